"""Surfaces from files: corners and triangles, from STL, OBJ and VTP.

meshio reads STL and OBJ, and VTK, in a process of its own, VTP and what of OBJ meshio does not know.
"""

from __future__ import annotations

import numpy as np

from ... import memory
from ...errors import InputError
from ...messages import quote
from ..mesh_readers import by_meshio, by_vtk

FORMATS = {".stl": "stl", ".obj": "obj", ".vtp": None}
"""Formats of surfaces by the end of their name, as meshio calls them; None for what VTK alone reads."""
HARMLESS = ("vertex", "poly_vertex", "line", "polyline")
"""Cells that bound nothing."""


def read(path):
    """(points (n, 3) in the unit of the file, triangles (t, 3)) of a file.

    Raises
    ------
    InputError
        For a file that is not there, cannot be read or has another format, and for one without a surface.
    """
    if not path.is_file():
        raise InputError(f"there is no file {path}")
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"format {quote(path.suffix)} must be one of {', '.join(FORMATS)}: use meshio convert")
    size = path.stat().st_size
    memory.check(memory.READING * size, f"the {size / 1e6:.3g} MB of {path.name}")
    points, cells = _of_vtk(path) if FORMATS[suffix] is None else _of_meshio(path, FORMATS[suffix])
    if _strays(points, cells):
        points, cells = _of_vtk(path)  # OBJ counts backwards with negative numbers
        if _strays(points, cells):
            raise InputError(f"its triangles name corners that are not among its {len(points)}")
    triangles = [triangle for cell_set in cells for triangle in _triangles(points, cell_set)]
    if not len(points) or not triangles:
        raise InputError("it holds no triangles: a body needs a closed surface")
    return points, np.ascontiguousarray(np.vstack(triangles), dtype=np.int64)


def _strays(points, cells):
    return any(cell_set.min() < 0 or cell_set.max() >= len(points) for cell_set in cells)


def _of_meshio(path, kind):
    mesh = by_meshio(path, kind)
    return _sorted(mesh.points, [(block.type, block.data) for block in mesh.cells])


def _of_vtk(path):
    mesh = by_vtk(path)
    return _sorted(mesh.points, [(block.kind, block.cells) for block in mesh.blocks])


def _sorted(points, blocks):
    points = np.asarray(points, dtype=float).reshape(len(points), -1 if len(points) else 3)
    for kind, cells in blocks:
        if len(cells) and kind not in ("triangle", "quad", "polygon", *HARMLESS):
            raise InputError(f"it holds {len(cells)} {kind} cells: a body needs a surface of triangles")
    if len(points) and points.shape[1] != 3:
        raise InputError(f"points of shape {points.shape} must have the shape (n, 3)")
    return points, [np.asarray(cells) for kind, cells in blocks if len(cells) and kind not in HARMLESS]


def _triangles(points, cells):
    """Triangles of cells of some corners each, which are convex."""
    corners = cells.shape[1]
    fan = [cells[:, [0, k, k + 1]] for k in range(1, corners - 1)]
    if corners > 4:
        normals = [np.cross(points[f[:, 1]] - points[f[:, 0]], points[f[:, 2]] - points[f[:, 0]]) for f in fan]
        total = sum(normals)
        bad = np.any([(normal * total).sum(axis=1) < 0.0 for normal in normals], axis=0)
        if bad.any():
            raise InputError(f"a face of {corners} corners is not convex: triangulate the surface where it is made")
    return fan
