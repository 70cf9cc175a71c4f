"""How the figures of the report look: one size, one set of colours, and pictures of solutions as PNG."""

from __future__ import annotations

import io
from typing import NamedTuple

import numpy as np

COLOURS = ("#1b5e8c", "#c8553d", "#3c7a4c", "#8a5a9e", "#b58900", "#555555")
"""Colours of lines, the first for refweb; they differ in lightness as well."""
READABLE = 9.0
"""Size of the smallest letters on a page [CSS pixel]."""
REFERENCE = dict(color="#222222", linewidth=1.2)
"""Style of a closed form; refweb's results are markers on it."""


def axes(xlabel, ylabel, columns=1, height=3.6, **options):
    """A matplotlib figure and its axes, labelled; with several columns a list of axes, whose labels are lists."""
    from matplotlib.figure import Figure

    page = Figure(figsize=(7.0, height), dpi=160, layout="constrained")
    found = np.atleast_1d(page.subplots(1, columns, **options))
    labels = [[label] * columns if isinstance(label, str) else label for label in (xlabel, ylabel)]
    for one, x, y in zip(found, *labels, strict=True):
        one.set(xlabel=x, ylabel=y)
        one.grid(color="#dddddd", linewidth=0.6)
        one.set_axisbelow(True)
        one.spines[["top", "right"]].set_visible(False)
        one.set_prop_cycle(color=COLOURS)
    return page, (found[0] if columns == 1 else found)


def ticks(plot, numbers):
    """Ticks of a logarithmic x axis at some numbers, written out."""
    plot.set_xticks(numbers, [f"{number:g}" for number in numbers])
    plot.set_xticks([], minor=True)


def picture(solution, field=None):
    """The picture of the last frame of a solution, a matplotlib figure."""
    return solution.picture(frame=-1, field=field)


class Image(NamedTuple):
    """A figure as a PNG, and the least width at which its smallest letters can be read [CSS pixel]."""

    png: bytes
    width: int


def image(figure):
    """The `Image` of a matplotlib figure."""
    from matplotlib.text import Text

    page = io.BytesIO()
    figure.savefig(page, format="png")
    sizes = [text.get_fontsize() for text in figure.findobj(Text) if text.get_visible() and text.get_text().strip()]
    width, _ = figure.get_size_inches()
    return Image(page.getvalue(), round(READABLE * 72.0 * width / min(sizes, default=10.0)))
