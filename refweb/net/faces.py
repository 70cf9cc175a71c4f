"""Edges of the faces of a mesh file as the lines of a web, each once.

May change: private functions, texts of findings and errors. Must stay: the edges as the last block of the mesh, where
`mesh_file` finds them; each edge once; kinds of cells in `CORNERS`, which `mesh_file` takes for faces; the order of
lines, by which scenes number them; `counted`, `decided`, `group_names` and `pieces_of`, which `mesh_file` imports.
Tests: ``tests/net/test_faces.py``.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..findings import NOTE, Finding
from .groups import members
from .mesh_readers import Block

CORNERS = {
    "triangle": 3,
    "triangle6": 3,
    "triangle7": 3,
    "quad": 4,
    "quad8": 4,
    "quad9": 4,
    "pixel": 4,
    "polygon": None,
}
"""Kinds of faces, and the number of corners, which are their first nodes; None if all nodes are."""


def decided(mesh, edges):
    """(Mesh without faces, groups of edges by number of the edge, findings on automatic decisions), from a mesh.

    Edges of faces become lines, the last block, if the key ``edges`` asks for it, or if it is None and there are no
    lines. An `InputError` where the file lacks what ``edges`` needs, or has lines and faces and ``edges`` is None.
    """
    faces = [block for block in mesh.blocks if block.kind in CORNERS and len(block.cells)]
    count, lines = sum(len(block.cells) for block in faces), bool(mesh.lines)
    if edges is False and not lines:
        raise InputError(f"edges = false takes lines alone, and the file has {count} faces and no lines: leave it out")
    if edges is True and not faces:
        raise InputError("edges = true takes edges of faces, and the file has no faces: leave it out")
    others = [block for block in mesh.blocks if block.kind not in CORNERS]
    if not faces or edges is False:
        return mesh._replace(blocks=others), {}, []
    if edges is None and lines:
        raise InputError(
            f"it holds {counted(mesh.blocks)} cells: a web has only lines; edges = false takes its lines alone, edges "
            f"= true the edges of its faces as well; or {mesh.remedy}"
        )
    pairs, of_face = _edges(faces, len(mesh.points))
    if lines:
        given = np.concatenate([pieces_of(block) for block in mesh.lines])
        fresh = ~np.isin(_keys(pairs, len(mesh.points)), _keys(given, len(mesh.points)))
        number = np.where(fresh, np.cumsum(fresh) - 1, -1)
        pairs, of_face = pairs[fresh], [number[sides] for sides in of_face]
    edge_groups = _groups(faces, of_face)
    notes = []
    if edges is None:
        text = f"the file has {count} faces and no lines: the web's lines are the {len(pairs)} edges of the faces"
        notes.append(Finding("mesh-file", text, "web", NOTE))
    block = Block("line", pairs, _data(mesh, pairs))
    return mesh._replace(blocks=[*others, block]), edge_groups, notes


def counted(blocks):
    """Text of the numbers of cells: ``1 line, 2 triangle``."""
    counts = {}
    for block in blocks:
        counts[block.kind] = counts.get(block.kind, 0) + len(block.cells)
    return ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items()))


def _corners(block):
    """Corners of faces in their order around, shape (faces, corners)."""
    cells = np.asarray(block.cells).astype(np.int64)[:, : CORNERS[block.kind]]
    return cells[:, [0, 1, 3, 2]] if block.kind == "pixel" else cells


def _edges(faces, count):
    """Edges, shape (edges, 2), in the order of the file, and for each block the edge of each side, −1 for a point."""
    sides = []
    for block in faces:
        corners = _corners(block)
        if corners.min() < 0 or corners.max() >= count:
            bad = corners[(corners < 0) | (corners >= count)][0]
            raise InputError(f"a face has the node {bad}, must be 0 … {count - 1}")
        sides.append(np.stack([corners, np.roll(corners, -1, axis=1)], axis=2))
    pairs = np.concatenate([side.reshape(-1, 2) for side in sides])
    real = pairs[:, 0] != pairs[:, 1]
    if not real.any():
        raise InputError("its faces have no edges: all corners of each are one node")
    keys, first, number = np.unique(_keys(pairs[real], count), return_index=True, return_inverse=True)
    order = np.argsort(first)
    position = np.empty(len(keys), dtype=np.int64)
    position[order] = np.arange(len(keys))
    of_side = np.full(len(pairs), -1)
    of_side[real] = position[number.ravel()]
    ends = np.cumsum([0, *(side.shape[0] * side.shape[1] for side in sides)])
    of_face = [
        of_side[start:stop].reshape(side.shape[:2])
        for start, stop, side in zip(ends[:-1], ends[1:], sides, strict=True)
    ]
    return pairs[real][first[order]], of_face


def pieces_of(block):
    """End nodes of each piece of a block of lines, cell by cell, shape (pieces, 2)."""
    cells = block.cells if block.kind == "polyline" else block.cells[:, :2]
    return np.stack([cells[:, :-1], cells[:, 1:]], axis=2).reshape(-1, 2).astype(np.int64)


def _keys(pairs, count):
    """A key for each pair of nodes, in any order."""
    return pairs.min(axis=1) * np.int64(count) + pairs.max(axis=1)


def _data(mesh, pairs):
    """Data of edges, if lines have them: natural lengths by distance, and no group."""
    data = {"entity": np.full(len(pairs), -1)} if mesh.groups is not None else {}
    if mesh.lines and all("natural_length" in block.data for block in mesh.lines):
        points = np.asarray(mesh.points, dtype=float)
        data["natural_length"] = np.linalg.norm(points[pairs[:, 1]] - points[pairs[:, 0]], axis=1)
    if mesh.lines and all("group" in block.data for block in mesh.lines):
        data["group"] = np.full(
            len(pairs), "", dtype=object
        )  # an array of objects leaves numbers of others as they are
    return data


def _groups(faces, of_face):
    """Edges of the faces of each group: by the cell data ``group``, and of Gmsh by physical surface."""
    edges_by_name = {}
    for block, edges in zip(faces, of_face, strict=True):
        names = group_names(block.data.get("group"), len(block.cells))
        for name, cells in [*block.members.items(), *members(names, len(block.cells)).items()]:
            edges_by_name.setdefault(name, []).append(edges[sorted(cells)].ravel())
    joined = {name: np.unique(np.concatenate(parts)) for name, parts in edges_by_name.items()}
    return {name: edges[edges >= 0] for name, edges in joined.items() if (edges >= 0).any()}


def group_names(values, count):
    """Group of each cell as text, "2" for 2 and 2.0; None without groups."""
    if values is None:
        return None
    values = np.asarray(values)
    if values.size != count:
        raise InputError(f"group of shape {values.shape} must have one entry for each of {count} lines")

    def text(value):
        if isinstance(value, bytes):
            return value.decode(errors="replace")
        return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)

    return tuple(map(text, values.reshape(count).tolist()))
