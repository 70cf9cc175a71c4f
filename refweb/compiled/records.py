"""Records and tables that kernels take by one pointer, by the public means that numba has for types of one's own.

numba hands a named tuple over field by field: the explicit loop would take some thousand numbers, whose code is most of
what a kernel has to be compiled for. Its structrefs count references, which kernels of the loop do not, and its
structured arrays have no arrays in them. A `record` here is a frozen dataclass. Python writes it once to a block of
memory that lives as long as it does, one word a number, a pointer and the sizes of an array, or the pointer to another
record or table; kernels read the fields that they name from there. What a field is says its annotation:

=====================  =======================================================================================
float, int             a number, which stays what it was when the block was written
`Vector` and others    an array, C-contiguous; its numbers are those of Python
a record               another record
`Arrays`               a table of arrays of one type, of which kernels may put others in place
`Functions`            a table of kernels of one signature, called by their addresses
=====================  =======================================================================================
"""

from __future__ import annotations

import ctypes
import dataclasses
import functools
import operator
import sys
import typing
from typing import Annotated, Any

import numpy as np
from llvmlite import ir
from numba import from_dtype, types
from numba.core import cgutils
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    unbox,
)
from numba.np.arrayobj import make_array, populate_array
from numba.np.numpy_support import as_dtype

from . import kernel, keys, numba_internals

_word, _byte = ir.IntType(64), ir.IntType(8).as_pointer()
WORD = np.dtype(np.int64)
_global: Any = infer_global


def _words_at(builder, pointer, place):
    """Pointer to a word behind a pointer."""
    return builder.gep(builder.bitcast(pointer, _word.as_pointer()), [place])


def _load(builder, pointer, place, stays=True):
    """A word behind a pointer, which ``stays`` what it is while kernels run, or may change."""
    found = builder.load(_words_at(builder, pointer, ir.Constant(_word, place)))
    if stays:
        found.set_metadata("invariant.load", builder.module.add_metadata([]))
    return found


def _array(context, builder, kind, data, sizes, meminfo=None):
    """An array of numba's at an address, with sizes of its own."""
    made = make_array(kind)(context, builder)
    size = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    step, strides = ir.Constant(_word, size), []
    for count in reversed(sizes):
        strides.insert(0, step)
        step = builder.mul(step, count)
    pointer = builder.inttoptr(data, context.get_data_type(kind.dtype).as_pointer())
    populate_array(made, pointer, sizes, strides, ir.Constant(_word, size), meminfo)
    return made._getvalue()


class Pointer(types.Type):
    """Type of what is handed over by one pointer."""

    def can_convert_to(self, context, other):
        """To nothing else."""
        return None


class Reference(Pointer):
    """Type of a `record`; its name changes with the fields of it and of all that it has."""

    def __init__(self, of):
        hints = typing.get_type_hints(of, localns=kernel.RECORDS, include_extras=True)
        self.fields = {field.name: kernel.type_of(hints[field.name]) for field in dataclasses.fields(of)}
        made = keys.digest(*(f"{name} {kind}" for name, kind in self.fields.items()))
        super().__init__(name=f"{of.__name__}-{made[:12]}")

    def place(self, name):
        """Number of the first word of a field, and its type."""
        at = 0
        for field, kind in self.fields.items():
            if field == name:
                return at, kind
            at += words_of(kind)
        raise AttributeError(name)


class ArraysType(Pointer):
    """Type of `Arrays`."""

    def __init__(self, item):
        self.item = item
        super().__init__(name=f"Arrays({item})")


class FunctionsType(Pointer):
    """Type of `Functions`."""

    def __init__(self, signature):
        self.item = numba_internals.Called(signature)
        super().__init__(name=f"Functions({signature})")


for _kind in (Reference, ArraysType, FunctionsType):
    register_model(_kind)(models.OpaqueModel)


def words_of(kind):
    """Number of words of a field."""
    return 1 + kind.ndim if isinstance(kind, types.Array) else 1


@infer_getattr
class _Fields(AttributeTemplate):
    key = Reference

    def generic_resolve(self, value, name):
        return value.fields.get(name)


@lower_getattr_generic(Reference)
def _read_field(context, builder, kind, value, name):
    at, field = kind.place(name)
    word = _load(builder, value, at)
    if isinstance(field, types.Array):
        return _array(context, builder, field, word, [_load(builder, value, at + 1 + n) for n in range(field.ndim)])
    if isinstance(field, Pointer):
        return builder.inttoptr(word, _byte)
    if isinstance(field, types.Float):
        return builder.bitcast(word, ir.DoubleType())
    return word


