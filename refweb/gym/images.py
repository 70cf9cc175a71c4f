"""Images of an environment, by the renderer of pictures off screen.

The camera stays for an episode while the scene is within its view, and is moved back where it leaves that. May change:
`MARGIN`, `LOOK`, with one view, and the camera. Must stay: an array of uint8, shape (height, width, 3), which
`environment` returns; `close`, which ends the process that draws; public names of `Images`, which other files use.
Tests: ``tests/gym/test_environment.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..pictures.camera import WHOLE
from ..pictures.frames import frame_of
from ..pictures.model import COARSE
from ..pictures.polygons import flat_images
from ..pictures.render import Renderer
from ..pictures.stage import Look, Seen, Stage
from ..results.vtu import meshes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..results.state import State

MARGIN = 1.6
"""Factor by which a view is wider than what is in it at first."""
LOOK = Look("slack", (0.0, 1.0), view="oblique")
"""Taut and slack lines in two colours, in one view."""


class Images:
    """Draws states of one environment.

    Parameters
    ----------
    size : (int, int)
        Width and height [pixel].
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._size = size
        self._stage: Any = None
        self._renderer: Any = None

    def forget(self) -> None:
        """Choose another camera with the next image, for another episode."""
        self._stage = None

    def image(self, state: State) -> NDArray[np.uint8]:
        """The image of a state, shape (height, width, 3)."""
        net = state.system.net
        supported = state.system.fixed[: net.nodes].any(axis=1)
        frame = frame_of(0, state.time, meshes(state), supported, net.point_mass)
        points = np.concatenate([frame.paths.reshape(-1, 3), *(body.points for body in frame.bodies.values())])
        stage = self._stage
        if stage is None or not self._within(points):
            stage = self._place_camera(frame)
        model, views, sizes = stage.model(frame), stage.views, [self._size]
        (image,) = self._renderer.images(model) or flat_images(model, views, sizes)
        return image

    def _within(self, points):
        """True if points are within the view."""
        (view,) = self._stage.views
        return bool((np.abs(view.project(points)[0] - view.offset) <= view.half).all())

    def _place_camera(self, frame):
        """Choose the view of a frame, start a renderer with it, and return the stage."""
        self.close()
        width, height = self._size
        stage = Stage.of(Seen.of(frame, LOOK.field), LOOK, width / height * WHOLE[3] / WHOLE[2])
        self._stage = replace(stage, views=[view.wider(MARGIN) for view in stage.views])
        self._renderer = Renderer(self._stage.views, [self._size], COARSE)
        return self._stage

    def close(self) -> None:
        """End the process that draws."""
        if self._renderer is not None:
            self._renderer.__exit__()
            self._renderer = None
