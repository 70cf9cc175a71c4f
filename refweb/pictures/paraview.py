"""Script that shows a run in ParaView: tubes, one range of colours, grey slack lines, bodies, time, camera.

May change: private functions and `SIZE`. Must stay: keys of ``given`` in `script`, which are names in
``for_paraview.template``; the line ``GIVEN = {} # what is shown`` of that, which is replaced letter by letter;
`TEMPLATE`, and `NAME`, the file, which `results.folder.RESULT_FILES` lists. Tests: ``tests/pictures/test_viewers.py``.
"""

from __future__ import annotations

import pprint
from pathlib import Path

import numpy as np

from ..results.files import write_text
from .frames import listed
from .pictures import stage_of, target
from .record import CLOCKS, of_folder
from .stage import BODIES, GREY_WHERE_SLACK, SLACK, SUPPORT, TWO, colour_map, scaled_unit

NAME, TEMPLATE = "web_in_paraview.py", Path(__file__).with_name("for_paraview.template")
SIZE = (1600, 1000)
"""Size of the view [pixel]."""


def script(folder, field=None, out=None):
    """Write a script for ``paraview --script=FILE`` or ``pvpython FILE`` into a result folder; returns its path.

    The field of the colours is that of `refweb.picture`. ``out`` is another ``.py`` to write. The script looks for the
    result folder beside itself, then at the path at which it was written. A folder or field that there is not, and a
    file that cannot be written, are refused.
    """
    folder = Path(folder)
    record = of_folder(folder)
    out = target(folder / NAME if out is None else out, ["py"])
    number = record.chosen()
    frame = record.frame(number)
    stage = stage_of(record, frame, field, SIZE)
    options, view = stage.options, stage.views[0]
    view = view.wider(1.12 * view.half[0] * SIZE[1] / (view.half[1] * SIZE[0]))  # beside it is the colour bar
    factor, unit = scaled_unit(options.field, max(map(abs, options.limits)))
    points, cells = _arrays(folder, number)
    given = {
        "folder": str(folder.resolve()),
        "beside": out.resolve().parent == folder.resolve(),
        "title": record.title,
        "time": record.times[number],
        "clock": CLOCKS.get(record.kind, CLOCKS["dynamic"]).replace("{:", "{time:"),
        "size": list(SIZE),
        "field": options.field,
        "label": options.field.replace("_", " ") + (f" [{unit}]" if unit else ""),
        "of_cells": options.field in cells,
        "vector": points.get(options.field, 1) > 1,
        "factor": factor,
        "limits": list(options.limits),
        "grey": options.field in GREY_WHERE_SLACK and "slack" in cells,
        "colours": colour_map()(np.linspace(0, 1, 33))[:, :3].round(4).tolist(),
        "two": [list(colour) for colour in TWO.values()] if options.field == "slack" else None,
        "slack_colour": list(SLACK),
        "support_colour": list(SUPPORT),
        "body_colours": [list(colour) for colour in BODIES],
        "bodies": list(frame.bodies),
        "supports": "support" in points,
        "radius": float(np.min(stage.radius)),
        "eye": view.eye.tolist(),
        "focus": view.focus(stage.middle).tolist(),
        "up": view.axes[1].tolist(),
        "angle": view.angle,
        "half_height": float(view.half[1]),
    }
    text = TEMPLATE.read_text(encoding="utf-8")
    write_text(out, text.replace("GIVEN = {}  # what is shown", f"GIVEN = {pprint.pformat(given, width=118)}", 1))
    return out


def _arrays(folder, number):
    """Numbers of components of point data by name, and names of cell data, of a frame."""
    import meshio

    mesh = meshio.read(listed(folder)[number].paths["web"])
    return {name: int(values[0].size) for name, values in mesh.point_data.items()}, set(mesh.cell_data)
