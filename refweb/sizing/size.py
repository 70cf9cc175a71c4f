"""Size a scene: find the least design that meets requirements, write it as a scene, run it, and say what governs it.

May change: private functions and notes for readers; `GOVERNS` and `SHOWN`, which decide what these say. Must stay:
`size`, its arguments and result, and attributes of `Sized`, which `refweb` exports; keys of `Sized.summary`, which are
those of ``run.json`` and which `results.sizing_text` and `pictures.sizing` read; names of files in the folder;
`prepared`, which `commands.arguments` imports. Tests: ``tests/sizing/test_size.py``.
"""

from __future__ import annotations

import math
import pathlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..errors import SolverError
from ..messages import quote
from ..results.case_rows import results_among, written
from ..results.files import as_toml, finite, write_text
from ..results.progress import followed
from ..results.provenance import versions
from ..results.run_status import Clock, recorded
from ..sweeps.workers import crew_of
from .formulas import MOST_SIDES
from .problem import Problem
from .requirements import Sizing, load
from .runs import Runs
from .search import BESIDE, best, method_of, searched
from .smooth import ACTIVE

if TYPE_CHECKING:
    from os import PathLike

    from ..scene import Scene

GOVERNS = 1e-6
"""Difference of reserves up to which a requirement is the tightest."""
SHOWN = 1e-3
"""Part of the gradient of the objective up to which the conditions of an optimum hold."""


@dataclass(eq=False, repr=False)
class Sized:
    """The least design that meets requirements, as `refweb.size` returns it.

    Attributes
    ----------
    sizing : refweb.Sizing
        The requirements.
    scene : refweb.Scene or None
        Scene of the design; of draws with the values of the scene file.
    values : dict
        Free numbers of the design by name.
    objective : dict
        ``value``, ``error`` and ``unit`` of what is least, of draws of its mean.
    requirements : list of dict
        Of each requirement ``name``, ``condition``, ``probability``, ``reserve`` over its limit with its ends ``least``
        and ``most``, ``holds`` (true, false or None: undecided), ``governs``, and ``costs``: change of the objective
        for a limit that is 1 % stricter, None where it is not known or the conditions of an optimum do not hold.
    optimality : dict or None
        By gradients ``residual``, the part of the gradient of the objective that the active requirements and bounds do
        not balance, and ``at_bound``, numbers at a bound.
    designs : list of dict
        All designs that were run: ``values``, ``objective``, ``reserve``, the smallest one, and ``holds``.
    status : {"running", "solved", "unconfirmed", "undecided", "infeasible", "failed", "interrupted"}
        "unconfirmed" if the design meets all requirements, but by gradients the conditions of an optimum do not hold,
        so that a better one may exist; "infeasible" if no design meets all requirements, and "undecided" if one may
        within ±, where ``values`` are those of the nearest design.
    message : str
        Reason for another status than "solved".
    method : str
        The method.
    runs : int
        Number of runs since the start, without those recorded before.
    notes : list of str
        Remarks, as on designs that ± leaves undecided.
    """

    sizing: Sizing
    title: str
    method: str
    scene: Scene | None = None
    values: dict[str, Any] = field(default_factory=dict)
    objective: dict[str, Any] = field(default_factory=dict)
    requirements: list[dict[str, Any]] = field(default_factory=list)
    optimality: dict[str, Any] | None = None
    designs: list[dict[str, Any]] = field(default_factory=list)
    status: str = "running"
    message: str = ""
    runs: int = 0
    recorded: int = 0
    notes: list[str] = field(default_factory=list)
    cost: dict[str, Any] = field(default_factory=lambda: {"cpu_s": 0.0, "wall_s": 0.0, "compile_s": 0.0})
    versions: dict[str, str] = field(default_factory=versions)

    def summary(self) -> dict[str, Any]:
        """The content of ``run.json``, a dict of plain values; ``kind`` is "size"."""
        kept = ("status", "message", "method", "values", "objective", "requirements", "optimality", "designs")
        kept += ("runs", "recorded", "notes", "cost", "versions", "title")
        plain = {key: finite(getattr(self, key)) for key in kept}
        return {"kind": "size", **plain, "sizing": self.sizing.to_dict()}

    def __repr__(self) -> str:
        design = ", ".join(f"{name} = {quote(value)}" for name, value in self.values.items())
        return f'<Sized "{self.title}": {self.status}; {design}>'


