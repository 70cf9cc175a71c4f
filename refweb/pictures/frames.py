"""Frames, the records that pictures draw: lines in space with values on them, supports and bodies.

`read` takes one from a result folder, `frame_of` makes one of meshes in memory.
"""

from __future__ import annotations

import contextlib
import io
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError

CELLS = ("line", "line3", "line4")
POINTS_ALONG_A_CURVE = 9


class Frame(NamedTuple):
    """What is drawn of one instant.

    Attributes
    ----------
    number : int
        Its number in a result folder.
    time : float
        Time [s]; in statics the load step, of a mode its number.
    paths, origin : ndarray, shape (lines, points, 3)
        Lines where they are and undeformed [m].
    tree : bool
        Whether the lines close no loop.
    fields : dict of str to ndarray, shape (lines,)
        Values per line [SI].
    slack : ndarray of bool, shape (lines,)
        Slack lines.
    supports : ndarray, shape (n, 3)
        Places of supported nodes [m].
    bodies : dict of str to Body
        Bodies by name.
    ends : ndarray of int, shape (lines, 2)
        Numbers of the nodes where lines begin and end.
    """

    number: int
    time: float
    paths: np.ndarray
    origin: np.ndarray
    tree: bool
    fields: dict
    slack: np.ndarray
    supports: np.ndarray
    bodies: dict
    ends: np.ndarray


class Body(NamedTuple):
    """Surface of a body: points [m], shape (points, 3), and triangles, shape (triangles, 3)."""

    points: np.ndarray
    triangles: np.ndarray


class Listed(NamedTuple):
    """A frame of ``web.pvd``: its time, and the path of each of its meshes by name."""

    time: float
    paths: dict


def listed(folder):
    """The frames that ``web.pvd`` lists.

    Returns
    -------
    dict of int to Listed
        By their numbers, ascending; ``web`` is a mesh of each.

    Raises
    ------
    InputError
        Where ``web.pvd`` cannot be read or lists no web.
    """
    if not Path(folder).is_dir():
        raise InputError(f'"{folder}" is not a folder')
    try:
        sets = list(ElementTree.parse(Path(folder) / "web.pvd").iter("DataSet"))
    except FileNotFoundError:
        raise InputError(f'"{folder}" is not a result folder, it holds no web.pvd: name one of refweb run') from None
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(f'"{folder}" is not a result folder: web.pvd cannot be read ({error})') from None
    found = {}
    for item in sets:
        match = re.fullmatch(r"(.*)_(\d+)\.vtu", Path(item.get("file", "")).name)
        if match:
            frame = found.setdefault(int(match[2]), Listed(float(item.get("timestep", 0)), {}))
            frame.paths[match[1]] = Path(folder) / item.get("file", "")
    found = {number: found[number] for number in sorted(found) if "web" in found[number].paths}
    if not found:
        raise InputError(f'"{folder}" has no frames: web.pvd lists no file such as frames/web_000000.vtu')
    return found


def read(folder, number):
    """One frame of a result folder.

    Raises
    ------
    InputError
        Where there is no such frame (names the nearest), or it cannot be read or has positions that are not finite.
    """
    found = listed(folder)
    if number not in found:
        close = min(found, key=lambda n: abs(n - number))
        raise InputError(f"frame = {number}: no such frame in {folder}, the nearest is {close}, the last {max(found)}")
    time, paths = found[number]
    web = _mesh(paths["web"])
    if not np.isfinite(web.points).all():
        raise InputError(f"frame = {number}: has positions that are not finite, choose an earlier one")
    if not any(block.type in CELLS for block in web.cells):
        raise InputError(f'"{paths["web"]}" has no lines')
    meshes = {"web": web, **{name: _mesh(path) for name, path in paths.items() if name != "web"}}
    return frame_of(number, time, meshes, _supported(folder, web))


def frame_of(number, time, meshes, supported):
    """A frame of meshes.

    Parameters
    ----------
    number : int
        Its number.
    time : float
        Its time [s], or load step.
    meshes : dict of str to meshio.Mesh
        ``web``, and bodies by name, as `refweb.results.vtu.meshes` makes them.
    supported : ndarray of bool, shape (points,)
        Which points of the web are supported.
    """
    web = meshes["web"]
    origin = web.points - web.point_data.get("displacement", 0.0)
    blocks = [(i, block.data) for i, block in enumerate(web.cells) if block.type in CELLS]
    samples = max(2 if cells.shape[1] == 2 else POINTS_ALONG_A_CURVE for _, cells in blocks)
    paths, start = (np.concatenate([_curves(x[cells], samples) for _, cells in blocks]) for x in (web.points, origin))
    fields = _fields(web, blocks)
    slack = np.asarray(fields.get("slack", np.zeros(len(paths)))) > 0.5
    edges = sum(cells.shape[0] * (cells.shape[1] - 1) for _, cells in blocks)
    tree = edges < len(np.unique(np.concatenate([cells.ravel() for _, cells in blocks])))
    bodies = {name: _surface(mesh) for name, mesh in meshes.items() if name != "web"}
    ends = np.concatenate([cells[:, :2] for _, cells in blocks])
    return Frame(number, time, paths, start, tree, fields, slack, web.points[supported], bodies, ends)


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
    return Body(mesh.points, np.concatenate(corners))
