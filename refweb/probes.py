"""Compiled probes: what an explicit loop looks at in every step, one scalar each.

A probe has the signature ``value = probe(t, x, v, f, lines, rows, data, where)``: ``lines`` holds tension and strain of
each element, ``rows`` and ``data`` the probe's own numbers; it writes the row or element it stands at to ``where[0]``.
"""

from __future__ import annotations

import math

import numpy as np
from numba import types

from .compiled import _array, kernel

_f, _i = types.float64, types.int64
PROBE = _f(_f, _array(_f, 2), _array(_f, 2), _array(_f, 2), _array(_f, 2), _array(_i, 1), _array(_f, 2), _array(_i, 1))
MAGNITUDE = 3
"""Component number of a magnitude."""


@kernel()
def component_of(a, row, component):
    """A component of a row, or its magnitude."""
    if component < MAGNITUDE:
        return a[row, component]
    return math.sqrt(a[row, 0] * a[row, 0] + a[row, 1] * a[row, 1] + a[row, 2] * a[row, 2])


@kernel()
def largest_of(a, data, rows, where):
    """Largest component, or magnitude, of ``a + data`` over some rows; ``rows`` is (component, row, row, ...)."""
    component, best, at = rows[0], -math.inf, rows[1]
    for n in range(1, rows.size):
        r = rows[n]
        if component < MAGNITUDE:
            value = a[r, component] + data[n - 1, component]
        else:
            x, y, z = a[r, 0] + data[n - 1, 0], a[r, 1] + data[n - 1, 1], a[r, 2] + data[n - 1, 2]
            value = x * x + y * y + z * z
        if value > best:
            best, at = value, r
    where[0] = at
    return best if component < MAGNITUDE else math.sqrt(best)


@kernel(PROBE)
def displacement(t, x, v, f, lines, rows, data, where):
    """Largest of x + data: displacement where data is zero, position where it is the reference."""
    return largest_of(x, data, rows, where)


@kernel(PROBE)
def velocity(t, x, v, f, lines, rows, data, where):
    """Largest of v."""
    return largest_of(v, data, rows, where)


@kernel(PROBE)
def reaction(t, x, v, f, lines, rows, data, where):
    """Component or magnitude of Σ w (g − f) over rows; data holds w and g, shape (rows, 6)."""
    where[0] = rows[1]
    total = np.zeros((1, 3))
    for n in range(1, rows.size):
        for k in range(3):
            total[0, k] += data[n - 1, k] * (data[n - 1, 3 + k] - f[rows[n], k])
    return component_of(total, 0, rows[0])


@kernel(PROBE)
def line(t, x, v, f, lines, rows, data, where):
    """Largest of data × column over elements; ``rows`` is (column, element) or (column, −1) for all."""
    column, best, at = rows[0], -math.inf, 0
    first, last = (0, lines.shape[0]) if rows[1] < 0 else (rows[1], rows[1] + 1)
    for c in range(first, last):
        value = lines[c, column] * data[c, 0]
        if value > best:
            best, at = value, c
    where[0] = at
    return best


@kernel(PROBE)
def slack_fraction(t, x, v, f, lines, rows, data, where):
    """Share of elements whose strain is at most data."""
    count = 0
    for c in range(lines.shape[0]):
        if lines[c, 1] <= data[c, 0]:
            count += 1
    return count / lines.shape[0]


INTEGERS = _array(_i, 1)
"""Type of a probe's rows."""
