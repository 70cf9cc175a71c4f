"""Pictures of a run from a result folder or a solution in memory: the web, with lines coloured by a field.

A picture has two views: in perspective, and from the side with metres along the axes. A plane web, such as a hanging
cable, has one view along the normal of the plane. Colours have one range in all frames of a run, so that two pictures
of it can be compared. Slack lines are grey if the field is a tension, stress or strain. No display is needed:
`refweb.pictures.render` renders by OpenGL off screen, and `refweb.pictures.polygons` where it cannot.

May change: private functions, `SIZE`, and `MOST_SCALED`, a limit of what is accepted. Must stay: names in `LABELS`,
values of ``--labels``; names of the arguments of `picture`, which `refweb` exports and to which `commands.picture`
gives its options as keywords; `target`, `drawn`, `png` and `record_of`, which pages, `film`, `plots`, `paraview`,
`solution` and `commands.gradient` call; all names that `film`, `plots` and other files import. Tests:
``tests/pictures/test_pictures.py``.
"""

from __future__ import annotations

import functools
import io
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..messages import nearest, quote
from ..results.files import write_atomically
from ..results.solution import SolutionData
from . import render
from .camera import VIEWS
from .line_numbers import number_lines
from .over_frames import on_frames, on_peak, with_largest
from .polygons import polygons
from .record import of_folder, of_solution
from .stage import DARK, PALE, Look, Seen, Stage, limits_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from matplotlib.figure import Figure

SIZE = (1600, 1000)
"""Size of a picture [pixel]."""
LABELS = ("lines",)
"""Parts of a web that may be numbered."""
MOST_SCALED = 1e6
"""Largest factor on displacements [1]."""


def picture(
    source: SolutionData | str | PathLike[str],
    frame: int | None = None,
    time: float | None = None,
    field: str | None = None,
    range: Sequence[float] | str | None = None,
    scale: float = 1.0,
    view: Sequence[float] | str | None = None,
    out: str | PathLike[str] | None = None,
    labels: str | None = None,
) -> Figure:
    """Draw one frame of a run.

    Parameters
    ----------
    source : Solution or path-like
        A solution, in memory or loaded, or a result folder.
    frame : int, optional
        Its number, as in the names of files; −1 is the last.
    time : float, optional
        The frame nearest a time [s], in statics a load step, is drawn. Default the one nearest the largest value of the
        first observable; of modes the first.
    field : str, optional
        Cell data, or point data: lines show the largest of their nodes, of vectors the magnitude. Default
        ``stress``, of modes ``shape``, or the first there is. ``utilisation`` is that of lines that have a strength,
        and ``largest_NAME`` of each line the largest NAME over the frames that were written.
    range : (low, high) or "auto", optional
        Range of the colours [SI]; ``"auto"`` for the values of this frame. Default the values of all frames.
    scale : float
        Factor on displacements, or on the shape of a mode, > 0.
    view : str or sequence of 3 floats, optional
        The only view: ``"oblique"``, ``"side"``, ``"front"``, ``"top"``, along the web's normal, or a direction from
        the web to the viewer. Default an oblique view and one from the side.
    out : path-like, optional
        File to write, in any format that matplotlib writes.
    labels : {"lines"}, optional
        Parts to number. If numbers of lines would overlap, the line with the largest value keeps its number.

    Returns
    -------
    matplotlib.figure.Figure
        It shows itself in a notebook.

    Raises
    ------
    InputError
        No result folder, no such frame, field, view or format; names the nearest valid one.
    """
    record = record_of(source)
    out = None if out is None else target(out)
    page = drawn(record, frame, time, field, range, scale, view, labels)
    if out is not None:
        if out.suffix.lower() == ".png":
            write_atomically(out, lambda name: Path(name).write_bytes(png(page)))
        else:
            write_atomically(out, functools.partial(page.savefig, dpi="figure"))
    return page


def drawn(record, frame=None, time=None, field=None, range=None, scale=1.0, view=None, labels=None):
    """The page of a frame of a `refweb.pictures.record.Record`, as `picture` gives it."""
    if labels not in (None, *LABELS):
        raise InputError(f"labels = {quote(labels)} is nothing that can be numbered, {nearest(str(labels), LABELS)}")
    record = with_largest(record, field)
    number = record.chosen(frame, time)
    frame_drawn = record.frame(number)
    options = look_of(record, frame_drawn, field, range, scale, view)
    posed = with_supports(record, frame_drawn).posed(options.scale)
    stage = Stage.of(Seen.of(posed, options.field), options, SIZE[0] / SIZE[1])
    model = stage.model(posed)
    images = render.images([model], stage.views, stage.pixels(SIZE))
    page = blank_page(stage, record.title, SIZE)
    rest = images[0] if images and images[0] else [None] * len(stage.views)
    for axes, view, image, (_, height) in zip(page.axes, stage.views, rest, stage.pixels(SIZE), strict=False):
        if image is not None:
            image_shown = with_clear_white(image) if stage.beneath else image
            axes.imshow(
                image_shown, extent=view.extent, aspect="auto", interpolation="none", zorder=1 if stage.beneath else 0
            )
        else:
            polygons(axes, model, view, height)
        axes.set(xlim=view.extent[:2], ylim=view.extent[2:])
    page.text(0.03, 0.905, clock_line(record, number, options), size=15, color=DARK, parse_math=False)
    words = number_lines(page, stage.views, posed, options.field) if labels is not None else ""
    page.text(0.985, 0.015, f"{words}frame {number}", size=11, color=PALE, ha="right")
    return page


