"""Nodes of the web that are attached to a point of a body.

A node that is attached to a free body is no unknown. It moves with the body, at the arm a from the centre of mass, with
the velocity v + ω × a. A force f on it acts on the body, as the force f and the moment a × f. Its mass m is added to
the body: the centre of mass of both moves by s, and the tensor of inertia about it is

    J + M (|s|² 1 − s⊗s) + Σ m (|a|² 1 − a⊗a),

M being the mass of the body alone; the row of the body is that of this centre. Nothing else changes in the equations,
which have no multipliers. On a fixed body a node is a support. One that tables move has no mass, and its nodes none.

May change: `_joined` and `_about`, within the formula above. Must stay: keys and docstring of `Attach` (scene format
and help; after a change write ``validation/REFERENCE.md`` anew); the fields ``carried`` and ``points`` of the body and
the zero mass of its nodes, from which `net.rotation` moves the nodes and `system.attached_nodes` and
`system.resting_bodies` make tangents. Those three change together with this file. Tests:
``tests/effects/test_attach.py``, ``tests/test_contract.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..kernels import FORCE, kernel
from ..messages import quote
from ..tables import Several, Table, nodes, table, text, vector
from .base import PrescribedMotion, column

if TYPE_CHECKING:
    from ..net.net import Net


@kernel(FORCE)
def hold(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        for i in range(3):
            x[cells[c, 0], i], v[cells[c, 0], i] = data[c, i], 0.0


@table
class Attach(Table):
    """Nodes of the web that are attached to a body, with lines that are free to turn there.

    Their mass is the body's, whose row is the centre of mass of all: position and velocity that are observed are those
    of this; a body that ``[[motion]]`` moves has none, and its nodes neither. A sphere turns in space where it has
    nodes. Nodes on a fixed body are supports. The point may lie inside of the body or outside; contact with the body is
    that of any line, and where there is any a line may not begin in the core of the body. Drag of the body acts at the
    centre of mass.

    Parameters
    ----------
    body : str
        Name of the body.
    node : int, str or list
        Nodes, by number or name.
    point : sequence of 3 float, optional
        Point on the body of all these nodes, along its axes from its position [m]; by default the position of each node
        in the web. Natural lengths of lines stay those of the positions in the web.

    Raises
    ------
    InputError
        From ``extend``, for an unknown node or body, a free ring, which keeps its plane, and a node that is attached
        twice. In a scene, for a node that is also supported, moved or linked, for a free body with nodes and a
        consistent mass, and for friction of lines on each other there by "central-difference".

    Examples
    --------
        [[attach]]
        body = "hub"
        node = [0, 5]

        [[attach]]
        body = "box"
        node = 7
        point = [0.5, 0.5, 0.2]
    """

    several = True

    body: str = text(limit=80)
    node: Several = nodes()
    point: Several = vector(default=None, unit="m")

    def extend(self, net: Net) -> Net:
        """The net with the nodes attached to the body."""
        body = net.body_of(self.body)
        number = net.bodies.index(body)
        if body.shape.planar and not body.fixed:
            raise InputError(
                f"body = {quote(self.body)} is a {type(body.shape).__name__.lower()}, which keeps its plane: give it "
                "another shape, such as a cylinder, or fixed = true"
            )
        nodes_found = np.unique(net.web.find(self.node))
        for body_here in net.bodies:
            for node in np.intersect1d(nodes_found, body_here.carried):
                raise InputError(f'node = {node} is on body "{body_here.name}" already')
        points = (net.points[nodes_found] - net.points[body.row]) @ body.axes.T
        if self.point is not None:
            points[:] = self.point + body.offset
        carried, points = (*body.carried, *nodes_found.tolist()), np.vstack([body.points, points])
        bodies, mass, places = list(net.bodies), net.mass.copy(), net.points.copy()
        bodies[number] = replace(body, carried=carried, points=points)
        if body.moved:
            bodies[number], mass[nodes_found] = replace(bodies[number], turns=True), 0.0
        elif not body.fixed:
            shift, bodies[number] = _joined(bodies[number], mass[body.row], mass[nodes_found])
            mass[body.row] += mass[nodes_found].sum()
            mass[nodes_found] = 0.0
            places[body.row] += shift
        return replace(net, mass=mass, points=places, bodies=tuple(bodies))

    def on(self, net: Net) -> PrescribedMotion | list[Any]:
        """The nodes on a fixed body as supports; nothing for a free body."""
        body = net.body_of(self.body)
        carried = np.isin(body.carried, net.web.find(self.node))
        if not body.fixed:
            return []
        rows = np.array(body.carried)[carried]
        data = body.points[carried] @ body.axes - (net.points[rows] - net.points[body.row])
        data[np.abs(data) <= 1e-13 * np.abs(body.points).max()] = 0.0  # of rounding
        return PrescribedMotion(cells=column(rows), data=np.ascontiguousarray(data), kernel=hold)


def _joined(body, mass, added):
    """(Displacement of the centre of mass, the body with masses at the last of its points)."""
    last = body.points[len(body.points) - len(added) :]
    shift = added @ last / (mass + added.sum())
    inertia = body.inertia + mass * _about(shift) + sum(m * _about(p - shift) for m, p in zip(added, last, strict=True))
    moved = shift @ body.axes
    velocity = np.add(body.velocity, np.cross(body.angular_velocity, moved))
    return moved, replace(
        body,
        inertia=inertia,
        velocity=tuple(velocity.tolist()),
        turns=True,
        points=body.points - shift,
        offset=body.offset - shift,
    )


def _about(p):
    """|p|² 1 − p⊗p."""
    return p @ p * np.eye(3) - np.outer(p, p)
