"""Tubes and surfaces seen through a camera: as an image by OpenGL, or as polygons of a matplotlib axes.

OpenGL libraries that are missing or broken end a process instead of raising an exception, and they write to the
terminal. `images` therefore renders in a child process, tries each kind of off-screen window in turn and returns None
if none works; `polygons` then draws the same model through the same `refweb.pictures.camera.View` with matplotlib
alone.
"""

from __future__ import annotations

import io
import logging
import os
import pickle
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SUPERSAMPLING = 2
PIECES = 3000  # long lines, and large triangles, are cut for depth sorting while there are fewer
SECONDS_TO_START, SECONDS_PER_FRAME = 60.0, 60.0


@dataclass(frozen=True)
class Tubes:
    """Lines of one thickness: paths [m], shape (lines, points, 3); colours in 0…1, shape (lines, 3); radius [m]."""

    paths: np.ndarray
    colours: np.ndarray
    radius: float


@dataclass(frozen=True)
class Balls:
    """Markers: centres [m], shape (balls, 3); one colour in 0…1; radius [m]."""

    centres: np.ndarray
    colour: tuple
    radius: float


@dataclass(frozen=True)
class Surface:
    """A body: points [m], shape (points, 3); triangles, shape (triangles, 3); one colour in 0…1."""

    points: np.ndarray
    triangles: np.ndarray
    colour: tuple


# OpenGL, in a child process


def windows():
    """Kinds of window to try, as (VTK class or None for its default, whether it may use the display)."""
    if not sys.platform.startswith("linux"):
        return [(None, True)]
    display = [("vtkXOpenGLRenderWindow", True)] if os.environ.get("DISPLAY") else []
    return [("vtkEGLRenderWindow", False), ("vtkOSOpenGLRenderWindow", False), *display]


def images(models, views, sizes):
    """Render each model in each view.

    Parameters
    ----------
    models : list of lists of `Tubes`, `Balls` and `Surface`
        One list per frame of a film.
    views : list of `refweb.pictures.camera.View`
    sizes : list of (width, height)
        Size of each view [pixel].

    Returns
    -------
    list of bytes, or None
        What `unpack` turns into the images of a model; None where OpenGL is not to be had.
    """
    with tempfile.TemporaryDirectory(prefix="refweb-") as folder:
        job = Path(folder, "job.pickle")
        job.write_bytes(pickle.dumps((models, views, sizes)))
        for window, display in windows():
            try:
                _child(job, window, display, SECONDS_TO_START + SECONDS_PER_FRAME * len(models))
                return [job.with_name(f"{i}.npz").read_bytes() for i in range(len(models))]
            except (OSError, subprocess.SubprocessError) as error:
                said = (getattr(error, "stderr", None) or b"").decode(errors="replace").strip().rpartition("\n")[2]
                logging.getLogger(__name__).info("%s cannot be used: %s", window, said or type(error).__name__)
    return None


def unpack(packed):
    """The images of one model, a list with one per view: RGB, shape (height, width, 3), uint8."""
    with np.load(io.BytesIO(packed)) as data:
        return list(data.values())


