"""Depth in a body, a core grown by a radius: value, gradient and Hessian, by compiled kernels.

The core is the centre of a sphere, the axis of a ring, or, for a box or cylinder with rounded edges, a smaller box or
cylinder with half sizes c. r is the radius of growth. With w = l − clip(l, −c, c), the vector from the nearest point of
the core to the point l, r − |w| is the distance from the surface, negative outside. This is the depth up to `EXACT` of
r, and beyond that if one face is much nearer than the others. For a core that is a point or a line it is the depth
everywhere.

Farther inside, the distance has a kink where two faces are equally near. There a line has its largest depth, a node
jumps from one face to the other, and at an edge of the core the force of a line drops to 1/√2. The normal of one face
is then not the gradient of an energy. Therefore the depth t at a point is the parameter of the surface through it, of a
family of rounded boxes: their half sizes are c − g(t), the radius of their edges is ρ(t) = r − t + g(t), and their
faces are t below those of the body. g is 0 up to `EXACT` of r, then a parabola, then a line with slope `WIDENING`: ρ
decreases from r to r/4 and then increases with depth. If g exceeds a half size, a roof joins opposite faces. With b =
(|l| − c + g)₊ of each axis, or √(l² + (g − c)²) + g − c where g > c, the depth solves

    |b(l, t)| = ρ(t).

This is convex in l and t together. The depth is therefore concave, and its gradient is continuous, of length 1 at the
surface and at most 1 elsewhere. Newton's method converges to the root from the distance of the nearest face.

The depth with kinks, and the normal of the nearest face, gives worse results with the default rounding: of 60 taut
cables bent over the edge of a box Newton's method then refuses 48, here none; nets that fall on a box then keep their
energy to 0.1, here to 1e-5 with order 2. A `WIDENING` of 1, with a constant edge radius, gives the same results except
for a rounding of 1e-4 of the size, at which the order is 1. A `WIDENING` of 2 gives less depth in the middle.

May change: private functions and how the root is found. Must stay: value, gradient and Hessian of one depth, which is
concave with a gradient of at most 1: contact, its bounds and `effects.contact.line_body_ccd` rely on both; the
signature ``(point, grown)``, which is that of `Shape.depth`. `EXACT` and `WIDENING` change contact deep in bodies.
Tests: ``tests/effects/test_deep_contact.py``.
"""

from __future__ import annotations

import math

from ..kernels import kernel

EXACT = 0.5
"""Depth up to which depth is the distance from the surface, over the radius of growth."""
WIDENING = 1.5
"""Slope of g far inside: faces whose depths differ by less than this factor share the force."""


@kernel()
def _beyond(at, c):
    return at - c if at > c else at + c if at < -c else 0.0


@kernel()
def _shrinkage(t, radius):
    """Shrinkage g at a depth, with g' and g''."""
    past, width = t - EXACT * radius, (1.0 - EXACT) * radius
    if past <= 0.0:
        return 0.0, 0.0, 0.0
    if past < WIDENING * width:
        return 0.5 * past * past / width, past / width, 1.0 / width
    return WIDENING * (past - 0.5 * WIDENING * width), WIDENING, 0.0


