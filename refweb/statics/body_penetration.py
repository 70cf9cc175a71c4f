"""Penetration check of statics: lines that pass through bodies between two equilibria.

Statics has no motion between two equilibria, so each point is taken to move in a straight line. A line that moves
through the core of a body in this way has passed through the body or has slid around it. The load steps do not tell
which; smaller ones would.

`statics.simulation` and, for a start at an equilibrium, `dynamics.simulation` use `Passage`, and `record` takes
equilibria in their order.
"""

from __future__ import annotations

import math

import numpy as np

from ..effects.base import pairs_of
from ..effects.contact.overlap import CORE, Overlaps
from ..errors import SolverError
from ..results.state import State
from ..system.static_system import waiting

PARTS = 8
"""Number of positions that are checked on a path as long as a body is thick."""
MOST = 64
"""Largest number of nodes around whose nearest approach to a body positions are checked."""


class Passage:
    """Follows how deep lines are in bodies from one equilibrium to the next.

    Parameters
    ----------
    scene : refweb.Scene
        With a stiffness of contact for each body.
    system : refweb.system.system.System
        System of the scene.
    x : ndarray, shape (rows, 3), optional
        Displacement before the first equilibrium [m], by default zero.

    Attributes
    ----------
    overlaps : refweb.effects.contact.overlap.Overlaps
        The deepest contact of each body.
    """

    def __init__(self, scene, system, x=None):
        settled, pairs = scene.settled(), None
        if pairs_of(system):
            from ..effects.contact.pair_overlap import PairOverlaps

            pairs = PairOverlaps(settled.contact, settled.chosen, system, moving=False)
        self._system, self.overlaps = system, Overlaps(settled, system, moving=False, pairs=pairs)
        self._waiting = [body.row for body in waiting(system)]
        self._x = np.zeros((system.rows, 3)) if x is None else x

    def record(self, state):
        """Take the next equilibrium, a `refweb.results.state.State`, and check the path that leads there.

        Raises
        ------
        SolverError
            For a line whose path leads through the core of a body.
        """
        net = self._system.net
        for i, body in enumerate(net.bodies):
            if body.row not in self._waiting:
                deep = state.overlap(body)
                at = int(deep.argmax())
                self.overlaps.record(i, float(deep[at]), state.time, int(net.line[at]))
                self._look_back(body, deep, state)
        if (pairs := self.overlaps.pairs) is not None:
            for i, depth in enumerate(state.pair_overlaps):
                if not {body.row for body in pairs.deepest[i].bodies} & {*self._waiting}:
                    pairs.record(i, float(depth), state.time)
        self._x = state.x

    def _looks(self, body, path):
        """Shares of a path (rows, 3) at which lines may be deepest: around the nearest approach of nodes to a body."""
        net = self._system.net
        position, shift = net.points + self._x, path[: net.nodes] - path[body.row]
        begin = position[: net.nodes] - position[body.row]
        length = np.linalg.norm(shift, axis=1)
        moved = np.flatnonzero(PARTS * length > body.thickness)
        begin, shift, length = begin[moved], shift[moved], length[moved]
        nearest = np.clip(-(begin * shift).sum(axis=1) / length**2, 0.0, 1.0)
        order = np.argsort(np.linalg.norm(begin + nearest[:, None] * shift, axis=1))[:MOST]
        step = body.thickness / (PARTS * length[order])
        around = nearest[order, None] + step[:, None] * np.arange(-PARTS, PARTS + 1)
        return np.unique(around[(around > 0.0) & (around < 1.0)])

    def _look_back(self, body, deep, state):
        """Check the path that leads to an equilibrium."""
        system, path = self._system, state.x - self._x
        looks = self._looks(body, path) if math.isfinite(body.thickness) else []
        before = State(system, state.time, self._x).overlap(body) if len(looks) else deep
        ends = np.maximum(np.maximum(deep, before), CORE * body.thickness)
        for share in looks:
            overlap = State(system, state.time, self._x + share * path).overlap(body)
            if ((passed := overlap - ends) > 1e-9 * body.thickness).any():
                line = system.net.line[int(passed.argmax())]
                raise SolverError(
                    f'line {line} passes the core of body "{body.name}" on its way to load step {state.time:g}: it '
                    "slid around, or the solver went through, or contact is too weak; take smaller load_steps, or a "
                    f"larger stiffness than {self.overlaps.stiffness_of(body):g}"
                )
