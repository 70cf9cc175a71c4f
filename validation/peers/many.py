"""Many impacts by two processes, for programs that have no way of their own."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np


def last(impact, problem, settings, speed):
    """Last position of the thrown mass at a speed [m]."""
    return impact(replace(problem, speed=speed), **settings)[problem.node]


def by_processes(impact, problem, **settings):
    """Last positions of the thrown mass for all draws, shape (k, 3) [m].

    Parameters
    ----------
    impact : callable
        Function of a program, on the top level of its file.
    problem : Problem
    **settings
        Of the function.
    """
    with ProcessPoolExecutor(2) as pool:
        one = partial(last, impact, problem, settings)
        return np.array(list(pool.map(one, problem.draws.tolist(), chunksize=10)))
