"""Damping and friction between two bodies, and how explicit kicks solve for them.

The law is that of `refweb.effects.contact.friction`, with the contacts of `refweb.effects.contact.body_body_detection`.
u is the velocity of the first body relative to the second where they touch: half the depth below the surface of either,
so that a ball that rolls has none. F acts there on both, and has the moment a × F about the first body's row, a from
there. What is solved for in a kick is that of `refweb.effects.contact_solver`; a contact here moves two rotations.
"""

from __future__ import annotations

import functools
import math

from ...kernels import DETECT, STIFFNESS, kernel
from ...net.rotation import times, times_transposed
from ..base import CELL, ImplicitContactKernels
from ..contact_solver import (
    ARMS,
    AXES,
    DAMPING,
    FORCES,
    FRICTION,
    LEVERS,
    MIXED,
    NOTED,
    OWN,
    PUSH,
    ROWS,
    SLIP,
    SLOT,
    START,
    THETA,
    WIDTH,
    fitted,
    sweeping,
    warm_start,
)  # fmt: skip
from ..vectors import cross, dot
from .body_body_detection import (
    DOWN,
    FIRST,
    NORMAL,
    SECOND,
    SHARE,
    SIDE,
    SIDES,
    SPINS,
    frame_of,
    law_of,
    meeting,
    vector_at,
)
from .body_body_detection import SLOT as WHICH
from .body_body_penalty import force_of, push, slopes_of
from .contact_points import hessian_times
from .friction import facing, friction_force, turned_by
from .line_body_friction import direction, mixture

LEVERS_OF_SECOND, ARMS_OF_SECOND, WHOLE = WIDTH, WIDTH + 9, WIDTH + 18
"""Columns of what touches, behind those of `refweb.effects.contact_solver`: as there of the second body, whose row of
rotation stands last among ``ROWS``; and their number."""
SLOTS = 3
"""Number of contacts of a part that are remembered."""


@kernel(forceinline=True)
def rows_of(touches, n):
    """Rows of both bodies and of their rotations, −1 without."""
    return int(touches[n, ROWS]), int(touches[n, ROWS + 1]), int(touches[n, ROWS + 2]), int(touches[n, ROWS + 3])


@kernel(forceinline=True)
def along(touches, n, i, rows):
    """Component along direction i of u, of velocities ``rows (rows, 3)``."""
    a, b, spin, row_b = rows_of(touches, n)
    at, lever, second, total = AXES + 3 * i, LEVERS + 3 * i, LEVERS_OF_SECOND + 3 * i, 0.0
    for k in range(3):
        total += touches[n, at + k] * (rows[a, k] - rows[b, k])
        if spin >= 0:
            total += touches[n, lever + k] * rows[spin, k]
        if row_b >= 0:
            total += touches[n, second + k] * rows[row_b, k]
    return total


@kernel(forceinline=True)
def moved(touches, n, i, f, inverse):
    """Component along direction i of the acceleration by forces f."""
    a, b, spin, row_b = rows_of(touches, n)
    at, lever, second, total = AXES + 3 * i, LEVERS + 3 * i, LEVERS_OF_SECOND + 3 * i, 0.0
    for k in range(3):
        total += touches[n, at + k] * (inverse[a, k] * f[a, k] - inverse[b, k] * f[b, k])
        if spin >= 0:
            total += touches[n, lever + k] * inverse[spin, k] * f[spin, k]
        if row_b >= 0:
            total += touches[n, second + k] * inverse[row_b, k] * f[row_b, k]
    return total


@kernel(forceinline=True)
def apply_force(touches, n, p, q, s, f):
    """Add a force along the three directions to the rows of a contact."""
    a, b, spin, row_b = rows_of(touches, n)
    for k in range(3):
        force = p * touches[n, AXES + k] + q * touches[n, AXES + 3 + k] + s * touches[n, AXES + 6 + k]
        f[a, k] += force
        f[b, k] -= force
        if spin >= 0:
            f[spin, k] += p * touches[n, ARMS + k] + q * touches[n, ARMS + 3 + k] + s * touches[n, ARMS + 6 + k]
        if row_b >= 0:
            at = ARMS_OF_SECOND + k
            f[row_b, k] += p * touches[n, at] + q * touches[n, at + 3] + s * touches[n, at + 6]


