"""Frames, the data of one instant for drawing: lines with values, supports, masses and bodies.

`read` reads a frame of a result folder, `frame_of` makes one from meshes in memory.

May change: private functions and `POINTS_ALONG_A_CURVE`. Must stay: kinds of cells in `CELLS` and names of data that
are read, which `results.vtu` gives, and keys of the checkpoint, which `results.folder` gives; fields of `Frame`, which
pictures, pages and `gym.images` read by name; `listed`, which `solution`, `paraview` and `record` import; `number_of`,
which `solution` and `record` import. Tests: ``tests/pictures/test_pictures.py``,
``tests/pictures/test_over_frames.py``.
"""

from __future__ import annotations

import contextlib
import functools
import io
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..results.vtu import SHAPE_SIZE

CELLS = ("line", "line3", "line4")
POINTS_ALONG_A_CURVE = 9


class Frame(NamedTuple):
    """Data of one instant for drawing.

    Attributes
    ----------
    number : int
        Its number in a result folder.
    time : float
        Time [s]; in statics the load step, of a mode its number.
    paths, origin : ndarray, shape (lines, points, 3)
        Lines in deformed and undeformed position [m].
    tree : bool
        True if the lines form no closed loop.
    fields : dict of str to ndarray, shape (lines,)
        Values per line [SI].
    slack : ndarray of bool, shape (lines,)
        Slack lines.
    supports : ndarray, shape (n, 3)
        Positions of supported nodes [m].
    bodies : dict of str to Body
        Bodies by name.
    ends : ndarray of int, shape (lines, 2)
        Numbers of the first and last node of each line.
    lifted : ndarray, shape (n, 3)
        Displacements of supported nodes [m].
    swing : ndarray, shape (lines, points, 3), or None
        Displacement of a mode along the paths [m]; None for a run that is no modes.
    masses : Masses or None
        Point masses; None if there are none.
    """

    number: int
    time: float
    paths: np.ndarray
    origin: np.ndarray
    tree: bool
    fields: dict[str, Any]
    slack: np.ndarray
    supports: np.ndarray
    bodies: dict[str, Any]
    ends: np.ndarray
    lifted: np.ndarray
    swing: np.ndarray | None
    masses: Masses | None = None

    @property
    def broken(self):
        """Broken lines, which are slack as well, bool, shape (lines,)."""
        return np.asarray(self.fields.get("broken", np.zeros(len(self.paths)))) > 0.5

    def held_as(self, last):
        """The frame with the supports of the last frame, for a file that contains none."""
        return self if len(self.supports) else self._replace(supports=last.supports, lifted=last.lifted)

    def posed(self, scale=1.0, phase=1.0):
        """The frame with displacements times a factor; a mode is also multiplied by its phase −1…1."""
        if self.swing is not None:
            further = scale * phase - 1.0
            bodies = {name: body.shifted(further * body.swing) for name, body in self.bodies.items()}
            return self._replace(paths=self.paths + further * self.swing, bodies=bodies)
        if scale == 1.0:
            return self
        further, masses = scale - 1.0, self.masses
        return self._replace(
            paths=self.origin + scale * (self.paths - self.origin),
            supports=self.supports + further * self.lifted,
            bodies={name: body.shifted(further * body.displacement) for name, body in self.bodies.items()},
            masses=masses and masses._replace(points=masses.points + further * masses.displacement),
        )


class Body(NamedTuple):
    """Surface of a body: points and displacement [m], shape (points, 3), and triangles, shape (triangles, 3).

    Of a mode ``swing`` is the part of the displacement that it has [m], else zero.
    """

    points: np.ndarray
    triangles: np.ndarray
    displacement: np.ndarray
    swing: np.ndarray

    def shifted(self, by):
        """The body with its points moved by vectors [m]."""
        return self._replace(points=self.points + by)


class Masses(NamedTuple):
    """Point masses: points and displacement [m], both of shape (n, 3), and mass [kg], shape (n,)."""

    points: np.ndarray
    displacement: np.ndarray
    mass: np.ndarray


class Listed(NamedTuple):
    """A frame of ``web.pvd``: its time, and the path of each of its meshes by name."""

    time: float
    paths: dict[str, Any]


def listed(folder):
    """Read ``web.pvd``: frames by number, ascending, each a `Listed` with the mesh ``web``.

    A file that cannot be read or lists no web is refused.
    """
    if not Path(folder).is_dir():
        raise InputError(f"{folder} is not a folder")
    try:
        sets = list(ElementTree.parse(Path(folder) / "web.pvd").iter("DataSet"))
    except FileNotFoundError:
        raise InputError(f'"{folder}" is not a result folder, it holds no web.pvd: name one of refweb run') from None
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(f'"{folder}" is not a result folder: web.pvd cannot be read ({error})') from None
    paths = {}
    for item in sets:
        match = re.fullmatch(r"(.*)_(\d+)\.vtu", Path(item.get("file", "")).name)
        if match:
            frame = paths.setdefault(int(match[2]), Listed(float(item.get("timestep", 0)), {}))
            frame.paths[match[1]] = Path(folder) / item.get("file", "")
    paths = {number: paths[number] for number in sorted(paths) if "web" in paths[number].paths}
    if not paths:
        raise InputError(f'"{folder}" has no frames: web.pvd lists no file such as frames/web_000000.vtu')
    return paths


def number_of(frame, known):
    """The number of a frame, checked against the known numbers; a negative number counts from the end."""
    if -len(known) <= frame < 0:
        return known[frame]
    if frame not in known:
        close = min(known, key=lambda number: abs(number - frame))
        raise InputError(f"frame = {frame}: there is no such frame, the nearest is {close}, the last {known[-1]}")
    return frame


