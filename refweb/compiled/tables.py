"""Tables that kernels read by one pointer: of arrays of one type, and of kernels of one signature.

A table has two words, the number of its items and their address. An item of a table of kernels is the address of a
kernel. An item of a table of arrays has the address of a reference counter, 0 for an array of Python, the address of
the array, and its sizes.

May change: private names but ``_items`` and ``_head``. Must stay: words that Python writes and the code that reads them
change together; ``_items`` and ``_head`` exist as long as the table, since kernels have their addresses; references to
arrays are counted as here, else memory leaks or is read after its end; names that `records`, `kernels` and
`integrators.neighbour_list` (`ArraysType`) import. Tests: ``tests/compiled/test_pointers.py``.
"""

from __future__ import annotations

import ctypes
import functools
import operator
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from llvmlite import ir
from numba import from_dtype, types
from numba.core import cgutils
from numba.extending import NativeValue, models, register_model, unbox
from numba.np.numpy_support import as_dtype

from . import numba_internals
from .numba_internals import AbstractTemplate, infer_global, lower_builtin, make_array

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_word, _byte = ir.IntType(64), ir.IntType(8).as_pointer()
WORD = np.dtype(np.int64)
_global: Any = infer_global


def pointer_to(builder, word):
    """Pointer from a word that contains an address."""
    return builder.inttoptr(word, _byte)


def _words_at(builder, pointer, index):
    """Pointer to a word at an index from a pointer."""
    return builder.gep(builder.bitcast(pointer, _word.as_pointer()), [index])


def load(builder, pointer, index, stays=True):
    """Word at an index from a pointer; ``stays`` is True if kernels do not change it."""
    value = builder.load(_words_at(builder, pointer, ir.Constant(_word, index)))
    if stays:
        value.set_metadata("invariant.load", builder.module.add_metadata([]))
    return value


