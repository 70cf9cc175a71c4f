"""Run of one case in a worker: it takes a `Job` and returns an `Outcome`, without a shared disk.

The worker may be a process on another machine. The job contains the files that it needs. The outcome contains the cells
of a row, and on demand ``run.json`` or an archive of the result folder.

May change: private functions; how files are packed, on both sides (`packed`, `unpacked`) at once. Must stay: fields of
`Job` and `Outcome`, which travel by pickle to other machines as plain values and bytes; columns of `cells_of`, which
are those of `results.case_rows`; `solve`, which `workers` and `sizing.runs` call; `keep_outcome` and `kept_files`,
which `sweep` imports; `_brought`, which a test calls. Tests: ``tests/sweeps/test_sweep.py``,
``tests/sweeps/test_workers.py``.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import os
import pathlib
import shutil
import socket
import tempfile
import warnings
import zipfile
from typing import Any, NamedTuple

from ..errors import InputError, SolverError
from ..messages import one_line
from ..registry import with_files


class Job(NamedTuple):
    """A case that is to be run.

    Attributes
    ----------
    key : str
        Key of the case.
    given : dict
        Its scene as the dict of a scene file.
    folder, file : str
        Folder at which its relative paths start, and its name in messages.
    keeps : {"none", "json", "all"}
        Data to return besides cells.
    home : tuple
        Machine and process that sent it.
    files : dict
        Content of files that the scene reads, by absolute path, for machines that do not have them.
    task : callable, optional
        Called with the scene in place of its run; returns the content of a ``run.json``, in which ``more`` may have
        further cells.
    """

    key: str
    given: dict[str, Any]
    folder: str | None
    file: str
    keeps: str
    home: tuple[Any, ...]
    files: dict[str, Any]
    task: Any = None


class Outcome(NamedTuple):
    """Result of a case: cells of its row, the content of its ``run.json``, and its result folder as an archive."""

    key: str
    cells: dict[str, Any]
    summary: dict[str, Any] | None = None
    archive: bytes | None = None


def machine():
    """(Name of this machine, number of this process)."""
    return socket.gethostname(), os.getpid()


def solve(job):
    """Run a case and return its `Outcome`, also for an error."""
    from ..results.run_status import Clock

    if job.home != machine():
        _settle()
    clock = Clock()
    try:
        with warnings.catch_warnings() if job.home == machine() else contextlib.nullcontext():
            summary, archive = _run(job)
        cells = cells_of(summary) | summary.get("more", {})
    except Exception as error:
        text = f"internal error, {type(error).__name__}: {error}"
        message = _values_text(job, error) if isinstance(error, InputError | SolverError) else one_line(text)
        status = "refused" if isinstance(error, InputError) else "failed"
        summary, archive, cells = None, None, {"status": status, "message": message}
    return Outcome(job.key, cells | clock.spent(), summary if job.keeps == "json" else None, archive)


def _values_text(job, error):
    """A message without the name of the file and the values, which the row contains."""
    text = one_line(str(error))
    head = f"{job.file}: " if job.file else ""
    text = text.removeprefix(head)
    return text if len(text) <= 1000 else text[:997] + "..."


@functools.cache
def _settle():
    """Prepare a worker process: step-refinement runs get no thread."""
    from ..dynamics import twin_error

    warnings.simplefilter("ignore", RuntimeWarning)  # overflow: what it leads to is found and named
    twin_error.THREADS = False


def _run(job):
    """Content of ``run.json`` of a case, and the archive of the result folder or None."""
    from ..runner import run
    from ..scene import Scene

    with contextlib.ExitStack() as stack:
        given, folder = job.given, job.folder and pathlib.Path(job.folder)
        if job.files:
            directory = pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="refweb-")))
            given = _brought(job, directory)
        scene = Scene.from_dict(given, folder, job.file)
        if job.task is not None:
            return job.task(scene), None
        if job.keeps != "all":
            return run(scene, progress=False).summary(), None
        directory = pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="refweb-"))) / "run"
        return run(scene, out=directory, progress=False).summary(), packed(directory)


def _brought(job, directory):
    """The scene of a job; files that this machine lacks are written to a folder."""
    moved = {}
    for number, (path, content) in enumerate(job.files.items()):
        source = pathlib.Path(path)
        same = source.is_file() and hashlib.sha256(source.read_bytes()).digest() == hashlib.sha256(content).digest()
        if not same:
            of_a_run = source.name in ("run.json", "scene.toml", "checkpoint.npz")
            folder = directory / ("start" if of_a_run else str(number))
            folder.mkdir(exist_ok=True)
            (folder / source.name).write_bytes(content)
            moved[path] = str(folder / source.name)
            moved[str(source.parent)] = str(folder)
    base = pathlib.Path(job.folder or "")

    def brought(path):
        return moved.get(str(base.joinpath(path).resolve()), path)

    given, solve = with_files(job.given, brought), dict(job.given["solve"])
    if isinstance(solve.get("start"), str):
        solve["start"] = brought(solve["start"])
    return {**given, "solve": solve}


def packed(folder):
    """A result folder as one archive."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                archive.writestr(zipfile.ZipInfo(path.relative_to(folder).as_posix()), path.read_bytes())
    return content.getvalue()


