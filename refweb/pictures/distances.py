"""Panel of stress, tension or strain of lines over their distance from the point of impact or load.

May change: all of the drawing, and `MANY`. Must stay: `FIELDS`, which are fields of frames and of which `plots.kinds`
makes names of plots (values of ``refweb plot --quantity``); `distances`, which `plots` imports. Tests:
``tests/pictures/test_plots.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..net.web import Web
from ..results.units import readable
from .frames import Frame
from .histories import bounds_of
from .limits import limit
from .plot_data import unit_of
from .record import CLOCKS
from .sheet import PALE, Panel, label, legend

FIELDS = {"stress": "Pa", "tension": "N", "strain": "1"}
"""Fields that can be drawn, with their units."""
MANY = 4000
"""Number of lines above which vector files store their points as an image."""


class Spread(NamedTuple):
    """Values of lines, and their distances from a point.

    Attributes
    ----------
    frame : refweb.pictures.frames.Frame
        The instant.
    values : ndarray, shape (lines,)
        Their field [SI].
    distance : ndarray, shape (lines,)
        Distance of the middle of each line from the point, in the undeformed web [m].
    slack : ndarray of bool, shape (lines,)
        Slack lines.
    origin : str
        Name of the point.
    remark : str
        Remark on the time of the frame, if the largest value belongs to another time; else empty.
    """

    frame: Frame
    values: np.ndarray
    distance: np.ndarray
    slack: np.ndarray
    origin: str
    remark: str


def spread(record, field):
    """The `Spread` of a field at the frame nearest its largest value."""
    if not record.times:
        raise InputError(f"{record.name}: has no frames, so it is not known what its lines have")
    name, when = largest(record, field)
    frame = record.frame(min(record.times, key=lambda number: abs(record.times[number] - when)))
    if field not in frame.fields:
        raise InputError(f"{record.name}: its frames hold no {field}")
    values, middles = np.asarray(frame.fields[field]), frame.origin.mean(axis=1)
    origin_point, words = _origin(record, frame, middles, values, field)
    remark = f"The frame at {at(record, frame.time)} is nearest to {name}, which is of {at(record, when)}."
    remark = "" if frame.time == when or not name else remark
    return Spread(frame, values, np.linalg.norm(middles - origin_point, axis=1), frame.slack, words, remark)


def largest(record, field):
    """Name and time of the result of a field, or of the first result; without results "" and the last time."""
    results = record.summary.get("results") or {}
    asked = {entry.get("name"): entry for entry in record.scene.get("observe") or []}
    names = [name for name in results if asked.get(name, {}).get("quantity") == field]
    name = next((name for name in [*names, *results] if results[name].get("time") is not None), None)
    if name is None:
        return "", max(record.times.values())
    steps = [entry[name] for step in record.summary.get("steps") or [] if name in (entry := step.get("results", {}))]
    return name, max(steps or [results[name]], key=lambda entry: abs(entry["value"] or 0.0))["time"]


def _origin(record, frame, middles, values, field):
    """Position [m] and name of the point of impact or load, of the largest value, or of the centre of the web."""
    numbers = np.asarray(frame.fields.get("line", np.arange(len(values))))
    touched = {
        name: body for name, body in (record.summary.get("bodies") or {}).items() if body.get("line") is not None
    }
    if touched:
        name = max(touched, key=lambda body: touched[body]["overlap"])
        return middles[numbers == touched[name]["line"]].mean(axis=0), f'where "{name}" touches deepest'
    loaded = _loaded(record, frame, numbers)
    if loaded is not None:
        return loaded
    if frame.slack.all() or not (values > 0.0).any():
        why = "all lines are slack" if frame.slack.all() else f"no line has {field}"
        points = frame.origin.reshape(-1, 3)
        return 0.5 * (points.min(axis=0) + points.max(axis=0)), f"the centre of the web, as {why}"
    line = int(np.nanargmax(values))
    return middles[line], f"line {int(numbers[line])}, where {field} is largest"


def _loaded(record, frame, numbers):
    """Position and name of the loaded node; None unless exactly one node is loaded."""
    loads = record.scene.get("load") or []
    count = (record.summary.get("web") or {}).get("nodes", 0)
    nodes = np.zeros((int(frame.ends.max()) + 1, 3))
    nodes[frame.ends] = frame.origin[:, [0, -1]]
    if not loads or not 0 < count <= len(nodes):
        return None
    first = np.unique(numbers, return_index=True)[1]  # the elements of a line follow each other
    lines = np.column_stack([frame.ends[first, 0], frame.ends[np.append(first[1:], len(numbers)) - 1, 1]])
    try:
        web = Web(points=nodes[:count], lines=lines, kind=str((record.scene.get("web") or {}).get("kind", "inline")))
        loaded_nodes = np.unique(np.concatenate([web.find(load["node"]) for load in loads]))
    except (InputError, KeyError, ValueError):  # a name that the scene alone knows
        return None
    return (nodes[loaded_nodes[0]], f"node {loaded_nodes[0]}, which is loaded") if len(loaded_nodes) == 1 else None


def distances(runs, field):
    """The panel of a field over the distance from the point of impact or load."""
    spreads = [spread(s.record, field) for s in runs]
    factor, called = unit_of(FIELDS[field], *(item.values for item in spreads))
    metre, unit = unit_of("m", *(item.distance for item in spreads))

    def draw(axes):
        entries = []
        for s, item in zip(runs, spreads, strict=True):
            taut, many = ~item.slack, len(item.values) > MANY
            size = 3.0 if len(item.values) > 500 else 5.0
            dots = {"linestyle": "", "markersize": size, "rasterized": many, "markeredgewidth": 0.0, "alpha": 0.75}
            far, values = item.distance / metre, item.values / factor
            origin_text = f", from {item.origin}" if len(places) > 1 else ""
            when = at(s.record, item.frame.time)
            if taut.any():
                (points,) = axes.plot(far[taut], values[taut], marker=s.ink.marker, color=s.ink.colour, **dots)
                largest = readable(float(np.nanmax(item.values)), None, FIELDS[field])
                entries.append((points, s.said(f"lines at {when}, at most {largest}{origin_text}")))
            if item.slack.any():
                style = {"linestyle": "", "marker": "x", "markersize": size + 1, "rasterized": many}
                (points,) = axes.plot(
                    far[item.slack], values[item.slack], color=s.ink.colour if s.name else PALE, **style
                )
                all_of_it = "" if taut.any() else f" at {when}{origin_text}"
                entries.append((points, s.said(f"slack: {item.slack.sum()} of {len(item.slack)} lines{all_of_it}")))
        values = np.concatenate([item.values for item in spreads]) / factor
        limit(axes, values, bounds=bounds_of(runs, field, factor))
        axes.set_xlim(left=0.0)
        label(axes, field, called)
        legend(axes, entries)

    places = dict.fromkeys(item.origin for item in spreads)
    origin_text = f"\nfrom {next(iter(places))}" if len(places) == 1 else ""
    return [
        Panel(
            draw, f"distance in the undeformed web [{unit}]{origin_text}", 3.4, tuple(item.remark for item in spreads)
        )
    ]


def at(record, time):
    """Text of a time or load step."""
    return CLOCKS[record.kind].format(time)
