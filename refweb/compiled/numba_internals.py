"""All uses of private parts of numba, with reasons, and the ways without them.

=====================  ======================================================  ====================================
part                   reason                                                  without it
=====================  ======================================================  ====================================
``dispatcher._cache``  numba's own cache looks at one source file alone, so    ``njit(cache=True)``
                       that a changed callee leaves stale machine code, and
                       a comment makes all of a file stale
options of `njit`      entries from Python are two fifths of what it takes to  they are compiled, references are
(`BARE`, ``_nrt``)     compile, and counting of references costs 10 ns an      counted
                       array and call
call by address        a caller that links its callees optimizes all that is   kernels are linked
                       below it again
``JITCodeLibrary``     of a linked kernel all callers run the copy that is     the first run, which
                       loaded first, and copies may differ in rounding; code   compiles, may differ from
                       of a kernel that is only linked is never run            later ones in rounding
operators of types     kernels read records and tables as Python does         none: what `records` and `tables`
of one's own                                                                   need of numba beside its
                                                                               ``extending`` stands here
=====================  ======================================================  ====================================

``REFWEB_PLAIN=1`` uses the right column. Tables of kernels need addresses of functions and the calling convention of
numba in both. numba is bounded above in ``pyproject.toml``.

May change: nothing but names inside of functions: each use follows a private part of numba. Must stay: names that
`kernel`, `records`, `tables`, `rows` and `second_process` import; both ways give the same results. A new use of a
private part gets a row of the table and, if there is one, a way without it; a new version of numba has to be tried
before the bound in ``pyproject.toml`` is raised. Tests: ``tests/compiled/test_kernel.py``, ``test_pointers.py``.
"""

from __future__ import annotations

import ctypes
import functools
import importlib
import os
import pickle
from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils, config, sigutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.imputils import lower_builtin, lower_constant
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, Signature, infer_global
from numba.extending import intrinsic, models, register_model
from numba.np.arrayobj import make_array, populate_array

from . import keys, store

__all__ = ["AbstractTemplate", "AttributeTemplate", "infer_global", "lower_builtin", "make_array", "populate_array"]

