"""Planes: half spaces of ground.

May change: the square that is drawn. Must stay: keys and docstring of `Plane` (scene format and help; after a change
write ``validation/REFERENCE.md`` anew); the infinite extent and thickness that follow from `grown`, by which checks of
contact know ground; the class name in `registry.SHAPES`. Tests: ``tests/effects/test_ground.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ...kernels import kernel
from ...tables import Several, real, table, vector
from ..rigid_body import Grown, Shape

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel()
def depth(p, grown):
    """Distance behind the plane, as `refweb.net.grown_core.depth`, of a body that is thicker by ``grown.radius``."""
    return grown.radius - p[2], (0.0, 0.0, -1.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@table
class Plane(Shape):
    """All that lies behind a plane through the position, such as level ground; it is fixed.

    If the stiffness of contact is not given, it is chosen for an overlap of 2 % of the shortest line, since a plane has
    no size. Nothing passes through it at any depth.

    Parameters
    ----------
    normal : sequence of 3 float
        Direction away from the ground.
    drawn : float
        Edge of the square that is drawn about the position [m], > 0.

    Examples
    --------
        [[body]]
        name = "floor"
        shape = "plane"
        normal = [0.0, 0.0, 1.0]
        position = [0.0, 0.0, -0.2]
        fixed = true
    """

    ground = True

    normal: Several = vector(default=None)
    drawn: float = real(default=2.0, above=0, unit="m")

    def grown(self) -> Grown:
        """An infinite box."""
        return Grown(0.0, (math.inf, math.inf, math.inf))

    def depth(self) -> Any:
        """Kernel of the distance behind it."""
        return depth

    def skeleton(self) -> NDArray[Any] | None:
        """No parts: other bodies touch it with their parts."""
        from ..skeleton import PART

        return np.zeros(0, PART)

    def volume(self) -> None:
        """None: it has no end."""
        raise InputError('density has no meaning for shape = "plane", which has no end: leave it out')

    def boundary(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """A square."""
        corners = 0.5 * self.drawn * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
        return corners, np.array([[0, 1, 2], [0, 2, 3]])
