"""Compiled probes: scalars that a run evaluates in every step.

A probe has the signature ``value = probe(t, x, v, f, lines, rows, data, where)``. ``x``, ``v`` and ``f`` are the
displacement, the velocity and the total force of each row of the unknowns, shape (rows, 3). ``lines`` has tension and
strain of each element, shape (cells, 2 or more). ``rows`` and ``data`` are parameters of the probe; ``data`` may also
be the output of a force term for its cells. If ``where[1]`` is `PLACE`, the probe writes the row or element of its
value to ``where[0]``.

May change: private functions; how a value is found, if it stays the same to the last digit. Must stay: the signature
`PROBE`, which kernels here, in `observables` and in plug-ins have; ``where[0]`` and ``where[1]``; numbers of
`MAGNITUDE`, `PLACE`, `NODES`, `LINES` and of sources, which kernels read; parameters in ``rows`` as each docstring
says; `plain_of`, as `dynamics.integrators.extremes` has loops of its own for what it knows; no kernel in
`WITHOUT_LINES` reads ``lines``; all names that `observables.reaction`, `integrators.rupture` and other files import.
Tests: ``tests/results/test_probes.py``, ``tests/results/test_observable_contract.py``,
``tests/dynamics/integrators/test_line_blocks.py``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types

from ..compiled.rows import numbers_aside, numbers_at, record_at, width_of
from ..effects.base import BLOCK, BLOCK_OUT, FELT, STRAIN
from ..kernels import INTEGERS, MATRIX, kernel, sum_of

PROBE = types.float64(types.float64, MATRIX, MATRIX, MATRIX, MATRIX, INTEGERS, MATRIX, INTEGERS)
MAGNITUDE = 3
"""Component number of a magnitude."""
PLACE = 1
"""Value of ``where[1]`` that asks a probe for the row or element of its value."""


class Probe(NamedTuple):
    """Scalar of the state that a run follows.

    Attributes
    ----------
    kernel : callable
        Compiled function of the signature `PROBE`.
    rows : sequence of int
        Parameters of the probe, see its kernel.
    data : ndarray of float, two-dimensional
        Further parameters.
    sign : float
        1 for the largest value of all steps, −1 for the smallest, 0 for neither.
    average : float
        Length of a window [s] whose mean replaces the value, 0 for none.
    term : int
        Number of the force term whose output per cell replaces ``data``; `refweb.effects.base.CONTACT` for the contact
        forces on bodies; −1 for none.
    """

    kernel: Callable[..., Any]
    rows: list[Any] | np.ndarray
    data: np.ndarray
    sign: float = 0.0
    average: float = 0.0
    term: int = -1

    def at(self, state: Any, force: np.ndarray) -> float:
        """Value in a `refweb.results.state.State` with the total ``force`` of each row, of a probe without lines."""
        rows, data = np.array(self.rows, dtype=np.int64), np.ascontiguousarray(self.data, dtype=float)
        return float(self.kernel(state.time, state.x, state.v, force, np.zeros((0, 0)), rows, data, np.full(2, -1)))


@kernel()
def _larger(a, b):
    return b if b > a else a


@kernel()
def _square(a, data, row, n):
    x, y, z = a[row, 0] + data[n, 0], a[row, 1] + data[n, 1], a[row, 2] + data[n, 2]
    return x * x + y * y + z * z


@kernel()
def _value(a, data, row, n, component):
    return a[row, component] + data[n, component] if component < MAGNITUDE else _square(a, data, row, n)


@kernel(leaf=True)
def largest_of(a, data, rows, where):
    """Largest component, or magnitude, of ``a + data`` over some rows.

    ``rows`` is (component, first, last + 1), or (component, −1, −1, row, row, ...). The row of the value is found only
    if it is asked for.
    """
    component, first, last, best = rows[0], rows[1], rows[2], -math.inf
    if first >= 0:
        part = a[first:last]  # a view whose index starts at 0: no check for rows counted from the end
        for n in range(part.shape[0]):
            best = _larger(best, _value(part, data, n, n, component))
    else:
        for n in range(rows.size - 3):
            best = _larger(best, _value(a, data, rows[3 + n], n, component))
    if where[1] == PLACE:
        where[0] = -1
        for n in range(data.shape[0]):
            r = first + n if first >= 0 else rows[3 + n]
            if _value(a, data, r, n, component) >= best - 1e-15 * abs(best):
                where[0] = r
                break
    return math.sqrt(best) if component == MAGNITUDE else best


NODES, LINES = 1, 2
"""Kinds of `plain_of`: the largest magnitude of displacements, the largest value of a column over elements."""


GROUP, LANES = 512, 64
"""Number of rows, or elements, whose largest value is found by itself, so that its place is searched in few of them.
Number of maxima that are found at once: a loop without a branch takes all lanes of the processor."""
OF_BLOCKS: int = width_of(BLOCK_OUT)
"""Number of columns of a matrix that has blocks of lines in place of lines: no other has as many."""


@kernel(leaf=True, forceinline=True)
def largest_in(lines, column, first, last):
    """Largest value of a column over the elements from ``first`` to ``last`` − 1, and one at or before its place.

    The second is the first of a group of elements: in that group lies the place, or within rounding an equal one.
    """
    best, near, maxima, width = -math.inf, first, numbers_aside(LANES), lines.shape[1]
    for begin in range(first, last, GROUP):
        end = min(begin + GROUP, last)
        values, largest = numbers_at(lines, begin, column), -math.inf
        for k in range(LANES):
            maxima[k] = -math.inf
        for n in range((end - begin) // LANES if width == 2 else 0):
            for k in range(np.uint64(LANES)):
                value = values[np.uint64(2) * (np.uint64(LANES * n) + k)]
                maxima[k] = value if value > maxima[k] else maxima[k]
        for n in range((end - begin) // LANES * LANES if width == 2 else 0, end - begin):
            largest = _larger(largest, values[width * n])
        for k in range(LANES):
            largest = _larger(largest, maxima[k])
        if _far_above(largest, best):
            near = begin
        best = _larger(best, largest)
    return best, near


@kernel(leaf=True, forceinline=True)
def largest_of_blocks(blocks, column):
    """Largest tension, or strain, of all blocks of lines, of a matrix of `BLOCK_OUT` with one more row."""
    best = -math.inf
    for n in range(blocks.shape[0] - 1):
        best = _larger(best, blocks[n, column])
    return best


@kernel(leaf=True, forceinline=True)
def largest_square(x, first, last):
    """Largest squared magnitude of the flat array x over rows ``first`` to ``last`` − 1, and a row as `largest_in`."""
    best, near, maxima = -math.inf, first, numbers_aside(LANES)
    for begin in range(first, last, GROUP):
        end, largest = min(begin + GROUP, last), -math.inf
        for k in range(LANES):
            maxima[k] = -math.inf
        for n in range((end - begin) // LANES):
            row = np.uint64(begin + LANES * n)
            for k in range(np.uint64(LANES)):
                value = _size(x, np.uint64(3) * (row + k))
                maxima[k] = value if value > maxima[k] else maxima[k]
        for n in range(begin + (end - begin) // LANES * LANES, end):
            largest = _larger(largest, _size(x, np.uint64(3 * n)))
        for k in range(LANES):
            largest = _larger(largest, maxima[k])
        if _far_above(largest, best):
            near = begin
        best = _larger(best, largest)
    return best, near


@kernel(leaf=True, forceinline=True)
def _far_above(a, b):
    """Tell if a value is above another by more than its rounding."""
    return a - 1e-15 * abs(a) > b


@kernel(leaf=True, forceinline=True)
def _size(x, q):
    return x[q] * x[q] + x[q + np.uint64(1)] * x[q + np.uint64(1)] + x[q + np.uint64(2)] * x[q + np.uint64(2)]


@kernel(leaf=True, forceinline=True)
def row_of_square(x, first, last, square):
    """First row whose squared magnitude is the largest, as `largest_of` says it; four are compared at once."""
    limit, fours = square - 1e-15 * abs(square), first
    while fours + 4 <= last:
        q = np.uint64(3 * fours)
        near = _larger(_size(x, q), _size(x, q + np.uint64(3)))
        if _larger(near, _larger(_size(x, q + np.uint64(6)), _size(x, q + np.uint64(9)))) >= limit:
            break
        fours += 4
    for n in range(fours, last):
        if _size(x, np.uint64(3 * n)) >= limit:
            return n
    return -1


@kernel(leaf=True, forceinline=True)
def element_of(lines, column, first, last, scale, value):
    """First element of which ``scale`` times a column is a value, ``first`` if none is; four are compared at once."""
    k, fours = np.uint64(column), first
    while fours + 4 <= last:
        n = np.uint64(fours)
        pair = (lines[n, k] * scale == value) | (lines[n + np.uint64(1), k] * scale == value)
        next_pair = (lines[n + np.uint64(2), k] * scale == value) | (lines[n + np.uint64(3), k] * scale == value)
        if pair | next_pair:
            break
        fours += 4
    for n in range(fours, last):
        if lines[np.uint64(n), k] * scale == value:
            return n
    return first


@kernel(leaf=True, forceinline=True)
def element_of_blocks(blocks, column, scale, value):
    """First element of which ``scale`` times a column is the largest value of all blocks and steps so far, −1 if none.

    Its block shows each of its lines.
    """
    for n in range(blocks.shape[0] - 1):
        if scale * blocks[n, column] == value:
            block = record_at(BLOCK_OUT, blocks, n, 0)
            for k in range(int(block.count)):
                if scale * block.shown[k, column] == value:
                    return n * BLOCK + k
    return -1


def plain_of(probe: Probe) -> tuple[tuple[int, ...], float]:
    """Quantity of a probe if it is so simple that the loop needs no kernel for it.

    Returns
    -------
    tuple of 4 int
        (`NODES`, first row, last + 1, 0), or (`LINES`, column, first element, last + 1), or zeros if it is not simple.
    float
        Factor on the largest value.
    """
    rows, data, none = list(probe.rows), probe.data, ((0, 0, 0, 0), 1.0)
    if probe.kernel is displacement and rows[0] == MAGNITUDE and rows[1] >= 0:
        return none if data.any() else ((NODES, *rows[1:], 0), 1.0)
    if probe.kernel is line and len(data) and data[0, 0] > 0.0 and (data[:, 0] == data[0, 0]).all():
        return (LINES, *rows), float(data[0, 0])
    return none


def reads_each_line(probe: Probe, lines: int) -> bool:
    """Tell if a probe reads more of a number of lines than the largest tension or strain of all."""
    (kind, column, first, last), _ = plain_of(probe)
    if kind == LINES:
        return column > STRAIN or first > 0 or last < lines or probe.sign < 0.0
    return probe.term == 0 or not any(probe.kernel is kernel for kernel in WITHOUT_LINES)


@kernel(PROBE)
def displacement(t, x, v, f, lines, rows, data, where):
    """Largest of x + data: a displacement if data is zero, a position if data is the reference position."""
    return largest_of(x, data, rows, where)


@kernel(PROBE)
def velocity(t, x, v, f, lines, rows, data, where):
    """Largest of v."""
    return largest_of(v, data, rows, where)


@kernel(PROBE)
def reaction(t, x, v, f, lines, rows, data, where):
    """Component or magnitude of −Σ w f over rows; data holds w, shape (rows, 3)."""
    total0 = total1 = total2 = 0.0
    first = rows[1]
    for n in range(data.shape[0]):
        r = first + n if first >= 0 else rows[3 + n]
        total0 -= data[n, 0] * f[r, 0]
        total1 -= data[n, 1] * f[r, 1]
        total2 -= data[n, 2] * f[r, 2]
    where[0] = first if first >= 0 else rows[3]
    return component_of(rows[0], total0, total1, total2)


@kernel(PROBE)
def contact_force(t, x, v, f, lines, rows, data, where):
    """Component or magnitude of the force of contact on bodies together.

    ``rows`` is (component, row of what they feel, ...).
    """
    total0 = total1 = total2 = 0.0
    where[0] = -1
    for n in range(1, rows.size):
        force = record_at(FELT, data, rows[n], 0).force
        total0, total1, total2 = total0 + force[0], total1 + force[1], total2 + force[2]
    return component_of(rows[0], total0, total1, total2)


@kernel(PROBE)
def contact_depth(t, x, v, f, lines, rows, data, where):
    """Largest contact depth in some rows of ``data``, 0 without contact."""
    deepest, where[0] = 0.0, -1
    for r in rows:
        felt = record_at(FELT, data, r, 0)
        if felt.depth > deepest:
            deepest, where[0] = felt.depth, int(felt.element)
    return deepest


@kernel()
def component_of(component, x, y, z):
    """Component or magnitude of a vector."""
    if component == MAGNITUDE:
        return math.sqrt(x * x + y * y + z * z)
    return x if component == 0 else y if component == 1 else z


@kernel(PROBE)
def line(t, x, v, f, lines, rows, data, where):
    """Largest of data × column over elements; ``rows`` is (column, first, last + 1)."""
    column, first, last = rows[0], rows[1], rows[2]
    values, scales, best = lines[first:last, column], data[first:last, 0], -math.inf
    for n in range(values.size):
        best = _larger(best, values[n] * scales[n])
    if where[1] == PLACE:
        where[0] = first
        for n in range(values.size):
            if values[n] * scales[n] == best:
                where[0] = first + n
                break
    return best


@kernel(PROBE)
def line_of(t, x, v, f, lines, rows, data, where):
    """Largest of data × column over some elements; ``rows`` is (column, element, element, ...)."""
    column, best = rows[0], -math.inf
    for n in range(1, rows.size):
        value = lines[rows[n], column] * data[rows[n], 0]
        if n == 1 or value > best:
            best, where[0] = value, rows[n]
    return best


@kernel(PROBE)
def breaking(t, x, v, f, lines, rows, data, where):
    """Largest of data × column over elements, of (tension, strain); ``rows`` are these columns."""
    best, where[0] = -math.inf, -1
    for n in range(data.shape[0]):
        share = max(lines[n, rows[0]] * data[n, 0], lines[n, rows[1]] * data[n, 1])
        if share > best:
            best, where[0] = share, n
    return best


def share_of_limits(system):
    """Probe of the largest share of a limit at which an element of a system breaks, 1 where it breaks."""
    weakness = system.weakness
    if weakness.strains is None:
        return Probe(line, [system.tension_column, 0, len(weakness.limits)], 1.0 / weakness.limits[:, None], 1.0)
    limits = np.column_stack([weakness.limits, weakness.strains])
    return Probe(breaking, [system.tension_column, STRAIN], 1.0 / limits, 1.0)


DISPLACEMENT, VELOCITY, REACTION = range(3)
"""Sources of vectors of `selected_row`: x + data, v, and −data × f."""


@kernel()
def _score(select, value):
    """Number that is largest of what counts, see `refweb.results.observables.observable.SELECTIONS`."""
    return value if select == 0 else -value if select == 1 else abs(value)


@kernel()
def _counted(select, score):
    """The value of a `_score`."""
    return -score if select == 1 else score


@kernel(PROBE)
def selected_row(t, x, v, f, lines, rows, data, where):
    """Component or magnitude that counts of vectors of rows; ``rows`` is (source, select, component, row, ...)."""
    source, select, best = rows[0], rows[1], -math.inf
    for n in range(data.shape[0]):
        r = rows[3 + n]
        a, b, c = x[r, 0] + data[n, 0], x[r, 1] + data[n, 1], x[r, 2] + data[n, 2]
        if source == VELOCITY:
            a, b, c = v[r, 0], v[r, 1], v[r, 2]
        elif source == REACTION:
            a, b, c = -data[n, 0] * f[r, 0], -data[n, 1] * f[r, 1], -data[n, 2] * f[r, 2]
        score = _score(select, component_of(rows[2], a, b, c))
        if score > best:
            best, where[0] = score, r
    return _counted(select, best)


@kernel(PROBE)
def selected_contact(t, x, v, f, lines, rows, data, where):
    """Component or magnitude that counts of forces of contact on k bodies.

    ``rows`` is (select, component, k, k rows of what they feel, k rows of the bodies).
    """
    select, count, best = rows[0], rows[2], -math.inf
    for n in range(count):
        force = record_at(FELT, data, rows[3 + n], 0).force
        score = _score(select, component_of(rows[1], force[0], force[1], force[2]))
        if score > best:
            best, where[0] = score, rows[3 + count + n]
    return _counted(select, best)


@kernel(PROBE)
def selected_element(t, x, v, f, lines, rows, data, where):
    """The value that counts of data × column over elements; ``rows`` is (select, column, element, ...)."""
    select, best = rows[0], -math.inf
    for n in range(2, rows.size):
        score = _score(select, lines[rows[n], rows[1]] * data[rows[n], 0])
        if score > best:
            best, where[0] = score, rows[n]
    return _counted(select, best)


@kernel(PROBE)
def slack_fraction(t, x, v, f, lines, rows, data, where):
    """Share of elements with a strain of at most data or, where data is nan, no tension, column rows[0] of lines."""
    count = 0
    for c in range(lines.shape[0]):
        if lines[c, 1] <= data[c, 0] or math.isnan(data[c, 0]) and lines[c, rows[0]] <= 0.0:
            count += 1
    return count / lines.shape[0]


@kernel(PROBE)
def root_of_sum(t, x, v, f, lines, rows, data, where):
    """Root of the sum of the column ``rows[0]`` of what lines show."""
    return math.sqrt(sum_of(lines[:, rows[0]]))


@kernel(PROBE)
def deepest(t, x, v, f, lines, rows, data, where):
    """Largest value of data, one column, over rows (first, last + 1); ``where[0]`` counts from ``first``.

    Eight independent maxima take a ninth of the time of one.
    """
    values = data.reshape(-1)[rows[0] : rows[1]]
    a = b = c = d = e = g = h = i = 0.0
    eights = values.size // 8 * 8
    for n in range(0, eights, 8):
        a, b = _larger(a, values[n]), _larger(b, values[n + 1])
        c, d = _larger(c, values[n + 2]), _larger(d, values[n + 3])
        e, g = _larger(e, values[n + 4]), _larger(g, values[n + 5])
        h, i = _larger(h, values[n + 6]), _larger(i, values[n + 7])
    for n in range(eights, values.size):
        a = _larger(a, values[n])
    best = _larger(_larger(_larger(a, b), _larger(c, d)), _larger(_larger(e, g), _larger(h, i)))
    if where[1] == PLACE:
        where[0] = -1
        for n in range(values.size if best > 0.0 else 0):
            if values[n] == best:
                where[0] = n
                break
    return best


@kernel(PROBE)
def surface_speed(t, x, v, f, lines, rows, data, where):
    """Largest possible speed of a point of a body; ``rows`` are those of its position and rotation, or −1.

    data is the largest distance of its points from the position, times the factor from the row of rotation to the
    largest angular velocity.
    """
    best = 0.0
    for n in range(data.shape[0]):
        row, spin = rows[2 * n], rows[2 * n + 1]
        speed = math.sqrt(v[row, 0] ** 2 + v[row, 1] ** 2 + v[row, 2] ** 2)
        if spin >= 0:
            speed += data[n, 0] * math.sqrt(v[spin, 0] ** 2 + v[spin, 1] ** 2 + v[spin, 2] ** 2)
        best = max(best, speed)
    return best


WITHOUT_LINES = (
    displacement, velocity, reaction, contact_force, contact_depth, selected_row, selected_contact, deepest,
    surface_speed,
)  # fmt: skip
"""Kernels of probes that do not read what lines show."""
