"""Errors that the solution of a scene does not show: of smoothing, and of elements.

With the smooth law results differ from those of η → 0 in proportion to η, so that a tenth of η, found from the same
state, shows nine tenths of that. Elements are judged by the same scene with every line in two and in four times as many
of them: where the first difference is q times the second, what is left after the first is q/(q − 1) times that.
"""

from __future__ import annotations

from dataclasses import replace

from ..errors import SolverError
from ..results.state import State
from ..settings import Accuracy

SHARE = 0.1
"""Smoothing that is compared with, over that of the scene."""
FINER = (2, 4)
"""Number of elements per line that are compared with, over that of the scene."""
SLOWEST, FASTEST = 1.5, 16.0
"""Bounds on q: slower is no convergence that could be relied on, and faster is chance."""


class Smoothing:
    """The equilibria of a static scene with `SHARE` of its smoothing, one for each that is asked for."""

    def __init__(self, scene):
        from .newton import Newton

        cable = scene.cable
        groups = {
            name: replace(group, smoothing=SHARE * group.smoothing) if group.smoothing is not None else group
            for name, group in cable.groups.items()
        }
        self._observables = scene.observables
        self._system = scene.replace(cable=replace(cable, smoothing=SHARE * cable.smoothing, groups=groups)).build()
        self._newton = Newton(self._system.at_rest())

    def errors(self, equilibrium, values):
        """Of each value in an equilibrium its distance from the value at η → 0; None where that was not found."""
        try:
            found = self._newton.solve(equilibrium.step, equilibrium.x, warm=True, most=60)
        except SolverError:
            return [None] * len(values)
        state = State(self._system, found.step, found.x)
        there = [o.value(state).value for o in self._observables]
        return [abs(here - other) / (1.0 - SHARE) for here, other in zip(values, there, strict=True)]


def discretisation_errors(scene, results, solve):
    """Results with the error of elements; those that do not converge have all that was seen as their error.

    Parameters
    ----------
    scene : refweb.Scene
        As it was solved.
    results : list of dict of str to refweb.results.observables.Result
        Of each load step, or of the motion.
    solve : callable
        Gives such a list of another scene.
    """
    found = [results]
    for times in FINER:
        cable = replace(scene.cable, subdivide=times * scene.cable.subdivide)
        found.append(solve(scene.replace(cable=cable, accuracy=Accuracy(error="none"))))
    return [
        {
            name: result._replace(discretisation=_left(*(step[name].value for step in steps)))
            for name, result in here.items()
        }
        for here, *steps in zip(results, *found, strict=True)
    ]


def _left(coarse, fine, finest):
    """Error of the first of three values."""
    first, second = abs(coarse - fine), abs(fine - finest)
    if second * SLOWEST > first:
        return 2.0 * max(first, second, abs(coarse - finest))
    ratio = min(first / second, FASTEST) if second > 0.0 else FASTEST
    return first * ratio / (ratio - 1.0)
