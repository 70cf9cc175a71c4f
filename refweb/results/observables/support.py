"""Force and moment that hold a body, by its motion or its axle, and the angle that it has turned by about an axle.

The force on the body of whatever acts is at its row, or at that of a point of its axle; what holds it gives the
negative, and what the centre of mass takes to go round an axle:

    F = m (α n × r − ω² r) − f,        α = n·M/I,

with the arm r from the axle to the centre of mass, the moment M of all that acts and I about the axle. An axle bears
the moment across it, J α n + ω² n × J n − M with the tensor of inertia J about the same point.

Keys, and rows of a body by `rows`, are those of `rotation.Turning`. May change: private functions and how the formulas
are written: the kernels serve `of` as well. Must stay: signs; rows and data of a probe in the order that its kernel
reads; class docstrings (help; after a change write ``validation/REFERENCE.md`` anew) and names in
`registry.OBSERVABLES`; `AxleAngle`, which `statics.responses` knows by its class. Tests:
``tests/effects/test_axles.py``, ``tests/effects/test_moved_bodies.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from ...kernels import kernel
from ...net.rotation import add_forces_to_bodies, matrix_at, times
from ..probes import PROBE, Probe, component_of
from .observable import Value
from .rotation import Turning

if TYPE_CHECKING:
    from ...system.system import System
    from ..state import State


class _Held(Turning):
    """Quantity of a body that a motion or an axle holds."""

    dynamic = False

    def on(self, system: System) -> None:
        """Refuse a body that nothing holds in a way that is known here."""
        super().on(system)
        body = self.body(system.net)
        if not (body.moved or body.axle):
            raise InputError(
                f'quantity = "{self.observe.quantity}": body = "{body.name}" is neither moved by [[motion]] nor on an '
                "axle: hold it by [[motion]] displacement = [[0, 0, 0, 0]] and rotation = [[0, 0, 0, 0]] in place of "
                'fixed = true; the force of contact on it is quantity = "reaction"'
            )

    def of(self, state: State) -> Value:
        """Value by its probe, which looks at no lines."""
        force = state.system.balance(state.time, state.x, state.v).force
        return Value(self.probe(state.system).at(state, force), None)


class SupportForce(_Held):
    """Force of motion or axle on a body."""

    unit = "N"

    def probe(self, system: System) -> Probe:
        """Make the probe of x, v and f."""
        body, (component, *_) = self.body(system.net), self.rows(system)
        off = body.pivot is not None and not body.moved
        direction = body.axle.direction if off and body.axle else np.zeros(3)
        data = [body.mass if off else 0.0, body.moment, *body.arm, *direction]
        turning = (body.spin, body.turn) if off else (-1, -1)
        return Probe(support_force, [component, body.base, *turning], np.array([data]))


class SupportMoment(_Held):
    """Moment of the motion or the axle of a body on it, about its position or the nearest point of the axle."""

    unit = "N m"

    def on(self, system: System) -> None:
        """Refuse a body that is moved, and not turned."""
        super().on(system)
        body = self.body(system.net)
        if body.spin is None:
            raise InputError(
                f'quantity = "support_moment": body = "{body.name}" is not turned by [[motion]] rotation = ..., whose '
                "moment it is: give rotation = [[0, 0, 0, 0]] to hold it"
            )

    def of(self, state: State) -> Value:
        """Value by its probe; in statics of the moments that an axle bears as well."""
        body, system = self.body(state.system.net), state.system
        if body.moved or body.axle is None or not system.angles:
            return super().of(state)
        force = sum((system.force_of(term, state.time, state.x) for term in system.terms), np.zeros((system.rows, 3)))
        add_forces_to_bodies(state.x, force, system.carriers.turns)
        axle, moment = body.axle.direction, force[body.spin]
        across = (axle @ moment) * axle - moment
        return Value(float(component_of.py_func(self.rows(system)[0], *across)), None)

    def probe(self, system: System) -> Probe:
        """Make the probe of x, v and f."""
        body, (component, spin, turn) = self.body(system.net), self.rows(system)
        if body.moved or body.axle is None:
            return Probe(support_moment, [component, spin], np.zeros((0, 0)))
        about_base = body.axes.T @ body.inertia @ body.axes
        about_base += body.mass * (body.arm @ body.arm * np.eye(3) - np.outer(body.arm, body.arm))
        return Probe(axle_moment, [component, spin, turn], np.vstack([about_base, body.axle.direction]))


class AxleAngle(_Held):
    """Angle of a body about its axle from its pose in the web, of any number of turns.

    A run with ``start = "equilibrium"`` begins with the angle of the equilibrium.
    """

    unit = "rad"
    keys: tuple[str, ...] = ("body",)

    def on(self, system: System) -> None:
        """Refuse a body without an axle."""
        super().on(system)
        body = self.body(system.net)
        if not body.axle or body.turn is None:
            raise InputError(
                f'quantity = "axle_angle": body = "{body.name}" turns about no axle: give axle = '
                "{ direction = [...] } and, where it is moved, rotation = ..."
            )

    def probe(self, system: System) -> Probe:
        """Make the probe of x alone."""
        return Probe(axle_angle, self.rows(system)[2:], np.zeros((0, 0)))


@kernel(PROBE)
def support_force(t, x, v, f, lines, rows, data, where):
    """Force on a body; ``rows`` is (component, row, rows of rotation), data m, I, r at the start and n; m = 0: −f."""
    b, s = rows[1], rows[2]
    p = 0.0 - f[b, 0], 0.0 - f[b, 1], 0.0 - f[b, 2]
    if data[0, 0] > 0.0:
        n = data[0, 5], data[0, 6], data[0, 7]
        r = times(matrix_at(x, s, rows[3]), (data[0, 2], data[0, 3], data[0, 4]))
        faster = data[0, 0] * (n[0] * f[s, 0] + n[1] * f[s, 1] + n[2] * f[s, 2]) / data[0, 1]
        rate = n[0] * v[s, 0] + n[1] * v[s, 1] + n[2] * v[s, 2]
        inward = -data[0, 0] * rate * rate
        p = (
            p[0] + faster * (n[1] * r[2] - n[2] * r[1]) + inward * r[0],
            p[1] + faster * (n[2] * r[0] - n[0] * r[2]) + inward * r[1],
            p[2] + faster * (n[0] * r[1] - n[1] * r[0]) + inward * r[2],
        )
    return component_of(rows[0], p[0], p[1], p[2])


@kernel(PROBE)
def support_moment(t, x, v, f, lines, rows, data, where):
    """Moment on a body; ``rows`` is (component, row of rotation)."""
    s = rows[1]
    return component_of(rows[0], 0.0 - f[s, 0], 0.0 - f[s, 1], 0.0 - f[s, 2])


@kernel(PROBE)
def axle_moment(t, x, v, f, lines, rows, data, where):
    """Moment of an axle; ``rows`` is (component, rows of rotation), data has J at the start by rows, and n."""
    s, m, n = rows[1], matrix_at(x, rows[1], rows[2]), (data[3, 0], data[3, 1], data[3, 2])
    tensor = (
        (data[0, 0], data[0, 1], data[0, 2]),
        (data[1, 0], data[1, 1], data[1, 2]),
        (data[2, 0], data[2, 1], data[2, 2]),
    )
    p = times(m, times(tensor, n))  # J n: n stays as it turns
    rate = n[0] * v[s, 0] + n[1] * v[s, 1] + n[2] * v[s, 2]
    faster = (n[0] * f[s, 0] + n[1] * f[s, 1] + n[2] * f[s, 2]) / (n[0] * p[0] + n[1] * p[1] + n[2] * p[2])
    square = rate * rate
    return component_of(
        rows[0],
        faster * p[0] + square * (n[1] * p[2] - n[2] * p[1]) - f[s, 0],
        faster * p[1] + square * (n[2] * p[0] - n[0] * p[2]) - f[s, 1],
        faster * p[2] + square * (n[0] * p[1] - n[1] * p[0]) - f[s, 2],
    )


@kernel(PROBE)
def axle_angle(t, x, v, f, lines, rows, data, where):
    """Angle about an axle; ``rows`` is the second row of rotation."""
    return x[rows[0], 1]
