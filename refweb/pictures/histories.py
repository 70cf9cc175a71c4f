"""Histories of a run over time, results of its load steps and frequencies of its modes, with ± where it is known."""

from __future__ import annotations

import numpy as np

from ..results.units import scale_of
from .plot_data import bar, told, unit_of
from .sheet import COLOURS, DARK, LETTERS, MARKERS, PALE, STYLES, Panel, dot, label, legend, telling

OF_ALL = "Points: results of all steps, with ± where it is known. Lines: rows of the history."
MOST_TICKS = 12
"""Number of load steps up to which each has its own mark on the axis."""


def history(shown, name):
    """The panel of a column of the history over time: its result stands as a point with ± where it was found."""
    having = [s for s in shown if name in s.units]
    unit = having[0].units[name]
    found = [s.results[name].value for s in having if name in s.results]
    factor, called = unit_of(unit, *(s.history[name] for s in having), *found)
    second, clock = clock_of(having)

    def draw(axes):
        entries = []
        for s in having:
            keep = telling(s.history[name])
            style = {"color": s.ink.colour, "linestyle": s.ink.style, "linewidth": 1.4}
            style["marker"] = dot(keep)
            (line,) = axes.plot(s.along[keep] / second, s.history[name][keep] / factor, **style)
            result = s.results.get(name)
            if result is None or not np.isfinite(result.value):
                entries += [(line, s.name or "")] if s.name else []
                continue
            error = bar(result, factor)
            ink = {"color": s.ink.colour, "markeredgecolor": DARK, "capsize": 5.0, "elinewidth": 2.0, "markersize": 6.0}
            point = axes.errorbar(result.time / second, result.value / factor, error, fmt=s.ink.marker, **ink, zorder=3)
            entries.append((point, s.said(f"{told(result)} at t = {_time(result.time, second, clock)}")))
        marks(axes, having, second)
        label(axes, name, called)
        legend(axes, entries)

    notes = [OF_ALL] if any(name in s.results for s in having) else []
    return [Panel(draw, f"time [{clock}]", notes=(*notes, *(note for s in having for note in s.other_errors(name))))]


def clock_of(shown):
    """(factor, name) of the unit of time of some runs: seconds, but for runs of less than a tenth of one."""
    longest = max((float(np.abs(s.along).max(initial=0.0)) for s in shown), default=0.0)
    return (1.0, "s") if longest >= 0.1 else scale_of(longest, "s")


def _time(value, factor, name):
    return f"{value / factor:.6g} {name}"


def marks(axes, shown, second):
    """Mark events by lines across, with their names where one run is shown."""
    for s in shown:
        for name, time in s.events:
            axes.axvline(time / second, color=s.ink.colour if s.name else PALE, linestyle=":", linewidth=1.2)
            if not s.name:
                place = {"xy": (time / second, 0.97), "xycoords": axes.get_xaxis_transform()}
                look = {"rotation": 90, "ha": "right", "va": "top", "fontsize": LETTERS - 2, "color": DARK}
                axes.annotate(name, **place, **look, parse_math=False)


def steps(shown, name):
    """The panel of a result over the load steps, with its ± as bars."""
    having = [s for s in shown if any(name in results for _, results in s.steps)]
    if len(having) < len(shown):
        return _columns(shown, name, "load step", [(s.along, s.history[name]) for s in shown])
    found = [[(step, results[name]) for step, results in s.steps if name in results] for s in having]
    unit = found[0][0][1].unit
    factor, called = unit_of(unit, *(np.array([result.value for _, result in own]) for own in found))

    def draw(axes):
        entries = []
        for s, own in zip(having, found, strict=True):
            at, values = [step for step, _ in own], [result.value / factor for _, result in own]
            style = {"color": s.ink.colour, "linestyle": s.ink.style, "linewidth": 1.2}
            axes.plot(at, values, **style)
            for step, result in own:
                ink = {"color": s.ink.colour, "fmt": s.ink.marker, "capsize": 5.0, "elinewidth": 2.0, "markersize": 6.0}
                point = axes.errorbar(step, result.value / factor, bar(result, factor), **ink)
            entries.append((point, s.said(f"{told(own[-1][1])} at step {own[-1][0]:g}")))
        tick_steps(axes, [step for own in found for step, _ in own])
        label(axes, name, called)
        legend(axes, entries)

    return [Panel(draw, "load step", notes=tuple(note for s in having for note in s.other_errors(name)))]


def tick_steps(axes, steps):
    """Mark load steps on the axis where they are few."""
    if len(steps := sorted(set(steps))) <= MOST_TICKS:
        axes.set_xticks(steps, [f"{step:g}" for step in steps])


