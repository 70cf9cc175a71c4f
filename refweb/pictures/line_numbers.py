"""Numbers of lines on a picture: lines with the largest values first, without overlaps.

May change: all else. Must stay: `number_lines`, its arguments and its result, the text that `pictures` writes below the
picture; `_apart`, which a test calls. Tests: ``tests/pictures/test_over_frames.py``.
"""

from __future__ import annotations

import numpy as np

from .stage import LARGEST

SIZE, WIDE, HIGH = 9, 0.75, 1.5
"""Font size of the numbers [pt]; width and height of a digit over it, with spacing."""
MOST, LOOKED_AT = 200, 20_000
"""Largest number of numbered lines, and of candidates."""


def number_lines(page, views, frame, field):
    """Write numbers of lines on a page, in its view in perspective if there is one, else in its first.

    The page is a figure with an axes for each of its ``views``. Lines with the largest values of a field of the frame
    come first. Returns a remark on lines without a number; empty if all have one.
    """
    from matplotlib.patheffects import withStroke

    elements = np.asarray(frame.fields.get("line", np.arange(len(frame.paths)))).astype(int)
    lines, first, count = np.unique(elements, return_index=True, return_counts=True)
    largest = np.full(len(lines), -np.inf)
    np.maximum.at(largest, np.searchsorted(lines, elements), np.nan_to_num(frame.fields[field], nan=-np.inf))
    axes, view = next((pair for pair in zip(page.axes, views, strict=False) if pair[1].perspective), (None, views[0]))
    axes = axes or page.axes[0]
    middles = first + count // 2
    paths = frame.paths[middles]
    places = view.project(0.5 * (paths[:, (paths.shape[1] - 1) // 2] + paths[:, paths.shape[1] // 2]))[0]
    points = 72.0 * page.get_size_inches() * axes.get_position().size / (2.0 * np.asarray(view.half))
    style = {"size": SIZE, "color": "#111111", "ha": "center", "va": "center", "clip_on": True, "zorder": 6}
    style["path_effects"] = [withStroke(linewidth=2.0, foreground="white")]
    chosen = _apart(places * points, np.argsort(-largest, kind="stable"), SIZE * WIDE * len(str(lines[-1])))
    for index in chosen:
        axes.text(*places[index], str(lines[index]), **style)
    if len(chosen) == len(lines):
        return ""
    name = field.removeprefix(LARGEST).replace("_", " ")
    return f"{len(chosen)} of {len(lines)} lines are numbered, those of large {name} first   "


def _apart(places, order, width):
    """Indices of at most `MOST` positions [pt], shape (n, 2), that do not overlap earlier ones in an order."""
    chosen: list = []
    for index in order[:LOOKED_AT]:
        beside = np.abs(places[chosen] - places[index])
        if not ((beside[:, 0] < width) & (beside[:, 1] < SIZE * HIGH)).any():
            chosen.append(index)
            if len(chosen) == MOST:
                break
    return chosen
