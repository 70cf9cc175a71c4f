"""The largest stable step, by Gershgorin's bound on the largest frequency of what can act before the next row."""

from __future__ import annotations

import math

import numpy as np

from ...kernels import BOUND, kernel


@kernel()
def step_bound(reach, speed, x, mass, free, rates, bounds, viscous, dampings, cells, data):
    """Largest stable step [s], 2/ω (√(1 + ζ²) − ζ); infinite where nothing vibrates."""
    rates[:] = 0.0
    for i in range(len(bounds)):
        bounds[i](reach, speed, x, mass, rates, cells[i], data[i])
    if not viscous.size:
        rate = 0.0
        for r in free:
            rate = max(rate, rates[r] / mass[r])
        return 2.0 / math.sqrt(rate) if rate > 0.0 else math.inf
    losses, step = np.zeros(rates.size), math.inf
    for n in range(viscous.size):
        dampings[n](reach, speed, x, mass, losses, cells[viscous[n]], data[viscous[n]])
    for r in free:
        rate, loss = rates[r] / mass[r], losses[r] / mass[r]
        if rate + loss > 0.0:  # (√(γ² + 4κ) − γ)/κ of κ = ω², γ = 2ζω
            step = min(step, 4.0 / (math.sqrt(loss * loss + 4.0 * rate) + loss))
    return step


@kernel(BOUND)
def no_bound(reach, speed, x, mass, rates, cells, data):
    pass
