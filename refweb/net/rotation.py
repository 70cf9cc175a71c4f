"""Rotations of rigid bodies: quaternions in rows of a net, free rotation, and motion of carried nodes.

The rotation of a body since the start is a unit quaternion q. Its vector part is the displacement of the first row of
rotation, and q₀ − 1 is the first component of the displacement of the second row: zero displacement is no rotation. The
velocity of the first row is L/I, the angular momentum L about the centre, along the axes of space, over a moment of
inertia I that replaces the mass. Torques change this velocity as forces change that of other rows, and free motion
keeps it constant. With W = I J⁻¹ of the tensor J at the start and the rotation matrix R of q,

    ω = R W Rᵀ (L/I),        q' = ½ ω q.

Free motion is computed by the Taylor series of these equations, along the axes of the body, to rounding. The
coefficients follow from a recurrence, since the equations are quadratic. The poles of the solution are at imaginary
times of at least π/2 over the largest |ω|, so that steps of `TURN` converge as 0.16ⁿ. The result is the exact flow of
the kinetic energy, symplectic and reversible in splittings of any order, as the closed form of van Zon and Schofield
[1]_, but without Jacobi functions and distinctions of cases.

A body may carry nodes of the web, see `refweb.effects.attach`: they move with the body, and forces on them act on the
body. A body on an axle of direction n has W = n⊗n, and I about the axle: moments across the axle do not turn it. If its
centre of mass is off the axle, a fixed row of the axle carries the row of the body as a node, and the kinetic energy
counts its part of I once. The second component of the second row of rotation is the angle about the axle.

May change: private functions, `TURN`, `TERMS` and `SMALL`, as long as the flow stays exact to rounding. Must stay: the
meaning of both rows of rotation (quaternion, q₀ − 1, angle about an axle), which `effects`, `system`,
`results.observables` and checkpoints read; names in ``apart``, keys of `dynamics.integrators.features`; the order of
sums, which decides the last digits of bodies that turn; all names that `system.attached_nodes`, `integrators.step` and
other files import; public names of `RigidRotations`, which other files use. Tests: ``tests/net/test_rotation.py``,
``tests/effects/test_tumbling.py``, ``tests/effects/test_axles.py``.

References
----------
.. [1] R. van Zon, J. Schofield, "Numerical implementation of the exact dynamics of free rigid bodies", J. Comput. Phys.
   225 (2007) 145–164, doi:10.1016/j.jcp.2006.11.019.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from ..kernels import Cube, IntegerMatrix, Matrix, Record, Vector, kernel

TURN = 0.25
"""Largest angle of rotation by one series [rad]; a larger rotation takes several series."""
TERMS = 24
"""Largest number of terms of a series; the next term is below 1e-19."""
SMALL = 1e-18
"""Size of a term that ends a series."""


@kernel()
def matrix_of(w, a, b, c):
    """Rows of the rotation matrix of a quaternion of any length."""
    s = 2.0 / (w * w + a * a + b * b + c * c)
    return (
        (1.0 - s * (b * b + c * c), s * (a * b - w * c), s * (a * c + w * b)),
        (s * (a * b + w * c), 1.0 - s * (a * a + c * c), s * (b * c - w * a)),
        (s * (a * c - w * b), s * (b * c + w * a), 1.0 - s * (a * a + b * b)),
    )


@kernel()
def matrix_at(x, spin, turn):
    """Rows of the rotation matrix of a body whose rotation is in two rows."""
    return matrix_of(1.0 + x[turn, 0], x[spin, 0], x[spin, 1], x[spin, 2])


@kernel()
def times(m, p):
    """Product of a matrix, given by rows, and a vector."""
    return (
        m[0][0] * p[0] + m[0][1] * p[1] + m[0][2] * p[2],
        m[1][0] * p[0] + m[1][1] * p[1] + m[1][2] * p[2],
        m[2][0] * p[0] + m[2][1] * p[1] + m[2][2] * p[2],
    )


@kernel()
def times_transposed(m, q):
    """Product of the transposed matrix, given by rows, and a vector."""
    return (
        m[0][0] * q[0] + m[1][0] * q[1] + m[2][0] * q[2],
        m[0][1] * q[0] + m[1][1] * q[1] + m[2][1] * q[2],
        m[0][2] * q[0] + m[1][2] * q[1] + m[2][2] * q[2],
    )


@kernel(leaf=True)
def quaternion_rate(w, a, b, c, omega):
    """½ ω q of a quaternion and an angular velocity along the axes of space."""
    p, q, r = 0.5 * omega[0], 0.5 * omega[1], 0.5 * omega[2]
    return -p * a - q * b - r * c, p * w + q * c - r * b, q * w + r * a - p * c, r * w + p * b - q * a


@kernel()
def to_quaternion(block, x, spin, turn, at):
    """Convert columns of a rotation to columns of its quaternion, two rows of three from ``at``, of all rows."""
    w, a, b, c = 1.0 + x[turn, 0], x[spin, 0], x[spin, 1], x[spin, 2]
    size = 2.0 / (w * w + a * a + b * b + c * c)
    for i in range(at + 3):
        k0, k1, k2 = block[i, at], block[i, at + 1], block[i, at + 2]
        block[i, at] = size * (w * k0 + k1 * c - k2 * b)
        block[i, at + 1] = size * (w * k1 + k2 * a - k0 * c)
        block[i, at + 2] = size * (w * k2 + k0 * b - k1 * a)
        block[i, at + 3] = -size * (k0 * a + k1 * b + k2 * c)


class RigidRotations(Record):
    """Bodies whose orientation counts.

    Attributes
    ----------
    rows : ndarray of int, shape (bodies, 3)
        Row of each body and its two rows of rotation.
    moment : ndarray, shape (bodies,)
        I [kg m²]; 0 for bodies that tables move.
    mobility : ndarray, shape (bodies, 3, 3)
        W, along the axes of space at the start.
    principal : ndarray, shape (bodies, 3, 3)
        Unit vectors of the principal axes, along the axes of space at the start.
    faster : ndarray, shape (bodies, 3)
        I over the moments of inertia about the principal axes; the least is 1.
    reach : ndarray, shape (bodies, 3)
        Bound of the distance of points of a body from each principal axis [m].
    before : ndarray, shape (bodies, 4)
        Memory for quaternions.
    terms_space : ndarray, shape (TERMS + 1, 10)
        Memory for the terms of a series: q, L/I and ω along the axes of the body.
    carried : ndarray of int, shape (carried, 2)
        Nodes that bodies carry, and the number of the body of each.
    arms : ndarray, shape (carried, 3)
        Vectors from the centre of mass to carried nodes at the start [m].
    ahead : ndarray, shape (carried, 3)
        Displacements of carried nodes at the start [m]; 0 if they start in their positions in the web.
    scales : ndarray, shape (carried, 3)
        Factors that convert rates of nodes to rates of the body, see `carry_rates`.
    axles : ndarray, shape (bodies, 3)
        Unit vectors along axles; 0 without an axle.
    doubled : ndarray, shape (bodies,)
        Part of the moments of inertia from the mass of rows off axles, which their own rows contain too [kg m²].
    """

    rows: IntegerMatrix
    moment: Vector
    mobility: Cube
    principal: Cube
    faster: Matrix
    reach: Matrix
    before: Matrix
    terms_space: Matrix
    carried: IntegerMatrix
    arms: Matrix
    ahead: Matrix
    scales: Matrix
    axles: Matrix
    doubled: Vector

    @classmethod
    def of(cls, net):
        """The record of a `refweb.net.net.Net`."""
        bodies = [body for body in net.bodies if body.turn is not None]
        count = len(bodies)
        mobility = np.array([b.axes.T @ b.mobility @ b.axes for b in bodies]).reshape(count, 3, 3)
        faster, principal = np.linalg.eigh(mobility)
        principal = np.ascontiguousarray(principal.swapaxes(1, 2))
        carried = [(row, n) for n, body in enumerate(bodies) for row in _carried_rows(body)]
        arms = np.array([arm for body in bodies for arm in _arms(body)]).reshape(-1, 3)
        ahead = [net.points[bodies[n].base] - net.points[row] for row, n in carried]
        return cls(
            rows=np.array([(b.base, b.spin, b.turn) for b in bodies], dtype=np.int64).reshape(count, 3),
            moment=np.array([0.0 if b.moved else b.moment for b in bodies], dtype=float),
            mobility=mobility,
            principal=principal,
            faster=faster,
            reach=np.array([_reach(b, axes) for b, axes in zip(bodies, principal, strict=True)]).reshape(count, 3),
            before=np.zeros((count, 4)),
            terms_space=np.zeros((TERMS + 1, 10)),
            carried=np.array(carried, dtype=np.int64).reshape(-1, 2),
            arms=arms,
            ahead=_exact(np.array(ahead).reshape(-1, 3), arms),
            scales=np.array([row for body in bodies for row in _scales(body, net)]).reshape(-1, 3),
            axles=np.array([b.axle.direction if b.axle else np.zeros(3) for b in bodies]).reshape(count, 3),
            doubled=np.array([b.mass * (b.arm @ b.arm) for b in bodies], dtype=float),
        )


def _carried_rows(body):
    """Rows that a body carries: its own row, if it is off the axle, and rows of nodes."""
    return ([] if body.pivot is None else [body.row]) + list(body.carried)


def _arms(body):
    """Vectors at the start from the centre of rotation of a body to carried rows [m], shape (carried, 3)."""
    nodes = body.arm + body.points @ body.axes
    return nodes if body.pivot is None else np.vstack([body.arm, nodes])


def _reach(body, axes):
    """Bound of the distance of points of a body from each of some axes [m], by the box of the body."""
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    corners = body.arm + (signs * (np.array(body.core) + body.radius) + body.offset) @ body.axes
    largest = body.extent + np.linalg.norm(body.arm)
    return np.minimum(np.linalg.norm(np.cross(corners[:, None], axes), axis=2).max(axis=0), largest)


def _exact(a, b):
    """a + b, and 0 if the sum is of the size of rounding."""
    total = a + b
    return np.where(np.abs(total) > 1e-13 * np.abs(a).max(initial=0.0), total, 0.0)


def _scales(body, net):
    """Scales that turn rates of attached nodes into rates of the body, see `carry_rates`; shape (carried, 3)."""
    points = _arms(body) @ body.axes.T
    if not len(points):
        return np.zeros((0, 3))
    size, axes = np.linalg.eigh(body.mobility)
    root = axes * np.sqrt(np.maximum(size, 0.0)) @ axes.T
    across = [np.cross(np.eye(3), point) @ root for point in points]
    pulls = [[root @ (p[k] * np.eye(3) - np.outer(p, np.eye(3)[k])) @ root for k in range(3)] for p in points]
    lever = np.linalg.norm(across, 2, axis=(1, 2))
    light, own_mass = net.mass[net.heavy].min(initial=math.inf), net.mass[body.row]
    angle = min(0.5 / max(float(lever.max()), 1e-300), math.sqrt(light / body.moment))
    factor = min(0.5, math.sqrt(light / own_mass)) if own_mass > 0.0 else 0.5
    pull = np.linalg.norm(np.linalg.norm(pulls, 2, axis=(2, 3)), axis=1)
    return np.column_stack([np.full(len(lever), 1.0 / factor), lever / angle, pull])


@kernel(leaf=True)
def angular_velocity(n, x, v, turns):
    """ω of a body [rad/s], along the axes of space."""
    m, s, w = matrix_at(x, turns.rows[n, 1], turns.rows[n, 2]), turns.rows[n, 1], turns.mobility[n]
    p = times_transposed(m, (v[s, 0], v[s, 1], v[s, 2]))
    return times(
        m,
        (
            w[0, 0] * p[0] + w[0, 1] * p[1] + w[0, 2] * p[2],
            w[1, 0] * p[0] + w[1, 1] * p[1] + w[1, 2] * p[2],
            w[2, 0] * p[0] + w[2, 1] * p[1] + w[2, 2] * p[2],
        ),
    )


@kernel(leaf=True, apart=("turning",))
def more_kinetic(x: Matrix, v: Matrix, turns: RigidRotations) -> float:
    """Kinetic energy of rotating bodies minus ½ I |L/I|² of each [J], which their rows contain as other rows do."""
    total = 0.0
    for n in range(turns.moment.size):
        s, omega = turns.rows[n, 1], angular_velocity(n, x, v, turns)
        for k in range(3):
            total += 0.5 * turns.moment[n] * v[s, k] * (omega[k] - v[s, k]) - 0.5 * turns.doubled[n] * omega[k] ** 2
    return total


@kernel(leaf=True)
def note_turns(x, turns):
    """Save the quaternions of bodies before a drift."""
    for n in range(turns.moment.size):
        s = turns.rows[n, 1]
        turns.before[n, 0] = 1.0 + x[turns.rows[n, 2], 0]
        for k in range(3):
            turns.before[n, 1 + k] = x[s, k]


@kernel(leaf=True)
def series(h, n, v, turns, q):
    """Advance the quaternion ``q (4,)`` of a free body by a time h, by one series."""
    terms_space, w, s = turns.terms_space, turns.mobility[n], turns.rows[n, 1]
    start = times_transposed(matrix_of(q[0], q[1], q[2], q[3]), (v[s, 0], v[s, 1], v[s, 2]))
    for k in range(4):
        terms_space[0, k] = q[k]
    for k in range(3):
        terms_space[0, 4 + k] = start[k]
    for m in range(TERMS):
        for k in range(3):
            terms_space[m, 7 + k] = (
                w[k, 0] * terms_space[m, 4] + w[k, 1] * terms_space[m, 5] + w[k, 2] * terms_space[m, 6]
            )
        share = h / (m + 1.0)
        l0 = l1 = l2 = q0 = q1 = q2 = q3 = 0.0
        for i in range(m + 1):
            a, b, c, d = terms_space[i, 0], terms_space[i, 1], terms_space[i, 2], terms_space[i, 3]
            f, g, e = terms_space[i, 4], terms_space[i, 5], terms_space[i, 6]
            u0, u1, u2 = terms_space[m - i, 7], terms_space[m - i, 8], terms_space[m - i, 9]
            l0, l1, l2 = l0 + g * u2 - e * u1, l1 + e * u0 - f * u2, l2 + f * u1 - g * u0
            q0 -= b * u0 + c * u1 + d * u2
            q1 += a * u0 + c * u2 - d * u1
            q2 += a * u1 + d * u0 - b * u2
            q3 += a * u2 + b * u1 - c * u0
        terms_space[m + 1, 0], terms_space[m + 1, 1] = 0.5 * share * q0, 0.5 * share * q1
        terms_space[m + 1, 2], terms_space[m + 1, 3] = 0.5 * share * q2, 0.5 * share * q3
        terms_space[m + 1, 4], terms_space[m + 1, 5], terms_space[m + 1, 6] = share * l0, share * l1, share * l2
        size = moved = 0.0
        for k in range(4):
            q[k] += terms_space[m + 1, k]
            size = max(size, abs(terms_space[m + 1, k]))
        for k in range(3):
            moved = max(moved, abs(terms_space[m + 1, 4 + k]))
        if size < SMALL and abs(h) * moved < SMALL:
            break
    size = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for k in range(4):
        q[k] *= size


@kernel(forceinline=True)
def along_principal(n, m, a, turns):
    """Components of a vector along the principal axes of a body with rotation matrix m."""
    p, e = times_transposed(m, a), turns.principal[n]
    return times(((e[0, 0], e[0, 1], e[0, 2]), (e[1, 0], e[1, 1], e[1, 2]), (e[2, 0], e[2, 1], e[2, 2])), p)


@kernel(leaf=True)
def fastest_about(n, u, turns):
    """Bounds of the angular velocities of a free body about its principal axes [rad/s], from L/I along these.

    Let w = I/J about each axis and e = Σ (w − 1) u², which is (2 T I − L²)/I² and constant for a free body. Bounds are
    w |u|, √(w Σ w u²) and w √(e/(w − 1)). With the last one, a rod that spins about its middle does not spin about its
    axis.
    """
    w, square, energy, spare = turns.faster[n], 0.0, 0.0, 0.0
    for k in range(3):
        square += u[k] * u[k]
        energy += w[k] * u[k] * u[k]
        spare += max(w[k] - 1.0, 0.0) * u[k] * u[k]
    first = min(w[0] * math.sqrt(square), math.sqrt(w[0] * energy))
    second = min(w[1] * math.sqrt(square), math.sqrt(w[1] * energy))
    third = min(w[2] * math.sqrt(square), math.sqrt(w[2] * energy))
    if w[1] > 1.0:
        second = min(second, w[1] * math.sqrt(spare / (w[1] - 1.0)))
    if w[2] > 1.0:
        third = min(third, w[2] * math.sqrt(spare / (w[2] - 1.0)))
    return first, second, third


@kernel(leaf=True, apart=("turning",))
def advance_rotation(h: float, v: Matrix, x: Matrix, turns: RigidRotations) -> None:
    """Rotate free bodies for a time h [s] from the saved quaternions, and write the result to x."""
    for n in range(turns.moment.size):
        s, q = turns.rows[n, 1], turns.before[n]
        u = along_principal(n, matrix_of(q[0], q[1], q[2], q[3]), (v[s, 0], v[s, 1], v[s, 2]), turns)
        a, b, c = fastest_about(n, u, turns)
        parts = int(math.ceil(min(abs(h) * math.sqrt(a * a + b * b + c * c) / TURN, 1e6)))
        for _ in range(parts):
            series(h / parts, n, v, turns, q)
        x[turns.rows[n, 2], 0] = q[0] - 1.0
        rate = take_along_axle(n, v, turns)
        x[turns.rows[n, 2], 1] += h * rate
        for k in range(3):
            x[s, k] = q[1 + k]
    update_attached_nodes(x, v, turns)


@kernel(leaf=True)
def take_along_axle(n, v, turns):
    """Keep the component of a velocity about the axle of a body; returns it [rad/s], 0 without an axle."""
    s, e = turns.rows[n, 1], turns.axles[n]
    rate = e[0] * v[s, 0] + e[1] * v[s, 1] + e[2] * v[s, 2]
    if e[0] != 0.0 or e[1] != 0.0 or e[2] != 0.0:
        for k in range(3):
            v[s, k] = rate * e[k]
    return rate


@kernel(apart=("turning", "looks"))
def turns_within(
    s: float, h: float, old: Cube, x: Matrix, v: Matrix, turns: RigidRotations, state: Matrix, speed: Matrix
) -> None:
    """Write rotations, and rows that bodies carry, within a step to ``state`` and ``speed``.

    s is the fraction of a step of size h from ``old`` (position, velocity, ...). The rotations are those of the cubic
    through quaternions and their rates at both ends.
    """
    r = 1.0 - s
    blend, rate0, rate1 = s * s * (3.0 - 2.0 * s), h * s * r * r, -h * s * s * r
    for n in range(turns.moment.size):
        p, t = turns.rows[n, 1], turns.rows[n, 2]
        first = 1.0 + old[0, t, 0], old[0, p, 0], old[0, p, 1], old[0, p, 2]
        last = 1.0 + x[t, 0], x[p, 0], x[p, 1], x[p, 2]
        d0 = quaternion_rate(*first, angular_velocity(n, old[0], old[1], turns))
        d1 = quaternion_rate(*last, angular_velocity(n, x, v, turns))
        state[t, 0] = first[0] - 1.0 + blend * (last[0] - first[0]) + rate0 * d0[0] + rate1 * d1[0]
        state[t, 1] = old[0, t, 1] + blend * (x[t, 1] - old[0, t, 1])
        for k in range(3):
            state[t, 1] += turns.axles[n, k] * (rate0 * old[1, p, k] + rate1 * v[p, k])
            state[p, k] = first[1 + k] + blend * (last[1 + k] - first[1 + k]) + rate0 * d0[1 + k] + rate1 * d1[1 + k]
    update_attached_nodes(state, speed, turns)


@kernel(leaf=True)
def turn_by(x, y, v, turns):
    """Rotate bodies from their orientation in x by the rotation vectors y − x of their rows [rad]; the result is in y.

    Positions of carried nodes are written to y, and their velocities, from ``v`` of the bodies, to v.
    """
    for n in range(turns.moment.size):
        s, t = turns.rows[n, 1], turns.rows[n, 2]
        a, b, c = y[s, 0] - x[s, 0], y[s, 1] - x[s, 1], y[s, 2] - x[s, 2]
        half = 0.5 * math.sqrt(a * a + b * b + c * c)
        share = 0.5 * math.sin(half) / half if half > 0.0 else 0.5
        e, f, g, h = math.cos(half), share * a, share * b, share * c
        w, p, q, r = 1.0 + x[t, 0], x[s, 0], x[s, 1], x[s, 2]
        first = e * w - f * p - g * q - h * r
        second = e * p + f * w + g * r - h * q
        third = e * q + g * w + h * p - f * r
        last = e * r + h * w + f * q - g * p
        size = 1.0 / math.sqrt(first * first + second * second + third * third + last * last)
        y[t, 0] = first * size - 1.0
        y[t, 1] += turns.axles[n, 0] * a + turns.axles[n, 1] * b + turns.axles[n, 2] * c
        y[s, 0], y[s, 1], y[s, 2] = second * size, third * size, last * size
    update_attached_nodes(y, v, turns)


@kernel(leaf=True)
def update_attached_nodes(x, v, turns):
    """Write positions and velocities of carried nodes, if there are any."""
    if turns.carried.shape[0]:
        carry_nodes(x, v, turns)


@kernel(leaf=True, apart=("carried",))
def carry_nodes(x: Matrix, v: Matrix, turns: RigidRotations) -> None:
    """Write positions and velocities of carried nodes."""
    for c in range(turns.carried.shape[0]):
        i, n, a = turns.carried[c, 0], turns.carried[c, 1], turns.arms[c]
        b = turns.rows[n, 0]
        arm = times(matrix_at(x, turns.rows[n, 1], turns.rows[n, 2]), (a[0], a[1], a[2]))
        w = angular_velocity(n, x, v, turns)
        for k in range(3):
            x[i, k] = x[b, k] + (arm[k] - a[k]) + turns.ahead[c, k]
        v[i, 0] = v[b, 0] + w[1] * arm[2] - w[2] * arm[1]
        v[i, 1] = v[b, 1] + w[2] * arm[0] - w[0] * arm[2]
        v[i, 2] = v[b, 2] + w[0] * arm[1] - w[1] * arm[0]


@kernel(leaf=True)
def add_forces_to_bodies(x, f, turns):
    """Add forces on carried nodes, if there are any, to the forces on their bodies."""
    if turns.carried.shape[0]:
        forces_to_bodies(x, f, turns)


@kernel(leaf=True, apart=("carried",))
def forces_to_bodies(x: Matrix, f: Matrix, turns: RigidRotations) -> None:
    """Add forces on carried nodes, and their moments, to the rows of their bodies."""
    for c in range(turns.carried.shape[0]):
        i, n, a = turns.carried[c, 0], turns.carried[c, 1], turns.arms[c]
        b, s = turns.rows[n, 0], turns.rows[n, 1]
        arm = times(matrix_at(x, s, turns.rows[n, 2]), (a[0], a[1], a[2]))
        for k in range(3):
            f[b, k] += f[i, k]
        f[s, 0] += arm[1] * f[i, 2] - arm[2] * f[i, 1]
        f[s, 1] += arm[2] * f[i, 0] - arm[0] * f[i, 2]
        f[s, 2] += arm[0] * f[i, 1] - arm[1] * f[i, 0]


def quaternion_of(matrix):
    """The unit quaternion (w, x, y, z) of a rotation matrix, w ≥ 0."""
    m = np.asarray(matrix, dtype=float)
    k = np.array(
        [
            [m.trace(), m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [0.0, m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
            [0.0, 0.0, m[1, 1] - m[0, 0] - m[2, 2], m[1, 2] + m[2, 1]],
            [0.0, 0.0, 0.0, m[2, 2] - m[0, 0] - m[1, 1]],
        ]
    )
    quaternion = np.linalg.eigh(k, UPLO="U")[1][:, -1]
    return quaternion * (
        1.0 if quaternion[0] > 0.0 or (quaternion[0] == 0.0 and quaternion[np.abs(quaternion).argmax()] > 0.0) else -1.0
    )
