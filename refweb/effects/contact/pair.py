"""Data of a pair, one element and one body, for the kernels of contact.

Data of a cell begin with the columns `RADIUS` to `AWAY`, and vectors from the centre to the cell's nodes in the web's
position; behind these stands the rest of a `Pair`, which spheres alone do not need, and at the end what turning takes.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from ...kernels import kernel
from ...net.rigid_body import Grown
from ...net.rotation import matrix_at, times

RADIUS, PENALTY, AWAY = 0, 1, 2
"""Columns of data: radius of a sphere around the body [m], stiffness of the penalty, first of the vectors."""
_EXPONENT, _DAMPING, _FRICTION, _SLIP, _GROWTH, _CORE, _ROUND, _ONCE, _PLANAR, _AXES = 0, 1, 2, 3, 4, 5, 8, 9, 10, 11
_FINE, _THICK, _FIELD, _MOBILITY, _LEVER, _OFFSET = 20, 21, 22, 23, 29, 30
"""Columns behind the vectors."""


class Pair(NamedTuple):
    """Data of an element and a body.

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
    mobility : tuple of 6 float
        W of `refweb.net.rotation` along these axes, 00, 01, 02, 11, 12, 22.
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
    mobility: tuple


def pair_data(body, cells, points, law, tumbles=False):
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
    tumbles : bool
        True if the axes of the body follow from its rows of rotation.
    """
    away = (points[cells] - points[body.row]).reshape(len(cells), -1)
    shape, (stiffness, *law) = body.shape, law
    radius, core, round_, *field = shape.grown()
    tail = [*law, radius, *core, round_, shape.once, shape.planar, *body.axes.ravel(), *field]
    tail += [*body.mobility[np.triu_indices(3)], lever(body), *body.offset] if tumbles else []
    head, tail = (np.tile(part, (len(cells), 1)) for part in ([body.extent, stiffness], tail))
    return np.column_stack([head, away, tail])


def lever(body):
    """√(I (y × g)·J⁻¹(y × g)) for any point y of a body and unit vector g, at most [m]: a lever for its moment I."""
    reach = np.array(body.core) + body.radius + np.abs(body.offset)
    across = np.sqrt((reach**2).sum() - reach**2)
    return float(np.sqrt(across @ np.abs(body.mobility) @ across))


@kernel(forceinline=True)
def lever_of(data, c, nodes):
    """Data of `lever` for the body of cell c."""
    return data[c, AWAY + 3 * nodes + _LEVER]


@kernel(forceinline=True)
def from_shape(p, data, c, nodes):
    """Vector at p, from the row of the body of cell c, from the centre of its shape; along its axes."""
    at = AWAY + 3 * nodes + _OFFSET
    return p[0] - data[c, at], p[1] - data[c, at + 1], p[2] - data[c, at + 2]


@functools.cache
def pairing(spins):
    """Kernel ``(x, cells, data, c, nodes)`` of the `Pair` of cell c at displacements x.

    Parameters
    ----------
    spins : int
        2 where the last rows of a cell are those of the rotation of the body, of which its axes follow.
    """

    @kernel(forceinline=True)
    def paired(x, cells, data, c, nodes):
        pair = pair_of(data, c, nodes)
        if spins < 2:
            return pair
        turned = matrix_at(x, cells[c, nodes + 1], cells[c, nodes + 2])
        at, axes = AWAY + 3 * nodes + _MOBILITY, pair.axes
        return Pair(
            pair.stiffness,
            pair.exponent,
            pair.damping,
            pair.friction,
            pair.slip_velocity,
            pair.shape,
            (times(turned, axes[0]), times(turned, axes[1]), times(turned, axes[2])),
            pair.once,
            pair.planar,
            (data[c, at], data[c, at + 1], data[c, at + 2], data[c, at + 3], data[c, at + 4], data[c, at + 5]),
        )

    return paired


@kernel(forceinline=True)
def pair_of(data, c, nodes):
    """The `Pair` of cell c as its body starts; what is not read of it costs nothing."""
    at = AWAY + 3 * nodes
    a, k = at + _AXES, at + _CORE
    return Pair(
        data[c, PENALTY],
        data[c, at + _EXPONENT],
        data[c, at + _DAMPING],
        data[c, at + _FRICTION],
        data[c, at + _SLIP],
        Grown(
            data[c, at + _GROWTH],
            (data[c, k], data[c, k + 1], data[c, k + 2]),
            data[c, at + _ROUND] != 0.0,
            data[c, at + _FINE],
            data[c, at + _THICK],
            data[c, at + _FIELD],
        ),
        (
            (data[c, a], data[c, a + 1], data[c, a + 2]),
            (data[c, a + 3], data[c, a + 4], data[c, a + 5]),
            (data[c, a + 6], data[c, a + 7], data[c, a + 8]),
        ),
        data[c, at + _ONCE] != 0.0,
        data[c, at + _PLANAR] != 0.0,
        (1.0, 0.0, 0.0, 1.0, 0.0, 1.0),
    )


@kernel()
def power_of_depth(exponent, deep):
    """δ^p of a depth δ > 0, p being 1 or 1.5."""
    return deep if exponent == 1.0 else deep * math.sqrt(deep)
