"""Run of a study: find the missing cases, run them in workers, and append their rows to the folder of the study.

A study can continue from the state of its folder at any time. The files of a case are written before its row, and a row
is appended as a whole. Therefore a study that is killed loses only the cases that its workers were running. The key of
a row is a digest of its scene: another study with the same case finds it.

May change: private functions and texts, `STUDIES` among them. Must stay: `sweep`, its arguments and result, which
`refweb` exports; files of a case before its row, and rows that are appended as a whole; `holds_rows`, which knows a
message of `results.folder.check_folder` by its words "is not empty"; `job_of` and `tidy`, which `sizing.runs` calls;
`base_of`, which `sizing.space` imports; `prepared`, which `commands.arguments` imports. Tests:
``tests/sweeps/test_sweep.py``.
"""

from __future__ import annotations

import contextlib
import pathlib
import shutil
import time
import tomllib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..errors import InputError, in_file
from ..messages import quote, short
from ..results import case_rows
from ..results.files import as_toml, write_json, write_text
from ..results.folder import check_folder, is_alive, read_summary
from ..results.progress import duration, followed
from ..results.run_status import Clock, recorded
from ..scene import Scene, file_of
from .case import Job, keep_outcome, kept_files, machine
from .design import Base, cases_of, files_of
from .expressions import Expression
from .study import Study, load
from .study_result import Sweep, columns_of, row_of
from .workers import crew_of, through

if TYPE_CHECKING:
    from os import PathLike

STUDIES = {"sweep": "study", "size": "sizing"}
"""Names of studies in messages, by ``kind`` of their ``run.json``."""


def sweep(
    scene: Scene | Study | str | PathLike[str],
    parameters: dict[str, Any] | None = None,
    out: str | PathLike[str] | None = None,
    executor: Any = None,
    workers: int | None = None,
    progress: bool | Callable[..., Any] | None = True,
    announce: Callable[[Sweep], object] | None = None,
    **options: Any,
) -> Sweep:
    """Run a scene with many values.

    Parameters
    ----------
    scene : Scene, path-like or str
        A scene, a scene file or the name of a scene shipped with refweb. Without parameters the file of a study, the
        name of one shipped with refweb, or a `refweb.Study`.
    parameters : dict, optional
        Values that vary by path, as in a study: ``{"body.0.velocity": [[0, 0, 1], [0, 0, 2]]}``.
    out : path-like, optional
        Folder of the study; if it has rows of a study, only the missing cases are run. Without it nothing is written to
        the disk.
    executor : concurrent.futures.Executor, optional
        Executor that runs the cases; by default processes of this machine.
    workers : int, optional
        Number of processes, by default one for each processor.
    progress : bool or callable
        See `refweb.run`.
    announce : callable, optional
        Called with the `Sweep` before anything is run.
    **options
        Other keys of a study, such as ``sample="sobol", count=64``.

    Returns
    -------
    Sweep

    Raises
    ------
    InputError
        For wrong input; nothing has been written.
    SolverError
        Where the folder cannot be written or the executor takes no more cases.
    """
    clock = Clock()
    crew = crew_of(executor, workers)
    study_run, base = prepared(scene, parameters, options)
    kept = Kept(out, study_run)
    study_run.path = kept.path
    study_run.gather(kept.rows)
    if announce is not None:
        announce(study_run)
    kept.begin(scene if isinstance(scene, Scene) else None)
    try:
        with recorded(study_run, clock, lambda: _done(study_run, kept)), followed(progress, "starting workers") as tell:
            try:
                _run(study_run, base, kept, crew, tell)
            finally:
                kept.end()
    finally:
        kept.summary()
    return study_run


def prepared(scene, parameters=None, options=None):
    """Check the arguments of `sweep`; the `Sweep` before any run, and the base scene."""
    study, base = _asked(scene, parameters, options or {})
    cases = cases_of(study, base)
    study_run = Sweep(study, cases, str(base.given.get("title", study.scene)))
    if skipped := sum(case.given is None for case in cases):
        study_run.reasons = [f"{skipped} of {len(cases)} cases are skipped: {study.skip}"]
    _check(study, base, cases)
    return study_run, base


