"""Start of the next load step: the last equilibria, extrapolated.

The displacement of a flat web under a load F goes with F^(1/3), as tension goes with its square and the load with both;
that of a prestressed web with F. Both are tried, from the last two equilibria and, where the loads are 0 at load step
0, from the last one alone. What has the least energy is taken, if need be the last equilibrium as it is.
"""

from __future__ import annotations

import numpy as np

POWERS = (1.0, 1.0 / 3.0)
"""Of the load step, with which displacements may go."""


def predicted(system, t, states):
    """Displacement [m] that load step t starts from, shape (rows, 3).

    Parameters
    ----------
    system : refweb.system.system.System
        Under dead loads, so that the least energy is nearest.
    t : float
        The load step.
    states : list of refweb.statics.equilibrium.Equilibrium
        Those before, the last one last.
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
    """Energy with what moves as prescribed at load step t [J]."""
    x = x.copy()
    system.drive(t, x)
    return system.energy(t, x)