@kernel()
def place_of(contacts, n, s):
    """Contact point of two bodies, from the row of one of them [m]."""
    g = vector_at(contacts, n, NORMAL)
    size = math.sqrt(dot(g, g))
    y, path = vector_at(contacts, n, FIRST if s == 0 else SECOND), contacts[n, DOWN] / size if size > 0.0 else 0.0
    return y[0] + path * g[0], y[1] + path * g[1], y[2] + path * g[2]


@kernel()
def turned_velocity(v, data, cells, c, s, frame):
    """Angular velocity of a body [rad/s]."""
    spins, r = data[c, SIDES + SIDE * s + SPINS], cells[c, 2 + 2 * s]
    if spins == 0.0:
        return 0.0, 0.0, 0.0
    w = times(frame.axes, (v[r, 0], v[r, 1], v[r, 2]))
    w = hessian_times(frame.mobility, w) if spins == 2.0 else turned_by(frame.planar, w)
    return times_transposed(frame.axes, w)


@kernel(forceinline=True)
def delassus(touches, n, i, j, inverse):
    """J M⁻¹ Jᵀ between two directions of a contact [1/kg]."""
    a, b, spin, row_b = rows_of(touches, n)
    total = 0.0
    for k in range(3):
        total += touches[n, AXES + 3 * i + k] * touches[n, AXES + 3 * j + k] * (inverse[a, k] + inverse[b, k])
        if spin >= 0:
            total += touches[n, ARMS + 3 * i + k] * touches[n, LEVERS + 3 * j + k] * inverse[spin, k]
        if row_b >= 0:
            at = touches[n, ARMS_OF_SECOND + 3 * i + k] * touches[n, LEVERS_OF_SECOND + 3 * j + k]
            total += at * inverse[row_b, k]
    return total


@kernel(forceinline=True)
def set_direction(touches, n, i, first, second):
    """Write direction i of a contact, as either body has it."""
    for k in range(3):
        touches[n, AXES + 3 * i + k] = first.axis[k]
        touches[n, LEVERS + 3 * i + k], touches[n, ARMS + 3 * i + k] = -first.lever[k], -first.arm[k]
        touches[n, LEVERS_OF_SECOND + 3 * i + k] = second.lever[k]
        touches[n, ARMS_OF_SECOND + 3 * i + k] = second.arm[k]


@kernel()
def set_touch(touches, n, contacts, m, x, v, inverse, cells, data, c):
    """Write all that sweeps ask of contact m of pair c.

    The two tangents are those between which J M⁻¹ Jᵀ has no mixed term.
    """
    law, frame_a, frame_b = law_of(data, c), frame_of(x, cells, data, c, 0), frame_of(x, cells, data, c, 1)
    spins = int(data[c, SIDES + SPINS]), int(data[c, SIDES + SIDE + SPINS])
    touches[n, CELL], touches[n, ROWS], touches[n, ROWS + 1] = c, cells[c, 0], cells[c, 1]
    touches[n, ROWS + 2] = cells[c, 2] if spins[0] else -1
    touches[n, ROWS + 3] = cells[c, 4] if spins[1] else -1
    y, z = place_of(contacts, m, 0), place_of(contacts, m, 1)
    steep, g = facing(vector_at(contacts, m, NORMAL))
    g = g if steep > 0.0 else (1.0, 0.0, 0.0)  # nothing pushes
    e = cross(g, (1.0, 0.0, 0.0) if abs(g[0]) < 0.6 else (0.0, 1.0, 0.0))
    size = math.sqrt(dot(e, e))
    e = e[0] / size, e[1] / size, e[2] / size
    h = cross(g, e)
    set_direction(touches, n, 0, direction(g, y, frame_a, spins[0]), direction(g, z, frame_b, spins[1]))
    tangent_a, tangent_b = direction(e, y, frame_a, spins[0]), direction(e, z, frame_b, spins[1])
    binormal_a, binormal_b = direction(h, y, frame_a, spins[0]), direction(h, z, frame_b, spins[1])
    set_direction(touches, n, 1, tangent_a, tangent_b)
    set_direction(touches, n, 2, binormal_a, binormal_b)
    first, last = delassus(touches, n, 1, 1, inverse), delassus(touches, n, 2, 2, inverse)
    mixed = delassus(touches, n, 1, 2, inverse)
    if abs(mixed) > 1e-15 * (first + last):
        angle = 0.5 * math.atan2(2.0 * mixed, first - last)
        c1, s1 = math.cos(angle), math.sin(angle)
        set_direction(touches, n, 1, mixture(c1, tangent_a, s1, binormal_a), mixture(c1, tangent_b, s1, binormal_b))
        set_direction(touches, n, 2, mixture(c1, binormal_a, -s1, tangent_a), mixture(c1, binormal_b, -s1, tangent_b))
    for i in range(3):
        touches[n, OWN + i] = delassus(touches, n, i, i, inverse)
        touches[n, START + i], touches[n, FORCES + i] = along(touches, n, i, v), 0.0
    touches[n, MIXED], touches[n, MIXED + 1] = delassus(touches, n, 0, 1, inverse), delassus(touches, n, 0, 2, inverse)
    touches[n, PUSH], touches[n, DAMPING] = push(law, contacts, m, SHARE) * steep, law.damping * steep
    touches[n, FRICTION], touches[n, SLIP], touches[n, THETA + 1] = law.friction, law.slip_velocity, 1.0
    touches[n, SLOT] = contacts[m, WHICH]


