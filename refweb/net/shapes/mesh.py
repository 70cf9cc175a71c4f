"""Solids from files: bodies that a surface of triangles bounds."""

from __future__ import annotations

import functools
import hashlib
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...messages import quote
from ...tables import Several, integer, real, rows, table, text
from ..rigid_body import Grown, Shape, axes_of

GRID = 48
"""Number of cells of the grid along the longest side, where none is given and no wall is too thin for it."""
WIDE = 96
"""The same of a grid for bodies that are thicker than the first one reaches: far from a surface depth is smooth."""
WALL = 2.0
"""Least number of cells from the middle of a wall to its surface."""
MOST = 4_000_000
"""Largest number of points of a grid that is chosen."""
SIZES = 1e-6, 1e6
"""Smallest and largest size of a body [m]."""


class Solid(NamedTuple):
    """Solid of a file, about the centre of mass.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Corners [m].
    triangles : ndarray of int, shape (t, 3)
        Those of each triangle, outward.
    centre : ndarray, shape (3,)
        Centre of mass, from the origin of the file [m].
    volume : float
        Volume [m³].
    inertia : ndarray, shape (3, 3)
        Moments for a density of 1 [m⁵].
    field : refweb.net.boundary.field.Field
        Depth in it.
    convex : bool
        Whether it is convex.
    remarks : tuple of str
        What has been mended.
    """

    points: np.ndarray
    triangles: np.ndarray
    centre: np.ndarray
    volume: float
    inertia: np.ndarray
    field: Any
    convex: bool
    remarks: tuple


@table
class Mesh(Shape):
    """A solid whose surface is in a file; its position is that of its centre of mass, were it uniform.

    The origin of the file lies at −c from there, c being the centre of mass in the file, turned as the axes say.

    Parameters
    ----------
    file : str
        STL, OBJ or VTP file of a closed surface of triangles, relative to the scene's folder.
    scale : float
        Metres a unit of the file, > 0.
    axes : list of 2 vectors, optional
        Directions of the first two axes of the file, at right angles; by default x and y.
    grid : int, optional
        Number of cells along its longest side of the grid on which depth is known, see `refweb.net.boundary.field`; by
        default 48, or as many as its thinnest wall asks for.

    Examples
    --------
        [[body]]
        name = "satellite"
        shape = "mesh"
        file = "satellite.stl"
        scale = 1e-3
        position = [0.0, 0.0, -0.3]
        fixed = true
    """

    free = True

    file: str = text()
    scale: float = real(default=1.0, above=0)
    axes: Several = rows(3, default=None)
    grid: int | None = integer(default=None, at_least=8, at_most=4096)

    def check(self):
        """Refuse axes that are not two at right angles."""
        self.frame()

    def to_dict(self):
        """The table as plain TOML values, the file with its folder."""
        return {**super().to_dict(), "file": str(Path(self.file).absolute())}

    @functools.cached_property
    def solid(self):
        """The `Solid`.

        Raises
        ------
        InputError
            For a file that cannot be read or is no closed surface, a size that no body has, and a grid that is too
            coarse for its walls or does not fit into memory.
        """
        path = Path(self.file)
        try:
            content = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
            return _solid(path, content, self.scale, self.grid)
        except InputError as error:
            raise InputError(f"file = {quote(self.file)}: {error}") from None
        except OSError as error:
            raise InputError(f"file = {quote(self.file)}: cannot be read: {error.strerror or error}") from None

    def settle(self):
        """Read the file."""
        _ = self.solid

    def grown(self):
        """No core: the box that it fills about its centre, within its error, and where its field's numbers stand."""
        field = self.solid.field
        size = tuple((np.abs(self.solid.points).max(axis=0) + field.error).tolist())
        return Grown(
            0.0, size, fine=math.inf if self.solid.convex else field.spacing, thick=field.thickness, field=field.address
        )

    @property
    def extent(self):
        """Largest distance from its centre to its surface, within its error [m]."""
        return float(np.linalg.norm(self.solid.points, axis=1).max()) + self.solid.field.error

    def frame(self):
        """Unit vectors of the axes of the file."""
        return axes_of(self.axes)

    def volume(self):
        """Its volume [m³]."""
        return self.solid.volume

    def inertia(self, mass):
        """Tensor of inertia of a uniform mass about its centre [kg m²], along its axes, shape (3, 3)."""
        return mass / self.solid.volume * self.solid.inertia

    def depth(self):
        """Kernel of the depth that its field has."""
        from ..boundary.field import depth

        return depth

    def skeleton(self):
        """Its edges that stand out."""
        from ..skeleton import of_surface

        return of_surface(self.solid.points, self.solid.triangles)

    def touched(self, thickness):
        """Its field, or for what is thicker than that reaches a wider one, with `WIDE` cells along all it fills."""
        field, grown = self.solid.field, self.grown()
        if thickness <= field.margin:
            return grown
        from ..boundary.field import field_of

        wide = vars(self).setdefault("_wide", {})  # kept as long as this: kernels read it where it stands
        if thickness not in wide:
            points, triangles = self.solid.points, self.solid.triangles
            size = float(np.ptp(points, axis=0).max())
            spacing = max((size + 2.0 * thickness) / WIDE, field.spacing)
            cells = max(int(np.ceil(size / spacing)), 1)
            around = int(np.ceil(1.1 * thickness * cells / size)) + 2
            wide[thickness] = field_of(points, triangles, cells, around, field)
        return grown._replace(field=wide[thickness].address)

    def surface(self):
        """Its triangles."""
        return self.solid.points, self.solid.triangles

    def remarks(self):
        """Remarks on repairs of its file."""
        return self.solid.remarks

    def texts(self):
        """Texts on its size, its centre of mass in the file, and the error of its field at the surface."""
        solid, field = self.solid, self.solid.field
        centre = ", ".join(f"{x:.4g}" for x in solid.centre)
        grid = " × ".join(map(str, field.counts))
        yield f"{len(solid.triangles)} triangles, {solid.volume:.4g} m³, centre of mass at ({centre}) m from its origin"
        yield f"surface within {field.error:.1e} m on a grid of {grid} points"

    @property
    def error(self):
        """Largest distance of the surface that lines feel from that of the file [m]."""
        return self.solid.field.error


