"""How a run ended and what it cost: status, message and time, however it is left."""

from __future__ import annotations

import contextlib
import time

from ..errors import SolverError


class Clock:
    """CPU and wall time since it was made."""

    def __init__(self):
        self._cpu, self._wall = time.process_time(), time.perf_counter()

    def spent(self):
        """What has passed since, ``cpu_s`` and ``wall_s`` [s]."""
        return {"cpu_s": time.process_time() - self._cpu, "wall_s": time.perf_counter() - self._wall}


@contextlib.contextmanager
def recorded(found, clock, done=None):
    """Write to what is found how the run inside ends, and what it cost.

    Parameters
    ----------
    found : object
        Gets ``status``, "solved", "failed" or "interrupted", unless the run sets another than "running" itself; of a
        failure its ``message``; and in the dict ``cost`` what the clock says.
    clock : Clock
        Made where the run began.
    done : callable, optional
        How far the run came, in words, for the message of an interruption.
    """
    try:
        yield
        if found.status == "running":
            found.status = "solved"
    except KeyboardInterrupt:
        found.status = "interrupted"
        if done is not None:
            found.message = f"interrupted after {done()}"
        raise
    except SolverError as error:
        found.status, found.message = "failed", str(error)
        raise
    except Exception as error:
        found.status, found.message = "failed", f"{type(error).__name__}: {error}"
        raise
    finally:
        found.cost = {**found.cost, **clock.spent()}
