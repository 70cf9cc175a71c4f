"""Rigid bodies as a table of the scene.

May change: private functions, checks and their messages, and `EVEN`, a tolerance of these. Must stay: keys and
docstring of `Body` (scene format and help; after a change write ``validation/REFERENCE.md`` anew), to which each class
in `registry.SHAPES` adds its fields; rows of bodies in the order of their tables, behind all nodes;
`Body.without_mass`, which `build` reads; the fields of `refweb.net.rigid_body.RigidBody` that `extend` fills. Tests:
``tests/effects/test_contact.py``, ``tests/effects/test_faulty_bodies.py``.
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..accepted import accepts, any_of, array, limits
from ..errors import InputError
from ..messages import quote
from ..net.rigid_body import RigidBody, Shape, matrix_of, unit
from ..registry import SHAPES, known, load
from ..tables import (
    LARGEST,
    Several,
    Table,
    boolean,
    checked,
    choice,
    field,
    numbers_list,
    part,
    real,
    refuse_keys,
    rows,
    text,
    vector,
)

if TYPE_CHECKING:
    from ..net.net import Net

EVEN = 1e-9
"""Relative tolerance of conditions on moments of inertia: they may come from a CAD program with few digits."""


def _keys(shape):
    """Names of the keys of a shape."""
    return [f.name for f in fields(load(SHAPES[shape]))]


def _given(name, value):
    return value


_number = limits("number", at_least=-LARGEST, at_most=LARGEST)
_moment = real(above=0, unit="kg m²")


@accepts(any_of(_moment.metadata["read"].accepts, array(_number, 3, 3), array(array(_number, 3, 3), 3, 3)))
def _inertia(name, value):
    """Read a moment of inertia, three of them, or a symmetric tensor; as a number, or as three rows."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if not isinstance(value, (list, tuple)):
        return checked(name, value, _moment)
    if len(value) != 3:
        raise InputError(f"{name} = {quote(value)} must be a number, three, or 3 rows of 3 [kg m²]")
    if not isinstance(value[0], (list, tuple)):
        tensor = np.diag(checked(name, value, numbers_list()))
    else:
        tensor = np.array(checked(name, value, rows(3)))
    if not np.abs(tensor - tensor.T).max() <= EVEN * np.abs(tensor).max():
        raise InputError(f"{name} = {quote(value)} must be symmetric")
    smallest, middle, largest = np.linalg.eigvalsh(tensor)
    if not smallest > 0.0:
        raise InputError(
            f"{name} = {quote(value)} must be positive definite: its principal moments begin at {smallest:g}"
        )
    if not largest <= (1.0 + EVEN) * (smallest + middle):
        raise InputError(
            f"{name} = {quote(value)} is no body's: the largest principal moment {largest:g} must be ≤ "
            f"{smallest + middle:g} [kg m²], the sum of the others"
        )
    return tuple(tuple(row) for row in (0.5 * (tensor + tensor.T)).tolist())


@accepts(array(_number, 4, 4))
def _quaternion(name, value):
    """Read a quaternion that is not zero."""
    quaternion = checked(name, value, numbers_list())
    if len(quaternion) != 4:
        raise InputError(f"{name} = {quote(value)} must be a quaternion [w, x, y, z], not {len(quaternion)} numbers")
    if not any(quaternion):
        raise InputError(f"{name} = {quote(value)} must not be zero")
    return quaternion


