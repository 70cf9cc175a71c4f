"""Reading of webs from two CSV files, one of points and one of lines.

May change: private functions, texts of errors, `LISTED` and `ALIKE`, which are of these. Must stay: names of columns in
`POINTS`, `LINES` and `NAMES`, a file format that `mesh_file` describes; what `web_of` returns, and `columns_of`, which
`effects.fold`, `boundary.heights` and `law_keys` call. Tests: ``tests/net/test_mesh_files.py``,
``tests/net/test_bad_files.py``.
"""

from __future__ import annotations

import csv
import difflib

import numpy as np

from ..errors import InputError
from ..findings import NOTE, WARNING, Finding
from ..messages import nearest, quote
from .web import Web

POINTS = {"x": True, "y": True, "z": True, "name": False, "support": False}
LINES = {"i": True, "j": True, "natural_length": False, "group": False}
"""Columns of both files; True for a required column."""
NAMES = (*POINTS, *LINES)
"""Names of all columns."""
LISTED = 5
"""Largest number of problems in a message, which gives the number of the others."""
ALIKE = 0.75
"""Similarity above which the name of a column may be misspelt."""


def web_of(points, lines, columns=None, first=0):
    """The `Web` of the paths of its points and of its lines.

    ``columns`` are those in the files by the names in `NAMES`, and ``first`` is the number of the first point in the
    columns i and j. Missing files, files without rows, and wrong columns, cells and node numbers are refused.
    """
    columns, problems = columns or {}, Problems()
    nodes, ends = (_table(path, known, columns, problems) for path, known in ((points, POINTS), (lines, LINES)))
    places = [nodes.numbers(key, problems) for key in "xyz"]
    pairs = [ends.numbers(key, problems, integer=True) for key in "ij"]
    rim = nodes.numbers("support", problems, empty=0.0)
    length = ends.numbers("natural_length", problems)
    _check_ends(ends, pairs, len(nodes), first, problems)
    problems.refuse()
    names = {}
    for number, name in enumerate(nodes.columns.get("name", ())):
        if name:
            names.setdefault(name, []).append(number)
    return Web(
        np.column_stack([np.asarray(column) for column in places]),
        np.column_stack([np.asarray(end) for end in pairs]) - first,
        length,
        rim=() if rim is None else np.flatnonzero(rim),
        kind="file",
        names=names,
        groups=ends.columns.get("group"),
        notes=[finding for table in (nodes, ends) for finding in table.notes()],
    )


def columns_of(path, names):
    """Numbers in the columns of some names of a file, which has no others, shape (rows, names)."""
    problems = Problems()
    columns = _table(path, dict.fromkeys(names, True), None, problems)
    for name in columns.others if all(name in columns.columns for name in names) else ():
        problems.add(f"{path.name}: column {quote(name)} is unknown, {nearest(name, names)}")
    values = [columns.numbers(key, problems) for key in names]
    problems.refuse()
    return np.column_stack([np.asarray(column) for column in values])


class Problems:
    """Problems of files, collected for one message."""

    def __init__(self):
        self._texts, self._hints = [], []

    def add(self, text):
        """Add a problem."""
        self._texts.append(text)

    def hint(self, text):
        """Add a remedy at the end of the message."""
        self._hints.append(text)

    def refuse(self):
        """Raise an `InputError` that lists the first `LISTED`, if there are any."""
        if self._texts:
            more = len(self._texts) - LISTED
            counted = [f"and {more} problem{'s' * (more > 1)} more"] if more > 0 else []
            raise InputError("; ".join([*self._texts[:LISTED], *counted, *self._hints]))


