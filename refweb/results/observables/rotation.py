"""Rotation of a body: its orientation, its angular velocity and its angular momentum about its centre.

All components are along the axes x, y and z of the scene.

May change: private functions; how values are computed, in `of` and in the kernels together. Must stay: `W`, the number
of the component "w"; rows and data of a probe in the order that its kernel reads; `Turning`, on which `support` builds;
`Orientation`, which `statics.responses` differentiates; class docstrings (help; after a change write
``validation/REFERENCE.md`` anew) and names in `registry.OBSERVABLES`. Tests:
``tests/results/test_observable_contract.py``, ``tests/dynamics/test_attitude.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from ...kernels import kernel
from ...net.rotation import matrix_at, quaternion_of, times, times_transposed
from ..probes import PROBE, Probe, component_of
from .observable import Observable, Value

if TYPE_CHECKING:
    from ...system.system import System
    from ..state import State
    from .observe import Observe

W = 3
"""Number of the component "w"."""


class Turning(Observable):
    """Rotation of one body."""

    keys: tuple[str, ...] = ("body", "component")
    dynamic = True

    def on(self, system: System) -> None:
        """Refuse an unknown body, and a missing name if there is no body or there are several."""
        if not system.net.bodies:
            raise InputError(f'quantity = "{self.observe.quantity}" needs a [[body]] in the scene')
        self.body(system.net)

    def rows(self, system: System) -> list[int]:
        """Component and rows of rotation of the body, −1 for rows that do not exist."""
        body = self.body(system.net)
        return [self.component, *(-1 if row is None else row for row in (body.spin, body.turn))]

    def _sized(self, vector):
        component = self.observe.component
        return Value(float(np.linalg.norm(vector) if component is None else vector[component]), None)


class Orientation(Turning):
    """Component of the quaternion from x, y, z to the axes of the body; without it the angle from its pose in the web.

    At the start it is the ``orientation`` of the scene, or that of the axes with w ≥ 0. It does not jump. The angle is
    0 to π.
    """

    dynamic = False

    def __init__(self, observe: Observe) -> None:
        super().__init__(observe)
        self.unit = "rad" if observe.component is None else "1"

    def bounds(self, system: System | None) -> tuple[float, float]:
        """Bounds of the value: those of an angle, or of a component of a unit quaternion."""
        return (0.0, math.pi) if self.observe.component is None else (-1.0, 1.0)

    def on(self, system: System) -> None:
        """Refuse a sphere, which has no orientation."""
        super().on(system)
        body = self.body(system.net)
        if body.spin is not None and body.turn is None and not body.shape.planar:
            raise InputError(
                f'body = "{body.name}" has no orientation that is followed: a sphere with one moment of inertia looks '
                "the same however it turns"
            )

    def of(self, state: State) -> Value:
        """Value by the rotation of the body."""
        return Value(self.probe(state.system).at(state, state.x), None)

    def probe(self, system: System) -> Probe:
        """Make the probe of x alone."""
        body, component = self.body(system.net), self.observe.component
        component = -1 if component is None else component
        return Probe(
            orientation,
            [component, *self.rows(system)[1:]],
            np.concatenate([quaternion_of(body.axes.T), body.axes[2]])[None],
        )


class AngularVelocity(Turning):
    """Angular velocity; in a rotating frame, relative to the frame."""

    unit = "rad/s"

    def of(self, state: State) -> Value:
        """Value by momentum and inertia."""
        return self._sized(self.body(state.system.net).turning(state.x, state.v))

    def probe(self, system: System) -> Probe:
        """Make the probe of x and v."""
        body = self.body(system.net)
        whirl = np.eye(3) if body.turn is None else body.axes.T @ body.mobility @ body.axes
        return Probe(angular_velocity, self.rows(system), whirl)


class AngularMomentum(Turning):
    """Angular momentum about the centre of the body; in a rotating frame, by the rotation relative to the frame."""

    unit = "N m s"

    def on(self, system: System) -> None:
        """Refuse a body that tables turn, whose inertia is not known."""
        super().on(system)
        body = self.body(system.net)
        if body.moved and body.spin is not None:
            raise InputError(
                f'quantity = "angular_momentum": body = "{body.name}" is turned by [[motion]] and has no inertia: take '
                '"angular_velocity" times its moment of inertia'
            )

    def of(self, state: State) -> Value:
        """Value by the velocity of its row of rotation."""
        return self._sized(self.body(state.system.net).spin_about_centre(state.x, state.v))

    def probe(self, system: System) -> Probe:
        """Make the probe of v, and on an axle of x."""
        body, (component, spin, turn) = self.body(system.net), self.rows(system)
        return Probe(angular_velocity, [component, spin, turn if body.axle else -1], body.spin_momentum)


@kernel(PROBE)
def orientation(t, x, v, f, lines, rows, data, where):
    """Component of a quaternion, or angle; ``rows`` is (component or −1, rows of rotation), data the start, normal."""
    w, a, b, c = 1.0, 0.0, 0.0, 0.0
    s = rows[1]
    if rows[2] >= 0:
        w, a, b, c = 1.0 + x[rows[2], 0], x[s, 0], x[s, 1], x[s, 2]
    elif s >= 0:
        half = 0.5 * (data[0, 4] * x[s, 0] + data[0, 5] * x[s, 1] + data[0, 6] * x[s, 2])
        size = math.sin(half)
        w, a, b, c = math.cos(half), size * data[0, 4], size * data[0, 5], size * data[0, 6]
    size = math.sqrt(w * w + a * a + b * b + c * c)
    if rows[0] < 0:
        return 2.0 * math.atan2(math.sqrt(a * a + b * b + c * c), abs(w))
    d, p, q, r = data[0, 0], data[0, 1], data[0, 2], data[0, 3]
    if rows[0] == W:
        return (w * d - a * p - b * q - c * r) / size
    if rows[0] == 0:
        return (w * p + a * d + b * r - c * q) / size
    if rows[0] == 1:
        return (w * q - a * r + b * d + c * p) / size
    return (w * r + a * q - b * p + c * d) / size


@kernel(leaf=True)
def turned_with(first, s, q, x, v, data):
    """R W Rᵀ v of a body with rows of rotation s and q; the rows of W begin at ``first`` in data. R is 1 if q < 0."""
    w = v[s, 0], v[s, 1], v[s, 2]
    matrix = (
        (data[first, 0], data[first, 1], data[first, 2]),
        (data[first + 1, 0], data[first + 1, 1], data[first + 1, 2]),
        (data[first + 2, 0], data[first + 2, 1], data[first + 2, 2]),
    )
    if q < 0:
        return times(matrix, w)
    turned = matrix_at(x, s, q)
    return times(turned, times(matrix, times_transposed(turned, w)))


@kernel(PROBE)
def angular_velocity(t, x, v, f, lines, rows, data, where):
    """Kernel of R W Rᵀ v; ``rows`` is (component, rows of rotation), data W along the axes of space at the start.

    Without the second row of rotation R is 1.
    """
    if rows[1] < 0:
        return 0.0
    w = turned_with(0, rows[1], rows[2], x, v, data)
    return component_of(rows[0], w[0], w[1], w[2])
