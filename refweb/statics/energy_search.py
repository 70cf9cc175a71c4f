"""Line search down the energy, for forces with a potential.

Differences of the energy become smaller than rounding near the end. Then the slope, force times step, is compared
instead.

May change: constants and the rule of the search: they decide how many steps `newton` takes; what counts as an
equilibrium, the residual decides. Must stay: arguments and answer of `along`, the same as those of
`residual_search.ResidualSearch.along`, since `newton` calls either; each step goes down in energy; `EnergySearch`,
which `newton` imports. Tests: ``tests/statics/test_statics.py``.
"""

from __future__ import annotations

import numpy as np

LONGEST, HALVINGS, ROUNDING = 0.1, 30, 1e-14
"""First move in a direction of negative curvature, over the shortest natural length; number of times that it is halved;
fall of the energy, over the energy, that is more than rounding."""


class EnergySearch:
    """Searches along the steps of one iteration; keeps the energy between them.

    Parameters
    ----------
    system : refweb.system.system.System
        System whose forces have a potential.
    t : float
        Load step.
    x : ndarray, shape (rows, 3)
        Displacement at the start of the iteration [m].
    """

    def __init__(self, system, t, x):
        self._system, self._t, self._energy = system, t, system.energy(t, x)

    def along(self, p, x, r, shift, stats):
        """Take a step, or a part of it.

        Parameters
        ----------
        p : ndarray, shape (unknowns,)
            The step [m].
        x : ndarray, shape (rows, 3)
            Displacement [m].
        r : ndarray, shape (unknowns,)
            Force there [N]; r·p > 0.
        shift : float
            Prestress τ of the tangent that p comes from [N].
        stats : dict
            Its ``nfev`` grows by the number of evaluations.

        Returns
        -------
        x : ndarray, shape (rows, 3)
            Displacement after the step [m].
        shift : float
            The next τ [N]: smaller after a step that its model has predicted well, larger after a step that was cut.
        """
        system, slope, energy = self._system, r @ p, self._energy
        step, drowned = system.rows_of(p), 0.5 * slope < 1e-9 * abs(energy)
        longest = a = system.largest_share(p)
        for _ in range(40):
            y = system.moved(x, a * step)
            self._energy = system.energy(self._t, y)
            stats["nfev"] += 1
            if drowned:
                derivative = system.force(self._t, y).ravel()[system.free] @ p
                if derivative >= -0.9 * slope:
                    break
                a *= 0.5
                continue
            rise = self._energy - energy + a * slope
            if self._energy <= energy - 1e-4 * a * slope:
                break
            a *= min(max(0.5 * a * slope / rise, 0.1), 0.5) if np.isfinite(rise) else 0.1
        if a < longest:
            return y, 2.0 * shift
        good = longest == 1.0 and (drowned or energy - self._energy > 0.25 * 0.5 * slope)
        return y, 0.1 * shift if good else shift

    def down(self, d, x, r, stats):
        """Move along a direction d of negative curvature, in which the energy falls either way from a saddle.

        Parameters
        ----------
        d : ndarray, shape (unknowns,)
            Direction [m].
        x, r, stats
            As for `along`; the force r may be 0.

        Returns
        -------
        ndarray, shape (rows, 3)
            Displacement after the longest of halved moves that lowers the energy by more than rounding; x where none
            does.
        """
        system = self._system
        step = system.rows_of(d if r @ d >= 0.0 else -d)
        a = system.largest_share(d) * LONGEST * system.net.natural_length.min() / np.abs(step).max()
        for _ in range(HALVINGS):
            y = system.moved(x, a * step)
            energy = system.energy(self._t, y)
            stats["nfev"] += 1
            if energy < self._energy - ROUNDING * abs(self._energy):
                self._energy = energy
                return y
            a *= 0.5
        return x
