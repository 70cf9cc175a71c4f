"""The data of a solution: attributes that a run fills in, and their form in ``run.json``.

May change: the text that `Names` shows, and words in `OTHER_ERRORS`, not its keys. Must stay: keys of `summary` and
`plain`, the format of ``run.json``, which `read_results`, pictures, pages and users read; names of fields, which
statics, dynamics, `studies.modes` and users fill or read (a new one needs a default, so that older files can be read);
`SolutionData` with its public names, which `solution` and `pictures.pictures` import; `as_history`, which `runner`,
`dynamics.stepped_run` and other files import; `Result` with its public names, which `dynamics.history`,
`dynamics.simulation` and other files import; `SOLVER`, which `dynamics.simulation`, `statics.simulation` and
`studies.modes` import. Tests: ``tests/results/test_results.py``, ``tests/results/test_loaded.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..findings import Finding, texts
from ..messages import nearest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..scene import Scene

SOLVER: dict[str, Any] = dict.fromkeys(
    "method factorization nsteps nfev njev nlu residual duality_gap above_lowest smallest_pivot slack_nodes "
    "energy_drift momentum_drift angular_momentum_drift".split()
)
"""Statistics of a solver; None for those that it does not know."""


OTHER_ERRORS = {"smoothing": "smoothing moves", "discretisation": "discretisation error", "neglected": "orbit neglects"}
"""Errors of a result with separate keys, and the words before them; ± contains the first two."""


OPTIONAL = "broken_before commands controls margin bodies pairs lines passage throw horizon".split()
"""Keys of ``run.json`` and attributes of a solution that are left out where they are empty."""


class Names(dict[str, Any]):
    """A dict whose errors on unknown keys name the nearest key."""

    def __missing__(self, key: str) -> Any:
        raise KeyError(f"{key!r} is not among them, {nearest(key, self)}")


class Result(NamedTuple):
    """A result of a run: value, error (None if it is not known), unit, time and position.

    ``error`` is the sum of all ``parts`` that are known, see `refweb.results.error_budget`: each of these is a number,
    or "none" for one of the ``reasons``, or "not estimated". ``verdict`` is what the number is worth, None where parts
    are missing for that, with a sentence ``verdict_text`` and, where it is determined, its ``digits``. ``proven`` says
    that ± of an equilibrium is a bound from duality. ``smoothing`` and ``discretisation`` are the parts of the smooth
    law and of elements, where these were looked for. In an orbit ``neglected`` is what its equations leave out, see
    `refweb.Orbit`; None where there is none. ``interval`` are the least and the largest value in all equilibria, where
    parts of the web float; an end that nothing holds is infinite. ``within`` are the least and the largest value that ±
    leaves of those which are possible, where it goes beyond them: a length is not negative, and a share is 0 to 1.
    ``at`` says what ``where`` is the number of, "node", "line" or, of several bodies, "body".
    """

    value: float
    error: float | None
    unit: str
    time: float
    where: int | None
    smoothing: float | None = None
    discretisation: float | None = None
    neglected: float | None = None
    interval: tuple[float, float] | None = None
    at: str | None = None
    within: tuple[float, float] | None = None
    parts: dict[str, float | str] | None = None
    reasons: dict[str, str] | None = None
    verdict: str | None = None
    verdict_text: str = ""
    digits: int | None = None
    proven: bool = False

    def bounded(self, lower: float, upper: float) -> Result:
        """The result with ± cut to the possible values from ``lower`` to ``upper``."""
        if self.error is None or not np.isfinite(self.error):
            return self
        error = min(self.error, max(self.value - lower, upper - self.value, 0.0))
        low, high = self.value - self.error, self.value + self.error
        cut = (low < lower or high > upper) and lower <= self.value <= upper
        return self._replace(error=error, within=(max(low, lower), min(high, upper)) if cut else None)

    def plain(self) -> dict[str, Any]:
        """Convert to a dict, without errors that were not computed; an infinite end of an interval is None."""
        extra = {key: value for key in OTHER_ERRORS if (value := getattr(self, key)) is not None}
        if self.where is not None:
            extra["at"] = self.at
        if self.within is not None:
            extra["within"] = list(self.within)
        if self.interval is not None:
            extra["interval"] = [end if np.isfinite(end) else None for end in self.interval]
        if self.proven:
            extra["proven"] = True
        if self.parts is not None:
            extra |= {key: getattr(self, key) for key in ("parts", "reasons", "verdict", "verdict_text", "digits")}
        return {key: getattr(self, key) for key in ("value", "error", "unit", "time", "where")} | extra


def read_results(given: dict[str, Any]) -> dict[str, Result]:
    """Results by name from their dicts in ``run.json``; raise a `TypeError` for other content."""
    results = {name: Result(**entry) for name, entry in given.items()}
    for name, entry in results.items():
        kinds = ((entry.value, float | int), (entry.error, float | None), (entry.unit, str))
        if not all(isinstance(value, kind) for value, kind in kinds):
            raise TypeError(f"{name} is not a number")
        if entry.within is not None:
            results[name] = entry = entry._replace(within=tuple(entry.within))
        if entry.interval is not None:
            lower, upper = entry.interval
            ends = -np.inf if lower is None else lower, np.inf if upper is None else upper
            results[name] = entry._replace(interval=ends)
    return results


@dataclass(eq=False, repr=False)
class SolutionData:
    """Data of a run, during it and after it.

    Attributes
    ----------
    scene : refweb.Scene
        The scene of the run.
    state : refweb.results.state.State
        The last state.
    columns : list of str
        Names of the columns of ``history.csv``, with units.
    steps : list of dict
        Results and solver statistics of each load step.
    solver, cost, web : dict
        As in ``run.json``.
    versions : dict of str to str
        Versions of refweb, Python and the libraries that solved it, by name.
    status : {"running", "solved", "failed", "interrupted"}
        How the run ended; ``message`` has the reason.
    findings : list of refweb.findings.Finding
        Remarks, warnings and refusals on the results, by code.
    table : dict of str to ndarray, optional
        The history, if it is kept in memory; always for load steps.
    path : pathlib.Path, optional
        The result folder of the run.
    utilisation : refweb.results.strength.Utilisation, optional
        Largest stress over strength, in dynamics over time, with its line and ±; None if no line has a strength.
    margin : dict, optional
        The smallest margin of safety, in dynamics over time, in statics over load steps, see
        `refweb.results.state.margin_of`; None if no line has a strength.
    bodies : dict
        Entry for each body that the web may touch, by name: deepest ``overlap`` [m] with its ``time`` and ``line``, the
        ``allowed`` overlap, the ``stiffness`` of contact, and ``chosen``, True if refweb chose it. A body from a mesh
        has the ``surface_error`` [m], the error of its distance field at the surface.
    pairs : dict
        Entry for each two bodies that have touched each other, by names: deepest ``overlap`` [m], its ``time``, the
        ``allowed`` overlap and the ``stiffness`` of their contact.
    lines : dict
        Contact of lines with lines: the deepest ``overlap`` [m], ``radius`` of the lines [m] and ``stiffness`` [N/m];
        empty without ``[self_contact]``.
    passage : dict
        Penetration checks: "certified" if it is proven that nothing has passed through, else the reason for doubt.
        ``lines`` is for lines through lines, ``bodies`` for lines through bodies, ``pairs`` for bodies through bodies.
    reduced : dict
        Results of a dynamic run; `results` has those of any run.
    horizon : dict
        Horizon of the motion, see `refweb.studies.predictability.horizon`; empty if it was not asked for.
    divergence : refweb.dynamics.divergence.Divergence, optional
        Exponential growth of the difference from the step-refinement run; None without such growth.
    further : list of dict
        ``part``, ``text``, ``cpu_s`` and ``status`` of each further run, see `refweb.studies.further_runs`.
    events : list of dict
        ``name`` of each event, its ``time`` [s] (None if it did not happen), and the ``error`` of that.
    throw : dict
        Numbers of a throw, see `refweb.Throw`; empty if they were not asked for.
    breaks : list of dict, optional
        Entry for each broken element, in the order of the breaks: ``line``, ``element``, ``time`` [s] with its
        ``error``, ``place`` of its middle [m] and its stored ``energy`` [J]; None if no line can break.
    broken_before : list of int
        Lines that were broken at the start of the run.
    commands : list of (time, path, value)
        Values that changed during the run.
    controls : list of dict
        ``name`` of each control, what it ``sets``, and of the size of that the integral over time, ``spent`` with
        ``error`` and ``unit``, and the ``largest``.
    twin_end : (ndarray, ndarray), optional
        Displacement [m] and velocity [m/s] at the end of the step-refinement run, each of shape (rows, 3); None without
        such a run.
    twin_steps : int
        Number of steps of the step-refinement run, 0 without such a run.
    frames : list of (int, refweb.results.state.State)
        Row numbers and states of a run without a folder. A run with a folder keeps none in memory: its frames are
        files, which are read when they are needed.
    """

    scene: Scene
    state: Any = None
    table: dict[str, NDArray[np.float64]] | None = None
    path: Any = None
    columns: list[str] = field(default_factory=list)
    steps: list[dict[str, Any]] = field(default_factory=list)
    solver: dict[str, Any] = field(default_factory=SOLVER.copy)
    cost: dict[str, Any] = field(
        default_factory=lambda: {"cpu_s": 0.0, "wall_s": 0.0, "compile_s": 0.0, "by_effect": {}}
    )
    web: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    status: str = "running"
    message: str = ""
    findings: list[Finding] = field(default_factory=list)
    events: list[dict[str, Any]] = field(default_factory=list)
    throw: dict[str, Any] = field(default_factory=dict)
    breaks: list[dict[str, Any]] | None = None
    commands: list[Any] = field(default_factory=list)
    controls: list[Any] = field(default_factory=list)
    broken_before: list[int] = field(default_factory=list)
    twin_end: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    twin_steps: int = 0
    frames: list[tuple[int, Any]] = field(default_factory=list)
    reduced: dict[str, Result] = field(default_factory=dict)
    horizon: dict[str, Any] = field(default_factory=dict)
    divergence: Any = None
    further: list[dict[str, Any]] = field(default_factory=list)
    utilisation: Any = None
    margin: dict[str, Any] | None = None
    bodies: dict[str, Any] = field(default_factory=dict)
    pairs: dict[str, Any] = field(default_factory=dict)
    lines: dict[str, Any] = field(default_factory=dict)
    passage: dict[str, Any] = field(default_factory=dict)

    @property
    def steps_of_both(self) -> float:
        """Steps of the run and of its step refinement, over those of the run; 1 in statics."""
        return 1.0 + self.twin_steps / max(self.solver["nsteps"] or 0, 1)

    @property
    def warnings(self) -> list[str]:
        """Texts of the findings, without the refusal that is in ``message``."""
        return texts(self.findings)

    @property
    def results(self) -> dict[str, Result]:
        """Results by name, each a `refweb.results.solution.Result`; in statics those of the last load step."""
        return Names(self.steps[-1]["results"] if self.steps else self.reduced)

    @property
    def history(self) -> dict[str, NDArray[np.float64]]:
        """Columns of the history by name, a dict of arrays with one entry per row.

        The first column is ``time`` [s], in statics ``step``. Then follow all observables and the energies [J], in
        dynamics also the momentum of free nodes and bodies and the impulse of the supports [N s]. The history of a
        dynamic run with a folder is read from its file.
        """
        if self.table is not None:
            return self.table
        rows = np.loadtxt(self.path / "history.csv", delimiter=",", skiprows=1, ndmin=2)
        return as_history(self.columns, rows)

    def summary(self) -> dict[str, Any]:
        """The content of ``run.json``, a dict of plain values; None for numbers of a failed run that are not finite."""
        from .files import finite

        def plain(results):
            return {name: result.plain() for name, result in results.items()}

        content = {
            "status": self.status,
            "message": self.message,
            "scene": self.scene.title,
            "web": self.web,
            "results": plain(self.results),
            "steps": [{**step, "results": plain(step["results"])} for step in self.steps],
            "events": self.events,
            **({} if self.breaks is None else {"breaks": self.breaks}),
            "solver": self.solver,
            "cost": self.cost,
            "versions": self.versions,
            "seed": self.scene.seed,
            **({"chosen": list(self.scene.chosen)} if self.scene.chosen else {}),
            "warnings": self.warnings,
            "findings": [finding._asdict() for finding in self.findings],
            **({"utilisation": self.utilisation.plain()} if self.utilisation else {}),
            **{key: value for key in OPTIONAL if (value := getattr(self, key))},
            **({"further_runs": self.further} if self.further else {}),
        }
        return finite(content)


def as_history(columns: Sequence[str], rows: Any) -> Names:
    """Rows of numbers as a dict by name; ``columns`` are names with units."""
    names = [column.rsplit(" [", 1)[0] for column in columns]
    table = np.asarray(rows, dtype=float).reshape(len(rows), len(names))
    return Names(zip(names, table.T, strict=True))
