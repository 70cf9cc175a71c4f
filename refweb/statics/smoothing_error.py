"""Errors of smoothing in statics, from equilibria with less smoothing.

With the smooth law, results differ from those of η → 0 in proportion to η. An equilibrium with a tenth of η, found from
the same state, shows nine tenths of this difference.

May change: the insides of `Smoothing`. Must stay: values and errors come in the order of the scene's observables, then
of ``more``, as `statics.simulation` gives and reads them; the share of η is `results.error_budget.SMOOTHING_SHARE`.
Tests: ``tests/dynamics/test_accuracy.py``.
"""

from __future__ import annotations

from ..errors import SolverError
from ..results.error_budget import SMOOTHING_SHARE
from ..results.state import State
from ..system.static_system import at_rest
from .newton import Newton


class Smoothing:
    """Equilibria of a static scene with `SMOOTHING_SHARE` of its smoothing, and the errors that follow.

    Parameters
    ----------
    scene : refweb.Scene
        The scene.
    more : sequence of refweb.results.observables.observable.Observable
        Further observables whose errors follow those of the scene's observables.
    """

    def __init__(self, scene, more=()):
        self._observables = [*(o.observable for o in scene.observables), *more]
        self._system = scene.replace(cable=scene.cable.with_smoothing(SMOOTHING_SHARE)).build()
        self._newton = Newton(at_rest(self._system))

    def errors(self, equilibrium, values):
        """Difference of each value in an equilibrium from the value at η → 0; None where that was not found."""
        try:
            equilibrium_near = self._newton.solve(equilibrium.step, equilibrium.x, warm=True, limit=60)
        except SolverError:
            return [None] * len(values)
        state = State(self._system, equilibrium_near.step, equilibrium_near.x)
        values_near = [o.of(state).value for o in self._observables]
        rest = 1.0 - SMOOTHING_SHARE
        return [abs(value - value_near) / rest for value, value_near in zip(values, values_near, strict=True)]
