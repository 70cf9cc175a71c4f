"""What statics costs beside its factorizations: CPU time of the shipped load series on the paper's square web.

    python -m validation.cost.statics

The series of `square-load`, 1 to 5 N from flat, runs on a system that is built and warm. Its orderings, factorizations
and solves by `refweb.system.supernodal`, with their matrices and right-hand sides, are recorded once and then timed
alone. CPU time, minimum of several runs that alternate, in one process with one thread; with the certificates and
without them.
"""

from __future__ import annotations

import os
import sys
import time
from contextlib import contextmanager

from refweb.sweeps.threads import ONE_THREAD

os.environ |= ONE_THREAD

from refweb.scene import Scene  # noqa: E402
from refweb.statics import load_steps  # noqa: E402
from refweb.system import supernodal  # noqa: E402
from refweb.system.system import System  # noqa: E402

LIMIT = 3.2
"""Largest ratio of the series to its factorizations and solves."""


class Recorder(supernodal.Supernodal):
    """Notes every call: (name, argument)."""

    calls: list = []

    def __init__(self, pattern):
        self.calls.append(("order", pattern))
        super().__init__(pattern)

    def factorize(self, values):
        self.calls.append(("factorize", values.copy()))
        super().factorize(values)

    def solve(self, b):
        self.calls.append(("solve", b.copy()))
        return super().solve(b)


@contextmanager
def replaced(owner, name, value):
    """An attribute replaced for a while."""
    before = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)


def recorded(series):
    """All calls that a series makes."""
    Recorder.calls = []
    with replaced(supernodal, "Supernodal", Recorder):
        series()
    return Recorder.calls


def replay(calls):
    """The same calls alone."""
    for name, argument in calls:
        if name == "order":
            solver = supernodal.Supernodal(argument)
        elif name == "factorize":
            solver.factorize(argument)
        else:
            solver.solve(argument)


def cpu_time(call):
    began = time.process_time()
    call()
    return time.process_time() - began


def measure(repeats=15):
    """Rows of (with certificates, calls, CPU time of the series, of these calls alone) [s]."""
    tables = Scene.load("square-load").to_dict()
    tables["solve"]["factorization"] = "supernodal"
    scene = Scene.from_dict(tables)
    system, rows = scene.build(), []

    def series():
        return list(load_steps.solve(system, scene.solve.load_steps))

    for certified in (True, False):
        with replaced(System, "convex", System.convex if certified else False):
            calls = recorded(series)
            times = [(cpu_time(series), cpu_time(lambda: replay(calls))) for _ in range(repeats)]  # noqa: B023
            rows.append((certified, calls, *map(min, zip(*times, strict=True))))
    return rows


def main():
    """Print the ratios; the status says whether they are within the limit."""
    ratios = []
    for certified, calls, whole, alone in measure():
        ratios.append(whole / alone)
        count = [sum(name == kind for name, _ in calls) for kind in ("order", "factorize", "solve")]
        print(f"{'with' if certified else 'without'} certificates: series {1e3 * whole:.0f} ms, its", end=" ")
        print(f"{count[0]} orderings, {count[1]} factorizations and {count[2]} solves alone", end=" ")
        print(f"{1e3 * alone:.0f} ms, ratio {ratios[-1]:.2f}, limit {LIMIT}")
    return 0 if max(ratios) <= LIMIT else 1


if __name__ == "__main__":
    sys.exit(main())
