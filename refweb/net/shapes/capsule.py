"""Capsules: straight lines grown by a radius.

May change: texts of errors. Must stay: keys and docstring of `Capsule` (scene format and help; after a change write
``validation/REFERENCE.md`` anew); what `grown` and `skeleton` return, on which contact, mass and bounds rest; the class
name in `registry.SHAPES`. Tests: ``tests/effects/test_contact.py``, ``tests/effects/test_between_bodies.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...tables import Several, real, table, vector
from ..rigid_body import Grown, Shape

if TYPE_CHECKING:
    from numpy.typing import NDArray


@table
class Capsule(Shape):
    """A cylinder that ends in half spheres of its own radius; its axis is its third direction.

    Parameters
    ----------
    radius : float
        Its radius [m], > 0.
    length : float
        Distance of the centres of its half spheres [m], > 0; the total length is larger by two radii.
    axis : sequence of 3 float
        Its axis; not with ``orientation``.

    Examples
    --------
        [[body]]
        name = "tank"
        shape = "capsule"
        radius = 0.2
        length = 0.6
        axis = [0.0, 1.0, 0.0]
        position = [0.0, 0.0, -0.3]
        fixed = true
    """

    free = True

    radius: float = real(above=0, unit="m")
    length: float = real(above=0, unit="m")
    axis: Several = vector(default=None)

    def grown(self) -> Grown:
        """Its axis, grown by the radius."""
        return Grown(self.radius, (0.0, 0.0, 0.5 * self.length))

    def skeleton(self) -> NDArray[Any]:
        """Its axis."""
        from ..skeleton import of_box

        return of_box(self.grown())
