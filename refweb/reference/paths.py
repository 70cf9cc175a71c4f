"""Values of a scene by their path, such as ``solve.duration`` or ``body.0.velocity``.

A path is what TOML calls a dotted key, from the head of the scene file to the value. A number in it is an index, from
0; of tables with names, bodies and observables among them, the name will do, ``body.ball.velocity``. Values are put
where they belong before anything is checked, so that they are refused, or not, as if they stood in the file. The
table of an effect, or the list of its tables, is left out where it is ``false``: ``self_contact = false`` is the scene
whose lines do not touch each other.

May change: private functions, texts of errors and `LONGEST`. Must stay: the form of paths, which users write in
``--set``, in study files and in requirements; `with_value`, which gives a new dict and changes none, for `scene`,
`sweeps`, `sizing`, `gym`, `statics.gradients` and `dynamics.parameters`; `read_settings`, which `commands.arguments`
imports. Tests: ``tests/reference/test_paths.py``.
"""

from __future__ import annotations

import tomllib
from typing import Any

from ..errors import InputError, refused_at
from ..messages import nearest, one_line, quote, short
from ..registry import EFFECTS, known

LONGEST = 1000
"""Largest number of characters in a path."""


def read_settings(texts):
    """Values by path from texts ``PATH=VALUE``; of a path that is given twice the last one counts.

    A value is one of TOML; what is none, such as the bare word ``newton``, is a text.

    Raises
    ------
    InputError
        For what is no ``PATH=VALUE``, and for lists, tables and texts in quotes that TOML cannot read.
    """
    values = {}
    for given in texts:
        path, sign, word = given.partition("=")
        if not sign or not path.strip():
            raise InputError(f"--set {short(given)}: must be PATH=VALUE, such as solve.duration=0.5")
        values[path.strip()] = _read(path.strip(), word.strip())
    return values


def _read(path, word):
    try:
        read = tomllib.loads(f"value = {word}")
        if read.keys() == {"value"}:
            return read["value"]
        reason = "more than one value"
    except (ValueError, RecursionError) as error:
        reason = one_line(error)
    if word[:1] in ("[", "{", '"', "'"):
        raise InputError(f"--set {short(path)}={short(word)}: cannot be read as TOML: {reason}")
    return word


def with_value(given, path, value) -> dict[str, Any]:
    """The dict of a scene file with another value at a path.

    Parameters
    ----------
    given : dict
        Content of the file by TOML; it is not changed.
    path : str
        Keys and numbers with dots between. Tables that are missing are made, in a list of tables behind the last one.
    value : object
        As TOML reads it; False for an effect that is left out.

    Returns
    -------
    dict

    Raises
    ------
    InputError
        For what is no path, a number that is out of range, a name that no table of a list has, and a key of what holds
        none.
    """
    keys = _keys(path)
    if value is False and len(keys) == 1 and known(EFFECTS, keys[0]):
        return {key: table for key, table in given.items() if key != keys[0]}
    with refused_at(f"{short(path)} = {quote(value)}:"):
        return _put(given, keys, (), value)


def _keys(path):
    """The keys of a path, as TOML reads them."""
    keys = []
    try:
        table = tomllib.loads(f"{path} = 0") if len(str(path)) <= LONGEST else None
        while isinstance(table, dict):
            ((key, table),) = table.items()
            keys.append(key)
    except (ValueError, RecursionError):
        keys = []
    if not keys:
        wanted = 'must be keys and numbers with dots between, such as body.0.mass; other names stand in quotes, "a b"'
        raise InputError(f"path {quote(str(path))} {wanted}")
    return keys


def _put(value_here, keys, above, value) -> Any:
    """Value ``value_here``, below the keys ``above``, with a value put at ``keys``; None where nothing stands here."""
    if not keys:
        return value
    key, rest = keys[0], keys[1:]
    at = (*above, key)
    if value_here is None and key == "0" and len(above) == 1:
        return [_put(None, rest, at, value)]
    if value_here is None or isinstance(value_here, dict):
        value_here = value_here or {}
        return {**value_here, key: _put(value_here.get(key), rest, at, value)}
    if isinstance(value_here, (list, tuple)):
        number, changed = _number(value_here, key, at), list(value_here)
        changed[number : number + 1] = [_put(value_here[number] if number < len(value_here) else None, rest, at, value)]
        return changed
    raise InputError(f"{short('.'.join(above))} = {quote(value_here)} has no keys")


def _number(entries, key, at):
    """Number of an entry of a list, by number or by name; one more than there are adds a table."""
    parent, last = short(".".join(at[:-1])), len(entries) - 1
    if not entries:
        raise InputError(f"{parent} = [] is empty, give it whole")
    tables = any(isinstance(entry, dict) for entry in entries)
    if key.isascii() and key.isdecimal():
        if len(key) < 10 and int(key) <= last + tables:
            return int(key)
        adds = f"; {last + 1} adds one" if tables else ""
        raise InputError(f"{parent}.{short(key)}: the number must be 0 … {last}{adds}")
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in entries]
    if key in names:
        return names.index(key)
    known = [name for name in names if isinstance(name, str)]
    hint = f" or its name, {nearest(key, known)}" if known else ""
    raise InputError(f"{parent} is a list: {quote(key)} must be a number, 0 … {last},{hint}".removesuffix(","))
