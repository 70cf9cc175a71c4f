"""A second process that compiles: a copy of this one, which begins at the other end of the list.

LLVM and numba's front end hold locks, so that two threads compile no faster than one. A copy of the process has all
kernels of the list with their records and factories, needs no imports, and leaves what it compiles in the folder of
`refweb.compiled.store`, where the first process reads what it comes to. Locks of files keep both from compiling the
same. There is a copy on Linux, where copies of processes with threads are safe while no thread compiles.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import warnings

from . import numba_internals

LEAST = 8
"""Number of kernels from which on a second process is begun; a copy costs some 20 ms."""


def allowed():
    """Tell if a second process may compile.

    Not on one core, not where ``REFWEB_COMPILERS=1`` says so, and not in a worker: its like are busy on other cores.
    """
    if sys.platform != "linux" or numba_internals.PLAIN or os.environ.get("REFWEB_COMPILERS") == "1":
        return False
    from multiprocessing import parent_process

    return len(os.sched_getaffinity(0)) > 1 and parent_process() is None


@contextlib.contextmanager
def beside(kernels):
    """Compile some kernels in a copy of this process, the last one first, while the block does so from the first on.

    Parameters
    ----------
    kernels : list of refweb.compiled.kernel.Kernel
        Those without machine code on disk. Fewer than `LEAST` are left to the block.
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
        os.waitpid(child, 0)


def _copy(kernels):
    """Number of the process that compiles kernels from the last one on."""
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
