"""Workers of one test run do not compile the same kernel at the same time.

A fresh environment has no machine code on disk, and both workers want the same kernels first. One of them compiles a
function, the other waits for it and reads what it has written; different functions compile side by side.
"""

import hashlib
import os
import pathlib
import shutil
import tempfile

from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

try:
    import fcntl
except ImportError:  # no such locks on Windows: kernels are compiled twice there
    fcntl = None

RUN = os.environ.get("PYTEST_XDIST_TESTRUNUID")
LOCKS = pathlib.Path(tempfile.gettempdir()) / f"refweb-tests-{RUN}"


def pytest_configure(config):
    """Put a lock of its name around the compilation of each function, in workers."""
    if fcntl is None or RUN is None:
        return
    compile_one = Dispatcher.compile

    def compile_once(self, sig):
        name = hashlib.sha256(f"{self.py_func.__module__}.{self.py_func.__qualname__}".encode()).hexdigest()[:16]
        with global_compiler_lock:  # first that of this process, whose threads wait for each other inside of it
            LOCKS.mkdir(exist_ok=True)
            with open(LOCKS / name, "w") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                return compile_one(self, sig)

    Dispatcher.compile = compile_once


def pytest_unconfigure(config):
    """Remove the locks; a worker that goes on makes its own anew."""
    if RUN is not None:
        shutil.rmtree(LOCKS, ignore_errors=True)
