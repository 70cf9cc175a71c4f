"""A second process for compilation: a copy of this one, which starts at the other end of the list.

LLVM and the front end of numba hold locks, so that two threads compile no faster than one. A copy of the process has
all kernels of the list, needs no imports, and writes machine code to the folder of `refweb.compiled.store`, from which
the first process reads it. File locks prevent that both compile the same kernel. A copy is made only on Linux, on which
copying a process with threads is safe while no thread compiles.

May change: `LEAST`. Must stay: `beside`, which `kernel.prepare` calls; no copy is made off Linux or while a thread
compiles; the copy leaves by `os._exit`, so that it runs no handler of the first process, and none is left at the end.
Tests: ``tests/compiled/test_kernel.py``.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import warnings

from . import numba_internals

LEAST = 8
"""Least number of kernels for a second process; a copy costs some 20 ms."""


def allowed():
    """Tell if a second process may compile.

    It may not on one core, with ``REFWEB_COMPILERS=1``, and in a worker, since other workers use the other cores.
    """
    if sys.platform != "linux" or numba_internals.PLAIN or os.environ.get("REFWEB_COMPILERS") == "1":
        return False
    from multiprocessing import parent_process

    return len(os.sched_getaffinity(0)) > 1 and parent_process() is None


@contextlib.contextmanager
def beside(kernels):
    """Compile some kernels in a copy of this process, the last one first, while the block compiles from the first on.

    Parameters
    ----------
    kernels : list of refweb.compiled.kernel.Kernel
        Kernels without machine code on disk. Fewer than `LEAST` are left to the block.
    """
    if len(kernels) < LEAST or not allowed():
        yield
        return
    child = _copy(kernels)
    try:
        yield
    except BaseException:
        os.kill(child, signal.SIGKILL)
        raise
    finally:
        with contextlib.suppress(ChildProcessError):  # where the caller ignores SIGCHLD
            os.waitpid(child, 0)


def _copy(kernels):
    """Start a process that compiles kernels from the last one on; returns its id."""
    parent = os.getpid()
    with numba_internals.lock, warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of copies of processes with threads
        child = os.fork()
        if child:
            return child
    try:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process ends this one
        for kernel_ in reversed(kernels):
            if os.getppid() != parent:
                break
            if not kernel_.known():
                kernel_.address()
    finally:
        os._exit(0)
