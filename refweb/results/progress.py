"""Progress of a run: a bar in a terminal, a line in a notebook."""

from __future__ import annotations

import contextlib
import sys
import threading
import time

from ..compiled import watched

DELAY = 2.0
"""Time after which progress is shown [s]."""
APART = 0.5
"""Least time between two texts in a notebook [s]."""
LOADING = "loading"


@contextlib.contextmanager
def followed(progress, text=LOADING):
    """Show the progress of a run in a terminal or notebook while the block runs.

    Parameters
    ----------
    progress : bool, None or callable
        A callable is called with a line of text and the finished share, 0 to 1. True shows the progress in a terminal
        or a notebook, and nowhere else. False and None show nothing.
    text : str
        First text.

    Yields
    ------
    callable
    """
    if callable(progress):
        with _compiling(progress):
            yield progress
    elif progress and sys.stderr.isatty():
        with _bar(text) as tell, _compiling(tell):
            yield tell
    elif progress and _in_notebook():
        with _line() as tell, _compiling(tell):
            yield tell
    else:
        yield lambda text, share: None


def _compiling(tell):
    """Show the number of kernels that are compiled."""
    return watched(lambda done, count: tell(f"compiling {done + 1} of {count}, the first time", done / count))


def _in_notebook():
    """Tell if this is the kernel of a notebook."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return shell is not None and hasattr(shell, "kernel")


@contextlib.contextmanager
def _bar(text):
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    bar = Progress(
        BarColumn(),
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
        yield lambda text, share: bar.update(task, description=text, completed=share)
    finally:
        timer.cancel()
        bar.stop()


@contextlib.contextmanager
def _line():
    """A line that is overwritten, and empty at the end."""
    last = time.perf_counter() + DELAY - APART
    width = 0

    def tell(text, share):
        nonlocal last, width
        if time.perf_counter() > last + APART:
            line = f"{100.0 * share:3.0f} %  {text}"
            print(f"\r{line:<{width}}", end="", file=sys.stderr, flush=True)
            last, width = time.perf_counter(), max(width, len(line))

    try:
        yield tell
    finally:
        if width:
            print("\r" + " " * width + "\r", end="", file=sys.stderr, flush=True)
