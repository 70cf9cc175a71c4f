"""Kernels: what compiles them, keeps their machine code on disk and hands records to them by one pointer.

===================  ==========================================================================================
`kernel`             what a kernel is: compiled when it is called, listed or prepared, and never before
`records`, `tables`  what kernels take by one pointer
`keys`               what the machine code of a kernel depends on
`store`              where it is kept: a folder of the user's, and one in the package of a wheel
`second_process`     a copy of the process that compiles as well, from the other end of a list
`numba_internals`    all that relies on private parts of numba, each with its reason and a way without it
===================  ==========================================================================================
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable

watchers: list[Callable[[int, int], None]] = []
"""Called with the number of kernels that have been compiled and of those that are to be, before each of them."""


@contextlib.contextmanager
def watched(tell):
    """Call ``tell`` before each kernel that is compiled in the block, see `watchers`."""
    watchers.append(tell)
    try:
        yield
    finally:
        watchers.remove(tell)
