"""Reading a result folder for pictures: which frames it has, and one frame as lines in space with values on them."""

from __future__ import annotations

import contextlib
import io
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError

CELLS = ("line", "line3", "line4")
POINTS_ALONG_A_CURVE = 9


@dataclass(frozen=True)
class Shot:
    """One frame of a result folder.

    `paths` and `origin` [m], shape (lines, points, 3), are the lines now and undeformed; `tree` says that they close no
    loop; `fields` are values per line [SI], shape (lines,); `slack` flags, shape (lines,); `pins` the supports
    [m], shape (n, 3); `bodies` their points [m], shape (points, 3), and triangles, shape (triangles, 3), by name.
    """

    number: int
    time: float
    paths: np.ndarray
    origin: np.ndarray
    tree: bool
    fields: dict
    slack: np.ndarray
    pins: np.ndarray
    bodies: dict


def frames(folder):
    """The frames that ``web.pvd`` lists.

    Returns
    -------
    dict
        By frame number, ascending: its time [s] (statics: the step) and the path of each mesh, by name; ``web`` is one.

    Raises
    ------
    InputError
        Where ``web.pvd`` cannot be read or lists no web.
    """
    if not Path(folder).is_dir():
        raise InputError(f'"{folder}" is no folder')
    try:
        sets = list(ElementTree.parse(Path(folder) / "web.pvd").iter("DataSet"))
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(f'"{folder}" is not a result folder: web.pvd cannot be read ({error})') from None
    found = {}
    for item in sets:
        match = re.fullmatch(r"(.*)_(\d+)\.vtu", Path(item.get("file", "")).name)
        if match:
            frame = found.setdefault(int(match[2]), (float(item.get("timestep", 0)), {}))
            frame[1][match[1]] = Path(folder) / item.get("file")
    found = {number: found[number] for number in sorted(found) if "web" in found[number][1]}
    if not found:
        raise InputError(f'"{folder}" has no frames: web.pvd lists no file such as frames/web_000000.vtu')
    return found


def read(folder, number):
    """One frame.

    Raises
    ------
    InputError
        Where there is no such frame (names the nearest), or it cannot be read or has positions that are not finite.
    """
    found = frames(folder)
    if number not in found:
        close = min(found, key=lambda n: abs(n - number))
        raise InputError(f"frame = {number}: no such frame in {folder}, the nearest is {close}, the last {max(found)}")
    time, files = found[number]
    mesh = _mesh(files["web"])
    points = mesh.points
    if not np.isfinite(points).all():
        raise InputError(f"frame = {number}: has positions that are not finite, choose an earlier one")
    origin = points - mesh.point_data.get("displacement", 0.0)
    blocks = [(i, block.data) for i, block in enumerate(mesh.cells) if block.type in CELLS]
    if not blocks:
        raise InputError(f'"{files["web"]}" has no lines')
    samples = max(2 if cells.shape[1] == 2 else POINTS_ALONG_A_CURVE for _, cells in blocks)
    paths, start = (np.concatenate([_curves(x[cells], samples) for _, cells in blocks]) for x in (points, origin))
    fields = _fields(mesh, blocks)
    slack = np.asarray(fields.get("slack", np.zeros(len(paths)))) > 0.5
    pins = points[_supported(folder, mesh)]
    edges = sum(cells.shape[0] * (cells.shape[1] - 1) for _, cells in blocks)
    tree = edges < len(np.unique(np.concatenate([cells.ravel() for _, cells in blocks])))
    bodies = {name: _surface(_mesh(path)) for name, path in files.items() if name != "web"}
    return Shot(number, time, paths, start, tree, fields, slack, pins, bodies)


def _mesh(path):
    import meshio

    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        reason = said.getvalue() if isinstance(error, SystemExit) else str(error)
        raise InputError(f'"{path}" cannot be read: {reason or type(error).__name__}') from None


def _supported(folder, mesh):
    """Which points are supported: as the checkpoint has it, else those where a reaction acts."""
    count = len(mesh.points)
    try:
        with np.load(Path(folder) / "checkpoint.npz") as checkpoint:
            return checkpoint["supported"][:count].any(axis=1)
    except Exception:  # whatever a spoilt file makes of it
        return _size(mesh.point_data.get("reaction", np.zeros(count))) > 0


def _size(data):
    """Magnitudes of vectors, shape (n, 3); numbers, shape (n,), as they are."""
    return np.linalg.norm(data.reshape(len(data), -1), axis=1) if data.ndim > 1 else data


def _fields(mesh, blocks):
    """Cell data, and point data as the mean over the nodes of each line; of vectors the magnitude."""
    fields = {name: np.concatenate([_size(data[i]) for i, _ in blocks]) for name, data in mesh.cell_data.items()}
    for name, data in mesh.point_data.items():
        fields.setdefault(name, np.concatenate([_size(data)[cells].mean(axis=1) for _, cells in blocks]))
    return fields


def _curves(nodes, samples):
    """Points along elements of any order, shape (elements, samples, 3), whose two end nodes come first."""
    count = nodes.shape[1]
    where = np.array([0.0, 1.0, *np.arange(1, count - 1) / (count - 1)])
    powers = np.arange(count)
    weights = np.linspace(0, 1, samples)[:, None] ** powers @ np.linalg.inv(where[:, None] ** powers)
    return np.einsum("sn,enx->esx", weights, nodes)


def _surface(mesh):
    """Points and triangles of a body."""
    corners = [np.zeros((0, 3), dtype=int)]
    for block in mesh.cells:
        if block.type == "triangle":
            corners.append(block.data)
        elif block.type == "quad":
            corners += [block.data[:, [0, 1, 2]], block.data[:, [0, 2, 3]]]
    return mesh.points, np.concatenate(corners)
