"""± of dynamic results from a step-refinement run, or twin: a second run with other steps.

The error of results and of the times of events is the difference of both runs, times a factor by the order of the
method, times `SPREAD`. The second run takes place beside the first or after it. It has fewer steps where that says the
error (`coarser_by` of the integrator), and more where it does not, or where fewer steps fail: in a chaotic motion the
energy drift of a run may be near its limit, and beyond it in a finer run.

May change: `PAUSE`, private functions that do not change a factor. Must stay: fields of `TwinRun`; rows are those of
`Watch.compared`; the name `THREADS`, which `sweeps.case` sets. A changed factor, or another constant than `PAUSE`,
changes ± of all dynamic results: `accuracy_loop._throw` repeats that of `add_errors`, `SPREAD`/(1 − `error_share`), and
``python -m validation coverage`` counts how often ± holds. Must stay as well: `Twin` with its public names, which
`accuracy_loop` imports; `largest_mean`, which `gradients` and `studies.further_runs` import; `_add_lateness`, which a
test calls. Tests: ``tests/dynamics/test_agreement_by_chance.py``, ``test_one_row.py``.
"""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np

from ..errors import SolverError
from ..findings import Finding
from ..results.solution import Result
from .budget import check_budget
from .divergence import divergence
from .history import SPREAD
from .integrators.integrator import IntegratorState
from .schedule import blocks, spans_of, time_of

THREADS = True
"""True if twins may have a thread of their own: not in processes that share a machine as it is."""
AGAIN = 2.0
"""Factor on the steps of an explicit run after one of √2 times the steps that has failed."""
PAUSE = 0.2
"""Time between two looks at a twin that is waited for [s]."""

MOST_CHANCE, TELLING = 10.0, 0.3
"""Largest factor on differences that are small by chance; least error of energy in a part of the time, over that of the
largest part, at which this part counts for the factor."""
SAME_SIDE = 1e-9
"""Size of what decides a sign, over the largest one, below which rounding may decide."""
ROUNDING = 1e-12
"""Error of energy that rounding may leave, over the largest energy of a run."""


class TwinRun(NamedTuple):
    """Outcome of a step-refinement run.

    Attributes
    ----------
    results : dict of str to refweb.results.solution.Result
        Results by name, without errors.
    course : refweb.dynamics.integrators.integrator.IntegratorState
        State at the end.
    rows : ndarray, shape (rows, columns)
        See `refweb.dynamics.history.Watch.compared`.
    shares : dict of str to refweb.results.solution.Result
        See `refweb.dynamics.history.Watch.shares`.
    share_rows : ndarray, shape (rows, shares)
        See `refweb.dynamics.history.Watch.shares_of`.
    controllers : list of refweb.dynamics.controllers.Controller
        Controls at the end.
    """

    results: dict[str, Result]
    course: IntegratorState
    rows: np.ndarray
    shares: dict[str, Result]
    share_rows: np.ndarray
    controllers: list[Any]


