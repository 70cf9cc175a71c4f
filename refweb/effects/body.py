"""Rigid bodies as a table of the scene."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, fields, replace

import numpy as np

from ..errors import InputError
from ..messages import shown
from ..net.rigid_body import RigidBody, Shape
from ..registry import SHAPES, load
from ..tables import Several, Table, boolean, choice, field, real, refuse_keys, text, vector


def _keys(shape):
    """Names of the keys of a shape."""
    return [f.name for f in fields(load(SHAPES[shape]))]


def _given(name, value):
    return value


@dataclass(frozen=True, kw_only=True, init=False)
class Body(Table):
    """A rigid body, free or fixed; its shape has keys of its own.

    A body moves without turning, but for spheres and rings under friction, which turn, a ring about its normal only. A
    ring is a rigid circle that touches the web as the disc inside it would, at any distance from its plane: how deep a
    point is in it is measured at right angles to its normal. It is meant for webs that move in its plane.

    Parameters
    ----------
    name : str
        Name in observables and files.
    shape : {"sphere", "ring", "box", "cylinder", "capsule"}
        Its shape, of `refweb.registry.SHAPES`; "sphere" by default.
    radius : float
        Radius of a sphere, a ring, a cylinder or a capsule [m], > 0.
    normal : sequence of 3 float
        Normal of a ring.
    size : sequence of 3 float
        Edges of a box [m], > 0.
    axes : list of 2 vectors, optional
        Directions of the first two edges of a box, at right angles; by default x and y.
    length : float
        Length of a cylinder, or of a capsule between the centres of its ends [m], > 0.
    axis : sequence of 3 float
        Axis of a cylinder or a capsule.
    rounding : float, optional
        Radius of the edges of a box or a cylinder [m], > 0, by default 2 % of its smallest size.
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
        no mass or is a box, a cylinder or a capsule, a fixed one that moves, and a ring that turns about another axis
        than its normal; from ``extend``, for a name that is listed twice, and a free body in statics.

    Examples
    --------
        [[body]]
        name = "ball"
        radius = 0.1
        mass = 1.0
        position = [0.0, 0.0, -0.11]
        velocity = [0.0, 0.0, 2.0]
    """

    several = True

    name: str = text(most=80)
    shape: str = choice(SHAPES, default="sphere")
    form: Shape = field(_given, default=None)  # the keys of the shape, as its own table
    mass: float | None = real(default=None, above=0, unit="kg")
    position: Several = vector(unit="m")
    velocity: Several = vector(default=(0.0, 0.0, 0.0), unit="m/s")
    angular_velocity: Several = vector(default=(0.0, 0.0, 0.0), unit="rad/s")
    inertia: float | None = real(default=None, above=0, unit="kg m²")
    fixed: bool = boolean(default=False)

    def __init__(self, **given):
        form = given.pop("form", None)  # of the body that this one is a copy of
        own = {f.name: getattr(form, f.name) for f in fields(form)} if form else {}
        refuse_keys(type(self), {**own, **given})
        for f in fields(self):
            object.__setattr__(self, f.name, given.pop(f.name, f.default))
        object.__setattr__(self, "form", {**own, **given})
        self.__post_init__()

    def __getattr__(self, key):
        form = self.__dict__.get("form")
        if isinstance(form, Shape) and key in _keys(self.shape):
            return getattr(form, key)
        raise AttributeError(f"'Body' object has no attribute {key!r}")

    @classmethod
    def keys(cls, given):
        """Names of its keys: its own with those of its shape in their place, of all shapes where one is none of them.

        What ``given`` does not ask for is not imported.
        """

        def among(*shapes):
            own = dict.fromkeys(key for shape in shapes for key in _keys(shape))
            return [key for f in fields(cls) for key in (own if f.name == "form" else [f.name])]

        shape = given.get("shape", "sphere")
        known = among(shape) if isinstance(shape, str) and shape in SHAPES else []
        return known if given.keys() <= set(known) else among(*SHAPES)

    def to_dict(self):
        """The table as plain TOML values, the keys of the shape among the others."""
        pairs = super().to_dict().items()
        return {k: v for key, value in pairs for k, v in (value.items() if key == "form" else [(key, value)])}

    def check(self):
        """Refuse half a shape, a free body without mass, a fixed one that moves, a name that is no file name."""
        object.__setattr__(self, "form", self._form())
        if not self.fixed and not self.form.free:
            free = [shape for shape, reference in SHAPES.items() if load(reference).free]
            raise InputError(
                f'fixed = false: shape = "{self.shape}" must have fixed = true; {" and ".join(free)} may be free'
            )
        if not self.fixed and self.mass is None:
            raise InputError("mass is missing: a free body needs mass = ... [kg]; fixed = true holds it")
        for key in ("velocity", "angular_velocity"):
            if self.fixed and any(getattr(self, key)):
                raise InputError(f"{key} = {list(getattr(self, key))} must be zero where fixed = true")
        if not self.name.replace("-", "").replace("_", "").isalnum() or self.name.lower() == "web":
            raise InputError(f'name = "{self.name}" must be letters, digits, - and _, and not "web": it names files')
        self.form.refuse_turning(self.angular_velocity)

    def _form(self):
        """The table of the shape, from what is given of its keys."""
        kind, noted = load(SHAPES[self.shape]), vars(self)["form"]  # by `__init__`, a dict
        given = {key: value for key, value in noted.items() if value is not None}
        for f in fields(kind):
            if f.default is MISSING and f.name not in given:
                raise InputError(f'{f.name} is missing: shape = "{self.shape}" needs {f.name} = ...')
        for key in given.keys() - _keys(self.shape):
            raise InputError(f'{key} = {shown(given[key])} has no meaning for shape = "{self.shape}"')
        return kind(**given)

    def extend(self, net):
        """The net with one more row."""
        if any(body.name == self.name for body in net.bodies):
            raise InputError(f'name = "{self.name}" is listed twice: names of bodies are unique')
        if not self.fixed and net.quasi_static:
            raise InputError("fixed = false: a free body cannot be used in statics; fixed = true holds it")
        body = RigidBody(
            name=self.name,
            row=len(net.points),
            shape=self.form,
            velocity=self.velocity,
            fixed=self.fixed,
            inertia=self.inertia or self.form.inertia(self.mass or 0.0),
            angular_velocity=self.angular_velocity,
        )
        return replace(
            net,
            points=np.vstack([net.points, self.position]),
            mass=np.append(net.mass, self.mass or 0.0),
            bodies=(*net.bodies, body),
        )
