"""Loads from outside: forces that a factor over time multiplies, and whose power is work.

Behind its own numbers each cell of such a load has those of the factor: its largest size; the constant and the slope
that it has without a table, 1 and 0, in statics 0 and 1; its table. Without one a load acts in full, or, in statics,
times the load step.
"""

from __future__ import annotations

import numpy as np

from ..kernels import kernel
from .base import Balance, ForceTerm, Timing
from .time_tables import flattened, integrate, interpolate


@kernel()
def factor_at(t, data, start):
    """The factor at time t of a cell, whose numbers begin at ``start``; ``data[start]`` is the largest size of it."""
    if data[start + 3] > 0.0:
        return interpolate(t, data, start + 3, 2, 1)[0]
    return data[start + 1] + data[start + 2] * t


@kernel()
def factor_until(t, data, start):
    """∫ of the factor until time t [s], but for a constant; all cells of a load have one factor."""
    if data[start + 3] > 0.0:
        return integrate(t, data, start + 3, 2, 1)
    return (data[start + 1] + 0.5 * data[start + 2] * t) * t


def outer_load(net, name, cells, data, factor, impulse=None, **parts):
    """The `ForceTerm` of a load.

    Parameters
    ----------
    net : refweb.net.net.Net
        What it acts on.
    name : str
        Name of the effect.
    cells : ndarray of int32, shape (cells, arity)
        Rows that each cell couples.
    data : ndarray, shape (cells, columns)
        Numbers of each cell; in what kernels see those of the factor follow, from ``columns`` on.
    factor : sequence of (t, factor) or None
        Linear in between, end values held.
    impulse : kernel, optional
        That of a `Balance`.
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
