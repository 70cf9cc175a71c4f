"""Solutions: the results of a run, the fields of its last state as arrays, and its result folder.

May change: private functions. Must stay: public names, which users call; `load` reads the keys that
`results.solution.SolutionData.summary` and `results.folder` write to ``run.json`` and ``checkpoint.npz``: a renamed key
changes both sides, and older folders are still read; `Solution`, which `refweb`, `runner` and other files import;
`scene_of` and `summary_of`, which `runner` imports. Tests: ``tests/results/test_loaded.py``,
``tests/results/test_results.py``.
"""

from __future__ import annotations

import pathlib
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError
from .findings import read_findings
from .messages import nearest, short
from .results.folder import read_summary
from .results.solution import OPTIONAL, OTHER_ERRORS, SolutionData, read_results
from .results.strength import read_utilisation
from .scene import Scene

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike

    from matplotlib.figure import Figure
    from numpy.typing import NDArray
    from pandas import DataFrame
    from pyvista import MultiBlock

    from .statics.gradients import Gradient


class Solution(SolutionData):
    """A solved scene, as `refweb.run` returns it.

    The run fills in the attributes of `refweb.results.solution.SolutionData`: ``results``, ``history``, ``steps``,
    ``events``, ``status``, ``warnings`` and more. The arrays are read from the last state of the run.

    Attributes
    ----------
    positions, displacement, velocities, reaction : ndarray, shape (nodes, 3)
        Of nodes; those of order and subdivision come last.
    tension, stress, strain, slack : ndarray, shape (lines,)
        Of lines.
    """

    @property
    def positions(self) -> NDArray[np.float64]:
        """Positions of the nodes in the last state [m], shape (nodes, 3); those of order and subdivision come last."""
        return self.state.position[: self.state.system.net.nodes]

    @property
    def displacement(self) -> NDArray[np.float64]:
        """Displacement of the nodes in the last state [m], shape (nodes, 3)."""
        return self.state.x[: self.state.system.net.nodes]

    @property
    def tension(self) -> NDArray[np.float64]:
        """Tension of the lines in the last state [N], shape (lines,)."""
        return self.state.tension

    @property
    def stress(self) -> NDArray[np.float64]:
        """Stress of the lines in the last state [Pa], shape (lines,)."""
        return self.state.stress

    @property
    def strain(self) -> NDArray[np.float64]:
        """Strain of the lines in the last state [1], shape (lines,)."""
        return self.state.strain

    @property
    def slack(self) -> NDArray[np.bool_]:
        """Lines that are slack in the last state, bool, shape (lines,)."""
        return self.state.slack

    @property
    def velocities(self) -> NDArray[np.float64]:
        """Velocities of the nodes in the last state [m/s], shape (nodes, 3)."""
        return self.state.v[: self.state.system.net.nodes]

    @property
    def reaction(self) -> NDArray[np.float64]:
        """Force of the supports on the nodes in the last state [N], shape (nodes, 3)."""
        return self.state.reaction[: self.state.system.net.nodes]

    def __repr__(self) -> str:
        values = ", ".join(f"{name} = {result.value:.6g} {result.unit}" for name, result in self.results.items())
        return f'<Solution of "{self.scene.title}": {self.status}; {values}>'

    def _repr_html_(self):
        from .results.notebook import of_solution

        return of_solution(self)

    def to_pyvista(self, frame: int = -1) -> MultiBlock:
        """A frame as meshes of pyvista.

        Parameters
        ----------
        frame : int
            Number of the frame, as the files of a result folder and ``refweb picture --frame`` have it; −1 is the last.

        Returns
        -------
        pyvista.MultiBlock
            The block ``web``, and a surface for each body, with the point and cell data of a result folder's frames;
            the time [s] is the field data ``TimeValue``, in statics the load step.

        Raises
        ------
        InputError
            Where there is no such frame; names the nearest.
        """
        import pyvista

        from .pictures.frames import listed, number_of
        from .results.vtu import meshes

        if self.frames:
            frames = dict(self.frames)
            state = frames[number_of(frame, list(frames))]
            time, frames = state.time, meshes(state)
            blocks = {name: pyvista.from_meshio(mesh) for name, mesh in frames.items()}
        else:
            frames = listed(self.path)
            time, paths = frames[number_of(frame, list(frames))]
            blocks = {name: pyvista.read(path) for name, path in paths.items()}
        result = pyvista.MultiBlock(blocks)
        result.add_field_data([time], "TimeValue")
        return result

    def picture(
        self,
        frame: int | None = None,
        time: float | None = None,
        field: str | None = None,
        range: Sequence[float] | str | None = None,
        scale: float = 1.0,
        view: Sequence[float] | str | None = None,
        out: str | PathLike[str] | None = None,
        labels: str | None = None,
    ) -> Figure:
        """Draw one frame, as `refweb.picture` does, whose options these are.

        Returns
        -------
        matplotlib.figure.Figure
            It shows itself in a notebook.

        Raises
        ------
        InputError
            No such frame, field, view or format; names the nearest valid one.
        """
        from .pictures.pictures import picture

        return picture(self, frame, time, field, range, scale, view, out, labels)

    def gradient(self, result: str, path: str, by: str | None = None) -> Gradient:
        """Derivative of a result by numbers of the scene: in statics at the last load step, in dynamics at its time.

        In statics one solution with the factorization of the equilibrium, its adjoint, gives the derivatives of a
        result by all numbers. They are those of the law as it is: exact, and with ± from the residuals of the
        equilibrium and of the adjoint, from rounding, and from differences where a number of the scene is changed.

        In dynamics the run and its step-refinement run are repeated by central differences, and the derivative of each
        step, with its contacts, goes beside it; it gives those of all results by one number. ± is from the difference
        of both, as that of a result. The largest value of a run has the derivative at its time.

        Where two lines or nodes share the largest value, a derivative is that for a number that rises, and ``left``
        that for one that falls; in dynamics also where two peaks in time are equal, where a size is 0, and where a
        value has a kink, as a tension between slack and taut. Peaks that differ by less than ± of the result count in ±
        of its derivative. A stiffness of contact that refweb chose stays as it is; ``notes`` say so where it depends on
        the number.

        Parameters
        ----------
        result : str
            Name of a result: a tension, stress, strain, displacement, position, reaction of nodes, distance, mouth,
            energy, a number of a thread, or the turn of a body. In statics forces on bodies, overlaps and shares are
            refused, in dynamics means over a window, and what is summed over steps, as work.
        path : str
            Any number of the scene by its path, such as ``cable.area`` or ``load.0.force.2``. In statics, by line or
            group, ``cable.modulus``, ``cable.area``, ``cable.density``, ``cable.prestrain`` or ``natural_length`` of
            each: the others, natural lengths among them, stay as they are. In statics also ``force``: the forces on
            each node; ``position``: the positions of each support, which moves as by ``[[motion]]``, so that natural
            lengths stay as they are and displacements count from the web as built. The path ``web.points.0.2`` moves a
            point as built.
        by : {"line", "group", "node"}, optional
            Entries of the gradient in statics; by default one number of the scene, or nodes.

        Returns
        -------
        refweb.statics.gradients.Gradient
            Its ``value`` and ``error`` are arrays; ``float`` takes it where it is one number.

        Raises
        ------
        InputError
            For a result or path that there is none of. In statics for lines that have yielded and turned back, a result
            that depends on parts without stiffness, and a kink: a line that is neither slack nor taut, or between
            yielding and not, or a size that is 0. In dynamics for methods other than central differences, effects that
            have no derivative, largest values that are kept while their derivatives change, as of a web at rest,
            motions that stay at a kink of a force, as of lines at rest that are neither slack nor taut, and results
            behind the time at which the run and its step refinement have no digit in common, where motion
            is chaotic.

        Examples
        --------
        >>> solution.gradient("max_stress", "cable.area")  # doctest: +SKIP
        """
        return self.gradients.gradient(result, path, by)

    @cached_property
    def gradients(self) -> Any:
        """The gradients of this solution, see `gradient`: those of `refweb.statics` or `refweb.dynamics`."""
        if self.scene.solve.kind == "static":
            from .statics.gradients import Gradients
        else:
            from .dynamics.gradients import Gradients
        return Gradients(self)

    def to_pandas(self, what: str = "history") -> DataFrame:
        """Results or history as a table of pandas, which is to be installed.

        Parameters
        ----------
        what : {"history", "results"}
            The history by time or load step, a column for each quantity; or the results by name, with the columns
            ``value``, ``error``, ``unit``, ``time``, ``at`` and ``where``. Of a run that has them ``smoothing``,
            ``discretisation`` and ``neglected`` follow.

        Returns
        -------
        pandas.DataFrame
            Of the history ``attrs["units"]`` has the unit of each column and of the index by name, and
            ``attrs["title"]`` the title of the scene.

        Raises
        ------
        InputError
            Where pandas is not installed, and for another ``what``.
        """
        if what not in ("history", "results"):
            raise InputError(f'what = "{what}" must be "history" or "results", {nearest(what, ["history", "results"])}')
        try:
            import pandas
        except ImportError:
            raise InputError("to_pandas needs pandas: pip install pandas") from None
        if what == "results":
            keys = ["value", "error", "unit", "time", "at", "where"]
            keys += [key for key in OTHER_ERRORS if any(getattr(r, key) is not None for r in self.results.values())]
            rows = {name: [getattr(result, key) for key in keys] for name, result in self.results.items()}
            frame = pandas.DataFrame.from_dict(rows, orient="index", columns=keys)
            return frame.astype({"where": "Int64"})
        table = pandas.DataFrame(dict(self.history))
        table = table.set_index(table.columns[0])
        table.attrs = {"title": self.scene.title, "units": dict(map(_named, self.columns))}
        return table

    def plot(self, quantity: str | Sequence[str] | None = None, out: str | PathLike[str] | None = None) -> Figure:
        """Draw histories with ±, balances, spectra, stress over distance; a notebook shows the figure.

        Parameters
        ----------
        quantity : str or sequence of str, optional
            Quantities to draw, one panel each: an observable or another column of the history; ``energy`` or
            ``momentum``, the balances; ``spectrum`` of the first observable or ``spectrum:NAME``; ``stress``,
            ``tension`` or ``strain`` of lines over the distance from the point of impact or load; ``frequencies`` of
            modes. By default the observables and the energy balance; in statics the results over load steps, or stress
            over distance for one load step.
        out : path-like, optional
            A ``.png``, ``.svg`` or ``.pdf`` to write.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        InputError
            For a quantity that there is not, with the nearest, and a place or format that cannot be written.
        """
        from .pictures.pictures import target
        from .pictures.plots import ENDINGS, draw, write
        from .pictures.record import of_solution

        path = None if out is None else target(out, ENDINGS)
        figure = draw(of_solution(self, with_frames=False), quantity)
        if path is not None:
            write(figure, path)
        return figure

    def report(
        self, out: str | PathLike[str] | None = None, frames: int | None = None, sheet: bool = False
    ) -> pathlib.Path:
        """Write one page of the run, HTML that needs nothing else, with the web in space to turn and play.

        Parameters
        ----------
        out : path-like, optional
            The file, which ends in ``.html``; by default ``report.html`` in the folder of the run, where it has one,
            of the sheet ``sheet.html``.
        frames : int, optional
            Number of frames to turn and play; by default as many as leave the page small.
        sheet : bool
            True to write only the sheet: sizes, largest tension, margin of safety and the verdict on each result.

        Returns
        -------
        pathlib.Path
            The file written.

        Raises
        ------
        InputError
            Where the file cannot be written, ``frames`` is below 1, or a solution in memory gets no ``out``.
        """
        from .pages.page import report_of

        return report_of(self, out, frames, sheet)

    def save(self, folder: str | PathLike[str], force: bool = False) -> None:
        """Write the result folder.

        Parameters
        ----------
        folder : path-like
            Made where it does not exist.
        force : bool
            Replace the results of an earlier run.

        Raises
        ------
        InputError
            Where the folder is not empty or cannot be written.
        """
        from .results.folder import Folder, check_folder, copy

        check_folder(folder, force)
        if self.path is not None:
            copy(self.path, folder)
            return
        out = Folder(folder, self.scene, self.columns, {**self.summary(), "status": "running"})
        for row in zip(*self.history.values(), strict=True):
            out.row(row)
        for number, state in self.frames:
            out.frame(number, state)
        if self.twin_end is not None:
            out.keep_twin(self.twin_end)
        out.close()
        out.summary(self.summary())


