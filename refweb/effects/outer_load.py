"""External loads: forces with a factor over time, whose power is work.

Each cell of such a load has first its numbers, and then those of the factor: its largest size; constant and slope
without a table, which are 1 and 0, in statics 0 and 1; its table. Without a table the factor is 1, in statics the load
step.

May change: how kernels are written. Must stay: the order of the numbers of a factor (largest size, constant, slope,
table), which `factor_at` and `factor_until` read by position, and the first of which bounds of `pressure`, `thrust` and
`body_load` read; the numbers of a load ahead of them, over which `dynamics.commands` writes; the balance "work", a key
of `System.working`; `outer_load`, which `pressure`, `thrust` and `body_load` call, and `nodal_load`, which `load`,
`body_load` and `mass_flow` call. Tests: ``tests/test_contract.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..kernels import ENERGY, FORCE, IMPULSE, kernel
from .base import Balance, ForceTerm, Timing, column
from .time_tables import flattened, integrate, interpolate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.net import Net


@kernel()
def factor_at(t, data, start):
    """The factor at time t, whose numbers begin at ``start``; ``data[start]`` is its largest size."""
    if data[start + 3] > 0.0:
        return interpolate(t, data, start + 3, 2, 1)[0]
    return data[start + 1] + data[start + 2] * t


@kernel()
def factor_until(t, data, start):
    """∫ of the factor until time t [s], up to a constant; all cells of a load have the same factor."""
    if data[start + 3] > 0.0:
        return integrate(t, data, start + 3, 2, 1)
    return (data[start + 1] + 0.5 * data[start + 2] * t) * t


def outer_load(
    net: Net,
    name: str,
    cells: NDArray[np.int32],
    data: NDArray[np.float64],
    factor: Any,
    impulse: Any = None,
    **parts: Any,
) -> ForceTerm:
    """The `ForceTerm` of a load.

    Kernels get the numbers of a cell, ``data (cells, columns)``, and those of the factor from ``columns`` on. The
    factor is a table of (t, factor), linear between its times and constant before and after them, or None. ``impulse``
    is that of the `Balance`; ``parts`` are ``force``, which writes its power [W] to ``out[c, 0]``, and other parts of a
    `ForceTerm`.
    """
    table = factor or ()
    largest = max((abs(value) for _, value in table), default=1.0)
    numbers = [largest, *((0.0, 1.0) if net.quasi_static else (1.0, 0.0)), *flattened(table)]
    columns = data.shape[1]
    with_factor = np.empty((len(cells), columns + len(numbers)))
    with_factor[:, :columns], with_factor[:, columns:] = data, numbers
    return ForceTerm(
        name=name,
        cells=cells,
        data=with_factor,
        balance=Balance("work", power=0, impulse=impulse),
        timing=Timing(tuple(t for t, _ in table)),
        **parts,
    )


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


def nodal_load(net: Net, name: str, rows: NDArray[np.int64], forces: NDArray[np.float64], factor: Any) -> ForceTerm:
    """The `ForceTerm` of dead loads ``forces (rows, 3)`` [N] on rows, times a factor as that of `outer_load`."""
    return outer_load(net, name, column(rows), forces, factor, impulse=impulse, force=force, energy=energy)
