"""Cameras: projection of points to a page, and the choice of views that show the deformation of a web.

May change: private functions, positions on the page (`ALONE` to `BESIDE`), `TANGENT`, `MANY`, and which view is chosen.
Must stay: names in `VIEWS`, which are values of ``refweb picture --view``; methods of `View`, which `render`,
`polygons`, `stage` and `pages.space` call; `choose`, `outermost` and `MANY`, which `stage` uses; `choose` and `nearby`,
from which `pages.space` takes its first view; a single oblique view stands at `WHOLE`, on which `gym.images` counts.
Tests: ``tests/pictures/test_pictures.py``, ``tests/pictures/test_large.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

TANGENT = np.tan(np.radians(10.0))
ALONE, WHOLE = (0.07, 0.08, 0.79, 0.78), (0.02, 0.04, 0.85, 0.85)
"""Position of a single view [share of the page]: with axes in metres, and without axes."""
LEFT, WIDTH, BOTTOM, HEIGHT, LEAST = 0.07, 0.79, 0.07, 0.79, 0.12
"""Positions of two views one above the other, and the least height of the lower one [share of the page]."""
BESIDE = (0.02, 0.06, 0.40, 0.82), (0.48, 0.08, 0.37, 0.80)
"""Positions on the page of two views side by side [share of the page]."""
MANY = 50_000
"""Number of points above which a view is fitted to the `outermost` of them."""
VIEWS = ("oblique", "side", "front", "top")
"""Names of views: in perspective, from two sides along the web, and along its normal."""


@dataclass(frozen=True)
class View:
    """A camera: its position and the part of the scene in its frame.

    `axes` are the unit vectors to the right, up and towards the viewer, shape (3, 3). In perspective, `centre` is the
    eye [m] and `half` the tangents of half the horizontal and vertical angle; in parallel projection `centre` is a
    point on the line of sight [m] and `half` half the width and height [m].
    """

    axes: np.ndarray
    centre: np.ndarray
    half: tuple[Any, ...]
    perspective: bool

    @classmethod
    def fit(cls, axes, points, aspect, tangent=None, margin=1.06):
        """The closest view that shows all points [m], shape (points, 3), in a frame of the given width/height.

        `tangent` of half the vertical angle is for perspective; None is for parallel projection.
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
        """The point [m], shape (3,), at a share −1…1 of half the width and height and at a depth towards the viewer."""
        flat = np.array([x, y]) * self.half * (-depth if self.perspective else 1.0)
        return self.centre + np.array([*flat, depth]) @ self.axes

    def wider(self, factor):
        """The view enlarged by a factor; the view itself if the factor is below 1."""
        return replace(self, half=tuple(half * factor for half in self.half)) if factor > 1 else self

    def shows(self, points):
        """Tell if a part of the span of these points [m], shape (points, 3), lies within the frame."""
        if not len(points):
            return False
        flat = (self.project(points)[0] - self.offset) / self.half
        return bool(np.all(flat.max(axis=0) > -1) and np.all(flat.min(axis=0) < 1))

    def share(self, points):
        """Share of the frame's width that points [m], shape (points, 3), take."""
        return float(np.ptp(self.project(points)[0][:, 0]) / (2 * self.half[0]))

    @property
    def eye(self):
        """Position of the camera [m], shape (3,)."""
        return self.centre if self.perspective else self.centre + sum(self.half) * self.axes[2]

    @property
    def angle(self):
        """Vertical angle [°]; None in parallel projection."""
        return 2.0 * float(np.degrees(np.arctan(self.half[1]))) if self.perspective else None

    def focus(self, middle=None):
        """Point on the line of sight [m], shape (3,), at the depth of another point, by default 1 m away."""
        return self.eye - (1.0 if middle is None else (self.eye - middle) @ self.axes[2]) * self.axes[2]

    @property
    def offset(self):
        """Frame coordinates of the middle of the frame, shape (2,)."""
        return np.zeros(2) if self.perspective else self.axes[:2] @ self.centre

    @property
    def extent(self):
        """Left, right, bottom and top of the frame in frame coordinates."""
        (x, y), (w, h) = self.offset, self.half
        return x - w, x + w, y - h, y + h


def outermost(points):
    """The points of a set [m], shape (n, 3), that lie farthest in one of many directions."""
    if len(points) <= 300:
        return points
    if len(points) > MANY:
        return outermost(np.concatenate([outermost(points[i : i + MANY]) for i in range(0, len(points), MANY)]))
    count = 150
    height = 1 - 2 * (np.arange(count) + 0.5) / count
    turn = np.pi * (1 + 5**0.5) * np.arange(count)
    ring = np.sqrt(1 - height**2)
    directions = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
    directions = np.concatenate([directions, np.eye(3), -np.eye(3)])
    return points[np.unique((directions.astype("f4") @ points.T.astype("f4")).argmax(axis=1))]