sweep, (recall, commit) = sweeping(moved, apply_force), warm_start(along, apply_force)


@functools.cache
def kernels(first, second):
    """Force, stiffness, damping, and a function that makes the `ImplicitContactKernels` of numbers of parts."""
    space_of, detect = meeting(first, second)

    @kernel()
    def add_forces(x, v, f, cells, data, c, space):
        """Add the forces of a pair; their power [W], and the force on the second body [N]."""
        law, frame_a, frame_b = law_of(data, c), frame_of(x, cells, data, c, 0), frame_of(x, cells, data, c, 1)
        power, felt = 0.0, (0.0, 0.0, 0.0)
        a, b, contacts = cells[c, 0], cells[c, 1], space.contacts
        w, o = turned_velocity(v, data, cells, c, 0, frame_a), turned_velocity(v, data, cells, c, 1, frame_b)
        for n in range(detect(0.0, x, cells, data, c, space)):
            y, z = place_of(contacts, n, 0), place_of(contacts, n, 1)
            p, q = cross(w, y), cross(o, z)
            u = (
                v[a, 0] + p[0] - v[b, 0] - q[0],
                v[a, 1] + p[1] - v[b, 1] - q[1],
                v[a, 2] + p[2] - v[b, 2] - q[2],
            )
            friction = friction_force(law, push(law, contacts, n, SHARE), vector_at(contacts, n, NORMAL), u)
            power += dot(friction, u)
            felt = felt[0] - friction[0], felt[1] - friction[1], felt[2] - friction[2]
            for s in range(2):
                frame, arm, sign, spins = (frame_a, y, 1.0, data[c, SIDES + SPINS])
                if s == 1:
                    frame, arm, sign, spins = (frame_b, z, -1.0, data[c, SIDES + SIDE + SPINS])
                for k in range(3):
                    f[cells[c, s], k] += sign * friction[k]
                if spins > 0.0:
                    moment = turned_by(frame.planar, times(frame.axes, cross(arm, friction)))
                    moment = times_transposed(frame.axes, moment)
                    for k in range(3):
                        f[cells[c, 2 + 2 * s], k] += sign * moment[k]
        return power, felt

    slopes, force = slopes_of(space_of, add_forces), force_of(space_of, add_forces)

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        blocks[:] = 0.0
        if not definite:
            slopes(x, v, blocks, cells, data, False)

    @kernel(STIFFNESS)
    def damping(t, x, v, blocks, cells, data, definite):
        slopes(x, v, blocks, cells, data, True)

    @kernel(DETECT)
    def meeting_all(h, x, v, inverse, cells, data, touches, begin):
        space, count = space_of(data), begin
        for c in range(cells.shape[0]):
            for m in range(detect(0.0, x, cells, data, c, space)):
                if count < touches.shape[0]:
                    set_touch(touches, count, space.contacts, m, x, v, inverse, cells, data, c)
                    z = h * touches[count, OWN] * touches[count, PUSH] * touches[count, DAMPING]
                    touches[count, THETA] = fitted(z)
                count += 1
        return count

    return (
        force,
        stiffness,
        damping,
        lambda parts: ImplicitContactKernels(meeting_all, recall, sweep, commit, WHOLE, NOTED * SLOTS * parts),
    )
