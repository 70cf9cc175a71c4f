"""A line that falls through a fluid, and a pendulum on a rigid link.

A level line falls across itself through a fluid at rest. With mass per length μ, drag ½ ρ C D v² per length and weight
μ g its velocity is

    v = v∞ tanh(g t / v∞),      v∞ = √(2 μ g / (ρ C D))

A mass on a rigid link without mass begins level and at rest. Its angle from the vertical satisfies θ'' = −ω² sin θ,
ω² = g/L, and with k² = 1/2 of a swing from 90°

    sin(θ/2) = k sn(K(k) − ω t, k)

Independent method: these closed forms, the second by Jacobi's elliptic functions of mpmath.
"""

import mpmath
import numpy as np

import refweb

from ..harness.case import Case, Row, slope

GRAVITY = 9.81
FLUID, COEFFICIENT, DIAMETER = 1.2, 1.1, 0.01
"""Density of the fluid [kg/m³], drag coefficient across the line, and its diameter [m]."""
AREA, DENSITY = 1e-6, 900.0
LENGTH, TIME = 1.5, 1.7
"""Length of the link [m] and time of its swing [s]."""


def fall(duration, step):
    """Velocity of a line after a time [m/s]."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]]),
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=AREA, density=DENSITY),
        supports=refweb.Supports(nodes=[]),
        effects=[
            refweb.Gravity(acceleration=(0, 0, -GRAVITY)),
            refweb.Drag(density=FLUID, normal=COEFFICIENT, diameter=DIAMETER),
        ],
        solve=refweb.Dynamic(duration=duration, step_size=step, method="central-difference"),
        observe=[refweb.Observe(name="speed", quantity="velocity", node=0)],
        accuracy=refweb.Accuracy(error="none"),
    )
    return refweb.run(scene).results["speed"].value


def swing(rtol):
    """Position of a mass on a rigid link at the end [m], shape (3,); its line is slack."""
    scene = refweb.Scene(
        web=refweb.Inline(
            points=[[0, 0, 0], [LENGTH, 0, 0]], lines=[[0, 1]], natural_length=[2.0 * LENGTH], supports=[0]
        ),
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-6, density=0.0),
        effects=[
            refweb.PointMass(node=1, mass=2.0),
            refweb.Gravity(acceleration=(0, 0, -GRAVITY)),
            refweb.Link(nodes=[0, 1]),
        ],
        solve=refweb.Dynamic(duration=TIME, method="ida", rtol=rtol),
        accuracy=refweb.Accuracy(error="none"),
    )
    return refweb.run(scene).positions[1]


def exact_swing():
    """The same in closed form."""
    with mpmath.workdps(30):
        k, omega = mpmath.sqrt(mpmath.mpf(1) / 2), mpmath.sqrt(mpmath.mpf(GRAVITY) / LENGTH)
        sine = k * mpmath.ellipfun("sn", mpmath.ellipk(k * k) - omega * TIME, m=k * k)
        theta = float(2 * mpmath.asin(sine))
    return LENGTH * np.array([np.sin(theta), 0.0, -np.cos(theta)])


def case(quick):
    limit = np.sqrt(2.0 * DENSITY * AREA * GRAVITY / (FLUID * COEFFICIENT * DIAMETER))
    time, counts = 0.2, (20, 40, 80)
    exact = limit * np.tanh(GRAVITY * time / limit)
    errors = [abs(fall(time, time / count) - exact) for count in counts]
    rows = [
        Row("velocity of a falling line at 0.2 s", fall(time, time / 2000), exact, "closed form", 1e-5,
            "order 2 in steps of a 2000th", "m/s"),
        Row("order of its error", -slope(counts, errors), 2, "theory", 0.15, "the coarsest step", scale=1),
        Row("velocity at 2 s", fall(2.0, 1e-3), limit, "v∞, since tanh(g t/v∞) = 1", 1e-9,
            "rounding of 2000 steps", "m/s"),
    ]  # fmt: skip
    place = exact_swing()
    for rtol in (1e-5, 1e-7):
        apart = float(np.linalg.norm(swing(rtol) - place))
        reason = "a thousand tolerances of steps that add up over a swing"
        rows.append(Row(f"mass on a link, rtol = {rtol:g}: error of its position", apart, 0.0, "elliptic functions",
                        1e3 * rtol, reason, "m", scale=LENGTH))  # fmt: skip
    return Case(rows=rows)
