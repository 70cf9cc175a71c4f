"""Panels of histories over time, of results over load steps and of frequencies of modes, with known ±.

May change: private functions and all of the drawing, `OF_ALL` and `MOST_TICKS` among it. Must stay: the functions that
`plots` calls, one for each kind of plot, each of which gives panels of `sheet`; `clock_of`, `tick_steps` and
`bounds_of`, which `balances` and `distances` call; `across`, `history` and `of_modes`, which `plots` imports. Tests:
``tests/pictures/test_plots.py``, ``tests/pictures/test_limits.py``.
"""

from __future__ import annotations

import numpy as np

from ..results.units import scale_of
from .limits import Bar, bar_of, limit
from .plot_data import bar, text_of, unit_of
from .sheet import COLOURS, DARK, LETTERS, MARKERS, PALE, STYLES, Panel, curve, label, legend

OF_ALL = "Points: results of all steps, with ± where it is known. Lines: rows of the history."
MOST_TICKS = 12
"""Largest number of load steps with a mark each on the axis."""


def history(runs, name):
    """The panel of a column of the history over time, with its result as a point with ±."""
    having = [s for s in runs if name in s.units]
    unit = having[0].units[name]
    values = [s.results[name].value for s in having if name in s.results]
    factor, called = unit_of(unit, *(s.history[name] for s in having), *values)
    second, clock = clock_of(having)

    def draw(axes):
        entries, bars = [], []
        for s in having:
            line = curve(axes, s.ink, s.along / second, s.history[name] / factor)
            result = s.results.get(name)
            if result is None or not np.isfinite(result.value):
                entries += [(line, s.name or "")] if s.name else []
                continue
            error = bar(result, factor)
            ink = {"color": s.ink.colour, "markeredgecolor": DARK, "capsize": 5.0, "elinewidth": 2.0, "markersize": 6.0}
            point = axes.errorbar(result.time / second, result.value / factor, error, fmt=s.ink.marker, **ink, zorder=3)
            bars.append(bar_of(result.time / second, result, factor, error))
            entries.append((point, s.said(f"{text_of(result)} at t = {result.time / second:.6g} {clock}")))
        marks(axes, having, second)
        values = np.concatenate([s.history[name] for s in having]) / factor
        limit(axes, values, bars, bounds_of(having, name, factor), called)
        label(axes, name, called)
        legend(axes, entries)

    notes = [OF_ALL] if any(name in s.results for s in having) else []
    return [
        Panel(draw, f"time [{clock}]", notes=(*notes, *(remark for s in having for remark in s.other_errors(name))))
    ]


def across(runs, name, against):
    """The panel of a column over another one, such as a loop of tension over strain; it begins at the point."""
    factor, called = unit_of(runs[0].units[name], *(s.history[name] for s in runs))
    width, below = unit_of(runs[0].units[against], *(s.history[against] for s in runs))

    def draw(axes):
        entries = []
        for s in runs:
            x, y = s.history[against] / width, s.history[name] / factor
            (line,) = axes.plot(x, y, color=s.ink.colour, linestyle=s.ink.style, linewidth=1.4)
            axes.plot(x[:1], y[:1], color=s.ink.colour, marker=s.ink.marker, markeredgecolor=DARK)
            entries += [(line, s.name)] if s.name else []
        limit(axes, np.concatenate([s.history[name] for s in runs]) / factor, [], bounds_of(runs, name, factor), called)
        label(axes, name, called)
        legend(axes, entries)

    return [Panel(draw, f"{against} [{below}]" if below else against, notes=("The point is the start.",))]


def bounds_of(runs, name, factor):
    """Least and largest possible value of a column in several runs, in units of the axis."""
    lower, upper = zip(*(s.bounds.get(name, (-np.inf, np.inf)) for s in runs), strict=True)
    return min(lower) / factor, max(upper) / factor


def clock_of(runs):
    """Factor and name of the unit of time of some runs: s, with a prefix for runs below 0.1 s."""
    longest = max((float(np.abs(s.along).max(initial=0.0)) for s in runs), default=0.0)
    return (1.0, "s") if longest >= 0.1 else scale_of(longest, "s")


def marks(axes, runs, second):
    """Mark events by vertical lines, with their names if one run is shown."""
    for s in runs:
        for name, time in s.events:
            axes.axvline(time / second, color=s.ink.colour if s.name else PALE, linestyle=":", linewidth=1.2)
            if not s.name:
                position = {"xy": (time / second, 0.97), "xycoords": axes.get_xaxis_transform()}
                style = {"rotation": 90, "ha": "right", "va": "top", "fontsize": LETTERS - 2, "color": DARK}
                axes.annotate(name, **position, **style, parse_math=False)


def steps(runs, name):
    """The panel of a result over the load steps, with its ± as bars."""
    having = [s for s in runs if any(name in results for _, results in s.steps)]
    if len(having) < len(runs):
        return _columns(runs, name, "load step", [(s.along, s.history[name]) for s in runs])
    series = [[(step, results[name]) for step, results in s.steps if name in results] for s in having]
    unit = series[0][0][1].unit
    factor, called = unit_of(unit, *(np.array([result.value for _, result in rows]) for rows in series))

    def draw(axes):
        entries, bars = [], []
        for s, rows in zip(having, series, strict=True):
            at, values = [step for step, _ in rows], [result.value / factor for _, result in rows]
            style = {"color": s.ink.colour, "linestyle": s.ink.style, "linewidth": 1.2}
            axes.plot(at, values, **style)
            for step, result in rows:
                ink = {"color": s.ink.colour, "fmt": s.ink.marker, "capsize": 5.0, "elinewidth": 2.0, "markersize": 6.0}
                point = axes.errorbar(step, result.value / factor, error := bar(result, factor), **ink)
                bars.append(bar_of(step, result, factor, error))
            entries.append((point, s.said(f"{text_of(rows[-1][1])} at step {rows[-1][0]:g}")))
        tick_steps(axes, [step for rows in series for step, _ in rows])
        limit(axes, [], bars, bounds_of(having, name, factor), called)
        label(axes, name, called)
        legend(axes, entries)

    return [Panel(draw, "load step", notes=tuple(remark for s in having for remark in s.other_errors(name)))]


