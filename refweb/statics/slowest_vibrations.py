"""The slowest vibrations about an equilibrium whose tangent is not symmetric, and a bound on the growth of the others.

With φ the shape of a vibration, all s of (s² M + s C + K) φ = 0 are those of

    μ (a, b) = (−K⁻¹ (ω C a + ω² M b), a),        s = ω/μ,        a = μ φ,        b = φ,

with any ω. Without C they are those of μ φ = K⁻¹ M φ, s² = −1/μ. Arnoldi iteration finds the largest μ, with one
solution of K in each step. Where a vibration may grow, the μ are found again to all digits. Then left eigenvectors, by
solutions with Kᵀ, show how far rounding changes the μ.

May change: numbers of vectors and tolerances. Must stay: fields of `Slowest`, which `stability` reads; ``grows`` is
True only beyond rounding; seeds are fixed, so that the same run gives the same answer; `coupling`, which `stability`
imports. Tests: ``tests/statics/test_stability.py``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigs, eigsh

NUMBER, VECTORS = 4, 20
"""Number of μ to find without C, and number of Arnoldi vectors; with C twice as many of both."""
CLOSE = 1e-6
"""Relative error of these μ."""
ROUNDING = 64.0 * np.finfo(float).eps
"""Error of a matrix over its norm."""
ABOVE = 1.1
"""Bound of α over the value of the iteration, which finds α² to a relative error of `NEARLY`."""
NEARLY = 0.1


class Slowest(NamedTuple):
    """The s of the slowest vibrations [1/s], a mask of those that grow beyond rounding, and True if there are more."""

    s: Any
    grows: np.ndarray
    more: bool


class Weighed:
    """Solutions with K for unknowns with mass, scaled by the square roots of the masses.

    Parameters
    ----------
    solver : refweb.system.factorization.Lu
        Factorization of K.
    M : sparse matrix, shape (n, n)
        Mass [kg].
    C : sparse matrix, shape (n, n), optional
        −∂f/∂v [N s/m].
    """

    def __init__(self, solver, M, C=None):
        diagonal = M.diagonal()
        self.massive = np.flatnonzero(diagonal > 0.0)
        self._root, self._size, self._solver = np.sqrt(diagonal[self.massive]), len(diagonal), solver
        self.M = M.tocsr()[self.massive][:, self.massive]
        self.C: Any = None if C is None else C.tocsr()[self.massive][:, self.massive]
        self.omega = 1.0

    def soft(self, force, transposed=False):
        """Displacement of the unknowns with mass under forces on them."""
        full = np.zeros(self._size)
        full[self.massive] = force
        return self._solver.solve(full, transposed)[self.massive]

    def once(self, u):
        """K⁻¹ M times u, scaled."""
        return self._root * self.soft(self.M @ (u / self._root))

    def once_transposed(self, u):
        """Transpose of `once`, times u."""
        return (self.M @ self.soft(self._root * u, True)) / self._root

    def twice(self, u):
        """The operator of (a, b) with C, scaled."""
        a, b = np.split(u, 2)
        force = self.C @ (a / self._root) + self.omega * (self.M @ (b / self._root))
        return np.concatenate([-self.omega * self._root * self.soft(force), a])

    def twice_transposed(self, u):
        """Transpose of `twice`, times u."""
        p, q = np.split(u, 2)
        pull = -self.omega * self.soft(self._root * p, True)
        return np.concatenate([(self.C.T @ pull) / self._root + q, self.omega * (self.M @ pull) / self._root])


def slowest(solver, M, C=None):
    """The `Slowest` vibrations of matrices as in `Weighed`."""
    weighed = Weighed(solver, M, C)
    start = np.random.default_rng(0).standard_normal(len(weighed.massive))
    by, transposed, factor = weighed.once, weighed.once_transposed, 1
    if C is not None:
        for _ in range(4):
            start = weighed.once(start / np.linalg.norm(start))
        weighed.omega = 1.0 / np.sqrt(np.linalg.norm(start))
        by, transposed, factor, start = weighed.twice, weighed.twice_transposed, 2, np.tile(start, 2)

    def largest_pairs(matvec, close) -> Any:
        if len(start) <= 2 * factor * VECTORS:
            return np.linalg.eig(np.column_stack([matvec(e) for e in np.eye(len(start))]))
        operator = LinearOperator((len(start), len(start)), matvec=matvec, dtype=float)  # pyright: ignore[reportCallIssue]  # as __new__ takes them
        return eigs(operator, factor * NUMBER, which="LM", v0=start, ncv=factor * VECTORS, tol=close)

    mu, right = largest_pairs(by, CLOSE)
    suspect = (mu.imag != 0.0) | (mu.real < 0.0) if C is None else mu.real > -CLOSE * abs(mu)
    grows = np.zeros(len(mu), dtype=bool)
    if suspect.any():
        (mu, right), (_, left) = largest_pairs(by, 0.0), largest_pairs(transposed, 0.0)
        off = ROUNDING * abs(mu).max() * _conditions(right, left)
        grows = (abs(mu.imag) > off) | (mu.real < -off) if C is None else mu.real > off
    return Slowest(np.sqrt(-1.0 / mu + 0j) if C is None else weighed.omega / mu, grows, len(mu) < len(start))


def _conditions(right, left):
    """Condition numbers of eigenvalues by unit vectors of the same space from the right and from the left."""
    overlap = left.T @ right
    dual = np.linalg.lstsq(overlap, left.T, rcond=np.finfo(float).eps)[0]
    return np.linalg.norm(dual, axis=1) * np.linalg.norm(right, axis=0)


def coupling(solve, A, M):
    """A bound on α = ‖S^(−1/2) A M^(−1/2)‖ [1/s]; the iteration starts at random and may miss it by chance.

    Parameters
    ----------
    solve : callable
        Displacement S⁻¹ f under a force f.
    A : sparse matrix
        Skew-symmetric matrix.
    M : sparse matrix
        Diagonal matrix of masses above 0.
    """
    root = np.sqrt(M.diagonal())

    def times(u):
        return -(A @ solve(A @ (u.ravel() / root))) / root

    operator = LinearOperator(A.shape, matvec=times, dtype=float)  # pyright: ignore[reportCallIssue]  # as __new__ takes them
    start = np.random.default_rng(0).standard_normal(len(root))
    (largest,) = eigsh(operator, 1, which="LA", v0=times(start), ncv=6, tol=NEARLY, return_eigenvectors=False)
    return ABOVE * float(np.sqrt(max(largest, 0.0)))
