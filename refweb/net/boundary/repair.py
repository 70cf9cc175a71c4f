"""Repair of faulty surfaces: holes are closed, and parts that overlap or touch become one solid.

The input are triangles, the output is a `Repaired` solid. Of equal triangles one is kept. A part is a set of triangles
connected by edges of two triangles; its triangles are turned outward, so that the volume between the part and the
middle of its rim is positive. A part that faces inward in the file and lies in others bounds a cavity. Holes are closed
by triangles of their rim, or, if the rim is not plane, by the cone from its middle. The surface then has no rim, and
the solid is the set of points with a winding number above 1/2, see `refweb.net.boundary.winding`; for overlapping parts
it is their union. The boundary is the part of the surface with the solid on one side only. Triangles that others cross
are divided until the pieces are small against the cells of the grid of depth. Walls and gaps between parts that are
thinner than 2 % of a cell are ignored.

The library trimesh 5.2 finds the volume of 8 of the 14 faulty solids in ``tests/net/test_repair.py``. With unions by
manifold3d it finds all, but keeps gaps: between two boxes at a distance of 1e-6 m it gives a depth of 1 mm, and 99 mm
is that of one solid.

May change: private functions, `EMPTY` and other texts; those in ``remarks`` become warnings of a run. Must stay: fields
of `Repaired`, which `shapes.mesh` reads by name; surfaces without a fault, which keep their bits. `COARSE`, `SMALL`,
`LOOKS`, `GAP`, `FLAT`, `LOOP` and `SUMMED` change depth and mass of faulty solids. Must stay as well: `touches_itself`
and `repaired`, which `shapes.mesh` imports. Tests: ``tests/net/test_repair.py`` compares with volumes in closed form.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ...errors import InputError
from .closed import Moments, joined, moments, oriented
from .field import GAP
from .polygons import ears
from .winding import Winding

COARSE, SMALL = 2.0, 1.0 / 16.0
"""Length of pieces of a triangle that are checked one by one, and least length of divided pieces, over a cell."""
LOOKS = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
"""Barycentric coordinates of the points at which a triangle is checked."""
FLAT = 1e-7
"""Volume up to which a part counts as a sheet, over its area to the power 3/2."""
LOOP = 400
"""Largest number of edges of a hole that is closed by triangles of its rim."""
SUMMED = 5e-3
"""Largest relative difference of sums over lines and the exact volume of a boundary without gaps."""
EMPTY = (
    "it has no inside: its winding number is nowhere above 1/2, and a body needs a surface that encloses something. "
    'Open ground is shape = "terrain" with heights = FILE'
)


class Repaired(NamedTuple):
    """Solid from a faulty surface.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Corners [m].
    triangles : ndarray of int, shape (t, 3)
        Corners of each triangle in the boundary, outward; a part of a triangle may lie inside.
    boundary : tuple of ndarray
        Corners and triangles of only the boundary.
    moments : refweb.net.boundary.closed.Moments
        Of the solid.
    winding : refweb.net.boundary.winding.Winding
        Decides which points are inside.
    remarks : tuple of str
        Faults of the surface.
    """

    points: np.ndarray
    triangles: np.ndarray
    boundary: tuple[Any, ...]
    moments: Moments
    winding: Winding
    remarks: tuple[Any, ...]


def repaired(points, triangles, cells):
    """The `Repaired` solid of some triangles, for a grid of depth with a number of cells along the longest side.

    A surface that encloses nothing is refused.
    """
    points, triangles = joined(points, triangles)
    if not len(triangles):
        raise InputError(EMPTY)
    single, doubled = _single(triangles)
    pieces = _pieces(points, single)
    sheet = (pieces.flat & pieces.open)[pieces.piece]
    single, sheets = single[~sheet], pieces.area[sheet]
    if not len(single):
        raise InputError(EMPTY)
    pieces = _pieces(points, single)
    triangles = _outward(points, single, pieces)
    extended, lids, holes = _lids(points, triangles, pieces.ends)
    surface = np.vstack([triangles, lids])
    winding = Winding(extended, surface)
    spacing = float(np.ptp(extended[np.unique(surface)], axis=0).max()) / cells
    corners, side, cut = _boundary(extended[surface], winding, spacing)
    summed = _of_sums(winding.sums())
    if not len(corners) or not summed.volume > 0.0:
        raise InputError(EMPTY)
    flat, number = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = number.reshape(-1, 3)
    exact = moments(flat, faces)
    weighed = summed if cut.any() or abs(exact.volume - summed.volume) > SUMMED * summed.volume else exact
    remaining = _turned(surface, side)[(side != 0) | cut]
    used, number = np.unique(remaining, return_inverse=True)
    inverted, inner = int((triangles != single).any(axis=1).sum()), int((side == 0)[: len(triangles)].sum())
    remarks = [*_remarks(pieces, holes, doubled, inverted, sheets)]
    if inner:
        seams = f", its edges there within {SMALL * spacing:.2g} m" if cut.any() else ""
        remarks.append(
            f"{inner} triangles lie in other parts or pass through them: the solid is the union of its parts{seams}"
        )
    return Repaired(extended[used], number.reshape(-1, 3), (flat, faces), weighed, winding, tuple(remarks))


def touches_itself(points, triangles, cells):
    """Tell if parts of a closed surface touch or are closer than `GAP` of a cell."""
    spacing = float(np.ptp(points, axis=0).max()) / cells
    _, side, _ = _boundary(points[triangles], Winding(points, triangles), spacing)
    return not (side == 1).all()


def _single(triangles):
    """Different triangles, and the number of removed ones; a wall that two parts share is removed."""
    _, first, of, count = np.unique(
        np.sort(triangles, axis=1), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    doubled = len(triangles) - len(first)
    single, twice = triangles[first], count % 2 == 0
    if twice.any():
        edges, _ = _edges(single)
        between = np.flatnonzero(twice)
        inside = coo_matrix(
            (np.ones(3 * len(between)), (np.repeat(np.arange(len(between)), 3), edges[between].ravel()))
        )
        _, wall = connected_components(inside @ inside.T, directed=False)
        within = np.bincount(edges[between].ravel(), minlength=edges.max() + 1)
        beside = np.bincount(edges.ravel(), minlength=edges.max() + 1) - within
        rim = within == 1
        open_ = (rim & ((beside == 0) | (beside % 2 == 1)))[edges[between]].any(axis=1)
        needed = np.ones(len(single), dtype=bool)
        needed[between] = np.isin(wall, wall[open_])
        single = single[needed]
    return single, doubled


def _edges(triangles):
    """Numbers of the edges of triangles, shape (t, 3), and corners of each edge, shape (e, 2)."""
    ends = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, of = np.unique(ends, axis=0, return_inverse=True)
    return of.reshape(-1, 3), edges


class _Pieces(NamedTuple):
    """Pieces: sets of triangles connected by edges of two triangles.

    Attributes
    ----------
    triangles : ndarray of int, shape (t, 3)
        All triangles; those of a piece face the same side.
    piece, area : ndarray, shape (t,)
        Piece of each triangle, and its area [m²].
    as_given : ndarray of bool, shape (pieces,)
        True if most triangles of a piece have the orientation of the file.
    volume : ndarray, shape (pieces,)
        Volume between a piece and the middle of its rim [m³].
    flat : ndarray of bool, shape (pieces,)
        True if this volume is zero.
    ends : ndarray of int, shape (k, 2)
        Corners of the edges of one triangle.
    open : ndarray of bool, shape (pieces,)
        True if a piece has such an edge.
    crowded : int
        Number of edges of more than two triangles.
    """

    triangles: np.ndarray
    piece: np.ndarray
    area: np.ndarray
    as_given: np.ndarray
    volume: np.ndarray
    flat: np.ndarray
    ends: np.ndarray
    open: np.ndarray
    crowded: int


def _pieces(points, triangles):
    """The `_Pieces` of some triangles."""
    edges, ends = _edges(triangles)
    count = np.bincount(edges.ravel())
    order = np.argsort(edges.ravel(), kind="stable")
    order = order[count[edges.ravel()[order]] == 2].reshape(-1, 2)
    start = triangles[order // 3, order % 3]
    piece, turned = oriented(len(triangles), order // 3, start[:, 0] == start[:, 1])
    faces = np.where(turned[:, None], triangles[:, ::-1], triangles)
    a, b, c = (points[faces[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    as_given = np.bincount(piece, np.where(turned, -area, area)) >= 0.0
    volume = np.array([_volume(points, faces[piece == n]) for n in range(piece.max() + 1)])
    flat = np.abs(volume) <= FLAT * np.bincount(piece, area) ** 1.5
    is_open = np.bincount(piece, (count[edges] == 1).any(axis=1)) > 0
    return _Pieces(faces, piece, area, as_given, volume, flat, ends[count == 1], is_open, int((count > 2).sum()))


def _outward(points, triangles, pieces):
    """Triangles outward."""
    flip = np.where(pieces.flat, ~pieces.as_given, pieces.volume < 0.0)
    outward = np.where(flip[pieces.piece][:, None], pieces.triangles[:, ::-1], pieces.triangles)
    inside_out = ~pieces.flat & (flip == pieces.as_given)
    if (np.abs(pieces.volume) * np.where(inside_out, -1.0, 1.0))[~pieces.flat].sum() > 0.0:
        for n in np.flatnonzero(inside_out):
            part = pieces.piece == n
            if _lies_in_others(points, outward, part):
                outward[part] = outward[part][:, ::-1]
    return outward


def _rim(triangles):
    """Directed edges, shape (e, 2), that occur more often in one direction than in the other."""
    ends = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    forth = ends[:, 0] < ends[:, 1]
    edges, of = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    net = np.bincount(of.ravel(), np.where(forth, 1.0, -1.0)).astype(int)
    directed = np.where((net > 0)[:, None], edges, edges[:, ::-1])
    return np.repeat(directed, np.abs(net), axis=0)


def _volume(points, triangles):
    """Volume between a surface and the middle of its rim [m³]."""
    rim = _rim(triangles)
    middle = points[rim].mean(axis=(0, 1)) if len(rim) else points[triangles[0, 0]]
    a, b, c = (points[triangles[:, k]] - middle for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def _lies_in_others(points, triangles, part):
    """Tell if a part without a rim lies inside other triangles."""
    if len(_rim(triangles[part])):
        return False
    return bool(Winding(points, triangles[~part]).inside(points[triangles[part]].mean(axis=1)).all())


def _lids(points, triangles, ends):
    """Points followed by middles of rims, triangles that close all rims, and the size of each hole [m].

    A rim with edges of only one triangle, corners ``ends (k, 2)``, belongs to a hole.
    """
    rim, opening = _rim(triangles), set(map(tuple, np.sort(ends, axis=1).tolist()))
    if not len(rim):
        return points, np.zeros((0, 3), dtype=np.int64), []
    corners, number = np.unique(rim, return_inverse=True)
    number = number.reshape(-1, 2)
    graph = coo_matrix((np.ones(len(rim)), number.T), shape=(len(corners), len(corners)))
    _, part = connected_components(graph, directed=False)
    lids, middles, holes = [], [], []
    for n in range(part.max() + 1):
        edges = rim[part[number[:, 0]] == n]
        places = points[np.unique(edges)]
        if not opening.isdisjoint(map(tuple, np.sort(edges, axis=1).tolist())):
            holes.append(float(np.linalg.norm(np.ptp(places, axis=0))))
        loop = _loop(edges) if len(edges) <= LOOP else None
        parts = None if loop is None else _in_plane(points[loop])
        if parts is not None:
            lids.append(np.array(loop)[parts])
        else:
            at = len(points) + len(middles)
            middles.append(points[edges[:, 0]].mean(axis=0))
            lids.append(np.column_stack([edges[:, ::-1], np.full(len(edges), at)]))
    return np.vstack([points, *middles]), np.vstack(lids), sorted(holes, reverse=True)


def _loop(edges):
    """Corners around a hole, against the direction of its edges; None if they are not one loop."""
    after = dict(edges[:, ::-1].tolist())
    if len(after) < len(edges) or len(set(after.values())) < len(edges):
        return None
    loop = [int(edges[0, 1])]
    while (corner := after[loop[-1]]) != loop[0]:
        loop.append(corner)
    return loop if len(loop) == len(edges) else None


def _in_plane(corners):
    """Triangles of a polygon that is plane within a thousandth of its size; None for another."""
    normal = np.linalg.svd(corners - corners.mean(axis=0))[2][2]
    away = np.abs((corners - corners.mean(axis=0)) @ normal).max()
    if len(corners) > 3 and away > 1e-3 * np.ptp(corners, axis=0).max():
        return None
    return ears(corners)


def _sides(corners, winding, spacing):
    """Side of the solid at points of triangles, shape (t, points): 1 behind, −1 before, 0 both or none."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, size, out=np.zeros_like(normal), where=size > 0.0)
    places = np.einsum("lk,tkx->tlx", LOOKS, corners)
    shift = GAP * spacing * normal[:, None]
    before, behind = (winding.inside((places + s * shift).reshape(-1, 3)) for s in (1.0, -1.0))
    return (behind.astype(int) - before).reshape(len(corners), -1)


