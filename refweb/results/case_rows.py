"""``results.csv`` of a study, one row a case. A kill at any moment leaves whole rows and nothing else.

The columns are ``case``, a key of the content of the case; ``status``; the parameters by their paths; for each result
``NAME [unit]`` and ``NAME ±``; ``statistical``, the names of results of which one run is one draw; ``message``; and the
cost of the run. Some results have more columns. ``NAME least`` and ``NAME most`` are the ends of an interval in which
the result may lie. ``NAME mean`` and ``NAME deviation`` are those of its ensemble. ``NAME verdict`` is its verdict, see
`refweb.results.error_budget`. An empty cell means that the value is not known. Numbers read back to the same floats.

Rows are in the order in which cases end while a study runs, and in the order of the cases when it has ended.

May change: private functions; how rows are buffered and read. Must stay: names of files (`NAME`, `ASIDE`), names and
endings of columns above and in `FIRST` and `LAST`, a file format that `sweeps`, `sizing.runs`, `pages.study` and
`pictures.studies` read (a new column may be added); a row that is appended as a whole; numbers that read back to the
same floats; all names that `sweeps.sweep`, `sizing.runs` and other files import. Tests: ``tests/sweeps/test_sweep.py``.
"""

from __future__ import annotations

import csv
import io
import json
import pathlib
from typing import Any, NamedTuple

from ..messages import one_line, short
from . import files
from .folder import hold

NAME, ASIDE = "results.csv", "set-aside.csv"
"""File of the table of a study; file of rows that are not among its cases any more."""
FIRST, LAST = ("case", "status"), ("statistical", "message", "cpu_s", "wall_s", "compile_s")
"""Columns before the parameters, and columns after the results."""
_TEXTS = ("case", "status", "statistical", "message")


class Named(NamedTuple):
    """A result among the columns: its name and unit."""

    name: str
    unit: str


def results_among(columns):
    """The results among columns, each a `Named`."""
    named = [column.rpartition(" [") for column in columns if column.endswith("]")]
    return [Named(name, unit[:-1]) for name, _, unit in named if f"{name} ±" in columns]


def result_cells(row):
    """The cells of a row that its case determines: all but parameters, whose names may have changed."""
    mine = {*FIRST, *LAST}
    for name, unit in results_among(row):
        mine |= {f"{name}{end}" for end in (f" [{unit}]", " ±", " least", " most", " mean", " deviation", " verdict")}
    return {column: value for column, value in row.items() if column in mine}


def read(path):
    """Rows of a table, each a dict by column; empty without a table. A row without its end is left out."""
    try:
        with open(path, encoding="utf-8", newline="") as file:
            text = file.read()
    except FileNotFoundError:
        return []
    lines = csv.reader(io.StringIO(text[: text.rfind("\n") + 1], newline=""))
    columns = next(lines, [])
    return [
        {name: _read(name, cell) for name, cell in zip(columns, line, strict=True)}
        for line in lines
        if len(line) == len(columns)
    ]


def _read(name, cell):
    if name in _TEXTS:
        return cell
    if cell == "":
        return None
    try:
        return json.loads(cell)
    except ValueError:
        try:
            return float(cell)  # inf and nan, as Python writes them
        except ValueError:
            return cell


def _cell(value):
    if value is None:
        return ""
    if isinstance(value, float):
        return files.number(value)
    if isinstance(value, str):
        return one_line(value)
    return json.dumps(value, ensure_ascii=False)


def _line(cells):
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue().encode()


def ordered(columns):
    """Columns in their order."""
    return [*FIRST, *(c for c in columns if c not in FIRST and c not in LAST), *LAST]


def write(path, rows, columns=()):
    """Write a table anew, atomically; columns are those given and those of the rows."""
    columns = ordered(dict.fromkeys([*columns, *(name for row in rows for name in row)]))
    content = b"".join(_line(map(_cell, line)) for line in (columns, *([row.get(c) for c in columns] for row in rows)))
    files.write_atomically(pathlib.Path(path), lambda name: pathlib.Path(name).write_bytes(content))
    return columns


class CaseRows:
    """The table of a study during its run, locked until the run ends.

    Parameters
    ----------
    folder : path-like
        Folder of the study.
    rows : list of dict
        Rows that exist already.
    columns : sequence of str
        Columns that are known already, in their order.

    Raises
    ------
    SolverError
        From every method that writes, if the folder cannot be written any more.
    """

    def __init__(self, folder, rows, columns):
        self.path = pathlib.Path(folder) / NAME
        self._file: Any = None
        self.rows = list(rows)
        self._write(columns)

    def _write(self, columns):
        with written(self.path.parent):
            self._columns = write(self.path, self.rows, columns)
            if self._file is not None:
                self._file.close()
            self._file = open(self.path, "ab", buffering=0)
            hold(self._file)

    def add(self, *rows):
        """Append some rows at once."""
        self.rows += rows
        if any(row.keys() - set(self._columns) for row in rows):
            self._write(dict.fromkeys([*self._columns, *(name for row in rows for name in row)]))
            return
        lines = b"".join(_line([_cell(row.get(name)) for name in self._columns]) for row in rows)
        with written(self.path.parent):
            files.append(self._file, lines)

    def order(self, rows):
        """Write the table with the given rows in their order."""
        self.rows = list(rows)
        self._write(self._columns)

    def close(self):
        """Close the table, which ends its lock."""
        self._file.close()


def written(folder):
    """Turn an error of writing into a `SolverError` that names the folder of the study."""
    left = "rows that were written are whole, and the study goes on with what is missing"
    return files.written(f"folder of the study {short(str(folder))}", left)
