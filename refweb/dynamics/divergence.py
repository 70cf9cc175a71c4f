"""Exponential growth of the difference of two runs of one scene: a sign of chaos without further runs.

Errors of time steps grow with a low power of time. In a chaotic motion any difference grows by the same factor in equal
times, until no digit is left. The run and its step-refinement run are two such motions.

May change: constants; they decide from which growth on results have no ±. Must stay: rows are those of
`Watch.compared`, time first and the balance of energy last; fields of `Divergence`, which `twin_error` and `gradients`
read; `divergence`, which `gradients` and `twin_error` import; `lost_before`, which `gradients` imports. Tests:
``tests/results/test_error_budget.py``, ``tests/dynamics/test_dynamic_gradients.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

WINDOWS, ROWS = 16, 3
"""Number of parts of the time, and least number of rows in each."""
IN_TURN, FACTOR = 5, 2.5
"""Number of successive parts in each of which differences must grow by at least this factor.

After a contact in a smooth motion differences grow with the square of time: by 9, 2.8, 2.0 from part to part, which is
not enough for so many successive parts."""
LOST = 0.1
"""Difference over the size of the motion at which no digit is left."""
SEEN = 1e-3
"""Least difference over the size of the motion that matters."""


class Divergence(NamedTuple):
    """Growth of a difference.

    Attributes
    ----------
    growth : float
        Lyapunov exponent [1/s].
    lost : float
        Time at which no digit is left [s], infinite if there is none.
    """

    growth: float
    lost: float


def divergence(rows, refined):
    """Find exponential growth of the differences of two runs.

    Parameters
    ----------
    rows, refined : ndarray, shape (rows, columns)
        Time [s], observables and a balance, see `refweb.dynamics.history.Watch.compared`.

    Returns
    -------
    Divergence or None
        None if differences do not grow exponentially, or if there are too few rows.
    """
    count = min(len(rows), len(refined))
    if count < WINDOWS * ROWS:
        return None
    same = rows[:count, 0] == refined[:count, 0]
    times, values = rows[:count, 0][same], rows[:count, 1:-1][same]
    size = np.abs(values).max(axis=0, initial=0.0)
    if not (size > 0.0).any() or not times[-1] > 0.0:
        return None
    apart = np.abs(values - refined[:count, 1:-1][same])[:, size > 0.0] / size[size > 0.0]
    means = _means(times, apart)
    ratios = means[1:] / np.maximum(means[:-1], 1e-300)
    grows = ratios >= FACTOR
    for last in range(len(ratios) - 1, IN_TURN - 2, -1):
        first = last + 1 - IN_TURN
        if grows[first : last + 1].all() and means[first] > 0.0 and means[last + 1] >= SEEN:
            rate = np.log(means[last + 1] / means[first]) / (IN_TURN * times[-1] / WINDOWS)
            behind = np.flatnonzero(means >= LOST)
            return Divergence(float(rate), float(times[-1] * behind[0] / WINDOWS) if len(behind) else np.inf)
    return None


def _means(times, apart):
    """Root mean squares of differences in each part of the time, 0 in one without rows."""
    part = np.minimum((times / times[-1] * WINDOWS).astype(int), WINDOWS - 1)
    return np.array([np.sqrt(np.mean(apart[part == k] ** 2)) if (part == k).any() else 0.0 for k in range(WINDOWS)])


def lost_before(times, values, refined, end):
    """Time from which on two runs have no digit of a quantity in common, up to a time ``end`` [s].

    Parameters
    ----------
    times, values, refined : ndarray, shape (rows,)
        Times of rows [s], and the quantity in both runs.
    end : float
        Time of a result [s].

    Returns
    -------
    float
        Infinite if they have one at the end, or if there are too few rows.
    """
    size = np.abs(values).max(initial=0.0)
    if len(times) < WINDOWS or not size > 0.0:
        return np.inf
    last = min(int(end / times[-1] * WINDOWS), WINDOWS - 1)
    common = np.flatnonzero(_means(times, values - refined)[: last + 1] < LOST * size)
    first = common[-1] + 1 if len(common) else 0
    return float(times[-1] * first / WINDOWS) if first <= last else np.inf
