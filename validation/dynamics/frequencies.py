"""Frequencies of a string, of a net and of a hanging chain.

- *A prestressed string* of length l under the tension T: f_k = k c/2l with c² = T/m′, m′ its mass per current length
  (Lord Rayleigh, *The Theory of Sound*, 1877).
- *A square net* of N × N squares of such strings of side a, held at its rim: on each string the displacement is a sum
  of sin and cos of ωs/c, and where four meet their slopes add up to zero, so that
  2 cos(ωa/c) = cos(pπ/N) + cos(qπ/N) for 0 < p, q < N.
- *A hanging chain*, heavy and free at its lower end: ω = (j/2) √(g/L) with the zeros j of the Bessel function J₀
  (D. Bernoulli 1738), here as a cable that stretches by 1e-8 under its weight.

Frequencies of elements of order p converge with the order 2 p. refweb's ± is that of solving, not of the elements.
"""

import numpy as np
from scipy.special import jn_zeros, jv

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, slope

MODULUS, AREA, DENSITY, PRESTRAIN, GRAVITY = 7e7, 1e-4, 200.0, 0.02, 9.81
SPEED = np.sqrt(MODULUS / DENSITY * PRESTRAIN * (1 + PRESTRAIN))
"""Of waves across, in current length [m/s]: m′ = ρA/(1 + ε)."""
ACROSS = [refweb.Supports(nodes="all", components=["x", "y"])]


def cable(order, subdivide, **changes):
    options = dict(law="tension-only", modulus=MODULUS, area=AREA, density=DENSITY, prestrain=PRESTRAIN)
    return refweb.Cable(**{**options, **changes}, order=order, subdivide=subdivide)


def string(order, subdivide):
    """Modes across a string of 1 m."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1])
    return refweb.modes(refweb.Scene(web=web, cable=cable(order, subdivide), support=ACROSS), 3)


def net(order, subdivide, cells, number):
    """Modes across a net of sides of 0.25 m."""
    web = refweb.Window(mesh="square", rows=cells, columns=cells, side=0.25)
    return refweb.modes(refweb.Scene(web=web, cable=cable(order, subdivide), support=ACROSS), number)


def chain(order, subdivide):
    """Modes across a chain of 1 m that hangs, in one plane."""
    web = refweb.Inline(points=[[0, 0, 0], [0, 0, -1]], lines=[[0, 1]], supports=[0])
    scene = refweb.Scene(
        web=web,
        cable=cable(order, subdivide, prestrain=0.0, modulus=DENSITY * GRAVITY * 1e8),
        effects=[refweb.Gravity(acceleration=(0, 0, -GRAVITY))],
        support=[refweb.Supports(nodes="all", components=["y"])],
    )
    return refweb.modes(scene, 3)


def exact_net(cells):
    """Frequencies of the net below the first of a single string [Hz], ascending."""
    half = np.cos(np.pi * np.arange(1, cells) / cells) / 2
    return np.sort(np.arccos(np.add.outer(half, half)).ravel()) * SPEED / 0.25 / (2 * np.pi)


def case(quick):
    cells = 4 if quick else 8
    exact = {
        "string": np.arange(1, 4) * SPEED / 2,
        "net": exact_net(cells)[:3],
        "chain": jn_zeros(0, 3) / 2 * np.sqrt(GRAVITY) / (2 * np.pi),
    }
    solve = {"string": string, "net": lambda order, subdivide: net(order, subdivide, cells, 3), "chain": chain}
    counts = {
        "string": {1: (24, 32, 48), 2: (12, 16, 24), 3: (8, 10, 12)},
        "net": {1: (8, 12, 16), 2: (4, 6, 8), 3: (2, 3, 4)},
        "chain": {1: (32, 48, 64), 2: (16, 24, 32), 3: (12, 16, 24)},
    }
    rows, errors, modes = [], {}, {}
    for name, frequency in exact.items():
        for order, numbers in counts[name].items():
            modes[name] = [solve[name](order, number) for number in numbers]
            found = np.array([here.frequency[:3] for here in modes[name]])
            # The third mode: errors of the first come down to those of solving.
            errors[name, order] = np.abs(found[:, 2] / frequency[2] - 1)
            title, reason = f"{name}, third mode: order of elements of order {order}", "the coarsest mesh"
            value = -slope(numbers, errors[name, order])
            rows.append(Row(title, value, 2 * order, "theory", 0.15, reason, scale=1))
        for mode in range(3):
            title, here = f"{name}, mode {mode + 1}, cubic elements", modes[name][-1]
            value, reason = here.frequency[mode], "the third mode's error, of order h⁶"
            rows.append(Row(title, value, frequency[mode], "closed form", 1e-6, reason, "Hz", here.error[mode]))

    def drawn():
        labels = ["elements per line", "displacement"], ["relative error of the third mode", "s [m]"]
        page, (left, right) = plots.axes(*labels, columns=2, height=4.2)
        for (name, order), found in errors.items():
            numbers = np.array(counts[name][order], dtype=float)
            mark = {"string": "o", "net": "s", "chain": "D"}[name]
            colour = plots.COLOURS[order - 1]
            left.loglog(numbers, found, mark, color=colour, markersize=4, label=f"{name}, order {order}")
            left.loglog(numbers, found[0] * (numbers / numbers[0]) ** (-2.0 * order), **plots.REFERENCE)
        plots.ticks(left, [2, 4, 8, 16, 32, 64])
        hanging, s = modes["chain"][-1], np.linspace(0, 1, 200)
        place = hanging.state.system.net.points[:, 2] + 1
        order = np.argsort(place)
        for mode, zero in enumerate(jn_zeros(0, 3)):
            shape = hanging.spectra[-1].shapes[mode][:, 0]
            sign = np.sign(shape[np.argmin(place)])
            right.plot(jv(0, zero * np.sqrt(s)), s, **plots.REFERENCE)
            right.plot(sign * shape[order], place[order], "o", markersize=3, label=f"mode {mode + 1}")
        left.legend(frameon=False, fontsize="x-small")
        right.legend(frameon=False, fontsize="small")
        return page

    caption = "Left: errors, with lines of order 2, 4 and 6. Right: modes of the hanging chain on J₀(j √(s/L)), s from "
    return Case(rows=rows, figures=[Figure(caption + "its free end.", drawn)])
