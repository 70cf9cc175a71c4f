"""Kernels of the segments of threads, which terms of threads share: vector, stiffness across, and energy.

Data of a cell have ``width`` columns of a record, 1/A, and four columns for each segment s from ``width + 1 + 4 s`` on:
its vector in the web's position and the length of it [m].

May change: how a kernel computes its numbers. Must stay: the columns above, which `net.threads` writes and `thread`,
`thread_friction`, `thread_slips` and `winch_power` read: a change of the layout goes to all of them; the six numbers
that a segment kernel returns; arguments of `energy_kernel`, which `winding` calls too; `add_across`, which `thread` and
`thread_friction` import; `segment_kernel`, which `thread`, `thread_friction` and other files import. Tests:
``tests/effects/test_thread.py``.
"""

from __future__ import annotations

import functools
import math

from ..compiled.rows import record_at
from ..kernels import ENERGY, kernel


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


@kernel(forceinline=True)
def add_across(blocks, c, s, p, turn):
    """Add the stiffness of segment s of cell c across its unit vector p, T/l = ``turn``, to the block of the cell."""
    for k in range(3):
        for m in range(3):
            across = turn * ((1.0 if k == m else 0.0) - p[k] * p[m])
            first, second = 3 * s + k, 3 * s + m
            blocks[c, first, second] += across
            blocks[c, first + 3, second + 3] += across
            blocks[c, first, second + 3] -= across
            blocks[c, first + 3, second] -= across


def energy_kernel(law, record, strain_of):
    """The energy kernel of threads of one strain, which ``strain_of(x, cells, data, c)`` gives."""
    energy_density = law.energy_density

    @kernel(ENERGY)
    def energy(t, x, cells, data, out):
        for c in range(cells.shape[0]):
            line = record_at(record, data, c, 0)
            out[c] = line.natural_length * energy_density(strain_of(x, cells, data, c), line)

    return energy
