"""Tension, stress, strain and length of a thread, and the slip over its rings.

May change: class docstrings, which are help: then write ``validation/REFERENCE.md`` anew. Must stay: columns of ``out``
that `column` counts, as `effects.thread`, `effects.thread_friction` and `effects.winding` write them; class names,
which are the capitalised names of quantities: `Observe` finds them so; `of_cell`, which `dynamics.history` calls;
`OfThread`, which `statics.responses` imports. Tests: ``tests/effects/test_thread.py``,
``tests/effects/test_thread_friction.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ...kernels import kernel
from ...messages import nearest, quote
from ...net.threads import COLUMNS
from ..probes import PROBE, Probe
from .observable import ANY, NOT_NEGATIVE, ROUNDING, Observable, Value

if TYPE_CHECKING:
    from ...net.net import Net
    from ...net.threads import ThreadLine
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

    def column_in(self, thread: ThreadLine) -> int:
        """Column of the value in what the force of a thread observes."""
        return self.column

    def of(self, state: State) -> Value:
        """The value of the thread."""
        thread = self._thread(state.system)[1]
        return Value(float(state.threads[thread.name][self.column_in(thread)]), None)

    def probe(self, system: System) -> Probe:
        """Make the probe of the thread."""
        number, thread = self._thread(system)
        return Probe(of_cell, [self.column_in(thread)], np.zeros((0, 0)), term=number)

    def bounds(self, system: System | None) -> tuple[float, float]:
        """A thread that only pulls has a tension that is not negative."""
        pulls = self.pull and system is not None and not self._thread(system)[1].line.law.pushes
        return NOT_NEGATIVE if pulls else ANY

    def error(self, state: State, equilibrium: Equilibrium) -> float | None:
        """The proven bound of duality, or else the estimate by deviations; and the rounding of the strain.

        None if the thread may be slack within the bound and the value is no tension, which then is not unique.
        """
        thread, bound = self._thread(state.system)[1], equilibrium.duality_bound
        line = thread.line
        if bound is None:
            error = super().error(state, equilibrium)
            return None if error is None else error + ROUNDING * self.scale(line)
        names = [each.name for each in state.system.net.threads]
        error = float(bound.threads[names.index(thread.name)])
        if not self.pull and state.threads[thread.name][0] <= error:
            return None
        return (error / float(line.axial[0]) + ROUNDING) * self.scale(line)

    def proven(self, equilibrium: Equilibrium) -> bool:
        """True if there is a bound from duality."""
        return equilibrium.duality_bound is not None


class Tension(OfThread):
    """Tension of a thread, with friction the largest, or that of a segment."""

    keys: tuple[str, ...] = ("thread", "segment")
    unit = "N"
    pull = True

    def on(self, system: System) -> None:
        """Refuse a segment that the thread does not have."""
        super().on(system)
        count, segment = len(self._thread(system)[1].distances), self.observe.segment
        if segment is not None and segment >= count:
            raise InputError(f"segment = {segment} must be < {count}, the number of segments of the thread")

    def column_in(self, thread: ThreadLine) -> int:
        """Column of the tension of the segment; without friction all have the same."""
        return COLUMNS + self.observe.segment if thread.rings and self.observe.segment is not None else 0

    def scale(self, line: Net) -> float:
        """EA."""
        return float(line.axial[0])


class Stress(OfThread):
    """Nominal stress of a thread, tension over area."""

    unit = "Pa"
    column = 1
    pull = True

    def scale(self, line: Net) -> float:
        """E."""
        return float(line.axial[0] / line.area[0])


class Strain(OfThread):
    """Engineering strain of a thread."""

    column = 2


class Slip(OfThread):
    """Length of a thread that has gone over a ring with friction, or a winch, in the order of its nodes."""

    keys: tuple[str, ...] = ("thread", "ring")
    unit = "m"

    def on(self, system: System) -> None:
        """Refuse a thread without friction, a missing ring, and a node that is no ring."""
        super().on(system)
        thread, ring = self._thread(system)[1], self.observe.ring
        if not thread.rings:
            raise InputError(f'quantity = "slip" needs friction of {thread.title}: give it 0.0 there, or more')
        first, last = (0, len(thread.friction) - 1) if thread.closed else (1, len(thread.friction))
        first, last = first - (thread.ends == 2), last + (thread.ends == 3)
        if ring is None or not first <= ring <= last:
            given = "ring is missing" if ring is None else f"ring = {ring}"
            raise InputError(f"{given}: it must be from {first} to {last}, a number in the list of nodes of the thread")

    def column_in(self, thread: ThreadLine) -> int:
        """Column of the slip."""
        ring: Any = self.observe.ring
        return COLUMNS + len(thread.distances) + (ring - 1) % thread.rings

    def scale(self, line: Net) -> float:
        """Natural length."""
        return float(line.natural_length[0])


class Length(OfThread):
    """Current length of a thread, from its first node to its last through all others."""

    unit = "m"
    column = 3

    def bounds(self, system: System | None) -> tuple[float, float]:
        """Bounds of the value: a length is not negative."""
        return NOT_NEGATIVE

    def scale(self, line: Net) -> float:
        """Natural length."""
        return float(line.natural_length[0])
