"""Compiled kernels: their signatures, the records of contacts that some of them fill, and annotations.

Every effect writes its force once, as a kernel of the one signature `FORCE`, so that the explicit loop can call any
mixture of them without Python, and every other solver calls the same code. ``x`` in a kernel is the *displacement* of
each row from its reference position: with the strain formula of `refweb.effects.elasticity` a net under 1e-9 N keeps
all its digits, which it loses when positions are the unknowns.

=================  ===================================================================================================
`FORCE`            ``(t, x, v, f, cells, data, out)``: adds forces [N] to ``f``, writes ``out`` per cell
`ENERGY`           ``(t, x, cells, data, out)``: writes the energy [J] of each cell to ``out (c,)``
`STIFFNESS`        ``(t, x, v, blocks, cells, data, definite)``: writes −∂f/∂x [N/m] per cell; ``definite`` asks for a
                   positive semidefinite part
`BOUND`            ``(reach, speed, x, mass, rates, cells, data)``: adds to ``rates`` what bounds each row's sum of
                   |K| [N/m], for all that can act before a row has moved by ``reach`` [m], at ``speed`` [m/s] at most
`IMPULSE`          ``(t, x, cells, data, total)``: adds ∫F dt [N s], F the sum of the forces of all cells, to ``total
                   (3,)``, but for a constant
`DETECT`           ``(x, cells, data, contacts, parts, begin)``: writes the contacts of all cells, see `CONTACT`, from
                   ``begin`` on; the number behind them, also where ``contacts`` has no space for all
`LAW`              ``(h, number, first, end, f, inverse, contacts, parts)``: finds in turn the forces of contacts
                   from ``first`` on, before or down to ``end``, in a kick of size h, sweep ``number``, and adds their
                   changes to f; the largest change of a velocity [m/s]. ``inverse (rows, 3)`` is 1/m, 0 where a
                   support holds
`NEAR`             ``(skin, x, cells, data, chosen)``: writes the numbers of all cells that may touch when they come
                   nearer by ``skin`` [m] to ``chosen``; their number
`MEETS`            ``(margin, path, kick, drift, x, v, f, inverse, cells, data, due, met)``: whether lines of any cell
                   come nearer than ``margin`` [m] in a drift behind a kick, in which rows come nearer by ``path`` [m]
                   at most, with ``inverse`` as in `LAW`; its rows are written to ``met``. Where ``due`` has any, only
                   the cells that are due are looked at, see `DUE`
`TIME_TO_CONTACT`  ``(x, v, cells, data)``: time in which no cell comes much nearer [s]
`RELAX`            ``(h, x, cells, data, before, lost)``: takes internal variables of all cells, in ``x``, to the end of
                   a step h; ``before`` has strains at its start and gets those at its end, for h = 0 alone; writes the
                   energy that is dissipated in each cell [J] to ``lost``
=================  ===================================================================================================

`STIFFNESS` is also the signature of −∂f/∂v [N s/m], and `BOUND` that of its row sums.

`refweb.compiled` says what a kernel is, where its machine code is kept and how records reach it.

May change: insides of the small kernels at the end. Must stay: signatures, and names and order in dtypes: a changed one
changes every kernel that has it, in `effects`, `integrators` and effects of users, and all their callers. A further
field of a dtype compiles these kernels again and needs a value wherever its rows are filled. Must stay as well: all
names that `integrators.records`, `integrators.neighbour_list` and other files import. Tests:
``tests/test_contract.py``, ``tests/how_to/test_effect.py``.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numba import from_dtype, types

from .compiled.kernel import kernel
from .compiled.records import Cube, IntegerMatrix, Integers, Matrix, Record, Vector
from .compiled.tables import Arrays, Functions

__all__ = [
    "Arrays",
    "Cube",
    "Functions",
    "IntegerMatrix",
    "Integers",
    "Matrix",
    "Record",
    "Vector",
    "kernel",
]

_f, _i = types.float64, types.int32


def _array(scalar, dimensions):
    return types.Array(scalar, dimensions, "C")


VECTOR, MATRIX, INDICES = _array(_f, 1), _array(_f, 2), _array(_i, 2)
"""Types of numbers per cell, of the data and of the cells of a term."""
INTEGERS = _array(types.int64, 1)
"""Type of row numbers."""
_common = (_f, _array(_f, 2), _array(_f, 2))
FORCE = types.void(*_common, _array(_f, 2), _array(_i, 2), _array(_f, 2), _array(_f, 2))
ENERGY = types.void(_f, _array(_f, 2), _array(_i, 2), _array(_f, 2), _array(_f, 1))
BOUND = types.void(_f, _f, _array(_f, 2), _array(_f, 1), _array(_f, 1), _array(_i, 2), _array(_f, 2))
IMPULSE = ENERGY
STIFFNESS = types.void(*_common, _array(_f, 3), _array(_i, 2), _array(_f, 2), types.boolean)
PART = np.dtype([("row", np.int64), ("jacobian", float, (3, 3)), ("transpose", float, (3, 3))])
"""A row that a contact moves; for each direction, J (what its velocity adds to the relative velocity u) and Jᵀ (what a
force adds to that on the row), which are equal but for rotations."""
CONTACT = np.dtype(
    [
        ("cell", np.int64),
        ("owner", np.int64),
        ("tag", np.int64),
        ("term", np.int64),
        ("first", np.int64),
        ("count", np.int64),
        ("group", np.int64),
        ("tangent", float, (3,)),
        ("drag", float, (2,)),
        ("normal_force", float),
        ("damping", float),
        ("friction", float),
        ("slip_velocity", float),
        ("wind", float, (3,)),
        ("velocity", float, (3,)),
        ("force", float, (3,)),
        ("theta", float, (2,)),
        ("delassus", float, (3, 3)),
        ("basis", float, (3, 3)),
    ]
)
"""A contact: three directions along which a force acts on some rows.

