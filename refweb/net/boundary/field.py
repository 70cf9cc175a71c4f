"""Depth in a solid as a field of cubic B-splines on a grid, with continuous second derivatives.

The distance from the surface is known at the points of a grid, see `refweb.net.boundary.distances`. Between the points
the depth is a sum of cubic B-splines, whose gradient and Hessian are continuous. A force that is the gradient of an
energy of this depth therefore conserves the energy. Its coefficients are the distances δ less a sixth of their second
differences,

    c = δ − (δ(+1) − 2 δ + δ(−1))/6 of each axis,

which reproduces cubic polynomials [1]_: the field misses a smooth surface by O(h⁴), and rounds edges by 0.2 h. Its
waves beside edges are smaller than those of splines that interpolate δ: on the surface of a box gradients reach 1.09,
not 1.19.

May change: private functions; `BYTES`, and how thickness is found (`LOOKS`, `OPPOSITE`, `BEYOND`, `THINNER`), which the
penetration check compares with. Must stay: the numbers of a field in the order of `ORIGIN` to `HEAD`, since kernels
read them at their address; the `Field`, which shapes keep as long as kernels may read it; `GAP`, which `repair` uses.
`AROUND` and the formula of c change depth, so contact of all meshes and terrains. Must stay as well: `places_on`, which
`shapes.terrain` imports; `field_of`, which `shapes.filled` imports. Tests: ``tests/net/test_boundary.py``,
``tests/effects/test_mesh_bodies.py``.

References
----------
.. [1] C. de Boor, G. J. Fix, "Spline approximation by quasiinterpolants", J. Approx. Theory 8 (1973) 19–45,
   doi:10.1016/0021-9045(73)90029-4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ... import memory
from ...compiled.rows import number_at
from ...kernels import kernel

ORIGIN, FINE, COUNTS, MARGIN, HEAD = 0, 3, 4, 7, 8
"""Positions in the numbers of a field: first point of the grid [m], points per metre, numbers of points, distance of
the body from the end of the field [m], and then the coefficients."""
AROUND = 4
"""Number of points of the grid on each side of the body."""
BYTES = 40.0
"""Memory for each point of a grid while its field is made [byte]."""
GAP = 0.02
"""Width of gaps in a repaired solid that are ignored, over the spacing of the grid."""
LOOKS, OPPOSITE, BEYOND, THINNER = 4000, -0.8, 1.5, 0.01
"""Number of surface points from which thickness is measured; rate of decrease of depth beyond the middle of a wall, and
cells behind it at which it is measured; share of the surface that may be thinner."""


@kernel(forceinline=True)
def _weights(t):
    """Values, first and second derivatives of the four splines at a position in a cell."""
    r = 1.0 - t
    return (
        (r * r * r / 6.0, (3.0 * t - 6.0) * t * t / 6.0 + 2.0 / 3.0, ((3.0 - 3.0 * t) * t + 3.0) * t / 6.0 + 1.0 / 6.0,
         t * t * t / 6.0),
        (-0.5 * r * r, (1.5 * t - 2.0) * t, (1.0 - 1.5 * t) * t + 0.5, 0.5 * t * t),
        (r, 3.0 * t - 2.0, 1.0 - 3.0 * t, t),
    )  # fmt: skip


@kernel()
def _outside(u, v, w, fine, most0, most1, most2, margin):
    """Depth outside the field, as `depth`: at most the one that the body can have there."""
    a, b, c = u - min(max(u, 1.0), most0), v - min(max(v, 1.0), most1), w - min(max(w, 1.0), most2)
    off = math.sqrt(a * a + b * b + c * c)
    return -margin - off / fine, (-a / off, -b / off, -c / off), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel(forceinline=True)
def depth_at(p, address):
    """Depth, as `depth`, by a field whose numbers are at an address."""
    at = int(address)
    fine = number_at(at, FINE)
    u = (p[0] - number_at(at, ORIGIN)) * fine
    v = (p[1] - number_at(at, ORIGIN + 1)) * fine
    w = (p[2] - number_at(at, ORIGIN + 2)) * fine
    n0, n1, n2 = int(number_at(at, COUNTS)), int(number_at(at, COUNTS + 1)), int(number_at(at, COUNTS + 2))
    if not (1.0 <= u <= n0 - 2.0 and 1.0 <= v <= n1 - 2.0 and 1.0 <= w <= n2 - 2.0):
        return _outside(u, v, w, fine, n0 - 2.0, n1 - 2.0, n2 - 2.0, number_at(at, MARGIN))
    i, j, k = min(int(u), n0 - 3), min(int(v), n1 - 3), min(int(w), n2 - 3)
    (x, dx, ddx), (y, dy, ddy), (z, dz, ddz) = _weights(u - i), _weights(v - j), _weights(w - k)
    f = f0 = f1 = f2 = f00 = f01 = f02 = f11 = f12 = f22 = 0.0
    for a in range(4):
        g = g1 = g2 = g11 = g12 = g22 = 0.0
        for b in range(4):
            start = HEAD + ((i - 1 + a) * n1 + j - 1 + b) * n2 + k - 1
            c0, c1 = number_at(at, start), number_at(at, start + 1)
            c2, c3 = number_at(at, start + 2), number_at(at, start + 3)
            s = z[0] * c0 + z[1] * c1 + z[2] * c2 + z[3] * c3
            s2 = dz[0] * c0 + dz[1] * c1 + dz[2] * c2 + dz[3] * c3
            s22 = ddz[0] * c0 + ddz[1] * c1 + ddz[2] * c2 + ddz[3] * c3
            g, g2, g22 = g + y[b] * s, g2 + y[b] * s2, g22 + y[b] * s22
            g1, g12, g11 = g1 + dy[b] * s, g12 + dy[b] * s2, g11 + ddy[b] * s
        f, f1, f2 = f + x[a] * g, f1 + x[a] * g1, f2 + x[a] * g2
        f11, f12, f22 = f11 + x[a] * g11, f12 + x[a] * g12, f22 + x[a] * g22
        f0, f01, f02, f00 = f0 + dx[a] * g, f01 + dx[a] * g1, f02 + dx[a] * g2, f00 + ddx[a] * g
    bend = fine * fine
    hessian = bend * f00, bend * f01, bend * f02, bend * f11, bend * f12, bend * f22
    return f, (fine * f0, fine * f1, fine * f2), hessian


@kernel()
def depth(p, grown):
    """Depth, as `refweb.net.grown_core.depth`, by the field at ``grown.field``, grown by the radius."""
    deep, gradient, hessian = depth_at(p, grown.field)
    return deep + grown.radius, gradient, hessian


depth.convex = False


@kernel()
def depths(places, address, result):
    """Write the depth at points (n, 3) and its gradient to ``result (n, 4)``."""
    for i in range(places.shape[0]):
        deep, g, _ = depth_at((places[i, 0], places[i, 1], places[i, 2]), address)
        result[i, 0], result[i, 1], result[i, 2], result[i, 3] = deep, g[0], g[1], g[2]


@dataclass(frozen=True, eq=False)
class Field:
    """The depth in a solid.

    Attributes
    ----------
    numbers : ndarray
        Numbers for kernels, see `ORIGIN`.
    spacing : float
        Spacing h of its grid [m].
    counts : tuple of 3 int
        Numbers of points along the axes.
    error : float
        Largest |depth| on the surface, where it should be 0 [m], at corners, on edges and in the middle of triangles.
    thickness : float
        Least depth in the middle of a wall [m], see `_thickness`.
    offset : float
        Distance of the surface of depth 0 from the surface of the solid, outward [m].
    """

    numbers: np.ndarray
    spacing: float
    counts: tuple[Any, ...]
    error: float
    thickness: float
    offset: float

    @property
    def margin(self):
        """Distance from the body up to which the field is defined [m]."""
        return float(self.numbers[MARGIN])

    @property
    def address(self):
        """Address of its numbers in memory, valid as long as the field exists."""
        return float(self.numbers.ctypes.data)

    def at(self, places):
        """Depth [m], shape (n,), and gradient, shape (n, 3), at points (n, 3)."""
        result = np.empty((len(places), 4))
        depths(np.ascontiguousarray(places), self.address, result)
        return result[:, 0], result[:, 1:]


def field_of(points, triangles, cells, around=AROUND, known=None, winding=None, offset=0.0):
    """The `Field` of the solid inside a surface, with a number of cells along its longest side.

    ``around`` is the number of grid points on each side of the solid. A wider field takes error, thickness and offset
    from the field ``known``. For the boundary of a `refweb.net.boundary.repair.Repaired` solid ``winding`` decides
    which points are inside. The solid is thickened by ``offset`` [m] on each side. A grid that does not fit into memory
    is refused.
    """
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    h = float(size.max()) / cells
    if known is not None:
        offset = known.offset
    around += int(np.ceil(offset / h))
    counts = np.ceil(size / h).astype(np.int64) + 1 + 2 * around
    shape = tuple(counts.tolist())
    memory.check(BYTES * float(np.prod(counts.astype(float))), f"the {' × '.join(map(str, shape))} points of its grid")
    origin = low + 0.5 * size - 0.5 * h * (counts - 1)
    deep = _depths(points, triangles, origin, h, shape, winding) + offset
    head = [*origin, 1.0 / h, *counts, (around - 1) * h - offset]
    numbers = np.concatenate([head, _coefficients(deep).ravel()])
    field = Field(numbers, h, shape, 0.0, 0.0, offset)
    if known is not None:
        return replace(field, error=known.error, thickness=known.thickness)
    error = max(np.abs(field.at(places_on(points, triangles))[0]).max(), offset)
    return replace(field, error=float(error), thickness=_thickness(field, points, triangles) + offset)


def _depths(points, triangles, origin, h, shape, winding):
    """Depth at the points of a grid [m]."""
    from .distances import signed, unsigned

    deep, nearest = np.full(shape, np.inf), np.full(shape, -1, dtype=np.int32)
    if winding is None:
        signed(points, triangles, origin, h, deep, nearest, np.zeros(shape, dtype=np.uint8))
        return deep
    unsigned(points, triangles, origin, h, deep, nearest)
    del nearest
    np.sqrt(deep, out=deep)
    for i in range(shape[0]):
        places = np.stack(np.meshgrid(*(h * np.arange(n) for n in (1, *shape[1:])), indexing="ij"), axis=-1)
        places = (places + origin + [i * h, 0.0, 0.0]).reshape(-1, 3)
        inside = winding.inside(places)
        # A point far from the boundary with the solid around it lies in a gap between parts.
        far = np.flatnonzero(~inside & (deep[i].ravel() > 4.0 * GAP * h))
        for step in GAP * h * np.vstack([np.eye(3), -np.eye(3)]) if len(far) else ():
            inside[far] |= winding.inside(places[far] + step)
        deep[i][~inside.reshape(shape[1:])] *= -1.0
    return deep


def _coefficients(deep):
    """Coefficients of the splines."""
    c = deep.copy()
    for axis in range(3):
        d, into = np.moveaxis(deep, axis, 0), np.moveaxis(c, axis, 0)
        into[1:-1] -= (d[2:] - 2.0 * d[1:-1] + d[:-2]) / 6.0
    return c


def places_on(points, triangles):
    """Points of a surface at which the field may have its largest errors."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    edges = [(1.0 - t) * p + t * q for p, q in ((a, b), (b, c), (c, a)) for t in (0.25, 0.5)]
    return np.vstack([points, *edges, (a + b + c) / 3.0])


