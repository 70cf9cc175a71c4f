"""Webs given node by node and line by line in the scene.

May change: private functions and texts of errors. Must stay: keys and docstring of `Inline` (scene format and help;
after a change write ``validation/REFERENCE.md`` anew); the order of nodes and lines as given; the class name, which
`registry.WEBS` and `studies.form` have. Tests: ``tests/net/test_webs.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..accepted import accepts, any_of, array, by_name
from ..errors import InputError
from ..messages import quote
from ..tables import (
    Several,
    Table,
    checked,
    choice,
    field,
    node_number,
    numbers_list,
    read_all,
    real,
    rows,
    table,
    texts,
)
from .web import Web, in_range

if TYPE_CHECKING:
    from os import PathLike

LENGTH = real(above=0, unit="m")


@accepts(any_of({"enum": ["distance"]}, LENGTH.metadata["read"].accepts, array(LENGTH.metadata["read"].accepts)))
def _lengths(name, value):
    if isinstance(value, str):
        if value != "distance":
            raise InputError(f'{name} = {quote(value)} must be "distance", one number or one for each line [m]')
        return value
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, (list, tuple)):
        return tuple(read_all(name, value, LENGTH.metadata["read"]))
    return checked(name, value, LENGTH)


@accepts(by_name(any_of(node_number.accepts, array(node_number.accepts, 1))))
def _names(name, value):
    if not isinstance(value, dict):
        raise InputError(f"{name} = {quote(value)} must be a table of node numbers, such as {{tip = 3}}")
    result = {}
    for key, numbers in value.items():
        listed = numbers if isinstance(numbers, (list, tuple)) else [numbers]
        if not listed:
            raise InputError(f"{name}.{key} = [] must be at least one node number")
        result[key] = tuple(node_number(f"{name}.{key}", node) for node in listed)
    return result


@accepts(any_of(array({"type": "string"}), by_name(array(node_number.accepts, 1))))
def _groups(name, value):
    if not isinstance(value, dict):
        return checked(name, value, texts())
    return {key: checked(f"{name}.{key}", lines, numbers_list(number=node_number)) for key, lines in value.items()}


@table
class Inline(Table):
    """A web given node by node and line by line.

    Parameters
    ----------
    points : list of [x, y, z]
        Positions [m].
    lines : list of [i, j]
        End nodes of each line.
    natural_length : list, float or "distance"
        Natural length of each line or of all [m], by default the distance of the end nodes.
    supports : list of int
        Nodes that are fixed unless the scene says otherwise.
    names : dict of str to int or list of int
        Names for nodes.
    groups : list of str or dict of str to list of int, optional
        Group of each line, "" for none; or the lines of each group, where a line may be in several.

    Raises
    ------
    InputError
        For rows that are not of three, or two, numbers, a natural length that is not > 0, a name without nodes, and a
        support that is none of the nodes; from ``web``, for whatever `refweb.Web` refuses.

    Examples
    --------
        [web]
        kind = "inline"
        points = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
        lines = [[0, 1], [1, 2]]
        supports = [0, 2]
        names = { tip = 1 }
    """

    kind: str = choice("inline", default="inline")
    points: Several = rows(3, unit="m")
    lines: Several = rows(2, number=node_number)
    natural_length: Several = field(_lengths, default="distance", unit="m")
    supports: Several = numbers_list(default=(), number=node_number, empty=True)
    names: dict[str, Any] = field(_names, default_factory=dict)
    groups: Several = field(_groups, default=None)

    def check(self) -> None:
        """Refuse supports that are none of the nodes."""
        in_range("supports", np.array(self.supports, dtype=np.int64), len(self.points))

    def web(self, base: str | PathLike[str] | None = None) -> Web:
        """The `Web`."""
        length = self.natural_length
        if length == "distance":
            length = None
        elif not isinstance(length, tuple):
            length = np.full(len(self.lines), length)
        lines = np.array(self.lines, dtype=np.int64)
        return Web(self.points, lines, length, rim=self.supports, names=self.names, groups=self.groups)
