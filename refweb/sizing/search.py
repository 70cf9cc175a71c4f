"""Ways to the least design: by gradients, of all designs, by differential evolution and by dividing rectangles.

Each runs designs by `refweb.sizing.runs.Runs`; all but gradients leave it to `best` to choose among them. In a search
without gradients undecided requirements count as not met.

May change: private functions; `MOST_COMBINATIONS`, `FEW`, `RESERVES`, `BESIDE` and `VIOLATED`, which decide which
method runs, how many designs, and which of these is taken. Must stay: `method_of`, `searched` and `best`, which `size`
calls; names of methods, which are those of `requirements.METHODS`; seeds, by which a sizing that continues finds its
runs again. Tests: ``tests/sizing/test_size.py``.

References
----------
R. Storn and K. Price, J. Global Optim. 11 (1997) 341–359, doi:10.1023/A:1008202821328.
J. M. Gablonsky and C. T. Kelley, J. Global Optim. 21 (2001) 27–37, doi:10.1023/A:1017930332101.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from ..errors import InputError
from .runs import Spent
from .smooth import Smooth
from .space import Design

MOST_COMBINATIONS = 64
"""Largest number of combinations of options each of which has its least design by gradients."""
FEW = 3
"""Largest number of numbers between bounds for dividing rectangles."""
RESERVES = (0.05, 0.1, 0.2, 0.4)
"""Reserves of further least designs, for the trade-off."""
BESIDE = 1e-6
"""Relative difference of the objective above which a design is better than that by gradients."""
VIOLATED = 1e3
"""Objective, over its size, of a violation of 1 where designs have no other order."""


def method_of(problem):
    """The method of a problem; "auto" is the first that fits.

    Raises
    ------
    InputError
        For a method that does not fit the free numbers.
    """
    sizing, space = problem.sizing, problem.space
    smooth = bool(space.free) and problem.static and not sizing.draws and space.combinations <= MOST_COMBINATIONS
    listed = not space.free and space.combinations * len(problem.drawn) <= sizing.runs
    rectangles = bool(space.free) and not space.listed
    asked = sizing.method
    if asked == "auto":
        few = rectangles and len(space.free) <= FEW
        return "gradients" if smooth else "enumeration" if listed else "direct" if few else "evolution"
    if asked == "gradients" and not smooth:
        needed = (
            f"numbers between bounds, statics, no draws, and at most {MOST_COMBINATIONS} combinations of the others"
        )
        raise InputError(f'method = "gradients" needs {needed}: leave it out')
    if asked == "enumeration" and not listed:
        count = space.combinations * len(problem.drawn)
        needed = f"no numbers between bounds, and at most runs = {sizing.runs} runs, not {count}"
        raise InputError(f'method = "enumeration" needs {needed}')
    if asked == "direct" and not rectangles:
        raise InputError('method = "direct" needs numbers between bounds alone: leave it out')
    return asked


def searched(runs, method):
    """Search by a method; (optima by gradients, a list, and True if the largest number of runs is reached)."""
    search = {"gradients": _gradients, "enumeration": _enumeration, "evolution": _evolution, "direct": _direct}
    optima = []
    try:
        search[method](runs, optima)
    except Spent:
        return optima, True
    return optima, False


def _gradients(runs, optima):
    """Least design of each combination of options from all starts and by all sides, and further ones with a reserve."""
    sizing, space, solved = runs.problem.sizing, runs.problem.space, []
    for options in space.choices():
        sides = [Smooth(runs, options, requirements) for requirements in runs.problem.sides() or [None]]
        starts, ends = space.starts(sizing.starts, sizing.seed), []
        for start in starts:
            values = []
            for smooth in sides:
                u = smooth.optimise(start)
                (judged,) = runs.of([smooth.design(u)], slopes=True)
                if judged.feasible is True:
                    ends.append((judged.value, smooth, u))
                    values.append(judged.value)
            runs.ends.append((options, min(values, default=None)))
        if ends:
            _, smooth, u = min(ends, key=lambda end: end[0])
            solved.append((smooth, u))
            optima.append(smooth.optimum(u))
            continue
        for start, smooth in itertools.product(starts, sides):
            runs.of([smooth.design(smooth.nearest(start))], slopes=True)
    for smooth, u in solved if sizing.trade_off else ():
        for reserve in RESERVES:
            u = smooth.optimise(u, reserve)
            if runs.of([smooth.design(u)], slopes=True)[0].tightest < reserve:
                break


def _enumeration(runs, optima):
    count = runs.crew.parallel
    designs = [Design((), options) for options in runs.problem.space.choices()]
    for first in range(0, len(designs), 4 * count):
        runs.of(designs[first : first + 4 * count])


def _designs(runs, points):
    """Designs at rows of fractions and numbers of options."""
    count = len(runs.problem.space.free)
    return [Design(tuple(map(float, x[:count])), tuple(int(round(number)) for number in x[count:])) for x in points]


def _evolution(runs, optima):
    from scipy.optimize import NonlinearConstraint, differential_evolution

    space = runs.problem.space
    ends = [(0, len(options) - 1) for options in space.listed.values()]

    def objective(x):
        judged = runs.of(_designs(runs, np.atleast_2d(x.T)))
        return np.array([j.value if math.isfinite(j.value) else np.inf for j in judged])

    def reserve(x):
        return np.array([[j.tightest for j in runs.of(_designs(runs, np.atleast_2d(x.T)))]])

    differential_evolution(
        objective,
        [(0.0, 1.0)] * len(space.free) + ends,
        integrality=[False] * len(space.free) + [True] * len(ends),
        constraints=NonlinearConstraint(reserve, 0.0, np.inf),
        vectorized=True,
        updating="deferred",
        polish=False,
        seed=np.random.default_rng(runs.problem.sizing.seed),
        popsize=max(5, 15 // max(len(space.names), 1)),
        tol=1e-6,
        maxiter=10_000,
    )


def _direct(runs, optima):
    from scipy.optimize import direct

    sizes = []

    def merit(x):
        (judged,) = runs.of(_designs(runs, [x]))
        if not math.isfinite(judged.value):
            return 10.0 * VIOLATED
        sizes.append(abs(judged.value) or 1.0)
        return judged.value / sizes[0] + VIOLATED * max(-judged.tightest, 0.0)

    largest = runs.problem.sizing.runs // len(runs.problem.drawn)
    direct(merit, [(0.0, 1.0)] * len(runs.problem.space.free), maxfun=largest, maxiter=10 * largest, vol_tol=1e-12)


def best(runs, optima):
    """(Best design, its `refweb.sizing.smooth.Optimum` or None): the least that meets all requirements.

    Without one it is the design whose largest violation is least.
    """
    judged = list(runs.judged.values())
    feasible = [j for j in judged if j.feasible is True and math.isfinite(j.value)]
    if not feasible:
        known = [j for j in judged if math.isfinite(j.value)]
        return (max(known, key=lambda j: j.tightest) if known else None), None
    lowest = min(feasible, key=lambda j: j.value)
    met = [optimum for optimum in optima if optimum.judged.feasible is True]
    if met:
        optimum = min(met, key=lambda o: o.judged.value)
        if optimum.judged.value <= lowest.value + BESIDE * abs(lowest.value):
            return optimum.judged, optimum
    return lowest, None
