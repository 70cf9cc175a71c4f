"""Data of a pair, one element and one body, for the kernels of contact.

Data of a cell begin with a `SPHERE` and the vectors from the centre to the cell's nodes in the web's position; behind
these stands a `SURFACE`, which spheres alone do not need, and at the end a `TURNING` of a body that turns in space.

May change: how the kernels are written. Must stay: names and order of the fields of `SPHERE`, `SURFACE` and `TURNING`:
`pair_data` here and `bodies` write them by position, all kernels of this folder and `system.contact_shares` read them.
A new field goes to all three; `AWAY` and `WIDTH` count them. Fields of `LINE_CONTACT` are read by name. Must stay as
well: all names that `contact_points`, `penalty` and other files import. Tests: ``tests/effects/test_tumbling.py``,
``tests/test_contract.py``.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from numba import from_dtype, types

from ...compiled.rows import record_at, width_of
from ...kernels import kernel
from ...net.rigid_body import Grown
from ...net.rotation import matrix_at, times

SPHERE = np.dtype([("radius", float), ("stiffness", float)])
"""Radius of a sphere around the body [m], stiffness of the penalty."""
SURFACE = np.dtype(
    [
        *((name, float) for name in ("exponent", "damping", "friction", "slip_velocity", "growth")),
        ("core", float, (3,)),
        *((name, float) for name in ("rounded", "once", "planar")),
        ("axes", float, (3, 3)),
        *((name, float) for name in ("fine", "thick", "field")),
    ]
)
"""Further fields of a `Pair`."""
TURNING = np.dtype([("mobility", float, (6,)), ("lever", float), ("offset", float, (3,))])
"""Mobility of a `Pair`, what `lever` says, and the centre of the shape from the body's row [m]."""
LINE_CONTACT = np.dtype([("cell", np.int64), *((name, float) for name in ("xi", "inner", "weight", "share", "rise"))])
"""A contact that is found on a line: its cell, place, and whether that moves; on bodies that are not convex by what its
energy counts, 1 of a maximum or an end and −1 of a minimum, the share of the push that losses have, and F of
`refweb.effects.contact.nonconvex_contacts`."""
LineContacts = Annotated[np.ndarray, types.Array(from_dtype(LINE_CONTACT), 1, "C")]
AWAY, WIDTH = width_of(SPHERE), width_of(SURFACE)
"""First column of the vectors; number of columns of a `SURFACE`."""


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
    axes: tuple[Any, ...]
    once: bool
    planar: bool
    mobility: tuple[Any, ...]


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
def turning_of(data, c, nodes):
    """The `TURNING` of cell c."""
    return record_at(TURNING, data, c, AWAY + 3 * nodes + WIDTH)


@kernel(forceinline=True)
def lever_of(data, c, nodes):
    """Data of `lever` for the body of cell c."""
    return turning_of(data, c, nodes).lever


@kernel(forceinline=True)
def from_shape(p, data, c, nodes):
    """Vector at p, from the row of the body of cell c, from the centre of its shape; along its axes."""
    offset = turning_of(data, c, nodes).offset
    return p[0] - offset[0], p[1] - offset[1], p[2] - offset[2]


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
        w, axes = turning_of(data, c, nodes).mobility, pair.axes
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
            (w[0], w[1], w[2], w[3], w[4], w[5]),
        )

    return paired


@kernel(forceinline=True)
def pair_of(data, c, nodes):
    """The `Pair` of cell c as its body starts; what is not read of it costs nothing."""
    surface = record_at(SURFACE, data, c, AWAY + 3 * nodes)
    core, axes = surface.core, surface.axes
    return Pair(
        record_at(SPHERE, data, c, 0).stiffness,
        surface.exponent,
        surface.damping,
        surface.friction,
        surface.slip_velocity,
        Grown(
            surface.growth,
            (core[0], core[1], core[2]),
            surface.rounded != 0.0,
            surface.fine,
            surface.thick,
            surface.field,
        ),
        (
            (axes[0, 0], axes[0, 1], axes[0, 2]),
            (axes[1, 0], axes[1, 1], axes[1, 2]),
            (axes[2, 0], axes[2, 1], axes[2, 2]),
        ),
        surface.once != 0.0,
        surface.planar != 0.0,
        (1.0, 0.0, 0.0, 1.0, 0.0, 1.0),
    )


@kernel()
def power_of_depth(exponent, deep):
    """δ^p of a depth δ > 0, p being 1 or 1.5."""
    return deep if exponent == 1.0 else deep * math.sqrt(deep)
