"""Common parts of kernels over line elements: gradients, strain, and forces along the line.

``gradients`` are dN/dξ of the reference element, by quadrature point and node, as one tuple of numbers. ``data`` of a
kernel over lines is `refweb.net.laws.line_data.LineData.matrix`: all terms of the compiled loop take matrices. `LINE`
gives its first columns their names, and `refweb.net.net.Net.law_record` those that the laws of a net read.

May change: nothing without a change of the last digits of all results, since kernels of all lines inline these
functions and their order of sums. Must stay: arguments, and what each returns; all names that `viscous`, `plastic` and
other files import. Tests: ``tests/test_contract.py``, ``tests/net/test_elements.py``.
"""

from __future__ import annotations

import math

import numpy as np

from ..compiled.rows import record_at
from ..kernels import kernel
from ..net.laws.law import LINE


@kernel(forceinline=True)
def line_at(data, c):
    """The `LINE` of cell c."""
    return record_at(LINE, data, c, 0)


@kernel(forceinline=True)
def gradient(v, cells, c, q, nodes, gradients):
    """dv/dξ at quadrature point q of cell c."""
    v0 = v1 = v2 = 0.0
    for a in range(nodes):
        row, d = np.uint64(cells[c, a]), gradients[q * nodes + a]  # unsigned: no row counts from the end
        v0 += d * v[row, 0]
        v1 += d * v[row, 1]
        v2 += d * v[row, 2]
    return v0, v1, v2


@kernel(forceinline=True)
def direction(x, cells, c, end):
    """(dx/dξ over its length |d|, 1/|d|), or zeros, of the cell c.

    ``end.along`` is d in the web's position, and ``end.slopes`` are ∂d/∂x of each node.
    """
    d0, d1, d2 = end.along[0], end.along[1], end.along[2]
    for b in range(end.slopes.size):
        row, slope = cells[c, b], end.slopes[b]
        d0 += slope * x[row, 0]
        d1 += slope * x[row, 1]
        d2 += slope * x[row, 2]
    length = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    inverse = 1.0 / length if length > 0.0 else 0.0
    return (d0 * inverse, d1 * inverse, d2 * inverse), inverse


@kernel(forceinline=True)
def strain(x, cells, data, c, q, nodes, gradients):
    """(dx/dξ, 1/|dx/dξ| or 0, ε) at quadrature point q of cell c."""
    return strain_of(line_at(data, c), *gradient(x, cells, c, q, nodes, gradients))


@kernel(forceinline=True)
def strain_of(line, u0, u1, u2):
    """Strain as `strain` returns it, from the numbers of a line and du/dξ."""
    natural, r0, r1, r2, r = line.natural_length, line.reference[0], line.reference[1], line.reference[2], line.distance
    p0, p1, p2 = r0 + u0, r1 + u1, r2 + u2
    length = math.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
    square = (2.0 * r0 + u0) * u0 + (2.0 * r1 + u1) * u1 + (2.0 * r2 + u2) * u2 + (r - natural) * (r + natural)
    inverse = 1.0 / length if length > 0.0 else 0.0
    return p0, p1, p2, inverse, square / (natural * (length + natural))


@kernel(forceinline=True)
def add_stiffness(blocks, c, q, nodes, gradients, along, across, p):
    """Add the stiffness along the direction p and ``across`` it, at quadrature point q, to the block of cell c."""
    for a in range(nodes):
        for b in range(nodes):
            d = gradients[q * nodes + a] * gradients[q * nodes + b]
            for i in range(3):
                for j in range(3):
                    blocks[c, 3 * a + i, 3 * b + j] += d * (along - across) * p[i] * p[j]
                blocks[c, 3 * a + i, 3 * b + i] += d * across


@kernel(forceinline=True)
def add_row_sums(rates, cells, c, q, nodes, gradients, weight, axial):
    """Add the row sums of |K| of a stiffness EA/L ``axial`` [N/m] at quadrature point q to those of nodes of cell c."""
    total = 0.0
    for a in range(nodes):
        total += abs(gradients[q * nodes + a])
    for a in range(nodes):
        rates[np.uint64(cells[c, a])] += weight * abs(gradients[q * nodes + a]) * total * axial


@kernel(forceinline=True)
def internal_number(x, row, n):
    """Number n of an element whose internal variables begin at a row, see `refweb.effects.base.with_internal`."""
    return x[row + n // 3, n % 3]


@kernel(forceinline=True)
def pull_together(f, cells, c, q, nodes, gradients, scale, p0, p1, p2):
    """Add the forces −``scale`` dN/dξ dx/dξ of a tension at quadrature point q to the nodes of cell c."""
    for a in range(nodes):
        row, d = np.uint64(cells[c, a]), scale * gradients[q * nodes + a]
        f[row, 0] -= d * p0
        f[row, 1] -= d * p1
        f[row, 2] -= d * p2
