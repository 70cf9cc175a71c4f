"""Contact points of a line on a body that is not convex.

There F = W(ξ) δ(ξ)^(p + 1), see `refweb.effects.contact.contact_points`, may have several maxima along an element, with
minima in between. The energy is k/(p + 1) times the total rise of F along the element: the sum of its maxima less that
of its minima where the line is inside. For a convex body this is the single maximum. A maximum and a minimum that
appear on a slope have the same position, and a maximum that appears at the surface has no depth. Therefore the energy
has a continuous slope.

Maxima and minima are found where the slope of F changes its sign between two samples. The distance of samples is at
most half the length on which the surface may turn. If a sample is outside of the body, the line is outside over its
distance from the surface, and samples there are left out.

Friction and damping have no energy. Each maximum counts with a share of its push: the fall of F to both sides, on
average, over F. Minima do not count. The sum of these shares equals the total rise, no share is negative, and friction
always dissipates.

`contact_points.places` hands its kernels over; `pair` describes cells and data. May change: `SAMPLES`, `LEAST` and
`LOOKS` upwards, and `FURTHER` up to 2: they weigh time against extremes that are missed. Must stay: the two kernels
that `several` returns and `PLACES`, of which `contact_points` makes its `Places`; `STEEPEST`, a bound on gradients of
depths that `body_body_detection` and `line_body_ccd` rely on: it may be larger only. Tests:
``tests/effects/test_mesh_bodies.py``.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from ...kernels import Indices, Matrix, kernel
from ..vectors import dot
from .nearest_point import far, point
from .pair import LINE_CONTACT, LineContacts, power_of_depth

SAMPLES = 256
"""Largest number of parts of an element for samples of the slope."""
LEAST = 4
"""Least number of such parts."""
PLACES = 2 * SAMPLES + 2
"""Largest number of contacts of an element."""
LOOKS = 4
"""Number of further samples for a slope of F that changes its sign twice between two samples."""
FURTHER = 1.8
"""Distance of the next sample from one outside, over its distance from the surface; 2 would just leave no gap."""
STEEPEST = 1.25
"""Largest gradient of a depth."""


@kernel()
def record(contact, c, xi, inner, weight, rise):
    """Write a contact."""
    contact.cell, contact.xi, contact.inner = c, xi, inner
    contact.weight, contact.share, contact.rise = weight, max(weight, 0.0), rise


@kernel()
def least_between(begin, slope, end, last):
    """Extremum of a cubic polynomial on (0, 1) whose ends and slopes there are known, of unlike signs."""
    mean = end - begin
    b, a = 6.0 * mean - 4.0 * slope - 2.0 * last, 3.0 * (slope + last - 2.0 * mean)
    root = math.sqrt(max(b * b - 4.0 * a * slope, 0.0))
    q = -0.5 * (b + math.copysign(root, b))
    for candidate in (slope / q if q != 0.0 else -1.0, q / a if a != 0.0 else -1.0):
        if 0.0 < candidate < 1.0:
            return candidate
    return slope / (slope - last)


@kernel()
def share_out(buffer, begin, end):
    """Write the shares of the maxima among the places between the ends of an element."""
    for n in range(begin, end):
        if buffer[n].weight > 0.0:
            before = buffer[n - 1].rise if n > begin and buffer[n - 1].weight < 0.0 else 0.0
            after = buffer[n + 1].rise if n + 1 < end and buffer[n + 1].weight < 0.0 else 0.0
            buffer[n].share = max(1.0 - 0.5 * (before + after) / buffer[n].rise, 0.0)


@functools.cache
def several(course_of, spot_of, rise, pieces, nodes, functions):
    """(kernel of the deepest place of an element, kernel of all contacts of a line), as in `places`."""

    @kernel()
    def between(x, cells, data, c, course, low, high, xi, sign):
        pair, moved = course.pair, math.inf
        for _ in range(100):  # Newton's method, by bisection where it leaves the bracket or comes no nearer
            value, curve = rise(pair, xi, spot_of(x, cells, data, c, course, xi))
            if sign * value > 0.0:
                low = xi
            else:
                high = xi
            step = xi - value / curve if sign * curve < 0.0 else -1.0
            if not low <= step <= high or abs(step - xi) > 0.5 * moved:
                step = 0.5 * (low + high)
            moved, xi = abs(step - xi), step
            if moved <= 1e-15:
                break
        return xi

    @kernel()
    def dip(x, cells, data, c, course, low, high, begin, end):
        """A place between two where the slope of F has another sign than at both, 2 where there is none."""
        pair, sign = course.pair, 1.0 if begin[0] > 0.0 else -1.0
        for _ in range(LOOKS):
            width = high - low
            if not (sign * begin[1] < 0.0 and sign * end[1] > 0.0):
                break
            xi = low + width * least_between(begin[0], width * begin[1], end[0], width * end[1])
            value, curve = rise(pair, xi, spot_of(x, cells, data, c, course, xi))
            if (value > 0.0) != (sign > 0.0):
                return xi
            if abs(value) > abs(curve) * width:
                break
            if sign * curve < 0.0:
                low, begin = xi, (value, curve)
            else:
                high, end = xi, (value, curve)
        return 2.0

    @kernel()
    def scan(x, cells, data, c, buffer, begin):
        """Write the contacts of a cell between its ends to rows from ``begin`` on; (row behind, depths of its ends)."""
        course, count = course_of(x, cells, data, c), begin
        pair = course.pair
        _, d, _ = point(x, cells, data, c, nodes, functions, 0.5)
        steepest = STEEPEST * math.sqrt(dot(d, d)) * (1.0 if nodes == 2 else float(nodes * nodes))
        first = last = -math.inf
        middle = spot_of(x, cells, data, c, course, 0.5)
        convex = nodes == 2 and pair.shape.fine == math.inf
        if middle.depth + 0.5 * (abs(dot(middle.gradient, middle.d)) if convex else steepest) <= 0.0:
            return count, first, last
        parts = int(min(max(2.0 * steepest / pair.shape.fine, LEAST), SAMPLES))
        n, last_n, sure, low, before, deep_before = 0, -1, 0, 0.0, (0.0, 0.0), 0.0
        while True:
            xi = n / parts
            spot = spot_of(x, cells, data, c, course, xi)
            clear = deep_before + spot.depth + steepest * (n - last_n) / parts <= 0.0
            if not clear and n > sure:  # look again nearer to what was certain
                n = sure
                continue
            value = rise(pair, xi, spot)
            if n == 0:
                first = spot.depth
            elif not clear and n == last_n + 1:
                turn = (before[0] > 0.0) != (value[0] > 0.0)
                inner = 2.0 if turn else dip(x, cells, data, c, course, low, xi, before, value)
                for k in range(1 if turn else 2 if inner < 1.0 else 0):
                    begins, ends = (low, xi) if turn else (low, inner) if k == 0 else (inner, xi)
                    sign = 1.0 if (before[0] > 0.0) == (k == 0) else -1.0
                    at = before[0] / (before[0] - value[0]) if turn else 0.5
                    at = begins + at * (ends - begins)
                    at = between(x, cells, data, c, course, begins, ends, at, sign)
                    deep = spot_of(x, cells, data, c, course, at).depth
                    if deep > 0.0 and 0.0 < at < 1.0:
                        felt = 4.0 * at * (1.0 - at) * deep * power_of_depth(pair.exponent, deep)
                        record(buffer[count], c, at, 1.0, sign, felt)
                        count += 1
            if n == parts:
                last = spot.depth
                break
            far_on = -spot.depth / steepest * parts if spot.depth < 0.0 else 0.0
            last_n, low, before, deep_before = n, xi, value, spot.depth
            sure, n = min(n + max(int(far_on), 1), parts), min(n + max(int(FURTHER * far_on), 1), parts)
        share_out(buffer, begin, count)
        return count, first, last

    @kernel()
    def deepest(x, cells, data, c):
        buffer, where, largest = np.empty(PLACES, LINE_CONTACT), 0.0, -math.inf
        count, first, last = scan(x, cells, data, c, buffer, 0)
        course, largest = course_of(x, cells, data, c), max(first, last)
        for n in range(count):
            deep = spot_of(x, cells, data, c, course, buffer[n].xi).depth
            if deep > largest:
                where, largest = buffer[n].xi, deep
        return where, largest

    @kernel(apart=())
    def contacts(x: Matrix, cells: Indices, data: Matrix, first: int, buffer: LineContacts) -> int:
        count = 0
        for c in range(first, first + pieces):
            if far(x, cells, data, c, nodes):
                continue
            count, begin, end = scan(x, cells, data, c, buffer, count)
            for at, deep in ((0.0, begin), (1.0, end)):
                if deep > 0.0:
                    record(buffer[count], c, at, 0.0, 1.0, 0.0)
                    count += 1
        return count

    return deepest, contacts
