"""Runs of designs: what is recorded in the folder of a sizing, what is missing, and what the rows say of a design.

The row of a run is appended as a whole, under a digest of its scene and of what is computed of it. A sizing that is
killed loses only the runs that its workers had begun.

May change: private functions and texts of progress; `FAILED`, which is below 0. Must stay: the key of a run (digest of
its scene and of its `Task`), as with another one all runs of stored sizings are made again; rows that are appended as a
whole; fields of `Judged`, which `size`, `search` and `smooth` read; `Spent`, which `search` imports; `middle`, which
`smooth` imports; public names of `Runs`, which other files use. Tests: ``tests/sizing/test_size.py``.
"""

from __future__ import annotations

import hashlib
import json
import math
import pathlib
import statistics
from collections.abc import Callable
from typing import Any, NamedTuple

from ..errors import InputError
from ..messages import one_line
from ..results import case_rows
from ..results.files import as_toml, write_json, write_text
from ..sweeps.case import solve
from ..sweeps.chances import bounds, clopper_pearson
from ..sweeps.design import KEY, Case, key_of
from ..sweeps.expressions import Interval
from ..sweeps.sweep import holds_rows, job_of, tidy
from ..sweeps.workers import Processes, through
from .case import Task
from .requirements import SCENE_FILE
from .space import Design

FAILED = Interval(-1.0, -1.0)
"""Reserve of a requirement of a design whose run gives no result."""


class Spent(Exception):
    """The largest number of runs is reached."""


class Judged(NamedTuple):
    """Results of the runs of a design.

    Attributes
    ----------
    design : refweb.sizing.space.Design
        The design.
    rows : list of dict
        Its rows, one for each draw.
    objective : refweb.sweeps.expressions.Interval
        Objective, of draws the mean; infinite for a design without results.
    reserves : tuple of refweb.sweeps.expressions.Interval
        Reserve of each requirement, see `refweb.sizing.formulas`.
    verdicts : tuple of (bool or None)
        True if a requirement holds for the whole ±, False if for no part of it, else None.
    message : str
        Reason for which it has no results, else empty.
    spread : float
        Standard deviation of the mean of the objective over draws, 0 of one draw.
    """

    design: Design
    rows: list[dict[str, Any]]
    objective: Interval
    reserves: tuple[Interval, ...]
    verdicts: tuple[bool | None, ...]
    message: str = ""
    spread: float = 0.0

    @property
    def feasible(self):
        """True if all requirements hold, False if one does not, None if one is undecided."""
        return False if False in self.verdicts else None if None in self.verdicts else True

    @property
    def value(self):
        """Middle of the objective."""
        return middle(self.objective)

    @property
    def tightest(self):
        """Smallest lower end of a reserve."""
        return min(reserve.low for reserve in self.reserves)


def middle(interval):
    """Middle of an interval; infinite ends count as they are."""
    low, high = interval
    return low if low == high else 0.5 * (low + high)