@dataclass(frozen=True, kw_only=True, init=False)
class Body(Table):
    """A rigid body, free, fixed, on an axle or moved by ``[[motion]]``; its shape has keys of its own.

    A free body moves and rotates in space. A ring is an exception: it keeps its plane and rotates about its normal
    only. It is a rigid circle that touches the web as the disc inside it would, at any distance from its plane. The
    depth of a point is measured at right angles to the normal. A ring is meant for webs that move in its plane.

    In statics a free body rests where forces and moments on it balance, if it touches the web, or carries nodes by
    ``[[attach]]``. Newton's method goes downhill from where its table has it, so that a ball begins in the net, or next
    to it. A rotation at no cost, as of a beam on two ropes about its own line, is a remark. Balls and rings do not
    turn.

    Parameters
    ----------
    name : str
        Name in observables and files.
    shape : {"sphere", "ring", "box", "cylinder", "capsule", "mesh", "plane", "terrain"}
        Shape, one of `refweb.registry.SHAPES`; "sphere" by default.
    radius : float
        Radius of a sphere, a ring, a cylinder or a capsule [m], > 0.
    normal : sequence of 3 float
        Normal of a ring; for a plane the direction away from the ground.
    size : sequence of 3 float
        Edges of a box [m], > 0.
    axes : list of 2 vectors, optional
        Directions of the first two edges of a box, or of the first two axes of a file, at right angles; by default x
        and y. The third axis follows.
    length : float
        Length of a cylinder, or of a capsule between the centres of its ends [m], > 0.
    axis : sequence of 3 float
        Axis of a cylinder or a capsule, the third of its axes.
    rounding : float, optional
        Radius of the edges of a box or a cylinder [m], > 0, by default 2 % of its smallest size.
    file : str
        For a mesh: STL, OBJ or VTP file of its surface, relative to the scene's folder.
    scale : float
        For a mesh or terrain: metres per unit of its file, > 0; 1 by default.
    surface : {"file", "hull"}
        For a mesh: "hull" takes the convex hull of the surface in the file.
    drawn : float
        For a plane: edge of the square that is drawn [m], > 0; 2 by default.
    heights : str
        For terrain: CSV file of heights, with the columns x, y and z, or OBJ, STL or VTP file of an open surface,
        relative to the scene's folder.
    thickness : float, optional
        For terrain: depth of the ground below its lowest point [m], > 0; by default a quarter of its longest side.
    grid : int, optional
        For a mesh or terrain: number of cells, along the longest side, of the grid of depth; by default 48, or more if
        the thinnest wall needs them.
    orientation : sequence of 4 float, optional
        In place of ``axes`` or ``axis``: the quaternion (w, x, y, z), of any length but 0, of the rotation that takes
        x, y and z to the body's axes.
    mass : float, optional
        Mass [kg], > 0; it or the density is needed unless the body is fixed, or moved by ``[[motion]]``.
    density : float, optional
        Density of a solid body [kg/m³], > 0, in place of the mass.
    position : sequence of 3 float
        Position of its centre of mass [m]. For a mesh this is the centre of a uniform solid. For a plane it is any
        point on it, for terrain the position of the origin of its file.
    velocity : sequence of 3 float
        Initial velocity [m/s].
    angular_velocity : sequence of 3 float
        Initial angular velocity along x, y and z [rad/s]; for a ring along its normal.
    inertia : float or list, optional
        Moments of inertia about its centre [kg m²]: one number, three about its axes, or the symmetric 3 × 3 tensor
        along them; for a ring that about its normal. By default those of a uniform solid with its rounded edges, and
        m r² for a ring.
    fixed : bool
        True if it does not move.
    axle : BodyAxle, optional
        Axle that it turns about, ``{ point = ..., direction = ..., torque = ... }``, freely or by ``[[motion]]``. Its
        place and its rotation follow from the angle alone. Statics finds the angle at which it rests, by method =
        "newton".

    Raises
    ------
    InputError
        For a key that the shape lacks or does not have, sizes, a mass or a density that are not > 0, both of these,
        axes that are zero or not at right angles, or that are given twice, an orientation that is zero, a rounding
        above half the smallest size, an inertia that no body has (not symmetric, not positive definite, or one
        principal moment above the sum of the others), and a name that is no file name; for a free body without mass, a
        fixed one that moves, and a ring that turns about another axis than its normal; for an axle of a fixed body or a
        ring, and a velocity that it does not allow; from ``extend``, for a name that is listed twice, and in
        statics for a velocity.

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

    name: str = text(limit=80)
    shape: str = choice(SHAPES, default="sphere")
    form: Shape = field(_given, default=None)  # the keys of the shape, as its own table
    orientation: Several = field(_quaternion, default=None)
    mass: float | None = real(default=None, above=0, unit="kg")
    density: float | None = real(default=None, above=0, unit="kg/m³")
    position: Several = vector(unit="m")
    velocity: Several = vector(default=(0.0, 0.0, 0.0), unit="m/s")
    angular_velocity: Several = vector(default=(0.0, 0.0, 0.0), unit="rad/s")
    inertia: Several = field(_inertia, default=None, unit="kg m²")
    fixed: bool = boolean(default=False)
    axle: Any = part("refweb.effects.axle:BodyAxle")

    def __init__(self, **given: Any) -> None:
        form = given.pop("form", None)  # of the body that this one is a copy of
        values = {f.name: getattr(form, f.name) for f in fields(form)} if form else {}
        refuse_keys(type(self), {**values, **given})
        for f in fields(self):
            object.__setattr__(self, f.name, given.pop(f.name, f.default))
        object.__setattr__(self, "form", {**values, **given})
        self.__post_init__()

    def __getattr__(self, key: str) -> Any:
        form = self.__dict__.get("form")
        if isinstance(form, Shape) and key in _keys(self.shape):
            return getattr(form, key)
        raise AttributeError(f"'Body' object has no attribute {key!r}")

    @classmethod
    def keys(cls, given: dict[str, Any]) -> list[str]:
        """Names of the keys for a shape, or of all shapes if a key in ``given`` belongs to another one.

        Shapes that ``given`` does not need are not imported.
        """

        def among(*shapes):
            keys = dict.fromkeys(key for shape in shapes for key in _keys(shape))
            return [key for f in fields(cls) for key in (keys if f.name == "form" else [f.name])]

        shape = given.get("shape", "sphere")
        keys = among(shape) if isinstance(shape, str) and known(SHAPES, shape) else []
        return keys if given.keys() <= set(keys) else among(*SHAPES)

    def to_dict(self) -> dict[str, Any]:
        """The table as plain TOML values, the keys of the shape among the others."""
        pairs = super().to_dict().items()
        return {k: v for key, value in pairs for k, v in (value.items() if key == "form" else [(key, value)])}

    def check(self) -> None:
        """Refuse an incomplete shape, a free body without mass, a fixed body that moves, and a bad name."""
        object.__setattr__(self, "form", self._form())
        if not self.fixed and not self.form.free and not self.moved:
            free = [shape for shape, reference in SHAPES.items() if load(reference).free]
            raise InputError(
                f'fixed = false: shape = "{self.shape}" must have fixed = true; '
                f"{', '.join(free[:-1])} and {free[-1]} may be free"
            )
        if self.mass is not None and self.density is not None:
            raise InputError(f"mass = {self.mass:g} and density = {self.density:g} exclude each other")
        if self.density is not None:
            self.form.volume()  # which a ring has not
        if self.moved and (any(self.velocity) or any(self.angular_velocity)):
            raise InputError(self.without_mass)
        self._refuse_tensor()
        for key in ("velocity", "angular_velocity"):
            if self.fixed and any(getattr(self, key)):
                raise InputError(f"{key} = {list(getattr(self, key))} must be zero where fixed = true")
        if not self.name.replace("-", "").replace("_", "").isalnum() or self.name.lower() == "web":
            raise InputError(f'name = "{self.name}" must be letters, digits, - and _, and not "web": it names files')
        self.form.refuse_turning(self.angular_velocity)
        if self.axle:
            self._refuse_axle()

    @property
    def moved(self) -> bool:
        """True if it is not fixed and has no mass: then ``[[motion]]`` has to move it."""
        return not self.fixed and self.mass is None and self.density is None

    @property
    def without_mass(self) -> str:
        """Reason for which it is refused without mass where nothing moves it."""
        return (
            "mass is missing: a free body needs mass = ... [kg] or density = ... [kg/m³]; fixed = true holds it, and "
            f"[[motion]] body = {quote(self.name)} moves it"
        )

    def _refuse_axle(self):
        """Refuse an axle of what cannot turn, and velocities that it does not allow."""
        if self.fixed or self.form.planar:
            reason = "where fixed = true" if self.fixed else f'for shape = "{self.shape}", which keeps its plane'
            raise InputError(f"axle = {quote(self.axle.to_dict())} has no meaning {reason}: leave it out")
        if any(self.velocity):
            raise InputError(
                f"velocity = {list(self.velocity)} must be zero with axle: a body on an axle only turns; give "
                "angular_velocity along its direction"
            )
        direction, omega = unit("direction", self.axle.direction), np.array(self.angular_velocity)
        if np.linalg.norm(np.cross(direction, omega)) > EVEN * np.linalg.norm(omega):
            raise InputError(
                f"angular_velocity = {list(self.angular_velocity)} must be along axle.direction = "
                f"{list(self.axle.direction)}: give a multiple of it"
            )

    def _refuse_tensor(self):
        """Refuse axes that are missing or given twice, and more than one moment of inertia of a ring."""
        given = [key for key in self.form.directions if getattr(self.form, key, None) is not None]
        if self.orientation is None:
            self.form.frame()
        elif given:
            raise InputError(f"orientation = {quote(self.orientation)} and {given[0]} exclude each other: give one")
        if self.form.planar and isinstance(self.inertia, tuple):
            raise InputError(f'inertia = {quote(self.inertia)} must be a number for shape = "{self.shape}"')

    def _form(self):
        """The table of the shape, from the given keys."""
        kind, noted = load(SHAPES[self.shape]), vars(self)["form"]  # by `__init__`, a dict
        given = {key: value for key, value in noted.items() if value is not None}
        for f in fields(kind):
            if f.default is MISSING and f.name not in given:
                raise InputError(f'{f.name} is missing: shape = "{self.shape}" needs {f.name} = ...')
        for key in given.keys() - _keys(self.shape):
            raise InputError(f'{key} = {quote(given[key])} has no meaning for shape = "{self.shape}"')
        return kind(**given)

    def extend(self, net: Net) -> Net:
        """The net with one more row."""
        if any(body.name == self.name for body in net.bodies):
            raise InputError(f'name = "{self.name}" is listed twice: names of bodies are unique')
        for key in ("velocity", "angular_velocity"):
            if net.quasi_static and any(getattr(self, key)):
                raise InputError(f"{key} = {list(getattr(self, key))} has no meaning in statics: leave it out")
        self.form.settle()
        mass = self.mass or (self.density * (self.form.volume() or 0.0) if self.density else 0.0)
        body = RigidBody(
            name=self.name,
            row=len(net.points),
            shape=self.form,
            velocity=self.velocity,
            fixed=self.fixed,
            axes=self.form.frame() if self.orientation is None else matrix_of(self.orientation).T,
            inertia=self._tensor(mass),
            angular_velocity=self.angular_velocity,
            moved=self.moved,
            axle=self.axle and self.axle.at(self.position),
        )
        turns = not body.moved and body.tumbles
        return replace(
            net,
            points=np.vstack([net.points, self.position]),
            mass=np.append(net.mass, mass),
            bodies=(*net.bodies, replace(body, turns=turns or any(self.angular_velocity))),
        )

    def _tensor(self, mass):
        """Tensor of inertia of a free body; zero of one that is fixed or moved."""
        if self.fixed or self.moved:
            return np.zeros((3, 3))
        if self.inertia is None:
            return self.form.inertia(mass)
        return np.array(self.inertia) if isinstance(self.inertia, tuple) else self.inertia * np.eye(3)
