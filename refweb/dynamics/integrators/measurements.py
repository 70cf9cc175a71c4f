"""Measurements of a run: its probes and sums, their values at a sample, and their extremes over all samples."""

from __future__ import annotations

import bisect
from typing import NamedTuple

import numpy as np

from ...results.probes import PLACE
from .averages import HALVINGS, PARTS, PAYS, SETTLED, Windows, begin_averages, open_share, slide, write_means
from .extremes import EDGE, Extremes, note_time, turns_back

ROUNDS = 6
"""Largest number of looks at one peak."""


class Top(NamedTuple):
    """The highest point of a parabola."""

    time: float
    height: float


def top_of(times, heights):
    """The `Top` of the parabola through three points, None where it has none; a step of one rounding has no middle."""
    (before, at, now), (low, high, value) = times, heights
    if not before < at < now:
        return None
    rise, fall = (high - low) / (at - before), (value - high) / (now - at)
    curve = (fall - rise) / (now - before)
    slope = rise + curve * (at - before)
    return Top(at - 0.5 * slope / curve, high - 0.25 * slope * slope / curve) if curve < 0.0 else None


class Measurements:
    """Probes and, behind them, sums.

    Parameters
    ----------
    probes : sequence of refweb.results.probes.Probe
        Scalars of the state.
    sums : sequence of refweb.dynamics.integrators.integrator.Sum
        Weighted sums of ``terms`` energies, kinetic energy, work and step size.
    terms : int
        Number of terms of the system.

    Attributes
    ----------
    probed : int
        Number of probes.
    terms : list of int
        Numbers of the terms of whose cells probes read what they show, see `refweb.results.probes.Probe`.
    """

    def __init__(self, probes, sums, terms):
        self.probed = len(probes)
        self._probes = [
            (p.kernel, np.array(p.rows, dtype=np.int64), np.ascontiguousarray(p.data, dtype=float), p.term)
            for p in probes
        ]
        self.terms = sorted({probe.term for probe in probes} - {-1})
        self._weights = np.array([quantity.weights for quantity in sums], dtype=float).reshape(len(sums), terms + 3)
        self._signs = np.array([float(quantity.sign) for quantity in (*probes, *sums)])
        self._windows = Windows.of(probes)
        self._signs[self._windows.slots] = 0.0
        self._followed = np.flatnonzero(self._signs[: self.probed])
        self._where = np.zeros(2, dtype=np.int64)

    def probe(self, i, sample):
        """Value of a probe at a `refweb.dynamics.integrators.simpson_balance.Sample`."""
        kernel, rows, data, term = self._probes[i]
        data = sample.per_cell.get(term, data)
        return kernel(sample.time, sample.x, sample.v, sample.force, sample.lines, rows, data, self._where)

    def _position_of(self, i, sample):
        """Row or element that the value of a probe stands at."""
        self._where[1] = PLACE
        self.probe(i, sample)
        self._where[1] = 0
        return self._where[0]

    def probes(self, sample):
        """Value of each probe at a sample."""
        return [self.probe(i, sample) for i in range(self.probed)]

    def value(self, slot, sample, energies):
        """Value of a probe or, behind them, of a sum; ``energies(sample)`` is what sums weigh."""
        return self.probe(slot, sample) if slot < self.probed else self._weights[slot - self.probed] @ energies(sample)

    def at_start(self, sample, energies):
        """The `Extremes` at t = 0, where no step has been taken, the `Averages` and the values there."""
        places = [self._position_of(i, sample) for i in range(self.probed)]
        values = np.array([*self.probes(sample), *(self._weights @ energies)])
        extremes = Extremes.at_start(values.copy(), np.array([*places, *[-1] * len(self._weights)], dtype=np.int64))
        averages = begin_averages(self._windows, extremes)
        stepping = self.probed + np.flatnonzero(self._weights[:, -1])
        extremes.values[stepping] = extremes.recent[stepping, 2] = -np.inf * self._signs[stepping]
        return extremes, averages, values

    def inspect(self, extremes, sample, energies):
        """Take the values at a sample over into the extremes; numbers of what may turn back.

        ``energies(sample)`` is what sums weigh.
        """
        note_time(extremes.looked, sample.time)
        values: dict = {i: self.probe(i, sample) for i in self._followed}
        if len(self._weights):
            values |= enumerate(self._weights @ energies(sample), self.probed)
        turned = []
        for i, value in values.items():
            if turns_back(i, value, self._signs[i], extremes.values[i], extremes.recent, True):
                turned.append(i)
            self._take_over(extremes, i, value, sample)
        return turned

    def follow(self, extremes, middle, end, sample_at, energies):
        """Look at a piece of a step: at its middle, its end and, by ``sample_at(time)``, where values turn back."""
        self.inspect(extremes, middle, energies)
        for i in self.inspect(extremes, end, energies):
            self._search_top(extremes, i, lambda t: (s := sample_at(t), self.value(i, s, energies)))  # noqa: B023

    def average(self, course, piece, end, sample_at):
        """Slide windows through a piece of a step that ends with the sample ``end``, ahead of a jump."""
        averages, slots = course.averages, self._windows.slots
        if not len(slots):
            return
        todo = [(piece.begin, end.time, end, HALVINGS, np.inf)]
        while todo:
            begin, until, last, halvings, before = todo.pop()
            inside = [sample_at(begin + (until - begin) * part / PARTS) for part in range(1, PARTS)]
            for part, sample in enumerate((*inside, last), 1):
                averages.within[:, part] = [self.probe(i, sample) for i in slots]
            left = np.array([open_share(w) for w in averages.within])
            pays = (left > SETTLED * np.abs(averages.within).max(axis=1)) & (left < PAYS * before)
            if halvings and pays.any():
                middle = inside[PARTS // 2 - 1]
                todo += [
                    (middle.time, until, last, halvings - 1, left),
                    (begin, middle.time, middle, halvings - 1, left),
                ]
                continue
            now = piece.end.time if last is end else until
            for n in range(len(slots)):
                slide(n, now, True, self._windows, averages, course.extremes)
            averages.looked[0] = now
        if piece.jump:
            averages.within[:, 0] = [self.probe(i, piece.end) for i in slots]

    def write_means(self, row, course):
        """Write means to a row of a history, in the places of their probes."""
        if len(self._windows.slots):
            write_means(row, self._windows, course.averages, course.extremes)

    def _take_over(self, extremes, i, value, sample, correction=0.0):
        """Note a value that is more extreme than all before."""
        if self._signs[i] * value > self._signs[i] * extremes.values[i]:
            extremes.values[i], extremes.times[i], extremes.corrections[i] = value, sample.time, correction
            if i < self.probed:
                extremes.places[i] = self._position_of(i, sample)

    def _search_top(self, extremes, i, look_at):
        """Look for a peak between the last three looks, by parabolas through the highest value and its neighbours."""
        sign, times, heights = self._signs[i], extremes.looked.tolist(), (self._signs[i] * extremes.recent[i]).tolist()
        shortest, best = EDGE * (times[2] - times[0]), None
        for _ in range(ROUNDS):
            highest = int(np.argmax(heights))
            n = min(max(highest, 1), len(times) - 2)
            top = top_of(times[n - 1 : n + 2], heights[n - 1 : n + 2])
            if top is None or not times[0] - 0.25 / EDGE * shortest < top.time < times[-1] + 0.25 / EDGE * shortest:
                break
            t = min(max(top.time, times[0] + shortest), times[-1] - shortest)
            if min(abs(t - time) for time in times) < 0.5 * shortest:
                break
            sample, value = look_at(t)
            at = bisect.bisect(times, t)
            times.insert(at, t)
            heights.insert(at, sign * value)
            if sign * value > max(heights[:at] + heights[at + 1 :]):
                best = sample, value, abs(top.height - sign * value)
            if abs(top.height - sign * value) <= 1e-14 * abs(value):
                break
        if best is not None:
            sample, value, off = best
            self._take_over(extremes, i, value, sample, off)
