"""Factorizations of tangents: LDLᵀ by qdldl, whose D shows the signs of the pivots, and LU of what is not symmetric."""

from __future__ import annotations

from typing import Any

import numpy as np


class Factor:
    """LDLᵀ of matrices of one `refweb.system.sparsity.Pattern`; the ordering is found once."""

    def __init__(self, pattern):
        self.pattern = pattern
        self._solver: Any = None
        self._matrix: Any = None

    def update(self, values):
        """Factorize the symmetric matrix of these values."""
        import qdldl

        self._matrix = self.pattern.upper_matrix(values)
        if not self.pattern.size:
            return
        if self._solver is None:
            try:
                self._solver = qdldl.Solver(self._matrix, upper=True)
                return
            except RuntimeError:  # a zero pivot, which raises here and not in an update
                definite = self._matrix.copy()
                definite.data[:] = 0.0
                definite.setdiag(1.0)
                self._solver = qdldl.Solver(definite, upper=True)
        self._solver.update(self._matrix, upper=True)

    def solve(self, b):
        """Solution of A y = b, shape (n,); None where the factorization broke down on a zero pivot.

        qdldl reports no breakdown, so the residual of the solution is looked at and, where it is large, refined away.
        """
        if not self.pattern.size:
            return np.zeros(0)
        upper, y, rest = self._matrix, np.zeros_like(b), b
        bound = np.abs(b).max(initial=0.0)
        for _ in range(3):
            y = y + self._solver.solve(rest)
            rest = b - (upper @ y + upper.T @ y - upper.diagonal() * y)
            error = np.abs(rest).max(initial=0.0)
            if error <= 1e-8 * bound:
                return y
        return y if error <= 1e-2 * bound else None

    def negative_pivots(self):
        """Number of pivots that are not positive."""
        if not self.pattern.size:
            return 0
        return int(np.count_nonzero(~(self._solver.factors()[1] > 0.0)))


class Lu:
    """LU of matrices of one `refweb.system.sparsity.Pattern`, with what a `Factor` has."""

    def __init__(self, pattern):
        self.pattern = pattern
        self._solver = None

    def update(self, values):
        """Factorize the matrix of these values."""
        from scipy.sparse.linalg import splu

        try:
            self._solver = splu(self.pattern.matrix(values), permc_spec="MMD_AT_PLUS_A")
        except RuntimeError:  # exactly singular
            self._solver = None

    def solve(self, b):
        """Solution of A y = b, shape (n,); None where there is none."""
        if self._solver is None:
            return None
        y = self._solver.solve(b)
        return y if np.isfinite(y).all() else None

    def negative_pivots(self) -> int:
        """No signs of pivots tell of what is not symmetric."""
        raise NotImplementedError


def weak_pivot(solver):
    """Index of the first pivot of a `qdldl.Solver` that is not positive, None if all are."""
    _, pivots, order = solver.factors()
    bad = np.flatnonzero(~(pivots > 0.0))
    return int(order[bad[0]]) if len(bad) else None
