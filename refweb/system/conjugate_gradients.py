"""Conjugate gradients with the factorization of a similar matrix as preconditioner.

They solve A y = b with a factorization of M. The number of iterations grows as √κ, κ the condition number of M⁻¹A.
Between two load steps of a web, whose tensions differ by a factor of two or three, a solution to 1 % takes two or three
iterations. An iteration costs a sixth (fronts), a ninth (rslab) or a thirtieth (SuperLU) of a factorization at 118 803
unknowns. If a few iterations are not enough, a factorization of A itself costs less. If A or M shows a direction
without stiffness, only a factorization can tell more. Both cases end the iteration.

May change: the rule by which the iteration ends early; it changes the cost of `statics.newton`, and how sharp the
bounds of `statics.duality_bound` are. Must stay: arguments of `solve` and fields of `Found`, which both read, and that
A and M are symmetric. Tests: ``tests/statics/test_reused_factorization.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Found(NamedTuple):
    """Solutions of A y = b, shape (n,) or (n, k).

    ``left`` is √(rᵀM⁻¹r) of the residual r over the same norm of b, the largest of all k. ``enough`` is True if it is
    within the tolerance.
    """

    y: np.ndarray
    left: float
    enough: bool
    iterations: int


def solve(times, precondition, b, tolerance, limit):
    """Solve A y = b for one or several right-hand sides, to a tolerance if the iteration reaches it.

    Parameters
    ----------
    times, precondition : callable
        A y and M⁻¹r, of arrays of the shape of b; A and M symmetric.
    b : ndarray, shape (n,) or (n, k)
        Right-hand sides.
    tolerance : float
        Largest ``left`` that is enough.
    limit : int
        Largest number of iterations. The iteration ends earlier if its rate of convergence shows that they are too few.

    Returns
    -------
    Found
    """
    y, r, left = np.zeros_like(b), b.copy(), 1.0
    z = precondition(r)
    size = first = _dot(r, z)
    if not (np.isfinite(first).all() and (first >= 0.0).all()):
        return Found(y, np.inf, False, 0)
    p, k = z.copy(), 0
    while k < limit and left > tolerance:
        q = times(p)
        stiffness = _dot(p, q)
        if not (stiffness[size > 0.0] > 0.0).all():  # or not a number
            return Found(y, left, False, k)
        step, k = _over(size, stiffness), k + 1
        y += step * p
        r -= step * q
        z = precondition(r)
        last, size = size, _dot(r, z)
        left = float(np.sqrt(np.abs(_over(size, first)).max(initial=0.0)))
        if not (size >= 0.0).all() or (k > 1 and left ** (limit / k) > tolerance):
            break
        p = z + _over(size, last) * p
    return Found(y, left, left <= tolerance, k)


def _dot(a, b):
    """Products of columns."""
    return (a * b).sum(axis=0)


def _over(a, b):
    """Ratio of two numbers; 0 if the first is 0."""
    return np.where(b > 0.0, a / np.where(b > 0.0, b, 1.0), 0.0)
