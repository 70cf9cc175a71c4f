"""The work–precision diagram: errors against CPU time, one curve per method, with failures and unknown errors.

May change: all of the drawing, `STYLES` and `OUTSIDER` among it. Must stay: statuses and fields that are read, those of
`trials.Trial`; `diagram`, which `cost` calls. Tests: ``tests/studies/test_cost.py``.
"""

from __future__ import annotations

import math

from . import dop853

STYLES = (
    ("#1b5e8c", "o"),
    ("#3c7a4c", "s"),
    ("#8a5a9e", "D"),
    ("#c8553d", "v"),
    ("#b58900", "^"),
    ("#7a4a2b", "<"),
    ("#2f8f8f", ">"),
    ("#a0527a", "h"),
)
"""Colour and marker of each method, in their order."""
OUTSIDER = ("#555555", "P")
"""Colour and marker of a method that is not refweb's."""


def diagram(cost):
    """Draw the two errors of a `refweb.studies.work_precision.Cost`, a `matplotlib.figure.Figure`."""
    from matplotlib.figure import Figure

    page = Figure(figsize=(5.6, 7.8), dpi=130, layout="constrained")  # legible on a phone as well
    halves = page.subplots(2, 1, sharex=True)
    unit = "" if cost.observable.unit == "1" else f" [{cost.observable.unit}]"
    names = f"error of {cost.observable.name}{unit}", "error of displacement at the end [m]"
    for plot, name, key, trust in zip(halves, names, ("error_observable", "error_state"), cost.trust, strict=True):
        _curves(plot, cost, key, trust)
        plot.set_ylabel(name)
        plot.grid(color="#dddddd", linewidth=0.6)
        plot.set_axisbelow(True)
        plot.spines[["top", "right"]].set_visible(False)
    for axis in (halves[0].yaxis, halves[1].yaxis, halves[1].xaxis):
        _ticked(axis)
    halves[1].set_xlabel("CPU time [s]")
    handles = halves[0].get_legend_handles_labels()
    page.legend(*handles, loc="outside lower center", ncols=2, frameon=False, fontsize=8.5)
    page.suptitle(cost.scene.title, fontsize=11)
    return page


def _curves(plot, cost, key, trust):
    values = [getattr(t, key) for t in cost.trials if getattr(t, key) > 0.0]
    floor = max(trust, 1e-3 * min(values, default=1.0))
    for index, method in enumerate(dict.fromkeys(t.method for t in cost.trials)):
        ladder = [t for t in cost.trials if t.method == method]
        colour, marker = OUTSIDER if method == dop853.NAME else STYLES[index % len(STYLES)]
        solved = [t for t in ladder if t.status == "solved"]
        times, errors = [t.cpu_s for t in solved], [max(getattr(t, key), 0.3 * floor) for t in solved]
        plot.plot(times, errors, marker=marker, markersize=4, color=colour, linewidth=1.1, label=_label(method, ladder))
        failed = [t.cpu_s for t in ladder if t.status == "failed" and math.isfinite(t.cpu_s)]
        top = {"transform": plot.get_xaxis_transform(), "markersize": 7, "markeredgewidth": 1.8}  # no error has a place
        plot.plot(failed, [0.97] * len(failed), "x", color=colour, **top)
    if values:
        plot.set(xscale="log", yscale="log")
    if trust > 0.0:
        plot.axhspan(1e-9 * floor, trust, color="#bbbbbb", alpha=0.45, linewidth=0, label="references apart: not known")
        plot.set_ylim(bottom=0.2 * floor)


def _ticked(axis):
    """Widen a logarithmic axis to at least two powers of ten, since only these have a number."""
    from matplotlib.ticker import NullFormatter

    if axis.get_scale() == "log":
        low, high = (math.log10(limit) for limit in axis.get_view_interval())
        if math.floor(high) - math.ceil(low) < 1:
            axis.axes.set(**{f"{axis.axis_name}lim": (10.0 ** math.floor(low), 10.0 ** math.ceil(high))})
        axis.set_minor_formatter(NullFormatter())


def _label(method, ladder):
    """Name of a method, with how many runs failed, were left out or refused."""
    count = {status: sum(t.status == status for t in ladder) for status in ("failed", "refused", "budget")}
    if count["refused"]:
        return f"{method} (refused)"
    parts = [f"{count['failed']} failed, ×"] * bool(count["failed"])
    parts += [f"{count['budget']} left out"] * bool(count["budget"])
    return f"{method} ({'; '.join(parts)})" if parts else method
