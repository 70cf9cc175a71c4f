"""Search for elements that are near each other: pairs of a list, or of all elements by a grid of cells.

A cell of the grid is as wide as the longest element plus the distance of the search. Therefore all elements near an
element have their middles in the same cell or in a neighbouring cell, and the time is proportional to the number of
elements. Elements that share a node make no pair, nor do those that are listed as near along the net.

May change: `BOXES`, the size of the grid. Must stay: that no pair within reach is missed, `REACH` included; what
`near_pairs` and `paired` return, for all kernels of this folder; the order of pairs, which decides the last digits of
results; `axes_apart`, which `line_line_penalty` imports; `distances`, `foresee` and `pairs_by_margin`, which `table`
imports; `margins_ahead`, which `integrators.neighbour_list` imports; `FASTER`, which `integrators.step_bound` imports.
Tests: ``tests/effects/test_self_contact.py`` compares with all pairs.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.rows import record_at, width_of
from ...kernels import NEAR, kernel
from ..vectors import dot
from .pair import APART, ELEMENT, PAIR, nearest, place_of

WIDTH = width_of(PAIR)
"""Number of columns of the data of pairs."""

REACH = math.sqrt(2.0)
"""Distance of two segments up to which they may push each other, over the distance of contact: the window of an element
extends beyond its ends."""
FASTER = 1.5
"""Allowance for what other contacts add to the relative speed of a pair in a span."""
ROUNDED = 1e-12
"""Allowance for rounding in the margins of rows."""
BOXES = 4
"""Largest number of cells of the grid over that of elements."""


@kernel()
def middles(marks, x, cells, data, buffer):
    """Write middle, half vector, half length and margin of elements to ``buffer (elements, 8)``.

    The result is the largest sum of both. The last column of ``marks`` has the margins of rows; without rows they are
    0.
    """
    widest = 0.0
    for c in range(cells.shape[0]):
        i, j, square, ends = cells[c, 0], cells[c, 1], 0.0, record_at(ELEMENT, data, c, 0).ends
        for k in range(3):
            a, b = ends[0, k] + x[i, k], ends[1, k] + x[j, k]
            buffer[c, k], buffer[c, 3 + k] = 0.5 * (a + b), 0.5 * (b - a)
            square += (b - a) * (b - a)
        buffer[c, 6] = 0.5 * math.sqrt(square)
        buffer[c, 7] = max(marks[i, 3], marks[j, 3]) if marks.shape[0] else 0.0
        widest = max(widest, buffer[c, 6] + buffer[c, 7])
    return widest


@kernel()
def boxes_of(width, buffer):
    """(least place, width of the cells of a grid, numbers along the axes); no cells where places are not finite."""
    low, high, count = np.empty(3), np.empty(3), np.empty(3, dtype=np.int64)
    for k in range(3):
        low[k], high[k], count[k] = math.inf, -math.inf, 1
    for c in range(buffer.shape[0]):
        for k in range(3):
            low[k], high[k] = min(low[k], buffer[c, k]), max(high[k], buffer[c, k])
    size, finite = 0.0, True
    for k in range(3):  # numba's ``max`` of an array takes half a second to compile
        size, finite = max(size, high[k] - low[k]), finite and math.isfinite(high[k] - low[k])
    if not (finite and math.isfinite(width) and width > 0.0):
        count[0] = 0
        return low, width, count
    width = max(width, size / 1e6)
    while True:
        total = 1.0
        for k in range(3):
            count[k] = int((high[k] - low[k]) / width) + 1
            total *= count[k]
        if total <= BOXES * buffer.shape[0] + 64:
            return low, width, count
        width *= 1.3


@kernel()
def sorted_by_box(low, width, count, buffer):
    """(elements in the order of boxes, where each box begins among them, and their columns of ``buffer``).

    The last three columns are the half sizes of their boxes, with their margins.
    """
    sorted_elements = np.empty(buffer.shape[0], dtype=np.int64)
    start = np.empty(count[0] * count[1] * count[2] + 1, dtype=np.int64)
    for b in range(start.size):
        start[b] = 0
    for c in range(buffer.shape[0]):
        at = 0
        for k in range(3):
            at = at * count[k] + min(int((buffer[c, k] - low[k]) / width), count[k] - 1)
        sorted_elements[c] = at
        start[at + 1] += 1
    for b in range(1, start.size):
        start[b] += start[b - 1]
    order, filled = np.empty(buffer.shape[0], dtype=np.int64), np.empty(start.size - 1, dtype=np.int64)
    columns = np.empty((buffer.shape[1] + 3, buffer.shape[0]))
    for b in range(filled.size):
        filled[b] = start[b]
    for c in range(buffer.shape[0]):
        at = filled[sorted_elements[c]]
        order[at] = c
        filled[sorted_elements[c]] += 1
        for k in range(buffer.shape[1]):
            columns[k, at] = buffer[c, k]
        for k in range(3):
            columns[8 + k, at] = abs(buffer[c, 3 + k]) + buffer[c, 7]
    return order, start, columns


@kernel(forceinline=True)
def nonadjacent(a, b, cells, data):
    """Tell if two elements share no node, and are not near along the net."""
    i, j, k, m = cells[a, 0], cells[a, 1], cells[b, 0], cells[b, 1]
    if i == k or i == m or j == k or j == m:
        return False
    for n in range(APART, data.shape[1]):
        if data[a, n] < 0.0:
            return True
        if data[a, n] == b:
            return False
    return True


@kernel(leaf=True)
def note_boxes(reach, m, begin, end, columns, meets):
    """Write if the boxes of an element and of those from ``begin`` to ``end`` are nearer than a reach.

    Many are looked at at once; to test one by one takes twice as long.
    """
    x, y, z = columns[0, m], columns[1, m], columns[2, m]
    a, b, c = reach + columns[8, m], reach + columns[9, m], reach + columns[10, m]
    for n in range(begin, end):
        first, second = abs(columns[0, n] - x) <= a + columns[8, n], abs(columns[1, n] - y) <= b + columns[9, n]
        meets[n] = first & second & (abs(columns[2, n] - z) <= c + columns[10, n])


@kernel(forceinline=True)
def segments_meet(reach, m, n, columns):
    """Tell if two elements are nearer than a reach."""
    g, h = (columns[3, m], columns[4, m], columns[5, m]), (columns[3, n], columns[4, n], columns[5, n])
    d = columns[0, m] - columns[0, n], columns[1, m] - columns[1, n], columns[2, m] - columns[2, n]
    p = d[0] - g[0] + h[0], d[1] - g[1] + h[1], d[2] - g[2] + h[2]
    u, w = (2.0 * g[0], 2.0 * g[1], 2.0 * g[2]), (2.0 * h[0], 2.0 * h[1], 2.0 * h[2])
    return nearest(p, u, w)[2] < reach * reach


@kernel(forceinline=True)
def set_ranges(box, count, start, ranges):
    """Write where elements begin and end that stand in half of the boxes beside a box; their number."""
    z = box % count[2]
    y, q = box // count[2] % count[1], box // count[2] // count[1]
    before, behind, amount = (1 if z > 0 else 0), (1 if z + 1 < count[2] else 0), 1
    ranges[0, 1] = start[box + behind + 1]  # of its own and the one behind it, from an element on
    for n in range(4):
        i, j = (1, n - 1) if n < 3 else (0, 1)
        if q + i < count[0] and 0 <= y + j < count[1]:
            neighbour = box + (i * count[1] + j) * count[2]
            ranges[amount, 0], ranges[amount, 1] = start[neighbour - before], start[neighbour + behind + 1]
            amount += 1
    return amount


@kernel()
def fill(reach, count, start, order, columns, cells, data, pairs):
    """Write all pairs of elements nearer than a reach and both margins, as far as ``pairs`` holds; their number."""
    ranges, amount, meets = np.empty((5, 2), dtype=np.int64), 0, np.empty(order.size, dtype=np.bool_)
    for box in range(start.size - 1):
        if start[box] == start[box + 1]:
            continue
        beside = set_ranges(box, count, start, ranges)
        for m in range(start[box], start[box + 1]):
            ranges[0, 0] = m + 1
            for part in range(beside):
                note_boxes(reach, m, ranges[part, 0], ranges[part, 1], columns, meets)
                for n in range(ranges[part, 0], ranges[part, 1]):
                    if not meets[n]:
                        continue
                    a, b, within = (
                        min(order[m], order[n]),
                        max(order[m], order[n]),
                        reach + columns[7, m] + columns[7, n],
                    )
                    if nonadjacent(a, b, cells, data) and segments_meet(within, m, n, columns):
                        if amount < pairs.shape[0]:
                            pairs[amount, 0], pairs[amount, 1] = a, b
                        amount += 1
    return amount


@kernel()
def in_order(count, amount, unsorted):
    """The first pairs of those that are found of a number of elements, in the order of their elements."""
    begin, filled = np.zeros(count + 1, dtype=np.int64), np.zeros(count, dtype=np.int64)
    pairs = np.empty((amount, 2), dtype=np.int64)
    for n in range(amount):
        begin[unsorted[n, 0] + 1] += 1
    for a in range(count):
        begin[a + 1] += begin[a]
    for n in range(amount):
        a, b = unsorted[n, 0], unsorted[n, 1]
        at = begin[a] + filled[a]
        filled[a] += 1
        while at > begin[a] and pairs[at - 1, 1] > b:
            pairs[at, 1] = pairs[at - 1, 1]
            at -= 1
        pairs[at, 1] = b
        pairs[begin[a] + filled[a] - 1, 0] = a
    return pairs


@kernel()
def pairs_within(skin, marks, x, cells, data):
    """Numbers of all pairs of elements that may push each other, in order, shape (., 2).

    They come nearer by ``skin`` [m] and the margins of both, see `middles`.
    """
    none, buffer = np.empty((0, 2), dtype=np.int64), np.empty((cells.shape[0], 8))
    if cells.shape[0] < 2:
        return none
    reach = REACH * record_at(ELEMENT, data, 0, 0).touch + skin
    low, width, count = boxes_of(2.0 * middles(marks, x, cells, data, buffer) + reach, buffer)
    if count[0] == 0:
        return none
    order, start, columns = sorted_by_box(low, width, count, buffer)
    unsorted = np.empty((cells.shape[0] + 64, 2), dtype=np.int64)
    while True:
        amount = fill(reach, count, start, order, columns, cells, data, unsorted)
        if amount <= unsorted.shape[0]:
            return in_order(cells.shape[0], amount, unsorted)
        unsorted = np.empty((amount, 2), dtype=np.int64)


@kernel()
def paired(chosen, cells, data):
    """(nodes, numbers) of pairs of elements, as `refweb.effects.self_contact.pair` has them."""
    rows, numbers = np.empty((chosen.shape[0], 4), dtype=np.int32), np.empty((chosen.shape[0], WIDTH))
    for c in range(chosen.shape[0]):
        a, b = chosen[c, 0], chosen[c, 1]
        for n in range(2):
            rows[c, n], rows[c, 2 + n] = cells[a, n], cells[b, n]
        pair, first = record_at(PAIR, numbers, c, 0), record_at(ELEMENT, data, a, 0)
        second = record_at(ELEMENT, data, b, 0)
        pair.touch, pair.damping, pair.scale = first.touch, first.damping, min(first.scale, second.scale)
        pair.length, pair.second = first.length, second.length
        pair.friction, pair.slip_velocity, pair.rolls = first.friction, first.slip_velocity, first.rolls
        pair.elements[0], pair.elements[1] = a, b
        pair.approach = pair.speed = pair.closing = math.inf
        for k in range(3):
            pair.vectors[0, k] = first.ends[1, k] - first.ends[0, k]
            pair.vectors[1, k] = second.ends[0, k] - first.ends[0, k]
            pair.vectors[2, k] = second.ends[1, k] - first.ends[0, k]
    return rows, numbers


@kernel()
def pairs_by_margin(skin, marks, x, cells, data):
    """(numbers of the elements, nodes, numbers) of all pairs within a skin, and the margins of rows, of touching."""
    chosen = pairs_within(skin, marks, x, cells, data)
    rows, numbers = paired(chosen, cells, data)
    return chosen, rows, numbers


@kernel()
def near_pairs(skin, x, cells, data):
    """The same within a skin alone."""
    return pairs_by_margin(skin, np.empty((0, 4)), x, cells, data)


@kernel()
def foresee(span, early, x, v, f, inverse, cells, data):
    """Write how near the elements of each pair may come in a span [s], and how fast they are then.

    Their nodes have the velocities v, and what the forces f add within a time ``early`` [s]. A force that is not in
    balance turns within half a period of its line, so that it does not act for a longer span. All points of both are
    apart by their distance, along the line between the nearest two, so that it falls by what nodes move along that.
    """
    for c in range(cells.shape[0]):
        (p, u, w), fastest, closest = place_of(x, cells, data, c), 0.0, 0.0
        s, t, square = nearest(p, u, w)
        q = p[0] + s * u[0] - t * w[0], p[1] + s * u[1] - t * w[1], p[2] + s * u[2] - t * w[2]
        inverse_size = 1.0 / math.sqrt(square) if square > 0.0 else 0.0
        for i in range(2):
            for j in range(2, 4):
                r, o, speed, push, apart = cells[c, i], cells[c, j], 0.0, 0.0, 0.0
                for k in range(3):
                    speed += (v[r, k] - v[o, k]) ** 2
                    push += (inverse[r, k] * f[r, k] - inverse[o, k] * f[o, k]) ** 2
                    apart += (v[r, k] - v[o, k]) * q[k]
                speed, push = math.sqrt(speed), early * math.sqrt(push)
                fastest = max(fastest, speed + push)
                toward = -apart * inverse_size if square > 0.0 else speed
                closest = max(closest, toward + (FASTER - 1.0) * speed + FASTER * push)
        pair = record_at(PAIR, data, c, 0)
        pair.speed = FASTER * fastest
        pair.approach, pair.closing = span * pair.speed, span * closest


@kernel()
def margins_ahead(span, early, v, f, inverse):
    """Rooms of rows as marks, see `middles`: no pair comes nearer by more than those of its elements in `foresee`."""
    marks, mean = np.zeros((v.shape[0], 4)), np.zeros(3)
    for r in range(v.shape[0]):
        for k in range(3):
            mean[k] += v[r, k] / v.shape[0]
    for r in range(v.shape[0]):
        speed = push = 0.0
        for k in range(3):
            speed += (v[r, k] - mean[k]) ** 2
            push += (inverse[r, k] * f[r, k]) ** 2
        marks[r, 3] = FASTER * span * (math.sqrt(speed) + early * math.sqrt(push)) * (1.0 + ROUNDED)
    return marks


@kernel()
def distances(x, cells, data):
    """Distance of the centre lines of each pair [m]."""
    apart = np.empty(cells.shape[0])
    for c in range(cells.shape[0]):
        p, u, w = place_of(x, cells, data, c)
        apart[c] = math.sqrt(nearest(p, u, w)[2])
    return apart


@kernel(forceinline=True)
def from_axis(p, u, w):
    """Least distance of the points of an element u from the axis of the element w, p as in `Place`."""
    ww, pw, uw = dot(w, w), dot(p, w), dot(u, w)
    share, change = pw / ww, uw / ww
    a = p[0] - share * w[0], p[1] - share * w[1], p[2] - share * w[2]
    b = u[0] - change * w[0], u[1] - change * w[1], u[2] - change * w[2]
    square = dot(b, b)
    s = min(max(-dot(a, b) / square, 0.0), 1.0) if square > 0.0 else 0.0
    a = a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]
    return math.sqrt(dot(a, a))


@kernel(forceinline=True)
def axes_apart(p, u, w, touch, approach):
    """Least distance of each element from the axis of the other, at least, when rows have come nearer by an approach.

    An element touches points that are within the distance of touch of its axis, and no further beyond its ends. There
    the axis moves by more than its nodes, by 2 touch over the length of the element. 0 where an element may have become
    shorter than the approach.
    """
    first, second = math.sqrt(dot(u, u)) - approach, math.sqrt(dot(w, w)) - approach
    if not min(first, second) > 0.0:
        return 0.0
    of_first = from_axis(p, u, w) - approach * (1.0 + 2.0 * touch / second)
    of_second = from_axis((-p[0], -p[1], -p[2]), w, u) - approach * (1.0 + 2.0 * touch / first)
    return max(min(of_first, of_second), 0.0)


@kernel(NEAR)
def near(skin, x, cells, data, chosen):
    count = 0
    for c in range(cells.shape[0]):
        p, u, w = place_of(x, cells, data, c)
        touch = record_at(PAIR, data, c, 0).touch
        reach = REACH * touch + skin
        m = p[0] + 0.5 * (u[0] - w[0]), p[1] + 0.5 * (u[1] - w[1]), p[2] + 0.5 * (u[2] - w[2])
        square = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
        span = u[0] * u[0] + u[1] * u[1] + u[2] * u[2] + w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
        if square > 0.75 * span + 3.0 * reach * reach or nearest(p, u, w)[2] >= reach * reach:
            continue  # what is not a number is near
        if axes_apart(p, u, w, touch, skin) > touch:
            continue
        chosen[count] = c
        count += 1
    return count