@_global(operator.getitem)
class _GetItem(AbstractTemplate):
    def generic(self, args, kws):
        if isinstance(args[0], ArraysType | FunctionsType) and isinstance(args[1], types.Integer):
            return args[0].item(args[0], types.intp)
        return None


@lower_builtin(operator.getitem, FunctionsType, types.intp)
def _function(context, builder, signature, arguments):
    table, place = arguments
    items = builder.inttoptr(_load(builder, table, 1), _word.as_pointer())
    found = builder.load(builder.gep(items, [place]))
    found.set_metadata("invariant.load", builder.module.add_metadata([]))
    return builder.inttoptr(found, _byte)


def _item(builder, table, place, kind):
    """Pointer to the words of an array in a table: what counts its references, its address, its sizes."""
    items = builder.inttoptr(_load(builder, table, 1), _word.as_pointer())
    return builder.gep(items, [builder.mul(place, ir.Constant(_word, 2 + kind.ndim))])


@lower_builtin(operator.getitem, ArraysType, types.intp)
def _array_in(context, builder, signature, arguments):
    kind, (table, place) = signature.return_type, arguments
    at = _item(builder, table, place, kind)
    meminfo = builder.inttoptr(_load(builder, at, 0, stays=False), _byte)
    sizes = [_load(builder, at, 2 + n, stays=False) for n in range(kind.ndim)]
    found = _array(context, builder, kind, _load(builder, at, 1, stays=False), sizes, meminfo)
    if context.enable_nrt:  # whoever counts references gives this one back; to others it is lent
        context.nrt.incref(builder, kind, found)
    return found


@_global(operator.setitem)
class _SetItem(AbstractTemplate):
    def generic(self, args, kws):
        if isinstance(args[0], ArraysType) and isinstance(args[1], types.Integer):
            return types.void(args[0], types.intp, args[0].item)
        return None


@lower_builtin(operator.setitem, ArraysType, types.intp, types.Array)
def _put(context, builder, signature, arguments):
    """Put an array into a table, which then has a reference to it."""
    kind, (table, place, value) = signature.args[2], arguments
    at, new = _item(builder, table, place, kind), make_array(kind)(context, builder, value)
    before = _array_in(context, builder, kind(signature.args[0], types.intp), (table, place))
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
    return _load(builder, arguments[0], 0)


@unbox(Reference)
@unbox(ArraysType)
@unbox(FunctionsType)
def _enter(kind, value, c):
    pointer = cgutils.alloca_once_value(c.builder, ir.Constant(_byte, None))
    address = c.pyapi.object_getattr_string(value, "address")
    with cgutils.if_likely(c.builder, cgutils.is_not_null(c.builder, address)):
        c.builder.store(c.pyapi.long_as_voidptr(address), pointer)
        c.pyapi.decref(address)
    failed = cgutils.is_not_null(c.builder, c.pyapi.err_occurred())
    return NativeValue(c.builder.load(pointer), is_error=failed)


def _refuse(value, kind, name):
    raise TypeError(f"{name} is {getattr(value, 'dtype', type(value).__name__)}, not {kind}")


def _sizes(value, kind, name):
    """Address and sizes of an array, which is of a type."""
    fits = isinstance(value, np.ndarray) and value.ndim == kind.ndim and value.flags.c_contiguous
    if not fits or from_dtype(value.dtype) != kind.dtype or not value.flags.writeable:
        _refuse(value, kind, name)
    return [value.ctypes.data, *value.shape]


class Arrays:
    """A table of arrays of one type.

    Parameters
    ----------
    item : numba type
        That of the arrays.
    arrays : sequence of ndarray
        C-contiguous, with numbers of that type; the table keeps them. Kernels may put others in their places, which
        are given back with the table.
    """

    kind_of = ArraysType

    def __init__(self, item, arrays):
        self.item, self._arrays = item, list(arrays)
        words = [[0, *_sizes(one, item, "an array")] for one in self._arrays]
        self._items = np.array(words, dtype=WORD).reshape(len(words), 2 + item.ndim)
        self._head = np.array([len(words), self._items.ctypes.data], dtype=WORD)
        self.address = self._head.ctypes.data

    @functools.cached_property
    def _numba_type_(self):
        return ArraysType(self.item)

    def __len__(self):
        return len(self._arrays)

    def __setitem__(self, place, array):
        self._give_back(place)
        self._items[place] = [0, *_sizes(array, self.item, "an array")]
        self._arrays[place] = array

    def __getitem__(self, place) -> np.ndarray:
        """The array that Python has put there, or a view of what a kernel has, while it stands there."""
        words = self._items[place]
        if not words[0]:
            return self._arrays[place]
        dtype, shape = as_dtype(self.item.dtype), tuple(words[2:].tolist())
        size = dtype.itemsize * int(np.prod(shape))
        content: Any = (ctypes.c_char * size).from_address(int(words[1]))
        return np.frombuffer(content, dtype=dtype).reshape(shape)

    def _give_back(self, place):
        if self._items[place, 0]:
            numba_internals.give_back(int(self._items[place, 0]))
            self._items[place, 0] = 0

    def __del__(self):
        if sys.is_finalizing():
            return
        for place in range(len(self)):
            self._give_back(place)


