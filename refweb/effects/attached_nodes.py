"""Response of attached nodes to forces, for kicks that are solved for.

Such a node, at the arm a from the centre of mass of its body, has the velocity v + ω × a, and a force p on it is p and
the moment a × p on the body. Of a kick by p, with the mass M and the tensor of inertia J of the body as it stands,

    δv_node/δt = p/M + J⁻¹(a × p) × a,

as positions stay in a kick. In the rows of `refweb.net.rotation` J⁻¹ is W/I, W along the axes of space.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernels import kernel
from ..net.rotation import RigidRotations, matrix_at, times, times_transposed
from .vectors import cross

COLUMNS = 15
"""Number of columns of a node in the data of a cell: rows of the body and of its rotation, the first −1 of a node that
none carries; a and W at the start."""
_SPIN, _TURN, _ARM, _MOBILITY = 1, 2, 3, 6


class Carrier(NamedTuple):
    """The body that carries a node, as it stands.

    Attributes
    ----------
    row, spin : int
        Its row, and the first of its rotation.
    arm : tuple of 3 float
        a [m].
    turned, mobility : tuple of 3 tuples of 3 float
        Its rotation, and W at the start, by rows.
    """

    row: int
    spin: int
    arm: tuple
    turned: tuple
    mobility: tuple


def columns(net, nodes):
    """Numbers of nodes (cells, count) for the data of cells, shape (cells, count `COLUMNS`)."""
    turns, numbers = RigidRotations.of(net), np.zeros((len(net.points), COLUMNS))
    numbers[:, 0] = -1.0
    for (node, n), arm in zip(turns.carried, turns.arms, strict=True):
        numbers[node] = [*turns.rows[n], *arm, *turns.mobility[n].ravel()]
    return numbers[nodes].reshape(len(nodes), -1)


@kernel(forceinline=True)
def is_carried(data, c, at):
    """Tell if a body carries the node whose columns begin at ``at``."""
    return data[c, at] >= 0.0


@kernel(forceinline=True)
def carrier_of(x, data, c, at):
    """The `Carrier` of the node whose columns begin at ``at``."""
    spin, m, w = int(data[c, at + _SPIN]), at + _ARM, at + _MOBILITY
    turned = matrix_at(x, spin, int(data[c, at + _TURN]))
    return Carrier(
        int(data[c, at]),
        spin,
        times(turned, (data[c, m], data[c, m + 1], data[c, m + 2])),
        turned,
        (
            (data[c, w], data[c, w + 1], data[c, w + 2]),
            (data[c, w + 3], data[c, w + 4], data[c, w + 5]),
            (data[c, w + 6], data[c, w + 7], data[c, w + 8]),
        ),
    )


@kernel(forceinline=True)
def turn_by(carrier, moment):
    """W along the axes of space, times a moment."""
    return times(carrier.turned, times(carrier.mobility, times_transposed(carrier.turned, moment)))


@kernel(forceinline=True)
def speed_at(arm, velocity, turning):
    """v + ω × a."""
    across = cross(turning, arm)
    return velocity[0] + across[0], velocity[1] + across[1], velocity[2] + across[2]
