"""Bodies with depth on a grid: solids inside a surface of triangles.

May change: texts of errors, and `MOST`, a limit of what is accepted. Must stay: fields of `Solid`, which `mesh` and
`terrain` fill; ``file_key``, ``made`` and ``axes`` as what a subclass gives, and the life of ``solid``, since kernels
read its field by address. `GRID`, `WIDE` and `WALL` change depth, so contact of all meshes and terrains. Must stay as
well: `Filled` and `field_in`, which `mesh` and `terrain` import. Tests: ``tests/effects/test_mesh_bodies.py``,
``tests/net/test_boundary.py``.
"""

from __future__ import annotations

import functools
import hashlib
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from ...errors import InputError, refused_at
from ...messages import quote
from ...tables import Several
from ..rigid_body import Grown, Shape

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

GRID = 48
"""Number of cells of the grid along the longest side, by default and if no wall is too thin."""
WIDE = 96
"""Number of cells of a wider grid, for contact with thicker bodies; far from a surface the depth is smooth."""
WALL = 2.0
"""Least number of cells from the middle of a wall to its surface."""
MOST = 4_000_000
"""Largest number of points of a chosen grid."""


class Solid(NamedTuple):
    """Solid of a file, about the origin of the body.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Corners [m].
    triangles : ndarray of int, shape (t, 3)
        Corners of each triangle, outward.
    centre : ndarray, shape (3,)
        Centre of mass, from the origin of the file [m].
    volume : float
        Volume [m³].
    inertia : ndarray, shape (3, 3)
        Moments for a density of 1 [m⁵].
    field : refweb.net.boundary.field.Field
        Depth in the solid.
    convex : bool
        True if the body is convex.
    remarks : tuple of str
        Faults of the surface.
    felt : tuple of ndarray, optional
        Corners and triangles of the boundary of a repaired solid, if they differ from ``points`` and ``triangles``.
    winding : refweb.net.boundary.winding.Winding, optional
        Decides which points are inside a repaired solid.
    error : float, optional
        Error of the field at the part of the surface that matters [m]; by default that of the field.
    """

    points: np.ndarray
    triangles: np.ndarray
    centre: np.ndarray
    volume: float
    inertia: np.ndarray
    field: Any
    convex: bool
    remarks: tuple[Any, ...]
    felt: tuple[Any, ...] | None = None
    winding: Any = None
    error: float | None = None


