"""Rigid bodies: rows of the unknowns after those of the nodes, and the interface of shapes.

How to write a body shape
-------------------------
A shape is a class whose fields are its keys in ``[[body]]``. All that lies behind a plane, ``my_webs/wall.py``::

    import numpy as np

    from refweb.kernels import kernel
    from refweb.net.rigid_body import Grown, Shape, axes_about
    from refweb.tables import Several, real, table, vector

    @kernel()
    def depth(p, grown):  # at a point along the axes [m]; its gradient; its Hessian [1/m], 00 01 02 11 12 22
        return -p[2], (0.0, 0.0, -1.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    @table
    class Wall(Shape):
        '''All that lies behind a plane through its position.'''
        normal: Several = vector()  # a key that it needs
        drawn: float = real(default=2.0, above=0, unit="m")  # one with a default: edge of the square that is drawn
        def check(self):  # raises `refweb.errors.InputError` for what cannot be, here a normal that is zero
            self.frame()
        def frame(self):  # unit vectors of the axes; where it is left out, by a key axis, normal or axes
            return axes_about("normal", self.normal)
        def grown(self):  # radius of growth, and half sizes of the core: of the box that it fills
            return Grown(0.0, (np.inf, np.inf, np.inf))
        def depth(self):
            return depth
        def boundary(self):  # points and triangles, along the axes
            corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
            return 0.5 * self.drawn * corners, np.array([[0, 1, 2], [0, 2, 3]])

A body is convex. Its depth is the distance from its surface near the surface, and concave, with a continuous gradient:
the force is the gradient of an energy. Therefore edges are rounded. A body is a core and a radius of growth on all
sides, ``grown.radius`` and ``grown.core`` in a kernel. For a core that is a box, whose half sizes may be 0, or round
about its axis, `Shape` has ``depth`` and ``boundary``: ``Grown(radius, (0.0, 0.0, length / 2))`` is a capsule. For
other cores ``farthest`` may give the surface, whose triangles face outward. A shape that may move and turn sets ``free
= True``; without such a core it defines its ``volume()`` and the tensor ``inertia(mass)`` about its centre. A shape
that is not convex has ``depth.convex = False`` and the length ``fine`` of `Grown`, see `refweb.net.shapes.filled`. A
body touches other bodies by its ``skeleton()``, points, lines and arcs of `refweb.net.skeleton`; contact of bodies
refuses a shape without one. An entry point of your package makes it known to scenes; in a script
``refweb.register("shape", "wall", Wall)`` does the same. One that refweb ships is a line in `refweb.registry.SHAPES`::

    [project.entry-points."refweb.shapes"]
    wall = "my_webs.wall:Wall"
"""

# This docstring is a page of the site and of `refweb help own-shape`. May change: its prose. Must stay: its code, which
# tests/how_to/test_body_shape.py runs; names of fields and methods of `Shape` and `Grown`, which shapes of users give
# and kernels of effects.contact read; names of fields of `RigidBody`, which effects, system and results read; rows of
# bodies behind the nodes and rows of rotation behind these, which checkpoints name by `row_names`. Other tests:
# tests/effects/test_contact.py, tests/effects/test_tumbling.py. Must stay as well: `matrix_of`, which
# `dynamics.initial_state` and `effects.body` import; `axes_of`, which `effects.orbit` imports; `Axle`, which
# `effects.axle` imports; `with_rotations`, which `system.system` imports.

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from ..errors import InputError
from ..messages import quote
from ..tables import Table

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from .net import Net


class Grown(NamedTuple):
    """A core about the centre of a body, grown by a radius; a record that kernels read.

    Attributes
    ----------
    radius : float
        Radius of growth [m].
    core : tuple of 3 float
        Half sizes of the core along the body's axes [m]; infinite where it has no end.
    round : bool
        True if the core is a cylinder about the third axis, with the first number as radius; False for a box.
    fine : float
        Length on which the surface may turn [m] for a body that need not be convex; 0 for a convex body.
    thick : float
        Least distance from its middle to its surface [m], if it does not follow from the core.
    field : float
        Address of the numbers of a field, for a body with a field.
    """

    radius: float
    core: tuple[float, float, float]
    round: bool = False
    fine: float = 0.0
    thick: float = 0.0
    field: float = 0.0


