"""Monitors on dense output: extremes, means and events of any method, by the kernels of the compiled loop.

Only the times of evaluation differ from those of the loop. The loop evaluates a peak once, at the maximum of the
parabola through the last three values, and an integral has one part for each evaluation. Dense output is as accurate
within a step as at its ends. Therefore peaks are searched by several parabolas, and steps are halved if the error of a
mean is too large.

May change: `ROUNDS` and how peaks are searched. Must stay: public methods of `Measurements`, which `step_observer`
calls; values are those of the kernels of the compiled loop: arguments follow `extremes`, `averages` and `rows`, in
their order. Tests: ``tests/dynamics/test_peaks.py``, ``test_averages.py``.
"""

from __future__ import annotations

import bisect

import numpy as np

from ...effects.base import CONTACT
from .averages import HALVINGS, PAYS, SETTLED, average, look_for_means, open_share
from .extremes import (
    EDGE,
    Extremes,
    begin_anew,
    inspect,
    look_at,
    look_at_sums,
    look_with_places,
    parabola,
    update_extreme,
)
from .monitors import Observed, begin_monitors
from .rows import write_probes

ROUNDS = 6
"""Largest number of evaluations for one peak."""


def top_of(times, heights):
    """(Time, height) of the maximum of the parabola through three points, None if it has none.

    A step of one rounding has no middle.
    """
    if not times[0] < times[1] < times[2]:
        return None
    slope, curve = parabola(tuple(times), tuple(heights))
    return (times[1] - 0.5 * slope / curve, heights[1] - 0.25 * slope * slope / curve) if curve < 0.0 else None


