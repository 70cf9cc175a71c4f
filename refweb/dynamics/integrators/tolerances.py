"""Scales of the tolerances of displacements and velocities where the state itself is near zero.

May change: nothing without a reason: default tolerances follow from these scales, so that others change steps and
digits of all methods with rtol, within ±. Must stay: `scales` gives (displacement [m], velocity [m/s]) to `ida`,
`step_observer` and `studies.dop853`. The help of ``atol_position`` in `settings.Dynamic` says the same in words. Tests:
``tests/dynamics/integrators/test_cvode.py``.
"""

from __future__ import annotations

import numpy as np


def scales(system):
    """Displacement [m] and velocity [m/s] of which rtol is the absolute tolerance.

    A strain of 1e-3 in the shortest element, and the velocity at which its ends take that up: 1e-3 of the speed of
    sound in the fastest element.
    """
    net, length = system.net, system.natural_length(0.0)
    mass = np.maximum(np.bincount(net.cells.ravel(), minlength=system.rows), 1)
    light = np.where(net.mass > 0.0, net.mass, np.inf) / mass
    lightest = light[net.cells].min(axis=1)
    rate = np.sqrt(net.line_data.ea / length / np.where(np.isfinite(lightest), lightest, np.inf)).max(initial=0.0)
    near = 1e-3 * length.min()
    return near, near * rate if rate > 0.0 else near
