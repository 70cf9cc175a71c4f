"""Kernels that several processes want at once: one compiles, the others wait for it and read what it has written.

Without that a cold start compiles every kernel in every process. It is worse than slow: numba numbers the machine code
of a function on disk by what stands there already, and two processes that write at once may put different code under
one number.
"""

from __future__ import annotations

import getpass
import hashlib
import pathlib
import tempfile

_DONE = []


def one_at_a_time(folder=None):
    """Put a lock of its name around the compilation of each function in this process; on Windows there are none.

    Parameters
    ----------
    folder : path-like, optional
        Where the locks are; by default one of the user's on this machine.
    """
    try:
        import fcntl
    except ImportError:
        return
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.dispatcher import Dispatcher

    if _DONE:
        return
    locks = pathlib.Path(folder or f"{tempfile.gettempdir()}/refweb-kernels-{getpass.getuser()}")
    compile_one = Dispatcher.compile

    def compile_once(self, sig):
        name = hashlib.sha256(f"{self.py_func.__module__}.{self.py_func.__qualname__}".encode()).hexdigest()[:16]
        with global_compiler_lock:  # first that of this process, whose threads wait for each other inside of it
            locks.mkdir(parents=True, exist_ok=True)
            with open(locks / name, "w") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                return compile_one(self, sig)

    Dispatcher.compile = compile_once
    _DONE.append(compile_one)
