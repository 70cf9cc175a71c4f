"""Open positions of an equilibrium: the parts that float, their directions, and their range.

For lines that only pull, by the tension-only law or a curve that rises, the tensions of taut lines and their directions
are unique under dead loads. Two equilibria then differ by translations of *parts*. A part is connected by lines whose
tension is proven to be above 0. A part that no support holds along an axis floats along it, as far as its slack lines
allow, |d| ≤ L. For other laws or forces, the null space of the tangent is open. Tensions, reactions and energies do not
change as parts float.

May change: `SAMPLES`, `OPEN`, private functions. Must stay: fields of `Floating` and `Parts`, which
`results.observables`, `remarks` and `interval` read by name; `reach` and `limits` hold the values of all equilibria:
they may be too wide, never too narrow; `between_slack_lines`, which `equilibrium` and `monotone_loading`
import; `NullSpace`, which `newton` imports. Tests: ``tests/statics/test_floating.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from .bars import Bars

if TYPE_CHECKING:
    from numpy.typing import NDArray

SAMPLES = 3
"""Number of random moves without stiffness that represent all such moves."""
OPEN = 1e-3
"""Least component of a move without stiffness, over its largest component, that counts as open."""


@dataclass(frozen=True, eq=False)
class Floating:
    """Components of positions that an equilibrium does not determine.

    Attributes
    ----------
    free : ndarray of bool, shape (rows, 3)
        True for components that may move without stiffness.
    moves : ndarray, shape (k, rows, 3)
        Random moves of this kind; the largest component of each is 1.
    parts : refweb.statics.floating.Parts, optional
        Parts that float as a whole; None where only the tangent is known.
    """

    free: np.ndarray
    moves: np.ndarray
    parts: Parts | None = None

    @property
    def rows(self) -> NDArray[np.int64]:
        """Rows with an open component."""
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
        Largest distance of the rows of each pair [m]: the natural length, for a taut line its length.
    straight : bool
        True if each line is one bar, whose length is the distance of its ends.
    """

    of: np.ndarray
    fixed: np.ndarray
    position: np.ndarray
    pairs: np.ndarray
    longest: np.ndarray
    straight: bool

    @cached_property
    def reach(self) -> NDArray[np.float64]:
        """Least and largest position of each row that chains of lines allow [m], shape (2, rows, 3).

        The distance of a floating row from a fixed row is at most the length of the lines between them. This is an
        outer bound.
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

    def limits(self, row: int, axis: int) -> tuple[float, float] | None:
        """Least and largest position of a row along an axis [m], infinite where nothing holds it; None if unknown."""
        if not self.straight:
            return None
        from .interval import Interval

        return Interval(self, self.of[row], axis).limits(self.position[row, axis])


def _least_of_each(graph):
    """The graph with the shortest line between each two rows, where a sparse matrix would add their lengths."""
    order = np.lexsort((graph.data, graph.col, graph.row))
    row, col, data = graph.row[order], graph.col[order], graph.data[order]
    first = np.append(True, (np.diff(row) != 0) | (np.diff(col) != 0))
    return coo_array((data[first], (row[first], col[first])), shape=graph.shape).tocsr()


def between_slack_lines(system, equilibrium):
    """The `Floating` parts of an equilibrium with a duality bound; None where no part floats.

    A line counts as taut where its tension exceeds its proven error at each quadrature point.
    """
    net, x = system.at(equilibrium.step).net, equilibrium.x
    tension = Bars(net, x).tension.reshape(len(net.cells), -1)
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
    reach = np.tile(net.natural_length * (1.0 + net.slackness), net.cells.shape[1] - 1)
    longest = np.where(joined, apart, np.maximum(apart, reach * (1.0 if net.cells.shape[1] == 2 else 2.0)))
    moves = np.random.default_rng(0).uniform(-1.0, 1.0, (SAMPLES, count, 3))[:, part] * free
    parts = Parts(part, fixed, position, pairs, longest, len(net.weights) == 1)
    return Floating(free, moves / np.abs(moves).max(axis=(1, 2), keepdims=True), parts)


def _without_slip(system, x, moves):
    """Combinations of moves, (k, rows, 3), in which no thread slips over a ring that has friction.

    A tangent lets rings slip on to either side, but friction resists a thread that turns back.
    """
    slips, position = [np.zeros((len(moves), 0))], system.net.points + x
    for thread in system.net.threads:
        if any(thread.friction):
            first, second = thread.segments.T
            along = position[second] - position[first]
            along /= np.linalg.norm(along, axis=1)[:, None]
            slips.append(((moves[:, second] - moves[:, first]) * along).sum(axis=2))
    _, size, vectors = np.linalg.svd(moves.reshape(len(moves), -1).T, full_matrices=False)
    basis = vectors[size > OPEN * size.max(initial=0.0)]
    if not len(basis):
        return moves
    turned, slip, _ = np.linalg.svd(basis @ np.hstack(slips))
    without = turned.T[np.count_nonzero(slip > OPEN * size.max()) :] @ basis
    if not len(without):
        return np.zeros_like(moves)
    mixed = np.random.default_rng(2).uniform(-1.0, 1.0, (len(moves), len(without))) @ without
    some = np.tensordot(mixed, moves, axes=1)
    return some / np.abs(some).max(axis=(1, 2))[:, None, None]


class NullSpace:
    """Moves without stiffness of a tangent K, by the factorization of K + τ G.

    G is the geometric stiffness of a unit tension in every line; it is definite where the net is connected to supports.
    In the eigenvectors of K v = λ G v, the matrix (K + τ G)⁻¹ τ G is τ/(λ + τ): 1 where λ = 0, and nearly 0 where λ is
    far above τ.

    Parameters
    ----------
    factor : refweb.system.factorization.Factor
        Factorization of K + τ G.
    weight : scipy.sparse.csc_array, shape (n, n)
        τ G.
    """

    def __init__(self, factor, weight):
        self._factor, self._weight = factor, weight

    def part(self, p):
        """Part of a displacement that has no stiffness, shape (n,); None where the factorization breaks down."""
        for _ in range(2):
            p = self._factor.solve(self._weight @ p)
            if p is None:
                return None
        return p

    def solve(self, force):
        """Displacement under a force, without moves of no stiffness; None where the factorization breaks down."""
        p = self._factor.solve(force)
        for _ in range(2):
            if p is None or (none := self.part(p)) is None:
                return None
            force = force - self._weight @ none
            p = self._factor.solve(force)
        return p

    def floating(self, system, x):
        """Parts that may move at no cost about a displacement x, a `Floating`; None where there are none."""
        rings = sum(len(thread.friction) for thread in system.net.threads if any(thread.friction))
        moves, levers = np.zeros((SAMPLES + rings, system.rows, 3)), system.levers[:, None]
        for move, p in zip(
            moves, np.random.default_rng(0).uniform(-1.0, 1.0, (len(moves), len(system.free))), strict=True
        ):
            change = self.part(p)
            if change is not None and (largest := np.abs(levers * system.rows_of(change)).max(initial=0.0)) > OPEN:
                move.ravel()[system.free] = change / largest
        moves = _without_slip(system, x, moves) if rings else moves
        for part_held in system.unsupported_parts:  # which the tangent's anchors hold
            moves[:, part_held.rows, part_held.axis] += np.random.default_rng(1).uniform(0.5, 1.0, (len(moves), 1))
        free = np.any(np.abs(levers * moves) > OPEN, axis=0)
        # What may move at no cost turns as well, where it goes on: its other components change to second order.
        free |= free.any(axis=1)[:, None] & ~system.supported
        if system.carriers:
            with_nodes = moves.copy()
            system.carriers.add_moves(x, with_nodes)
            free |= (np.abs(with_nodes) > OPEN).any(axis=0) & system.carried[:, None]
        return Floating(free, moves) if free.any() else None
