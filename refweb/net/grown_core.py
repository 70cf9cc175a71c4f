"""Depth in a core that has grown, as compiled kernels.

A core has grown by a radius r: that of a sphere is the point in its centre, of a ring its axis, of a box or a cylinder
with rounded edges a smaller box or cylinder. With the core's half sizes c, and w = l − clip(l, −c, c) from its nearest
point to the point l, the depth is r − |w| outside of the core, and r plus the least distance from the core's faces
inside. That is the distance from the surface, negative outside: concave, of a gradient of length 1, which is continuous
up to the core.
"""

from __future__ import annotations

import math

from ..kernels import kernel


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
def depth(p, grown):
    """Depth of a point [m], its gradient and its Hessian [1/m].

    Parameters
    ----------
    p : tuple of 3 float
        The point, from the centre along the shape's axes [m].
    grown : refweb.net.rigid_body.Grown
        The shape.

    Returns
    -------
    depth : float
    gradient : tuple of 3 float
    hessian : tuple of 6 float
        Of the axes 00, 01, 02, 11, 12, 22.
    """
    c = grown.core
    if not grown.round:
        return grown_box(p[0], p[1], p[2], grown.radius, c[0], c[1], c[2])
    out = math.hypot(p[0], p[1])
    e0, e1, inverse = (p[0] / out, p[1] / out, 1.0 / out) if out > 0.0 else (1.0, 0.0, 0.0)
    deep, (g, _, g2), (b, _, b02, _, _, b22) = grown_box(out, 0.0, p[2], grown.radius, c[0], math.inf, c[2])
    around = g * inverse
    bend = (b * e0 * e0 + around * e1 * e1, (b - around) * e0 * e1, b02 * e0, b * e1 * e1 + around * e0 * e0)
    return deep, (g * e0, g * e1, g2), (*bend, b02 * e1, b22)
