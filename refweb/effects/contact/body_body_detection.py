"""Contact points of two bodies: the skeleton of each against the depth in the other.

A part of a skeleton, see `refweb.net.skeleton`, has a thickness τ: it touches a body where it is inside of that body
grown by τ. A straight part has the contacts of an element of the web, see `refweb.effects.contact.contact_points`. A
point has one contact. An arc has one contact, at the coordinate ξ where W δ^(p + 1) is largest, with the window W =
sin²(π ξ). Each contact has the energy k/(p + 1) W δ^(p + 1). Since ξ is an extreme, the force is that of a fixed ξ.
With G = ∂δ/∂y at the contact point y, it is −k W δ^p G on the body with the skeleton, and the opposite on the other
body, both at y. Therefore momentum and angular momentum are conserved to rounding.

May change: `SAMPLES`, and how an extreme is searched. Must stay: the order of the fields of `SIDE` and `BODIES`, which
`bodies` writes by position; the fields of `BODY_CONTACT`, which `body_body_penalty` and `body_body_friction` read by
name; columns that are counted from these (`BEHIND`, `PAIR_WIDTH`, `TOUCHED`, …); the three values of ``slot`` of a
part, by which friction finds its force of the step before; the order of contacts, which decides the last digits of
results; all names that `body_body_friction` and `body_body_penalty` import. Tests:
``tests/effects/test_between_bodies.py``.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from numba import from_dtype, types

from ...compiled.rows import column_of, record_at, width_of
from ...kernels import Indices, Matrix, kernel
from ...net.rotation import matrix_at, times, times_transposed
from ...net.skeleton import ARC, PART, SEGMENT
from ..vectors import dot
from .contact_points import climb, hessian_times, places, window
from .nonconvex_contacts import STEEPEST
from .pair import AWAY, LINE_CONTACT, SPHERE, SURFACE, LineContacts, pair_of

BEHIND = AWAY + 6
"""Column of the `refweb.effects.contact.pair.SURFACE` of a line with two ends on a body."""
PAIR_WIDTH = BEHIND + width_of(SURFACE)
"""Number of columns of such a pair."""
SIDE = np.dtype(
    [
        ("axes", float, (3, 3)),
        ("offset", float, (3,)),
        ("spins", float),
        ("planar", float),
        ("mobility", float, (6,)),
        *((name, float) for name in ("lever", "extent", "free", "thick", "parts", "begin")),
        ("touched", float, (PAIR_WIDTH,)),
    ]
)
"""Data of one of two bodies.

``axes`` are those at the start, ``offset`` is the centre of the shape from the row [m], ``spins`` the number of rows of
its rotation that count; ``planar``, ``mobility`` and ``lever`` are as in `refweb.effects.contact.pair`. ``extent`` is
the greatest distance of its surface from its row and ``thick`` the least from its middle [m]; ``free`` is 1 if it
moves. ``parts`` is the number of its parts and ``begin`` the column of the first. `refweb.effects.contact.pair.pair_of`
reads ``touched`` of a body that is touched, without axes."""
BODIES = np.dtype([("room", float), ("away", float, (3,)), ("sides", SIDE, (2,))])
"""Data of a pair: number of contacts there is room for, the first body's row from the second's at the start [m], and
both sides; behind these stand their parts, see `refweb.net.skeleton.PART`."""
SIDES, SIDE_WIDTH, PART_WIDTH = column_of(BODIES, "sides"), width_of(SIDE), width_of(PART)
TOUCHED = SIDES + column_of(SIDE, "touched")
"""Column of the pair that has the law of both."""
LINE = (1.0, 0.0, -1.0, 1.0)
"""Shares of both ends of a line."""
SAMPLES = 8
"""Number of parts of an arc between whose ends its deepest place is looked for."""
_numbers = "depth weight share down inner"
BODY_CONTACT = np.dtype(
    [
        ("points", float, (2, 3)),
        ("normal", float, (3,)),
        *((name, float) for name in _numbers.split()),
        ("slot", np.int64),
    ]
)
"""A contact.

