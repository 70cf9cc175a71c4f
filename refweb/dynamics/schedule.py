"""Times of a run: its history rows, the rows with frames, and blocks of rows."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from .integrators.integrator import History

BLOCK = 0.1
"""Time that a block of rows is meant to take [s]: between two of them a run can be interrupted, and tells where it is.
"""
FEW_CORNERS = 20
"""Corners of tables of which nothing is told: they cost next to nothing."""
FEW, COMPARED = 10, 20
"""Number of rows below which a run and its twin are compared between rows as well, and at about how many times then."""
ROW, ROW_CELL, FRAME, FRAME_CELL = 1e-5, 1e-8, 2e-3, 1e-6
"""CPU time of a row and of a frame, and of each with every element [s], measured on nets of 1 and 5165 elements."""
MOST_ROWS = 10_000
"""Largest number of rows of a block."""


class Schedule(NamedTuple):
    """Times of the history rows and frames of a run.

    Attributes
    ----------
    times : ndarray, shape (rows,)
        Times of the history rows [s].
    frames : ndarray of int
        Numbers of the rows that frames are written at, the last row at least.
    between : ndarray
        Times between rows at which a run is compared with its twin [s]; none where rows are many. Steps end there
        whether there is a twin or not: errors do not change the run.
    """

    times: np.ndarray
    frames: np.ndarray
    between: np.ndarray = np.zeros(0)

    @classmethod
    def of(cls, scene):
        """Make the schedule of a scene: the rows of its interval, and a frame every ``frames`` rows and at the end."""
        times = row_times(scene)
        frames = np.unique(np.append(np.arange(0, len(times), scene.output.frames), len(times) - 1))
        return cls(times, frames, times_between(times))


class Counts(NamedTuple):
    """Numbers of what a run writes and computes at rows."""

    rows: int
    frames: int
    refined_rows: int

    @classmethod
    def of(cls, scene):
        """Count history rows, frames, and rows of the step-refinement run, which has as many or none."""
        interval, duration = scene.output.interval, scene.solve.duration
        whole_rows = int(math.floor(duration / interval * (1.0 + 1e-12)))
        rows = whole_rows + 1 + (duration - whole_rows * interval > 1e-9 * interval)
        frames = -(-rows // scene.output.frames) + ((rows - 1) % scene.output.frames != 0)
        return cls(rows, frames, rows if scene.accuracy.error == "twin" else 0)

    def text(self, scene):
        """The counts in words, with the time between."""
        interval, every = scene.output.interval, scene.output.frames
        text = f"{self.rows} rows, one each {interval:.6g} s; {self.frames} frames, one each {every * interval:.6g} s"
        return text + (f"; {self.refined_rows} rows of the step-refinement run" if self.refined_rows else "")

    def seconds(self, cells):
        """Estimate the CPU time of rows and frames of a web of so many elements [s]."""
        frames = self.frames * (FRAME + FRAME_CELL * cells)
        return frames + (self.rows + self.refined_rows) * (ROW + ROW_CELL * cells)


def row_times(scene):
    """Times of the history rows [s]: multiples of the interval, and the end."""
    interval, duration = scene.output.interval, scene.solve.duration
    count = int(math.floor(duration / interval * (1.0 + 1e-12)))
    times = interval * np.arange(count + 1)
    if duration - times[-1] > 1e-9 * interval:
        return np.append(times, duration)
    times[-1] = duration
    return times


def time_of(t, end):
    """The time that a run has come to [s], in words."""
    return f"t = {t:.4g} of {end:.4g} s"


def times_between(times):
    """Times that cut rows which are fewer than `FEW` into about `COMPARED` parts [s], equal in each row."""
    parts = -(-COMPARED // max(len(times) - 1, 1)) if len(times) <= FEW else 1
    shares = np.arange(1, parts) / parts
    return (times[:-1, None] + shares * np.diff(times)[:, None]).ravel()


class Block(NamedTuple):
    """Rows that an integrator has come through at once.

    Attributes
    ----------
    first : int
        Number of the first row.
    history : refweb.dynamics.integrators.integrator.History
        All of them.
    compared : refweb.dynamics.integrators.integrator.History
        The same and, where rows are few, what lies between them.
    """

    first: int
    history: History
    compared: History


def blocks(integrator, course, schedule, first=0):
    """Advance through the times of a schedule in blocks that last about `BLOCK` and end at each of its frames.

    Parameters
    ----------
    integrator : refweb.dynamics.integrators.integrator.Integrator
        What advances.
    course : refweb.dynamics.integrators.integrator.IntegratorState
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
        began, rows = time.perf_counter(), times[first : first + count]
        between = schedule.between[(schedule.between > course.time) & (schedule.between < rows[-1])]
        history = compared = integrator.advance(course, np.sort(np.concatenate([rows, between])))
        if len(between):
            selected = np.isin(compared.time, rows)
            selected[-1] = True  # where an event ends the run, its row is that of the event
            history = compared[selected]
        yield Block(first, history, compared)
        first += count
        spent = time.perf_counter() - began
        size = max(1, min(2 * size if spent < 0.5 * BLOCK else int(size * BLOCK / spent), MOST_ROWS))
        if course.stopped:
            break
    integrator.refuse_drift(course)
