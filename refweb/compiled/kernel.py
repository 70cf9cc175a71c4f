"""Kernels: functions that numba compiles when they are called, stand in a table or are prepared, never before.

Three kinds of calls lead to a kernel. Another kernel that names it is optimized with it, as numba does by itself: for
what stands in loops over elements. A kernel with ``apart`` is called by its address: its callers know its signature,
which its annotations say, and are neither optimized with it nor compiled again when it changes. Its ``apart`` are the
features that a run needs to reach it; a run without them neither compiles nor loads it, see `prepare`. And Python calls
a kernel through an entry of its own, which is compiled when it is first asked for.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import typing
from typing import Annotated, Any

from numba import types

from . import keys, numba_internals, watchers
from .second_process import beside

COMMON = {"error_model": "numpy", "fastmath": {"contract"}, "nogil": True}
"""Options of all kernels: products and sums may contract, nothing else departs from IEEE arithmetic."""
PLAIN_TYPES = {float: types.float64, int: types.int64, bool: types.boolean, type(None): types.void}
RECORDS: dict[str, Any] = {}
"""Classes of records by name, for annotations whose module does not import them."""


def type_of(annotation):
    """numba's type of what an annotation says: a number, an array with its type, a table, or a record."""
    if annotation in PLAIN_TYPES:
        return PLAIN_TYPES[annotation]
    if typing.get_origin(annotation) is Annotated:
        base, kind = typing.get_args(annotation)[:2]
        return base.kind_of(kind) if hasattr(base, "kind_of") else kind
    if typing.get_origin(annotation) is tuple:
        return types.Tuple([type_of(part) for part in typing.get_args(annotation)])
    return annotation.reference()


def signature_of(function):
    """The `numba` signature that the annotations of a function say."""
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
        True if there is machine code of all kernels that it may reach, for any features of a run.
    apart : frozenset of str, optional
        Features of a run that reaches it, for one that is called by its address; else None.
    """

    def __init__(self, function, signature, apart, counted, options):
        self.py_func, self.apart = function, None if apart is None else frozenset(apart)
        self._given, self._counted, self._options = signature, counted, {**COMMON, **options}
        self.prepared = False
        if function.__closure__:
            cells = [keys.described(cell.cell_contents, ()) for cell in function.__closure__]
            function.__qualname__ += f"_{keys.digest(*cells)[:16]}"

    @property
    def name(self):
        """Its name with that of its module, without the package's."""
        return f"{self.py_func.__module__}.{self.py_func.__qualname__}".removeprefix("refweb.").replace("<locals>.", "")

    @functools.cached_property
    def signature(self):
        """Its one signature; None where callers give it any."""
        return signature_of(self.py_func) if self._given is None and self.apart is not None else self._given

    @functools.cached_property
    def _key(self):
        options = sorted((name, *(sorted(v) if isinstance(v, set) else [v])) for name, v in self._options.items())
        return keys.digest(keys.of_function(self.py_func), options, self._counted, self.signature)

    @property
    def _linked(self):
        """True if kernels that name it are optimized with it."""
        return self.apart is None or numba_internals.PLAIN

    def machine_code_key(self):
        """Key of all that a caller's machine code depends on, see `refweb.compiled.keys.described`."""
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
        linked = self.apart is None
        cache = numba_internals.Cache(self.py_func.__qualname__.rpartition(".")[2], lambda: self._key, linked)
        return numba_internals.dispatcher(self.py_func, given, cache)

    def _compiled(self):
        """The same, with its one signature compiled where it has one."""
        body = self._body
        if self.signature is not None and not body.overloads:
            body.compile(self.signature)
            body.disable_compile()
        return body

    @property
    def _numba_type_(self):
        with numba_internals.lock:
            return (self._compiled() if self._linked else _ByAddress(self))._numba_type_

    def known(self):
        """Tell if its machine code is loaded, or on disk."""
        if self._slot.filled:
            return True
        return numba_internals.PLAIN or self._body._cache.has(self.signature)

    def address(self):
        """Address of its machine code, which is compiled where there is none."""
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
        cache = numba_internals.Cache(name, lambda: f"entry {self._key}", False)
        return numba_internals.dispatcher(self.py_func, {**self._options, **numba_internals.ENTRY}, cache)

    def __call__(self, *arguments):
        if not self.prepared:
            prepare([self])
        return self._entry(*arguments)

    @property
    def call(self):
        """Entry for a run that has prepared it with its features: kernels for others may not be compiled."""
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
    cache = numba_internals.Cache("entry", lambda: f"entry {signature}", False)
    made = numba_internals.dispatcher(space["entry"], {**COMMON, **numba_internals.ENTRY}, cache)
    made.compile(signature.return_type(types.intp, *signature.args))
    made.disable_compile()
    return made


class _ByAddress:
    """A kernel as its callers see it that call it by its address."""

    def __init__(self, kernel):
        self.kernel = kernel

    @property
    def _numba_type_(self):
        return numba_internals.Called(self.kernel.signature, self.kernel._slot.symbol)

    def machine_code_key(self):
        """Key of a kernel that is called by address."""
        return f"apart {self.kernel._slot.symbol}"


def _collect(function, kernels, visited):
    """Add to ``kernels`` the kernels that are called by their address from a function and what is compiled into it."""
    if function in visited:
        return
    visited.add(function)
    for _, value in keys.captured(function):
        for item in value if isinstance(value, tuple) else (value,):
            if isinstance(item, Kernel):
                if item.apart is None:
                    _collect(item.py_func, kernels, visited)
                else:
                    kernels[item] = None


def needed(kernels, features=None):
    """Kernels to have machine code of before a run: some, and all that they reach by address with its features.

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
        left += [k for k in item.callees if features is None or k.apart <= features]
    return list(wanted)


def prepare(kernels, features=None):
    """Compile or load all that is `needed` before a run, and tell `refweb.compiled.watchers` what is to be compiled.

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
    """Do not look for unreachable objects: compiling makes many that stay, which takes a tenth of its time."""
    looks = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if looks:
            gc.enable()


def kernel(signature=None, *, leaf=False, apart=None, **options) -> Any:
    """Compile a function, and keep its machine code on disk.

    Parameters
    ----------
    signature : numba signature, optional
        The only one that it has; by default callers give it any, or where it is ``apart`` its annotations say.
    leaf : bool
        True if it counts no references to arrays, which takes 10 ns for each array and call. Such a kernel neither
        makes nor returns arrays, nor calls kernels that return any.
    apart : sequence of str, optional
        Features of a run that reaches it: it is called by its address, see the module.
    **options
        Of `numba.njit`.
    """
    return lambda function: Kernel(function, signature, apart, not leaf, options)
