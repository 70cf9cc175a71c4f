"""The kernel of a segment of a thread, which all its terms read."""

from __future__ import annotations

import functools
import math

from ..kernels import kernel


@functools.cache
def segment_kernel(width):
    """The kernel of a segment where ``width`` columns stand ahead of 1/A."""

    @kernel(forceinline=True)
    def segment(x, cells, data, c, s):
        """(Vector, 1/length or 0, length, length less that in the web's position) of segment s of cell c."""
        i, j, k = cells[c, s], cells[c, s + 1], width + 1 + 4 * s
        r0, r1, r2, distance = data[c, k], data[c, k + 1], data[c, k + 2], data[c, k + 3]
        u0, u1, u2 = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
        p0, p1, p2 = r0 + u0, r1 + u1, r2 + u2
        length = math.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
        square = (2.0 * r0 + u0) * u0 + (2.0 * r1 + u1) * u1 + (2.0 * r2 + u2) * u2
        both = length + distance
        return p0, p1, p2, 1.0 / length if length > 0.0 else 0.0, length, square / both if both > 0.0 else 0.0

    return segment
