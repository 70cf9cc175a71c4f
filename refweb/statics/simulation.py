"""The load steps of a static scene, one after another: results, history row, remarks and frames of each.

`Simulation` has the interface of `refweb.dynamics.simulation`, and the runner follows either.

May change: private methods. Must stay: public names, which `runner` uses of this `Simulation` and of that of dynamics
alike; a row is (load step, observables, energies) in the order of ``columns``, the header of ``history.csv``; keys of
``steps`` and ``solver``, which are those of ``run.json``. Tests: ``tests/statics/test_statics.py``,
``tests/results/test_frames.py``.
"""

from __future__ import annotations

import numpy as np

from ..errors import SolverError
from ..findings import Finding
from ..registry import STATICS, load
from ..results.columns import FIRST, static_energies
from ..results.observables.line import StressShare
from ..results.solution import SOLVER, Result
from ..results.state import State
from ..results.strength import Utilisation, strength_remark
from ..system.static_system import at_rest
from .remarks import Remarks, open_rows, remarks_on


class Simulation:
    """Follows the load steps of a static scene.

    Parameters
    ----------
    scene : refweb.Scene
        The scene that is solved.
    system : refweb.system.system.System
        System of the scene.
    solution : refweb.Solution
        Its ``steps``, ``state``, ``solver``, ``utilisation`` and, without a folder, ``frames`` grow as load steps are
        solved.

    Attributes
    ----------
    columns : list of str
        Names of the columns of the history.
    rows : list of list of float
        History rows so far.
    """

    def __init__(self, scene, system, solution):
        self.scene, self.system, self.solution = scene, system, solution
        self.rows, self._remarks, self._framed = [], Remarks(), -1
        self._passage, self._lines = _passage_of(scene, system), _lines_of(scene, system)
        self._shares = {}
        if np.isfinite(system.net.strength).any():
            differ = system.net.allowed_share is not None
            self._shares = {over: StressShare(over) for over in ("strength", *(["allowed"] if differ else []))}
        self._totals = dict(nsteps=0, nfev=0, njev=0, nlu=0)
        self.columns = [FIRST["static"], *(f"{o.name} [{o.unit}]" for o in scene.observables)]
        self.columns += [f"{name} [J]" for name in static_energies(system)]

    price = None
    """Expected CPU time of smaller errors: None, since errors of statics are found, not chosen."""

    @property
    def done(self):
        """Text of the number of load steps that were solved."""
        return f"{len(self.rows)} load steps"

    def follow(self, folder, tell):
        """Solve all load steps; write each row and frame to ``folder`` at once, if there is a folder."""
        scene, solution, steps = self.scene, self.solution, self.scene.solve.load_steps
        solve, smoothing = load(STATICS[scene.solve.method]), self._smoothing()
        solution.solver = {**SOLVER, "method": scene.solve.method, **self._totals}
        try:
            for equilibrium in solve(self.system, steps, lambda text: tell(text, len(self.rows) / len(steps))):
                row = self._accept(equilibrium, smoothing)
                self.rows.append(row)
                if folder is not None:
                    folder.row(row)
                if (len(self.rows) - 1) % scene.output.frames == 0:
                    self._frame(folder)
        finally:
            if self._framed < len(self.rows) - 1:
                self._frame(folder)

    def remarks(self):
        """Remarks for a reader of the results."""
        if self.rows:  # ± of the last load step may have grown since
            self._remarks.renew(self.rows[-1][0], "over-strength", strength_remark(self.solution.utilisation))
        yield from self._remarks.findings()
        yield from self.system.remarks()
        if self._passage is not None and self.rows:
            yield from self._passage.overlaps.remarks()
        if self._lines is not None and self.rows:
            yield Finding("lines-in-doubt", f"lines may have passed through lines: {self._lines.why}", "self_contact")

    def _smoothing(self):
        """The `refweb.statics.smoothing_error.Smoothing` of the scene, None if it is not needed."""
        scene = self.scene
        smooth = self.system.net.law_is("smoothed").any()
        if not smooth or scene.solve.method != "newton" or scene.accuracy.error == "none":
            return None
        from .smoothing_error import Smoothing

        return Smoothing(scene, self._shares.values())

    def _accept(self, equilibrium, smoothing):
        """Record an equilibrium; return its history row."""
        scene, solution = self.scene, self.solution
        state = State(equilibrium.system_of(self.system), equilibrium.step, equilibrium.x)
        rest = at_rest(self.system)
        if equilibrium.stability is None and not rest.convex:  # of a method that knows no tangents
            from .stability import ask

            ask(self.system, rest, equilibrium)
        if self.system.weakness is not None:
            self._refuse_break(equilibrium)
        if self._passage is not None:
            self._passage.record(state, equilibrium.path)
            overlaps = self._passage.overlaps
            solution.bodies, solution.pairs = overlaps.plain(), overlaps.pairs.plain() if overlaps.pairs else {}
            overlaps.refuse()
        if self._lines is not None:
            self._lines.record(state)
            solution.passage = {**solution.passage, "lines": f"not certified: {self._lines.why}"}
            solution.lines = self._lines.deepest.plain()
        smoothed = self._smoothed(equilibrium, state, smoothing)
        results = self._results(equilibrium, state, smoothed[: len(scene.observables)])
        row = [equilibrium.step, *(result.value for result in results.values()), *state.energies.values()]
        if not np.isfinite(row).all():
            bad = self.columns[np.isfinite(row).argmin()]
            raise SolverError(f"non-finite {bad} at step {equilibrium.step:g}: the numbers of the scene overflow")
        stats = {key: equilibrium.stats.get(key) for key in SOLVER} | {
            "method": scene.solve.method,
            "factorization": self.system.factorized_by,
            "duality_gap": equilibrium.duality_bound.gap if equilibrium.duality_bound else None,
            "slack_nodes": len(open_rows(state, equilibrium)),
        }
        self._totals = {key: total + stats[key] for key, total in self._totals.items()}
        load = {"load": load} if (load := _load(self.system, equilibrium)) is not None else {}
        solution.steps.append({"step": equilibrium.step, **load, "results": results, "solver": stats})
        solution.solver = {**stats, **self._totals}
        solution.state = state
        if self._shares:
            self._record_shares(equilibrium, state, smoothed[len(results) :])
        self._remarks.record(equilibrium.step, remarks_on(state, stats, solution.utilisation, equilibrium))
        return row

    def _refuse_break(self, equilibrium):
        """Refuse an equilibrium in which a line is broken."""
        from .rupture import refuse_break

        before = self.solution.steps[-1]["step"] if self.solution.steps else 0.0
        refuse_break(self.system, load(STATICS[self.scene.solve.method]), equilibrium, before)

    def _record_shares(self, equilibrium, state, smoothed):
        """Record the largest stress over strength and the margin of safety, with their errors.

        ``smoothed`` has the error of the smooth law of each number in ``_shares``, None where it is not known.
        """
        solution, used, errors = self.solution, self._shares["strength"].of(state), []
        for share, moved in zip(self._shares.values(), smoothed, strict=True):
            error = share.error(state, equilibrium)
            errors.append((error, None if error is None else error + (moved or 0.0)))
        proven = errors[0][0] is not None and self._shares["strength"].proven(equilibrium)
        line = 0 if used.where is None else used.where
        solution.utilisation = Utilisation(used.value, line, errors[0][0], None, smoothed[0], proven)
        if solution.margin is None or state.margin["used"] > solution.margin["used"]:
            solution.margin = {**state.margin, "error": errors[-1][1]}

    def _smoothed(self, equilibrium, state, smoothing):
        """Errors of the smooth law of all results and of the numbers in ``_shares``; None where they are not known."""
        observed = [*(o.observable for o in self.scene.observables), *self._shares.values()]
        if smoothing is None:
            return [None] * len(observed)
        return smoothing.errors(equilibrium, [o.of(state).value for o in observed])

    def _results(self, equilibrium, state, smoothed):
        """The results of an equilibrium by name, with their errors; ``smoothed`` are those of the smooth law."""
        observables = self.scene.observables
        values = [o.value(state) for o in observables]
        errors = [o.error(state, equilibrium) for o in observables]
        share = None
        if (radius := self.system.orbit_radius) is not None:
            places = state.position[: self.system.rows - self.system.net.spins]
            share = float(np.linalg.norm(places, axis=1).max()) / radius
        return {
            o.name: o.bounded(
                Result(
                    *(value.value, error, o.unit, equilibrium.step, value.where, moved),
                    interval=o.interval(state, equilibrium),
                    neglected=None if share is None else abs(value.value) * share,
                    at=None if value.where is None else o.observable.at,
                    proven=error is not None and o.observable.proven(equilibrium),
                ),
                self.system,
            )
            for o, value, error, moved in zip(observables, values, errors, smoothed, strict=True)
        }

    def _frame(self, folder):
        """Keep the last state, in the folder where there is one."""
        self._framed = len(self.rows) - 1
        if folder is None:
            self.solution.frames.append((self._framed, self.solution.state))
        else:
            folder.frame(self._framed, self.solution.state)


def _load(system, equilibrium):
    """Sum of the sizes of the forces of ``[[load]]`` at an equilibrium [N], None without any."""
    forces = [system.force_of(f, equilibrium.step, equilibrium.x) for f in system.terms if f.name == "load"]
    return float(np.linalg.norm(sum(forces), axis=1).sum()) if forces else None


def _passage_of(scene, system):
    """The `refweb.statics.body_penetration.Passage` of a scene, None without contact."""
    if not system.contact:
        return None
    from .body_penetration import Passage

    return Passage(scene, system)


def _lines_of(scene, system):
    """The `refweb.statics.line_penetration.LinePassage` of a scene, None without lines that touch lines."""
    if not any(term.contact.crossing is not None for term in system.terms):
        return None
    from .line_penetration import LinePassage

    return LinePassage(system, "self_contact" in scene.settled().chosen)
