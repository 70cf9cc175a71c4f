"""Dynamic run of a scene: from its start through rows and frames to results, with checkpoints.

May change: private methods, `LOOKS`, words of findings. Must stay: public names, which `runner` uses of this
`Simulation` and of that of statics alike, and `accuracy_loop`, `twin_error`, `stepped_run`, `gradients` and
`studies.predictability` too; keys that `_frame` writes to ``checkpoint.npz``: `_set_off` and `runner._before` read
them. Tests: ``tests/dynamics/test_dynamics.py``, ``tests/test_faults.py``, ``tests/dynamics/test_starts.py``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..effects.base import pairs_of
from ..errors import EnergyDriftError, InputError, IntegrationError, SolverError
from ..findings import NOTE, Finding
from ..registry import INTEGRATORS
from ..results.solution import SOLVER, Result
from ..results.state import State, curve_remark, floor_remark, strain_remark, strain_remarks_of_thread
from ..results.strength import strength_remark
from .accuracy_loop import CLIMBS, AccuracyState, reach_digits, run_within_drift
from .budget import Budget, check_budget
from .history import Watch
from .initial_state import (
    Start,
    equilibrium,
    fields_of,
    record_of,
    remarks_on,
    remarks_on_lengths,
    stored,
    unused_velocities,
)
from .integrators.crossings import APART, BESIDE, THROUGH
from .integrators.integrator import MAX_STEPS_PER_ROW, IntegratorState
from .integrators.momentum_balance import pushing_terms
from .schedule import FEW_CORNERS, Schedule, blocks, time_of

NO_TWIN = (
    "the run that it starts from had no step-refinement run: ± holds the error that this run adds, not that of "
    "the state it starts from"
)


LOOKS = 8
"""Number of frames in which edges are sought that are sharp for the elements, the last among them."""


class RunResult(NamedTuple):
    """A complete run: results by name, without errors, corrections between steps, and the course.

    ``shares`` and ``share_corrections`` are those of stress over its limits, see `refweb.dynamics.history.Watch`.
    """

    results: dict[str, Result]
    corrections: dict[str, float]
    course: IntegratorState
    shares: dict[str, Result]
    share_corrections: dict[str, float]


class Simulation:
    """Runs a dynamic scene: history rows, peaks, frames, errors.

    Parameters
    ----------
    scene : refweb.Scene
        Scene with observables, output and method.
    system : refweb.system.system.System
        The system.
    solution : refweb.Solution
        Solution that is filled in.
    kept : dict of str to ndarray, optional
        Checkpoint of a run that continues.
    commands : sequence of refweb.dynamics.commands.Command
        Values that change during the run.

    Attributes
    ----------
    watch : refweb.dynamics.history.Watch
        Monitors of the integrator.
    schedule : refweb.dynamics.schedule.Schedule
        Times of rows and frames.
    integrator : refweb.dynamics.integrators.integrator.Integrator
        Integrator of the run.
    begin : refweb.dynamics.initial_state.Start
        Initial state; an equilibrium is known after the start of the run.
    begin_of_twin : refweb.dynamics.initial_state.Start, optional
        Initial state of the step refinement, if it differs: the end of the step refinement of an earlier run.
    standing : refweb.dynamics.accuracy_loop.AccuracyState
        Present accuracy, and number of repeated runs.
    budget : refweb.dynamics.budget.Budget
        Budget of all runs.

    Raises
    ------
    InputError
        If the method cannot solve the scene.
    """

    def __init__(self, scene, system, solution, kept=None, commands=()):
        self._ways = None
        if scene.solve.method == "auto":
            from .method_fallback import MethodFallback

            self._ways = MethodFallback(scene, system, kept)
            scene = self._ways.scene
        self.begin, self.begin_of_twin = Start(system.settled(system.laid)), None
        if kept is not None:
            self.begin = Start(*(kept.get(f"begin_{name}") for name in Start._fields))
            if "twin_begin_x" in kept:
                self.begin_of_twin = Start(kept["twin_begin_x"], kept["twin_begin_v"])
        elif scene.start_folder is not None:
            self.begin, self.begin_of_twin = stored(system, scene.start_folder)
            solution.findings += unused_velocities(system, self.begin)
            solution.findings += remarks_on_lengths(system, scene.start_folder)
            if self.begin_of_twin is None and self.begin.v is not None and self.begin.v.any():
                solution.findings.append(Finding("no-error", NO_TWIN, "accuracy"))
        system = self.begin.torn(system)
        solution.broken_before = np.unique(system.net.line[system.net.broken]).tolist()
        self.scene, self.system, self.solution = scene, system, solution
        self.watch, self.schedule = Watch(scene, system), Schedule.of(scene)
        if commands or scene.control:
            from .controllers import commands_of

            acting = commands_of(scene, system, self.watch, self.schedule, commands)
            self.schedule = self.schedule._replace(commands=acting)
        self.overlaps, self._silent = _overlaps_of(scene, system), _silent_of(system)
        self._lines, self._through = None, _through_of(system)
        self._tables, self._compared, self._share_rows = [], [], []
        self._kept: Any = kept
        self._jumps, self._coincident = None, False
        frames = self.schedule.frames[::-1]
        self._looks = set(frames[:: -(-len(frames) // LOOKS)].tolist())
        _check_step(scene)
        self._stand(kept)
        self.integrator = self.integrator_at(self.standing.knob)
        if kept is None and len(system.corners) > FEW_CORNERS:
            from .breakpoints import remarks_on_corners

            solution.findings += remarks_on_corners(scene, system)
        if scene.solve.start != "equilibrium" and kept is None:
            solution.findings += remarks_on(self.begin, system)
            self._note_jumps(self.begin.contact_shares, self.begin.x)

    @property
    def columns(self):
        """Names of the columns of ``history.csv``, with units."""
        return self.watch.columns

    @property
    def done(self):
        """Text of the time that the run has reached."""
        return f"t = {self._tables[-1][-1, 0] if self._tables else 0.0:.6g} s"

    def price(self, share):
        """Expected CPU time for errors that are smaller by a factor ``share`` [s], see `refweb.dynamics.budget`."""
        return self.budget.price_of(self.integrator, share, CLIMBS)

    @property
    def rows(self):
        """Rows of ``history.csv``, shape (rows, columns); only the last one if a folder has them."""
        return np.concatenate(self._tables) if self._tables else np.zeros((0, len(self.columns)))

    def integrator_at(self, knob):
        """The integrator of the scene, at a value of its knob."""
        method, solve, watch = INTEGRATORS[self.scene.solve.method], self.scene.solve, self.watch
        looked_at = watch.probes, watch.sums, watch.events
        return method.integrator_of(solve, self.system, *looked_at, **{method.knob: knob})

    def follow(self, folder, tell):
        """Run from start to end, as often as needed.

        Parameters
        ----------
        folder : refweb.results.folder.Folder or None
            Folder to which rows and frames are written during the run.
        tell : callable
            Called with a text and the finished share.
        """
        self.settle(tell)
        while True:
            try:
                if self._jumps and self.scene.solve.method in ("cvode", "ida"):
                    raise IntegrationError(f'{self._jumps}; use method = "central-difference"')
                run_within_drift(self, folder, tell)
                if (digits := self.scene.accuracy.digits) is not None:
                    reach_digits(self, digits, folder, tell)
            except IntegrationError as error:
                if self._ways is None:
                    raise
                self._fall_back(self._ways, error, folder)
            else:
                break

    def _stand(self, kept=None):
        """Set the state at the start of a method, or at a checkpoint."""
        solve = self.scene.solve
        self.standing = AccuracyState.of(getattr(solve, INTEGRATORS[solve.method].knob), kept)
        self.budget = Budget(self.scene.accuracy.budget)

    def _fall_back(self, ways, error, folder):
        """Discard the run and start with another method; raise a `SolverError` if there is none."""
        self.solution.findings.append(Finding("method-changed", ways.give_over(error), "solve", NOTE))
        self.scene, self.solution.reduced, self.solution.solver = ways.scene, {}, dict(SOLVER)
        self._stand()
        self.again(folder)

    def settle(self, tell):
        """Set the equilibrium as initial state where the scene asks for it."""
        if self.scene.solve.start != "equilibrium" or self._kept is not None:
            return
        from ..statics.remarks import on_stability, remark_on_open
        from ..system.static_system import waiting

        equilibrium_ = equilibrium(self.system, lambda text: tell(f"equilibrium, {text}", 0.0))
        x = self.system.settled(equilibrium_.x)
        self.begin, state = Start(x), State(self.system, 0.0, x)
        for finding in remark_on_open(state, equilibrium_):
            text = f"of the equilibrium it starts from: {finding.text}"
            self.solution.findings.append(finding._replace(text=text))
        self.solution.findings += on_stability(state, equilibrium_, "the equilibrium it starts from")
        self._note_jumps(equilibrium_.contact_shares, x)
        self.solution.findings += remarks_on(self.begin, self.system)
        absent = waiting(self.system)
        if names := [body.name for body in absent if body.carried]:
            which = "bodies that move at the start are held while the web finds its equilibrium"
            text = f"{which}, and so are the nodes that they carry: {', '.join(names)}"
            self.solution.findings.append(Finding("left-out", text, "body"))
        if self.overlaps is not None and len(absent) < len(self.system.net.bodies):
            from ..statics.body_penetration import Passage

            passage = Passage(self.scene, self.system)
            passage.record(State(self.system, 0.0, equilibrium_.x), equilibrium_.path)
            passage.overlaps.refuse()

    def _note_jumps(self, shares, x):
        """Note that elements share the push of a body at the start x, between which it jumps in dynamics."""
        if shares is None:
            return
        from ..statics.contact_kinks import jumps
        from ..system.static_system import at_rest

        self._jumps = jumps(at_rest(self.system), shares, x)
        if self._jumps:
            self.solution.findings.append(Finding("shared-push", self._jumps, "contact"))

    def run(self, folder, tell):
        """Run once from start to end and return a `RunResult`.

        ``tell`` is called with what the run has come to, in words, and the share that is done.
        """
        times, integrator = self.schedule.times, self.integrator
        course, ahead = self._set_off(folder)
        self._refuse_overlap(course)
        end = float(times[-1])

        def report(t):
            tell(", ".join([time_of(t, end), *self.watch.progress(course, self._tables)]), t / end)
            check_budget(self, t / end)

        report(course.time)
        integrator.on_progress = report
        try:
            for block in blocks(integrator, course, self.schedule, ahead):
                table = self.watch.table(block.history)
                if len(self.schedule.between):
                    self._compared += self.watch.compared(self.watch.table(block.compared)).tolist()
                self._share_rows.append(self.watch.shares_of(block.compared))
                self.inspect(course)
                last = block.first + len(table) - 1
                if folder is None:
                    self._tables.append(table)
                else:
                    self._tables = [table[-1:]]
                    for row in table:
                        folder.row(row)
                if last in self.schedule.frames or course.stopped:
                    self._frame(last, folder, course)
                report(course.time)
        except SolverError as error:
            self._refuse_overlap(course)  # whatever stopped it: what comes of a line within a body is nonsense
            if isinstance(error, EnergyDriftError) and (text := self.watch.half_turns(course, drifts=True)):
                error.args = (f"{error}; {text}",)
            raise
        finally:
            self._record(course)
        relative = self.standing.knob if integrator.knob == "rtol" else 0.0
        corrections = self.watch.corrections(course, relative, getattr(integrator, "tolerances", {}))
        shares = self.watch.shares(course), self.watch.share_corrections(course, relative)
        return RunResult(self.watch.results(course, self._tables[-1][-1]), corrections, course, *shares)

    def inspect(self, course):
        """Refuse a course whose lines are too deep in bodies, and note what is warned of."""
        self._refuse_overlap(course)
        if self._silent is not None:
            self._silent.inspect(course.time, course.x)

    def compared(self, folder):
        """Rows for the comparison with a step refinement, see `refweb.dynamics.history.Watch.compared`."""
        if len(self.schedule.between):
            return np.array(self._compared)
        return self.watch.compared(self.rows if folder is None else folder.rows())

    @property
    def share_rows(self):
        """Stress over its limits in the rows of `compared`, shape (rows, shares), see `Watch.shares_of`."""
        return np.concatenate(self._share_rows) if self._share_rows else np.zeros((0, 0))

    def again(self, folder):
        """Discard the run, for a run with the knob of ``standing``."""
        self.integrator, self._tables, self._compared = self.integrator_at(self.standing.knob), [], []
        self._share_rows = []
        self.overlaps, self._lines = _overlaps_of(self.scene, self.system), None
        self._through, self._silent = _through_of(self.system), _silent_of(self.system)
        self.solution.frames.clear()
        self.solution.twin_end, self.solution.twin_steps = None, 0
        if folder is not None:
            folder.restart(self.solution.summary())

    def _set_off(self, folder):
        """The course at its start, or at its checkpoint, and the number of the next row."""
        self.schedule.reset()
        if self._kept is None:
            return self.integrator.start(*self.begin.motion), 0
        course, row = self.integrator.load(fields_of(self._kept["run"])), int(self._kept["row"])
        self._compared = self._kept.get("compared", np.zeros((0, 0))).tolist()
        self._share_rows = [self._kept["share_rows"]] if "share_rows" in self._kept else []
        if self._silent is not None:
            self._silent.restore(self._kept.get("silent", np.zeros((0, 3))))
        if self.overlaps is not None and "edges" in self._kept:
            self.overlaps.restore_edges(self._kept["edges"])
        self._resume_controls(course, row, folder.last_row())
        self._kept, self._tables = None, [np.array([folder.last_row()])]
        times, frames = self.schedule.times, self.schedule.frames
        folder.listed([*((n, times[n]) for n in frames[frames < row]), (row, course.time)], self.system.net.bodies)
        return course, len(times) if course.stopped else row + 1

    def _resume_controls(self, course, row, values):
        """Restore the controls of a checkpoint, and apply their commands at its row."""
        commands = self.schedule.commands
        if commands is not None:
            commands.load(str(self._kept["controls"]))
            commands.act_on(row, self.integrator, course, np.array(values))

    def _refuse_overlap(self, course):
        """Refuse lines that are too deep in bodies, see `refweb.effects.contact.overlap.Deepest`."""
        if self.overlaps is not None:
            self.watch.note_overlaps(course, self.overlaps)
            self.overlaps.refuse()
        if (deepest := self.watch.overlap_of_lines(course)) is not None:
            if self._lines is None:
                from ..effects.self_contact.penetration import Passage

                chosen = self.scene.settled().chosen
                self._lines = Passage(self.system, self._unfollowed(), "self_contact" in chosen)
            self._lines.record(deepest[0], course.crossings[[APART, BESIDE]])
            overlap, time, cell = deepest
            self._lines.refuse(overlap, f"t = {time:.6g} s", cell, course.v)

    def _unfollowed(self):
        """Reason why lines are not checked against lines, None if they are checked."""
        method = self.scene.solve.method
        if not getattr(self.integrator, "follows_lines", False):
            return f"{method} does not follow lines in its steps"
        if self.system.carried.any() and INTEGRATORS[method].knob == "safety":
            return "nodes that turn with a body by [[attach]] do not move in straight lines"
        return None

    def _record(self, course):
        """Record the state of a run in the solution."""
        solution, watch = self.solution, self.watch
        self._largest_stress, self._unfilled = watch.largest_stress(course), watch.unfilled(course)
        if (used := watch.utilisation(course)) is not None:
            solution.utilisation, solution.margin = used, watch.margin(course)
        self._strain, self._share_of_curve = watch.strain(course), watch.share_of_curve(course)
        self._strains_of_threads = watch.strains_of_threads(course)
        self._half_turns = watch.half_turns(course)
        if self.overlaps is not None:
            solution.bodies = self.overlaps.plain()
            if (pairs := self.overlaps.pairs) is not None:
                watch.note_way(course, pairs, self.integrator)
                solution.pairs, solution.passage = pairs.plain(), {"pairs": pairs.passage()}
        if self._through is not None:
            self._through.record(course.crossings[THROUGH])
            solution.passage = {**solution.passage, "bodies": self._through.status()}
        if self._lines is not None:
            solution.passage, solution.lines = {**solution.passage, "lines": self._lines.status()}, self._lines.plain()
        if np.isfinite(course.x).all():
            solution.state = self._state(course)
        if course.breaks is not None:
            solution.breaks = self.watch.breaks(course)
        solution.events = [
            {"name": event.name, "time": float(time) if np.isfinite(time) else None, "error": None}
            for event, time in zip(self.scene.event, course.events["time"][: len(self.scene.event)], strict=True)
        ]
        if self.schedule.commands is not None:
            controllers = self.schedule.commands.controllers
            solution.controls = [controller.plain(course.time) for controller in controllers]
            self.surfaces = [controller.surfaces for controller in controllers]
        spent = dict(nsteps=course.nsteps, **course.drifts, **self.integrator.spent(course))
        terms = self.system.terms
        if integrated := sorted({terms[i].name for i in pushing_terms(terms)}):
            spent["integrated_impulses"] = integrated
        choice = {} if self._ways is None else self._ways.record()
        solution.solver = {**SOLVER, "method": self.scene.solve.method, **choice, **spent}

    def _state(self, course):
        """The state of a course, as a copy."""
        state = self.watch.state(course)
        system = state.system if self.schedule.commands is None else state.system.snapshot(state.time)
        return State(system, state.time, state.x.copy(), state.v.copy())

    def _frame(self, number, folder, course):
        """Keep a state; in a folder, with a checkpoint."""
        state = self._state(course)
        if self.system.net.threads and not self._coincident:
            from ..net.threads import coincident_nodes

            text = coincident_nodes(self.system.net, state.x, self.system.supported)
            self._coincident = text is not None
            if text is not None:
                text += f", or expect short steps (at t = {state.time:.6g} s)"
                self.solution.findings.append(Finding("coincident-nodes", text, "thread"))
        if self.overlaps is not None and (number in self._looks or course.stopped):
            for body in self.overlaps.bodies:
                self.overlaps.note_edge(body, state, state.overlap(body))
        if folder is None:
            self.solution.frames.append((number, state))
            return
        kept = {"run": record_of(self.integrator.save(course))}
        kept |= {f"begin_{name}": array for name, array in self.begin._asdict().items() if array is not None}
        if self.begin_of_twin is not None:
            kept |= {f"twin_begin_{name}": array for name, array in zip("xv", self.begin_of_twin.motion, strict=True)}
        if self.schedule.commands is not None:
            kept["controls"] = np.array(self.schedule.commands.save())
        kept |= {"row": number} | self.standing.arrays() | ({} if self._ways is None else self._ways.arrays())
        kept |= {} if self._silent is None else {"silent": self._silent.kept()}
        kept |= {"edges": self.overlaps.kept_edges()} if self.overlaps is not None and self.overlaps.edges else {}
        kept |= {"share_rows": self.share_rows} if self._share_rows and self._share_rows[0].size else {}
        folder.frame(number, state, run=kept | ({"compared": np.array(self._compared)} if self._compared else {}))

    def remarks(self):
        """Remarks for a reader of the results."""
        if not self.solution.reduced:
            return
        if self._largest_stress is not None:
            yield from floor_remark(self.system.net, self._largest_stress)
        if self.system.weakness is None:
            yield from strength_remark(self.solution.utilisation)
        yield from strain_remark(self.system.net, self._strain)
        if self._share_of_curve is not None:
            yield from curve_remark(self.system.net, *self._share_of_curve)
        for thread, strain in self._strains_of_threads:
            yield from strain_remarks_of_thread(thread, strain)
        if self._half_turns:
            yield Finding("half-turn", self._half_turns, "thread")
        yield from self.system.remarks()
        if self.system.net.flows:
            yield from self.system.material_flow.remarks()
        if self.overlaps is not None:
            yield from self.overlaps.remarks()
        if self._through is not None:
            yield from self._through.remarks()
        if self._lines is not None:
            yield from self._lines.remarks()
        if self._silent is not None:
            yield from self._silent.remarks()
        for name in self._unfilled:
            end = self._tables[-1][-1, 0]
            text = f"{name} is the mean of the whole run: it ended at t = {end:.6g} s, before a window was full"
            yield Finding("short-window", text, "observe")
        yield from self._unseen()

    def _unseen(self):
        """Findings on thresholds that the extreme of an observable has passed between steps only."""
        names = [o.name for o in self.scene.observables]
        for event, entry in zip(self.scene.event, self.solution.events, strict=True):
            if entry["time"] is None and (result := self.solution.reduced.get(event.observe)) is not None:
                start = self._tables[0][0, 1 + names.index(event.observe)]
                if (start - event.value) * (result.value - event.value) < 0.0:
                    yield Finding(
                        "event-not-seen",
                        f'event "{event.name}" is not seen: {event.observe} passes {event.value:g} and comes back '
                        f"within a step, about t = {result.time:.6g} s: lower [output] interval",
                        "event",
                    )


def _overlaps_of(scene, system):
    """The `refweb.effects.contact.overlap.Overlaps` of a scene, None without contact."""
    if not system.contact:
        return None
    from ..effects.contact.overlap import Overlaps

    settled, pairs = scene.settled(), None
    if pairs_of(system):
        from ..effects.contact.pair_overlap import PairOverlaps

        pairs = PairOverlaps(settled.contact, settled.chosen, system)
    return Overlaps(settled, system, moving=True, pairs=pairs)


def _through_of(system):
    """The `refweb.effects.contact.penetration.BodyPassage` of a system, None without contact."""
    if not system.contact:
        return None
    from ..effects.contact.penetration import BodyPassage

    return BodyPassage(system)


def _silent_of(system):
    """The `refweb.effects.contact.undetected_overlap.Silent` of a system, None where there are no two bodies."""
    if len(system.net.bodies) < 2:
        return None
    from ..effects.contact.undetected_overlap import silent_of

    return silent_of(system)


def _check_step(scene):
    """Refuse a fixed step with too many steps in a row."""
    step, row = scene.solve.step_size, min(scene.output.interval, scene.solve.duration)
    if step is not None and row > MAX_STEPS_PER_ROW * step:
        shortest = row / MAX_STEPS_PER_ROW
        raise InputError(
            f"[solve] step_size = {step:g} must be ≥ {shortest:g} [s]: a row takes at most {MAX_STEPS_PER_ROW:g} steps"
        )
