"""Trade-off of a sizing: what is least over the reserve of the tightest requirement, of all designs that were run.

May change: private functions and all of the drawing, `LOWEST` and `MOST_NAMES` among it. Must stay: keys that are read,
those of `sizing.size.Sized.summary` in ``run.json``, and columns of ``results.csv``; `plot`, which `commands.size`
calls; `NAME`, the file. Tests: ``tests/sizing/test_size.py`` (`front`).
"""

from __future__ import annotations

from pathlib import Path

from ..errors import InputError
from ..messages import short
from ..results.folder import read_summary
from ..results.units import scale_of
from .plots import write
from .sheet import COLOURS, DARK, PALE, Panel, label, legend, sheet

NAME = "trade-off.png"
"""Name of the file in the folder of a sizing."""
LOWEST = -0.5
"""Smallest reserve that is drawn: designs that miss more say nothing of the trade-off."""
MOST_NAMES = 5
"""Largest number of designs of the front that are named below it."""


def front(designs):
    """Designs that no other one beats in both: with a smaller objective and a larger reserve, by objective."""
    chosen = []
    for design in sorted(designs, key=lambda d: (d["objective"], -d["reserve"])):
        if not chosen or design["reserve"] > chosen[-1]["reserve"]:
            chosen.append(design)
    return chosen


def plot(folder):
    """Write the trade-off of the folder of a sizing; returns the file; refuses one without a sizing."""
    folder = Path(folder)
    summary = read_summary(folder)
    if summary is None or summary.get("kind") != "size":
        raise InputError(f"{short(str(folder))}: holds no sizing: use refweb size")
    write(draw(summary), folder / NAME)
    return folder / NAME


def draw(summary):
    """The `matplotlib.figure.Figure` of the trade-off, from the content of a ``run.json``."""
    known = [d for d in summary["designs"] if d["objective"] is not None and d["reserve"] is not None]
    drawn = [d for d in known if d["reserve"] >= LOWEST]
    tightest = min(summary["requirements"], key=lambda entry: entry["least"] if entry["least"] is not None else 1e300)
    sizes = [abs(d["objective"]) for d in drawn]
    factor, unit = scale_of(max(sizes, default=1.0), summary["objective"]["unit"])

    def plotted(axes):
        entries = []
        kinds = {
            "meets all requirements": (True, "o", COLOURS[2]),
            "undecided within ±": (None, "D", COLOURS[4]),
            "does not": (False, "x", PALE),
        }
        for words, (holds, marker, colour) in kinds.items():
            chosen = [d for d in drawn if d["holds"] is holds]
            style = {"marker": marker, "color": colour, "linestyle": "none", "markersize": 5.0}
            (handle,) = axes.plot(*_columns(chosen, factor), **style)
            entries += [(handle, words)] if chosen else []
        best = front(drawn)
        (line,) = axes.step(*_columns(best, factor), where="pre", color=COLOURS[0], linewidth=1.2)
        entries += [(line, "no design is better in both")] if len(best) > 1 else []
        answer = min((d for d in drawn if d["values"] == summary["values"]), key=lambda d: d["objective"], default=None)
        if answer is not None:
            style = {"marker": "*", "color": COLOURS[1], "linestyle": "none", "markersize": 14.0}
            (star,) = axes.plot(*_columns([answer], factor), **style)
            entries.append((star, "the nearest design" if summary["status"] == "infeasible" else "the design"))
        axes.axvline(0.0, color=DARK, linewidth=0.8, linestyle=":")
        label(axes, summary["sizing"]["minimise"], unit)
        legend(axes, entries, columns=2)

    left = len(known) - len(drawn)
    named = list(_names(front(drawn), factor, unit))
    notes = [f"At the design the tightest is {tightest['name']}: {tightest['condition']}."]
    notes += [f"The line goes by {'; '.join(named)}."] if named else []
    notes += [f"{left} designs with a reserve below {100.0 * LOWEST:.0f} % are not drawn."] if left else []
    panel = Panel(plotted, "reserve of the tightest requirement, lower end of ± [% of its limit]", height=3.4)
    return sheet([panel], summary["title"], notes)


def _columns(designs, factor):
    return [100.0 * d["reserve"] for d in designs], [d["objective"] / factor for d in designs]


def _names(designs, factor, unit):
    """Texts of the options of designs of the front that meet all requirements, where there are any."""
    for design in [d for d in designs if d["holds"]][:MOST_NAMES]:
        words = [str(value) for value in design["values"].values() if isinstance(value, str)]
        if words:
            (x,), (y,) = _columns([design], factor)
            yield f"{', '.join(words)}: {y:.4g}{f' {unit}' if unit else ''}, reserve {x:.3g} %"
