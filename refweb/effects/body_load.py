"""Forces and torques on free bodies, along the axes of space or along those of the body.

With the rotation R of a body since the start, and a force F or a torque T along axes that turn with it, the force is
R F at its centre of mass, the moment R T, and a rotation δθ changes them by δθ × R F and δθ × R T. Torques have no
potential. The power of a moment is M · ω with ω = R W Rᵀ v, see `refweb.net.rotation`.

May change: the code of the kernels. Must stay: the name "load" of the terms, as in `load`; `terms_of`, which `load`
calls; the factor behind the fields of `BODY_LOAD`, where `outer_load` puts it; cells and shape of the data for other
values of force and torque, as `dynamics.commands` writes new numbers over them during a run. Another field of
`BODY_LOAD` is also written in `_cell`. Tests: ``tests/dynamics/test_attitude.py``, ``tests/test_contract.py``.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..compiled.rows import matrix_of, record_at, width_of
from ..kernels import BOUND, FORCE, STIFFNESS, kernel
from ..net.rotation import matrix_at, times, times_transposed, to_quaternion
from .base import ForceTerm, Tangent
from .outer_load import factor_at, nodal_load, outer_load
from .vectors import cross

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.net import Net
    from ..net.rigid_body import RigidBody

BODY_LOAD = np.dtype([("value", float, (3,)), ("turned", float), ("oriented", float), ("mobility", float, (3, 3))])
"""Data of a cell: F or T along the axes of space at the start; 1 if it turns with the body; 1 if the body has an
orientation; W at the start."""
FACTOR: int = width_of(BODY_LOAD)
"""First column of the factor."""


@kernel()
def value_of(t, x, cells, data, c):
    """F or T of a cell at time t, along the axes of space."""
    load, share = record_at(BODY_LOAD, data, c, 0), factor_at(t, data[c], FACTOR)
    value = share * load.value[0], share * load.value[1], share * load.value[2]
    return times(matrix_at(x, cells[c, 1], cells[c, 2]), value) if load.turned > 0.0 else value


@kernel()
def angular_velocity(x, v, cells, data, c):
    """ω of the body of a cell."""
    load, row = record_at(BODY_LOAD, data, c, 0), cells[c, 1]
    rate = v[row, 0], v[row, 1], v[row, 2]
    if load.oriented == 0.0:
        return rate
    turned = matrix_at(x, row, cells[c, 2])
    return times(turned, times(load.mobility, times_transposed(turned, rate)))


@kernel(FORCE)
def push(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        value, row = value_of(t, x, cells, data, c), cells[c, 0]
        out[c, 0] = value[0] * v[row, 0] + value[1] * v[row, 1] + value[2] * v[row, 2]
        for i in range(3):
            f[row, i] += value[i]


@kernel(FORCE)
def twist(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        value, omega, row = value_of(t, x, cells, data, c), angular_velocity(x, v, cells, data, c), cells[c, 1]
        out[c, 0] = value[0] * omega[0] + value[1] * omega[1] + value[2] * omega[2]
        for i in range(3):
            f[row, i] += value[i]


@functools.cache
def tangent_of(moment: bool) -> Tangent:
    """Stiffness of loads that turn with their body: of torques if ``moment``, else of forces."""
    first = 3 if moment else 0

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        blocks[:] = 0.0
        for c in range(cells.shape[0] if not definite else 0):
            value = value_of(t, x, cells, data, c)
            for j in range(3):
                change = cross((1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0), value)
                for i in range(3):
                    blocks[c, first + i, 3 + j] = -change[i]
            to_quaternion(blocks[c], x, cells[c, 1], cells[c, 2], 3)

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            load = record_at(BODY_LOAD, data, c, 0)
            for i in range(3):
                rates[cells[c, 1]] += 2.0 * abs(load.value[i]) * data[c, FACTOR]

    return Tangent(stiffness, bound if moment else None, symmetric=False)  # a force feels no angle that it changes


def terms_of(
    net: Net,
    body: RigidBody,
    force: NDArray[np.float64] | None,
    torque: NDArray[np.float64] | None,
    turned: bool,
    factor: object,
) -> list[ForceTerm]:
    """The terms of a force [N] and of a torque [N m] on a body, which statics leaves out.

    Both are along the axes of space, shape (3,), at the start where they turn with the body, ``turned``, or None;
    ``factor`` is a table of (t, factor) of both, or None.
    """
    terms = []
    if force is not None and not turned:
        terms.append(nodal_load(net, "load", np.array([body.row]), np.array([force]), factor))
    for value, kernel_of, moment in ((force if turned else None, push, False), (torque, twist, True)):
        if value is not None:
            tangent = tangent_of(moment) if turned else Tangent()
            term = outer_load(net, "load", *_cell(body, value, turned), factor, force=kernel_of, tangent=tangent)
            balance = term.balance._replace(internal=moment, twists=moment)
            terms.append(replace(term, balance=balance))
    return [replace(term, timing=term.timing._replace(at_rest=False)) for term in terms]


def _cell(body, value, turned):
    """(Rows, numbers) of a load on a body that turns."""
    oriented, numbers = body.turn is not None, np.zeros(1, BODY_LOAD)
    numbers["value"], numbers["turned"], numbers["oriented"] = value, turned, oriented
    numbers["mobility"] = body.axes.T @ body.mobility @ body.axes if oriented else np.eye(3)
    return np.array([[body.row, body.spin, body.turn][: 2 + oriented]], dtype=np.int32), matrix_of(numbers)
