"""Tubes, balls and surfaces seen through cameras, as images by OpenGL off screen.

OpenGL libraries that are missing or broken end a process instead of raising an exception, and they write to the
terminal. A `Renderer` therefore renders in a child process, see `refweb.pictures.opengl`, which it keeps for all
frames of a film, tries each kind of off-screen window in turn and gives None if none works;
`refweb.pictures.polygons` then draws the same model through the same `refweb.pictures.camera.View`.
"""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import subprocess
import sys
import tempfile
import threading
from dataclasses import dataclass
from typing import Any

import numpy as np

SECONDS_TO_START, SECONDS_PER_FRAME = 60.0, 60.0
"""Longest that a child may take [s]."""
FINE, COARSE = 10, 6
"""Sides of a tube in a picture, and in a film."""


@dataclass(frozen=True)
class Tubes:
    """Lines: paths [m], shape (lines, points, 3); colours in 0…1, shape (lines, 3); radius [m], one or (lines,)."""

    paths: np.ndarray
    colours: np.ndarray
    radius: float | np.ndarray


@dataclass(frozen=True)
class Balls:
    """Markers: centres [m], shape (balls, 3); one colour in 0…1; radius [m]."""

    centres: np.ndarray
    colour: tuple
    radius: float


@dataclass(frozen=True)
class Surface:
    """A body: points [m], shape (points, 3); triangles, shape (triangles, 3); one colour in 0…1."""

    points: np.ndarray
    triangles: np.ndarray
    colour: tuple


def windows():
    """Kinds of window to try, as (VTK class or None for its default, whether it may use the display)."""
    if not sys.platform.startswith("linux"):
        return [(None, True)]
    display = [("vtkXOpenGLRenderWindow", True)] if os.environ.get("DISPLAY") else []
    return [("vtkEGLRenderWindow", False), ("vtkOSOpenGLRenderWindow", False), *display]


def images(models, views, sizes):
    """Each model in each view.

    Parameters
    ----------
    models : list of lists of `Tubes`, `Balls` and `Surface`
        One list per instant.
    views : list of `refweb.pictures.camera.View`
    sizes : list of (width, height)
        Size of each view [pixel].

    Returns
    -------
    list of lists of ndarray, or None
        RGB, shape (height, width, 3), uint8, of each view of each model; None where OpenGL is not to be had.
    """
    with Renderer(views, sizes) as renderer:
        drawn_images = []
        for model in models:
            drawn_images.append(renderer.images(model))
            if drawn_images[-1] is None:
                return None
    return drawn_images


class Renderer:
    """A child process with one window, which renders one model after the other.

    Parameters
    ----------
    views, sizes
        As for `images`.
    sides : int
        Of a tube.
    """

    def __init__(self, views, sizes, sides=FINE):
        self._job = (views, sizes, sides)
        self._kinds = windows()
        self._child: Any = None
        self._said: Any = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._end()

    def images(self, model):
        """A model in each view, RGB, shape (height, width, 3), uint8; None where OpenGL is not to be had."""
        while self._child is not None or self._kinds:
            try:
                if self._child is None:
                    self._start(*self._kinds.pop(0))
                    return self._answer(SECONDS_TO_START + SECONDS_PER_FRAME, self._job, model)
                return self._answer(SECONDS_PER_FRAME, model)
            except (OSError, EOFError, pickle.UnpicklingError) as error:
                logging.getLogger(__name__).info(
                    "OpenGL cannot be used: %s", self._last_words() or type(error).__name__
                )
                self._end()
        return None

    def _start(self, window, display):
        """Start a child; what OpenGL writes goes to a file."""
        environment = {k: v for k, v in os.environ.items() if display or k not in ("DISPLAY", "WAYLAND_DISPLAY")}
        if window:
            environment["VTK_DEFAULT_OPENGL_WINDOW"] = window
        path = [os.path.abspath(p) for p in sys.path]
        code = f"import sys; sys.path[:] = {path!r}; from {__package__}.opengl import serve; serve()"
        self._said = tempfile.TemporaryFile(prefix="refweb-")
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": self._said}
        self._child = subprocess.Popen(
            [sys.executable or "python3", "-c", code], cwd=tempfile.gettempdir(), env=environment, **pipes
        )

    def _answer(self, seconds, *sent):
        """Reply of the child process; it is killed where it takes longer."""
        limit = threading.Timer(seconds, self._child.kill)
        limit.start()
        try:
            for item in sent:
                pickle.dump(item, self._child.stdin, protocol=5)
            self._child.stdin.flush()
            return pickle.load(self._child.stdout)
        finally:
            limit.cancel()

    def _last_words(self):
        """The last line that the child has written."""
        self._child.wait()
        self._said.seek(0)
        return self._said.read().decode(errors="replace").strip().rpartition("\n")[2]

    def _end(self):
        if self._child is not None:
            self._child.kill()
            for pipe in (self._child.stdin, self._child.stdout, self._said):
                with contextlib.suppress(OSError):
                    pipe.close()
            self._child.wait()
        self._child = None
