"""± of dynamic results from a twin: a second run of a smaller error, beside the first or after it.

What differs between the two, times what the order of the method makes of that and `SPREAD`, is the error of results and
of the times of events.
"""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np

from ..results.solution import Result
from .history import SPREAD
from .integrators.integrator import Course
from .schedule import blocks

THREADS = True
"""Whether twins may have a thread of their own: not in processes that share a machine as it is."""


def steps_with_twin(scene):
    """Steps of a scene's run and its twin over those of the run: of order 2, half the error is √2 times the steps."""
    return 1.0 + np.sqrt(2.0) if scene.accuracy.error == "twin" else 1.0


class TwinRun(NamedTuple):
    """What came of a twin.

    Attributes
    ----------
    results : dict of str to refweb.results.solution.Result
        By name, without errors.
    course : refweb.dynamics.integrators.integrator.Course
        Its end.
    rows : ndarray, shape (rows, columns)
        Time, then the observables in their order.
    """

    results: dict[str, Result]
    course: Course
    rows: np.ndarray


class Twin:
    """A run of a smaller error than that of the integrator of a simulation.

    Within a ``with`` block it goes on in a thread of its own, where the integrator's loop needs no interpreter, and
    ends with the block at the latest; else it runs when it is asked for.

    Parameters
    ----------
    simulation : refweb.dynamics.simulation.Simulation
        What it is the twin of.

    Attributes
    ----------
    failure : Exception, optional
        Why it has not come to its end.
    """

    def __init__(self, simulation):
        self._simulation, self._stop = simulation, threading.Event()
        self._thread = self._course = self._last = self._rows = self.failure = None

    def __enter__(self):
        integrator = self._simulation.integrator
        if integrator.beside and THREADS:  # the twin is made here: a system is used by one thread at a time
            twin = integrator.refined()
            twin.breathe = self._breathe
            self._thread = threading.Thread(target=self._run, args=(lambda: twin,), daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *error):
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def _breathe(self, t):
        if self._stop.is_set():
            raise InterruptedError(f"the twin run was ended at t = {t:g} s")

    def _run(self, made):
        simulation, rows = self._simulation, []
        try:
            integrator = made()
            begin = simulation.begin if simulation.begin_of_twin is None else simulation.begin_of_twin
            course = integrator.start(*begin)
            for block in blocks(integrator, course, simulation.schedule):
                table = simulation.watch.table(block.compared)
                rows.append(simulation.watch.of_observables(table).copy())
                if self._stop.is_set():
                    return
            self._course, self._last, self._rows = course, table[-1], np.concatenate(rows)
        except Exception as error:  # whatever it is, it belongs into the warnings of the run itself
            self.failure = error

    def ended(self):
        """Wait for it; what came of it, a `TwinRun`, None where it has failed."""
        if self._thread is not None:
            self._thread.join()
        else:
            self._run(self._simulation.integrator.refined)
        if self._course is None or self._rows is None:
            return None
        return TwinRun(self._simulation.watch.results(self._course, self._last), self._course, self._rows)


def _largest_mean(times, apart, end):
    """Largest root mean square of differences: from ½ end to end, from ¼ to ½, from ⅛ to ¼, from 0 to ⅛."""
    largest, starts = 0.0, (0.5, 0.25, 0.125, 0.0)
    for start, until in zip(starts, (1.0, *starts[:-1]), strict=False):
        near = (times >= start * end) & (times <= until * end)
        if near.any():
            largest = max(largest, float(np.sqrt(np.mean(apart[near] ** 2))))
    return largest


def with_errors(results, corrections, twin, own, other, order=2.0):
    """Results with ± from what differs in a run of a smaller error, times ``order`` and `SPREAD`.

    Two runs may agree by chance on a peak, or at the end, where the motion differs otherwise; what is constant after
    contact carries one difference through all rows. What counts is the larger of the difference of the result and the
    mean one, root mean square, of the observable at the times before: in half the time up to the result, or in half of
    what is left, wherever it is largest. Central differences are of order 2: a run of √2 times the steps has half the
    error, so that the error is twice the difference where that order holds (``order`` is that factor for the steps
    really taken). The error of CVODE and IDA goes with the tolerance to the power 2/3 at order 2, and faster at higher
    ones. Higher orders count as 2 here: peaks, contact and slack lines leave no more of them, for which the threefold
    is taken as well. An extreme between steps is known no better than what it exceeds the values at steps by, and one
    of CVODE or IDA no better than `SPREAD` times their relative tolerance: run and twin may find it alike. How often ±
    contains the truth is counted by ``python -m validation coverage``.

    Parameters
    ----------
    results, twin : dict of str to refweb.results.solution.Result
        Of either run.
    corrections : dict of str to float
        What ± of extremes is at least.
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
        apart_then = max(abs(result.value - twin[name].value), _largest_mean(own[:, 0], apart[:, i], result.time))
        error = SPREAD * order * apart_then + 4e-16 * abs(result.value)
        error = max(error, corrections.get(name, 0.0))
        found[name] = result._replace(error=float(error))
    return found


def add_errors(solution, run, twin, rows, share):
    """Add ± to the results of a solution and to the times of its events.

    Parameters
    ----------
    solution : refweb.Solution
        With results and events.
    run : refweb.dynamics.simulation.Ended
        What it is made of.
    twin : TwinRun
        What came of its twin.
    rows : ndarray, shape (rows, columns)
        Rows of its history: time, then the observables in their order.
    share : float
        Error of the twin over that of the run.
    """
    one, other = run.course, twin.course
    if one.stopped != other.stopped:
        which = ["the run", "its twin, the second run of a smaller error"][:: 1 if one.stopped else -1]
        solution.warnings.append("no errors are known: an event ends {}, but not {}".format(*which))
        return
    factor = 1.0 / (1.0 - share)
    solution.reduced = with_errors(run.results, run.corrections, twin.results, rows, twin.rows, factor)
    for found, width, time in zip(solution.events, one.events["width"], other.events["time"], strict=True):
        if found["time"] is not None and np.isfinite(time):
            off = abs(found["time"] - float(time))
            found["error"] = SPREAD * factor * off + float(width) + 4e-16 * found["time"]
    if one.stopped and len(rows) > 1:
        _add_lateness(solution, rows[-2:])


def _add_lateness(solution, rows):
    """Add to ± of results at the end what they change in that of the time of the event there."""
    before, last = rows
    late = max((event["error"] or 0.0 for event in solution.events if event["time"] == last[0]), default=0.0)
    change = late * np.abs(last - before) / (last[0] - before[0])
    for i, (name, result) in enumerate(solution.reduced.items(), 1):
        if result.time == last[0]:
            solution.reduced[name] = result._replace(error=result.error + float(change[i]))
