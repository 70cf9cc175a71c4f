"""What cannot change where no line passes through a line: seen in frames alone, by other means than refweb's.

Centre lines are polygons. Where two of their edges cross as seen from a direction, one is in front of the other; while
they go on crossing in that view, it stays in front unless one passes through the other. How two closed lines are linked
is the sum of such signs, and of an open line whose ends are far away it tells the knot: the determinant is that of the
matrix of its crossings, 1 of a line without a knot, 3 of an overhand knot, see C. C. Adams, *The Knot Book*, 1994.
"""

import numpy as np

DIRECTIONS = 4
"""Number of directions at random from which crossings are seen."""


def views():
    """Axes of views from directions at random, shape (3, 3) each; the third is the direction."""
    random = np.random.default_rng(11)
    return [np.linalg.qr(random.standard_normal((3, 3)))[0] for _ in range(DIRECTIONS)]


def crossings(points, edges, axes):
    """(Pairs of edges that cross in a view, shape (n, 2); how far the first is in front of the other there; places).

    Edges that share a node make no pair. The places on both edges are from 0 to 1, shape (n, 2).
    """
    seen = points @ axes
    first, last = seen[edges[:, 0]], seen[edges[:, 1]]
    i, j = np.triu_indices(len(edges), 1)
    low, high = np.minimum(first, last)[:, :2], np.maximum(first, last)[:, :2]
    near = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
    near &= (edges[i][:, :, None] != edges[j][:, None, :]).all(axis=(1, 2))
    i, j = i[near], j[near]
    u, w, d = last[i] - first[i], last[j] - first[j], first[j] - first[i]
    area = u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (d[:, 0] * w[:, 1] - d[:, 1] * w[:, 0]) / area
        t = (d[:, 0] * u[:, 1] - d[:, 1] * u[:, 0]) / area
    inside = (s > 0.0) & (s < 1.0) & (t > 0.0) & (t < 1.0)
    s, t, i, j, u, w = s[inside], t[inside], i[inside], j[inside], u[inside], w[inside]
    front = first[i, 2] + s * u[:, 2] - first[j, 2] - t * w[:, 2]
    return np.column_stack([i, j]), front, np.column_stack([s, t])


def passed(before, after, edges, margin=0.0):
    """Pairs of edges of which one that was in front is behind from one frame to the next, in any view, shape (n, 2).

    ``margin`` is a distance [m] that both are apart by at least.
    """
    found = []
    for axes in views():
        (one, was, _), (other, now, _) = crossings(before, edges, axes), crossings(after, edges, axes)
        numbers = [pairs[:, 0] * len(edges) + pairs[:, 1] for pairs in (one, other)]
        _, a, b = np.intersect1d(*numbers, return_indices=True)
        turned = (was[a] * now[b] < 0.0) & (np.minimum(np.abs(was[a]), np.abs(now[b])) > margin)
        found.append(one[a][turned])
    return np.unique(np.concatenate(found), axis=0)


def knot_determinant(points):
    """Determinant of an open line, its ends continued straight to far away, by its crossings in a view."""
    size = np.ptp(points, axis=0).max()
    middle = points.mean(axis=0)
    out = [100.0 * size * (end - middle) / np.linalg.norm(end - middle) for end in (points[0], points[-1])]
    line = np.vstack([points[0] + out[0], points, points[-1] + out[1]])
    edges = np.column_stack([np.arange(len(line) - 1), np.arange(1, len(line))])
    pairs, front, places = crossings(line, edges, views()[0])
    if not len(pairs):
        return 1
    below = np.where(front > 0.0, 1, 0)  # which of a pair is behind
    rows = np.arange(len(pairs))
    along = pairs + places
    under = np.sort(along[rows, below])  # an arc goes from one passage behind to the next
    arc = lambda place: int(np.searchsorted(under, place))  # noqa: E731
    matrix = np.zeros((len(pairs), len(pairs) + 1))
    for n in rows:
        over, own = along[n, 1 - below[n]], along[n, below[n]]
        matrix[n, arc(over)] += 2.0
        matrix[n, arc(own - 1e-12)] -= 1.0
        matrix[n, arc(own + 1e-12)] -= 1.0
    return round(abs(np.linalg.det(matrix[:, 1:])))
