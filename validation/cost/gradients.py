"""What gradients by all lines cost beside what they are derivatives of: CPU time on the paper's square web.

    python -m validation.cost.gradients

The web has 3120 lines. The first gradient factorizes the tangent of the equilibrium, further results share it. Compared
are a gradient of statics with the load series of `square-load`, and one of a natural frequency with its modes. CPU
time, minimum of several runs, in one process with one thread.
"""

from __future__ import annotations

import os
import sys
import time

from refweb.sweeps.threads import ONE_THREAD

os.environ |= ONE_THREAD

import refweb  # noqa: E402

LIMIT = 1.2
"""Largest ratio of a gradient by all lines to the solution that it is a derivative of."""
REPEATS = 7


def timed(call):
    """(What a call returns, its CPU time [s])."""
    began = time.process_time()
    returned = call()
    return returned, time.process_time() - began


def measure(solve, results):
    """CPU time of a solution, and of the gradients of some results by the area of each line, minima [s]."""
    times = []
    for _ in range(REPEATS):
        solution, alone = timed(solve)
        of_results = [timed(lambda: solution.gradient(name, "cable.area", "line"))[1] for name in results]  # noqa: B023
        times.append((alone, *of_results))
    return list(map(min, zip(*times, strict=True)))


def main():
    """Print the ratios; the status says whether they are within the limit."""
    scene = refweb.Scene.load("square-load")
    statics = measure(lambda: refweb.run(scene, progress=False), ("max_stress", "deflection"))
    vibrations = measure(lambda: refweb.modes(scene, 3, progress=False), ("frequency_1",))
    for name, (alone, *more) in (("statics", statics), ("modes", vibrations)):
        parts = ", ".join(f"{1e3 * t:.0f} ms, ratio {t / alone:.2f}" for t in more)
        print(f"{name}: {1e3 * alone:.0f} ms alone; gradients by 3120 lines {parts}, limit {LIMIT}")
    return 0 if max(statics[1] / statics[0], vibrations[1] / vibrations[0]) <= LIMIT else 1


if __name__ == "__main__":
    sys.exit(main())
