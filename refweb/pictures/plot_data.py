"""Data of a record for plots: history with units, results with ±, and the style among several records.

May change: private functions and texts. Must stay: properties of `Shown`, which panels read by name; names and units
from heads of tables, ``NAME [unit]``, a file format; `refuse_spoilt`, which `plots` imports; `unit_of`, which
`balances`, `distances` and other files import; `bar` and `text_of`, which `histories` imports. Tests:
``tests/pictures/test_plots.py``.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..results.observables.observe import bounds_by_name
from ..results.solution import Result, read_results
from ..results.units import other_errors, readable, scale_of
from .record import Record
from .sheet import Ink

RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
"""Digits of exponents."""


@dataclass(frozen=True, eq=False)
class Shown:
    """Record in a plot, with its name and style.

    Attributes
    ----------
    record : refweb.pictures.record.Record
        Record to draw.
    name : str
        Name among other records; empty for a single record.
    ink : refweb.pictures.sheet.Ink
        Style of its lines.
    """

    record: Record
    name: str
    ink: Ink

    @functools.cached_property
    def units(self):
        """Unit of each column of the history by name, "1" for numbers; the first is time, load step or mode."""
        columns = self.record.table()[0]
        if not all(column.endswith("]") and " [" in column for column in columns):
            raise InputError(f"{self.record.name}: the columns of its history have no names with units")
        return dict(column.removesuffix("]").rsplit(" [", 1) for column in columns)

    @property
    def history(self):
        """Columns of the history by name."""
        return self.record.table()[1]

    @property
    def along(self):
        """The first column: time [s], in statics the load step."""
        return self.history[next(iter(self.units))]

    @property
    def observables(self):
        """Names of the observables among the columns."""
        names = [entry.get("name") for entry in self.record.scene.get("observe") or []] or list(self.results)
        return [name for name in names if name in self.units]

    @property
    def energies(self):
        """Names of the columns of the energy balance [J]: stored and dissipated energies, work, and the total."""
        names = [name for name in list(self.units)[1 + len(self.observables) :] if self.units[name] == "J"]
        return names if "total_energy" in names else []

    @functools.cached_property
    def results(self):
        """Results by name, each a `refweb.results.solution.Result`; empty during the run."""
        return _results(self.record.summary)

    @functools.cached_property
    def bounds(self):
        """Least and largest possible value of columns of the history by name, as far as the scene determines them."""
        try:
            return bounds_by_name(self.record.scene)
        except (InputError, TypeError, AttributeError):  # of a file that no run has written
            return {}

    @property
    def events(self):
        """Names and times [s] of the events that happened."""
        happened = [event for event in self.record.summary.get("events") or [] if event.get("time") is not None]
        return [(str(event.get("name")), float(event["time"])) for event in happened]

    @functools.cached_property
    def steps(self):
        """Results of each load step: pairs of the step and its results by name."""
        return [(step["step"], _results(step)) for step in self.record.summary.get("steps") or []]

    def other_errors(self, name):
        """Text of the errors of a result besides ±."""
        result = self.results.get(name)
        return [self.said(text) for text in other_errors({name: result.plain()})] if result is not None else []

    def said(self, words):
        """A text about the record, with its name if there are several."""
        return f"{self.name}: {words}" if self.name and words else self.name or words


def _results(summary):
    return read_results(summary.get("results") or {})


def refuse_spoilt(record):
    """Refuse a record with a ``run.json`` or ``scene.toml`` that no run has written."""
    run, scene = record.summary, record.scene
    lists = [run.get("steps"), run.get("events"), scene.get("observe"), scene.get("load")]
    tables = [run.get("web"), run.get("solver"), run.get("bodies"), scene.get("web")]
    try:
        checks = [isinstance(entry, dict) for several in lists for entry in several or []]
        checks += [isinstance(entry or {}, dict) for entry in tables] + [isinstance(run.get("kind"), str | None)]
        results = [_results(given) for given in (run, *(run.get("steps") or []))]
        checks += [math.isfinite(entry.time) for given in results for entry in given.values()]
        checks += [math.isfinite(step["step"]) for step in run.get("steps") or []]
        checks += [math.isfinite(body["overlap"]) and "line" in body for body in (run.get("bodies") or {}).values()]
    except (TypeError, ValueError, AttributeError, KeyError):
        checks = [False]
    if not all(checks):
        raise InputError(f"{record.name}: its run.json or scene.toml is not what a run of refweb writes")


def unit_of(unit, *values):
    """Factor and name of a unit in which the largest of some values is readable, with a prefix or a power of ten."""
    size = float(max((np.abs(v[np.isfinite(v)]).max(initial=0.0) for v in map(np.atleast_1d, values)), default=0.0))
    factor, name = scale_of(size, unit)
    if size == 0.0 or 1e-2 <= size / factor < 1e5:
        return factor, name
    power = int(np.floor(np.log10(size)))
    return 10.0**power, f"10{str(power).translate(RAISED)} {scale_of(0.0, unit)[1]}".rstrip()


def bar(result: Result, factor=1.0):
    """± of a result as lengths below and above it, shape (2, 1); None if it is not known."""
    if (between := result.interval or result.within) is not None:
        ends = [result.value - between[0], between[1] - result.value]
        return np.array([[end if np.isfinite(end) else 0.0] for end in ends]) / factor
    return None if result.error is None else np.full((2, 1), result.error / factor)


def text_of(result: Result):
    """Text of a result with its ±."""
    words = readable(result.value, result.error, result.unit, result.within)
    if result.interval is not None:
        lower, upper = (readable(end, None, result.unit) if np.isfinite(end) else "any" for end in result.interval)
        return f"{words}, may be from {lower} to {upper}"
    return words
