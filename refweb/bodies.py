"""Rigid bodies: rows of the unknowns after those of the web's nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


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
        Radius of the sphere [m].
    velocity : tuple of 3 float
        Initial velocity [m/s].
    fixed : bool
        Whether it does not move.
    """

    name: str
    row: int
    radius: float
    velocity: tuple
    fixed: bool


def sphere(centre, radius, level=24):
    """Surface of a sphere as points (n, 3) [m] and triangles (t, 3), outward."""
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
        a, b = ring * level, (ring + 1) * level
        triangles.append(np.column_stack([a + here, b + here, b + after]))
        triangles.append(np.column_stack([a + here, b + after, a + after]))
    triangles.append(np.column_stack([np.full(level, bottom), last + after, last + here]))
    return np.asarray(centre) + radius * points, np.vstack(triangles)
