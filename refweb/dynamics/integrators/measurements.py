"""What a run is looked at with: its probes and sums, their values at a sample, and their extremes over all samples."""

from __future__ import annotations

import numpy as np

from ...results.probes import PLACE
from .extremes import Extremes, quadratic_peak


class Measurements:
    """Probes and, behind them, sums.

    Parameters
    ----------
    probes : sequence of refweb.results.probes.Probe
        Scalars of the state.
    sums : sequence of refweb.dynamics.integrators.integrator.Sum
        Weighted sums of ``families`` energies, kinetic energy, work and step size.
    families : int
        Number of families of the system.

    Attributes
    ----------
    probed : int
        Number of probes.
    """

    def __init__(self, probes, sums, families):
        self.probed = len(probes)
        self._probes = [
            (probe.kernel, np.array(probe.rows, dtype=np.int64), np.ascontiguousarray(probe.data, dtype=float))
            for probe in probes
        ]
        self._weights = np.array([one.weights for one in sums], dtype=float).reshape(len(sums), families + 3)
        self._signs = np.array([float(one.sign) for one in (*probes, *sums)])
        self._followed = np.flatnonzero(self._signs[: self.probed])
        self._where = np.zeros(2, dtype=np.int64)

    def probe(self, i, sample):
        """Value of a probe at a `refweb.dynamics.integrators.simpson_book.Sample`."""
        kernel, rows, data = self._probes[i]
        return kernel(sample.time, sample.x, sample.v, sample.force, sample.lines, rows, data, self._where)

    def _place(self, i, sample):
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
        """The `Extremes` at t = 0, where no step has been taken, and the values there."""
        places = [self._place(i, sample) for i in range(self.probed)]
        values = np.array([*self.probes(sample), *(self._weights @ energies)])
        extremes = Extremes.at_start(values.copy(), np.array([*places, *[-1] * len(self._weights)], dtype=np.int64))
        stepping = self.probed + np.flatnonzero(self._weights[:, -1])
        extremes.values[stepping] = extremes.recent[stepping, 3] = -np.inf * self._signs[stepping]
        return extremes, values

    def follow(self, extremes, sample, energies):
        """Take the values at a sample over into the extremes; ``energies(sample)`` is what sums weigh."""
        for i in self._followed:
            if self._beats(extremes, i, value := self.probe(i, sample), sample.time):
                extremes.places[i] = self._place(i, sample)
            quadratic_peak(extremes, i, sample.time, value, self._signs[i])
        if len(self._weights):
            for i, value in enumerate(self._weights @ energies(sample), self.probed):
                self._beats(extremes, i, value, sample.time)
                quadratic_peak(extremes, i, sample.time, value, self._signs[i])

    def _beats(self, extremes, i, value, t):
        """Note a value that is more extreme than all before; whether it is."""
        if not self._signs[i] * value > self._signs[i] * extremes.values[i]:
            return False
        extremes.values[i], extremes.times[i] = value, t
        return True
