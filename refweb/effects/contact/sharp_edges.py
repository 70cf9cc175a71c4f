"""Lines that turn round an edge which is sharp for their elements: the push along them.

Straight elements cannot bend round an edge. A line with the tension T that turns there by a small angle θ, with the
push N = T θ, stores T θ² ξ (1 − ξ) L/2 more when the edge is at ξ of an element of length L than when it is at a node.
Energies differ by T θ² L/8, so that contact pushes along the line by N θ/4 on average from a node to the middle of an
element, and by N θ/2 at most, however stiff it is. With the radius r of the edge along the line this falls: it is
θ/4 (1 − r θ/(2 L))² of N on average, and 0 from r θ = 2 L on, as on a cylinder round which nodes turn the line
everywhere. A chain of four elements with the contact of `refweb.effects.contact.contact_points` has these factors on
θ/4, for overlaps of a thousandth to a hundredth of r or L:

=====================  =====  =====  =====  =====  =====  =====
r θ/L                  0.03   0.2    0.4    0.7    0.8    1.4
=====================  =====  =====  =====  =====  =====  =====
measured               1.00   0.77   0.58   0.47   0.39   0.15
(1 − r θ/(2 L))²       0.97   0.81   0.64   0.42   0.36   0.09
=====================  =====  =====  =====  =====  =====  =====

May change: private functions, `PRESSED` and how the edge is searched. Must stay: the fields of `Edge` in their order,
since checkpoints keep them as rows by `overlap`, and the call of `sharpest_edge` there; the formula of the share, which
``tests/statics/test_sharp_edges.py`` checks. Results do not depend on this file: `overlap` makes a finding of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...net.rotation import matrix_at

PRESSED = 0.1
"""Least overlap and tension of an element whose push counts, over the largest."""
GOLDEN = 0.5 * (3.0 - 5.0**0.5)


class Edge(NamedTuple):
    """An edge of a body round which a line turns.

    Attributes
    ----------
    line : int
        The line.
    angle : float
        Angle θ between the elements before and behind the touched one [rad].
    length : float
        Length L of the touched element [m].
    radius : float
        Radius r of the surface along the element [m].
    """

    line: int
    angle: float
    length: float
    radius: float

    @property
    def share(self) -> float:
        """Average push along the line, over the push of the contact."""
        return 0.25 * self.angle * max(1.0 - 0.5 * self.radius * self.angle / self.length, 0.0) ** 2

    def enough(self, share):
        """Least r/L at which no more than a ``share`` is left."""
        return 2.0 / self.angle * (1.0 - min(2.0 * (share / self.angle) ** 0.5, 1.0))


def sharpest_edge(state, body, overlap, limit):
    """The `Edge` of the largest share of a body, None if no share is above the ``limit``.

    Only elements count whose overlap and tension are not far below the largest: a slack line that lies about an edge is
    not pushed along. ``overlap`` is the depth of each element in the body [m], shape (cells,).
    """
    net, position = state.system.net, state.position
    if net.cells.shape[1] > 2:
        return None
    tension = np.where(overlap > PRESSED * overlap.max(), state.element_tension, 0.0)
    touched = np.flatnonzero(tension > PRESSED * tension.max())
    vectors = position[net.cells[:, 1]] - position[net.cells[:, 0]]
    length = np.linalg.norm(vectors, axis=1)
    ahead = vectors / length[:, None]
    order = np.argsort(net.cells.ravel(), kind="stable")
    ends = net.cells.ravel()[order]
    worst = None
    for c in touched.tolist():
        before, behind = (_next(net, order, ends, ahead, c, side) for side in (0, 1))
        angle = float(np.arccos(np.clip(before @ behind, -1.0, 1.0)))
        if 0.25 * angle > max(limit, worst.share if worst else 0.0):
            radius = _radius_along(state, body, position[net.cells[c, 0]], vectors[c])
            edge = Edge(int(net.line[c]), angle, float(length[c]), radius)
            if edge.share > max(limit, worst.share if worst else 0.0):
                worst = edge
    return worst


def _next(net, order, ends, ahead, c, side):
    """Direction of the element that goes on most straight at an end of element c, or its own at a free end."""
    node = net.cells[c, side]
    at = order[np.searchsorted(ends, node) : np.searchsorted(ends, node, side="right")]
    at = at[at // 2 != c]
    if not len(at):
        return ahead[c]
    directions = np.where((at % 2 == side)[:, None], -1.0, 1.0) * ahead[at // 2]
    return directions[(directions @ ahead[c]).argmax()]


def _radius_along(state, body, start, vector):
    """Radius of the surface along an element at its deepest point [m]; infinite where the surface is flat there."""
    axes = body.axes
    if body.turn is not None:
        axes = axes @ np.array(matrix_at(state.x, body.spin, body.turn)).T
    start, vector = axes @ (start - state.position[body.row]) - body.offset, axes @ vector
    depth, grown = body.shape.depth(), body.shape.grown()

    def deep(xi):
        return depth(tuple((start + xi * vector).tolist()), grown)

    places = np.linspace(0.0, 1.0, 17)
    nearest = int(np.argmax([deep(xi)[0] for xi in places]))
    low, high = places[max(nearest - 1, 0)], places[min(nearest + 1, 16)]
    for _ in range(40):
        first, second = low + GOLDEN * (high - low), high - GOLDEN * (high - low)
        low, high = (low, second) if deep(first)[0] > deep(second)[0] else (first, high)
    h = deep(0.5 * (low + high))[2]
    d = vector / np.linalg.norm(vector)
    bend = -float(d @ np.array([[h[0], h[1], h[2]], [h[1], h[3], h[4]], [h[2], h[4], h[5]]]) @ d)
    return 1.0 / bend if bend > 0.0 else np.inf
