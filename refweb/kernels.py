"""Compiled kernels: their signatures and where their machine code is kept.

Every effect writes its force once, as a kernel of the one signature `FORCE`, so that the explicit loop can call any
mixture of them without Python, and every other solver calls the same code. ``x`` in a kernel is the *displacement* of
each row from its reference position: with the strain formula of `refweb.effects.elasticity` a net under 1e-9 N keeps
all its digits, which it loses when positions are the unknowns.

=============  ==========================================================================================
`FORCE`        ``(t, x, v, f, cells, data, out)``: adds forces [N] to ``f``, writes ``out`` per cell
`ENERGY`       ``(t, x, cells, data, out)``: writes the energy [J] of each cell to ``out (c,)``
`STIFFNESS`    ``(t, x, v, blocks, cells, data, definite)``: writes −∂f/∂x [N/m] per cell; ``definite`` asks for
               a positive semidefinite part
`BOUND`        ``(reach, speed, x, mass, rates, cells, data)``: adds to ``rates`` what bounds each row's sum of |K|
               [N/m], for all that can act before a row has moved by ``reach`` [m], at ``speed`` [m/s] at most
`LINES`        ``(t, lines, cells, data)``: changes natural lengths among the numbers of all lines
`IMPULSE`      ``(t, x, cells, data, total)``: adds ∫F dt [N s], F the sum of the forces of all cells, to ``total
               (3,)``, but for a constant
`MEET`         ``(h, x, v, inverse, cells, data, touches, begin)``: writes what touches to rows of ``touches`` from
               ``begin`` on, for a kick of size h from velocities v, ``inverse (rows, 3)`` being 1/m, 0 where a support
               holds; the row behind them, also where ``touches`` has no room for all
`KEPT`         ``(number, memory, f, touches, begin, end)``: adds to f the forces of what touched in the step before
               this one, of a ``number`` > 0
`SWEEP`        ``(h, number, f, inverse, touches, count)``: solves contacts one after the other and adds what their
               forces change by to f; the largest change of a velocity in a kick [m/s]
`GIVE`         ``(number, memory, v, touches, begin, end, out)``: notes forces in the ``memory`` of a step, and writes
               the power of each cell to ``out`` [W]
`NEAR`         ``(skin, x, cells, data, chosen)``: writes the numbers of all cells that may touch when they come nearer
               by ``skin`` [m] to ``chosen``; their number
`MEETS`        ``(room, way, kick, drift, x, v, f, inverse, cells, data, met)``: whether lines of any cell come nearer
               than ``room`` [m] in a drift behind a kick, in which rows come nearer by ``way`` [m] at most, with
               ``inverse`` as in `MEET`; its rows are written to ``met``
`WATCH`        ``(room, way, kick, drift, x, v, f, inverse, cells, data, due, chosen, met)``: the same of cells that are
               looked at when their turn comes: ``due`` has the way of all drifts after which that is, behind them that
               way itself, what it may come to with those that are ``chosen``, the last of which is their number, and
               how far the turn of the next is at least
`SOON`         ``(x, v, cells, data)``: time in which no cell comes much nearer [s]
=============  ==========================================================================================

`STIFFNESS` is also the signature of −∂f/∂v [N s/m], and `BOUND` that of its row sums.

Machine code is kept on disk, in a folder named by the content of all sources with kernels: numba itself looks only at
the file a function stands in, and would go on using a kernel whose law, in another file, has changed. It also finds the
machine code of kernels in typed lists by name: kernels of one factory, which differ in the numbers and the kernels that
they capture, are named after these, a captured kernel by its name and the content of its file.

Of several processes that want the same kernel one compiles it, and the others wait and read what it has written; on
Windows, where there are no such locks, each compiles it. Without them it is not only slower: numba numbers the machine
code of a function by what stands there already, and two that write at once may put different code under one number.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import pathlib
import warnings
from typing import Any

import numba
import numba.typed
from llvmlite.binding import parse_assembly
from numba import types
from numba.core import config
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher
from numba.core.runtime.nrt import rtsys
from numba.core.typing.templates import Signature

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None

# Kernels in typed lists are numba's first-class functions, which it calls experimental at every compilation.
warnings.filterwarnings("ignore", message="First-class function type feature is experimental")

_config: Any = config  # numba makes its entries at run time, from variables of the environment
_f, _i = types.float64, types.int32


def _array(scalar, dimensions):
    return types.Array(scalar, dimensions, "C")


VECTOR, MATRIX, INDICES = _array(_f, 1), _array(_f, 2), _array(_i, 2)
"""Types of numbers per cell, of the data and of the cells of a family."""
INTEGERS = _array(types.int64, 1)
"""Type of row numbers."""
_common = (_f, _array(_f, 2), _array(_f, 2))
FORCE = types.void(*_common, _array(_f, 2), _array(_i, 2), _array(_f, 2), _array(_f, 2))
ENERGY = types.void(_f, _array(_f, 2), _array(_i, 2), _array(_f, 2), _array(_f, 1))
BOUND = types.void(_f, _f, _array(_f, 2), _array(_f, 1), _array(_f, 1), _array(_i, 2), _array(_f, 2))
IMPULSE = ENERGY
LINES = types.void(_f, _array(_f, 2), _array(_i, 2), _array(_f, 2))
STIFFNESS = types.void(*_common, _array(_f, 3), _array(_i, 2), _array(_f, 2), types.boolean)
MEET = types.int64(
    _f, _array(_f, 2), _array(_f, 2), _array(_f, 2), _array(_i, 2), _array(_f, 2), _array(_f, 2), types.int64
)
SWEEP = types.float64(_f, types.int64, _array(_f, 2), _array(_f, 2), _array(_f, 2), types.int64)
KEPT = types.void(types.int64, _array(_f, 2), _array(_f, 2), _array(_f, 2), types.int64, types.int64)
GIVE = types.void(types.int64, _array(_f, 2), _array(_f, 2), _array(_f, 2), types.int64, types.int64, _array(_f, 2))
_drift = (_f, _f, _f, _f, MATRIX, MATRIX, MATRIX, MATRIX, INDICES, MATRIX)
MEETS = types.boolean(*_drift, INTEGERS)
WATCH = types.boolean(*_drift, VECTOR, INTEGERS, INTEGERS)
SOON = types.float64(MATRIX, MATRIX, INDICES, MATRIX)
NEAR = types.int64(_f, _array(_f, 2), _array(_i, 2), _array(_f, 2), INTEGERS)


def _cache_folder():
    package = pathlib.Path(__file__).parent
    folders, state = os.walk(package), hashlib.sha256()
    for source in sorted(f"{at}/{name}" for at, _, names in folders for name in names if name.endswith(".py")):
        with open(source, "rb") as file:
            content = file.read()
        if b"kernel(" in content or b"ufunc(" in content:
            state.update(content)
    name = f"refweb-{state.hexdigest()[:16]}"
    if _config.CACHE_DIR:
        return str(pathlib.Path(_config.CACHE_DIR) / name)
    if os.access(package, os.W_OK):
        return str(package / "__pycache__" / name)
    return ""  # numba's own choice, a folder of the user's


_folder = _cache_folder()


class _Cache(FunctionCache):
    """Machine code of a function on disk, read without what only compiling needs.

    numba would first look for declarations of functions that have come since it last looked, all that it has at the
    first time, which takes as long as to read the machine code. Compiling looks by itself.
    """

    def load_overload(self, sig, target_context):
        """The machine code of a signature, None where there is none."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


