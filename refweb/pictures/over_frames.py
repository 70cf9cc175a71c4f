"""Fields over all frames of a run: the largest value of each line, and peaks of the run between frames.

May change: private functions, `MISSED` and remarks. Must stay: names of fields, `LARGEST` and another field, which
`stage` and `line_numbers` take apart; `on_frames`, `on_peak`, `with_largest` and `with_values`, which `pictures`,
`film` and `commands.gradient` call. Tests: ``tests/pictures/test_over_frames.py``.
"""

from __future__ import annotations

import functools

import numpy as np

from ..errors import InputError
from ..results.units import readable
from .peaks import Largest, observed, when
from .stage import LARGEST, UNITS

MISSED = 1e-3
"""Relative excess of the peak of a run over all frames above which a remark says so."""


def with_largest(record, field):
    """A record whose frames have the field ``largest_NAME``: the largest NAME of each line over all frames.

    For another field to draw, or None, it is the given `refweb.pictures.record.Record`.
    """
    base = field.removeprefix(LARGEST) if isinstance(field, str) and field.startswith(LARGEST) else ""
    if not base or not record.times or base not in record.frame(next(iter(record.times))).fields:
        return record

    @functools.cache
    def largest():
        return functools.reduce(np.fmax, (values for _, values in _values_of(record, base)))

    def frame(number):
        plain = record.frame(number)
        if len(largest()) != len(plain.paths):
            raise InputError(f'field = "{field}": the frames have webs of different lines')
        return plain._replace(fields={**plain.fields, field: largest()})

    return record._replace(frame=frame)


def with_values(record, field, values):
    """A record whose frames have one more field, of values of each line or of each path, shape (paths,)."""

    def frame(number):
        plain = record.frame(number)
        return plain._replace(fields={**plain.fields, field: values})

    return record._replace(frame=frame)


def _values_of(record, field):
    """Number of each readable frame, and values of a field in it."""
    shape = None
    for number in record.times:
        try:
            values = record.frame(number).fields[field]
        except (InputError, KeyError):
            continue
        if shape is not None and values.shape != shape:
            raise InputError(f'field = "{LARGEST}{field}": the frames have webs of different lines')
        shape = values.shape
        yield number, values


def on_frames(record, field):
    """Remark on a field over all frames; empty for another field."""
    count = len(record.times)
    return f"largest over the {count} frames written" if field.startswith(LARGEST) else ""


def on_peak(record, field, high):
    """Sentence on the peak of a field over the run, if it is above the largest in all frames [SI]; else empty."""
    name = field.removeprefix(LARGEST)
    peak = _peak(record, name)
    if peak is None or not peak.value > high + MISSED * abs(high):
        return ""
    kind = "node" if name in ("displacement", "velocity") else "line"
    at = f" at {kind} {peak.line}" if peak.line is not None else ""
    clock = f", {when(peak.time, record.kind == 'dynamic')}," if peak.time is not None else ""
    return f"the peak {readable(peak.value, None, UNITS.get(name, ''))}{at}{clock} is between frames"


def _peak(record, name):
    """The largest value of a field over the run, a `refweb.pictures.peaks.Largest`; None if it is not known."""
    summary = record.summary
    try:
        if name != "utilisation":
            return observed(summary, record.scene, name)
        used, margin = summary.get("utilisation"), summary.get("margin") or {}
        if not used or record.kind != "dynamic":
            return None
        time = margin["time"] if margin.get("line") == used["line"] else None
        return Largest(used["value"], used.get("error"), used["line"], time)
    except (InputError, KeyError, TypeError, ValueError, AttributeError):  # of files that no run has written
        return None
