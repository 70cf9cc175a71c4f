"""Losses where things touch, solved for contact by contact, where an explicit method kicks velocities.

A kick of size h leaves positions where they are. Of the velocities v⁻ ahead of it and v⁺ behind it, the impulses
of contacts that act at once are to follow: with the relative velocity u = J v of a contact, its force F(u) of
`refweb.effects.contact.friction` and all other forces f,

    v⁺ = v⁻ + h M⁻¹(f + Σ Jᵀ F(u_θ)),        u_θ = (1 − θ) u⁻ + θ u⁺.

Friction below its slip velocity is as stiff as that is small, so these equations are solved and not stepped over. They
are coupled, since contacts share nodes and bodies: a sweep solves them one after the other, each with the forces that
the others have come to, and the next sweep goes the other way, as nonlinear Gauss–Seidel does in [1]_. Each alone has a
solution in closed form but for one number. Along the normal u = b + θ h w F is linear by pieces. Along the two
directions of the tangent plane in which J M⁻¹ Jᵀ has no mixed term, with Z_i = θ h w_i μ N, the size r = √(|u_t|² +
v_s²) is the root of

    v_s²/r² + Σ b_i²/(r + Z_i)² = 1,

whose left side falls and is convex, so that Newton's method on its inverse root comes to it from below.

θ is ½ where a kick hardly changes the slip, which makes steps of order 2, and goes to 1 where the contact sticks, which
takes the slip away instead of turning it round: θ(z) = 1/(1 − e⁻ᶻ) − 1/z is exact for a force −z u/h w. It departs from
½ by z/12, of order h, which leaves the order at 2. What all forces do to the kinetic energy in a kick is h times their
power at v = ½ (v⁻ + v⁺), and this power is what is booked: it closes the book whether sweeps have converged or not.
Where it would be positive at a contact, whose slip turns round within the kick, θ is ½ there: F(u)·u is never positive.

References
----------
.. [1] M. Jean, "The non-smooth contact dynamics method", Comput. Methods Appl. Mech. Engrg. 177 (1999) 235–257,
   doi:10.1016/S0045-7825(98)00383-1.
"""

from __future__ import annotations

import functools
import math

from ..kernels import COMMIT, GAUSS_SEIDEL, WARM_START, kernel
from .base import CELL, FELT

ROWS, SHARES, AXES, LEVERS, START = 1, 5, 7, 16, 25
"""Columns of what touches, behind its cell: rows of the nodes, the body and its rotation, −1 without; shares of the
nodes; the normal and two tangents; what the velocity of the rotation adds to u along each; u⁻ along each [m/s]."""
OWN, MIXED, PUSH, DAMPING, FRICTION, SLIP = 28, 31, 33, 34, 35, 36
"""J M⁻¹ Jᵀ of each direction [1/kg], and of the normal with each tangent; N₀ [N], d [s/m], μ and v_s [m/s]."""
FORCES, THETA, SLOT, ARMS, WIDTH = 37, 40, 42, 43, 52
"""F along each direction [N], θ of the normal and of the tangents, slot in the memory of a cell; what a force along
each direction adds to the moment on the body; number of columns."""
SLOTS, NOTED = 3, 4
"""Contacts that a cell has at most, and what is remembered of each: the number of the step, and F [N]."""
SETTLING = 1
"""Number of sweeps after which θ stays: forces of the step before are known, and a second changes nothing."""


@kernel()
def fitted(z):
    """θ(z) = 1/(1 − e⁻ᶻ) − 1/z of a loss that alone would take e⁻ᶻ of a velocity, z ≥ 0; ½ to 1."""
    if z < 0.1:
        return 0.5 + z / 12.0 * (1.0 - z * z / 60.0 * (1.0 - z * z / 42.0))
    return 1.0 / (1.0 - math.exp(-z)) - 1.0 / z


@kernel()
def slip_size(b, c, y, z, slip):
    """Root r of slip²/r² + b²/(r + y)² + c²/(r + z)² = 1, with y, z ≥ 0: never below the root of large steps."""
    r = max(slip, math.sqrt(b * b + c * c) - max(y, z))
    for _ in range(100):
        p, q, s = slip / r, b / (r + y), c / (r + z)
        p, q, s = p * p, q * q, s * s
        total = p + q + s
        step = total * (math.sqrt(total) - 1.0) / (p / r + q / (r + y) + s / (r + z))
        r += step
        if not abs(step) > 1e-15 * r:
            break
    return r


@kernel(forceinline=True)
def solve_normal(touches, n, h, rate):
    """(force along the normal, N) where the others alone would speed the contact up by ``rate`` [m/s²]."""
    push, damping, weight = touches[n, PUSH], touches[n, DAMPING], touches[n, OWN]
    if damping == 0.0:
        return 0.0, push
    while True:
        theta = touches[n, THETA]
        start = touches[n, START] + theta * h * rate
        u = start / (1.0 + theta * h * weight * push * damping)
        damped = damping * u
        if damped < -1.0:
            damped = -1.0
        force = -push * damped
        if theta == 0.5 or damped * (touches[n, START] + 0.5 * h * (rate + weight * force)) >= 0.0:
            return force, push * (1.0 + damped)
        touches[n, THETA] = 0.5


