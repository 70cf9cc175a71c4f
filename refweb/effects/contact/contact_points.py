"""Contact points of a line on a body of any shape.

A line that lies on a face, or along a ring or a cylinder, has no single nearest point: a force at the deepest point
would jump from end to end. Therefore all shapes but spheres have several contacts with each element: one at each end,
and one in between. The latter is at the coordinate ξ where W(ξ) δ(ξ)^(p + 1) is largest, with the depth δ, the exponent
p of the penalty and the window W = 4 ξ (1 − ξ). On a straight element this ξ is unique, since the roots of W and δ are
concave. It does not jump, and its force vanishes near an end, where the contact of the end takes over. A curved element
that bends away from the body may have two such ξ; the deeper one counts. Where both are equal, the energy has a kink
and the force jumps.

May change: how ξ is searched, and limits of the iterations. Must stay: the four entries of `Places` in their order,
which `penalty`, `friction`, `line_body_friction` and `body_body_detection` unpack; three contacts of an element on a
convex body, which is `SLOTS` of `line_body_friction`; the fields of `ContactPoint` and the mark `NOWHERE`; that
`in_reach` and `reaching` miss no contact; all names that `line_body_friction`, `body_body_detection` and other files
import; public names of `PointContact`, which other files use. Tests: ``tests/effects/test_contact.py``,
``tests/dynamics/integrators/test_nearby.py``, ``tests/test_contract.py``.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

from ...kernels import Indices, Matrix, kernel
from ...net.rotation import times
from ..vectors import dot
from .nearest_point import SAMPLES, far, in_box, point, share
from .pair import LineContacts, Pair, from_shape, pairing

NOWHERE = -1.0
"""Coordinate ξ of an element without any contact."""
CLOSE = 1e-8
"""Step of Newton's method behind which its next one is rounding, and the depth there follows from the slope before."""
NO_VECTOR = (0.0, 0.0, 0.0)
"""Second derivative of a straight element along itself; vectors of the `Course` of a curved one."""


class ContactPoint(NamedTuple):
    """A point of an element relative to a body: vectors are from the row of the body and along its axes.

    Attributes
    ----------
    y, d, e : tuple of 3 float
        The point y of the line [m], y' = dy/dξ and y''.
    depth : float
        Depth of that point δ [m].
    gradient, hessian : tuple of 3 and of 6 float
        g = ∂δ/∂y and H = ∂²δ/∂y² [1/m], of the axes 00, 01, 02, 11, 12, 22.
    """

    y: tuple[Any, ...]
    d: tuple[Any, ...]
    e: tuple[Any, ...]
    depth: float
    gradient: tuple[Any, ...]
    hessian: tuple[Any, ...]


class PointContact(NamedTuple):
    """A contact.

    Attributes
    ----------
    c : int
        Cell.
    xi : float
        Coordinate ξ of the contact.
    inner : bool
        True if ξ changes as the line moves.
    pair : Pair
        The element and the body.
    spot : ContactPoint
        The point of the line at ξ.
    weight, share : float
        Factors on its energy and on its losses; both are 1 for convex bodies.
    """

    c: int
    xi: float
    inner: bool
    pair: Pair
    spot: ContactPoint
    weight: float
    share: float


@kernel()
def hessian_times(h, p):
    """Product of a Hessian and a vector."""
    return (
        h[0] * p[0] + h[1] * p[1] + h[2] * p[2],
        h[1] * p[0] + h[3] * p[1] + h[4] * p[2],
        h[2] * p[0] + h[4] * p[1] + h[5] * p[2],
    )


@kernel()
def window(once, xi, inner):
    """(W, W', W'') of a contact; 1 at an end, and of a sphere."""
    if not inner or once:
        return 1.0, 0.0, 0.0
    return 4.0 * xi * (1.0 - xi), 4.0 - 8.0 * xi, -8.0