class Shape(Table):
    """Shape of a body: its keys in ``[[body]]`` as fields of a table, and the data that follow from them alone.

    Attributes
    ----------
    free : bool
        True if a body of this shape may move.
    once : bool
        True if its core is a point: a sphere has one contact with a line, at the deepest point. Other shapes have
        contacts with each element at both ends and one in between.
    planar : bool
        True if it rotates about its third axis only, about which it is symmetric.
    ground : bool
        True for ground, whose size gives no limit of the penetration.
    error : float, optional
        Largest distance of the surface of contact from the given surface [m], if they differ.
    directions : tuple of str
        Keys of the directions of its axes: of two, ``axes``, or of the third, ``axis`` or ``normal``.
    """

    free = False
    once = False
    planar = False
    ground = False
    error: float | None = None
    directions: ClassVar[tuple[str, ...]] = ("axes", "axis", "normal")

    def grown(self) -> Grown:
        """Its core and the radius of growth, a `Grown`."""
        raise NotImplementedError

    def settle(self) -> None:
        """Read files, and refuse invalid content; called when a net is made."""

    @property
    def extent(self) -> float:
        """Largest distance from its centre to its surface for contact with a web [m]."""
        radius, core, *_ = self.grown()
        return radius + float(np.linalg.norm(core))

    def check(self) -> None:
        """Refuse a direction that is zero, and axes that are not at right angles."""
        if any(getattr(self, key, None) is not None for key in self.directions):
            self.frame()

    def frame(self) -> NDArray[np.float64]:
        """Unit vectors of its axes, right-handed, shape (3, 3), by its key among ``directions``."""
        for key in ("axis", "normal"):
            if hasattr(self, key):
                return axes_about(key, getattr(self, key))
        return axes_of(getattr(self, "axes", None))

    def remarks(self) -> Iterable[str]:
        """Texts of warnings on its input."""
        return ()

    def texts(self) -> Iterable[str]:
        """Texts on it for the box of a scene."""
        return ()

    def volume(self) -> float | None:
        """Its volume [m³]."""
        from .solid import moments

        return moments(self.grown())[0]

    def inertia(self, mass: float) -> NDArray[np.float64]:
        """Tensor of inertia of a uniform mass about its centre [kg m²], along its axes, shape (3, 3)."""
        from .solid import inertia

        return inertia(self.grown(), mass)

    def refuse_turning(self, angular_velocity: Sequence[float]) -> None:
        """Refuse an impossible angular velocity [rad/s]."""

    def depth(self) -> Any:
        """Kernel of its depth, by default `refweb.net.grown_core.depth` for boxes and round cores."""
        from .grown_core import depth

        return depth

    def skeleton(self) -> NDArray[Any] | None:
        """Parts by which it touches other bodies, from `refweb.net.skeleton`; None if it touches none."""
        return None

    def touched(self, thickness: float) -> Grown:
        """The `Grown` for contact with parts of other bodies up to a thickness [m]."""
        return self.grown()

    def farthest(self, normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of the core (n, 3) [m] that are farthest along unit vectors (n, 3)."""
        return np.sign(normals) * self.grown().core

    def boundary(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Its surface about the centre as points (n, 3) [m] and triangles (t, 3), outward."""
        from .surfaces import sphere

        normals, triangles = sphere()
        return self.grown().radius * normals + self.farthest(normals), triangles


ON_AXLE = 1e-12
"""Distance of a body from its axle that counts as rounding, over its coordinates."""


class Axle(NamedTuple):
    """Line that a body turns about.

    Attributes
    ----------
    point : ndarray, shape (3,)
        A point on it [m].
    direction : ndarray, shape (3,)
        Unit vector along it.
    torque : tuple of (t, torque)
        Torque about it over time [N m], linear in between, end values held; empty for none.
    """

    point: NDArray[np.float64]
    direction: NDArray[np.float64]
    torque: tuple[tuple[float, float], ...] = ()

    def arm(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vector from the nearest point of the axle to a position [m], shape (3,)."""
        away = position - self.point
        return away - (away @ self.direction) * self.direction


@dataclass(frozen=True)
class RigidBody:
    """A body of a net.

    Attributes
    ----------
    name : str
        Its name.
    row : int
        Its row of x and v.
    shape : Shape
        Shape of the body.
    velocity : tuple of 3 float
        Initial velocity [m/s].
    fixed : bool
        True if it does not move.
    moved : bool
        True if it moves as tables say.
    axle : Axle, optional
        The axle that it turns about.
    axes : ndarray, shape (3, 3)
        Unit vectors of its axes at the start.
    inertia : ndarray, shape (3, 3)
        Tensor of inertia along its axes [kg m²].
    angular_velocity : tuple of 3 float
        Initial angular velocity [rad/s].
    turns : bool
        True if its rotation is followed.
    spin : int, optional
        Its first row of rotation, if it has one.
    turn : int, optional
        Its second row of rotation, if its orientation counts, see `refweb.net.rotation`.
    carried : tuple of int
        Nodes that it carries; its mass includes theirs.
    points : ndarray, shape (carried, 3)
        Positions of the carried nodes, along its axes from its row [m].
    offset : ndarray, shape (3,)
        Centre of its shape, along its axes from its row [m]; the row is the centre of mass with carried nodes.
    pivot : int, optional
        Row of the point of the axle about which its row turns, if its row is off the axle.
    arm : ndarray, shape (3,)
        Vector from that point to its row at the start [m]; 0 without a pivot.
    mass : float
        Its mass [kg], for a body on an axle.
    """

    name: str
    row: int
    shape: Shape
    velocity: tuple[float, float, float]
    fixed: bool
    axes: NDArray[np.float64] = field(default_factory=lambda: np.eye(3), compare=False)
    inertia: NDArray[np.float64] = field(default_factory=lambda: np.zeros((3, 3)), compare=False)
    angular_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turns: bool = False
    spin: int | None = None
    turn: int | None = None
    carried: tuple[int, ...] = ()
    points: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)), compare=False)
    offset: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3), compare=False)
    moved: bool = False
    axle: Axle | None = field(default=None, compare=False)
    pivot: int | None = None
    arm: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3), compare=False)
    mass: float = 0.0

    @property
    def prescribed(self) -> bool:
        """True if forces do not move it: it is fixed, or tables move it."""
        return self.fixed or self.moved

    @property
    def base(self) -> int:
        """Row of the centre of its rotation: its own, or that of a point of its axle."""
        return self.row if self.pivot is None else self.pivot

    @property
    def radius(self) -> float:
        """Radius of growth of its shape [m]."""
        return self.shape.grown().radius

    @property
    def core(self) -> tuple[float, float, float]:
        """Half sizes of the core of its shape [m]."""
        return self.shape.grown().core

    @property
    def thickness(self) -> float:
        """Least distance from its middle to its surface [m]."""
        return self.shape.grown().thick or self.radius + min(self.core)

    @property
    def extent(self) -> float:
        """Largest distance from its row to its surface for contact with a web [m]; infinite for a ring."""
        return self.shape.extent + float(np.linalg.norm(self.offset))

    @property
    def tumbles(self) -> bool:
        """True if its orientation counts: a free body that is no ring, nor a sphere with one moment of inertia.

        It also counts for a body that carries nodes, and for one that tables move or that turns about an axle.
        """
        if self.moved or self.axle:
            return True
        spherical = (self.inertia == self.inertia[0, 0] * np.eye(3)).all()
        return not (self.fixed or self.shape.planar or self.shape.once and spherical and not self.carried)

    @property
    def moment(self) -> float:
        """Moment of inertia in place of mass [kg m²]: the largest one, or that of a ring about its normal.

        On an axle it is the moment about the axle; for a body that tables move it has no meaning.
        """
        if self.moved:
            return 1.0
        if self.axle:
            return self.moment_about_centre + self.mass * float(self.arm @ self.arm)
        if self.tumbles:
            return float(np.linalg.eigvalsh(self.inertia)[-1])
        return float(self.inertia[2, 2])

    @property
    def moment_about_centre(self) -> float:
        """`moment` about the direction of the axle through the row: without the mass times the squared arm."""
        if self.moved or not self.axle:
            return self.moment
        direction = self.axes @ self.axle.direction
        return float(direction @ self.inertia @ direction)

    @property
    def mobility(self) -> NDArray[np.float64]:
        """Moment of inertia times the inverse of the inertia tensor, along its axes, shape (3, 3).

        On an axle only the part along the axle remains.
        """
        if self.moved:
            return np.eye(3)
        if self.axle:
            direction = self.axes @ self.axle.direction
            return np.outer(direction, direction)
        tensor = self.moment * np.linalg.inv(self.inertia)
        return 0.5 * (tensor + tensor.T)

    @property
    def spin_momentum(self) -> NDArray[np.float64]:
        """The angular momentum about its centre over the velocity of its row of rotation, shape (3, 3) [kg m²].

        This matrix is along x, y and z at the start and turns with a body on an axle; otherwise it is `moment` times 1.
        """
        if not self.axle:
            return self.moment * np.eye(3)
        return self.axes.T @ self.inertia @ self.mobility @ self.axes

    @property
    def start_spin(self) -> tuple[float, float, float] | NDArray[np.float64]:
        """Velocity of its row of rotation at the start [rad/s], see `refweb.net.rotation`; a tuple or an ndarray."""
        if not self.tumbles or self.axle:
            return self.angular_velocity
        return self.axes.T @ (self.inertia @ (self.axes @ self.angular_velocity)) / self.moment

    def rotation(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Matrix of its rotation since the start, at displacements x (rows, 3)."""
        if self.turn is not None:
            return matrix_of((1.0 + x[self.turn, 0], *x[self.spin]))
        if self.shape.planar and self.spin is not None:  # about its normal, by an angle
            angle = float(self.axes[2] @ x[self.spin])
            return matrix_of((np.cos(0.5 * angle), *np.sin(0.5 * angle) * self.axes[2]))
        return np.eye(3)

    def turning(self, x: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Its angular velocity [rad/s] at displacements and velocities of all rows, (rows, 3); along x, y and z."""
        if self.turn is None:
            return np.zeros(3) if self.spin is None else v[self.spin]
        axes = self.axes @ self.rotation(x).T
        return axes.T @ (self.mobility @ (axes @ v[self.spin]))

    def spin_about_centre(self, x: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Its angular momentum about its centre of mass [N m s], arguments as of `turning`; 0 of one that is fixed."""
        if self.spin is None:
            return np.zeros(3)
        turned = self.rotation(x) if self.axle else np.eye(3)
        return turned @ (self.spin_momentum @ (turned.T @ v[self.spin]))

    def surface(
        self, centre: NDArray[np.float64] | Sequence[float], rotation: NDArray[np.float64] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Its surface with its row at a centre: points (n, 3) [m] and triangles (t, 3), outward; turned by a matrix."""
        local, triangles = self.shape.boundary()
        axes = self.axes if rotation is None else self.axes @ rotation.T
        return np.asarray(centre) + (local + self.offset) @ axes, triangles


def row_names(bodies: Sequence[RigidBody]) -> list[str]:
    """Names of the rows after the nodes: of bodies, and, with a dot, of points of axles and rotations."""
    rows = ([f"{b.name}.spin", f"{b.name}.turn"][: 1 + (b.turn is not None)] for b in bodies if b.spin is not None)
    pivots = [f"{body.name}.axle" for body in bodies if body.pivot is not None]
    return [body.name for body in bodies] + pivots + [name for names in rows for name in names]


def with_rotations(net: Net) -> Net:
    """The net with the rows of rotation of its bodies after all others."""
    if net.spins or not any(body.turns for body in net.bodies):
        return net
    net = _with_pivots(net)
    bodies, mass = [], []
    for body in net.bodies:
        if body.turns:
            at, count = len(net.points) + len(mass), 1 + body.tumbles
            mass += count * [0.0 if body.moved else body.moment]
            body = replace(body, spin=at, turn=at + 1 if body.tumbles else None)
        bodies.append(body)
    return replace(
        net,
        points=np.vstack([net.points, np.zeros((len(mass), 3))]),
        mass=np.append(net.mass, mass),
        bodies=tuple(bodies),
        spins=len(mass),
    )


def _with_pivots(net):
    """The net with a row for the point of each axle about which the row of a body turns."""
    bodies, pivots = [], []
    for body in net.bodies:
        if body.axle:
            arm = body.axle.arm(net.points[body.row])
            body = replace(body, mass=float(net.mass[body.row]))
            if np.abs(arm).max() > ON_AXLE * np.abs([net.points[body.row], body.axle.point]).max():
                body = replace(body, pivot=len(net.points) + len(pivots), arm=arm)
                pivots.append(net.points[body.row] - arm)
        bodies.append(body)
    if not pivots:
        return replace(net, bodies=tuple(bodies))
    points, mass = np.vstack([net.points, pivots]), np.append(net.mass, np.zeros(len(pivots)))
    return replace(net, points=points, mass=mass, bodies=tuple(bodies))


def of_size_one(vector: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """A vector over a power of 2 near its largest component, so that its square is neither 0 nor infinite."""
    vector = np.asarray(vector, dtype=float)
    return np.ldexp(vector, -np.frexp(np.abs(vector).max())[1])


def matrix_of(quaternion: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrix of a quaternion (w, x, y, z) of any length but 0."""
    quaternion = of_size_one(quaternion)
    w, *v = quaternion / np.linalg.norm(quaternion)
    a, b, c = v
    across = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
    return np.eye(3) + 2.0 * (w * across + across @ across)


def unit(name: str, axis: Any) -> NDArray[np.float64]:
    """The unit vector along a key's value; zero is refused."""
    vector = of_size_one(axis)
    size = np.linalg.norm(vector)
    if not size > 0.0:
        raise InputError(f"{name} = {list(axis)} must not be zero")
    return vector / size


def axes_about(name: str, axis: Any) -> NDArray[np.float64]:
    """Unit vectors, shape (3, 3), the third along a key's value."""
    if axis is None:
        raise InputError(f"{name} is missing: give {name} = ... or orientation = ...")
    vector = unit(name, axis)
    first: Any = np.cross(vector, np.eye(3)[np.abs(vector).argmin()])
    first /= np.linalg.norm(first)
    return np.array([np.cross(first, vector), first, vector])


def axes_of(axes: Any) -> NDArray[np.float64]:
    """Unit vectors, shape (3, 3), along two given ones at right angles and their cross product; x, y, z for None."""
    if axes is None:
        return np.eye(3)
    if len(axes) != 2:
        raise InputError(f"axes = {quote(axes)} must be two vectors, not {len(axes)}")
    first, second = (unit(f"axes[{i}]", axis) for i, axis in enumerate(axes))
    if abs(first @ second) > 1e-6:
        raise InputError(f"axes = {quote(axes)} must be at right angles")
    second = unit("axes", second - (first @ second) * first)
    return np.array([first, second, np.cross(first, second)])
