"""A state as meshes of its web and its bodies: points, cells and data of both; and their VTU files.

meshio 5.3 takes 13 ms and 418 kB for a frame of the web of hexagon-impact, of 3 554 nodes and 5 165 elements.

May change: private functions; `SHAPE_SIZE`, the drawn size of a mode. Must stay: names of data, a file format that
`net.mesh_file`, `pictures.frames` and ParaView read (a new one may be added); points in the order of the net's nodes;
`write_mesh`, which `folder` imports. Tests: ``tests/results/test_frames.py``.
"""

from __future__ import annotations

import functools

import numpy as np

from ..net.threads import COLUMNS
from .files import write_atomically

POINT_DATA: tuple[str, ...] = ("displacement", "velocity", "reaction", "mass", "support")
"""Names of data of nodes; ``support`` is 1 if all components are supported, else 0."""
SHAPE_SIZE = 0.05
"""Largest displacement of a drawn mode over the diagonal of the net's bounding box."""
CELL_DATA: tuple[str, ...] = ("tension", "stress", "strain", "natural_length", "slack")


def meshes(state, shape=None):
    """The meshes of a state by name: ``web``, and its bodies.

    Parameters
    ----------
    state : refweb.results.state.State
        State of the frame.
    shape : ndarray, shape (rows, 3), optional
        Mode shape that is added to the positions.

    Returns
    -------
    dict of str to meshio.Mesh
    """
    net = state.system.net
    web = web_mesh(state, None if shape is None else shape[: net.nodes])
    return {"web": web, **{body.name: body_mesh(body, state, shape) for body in net.bodies}}


def web_mesh(state, shape=None):
    """The web of a state: current positions, and lines in the numbering of the web, as float64.

    Elements of order 2 and 3 are quadratic and cubic cells. The elements of one line follow each other. Segments of
    threads come after all lines; their cell data ``thread`` is the number of their thread from 1 on, 0 of lines. A mode
    ``shape`` is added to the positions.
    """
    import meshio

    points, point_data, cell_data = frame_data(state, shape)
    net = state.system.net
    lines = [({1: "line", 2: "line3", 3: "line4"}[net.order], net.cells)]
    cells = {key: [values] for key, values in cell_data.items()}
    for number, thread in enumerate(net.threads, 1):
        cells.setdefault("thread", [np.zeros(len(net.cells))])
        lines.append(("line", thread.segments))
        drawn = _of_thread(state, thread) | {"thread": float(number), "line": -1.0}
        for key, values in cells.items():
            values.append(np.broadcast_to(drawn.get(key, 0.0), len(thread.distances)).copy())
    return meshio.Mesh(points, lines, point_data, cells)


def _of_thread(state, thread):
    """Cell data of the segments of a thread by name; without friction its natural length in the shares of lengths."""
    tension, stress, strain, _ = state.threads[thread.name][:COLUMNS]
    apart = np.linalg.norm(np.diff(state.position[thread.rows], axis=0), axis=1)
    if thread.rings:
        tension, slips = np.split(state.threads[thread.name][COLUMNS:], [len(apart)])
        natural = thread.natural_lengths(slips)
        stress, strain = tension / thread.line.area[0], apart / natural - 1.0
    else:
        natural = apart * (thread.natural_length / apart.sum()) if apart.any() else apart
    slack = np.asarray(strain <= thread.line.slackness[0], dtype=float)
    return dict(zip(CELL_DATA, (tension, stress, strain, natural, slack), strict=True))


def body_mesh(body, state, shape=None):
    """The surface of a body at its current position, as it has turned; its points have their own velocity.

    The ``shape`` of a mode (rows, 3) moves and turns it, to first order.
    """
    import meshio

    rotation, centre = body.rotation(state.x) if body.turn is not None else None, state.position[body.row]
    points, triangles = body.surface(centre, rotation)
    data = {"displacement": state.x, "velocity": state.v, "reaction": state.reaction}
    point_data: dict = {name: np.tile(values[body.row], (len(points), 1)) for name, values in data.items()}
    if rotation is not None:
        away = points - centre
        point_data["displacement"] += away - away @ rotation
        point_data["velocity"] += np.cross(body.turning(state.x, state.v), away)
    if shape is not None:
        move = np.tile(shape[body.row], (len(points), 1))
        if body.spin is not None:
            move += np.cross(shape[body.spin], points - centre)
        points = points + _drawn_size(state) * move
        point_data["displacement"] = point_data["displacement"] + _drawn_size(state) * move
        point_data["shape"] = move
    return meshio.Mesh(points, [("triangle", triangles)], point_data)


def _drawn_size(state):
    """Size of the largest displacement of a mode as it is drawn [m]."""
    return SHAPE_SIZE * np.linalg.norm(np.ptp(state.position[: state.system.net.nodes], axis=0))


def write_mesh(path, mesh):
    """Write a mesh as VTU, arrays compressed by zlib, atomically."""
    write_atomically(path, functools.partial(mesh.write, file_format="vtu", compression="zlib"))


def frame_data(state, shape=None):
    """Points, and point and cell data by name, of the web of a state as in VTU files; one cell per element.

    The ``shape`` of a mode (nodes, 3) is point data as well, and is added to points and displacement.
    """
    net = state.system.at(state.time, state.x).net
    fields = (state.position, *(getattr(state, name) for name in ("x", "v", "reaction")), net.mass)
    points, *point_data = (values[: net.nodes].copy() for values in fields)
    curved = [points, *point_data[:2]]
    point_data.append(state.system.fixed[: net.nodes].all(axis=1).astype(float))
    if shape is not None:
        for values in curved[:2]:
            values += _drawn_size(state) * shape
        point_data.append(shape.copy())
        curved.append(point_data[-1])
    if net.order > 2:
        inner, weights = net.cells[:, 2:], _drawn(net)[2:]
        for values in curved:
            values[inner] = np.einsum("ia,cax->cix", weights, values[net.cells])
    cells = (state.element_tension, state.element_tension / net.area, state.element_strain)
    cell_data = dict(zip(CELL_DATA, (*cells, net.natural_length, state.element_slack), strict=True))
    if state.plastic_strain is not None:
        cell_data["plastic_strain"] = state.plastic_strain
    if np.isfinite(net.strength).any():
        cell_data["utilisation"] = state.element_tension / (net.area * net.strength)
    if state.system.weakness is not None:
        cell_data["broken"] = np.isin(np.arange(len(net.cells)), net.broken)
    if net.subdivide > 1:
        cell_data["line"] = net.line
    cell_data = {key: np.asarray(values, dtype=float) for key, values in cell_data.items()}
    return points, dict(zip((*POINT_DATA, "shape"), point_data, strict=False)), cell_data


def _drawn(net):
    """Weights of a cell's nodes at the nodes of a VTK cell of the same order, shape (nodes, nodes).

    VTK's cubic cell has its inner nodes at thirds, the element of order 3 at the Gauss–Lobatto points. A VTK cell
    through the nodes of the element would have 10 % less sag than the element.
    """
    order = net.order
    places = np.array([0.0, 1.0, *np.arange(1, order) / order])
    powers = np.arange(order + 1)
    return places[:, None] ** powers @ np.linalg.inv(net.places[:, None] ** powers)
