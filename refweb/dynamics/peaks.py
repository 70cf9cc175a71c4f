"""Largest values of a run that are reached more than once, within their ±, and the derivatives of each.

A largest value of a motion is that of a peak in time, or of an end. Peaks that ± does not tell apart have a derivative
each. Where they are equal, the result has the largest of them for a number that rises, and the least for one that
falls, as lines that share a largest value; where they are not, ± covers all.

May change: the insides of functions, if answers stay. Must stay: `Peaks.step` is called with the value at each step in
turn, and `end` after the last; fields of `Peak`, which `linear_run` fills, and of `Pool`: `gradients` reads both.
`TIED` and `KINK` are those of `responses`. Must stay as well: `kept` and `pooled`, which `gradients` imports. Tests:
``tests/dynamics/test_dynamic_gradients.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .responses import KINK, TIED, Slopes


class Peak(NamedTuple):
    """A peak in time: its time [s], value, and `Slopes`."""

    time: float
    value: float
    slopes: Slopes


class Peaks:
    """Times of local peaks of a value that is followed by steps: of those that reach a level.

    Parameters
    ----------
    sign : float
        1 for largest values, −1 for smallest.
    level : float
        Value that counts [unit of the value].
    """

    def __init__(self, sign, level):
        self._sign, self._level, self._last = sign, sign * level, []

    def step(self, t, value):
        """Take the value at the next time; return the time of a peak in the last two steps, else None."""
        self._last = [*self._last[-2:], (t, self._sign * value)]
        if len(self._last) == 2:
            (t0, s0), (_, s1) = self._last
            return t0 if s0 > s1 and s0 >= self._level else None
        if len(self._last) < 3:
            return None
        (t0, s0), (t1, s1), (t2, s2) = self._last
        if not s0 <= s1 > s2:
            return None
        before, behind = (s1 - s0) / (t1 - t0), (s2 - s1) / (t2 - t1)
        bend = (behind - before) / (t2 - t0)
        slope = before + bend * (t1 - t0)
        return t1 - 0.5 * slope / bend if s1 - 0.25 * slope**2 / bend >= self._level else None

    def end(self):
        """Time of the end where the value has a peak there, else None."""
        (_, s0), (t, s) = self._last[-2:]
        return t if s > s0 and s >= self._level else None


class Pool(NamedTuple):
    """Derivatives of peaks that ± does not tell apart, each of shape (numbers,) but the last.

    Attributes
    ----------
    value, left : ndarray
        For numbers that rise and that fall, of the peaks that are equal.
    low, high : ndarray
        Range of those of all peaks.
    at : int
        The peak that counts.
    """

    value: np.ndarray
    left: np.ndarray
    low: np.ndarray
    high: np.ndarray
    at: int


def pooled(peaks, time, sign):
    """The `Pool` of peaks, of which the one nearest to a time counts; ``sign`` as of `Peaks`."""
    at = int(np.argmin([abs(peak.time - time) for peak in peaks]))
    right, left, spread = np.array([peak.slopes for peak in peaks]).swapaxes(0, 1)
    low, high = (np.minimum(right, left) - spread).min(axis=0), (np.maximum(right, left) + spread).max(axis=0)
    tied = [abs(peak.value - peaks[at].value) <= TIED * abs(peaks[at].value) for peak in peaks]
    if sign < 0.0:
        return Pool(right[tied].min(axis=0), left[tied].max(axis=0), low, high, at)
    return Pool(right[tied].max(axis=0), left[tied].min(axis=0), low, high, at)


def kept(peaks, value, sizes):
    """Ranges of the derivatives at times at which the largest ``value`` is kept, shape (2, 2, numbers).

    They are for numbers that rise and that fall, the least and the largest. A time counts for a number of which a
    change by `KINK` of its size makes up for the difference of values.
    """
    ranges = np.tile(np.array([np.inf, -np.inf])[:, None], (2, 1, len(sizes)))
    for peak in peaks:
        sides = np.array([peak.slopes.value, peak.slopes.left])
        near = abs(peak.value - value) <= KINK * sizes * np.abs(sides).max(axis=0)
        ranges[:, 0] = np.where(near, np.minimum(ranges[:, 0], sides), ranges[:, 0])
        ranges[:, 1] = np.where(near, np.maximum(ranges[:, 1], sides), ranges[:, 1])
    return ranges
