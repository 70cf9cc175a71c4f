"""Reading of surfaces: corners and triangles from STL, OBJ and VTP files.

meshio reads STL. VTK reads VTP, in a separate process. `refweb.net.obj_file` reads corners and faces of OBJ: meshio
does not accept the lists of textured files, and VTK rounds to 7 digits.

May change: private functions; texts of errors, and `HARMLESS`, the kinds of cells that are ignored. Must stay: what
`read` returns, which `heights` and `shapes.mesh` take; the suffixes in `READERS`, a file format: a new one also goes to
`FORMATS` of `shapes.terrain` and to the help text of ``file`` and ``heights``. Tests: ``tests/net/test_boundary.py``.
"""

from __future__ import annotations

import itertools

import numpy as np

from ... import memory
from ...errors import InputError
from ...messages import quote
from ..mesh_readers import by_meshio, by_vtk
from ..obj_file import read_obj
from .polygons import ears

HARMLESS = ("vertex", "poly_vertex", "line", "polyline")
"""Kinds of cells that are ignored, since they bound nothing."""


def read(path):
    """Points, shape (n, 3), in the unit of a file, and triangles, shape (t, 3).

    A file that is not there, cannot be read, has another format or no surface is refused.
    """
    if not path.is_file():
        raise InputError(f"there is no file {path}")
    suffix = path.suffix.lower()
    if suffix not in READERS:
        raise InputError(f"format {quote(path.suffix)} must be one of {', '.join(READERS)}: use meshio convert")
    size = path.stat().st_size
    memory.check(memory.READING * size, f"the {size / 1e6:.3g} MB of {path.name}")
    points, cells = READERS[suffix](path)
    if any(cell_set.min() < 0 or cell_set.max() >= len(points) for cell_set in cells):
        raise InputError(f"its triangles name corners that are not among its {len(points)}")
    triangles = [triangle for cell_set in cells for triangle in _triangles(points, cell_set)]
    if not len(points) or not triangles:
        raise InputError("it holds no triangles: a body needs a closed surface")
    return points, np.ascontiguousarray(np.vstack(triangles), dtype=np.int64)


def _of_stl(path):
    mesh = by_meshio(path, "stl")
    return _sorted(mesh.points, [(block.type, block.data) for block in mesh.cells])


def _of_obj(path):
    """Corners, and an array (faces, corners) for each sequence of faces with equal numbers of corners."""
    points, _, faces, _, _ = read_obj(path)
    return points, [np.array(list(group), dtype=np.int64) for _, group in itertools.groupby(faces, len)]


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
    """Triangles of cells with a number of corners each."""
    corners = cells.shape[1]
    fan = np.stack([cells[:, [0, k, k + 1]] for k in range(1, corners - 1)])
    if corners > 3:
        p, q, r = (points[fan[..., k]] for k in range(3))
        normals = np.cross(q - p, r - p)
        for n in np.flatnonzero(((normals * normals.sum(axis=0)).sum(axis=2) < 0.0).any(axis=0)):
            parts = ears(points[cells[n]])
            if parts is None:
                raise InputError(f"the sides of a face of {corners} corners cross: mend it where the surface is made")
            fan[:, n] = cells[n][parts]
    return fan


READERS = {".stl": _of_stl, ".obj": _of_obj, ".vtp": _of_vtk}
"""Functions that read surfaces, by the suffix of the file."""