@kernel(forceinline=True)
def rise(pair, xi, spot):
    """Function that vanishes at the deepest position of an element, positive before it, and its slope.

    W' δ + (p + 1) W δ', or where nothing is touched δ'; of a sphere the rate of −½ |y|², which is linear.
    """
    d, g, deep = spot.d, spot.gradient, spot.depth
    slope, curve = dot(g, d), dot(d, hessian_times(spot.hessian, d)) + dot(g, spot.e)
    if pair.once:
        away = pair.shape.radius - deep
        return away * slope, away * curve - slope * slope
    if deep <= 0.0:
        return slope, curve
    power, (w, w1, w2) = pair.exponent, window(False, xi, True)
    return w1 * deep + (power + 1.0) * w * slope, w2 * deep + (power + 2.0) * w1 * slope + (power + 1.0) * w * curve


@kernel(forceinline=True)
def place_moves(touch, moving, nodes, functions, z):
    """Write by how much the place of a contact moves with each node, along the body's axes, to ``z (nodes + 1, 3)``.

    The last row is of the body; all are zero unless ``moving``.
    """
    z[:] = 0.0
    pair, xi, spot = touch.pair, touch.xi, touch.spot
    curve = rise(pair, xi, spot)[1]
    if not moving or not touch.weight * curve < 0.0:
        return
    (w, w1, _), g, turned = window(pair.once, xi, True), spot.gradient, hessian_times(spot.hessian, spot.d)
    distance = pair.shape.radius - spot.depth if pair.once else (pair.exponent + 1.0) * w
    for a in range(nodes + 1):
        value, slope = share(a, nodes, functions, xi) if a < nodes else (-1.0, 0.0)
        for k in range(3):
            z[a, k] = -(w1 * value * g[k] + distance * (value * turned[k] + slope * g[k])) / curve


@kernel(forceinline=True)
def set_place(contact, c, xi, inner):
    """Write the place of a contact of a line."""
    contact.cell, contact.xi, contact.inner = c, xi, inner


class Places(NamedTuple):
    """Kernels that find where lines touch bodies of one depth, see `places`, and how many contacts an element has."""

    deepest: Callable[..., Any]
    contacts: Callable[..., Any]
    touch_of: Callable[..., Any]
    limit: int


@kernel(forceinline=True)
def climb(value, curve, low, high, moved, xi):
    """(low, high, how far it moved, place) of the next place on the way to where a ``value`` falls through zero.

    By Newton's method with the slope ``curve``, and by bisection where it leaves the bracket or comes no nearer.
    """
    if value > 0.0:
        low = xi
    else:
        high = xi
    step = xi - value / curve if curve < 0.0 else -1.0
    if not low <= step <= high or abs(step - xi) > 0.5 * moved:
        step = 0.5 * (low + high)
    return low, high, abs(step - xi), step


@functools.cache
def within_of(depth, spins):
    """Kernel ``(x, cells, data, c, nodes, functions, xi)`` of the `ContactPoint` at a place of cell c; see `places`."""
    paired = pairing(spins)

    @kernel()
    def within(x, cells, data, c, nodes, functions, xi):
        pair = paired(x, cells, data, c, nodes)
        p, d, e = point(x, cells, data, c, nodes, functions, xi)
        p, d, e = times(pair.axes, p), times(pair.axes, d), times(pair.axes, e)
        deep, gradient, hessian = depth(from_shape(p, data, c, nodes) if spins == 2 else p, pair.shape)
        return ContactPoint(p, d, e, deep, gradient, hessian)

    return within


class Course(NamedTuple):
    """An element relative to a body, for its `ContactPoint` at any place.

    Attributes
    ----------
    pair : Pair
        The element and the body.
    y, d : tuple of 3 float
        First node of a straight element from the row of the body, and the vector to its last node, along the body's
        axes [m]; zero of a curved element.
    at : tuple of 3 float
        The first node from the centre of the shape.
    """

    pair: Pair
    y: tuple[Any, ...]
    d: tuple[Any, ...]
    at: tuple[Any, ...]


