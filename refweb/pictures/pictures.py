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
from pathlib import Path
from typing import NamedTuple

from ..errors import InputError
from ..messages import nearest
from ..results.files import write_atomically
from ..results.folder import read_summary
from . import render
from .frames import listed, read
from .stage import DARK, PALE, Stage, palette

SIZE, FILM_SIZE = (1600, 1000), (1200, 750)
CLOCKS = {"modes": "mode {:g}", "static": "step {:g}", "dynamic": "t = {:.6g} s"}
"""How the time of a frame reads, by kind of run."""


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
    last = max(listed(folder))
    shown = read(folder, last if frame is None else frame)
    field = _field(shown, field)
    supports = shown.supports if len(shown.supports) else read(folder, last).supports
    for page in _pages([shown], field, supports, _heading(folder), SIZE):
        write_atomically(out, page.savefig)
    return out


def drawn(frame, heading, field=None):
    """The page of a frame, wherever it comes from, as `picture` writes it.

    Parameters
    ----------
    frame : refweb.pictures.frames.Frame
        What is drawn.
    heading : Heading
        What stands above it.
    field : str, optional
        As for `picture`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    (page,) = _pages([frame], _field(frame, field), frame.supports, heading, SIZE)
    return page


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
    frames = [read(folder, number) for number in listed(folder)]
    field = _field(frames[-1], field)
    supports = next((frame.supports for frame in reversed(frames) if len(frame.supports)), frames[-1].supports)
    film, colours = [], Image.new("P", (1, 1))
    colours.putpalette(palette().ravel().tolist())
    for page in _pages(frames, field, supports, _heading(folder), FILM_SIZE):
        image = io.BytesIO()
        page.savefig(image, format="png")
        if progress is not None:
            progress("drawing frames", (len(film) + 1) / len(frames))
        film.append(Image.open(image).convert("RGB").quantize(palette=colours, dither=Image.Dither.NONE))
    duration = [round(1000 / fps)] * (len(film) - 1) + [1000]
    rest = dict(save_all=True, append_images=film[1:], duration=duration, loop=0)
    write_atomically(out, lambda name: film[0].save(name, **rest))
    return out


def _target(out, default, endings=None):
    from matplotlib.figure import Figure

    if out is None and not default.parent.is_dir():
        raise InputError(f"{default.parent} is not a folder")
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


def _field(frame, name):
    """The field to show: the one asked for, else a mode's shape, else stress, else the first."""
    if name is None:
        name = next((known for known in ("shape", "stress", *frame.fields) if known in frame.fields), "stress")
    if name not in frame.fields:
        raise InputError(f'field = "{name}": no such field, {nearest(name, frame.fields)}')
    return name


class Heading(NamedTuple):
    """What stands above a picture: its title, how a frame's time reads, and a word on a run that is not solved."""

    title: str
    clock: str
    note: str

    @classmethod
    def of(cls, title, kind, status="solved"):
        """Of a run of a kind, "static", "dynamic" or "modes"."""
        note = "" if status == "solved" else f"  —  run {status}"
        return cls(title[:100], CLOCKS.get(str(kind), CLOCKS["dynamic"]), note)


def _heading(folder):
    """The heading that ``run.json`` and ``scene.toml`` give."""
    run = read_summary(Path(folder)) or {}
    try:
        kind = tomllib.loads((Path(folder) / "scene.toml").read_text(encoding="utf-8"))["solve"]["kind"]
    except (OSError, ValueError, KeyError, TypeError):
        kind = "dynamic"
    title = str(run.get("scene") or Path(folder).resolve().name)
    return Heading.of(title, "modes" if run.get("kind") == "modes" else kind, run.get("status", "solved"))


def _pages(frames, field, supports, heading, size):
    """The pages of some frames, one figure after the other."""
    from matplotlib.figure import Figure

    stage = Stage.of(frames, field, size, supports)
    models = [stage.model(frame) for frame in frames]
    pixels = [tuple(round(r * s) for r, s in zip(rect[2:], size, strict=True)) for rect in stage.rectangles]
    drawn = render.images(models, stage.views, pixels)
    for i, frame in enumerate(frames):
        images = render.unpack(drawn[i]) if drawn else [None] * len(stage.views)
        figure = Figure(figsize=(16, 10), dpi=size[0] / 16)
        for image, view, rect, (_, height) in zip(images, stage.views, stage.rectangles, pixels, strict=True):
            axes = figure.add_axes(rect)
            if image is not None:
                axes.imshow(image, extent=view.extent, aspect="auto", interpolation="none", zorder=0)
            else:
                render.polygons(axes, models[i], view, height)
            axes.set(xlim=view.extent[:2], ylim=view.extent[2:])
            stage.annotate(axes, view)
        stage.legend(figure, frame)
        large = min(23.0, 23.0 * 58 / len(heading.title))
        figure.text(0.03, 0.945, heading.title, size=large, weight="bold", color="#111111", parse_math=False)
        figure.text(0.03, 0.905, heading.clock.format(frame.time) + heading.note, size=16, color=DARK, parse_math=False)
        figure.text(0.985, 0.015, f"frame {frame.number}", size=11, color=PALE, ha="right")
        yield figure