class Twin:
    """A run with another error than that of the integrator of a simulation.

    Within a ``with`` block it runs in a separate thread if the integrator's loop needs no interpreter, and it ends with
    the block at the latest. Else it runs when its outcome is requested.

    Parameters
    ----------
    simulation : refweb.dynamics.simulation.Simulation
        Simulation of the first run.

    Attributes
    ----------
    failure : Exception, optional
        Error that ended the run.
    """

    def __init__(self, simulation):
        self._simulation, self._stop = simulation, threading.Event()
        self._thread = self._course = self._last = self._rows = self._share_rows = self.failure = None
        self._time, self._tell = 0.0, lambda text, share: None
        rule, self._by, self._left = getattr(simulation.integrator, "coarser_by", None), None, []
        if rule is not None:
            self._by = rule(spans_of(simulation.scene, simulation.system))
            self._left = [AGAIN] if self._by is None else [None, AGAIN]

    def __enter__(self):
        integrator = self._simulation.integrator
        alone = self._simulation.schedule.commands is None  # two runs with commands would write to the same arrays
        if integrator.beside and THREADS and alone:
            twin = integrator.refined(self._by)  # made here, so that one thread finds what the system finds once
            self._thread = threading.Thread(target=self._run, args=(lambda: twin,), daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *error):
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def _on_progress(self, t):
        if self._stop.is_set():
            raise InterruptedError(f"the step-refinement run was ended at t = {t:g} s")
        self._time = t
        if self._thread is None:
            self._report()
        check_budget(self._simulation, t / self._simulation.schedule.times[-1], twin=True)

    def _report(self):
        """Tell how far it is."""
        end = float(self._simulation.schedule.times[-1])
        self._tell(f"step refinement, {time_of(self._time, end)}", self._time / end)

    def _run(self, made):
        simulation, rows, share_rows = self._simulation, [], []
        try:
            simulation.schedule.reset()
            integrator = made()
            integrator.on_progress = self._on_progress
            begin = simulation.begin if simulation.begin_of_twin is None else simulation.begin_of_twin
            course = integrator.start(*begin.motion)
            for block in blocks(integrator, course, simulation.schedule):
                table = simulation.watch.table(block.compared)
                rows.append(simulation.watch.compared(table))
                share_rows.append(simulation.watch.shares_of(block.compared))
                if self._stop.is_set():
                    return
            self._share_rows = np.concatenate(share_rows)
            self._course, self._last, self._rows = course, table[-1], np.concatenate(rows)
        except Exception as error:  # whatever it is, it belongs into the warnings of the run itself
            self.failure = error

    def _shows_nothing(self, stopped):
        """Tell if the run has failed, or if it has fewer steps and ends otherwise than the first run by an event."""
        if self.failure is not None:
            return isinstance(self.failure, SolverError)
        fewer = self._by is not None and self._by < 1.0
        return fewer and self._course is not None and self._course.stopped != stopped

    def ended(self, tell, stopped):
        """Wait for the `TwinRun`; an explicit one that shows nothing is replaced by a finer one.

        Parameters
        ----------
        tell : callable
            Called with the progress.
        stopped : bool
            True if an event has ended the first run.

        Returns
        -------
        TwinRun or None
            None if the run has failed.
        """
        self._tell = tell
        self._report()
        if self._thread is not None:
            while self._thread.is_alive():
                self._thread.join(PAUSE)
                self._report()
        else:
            self._run(lambda: self._simulation.integrator.refined(self._by))
        while self._left and self._shows_nothing(stopped):
            self._by, self._thread, self._course, self.failure = self._left.pop(0), None, None, None
            self._run(lambda: self._simulation.integrator.refined(self._by))
        if self._course is None or self._rows is None or self._share_rows is None:
            return None
        watch, course = self._simulation.watch, self._course
        results, shares = watch.results(course, self._last), watch.shares(course)
        commands = self._simulation.schedule.commands
        controllers = [] if commands is None else commands.controllers
        return TwinRun(results, course, self._rows, shares, self._share_rows, controllers)


def _parts(times, end):
    """Masks of the times in each part of the time to ``end``: from ½ to 1, from ¼ to ½, from ⅛ to ¼, from 0 to ⅛."""
    starts = (0.5, 0.25, 0.125, 0.0)
    for start, until in zip(starts, (1.0, *starts[:-1]), strict=False):
        near = (times >= start * end) & (times <= until * end)
        if near.any():
            yield near


def _mean(values):
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def largest_mean(times, apart, end):
    """Largest root mean square of differences over the parts of the time to ``end``."""
    return max((_mean(apart[near]) for near in _parts(times, end)), default=0.0)


def _of_chance(times, off, apart, end, order, floor):
    """Factor by which differences are too small, from 1 to `MOST_CHANCE`, by the known error of energy.

    Parameters
    ----------
    times : ndarray
        Times of rows [s].
    off, apart : ndarray
        Error of the energy balance at these times [J], and difference of both runs in it.
    end, order : float
        Time of the result [s], and the error over the difference.
    floor : float
        Error of the balance by rounding [J].
    """
    means = [(_mean(off[near]), _mean(apart[near])) for near in _parts(times, end)]
    floor = max(floor, TELLING * max((mean for mean, _ in means), default=0.0))
    factors = [max(mean / max(order * between, 1e-300), 1.0) for mean, between in means if mean > floor]
    return min(max(factors, default=1.0), MOST_CHANCE)


