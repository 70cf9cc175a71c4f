"""Cylinders with rounded edges.

May change: texts of errors. Must stay: keys and docstring of `Cylinder` (scene format and help; after a change write
``validation/REFERENCE.md`` anew); what `grown` and `skeleton` return, on which contact, mass and bounds rest; the class
name, which `registry.SHAPES` and `effects.around.KINDS` have. Tests: ``tests/effects/test_contact.py``,
``tests/effects/test_between_bodies.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...tables import Several, real, table, vector
from ..rigid_body import Grown, Shape
from .rounding import check_rounding, edge_radius, shrunk

if TYPE_CHECKING:
    from numpy.typing import NDArray


@table
class Cylinder(Shape):
    """A cylinder; its axis is its third direction.

    Parameters
    ----------
    radius : float
        Its radius [m], > 0.
    length : float
        Its length [m], > 0.
    axis : sequence of 3 float
        Its axis; not with ``orientation``.
    rounding : float, optional
        Radius of the edges [m], > 0, by default 2 % of the smallest size; see `refweb.net.grown_core`.

    Examples
    --------
        [[body]]
        name = "mast"
        shape = "cylinder"
        radius = 0.1
        length = 1.0
        axis = [0.0, 1.0, 0.0]
        position = [0.0, 0.0, -0.2]
        fixed = true
    """

    free = True

    radius: float = real(above=0, unit="m")
    length: float = real(above=0, unit="m")
    axis: Several = vector(default=None)
    rounding: float | None = real(default=None, above=0, unit="m")

    def check(self) -> None:
        """Refuse an axis that is zero and a rounding that is too large."""
        super().check()
        check_rounding(self.rounding, self._sizes())

    def _sizes(self):
        return 2.0 * self.radius, 2.0 * self.radius, self.length

    def grown(self) -> Grown:
        """A smaller cylinder, grown by the radius of the edges."""
        edge = edge_radius(self.rounding, self._sizes())
        return Grown(edge, shrunk(self._sizes(), edge), round=True)

    def skeleton(self) -> NDArray[Any]:
        """The rims of its core, and its axis."""
        from ..skeleton import of_cylinder

        return of_cylinder(self.grown())

    def farthest(self, normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of the core, on the circles at its ends."""
        side = np.sign(normals)
        around = np.linalg.norm(normals[:, :2], axis=1, keepdims=True)
        side[:, :2] = normals[:, :2] / np.where(around > 0.0, around, 1.0)
        return side * self.grown().core
