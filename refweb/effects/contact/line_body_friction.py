"""Damping and friction of lines on bodies in explicit kicks.

`refweb.effects.contact_solver` solves for them; this module detects the contacts.

Lines that end at one node touch a body there at one point, with one normal and one slip. They are one contact with the
sum of their forces, so that sweeps need not distribute the force among them.

May change: how the kernel is written. Must stay: tags 0 between the ends of an element, 1 and 2 at them, by which
`contact_solver` finds the force of the step before; the body as the second part of a contact at an end, which `detect`
compares; `SLOTS`, the limit in `contact_points`; `levers`, which `body_body_friction` calls; the order of contacts,
which decides the last digits of results; `kernels`, which `table` imports. Tests:
``tests/effects/test_contact_losses.py``.
"""

from __future__ import annotations

import functools

import numpy as np

from ...kernels import DETECT, kernel
from ...net.rotation import times, times_transposed
from ..base import ImplicitContactKernels
from ..contact_solver import direction, friction_law, set_basis, set_part
from ..vectors import cross, dot
from .contact_points import hessian_times, places, set_place
from .friction import facing
from .nearest_point import share
from .pair import LINE_CONTACT
from .penalty import rubbed_by

SLOTS = 3
"""Largest number of contacts of a cell: one in between, and one at each end."""


@kernel(forceinline=True)
def levers(axis, y, pair, spins):
    """(J, Jᵀ) of the rotation of a body along an axis, at y from its centre; a ring turns about its normal alone."""
    arm = cross(axis, y)
    if pair.planar:
        normal = pair.axes[2]
        turn = dot(arm, normal)
        arm = turn * normal[0], turn * normal[1], turn * normal[2]
    if spins == 2:
        return times_transposed(pair.axes, hessian_times(pair.mobility, times(pair.axes, arm))), arm
    return arm, arm


@kernel(forceinline=True)
def set_contact(contact, parts, touch, cells, spins, functions):
    """Write a contact of an element with two nodes: its rows are nodes that feel it, the body and its rotation."""
    c, pair = touch.c, touch.pair
    steep, g = facing(times_transposed(pair.axes, touch.spot.gradient))
    y = times_transposed(pair.axes, touch.spot.y)
    set_basis(contact, g if steep > 0.0 else (1.0, 0.0, 0.0))  # where nothing pushes any will do
    contact.cell, contact.owner, contact.group = c, c, 1
    contact.tag = 0 if touch.inner or pair.once else 1 if touch.xi < 0.5 else 2
    at = contact.first
    contact.normal_force, contact.damping = rubbed_by(touch) * steep, pair.damping * steep
    contact.friction, contact.slip_velocity, contact.wind[:] = pair.friction, pair.slip_velocity, 0.0
    for end in range(2):
        part = share(end, 2, functions, touch.xi)[0]
        if part != 0.0:
            for i in range(3):
                e = direction(contact, i)
                e = part * e[0], part * e[1], part * e[2]
                set_part(parts[at], cells[c, end], i, e, e)
            at += 1
    for i in range(3):
        e = direction(contact, i)
        rate, force = (-e[0], -e[1], -e[2]), (-e[0], -e[1], -e[2])
        set_part(parts[at], cells[c, 2], i, rate, force)
        if spins:
            rate, force = levers(e, y, pair, spins)
            set_part(parts[at + 1], cells[c, 3], i, rate, force)
    contact.count = at - contact.first + (2 if spins else 1)


@kernel(forceinline=True)
def take_known(known, first, pieces, buffer):
    """Write the contacts of a line that the push has found, in the order in which it does; their number."""
    count = 0
    for c in range(first, first + pieces):
        xi, ends = known[c, 0], int(known[c, 1])
        if xi > 0.0:
            set_place(buffer[count], c, xi, 1.0)
            count += 1
        for end in range(2):
            if ends & (1 << end):
                set_place(buffer[count], c, float(end), 0.0)
                count += 1
    return count


def kernels(depth, pieces, functions, spins):
    """The `ImplicitContactKernels` of elements with two nodes.

    Parameters
    ----------
    depth, pieces, functions, spins
        See `refweb.effects.contact.friction.kernels`.
    """
    return ImplicitContactKernels(detecting(depth, pieces, functions, spins), friction_law, SLOTS)


@functools.cache
def detecting(depth, pieces, functions, spins):
    """The kernel that detects contacts of elements with two nodes, with the parameters of `kernels`."""
    _, contacts_of, touch_of, limit = places(depth, spins, pieces, 2, functions)

    @kernel(DETECT)
    def detect(x, cells, data, known, contacts, parts, begin):
        buffer, count = np.empty(limit * pieces, LINE_CONTACT), begin
        at_node = np.full(x.shape[0], -1)
        for first in range(0, cells.shape[0], pieces):
            if known.shape[1]:
                touching = take_known(known, first, pieces, buffer)
            else:
                touching = contacts_of(x, cells, data, first, buffer)
            for n in range(touching):
                if count < contacts.size:
                    touch = touch_of(x, cells, data, buffer, n)
                    if not touch.inner:
                        node = cells[touch.c, 0 if touch.xi < 0.5 else 1]
                        same = at_node[node]
                        if same >= 0 and parts[contacts[same].first + 1].row == cells[touch.c, 2]:
                            contacts[same].normal_force += rubbed_by(touch) * facing(touch.spot.gradient)[0]
                            continue
                        at_node[node] = count
                    set_contact(contacts[count], parts, touch, cells, spins, functions)
                count += 1
        return count

    return detect
