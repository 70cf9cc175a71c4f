"""Check if bodies have come to the middle of each other in a step of any method, on its interpolant.

Pieces of steps are taken as `refweb.dynamics.integrators.line_line_ccd` takes them. In a piece two bodies come nearer
by no more than their places do, and what points of either move by as it turns. Where that and their depth at its start
together are less than the least distance from a middle to its surface, or less than what the balls around both are
apart, neither passes the other.
"""

from __future__ import annotations

import numpy as np

from .crossings import PAIRS
from .line_line_ccd import Followed

TRAVEL = 0.2
"""Largest share of that distance that bodies may come nearer by in a step, or half of what the balls are apart."""


class FollowedPairs(Followed):
    """Follows bodies that push each other.

    Parameters
    ----------
    system : refweb.system.system.System
        What acts.
    """

    def __init__(self, system):
        self._terms, self._net = [term for term in system.terms if term.contact.pairs], system.net

    def soon(self, x, v):
        """Time in which no body comes much nearer to another from displacement x and velocity v [s]."""
        time = np.inf
        for pair in (pair for term in self._terms for pair in term.contact.pairs):
            body_a, body_b = pair
            speed = np.linalg.norm(v[body_a.row] - v[body_b.row]) + sum(
                body.extent * np.linalg.norm(body.turning(x, v)) for body in pair if body.turn is not None
            )
            if speed > 0.0:
                time = min(time, max(TRAVEL * _thickness(pair), 0.5 * self._apart(pair, x)) / speed)
        return time

    def inspect(self, course, piece, at):
        """Note in a course the first pair that may have met in a piece of a step."""
        for term in self._terms:
            self._record(course, piece, at, PAIRS, term)

    def _margin(self, bend):
        return bend

    def _met(self, looked_at, x, path, margin):
        term, still = looked_at, np.zeros_like(x)
        deep = np.zeros((len(term.cells), term.columns))
        term.force(0.0, x, still, np.zeros_like(x), term.cells, term.data, deep)
        for pair, (depth, *_) in zip(term.contact.pairs, deep, strict=True):
            nearer = self._nearer(pair, path) + self._nearer(pair, margin)
            if not (depth + nearer < _thickness(pair) or nearer < self._apart(pair, x)):
                body_a, body_b = pair
                return np.array([body_a.row, body_b.row, -1, -1])
        return None

    def _nearer(self, pair, path):
        """Largest decrease of the distance of two bodies along a path [m]."""
        body_a, body_b = pair
        turned = sum(
            2.0 * body.extent * np.hypot(np.linalg.norm(path[body.spin]), path[body.turn, 0])
            for body in pair
            if body.turn is not None
        )
        return float(np.linalg.norm(path[body_a.row] - path[body_b.row]) + turned)

    def _apart(self, pair, x):
        """Distance of the balls around two bodies [m], below 0 where they overlap."""
        body_a, body_b = pair
        places = [self._net.points[body.row] + x[body.row] for body in pair]
        return float(np.linalg.norm(places[0] - places[1])) - body_a.extent - body_b.extent


def _thickness(pair):
    """Least distance from the middle of either to its surface [m]."""
    return min(body.thickness for body in pair)
