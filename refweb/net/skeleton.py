"""Skeletons: the points, straight lines and arcs by which a body touches other bodies, each grown by a thickness.

Two convex bodies touch with a corner on a face, a face on a corner, or with two edges. Contact is therefore found from
corners and edges of one body and the depth in the other. The skeleton of a sphere is a point, that of a capsule a line,
of a box its edges, and of a cylinder its two rims. A corner belongs to one of its edges only, which owns it: otherwise
it would count several times.

A rim consists of two rows of arcs, shifted by half an arc. Each arc has one contact with the weight sin²(π ξ). The
weights of both rows add up to 1 at the deepest point of the rim, so that a rolling rim has a constant force.

May change: `MOST`, above which a mesh is refused; `FLAT`, which changes contact of meshes with bodies. Must stay:
fields of `PART`, which `effects.contact` reads by name and width; numbers of `POINT`, `SEGMENT` and `ARC`; `ARCS`, on
which contact of rims depends; the order of parts, which decides the last digits of contact between bodies;
`of_cylinder`, which `shapes.cylinder` imports; `of_box`, which `shapes.box`, `shapes.capsule` and `shapes.sphere`
import; `of_surface`, which `shapes.filled` imports. Tests: ``tests/effects/test_between_bodies.py``.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .rigid_body import Grown

POINT, SEGMENT, ARC = 0.0, 1.0, 2.0
"""Kinds of a part."""
_vectors = [(name, float, (3,)) for name in ("start", "end", "third")]
PART = np.dtype([("kind", float), ("thickness", float), *_vectors, ("owns", float, (2,))])
"""A part: its kind; thickness [m]; the point, both ends of a line, or the centre of an arc and two radius vectors at
right angles, with the points start + end cos φ + third sin φ [m]; flags of the ends that a line owns, or φ at both ends
[rad]. Vectors are from the centre of the shape along its axes."""
ARCS = 4
"""Number of arcs in a row around a rim."""
FLAT = 1e-3
"""Angle between two triangles up to which they are one face [rad]."""
MOST = 3000
"""Largest number of edges of a surface."""


def points(places: NDArray[np.float64] | Sequence[Sequence[float]], thickness: float) -> NDArray[Any]:
    """Parts that are points (n, 3), an array of `PART`."""
    parts = np.zeros(len(places), PART)
    parts["kind"], parts["thickness"], parts["start"] = POINT, thickness, places
    return parts


def edges(
    places: NDArray[np.float64] | Sequence[Sequence[float]],
    pairs: Sequence[Sequence[int]] | NDArray[np.int64],
    thickness: float,
) -> NDArray[Any]:
    """Parts that are the lines between pairs (n, 2) of points (n, 3), an array of `PART`.

    Each point belongs to the first line that ends there.
    """
    parts, owned = np.zeros(len(pairs), PART), set()
    parts["kind"], parts["thickness"] = SEGMENT, thickness
    for part, pair in zip(parts, pairs, strict=True):
        for end, (corner, name) in enumerate(zip(pair, ("start", "end"), strict=True)):
            part[name], part["owns"][end] = places[corner], corner not in owned
            owned.add(corner)
    return parts


def rim(radius: float, height: float, thickness: float) -> NDArray[Any]:
    """Parts of a circle about the third axis, an array of 2 `ARCS` of `PART`."""
    parts = np.zeros(2 * ARCS, PART)
    parts["kind"], parts["thickness"] = ARC, thickness
    parts["start"], parts["end"], parts["third"] = (0.0, 0.0, height), (radius, 0.0, 0.0), (0.0, radius, 0.0)
    begin = math.pi / ARCS * np.arange(2 * ARCS)
    parts["owns"] = np.column_stack([begin, begin + 2.0 * math.pi / ARCS])
    return parts


def of_box(grown: Grown) -> NDArray[Any]:
    """Parts of a grown box, a `refweb.net.rigid_body.Grown`; also for a point or a line."""
    corners = np.array(list(itertools.product(*([-c, c] if c > 0.0 else [0.0] for c in grown.core))))
    pairs = [
        (i, j)
        for i, j in itertools.combinations(range(len(corners)), 2)
        if np.count_nonzero(corners[i] != corners[j]) == 1
    ]
    return edges(corners, pairs, grown.radius) if pairs else points(corners, grown.radius)


def of_cylinder(grown: Grown) -> NDArray[Any]:
    """Parts of a grown cylinder about the third axis: its rims, and parts inside for crossed cylinders.

    The parts inside are, for a long cylinder, the capsule on its axis, for a flat one the thickest rim, and rims of
    half that thickness. Between these parts crossed cylinders overlap by up to 0.03 of the radius before they touch.
    """
    radius, _, half = grown.core
    if not radius > 0.0:
        return of_box(grown)
    thickest = grown.radius + min(radius, half)
    parts = []
    for thickness in dict.fromkeys((grown.radius, 0.5 * (grown.radius + thickest), thickest)):
        inward = thickness - grown.radius
        out, height = radius - inward, half - inward
        heights = dict.fromkeys((-height, height))
        if out > 0.0:
            parts += [rim(out, at, thickness) for at in heights]
        elif height > 0.0:
            parts.append(edges(np.array([[0.0, 0.0, at] for at in heights]), [(0, 1)], thickness))
        else:
            parts.append(points(np.zeros((1, 3)), thickness))
    return np.concatenate(parts)


def of_surface(corners: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[Any]:
    """Parts of a surface of triangles (t, 3), outward, with corners (n, 3): its convex edges, by `FLAT`.

    Edges of one triangle, at the intersection of parts of a solid, do not count. More than `MOST` of them are refused.
    """
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    side: dict = {}
    for t, triangle in enumerate(triangles.tolist()):
        for k in range(3):
            side[triangle[k], triangle[k - 2]] = t, triangle[k - 1]
    pairs = []
    for (i, j), (t, _) in side.items():
        opposite, across = side.get((j, i), (t, i))
        below = normals[t] @ (corners[across] - corners[i])
        if i < j and below < 0.0 and normals[t] @ normals[opposite] < math.cos(FLAT):
            pairs.append((i, j))
    if len(pairs) > MOST:
        raise InputError(
            f"its surface has {len(pairs)} edges that stand out, and between_bodies = true takes at most {MOST}: give "
            "a coarser surface"
        )
    return edges(corners, pairs, 0.0)
