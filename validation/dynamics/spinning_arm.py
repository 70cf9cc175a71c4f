"""A spinning elastic arm, in the frame that turns and from outside.

A cable turns with the angular velocity Ω about a hub and is stretched by its own mass. With s in natural arc length and
k = Ω √(ρ/E), balance along it is x″ + k² x = 0 with x(0) = a at the hub and x′(L) = 1 at its free end, which has no
tension:

    x = a cos ks + B sin ks,    B = (1 + a k sin kL)/(k cos kL),    T(s) = EA (x′ − 1)

There is no such state for kL ≥ π/2. In the frame that turns refweb finds it as an equilibrium; the ends of elements
converge with twice their order. With a mass m at its end, an arm without mass has the length L/(1 − Ω²/Ω₁²), where
Ω₁ = √(EA/mL) is the limit. Seen from outside the same arm moves: it starts at its equilibrium with the velocities of
the turn, and after a quarter of one it must be a quarter of a turn further at the same length. Central differences are
of order 2.
"""

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, slope

MODULUS, AREA, DENSITY, HUB = 7e7, 1e-4, 200.0, 0.3
AXIAL, TURN = MODULUS * AREA, 0.7
"""EA [N], and k L."""


def cable(order=1, density=DENSITY):
    return refweb.Cable(law="tension-only", modulus=MODULUS, area=AREA, density=density, order=order)


def arm(elements, hub=HUB):
    """Elements together 1 m long on the x axis, from the hub."""
    points = [[hub + i / elements, 0.0, 0.0] for i in range(elements + 1)]
    return refweb.Inline(points=points, lines=[[i, i + 1] for i in range(elements)], supports=[0])


def heavy(order, elements):
    """The heavy arm at rest in the frame that turns."""
    speed = TURN * np.sqrt(MODULUS / DENSITY)
    scene = refweb.Scene(
        web=arm(elements),
        cable=cable(order),
        effects=[refweb.Frame(angular_velocity=(0.0, 0.0, speed))],
    )
    return refweb.run(scene)


def place(s):
    """Closed form of the heavy arm: x [m] and T [N]."""
    B = (1 + HUB * TURN * np.sin(TURN)) / (TURN * np.cos(TURN))
    x = HUB * np.cos(TURN * s) + B * np.sin(TURN * s)
    return x, AXIAL * (TURN * (B * np.cos(TURN * s) - HUB * np.sin(TURN * s)) - 1)


def from_outside(share, steps, mass=2.0):
    """An arm without mass with a mass at its end, at a share of the limit: a quarter of a turn."""
    speed = share * np.sqrt(AXIAL / mass)
    length = 1 / (1 - share**2)
    quarter = np.pi / 2 / speed
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [length, 0, 0]], lines=[[0, 1]], natural_length=1.0, supports=[0]),
        cable=cable(density=0.0),
        effects=[refweb.PointMass(node=1, mass=mass), refweb.Velocity(node=1, value=(0, speed * length, 0))],
        solve=refweb.Dynamic(duration=quarter, step_size=quarter / steps * (1 + 1e-9)),
        output=refweb.Output(interval=quarter / 10),
        observe=[refweb.Observe(name=axis, quantity="position", node=1, component=axis) for axis in "xy"],
    )
    return refweb.run(scene), length


def case(quick):
    rows, errors = [], {}
    for order, counts in {1: (8, 16, 32), 2: (4, 8, 16), 3: (2, 4, 8)}.items():
        found = []
        for count in counts:
            solution = heavy(order, count)
            s = np.linspace(0, 1, count + 1)
            found.append(np.abs(solution.positions[: count + 1, 0] - place(s)[0]).max())
        errors[order] = counts, found
        reason = "the coarsest mesh"
        rows.append(Row(f"order of elements of order {order}", -slope(counts, found), 2 * order, "theory", 0.15, reason,
                        scale=1))  # fmt: skip
    x, tension = place(np.array([0.0, 1.0]))
    tip = solution.positions[counts[-1], 0]
    rows.append(Row("radius of the free end, 8 cubic elements", tip, x[1], "closed form", 1e-9, "h⁶ of 1/8", "m"))
    pull = -solution.reaction[0, 0]
    rows.append(Row("tension at the hub", pull, tension[0], "closed form", 1e-8, "EA times the same", "N"))
    for share in (0.1, 0.5, 0.9):
        mass, limit = 2.0, np.sqrt(AXIAL / 2.0)
        scene = refweb.Scene(
            web=arm(1, hub=0.0),
            cable=cable(density=0.0),
            effects=[refweb.PointMass(node=1, mass=mass), refweb.Frame(angular_velocity=(0, 0, share * limit))],
        )
        radius, exact = refweb.run(scene).positions[1, 0], 1 / (1 - share**2)
        reason = "rounding over 1 − share²"
        rows.append(Row(f"mass at Ω = {share} Ω₁: radius", radius, exact, "closed form", 1e-12, reason, "m"))
    counts = 36 * 3 ** np.arange(3 if quick else 5)
    found = []
    for count in counts:
        solution, length = from_outside(0.5, int(count))
        found.append(np.hypot(solution.results["x"].value, solution.results["y"].value - length))
    within, reason = 2 / counts[-1] ** 2, "order 2 in the step, 2 (1/steps)²"
    for axis, exact in (("x", 0.0), ("y", length)):
        here = solution.results[axis]
        title = f"from outside, a quarter of a turn: {axis}"
        rows.append(Row(title, here.value, exact, "closed form", within, reason, "m", here.error, scale=length,
                        covered=True))  # fmt: skip
    rows.append(Row("order from outside", -slope(counts, found), 2, "theory", 0.1, "coarsest step", scale=1))

    def drawn():
        labels = ["natural arc length s [m]", "elements"], ["tension [N]", "error of joints [m]"]
        page, (left, right) = plots.axes(*labels, columns=2)
        fine, elements = np.linspace(0, 1, 200), 16
        left.plot(fine, place(fine)[1], **plots.REFERENCE)
        left.plot((np.arange(elements) + 0.5) / elements, heavy(1, elements).tension, "o", markersize=4)
        for (order, (counts, found)), mark in zip(errors.items(), "osD", strict=True):
            counts = np.array(counts, dtype=float)
            right.loglog(counts, found, mark, label=f"order {order}")
            right.loglog(counts, found[0] * (counts / counts[0]) ** (-2.0 * order), **plots.REFERENCE)
        plots.ticks(right, [2, 4, 8, 16, 32])
        right.legend(frameon=False, fontsize="small", loc="lower left")
        return page

    caption = "The heavy arm. Left: tension of 16 straight elements on the closed form. Right: errors, with lines of "
    return Case(rows=rows, figures=[Figure(caption + "order 2, 4 and 6.", drawn)])