def tick_steps(axes, steps):
    """Mark each load step on the axis if there are few."""
    if len(steps := sorted(set(steps))) <= MOST_TICKS:
        axes.set_xticks(steps, [f"{step:g}" for step in steps])


def of_modes(runs, name):
    """The panel of a column of the table of modes over the number of the mode, at the last load step."""
    last = [s.history["step"] == s.history["step"][-1] for s in runs]
    pairs = [(s.history["mode"][rows], s.history[name][rows]) for s, rows in zip(runs, last, strict=True)]
    return _columns(runs, name, "mode", pairs)


def _columns(runs, name, along, pairs):
    """The panel of a column over its abscissa, without ±."""
    factor, called = unit_of(runs[0].units[name], *(values for _, values in pairs))

    def draw(axes):
        entries = []
        for s, (at, values) in zip(runs, pairs, strict=True):
            style = {"color": s.ink.colour, "marker": s.ink.marker}
            style["linestyle"] = "" if along == "mode" else s.ink.style  # between modes there is nothing
            (line,) = axes.plot(at, values / factor, **style)
            entries += [(line, s.name)] if s.name else []
        values = np.concatenate([values for _, values in pairs]) / factor
        limit(axes, values, bounds=bounds_of(runs, name, factor))
        label(axes, name, called)
        legend(axes, entries)

    return [Panel(draw, along)]


def frequencies(runs):
    """The panel of natural frequencies with ±: over the mode number, or over load steps if there are several."""
    several = any(len(np.unique(s.history["step"])) > 1 for s in runs)
    largest = max(float(np.abs(s.history["frequency"]).max(initial=0.0)) for s in runs)
    factor, called = scale_of(largest, "Hz")

    def draw(axes):
        entries, bars = [], []
        for s in runs:
            table = s.history
            table_of = {"step": table["step"], "mode": table["mode"], "frequency": table["frequency"] / factor}
            errors = table["error"] / factor
            at, count = table_of["step" if several else "mode"], len(np.unique(table_of["mode"]))
            if several:
                handle = _over_steps(axes, table_of, errors, s)
            else:
                ink = {"color": s.ink.colour, "capsize": 5.0, "elinewidth": 2.0, "markersize": 7.0}
                handle = axes.errorbar(at, table_of["frequency"], errors, fmt=s.ink.marker, **ink)
            entries.append((handle, s.said(f"{count} modes, ± at most {max(errors, default=0.0):.2g} {called}")))
            bars += [Bar(*row) for row in zip(at, table_of["frequency"], errors, errors, strict=True)]
            unstable = table_of["frequency"] < 0
            if unstable.any():
                style = {"color": DARK, "marker": "x", "linestyle": "", "markersize": 10, "markeredgewidth": 2.5}
                (cross,) = axes.plot(at[unstable], table_of["frequency"][unstable], **style, zorder=4)
                entries.append((cross, "below zero: imaginary, unstable"))
            if several and not s.name:
                _number_modes(axes, table_of)
        if several:
            tick_steps(axes, [step for s in runs for step in s.history["step"].tolist()])
        else:
            axes.xaxis.get_major_locator().set_params(integer=True)
        limit(axes, [], bars, (0.0, np.inf), called)
        label(axes, "frequency", called)
        legend(axes, entries)

    return [Panel(draw, "load step" if several else "mode", 3.6)]


def _over_steps(axes, table, errors, s):
    """A line for each mode by its number, from step to step."""
    handle = None
    for number, mode in enumerate(np.unique(table["mode"])):
        rows_here = table["mode"] == mode
        single = not s.name
        ink = {"color": COLOURS[number % len(COLOURS)] if single else s.ink.colour, "capsize": 4.0, "markersize": 5.0}
        ink |= {"linestyle": STYLES[number % len(STYLES)] if single else s.ink.style, "linewidth": 1.2}
        ink["marker"] = MARKERS[number % len(MARKERS)] if single else s.ink.marker
        handle = axes.errorbar(table["step"][rows_here], table["frequency"][rows_here], errors[rows_here], **ink)
    return handle


def _number_modes(axes, table):
    """Write numbers of modes at the ends of lines, one text for lines that coincide."""
    last = table["step"] == table["step"][-1]
    values, modes = table["frequency"][last], table["mode"][last].astype(int)
    near = 0.03 * max(float(np.ptp(table["frequency"])), 1e-300)
    groups = []
    for value, mode in sorted(zip(values.tolist(), modes.tolist(), strict=True)):
        if groups and value - groups[-1][-1][0] < near:
            groups[-1].append((value, mode))
        else:
            groups.append([(value, mode)])
    for group in groups:
        numbers = sorted(mode for _, mode in group)
        consecutive = len(numbers) > 1 and numbers == list(range(numbers[0], numbers[-1] + 1))
        words = f"{numbers[0]}–{numbers[-1]}" if consecutive else ", ".join(map(str, numbers))
        position = {"xytext": (8, 0), "textcoords": "offset points", "va": "center", "fontsize": LETTERS - 1}
        axes.annotate(words, (table["step"][-1], float(np.mean([value for value, _ in group]))), **position, color=DARK)
