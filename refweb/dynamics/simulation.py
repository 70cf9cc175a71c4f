"""Dynamic runs of a scene: what is looked at in every step, history rows, peaks and their errors."""

from __future__ import annotations

import functools
import math
import threading
import time

import numpy as np

from ..errors import InputError, OpenBook
from ..net.tension_laws import SMOOTH
from ..registry import INTEGRATORS, load
from ..results import probes
from ..results.observables.book import weights
from ..results.observables.observe import SIGN, Observe
from ..results.solution import SOLVER, Result
from ..results.state import State, floor_remark, strength_remark
from .integrators.events import Event
from .integrators.integrator import MAX_STEPS_PER_ROW, History, Sum

_VECTORS = ("momentum", "support_impulse")


def started(system, x=None):
    """What a reader has to know of a start at displacement x: jumps of motion, and bodies inside of the web."""
    before = np.zeros((system.rows, 3)) if x is None else x
    now = before.copy()
    system.drive(0.0, now)
    inner = [(family.contact, system.energy_of(family, 0.0, now)) for family in system.families if family.internal]
    moved = np.flatnonzero((now != before).any(axis=1))
    if len(moved):
        stored = sum(energy.sum() for _, energy in inner)
        yield f"[[motion]] has moved node {moved[0]} at t = 0 already: the web starts with {stored:.4g} J"
    pushed = np.concatenate([np.zeros(0), *(energy for contact, energy in inner if contact)])
    if pushed.max(initial=0.0) > 0.0:
        line = system.net.line[int(pushed.argmax()) % len(system.net.line)]
        yield f"a body overlaps the web at the start, most at line {line}: contact starts with {pushed.sum():.4g} J"


def row_times(scene):
    """Times of the history rows [s]: multiples of the interval, and the end."""
    interval, duration = scene.output.interval, scene.solve.duration
    count = int(math.floor(duration / interval * (1.0 + 1e-12)))
    times = interval * np.arange(count + 1)
    if duration - times[-1] > 1e-9 * interval:
        return np.append(times, duration)
    times[-1] = duration
    return times


def blocks(solver, run, times, stops, first=0):
    """Advance through ``times`` in blocks that last about a tenth of a second and end at each of ``stops``.

    Yields
    ------
    (first row, `refweb.dynamics.integrators.integrator.History`)

    Raises
    ------
    OpenBook
        At the end, for a run whose energy drift exceeds its limit.
    """
    size = 1
    while first < len(times):
        stop = stops[np.searchsorted(stops, first)]
        count = min(size, stop + 1 - first)
        began = time.perf_counter()
        yield first, solver.advance(run, times[first : first + count])
        first += count
        spent = time.perf_counter() - began
        size = max(1, min(2 * size if spent < 0.05 else int(size * 0.1 / spent), 10000))
        if run.stopped:
            break
    solver.refuse_drift(run)


SPREAD = 3.0
"""± of a result over its error if the method has its order."""


def with_errors(results, twin, own, other, order=2.0):
    """Results with ± from what differs in a run of a smaller error, times ``order`` and `SPREAD`.

    Two runs may agree by chance on a peak, or at the end, where the motion differs otherwise. What counts is the larger
    of the difference of the result and the mean one, root mean square, of the observable in the rows before: in half
    the time up to the result. Central differences are of order 2: a run of √2 times the steps has half the error, so
    that the error is twice the difference where that order holds (``order`` is that factor for the steps really taken).
    The error of CVODE and IDA goes with the tolerance to the power 2/3 at order 2, and faster at higher ones. Higher
    orders count as 2 here: peaks, contact and slack lines leave no more of them, for which the threefold is taken as
    well. How often ± contains the truth is counted by ``python -m validation coverage``.

    Parameters
    ----------
    results, twin : dict of str to refweb.results.solution.Result
        Of either run.
    own, other : ndarray, shape (rows, columns)
        Rows of either history: time, then the observables in their order. Those of equal times are compared: the last
        ones differ where an event ends either run.
    order : float
        The error over the difference.
    """
    rows, found = min(len(own), len(other)), {}
    same = own[:rows, 0] == other[:rows, 0]
    own, apart = own[:rows][same], np.abs(own[:rows] - other[:rows])[same]
    for i, (name, result) in enumerate(results.items(), 1):
        near = (own[:, 0] >= 0.5 * result.time) & (own[:, 0] <= result.time)
        mean = np.sqrt(np.mean(apart[near, i] ** 2)) if near.any() else 0.0
        error = SPREAD * order * max(abs(result.value - twin[name].value), mean) + 4e-16 * abs(result.value)
        found[name] = result._replace(error=float(error))
    return found


