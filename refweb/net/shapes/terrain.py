"""Terrain: ground with heights from a file.

May change: private functions and texts of errors. Must stay: keys and docstring of `Terrain` (scene format and help;
after a change write ``validation/REFERENCE.md`` anew); ``heights``, which `registry.FILES` names so that paths count
from the scene's folder; `FORMATS`, the suffixes that `boundary.heights` reads. `DEEP` changes the solid under the
ground. Tests: ``tests/effects/test_ground.py``.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ...messages import quote
from ...tables import Several, integer, real, rows, table, text
from .filled import GRID, MOST, Filled, Solid, field_in

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

DEEP = 0.25
"""Default depth of the ground below its lowest point, over its longest side."""
FORMATS = (".csv", ".obj", ".stl", ".vtp")
"""Suffixes of files of heights."""


@table
class Terrain(Filled):
    """Ground given by heights: solid below them down to a depth, with vertical walls at its rim; it is fixed.

    The position is that of the origin of the file, and the third axis is up. A CSV file has the columns x, y and z of
    points, on a grid or scattered, which triangles join; a surface file (OBJ, STL, VTP) contains the triangles. The
    surface has one height at each position, without overhangs. Its error does not include triangles at the rim. If the
    stiffness of contact is not given, it is chosen as for a plane.

    Parameters
    ----------
    heights : str
        CSV file of heights, or OBJ, STL or VTP file of an open surface, relative to the scene's folder.
    scale : float
        Metres per unit of the file, > 0.
    thickness : float, optional
        Depth of the ground below its lowest point [m], > 0; by default a quarter of its longest side.
    axes : list of 2 vectors, optional
        Directions of the first two axes of the file, at right angles; by default x and y.
    grid : int, optional
        Number of cells of the grid of depth along its longest side; by default 48 or more, so that a cell is at most as
        long as the edges of the triangles, as far as memory allows.

    Examples
    --------
        [[body]]
        name = "hill"
        shape = "terrain"
        heights = "hill.csv"
        position = [0.0, 0.0, -2.0]
        fixed = true
    """

    ground = True
    file_key = "heights"

    heights: str = text()
    scale: float = real(default=1.0, above=0)
    thickness: float | None = real(default=None, above=0, unit="m")
    axes: Several = rows(3, default=None)
    grid: int | None = integer(default=None, at_least=8, at_most=4096)

    def made(self, path: Path, content: str) -> Solid:
        """The `Solid` of a file, about its origin.

        Refuses another format, two heights at one position, and a grid that does not fit into memory.
        """
        if path.suffix.lower() not in FORMATS:
            raise InputError(f"format {quote(path.suffix)} must be one of {', '.join(FORMATS)}")
        if not path.is_file():
            raise InputError(f"there is no file {path}")
        return _solid(path, content, self.scale, self.thickness, self.grid)

    def skeleton(self) -> NDArray[Any] | None:
        """Its convex edges, or none if there are too many: other bodies touch it with their parts."""
        from ..skeleton import PART

        try:
            return super().skeleton()
        except InputError:
            return np.zeros(0, PART)


@functools.lru_cache(maxsize=16)
def _solid(path, content, scale, thickness, grid):
    """The `Solid` of the content of a file."""
    from ..boundary.closed import NotClosedError, closed, is_convex, moments
    from ..boundary.field import places_on
    from ..boundary.heights import above_ground, on_rim, places_of

    points, triangles = places_of(path)
    points = scale * points
    longest = float(np.ptp(points[triangles].reshape(-1, 3), axis=0).max())
    bottom = points[triangles, 2].min() - (thickness or DEEP * longest)
    try:
        surface = closed(*above_ground(points, triangles, bottom))
    except NotClosedError as error:
        raise InputError(f"its surface must have one height at each place: {error}") from None
    volume, centre, inertia = moments(surface.points, surface.triangles)
    edge = np.median(np.linalg.norm(points[triangles[:, 0]] - points[triangles[:, 1]], axis=1))
    sides = np.ptp(surface.points, axis=0)
    finest = 0.5 * (MOST / max(float(np.prod(sides / sides.max())), 1e-3)) ** (1.0 / 3.0)
    cells = int(np.clip(np.ceil(sides.max() / edge), GRID, max(finest, GRID)))
    field = field_in(surface.points, surface.triangles, grid, fewest=cells)
    convex = is_convex(surface.points, volume)
    solid = Solid(surface.points, surface.triangles, centre, volume, inertia, field, convex, ())
    used, inner = np.unique(triangles[~on_rim(triangles)], return_inverse=True)
    if not len(used):
        return solid
    return solid._replace(error=float(np.abs(field.at(places_on(points[used], inner.reshape(-1, 3)))[0]).max()))
