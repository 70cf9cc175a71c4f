"""Triangulation of polygons in space by cutting off ears.

An ear is a corner that does not point inward and whose triangle holds no other corner. A polygon whose sides do not
cross has at least two ears [1]_; the ear with the largest least angle is cut off first.

VTK 9.7 cuts ears in a hundredth of the time, and gives up a face with a hole whose outline goes there and back along
one line, as CAD programs write it; of a polygon with a repeated corner it leaves out a triangle.

May change: private functions, the choice of the ear, and `TOUCHES`, a tolerance of rounding. Must stay: triangles as
numbers of corners, and None for sides that cross: `repair` then takes a cone, and `surface_file` refuses the file.
Tests: ``tests/net/test_repair.py``.

References
----------
.. [1] G. H. Meisters, "Polygons have ears", Amer. Math. Monthly 82 (1975) 648–651, doi:10.2307/2319703.
"""

from __future__ import annotations

import numpy as np

TOUCHES = 1e-12
"""Area that counts as zero, over the square of the size of a polygon."""


def ears(corners):
    """Triangles, shape (n − 2, 3), of a polygon of corners (n, 3), by numbers; None if its sides cross."""
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    size = np.ptp(corners, axis=0).max()
    if not np.linalg.norm(normal) > TOUCHES * size**2:
        return None
    k = int(np.abs(normal).argmax())
    flat = corners[:, [(k + 1) % 3, (k + 2) % 3]] * [np.sign(normal[k]), 1.0]
    if _cross(flat, size):
        return None
    left, triangles = list(range(len(corners))), []
    while len(left) > 3:
        best, at = -np.inf, -1
        for n, b in enumerate(left):
            a, c = left[n - 1], left[(n + 1) % len(left)]
            value = _quality(flat[a], flat[b], flat[c])
            if value > best and not _holds(flat, left, (a, b, c), size):
                best, at = value, n
        if at < 0 or best < 0.0:
            return None
        triangles.append([left[at - 1], left[at], left[(at + 1) % len(left)]])
        left.pop(at)
    return np.array([*triangles, left])


def _area(a, b, c):
    """Twice the area of a triangle in the plane, positive where it turns to the left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _cross(flat, size):
    """Tell if two sides of a polygon (n, 2) cross between their ends; sides may touch."""
    a, b = flat.T, np.roll(flat.T, -1, axis=1)
    start = _area(a[:, :, None], b[:, :, None], a[:, None])  # of each corner beside each side
    end, slip = np.roll(start, -1, axis=1), TOUCHES * size**2
    apart = (np.minimum(start, end) < -slip) & (np.maximum(start, end) > slip)
    return bool((apart & apart.T).any())


def _quality(a, b, c):
    """Twice the area of a triangle over the sum of the squares of its sides."""
    square = sum(float(((p - q) ** 2).sum()) for p, q in ((a, b), (b, c), (c, a)))
    return _area(a, b, c) / square if square > 0.0 else 0.0


def _holds(flat, left, ear, size):
    """Tell if the triangle at a corner contains another remaining corner."""
    a, b, c = (flat[i] for i in ear)
    p = flat[[i for i in left if i not in ear]]
    outside = np.zeros(len(p), dtype=bool)
    for q, r in ((a, b), (b, c), (c, a)):
        outside |= _area(q, r, p.T) <= TOUCHES * size**2
    return not outside.all()
