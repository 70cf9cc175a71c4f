"""Elements of a model, the list of all that is drawn of a frame: tubes, balls and surfaces.

May change: `FINE` and `COARSE`, the numbers of sides of tubes. Must stay: fields of `Tubes`, `Balls` and `Surface`,
which `stage` makes and `opengl` and `polygons` draw: a new class needs a function in both; plain values, which travel
to a child process. Tests: ``tests/pictures/test_large.py``, ``tests/pictures/test_pictures.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

FINE, COARSE = 10, 6
"""Sides of a tube in a picture, and in a film."""


@dataclass(frozen=True)
class Tubes:
    """Lines: paths [m], shape (lines, points, 3); colours in 0…1, shape (lines, 3); radius [m], one or (lines,)."""

    paths: np.ndarray
    colours: np.ndarray
    radius: float | np.ndarray


@dataclass(frozen=True)
class Balls:
    """Markers: centres [m], shape (balls, 3); one colour in 0…1; radius [m]."""

    centres: np.ndarray
    colour: tuple[Any, ...]
    radius: float


@dataclass(frozen=True)
class Surface:
    """A body: points [m], shape (points, 3); triangles, shape (triangles, 3); one colour in 0…1."""

    points: np.ndarray
    triangles: np.ndarray
    colour: tuple[Any, ...]
