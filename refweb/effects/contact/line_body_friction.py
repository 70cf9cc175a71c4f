"""Losses of contact of lines with bodies, solved for where an explicit method kicks velocities.

How they are solved for is in `refweb.effects.contact_solver`; here is what touches, and what a force does there.

Lines that end at one node touch a body there at one point, with one normal and one slip. They are one contact of their
pushes together: its forces are the sum of theirs, and sweeps need not settle which of them bears how much.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from ...kernels import DETECT, kernel
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
    SHARES,
    SLIP,
    SLOT,
    SLOTS,
    START,
    THETA,
    WIDTH,
    fitted,
    sweeping,
    warm_start,
)  # fmt: skip
from ..vectors import cross, dot
from .contact_points import hessian_times, places
from .friction import facing
from .nearest_point import share
from .penalty import rubbed_by


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
def apply_force(touches, n, p, q, s, f):
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
def delassus(first, second, light, lighter):
    """J M⁻¹ Jᵀ between two directions [1/kg], by that of the places and that of the rotation along the axes."""
    p, q, r, s = first.axis, second.axis, first.arm, second.lever
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
def set_direction(touches, n, i, given):
    """Write direction i of a contact."""
    for k in range(3):
        touches[n, AXES + 3 * i + k], touches[n, LEVERS + 3 * i + k] = given.axis[k], given.lever[k]
        touches[n, ARMS + 3 * i + k] = given.arm[k]


@kernel(forceinline=True)
def set_touch(touches, n, touch, cells, v, inverse, spins, functions):
    """Write all that sweeps ask of a contact of an element with two nodes, but θ of the normal.

    The two tangents are those between which J M⁻¹ Jᵀ has no mixed term.
    """
    c, pair = touch.c, touch.pair
    a, b, body, spin = cells[c, 0], cells[c, 1], cells[c, 2], cells[c, 3] if spins else -1
    touches[n, CELL], touches[n, ROWS], touches[n, ROWS + 1], touches[n, ROWS + 2] = c, a, b, body
    touches[n, ROWS + 3] = spin
    near, far = share(0, 2, functions, touch.xi)[0], share(1, 2, functions, touch.xi)[0]
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
    normal = direction(g, y, pair, spins)
    tangent, binormal = direction(e, y, pair, spins), direction(cross(g, e), y, pair, spins)
    first, last = delassus(tangent, tangent, light, lighter), delassus(binormal, binormal, light, lighter)
    mixed = delassus(tangent, binormal, light, lighter)
    if abs(mixed) > 1e-15 * (first + last):
        angle = 0.5 * math.atan2(2.0 * mixed, first - last)
        cosine, sine = math.cos(angle), math.sin(angle)
        tangent, binormal = mixture(cosine, tangent, sine, binormal), mixture(cosine, binormal, -sine, tangent)
        first, last = delassus(tangent, tangent, light, lighter), delassus(binormal, binormal, light, lighter)
    set_direction(touches, n, 0, normal)
    set_direction(touches, n, 1, tangent)
    set_direction(touches, n, 2, binormal)
    touches[n, OWN], touches[n, OWN + 1], touches[n, OWN + 2] = delassus(normal, normal, light, lighter), first, last
    touches[n, MIXED] = delassus(normal, tangent, light, lighter)
    touches[n, MIXED + 1] = delassus(normal, binormal, light, lighter)
    for i in range(3):
        touches[n, START + i] = along(touches, n, i, v)
        touches[n, FORCES + i] = 0.0
    touches[n, PUSH], touches[n, DAMPING] = rubbed_by(touch) * steep, pair.damping * steep
    touches[n, FRICTION], touches[n, SLIP] = pair.friction, pair.slip_velocity
    touches[n, THETA + 1] = 1.0
    touches[n, SLOT] = 0.0 if touch.inner or pair.once else 1.0 if touch.xi < 0.5 else 2.0


sweep, (recall, commit) = sweeping(moved, apply_force), warm_start(along, apply_force)


@kernel()
def alone(touches, n, x, v, inverse, data):
    """Nothing is to be added to a contact."""


@functools.cache
def meeting(depth, pieces, functions, spins, more=alone):
    """Kernel that writes what touches, of elements with two nodes, and lets ``more`` see each.

    Parameters
    ----------
    depth, pieces, functions, spins
        See `refweb.effects.contact.friction.kernels`.
    more : kernel
        Has the arguments of `alone`.
    """
    _, _, contacts, touch_of, (limit, columns) = places(depth, spins)

    @kernel(DETECT)
    def detect(h, x, v, inverse, cells, data, touches, begin):
        buffer, count = np.empty((limit * pieces, columns)), begin
        at_node = np.full(x.shape[0], -1)
        for first in range(0, cells.shape[0], pieces):
            for n in range(contacts(x, cells, data, first, pieces, 2, functions, buffer)):
                if count < touches.shape[0]:
                    touch = touch_of(x, cells, data, 2, functions, buffer, n)
                    if not touch.inner:
                        node = cells[touch.c, 0 if touch.xi < 0.5 else 1]
                        row = at_node[node]
                        if row >= 0 and int(touches[row, ROWS + 2]) == cells[touch.c, 2]:
                            touches[row, PUSH] += rubbed_by(touch) * facing(touch.spot.gradient)[0]
                            continue
                        at_node[node] = count
                    set_touch(touches, count, touch, cells, v, inverse, spins, functions)
                    more(touches, count, x, v, inverse, data)
                count += 1
        for n in range(begin, min(count, touches.shape[0])):
            touches[n, THETA] = fitted(h * touches[n, OWN] * touches[n, PUSH] * touches[n, DAMPING])
        return count

    return detect


def kernels(depth, pieces, functions, spins):
    """The `ImplicitContactKernels` of elements with two nodes.

    Parameters
    ----------
    depth, pieces, functions, spins
        See `refweb.effects.contact.friction.kernels`.
    """
    return ImplicitContactKernels(meeting(depth, pieces, functions, spins), recall, sweep, commit, WIDTH, SLOTS * NOTED)
