"""Fixed sparsity pattern of the tangent of a net, and the assembly of blocks of cells into its values.

May change: how `Pattern` finds its entries. Must stay: rows increase within a column, which `attached_nodes` and
factorizations count on; names of attributes, which `cvode`, `ida` and modes read; the order of sums in `_scatter`,
which decides the last bits of K; public names of `Pattern`, which other files use. Tests:
``tests/system/test_factorization.py``, ``test_system.py``.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse

from ..kernels import kernel


@kernel()
def _scatter(blocks, slots, values):
    size = blocks.shape[1]
    for c in range(blocks.shape[0]):
        k = 0
        for i in range(size):
            for j in range(size):
                slot = slots[c, k]
                if slot >= 0:
                    values[slot] += blocks[c, i, j]
                k += 1


def _different(keys):
    """Different values of keys, increasing; sorting takes a fifth of the time of `numpy.unique`, which hashes."""
    keys = np.sort(keys)
    return keys[np.append(True, keys[1:] != keys[:-1])] if len(keys) else keys


class Pattern:
    """CSC pattern of the free components of all cells that couple them.

    It has every diagonal entry and, off the diagonal, the entries that a term couples. Entries that are zero stay in
    it.

    Parameters
    ----------
    rows : int
        Number of rows; row r has the components 3r, 3r + 1, 3r + 2.
    free : ndarray of int
        Components that are not supported, in the order of the unknowns.
    cells : list of ndarray of int32, shape (cells, arity)
        One entry per term with stiffness.
    library : refweb.system.factorization.Library
        Library that factorizes symmetric matrices.
    also : list of ndarray of int32, shape (cells, arity)
        Further cells whose rows are coupled, but not by a term.

    Attributes
    ----------
    indptr, indices : ndarray of int32
        The pattern.
    slots : list of ndarray of int32, shape (cells, (3 arity)²)
        Position in the values of each entry of a cell's block, row by row; −1 if a component is supported.
    row : ndarray of int, shape (n,)
        Row of each unknown.
    diagonal : ndarray of int
        Positions of the diagonal in the values.
    """

    def __init__(self, rows, free, cells, library, also=()):
        self.size = n = len(free)
        self.row = np.asarray(free) // 3
        self.library = library
        library.choose(n)
        number = np.full((rows, 3), -1, dtype=np.int32)
        number.ravel()[free] = np.arange(n, dtype=np.int32)
        # By blocks of two rows, of which there are a ninth: column × rows + row, in the order of the columns.
        keys = [np.arange(rows) * (rows + 1)]
        keys += [(term[:, None, :].astype(np.int64) * rows + term[:, :, None]).reshape(-1) for term in (*cells, *also)]
        blocks = _different(np.concatenate(keys))
        of_cells = [np.searchsorted(blocks, key) for key in keys]
        coupled = np.zeros(len(blocks), dtype=bool)
        for block in of_cells[1:]:
            coupled[block] = True
        places = self._places(number, blocks // max(rows, 1), blocks % max(rows, 1), coupled)
        self.slots = []
        for term, block in zip(cells, of_cells[1 : 1 + len(cells)], strict=True):
            arity = term.shape[1]
            slots = places[block].reshape(len(term), arity, arity, 3, 3).transpose(0, 1, 4, 2, 3)
            self.slots.append(np.ascontiguousarray(slots).reshape(len(term), 9 * arity**2))
        self.diagonal = places[of_cells[0]][:, range(3), range(3)].ravel()[free]

    def _places(self, number, column, row, coupled):
        """Find the pattern, and the position of each entry of each block by its column and row; −1 for no entry."""
        inside = (number[column] >= 0)[:, :, None] & (number[row] >= 0)[:, None, :]
        inside &= coupled[:, None, None] | np.eye(3, dtype=bool)
        count = inside.sum(axis=2, dtype=np.int32)
        first = np.searchsorted(column, np.arange(len(number)))  # each has its diagonal block
        lengths = np.add.reduceat(count, first, dtype=np.int64)
        self.indptr = np.append(0, np.cumsum(lengths[number >= 0])).astype(np.int32)
        # Blocks of a column follow each other: what stands before one in it is what stands before it at all, less that
        # of the column's first.
        before = np.cumsum(count, axis=0, dtype=np.int64) - count
        before -= before[first][column]
        start = np.where(number >= 0, self.indptr[number], 0)[column] + before
        places = start[:, :, None] + np.cumsum(inside, axis=2) - 1
        places = np.where(inside, places, -1).astype(np.int32)
        self.indices = np.empty(self.indptr[-1], dtype=np.int32)
        self.indices[places[inside]] = np.broadcast_to(number[row][:, None, :], inside.shape)[inside]
        return places

    @cached_property
    def columns(self):
        """Column of each entry, shape (entries,)."""
        return np.repeat(np.arange(self.size, dtype=np.int32), np.diff(self.indptr))

    @cached_property
    def lower(self):
        """Positions of the lower triangle, diagonal included, shape (entries,)."""
        return np.flatnonzero(self.indices >= self.columns)

    @cached_property
    def upper(self):
        """Positions of the upper triangle, diagonal included, shape (entries,)."""
        return np.flatnonzero(self.indices <= self.columns)

    @cached_property
    def _upper_pattern(self):
        """Row of each entry of the upper triangle, and the starts of its columns."""
        starts = np.searchsorted(self.columns[self.upper], np.arange(self.size + 1))
        return self.indices[self.upper], starts.astype(np.int32)

    def assemble(self, blocks):
        """Values of the pattern from one array of blocks (cells, 3 arity, 3 arity) per term."""
        values = np.zeros(len(self.indices))
        for block, slots in zip(blocks, self.slots, strict=True):
            _scatter(block, slots, values)
        return values

    def assemble_one(self, number, blocks):
        """Values of the pattern from the blocks of one term, by its number."""
        values = np.zeros(len(self.indices))
        _scatter(np.ascontiguousarray(blocks), self.slots[number], values)
        return values

    def matrix(self, values):
        """The `scipy.sparse.csc_array` of values."""
        return scipy.sparse.csc_array((values, self.indices, self.indptr), shape=(self.size, self.size))

    @cached_property
    def _lower_pattern(self):
        """Pattern of the lower triangle with unknowns counted from the last one on, see `_upper_pattern`."""
        ends = np.searchsorted(self.columns[self.lower], np.arange(self.size + 1))
        starts = len(self.lower) - ends[::-1]
        return self.size - 1 - self.indices[self.lower][::-1], starts.astype(np.int32)

    def upper_matrix(self, values, turn=1):
        """The upper triangle of values as a `scipy.sparse.csc_matrix`, as an LDLᵀ factorization takes it.

        With a ``turn`` of −1 unknowns are counted from the last one on.
        """
        places, pattern = (self.upper, self._upper_pattern) if turn > 0 else (self.lower[::-1], self._lower_pattern)
        return scipy.sparse.csc_matrix((values[places], *pattern), shape=(self.size, self.size))
