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
`Lower`                numba takes an array apart for each number of it, a     numba's own
                       third of all instructions that LLVM reads
`_replacements`        parts of numba's front end take a tenth of the time to  numba's own
                       compile for what is found with less work
=====================  ======================================================  ====================================

``REFWEB_PLAIN=1`` uses the right column. Tables of kernels need addresses of functions and the calling convention of
numba in both. numba is bounded above in ``pyproject.toml``.

May change: nothing but names inside of functions: each use follows a private part of numba. Must stay: names that
`kernel`, `records`, `tables`, `rows` and `second_process` import; both ways give the same results. A new use of a
private part gets a row of the table and, if there is one, a way without it; a new version of numba has to be tried
before the bound in ``pyproject.toml`` is raised. Tests: ``tests/compiled/test_kernel.py``, ``test_pointers.py``.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import importlib
import os
import pickle
from types import CodeType
from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba import types
from numba.core import cgutils, config, event, sigutils, targetconfig
from numba.core import ir as numba_ir
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import register_pass
from numba.core.datamodel import default_manager
from numba.core.imputils import lower_builtin, lower_constant
from numba.core.lowering import Lower
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps
from numba.core.typed_passes import NativeLowering
from numba.core.types.functions import BaseFunction
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, Signature, infer_global
from numba.core.untyped_passes import InlineClosureLikes, MakeFunctionToJitFunction
from numba.extending import intrinsic, models, register_model
from numba.np.arrayobj import fix_integer_index, load_item, make_array, store_item

from . import keys, store

__all__ = ["AbstractTemplate", "AttributeTemplate", "infer_global", "lower_builtin", "make_array"]

