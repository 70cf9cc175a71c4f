"""Initial velocities of nodes."""

from __future__ import annotations

from ..errors import InputError
from ..tables import Several, Table, nodes, table, vector


@table
class Velocity(Table):
    """Initial velocity of each of some nodes; "all" are all nodes that are free.

    Parameters
    ----------
    node : int, str or list
        Nodes, by number or name. Of several velocities of one node the last counts: first those of "all".
    value : sequence of 3 float
        Velocity [m/s].

    Raises
    ------
    InputError
        For a velocity that is not three finite numbers; from ``start``, in statics, for a node that the web does not
        have, and for one that is named and supported along a component that is not 0.

    Examples
    --------
        [[velocity]]
        node = "all"
        value = [0.0, 0.0, 4.0]
    """

    several = True

    node: Several = nodes()
    value: Several = vector(unit="m/s")

    def start(self, net, supported, v):
        """Write the initial velocities into v, shape (rows, 3); refuse those that a support does not allow."""
        if net.quasi_static:
            raise InputError("a velocity cannot be used in statics: leave it out")
        for node in net.find(self.node):
            allowed = [axis for axis in range(3) if not supported[node, axis]]
            stopped = [axis for axis in range(3) if supported[node, axis] and self.value[axis] != 0.0]
            if stopped and self.node != "all":
                axis = "xyz"[stopped[0]]
                raise InputError(f"node = {node} is supported along {axis}: it cannot have a velocity there")
            v[node, allowed] = [self.value[axis] for axis in allowed]
