"""Blocks of straight elements, and the runs of elements in them, for kernels that take elements together.

Webs repeat: lines from node n to n + 1 follow each other, and lines from n to n + 40 as well. A run is a number of
lines whose first nodes follow each other and whose second nodes do, too. Their displacements and forces lie one after
another in memory, so that differences and sums over a run take all lanes of the processor.

May change: the order of elements in a block, and with it the last digits of all results. Must stay: `BLOCK`, which a
kernel has space for, and `runs_of` and `blocks_of`, which `dynamics.integrators.records` calls. Tests:
``tests/net/test_elements.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compiled.rows import width_of
from ..net.laws.law import LINE

if TYPE_CHECKING:
    from numpy.typing import NDArray

BLOCK = 256
"""Number of elements whose forces are found together: their numbers stay in the nearest cache."""
SPACE, OUTPUTS = 3 * BLOCK, 2 * BLOCK
"""Number of components of their differences, and of their tensions and strains."""
LONG = 8
"""Mean number of elements of the runs of a net from which they are worth it: a run costs as much as two elements."""
RUN = np.dtype([(name, np.int32) for name in ("begin", "count", "first", "second", "element", "stride")])
"""Where a run begins in the order of its block, 0 for the first of a block, its number of elements, the rows of the
nodes of its first element, the number of that, and from each element to the next."""


def runs_of(cells: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int64]] | None:
    """Runs of each block, shorter offsets of nodes first, and elements in their order; None where they are short.

    Parameters
    ----------
    cells : ndarray of int, shape (elements, 2)
        Rows of the nodes.

    Returns
    -------
    tuple of ndarray, or None
        `RUN` of each, shape (runs, 6), and the number of each element, shape (elements,).
    """
    number, rows = np.arange(len(cells)), int(cells.max(initial=0)) + 1
    first, second = cells[:, 0].astype(np.int64), cells[:, 1].astype(np.int64)
    key = np.full(-(-len(cells) // BLOCK) * BLOCK, np.iinfo(np.int64).max)
    key[: len(cells)] = (second - first + rows) * rows + first
    order = np.argsort(key.reshape(-1, BLOCK), axis=1, kind="stable")
    order = (order + np.arange(0, len(key), BLOCK)[:, None]).reshape(-1)[: len(cells)]
    first, second, strides = first[order], second[order], np.diff(order)
    follows = (np.diff(first) == 1) & (np.diff(second) == 1) & (number[1:] % BLOCK > 0)
    follows[1:] &= ~follows[:-1] | (strides[1:] == strides[:-1])
    begins = np.flatnonzero(np.append(True, ~follows))
    if len(begins) * LONG > len(cells):
        return None
    counts, strides = np.diff(np.append(begins, len(cells))), np.append(strides, 1)[begins]
    runs = np.column_stack([begins % BLOCK, counts, first[begins], second[begins], order[begins], strides])
    return runs.astype(np.int32), order


def blocks_of(lines: NDArray[np.float64], order: NDArray[np.int64] | None = None) -> NDArray[np.float64]:
    """Line data by blocks of `BLOCK` elements, column after column, shape (blocks, columns · `BLOCK`).

    Parameters
    ----------
    lines : ndarray, shape (elements, columns)
        Numbers of straight elements, of which the first columns, those of `LINE`, are taken.
    order : ndarray of int, shape (elements,), optional
        Elements in the order of `runs_of`.
    """
    count, columns = -(-len(lines) // BLOCK), width_of(LINE)
    blocks = np.zeros((columns, count * BLOCK))
    blocks[:, : len(lines)] = (lines if order is None else lines[order])[:, :columns].T
    return np.ascontiguousarray(blocks.reshape(columns, count, BLOCK).swapaxes(0, 1)).reshape(count, -1)
