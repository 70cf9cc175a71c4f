"""Kernels: their compilation, machine code on disk, and records that they read by one pointer.

===================  ==========================================================================================
`kernel`             kernels: compiled when they are called, put in a table or prepared, and not before
`records`, `tables`  arguments of kernels that are passed by one pointer
`keys`               digests of all on which the machine code of a kernel depends
`store`              files of machine code, in a folder of the user and in the package of a wheel
`second_process`     a copy of the process that compiles from the other end of a list
`numba_internals`    all uses of private parts of numba, with reasons and the ways without them
===================  ==========================================================================================

Room: the lowest, which imports nothing of refweb; other rooms take most of it through `refweb.kernels`, and rows from
`refweb.compiled.rows`. A change of any file here, even of a comment, compiles all kernels of all users again: change
several at once. May change: what each file says. Must stay: ``watchers`` and `watched`, by which `results.progress`
counts compiled kernels; the first sentence, which stands in ``tests/test_architecture.py`` as well. Tests:
``tests/compiled``.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable

watchers: list[Callable[[int, int], None]] = []
"""Functions that are called before each compilation, with the numbers of compiled kernels and of all to compile."""


@contextlib.contextmanager
def watched(tell):
    """Call ``tell`` before each kernel that is compiled in the block, see `watchers`."""
    watchers.append(tell)
    try:
        yield
    finally:
        watchers.remove(tell)