def _child(job, window, display, seconds):
    """Run `_render` on a job in a process of its own; what it writes or dumps stays in the job's folder."""
    environment = {k: v for k, v in os.environ.items() if display or k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    if window:
        environment["VTK_DEFAULT_OPENGL_WINDOW"] = window
    path = [os.path.abspath(p) for p in sys.path]
    code = f"import sys; sys.path[:] = {path!r}; from {__name__} import _render; _render({str(job)!r})"
    subprocess.run(
        [sys.executable or "python3", "-c", code],
        cwd=job.parent,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=True,
        timeout=seconds,
    )


def _render(job):
    """Render a pickled job and leave one ``NUMBER.npz`` per model beside it."""
    models, views, sizes = pickle.loads(Path(job).read_bytes())
    for i, model in enumerate(models):
        result = [_image(model, view, size) for view, size in zip(views, sizes, strict=True)]
        np.savez_compressed(Path(job).with_name(f"{i}.npz"), *result)


def _image(model, view, size):
    import pyvista

    plotter = pyvista.Plotter(off_screen=True, window_size=[SUPERSAMPLING * s for s in size])
    plotter.background_color = pyvista.Color("white")
    for part in model:
        _add(plotter, part)
    _aim(plotter, view)
    image = np.asarray(plotter.screenshot(return_img=True))[..., :3]
    plotter.close()
    if model and np.ptp(image) == 0:
        raise SystemExit("the window stays blank")
    w, h = size
    blocks = image.reshape(h, SUPERSAMPLING, w, SUPERSAMPLING, 3)
    return blocks.mean(axis=(1, 3)).round().astype(np.uint8)


def _aim(plotter, view):
    camera = plotter.camera
    camera.position = view.centre + (0 if view.perspective else view.axes[2] * sum(view.half))
    camera.focal_point = np.array(camera.position) - view.axes[2]
    camera.up = view.axes[1]
    camera.parallel_projection = not view.perspective
    if view.perspective:
        camera.view_angle = 2 * np.degrees(np.arctan(view.half[1]))
    else:
        camera.parallel_scale = view.half[1]
    plotter.renderer.ResetCameraClippingRange()


def _add(plotter, part):
    import pyvista

    look = {"ambient": 0.45, "diffuse": 0.62, "specular": 0.15, "specular_power": 20}
    if isinstance(part, Surface) and len(part.triangles):
        faces = np.insert(part.triangles, 0, 3, axis=1)
        mesh = pyvista.PolyData(part.points, faces=faces.ravel()).clean()
        smooth = {"smooth_shading": True, "split_sharp_edges": True, "feature_angle": 40}
        plotter.add_mesh(mesh, color=part.colour, **smooth, **{**look, "specular": 0.4})
    elif isinstance(part, Balls) and len(part.centres):
        ball = pyvista.Sphere(radius=part.radius, theta_resolution=16, phi_resolution=16)
        mesh = pyvista.PolyData(np.asarray(part.centres, dtype=float)).glyph(geom=ball, scale=False, orient=False)
        plotter.add_mesh(mesh, color=part.colour, smooth_shading=True, **look)
    elif isinstance(part, Tubes) and len(part.paths):
        n, k = part.paths.shape[:2]
        cells = np.insert(np.arange(n * k).reshape(n, k), 0, k, axis=1)
        mesh = pyvista.PolyData(part.paths.reshape(-1, 3), lines=cells.ravel())
        mesh.cell_data["colour"] = np.round(255 * np.asarray(part.colours)).astype(np.uint8)
        mesh = mesh.tube(radius=part.radius, n_sides=10, capping=True)
        plotter.add_mesh(mesh, scalars="colour", rgb=True, smooth_shading=False, **look)


# matplotlib alone


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
        unit = _sphere(8, 12)
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
    """A dark and, on it, a narrower bright strip for each straight piece of each line."""
    ends = np.stack([part.paths[:, :-1], part.paths[:, 1:]], axis=2).reshape(-1, 2, 1, 3)
    cuts = np.linspace(0, 1, 1 + int(np.clip(PIECES / max(len(ends), 1), 1, 16)))[:, None]
    points = ends[:, 0] + cuts * (ends[:, 1] - ends[:, 0])
    pieces = np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 3)
    colours = np.repeat(part.colours, len(pieces) // max(len(part.paths), 1), axis=0)
    ends, depth, scale = view.project(pieces)
    width = np.maximum(part.radius * scale.mean(axis=1), 0.5 * pixel)[:, None]
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


def _sphere(rings, sectors):
    """Unit sphere: points, shape (points, 3); triangles, shape (triangles, 3)."""
    theta, phi = np.meshgrid(np.linspace(0, np.pi, rings + 1), 2 * np.pi * np.arange(sectors) / sectors, indexing="ij")
    points = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    number = np.arange(theta.size).reshape(theta.shape)
    a, b = number[:-1].ravel(), number[1:].ravel()
    c, d = (np.roll(x, -1, axis=1).ravel() for x in (number[:-1], number[1:]))
    return points.reshape(-1, 3), np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
