"""Closed surfaces: check, orientation of triangles, and volume, centre and moments of the solid inside.

The moments are those of tetrahedra from one point to each triangle [1]_: with the corners a, b, c from that point and s
= a + b + c, a tetrahedron has the volume V = a·(b × c)/6, the first moment V s/4, and the second one V (s⊗s + a⊗a + b⊗b
+ c⊗c)/20. The point is the middle of the box around the surface. The library trimesh 5.2 takes the origin, and the
inertia of a box at a distance of 1 km then has an error of 1e-5; here it is 3e-13.

May change: private functions, texts of errors, and how triangles are turned outward. Must stay: `NotClosedError` for
what `shapes.mesh` may repair (any other `InputError` refuses the file); fields of `Closed` and `Moments`, which
`repair`, `shapes.mesh` and `shapes.terrain` read by name. `SAME`, `THIN` and `DENT` decide which files are taken. Must
stay as well: all names that `shapes.mesh`, `shapes.terrain` and other files import. Tests:
``tests/net/test_boundary.py``.

References
----------
.. [1] F. Tonon, "Explicit exact formulas for the 3-D tetrahedron inertia tensor in terms of its vertex coordinates",
   J. Math. Stat. 1 (2005) 8–11, doi:10.3844/jmssp.2005.8.11.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components
from scipy.spatial import ConvexHull, QhullError, cKDTree

from ...errors import InputError
from ...tables import LARGEST

SAME = 1e-7
"""Distance up to which corners coincide, over the largest coordinate or size: STL has seven digits."""
THIN = 1e-9
"""Volume up to which a surface counts as flat, over the cube of its largest size."""

DENT = 1e-6
"""Largest relative difference of the volumes of a convex solid and its hull, by rounding of corners."""


class NotClosedError(InputError):
    """A surface that is not closed; `refweb.net.boundary.repair` may find the intended solid."""


class Closed(NamedTuple):
    """A surface that bounds a solid.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Corners.
    triangles : ndarray of int, shape (t, 3)
        Corners of each triangle, outward.
    turned : int
        Number of triangles that faced inward and were turned.
    dropped : int
        Number of triangles with two equal corners, which were dropped.
    pieces : int
        Number of pieces without common edges.
    """

    points: np.ndarray
    triangles: np.ndarray
    turned: int
    dropped: int
    pieces: int


class Moments(NamedTuple):
    """Volume, centre and second moments of a uniform solid.

    Attributes
    ----------
    volume : float
        V [m³].
    centre : ndarray, shape (3,)
        Centre of mass [m].
    inertia : ndarray, shape (3, 3)
        Tensor of inertia about the centre, for a density of 1 [m⁵].
    """

    volume: float
    centre: np.ndarray
    inertia: np.ndarray


def closed(points, triangles):
    """The `Closed` surface of some triangles.

    Raises
    ------
    InputError
        For coordinates that are not finite, and a flat surface.
    NotClosedError
        For a surface that is open, not orientable or crosses itself, and for edges of more than two triangles.
    """
    if not (np.abs(points) <= LARGEST).all():
        raise InputError(f"coordinates of corners must be numbers ≤ {LARGEST:g} [m] in size")
    count = len(triangles)
    points, triangles = joined(points, triangles)
    if len(triangles) < 4:
        raise NotClosedError(f"it holds {len(triangles)} triangles with an area: a closed surface has at least 4")
    pairs, along = _neighbours(points, triangles)
    piece, turned = oriented(len(triangles), pairs, along)
    wrong = np.flatnonzero(turned[pairs[:, 0]] ^ turned[pairs[:, 1]] ^ along)
    if len(wrong):
        first, second = pairs[wrong[0]]
        edge = np.intersect1d(triangles[first], triangles[second])[:2]
        raise NotClosedError(
            f"the surface has one side only, as a Möbius band, as seen at an edge {_edge(points, *edge)}"
        )
    triangles = np.where(turned[:, None], triangles[:, ::-1], triangles)
    size = np.ptp(points[triangles].reshape(-1, 3), axis=0).max()
    inward = _inward(points, triangles, piece, THIN * size**3)
    triangles = np.where(inward[piece][:, None], triangles[:, ::-1], triangles)
    used, number = np.unique(triangles, return_inverse=True)
    faced_inward, dropped = int((turned ^ inward[piece]).sum()), count - len(triangles)
    solid = Closed(points[used], number.reshape(-1, 3), faced_inward, dropped, int(piece.max()) + 1)
    _refuse_crossings(solid)
    return solid


def moments(points, triangles):
    """The `Moments` of the solid that a surface bounds."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    a, b, c = ((points - middle)[triangles[:, k]] for k in range(3))
    tetrahedra, s = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0, a + b + c
    volume = tetrahedra.sum()
    centre = (tetrahedra[:, None] * s).sum(axis=0) / (4.0 * volume)
    second = sum(np.einsum("i,ij,ik->jk", tetrahedra, q, q) for q in (s, a, b, c)) / 20.0
    second -= volume * np.outer(centre, centre)
    return Moments(float(volume), middle + centre, np.trace(second) * np.eye(3) - second)


