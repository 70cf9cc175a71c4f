"""Terrain from heights: triangles between given points, and the solid block of ground below them.

May change: private functions, texts of errors, and `UPRIGHT`. Must stay: triangles that face up, on which
`shapes.terrain` relies; what `places_of`, `on_rim` and `above_ground` return. A new suffix also goes to `FORMATS` of
`shapes.terrain`. Tests: ``tests/effects/test_ground.py``.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay, QhullError

from ...errors import InputError
from ..csv_files import columns_of
from .closed import joined
from .surface_file import read

UPRIGHT = 1e-6
"""Least area of a triangle in the view from above, over its area."""


def places_of(path):
    """Points, shape (n, 3), in the unit of a file of heights, and triangles, shape (t, 3), that face up.

    A file without a surface, and two heights at one position, are refused.
    """
    if path.suffix.lower() == ".csv":
        points = columns_of(path, "xyz")
        triangles = _between(points)
    else:
        points, triangles = joined(*read(path))
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    steep = np.abs(normal[:, 2]) <= UPRIGHT * np.linalg.norm(normal, axis=1)
    if steep.any():
        at = ", ".join(f"{x:.6g}" for x in a[steep.argmax()])
        raise InputError(
            f"{int(steep.sum())} of its triangles stand upright, such as the one at ({at}): ground has one height at "
            "each place"
        )
    return points, np.where((normal[:, 2] < 0.0)[:, None], triangles[:, ::-1], triangles)


def _between(points):
    """Triangles between points (n, 3): halves of the cells of a grid, or Delaunay triangles without a grid."""
    if not np.isfinite(points).all():
        raise InputError("its heights must be finite")
    xs, ys = np.unique(points[:, 0]), np.unique(points[:, 1])
    if len(np.unique(points[:, :2], axis=0)) < len(points):
        raise InputError("it has two heights at a place: ground has one")
    if min(len(xs), len(ys)) > 1 and len(xs) * len(ys) == len(points):
        grid = np.lexsort((points[:, 1], points[:, 0])).reshape(len(xs), len(ys))
        a, b, c, d = (part.ravel() for part in (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]))
        return np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    try:
        return Delaunay(points[:, :2]).simplices.astype(np.int64)
    except QhullError:
        raise InputError(f"its {len(points)} places lie on one line: ground needs three at least that do not") from None


def rim_of(triangles):
    """Edges, shape (e, 2), that belong to one triangle only, in its direction."""
    ends = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, of, times = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True)
    return ends[times[of.ravel()] == 1]


def on_rim(triangles):
    """Mask of triangles with a corner on the rim."""
    return np.isin(triangles, rim_of(triangles)).any(axis=1)


def above_ground(points, triangles, bottom):
    """Corners and triangles of the block between a surface that faces up and the height of its bottom [m]."""
    count = len(points)
    low = np.column_stack([points[:, :2], np.full(count, bottom)])
    a, b = rim_of(triangles).T
    walls = np.vstack([np.column_stack([b, a, a + count]), np.column_stack([b, a + count, b + count])])
    return np.vstack([points, low]), np.vstack([triangles, count + triangles[:, ::-1], walls])
