"""Means of values over windows that move along a run.

The mean of a value q over the window of length w that ends at t is (I(t) − I(t − w))/w, with I the integral of q. I and
q are stored at `CELLS` times of a window, evenly spaced from t = 0 on, for any steps. At other times I follows from the
cubic through I and its rate q at the ends of a cell. In a step q is a polynomial: linear if the motion is of order 2,
else of degree 4 through its values at `PARTS` equal parts. The error of this polynomial, see `open_share`, is summed
beside the integral, and ± is at least this sum over the window. A method with dense output halves steps with an error
above `SETTLED`.

Before t = w the mean is that over the time so far, I(t)/t, and the value itself at t = 0. Largest and smallest means
are those of full windows alone. They are searched at the ends of cells and at rows. If the rate of the mean, (q(t) −
q(t − w))/w, changes its sign between two of these, the cubic through means and rates is searched as well. Its
difference from the parabola through the rates is stored as correction, and ± is at least this. It shows the error by
many steps in a cell.

May change: `SETTLED`, `HALVINGS` and `PAYS`, which trade cost for ±, and `NEAR`, above rounding and far below a cell
over a run, 1/(`CELLS` · `build.MAX_WINDOWS`). Must stay: fields of `Averages` and `CELLS`, which checkpoints keep;
`measurements` and `dense_output` give values at `PARTS` + 1 places of a step, and follow a change of it; ± holds the
error of each mean. Kernels with ``apart`` are called with these arguments by `explicit_loop`, `dense_output`, `rows`
and `measurements`. Must stay as well: all names that `measurements`, `monitors` and other files import. Tests:
``tests/dynamics/test_averages.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Self

import numpy as np

from ...kernels import Integers, Matrix, Record, Vector, kernel
from .extremes import look_at

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...results.probes import Probe
    from .extremes import Extremes
    from .monitors import Observed

CELLS = 1024
"""Number of cells of a window. The mean of a sine over a whole period is off its largest value by 4e-12 of that."""
PARTS = 4
"""Number of equal parts of a step of higher order at whose ends a value is looked at: `measurements` takes quarters."""
SETTLED, HALVINGS = 1e-8, 10
"""Share of the values of a step that its integral may leave open before it is halved, and how often it may be."""
PAYS = 0.75
"""Share of what is left open that half a step may leave for another halving: at a kink it is ½, of rounding all."""
NEAR = 1e-12
"""Share of a time within which a step that ends before the end of a cell is taken to meet it."""


class Windows(Record):
    """Windows of the averages that are asked for.

    Attributes
    ----------
    slots : ndarray of int, shape (averaged,)
        Number of the probe of each.
    widths : ndarray
        Length of each window [s].
    signs : ndarray
        1 for the largest mean of all full windows, −1 for the smallest, 0 for neither.
    """

    slots: Integers
    widths: Vector
    signs: Vector

    @classmethod
    def of(cls, probes: Sequence[Probe]) -> Self:
        """Make the record of probes, of which those with a window are averaged."""
        slots = np.array([i for i, probe in enumerate(probes) if probe.average], dtype=np.int64)
        widths = np.array([float(probes[i].average) for i in slots])
        return cls(slots, widths, np.array([float(probes[i].sign) for i in slots]))


class Averages(Record):
    """State of the averages at the last inspection.

    Attributes
    ----------
    integrals, values : ndarray, shape (averaged, CELLS + 1)
        Integral, but for a constant, and value at the ends of the last cells; that of cell k, which is the first time
        of all for k = 0, stands at k modulo CELLS + 1.
    passed : ndarray of int, shape (averaged,)
        Number of the last cell that is passed.
    integral : ndarray, shape (averaged,)
        Integral at the last look, but for the same constant.
    opens : ndarray, shape (averaged, CELLS + 1)
        Sum of the errors of all steps until the ends of the last cells.
    open : ndarray, shape (averaged,)
        Sum of the errors of all steps.
    within : ndarray, shape (averaged, PARTS + 1)
        Value at the last look, then at the ends of equal parts of the step behind it.
    latest : ndarray, shape (averaged, 2)
        Mean at the end of the last cell and its rate [1/s] of it, where a window was full there.
    looked : ndarray, shape (1,)
        Time of the last look [s].
    """

    integrals: Matrix
    values: Matrix
    passed: Integers
    integral: Vector
    opens: Matrix
    open: Vector
    within: Matrix
    latest: Matrix
    looked: Vector

    @classmethod
    def at_start(cls, values: Sequence[float] | NDArray[np.float64] = ()) -> Self:
        """Make the record for values at t = 0; by default of no means."""
        count, values = len(values), np.asarray(values, dtype=float)
        kept, within = np.zeros((count, CELLS + 1)), np.zeros((count, PARTS + 1))
        kept[:, 0] = within[:, 0] = values
        passed, none = np.zeros(count, dtype=np.int64), np.zeros((count, 2))
        opens = np.zeros_like(kept), np.zeros(count)
        return cls(np.zeros_like(kept), kept, passed, np.zeros(count), *opens, within, none, np.zeros(1))


def begin_averages(windows, extremes):
    """The `Averages` of probes whose extremes are their values at t = 0; these become those of no window."""
    averages, extreme = Averages.at_start(extremes.values[windows.slots]), windows.signs != 0.0
    extremes.values[windows.slots[extreme]] = -np.inf * windows.signs[extreme]
    return averages


@kernel()
def coefficients(values, smooth):
    """Find the coefficients of the polynomial through values at the ends of a step or, if ``smooth``, of its parts."""
    if not smooth:
        return values[0], values[4] - values[0], 0.0, 0.0, 0.0
    d1, d2 = values[1] - values[0], values[2] - 2.0 * values[1] + values[0]
    d3 = values[3] - 3.0 * (values[2] - values[1]) - values[0]
    d4 = values[4] - 4.0 * (values[3] + values[1]) + 6.0 * values[2] + values[0]
    c1, c2 = d1 - d2 / 2.0 + d3 / 3.0 - d4 / 4.0, d2 / 2.0 - d3 / 2.0 + 11.0 / 24.0 * d4
    return values[0], 4.0 * c1, 16.0 * c2, 64.0 * (d3 / 6.0 - d4 / 4.0), 256.0 / 24.0 * d4


@kernel()
def open_share(values):
    """Uncertainty of the integral over a step, over the length of the step, by values at the ends of its parts.

    The fourth difference is what halving the step changes in Simpson's rule. Of a smooth value Boole's rule is better
    by the square of the step, which is what differences fall with from the second to the fourth; at a kink, where they
    do not fall, it is no better. A kink at a third of the step has no fourth difference, but a third one, as has a
    value that turns from one side to the other: there this is too large until steps are halved.
    """
    first, middle = values[0] - 2.0 * values[1] + values[2], values[1] - 2.0 * values[2] + values[3]
    last = values[2] - 2.0 * values[3] + values[4]
    second, third = max(abs(first), abs(middle), abs(last)), max(abs(middle - first), abs(last - middle))
    fourth = abs(first - 2.0 * middle + last)
    if not second > 0.0:
        return 0.0
    return max(fourth * min(fourth / second, 1.0), third * min(third / second, 1.0) ** 3) / 6.0


@kernel()
def open_mean(n, windows, averages):
    """Uncertainty of the mean at the last inspection."""
    t, passed, width = averages.looked[0], averages.passed[n], windows.widths[n]
    if passed < CELLS:
        return averages.open[n] / t if t > 0.0 else 0.0
    return (averages.open[n] - averages.opens[n, (passed + 1) % (CELLS + 1)]) / width


@kernel()
def compare(n, begin, end, mean, rate, windows, averages, extremes):
    """Take over a mean at the time ``end``, or one since that of the latest, ``begin``, that exceeds the extreme."""
    slot, sign, span = windows.slots[n], windows.signs[n], end - begin
    top, when, correction = mean, end, 0.0
    first, last = sign * span * averages.latest[n, 1], sign * span * rate
    if span > 0.0 and first > 0.0 and last < 0.0:
        rise = sign * (mean - averages.latest[n, 0])
        cubic, square = first + last - 2.0 * rise, 3.0 * rise - 2.0 * first - last
        share = first / (math.sqrt(max(square * square - 3.0 * cubic * first, 0.0)) - square)
        height = ((cubic * share + square) * share + first) * share
        if height > max(rise, 0.0):
            top, when = averages.latest[n, 0] + sign * height, begin + share * span
            correction = abs(height - 0.5 * first * first / (first - last))
    if sign * top > sign * extremes.values[slot]:
        extremes.values[slot], extremes.times[slot] = top, when
        extremes.corrections[slot] = correction + open_mean(n, windows, averages)


@kernel()
def end_cell(n, integral, value, left, windows, averages, extremes):
    """Pass the end of a cell, at which the integral is that since the last look; ``left`` is open before the step."""
    averages.passed[n] += 1
    passed, width, cell = averages.passed[n], windows.widths[n], windows.widths[n] / CELLS
    integral += averages.integral[n]
    if passed >= CELLS:
        begin = (passed + 1) % (CELLS + 1)  # that of the cell a window before
        mean, rate = (integral - averages.integrals[n, begin]) / width, (value - averages.values[n, begin]) / width
        if windows.signs[n] != 0.0:
            since = (passed - 1 if passed > CELLS else passed) * cell
            compare(n, since, passed * cell, mean, rate, windows, averages, extremes)
        averages.latest[n, 0], averages.latest[n, 1] = mean, rate
    at = passed % (CELLS + 1)
    averages.integrals[n, at], averages.values[n, at], averages.opens[n, at] = integral, value, left
    if passed % CELLS == 0:  # integrals begin anew: of a long run they would lose digits
        averages.integral[n] -= integral
        for k in range(CELLS + 1):
            averages.integrals[n, k] -= integral


@kernel()
def slide(n, now, smooth, windows, averages, extremes):
    """Slide a window to the end of a step, whose values ``within`` holds."""
    begin, cell, values = averages.looked[0], windows.widths[n] / CELLS, averages.within[n]
    h, (c0, c1, c2, c3, c4) = now - begin, coefficients(values, smooth)
    left = averages.open[n]
    if smooth:
        averages.open[n] += h * open_share(values)
    at = (averages.passed[n] + 1) * cell
    while at <= now * (1.0 + NEAR):
        s = (at - begin) / h
        integral = h * s * (c0 + s * (c1 / 2.0 + s * (c2 / 3.0 + s * (c3 / 4.0 + s * c4 / 5.0))))
        value = c0 + s * (c1 + s * (c2 + s * (c3 + s * c4)))
        end_cell(n, integral, value, left, windows, averages, extremes)
        at = (averages.passed[n] + 1) * cell
    averages.integral[n] += h * (c0 + c1 / 2.0 + c2 / 3.0 + c3 / 4.0 + c4 / 5.0)
    values[0] = values[PARTS]


@kernel()
def mean_now(n, windows, averages):
    """The mean at the last look and, of a full window, its rate [1/s] of it."""
    t, passed, width = averages.looked[0], averages.passed[n], windows.widths[n]
    if not t > 0.0:
        return averages.within[n, 0], 0.0
    if passed < CELLS:
        return averages.integral[n] / t, 0.0
    cell, low, high = width / CELLS, (passed + 1) % (CELLS + 1), (passed + 2) % (CELLS + 1)
    s, first, last = t / cell - passed, averages.values[n, low], averages.values[n, high]
    gained = averages.integrals[n, high] - averages.integrals[n, low]
    past = s * s * (3.0 - 2.0 * s) * gained + cell * s * (1.0 - s) * ((1.0 - s) * first - s * last)
    value = 6.0 * s * (1.0 - s) * gained / cell + (1.0 - s) * (1.0 - 3.0 * s) * first - s * (2.0 - 3.0 * s) * last
    return (averages.integral[n] - averages.integrals[n, low] - past) / width, (averages.within[n, 0] - value) / width


@kernel(apart=("averages",))
def write_means(row: Vector, windows: Windows, averages: Averages, extremes: Extremes) -> None:
    """Write means to a row of a history, in the places of their probes; no extreme is less than those."""
    for n in range(windows.slots.size):
        mean, rate = mean_now(n, windows, averages)
        row[1 + windows.slots[n]] = mean
        if windows.signs[n] == 0.0:
            extremes.corrections[windows.slots[n]] = open_mean(n, windows, averages)
        if windows.signs[n] != 0.0 and averages.passed[n] >= CELLS:
            begin = averages.passed[n] * windows.widths[n] / CELLS
            compare(n, begin, averages.looked[0], mean, rate, windows, averages, extremes)


@kernel(apart=("averages",))
def look_for_means(
    part: int,
    t: float,
    x: Matrix,
    v: Matrix,
    f: Matrix,
    lines: Matrix,
    where: Integers,
    observed: Observed,
    averages: Averages,
) -> None:
    """Look at all values that are averaged, at the end of a part of a step; 0 is its start."""
    slots = observed.windows.slots
    for n in range(slots.size):
        i = slots[n]
        averages.within[n, part] = look_at(i, t, x, v, f, lines, observed, where)


@kernel(apart=("averages",))
def average(
    now: float,
    x: Matrix,
    v: Matrix,
    f: Matrix,
    lines: Matrix,
    where: Integers,
    smooth: bool,
    observed: Observed,
    averages: Averages,
    extremes: Extremes,
) -> None:
    """Slide all windows to the end of a step."""
    look_for_means(PARTS, now, x, v, f, lines, where, observed, averages)
    for n in range(observed.windows.slots.size):
        slide(n, now, smooth, observed.windows, averages, extremes)
    averages.looked[0] = now
