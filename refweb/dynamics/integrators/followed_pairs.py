"""Whether bodies have come to the middle of each other in a step of any method, on its interpolant.

Pieces of steps are taken as `refweb.dynamics.integrators.followed_lines` takes them. In a piece two bodies come nearer
by no more than their places do, and what points of either move by as it turns. Where that and their depth at its start
together are less than the least distance from a middle to its surface, or less than what the balls around both are
apart, neither passes the other.
"""

from __future__ import annotations

import numpy as np

from .crossings import PAIRS, note_met
from .followed_bodies import FollowedBodies
from .followed_lines import HALVINGS, Place

TRAVEL = 0.2
"""Largest share of that distance that bodies may come nearer by in a step, or half of what the balls are apart."""


class FollowedPairs(FollowedBodies):
    """Follows bodies that push each other.

    Parameters
    ----------
    system : refweb.system.system.System
        What acts.
    """

    def __init__(self, system):
        super().__init__(system)
        self._families = [family for family in system.families if family.pairs]
        self._net = system.net

    def soon(self, x, v):
        """Time in which no body comes much nearer to another from displacement x and velocity v [s]."""
        time = np.inf
        for pair in (pair for family in self._families for pair in family.pairs):
            one, other = pair
            speed = np.linalg.norm(v[one.row] - v[other.row]) + sum(
                body.extent * np.linalg.norm(body.turning(x, v)) for body in pair if body.turn is not None
            )
            if speed > 0.0:
                time = min(time, max(TRAVEL * _thickness(pair), 0.5 * self._apart(pair, x)) / speed)
        return time

    def look(self, course, piece, at):
        """Note in a course the first pair that may have met in a piece of a step."""
        if np.isfinite(course.crossings[PAIRS, 0]):
            return
        begin = Place(course.time, course.x)
        middle, end = (Place(sample.time, sample.x) for sample in (piece.middle, piece.end))
        for family in self._families:
            found = self._first(family, begin, middle, end, at, HALVINGS)
            if found is not None:
                time, (one, other) = found
                note_met(PAIRS, time, np.array([one.row, other.row, -1, -1]), course.crossings)
                return

    def _first(self, family, begin, middle, end, at, halvings):
        """(Time from which on two may have met [s], both), None where none have."""
        bend = middle.x - 0.5 * (begin.x + end.x)
        for first, last in ((begin, middle), (middle, end)):
            pair = self._open(family, first.x, last.x - first.x, bend)
            if pair is None:
                continue
            if not halvings:
                return first.time, pair
            halfway = 0.5 * (first.time + last.time)
            found = self._first(family, first, Place(halfway, at(halfway)), last, at, halvings - 1)
            if found is not None:
                return found
        return None

    def _open(self, family, x, way, bend):
        """A pair of which it is not certain that it stays apart on a way from displacement x, None where it is."""
        deep, still = np.zeros((len(family.cells), family.observed)), np.zeros_like(x)
        family.force(0.0, x, still, np.zeros_like(x), family.cells, family.data, deep)
        for pair, (depth, *_) in zip(family.pairs, deep, strict=True):
            nearer = sum(self._nearer(pair, one) for one in (way, bend))
            if not (depth + nearer < _thickness(pair) or nearer < self._apart(pair, x)):
                return pair
        return None

    def _nearer(self, pair, way):
        """By how much two bodies come nearer on a way, at most [m]."""
        one, other = pair
        turned = sum(
            2.0 * body.extent * np.hypot(np.linalg.norm(way[body.spin]), way[body.turn, 0])
            for body in pair
            if body.turn is not None
        )
        return float(np.linalg.norm(way[one.row] - way[other.row]) + turned)

    def _apart(self, pair, x):
        """What the balls around two bodies are apart [m], below 0 where they overlap."""
        one, other = pair
        places = [self._net.points[body.row] + x[body.row] for body in pair]
        return float(np.linalg.norm(places[0] - places[1])) - one.extent - other.extent


def _thickness(pair):
    """Least distance from the middle of either to its surface [m]."""
    return min(body.thickness for body in pair)
