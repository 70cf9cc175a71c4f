"""Winding number of a surface of triangles, and moments of the points at which it is above 1/2.

The generalised winding number [1]_ of a surface around a point is its solid angle over 4π. For a surface without a rim
it is an integer: the number of times that a straight line from the point leaves the surface, minus the number of times
that it enters. Winding numbers of parts add up: the union of overlapping parts is the set with a number above 1/2.
Lines run along the third axis, and are compared with the triangles in their cell of a grid across that axis.

May change: private functions; `MOST`, the size of the grid, which costs time alone. Must stay: the order of the ten
integrals of `Winding.sums` (1, x, y, z, xx, xy, xz, yy, yz, zz), which `repair` reads by position. `LINES` changes the
mass of some repaired solids. Tests: ``tests/net/test_repair.py``.

References
----------
.. [1] A. Jacobson, L. Kavan, O. Sorkine-Hornung, "Robust inside-outside segmentation using generalized winding
   numbers", ACM Trans. Graph. 32 (2013) 33, doi:10.1145/2461912.2461916.
"""

from __future__ import annotations

import math

import numpy as np

from ...kernels import kernel
from .crossings import triangles_by_cell
from .distances import meets

MOST = 512
"""Largest number of cells along a side of the grid of triangles."""
LINES = 1024
"""Number of lines along each side by which moments are summed."""


@kernel()
def _cell(value, low, h, count):
    return min(max(int(math.floor((value - low) / h)), 0), count - 1)


@kernel()
def _numbers(places, points, triangles, low, h, n, ends, listed, result):
    """Write the winding numbers around points (m, 3) to ``result (m,)``."""
    for p in range(places.shape[0]):
        x, y, z = places[p, 0], places[p, 1], places[p, 2]
        cell = _cell(x, low[0], h[0], n) * n + _cell(y, low[1], h[1], n)
        number = 0
        for m in range(ends[cell], ends[cell + 1]):
            side, at = meets(points, triangles[listed[m]], x, y)
            if side != 0 and at > z:
                number += side
        result[p] = number


@kernel()
def _add_part(total, x, y, z0, z1):
    """Add the moments of a segment of a line: 1, x, y, z, xx, xy, xz, yy, yz, zz."""
    length, first, second = z1 - z0, 0.5 * (z1 * z1 - z0 * z0), (z1 * z1 * z1 - z0 * z0 * z0) / 3.0
    total[0] += length
    total[1] += x * length
    total[2] += y * length
    total[3] += first
    total[4] += x * x * length
    total[5] += x * y * length
    total[6] += x * first
    total[7] += y * y * length
    total[8] += y * first
    total[9] += second


@kernel()
def _sums(points, triangles, low, h, n, ends, listed, start, step, lines, total):
    """Add up the moments of the inside along lines."""
    heights, sides = np.empty(listed.shape[0]), np.empty(listed.shape[0], np.int64)
    for i in range(lines):
        for j in range(lines):
            x, y = start[0] + (i + 0.5) * step[0], start[1] + (j + 0.5) * step[1]
            cell, count = _cell(x, low[0], h[0], n) * n + _cell(y, low[1], h[1], n), 0
            for m in range(ends[cell], ends[cell + 1]):
                side, at = meets(points, triangles[listed[m]], x, y)
                if side != 0:
                    k = count
                    while k > 0 and heights[k - 1] > at:
                        heights[k], sides[k] = heights[k - 1], sides[k - 1]
                        k -= 1
                    heights[k], sides[k], count = at, side, count + 1
            number = 0
            for k in range(count - 1):
                number -= sides[k]
                if number > 0:
                    _add_part(total, x, y, heights[k], heights[k + 1])


class Winding:
    """Winding numbers of a surface without a rim.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Corners [m].
    triangles : ndarray of int, shape (t, 3)
        Corners of each triangle.
    """

    def __init__(self, points, triangles):
        self._surface = np.ascontiguousarray(points), np.ascontiguousarray(triangles)
        n = int(np.clip(math.isqrt(len(triangles)), 1, MOST))
        used = points[np.unique(triangles)]
        self._low, size = used.min(axis=0), np.ptp(used, axis=0)
        self._size = size
        h = np.maximum(size / n, np.finfo(float).tiny)
        self._grid = self._low, h, n, *triangles_by_cell(*self._surface, self._low, h, np.array([n, n, 1]))

    def moved(self, by):
        """The winding numbers of the surface moved by a vector [m]."""
        points, triangles = self._surface
        return Winding(points + by, triangles)

    def at(self, places):
        """Winding numbers around points (m, 3), shape (m,)."""
        result = np.empty(len(places), np.int64)
        _numbers(np.ascontiguousarray(places), *self._surface, *self._grid, result)
        return result

    def inside(self, places):
        """Mask of points (m, 3) with a winding number above 1/2."""
        return self.at(places) > 0

    def sums(self):
        """Integrals of 1, x, y, z, xx, xy, xz, yy, yz, zz over the inside, shape (10,), by lines one step apart."""
        total, step = np.zeros(10), self._size / LINES
        _sums(*self._surface, *self._grid, self._low, step, LINES, total)
        return total * step[0] * step[1]