@functools.cache
def along(depth, spins, nodes, functions):
    """Kernels of an element that is looked at in several places: its axes are found once.

    ``(x, cells, data, c)`` gives the `Course` of cell c, and ``(x, cells, data, c, course, xi)`` its `ContactPoint` at
    ξ. Parameters are those of `places`.
    """
    paired, within = pairing(spins), within_of(depth, spins)

    @kernel(forceinline=True)
    def course_of(x, cells, data, c):
        pair = paired(x, cells, data, c, nodes)
        if nodes > 2:
            return Course(pair, NO_VECTOR, NO_VECTOR, NO_VECTOR)
        y, d, _ = point(x, cells, data, c, nodes, functions, 0.0)
        y, d = times(pair.axes, y), times(pair.axes, d)
        return Course(pair, y, d, from_shape(y, data, c, nodes) if spins == 2 else y)

    @kernel(forceinline=True)
    def spot_of(x, cells, data, c, course, xi):
        if nodes > 2:
            return within(x, cells, data, c, nodes, functions, xi)
        y, d, at = course.y, course.d, course.at
        at = at[0] + xi * d[0], at[1] + xi * d[1], at[2] + xi * d[2]
        deep, gradient, hessian = depth(at, course.pair.shape)
        y = y[0] + xi * d[0], y[1] + xi * d[1], y[2] + xi * d[2]
        return ContactPoint(y, d, NO_VECTOR, deep, gradient, hessian)

    return course_of, spot_of


@functools.cache
def places(depth, spins, pieces, nodes, functions):
    """Kernels that find where lines touch.

    ``deepest(x, cells, data, c)`` is (place, depth) of the contact between the ends of a cell, or `NOWHERE`.
    ``contacts(x, cells, data, first, buffer)`` writes the contacts of a line to an array of `LINE_CONTACT` and returns
    their number, and ``touch_of(x, cells, data, buffer, n)`` is the `PointContact` that is one of them. ``limit`` is
    the largest number of contacts of an element. ``contacts`` is called by its address: its search is a large part of
    the machine code of a contact, of which all kernels would have a copy.

    Parameters
    ----------
    depth : kernel
        Depth in the bodies, as `refweb.net.grown_core.depth`; where they need not be convex, with ``convex = False``,
        see `refweb.effects.contact.nonconvex_contacts`.
    spins : int
        See `refweb.effects.contact.pair.pairing`.
    pieces, nodes, functions
        See `refweb.effects.contact.penalty.kernels`.
    """
    course_of, spot_of, convex = *along(depth, spins, nodes, functions), getattr(depth, "convex", True)

    @kernel(forceinline=True)
    def touch_of(x, cells, data, buffer, n):
        c, xi = buffer[n].cell, buffer[n].xi
        course = course_of(x, cells, data, c)
        spot = spot_of(x, cells, data, c, course, xi)
        weight, share = (1.0, 1.0) if convex else (buffer[n].weight, buffer[n].share)
        return PointContact(c, xi, buffer[n].inner > 0.0, course.pair, spot, weight, share)

    if not convex:
        from .nonconvex_contacts import PLACES, several

        return Places(*several(course_of, spot_of, rise, pieces, nodes, functions), touch_of, PLACES)

    @kernel(forceinline=nodes == 2)
    def climbed(x, cells, data, c, course, low, high, xi):
        moved, pair = math.inf, course.pair
        if pair.once:
            for end in (low, high):
                spot = spot_of(x, cells, data, c, course, end)
                slope = dot(spot.gradient, spot.d)
                if (end == 0.0 and slope <= 0.0) or (end == 1.0 and slope >= 0.0):
                    return end, spot.depth
        for _ in range(100):
            spot = spot_of(x, cells, data, c, course, xi)
            deep, slope = spot.depth, dot(spot.gradient, spot.d)
            if moved <= 1e-15:
                break
            if nodes == 2 and deep + max(slope * (high - xi), slope * (low - xi)) <= 0.0:
                return (NOWHERE if high - low == 1.0 else xi), deep  # concave: nowhere deep enough
            (value, curve), before = rise(pair, xi, spot), xi
            low, high, moved, xi = climb(value, curve, low, high, moved, xi)
            if moved < CLOSE and abs(abs(value) - moved * abs(curve)) < 1e-6 * abs(value):
                return xi, deep + slope * (xi - before)
        return xi, deep

    @kernel()
    def felt(x, cells, data, c, course, xi):
        deep, pair = spot_of(x, cells, data, c, course, xi).depth, course.pair
        return window(pair.once, xi, True)[0] ** (1.0 / (pair.exponent + 1.0)) * deep if deep > 0.0 else deep

    @kernel(forceinline=nodes == 2)
    def deepest_of(x, cells, data, c, course):
        if nodes > 2:  # from the places where samples are largest, of which there may be several
            largest, where, depth_there = -math.inf, 0.0, 0.0
            before, current = -math.inf, felt(x, cells, data, c, course, 0.0)
            for n in range(SAMPLES + 1):
                at, after = n / SAMPLES, -math.inf
                if n < SAMPLES:
                    after = felt(x, cells, data, c, course, at + 1.0 / SAMPLES)
                if current >= before and current > after:
                    low, high = max(at - 1.0 / SAMPLES, 0.0), min(at + 1.0 / SAMPLES, 1.0)
                    xi, deep = climbed(x, cells, data, c, course, low, high, at)
                    value = felt(x, cells, data, c, course, xi)
                    if value > largest:
                        largest, where, depth_there = value, xi, deep
                before, current = current, after
            return where, depth_there
        return climbed(x, cells, data, c, course, 0.0, 1.0, 0.5)

    @kernel()
    def deepest(x, cells, data, c):
        return deepest_of(x, cells, data, c, course_of(x, cells, data, c))

    @kernel(leaf=True, apart=())
    def contacts(x: Matrix, cells: Indices, data: Matrix, first: int, buffer: LineContacts) -> int:
        count, best = 0, 0.0
        for c in range(first, first + pieces):
            if far(x, cells, data, c, nodes):
                continue
            course = course_of(x, cells, data, c)
            xi, deep = deepest_of(x, cells, data, c, course)
            if xi == NOWHERE:
                continue
            inner = 0.0 < xi < 1.0
            if course.pair.once:
                if deep > best:
                    best, count = deep, 1
                    set_place(buffer[0], c, xi, 1.0 if inner else 0.0)
                continue
            if deep > 0.0 and inner:
                set_place(buffer[count], c, xi, 1.0)
                count += 1
            for end in range(2):
                if spot_of(x, cells, data, c, course, float(end)).depth > 0.0:
                    set_place(buffer[count], c, float(end), 0.0)
                    count += 1
        return count

    return Places(deepest, contacts, touch_of, 3)


