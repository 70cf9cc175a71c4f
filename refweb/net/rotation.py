"""Rotations of rigid bodies: quaternions in the rows of a net, and the free motion of a body that turns.

The rotation of a body since the start is a unit quaternion q. Its vector part is the displacement of the body's row of
rotation, q₀ − 1 the first component of that of the row behind it, so that no displacement is no rotation. The velocity
of the row of rotation is L/I: the angular momentum L about the centre, along the axes of space, over a moment of
inertia I that stands in place of mass. So torques kick that row as forces kick the others, and what moves the body
freely keeps it. With W = I J⁻¹ of the tensor J at the start and the rotation matrix R of q,

    ω = R W Rᵀ (L/I),        q' = ½ ω q.

A free body moves by Taylor's series of this, along the axes of the body, to rounding: its coefficients follow from each
other, since all is quadratic. The poles of the motion lie at imaginary times of at least π/2 over the largest |ω|, so
that steps of `TURN` converge as 0.16ⁿ. That is the flow of the kinetic energy itself, symplectic and reversible as the
closed form of van Zon and Schofield [1]_ is, in splittings of any order, and takes no Jacobi functions nor cases.

A body may carry nodes of the web, see `refweb.effects.attach`: they are where it takes them, and what acts on them acts
on it. One that turns about an axle has W = n⊗n of its direction n, and I about it: so moments across it turn nothing.
Where its centre of mass is off the axle, its row is carried as nodes are, by a row of the axle that stays, and kinetic
energy has what it adds to I once. The second row of rotation has the angle about the axle as its second component.

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
"""Largest angle by which a series takes a body on [rad]; longer ways are several."""
TERMS = 24
"""Largest number of terms of a series: the next is below 1e-19."""
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
    """Make columns of a quaternion, in two rows of three from ``at``, of those of a rotation, of all rows before."""
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
        Row of the place of each, and its two rows of rotation.
    moment : ndarray, shape (bodies,)
        I [kg m²]; 0 of those that tables move.
    mobility : ndarray, shape (bodies, 3, 3)
        W, along the axes of space at the start.
    principal : ndarray, shape (bodies, 3, 3)
        Unit vectors of the principal axes, along the axes of space at the start.
    faster : ndarray, shape (bodies, 3)
        I over the moments of inertia about these; 1 about one of them, and not less about the others.
    reach : ndarray, shape (bodies, 3)
        Largest distance of a point of a body from each of these axes, at most [m].
    before : ndarray, shape (bodies, 4)
        Space for quaternions.
    terms_space : ndarray, shape (TERMS + 1, 10)
        Space for the terms of a series: of q, of L/I and of ω along the axes of the body.
    carried : ndarray of int, shape (carried, 2)
        Nodes that bodies carry, and the number of the body of each.
    arms : ndarray, shape (carried, 3)
        Vectors from the centre of mass to them at the start [m].
    ahead : ndarray, shape (carried, 3)
        Their displacements at the start [m], 0 where the body takes them where the web has them.
    scales : ndarray, shape (carried, 3)
        Factors that make rates of the nodes those of the body, see `carry_rates`.
    axles : ndarray, shape (bodies, 3)
        Unit vectors along axles, 0 of bodies that have none.
    doubled : ndarray, shape (bodies,)
        Part of the moments of inertia that rows off axles have by their mass [kg m²].
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
        """Those of a `refweb.net.net.Net`."""
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
    """Rows that a body carries: its own, where it is off the axle, and those of nodes."""
    return ([] if body.pivot is None else [body.row]) + list(body.carried)


def _arms(body):
    """Vectors at the start from where it turns about to what a body carries [m], shape (carried, 3)."""
    nodes = body.arm + body.points @ body.axes
    return nodes if body.pivot is None else np.vstack([body.arm, nodes])


def _reach(body, axes):
    """Largest distance of a point of a body from each of some axes that it turns about, at most [m]: of the box."""
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    corners = body.arm + (signs * (np.array(body.core) + body.radius) + body.offset) @ body.axes
    largest = body.extent + np.linalg.norm(body.arm)
    return np.minimum(np.linalg.norm(np.cross(corners[:, None], axes), axis=2).max(axis=0), largest)


def _exact(a, b):
    """a + b, 0 where that is of rounding."""
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
    """Kinetic energy of bodies that turn less ½ I |L/I|² of each [J], which their rows have as all others."""
    total = 0.0
    for n in range(turns.moment.size):
        s, omega = turns.rows[n, 1], angular_velocity(n, x, v, turns)
        for k in range(3):
            total += 0.5 * turns.moment[n] * v[s, k] * (omega[k] - v[s, k]) - 0.5 * turns.doubled[n] * omega[k] ** 2
    return total


@kernel(leaf=True)
def note_turns(x, turns):
    """Note the quaternions of bodies ahead of a drift."""
    for n in range(turns.moment.size):
        s = turns.rows[n, 1]
        turns.before[n, 0] = 1.0 + x[turns.rows[n, 2], 0]
        for k in range(3):
            turns.before[n, 1 + k] = x[s, k]


@kernel(leaf=True)
def series(h, n, v, turns, q):
    """Take the quaternion ``q (4,)`` of a free body on by a time h, by one series."""
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
    """Components of a vector along the principal axes of a body of rotation matrix m."""
    p, e = times_transposed(m, a), turns.principal[n]
    return times(((e[0, 0], e[0, 1], e[0, 2]), (e[1, 0], e[1, 1], e[1, 2]), (e[2, 0], e[2, 1], e[2, 2])), p)


@kernel(leaf=True)
def fastest_about(n, u, turns):
    """Angular velocities about its principal axes that a free body comes to, at most [rad/s], by L/I along these.

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
    """Turn free bodies by a time h [s] from the quaternions that are noted, and write them to x."""
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
    """Leave the rotation about the axle of a body in its velocity; that about it [rad/s], 0 without an axle."""
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
    """Write rotations, and what bodies carry, to ``state`` and ``speed``.

    They are those at the share s of a step of size h that begins at ``old`` (position, velocity, ...), and lie on the
    cubic through quaternions and their rates at either end.
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
    """Turn bodies from where x has them by the rotation vectors y − x of their rows of rotation [rad], written to y.

    Carried nodes go with them: their places are written to y, their velocities by ``v`` of the bodies.
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
    """Write places and velocities of the nodes that bodies carry, where they carry any."""
    if turns.carried.shape[0]:
        carry_nodes(x, v, turns)


@kernel(leaf=True, apart=("carried",))
def carry_nodes(x: Matrix, v: Matrix, turns: RigidRotations) -> None:
    """Write places and velocities of the nodes that bodies carry."""
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
    """Add the forces on nodes that bodies carry to those on the bodies, where they carry any."""
    if turns.carried.shape[0]:
        forces_to_bodies(x, f, turns)


@kernel(leaf=True, apart=("carried",))
def forces_to_bodies(x: Matrix, f: Matrix, turns: RigidRotations) -> None:
    """Add the forces on nodes that bodies carry, and their moments, to those on the bodies."""
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
