"""Records: frozen dataclasses that Python writes and kernels read by one pointer.

numba passes a named tuple field by field: the explicit loop would have a thousand arguments, and most of the
compilation time would be for them. The structrefs of numba count references, which kernels of the loop avoid, and
structured arrays cannot contain arrays. A `Record` is written once to a block of memory that exists as long as the
record: a word for a number, pointer and sizes for an array, and a pointer for another record or table. Kernels read
fields from the block. The annotation of a field determines its form in kernels:

=====================  =======================================================================================
float, int             a number, which stays what it was when the block was written
`Vector` and others    an array, C-contiguous; its numbers are those of Python
a record               another record
`Arrays`               a table of arrays of one type, of which kernels may put others in place
`Functions`            a table of kernels of one signature, called by their addresses
=====================  =======================================================================================

Kernels follow fields that are added and moved: the name of the type has a digest of them, so that these compile again.
Callers that fill a record by position, and fields that go into checkpoints by name, do not.

May change: private names. Must stay: public names of `Record` and the annotations at the end, which `kernels` hands on;
the order of words in `_block`, in which `_read_field` finds a field: change both together. Names of records are unique
in refweb. Must stay as well: `Cube`, `IntegerMatrix`, `Integers` and `Matrix`, which `kernels` imports. Tests:
``tests/compiled/test_pointers.py``.
"""

from __future__ import annotations

import dataclasses
import functools
import typing
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import infer_getattr, lower_getattr_generic, models, register_model, unbox

from . import kernel, keys
from .numba_internals import AttributeTemplate
from .tables import WORD, Functions, Pointer, array_at, enter, load, pointer_to, refuse, sizes_of

if TYPE_CHECKING:
    from collections.abc import Iterator


class Reference(Pointer):
    """Type of a `Record`; its name changes with its fields and those of its records."""

    def __init__(self, of):
        hints = typing.get_type_hints(of, localns=kernel.RECORDS, include_extras=True)
        self.fields = {field.name: kernel.type_of(hints[field.name]) for field in dataclasses.fields(of)}
        made = keys.digest(*(f"{name} {kind}" for name, kind in self.fields.items()))
        super().__init__(name=f"{of.__name__}-{made[:12]}")

    def position(self, name):
        """Number of the first word of a field, and its type."""
        at = 0
        for field, kind in self.fields.items():
            if field == name:
                return at, kind
            at += words_of(kind)
        raise AttributeError(name)


register_model(Reference)(models.OpaqueModel)
unbox(Reference)(enter)


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
    at, field = kind.position(name)
    word = load(builder, value, at)
    if isinstance(field, types.Array):
        return array_at(context, builder, field, word, [load(builder, value, at + 1 + n) for n in range(field.ndim)])
    if isinstance(field, Pointer):
        return pointer_to(builder, word)
    if isinstance(field, types.Float):
        return builder.bitcast(word, ir.DoubleType())
    return word


@typing.dataclass_transform(eq_default=False, frozen_default=True)
class Record:
    """A frozen dataclass that kernels take by one pointer; annotations of a subclass are its fields, see the module."""

    def __init_subclass__(cls) -> None:
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
            value, label = getattr(self, name), f"{type(self).__name__}.{name}"
            if isinstance(kind, types.Array):
                words += sizes_of(value, kind, label)
            elif isinstance(kind, Pointer):
                given = value._numba_type_
                if given is not kind and given != kind:
                    refuse(value, kind, label)
                words.append(value.address)
            else:
                words.append(int(np.float64(value).view(np.int64)) if isinstance(kind, types.Float) else int(value))
        return np.array(words, dtype=WORD)

    @functools.cached_property
    def address(self) -> int:
        """Address of the block, valid as long as the record exists."""
        return self._block.ctypes.data

    def __getstate__(self) -> dict[str, Any]:
        """Its fields; a copy makes a new block."""
        return self.by_name()

    @classmethod
    def field_names(cls) -> list[str]:
        """Names of the fields."""
        base: Any = cls
        return [field.name for field in dataclasses.fields(base)]

    def by_name(self) -> dict[str, Any]:
        """Its fields by name."""
        return {name: getattr(self, name) for name in self.field_names()}

    def all_kernels(self) -> Iterator[Any]:
        """All kernels in its tables and those of its records."""
        for value in self.by_name().values():
            if isinstance(value, Functions):
                yield from value.kernels
            elif isinstance(value, Record):
                yield from value.all_kernels()

    def without_kernels(self) -> typing.Self:
        """Copy of it with empty tables of kernels, which needs no machine code; arrays are shared."""
        record: Any = self
        empty: dict[str, Any] = {}
        for name, value in self.by_name().items():
            if isinstance(value, Functions):
                empty[name] = Functions(value.signature, ())
            elif isinstance(value, Record):
                empty[name] = value.without_kernels()
        return dataclasses.replace(record, **empty)


Vector = Annotated[np.ndarray, types.Array(types.float64, 1, "C")]
Matrix = Annotated[np.ndarray, types.Array(types.float64, 2, "C")]
Cube = Annotated[np.ndarray, types.Array(types.float64, 3, "C")]
Integers = Annotated[np.ndarray, types.Array(types.int64, 1, "C")]
IntegerMatrix = Annotated[np.ndarray, types.Array(types.int64, 2, "C")]
"""Annotations of arrays."""