def with_errors(results, floors, twin, kept_rows, rows_refined, order=2.0, drifts=None, energy=0.0, snaps=None):
    """Results with ±: the difference from a run with other steps, times ``order`` and `SPREAD`.

    Two runs may agree by chance on a peak, or at the end, although the motions differ. Therefore ± uses the larger of
    the difference of the result and the largest mean difference of the observable before it. Means are root mean
    squares over the second half of the time up to the result, over the second half of the time before that, and so on.
    Central differences are of order 2: a run with √2 times the steps has half the error, so that the error is twice the
    difference (``order`` is this factor for the actual steps). The error of CVODE and IDA is proportional to the
    tolerance to the power 2/3 at order 2, and falls faster at higher orders. Higher orders count as 2, since peaks,
    contact and slack lines reduce them; `SPREAD` covers this as well. Extremes between steps and absolute tolerances
    have lower limits of ±, ``floors``.

    A kink of the force, at a first contact or when a line snaps taut, causes an error that depends on its position
    within a step. This error may be similar in two runs by chance, and then all later rows agree too well. The energy
    balance has the same error, and its error is known, since it must be constant. If it is larger than ``order`` times
    the difference of both balances, in one of the parts of the time before, ± of all results is increased by this
    factor. The position of a body after a first contact may agree by chance although velocities differ. Its error is at
    least the difference of velocities times half of the last row interval (``drifts``).

    The damping force of a line jumps where it snaps taut. The balance closes there wherever in a step that is, so that
    it does not tell the error. Therefore the energy that jumps leave in doubt (``snaps``) is compared with the
    difference of the energies of both runs, in the same way. Of 720 results of a mass on a damped line 21 are off by
    more than ±, up to 2.2 times, without this, and with it the worst by 0.46 times ±; of 300 results of damped webs 2,
    up to 1.4 times, and the worst by 0.64 times ±, while the median of ± over the error grows from 9 to 18. Losses of
    contact begin with the overlap, from zero, and need no such limit.

    Of 7452 results of 207 random impacts, 7 have an error above three times ± by the difference alone, and none with
    the factor of energy, ``drifts`` and ``floors``. Of 1992 results of explicit steps of 83 more impacts the numbers
    are 5 and 1: the speed of a web with its first contact in the last row, 3.4 times ±. ``python -m validation
    coverage`` counts how often ± contains the true value. Alternatives are worse. The mean error of energy over all the
    time to the result hides a first contact that agrees (3.05 times ±). The largest ratio of all times from the start
    has more misses and a wider ±. With a third run of 1.75 times the steps no error is above 1.4 times ±, but it costs
    1.7 times as much. With 1.2 times the steps it costs 1.5 times, and the median of ± over the error rises to 12. A
    bound by the jump of the rate of the force needs the speed of each contact, which a compiled loop would have to
    record in every step.

    Parameters
    ----------
    results, twin : dict of str to refweb.results.solution.Result
        Results of both runs.
    floors : dict of str to float
        Lower limits of ±.
    kept_rows, rows_refined : ndarray, shape (rows, columns)
        Rows of both histories, see `refweb.dynamics.history.Watch.compared`. Rows of equal times are compared; the last
        times differ if an event ends a run.
    order : float
        Error over the difference.
    drifts : dict of str to float, optional
        Least difference of positions at the end, see `refweb.dynamics.history.Watch.drifts`.
    energy : float
        Largest energy of the run [J].
    snaps : ndarray, shape (2, rows), optional
        Energy that jumps of forces within steps leave in doubt so far, at the rows of the run, and difference of the
        energies of both runs [J].
    """
    rows, results_found, chances, drifts = min(len(kept_rows), len(rows_refined)), {}, {}, drifts or {}
    same, last = kept_rows[:rows, 0] == rows_refined[:rows, 0], kept_rows[-1, 0]
    kept_rows, apart = kept_rows[:rows][same], np.abs(kept_rows[:rows] - rows_refined[:rows])[same]
    times, off = kept_rows[:, 0], kept_rows[:, -1] - kept_rows[0, -1]
    known = [(off, apart[:, -1])] if snaps is None else [(off, apart[:, -1]), snaps[:, :rows][:, same]]
    for i, (name, result) in enumerate(results.items(), 1):
        end = result.time
        if end not in chances:
            chances[end] = max(_of_chance(times, doubt, gap, end, order, ROUNDING * energy) for doubt, gap in known)
        apart_then = max(abs(result.value - twin[name].value), largest_mean(times, apart[:, i], end))
        apart_then = max(apart_then, drifts.get(name, 0.0) if end == last else 0.0)
        error = max(SPREAD * order * chances[end] * apart_then + 4e-16 * abs(result.value), floors.get(name, 0.0))
        results_found[name] = result._replace(error=float(error))
    return results_found


