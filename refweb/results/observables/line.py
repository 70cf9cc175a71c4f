"""Tension, stress and strain: of a line its largest, without one that of all lines."""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...net.net import AXIAL_STIFFNESS
from .observable import Observable, Value


class Line(Observable):
    """A number of each line.

    Subclasses have ``values(state)``, shape (lines,), ``scale(net)``, by which ``column`` of tension and strain of each
    element is multiplied, and ``bound(tension, net)``, the error of each element that a proven one of tensions makes.
    """

    keys = ("line",)
    column = 0

    def on(self, system):
        """Refuse a line that the net does not have."""
        count = len(system.net.web.lines)
        if self.observe.line is not None and self.observe.line >= count:
            raise InputError(f"line = {self.observe.line} must be 0 … {count - 1}")

    def of(self, state):
        """That of its line, or the largest."""
        values, line = self.values(state), self.observe.line
        at = int(np.argmax(values)) if line is None else line
        return Value(float(values[at]), at)

    def probe(self, system):
        """Of the elements of its line, or of all."""
        from ..probes import Probe, line

        net, own = system.net, self.observe.line
        elements = np.arange(len(net.line)) if own is None else np.flatnonzero(net.line == own)
        return Probe(line, [self.column, elements[0], elements[-1] + 1], self.scale(net)[:, None])

    def place(self, system, at):
        """The line of an element."""
        return int(system.net.line[at])

    def scale(self, net):
        """1, shape (cells,)."""
        return np.ones(len(net.cells))

    def error(self, state, equilibrium):
        """The proven bound of duality, where there is one, and the rounding of lines that both ends hold."""
        if equilibrium.duality_bound is None:
            return super().error(state, equilibrium)
        net, line = state.system.net, self.observe.line
        bound = self.bound(equilibrium.duality_bound.tension, net)
        return float((bound if line is None else bound[net.line == line]).max()) + self.of_held_lines(state)


class Tension(Line):
    """Tension."""

    unit = "N"

    def values(self, state):
        """Tension [N], shape (lines,)."""
        return state.tension

    def bound(self, tension, net):
        """Its own [N], shape (cells,)."""
        return tension


class Stress(Line):
    """Nominal stress, tension over area."""

    unit = "Pa"

    def values(self, state):
        """Stress [Pa], shape (lines,)."""
        return state.stress

    def scale(self, net):
        """One over the area [1/m²], shape (cells,)."""
        return 1.0 / net.area

    def bound(self, tension, net):
        """That of tension over the area [Pa], shape (cells,)."""
        return tension / net.area


class Strain(Line):
    """Engineering strain."""

    column = 1

    def values(self, state):
        """Strain [1], shape (lines,)."""
        return state.strain

    def bound(self, tension, net):
        """That of tension over EA [1], shape (cells,)."""
        return tension / net.line_data[:, AXIAL_STIFFNESS]

    def error(self, state, equilibrium):
        """None where duality leaves it open whether the line is slack: then its strain is not unique."""
        error = super().error(state, equilibrium)
        open_ = equilibrium.duality_bound is not None and self.of(state).value <= error
        return None if open_ else error