class _CacheByName(_Cache):
    """Machine code of a function whose name tells what it captures.

    numba's own key is made of what the function captures as bytes, which of kernels and their types differ in every
    process.
    """

    def _index_key(self, signature, codegen):
        return signature, codegen.magic_tuple(), self._py_func.__qualname__


class _CacheOfBodies(_CacheByName):
    """Machine code of a function without its entry from Python, kept beside that with one."""

    def _index_key(self, signature, codegen):
        return *super()._index_key(signature, codegen), "body"


class _Entry(CompileResultCacheImpl):
    """Machine code that is entered from Python alone.

    It is kept without the code that kernels above would be optimized with, which takes three times as long to read.
    """

    def reduce(self, result):
        """What is kept: names alone stand in for that code."""
        (name, kind, code), *rest = super().reduce(result)
        if kind == "object":
            made = result.fndesc
            names = made.mangled_name, made.llvm_cpython_wrapper_name, made.llvm_cfunc_wrapper_name
            stubs = "\n".join(f'define void @"{stub}"() {{ ret void }}' for stub in names)
            code = code[0], parse_assembly(stubs).as_bitcode()
        return (name, kind, code), *rest


@contextlib.contextmanager
def _alone(function):
    """Keep other threads and processes from compiling a function."""
    with global_compiler_lock, contextlib.ExitStack() as stack:  # threads wait for each other inside of the first
        if fcntl is not None and _folder:
            with contextlib.suppress(OSError):
                os.makedirs(_folder, exist_ok=True)
                name = hashlib.sha256(f"{function.__module__}.{function.__qualname__}".encode()).hexdigest()[:16]
                fcntl.flock(stack.enter_context(open(f"{_folder}/{name}.lock", "w")), fcntl.LOCK_EX)
        yield


