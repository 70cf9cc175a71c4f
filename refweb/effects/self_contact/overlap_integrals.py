"""The overlap of one straight element with the line of another, as an integral in closed form.

For a point a of the first element, let p = a − b₀ be its vector from the first end of the other element w = b₁ − b₀.
With M = |w| and ŵ = w/M, y = p·ŵ is its coordinate along that element, and D = |p − y ŵ|² its squared distance from the
straight line. With the distance of contact c,

    I = ∫₀¹ W(y, M) e(D) ds,      e = (c² − D)² where D < c², else 0,      W = S(y/c) − S((y − M)/c),

S(x) = ½ + ¾ x − ¼ x³ from 0 at x = −1 to 1 at x = 1. W is a smooth window along the element. If elements continue each
other in a straight line, their W add up to 1 for any lengths. Then I does not depend on the position of their joint,
and an object that slides along a line has no force from joints. Beyond a free end, or a corner, W decreases to 0 over
the distance c. Every corner has contact, since within c of it W of each side is above 0.

Along the first element p and y are linear in s, and D is quadratic. Therefore the integrand and its first and second
derivatives are piecewise polynomials of degree 7, which four Gauss points on each piece integrate to rounding.
Integrand and gradient are continuous between pieces. Hence I is a smooth function of the four nodes, with Lipschitz
continuous first derivatives, also for parallel lines. Its derivatives are the integrals of those of the integrand.

Three alternatives have drawbacks. The nearest points of two segments jump where lines are parallel. The least value of
½ |d(s, t)|² + ½ ε ((s − ½)² + (t − ½)²) over both segments is smooth, but the elements on both sides of a joint push:
within √(4 r δ) of it the energy of an overlap δ doubles, which resists sliding by ¼ √(δ/r) of the push. A sum over
Gauss points on both lines needs many points if r is much smaller than an element.

An element without length has no direction; then I is 0, which is its limit.

May change: `SHORT`, and how pieces are found; `PLACES` and `WEIGHTS` are exact for the degree above. Must stay: the
integral I and its derivatives, as the closed form of `line_line_penalty` has the same energy; the order of the slopes
of `first`, which that file reads by position; `add_second`, which `line_line_penalty` imports. Tests:
``tests/effects/test_self_contact.py``.
"""

from __future__ import annotations

import math

import numpy as np

from ...kernels import kernel
from ..vectors import dot

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
PLACES, WEIGHTS = tuple((0.5 * (1.0 + _POINTS)).tolist()), tuple((0.5 * _WEIGHTS).tolist())
"""Gauss points and weights on [0, 1]."""
NOWHERE = 0.0, 0.0, 0.0, 0.0
"""Ends of no pieces."""
SHORT = 1e-9
"""Length of an element over the distance of contact below which it has no direction."""


@kernel(forceinline=True)
def step_at(x):
    """(S, S') at x, without a branch."""
    x = min(max(x, -1.0), 1.0)
    return 0.5 + x * (0.75 - 0.25 * x * x), 0.75 - 0.75 * x * x


@kernel(forceinline=True)
def bend_at(x):
    """S'' at x."""
    return -1.5 * x if abs(x) < 1.0 else 0.0


@kernel(forceinline=True)
def along(p, u, w):
    """(M, 1/M, ŵ, y, y', p − y ŵ, and its derivative) at the first node of u, p being that from the first node of w."""
    length = math.sqrt(dot(w, w))
    short = 1.0 / length
    unit = short * w[0], short * w[1], short * w[2]
    y, rate = dot(p, unit), dot(u, unit)
    across = p[0] - y * unit[0], p[1] - y * unit[1], p[2] - y * unit[2]
    turn = u[0] - rate * unit[0], u[1] - rate * unit[1], u[2] - rate * unit[2]
    return length, short, unit, y, rate, across, turn


@kernel(forceinline=True)
def comes_near(quadratic):
    """Tell if c² − D, by its numbers, see `pieces`, may be above 0 within a length of 1 to either side."""
    deep, half, square = quadratic
    return deep > 0.0 or (deep + 2.0 * abs(half) > 0.0 and half * half + square * deep > 0.0)


