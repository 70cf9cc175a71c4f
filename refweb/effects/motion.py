"""Prescribed motion: nodes whose displacement is a function of time."""

from __future__ import annotations

import numpy as np

from ..kernels import FORCE, kernel
from ..tables import Several, Table, nodes, rows, table
from .base import PrescribedMotion, column
from .time_tables import flattened, interpolate


@kernel(FORCE)
def drive(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        for i in range(3):
            x[cells[c, 0], i], v[cells[c, 0], i] = interpolate(t, data[c], 0, 4, 1 + i)


@table
class Motion(Table):
    """Prescribed displacement of nodes, which become supports.

    Parameters
    ----------
    node : int, str or list
        Nodes, by number or name.
    displacement : sequence of (t, x, y, z)
        Displacement from the position in the web [m]: linear between the times, constant before and after them. In
        statics t is the load step.

    Raises
    ------
    InputError
        For a table without rows, rows that are not four finite numbers, and times that do not increase; from ``on``,
        for a node that the web does not have.

    Examples
    --------
        [[motion]]
        node = [0, 1]
        displacement = [[0.0, 0.0, 0.0, 0.0], [1.0, -0.2, 0.0, 0.0]]
    """

    several = True

    node: Several = nodes()
    displacement: Several = rows(4, unit="m", increasing=True)

    def on(self, net):
        """The driven rows."""
        driven = net.find(self.node)
        data = np.tile(flattened(self.displacement), (len(driven), 1))
        return PrescribedMotion(
            cells=column(driven), data=data, kernel=drive, times=tuple(row[0] for row in self.displacement)
        )
