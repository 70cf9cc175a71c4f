"""Drawing of models by pyvista, in a window or off screen as an image of each view.

May change: private functions but `_off_screen`, and all constants: lights, matter and numbers of corners. Must stay:
`images` and `open_off_screen`, which `render` calls in a child process, and `_off_screen`, in which that finds its
window; `plotter_of`, `aim`, `show` and `pixels_of`, which `window` calls. Tests: ``tests/pictures/test_large.py``,
``tests/pictures/test_pictures.py``.
"""

from __future__ import annotations

import functools
import os
from typing import Any

import numpy as np

from .model import FINE, Balls, Surface, Tubes

SUPERSAMPLING = 2
MATTER = {"ambient": 0.45, "diffuse": 0.62, "specular_power": 20.0}
ROUND = {"specular": 0.15, "smooth_shading": True, "culling": "back"}
LIGHTS = (((-0.45, 0.75, 1.0), 0.62), ((0.7, -0.3, 0.8), 0.28), ((0.0, 0.0, 1.0), 0.22))
"""Directions and intensities of the lights, which move with the camera: from above to the left, beside, the viewer."""
MOST_CORNERS = 1_000_000
"""Number of corners of tubes above which lines are drawn as flat wires, since they are few pixels wide."""
MOST_OF_BALLS = 200_000
"""Number of corners of all balls together; many balls are coarser."""

_off_screen = []


def open_off_screen(*job):
    """Prepare this process for `images`; ``job`` are views, their sizes [pixel] and the sides of a tube.

    Output of libraries is discarded.
    """
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)
    _off_screen[:] = [plotter_of(job[1][0], off_screen=True), *job]
    _off_screen[0].disable_anti_aliasing()


def images(model):
    """A model in each view, RGB, shape (height, width, 3), uint8.

    Raises
    ------
    OSError
        If the window stays blank.
    """
    from PIL import Image

    plotter, views, sizes, sides = _off_screen
    show(plotter, model, sides, functools.partial(pixels_of, views, SUPERSAMPLING * np.array(sizes)))
    drawn = []
    for view, size in zip(views, sizes, strict=True):
        plotter.render_window.SetSize(*(SUPERSAMPLING * length for length in size))
        aim(plotter, view)
        plotter.render_window.Render()
        image = plotter.screenshot(return_img=True)
        drawn.append(np.asarray(Image.fromarray(image).reduce(SUPERSAMPLING)))
    if model and not any(np.ptp(image) for image in drawn):
        raise OSError("the window stays blank")
    return drawn


def pixels_of(views, sizes, point):
    """Pixels per metre at a point [m], shape (3,), the mean over views of some sizes [pixel]."""
    return np.mean(
        [v.project(point)[2] * height / (2 * v.half[1]) for v, (_, height) in zip(views, sizes, strict=True)]
    )


def plotter_of(size, off_screen=False):
    """A plotter of pyvista of a size [pixel], white, with the lights of pictures."""
    import pyvista

    plotter: Any = pyvista.Plotter(off_screen=off_screen, window_size=list(size), lighting="none")
    plotter.set_background("white")
    for position, intensity in LIGHTS:
        plotter.add_light(pyvista.Light(position=position, intensity=intensity, light_type="camera light"))
    return plotter


def aim(plotter, view, middle=None):
    """Set the camera of a plotter to a `refweb.pictures.camera.View`, with its focus at the depth of ``middle`` [m]."""
    camera = plotter.camera
    camera.position, camera.focal_point, camera.up = view.eye, view.focus(middle), view.axes[1]
    camera.parallel_projection = not view.perspective
    if view.perspective:
        camera.view_angle = view.angle
    else:
        camera.parallel_scale = view.half[1]
    plotter.renderer.ResetCameraClippingRange()


def show(plotter, model, sides, pixels):
    """Replace the model of a plotter; ``pixels`` gives the pixels per metre at a point [m]."""
    for number in range(len(model), len(plotter.actors)):
        plotter.remove_actor(f"part {number}", render=False)
    for number, part in enumerate(model):
        mesh, style = _MESHES[type(part)](part, sides, pixels)
        if mesh is None:
            plotter.remove_actor(f"part {number}", render=False)
            continue
        plotter.add_mesh(mesh, name=f"part {number}", reset_camera=False, render=False, **MATTER | style)


def _lines(part, sides, pixels):
    """Tubes, or wires of the same width at the middle of the web: without OpenGL a tube takes a hundredfold time."""
    import pyvista

    paths = np.asarray(part.paths, dtype=float)
    lines, points = paths.shape[:2]
    if not lines:
        return None, {}
    cells = np.insert(np.arange(lines * points).reshape(lines, points), 0, points, axis=1)
    mesh = pyvista.PolyData(paths.reshape(-1, 3), lines=cells.ravel())
    mesh.cell_data["colour"] = np.round(255 * np.asarray(part.colours)).astype(np.uint8)
    style = {"scalars": "colour", "rgb": True}
    if sides * lines * points > MOST_CORNERS:
        width = 2 * float(np.median(part.radius)) * pixels(mesh.points.mean(axis=0))
        half_lit = {"diffuse": 0.8 * MATTER["diffuse"]}  # half of a tube is turned away from the light
        return mesh, style | half_lit | {"line_width": max(1.0, width)}
    mesh.point_data["radius"] = np.repeat(np.broadcast_to(part.radius, lines), points)
    return mesh.tube(scalars="radius", absolute=True, n_sides=sides), style | ROUND


def _surface(part, sides, pixels):
    """A body, with smooth shading except at sharp edges."""
    import pyvista

    mesh = pyvista.PolyData(part.points, faces=np.insert(part.triangles, 0, 3, axis=1).ravel()).clean()
    smooth = {"smooth_shading": True, "split_sharp_edges": True, "feature_angle": 40.0}
    return mesh if mesh.n_cells else None, {"color": part.colour, "specular": 0.4, **smooth}


def _balls(part, sides, pixels):
    import pyvista

    if not len(part.centres):
        return None, {}
    finest = 16 if sides >= FINE else 10
    resolution = int(np.clip(np.sqrt(MOST_OF_BALLS / len(part.centres)), 6, finest))
    ball = pyvista.Sphere(radius=part.radius, theta_resolution=resolution, phi_resolution=resolution)
    mesh = pyvista.PolyData(np.asarray(part.centres, dtype=float)).glyph(geom=ball, scale=False, orient=False)
    return mesh, ROUND | {"color": part.colour}


_MESHES = {Tubes: _lines, Surface: _surface, Balls: _balls}
