"""Limits of axes, from values without ±; a bar of ± beyond a limit is cut and marked by an arrow and its ±.

May change: private functions, `MARGIN`, `MOST_NUMBERS`, `NEAR` and marks. Must stay: `limit`, `limit_along` and
`bar_of`, by which plots of runs and studies set most of their axes; limits that follow from values and not from ±;
`Bar`, which `histories` and `studies` import. Tests: ``tests/pictures/test_limits.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..results.solution import Result
from .sheet import DARK, LETTERS

MARGIN = 0.1
"""Extension of an axis at each end, over the range of values."""
MOST_NUMBERS = 4
"""Largest number of cut bars at one end of an axis with a printed ± each."""

NEAR = 0.2
"""Share of the horizontal axis within which two ± are printed one below the other."""


class Bar(NamedTuple):
    """A value with ±, in units of the axes: abscissa, value, and lengths of ± below and above."""

    along: float
    value: float
    below: float
    above: float

    def end(self, sign):
        """The upper end of the bar, sign = 1, or the lower one, sign = −1."""
        return self.value + self.above if sign > 0 else self.value - self.below


def bar_of(along, result: Result, factor, error):
    """The `Bar` of a result at an abscissa; ``error`` is from `refweb.pictures.plot_data.bar`, None without ±."""
    below, above = (0.0, 0.0) if error is None else error.ravel().tolist()
    return Bar(along, result.value / factor, below, above)


def window(values, bars=(), bounds=(-np.inf, np.inf)):
    """Ends of an axis.

    Parameters
    ----------
    values : ndarray
        All values that are drawn, in units of the axis.
    bars : sequence of Bar
        Values with ±. The axis contains the end of a bar if the bar is at most as long as the range of all values.
    bounds : (float, float)
        Least and largest possible value, in the same units: an axis of values that cannot be negative begins at 0 or
        above.

    Returns
    -------
    (float, float) or None
        Lower and upper end; None if no value is finite.
    """
    values = np.concatenate([np.ravel(values), [bar.value for bar in bars]]).astype(float)
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    low, high = float(values.min()), float(values.max())
    size = (high - low) or abs(high)
    lowest, highest = low, high
    for bar in bars:
        lowest = min(lowest, bar.value - bar.below) if bar.below <= size else lowest
        highest = max(highest, bar.value + bar.above) if bar.above <= size else highest
    margin = MARGIN * ((highest - lowest) or abs(high) or 1.0)
    lower = lowest - margin if low < bounds[0] else max(lowest - margin, bounds[0])
    return lower, max(highest + margin, lower + margin)


def limit(axes, values, bars=(), bounds=(-np.inf, np.inf), unit=""):
    """Set the vertical axis to the `window` of some values, and mark the bars that it cuts, with ± in the unit."""
    ends = window(values, bars, bounds)
    if ends is None:
        return
    axes.set_ylim(*ends)
    slip = 1e-9 * (ends[1] - ends[0])
    for sign, end, bound in ((1, ends[1], bounds[1]), (-1, ends[0], bounds[0])):
        cut = [bar for bar in bars if sign * (min if sign > 0 else max)(bar.end(sign), bound) > sign * end + slip]
        _mark(axes, cut, end, sign, unit)


def limit_along(axes, values, errors, bounds=(-np.inf, np.inf), unit=""):
    """Set the horizontal axis, for values with ± one above the other; an arrow shows the largest ± that is cut.

    ``values`` and ``errors`` have the shape (n,).
    """
    bars = [Bar(0.0, *row) for row in zip(values, errors, errors, strict=True)]
    ends = window(values, bars, bounds)
    if ends is None:
        return
    axes.set_xlim(*ends)
    slip = 1e-9 * (ends[1] - ends[0])
    for sign, end, side in ((1, ends[1], "right"), (-1, ends[0], "left")):
        cut = [bar.above for bar in bars if sign * bar.end(sign) > sign * end + slip]
        if cut and not (sign < 0 and end == bounds[0]):
            marker = ">" if sign > 0 else "<"
            axes.plot([end], [0.5], marker=marker, color=DARK, markersize=7.0, clip_on=False, zorder=5)
            words = {"ha": side, "va": "center", "fontsize": LETTERS - 1, "color": DARK, "parse_math": False}
            shift = {"xytext": (-7 * sign, 0), "textcoords": "offset points"}
            axes.annotate(f"± at most {max(cut):.3g} {unit}".rstrip(), (end, 0.5), **shift, **words, zorder=5)


def _mark(axes, cut, end, sign, unit):
    """Draw an arrow at an end of the axis for each bar that is cut there, and print ± beside it."""
    marker = "^" if sign > 0 else "v"
    for bar in cut:
        axes.plot([bar.along], [end], marker=marker, color=DARK, markersize=7.0, clip_on=False, zorder=5)
    (first, last), printed = axes.get_xlim(), []
    sizes = [(bar.above, bar.below)[sign < 0] for bar in cut]
    words = [f"± {size:.3g} {unit}".rstrip() for size in sizes]
    if len(cut) > MOST_NUMBERS:
        words = [f"{len(cut)} bars are cut, ± at most {max(sizes):.3g} {unit}".rstrip()]
        cut = cut[int(np.argmax(sizes)) :][:1]
    for bar, text in zip(cut, words, strict=True):
        left = bar.along <= 0.5 * (first + last)
        near = sum(abs(bar.along - position) < NEAR * (last - first) for position in printed)
        printed.append(bar.along)
        shift = {"xytext": (7 if left else -7, -sign * (5 + 13 * near)), "textcoords": "offset points"}
        style = {"ha": "left" if left else "right", "va": "center", "fontsize": LETTERS - 1, "color": DARK}
        axes.annotate(text, (bar.along, end), **shift, **style, parse_math=False, zorder=5)
