"""Search for triangles of a surface that pass through each other, by compiled kernels.

Two triangles cross if an edge of one passes through the other. Each edge is compared with the triangles in the cells of
a grid that the edge crosses, except triangles with a common corner.

May change: private functions; `MOST`, the size of the grid, which costs time alone. Must stay: what `triangles_by_cell`
returns, with cell (i, j, k) as number (i n₁ + j) n₂ + k, which `winding` reads; the pair, or (−1, −1), of `crossing`,
which `closed` reads. `ROUNDING` decides what counts as a touch. Tests: ``tests/net/test_boundary.py``.
"""

from __future__ import annotations

import numpy as np

from ...kernels import kernel

ROUNDING = 1e-12
"""Volume of a tetrahedron that counts as zero, over the product of three lengths."""
MOST = 128
"""Largest number of cells along an edge of the grid."""


@kernel()
def _volume(points, a, b, c, d):
    """Six times the volume of a tetrahedron; 0 if rounding decides its sign."""
    u0, u1, u2 = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
    v0, v1, v2 = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
    w0, w1, w2 = points[d, 0] - points[a, 0], points[d, 1] - points[a, 1], points[d, 2] - points[a, 2]
    determinant = u0 * (v1 * w2 - v2 * w1) + u1 * (v2 * w0 - v0 * w2) + u2 * (v0 * w1 - v1 * w0)
    size = (u0 * u0 + u1 * u1 + u2 * u2) * (v0 * v0 + v1 * v1 + v2 * v2) * (w0 * w0 + w1 * w1 + w2 * w2)
    return 0.0 if determinant * determinant <= ROUNDING * ROUNDING * size else determinant


@kernel()
def _passes(points, a, b, triangles, t):
    """Tell if the line from corner a to corner b passes through triangle t, from one side to the other."""
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    if a == i or a == j or a == k or b == i or b == j or b == k:
        return False
    if not _volume(points, i, j, k, a) * _volume(points, i, j, k, b) < 0.0:
        return False
    first, two, three = _volume(points, a, b, i, j), _volume(points, a, b, j, k), _volume(points, a, b, k, i)
    return (first >= 0.0 and two >= 0.0 and three >= 0.0) or (first <= 0.0 and two <= 0.0 and three <= 0.0)


@kernel()
def _cells_of(points, corners, low, h, n, span):
    """Write the first and the last cell of the grid of the box around some corners."""
    for k in range(3):
        lower, upper = points[corners[0], k], points[corners[0], k]
        for c in corners:
            lower, upper = min(lower, points[c, k]), max(upper, points[c, k])
        span[0, k] = min(max(int((lower - low[k]) / h[k]), 0), n[k] - 1)
        span[1, k] = min(max(int((upper - low[k]) / h[k]), 0), n[k] - 1)


@kernel()
def _find(points, triangles, low, h, n, count, listed, fill):
    """List the triangles of each cell (``fill``), or count them."""
    span = np.empty((2, 3), np.int64)
    for t in range(triangles.shape[0]):
        _cells_of(points, triangles[t], low, h, n, span)
        for i in range(span[0, 0], span[1, 0] + 1):
            for j in range(span[0, 1], span[1, 1] + 1):
                for k in range(span[0, 2], span[1, 2] + 1):
                    cell = (i * n[1] + j) * n[2] + k
                    if fill:
                        count[cell] -= 1
                        listed[count[cell]] = t
                    else:
                        count[cell + 1] += 1


def triangles_by_cell(points, triangles, low, h, n):
    """List the triangles in each cell of a grid.

    Parameters
    ----------
    points : ndarray, shape (corners, 3)
        Corners [m].
    triangles : ndarray of int, shape (t, 3)
        Those of each triangle.
    low, h : ndarray, shape (3,)
        Lowest corner of the grid, and edges of its cells [m].
    n : ndarray of int, shape (3,)
        Number of cells along each axis; cell (i, j, k) has the number (i n₁ + j) n₂ + k.

    Returns
    -------
    ends : ndarray of int, shape (cells + 1,)
        Start of the triangles of each cell in the list, and end of the last.
    listed : ndarray of int
        The list.
    """
    ends = np.zeros(n.prod() + 1, np.int64)
    _find(points, triangles, low, h, n, ends, np.zeros(0, np.int64), False)
    ends = np.cumsum(ends)
    listed, filled = np.empty(ends[-1], np.int64), ends[1:].copy()
    _find(points, triangles, low, h, n, filled, listed, True)
    return ends, listed


@kernel()
def _first(points, triangles, low, h, n, ends, listed):
    """A triangle, and another one through which one of its edges passes; (−1, −1) if there is none."""
    span, edge = np.empty((2, 3), np.int64), np.empty(2, np.int64)
    for t in range(triangles.shape[0]):
        for e in range(3):
            edge[0], edge[1] = triangles[t, e], triangles[t, (e + 1) % 3]
            if edge[0] > edge[1]:
                continue  # its other triangle has it the other way round
            _cells_of(points, edge, low, h, n, span)
            for i in range(span[0, 0], span[1, 0] + 1):
                for j in range(span[0, 1], span[1, 1] + 1):
                    for k in range(span[0, 2], span[1, 2] + 1):
                        cell = (i * n[1] + j) * n[2] + k
                        for m in range(ends[cell], ends[cell + 1]):
                            if _passes(points, edge[0], edge[1], triangles, listed[m]):
                                return t, listed[m]
    return -1, -1


def crossing(points, triangles):
    """Two triangles of a closed surface that pass through each other; (−1, −1) if there are none."""
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    edges = np.linalg.norm(points[triangles] - points[np.roll(triangles, 1, axis=1)], axis=2)
    h = max(float(np.median(edges)), float(size.max()) / MOST)
    n = np.maximum(np.ceil(size / h), 1.0).astype(np.int64)
    h = np.full(3, h)
    ends, listed = triangles_by_cell(points, triangles, low, h, n)
    return tuple(map(int, _first(points, triangles, low, h, n, ends, listed)))
