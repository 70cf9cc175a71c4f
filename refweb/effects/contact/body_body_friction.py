"""Damping and friction between two bodies, and how explicit kicks solve for them.

The law is that of `refweb.effects.contact.friction`, with the contacts of `refweb.effects.contact.body_body_detection`.
u is the velocity of the first body relative to the second at the contact point, half the depth below the surface of
each, so that a rolling sphere has no slip. F acts there on both bodies, with the moment a × F about the first body's
row at the arm a. `refweb.effects.contact_solver` solves for F in a kick; such a contact moves two rotations.

May change: how the kernels are written. Must stay: the law, which is that of `friction` and `contact_solver` and
changes in all three; `SLOTS`, the number of values of ``slot`` of a part in `body_body_detection`; the order of what
`kernels` returns, which `bodies` unpacks; kernel signatures. Tests: ``tests/effects/test_between_bodies.py``.
"""

from __future__ import annotations

import functools
import math

from ...kernels import DETECT, STIFFNESS, kernel
from ...net.rotation import times, times_transposed
from ..base import ImplicitContactKernels
from ..contact_solver import direction, friction_law, set_basis, set_part
from ..vectors import cross, dot
from .body_body_detection import frame_of, law_of, meeting, side_of, vector
from .body_body_penalty import force_of, push, slopes_of
from .contact_points import hessian_times
from .friction import facing, friction_force, turned_by
from .line_body_friction import levers

SLOTS = 3
"""Number of contacts of a part whose forces are kept."""


@kernel()
def place_of(contact, s):
    """Contact point of two bodies, from the row of one of them [m]."""
    g, y = vector(contact.normal), contact.points[s]
    size = math.sqrt(dot(g, g))
    path = contact.down / size if size > 0.0 else 0.0
    return y[0] + path * g[0], y[1] + path * g[1], y[2] + path * g[2]


@kernel()
def turned_velocity(v, data, cells, c, s, frame):
    """Angular velocity of a body [rad/s]."""
    spins, r = side_of(data, c, s).spins, cells[c, 2 + 2 * s]
    if spins == 0.0:
        return 0.0, 0.0, 0.0
    w = times(frame.axes, (v[r, 0], v[r, 1], v[r, 2]))
    w = hessian_times(frame.mobility, w) if spins == 2.0 else turned_by(frame.planar, w)
    return times_transposed(frame.axes, w)


@kernel()
def set_contact(contact, parts, point, x, cells, data, c):
    """Write a contact of pair c: its rows are those of both bodies, and of their rotations."""
    law, frame_a, frame_b = law_of(data, c), frame_of(x, cells, data, c, 0), frame_of(x, cells, data, c, 1)
    spins_a, spins_b = int(side_of(data, c, 0).spins), int(side_of(data, c, 1).spins)
    y, z = place_of(point, 0), place_of(point, 1)
    steep, g = facing(vector(point.normal))
    set_basis(contact, g if steep > 0.0 else (1.0, 0.0, 0.0))  # where nothing pushes any will do
    contact.cell, contact.owner, contact.tag, contact.group = c, c, point.slot, 1
    contact.normal_force, contact.damping = push(law, point.share, point.depth) * steep, law.damping * steep
    contact.friction, contact.slip_velocity, contact.wind[:] = law.friction, law.slip_velocity, 0.0
    for i in range(3):
        e = direction(contact, i)
        at = contact.first
        set_part(parts[at], cells[c, 0], i, e, e)
        rate, force = (-e[0], -e[1], -e[2]), (-e[0], -e[1], -e[2])
        set_part(parts[at + 1], cells[c, 1], i, rate, force)
        at += 2
        if spins_a:
            lever, arm = levers(e, y, frame_a, spins_a)
            rate, force = (-lever[0], -lever[1], -lever[2]), (-arm[0], -arm[1], -arm[2])
            set_part(parts[at], cells[c, 2], i, rate, force)
            at += 1
        if spins_b:
            rate, force = levers(e, z, frame_b, spins_b)
            set_part(parts[at], cells[c, 4], i, rate, force)
            at += 1
    contact.count = at - contact.first


@functools.cache
def kernels(first, second):
    """Force, stiffness, damping, and a function that makes the `ImplicitContactKernels` of numbers of parts."""
    space_of, detect = meeting(first, second)

    @kernel()
    def add_forces(x, v, f, cells, data, c, space):
        """Add the forces of a pair; their power [W], and the force on the second body [N]."""
        law, frame_a, frame_b = law_of(data, c), frame_of(x, cells, data, c, 0), frame_of(x, cells, data, c, 1)
        power, felt = 0.0, (0.0, 0.0, 0.0)
        a, b = cells[c, 0], cells[c, 1]
        w, o = turned_velocity(v, data, cells, c, 0, frame_a), turned_velocity(v, data, cells, c, 1, frame_b)
        for n in range(detect(0.0, x, cells, data, c, space)):
            contact = space.contacts[n]
            y, z = place_of(contact, 0), place_of(contact, 1)
            p, q = cross(w, y), cross(o, z)
            u = (
                v[a, 0] + p[0] - v[b, 0] - q[0],
                v[a, 1] + p[1] - v[b, 1] - q[1],
                v[a, 2] + p[2] - v[b, 2] - q[2],
            )
            friction = friction_force(law, push(law, contact.share, contact.depth), vector(contact.normal), u)
            power += dot(friction, u)
            felt = felt[0] - friction[0], felt[1] - friction[1], felt[2] - friction[2]
            for s in range(2):
                frame, arm, sign, spins = frame_a, y, 1.0, side_of(data, c, s).spins
                if s == 1:
                    frame, arm, sign = frame_b, z, -1.0
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
    def detect_all(x, cells, data, known, contacts, parts, begin):
        space, count = space_of(data), begin
        for c in range(cells.shape[0]):
            for m in range(detect(0.0, x, cells, data, c, space)):
                if count < contacts.size:
                    set_contact(contacts[count], parts, space.contacts[m], x, cells, data, c)
                count += 1
        return count

    return (
        force,
        stiffness,
        damping,
        lambda parts: ImplicitContactKernels(detect_all, friction_law, SLOTS * parts),
    )
