"""When a run is looked at: the times of its history rows, those that frames are written at, and blocks of them."""

from __future__ import annotations

import math
import time
from typing import NamedTuple

import numpy as np

BLOCK = 0.1
"""Time that a block of rows is meant to take [s]: between two of them a run can be interrupted, and tells where it is.
"""
MOST_ROWS = 10_000
"""Largest number of rows of a block."""


class Schedule(NamedTuple):
    """When a run is looked at.

    Attributes
    ----------
    times : ndarray, shape (rows,)
        Times of the history rows [s].
    frames : ndarray of int
        Numbers of the rows that frames are written at, the last row at least.
    """

    times: np.ndarray
    frames: np.ndarray

    @classmethod
    def of(cls, scene):
        """That of a scene: the rows of its interval, and a frame every ``frames`` rows and at the end."""
        times = row_times(scene)
        return cls(times, np.unique(np.append(np.arange(0, len(times), scene.output.frames), len(times) - 1)))


def row_times(scene):
    """Times of the history rows [s]: multiples of the interval, and the end."""
    interval, duration = scene.output.interval, scene.solve.duration
    count = int(math.floor(duration / interval * (1.0 + 1e-12)))
    times = interval * np.arange(count + 1)
    if duration - times[-1] > 1e-9 * interval:
        return np.append(times, duration)
    times[-1] = duration
    return times


class Block(NamedTuple):
    """Rows that an integrator has come through at once: the number of the first, and its history of all of them."""

    first: int
    history: object


def blocks(integrator, course, schedule, first=0):
    """Advance through the times of a schedule in blocks that last about `BLOCK` and end at each of its frames.

    Parameters
    ----------
    integrator : refweb.dynamics.integrators.integrator.Integrator
        What advances.
    course : refweb.dynamics.integrators.integrator.Course
        The state of its run.
    schedule : Schedule
        Where to.
    first : int
        Number of the first row ahead.

    Yields
    ------
    Block
        Until the end, or an event that ends the run.

    Raises
    ------
    OpenBook
        At the end, for a run whose energy drift exceeds its limit.
    """
    times, size = schedule.times, 1
    while first < len(times):
        stop = schedule.frames[np.searchsorted(schedule.frames, first)]
        count = min(size, stop + 1 - first)
        began = time.perf_counter()
        yield Block(first, integrator.advance(course, times[first : first + count]))
        first += count
        spent = time.perf_counter() - began
        size = max(1, min(2 * size if spent < 0.5 * BLOCK else int(size * BLOCK / spent), MOST_ROWS))
        if course.stopped:
            break
    integrator.refuse_drift(course)