@functools.cache
def in_reach(depth, spins):
    """The kernel that tells whether an element with two nodes may touch its body within a skin.

    Of a convex body it looks at the deepest point, see `reaching`. The tangent in the middle of the element alone would
    list up to twice as many elements near a round body, and take as long.
    """
    return reaching(depth, spins) if getattr(depth, "convex", True) else in_box(spins)


@functools.cache
def reaching(depth, spins):
    """The kernel that tells whether an element with two nodes touches its body after an approach of ``reach``.

    It looks at the depth itself, which changes by no more than line and body move. So an element that `in_reach` has
    left out of a list stays out of reach until the skin of that list is used up, and bounds of steps do not depend on
    where the list was made. The depth in bodies that are not convex is not followed along the element.
    """
    if not getattr(depth, "convex", True):
        return in_reach(depth, spins)
    paired = pairing(spins)

    @kernel()
    def reaches(reach, x, cells, data, c, nodes, functions):
        pair, low, high, moved, xi = paired(x, cells, data, c, nodes), 0.0, 1.0, math.inf, 0.5
        p, d, _ = point(x, cells, data, c, nodes, functions, 0.0)
        p, d = times(pair.axes, p), times(pair.axes, d)
        p = from_shape(p, data, c, nodes) if spins == 2 else p
        while moved > 1e-15:
            deep, gradient, hessian = depth((p[0] + xi * d[0], p[1] + xi * d[1], p[2] + xi * d[2]), pair.shape)
            deep, slope = deep + reach, dot(gradient, d)
            if deep + max(slope * (high - xi), slope * (low - xi)) <= 0.0:
                return False  # concave: nowhere deep enough
            if deep > 0.0:
                break
            low, high, moved, xi = climb(slope, dot(d, hessian_times(hessian, d)), low, high, moved, xi)
        return True

    return reaches
