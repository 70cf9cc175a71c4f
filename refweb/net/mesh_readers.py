"""Reading of mesh files: by meshio, and by VTK for content that meshio does not read.

meshio skips polylines of .vtu files without a message, and reads neither polygonal data nor texts. VTK reads such
files, in a separate process, since a damaged file may end the process.

May change: private functions, `REMEDIES` and texts of errors. Must stay: fields of `Mesh` and `Block`, which
`mesh_file` and `faces` read; suffixes in `FORMATS` and kinds in `LINES`; names in `BY_VTK`, which passes on no other
data; `by_meshio` and `by_vtk`, which `boundary.surface_file` calls too; VTK in a process of its own. Tests:
``tests/net/test_mesh_files.py``, ``tests/net/test_bad_files.py``.
"""

from __future__ import annotations

import itertools
import re
from typing import Any, NamedTuple

import numpy as np

from .. import memory
from ..errors import InputError
from ..messages import quote

FORMATS = {".vtu": "vtu", ".vtk": "vtk", ".vtp": None, ".msh": "gmsh", ".obj": "obj", ".stl": "stl"}
"""Formats of mesh files by suffix, with the names of meshio; None for files that only VTK reads."""
LINES = ("line", "line3", "line4", "polyline")
REMEDIES = {
    ".msh": "in Gmsh give the curves physical groups and save these alone, Mesh.SaveAll = 0, or mesh by `gmsh -1`",
    ".obj": "write rows l 1 2 of lines, or rows f 1 2 3 of faces",
    "": "extract the edges of solids, in ParaView by Extract Edges, in pyvista by mesh.extract_all_edges()",
}
"""Remedies for a file with other cells, by its suffix."""
BY_VTK = """
import sys
import numpy as np
import pyvista
mesh = pyvista.read(sys.argv[1])
mesh = mesh.combine() if isinstance(mesh, pyvista.MultiBlock) else mesh
mesh = mesh.cast_to_unstructured_grid()
found = {"points": mesh.points, "types": mesh.celltypes, "cells": mesh.cell_connectivity, "offsets": mesh.offset}
for kind, data in (("cell", mesh.cell_data), ("point", mesh.point_data)):
    for name in {"natural_length", "group", "broken", "support", "displacement"} & set(data):
        found[f"{kind} {name}"] = np.asarray(data[name])
np.savez(sys.argv[2], **found)
"""
"""Program that reads a file by VTK. Its arguments are the path of the file and that of the archive of arrays to
write."""


class Block(NamedTuple):
    """Cells of one kind: their nodes, shape (cells, nodes), and data of cells by name.

    ``members`` are the cells of each physical group of Gmsh, for faces.
    """

    kind: str
    cells: np.ndarray
    data: dict[str, Any]
    members: dict[str, Any] = {}


class Mesh(NamedTuple):
    """Content of a mesh file.

    Attributes
    ----------
    points : ndarray, shape (nodes, 2 or 3)
        Positions [m].
    blocks : list of Block
        All cells, in the order of the file.
    point_data : dict of str to ndarray
        Data of nodes by name.
    remedy : str
        Remedy for cells that a web cannot have.
    groups : dict of str to list of int, optional
        Cells of Gmsh that are lines, by physical group; None for other files.
    names : dict of str to list of int
        Nodes by physical point.
    supports : list of int
        Nodes of the points named ``support``.
    """

    points: np.ndarray
    blocks: list[Any]
    point_data: dict[str, Any]
    remedy: str
    groups: dict[str, Any] | None = None
    names: dict[str, Any] = {}
    supports: list[Any] = []

    @property
    def lines(self):
        """Blocks of lines, without empty ones."""
        return [block for block in self.blocks if block.kind in LINES and len(block.cells)]


def read(path):
    """Read the `Mesh` of a file."""
    if not path.is_file():
        raise InputError(f"there is no file {path}")
    suffix = path.suffix.lower()
    if suffix == ".geo":
        raise InputError(
            f"{path.name} is a geometry and no mesh: `gmsh -1 {path.name}` makes the mesh {path.stem}.msh of it, which "
            "path may name"
        )
    if suffix not in FORMATS:
        known = ", ".join([*list(FORMATS)[:4], ".csv", *list(FORMATS)[4:]])
        raise InputError(f"format {quote(path.suffix)} must be one of {known}: use meshio convert")
    memory.check(memory.READING * path.stat().st_size, f"the {path.stat().st_size / 1e6:.3g} MB of {path.name}")
    if suffix == ".obj":
        return _of_obj(path)
    if FORMATS[suffix] is None or _asks_for_vtk(path, suffix):
        return by_vtk(path)
    try:
        mesh = by_meshio(path, FORMATS[suffix])
    except KeyError as error:  # a type of VTK that meshio has no name for, or does not read
        if suffix == ".vtk" or error.args == ("pixel",):
            return by_vtk(path)
        raise _unread(path, f"KeyError {error}") from None
    except InputError as error:
        if suffix == ".vtk" and "Unknown section" in str(error):  # normals and others
            return by_vtk(path)
        raise
    if suffix == ".msh":
        return _of_gmsh(mesh)
    blocks = [
        Block(block.type, block.data, {name: data[i] for name, data in mesh.cell_data.items()})
        for i, block in enumerate(mesh.cells)
    ]
    return Mesh(mesh.points, blocks, mesh.point_data, REMEDIES[""])


