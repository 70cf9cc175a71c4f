"""Penetration check of lines with lines in a drift, and the time in which no lines can meet.

In a drift nodes move in straight lines. Points of two elements approach by at most the largest of the four differences
of the displacements of their nodes, since such a difference is linear along each element. A pair with a larger distance
does not meet. For all other pairs the motion is followed: at a distance d, the share d over that difference is safe.
This is repeated until the end of the drift, or until centre lines are nearer than `MEETING` times the distance of
contact.

Two elements that share a node meet if one folds flat onto the other: their distance is that of the far node of each
from the other element. They do not push each other, nor do elements that are near along the net. Such meetings are
reported, not prevented. A pair with a distance d needs no new check before rows have moved by d relative to each other.

May change: `AHEAD`, which decides time alone; `LOOKS` upwards, by which fewer pairs count as meeting in doubt; `TRAVEL`
downwards, which makes steps of implicit methods shorter. Must stay: signatures `MEETS` and `TIME_TO_CONTACT` of `meets`
and `soon`; cells that are pairs or single elements; the last three entries of ``due``, which `integrators.ccd` uses;
that no meeting is missed, which `MEETING` defines; `neighbours`, which `table` imports. Tests:
``tests/effects/test_self_contact.py``.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.rows import records_of, width_of
from ...kernels import MEETS, TIME_TO_CONTACT, kernel
from ..vectors import dot
from .pair import PAIR, nearest, numbers_of, place_of
from .search import near_pairs

MEETING = 1e-9
"""Distance at which centre lines count as meeting, over the distance of contact."""
LOOKS = 200
"""Largest number of positions of a pair that are checked; an undecided pair then counts as meeting."""
AHEAD = 8.0
"""Number of drifts for which pairs to check in turn are chosen."""
TRAVEL = 0.2
"""Largest approach of lines in an implicit step, over the distance of contact; or half of their distance."""


@kernel(forceinline=True)
def from_line(u, w):
    """Distance of the point u from the segment of w, both from its beginning."""
    square = dot(w, w)
    s = min(max(dot(u, w) / square, 0.0), 1.0) if square > 0.0 else 0.0
    d = u[0] - s * w[0], u[1] - s * w[1], u[2] - s * w[2]
    return math.sqrt(dot(d, d))


@kernel(forceinline=True)
def distance(p, u, w, joined):
    """Distance of two elements; for elements that are ``joined`` at their first nodes, that of their ends."""
    return min(from_line(u, w), from_line(w, u)) if joined else math.sqrt(max(nearest(p, u, w)[2], 0.0))


@kernel(forceinline=True)
def longest_of(p, u, w):
    """Largest size of p + s u − t w over both elements, which is at their ends."""
    longest = 0.0
    for i in range(2):
        for j in range(2):
            a, b = p[0] + i * u[0] - j * w[0], p[1] + i * u[1] - j * w[1]
            c = p[2] + i * u[2] - j * w[2]
            longest = max(longest, a * a + b * b + c * c)
    return math.sqrt(longest)


@kernel(forceinline=True)
def ways_of(cells, c, kick, drift, v, f, inverse):
    """Change of the vectors (p, u, w) of pair c in a drift after a kick."""
    i, j, k, m = cells[c, 0], cells[c, 1], cells[c, 2], cells[c, 3]
    a0, a1 = drift * (v[i, 0] + kick * inverse[i, 0] * f[i, 0]), drift * (v[i, 1] + kick * inverse[i, 1] * f[i, 1])
    b0, b1 = drift * (v[j, 0] + kick * inverse[j, 0] * f[j, 0]), drift * (v[j, 1] + kick * inverse[j, 1] * f[j, 1])
    c0, c1 = drift * (v[k, 0] + kick * inverse[k, 0] * f[k, 0]), drift * (v[k, 1] + kick * inverse[k, 1] * f[k, 1])
    d0, d1 = drift * (v[m, 0] + kick * inverse[m, 0] * f[m, 0]), drift * (v[m, 1] + kick * inverse[m, 1] * f[m, 1])
    a2, b2 = drift * (v[i, 2] + kick * inverse[i, 2] * f[i, 2]), drift * (v[j, 2] + kick * inverse[j, 2] * f[j, 2])
    c2, d2 = drift * (v[k, 2] + kick * inverse[k, 2] * f[k, 2]), drift * (v[m, 2] + kick * inverse[m, 2] * f[m, 2])
    return (a0 - c0, a1 - c1, a2 - c2), (b0 - a0, b1 - a1, b2 - a2), (d0 - c0, d1 - c1, d2 - c2)


@kernel(forceinline=True)
def gone(vector, share, path):
    """A vector after a share of its change."""
    return vector[0] + share * path[0], vector[1] + share * path[1], vector[2] + share * path[2]


@kernel()
def would_meet(margin, geometry, ways, joined):
    """(True if a pair comes nearer than ``margin`` in a drift, distance at its start)."""
    (p, u, w), (dp, du, dw) = geometry, ways
    longest, share, start = longest_of(dp, du, dw), 0.0, distance(p, u, w, joined)
    left = start
    for _ in range(LOOKS):
        if not left - margin > 0.0:
            return True, start
        if left - margin > (1.0 - share) * longest:
            return False, start
        share += (left - margin) / longest
        left = distance(gone(p, share, dp), gone(u, share, du), gone(w, share, dw), joined)
    return True, start


@kernel(forceinline=True)
def choose_due(reach, count, due):
    """Number of cells that are chosen, anew where some may be due that are not: those that are due soon."""
    if due[count].path + reach >= due[count + 1].path:
        due[count + 1].path = due[count].path + AHEAD * reach if count else math.inf
        due[count].chosen = 0
        for c in range(count):
            if due[c].path <= due[count + 1].path:
                due[due[count].chosen].chosen = c
                due[count].chosen += 1
    return due[count].chosen


@kernel(MEETS)
def meets(margin, path, kick, drift, x, v, f, inverse, cells, data, due, met):
    if cells.shape[1] != 4:
        _, cells, data = near_pairs(max(path, 0.0) + margin, x, cells, data)
    count, listed, came, following = cells.shape[0], due.size > 0, False, math.inf
    for n in range(choose_due(path + margin, count, due) if listed else count):
        c = due[n].chosen if listed else n
        if not (listed and due[c].path > due[count].path + path + margin):
            of, joined, closed, start = numbers_of(data, c), cells[c, 0] == cells[c, 2], False, math.inf
            if of.scale > 0.0:
                ways = ways_of(cells, c, kick, drift, v, f, inverse)
                closed, start = would_meet(margin + MEETING * of.touch, place_of(x, cells, data, c), ways, joined)
            if closed and not came:
                came = True
                for k in range(4):
                    met[k] = cells[c, k]
                if not listed:
                    break
            if listed:
                due[c].path = due[count].path + start
        if listed:
            following = min(following, due[c].path)
    if listed:
        due[count + 2].path = min(following, due[count + 1].path)
    return came


@kernel(TIME_TO_CONTACT)
def soon(x, v, cells, data):
    time = math.inf
    for c in range(cells.shape[0]):
        of = numbers_of(data, c)
        if of.scale > 0.0:
            speed = 2.0 * longest_of(*ways_of(cells, c, 0.0, 1.0, v, v, v))
            if speed > 0.0:
                geometry = place_of(x, cells, data, c)
                left = distance(geometry.p, geometry.u, geometry.w, False) - of.touch
                time = min(time, max(TRAVEL * of.touch, 0.5 * left) / speed)
    return time


def neighbours(net, beside, touch):
    """(Nodes, numbers, elements) of the pairs of elements that do not push: joined at a node, or near along the net.

    Joined elements begin at their common node. Two lines between the same nodes coincide at any time, and are no pair.

    Parameters
    ----------
    net : refweb.net.net.Net
        The elements.
    beside : ndarray, shape (elements, most)
        Those that are near each other along the net, see `refweb.effects.self_contact.table.near_along`.
    touch : float
        Distance at which lines touch [m].
    """
    cells, count = net.cells, len(net.cells)
    positions = np.stack([net.points[cells[:, 0]]] * 2, axis=1)
    positions[:, 1] += net.line_data.reference
    ends = np.arange(2 * count)  # element, and which of its nodes
    order = ends[np.argsort(cells.ravel(), kind="stable")]
    begin = np.searchsorted(cells.ravel()[order], np.arange(net.nodes + 1))
    joined = []
    for size in np.unique(np.diff(begin)):
        starts = begin[:-1][np.diff(begin) == size]
        first_index, second = np.triu_indices(size, 1)
        joined.append(
            np.stack([order[starts[:, None] + first_index].ravel(), order[starts[:, None] + second].ravel()], axis=1)
        )
    joined = np.concatenate([*joined, np.zeros((0, 2), dtype=np.int64)])
    twice = (np.sort(cells[joined[:, 0] // 2], axis=1) == np.sort(cells[joined[:, 1] // 2], axis=1)).all(axis=1)
    joined = joined[~twice]
    element, column = np.nonzero(beside > np.arange(count)[:, None])
    near = 2 * np.stack([element, beside[element, column].astype(np.int64)], axis=1)
    pairs = np.concatenate([joined, near])
    elements, first = pairs // 2, pairs % 2
    rows = np.stack([cells[elements, first], cells[elements, 1 - first]], axis=2).reshape(-1, 4)
    at = np.stack([positions[elements, first], positions[elements, 1 - first]], axis=2).reshape(-1, 4, 3)
    data = np.zeros((len(pairs), width_of(PAIR)))
    numbers = records_of(PAIR, data)
    numbers["touch"], numbers["scale"], numbers["vectors"] = touch, 1.0, at[:, 1:] - at[:, :1]
    return np.ascontiguousarray(rows, dtype=np.int32), data, elements
