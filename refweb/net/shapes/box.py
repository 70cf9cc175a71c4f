"""Boxes with rounded edges."""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...messages import shown
from ...tables import Several, real, rows, table, vector
from ..rigid_body import Grown, Shape, unit
from .rounding import check_rounding, edge_radius, shrunk


@table
class Box(Shape):
    """A box.

    Parameters
    ----------
    size : sequence of 3 float
        Its edges [m], > 0.
    axes : list of 2 vectors, optional
        Directions of the first two edges, at right angles; by default x and y. Not with ``orientation``.
    rounding : float, optional
        Radius of the edges [m], > 0, by default 2 % of the smallest size; see `refweb.net.grown_core`.

    Examples
    --------
        [[body]]
        name = "deck"
        shape = "box"
        size = [2.0, 2.0, 0.1]
        position = [0.0, 0.0, -0.2]
        fixed = true
    """

    free = True

    size: Several = vector(unit="m")
    axes: Several = rows(3, default=None)
    rounding: float | None = real(default=None, above=0, unit="m")

    def check(self):
        """Refuse sizes that are not > 0, axes that are not two at right angles and a rounding that is too large."""
        if min(self.size) <= 0.0:
            raise InputError(f"size = {list(self.size)} must be > 0 [m]")
        self.frame()
        check_rounding(self.rounding, self.size)

    def grown(self):
        """A smaller box, grown by the radius of the edges."""
        edge = edge_radius(self.rounding, self.size)
        return Grown(edge, shrunk(self.size, edge))

    def frame(self):
        """Unit vectors of its edges."""
        if self.axes is None:
            return np.eye(3)
        if len(self.axes) != 2:
            raise InputError(f"axes = {shown(self.axes)} must be two vectors, not {len(self.axes)}")
        first, second = (unit(f"axes[{i}]", axis) for i, axis in enumerate(self.axes))
        if abs(first @ second) > 1e-6:
            raise InputError(f"axes = {shown(self.axes)} must be at right angles")
        second = unit("axes", second - (first @ second) * first)
        return np.array([first, second, np.cross(first, second)])
