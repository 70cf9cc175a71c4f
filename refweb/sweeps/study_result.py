"""Results of a study in memory: its rows, their statistics, and the content of its ``run.json``.

May change: the text that a `Sweep` shows. Must stay: attributes of `Sweep`, which `refweb` exports; keys of `summary`,
which are those of ``run.json`` and which `results.study_text`, pages and pictures read; `columns_of` and `row_of`,
which `sweep` imports. Tests: ``tests/sweeps/test_sweep.py``.
"""

from __future__ import annotations

import functools
import json
import pathlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..results.case_rows import ordered, results_among
from ..results.files import finite
from ..results.observables.observe import bounds_by_name
from ..results.provenance import versions
from .chances import chances
from .design import groups
from .study import Study

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas


@dataclass(eq=False, repr=False)
class Sweep:
    """Many runs of one scene, as `refweb.sweep` returns them.

    Attributes
    ----------
    study : refweb.sweeps.study.Study
        The study.
    rows : list of dict
        A row for each case, in the order of the cases: cells by column, None where nothing is known.
    columns : list of str
        Names of the columns, see `refweb.results.case_rows`.
    chances : list of dict
        Evaluation of all rows together, see `refweb.sweeps.chances.chances`.
    title : str
        Title of the scene.
    status : {"running", "solved", "failed", "interrupted"}
        Status of the study: "solved" if every case has a row, also a row with the reason of a failure.
    message : str
        Reason for which it has not ended, else empty.
    warnings : list of str
        Warnings on the results.
    cost : dict of str to float
        Times of the last start of the study [s], ``cpu_s`` without its workers; ``cases_cpu_s`` is the CPU time of all
        rows, and ``cases_compile_s`` its part for compiling.
    path : pathlib.Path, optional
        Its folder.
    """

    study: Study
    cases: list[Any]
    title: str
    rows: list[dict[str, Any]] = field(default_factory=list)
    columns: list[str] = field(default_factory=list)
    chances: list[dict[str, Any]] = field(default_factory=list)
    status: str = "running"
    message: str = ""
    warnings: list[str] = field(default_factory=list)
    cost: dict[str, Any] = field(default_factory=lambda: {"cpu_s": 0.0, "wall_s": 0.0, "compile_s": 0.0})
    path: pathlib.Path | None = None
    versions: dict[str, str] = field(default_factory=versions)
    reasons: list[str] = field(default_factory=list)

    @property
    def count(self) -> dict[str, int]:
        """Number of rows of each status, a dict."""
        counts = dict.fromkeys(("solved", "failed", "refused", "lost", "skipped", "waiting"), 0)
        for row in self.rows:
            counts[row["status"]] += 1
        return {status: number for status, number in counts.items() if number}

    @functools.cached_property
    def _not_negative(self):
        """Names of results that cannot be negative in any case."""
        tables = ("observe", "cable", "damping")
        given = {json.dumps([case.given.get(key) for key in tables]): case.given for case in self.cases if case.given}
        bounds = map(bounds_by_name, given.values())
        names = [{name for name, (lower, _) in by_name.items() if lower >= 0.0} for by_name in bounds]
        return set.intersection(*names) if names else set()

    def gather(self, known: dict[str, dict[str, Any]]) -> None:
        """Set ``rows`` of all cases from the known rows by key, and compute their statistics."""
        self.rows = [row_of(self.study, case, known) for case in self.cases]
        self.columns = columns_of(self.study, self.rows)
        pairs = list(zip(self.cases, self.rows, strict=True))
        self.chances = chances(self.study, pairs, self.columns, groups(self.study))
        for key in ("cpu_s", "compile_s"):
            self.cost[f"cases_{key}"] = float(sum(row.get(key) or 0.0 for row in self.rows))

    def to_pandas(self) -> pandas.DataFrame:
        """The rows as a `pandas.DataFrame`; pandas must be installed."""
        import pandas

        return pandas.DataFrame(self.rows, columns=self.columns)

    def values(self, name: str) -> Any:
        """Values of a result, or of a parameter by its path, in all cases, an array; NaN for a missing value."""
        import numpy as np

        from ..errors import InputError
        from ..messages import nearest, quote

        known = {item.name: f"{item.name} [{item.unit}]" for item in results_among(self.columns)}
        known |= {path: path for path in self.study.parameters}
        if name not in known:
            raise InputError(f"{quote(name)} is neither a result nor a parameter, {nearest(name, known)}")
        cells = [row.get(known[name]) for row in self.rows]
        plain = all(cell is None or isinstance(cell, int | float) for cell in cells)
        return np.array([np.nan if cell is None else cell for cell in cells], dtype=float if plain else object)

    def summary(self) -> dict[str, Any]:
        """The content of ``run.json``, a dict of plain values; ``kind`` is "sweep"."""
        return {
            "kind": "sweep",
            "status": self.status,
            "message": self.message,
            "scene": self.title,
            "title": self.study.title,
            "study": self.study.to_dict(),
            "cases": len(self.cases),
            "count": self.count,
            "reasons": self.reasons,
            "chances": finite(self.chances),
            "not_negative": [item.name for item in results_among(self.columns) if item.name in self._not_negative],
            "cost": self.cost,
            "versions": self.versions,
            "seed": self.study.seed,
            "warnings": self.warnings,
        }

    def __repr__(self) -> str:
        text = ", ".join(f"{number} {status}" for status, number in self.count.items())
        return f'<Sweep of "{self.title}": {len(self.cases)} case{"s" * (len(self.cases) != 1)}, {text or "none run"}>'


def row_of(study: Study, case: Any, known: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """The row of a case: its values and the known row of its key."""
    values = {path: case.values[path] for path in study.parameters}
    if case.given is None:
        return {"case": "", "status": "skipped", **values, "message": f"skip: {study.skip}"}
    known_row = known.get(case.key, {"status": "waiting"})
    return {"case": case.key, **values, **{k: v for k, v in known_row.items() if k != "case" and k not in values}}


def columns_of(study: Study, rows: Sequence[dict[str, Any]]) -> list[str]:
    """All columns in their order."""
    return ordered(dict.fromkeys([*study.parameters, *(name for row in rows for name in row)]))