def of_modes(shown, name):
    """The panel of a column of the table of modes over the number of the mode, at the last load step."""
    last = [s.history["step"] == s.history["step"][-1] for s in shown]
    pairs = [(s.history["mode"][here], s.history[name][here]) for s, here in zip(shown, last, strict=True)]
    return _columns(shown, name, "mode", pairs)


def _columns(shown, name, along, pairs):
    """The panel of pairs of what a column is over and its values, without ±."""
    factor, called = unit_of(shown[0].units[name], *(values for _, values in pairs))

    def draw(axes):
        entries = []
        for s, (at, values) in zip(shown, pairs, strict=True):
            style = {"color": s.ink.colour, "marker": s.ink.marker}
            style["linestyle"] = "" if along == "mode" else s.ink.style  # between modes there is nothing
            (line,) = axes.plot(at, values / factor, **style)
            entries += [(line, s.name)] if s.name else []
        label(axes, name, called)
        legend(axes, entries)

    return [Panel(draw, along)]


def frequencies(shown):
    """The panel of natural frequencies with their ±: over the mode, of several load steps over the step."""
    several = any(len(np.unique(s.history["step"])) > 1 for s in shown)
    largest = max(float(np.abs(s.history["frequency"]).max(initial=0.0)) for s in shown)
    factor, called = scale_of(largest, "Hz")

    def draw(axes):
        entries = []
        for s in shown:
            table = s.history
            own = {"step": table["step"], "mode": table["mode"], "frequency": table["frequency"] / factor}
            errors = table["error"] / factor
            count = (max(errors, default=0.0), len(np.unique(own["mode"])))
            draw_one = _over_steps if several else _over_modes
            handle = draw_one(axes, own, errors, s)
            entries.append((handle, s.said(f"{count[1]} modes, ± at most {count[0]:.2g} {called}")))
            unstable = own["frequency"] < 0
            if unstable.any():
                at = own["step" if several else "mode"][unstable]
                look = {"color": DARK, "marker": "x", "linestyle": "", "markersize": 10, "markeredgewidth": 2.5}
                (cross,) = axes.plot(at, own["frequency"][unstable], **look, zorder=4)
                entries.append((cross, "below zero: imaginary, unstable"))
            if several and not s.name:
                _number_modes(axes, own)
        if several:
            tick_steps(axes, [step for s in shown for step in s.history["step"].tolist()])
        else:
            axes.xaxis.get_major_locator().set_params(integer=True)
        label(axes, "frequency", called)
        legend(axes, entries)

    return [Panel(draw, "load step" if several else "mode", 3.6)]


def _over_modes(axes, own, errors, s):
    ink = {"color": s.ink.colour, "fmt": s.ink.marker, "capsize": 5.0, "elinewidth": 2.0, "markersize": 7.0}
    return axes.errorbar(own["mode"], own["frequency"], errors, **ink)


def _over_steps(axes, own, errors, s):
    """A line for each mode by its number, from step to step."""
    handle = None
    for number, mode in enumerate(np.unique(own["mode"])):
        here = own["mode"] == mode
        single = not s.name
        ink = {"color": COLOURS[number % len(COLOURS)] if single else s.ink.colour, "capsize": 4.0, "markersize": 5.0}
        ink |= {"linestyle": STYLES[number % len(STYLES)] if single else s.ink.style, "linewidth": 1.2}
        ink["marker"] = MARKERS[number % len(MARKERS)] if single else s.ink.marker
        handle = axes.errorbar(own["step"][here], own["frequency"][here], errors[here], **ink)
    return handle


def _number_modes(axes, own):
    """Number the lines of modes at their ends; those that lie on each other together."""
    last = own["step"] == own["step"][-1]
    values, modes = own["frequency"][last], own["mode"][last].astype(int)
    near = 0.03 * max(float(np.ptp(own["frequency"])), 1e-300)
    groups = []
    for value, mode in sorted(zip(values.tolist(), modes.tolist(), strict=True)):
        if groups and value - groups[-1][-1][0] < near:
            groups[-1].append((value, mode))
        else:
            groups.append([(value, mode)])
    for group in groups:
        numbers = sorted(mode for _, mode in group)
        whole = len(numbers) > 1 and numbers == list(range(numbers[0], numbers[-1] + 1))
        words = f"{numbers[0]}–{numbers[-1]}" if whole else ", ".join(map(str, numbers))
        place = {"xytext": (8, 0), "textcoords": "offset points", "va": "center", "fontsize": LETTERS - 1}
        axes.annotate(words, (own["step"][-1], float(np.mean([value for value, _ in group]))), **place, color=DARK)
