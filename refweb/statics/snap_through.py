"""Check if a web of lines that can push may turn over, and have another equilibrium on another side.

Such a web snaps through a state in which lines push. Which side of that an equilibrium is on, its own tensions do not
say: pushed on the near side, the lines pull on the far one. So the web is looked at where unit tensions alone would
hold it, Σ (y_i − y_j)/L = 0 at each node between the supports as they stand, which depends on no load and no side.
Where all lines are at least as long there as by nature, the supports keep them stretched, and the web is taken to have
no other side; where some are shorter, it may have one.
"""

from __future__ import annotations

import numpy as np

from ..net.tension_laws import LINEAR
from ..system.factorization import Factor

SHORTER = 1e-9
"""Strain below which a line is shorter than by nature beyond rounding."""


def may_turn_over(rest, equilibrium):
    """Tell if lines that push without limit, as bars do, push in an equilibrium, or might in another.

    Parameters
    ----------
    rest : refweb.system.system.System
        As statics sees it.
    equilibrium : refweb.statics.equilibrium.Equilibrium
        Where it is.
    """
    net = rest.at(equilibrium.step).net
    bars = net.laws == LINEAR
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
