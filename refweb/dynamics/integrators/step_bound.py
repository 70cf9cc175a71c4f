"""The largest stable step, by Gershgorin's bound on the largest frequency of what can act before the next row.

Arrays of terms are described in `records.ForceTerms`. May change: a sharper bound, as long as it is one: a step may
come out too short and never too long. Must stay: arguments of the kernels, which `explicit_loop` and
`central_difference` call; `no_bound`, which `records` gives to terms without a bound; kernels of effects have the
signature `kernels.BOUND`. Rates of contact also limit the path of a step, from which `effects.contact.pair_overlap`
proves that none passes. `dynamics.expected_cost` finds the same bound in Python: change both together. Must stay as
well: `EARLY` and `step_by_pairs`, which `explicit_loop` imports; `SPAN` and `safe_step`, which `central_difference` and
`explicit_loop` import. Tests: ``tests/dynamics/test_expected_cost.py``, ``tests/dynamics/integrators/test_nearby.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ...effects.natural_lengths import set_lengths_by_blocks
from ...effects.self_contact.search import FASTER
from ...kernels import BOUND, Matrix, kernel
from ...net.rotation_bounds import carry_rates, pull_rates

if TYPE_CHECKING:
    from .records import ForceTerms, Inertia, Model, Running

SPAN = 100.0
"""Length of a span for which steps are planned where lines touch lines, over the step that the lines alone allow."""
EARLY = 2.0
"""Time for which a force at the start of a span changes the speed of a pair, over the same step."""
FAR = 8.0
"""Reach above which pairs are not found for a bound, over the largest depth of a skin around pairs."""


@kernel(leaf=True, apart=())
def step_bound(reach: float, speed: float, x: Matrix, f: Matrix, inertia: Inertia, terms: ForceTerms) -> float:
    """Largest stable step [s], 2/ω (√(1 + ζ²) − ζ); infinite where nothing vibrates.

    It is that of all that can act before a row has moved by ``reach`` [m], at ``speed`` [m/s] at most, while forces f
    act at x.
    """
    mass, viscous, rates, losses = inertia.mass, terms.viscous, inertia.rates[0], inertia.rates[1]
    inertia.rates[:] = 0.0
    for i in range(len(terms.bounds)):
        terms.bounds[i](reach, speed, x, mass, rates, terms.cells[i], terms.data[i])
    carries = inertia.turns.carried.shape[0] > 0
    if carries:
        carry_rates(rates, inertia.turns)
        pull_rates(rates, f, inertia.turns)
    if not viscous.size:
        rate = 0.0
        for r in inertia.moving:
            rate = max(rate, rates[r] / mass[r])
        return 2.0 / math.sqrt(rate) if rate > 0.0 else math.inf
    step = math.inf
    for n in range(viscous.size):
        cells, data = terms.cells[viscous[n]], terms.data[viscous[n]]
        terms.dampings[n](reach, speed, x, mass, losses, cells, data)
    if carries:
        carry_rates(losses, inertia.turns)
    for r in inertia.moving:
        rate, loss = rates[r] / mass[r], losses[r] / mass[r]
        if rate + loss > 0.0:  # (√(γ² + 4κ) − γ)/κ of κ = ω², γ = 2ζω
            step = min(step, 4.0 / (math.sqrt(loss * loss + 4.0 * rate) + loss))
    return step


@kernel(leaf=True, apart=())
def safe_step(
    start: float, end: float, changing: bool, reach: float, speed: float, x: Matrix, f: Matrix, model: Model
) -> float:
    """Step that is stable from ``start`` to ``end`` [s], also where natural lengths change.

    They are looked at at all corners of their factors: in between a length is a product of positive linear functions of
    time, and stiffness, which goes with its inverse, is largest at an end.
    """
    bound = math.inf
    for corner in model.lengths.corners:
        if changing and (start < corner < end or corner == math.inf) or corner == -math.inf:
            if changing:
                t, terms = min(max(corner, start), end), model.terms
                set_lengths_by_blocks(t, model.lengths, terms.data[0], terms.natural, terms.numbers)
            bound = min(bound, step_bound(reach, speed, x, f, model.inertia, model.terms))
    return bound


@kernel(apart=("pairs",))
def step_by_pairs(
    start: float,
    end: float,
    early: float,
    changing: bool,
    reach: float,
    speed: float,
    spread: float,
    hardest: float,
    model: Model,
    running: Running,
) -> float:
    """Bound the step as `safe_step` does, for lines that touch lines, by the speed of each pair.

    Pairs are found anew, so that steps do not depend on which pairs happen to be listed, as they would where a run is
    taken row by row. Speeds differ by ``spread`` [m/s] at most, and forces add to them for a time ``early`` [s], by the
    acceleration ``hardest`` [m/s²] at most, see `refweb.effects.self_contact.search.foresee`.
    """
    nearby, terms, inverse = model.nearby, model.terms, model.inertia.inverse
    x, v, f = running.x, running.v, running.f
    first, span = 2 * len(terms.data) - len(terms.cells), end - start  # see `records.ForceTerms`
    early = min(early, span)
    within = FASTER * span * (spread + 2.0 * early * hardest)
    if not within < FAR * nearby.skin[0].widest:
        within = math.inf
    for m in range(nearby.terms.size):
        i = nearby.terms[m]
        nearby.cells[m], nearby.data[m] = terms.cells[i], terms.data[i]
        nearby.aheads[m](i, m, within, span, early, x, v, f, inverse, terms.cells, terms.data)
    bound = safe_step(start, end, changing, reach, speed, running.x, running.f, model)
    for m in range(nearby.terms.size):
        i = nearby.terms[m]
        terms.cells[i], terms.data[i] = nearby.cells[m], nearby.data[m]
        nearby.cells[m], nearby.data[m] = terms.cells[first + m], terms.data[first + m]
    return bound


@kernel(BOUND)
def no_bound(reach, speed, x, mass, rates, cells, data):
    pass
