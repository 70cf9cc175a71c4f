"""Kernels: functions that numba compiles when they are called, put in a table or prepared, and not before.

There are three kinds of calls of a kernel. In a call by another kernel numba optimizes both together; this is for code
in loops over elements. A kernel with ``apart`` is called by its address: its callers know only its signature, from its
annotations, and are not compiled again when the kernel changes. ``apart`` lists the features of a run that may call it;
a run without them neither compiles nor loads it, see `prepare`. A call from Python goes through an entry, which is
compiled at the first call.

May change: private functions, and how kernels are collected in `needed`, if none is left out. Must stay: arguments of
`kernel`, which effects of users call; `machine_code_key` and `_numba_type_`, which `keys` and numba call; `COMMON`,
which decides the bits of all results; `RECORDS`, which `records` fills and annotations are looked up in. A name in
``apart`` that `dynamics.integrators.features` never gives is not prepared, and its call ends the run. Must stay as
well: `type_of`, which `records` imports. Tests: ``tests/compiled/test_kernel.py``.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import typing
from typing import TYPE_CHECKING, Annotated, Any

from numba import types

from . import keys, numba_internals, watchers
from .second_process import beside

if TYPE_CHECKING:
    from collections.abc import Sequence

COMMON = {"error_model": "numpy", "fastmath": {"contract"}, "nogil": True}
"""Options of all kernels: fused products and sums are allowed, otherwise the arithmetic is that of IEEE 754."""
PLAIN_TYPES = {float: types.float64, int: types.int64, bool: types.boolean, type(None): types.void}
RECORDS: dict[str, Any] = {}
"""Classes of records by name, for annotations in modules that do not import them."""


def type_of(annotation):
    """Type of numba for an annotation: a number, an array with its type, a (named) tuple, a table, or a record."""
    if annotation in PLAIN_TYPES:
        return PLAIN_TYPES[annotation]
    if typing.get_origin(annotation) is Annotated:
        base, kind = typing.get_args(annotation)[:2]
        return base.kind_of(kind) if hasattr(base, "kind_of") else kind
    if typing.get_origin(annotation) is tuple:
        return types.Tuple([type_of(part) for part in typing.get_args(annotation)])
    if hasattr(annotation, "_fields"):
        hints = typing.get_type_hints(annotation, localns=RECORDS, include_extras=True)
        return types.BaseTuple.from_types([type_of(hints[name]) for name in annotation._fields], annotation)
    return annotation.reference()


def signature_of(function):
    """The numba signature from the annotations of a function."""
    hints = typing.get_type_hints(function, localns=RECORDS, include_extras=True)
    result = type_of(hints.pop("return"))
    return result(*map(type_of, hints.values()))


class Kernel:
    """A compiled function, see the module.

    Attributes
    ----------
    py_func : function
        The Python function.
    prepared : bool
        True if there is machine code of all kernels that it may call, for any features of a run.
    apart : frozenset of str, optional
        Features of runs that may call it, for a kernel that is called by its address; else None.
    """

    def __init__(self, function, signature, apart, counted, options):
        self.py_func, self.apart = function, None if apart is None else frozenset(apart)
        self._given, self._counted, self._options = signature, counted, {**COMMON, **options}
        self.prepared = self._keying = False
        if function.__closure__:
            cells = [keys.described(keys.content_of(cell), ()) for cell in function.__closure__]
            function.__qualname__ += f"_{keys.digest(*cells)[-24:-8]}"

    @property
    def name(self):
        """Its name with its module, without the package."""
        return f"{self.py_func.__module__}.{self.py_func.__qualname__}".removeprefix("refweb.").replace("<locals>.", "")

    @functools.cached_property
    def signature(self):
        """Its only signature; None if callers determine it."""
        return signature_of(self.py_func) if self._given is None and self.apart is not None else self._given

    @functools.cached_property
    def _key(self):
        return self._new_key()

    def _new_key(self):
        options = sorted((name, *(sorted(v) if isinstance(v, set) else [v])) for name, v in self._options.items())
        self._keying = True
        try:
            return keys.digest(keys.of_function(self.py_func), options, self._counted, self.signature)
        finally:
            self._keying = False

    def renew(self):
        """Forget machine code, if anything that the kernel captures has changed; tell if it has.

        Numba reads globals when it compiles. In a notebook cells run again, with other numbers or helpers. Kernels of
        this package do not change in a process, and are not looked at.
        """
        if self._keying or self.py_func.__module__.startswith("refweb."):
            return False
        self._keying = True  # kernels may call each other
        try:
            changed = any([item.renew() for item in _kernels_in(self.py_func)])
        finally:
            self._keying = False
        if "_key" in self.__dict__ and (changed or self._new_key() != self._key):
            for name in ("_key", "_slot", "_body", "_entry", "callees"):
                self.__dict__.pop(name, None)
            self.prepared, changed = False, True
        return changed

    @property
    def _linked(self):
        """True if its callers are optimized with it."""
        return self.apart is None or numba_internals.PLAIN

    def machine_code_key(self):
        """Key of its part in the machine code of a caller, see `refweb.compiled.keys.described`."""
        if self._keying:
            return f"again {self.name} {keys.ONCE}"
        return self._key if self._linked else _ByAddress(self).machine_code_key()

    @functools.cached_property
    def _slot(self):
        """Slot of its address, shared by kernels that are the same."""
        symbol = f"refweb.{self.name}.{keys.digest(self.signature)[:8]}"
        return numba_internals.slot_of(symbol, self._key)

    @functools.cached_property
    def _body(self):
        """The dispatcher that kernels see."""
        given = {**numba_internals.options(self._options, self._counted), **numba_internals.BARE}
        linked, called = self.apart is None, self.signature is not None
        cache = numba_internals.Cache(self.py_func.__qualname__.rpartition(".")[2], lambda: self._key, linked, called)
        return numba_internals.dispatcher(self.py_func, given, cache)

    def _compiled(self):
        """The dispatcher, with its only signature compiled if it has one."""
        body = self._body
        if self.signature is not None and not body.overloads:
            body.compile(self.signature)
            body.disable_compile()
        return body

    @property
    def _numba_type_(self):
        with numba_internals.lock:
            return (self._compiled() if self._linked else _ByAddress(self))._numba_type_

    @property
    def loaded(self):
        """True if its machine code is loaded."""
        return self._slot.filled

    def known(self):
        """Tell if its machine code is loaded, or on disk."""
        if self.loaded:
            return True
        return numba_internals.PLAIN or self._body._cache.has(self.signature)

    def address(self):
        """Address of its machine code, which is compiled if necessary."""
        with numba_internals.lock:
            if not self._slot.filled:
                for callee in self.callees:
                    _ = callee._slot  # symbols that its machine code names
                self._slot.fill(numba_internals.address_of(self._compiled(), self.signature))
        return self._slot.address

    @functools.cached_property
    def _entry(self):
        """The dispatcher that Python calls."""
        if self.signature is not None:
            return functools.partial(entry_of(self.signature), self.address())
        name = "entry_" + self.py_func.__qualname__.rpartition(".")[2]
        cache = numba_internals.Cache(name, lambda: f"entry {self._key}")
        return numba_internals.dispatcher(self.py_func, {**self._options, **numba_internals.ENTRY}, cache)

    def __call__(self, *arguments):
        if not self.prepared:
            prepare([self])
        return self._entry(*arguments)

    @property
    def call(self):
        """Entry for a run that has prepared it with its features; kernels for other features may not be compiled."""
        return self._entry

    @functools.cached_property
    def callees(self):
        """Kernels that are called by their address, by it or by what is compiled into it, a list."""
        kernels = {}
        _collect(self.py_func, kernels, set())
        return list(kernels)


@functools.cache
def entry_of(signature):
    """The dispatcher by which Python calls all kernels of one signature: its first argument is their address."""
    names = ", ".join(f"a{n}" for n in range(len(signature.args)))
    space = {"kernel_at": numba_internals.kernel_at(signature), "__name__": __name__}
    exec(f"def entry(address, {names}): return kernel_at(address)({names})", space)
    cache = numba_internals.Cache("entry", lambda: f"entry {signature}")
    made = numba_internals.dispatcher(space["entry"], {**COMMON, **numba_internals.ENTRY}, cache)
    made.compile(signature.return_type(types.intp, *signature.args))
    made.disable_compile()
    return made


class _ByAddress:
    """A kernel for callers that call it by its address."""

    def __init__(self, kernel):
        self.kernel = kernel

    @property
    def _numba_type_(self):
        return numba_internals.Called(self.kernel.signature, self.kernel._slot.symbol)

    def machine_code_key(self):
        """Key of a kernel that is called by address."""
        return f"apart {self.kernel._slot.symbol}"


def _kernels_in(function):
    """Kernels that a function captures, by themselves or in tuples, a list."""
    values = [value for _, value in keys.captured(function)]
    return [k for value in values for k in (value if isinstance(value, tuple) else (value,)) if isinstance(k, Kernel)]


def _collect(function, kernels, visited):
    """Add to ``kernels`` the kernels that are called by their address from a function and what is compiled into it."""
    if function in visited:
        return
    visited.add(function)
    for item in _kernels_in(function):
        if item.apart is None:
            _collect(item.py_func, kernels, visited)
        else:
            kernels[item] = None


def needed(kernels, features=None):
    """List the kernels whose machine code a run needs: given ones, and all that they call by address.

    Parameters
    ----------
    kernels : sequence of Kernel
        Kernels that are called directly or are in tables.
    features : set of str, optional
        Features of the run; by default all.

    Returns
    -------
    list of Kernel
    """
    wanted, left = {}, list(kernels)
    while left:
        item = left.pop()
        if item in wanted:
            continue
        wanted[item] = None
        item.renew()
        left += [k for k in item.callees if features is None or k.apart <= features]
    return list(wanted)


def prepare(kernels, features=None):
    """Compile or load all `needed` kernels before a run, and call `refweb.compiled.watchers` for compiled ones.

    Parameters
    ----------
    kernels, features
        See `needed`.
    """
    wanted = [item for item in needed(kernels, features) if item.signature is not None]
    unknown = [item for item in wanted if not item.known()]
    new = {item: n for n, item in enumerate(unknown)}
    with _no_collection(), beside(unknown):
        for item in wanted:
            for tell in watchers if item in new else ():
                tell(new[item], len(new))
            item.address()
    for item in kernels if features is None else ():
        item.prepared = True


@contextlib.contextmanager
def _no_collection():
    """Disable garbage collection, which takes a tenth of the time of compilation, since many objects stay."""
    looks = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if looks:
            gc.enable()


def kernel(signature: Any = None, *, leaf: bool = False, apart: Sequence[str] | None = None, **options: Any) -> Any:
    """Compile a function, and keep its machine code on disk.

    Parameters
    ----------
    signature : numba signature, optional
        Its only signature; by default callers determine it, or, with ``apart``, its annotations.
    leaf : bool
        True for a kernel without reference counting, which takes 10 ns for each array and call. Such a kernel neither
        makes nor returns arrays, and calls no kernels that do.
    apart : sequence of str, optional
        Features of runs that may call it, by its address, see the module.
    **options
        Options of `numba.njit`.
    """
    return lambda function: Kernel(function, signature, apart, not leaf, options)
