"""Range of a part that floats: a small convex problem.

The equilibria of a net of tension-only lines under dead loads are translations t of its floating parts. No slack line
may become longer than its natural length, c = ½ (L² − |d + t_a − t_b|²) ≥ 0. With multipliers λ ≥ 0 and the change A t
of a line's vector, the largest t of one part along an axis e satisfies

    Σ Aᵀ (λ d) = e,    λ c = 0,

which a primal–dual interior-point method solves through λ c = μ. Its matrix keeps the multipliers as unknowns, so that
lines at their limit do no harm. By weak duality e·t + Σ λ c is never below the largest t where the first equation
holds. This sum is returned.

May change: the iteration and its constants. Must stay: `Interval` and `limits`, which `floating.Parts.limits` calls,
and that a limit is the value of the dual problem, e·t + Σ λ c with balanced multipliers: such a value is never too
narrow, however the iteration ends. Tests: ``tests/statics/test_floating.py``.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import block_array, coo_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

CLOSE, MOST = 1e-10, 200
"""Relative tolerance of λ c and of the balance of λ d at the end; largest number of iterations."""
SHARE = 0.1
"""μ over the mean of λ c before a step."""


class Interval:
    """Range of one part along one axis.

    Parameters
    ----------
    parts : refweb.statics.floating.Parts
        Floating parts of the equilibrium.
    part, axis : int
        Number of the part, and axis.
    """

    def __init__(self, parts, part, axis):
        ends = parts.of[parts.pairs]
        moving = ~parts.fixed.all(axis=1)
        between = (ends[:, 0] != ends[:, 1]) & moving[ends].any(axis=1)
        near = between & moving[ends].all(axis=1)
        graph = coo_array((np.ones(near.sum()), tuple(ends[near].T)), shape=(len(moving), len(moving)))
        group = connected_components(graph, directed=False)[1]
        between &= (np.where(moving[ends], group[ends], -1) == group[part]).any(axis=1)
        ends, pairs = ends[between], parts.pairs[between]
        self._number = np.full((len(moving), 3), -1)
        mask = (moving & (group == group[part]))[:, None] & ~parts.fixed
        touched = np.zeros_like(moving)
        touched[ends] = True
        # Along an axis that holds none of these parts all of them can go on together: one of them stays.
        self.bounded = bool((parts.fixed[:, axis] & touched).any())
        for k in range(3):
            if not (parts.fixed[:, k] & touched).any():
                mask[part, k] = False
        mask &= touched[:, None]
        self._number[mask] = np.arange(mask.sum())
        self._goal = self._number[part, axis]
        self._line = parts.position[pairs[:, 1]] - parts.position[pairs[:, 0]]
        self._longest = parts.longest[between]
        self._count = int(mask.sum())
        lines, rows, columns, signs = np.arange(len(pairs)), [], [], []
        for end, sign in ((1, 1.0), (0, -1.0)):
            for k in range(3):
                number = self._number[ends[:, end], k]
                rows.append(3 * lines[number >= 0] + k)
                columns.append(number[number >= 0])
                signs.append(np.full(len(rows[-1]), sign))
        shape = (3 * len(pairs), self._count)
        self._turns = coo_array((np.concatenate(signs), (np.concatenate(rows), np.concatenate(columns))), shape).tocsc()

    def limits(self, now):
        """Least and largest position [m] of a row that is at ``now``; None if rounding hides them."""
        if not self.bounded:
            return -np.inf, np.inf
        ends = now - self._farthest(-1.0), now + self._farthest(1.0)
        return ends if np.isfinite(ends).all() else None

    def _farthest(self, sign):
        """Largest distance along ``sign`` times the axis [m]."""
        goal, size = np.zeros(self._count), self._longest.max()
        goal[self._goal] = sign
        t, weight, rest = np.zeros(self._count), np.full(len(self._line), 1.0 / size), 0.1 * self._longest**2
        farthest = np.inf
        for _ in range(MOST):
            line = self._line + (self._turns @ t).reshape(-1, 3)
            left = 0.5 * (self._longest**2 - (line**2).sum(axis=1))
            open_ = goal - self._turns.T @ (weight[:, None] * line).ravel()
            if np.abs(open_).max() < CLOSE:
                farthest = min(farthest, float(goal @ t + weight @ left))
                if (weight @ rest) < CLOSE * size and np.abs(left - rest).max() < CLOSE * size**2:
                    break
            off, mean = left - rest, weight @ rest / len(rest)
            share = SHARE if np.abs(weight * off).max() < SHARE * mean else 1.0
            try:
                moved, change = self._newton(line, weight, rest, open_, off, share * mean)
            except RuntimeError:  # exactly singular, where rounding allows no further step
                break
            closer = off - (line * (self._turns @ moved).reshape(-1, 3)).sum(axis=1)
            length = min(_longest_step(weight, change), _longest_step(rest, closer))
            t, weight, rest = t + length * moved, weight + length * change, rest + length * closer
        return farthest

    def _newton(self, line, weight, rest, open_, off, target):
        """Changes of t and of the multipliers."""
        count, lines = self._count, len(line)
        every = 3 * lines
        spread = coo_array((line.ravel(), (np.repeat(np.arange(lines), 3), np.arange(every))), (lines, every)).tocsr()
        along = spread @ self._turns
        across = self._turns.T @ diags_array(np.repeat(weight, 3)) @ self._turns
        matrix = block_array([[across, along.T], [along, diags_array(-rest / weight)]], format="csc")
        change = splu(matrix).solve(np.concatenate([open_, off - target / weight + rest]))
        return change[:count], change[count:]


def _longest_step(value, change):
    """Largest step, at most 1, that leaves a hundredth of the value that falls most."""
    down = change < 0.0
    return min(1.0, 0.99 * (value[down] / -change[down]).min(initial=np.inf))
