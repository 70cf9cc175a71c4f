"""The data of a solution: what a run fills in while it goes, and what ``run.json`` says of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..findings import texts
from ..messages import nearest

if TYPE_CHECKING:
    from ..scene import Scene

SOLVER = dict.fromkeys(
    "method factorization nsteps nfev njev nlu residual duality_gap above_lowest smallest_pivot slack_nodes "
    "energy_drift momentum_drift angular_momentum_drift".split()
)
"""What a solver reports; None for what it does not know."""


OTHER_ERRORS = {"smoothing": "smoothing moves", "discretisation": "discretisation error", "neglected": "orbit neglects"}
"""Errors of a result that have keys of their own, and the words before them; ± holds the first two."""


class Names(dict):
    """A dict whose unknown keys are answered with the nearest one."""

    def __missing__(self, key):
        raise KeyError(f"{key!r} is not among them, {nearest(key, self)}")


class Result(NamedTuple):
    """A result of a run: value, its error (None where none is known), unit, time and place.

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

    def bounded(self, lower, upper):
        """The result where only what lies from ``lower`` to ``upper`` is possible."""
        if self.error is None or not np.isfinite(self.error):
            return self
        error = min(self.error, max(self.value - lower, upper - self.value, 0.0))
        low, high = self.value - self.error, self.value + self.error
        cut = (low < lower or high > upper) and lower <= self.value <= upper
        return self._replace(error=error, within=(max(low, lower), min(high, upper)) if cut else None)

    def plain(self):
        """Convert to a dict, without the errors that were not looked for; an infinite end of an interval is None."""
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


