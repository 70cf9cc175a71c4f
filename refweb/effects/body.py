"""Rigid bodies as a table of the scene."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..messages import shown
from ..net.rigid_body import RigidBody
from ..net.shapes import KINDS
from ..tables import Table, boolean, choice, real, rows, text, vector

NEEDS = {
    "sphere": ("radius",),
    "ring": ("radius", "normal"),
    "box": ("size",),
    "cylinder": ("radius", "length", "axis"),
}
MAY = {"sphere": (), "ring": (), "box": ("axes", "rounding"), "cylinder": ("rounding",)}
"""Keys that a shape needs, and that it may have."""
OWN = {key for keys in (*NEEDS.values(), *MAY.values()) for key in keys}
ROUNDING = 0.02
"""Radius of edges, where none is given, over the smallest size."""


@dataclass(frozen=True, kw_only=True)
class Body(Table):
    """A rigid body, free or fixed; boxes and cylinders are fixed.

    A body moves without turning, but for spheres and rings under friction, which turn, a ring about its normal only. A
    ring is a rigid circle that touches the web as the disc inside it would, at any distance from its plane: how deep a
    point is in it is measured at right angles to its normal. It is meant for webs that move in its plane.

    Parameters
    ----------
    name : str
        Name in observables and files.
    shape : {"sphere", "ring", "box", "cylinder"}
        Its shape.
    radius : float
        Radius of a sphere, a ring or a cylinder [m], > 0.
    normal : sequence of 3 float
        Normal of a ring.
    size : sequence of 3 float
        Edges of a box [m], > 0.
    axes : list of 2 vectors, optional
        Directions of the first two edges of a box, at right angles; by default x and y.
    length : float
        Length of a cylinder [m], > 0.
    axis : sequence of 3 float
        Axis of a cylinder.
    rounding : float, optional
        Radius of the edges of a box or a cylinder [m], > 0, by default `ROUNDING` of its smallest size. Contact that is
        no deeper has a force of one direction.
    mass : float, optional
        Mass [kg], > 0; needed unless the body is fixed.
    position : sequence of 3 float
        Position of its centre [m].
    velocity : sequence of 3 float
        Initial velocity [m/s].
    angular_velocity : sequence of 3 float
        Initial angular velocity [rad/s], which only friction feels; of a ring along its normal.
    inertia : float, optional
        Moment of inertia [kg m²], > 0, by default that of a solid sphere, 2/5 m r², or of a thin ring, m r².
    fixed : bool
        Whether it does not move.

    Raises
    ------
    InputError
        For a key that the shape lacks or does not have, sizes or a mass that are not > 0, axes that are zero or not at
        right angles, a rounding above half the smallest size, and a name that is no file name; for a free body that has
        no mass or is a box or a cylinder, a fixed one that moves, and a ring that turns about another axis than its
        normal; from ``extend``, for a name that stands twice, and a free body in statics.
    """

    several = True

    name: str = text(most=80)
    shape: str = choice(*NEEDS, default="sphere")
    radius: float | None = real(None, above=0, unit="m")
    normal: tuple | None = vector(None)
    size: tuple | None = vector(None, unit="m")
    axes: tuple | None = rows(3, None)
    length: float | None = real(None, above=0, unit="m")
    axis: tuple | None = vector(None)
    rounding: float | None = real(None, above=0, unit="m")
    mass: float | None = real(None, above=0, unit="kg")
    position: tuple = vector(unit="m")
    velocity: tuple = vector((0.0, 0.0, 0.0), unit="m/s")
    angular_velocity: tuple = vector((0.0, 0.0, 0.0), unit="rad/s")
    inertia: float | None = real(None, above=0, unit="kg m²")
    fixed: bool = boolean(False)

    def check(self):
        """Refuse half a shape, a free body without mass, a fixed one that moves, a name that is no file name."""
        for key in NEEDS[self.shape]:
            if getattr(self, key) is None:
                raise InputError(f'{key} is missing: shape = "{self.shape}" needs {key} = ...')
        for key in OWN - {*NEEDS[self.shape], *MAY[self.shape]}:
            if (value := getattr(self, key)) is not None:
                raise InputError(f'{key} = {shown(value)} has no meaning for shape = "{self.shape}"')
        if not self.fixed and self.shape in ("box", "cylinder"):
            raise InputError(
                f'fixed = false: shape = "{self.shape}" must have fixed = true; sphere and ring may be free'
            )
        if not self.fixed and self.mass is None:
            raise InputError("mass is missing: a free body needs mass = ... [kg]; fixed = true holds it")
        for key in ("velocity", "angular_velocity"):
            if self.fixed and any(getattr(self, key)):
                raise InputError(f"{key} = {list(getattr(self, key))} must be zero where fixed = true")
        if not self.name.replace("-", "").replace("_", "").isalnum() or self.name.lower() == "web":
            raise InputError(f'name = "{self.name}" must be letters, digits, - and _, and not "web": it names files')
        if self.size is not None and min(self.size) <= 0.0:
            raise InputError(f"size = {list(self.size)} must be > 0 [m]")
        self._frame()
        if self.rounding is not None and self.rounding > 0.5 * min(self._sizes()):
            raise InputError(f"rounding = {self.rounding:g} must be ≤ {0.5 * min(self._sizes()):g} [m], half the size")
        along = np.linalg.norm(np.cross(self.angular_velocity, self.normal)) if self.shape == "ring" else 0.0
        if along > 1e-9 * np.linalg.norm(self.angular_velocity) * np.linalg.norm(self.normal or 0.0):
            raise InputError(f"angular_velocity = {list(self.angular_velocity)} must be along the normal of the ring")

    def _sizes(self):
        return self.size if self.shape == "box" else (2.0 * self.radius, self.length or math.inf)

    def _frame(self):
        """Unit vectors of the axes, shape (3, 3); of a ring or a cylinder its own comes third."""
        if self.shape == "sphere" or (self.shape == "box" and self.axes is None):
            return np.eye(3)
        if self.shape == "box":
            if len(self.axes) != 2:
                raise InputError(f"axes = {shown(self.axes)} must be two vectors, not {len(self.axes)}")
            first, second = (_unit(f"axes[{i}]", axis) for i, axis in enumerate(self.axes))
            if abs(first @ second) > 1e-6:
                raise InputError(f"axes = {shown(self.axes)} must be at right angles")
            second = _unit("axes", second - (first @ second) * first)
            return np.array([first, second, np.cross(first, second)])
        key = "normal" if self.shape == "ring" else "axis"
        own = _unit(key, getattr(self, key))
        first = np.cross(own, np.eye(3)[np.abs(own).argmin()])
        first /= np.linalg.norm(first)
        return np.array([np.cross(first, own), first, own])

    def _grown(self):
        """(radius of growth, half sizes of the core) of `refweb.effects.contact.signed_distance`."""
        if self.shape == "sphere":
            return self.radius, (0.0, 0.0, 0.0)
        if self.shape == "ring":
            return self.radius, (0.0, 0.0, math.inf)
        edge = self.rounding or ROUNDING * min(self._sizes())
        half = self.size if self.shape == "box" else (2.0 * self.radius, 2.0 * self.radius, self.length)
        return edge, tuple(max(0.5 * size - edge, 0.0) for size in half)

    def extend(self, net):
        """The net with one more row."""
        if any(body.name == self.name for body in net.bodies):
            raise InputError(f'name = "{self.name}" stands twice: names of bodies are unique')
        if not self.fixed and net.quasi_static:
            raise InputError("fixed = false: a free body has no place in statics; fixed = true holds it")
        radius, core = self._grown()
        share = {"sphere": 0.4, "ring": 1.0}.get(self.shape, 0.0)
        body = RigidBody(
            name=self.name,
            row=len(net.points),
            radius=radius,
            velocity=self.velocity,
            fixed=self.fixed,
            kind=KINDS[self.shape],
            core=core,
            axes=tuple(map(tuple, self._frame().tolist())),
            inertia=self.inertia or share * (self.mass or 0.0) * radius**2,
            angular_velocity=self.angular_velocity,
        )
        return replace(
            net,
            points=np.vstack([net.points, self.position]),
            mass=np.append(net.mass, self.mass or 0.0),
            bodies=(*net.bodies, body),
        )


def _unit(name, axis):
    size = np.linalg.norm(axis)
    if not size > 0.0:
        raise InputError(f"{name} = {list(axis)} must not be zero")
    return np.array(axis) / size
