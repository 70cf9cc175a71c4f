"""Nested dissection of a graph: separators, and the parts that they leave, as a binary tree.

A separator parts a graph into two halves without an edge between them. Both are parted again, down to small parts
(George, SIAM J. Numer. Anal. 10, 1973, doi:10.1137/0710032). Parts are halved along coordinates that the graph itself
has: differences of the numbers of edges to nodes far apart. A folded web has the same as a flat one. Of four directions
and both sides of each cut, the fewest nodes are the separator.

May change: the directions, and how halves are found: they change the fill-in, and results by rounding. Must stay:
numbers of tree nodes, 2h and 2h + 1 below h, and that no edge joins two parts neither of which is above the other;
`multifrontal` counts on both. Tests: ``tests/system/test_multifrontal.py``.
"""

from __future__ import annotations

import numpy as np


def dissected(graph, largest):
    """Number in a binary tree of the separator or part that each node of a graph is in.

    Parameters
    ----------
    graph : csr_array, shape (n, n)
        Symmetric; entries off the diagonal are edges.
    largest : int
        Largest number of nodes of a part that is not parted again.

    Returns
    -------
    ndarray of int, shape (n,)
        1 for the first separator; the parts and separators on its sides are below 2 and 3. Nodes with more than √n
        edges, which shorten all ways, count as a part of it.
    """
    active = np.diff(graph.indptr) <= max(np.sqrt(graph.shape[0]), largest)
    nodes = np.flatnonzero(active)
    numbers = np.ones(len(active), dtype=np.int64)
    numbers[nodes] = _tree(graph[nodes][:, nodes] if len(nodes) < len(active) else graph, largest)
    return numbers


def _tree(graph, largest):
    """`dissected` of a graph without nodes of many edges."""
    n = graph.shape[0]
    orders, ends = [np.argsort(along, kind="stable") for along in _directions(graph)], graph.tocoo()
    once = ends.row < ends.col
    edges = np.array([ends.row[once], ends.col[once]])
    numbers, active = np.ones(n, dtype=np.int64), np.ones(n, dtype=bool)
    while True:
        _, part, sizes = np.unique(numbers[active], return_inverse=True, return_counts=True)
        active[active] = sizes[part] > largest
        if not active.any():
            return numbers
        kept, part = np.unique(part[sizes[part] > largest], return_inverse=True)
        of, sizes = np.full(n, -1), sizes[kept]
        of[active] = part
        edges = edges[:, (of[edges[0]] >= 0) & (of[edges[0]] == of[edges[1]])]
        separator, second = _halved(orders, edges, active, of, sizes)
        active &= ~separator
        numbers[active] = 2 * numbers[active] + second[active]


def _halved(orders, edges, active, of, sizes):
    """Masks of the separators of all parts, and of the second halves."""
    first, fewest = np.cumsum(sizes) - sizes, np.full(len(sizes), len(of))
    separator, second = np.zeros((2, len(of)), dtype=bool)
    for order in orders:
        nodes = order[active[order]]
        nodes = nodes[np.argsort(of[nodes], kind="stable")]
        behind = np.zeros(len(of), dtype=bool)
        behind[nodes] = np.arange(len(nodes)) - first[of[nodes]] >= sizes[of[nodes]] // 2
        across = edges[:, behind[edges[0]] != behind[edges[1]]].ravel()
        for side in (False, True):
            cut = np.zeros(len(of), dtype=bool)
            cut[across[behind[across] == side]] = True
            count = np.bincount(of[cut], minlength=len(sizes))
            better = active & (count < fewest)[of]
            fewest = np.minimum(fewest, count)
            separator[better], second[better] = cut[better], behind[better]
    return separator, second


def _directions(graph):
    """Coordinates of the nodes along four directions, by numbers of edges to four nodes far apart in each component."""
    from scipy.sparse.csgraph import connected_components, dijkstra

    _, component = connected_components(graph, directed=False)

    def away(nodes):
        return dijkstra(graph, indices=nodes, unweighted=True, min_only=True)

    def farthest(distance):
        order = np.lexsort((distance, component))
        return order[np.append(np.diff(component[order]) > 0, True)]

    nearest = away(farthest(away(farthest(np.zeros(len(component))))))
    distances = [nearest]
    for _ in range(3):
        distances.append(away(farthest(nearest)))
        nearest = np.minimum(nearest, distances[-1])
    a, b, c, d = distances
    return a - b, c - d, a - b + c - d, a - b - c + d