def read_results(given):
    """Results by name of what ``run.json`` says of them; a `TypeError` where no run has said that."""
    results = {name: Result(**entry) for name, entry in given.items()}
    for name, entry in results.items():
        if not (
            isinstance(entry.value, float | int)
            and isinstance(entry.error, float | None)
            and isinstance(entry.unit, str)
        ):
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
    """Data of a scene that is solved, or being solved.

    Attributes
    ----------
    scene : refweb.Scene
        What was solved.
    state : refweb.results.state.State
        The last state.
    columns : list of str
        Names of the columns of ``history.csv``, with units.
    steps : list of dict
        Results and solver figures of each load step.
    solver, cost, web : dict
        As in ``run.json``.
    versions : dict of str to str
        Versions of refweb, Python and the libraries that solved it, by name.
    status : {"running", "solved", "failed", "interrupted"}
        How it ended; ``message`` says why.
    findings : list of refweb.findings.Finding
        Remarks, warnings and refusals: what a reader of the results has to know, by code.
    table : dict of str to ndarray, optional
        The history, where it is held in memory; of load steps always.
    path : pathlib.Path, optional
        The result folder that a run wrote while it went.
    utilisation : refweb.results.strength.Utilisation, optional
        Largest stress over strength, in dynamics over time, its line and its ±; None where no line has a strength.
    margin : dict, optional
        The smallest margin of safety, in dynamics over time, in statics over load steps, see
        `refweb.results.state.margin_of`; None where no line has a strength.
    bodies : dict
        Of each body that the web may touch, by name: its deepest ``overlap`` [m], ``time`` and ``line`` of that, the
        overlap ``allowed``, and the ``stiffness`` of its contact, ``chosen`` by refweb or given; of a mesh the
        ``surface_error`` [m], by which its field misses the surface.
    pairs : dict
        Of each two bodies that have touched each other, by names: the deepest ``overlap`` [m], its ``time``, the
        overlap ``allowed`` and the ``stiffness`` of their contact.
    lines : dict
        Of lines that touch lines the deepest ``overlap`` [m], their ``radius`` [m] and the ``stiffness`` [N/m];
        empty without ``[self_contact]``.
    passage : dict
        "certified" where nothing can have passed, or why that is not certain: of ``lines`` through lines, of lines
        through ``bodies``, and of ``pairs`` of bodies through each other.
    reduced : dict
        Results of a dynamic run; `results` has those of either kind.
    horizon : dict
        How long the motion is determined, see `refweb.studies.predictability.horizon`; empty where that was not asked
        for.
    divergence : refweb.dynamics.divergence.Divergence, optional
        Exponential growth of the difference of a run and its twin; None where there is none.
    further : list of dict
        Further runs that have told of parts of errors, see `refweb.studies.further_runs`: ``part``, ``text``, ``cpu_s``
        and ``status`` of each.
    events : list of dict
        Of each event its ``name``, the ``time`` it happened at [s], None if it did not, and the ``error`` of that.
    throw : dict
        What came of a throw, see `refweb.Throw`; empty where that was not asked for.
    breaks : list of dict, optional
        Of each element that has broken, in the order in which they did, its ``line``, ``element``, ``time`` [s] and the
        ``error`` of that, the ``place`` of its middle [m] and the ``energy`` [J] that it held; None where nothing may.
    broken_before : list of int
        Lines that were broken before the run began.
    twin_end : (ndarray, ndarray), optional
        Displacement [m] and velocity [m/s] at which the twin run ended, each of shape (rows, 3); None where there was
        none.
    frames : list of (int, refweb.results.state.State)
        Row numbers and states of a run that writes no folder. One that does keeps none: its frames are files, which
        are read when they are looked at.
    """

    scene: Scene
    state: Any = None
    table: dict | None = None
    path: Any = None
    columns: list = field(default_factory=list)
    steps: list = field(default_factory=list)
    solver: dict = field(default_factory=SOLVER.copy)
    cost: dict = field(default_factory=lambda: {"cpu_s": 0.0, "wall_s": 0.0, "compile_s": 0.0, "by_effect": {}})
    web: dict = field(default_factory=dict)
    versions: dict = field(default_factory=dict)
    status: str = "running"
    message: str = ""
    findings: list = field(default_factory=list)
    events: list = field(default_factory=list)
    throw: dict = field(default_factory=dict)
    breaks: list | None = None
    broken_before: list = field(default_factory=list)
    twin_end: tuple | None = None
    frames: list = field(default_factory=list)
    reduced: dict = field(default_factory=dict)
    horizon: dict = field(default_factory=dict)
    divergence: Any = None
    further: list = field(default_factory=list)
    utilisation: Any = None
    margin: dict | None = None
    bodies: dict = field(default_factory=dict)
    pairs: dict = field(default_factory=dict)
    lines: dict = field(default_factory=dict)
    passage: dict = field(default_factory=dict)

    @property
    def warnings(self) -> list[str]:
        """Texts of the findings, but for the refusal that ``message`` has."""
        return texts(self.findings)

    @property
    def results(self) -> dict[str, Result]:
        """Results by name, each a `refweb.results.solution.Result`; of the last load step."""
        return Names(self.steps[-1]["results"] if self.steps else self.reduced)

    @property
    def history(self) -> dict[str, np.ndarray]:
        """Columns of the history by name, a dict of arrays with one entry per row.

        First ``time`` [s], in statics ``step``, then every observable and the energies [J], in dynamics the momentum of
        all that is free and the impulse of the supports [N s] as well. A dynamic run that writes a folder holds none of
        it in memory: it is read from there.
        """
        if self.table is not None:
            return self.table
        rows = np.loadtxt(self.path / "history.csv", delimiter=",", skiprows=1, ndmin=2)
        return as_history(self.columns, rows)

    def summary(self):
        """The content of ``run.json``, a dict of plain values."""

        def plain(results):
            return {name: result.plain() for name, result in results.items()}

        return {
            "status": self.status,
            "message": self.message,
            "scene": self.scene.title,
            "web": self.web,
            "results": plain(self.results),
            "steps": [{**step, "results": plain(step["results"])} for step in self.steps],
            "events": self.events,
            **({} if self.breaks is None else {"breaks": self.breaks}),
            **({"broken_before": self.broken_before} if self.broken_before else {}),
            "solver": self.solver,
            "cost": self.cost,
            "versions": self.versions,
            "seed": self.scene.seed,
            **({"chosen": list(self.scene.chosen)} if self.scene.chosen else {}),
            "warnings": self.warnings,
            "findings": [finding._asdict() for finding in self.findings],
            **({"utilisation": self.utilisation.plain()} if self.utilisation else {}),
            **({"margin": self.margin} if self.margin else {}),
            **({"bodies": self.bodies} if self.bodies else {}),
            **({"pairs": self.pairs} if self.pairs else {}),
            **({"lines": self.lines} if self.lines else {}),
            **({"passage": self.passage} if self.passage else {}),
            **({"throw": self.throw} if self.throw else {}),
            **({"horizon": self.horizon} if self.horizon else {}),
            **({"further_runs": self.further} if self.further else {}),
        }


def as_history(columns, rows):
    """Rows of numbers as a dict by name; ``columns`` are names with units."""
    names = [column.rsplit(" [", 1)[0] for column in columns]
    table = np.asarray(rows, dtype=float).reshape(len(rows), len(names))
    return Names(zip(names, table.T, strict=True))