def convex_hull(points, triangles):
    """Corners and triangles of the convex hull of a surface, outward; refuses a plane surface."""
    if not (np.abs(points) <= LARGEST).all():
        raise InputError(f"coordinates of corners must be numbers ≤ {LARGEST:g} [m] in size")
    points = points[np.unique(triangles)]
    try:
        hull = ConvexHull(points)
    except QhullError:
        raise InputError("the surface is flat, and its hull has no volume: a body has one") from None
    a, b, c = (points[hull.simplices[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0.0
    return points, np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices).astype(np.int64)


def is_convex(points, volume):
    """Tell if a solid is convex, by its corners and volume [m³]."""
    return bool(ConvexHull(points).volume <= (1.0 + DENT) * volume)


def joined(points, triangles):
    """Different points, and the triangles between them with three different corners."""
    if not len(triangles):
        return points, triangles
    near = SAME * max(np.abs(points[triangles]).max(), np.finfo(float).tiny)
    pairs = cKDTree(points).query_pairs(near, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points)))
    _, part = connected_components(graph, directed=False)
    _, first = np.unique(part, return_index=True)
    triangles = part[triangles].astype(np.int64)
    a, b, c = triangles.T
    return points[first], triangles[(a != b) & (b != c) & (c != a)]


def _edge(points, start, end):
    start, end = (", ".join(f"{x:.6g}" for x in points[i]) for i in (start, end))
    return f"from ({start}) to ({end})"


def _neighbours(points, triangles):
    """Triangles on both sides of each edge, shape (e, 2), and a mask of edges that both use in one direction, (e,)."""
    ends = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    sides = np.sort(ends, axis=1)
    edges, of, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    if (count == 1).any():
        edge = edges[count.argmin()]
        raise NotClosedError(
            f"the surface is open: {int((count == 1).sum())} edges have one triangle, such as the one "
            f"{_edge(points, *edge)}; close it where it is made, as by a filter that fills holes"
        )
    if (count > 2).any():
        edge = edges[count.argmax()]
        raise NotClosedError(
            f"{int((count > 2).sum())} edges have more than two triangles, such as the one {_edge(points, *edge)} with "
            f"{count.max()}: part the solids that touch there, or join them to one, where the surface is made"
        )
    order = np.argsort(of.ravel(), kind="stable").reshape(-1, 2)
    along = (ends[order[:, 0]] == ends[order[:, 1]]).all(axis=1)
    return order // 3, along


def oriented(size, pairs, along):
    """Piece of each triangle, and a mask of triangles to turn so that all of a piece face the same side.

    Parameters
    ----------
    size : int
        Number of triangles.
    pairs : ndarray of int, shape (e, 2)
        Triangles on both sides of edges.
    along : ndarray of bool, shape (e,)
        True if both triangles run along the edge in the same direction.
    """
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(size, size)).tocsr()
    graph = graph + graph.T
    _, piece = connected_components(graph, directed=False)
    differs = coo_matrix((np.where(along, 2.0, 1.0), pairs.T), shape=(size, size)).tocsr()
    differs = differs.maximum(differs.T)
    turned = np.zeros(size, dtype=bool)
    for first in np.unique(piece, return_index=True)[1]:
        order, before = breadth_first_order(graph, first, directed=False)
        if len(order) == 1:
            continue
        flips = np.asarray(differs[order[1:], before[order[1:]]]).ravel() == 2.0
        for t, flip in zip(order[1:].tolist(), flips.tolist(), strict=True):
            turned[t] = turned[before[t]] ^ flip
    return piece, turned


def _inward(points, triangles, piece, smallest):
    """Mask of pieces to turn; a piece inside another one bounds a cavity."""
    volume = np.array([
        moments(points, triangles[piece == i]).volume if _is_thick(points, triangles[piece == i]) else 0.0
        for i in range(piece.max() + 1)
    ])  # fmt: skip
    if np.abs(volume).max() <= smallest:
        raise InputError(f"the surface is flat: its volume is {np.abs(volume).max():.3g}, a body has one")
    hollow = np.zeros(len(volume), dtype=bool)
    for i in range(len(volume) if len(volume) > 1 else 0):
        p = points[triangles[piece == i][0, 0]]
        turns = [_turns(p, points, triangles[piece == j]) for j in range(len(volume)) if j != i]
        hollow[i] = sum(round(abs(turn)) for turn in turns) % 2
    return (volume < 0.0) != hollow


def _is_thick(points, triangles):
    return np.abs(np.linalg.det(points[triangles] - points[triangles[0, 0]])).sum() > 0.0


def _turns(p, points, triangles):
    """Winding number of a surface around a point: the solid angle of the surface over 4π."""
    a, b, c = (points[triangles[:, k]] - p for k in range(3))
    i, j, k = (np.linalg.norm(q, axis=1) for q in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = i * j * k + (a * b).sum(1) * k + (b * c).sum(1) * i + (c * a).sum(1) * j
    return float(np.arctan2(above, below).sum() / (2.0 * np.pi))


def _refuse_crossings(surface):
    """Refuse a surface that crosses itself."""
    from .crossings import crossing

    first, second = crossing(surface.points, surface.triangles)
    if first < 0:
        return
    where = surface.points[surface.triangles[first]].mean(axis=0)
    coordinates = ", ".join(f"{x:.6g}" for x in where)
    raise NotClosedError(
        f"the surface crosses itself: triangle {first} about ({coordinates}) and triangle {second} pass through "
        "each other; join the solids to one (a boolean union) where the surface is made"
    )
