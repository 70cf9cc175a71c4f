"""Check if a web with bars may snap through to another equilibrium.

Such a web snaps through a state in which bars push. The tensions of an equilibrium do not tell on which side of that
state it is: bars that push on the near side pull on the far side. Therefore the check uses the configuration y in which
unit tensions balance between the supports, Σ (y_i − y_j)/L = 0 at each node. It depends on no load and on no side. If
no bar there is shorter than its natural length, the supports keep the bars stretched, and the web is taken to have no
other equilibrium. If a bar is shorter, it may have one.

May change: all inside of `may_turn_over`; its answer makes a finding and changes no number. Must stay: its name and
arguments, by which `stability` calls it, and the answer True where the check cannot be done. Tests:
``tests/statics/test_stability.py``.
"""

from __future__ import annotations

import numpy as np

from ..system.factorization import Factor

SHORTER = 1e-9
"""Compressive strain above which a bar counts as shorter than its natural length, beyond rounding."""


def may_turn_over(rest, equilibrium):
    """Tell if bars push in an equilibrium, or may push in another one.

    Parameters
    ----------
    rest : refweb.system.system.System
        The system of statics, see `refweb.system.static_system`.
    equilibrium : refweb.statics.equilibrium.Equilibrium
        The equilibrium.
    """
    net = rest.at(equilibrium.step).net
    bars = net.law_is("bar")
    if (bars & (equilibrium.tension < 0.0)).any() or rest.unsupported_parts or rest.resting:
        return True
    values = rest.at(equilibrium.step).across_lines(np.ones(len(net.cells)))
    factor = Factor(rest.pattern)
    factor.update(values)
    x = equilibrium.x.copy()
    x.ravel()[rest.free] = 0.0
    pull = -(net.bars.T @ (net.bar_vectors(x) / net.bar_lengths[:, None]))
    if (y := factor.solve(pull.ravel()[rest.free])) is None:
        return True
    x.ravel()[rest.free] = y
    strain = np.linalg.norm(net.bar_vectors(x), axis=1) / net.bar_lengths - 1.0
    return bool((strain[np.repeat(bars, len(net.weights))] < -SHORTER).any())
