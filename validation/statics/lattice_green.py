"""A prestressed net under a small load is a lattice's Green's function.

A square net of N × N squares of side a, held at its rim, every line under the tension T. A small force F across it at
the middle node moves the nodes by w with

    (T/a) (4 w(i, j) − w(i+1, j) − w(i−1, j) − w(i, j+1) − w(i, j−1)) = F δ(i, j)

the discrete Poisson equation, whose solution on the square is a double sine series, summed here in double precision.
On the infinite lattice the differences are those of a grid of resistors: w(0, 0) − w(1, 0) = F a/4T, exactly and on
any symmetric net, and w(0, 0) − w(1, 1) → F a/πT for large N (J. Cserti, Am. J. Phys. 68, 2000, doi:10.1119/1.1285881).

What is left to second order is the stretching of the lines, of relative size (EA/T) (w/a)²: the difference to the
closed form has to fall with the square of the load, which is fitted.
"""

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, slope

SIDE, MODULUS, AREA, PRESTRAIN = 0.1, 7e7, 1e-4, 0.01
TENSION = MODULUS * AREA * PRESTRAIN


def solved(count, loads):
    """The net, with a load step for each load [N] at the middle; ``count`` is even."""
    # The window drops the frame: N cells along a side have N − 1 inner nodes, and lines to N + 1 fixed places.
    scene = refweb.Scene(
        web=refweb.Window(mesh="square", rows=count, columns=count, side=SIDE),
        cable=refweb.Cable(law="tension-only", modulus=MODULUS, area=AREA, density=0.0, prestrain=PRESTRAIN),
        effects=[refweb.Load(node="centre", force=(0.0, 0.0, 1.0))],
        solve=refweb.Static(load_steps=list(loads)),
    )
    return refweb.run(scene)


def green(count):
    """w T/F a of all nodes of a net whose rim is held, shape (count + 1, count + 1)."""
    p = np.arange(1, count)
    shape = np.sin(np.pi * np.outer(np.arange(count + 1), p) / count)
    middle = shape[count // 2]
    half = 2.0 * np.cos(np.pi * p / count)
    return (2.0 / count) ** 2 * shape @ (np.outer(middle, middle) / (4.0 - half[:, None] - half)) @ shape.T


def on_grid(solution, count, state):
    """Displacement across of the nodes, shape (count + 1, count + 1); 0 in the corners, where there are none."""
    web = state.system.net.web
    place = np.rint((web.points[:, :2] / SIDE) + count / 2).astype(int)
    w = np.zeros((count + 1, count + 1))
    w[place[:, 0], place[:, 1]] = state.x[: len(web.points), 2]
    return w


def case(quick):
    count = 20 if quick else 60
    # From the smallest, whose difference of second order is 1e-8 of it, to one where it is seen well above rounding.
    loads = np.array([1e-3, 0.25, 0.5, 1.0])
    solution, exact, middle = solved(count, loads), green(count), count // 2
    grids = [on_grid(solution, count, state) * TENSION / (load * SIDE) for (_, state), load in
             zip(solution.frames, loads, strict=True)]  # fmt: skip
    w = grids[0]
    left = solution.steps[0]["solver"]["residual"] * TENSION / loads[0]
    second = MODULUS * AREA / TENSION * (loads[0] / TENSION) ** 2
    tolerance, reason = max(left * exact[middle, middle] / 0.25, second), "residual over the load, and (EA/T) (F/T)²"
    rows = [
        Row("w(0, 0) T/F a", w[middle, middle], exact[middle, middle], "double sine series", tolerance, reason),
        Row("w(0, 0) − w(1, 0)", w[middle, middle] - w[middle + 1, middle], 0.25, "symmetry", 4 * tolerance, reason),
        Row(
            "largest difference of any node", np.abs(w - exact).max(), 0.0, "double sine series", tolerance, reason,
            scale=exact[middle, middle],
        ),
    ]  # fmt: skip
    sizes = np.array([4, 6, 8] if quick else [6, 8, 12, 16])
    diagonal = []
    for size in sizes:
        small = solved(size, loads[:1])
        net, half = on_grid(small, size, small.frames[0][1]) * TENSION / (loads[0] * SIDE), size // 2
        diagonal.append(net[half, half] - net[half + 1, half + 1])
    diagonal = np.array(diagonal)
    order = -slope(sizes, np.abs(diagonal - 1 / np.pi))
    # What the rim adds is harmonic with the symmetry of a square: it begins with the fourth power of the distance.
    rows.append(
        Row("order at which w(0, 0) − w(1, 1) tends to 1/π", order, 4, "symmetry of the square", 0.5, "small nets",
            scale=1)
    )  # fmt: skip
    bending = [np.abs(grid - exact).max() for grid in grids[1:]]
    title = "exponent of the difference over the load"
    reason = "the next term, (EA/T) (F/T)² of the first"
    rows.append(Row(title, slope(loads[1:], bending), 2, "second order", 0.05, reason, scale=1))

    def drawn():
        page, (left, right) = plots.axes(["distance along a line [a]", "squares along a side"],
                                         ["w T/F a", "w(0, 0) − w(1, 1), in F a/T"], columns=2)  # fmt: skip
        along = np.arange(-middle, middle + 1)
        left.plot(along, exact[middle], **plots.REFERENCE)
        left.plot(along, w[middle], "o", markersize=4, label="at the load")
        left.plot(along, exact[middle // 2], **plots.REFERENCE)
        left.plot(along, w[middle // 2], "s", markersize=4, label="half-way")
        left.legend(frameon=False, fontsize="small", loc="upper left")
        right.plot(sizes, diagonal, "o")
        right.axhline(1 / np.pi, **plots.REFERENCE)
        return page

    caption = f"Left: a net of {count} × {count} squares, refweb (markers) on the sine series (lines). Right: the step "
    return Case(rows=rows, figures=[Figure(caption + "along a diagonal, with its limit 1/π.", drawn)])