def _boundary(corners, winding, spacing):
    """Corners of the boundary, (k, 3, 3), 1 or −1 for triangles that are whole in it, and a mask of divided ones."""
    parts, of = _parted(corners, np.arange(len(corners)), COARSE * spacing)
    sides = _sides(parts, winding, spacing)
    low, high = np.full(len(corners), 2), np.full(len(corners), -2)
    np.minimum.at(low, of, sides.min(axis=1))
    np.maximum.at(high, of, sides.max(axis=1))
    side, cut = np.where(low == high, low, 0), low != high
    kept = [_turned(corners[side != 0], side[side != 0])]
    parts, sides = parts[cut[of]], sides[cut[of]]
    while len(parts):
        same = (sides == sides[:, :1]).all(axis=1) | (_longest(parts)[0] <= SMALL * spacing)
        kept.append(_turned(parts[same & (sides[:, 0] != 0)], sides[same & (sides[:, 0] != 0), 0]))
        parts = _halved(parts[~same])
        sides = _sides(parts, winding, spacing) if len(parts) else np.zeros((0, len(LOOKS)), dtype=int)
    return np.vstack(kept), side, cut


def _turned(corners, side):
    """Triangles, by corners or numbers, turned if their side is below 0."""
    return np.where((side < 0).reshape(-1, *(corners.ndim - 1) * (1,)), corners[:, ::-1], corners)


