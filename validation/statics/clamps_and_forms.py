"""Clamps and form finding: a cantilever of links, a saddle of one force density, three strings that meet.

A clamped cantilever of B = L = 1 of n links with springs B n between them, 2 B n at the clamp, bends under a small load
P at its tip by PL³/3B (1 + 1/2n²).

A square grid of one force density q within straight edges of a twisted square is the saddle z = c x y, since its
balance Σ q (x_j − x_i) = 0 holds for x, y and x y alike. Three strings of one constant force meet at angles of 120°, in
the point of least length (Fermat).
"""

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row


def cantilever(count, load=1e-6):
    """Deflection of the tip [m]."""
    points = [[i / count, 0.0, 0.0] for i in range(count + 1)]
    scene = refweb.Scene(
        web=refweb.Inline(points=points, lines=[[i, i + 1] for i in range(count)], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=1e6, area=1.0, density=1.0),
        effects=[
            refweb.Bending(stiffness=1.0, clamp=[0]),
            refweb.Load(node=count, force=(0.0, load, 0.0)),
        ],
    )
    return refweb.run(scene).displacement[-1, 1] / load


def saddle(side):
    """(Positions, exact ones) of a square grid of so many cells a side."""
    plan = np.stack(np.meshgrid(*2 * [np.arange(side + 1.0)], indexing="ij"), axis=-1).reshape(-1, 2)
    exact = np.column_stack([plan, (plan[:, 0] - side / 2) * (plan[:, 1] - side / 2) / side])
    number = np.arange(len(plan)).reshape(side + 1, side + 1)
    lines = np.vstack([np.column_stack([a.ravel(), b.ravel()]) for a, b in ((number[:-1], number[1:]),
                       (number[:, :-1], number[:, 1:]))])  # fmt: skip
    rim = (plan == 0).any(axis=1) | (plan == side).any(axis=1)
    points = np.where(rim[:, None], exact, np.column_stack([plan, np.zeros(len(plan))]))
    scene = refweb.Scene(
        web=refweb.Inline(points=points.tolist(), lines=lines.tolist(), supports=np.flatnonzero(rim).tolist()),
        cable=refweb.Cable(law="force-density", force_density=7.0, modulus=1e9, area=1e-6, density=1000.0),
    )
    return refweb.run(scene).positions, exact


def meeting(corners):
    """Angles between three strings of one force [rad]."""
    points = [*corners, np.mean(corners, axis=0) + [0.1, -0.2, 0.3]]
    scene = refweb.Scene(
        web=refweb.Inline(points=np.array(points).tolist(), lines=[[0, 3], [1, 3], [2, 3]], supports=[0, 1, 2]),
        cable=refweb.Cable(law="constant-force", pretension=10.0, modulus=1e9, area=1e-6, density=1000.0),
    )
    ways = np.array(corners) - refweb.run(scene).positions[3]
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    return [float(np.arccos(ways[i] @ ways[i - 1])) for i in range(3)]


def case(quick):
    rows, counts = [], (2, 10) if quick else (1, 2, 5, 10, 20)
    found = [cantilever(count) for count in counts]
    for count, value in zip(counts, found, strict=True):
        exact = (1.0 + 0.5 / count**2) / 3.0
        reason = "the square of the load is left out"
        rows.append(Row(f"cantilever of {count} links", value, exact, "springs in a row", 1e-8, reason, "m/N"))
    positions, exact = saddle(6)
    off = float(np.abs(positions - exact).max())
    rows.append(Row("saddle, farthest node off z = x y", off, 0.0, "closed form", 1e-12, "rounding", "m", scale=6.0))
    for i, angle in enumerate(meeting([[0.0, 0.0, 0.0], [4.0, 0.0, 1.0], [1.0, 3.0, -1.0]]), 1):
        title, reason = f"strings of one force, angle {i}", "a residual of 1e-10 of the force"
        rows.append(Row(title, angle, 2.0 * np.pi / 3.0, "Fermat", 1e-9, reason, "rad"))

    def drawn():
        page, plot = plots.axes("links", "tip over that of a beam")
        fine = np.arange(1, 21)
        plot.plot(fine, 1.0 + 0.5 / fine**2, **plots.REFERENCE)
        plot.plot(counts, 3.0 * np.array(found), "o")
        return page

    return Case(
        rows=rows, figures=[Figure("Tip of a clamped chain: refweb (markers) on the closed form (line).", drawn)]
    )
