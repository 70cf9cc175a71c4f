"""The force of drag at a node, quadratic in its velocity relative to the fluid, as compiled kernels.

Each node of an element has the drag of its share of the natural length. With the unit tangent t of the element there,
the velocity u = v − w of the node relative to the wind, u_t = (t·u) t and u_n = u − u_t,

    F = −c_n |u_n| u_n − c_t |u_t| u_t.

−∂F/∂u = c_n (|u_n| (I − t⊗t) + u_n⊗u_n/|u_n|) + 2 c_t |u_t| t⊗t is positive semidefinite, and F·u ≤ 0. A cell without
direction, such as a body or an element without length, has t = 0, and all of u counts as u_n.

May change: how the kernels are written. Must stay: the law in `drag_on` and `slope_of`, which `implicit_drag` solves in
explicit kicks; ``out`` with the power [W]; the two coefficients as the first numbers of `end_of`, which `table` sets to
0 at a break. Tests: ``tests/test_contract.py``, ``tests/effects/test_drag.py``.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from ...compiled.rows import record_at
from ...kernels import BOUND, FORCE, STIFFNESS, kernel
from ..line_kernels import direction
from ..vectors import dot


def end_of(nodes):
    """Dtype of the data of cells of so many nodes.

    c_n and c_t [kg/m]; w; d = dx/dξ of the web; the number of cells of one row, where they begin, else 0; natural
    length [m]; ∂d/∂x of each node, the first of which bears the force.
    """
    vectors = [("wind", float, (3,)), ("along", float, (3,))]
    numbers = [("group", float), ("length", float), ("slopes", float, (nodes,))]
    return np.dtype([("normal", float), ("tangential", float), *vectors, *numbers])


@kernel()
def split(t, u):
    """(t·u, u_n, |u_n|)."""
    along = dot(t, u)
    n = u[0] - along * t[0], u[1] - along * t[1], u[2] - along * t[2]
    return along, n, math.sqrt(dot(n, n))


@kernel()
def drag_on(t, u, normal, tangential):
    """F of coefficients c_n and c_t."""
    along, n, size = split(t, u)
    a, b = normal * size, tangential * abs(along) * along
    return -a * n[0] - b * t[0], -a * n[1] - b * t[1], -a * n[2] - b * t[2]


@kernel()
def slope_of(t, u, normal, tangential):
    """Rows of −∂F/∂u."""
    along, n, size = split(t, u)
    inverse = normal / size if size > 0.0 else 0.0
    a, b, c = normal * size, inverse, 2.0 * tangential * abs(along) - normal * size
    p, q, s = b * n[0] * n[1] + c * t[0] * t[1], b * n[0] * n[2] + c * t[0] * t[2], b * n[1] * n[2] + c * t[1] * t[2]
    first, second, third = b * n[0] * n[0] + c * t[0] * t[0], b * n[1] * n[1] + c * t[1] * t[1], b * n[2] * n[2]
    return (a + first, p, q), (p, a + second, s), (q, s, a + third + c * t[2] * t[2])


@kernel()
def relative(v, row, wind):
    """u of a row."""
    return v[row, 0] - wind[0], v[row, 1] - wind[1], v[row, 2] - wind[2]


@functools.cache
def kernels(nodes):
    """Force, stiffness, damping and bound of cells of so many nodes."""
    End = end_of(nodes)

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            row, end = cells[c, 0], record_at(End, data, c, 0)
            e, _ = direction(x, cells, c, end)
            force_ = drag_on(e, relative(v, row, end.wind), end.normal, end.tangential)
            power = 0.0
            for k in range(3):
                f[row, k] += force_[k]
                power += force_[k] * v[row, k]
            out[c, 0] = power

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        for c in range(cells.shape[0]):
            blocks[c] = 0.0
            end = record_at(End, data, c, 0)
            e, inverse = direction(x, cells, c, end)
            along, n, size = split(e, relative(v, cells[c, 0], end.wind))
            normal, tangential = end.normal, end.tangential
            for j in range(3 if not definite else 0):
                faster = n[j] * inverse  # ∂(t·u)/∂d
                for i in range(3):
                    turned = ((1.0 if i == j else 0.0) - e[i] * e[j]) * inverse  # ∂t/∂d
                    change = -normal * size * (faster * e[i] + along * turned)
                    if size > 0.0:
                        change -= normal * n[i] * along * faster / size
                    change += tangential * abs(along) * (2.0 * faster * e[i] + along * turned)
                    for b in range(nodes):
                        blocks[c, i, 3 * b + j] = end.slopes[b] * change

    @kernel(STIFFNESS)
    def damping(t, x, v, blocks, cells, data, definite):
        for c in range(cells.shape[0]):
            blocks[c] = 0.0
            end = record_at(End, data, c, 0)
            e, _ = direction(x, cells, c, end)
            slope = slope_of(e, relative(v, cells[c, 0], end.wind), end.normal, end.tangential)
            for i in range(3):
                for j in range(3):
                    blocks[c, i, j] = slope[i][j]

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        # Of the turn of a tangent, whose entries are below 2 (c_n + c_t) |u|²/|d| each; a taut line is as long as this.
        for c in range(cells.shape[0]):
            end = record_at(End, data, c, 0)
            w0, w1, w2 = end.wind[0], end.wind[1], end.wind[2]
            fastest = speed + math.sqrt(w0 * w0 + w1 * w1 + w2 * w2)
            coefficient = 4.0 * (end.normal + end.tangential) * fastest * fastest / end.length
            for b in range(nodes):
                rates[cells[c, 0]] += coefficient * abs(end.slopes[b])

    return force, stiffness, damping, bound
