"""Films: all frames of a run with one camera and one range of colours, or one period of a mode.

One renderer draws all frames. Title, axes and legend are drawn once, and for each frame only the web and its time.
Frames are read, drawn and written one after the other, so that memory holds one of them.

May change: private functions, sizes, colours and durations, all constants among them. Must stay: names of the arguments
of `animate`, to which `commands.picture` gives its options as keywords; one camera and one range of colours for all
frames; one frame in memory at a time. Tests: ``tests/pictures/test_pictures.py``.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..results.files import write_atomically
from . import movie_writer, render
from .model import COARSE
from .over_frames import with_largest
from .pictures import blank_page, clock_line, look_of, pixels, record_of, target, with_clear_white
from .polygons import flat_images
from .stage import DARK, PALE, Seen, Stage, colour_map

SIZE = (1200, 750)
"""Size of a film [pixel]."""
PHASES, SWINGS = 24, 12.0
"""Number of images of one period of a mode, and images per second [1/s]."""
SAMPLES = 6
"""Number of images from which the palette of a GIF is made."""
LAST = 1.0
"""Duration of the last image, except for modes [s]."""


def animate(source, out, frame=None, time=None, field=None, range=None, scale=1.0, view=None, fps=10.0, progress=None):
    """Draw all frames of a run as a film, or one period of a mode.

    Parameters
    ----------
    source, field, range, scale, view
        As for `refweb.picture`.
    out : path-like
        A ``.gif`` or an ``.mp4``.
    frame : int, optional
        The number of a mode.
    time : float, optional
        The same as ``frame``; both are refused for a run that is no modes.
    fps : float
        Frames per second [1/s], > 0 and ≤ 50; the last frame lasts a second. A period of a mode takes two seconds.
    progress : callable, optional
        Called with a line of text and the share that is done, 0 to 1.

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    InputError
        As for `refweb.picture`.
    """
    record = with_largest(record_of(source), field)
    out = target(out, movie_writer.ENDINGS)
    if not 0 < fps <= 50:
        raise InputError(f"fps = {fps} must be > 0 and ≤ 50 [1/s]")
    if record.kind != "modes" and (frame is not None or time is not None):
        name, value = ("time", f"{time:g}") if frame is None else ("frame", frame)
        raise InputError(f"{name} = {value}: a film has all frames, leave it out")
    poses = poses_of(record, frame, time)
    first = record.frame(poses[0].number)
    options = look_of(record, first, field, range, scale, view)
    film = _Film(record, poses, options, fps)
    write_atomically(out, lambda name: film.write(Path(name), progress or (lambda text, share: None)))
    return out


class Pose(NamedTuple):
    """An image of a film: the number of its frame, and the phase factor −1…1 of a mode."""

    number: int
    phase: float


def poses_of(record, frame, time):
    """The poses of a film, each a `Pose`: those of all frames of a run, or a period of a mode."""
    if record.kind != "modes":
        record.chosen(-1)
        return [Pose(number, 1.0) for number in record.times]
    number = record.chosen(frame, time)
    return [Pose(number, float(phase)) for phase in np.cos(2 * np.pi * np.arange(PHASES) / PHASES)]


class _Film:
    """The images of a film, drawn one by one."""

    def __init__(self, record, poses, options, fps):
        self._record, self._poses, self._options = record, poses, options
        self._swings = record.kind == "modes"
        self._fps = SWINGS if self._swings else fps
        self._last = record.frame(poses[-1].number)
        self._decimals = max((len(f"{t:.6g}".partition(".")[2]) for t in record.times.values()), default=0)

    def write(self, path, progress):
        """Write the film; ``progress`` is called with the finished share."""
        self._stage = self._survey(progress)
        self._sizes = self._stage.pixels(SIZE)
        self._around = self._page()
        count = len(self._poses)
        ahead = sorted({round(i) for i in np.linspace(0, count - 1, min(count, SAMPLES))})
        seconds = count * [1.0 / self._fps]
        if not self._swings:
            seconds[-1] = LAST
        certain = np.round(255 * colour_map()(np.linspace(0, 1, 64))[:, :3]).astype(int)
        with render.Renderer(self._stage.views, self._sizes, COARSE) as renderer:
            drawn = {i: self._image(renderer, self._poses[i]) for i in ahead}

            def images():
                for i, pose in enumerate(self._poses):
                    yield drawn[i] if i in drawn else self._image(renderer, pose)
                    progress("drawing frames", (i + 1) / count)

            movie_writer.write(path, images(), seconds, list(drawn.values()), certain)

    def _frame(self, pose):
        return self._record.frame(pose.number).held_as(self._last).posed(self._options.scale, pose.phase)

    def _survey(self, progress):
        """The stage that contains all images; for a mode both extremes and the middle."""
        ends = {max, min}
        poses = [end(self._poses, key=lambda pose: pose.phase) for end in ends] if self._swings else self._poses
        limits = None
        for pose in poses:
            progress("reading frames", 0.0)
            limits_here = Seen.of(self._frame(pose), self._options.field).spanned()
            limits = limits_here if limits is None else limits.joined(limits_here)
        return Stage.of(limits, self._options, SIZE[0] / SIZE[1])

    def _page(self):
        """Image of title, axes and legend, with a transparent area for the web, RGBA."""
        page = blank_page(self._stage, self._record.title, SIZE)
        for patch in (page.patch, *(axes.patch for axes in page.axes)):
            patch.set_alpha(0.0)
        return pixels(page)

    def _image(self, renderer, pose):
        """The image of a whole page of a frame, RGB."""
        from PIL import Image, ImageDraw

        model = self._stage.model(self._frame(pose))
        views = renderer.images(model) or flat_images(model, self._stage.views, self._sizes)
        page, beneath = Image.new("RGB", SIZE, "white"), self._stage.beneath
        if beneath:
            page.paste(self._around, mask=self._around)
        for view, (left, bottom, _, height) in zip(views, self._stage.rectangles, strict=True):
            mask = Image.fromarray(with_clear_white(view)) if beneath else None
            corner = round(left * SIZE[0]), round((1 - bottom - height) * SIZE[1])
            page.paste(Image.fromarray(view), corner, mask)
        if not beneath:
            page.paste(self._around, mask=self._around)
        pen = ImageDraw.Draw(page)
        clock = clock_line(self._record, pose.number, self._options, self._decimals)
        pen.text((0.03 * SIZE[0], 0.095 * SIZE[1]), clock, DARK, _letters(16), "ls")
        pen.text((0.985 * SIZE[0], 0.985 * SIZE[1]), f"frame {pose.number}", PALE, _letters(11), "rs")
        return page


@functools.cache
def _letters(points):
    """Font of matplotlib, of a size in points on a page of 16 inches."""
    from matplotlib.font_manager import findfont
    from PIL import ImageFont

    return ImageFont.truetype(findfont("DejaVu Sans"), points / 72 * SIZE[0] / 16)
