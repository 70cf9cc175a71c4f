"""Spheres: points grown by a radius.

May change: nothing of what `grown` returns. Must stay: keys and docstring of `Sphere` (scene format and help; after a
change write ``validation/REFERENCE.md`` anew); ``once``, by which contact acts once a line and not once an element; the
class name, which `registry.SHAPES` and `effects.around.KINDS` have. Tests: ``tests/effects/test_contact.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...tables import real, table
from ..rigid_body import Grown, Shape

if TYPE_CHECKING:
    from numpy.typing import NDArray


@table
class Sphere(Shape):
    """A sphere.

    Parameters
    ----------
    radius : float
        Its radius [m], > 0.

    Examples
    --------
        [[body]]
        name = "post"
        shape = "sphere"
        radius = 0.1
        position = [0.0, 0.0, -0.11]
        fixed = true
    """

    free = True
    once = True

    radius: float = real(above=0, unit="m")

    def grown(self) -> Grown:
        """A point, grown by the radius."""
        return Grown(self.radius, (0.0, 0.0, 0.0))

    def skeleton(self) -> NDArray[Any]:
        """Its centre."""
        from ..skeleton import of_box

        return of_box(self.grown())

    def inertia(self, mass: float) -> NDArray[np.float64]:
        """Moments of inertia of a solid sphere, 2/5 m r²."""
        return 0.4 * mass * self.radius**2 * np.eye(3)
