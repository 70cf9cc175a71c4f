"""One fixed sparsity pattern for the tangent of a net."""

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


class Pattern:
    """CSC pattern of the free components of all cells that couple them.

    It has every diagonal entry, and off the diagonal only what some family couples; slack or zero entries stay in it.

    Parameters
    ----------
    rows : int
        Number of rows; row r has the components 3r, 3r + 1, 3r + 2.
    free : ndarray of int
        Components that are not supported, in the order of the unknowns.
    cells : list of ndarray of int32, shape (cells, arity)
        One entry per family with stiffness.
    library : refweb.system.factorization.Library
        What factorizes symmetric matrices.

    Attributes
    ----------
    indptr, indices : ndarray of int32
        The pattern.
    slots : list of ndarray of int32, shape (cells, (3 arity)²)
        Place of each entry of a cell's block, row by row, in the values; −1 where a component is supported.
    upper : ndarray of int
        Places of the upper triangle, diagonal included.
    diagonal : ndarray of int
        Places of the diagonal.
    """

    def __init__(self, rows, free, cells, library):
        self.size = n = len(free)
        self.library = library
        library.choose(n)
        number = np.full(3 * rows, -1, dtype=np.int64)
        number[free] = np.arange(n)
        keys: list[np.ndarray] = [np.arange(n) * (n + 1)]
        for family in cells:
            unknowns = number[(3 * family[:, :, None] + np.arange(3)).reshape(len(family), -1)]
            i, j = unknowns[:, :, None], unknowns[:, None, :]
            keys.append(np.where((i >= 0) & (j >= 0), j * n + i, -1).reshape(len(family), -1))
        entries = np.unique(np.concatenate([k.ravel() for k in keys]))
        entries = entries[entries >= 0]
        row, col = entries % n if n else entries, entries // n if n else entries
        self.indices = row.astype(np.int32)
        self.indptr = np.searchsorted(col, np.arange(n + 1)).astype(np.int32)
        self.slots = [np.where(k >= 0, np.searchsorted(entries, k), -1).astype(np.int32) for k in keys[1:]]
        self.diagonal = np.searchsorted(entries, keys[0])
        self.upper = np.flatnonzero(row <= col)
        self._upper_indices = self.indices[self.upper]
        self._upper_indptr = np.searchsorted(col[self.upper], np.arange(n + 1)).astype(np.int32)

    @cached_property
    def lower(self):
        """Places of the lower triangle, diagonal included, shape (entries,)."""
        return np.flatnonzero(self.indices >= np.repeat(np.arange(self.size), np.diff(self.indptr)))

    def assemble(self, blocks):
        """Values of the pattern from one array of blocks (cells, 3 arity, 3 arity) per family."""
        values = np.zeros(len(self.indices))
        for block, slots in zip(blocks, self.slots, strict=True):
            _scatter(block, slots, values)
        return values

    def assemble_one(self, number, blocks):
        """Values of the pattern from the blocks of one family, by its number."""
        values = np.zeros(len(self.indices))
        _scatter(np.ascontiguousarray(blocks), self.slots[number], values)
        return values

    def matrix(self, values):
        """The `scipy.sparse.csc_array` of values."""
        return scipy.sparse.csc_array((values, self.indices, self.indptr), shape=(self.size, self.size))

    def upper_matrix(self, values):
        """The upper triangle of values as a `scipy.sparse.csc_matrix`, as an LDLᵀ factorization takes it."""
        part = (values[self.upper], self._upper_indices, self._upper_indptr)
        return scipy.sparse.csc_matrix(part, shape=(self.size, self.size))
