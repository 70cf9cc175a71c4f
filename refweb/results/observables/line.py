"""Tension, stress and strain: the largest value of a line, or of several lines."""

from __future__ import annotations

import numpy as np

from ...effects.base import STRAIN
from ...net.tension_laws import TENSION_ONLY
from .observable import ANY, NOT_NEGATIVE, Observable, Value


class Line(Observable):
    """A number of each line.

    Subclasses have `values`, `bound` and `scale`. The latter is a factor on the ``column`` of tension or strain of each
    element.

    Attributes
    ----------
    pull : bool
        True if the value has the sign of the tension.
    """

    keys, at = ("line",), "line"
    pull = True

    def values(self, state):
        """Value of each line in a state, shape (lines,)."""
        raise NotImplementedError

    def bound(self, tension, net):
        """Error of each element by a proven error of its tension [N], shape (cells,)."""
        raise NotImplementedError

    def on(self, system):
        """Refuse lines that the net does not have."""
        self.lines(system.net)

    def lines(self, net):
        """Numbers of the observed lines, increasing; None for all."""
        line = self.observe.line
        return None if line is None else net.web.find_lines(line, "line")

    def elements(self, net):
        """Numbers of their elements, increasing, shape (k,)."""
        lines = self.lines(net)
        return np.arange(len(net.line)) if lines is None else np.flatnonzero(np.isin(net.line, lines))

    def of(self, state):
        """The largest value of the observed lines."""
        values, lines = self.values(state), self.lines(state.system.net)
        at = int(np.argmax(values) if lines is None else lines[np.argmax(values[lines])])
        return Value(float(values[at]), at)

    def probe(self, system):
        """Make the probe of the elements of the observed lines."""
        from ..probes import Probe, line, line_of

        elements, scale = self.elements(system.net), self.scale(system.net)[:, None]
        first, last = int(elements[0]), int(elements[-1])
        if len(elements) == last + 1 - first:
            return Probe(line, [self.column(system), first, last + 1], scale)
        return Probe(line_of, [self.column(system), *elements.tolist()], scale)

    def position(self, system, at):
        """The line of an element."""
        return int(system.net.line[at])

    def bounds(self, system):
        """Bounds of the value: the tension of lines that only pull is not negative if they are not damped."""
        pulls = (system.net.laws[self.elements(system.net)] == TENSION_ONLY).any()
        alone = sum(term.over_lines for term in system.terms) == 1
        return NOT_NEGATIVE if self.pull and pulls and alone else ANY

    def bounds_by_tables(self, tables):
        """Bounds of the value by the tables of a scene: those of `bounds` if cable and groups have one law."""
        cable = tables.get("cable", {})
        laws = {table["law"] for table in (cable, *cable.get("groups", {}).values()) if "law" in table}
        damped = tables.get("damping", {}).get("time", 0.0) > 0.0
        return NOT_NEGATIVE if self.pull and laws == {"tension-only"} and not damped else ANY

    def column(self, system):
        """Column of tension in the output of lines."""
        return system.tension_column

    def scale(self, net):
        """1, shape (cells,)."""
        return np.ones(len(net.cells))

    def error(self, state, equilibrium):
        """The proven bound of duality, if there is one, plus the rounding of lines whose ends are both fixed."""
        if equilibrium.duality_bound is None:
            return super().error(state, equilibrium)
        net = state.system.net
        bound = self.bound(equilibrium.duality_bound.tension, net)[self.elements(net)]
        return float(bound.max()) + self.of_held_lines(state)

    def proven(self, equilibrium):
        """True if there is a bound from duality."""
        return equilibrium.duality_bound is not None


class Tension(Line):
    """Tension."""

    unit = "N"

    def values(self, state):
        """Tension [N], shape (lines,)."""
        return state.tension

    def bound(self, tension, net):
        """The error bound of tension itself [N], shape (cells,)."""
        return tension


class Stress(Line):
    """Nominal stress, tension over area."""

    unit = "Pa"

    def values(self, state):
        """Stress [Pa], shape (lines,)."""
        return state.stress

    def scale(self, net):
        """Inverse of the area [1/m²], shape (cells,)."""
        return 1.0 / net.area

    def bound(self, tension, net):
        """Error bound of tension over the area [Pa], shape (cells,)."""
        return tension / net.area


class StressShare(Line):
    """Stress over its limit, the largest of all lines, for the margin of safety and the utilisation.

    Parameters
    ----------
    over : {"strength", "allowed"}
        The limit, an attribute of `refweb.net.net.Net`.
    """

    def __init__(self, over):
        from .observe import Observe

        super().__init__(Observe(name=over, quantity="stress"))
        self._over = over

    def of(self, state):
        """The largest of all lines."""
        shares = state.element_tension * self.scale(state.system.net)
        at = int(shares.argmax())
        return Value(float(shares[at]), int(state.system.net.line[at]))

    def scale(self, net):
        """Inverse of the tension at the limit [1/N], 0 without a limit, shape (cells,)."""
        return 1.0 / (net.area * getattr(net, self._over))

    def bound(self, tension, net):
        """Error bound of tension over the tension at the limit [1], shape (cells,)."""
        return tension * self.scale(net)


class Strain(Line):
    """Engineering strain."""

    pull = False

    def column(self, system):
        """Column of strain."""
        return STRAIN

    def values(self, state):
        """Strain [1], shape (lines,)."""
        return state.strain

    def bound(self, tension, net):
        """Error bound of tension over EA [1], shape (cells,)."""
        return tension / net.line_data.ea

    def error(self, state, equilibrium):
        """± of the value; None if the line may be slack within its bound, since its strain is then not unique."""
        error = super().error(state, equilibrium)
        if error is None or equilibrium.duality_bound is None:
            return error
        return None if self.of(state).value <= error else error
