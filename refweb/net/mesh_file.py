"""Webs from files: meshes of VTK and Gmsh, result frames, and CSV of points and lines.

May change: private functions; texts of findings and errors, and `HARMLESS`, the kinds of cells that are ignored. Must
stay: keys and docstring of `File` (scene format and help; after a change write ``validation/REFERENCE.md`` anew); names
of data, which are those of frames by `results.vtu` (a new one also goes to `BY_VTK` of `mesh_readers`); the order of
nodes and lines of a file; `remarks`, which `runner` imports. Tests: ``tests/net/test_mesh_files.py``,
``tests/net/test_webs.py``.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..accepted import accepts, by_name
from ..errors import InputError, refused_at
from ..findings import Finding
from ..messages import nearest, quote
from ..tables import Table, boolean, choice, field, integer, table, text
from .csv_files import NAMES
from .faces import CORNERS, counted, decided, group_names, pieces_of
from .groups import members
from .web import Web

if TYPE_CHECKING:
    from os import PathLike

INNER = {"line": 0, "line3": 1, "line4": 2}
"""Number of nodes between the ends of cells that are lines; a web uses only the ends."""
HARMLESS = ("vertex", "poly_vertex")
"""Kinds of cells that a web ignores."""


@accepts(by_name({"type": "string", "pattern": r"\S"}))
def _columns(name, value):
    """A table of names of columns."""
    if not isinstance(value, dict):
        raise InputError(f'{name} = {quote(value)} must be a table of names of columns, such as {{i = "from"}}')
    for key, column in value.items():
        if not isinstance(column, str) or not column.strip():
            raise InputError(f"{name}.{key} = {quote(column)} must be the name of a column in the file")
    return dict(value)


@table
class File(Table):
    """A web from a VTK, Gmsh, OBJ or STL file, or from two CSV files.

    Files end with .vtu, .vtp or .vtk of any version, .msh of 2.2 or 4.1, .obj, .stl or .csv.

    VTK: cells are lines or polylines; of curved lines the ends count, and vertices do no harm. Taken where present:
    cell data ``natural_length`` [m], which a polyline shares out by distance, ``group`` (numbers or texts) and
    ``broken`` (not 0: the line carries nothing, half of its mass stays with either end, and only dynamics takes it),
    and point data ``support`` (not 0: held in all components). A frame of a result folder is the web that it shows, as
    it was before any displacement, with its natural lengths of that time and its broken lines; what is held in all
    components is a support.

    Gmsh: physical curves are groups of lines, physical points names of nodes, by their tag where they have no name;
    points named ``support`` are supports. An element in several curves is one line of several groups. Nodes that no
    line uses and no point names are left out.

    Faces: a file that has faces and no lines, such as a surface of STL, gives the edges of its faces as lines, each
    once; a note says so. Groups of faces, physical surfaces of Gmsh among them, are groups of their edges. Points that
    no line uses are left out then. OBJ: rows ``l`` are lines, rows ``f`` faces, and ``g`` begins a group.

    CSV: ``path`` has the points, with columns x, y, z [m] and, if wanted, name and support (not 0); ``lines`` has the
    columns i, j, node numbers from 0, and, if wanted, natural_length [m] and group. ``columns`` and ``first`` read
    files that have other names and numbers. Other columns are left alone, and a note names them.

    Groups by the web's supports, ``rim``, ``anchors`` and ``inner``, come with every web, see `refweb.net.groups`.

    Parameters
    ----------
    path : str
        The file, relative to the scene's folder.
    lines : str, optional
        With CSV the file of the lines.
    edges : bool, optional
        True to take edges of faces as lines, beside the lines of the file; false to take the lines of the file alone.
        By default edges are taken if the file has no lines. A file with lines and faces is refused without this key.
    columns : dict of str to str, optional
        With CSV the names of columns that have other names: ``columns = {i = "from", j = "to"}``.
    first : int, optional
        With CSV the number of the first point in the columns i and j, 0 by default.

    Raises
    ------
    InputError
        For columns that a web does not have; from ``web``, if the file cannot be read or is not a web.

    Notes
    -----
    meshio reads the file, and VTK, in a process of its own, what meshio does not know. Other formats are converted:
    ``meshio convert net.inp net.vtu``.

    Examples
    --------
        [web]
        kind = "file"
        path = "net.vtu"
    """

    kind: str = choice("file", default="file")
    path: str = text()
    lines: str | None = text(default=None)
    edges: bool | None = boolean(default=None)
    columns: dict[str, Any] | None = field(_columns, default=None)
    first: int | None = integer(default=None, at_least=0)

    def check(self) -> None:
        """Refuse columns that a web does not have."""
        for key in self.columns or ():
            if key not in NAMES:
                raise InputError(f"columns.{key} is no column of a web, {nearest(key, NAMES)}")

    def web(self, base: str | PathLike[str] | None = None) -> Web:
        """The `Web`; ``base`` is the folder that a relative path starts from."""
        folder, csv = Path(base or "."), Path(self.path).suffix.lower() == ".csv"
        if csv != (self.lines is not None):
            has = f"lines = {quote(self.lines)} has no meaning with" if self.lines else "lines is missing beside"
            raise InputError(f"{has} path = {quote(self.path)}: CSV has points and lines in two files")
        for key in ("edges",) if csv else ("columns", "first"):
            if (value := getattr(self, key)) is not None:
                kinds = "of mesh files, not of CSV" if csv else "of CSV files"
                raise InputError(f"{key} = {quote(value)} is a key {kinds}: leave it out beside {quote(self.path)}")
        with refused_at(f"path = {quote(self.path)}:"):
            if self.lines is not None:
                from .csv_files import web_of

                return web_of(folder / self.path, folder / self.lines, self.columns or {}, self.first or 0)
            from .mesh_readers import read

            return _web_of(read(folder / self.path), self.edges)


def remarks(web):
    """Findings on a web of a file: decisions of the reader, and frequent mistakes in files.

    Mistakes are lines that occur twice, and nodes with equal positions that no line joins.
    """
    yield from web.notes
    ends = np.sort(web.lines, axis=1)
    pairs, of, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    for pair in np.flatnonzero(count > 1)[:1]:
        first, second = np.flatnonzero(of.ravel() == pair)[:2]
        yield Finding(
            "mesh-file",
            f"{int((count - 1).sum())} lines join two nodes that another line joins, {first} and {second} among them: "
            "each carries load; leave one out if the file has it twice by mistake",
            "web",
        )
    used = np.unique(web.lines)
    size = np.ptp(web.points[used], axis=0).max() or 1.0
    cell = np.round((web.points[used] - web.points[used].min(axis=0)) / (1e-9 * size)).astype(np.int64)
    order = np.lexsort(cell.T)
    same = np.flatnonzero((np.diff(cell[order], axis=0) == 0).all(axis=1))
    apart = [(used[order[i]], used[order[i + 1]]) for i in same]
    joined = set(map(tuple, pairs.tolist()))
    apart = [pair for pair in (tuple(sorted(map(int, pair))) for pair in apart) if pair not in joined]
    if apart:
        yield Finding(
            "mesh-file",
            f"{len(apart)} pairs of nodes are at one place and no line joins them, {apart[0][0]} and {apart[0][1]} "
            "among them: the web comes apart there; merge them where the file is made",
            "web",
        )


def _web_of(mesh, edges=None):
    """The web of a `refweb.net.mesh_readers.Mesh`; ``edges`` is the key of that name."""
    mesh = _without_threads(mesh)
    _check_cells(mesh)
    unused = any(block.kind in CORNERS for block in mesh.blocks)
    mesh, edge_groups, notes = decided(mesh, edges)
    points = np.asarray(mesh.points)
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InputError(f"points of shape {points.shape} must have the shape (nodes, 3)")
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    count = sum(len(block.cells) for block in mesh.lines)
    length, group = _joined("natural_length", mesh.lines), _joined("group", mesh.lines)
    length = _numbers("natural_length", length, count)
    groups = group_names(group, count)
    support = _numbers("support", mesh.point_data.get("support"), len(points))
    moved = mesh.point_data.get("displacement")
    if moved is not None and length is not None and support is not None and np.shape(moved) == points.shape:
        points = points - moved  # a frame, whose points are current positions
    broken = _numbers("broken", _joined("broken", mesh.lines), count)
    lines, of, share = _segments(mesh.lines, points)
    if length is not None:
        length = length[of] * share
    groups = None if groups is None else [groups[i] for i in of]
    if edge_groups:
        first = len(lines) - len(mesh.blocks[-1].cells)
        joined = {} if groups is None else members(groups, len(lines))
        for name, number in edge_groups.items():
            joined[name] = np.union1d(joined.get(name, np.zeros(0, dtype=np.int64)), first + number).astype(np.int64)
        groups = joined
    if mesh.groups is not None:
        named: dict = {} if groups is None else dict(members(groups, len(lines)))
        for name, cells in mesh.groups.items():
            named[name] = [*named.get(name, ()), *cells]
        once, order = _merged(lines, mesh)
        lines, length = lines[once], None if length is None else length[once]
        groups = {name: np.unique(order[list(cells)]) for name, cells in named.items()}
    broken = np.zeros(0, dtype=np.int64) if broken is None or mesh.groups is not None else np.flatnonzero(broken[of])
    rim = mesh.supports if support is None else np.flatnonzero(support)
    members_: dict = dict(kind="file", groups=groups, broken=broken, notes=notes)
    mask = _kept(mesh, lines, rim, len(points), unused)
    if mask is None:
        return Web(points, lines, length, rim=rim, names=mesh.names, **members_)
    new = np.cumsum(mask) - 1
    names = {name: new[list(nodes)].tolist() for name, nodes in mesh.names.items()}
    return Web(points[mask], new[lines], length, rim=new[rim], names=names, **members_)


def _kept(mesh, lines, rim, count, unused):
    """Mask of the nodes of the web, bool, shape (nodes,); None for all nodes.

    Nodes within curved lines are left out. With ``unused``, for Gmsh and faces, nodes without a line and a physical
    point are left out too.
    """
    mask = np.full(count, mesh.groups is None and not unused)
    curved = [block.cells[:, 2:] for block in mesh.lines if INNER.get(block.kind)]
    if (mask.all() and not curved) or lines.min() < 0 or lines.max() >= count:  # the web refuses such lines
        return None
    for inner in curved:
        mask[inner] = False
    mask[lines] = mask[rim] = True
    for nodes in mesh.names.values():
        mask[nodes] = True
    return None if mask.all() else mask


def _check_cells(mesh):
    """Refuse cells that are no lines, with their kinds."""
    unsupported = {block.kind for block in mesh.blocks} - {*INNER, "polyline", *HARMLESS, *CORNERS}
    if unsupported or not (mesh.lines or any(block.kind in CORNERS and len(block.cells) for block in mesh.blocks)):
        raise InputError(f"it holds {counted(mesh.blocks) or 'no'} cells: a web has only lines; {mesh.remedy}")


def _segments(blocks, points):
    """Lines (n, 2) of all blocks, the cell of each, and its share of the length of the cell."""
    lines, of, share, first = [], [], [], 0
    for block in blocks:
        pairs = pieces_of(block)
        pieces = len(pairs) // len(block.cells)
        lines.append(pairs)
        of.append(first + np.repeat(np.arange(len(block.cells)), pieces))
        first += len(block.cells)
        if pieces == 1:
            share.append(np.ones(len(pairs)))
            continue
        size = np.linalg.norm(np.diff(points[pairs % len(points)], axis=1)[:, 0], axis=1).reshape(-1, pieces)
        total = size.sum(axis=1, keepdims=True)
        share.append((size / np.where(total > 0.0, total, 1.0)).ravel())
    return np.concatenate(lines), np.concatenate(of), np.concatenate(share)


def _merged(lines, mesh):
    """Different elements of Gmsh, and the index of each: a file may list an element of two groups twice."""
    entity = np.concatenate([block.data.get("entity", np.arange(len(block.cells))) for block in mesh.lines])
    key = np.column_stack([np.sort(lines, axis=1), entity])
    _, first, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    position = np.argsort(order)[number.ravel()]
    return first[order], position


def _without_threads(mesh):
    """The mesh of a frame without the segments of its threads, which are no lines of the web."""

    def lines_of(block):
        lines = np.asarray(block.data["thread"]) == 0.0
        return block._replace(cells=block.cells[lines], data={key: data[lines] for key, data in block.data.items()})

    known = [{"thread", "natural_length"} <= block.data.keys() for block in mesh.blocks]
    return mesh._replace(blocks=[lines_of(b) if drawn else b for b, drawn in zip(mesh.blocks, known, strict=True)])


def _joined(key, blocks):
    """Data of a name of all cells; None if a block lacks it."""
    values = [block.data.get(key) for block in blocks]
    return None if any(value is None for value in values) else np.concatenate(values)


def _numbers(name, values, count):
    if values is None:
        return None
    values = np.asarray(values)
    if values.size != count or values.dtype.kind not in "biuf" or not np.isfinite(values).all():
        raise InputError(f"{name} of shape {values.shape} must be {count} finite numbers")
    return values.reshape(count).astype(np.float64)
