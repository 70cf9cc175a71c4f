"""Moments on bodies in steadily rotating axes: by forces that are linear in position, and by Coriolis forces.

Let S = ∫ r⊗r dm of a body, which is ½ tr(J) 1 − J with its tensor of inertia J. The forces of
`refweb.effects.turning_axes` have the moments about its centre

    ∫ r × G r dm = ε : (S G),        −2 ∫ r × (Ω × (ω × r)) dm = 2 ω × S Ω,

The first moment, which includes gravity gradients, has the potential −½ tr(S G). The second does no work. ω is the
angular velocity in these axes, see `refweb.net.rotation`. A rotation δθ changes S by δθ × S − S × δθ.

May change: how the kernels are written. Must stay: the fields of `BODY`, which `force_terms` writes and kernels read by
name, by `body_at`; both moments, which follow from the forces of `turning_axes`: those, these and `turning_flows`
change together; the Coriolis moment, which `system.resting_bodies` has once more, by angular velocities: both change
together; `force_terms`, which `turning_axes` calls. Tests: ``tests/test_contract.py``, ``tests/effects/test_orbit.py``.
"""

from __future__ import annotations

import math

import numpy as np

from ..compiled.rows import matrix_of, record_at
from ..kernels import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from ..net.rotation import RigidRotations, matrix_at, times, to_quaternion
from .base import ForceTerm, Tangent, Timing, VelocityForce
from .vectors import cross

_matrix = float, (3, 3)
BODY = np.dtype(
    [
        ("pull", *_matrix),
        ("speed", float, (3,)),
        ("spread", *_matrix),
        ("mobility", *_matrix),
        ("largest", float),
    ]
)
"""Data of a body: G, Ω, S and W at the start, and the largest eigenvalue of S times that of W [kg m²]."""


@kernel(forceinline=True)
def body_at(data, c):
    """The `BODY` of cell c."""
    return record_at(BODY, data, c, 0)


@kernel(forceinline=True)
def rows_of(m):
    """A matrix, by rows."""
    return (m[0, 0], m[0, 1], m[0, 2]), (m[1, 0], m[1, 1], m[1, 2]), (m[2, 0], m[2, 1], m[2, 2])


@kernel()
def turned(m, s):
    """M S Mᵀ of a symmetric matrix S, all row by row."""
    p, q, r = times(m, s[0]), times(m, s[1]), times(m, s[2])
    return times(m, (p[0], q[0], r[0])), times(m, (p[1], q[1], r[1])), times(m, (p[2], q[2], r[2]))


@kernel()
def turning_of(s, g):
    """ε : (S G) of a matrix S and a symmetric matrix G, row by row."""
    return (
        s[1][0] * g[0][2] + s[1][1] * g[1][2] + s[1][2] * g[2][2]
        - s[2][0] * g[0][1] - s[2][1] * g[1][1] - s[2][2] * g[2][1],
        s[2][0] * g[0][0] + s[2][1] * g[1][0] + s[2][2] * g[2][0]
        - s[0][0] * g[0][2] - s[0][1] * g[1][2] - s[0][2] * g[2][2],
        s[0][0] * g[0][1] + s[0][1] * g[1][1] + s[0][2] * g[2][1]
        - s[1][0] * g[0][0] - s[1][1] * g[1][0] - s[1][2] * g[2][0],
    )  # fmt: skip


@kernel()
def changed(e, s):
    """e × S − S × e, the symmetric change of a symmetric matrix S by a small rotation e, row by row."""
    a, b, c = cross(e, s[0]), cross(e, s[1]), cross(e, s[2])  # columns of e × S
    return (
        (a[0] + a[0], b[0] + a[1], c[0] + a[2]),
        (a[1] + b[0], b[1] + b[1], c[1] + b[2]),
        (a[2] + c[0], b[2] + c[1], c[2] + c[2]),
    )


@kernel()
def unit(j):
    return (1.0 if j == 0 else 0.0), (1.0 if j == 1 else 0.0), (1.0 if j == 2 else 0.0)


