"""Penetration check of statics: lines that pass through bodies between two equilibria.

Statics has no motion between two equilibria, so each point is taken to move in a straight line. A line that moves
through the core of a body in this way has passed through the body or has slid around it. Which of these it was tell the
iterates of Newton's method between the two, as far as they are kept, in which no body moves by more than half its
thickness at once; otherwise smaller load steps would.

May change: `PARTS` and `MOST`, upwards: fewer positions may miss a passage. Must stay: `Passage.record` takes
equilibria in their order, from `statics.simulation` and, for a start at an equilibrium, `dynamics.simulation`; both
read ``overlaps``. Tests: ``tests/effects/test_overlap.py``.
"""

from __future__ import annotations

import itertools
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

    def record(self, state, path=()):
        """Take the next equilibrium, a `refweb.results.state.State`, and check the way that leads there.

        That is straight, or along the displacements of all rows in a ``path`` [m], each near the next.

        Raises
        ------
        SolverError
            For a line whose way leads through the core of a body.
        """
        net, self.overlaps.edges = self._system.net, {}
        for i, body in enumerate(net.bodies):
            if body.row not in self._waiting:
                deep = state.overlap(body)
                at = int(deep.argmax())
                self.overlaps.record(i, float(deep[at]), state.time, int(net.line[at]))
                self._look_back(body, deep, state, path)
                self.overlaps.note_edge(body, state, deep)
        if (pairs := self.overlaps.pairs) is not None:
            for i, depth in enumerate(state.pair_overlaps):
                if not {body.row for body in pairs.deepest[i].bodies} & {*self._waiting}:
                    pairs.record(i, float(depth), state.time)
        self._x = state.x

    def _looks(self, body, begin, end):
        """Shares of a way at which lines may be deepest: around the nearest approach of nodes to a body."""
        net, path = self._system.net, end - begin
        position, shift = net.points + begin, path[: net.nodes] - path[body.row]
        from_body = position[: net.nodes] - position[body.row]
        length = np.linalg.norm(shift, axis=1)
        moved = np.flatnonzero(PARTS * length > body.thickness)
        from_body, shift, length = from_body[moved], shift[moved], length[moved]
        nearest = np.clip(-(from_body * shift).sum(axis=1) / length**2, 0.0, 1.0)
        order = np.argsort(np.linalg.norm(from_body + nearest[:, None] * shift, axis=1))[:MOST]
        step = body.thickness / (PARTS * length[order])
        around = nearest[order, None] + step[:, None] * np.arange(-PARTS, PARTS + 1)
        return np.unique(around[(around > 0.0) & (around < 1.0)])

    def _passing(self, body, ends, time, begin, end, looks):
        """The element that is deeper than at the ``ends`` at some shares of a way, None if none is."""
        for share in looks:
            overlap = State(self._system, time, begin + share * (end - begin)).overlap(body)
            if ((passed := overlap - ends) > 1e-9 * body.thickness).any():
                return int(passed.argmax())
        return None

    def _look_back(self, body, deep, state, path):
        """Check the way that leads to an equilibrium: straight, or else along the iterates of a ``path``."""
        looks = self._looks(body, self._x, state.x) if math.isfinite(body.thickness) else []
        if not len(looks):
            return
        before = State(self._system, state.time, self._x).overlap(body)
        ends = np.maximum(np.maximum(deep, before), CORE * body.thickness)
        element = self._passing(body, ends, state.time, self._x, state.x, looks)
        if element is not None and len(path):
            for begin, end in itertools.pairwise((self._x, *path, state.x)):
                looks = np.append(self._looks(body, begin, end), 1.0)
                if (element := self._passing(body, ends, state.time, begin, end, looks)) is not None:
                    break
        if element is not None:
            raise SolverError(
                f'line {self._system.net.line[element]} passes the core of body "{body.name}" on its way to load step '
                f"{state.time:g}: it slid around, or the solver went through, or contact is too weak; take smaller "
                f"load_steps, or a larger stiffness than {self.overlaps.stiffness_of(body):g}"
            )
