"""The elastic catenary: level, inclined and heavy, at three orders of elements.

A cable of natural length L hangs under its weight w per natural length between (0, 0) and (a, b). With the tension H
across and V(s) = V0 + w s upwards at natural arc length s, T = √(H² + V²), balance and Hooke's law give

    x(s) = H s/EA + (H/w) [asinh(V/H) − asinh(V0/H)]
    z(s) = (V0 s + w s²/2)/EA + [T(s) − T(0)]/w

and the second end gives H and V0 (H. M. Irvine, *Cable Structures*, MIT Press 1981, chapter 1; H. M. Irvine and
G. B. Sinclair 1976), solved here in 30 digits.

The rows compare a cable of few cubic elements with the closed form and fit the order at which the ends of elements
converge, in the mean square: 2 p for elements of order p, as for any Galerkin method in one dimension. Neither strains
nor sags are small.
"""

from dataclasses import dataclass

import mpmath
import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, slope

AXIAL, AREA, GRAVITY = 100.0, 1e-4, 9.81


@dataclass(frozen=True)
class Hung:
    """A cable: second end (a, b) and natural length [m], weight [N/m], elements by order."""

    end: tuple
    natural: float
    weight: float
    counts: dict


CABLES = {
    "level": Hung((1.0, 0.0), 0.995, 6.0, {1: (8, 16, 32), 2: (4, 8, 16), 3: (2, 4, 8)}),
    "heavy": Hung((1.0, 0.0), 1.5, 20.0, {1: (32, 64, 128), 2: (24, 48, 96), 3: (16, 24, 36)}),
    "inclined": Hung((1.0, 0.6), 1.3, 20.0, {1: (32, 64, 128), 2: (24, 48, 96), 3: (16, 24, 36)}),
}


def solved(hung, order, elements):
    """The cable in lines of one element each, from straight between its ends, stretched or slack."""
    share = np.linspace(0.0, 1.0, elements + 1)[:, None]
    cable = refweb.Cable(
        law="tension-only",
        modulus=AXIAL / AREA,
        area=AREA,
        density=hung.weight / (AREA * GRAVITY),
        order=order,
    )
    scene = refweb.Scene(
        web=refweb.Inline(
            points=(share * [hung.end[0], 0.0, hung.end[1]]).tolist(),
            lines=[[i, i + 1] for i in range(elements)],
            natural_length=hung.natural / elements,
            supports=[0, elements],
        ),
        cable=cable,
        effects=[refweb.Gravity(acceleration=(0.0, 0.0, -GRAVITY))],
    )
    return refweb.run(scene)


def exact(hung):
    """H [N], V0 [N] and s ↦ (x, z) of the closed form."""
    (a, b), L, w = hung.end, hung.natural, hung.weight
    with mpmath.workdps(30):

        def miss(H, V0):
            V = V0 + w * mpmath.mpf(L)
            T, T0 = mpmath.sqrt(H**2 + V**2), mpmath.sqrt(H**2 + V0**2)
            x = H * L / AXIAL + H / w * (mpmath.asinh(V / H) - mpmath.asinh(V0 / H))
            return [x - a, (V0 + V) * L / 2 / AXIAL + (T - T0) / w - b]

        if L > np.hypot(a, b):  # of a flat parabola
            start = w * a / (2 * np.sqrt(3 * ((L**2 - b**2) / a**2 - 1)))
        else:
            start = AXIAL * (np.hypot(a, b) / L - 1)
        H, V0 = map(float, mpmath.findroot(miss, (start, start * b / a - w * L / 2)))

    def position(s):
        V, T0 = V0 + w * s, np.hypot(H, V0)
        x = H * s / AXIAL + H / w * (np.arcsinh(V / H) - np.arcsinh(V0 / H))
        z = s * (V0 + w * s / 2) / AXIAL + s * (2 * V0 + w * s) / (np.hypot(H, V) + T0)
        return np.stack([x, z], axis=-1)

    return H, V0, position


def compared(solution, elements, hung):
    """Name, value, closed form and unit of H, V0 and the lowest joint."""
    H, V0, position = exact(hung)
    pull, joints = -solution.reaction[0], position(np.linspace(0.0, hung.natural, elements + 1))
    lowest = solution.positions[: elements + 1, 2].min()
    return [
        ("H at the first end", pull[0], H, "N"),
        ("V0 at the first end", pull[2], V0, "N"),
        ("lowest joint", lowest, joints[:, 1].min(), "m"),
    ]


def case(quick):
    rows, errors, shapes, strains = [], {}, {}, []
    for name, hung in CABLES.items():
        H, V0, position = exact(hung)
        strains.append(np.hypot(H, max(-V0, V0 + hung.weight * hung.natural)) / AXIAL)
        for order, counts in hung.counts.items():
            errors[name, order], found = [], []
            for elements in counts:
                solution = solved(hung, order, elements)
                found.append(compared(solution, elements, hung))
                s = np.linspace(0.0, hung.natural, elements + 1)
                place = solution.positions[: elements + 1, [0, 2]]
                errors[name, order].append(np.sqrt(np.mean(np.sum((place - position(s)) ** 2, axis=1))))
            fitted = -slope(counts, errors[name, order])
            title, reason = f"{name}: order of elements of order {order}", "coarsest mesh not yet in the limit"
            rows.append(Row(title, fitted, 2 * order, "theory", 0.15, reason, scale=1))
        shapes[name] = position(np.linspace(0, hung.natural, 200)), place
        # Of cubic elements, the last of the orders.
        coarse, fine = counts[-2:]
        for (_, before, there, _), (title, value, reference, unit) in zip(*found[-2:], strict=True):
            off = abs(before / there - 1)
            tolerance = 2 * off * (coarse / fine) ** 6 + 1e-13 * fine
            reason = f"twice what h⁶ leaves of {off:.0e} with {coarse} elements; 1e-13 an element, rounding"
            rows.append(Row(f"{name}: {title}", value, reference, "Irvine", tolerance, reason, unit))

    def drawn():
        page, (left, right) = plots.axes(["x [m]", "elements"], ["z [m]", "error of joints [m]"], columns=2)
        left.set_aspect("equal")
        for (name, (curve, place)), mark in zip(shapes.items(), "osD", strict=True):
            left.plot(*curve.T, **plots.REFERENCE)
            left.plot(*place.T, mark, markersize=4, label=name)
        for order, mark in zip((1, 2, 3), "osD", strict=True):
            counts = np.array(CABLES["inclined"].counts[order])
            found = np.array(errors["inclined", order])
            right.loglog(counts, found, mark, label=f"elements of order {order}")
            right.loglog(counts, found[0] * (counts / counts[0]) ** (-2.0 * order), **plots.REFERENCE)
        plots.ticks(right, [16, 32, 64, 128])
        left.legend(frameon=False, fontsize="small")
        right.legend(frameon=False, fontsize="small")
        return page

    caption = (
        f"Left: joints of cubic elements on the closed form; strains reach {100 * max(strains):.1f} %. Right: error of "
        "joints of the inclined cable, with lines of order 2, 4 and 6."
    )
    return Case(rows=rows, figures=[Figure(caption, drawn)])
