"""Boxes with rounded edges.

May change: texts of errors. Must stay: keys and docstring of `Box` (scene format and help; after a change write
``validation/REFERENCE.md`` anew); what `grown` and `skeleton` return, on which contact, mass and bounds rest; the class
name in `registry.SHAPES`. Tests: ``tests/effects/test_contact.py``, ``tests/effects/test_between_bodies.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...errors import InputError
from ...tables import Several, real, rows, table, vector
from ..rigid_body import Grown, Shape
from .rounding import check_rounding, edge_radius, shrunk

if TYPE_CHECKING:
    from numpy.typing import NDArray


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

    def check(self) -> None:
        """Refuse sizes that are not > 0, axes that are not at right angles, and a rounding that is too large."""
        if min(self.size) <= 0.0:
            raise InputError(f"size = {list(self.size)} must be > 0 [m]")
        super().check()
        check_rounding(self.rounding, self.size)

    def grown(self) -> Grown:
        """A smaller box, grown by the radius of the edges."""
        edge = edge_radius(self.rounding, self.size)
        return Grown(edge, shrunk(self.size, edge))

    def skeleton(self) -> NDArray[Any]:
        """The edges of its core."""
        from ..skeleton import of_box

        return of_box(self.grown())
