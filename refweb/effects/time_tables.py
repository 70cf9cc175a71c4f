"""Piecewise linear tables over time, for compiled kernels.

A table of rows (t, values...) is stored in a row of ``data``: the number of rows, then the rows one after another. Its
values are constant before the first and after the last time.

May change: how a row is searched. Must stay: the layout of a table in ``data`` (number of rows, then rows), which
`flattened` writes, kernels of seven files read and `dynamics.commands` writes over; end values held. A force gives its
times to `Timing`, so that implicit steps end there; `system.material_flow` interpolates the same tables by numpy. Must
stay as well: `integrate`, which `outer_load` imports; `interpolate`, which `axle`, `mass_flow` and other files import.
Tests: ``tests/effects/test_time_tables.py``.
"""

from __future__ import annotations

from ..kernels import kernel


@kernel()
def interpolate(t, data, start, width, column):
    """(value, slope) of one column at time t, by bisection; ``width`` counts the time column."""
    before = start + 1
    row_begin = before + (int(data[start]) - 1) * width
    if t < data[before]:
        return data[before + column], 0.0
    if not t < data[row_begin]:
        return data[row_begin + column], 0.0
    while row_begin - before > width:
        middle = before + (row_begin - before) // width // 2 * width
        if t < data[middle]:
            row_begin = middle
        else:
            before = middle
    slope = (data[row_begin + column] - data[before + column]) / (data[row_begin] - data[before])
    if t - data[before] < data[row_begin] - t:
        return data[before + column] + slope * (t - data[before]), slope
    return data[row_begin + column] - slope * (data[row_begin] - t), slope


@kernel()
def integrate(t, data, start, width, column):
    """∫ of one column from the first time of the table to t, exact for the values of `interpolate`."""
    rows, first, total = int(data[start]), start + 1, 0.0
    if t < data[first]:
        return data[first + column] * (t - data[first])
    for k in range(1, rows):
        row_begin = first + k * width
        before = row_begin - width
        if t < data[row_begin]:
            value, _ = interpolate(t, data, start, width, column)
            return total + 0.5 * (data[before + column] + value) * (t - data[before])
        total += 0.5 * (data[before + column] + data[row_begin + column]) * (data[row_begin] - data[before])
    last = first + (rows - 1) * width
    return total + data[last + column] * (t - data[last])


def flattened(table):
    """A table as a list of numbers, in the format of `interpolate`."""
    return [float(len(table)), *(value for row in table for value in row)]
