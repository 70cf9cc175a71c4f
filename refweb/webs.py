"""A web is nodes, lines between them and the lines' natural lengths; here also the webs that are not lattices.

The tables `SingleCable`, `Inline` and `File` make a `Web`, as those of `refweb.lattices` do.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np

from . import inputs
from .inputs import InputError, Table, choice, integer, nearest, node_number, numbers_list, real, rows, shown, vector

SELECTIONS = ("centre", "rim", "corners", "all")
_TIE = 1e-9  # two distances are equal if they differ by less than this part of the web's size
_length = real(above=0, unit="m").metadata["read"]


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
        Nodes that the web's own rule supports, sorted.
    kind : {"paper", "window", "layers", "cable", "inline", "file"}
        The rule that made the web.
    cells : int, optional
        Number of meshes, by default lines − nodes + components.
    names : dict of str to tuple of int
        The user's names for nodes.
    groups : tuple of str, optional
        Group of each line, "" for none.
    length_given : bool, optional
        Whether natural lengths are data of their own and not distances; by default whether ``natural_length`` is given.

    Raises
    ------
    InputError
        For node numbers out of range, a line that joins a node to itself, repeats another one or has no length, nodes
        that no line uses, numbers that are not finite.

    Notes
    -----
    Arrays are C-contiguous and read-only.
    """

    points: np.ndarray
    lines: np.ndarray
    natural_length: np.ndarray | None = None
    rim: np.ndarray = ()
    kind: str = "inline"
    cells: int | None = None
    names: dict[str, tuple[int, ...]] = field(default_factory=dict)
    groups: tuple[str, ...] | None = None
    length_given: bool | None = None

    def __post_init__(self):
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
        groups = ("",) * len(lines) if self.groups is None else tuple(map(str, self.groups))
        if len(groups) != len(lines):
            raise InputError(f"groups has {len(groups)} entries for {len(lines)} lines")
        names = {name: _named(name, numbers, len(points)) for name, numbers in self.names.items()}
        rim = np.unique(_in_range("rim", self.rim, len(points))).astype(np.int32)
        given = self.natural_length is not None if self.length_given is None else bool(self.length_given)
        for name, value in (("points", points), ("lines", lines), ("natural_length", length), ("rim", rim)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        for name, value in (("groups", groups), ("names", names), ("length_given", given)):
            object.__setattr__(self, name, value)
        if self.cells is None:
            object.__setattr__(self, "cells", len(lines) - len(points) + self.components()[0])

    @property
    def cable_length(self):
        """Sum of the natural lengths [m]."""
        return float(self.natural_length.sum())

    @property
    def area(self):
        """Area of the bounding box [m²]: the product of its two largest sides, for a flat web those in x and y."""
        return float(np.sort(np.ptp(self.points, axis=0))[1:].prod())

    @property
    def centre(self):
        """Number of the node nearest the origin, of a cable nearest half its length; ties go to lowest y, then x."""
        size = np.ptp(self.points, axis=0).max()
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
    def corners(self):
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

    def components(self):
        """Number of connected parts and the part each node belongs to, shape (nodes,)."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        n = len(self.points)
        graph = coo_array((np.ones(len(self.lines), dtype=np.int8), tuple(self.lines.T)), shape=(n, n))
        return connected_components(graph, directed=False)

    def find(self, selection, name="node"):
        """Node numbers of a selection.

        Parameters
        ----------
        selection : int, str or list of them
            Node numbers, the user's names, "centre", "rim", "corners" or "all".
        name : str
            What messages call the selection.

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
            found = [self._find_one(f"{name}[{i}]", one) for i, one in enumerate(selection)]
        else:
            found = [self._find_one(name, selection)]
        return np.array(list(dict.fromkeys(chain(*found))), dtype=np.int64)

    def _find_one(self, name, one):
        if not isinstance(one, str):
            if not 0 <= node_number(name, one) < len(self.points):
                raise InputError(f"{name} = {one} must be 0 … {len(self.points) - 1}")
            return (one,)
        if one in self.names:
            return self.names[one]
        if one == "all":
            return range(len(self.points))
        if one == "rim" and not len(self.rim):
            raise InputError(f'{name} = "rim": this web has no supports of its own, give node numbers')
        if one in SELECTIONS:
            return np.atleast_1d(getattr(self, one)).tolist()
        raise InputError(f"{name} = {shown(one)} names no node, {nearest(one, (*SELECTIONS, *self.names))}")


def _first(bad):
    """Index of the first true entry, none if all are false."""
    return np.flatnonzero(bad)[:1].tolist()


def _in_range(name, numbers, count):
    numbers = np.asarray(numbers)
    if numbers.size and numbers.dtype.kind not in "iu":
        raise InputError(f"{name} = {shown(numbers.tolist())} must be node numbers")
    for i in _first((numbers < 0) | (numbers >= count)):
        raise InputError(f"{name}[{i}] = {numbers[i]} must be 0 … {count - 1}")
    return numbers.astype(np.int64)


def _named(name, numbers, count):
    if name in SELECTIONS:
        raise InputError(f"names.{name} = {shown(numbers)}: {', '.join(SELECTIONS)} have a meaning of their own")
    return tuple(_in_range(f"names.{name}", np.atleast_1d(numbers), count).tolist())


def _checked_lines(lines, nodes):
    lines = np.asarray(lines)
    if lines.ndim != 2 or lines.shape[1] != 2 or len(lines) == 0 or lines.dtype.kind not in "iu":
        raise InputError(f"lines of shape {lines.shape} must be at least one pair of node numbers, shape (lines, 2)")
    for i in _first(((lines < 0) | (lines >= nodes)).any(axis=1)):
        raise InputError(f"lines[{i}] = {lines[i].tolist()} must be node numbers 0 … {nodes - 1}")
    for i in _first(lines[:, 0] == lines[:, 1]):
        raise InputError(f"lines[{i}] = {lines[i].tolist()} joins a node to itself")
    key = lines.min(axis=1).astype(np.int64) * nodes + lines.max(axis=1)
    _, first, same = np.unique(key, return_index=True, return_inverse=True)
    for i in _first(first[same] != np.arange(len(lines))):
        j = first[same[i]]
        raise InputError(f"lines[{i}] = {lines[i].tolist()} repeats lines[{j}] = {lines[j].tolist()}")
    unused = np.flatnonzero(np.bincount(lines.ravel(), minlength=nodes) == 0)
    if len(unused):
        more = f" (and {len(unused) - 1} more)" if len(unused) > 1 else ""
        raise InputError(f"node {unused[0]}{more} is used by no line")
    return np.array(lines, dtype=np.int32, order="C")


@dataclass(frozen=True, kw_only=True)
class SingleCable(Table):
    """One cable with both ends fixed, of lines of equal natural length.

    Parameters
    ----------
    start, end : tuple of 3 floats
        Positions of the ends [m].
    elements : int
        Number of lines.
    length : float, optional
        Natural length of the whole cable [m], by default the distance of the ends. A longer cable lies on a circular
        arc with chords of exactly length/elements, a shorter one is straight and stretched.
    sag : tuple of 3 floats, optional
        Direction of the arc seen from the chord; by default −z, for a vertical cable −x.

    Raises
    ------
    InputError
        If the ends coincide, ``sag`` is parallel to the chord, or one line would be longer than the distance.
    """

    kind: str = choice("cable", default="cable")
    start: tuple = vector(unit="m")
    end: tuple = vector(unit="m")
    elements: int = integer(at_least=1, at_most=1_000_000)
    length: float | None = real(None, above=0, unit="m")
    sag: tuple | None = vector(None)

    def check(self):
        with np.errstate(over="ignore"):
            distance = np.linalg.norm(np.subtract(self.end, self.start))
        if not 0 < distance < np.inf:
            raise InputError(f"end = {list(self.end)} must be apart from start by a finite distance > 0 [m]")
        if self.sag is not None and self._aside(self.sag) is None:
            raise InputError(f"sag = {list(self.sag)} must not be zero or parallel to the cable, from start to end")
        if self.elements == 1 and self.length is not None and self.length > distance:
            raise InputError(f"elements = 1 must be ≥ 2: length = {self.length:g} m > distance = {distance:g} m")

    def _aside(self, direction):
        """Unit vector of the part of a direction that is normal to the chord; None if there is none."""
        chord = np.subtract(self.end, self.start)
        chord = chord / np.linalg.norm(chord)
        direction = np.divide(direction, np.linalg.norm(direction) or 1.0)
        aside = direction - (direction @ chord) * chord
        size = np.linalg.norm(aside)
        return aside / size if size > _TIE else None

    def web(self, base=None):
        """The `Web`, nodes numbered from start to end."""
        n, start, end = self.elements, np.array(self.start), np.array(self.end)
        distance = np.linalg.norm(end - start)
        length = distance if self.length is None else self.length
        points = np.linspace(start, end, n + 1)
        if length > distance:
            along, aside = _arc(n, distance, length)
            for down in (self.sag, (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0)):
                if down is not None and (down := self._aside(down)) is not None:
                    break
            points[1:-1] = start + along[:, None] * ((end - start) / distance) + aside[:, None] * down
        lines = np.stack([np.arange(n), np.arange(1, n + 1)], axis=1)
        each = np.full(n, length / n)
        return Web(points, lines, each, rim=(0, n), kind="cable", length_given=self.length is not None)


def _arc(n, distance, length):
    """Inner vertices of n equal chords on a circular arc: positions along and aside the line between its ends [m].

    Half the angle φ of a chord solves sin nφ/sin φ = n·distance/length, which decreases from n to 0 on (0, π/n).
    """
    from scipy.optimize import brentq

    chord = length / n
    excess = (length - distance) / chord

    def mismatch(phi):
        return excess - (n - np.sin(n * phi) / np.sin(phi)) if phi > 0 else excess

    phi = brentq(mismatch, 0.0, np.pi / n, xtol=1e-300, rtol=4 * np.finfo(float).eps, maxiter=1000)
    k = np.arange(1, n)
    if phi == 0:
        return k * chord, 0.0 * k
    scale = chord / np.sin(phi) * np.sin(k * phi)
    return scale * np.cos((n - k) * phi), scale * np.sin((n - k) * phi)


def _lengths(name, value):
    if isinstance(value, str):
        if value != "distance":
            raise InputError(f'{name} = {shown(value)} must be "distance", one number or one for each line [m]')
        return value
    if np.ndim(value):
        return tuple(_length(f"{name}[{i}]", one) for i, one in enumerate(value))
    return _length(name, value)


def _names(name, value):
    if not isinstance(value, dict):
        raise InputError(f"{name} = {shown(value)} must be a table of node numbers, such as {{tip = 3}}")
    result = {}
    for key, numbers in value.items():
        listed = numbers if isinstance(numbers, (list, tuple)) else [numbers]
        result[key] = tuple(node_number(f"{name}.{key}", one) for one in listed)
    return result


@dataclass(frozen=True, kw_only=True)
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
    groups : list of str, optional
        Group of each line.
    """

    kind: str = choice("inline", default="inline")
    points: tuple = rows(3, unit="m")
    lines: tuple = rows(2, number=node_number)
    natural_length: tuple | float | str = inputs.field(_lengths, "distance", "m")
    supports: tuple = numbers_list((), number=node_number, empty=True)
    names: dict = inputs.field(_names, factory=dict)
    groups: tuple | None = inputs.texts(None)

    def check(self):
        _in_range("supports", np.array(self.supports, dtype=np.int64), len(self.points))

    def web(self, base=None):
        """The `Web`."""
        length = self.natural_length
        if length == "distance":
            length = None
        elif np.ndim(length) == 0:
            length = np.full(len(self.lines), length)
        lines = np.array(self.lines, dtype=np.int64)
        return Web(self.points, lines, length, rim=self.supports, names=self.names, groups=self.groups)


@dataclass(frozen=True, kw_only=True)
class File(Table):
    """A web from a file that meshio reads and that has line cells and no others.

    Cell data ``natural_length`` [m] and ``group`` (numbers or texts) and point data ``support`` (not 0: fixed) are
    taken where present; other data is left alone.

    Parameters
    ----------
    path : str
        The file, relative to the scene's folder.

    Raises
    ------
    InputError
        From ``web``, if the file cannot be read or is not a web.

    Notes
    -----
    meshio does not come to an end on Tecplot and Kratos (mdpa) files that are cut off.
    """

    kind: str = choice("file", default="file")
    path: str = inputs.text()

    def web(self, base=None):
        """The `Web`; ``base`` is the folder that a relative path starts from."""
        try:
            return _web_of(_read(Path(base or ".") / self.path))
        except InputError as error:
            raise InputError(f"path = {shown(self.path)}: {error}") from None


def _read(path):
    """The mesh meshio reads; it reports some failures by printing and leaving the program."""
    import contextlib
    import io
    import warnings

    import meshio

    if not path.is_file():
        raise InputError(f"there is no file {path}")
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        reason = f"{type(error).__name__} {error}" if isinstance(error, Exception) else said.getvalue()
        reason = " ".join(reason.replace("Error: Couldn't read file", "").replace(str(path), "").split())[:200]
        raise InputError(f"meshio cannot read {path}; is it whole, and its data numeric? ({reason})") from None


def _web_of(mesh):
    kinds = [block.type for block in mesh.cells]
    other = sorted(set(kinds) - {"line"})
    if other or not kinds:
        raise InputError(f"{', '.join(other) or 'no'} cells: a web has line cells and no others")
    points = np.asarray(mesh.points)
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise InputError(f"points of shape {points.shape} must have the shape (nodes, 3)")
    points = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    lines = np.concatenate([block.data for block in mesh.cells]).astype(np.int64)
    length, group = (
        np.concatenate(mesh.cell_data[key]) if key in mesh.cell_data else None for key in ("natural_length", "group")
    )
    length = _numbers("natural_length", length, len(lines))
    support = _numbers("support", mesh.point_data.get("support"), len(points))
    rim = () if support is None else np.flatnonzero(support)
    return Web(points, lines, length, rim=rim, kind="file", groups=_group_names(group, len(lines)))


def _numbers(name, values, count):
    if values is None:
        return None
    values = np.asarray(values)
    if values.size != count or values.dtype.kind not in "biuf" or not np.isfinite(values).all():
        raise InputError(f"{name} of shape {values.shape} must be {count} finite numbers")
    return values.reshape(count).astype(np.float64)


def _group_names(values, count):
    """Group of each line as text: 2 and 2.0 read "2"."""
    if values is None:
        return None
    values = np.asarray(values)
    if values.size != count:
        raise InputError(f"group of shape {values.shape} must have one entry for each of {count} lines")

    def text(value):
        if isinstance(value, bytes):
            return value.decode(errors="replace")
        return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)

    return tuple(map(text, values.reshape(count).tolist()))
