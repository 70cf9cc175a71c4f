"""What a study costs beside its runs.

    python -m validation.cost.sweep [CASES]

Impacts on the paper's square web at places and speeds at random, by processes of this machine into a folder, 200 cases
by default. What is beside the runs is the CPU time of this process and its workers without that which the cases tell:
the start of workers, which a study of one case for each worker shows alone, and what every case adds, which may be 5 %
of the runs. Exit status 1 above that. On Windows, which does not tell the CPU time of processes that have ended, there
is nothing to see.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from typing import NamedTuple

import refweb
from refweb.sweeps.workers import Processes

LIMIT = 0.05
"""Largest share of the runs."""
VARIED = {
    "body.0.position.0": {"distribution": "uniform", "loc": -0.5, "scale": 1.0},
    "body.0.position.1": {"distribution": "uniform", "loc": -0.5, "scale": 1.0},
    "body.0.velocity.2": {"distribution": "norm", "loc": 1.0, "scale": 0.1},
}


class Spent(NamedTuple):
    """CPU time of a study: of its cases, and of all processes without them [s]; and its wall time [s]."""

    cases: float
    beside: float
    wall: float


def spent(count, seed):
    """What a study of so many cases takes, a `Spent`."""
    with tempfile.TemporaryDirectory() as folder:
        begun, before = time.perf_counter(), sum(os.times()[:4])
        found = refweb.sweep(
            "square-impact", VARIED, out=f"{folder}/study", sample="random", count=count, seed=seed, progress=None
        )
        whole, wall = sum(os.times()[:4]) - before, time.perf_counter() - begun
    if found.count != {"solved": count}:
        raise SystemExit(f"not all cases are solved: {found.count}")
    return Spent(found.cost["cases_cpu_s"], whole - found.cost["cases_cpu_s"], wall)


def main(cases):
    """Print the table; whether the limit is kept."""
    workers = Processes().parallel
    spent(workers, 0)  # compiles
    start, whole = spent(workers, 1), spent(cases, 2)
    more, beside = whole.cases - start.cases, whole.beside - start.beside
    print(f"{cases} impacts on the square web, {workers} workers, {whole.wall:.0f} s")
    print(f"  runs              {whole.cases:8.1f} s CPU, {1e3 * whole.cases / cases:.0f} ms each")
    print(f"  start of workers  {start.beside:8.1f} s CPU")
    each = f"{1e3 * beside / cases:.1f} ms a case, {beside / more:.1%} of the runs"
    print(f"  beside the runs   {beside:8.1f} s CPU, {each}")
    return beside <= LIMIT * more


if __name__ == "__main__":
    sys.exit(not main(int(sys.argv[1]) if len(sys.argv) > 1 else 200))
