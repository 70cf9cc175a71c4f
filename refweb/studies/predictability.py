"""Horizon of a motion: growth of a small difference between two runs.

A slack net is chaotic: the smallest difference grows until no digit of a position is correct. A second run starts with
every free unknown moved at random by up to `PERTURBATION` of the shortest element. It has the same steps, and controls
act on its own state. The separation of the two motions shows how errors of this size grow, rounding included, for any
integrator. After the time at which less than one digit is left, results are statistical: several runs have a mean and a
spread, and no run has more.

May change: private functions and texts. Must stay: keys of `horizon` and `ensemble`, which stand in ``run.json`` and
which `further_runs` and `sweeps.case` read; `PERTURBATION`, with which the horizon in ``run.json`` changes; equal steps
of both runs; `lost_digits`, which `further_runs` imports. Tests: ``tests/studies/test_horizon.py``,
``tests/dynamics/test_control.py``.
"""

from __future__ import annotations

import numpy as np

from ..dynamics.initial_state import Start
from ..dynamics.schedule import blocks
from ..results.strength import UTILISATION

PERTURBATION = 1e-12
"""Largest difference of an unknown at the start, over the natural length of the shortest element."""


def horizon(simulation, results, members=None, tell=None):
    """Find the growth of a small difference.

    Parameters
    ----------
    simulation : refweb.dynamics.simulation.Simulation
        Simulation of a motion that has been run.
    results : dict of str to refweb.results.solution.Result
        Its results.
    members : int, optional
        Number of runs for mean and spread.
    tell : callable, optional
        Called with a text and the finished share.

    Returns
    -------
    dict
        ``perturbation`` [m]; ``growth`` of the difference, e-folds per second [1/s], by least squares from the start
        to where no digit is left; ``digits``, a list of (k, time at which fewer than k digits of the largest
        displacement are left [s], None where they are left at the end), k = 12 … 1; ``statistical``, names of results
        behind the last of these times; and what `ensemble` returns.
    """
    tell = tell or (lambda text, share: None)
    times = simulation.schedule.times
    pair = _motion(simulation, simulation.begin), _motion(simulation, _beside(simulation, 1))
    first = pair[0] if simulation.schedule.commands is None else [x.copy() for x in pair[0]]  # both set the same values
    apart, size = [], []
    for n, (x, x_beside) in enumerate(zip(first, pair[1], strict=False)):
        apart.append(np.abs(x - x_beside).max())
        size.append(np.abs(x).max())
        tell("horizon", n / (len(times) - 1))
    when = times[: len(apart)]
    left = -np.log10(np.maximum(apart, 1e-300) / np.maximum(max(size), 1e-300))
    digits = [(k, float(when[np.argmax(left < k)]) if (left < k).any() else None) for k in range(12, 0, -1)]
    end = digits[-1][1]
    known = when <= end if end is not None else np.ones(len(when), dtype=bool)
    growth = float(np.polyfit(when[known], np.log(np.maximum(apart, 1e-300))[known], 1)[0]) if known.sum() > 1 else None
    horizon_data = {
        "perturbation": float(PERTURBATION * simulation.system.net.natural_length.min()),
        "growth": growth,
        "digits": digits,
        "statistical": [name for name, r in results.items() if end is not None and r.time > end],
    }
    if members is not None:
        horizon_data |= ensemble(simulation, [PERTURBATION] * members, tell)
    return horizon_data


def _motion(simulation, begin):
    """Yield the displacements of a run from a `Start`, the same array at each row."""
    integrator, schedule = _integrator(simulation), simulation.schedule
    schedule.reset()
    course = integrator.start(*begin.motion)
    for row, time in enumerate(schedule.times):
        history = integrator.advance(course, [time])
        yield course.x
        if course.stopped:
            return
        if schedule.commands is not None:
            schedule.commands.act(row, integrator, course, history)


def _integrator(simulation):
    """Integrator with the final accuracy parameter of the simulation."""
    return simulation.integrator_at(simulation.standing.knob)


def _beside(simulation, seed, size=PERTURBATION):
    """The `Start` of the run of a seed, at a small difference from that of the simulation."""
    system, x = simulation.system, simulation.begin.x
    x = np.zeros((system.rows, 3)) if x is None else x.copy()
    size *= system.net.natural_length.min()
    x.ravel()[system.free] += size * np.random.default_rng(seed).uniform(-1.0, 1.0, len(system.free))
    return Start(x, simulation.begin.v)


def lost_digits(horizon, time):
    """Number of digits that a difference of `PERTURBATION` costs until a time [s]: the power of ten of its growth."""
    return 12 - max((k for k, when in horizon["digits"] if when is None or when > time), default=0)


def ensemble(simulation, sizes, tell):
    """Statistics over runs of different seeds, one for each of ``sizes``, by which its start differs at most.

    A size is relative to the natural length of the shortest element.

    Returns
    -------
    dict
        ``ensemble``, of each result ``mean`` and ``deviation``, the standard one; and ``utilisation``, both of the
        utilisation if there is one.
    """
    watch, values = simulation.watch, []
    for seed, size in enumerate(sizes, 1):
        integrator = _integrator(simulation)
        simulation.schedule.reset()
        course = integrator.start(*_beside(simulation, seed, size).motion)
        for block in blocks(integrator, course, simulation.schedule):
            table = watch.table(block.history)
        values_found = {name: result.value for name, result in watch.results(course, table[-1]).items()}
        if (used := watch.utilisation(course)) is not None:
            values_found[UTILISATION] = used[0]
        values.append(list(values_found.values()))
        tell("ensemble", seed / len(sizes))
    mean, deviation, names = np.mean(values, axis=0), np.std(values, axis=0, ddof=1), list(values_found)
    both = {n: {"mean": float(m), "deviation": float(d)} for n, m, d in zip(names, mean, deviation, strict=True)}
    used = both.pop(UTILISATION, None)
    return {"ensemble": both} | ({} if used is None else {"utilisation": used})