def unpacked(content, folder):
    """Put the files of an archive into a folder."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        archive.extractall(folder)


def cells_of(summary):
    """Cells of a row from the content of a ``run.json``: results, and numbers of a throw if no result has the name.

    A statement of a throw, such as "inside", is 1 or 0 as in this run; if ± leaves it undecided, it is bounded by 0 and
    1. Results after the horizon of the motion are random samples. Numbers of a throw for which the step-refinement run
    gives no ± are random samples too.
    """
    cells = {"status": summary["status"], "message": summary["message"]}
    horizon = summary.get("horizon") or {}
    statistical, ensemble = horizon.get("statistical", []), horizon.get("ensemble", {})
    for name, result in summary["results"].items():
        cells[f"{name} [{result['unit']}]"] = result["value"]
        cells[f"{name} ±"] = result["error"]
        if "verdict" in result:
            cells[f"{name} verdict"] = result["verdict"]
        if result.get("interval") is not None:
            lower, upper = result["interval"]
            cells[f"{name} least"] = -float("inf") if lower is None else lower
            cells[f"{name} most"] = float("inf") if upper is None else upper
        if name in statistical and name in ensemble:
            cells[f"{name} mean"], cells[f"{name} deviation"] = ensemble[name]["mean"], ensemble[name]["deviation"]
    of_throw = {n: throw_entry for n, throw_entry in summary.get("throw", {}).items() if n not in summary["results"]}
    for name, throw_entry in of_throw.items():
        value, error = throw_entry["value"], throw_entry.get("error")
        interval = None
        if "drawn" in throw_entry:
            value, decided = float(throw_entry["drawn"]), value is not None
            if error is not None:
                error, interval = (0.0, None) if decided else (1.0, (0.0, 1.0))
        elif throw_entry.get("at_least"):
            error, interval = None, (value - (error or 0.0), float("inf"))
        cells[f"{name} [{throw_entry.get('unit', '1')}]"], cells[f"{name} ±"] = value, error
        if interval is not None:
            cells[f"{name} least"], cells[f"{name} most"] = interval
        if throw_entry.get("statistical"):
            statistical = [*statistical, name]
    cells["statistical"] = " ".join(statistical)
    return cells


def kept_files(folder, job_key):
    """Paths where a study keeps the ``run.json`` and the result folder of a case."""
    cases = pathlib.Path(folder) / "cases"
    return cases / f"{job_key}.json", cases / job_key


def keep_outcome(folder, outcome):
    """Write the files of a case into the folder of a study, atomically."""
    from ..results.files import write_json

    as_json, archive = kept_files(folder, outcome.key)
    if outcome.summary is not None or outcome.archive is not None:
        as_json.parent.mkdir(exist_ok=True)
    if outcome.summary is not None:
        write_json(as_json, outcome.summary)
    if outcome.archive is not None:
        beside = archive.with_name(f".refweb-{outcome.key}")
        for path in (beside, archive):
            if path.exists():
                shutil.rmtree(path)
        unpacked(outcome.archive, beside)
        os.replace(beside, archive)
