"""``results.csv`` of a study, a row a case: written so that a kill at any moment leaves whole rows and nothing else.

Columns are ``case``, which tells what was run by its content, ``status``, the parameters by their paths, of each result
``NAME [unit]`` with ``NAME ±`` behind it and, where there is such, ``NAME least`` and ``NAME most``, between which it
may lie anywhere, ``NAME mean`` and ``NAME deviation`` of its ensemble, and ``NAME verdict``, see
`refweb.results.error_budget`; ``statistical``, names of results of which
one run is one draw; ``message``, and what the run cost. An empty cell is what is not known. Numbers read back to the
same floats.

While a study goes rows stand in the order in which cases end, and in the end in that of the cases.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import pathlib
from typing import Any, NamedTuple

from ..errors import SolverError
from ..messages import one_line, short
from .files import number, write_atomically
from .folder import hold

NAME, ASIDE = "results.csv", "set-aside.csv"
"""The table of a study, and rows that its cases do not ask for any more."""
FIRST, LAST = ("case", "status"), ("statistical", "message", "cpu_s", "wall_s", "compile_s")
"""Columns before the parameters and behind the results."""
_TEXTS = ("case", "status", "statistical", "message")


class Named(NamedTuple):
    """A result among the columns: its name and unit."""

    name: str
    unit: str


def results_among(columns):
    """The results that columns hold, each a `Named`."""
    named = [column.rpartition(" [") for column in columns if column.endswith("]")]
    return [Named(name, unit[:-1]) for name, _, unit in named if f"{name} ±" in columns]


def result_cells(row):
    """The cells of a row that its case alone determines: without parameters, whose names may be others by now."""
    names = {result.name for result in results_among(row)}
    ends = (" ±", " least", " most", " mean", " deviation", " verdict")
    mine = {f"{result.name} [{result.unit}]" for result in results_among(row)} | {
        f"{n}{end}" for n in names for end in ends
    }
    return {column: value for column, value in row.items() if column in mine or column in (*FIRST, *LAST)}


def read(path):
    """Rows of a table, each a dict by column; none where there is no table. A row without its end is left out."""
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
        return number(value)
    if isinstance(value, str):
        return one_line(value)
    return json.dumps(value, ensure_ascii=False)


def _line(cells):
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue().encode()


def _ordered(columns):
    """Columns in their order."""
    return [*FIRST, *(c for c in columns if c not in FIRST and c not in LAST), *LAST]


def write(path, rows, columns=()):
    """Write a table anew, atomically; columns are those given and those of the rows."""
    columns = _ordered(dict.fromkeys([*columns, *(name for row in rows for name in row)]))
    content = b"".join(_line(map(_cell, line)) for line in (columns, *([row.get(c) for c in columns] for row in rows)))
    write_atomically(pathlib.Path(path), lambda name: pathlib.Path(name).write_bytes(content))
    return columns


class CaseRows:
    """The table of a study that is being run, locked for as long.

    Parameters
    ----------
    folder : path-like
        Folder of the study.
    rows : list of dict
        Rows that are there already.
    columns : sequence of str
        Columns in their order, as far as they are known.

    Raises
    ------
    SolverError
        From every method that writes, where the folder cannot be written any more.
    """

    def __init__(self, folder, rows, columns):
        self.path = pathlib.Path(folder) / NAME
        self._file: Any = None
        self.rows = list(rows)
        self._write(columns)

    def _write(self, columns):
        with self._written():
            self._columns = write(self.path, self.rows, columns)
            if self._file is not None:
                self._file.close()
            self._file = open(self.path, "ab", buffering=0)
            hold(self._file)

    def _written(self):
        return written(self.path.parent)

    def add(self, *rows):
        """Append some rows at once."""
        self.rows += rows
        if any(row.keys() - set(self._columns) for row in rows):
            self._write(dict.fromkeys([*self._columns, *(name for row in rows for name in row)]))
            return
        lines = b"".join(_line([_cell(row.get(name)) for name in self._columns]) for row in rows)
        with self._written():
            size = os.fstat(self._file.fileno()).st_size
            try:
                while lines:
                    lines = lines[self._file.write(lines) :]
            except OSError:
                self._file.truncate(size)
                raise

    def order(self, rows):
        """Let the table hold some rows in their order."""
        self.rows = list(rows)
        self._write(self._columns)

    def close(self):
        """Let go of the table."""
        self._file.close()


@contextlib.contextmanager
def written(folder):
    """Name a folder of a study where it cannot be written; see `refweb.results.folder.Folder`."""
    try:
        yield
    except OSError as error:
        raise SolverError(
            f"folder of the study {short(str(folder))}: cannot be written any more: {error.strerror or error}; "
            "rows that were written are whole, and the study goes on with what is missing"
        ) from None