def nearby(points, solid, extent):
    """Points of the web and those of bodies, shape (n, 3) [m], that lie within 0.3 of an extent around it."""
    low, high = points.min(axis=0) - 0.3 * extent, points.max(axis=0) + 0.3 * extent
    return np.concatenate([points, solid[np.all((solid >= low) & (solid <= high), axis=1)]])


def choose(origin, points, solid, moved, tree, aspect, named=None):
    """The views that show a web best, and their positions on the page.

    Parameters
    ----------
    origin : array, shape (n, 3)
        Points of the undeformed web [m].
    points : array, shape (m, 3)
        Points of the deformed web, or of all frames of a film [m].
    solid : array, shape (k, 3)
        Points of bodies [m]; points far from the web may lie outside the picture.
    moved : float
        Largest component of a displacement [m].
    tree : bool
        True if the lines form no closed loop, as in a cable.
    aspect : float
        Width/height of the page.
    named : str or array of 3, optional
        The only view: one of `VIEWS`, or the direction from the web to the viewer.

    Returns
    -------
    views : list of `View`
        One in perspective and one from the side; for a plane web one along its normal. A horizontal web with closed
        loops counts as plane only if it has moved in its plane: otherwise it may be about to leave it.
    rectangles : list of (left, bottom, width, height)
        Shares of the page.
    """
    extent = np.linalg.norm(np.ptp(points, axis=0))
    outer = points if len(points) <= MANY else outermost(points)
    near = nearby(outer, solid, extent)
    side = _side(origin)
    if named is not None:
        if isinstance(named, str) and named == "oblique":
            return [View.fit(_oblique(side), near, aspect * WHOLE[2] / WHOLE[3], TANGENT)], [WHOLE]
        return [View.fit(_named(named, side), near, aspect * ALONE[2] / ALONE[3], margin=1.12)], [ALONE]
    normal = _plane(np.concatenate([origin, points]), extent)
    if normal is not None and (abs(normal[2]) < 0.9 or tree or moved > 1e-3 * extent):
        return [View.fit(_facing(normal), near, aspect * ALONE[2] / ALONE[3], margin=1.12)], [ALONE]
    return _pair(_oblique(side), side, near, outer, aspect)


def _named(named, side):
    """Axes of the view with a name, or from a direction."""
    if isinstance(named, str):
        along, normal, across = side
        return {"side": side, "front": np.array([-across, normal, along]), "top": _facing(normal)}[named]
    near = _unit(np.asarray(named, dtype=float))
    up = np.array([0.0, 0.0, 1.0]) if abs(near[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = _unit(np.cross(up, near))
    return np.array([right, np.cross(near, right), near])


def _pair(oblique, side, near, points, aspect):
    """A view in perspective and one from the side with the same width of the web, one above the other or side by side.

    The height of the lower view gives both the same width; the larger pair of views is chosen.
    """

    def stacked(low):
        rectangles = [(0.02, BOTTOM + 0.04 + low, 0.85, HEIGHT - low), (LEFT, BOTTOM, WIDTH, low)]
        return rectangles, *_fitted(oblique, side, near, aspect, rectangles)

    def excess(low):
        (above, below), *views = stacked(low)
        large, small = views
        return small.share(points) * below[2] - large.share(points) * above[2]

    low, high = LEAST, 0.6 * HEIGHT
    for _ in range(20 if excess(low) < 0 else 0):
        middle = (low + high) / 2
        low, high = (middle, high) if excess(middle) < 0 else (low, middle)
    pair_of_views = [stacked(low), (BESIDE, *_fitted(oblique, side, near, aspect, BESIDE))]
    widths = [min(v.share(points) * r[2] for v, r in zip(views, where, strict=True)) for where, *views in pair_of_views]
    (first, second), large, small = pair_of_views[int(widths[1] > 1.15 * widths[0])]
    wider = small.share(points) * second[2] / (large.share(points) * first[2])
    return [large.wider(1 / wider), small.wider(wider)], [first, second]


def _fitted(oblique, side, near, aspect, rectangles):
    """The view in perspective and the one from the side that fit into two rectangles."""
    first, second = (aspect * r[2] / r[3] for r in rectangles)
    return View.fit(oblique, near, first, TANGENT), View.fit(side, near, second, margin=1.1)


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
    """Unit normal of the plane that contains all points, for a straight line the vertical plane; or None."""
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
    """Axes of the view in perspective: from front and above for a lying web, from the side for a standing web."""
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
