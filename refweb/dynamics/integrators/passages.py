"""Penetration check of lines and bodies in a step of any method, on its dense output.

A piece of a step is known at its start, in its middle and at its end. Between these, rows are taken to move in straight
lines, as in the drift of an explicit step, and the same kernels check what may meet, see
`refweb.dynamics.integrators.ccd`. Unlike a drift, a piece is not rejected: it is halved, up to `HALVINGS` times, while
it is not certain that nothing meets. Two rows may come nearer than on straight paths by their distance from these paths
in the middle; a parabola leaves half of that open.

By a rotation, points of a body move at most by twice the difference of its quaternions times their distance from its
position. Two bodies approach at most by the approach of their positions plus the motion of points of each by rotation.
Neither passes through the other if this approach plus their depth at the start is less than the least distance from a
middle to its surface, or if the approach is less than the distance of the spheres around both.

May change: `HALVINGS`, upwards, and how pieces are halved. Must stay: bounds of motion may be too large, never too
small; checks are those of `crossings.checks_of`, and rows of ``crossings`` its kinds; `step_limits` calls `soon`, and
`step_observer` calls `inspect`. `TRAVEL` bounds the steps of all methods with tolerances. Must stay as well:
`Passages`, which `step_limits` imports. Tests: ``tests/effects/test_passage.py``, ``test_between_bodies.py``.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from ...effects.base import pairs_of
from ...kernels import ALL_DUE, kernel
from .crossings import PAIRS, THROUGH, checks_of, note_met

HALVINGS = 10
"""Largest number of times that a piece is halved where it is not certain that nothing meets."""
TRAVEL = 0.2
"""Largest share of a body's thickness that anything may move in a step, so that nothing passes through; where bodies
are further away, half of that distance."""


class Position(NamedTuple):
    """Positions of all rows: time [s], and displacement [m], shape (rows, 3)."""

    time: float
    x: np.ndarray


class Passages:
    """The lines and bodies of a system that push each other.

    Parameters
    ----------
    system : refweb.system.system.System
        The system.
    position : callable
        Displacement of all rows [m], shape (rows, 3), at a time within the last step.
    """

    def __init__(self, system, position):
        self._terms, self._net, self._position = system.terms, system.net, position
        self._still, self._rows_met = np.zeros((system.rows, 3)), np.zeros(4, dtype=np.int64)
        self._checks, self._pairs = checks_of(system), pairs_of(system)

    def soon(self, x, v):
        """Time in which no line comes through another, and no body much nearer to another, from a state [s]."""
        lines = (term for term in self._terms if term.contact.crossing is not None)
        times = [term.contact.crossing.soon(x, v, term.cells, term.data) for term in lines]
        for pair in self._pairs:
            speed = np.linalg.norm(np.subtract(*(v[body.row] for body in pair))) + sum(
                body.extent * np.linalg.norm(body.turning(x, v)) for body in pair if body.turn is not None
            )
            if speed > 0.0:
                times.append(max(TRAVEL * _thickness(pair), 0.5 * self._apart(pair, x)) / speed)
        return min(times, default=np.inf)

    def inspect(self, course, piece):
        """Note in a course the first of each kind that may have met in a piece of a step."""
        for check in self._checks:
            if not np.isfinite(course.crossings[check.kind, 0]):
                met = partial(self._pair_met if check.kind == PAIRS else self._lines_met, check)
                meeting = self._first(met, piece.start, piece.middle, piece.end, HALVINGS)
                if meeting is not None:
                    note_met(check.kind, *meeting, course.crossings)

    def _first(self, met, begin, middle, end, halvings):
        """(Time from which on two may have met [s], their rows), None where none have."""
        bend = middle.x - 0.5 * (begin.x + end.x)
        for first, last in ((begin, middle), (middle, end)):
            rows = met(first.x, last.x - first.x, bend)
            if rows is None:
                continue
            if not halvings:
                return first.time, rows
            halfway = 0.5 * (first.time + last.time)
            meeting = self._first(met, first, Position(halfway, self._position(halfway)), last, halvings - 1)
            if meeting is not None:
                return meeting
        return None

    def _lines_met(self, check, x, path, bend):
        """Rows of lines, or of a line and a body, that may have met on a way; None where none can have."""
        bodies = self._net.bodies if check.kind == THROUGH else ()
        places = len(self._net.points) - self._net.spins if bodies else self._net.nodes
        turned = sum(max((turned_by(body, moved) for body in bodies), default=0.0) for moved in (path, bend))
        margin, largest, still = float(spread(bend, places) + turned), 2.0 * spread(path, places), self._still
        drift = margin, largest, 0.0, 1.0, x, path, still, still
        came = check.kernel(*drift, check.cells, check.data, ALL_DUE, self._rows_met)
        return self._rows_met if came else None

    def _pair_met(self, check, x, path, bend):
        """Rows of two bodies that may have come to the middle of one of them on a way; None where none can have."""
        term = self._terms[check.term]
        deep = np.zeros((len(check.cells), term.columns))
        check.kernel(0.0, x, self._still, np.zeros_like(x), check.cells, check.data, deep)
        for pair, (depth, *_) in zip(term.contact.pairs, deep, strict=True):
            nearer = _nearer(pair, path) + _nearer(pair, bend)
            if not (depth + nearer < _thickness(pair) or nearer < self._apart(pair, x)):
                return np.array([pair[0].row, pair[1].row, -1, -1])
        return None

    def _apart(self, pair, x):
        """Distance of the balls around two bodies [m], below 0 where they overlap."""
        first, second = (self._net.points[body.row] + x[body.row] for body in pair)
        return float(np.linalg.norm(first - second)) - pair[0].extent - pair[1].extent


@kernel()
def spread(path, count):
    """Largest distance of the first rows from the first of them [m]."""
    square = 0.0
    for r in range(1, count):
        a, b, c = path[r, 0] - path[0, 0], path[r, 1] - path[0, 1], path[r, 2] - path[0, 2]
        square = max(square, a * a + b * b + c * c)
    return math.sqrt(square)


def turned_by(body, path):
    """Largest movement of points of a body as it turns [m]."""
    return (
        0.0 if body.turn is None else 2.0 * body.extent * np.hypot(np.linalg.norm(path[body.spin]), path[body.turn, 0])
    )


def _nearer(pair, path):
    """Largest decrease of the distance of two bodies along a path [m]."""
    moved = np.linalg.norm(path[pair[0].row] - path[pair[1].row])
    return float(moved + sum(turned_by(body, path) for body in pair))


def _thickness(pair):
    """Least distance from the middle of either to its surface [m]."""
    return min(body.thickness for body in pair)
