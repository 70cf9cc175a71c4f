"""Rows of matrices as records: Python and kernels read the numbers of a cell by the names of one dtype.

All terms of the compiled loop take matrices, so that one loop serves every combination of them. A dtype names the
columns of a matrix; its fields are numbers or arrays of one type. A row may have more columns before and after those of
a record.

Fields are eight bytes wide, since columns count numbers; `record_at` reads memory without a check of its bounds.

May change: the way in which an intrinsic builds its address. Must stay: names and arguments of all functions here, on
which all effects with data of more than one column rely; records and matrices that they return share memory with what
they are given. Tests: ``tests/compiled/test_pointers.py``, ``tests/test_contract.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .numba_internals import make_array

if TYPE_CHECKING:
    from numpy.typing import NDArray

_intrinsic: Any = intrinsic  # kernels give all but the first argument


def width_of(kind: np.dtype[Any]) -> int:
    """Number of columns of a dtype."""
    return kind.itemsize // 8


def column_of(kind: np.dtype[Any], field: str) -> int:
    """Number of the first column of a field."""
    fields: Any = kind.fields
    return fields[field][1] // 8


def records_of(kind: np.dtype[Any], matrix: NDArray[np.float64]) -> NDArray[Any]:
    """The first columns of a C-contiguous matrix as records over the same memory, shape (rows,)."""
    return np.ndarray(len(matrix), kind, matrix, strides=matrix.strides[:1])


def matrix_of(records: NDArray[Any]) -> NDArray[np.float64]:
    """Numbers of records as a matrix over the same memory, shape (records, columns)."""
    return records.view(float).reshape(len(records), width_of(records.dtype))


@_intrinsic
def record_at(typing, kind, matrix, row, column):
    """The record of a row of a C-contiguous matrix from a column on, over the same memory, in kernels."""

    def build(context, builder, signature, arguments):
        _, array, row, column = arguments
        array = make_array(signature.args[1])(context, builder, array)
        first = builder.add(builder.mul(row, builder.extract_value(array.shape, 1)), column)
        return builder.bitcast(builder.gep(array.data, [first]), context.get_value_type(signature.return_type))

    return kind.dtype(kind, matrix, types.intp, types.intp), build


@_intrinsic
def narrowed(typing, kind, record):
    """The same record with the fields of another dtype alone, over the same memory, in kernels."""

    def build(context, builder, signature, arguments):
        return builder.bitcast(arguments[1], context.get_value_type(signature.return_type))

    return kind.dtype(kind, record), build


@_intrinsic
def number_at(typing, address, index):
    """The number of an index in an array of numbers at an address, which Python keeps, in kernels."""

    def build(context, builder, signature, arguments):
        address, index = arguments
        numbers = builder.inttoptr(address, context.get_value_type(types.float64).as_pointer())
        return builder.load(builder.gep(numbers, [index]))

    return types.float64(types.int64, types.int64), build


@_intrinsic
def numbers_at(typing, matrix, row, column):
    """The numbers of a row of a C-contiguous matrix from a column on, in kernels.

    Indices without sign count from there, without a check: loops over them use all lanes of the processor.
    """

    def build(context, builder, signature, arguments):
        array, row, column = arguments
        array = make_array(signature.args[0])(context, builder, array)
        return builder.gep(array.data, [builder.add(builder.mul(row, builder.extract_value(array.shape, 1)), column)])

    return types.CPointer(matrix.dtype)(matrix, types.intp, types.intp), build


_of_literals: Any = intrinsic(prefer_literal=True)


@_of_literals
def numbers_aside(typing, count):
    """Space for a constant count of numbers, to the end of the kernel; nothing else has an address in it."""

    def build(context, builder, signature, arguments):
        shape = ir.ArrayType(context.get_value_type(types.float64), count.literal_value)
        return builder.bitcast(cgutils.alloca_once(builder, shape), shape.element.as_pointer())

    return types.CPointer(types.float64)(count), build