@functools.lru_cache(maxsize=16)
def _solid(path, content, scale, grid):
    """The `Solid` of a file of some content."""
    from ..boundary.closed import closed, is_convex, moments
    from ..boundary.surface_file import read

    points, triangles = read(path)
    surface = closed(points * scale, triangles)
    size = float(np.ptp(surface.points, axis=0).max())
    if not SIZES[0] <= size <= SIZES[1]:
        raise InputError(
            f"its size is {size:.3g} m with scale = {scale:g}, it must be {SIZES[0]:g} to {SIZES[1]:g} m: give scale, "
            "the metres a unit of the file"
        )
    volume, centre, inertia = moments(surface.points, surface.triangles)
    centred = surface._replace(points=surface.points - centre)
    mended = []
    if surface.turned:
        mended.append(f"{surface.turned} of {len(centred.triangles)} triangles faced inward and were turned")
    if surface.dropped:
        mended.append(f"{surface.dropped} triangles of two corners were dropped")
    field = _field(centred, grid)
    return Solid(
        centred.points,
        centred.triangles,
        centre,
        volume,
        inertia,
        field,
        is_convex(centred.points, volume),
        tuple(mended),
    )


def _field(surface, grid):
    """The field of a surface, of a grid that is fine enough for its walls."""
    from ..boundary.field import field_of

    cells = grid or GRID
    while True:
        field = field_of(surface.points, surface.triangles, cells)
        if field.thickness >= WALL * field.spacing:
            return field
        more = min(max(1.1 * WALL * field.spacing / max(field.thickness, field.spacing), 1.25), 2.0)
        finer = int(np.ceil(more * cells))
        if grid or np.prod(np.array(field.counts, dtype=float)) * more**3 > MOST:
            raise InputError(
                f"grid = {cells} has cells of {field.spacing:.3g} m, and walls {2.0 * field.thickness:.3g} m thin need "
                f"{2.0 * WALL:g} of them: give grid = {finer} or more, or thicken the walls"
            )
        cells = finer