CLIMBS = 8
"""Number of times that accuracy is raised for digits that are missing."""
STAYS = "a higher accuracy changes it as much: it is zero, or not determined, or a peak that needs a shorter interval"
STUCK = 1.5
"""Factor by which an error has to fall where half the step, or a tenth of rtol, is meant to quarter it."""


def missing_digits(results, digits):
    """±, over what so many significant digits allow, of each result that has not got them."""
    allowed = {name: 0.5 * 10.0**-digits * abs(result.value) for name, result in results.items()}
    shares = {n: np.inf if r.error is None else r.error / max(allowed[n], 5e-324) for n, r in results.items()}
    return {name: share for name, share in shares.items() if share > 1.0}


class _Twin:
    """A run of a smaller error: beside an explicit run, whose compiled loop needs no interpreter, in a thread of its
    own; after an implicit one."""

    def __init__(self, motion, wanted):
        self._motion, self._wanted = motion, wanted
        self._beside = wanted and motion._solver.beside
        self._stop = threading.Event()

    def __enter__(self):
        self._thread, self._ended, self._failure = None, None, None
        if self._beside:  # the solver is made here: a system is used by one thread at a time
            solver = self._motion._solver.refined()
            solver.breathe = self._breathe
            self._thread = threading.Thread(target=self._run, args=(solver,), daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *error):
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def _breathe(self, t):
        if self._stop.is_set():
            raise InterruptedError(f"the twin run was ended at t = {t:g} s")

    def _run(self, solver=None):
        motion = self._motion
        try:
            solver = solver or motion._solver.refined()
            run = solver.start(*motion.begin)
            rows = []
            for _, history in blocks(solver, run, *motion._times()):
                rows.append(motion.table(history)[:, : 1 + len(motion.scene.observables)])
                if self._stop.is_set():
                    return
            self._ended = run, np.concatenate(rows)
        except Exception as error:  # whatever it is, it belongs into the warnings of the run itself
            self._failure = error

    def results(self):
        """Wait for it; its results, its end, its rows and why it failed, None where there are none."""
        if self._thread is not None:
            self._thread.join()
        elif self._wanted:
            self._run()
        if self._ended is None:
            return None, None, None, self._failure
        run, rows = self._ended
        return self._motion.results(run, rows[-1]), run, rows, None