def array_at(context, builder, kind, data, sizes, meminfo=None):
    """Array of numba at an address, with given sizes."""
    size = ir.Constant(_word, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    step, strides, number = size, [], ir.Constant(_word, 1)
    for count in reversed(sizes):
        strides.insert(0, step)
        step, number = builder.mul(step, count), builder.mul(number, count)
    parts = {
        "meminfo": ir.Constant(_byte, None) if meminfo is None else meminfo,
        "parent": ir.Constant(_byte, None),
        "nitems": number,
        "itemsize": size,
        "data": builder.inttoptr(data, context.get_data_type(kind.dtype).as_pointer()),
        "shape": cgutils.pack_array(builder, sizes),
        "strides": cgutils.pack_array(builder, strides),
    }
    return numba_internals.array_of(context, builder, kind, parts)


class Pointer(types.Type):
    """Type of an argument that is passed by one pointer."""

    def can_convert_to(self, context: Any, target: Any) -> Any:
        """Allow no conversion."""
        return None


class ArraysType(Pointer):
    """Type of `Arrays`."""

    def __init__(self, item: Any) -> None:
        self.item: Any = item
        super().__init__(name=f"Arrays({item})")


class FunctionsType(Pointer):
    """Type of `Functions`."""

    def __init__(self, signature: Any) -> None:
        self.item: Any = numba_internals.Called(signature)
        super().__init__(name=f"Functions({signature})")


for _kind in (ArraysType, FunctionsType):
    register_model(_kind)(models.OpaqueModel)
arrays_type, functions_type = functools.cache(ArraysType), functools.cache(FunctionsType)
"""Types by item and by signature, whose names are long to write: a run asks for them hundreds of times."""


@_global(operator.getitem)
class _GetItem(AbstractTemplate):
    def generic(self, args, kws):
        if isinstance(args[0], ArraysType | FunctionsType) and isinstance(args[1], types.Integer):
            return args[0].item(args[0], types.intp)
        return None


@lower_builtin(operator.getitem, FunctionsType, types.intp)
def _function(context, builder, signature, arguments):
    table, index = arguments
    items = builder.inttoptr(load(builder, table, 1), _word.as_pointer())
    value = builder.load(builder.gep(items, [index]))
    value.set_metadata("invariant.load", builder.module.add_metadata([]))
    return pointer_to(builder, value)


def _item(builder, table, index, kind):
    """Pointer to the words of an array in a table: reference counter, address, sizes."""
    items = builder.inttoptr(load(builder, table, 1), _word.as_pointer())
    return builder.gep(items, [builder.mul(index, ir.Constant(_word, 2 + kind.ndim))])


@lower_builtin(operator.getitem, ArraysType, types.intp)
def _array_in(context, builder, signature, arguments):
    kind, (table, index) = signature.return_type, arguments
    at = _item(builder, table, index, kind)
    meminfo = pointer_to(builder, load(builder, at, 0, stays=False))
    sizes = [load(builder, at, 2 + n, stays=False) for n in range(kind.ndim)]
    array = array_at(context, builder, kind, load(builder, at, 1, stays=False), sizes, meminfo)
    if context.enable_nrt:  # whoever counts references gives this one back; to others it is lent
        context.nrt.incref(builder, kind, array)
    return array


@_global(operator.setitem)
class _SetItem(AbstractTemplate):
    def generic(self, args, kws):
        if isinstance(args[0], ArraysType) and isinstance(args[1], types.Integer):
            return types.void(args[0], types.intp, args[0].item)
        return None


@lower_builtin(operator.setitem, ArraysType, types.intp, types.Array)
def _put(context, builder, signature, arguments):
    """Put an array into a table, which then holds a reference to it."""
    kind, (table, index, value) = signature.args[2], arguments
    at, new = _item(builder, table, index, kind), make_array(kind)(context, builder, value)
    before = _array_in(context, builder, kind(signature.args[0], types.intp), (table, index))
    context.nrt.incref(builder, kind, value)
    sizes = cgutils.unpack_tuple(builder, new.shape)
    words = [builder.ptrtoint(new.meminfo, _word), builder.ptrtoint(new.data, _word), *sizes]
    for n, word in enumerate(words):
        builder.store(word, builder.gep(at, [ir.Constant(_word, n)]))
    for _ in range(2):  # what reading it has counted, and what the table had
        context.nrt.decref(builder, kind, before)
    return context.get_dummy_value()


@_global(len)
class _Len(AbstractTemplate):
    def generic(self, args, kws):
        return types.intp(args[0]) if isinstance(args[0], ArraysType | FunctionsType) else None


@lower_builtin(len, ArraysType)
@lower_builtin(len, FunctionsType)
def _len(context, builder, signature, arguments):
    return load(builder, arguments[0], 0)


def enter(kind, value, c):
    pointer = cgutils.alloca_once_value(c.builder, ir.Constant(_byte, None))
    address = c.pyapi.object_getattr_string(value, "address")
    with cgutils.if_likely(c.builder, cgutils.is_not_null(c.builder, address)):
        c.builder.store(c.pyapi.long_as_voidptr(address), pointer)
        c.pyapi.decref(address)
    failed = cgutils.is_not_null(c.builder, c.pyapi.err_occurred())
    return NativeValue(c.builder.load(pointer), is_error=failed)


for _kind in (ArraysType, FunctionsType):
    unbox(_kind)(enter)


def refuse(value, kind, name):
    raise TypeError(f"{name} is {getattr(value, 'dtype', type(value).__name__)}, not {kind}")


_number_type = functools.cache(from_dtype)


def sizes_of(value, kind, name):
    """Address and sizes of an array, with a check of its type."""
    fits = isinstance(value, np.ndarray) and value.ndim == kind.ndim and (flags := value.flags).c_contiguous
    if not fits or _number_type(value.dtype) != kind.dtype or not flags.writeable:
        refuse(value, kind, name)
    return [value.__array_interface__["data"][0], *value.shape]


class Arrays:
    """A table of arrays of one type.

    Parameters
    ----------
    item : numba type
        That of the arrays.
    arrays : sequence of ndarray
        C-contiguous arrays with numbers of that type; the table keeps them. Kernels may replace them; the table
        releases these arrays at its end.
    """

    kind_of = staticmethod(arrays_type)

    def __init__(self, item: Any, arrays: Sequence[Any]) -> None:
        self.item: Any = item
        self._arrays = list(arrays)
        words = [[0, *sizes_of(array, item, "an array")] for array in self._arrays]
        self._items = np.array(words, dtype=WORD).reshape(len(words), 2 + item.ndim)
        self._head = np.array([len(words), self._items.ctypes.data], dtype=WORD)
        self.address: int = self._head.ctypes.data

    @property
    def _numba_type_(self):
        return arrays_type(self.item)

    def __len__(self) -> int:
        return len(self._arrays)

    def __setitem__(self, index: int, array: NDArray[Any]) -> None:
        self._give_back(index)
        self._items[index] = [0, *sizes_of(array, self.item, "an array")]
        self._arrays[index] = array

    def __getitem__(self, index: int) -> np.ndarray:
        """The array from Python, or a view of the array of a kernel, valid while it is in the table."""
        words = self._items[index]
        if not words[0]:
            return self._arrays[index]
        dtype, shape = as_dtype(self.item.dtype), tuple(words[2:].tolist())
        size = dtype.itemsize * int(np.prod(shape))
        content: Any = (ctypes.c_char * size).from_address(int(words[1]))
        return np.frombuffer(content, dtype=dtype).reshape(shape)

    def _give_back(self, index):
        if self._items[index, 0]:
            numba_internals.give_back(int(self._items[index, 0]))
            self._items[index, 0] = 0

    def __del__(self) -> None:
        if sys is None or sys.is_finalizing():
            return
        for index in range(len(self)):
            self._give_back(index)


class Functions:
    """A table of kernels of one signature.

    Parameters
    ----------
    signature : numba signature
        Signature of the kernels.
    kernels : sequence of refweb.compiled.kernel.Kernel
        Kernels of that signature; they are compiled by `refweb.compiled.kernel.prepare`, or when the address of the
        table is needed.
    """

    kind_of = staticmethod(functions_type)

    def __init__(self, signature: Any, kernels: Sequence[Any]) -> None:
        self.signature: Any = signature
        self.kernels: tuple[Any, ...] = tuple(kernels)
        for item in self.kernels:
            if item.signature != signature:
                raise TypeError(f"{item.name} has the signature {item.signature}, not {signature}")

    @property
    def _numba_type_(self):
        return functions_type(self.signature)

    def __len__(self) -> int:
        return len(self.kernels)

    def __getitem__(self, index: int) -> Any:
        return self.kernels[index]

    @functools.cached_property
    def _items(self):
        return np.array([item.address() for item in self.kernels], dtype=WORD)

    @functools.cached_property
    def _head(self):
        return np.array([len(self), self._items.ctypes.data], dtype=WORD)

    @functools.cached_property
    def address(self) -> int:
        """Address of the table."""
        return self._head.ctypes.data