def _thickness(field, points, triangles):
    """Least distance from the middle of a wall to its surface [m], except for a share `THINNER` of the surface.

    From points on the surface the depth increases along the inner normal, and then decreases towards the surface ahead.
    If that surface is opposite, both bound a wall. No wall is thicker than the largest depth.
    """
    rng = np.random.default_rng(0)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    t = rng.choice(len(triangles), LOOKS, p=area / area.sum())
    u, v = rng.random((2, LOOKS))
    fold = u + v > 1.0
    u, v = np.where(fold, 1.0 - u, u)[:, None], np.where(fold, 1.0 - v, v)[:, None]
    places, inward = a[t] + u * (b[t] - a[t]) + v * (c[t] - a[t]), -normal[t] / area[t][:, None]
    deepest, walls, height = 0.0, np.full(LOOKS, np.inf), 0.5 * field.spacing
    numbers = np.arange(LOOKS)
    while len(numbers):
        deep, gradient = field.at(places[numbers] + height * inward[numbers])
        deepest = max(deepest, float(deep.max()))
        past = (gradient * inward[numbers]).sum(axis=1) < 0.5
        over = numbers[past]
        _, beyond = field.at(places[over] + (height + BEYOND * field.spacing) * inward[over])
        wall = over[(beyond * inward[over]).sum(axis=1) < OPPOSITE]
        walls[wall] = height
        numbers, height = numbers[~past], height + 0.5 * field.spacing
    return float(min(np.sort(walls)[int(THINNER * LOOKS)], deepest))
