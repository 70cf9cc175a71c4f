"""Explicit runs of a scene: what is looked at in every step, history rows, peaks and their errors."""

from __future__ import annotations

import math
import threading
import time

import numpy as np

from . import probes, starts
from .central_difference import CentralDifference, OpenBook
from .laws import SMOOTH
from .observables import LINE, NODAL, Result
from .solution import SOLVER
from .state import State, floor_remark, strength_remark

ENERGIES = ("kinetic_energy", "strain_energy", "potential_energy", "contact_energy", "work", "total_energy")
_VECTORS = ("momentum", "support_impulse")


def _weights(system, quantity):
    """Weights of (energy of each family, kinetic energy, work, step size) that make a quantity of the whole net."""
    total, energies = quantity == "total_energy", [f.book for f in system.families]
    weights = [book != "work" and (total or book == quantity) for book in energies]
    weights += [total or quantity == "kinetic_energy", quantity == "work", quantity == "step_size"]
    return np.array(weights, dtype=float)


def probe_of(observable, system):
    """An observable as a probe: (kernel, rows, data)."""
    net, quantity = system.net, observable.quantity
    if quantity == "slack_fraction":
        return probes.slack_fraction, [], net.slackness[:, None]
    if quantity in LINE:
        elements = np.arange(len(net.line)) if observable.line is None else np.flatnonzero(net.line == observable.line)
        scale = 1.0 / net.area if quantity == "stress" else np.ones(len(net.cells))
        return probes.line, [1 if quantity == "strain" else 0, elements[0], elements[-1] + 1], scale[:, None]
    component = probes.MAGNITUDE if observable.component is None else observable.component
    rows = observable.rows(system)
    consecutive = len(rows) == 1 or (np.diff(rows) == 1).all()
    numbers = [component, rows[0], rows[-1] + 1] if consecutive else [component, -1, -1, *rows]
    if quantity == "reaction":
        weight = np.where(system.supported[rows], 1.0, 0.0)
        rest = np.zeros((len(rows), 3))
        if observable.body is not None:
            weight[:] = -1.0
            still = np.zeros((system.rows, 3))
            for family in system.families:
                if family.book == "potential_energy":
                    rest += system.force_of(family, 0.0, still)[rows]
        return probes.reaction, numbers, np.hstack([weight, rest])
    kernel = probes.velocity if quantity == "velocity" else probes.displacement
    data = net.points[rows] if quantity == "position" else np.zeros((len(rows), 3))
    return kernel, numbers, data


def started(system, x=None):
    """What a reader has to know of a start at displacement x: jumps of motion, and bodies inside of the web."""
    before = np.zeros((system.rows, 3)) if x is None else x
    now, energy = before.copy(), {}
    system.drive(0.0, now)
    for family in system.families:
        if family.internal:
            energy[family.name] = system.energy_of(family, 0.0, now)
    moved = np.flatnonzero((now != before).any(axis=1))
    if len(moved):
        stored = sum(map(sum, energy.values()))
        yield f"[[motion]] has moved node {moved[0]} at t = 0 already: the web starts with {stored:.4g} J"
    pushed = energy.get("contact", np.zeros(1))
    if pushed.max() > 0.0:
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


def blocks(solver, run, times, stops):
    """Advance through ``times`` in blocks that last about a tenth of a second and end at each of ``stops``.

    Yields
    ------
    (first row, rows of the solver)
    """
    first, size = 0, 1
    while first < len(times):
        stop = stops[np.searchsorted(stops, first)]
        count = min(size, stop + 1 - first)
        began = time.perf_counter()
        yield first, solver.rows(run, times[first : first + count])
        first += count
        spent = time.perf_counter() - began
        size = max(1, min(2 * size if spent < 0.05 else int(size * 0.1 / spent), 10000))


SPREAD = 3.0
"""± of a result over its error if the method has its order."""


def with_errors(results, twin, order=2.0):
    """Results with ± from their difference to a run of half the error, times ``order`` and `SPREAD`.

    Central differences are of order 2: a run of √2 times the steps has half the error, so that the error is twice the
    difference where that order holds (``order`` is that factor for the steps really taken). Peaks, contact and slack
    lines have none; three times as much then covers most: of the 17 observables of the four impacts shipped, 16 have
    their value at 1/8 of the step within ±. The other is a peak of stress, 93.4 ± 3.04 kPa and off by 3.05 kPa; where
    both runs happen to agree on a peak, ± says too little.
    """
    errors = {n: SPREAD * order * abs(r.value - twin[n].value) + 4e-16 * abs(r.value) for n, r in results.items()}
    return {n: r._replace(error=errors[n]) for n, r in results.items()}


