"""Result folders: frames, history and summary. A kill at any moment leaves a folder that can be read.

``history.csv`` grows by whole rows. Every other file is written under another name and then moved. The row of a frame
is written first, then the frame and the checkpoint of its state, and then its entry in ``web.pvd``.

May change: private functions and texts of errors. Must stay: names of files and `TABLES`, each of which `RESULT_FILES`
lists (``--force`` removes these alone; a new one goes there); keys of the checkpoint, which `dynamics` and
`pictures.frames` read; the order in which a frame is written; ``run.json`` as last of a copy; all names that `runner`,
`sweeps.sweep` and other files import; public names of `Folder`, which other files use. Tests:
``tests/results/test_results.py``, ``tests/test_faults.py``.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import html
import io
import json
import os
import pathlib
import re
import shlex
import shutil
from collections import Counter

import numpy as np

from ..errors import InputError
from ..messages import short
from ..net.rigid_body import row_names
from .files import append, as_toml, number, write_atomically, write_json, write_text, written
from .vtu import meshes, write_mesh

RESULT_FILES = re.compile(
    r"scene\.toml|checkpoint\.npz|(history|modes|cost)\.csv|(run|trust)\.json|web\.pvd|(web|cost|trust)\.png|web\.gif"
    r"|plot\.(png|svg|pdf)|report\.html|sheet\.html|web_in_paraview\.py"
    r"|frames/[^/]+_\d{6,}\.vtu|(frames/)?\.refweb-[^/]+"
)
"""Files that refweb writes into a result folder under names of its own; ``--force`` removes these and no others."""

TABLES = ("history.csv", "modes.csv", "results.csv")
"""Names of the tables of runs and studies."""


def read_summary(folder):
    """The content of ``run.json`` in a folder; None if there is no such file of refweb."""
    try:
        run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    is_record = isinstance(run, dict) and isinstance(run.get("versions"), dict) and "refweb" in run["versions"]
    return run if is_record else None


def is_alive(folder):
    """True if the run that writes a folder is alive, None where that cannot be known.

    A run locks its history; the lock ends with its process in any case. Windows has no such lock.
    """
    try:
        import fcntl
    except ImportError:
        return None
    try:
        with open(next(folder / name for name in TABLES if (folder / name).exists()), "rb") as table:
            fcntl.flock(table, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except (OSError, StopIteration):
        return None
    return False


def fingerprint(folder):
    """Key of the scene of a folder by its content: an edited ``scene.toml`` has another key."""
    return hashlib.sha256((folder / "scene.toml").read_bytes()).hexdigest()


def reached(folder):
    """Text of the time or load step of the last row of a history; None without rows."""
    try:
        with open(folder / "history.csv", encoding="utf-8") as lines:
            name, *rows = (line.split(",")[0] for line in lines)
            return f"{name.split(' [')[0].replace('time', 't')} = {float(rows[-1]):.6g}{' s' * name.startswith('time')}"
    except (OSError, ValueError, IndexError):
        return None


def so_far(folder, summary):
    """The summary of a run that has not ended: its last row, and if its process is alive."""
    alive, at = is_alive(folder), reached(folder)
    text = f"it has reached {at}" if at else "it has written no row"
    if summary.get("kind") in ("sweep", "size"):
        statuses = _statuses(folder)
        text = f"it has written {len(statuses)} row{'s' * (len(statuses) != 1)}"
        if summary["kind"] == "sweep" and statuses:
            summary = {**summary, "count": _counted(statuses, summary["count"])}
    if alive is False:
        return {**summary, "status": "killed", "message": f"its process is dead; {text}; {remedy(folder)}"}
    return {**summary, "message": f"{text}; {'its process is alive' if alive else 'whether it is alive is not known'}"}


def _statuses(folder):
    """Status of each whole row of the table of a study."""
    try:
        text = (folder / "results.csv").read_text(encoding="utf-8")
    except OSError:
        return []
    return [row["status"] for row in csv.DictReader(io.StringIO(text[: text.rfind("\n") + 1], newline=""))]


def _counted(statuses, count):
    """Number of cases of each status by rows of a study; ``count`` is that at its start."""
    total = Counter(statuses)
    total["skipped"] = total["skipped"] or count.get("skipped", 0)  # which have no rows before the end
    total["waiting"] = 0
    total["waiting"] = sum(count.values()) - total.total()
    return {status: number for status, number in total.items() if number > 0}


def remedy(folder):
    """Text on how to continue a run that has not ended."""
    if (folder / "requirements.toml").exists():
        return "refweb size with the same requirements and --out goes on, and runs nothing again"
    if (folder / "results.csv").exists():
        return "refweb sweep with the same study and --out goes on with what is missing"
    if (folder / "checkpoint.npz").exists():
        return f"refweb resume {shlex.quote(str(folder))} continues it"
    return "refweb run --force starts it again"


def hold(table):
    """Lock an open table, if the system has locks."""
    with contextlib.suppress(ImportError, OSError):
        import fcntl

        fcntl.flock(table, fcntl.LOCK_EX | fcntl.LOCK_NB)


def check_folder(folder, force=False):
    """Refuse a result folder that cannot be written, before anything is computed.

    Raises
    ------
    InputError
        If ``folder`` is a file, cannot be written, or is not empty without ``force``; with ``force`` if it holds no
        ``run.json`` of refweb.
    """
    folder = pathlib.Path(folder)
    name = f"result folder {short(str(folder))}"
    try:
        existing = next(p for p in (folder.absolute(), *folder.absolute().parents) if p.exists() or p.is_symlink())
        for part in (existing, *([folder / "frames"] if (folder / "frames").exists() else [])):
            if not part.is_dir():
                raise InputError(f"{name}: {part.name} is a file, not a folder")
            if not os.access(part, os.W_OK | os.X_OK):
                raise InputError(f"{name}: {part.name} cannot be written: choose another folder")
        full = existing == folder.absolute() and any(not p.name.startswith(".refweb-") for p in folder.iterdir())
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{name}: cannot be used: {getattr(error, 'strerror', None) or error}") from None
    if full and is_alive(folder):
        raise InputError(f"{name}: is being written by a run that is alive: choose another folder, or stop that run")
    if full and not force:
        raise InputError(
            f"{name}: is not empty: choose another folder, or replace its results with --force (in Python force=True)"
        )
    if full and read_summary(folder) is None:
        raise InputError(f"{name}: holds no run.json of refweb, so it is not a result folder: nothing was removed")


def clear(folder, kept=("run.json",)):
    """Remove the files of a run except ``kept``, and no others."""
    for path in [*folder.iterdir(), *(folder / "frames").glob("*")]:
        name = path.relative_to(folder).as_posix()
        if path.is_file() and RESULT_FILES.fullmatch(name) and name not in kept:
            path.unlink()


def copy(source, target):
    """Copy the files of a run from one folder to another, ``run.json`` last."""
    target = pathlib.Path(target)
    if source.resolve() == target.resolve():
        return
    (target / "frames").mkdir(parents=True, exist_ok=True)
    clear(target)
    paths = [p for p in source.rglob("*") if p.is_file() and RESULT_FILES.fullmatch(p.relative_to(source).as_posix())]
    for path in sorted(paths, key=lambda p: p.name == "run.json"):
        copy_path = target / path.relative_to(source)
        write_atomically(copy_path, lambda name, path=path: shutil.copyfile(path, name))


class Folder:
    """A result folder that is being written.

    Parameters
    ----------
    path : path-like
        The folder. It is created if it does not exist; else earlier results are removed.
    scene : refweb.Scene
        Scene, which is written as ``scene.toml`` with all defaults.
    columns : sequence of str
        Header of ``history.csv``.
    run : dict
        First content of ``run.json``.
    table : str
        Name of the history's file.
    row : int, optional
        Number of the last row to keep of a run that continues; only later rows and frames are removed then.

    Raises
    ------
    SolverError
        From every method that writes, where the folder cannot be written any more.
    """

    def __init__(self, path, scene, columns, run, table="history.csv", row=None):
        self.path = pathlib.Path(path)
        self._columns, self._table = columns, table
        if row is not None:
            self._go_on(row, run)
            return
        text = as_toml(scene.to_dict())
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"result folder {short(str(path))}: cannot be made: {error.strerror}") from None
        with self._written():
            (self.path / "scene.toml").unlink(missing_ok=True)  # from here on there is nothing to resume
        self.summary(run)
        with self._written():
            (self.path / "frames").mkdir(exist_ok=True)
            clear(self.path)
            write_text(self.path / "scene.toml", text)
            self._scene = fingerprint(self.path)
        self._start()

    def _written(self):
        """Turn an error of writing into a `SolverError` that names the folder."""
        return written(f"result folder {short(str(self.path))}", "what was written is whole")

    def _start(self):
        with self._written():
            self._history = open(self.path / self._table, "wb", buffering=0)
            hold(self._history)
        self.row(self._columns)
        self._listed = []
        self._list_frames()

    def _go_on(self, row, run):
        """Cut the history after a row, and remove later frames."""
        self._scene = fingerprint(self.path)
        try:
            with open(self.path / self._table, "rb") as lines:
                kept = [len(line) for line, _ in zip(lines, range(row + 2), strict=False)]
                lines.seek(0)
                header = lines.readline().decode(errors="replace").strip()
        except OSError as error:
            raise InputError(f"{self.path / self._table}: cannot be read: {error.strerror}") from None
        if len(kept) < row + 2 or header != ",".join(self._columns):
            raise InputError(f"{self.path / self._table}: is not the history that checkpoint.npz belongs to")
        with self._written():
            self._history = open(self.path / self._table, "r+b", buffering=0)
            hold(self._history)
            self._history.seek(sum(kept))
            self._history.truncate()
            for path in [*self.path.glob(".refweb-*"), *(self.path / "frames").iterdir()]:
                number = re.search(r"_(\d{6,})\.vtu$", path.name)
                if RESULT_FILES.fullmatch(path.relative_to(self.path).as_posix()) and not (
                    number and int(number[1]) <= row
                ):
                    path.unlink()
        self._listed = []
        self.summary(run)

    def restart(self, run):
        """Remove rows and frames and begin again; ``run`` is the content of ``run.json``."""
        self.close()
        with self._written():
            (self.path / "checkpoint.npz").unlink(missing_ok=True)
        self.summary(run)
        with self._written():
            clear(self.path, kept=("run.json", "scene.toml"))
        self._start()

    def row(self, values):
        """Append a row to the history, or nothing if the disk is full."""
        line = ",".join(v if isinstance(v, str) else number(v) for v in values) + "\n"
        with self._written():
            append(self._history, line.encode())

    def frame(self, number, state, shape=None, run=None):
        """Write frame and checkpoint of a state and list the frame in ``web.pvd``, with a ``shape`` as its mode.

        ``run`` has further arrays of the checkpoint by name, from which the run can continue.
        """
        with self._written():
            for name, mesh in meshes(state, shape).items():
                write_mesh(self.path / f"frames/{name}_{number:06d}.vtu", mesh)
            net = state.system.net
            arrays = {"time": state.time, "positions": state.position, "displacements": state.x, "velocities": state.v}
            names = [*row_names(net.bodies), *net.internal_names]
            arrays |= {"supported": state.system.fixed, "bodies": np.array(names, dtype=str)}
            arrays |= {"lines": net.web.lines, "scene": self._scene}
            if net.internal:
                from ..system.internal_rows import kept

                arrays |= kept(state.system)
            if net.factors:
                arrays["length_factors"] = state.system.natural_length(state.time) / net.natural_length
            for key in ("axes", "inertia", "offset") if net.bodies else ():
                arrays[f"body_{key}"] = np.array([getattr(body, key) for body in net.bodies])
            if net.bodies:
                arrays["body_axle"] = np.array([b.axle.direction if b.axle else np.zeros(3) for b in net.bodies])
            if net.point_mass is not None:
                arrays["point_masses"] = net.point_mass
            if state.system.weakness is not None:
                arrays |= {"broken": net.broken, "broken_energies": net.line_data.rupture_energy[net.broken]}
            if state.system.contact_shares is not None:
                arrays["contact_shares"] = state.system.contact_shares
            arrays |= run or {}
            write_atomically(self.path / "checkpoint.npz", lambda file: np.savez(file, **arrays))
        self.listed([(number, state.time if shape is None else number)], net.bodies)

    def keep_twin(self, end):
        """Add the end of the step-refinement run to the last checkpoint: displacement [m] and velocity [m/s]."""
        with self._written():
            with np.load(self.path / "checkpoint.npz") as archive:
                arrays = {key: archive[key] for key in archive}
            arrays |= dict(zip(("twin_displacements", "twin_velocities"), end, strict=True))
            write_atomically(self.path / "checkpoint.npz", lambda file: np.savez(file, **arrays))

    def listed(self, frames, bodies):
        """Add frames, each a row number and its time, to ``web.pvd``."""
        for row, time in frames:
            names = ["web", *(body.name for body in bodies)]
            self._listed += [
                f'    <DataSet timestep="{number(time)}" group="" part="{part}" name="{html.escape(name)}" '
                f'file="{html.escape(f"frames/{name}_{row:06d}.vtu")}"/>\n'
                for part, name in enumerate(names)
            ]
        self._list_frames()

    def _list_frames(self):
        rows = "".join(self._listed)
        with self._written():
            write_text(
                self.path / "web.pvd",
                '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
                f"  <Collection>\n{rows}  </Collection>\n</VTKFile>\n",
            )

    def summary(self, run):
        """Write ``run.json``."""
        with self._written():
            write_json(self.path / "run.json", run)

    def last_row(self):
        """The last row of the history."""
        with open(self.path / self._table, encoding="utf-8") as lines:
            *_, last = lines
        return [float(value) for value in last.split(",")]

    def rows(self):
        """All rows of the history, shape (rows, columns)."""
        return np.loadtxt(self.path / self._table, delimiter=",", skiprows=1, ndmin=2)

    def close(self):
        """Close the history."""
        self._history.close()
