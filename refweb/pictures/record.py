"""Records: summary, history and frames of a run, from a folder or memory, for pictures, plots and pages.

May change: private functions, `FRAMES_KEPT`, and texts in `OTHERS` and `CLOCKS`. Must stay: fields and methods of
`Record`, by which alone plots, pages and pictures know a run; the same record by `of_folder` and `of_solution`;
``frequency_N``, a name that `studies.modes` gives. Tests: ``tests/pictures/test_pictures.py``,
``tests/pictures/test_plots.py``.
"""

from __future__ import annotations

import functools
import tomllib
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..messages import short
from ..results.folder import TABLES, read_summary
from ..results.solution import as_history
from ..results.units import readable
from .frames import Frame, frame_of, listed, number_of, read

CLOCKS = {"modes": "mode {:g}", "static": "step {:g}", "dynamic": "t = {:.6g} s"}
"""Format of the time of a frame, by kind of run."""

OTHERS = {
    "cost": "its diagram is cost.png there, by refweb cost",
    "sweep": "its plots are there already, by refweb sweep, one a result; refweb report writes its page",
    "size": "its trade-off is trade-off.png there, by refweb size, and its design the result folder design",
}
"""Remedies for result folders of other kinds."""


FRAMES_KEPT = 64
"""Number of frames kept in memory, since a film and a page use each more than once."""


class Record(NamedTuple):
    """Data of a run for pictures, plots and pages.

    Attributes
    ----------
    name : str
        Name among other records: that of its folder, in memory the title of its scene.
    kind : {"static", "dynamic", "modes"}
        Kind of the run.
    summary : dict
        The content of ``run.json``; empty if a folder has none.
    scene : dict
        The tables of its scene file; empty if there is none.
    times : dict of int to float
        Times of its frames [s] by number, ascending; in statics load steps, of modes their numbers.
    frame : callable
        Returns the `Frame` of a number.
    table : callable
        Returns the names of columns with units, and the history by name, which is read once.
    """

    name: str
    kind: str
    summary: dict[str, Any]
    scene: dict[str, Any]
    times: dict[int, float]
    frame: Callable[[int], Frame]
    table: Callable[[], tuple[Any, ...]]

    @property
    def title(self):
        """Title of its scene."""
        return str(self.summary.get("scene") or self.name)

    @property
    def status(self):
        """Status of the run."""
        return str(self.summary.get("status", "solved"))

    @property
    def ending(self):
        """Text on the end of a run that is not solved; empty for a solved run."""
        return {"solved": "", "running": "run not ended"}.get(self.status, f"run {self.status}")

    def refuse_others(self, drawn):
        """Refuse a record of neither a run nor modes; ``drawn`` names the output, such as "plots"."""
        if (kind := self.summary.get("kind")) not in (None, "modes"):
            words = OTHERS.get(kind, f"{drawn} are of runs and of modes")
            raise InputError(f"{self.name}: holds {short(str(kind))}, not a run: {words}")

    def clock(self, number, decimals=None):
        """Text of the time of a frame: time, load step, or number and frequency of a mode with ±.

        Without ``decimals`` a time has six digits.
        """
        text = CLOCKS.get(self.kind, CLOCKS["dynamic"]).format(self.times[number])
        if self.kind == "dynamic" and decimals is not None and decimals <= 6:
            text = f"t = {self.times[number]:.{decimals}f} s"
        if self.kind == "modes":
            frequency = (self._steps or [{}])[-1].get("results", {}).get(f"frequency_{number}")
            text += f", {readable(frequency['value'], frequency['error'], frequency['unit'])}" if frequency else ""
        return text

    def chosen(self, frame=None, time=None):
        """The number of the frame to show.

        Parameters
        ----------
        frame : int, optional
            Its number; −1 is the last.
        time : float, optional
            The frame nearest a time [s], in statics a load step, is taken. Default: the frame nearest the time of the
            largest value of the first observable; for modes the first, and without such a time the last.

        Raises
        ------
        InputError
            If there are no frames, or not this one, with the nearest.
        """
        if frame is not None and time is not None:
            raise InputError(f"frame = {frame} and time = {time:g} exclude each other: leave one out")
        numbers = list(self.times)
        if not numbers:
            raise InputError(f'"{short(self.name)}" has no frames: run it with frames = 1 or more in [output]')
        if frame is not None:
            return number_of(frame, numbers)
        if time is None:
            time = self._time_of_the_largest()
        elif not np.isfinite(time):
            raise InputError(f"time = {time} must be a finite number")
        return numbers[-1] if time is None else min(numbers, key=lambda n: abs(self.times[n] - time))

    @property
    def _steps(self):
        """Load steps as ``run.json`` has them."""
        return self.summary.get("steps") or []

    def _time_of_the_largest(self):
        """Time, or load step, of the largest value of the first observable; None if there is none."""
        if self.kind == "modes":
            return next(iter(self.times.values()))
        if self.kind == "static":
            first = [(step["step"], next(iter(step.get("results", {}).values()), None)) for step in self._steps]
            candidates = [(abs(entry["value"]), step) for step, entry in first if entry and entry["value"] is not None]
            return max(candidates, key=lambda pair: pair[0])[1] if candidates else None
        return next((entry["time"] for entry in self.summary.get("results", {}).values()), None)