class _Twin:
    """A run of half the error beside the run itself, in a thread of its own: the compiled loop needs no interpreter."""

    def __init__(self, motion, safety, wanted):
        self._motion, self._safety, self._wanted = motion, safety, wanted
        self._stop = threading.Event()

    def __enter__(self):
        self._thread, self._ended, self._failure = None, None, None
        if self._wanted:
            self._thread = threading.Thread(target=self._run, daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *error):
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self):
        motion = self._motion
        try:
            solver = motion.solver(self._safety, math.sqrt(2.0))
            run = solver.start(*motion.begin)
            last = None
            for _, history in blocks(solver, run, *motion._times()):
                last = history[-1:]
                if self._stop.is_set():
                    return
            self._ended = run, motion.table(last)[0]
        except Exception as error:  # whatever it is, it belongs into the warnings of the run itself
            self._failure = error

    def results(self):
        """Wait for it; its results, its number of steps and why it failed, None where there are none."""
        if self._thread is not None:
            self._thread.join()
        if self._ended is None:
            return None, None, self._failure
        run, last = self._ended
        return self._motion.results(run, last), run.nsteps, None


class Motion:
    """Follows a dynamic scene: history rows, peaks, frames, errors.

    Parameters
    ----------
    scene : refweb.Scene
        What is observed, how often, and how it is solved.
    system : refweb.system.System
        What acts.
    solution : refweb.Solution
        What is filled in.

    Raises
    ------
    InputError
        For what central differences cannot take.
    """

    def __init__(self, scene, system, solution):
        self.scene, self.system, self.solution = scene, system, solution
        self.rows = []
        self.probed = [o for o in scene.observables if o.quantity in (*NODAL, *LINE, "slack_fraction")]
        self.watched = [o for o in scene.observables if o.quantity in (*ENERGIES, "step_size") and o.reduce != "final"]
        books = {f.book for f in system.families}
        books |= {"kinetic_energy", "total_energy"} | ({"work"} if system.drives else set())
        self.energies = [name for name in ENERGIES if name in books]
        self.columns = ["time [s]", *(f"{o.name} [{o.unit}]" for o in scene.observables)]
        self.columns += [f"{name} [J]" for name in self.energies]
        self.columns += [f"{name}_{axis} [N s]" for name in _VECTORS for axis in "xyz"]
        self._own = self._hidden()
        self._solver = self.solver(scene.solve.safety)
        self._columns = self._places()
        self.begin = None, None
        if (folder := scene.start_folder) is not None:
            self.begin = starts.stored(system, folder)
        if scene.solve.start != "equilibrium":
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

    def solver(self, safety, finer=1.0):
        """The `CentralDifference` of the scene at a share of the step bound, or a step_size, ``finer`` times finer."""
        signs, step = {"max": 1, "min": -1, "final": 0}, self.scene.solve.step_size
        return CentralDifference(
            self.system,
            probes=[(*probe_of(o, self.system), signs[o.reduce]) for o in self.probed]
            + [(probes.line, [0, 0, len(scale)], scale[:, None], 1) for scale in self._own.values()],
            watch=[(_weights(self.system, o.quantity), signs[o.reduce]) for o in self.watched],
            safety=safety,
            step_size=step,
            finer=finer,
        )

    def table(self, history):
        """Rows of the solver as rows of ``history.csv``."""
        return history @ self._columns

    def _places(self):
        """What each column of ``history.csv`` is of the solver's columns, shape (solver columns, columns)."""
        first = 1 + len(self.probed) + len(self._own)
        sums = len(self.system.families) + 3
        count = first + sums + 6
        columns = [np.eye(count)[0]]
        for o in self.scene.observables:
            column = np.zeros(count)
            if o in self.probed:
                column[1 + self.probed.index(o)] = 1.0
            else:
                column[first : first + sums] = _weights(self.system, o.quantity)
            columns.append(column)
        for name in self.energies:
            columns.append(np.zeros(count))
            columns[-1][first : first + sums] = _weights(self.system, name)
        return np.column_stack([*columns, np.eye(count)[:, -6:]])

    def results(self, run, last):
        """Results by name, without errors; ``last`` is the last row of ``history.csv``."""
        results, net = {}, self.system.net
        state = State(self.system, run.time, run.x, run.v)
        for i, o in enumerate(self.scene.observables):
            value, when, where = float(last[1 + i]), run.time, None
            if o in self.probed:
                at = self.probed.index(o)
                if o.reduce != "final":
                    value, when, where = float(run.peaks[at]), float(run.times[at]), int(run.places[at])
                elif o.quantity != "slack_fraction":
                    where = o.value(state).where
                if o.quantity in LINE and o.reduce != "final":
                    where = int(net.line[where])
                summed = o.quantity == "slack_fraction" or (o.quantity == "reaction" and o.node is None)
                if summed or o.body is not None:
                    where = None
            elif o in self.watched:
                at = len(self.probed) + len(self._own) + self.watched.index(o)
                value, when = float(run.peaks[at]), float(run.times[at])
            results[o.name] = Result(value, None, o.unit, when, where)
        return results

    def follow(self, folder, tell):
        """Run; a run whose energy book is open is repeated with half the step, twice at most."""
        scene, solution, safety = self.scene, self.solution, self.scene.solve.safety
        if scene.solve.start == "equilibrium":
            found = starts.equilibrium(self.system, lambda text: tell(f"equilibrium, {text}", 0.0))
            self.begin = found.x, None
            if found.stats.get("smallest_pivot") == -1:
                solution.warnings.append(
                    "the equilibrium it starts from is a saddle (a pivot of its tangent is negative): the motion "
                    'leaves it by itself; law = "tension-only" has no such states'
                )
            solution.warnings += started(self.system, found.x)
        for attempt in range(3):
            with _Twin(self, safety, scene.accuracy.error == "twin") as twin:
                try:
                    results = self._run(self._solver, folder, lambda share: tell("running", share))
                except OpenBook as error:
                    if attempt == 2 or scene.solve.step_size is not None:
                        raise
                    safety *= 0.5
                    solution.warnings.append(f"{error}; repeated with safety = {safety:g}")
                    self._solver, self.rows = self.solver(safety), []
                    solution.frames.clear()
                    if folder is not None:
                        folder.restart(solution.summary())
                    continue
                tell("finding errors by a twin run", 1.0)
                other, steps, failure = twin.results()
            break
        solution.reduced = results
        if other:
            ratio = solution.solver["nsteps"] / steps
            solution.reduced = with_errors(results, other, 1.0 / (1.0 - ratio**2))
        if failure:
            solution.warnings.append(f"no errors are known: the twin run failed: {failure}")

    def _run(self, solver, folder, tell):
        """One run from start to end, with rows and frames; returns its results."""
        run, times, stops = solver.start(*self.begin), *self._times()
        tell(0.0)
        try:
            for first, history in blocks(solver, run, times, stops):
                table = self.table(history)
                last = first + len(table) - 1
                if folder is None:
                    self.rows += table.tolist()
                else:
                    self.rows = [table[-1].tolist()]
                    for row in table:
                        folder.row(row)
                if last in stops:
                    self._frame(last, folder, run)
                tell((last + 1) / len(times))
        finally:
            self._note(run)
        return self.results(run, table[-1])

    def _times(self):
        """Times of the history rows, and the rows that frames are written at."""
        times = row_times(self.scene)
        return times, np.unique(np.append(np.arange(0, len(times), self.scene.output.frames), len(times) - 1))

    def _note(self, run):
        """Take the state of a run over into the solution."""
        self._peaks = dict(zip(self._own, run.peaks[len(self.probed) :], strict=False))
        if "utilisation" in self._peaks:
            at = int(run.places[len(self.probed) + list(self._own).index("utilisation")])
            self.solution.utilisation = float(self._peaks["utilisation"]), int(self.system.net.line[at])
        if np.isfinite(run.x).all():
            self.solution.state = State(self.system, run.time, run.x.copy(), run.v.copy())
        figures = dict(nsteps=run.nsteps, nfev=run.nsteps + 1, njev=0, nlu=0, energy_drift=run.drift)
        self.solution.solver = {**SOLVER, "method": self.scene.solve.method, **figures}
        self.solution.solver["slack_nodes"] = len(self.solution.state.slack_nodes) if self.solution.state else None

    def _frame(self, number, folder, run):
        state = State(self.system, run.time, run.x.copy(), run.v.copy())
        if folder is None:
            self.solution.frames.append((number, state))
        else:
            folder.frame(number, state)

    def remarks(self):
        """What a reader of the results has to know."""
        net = self.system.net
        if not self.solution.reduced:
            return
        if "stress" in self._peaks:
            yield from floor_remark(net, self._peaks["stress"])
        yield from strength_remark(self.solution.utilisation)
