"""The slowest vibrations about an equilibrium whose tangent is not symmetric, and a bound on the growth of the others.

With φ the shape of one, all s of (s² M + s C + K) φ = 0 are those of

    μ (a, b) = (−K⁻¹ (ω C a + ω² M b), a),        s = ω/μ,        a = μ φ,        b = φ,

with any ω; without C those of μ φ = K⁻¹ M φ, s² = −1/μ. Arnoldi iteration finds the largest μ, by one solution with K
in each step. Left vectors, by solutions with Kᵀ, tell how far rounding moves them; they are asked for only where
something grows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator, eigs, eigsh

NUMBER = 6
"""Number of μ that are looked for without C; with it twice as many."""
ROUNDING = 64.0 * np.finfo(float).eps
"""Error of a matrix over its norm."""
ABOVE = 1.05
"""The bound α over what an iteration finds of it, its square to 1e-2."""


class Slowest(NamedTuple):
    """The s of the slowest vibrations [1/s], and which of them grow beyond what rounding makes."""

    s: np.ndarray
    grows: np.ndarray


class Weighed:
    """Solutions with K for what has mass, weighed by the roots of that.

    Parameters
    ----------
    solver : refweb.system.factorization.Lu
        Of K.
    M : sparse matrix, shape (n, n)
        Mass [kg].
    C : sparse matrix, shape (n, n), optional
        −∂f/∂v [N s/m].
    """

    def __init__(self, solver, M, C=None):
        own = M.diagonal()
        self.massive = np.flatnonzero(own > 0.0)
        self._root, self._size, self._solver = np.sqrt(own[self.massive]), len(own), solver
        self.M = M.tocsr()[self.massive][:, self.massive]
        self.C = None if C is None else C.tocsr()[self.massive][:, self.massive]
        self.omega = 1.0

    def soft(self, force, transposed=False):
        """Weighed displacement under weighed forces."""
        whole = np.zeros(self._size)
        whole[self.massive] = force
        return self._solver.solve(whole, transposed)[self.massive]

    def once(self, u):
        """K⁻¹ M."""
        return self._root * self.soft(self.M @ (u / self._root))

    def once_transposed(self, u):
        """Its transpose."""
        return (self.M @ self.soft(self._root * u, True)) / self._root

    def twice(self, u):
        """The same of (a, b) with C."""
        a, b = np.split(u, 2)
        force = self.C @ (a / self._root) + self.omega * (self.M @ (b / self._root))
        return np.concatenate([-self.omega * self._root * self.soft(force), a])

    def twice_transposed(self, u):
        """Its transpose."""
        p, q = np.split(u, 2)
        pull = -self.omega * self.soft(self._root * p, True)
        return np.concatenate([(self.C.T @ pull) / self._root + q, self.omega * (self.M @ pull) / self._root])


def slowest(solver, M, C=None):
    """The `Slowest` vibrations of matrices as in `Weighed`."""
    weighed = Weighed(solver, M, C)
    size = len(weighed.massive)
    start = np.random.default_rng(0).standard_normal(size)
    for _ in range(4):
        start = weighed.once(start / np.linalg.norm(start))
    weighed.omega = 1.0 / np.sqrt(np.linalg.norm(start))
    if C is None:
        by, transposed, start, number = weighed.once, weighed.once_transposed, start, NUMBER
    else:
        by, transposed, start, number = weighed.twice, weighed.twice_transposed, np.tile(start, 2), 2 * NUMBER

    def found(matvec):
        operator = LinearOperator((len(start), len(start)), matvec=matvec, dtype=float)  # pyright: ignore[reportCallIssue]  # as __new__ takes them
        return eigs(operator, number, which="LM", v0=start)

    mu, vectors = found(by)
    growth = abs(np.sqrt(-1.0 / mu).real) if C is None else weighed.omega * (1.0 / mu).real
    s = np.sqrt(-1.0 / mu) if C is None else weighed.omega / mu
    grows = growth > 0.0
    if grows.any():
        _, left = found(transposed)
        off = ROUNDING * abs(mu).max() * _conditions(vectors, left)
        beyond = (abs(mu.imag) > off) | (mu.real < -off) if C is None else mu.real > off
        grows &= beyond
    return Slowest(np.where(s.real < 0.0, -s, s) if C is None else s, grows)


def _conditions(right, left):
    """Condition numbers of eigenvalues by unit vectors of the same space from the right and from the left."""
    overlap = left.T @ right
    dual = np.linalg.lstsq(overlap, left.T, rcond=np.finfo(float).eps)[0]
    return np.linalg.norm(dual, axis=1) * np.linalg.norm(right, axis=0)


def coupling(solve, A, M):
    """A bound on α = ‖S^(−1/2) A M^(−1/2)‖ [1/s], but for the chance of its iteration.

    Parameters
    ----------
    solve : callable
        Solution with S of a force.
    A : sparse matrix
        Skew.
    M : sparse matrix
        Diagonal, of mass above 0.
    """
    root = np.sqrt(M.diagonal())

    def times(u):
        return -(A @ solve(A @ (u.ravel() / root))) / root

    operator = LinearOperator(A.shape, matvec=times, dtype=float)  # pyright: ignore[reportCallIssue]  # as __new__ takes them
    start = np.random.default_rng(0).standard_normal(len(root))
    (largest,) = eigsh(operator, 1, which="LA", v0=times(start), tol=1e-2, return_eigenvectors=False)
    return ABOVE * float(np.sqrt(max(largest, 0.0)))
