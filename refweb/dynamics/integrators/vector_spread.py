"""Spread of rows of vectors: no two differ by more.

May change: how the bound is computed. Must stay: it may be too large and never too small, since `ccd`, `neighbour_list`
and `explicit_loop` bound motion by it; its arguments; `spread_of`, which `ccd`, `explicit_loop` and other files import.
Tests: ``tests/dynamics/integrators/test_nearby.py``.
"""

from __future__ import annotations

import math

from ...kernels import kernel


@kernel(leaf=True, fastmath={"contract", "nnan", "nsz"})
def spread_of(rows):
    """Root of the sum of the squares of the ranges of three columns: no two rows differ by more."""
    a0 = a1 = a2 = -math.inf
    b0 = b1 = b2 = math.inf
    for r in range(rows.shape[0]):
        x, y, z = rows[r, 0], rows[r, 1], rows[r, 2]
        a0, b0 = x if x > a0 else a0, x if x < b0 else b0
        a1, b1 = y if y > a1 else a1, y if y < b1 else b1
        a2, b2 = z if z > a2 else a2, z if z < b2 else b2
    return math.sqrt((a0 - b0) ** 2 + (a1 - b1) ** 2 + (a2 - b2) ** 2)
