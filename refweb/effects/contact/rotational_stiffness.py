"""Tangents of contact by rotation, as compiled kernels.

Forces at a contact depend on the relative position of body and line. If the body, the line and all velocities rotate by
δθ, the forces rotate as well. Let K_b = −∂f/∂x_b and C_b = −∂f/∂v_b be the blocks of the nodes b, with arms p_b from
the centre and velocities v_b of all rows. Then the stiffness against a rotation of the body alone is

    K_θ δθ = −Σ K_b (δθ × p_b) − Σ C_b (δθ × v_b) − δθ × f.

The rows of the moment on the body follow from −Σ p_a × f_a with the forces f_a on nodes. A change of the quaternion
rotates the body by δθ = 2 (q₀ δq − δq₀ q + q × δq)/|q|². All but the last is along the axes of the body.

May change: how the sums are written. Must stay: blocks with nodes, body and rotation in this order, along the axes of
the body, which `penalty` and `friction` turn to space afterwards; what the functions add, as tangents of both rely on
it; all names that `penalty` and `friction` import. Tests: ``tests/effects/test_tumbling.py``,
``tests/test_contract.py``.
"""

from __future__ import annotations

from ...kernels import kernel
from ...net.rotation import times
from .nearest_point import share
from .pair import AWAY


@kernel()
def add_push(pushes, size, along, xi, nodes, functions):
    """Add the forces on the nodes of an element, ``pushes (nodes, 3)``, of one at a place."""
    for a in range(nodes):
        value, _ = share(a, nodes, functions, xi)
        for k in range(3):
            pushes[a, k] += value * size * along[k]


@kernel()
def set_arms(x, cells, data, c, nodes, axes, arms):
    """Write vectors from the centre of the body to the nodes of a cell, along its axes."""
    b = cells[c, nodes]
    for a in range(nodes):
        i, at = cells[c, a], AWAY + 3 * a
        p = data[c, at] + x[i, 0] - x[b, 0], data[c, at + 1] + x[i, 1] - x[b, 1], data[c, at + 2] + x[i, 2] - x[b, 2]
        arms[a, 0], arms[a, 1], arms[a, 2] = times(axes, p)


@kernel()
def across(block, row, column, p, sign, at):
    """Add sign × the product of part (row, column) of a block and the matrix of δθ × p to its columns from ``at``."""
    for i in range(row, row + 3):
        k0, k1, k2 = block[i, column], block[i, column + 1], block[i, column + 2]
        block[i, at] += sign * (k2 * p[1] - k1 * p[2])
        block[i, at + 1] += sign * (k0 * p[2] - k2 * p[0])
        block[i, at + 2] += sign * (k1 * p[0] - k0 * p[1])


@kernel()
def add_cross(block, row, at, p, sign):
    """Add sign × the matrix of δθ × p to a part of a block."""
    block[row, at + 1] += sign * p[2]
    block[row, at + 2] -= sign * p[1]
    block[row + 1, at] -= sign * p[2]
    block[row + 1, at + 2] += sign * p[0]
    block[row + 2, at] += sign * p[1]
    block[row + 2, at + 1] -= sign * p[0]


@kernel()
def add_moments(block, pushes, arms, nodes):
    """Write the rows of the moment on the body, behind those of nodes and body."""
    r = 3 * (nodes + 1)
    for a in range(nodes):
        p = arms[a]
        for j in range(3 * (nodes + 1)):
            k0, k1, k2 = block[3 * a, j], block[3 * a + 1, j], block[3 * a + 2, j]
            block[r, j] -= p[1] * k2 - p[2] * k1
            block[r + 1, j] -= p[2] * k0 - p[0] * k2
            block[r + 2, j] -= p[0] * k1 - p[1] * k0
        add_cross(block, r, 3 * a, pushes[a], 1.0)
        add_cross(block, r, 3 * nodes, pushes[a], -1.0)


@kernel()
def add_rotation(block, pushes, arms, nodes):
    """Write the columns of a rotation of the body, but for what velocities add, behind those of nodes and body."""
    at = 3 * (nodes + 1)
    for a in range(nodes):
        for row in range(0, at + 3, 3):
            across(block, row, 3 * a, arms[a], -1.0, at)
        push, p = pushes[a], arms[a]
        moment = p[1] * push[2] - p[2] * push[1], p[2] * push[0] - p[0] * push[2], p[0] * push[1] - p[1] * push[0]
        add_cross(block, 3 * a, at, push, -1.0)
        add_cross(block, 3 * nodes, at, push, 1.0)
        add_cross(block, at, at, moment, 1.0)


@kernel()
def add_velocities(block, damping, v, cells, c, nodes, axes):
    """Add what velocities add to the columns of a rotation, by the block of −∂f/∂v."""
    at = 3 * (nodes + 1)
    for b in range(nodes + 2):
        r = cells[c, b]
        omega = times(axes, (v[r, 0], v[r, 1], v[r, 2]))
        for i in range(at + 3):
            k0, k1, k2 = damping[i, 3 * b], damping[i, 3 * b + 1], damping[i, 3 * b + 2]
            block[i, at] -= k2 * omega[1] - k1 * omega[2]
            block[i, at + 1] -= k0 * omega[2] - k2 * omega[0]
            block[i, at + 2] -= k1 * omega[0] - k0 * omega[1]
