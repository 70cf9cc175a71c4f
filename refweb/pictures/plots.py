"""Plots of one or several runs: histories with ±, balances, spectra, stress over distance, load steps, frequencies.

`kinds` lists the plots of a record, `draw` makes a figure of records, and `plot` writes a figure of result folders.

May change: private functions, titles, and which plots are usual. Must stay: names of plots, with `SPECTRUM` and
`DISTANCE`, which are values of ``refweb plot --quantity``; arguments of `plot`, to which `commands.plot` gives its
options; `draw`, `kinds` and `as_svg`, which pages call, and `solution` the first of them; `LETTERS_STAY` and `BESIDE`,
which make equal plots equal files; `ENDINGS`, which `solution` imports; `write`, which `solution`, `sizing` and
`studies` import; public names of `Plotted`, which other files use. Tests: ``tests/pictures/test_plots.py``.
"""

from __future__ import annotations

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import InputError
from ..messages import nearest
from ..messages import quote as as_shown
from ..results.files import write_atomically
from . import balances, distances, histories, spectra
from .pictures import shows_itself, target
from .plot_data import Shown, refuse_spoilt
from .record import Record, of_folder
from .sheet import Ink, sheet

ENDINGS = ("png", "svg", "pdf")
"""Formats of plots."""
LETTERS_STAY: dict[Any, Any] = {"svg.fonttype": "none", "pdf.fonttype": 42, "svg.hashsalt": "refweb"}
"""Settings for vector files: text stays text, and elements have the same names in each run."""
BESIDE: dict[str, Any] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
"""Metadata of a file, by format: no dates, so that equal plots are equal files."""
SPECTRUM, DISTANCE = "spectrum:", "-distance"


def kinds(record):
    """Plots of a record: names for `draw` with a description each, the most useful first.

    `draw` also takes any column of the history, and for a dynamic run ``spectrum:`` before a column.
    """
    refuse_spoilt(record)
    run = Shown(record, "", Ink.of(0))
    if record.kind == "modes":
        return {"frequencies": "Natural frequencies with ±"}
    rows, dynamic = len(run.along), record.kind == "dynamic"
    over = "time" if dynamic else "the load step, with ±"
    lines = {name: f"{name} over {over}" for name in run.observables if dynamic or rows > 1}
    offered = {}
    if run.energies:
        offered["energy"] = "Energy by kind" + (", and the error of its balance" if dynamic else "")
    if dynamic and balances.has_momentum(run):
        offered["momentum"] = "Momentum against the impulses of supports and loads"
    if dynamic and rows >= spectra.FEWEST and run.observables:
        offered["spectrum"] = f"Spectrum of {run.observables[0]}"
    if record.times:
        offered |= {f"{field}{DISTANCE}": f"{field} of lines over distance" for field in distances.FIELDS}
    return lines | {name: words for name, words in offered.items() if name not in lines}


def usual(record):
    """Names of the plots that are drawn by default."""
    run = Shown(record, "", Ink.of(0))
    if record.kind == "modes":
        return ["frequencies"]
    if record.kind == "dynamic":
        return [*run.observables, *(["energy"] if run.energies else [])]
    return run.observables if len(run.along) > 1 or not record.times else [f"stress{DISTANCE}"]


def draw(records, what=None, title=None, against=None):
    """Draw some of the `kinds` of one record, or of several records in the same panels.

    Parameters
    ----------
    records : Record or sequence of Record
        Runs of one kind.
    what : str or sequence of str, optional
        Names of `kinds`, or of columns of their tables; by default observables and the energy balance, in statics the
        results over load steps, of one load step stress over distance, of modes their frequencies. ``spectrum`` is that
        of the first observable, and a field of lines is drawn over distance.
    title : str, optional
        Title above the plot; by default the titles of the scenes, with the status of runs that are not solved.
    against : str, optional
        Column over which those named in ``what`` are drawn, in place of time or load step.

    Returns
    -------
    matplotlib.figure.Figure
        Panels one below the other; a notebook shows the figure.

    Raises
    ------
    InputError
        For a name that no record has, with the nearest known name; for records of several kinds, and without rows.
    """
    return _drawn([records] if isinstance(records, Record) else list(records), what, title, against)[0]


def _drawn(records, what, title=None, against=None):
    """The figure of some records, and a text on missing data of records."""
    runs, notes = _beside(records)
    panels, missing, asked = [], {}, {}
    if against is not None and what is None:
        what = [name for name in _usual_of_all(runs) if any(name in s.units for s in runs) and name != against]
    for typed in _asked(runs, what):
        asked.setdefault(_meant(runs, typed), typed)
    for name, typed in asked.items():
        having = [s for s in runs if (_has(s, name) if against is None else {name, against} <= s.units.keys())]
        if not having:
            _refuse(runs, name, typed, against)
        panels += _panels(having, name) if against is None else histories.across(having, name, against)
        for s in runs:
            missing.setdefault(s.name, []).extend([typed] if s not in having else [])
    lacking = tuple(f"{who} has no {', '.join(names)}" for who, names in missing.items() if names)
    figure = sheet(panels, _title(runs) if title is None else title, [*notes, *lacking])
    return shows_itself(figure), lacking


def _asked(runs, what):
    """Names of the plots to draw as given, or the default ones."""
    several = isinstance(what, Iterable) and not isinstance(what, str)
    names = _usual_of_all(runs) if what is None else list(what) if several else [what]
    for name in names:
        if not isinstance(name, str):
            raise InputError(f"quantity = {as_shown(name)}: is not a name, {nearest(name, _known(runs))}")
    return names or _usual_of_all(runs)