PLAIN = os.environ.get("REFWEB_PLAIN") == "1"
"""True if kernels use only public parts of numba."""
BARE = {} if PLAIN else {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of a kernel without an entry from Python."""
ENTRY = {} if PLAIN else {"no_cfunc_wrapper": True}
"""Options of a kernel that only Python calls."""
_byte = ir.IntType(8).as_pointer()
_config: Any = config  # numba makes its entries at run time, from variables of the environment
lock = global_compiler_lock
"""numba's own: one thread compiles at a time."""


@functools.cache
def host():
    """(name, features) of the processor that numba compiles for."""
    features = _config.CPU_FEATURES
    if features is None:
        own_features = llvm.get_host_cpu_features()
        features = ",".join(name for name in sorted(own_features) if own_features[name])
    return _config.CPU_NAME or llvm.get_host_cpu_name(), features


@functools.cache
def shipped():
    """Processor and features of machine code in a wheel that this processor can run; None if there is none."""
    target, features = store.portable(), llvm.get_host_cpu_features()
    return target if target and (target[0] != "x86-64-v3" or all(features.get(name) for name in store.V3)) else None


def options(given, counted):
    """Options of `numba.njit` for a kernel that counts references or does not."""
    return given if counted or PLAIN else {**given, "_nrt": False}


class Cache:
    """Cache of a dispatcher of numba: files of `refweb.compiled.store`.

    Parameters
    ----------
    name : str
        Readable part of the names of files.
    key : callable
        Text of all that the machine code depends on besides the types of its arguments.
    linked : bool
        True if other kernels may be optimized with it. Else the data for that, most of a file, is left out.
    called : bool
        True if it is called by its address or from Python. Else its machine code is left out.
    """

    def __init__(self, name, key, linked=False, called=True):
        self.name, self.key, self.linked, self.called = name, key, linked, called

    def file(self, signature, processor=None):
        """Name of the file of a signature."""
        arguments, _ = sigutils.normalize_signature(signature)
        made = keys.digest(keys.platform_key(processor or host()), self.key(), *map(str, arguments))
        return f"{self.name}-{made}"

    def _paths(self, signature):
        """Files that may contain the machine code of a signature: in the folder of the user, and in a wheel."""
        yield store.folder() / self.file(signature)
        if store.SHIPPED.is_dir() and (target := shipped()):
            yield store.SHIPPED / self.file(signature, target)

    def has(self, signature):
        """Tell if there is machine code of a signature."""
        return any(path.exists() for path in self._paths(signature))

    def load_overload(self, signature, target_context):
        """The machine code of a signature; None if there is none."""
        content = next(
            (machine_code for path in self._paths(signature) if (machine_code := store.read(path)) is not None), None
        )
        if content is None:
            return None
        rtsys.initialize(target_context)
        return CompileResult._rebuild(target_context, *pickle.loads(content))

    def save_overload(self, signature, result):
        """Write the machine code of a signature."""
        store.write(self.file(signature), dumps(result._reduce()))


class _Library(JITCodeLibrary):
    """Machine code of one function, which calls no copy of a linked kernel but its own.

    LLVM would let all libraries with a copy of a kernel call the copy that is loaded first. Copies are optimized in
    different ways and so may differ in rounding; then a run that compiles would differ from later ones.
    """

    def __init__(self, codegen, name, cache):
        super().__init__(codegen, name)
        self.cache = cache
        self.enable_object_caching()

    def _finalize_final_module(self):
        module = self._final_module
        functions = [function for function in module.functions if not function.is_declaration]
        if self.cache.linked:
            self._finalized = True  # the functions are, which the next line asks for
            self._get_module_for_linking()
        else:
            names = [function.name for function in functions if function.linkage == llvm.Linkage.external]
            self._shared_module = llvm.parse_assembly("\n".join(f'define void @"{n}"() {{ ret void }}' for n in names))
        if self.cache.called:
            for function in functions:
                if function.linkage == llvm.Linkage.linkonce_odr:
                    function.linkage = "internal"
        else:
            names = [value.name for value in module.global_variables if value.name.startswith("_ZN08NumbaEnv")]
            self._final_module = llvm.parse_assembly("\n".join(f'@"{name}" = common global i64 0' for name in names))
            self._final_module.name = module.name
        super()._finalize_final_module()


def _compiler_of(cache):
    """Compiler of numba that makes a `_Library`."""

    class KernelCompiler(Compiler):
        def define_pipelines(self):
            state = self.state
            state.library = _Library(state.targetctx.codegen(), state.func_id.func_qualname, cache)
            return super().define_pipelines()

    return KernelCompiler


def without_literals(signature):
    """The signature with integers in place of literal integers of a caller.

    By default numba compiles a kernel again for each literal integer of a caller. This is useful only if both are
    optimized together, as with ``forceinline``: loops over the nodes of an element are then unrolled.
    """
    arguments, result = sigutils.normalize_signature(signature)
    arguments = tuple(map(types.unliteral, arguments))
    return arguments if result is None else result(*arguments)


def dispatcher(function, given, cache) -> Any:
    """A dispatcher of numba with a `Cache`; one thread and one process compiles at a time."""
    if PLAIN:
        return numba.njit(cache=function.__code__.co_filename != "<string>", **given)(function)
    made: Any = numba.njit(pipeline_class=_compiler_of(cache), **given)(function)
    made._cache, compile_one = cache, made.compile

    def compile_alone(signature):
        if not given.get("forceinline"):
            signature = without_literals(signature)
        known = made.overloads.get(tuple(sigutils.normalize_signature(signature)[0]))
        if known is not None:
            return known.entry_point
        with lock:
            if (result := made._cache.load_overload(signature, made.targetctx)) is not None:
                made.targetctx.insert_user_function(result.entry_point, result.fndesc, [result.library])
                made.add_overload(result)
                return result.entry_point
            with store.alone(cache.file(signature)):
                return compile_one(signature)

    made.compile = compile_alone
    return made


def address_of(made, signature):
    """Address of the machine code of a dispatcher for a signature, in numba's own calling convention."""
    result = made.overloads[tuple(signature.args)]
    return result.library.get_pointer_to_function(result.fndesc.llvm_func_name)


class Slot:
    """Memory of the address of a kernel for its callers, 0 until it is compiled.

    LLVM must know its symbol before a caller is compiled or read from disk: an unknown symbol would end the process.
    """

    def __init__(self, symbol, key):
        self.symbol, self.key, self._cell = symbol, key, ctypes.c_void_p()
        llvm.add_symbol(symbol, ctypes.addressof(self._cell))

    @property
    def filled(self):
        """True if the address is known."""
        return bool(self._cell.value)

    @property
    def address(self):
        """The address; 0 if it is not known."""
        return self._cell.value or 0

    def fill(self, address):
        """Write the address."""
        self._cell.value = address


_slots: dict[str, Slot] = {}


def slot_of(symbol, key):
    """The `Slot` of a symbol, kept until the process ends; a symbol of a kernel with another key is renamed."""
    name = symbol
    while name in _slots and _slots[name].key != key:
        name += "'"
    if name not in _slots:
        _slots[name] = Slot(name, key)
    return _slots[name]


def give_back(meminfo):
    """Release a reference to an array that a kernel has made, by the address of its reference counter."""
    runtime: Any = importlib.import_module("numba.core.runtime._nrt_python")
    runtime._MemInfo(meminfo)  # takes the reference, and gives it back at its own end


class Called(types.Callable):
    """Type of a kernel that is called by its address: one of a `Slot`, or of a table of kernels."""

    def __init__(self, signature, symbol=""):
        self.signature, self.symbol = signature, symbol
        super().__init__(name=f"called{signature}{symbol}")

    def get_call_type(self, context, args, kws):
        """The one signature that there is."""
        if kws or len(args) != len(self.signature.args):
            return None
        return Signature(self.signature.return_type, self.signature.args, recvr=self)

    def get_call_signatures(self):
        """The one signature that there is."""
        return (self.signature,), False

    def get_impl_key(self, sig):
        """Return the key by which the calls are lowered."""
        return Called


register_model(Called)(models.OpaqueModel)


def kernel_at(signature):
    """A function for kernels: the kernel of a signature that stands at an address."""

    @intrinsic
    def at(context, address):
        def read(context, builder, signature, arguments):
            return builder.inttoptr(arguments[0], _byte)

        return Called(signature)(types.intp), read

    return at


@lower_constant(Called)
def _read_slot(context, builder, kind, value):
    slot = builder.module.globals.get(kind.symbol)
    if slot is None:
        slot = ir.GlobalVariable(builder.module, _byte, kind.symbol)
    return builder.load(slot)


@lower_builtin(Called, Called, types.VarArg(types.Any))
def _call(context, builder, signature, arguments):
    kind, result, given = signature.args[0], signature.return_type, signature.args[1:]
    entry, *values = arguments
    if kind.symbol:
        with builder.if_then(cgutils.is_null(builder, entry), likely=False):
            message = f"{kind.symbol} is not compiled: no feature of the run asks for it"
            context.call_conv.return_user_exc(builder, RuntimeError, (message,))
    shape = context.call_conv.get_function_type(result, given)
    entry = builder.bitcast(entry, shape.as_pointer())
    status, out = context.call_conv.call_function(builder, entry, result, given, values)
    with cgutils.if_unlikely(builder, status.is_error):
        context.call_conv.return_status_propagate(builder, status)
    return out