def _compiled_once(dispatcher):
    """A dispatcher that compiles `_alone`."""
    compile_one = dispatcher.compile

    def compile_alone(signature):
        with _alone(dispatcher.py_func):
            return compile_one(signature)

    dispatcher.compile = compile_alone
    return dispatcher


class _Kernel:
    """A kernel that numba sees where it is first called, listed or compiled into another: nobody asks for all."""

    def __init__(self, function, signature, options):
        self.py_func = function
        self._compiled = functools.cache(lambda: _compile(_with_body, function, signature, options))

    def __call__(self, *arguments):
        return self._compiled()(*arguments)

    def __getattr__(self, name):
        if name.startswith("_"):  # of copies and the like
            raise AttributeError(name)
        return getattr(self._compiled(), name)

    _numba_type_ = property(lambda self: numba.typeof(self._compiled()))

    def listed(self):
        """What stands in typed lists."""
        return self._compiled()


def _dispatcher(function, options, cache):
    """A dispatcher that compiles `_alone`, with its machine code in a cache."""
    dispatcher: Any = numba.njit(**options)(function)
    dispatcher._cache = cache(function)
    _compiled_once(dispatcher)
    return dispatcher


def _of_signature(dispatcher, signature):
    """A dispatcher of one signature, where one is given."""
    if signature is not None:
        dispatcher.compile(signature)
        dispatcher.disable_compile()
    return dispatcher