class Functions:
    """A table of kernels of one signature.

    Parameters
    ----------
    signature : numba signature
        Theirs.
    kernels : sequence of refweb.compiled.kernel.Kernel
        Of it; they are compiled where the address of the table is asked for, or before by
        `refweb.compiled.kernel.prepare`.
    """

    kind_of = FunctionsType

    def __init__(self, signature, kernels):
        self.signature, self.kernels = signature, tuple(kernels)
        for one in self.kernels:
            if one.signature != signature:
                raise TypeError(f"{one.name} has the signature {one.signature}, not {signature}")

    @functools.cached_property
    def _numba_type_(self):
        return FunctionsType(self.signature)

    def __len__(self):
        return len(self.kernels)

    def __getitem__(self, place):
        return self.kernels[place]

    @functools.cached_property
    def _items(self):
        return np.array([one.address() for one in self.kernels], dtype=WORD)

    @functools.cached_property
    def _head(self):
        return np.array([len(self), self._items.ctypes.data], dtype=WORD)

    @property
    def address(self):
        """Address of the table."""
        return self._head.ctypes.data


@typing.dataclass_transform(eq_default=False, frozen_default=True)
class Record:
    """A frozen dataclass that kernels take by one pointer; annotations of a subclass are its fields, see the module."""

    def __init_subclass__(cls):
        known = kernel.RECORDS.get(cls.__name__)
        if known is not None and known.__module__ != cls.__module__:
            raise TypeError(f"a record {cls.__name__} stands in {known.__module__}: give this one another name")
        kernel.RECORDS[cls.__name__] = dataclasses.dataclass(frozen=True, eq=False)(cls)

    @classmethod
    @functools.cache
    def reference(cls):
        """Type of a pointer to one."""
        return Reference(cls)

    @property
    def _numba_type_(self):
        return self.reference()

    @functools.cached_property
    def _block(self):
        """The words of its fields."""
        words = []
        for name, kind in self.reference().fields.items():
            value, told = getattr(self, name), f"{type(self).__name__}.{name}"
            if isinstance(kind, types.Array):
                words += _sizes(value, kind, told)
            elif isinstance(kind, Pointer):
                if value._numba_type_ != kind:
                    _refuse(value, kind, told)
                words.append(value.address)
            else:
                words.append(int(np.float64(value).view(np.int64)) if isinstance(kind, types.Float) else int(value))
        return np.array(words, dtype=WORD)

    @property
    def address(self):
        """Address of the block, which lives as long as the record."""
        return self._block.ctypes.data

    def __getstate__(self):
        """Its fields: a copy has a block of its own."""
        return self.by_name()

    @classmethod
    def field_names(cls):
        """Names of the fields."""
        own: Any = cls
        return [field.name for field in dataclasses.fields(own)]

    def by_name(self):
        """Its fields by name."""
        return {name: getattr(self, name) for name in self.field_names()}

    def all_kernels(self):
        """All kernels in its tables and those of its records."""
        for value in self.by_name().values():
            if isinstance(value, Functions):
                yield from value.kernels
            elif isinstance(value, Record):
                yield from value.all_kernels()


Vector = Annotated[np.ndarray, types.Array(types.float64, 1, "C")]
Matrix = Annotated[np.ndarray, types.Array(types.float64, 2, "C")]
Cube = Annotated[np.ndarray, types.Array(types.float64, 3, "C")]
Integers = Annotated[np.ndarray, types.Array(types.int64, 1, "C")]
IntegerMatrix = Annotated[np.ndarray, types.Array(types.int64, 2, "C")]
"""Annotations of arrays."""