class Measurements:
    """Probes and, behind them, sums.

    Parameters
    ----------
    probes, sums : sequence
        See `refweb.dynamics.integrators.integrator`.
    book : refweb.dynamics.integrators.simpson_balance.SimpsonBalance
        Of the energies that sums weigh.
    """

    def __init__(self, probes, sums, book):
        self.observed, self._book = Observed.of(probes, sums, len(book.system.terms)), book
        self._of_terms = [(i, probe.term) for i, probe in enumerate(probes) if probe.term != -1]
        self._where, self._read = np.zeros(2, dtype=np.int64), None

    def _state(self, sample):
        """Arguments of a look at a sample, whose values per cell probes read from now on."""
        if sample is not self._read:
            for i, term in self._of_terms:
                self.observed.data[i] = sample.felt if term == CONTACT else sample.per_cell[term]
            self._read = sample
        return sample.time, sample.x, sample.v, sample.force, sample.per_cell.lines

    def value(self, piece, slot, sample):
        """Value of a probe or, behind them, of a sum, at a sample of a piece."""
        first = len(self.observed.probes)
        if slot >= first:
            return self.observed.sums[slot - first] @ self._book.energies_within(piece, sample)
        return look_at(int(slot), *self._state(sample), self.observed, self._where)

    def start(self, sample, energies, events):
        """Monitors at t = 0, see `refweb.dynamics.integrators.monitors.begin_monitors`."""
        extremes = Extremes.at_start(np.zeros(len(self.observed.signs)))
        look_with_places(*self._state(sample), self._where, self.observed, extremes.values, extremes.places)
        return begin_monitors(self.observed, extremes, energies, events)

    def write(self, row, sample, course):
        """Write time, probes and means to a row of a history."""
        write_probes(row, *self._state(sample), self._where, self.observed, course.averages, course.extremes)

    def inspect(self, course, piece):
        """Follow extremes and means through a piece of a step: ahead of a jump at its end, and behind that."""
        extremes, end = course.extremes, piece.end
        if piece.jump is not None:
            end = piece.at(end.time - EDGE * (end.time - piece.start.time))
        self._inspect(extremes, piece, piece.middle)
        if self._inspect(extremes, piece, end):
            self._search_tops(extremes, piece)
        if len(self.observed.windows.slots):
            self._average(course, piece, end)
        if piece.jump is not None:
            self._inspect(extremes, piece, piece.end)
            begin_anew(extremes)

    def _inspect(self, extremes, piece, sample):
        """Take the values at a sample over into the extremes; tell if any may turn back."""
        turned = inspect(*self._state(sample), self._where, self.observed, extremes, True)
        if not len(self.observed.sums):
            return turned
        return (
            look_at_sums(sample.time, self._book.energies_within(piece, sample), self.observed, extremes, True)
            or turned
        )

    def _average(self, course, piece, end):
        """Slide windows through a piece of a step that ends with the sample ``end``, ahead of a jump.

        Each part is looked at in its quarters, of which the half and the end are known samples.
        """
        begin, until = piece.start.time, end.time
        middle = piece.middle if end is piece.end else piece.at(0.5 * (begin + until))
        averages, todo = course.averages, [(begin, until, middle, end, HALVINGS, np.inf)]
        rest = self._where, self.observed, averages
        while todo:
            begin, until, middle, last, halvings, before = todo.pop()
            quarter = 0.25 * (until - begin)
            first, third = piece.at(begin + quarter), piece.at(until - quarter)
            for part, sample in enumerate((first, middle, third, last), 1):
                look_for_means(part, *self._state(sample), *rest)
            shares = map(open_share.py_func, averages.within.tolist())  # a few sums, not worth an entry of machine code
            left = np.array(list(shares))
            pays = (left > SETTLED * np.abs(averages.within).max(axis=1)) & (left < PAYS * before)
            if halvings and pays.any():
                todo += [
                    (middle.time, until, third, last, halvings - 1, left),
                    (begin, middle.time, first, middle, halvings - 1, left),
                ]
                continue
            _, *state = self._state(last)
            now = piece.end.time if last is end else until
            average(now, *state, self._where, True, self.observed, averages, course.extremes)
        if piece.jump is not None:
            look_for_means(0, *self._state(piece.end), *rest)

    def _search_tops(self, extremes, piece):
        """Look for peaks of all that may turn back, see `refweb.dynamics.integrators.extremes.turns_back`."""
        with np.errstate(invalid="ignore"):  # no step has a size ahead of the first
            first, middle, last = self.observed.signs * extremes.recent.T
            curve, highest = 2.0 * middle - first - last, np.maximum(middle, last)
            above = highest + curve > self.observed.signs * extremes.values
        for i in np.flatnonzero((last - middle < 0.75 * curve) & above).tolist():
            self._search_top(extremes, i, piece)

    def _search_top(self, extremes, i, piece):
        """Look for a peak between the last three looks, by parabolas through the highest value and its neighbours."""
        sign, times = self.observed.signs[i], extremes.looked.tolist()
        heights = (sign * extremes.recent[i]).tolist()
        shortest, best = EDGE * (times[2] - times[0]), None
        for _ in range(ROUNDS):
            highest = int(np.argmax(heights))
            n = min(max(highest, 1), len(times) - 2)
            top = top_of(times[n - 1 : n + 2], heights[n - 1 : n + 2])
            if top is None or not times[0] - 0.25 / EDGE * shortest < top[0] < times[-1] + 0.25 / EDGE * shortest:
                break
            t = min(max(top[0], times[0] + shortest), times[-1] - shortest)
            if min(abs(t - time) for time in times) < 0.5 * shortest:
                break
            sample = piece.at(t)
            value, at = float(self.value(piece, i, sample)), bisect.bisect(times, t)
            times.insert(at, t)
            heights.insert(at, sign * value)
            off = abs(top[1] - sign * value)
            if sign * value > max(heights[:at] + heights[at + 1 :]):
                best = sample, value, off
            if off <= 1e-14 * abs(value):
                break
        if best is not None and sign * best[1] > sign * extremes.values[i]:
            sample, value, off = best
            if i < len(self.observed.probes):
                update_extreme(i, value, *self._state(sample), self.observed, self._where, extremes)
            extremes.values[i], extremes.times[i], extremes.corrections[i] = value, sample.time, off