def of_folder(folder, with_frames=True):
    """The record of a result folder; refuses what is none, and one without frames unless ``with_frames`` is False.

    A run that failed at once has none, but may have a history. ``frame`` and ``table`` refuse a file that is spoilt.
    """
    folder = Path(folder)
    summary = read_summary(folder) or {}
    try:
        scene = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
        kind = str(scene["solve"]["kind"])
    except (OSError, ValueError, KeyError, TypeError):
        scene, kind = {}, "dynamic"
    kind = "modes" if summary.get("kind") == "modes" else kind
    frames = _listed(folder, with_frames)
    times = {number: listed_frame.time for number, listed_frame in frames.items()}
    name = folder.name or folder.resolve().name
    table = functools.cache(functools.partial(_table, folder))

    frame = functools.lru_cache(FRAMES_KEPT)(functools.partial(read, folder, known_paths=frames))
    return Record(name, kind, summary, scene, times, frame, table)


def _listed(folder, with_frames):
    """The frames of a folder by number; empty for a run without frames, if that is allowed."""
    try:
        return listed(folder)
    except InputError:
        if with_frames or read_summary(folder) is None:
            raise
        return {}


def of_solution(solution, with_frames=True):
    """The record of a `refweb.results.solution.SolutionData`, from its folder if it has no frames in memory."""
    summary = solution.summary()
    states = {number: (state, None) for number, state in solution.frames}
    if summary.get("kind") == "modes" and solution.table is not None and solution.spectra:
        states = {number: (solution.state, shape) for number, shape in enumerate(solution.spectra[-1].shapes, start=1)}
    if not states and solution.path is not None:
        return of_folder(solution.path, with_frames)
    from ..results.vtu import meshes

    @functools.lru_cache(FRAMES_KEPT)
    def frame(number):
        state, shape = states[number]
        supported = state.system.fixed[: state.system.net.nodes].any(axis=1)
        return frame_of(number, times[number], meshes(state, shape), supported, state.system.net.point_mass)

    scene = solution.scene
    try:
        tables = scene.to_dict()
    except InputError:  # a web made in Python
        tables = {}
    times = {number: state.time if shape is None else float(number) for number, (state, shape) in states.items()}
    kind, table = summary.get("kind", scene.solve.kind), (solution.columns, solution.history)
    return Record(scene.title, kind, summary, tables, times, frame, lambda: table)


def _node(text):
    """The number of a node; not a number where a body is named."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _table(folder):
    """Columns and history of a folder."""
    path = next((folder / name for name in TABLES if (folder / name).exists()), folder / TABLES[0])
    try:
        with open(path, encoding="utf-8") as lines:
            columns = lines.readline().rstrip("\n").split(",")
            complete_lines = (
                line for line in lines if line.endswith("\n")
            )  # a run that is alive may be writing the last
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # that there are no rows
                named: Any = {columns.index("node [1]"): _node} if path.name == "modes.csv" else None
                rows = np.loadtxt(complete_lines, delimiter=",", ndmin=2, converters=named)
        return columns, as_history(columns, rows)
    except (OSError, ValueError) as error:
        raise InputError(f"{short(str(path))}: cannot be read: {error}") from None
