"""Progress of a run: a bar in a terminal, a line in a notebook, and a line now and then where there is neither.

May change: `DELAY`, `APART`, `EVERY`, `BEGUN`, private functions and texts. Must stay: `followed` and the call
``tell(text, share)`` that it yields, which `runner` and verbs pass on; a phase is known by its text without numbers,
before the first comma; `duration`, which `sweeps.sweep` imports. Tests: ``tests/results/test_loaded.py``.
"""

from __future__ import annotations

import contextlib
import re
import sys
import threading
import time

from ..compiled import watched

DELAY = 2.0
"""Time after which progress is shown [s]."""
APART = 0.5
"""Least time between two texts in a notebook [s]."""
EVERY = 10.0
"""Time between two lines where there is neither a terminal nor a notebook [s]."""
BEGUN = 0.02
"""Share of a phase behind which the time that it still takes is estimated."""
LOADING = "loading"


@contextlib.contextmanager
def followed(progress, text=LOADING):
    """Show the progress of a run in a terminal or notebook while the block runs.

    Parameters
    ----------
    progress : bool, None or callable
        A callable is called itself, with a line of text and the share of its phase that is done, 0 to 1. True shows it
        in a terminal and in a notebook, and elsewhere as a line of the error stream every `EVERY`; False and None show
        nothing.
    text : str
        First text.

    Yields
    ------
    callable
    """
    if not progress:
        yield lambda text, share: None
        return
    if callable(progress):
        display = contextlib.nullcontext(progress)
    else:
        display = _bar(text) if sys.stderr.isatty() else _line() if _in_notebook() else _lines()
    with display as tell, _compiling(tell):
        yield tell


def _compiling(tell):
    """Show the number of kernels that are compiled."""
    return watched(lambda done, count: tell(f"compiling {done + 1} of {count}, the first time", done / count))


class RemainingTime:
    """Estimate of the time that a phase still takes: as what is left of it to what is done since it was first seen.

    A phase is what texts say before their first comma, numbers apart.
    """

    def __init__(self, clock=time.monotonic):
        self._clock, self._phase, self._began, self._first, self._last = clock, "", 0.0, 0.0, 0.0

    def added_to(self, text, share):
        """The text with the time that is left, where it is known and not said already."""
        phase, now = re.sub(r"[-+.\de]*\d", "", text.partition(",")[0]), self._clock()
        if phase != self._phase or share < self._last:
            self._phase, self._began, self._first = phase, now, share
        self._last = share
        if share - self._first < BEGUN or share >= 1.0 or text.endswith(" left"):
            return text
        return f"{text}, {duration((now - self._began) * (1.0 - share) / (share - self._first))} left"


def duration(seconds):
    """A time in words."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def _in_notebook():
    """Tell if this is the kernel of a notebook."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return shell is not None and hasattr(shell, "kernel")


@contextlib.contextmanager
def _bar(text):
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    bar = Progress(
        BarColumn(bar_width=20),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
        console=Console(stderr=True),
        transient=True,
    )
    task = bar.add_task(text, total=1.0)
    timer = threading.Timer(DELAY, bar.start)
    timer.daemon = True
    timer.start()
    try:
        remaining = RemainingTime()
        yield lambda text, share: bar.update(task, description=remaining.added_to(text, share), completed=share)
    finally:
        timer.cancel()
        bar.stop()


@contextlib.contextmanager
def _line():
    """A line that is overwritten, and empty at the end."""
    last = time.perf_counter() + DELAY - APART
    width, remaining = 0, RemainingTime()

    def tell(text, share):
        nonlocal last, width
        text = remaining.added_to(text, share)
        if time.perf_counter() > last + APART:
            line = f"{100.0 * share:3.0f} %  {text}"
            print(f"\r{line:<{width}}", end="", file=sys.stderr, flush=True)
            last, width = time.perf_counter(), max(width, len(line))

    try:
        yield tell
    finally:
        if width:
            print("\r" + " " * width + "\r", end="", file=sys.stderr, flush=True)


@contextlib.contextmanager
def _lines():
    """A line every `EVERY`, of what was last told: for logs and pipes."""
    latest, ended, remaining = f"  0 %  {LOADING}", threading.Event(), RemainingTime()

    def tell(text, share):
        nonlocal latest
        latest = f"{100.0 * share:3.0f} %  {remaining.added_to(text, share)}"

    def show():
        while not ended.wait(EVERY):
            with contextlib.suppress(OSError, ValueError):  # nobody reads the stream any more
                print(latest, file=sys.stderr, flush=True)

    thread = threading.Thread(target=show, daemon=True)
    thread.start()
    try:
        yield tell
    finally:
        ended.set()
        thread.join()
