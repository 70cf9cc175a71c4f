"""The largest stable step, by Gershgorin's bound on the largest frequency of what can act before the next row."""

from __future__ import annotations

import math

import numpy as np

from ...kernels import BOUND, kernel
from ...net.rotation_bounds import carry_rates, pull_rates
from .step import set_lengths


@kernel()
def step_bound(reach, speed, x, f, inertia, families, rates):
    """Largest stable step [s], 2/ω (√(1 + ζ²) − ζ); infinite where nothing vibrates.

    It is that of all that can act before a row has moved by ``reach`` [m], at ``speed`` [m/s] at most, while forces f
    act at x. ``rates`` is room for a number a row.
    """
    mass, cells, data, viscous = inertia.mass, families.cells, families.data, families.viscous
    rates[:] = 0.0
    for i in range(len(families.bounds)):
        families.bounds[i](reach, speed, x, mass, rates, cells[i], data[i])
    carry_rates(rates, inertia.turns)
    pull_rates(rates, f, inertia.turns)
    if not viscous.size:
        rate = 0.0
        for r in inertia.moving:
            rate = max(rate, rates[r] / mass[r])
        return 2.0 / math.sqrt(rate) if rate > 0.0 else math.inf
    losses, step = np.zeros(rates.size), math.inf
    for n in range(viscous.size):
        families.dampings[n](reach, speed, x, mass, losses, cells[viscous[n]], data[viscous[n]])
    carry_rates(losses, inertia.turns)
    for r in inertia.moving:
        rate, loss = rates[r] / mass[r], losses[r] / mass[r]
        if rate + loss > 0.0:  # (√(γ² + 4κ) − γ)/κ of κ = ω², γ = 2ζω
            step = min(step, 4.0 / (math.sqrt(loss * loss + 4.0 * rate) + loss))
    return step


@kernel()
def safe_step(start, end, changing, reach, speed, x, f, model):
    """Step that is stable from ``start`` to ``end`` [s], also where natural lengths change.

    They are looked at at all corners of their factors: in between a length is a product of positive linear functions of
    time, and stiffness, which goes with its inverse, is largest at an end.
    """
    bound, rates = math.inf, np.empty(x.shape[0])
    for corner in model.reels.corners:
        if changing and (start < corner < end or corner == math.inf) or corner == -math.inf:
            if changing:
                set_lengths(min(max(corner, start), end), model.reels, model.families.data[0])
            bound = min(bound, step_bound(reach, speed, x, f, model.inertia, model.families, rates))
    return bound


@kernel(BOUND)
def no_bound(reach, speed, x, mass, rates, cells, data):
    pass
