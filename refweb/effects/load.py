"""Dead loads: forces of fixed direction on nodes, with an optional factor over time."""

from __future__ import annotations

import numpy as np

from ..kernels import ENERGY, FORCE, IMPULSE, kernel
from ..tables import Several, Table, nodes, rows, table, vector
from .base import column
from .outer_load import factor_at, factor_until, outer_load


@kernel(FORCE)
def force(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        row, times = cells[c, 0], factor_at(t, data[c], 3)
        out[c, 0] = times * (data[c, 0] * v[row, 0] + data[c, 1] * v[row, 1] + data[c, 2] * v[row, 2])
        for i in range(3):
            f[row, i] += times * data[c, i]


@kernel(ENERGY)
def energy(t, x, cells, data, out):
    for c in range(cells.shape[0]):
        row = cells[c, 0]
        work = data[c, 0] * x[row, 0] + data[c, 1] * x[row, 1] + data[c, 2] * x[row, 2]
        out[c] = -factor_at(t, data[c], 3) * work


@kernel(IMPULSE)
def impulse(t, x, cells, data, total):
    times = factor_until(t, data[0], 3) if cells.shape[0] else 0.0
    for c in range(cells.shape[0]):
        for i in range(3):
            total[i] += times * data[c, i]


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

    def on(self, net):
        """The term of the loaded nodes; its energy is −(force)·(displacement), ``out`` its power [W]."""
        loaded = net.web.find(self.node)
        data = np.tile(self.force, (len(loaded), 1))
        kernels = dict(impulse=impulse, force=force, energy=energy)
        return outer_load(net, "load", column(loaded), data, self.factor, **kernels)
