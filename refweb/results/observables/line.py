"""Tension, stress and strain of elements of lines, of which one counts, see ``select`` of `refweb.Observe`.

May change: how values are found, in `values` and in the probe together. Must stay: class docstrings (help; after a
change write ``validation/REFERENCE.md`` anew) and names in `registry.OBSERVABLES`; classes that `statics.simulation`,
`statics.responses`, `dynamics.responses` and `sizing.case` know; `Strain` and `Stress`, which `sizing.case` and
`statics.responses` import; `Line`, which `dynamics.responses` imports; `StressShare`, which `statics.simulation`
imports. Tests: ``tests/results/test_observable_contract.py``, ``tests/results/test_selections.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...effects.base import STRAIN
from ...errors import InputError
from ...net.tension_laws import law_of
from .observable import ANY, NOT_NEGATIVE, SELECTIONS, Observable, Value

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...net.net import Net
    from ...statics.duality_bound import DualityBound
    from ...statics.equilibrium import Equilibrium
    from ...system.system import System
    from ..probes import Probe
    from ..state import State


class Line(Observable):
    """A number of each element.

    The value is `scale` times the ``column`` of tension or strain of each element.

    Attributes
    ----------
    pull : bool
        True if the value has the sign of the tension.
    """

    keys: tuple[str, ...] = ("line", "thread", "part", "select")
    at = "line"
    pull = True

    def values(self, state: State) -> NDArray[np.float64]:
        """Value of each element in a state, shape (cells,)."""
        return state.element_tension * self.scale(state.system.net)

    def bound(self, proven: DualityBound, net: Net) -> NDArray[np.float64]:
        """Error of each element by a `refweb.statics.duality_bound.DualityBound`, shape (cells,)."""
        return proven.tension * self.scale(net)

    def on(self, system: System) -> None:
        """Refuse lines that the net does not have, and parts of lines of one element."""
        self.lines(system.net)
        if self.observe.part is not None and system.net.subdivide == 1:
            raise InputError(
                f'part = "{self.observe.part}" needs [cable] subdivide > 1: a line of one element has no parts; leave '
                "it out, or name lines where they end"
            )

    def lines(self, net: Net) -> NDArray[np.int64] | None:
        """Numbers of the observed lines, increasing; None for all."""
        line = self.observe.line
        return None if line is None else net.web.find_lines(line, "line")

    def elements(self, net: Net) -> NDArray[np.int64]:
        """Numbers of their elements, or of the part of each that is asked for, increasing, shape (k,)."""
        lines, part = self.lines(net), self.observe.part
        if part is not None:
            lines = np.arange(len(net.web.lines)) if lines is None else lines
            ends = {"start": 0, "end": net.subdivide - 1}
            return net.middle_of(lines) if part == "middle" else lines * net.subdivide + ends[part]
        return np.arange(len(net.line)) if lines is None else np.flatnonzero(np.isin(net.line, lines))

    def of(self, state: State) -> Value:
        """The value that counts of its elements."""
        net = state.system.net
        elements = self.elements(net)
        value, at = self.selected(self.values(state)[elements])
        return Value(value, int(net.line[elements[at]]))

    def probe(self, system: System) -> Probe:
        """Make the probe of the elements of its lines, or of all."""
        from ..probes import Probe, line, line_of, selected_element

        elements, scale = self.elements(system.net), self.scale(system.net)[:, None]
        if self.selects:
            numbers = [SELECTIONS[self.observe.select], self.column(system), *elements.tolist()]
            return Probe(selected_element, numbers, scale)
        first, last = int(elements[0]), int(elements[-1])
        if len(elements) == last + 1 - first:
            return Probe(line, [self.column(system), first, last + 1], scale)
        return Probe(line_of, [self.column(system), *elements.tolist()], scale)

    def position(self, system: System, at: int) -> int:
        """The line of an element."""
        return int(system.net.line[at])

    def bounds(self, system: Any) -> tuple[float, float]:
        """Lines that can only pull have tensions that are not negative, damping apart.

        Where such a line is among others the largest is not negative, and where there is no other the smallest.
        """
        if self.observe.select == "abs":
            return NOT_NEGATIVE
        pulls = ~system.net.law_is("pushes")[self.elements(system.net)]
        alone = sum(term.over_lines for term in system.terms) == 1
        certain = pulls.all() if self.observe.select == "min" else pulls.any()
        return NOT_NEGATIVE if self.pull and certain and alone else ANY

    def bounds_by_tables(self, tables: dict[str, Any]) -> tuple[float, float]:
        """The same where the law of all lines is known without the net: one law, of the cable and of its groups."""
        if self.observe.select == "abs":
            return NOT_NEGATIVE
        cable = tables.get("cable", {})
        laws = {table["law"] for table in (cable, *cable.get("groups", {}).values()) if "law" in table}
        damped = tables.get("damping", {}).get("time", 0.0) > 0.0
        pushes = damped or not laws or any(law_of(law).pushes for law in laws)
        return NOT_NEGATIVE if self.pull and not pushes else ANY

    def column(self, system: System) -> int:
        """Column of tension in the output of lines."""
        return system.tension_column

    def scale(self, net: Net) -> NDArray[np.float64]:
        """1, shape (cells,)."""
        return np.ones(len(net.cells))

    def error(self, state: State, equilibrium: Equilibrium) -> float | None:
        """The proven bound of duality, if there is one, plus the rounding of lines whose ends are both fixed."""
        if equilibrium.duality_bound is None:
            return super().error(state, equilibrium)
        net = state.system.net
        bound = self.bound(equilibrium.duality_bound, net)[self.elements(net)]
        return float(bound.max()) + self.of_held_lines(state)

    def proven(self, equilibrium: Equilibrium) -> bool:
        """True if there is a bound from duality."""
        return equilibrium.duality_bound is not None


class Tension(Line):
    """Tension."""

    unit = "N"


class Stress(Line):
    """Nominal stress, tension over area."""

    unit = "Pa"

    def values(self, state: State) -> NDArray[np.float64]:
        """Stress [Pa], shape (cells,)."""
        return state.element_tension / state.system.net.area

    def scale(self, net: Net) -> NDArray[np.float64]:
        """Inverse of the area [1/m²], shape (cells,)."""
        return 1.0 / net.area


class StressShare(Line):
    """Stress over its limit, the largest of all lines, for the margin of safety and the utilisation.

    Parameters
    ----------
    over : {"strength", "allowed"}
        The limit, an attribute of `refweb.net.net.Net`.
    """

    def __init__(self, over: str) -> None:
        from .observe import Observe

        super().__init__(Observe(name=over, quantity="stress"))
        self._over = over

    def scale(self, net: Net) -> NDArray[np.float64]:
        """Inverse of the tension at the limit [1/N], 0 without a limit, shape (cells,)."""
        return 1.0 / (net.area * getattr(net, self._over))


class Strain(Line):
    """Engineering strain."""

    pull = False

    def column(self, system: System) -> int:
        """Column of strain."""
        return STRAIN

    def values(self, state: State) -> NDArray[np.float64]:
        """Strain [1], shape (cells,)."""
        return state.element_strain

    def bound(self, proven: DualityBound, net: Net) -> NDArray[np.float64]:
        """Error bound of strain itself [1], shape (cells,)."""
        return proven.strain

    def error(self, state: State, equilibrium: Equilibrium) -> float | None:
        """± of the value; None if the line may be slack within its bound, since its strain is then not unique."""
        error = super().error(state, equilibrium)
        if error is None or equilibrium.duality_bound is None:
            return error
        elements = self.elements(state.system.net)
        values = self.values(state)[elements[~state.system.net.forming[elements]]]
        if not len(values):
            return error
        counts = values.min() if self.selects else values.max()
        return None if counts <= error else error
