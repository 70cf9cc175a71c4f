"""Sheets: layout of the panels of a plot one below the other, styles, labels and fonts, readable on a phone.

May change: all constants: sizes, fonts, marks, and colours that colour-blind people can tell apart. Must stay: at least
as many `COLOURS` as `results.error_budget.PARTS`; names here, from which all plots take styles; extremes in `telling`,
so that no peak is left out; all names that `histories`, `balances` and other files import; public names of `Ink`, which
other files use. Tests: ``tests/pictures/test_plots.py``.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

WIDTH, RESOLUTION = 6.4, 150
"""Width of a sheet [inch] and pixels in an inch."""
LETTERS = 11
"""Font sizes [pt]."""
TALL, LOW = 2.3, 1.6
"""Heights of panels [inch]."""
DARK, PALE, GRID = "#222222", "#888888", "#dddddd"
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442", "#000000")
"""Colours that colour-blind people distinguish, by Okabe and Ito (2008)."""
STYLES = ("-", "--", "-.", ":", (0, (7, 2)), (0, (3, 1, 1, 1, 1, 1)), (0, (1, 2)), (0, (9, 2, 2, 2)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
NARROWEST = 1e-3
"""Least range of an axis over its largest value; for smaller ranges ticks would need too many digits."""
MOST = 1000
"""Number of parts of a long history whose extremes are drawn, about one for each pixel."""


class Ink(NamedTuple):
    """Style of one of several curves: colour, style of lines, marker."""

    colour: str
    style: str | tuple[Any, ...]
    marker: str

    @classmethod
    def of(cls, number):
        """Style number n, from 0 on; after the last colour the colours repeat with another line and marker."""
        again, colour = divmod(number, len(COLOURS))
        return cls(COLOURS[colour], STYLES[(colour + again) % len(STYLES)], MARKERS[(colour + again) % len(MARKERS)])


class Panel(NamedTuple):
    """A part of a sheet.

    Attributes
    ----------
    draw : callable
        Called with the `matplotlib.axes.Axes` to draw on.
    along : str
        Label of its horizontal axis, with its unit; panels below each other share an equal axis.
    height : float
        Its height [inch].
    notes : tuple of str
        Notes below the sheet, each once.
    """

    draw: Callable[..., Any]
    along: str
    height: float = TALL
    notes: tuple[str, ...] = ()


def sheet(panels, title, notes=()):
    """The `matplotlib.figure.Figure` of some panels, with a title above and notes below."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    notes = dict.fromkeys(filter(None, [*(remark for panel in panels for remark in panel.notes), *notes]))
    words, below = textwrap.wrap(title, 48), [line for remark in notes for line in textwrap.wrap(remark, 84)]
    heights = [panel.height for panel in panels]
    size = (WIDTH, sum(heights) + 0.25 * len(words) + 0.2 * len(below) + 0.5)
    figure = Figure(figsize=size, dpi=RESOLUTION, layout=ConstrainedLayoutEngine(h_pad=0.06, w_pad=0.06))
    column = figure.subplots(len(panels), 1, squeeze=False, height_ratios=heights)[:, 0]
    for number, (axes, panel) in enumerate(zip(column, panels, strict=True)):
        axes.grid(color=GRID, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=LETTERS - 1, colors=DARK)
        if number and panels[number - 1].along == panel.along:
            axes.sharex(column[number - 1])
            column[number - 1].tick_params(labelbottom=False)
            column[number - 1].set_xlabel("")
        axes.set_xlabel(panel.along, size=LETTERS, color=DARK)
        panel.draw(axes)
        true_ticks(axes)
    style = {"x": 0.02, "ha": "left", "parse_math": False}
    if words:
        figure.suptitle("\n".join(words), size=LETTERS + 2, weight="bold", color=DARK, **style)
    if below:
        figure.supxlabel("\n".join(below), size=LETTERS - 1, color=DARK, **style)
    return figure


def true_ticks(axes):
    """Let ticks show full values, without offset or power of ten, in a wide enough range."""
    from matplotlib.ticker import ScalarFormatter

    if axes.get_yscale() == "linear":
        low, high = axes.get_ylim()
        lacking = NARROWEST * max(abs(low), abs(high)) - (high - low)
        if lacking > 0.0:
            axes.set_ylim(low - 0.5 * lacking, high + 0.5 * lacking)
    for axis in (axes.xaxis, axes.yaxis):
        if isinstance(formatter := axis.get_major_formatter(), ScalarFormatter):
            formatter.set_useOffset(False)
            formatter.set_scientific(False)


def legend(axes, entries, columns=1):
    """Draw a legend above the axes; ``entries`` are pairs of handle and text."""
    if entries:
        handles, words = zip(*entries, strict=True)
        style = {
            "frameon": False,
            "borderaxespad": 0.1,
            "handlelength": 2.2,
            "columnspacing": 1.2,
            "labelspacing": 0.25,
        }
        position = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": columns, "fontsize": LETTERS - 1}
        words = ["\n ".join([""] + textwrap.wrap(text, 58 // columns))[1:] for text in words]
        drawn = axes.legend(handles, words, **position, **style)
        for text in drawn.get_texts():
            text.set(parse_math=False, color=DARK)


def label(axes, name, unit=""):
    """Label the vertical axis with its unit."""
    axes.set_ylabel(f"{name} [{unit}]" if unit else name, size=LETTERS, color=DARK, parse_math=False)


def curve(axes, ink, along, values, width=1.4, **style):
    """Draw a history, shape (rows,), by its `telling` rows, in an `Ink` or another ``style``; returns the line."""
    rows = telling(values)
    style = {"color": ink.colour, "linestyle": ink.style, "linewidth": width, "marker": dot(rows)} | style
    return axes.plot(along[rows], values[rows], **style)[0]


def dot(rows):
    """The marker of a line through some rows: a dot for a single row, else none."""
    return "." if len(rows) == 1 else ""


def telling(*columns, limit=MOST):
    """Numbers of the rows to draw of long columns: extremes of each column in each of ``limit`` parts.

    These are all rows of short columns, and the first and last row in any case.
    """
    rows = len(columns[0])
    if rows <= 4 * limit:
        return np.arange(rows)
    size = -(-rows // limit)
    indices = [np.array([0, rows - 1])]
    for column in columns:
        padded = np.full(size * -(-rows // size), np.nan)
        padded[:rows] = column
        parts = padded.reshape(-1, size)
        begin = size * np.arange(len(parts))
        for values in (np.where(np.isnan(parts), np.inf, parts), np.where(np.isnan(parts), np.inf, -parts)):
            indices.append(begin + values.argmin(axis=1))
    return np.unique(np.minimum(np.concatenate(indices), rows - 1))
