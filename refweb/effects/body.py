"""Rigid bodies as a table of the scene."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..bodies import RigidBody
from ..inputs import InputError, Table, boolean, choice, real, text, vector


@dataclass(frozen=True, kw_only=True)
class Body(Table):
    """A rigid sphere, free in translation or fixed.

    Parameters
    ----------
    name : str
        Name in observables and files.
    shape : {"sphere"}
        Its shape.
    radius : float
        Radius [m], > 0.
    mass : float, optional
        Mass [kg], > 0; needed unless the body is fixed.
    position : sequence of 3 float
        Position of its centre [m].
    velocity : sequence of 3 float
        Initial velocity [m/s].
    fixed : bool
        Whether it does not move.
    """

    name: str = text(most=80)
    shape: str = choice("sphere", default="sphere")
    radius: float = real(above=0, unit="m")
    mass: float | None = real(None, above=0, unit="kg")
    position: tuple = vector(unit="m")
    velocity: tuple = vector((0.0, 0.0, 0.0), unit="m/s")
    fixed: bool = boolean(False)

    def check(self):
        """Refuse a free body without mass, a fixed one with velocity, a name that is no file name."""
        if not self.fixed and self.mass is None:
            raise InputError("mass is missing: a free body needs mass = ... [kg]; fixed = true holds it")
        if self.fixed and any(self.velocity):
            raise InputError(f"velocity = {list(self.velocity)} must be zero where fixed = true")
        if not self.name.replace("-", "").replace("_", "").isalnum() or self.name.lower() == "web":
            raise InputError(f'name = "{self.name}" must be letters, digits, - and _, and not "web": it names files')

    def extend(self, net):
        """The net with one more row."""
        if any(body.name == self.name for body in net.bodies):
            raise InputError(f'name = "{self.name}" stands twice: names of bodies are unique')
        if not self.fixed and net.quasi_static:
            raise InputError("fixed = false: a free body has no place in statics; fixed = true holds it")
        body = RigidBody(self.name, len(net.points), self.radius, self.velocity, self.fixed)
        return replace(
            net,
            points=np.vstack([net.points, self.position]),
            mass=np.append(net.mass, self.mass or 0.0),
            bodies=(*net.bodies, body),
        )