PLAIN = os.environ.get("REFWEB_PLAIN") == "1"
"""True if kernels use only public parts of numba."""
BARE = {} if PLAIN else {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of a kernel without an entry from Python."""
ENTRY = {} if PLAIN else {"no_cfunc_wrapper": True}
"""Options of a kernel that only Python calls."""
_array = default_manager[types.Array(types.float64, 1, "C")]
_COUNTER, _DATA, _SHAPE = (_array.get_field_position(name) for name in ("meminfo", "data", "shape"))
"""Places of an array's parts in its intermediate code."""
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
        """The machine code of a signature; None if there is none, or none that this version of the package can load."""
        content = next(
            (machine_code for path in self._paths(signature) if (machine_code := store.read(path)) is not None), None
        )
        if content is None:
            return None
        rtsys.initialize(target_context)
        try:
            parts = pickle.loads(content)
        except (AttributeError, ImportError):  # a class among its types stands in another module by now
            return None
        return CompileResult._rebuild(target_context, *parts)

    def save_overload(self, signature, result):
        """Write the machine code of a signature, if another process may use it: it contains no address of this one."""
        name = self.file(signature)
        if keys.ONCE not in name and not result.library.has_dynamic_globals:
            store.write(name, dumps(result._reduce()))


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
        self._finalize_dynamic_globals()  # of the module for linking, which may be left out below
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


def array_of(context, builder, kind, parts):
    """Array of numba from its parts by name."""
    array = ir.Constant(context.get_value_type(kind), ir.Undefined)
    for position, name in enumerate(context.data_model_manager[kind]._fields):
        array = builder.insert_value(array, parts[name], position)
    return array


class _Lower(Lower):
    """Writes fewer instructions for LLVM than numba: an array is not taken apart for a number in it, nor to be counted.

    LLVM removes the others, which are a third of all, after it has read them. Machine code is nearly the same.
    """

    def _indices(self, array, index):
        """Types and values of indices of one number in an array without gaps; None for other indices and arrays."""
        kind = self.typeof(index.name)
        kinds = kind.types if isinstance(kind, types.BaseTuple) else (kind,)
        if (
            not isinstance(array, types.Array)
            or array.layout != "C"
            or not isinstance(array.dtype, types.Float | types.Integer | types.Boolean)
            or len(kinds) != array.ndim
            or not all(isinstance(kind, types.Integer) for kind in kinds)
            or self.context.enable_boundscheck
        ):
            return None
        value = self.loadvar(index.name)
        if not isinstance(kind, types.BaseTuple):
            return [(kind, value)]
        return [(kind, self.builder.extract_value(value, n)) for n, kind in enumerate(kinds)]

    def _item_pointer(self, array, indices):
        """Pointer to the number at indices of an array, which count from its end if they are negative."""
        builder, data = self.builder, self.builder.extract_value(array, _DATA)
        shape = cgutils.unpack_tuple(builder, builder.extract_value(array, _SHAPE))
        at = [fix_integer_index(self.context, builder, *index, n) for index, n in zip(indices, shape, strict=True)]
        return cgutils.get_item_pointer2(self.context, builder, data, shape, None, "C", at)

    def lower_getitem(self, resty, expr, value, index, signature):
        """Read a number of an array."""
        array = self.typeof(value.name)
        if (indices := self._indices(array, index)) is None:
            return super().lower_getitem(resty, expr, value, index, signature)
        pointer = self._item_pointer(self.loadvar(value.name), indices)
        item = load_item(self.context, self.builder, array, pointer)
        return self.context.cast(self.builder, item, array.dtype, resty)

    def lower_setitem(self, target_var, index_var, value_var, signature):
        """Write a number of an array."""
        array, kind = self.typeof(target_var.name), self.typeof(value_var.name)
        number = isinstance(kind, types.Number | types.Boolean)
        if not number or (indices := self._indices(array, index_var)) is None:
            return super().lower_setitem(target_var, index_var, value_var, signature)
        pointer = self._item_pointer(self.loadvar(target_var.name), indices)
        value = self.context.cast(self.builder, self.loadvar(value_var.name), kind, array.dtype)
        store_item(self.context, self.builder, array, value, pointer)
        return self.context.get_dummy_value()

    def incref(self, typ, val):
        """Count a reference."""
        super().incref(*self._counted(typ, val))

    def decref(self, typ, val):
        """Give a reference back."""
        super().decref(*self._counted(typ, val))

    def _counted(self, kind, value):
        """The counter of an array, in place of the whole array."""
        if not isinstance(kind, types.Array) or not self.context.enable_nrt:
            return kind, value
        return types.MemInfoPointer(types.voidptr), self.builder.extract_value(value, _COUNTER)

    def delvar(self, name):
        """Give the references of a variable back; without any there is nothing to do."""
        if self.context.data_model_manager[self.typeof(name)].contains_nrt_meminfo():
            super().delvar(name)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(NativeLowering):
    _name = "kernel_lowering"
    lowering_class = _Lower


_FOR_FUNCTIONS_INSIDE = InlineClosureLikes, MakeFunctionToJitFunction
"""Passes of numba for functions and comprehensions inside of a function, which few kernels have."""


def _compiler_of(cache):
    """Compiler of numba that makes a `_Library` by `_Lower`."""

    class KernelCompiler(Compiler):
        def define_pipelines(self):
            state = self.state
            state.library = _Library(state.targetctx.codegen(), state.func_id.func_qualname, cache)
            pipelines = super().define_pipelines()
            inside = any(isinstance(value, CodeType) for value in state.func_id.code.co_consts)
            for pipeline in pipelines:
                pipeline.passes = [
                    (_Lowering if step is NativeLowering else step, text)
                    for step, text in pipeline.passes
                    if inside or step not in _FOR_FUNCTIONS_INSIDE
                ]
            return pipelines

    return KernelCompiler


_SCALARS_AND_ARRAYS = types.Number, types.Boolean, types.Array
_VARIABLE, _INSTRUCTION, _SEQUENCE, _MAPPING, _NEITHER = range(5)


@functools.cache
def _role(kind):
    """Tell how `_add_variables` reads a value of a Python type."""
    for role, kinds in enumerate((numba_ir.Var, numba_ir.Inst, (list, tuple), dict)):
        if issubclass(kind, kinds):
            return role
    return _NEITHER


def _add_variables(value, variables):
    """Add to a list all variables in a part of an instruction of numba's intermediate code."""
    role = _role(type(value))
    if role == _VARIABLE:
        variables.append(value)
    elif role == _INSTRUCTION:
        variables += value.list_vars()
    elif role != _NEITHER:
        for part in value if role == _SEQUENCE else value.values():
            _add_variables(part, variables)


def _variables_in(instruction, value):
    """All variables in a part of an instruction, by one look-up of the type of each value."""
    variables: list[Any] = []
    _add_variables(value, variables)
    return variables


def _call_type(original):
    """Return ``BaseFunction.get_call_type`` that remembers the signatures of operators of scalars and arrays.

    Without that numba tries all meanings of an operator, up to one of strings and of sets, for each occurrence. Only
    a meaning that is lowered by the name of the operator is remembered; others are functions to be compiled.
    """

    def get_call_type(self, context, args, kws):
        known = self.__dict__.setdefault("_refweb_signatures", {})
        signature = None if kws else known.get((context, args))
        if signature is None:
            signature = original(self, context, args, kws)
            simple = not kws and all(isinstance(kind, _SCALARS_AND_ARRAYS) for kind in args)
            if simple and self._impl_keys[signature.args] is self.typing_key:
                known[context, args] = signature
        return signature

    return get_call_type


@functools.cache
def _defaults(kind):
    return {name: option.default for name, option in kind.options.items()}


def _values(flags):
    """Values of all options of a compilation, without a call for each."""
    return {**_defaults(type(flags)), **flags._values}


def _equal(flags, second):
    """Tell if options of two compilations are equal."""
    if flags is second:
        return True
    return _values(flags) == _values(second) if isinstance(second, targetconfig.TargetConfig) else NotImplemented


@functools.cache
def _hash_of(kind):
    return hash(tuple(sorted(kind.options)))


def _heard(original):
    """Return a function that announces an event of numba, and does nothing if nobody listens."""
    return lambda kind, *data, **named: original(kind, *data, **named) if event._registered.get(kind) else None


@contextlib.contextmanager
def _no_timer(kind, callback):
    """Stand in for a timer of the locks of numba and LLVM, which are taken 200 000 times for a capture."""
    yield


_replacements = (
    (numba_ir.Inst, "_rec_list_vars", _variables_in),
    (BaseFunction, "get_call_type", _call_type(BaseFunction.get_call_type)),
    (targetconfig.TargetConfig, "values", _values),
    (targetconfig.TargetConfig, "__eq__", _equal),
    (targetconfig.TargetConfig, "__hash__", lambda flags: _hash_of(type(flags))),
    (event, "start_event", _heard(event.start_event)),
    (event, "end_event", _heard(event.end_event)),
    (event, "install_timer", _no_timer),
)
"""Faster functions for those of numba, with the same results, while kernels are compiled."""


@contextlib.contextmanager
def _replaced():
    """Compile in the block, whose thread has the lock, with `_replacements`."""
    before = [getattr(where, name) for where, name, _ in _replacements]
    try:
        for where, name, replacement in _replacements:
            setattr(where, name, replacement)
        yield
    finally:
        for (where, name, _), original in zip(_replacements, before, strict=True):
            setattr(where, name, original)


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
    disabled, _config.DISABLE_JIT = _config.DISABLE_JIT, 0  # kernels have no way without machine code
    try:
        made: Any = numba.njit(pipeline_class=_compiler_of(cache), **given)(function)
    finally:
        _config.DISABLE_JIT = disabled
    made._cache, compile_one = cache, made.compile

    def compile_alone(signature):
        if not given.get("forceinline"):
            signature = without_literals(signature)
        with lock:  # an overload that two threads add is ambiguous, and each call looks for it anew
            known = made.overloads.get(tuple(sigutils.normalize_signature(signature)[0]))
            if known is not None:
                return known.entry_point
            if (result := made._cache.load_overload(signature, made.targetctx)) is not None:
                made.targetctx.insert_user_function(result.entry_point, result.fndesc, [result.library])
                made.add_overload(result)
                return result.entry_point
            with store.alone(cache.file(signature)), _replaced():
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
