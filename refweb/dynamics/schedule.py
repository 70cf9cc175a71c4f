"""Times of a run: its history rows, the rows with frames, and blocks of rows.

May change: `BLOCK`, `MOST_ROWS` and the measured costs, which change no result; `FEW_CORNERS`, above which `simulation`
and ``refweb check`` ask `breakpoints` for a finding, and which ``tests/test_pay_for_what_you_call.py`` knows by name.
Must stay: times of rows and numbers of frames of a scene, since a resumed run finds its row by number, and frames of
folders are named by it; with `COMPARED` and `FEW` ± changes, and the last digits of runs of few rows, whose steps end
at more times; all names that `simulation`, `stepped_run` and other files import; public names of `Counts`, which other
files use. Tests: ``tests/dynamics/test_default_rows.py``, ``test_one_row.py``.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .commands import Commands
    from .integrators.integrator import History

BLOCK = 0.1
"""Time that a block of rows should take [s]: between two blocks a run can be interrupted and reports its progress.
"""
FEW_CORNERS = 20
"""Number of corners of tables up to which nothing is reported, since they cost little."""
FEW, COMPARED = 10, 20
"""Number of rows below which run and step refinement are compared between rows as well; approximate number of times for
this comparison."""
ROW, ROW_CELL, FRAME, FRAME_CELL = 1e-5, 1e-8, 2e-3, 1e-6
"""CPU time of a row, of a row per element, of a frame, and of a frame per element [s], by nets of 1 and 5165
elements."""
MOST_ROWS = 10_000
"""Largest number of rows of a block."""


class Schedule(NamedTuple):
    """Times of the history rows and frames of a run.

    Attributes
    ----------
    times : ndarray, shape (rows,)
        Times of the history rows [s].
    frames : ndarray of int
        Numbers of the rows with frames; at least the last row.
    between : ndarray
        Times between rows at which a run is compared with its step refinement [s]; empty if there are many rows. Steps
        end there in any case, so that the comparison does not change the run.
    commands : refweb.dynamics.commands.Commands, optional
        Commands of the run.
    """

    times: np.ndarray
    frames: np.ndarray
    between: np.ndarray = np.zeros(0)
    commands: Commands | None = None

    def reset(self):
        """Give what commands set the values of the scene, before a run starts."""
        if self.commands is not None:
            self.commands.reset()

    @classmethod
    def of(cls, scene):
        """Make the schedule of a scene: the rows of its interval, and a frame every ``frames`` rows and at the end."""
        times = row_times(scene)
        frames = np.unique(np.append(np.arange(0, len(times), scene.output.frames), len(times) - 1))
        return cls(times, frames, times_between(times))


class Counts(NamedTuple):
    """Numbers of rows and frames of a run."""

    rows: int
    frames: int
    refined_rows: int

    @classmethod
    def of(cls, scene):
        """Count history rows, frames, and rows of the step-refinement run, which has equally many or none."""
        interval, duration = scene.output.interval, scene.solve.duration
        whole_rows = int(math.floor(duration / interval * (1.0 + 1e-12)))
        rows = whole_rows + 1 + (duration - whole_rows * interval > 1e-9 * interval)
        frames = -(-rows // scene.output.frames) + ((rows - 1) % scene.output.frames != 0)
        return cls(rows, frames, rows if scene.accuracy.error == "twin" else 0)

    def text(self, scene):
        """The counts as text, with the output interval."""
        interval, every = scene.output.interval, scene.output.frames
        text = f"{self.rows} rows, one each {interval:.6g} s; {self.frames} frames, one each {every * interval:.6g} s"
        return text + (f"; {self.refined_rows} rows of the step-refinement run" if self.refined_rows else "")

    def seconds(self, cells):
        """Estimate the CPU time of rows and frames of a web of so many elements [s]."""
        frames = self.frames * (FRAME + FRAME_CELL * cells)
        return frames + (self.rows + self.refined_rows) * (ROW + ROW_CELL * cells)


def row_times(scene) -> NDArray[np.float64]:
    """Times of the history rows [s]: multiples of the interval, and the end."""
    interval, duration = scene.output.interval, scene.solve.duration
    count = int(math.floor(duration / interval * (1.0 + 1e-12)))
    times: NDArray[np.float64] = interval * np.arange(count + 1)
    if duration - times[-1] > 1e-9 * interval:
        return np.append(times, duration)
    times[-1] = duration
    return times


def time_of(t, end):
    """The time that a run has come to [s], in words."""
    return f"t = {t:.4g} of {end:.4g} s"


def times_between(times):
    """Times that divide the intervals of fewer than `FEW` rows into about `COMPARED` equal parts [s]."""
    parts = -(-COMPARED // max(len(times) - 1, 1)) if len(times) <= FEW else 1
    shares = np.arange(1, parts) / parts
    return (times[:-1, None] + shares * np.diff(times)[:, None]).ravel()


def spans_of(scene, system):
    """Times between rows, times of the comparison with a step refinement and corners of tables [s], in their order."""
    rows, corners = row_times(scene), system.corners
    corners = corners[(corners > 0.0) & (corners < rows[-1])]
    return np.diff(np.union1d(np.union1d(rows, times_between(rows)), corners))


class Block(NamedTuple):
    """Rows of one call of an integrator.

    Attributes
    ----------
    first : int
        Number of the first row.
    history : refweb.dynamics.integrators.integrator.History
        All rows of the block.
    compared : refweb.dynamics.integrators.integrator.History
        The same rows and, if rows are few, the times between them.
    """

    first: int
    history: History
    compared: History


def times_of(schedule, time, first, stop):
    """Times to which an integrator goes for the rows from ``first`` to ``stop`` − 1 from a time on [s]."""
    rows = schedule.times[first:stop]
    if not len(schedule.between):
        return rows
    between = schedule.between[(schedule.between > time) & (schedule.between < rows[-1])]
    return np.sort(np.concatenate([rows, between]))


def block_of(schedule, first, stop, compared):
    """The `Block` of the rows from ``first`` to ``stop`` − 1, from the `History` at their `times_of`."""
    rows, history = schedule.times[first:stop], compared
    if len(schedule.between):
        selected = np.isin(compared.time, rows)
        selected[-1:] = True  # where an event ends the run, its row is that of the event
        history = compared[selected]
    return Block(first, history, compared)


def blocks(integrator, course, schedule, first=0):
    """Advance through the times of a schedule in blocks of about `BLOCK` seconds, which end at each frame.

    Parameters
    ----------
    integrator : refweb.dynamics.integrators.integrator.Integrator
        The integrator.
    course : refweb.dynamics.integrators.integrator.IntegratorState
        The state of its run.
    schedule : Schedule
        Times of rows and frames.
    first : int
        Number of the next row.

    Yields
    ------
    Block
        Until the end, or an event that ends the run.

    Raises
    ------
    refweb.errors.EnergyDriftError
        At the end, if the energy drift of the run exceeds its limit.
    """
    times, size, commands = schedule.times, 1, schedule.commands
    while first < len(times):
        stop = schedule.frames[np.searchsorted(schedule.frames, first)]
        if commands is not None:
            stop = min(stop, commands.until(first))
        count, began = min(size, stop + 1 - first), time.perf_counter()
        compared = integrator.advance(course, times_of(schedule, course.time, first, first + count))
        block = block_of(schedule, first, first + count, compared)
        yield block
        first += count
        if commands is not None:
            commands.act(first - 1, integrator, course, block.history)
        spent = time.perf_counter() - began
        size = max(1, min(2 * size if spent < 0.5 * BLOCK else int(size * BLOCK / spent), MOST_ROWS))
        if course.stopped:
            break
    integrator.refuse_drift(course)
