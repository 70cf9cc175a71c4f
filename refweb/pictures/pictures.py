"""Pictures and films of a result folder: the web at true scale, its lines coloured by a field.

A web is seen twice: in perspective and, below, from the side, with metres along the axes. What lies in a plane, such as
a hanging cable, is seen once, along the normal of the plane. Slack lines are grey where the field is a tension, stress
or strain. Nothing needs a display: `refweb.pictures.render` renders by OpenGL off screen, and by matplotlib where it
cannot.
"""

from __future__ import annotations

import io
import os
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..messages import nearest
from ..pictures import camera as views
from ..pictures import frames as shots
from ..pictures import render as drawing
from ..results.folder import read_summary, write_atomically
from ..results.units import prefixed
from .render import Balls, Surface, Tubes

SIZE, FILM_SIZE = (1600, 1000), (1200, 750)
DARK, PALE, BEFORE, SUPPORT, SLACK = "#333333", "#888888", "#999999", (0.25, 0.25, 0.27), (0.80, 0.80, 0.81)
BODIES = ((0.45, 0.55, 0.68), (0.70, 0.55, 0.45), (0.55, 0.62, 0.50))
GREY_WHERE_SLACK = ("tension", "stress", "strain")
UNITS = {"tension": "N", "reaction": "N", "stress": "Pa", "natural_length": "m", "displacement": "m"}
UNITS |= {"velocity": "m/s", "mass": "kg"}


def picture(folder, frame=None, field=None, out=None):
    """Draw one frame of a result folder.

    Parameters
    ----------
    folder : path
        A result folder: ``web.pvd``, ``frames/`` and, for the title, ``run.json`` and ``scene.toml``.
    frame : int, optional
        The number in the file's name; default the last.
    field : str, optional
        Cell data, or point data: lines show the mean over their nodes, of vectors the magnitude. Default ``stress``, or
        the first there is.
    out : path, optional
        Any format matplotlib writes; default ``folder/web.png``.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    InputError
        No result folder, no such frame, field or format; names the nearest valid one.
    """
    out = _target(out, Path(folder) / "web.png")
    last = max(shots.frames(folder))
    shot = shots.read(folder, last if frame is None else frame)
    field = _field(shot, field)
    pins = shot.pins if len(shot.pins) else shots.read(folder, last).pins
    for figure in _figures([shot], field, pins, _heading(folder), SIZE):
        write_atomically(out, figure.savefig)
    return out


def animate(folder, field=None, out=None, fps=10.0, progress=None):
    """Draw all frames of a result folder as a GIF, with one camera and one range of colours.

    Parameters
    ----------
    folder, field
        As for `picture`.
    out : path, optional
        A ``.gif``; default ``folder/web.gif``.
    fps : float
        Frames per second [1/s], > 0 and ≤ 50; the last one stays for a second.
    progress : callable, optional
        Called with a line of text and the share that is done, 0 to 1.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    InputError
        As for `picture`.
    """
    from PIL import Image

    out = _target(out, Path(folder) / "web.gif", ["gif"])
    if not 0 < fps <= 50:
        raise InputError(f"fps = {fps} must be > 0 and ≤ 50 [1/s]")
    reel = [shots.read(folder, number) for number in shots.frames(folder)]
    field = _field(reel[-1], field)
    pins = next((shot.pins for shot in reversed(reel) if len(shot.pins)), reel[-1].pins)
    film, palette = [], Image.new("P", (1, 1))
    palette.putpalette(_palette().ravel().tolist())
    for figure in _figures(reel, field, pins, _heading(folder), FILM_SIZE):
        page = io.BytesIO()
        figure.savefig(page, format="png")
        if progress is not None:
            progress("drawing frames", (len(film) + 1) / len(reel))
        film.append(Image.open(page).convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE))
    duration = [round(1000 / fps)] * (len(film) - 1) + [1000]
    rest = dict(save_all=True, append_images=film[1:], duration=duration, loop=0)
    write_atomically(out, lambda name: film[0].save(name, **rest))
    return out


def _target(out, default, endings=None):
    from matplotlib.figure import Figure

    if out is None and not default.parent.is_dir():
        raise InputError(f"{default.parent} is no folder")
    out = Path(default if out is None else out)
    endings = endings or sorted(Figure().canvas.get_supported_filetypes())
    ending = out.suffix[1:].lower()
    if ending not in endings:
        raise InputError(f'out = "{out}": unknown format "{ending}", {nearest(ending, endings)}')
    if not out.parent.is_dir():
        raise InputError(f'out = "{out}": there is no folder "{out.parent}"')
    if out.is_dir() or not all(os.access(path, os.W_OK) for path in (out, out.parent) if path.exists()):
        raise InputError(f'out = "{out}": cannot be written, choose another place')
    return out


