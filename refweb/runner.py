"""From a scene to a solution: the solver runs, and files, history and progress follow it."""

from __future__ import annotations

import importlib.metadata
import sys
import time

import numpy as np

from . import __version__, statics
from .io import Folder, check_folder
from .laws import LINEAR, SMOOTH
from .observables import Result
from .scene import Scene
from .solution import SOLVER, Solution, as_history
from .state import State


def run(scene, out=None, force=False, progress=None, announce=None):
    """Solve a scene.

    Parameters
    ----------
    scene : Scene, path-like or str
        A scene, a scene file or the name of a scene shipped with refweb.
    out : path-like, optional
        Result folder, written while the run goes; without it nothing touches the disk.
    force : bool
        Replace the results of an earlier run in ``out``.
    progress : callable, optional
        Called with a line of text and the share that is done, 0 to 1.
    announce : callable, optional
        Called with the scene and its system when the input has been accepted.

    Returns
    -------
    Solution

    Raises
    ------
    InputError
        For wrong input; nothing has been written.
    SolverError
        Where there is no answer or none is found. What was computed is kept in ``out``, marked "failed".
    """
    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    if out is not None:
        check_folder(out, force)
    started = time.process_time(), time.perf_counter()
    system = scene.build()
    if announce is not None:
        announce(scene, system)
    solution = Solution(scene, web=web_of(system), versions=_versions())
    solution.warnings += _notices(scene, system)
    names, units = ["step"], ["1"]
    for observable in scene.observables:
        names.append(observable.name)
        units.append(observable.unit)
    energies = list(State(system, 0.0, np.zeros((system.rows, 3))).energies)
    names, units = names + energies, units + ["J"] * len(energies)
    solution.columns = [f"{name} [{unit}]" for name, unit in zip(names, units, strict=True)]
    rows, remarks = [], {}
    folder = Folder(out, scene, solution.columns, solution.summary()) if out is not None else None
    try:
        _solve(scene, system, solution, rows, remarks, folder, progress)
        solution.status = "solved"
    except KeyboardInterrupt:
        solution.status, solution.message = "interrupted", f"interrupted after {len(rows)} load steps"
        raise
    except statics.SolverError as error:
        solution.status, solution.message = "failed", str(error)
        raise
    except Exception as error:
        solution.status, solution.message = "failed", f"{type(error).__name__}: {error}"
        raise
    finally:
        solution.history = as_history(names, rows)
        solution.cost = _cost(system, solution, started)
        solution.warnings += _told(remarks, len(rows))
        if folder is not None:
            folder.close()
            folder.summary(solution.summary())
    return solution


def _solve(scene, system, solution, rows, remarks, folder, progress):
    """Follow the load steps: results, remarks and history row of each, and frames of some, the last always."""
    steps = scene.solve.load_steps

    def tell(text):
        if progress is not None:
            progress(text, len(rows) / len(steps))

    def frame():
        solution.frames.append((len(rows) - 1, solution.state))
        if folder is not None:
            folder.frame(*solution.frames[-1])

    totals = dict(nsteps=0, nfev=0, njev=0, nlu=0)
    solution.solver = {**SOLVER, "method": scene.solve.method, **totals}
    try:
        for found in statics.solve(system, steps, tell):
            state = State(system, found.step, found.x)
            values = [o.value(state) for o in scene.observables]
            errors = [o.error(state, found.certificate) for o in scene.observables]
            results = {
                o.name: Result(value.value, error, o.unit, found.step, value.where)
                for o, value, error in zip(scene.observables, values, errors, strict=True)
            }
            stats = {key: found.stats.get(key) for key in SOLVER} | {
                "method": scene.solve.method,
                "duality_gap": found.certificate.gap if found.certificate else None,
                "slack_nodes": len(state.slack_nodes),
            }
            totals = {key: totals[key] + stats[key] for key in totals}
            row = [found.step, *(v.value for v in values), *state.energies.values()]
            if not np.isfinite(row).all():
                bad = solution.columns[np.isfinite(row).argmin()]
                raise statics.SolverError(f"non-finite {bad} at step {found.step:g}: the numbers of the scene overflow")
            solution.steps.append({"step": found.step, "results": results, "solver": stats})
            solution.solver = {**stats, **totals}
            solution.state = state
            rows.append(row)
            for kind, text in _remarks(state, stats):
                remarks.setdefault(kind, []).append((found.step, text))
            if folder is not None:
                folder.row(row)
            if (len(rows) - 1) % scene.output.frames == 0:
                frame()
    finally:
        if rows and solution.frames[-1][0] < len(rows) - 1:
            frame()


