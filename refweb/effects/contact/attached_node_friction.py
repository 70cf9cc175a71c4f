"""Losses of contact, solved for in explicit kicks, of lines that end at nodes which bodies carry.

A force at such a line is one on the bodies that carry its nodes, and their moments are: what a contact moves are the
rows of its nodes, of the body that it touches, and of those that carry, each with its own part of J and of Jᵀ of
`refweb.effects.contact_solver`, see `refweb.effects.attached_nodes`. Of a body that is touched and carries too, both
parts are one.
"""

from __future__ import annotations

import math

from ...kernels import kernel
from ..attached_nodes import COLUMNS, carrier_of, is_carried, turn_by
from ..base import CELL, ImplicitContactKernels
from ..contact_solver import (
    ARMS,
    AXES,
    LEVERS,
    MIXED,
    NOTED,
    OWN,
    ROWS,
    SHARES,
    SLOTS,
    START,
    WIDTH,
    sweeping,
    warm_start,
)
from ..vectors import cross
from .line_body_friction import meeting, rows_of

RATES, PUSHES, PART = 1, 10, 19
"""Columns of a part, behind its row: what the velocity of that row adds to u along each direction, and what a force
along each direction adds to the force on it; number of columns."""
PARTS = 8
"""Largest number of parts: two nodes, the body that is touched and two that carry, and the rotations of these."""
WHOLE = WIDTH + PARTS * PART
"""Number of columns of what touches; parts stand behind the columns of `refweb.effects.contact_solver`."""


@kernel()
def add_part(touches, n, i, row, rate, push):
    """Add what a row has of direction i of a contact."""
    at = WIDTH
    while touches[n, at] >= 0.0 and touches[n, at] != row:
        at += PART
    if touches[n, at] < 0.0:
        touches[n, at : at + PART] = 0.0
        touches[n, at] = row
    for k in range(3):
        touches[n, at + RATES + 3 * i + k] += rate[k]
        touches[n, at + PUSHES + 3 * i + k] += push[k]


@kernel()
def add_node(touches, n, i, end, x, data, c):
    """Add what an end of the element has of direction i of a contact."""
    near, axis, row = touches[n, SHARES + end], AXES + 3 * i, int(touches[n, ROWS + end])
    g, at = (near * touches[n, axis], near * touches[n, axis + 1], near * touches[n, axis + 2]), data.shape[1]
    at -= (2 - end) * COLUMNS
    if not is_carried(data, c, at):
        add_part(touches, n, i, row, g, g)
        return
    carrier = carrier_of(x, data, c, at)
    moment = cross(carrier.arm, g)
    add_part(touches, n, i, row, (0.0, 0.0, 0.0), g)  # where it acts
    add_part(touches, n, i, carrier.row, g, g)
    add_part(touches, n, i, carrier.spin, turn_by(carrier, moment), moment)


@kernel()
def along(touches, n, i, rows):
    """Component along direction i of u, of velocities ``rows (rows, 3)``."""
    total = 0.0
    for m in range(PARTS):
        at = WIDTH + PART * m
        if touches[n, at] < 0.0:
            break
        row, rate = int(touches[n, at]), at + RATES + 3 * i
        for k in range(3):
            total += touches[n, rate + k] * rows[row, k]
    return total


@kernel()
def moved(touches, n, i, f, inverse):
    """Component along direction i of the acceleration by forces f."""
    total = 0.0
    for m in range(PARTS):
        at = WIDTH + PART * m
        if touches[n, at] < 0.0:
            break
        row, rate = int(touches[n, at]), at + RATES + 3 * i
        for k in range(3):
            total += touches[n, rate + k] * inverse[row, k] * f[row, k]
    return total


@kernel()
def apply_force(touches, n, p, q, s, f):
    """Add a force along the three directions to the rows of a contact."""
    for m in range(PARTS):
        at = WIDTH + PART * m
        if touches[n, at] < 0.0:
            break
        row, push = int(touches[n, at]), at + PUSHES
        for k in range(3):
            f[row, k] += p * touches[n, push + k] + q * touches[n, push + 3 + k] + s * touches[n, push + 6 + k]


@kernel()
def delassus(touches, n, i, j, inverse):
    """J M⁻¹ Jᵀ between two directions of a contact [1/kg]."""
    total = 0.0
    for m in range(PARTS):
        at = WIDTH + PART * m
        if touches[n, at] < 0.0:
            break
        row = int(touches[n, at])
        for k in range(3):
            total += touches[n, at + RATES + 3 * i + k] * inverse[row, k] * touches[n, at + PUSHES + 3 * j + k]
    return total


@kernel()
def turn_tangents(touches, n, at, cosine, sine):
    """Make the vectors of two tangents, which stand behind each other, those of tangents turned in their plane."""
    for k in range(at, at + 3):
        first, second = touches[n, k], touches[n, k + 3]
        touches[n, k], touches[n, k + 3] = cosine * first + sine * second, cosine * second - sine * first


@kernel()
def set_parts(touches, n, x, v, inverse, data):
    """Write the parts of a contact, with tangents between which J M⁻¹ Jᵀ has no mixed term, and all that follows."""
    for m in range(PARTS):
        touches[n, WIDTH + PART * m] = -1.0
    c, (_, _, body, spin) = int(touches[n, CELL]), rows_of(touches, n)
    for i in range(3):
        at, lever, arm = AXES + 3 * i, LEVERS + 3 * i, ARMS + 3 * i
        g = -touches[n, at], -touches[n, at + 1], -touches[n, at + 2]
        add_part(touches, n, i, body, g, g)
        if spin >= 0:
            rate = touches[n, lever], touches[n, lever + 1], touches[n, lever + 2]
            add_part(touches, n, i, spin, rate, (touches[n, arm], touches[n, arm + 1], touches[n, arm + 2]))
        for end in range(2):
            if touches[n, SHARES + end] > 0.0:
                add_node(touches, n, i, end, x, data, c)
    first, last = delassus(touches, n, 1, 1, inverse), delassus(touches, n, 2, 2, inverse)
    mixed = delassus(touches, n, 1, 2, inverse)
    if abs(mixed) > 1e-15 * (first + last):
        angle = 0.5 * math.atan2(2.0 * mixed, first - last)
        cosine, sine = math.cos(angle), math.sin(angle)
        turn_tangents(touches, n, AXES + 3, cosine, sine)
        for m in range(PARTS):
            at = WIDTH + PART * m
            if touches[n, at] < 0.0:
                break
            turn_tangents(touches, n, at + RATES + 3, cosine, sine)
            turn_tangents(touches, n, at + PUSHES + 3, cosine, sine)
    for i in range(3):
        touches[n, OWN + i], touches[n, START + i] = delassus(touches, n, i, i, inverse), along(touches, n, i, v)
    touches[n, MIXED], touches[n, MIXED + 1] = delassus(touches, n, 0, 1, inverse), delassus(touches, n, 0, 2, inverse)


sweep, (recall, commit) = sweeping(moved, apply_force), warm_start(along, apply_force)


def kernels(depth, pieces, functions, spins):
    """The `ImplicitContactKernels` of elements with two nodes, of which bodies carry some; see
    `refweb.effects.contact.line_body_friction`.

    Data have the columns of both nodes, see `refweb.effects.attached_nodes`, behind all others.
    """
    return ImplicitContactKernels(
        meeting(depth, pieces, functions, spins, set_parts), recall, sweep, commit, WHOLE, SLOTS * NOTED, True
    )