class Motion:
    """Follows a dynamic scene: history rows, peaks, frames, errors.

    Parameters
    ----------
    scene : refweb.Scene
        What is observed, how often, and how it is solved.
    system : refweb.system.system.System
        What acts.
    solution : refweb.Solution
        What is filled in.
    kept : dict of str to ndarray, optional
        Checkpoint of a run that goes on.

    Raises
    ------
    InputError
        For what central differences cannot take.
    """

    def __init__(self, scene, system, solution, kept=None):
        self._choice = {}
        if scene.solve.method == "auto":
            from .method_choice import decided

            solve, self._choice["choice"] = decided(scene, system)
            scene = scene.replace(solve=solve)
        self.scene, self.system, self.solution = scene, system, solution
        self.rows = []
        self.probed = [o for o in scene.observables if not o.observable.booked]
        awaited = {event.observe for event in scene.event}
        sums = [o for o in scene.observables if o.observable.booked]
        self.watched = [o for o in sums if o.reduce != "final" or o.name in awaited]
        own = dict.fromkeys(f.book for f in system.families if f.book != "work")
        work = ["work"] if "work" in [f.book for f in system.families] or system.drives or system.line_drives else []
        self.energies = ["kinetic_energy", *own, *work, "total_energy"]
        self.columns = ["time [s]", *(f"{o.name} [{o.unit}]" for o in scene.observables)]
        self.columns += [f"{name} [J]" for name in self.energies]
        self.columns += [f"{name}_{axis} [N s]" for name in _VECTORS for axis in "xyz"]
        self._method = INTEGRATORS[scene.solve.method]
        step, row = scene.solve.step_size, min(scene.output.interval, scene.solve.duration)
        if step is not None and row > MAX_STEPS_PER_ROW * step:
            raise InputError(
                f"[solve] step_size = {step:g} must be ≥ {row / MAX_STEPS_PER_ROW:g} [s]: a row takes at most "
                f"{MAX_STEPS_PER_ROW:g} steps"
            )
        self._own = self._hidden()
        self._events = [self._event(event) for event in scene.event]
        self._accuracy = getattr(scene.solve, self._method.knob)
        self._first, self._repeated, self._missing, self._kept = self._accuracy, 0, {}, kept
        if kept is not None:
            self._accuracy, self._repeated = float(kept["accuracy"]), int(kept["repeated"])
            self._missing = dict(zip(kept["missing"].tolist(), kept["shares"].tolist(), strict=True))
        self._solver = self.solver(self._accuracy)
        self._columns = self._places()
        self.begin = None, None
        if kept is not None:
            self.begin = kept.get("begin_x"), kept.get("begin_v")
        elif (folder := scene.start_folder) is not None:
            from .initial_state import stored

            self.begin = stored(system, folder)
        if scene.solve.start != "equilibrium" and kept is None:
            solution.warnings += started(system, self.begin[0])

    @property
    def done(self):
        """How far it came."""
        return f"t = {self.rows[-1][0] if self.rows else 0.0:.6g} s"

    def _hidden(self):
        """Probes of refweb's own, behind the user's: largest stress and utilisation where a warning may need them."""
        net, own = self.system.net, {}
        if net.law.number == SMOOTH:
            own["stress"] = 1.0 / net.area
        if np.isfinite(net.strength).any():
            own["utilisation"] = 1.0 / (net.area * net.strength)
        return own

    def _event(self, event):
        """An event, its slot yet to be given, and its own probe, None where it is an observable's."""
        system = self.system
        if event.kind == "contact":
            from ..results.observables.reaction import push_on

            rows = [body.row for body in system.net.bodies if event.body in (None, body.name)]
            probe = push_on(system, rows)
            return Event(-1, 0.0, rising=True, stop=event.stop, at_once=True), probe
        if event.kind == "taut":
            probe = Observe(name="_", quantity="strain", line=event.line).probe(system)
            return Event(-1, float(system.net.slackness[probe.rows[1]]), rising=True, stop=event.stop), probe
        return Event(-1, event.value, stop=event.stop), None

    def solver(self, accuracy):
        """The integrator of the scene at a safety, or rtol."""
        solve, probed = self.scene.solve, [o.probe(self.system) for o in self.probed]
        probed += [probes.Probe(probes.line, [0, 0, len(scale)], scale[:, None], 1) for scale in self._own.values()]
        slots = {o.name: i for i, o in enumerate(self.probed)}
        for event, (_, probe) in zip(self.scene.event, self._events, strict=True):
            if probe is not None:
                slots[event] = len(probed)
                probed.append(probe)
        slots |= {o.name: len(probed) + i for i, o in enumerate(self.watched)}
        events = [
            found._replace(slot=slots[event if probe is not None else event.observe])
            for event, (found, probe) in zip(self.scene.event, self._events, strict=True)
        ]
        sums = [Sum(o.observable.weights(self.system), SIGN[o.reduce]) for o in self.watched]
        keys = {key: getattr(solve, key) for key in self._method.keys if getattr(solve, key) is not None}
        keys[self._method.knob] = accuracy
        return load(self._method.integrator)(self.system, probed, sums, events, **keys)

    def table(self, history):
        """Rows of the solver as rows of ``history.csv``."""
        return history.values @ self._columns

    def _places(self):
        """What each column of ``history.csv`` is of the solver's columns, shape (solver columns, columns)."""
        probed = len(self.probed) + len(self._own) + sum(probe is not None for _, probe in self._events)
        unit = History.empty(0, probed, self.system.families)
        unit = History(unit.names, np.eye(len(unit.names)), probed)
        columns = [unit.time]
        for o in self.scene.observables:
            if o in self.probed:
                columns.append(unit.probes[:, self.probed.index(o)])
            else:
                columns.append(unit.sums @ o.observable.weights(self.system))
        columns += [unit.sums @ weights(self.system, name) for name in self.energies]
        return np.column_stack([*columns, unit.momentum, unit.impulse])

    def results(self, run, last):
        """Results by name, without errors; ``last`` is the last row of ``history.csv``."""
        results, extremes = {}, run.extremes
        state = State(self.system, run.time, run.x, run.v)

        def extreme(at):
            return float(extremes.values[at]), float(extremes.times[at]), int(extremes.places[at])

        for i, o in enumerate(self.scene.observables):
            value, when, where = float(last[1 + i]), run.time, None
            if o in self.probed:
                at = self.probed.index(o)
                if o.reduce != "final":
                    value, when, where = extreme(at)
                    where = o.observable.place(self.system, where)
                else:
                    where = o.value(state).where
            elif o in self.watched and o.reduce != "final":
                value, when, _ = extreme(len(extremes.values) - len(self.watched) + self.watched.index(o))
            results[o.name] = Result(value, None, o.unit, when, where)
        return results

    def follow(self, folder, tell):
        """Run, and run again at a higher accuracy as long as digits are asked for that are missing."""
        scene, solution, accuracy = self.scene, self.solution, self._accuracy
        if scene.solve.start == "equilibrium" and self._kept is None:
            from .initial_state import equilibrium

            found = equilibrium(self.system, lambda text: tell(f"equilibrium, {text}", 0.0))
            self.begin = found.x, None
            if found.stats.get("smallest_pivot") == -1:
                solution.warnings.append(
                    "the equilibrium it starts from is a saddle (a pivot of its tangent is negative): the motion "
                    'leaves it by itself; without a [frame] law = "tension-only" has no such states'
                )
            solution.warnings += started(self.system, found.x)
        accuracy = self._closed(accuracy, folder, tell)
        if scene.accuracy.digits is None:
            return
        before = self._missing
        for _ in range(CLIMBS):
            missing = missing_digits(solution.reduced, scene.accuracy.digits)
            falling = [share for name, share in missing.items() if before.get(name, np.inf) > STUCK * share]
            if not falling:
                break
            before, steps = missing, solution.solver["nsteps"]
            self._missing = before
            accuracy *= self._solver.next_knob(max(falling))
            self._again(accuracy, folder)
            accuracy = self._closed(accuracy, folder, tell)
            if solution.solver["nsteps"] < 1.1 * steps:  # something else limits them: nothing was changed
                before = self._missing = {}
        for name, share in missing_digits(solution.reduced, scene.accuracy.digits).items():
            falls = before.get(name, np.inf) > STUCK * share
            why = "it would take more still" if falls else STAYS
            known = f"its ± is {share:.3g} times what they allow with {self._method.knob} = {accuracy:g}; {why}"
            known = known if np.isfinite(share) else "its ± is not known"
            solution.warnings.append(f"{name} has not the {scene.accuracy.digits} digits asked for: {known}")

    def _again(self, accuracy, folder):
        """Forget what was computed, for a run of another accuracy."""
        self._accuracy, self._solver, self.rows = accuracy, self.solver(accuracy), []
        self.solution.frames.clear()
        if folder is not None:
            folder.restart(self.solution.summary())

    def _closed(self, accuracy, folder, tell):
        """Run with errors; one whose energy book is open again with half the step, or a tenth of rtol, twice at most.

        Returns the accuracy of the run.
        """
        scene, solution = self.scene, self.solution
        for attempt in range(self._repeated, 3):
            self._repeated = attempt
            text = "running" if accuracy == self._first else f"running with {self._method.knob} = {accuracy:g}"
            with _Twin(self, scene.accuracy.error == "twin") as twin:
                try:
                    results, run = self._run(self._solver, folder, functools.partial(tell, text))
                except OpenBook as error:
                    if attempt == 2 or scene.solve.step_size is not None:
                        raise
                    accuracy *= self._solver.retry
                    solution.warnings.append(f"{error}; repeated with {self._method.knob} = {accuracy:g}")
                    self._again(accuracy, folder)
                    continue
                tell("finding errors by a twin run", 1.0)
                other, ended, rows, failure = twin.results()
            break
        solution.reduced, self._repeated = results, 0
        if other and run.stopped != ended.stopped:
            which = "the run" if run.stopped else "its twin of a smaller error"
            solution.warnings.append(f"no errors are known: an event ends {which} and not the other of the two")
        elif other:
            factor = 1.0 / (1.0 - self._solver.error_share(run, ended))
            own = np.array(self.rows) if folder is None else folder.rows()
            solution.reduced = with_errors(results, other, own[:, : rows.shape[1]], rows, factor)
            for found, width, time in zip(solution.events, run.events["width"], ended.events["time"], strict=True):
                if found["time"] is not None and np.isfinite(time):
                    off = abs(found["time"] - float(time))
                    found["error"] = SPREAD * factor * off + float(width) + 4e-16 * found["time"]
            if run.stopped and len(own) > 1:
                self._add_lateness(own[-2:])
        if failure:
            solution.warnings.append(f"no errors are known: the twin run failed: {failure}")
        return accuracy

    def _add_lateness(self, own):
        """Add to ± of results at the end what they change in that of the time of the event there; from two rows."""
        solution, end = self.solution, own[1, 0]
        late = max((event["error"] or 0.0 for event in solution.events if event["time"] == end), default=0.0)
        change = late * np.abs(own[1] - own[0]) / (end - own[0, 0])
        for i, (name, result) in enumerate(solution.reduced.items(), 1):
            if result.time == end:
                solution.reduced[name] = result._replace(error=result.error + float(change[i]))

    def _run(self, solver, folder, tell):
        """One run from start to end, with rows and frames; returns its results and its end."""
        times, stops = self._times()
        run, ahead = self._set_off(solver, folder, times, stops)
        tell(ahead / len(times))
        solver.breathe = lambda t: tell(t / times[-1])
        try:
            for first, history in blocks(solver, run, times, stops, ahead):
                table = self.table(history)
                last = first + len(table) - 1
                if folder is None:
                    self.rows += table.tolist()
                else:
                    self.rows = [table[-1].tolist()]
                    for row in table:
                        folder.row(row)
                if last in stops or run.stopped:
                    self._frame(last, folder, run)
                tell((last + 1) / len(times))
        finally:
            self._note(run)
        return self.results(run, self.rows[-1]), run

    def _set_off(self, solver, folder, times, stops):
        """The run at its start, or where its checkpoint has it, and the number of the row ahead."""
        if self._kept is None:
            return solver.start(*self.begin), 0
        own = {key.removeprefix("run_"): array for key, array in self._kept.items() if key.startswith("run_")}
        run, row = solver.load(own), int(self._kept["row"])
        self._kept, self.rows = None, [folder.last_row()]
        folder.listed([*((n, times[n]) for n in stops[stops < row]), (row, run.time)], self.system.net.bodies)
        return run, len(times) if run.stopped else row + 1

    def _times(self):
        """Times of the history rows, and the rows that frames are written at."""
        times = row_times(self.scene)
        return times, np.unique(np.append(np.arange(0, len(times), self.scene.output.frames), len(times) - 1))

    def _note(self, run):
        """Take the state of a run over into the solution."""
        self._peaks = dict(zip(self._own, run.extremes.values[len(self.probed) :], strict=False))
        if "utilisation" in self._peaks:
            at = int(run.extremes.places[len(self.probed) + list(self._own).index("utilisation")])
            self.solution.utilisation = float(self._peaks["utilisation"]), int(self.system.net.line[at])
        if np.isfinite(run.x).all():
            self.solution.state = State(self.system, run.time, run.x.copy(), run.v.copy())
        self.solution.events = [
            {"name": event.name, "time": float(time) if np.isfinite(time) else None, "error": None}
            for event, time in zip(self.scene.event, run.events["time"], strict=True)
        ]
        figures = dict(nsteps=run.nsteps, energy_drift=run.drift, **self._solver.spent(run))
        self.solution.solver = {**SOLVER, "method": self.scene.solve.method, **self._choice, **figures}
        self.solution.solver["slack_nodes"] = len(self.solution.state.slack_nodes) if self.solution.state else None

    def _frame(self, number, folder, run):
        state = State(self.system, run.time, run.x.copy(), run.v.copy())
        if folder is None:
            self.solution.frames.append((number, state))
            return
        kept = {f"run_{name}": array for name, array in self._solver.save(run).items()}
        kept |= {f"begin_{name}": array for name, array in zip("xv", self.begin, strict=True) if array is not None}
        kept |= {"row": number, "accuracy": self._accuracy, "repeated": self._repeated}
        kept |= {"missing": np.array(list(self._missing), dtype=str), "shares": np.array(list(self._missing.values()))}
        folder.frame(number, state, run=kept)

    def remarks(self):
        """What a reader of the results has to know."""
        net = self.system.net
        if not self.solution.reduced:
            return
        if "stress" in self._peaks:
            yield from floor_remark(net, self._peaks["stress"])
        yield from strength_remark(self.solution.utilisation)
