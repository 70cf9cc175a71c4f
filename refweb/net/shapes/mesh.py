"""Solids from files of a surface of triangles.

May change: private functions, texts of errors, and `SIZES`, limits of what is accepted. Must stay: keys and docstring
of `Mesh` (scene format and help; after a change write ``validation/REFERENCE.md`` anew); ``file``, which
`registry.FILES` names so that paths count from the scene's folder; `_solid`, which a test calls. Tests:
``tests/effects/test_mesh_bodies.py``, ``tests/net/test_repair.py``.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from ...tables import Several, choice, integer, real, rows, table, text
from .filled import GRID, Filled, Solid, field_in

if TYPE_CHECKING:
    from pathlib import Path

SIZES = 1e-6, 1e6
"""Smallest and largest size of a body [m]."""


@table
class Mesh(Filled):
    """A solid with its surface in a file; its position is that of its centre of mass at uniform density.

    With the centre of mass c in the file, the origin of the file is at −c from the position, turned with the axes.
    Parts that overlap or touch become one solid and holes are closed, with a warning, see `refweb.net.boundary.repair`.

    Parameters
    ----------
    file : str
        STL, OBJ or VTP file of a surface that encloses something, relative to the scene's folder.
    scale : float
        Metres per unit of the file, > 0.
    surface : {"file", "hull"}
        "hull" takes the convex hull of the surface in place of what the file has.
    axes : list of 2 vectors, optional
        Directions of the first two axes of the file, at right angles; by default x and y.
    grid : int, optional
        Number of cells of the grid of depth along its longest side, see `refweb.net.boundary.field`; by default 48, or
        more for thin walls.

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
    file_key = "file"

    file: str = text()
    scale: float = real(default=1.0, above=0)
    surface: str = choice("file", "hull", default="file")
    axes: Several = rows(3, default=None)
    grid: int | None = integer(default=None, at_least=8, at_most=4096)

    def made(self, path: Path, content: str) -> Solid:
        """The `Solid` of a file.

        Refuses a surface that encloses nothing, a size out of `SIZES`, and a grid that does not fit into memory.
        """
        return _solid(path, content, self.scale, self.grid, self.surface == "hull")


@functools.lru_cache(maxsize=16)
def _solid(path, content, scale, grid, hull):
    """The `Solid` of the content of a file, or its convex hull."""
    from ..boundary.closed import NotClosedError, closed, convex_hull, is_convex, moments
    from ..boundary.surface_file import read

    points, triangles = read(path)
    points = points * scale
    try:
        surface = closed(*(convex_hull(points, triangles) if hull else (points, triangles)))
    except NotClosedError:
        _refuse_size(points[triangles], scale)
        return _repaired(points, triangles, grid)
    _refuse_size(surface.points, scale)
    if surface.pieces > 1:
        from ..boundary.repair import touches_itself

        if touches_itself(surface.points, surface.triangles, grid or GRID):
            return _repaired(surface.points, surface.triangles, grid)
    volume, centre, inertia = moments(surface.points, surface.triangles)
    centred = surface._replace(points=surface.points - centre)
    mended = []
    if surface.turned:
        mended.append(f"{surface.turned} of {len(centred.triangles)} triangles faced inward and were turned")
    if surface.dropped:
        mended.append(f"{surface.dropped} triangles of two corners were dropped")
    return Solid(
        centred.points,
        centred.triangles,
        centre,
        volume,
        inertia,
        field_in(centred.points, centred.triangles, grid),
        is_convex(centred.points, volume),
        tuple(mended),
    )


def _refuse_size(points, scale):
    """Refuse a size out of `SIZES`."""
    size = float(np.ptp(points.reshape(-1, 3), axis=0).max())
    if not SIZES[0] <= size <= SIZES[1]:
        raise InputError(
            f"its size is {size:.3g} m with scale = {scale:g}, it must be {SIZES[0]:g} to {SIZES[1]:g} m: give scale, "
            "the metres a unit of the file"
        )


def _repaired(points, triangles, grid):
    """The `Solid` of a repaired surface."""
    from ..boundary.closed import is_convex
    from ..boundary.repair import repaired

    solid = repaired(points, triangles, grid or GRID)
    volume, centre, inertia = solid.moments
    corners, triangles = solid.boundary
    felt, winding = (corners - centre, triangles), solid.winding.moved(-centre)
    return Solid(
        solid.points - centre,
        solid.triangles,
        centre,
        volume,
        inertia,
        field_in(*felt, grid, winding),
        is_convex(felt[0], volume),
        solid.remarks,
        felt,
        winding,
    )
