"""A hanging chain is an exact polygon.

A chain of straight elastic links whose weight sits at its joints hangs in a polygon: link i pulls with the horizontal
force H and the vertical force V + i w, where w is the weight of a joint, and is stretched by the tension that both
make. This is what elements of order 1 are, so that refweb has to give the polygon itself, not an approximation of it.

Independent method: H and V by shooting for the second end, in 30 digits. 4 m of chain over 3 m, level and with ends
0.7 m apart in height, ρ = 500 kg/m³ and A = 1e-4 m² (Example 1 of *Dynamic modelling and analysis of space webs*), with
E = 7e5, 7e7 and 7e9 Pa.
"""

import itertools

import mpmath
import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row

LENGTH, SPAN, AREA, DENSITY, GRAVITY = 4.0, 3.0, 1e-4, 500.0, 9.81
EPS = np.finfo(float).eps


def solved(links, drop, modulus):
    """The chain between (0, 0) and (3 m, drop)."""
    scene = refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(SPAN, 0, drop), length=LENGTH, elements=links),
        cable=refweb.Cable(law="tension-only", modulus=modulus, area=AREA, density=DENSITY),
        effects=[refweb.Gravity(acceleration=(0, 0, -GRAVITY))],
    )
    return refweb.run(scene)


def polygon(links, drop, axial):
    """Joints (x, z) [m] and tensions [N]."""
    with mpmath.workdps(30):
        each = mpmath.mpf(LENGTH) / links
        weight = mpmath.mpf(DENSITY) * mpmath.mpf(AREA) * mpmath.mpf(GRAVITY) * each

        def vectors(H, V):
            for i in range(links):
                vertical = V + i * weight
                tension = mpmath.sqrt(H * H + vertical * vertical)
                stretched = each * (1 + tension / axial)
                yield stretched * H / tension, stretched * vertical / tension, tension

        def miss(H, V):
            found = list(vectors(H, V))
            return [sum(f[0] for f in found) - SPAN, sum(f[1] for f in found) - mpmath.mpf(drop)]

        H, V = mpmath.findroot(miss, (weight * links / 3, -weight * links / 2))
        dx, dz, tension = zip(*vectors(H, V), strict=True)
        joints = [[0.0, 0.0], *zip(itertools.accumulate(dx), itertools.accumulate(dz), strict=True)]
        return np.array(joints, dtype=float), np.array(tension, dtype=float)


def case(quick):
    links, rows, shapes = 20 if quick else 100, [], []
    for drop, modulus in itertools.product((0.0, 0.7), (7e5, 7e7, 7e9)):
        solution = solved(links, drop, modulus)
        joints, tension = polygon(links, drop, modulus * AREA)
        place = solution.positions[:, [0, 2]]
        shapes.append((drop, modulus, place, joints))
        title = f"drop {drop:g} m, E = {1e-6 * modulus:g} MPa"
        worst = np.abs(place - joints).max()
        # A taut chain is at least as stiff as its H/l on the graph's Laplacian, whose least eigenvalue is 4 sin²(π/2n).
        each = LENGTH / links * (1 + tension.max() / (modulus * AREA))
        stiffness = tension.min() / each * 4 * np.sin(np.pi / (2 * links)) ** 2
        left = (solution.solver["residual"] * tension.max() + EPS * modulus * AREA) * np.sqrt(links)
        reason = "the residual, and rounding of EA ε, over the least stiffness H/l 4 sin²(π/2n)"
        rows.append(
            Row(f"{title}: largest error of a joint", worst, 0.0, "polygon", left / stiffness, reason, "m", scale=1)
        )
        top, bound = solution.tension.max(), 1e-9 + EPS * modulus * AREA * links / tension.min()
        reason = "residual 1e-9, and rounding of EA ε on links in line"
        rows.append(Row(f"{title}: largest tension", top, tension.max(), "polygon", bound, reason, "N"))

    def drawn():
        page, plot = plots.axes("x [m]", "z [m]", height=4.2)
        plot.set_aspect("equal")
        for drop, modulus, place, joints in shapes:
            if modulus != 7e9:
                plot.plot(*joints.T, **plots.REFERENCE)
                plot.plot(*place.T, "o", markersize=3, label=f"E = {1e-6 * modulus:g} MPa, drop {drop:g} m")
        plot.legend(frameon=False, loc="upper center")
        return page

    caption = f"Chains of {links} links: joints by refweb (markers) on the exact polygon (lines)."
    return Case(rows=rows, figures=[Figure(caption, drawn)])
