"""Tension, stress, strain and length of a thread."""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...kernels import kernel
from ...messages import nearest, quote
from ..probes import PROBE, Probe
from .observable import ANY, NOT_NEGATIVE, ROUNDING, Observable, Value

UNITS = {"tension": "N", "stress": "Pa", "strain": "1", "length": "m"}
"""Quantities of a thread in the order of what its force observes, and their units."""


@kernel(PROBE)
def of_cell(t, x, v, f, lines, rows, data, where):
    """A column of the output of a term of one cell; ``rows`` is (column,)."""
    where[0] = -1
    return data[0, rows[0]]


class OfThread(Observable):
    """Tension, stress, strain or current length of a thread, from its first node to its last through all others."""

    keys = ("thread",)

    @property
    def unit(self):
        """Unit of the quantity."""
        return UNITS[self.observe.quantity]

    @property
    def _column(self):
        return list(UNITS).index(self.observe.quantity)

    def on(self, system):
        """Refuse a missing name, and one that is that of no thread."""
        names, name = [thread.name for thread in system.net.threads], self.observe.thread
        if name not in names:
            hint = nearest(name or "", names) if names else "the scene has no [[thread]]"
            missing = "thread is missing" if name is None else f"thread = {quote(name)} is not a thread"
            raise InputError(f"{missing}, {hint}")

    def _thread(self, system):
        """(Number of the term, the thread)."""
        return next(item for item in system.threads.items() if item[1].name == self.observe.thread)

    def of(self, state):
        """The value of the thread."""
        return Value(float(state.threads[self.observe.thread][self._column]), None)

    def probe(self, system):
        """Make the probe of the thread."""
        return Probe(of_cell, [self._column], np.zeros((0, 0)), term=self._thread(system)[0])

    def bounds(self, system):
        """Lengths are not negative, nor is what a thread that only pulls is drawn with."""
        if self.observe.quantity == "length":
            return NOT_NEGATIVE
        if system is None or self.observe.quantity == "strain":
            return ANY
        return ANY if self._thread(system)[1].line.law.pushes else NOT_NEGATIVE

    def error(self, state, equilibrium):
        """The estimate by deviations, and the rounding of the strain, which no node balances where all are held."""
        error = super().error(state, equilibrium)
        if error is None:
            return None
        line = self._thread(state.system)[1].line
        scale = {"tension": line.axial[0], "stress": line.axial[0] / line.area[0], "strain": 1.0}
        return error + ROUNDING * float(scale.get(self.observe.quantity, line.natural_length[0]))
