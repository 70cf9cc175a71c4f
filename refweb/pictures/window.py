"""Window of pyvista for a run: lines as tubes, slack lines grey, bodies, supports, and a slider over frames.

May change: all but `window`, which `commands.view` calls, and `prepared`, which it and a test use. Tests:
``tests/pictures/test_viewers.py``.
"""

from __future__ import annotations

import functools
import os
import sys

import numpy as np

from ..errors import InputError
from .model import COARSE
from .pictures import stage_of
from .record import of_folder
from .stage import DARK, TWO, colour_map, scaled_unit

SIZE = (1400, 900)
"""Size of the window [pixel]."""


def window(folder, field=None):
    """Show a result folder in a window until it is closed, with colours by a field as in `refweb.picture`.

    A folder or field that there is not is refused, and where there is no display.
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
    """(Plotter of pyvista with the frame that a record has `chosen`, function that shows the frame of an index)."""
    from . import opengl

    numbers = list(record.times)
    first = record.chosen()
    frame = record.frame(first)
    stage = stage_of(record, frame, field, SIZE)
    plotter = opengl.plotter_of(SIZE, off_screen)
    plotter.add_axes(color=DARK)

    def show(frame_number):
        number = numbers[int(np.clip(round(frame_number), 0, len(numbers) - 1))]
        try:
            words, model = record.clock(number), stage.model(record.frame(number))
        except InputError as error:
            words = str(error)[:120]
        else:
            opengl.show(plotter, model, COARSE, functools.partial(opengl.pixels_of, [view], [SIZE]))
        plotter.add_text(words, name="clock", position="lower_left", font_size=12, color=DARK)

    view = stage.views[0]
    view = view.wider(max(1.3, 1.12 * view.half[0] * SIZE[1] / (view.half[1] * SIZE[0])))  # beside and below are bars
    opengl.aim(plotter, view, stage.middle)
    show(numbers.index(first))
    plotter.add_text(record.title[:100], name="title", position="upper_left", font_size=14, color=DARK)
    _legend(plotter, stage.options)
    if len(numbers) > 1:
        ends = [0, len(numbers) - 1]
        style = {"pointa": (0.3, 0.08), "pointb": (0.7, 0.08), "color": DARK, "fmt": "%.0f"}
        plotter.add_slider_widget(show, ends, value=numbers.index(first), title="frame", style="modern", **style)
    plotter.renderer.ResetCameraClippingRange()
    return plotter, show


def _legend(plotter, options):
    """Draw the colour bar, or the two colours of slackness."""
    import pyvista

    field, (low, high) = options.field, options.limits
    if field == "slack":
        plotter.add_legend(list(map(list, TWO.items())), loc="center right", size=(0.1, 0.1))
        return
    factor, unit = scaled_unit(field, max(abs(low), abs(high)))
    mapper = pyvista.DataSetMapper()
    mapper.lookup_table = pyvista.LookupTable(colour_map(), scalar_range=(factor * low, factor * high))
    name = field.replace("_", " ") + (f" [{unit}]" if unit else "")
    plotter.add_scalar_bar(name, mapper=mapper, color=DARK, vertical=True, fmt="%.3g", n_labels=5)
