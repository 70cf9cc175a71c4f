"""Check if lines have come to the middle of a body in a step of any method, on its interpolant.

Pieces of steps are taken as `refweb.dynamics.integrators.line_line_ccd` takes them. What points of a body move by as
it turns is at most twice the difference of its quaternions times their distance from its place.
"""

from __future__ import annotations

import numpy as np

from .crossings import THROUGH
from .line_line_ccd import FollowedLines


class FollowedBodies(FollowedLines):
    """Follows lines that bodies push.

    Parameters
    ----------
    system : refweb.system.system.System
        What acts.
    """

    def __init__(self, system):
        super().__init__(system)
        self._terms = [term for term in system.terms if term.contact.passing is not None]
        self._places = system.rows - system.net.spins
        turning = [body for body in system.net.bodies if body.turn is not None]
        self._rows = np.array([(body.spin, body.turn) for body in turning], dtype=np.int64).reshape(-1, 2)
        self._extent = np.array([body.extent for body in turning])

    def inspect(self, course, piece, at):
        """Note in a course what may have met in a piece of a step; ``at`` gives the displacement at a time within."""
        for term in self._terms:
            self._record(course, piece, at, THROUGH, (term.contact.passing, term.cells, term.data))

    def _turned(self, path):
        """Largest movement of points of bodies as these turn [m]."""
        if not len(self._rows):
            return 0.0
        spin, turn = self._rows.T
        return float((2.0 * self._extent * np.hypot(np.linalg.norm(path[spin], axis=1), path[turn, 0])).max())
