"""Records, what pictures, plots and pages show of a run: its summary, history and frames, of a folder or of memory."""

from __future__ import annotations

import functools
import tomllib
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..messages import short
from ..results.folder import TABLES, read_summary
from ..results.solution import as_history
from .frames import Frame, frame_of, listed, read


class Record(NamedTuple):
    """What is shown of a run.

    Attributes
    ----------
    name : str
        What tells it from others: the name of its folder, in memory the title of its scene.
    kind : {"static", "dynamic", "modes"}
        What was solved.
    summary : dict
        The content of ``run.json``; empty where a folder has none.
    scene : dict
        The tables of its scene file; empty where there is none.
    times : dict of int to float
        Times of its frames [s] by number, ascending; in statics load steps, of modes their numbers.
    frame : callable
        Gives the `Frame` of a number.
    table : callable
        Gives (names of columns with units, history by name), read once.
    """

    name: str
    kind: str
    summary: dict
    scene: dict
    times: dict
    frame: Callable[[int], Frame]
    table: Callable[[], tuple]

    @property
    def title(self):
        """Title of its scene."""
        return str(self.summary.get("scene") or self.name)

    @property
    def status(self):
        """How it ended."""
        return str(self.summary.get("status", "solved"))


def of_folder(folder, seen=True):
    """The record of a result folder.

    Parameters
    ----------
    folder : path-like
        The folder.
    seen : bool
        Whether there have to be frames: a run that failed at once has none, and may have a history.

    Raises
    ------
    InputError
        Where it is no result folder, or lists no frames; its ``frame`` and ``table`` where they cannot be read.
    """
    folder = Path(folder)
    summary = read_summary(folder) or {}
    try:
        scene = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
        kind = str(scene["solve"]["kind"])
    except (OSError, ValueError, KeyError, TypeError):
        scene, kind = {}, "dynamic"
    kind = "modes" if summary.get("kind") == "modes" else kind
    name = folder.name or folder.resolve().name
    table = functools.cache(functools.partial(_table, folder))
    return Record(name, kind, summary, scene, _times(folder, seen), functools.partial(read, folder), table)


def _times(folder, seen):
    """Times of the frames of a folder by number; none of a run that has a summary and no frames, where that may be."""
    try:
        return {number: found.time for number, found in listed(folder).items()}
    except InputError:
        if seen or read_summary(folder) is None:
            raise
        return {}


def of_solution(solution, seen=True):
    """The record of a `refweb.results.solution.SolutionData`, of its folder where it holds no history in memory."""
    if solution.table is None:
        return of_folder(solution.path, seen)
    from ..results.vtu import meshes

    states = dict(solution.frames)

    def frame(number):
        if number not in states:
            close = min(states, key=lambda n: abs(n - number))
            raise InputError(
                f"frame = {number}: there is no such frame, the nearest is {close}, the last {max(states)}"
            )
        state = states[number]
        supported = state.system.supported[: state.system.net.nodes].any(axis=1)
        return frame_of(number, state.time, meshes(state), supported)

    scene = solution.scene
    try:
        tables = scene.to_dict()
    except InputError:  # a web made in Python
        tables = {}
    times = {number: state.time for number, state in solution.frames}
    summary = solution.summary()
    kind, table = summary.get("kind", scene.solve.kind), (solution.columns, solution.history)
    return Record(scene.title, kind, summary, tables, times, frame, lambda: table)


def _table(folder):
    """Columns and history of a folder."""
    path = next((folder / name for name in TABLES if (folder / name).exists()), folder / TABLES[0])
    try:
        with open(path, encoding="utf-8") as lines:
            columns = lines.readline().rstrip("\n").split(",")
            whole = (line for line in lines if line.endswith("\n"))  # a run that is alive may be writing the last
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # that there are no rows
                rows = np.loadtxt(whole, delimiter=",", ndmin=2)
        return columns, as_history(columns, rows)
    except (OSError, ValueError) as error:
        raise InputError(f"{short(str(path))}: cannot be read: {error}") from None
