"""Penetration check of statics: lines that lie deep in lines, or meet between two equilibria.

Statics has no motion between two equilibria, so each point is taken to move in a straight line. Two lines that meet in
this way have passed through each other or have slid around each other. The load steps do not tell which; smaller ones
may.

May change: words of ``why`` and `UNFOLLOWED`. Must stay: `record` takes equilibria in their order, from
`statics.simulation`, which writes ``why`` and ``deepest`` to ``run.json`` and to a finding; `LinePassage`, which
`simulation` imports. Tests: ``tests/effects/test_self_contact.py``.
"""

from __future__ import annotations

import numpy as np

from ..effects.self_contact.penetration import Passage, lines_of, pressed
from ..kernels import ALL_DUE

UNFOLLOWED = "what moves between load steps is not followed"


class LinePassage:
    """Follows lines that touch lines from one equilibrium to the next.

    Parameters
    ----------
    system : refweb.system.system.System
        System with a force term of lines against lines.
    chosen : bool
        True if refweb chose the stiffness.

    Attributes
    ----------
    deepest : refweb.effects.self_contact.penetration.Passage
        The deepest overlap.
    why : str
        Reason why it is not certain that no line has passed through another.
    """

    def __init__(self, system, chosen):
        self._system, self._term = system, system.terms[pressed(system)]
        self._x = np.zeros((system.rows, 3)) if system.laid is None else system.laid
        self.deepest, self.why = Passage(system, UNFOLLOWED, chosen), UNFOLLOWED

    def record(self, state):
        """Take the next equilibrium, a `refweb.results.state.State`; check its overlaps and the path to it.

        Raises
        ------
        PenetrationError
            For an overlap above the limit, where refweb chose the stiffness.
        SolverError
            For an overlap above the limit, where the scene gives the stiffness.
        """
        term, still = self._term, np.zeros((self._system.rows, 3))
        depth = np.zeros((len(term.cells), 1))
        term.force(state.time, state.x, still, np.zeros_like(still), term.cells, term.data, depth)
        if len(depth):
            cell = int(depth.argmax())
            self.deepest.record(float(depth[cell, 0]), None)
            self.deepest.refuse(float(depth[cell, 0]), f"load step {state.time:g}", cell)
        met, path = np.zeros(4, dtype=np.int64), state.x - self._x
        numbers = 0.0, 0.0, 0.0, 1.0, self._x, path, still, still, term.cells, term.data, ALL_DUE, met
        if self.why == UNFOLLOWED and term.contact.crossing.meets(*numbers):
            self.why = (
                f"{lines_of(self._system.net, met)} meet on their straight ways to load step {state.time:g}; smaller "
                "load_steps may tell whether they pass or slide around each other"
            )
        self._x = state.x
