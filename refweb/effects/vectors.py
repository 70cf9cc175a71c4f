"""Products of vectors of three numbers, as compiled kernels."""

from __future__ import annotations

from ..kernels import kernel


@kernel()
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel()
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
