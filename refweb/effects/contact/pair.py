"""Numbers of a pair, one element and one body, as the kernels of contact read them.

Data of a cell begin with the columns `RADIUS` to `AWAY`, and vectors from the centre to the cell's nodes in the web's
position; behind these stands the rest of a `Pair`, which spheres alone do not need.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernels import kernel
from ...net.rigid_body import Grown

RADIUS, PENALTY, AWAY = 0, 1, 2
"""Columns of data: radius of a sphere around the body [m], stiffness of the penalty, first of the vectors."""
_EXPONENT, _DAMPING, _FRICTION, _SLIP, _GROWTH, _CORE, _ROUND, _ONCE, _PLANAR, _AXES = 0, 1, 2, 3, 4, 5, 8, 9, 10, 11
"""Columns behind the vectors."""


class Pair(NamedTuple):
    """What is known of an element and a body.

    Attributes
    ----------
    stiffness, exponent : float
        Of the penalty, [N/m^p] and p.
    damping, friction, slip_velocity : float
        Of `refweb.effects.contact.friction`, [s/m], [1], [m/s].
    shape : refweb.net.rigid_body.Grown
        Core of the body, and the radius of its growth.
    axes : tuple of 3 tuples of 3 float
        Unit vectors of the body's axes.
    once, planar : bool
        As in `refweb.net.rigid_body.Shape`.
    """

    stiffness: float
    exponent: float
    damping: float
    friction: float
    slip_velocity: float
    shape: Grown
    axes: tuple
    once: bool
    planar: bool


def pair_data(body, cells, points, law):
    """Data of the contact of elements with a body, shape (cells, columns).

    Parameters
    ----------
    body : refweb.net.rigid_body.RigidBody
        The body.
    cells : ndarray of int, shape (cells, nodes)
        Rows along each element.
    points : ndarray, shape (rows, 3)
        Reference positions [m].
    law : tuple of 5 float
        Stiffness, exponent, damping, friction and slip velocity, as in `Pair`.
    """
    away = (points[cells] - points[body.row]).reshape(len(cells), -1)
    shape, (stiffness, *law) = body.shape, law
    radius, core, round_ = shape.grown()
    tail = [*law, radius, *core, round_, shape.once, shape.planar, *shape.frame().ravel()]
    head, tail = (np.tile(part, (len(cells), 1)) for part in ([body.extent, stiffness], tail))
    return np.column_stack([head, away, tail])


@kernel(forceinline=True)
def pair_of(data, c, nodes):
    """The `Pair` of cell c; what is not read of it costs nothing."""
    at = AWAY + 3 * nodes
    a, k = at + _AXES, at + _CORE
    return Pair(
        data[c, PENALTY],
        data[c, at + _EXPONENT],
        data[c, at + _DAMPING],
        data[c, at + _FRICTION],
        data[c, at + _SLIP],
        Grown(data[c, at + _GROWTH], (data[c, k], data[c, k + 1], data[c, k + 2]), data[c, at + _ROUND] != 0.0),
        (
            (data[c, a], data[c, a + 1], data[c, a + 2]),
            (data[c, a + 3], data[c, a + 4], data[c, a + 5]),
            (data[c, a + 6], data[c, a + 7], data[c, a + 8]),
        ),
        data[c, at + _ONCE] != 0.0,
        data[c, at + _PLANAR] != 0.0,
    )
