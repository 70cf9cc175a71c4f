"""Penetration check of lines with bodies: lines must not reach the middle of a body in a drift.

The push of a body changes its direction in the middle, where depth is largest: a line that gets there may leave on the
other side. In a drift the depth of a line grows at most by its relative displacement: that of the nodes of its element
less that of the body, plus a part by the rotation of the body. If the sum of both stays below `MIDDLE` of the distance
from the middle to the surface, no line passes. Lines may slide around a body at any depth.

The depth of an element may be larger between its contacts. Along a straight element, the depth in a convex body is
concave. From any point it rises by at most its slope there times the distance to the ends, and it is at most `SHOWN`
times the depth of the contacts. Let ξ be that of the largest W δ^(p + 1), W = 4 ξ (1 − ξ). From W'/W ≤ 1/ξ follows |δ'|
≤ δ/((p + 1) ξ), and the deepest point is at most ξ away: (p + 2)/(p + 1) ≤ `SHOWN`. In a body that is not convex, the
largest gradient of depth gives a bound.

May change: `PARTS`. Must stay: the four entries of ``met`` (two nodes, the row of the body, 1 where the line is in the
core), which `integrators.ccd` and `penetration` read by position; `MIDDLE` and `SHOWN`, which follow from geometry: the
first may only fall, the second only rise; that no line which may pass is left out; `passing`, which `table` imports;
`limits_of`, which `integrators.crossings` imports. Tests: ``tests/effects/test_passage.py``.
"""

from __future__ import annotations

import functools
import math

from ...compiled.rows import record_at
from ...kernels import MEETS, kernel
from ..vectors import dot
from .nearest_point import closest
from .overlap import CORE
from .pair import SPHERE, pair_of

MIDDLE = 0.7
"""Depth that no line may reach, over the distance from the middle of a body to its surface. The depth in the middle is
0.737 of that distance for a cube, 0.757 for a square bar, 0.8 for a plate, and 1 for a sphere or a capsule."""
SHOWN = 1.5
"""Largest depth of an element in a convex body over that of its deepest contact; for spheres both are equal."""
PARTS = 256
"""Largest number of parts of an element whose depth is evaluated one by one."""


def limits_of(term, bodies):
    """(Depth that no line may reach [m], largest depth of an element over that of its contacts).

    Both are for a term and the bodies that its cells may touch. The second is infinite if it is not known.
    """
    own_bodies = [body for body in bodies if body.row in term.cells[:, 2]]
    observed = [
        1.0 if b.shape.once else SHOWN if getattr(b.shape.depth(), "convex", True) else math.inf for b in own_bodies
    ]
    return MIDDLE * min(body.thickness for body in own_bodies), max(observed)


@kernel(forceinline=True)
def nearing(cells, c, nodes, kick, drift, v, f, inverse):
    """Largest displacement of a node of cell c relative to its body in a drift after a kick [m]."""
    fastest, b = 0.0, cells[c, nodes]
    for a in range(nodes):
        i, square = cells[c, a], 0.0
        for k in range(3):
            velocity = v[i, k] + kick * inverse[i, k] * f[i, k]
            square += (velocity - v[b, k] - kick * inverse[b, k] * f[b, k]) ** 2
        fastest = max(fastest, square)
    return abs(drift) * math.sqrt(fastest)


@functools.cache
def passing(depth, nodes, functions, spins=0):
    """The kernel of `refweb.kernels.MEETS` of lines in bodies of one depth, None for spheres alone.

    It writes the nodes of an element, the row of the body, and 1 if the element is in the core already, else 0.
    ``margin`` is the approach of points of bodies by their rotation. Arguments are those of
    `refweb.effects.contact.penalty.kernels`.
    """
    if depth is None:

        @kernel()
        def below(x, cells, data, c, share, margin):
            away = math.sqrt(closest(x, cells, data, c, nodes, functions)[1])
            radius = record_at(SPHERE, data, c, 0).radius
            return radius - away < share * radius - margin

    else:
        from .contact_points import within_of
        from .penalty import thickness

        within, steepest = within_of(depth, spins), 0.0
        if not getattr(depth, "convex", True):
            from .nonconvex_contacts import STEEPEST as steepest

        @kernel()
        def below(x, cells, data, c, share, margin):
            limit = share * thickness(pair_of(data, c, nodes).shape) - max(steepest, 1.0) * margin
            parts = 1
            while parts <= PARTS:
                deepest_seen, largest = -math.inf, -math.inf
                for n in range(parts):
                    spot = within(x, cells, data, c, nodes, functions, (n + 0.5) / parts)
                    slope = steepest * math.sqrt(dot(spot.d, spot.d)) if steepest else abs(dot(spot.gradient, spot.d))
                    deepest_seen = max(deepest_seen, spot.depth)
                    largest = max(largest, spot.depth + 0.5 * slope / parts)
                if largest < limit:
                    return True
                if not deepest_seen < limit:
                    return False
                parts *= 4
            return False

    @kernel(MEETS)
    def meets(margin, path, kick, drift, x, v, f, inverse, cells, data, due, met):
        for c in range(cells.shape[0]):
            allowance = margin + nearing(cells, c, nodes, kick, drift, v, f, inverse)
            reach = record_at(SPHERE, data, c, 0).radius + allowance
            if closest(x, cells, data, c, nodes, functions)[1] > reach * reach:
                continue
            if not below(x, cells, data, c, MIDDLE, allowance):
                met[0], met[1], met[2] = cells[c, 0], cells[c, 1], cells[c, nodes]
                met[3] = 0 if below(x, cells, data, c, CORE, 0.0) else 1
                return True
        return False

    return meets
