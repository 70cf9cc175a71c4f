"""Drag on nodes that bodies carry, solved for in explicit kicks.

They answer to forces as `refweb.effects.attached_nodes` has it: in the equations of `refweb.effects.drag.implicit_drag`
a full matrix stands in place of M⁻¹. Nodes of one body feel each other's drag, and that on the body, and take a few
sweeps.
"""

from __future__ import annotations

from ...kernels import kernel
from ...net.rotation import times
from ..attached_nodes import COLUMNS, carrier_of, is_carried, speed_at, turn_by
from ..vectors import cross
from . import implicit_drag
from .implicit_drag import WIDTH, rubbing, solving

BODY, SPIN, ARM, MOBILITY, WHOLE = WIDTH, WIDTH + 1, WIDTH + 2, WIDTH + 5, WIDTH + 14
"""Columns of what feels drag, behind those of `refweb.effects.drag.implicit_drag`: rows of the body, −1 without, and of
its
rotation; the arm of the node; W of `refweb.net.rotation` along the axes of space; number of columns."""


@kernel(forceinline=True)
def arm(touches, n):
    return touches[n, ARM], touches[n, ARM + 1], touches[n, ARM + 2]


@kernel(forceinline=True)
def turned(touches, n, moment):
    """W times a moment."""
    at = MOBILITY
    rows = (
        (touches[n, at], touches[n, at + 1], touches[n, at + 2]),
        (touches[n, at + 3], touches[n, at + 4], touches[n, at + 5]),
        (touches[n, at + 6], touches[n, at + 7], touches[n, at + 8]),
    )
    return times(rows, moment)


@kernel()
def at_arm(touches, n, force, moment, inverse):
    """Acceleration of a node by a force and a moment on the body that carries it."""
    row, turning, a = int(touches[n, BODY]), turned(touches, n, moment), inverse[int(touches[n, SPIN]), 0]
    change = inverse[row, 0] * force[0], inverse[row, 1] * force[1], inverse[row, 2] * force[2]
    return speed_at(arm(touches, n), change, (a * turning[0], a * turning[1], a * turning[2]))


@kernel()
def speeds_up(touches, n, f, inverse):
    """Tell if speeds grow, as `refweb.effects.drag.implicit_drag.speeds_up` does."""
    row, spin = int(touches[n, BODY]), int(touches[n, SPIN])
    if row < 0:
        return implicit_drag.speeds_up(touches, n, f, inverse)
    force, moment = (f[row, 0], f[row, 1], f[row, 2]), (f[spin, 0], f[spin, 1], f[spin, 2])
    return at_arm(touches, n, force, moment, inverse)


@kernel()
def answer(touches, n, p, inverse):
    """Compute the response, as `refweb.effects.drag.implicit_drag.answer` does."""
    if touches[n, BODY] < 0.0:
        return implicit_drag.answer(touches, n, p, inverse)
    return at_arm(touches, n, p, cross(arm(touches, n), p), inverse)


@kernel()
def push(touches, n, p, f):
    """Add the force as `refweb.effects.drag.implicit_drag.push` does; it stands at the node as well."""
    implicit_drag.push(touches, n, p, f)
    if touches[n, BODY] >= 0.0:
        row, spin, moment = int(touches[n, BODY]), int(touches[n, SPIN]), cross(arm(touches, n), p)
        for k in range(3):
            f[row, k] += p[k]
            f[spin, k] += moment[k]


@kernel()
def set_carrier(touches, n, x, data, c):
    """Write the body that carries the row of touch n."""
    at = data.shape[1] - COLUMNS
    touches[n, BODY] = touches[n, SPIN] = -1.0
    if is_carried(data, c, at):
        carrier = carrier_of(x, data, c, at)
        touches[n, BODY], touches[n, SPIN] = carrier.row, carrier.spin
        for k in range(3):
            unit = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
            column = turn_by(carrier, unit)  # a row as well: W is symmetric
            touches[n, ARM + k] = carrier.arm[k]
            for j in range(3):
                touches[n, MOBILITY + 3 * k + j] = column[j]


sweep = solving(speeds_up, answer, push)


def carrying(nodes):
    """The `ImplicitContactKernels` of cells of so many nodes, the first of which bodies may carry.

    Data have the columns of `refweb.effects.attached_nodes` behind all others.
    """
    return rubbing(nodes, set_carrier, sweep, WHOLE)
