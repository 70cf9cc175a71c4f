"""Bounds of the velocity of bodies that turn, and of the stiffness by attached nodes, for steps of explicit methods.

See `refweb.net.rotation`.

May change: a bound, if it stays above the exact value. Must stay: names in ``apart``, keys of
`dynamics.integrators.features`; arguments and results, which `step_bound`, `ccd`, `explicit_loop` and `neighbour_list`
of `dynamics.integrators` use; all names that `integrators.step_bound`, `integrators.explicit_loop` and other files
import. Tests: ``tests/net/test_rotation.py``.
"""

from __future__ import annotations

import math

from ..kernels import Matrix, Vector, kernel
from .rotation import RigidRotations, along_principal, fastest_about, matrix_at


@kernel(leaf=True, apart=("carried",))
def carry_rates(rates: Vector, turns: RigidRotations) -> None:
    """Convert row sums of |K|, or of damping, of carried nodes to row sums of the bodies.

    A node at the arm a moves by δ + θ × a. Two unknowns of the body replace its displacement. They are scaled to at
    most half of it: the rows of other nodes then keep their sums, and the rows of the body get the sums of the node
    over these scales.
    """
    for c in range(turns.carried.shape[0]):
        i, n = turns.carried[c, 0], turns.carried[c, 1]
        rates[turns.rows[n, 0]] += turns.scales[c, 0] * rates[i]
        rates[turns.rows[n, 1]] += turns.scales[c, 1] * rates[i]


@kernel(leaf=True, apart=("carried",))
def pull_rates(rates: Vector, f: Matrix, turns: RigidRotations) -> None:
    """Add the moments of forces f on carried nodes to the rows of rotation of bodies, for twice these forces."""
    for c in range(turns.carried.shape[0]):
        i = turns.carried[c, 0]
        pull = math.sqrt(f[i, 0] ** 2 + f[i, 1] ** 2 + f[i, 2] ** 2)
        rates[turns.rows[turns.carried[c, 1], 1]] += 2.0 * turns.scales[c, 2] * pull


@kernel(leaf=True)
def speeds(n, x, v, turns):
    """Bounds of the speed of a body and of the speed from rotation at its surface, in free motion [m/s]."""
    b, s, far = turns.rows[n, 0], turns.rows[n, 1], turns.reach[n]
    speed = math.sqrt(v[b, 0] ** 2 + v[b, 1] ** 2 + v[b, 2] ** 2)
    u = along_principal(n, matrix_at(x, s, turns.rows[n, 2]), (v[s, 0], v[s, 1], v[s, 2]), turns)
    fastest = fastest_about(n, u, turns)
    return speed, far[0] * fastest[0] + far[1] * fastest[1] + far[2] * fastest[2]


@kernel(leaf=True)
def pushes(n, x, f, turns):
    """Bounds of the force on a body, and of I times the acceleration of its surface by the moment on it.

    The units are [N] and [N m²]: the second over I [kg m²] is the acceleration.
    """
    b, s, far, w = turns.rows[n, 0], turns.rows[n, 1], turns.reach[n], turns.faster[n]
    force_size = math.sqrt(f[b, 0] ** 2 + f[b, 1] ** 2 + f[b, 2] ** 2)
    m = along_principal(n, matrix_at(x, s, turns.rows[n, 2]), (f[s, 0], f[s, 1], f[s, 2]), turns)
    return force_size, far[0] * w[0] * abs(m[0]) + far[1] * w[1] * abs(m[1]) + far[2] * w[2] * abs(m[2])


@kernel(leaf=True, apart=("turning",))
def fastest_surface(x: Matrix, v: Matrix, turns: RigidRotations) -> float:
    """Bound of the speed from rotation at the surface of any body in free motion [m/s]."""
    fastest = 0.0
    for n in range(turns.moment.size):
        fastest = max(fastest, speeds(n, x, v, turns)[1])
    return fastest


@kernel(leaf=True, apart=("turning",))
def fastest_point(x: Matrix, v: Matrix, turns: RigidRotations) -> float:
    """Bound of the speed of any point of a body in free motion [m/s]."""
    fastest = 0.0
    for n in range(turns.moment.size):
        speed, turning = speeds(n, x, v, turns)
        fastest = max(fastest, speed + turning)
    return fastest


@kernel(leaf=True, apart=("turning",))
def hardest_push(x: Matrix, f: Matrix, inverse: Matrix, turns: RigidRotations) -> float:
    """Bound of the acceleration of any point of a body by forces f [m/s²]."""
    hardest = 0.0
    for n in range(turns.moment.size):
        force, moment = pushes(n, x, f, turns)
        hardest = max(hardest, inverse[turns.rows[n, 0], 0] * force + inverse[turns.rows[n, 1], 0] * moment)
    return hardest


@kernel(apart=("turning", "body_ccd"))
def beside_places(
    kick: float, drift: float, x: Matrix, v: Matrix, f: Matrix, inverse: Matrix, turns: RigidRotations
) -> float:
    """Bound of the distance of points of bodies from predicted positions in a drift after a kick [m].

    For the surface it is the displacement by rotation, for carried nodes the deviation from uniform motion.
    """
    largest = off = 0.0
    for n in range(turns.moment.size):
        (_, turning), (_, moment) = speeds(n, x, v, turns), pushes(n, x, f, turns)
        largest = max(largest, abs(drift) * (turning + abs(kick) * inverse[turns.rows[n, 1], 0] * moment))
    for c in range(turns.carried.shape[0]):
        n, a = turns.carried[c, 1], turns.arms[c]
        b, s = turns.rows[n, 0], turns.rows[n, 1]
        u = along_principal(n, matrix_at(x, s, turns.rows[n, 2]), (v[s, 0], v[s, 1], v[s, 2]), turns)
        w, arm = fastest_about(n, u, turns), math.sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2)
        force = abs(kick) * inverse[b, 0] * math.sqrt(f[b, 0] ** 2 + f[b, 1] ** 2 + f[b, 2] ** 2)
        more = abs(kick) * inverse[s, 0] * math.sqrt(f[s, 0] ** 2 + f[s, 1] ** 2 + f[s, 2] ** 2)
        more *= max(turns.faster[n, 0], turns.faster[n, 1], turns.faster[n, 2])
        angle = abs(drift) * (math.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2) + more)
        off = max(off, abs(drift) * (force + more * arm) + 0.5 * angle * angle * arm)
    return largest + off