@kernel()
def pieces(low, high, length, y, rate, quadratic, touch):
    """(Number of the pieces of low to high on which the integrand is a polynomial, their ends).

    y + s rate is the coordinate of a point along the other element. The three numbers of ``quadratic`` are a, b and c
    of c² − D = a − 2 b s − c s². Ends are passed as numbers, since counting references to an array takes as long as a
    piece.
    """
    deep, half, square = quadratic
    root = half * half + square * deep
    if square > 0.0:
        q = -(half + math.copysign(math.sqrt(max(root, 0.0)), half))
        near_end, far_end = q / square, (-deep / q if q != 0.0 else math.inf)
        low, high = max(low, min(near_end, far_end)), min(high, max(near_end, far_end))
    if not low < high:
        return 0, NOWHERE
    if rate == 0.0:
        return (1 if -touch < y < length + touch else 0), (low, high, high, high)
    first, last = (-touch - y) / rate, (length + touch - y) / rate
    low, high = max(low, min(first, last)), min(high, max(first, last))
    if not low < high:
        return 0, NOWHERE
    near_end, far_end = (touch - y) / rate, (length - touch - y) / rate
    inner, outer = min(near_end, far_end), max(near_end, far_end)
    if not low < inner < high:
        return (2, (low, outer, high, high)) if low < outer < high else (1, (low, high, high, high))
    return (3, (low, inner, outer, high)) if low < outer < high else (2, (low, inner, high, high))


@kernel(forceinline=True)
def with_point(sums, q, weight, quadratic, y, rate, length):
    """Sums over Gauss points with another at q: of I, of W (c² − D) times 1, q and q², and of e times slopes of W."""
    deep, position = quadratic[0] - q * (2.0 * quadratic[1] + q * quadratic[2]), y + q * rate
    (near, rise), (far, fall) = step_at(position), step_at(position - length)
    pull = weight * deep * (near - far)
    energy = weight * deep * deep
    tilt = energy * (rise - fall)
    return (
        sums[0] + deep * pull,
        sums[1] + pull,
        sums[2] + q * pull,
        sums[3] + q * q * pull,
        sums[4] + tilt,
        sums[5] + q * tilt,
        sums[6] + energy * fall,
    )


@kernel()
def first(pp, pu, pw, uw, ww, nn, s, t, touch):
    """(I, its slopes by ½ p·p, p·u, p·w, ½ u·u, u·w and ½ w·w), the products of vectors and nn = |u × w|².

    p is from the point at the share t of the other element to that at the share s of the first; any two will do, and
    where both are near each other nothing cancels. With q the place from there on, I depends on the products by

        y = t M + p·ŵ + q u·ŵ,      D = p·p − (p·ŵ)² + 2 q (p·u − p·ŵ u·ŵ) + q² (u·u − (u·ŵ)²),

    and on M itself, so that sums over Gauss points of W (c² − D), times 1, q and q², and of e ∂W are all that it takes:
    no vector is.
    """
    zero, times_ww = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), ((touch * touch - pp) * ww + pw * pw, pu * ww - pw * uw, nn)
    if not (ww > (SHORT * touch) ** 2 and comes_near(times_ww)):
        return 0.0, zero
    length = math.sqrt(ww)
    short, inverse = 1.0 / length, 1.0 / touch
    z, rate, unit = short * pw, short * uw, short * short
    quadratic, y = (unit * times_ww[0], unit * times_ww[1], unit * nn), t * length + z
    count, ends = pieces(-s, 1.0 - s, length, y, rate, quadratic, touch)
    if count == 0:
        return 0.0, zero
    along, change, span_of_w = inverse * y, inverse * rate, inverse * length
    sums = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for n in range(count):
        low, span = ends[n], ends[n + 1] - ends[n]
        sums = with_point(sums, low + PLACES[0] * span, WEIGHTS[0] * span, quadratic, along, change, span_of_w)
        sums = with_point(sums, low + PLACES[1] * span, WEIGHTS[1] * span, quadratic, along, change, span_of_w)
        sums = with_point(sums, low + PLACES[2] * span, WEIGHTS[2] * span, quadratic, along, change, span_of_w)
        sums = with_point(sums, low + PLACES[3] * span, WEIGHTS[3] * span, quadratic, along, change, span_of_w)
    total, pull0, pull1, pull2, tilt0, tilt1, end = sums
    pull0, pull1, pull2 = -4.0 * pull0, -4.0 * pull1, -4.0 * pull2
    tilt0, tilt1, end = inverse * tilt0, inverse * tilt1, inverse * end
    by_z, by_rate = tilt0 - z * pull0 - rate * pull1, tilt1 - z * pull1 - rate * pull2
    by_length = (end + t * tilt0) * length - z * by_z - rate * by_rate
    return total, (pull0, pull1, short * by_z, pull2, short * by_rate, unit * by_length)


