"""Webs from two CSV files, one of points and one of lines."""

from __future__ import annotations

import csv

import numpy as np

from ..errors import InputError
from ..messages import nearest, quote
from .web import Web

POINTS = {"x": True, "y": True, "z": True, "name": False, "support": False}
LINES = {"i": True, "j": True, "natural_length": False, "group": False}
"""Columns of both, and whether they must be there."""


def web_of(points, lines):
    """The `Web` of the paths of its points and of its lines."""
    nodes, ends = _table(points, POINTS), _table(lines, LINES)
    places = np.column_stack([nodes.numbers(key) for key in "xyz"])
    pairs = np.column_stack([ends.numbers(key, integer=True) for key in "ij"])
    names = {}
    for number, name in enumerate(nodes.columns.get("name", ())):
        if name:
            names.setdefault(name, []).append(number)
    rim = np.flatnonzero(nodes.numbers("support", empty=0.0)) if "support" in nodes.columns else ()
    length = ends.numbers("natural_length") if "natural_length" in ends.columns else None
    for number, pair in enumerate(pairs):
        if not 0 <= pair.min() <= pair.max() < len(places):
            raise InputError(f"{ends.at(number)}: nodes {pair.tolist()} must be 0 … {len(places) - 1}, counted from 0")
    return Web(places, pairs, length, rim=rim, kind="file", names=names, groups=ends.columns.get("group"))


def places_of(path):
    """Positions [m] in the columns x, y and z of a file, shape (rows, 3)."""
    columns = _table(path, dict.fromkeys("xyz", True))
    return np.column_stack([columns.numbers(key) for key in "xyz"])


class _Columns:
    """Columns of a CSV file as texts, by name."""

    def __init__(self, path, columns, rows):
        self.path, self.columns, self._rows = path, columns, rows

    def at(self, number):
        """Name of a row in messages."""
        return f"{self.path.name}, line {self._rows[number]}"

    def numbers(self, key, integer=False, empty=None):
        """A column as numbers."""
        values = []
        for number, text in enumerate(self.columns[key]):
            try:
                if "_" in text:  # which Python takes in numbers
                    raise ValueError
                values.append(empty if not text and empty is not None else int(text) if integer else float(text))
            except ValueError:
                kind = "a whole number" if integer else "a number"
                raise InputError(f"{self.at(number)}: {key} = {quote(text)} must be {kind}") from None
        return np.array(values, dtype=np.int64 if integer else np.float64)


def _table(path, known):
    """The `_Columns` of a file."""
    if not path.is_file():
        raise InputError(f"there is no file {path}")
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, skipinitialspace=True)
            rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(map(str.strip, row))]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path.name} is not a text of rows with commas: {error}") from None
    head = [name.lower() for name in rows[0][1]] if rows else []
    for name in head:
        if name not in known:
            raise InputError(f"{path.name}: column {quote(name)} is unknown, {nearest(name, known)}")
    for name, needed in known.items():
        if needed and name not in head:
            raise InputError(f"{path.name}: column {name} is missing, the first row has {quote(','.join(head))}")
    if len(set(head)) < len(head):
        raise InputError(f"{path.name}: a column is listed twice in {quote(','.join(head))}")
    for number, row in rows[1:]:
        if len(row) != len(head):
            raise InputError(f"{path.name}, line {number} has {len(row)} cells, the first row {len(head)}")
    columns = {name: [row[at] for _, row in rows[1:]] for at, name in enumerate(head)}
    if len(rows) < 2:
        raise InputError(f"{path.name} has no rows below its first")
    return _Columns(path, columns, [number for number, _ in rows[1:]])
