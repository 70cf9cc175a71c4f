"""Tubes, balls and surfaces as depth-sorted polygons of matplotlib, for machines without OpenGL.

May change: all of the drawing, and `PIECES`. Must stay: `polygons` and `flat_images`, which `pictures`, `film` and
`gym.images` call where `render` gives None; a function for each class of `model`. Tests:
``tests/pictures/test_pictures.py``.
"""

from __future__ import annotations

import numpy as np

from ..net.surfaces import sphere
from .model import Balls, Surface

PIECES = 3000
"""Number of polygons up to which long lines and large triangles are cut for depth sorting."""


def flat_images(model, views, sizes):
    """A model in each view, RGB, shape (height, width, 3), uint8, as `refweb.pictures.render.Renderer` gives it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    images = []
    for view, (width, height) in zip(views, sizes, strict=True):
        page = Figure(figsize=(width / 100, height / 100), dpi=100)
        axes = page.add_axes((0, 0, 1, 1))
        axes.axis("off")
        polygons(axes, model, view, height)
        axes.set(xlim=view.extent[:2], ylim=view.extent[2:])
        canvas = FigureCanvasAgg(page)
        canvas.draw()
        images.append(np.asarray(canvas.buffer_rgba())[..., :3].copy())
    return images


def polygons(axes, model, view, pixels):
    """Draw a model as depth-sorted polygons; `pixels` is the height of the axes [pixel]."""
    from matplotlib.collections import PolyCollection

    pixel = 2 * view.half[1] / pixels
    parts = [_flat(part, view, pixel) for part in model]
    corners, colours, depth = (np.concatenate(x) for x in zip(*parts, strict=True))
    order = np.argsort(depth, kind="stable")
    corners, colours = corners[order], colours[order]
    drawn = PolyCollection(
        corners,  # pyright: ignore[reportArgumentType]  # it takes an array as well, and makes paths of it at once
        facecolors=colours,
        edgecolors=colours,
        linewidths=0.15,
    )
    axes.add_collection(drawn)


def _flat(part, view, pixel):
    """Polygons of one part: corners, shape (n, 4, 2); colours, shape (n, 3); depth [m], shape (n,)."""
    if isinstance(part, Surface):
        return _flat_surface(part, view)
    if isinstance(part, Balls):
        unit = sphere(12)
        points = (part.centres[:, None] + part.radius * unit[0]).reshape(-1, 3)
        triangles = (np.arange(len(part.centres))[:, None, None] * len(unit[0]) + unit[1]).reshape(-1, 3)
        return _flat_surface(Surface(points, triangles, part.colour), view)
    return _flat_tubes(part, view, pixel)


def _flat_surface(part, view):
    corners = part.points[part.triangles]
    while 0 < len(corners) < PIECES // 10:
        (a, b, c), (d, e, f) = (np.moveaxis(x, 1, 0) for x in (corners, (corners + np.roll(corners, -1, axis=1)) / 2))
        corners = np.concatenate([np.stack(x, axis=1) for x in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ view.axes.T
    normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-300
    shade = 0.45 + 0.55 * np.abs(normal @ np.array([-0.35, 0.55, 0.76]))
    flat, depth, _ = view.project(corners)
    middle = corners.mean(axis=1)
    sight = view.centre - middle if view.perspective else view.axes[2]
    outward = np.sum(normal @ view.axes * (middle - part.points.mean(axis=0)), axis=1)
    hidden = outward * np.sum(normal @ view.axes * sight, axis=1) < 0
    behind = 2 * hidden * np.ptp(corners, axis=1).max(axis=1)  # sorted out of the way of the faces in front
    return flat[:, [0, 1, 2, 2]], np.clip(shade[:, None] * part.colour, 0, 1), depth.mean(axis=1) - behind


def _flat_tubes(part, view, pixel):
    """A dark strip with a narrower bright strip on it, for each straight piece of each line."""
    ends = np.stack([part.paths[:, :-1], part.paths[:, 1:]], axis=2).reshape(-1, 2, 1, 3)
    cuts = np.linspace(0, 1, 1 + int(np.clip(PIECES / max(len(ends), 1), 1, 16)))[:, None]
    points = ends[:, 0] + cuts * (ends[:, 1] - ends[:, 0])
    pieces = np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 3)
    colours = np.repeat(part.colours, len(pieces) // max(len(part.paths), 1), axis=0)
    ends, depth, scale = view.project(pieces)
    radius = np.repeat(np.broadcast_to(part.radius, len(part.paths)), len(pieces) // max(len(part.paths), 1))
    width = np.maximum(radius * scale.mean(axis=1), 0.5 * pixel)[:, None]
    along = ends[:, 1] - ends[:, 0]
    along = along / (np.linalg.norm(along, axis=1, keepdims=True) + 1e-300) * width
    across = along[:, ::-1] * [-1, 1]
    a, b = ends[:, 0] - 0.5 * along, ends[:, 1] + 0.5 * along

    def strip(share):
        s = share * across
        return np.stack([a - s, b - s, b + s, a + s], axis=1)

    corners = np.stack([strip(1.0), strip(0.5)], axis=1).reshape(-1, 4, 2)
    shades = np.stack([0.72 * colours, 0.15 + 0.85 * colours], axis=1).reshape(-1, 3)
    return corners, np.clip(shades, 0, 1), np.repeat(depth.mean(axis=1), 2)