@kernel(forceinline=True)
def add_product(block, weights, others, value, i, j, order):
    """Add to the entries i, j of the blocks of four nodes, in an order, the products of two rows of their shares."""
    for m in range(4):
        for n in range(4):
            block[3 * order[m] + i, 3 * order[n] + j] += weights[m] * others[n] * value


@kernel()
def add_second(p, u, w, touch, scale, definite, order, block):
    """Add the second derivatives of I, times a scale, to the block of four nodes: of a pair, in an order of its nodes.

    ``definite`` takes the part that is positive semidefinite in any state: 2 ∇D∇D of e.
    """
    if not dot(w, w) > (SHORT * touch) ** 2:
        return
    length, short, unit, y0, rate, across, turn = along(p, u, w)
    quadratic = touch * touch - dot(across, across), dot(across, turn), dot(turn, turn)
    if not comes_near(quadratic):
        return
    count, ends = pieces(0.0, 1.0, length, y0, rate, quadratic, touch)
    for k in range(count):
        low, span = ends[k], ends[k + 1] - ends[k]
        for point in range(4):
            s = low + span * PLACES[point]
            weight, y = scale * span * WEIGHTS[point], y0 + s * rate
            d = across[0] + s * turn[0], across[1] + s * turn[1], across[2] + s * turn[2]
            deep, part = touch * touch - dot(d, d), short * y
            position, past = y / touch, (y - length) / touch
            near, far = step_at(position), step_at(past)
            integral, e, steep = weight * (near[0] - far[0]), deep * deep, -2.0 * deep
            by_y, by_m = weight * (near[1] - far[1]) / touch, weight * far[1] / touch
            yy, mm = weight * (bend_at(position) - bend_at(past)) / touch**2, -weight * bend_at(past) / touch**2
            if definite:
                e = steep = 0.0
            of_p, of_w = (1.0 - s, s, -1.0, 0.0), (0.0, 0.0, -1.0, 1.0)
            for i in range(3):
                for j in range(3):
                    # ∇y = (ŵ, d/M), ∇M = (0, ŵ), ∇D = (2 d, −2 τ d), each for p and for w
                    y_p, y_w, d_p, d_w = unit[i], short * d[i], 2.0 * d[i], -2.0 * part * d[i]
                    z_p, z_w, e_p, e_w = unit[j], short * d[j], 2.0 * d[j], -2.0 * part * d[j]
                    flat = (1.0 if i == j else 0.0) - unit[i] * unit[j]
                    slope, mixed = integral * steep, by_y * steep
                    pp = yy * e * y_p * z_p + mixed * (y_p * e_p + d_p * z_p) + 2.0 * integral * d_p * e_p
                    pp += 2.0 * slope * flat
                    pw = yy * e * y_p * z_w + mixed * (y_p * e_w + d_p * z_w) + 2.0 * integral * d_p * e_w
                    pw += (-mm * e * y_p + by_m * steep * d_p) * unit[j] + by_y * e * short * flat
                    pw -= 2.0 * slope * (unit[i] * short * d[j] + part * flat)
                    ww = yy * e * y_w * z_w + mixed * (y_w * e_w + d_w * z_w) + 2.0 * integral * d_w * e_w
                    ww += mm * e * (unit[i] * unit[j] - y_w * unit[j] - unit[i] * z_w)
                    ww += by_m * (steep * (d_w * unit[j] + unit[i] * e_w) + e * short * flat)
                    bent = (unit[i] * d[j] + d[i] * unit[j]) * short
                    ww -= by_y * e * (bent + part * flat) * short
                    ww += 2.0 * slope * (part * bent + part * part * flat - y_w * z_w)
                    add_product(block, of_p, of_p, pp, i, j, order)
                    add_product(block, of_p, of_w, pw, i, j, order)
                    add_product(block, of_w, of_p, pw, j, i, order)
                    add_product(block, of_w, of_w, ww, i, j, order)
