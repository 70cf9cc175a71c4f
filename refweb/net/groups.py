"""Groups of lines: names for sets of lines in a scene. A line may be in several.

Every web has groups by its own supports, the nodes of its rim, unless the user has given these names to others:

========== ==========================================================================
``rim``     lines between two nodes of the rim: the cable along a rim that is held
``anchors`` lines with one node of the rim: those that hang the web up
``inner``   all others
========== ==========================================================================

Each line is in one of these three. A group without lines is none.

`net.web`, `net.mesh_file` and `net.faces` call `members`. May change: private functions and texts of errors. Must stay:
names in `PLACES`, which are the scene format, in the order of the number of ends in the rim; increasing int64 arrays of
`members`; −1 of `givers` where no table gives a key, which `cable`, `plastic_keys`, `effects.rupture` and
`effects.temperature` read; `by_place`, which `web` imports. Tests: ``tests/net/test_groups.py``.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..messages import nearest, quote

PLACES = ("inner", "anchors", "rim")
"""Groups by the number of ends of a line in the rim."""


def members(given, count):
    """Numbers of the lines of each group, a dict of increasing int64 arrays.

    ``given`` is None, the group of each of the ``count`` lines, "" for none, or a dict of the lines of each group.
    """
    if given is None:
        return {}
    if "all" in list(given):
        raise InputError('groups: "all" is the name of all lines: names are unique')
    if isinstance(given, dict):
        return {str(name): _numbers(name, lines, count) for name, lines in given.items() if len(lines)}
    names = list(map(str, given))
    if len(names) != count:
        raise InputError(f"groups has {len(names)} entries for {count} lines")
    number = {name: i for i, name in enumerate(dict.fromkeys(names))}
    of = np.array([number[name] for name in names], dtype=np.int64)
    order = np.argsort(of, kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(of, minlength=len(number)))[:-1])
    return {name: part for name, part in zip(number, parts, strict=True) if name}


def _numbers(name, lines, count):
    lines = np.asarray(lines)
    if lines.ndim != 1 or lines.dtype.kind not in "iu":
        raise InputError(f"groups.{name} = {quote(lines.tolist())} must be line numbers")
    for line in lines[(lines < 0) | (lines >= count)][:1]:
        raise InputError(f"groups.{name} has line {line}, must be 0 … {count - 1}")
    return np.unique(lines).astype(np.int64)


def by_place(lines, rim, nodes):
    """The groups of `PLACES` that have lines, as `members`."""
    counts = np.zeros(nodes, dtype=np.int64)
    counts[rim] = 1
    ends = counts[lines].sum(axis=1)
    names_of = {name: np.flatnonzero(ends == k) for k, name in enumerate(PLACES)} if len(rim) else {}
    return {name: names_of[name] for name in reversed(PLACES) if name in names_of and len(names_of[name])}


def givers(groups, tables, count, where="groups"):
    """Number of the table that sets a key on each line, shape (lines,), −1 for none, for each key that is set.

    ``groups`` are lines of each group of a web with ``count`` lines, ``tables`` by name of the group, of which a key
    that is None is not given. A group that the web does not have, and a line with one key from two groups, are refused,
    with a message that begins with ``where``.
    """
    owners, names = {}, list(tables)
    for number, (name, table) in enumerate(tables.items()):
        if name not in groups:
            hint = nearest(name, groups) if groups else "this web has no groups"
            raise InputError(f"{where} {quote(name)} is not a group of lines, {hint}")
        for key in table.to_dict():
            by = owners.setdefault(key, np.full(count, -1))
            for line in groups[name][by[groups[name]] >= 0][:1]:
                raise InputError(
                    f"{where} {quote(names[by[line]])} and {quote(name)} both give {key} to line {line}: give it in "
                    "one of them"
                )
            by[groups[name]] = number
    return owners
