"""From a scene to a solution: the solver runs, and files, history and progress follow it.

May change: private functions, words of findings, `STIFFENINGS` and `MOST_TIMES`. Must stay: `run`, `trust` and
`resume`, which users and verbs call, and `run` also `sweeps.case`, `sizing.case` and `sizing.size`; `_attempt` uses the
same attributes of both simulations (``columns``, ``rows``, ``done``, ``system``, ``price``, ``follow``, ``remarks``);
`_before` asks for keys that `refweb.dynamics.simulation` writes to checkpoints; wrong input writes nothing; `notices`
and `simulation_of`, which `commands.check` imports. Tests: ``tests/results/test_remarks.py``, ``tests/test_faults.py``.
"""

from __future__ import annotations

import itertools
import pathlib
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from . import memory
from .errors import InputError, PenetrationError, in_file
from .findings import NOTE, REFUSAL, Finding, read_findings
from .messages import short
from .results.error_budget import judge, rubs
from .results.folder import Folder, check_folder, fingerprint, is_alive
from .results.progress import followed
from .results.provenance import versions, web_of
from .results.run_status import Clock, recorded
from .results.solution import as_history
from .scene import Scene
from .solution import Solution, scene_of, summary_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from os import PathLike

    from .system.system import System

STIFFENINGS = 8
"""Largest number of times that a run is repeated with a stiffer contact."""
MOST_TIMES = 200
"""Largest number of times at which it is looked whether what acts from outside moves anything."""


def run(
    scene: Scene | str | PathLike[str],
    out: str | PathLike[str] | None = None,
    force: bool = False,
    progress: bool | Callable[..., Any] | None = True,
    announce: Callable[[Scene, System], object] | None = None,
    checkpoint: tuple[Any, Any] = (None, None),
    commands: Sequence[Any] = (),
) -> Solution:
    """Solve a scene.

    Parameters
    ----------
    scene : Scene, path-like or str
        A scene, a scene file or the name of a scene shipped with refweb.
    out : path-like, optional
        Result folder, written while the run goes; without it nothing touches the disk.
    force : bool
        Replace the results of an earlier run in ``out``.
    progress : bool or callable
        True to show the progress in a terminal or a notebook. A callable is called with a line of text and the finished
        share, 0 to 1.
    announce : callable, optional
        Called with the scene and its system when the input has been accepted.
    checkpoint : tuple, optional
        Checkpoint and ``run.json`` of a run that goes on, see `resume`.
    commands : sequence of (float, str, object), optional
        Values that change during a dynamic run: time of a history row [s], path such as ``load.0.force``, and the value
        from then on, see `refweb.start`. The step-refinement run has the same.

    Returns
    -------
    Solution

    Raises
    ------
    InputError
        For wrong input; nothing has been written.
    SolverError
        Where there is no answer or none is found. The rows and frames computed so far stay in ``out``, marked "failed".
    """
    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    if out is not None:
        check_folder(out, force)
    if commands:
        scene = _commanded(scene)
    clock, (scene, system), repeats = Clock(), scene.settle(), []
    with followed(progress) as tell:
        while True:
            try:
                return _attempt(scene, system, out, tell, announce, clock, repeats, *checkpoint, commands)
            except PenetrationError as soft:  # repeated with a stiffer contact as often as the chosen one is too soft
                table = "self_contact" if "self_contact" in soft.stiffness else "contact"
                repeats.append(Finding("repeated", str(soft), table, NOTE))
                scene, announce, checkpoint = scene.with_stiffness(soft.stiffness), None, (None, None)
                if len(repeats) == STIFFENINGS:  # what is chosen now counts as given: it is warned of, or refused
                    scene = scene.replace(chosen=())
                system = scene.build()


