"""Initial velocities of nodes.

May change: messages. Must stay: keys and docstring of `Velocity` (scene format and help; after a change write
``validation/REFERENCE.md`` anew); `start`, which `system.start` calls in the order of the tables, so that later tables
write over earlier ones. Tests: ``tests/effects/test_velocity.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..tables import Several, Table, nodes, table, vector

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.net import Net


@table
class Velocity(Table):
    """Initial velocity of some nodes, uniform or by a spin about a point; "all" are all free nodes.

    Parameters
    ----------
    node : int, str or list
        Nodes, by number or name. If a node has several velocities the last table counts; tables with "all" come first.
    value : sequence of 3 float, optional
        Velocity [m/s].
    spin : sequence of 3 float, optional
        Angular velocity ω [rad/s] about a point, as for a rigid body: ω × (x − about) is added to ``value``.
    about : sequence of 3 float
        Point of the spin [m].

    Raises
    ------
    InputError
        For vectors that are not three finite numbers, and if neither ``value`` nor ``spin`` is given. From ``start``:
        in statics, for a node that the web does not have, and for a named node that is attached to a body, or supported
        along a component that is not 0.

    Examples
    --------
        [[velocity]]
        node = "all"
        value = [0.0, 0.0, 4.0]
        spin = [0.0, 0.0, 2.0]
    """

    several = True

    node: Several = nodes()
    value: Several = vector(default=None, unit="m/s")
    spin: Several = vector(default=None, unit="rad/s")
    about: Several = vector(default=(0.0, 0.0, 0.0), unit="m")

    def check(self) -> None:
        """Refuse a table without ``value`` and ``spin``."""
        if self.value is None and self.spin is None:
            raise InputError("value is missing: a velocity needs value = [...] [m/s], spin = [...] [rad/s], or both")
        if self.spin is None and any(self.about):
            raise InputError(f"about = {list(self.about)} has no meaning without spin = [...] [rad/s]")

    def start(self, net: Net, supported: NDArray[np.bool_], v: NDArray[np.float64]) -> None:
        """Write the initial velocities into v, shape (rows, 3); refuse those that a support does not allow."""
        if net.quasi_static:
            raise InputError("a velocity cannot be used in statics: leave it out")
        nodes_found = net.find(self.node)
        velocities = np.tile(np.array(self.value or (0.0, 0.0, 0.0)), (len(nodes_found), 1))
        if self.spin is not None:
            velocities += np.cross(self.spin, net.points[nodes_found] - self.about)
        for node, velocity in zip(nodes_found, velocities, strict=True):
            allowed = [axis for axis in range(3) if not supported[node, axis]]
            stopped = [axis for axis in range(3) if supported[node, axis] and velocity[axis] != 0.0]
            for body in net.bodies if self.node != "all" else ():
                if node in body.carried:
                    raise InputError(
                        f'node = {node} is on body "{body.name}" by [[attach]] and has the velocity of that'
                    )
            if stopped and self.node != "all":
                axis = "xyz"[stopped[0]]
                raise InputError(f"node = {node} is supported along {axis}: it cannot have a velocity there")
            v[node, allowed] = velocity[allowed]
