"""Workers that run cases: processes of this machine, or any `concurrent.futures.Executor`; workers may die.

`through` submits jobs and yields the outcome of each once. If a worker dies, its jobs are tried again one at a time, to
find the job that kills its worker among those that ran at the same time. A job that has killed `TRIES` workers is given
up.

May change: private functions, `TRIES` and `GLANCE`. Must stay: each outcome once from `through`; of an executor of a
user only ``submit``, standard futures and, where it exists, ``_max_workers`` are used; one thread of each library, by
which rows are the same in all processes; `crew_of`, which `sizing.size` and `sweep` import; `Processes`, which
`sizing.runs` imports; `cluster`, which `commands.arguments` imports. Tests: ``tests/sweeps/test_workers.py``.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import multiprocessing.connection
import os
import signal
import threading
from collections import Counter, deque
from typing import Any

from ..errors import InputError, SolverError
from ..messages import one_line, quote
from .case import Outcome, solve
from .threads import ONE_THREAD

TRIES = 3
"""Number of workers that a job may kill before it is given up."""
GLANCE = 0.5
"""Longest time between two checks for finished jobs [s]."""


def cores():
    """Number of processors that this process may use, by affinity and the quota of a container."""
    import loky

    return loky.cpu_count()


def _watch(parent):
    """End this process when the process at the other end of a pipe ends for any reason; ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)

    def wait():
        multiprocessing.connection.wait([parent])
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


class Processes:
    """Processes of this machine, one thread each, by loky: they do not import the user's script, which needs no guard.

    loky gives up all jobs when one process dies, and does not say which job killed it; `through` tries them again.

    Attributes
    ----------
    pool : loky.ProcessPoolExecutor, optional
        Its processes, None before the first job and after the end.
    """

    local = True

    def __init__(self, count=None):
        self.parallel = count or cores()
        self.pool: Any = None
        self._alive: Any = None

    def submit(self, job):
        """Hand out a job; a `concurrent.futures.Future`."""
        import loky

        if self.pool is None:
            parent, self._alive = multiprocessing.Pipe(duplex=False)
            options = {"initializer": _watch, "initargs": (parent,), "env": ONE_THREAD}
            self.pool = loky.ProcessPoolExecutor(self.parallel, **options)
        can_block = hasattr(signal, "pthread_sigmask")  # until `_watch` runs
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if can_block else None
        try:
            return self.pool.submit(solve, job)
        except concurrent.futures.BrokenExecutor as error:  # a worker has died since
            future = concurrent.futures.Future()
            future.set_exception(error)
            return future
        finally:
            if before is not None:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def renew(self):
        """Start new processes after a worker has died."""
        self.stop()

    def stop(self):
        """End all processes at once."""
        if self.pool is not None:
            self.pool.shutdown(kill_workers=True)
            self._alive.close()
            self.pool = self._alive = None


class Given:
    """An executor that the caller has made, and shuts down."""

    local = False

    def __init__(self, executor, parallel=None):
        self._executor = executor
        self.parallel = parallel or getattr(executor, "_max_workers", None) or cores()
        self._futures = set()

    def submit(self, job):
        """Hand out a job; a `concurrent.futures.Future`."""
        try:
            future = self._executor.submit(solve, job)
        except Exception as error:
            name = type(self._executor).__name__
            raise SolverError(
                f"the executor, {name}, takes no more cases: {one_line(error)}; the study goes on with what is missing "
                "when it is started again"
            ) from None
        self._futures.add(future)
        future.add_done_callback(self._futures.discard)
        return future

    def renew(self):
        """Do nothing: the caller renews the executor."""

    def stop(self):
        """Cancel the jobs that have not started."""
        for future in list(self._futures):
            future.cancel()


def crew_of(executor, workers):
    """Workers of an executor, or so many processes of this machine, None for one for each processor.

    Raises
    ------
    InputError
        For both at once, and a number that is not whole or below 1.
    """
    if executor is not None and workers is not None:
        raise InputError(f"workers = {workers} has no meaning with an executor, which has its own: leave one out")
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise InputError(f"workers = {quote(workers)} must be a whole number ≥ 1")
    if executor is None:
        return Processes(workers)
    return executor if isinstance(executor, Given | Processes) else Given(executor)


@contextlib.contextmanager
def cluster(address):
    """The workers of a running Dask cluster, by the address of its scheduler, tcp://HOST:PORT.

    Yields
    ------
    Given
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            '--scheduler needs distributed, which is not installed: pip install "refweb[cluster]"'
        ) from None
    try:
        client: Any = Client(address, timeout="10s", set_as_default=False)
    except Exception as error:
        raise InputError(f"--scheduler {address}: no scheduler answers there: {one_line(error)}") from None
    try:
        workers = Given(client.get_executor(pure=False), sum(client.nthreads().values()))
        yield workers
    finally:
        client.close()


def through(jobs, workers, last=True):
    """Outcomes of jobs, each once, in the order in which they arrive.

    Parameters
    ----------
    jobs : iterable of Job
        Jobs to run.
    workers : Processes or Given
        Workers that run the jobs.
    last : bool
        True to stop the workers at the end, also at an early one.

    Yields
    ------
    Outcome
    """
    ahead, suspects, tried = deque(jobs), deque(), Counter()
    running, refused = {}, None
    try:
        while running or not refused and (ahead or suspects):
            try:
                while suspects and not running:
                    _hand_out(suspects, running, workers, alone=True)
                alone = any(job_alone for _, job_alone in running.values())
                while ahead and not suspects and len(running) <= workers.parallel and not alone:
                    _hand_out(ahead, running, workers)
            except SolverError as error:  # what is running may end all the same
                refused = error
                ahead.clear()
                suspects.clear()
            done, _ = concurrent.futures.wait(running, GLANCE, concurrent.futures.FIRST_COMPLETED)
            broken = [f for f in done if f.cancelled() or f.exception() is not None]
            for future in done - set(broken):
                del running[future]
                yield future.result()
            if broken:
                yield from _again(broken, running, workers, suspects, tried)
        if refused is not None:
            raise refused
    finally:
        if last:
            workers.stop()


def _hand_out(jobs, running, workers, alone=False):
    running[workers.submit(jobs[0])] = (jobs[0], alone)
    jobs.popleft()


def _again(broken, running, workers, suspects, tried):
    """Keep the jobs of a dead worker for another try; yield outcomes of jobs that are given up or had finished."""
    if workers.local:  # with one process all die
        workers.renew()
        broken = list(running)
    for future in broken:
        job, alone = running.pop(future)
        if future.done() and not future.cancelled() and future.exception() is None:
            yield future.result()
            continue
        error = None if future.cancelled() or not future.done() else future.exception()
        tried[job.key] += alone or not workers.local
        if tried[job.key] < TRIES:
            suspects.append(job)
        else:
            why = type(error).__name__ + (f": {one_line(error)}" if str(error) else "") if error else "cancelled"
            text = f"its worker died {TRIES} times ({why[:200]}); the study tries again when it is started again"
            yield Outcome(job.key, {"status": "lost", "message": text})
