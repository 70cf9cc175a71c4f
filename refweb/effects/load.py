"""Dead loads: forces of fixed direction on nodes, with an optional factor over time.

`outer_load` has the kernels; `statics.simulation` finds dead loads by the name "load".
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..tables import Several, Table, nodes, rows, table, vector
from .outer_load import nodal_load

if TYPE_CHECKING:
    from ..net.net import Net
    from .base import ForceTerm


@table
class Load(Table):
    """A dead load on each of some nodes.

    Parameters
    ----------
    node : int, str or list
        Nodes, by number or name.
    force : sequence of 3 float
        Force on each node [N].
    factor : sequence of (t, factor), optional
        Factor on the force over time: linear between the times, constant before and after them. Without it the factor
        is 1, in statics the load step.

    Raises
    ------
    InputError
        For a force that is not three finite numbers, and a factor without rows or with times that do not increase. From
        ``on``, for a node that the web does not have.

    Examples
    --------
        [[load]]
        node = "centre"
        force = [0.0, 0.0, 1.0]
        factor = [[0.0, 0.0], [0.1, 1.0]]
    """

    several = True

    node: Several = nodes()
    force: Several = vector(unit="N")
    factor: Several = rows(2, default=None, increasing=True)

    def on(self, net: Net) -> ForceTerm:
        """The term of the loaded nodes; its energy is −(force)·(displacement), ``out`` its power [W]."""
        loaded = net.web.find(self.node)
        return nodal_load(net, "load", loaded, np.broadcast_to(self.force, (len(loaded), 3)), self.factor)
