"""Piecewise linear tables over time, as compiled kernels read them.

A table of rows (t, values...) stands in a row of ``data`` as: number of rows, then the rows one after another. It holds
its end values before the first and after the last time.
"""

from __future__ import annotations

from ..kernels import kernel


@kernel()
def interpolate(t, data, start, width, column):
    """(value, slope) of one column at time t; ``width`` counts the time column."""
    rows = int(data[start])
    first = start + 1
    if t < data[first]:
        return data[first + column], 0.0
    for k in range(1, rows):
        here = first + k * width
        if t < data[here]:
            before = here - width
            slope = (data[here + column] - data[before + column]) / (data[here] - data[before])
            if t - data[before] < data[here] - t:
                return data[before + column] + slope * (t - data[before]), slope
            return data[here + column] - slope * (data[here] - t), slope
    return data[first + (rows - 1) * width + column], 0.0


def flattened(table):
    """A table as the list of numbers that `interpolate` reads."""
    return [float(len(table)), *(value for row in table for value in row)]
