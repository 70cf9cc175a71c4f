"""Webs: nodes, lines between them and their natural lengths, and the selection of nodes and lines by name.

May change: private functions and texts of errors; `_TIE` decides which node is the centre. Must stay: fields and
methods of `Web`, which `refweb` exports, with arrays that are read-only; words in `SELECTIONS`, which are the scene
format; the order in which `find` and `find_lines` return numbers; `in_range`, which `inline` imports. Tests:
``tests/net/test_webs.py``, ``tests/net/test_groups.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..messages import nearest, quote
from ..tables import Several, node_number
from .groups import by_place, members

if TYPE_CHECKING:
    from numpy.typing import NDArray

SELECTIONS = ("centre", "rim", "corners", "all")
_TIE = 1e-9  # two distances are equal if they differ by less than this part of the web's size


@dataclass(frozen=True, eq=False)
class Web:
    """A net of straight lines in its stress-free or prestressed position.

    Parameters
    ----------
    points : ndarray of shape (nodes, 3)
        Positions [m].
    lines : ndarray of shape (lines, 2)
        End nodes of each line, as int32.
    natural_length : ndarray of shape (lines,), optional
        Natural length of each line [m], by default the distance of its end nodes.
    rim : ndarray of shape (k,)
        Nodes that the generator of the web supports, sorted.
    kind : {"paper", "window", "layers", "cable", "inline", "file"}
        Generator of the web.
    cells : int, optional
        Number of meshes, by default lines − nodes + components.
    names : dict of str to tuple of int
        The user's names for nodes.
    groups : sequence of str or dict of str to sequence of int, optional
        Group of each line, "" for none, or the lines of each group, which may share lines. The attribute is a dict of
        increasing int64 arrays of the lines of each group, with the groups by supports of `refweb.net.groups`.
    length_given : bool, optional
        True if natural lengths are separate data, not distances; by default True if ``natural_length`` is given.
    broken : sequence of int
        Lines that are broken and carry nothing; the attribute is an increasing int64 array.
    notes : sequence of refweb.findings.Finding
        Findings on the reading of its file.

    Raises
    ------
    InputError
        For node numbers out of range, a line that joins a node to itself or has no length, numbers that are not finite.

    Notes
    -----
    Arrays are C-contiguous and read-only.
    """

    points: Several
    lines: Several
    natural_length: Several = None
    rim: Several = ()
    kind: str = "inline"
    cells: int | None = None
    names: dict[str, tuple[int, ...]] = field(default_factory=dict)
    groups: Several = None
    length_given: bool | None = None
    broken: Several = ()
    notes: Several = ()

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=np.float64, order="C")
        if points.ndim != 2 or points.shape[1] != 3:
            raise InputError(f"points of shape {points.shape} must have the shape (nodes, 3)")
        for i in _first(~np.isfinite(points).all(axis=1)):
            raise InputError(f"points[{i}] = {points[i].tolist()} must be finite [m]")
        lines = _checked_lines(self.lines, len(points))
        if self.natural_length is None:
            with np.errstate(over="ignore"):
                length = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
            for i in _first(length == 0):
                raise InputError(f"lines[{i}] = {lines[i].tolist()} has no length: its nodes coincide")
        else:
            length = np.array(self.natural_length, dtype=np.float64)
        if length.shape != (len(lines),):
            raise InputError(f"natural_length has {length.size} entries for {len(lines)} lines")
        for i in _first(~((length > 0) & np.isfinite(length))):
            raise InputError(f"natural_length[{i}] = {length[i]:g} must be finite and > 0 [m]")
        groups = members(self.groups, len(lines))
        names = {name: _named(name, numbers, len(points)) for name, numbers in self.names.items()}
        rim = np.unique(in_range("rim", self.rim, len(points))).astype(np.int32)
        groups |= {
            name: group_members
            for name, group_members in by_place(lines, rim, len(points)).items()
            if name not in groups
        }
        broken = np.unique(in_range("broken", self.broken, len(lines)))
        given = self.natural_length is not None if self.length_given is None else bool(self.length_given)
        for name, value in (
            ("points", points),
            ("lines", lines),
            ("natural_length", length),
            ("rim", rim),
            ("broken", broken),
        ):
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        for name, value in (("groups", groups), ("names", names), ("length_given", given)):
            object.__setattr__(self, name, value)
        if self.cells is None:
            object.__setattr__(self, "cells", len(lines) - len(points) + self.components()[0])

    @property
    def cable_length(self) -> float:
        """Sum of the natural lengths [m]."""
        return float(self.natural_length.sum())

    @property
    def area(self) -> float:
        """Area of the bounding box [m²]: the product of its two largest sides, in x and y for a flat web."""
        return float(np.sort(np.ptp(self.points, axis=0))[1:].prod())

    @property
    def centre(self) -> int:
        """Number of the node nearest the origin, for a cable its middle; among equal ones with least y, then x."""
        size = max(np.ptp(values) for values in self.points.T)
        if self.kind == "cable":
            near = np.unique([len(self.lines) // 2, (len(self.lines) + 1) // 2])
        else:
            distance = np.linalg.norm(self.points, axis=1)
            near = np.flatnonzero(distance <= distance.min() + _TIE * size)
        for axis in (1, 0, 2):
            value = self.points[near, axis]
            near = near[value <= value.min() + _TIE * size]
        return int(near[0])

    @property
    def corners(self) -> NDArray[np.int64]:
        """Numbers of the hull's vertices, sorted, shape (k,); refused unless the web lies in z = 0."""
        from scipy.spatial import ConvexHull, QhullError

        size = np.ptp(self.points, axis=0).max()
        height = np.abs(self.points[:, 2]).max()
        if height > _TIE * size:
            raise InputError(f"corners are those of a flat web in z = 0 m; this web reaches |z| = {height:g} m")
        try:
            hull = ConvexHull(self.points[:, :2]).vertices
        except QhullError:
            raise InputError("corners are those of a flat web; the nodes of this web lie on one line") from None
        side = np.roll(self.points[hull, :2], -1, axis=0) - self.points[hull, :2]
        side /= np.linalg.norm(side, axis=1)[:, None]
        before = np.roll(side, 1, axis=0)
        turn = before[:, 0] * side[:, 1] - before[:, 1] * side[:, 0]
        return np.sort(hull[turn > _TIE]).astype(np.int64)

    @property
    def bare(self) -> NDArray[np.int64]:
        """Numbers of the nodes that no line uses, sorted, shape (k,)."""
        return np.flatnonzero(np.bincount(self.lines.ravel(), minlength=len(self.points)) == 0)

    def components(self) -> tuple[int, NDArray[np.int32]]:
        """Number of connected parts and the part each node belongs to, shape (nodes,)."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        n = len(self.points)
        graph = coo_array((np.ones(len(self.lines), dtype=np.int8), tuple(self.lines.T)), shape=(n, n))
        return connected_components(graph, directed=False)

    def find(self, selection: Any, name: str = "node") -> NDArray[np.int64]:
        """Node numbers of a selection.

        Parameters
        ----------
        selection : int, str or list of them
            Node numbers, the user's names, "centre", "rim", "corners" or "all".
        name : str
            Name of the selection in messages.

        Returns
        -------
        ndarray of shape (k,)
            Node numbers as int64, in the order given, each once.

        Raises
        ------
        InputError
            For a number out of range or an unknown name.
        """
        if isinstance(selection, (list, tuple, np.ndarray)):
            numbers = [self._find_one(f"{name}[{i}]", part) for i, part in enumerate(selection)]
        else:
            numbers = [self._find_one(name, selection)]
        return np.array(list(dict.fromkeys(chain(*numbers))), dtype=np.int64)

    def find_one(self, selection: Any, name: str = "node") -> int:
        """Number of the one node of a selection; refuses several, and what `find` refuses."""
        numbers = self.find(selection, name)
        if len(numbers) != 1:
            raise InputError(f"{name} = {quote(selection)} is {len(numbers)} nodes, must be one")
        return int(numbers[0])

    def find_around(self, selection: Any) -> NDArray[np.int64]:
        """Find nodes, as `find`; nodes of one name in counterclockwise order around their middle."""
        numbers = self.find(selection)
        if not isinstance(selection, str) or len(numbers) < 3:
            return numbers
        away = self.points[numbers] - self.points[numbers].mean(axis=0)
        first, second, normal = np.linalg.svd(away)[2]
        turn = np.copysign(1.0, normal[np.abs(normal).argmax()] * np.linalg.det([first, second, normal]))
        return numbers[np.argsort(turn * np.arctan2(away @ second, away @ first), kind="stable")]

    def find_lines(self, selection: Any, name: str = "lines") -> NDArray[np.int64]:
        """Line numbers of a selection.

        Parameters
        ----------
        selection : int, str or list of them
            Line numbers, groups, or "all".
        name : str
            Name of the selection in messages.

        Returns
        -------
        ndarray of shape (k,)
            Line numbers as int64, increasing, each once.

        Raises
        ------
        InputError
            For a number out of range, or a name without lines.
        """
        if isinstance(selection, (list, tuple, np.ndarray)):
            numbers = [self._find_lines(f"{name}[{i}]", part) for i, part in enumerate(selection)]
        else:
            numbers = [self._find_lines(name, selection)]
        return np.unique(np.concatenate(numbers)).astype(np.int64)

    def _find_lines(self, name, part):
        if not isinstance(part, str):
            if not 0 <= node_number(name, part) < len(self.lines):
                raise InputError(f"{name} = {part} must be 0 … {len(self.lines) - 1}")
            return [part]
        if part in self.groups:
            return self.groups[part]
        if part == "all":
            return np.arange(len(self.lines))
        if part == "rim":
            raise InputError(f'{name} = "rim": no line of this web joins two nodes of its rim, give line numbers')
        raise InputError(f"{name} = {quote(part)} names no line, {nearest(part, ('all', *self.groups))}")

    def _find_one(self, name, part):
        if not isinstance(part, str):
            if not 0 <= node_number(name, part) < len(self.points):
                raise InputError(f"{name} = {part} must be 0 … {len(self.points) - 1}")
            return (part,)
        if part in self.names:
            return self.names[part]
        if part == "all":
            return range(len(self.points))
        if part == "rim" and not len(self.rim):
            raise InputError(f'{name} = "rim": this web has no supports of its own, give node numbers')
        if part in SELECTIONS:
            return np.atleast_1d(getattr(self, part)).tolist()
        raise InputError(f"{name} = {quote(part)} names no node, {nearest(part, (*SELECTIONS, *self.names))}")


def _first(bad):
    """Index of the first true entry, none if all are false."""
    return np.flatnonzero(bad)[:1].tolist()


def in_range(name: str, numbers: Any, count: int) -> NDArray[np.int64]:
    """Numbers as int64; refuse those that are not 0 … count − 1."""
    numbers = np.asarray(numbers)
    if numbers.size and numbers.dtype.kind not in "iu":
        raise InputError(f"{name} = {quote(numbers.tolist())} must be node numbers")
    for i in _first((numbers < 0) | (numbers >= count)):
        raise InputError(f"{name}[{i}] = {numbers[i]} must be 0 … {count - 1}")
    return numbers.astype(np.int64)


def _named(name, numbers, count):
    if name in SELECTIONS:
        raise InputError(f"names.{name} = {quote(numbers)}: {', '.join(SELECTIONS)} have a meaning of their own")
    return tuple(in_range(f"names.{name}", np.atleast_1d(numbers), count).tolist())


def _checked_lines(lines, nodes):
    lines = np.asarray(lines)
    if lines.ndim != 2 or lines.shape[1] != 2 or len(lines) == 0 or lines.dtype.kind not in "iu":
        raise InputError(f"lines of shape {lines.shape} must be at least one pair of node numbers, shape (lines, 2)")
    for i in _first(((lines < 0) | (lines >= nodes)).any(axis=1)):
        raise InputError(f"lines[{i}] = {lines[i].tolist()} must be node numbers 0 … {nodes - 1}")
    for i in _first(lines[:, 0] == lines[:, 1]):
        raise InputError(f"lines[{i}] = {lines[i].tolist()} joins a node to itself")
    return np.array(lines, dtype=np.int32, order="C")
