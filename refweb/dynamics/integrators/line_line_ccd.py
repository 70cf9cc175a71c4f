"""Check if lines have met in a step of any method, on its interpolant.

A piece of a step is known at its start, in its middle and at its end. From each to the next rows are taken to move in
straight lines, and lines that come nearer than these leave open are not sure not to meet: two rows by as much as they
are off the straight way from start to end in the middle. A parabola leaves half of that open. Where lines come so near,
the piece is halved, up to `HALVINGS` times.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .crossings import APART, BESIDE, note_met

HALVINGS = 10
"""Largest number of times that a piece is halved where it is not certain that nothing meets."""


class Place(NamedTuple):
    """Positions of all rows: time [s], and displacement [m], shape (rows, 3)."""

    time: float
    x: np.ndarray


class Followed:
    """Looks at pieces of a step until nothing can have met in them, or they are too short."""

    # What a subclass brings

    def _margin(self, bend):
        """Free distance that a bend of the middle leaves."""
        raise NotImplementedError

    def _met(self, looked_at, x, path, margin) -> np.ndarray | None:
        """Rows of what may have met on a way from displacement x, None where nothing can have."""
        raise NotImplementedError

    # What is made of it

    def _record(self, course, piece, at, which, looked_at):
        """Note in a row of what has met the first that may have in a piece of a step."""
        if np.isfinite(course.crossings[which, 0]):
            return
        begin = Place(course.time, course.x)
        middle, end = (Place(sample.time, sample.x) for sample in (piece.middle, piece.end))
        meeting = self._first(looked_at, begin, middle, end, at, HALVINGS)
        if meeting is not None:
            note_met(which, *meeting, course.crossings)

    def _first(self, looked_at, begin, middle, end, at, halvings):
        """(Time from which on two may have met [s], their rows), None where none have."""
        margin = self._margin(middle.x - 0.5 * (begin.x + end.x))
        for first, last in ((begin, middle), (middle, end)):
            met = self._met(looked_at, first.x, last.x - first.x, margin)
            if met is None:
                continue
            if not halvings:
                return first.time, met
            halfway = 0.5 * (first.time + last.time)
            meeting = self._first(looked_at, first, Place(halfway, at(halfway)), last, at, halvings - 1)
            if meeting is not None:
                return meeting
        return None


class FollowedLines(Followed):
    """Follows lines that push each other, and their neighbours along the net.

    Parameters
    ----------
    system : refweb.system.system.System
        What acts.
    """

    def __init__(self, system):
        self._terms = [term for term in system.terms if term.contact.crossing is not None]
        self._places = system.net.nodes
        self._still, self._rows_met = np.zeros((system.rows, 3)), np.zeros(4, dtype=np.int64)

    def soon(self, x, v):
        """Time in which no line comes through another from displacement x and velocity v [s]."""
        return min((f.contact.crossing.soon(x, v, f.cells, f.data) for f in self._terms), default=np.inf)

    def inspect(self, course, piece, at):
        """Note in a course what may have met in a piece of a step; ``at`` gives the displacement at a time within."""
        for term in self._terms:
            crossing, beside = term.contact.crossing, (term.contact.crossing.rows, term.contact.crossing.data)
            for which, cells in ((APART, (term.cells, term.data)), (BESIDE, beside)):
                self._record(course, piece, at, which, (crossing.meets, *cells))

    def _margin(self, bend):
        return self._spread(bend) + self._turned(bend)

    def _met(self, looked_at, x, path, margin):
        meets, cells, data = looked_at
        open_, largest = margin + self._turned(path), 2.0 * self._spread(path)
        came = meets(open_, largest, 0.0, 1.0, x, path, self._still, self._still, cells, data, self._rows_met)
        return self._rows_met if came else None

    def _spread(self, path):
        """Largest distance of positions from the first [m]."""
        return float(np.linalg.norm(path[: self._places] - path[:1], axis=1).max(initial=0.0))

    def _turned(self, path):
        """Largest movement of points of turning bodies beside that [m]."""
        return 0.0
