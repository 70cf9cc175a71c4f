"""Events: moments at which the value of a probe, or of a sum, passes a level.

A compiled step is looked at once, at its end: a moment is known to its size. Bisection finds a moment to rounding where
values are known anywhere within a step. An event of rest: a value has stayed below a share of its largest for a time.

May change: how `search` comes to a moment, within rounding. Must stay: fields of `EVENT`, which checkpoints keep and
`rupture` reads and sets by name; fields of `Event`, which `history` fills, have the same names there. `note_events` is
called by `explicit_loop` with these arguments. Must stay as well: `EventArray`, which `records` imports; `event_rows`,
which `central_difference` and `step_observer` import; `ended_by`, which `explicit_loop`, `integrator` and `rupture`
import; `starts_above`, which `monitors` imports. Tests: ``tests/dynamics/test_events.py``,
``tests/dynamics/integrators/test_step_observer.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np
from numba import from_dtype, types

from ...kernels import Integers, Matrix, Vector, inner, kernel
from .extremes import look_at

if TYPE_CHECKING:
    from .monitors import Observed

EVENT = np.dtype(
    [
        ("slot", np.int64),
        ("level", float),
        ("rising", np.int64),
        ("at_once", np.int64),
        ("stop", np.int64),
        ("during", float),
        ("side", float),
        ("largest", float),
        ("since", float),
        ("time", float),
        ("width", float),
    ]
)
"""An event in the loop: slot, level, flags and time to last as in `Event`; the side of the level that its value is on,
1 above, −1 not and 0 before any is known; of one with a time to last the largest value so far, and the time since which
it is below the share of that [s], infinite where it is not; the time at which it has happened [s], infinite before; and
how much earlier that may have been [s]."""

EventArray = Annotated[np.ndarray, types.Array(from_dtype(EVENT), 1, "C")]


class Event(NamedTuple):
    """An event to report the time of.

    Attributes
    ----------
    slot : int
        Number of the probe or, behind the probes, of the sum.
    level : float
        The level that its value passes.
    rising : bool
        True if only passing upwards counts.
    stop : bool
        True if the event ends the run.
    at_once : bool
        True if being above at t = 0 counts, as a contact does.
    during : float
        0, or for how long the value is to stay at or below ``level`` times its largest so far [s]: it happens then.
    """

    slot: int
    level: float
    rising: bool = False
    stop: bool = False
    at_once: bool = False
    during: float = 0.0


def event_rows(events):
    """Events as an array of `EVENT`, none of which has happened."""
    rows = np.zeros(len(events), dtype=EVENT)
    for row, event in zip(rows, events, strict=True):
        for name, value in event._asdict().items():
            row[name] = value
    rows["time"] = rows["since"] = np.inf
    return rows


@kernel()
def crosses(event, value):
    """Tell if an event happens with this value, and record the side it is on."""
    side = 1.0 if value > event.level else -1.0
    before, event.side = event.side, side
    return side != before and (side > 0.0 or event.rising == 0)


@kernel()
def rests(event, t, value):
    """Tell if an event happens at t as its value has stayed below a share of its largest, and record that."""
    event.largest = max(event.largest, value)
    if value > event.level * event.largest:
        event.since = math.inf
    elif event.since == math.inf:
        event.since = t
    return t - event.since >= event.during


@kernel()
def starts_above(event, value):
    """Note the side of an event at t = 0; where it happens by being there, it has happened."""
    if crosses(event, value) and event.at_once:
        event.time = 0.0


@kernel(leaf=True, apart=("events",))
def note_events(
    t: float,
    h: float,
    x: Matrix,
    v: Matrix,
    f: Matrix,
    lines: Matrix,
    events: EventArray,
    where: Integers,
    observed: Observed,
    total: Vector,
) -> bool:
    """Note what happens at the end of a step of size h; whether that ends the run."""
    ended = False
    for e in range(events.shape[0]):
        event = events[e]
        if event.time == math.inf:
            i = event.slot
            if i < len(observed.probes):
                value = look_at(i, t, x, v, f, lines, observed, where)
            else:
                value = inner(observed.sums[i - len(observed.probes)], total)
            if rests(event, t, value) if event.during > 0.0 else crosses(event, value):
                event.time, event.width = t, h
                ended = ended or event.stop > 0
    return ended


@kernel()
def ended_by(events):
    """Tell if an event has ended the run."""
    for e in range(events.shape[0]):
        if events[e].stop and events[e].time < math.inf:
            return True
    return False


def search(events, piece, value):
    """Record the events in a piece of a step, and the time of the first that ends the run.

    Events after the end of the run are removed.

    Parameters
    ----------
    events : ndarray of `EVENT`
        State of each event.
    piece : refweb.dynamics.integrators.simpson_balance.Piece
        Piece to search: its middle and its end.
    value : callable
        ``value(piece, slot, sample)`` of a probe or a sum.

    Returns
    -------
    float
        That time [s], infinite where none does.
    """
    stop, before = np.inf, piece.start.time
    for sample in (piece.middle, piece.end):
        for event in events:
            side, low, high = event["side"], before, sample.time
            if event["time"] < np.inf:
                continue
            if event["during"] > 0.0:
                if not rests(event, sample.time, value(piece, event["slot"], sample)):
                    continue
                low = high
            elif not crosses(event, value(piece, event["slot"], sample)):
                continue
            while low < (middle := 0.5 * (low + high)) < high:
                above = value(piece, event["slot"], piece.at(middle)) > event["level"]
                low, high = (middle, high) if above == (side > 0.0) else (low, middle)
            event["time"] = high
            if event["stop"]:
                stop = min(stop, high)
        before = sample.time
    times = events["time"]
    times[(times > stop) & (times < np.inf)] = np.inf
    return stop
