"""Sequential quadratic programming with a trust region, for few variables whose functions are expensive.

The step p at a point solves

    min g·p + p·B p/2    with    r + J p ≥ 0,    lower ≤ x + p ≤ upper,    |p| ≤ Δ,

with the matrix B of BFGS. This is a least-distance problem, which non-negative least squares solves exactly (Lawson and
Hanson, Solving Least Squares Problems, 1974, chapter 23). Where it has no solution, violated constraints are relaxed.

A step is taken if it lowers f + μ Σ max(−r, 0), with μ twice the largest multiplier. Constraints may be in groups, of
which the largest violation of each counts, and not all of which are known at each point, but the most violated one.
SLSQP of scipy takes μ close to the multiplier, for which this function is nearly flat between an infeasible point and
the optimum, and steps become a tenth as long again and again: one variable and one active constraint take 100
evaluations in place of 5. A step is taken as well if the next one is at most half as long: near the optimum differences
of f are those of rounding, and steps still lead to it.

May change: private functions; `FIRST`, `LONGEST`, `SHORTEST`, `ROUNDS`, `RELAXED` and `CURVED`, by which it takes more
or fewer evaluations. Must stay: arguments and results of `minimise`, which `smooth` calls; that it takes no random
numbers, so that a sizing that continues finds its runs again. Tests: ``tests/sizing/test_size.py``.
"""

from __future__ import annotations

import math

import numpy as np

FIRST, LONGEST, SHORTEST = 0.25, 1.0, 1e-9
"""First, largest and smallest radius of the trust region."""
ROUNDS = 60
"""Largest number of steps."""
RELAXED = (0.0, 0.5, 0.9, 1.0)
"""Share of the violation of constraints that stays, tried in turn."""
CURVED = 0.2
"""Least curvature of the Lagrangian along a step, over that of B, before Powell's damping."""


def minimise(functions, x, lower, upper, tolerance):
    """Least point of a smooth function within bounds and constraints.

    Parameters
    ----------
    functions : callable
        Returns at x (f, its gradient (n,), constraints r ≥ 0 (m,), their gradients (m, n)), and the number of the group
        of each constraint (m,) where they are in groups. Later points may have further constraints behind these. A
        constraint that is not known at a point has a gradient of 0 there.
    x, lower, upper : ndarray, shape (n,)
        Start and bounds.
    tolerance : float
        Length of the last step, which is taken without a look at the functions behind it.

    Returns
    -------
    ndarray, shape (n,)
    """
    x, radius, penalty = np.clip(x, lower, upper), FIRST, 0.0
    at = _grouped(functions(x))
    curvature = np.eye(len(x)) * max(np.linalg.norm(at[1]), 1e-3)
    step, multipliers = _step(curvature, at, lower - x, upper - x, radius)
    for _ in range(ROUNDS):
        if np.abs(step).max() <= tolerance:
            return np.clip(x + step, lower, upper)
        if radius < SHORTEST:
            break
        moved = np.clip(x + step, lower, upper)
        after = _grouped(functions(moved))
        penalty = max(penalty, 2.0 * np.bincount(at[4], multipliers).max(initial=0.0))
        gain, expected = _merit(at, penalty) - _merit(after, penalty), _expected(curvature, at, step, penalty)
        curvature = _updated(curvature, step, at, after, multipliers)
        following, others = _step(curvature, after, lower - moved, upper - moved, radius)
        nearer = math.isfinite(after[0]) and np.abs(following).max() <= 0.5 * np.abs(step).max()
        if gain > 1e-4 * expected or nearer:
            if gain > 0.75 * expected and np.abs(step).max() > 0.9 * radius:
                radius = min(2.0 * radius, LONGEST)
                following, others = _step(curvature, after, lower - moved, upper - moved, radius)
            x, at, step, multipliers = moved, after, following, others
            continue
        radius = 0.25 * np.abs(step).max()
        step, multipliers = _step(curvature, at, lower - x, upper - x, radius)
    return x


def _grouped(at):
    """Functions at a point with the group of each constraint, by default one for each."""
    return at if len(at) == 5 else (*at, np.arange(len(at[2])))


def _violation(r, groups):
    """Sum of the largest violations of each group."""
    worst = np.zeros(groups.max(initial=-1) + 1)
    np.maximum.at(worst, groups, -r)
    return worst.sum()


def _merit(at, penalty):
    return at[0] + penalty * _violation(at[2], at[4])


def _expected(curvature, at, step, penalty):
    """Gain of a step that the quadratic model expects."""
    _, df, r, dr, groups = at
    gain = _violation(r, groups) - _violation(r + dr @ step, groups)
    return penalty * gain - df @ step - 0.5 * step @ curvature @ step


def _step(curvature, at, lower, upper, radius):
    """(Step, multipliers of the constraints) of the quadratic problem."""
    _, df, r, dr, _ = at
    n, factor = len(df), np.linalg.cholesky(curvature)
    rows = np.vstack([dr, np.eye(n), -np.eye(n)])
    for share in RELAXED:
        limits = np.concatenate(
            [-r + share * np.minimum(r, 0.0), np.maximum(lower, -radius), -np.minimum(upper, radius)]
        )
        solved = _least_distance(factor, df, rows, limits)
        if solved is not None:
            step, multipliers = solved
            return step, multipliers[: len(r)]
    return np.zeros(n), np.zeros(len(r))


def _least_distance(factor, df, rows, limits):
    """(Step, multipliers) of the least g·p + p·B p/2 with rows · p ≥ limits, None where after is no such p."""
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    begin = solve_triangular(factor, df, lower=True)
    across = solve_triangular(factor, rows.T, lower=True).T
    beyond = limits + across @ begin
    scale = np.linalg.norm(np.column_stack([across, beyond]), axis=1)
    scale[scale == 0.0] = 1.0
    matrix = np.vstack([across.T, beyond]) / scale
    wanted = np.zeros(len(matrix))
    wanted[-1] = 1.0
    weights, _ = nnls(matrix, wanted, maxiter=100 * len(limits))
    rest = 1.0 - matrix[-1] @ weights
    if rest <= 1e-12:
        return None
    distance = matrix[:-1] @ weights / rest
    return solve_triangular(factor.T, distance - begin, lower=False), weights / scale / rest


def _updated(curvature, step, at, after, multipliers):
    """B of BFGS after a step, with Powell's damping; as it is where the functions have no values."""
    if not math.isfinite(after[0]):
        return curvature
    before, behind = at[3], after[3][: len(multipliers)]
    both = before.any(axis=1) & behind.any(axis=1)  # the others are not known at one of the points
    change = after[1] - at[1] - (behind - before)[both].T @ multipliers[both]
    along = curvature @ step
    old, new = step @ along, step @ change
    if new < CURVED * old:
        change = along + (1.0 - CURVED) * old / (old - new) * (change - along)
        new = CURVED * old
    changed = curvature - np.outer(along, along) / old + np.outer(change, change) / new
    return changed if np.isfinite(changed).all() and np.linalg.cond(changed) < 1e14 else curvature
