"""Films of a run: all its frames, with one camera and one range of colours; of a mode its swing."""

from __future__ import annotations

import io

from ..errors import InputError
from ..results.files import write_atomically
from . import render
from .pictures import blank_page, clock_line, look_of, record_of, target, with_supports
from .stage import DARK, PALE, Seen, Stage

SIZE = (1200, 750)
"""Of a film [pixel]."""


def animate(source, out, field=None, range=None, scale=1.0, view=None, fps=10.0, progress=None):
    """Draw all frames of a run as a GIF."""
    from PIL import Image

    out = target(out, ["gif"])
    if not 0 < fps <= 50:
        raise InputError(f"fps = {fps} must be > 0 and ≤ 50 [1/s]")
    record = record_of(source)
    frames = [with_supports(record, record.frame(number)) for number in record.times]
    look = look_of(record, frames[-1], field, range, scale, view)
    frames = [frame.posed(look.scale) for frame in frames]
    seen = Seen.of(frames[0], look.field).spanned()
    for frame in frames[1:]:
        seen = seen.joined(Seen.of(frame, look.field).spanned())
    stage = Stage.of(seen, look, SIZE[0] / SIZE[1])
    models, film = [stage.model(frame) for frame in frames], []
    drawn = render.images(models, stage.views, stage.pixels(SIZE))
    for i, frame in enumerate(frames):
        page = blank_page(stage, record.title, SIZE)
        images = render.unpack(drawn[i]) if drawn else [None] * len(stage.views)
        for axes, view, one, (_, height) in zip(page.axes, stage.views, images, stage.pixels(SIZE), strict=False):
            if one is not None:
                axes.imshow(one, extent=view.extent, aspect="auto", interpolation="none", zorder=0)
            else:
                render.polygons(axes, models[i], view, height)
            axes.set(xlim=view.extent[:2], ylim=view.extent[2:])
        page.text(0.03, 0.905, clock_line(record, frame.number, look), size=16, color=DARK, parse_math=False)
        page.text(0.985, 0.015, f"frame {frame.number}", size=11, color=PALE, ha="right")
        image = io.BytesIO()
        page.savefig(image, format="png")
        film.append(Image.open(image).convert("RGB").quantize())
        if progress is not None:
            progress("drawing frames", len(film) / len(frames))
    duration = [round(1000 / fps)] * (len(film) - 1) + [1000]
    rest = dict(save_all=True, append_images=film[1:], duration=duration, loop=0)
    write_atomically(out, lambda name: film[0].save(name, **rest))
    return out
