"""External loads: forces with a factor over time, whose power is work.

Each cell of such a load has first its numbers, and then those of the factor: its largest size; constant and slope
without a table, which are 1 and 0, in statics 0 and 1; its table. Without a table the factor is 1, in statics the load
step.
"""

from __future__ import annotations

import numpy as np

from ..kernels import kernel
from .base import Balance, ForceTerm, Timing
from .time_tables import flattened, integrate, interpolate


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


def outer_load(net, name, cells, data, factor, impulse=None, **parts):
    """The `ForceTerm` of a load.

    Parameters
    ----------
    net : refweb.net.net.Net
        The net.
    name : str
        Name of the effect.
    cells : ndarray of int32, shape (cells, arity)
        Rows that each cell couples.
    data : ndarray, shape (cells, columns)
        Numbers of each cell; kernels get those of the factor as well, from ``columns`` on.
    factor : sequence of (t, factor) or None
        Table that is linear between its times, and constant before and after them.
    impulse : kernel, optional
        Impulse of the `Balance`.
    **parts
        ``force``, which writes its power [W] to ``out[c, 0]``, and other parts of a `ForceTerm`.
    """
    table = factor or ()
    largest = max((abs(value) for _, value in table), default=1.0)
    numbers = [largest, *((0.0, 1.0) if net.quasi_static else (1.0, 0.0)), *flattened(table)]
    return ForceTerm(
        name=name,
        cells=cells,
        data=np.hstack([data, np.tile(numbers, (len(cells), 1))]),
        balance=Balance("work", power=0, impulse=impulse),
        timing=Timing(tuple(t for t, _ in table)),
        **parts,
    )