class Runs:
    """Runs of designs, each once.

    Parameters
    ----------
    problem : refweb.sizing.problem.Problem
        Requirements, space and formulas.
    out : path-like, optional
        Folder of the sizing.
    crew : refweb.sweeps.workers.Processes or Given
        Workers.

    Attributes
    ----------
    tell : callable
        Called with a line of text and the finished share.
    rows : dict
        Rows by the key of their run.
    judged : dict
        Results of each design that was asked for, a `Judged` by design.
    asked : set of str
        Keys of all runs that were asked for.
    fresh : int
        Number of runs since the start.
    ends : list of (tuple of int, float or None)
        Of each search from a start the options and the objective at its end, None where requirements are not met.
    """

    def __init__(self, problem, out, crew):
        self.problem, self.crew = problem, crew
        self.tell: Callable[..., object] = lambda text, share: None
        self.path = None if out is None else pathlib.Path(out).absolute()
        self.rows, self.judged, self.fresh, self.ends = {}, {}, 0, []
        self.asked, self._files, self._table = set(), {}, None
        if self.path is not None and holds_rows(out, "size"):
            stored = case_rows.read(self.path / case_rows.NAME)
            self.rows = {row["case"]: row for row in stored if row["status"] != "lost"}
        self.recorded = len(self.rows)

    def begin(self, summary):
        """Write the requirements and the rows that exist into the folder."""
        if self.path is None:
            return
        with case_rows.written(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
            tidy(self.path)
            self.summary(summary)
            write_text(self.path / "requirements.toml", _as_toml(self.problem.sizing))
            if not isinstance(self.problem.sizing.scene, str | tuple):
                write_text(self.path / SCENE_FILE, as_toml(self.problem.sizing.scene.to_dict()))
        self._table = case_rows.CaseRows(self.path, list(self.rows.values()), self.problem.space.names)

    def summary(self, content):
        """Write ``run.json``."""
        if self.path is not None:
            with case_rows.written(self.path):
                write_json(self.path / "run.json", content)

    def end(self):
        """Close the table of rows."""
        if self._table is not None:
            self._table.close()

    def of(self, designs, slopes=False):
        """Judge some designs, a list of `Judged`; missing runs are made.

        Parameters
        ----------
        designs : list of refweb.sizing.space.Design
            The designs.
        slopes : bool
            True for derivatives, which are in the rows.

        Raises
        ------
        Spent
            If this takes more runs than the requirements allow.
        """
        cases, missing = {design: self._cases(design, slopes) for design in designs}, {}
        for design, runs in list(cases.items()):
            keys = {case.key for case, *_ in runs if case.given is not None}
            if len(self.asked | keys) > self.problem.sizing.runs:
                del cases[design]
                continue
            self.asked |= keys
            missing |= {run[0].key: run for run in runs if run[0].given is not None and run[0].key not in self.rows}
        self._run(missing)
        self.judged |= {design: self._judge(design, runs) for design, runs in cases.items()}
        if len(cases) < len(set(designs)):
            raise Spent
        return [self.judged[design] for design in designs]

    def _cases(self, design, slopes):
        """(Case, base scene, task) of each draw; a case without ``given`` is refused, and ``part`` says why."""
        problem, cases = self.problem, []
        numbers = tuple((path, self.problem.space.settings(design)[path]) for path in problem.space.paths)
        task = Task(problem.quantities, problem.results if slopes else (), numbers if slopes else ())
        for draw in problem.drawn:
            try:
                base, settings, given, scene = problem.space.scene(design, draw)
            except InputError as error:
                cases.append((Case({}, 0, 0, part=one_line(str(error))), None, None))
                continue
            text = json.dumps([key_of(scene, self._files), task], allow_nan=False)
            key = hashlib.sha256(text.encode()).hexdigest()[:KEY]
            values = problem.space.values(design) | draw
            cases.append((Case(values, 0, 0, key=key, given=given), base, (task, settings)))
        return cases

    def _run(self, missing):
        """Run missing cases: one in this process, several in workers."""
        local = isinstance(self.crew, Processes)
        jobs = [
            job_of(base, case._replace(values=settings), local, task=task)
            for case, base, (task, settings) in missing.values()
        ]
        single, left = local and len(jobs) == 1, self.problem.sizing.runs - len(self.asked) + len(jobs)
        for outcome in map(solve, jobs) if single else through(jobs, self.crew, last=False) if jobs else ():
            row = {"case": outcome.key, **missing[outcome.key][0].values, **outcome.cells}
            self.rows[outcome.key] = row
            self.fresh += 1
            if self._table is not None:
                self._table.add(row)
            before = f", {self.recorded} recorded before" if self.recorded else ""
            left -= 1
            self.tell(f"{self.fresh} runs{before}, at most {left} left", 1.0 - left / self.problem.sizing.runs)

    def _judge(self, design, cases):
        """The `Judged` of a design."""
        problem = self.problem
        rows = [self.rows.get(case.key, {"status": "refused", "message": case.part}) for case, *_ in cases]
        values = [self._values(design, row) for row in rows]
        lacking = next((row for row, known in zip(rows, values, strict=True) if known is None), None)
        message, ends, spread = "", (math.inf, math.inf), 0.0
        if lacking is None:
            objectives = [problem.objective.number(known) for known in values]
            ends = [sum(part) / len(objectives) for part in zip(*objectives, strict=True)]
            if len(objectives) > 1 and all(map(math.isfinite, ends)):
                spread = statistics.stdev(map(middle, objectives)) / math.sqrt(len(objectives))
            if not all(map(math.isfinite, ends)):
                message, ends = f"{problem.sizing.minimise} has no finite value", (math.inf, math.inf)
        else:
            names = [item.name for item in case_rows.results_among(lacking)]
            message = lacking["message"] or f"no value of {', '.join(sorted(problem.used.difference(names)))}"
        pairs = [self._of_requirement(name, values) for name in problem.requirements]
        return Judged(
            design,
            rows,
            Interval(*ends),
            *map(tuple, zip(*pairs, strict=True)),
            message=one_line(message),
            spread=spread,
        )

    def _values(self, design, row):
        """Values by name for formulas; None where the row has no results."""
        if row["status"] != "solved":
            return None
        results = case_rows.results_among(row)
        values = bounds(row, results, self.problem.space.values(design), bool(self.problem.sizing.draws))
        return values if self.problem.used <= values.keys() else None

    def values_of(self, judged):
        """Values by name of the first draw of a design, None where its run has no results."""
        return self._values(judged.design, judged.rows[0])

    def _of_requirement(self, name, values):
        """(Reserve, verdict) of a requirement over all draws."""
        formula, sizing = self.problem.requirements[name], self.problem.sizing
        probability = sizing.requirements[name].probability
        verdicts = [False if known is None else formula(known) for known in values]
        if probability is not None:
            true, level = verdicts.count(True), sizing.confidence
            certain, possible = (
                clopper_pearson(n, len(values), level)[0] for n in (true, len(values) - verdicts.count(False))
            )
            reserve = Interval(certain / probability - 1.0, possible / probability - 1.0)
            return reserve, True if certain > probability else None if possible > probability else False
        reserves = [FAILED] if None in values else [r for known in values for r in formula.reserves(known)]
        verdict = False if False in verdicts else None if None in verdicts else True
        return Interval(min(r.low for r in reserves), min(r.high for r in reserves)), verdict


def _as_toml(sizing):
    """Requirements as TOML, with paths that lead to the same files."""
    import tomli_w

    given, folder = sizing.to_dict(), sizing.folder

    def placed(name):
        return str((folder / name).resolve()) if folder is not None and (folder / name).is_file() else name

    scenes = [placed(name) for name in sizing.scenes]
    given["scene"] = scenes if isinstance(sizing.scene, tuple) else scenes[0]
    for values in given["parameters"].values():
        if isinstance(values.get("catalogue"), str):
            values["catalogue"] = placed(values["catalogue"])
    return tomli_w.dumps(dict(sorted(given.items(), key=lambda item: isinstance(item[1], dict))))