def _field(shot, name):
    """The field to show: the one asked for, else a mode's shape, else stress, else the first."""
    if name is None:
        name = next((known for known in ("shape", "stress", *shot.fields) if known in shot.fields), "stress")
    if name not in shot.fields:
        raise InputError(f'field = "{name}": no such field, {nearest(name, shot.fields)}')
    return name


def _heading(folder):
    """Title, how a frame's time reads, and a word on a run that is not solved."""
    run = read_summary(Path(folder)) or {}
    try:
        kind = tomllib.loads((Path(folder) / "scene.toml").read_text(encoding="utf-8"))["solve"]["kind"]
    except (OSError, ValueError, KeyError, TypeError):
        kind = "dynamic"
    title = str(run.get("scene") or Path(folder).resolve().name)
    status = run.get("status", "solved")
    note = "" if status == "solved" else f"  —  run {status}"
    clock = "mode {:g}" if run.get("kind") == "modes" else "step {:g}" if kind == "static" else "t = {:.6g} s"
    return title[:100], clock, note


def _figures(reel, field, pins, heading, size):
    """The pages of some shots, one figure after the other."""
    from matplotlib.figure import Figure

    stage = Stage.of(reel, field, size)
    models = [stage.model(shot, pins) for shot in reel]
    pixels = [tuple(round(r * s) for r, s in zip(rect[2:], size, strict=True)) for rect in stage.rectangles]
    drawn = drawing.images(models, stage.views, pixels)
    for i, shot in enumerate(reel):
        images = drawing.unpack(drawn[i]) if drawn else [None] * len(stage.views)
        figure = Figure(figsize=(16, 10), dpi=size[0] / 16)
        for image, view, rect, (_, height) in zip(images, stage.views, stage.rectangles, pixels, strict=True):
            axes = figure.add_axes(rect)
            if drawn:
                axes.imshow(image, extent=view.extent, aspect="auto", interpolation="none", zorder=0)
            else:
                drawing.polygons(axes, models[i], view, height)
            axes.set(xlim=view.extent[:2], ylim=view.extent[2:])
            stage.annotate(axes, view)
        stage.legend(figure, shot, pins)
        title, clock, note = heading
        large = min(23.0, 23.0 * 58 / len(title))
        figure.text(0.03, 0.945, title, size=large, weight="bold", color="#111111", parse_math=False)
        figure.text(0.03, 0.905, clock.format(shot.time) + note, size=16, color=DARK, parse_math=False)
        figure.text(0.985, 0.015, f"frame {shot.number}", size=11, color=PALE, ha="right")
        yield figure


@dataclass(frozen=True)
class Stage:
    """What all pages share.

    `views` and their `rectangles`; the `field` and its `limits` [SI]; the `radius` of lines, the undeformed lines
    `origin`, shape (lines, points, 3), empty where nothing has moved, and the `middle` of the web, shape (3,) [m].
    """

    views: list
    rectangles: list
    field: str
    limits: tuple
    radius: float
    origin: np.ndarray
    middle: np.ndarray

    @classmethod
    def of(cls, reel, field, size):
        """The stage that shows all of the shots on a page of this size [pixel]."""
        points = np.concatenate([shot.paths.reshape(-1, 3) for shot in reel])
        solid = np.concatenate([np.zeros((0, 3)), *(body[0] for shot in reel for body in shot.bodies.values())])
        moved = max(np.abs(shot.paths - shot.origin).max() for shot in reel)
        origin = reel[0].origin
        chosen = views.choose(origin.reshape(-1, 3), points, solid, moved, reel[0].tree, size[0] / size[1])
        extent = np.linalg.norm(np.ptp(points, axis=0))
        length = np.median(np.linalg.norm(np.diff(origin, axis=1), axis=2).sum(axis=1))
        thinnest = 0.0018 if len(chosen[0]) == 1 else 0.0008
        radius = np.clip(0.06 * length, thinnest * extent, 0.0025 * extent)
        origin = origin if moved > 0 else origin[:0]
        return cls(*chosen, field, _limits(reel, field), radius, origin, points.mean(axis=0))

    def grey(self, shot):
        """Which lines are drawn as slack, shape (lines,)."""
        return shot.slack & (self.field in GREY_WHERE_SLACK)

    def model(self, shot, pins):
        """The tubes, surfaces and markers of a shot."""
        grey, low, high = self.grey(shot), *self.limits
        colours = _colour_map()(np.clip((shot.fields[self.field] - low) / (high - low), 0, 1))[:, :3]
        model = [Tubes(shot.paths[~grey], colours[~grey], self.radius)]
        model.append(Tubes(shot.paths[grey], np.tile(SLACK, (grey.sum(), 1)), 0.8 * self.radius))
        model.append(Balls(pins, SUPPORT, 2.2 * self.radius))
        for i, (points, triangles) in enumerate(shot.bodies.values()):
            model.append(Surface(points, triangles, BODIES[i % len(BODIES)]))
        return model

    def annotate(self, axes, view):
        """Metres along the axes of a parallel view, and the undeformed web; a triad of known length in perspective."""
        from matplotlib.collections import LineCollection

        if view.perspective:
            axes.axis("off")
            depth = view.project(self.middle)[1]
            _triad(axes, view, view.point(-0.88, -0.72, depth), _round(-0.12 * view.half[0] * depth))
            return
        axes.add_collection(LineCollection(view.project(self.origin)[0], colors=BEFORE, linewidths=0.8))
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=12, colors=DARK)
        axes.set_xlabel(f"{_axis_name(view.axes[0])} [m]", size=13, color=DARK)
        axes.set_ylabel(f"{_axis_name(view.axes[1])} [m]", size=13, color=DARK)

    def legend(self, figure, shot, pins):
        """Colour bar, and names for what is not on it."""
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize
        from matplotlib.lines import Line2D

        factor, unit = _scaled_unit(self.field, max(map(abs, self.limits)))
        norm = Normalize(*(factor * limit for limit in self.limits))
        bar = figure.colorbar(ScalarMappable(norm, _colour_map()), cax=figure.add_axes((0.905, 0.36, 0.014, 0.48)))
        bar.outline.set_visible(False)
        bar.ax.tick_params(labelsize=13, colors=DARK)
        bar.ax.set_title(self.field.replace("_", " ") + (f" [{unit}]" if unit else ""), size=15, pad=14, color=DARK)
        marks = [Line2D([], [], color=SLACK, lw=4, label="slack")] if self.grey(shot).any() else []
        marks += [Line2D([], [], color=SUPPORT, marker="o", ls="", ms=7, label="support")] if len(pins) else []
        marks += [Line2D([], [], color=BEFORE, lw=0.8, label="undeformed")] if len(self.origin) else []
        for i, name in enumerate(shot.bodies):
            marks.append(Line2D([], [], color=BODIES[i % len(BODIES)], marker="o", ls="", ms=13, label=name))
        look = {"frameon": False, "fontsize": 13, "labelcolor": DARK, "handlelength": 1.6}
        figure.legend(handles=marks, loc="upper left", bbox_to_anchor=(0.885, 0.32), **look)