def record_of(source):
    """The record of a solution or a result folder."""
    if not isinstance(source, str | os.PathLike | SolutionData):
        raise InputError(f"source = {quote(source)} must be a Solution or a result folder")
    return of_folder(source) if isinstance(source, str | os.PathLike) else of_solution(source)


def look_of(record, frame, field, limits, scale, view):
    """Check the options and make a `Look`; limits [SI] are by default those of all frames."""
    field, asked = _field(frame, field), limits
    if not isinstance(scale, int | float) or not 0.0 < scale <= MOST_SCALED:
        raise InputError(f"scale = {quote(scale)} must be a number > 0 and ≤ {MOST_SCALED:g}")
    limits = _limits(record, frame, field, limits)
    peak = on_peak(record, field, limits[1]) if asked is None and field != "slack" else ""
    remark = "  —  ".join(filter(None, [on_frames(record, field), peak]))
    return Look(field, limits, float(scale), _view(view), remark, bool(peak))


def stage_of(record, frame, field, size):
    """The stage of a single frame with default options, for a view of some size [pixel]."""
    options = look_of(record, frame, field, None, 1.0, None)
    return Stage.of(Seen.of(frame, options.field), options, size[0] / size[1])


def with_supports(record, frame):
    """The frame, with the supports of the last frame if its file contains none."""
    last = max(record.times)
    return frame if len(frame.supports) or frame.number == last else frame.held_as(record.frame(last))


def clock_line(record, number, options, decimals=None):
    """Line below the title: time, factor on displacements, and status of a run that is not solved."""
    parts = [record.clock(number, decimals)]
    if options.scale != 1:
        parts.append(f"{'shape' if record.kind == 'modes' else 'displacements'} × {options.scale:g}")
    return "  —  ".join(filter(None, [*parts, record.ending, options.remark]))


def blank_page(stage, title, size):
    """A page with title, empty labelled axes for each view, colour bar and legend."""
    from matplotlib.figure import Figure

    title = title[:100]
    figure = Figure(figsize=(16, 10), dpi=size[0] / 16)
    for view, rect in zip(stage.views, stage.rectangles, strict=True):
        axes = figure.add_axes(rect)
        axes.set(xlim=view.extent[:2], ylim=view.extent[2:])
        stage.annotate(axes, view)
    stage.legend(figure)
    large = min(23.0, 23.0 * 58 / max(len(title), 1))
    figure.text(0.03, 0.945, title, size=large, weight="bold", color="#111111", parse_math=False)
    return shows_itself(figure)


def shows_itself(figure):
    """Let notebooks show a figure; returns it."""
    setattr(figure, "_repr_png_", functools.partial(png, figure))  # noqa: B010  # what they look for
    return figure


def with_clear_white(image):
    """Make the white of an image, shape (height, width, 3), transparent, shape (height, width, 4)."""
    return np.dstack([image, np.uint8(255) * (image < 255).any(axis=2)])


def png(figure):
    """The bytes of a figure as PNG, in full colour and without transparency."""
    page = io.BytesIO()
    pixels(figure).convert("RGB").save(page, "PNG")
    return page.getvalue()


def pixels(figure):
    """A figure as an image of pillow, RGBA."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba()).copy())


def target(out, endings=None):
    """Check the path of a file to write: its ending, its folder and permission; returns a `pathlib.Path`."""
    from matplotlib.figure import Figure

    out = Path(out)
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
    """Name of the field to show: the given one, else the shape of a mode, else stress, else the first."""
    if name is None:
        name = next((known for known in ("shape", "stress", *frame.fields) if known in frame.fields), "stress")
    if name not in frame.fields:
        raise InputError(f'field = "{name}": no such field, {nearest(name, frame.fields)}')
    return name


def _limits(record, frame, field, limits):
    """The given range of colours [SI]."""
    if limits is None or field == "slack":
        if limits is not None:
            raise InputError('range: the field "slack" has two colours and no range, leave it out')
        return (0.0, 1.0) if field == "slack" else limits_of(record, field, record.times)
    if isinstance(limits, str) and limits == "auto":
        return limits_of(record, field, [frame.number])
    try:
        low, high = (float(limit) for limit in limits)
    except (TypeError, ValueError):
        raise InputError(f'range = {quote(limits)} must be two numbers [SI], low and high, or "auto"') from None
    if not (np.isfinite([low, high]).all() and low < high):
        raise InputError(f"range = {low:g} {high:g}: low must be less than high")
    return low, high


def _view(view):
    """The given view: a name, or a direction of shape (3,)."""
    if view is None or (isinstance(view, str) and view in VIEWS):
        return view
    try:
        direction = np.array(view, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"view = {quote(view)}: is no view, {nearest(str(view), VIEWS)}") from None
    if direction.shape != (3,) or not np.isfinite(direction).all() or not direction.any():
        raise InputError(f"view = {quote(view)} must be one of {', '.join(VIEWS)}, or three numbers, not all 0")
    return direction / np.abs(direction).max()
