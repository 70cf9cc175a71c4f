"""Extremes: largest or smallest values of probes and sums, at steps and between them.

If the parabola through the last three values has its extreme before the last one, the probe is evaluated there, on the
dense output between steps. Therefore a peak is a value of the motion, also for values with kinks, jumps and bounds. Its
difference from the values at steps is stored as correction. ± is at least this, since run and step refinement may agree
by chance. With steps of a higher order, the correction is the difference of the value from the parabola.

The first step of a run is evaluated inside, since there is no third value. After a jump of velocities extremes are
searched again from the third value on.

Over 30 phases, the largest error of a peak of an oscillator in central differences at ωh = 1/4 is 7.80e-3. It is
7.81e-3 with the maximum of the parabola, and the error of the amplitude at steps is 7.82e-3 itself. But the parabola
exceeds a kink by an eighth of a second difference, so that it gives negative tensions, or slack fractions above 1.

May change: nothing without the tests of peaks, since each rule here, and `EDGE`, decides values of results. Must stay:
fields of `Extremes`, which checkpoints keep; ``looked`` and ``recent`` have the last three looks, the oldest first.
Kernels are called by `explicit_loop`, `dense_output`, `measurements`, `averages` and `events`, which follow their
arguments. Must stay as well: all names that `dense_output`, `measurements` and other files import. Tests:
``tests/dynamics/test_peaks.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Self

import numpy as np

from ...kernels import Integers, Matrix, Record, Vector, inner, kernel
from ...results.probes import (
    NODES,
    OF_BLOCKS,
    PLACE,
    element_of,
    element_of_blocks,
    largest_in,
    largest_of_blocks,
    largest_square,
    row_of_square,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .monitors import Observed

EDGE = 2.0**-16
"""Share of a step at whose distance from an end it is looked at for the rate there."""


class Extremes(Record):
    """Extreme values of probes and, behind them, of sums.

    Attributes
    ----------
    values : ndarray, shape (probes + sums,)
        Extreme value of each.
    times : ndarray
        Time of each [s].
    places : ndarray of int
        Row or element that a probe's stands at.
    corrections : ndarray
        Correction of each by evaluation between steps, 0 if it was found at a step.
    recent : ndarray, shape (probes + sums, 3)
        Value of each at the last three looks since its rate may have jumped, not a number before.
    looked : ndarray, shape (3,)
        Times of these looks [s].
    """

    values: Vector
    times: Vector
    places: Integers
    corrections: Vector
    recent: Matrix
    looked: Vector

    @classmethod
    def at_start(cls, values: NDArray[np.float64], places: NDArray[np.int64] | None = None) -> Self:
        """Make the record for values at t = 0."""
        places = np.full(len(values), -1) if places is None else places
        recent = np.full((len(values), 3), np.nan)
        recent[:, 2] = values
        return cls(values, np.zeros(len(values)), places, np.zeros(len(values)), recent, np.array([np.nan, np.nan, 0]))


@kernel(leaf=True, forceinline=True)
def note_time(looked, t):
    """Note the time of a look."""
    looked[0], looked[1], looked[2] = looked[1], looked[2], t


@kernel(leaf=True, forceinline=True)
def turns_back(i, value, sign, extreme, recent, ending):
    """Note a value at a look; whether it may be that a peak above the extreme lies a little before.

    It lies about the value before where that is above its neighbours: the parabola of equal steps has no more than an
    eighth of their second difference there. Where steps are ``ending``, or have begun, it may also lie about the last
    value, or the first of three.
    """
    first, middle, last = sign * recent[i, 1], sign * recent[i, 2], sign * value
    recent[i, 0], recent[i, 1], recent[i, 2] = recent[i, 1], recent[i, 2], value
    curve = 2.0 * middle - first - last
    between = middle > first and middle > last and middle + 0.5 * curve > sign * extreme  # never of not a number
    return between or ending and last - middle < 0.75 * curve and max(middle, last) + curve > sign * extreme


@kernel()
def parabola(looked, recent):
    """Slope at the second of three times, and half of the second derivative, of the parabola through values there."""
    before, at, now = looked[0], looked[1], looked[2]
    low, high, value = recent[0], recent[1], recent[2]
    rise, fall = (high - low) / (at - before), (value - high) / (now - at)
    curve = (fall - rise) / (now - before)
    return rise + curve * (at - before), curve


@kernel()
def time_of_top(extremes, i, sign):
    """Time between the last three looks at which their parabola has a top above the extreme; not a number if none."""
    slope, curve = parabola(extremes.looked, extremes.recent[i])
    top, when = extremes.recent[i, 1] - 0.25 * slope * slope / curve, extremes.looked[1] - 0.5 * slope / curve
    above = sign * curve < 0.0 and sign * top > sign * extremes.values[i]
    return when if above and extremes.looked[0] < when < extremes.looked[2] else math.nan


@kernel()
def correction(extremes, i, sign, t, value, smooth):
    """Excess of a value between the last three inspections or, ``smooth``, its difference from their parabola."""
    recent = extremes.recent[i]
    if smooth:
        (slope, curve), late = parabola(extremes.looked, recent), t - extremes.looked[1]
        return abs(value - recent[1] - late * (slope + late * curve))
    return sign * value - max(sign * recent[0], sign * recent[1], sign * recent[2])


@kernel(leaf=True, forceinline=True)
def plain_value(i, x, lines, plain, scales, known):
    """Write the value of a plain probe, see `refweb.results.probes.plain_of`, to ``known[0]``; whether it is one.

    Displacements x are in a row. ``known`` holds behind that the probe before it of a column in this step, −1 for none,
    the largest of that, which may be of the same elements, the square of the last displacement, and the row and element
    from which the places of both are searched. ``lines`` may have blocks in place of lines, of `BLOCK_OUT`.
    """
    kind = plain[i, 0]
    if kind == NODES:
        known[3], known[4] = largest_square(x, plain[i, 1], plain[i, 2])
        known[0] = math.sqrt(known[3])
    elif kind > 0:
        j = int(known[1])
        if j < 0 or plain[i, 1] != plain[j, 1] or plain[i, 2] != plain[j, 2] or plain[i, 3] != plain[j, 3]:
            known[1] = i
            if lines.shape[1] == OF_BLOCKS:
                known[2] = largest_of_blocks(lines, plain[i, 1])
            else:
                known[2], known[5] = largest_in(lines, plain[i, 1], plain[i, 2], plain[i, 3])
        known[0] = scales[i] * known[2]
    return kind > 0


@kernel(leaf=True, forceinline=True)
def look_at(i, t, x, v, f, lines, observed, where):
    """Value of a probe, by its number."""
    rows, data = observed.rows[i], observed.data[i]
    return observed.probes[i](t, x, v, f, lines, rows, data, where)


@kernel(apart=())
def look_with_places(
    t: float,
    x: Matrix,
    v: Matrix,
    f: Matrix,
    lines: Matrix,
    where: Integers,
    observed: Observed,
    values: Vector,
    places: Integers,
) -> None:
    """Write values of all probes, and the row or element that each stands at, −1 for none."""
    for i in range(len(observed.probes)):
        where[0], where[1] = -1, PLACE
        values[i] = look_at(i, t, x, v, f, lines, observed, where)
        places[i], where[1] = where[0], 0


@kernel(leaf=True, apart=("watched",))
def update_extreme(
    i: int,
    value: float,
    t: float,
    x: Matrix,
    v: Matrix,
    f: Matrix,
    lines: Matrix,
    observed: Observed,
    where: Integers,
    extremes: Extremes,
) -> None:
    """Take over a value of a probe that exceeds its extreme, with its time and place."""
    where[1] = PLACE
    look_at(i, t, x, v, f, lines, observed, where)
    extremes.values[i], extremes.times[i], extremes.places[i], where[1] = value, t, where[0], 0
    extremes.corrections[i] = 0.0


@kernel(leaf=True, apart=("watched",))
def update_plain_extreme(
    i: int, t: float, x: Vector, lines: Matrix, known: Vector, observed: Observed, extremes: Extremes
) -> None:
    """Take over what `plain_value` has written, with its time and place: while a web deepens, that is each step."""
    plain = observed.plain
    extremes.values[i], extremes.times[i], extremes.corrections[i] = known[0], t, 0.0
    if plain[i, 0] == NODES:
        extremes.places[i] = row_of_square(x, int(known[4]), plain[i, 2], known[3])
    elif lines.shape[1] == OF_BLOCKS:
        extremes.places[i] = element_of_blocks(lines, plain[i, 1], observed.scales[i], known[0])
    else:
        extremes.places[i] = element_of(lines, plain[i, 1], int(known[5]), plain[i, 3], observed.scales[i], known[0])


@kernel(leaf=True, forceinline=True)
def take_over(simple, i, t, x, v, f, lines, known, observed, where, extremes):
    """Take over the value ``known[0]`` of a probe, which `plain_value` has written if it is ``simple``."""
    if simple:
        update_plain_extreme(i, t, x.reshape(-1), lines, known, observed, extremes)
    else:
        update_extreme(i, known[0], t, x, v, f, lines, observed, where, extremes)


@kernel(leaf=True, forceinline=True)
def follow(t, ending, x, v, f, lines, known, where, observed, extremes):
    """Inspect all probes that are followed as `inspect` does, simple ones without a call."""
    plain, scales, signs, values = observed.plain, observed.scales, observed.signs, extremes.values
    turned, known[1] = False, -1.0
    note_time(extremes.looked, t)
    for i in observed.followed:
        simple = plain_value(i, x.reshape(-1), lines, plain, scales, known)
        if not simple:
            known[0] = look_at(i, t, x, v, f, lines, observed, where)
        turned = turns_back(i, known[0], signs[i], values[i], extremes.recent, ending) or turned
        if signs[i] * known[0] > signs[i] * values[i]:
            take_over(simple, i, t, x, v, f, lines, known, observed, where, extremes)
    return turned


@kernel(leaf=True, apart=("looks",))
def inspect(
    t: float,
    x: Matrix,
    v: Matrix,
    f: Matrix,
    lines: Matrix,
    where: Integers,
    observed: Observed,
    extremes: Extremes,
    ending: bool,
) -> bool:
    """Look at all probes that are followed, and take over what exceeds its extreme; whether any may turn back."""
    signs, turned = observed.signs, False
    note_time(extremes.looked, t)
    for i in observed.followed:
        value = look_at(i, t, x, v, f, lines, observed, where)
        turned = turns_back(i, value, signs[i], extremes.values[i], extremes.recent, ending) or turned
        if signs[i] * value > signs[i] * extremes.values[i]:
            update_extreme(i, value, t, x, v, f, lines, observed, where, extremes)
    return turned


@kernel(apart=("books",))
def look_at_sums(t: float, total: Vector, observed: Observed, extremes: Extremes, ending: bool) -> bool:
    """Inspect sums of the energies ``total`` as `inspect` does; the time is recorded before."""
    first, signs, turned = len(observed.probes), observed.signs, False
    for i in range(first, signs.size):
        value = inner(observed.sums[i - first], total)
        turned = turns_back(i, value, signs[i], extremes.values[i], extremes.recent, ending) or turned
        if signs[i] * value > signs[i] * extremes.values[i]:
            extremes.values[i], extremes.times[i], extremes.corrections[i] = value, t, 0.0
    return turned


@kernel()
def begin_anew(extremes):
    """Forget all values but the last: rates may have jumped there."""
    extremes.looked[:2] = np.nan
    extremes.recent[:, :2] = np.nan


@kernel()
def correct_within(extremes, signs):
    """Find an extreme between the last two inspections, and keep its excess over both as correction."""
    for i in range(signs.size):
        if extremes.looked[1] < extremes.times[i] < extremes.looked[2]:
            best = max(signs[i] * extremes.recent[i, 1], signs[i] * extremes.recent[i, 2])
            extremes.corrections[i] = signs[i] * extremes.values[i] - best
