"""Dead loads: forces of fixed direction on nodes, and forces and torques on bodies, with an optional factor over time.

May change: messages. Must stay: keys and docstring of `Load` (scene format and help; after a change write
``validation/REFERENCE.md`` anew); the name "load", by which `statics.simulation` finds dead loads, and which
`statics.gradients.KNOWN` has; `numbers`, with which `dynamics.commands` writes another force over the first three
numbers of a cell. Kernels are in `outer_load` and `body_load`. Tests: ``tests/test_contract.py``,
``tests/dynamics/test_attitude.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..messages import quote
from ..tables import Several, Table, choice, nodes, rows, table, text, vector
from .outer_load import nodal_load

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.net import Net
    from ..net.rigid_body import RigidBody
    from .base import ForceTerm


@table
class Load(Table):
    """A force on each of some nodes, or a force and a torque on a free body.

    A force on a body acts at its centre of mass. Loads on bodies act in dynamics alone, and not in the equilibrium that
    a run may start from.

    Parameters
    ----------
    node : int, str or list, optional
        Nodes, by number or name.
    body : str, optional
        Name of a free body, in place of nodes.
    force : sequence of 3 float, optional
        Force on each node, or on the body [N].
    torque : sequence of 3 float, optional
        Torque on the body [N m].
    axes : {"space", "body"}
        Axes of force and torque on a body: x, y and z, or those of the body, with which they turn.
    factor : sequence of (t, factor), optional
        Factor on the load over time: linear between the times, constant before and after them. Without it the factor
        is 1, in statics the load step.

    Raises
    ------
    InputError
        For a force that is not three finite numbers, a factor without rows or with times that do not increase, nodes
        beside a body or neither, and a torque or axes of nodes. From ``on``, for a node that the web does not have,
        and axes of a body without orientation. From ``extend``, for a body that there is not, that is not free or turns
        about an axle, for a torque on a ring, and for a body in statics.

    Examples
    --------
        [[load]]
        node = "centre"
        force = [0.0, 0.0, 1.0]
        factor = [[0.0, 0.0], [0.1, 1.0]]

        [[load]]
        body = "hub"
        torque = [0.0, 0.0, 0.5]
    """

    several = True

    node: Several = nodes(default=None)
    body: str | None = text(default=None, limit=80)
    force: Several = vector(default=None, unit="N")
    torque: Several = vector(default=None, unit="N m")
    axes: str = choice("space", "body", default="space")
    factor: Several = rows(2, default=None, increasing=True)

    def check(self) -> None:
        """Refuse a load on nothing, on nodes and a body at once, and of nothing."""
        if self.node is None and self.body is None:
            raise InputError("node is missing: give node = ... or body = ...")
        if self.body is None:
            if self.force is None:
                raise InputError("force is missing: give force = ... [N]")
            if self.torque is not None:
                raise InputError(f"torque = {quote(self.torque)} has no meaning for nodes: it acts on a body")
            if self.axes != "space":
                raise InputError(f"axes = {quote(self.axes)} has no meaning for nodes, which do not turn")
        elif self.node is not None:
            raise InputError(f"node = {quote(self.node)} and body = {quote(self.body)} exclude each other: give one")
        elif self.force is None and self.torque is None:
            raise InputError("force is missing: give force = ... [N] or torque = ... [N m]")

    def extend(self, net: Net) -> Net:
        """The net whose body turns, unless a force in space leaves that alone."""
        if self.body is None:
            return net
        body = net.body_of(self.body)
        if net.quasi_static:
            raise InputError(f"body = {quote(self.body)}: loads on bodies have no meaning in statics: load nodes")
        self._refuse(body)
        if self.torque is None and self.axes == "space":
            return net
        return net.with_turning(body)

    def _refuse(self, body: RigidBody) -> None:
        """Refuse a body on which the load has no meaning."""
        if body.fixed or body.moved:
            raise InputError(f"body = {quote(self.body)} is not free: what holds or moves it bears the load")
        if body.axle:
            raise InputError(f"body = {quote(self.body)} turns about an axle: give axle.torque of the body")
        if self.torque is not None and body.shape.planar:
            raise InputError(f"torque = {quote(self.torque)} has no meaning for a ring, which keeps its plane")

    def numbers(self, data: NDArray[np.float64]) -> NDArray[np.float64]:
        """Numbers of the term of loaded nodes with this force, from those with another one."""
        changed = data.copy()
        changed[:, : len(self.force)] = self.force
        return changed

    def on(self, net: Net) -> ForceTerm | list[ForceTerm]:
        """The term of the loaded nodes, whose energy is −(force)·(displacement), or those of a body.

        ``out`` is the power [W].
        """
        if self.body is None:
            loaded = net.web.find(self.node)
            return nodal_load(net, "load", loaded, np.broadcast_to(self.force, (len(loaded), 3)), self.factor)
        from .body_load import terms_of

        body = net.body_of(self.body)
        turned = self.axes == "body"
        if turned and body.turn is None:
            raise InputError(f'axes = "body": body {quote(self.body)} has no orientation that is followed')
        values = [
            None if value is None else np.array(value) @ (body.axes if turned else np.eye(3))
            for value in (self.force, self.torque)
        ]
        return terms_of(net, body, values[0], values[1], turned, self.factor)
