"""Rigid bodies: rows of the unknowns after those of the web's nodes, and what a shape has to say.

How to write a body shape
-------------------------
A shape is a file with a class, whose fields are its keys in ``[[body]]``. This one is all that lies behind a plane::

    import numpy as np

    from refweb.kernels import kernel
    from refweb.net.rigid_body import Grown, Shape, axes_about
    from refweb.tables import Several, real, table, vector

    @kernel()
    def depth(p, grown):  # at a point along the axes [m]; its gradient; its Hessian [1/m], 00 01 02 11 12 22
        return -p[2], (0.0, 0.0, -1.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    @table
    class Wall(Shape):
        normal: Several = vector()  # a key that it needs
        drawn: float = real(default=2.0, above=0, unit="m")  # one with a default: edge of the square that is drawn
        def check(self):  # raises `refweb.errors.InputError` for what cannot be, here a normal that is zero
            self.frame()
        def frame(self):  # unit vectors of the axes; x, y and z where it is left out
            return axes_about("normal", self.normal)
        def grown(self):  # radius of growth, and half sizes of the core: of the box that it fills
            return Grown(0.0, (np.inf, np.inf, np.inf))
        def depth(self):
            return depth
        def surface(self):  # points and triangles, along the axes
            corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
            return 0.5 * self.drawn * corners, np.array([[0, 1, 2], [0, 2, 3]])

A body is convex. Its depth is the distance from its surface there, and concave, with a gradient that nowhere jumps: the
force is the slope of an energy. That is why edges are rounded, and a body is a core and the radius by which it has
grown on all sides: ``grown.radius`` and ``grown.core`` in a kernel. If the core is a box, whose half sizes may be 0, or
round about its axis, ``depth`` and ``surface`` are those of `Shape`, and ``Grown(radius, (0.0, 0.0, length / 2))`` is a
capsule; otherwise ``farthest`` may bring the surface, whose triangles face outward. A shape that may move sets
``free = True`` and brings ``inertia``. The line in ``SHAPES`` of ``refweb/registry.py``::

    "wall": "refweb.net.shapes.wall:Wall",
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..tables import Table


class Grown(NamedTuple):
    """A core about the centre of a body, grown by a radius; a record that kernels read.

    Attributes
    ----------
    radius : float
        Radius of growth [m].
    core : tuple of 3 float
        Half sizes of the core along the body's axes [m]; infinite where it has no end.
    round : bool
        Whether the core is a cylinder about the third axis, of the radius that stands first, and not a box.
    """

    radius: float
    core: tuple
    round: bool = False


class Shape(Table):
    """What a body looks like: its keys in ``[[body]]`` as fields of a table, and what follows from them alone.

    Attributes
    ----------
    free : bool
        Whether a body of this shape may move: it looks the same however friction turns it.
    once : bool
        Whether its core is a point: a sphere touches a line once, at the deepest place, other shapes each element at
        both ends and once in between.
    planar : bool
        Whether it turns about its third axis only.
    """

    free = False
    once = False
    planar = False

    def grown(self):
        """Its core and the radius of growth, a `Grown`."""
        raise NotImplementedError

    def frame(self):
        """Unit vectors of its axes, right-handed, shape (3, 3)."""
        return np.eye(3)

    def inertia(self, mass):
        """Moment of inertia of a mass [kg m²], where none is given."""
        return 0.0

    def refuse_turning(self, angular_velocity):
        """Refuse an angular velocity [rad/s] that it cannot have."""

    def depth(self):
        """Kernel of its depth, as `refweb.net.grown_core.depth`, which is that of boxes and of round cores."""
        from .grown_core import depth

        return depth

    def farthest(self, normals):
        """Points of the core (n, 3) [m] that are farthest along unit vectors (n, 3)."""
        return np.sign(normals) * self.grown().core

    def surface(self):
        """Its surface about the centre as points (n, 3) [m] and triangles (t, 3), outward."""
        from .surfaces import sphere

        normals, triangles = sphere()
        return self.grown().radius * normals + self.farthest(normals), triangles


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
        What it looks like.
    velocity : tuple of 3 float
        Initial velocity [m/s].
    fixed : bool
        Whether it does not move.
    inertia : float
        Moment of inertia [kg m²].
    angular_velocity : tuple of 3 float
        Initial angular velocity [rad/s].
    spin : int, optional
        Its row of rotation, where it has one.
    """

    name: str
    row: int
    shape: Shape
    velocity: tuple
    fixed: bool
    inertia: float = 0.0
    angular_velocity: tuple = (0.0, 0.0, 0.0)
    spin: int | None = None

    @property
    def radius(self):
        """Radius of growth of its shape [m]."""
        return self.shape.grown().radius

    @property
    def core(self):
        """Half sizes of the core of its shape [m]."""
        return self.shape.grown().core

    @property
    def thickness(self):
        """Least distance from its middle to its surface [m]."""
        return self.radius + min(self.core)

    @property
    def extent(self):
        """Largest distance from its centre to its surface as a web sees it [m]; infinite for a ring."""
        return self.radius + float(np.linalg.norm(self.core))

    def surface(self, centre):
        """Its surface about a centre as points (n, 3) [m] and triangles (t, 3), outward."""
        local, triangles = self.shape.surface()
        return np.asarray(centre) + local @ self.shape.frame(), triangles


def row_names(bodies):
    """Names of the rows behind those of the nodes: of bodies, and of their rotations, with a dot."""
    return [body.name for body in bodies] + [f"{body.name}.spin" for body in bodies if body.spin is not None]


def unit(name, axis):
    """The unit vector along a key's value; zero is refused."""
    size = np.linalg.norm(axis)
    if not size > 0.0:
        raise InputError(f"{name} = {list(axis)} must not be zero")
    return np.array(axis) / size


def axes_about(name, axis):
    """Unit vectors, shape (3, 3), the third along a key's value."""
    own = unit(name, axis)
    first = np.cross(own, np.eye(3)[np.abs(own).argmin()])
    first /= np.linalg.norm(first)
    return np.array([np.cross(first, own), first, own])
