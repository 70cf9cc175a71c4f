"""Force and moment that hold a body, by its motion or its axle, and the angle that it has turned by about an axle.

The force on the body of whatever acts is at its row, or at that of a point of its axle; what holds it gives the
negative, and what the centre of mass takes to go round an axle:

    F = m (α n × r − ω² r) − f,        α = n·M/I,

with the arm r from the axle to the centre of mass, the moment M of all that acts and I about the axle.
"""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...kernels import kernel
from ...net.rotation import matrix_at, times
from ..probes import PROBE, Probe, component_of
from .observable import ANY, Value
from .rotation import Turning


class _Held(Turning):
    """Quantity of a body that a motion or an axle holds."""

    dynamic = False

    def on(self, system):
        """Refuse a body that nothing holds in a way that is known here."""
        super().on(system)
        body = self.body(system.net)
        if not (body.moved or body.axle):
            raise InputError(
                f'quantity = "{self.observe.quantity}": body = "{body.name}" is neither moved by [[motion]] nor on an '
                'axle; the force of contact on it is quantity = "reaction"'
            )

    def of(self, state):
        """Value by its probe, which looks at no lines."""
        probe, lines, where = self.probe(state.system), np.zeros((0, 0)), np.full(2, -1)
        rows, data = np.array(probe.rows, dtype=np.int64), np.ascontiguousarray(probe.data, dtype=float)
        force = state.system.balance(state.time, state.x, state.v).force
        return Value(float(probe.kernel(state.time, state.x, state.v, force, lines, rows, data, where)), None)


class SupportForce(_Held):
    """Force of motion or axle on a body."""

    unit = "N"

    def probe(self, system):
        """Make the probe of x, v and f."""
        body, (component, *_) = self.body(system.net), self.rows(system)
        off = body.pivot is not None and not body.moved
        data = [body.mass if off else 0.0, body.moment, *body.arm, *(body.axle.direction if off else np.zeros(3))]
        turning = (body.spin, body.turn) if off else (-1, -1)
        return Probe(support_force, [component, body.base, *turning], np.array([data]))


class SupportMoment(_Held):
    """Moment of the motion of a body on it, about its position or the point of its axle."""

    unit = "N m"

    def on(self, system):
        """Refuse a body that is not turned by a motion."""
        super().on(system)
        body = self.body(system.net)
        if not body.moved or body.spin is None:
            raise InputError(
                f'quantity = "support_moment": body = "{body.name}" is not turned by [[motion]] rotation = ..., whose '
                "moment it is: give rotation = [[0, 0, 0, 0]] to hold it"
            )

    def probe(self, system):
        """Make the probe of f alone."""
        return Probe(support_moment, self.rows(system)[:2], np.zeros((0, 0)))


class AxleAngle(_Held):
    """Angle that a body has turned by about its axle since the start, of any number of turns."""

    unit, keys = "rad", ("body",)

    def bounds(self, system):
        """Any angle."""
        return ANY

    def on(self, system):
        """Refuse a body without an axle."""
        super().on(system)
        body = self.body(system.net)
        if not body.axle or body.turn is None:
            raise InputError(
                f'quantity = "axle_angle": body = "{body.name}" turns about no axle: give axle = '
                "{ direction = [...] } and, where it is moved, rotation = ..."
            )

    def probe(self, system):
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
def axle_angle(t, x, v, f, lines, rows, data, where):
    """Angle about an axle; ``rows`` is the second row of rotation."""
    return x[rows[0], 1]