@kernel()
def _half_square(at, c):
    """½ b² and its derivatives by l and c: (b²/2, ∂l, ∂c, ∂l∂l, ∂l∂c, ∂c∂c)."""
    if c >= 0.0:
        b, sign = abs(at) - c, math.copysign(1.0, at)
        return (0.5 * b * b, b * sign, -b, 1.0, -sign, 1.0) if b > 0.0 else (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    root = math.sqrt(at * at + c * c)
    b, i, j = root - c, at / root, c / root
    return 0.5 * b * b, b * i, -b * b / root, 1.0 - j * j * j, -i * i * i, 2.0 - 3.0 * j + j * j * j


@kernel()
def _smooth(l0, l1, l2, radius, c0, c1, c2, t):
    """Depth of a box, as `depth`, near several faces; ``t`` is the depth of the nearest face."""
    for _ in range(60):
        g, g1, _ = _shrinkage(t, radius)
        b0, b1, b2 = _half_square(l0, c0 - g), _half_square(l1, c1 - g), _half_square(l2, c2 - g)
        size, rho = math.sqrt(2.0 * (b0[0] + b1[0] + b2[0])), radius - t + g
        if not size > rho:
            break
        after = t - (size - rho) / (1.0 - g1 - g1 * (b0[2] + b1[2] + b2[2]) / size)
        if not after < t:
            break
        t = after
    g, g1, g2 = _shrinkage(t, radius)
    rho, rho1 = radius - t + g, g1 - 1.0
    b0, b1, b2 = _half_square(l0, c0 - g), _half_square(l1, c1 - g), _half_square(l2, c2 - g)
    by_t = -g1 * (b0[2] + b1[2] + b2[2]) - rho * rho1
    by_tt = g1 * g1 * (b0[5] + b1[5] + b2[5]) - g2 * (b0[2] + b1[2] + b2[2]) - rho1 * rho1 - rho * g2
    d0, d1, d2 = -b0[1] / by_t, -b1[1] / by_t, -b2[1] / by_t
    m0, m1, m2 = -g1 * b0[4], -g1 * b1[4], -g1 * b2[4]
    h00 = -(b0[3] + 2.0 * m0 * d0 + by_tt * d0 * d0) / by_t
    h11 = -(b1[3] + 2.0 * m1 * d1 + by_tt * d1 * d1) / by_t
    h22 = -(b2[3] + 2.0 * m2 * d2 + by_tt * d2 * d2) / by_t
    h01 = -(m0 * d1 + m1 * d0 + by_tt * d0 * d1) / by_t
    h02 = -(m0 * d2 + m2 * d0 + by_tt * d0 * d2) / by_t
    h12 = -(m1 * d2 + m2 * d1 + by_tt * d1 * d2) / by_t
    return t, (d0, d1, d2), (h00, h01, h02, h11, h12, h22)


@kernel()
def grown_box(l0, l1, l2, radius, c0, c1, c2, thin):
    """Depth of a box, as `depth`; ``thin`` is True if its core is a point or a line."""
    w0, w1, w2 = _beyond(l0, c0), _beyond(l1, c1), _beyond(l2, c2)
    distance = math.sqrt(w0 * w0 + w1 * w1 + w2 * w2)
    if distance > 0.0 and (thin or distance >= (1.0 - EXACT) * radius):
        inverse = 1.0 / distance
        g0, g1, g2 = -w0 * inverse, -w1 * inverse, -w2 * inverse
        b0 = (1.0 if w0 != 0.0 else 0.0) - g0 * g0
        b1 = (1.0 if w1 != 0.0 else 0.0) - g1 * g1
        b2 = (1.0 if w2 != 0.0 else 0.0) - g2 * g2
        bend = (-b0 * inverse, g0 * g1 * inverse, g0 * g2 * inverse)
        return radius - distance, (g0, g1, g2), (*bend, -b1 * inverse, g1 * g2 * inverse, -b2 * inverse)
    f0, f1, f2 = c0 - abs(l0), c1 - abs(l1), c2 - abs(l2)
    smallest = min(f0, f1, f2)
    at = 0 if f0 == smallest else 1 if f1 == smallest else 2
    g = _shrinkage(radius + smallest, radius)[0]
    others = min(f1 if at == 0 else f0, f1 if at == 2 else f2)
    if not thin and (others < g or min(c0, c1, c2) < g):
        return _smooth(l0, l1, l2, radius, c0, c1, c2, radius + smallest)
    g0 = math.copysign(1.0, -l0) if at == 0 else 0.0
    g1 = math.copysign(1.0, -l1) if at == 1 else 0.0
    g2 = math.copysign(1.0, -l2) if at == 2 else 0.0
    return radius + smallest, (g0, g1, g2), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


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
        thin = (c[0] > 0.0) + (c[1] > 0.0) + (c[2] > 0.0) < 2
        return grown_box(p[0], p[1], p[2], grown.radius, c[0], c[1], c[2], thin)
    out = math.sqrt(p[0] * p[0] + p[1] * p[1])
    inverse = 1.0 / out if out > 0.0 else 0.0
    e0, e1 = (p[0] * inverse, p[1] * inverse) if out > 0.0 else (1.0, 0.0)
    values = grown_box(out, 0.0, p[2], grown.radius, c[0], math.inf, c[2], c[0] == 0.0)
    deep, (g, _, g2), (b, _, b02, _, _, b22) = values
    around = g * inverse if out > 0.0 else b
    bend = (b * e0 * e0 + around * e1 * e1, (b - around) * e0 * e1, b02 * e0, b * e1 * e1 + around * e0 * e0)
    return deep, (g * e0, g * e1, g2), (*bend, b02 * e1, b22)
