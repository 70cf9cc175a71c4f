"""Displacement, position and velocity; of several nodes the one with the largest value counts."""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...messages import nearest
from .observable import Observable, Value


class Nodal(Observable):
    """A vector of each row of the unknowns, of which a component or the magnitude counts.

    Subclasses have `vectors` and a probe.
    """

    keys = ("node", "body", "component")

    def vectors(self, state):
        """Vector of each row in a state, shape (rows, 3)."""
        raise NotImplementedError

    def on(self, system):
        """Refuse nodes and bodies that the net does not have."""
        self.rows(system)

    def rows(self, system):
        """Observed rows, shape (k,)."""
        net, body = system.net, self.observe.body
        if body is not None:
            names = [body.name for body in net.bodies]
            if body not in names:
                hint = nearest(body, names) if names else "the scene has no [[body]]"
                raise InputError(f'body = "{body}" is not a body, {hint}')
            return np.array([net.bodies[names.index(body)].row])
        return np.arange(net.nodes) if self.observe.node is None else net.find(self.observe.node)

    def sizes(self, vectors):
        """The requested component of vectors, or their magnitude, shape (k,)."""
        component = self.observe.component
        return np.linalg.norm(vectors, axis=1) if component is None else vectors[:, component]

    def of(self, state):
        """The largest value of the observed rows."""
        rows = self.rows(state.system)
        sizes = self.sizes(self.vectors(state)[rows])
        at = int(np.argmax(sizes))
        return Value(float(sizes[at]), self.position(state.system, int(rows[at])))

    def position(self, system, at):
        """The node; None for a body."""
        return at if self.observe.body is None else None

    def numbers(self, rows):
        """Component and rows in the form of `refweb.results.probes.largest_of`."""
        from ..probes import MAGNITUDE

        component = MAGNITUDE if self.observe.component is None else self.observe.component
        consecutive = len(rows) == 1 or (np.diff(rows) == 1).all()
        return [component, rows[0], rows[-1] + 1] if consecutive else [component, -1, -1, *rows]


class Place(Nodal):
    """A vector of each row that follows from its position; it is open if the row floats."""

    def floats(self, state, equilibrium):
        """Tell if the row with the largest value floats, or a floating row may have a larger value."""
        floating = equilibrium.floating
        if floating is None:
            return bool(np.isin(self.rows(state.system), state.slack_nodes).any())
        rows, component = self.rows(state.system), self.observe.component
        axes = slice(None) if component is None else [component]
        open_ = floating.free[rows][:, axes].any(axis=1)
        if not open_.any():
            return False
        sizes = self.sizes(self.vectors(state)[rows])
        if open_[np.argmax(sizes)] or floating.parts is None:
            return True
        smallest, largest = floating.parts.reach[:, rows] + (self.vectors(state) - state.position)[rows]
        largest_move = (
            np.linalg.norm(np.maximum(-smallest, largest), axis=1) if component is None else largest[:, component]
        )
        return bool((largest_move[open_] > sizes.max()).any())

    def interval(self, state, equilibrium):
        """Range of one row along one axis, see `refweb.statics.floating.Parts.limits`."""
        rows, axis, floating = self.rows(state.system), self.observe.component, equilibrium.floating
        if floating is None or floating.parts is None or axis is None or len(rows) > 1 or not floating.free[rows, axis]:
            return None
        limits = floating.parts.limits(rows[0], axis)
        if limits is None:
            return None
        shift = float((self.vectors(state) - state.position)[rows[0], axis])
        value = float(self.vectors(state)[rows[0], axis])
        ends = sorted(float(limit) + shift for limit in limits)
        # rounding may leave the value beside limits that are next to equal
        return min(ends[0], value), max(ends[1], value)


class Displacement(Place):
    """Displacement from the reference position."""

    unit = "m"

    def vectors(self, state):
        """Displacement [m], shape (rows, 3)."""
        return state.x

    def probe(self, system):
        """Make the probe of x alone."""
        from ..probes import Probe, displacement

        rows = self.rows(system)
        return Probe(displacement, self.numbers(rows), np.zeros((len(rows), 3)))


class Position(Place):
    """Position in space."""

    unit = "m"

    def vectors(self, state):
        """Positions [m], shape (rows, 3)."""
        return state.position

    def probe(self, system):
        """Make the probe of x and the reference position."""
        from ..probes import Probe, displacement

        rows = self.rows(system)
        return Probe(displacement, self.numbers(rows), system.net.points[rows])


class Velocity(Nodal):
    """Velocity."""

    unit = "m/s"
    dynamic = True

    def vectors(self, state):
        """Velocities [m/s], shape (rows, 3)."""
        return state.v

    def probe(self, system):
        """Make the probe of v alone."""
        from ..probes import Probe, velocity

        rows = self.rows(system)
        return Probe(velocity, self.numbers(rows), np.zeros((len(rows), 3)))
