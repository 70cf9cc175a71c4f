"""Expected cost of an explicit run: its step, the cause of that step, and the CPU time.

May change: words of the text, `TELLING`. Must stay: the step of `ruling` is that of `integrators.step_bound`, whose
kernels it calls: change both together. ``refweb check`` prints the text of `expected_cost`, and ``refweb warm`` calls
it to compile its kernels. Tests: ``tests/dynamics/test_expected_cost.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..net.rotation import RigidRotations
from ..net.rotation_bounds import carry_rates
from ..registry import INTEGRATORS
from ..results.units import prefixed
from .budget import steps_with_twin
from .method_choice import TURNING, step_price
from .schedule import Counts, spans_of

TELLING = 0.95
"""Share of the step below which the step with all contacts is reported as well."""


class Rule(NamedTuple):
    """A step [s], and its cause."""

    step: float
    by: str


def ruling(integrator, system, reach, speed):
    """The `Rule` of the critical time step in the initial web, with contacts of bodies within ``reach`` [m].

    The cause is the term with the largest part in the row with the smallest step. It is that of stiffness, or of forces
    that depend on velocity if steps without these would be over √2 times as long.
    """
    net = system.net
    moving = np.flatnonzero(~system.supported.all(axis=1) & (net.mass > 0.0))
    terms = system.terms
    bounds = [term.tangent.bound for term in terms], [term.velocity.bound for term in terms]
    stiff, lossy = (_parts(system, part, reach, speed)[:, moving] / net.mass[moving] for part in bounds)
    both = np.sqrt(lossy.sum(axis=0) ** 2 + 4.0 * stiff.sum(axis=0)) + lossy.sum(axis=0)
    largest = both.max(initial=0.0)
    if not largest > 0.0:
        return Rule(np.inf, "nothing, as nothing vibrates")
    worst = int(both.argmax())
    damped = largest > np.sqrt(2.0) * 2.0 * np.sqrt(stiff[:, worst].sum())
    term = terms[int((lossy if damped else stiff)[:, worst].argmax())]
    row = int(moving[worst])
    if damped:
        name = f"Coriolis forces of [{term.name}]" if term.name in TURNING else term.name
        by = f"{name} at {system.row_name(row)}"
    elif term.over_lines:
        of_it = [row, *(node for body in net.bodies if row in (body.row, body.spin) for node in body.carried)]
        at = np.flatnonzero(np.isin(term.cells, of_it).any(axis=1))
        data = net.line_data[at]
        by = f"elasticity of line {net.line[at[(data.ea / data.natural_length).argmax()]]}"
    else:
        name = "friction" if term.velocity.implicit is not None else term.name
        by = f"{name} at {system.row_name(row)}"
    return Rule(integrator.safety * integrator.stretch * 4.0 / largest, by)


def _parts(system, bounds, reach, speed):
    """Parts of each term in the bounds of the row sums, shape (terms, rows)."""
    rates, parts, turns = np.zeros(system.rows), [], RigidRotations.of(system.net)
    for term, bound in zip(system.terms, bounds, strict=True):
        before, data = rates.copy(), system.data_of(term, 0.0)
        if bound is not None:
            bound(reach, speed, np.zeros((system.rows, 3)), system.net.mass, rates, term.cells, data)
        parts.append(rates - before)
        carry_rates(parts[-1], turns)
    return np.array(parts)


def _seconds(value):
    if value == np.inf:
        return "as long as rows"
    factor, prefix = prefixed(value)
    return f"{value / factor:.3g} {prefix}s"


def expected_cost(scene, system):
    """Text of the expected cost for a method whose steps have a bound; None for others."""
    method, solve = INTEGRATORS[scene.solve.method], scene.solve
    if method.knob != "safety":
        return None
    integrator = method.integrator_of(solve, system)
    linear = system.rows - system.net.spins
    v = system.initial_velocity()
    speeds = np.linalg.norm(v[:linear], axis=1)
    for body in system.net.bodies:
        if body.turn is not None:
            speeds[body.row] += body.extent * np.linalg.norm(body.turning(np.zeros_like(v), v))
    speed = 2.0 * float(speeds.max())
    rules = [ruling(integrator, system, 0.0, speed)]
    if system.contact:
        touched = ruling(integrator, system, np.inf, speed)
        if touched.step < TELLING * rules[0].step:
            rules.append(touched)
    if solve.step_size is not None:
        bound = _seconds(rules[-1].step / solve.safety)
        texts = [f"{_seconds(solve.step_size)} as given, of {bound} at most by {rules[-1].by}"]
        steps = [solve.duration / solve.step_size]
    else:
        texts = [f"{_seconds(rule.step)}{', where all is touched' * n}, by {rule.by}" for n, rule in enumerate(rules)]
        shortest = solve.duration / scene.output.interval
        steps = [max(solve.duration / rule.step, shortest) for rule in rules]
    each = len(integrator.drifts) * steps_with_twin(scene, integrator.coarser_by(spans_of(scene, system)))
    written = Counts.of(scene).seconds(len(system.net.cells))
    prices = [steps[0] * each * step_price(system), steps[-1] * each * step_price(system, touched=True)]
    prices = [price + written for price in prices]
    counts = " to ".join(dict.fromkeys(f"{n:.2g}" for n in steps))
    seconds = " to ".join(dict.fromkeys(f"{price:.2g}" for price in prices))
    twin = " with step refinement" if scene.accuracy.error == "twin" else ""
    return f"{'; '.join(texts)}; {counts} steps, some {seconds} s of CPU time{twin}"
