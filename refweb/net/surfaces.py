"""Surfaces of a sphere and a tube as points and triangles, outward, for drawing.

May change: private functions, the number of triangles: only pictures, frames and `commands.doubts` use surfaces. Must
stay: points and triangles that face outward, which `rigid_body` and `shapes.ring` return as ``boundary``.
"""

from __future__ import annotations

import functools

import numpy as np


@functools.cache
def sphere(level=24):
    """Unit sphere as points and triangles, ``level`` around; the arrays must not be changed."""
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
    indices = np.arange(level)
    after = (indices + 1) % level
    last, top, bottom = level * (len(polar) - 1), len(rings), len(rings) + 1
    triangles = [np.column_stack([np.full(level, top), indices, after])]
    for ring in range(len(polar) - 1):
        triangles += _band(ring * level + indices, ring * level + after, level)
    triangles.append(np.column_stack([np.full(level, bottom), last + after, last + indices]))
    return _fixed(points), _fixed(np.vstack(triangles))


@functools.cache
def tube(radius, thin):
    """Tube about the third axis with an outer radius and a thickness, as `sphere`."""
    level, sides = 48, 8
    around = np.linspace(0.0, 2.0 * np.pi, level, endpoint=False)[:, None]
    across = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    out = radius - thin + thin * np.cos(across)
    points = np.stack([out * np.cos(around), out * np.sin(around), thin * np.sin(across) + 0.0 * around], axis=-1)
    indices = np.arange(level * sides).reshape(level, sides)
    after = np.roll(indices, -1, axis=1)
    triangles = [t for i in range(level) for t in _band(indices[i], after[i], indices[(i + 1) % level] - indices[i])]
    return _fixed(points.reshape(-1, 3)), _fixed(np.vstack(triangles))


def _fixed(values):
    values.flags.writeable = False
    return values


def _band(ring, after, step):
    """Triangles between a closed row of points and the next row."""
    return [np.column_stack([ring, ring + step, after + step]), np.column_stack([ring, after + step, after])]
