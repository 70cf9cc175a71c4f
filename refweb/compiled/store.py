"""Storage of machine code: one file for each kernel and signature, named by all that it depends on.

It is looked for in a folder of the user's, see `folder`, then in the one that a wheel brings, ``machine_code`` in this
package. A file is written beside its place and moved there, so that several processes may share a folder, and is read
only where its name is that of what is asked for. Files unused for `UNUSED` are removed when something is compiled.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import pathlib
import platform
import tempfile
import time

UNUSED = 90 * 24 * 3600.0
"""Time after which a file that nobody has read is removed [s]."""
NOTED = 24 * 3600.0
"""Age of a file from which on its use is noted [s]."""
V3 = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
"""Features of a processor that runs code for x86-64-v3."""
CHECK = 16
"""Bytes of the checksum that a file begins with."""
SHIPPED = pathlib.Path(__file__).parent / "machine_code"
"""Folder of the machine code that a wheel contains."""


@functools.cache
def folder():
    """The folder that machine code is kept in: ``REFWEB_CACHE``, else one of the user's for the cache of programs."""
    if path := os.environ.get("REFWEB_CACHE"):
        return pathlib.Path(path)
    import platformdirs

    return pathlib.Path(platformdirs.user_cache_dir("refweb", appauthor=False)) / "kernels"


def portable():
    """(processor, features) that machine code in a wheel is made for on machines like this one; None where for none."""
    machine = platform.machine().lower()
    if machine in ("x86_64", "amd64"):
        return "x86-64-v3", ""
    return ("generic", "") if machine in ("aarch64", "arm64") else None


def _checksum(content):
    return hashlib.blake2b(content, digest_size=CHECK).digest()


def read(path):
    """Content of a file, whose use is noted; None where there is none, or a damaged one."""
    with contextlib.suppress(OSError):
        content = path.read_bytes()
        if content[:CHECK] == _checksum(content[CHECK:]):
            _note_use(path)
            return content[CHECK:]
    return None


def _note_use(path):
    """Give a file the present time, where its own is older than `NOTED`."""
    with contextlib.suppress(OSError):
        if time.time() - path.stat().st_mtime > NOTED:
            os.utime(path)


def write(name, content):
    """Write a file of machine code, where the folder can be written to."""
    with contextlib.suppress(OSError):
        folder().mkdir(parents=True, exist_ok=True)
        number, path = tempfile.mkstemp(dir=folder(), suffix=".part")
        with os.fdopen(number, "wb") as file:
            file.write(_checksum(content) + content)
        os.replace(path, folder() / name)
        prune()


@functools.cache
def prune():
    """Remove what nobody has used for long, once a process."""
    before = time.time() - UNUSED
    for path in folder().iterdir():
        with contextlib.suppress(OSError):
            if path.stat().st_mtime < before:
                path.unlink()


@contextlib.contextmanager
def alone(name):
    """Keep other processes from compiling what has a name; they wait, and read what has been written."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(ImportError, OSError):
            import fcntl  # not on Windows, where each process compiles

            folder().mkdir(parents=True, exist_ok=True)
            path = folder() / f"{name}.lock"
            file = stack.enter_context(open(path, "w"))
            fcntl.flock(file, fcntl.LOCK_EX)
            stack.callback(path.unlink, missing_ok=True)
        yield
