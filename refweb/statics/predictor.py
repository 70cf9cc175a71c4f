"""Start of the next load step: extrapolation of the last equilibria.

The displacement of a flat web under a load F is proportional to F^(1/3): its tension grows with the square of the
displacement, and the load with the product of both. The displacement of a prestressed web is proportional to F. Both
powers are tried with the last two equilibria and, where the loads are 0 at load step 0, with the last one alone. The
candidate of least energy is taken; the last equilibrium itself is one of them.

May change: `POWERS` and other candidates: they change numbers of factorizations alone. Must stay: `predicted` is called
by `load_steps` under dead loads where no line pushes; among the candidates is the last ``x``, which is returned as the
same array. Tests: ``tests/statics/test_reused_factorization.py``.
"""

from __future__ import annotations

import numpy as np

POWERS = (1.0, 1.0 / 3.0)
"""Powers of the load step to which displacements may be proportional."""


def predicted(system, t, states):
    """Displacement [m] that load step t starts from, shape (rows, 3).

    Parameters
    ----------
    system : refweb.system.system.System
        System under dead loads, so that the candidate of least energy is the best.
    t : float
        The load step.
    states : list of refweb.statics.equilibrium.Equilibrium
        Equilibria of the load steps before, in order.
    """
    last = states[-1]
    start, lowest = last.x, _energy(system, t, last.x)
    before = [(0.0, np.zeros_like(last.x)), *((state.step, state.x) for state in states[-2:-1])]
    for step, x in before:
        if not min(t, last.step) > 0.0 or step == last.step:
            continue
        for power in POWERS:
            share = (t**power - last.step**power) / (last.step**power - step**power)
            trial = last.x + share * (last.x - x)
            energy = _energy(system, t, trial)
            if energy < lowest:
                start, lowest = trial, energy
    return start


def _energy(system, t, x):
    """Energy with prescribed motions at load step t [J]."""
    x = x.copy()
    system.drive(t, x)
    return system.energy(t, x)
