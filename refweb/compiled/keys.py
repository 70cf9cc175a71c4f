"""Keys of machine code: digests of the bytecode of a kernel and of all that is compiled into it.

A changed comment, docstring or line number changes no bytecode, and nothing is compiled again. A kernel that is called
by its address is part of the key of its callers only by its signature: a change of it does not affect them.

May change: how texts are made, if they are the same in every process. Must stay: a key holds all that machine code
depends on, else stale code runs without a word; it holds no docstring, comment or line number. Packages in `LIBRARIES`
are not followed: none with kernels of its own may stand there. `globals_in` reads the bytecode of CPython ≥ 3.11: a new
version of Python has to be tried. Must stay as well: all names that `kernel`, `numba_internals` and other files import.
Tests: ``tests/compiled/test_keys.py``, ``test_kernel.py``.
"""

from __future__ import annotations

import enum
import functools
import hashlib
import opcode
import os
import pathlib
import platform
import sys
import types as python
import uuid

import numpy as np

LIBRARIES = {"numpy", "numba", "llvmlite", "scipy", *sys.stdlib_module_names}
"""Packages whose functions numba knows, or whose version is part of `platform_key`."""
SETTINGS = "OPT BOUNDSCHECK ENABLE_AVX LOOP_VECTORIZE SLP_VECTORIZE".split()
"""Variables of numba's configuration that change machine code."""
ONCE = f"once-{uuid.uuid4().hex}"
"""Mark of keys that hold for this process alone, since something captured cannot be described; it stays in digests."""
LOAD_GLOBAL, EXTENDED_ARG = opcode.opmap["LOAD_GLOBAL"], opcode.opmap["EXTENDED_ARG"]


def digest(*parts):
    """Digest of some texts, with the mark `ONCE` of any of them."""
    text = "\0".join(map(str, parts))
    return (ONCE if ONCE in text else "") + hashlib.sha256(text.encode()).hexdigest()[:24]


@functools.cache
def platform_key(processor):
    """Text of everything besides the source on which machine code depends: versions, processor and this package."""
    import llvmlite
    import numba
    from numba.core import config

    content = [path.read_bytes() for path in sorted(pathlib.Path(__file__).parent.glob("*.py"))]
    sources = hashlib.sha256(b"".join(content)).hexdigest()[:16]
    versions = numba.__version__, llvmlite.__version__
    settings = [str(getattr(config, name, "")) for name in SETTINGS]
    return " ".join(
        [sys.implementation.cache_tag, platform.system(), platform.machine(), *versions, *processor, sources, *settings]
    )


def code_of(code, docstring=None):
    """Text of the instructions of a code object, without line numbers and docstring, its first constant."""
    constants = [
        code_of(constant) if isinstance(constant, python.CodeType) else repr(constant) for constant in code.co_consts
    ]
    if docstring is not None and code.co_consts[:1] == (docstring,):
        constants = constants[1:]
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    return repr((code.co_code.hex(), constants, names, code.co_argcount, code.co_flags))


@functools.cache
def globals_in(code):
    """Names of the globals that a code object and nested ones load, a frozenset."""
    names, extended = set(), 0
    for operation, argument in zip(code.co_code[::2], code.co_code[1::2], strict=True):
        argument |= extended << 8
        if operation == LOAD_GLOBAL:
            names.add(code.co_names[argument >> 1])
        extended = argument if operation == EXTENDED_ARG else 0
    for constant in code.co_consts:
        if isinstance(constant, python.CodeType):
            names |= globals_in(constant)
    return frozenset(names)


def captured(function):
    """Pairs of name and value of the globals and closure of a function, in a fixed order."""
    for name in sorted(globals_in(function.__code__)):
        if name in function.__globals__:
            value = function.__globals__[name]
            yield from _used(name, value, set(function.__code__.co_names))
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, content_of(cell)


