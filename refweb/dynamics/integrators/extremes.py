"""Extremes: the largest or smallest value of what is looked at, over all steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernels import kernel
from ...results.probes import PLACE


class Extremes(NamedTuple):
    """Extreme values of probes and, behind them, of sums.

    Attributes
    ----------
    values : ndarray, shape (probes + sums,)
        Extreme value of each.
    times : ndarray
        Time of each [s].
    places : ndarray of int
        Row or element that a probe's stands at.
    recent : ndarray, shape (probes + sums, 4)
        Time and value of each when it was last looked at, twice: the tops of parabolas count as well.
    """

    values: np.ndarray
    times: np.ndarray
    places: np.ndarray
    recent: np.ndarray

    @classmethod
    def at_start(cls, values, places):
        """Those of the values at t = 0."""
        recent = np.full((len(values), 4), np.nan)
        recent[:, 2], recent[:, 3] = 0.0, values
        return cls(values, np.zeros(len(values)), places, recent)


@kernel()
def quadratic_peak(extremes, i, now, value, sign):
    """Take the top of the parabola through the last three values of a probe, where it has one between them."""
    recent = extremes.recent
    before, low, at, high = recent[i, 0], recent[i, 1], recent[i, 2], recent[i, 3]
    if sign * high > sign * low and sign * high > sign * value:  # never of what is not a number yet
        rise, fall = (high - low) / (at - before), (value - high) / (now - at)
        curve = (fall - rise) / (now - before)
        slope = rise + curve * (at - before)
        top = high - 0.25 * slope * slope / curve
        if sign * top > sign * extremes.values[i]:
            extremes.values[i], extremes.times[i] = top, at - 0.5 * slope / curve
    recent[i, 0], recent[i, 1], recent[i, 2], recent[i, 3] = at, high, now, value


@kernel()
def take_over(i, value, t, x, v, f, lines, where, probe, rows, data, extremes):
    """Take over a value of a probe that exceeds its extreme, with its time and place."""
    where[1] = PLACE
    probe(t, x, v, f, lines, rows, data, where)
    extremes.values[i], extremes.times[i], extremes.places[i], where[1] = value, t, where[0], 0


@kernel()
def look(t, x, v, f, lines, long, where, probes, rows, data, signs, followed, extremes):
    """Look at all that is followed, and take over what exceeds its extreme; after ``long`` steps parabolas as well."""
    for i in followed:
        value = probes[i](t, x, v, f, lines, rows[i], data[i], where)
        if signs[i] * value > signs[i] * extremes.values[i]:
            take_over(i, value, t, x, v, f, lines, where, probes[i], rows[i], data[i], extremes)
        if long:
            quadratic_peak(extremes, i, t, value, signs[i])


@kernel(forceinline=True)
def look_at_sums(t, long, sums, total, first, signs, extremes):
    """As `look`, at sums of the energies ``total``; their numbers follow from ``first``."""
    for j in range(sums.shape[0]):
        value, i = np.dot(sums[j], total), first + j
        if signs[i] * value > signs[i] * extremes.values[i]:
            extremes.values[i], extremes.times[i] = value, t
        if long:
            quadratic_peak(extremes, i, t, value, signs[i])