Its ``cell`` among those of the force ``term``, where it shows its power; the ``owner`` that remembers it, a cell
of the term or, of pairs of elements that are found anew, the first element, with a ``tag`` that tells it from others
there; its parts, a ``count`` from the ``first`` on, see `PART`; a ``basis`` that stays from step to step, by rows the
directions.

Numbers of its law: the push N₀ [N], damping d [s/m], friction μ and slip velocity v_s [m/s]; of drag the ``tangent`` of
the line, c_n and c_t [kg/m], and the ``wind`` [m/s]. Contacts that share a row may be one ``group``, of so many from
the first of them on: the others have 0 there, and no parts.

The solver writes the rest: the ``velocity`` u⁻ ahead of the kick [m/s], the ``force`` along each direction [N],
``theta`` of the normal and of the tangents, and the block ``delassus`` J M⁻¹ Jᵀ [1/kg].
"""
MEMORY = np.dtype([("tag", np.int64), ("step", np.int64), ("force", float, (3,))])
"""A contact as it is remembered until the next step: its tag, the number of the step, and its force by ``basis``."""
CONTACTS, PARTS = types.Array(from_dtype(CONTACT), 1, "C"), types.Array(from_dtype(PART), 1, "C")
MEMORIES = types.Array(from_dtype(MEMORY), 2, "C")
DETECT = types.int64(MATRIX, INDICES, MATRIX, MATRIX, CONTACTS, PARTS, types.int64)
LAW = types.float64(_f, *(3 * (types.int64,)), MATRIX, MATRIX, CONTACTS, PARTS)
DUE = np.dtype([("path", float), ("chosen", np.int64)])
"""A cell that is checked only when it is due: the approach in all drifts after which that is [m]. The list also has the
numbers of the cells that are due soon. Behind all cells stand three more: the approach so far, with how many are due
soon; that up to which these suffice; that at which the next is due, at least."""
DUE_LIST = types.Array(from_dtype(DUE), 1, "C")
ALL_DUE = np.zeros(0, dtype=DUE)
"""List with which all cells are checked."""
MEETS = types.boolean(_f, _f, _f, _f, MATRIX, MATRIX, MATRIX, MATRIX, INDICES, MATRIX, DUE_LIST, INTEGERS)
TIME_TO_CONTACT = types.float64(MATRIX, MATRIX, INDICES, MATRIX)
RELAX = types.void(_f, MATRIX, INDICES, MATRIX, VECTOR, VECTOR)
NEAR = types.int64(_f, _array(_f, 2), _array(_i, 2), _array(_f, 2), INTEGERS)


Indices = Annotated[np.ndarray, INDICES]
"""Annotation of cells."""
ContactArray = Annotated[np.ndarray, CONTACTS]
PartArray = Annotated[np.ndarray, PARTS]
"""Annotations of contacts and of their parts."""
IndexTable = Annotated[Arrays, INDICES]
MatrixTable = Annotated[Arrays, MATRIX]
VectorTable = Annotated[Arrays, VECTOR]
IntegerTable = Annotated[Arrays, INTEGERS]
DueTable = Annotated[Arrays, DUE_LIST]
ContactTable = Annotated[Arrays, CONTACTS]
PartTable = Annotated[Arrays, PARTS]
MemoryTable = Annotated[Arrays, MEMORIES]
"""Annotations of tables of arrays in records."""
ForceTable = Annotated[Functions, FORCE]
EnergyTable = Annotated[Functions, ENERGY]
BoundTable = Annotated[Functions, BOUND]
DetectTable = Annotated[Functions, DETECT]
LawTable = Annotated[Functions, LAW]
MeetsTable = Annotated[Functions, MEETS]
RelaxTable = Annotated[Functions, RELAX]
ImpulseTable = EnergyTable
"""Annotations of tables of kernels in records."""


@kernel(leaf=True)
def copy_rows(source, target):
    """Copy rows of three numbers; numba's ``target[:] = source`` takes seconds to compile, for its errors."""
    for r in range(source.shape[0]):
        for k in range(3):
            target[r, k] = source[r, k]


@kernel(leaf=True)
def inner(first, second):
    """Inner product of two vectors; to read a kernel with numba's own, or its sum or ``in``, imports scipy.linalg."""
    total = 0.0
    for n in range(first.shape[0]):
        total += first[n] * second[n]
    return total


@kernel(leaf=True)
def among(values, value):
    """Tell if a number is among those of a vector."""
    for n in range(values.shape[0]):
        if values[n] == value:
            return True
    return False


@kernel(leaf=True)
def sum_of(values):
    """Sum of a vector, one number after another."""
    total = 0.0
    for n in range(values.shape[0]):
        total += values[n]
    return total
