"""End of a run and its cost: status, message and time, however it is left."""

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
    """CPU time of this process and of those that it has begun and that have ended [s]."""
    return time.process_time() + sum(os.times()[2:4])


class Clock:
    """CPU and wall time since it was made, and what of it kernels took to compile."""

    def __init__(self):
        self._cpu, self._wall, self._compiled = _cpu(), time.perf_counter(), _compiling().seconds

    def spent(self):
        """Time that has passed since, ``cpu_s``, ``wall_s`` and ``compile_s`` [s]."""
        return {
            "cpu_s": _cpu() - self._cpu,
            "wall_s": time.perf_counter() - self._wall,
            "compile_s": _compiling().seconds - self._compiled,
        }


@contextlib.contextmanager
def recorded(target, clock, done=None):
    """Write to what is found how the run inside ends, and what it cost.

    Parameters
    ----------
    target : object
        Gets ``status``, "solved", "failed" or "interrupted", unless the run sets another than "running" itself; of a
        failure its ``message``; and in the dict ``cost`` what the clock says.
    clock : Clock
        Made where the run began.
    done : callable, optional
        How far the run came, in words, for the message of an interruption.
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
