"""Result folders: frames, history and summary, so written that a kill at any moment leaves a folder that opens.

Every file but ``history.csv``, which grows by whole rows, is written beside its place and then moved there.
"""

from __future__ import annotations

import json
import os
import pathlib
import re
import shutil
import tempfile
from xml.sax.saxutils import quoteattr

import numpy as np

from .bodies import row_names, surface
from .inputs import InputError, short

OWN = re.compile(
    r"scene\.toml|checkpoint\.npz|(history|modes)\.csv|run\.json|web\.pvd|web\.png|web\.gif|frames/[^/]+_\d{6,}\.vtu"
    r"|(frames/)?\.refweb-[^/]+"
)
"""Files that a run writes, and that ``--force`` removes."""
POINT_DATA = ("displacement", "velocity", "reaction", "mass")
SHAPE_SIZE = 0.05
"""Largest displacement of a drawn mode over the diagonal of the net's bounding box."""
CELL_DATA = ("tension", "stress", "strain", "natural_length", "slack")


def write_atomically(path, write):
    """Call ``write(file name)`` for a file beside ``path`` and move it there."""
    handle, name = tempfile.mkstemp(prefix=".refweb-", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    try:
        write(name)
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        pathlib.Path(name).unlink(missing_ok=True)
        raise


def write_text(path, text):
    """Write a text file atomically, as UTF-8."""
    write_atomically(path, lambda name: pathlib.Path(name).write_text(text, encoding="utf-8"))


def _drawn(net):
    """Weights of a cell's nodes at the places where VTK has the nodes of a line of that order, shape (nodes, nodes).

    VTK's cubic has its inner nodes at thirds, this element at the Gauss–Lobatto points: the curve through the element's
    own nodes would have 10 % less sag than the element.
    """
    order = net.order
    places = np.array([0.0, 1.0, *np.arange(1, order) / order])
    powers = np.arange(order + 1)
    return places[:, None] ** powers @ np.linalg.inv(net.places[:, None] ** powers)


def frame_data(state, shape=None):
    """Points, and point and cell data by name, of a state's web, as VTU has them; one cell per element.

    The ``shape`` of a mode, of shape (nodes, 3), is point data as well, and is added to points and displacement.
    """
    net = state.system.net
    state.system.prepare(state.time)
    fields = (state.position, *(getattr(state, name) for name in ("x", "v", "reaction")), net.mass)
    points, *point_data = (values[: net.nodes].copy() for values in fields)
    curved = [points, *point_data[:2]]
    if shape is not None:
        large = SHAPE_SIZE * np.linalg.norm(np.ptp(points, axis=0))
        for values in curved[:2]:
            values += large * shape
        point_data.append(shape.copy())
        curved.append(point_data[-1])
    if net.order > 2:
        inner, weights = net.cells[:, 2:], _drawn(net)[2:]
        for values in curved:
            values[inner] = np.einsum("ia,cax->cix", weights, values[net.cells])
    cells = (state.element_tension, state.element_tension / net.area, state.element_strain)
    cell_data = dict(zip(CELL_DATA, (*cells, net.natural_length, state.element_slack), strict=True))
    if net.subdivide > 1:
        cell_data["line"] = net.line
    cell_data = {key: np.asarray(values, dtype=float) for key, values in cell_data.items()}
    return points, dict(zip((*POINT_DATA, "shape"), point_data, strict=False)), cell_data


def write_frame(path, state, shape=None):
    """Write the web of a state as VTU: current positions, its lines in the web's own numbering, float64.

    Elements of order 2 and 3 are quadratic and cubic cells; those of a line that is divided follow each other. A
    ``shape`` is drawn on it.
    """
    import meshio

    points, point_data, cell_data = frame_data(state, shape)
    net = state.system.net
    mesh = meshio.Mesh(
        points,
        [({1: "line", 2: "line3", 3: "line4"}[net.order], net.cells)],
        point_data=point_data,
        cell_data={key: [values] for key, values in cell_data.items()},
    )
    write_atomically(path, lambda name: meshio.write(name, mesh, file_format="vtu"))


def write_body(path, body, state):
    """Write the surface of a body as VTU, at its current position."""
    import meshio

    points, triangles = surface(body, state.position[body.row])
    data = {"displacement": state.x, "velocity": state.v, "reaction": state.reaction}
    point_data = {name: np.tile(values[body.row], (len(points), 1)) for name, values in data.items()}
    mesh = meshio.Mesh(points, [("triangle", triangles)], point_data=point_data)
    write_atomically(path, lambda name: meshio.write(name, mesh, file_format="vtu"))


def _is_result(folder):
    """Whether a folder holds a ``run.json`` that a run of refweb wrote."""
    try:
        run = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(run, dict) and "refweb" in (run.get("versions") or ())


def check_folder(folder, force=False):
    """Refuse a result folder that cannot be written, before anything is computed.

    Raises
    ------
    InputError
        Where ``folder`` is a file, cannot be written, or is not empty and ``force`` is not given; with ``force`` where
        it holds no ``run.json`` of refweb.
    """
    folder = pathlib.Path(folder)
    name = f"result folder {short(str(folder))}"
    try:
        existing = next(p for p in (folder.absolute(), *folder.absolute().parents) if p.exists() or p.is_symlink())
        for part in (existing, *([folder / "frames"] if (folder / "frames").exists() else [])):
            if not part.is_dir():
                raise InputError(f"{name}: {part.name} is a file, not a folder")
            if not os.access(part, os.W_OK | os.X_OK):
                raise InputError(f"{name}: {part.name} cannot be written: choose another folder")
        full = existing == folder.absolute() and any(folder.iterdir())
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{name}: cannot be used: {getattr(error, 'strerror', None) or error}") from None
    if full and not force:
        raise InputError(f"{name}: is not empty: choose another folder, or force (--force) to replace its results")
    if full and not _is_result(folder):
        raise InputError(f"{name}: holds no run.json of refweb, so it is no result of it: nothing was removed")


def clear(folder, keep=("run.json",)):
    """Remove what a run wrote except ``keep``, and nothing else."""
    for path in [*folder.iterdir(), *(folder / "frames").glob("*")]:
        name = path.relative_to(folder).as_posix()
        if path.is_file() and OWN.fullmatch(name) and name not in keep:
            path.unlink()


def copy(source, target):
    """Copy what a run wrote from one folder to another, ``run.json`` last."""
    target = pathlib.Path(target)
    (target / "frames").mkdir(parents=True, exist_ok=True)
    clear(target)
    own = [p for p in source.rglob("*") if p.is_file() and OWN.fullmatch(p.relative_to(source).as_posix())]
    for path in sorted(own, key=lambda p: p.name == "run.json"):
        place = target / path.relative_to(source)
        write_atomically(place, lambda name, path=path: shutil.copyfile(path, name))


def number(value):
    """A number as text that reads back to the same float."""
    return repr(float(value))


class Folder:
    """A result folder that is being written.

    Parameters
    ----------
    path : path-like
        The folder; made where it does not exist, cleared of earlier results where it does.
    scene : refweb.Scene
        Written as ``scene.toml`` with all defaults filled in.
    columns : sequence of str
        Header of ``history.csv``.
    run : dict
        First content of ``run.json``.
    table : str
        Name of the history's file.
    """

    def __init__(self, path, scene, columns, run, table="history.csv"):
        import tomli_w

        text = tomli_w.dumps(scene.to_dict())
        self.path = pathlib.Path(path)
        try:
            (self.path / "frames").mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"result folder {short(str(path))}: cannot be made: {error.strerror}") from None
        self._columns, self._table = columns, table
        self.summary(run)
        clear(self.path)
        write_text(self.path / "scene.toml", text)
        self._start()

    def _start(self):
        self._history = open(self.path / self._table, "w", encoding="utf-8", newline="\n")
        self.row(self._columns)
        self._listed = []
        self._list_frames()

    def restart(self, run):
        """Remove rows and frames and begin anew; ``run`` is the content of ``run.json``."""
        self.close()
        self.summary(run)
        clear(self.path, keep=("run.json", "scene.toml"))
        self._start()

    def row(self, values):
        """Append a row to the history."""
        text = ",".join(v if isinstance(v, str) else number(v) for v in values)
        self._history.write(text + "\n")
        self._history.flush()

    def frame(self, number, state, shape=None):
        """Write frame and checkpoint of a state and list the frame in ``web.pvd``, with a ``shape`` as its mode."""
        name, time = f"frames/web_{number:06d}.vtu", state.time if shape is None else number
        write_frame(self.path / name, state, shape)
        self._listed.append((time, 0, name))
        for part, body in enumerate(state.system.net.bodies, start=1):
            name = f"frames/{body.name}_{number:06d}.vtu"
            write_body(self.path / name, body, state)
            self._listed.append((time, part, name))
        net = state.system.net
        arrays = {"time": state.time, "positions": state.position, "displacements": state.x, "velocities": state.v}
        arrays |= {"supported": state.system.supported, "bodies": np.array(row_names(net.bodies), dtype=str)}
        write_atomically(self.path / "checkpoint.npz", lambda file: np.savez(file, **arrays))
        self._list_frames()

    def _list_frames(self):
        rows = "".join(
            f'    <DataSet timestep="{number(time)}" group="" part="{part}" file={quoteattr(name)}/>\n'
            for time, part, name in self._listed
        )
        write_text(
            self.path / "web.pvd",
            '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
            f"  <Collection>\n{rows}  </Collection>\n</VTKFile>\n",
        )

    def summary(self, run):
        """Write ``run.json``."""
        write_text(self.path / "run.json", json.dumps(run, indent=1, ensure_ascii=False, allow_nan=False) + "\n")

    def close(self):
        """Close the history."""
        self._history.close()