def add_errors(simulation, run, twin, rows):
    """Add ± to the results of a simulation, to stress over its limits, and to the times of its events.

    Parameters
    ----------
    simulation : refweb.dynamics.simulation.Simulation
        Simulation at its end.
    run : refweb.dynamics.simulation.RunResult
        Outcome of the run.
    twin : TwinRun
        Outcome of its step refinement.
    rows : ndarray, shape (rows, columns)
        Rows of its history, see `refweb.dynamics.history.Watch.compared`.

    Returns
    -------
    float
        Time after which the step refinement shows no error of the run [s].
    """
    solution = simulation.solution
    first_run, refined = run.course, twin.course
    if first_run.stopped != refined.stopped:
        which = ["the run", "its step refinement, a second run with other steps"][:: 1 if first_run.stopped else -1]
        text = "no errors are known: an event ends {}, but not {}".format(*which)
        solution.findings.append(Finding("no-error", text, "event"))
        return 0.0
    factor = 1.0 / (1.0 - simulation.integrator.error_share(first_run, refined))
    drifts = simulation.watch.drifts(first_run, refined, np.diff(rows[-2:, 0]).sum())
    compared = run.results, run.corrections, twin.results, rows, twin.rows
    solution.divergence = divergence(rows, twin.rows)
    snaps = _snaps(simulation.share_rows, twin.share_rows, len(run.shares), len(rows))
    solution.reduced = with_errors(*compared, factor, drifts, first_run.largest, snaps)
    widths, count = zip(first_run.events["width"], refined.events["time"], strict=True), len(solution.events)
    for entry, (width, time) in zip(solution.events, list(widths)[:count], strict=True):
        if entry["time"] is not None and np.isfinite(time):
            off = abs(entry["time"] - float(time))
            entry["error"] = SPREAD * factor * off + float(width) + 4e-16 * entry["time"]
    if first_run.stopped and len(rows) > 1:
        _add_lateness(solution.reduced, solution.events, rows[-2:])
    if solution.controls:
        _add_errors_of_controls(simulation, twin, SPREAD * factor)
    known = np.inf
    if solution.breaks is not None:
        from .break_errors import add_errors_of_breaks

        known = add_errors_of_breaks(solution, first_run.breaks, refined.breaks, SPREAD * factor)
    if run.shares and len(simulation.share_rows) == len(rows):
        _add_errors_of_shares(simulation, run, twin, rows, factor, known, snaps)
    return known


def _snaps(share_rows, refined, shares, rows):
    """``snaps`` of `with_errors`, None where no damped line may snap taut, or not all rows are known."""
    if share_rows.shape[1] == shares or len(share_rows) < rows:
        return None
    same = min(rows, len(refined))
    return np.array([share_rows[:same, -1], np.abs(share_rows[:same, -2] - refined[:same, -2])])


def _add_errors_of_controls(simulation, twin, factor):
    """Add ± to what controls have spent; find switches of a control that errors may have changed."""
    solution = simulation.solution
    late = max((event["error"] or 0.0 for event in solution.events if event["time"] is not None), default=0.0)
    for entry, controller, surfaces in zip(solution.controls, twin.controllers, simulation.surfaces, strict=True):
        if entry["spent"] is not None:
            apart = abs(entry["spent"] - controller.spent(twin.course.time))
            entry["error"] = factor * apart + entry["largest"] * late + 4e-16 * entry["spent"]
        count = min(len(surfaces), len(controller.surfaces))
        if count:
            first, second = np.array(surfaces[:count]), np.array(controller.surfaces[:count])
            near = first <= factor * np.maximum.accumulate(np.abs(first - second)) + SAME_SIDE * first.max()
            if near.any():
                text = (
                    f"[[control]] {entry['name']}: {near.sum()} of {count} times what decides its sign is within ±, so "
                    "that another error switches otherwise: results behind the first of these are those of one motion "
                    "of several"
                )
                solution.findings.append(Finding("switch-in-doubt", text, "control"))


def _add_errors_of_shares(simulation, run, twin, rows, factor, known, snaps):
    """Add ± to the utilisation and the margin of safety of a solution, if these are before a ``known`` time."""
    solution, largest = simulation.solution, run.course.largest
    tables = (rows, simulation.share_rows), (twin.rows, twin.share_rows)
    count = len(run.shares)
    kept, refined = (np.column_stack([table[:, 0], shares[:, :count], table[:, -1]]) for table, shares in tables)
    compared = run.shares, run.share_corrections, twin.shares, kept, refined
    results = with_errors(*compared, factor, energy=largest, snaps=snaps)
    if run.course.stopped and len(rows) > 1:
        _add_lateness(results, solution.events, kept[-2:])
    errors = {name: share.error if share.time < known else None for name, share in results.items()}
    solution.utilisation = solution.utilisation._replace(error=errors["utilisation"])
    margin, error = solution.margin, errors["utilisation"]
    if "margin" in errors:
        error = errors["margin"]
    elif error is not None and margin["allowed"]:  # the same stress, over another limit
        error *= margin["strength"] / margin["allowed"]
    solution.margin = {**margin, "error": error}


def _add_lateness(results, events, rows):
    """Add to ± of results at the end their change within ± of the time of the event that ended the run.

    ``rows`` are the last two rows, with time and the results in their order.
    """
    before, last = rows
    late = max((event["error"] or 0.0 for event in events if event["time"] == last[0]), default=0.0)
    change = late * np.abs(last - before) / (last[0] - before[0])
    for i, (name, result) in enumerate(results.items(), 1):
        if result.time == last[0]:
            results[name] = result._replace(error=result.error + float(change[i]))