def _known(runs):
    """All names that can be drawn of some records, with the columns of their histories."""
    return dict.fromkeys(name for s in runs for name in (*kinds(s.record), *s.units))


def _refuse(runs, name, typed, against=None):
    """Raise an `InputError` for a name that cannot be drawn, with the reason."""
    if against is not None:
        columns = dict.fromkeys(column for s in runs for column in s.units)
        key, missing = ("quantity", typed) if against in columns else ("against", against)
        raise InputError(f"{key} = {as_shown(missing)}: there is no such column, {nearest(missing, columns)}")
    known, kind = _known(runs), runs[0].record.kind
    if name.startswith(SPECTRUM) or name == "spectrum":
        if kind != "dynamic":
            has = "modes have" if kind == "modes" else f"a {kind} run has"
            raise InputError(f"quantity = {as_shown(typed)}: {has} no spectrum, which is of a history over time")
        known = [f"{SPECTRUM}{column}" for s in runs for column in list(s.units)[1:]]
    raise InputError(f"quantity = {as_shown(typed)}: there is nothing of that name, {nearest(typed, known)}")


def _meant(runs, name):
    """Full name: ``spectrum`` becomes that of the first observable, and a field that over distance."""
    if any(name in s.units for s in runs):
        return name
    if name == "spectrum":
        return next((SPECTRUM + s.observables[0] for s in runs if s.observables), name)
    return f"{name}{DISTANCE}" if name in distances.FIELDS else name


def _usual_of_all(runs):
    """Names of the default plots of several records: those of two records at least, else all."""
    names = [name for s in runs for name in usual(s.record)]
    return [name for name in names if names.count(name) > 1] or names


def _beside(records):
    """Records with names and styles for one plot, and remarks on them."""
    if not records:
        raise InputError("there is nothing to plot: name a result folder")
    for record in records:
        refuse_spoilt(record)
        record.refuse_others("plots")
    if len(kinds_of := dict.fromkeys(record.kind for record in records)) > 1:
        raise InputError(f"{' and '.join(kinds_of)} runs have no axis in common: plot them one by one")
    single = len(records) == 1
    runs = [Shown(r, "" if single else r.name, Ink.of(n)) for n, r in enumerate(records)]
    notes = [_remark(s) for s in runs if s.record.ending]
    empty = [s for s in runs if not len(s.along)]
    if len(empty) == len(runs):
        raise InputError(f"{records[0].name}: its history has no rows, so there is nothing to plot")
    notes += [f"{s.name} has no rows" for s in empty]
    return [s for s in runs if s not in empty], notes


def _remark(s):
    """Remark on a run that is not solved: its message, and its status among several runs."""
    message = str(s.record.summary.get("message") or "")[:200] if s.record.ending else ""
    return s.said(": ".join(filter(None, [s.record.ending if s.name else "", message])))


def _title(runs):
    titles = list(dict.fromkeys(s.record.title[:100] for s in runs))
    words = runs[0].record.ending if len(runs) == 1 else ""
    remark = f" — {words}" if words else ""
    return (", ".join(titles) if len(titles) <= 3 else f"{len(runs)} runs") + remark


def _has(s, name):
    """Tell if a record has the data of a name."""
    if name.startswith(SPECTRUM) and name not in s.units:
        return s.record.kind == "dynamic" and name.removeprefix(SPECTRUM) in list(s.units)[1:]
    return name in s.units or (name in kinds(s.record) and name != "spectrum")


def _panels(runs, name):
    """Panels of a name: columns have priority."""
    kind = runs[0].record.kind
    if any(name in s.units for s in runs):
        if kind == "dynamic":
            return histories.history(runs, name)
        return histories.steps(runs, name) if kind == "static" else histories.of_modes(runs, name)
    if name == "frequencies":
        return histories.frequencies(runs)
    if name.startswith(SPECTRUM):
        return spectra.spectrum(runs, name.removeprefix(SPECTRUM))
    if name.endswith(DISTANCE):
        return distances.distances(runs, name.removesuffix(DISTANCE))
    return balances.energy(runs) if name == "energy" else balances.momentum(runs)


class Plotted(NamedTuple):
    """The file of a plot, and a text on missing data of folders."""

    path: Path
    lacking: tuple[str, ...]


def plot(folders, quantity=None, out=None, against=None):
    """Draw result folders in the same panels, and write the figure; returns a `Plotted`.

    ``quantity`` and ``against`` are ``what`` and ``against`` of `draw`. ``out`` is a ``.png``, ``.svg`` or ``.pdf``, by
    default ``plot.png`` in the first folder. A folder without results, and a file or format that cannot be written, are
    refused as well.
    """
    folders = [Path(folder) for folder in folders]
    records = [of_folder(folder, with_frames=False) for folder in folders]
    if len({record.name for record in records}) < len(records):
        records = [r._replace(name=str(folder)) for r, folder in zip(records, folders, strict=True)]
    path = target(folders[0] / "plot.png" if out is None else out, ENDINGS)
    figure, lacking = _drawn(records, quantity, against=against)
    write(figure, path)
    return Plotted(path, lacking)


def write(figure, path):
    """Write a figure to a ``.png``, ``.svg`` or ``.pdf``, atomically, its text as text."""
    from matplotlib import rc_context

    ending = Path(path).suffix[1:].lower()
    with rc_context(LETTERS_STAY):
        write_atomically(
            Path(path), lambda name: figure.savefig(name, format=ending, metadata=BESIDE.get(ending), dpi="figure")
        )


def as_svg(figure):
    """A figure as the text of an SVG, for a page."""
    from matplotlib import rc_context

    text = io.StringIO()
    with rc_context(LETTERS_STAY):
        figure.savefig(text, format="svg", metadata=BESIDE["svg"])
    return text.getvalue()
