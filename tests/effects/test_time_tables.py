"""Tables of time: their values, and that a long one costs no more than its logarithm."""

import math

import numpy as np
import pytest

from refweb.dynamics.integrators.explicit_loop import end_of_steps
from refweb.dynamics.integrators.integrator import SAME
from refweb.effects.time_tables import flattened, interpolate


class Counted:
    """Numbers that count how often one of them is read."""

    def __init__(self, numbers):
        self.numbers, self.reads, self.size = numbers, 0, len(numbers)

    def __getitem__(self, at):
        self.reads += 1
        return self.numbers[at]


@pytest.mark.parametrize("rows", [1, 2, 3, 8, 101])
def test_values_are_those_of_numpy(rows):
    """At corners, between them and outside, in each column; slopes are those of the piece that begins."""
    random = np.random.default_rng(rows)
    times = np.cumsum(random.uniform(1e-3, 1.0, rows))
    table = np.column_stack([times, random.normal(size=(rows, 2))])
    data = np.array([7.0, *flattened(table)])
    for t in (*times, *random.uniform(times[0] - 1.0, times[-1] + 1.0, 50)):
        piece = np.searchsorted(times, t, side="right")
        for column in (1, 2):
            value, slope = interpolate(t, data, 1, 3, column)
            assert value == pytest.approx(np.interp(t, times, table[:, column]), rel=1e-13, abs=1e-13)
            inside = 0 < piece < rows
            steep = (
                np.diff(table[piece - 1 : piece + 1, column])[0] / np.diff(times[piece - 1 : piece + 1])[0]
                if inside
                else 0.0
            )
            assert slope == pytest.approx(steep, rel=1e-12)


@pytest.mark.slow
def test_a_long_table_is_not_walked_through():
    """Reads of a table of 100 000 rows, wherever the time is: two ends, a bisection, a piece."""
    rows = 100_000
    data = np.array(flattened([(float(n), n % 2) for n in range(rows)]))
    for t in (0.5, 0.3 * rows, rows - 1.5):
        counted = Counted(data)
        assert interpolate.py_func(t, counted, 0, 2, 1)[0] == pytest.approx(np.interp(t, data[1::2], data[2::2]))
        assert counted.reads <= math.ceil(math.log2(rows)) + 16


def test_the_next_corner_is_not_walked_to():
    """Corners ahead of a time, not beyond a row; either is met within rounding."""
    corners = np.cumsum(np.random.default_rng(0).uniform(0.5, 1.5, 100_000))
    for n in (0, 1, 50_000, len(corners) - 2):
        counted = Counted(corners)
        at, ahead = corners[n] * (1.0 - 0.5 * SAME), corners[n + 1]
        assert end_of_steps.py_func(counted, at, 1e9) == ahead
        assert counted.reads <= math.ceil(math.log2(corners.size)) + 3
        assert end_of_steps(corners, at, ahead * (1.0 + 0.5 * SAME)) == ahead * (1.0 + 0.5 * SAME)
    assert end_of_steps(corners, corners[-1], 1e9) == 1e9 and end_of_steps(corners[:0], 0.0, 1.0) == 1.0