``points`` are from each body's row [m], ``normal`` is G, as from the first body into the second, ``depth`` is in m. Its
energy counts by ``weight`` and its losses by ``share``. The bodies touch at the distance ``down`` from the point along
G [m]. ``inner`` is 1 where its place changes as the bodies move, and ``slot`` is its number in the pair."""
BodyContacts = Annotated[np.ndarray, types.Array(from_dtype(BODY_CONTACT), 1, "C")]


class Frame(NamedTuple):
    """Position and orientation of a body.

    Attributes
    ----------
    axes : tuple of 3 tuples of 3 float
        Unit vectors of its axes.
    planar : bool
        True if the body rotates about the third axis alone.
    mobility : tuple of 6 float
        W of `refweb.net.rotation` along them, 00, 01, 02, 11, 12, 22.
    """

    axes: tuple[Any, ...]
    planar: bool
    mobility: tuple[Any, ...]


class Law(NamedTuple):
    """Numbers of the contact of two bodies, as in `refweb.effects.contact.pair.Pair`."""

    stiffness: float
    exponent: float
    damping: float
    friction: float
    slip_velocity: float


class Space(NamedTuple):
    """Space to work in: rows, cell and numbers of one line, what is found on it, and all contacts of a pair."""

    x: Matrix
    cells: Indices
    data: Matrix
    contact_data: LineContacts
    contacts: BodyContacts


@kernel()
def side_of(data, c, s):
    """The `SIDE` of a body of pair c."""
    return record_at(SIDE, data, c, SIDES + SIDE_WIDTH * s)


@kernel()
def frame_of(x, cells, data, c, s):
    """The `Frame` of a side of a pair."""
    side = side_of(data, c, s)
    axes, w = (vector(side.axes[0]), vector(side.axes[1]), vector(side.axes[2])), side.mobility
    if side.spins == 2.0:
        turned = matrix_at(x, cells[c, 2 + 2 * s], cells[c, 3 + 2 * s])
        axes = times(turned, axes[0]), times(turned, axes[1]), times(turned, axes[2])
    return Frame(axes, side.planar != 0.0, (w[0], w[1], w[2], w[3], w[4], w[5]))


@kernel()
def apart(x, cells, data, c):
    """The first body's row from the second's [m]."""
    a, b, away = cells[c, 0], cells[c, 1], record_at(BODIES, data, c, 0).away
    return away[0] + x[a, 0] - x[b, 0], away[1] + x[a, 1] - x[b, 1], away[2] + x[a, 2] - x[b, 2]


@kernel(forceinline=True)
def vector(numbers):
    """Three numbers."""
    return numbers[0], numbers[1], numbers[2]


@kernel()
def add(p, q):
    """p + q."""
    return p[0] + q[0], p[1] + q[1], p[2] + q[2]


@kernel()
def less(p, q):
    """p − q."""
    return p[0] - q[0], p[1] - q[1], p[2] - q[2]


@kernel()
def law_of(data, c):
    """The `Law` of two bodies."""
    surface = record_at(SURFACE, data, c, TOUCHED + BEHIND)
    return Law(
        record_at(SPHERE, data, c, TOUCHED).stiffness,
        surface.exponent,
        surface.damping,
        surface.friction,
        surface.slip_velocity,
    )


@functools.cache
def arcs(depth):
    """Kernel ``(start, end, centre, one, other, pair)`` of (place, W, point, depth, G) where an arc touches a body.

    ``start`` and ``end`` are the angles at the ends of the arc, whose centre and vectors are along the axes of the
    body. There W is 0 where it does not touch.
    """

    @kernel()
    def on_arc(position, start, end, centre, first, second, pair):
        """(point, depth, G, slope and bend of the depth by the place)."""
        turn = end - start
        angle = start + turn * position
        c, s = math.cos(angle), math.sin(angle)
        e = first[0] * c + second[0] * s, first[1] * c + second[1] * s, first[2] * c + second[2] * s
        d = (
            turn * (second[0] * c - first[0] * s),
            turn * (second[1] * c - first[1] * s),
            turn * (second[2] * c - first[2] * s),
        )
        deep, g, h = depth(add(centre, e), pair.shape)
        return add(centre, e), deep, g, dot(g, d), dot(d, hessian_times(h, d)) - turn * turn * dot(g, e)

    @kernel()
    def rising(power, position, deep, slope, curve):
        """Function that vanishes at the deepest position, positive before it, and its slope: as of straight lines."""
        if deep <= 0.0:
            return slope, curve
        w = math.sin(math.pi * position) ** 2
        w1, w2 = math.pi * math.sin(2.0 * math.pi * position), 2.0 * math.pi**2 * math.cos(2.0 * math.pi * position)
        return (
            w1 * deep + (power + 1.0) * w * slope,
            w2 * deep + (power + 2.0) * w1 * slope + (power + 1.0) * w * curve,
        )

    @kernel()
    def touched(start, end, centre, first, second, pair):
        power, largest, best = pair.exponent, -math.inf, 0
        radius, nearest = math.sqrt(dot(first, first)), -math.inf
        size, reach = (end - start) * radius, 2.0 * STEEPEST * radius * math.sin(0.25 * (end - start))
        _, deep, _, _, _ = on_arc(0.5, start, end, centre, first, second, pair)
        if deep + reach <= 0.0:
            return 0.0, 0.0, centre, 0.0, centre
        for n in range(SAMPLES + 1):
            _, deep, _, _, _ = on_arc(n / SAMPLES, start, end, centre, first, second, pair)
            nearest = max(nearest, deep)
            felt = deep
            if deep > 0.0:
                felt = deep * (math.sin(math.pi * n / SAMPLES) ** 2) ** (1.0 / (power + 1.0))
            if felt > largest:
                largest, best = felt, n
        if nearest + size / SAMPLES <= 0.0:  # gradients are shorter than 2
            return 0.0, 0.0, centre, 0.0, centre
        low, high = max(best - 1, 0) / SAMPLES, min(best + 1, SAMPLES) / SAMPLES
        position, moved = best / SAMPLES, math.inf
        for _ in range(100):
            _, deep, _, slope, curve = on_arc(position, start, end, centre, first, second, pair)
            value, curve = rising(power, position, deep, slope, curve)
            low, high, moved, position = climb(value, curve, low, high, moved, position)
            if moved <= 1e-15:
                break
        p, deep, g, _, _ = on_arc(position, start, end, centre, first, second, pair)
        w = math.sin(math.pi * position) ** 2
        return position, (w if deep > 0.0 else 0.0), p, deep, g

    return touched


@functools.cache
def pressing(depth):
    """(kernel that finds contacts of one skeleton in the depth of the other body, contacts of a line on it at most).

    The kernel ``(ahead, x, cells, data, c, s, space, count)`` writes those of the skeleton of side ``s``, grown by
    ``ahead`` more, to rows of ``space.contacts`` from ``count`` on, and returns the row behind them.
    """
    _, contacts, touch_of, limit = places(depth, 0, 1, 2, LINE)
    arc = arcs(depth)

    @kernel()
    def record(space, count, s, slot, path, y, g, contact_data, thickness, touching):
        """Write a contact; ``y`` and ``g`` are along the axes of the body that is touched."""
        axes, offset, own_axes, contact = touching.axes, path[0], path[1], space.contacts[count]
        away = times_transposed(axes, add(y, offset))  # from the row of the body that is touched
        g, near = times_transposed(axes, g), add(away, own_axes)
        for k in range(3):
            contact.points[s, k], contact.points[1 - s, k] = near[k], away[k]
            contact.normal[k] = g[k] if s == 0 else -g[k]
        contact.depth, contact.weight, contact.share, contact.inner = contact_data
        contact.down, contact.slot = (thickness - 0.5 * contact.depth) * (1.0 if s == 0 else -1.0), slot

    @kernel()
    def press(ahead, x, cells, data, c, s, space, count):
        frame_a, frame_b = frame_of(x, cells, data, c, s), frame_of(x, cells, data, c, 1 - s)
        mine, its = side_of(data, c, s), side_of(data, c, 1 - s)
        away = apart(x, cells, data, c)
        if s == 1:
            away = -away[0], -away[1], -away[2]
        centre, offset = vector(mine.offset), vector(its.offset)
        path, row = (offset, (-away[0], -away[1], -away[2])), space.data
        for k in range(PAIR_WIDTH):
            row[0, k] = its.touched[k]
        ball, surface, limit = record_at(SPHERE, row, 0, 0), record_at(SURFACE, row, 0, BEHIND), space.contacts.shape[0]
        growth, extent = surface.growth, ball.radius
        before = int(its.parts) if s == 1 else 0
        for n in range(int(mine.parts)):
            part = record_at(PART, data, c, int(mine.begin) + PART_WIDTH * n)
            kind, thickness, slot = part.kind, part.thickness, 3 * (before + n)
            surface.growth, ball.radius = growth + thickness + ahead, extent + thickness + ahead
            p = add(times_transposed(frame_a.axes, add(vector(part.start), centre)), away)
            p = less(times(frame_b.axes, p), offset)
            pair = pair_of(row, 0, 2)
            if kind == SEGMENT:
                q = add(times_transposed(frame_a.axes, add(vector(part.end), centre)), away)
                q = less(times(frame_b.axes, q), offset)
                d, middle = less(q, p), (0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1]), 0.5 * (p[2] + q[2]))
                if depth(middle, pair.shape)[0] + 0.5 * STEEPEST * math.sqrt(dot(d, d)) <= 0.0:
                    continue
                for k in range(3):
                    space.x[0, k], space.x[1, k] = p[k], q[k]
                for m in range(contacts(space.x, space.cells, row, 0, space.contact_data)):
                    touch = touch_of(space.x, space.cells, row, space.contact_data, m)
                    end = 1 if touch.xi > 0.5 else 0
                    if (touch.inner or part.owns[end] != 0.0) and count < limit:
                        w = window(False, touch.xi, touch.inner)[0]
                        contact_data = touch.spot.depth, w * touch.weight, w * touch.share, 1.0 if touch.inner else 0.0
                        which = slot + (2 if touch.inner else end)
                        record(
                            space,
                            count,
                            s,
                            which,
                            path,
                            touch.spot.y,
                            touch.spot.gradient,
                            contact_data,
                            thickness,
                            frame_b,
                        )
                        count += 1
            elif kind == ARC:
                relative = times(frame_b.axes, times_transposed(frame_a.axes, vector(part.end)))
                two = times(frame_b.axes, times_transposed(frame_a.axes, vector(part.third)))
                _, w, y, deep, g = arc(part.owns[0], part.owns[1], p, relative, two, pair)
                if w > 0.0 and count < limit:
                    record(space, count, s, slot, path, y, g, (deep, w, w, 1.0), thickness, frame_b)
                    count += 1
            else:
                deep, g, _ = depth(p, pair.shape)
                if deep > 0.0 and count < limit:
                    record(space, count, s, slot, path, p, g, (deep, 1.0, 1.0, 0.0), thickness, frame_b)
                    count += 1
        return count

    return press, limit


@functools.cache
def meeting(first, second):
    """Kernels of two bodies whose depths are given, see `pressing`.

    ``space_of(data)`` is the `Space`, and ``detect(ahead, x, cells, data, c, space)`` the number of contacts of a pair
    that it holds; it is called by its address, see `refweb.effects.contact.contact_points.places`.
    """
    (press, first_limit), (press_back, second_limit) = pressing(second), pressing(first)
    rows = max(first_limit, second_limit)

    @kernel()
    def space_of(data):
        cells = np.empty((1, 3), dtype=np.int32)
        for k in range(3):
            cells[0, k] = k
        largest = int(record_at(BODIES, data, 0, 0).room) if data.shape[0] else 0
        contacts = np.empty(largest, BODY_CONTACT)
        return Space(np.zeros((3, 3)), cells, np.empty((1, PAIR_WIDTH)), np.empty(rows, LINE_CONTACT), contacts)

    @kernel(apart=())
    def detect(ahead: float, x: Matrix, cells: Indices, data: Matrix, c: int, space: Space) -> int:
        away = apart(x, cells, data, c)
        reach = side_of(data, c, 0).extent + side_of(data, c, 1).extent + ahead
        if dot(away, away) > reach * reach:
            return 0
        count = press(ahead, x, cells, data, c, 0, space, 0)
        return press_back(ahead, x, cells, data, c, 1, space, count)

    return space_of, detect
