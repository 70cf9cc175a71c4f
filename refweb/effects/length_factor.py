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


def noted(net, lines, table):
    """The net with a factor as in `scaled` among its ``factors``."""
    return replace(net, factors=(*net.factors, (np.flatnonzero(np.isin(net.line, lines)), table)))


def shortest_of(net):
    """Natural length of each element at its shortest in a run [m], shape (cells,).

    Between corners a length is a product of positive linear functions of time, which is least at an end.
    """
    corners = [t for _, table in net.factors for t, _ in table if 0.0 < t < net.end]
    shortest = np.full(len(net.cells), np.inf)
    for t in {0.0, net.end, *corners}:
        length = net.natural_length.copy()
        for elements, table in net.factors:
            length[elements] *= np.interp(t, *np.transpose(table))
        np.minimum(shortest, length, out=shortest)
    return shortest


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