@kernel(FORCE)
def force(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        body = body_at(data, c)
        s = turned(matrix_at(x, cells[c, 0], cells[c, 1]), rows_of(body.spread))
        moment = turning_of(s, rows_of(body.pull))
        for k in range(3):
            f[cells[c, 0], k] += moment[k]


@kernel(ENERGY)
def energy(t, x, cells, data, out):
    for c in range(cells.shape[0]):
        body = body_at(data, c)
        start = rows_of(body.spread)
        s, g = turned(matrix_at(x, cells[c, 0], cells[c, 1]), start), rows_of(body.pull)
        out[c] = 0.0
        for i in range(3):
            for j in range(3):
                out[c] -= 0.5 * (s[i][j] - start[i][j]) * g[i][j]


@kernel(STIFFNESS)
def stiffness(t, x, v, blocks, cells, data, definite):
    blocks[:] = 0.0
    for c in range(cells.shape[0] if not definite else 0):
        body = body_at(data, c)
        s, g = turned(matrix_at(x, cells[c, 0], cells[c, 1]), rows_of(body.spread)), rows_of(body.pull)
        for j in range(3):
            change = turning_of(changed(unit(j), s), g)
            for i in range(3):
                blocks[c, i, j] = -change[i]
        to_quaternion(blocks[c], x, cells[c, 0], cells[c, 1], 0)


@kernel(BOUND)
def bound(reach, speed, x, mass, rates, cells, data):
    for c in range(cells.shape[0]):
        size, body = 0.0, body_at(data, c)
        for i in range(3):
            for j in range(3):
                size += body.pull[i, j] ** 2
        rates[cells[c, 0]] += 4.0 * body.largest * math.sqrt(size)


@kernel()
def whirl(x, v, data, c, cells):
    """(ω, S Ω, W) along the axes of the scene."""
    m, a, body = matrix_at(x, cells[c, 0], cells[c, 1]), cells[c, 0], body_at(data, c)
    w, o = turned(m, rows_of(body.mobility)), (body.speed[0], body.speed[1], body.speed[2])
    s = times(turned(m, rows_of(body.spread)), o)
    return times(w, (v[a, 0], v[a, 1], v[a, 2])), s, w


@kernel(FORCE)
def coriolis(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        omega, s, _ = whirl(x, v, data, c, cells)
        moment = cross(omega, s)
        for k in range(3):
            f[cells[c, 0], k] += 2.0 * moment[k]


@kernel(STIFFNESS)
def coriolis_stiffness(t, x, v, blocks, cells, data, definite):
    blocks[:] = 0.0
    for c in range(cells.shape[0] if not definite else 0):
        (omega, own_velocity, w), a, body = whirl(x, v, data, c, cells), cells[c, 0], body_at(data, c)
        s = turned(matrix_at(x, a, cells[c, 1]), rows_of(body.spread))
        u, o = (v[a, 0], v[a, 1], v[a, 2]), (body.speed[0], body.speed[1], body.speed[2])
        for j in range(3):
            e = unit(j)
            first, less = cross(e, omega), times(w, cross(e, u))
            first = cross((first[0] - less[0], first[1] - less[1], first[2] - less[2]), own_velocity)
            last = cross(omega, times(changed(e, s), o))
            for i in range(3):
                blocks[c, i, j] = -2.0 * (first[i] + last[i])
        to_quaternion(blocks[c], x, a, cells[c, 1], 0)


@kernel(STIFFNESS)
def damping(t, x, v, blocks, cells, data, definite):
    blocks[:] = 0.0
    for c in range(cells.shape[0] if not definite else 0):
        _, s, w = whirl(x, v, data, c, cells)
        for j in range(3):
            moment = cross((w[0][j], w[1][j], w[2][j]), s)
            for i in range(3):
                blocks[c, i, j] = -2.0 * moment[i]


@kernel(BOUND)
def damping_bound(reach, speed, x, mass, rates, cells, data):
    for c in range(cells.shape[0]):
        body = body_at(data, c)
        size = body.speed[0] ** 2 + body.speed[1] ** 2 + body.speed[2] ** 2
        rates[cells[c, 0]] += 2.0 * math.sqrt(3.0 * size) * body.largest


def force_terms(net, speed, pull, arguments):
    """The terms of all bodies that rotate in space, see `refweb.effects.turning_axes.force_terms`."""
    turns = RigidRotations.of(net)
    tensors = [body.axes.T @ body.inertia @ body.axes for body in net.bodies if body.turn is not None]
    spreads = [0.5 * np.trace(tensor) * np.eye(3) - tensor for tensor in tensors]
    data = np.zeros(len(spreads), BODY)
    data["pull"], data["speed"], data["spread"], data["mobility"] = pull, speed, spreads, turns.mobility
    data["largest"] = [
        np.linalg.eigvalsh(spread)[-1] * np.linalg.eigvalsh(mobility)[-1]
        for spread, mobility in zip(spreads, turns.mobility, strict=True)
    ]
    cells = np.ascontiguousarray(turns.rows[:, 1:], dtype=np.int32)
    shared: dict = dict(cells=cells, data=matrix_of(data), **arguments)
    still = ForceTerm(force=force, energy=energy, tangent=Tangent(stiffness, bound, symmetric=False), **shared)
    moving = ForceTerm(
        force=coriolis,
        tangent=Tangent(coriolis_stiffness, symmetric=False),
        velocity=VelocityForce(damping, damping_bound),
        timing=Timing(at_rest=False),
        **shared,
    )
    return [still, moving]
