"""Kernels: their compilation, machine code on disk, and records that they read by one pointer.

===================  ==========================================================================================
`kernel`             kernels: compiled when they are called, put in a table or prepared, and not before
`records`, `tables`  arguments of kernels that are passed by one pointer
`keys`               digests of all on which the machine code of a kernel depends
`store`              files of machine code, in a folder of the user and in the package of a wheel
`second_process`     a copy of the process that compiles from the other end of a list
`numba_internals`    all uses of private parts of numba, with reasons and the ways without them
===================  ==========================================================================================

Time to compile, for 0.1 s of capture-stage from an empty cache (417 functions): two fifths are LLVM, of which its
optimization takes 16 s of 88, its output of machine code 10, its passes per function 7 and reading intermediate code 6;
the rest is numba in Python, which takes 0.05 to 0.1 s for the smallest function and grows with lines. So the number of
functions counts. No kernel takes more than 4 %. An expression of arrays, ``np.empty`` or ``reshape`` in a kernel
compiles functions of numba as well, which takes 0.05 to 0.2 s for each set of options. Less optimization
(``NUMBA_OPT=1``) saves 12 s and leaves most runs as quick, but contact with surface files takes 1.2 to 1.4 times as
long. A profile: ``REFWEB_COMPILERS=1 REFWEB_CACHE=EMPTY python -m cProfile -o FILE -m refweb run SCENE``, in which
Python takes twice its time.

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
