"""Images of models by pyvista off screen, in a child process; input are models, views and sizes.

VTK 9.7, the library below pyvista, needs libEGL, libOSMesa or a display. On a server without any of them it ends the
process with a segmentation fault. A `Renderer` therefore renders in a child process, see `refweb.pictures.opengl`,
which it keeps for all frames of a film. It tries each kind of off-screen window in turn and returns None if none works.
`refweb.pictures.polygons` then draws the same model with the same `refweb.pictures.camera.View`.

May change: `SECONDS_PER_FRAME` and the order of windows. Must stay: None as the answer where nothing can be rendered,
as `pictures`, `film` and `gym.images` then draw by `polygons`; the child process, since VTK may end its process. Tests:
``tests/pictures/test_pictures.py``.
"""

from __future__ import annotations

import itertools
import logging
import os
import sys
from typing import Any

from .model import FINE

SECONDS_PER_FRAME = 120.0
"""Longest time of a child for an image, with its start [s]."""


def windows():
    """Kinds of window to try: VTK class, or None for the default, and True if it may use the display."""
    if not sys.platform.startswith("linux"):
        return [(None, True)]
    display = [("vtkXOpenGLRenderWindow", True)] if os.environ.get("DISPLAY") else []
    return [("vtkEGLRenderWindow", False), ("vtkOSOpenGLRenderWindow", False), *display]


def images(models, views, sizes):
    """Each model, a list of `Tubes`, `Balls` and `Surface`, in each view: lists as `Renderer.images` gives them.

    None where OpenGL is not to be had.
    """
    with Renderer(views, sizes) as renderer:
        drawn = list(itertools.takewhile(lambda images: images is not None, map(renderer.images, models)))
    return drawn if len(drawn) == len(models) else None


class Renderer:
    """A child process with one window, which renders one model after the other.

    ``views`` are each a `refweb.pictures.camera.View`, ``sizes`` their (width, height) [pixel], and a tube has so many
    ``sides``.
    """

    def __init__(self, views, sizes, sides=FINE):
        self._job = (views, sizes, sides)
        self._kinds = windows()
        self._child: Any = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._end()

    def images(self, model):
        """A model in each view, RGB, shape (height, width, 3), uint8; None where OpenGL is not to be had."""
        from concurrent.futures import BrokenExecutor

        from .opengl import images

        while self._child is not None or self._kinds:
            if self._child is None:
                self._child = self.start_child(*self._kinds.pop(0))
            try:
                return self._child.submit(images, model).result(SECONDS_PER_FRAME)
            except (OSError, BrokenExecutor, TimeoutError) as error:
                words = str(error).partition("\n")[0] or type(error).__name__
                logging.getLogger(__name__).info("OpenGL cannot be used: %s", words)
                self._end()
        return None

    def start_child(self, window, display):
        """Start a child, an executor of one process."""
        from loky import ProcessPoolExecutor

        from .opengl import open_off_screen

        environment = {} if display else {"DISPLAY": "", "WAYLAND_DISPLAY": ""}
        if window:
            environment["VTK_DEFAULT_OPENGL_WINDOW"] = window
        return ProcessPoolExecutor(1, initializer=open_off_screen, initargs=self._job, env=environment)

    def _end(self):
        if self._child is not None:
            self._child.shutdown(kill_workers=True)
        self._child = None
