"""Keys of machine code change with all that a kernel captures, and hold for one process where that cannot be known."""

import enum
import math
import os
import pathlib
import sys
import types

import numba
import numpy as np
import pytest

from refweb.compiled import keys, numba_internals, store
from refweb.kernels import kernel

HEAD = """
import collections, enum, math
import numba
import numpy as np
from numba.extending import overload
from refweb.kernels import kernel
"""
EDITS = {
    "default": "@kernel()\ndef helper(a, scale={0}):\n    return scale * a",
    "keyword default": "@kernel()\ndef helper(a, *, scale={0}):\n    return scale * a",
    "default of njit": "@numba.njit\ndef helper(a, scale={0}):\n    return scale * a",
    "signature of njit": "@numba.njit('float64({1})')\ndef helper(a):\n    return 2.0 * a",
    "option of njit": "@numba.njit(fastmath={2})\ndef helper(a):\n    return 2.0 * a",
    "enumeration": "class Mode(enum.Enum):\n    A = {0}\n\n@kernel()\ndef helper(a):\n    return Mode.A.value * a",
    "member": "MODE = enum.Enum('Mode', {{'A': {0}}}).A\n@kernel()\ndef helper(a):\n    return MODE.value * a",
    "fields": "K = collections.namedtuple('K', '{3}')(2.0, 3.0)\n@kernel()\ndef helper(a):\n    return K.k * a",
}
"""What is edited beside the body of a helper; the first and the second of each pair are put in."""
PAIRS = (2.0, 3.0), ("float64", "int64"), (True, False), ("k c", "c k")
UNKNOWN = {
    "vectorize": "@numba.vectorize\ndef helper(a):\n    return 2.0 * a",
    "overload": "def helper(a):\n    pass\n\n@overload(helper)\ndef _(a):\n    return lambda a: 2.0 * a",
    "class": "class helper:\n    pass",
    "itself": "@kernel()\ndef helper(a):\n    return 1.0 if a < 1.0 else helper(a - 1.0)",
}
"""Helpers whose part in the machine code cannot be described."""


def key_of(text):
    """Key of a kernel that calls the helper of a source."""
    module = types.ModuleType("my_webs.edited")
    exec(f"{HEAD}{text}\n\n@kernel()\ndef outer(a):\n    return helper(a)\n", vars(module))
    return module.outer.machine_code_key()


@pytest.mark.parametrize("edit", EDITS)
def test_a_key_changes_with_what_a_helper_is_beside_its_body(edit):
    before, after = (EDITS[edit].format(*(pair[n] for pair in PAIRS)) for n in range(2))
    assert key_of(before) == key_of(before) != key_of(after)


@pytest.mark.parametrize("what", UNKNOWN)
def test_a_key_holds_for_one_process_where_a_helper_cannot_be_described(what):
    assert keys.ONCE in key_of(UNKNOWN[what])


def test_other_classes_and_functions_are_known_by_name():
    assert keys.ONCE not in "".join(keys.described(value, ()) for value in (math.sin, np.sqrt, ValueError, len, np, 2))
    assert keys.ONCE in keys.described(type("Own", (), {"__module__": "my_webs"}), ())
    assert "0.5" in keys.described(enum.Enum("Mode", {"HALF": 0.5}), ())


def names(a):
    return profile.K * a  # noqa: F821


def test_a_module_of_a_user_may_have_the_name_of_a_standard_one(tmp_path, monkeypatch):
    """As ``profile``, a profile of wind: its numbers are followed, and those of the standard module are not."""
    for file, found in ((tmp_path / "profile.py", "profile.K"), (pathlib.Path(os.__file__).parent / "x.py", "profile")):
        module = types.ModuleType("profile")
        module.K, module.__file__ = 2.0, str(file)
        monkeypatch.setitem(sys.modules, "profile", module)
        monkeypatch.setitem(globals(), "profile", module)
        assert [name for name, _ in keys.captured(names)] == [found]


@pytest.mark.parametrize("name, value", [("OPT", 0), ("BOUNDSCHECK", 1)])
def test_a_key_has_the_settings_of_numba(monkeypatch, name, value):
    monkeypatch.setattr(numba.core.config, name, value)
    other = keys.platform_key.__wrapped__(numba_internals.host())
    monkeypatch.undo()
    assert other != keys.platform_key(numba_internals.host())


TABLE = np.full((200_000, 2), 2.0)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder of machine code."""
    monkeypatch.setattr(store, "folder", lambda: tmp_path)
    return tmp_path


@pytest.mark.parametrize("table", [TABLE[:, 1], TABLE], ids=["column", "large"])
def test_machine_code_with_an_address_is_not_kept(folder, table):
    """Numba captures the address of a large array, or of one that is not contiguous: it is another in each process."""

    @kernel()
    def inner(n):
        return table.flat[n]

    @kernel()
    def outer(n):
        return 2.0 * inner(n)

    assert outer(0) == 4.0
    assert not any("inner" in path.name or "outer" in path.name for path in pathlib.Path(folder).iterdir())


NUMBER = 2.0


@kernel()
def helper(a):
    return NUMBER * a


@kernel()
def outer(a):
    return 10.0 * helper(a)


def test_a_kernel_follows_what_it_captures_within_a_process(monkeypatch):
    """As in a notebook, where a cell with a number or a helper runs again."""
    assert outer(1.0) == 20.0 and not outer.renew()
    monkeypatch.setitem(globals(), "NUMBER", 3.0)
    assert outer.renew() and not outer.renew() and outer(1.0) == 30.0 == outer(1)

    @kernel()
    def other(a):
        return -a

    monkeypatch.setitem(globals(), "helper", other)
    assert outer.renew() and outer(1.0) == -10.0


@kernel()
def factorial(n):
    if n < 2:
        return 1
    return n * factorial(n - 1)


@kernel()
def calls_it(n):
    return factorial(n)


def test_a_kernel_calls_itself():
    assert calls_it(5) == 120


def test_a_helper_may_be_defined_below():
    @kernel()
    def first(a):
        return 2.0 * below(a)

    @kernel()
    def below(a):
        return 3.0 * a

    assert first(1.0) == 6.0


def test_kernels_compile_where_numba_is_told_not_to(monkeypatch):
    monkeypatch.setattr(numba.core.config, "DISABLE_JIT", 1)

    @kernel()
    def doubled(a):
        return 2.0 * a

    assert doubled(2.0) == 4.0 and numba.core.config.DISABLE_JIT == 1
