"""Data of elements, and of pairs of elements, for the kernels of lines against lines.

Cells of a term are pairs, of the nodes of one element and of another, or elements of which any two may touch: then
`refweb.effects.self_contact.search` makes pairs of them.

May change: how the kernels are written. Must stay: fields of `ELEMENT` and `PAIR` by name: `table` writes elements,
`search.paired` pairs, and `line_line_ccd.neighbours` of pairs ``touch``, ``scale`` and ``vectors`` alone; `APART`, the
column behind `ELEMENT`; the ``scale`` 0 of a broken element; that `apart` says so only of pairs that do not touch, for
which `ROUNDING` may only rise; all names that `line_line_penalty`, `line_line_ccd` and other files import; public names
of `Place`, which other files use. Tests: ``tests/effects/test_self_contact.py``.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...compiled.rows import record_at, width_of
from ...kernels import kernel
from ..vectors import cross, dot

_common = [(name, float) for name in "touch scale length damping friction slip_velocity rolls".split()]
ELEMENT = np.dtype([*_common, ("ends", float, (2, 3))])
"""Data of an element: distance of centre lines at which they touch [m], κ of `refweb.effects.self_contact.
line_line_penalty` [N/m⁴], 0 where it is broken, natural length [m], d [s/m], μ, v_s [m/s], whether lines roll, and
reference positions of its nodes [m]. Behind these stand the numbers of the elements that it does not touch, being
within the distance of touch along the net, −1 for none."""
PAIR = np.dtype(
    [
        *_common,
        ("second", float),
        ("vectors", float, (3, 3)),
        ("elements", float, (2,)),
        ("approach", float),
        ("speed", float),
        ("closing", float),
    ]
)
"""Data of a pair: the same, natural length of the second element [m], from the first node of the first element the
vectors to the three others in the web's position [m], and the numbers of both; for bounds the largest approach of the
two elements [m], their largest relative speed [m/s] and how much their distance may fall [m], infinite where only those
of the net are known."""
APART = width_of(ELEMENT)
"""First column of the data of an element behind these."""

ROUNDING = 1e-15
"""Error of a cross product over the lengths of its factors, at most."""


class Place(NamedTuple):
    """Geometry of a pair: vectors u and w of both elements, p from the second's first node to that of the first."""

    p: tuple[Any, ...]
    u: tuple[Any, ...]
    w: tuple[Any, ...]


class Numbers(NamedTuple):
    """Constants of a pair: the distance at which it touches, κ, and natural lengths, as in its data."""

    touch: float
    scale: float
    length: float
    second: float


@kernel(forceinline=True)
def numbers_of(data, c):
    """The `Numbers` of pair c."""
    pair = record_at(PAIR, data, c, 0)
    return Numbers(pair.touch, pair.scale, pair.length, pair.second)


@kernel(forceinline=True)
def place_of(x, cells, data, c):
    """The `Place` of pair c at displacements x."""
    i, j, k, m = cells[c, 0], cells[c, 1], cells[c, 2], cells[c, 3]
    to = record_at(PAIR, data, c, 0).vectors
    u = to[0, 0] + x[j, 0] - x[i, 0], to[0, 1] + x[j, 1] - x[i, 1], to[0, 2] + x[j, 2] - x[i, 2]
    p = x[i, 0] - x[k, 0] - to[1, 0], x[i, 1] - x[k, 1] - to[1, 1], x[i, 2] - x[k, 2] - to[1, 2]
    w = (
        to[2, 0] - to[1, 0] + x[m, 0] - x[k, 0],
        to[2, 1] - to[1, 1] + x[m, 1] - x[k, 1],
        to[2, 2] - to[1, 2] + x[m, 2] - x[k, 2],
    )
    return Place(p, u, w)


@kernel(forceinline=True)
def apart(geometry, touch):
    """Tell if a pair does certainly not touch: by its middles, then by the planes that both lines are parallel to.

    Of lines parallel to rounding u × w is what rounding leaves, in any direction. An error of `ROUNDING` |u||w|
    is allowed for, by (a + b)² ≤ 1.01 a² + 101 b².
    """
    p, u, w = geometry
    uu, ww = dot(u, u), dot(w, w)
    m = p[0] + 0.5 * (u[0] - w[0]), p[1] + 0.5 * (u[1] - w[1]), p[2] + 0.5 * (u[2] - w[2])
    # within √2 touch of each other, and (a + b + c)² ≤ 3 (a² + b² + c²)
    if dot(m, m) > 0.75 * (uu + ww) + 6.0 * touch * touch:
        return True
    n = cross(u, w)
    off = dot(p, n)
    return off * off > 1.01 * touch * touch * dot(n, n) + 101.0 * ROUNDING**2 * dot(p, p) * uu * ww


@kernel(forceinline=True)
def angle_factor(n, first, last, touch):
    """(f, the product of the natural lengths), n = u × w, see `refweb.effects.self_contact.line_line_penalty`."""
    area = first * last
    inverse = 1.0 / area
    return math.sqrt(inverse * (dot(n, n) * inverse + touch * touch)), area


@kernel(forceinline=True)
def nearest(p, u, w):
    """(s, t, squared distance) of the points of two segments that are nearest each other."""
    a, b, c = dot(u, u), dot(u, w), dot(w, w)
    d, e = dot(u, p), dot(w, p)
    scale = a * c - b * b
    s = min(max((b * e - c * d) / scale, 0.0), 1.0) if scale > 0.0 else 0.0
    t = (b * s + e) / c if c > 0.0 else 0.0
    if not 0.0 <= t <= 1.0 or c == 0.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((b * t - d) / a, 0.0), 1.0) if a > 0.0 else 0.0
    q = (p[0] + s * u[0] - t * w[0], p[1] + s * u[1] - t * w[1], p[2] + s * u[2] - t * w[2])
    return s, t, dot(q, q)
