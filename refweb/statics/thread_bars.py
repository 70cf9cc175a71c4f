"""Bars of a net with threads: those of its lines, and a bar for each segment of a thread, which share one tension.

May change: how arrays are computed, and `SHIFT`, above rounding, as any correction proves a bound. Must stay: names and
meaning of the methods and attributes of `bars.Bars`, in place of which `duality_bound` uses it; bars of lines stand
first, then segments, thread by thread from ``first``. Must follow a change of `Bars`. Must stay as well: `ThreadBars`,
which `duality_bound` imports. Tests: ``tests/effects/test_thread.py``.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, vstack

from ..system.factorization import Factor
from .bars import Bars

SHIFT = 1e-12
"""Prestress of the tangent [1] over the largest axial stiffness, so that it has an inverse."""


class ThreadBars(Bars):
    """State of the bars of lines and, behind them, of segments of threads at a displacement.

    Parameters
    ----------
    net : refweb.net.net.Net
        The net; its threads have the law of tension alone and run over no bodies.
    x : ndarray, shape (rows, 3)
        The displacement [m].

    Attributes
    ----------
    first : ndarray of int, shape (threads,)
        First segment of each thread.
    """

    def __init__(self, net, x):
        super().__init__(net, x)
        threads = net.threads
        count = np.array([len(thread.distances) for thread in threads])
        self._behind, self.first = len(self.natural), np.cumsum(count) - count
        self._of = np.repeat(np.arange(len(count)), count)
        rows = np.concatenate([thread.segments for thread in threads])
        of_segments = np.tile([-1.0, 1.0], len(rows)), rows.ravel(), 2 * np.arange(len(rows) + 1)
        self.matrix = vstack([self.matrix, csr_array(of_segments, shape=(len(rows), len(net.points)))], "csr")
        moved = x[rows[:, 1]] - x[rows[:, 0]]
        vector = np.concatenate([thread.vectors for thread in threads]) + moved
        length = np.linalg.norm(vector, axis=1)
        distance = np.concatenate([thread.distances for thread in threads])
        square = ((vector + vector - moved) * moved).sum(axis=1)  # digits of a small displacement
        longer = square / np.where(length + distance > 0.0, length + distance, 1.0)
        lines = [thread.line for thread in threads]
        natural = np.array([thread.natural_length for thread in threads])
        self._natural = natural * (1.0 + np.array([line.slackness[0] for line in lines]))
        self._axial = np.array([line.axial[0] for line in lines]) / natural
        offset = np.array([float(line.line_data.distance[0]) for line in lines]) - self._natural
        self._beyond = np.add.reduceat(longer, self.first) + offset
        self._tension = self._axial * np.maximum(self._beyond, 0.0)
        self.tangent = np.append(self.tangent, 0.0 * length)
        self.natural = np.append(self.natural, np.where(distance > 0.0, distance, natural[self._of]))
        self.unstressed = np.append(self.unstressed, length)
        self.stiffness = np.append(self.stiffness, self._axial[self._of])
        self.length, self.tension = np.append(self.length, length), np.append(self.tension, self._tension[self._of])
        self.direction = np.vstack([self.direction, vector / np.where(length > 0.0, length, 1.0)[:, None]])

    @property
    def energy(self):
        """Strain energy of each bar [J], shape (bars,): that of a thread at its first segment."""
        energy = super().energy
        energy[self._behind :] = 0.0
        energy[self._behind + self.first] = 0.5 * self._tension**2 / self._axial
        return energy

    def shared(self, stretch):
        """Change of force along the bars [N] by stretches of all segments of their threads [m], shape (bars, 3)."""
        change = np.zeros_like(self.direction)
        rate = np.where(self._tension > 0.0, self._axial, 0.0) * np.add.reduceat(stretch[self._behind :], self.first)
        change[self._behind :] = rate[self._of, None] * self.direction[self._behind :]
        return change

    def stretched(self, parts, size):
        """Parts of the bars in the duality gap along themselves [J], for forces of that ``size`` [N]."""
        size = size[self._behind :]
        largest = np.maximum.reduceat(size, self.first)
        parts[self._behind :] = (largest[self._of] - size) * self.length[self._behind :]
        strained = (self._tension - largest) ** 2 / (2.0 * self._axial)
        parts[self._behind + self.first] += strained + largest * np.maximum(-self._beyond, 0.0)
        return parts

    def factor(self, system, equilibrium):
        """The `refweb.system.factorization.Factor` of the tangent of an equilibrium."""
        factor = Factor(system.pattern)
        shift = SHIFT * max(self.stiffness.max() * self.natural.max(), 1.0)
        values = system.stiffness(equilibrium.step, equilibrium.x, np.zeros_like(equilibrium.x), definite=True)
        factor.update(values + shift * system.across_lines(np.ones(len(system.net.cells))), shift)
        equilibrium.stats["nlu"] = equilibrium.stats.get("nlu", 0) + 1
        return factor
