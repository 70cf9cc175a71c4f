"""Storage of machine code: one file for each kernel and signature, named by a digest of its dependencies.

Files are searched in a folder of the user, see `folder`, then in the folder ``machine_code`` of this package, which a
wheel may contain. A file is written under another name and then renamed, so that several processes may share a folder.
Files unused for `UNUSED` are removed during compilation.

May change: the format of files and their names, since a change here gives all of them other names; `UNUSED` and
`NOTED`. Must stay: ``REFWEB_CACHE``; a file is never read half written or damaged; `V3`, the processors on which
machine code of wheels runs; `SHIPPED`, which ``pyproject.toml`` packs, `wheel` checks and ``refweb warm --ship`` fills;
names that `numba_internals` imports, of which `commands.warm` imports `portable`. Tests:
``tests/compiled/test_store.py``, ``test_kernel.py``.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import pathlib
import platform
import re
import time
import uuid

UNUSED = 90 * 24 * 3600.0
"""Time after which an unused file is removed [s]."""
NOTED = 24 * 3600.0
"""Age of a file above which its use updates its time [s]."""
PATIENCE = 30.0
"""Longest time to wait for another process that compiles the same kernel: it may be stopped [s]."""
NAMES = re.compile(r".*-[0-9a-f]{24}(\.lock)?|refweb-.*\.part")
"""Names of files that are written here."""
V3 = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
"""Features of a processor that runs code for x86-64-v3."""
CHECK = 16
"""Size of the checksum at the beginning of a file [byte]."""
SHIPPED = pathlib.Path(__file__).parent / "machine_code"
"""Folder of the machine code that a wheel contains."""


@functools.cache
def folder():
    """Folder of machine code: ``REFWEB_CACHE``, else the cache folder of the user; none can be made without a home."""
    if path := os.environ.get("REFWEB_CACHE"):
        return pathlib.Path(path)
    import platformdirs

    try:
        return pathlib.Path(platformdirs.user_cache_dir("refweb", appauthor=False)) / "kernels"
    except RuntimeError:
        return pathlib.Path(os.devnull) / "refweb"


def portable():
    """Processor and features of machine code in wheels for machines like this one; None if there is none."""
    machine = platform.machine().lower()
    if machine in ("x86_64", "amd64"):
        return "x86-64-v3", ""
    return ("generic", "") if machine in ("aarch64", "arm64") else None


def _checksum(content):
    return hashlib.blake2b(content, digest_size=CHECK).digest()


def read(path):
    """Content of a file, with an update of its time; None if it does not exist or is damaged."""
    with contextlib.suppress(OSError):
        content = path.read_bytes()
        if content[:CHECK] == _checksum(content[CHECK:]):
            _note_use(path)
            return content[CHECK:]
    return None


def _note_use(path):
    """Update the time of a file that is older than `NOTED`."""
    with contextlib.suppress(OSError):
        if time.time() - path.stat().st_mtime > NOTED:
            os.utime(path)


def write(name, content):
    """Write a file of machine code, if the folder can be written."""
    with contextlib.suppress(OSError):
        folder().mkdir(parents=True, exist_ok=True)
        path = folder() / f"refweb-{uuid.uuid4().hex}.part"
        try:
            path.write_bytes(_checksum(content) + content)
            os.replace(path, folder() / name)
        finally:
            path.unlink(missing_ok=True)
        prune()


@functools.cache
def prune():
    """Remove unused files, once in a process."""
    before = time.time() - UNUSED
    for path in folder().iterdir():
        with contextlib.suppress(OSError):
            if NAMES.fullmatch(path.name) and path.stat().st_mtime < before:
                path.unlink()


def _locked(fcntl, file):
    """Lock a file, if no other process has locked it; tell if it is locked."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


@contextlib.contextmanager
def alone(name):
    """Lock a name during compilation; other processes wait up to `PATIENCE`, and then read the written file."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(ImportError, OSError):
            import fcntl  # not on Windows, where each process compiles

            folder().mkdir(parents=True, exist_ok=True)
            path = folder() / f"{name}.lock"
            file = stack.enter_context(open(path, "w"))
            until = time.monotonic() + PATIENCE
            while not _locked(fcntl, file) and time.monotonic() < until:
                time.sleep(0.01)
            stack.callback(path.unlink, missing_ok=True)
        yield
