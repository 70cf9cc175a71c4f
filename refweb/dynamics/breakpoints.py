"""Cost of the breakpoints of tables: steps end at each, and more breakpoints than steps set the step.

May change: `TOLD` and the words of the finding. Must stay: `remarks_on_corners`, which `simulation` and ``refweb
check`` call; integrators whose steps have a bound bring `steps_in`; of others the finding says the number of
breakpoints alone. No number of a result depends on this file. Tests: ``tests/dynamics/test_corners.py``.
"""

from __future__ import annotations

import numpy as np

from ..findings import Finding
from ..registry import INTEGRATORS
from .schedule import FEW_CORNERS, row_times

TOLD = 1.5
"""Least factor on the number of steps that a finding reports."""


def remarks_on_corners(scene, system):
    """Warn that breakpoints of tables shorten the steps of a run: a list of at most one finding.

    Parameters
    ----------
    scene : refweb.Scene
        Scene with a method that is not "auto".
    system : refweb.system.system.System
        The system.
    """
    end = scene.solve.duration
    corners = system.corners
    corners = corners[(corners > 0.0) & (corners < end)]
    if len(corners) <= FEW_CORNERS:
        return []
    apart = f"steps end at {len(corners)} corners of time tables, {end / len(corners):.3g} s apart on average"
    integrator = INTEGRATORS[scene.solve.method].integrator_of(scene.solve, system)
    if not hasattr(integrator, "steps_in"):
        return [Finding("tables", f"{apart}: {scene.solve.method} takes at least as many steps")]
    rows = row_times(scene)
    plain = integrator.steps_in(np.diff(rows)).sum()
    steps = integrator.steps_in(np.diff(np.union1d(rows, corners))).sum()
    if len(corners) < plain and steps < TOLD * plain:
        return []
    work = f"{steps / plain:.3g} times the work"
    text = f"{apart}: {steps:.3g} steps, where stability and rows need {plain:.3g}, {work}"
    return [Finding("tables", text)]