def _asks_for_vtk(path, suffix):
    """Tell if a VTK file has polygonal data, polylines or texts."""
    if suffix == ".vtk":
        with path.open("rb") as file:
            return re.search(rb"^\s*DATASET\s+POLYDATA", file.read(2000), re.MULTILINE | re.IGNORECASE) is not None
    if suffix != ".vtu":
        return False
    content = path.read_bytes()
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        return False
    return b'type="String"' in content or _has_polylines(path, content)


def _has_polylines(path, content):
    """Tell if meshio skips cells of a .vtu file."""
    said = sum(map(int, re.findall(rb'NumberOfCells="(\d{1,12})"', content)))
    try:
        return said != sum(len(block.data) for block in by_meshio(path, "vtu").cells)
    except (InputError, KeyError):
        return False


def _unread(path, reason, reader="meshio"):
    reason = " ".join(reason.replace("Error: Couldn't read file", "").replace(str(path), "").split())[:200]
    if "gmsh:physical" in reason:
        reason = "some curves or points have a physical group and others none: save with Mesh.SaveAll = 0"
    return InputError(f"{reader} cannot read {path}; is it whole, and its data numeric? ({reason})")


def by_meshio(path, kind):
    """Read a mesh by meshio, which reports some failures by printing and SystemExit."""
    import contextlib
    import io
    import warnings

    import meshio

    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return meshio.read(path, file_format=kind)
    except KeyError:
        raise
    except (Exception, SystemExit) as error:
        raise _unread(
            path, f"{type(error).__name__} {error}" if isinstance(error, Exception) else said.getvalue()
        ) from None


def by_vtk(path):
    """Read a `Mesh` by VTK in a separate process."""
    import subprocess
    import sys
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "mesh.npz"
        ended = subprocess.run([sys.executable, "-c", BY_VTK, str(path), str(target)], capture_output=True, text=True)
        if ended.returncode or not target.is_file():
            said = [line for line in ended.stderr.splitlines() if line.strip()]
            raise _unread(path, said[-1] if said else f"status {ended.returncode}", "VTK")
        with np.load(target, allow_pickle=False) as archive:
            arrays = dict(archive)
    from meshio import _vtk_common

    names = _vtk_common.vtk_to_meshio_type
    sizes, types = np.diff(arrays["offsets"]), arrays["types"]
    starts = np.flatnonzero(np.append(True, (np.diff(types) != 0) | (np.diff(sizes) != 0))) if len(types) else []
    blocks = []
    for first, last in itertools.pairwise([*starts, len(types)]):
        cells = arrays["cells"][arrays["offsets"][first] : arrays["offsets"][last]].reshape(last - first, sizes[first])
        data = {key[5:]: values[first:last] for key, values in arrays.items() if key.startswith("cell ")}
        kind = "polyline" if types[first] == 4 else names.get(int(types[first]), f"type {types[first]}")
        blocks.append(Block(kind, cells, data))
    point_data = {key[6:]: values for key, values in arrays.items() if key.startswith("point ")}
    return Mesh(arrays["points"], blocks, point_data, REMEDIES[""])


def _of_obj(path):
    """The `Mesh` of an OBJ file: lines and faces by their number of corners, in the order of the file."""
    from .obj_file import read_obj

    points, lines, faces, *groups = read_obj(path)
    cells = [
        *(("polyline", *of) for of in zip(lines, groups[0], strict=True)),
        *(("polygon", *of) for of in zip(faces, groups[1], strict=True)),
    ]
    blocks = []
    for (kind, _), alike in itertools.groupby(cells, lambda cell: (cell[0], len(cell[1]))):
        _, corners, names = zip(*alike, strict=True)
        blocks.append(Block(kind, np.array(corners, dtype=np.int64), {"group": np.array(names)}))
    return Mesh(points, blocks, {}, REMEDIES[".obj"])


def _of_gmsh(mesh):
    """The `Mesh` of a Gmsh file, with its physical groups."""
    named = {(int(dim), int(tag)): name for name, (tag, dim) in mesh.field_data.items()}
    blocks, groups, names, first = [], {}, {}, 0
    for i, block in enumerate(mesh.cells):
        tags = {key: mesh.cell_data[key][i] for key in ("gmsh:physical", "gmsh:geometrical") if key in mesh.cell_data}
        data = {key: mesh.cell_data[key][i] for key in ("natural_length", "group") if key in mesh.cell_data}
        data |= {"entity": tags["gmsh:geometrical"]} if "gmsh:geometrical" in tags else {}
        dim = 0 if block.type == "vertex" else 1 if block.type in LINES else 2
        members = {}
        for tag in np.unique(tags.get("gmsh:physical", [])):
            if tag:
                name = named.get((dim, int(tag)), str(tag))
                members.setdefault(name, set()).update(np.flatnonzero(tags["gmsh:physical"] == tag).tolist())
        for name, sets in mesh.cell_sets.items():
            if not name.startswith("gmsh:") and sets[i] is not None and len(sets[i]):
                members.setdefault(name, set()).update(np.asarray(sets[i]).tolist())
        blocks.append(Block(block.type, block.data, data, members if dim == 2 else {}))
        if dim == 2:
            continue
        for name, cells in members.items():
            if dim:
                groups.setdefault(name, []).extend(first + c for c in sorted(cells))
            else:
                names.setdefault(name, []).extend(block.data[sorted(cells), 0].tolist())
        first += len(block.data) if dim else 0
    supports = names.pop("support", [])
    return Mesh(mesh.points, blocks, mesh.point_data, REMEDIES[".msh"], groups, names, supports)
