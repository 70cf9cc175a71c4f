"""Rings: rigid circles; a web in the plane of a ring touches it as a disc.

May change: `TUBE`, which is for pictures alone. Must stay: keys and docstring of `Ring` (scene format and help; after a
change write ``validation/REFERENCE.md`` anew); ``planar``, by which `rigid_body` gives it one row of rotation; the
class name, which `registry.SHAPES` and `effects.around.KINDS` have. Tests: ``tests/effects/test_contact.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ...tables import Several, real, table, vector
from ..rigid_body import Grown, Shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

TUBE = 0.04
"""Thickness of the tube that is drawn for a ring, over its radius."""


@table
class Ring(Shape):
    """A ring; it is infinite along its normal, its third direction. It keeps its plane: it turns about its normal only.

    Parameters
    ----------
    radius : float
        Its radius [m], > 0.
    normal : sequence of 3 float
        Its normal.

    Examples
    --------
        [[body]]
        name = "ring"
        shape = "ring"
        radius = 0.08
        normal = [0.0, 1.0, 0.0]
        mass = 1.0
        position = [0.0, 0.0, -0.1]
    """

    free = True
    planar = True

    radius: float = real(above=0, unit="m")
    normal: Several = vector()

    def grown(self) -> Grown:
        """Its axis, grown by the radius."""
        return Grown(self.radius, (0.0, 0.0, math.inf))

    def skeleton(self) -> NDArray[Any] | None:
        """The circle."""
        from ..skeleton import rim

        return rim(self.radius, 0.0, 0.0)

    def volume(self) -> None:
        """None: it has no thickness."""
        raise InputError('density has no meaning for shape = "ring", which has no thickness: give mass = ... [kg]')

    def inertia(self, mass: float) -> NDArray[np.float64]:
        """Moments of inertia of a thin ring: m r² about its normal and half of it across."""
        about = mass * self.radius**2
        return np.diag([0.5 * about, 0.5 * about, about])

    def refuse_turning(self, angular_velocity: Sequence[float]) -> None:
        """Refuse to turn about another axis than the normal."""
        across = np.linalg.norm(np.cross(angular_velocity, self.normal))
        if across > 1e-9 * np.linalg.norm(angular_velocity) * np.linalg.norm(self.normal):
            raise InputError(f"angular_velocity = {list(angular_velocity)} must be along the normal of the ring")

    def boundary(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """A thin tube whose outer edge has the radius."""
        from ..surfaces import tube

        return tube(self.radius, TUBE * self.radius)
