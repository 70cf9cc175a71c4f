"""Line search for forces without a potential: a step is cut until it makes the next step shorter.

Follower loads have no energy that a line search could lower. A part a of the step p = J⁻¹r, with the tangent J and its
prestress, is taken if |J⁻¹r(x + ap)| < |p|. This is the natural monotonicity test [1]_: a residual in units of
displacement, which depends neither on the scale of forces nor on that of stiffnesses.

May change: how far and how often a step is cut: that decides how many steps `newton` takes; what counts as an
equilibrium, the residual decides. Must stay: arguments and answer of `along`, the same as those of
`energy_search.EnergySearch.along`, since `newton` calls either; `ResidualSearch`, which `newton` imports. Tests:
``tests/effects/test_follower_loads.py``, ``test_winch.py``.

References
----------
.. [1] P. Deuflhard, "Newton Methods for Nonlinear Problems", Springer 2011, section 2.1, doi:10.1007/978-3-642-23899-4.
"""

from __future__ import annotations

import numpy as np


class ResidualSearch:
    """Searches along the steps of one iteration; see `refweb.statics.energy_search.EnergySearch`.

    Parameters
    ----------
    system : refweb.system.system.System
        System of the iteration.
    factor : refweb.system.factorization.Lu
        Factorization of the tangent of each step.
    t : float
        Load step.
    """

    def __init__(self, system, factor, t):
        self._system, self._factor, self._t = system, factor, t

    def along(self, p, x, r, shift, stats):
        """Search as `EnergySearch.along`, for the first a = 1, 1/2, ... that makes the next step shorter."""
        system, size, step = self._system, np.linalg.norm(p), self._system.rows_of(p)
        a = system.largest_share(p)
        for _ in range(40):
            y = system.moved(x, a * step)
            ahead = self._factor.solve(system.force(self._t, y).ravel()[system.free])
            stats["nfev"] += 1
            length, along = (np.inf, 0.0) if ahead is None else (np.linalg.norm(ahead), ahead @ p)
            if length < size or (length < 2.0 * size and along > 0.9 * length * size):
                break
            a *= 0.5
        if a < 1.0:
            return y, 4.0 * shift
        return y, 0.1 * shift if along > 0.0 or length < 0.25 * size else shift