def _triad(axes, view, corner, length):
    """Arrows along x, y and z from a corner [m], as long as the note below them says [m]."""
    for arm, name in zip(length * np.eye(3), "xyz", strict=True):
        start, end, tip = view.project(np.array([corner, corner + arm, corner + 1.2 * arm]))[0]
        axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": DARK, "lw": 1.4, "shrinkA": 0})
        axes.text(*tip, name, size=14, color=DARK, ha="center", va="center")
    place, _, scale = view.project(corner)
    axes.text(*(place - [0, 0.6 * length * scale]), f"each {length:g} m", size=12, color=DARK, va="top")


def _colour_map():
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap

    return ListedColormap(colormaps["viridis"](np.linspace(0.03, 0.95, 256)))


def _palette():
    """The colours of a film, shape (colours, 3), 0…255: those of the lines and bodies in their shades, and greys."""
    colours = _colour_map()(np.linspace(0, 1, 48))[:, :3]
    shades = [colours, 0.8 * colours[::2], 0.6 * colours[::2], 0.5 + 0.5 * colours[::2], 0.75 + 0.25 * colours[::3]]
    shades += [np.clip(np.linspace(0.4, 1.5, 16)[:, None] * body, 0, 1) for body in BODIES]
    shades.append(np.linspace(0, 1, 17)[:, None] * np.ones(3))
    return np.round(255 * np.concatenate(shades)).astype(int)


def _limits(reel, field):
    """Range of the colours [SI]: that of the taut lines, from 0 where this does not waste half of it."""
    values = np.concatenate([shot.fields[field][~(shot.slack & (field in GREY_WHERE_SLACK))] for shot in reel])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    low = 0.0 if 0 <= low <= 0.5 * high else low
    return (low, high) if high - low > 1e-9 * abs(high) else (min(0.0, high), max(0.0, high) or 1.0)


def _scaled_unit(field, largest):
    """Factor and unit that make the largest value [SI] a number of one to three digits."""
    unit = UNITS.get(field, "")
    if field == "strain":
        return (100.0, "%") if largest >= 1e-4 else (1e6, "10⁻⁶")
    if not unit or largest == 0:
        return 1.0, unit
    scale, unit = (1e3, "g") if unit == "kg" else (1.0, unit)
    value, prefix = prefixed(largest * scale / 0.9999)
    return scale / value, prefix + unit


def _round(length):
    """The largest 1, 2 or 5 times a power of ten that is not longer [m]."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(max(m * power for m in (1, 2, 5) if m * power <= length * (1 + 1e-9)))


def _axis_name(axis):
    close = np.argmax(axis)
    return "xyz"[close] if axis[close] > 1 - 1e-6 else "along ({:.2g}, {:.2g}, {:.2g})".format(*axis)
