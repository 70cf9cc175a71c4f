"""Trial of the kernels of a plug-in: indices beyond their arrays, which compiled kernels would read as other memory.

Python runs the kernels of a term, and what they call, on some of its cells: at the reference configuration, and at
random displacements, velocities and times. Branches that are not taken there are read in the source, as far as they
name a column by a number or a constant. An index that is computed in such a branch is not seen. `effect_parts` calls
`refuse_overruns` for effects of other packages alone.

May change: `CELLS`, and `STATES` by further ones: with fewer of both fewer branches are seen; words of messages and
remedies, of which ``tests/test_plugins.py`` quotes some. Must stay: `refuse_overruns`, which `effect_parts` calls; in
`_calls` the order of arguments, which is that of signatures in `refweb.kernels`, since kernels are called by position,
and the names "data", "cells" and "out", which `_in_source`, `refuse_overruns` and `REMEDIES` know; `_OverrunError` is
an `IndexError`. Arrays of a trial are copies and its numbers those of one seed: it changes nothing, and refuses the
same each time. Other exceptions of Python are passed over. A further kernel of a `ForceTerm` belongs in `_calls`:
without it, its indices are not tried. Tests: ``tests/test_plugins.py``.
"""

from __future__ import annotations

import ast
import functools
import inspect
import pathlib
import textwrap
import traceback
import types
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from ..compiled.keys import captured
from ..errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..effects.base import ForceTerm
    from ..net.net import Net

CELLS = 20
"""Largest number of cells of a trial."""
STATES = (0.0, 0.0), (1e-2, 0.3), (10.0, 1.0), (1e4, 3.0)
"""Times [s], and displacements over the size of the web, of trials: kernels may take other branches."""
ROWS = "rows are those of the numbers in cells, or of a cell"
"""Remedy for a row that an array does not have."""
REMEDIES = {
    "data": "give each cell all numbers that its kernels read",
    "cells": "give each cell all rows that its kernels couple",
    "out": "write what ForceTerm says of out: a power needs power = 0 in its Balance",
}
"""Remedies by the name of an array."""


class _OverrunError(IndexError):
    """An index beyond an array: its name, shape and axis. As an `IndexError` it ends loops over arrays."""


class _Watched(np.ndarray):
    """An array that raises an `_OverrunError` where an index is out of range, as its parts do."""

    name, full_shape = "", ()

    def __array_finalize__(self, source):
        self.name, self.full_shape = getattr(source, "name", ""), getattr(source, "full_shape", ())

    def __getitem__(self, index):
        try:
            return super().__getitem__(index)
        except IndexError:
            raise _OverrunError(self.name, self.full_shape, self._axis(index)) from None

    def __setitem__(self, index, value):
        try:
            super().__setitem__(index, value)
        except IndexError:
            raise _OverrunError(self.name, self.full_shape, self._axis(index)) from None

    def _axis(self, index):
        """Axis of the whole array that an index goes beyond."""
        first = index[0] if isinstance(index, tuple) else index
        within = not isinstance(first, int | np.integer) or -len(self) <= first < len(self)
        return min(len(self.full_shape) - self.ndim + int(within), len(self.full_shape) - 1)


def refuse_overruns(term: ForceTerm, net: Net, title: str) -> None:
    """Refuse a term whose kernels index beyond their arrays; ``title`` begins the message.

    Raises
    ------
    InputError
        The message names kernel, line, array and remedy.
    """
    if term.data is None or not len(term.cells):
        return
    calls = (call for state in STATES for call in _calls(term, net, *state))
    for name, kernel, arguments in calls:
        overrun = _in_source(kernel.py_func, arguments) or _by_trial(kernel.py_func, arguments)
        if overrun:
            array, shape, axis, location = overrun
            size = f"{shape[axis]} {('rows', 'columns')[axis]}" if len(shape) == 2 else f"the shape {shape}"
            if array in ("data", "cells", "out") and axis == 0:
                size = "a row for each cell"
            remedy = REMEDIES.get(array, "see the signatures in refweb.kernels") if axis else ROWS
            raise InputError(f"{title}: {name}: {location} reaches beyond {array}, which has {size}: {remedy}")


