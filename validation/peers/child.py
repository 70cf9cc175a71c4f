"""One program on one problem, in a process of its own: ``python -m validation.peers.child NAME TASK FOLDER SETTINGS``.

Reads ``problem.npz`` of the folder, and writes what the program returns to ``result.npz`` and what that took to
``cost.json``. A program that compiles when it is called is called twice, and any other again where that is cheap; CPU
and wall time are the least of both, ``first_cpu`` is that of the first call. A fault is written as the program words
it.
"""

from __future__ import annotations

import importlib
import json
import os
import pathlib
import sys
import time

import numpy as np

from .problem import Problem

CHEAP = 1.0
"""CPU time of a call that is repeated [s]."""


def peak():
    """Largest memory of this process so far [MB]; None where the system does not say.

    On Linux ``ru_maxrss`` begins with that of the process which has started this one.
    """
    status = pathlib.Path("/proc/self/status")
    if status.exists():
        words = next(line for line in status.read_text(encoding="utf-8").splitlines() if line.startswith("VmHWM"))
        return 1.024e-3 * float(words.split()[1])
    if sys.platform != "darwin":
        return None
    import resource

    return 1e-6 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def cpu_time():
    """CPU time of this process, to better than a tick, and of those that it has started and that have ended [s]."""
    return time.process_time() + sum(os.times()[2:4])


def main(name, task, folder, settings):
    """Run it; 1 where the program fails."""
    folder, cost = pathlib.Path(folder), {}
    try:
        program = importlib.import_module(f"validation.peers.programs.{name}")
        cost["version"], problem, calls = program.version(), Problem.load(folder / "problem.npz"), []
        while not calls or (len(calls) < 2 and (program.COMPILES or calls[0][0] < CHEAP)):
            cpu, wall = cpu_time(), time.perf_counter()
            result = getattr(program, task)(problem, **json.loads(settings))
            calls.append((cpu_time() - cpu, time.perf_counter() - wall))
        np.savez(folder / "result.npz", result=result)
        least = min(calls)
        cost |= {"cpu": least[0], "wall": least[1], "first_cpu": calls[0][0]}
    except Exception as error:
        cost["failure"] = f"{type(error).__name__}: {error}"
    cost |= {"process_cpu": cpu_time(), "peak_mb": peak()}
    (folder / "cost.json").write_text(json.dumps(cost), encoding="utf-8")
    return int("failure" in cost)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
