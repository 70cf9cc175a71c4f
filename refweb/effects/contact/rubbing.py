"""Losses of contact solved for, contact by contact, where an explicit method kicks velocities.

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

Lines that end at one node touch a body there at one point, with one normal and one slip. They are one contact of their
pushes together: its forces are the sum of theirs, and sweeps need not settle which of them bears how much.

References
----------
.. [1] M. Jean, "The non-smooth contact dynamics method", Comput. Methods Appl. Mech. Engrg. 177 (1999) 235–257,
   doi:10.1016/S0045-7825(98)00383-1.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from ...kernels import GIVE, KEPT, MEET, SWEEP, kernel
from ...net.rotation import times, times_transposed
from ..base import Rubbing
from ..vectors import cross, dot
from .friction import facing
from .nearest_point import share
from .penalty import rubbed_by
from .places import hessian_times, places

CELL, ROWS, SHARES, AXES, LEVERS, START = 0, 1, 5, 7, 16, 25
"""Columns of what touches: cell; rows of the nodes, the body and its rotation, −1 without; shares of the nodes; the
normal and two tangents; what the velocity of the rotation adds to u along each; u⁻ along each [m/s]."""
OWN, MIXED, PUSH, DAMPING, FRICTION, SLIP = 28, 31, 33, 34, 35, 36
"""J M⁻¹ Jᵀ of each direction [1/kg], and of the normal with each tangent; N₀ [N], d [s/m], μ and v_s [m/s]."""
FORCE, THETA, SLOT, ARMS, WIDTH = 37, 40, 42, 43, 52
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
def rows_of(touches, n):
    """Rows of both nodes, of the body and of its rotation, −1 without."""
    return int(touches[n, ROWS]), int(touches[n, ROWS + 1]), int(touches[n, ROWS + 2]), int(touches[n, ROWS + 3])


@kernel(forceinline=True)
def along(touches, n, i, rows):
    """Component along direction i of Σ N v − v_body + ω × ..., of ``rows (rows, 3)``."""
    at, lever = AXES + 3 * i, LEVERS + 3 * i
    a, b, body, spin = rows_of(touches, n)
    total = 0.0
    for k in range(3):
        point = touches[n, SHARES] * rows[a, k] + touches[n, SHARES + 1] * rows[b, k]
        total += touches[n, at + k] * (point - rows[body, k])
        if spin >= 0:
            total += touches[n, lever + k] * rows[spin, k]
    return total


@kernel(forceinline=True)
def moved(touches, n, i, f, inverse):
    """Component along direction i of the acceleration by forces f."""
    at, lever = AXES + 3 * i, LEVERS + 3 * i
    a, b, body, spin = rows_of(touches, n)
    total = 0.0
    for k in range(3):
        point = touches[n, SHARES] * inverse[a, k] * f[a, k] + touches[n, SHARES + 1] * inverse[b, k] * f[b, k]
        total += touches[n, at + k] * (point - inverse[body, k] * f[body, k])
        if spin >= 0:
            total += touches[n, lever + k] * inverse[spin, k] * f[spin, k]
    return total


@kernel(forceinline=True)
def push_apart(touches, n, p, q, s, f):
    """Add a force along the three directions to the rows of a contact."""
    a, b, body, spin = rows_of(touches, n)
    for k in range(3):
        force = p * touches[n, AXES + k] + q * touches[n, AXES + 3 + k] + s * touches[n, AXES + 6 + k]
        f[a, k] += touches[n, SHARES] * force
        f[b, k] += touches[n, SHARES + 1] * force
        f[body, k] -= force
        if spin >= 0:
            f[spin, k] += p * touches[n, ARMS + k] + q * touches[n, ARMS + 3 + k] + s * touches[n, ARMS + 6 + k]


class Direction(NamedTuple):
    """A direction of a contact.

    Attributes
    ----------
    axis : tuple of 3 float
        Unit vector.
    lever : tuple of 3 float
        What the velocity of the rotation adds to u along it.
    arm : tuple of 3 float
        What a force along it adds to the moment on the body.
    """

    axis: tuple
    lever: tuple
    arm: tuple


@kernel(forceinline=True)
def direction(axis, y, pair, spins):
    """A `Direction` of a contact at y from the centre of its body; a ring turns about its normal alone."""
    if not spins:
        return Direction(axis, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    arm = cross(axis, y)
    if pair.planar:
        normal = pair.axes[2]
        turn = dot(arm, normal)
        arm = turn * normal[0], turn * normal[1], turn * normal[2]
    lever = arm
    if spins == 2:
        lever = times_transposed(pair.axes, hessian_times(pair.mobility, times(pair.axes, arm)))
    return Direction(axis, lever, arm)


@kernel(forceinline=True)
def weigh(one, other, light, lighter):
    """J M⁻¹ Jᵀ between two directions [1/kg], by that of the places and that of the rotation along the axes."""
    p, q, r, s = one.axis, other.axis, one.arm, other.lever
    places = p[0] * q[0] * light[0] + p[1] * q[1] * light[1] + p[2] * q[2] * light[2]
    return places + r[0] * s[0] * lighter[0] + r[1] * s[1] * lighter[1] + r[2] * s[2] * lighter[2]


@kernel(forceinline=True)
def mixture(c, p, s, q):
    """c p + s q of two directions."""
    return Direction(
        (c * p.axis[0] + s * q.axis[0], c * p.axis[1] + s * q.axis[1], c * p.axis[2] + s * q.axis[2]),
        (c * p.lever[0] + s * q.lever[0], c * p.lever[1] + s * q.lever[1], c * p.lever[2] + s * q.lever[2]),
        (c * p.arm[0] + s * q.arm[0], c * p.arm[1] + s * q.arm[1], c * p.arm[2] + s * q.arm[2]),
    )


@kernel(forceinline=True)
def set_direction(touches, n, i, own):
    """Write direction i of a contact."""
    for k in range(3):
        touches[n, AXES + 3 * i + k], touches[n, LEVERS + 3 * i + k] = own.axis[k], own.lever[k]
        touches[n, ARMS + 3 * i + k] = own.arm[k]


@kernel(forceinline=True)
def set_touch(touches, n, touch, cells, v, inverse, spins, functions):
    """Write all that sweeps ask of a contact of an element with two nodes, but θ of the normal.

    The two tangents are those between which J M⁻¹ Jᵀ has no mixed term.
    """
    c, pair = touch.c, touch.pair
    a, b, body, spin = cells[c, 0], cells[c, 1], cells[c, 2], cells[c, 3] if spins else -1
    touches[n, CELL], touches[n, ROWS], touches[n, ROWS + 1], touches[n, ROWS + 2] = c, a, b, body
    touches[n, ROWS + 3] = spin
    near, far = share(0, 2, functions, touch.place)[0], share(1, 2, functions, touch.place)[0]
    touches[n, SHARES], touches[n, SHARES + 1] = near, far
    y, g = times_transposed(pair.axes, touch.spot.y), times_transposed(pair.axes, touch.spot.gradient)
    steep, g = facing(g)
    g = g if steep > 0.0 else (1.0, 0.0, 0.0)  # nothing pushes
    e = cross(g, (1.0, 0.0, 0.0) if abs(g[0]) < 0.6 else (0.0, 1.0, 0.0))
    size = math.sqrt(dot(e, e))
    e = e[0] / size, e[1] / size, e[2] / size
    light = (
        near * near * inverse[a, 0] + far * far * inverse[b, 0] + inverse[body, 0],
        near * near * inverse[a, 1] + far * far * inverse[b, 1] + inverse[body, 1],
        near * near * inverse[a, 2] + far * far * inverse[b, 2] + inverse[body, 2],
    )
    lighter = (inverse[spin, 0], inverse[spin, 1], inverse[spin, 2]) if spins else (0.0, 0.0, 0.0)
    normal, one, other = (
        direction(g, y, pair, spins), direction(e, y, pair, spins), direction(cross(g, e), y, pair, spins)
    )  # fmt: skip
    first, last = weigh(one, one, light, lighter), weigh(other, other, light, lighter)
    mixed = weigh(one, other, light, lighter)
    if abs(mixed) > 1e-15 * (first + last):
        angle = 0.5 * math.atan2(2.0 * mixed, first - last)
        cosine, sine = math.cos(angle), math.sin(angle)
        one, other = mixture(cosine, one, sine, other), mixture(cosine, other, -sine, one)
        first, last = weigh(one, one, light, lighter), weigh(other, other, light, lighter)
    set_direction(touches, n, 0, normal)
    set_direction(touches, n, 1, one)
    set_direction(touches, n, 2, other)
    touches[n, OWN], touches[n, OWN + 1], touches[n, OWN + 2] = weigh(normal, normal, light, lighter), first, last
    touches[n, MIXED] = weigh(normal, one, light, lighter)
    touches[n, MIXED + 1] = weigh(normal, other, light, lighter)
    for i in range(3):
        touches[n, START + i] = along(touches, n, i, v)
        touches[n, FORCE + i] = 0.0
    touches[n, PUSH], touches[n, DAMPING] = rubbed_by(touch) * steep, pair.damping * steep
    touches[n, FRICTION], touches[n, SLIP] = pair.friction, pair.slip_velocity
    touches[n, THETA + 1] = 1.0
    touches[n, SLOT] = 0.0 if touch.inner or pair.once else 1.0 if touch.place < 0.5 else 2.0


@kernel(forceinline=True)
def solve_normal(touches, n, h, rate):
    """(force along the normal, N) where the others alone would speed the contact up by ``rate`` [m/s²]."""
    push, damping, own = touches[n, PUSH], touches[n, DAMPING], touches[n, OWN]
    if damping == 0.0:
        return 0.0, push
    while True:
        theta = touches[n, THETA]
        start = touches[n, START] + theta * h * rate
        u = start / (1.0 + theta * h * own * push * damping)
        damped = damping * u
        if damped < -1.0:
            damped = -1.0
        force = -push * damped
        if theta == 0.5 or damped * (touches[n, START] + 0.5 * h * (rate + own * force)) >= 0.0:
            return force, push * (1.0 + damped)
        touches[n, THETA] = 0.5


@kernel(forceinline=True)
def solve_tangents(touches, n, h, drag, first, last, settling):
    """Friction along both tangents, of μ N = ``drag``, where the others alone would speed it up by first and last."""
    slip, one, other = touches[n, SLIP], h * touches[n, OWN + 1], h * touches[n, OWN + 2]
    u, w = touches[n, START + 1], touches[n, START + 2]
    if settling:
        r = slip_size(u + h * first, w + h * last, one * drag, other * drag, slip)
        touches[n, THETA + 1] = fitted(max(one, other) * drag / r)
    while True:
        theta = touches[n, THETA + 1]
        b, c, y, z = u + theta * h * first, w + theta * h * last, theta * one * drag, theta * other * drag
        r = slip_size(b, c, y, z, slip)
        b, c = b / (r + y), c / (r + z)
        force = -drag * b, -drag * c
        if theta == 0.5:
            return force
        mean, more = u + 0.5 * (h * first + one * force[0]), w + 0.5 * (h * last + other * force[1])
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


@kernel(SWEEP)
def sweep(h, number, f, inverse, touches, count):
    """Solve contacts in turn, backwards where ``number`` is odd; the largest change of a velocity [m/s]."""
    most = 0.0
    for m in range(count):
        n = count - 1 - m if number % 2 else m
        if not touches[n, PUSH] > 0.0:
            continue
        was = touches[n, FORCE], touches[n, FORCE + 1], touches[n, FORCE + 2]
        p, normal = 0.0, touches[n, PUSH]
        if touches[n, DAMPING] > 0.0:
            own, rate = touches[n, OWN], moved(touches, n, 0, f, inverse)
            p, normal = solve_normal(touches, n, h, rate - own * was[0])
            most = max(most, h * own * abs(p - was[0]))
        q = s = 0.0
        drag = touches[n, FRICTION] * normal
        if drag > 0.0:
            one, other = touches[n, OWN + 1], touches[n, OWN + 2]
            first = moved(touches, n, 1, f, inverse) + touches[n, MIXED] * (p - was[0]) - one * was[1]
            last = moved(touches, n, 2, f, inverse) + touches[n, MIXED + 1] * (p - was[0]) - other * was[2]
            q, s = solve_tangents(touches, n, h, drag, first, last, number < SETTLING)
            most = max(most, h * one * abs(q - was[1]), h * other * abs(s - was[2]))
        touches[n, FORCE], touches[n, FORCE + 1], touches[n, FORCE + 2] = p, q, s
        push_apart(touches, n, p - was[0], q - was[1], s - was[2], f)
    return most


@kernel(KEPT)
def recall(number, memory, f, touches, begin, end):
    """Begin with the forces of the step before: what sticks then takes few sweeps."""
    for n in range(begin, end):
        c, at = int(touches[n, CELL]), NOTED * int(touches[n, SLOT])
        if memory[c, at] == number - 1:
            force = turned_from(memory, c, at + 1, touches, n)
            touches[n, FORCE], touches[n, FORCE + 1], touches[n, FORCE + 2] = force
            push_apart(touches, n, force[0], force[1], force[2], f)


@kernel(GIVE)
def give(number, memory, v, touches, begin, end, out):
    """Write the power of each cell at the velocities v, and remember forces."""
    out[:, 0] = 0.0
    for n in range(begin, end):
        c, at = int(touches[n, CELL]), NOTED * int(touches[n, SLOT])
        memory[c, at] = number
        for k in range(3):
            memory[c, at + 1 + k] = 0.0
            for i in range(3):
                memory[c, at + 1 + k] += touches[n, FORCE + i] * touches[n, AXES + 3 * i + k]
        for i in range(3):
            out[c, 0] += touches[n, FORCE + i] * along(touches, n, i, v)


@functools.cache
def kernels(depth, pieces, functions, spins):
    """The `Rubbing` of elements with two nodes.

    Parameters
    ----------
    depth, pieces, functions, spins
        See `refweb.effects.contact.friction.kernels`.
    """
    _, _, contacts, touch_of, (most, columns) = places(depth, spins)

    @kernel(MEET)
    def meet(h, x, v, inverse, cells, data, touches, begin):
        found, count = np.empty((most * pieces, columns)), begin
        at_node = np.full(x.shape[0], -1)
        for first in range(0, cells.shape[0], pieces):
            for n in range(contacts(x, cells, data, first, pieces, 2, functions, found)):
                if count < touches.shape[0]:
                    touch = touch_of(x, cells, data, 2, functions, found, n)
                    if not touch.inner:
                        node = cells[touch.c, 0 if touch.place < 0.5 else 1]
                        other = at_node[node]
                        if other >= 0 and int(touches[other, ROWS + 2]) == cells[touch.c, 2]:
                            touches[other, PUSH] += rubbed_by(touch) * facing(touch.spot.gradient)[0]
                            continue
                        at_node[node] = count
                    set_touch(touches, count, touch, cells, v, inverse, spins, functions)
                count += 1
        for n in range(begin, min(count, touches.shape[0])):
            touches[n, THETA] = fitted(h * touches[n, OWN] * touches[n, PUSH] * touches[n, DAMPING])
        return count

    return Rubbing(meet, recall, sweep, give, WIDTH, SLOTS * NOTED)
