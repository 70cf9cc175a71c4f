"""Gravity: a uniform acceleration on every mass.

May change: only `force`, `energy` and `impulse` together. Must stay: the name "gravity", which
`statics.gradients.KNOWN` and `statics.adjoint.MASSES` have; the key and docstring of `Gravity` (scene format and help;
after a change write ``validation/REFERENCE.md`` anew); the acceleration times mass as the numbers of a cell; the energy
as 0 in the web's position, from which ``history.csv`` counts. Tests: ``tests/test_contract.py``,
``tests/dynamics/test_momentum_balance.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernels import ENERGY, FORCE, IMPULSE, kernel
from ..tables import Several, Table, table, vector
from .base import Balance, ForceTerm, column

if TYPE_CHECKING:
    from ..net.net import Net


@kernel(FORCE)
def force(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        for i in range(3):
            f[cells[c, 0], i] += data[c, i]


@kernel(ENERGY)
def energy(t, x, cells, data, out):
    for c in range(cells.shape[0]):
        row = cells[c, 0]
        out[c] = -(data[c, 0] * x[row, 0] + data[c, 1] * x[row, 1] + data[c, 2] * x[row, 2])


@kernel(IMPULSE)
def impulse(t, x, cells, data, total):
    for c in range(cells.shape[0]):
        for i in range(3):
            total[i] += t * data[c, i]


@table
class Gravity(Table):
    """Weight m g of every row that has mass.

    Parameters
    ----------
    acceleration : sequence of 3 float
        g [m/s²].

    Raises
    ------
    InputError
        For an acceleration that is not three finite numbers.

    Examples
    --------
        [gravity]
        acceleration = [0.0, 0.0, -9.81]
    """

    acceleration: Several = vector(unit="m/s²")

    def on(self, net: Net) -> ForceTerm | list[ForceTerm]:
        """Terms of all rows with mass, and of what reels and winches add; the energy is zero in the web's position."""
        heavy = net.heavy
        steady = ForceTerm(
            name="gravity",
            cells=column(heavy),
            data=net.mass[heavy, None] * np.array(self.acceleration),
            force=force,
            energy=energy,
            balance=Balance("potential_energy", impulse=impulse, moment_free=True),
        )
        return [steady, *(flow.weight(net, self.acceleration) for flow in net.flows)] if net.flows else steady
