"""A run in a window of pyvista: lines as tubes, slack ones grey, bodies, supports, and a slider over the frames."""

from __future__ import annotations

import os
import sys

import numpy as np

from ..errors import InputError
from .paraview import camera_of
from .pictures import stage_of
from .record import of_folder
from .stage import BODIES, BROKEN, DARK, GREY_WHERE_SLACK, SLACK, SUPPORT, THIN, TWO, colour_map, scaled_unit

SIZE = (1400, 900)
"""Of the window [pixel]."""
MATTER = {"ambient": 0.4, "diffuse": 0.65, "specular": 0.15}


def window(folder, field=None):
    """Show a result folder in a window until it is closed.

    Parameters
    ----------
    folder : path-like
        A result folder.
    field : str, optional
        Field of the colours, as in `refweb.picture`.

    Raises
    ------
    InputError
        Where the folder is no result folder or has no such field, and where there is no display.
    """
    record = of_folder(folder)
    record.chosen()
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError(
            f"{folder}: there is no display for a window, DISPLAY is not set: refweb view without --window opens a "
            "page in a browser, and refweb picture needs neither"
        )
    plotter, _ = prepared(record, field)
    plotter.show()


def prepared(record, field=None, off_screen=False):
    """The plotter of a record, and what shows one of its frames by its place among them.

    Returns
    -------
    plotter : pyvista.Plotter
        It shows the frame of `refweb.pictures.record.Record.chosen`.
    show : callable
        Called with the place of a frame.
    """
    import pyvista

    numbers = list(record.times)
    first = record.chosen()
    frame = record.frame(first)
    stage = stage_of(record, frame, field, SIZE)
    plotter = pyvista.Plotter(off_screen=off_screen, window_size=list(SIZE))
    plotter.background_color = "white"
    plotter.add_axes(color=DARK)

    def show(frame_number):
        number = numbers[int(np.clip(round(frame_number), 0, len(numbers) - 1))]
        try:
            frame = record.frame(number)
        except InputError as error:
            plotter.add_text(str(error)[:120], name="clock", position="lower_left", font_size=12, color=DARK)
            return
        _draw(plotter, frame, stage)
        plotter.add_text(record.clock(number), name="clock", position="lower_left", font_size=12, color=DARK)

    show(numbers.index(first))
    plotter.add_text(record.title[:100], name="title", position="upper_left", font_size=14, color=DARK)
    if len(numbers) > 1:
        ends = [0, len(numbers) - 1]
        style = {"pointa": (0.3, 0.08), "pointb": (0.7, 0.08), "color": DARK, "fmt": "%.0f"}
        plotter.add_slider_widget(show, ends, value=numbers.index(first), title="frame", style="modern", **style)
    _aim(plotter, stage)
    return plotter, show


def _draw(plotter, frame, stage):
    """Put a frame in the place of another."""
    field, (low, high) = stage.options.field, stage.options.limits
    factor, unit = scaled_unit(field, max(abs(low), abs(high)))
    values = factor * frame.fields[field]
    broken = frame.broken
    grey = frame.slack & (field in GREY_WHERE_SLACK) & ~broken
    name = field.replace("_", " ") + (f" [{unit}]" if unit else "")
    colours = {"cmap": colour_map(), "clim": (factor * low, factor * high), "show_scalar_bar": False}
    if field == "slack":
        colours["cmap"] = list(TWO.values())
    parts = ("lines", ~(grey | broken), 1.0), ("slack", grey, 0.8), ("broken", broken, THIN)
    for part, chosen, share in parts:
        if not chosen.any():
            plotter.remove_actor(part)
            continue
        tubes = _tubes(frame.paths[chosen], values[chosen], share * stage.radius)
        plain = {"slack": SLACK, "broken": BROKEN}
        style = {"color": plain[part]} if part in plain else {"scalars": "value", **colours}
        actor = plotter.add_mesh(tubes, name=part, reset_camera=False, **style, **MATTER)
        if part == "lines" and name not in plotter.scalar_bars:
            plotter.add_scalar_bar(name, mapper=actor.mapper, color=DARK, vertical=True, fmt="%.3g", n_labels=5)
    if len(frame.supports):
        _surface(plotter, "supports", _balls(frame.supports, 2.2 * stage.radius), SUPPORT)
    import pyvista

    for i, (name, body) in enumerate(frame.bodies.items()):
        faces = np.insert(body.triangles, 0, 3, axis=1).ravel()
        _surface(plotter, f"body {name}", pyvista.PolyData(body.points, faces=faces).clean(), BODIES[i % len(BODIES)])


def _tubes(paths, values, radius):
    """Lines as tubes, with a value each."""
    import pyvista

    lines, points = paths.shape[:2]
    cells = np.insert(np.arange(lines * points).reshape(lines, points), 0, points, axis=1)
    mesh = pyvista.PolyData(paths.reshape(-1, 3), lines=cells.ravel())
    mesh.cell_data["value"] = values
    return mesh.tube(radius=float(radius), n_sides=8, capping=True)


def _balls(centres, radius):
    import pyvista

    ball = pyvista.Sphere(radius=float(radius), theta_resolution=10, phi_resolution=10)
    return pyvista.PolyData(np.asarray(centres, dtype=float)).glyph(geom=ball, scale=False, orient=False)


def _surface(plotter, name, mesh, colour):
    smooth = {"smooth_shading": True, "split_sharp_edges": True, "feature_angle": 40}
    plotter.add_mesh(mesh, name=name, color=colour, reset_camera=False, **smooth, **MATTER)


def _aim(plotter, stage):
    """The first view of the stage, above the slider."""
    given, camera = camera_of(stage, SIZE, margin=1.3), plotter.camera
    camera.position, camera.focal_point, camera.up = given["eye"], given["focus"], given["up"]
    camera.parallel_projection = given["angle"] is None
    if given["angle"] is None:
        camera.parallel_scale = given["half_height"]
    else:
        camera.view_angle = given["angle"]
    plotter.renderer.ResetCameraClippingRange()
