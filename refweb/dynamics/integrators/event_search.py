"""The time of events within a piece of a step, by bisection on what the method itself knows there."""

from __future__ import annotations

import numpy as np

from .events import crosses


def search(events, piece, value, sample_at):
    """Note the events that happen in a piece; return the time of the first that ends the run, infinite if none does.

    Parameters
    ----------
    events : ndarray of `refweb.dynamics.integrators.events.EVENT`
        What each has come to; those behind the end of the run are taken back.
    piece : refweb.dynamics.integrators.simpson_balance.Piece
        Where they are looked for: in its middle and at its end.
    value : callable
        ``value(slot, sample)`` of a probe or a sum.
    sample_at : callable
        The sample at a time in the piece.
    """
    stop, before = np.inf, piece.begin
    for sample in (piece.middle, piece.end):
        for event in events:
            if event["time"] < np.inf:
                continue
            side = event["side"]
            if crosses(event, value(event["slot"], sample)):
                event["time"] = _moment(event, value, sample_at, side, before, sample.time)
                if event["stop"]:
                    stop = min(stop, event["time"])
        before = sample.time
    times = events["time"]
    times[(times > stop) & (times < np.inf)] = np.inf
    return stop


def _moment(event, value, sample_at, side, low, high):
    """The time between two at which the value leaves a side of the level."""
    while True:
        middle = 0.5 * (low + high)
        if not low < middle < high:
            return high
        if (1.0 if value(event["slot"], sample_at(middle)) > event["level"] else -1.0) == side:
            low = middle
        else:
            high = middle
