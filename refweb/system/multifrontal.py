"""Multifrontal Cholesky factorization of positive definite tangents, ordered by nested dissection.

Each separator or part of `refweb.system.dissection` is a front: a dense matrix of its unknowns and of those after them
that the elimination couples (Duff and Reid, ACM Trans. Math. Softw. 9, 1983, doi:10.1145/356044.356047). LAPACK
eliminates the unknowns of a front at once; what is left is added to the front above. Hence most work is products of
dense matrices, of half as many operations as in LU. If the matrix is not positive definite, LAPACK shows a pivot that
is not positive, and another library has to factorize.

May change: `PART` and the layout of fronts: they change times, and results by rounding. Must stay: ``factorize``,
``solve``, ``solve_all``, ``times``, ``negative_pivots`` and ``solutions`` of `Multifrontal`, which `factorization`
calls; a RuntimeError of a matrix that is not positive definite, for then no sign of a pivot is known. Tests:
``tests/system/test_multifrontal.py``, ``test_factorization.py``.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse

from ..kernels import kernel
from .dissection import dissected

PART = 24
"""Largest number of rows of a part that is not parted. A factorization of a web of 118 803 unknowns takes the same time
with 16 to 32; larger parts fill the factor with zeros, and smaller parts make more fronts."""
FULLEST = 12.0
"""Largest number of entries of the factor over n log2 n, n the number of unknowns. Webs of 40 000 cells have 5.5
(hexagons) to 8.1 (triangles); a random triangulation has 32 and a lattice that fills space 48, which SuperLU factorizes
with less fill-in or less memory."""


class Front(NamedTuple):
    """A front.

    ``first`` and ``end`` bound its unknowns in the order of elimination, ``size`` counts them and the unknowns that
    they are coupled with. Entries of the matrix from ``begin`` to ``until`` in that order have the positions
    ``entries`` in it. ``below`` has the number of each front below, and where the unknowns that this one couples stand
    here.
    """

    first: int
    end: int
    size: int
    begin: int
    until: int
    entries: np.ndarray
    below: list


@kernel()
def _add_below(front, size, places, update):
    """Add the lower triangle of an update to a front; both matrices stand column by column in vectors."""
    count = len(places)
    for j in range(count):
        column = size * places[j]
        for i in range(j, count):
            front[column + places[i]] += update[count * j + i]


@kernel()
def _substitute(fronts, coupled, panels, x, sums):
    """Solve L Lᵀ y = x in place, unknowns in the order of elimination."""
    for f in range(len(fronts)):
        first, count, size, where, begin = fronts[f]
        rest = size - count
        sums[:rest] = 0.0
        for j in range(count):
            column = begin + size * j
            x[first + j] /= panels[column + j]
            value = x[first + j]
            for i in range(j + 1, count):
                x[first + i] -= panels[column + i] * value
            for i in range(rest):
                sums[i] += panels[column + count + i] * value
        for i in range(rest):
            x[coupled[where + i]] -= sums[i]
    for f in range(len(fronts) - 1, -1, -1):
        first, count, size, where, begin = fronts[f]
        rest = size - count
        for i in range(rest):
            sums[i] = x[coupled[where + i]]
        for j in range(count - 1, -1, -1):
            column = begin + size * j
            s0 = s1 = s2 = s3 = 0.0  # sums that do not wait for each other
            even = rest - rest % 4
            for i in range(0, even, 4):
                s0 += panels[column + count + i] * sums[i]
                s1 += panels[column + count + i + 1] * sums[i + 1]
                s2 += panels[column + count + i + 2] * sums[i + 2]
                s3 += panels[column + count + i + 3] * sums[i + 3]
            for i in range(even, rest):
                s0 += panels[column + count + i] * sums[i]
            for i in range(j + 1, count):
                s1 += panels[column + i] * x[first + i]
            x[first + j] = (x[first + j] - (s0 + s1 + s2 + s3)) / panels[column + j]


class _Plan:
    """Order of elimination and fronts of a `refweb.system.sparsity.Pattern`.

    Attributes
    ----------
    order : ndarray of int, shape (n,)
        Unknowns in the order of elimination.
    source : ndarray of int
        Positions in the values of the pattern of the lower triangle in that order.
    fronts : list of Front
        Each before the front above it.
    table, coupled : ndarray of int
        Arguments of `_substitute`: first unknown, number of unknowns, size, and begin in ``coupled`` and in the panels,
        shape (fronts, 5); unknowns of each front that follow later.
    fill : int
        Number of entries of the panels.
    """

    def __init__(self, pattern):
        n = pattern.size
        heads = np.flatnonzero(np.diff(pattern.row, prepend=-1))  # first unknown of each row that has any
        sizes = np.diff(heads, append=n)
        graph = pattern.matrix(np.ones(len(pattern.indices), dtype=np.int8))[heads][:, heads].tocsr()
        rows, starts = _eliminated(dissected(graph, PART))
        position = np.argsort(rows)
        begin = np.append(0, np.cumsum(sizes[rows]))  # first unknown of each row, in the order of elimination
        places = np.repeat(begin[position] - heads, sizes) + np.arange(n)
        self.order = np.argsort(places)
        low = np.flatnonzero(places[pattern.indices] >= places[pattern.columns])
        at = places[pattern.indices[low]], places[pattern.columns[low]]
        lower = scipy.sparse.coo_array((low, at), shape=(n, n)).tocsc()
        self.source = lower.data
        after = scipy.sparse.tril(graph[rows][:, rows], format="csc")
        self._arrange(lower, after, starts, begin)

    def _arrange(self, lower, after, starts, begin):
        """Find the fronts from the pattern of the lower triangle, that of its rows and the first row of each front."""
        ends, count = np.append(starts[1:], after.shape[0]), len(starts)
        below: list = [[] for _ in starts]
        coupled: list = []  # rows, and unknowns
        unknowns: list = []
        self.fronts, self.fill = [], 0
        for f, (start, end) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
            near = [after.indices[after.indptr[start] : after.indptr[end]], *(coupled[k] for k in below[f])]
            later = np.unique(np.concatenate(near))
            later = later[later >= end]
            if len(later):
                below[np.searchsorted(starts, later[0], side="right") - 1].append(f)
            coupled.append(later)
            unknowns.append(_ranges(begin[later], begin[later + 1]))
            first, last = int(begin[start]), int(begin[end])
            front = np.append(np.arange(first, last), unknowns[f])
            part = slice(int(lower.indptr[first]), int(lower.indptr[last]))
            columns = np.repeat(np.arange(last - first), np.diff(lower.indptr[first : last + 1]))
            entries = np.searchsorted(front, lower.indices[part]) + len(front) * columns
            places = [(k, np.searchsorted(front, unknowns[k])) for k in below[f]]
            self.fronts.append(Front(first, last, len(front), part.start, part.stop, entries, places))
        self.coupled = np.concatenate([np.zeros(0, dtype=np.int64), *unknowns])
        self.table = np.zeros((count, 5), dtype=np.int64)
        self.table[:, 0], self.table[:, 1] = begin[starts], begin[ends] - begin[starts]
        self.table[:, 2] = [front.size for front in self.fronts]
        rest, entries = self.table[:, 2] - self.table[:, 1], self.table[:, 1] * self.table[:, 2]
        self.table[:, 3], self.table[:, 4] = np.cumsum(rest) - rest, np.cumsum(entries) - entries
        self.fill = int(entries.sum())


def _eliminated(numbers):
    """Nodes of a tree in the order of elimination, each below before what is above; first positions of its fronts."""
    depth = np.frexp(numbers.astype(float))[1]
    last = (numbers + 1) << (depth.max(initial=1) - depth)  # of the numbers below, at the greatest depth
    order = np.lexsort((-depth, last))
    return order, np.flatnonzero(np.diff(numbers[order], prepend=0))


def _ranges(begin, end):
    """All integers from each begin to each end."""
    counts = end - begin
    return np.repeat(begin - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())


class Multifrontal:
    """Cholesky factorization by fronts; the order of elimination is found once."""

    solutions = 5

    def __init__(self, pattern):
        self.pattern = pattern
        self._panels: Any = None

    @cached_property
    def _plan(self):
        return _Plan(self.pattern)

    def factorize(self, values):
        """Factorize; raise a RuntimeError if the matrix is not positive definite, or the factor would be too full."""
        from scipy.linalg.blas import dsyrk, dtrsm
        from scipy.linalg.lapack import dpotrf

        plan = self._plan
        if plan.fill > FULLEST * self.pattern.size * np.log2(self.pattern.size + 1):
            raise RuntimeError("the factor would be too full")
        self._matrix = self.pattern.matrix(values)
        if self._panels is None:
            self._panels = np.empty(plan.fill)
        values, updates = values[plan.source], {}
        for f, front in enumerate(plan.fronts):
            size, count = front.size, front.end - front.first
            matrix = np.zeros(size * size)
            matrix[front.entries] = values[front.begin : front.until]
            for below, places in front.below:
                _add_below(matrix, size, places, updates.pop(below))
            matrix = matrix.reshape(size, size).T
            root, failed = dpotrf(matrix[:count, :count], lower=1, clean=0)
            if failed:
                raise RuntimeError("a pivot is not positive")
            panel = self._panels[plan.table[f, 4] :][: size * count].reshape(count, size).T
            panel[:count] = root
            if size > count:
                panel[count:] = rest = dtrsm(1.0, root, matrix[count:, :count], side=1, lower=1, trans_a=1)
                updates[f] = dsyrk(-1.0, rest, beta=1.0, c=matrix[count:, count:], lower=1).ravel(order="F")

    def solve(self, b):
        """Solution of A y = b."""
        plan = self._plan
        x, y = b[plan.order], np.empty(len(b))
        _substitute(plan.table, plan.coupled, self._panels, x, np.empty(plan.table[:, 2].max()))
        y[plan.order] = x
        return y

    def solve_all(self, b):
        """Solutions of A y = b, shape (n, k)."""
        return np.column_stack([self.solve(column) for column in b.T])

    def times(self, y):
        """A y."""
        return self._matrix @ y

    def negative_pivots(self):
        """Number of pivots that are not positive: none."""
        return 0
