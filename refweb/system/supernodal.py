"""LDLᵀ of symmetric tangents by supernodes, without exchanges of pivots.

The unknowns of a row, up to three, are a node. The order of elimination is the minimum degree of the nodes, by which
subtrees follow each other. Nodes whose columns of L have nearly the same rows are a supernode, whose columns are stored
as one dense matrix; D is separate. A supernode is eliminated at once, and what that subtracts from the matrix of its
other rows, its update, is added to the supernode above (Duff and Reid, ACM Trans. Math. Softw. 9, 1983,
doi:10.1145/356044.356047; Liu, SIAM Rev. 34, 1992, doi:10.1137/1034004). Hence most work is products of dense matrices
of three columns, which the compiler makes vector instructions of. Order, supernodes and all places are found once.

On a CPU with AVX-512 a factorization of a square web takes 1.1 ms at 4563 unknowns, 19 ms at 29 403 and 210 ms at
118 803, and a solution 0.12, 3 and 20 ms. qdldl takes 4.5 ms and 0.24 ms at 4563 unknowns, and five times as long for
either at 29 403; SuperLU takes five times as long for factorizations. From 120 000 unknowns on, fronts ordered by
nested dissection take as long, see `refweb.system.multifrontal`. 900 supernodes share 1521 nodes in the first of these
webs. With the order of nested dissection there are two thirds more products in it.

Indices are unsigned: numba looks whether others count from the end, and loops with that look have no vector
instructions. For the same reason three columns of L D stand in a buffer at fixed distances: the compiler has to prove
that nothing written there is read as well.

May change: `MOST`, `SPARSE` and `TILE`, which change times, and results by rounding; the insides of `_Plan`. Must stay:
``factorize``, ``solve``, ``solve_all``, ``times``, ``negative_pivots`` and ``solutions`` of `Supernodal`, which
`factorization` calls; a RuntimeError for a pivot that is 0, behind which no sign of a pivot is known. Tests:
``tests/system/test_supernodal.py``, ``test_factorization.py``.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse

from ..kernels import kernel

MOST = 12
"""Largest number of nodes of a supernode. With 8 to 16 a factorization takes the same time, with 4 a tenth longer."""
SPARSE = 0.2
"""Largest share of zeros in a supernode that two are joined to. From 0.1 to 0.3 times are the same."""
u = np.uint64
ONE, TWO, THREE, FOUR, LANES = u(1), u(2), u(3), u(4), u(8)
TILE, TWO_TILES = u(264), u(2 * 264)
"""Rows that are eliminated at once, and distance of columns in the buffer of L D: a multiple of `LANES`, but not of a
large power of 2, by which columns would share places in the cache."""


@kernel(leaf=True)
def _subtract(c, to, apart, w, at, factor, of, stride, count):
    """Subtract from three columns of c the products of three columns of w and three rows of L in ``factor``."""
    second, third = of + stride, of + stride + stride
    a0, b0, d0 = factor[of], factor[of + ONE], factor[of + TWO]
    a1, b1, d1 = factor[second], factor[second + ONE], factor[second + TWO]
    a2, b2, d2 = factor[third], factor[third + ONE], factor[third + TWO]
    for i in range(count):
        k, n = at + i, to + i
        w0, w1, w2 = w[k], w[k + TILE], w[k + TWO_TILES]
        c[n] -= w0 * a0 + w1 * a1 + w2 * a2
        c[n + apart] -= w0 * b0 + w1 * b1 + w2 * b2
        c[n + apart + apart] -= w0 * d0 + w1 * d1 + w2 * d2


@kernel(leaf=True)
def _eliminate(factor, begin, stride, size, t, count, pivots, first, w):
    """Find rows t to t + count of the columns of a supernode, and write those of L D to w; False for a pivot of 0.

    The first rows have the diagonal. Of the triangle above it nothing is read.
    """
    for g in range(u(0), size, THREE):
        buffer, column = TILE * g, begin + stride * g
        skip = g // LANES * LANES if t == u(0) else u(0)
        for q in range(THREE):
            for i in range(skip, count):
                w[buffer + TILE * q + i] = factor[column + stride * q + t + i]
        for q in range(u(0), g, THREE):
            _subtract(w, buffer + skip, TILE, w, TILE * q + skip, factor, begin + stride * q + g, stride, count - skip)
        if t == u(0):
            corner = buffer + g
            d0 = w[corner]
            l10, l20 = w[corner + ONE] / d0, w[corner + TWO] / d0
            d1 = w[corner + TILE + ONE] - l10 * w[corner + ONE]
            below = w[corner + TILE + TWO] - l10 * w[corner + TWO]
            l21 = below / d1
            d2 = w[corner + TWO_TILES + TWO] - (l20 * w[corner + TWO] + l21 * below)
            if not np.isfinite(d0 + d1 + d2) or d0 == 0.0 or d1 == 0.0 or d2 == 0.0:
                return False
            pivots[first + g], pivots[first + g + ONE], pivots[first + g + TWO] = d0, d1, d2
        else:
            corner = column + g
            l10, l20, l21 = factor[corner + ONE], factor[corner + TWO], factor[corner + stride + TWO]
            d0, d1, d2 = pivots[first + g], pivots[first + g + ONE], pivots[first + g + TWO]
        p0, p1, p2 = 1.0 / d0, 1.0 / d1, 1.0 / d2
        for i in range(skip, count):
            k, n = buffer + i, column + t + i
            w0 = w[k]
            w1 = w[k + TILE] - l10 * w0
            w2 = w[k + TWO_TILES] - (l20 * w0 + l21 * w1)
            w[k + TILE], w[k + TWO_TILES] = w1, w2
            factor[n], factor[n + stride], factor[n + stride + stride] = w0 * p0, w1 * p1, w2 * p2
    return True


@kernel(leaf=True)
def _add_block(target, to, apart, source, of, stride):
    """Add a block of three rows and columns."""
    for _ in range(3):
        target[to] += source[of]
        target[to + ONE] += source[of + ONE]
        target[to + TWO] += source[of + TWO]
        to, of = to + apart, of + stride


@kernel(leaf=True)
def _add_update(updates, below, stride, places, near, rest, factor, begin, high, size, update, apart):
    """Add the update of a supernode to the columns, and to the update, of the supernode above."""
    for j in range(rest):
        row, column = u(places[near + j]), below + stride * THREE * j
        if row < size:
            target = begin + high * row
            for i in range(j, rest):
                _add_block(factor, target + u(places[near + i]), high, updates, column + THREE * i, stride)
        else:
            target = update + apart * (row - size) - size
            for i in range(j, rest):
                _add_block(updates, target + u(places[near + i]), apart, updates, column + THREE * i, stride)


@kernel(leaf=True)
def _factorize(values, source, target, ones, table, places, factor, pivots, updates, w):
    """Factorize, see `_Plan`; False for a pivot that is 0 or not finite."""
    factor[:] = 0.0
    for e in range(len(source)):
        factor[u(target[e])] = values[u(source[e])]
    for e in range(len(ones)):
        factor[u(ones[e])] = 1.0
    count = u(len(table))
    for s in range(count):
        first, size, rest, begin, high = table[s, 0], table[s, 1], table[s, 2], table[s, 3], table[s, 4]
        update, stride, below = table[s, 5], table[s, 6], table[s, 8]
        for i in range(update, update + stride * THREE * rest):
            updates[i] = 0.0
        while below < count:
            of, apart, near, many = table[below, 5], table[below, 6], table[below, 7], table[below, 2]
            _add_update(updates, of, apart, places, near, many, factor, begin, high, size, update, stride)
            below = table[below, 9]
        for t in range(u(0), high, TILE):
            rows = min(TILE, high - t)
            if not _eliminate(factor, begin, high, size, t, rows, pivots, first, w):
                return False
            lowest, end = max(t, size) - size, stride if t + rows == high else max(t + rows, size) - size
            for j in range(u(0), THREE * rest, THREE):
                skip = max(lowest, j // LANES * LANES)
                to, at, of = update + stride * j + skip, size + skip - t, begin + size + j
                for q in range(u(0), size if skip < end else u(0), THREE):
                    _subtract(updates, to, stride, w, TILE * q + at, factor, of + high * q, high, end - skip)
    return True


@kernel(leaf=True)
def _subtract_columns(sums, factor, at, stride, begin, end, x0, x1, x2):
    """Subtract three columns of L times three numbers from sums."""
    for i in range(begin, end):
        k = at + i
        sums[i] -= factor[k] * x0 + factor[k + stride] * x1 + factor[k + stride + stride] * x2


@kernel(leaf=True)
def _products(sums, factor, at, stride, begin, end):
    """Products of sums with three columns of L."""
    a0 = a1 = a2 = a3 = b0 = b1 = b2 = b3 = c0 = c1 = c2 = c3 = 0.0  # sums that do not wait for each other
    for i in range(begin, end, FOUR):
        s0, s1, s2, s3 = sums[i], sums[i + ONE], sums[i + TWO], sums[i + THREE]
        k = at + i
        m = k + stride
        n = m + stride
        a0 += factor[k] * s0
        a1 += factor[k + ONE] * s1
        a2 += factor[k + TWO] * s2
        a3 += factor[k + THREE] * s3
        b0 += factor[m] * s0
        b1 += factor[m + ONE] * s1
        b2 += factor[m + TWO] * s2
        b3 += factor[m + THREE] * s3
        c0 += factor[n] * s0
        c1 += factor[n + ONE] * s1
        c2 += factor[n + TWO] * s2
        c3 += factor[n + THREE] * s3
    return (a0 + a1) + (a2 + a3), (b0 + b1) + (b2 + b3), (c0 + c1) + (c2 + c3)


@kernel(leaf=True)
def _forward(table, rows, factor, x, sums):
    """Solve L y = x in place."""
    for s in range(u(len(table))):
        first, size, rest, begin, high = table[s, 0], table[s, 1], table[s, 2], table[s, 3], table[s, 4]
        near = table[s, 7]
        for i in range(size):
            sums[i] = x[first + i]
        for i in range(size, high):
            sums[i] = 0.0
        for j in range(u(0), size, THREE):
            column = begin + high * j
            corner = column + j
            x0 = sums[j]
            x1 = sums[j + ONE] - factor[corner + ONE] * x0
            x2 = sums[j + TWO] - (factor[corner + TWO] * x0 + factor[corner + high + TWO] * x1)
            x[first + j], x[first + j + ONE], x[first + j + TWO] = x0, x1, x2
            _subtract_columns(sums, factor, column, high, (j + THREE) // LANES * LANES, high, x0, x1, x2)
        for i in range(rest):
            k, n = u(rows[near + i]), size + THREE * i
            x[k] += sums[n]
            x[k + ONE] += sums[n + ONE]
            x[k + TWO] += sums[n + TWO]


@kernel(leaf=True)
def _backward(table, rows, factor, x, sums):
    """Solve Lᵀ y = x in place."""
    count = u(len(table))
    for back in range(count):
        s = count - ONE - back
        first, size, rest, begin, high = table[s, 0], table[s, 1], table[s, 2], table[s, 3], table[s, 4]
        near = table[s, 7]
        for i in range(size):
            sums[i] = 0.0
        for i in range(rest):
            k, n = u(rows[near + i]), size + THREE * i
            sums[n], sums[n + ONE], sums[n + TWO] = x[k], x[k + ONE], x[k + TWO]
        for i in range(size + THREE * rest, high):
            sums[i] = 0.0
        for g in range(u(0), size, THREE):
            j = size - THREE - g
            column = begin + high * j
            corner = column + j
            p0, p1, p2 = _products(sums, factor, column, high, (j + THREE) // FOUR * FOUR, high)
            x2 = x[first + j + TWO] - p2
            x1 = x[first + j + ONE] - p1 - factor[corner + high + TWO] * x2
            x0 = x[first + j] - p0 - (factor[corner + ONE] * x1 + factor[corner + TWO] * x2)
            sums[j], sums[j + ONE], sums[j + TWO] = x0, x1, x2
            x[first + j], x[first + j + ONE], x[first + j + TWO] = x0, x1, x2


@kernel(leaf=True)
def _solve(table, rows, factor, pivots, order, b, y, x, sums):
    """Solve A y = b; x and sums are space for it."""
    for i in range(len(order)):
        x[i] = b[order[i]] if order[i] >= 0 else 0.0
    _forward(table, rows, factor, x, sums)
    for i in range(len(x)):
        x[i] /= pivots[i]
    _backward(table, rows, factor, x, sums)
    for i in range(len(order)):
        if order[i] >= 0:
            y[order[i]] = x[i]


class _Plan:
    """Order of elimination, supernodes and places of a `refweb.system.sparsity.Pattern`.

    A node with fewer than three unknowns gets others, whose diagonal entries are 1 and which are coupled with nothing.

    Attributes
    ----------
    order : ndarray of int32, shape (3 nodes,)
        Unknowns in the order of elimination; −1 for one of those others.
    table : ndarray of uint64, shape (supernodes, 10)
        First unknown in the order of elimination, number of columns, number of nodes that are coupled with these and
        eliminated later, begin of the columns in the factor and their distance, begin of the update among all updates
        and distance of its columns, begin of the nodes that are coupled, the last supernode below, and the next one
        below the same; the number of supernodes for none.
    rows, places : ndarray of uint32, shape (coupled nodes of all supernodes,)
        First unknown of each in the order of elimination, and its row in the supernode above.
    source, target : ndarray of int, shape (entries,)
        Entries of the pattern in the lower triangle of that order, and their places in the factor.
    ones : ndarray of int
        Places of the diagonal entries of the others.
    fill, height, tallest : int
        Number of entries of the factor and of the updates that are there at once, and of rows of a supernode.
    """

    def __init__(self, pattern):
        n, heads = pattern.size, np.flatnonzero(np.diff(pattern.row, prepend=-1))
        nodes, starts, lower = _eliminated(pattern.matrix(np.ones(len(pattern.indices)))[heads][:, heads])
        firsts, count = _supernodes(starts, lower), len(nodes)
        ends, number = np.append(firsts[1:], count), np.arange(len(firsts))
        size = ends - firsts
        of = np.repeat(number, size)  # supernode of each node
        rest = starts[ends] - starts[ends - 1]
        coupled = lower[_ranges(starts[ends - 1], rest)]
        owner, begins = np.repeat(number, rest), np.append(0, np.cumsum(rest))
        keys = owner * count + coupled

        def row(s, node):
            """Row of a node in a supernode, in nodes."""
            inside = of[node] == s
            number = np.searchsorted(keys, np.where(inside, 0, s * count + node))
            return np.where(inside, node - firsts[s], number - begins[s] + size[s])

        above = np.full(len(firsts), -1)
        above[rest > 0] = of[coupled[begins[:-1][rest > 0]]]
        self.rows, self.places = (3 * coupled).astype(np.uint32), (3 * row(above[owner], coupled)).astype(np.uint32)
        high, stride = _rounded_up(3 * (size + rest)), _rounded_up(3 * rest)
        area = 3 * size * high
        begin = np.cumsum(area) - area
        self.fill, self.tallest = int(area.sum()), int(high.max())
        update, below, beside = self._stacked(above.tolist(), (3 * stride * rest).tolist())
        columns = [3 * firsts, 3 * size, rest, begin, high, update, stride, begins[:-1], below, beside]
        self.table = np.column_stack(columns).astype(np.uint64)

        sizes = np.diff(heads, append=n)
        node, axis = np.repeat(np.argsort(nodes), sizes), np.arange(n) - np.repeat(heads, sizes)  # of each unknown
        at = 3 * node + axis
        self.order = np.full(3 * count, -1, dtype=np.int32)
        self.order[at] = np.arange(n)
        self.source = np.flatnonzero(at[pattern.indices] >= at[pattern.columns])
        i, j = pattern.indices[self.source], pattern.columns[self.source]
        s = of[node[j]]
        self.target = begin[s] + high[s] * (at[j] - 3 * firsts[s]) + 3 * row(s, node[i]) + axis[i]
        others = np.flatnonzero(self.order < 0)
        s = of[others // 3]
        self.ones = begin[s] + (high[s] + 1) * (others - 3 * firsts[s])

    def _stacked(self, above, areas):
        """Begin of the update of each supernode, the last supernode below each, and the next below the same.

        Updates of even and of odd depth are on two stacks: those below a supernode lie on top of one while its own
        comes to the top of the other.
        """
        count = len(above)
        depth, below, beside, begin = [0] * count, [count] * count, [count] * count, [0] * count
        for s in range(count - 1, -1, -1):
            if (p := above[s]) >= 0:
                depth[s] = 1 - depth[p]
                beside[s], below[p] = below[p], s
        top, height = [0, 0], [0, 0]
        for s, d in enumerate(depth):
            begin[s] = top[d]
            top[d] += areas[s]
            height[d] = max(height[d], top[d])
            k = below[s]
            while k < count:
                top[1 - d] -= areas[k]
                k = beside[k]
        self.height = sum(height)
        return np.array(begin) + height[0] * np.array(depth), below, beside


def _rounded_up(rows):
    """Numbers of rows with which every column begins at a multiple of `LANES`."""
    lanes = int(LANES)
    return (rows + lanes - 1) // lanes * lanes


def _ranges(begin, counts):
    """All integers of ranges by their begins and lengths."""
    return np.repeat(begin - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())


def _eliminated(graph):
    """Nodes in the order of elimination; starts and rows of the columns of L below its diagonal, in that order."""
    import qdldl

    n = graph.shape[0]
    upper = scipy.sparse.csc_matrix(scipy.sparse.triu(graph, format="csc"))
    upper.setdiag(n + 1.0)  # which is more than a row has off the diagonal
    lower, _, order = qdldl.Solver(upper, upper=True).factors()
    counts = np.diff(lower.indptr)
    above = np.full(n, -1)
    above[counts > 0] = lower.indices[lower.indptr[:-1][counts > 0]]
    rank = _postordered(above.tolist(), counts)
    keys = np.sort(rank[np.repeat(np.arange(n), counts)] * n + rank[lower.indices])
    nodes = np.empty(n, dtype=np.int64)
    nodes[rank] = order
    return nodes, np.searchsorted(keys, n * np.arange(n + 1)), keys % n


def _postordered(above, counts):
    """Rank of each node in an order in which subtrees follow each other, the one with the fullest column last."""
    n = len(above)
    sizes, depth = [1] * n, [0] * n
    for j, p in enumerate(above):
        if p >= 0:
            sizes[p] += sizes[j]
    for j in range(n - 1, -1, -1):
        if above[j] >= 0:
            depth[j] = depth[above[j]] + 1
    ends, rank = [*[0] * n, n], [0] * n  # the last is that of all roots, which are below −1
    for j in np.lexsort((-counts, depth)).tolist():
        end = ends[above[j]]
        rank[j] = ends[j] = end - 1
        ends[above[j]] = end - sizes[j]
    return np.array(rank)


def _supernodes(starts, rows):
    """First nodes of the supernodes: nodes with the same rows are joined, and others with few zeros."""
    counts = np.diff(starts)
    n = len(counts)
    above = np.full(n, -1)
    above[counts > 0] = rows[starts[:-1][counts > 0]]
    follows = above[:-1] == np.arange(1, n)
    heads = np.flatnonzero(np.append(True, ~(follows & (counts[:-1] == counts[1:] + 1)))).tolist()
    entries, follows, counts = np.append(0, np.cumsum(counts + 1)).tolist(), follows.tolist(), counts.tolist()
    firsts: list = []
    for first, end in zip(heads, [*heads[1:], n], strict=True):
        while firsts and follows[first - 1] and (many := end - firsts[-1]) <= MOST:
            dense = many * (0.5 * (many + 1) + counts[end - 1])
            if dense - (entries[end] - entries[firsts[-1]]) > SPARSE * dense:
                break
            first = firsts.pop()
        parts = -(-(end - first) // MOST)
        firsts += range(first, end, -(-(end - first) // parts))
    return np.array(firsts)


class Supernodal:
    """LDLᵀ by supernodes; order of elimination and places are found once."""

    solutions = 8

    def __init__(self, pattern):
        self.pattern = pattern
        self._values = np.zeros(0)

    @cached_property
    def _plan(self):
        return _Plan(self.pattern)

    @cached_property
    def _space(self):
        """Factor, pivots, updates, and L D of a supernode."""
        plan, buffer = self._plan, int(TILE) * 3 * MOST + int(LANES)
        return [np.zeros(size) for size in (plan.fill, len(plan.order), plan.height, buffer)]

    def factorize(self, values):
        """Factorize; raise a RuntimeError for a pivot that is 0 or not finite."""
        plan, self._values = self._plan, values
        if not _factorize(values, plan.source, plan.target, plan.ones, plan.table, plan.places, *self._space):
            raise RuntimeError("a pivot is 0")

    def solve(self, b):
        """Solution of A y = b."""
        plan, (factor, pivots, *_) = self._plan, self._space
        y, x, sums = np.empty(len(b)), np.empty(len(pivots)), np.empty(plan.tallest)  # threads may share a factor
        _solve(plan.table, plan.rows, factor, pivots, plan.order, np.ascontiguousarray(b), y, x, sums)
        return y

    def solve_all(self, b):
        """Solutions of A y = b, shape (n, k)."""
        return np.column_stack([self.solve(column) for column in b.T])

    def times(self, y):
        """A y."""
        return self.pattern.matrix(self._values) @ y

    def negative_pivots(self):
        """Number of pivots that are not positive."""
        return int(np.count_nonzero(~(self._space[1] > 0.0)))
