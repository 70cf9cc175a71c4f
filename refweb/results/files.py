"""Files that are whole or do not exist: they are written under another name and then moved. Numbers as text.

May change: private functions; names of files while they are written, which begin with ``.refweb-``
(`results.folder.RESULT_FILES`). Must stay: that a file is whole or not there; `number`, which reads back to the same
float; the order of tables in `as_toml`, by which forces are added up: another order changes the last digits of a run
from that file; `write_atomically`, which `commands.gradient`, `commands.new` and other files import; `write_text`,
which `commands.new`, `pages.page` and other files import; `finite`, which `results.solution`, `sweeps.study_result` and
`sizing.size` import. Tests: ``tests/test_scene.py``, ``tests/test_faults.py``.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import pathlib

from ..errors import SolverError

_numbers = itertools.count()


def write_atomically(path, write):
    """Call ``write(file name)`` for a file beside ``path`` and move it there."""
    name = path.with_name(f".refweb-{os.getpid()}-{next(_numbers)}{path.suffix}")
    try:
        write(str(name))
        os.replace(name, path)
    except BaseException:
        name.unlink(missing_ok=True)
        raise


def write_text(path, text):
    """Write a text file atomically, as UTF-8."""
    write_atomically(path, lambda name: pathlib.Path(name).write_text(text, encoding="utf-8"))


def finite(given):
    """Plain values with None for infinite numbers, which JSON does not have."""
    if isinstance(given, dict):
        return {key: finite(value) for key, value in given.items()}
    if isinstance(given, list | tuple):
        return [finite(value) for value in given]
    return None if isinstance(given, float) and given - given != 0.0 else given


def write_json(path, content):
    """Write plain values atomically as JSON."""
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def append(file, content):
    """Append bytes to an open file without a buffer, or nothing if the disk is full."""
    size = os.fstat(file.fileno()).st_size
    try:
        while content:
            content = content[file.write(content) :]
    except OSError:
        file.truncate(size)
        raise


@contextlib.contextmanager
def written(folder, left):
    """Turn an error of writing into a `SolverError` that says which folder it is, and what is left in it."""
    try:
        yield
    except OSError as error:
        raise SolverError(f"{folder}: cannot be written any more: {error.strerror or error}; {left}") from None


def number(value):
    """A number as text that reads back to the same float."""
    return repr(float(value))


def as_toml(given):
    """The dict of a scene as TOML, with tables in the order of the dict, in which sums are taken."""
    import tomli_w

    parts = []
    for key, value in sorted(given.items(), key=lambda item: isinstance(item[1], (dict, list))):
        if isinstance(value, list):
            for entry in value:
                below = {name: inner for name, inner in entry.items() if _holds_tables(inner)}
                plain = {name: inner for name, inner in entry.items() if name not in below}
                parts.append(f"[[{key}]]\n{tomli_w.dumps(plain)}")
                for name, inner in below.items():
                    header, tables = f"[{key}.{name}]", inner if isinstance(inner, list) else [inner]
                    header = f"[{header}]" if isinstance(inner, list) else header
                    parts += [f"{header}\n{tomli_w.dumps(table)}" for table in tables]
        else:
            parts.append(tomli_w.dumps({key: value}))
    return "\n".join(parts)


def _holds_tables(value):
    """True for a table, and for a list of tables."""
    return isinstance(value, dict) or isinstance(value, list) and any(isinstance(item, dict) for item in value)
