"""Natural lengths that follow a table over time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..kernels import LINES, kernel
from ..net.net import LENGTH
from .base import LineDrive, column
from .time_tables import flattened, interpolate


@kernel(LINES)
def scale(t, lines, cells, data):
    factor = interpolate(t, data[0], 0, 2, 1)[0]
    for c in range(cells.shape[0]):
        lines[cells[c, 0], LENGTH] *= factor


def shortened(net, lines, table):
    """The net whose ``shortest`` has heard of a factor as in `scaled`."""
    own = np.where(np.isin(net.line, lines), min(factor for _, factor in table), 1.0)
    return replace(net, shortest=net.shortest * own)


def scaled(net, lines, table):
    """The `LineDrive` that multiplies the natural lengths of lines by a factor.

    Parameters
    ----------
    net : refweb.net.net.Net
        What it acts on.
    lines : ndarray of int, shape (k,)
        Lines of the web; all elements of a line share the factor.
    table : sequence of (t, factor)
        Linear in between, end values held.
    """
    elements = np.flatnonzero(np.isin(net.line, lines))
    times = tuple(t for t, _ in table)
    return LineDrive(cells=column(elements), data=np.array([flattened(table)]), kernel=scale, times=times)
