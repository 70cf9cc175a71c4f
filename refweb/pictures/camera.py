"""Cameras: what of a scene goes where on a page, and how to choose a view that shows how a web deforms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

TANGENT = np.tan(np.radians(10.0))
ALONE, LARGE, BELOW = (0.07, 0.08, 0.79, 0.78), (0.02, 0.30, 0.85, 0.60), (0.07, 0.06, 0.79, 0.22)


@dataclass(frozen=True)
class View:
    """A camera: where it is and what of the scene fits into its frame.

    `axes` are the unit vectors to the right, up and towards the viewer, shape (3, 3). In perspective, `centre` is the
    eye [m] and `half` the tangents of half the horizontal and vertical angle; in parallel projection `centre` is a
    point on the line of sight [m] and `half` half the width and height [m].
    """

    axes: np.ndarray
    centre: np.ndarray
    half: tuple
    perspective: bool

    @classmethod
    def fit(cls, axes, points, aspect, tangent=None, margin=1.06):
        """The view that just shows all points [m], shape (points, 3), in a frame of the given width/height.

        `tangent` of half the vertical angle: perspective, from the nearest such eye; None: parallel projection.
        """
        right, up, near = (np.asarray(points) @ np.asarray(axes).T).T
        if tangent is None:
            size = max(np.ptp(up), np.ptp(right) / aspect, 1e-9) * margin / 2
            middle = np.array([right.max() + right.min(), up.max() + up.min(), 2 * near.max()]) / 2
            return cls(axes, middle @ axes, (size * aspect, size), False)
        half, eye, distance = (tangent * aspect, tangent), [], []
        for a, t in zip((right, up), half, strict=True):
            t = t / margin
            low, high = np.max(t * near - a), np.max(t * near + a)
            eye.append((high - low) / 2)
            distance.append((high + low) / (2 * t))
        return cls(axes, np.array([*eye, max(distance)]) @ axes, half, True)

    def project(self, points):
        """Frame coordinates of points [m], shape (…, 3).

        Returns (x, y), shape (…, 2), which span ±half (parallel: plus `offset`, so that they are metres along the
        axes); the depth towards the viewer [m], shape (…); and the frame units per metre there, shape (…).
        """
        local = (np.asarray(points) - self.centre) @ self.axes.T
        depth = local[..., 2]
        scale = 1.0 / np.maximum(-depth, 1e-12) if self.perspective else np.ones_like(depth)
        return local[..., :2] * scale[..., None] + self.offset, depth, scale

    def point(self, x, y, depth):
        """The place [m], shape (3,), at a share −1…1 of half the width and height and at a depth towards the viewer."""
        flat = np.array([x, y]) * self.half * (-depth if self.perspective else 1.0)
        return self.centre + np.array([*flat, depth]) @ self.axes

    @property
    def offset(self):
        """Frame coordinates of the middle of the frame, shape (2,)."""
        return np.zeros(2) if self.perspective else self.axes[:2] @ self.centre

    @property
    def extent(self):
        """Left, right, bottom and top of the frame in frame coordinates."""
        (x, y), (w, h) = self.offset, self.half
        return x - w, x + w, y - h, y + h


def choose(origin, points, solid, moved, tree, aspect):
    """The views that show a web best, and where on the page they stand.

    Parameters
    ----------
    origin : array, shape (n, 3)
        Points of the undeformed web [m].
    points : array, shape (m, 3)
        Points of the web now, or in all frames of a film [m].
    solid : array, shape (k, 3)
        Points of bodies [m]; what is far from the web may lie outside of the pictures.
    moved : float
        Largest component of a displacement [m].
    tree : bool
        Whether the lines close no loop, as those of a cable.
    aspect : float
        Width/height of the page.

    Returns
    -------
    views : list of `View`
        In perspective and from the side; of what lies in a plane, one along its normal. A horizontal web that closes
        loops counts as lying in a plane only once it has moved in it: it may be about to leave it.
    rectangles : list of (left, bottom, width, height)
        Shares of the page.
    """
    extent = np.linalg.norm(np.ptp(points, axis=0))
    low, high = points.min(axis=0) - 0.3 * extent, points.max(axis=0) + 0.3 * extent
    near = np.concatenate([points, solid[np.all((solid >= low) & (solid <= high), axis=1)]])
    normal = _plane(np.concatenate([origin, points]), extent)
    if normal is not None and (abs(normal[2]) < 0.9 or tree or moved > 1e-3 * extent):
        return [View.fit(_facing(normal), near, aspect * ALONE[2] / ALONE[3], margin=1.12)], [ALONE]
    side = _side(origin)
    large = View.fit(_oblique(side), near, aspect * LARGE[2] / LARGE[3], TANGENT)
    return [large, View.fit(side, near, aspect * BELOW[2] / BELOW[3], margin=1.15)], [LARGE, BELOW]


def _facing(normal):
    """Axes of the view along the normal of a plane."""
    up = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    right = _unit(np.cross(up, normal))
    right *= np.sign(right[np.argmax(abs(right))])
    up = _unit(up - (up @ normal) * normal)
    return np.array([right, up, np.cross(right, up)])


def _principal(points):
    """Principal axes of points, longest first, shape (3, 3), and the extents along them, shape (3,)."""
    offset = points - points.mean(axis=0)
    axes = np.linalg.eigh(offset.T @ offset)[1].T[::-1]
    return axes, np.ptp(offset @ axes.T, axis=0)


def _plane(points, extent):
    """Unit normal of the plane that holds all points (of a straight line: the vertical plane), or None."""
    axes, extents = _principal(points)
    if extents[2] > 1e-6 * extent:
        return None
    if extents[1] > 1e-6 * extent:
        return axes[2]
    normal = np.cross(axes[0], [0.0, 0.0, 1.0])
    return _unit(normal) if np.linalg.norm(normal) > 0.1 else np.array([0.0, 1.0, 0.0])


def _side(origin):
    """Axes of the view from the side: along the web, along its normal (z if it is not flat), towards the viewer."""
    axes, extents = _principal(origin)
    normal = axes[2] if extents[2] < 0.05 * extents[0] and extents[1] > 0.05 * extents[0] else np.array([0.0, 0.0, 1.0])
    normal = normal * np.sign(normal[np.argmax(abs(normal))])
    along = np.eye(3)[np.argmax(np.where(abs(normal) < 0.7, np.ptp(origin, axis=0), -1.0))]
    along = _unit(along - (along @ normal) * normal)
    return np.array([along, normal, np.cross(along, normal)])


def _oblique(side):
    """Axes of the view in perspective: a lying web from its front and above, a standing one well from its side."""
    front, azimuth, elevation = (side[2], 28.0, 24.0)
    if abs(side[1, 2]) < 0.7:
        front, azimuth, elevation = side[1] * (-1 if np.argmax(abs(side[1])) == 1 else 1), 50.0, 14.0
    up = np.array([0.0, 0.0, 1.0])
    front = _unit(front - front[2] * up)
    a, e = np.radians((azimuth, elevation))
    near = np.cos(e) * (np.cos(a) * front + np.sin(a) * np.cross(up, front)) + np.sin(e) * up
    right = _unit(np.cross(up, near))
    return np.array([right, np.cross(near, right), near])


def _unit(vector):
    return vector / np.linalg.norm(vector)