def _calls(term, net, t, moved_by) -> Iterator[tuple[str, Any, dict[str, Any]]]:
    """Name, kernel and arguments by name of each kernel of a term that has a trial, at a time and for displacements."""
    some = np.unique(np.linspace(0, len(term.cells) - 1, CELLS).astype(int))
    rows, count, width = len(net.points), len(some), 3 * term.cells.shape[1]

    def arrays(**given):
        for name, array in given.items():
            given[name] = array.view(_Watched)
            given[name].name, given[name].full_shape = name, array.shape
        return given

    size = moved_by * float(np.ptp(net.points, axis=0).max(initial=0.0))
    x, v = size * np.random.default_rng(0).uniform(-1.0, 1.0, (2, rows, 3))
    f = np.zeros((rows, 3))
    cells = {"cells": term.cells[some], "data": term.data[some]}
    moved, blocks = {"t": t, **arrays(x=x, v=v)}, np.zeros((count, width, width))
    yield "force", term.force, {**moved, **arrays(f=f, **cells, out=np.zeros((count, term.columns)))}
    bounds = {"reach": np.inf, "speed": 0.0, **arrays(x=x, mass=net.mass.copy(), rates=np.zeros(rows), **cells)}
    others = {
        "energy": (term.energy, {"t": t, **arrays(x=x, **cells, out=np.zeros(count))}),
        "impulse": (term.balance.impulse, {"t": t, **arrays(x=x, **cells, total=np.zeros(3))}),
        "tangent.stiffness": (term.tangent.stiffness, {**moved, **arrays(blocks=blocks, **cells), "definite": False}),
        "tangent.bound": (term.tangent.bound, bounds),
        "velocity.damping": (term.velocity.damping, {**moved, **arrays(blocks=blocks, **cells), "definite": False}),
        "velocity.bound": (term.velocity.bound, bounds),
    }
    yield from ((name, kernel, given) for name, (kernel, given) in others.items() if kernel is not None)


def _by_trial(function, arguments):
    """Name, shape and axis of an array, and the line that goes beyond it when Python runs a kernel; None without."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            _plain(function, {})(*arguments.values())
        except _OverrunError as error:
            frames = traceback.extract_tb(error.__traceback__)
            at = [frame for frame in frames if frame.filename != __file__][-1]
            return *error.args, f"line {at.lineno} of {pathlib.Path(at.filename).name}"
        except Exception:  # what Python computes in another way shows nothing
            return None
    return None


def _plain(value, known):
    """A kernel, or its function, as a function of Python that calls others as such; anything else as it is."""
    function = getattr(value, "py_func", value)
    if not isinstance(function, types.FunctionType) or (function is value and known):
        return value
    if function not in known:
        space, closure = dict(function.__globals__), function.__closure__ or ()
        cells = tuple(types.CellType() for _ in closure)
        given = function.__code__, space, function.__name__, function.__defaults__, cells or None
        known[function] = types.FunctionType(*given)
        for name, item in captured(function):
            module, _, inner = name.partition(".")
            plain = _plain(item, known)
            space[module] = types.SimpleNamespace(**{**vars(space[module]), inner: plain}) if inner else plain
        for cell, item in zip(cells, closure, strict=True):
            cell.cell_contents = _plain(item.cell_contents, known)
    return known[function]


def _in_source(function, arguments):
    """Name, shape and axis of an array, and a column in the source that it does not have; None without one."""
    names = dict(zip(inspect.signature(function).parameters, arguments, strict=False))
    for name, column, text in _columns_of(function):
        array = names.get(name)
        if array in ("data", "cells") and column >= arguments[array].shape[1]:
            return array, arguments[array].shape, 1, text
    return None


@functools.cache
def _columns_of(function):
    """(Name, column, text) of each ``name[row, column]`` whose column is a number or a constant, a list.

    Names whose attributes or lengths are asked for are left out: the kernel may know how many columns there are.
    """
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, SyntaxError):
        return []
    nodes, columns = list(ast.walk(tree)), []
    asked = {ast.unparse(node.value) for node in nodes if isinstance(node, ast.Attribute)}
    lengths = [node.args[0] for node in nodes if isinstance(node, ast.Call) and ast.unparse(node.func) == "len"]
    asked |= {ast.unparse(part.value) for part in lengths if isinstance(part, ast.Subscript)}
    for node in nodes:
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Tuple) and len(node.slice.elts) == 2:
            name, column = ast.unparse(node.value), node.slice.elts[1]
            value: Any = function.__globals__.get(column.id) if isinstance(column, ast.Name) else None
            value = column.value if isinstance(column, ast.Constant) else value
            if isinstance(value, int) and name not in asked:
                columns.append((name, value, ast.unparse(node)))
    return columns