def _asked(scene, parameters, options):
    """The study and the base scene from the arguments of `sweep`."""
    if parameters is None:
        if isinstance(scene, Scene):
            raise InputError('parameters are missing: give what varies, {"solve.duration": [0.1, 0.2]}')
        study = scene if isinstance(scene, Study) else load(scene)
        if options:
            raise InputError(f"{next(iter(options))} has no meaning with a study, which has its own keys: leave it out")
        path = study.folder / study.scene if study.folder is not None else pathlib.Path(study.scene)
        return study, base_of(path if path.is_file() else study.scene)
    if isinstance(scene, Scene):
        name, title, base = "scene.toml", scene.title, Base(scene.to_dict(), scene.folder, scene.file or "scene")
    else:
        path, base = pathlib.Path(scene), base_of(scene)
        name = str(path.resolve() if path.is_file() else scene)
        title = f"{base.given.get('title', path.stem)}, sweep"[:200]
    return Study(**{"scene": name, "title": title, **options, "parameters": parameters}), base


def base_of(source):
    """The `refweb.sweeps.design.Base` of a scene file, or of the name of a shipped scene."""
    path = file_of(source)
    Scene.load(path)  # says what is wrong with it alone
    given = {"title": path.stem, **tomllib.loads(path.read_bytes().decode("utf-8-sig"))}
    return Base(given, path.resolve().parent, path.name)


def _check(study, base, cases):
    """Refuse a study without cases, a first case that cannot be built, and unknown names in conditions."""
    first = next((case for case in cases if case.given is not None), None)
    if first is None:
        raise InputError(f"skip = {quote(study.skip)} leaves no case of {len(cases)}")
    _, scene = base.scene(first.values)
    scene.build()
    of_throw = [] if scene.throw is None else scene.throw.numbers
    for name, text in study.conditions.items():
        with in_file(f"conditions: {short(name)}"):
            Expression(text, [*study.parameters, *(item.name for item in scene.observables), *of_throw])


def _run(study_run, base, kept, workers, tell):
    """Run the missing cases."""
    missing = {case.key: case for case in study_run.cases if case.given is not None and not kept.has(case)}
    by_key = {}
    for case in study_run.cases:
        if case.given is not None:
            by_key.setdefault(case.key, []).append(case)
    total, left, began = sum(map(len, by_key.values())), sum(len(by_key[key]) for key in missing), None
    jobs = (job_of(base, case, workers.local, study_run.study.keep) for case in missing.values())
    tell(f"{total - left} of {total} cases", (total - left) / total)
    start = left
    with contextlib.closing(through(jobs, workers)) as outcomes:
        for outcome in outcomes:
            kept.add(outcome, by_key[outcome.key])
            left -= len(by_key[outcome.key])
            now = time.monotonic()
            if began is None:  # the first case has started workers and may have compiled kernels
                began, start = now, left
            rest = left * (now - began) / (start - left) if start > left else None
            bad = sum(row["status"] != "solved" for row in kept.rows.values())
            words = f"{total - left} of {total} cases" + (f", {bad} without results" if bad else "")
            tell(words + (f", {duration(rest)} left" if rest is not None and left else ""), (total - left) / total)


def job_of(base, case, local, keeps="none", task=None):
    """The `refweb.sweeps.case.Job` of a case of a base scene; where it is not ``local``, files go with it."""
    folder = None if base.folder is None else str(base.folder)
    files = {}
    if not local:
        given, scene = base.scene(case.values)
        for path in files_of(scene.to_dict()):
            with contextlib.suppress(OSError):
                files[path] = pathlib.Path(path).read_bytes()
    return Job(case.key, case.given, folder, base.name(case.values), keeps, machine(), files, task)


def _done(study_run, kept):
    have_rows = [case.key in kept.rows for case in study_run.cases if case.given is not None]
    return f"{sum(have_rows)} of {len(have_rows)} cases"


