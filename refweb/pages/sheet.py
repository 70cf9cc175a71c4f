"""The sheet of a run as HTML: sizes, largest tension, margin of safety, and verdicts on the results.

May change: private functions and the order of tables; sentences belong in `sheet_text`. Must stay: `sheet`, which
`page` puts first, or alone on a page; classes, which ``page.css`` knows; `NAME`, the file. Tests:
``tests/pages/test_sheet.py``.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..pictures.peaks import Largest, largest_tension
from . import sheet_text as words
from .markup import pairs, section, table, tag

NAME = "sheet.html"
"""Name of the file of a sheet in a result folder."""


def sheet(record, packing=words.PACKING):
    """The sheet of a `refweb.pictures.record.Record`; ``packing`` is the volume of cable over the packed volume."""
    summary, dynamic = record.summary, record.kind == "dynamic"
    sizes = list(words.on_sizes(summary.get("web") or {}, packing))
    parts = [tag("h3", "What it is"), pairs(sizes) if sizes else tag("p", "The sizes are not known.")]
    if record.kind != "modes":
        try:
            largest = largest_tension(summary, record.scene, lambda: of_frames(record))
            happens = [*words.on_tension(largest, dynamic), *words.on_margin(summary, record.scene, dynamic)]
            parts += [tag("h3", "What happens"), pairs(happens)]
        except (InputError, KeyError, TypeError, ValueError, AttributeError):
            parts.append(tag("p", "run.json or scene.toml is not what a run of refweb writes."))
    return section("sheet", "Sheet", *parts, tag("h3", "What it is worth"), *_worth(summary))


def _worth(summary):
    """The results with ± and verdicts."""
    results, steps = summary.get("results") or {}, summary.get("steps") or []
    if not results:
        yield tag("p", "There are no results." if summary else "Results are not known.")
        return
    yield table(*words.rows_of_worth(results))
    if len(steps) > 1:
        yield tag("p", f"Of load step {steps[-1]['step']:g}, the last of {len(steps)}.", class_="note")


def of_frames(record):
    """The `refweb.pictures.peaks.Largest` tension in the frames of a record; None without frames."""
    best = None
    for number, time in record.times.items():
        try:
            values = record.frame(number).fields["tension"]
        except (InputError, KeyError):
            continue
        if np.isfinite(values).any() and (best is None or np.nanmax(values) > best[0]):
            best = float(np.nanmax(values)), int(np.nanargmax(values)), number, time
    if best is None:
        return None
    value, element, number, time = best
    lines = record.frame(number).fields.get("line")
    source = "it is the largest in the frames that were written, between which it may be larger"
    return Largest(value, None, element if lines is None else int(lines[element]), time, source)
