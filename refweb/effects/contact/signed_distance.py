"""Where a line touches a body of any shape.

A shape is a core that has grown by a radius r: a sphere the point in its centre, a ring its axis, a box or a cylinder
with rounded edges a smaller box or cylinder. With the core's half sizes c, and w = l − clip(l, −c, c) from its nearest
point to the point l, the depth is r − |w| outside of the core, and r plus the least distance from the core's faces
inside. That is the distance from the surface, negative outside: concave, of a gradient of length 1, which is continuous
up to the core.

A line that lies on a face, or along a ring or a cylinder, has no single nearest point: a force at the deepest one would
jump from end to end. These shapes touch each element at both ends and once in between, at the place ξ where
W(ξ) δ(ξ)^(p + 1) is largest, with the depth δ, the exponent p of the penalty and the window W = 4 ξ (1 − ξ). On a
straight element that is one place, since the roots of W and δ are concave; it never jumps, and fades out where it nears
an end, whose own contact takes over.
"""

from __future__ import annotations

import math

from ...kernels import kernel
from ...net.shapes import CYLINDER, SPHERE
from ..vectors import dot
from .nearest_point import AWAY, AXES, CORE, GROWTH, KIND, POWER, SAMPLES, far, point, share

PLACES = 3
"""Largest number of contacts of an element."""


@kernel()
def _beyond(at, c):
    return at - c if at > c else at + c if at < -c else 0.0


@kernel()
def grown_box(l0, l1, l2, radius, c0, c1, c2):
    """As `depth`, of a box."""
    w0, w1, w2 = _beyond(l0, c0), _beyond(l1, c1), _beyond(l2, c2)
    distance = math.sqrt(w0 * w0 + w1 * w1 + w2 * w2)
    if distance > 0.0:
        g0, g1, g2 = -w0 / distance, -w1 / distance, -w2 / distance
        b0 = (1.0 if w0 != 0.0 else 0.0) - g0 * g0
        b1 = (1.0 if w1 != 0.0 else 0.0) - g1 * g1
        b2 = (1.0 if w2 != 0.0 else 0.0) - g2 * g2
        bend = (-b0 / distance, g0 * g1 / distance, g0 * g2 / distance)
        return radius - distance, (g0, g1, g2), (*bend, -b1 / distance, g1 * g2 / distance, -b2 / distance)
    f0, f1, f2 = c0 - abs(l0), c1 - abs(l1), c2 - abs(l2)
    least = min(f0, f1, f2)
    flat = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if f0 == least:
        return radius + least, (math.copysign(1.0, -l0), 0.0, 0.0), flat
    if f1 == least:
        return radius + least, (0.0, math.copysign(1.0, -l1), 0.0), flat
    return radius + least, (0.0, 0.0, math.copysign(1.0, -l2)), flat


@kernel()
def depth(kind, l0, l1, l2, radius, c0, c1, c2):
    """Depth of a point [m], its gradient and its Hessian [1/m].

    Parameters
    ----------
    kind : int
        Kind of the shape.
    l0, l1, l2 : float
        The point, from the centre along the shape's axes [m]; a ring and a cylinder have theirs along the third.
    radius : float
        Of growth [m].
    c0, c1, c2 : float
        Half sizes of the core [m]; of a cylinder's the radius stands first.

    Returns
    -------
    depth : float
    gradient : tuple of 3 float
    hessian : tuple of 6 float
        Of the axes 00, 01, 02, 11, 12, 22.
    """
    if kind != CYLINDER:
        return grown_box(l0, l1, l2, radius, c0, c1, c2)
    out = math.hypot(l0, l1)
    e0, e1, inverse = (l0 / out, l1 / out, 1.0 / out) if out > 0.0 else (1.0, 0.0, 0.0)
    deep, (g, _, g2), (b, _, b02, _, _, b22) = grown_box(out, 0.0, l2, radius, c0, math.inf, c2)
    around = g * inverse
    bend = (b * e0 * e0 + around * e1 * e1, (b - around) * e0 * e1, b02 * e0, b * e1 * e1 + around * e0 * e0)
    return deep, (g * e0, g * e1, g2), (*bend, b02 * e1, b22)


@kernel()
def along_axes(data, c, nodes, p):
    """A vector's components along the axes of the body."""
    at = AWAY + 3 * nodes + AXES
    return (
        data[c, at] * p[0] + data[c, at + 1] * p[1] + data[c, at + 2] * p[2],
        data[c, at + 3] * p[0] + data[c, at + 4] * p[1] + data[c, at + 5] * p[2],
        data[c, at + 6] * p[0] + data[c, at + 7] * p[1] + data[c, at + 8] * p[2],
    )


@kernel()
def from_axes(data, c, nodes, q):
    """The vector of components along the axes of the body."""
    at = AWAY + 3 * nodes + AXES
    return (
        data[c, at] * q[0] + data[c, at + 3] * q[1] + data[c, at + 6] * q[2],
        data[c, at + 1] * q[0] + data[c, at + 4] * q[1] + data[c, at + 7] * q[2],
        data[c, at + 2] * q[0] + data[c, at + 5] * q[1] + data[c, at + 8] * q[2],
    )


@kernel()
def within(x, cells, data, c, nodes, functions, place):
    """p, p', p'' along the body's axes at a place of cell c, then depth, its gradient and its Hessian."""
    p, d, e = point(x, cells, data, c, nodes, functions, place)
    p, d, e = along_axes(data, c, nodes, p), along_axes(data, c, nodes, d), along_axes(data, c, nodes, e)
    at = AWAY + 3 * nodes
    core = data[c, at + CORE], data[c, at + CORE + 1], data[c, at + CORE + 2]
    deep, g, bend = depth(int(data[c, at + KIND]), p[0], p[1], p[2], data[c, at + GROWTH], core[0], core[1], core[2])
    return p, d, e, deep, g, bend