def _longest(corners):
    """Length of the longest edge of triangles (t, 3, 3), and the number of its first corner."""
    length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return length.max(axis=1, initial=0.0), length.argmax(axis=1)


def _halved(corners):
    """Both halves of triangles, divided at the middle of their longest edge."""
    if not len(corners):
        return corners
    _, at = _longest(corners)
    row = np.arange(len(corners))
    a, b, c = (corners[row, (at + k) % 3] for k in range(3))
    middle = 0.5 * (a + b)
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def _parted(corners, of, length):
    """Pieces of triangles with edges up to a length, and the triangle of each."""
    done, owners = [], []
    while len(corners):
        short = _longest(corners)[0] <= length
        done.append(corners[short])
        owners.append(of[short])
        corners, of = _halved(corners[~short]), np.tile(of[~short], 2)
    return np.concatenate(done), np.concatenate(owners)


def _of_sums(sums):
    """`Moments` from the integrals of `Winding.sums`."""
    if not sums[0] > 0.0:
        return Moments(0.0, np.zeros(3), np.zeros((3, 3)))
    volume, centre = float(sums[0]), sums[1:4] / sums[0]
    xx, xy, xz, yy, yz, zz = sums[4:]
    second = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - volume * np.outer(centre, centre)
    return Moments(volume, centre, np.trace(second) * np.eye(3) - second)


def _remarks(pieces, holes, doubled, inverted, sheets):
    """Faults of a surface, each a text."""
    if holes:
        yield (
            f"the surface is open at {len(pieces.ends)} edges, in {len(holes)} holes that were bridged, the largest "
            f"{holes[0]:.3g} m across"
        )
    if doubled:
        yield f"{doubled} triangles lay on others and were left out"
    if pieces.crowded:
        yield f"{pieces.crowded} edges have more than two triangles: parts that touch there are one solid"
    if inverted:
        yield f"{inverted} of {len(pieces.triangles)} triangles faced inward and were turned"
    if len(sheets):
        yield f"{len(sheets)} triangles, {sheets.sum():.3g} m², bound nothing: sheets without thickness are not felt"
