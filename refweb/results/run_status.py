"""End of a run and its cost: status, message and time, also after an error.

May change: private functions and how time is measured. Must stay: words of status ("solved", "failed", "interrupted")
and keys of ``cost`` (``cpu_s``, ``wall_s``, ``compile_s``), which stand in ``run.json`` and which pictures, pages and
studies read; `Clock`, which `runner`, `sizing.size` and other files import; `recorded`, which `runner`, `sizing.size`
and other files import. Tests: ``tests/results/test_run_status.py``.
"""

from __future__ import annotations

import contextlib
import functools
import os
import time

from ..errors import SolverError
from ..findings import REFUSAL, Finding


@functools.cache
def _compiling():
    """Listener that measures the time of numba's compiling in this process [s]."""
    from numba.core import event

    class Compiling(event.Listener):
        seconds, depth, began = 0.0, 0, 0.0

        def on_start(self, event):
            if self.depth == 0:
                self.began = time.perf_counter()
            self.depth += 1

        def on_end(self, event):
            self.depth -= 1
            if self.depth == 0:
                self.seconds += time.perf_counter() - self.began

    listener = Compiling()
    event.register("numba:compile", listener)
    return listener


def _cpu():
    """CPU time of this process and of its child processes that have ended [s]."""
    return time.process_time() + sum(os.times()[2:4])


class Clock:
    """CPU and wall time since its creation, and the time of compiling kernels."""

    def __init__(self):
        self._cpu, self._wall, self._compiled = _cpu(), time.perf_counter(), _compiling().seconds

    def spent(self):
        """Times since the creation: ``cpu_s``, ``wall_s`` and ``compile_s`` [s]."""
        return {
            "cpu_s": _cpu() - self._cpu,
            "wall_s": time.perf_counter() - self._wall,
            "compile_s": _compiling().seconds - self._compiled,
        }


@contextlib.contextmanager
def recorded(target, clock, done=None):
    """Record in ``target`` how the run inside the block ends, and its cost.

    Parameters
    ----------
    target : object
        Object with ``status``, ``message`` and ``cost``. Its status becomes "failed" or "interrupted", or "solved" if
        it is still "running" at the end. A failure sets its message. The times of the clock are added to the dict
        ``cost``.
    clock : Clock
        Clock that was created at the start of the run.
    done : callable, optional
        Function that returns a text of the progress for the message of an interruption.
    """
    try:
        yield
        if target.status == "running":
            target.status = "solved"
    except KeyboardInterrupt:
        target.status = "interrupted"
        if done is not None:
            target.message = f"interrupted after {done()}"
        raise
    except SolverError as error:
        target.status, target.message = "failed", str(error)
        if hasattr(target, "findings"):
            target.findings.append(Finding(error.code, str(error), severity=REFUSAL))
        raise
    except Exception as error:
        target.status, target.message = "failed", f"{type(error).__name__}: {error}"
        raise
    finally:
        target.cost = {**target.cost, **clock.spent()}
