"""Drag in explicit kicks: an implicit equation for each node.

A kick of size h changes the velocity of a node from v⁻ to v⁺ = v⁻ + h M⁻¹(f + F(u)), with all other forces f and the
mean u of both velocities relative to the wind. This is the midpoint rule, which dissipates h F·v for any h. For a node
the equation is

    u = u⁻ + ½h M⁻¹(f + F(u)),

Its solution is unique, since −F is the gradient of a convex function of u. Newton's method starts from velocities
without drag, or with the drag of the sweep before. Equations of different nodes are independent, so that one sweep
solves all of them. Nodes that are attached to one body are an exception: M⁻¹ is then the block J M⁻¹ Jᵀ of
`refweb.effects.contact_solver`, and their equations are coupled, which takes a few sweeps.

May change: `MOST_STEPS` and `CLOSE`. Must stay: the force, which is that of `force`; that contacts of a row stand
together and the first has their number as ``group``, which `contact_solver` reads; signatures `DETECT` and `LAW`;
`implicit_drag`, which `table` imports. Tests: ``tests/effects/test_drag.py``.
"""

from __future__ import annotations

import functools

from ...compiled.rows import record_at
from ...kernels import DETECT, LAW, kernel
from ..base import ImplicitContactKernels
from ..contact_solver import acceleration, apply_force, set_part, way_of
from ..line_kernels import direction
from ..vectors import add, solve
from .force import drag_on, end_of, slope_of

MOST_STEPS, CLOSE = 60, 4e-16
"""Largest number of steps of Newton's method, and its tolerance relative to velocities."""


@kernel(forceinline=True)
def response(contact, p):
    """Acceleration of the node of a contact by a force p on it."""
    d = contact.delassus
    return (
        d[0, 0] * p[0] + d[0, 1] * p[1] + d[0, 2] * p[2],
        d[1, 0] * p[0] + d[1, 1] * p[1] + d[1, 2] * p[2],
        d[2, 0] * p[0] + d[2, 1] * p[1] + d[2, 2] * p[2],
    )


@kernel(forceinline=True)
def numbers_of(contact):
    """(t, c_n, c_t) of a contact."""
    return (contact.tangent[0], contact.tangent[1], contact.tangent[2]), contact.drag[0], contact.drag[1]


@kernel(forceinline=True)
def newton_step(h, n, count, u, rest, contacts):
    """Step of Newton's method with the residual ``rest`` of the equation at the velocity u."""
    node, a, b, c = contacts[n], (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for m in range(n, n + count):
        t, normal, tangential = numbers_of(contacts[m])
        slope = slope_of(t, u, normal, tangential)
        a, b, c = add(a, slope[0]), add(b, slope[1]), add(c, slope[2])
    p, q, s = response(node, a), response(node, b), response(node, c)
    p, q, s = (
        (1.0 + 0.5 * h * p[0], 0.5 * h * p[1], 0.5 * h * p[2]),
        (0.5 * h * q[0], 1.0 + 0.5 * h * q[1], 0.5 * h * q[2]),
        (0.5 * h * s[0], 0.5 * h * s[1], 1.0 + 0.5 * h * s[2]),
    )
    return solve(p, q, s, rest)


@kernel(LAW, leaf=True)
def drag_law(h, number, first, end, f, inverse, contacts, parts):
    """Law of drag, for all contacts of one row together, see `drag_row`."""
    largest = 0.0
    for n in range(first, end, way_of(first, end)):
        largest = max(largest, drag_row(h, n, f, inverse, contacts, parts))
    return largest


@kernel(leaf=True)
def drag_row(h, n, f, inverse, contacts, parts):
    """Find the drag of all contacts of one row; the first of these has their force."""
    node, count = contacts[n], contacts[n].group
    if count == 0:
        return 0.0
    before, rate = (node.force[0], node.force[1], node.force[2]), acceleration(node, parts, f, inverse)
    u = (
        node.velocity[0] + 0.5 * h * rate[0],
        node.velocity[1] + 0.5 * h * rate[1],
        node.velocity[2] + 0.5 * h * rate[2],
    )
    force = change = response(node, before)
    ahead = u[0] - 0.5 * h * change[0], u[1] - 0.5 * h * change[1], u[2] - 0.5 * h * change[2]
    for _ in range(MOST_STEPS):
        force = 0.0, 0.0, 0.0
        for m in range(n, n + count):
            t, normal, tangential = numbers_of(contacts[m])
            force = add(force, drag_on(t, u, normal, tangential))
        change = response(node, force)
        rest = (
            ahead[0] - u[0] + 0.5 * h * change[0],
            ahead[1] - u[1] + 0.5 * h * change[1],
            ahead[2] - u[2] + 0.5 * h * change[2],
        )
        size = max(abs(u[0]), abs(u[1]), abs(u[2]), abs(ahead[0]), abs(ahead[1]), abs(ahead[2]))
        if not max(abs(rest[0]), abs(rest[1]), abs(rest[2])) > CLOSE * size:
            break
        u = add(u, newton_step(h, n, count, u, rest, contacts))
    node.force[0], node.force[1], node.force[2] = force
    more = force[0] - before[0], force[1] - before[1], force[2] - before[2]
    apply_force(node, parts, more[0], more[1], more[2], f)
    change = response(node, more)
    return h * max(abs(change[0]), abs(change[1]), abs(change[2]))


@functools.cache
def implicit_drag(nodes):
    """The `ImplicitContactKernels` of cells of so many nodes, where those of a row stand together."""
    End = end_of(nodes)

    @kernel(DETECT)
    def detect(x, cells, data, known, contacts, parts, begin):
        for c in range(cells.shape[0] if begin + cells.shape[0] <= contacts.size else 0):
            contact, end = contacts[begin + c], record_at(End, data, c, 0)
            t, _ = direction(x, cells, c, end)
            contact.cell, contact.owner, contact.group = c, c, int(end.group)
            contact.drag[0], contact.drag[1] = end.normal, end.tangential
            for k in range(3):
                contact.tangent[k] = t[k]
            contact.count = 1 if contact.group else 0
            if contact.group == 0:
                continue
            contact.tag, contact.normal_force, contact.damping = 0, 0.0, 0.0
            for k in range(3):
                unit = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
                set_part(parts[contact.first], cells[c, 0], k, unit, unit)
                contact.wind[k] = end.wind[k]
                for j in range(3):
                    contact.basis[k, j] = unit[j]
        return begin + cells.shape[0]

    return ImplicitContactKernels(detect, drag_law, slots=1, parts=1)
