"""Tension, stress, strain and length of a thread.

`column` counts what `effects.thread` writes; `Observe` finds classes by the capitalised name of a quantity.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from ...kernels import kernel
from ...messages import nearest, quote
from ..probes import PROBE, Probe
from .observable import ANY, NOT_NEGATIVE, ROUNDING, Observable, Value

if TYPE_CHECKING:
    from ...net.net import Net
    from ...statics.equilibrium import Equilibrium
    from ...system.system import System
    from ..state import State


@kernel(PROBE)
def of_cell(t, x, v, f, lines, rows, data, where):
    """A column of the output of a term of one cell; ``rows`` is (column,)."""
    where[0] = -1
    return data[0, rows[0]]


class OfThread(Observable):
    """A number of a thread, which is that of all of it.

    Attributes
    ----------
    column : int
        Column of what the force of a thread observes.
    pull : bool
        True if the value has the sign of the tension.
    """

    keys: tuple[str, ...] = ("thread",)
    column = 0
    pull = False

    def scale(self, line: Net) -> float:
        """Change of the value by a strain of 1, of a thread as one ``line``."""
        return 1.0

    def on(self, system: System) -> None:
        """Refuse a missing name, and one that is that of no thread."""
        names, name = [thread.name for thread in system.net.threads], self.observe.thread
        if name not in names:
            hint = nearest(name or "", names) if names else "the scene has no [[thread]]"
            missing = "thread is missing" if name is None else f"thread = {quote(name)} is not a thread"
            raise InputError(f"{missing}, {hint}")

    def _thread(self, system):
        """(Number of the term, the thread)."""
        return next(item for item in system.threads.items() if item[1].name == self.observe.thread)

    def of(self, state: State) -> Value:
        """The value of the thread."""
        return Value(float(state.threads[self._thread(state.system)[1].name][self.column]), None)

    def probe(self, system: System) -> Probe:
        """Make the probe of the thread."""
        return Probe(of_cell, [self.column], np.zeros((0, 0)), term=self._thread(system)[0])

    def bounds(self, system: System | None) -> tuple[float, float]:
        """A thread that only pulls has a tension that is not negative."""
        pulls = self.pull and system is not None and not self._thread(system)[1].line.law.pushes
        return NOT_NEGATIVE if pulls else ANY

    def error(self, state: State, equilibrium: Equilibrium) -> float | None:
        """The proven bound of duality, or else the estimate by deviations; and the rounding of the strain.

        None if the thread may be slack within the bound and the value is no tension, which then is not unique.
        """
        net, line, bound = state.system.net, self._thread(state.system)[1].line, equilibrium.duality_bound
        if bound is None:
            error = super().error(state, equilibrium)
            return None if error is None else error + ROUNDING * self.scale(line)
        names = [thread.name for thread in net.threads]
        error = float(bound.threads[names.index(self.observe.thread)])
        if not self.pull and state.threads[self.observe.thread][0] <= error:
            return None
        return (error / float(line.axial[0]) + ROUNDING) * self.scale(line)

    def proven(self, equilibrium: Equilibrium) -> bool:
        """True if there is a bound from duality."""
        return equilibrium.duality_bound is not None


class Tension(OfThread):
    """Tension of a thread."""

    unit = "N"
    pull = True

    def scale(self, line: Net) -> float:
        """EA."""
        return float(line.axial[0])


class Stress(OfThread):
    """Nominal stress of a thread, tension over area."""

    unit, column = "Pa", 1
    pull = True

    def scale(self, line: Net) -> float:
        """E."""
        return float(line.axial[0] / line.area[0])


class Strain(OfThread):
    """Engineering strain of a thread."""

    column = 2


class Length(OfThread):
    """Current length of a thread, from its first node to its last through all others."""

    unit, column = "m", 3

    def bounds(self, system: System | None) -> tuple[float, float]:
        """Bounds of the value: a length is not negative."""
        return NOT_NEGATIVE

    def scale(self, line: Net) -> float:
        """Natural length."""
        return float(line.natural_length[0])