def load(folder: str | PathLike[str]) -> Solution:
    """The solution in a result folder, as `refweb.run` returned it.

    Its last state is that of the folder's last frame. The history is read when it is asked for, and a frame when it is
    drawn. Its cost, warnings and status are those of the run: a run that was killed has the status "running".

    Parameters
    ----------
    folder : path-like
        Result folder of a run.

    Raises
    ------
    InputError
        Where the folder holds no run, or its scene leads to another web.
    """
    folder = pathlib.Path(folder).absolute()
    summary = summary_of(folder)
    if "kind" in summary:
        raise InputError(f"result folder {short(str(folder))}: holds {summary['kind']}, not a run")
    scene = scene_of(folder, summary)
    try:
        solution = Solution(scene, path=folder)
        for key in ("status", "message", "web", "events", "solver", "cost", "versions"):
            setattr(solution, key, summary[key])
        for key in (*OPTIONAL, "breaks"):
            setattr(solution, key, summary.get(key, getattr(solution, key)))
        solution.findings = read_findings(summary)
        if used := summary.get("utilisation"):
            solution.utilisation = read_utilisation(used)
        solution.steps = [{**step, "results": read_results(step["results"])} for step in summary["steps"]]
        solution.reduced = {} if solution.steps else read_results(summary["results"])
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError(f"{short(str(folder))}/run.json: is not what a run of refweb writes") from None
    solution.columns, solution.state = _columns(folder), _last_state(folder, scene, solution.commands)
    return solution


