"""How long a motion is determined: a twin that starts a little beside it.

A slack net is chaotic: the smallest difference grows, and at some time no digit of a position is left. The twin starts
with every free unknown moved at random by up to `PERTURBATION` of the shortest element, and is solved with the same
steps. Where the motions part says how errors of that size grow, rounding included, whatever the integrator. Behind the
time at which less than one digit is left results are statistical: several runs have a mean and a spread, and no run has
more.
"""

from __future__ import annotations

import numpy as np

PERTURBATION = 1e-12
"""Largest difference of an unknown at the start, over the natural length of the shortest element."""


def horizon(motion, results, ensemble=None, tell=None):
    """What grows of a small difference.

    Parameters
    ----------
    motion : refweb.dynamics.simulation.Motion
        A motion that has been run.
    results : dict of str to refweb.results.solution.Result
        Its results.
    ensemble : int, optional
        Number of runs that mean and spread are taken of.
    tell : callable, optional
        Called with a text and the share that is done.

    Returns
    -------
    dict
        ``perturbation`` [m]; ``growth`` of the difference, e-folds per second [1/s], by least squares from the start
        to where no digit is left; ``digits``, a list of (k, time at which fewer than k digits of the largest
        displacement are left [s], None where they are left at the end), k = 12 … 1; ``statistical``, names of results
        behind the last of these times; ``ensemble``, of each result ``mean`` and ``deviation``, the standard one.
    """
    tell = tell or (lambda text, share: None)
    times = motion._times()[0][1:]
    pair = [motion.solver(motion._accuracy) for _ in range(2)]
    runs = [pair[0].start(*motion.begin), pair[1].start(*_moved(motion, 1))]
    apart, size = [np.abs(runs[0].x - runs[1].x).max()], [np.abs(runs[0].x).max()]
    for n, end in enumerate(times, 1):
        for solver, run in zip(pair, runs, strict=True):
            solver.advance(run, [end])
        apart.append(np.abs(runs[0].x - runs[1].x).max())
        size.append(np.abs(runs[0].x).max())
        tell("horizon", n / len(times))
        if any(run.stopped for run in runs):
            break
    when = np.append(0.0, times)[: len(apart)]
    left = -np.log10(np.maximum(apart, 1e-300) / np.maximum(max(size), 1e-300))
    digits = [(k, float(when[np.argmax(left < k)]) if (left < k).any() else None) for k in range(12, 0, -1)]
    end = digits[-1][1]
    known = when <= end if end is not None else np.ones(len(when), dtype=bool)
    growth = float(np.polyfit(when[known], np.log(np.maximum(apart, 1e-300))[known], 1)[0]) if known.sum() > 1 else None
    found = {
        "perturbation": float(PERTURBATION * motion.system.net.natural_length.min()),
        "growth": growth,
        "digits": digits,
        "statistical": [name for name, r in results.items() if end is not None and r.time > end],
    }
    if ensemble is not None:
        found["ensemble"] = _ensemble(motion, ensemble, tell)
    return found


def _moved(motion, seed):
    """Start of the run of a seed: displacement and velocity."""
    system, x = motion.system, motion.begin[0]
    x = np.zeros((system.rows, 3)) if x is None else x.copy()
    most = PERTURBATION * system.net.natural_length.min()
    x.ravel()[system.free] += most * np.random.default_rng(seed).uniform(-1.0, 1.0, len(system.free))
    return x, motion.begin[1]


def _ensemble(motion, count, tell):
    """Mean and standard deviation of each result over runs of different seeds."""
    from ..dynamics.simulation import blocks

    values = []
    for seed in range(1, count + 1):
        solver = motion.solver(motion._accuracy)
        run = solver.start(*_moved(motion, seed))
        for _, history in blocks(solver, run, *motion._times()):
            last = history[-1:]
        values.append([r.value for r in motion.results(run, motion.table(last)[0]).values()])
        tell("ensemble", seed / count)
    mean, spread = np.mean(values, axis=0), np.std(values, axis=0, ddof=1)
    names = [o.name for o in motion.scene.observables]
    return {n: {"mean": float(m), "deviation": float(s)} for n, m, s in zip(names, mean, spread, strict=True)}