class Filled(Shape):
    """Shape of a body whose solid stands in the file that the key ``file_key`` names, with ``axes`` of the file.

    A subclass gives ``made``, which makes the `Solid` of a path; ``content`` tells files of one path apart in a cache.
    """

    file_key: ClassVar[str]
    axes: Several

    def made(self, path: Path, content: str) -> Solid:
        """The `Solid` of a file."""
        raise NotImplementedError

    @functools.cached_property
    def solid(self) -> Solid:
        """The `Solid`; refuses a file that cannot be read, and what ``made`` refuses."""
        given = getattr(self, self.file_key)
        path = Path(given)
        with refused_at(f"{self.file_key} = {quote(given)}:"):
            try:
                return self.made(path, hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "")
            except OSError as error:
                raise InputError(f"cannot be read: {error.strerror or error}") from None

    def settle(self) -> None:
        """Read the file."""
        _ = self.solid

    def to_dict(self) -> dict[str, Any]:
        """The table as plain TOML values, the file with its folder."""
        return {**super().to_dict(), self.file_key: str(Path(getattr(self, self.file_key)).absolute())}

    def grown(self) -> Grown:
        """Half sizes of the box around it, within its error, as core, and the address of its field."""
        field = self.solid.field
        size = tuple((np.abs(self.solid.points).max(axis=0) + field.error).tolist())
        return Grown(
            0.0, size, fine=math.inf if self.solid.convex else field.spacing, thick=field.thickness, field=field.address
        )

    @property
    def extent(self) -> float:
        """Largest distance from its centre to its surface, within its error [m]."""
        return float(np.linalg.norm(self.solid.points, axis=1).max()) + self.solid.field.error

    def volume(self) -> float:
        """Its volume [m³]."""
        return self.solid.volume

    def inertia(self, mass: float) -> NDArray[np.float64]:
        """Tensor of inertia of a uniform mass about its centre [kg m²], along its axes, shape (3, 3)."""
        return mass / self.solid.volume * self.solid.inertia

    def depth(self) -> Any:
        """Kernel of the depth by its field."""
        from ..boundary.field import depth

        return depth

    def skeleton(self) -> NDArray[Any] | None:
        """Its convex edges."""
        from ..skeleton import of_surface

        return of_surface(self.solid.points, self.solid.triangles)

    def touched(self, thickness: float) -> Grown:
        """Its field, or for thicker parts a wider field with `WIDE` cells along the longest side."""
        field, grown = self.solid.field, self.grown()
        if thickness <= field.margin:
            return grown
        from ..boundary.field import field_of

        wide = vars(self).setdefault("_wide", {})  # kept as long as this: kernels read it where it stands
        if thickness not in wide:
            points, triangles = self._felt
            size = float(np.ptp(points, axis=0).max())
            spacing = max((size + 2.0 * thickness) / WIDE, field.spacing)
            cells = max(int(np.ceil(size / spacing)), 1)
            around = int(np.ceil(1.1 * thickness * cells / size)) + 2
            wide[thickness] = field_of(points, triangles, cells, around, field, self.solid.winding)
        return grown._replace(field=wide[thickness].address)

    def boundary(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Its triangles."""
        return self.solid.points, self.solid.triangles

    def remarks(self) -> tuple[str, ...]:
        """Remarks on repairs of its file, and on walls that are thickened."""
        return *self.solid.remarks, *self._on_thin_walls()

    def _on_thin_walls(self):
        field = self.solid.field
        if field.offset > 0.0:
            cells = round(float(np.ptp(self._felt[0], axis=0).max()) / field.spacing)
            yield (
                f"some walls are thinner than {2.0 * WALL:g} cells of its grid, {2.0 * WALL * field.spacing:.2g} m: "
                f"the body is {field.offset:.2g} m thicker on all sides; grid = {2 * cells} takes half of that"
            )

    @property
    def _felt(self):
        """Corners and triangles of the boundary from which its field is made."""
        return self.solid.felt or (self.solid.points, self.solid.triangles)

    def texts(self) -> Iterator[str]:
        """Texts on its size, its centre of mass in the file, and the error of its field at the surface."""
        solid, field = self.solid, self.solid.field
        centre = ", ".join(f"{x:.4g}" for x in solid.centre)
        grid = " × ".join(map(str, field.counts))
        yield f"{len(solid.triangles)} triangles, {solid.volume:.4g} m³, centre of mass at ({centre}) m from its origin"
        yield f"surface within {self.error:.1e} m on a grid of {grid} points"

    @property
    def error(self) -> float | None:
        """Largest distance of the surface of contact from that of the file [m]."""
        return self.solid.field.error if self.solid.error is None else self.solid.error


def field_in(points, triangles, grid, winding=None, fewest=GRID):
    """The field of the solid inside a surface, with ``grid`` cells, or with enough for its walls, ``fewest`` at least.

    If walls are too thin for a given grid, or for the finest chosen one, the whole solid is grown by an offset: depth
    is still a distance, and each wall has `WALL` cells on both sides of its middle.
    """
    from ..boundary.field import field_of

    cells = grid or fewest
    while True:
        field = field_of(points, triangles, cells, winding=winding)
        if field.thickness >= WALL * field.spacing:
            return field
        more = min(max(1.1 * WALL * field.spacing / max(field.thickness, field.spacing), 1.25), 2.0)
        if grid or math.prod(field.counts) * more**3 > MOST:
            offset = (WALL + 0.5) * field.spacing - field.thickness
            return field_of(points, triangles, cells, winding=winding, offset=offset)
        cells = int(np.ceil(more * cells))
