"""Plots of a study: one figure for each result, over the varying parameters, with ± and probabilities.

May change: private functions and all of the drawing, `MOST_PANELS` and `MOST_GROUPS` among it. Must stay: columns that
are read, those of `results.case_rows`; `draw` and `of_folder`, which `pages.study` calls, and `plot`, which
`commands.sweep` calls. Tests: ``tests/sweeps/test_study_pages.py``, ``tests/pictures/test_limits.py``.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..messages import quote, short
from ..results.case_rows import NAME, read, results_among
from ..results.folder import read_summary
from ..results.units import scale_of
from .limits import Bar, limit, limit_along
from .plots import write
from .sheet import DARK, PALE, Ink, Panel, label, legend, sheet

MOST_PANELS = 6
"""Largest number of parameters over which a result is drawn."""
MOST_GROUPS = 8
"""Largest number of groups with a style each."""


class Rows(NamedTuple):
    """Data of a study for drawing.

    Attributes
    ----------
    summary : dict
        The content of its ``run.json``.
    rows : list of dict
        Its rows with a result.
    columns : list of str
        Names of columns.
    """

    summary: dict[str, Any]
    rows: list[Any]
    columns: list[Any]

    @property
    def results(self):
        """Its results, each a `refweb.results.case_rows.Named`."""
        return results_among(self.columns)

    @property
    def groups(self):
        """Text and rows of each combination of parameters that are no numbers."""
        named = [path for path, values in self.summary["study"]["parameters"].items() if _is_named(values)]
        groups_found = {}
        for row in self.rows:
            words = ", ".join(f"{path.rpartition('.')[2]} = {_word(row[path])}" for path in named)
            groups_found.setdefault(words, []).append(row)
        return list(groups_found.items())


def _is_named(values):
    """Tell if a parameter has several values that are no numbers."""
    return isinstance(values, list) and len(values) > 1 and not all(isinstance(v, int | float) for v in values)


def _word(value):
    return value if isinstance(value, str) else quote(value)


def of_folder(folder):
    """The `Rows` of the folder of a study; refuse a folder without study."""
    folder = Path(folder)
    summary = read_summary(folder)
    if summary is None or summary.get("kind") != "sweep":
        raise InputError(f"{short(str(folder))}: holds no study: use refweb sweep")
    rows = read(folder / NAME)
    columns = list(dict.fromkeys(name for row in rows for name in row))
    return Rows(summary, [row for row in rows if row["status"] == "solved"], columns)


def draw(study, result):
    """Draw a result, a `refweb.results.case_rows.Named`, of `Rows` over each varying number; returns a figure.

    For samples its cumulative distribution is drawn as well.
    """
    column = f"{result.name} [{result.unit}]"
    values = [row[column] for row in study.rows if row.get(column) is not None]
    factor, unit = scale_of(max(map(abs, values), default=1.0), result.unit)
    paths = [path for path, value_list in study.summary["study"]["parameters"].items() if _is_number(value_list)]
    panels = [_over(study, result, column, path, factor, unit) for path in paths[:MOST_PANELS]]
    if study.summary["study"]["sample"] not in ("grid", "zip") or not panels:
        panels.append(_shares(study, result, column, factor, unit))
    left = len(paths) - MOST_PANELS
    notes = ["Bars: ± of each case."] + ([f"{left} more parameters are not drawn"] if left > 0 else [])
    return sheet(panels, f"{study.summary['title']}: {result.name}"[:200], notes)


def _is_number(values):
    """Tell if a parameter is several numbers."""
    return isinstance(values, dict) or (len(values) > 1 and all(isinstance(v, int | float) for v in values))


def _inked(study):
    """Text, rows and `Ink` of each group, up to the largest number of styles."""
    return [(words, rows, Ink.of(n)) for n, (words, rows) in enumerate(study.groups[:MOST_GROUPS])]


def _over(study, result, column, path, factor, unit):
    """The panel of a result over a parameter."""
    spread = study.summary["study"]["parameters"][path]
    ratio = isinstance(spread, dict) and spread.get("spacing") == "log"

    def plot(axes):
        entries, bars = [], []
        for words, rows, ink in _inked(study):
            valid = [row for row in rows if row.get(column) is not None and isinstance(row[path], int | float)]
            x, y = ([row[name] for row in valid] for name in (path, column))
            error = np.array([row.get(f"{result.name} ±") or 0.0 for row in valid]) / factor
            style = {"color": ink.colour, "markersize": 4.0, "elinewidth": 1.0, "capsize": 2.0}
            drawn = axes.errorbar(x, np.array(y) / factor, error, fmt=ink.marker, linestyle="none", **style)
            entries += [(drawn, words)] if words else []
            bars += [Bar(*row) for row in zip(x, np.array(y) / factor, error, error, strict=True)]
        if ratio:
            axes.set_xscale("log")
        limit(axes, [], bars, _bounds(study, result), unit)
        label(axes, result.name, unit)
        legend(axes, entries, columns=2)

    return Panel(plot, path)


def _shares(study, result, column, factor, unit):
    """The panel of the share of cases below a value, with the band of ±."""

    def plot(axes):
        groups = []
        for _, rows, ink in _inked(study):
            valid = [row for row in rows if row.get(column) is not None]
            y = np.array([row[column] for row in valid]) / factor
            error = np.array([row.get(f"{result.name} ±") or 0.0 for row in valid]) / factor
            steps = np.arange(1, len(y) + 1) / max(len(y), 1)
            axes.step(np.sort(y), steps, where="post", color=ink.colour, linestyle=ink.style)
            axes.fill_betweenx(steps, np.sort(y - error), np.sort(y + error), color=ink.colour, alpha=0.2, step="pre")
            groups.append((y, error))
        limits = [_limit(text, result.name) for text in study.summary["study"].get("conditions", {}).values()]
        limits = [at / factor for at in limits if at is not None]
        for at in limits:
            axes.axvline(at, color=PALE, linestyle=":")
        values, errors = (np.concatenate(parts) for parts in zip(*groups, strict=True))
        limit_along(axes, [*values, *limits], [*errors, *np.zeros(len(limits))], _bounds(study, result), unit)
        axes.set_ylim(0.0, 1.02)
        axes.set_ylabel("share of cases below", color=DARK)

    return Panel(plot, f"{result.name} [{unit}]" if unit else result.name)


def _bounds(study, result):
    """Least and largest possible value of a result."""
    return (0.0 if result.name in study.summary.get("not_negative", ()) else -math.inf), math.inf


def _limit(text, name):
    """The limit in a condition that only compares a result with a number."""
    match = re.fullmatch(rf"\s*{re.escape(name)}\s*[<>]=?\s*([-+\d.eE]+)\s*", text)
    try:
        value = float(match[1]) if match else math.nan
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def plot(folder):
    """Write a plot ``NAME.png`` of each result of a study into its folder; returns the files."""
    folder, study = Path(folder), of_folder(folder)
    written = []
    for result in study.results if study.rows else []:
        path = folder / f"{re.sub(r'[^A-Za-z0-9_-]+', '-', result.name)}.png"
        write(draw(study, result), path)
        written.append(path)
    return written