def size(
    requirements: Sizing | str | PathLike[str],
    out: str | PathLike[str] | None = None,
    executor: Any = None,
    workers: int | None = None,
    progress: bool | Callable[..., Any] | None = True,
    announce: Callable[[Sized], object] | None = None,
) -> Sized:
    """Find the least design of a scene that meets requirements.

    Parameters
    ----------
    requirements : Sizing, path-like or str
        Requirements, a requirements file, or the name of one shipped with refweb.
    out : path-like, optional
        Folder of the sizing: every run is recorded there, and one that is recorded is not run again. ``design.toml`` is
        the scene of the design, ``design`` its result folder. Without it nothing is written to the disk.
    executor : concurrent.futures.Executor, optional
        Executor that runs designs; by default processes of this machine, and this process for single designs.
    workers : int, optional
        Number of processes, by default one for each processor.
    progress : bool or callable
        See `refweb.run`.
    announce : callable, optional
        Called with the `Sized` before anything is run.

    Returns
    -------
    Sized

    Raises
    ------
    InputError
        For wrong input; nothing has been written.
    SolverError
        Where no design gives a result, and where the folder cannot be written or the executor takes no more runs.
    """
    clock = Clock()
    crew = crew_of(executor, workers)
    sized, problem = prepared(requirements)
    runs = Runs(problem, out, crew)
    sized.recorded = runs.recorded
    if announce is not None:
        announce(sized)
    runs.begin(sized.summary())
    try:
        with recorded(sized, clock, lambda: f"{runs.fresh} runs"), followed(progress, "starting") as runs.tell:
            try:
                optima, spent = searched(runs, sized.method)
            finally:
                runs.crew.stop()
                runs.end()
                sized.runs, sized.recorded = runs.fresh, len(runs.asked) - runs.fresh
            _conclude(sized, runs, *best(runs, optima), spent)
            _write(sized, runs)
    finally:
        runs.summary(sized.summary())
    return sized


def prepared(requirements):
    """Check requirements; (the `Sized` before any run, the `refweb.sizing.problem.Problem`)."""
    sizing = requirements if isinstance(requirements, Sizing) else load(requirements)
    problem = Problem(sizing)
    return Sized(sizing, sizing.title, method_of(problem)), problem


def _conclude(sized, runs, judged, optimum, spent):
    """Say what was found: the design, its requirements, and designs that are undecided."""
    for j in runs.judged.values():
        result = {"objective": j.value, "reserve": j.tightest, "holds": j.feasible}
        sized.designs.append({"values": runs.problem.space.values(j.design), **result})
    if judged is None:
        reasons = [j.message for j in runs.judged.values() if j.message]
        raise SolverError(f"no design gives a result: {reasons[0] if reasons else 'the first has none'}")
    if spent:
        sized.notes.append(f"runs = {sized.sizing.runs} are reached: more may find a better design")
    low, high = judged.objective
    unit = {item.name: item.unit for item in results_among(judged.rows[0])}.get(sized.sizing.minimise, "")
    sized.values = runs.problem.space.values(judged.design)
    sized.objective = {"value": judged.value, "error": 0.5 * (high - low) + _of_mean(sized, judged), "unit": unit}
    confirmed = optimum if optimum is not None and optimum.residual <= SHOWN else None
    sized.requirements = [
        _requirement(*row, runs, judged, confirmed, sized.method) for row in enumerate(runs.problem.requirements)
    ]
    *_, sized.scene = runs.problem.space.scene(judged.design)
    sized.scene = sized.scene.replace(title=f"{sized.title}: design"[:200])
    if judged.feasible is not True:
        sized.status = "infeasible" if judged.feasible is False else "undecided"
        sized.message = _nearest(sized)
    else:
        if optimum is not None:
            sized.optimality = {"residual": optimum.residual, "at_bound": optimum.bounds}
        if confirmed is None and sized.method == "gradients":
            sized.status, sized.message = "unconfirmed", _unconfirmed(optimum)
    _add_notes(sized, runs, judged)


def _of_mean(sized, judged):
    """± of the mean of the objective over draws by Student's t, which a note names; 0 without draws."""
    if not sized.sizing.draws:
        return 0.0
    count, level = sized.sizing.count, sized.sizing.confidence
    text = f"{sized.sizing.minimise} is the mean of {count} draws"
    if count < 2:
        sized.notes.append(f"{text}, whose ± is not known")
        return 0.0
    from scipy.stats import t

    sized.notes.append(f"{text}, whose ± holds with a confidence of {level:g}")
    return float(t.ppf(0.5 * (1.0 + level), count - 1)) * judged.spread


def _unconfirmed(optimum):
    """Text on a design by gradients at which the conditions of an optimum do not hold."""
    known = "are not known" if optimum is None else f"hold to {optimum.residual:.1e} alone"
    kink = "the search may have ended at a kink, where two lines share a largest value"
    return f'conditions of an optimum {known}: {kink}; a better design may exist: try more starts or "evolution"'


def _requirement(number, name, runs, judged, optimum, method):
    """Entry of a requirement."""
    given, reserve = runs.problem.sizing.requirements[name], judged.reserves[number]
    multiplier = None if optimum is None else optimum.multipliers.get(name, 0.0)
    tightest = reserve.low <= judged.tightest + GOVERNS
    if method == "gradients":
        tightest = tightest and reserve.low <= ACTIVE
    return {
        "name": name,
        "condition": given.condition,
        "probability": given.probability,
        "reserve": 0.5 * (reserve.low + reserve.high),
        "least": reserve.low,
        "most": reserve.high,
        "holds": judged.verdicts[number],
        "governs": bool(tightest if multiplier is None else multiplier > 0.0),
        "costs": None if multiplier is None else float(0.01 * multiplier),
    }


