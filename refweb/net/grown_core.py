"""Depth in a core that has grown, as compiled kernels.

A core has grown by a radius r: that of a sphere is the point in its centre, of a ring its axis, of a box or a cylinder
with rounded edges a smaller box or cylinder, of half sizes c. With w = l − clip(l, −c, c) from its nearest point to the
point l, r − |w| is the distance from the surface, negative outside. That is the depth as far as `EXACT` of r, and
beyond where one face is much nearer than the others; of a core that is a point or a line it is the depth everywhere.

Further in, distance has creases where two faces are equally near. A line is deepest where it crosses one, a node there
jumps from one face to the next, and at an edge of the core the push of a line over it drops to 1/√2 of itself. The
normal of one face is then no slope of an energy, and a mixture of both is one for lines alone. So the depth t is that
of the surface on which the point lies, of a term of rounded boxes: their half sizes are c − g(t), the radius of their
edges ρ(t) = r − t + g(t), and their faces are t below those of the body. g is 0 up to `EXACT` of r, then a parabola,
then of the slope `WIDENING`: ρ falls from r to r/4 and then grows with depth. Where g exceeds a half size, a roof joins
opposite faces. With b = (|l| − c + g)₊ of each axis, or √(l² + (g − c)²) + g − c where g > c, the depth solves

    |b(l, t)| = ρ(t).

This is convex in l and t together. Depth is concave, its gradient continuous, of length 1 at the surface and nowhere
longer, and Newton's method comes down to the root from the distance of the nearest face.

With the default rounding, this depth does better than faces with creases and the normal of one of them. Of 60 taut
cables that are bent over the edge of a box, Newton's method refuses none instead of 48. Nets that fall on a box keep
their energy to 1e-5, with order 2, instead of 0.1. A `WIDENING` of 1, edges that stay as sharp as they are, gives the
same until rounding is as small as 1e-4 of the size, where the order is 1; one of 2 leaves less depth in the middle.
"""

from __future__ import annotations

import math

from ..kernels import kernel

EXACT = 0.5
"""Depth up to which it is the distance from the surface, over the radius of growth."""
WIDENING = 1.5
"""Slope of g far in: faces whose depths differ by less than this factor share a push."""


@kernel()
def _beyond(at, c):
    return at - c if at > c else at + c if at < -c else 0.0


@kernel()
def _shrinkage(t, radius):
    """(g, g', g'') at a depth."""
    past, width = t - EXACT * radius, (1.0 - EXACT) * radius
    if past <= 0.0:
        return 0.0, 0.0, 0.0
    if past < WIDENING * width:
        return 0.5 * past * past / width, past / width, 1.0 / width
    return WIDENING * (past - 0.5 * WIDENING * width), WIDENING, 0.0


@kernel()
def _half_square(at, c):
    """½ b² and its derivatives by the place l and by c: (b²/2, ∂l, ∂c, ∂l∂l, ∂l∂c, ∂c∂c)."""
    if c >= 0.0:
        b, sign = abs(at) - c, math.copysign(1.0, at)
        return (0.5 * b * b, b * sign, -b, 1.0, -sign, 1.0) if b > 0.0 else (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    root = math.sqrt(at * at + c * c)
    b, i, j = root - c, at / root, c / root
    return 0.5 * b * b, b * i, -b * b / root, 1.0 - j * j * j, -i * i * i, 2.0 - 3.0 * j + j * j * j


@kernel()
def _smooth(l0, l1, l2, radius, c0, c1, c2, t):
    """Depth of a box, as `depth`, where faces share: ``t`` is the depth in the nearest one."""
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
    """Depth of a box, as `depth`; ``thin`` is true if its core is a point or a line."""
    w0, w1, w2 = _beyond(l0, c0), _beyond(l1, c1), _beyond(l2, c2)
    distance = math.sqrt(w0 * w0 + w1 * w1 + w2 * w2)
    if distance > 0.0 and (thin or distance >= (1.0 - EXACT) * radius):
        g0, g1, g2 = -w0 / distance, -w1 / distance, -w2 / distance
        b0 = (1.0 if w0 != 0.0 else 0.0) - g0 * g0
        b1 = (1.0 if w1 != 0.0 else 0.0) - g1 * g1
        b2 = (1.0 if w2 != 0.0 else 0.0) - g2 * g2
        bend = (-b0 / distance, g0 * g1 / distance, g0 * g2 / distance)
        return radius - distance, (g0, g1, g2), (*bend, -b1 / distance, g1 * g2 / distance, -b2 / distance)
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
    out = math.hypot(p[0], p[1])
    e0, e1 = (p[0] / out, p[1] / out) if out > 0.0 else (1.0, 0.0)
    values = grown_box(out, 0.0, p[2], grown.radius, c[0], math.inf, c[2], c[0] == 0.0)
    deep, (g, _, g2), (b, _, b02, _, _, b22) = values
    around = g / out if out > 0.0 else b
    bend = (b * e0 * e0 + around * e1 * e1, (b - around) * e0 * e1, b02 * e0, b * e1 * e1 + around * e0 * e0)
    return deep, (g * e0, g * e1, g2), (*bend, b02 * e1, b22)