@kernel(forceinline=True)
def solve_tangents(touches, n, h, drag, first, last, settling):
    """Friction along both tangents, of μ N = ``drag``, where the others alone would speed it up by first and last."""
    slip, first_weight, second = touches[n, SLIP], h * touches[n, OWN + 1], h * touches[n, OWN + 2]
    u, w = touches[n, START + 1], touches[n, START + 2]
    if settling:
        r = slip_size(u + h * first, w + h * last, first_weight * drag, second * drag, slip)
        touches[n, THETA + 1] = fitted(max(first_weight, second) * drag / r)
    while True:
        theta = touches[n, THETA + 1]
        b, c, y, z = u + theta * h * first, w + theta * h * last, theta * first_weight * drag, theta * second * drag
        r = slip_size(b, c, y, z, slip)
        b, c = b / (r + y), c / (r + z)
        force = -drag * b, -drag * c
        if theta == 0.5:
            return force
        mean, more = u + 0.5 * (h * first + first_weight * force[0]), w + 0.5 * (h * last + second * force[1])
        if b * mean + c * more >= 0.0:
            return force
        touches[n, THETA + 1] = 0.5


@kernel()
def turned_from(memory, c, at, touches, n):
    """Components along the directions of a contact of the vector that a row of a memory holds."""
    p = q = s = 0.0
    for k in range(3):
        p += memory[c, at + k] * touches[n, AXES + k]
        q += memory[c, at + k] * touches[n, AXES + 3 + k]
        s += memory[c, at + k] * touches[n, AXES + 6 + k]
    return p, q, s


@functools.cache
def sweeping(moved, apply_force):
    """The kernel that solves contacts in turn.

    Parameters
    ----------
    moved : kernel
        ``(touches, n, i, f, inverse)``: component along direction i of the acceleration by forces f at contact n.
    apply_force : kernel
        ``(touches, n, p, q, s, f)``: adds a force along the three directions of contact n to f.
    """

    @kernel(GAUSS_SEIDEL)
    def sweep(h, number, f, inverse, touches, count):
        """Solve contacts in turn, backwards where ``number`` is odd; the largest change of a velocity [m/s]."""
        largest = 0.0
        for m in range(count):
            n = count - 1 - m if number % 2 else m
            if not touches[n, PUSH] > 0.0:
                continue
            was = touches[n, FORCES], touches[n, FORCES + 1], touches[n, FORCES + 2]
            p, normal = 0.0, touches[n, PUSH]
            if touches[n, DAMPING] > 0.0:
                weight, rate = touches[n, OWN], moved(touches, n, 0, f, inverse)
                p, normal = solve_normal(touches, n, h, rate - weight * was[0])
                largest = max(largest, h * weight * abs(p - was[0]))
            q = s = 0.0
            drag = touches[n, FRICTION] * normal
            if drag > 0.0:
                first_weight, second = touches[n, OWN + 1], touches[n, OWN + 2]
                first = moved(touches, n, 1, f, inverse) + touches[n, MIXED] * (p - was[0]) - first_weight * was[1]
                last = moved(touches, n, 2, f, inverse) + touches[n, MIXED + 1] * (p - was[0]) - second * was[2]
                q, s = solve_tangents(touches, n, h, drag, first, last, number < SETTLING)
                largest = max(largest, h * first_weight * abs(q - was[1]), h * second * abs(s - was[2]))
            touches[n, FORCES], touches[n, FORCES + 1], touches[n, FORCES + 2] = p, q, s
            apply_force(touches, n, p - was[0], q - was[1], s - was[2], f)
        return largest

    return sweep


@functools.cache
def warm_start(along, apply_force):
    """The kernels that begin with the forces of the step before, and that note them with their power.

    Parameters
    ----------
    along : kernel
        ``(touches, n, i, rows)``: component along direction i of u, of velocities (rows, 3).
    apply_force : kernel
        See `sweeping`.
    """

    @kernel(WARM_START)
    def recall(number, memory, f, touches, begin, end):
        """Begin with the forces of the step before: what sticks then takes few sweeps."""
        for n in range(begin, end):
            c, at = int(touches[n, CELL]), NOTED * int(touches[n, SLOT])
            if memory[c, at] == number - 1:
                force = turned_from(memory, c, at + 1, touches, n)
                touches[n, FORCES], touches[n, FORCES + 1], touches[n, FORCES + 2] = force
                apply_force(touches, n, force[0], force[1], force[2], f)

    @kernel(COMMIT)
    def commit(number, memory, v, touches, begin, end, out):
        """Write the power of each cell at the velocities v, with the force that a body feels; remember forces."""
        out[:] = 0.0
        for n in range(begin, end):
            c, at = int(touches[n, CELL]), NOTED * int(touches[n, SLOT])
            memory[c, at] = number
            for k in range(3):
                memory[c, at + 1 + k] = 0.0
                for i in range(3):
                    memory[c, at + 1 + k] += touches[n, FORCES + i] * touches[n, AXES + 3 * i + k]
            for k in range(out.shape[1] - FELT):
                out[c, FELT + k] -= memory[c, at + 1 + k]
            for i in range(3):
                out[c, 0] += touches[n, FORCES + i] * along(touches, n, i, v)

    return recall, commit
