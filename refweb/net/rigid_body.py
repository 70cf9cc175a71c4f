"""Rigid bodies: rows of the unknowns after those of the web's nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .shapes import CYLINDER, RING, SPHERE

TUBE = 0.04
"""Thickness of the tube that a ring is drawn as, over its radius."""


@dataclass(frozen=True)
class RigidBody:
    """A body of a net.

    Attributes
    ----------
    name : str
        Its name.
    row : int
        Its row of x and v.
    radius : float
        Radius of a sphere or a ring, of the edges of a box or a cylinder [m].
    velocity : tuple of 3 float
        Initial velocity [m/s].
    fixed : bool
        Whether it does not move.
    kind : int
        Kind of its shape, see `refweb.net.shapes`.
    core : tuple of 3 float
        Half sizes of the core that ``radius`` lets grow [m]; of a cylinder's the radius, twice, and half its length.
    axes : tuple of 3 tuples of 3 float
        Unit vectors of its axes.
    inertia : float
        Moment of inertia [kg m²].
    angular_velocity : tuple of 3 float
        Initial angular velocity [rad/s].
    spin : int, optional
        Its row of rotation, where it has one.
    """

    name: str
    row: int
    radius: float
    velocity: tuple
    fixed: bool
    kind: int = SPHERE
    core: tuple = (0.0, 0.0, 0.0)
    axes: tuple = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    inertia: float = 0.0
    angular_velocity: tuple = (0.0, 0.0, 0.0)
    spin: int | None = None

    @property
    def thickness(self):
        """Least distance from its middle to its surface [m]."""
        return self.radius + min(self.core)

    @property
    def extent(self):
        """Largest distance from its centre to its surface as a web sees it [m]; infinite for a ring."""
        return self.radius + float(np.linalg.norm(self.core))


def row_names(bodies):
    """Names of the rows behind those of the nodes: of bodies, and of their rotations, with a dot."""
    return [body.name for body in bodies] + [f"{body.name}.spin" for body in bodies if body.spin is not None]


def surface(body, centre):
    """Surface of a body as points (n, 3) [m] and triangles (t, 3), outward: a ring is a thin tube."""
    if body.kind == RING:
        local, triangles = _tube(body.radius)
    else:
        sphere, triangles = _sphere()
        local = body.radius * sphere + _corners(body, sphere)
    return np.asarray(centre) + local @ np.array(body.axes), triangles


def _corners(body, normals):
    """Points of the core that are farthest along normals."""
    side = np.sign(normals)
    if body.kind == CYLINDER:
        around = np.linalg.norm(normals[:, :2], axis=1, keepdims=True)
        side[:, :2] = normals[:, :2] / np.where(around > 0.0, around, 1.0)
    return side * body.core


def _sphere():
    """Unit sphere as points and triangles."""
    level = 24
    polar = np.linspace(0.0, np.pi, level // 2 + 1)[1:-1]
    around = np.linspace(0.0, 2.0 * np.pi, level, endpoint=False)
    rings = np.stack(
        [
            np.outer(np.sin(polar), np.cos(around)),
            np.outer(np.sin(polar), np.sin(around)),
            np.outer(np.cos(polar), np.ones(level)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    points = np.vstack([rings, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    here = np.arange(level)
    after = (here + 1) % level
    last, top, bottom = level * (len(polar) - 1), len(rings), len(rings) + 1
    triangles = [np.column_stack([np.full(level, top), here, after])]
    for ring in range(len(polar) - 1):
        triangles += _band(ring * level + here, ring * level + after, level)
    triangles.append(np.column_stack([np.full(level, bottom), last + after, last + here]))
    return points, np.vstack(triangles)


def _tube(radius):
    """Ring about the third axis as points and triangles; its outer edge has the radius."""
    level, sides, thin = 48, 8, TUBE * radius
    around = np.linspace(0.0, 2.0 * np.pi, level, endpoint=False)[:, None]
    across = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    out = radius - thin + thin * np.cos(across)
    points = np.stack([out * np.cos(around), out * np.sin(around), thin * np.sin(across) + 0.0 * around], axis=-1)
    here = np.arange(level * sides).reshape(level, sides)
    after = np.roll(here, -1, axis=1)
    return points.reshape(-1, 3), np.vstack(
        [t for i in range(level) for t in _band(here[i], after[i], here[(i + 1) % level] - here[i])]
    )


def _band(here, after, step):
    """Triangles between a row of points, each with the one after it, and the row a step on."""
    return [np.column_stack([here, here + step, after + step]), np.column_stack([here, after + step, after])]
