"""Open positions of an equilibrium: the parts that float, their directions, and their range.

For the tension-only law under dead loads the tensions of taut lines and their directions are unique. Two equilibria
then differ by translations of *parts*, connected by lines whose tension is proven to be above 0; a part that no support
holds along an axis floats along it, as far as its slack lines let it, |d| ≤ L. For other laws, and where other forces
act, what may move at no cost is the null space of the tangent. Tensions, reactions and energies do not change where
parts float.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from ..effects.elasticity import strains

SAMPLES = 3
"""Number of moves at no cost that stand for all of them, at random."""
OPEN = 1e-3
"""Component of a move at no cost, over its largest, from which on it counts as open."""


@dataclass(frozen=True, eq=False)
class Floating:
    """Components of positions that an equilibrium does not determine.

    Attributes
    ----------
    free : ndarray of bool, shape (rows, 3)
        Components that may move at no cost.
    moves : ndarray, shape (k, rows, 3)
        Such moves, at random, the largest component of each 1.
    parts : refweb.statics.floating.Parts, optional
        What floats as a whole; None where only the tangent is known.
    """

    free: np.ndarray
    moves: np.ndarray
    parts: Parts | None = None

    @property
    def rows(self):
        """Rows of which some component is open."""
        return np.flatnonzero(self.free.any(axis=1))


@dataclass(frozen=True, eq=False)
class Parts:
    """Parts of a net that float along some axes, in one equilibrium.

    Attributes
    ----------
    of : ndarray of int, shape (rows,)
        The part of each row.
    fixed : ndarray of bool, shape (parts, 3)
        Axes along which a part has a support.
    position : ndarray, shape (rows, 3)
        Positions in the equilibrium [m].
    pairs : ndarray of int, shape (pairs, 2)
        Rows that a line joins.
    longest : ndarray, shape (pairs,)
        How far apart the rows of each may be [m]: the natural length, of a taut line its length.
    straight : bool
        Whether each line is one bar, whose length is the distance of its ends.
    """

    of: np.ndarray
    fixed: np.ndarray
    position: np.ndarray
    pairs: np.ndarray
    longest: np.ndarray
    straight: bool

    @cached_property
    def reach(self):
        """Least and largest position that chains of lines leave to each row [m], shape (2, rows, 3).

        A row that floats is no farther from one that is held than the lines between them are long: an outer bound.
        """
        rows = len(self.of)
        limits = np.array([self.position, self.position])
        for axis in range(3):
            fixed = np.flatnonzero(self.fixed[self.of, axis])
            for side, sign in enumerate((-1.0, 1.0)):
                if not len(fixed):
                    limits[side, :, axis] = sign * np.inf
                    continue
                ahead = sign * self.position[fixed, axis]
                start = ahead.min() - 1.0  # edges of no length would be none
                i = np.concatenate([self.pairs[:, 0], np.full(len(fixed), rows)])
                j = np.concatenate([self.pairs[:, 1], fixed])
                length = np.concatenate([self.longest, ahead - start])
                both = np.concatenate([i, j[: len(self.pairs)]]), np.concatenate([j, i[: len(self.pairs)]])
                graph = coo_array((np.append(length, self.longest), both), shape=(rows + 1, rows + 1))
                smallest = _least_of_each(graph)
                far = dijkstra(smallest, indices=rows)[:rows] + start
                open_ = ~self.fixed[self.of, axis]
                limits[side, open_, axis] = sign * far[open_]
        return limits

    def limits(self, row, axis):
        """Least and largest position of a row along an axis [m], infinite where nothing holds it; None if unknown."""
        if not self.straight:
            return None
        from .interval import Interval

        return Interval(self, self.of[row], axis).limits(self.position[row, axis])


def _least_of_each(graph):
    """The graph with the shortest of the lines between the same two rows, where a sparse matrix would sum them."""
    order = np.lexsort((graph.data, graph.col, graph.row))
    row, col, data = graph.row[order], graph.col[order], graph.data[order]
    first = np.append(True, (np.diff(row) != 0) | (np.diff(col) != 0))
    return coo_array((data[first], (row[first], col[first])), shape=graph.shape).tocsr()


def between_slack_lines(system, equilibrium):
    """Floating parts of an equilibrium with a duality bound, a `Floating`; None where nothing floats.

    A line is taut where the bound proves it: its tension exceeds its error, at each quadrature point.
    """
    net, x = system.at(equilibrium.step).net, equilibrium.x
    tension = net.line_data.ea[:, None] * strains(net, x)
    taut = (tension > equilibrium.duality_bound.tension[:, None]).all(axis=1) | net.forming
    pairs = np.vstack([net.cells[:, [0, k]] for k in range(1, net.cells.shape[1])])
    joined = np.tile(taut, net.cells.shape[1] - 1)
    graph = coo_array((joined[joined], tuple(pairs[joined].T)), shape=(system.rows, system.rows))
    count, part = connected_components(graph, directed=False)
    fixed = np.zeros((count, 3), dtype=bool)
    np.logical_or.at(fixed, part, system.supported)
    free = ~fixed[part]
    if not free.any():
        return None
    position = net.points + x
    apart = np.linalg.norm(position[pairs[:, 0]] - position[pairs[:, 1]], axis=1)
    reach = np.tile(net.natural_length, net.cells.shape[1] - 1)
    longest = np.where(joined, apart, np.maximum(apart, reach * (1.0 if net.cells.shape[1] == 2 else 2.0)))
    moves = np.random.default_rng(0).uniform(-1.0, 1.0, (SAMPLES, count, 3))[:, part] * free
    parts = Parts(part, fixed, position, pairs, longest, len(net.weights) == 1)
    return Floating(free, moves / np.abs(moves).max(axis=(1, 2), keepdims=True), parts)


class NullSpace:
    """Moves that a tangent K leaves at no cost, by the factorization of K + τ G.

    G is the geometric stiffness of a unit tension in every line, which is definite where the net holds together: in the
    eigenvectors of K v = λ G v the matrix (K + τ G)⁻¹ τ G is τ/(λ + τ), which is 1 where λ = 0 and nearly 0 where λ is
    far above τ.

    Parameters
    ----------
    factor : refweb.system.factorization.Factor
        Of K + τ G.
    weight : scipy.sparse.csc_array, shape (n, n)
        τ G.
    """

    def __init__(self, factor, weight):
        self._factor, self._weight = factor, weight

    def part(self, p):
        """Part of a displacement of the unknowns that costs nothing, shape (n,); None where the factor breaks down."""
        for _ in range(2):
            p = self._factor.solve(self._weight @ p)
            if p is None:
                return None
        return p

    def solve(self, force):
        """Displacement that a force makes but for moves at no cost, along which it is left out; None as above."""
        p = self._factor.solve(force)
        for _ in range(2):
            if p is None or (none := self.part(p)) is None:
                return None
            force = force - self._weight @ none
            p = self._factor.solve(force)
        return p

    def floating(self, system, x):
        """Parts that may move at no cost about a displacement x, a `Floating`; None where there are none."""
        moves, levers = np.zeros((SAMPLES, system.rows, 3)), system.levers[:, None]
        for move, p in zip(
            moves, np.random.default_rng(0).uniform(-1.0, 1.0, (SAMPLES, len(system.free))), strict=True
        ):
            change = self.part(p)
            if change is not None and (largest := np.abs(levers * system.rows_of(change)).max(initial=0.0)) > OPEN:
                move.ravel()[system.free] = change / largest
        for part_held in system.unsupported_parts:  # which the tangent's anchors hold
            moves[:, part_held.rows, part_held.axis] += np.random.default_rng(1).uniform(0.5, 1.0, (SAMPLES, 1))
        free = np.any(np.abs(levers * moves) > OPEN, axis=0)
        # What may move at no cost turns as well, where it goes on: its other components change to second order.
        free |= free.any(axis=1)[:, None] & ~system.supported
        if system.carriers:
            with_nodes = moves.copy()
            system.carriers.add_moves(x, with_nodes)
            free |= (np.abs(with_nodes) > OPEN).any(axis=0) & system.carried[:, None]
        return Floating(free, moves) if free.any() else None