def web_of(system):
    """Sizes of the web, as `run.json` holds them."""
    web, net = system.net.web, system.net
    return {
        "nodes": len(web.points),
        "lines": len(web.lines),
        "cells": int(web.cells),
        "cable_length": float(np.sum(net.natural_length)),
        "area": float(web.area),
        "mass": float(net.mass.sum()),
    }


def _versions():
    names = ("numpy", "scipy", "scikit-fem", "numba", "meshio", "qdldl")
    own = {"refweb": __version__, "python": sys.version.split()[0]}
    return {**own, **{name: importlib.metadata.version(name) for name in names}}


def _notices(scene, system):
    loose = statics.unsupported(system)
    if not loose:
        return []
    axes = ", ".join(sorted({"xyz"[axis] for _, axis in loose}))
    nodes = np.unique(np.concatenate([rows for rows, _ in loose]))
    return [f"{len(nodes)} nodes have no support along {axes}: their position there is not unique"]


def _cost(system, solution, started):
    """CPU and wall time, and an estimate of each effect's share: its kernel alone at the last state × its calls."""
    cpu, wall = time.process_time() - started[0], time.perf_counter() - started[1]
    state, share = solution.state, {}
    for family in system.families if state is not None else ():
        best = np.inf
        for _ in range(3):
            begin = time.process_time()
            system.force_of(family, state.time, state.x)
            best = min(best, time.process_time() - begin)
        share[family.name] = share.get(family.name, 0.0) + best * solution.solver["nfev"]
    return {"cpu_s": cpu, "wall_s": wall, "by_effect": share}


def _remarks(state, stats):
    """What a reader of a state has to know: pairs of a kind and a text."""
    net = state.system.net
    stress = float(state.stress.max())
    if net.law.number == SMOOTH:
        columns = net.line_data[:, 1:4].T
        floor = float((net.law.floor(*columns) / net.area).max())
        if floor > 0.01 * stress:
            yield "floor", (
                f"floor of the smooth law {floor:.4g} Pa is above 1 % of the largest stress {stress:.4g} Pa: "
                'slack lines push; lower smoothing or use law = "tension-only"'
            )
    if stats["smallest_pivot"] == -1:
        law = "bars" if net.law.number == LINEAR else "slack lines under the law's floor"
        yield "saddle", (
            f"the equilibrium is a saddle (a pivot of its tangent is negative): {law} push, and the web would wrinkle "
            'or buckle out of this state; law = "tension-only" has no such states'
        )
    if stats["slack_nodes"]:
        some = ", ".join(map(str, state.slack_nodes[:4])) + (", ..." if len(state.slack_nodes) > 4 else "")
        yield "slack", f"{stats['slack_nodes']} nodes hang on slack lines only, their positions are not unique: {some}"
    if state.utilisation is not None and state.utilisation.max() > 1.0:
        line = int(state.utilisation.argmax())
        yield "strength", f"line {line} breaks: stress over strength is {state.utilisation[line]:.3g}"


def _told(remarks, count):
    """Each kind of remark once, as it was last made, with the load steps it was made at unless that is all."""
    for made in remarks.values():
        steps = ", ".join(f"{step:g}" for step, _ in made[:8]) + (", ..." if len(made) > 8 else "")
        yield made[-1][1] + (f" (load step {steps})" if len(made) < count else "")