def read(folder, number, known_paths=None):
    """Read one frame of a result folder, whose `listed` frames may be given; refuses positions that are not finite."""
    time, paths = (known_paths or listed(folder))[number]
    web = _mesh(paths["web"])
    if not np.isfinite(web.points).all():
        raise InputError(f"frame = {number}: has positions that are not finite, choose an earlier one")
    if not any(block.type in CELLS for block in web.cells):
        raise InputError(f'"{paths["web"]}" has no lines')
    meshes = {"web": web, **{name: _mesh(path) for name, path in paths.items() if name != "web"}}
    return frame_of(number, time, meshes, _supported(folder, web), _point_masses(folder))


def frame_of(number, time, meshes, supported, point_mass=None):
    """Make a frame from meshes by name, the ``web`` and bodies, as `refweb.results.vtu.meshes` makes them.

    ``supported (points,)`` is True for supported points of the web, and ``point_mass (points,)`` is in kg.
    """
    web = meshes["web"]
    origin = web.points - web.point_data.get("displacement", 0.0)
    blocks = [(i, block.data) for i, block in enumerate(web.cells) if block.type in CELLS]
    samples = max(2 if cells.shape[1] == 2 else POINTS_ALONG_A_CURVE for _, cells in blocks)
    paths, start = (np.concatenate([_curves(x[cells], samples) for _, cells in blocks]) for x in (web.points, origin))
    fields = _fields(web, blocks)
    slack = np.asarray(fields.get("slack", np.zeros(len(paths)))) > 0.5
    edges, used = 0, np.zeros(len(web.points), dtype=bool)
    for _, cells in blocks:
        edges, used[cells] = edges + cells.shape[0] * (cells.shape[1] - 1), True
    tree = bool(edges < np.count_nonzero(used))
    amplitude = _amplitude(web.points, web.point_data["shape"]) if "shape" in web.point_data else 0.0
    bodies = {name: _surface(mesh, amplitude) for name, mesh in meshes.items() if name != "web"}
    ends = np.concatenate([cells[:, :2] for _, cells in blocks])
    moved, swing, masses = np.broadcast_to(web.points - origin, web.points.shape), None, None
    if "shape" in web.point_data:
        mode = amplitude * web.point_data["shape"]
        swing = np.concatenate([_curves(mode[cells], samples) for _, cells in blocks])
    if point_mass is not None and len(at := np.flatnonzero(point_mass[: len(web.points)] > 0.0)):
        masses = Masses(web.points[at], moved[at], point_mass[at])
    fixed, lifted = web.points[supported], moved[supported]
    return Frame(number, time, paths, start, tree, fields, slack, fixed, bodies, ends, lifted, swing, masses)


def _amplitude(points, shape):
    """Amplitude [m] of a mode that has been added to points [m], both of shape (points, 3).

    The amplitude is a share of the diagonal of the box around the undeformed points, which an iteration finds.
    """
    amplitude = 0.0
    for _ in range(100):
        size = SHAPE_SIZE * np.linalg.norm(np.ptp(points - amplitude * shape, axis=0))
        if abs(size - amplitude) <= 1e-14 * size:
            break
        amplitude = size
    return amplitude


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
    """Mask of supported points, from the checkpoint, else the points with a reaction."""
    count = len(mesh.points)
    try:
        with np.load(Path(folder) / "checkpoint.npz") as checkpoint:
            return checkpoint["supported"][:count].any(axis=1)
    except Exception:  # whatever a spoilt file makes of it
        return _size(mesh.point_data.get("reaction", np.zeros(count))) > 0


def _point_masses(folder):
    """Point mass on each node [kg] from the checkpoint; None if it has none."""
    try:
        with np.load(Path(folder) / "checkpoint.npz") as checkpoint:
            return checkpoint["point_masses"] if "point_masses" in checkpoint else None
    except Exception:  # whatever a spoilt file makes of it
        return None


def _size(data):
    """Magnitudes of vectors, shape (n, 3); numbers, shape (n,), are unchanged."""
    return np.linalg.norm(data.reshape(len(data), -1), axis=1) if data.ndim > 1 else data


def _fields(mesh, blocks):
    """Values of lines: cell data, and the largest point data over the nodes of a line; magnitudes of vectors."""
    fields = {name: np.concatenate([_size(data[i]) for i, _ in blocks]) for name, data in mesh.cell_data.items()}
    for name, data in mesh.point_data.items():
        if name not in fields:
            size = _size(data)
            fields[name] = np.concatenate([functools.reduce(np.maximum, size[cells].T) for _, cells in blocks])
    return fields


def _curves(nodes, samples):
    """Points along elements of any order, shape (elements, samples, 3), whose two end nodes come first."""
    count = nodes.shape[1]
    if count == samples == 2:
        return nodes
    where = np.array([0.0, 1.0, *np.arange(1, count - 1) / (count - 1)])
    powers = np.arange(count)
    weights = np.linspace(0, 1, samples)[:, None] ** powers @ np.linalg.inv(where[:, None] ** powers)
    return np.einsum("sn,enx->esx", weights, nodes)


def _surface(mesh, amplitude):
    """The `Body` of a mesh, in a mode with a factor [m] on its shape."""
    corners = [np.zeros((0, 3), dtype=int)]
    for block in mesh.cells:
        if block.type == "triangle":
            corners.append(block.data)
        elif block.type == "quad":
            corners += [block.data[:, [0, 1, 2]], block.data[:, [0, 2, 3]]]
    moved = np.reshape(mesh.point_data.get("displacement", np.zeros((1, 3))), (-1, 3))
    swing = amplitude * np.reshape(mesh.point_data.get("shape", np.zeros((1, 3))), (-1, 3))
    return Body(mesh.points, np.concatenate(corners), moved, swing)