class Kept:
    """Rows of a study, and its folder if there is one.

    Parameters
    ----------
    folder : path-like, optional
        The folder.
    study_run : Sweep
        The study.

    Attributes
    ----------
    rows : dict
        Cells by the key of their case.
    """

    def __init__(self, folder, study_run):
        self.path = None if folder is None else pathlib.Path(folder).absolute()
        self.study_run, self.rows, self._aside, self._table = study_run, {}, [], None
        if self.path is None:
            return
        full = holds_rows(folder, "sweep")
        asked = {case.key for case in study_run.cases}
        stored = [*case_rows.read(self.path / case_rows.ASIDE), *case_rows.read(self.path / case_rows.NAME)]
        for row in stored if full else ():
            if row["case"] in asked and row["status"] != "lost":
                self.rows[row["case"]] = case_rows.result_cells(row)
        unasked = {row["case"]: row for row in stored if row["case"] and row["case"] not in asked}
        self._aside = list(unasked.values())
        if count := len(self._aside):
            study_run.reasons.append(
                f"{count} row{'s' * (count > 1)} of another study, of other cases or another scene, set aside in "
                f"{case_rows.ASIDE}"
            )
        before = (read_summary(self.path) or {}).get("versions", {}) if full and self.rows else study_run.versions
        if changed := [f"{k} {v} after {before.get(k)}" for k, v in study_run.versions.items() if before.get(k) != v]:
            study_run.warnings.append(
                f"some rows are of other versions, {', '.join(changed)}: their last digits may differ"
            )

    def has(self, case):
        """Tell if a case has its row and the files to keep."""
        row = self.rows.get(case.key)
        if row is None:
            return False
        if self.path is None or self.study_run.study.keep == "none" or row["status"] != "solved":
            return True
        as_json, archive = kept_files(self.path, case.key)
        return as_json.is_file() if self.study_run.study.keep == "json" else (archive / "run.json").is_file()

    def begin(self, scene=None):
        """Write the study file, the header of the rows and, if it is in no file, the ``scene``."""
        if self.path is None:
            return
        with case_rows.written(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
            tidy(self.path)
            self.summary()
            if scene is not None:
                write_text(self.path / "scene.toml", as_toml(scene.to_dict()))
            write_text(self.path / "study.toml", _as_toml(self.study_run.study))
            if self._aside:
                case_rows.write(self.path / case_rows.ASIDE, self._aside)
        rows = [self._row(case) for case in self.study_run.cases if case.key in self.rows]
        self._table = case_rows.CaseRows(self.path, rows, columns_of(self.study_run.study, rows))

    def _row(self, case):
        return row_of(self.study_run.study, case, self.rows)

    def add(self, outcome, cases):
        """Write the files of a case and then its row; ``cases`` are all cases with this scene."""
        if self.path is not None:
            with case_rows.written(self.path):
                keep_outcome(self.path, outcome)
        self.rows[outcome.key] = outcome.cells
        if self._table is not None:
            self._table.add(*map(self._row, cases))

    def end(self):
        """Sort the rows, and compute their statistics."""
        self.study_run.gather(self.rows)
        if self._table is not None:
            rows_done = [row for row in self.study_run.rows if row["status"] != "waiting"]
            self._table.order(rows_done)
            self._table.close()

    def summary(self):
        """Write ``run.json``."""
        if self.path is not None:
            with case_rows.written(self.path):
                write_json(self.path / "run.json", self.study_run.summary())


def holds_rows(folder, kind):
    """Tell if a folder contains a study of a kind; refuse one with other content or without write permission."""
    path = pathlib.Path(folder)
    if path.is_dir() and (read_summary(path) or {}).get("kind") == kind:
        if is_alive(path):
            raise InputError(
                f"folder {short(str(folder))}: a study that is alive writes there: wait for it, or stop it"
            )
        return True
    try:
        check_folder(folder)
    except InputError as error:
        if "is not empty" not in str(error):
            raise
        raise InputError(
            f"folder {short(str(folder))}: is not empty and holds no {STUDIES[kind]}: choose another with --out"
        ) from None
    return False


def tidy(folder):
    """Remove temporary files of a study that was killed."""
    for path in [*folder.glob(".refweb-*"), *(folder / "cases").glob(".refweb-*")]:
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def _as_toml(study):
    """A study as TOML: its keys, then its tables, values by path in quotes."""
    import tomli_w

    given = study.to_dict()
    if study.folder is not None and (study.folder / study.scene).is_file():
        given["scene"] = str((study.folder / study.scene).resolve())
    return tomli_w.dumps(dict(sorted(given.items(), key=lambda item: isinstance(item[1], dict))))