def summary_of(folder: str | PathLike[str]) -> dict[str, Any]:
    """The content of ``run.json`` in a result folder of refweb, a dict; `InputError` where there is none."""
    folder = pathlib.Path(folder)
    name = f"result folder {short(str(folder))}:"
    if not folder.is_dir():
        raise InputError(f"{name} there is no such folder")
    summary = read_summary(folder)
    if summary is None or not (folder / "scene.toml").is_file():
        raise InputError(f"{name} holds no run.json and scene.toml of a run: use refweb run")
    return summary


def scene_of(folder: str | PathLike[str], summary: dict[str, Any]) -> Scene:
    """The scene in a result folder, with the stiffness of contact that refweb has chosen still its own to choose."""
    return Scene.load(pathlib.Path(folder) / "scene.toml").replace(chosen=tuple(summary.get("chosen", ())))


def _columns(folder):
    """Names of the columns of the history, with units."""
    try:
        with open(folder / "history.csv", encoding="utf-8") as lines:
            return lines.readline().rstrip("\n").split(",")
    except (OSError, ValueError) as error:
        raise InputError(f"{short(str(folder))}/history.csv: cannot be read: {error}") from None


def _last_state(folder, scene, commands):
    """The state of the last frame, None where there is none."""
    from .results.state import State

    path = folder / "checkpoint.npz"
    if not path.exists():
        return None
    if commands:
        from .dynamics.commands import widened

        scene = widened(scene)
    system = scene.build()
    try:
        with np.load(path) as kept:
            time, x, v = float(kept["time"]), kept["displacements"], kept["velocities"]
            controls = str(kept["controls"]) if "controls" in kept else None
            broken = [kept[name] for name in ("broken", "broken_energies") if name in kept]
            shares = kept["contact_shares"] if "contact_shares" in kept else None
    except Exception as error:  # whatever a spoilt file makes of it
        raise InputError(f"{short(str(path))}: cannot be read: {error}") from None
    if x.shape != (system.rows, 3):
        raise InputError(f"{short(str(path))}: is not that of a run that scene.toml leads to")
    if controls is not None:
        import json

        from .dynamics.commands import Inputs

        Inputs(system).restore_arrays(json.loads(controls)["inputs"])
    if broken and len(broken[0]):
        from .system.broken_lines import torn

        system = torn(system, *broken)
    if shares is not None:
        from .system.contact_shares import with_shares

        system = with_shares(system, shares)
    return State(system, time, x, v)


def _named(column):
    """(name, unit) of a column with its unit."""
    name, unit = column.rsplit(" [", 1)
    return name, unit.removesuffix("]")