class _Columns:
    """Columns of a CSV file as texts, by name; ``others`` are names of columns that a web does not have."""

    def __init__(self, path, columns, rows, others=(), known=()):
        self.path, self.columns, self._rows, self.others, self._known = path, columns, rows, others, known

    def __len__(self):
        return len(self._rows)

    def at(self, number):
        """Name of a row in messages."""
        return f"{self.path.name}, line {self._rows[number]}"

    def numbers(self, key, problems, integer=False, empty=None):
        """A column as numbers; None for a missing column; cells that are no numbers are added to the problems."""
        if key not in self.columns:
            return None
        values = []
        for number, text in enumerate(self.columns[key]):
            try:
                if "_" in text:  # which Python takes in numbers
                    raise ValueError
                values.append(empty if not text and empty is not None else int(text) if integer else float(text))
            except ValueError:
                kind = "a whole number" if integer else "a number"
                problems.add(f"{self.at(number)}: {key} = {quote(text)} must be {kind}")
                values.append(-1)
        try:
            return np.array(values, dtype=np.int64 if integer else np.float64)
        except OverflowError:
            return np.array([min(max(value, -(2**62)), 2**62) for value in values])

    def notes(self):
        """Findings on ignored columns, with a warning of names that may be misspelt."""
        if not self.others:
            return
        listed = ", ".join(map(quote, self.others))
        text = f"{self.path.name}: column{'s' * (len(self.others) > 1)} {listed} left alone"
        free, severity = [name for name in self._known if name not in self.columns], NOTE
        for column in self.others:
            for name in difflib.get_close_matches(column, free, n=1, cutoff=ALIKE):
                text += f'; if {quote(column)} is {name}, give columns = {{{name} = "{column}"}}'
                severity = WARNING
        yield Finding("mesh-file", text, "web", severity)


def _check_ends(ends, pairs, count, first, problems):
    """Add node numbers without a point to the problems."""
    if count == 0 or any(column is None for column in pairs):
        return
    numbers = np.column_stack(pairs)
    wrong = np.flatnonzero(((numbers < first) | (numbers >= first + count)).any(axis=1))
    outside = [number for number in wrong if all(ends.columns[key][number].lstrip("+-").isdigit() for key in "ij")]
    for number in outside:
        problems.add(
            f"{ends.at(number)}: nodes {numbers[number].tolist()} must be {first} … {first + count - 1}, counted from "
            f"{first}"
        )
    if outside and first == 0 and numbers.min() == 1 and numbers.max() == count:
        problems.hint("first = 1 reads numbers that begin at 1")


def _table(path, known, names, problems):
    """The `_Columns` of a file; ``names`` are those of columns that have other names in it, None if none may."""
    may_rename, names = names is not None, names or {}
    if not path.is_file():
        raise InputError(f"there is no file {path}")
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, skipinitialspace=True)
            rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(map(str.strip, row))]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path.name} is not a text of rows with commas: {error}") from None
    given = rows[0][1] if rows else []
    head = [name.lower() for name in given]
    if len(set(head)) < len(head):
        problems.add(f"{path.name}: a column is listed twice in {quote(','.join(given))}")
    wanted = {name: names.get(name, name).strip().lower() for name in known}
    missing = [name for name in known if wanted[name] not in head and (known[name] or name in names)]
    others = [name for name, lower in zip(given, head, strict=True) if lower not in wanted.values()]
    if missing and others:
        several = len(others) > 1
        hint = f"known: {', '.join(known)}" if several else nearest(others[0], known)
        listed = ", ".join(map(quote, others))
        problems.add(f"{path.name}: column{'s' * several} {listed} {'are' if several else 'is'} unknown, {hint}")
    for name in missing:
        called = f", called {quote(names[name])} in columns," if name in names else ""
        problems.add(f"{path.name}: column {name}{called} is missing, the first row has {quote(','.join(given))}")
    also = ", and first = 1 that numbers begin at 1" if "i" in missing else ""
    if may_rename and any(name not in names for name in missing) and given:
        problems.hint(
            "columns = {" + ", ".join(f'{name} = "..."' for name in missing) + "} says what they are called" + also
        )
    body = [(number, row) for number, row in rows[1:] if len(row) == len(head)]
    for number, row in rows[1:]:
        if len(row) != len(head):
            problems.add(f"{path.name}, line {number} has {len(row)} cells, the first row {len(head)}")
    if rows and len(rows) < 2:
        problems.add(f"{path.name} has no rows below its first")
    columns = {name: [row[head.index(column)] for _, row in body] for name, column in wanted.items() if column in head}
    return _Columns(path, columns, [number for number, _ in body], others, known)