def trust(
    scene: Scene | str | PathLike[str],
    budget: float | None = None,
    out: str | PathLike[str] | None = None,
    force: bool = False,
    progress: bool | Callable[..., Any] | None = True,
    announce: Callable[[Scene, System], object] | None = None,
) -> Solution:
    """Find all parts of the error of each result of a scene, and its verdict.

    Parameters
    ----------
    budget : float, optional
        CPU time that all runs may take [s], see `refweb.Accuracy`.
    out : path-like, optional
        Result folder of the run, with ``trust.json`` and ``trust.png``; without it nothing touches the disk.
    scene, force, progress, announce
        See `refweb.run`.

    Returns
    -------
    Solution
        Its ``results`` have ``parts``, ``error`` and ``verdict``; its ``further`` are the further runs
        by which the parts were found.

    Raises
    ------
    InputError
        For wrong input; nothing has been written.
    SolverError
        Where the scene itself has no answer.
    """
    from dataclasses import replace

    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    budget = scene.accuracy.budget if budget is None else budget
    accuracy = replace(scene.accuracy, error="twin", level="full", budget=budget)
    solution = run(scene.replace(accuracy=accuracy), out, force, progress, announce)
    if out is not None:
        from .studies.further_runs import write

        write(solution, out)
    return solution


def resume(
    folder: str | PathLike[str],
    progress: bool | Callable[..., Any] | None = True,
    announce: Callable[[Scene, System], object] | None = None,
) -> Solution:
    """Continue a dynamic run that was killed or interrupted or failed, from its last checkpoint.

    Central differences come to what the undisturbed run comes to, bit for bit; CVODE and IDA start again there, and
    come to it within their tolerance. A run without a checkpoint starts from its beginning.

    Parameters
    ----------
    folder : path-like
        Result folder of the run.
    progress, announce : callable, optional
        See `run`.

    Returns
    -------
    Solution

    Raises
    ------
    InputError
        Where ``folder`` holds no such run.
    SolverError
        See `run`.
    """
    from .dynamics.initial_state import checkpoint

    folder = pathlib.Path(folder)
    name = f"result folder {short(str(folder))}:"
    summary = summary_of(folder)
    if summary.get("status") == "solved":
        raise InputError(f"{name} holds a solved run: there is nothing to continue")
    if is_alive(folder):
        raise InputError(f"{name} is being written by a run that is alive: wait for its end, or stop it")
    if summary.get("commands"):
        raise InputError(f"{name} holds a run with commands, which cannot be continued: start it again")
    scene = scene_of(folder, summary)
    if "kind" in summary or scene.solve.kind == "static":
        raise InputError(f"{name} holds no dynamic run, and only dynamic runs have checkpoints: use refweb run --force")
    check_folder(folder, force=True)
    kept = checkpoint(folder, name) if (folder / "checkpoint.npz").exists() else None
    if kept is None:
        return run(scene, folder, True, progress, announce)
    if str(kept.get("scene", "")) not in ("", fingerprint(folder)):
        raise InputError(
            f"{name} its scene.toml is not that of the run any more: put it back, or use refweb run --force"
        )
    return run(scene, folder, True, progress, announce, (kept, summary))


def _attempt(scene, system, out, tell, announce, clock, repeats, kept=None, summary=None, commands=()):
    """Solve a scene as it stands, with its system.

    ``repeats`` are the findings of attempts before; ``kept`` and ``summary`` are checkpoint and ``run.json`` of a run
    that goes on.
    """
    if out is None:
        _check_frames(scene, system)
    if announce is not None:
        announce(scene, system)
    solution = Solution(scene, web=web_of(system), versions=versions())
    if kept is None:
        solution.findings += [*repeats, *notices(scene, system)]
    else:
        solution.findings += _before(kept, summary, system, solution.versions)
    simulation = simulation_of(scene, system, solution, kept, commands)
    solution.commands = [list(command) for command in commands]
    solution.columns = simulation.columns
    row = None if kept is None else int(kept["row"])
    folder = Folder(out, scene, solution.columns, solution.summary(), row=row) if out is not None else None
    try:
        with recorded(solution, clock, lambda: simulation.done):
            simulation.follow(folder, tell)
            if scene.accuracy.refine:
                tell("finding the errors of elements", 1.0)
                _refine(scene, solution)
            if scene.accuracy.horizon:
                from .studies.predictability import horizon

                solution.horizon = horizon(simulation, solution.results, scene.accuracy.ensemble, tell)
            errors = None
            if scene.accuracy.level == "full":
                from .studies.further_runs import FurtherRuns

                rows = simulation.rows if folder is None else folder.rows()
                further = FurtherRuns(simulation, solution, rows, clock, run, tell)
                further.follow()
                errors = further.findings()
            judge(solution, scene, simulation.system, simulation.price, errors)
    finally:
        if folder is None or scene.solve.kind == "static":
            solution.table = as_history(solution.columns, simulation.rows)
        if folder is not None:
            solution.path = folder.path.absolute()
        solution.cost["by_effect"] = _cpu_by_effect(system, solution)
        solution.findings = list(dict.fromkeys([*solution.findings, *simulation.remarks()]))  # a resumed run has some
        if folder is not None:
            folder.close()
            folder.summary(solution.summary())
    return solution


