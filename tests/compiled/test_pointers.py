"""Records and tables by one pointer: kernels read what Python has written, and give back what they have made."""

import copy
import gc
import importlib
import weakref
from typing import Annotated

import numpy as np
import pytest
from numba import types
from numba.core.registry import cpu_target
from numba.core.runtime import _nrt_python, rtsys

from refweb.kernels import MATRIX, Arrays, Functions, Integers, Matrix, MatrixTable, Record, Vector, kernel

ONE = types.float64(types.float64)


class Inner(Record):
    numbers: Vector
    count: int


class Outer(Record):
    share: float
    inside: Inner
    matrix: Matrix
    places: Integers
    functions: Annotated[Functions, ONE]
    table: MatrixTable


@kernel(ONE)
def double(value):
    return 2.0 * value


@kernel(ONE)
def square(value):
    return value * value


def record():
    return Outer(
        share=0.5,
        inside=Inner(np.array([1.0, 2.0, 3.0]), 7),
        matrix=np.arange(6.0).reshape(2, 3),
        places=np.array([4, 5]),
        functions=Functions(ONE, [double, square]),
        table=Arrays(MATRIX, [np.zeros((0, 3)), np.arange(4.0).reshape(2, 2)]),
    )


@kernel(leaf=True, apart=())
def read(given: Outer, out: Vector) -> None:
    out[0], out[1], out[2] = given.share, given.inside.count, given.inside.numbers[2]
    out[3], out[4] = given.matrix[1, 2], given.places[1]
    out[5], out[6] = given.functions[0](3.0), given.functions[1](3.0)
    out[7], out[8], out[9] = len(given.functions), given.table[1][1, 0], given.table[0].shape[1]


@kernel(leaf=True, apart=())
def write(given: Outer) -> None:
    given.inside.numbers[0], given.table[1][0, 0] = -1.0, -2.0


@kernel(apart=())
def replace(given: Outer, rows: int) -> float:
    given.table[0] = np.ones((rows, 2))
    total = 0.0
    for value in given.table[0].reshape(-1):
        total += value
    return total


def test_kernels_read_every_kind_of_field():
    out = np.zeros(10)
    read(record(), out)
    np.testing.assert_array_equal(out, [0.5, 7.0, 3.0, 5.0, 5.0, 6.0, 9.0, 2.0, 2.0, 3.0])


def test_kernels_write_to_the_arrays_of_python():
    given = record()
    write(given)
    assert given.inside.numbers[0] == -1.0 and given.table[1][0, 0] == -2.0


@pytest.fixture
def counted():
    """Counts what kernels allocate."""
    rtsys.initialize(cpu_target.target_context)
    _nrt_python.memsys_enable_stats()
    yield
    _nrt_python.memsys_disable_stats()


@pytest.mark.usefixtures("counted")
def test_what_kernels_put_into_a_table_is_given_back_with_it():
    def made():
        found = rtsys.get_allocation_stats()
        return found.mi_alloc - found.mi_free

    gc.collect()  # of what other tests have left
    given, before = record(), made()
    first = weakref.ref(given.table[0])
    for rows in (3, 5, 4):
        assert replace(given, rows) == 2.0 * rows
        np.testing.assert_array_equal(given.table[0], np.ones((rows, 2)))
    assert made() == before + 1
    given.table[0] = np.zeros((1, 1))
    assert made() == before
    replace(given, 2)
    del given
    gc.collect()
    assert made() == before and first() is None


def test_a_copy_has_a_block_of_its_own():
    given = record()
    out, other = np.zeros(10), copy.deepcopy(given.inside)
    read(given, out)
    assert other.address != given.inside.address and other.numbers is not given.inside.numbers


@pytest.mark.parametrize(
    "values, message",
    [
        (np.ones((2, 2)), "numbers is float64, not array"),
        (np.ones(3, dtype=np.float32), "numbers is float32"),
        (np.ones(6)[::2], "numbers is float64"),
        ([1.0], "numbers is list"),
    ],
)
def test_a_field_of_another_type_is_refused(values, message):
    with pytest.raises(TypeError, match=message):
        _ = Inner(values, 1).address


def test_two_records_of_one_name_are_refused():
    """Annotations name them."""
    with pytest.raises(TypeError, match="a record Model stands in refweb"):
        importlib.import_module("refweb.dynamics.integrators.records")
        type("Model", (Record,), {"__annotations__": {"count": int}})


def test_a_kernel_of_another_signature_is_refused():
    with pytest.raises(TypeError, match="signature"):
        Functions(types.float64(types.int64), [double])