@kernel()
def bent(bend, p):
    """Product of a Hessian and a vector."""
    return (
        bend[0] * p[0] + bend[1] * p[1] + bend[2] * p[2],
        bend[1] * p[0] + bend[3] * p[1] + bend[4] * p[2],
        bend[2] * p[0] + bend[4] * p[1] + bend[5] * p[2],
    )


@kernel()
def window(data, c, nodes, place, inner):
    """(W, W', W'') of a contact; 1 at an end, and of a sphere."""
    if not inner or data[c, AWAY + 3 * nodes + KIND] == SPHERE:
        return 1.0, 0.0, 0.0
    return 4.0 * place * (1.0 - place), 4.0 - 8.0 * place, -8.0


@kernel()
def rise(data, c, nodes, place, d, e, deep, g, bend):
    """What vanishes at the deepest place of an element, positive before it, and its slope.

    W' δ + (p + 1) W δ', or where nothing is touched δ'; of a sphere the rate of −½ |w|², which is linear.
    """
    at, slope, curve = AWAY + 3 * nodes, dot(g, d), dot(d, bent(bend, d)) + dot(g, e)
    if data[c, at + KIND] == SPHERE:
        away = data[c, at + GROWTH] - deep
        return away * slope, away * curve - slope * slope
    if deep <= 0.0:
        return slope, curve
    power, (w, w1, w2) = data[c, at + POWER], window(data, c, nodes, place, True)
    return w1 * deep + (power + 1.0) * w * slope, w2 * deep + (power + 2.0) * w1 * slope + (power + 1.0) * w * curve


@kernel()
def deepest(x, cells, data, c, nodes, functions):
    """(place within cell c, depth there) of the contact between its ends; of a sphere, that with the whole of it."""
    low, high, place, at = 0.0, 1.0, 0.5, AWAY + 3 * nodes
    if nodes > 2:
        most = -math.inf
        for n in range(SAMPLES + 1):
            deep = within(x, cells, data, c, nodes, functions, n / SAMPLES)[3]
            faded = window(data, c, nodes, n / SAMPLES, True)[0] ** (1.0 / (data[c, at + POWER] + 1.0))
            if (felt := faded * deep if deep > 0.0 else deep) > most:
                most, place = felt, n / SAMPLES
        low, high = max(place - 1.0 / SAMPLES, 0.0), min(place + 1.0 / SAMPLES, 1.0)
    if data[c, at + KIND] == SPHERE:
        for end in (low, high):
            _, d, _, deep, g, _ = within(x, cells, data, c, nodes, functions, end)
            if (end == 0.0 and dot(g, d) <= 0.0) or (end == 1.0 and dot(g, d) >= 0.0):
                return end, deep
    for _ in range(100):  # Newton's method, by bisection where it leaves the bracket
        _, d, e, deep, g, bend = within(x, cells, data, c, nodes, functions, place)
        slope = dot(g, d)
        if nodes == 2 and deep + max(slope * (high - place), slope * (low - place)) <= 0.0:
            return place, deep  # concave: nowhere deep enough
        value, curve = rise(data, c, nodes, place, d, e, deep, g, bend)
        if value > 0.0:
            low = place
        else:
            high = place
        step = place - value / curve if curve < 0.0 else -1.0
        if not low <= step <= high:
            step = 0.5 * (low + high)
        moved, place = abs(step - place), step
        if moved <= 1e-15:
            break
    return place, within(x, cells, data, c, nodes, functions, place)[3]


@kernel()
def contacts(x, cells, data, first, pieces, nodes, functions, found):
    """Write (cell, place, whether the place may move) of each contact of a line to ``found``; return their number."""
    count, best = 0, 0.0
    for c in range(first, first + pieces):
        if far(x, cells, data, c, nodes):
            continue
        place, deep = deepest(x, cells, data, c, nodes, functions)
        inner = 0.0 < place < 1.0
        if data[c, AWAY + 3 * nodes + KIND] == SPHERE:
            if deep > best:
                best, count = deep, 1
                found[0, 0], found[0, 1], found[0, 2] = c, place, inner
            continue
        if deep > 0.0 and inner:
            found[count, 0], found[count, 1], found[count, 2] = c, place, 1.0
            count += 1
        for end in range(2):
            if within(x, cells, data, c, nodes, functions, float(end))[3] > 0.0:
                found[count, 0], found[count, 1], found[count, 2] = c, end, 0.0
                count += 1
    return count


@kernel()
def moves(data, c, nodes, functions, place, inner, d, e, deep, g, bend, z):
    """Write by how much the place of a contact moves with each node, along the body's axes, to ``z (nodes + 1, 3)``.

    The last row is of the body; all are zero unless ``inner``.
    """
    z[:] = 0.0
    curve = rise(data, c, nodes, place, d, e, deep, g, bend)[1]
    if not inner or not curve < 0.0:
        return
    (w, w1, _), at, turned = window(data, c, nodes, place, True), AWAY + 3 * nodes, bent(bend, d)
    own = (data[c, at + POWER] + 1.0) * w if data[c, at + KIND] != SPHERE else data[c, at + GROWTH] - deep
    for a in range(nodes + 1):
        value, slope = share(a, nodes, functions, place) if a < nodes else (-1.0, 0.0)
        for k in range(3):
            z[a, k] = -(w1 * value * g[k] + own * (value * turned[k] + slope * g[k])) / curve