def _nearest(sized):
    """Text on the design that is nearest to meeting all requirements."""
    worst, design = min(sized.requirements, key=lambda entry: entry["least"]), _text_of(sized.values)
    wanted = f" with probability {worst['probability']:g}" if worst["probability"] is not None else ""
    how = f"fails by {-100.0 * worst['least']:.3g} % of its limit"
    if worst["holds"] is None:
        how = "is not decided within ±; a run with a smaller ± decides it"
    text = "no design within bounds meets all requirements"
    return f"{text}: nearest is {design}, where {worst['name']}, {worst['condition']}{wanted}, {how}"


def _text_of(values):
    """Free numbers of a design as text."""
    texts = {name: f"{value:.4g}" if isinstance(value, float) else quote(value) for name, value in values.items()}
    return ", ".join(f"{name} = {value}" for name, value in texts.items())


def _count(designs, adjective, verb, of_several):
    """Number of some designs, with an adjective and a verb, which is another one ``of_several``."""
    return f"{len(designs)} {adjective}" + (f"design {verb}" if len(designs) == 1 else f"designs {of_several}")


def _add_notes(sized, runs, judged):
    """Note undecided designs, failed ones, and results without ±."""
    every = list(runs.judged.values())
    better = [
        j for j in every if j.feasible is None and j.value < judged.value * (1.0 - math.copysign(BESIDE, judged.value))
    ]
    if judged.feasible is True and better:
        lower = min(better, key=lambda j: j.value)
        verdicts = zip(runs.problem.requirements, lower.verdicts, strict=True)
        by = ", ".join(name for name, verdict in verdicts if verdict is None)
        text = f"{_count(better, 'lesser ', 'is', 'are')} not decided within ± and counted as not meeting the "
        text += f"requirements, such as {_text_of(runs.problem.space.values(lower.design))} by {by}"
        sized.notes.append(f"{text}: a run with a smaller ± decides them")
    alike = [j for j in every if j.feasible is True and j is not judged and j.objective.low < judged.objective.high]
    if sized.method == "enumeration" and alike:
        count = _count(alike, "other ", "is", "are")
        sized.notes.append(f"{count} as good within ± of {sized.sizing.minimise}: their order is not decided")
    if failed := [j for j in every if j.message]:
        sized.notes.append(f"{_count(failed, '', 'has', 'have')} no result: {failed[0].message}")
    _note_starts(sized, runs, judged)
    lacking = {item.name for item in results_among(judged.rows[0]) if judged.rows[0].get(f"{item.name} ±") is None}
    if lacking := sorted(lacking & runs.problem.used):
        sized.notes.append(f"the ± of {', '.join(lacking)} is not known: it is compared by its value alone")


def _note_starts(sized, runs, judged):
    """Note where the searches from several starts ended, and conditions of which each follows one part alone."""
    ends = [value for options, value in runs.ends if options == judged.design.options]
    if len(ends) > 1:
        reached = sum(value is not None and value <= judged.value + SHOWN * abs(judged.value) for value in ends)
        others = sorted(value for value in ends if value is not None)[reached:]
        text = f"{reached} of {len(ends)} starts end at this objective"
        text += f", others at {', '.join(f'{value:.4g}' for value in others)}" if others else ""
        text += f", {ends.count(None)} at no design that meets the requirements" if None in ends else ""
        sized.notes.append(f"{text}: gradients find an optimum near each start")
    if sized.method == "gradients" and not runs.problem.sides():
        names = ", ".join(name for name, formula in runs.problem.requirements.items() if formula.count > 1)
        text = f'"or" has more than {MOST_SIDES} sides together, of which each start follows the nearest one alone'
        sized.notes.append(f"{names}: {text}: designs of others may be better")


def _write(sized, runs):
    """Write the scene of the design, its result folder and its page, unless they are there."""
    if runs.path is None:
        return
    from ..pages.page import report
    from ..results.error_budget import OPEN
    from ..results.folder import read_summary
    from ..runner import run

    folder, file, text = runs.path / "design", runs.path / "design.toml", as_toml(sized.scene.to_dict())
    before = file.read_text(encoding="utf-8") if file.is_file() else None
    summary = read_summary(folder) or {}
    if before != text or summary.get("status") != "solved":
        with written(runs.path):
            write_text(pathlib.Path(file), text)
        runs.tell("running the design", 1.0)
        summary = run(sized.scene, out=folder, force=folder.exists(), progress=False).summary()
        report(folder)
    sized.notes += [f"the design: {text}" for text in summary.get("warnings", ())]
    parts = {name: entry.get("parts") or {} for name, entry in summary.get("results", {}).items()}
    used = [name for name in runs.problem.used if parts.get(name, {}).get("elements") == OPEN]
    if used:
        text = "± is that of these elements: finer ones may change it, see [accuracy] refine"
        sized.notes.append(f"{', '.join(sorted(used))}: {text}")