def _commanded(scene):
    """The scene of a run with commands, `widened`; refuses one whose further runs would not have them."""
    from .dynamics.commands import widened

    if scene.solve.kind == "static":
        raise InputError('commands need [solve] kind = "dynamic": statics has load steps')
    accuracy = scene.accuracy
    for key, stands in (("refine", accuracy.refine), ("horizon", accuracy.horizon)):
        if stands:
            raise InputError(f"[accuracy] {key} = true cannot stand beside commands: its further runs have none")
    if accuracy.level == "full":
        raise InputError('[accuracy] level = "full" cannot stand beside commands: its further runs have none')
    return widened(scene)


def _check_frames(scene, system):
    """Refuse frames that do not fit into memory, which has to keep them all where no folder takes them."""
    solve, every = scene.solve, scene.output.frames
    static = solve.kind == "static"
    count = 1 + (len(solve.load_steps) - 1 if static else int(solve.duration / scene.output.interval)) // every
    size = memory.of_states(count, system.rows, len(system.net.cells), read=static)
    memory.check(size, f"[output] frames = {every}: {count} frames of a run that writes no result folder")


def _refine(scene, solution):
    """Add the errors of elements to the results."""
    from .studies.discretisation_error import discretisation_errors

    def results(solution):
        return [step["results"] for step in solution.steps] or [solution.reduced]

    changed = discretisation_errors(
        scene.replace(chosen=()), results(solution), lambda finer: results(run(finer, progress=False))
    )
    if not solution.steps:
        solution.reduced = changed[0]
    for step, with_errors in zip(solution.steps, changed, strict=False):
        step["results"] = with_errors


def _before(kept, summary, system, versions):
    """Warnings of a run that goes on; refuses a checkpoint that is none of this system."""
    known = {"row", "accuracy", "repeated", "missing", "shares", "run"}
    if not known <= kept.keys() or kept.get("positions", np.zeros(0)).shape != (system.rows, 3):
        raise InputError("checkpoint.npz is not that of a run that scene.toml leads to: use refweb run")
    yield from (finding for finding in read_findings(summary) if finding.severity != REFUSAL)
    begun = summary["versions"]
    if differing := [name for name in versions if begun.get(name) != versions[name]]:
        changes = ", ".join(f"{name} {versions[name]} after {begun.get(name)}" for name in differing)
        yield Finding("resumed", f"resumed with {changes}: what follows may differ in its last digits", "", NOTE)


def simulation_of(
    scene: Scene, system: System, solution: Solution, kept: Any = None, commands: Sequence[Any] = ()
) -> Any:
    """Make the simulation of a scene; refuse with an `InputError` a scene that its solver cannot take."""
    with in_file(scene.file):
        if scene.solve.kind == "static":
            from .statics.simulation import Simulation

            return Simulation(scene, system, solution)
        from .dynamics.simulation import Simulation

        return Simulation(scene, system, solution, kept, commands)


