"""Piecewise linear tables over time, as compiled kernels read them.

A table of rows (t, values...) stands in a row of ``data`` as: number of rows, then the rows one after another. It holds
its end values before the first and after the last time. The factor of a load is the constant and the slope that it has
without a table, then its table.
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


@kernel()
def factor_at(t, data, start):
    """A factor at time t, from the numbers that `factor` made."""
    if data[start + 2] > 0.0:
        return interpolate(t, data, start + 2, 2, 1)[0]
    return data[start] + data[start + 1] * t


def flattened(table):
    """A table as the list of numbers that `interpolate` reads."""
    return [float(len(table)), *(value for row in table for value in row)]


def factor(table, quasi_static):
    """The factor of a load as the list of numbers that `factor_at` reads.

    Parameters
    ----------
    table : sequence of (t, factor) or None
        Linear in between, end values held; None for 1, in statics for the load step.
    quasi_static : bool
        True in statics.
    """
    return [0.0, 1.0, *flattened(table or ())] if quasi_static else [1.0, 0.0, *flattened(table or ())]


def largest(table):
    """Largest size of the factor of a load, 1 without a table."""
    return max((abs(factor) for _, factor in table or ()), default=1.0)