def content_of(cell):
    """Content of a cell of a closure; None as long as it is empty."""
    try:
        return cell.cell_contents
    except ValueError:
        return None


def _in_library(name):
    """True for the name of a module of `LIBRARIES`; a file of a user may have the name of a standard module."""
    first = name.partition(".")[0]
    if first not in sys.stdlib_module_names or first not in sys.modules:
        return first in LIBRARIES
    file, standard = getattr(sys.modules[first], "__file__", None), os.path.dirname(os.path.realpath(os.__file__))
    return file is None or os.path.realpath(file).startswith(standard) and "site-packages" not in file


def _used(name, value, attributes):
    """Pairs of name and value of a captured value; for a module of no library, its functions and values in use."""
    if isinstance(value, python.ModuleType) and not _in_library(value.__name__):
        for inner in sorted(attributes & vars(value).keys()):
            yield from _used(f"{name}.{inner}", getattr(value, inner), attributes - {inner})
    else:
        yield name, value


def described(value, visited):
    """Describe a captured value by a text that is the same in every process.

    Parameters
    ----------
    value : object
        A number, a text, a type, a kernel, a function, or a tuple of such; of anything else the text has `ONCE`.
    visited : tuple
        Functions that are being described, to end recursion.
    """
    if hasattr(value, "machine_code_key"):
        return value.machine_code_key()
    if isinstance(value, tuple):
        fields = getattr(value, "_fields", ())
        return f"{type(value).__qualname__} {fields} {[described(item, visited) for item in value]}"
    if isinstance(value, enum.Enum):
        return f"{type(value).__qualname__} {value.name} {value.value!r}"
    if isinstance(value, bool | int | float | str | bytes | type(None) | np.generic | np.dtype):
        return repr(value)
    if isinstance(value, np.ndarray):
        return f"array {value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, python.ModuleType):
        return f"module {value.__name__}"
    function = getattr(value, "py_func", None) or getattr(value, "_defn", None) or value
    if isinstance(function, python.FunctionType):
        followed = function is not value or _is_known(function)  # else numba knows it by another function
        given = "" if function is value else _options(value)
        return f"{of_function(function, visited)} {given} {'' if followed else ONCE}"
    if isinstance(value, type):
        return _described_class(value)
    return f"{type(value).__qualname__} {getattr(value, '__name__', value)} {'' if _is_known(value) else ONCE}"


def _is_known(value):
    """True for what a library or this package defines, whose version or source is part of the key."""
    module = getattr(value, "__module__", None) or type(value).__module__
    return module.partition(".")[0] == "refweb" or _in_library(module) and _in_library(type(value).__module__)


def _options(made):
    """Options of a dispatcher of numba, and its signatures where it takes no others."""
    signatures = () if getattr(made, "_can_compile", True) else tuple(getattr(made, "overloads", ()))
    return f"{sorted(getattr(made, 'targetoptions', {}).items(), key=str)} {signatures}"


def _described_class(kind):
    """Describe a class: an enumeration by its members, a named tuple by its fields, others by their names."""
    name = f"class {kind.__module__}.{kind.__qualname__}"
    if issubclass(kind, enum.Enum):
        return f"{name} {[(member.name, member.value) for member in kind]}"
    if hasattr(kind, "_fields"):
        return f"{name} {kind._fields} {getattr(kind, '_field_defaults', {})}"
    return name if issubclass(kind, BaseException) or _is_known(kind) else f"{name} {ONCE}"


def of_function(function, visited=()):
    """Text that changes with the code of a function and of all that it calls."""
    if function in visited:
        return f"again {function.__qualname__}"
    visited = (*visited, function)
    parts = [f"{name} = {described(value, visited)}" for name, value in captured(function)]
    given = function.__defaults__ or (), tuple(sorted((function.__kwdefaults__ or {}).items()))
    code = code_of(function.__code__, function.__doc__)
    return digest(function.__module__, function.__qualname__, code, described(given, visited), *parts)
