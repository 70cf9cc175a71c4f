"""The largest stable step, by Gershgorin's bound on the largest frequency of what can act before the next row."""

from __future__ import annotations

import math

from ...kernels import BOUND, kernel
from ...list_items import item
from ...net.rotation_bounds import carry_rates, pull_rates
from .nearby import exchange
from .step import set_lengths


@kernel(leaf=True)
def step_bound(reach, speed, x, f, inertia, families):
    """Largest stable step [s], 2/ω (√(1 + ζ²) − ζ); infinite where nothing vibrates.

    It is that of all that can act before a row has moved by ``reach`` [m], at ``speed`` [m/s] at most, while forces f
    act at x.
    """
    mass, viscous, rates, losses = inertia.mass, families.viscous, inertia.rates[0], inertia.rates[1]
    inertia.rates[:] = 0.0
    for i in range(len(families.bounds)):
        item(families.bounds, i)(reach, speed, x, mass, rates, item(families.cells, i), item(families.data, i))
    carry_rates(rates, inertia.turns)
    pull_rates(rates, f, inertia.turns)
    if not viscous.size:
        rate = 0.0
        for r in inertia.moving:
            rate = max(rate, rates[r] / mass[r])
        return 2.0 / math.sqrt(rate) if rate > 0.0 else math.inf
    step = math.inf
    for n in range(viscous.size):
        cells, data = item(families.cells, viscous[n]), item(families.data, viscous[n])
        item(families.dampings, n)(reach, speed, x, mass, losses, cells, data)
    carry_rates(losses, inertia.turns)
    for r in inertia.moving:
        rate, loss = rates[r] / mass[r], losses[r] / mass[r]
        if rate + loss > 0.0:  # (√(γ² + 4κ) − γ)/κ of κ = ω², γ = 2ζω
            step = min(step, 4.0 / (math.sqrt(loss * loss + 4.0 * rate) + loss))
    return step


@kernel()
def shorten(t, model):
    """Give lines their natural lengths at time t."""
    set_lengths(t, model.reels, model.families.data[0])


@kernel(leaf=True)
def safe_step(start, end, changing, reach, speed, x, f, model):
    """Step that is stable from ``start`` to ``end`` [s], also where natural lengths change.

    They are looked at at all corners of their factors: in between a length is a product of positive linear functions of
    time, and stiffness, which goes with its inverse, is largest at an end.
    """
    bound = math.inf
    for corner in model.reels.corners:
        if changing and (start < corner < end or corner == math.inf) or corner == -math.inf:
            if changing:
                shorten(min(max(corner, start), end), model)
            bound = min(bound, step_bound(reach, speed, x, f, model.inertia, model.families))
    return bound


@kernel()
def step_by_elements(start, end, changing, reach, speed, model, running):
    """As `safe_step`, where pairs that are listed are not all that can touch: by the elements themselves."""
    families, cells, data = model.families, model.families.cells.copy(), model.families.data.copy()
    more, first = len(cells) - len(data), 2 * len(data) - len(cells)
    for m in range(more):
        cells[m], data[m] = cells[first + m], data[first + m]
    exchange(model.nearby, families, cells, data)
    bound = safe_step(start, end, changing, reach, speed, running.x, running.f, model)
    exchange(model.nearby, families, cells, data)
    return bound


@kernel(BOUND)
def no_bound(reach, speed, x, mass, rates, cells, data):
    pass
