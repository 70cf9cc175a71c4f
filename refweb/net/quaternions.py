"""Rotations as quaternions (w, x, y, z) of any length but zero, and as rotation vectors [rad], in Python.

May change: how they are computed. Must stay: the order (w, x, y, z) and rotation vectors in rad, which scenes,
`effects.motion` and `dynamics.controllers` have. `net.rotation` has the same for compiled code. Must stay as well:
`of_vector` and `product`, which `dynamics.controllers` and `effects.motion` import; `interpolated` and
`rotation_between`, which `dynamics.controllers` imports. Tests: ``tests/dynamics/test_attitude.py``,
``tests/effects/test_moved_bodies.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def of_vector(vector: ArrayLike) -> NDArray[np.float64]:
    """Unit quaternion of a rotation vector, by its direction and half of its size."""
    size = np.linalg.norm(vector)
    return np.array([np.cos(0.5 * size), *(0.5 * np.sinc(0.5 * size / np.pi) * np.asarray(vector))])


def product(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Product of two quaternions: the rotation q, and then p."""
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def rotation_between(second: NDArray[np.float64], first: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation vector of the shortest rotation from the first orientation to the second, along the axes of space."""
    w, *along = product(second, first * [1.0, -1.0, -1.0, -1.0])
    vector, size = np.array(along), np.linalg.norm(along)
    angle = 2.0 * np.arctan2(size, abs(w))
    return (np.copysign(angle, w) / size if size > 0.0 else 0.0) * vector


def interpolated(time: float, times: NDArray[np.float64], orientations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orientation at a time, by the shortest rotation at constant rate between two rows; end values are held."""
    n = int(np.clip(np.searchsorted(times, time, "right") - 1, 0, max(len(times) - 2, 0)))
    if len(times) == 1 or not times[n] < time:
        return orientations[n]
    share = min((time - times[n]) / (times[n + 1] - times[n]), 1.0)
    return product(of_vector(share * rotation_between(orientations[n + 1], orientations[n])), orientations[n])
