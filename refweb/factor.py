"""Symmetric factorization of the tangent: LDLᵀ by qdldl, whose D shows the signs of the pivots."""

from __future__ import annotations

import numpy as np


class Factor:
    """LDLᵀ of matrices of one `refweb.pattern.Pattern`; the ordering is found once."""

    def __init__(self, pattern):
        self.pattern = pattern
        self._solver = None
        self._matrix = None

    def update(self, values):
        """Factorize the symmetric matrix of these values."""
        import qdldl

        self._matrix = self.pattern.upper_matrix(values)
        if self._solver is None:
            self._solver = qdldl.Solver(self._matrix, upper=True)
        else:
            self._solver.update(self._matrix, upper=True)

    def solve(self, b):
        """Solution of A y = b, shape (n,); None where the factorization broke down on a zero pivot.

        qdldl reports no breakdown, so the residual of the solution is looked at.
        """
        y = self._solver.solve(b)
        if not np.isfinite(y).all():
            return None
        upper = self._matrix
        product = upper @ y + upper.T @ y - upper.diagonal() * y
        bound = 1e-6 * np.abs(b).max(initial=0.0)
        return y if np.abs(product - b).max(initial=0.0) <= bound else None

    def negative_pivots(self):
        """Number of pivots that are not positive."""
        return int(np.count_nonzero(~(self._solver.factors()[1] > 0.0)))