def notices(scene: Scene, system: System) -> Iterator[Finding]:
    """Findings on a scene before it is solved."""
    if system.net.web.kind == "file":
        from .net.mesh_file import remarks

        yield from remarks(system.net.web)

    from .net.materials import remarks as remarks_on_materials

    for text in remarks_on_materials(scene.cable):
        yield Finding("material", text, "cable", NOTE)
    for body in system.net.bodies:
        for text in body.shape.remarks():
            yield Finding("surface", f'body "{body.name}": {text}', "body")
    under = {wrap.body for thread in system.net.threads for wrap in thread.wraps}
    if not system.contact and any(not body.carried and body.name not in under for body in system.net.bodies):
        yield Finding("body-not-felt", "the scene has a [[body]] but no [contact]: the web does not feel it", "body")
    if scene.solve.kind == "static" and any(map(rubs, scene.effects)):
        text = 'statics has no friction: contact pushes along its normal alone; [solve] kind = "dynamic" has it'
        yield Finding("left-out", text, "contact")
    alone = [o.name for o in scene.observables if o.quantity in ("tension", "stress") and o.thread is o.line is None]
    if system.net.threads and alone:
        text = (
            f'{", ".join(alone)}: of lines alone; that of thread "{system.net.threads[0].name}" is observed by thread'
        )
        yield Finding("left-out", text, "observe", NOTE)
    if system.net.threads and any(hasattr(effect, "expansion") for effect in scene.effects):
        text = (
            f'[temperature] acts on lines alone: thread "{system.net.threads[0].name}" keeps its natural length; give '
        )
        yield Finding("left-out", text + "it the one that it has then, length or prestrain", "thread")
    yield from _idle(system, getattr(scene.solve, "load_steps", (0.0, *system.corners)))
    if scene.solve.kind == "static" and (parts := system.unsupported_parts):
        axes = ", ".join(sorted({"xyz"[part.axis] for part in parts}))
        rows = np.unique(np.concatenate([part.rows for part in parts]))
        nodes = np.count_nonzero(rows < system.net.nodes)
        bodies = f" and {len(rows) - nodes} bodies" if nodes < len(rows) else ""
        text = f"{nodes} nodes{bodies} have no support along {axes}: their position there is not unique"
        yield Finding("no-support", text, "supports")


def _idle(system, times):
    """Warnings of what acts from outside on supports alone, at some times."""
    for term in system.terms:
        if term.balance.internal or term.frame.angular_velocity is not None:
            continue
        times = sorted({*times, *term.timing.times})
        between = [0.5 * (before + after) for before, after in itertools.pairwise(times)]
        felt = [system.force_of(term, t, np.zeros((system.rows, 3))) != 0.0 for t in (*times, *between)[:MOST_TIMES]]
        acts = np.any(felt, axis=0)
        if acts.any() and not (acts & ~system.fixed).any():  # a node that a free body carries moves with it
            rows = np.flatnonzero(acts.any(axis=1))
            names = ", ".join(map(system.row_name, rows[:4])) + (", ..." if len(rows) > 4 else "")
            text = f"the {term.name} on {names} acts only on supports, which carry it: it moves nothing"
            yield Finding("idle-load", text, term.name)


def _cpu_by_effect(system, solution):
    """Estimate of each effect's share of the CPU time [s]: its kernel alone at the last state × its calls.

    In dynamics the calls are those of the run and of its twin, and what the kernels do not account for is "all else":
    steps, peaks, rows, files, and runs that were repeated.
    """
    state, share, scene = solution.state, {}, solution.scene
    calls = solution.solver["nfev"] or 0
    if scene.solve.kind == "dynamic":
        calls *= solution.steps_of_both
    for term in system.terms:
        if state is None:
            break
        best = np.inf
        for _ in range(3):
            begin = time.perf_counter()
            system.force_of(term, state.time, state.x, state.v)
            best = min(best, time.perf_counter() - begin)
        share[term.name] = share.get(term.name, 0.0) + best * calls
    if scene.solve.kind == "dynamic":
        share["all else"] = max(solution.cost["cpu_s"] - sum(share.values()), 0.0)
    return share