def _body(function, signature, options):
    bare = {**options, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return _of_signature(_dispatcher(function, bare, _CacheOfBodies), signature)


def _with_body(function, signature, options):
    """A kernel that Python, lists and kernels may call: these its body alone, which is compiled apart.

    The entry from Python takes apart all that it is given: for kernels that take records of a hundred arrays it is two
    fifths of the time that the explicit loop takes to compile, and only the outermost of them is called from Python.
    What the entry takes apart it counts references to, also that of a leaf.

    A number that a caller writes out is part of the types, so that bodies are compiled again for each such number: a
    tenth of all the time to compile. With its type alone explicit steps take seven times as long. Bodies that are left
    as they are, to be optimized with their callers alone, would take an eighth less.
    """
    cache = _CacheByName if function.__closure__ else _Cache
    dispatcher = _dispatcher(function, {**options, "_nrt": True}, cache)
    dispatcher._cache._impl = _Entry(function)
    body = functools.cache(lambda: _compile(_body, function, signature, options))
    dispatcher.get_call_template = lambda args, kws: body().get_call_template(args, kws)
    dispatcher.get_overload = lambda signature: body().get_overload(signature)
    return _of_signature(dispatcher, signature)


def _compile(decorator, *arguments) -> Any:
    default = _config.CACHE_DIR
    _config.CACHE_DIR = _folder or default
    try:
        return decorator(*arguments)
    finally:
        _config.CACHE_DIR = default


@functools.cache
def _content(code):
    """The content of the file that code stands in, or where there is none of the code itself."""
    try:
        return hashlib.sha256(pathlib.Path(code.co_filename).read_bytes()).hexdigest()
    except OSError:
        return repr((code.co_code, code.co_consts, code.co_names))


def _told(value):
    """What tells a captured value apart from all others, the same in every process."""
    if not isinstance(value, Dispatcher | _Kernel):
        return repr(value)
    function = value.py_func
    return f"{function.__module__}.{function.__qualname__} {_content(function.__code__)}"


def _named(function):
    """A function whose name tells apart what it captures."""
    if function.__closure__:
        captured = str([_told(cell.cell_contents) for cell in function.__closure__])
        function.__qualname__ += "_" + hashlib.sha256(captured.encode()).hexdigest()[:16]
    return function


def kernel(signature=None, leaf=False, **options) -> Any:
    """Compile a function, for any arguments or those of one signature, and keep its machine code on disk.

    Products and sums may contract to fused operations; nothing else departs from IEEE arithmetic.

    A ``leaf`` is for kernels to call, and of no signature. It counts no references to arrays, which takes 10 ns an
    array and call where loops hide that each is given back. So it neither makes nor returns arrays, nor calls what
    returns any, and has those in lists by `refweb.list_items.item` alone.
    """
    options = {"error_model": "numpy", "fastmath": {"contract"}, "nogil": True, "_nrt": not leaf, **options}
    return lambda function: _Kernel(_named(function), signature, options)


def record(cls):
    """Let numba type the first instance of a class of named tuples alone: all have fields of the same types.

    numba would look at every field at every call, which takes 0.8 ms for what the explicit loop takes.
    """
    known = []

    def kind(self):
        if not known:
            known.append(numba.typeof(self))
        return known[0]

    cls._numba_type_ = property(kind)
    return cls


def ufunc(signatures) -> Any:
    """Compile a scalar function into a numpy ufunc and keep its machine code on disk."""
    return lambda function: _compile(numba.vectorize(signatures, cache=True), function)


@kernel(leaf=True)
def copy_rows(source, target):
    """Copy rows of three numbers; numba's ``target[:] = source`` takes seconds to compile, for its errors."""
    for r in range(source.shape[0]):
        for k in range(3):
            target[r, k] = source[r, k]


@kernel(leaf=True)
def inner(one, other):
    """Inner product of two vectors; to read a kernel with numba's own, or its sum or ``in``, imports scipy.linalg."""
    total = 0.0
    for n in range(one.shape[0]):
        total += one[n] * other[n]
    return total


@kernel(leaf=True)
def among(values, value):
    """Whether a number is among those of a vector."""
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


@functools.cache
def _grown(item):
    """What appends one item to a list of its type, and begins that where there is none; nothing for no item."""
    kind = types.ListType(item)

    @kernel(kind(types.Optional(kind), types.Optional(item)))
    def grown(values, one):
        longer = numba.typed.List.empty_list(item) if values is None else values
        if one is not None:
            longer.append(one)
        return longer

    return grown


def typed_list(item, values) -> Any:
    """A numba typed list of kernels of one signature, or of arrays of one type.

    It is filled by compiled functions of explicit signature, whose machine code is kept on disk as well; numba's own
    list methods are compiled anew in every process.
    """
    grown = _grown(types.FunctionType(item) if isinstance(item, Signature) else item)
    result = grown(None, None)
    for value in values:
        grown(result, value.listed() if isinstance(value, _Kernel) else value)
    return result
