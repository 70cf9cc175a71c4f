"""Webs with triangle, square and hexagon meshes: webs of the paper, windows of any size, and concentric layers.

The paper is *Dynamic modelling and analysis of space webs*, Sci China-Phys Mech Astron 54 (2011). Lattice points have
integer coordinates in steps of `STEP` sides; the meshes are polygons of such points, and shared points and sides of
the polygons are the web's nodes and lines.

Groups of lines, beside ``rim``, ``anchors`` and ``inner`` of `refweb.net.groups`:

============= =========================================================================
``rows``      lines along x
``columns``   lines along y
``rising``    lines aslant, up to the right
``falling``   lines aslant, down to the right
``diagonals`` ``rising`` and ``falling``
``ring-K``    of layers: the outline of the innermost K layers, K = 1 … N
``spokes``    of layers: lines between two meshes of one layer, most from ring to ring
``rim``       of windows: the outline of the inner web, of ``inner`` as well
``corners``   of windows: lines of this ``rim`` that end where the inner web has its corners
============= =========================================================================

A web has the groups with lines: squares have ``rows`` and ``columns``, triangles have ``columns`` only at links of the
rim, and hexagons have ``rows`` only there. Supports are at the ends of links: webs of the paper have no ``rim``, and
the links are their ``anchors``. In a web of layers the nodes of the outline are supported, and the outline is the
``rim``. A line that cuts off a corner of a triangle has both nodes on the outline and belongs to ``rim`` too;
``ring-N`` is only the outline.

May change: private functions, as long as numbers stay; `_MOST_CELLS`, a limit of what is accepted. Must stay: constants
of the lattices (`MESHES` to `AREA`); the order of nodes and lines and the names of groups, by which scenes name them;
keys and docstrings of `Paper`, `Window` and `Layers` (scene format and help; after a change write
``validation/REFERENCE.md`` anew). Tests: ``tests/net/test_webs.py``, ``tests/net/test_window_sizes.py``,
``tests/net/test_groups.py``.
"""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import InputError
from ..tables import Table, choice, integer, real, table
from .web import Web

if TYPE_CHECKING:
    from os import PathLike

MESHES = ("triangle", "square", "hexagon")
#: Rows and columns of the paper's three webs (section 3.2).
PAPER = {"triangle": (29, 23), "square": (40, 40), "hexagon": (45, 40)}
#: Smallest window whose inner web hangs together, (rows, columns).
SMALLEST = {"triangle": (2, 1), "square": (2, 2), "hexagon": (2, 3)}
#: x and y of the lattice point (1, 1), in sides.
STEP = {"triangle": (0.5, sqrt(3) / 2), "square": (1.0, 1.0), "hexagon": (sqrt(3) / 2, 0.5)}
#: Width and height of a window in sides: (a, b) and (c, d) of a × columns + b and c × rows + d.
EXTENT = {
    "triangle": ((1.0, 2.0), (sqrt(3) / 2, 2.0 - sqrt(3) / 2)),
    "square": ((1.0, 0.0), (1.0, 0.0)),
    "hexagon": ((sqrt(3), -sqrt(3)), (1.5, -0.5)),
}
#: Area of a mesh of side 1.
AREA = {"triangle": sqrt(3) / 4, "square": 1.0, "hexagon": 3 * sqrt(3) / 2}

_UP = ((0, 0), (2, 0), (1, 1))
_DOWN = ((0, 0), (1, 1), (-1, 1))
_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 1))
_HEXAGON = ((0, -2), (1, -1), (1, 1), (0, 2), (-1, 1), (-1, -1))
_MOST_CELLS = 1_000_000
_PARALLEL = 1e-9  # sine of the angle below which a line lies along an axis


def _places(counts):
    """Row and column of each polygon, ``counts[j]`` in row j."""
    row = np.repeat(np.arange(len(counts)), counts)
    return row, np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)


def _rows(counts, first, polygon, pitch=(2, 1)):
    """Copies of a polygon, ``counts[j]`` in row j from x = ``first[j]`` on; integers, shape (polygons, corners, 2)."""
    row, column = _places(counts)
    points = np.stack([pitch[0] * column + np.asarray(first)[row], pitch[1] * row], axis=1)
    return points[:, None, :] + np.array(polygon)


class Tessellation(NamedTuple):
    """Net of polygons between lattice points.

    Attributes
    ----------
    nodes : ndarray of int, shape (nodes, 2)
        Shared corners, row by row.
    lines : ndarray of int, shape (lines, 2)
        Shared sides.
    frame : ndarray of bool, shape (lines,)
        True for sides of only one polygon.
    sides : ndarray of int, shape (polygons, corners)
        Line of each side of each polygon.
    """

    nodes: np.ndarray
    lines: np.ndarray
    frame: np.ndarray
    sides: np.ndarray


def _tessellation(polygons):
    """The `Tessellation` of polygons, an integer array of shape (polygons, corners, 2)."""
    corners = polygons.reshape(-1, 2)
    low = corners.min(axis=0)
    width = np.ptp(corners[:, 0]) + 1
    key, number = np.unique((corners - low) @ [1, width], return_inverse=True)
    number = number.reshape(polygons.shape[:2])
    ends = np.sort(np.stack([number, np.roll(number, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    sides, of, count = np.unique(ends @ [len(key), 1], return_inverse=True, return_counts=True)
    lines = np.stack([sides // len(key), sides % len(key)], axis=1)
    nodes = np.stack([key % width, key // width], axis=1) + low
    return Tessellation(nodes, lines, count == 1, of.reshape(number.shape))


def _directions(points, lines):
    """Groups by the direction of lines in the plane, see the module."""
    x, y, _ = (points[lines[:, 1]] - points[lines[:, 0]]).T
    along, up = abs(y) < _PARALLEL * abs(x), abs(x) < _PARALLEL * abs(y)
    aslant, rising = ~(along | up), x * y > 0.0
    groups = dict(rows=along, columns=up, rising=aslant & rising, falling=aslant & ~rising, diagonals=aslant)
    return {name: np.flatnonzero(these) for name, these in groups.items() if these.any()}


def _rings(net, layer):
    """Groups of a `Tessellation` whose polygons are in layers 1 … N."""
    low, high = np.full(len(net.lines), layer.max() + 1), np.zeros(len(net.lines), dtype=int)
    each = np.repeat(layer, net.sides.shape[1])
    np.minimum.at(low, net.sides.ravel(), each)
    np.maximum.at(high, net.sides.ravel(), each)
    ring = np.where(net.frame | (low < high), low, 0)
    rings = {f"ring-{k}": np.flatnonzero(ring == k) for k in range(1, layer.max() + 1)}
    return rings | ({"spokes": np.flatnonzero(ring == 0)} if (ring == 0).any() else {})


def _placed(nodes, mesh, side):
    """Positions (n, 3) [m] in z = 0, the bounding box centred at the origin."""
    centred = 2 * nodes - nodes.min(axis=0) - nodes.max(axis=0)
    return np.pad(centred * np.multiply(STEP[mesh], side / 2), ((0, 0), (0, 1)))


def _window(mesh, rows, columns, side, kind):
    """The paper's rule: a closed inner web, and one link to a fixed end for each outermost node and side."""
    if mesh == "triangle":
        odd = np.arange(rows - 1) % 2
        polygons = np.concatenate([_rows(columns - 1 + odd, 1 - odd, _UP), _rows(columns - odd, 1 + odd, _DOWN)])
        nodes, lines, _, sides = _tessellation(polygons)
        points = _placed(nodes, mesh, side)
        outward = [
            (np.flatnonzero(nodes[:, axis] == end), axis, sign)
            for axis in (1, 0)
            for end, sign in ((nodes[:, axis].min(), -1), (nodes[:, axis].max(), 1))
        ]
        links = np.concatenate([at for at, _, _ in outward])
        ends = np.concatenate([points[at] + sign * side * np.eye(3)[axis] for at, axis, sign in outward])
        rim = len(points) + np.arange(len(ends))
        points = np.concatenate([points, ends])
        lines = np.concatenate([lines, np.stack([links, rim], axis=1)])
    else:
        odd = np.arange(rows) % 2
        if mesh == "square":
            polygons = _rows(np.full(rows, columns), 0 * odd, _SQUARE, (1, 1))
        else:
            polygons = _rows(columns - odd, odd, _HEXAGON, (2, 3))
        nodes, lines, frame, sides = _tessellation(polygons)
        used, inner = np.unique(lines[~frame], return_inverse=True)
        rim = np.flatnonzero(np.isin(used, lines[frame]))
        points = _placed(nodes[used], mesh, side)
        lines = inner.reshape(-1, 2)
        sides = np.where(frame, -1, np.cumsum(~frame) - 1)[sides]
    groups = _directions(points, lines)
    if kind == "window":
        groups |= _outline(points, lines, rim, sides)
    return Web(points, lines, rim=rim, kind=kind, cells=len(polygons), groups=groups)


def _outline(points, lines, ends, sides):
    """Groups ``rim`` and ``corners`` of a window.

    ``ends`` are the nodes at the ends of links, and ``sides`` the line of each side of each polygon, −1 for none.
    """
    inner = np.logical_not(np.asarray(np.isin(lines, ends).any(axis=1)))
    complete = ((sides >= 0) & inner[sides]).all(axis=1)
    count = np.bincount(sides[complete].ravel(), minlength=len(lines))
    rim = np.flatnonzero(inner & (count < 2))
    if not len(rim):
        return {}
    nodes = np.unique(lines[rim])
    try:
        corners = nodes[Web(points[nodes], [[0, 1]]).corners]
    except InputError:  # all on one line, which has its ends alone
        corners = nodes[np.bincount(np.searchsorted(nodes, lines[rim]).ravel()) == 1]
    return {"rim": rim, "corners": rim[np.isin(lines[rim], corners).any(axis=1)]}


@table
class Paper(Table):
    """Web of section 3.2 of the paper: a triangle, square or hexagon web.

    Groups of lines: ``anchors``, the links at the rim; ``inner``, all others; of these and of links ``rows``,
    ``columns``, ``rising``, ``falling`` and ``diagonals``, see `refweb.net.lattices`.

    Parameters
    ----------
    mesh : {"triangle", "square", "hexagon"}
        755, 1677 and 3554 nodes.
    cable_length : float
        Total length of cable [m], which is the same for the three webs of the paper.

    Raises
    ------
    InputError
        For an unknown mesh, and a length that is not finite and > 0.

    Examples
    --------
        [web]
        kind = "paper"
        mesh = "hexagon"
        cable_length = 201.4
    """

    kind: str = choice("paper", default="paper")
    mesh: str = choice(*MESHES)
    cable_length: float = real(above=0, unit="m")

    def web(self, base: str | PathLike[str] | None = None) -> Web:
        """The `refweb.net.web.Web`.

        Notes
        -----
        The hexagon web has 5165 lines; the paper's caption of Figure 13 prints 5156. The cells are the paper's 1260,
        1600 and 1778: in the square and the hexagon web a sector between neighbouring links at the rim counts as a
        cell, in the triangle web it does not.
        """
        rows, columns = PAPER[self.mesh]
        lines = len(_window(self.mesh, rows, columns, 1.0, "paper").lines)
        return _window(self.mesh, rows, columns, self.cable_length / lines, "paper")


@table
class Window(Table):
    """A web by the rule of `Paper`, at any size: closed inner web, every outermost node linked to a fixed end.

    Groups of lines: ``anchors``, the links at the rim; ``inner``, all others; ``rim``, the outline of the inner web,
    and ``corners``, the lines of it that end at its corners; of inner lines and of links ``rows``, ``columns``,
    ``rising``, ``falling`` and ``diagonals``, see `refweb.net.lattices`.

    Parameters
    ----------
    mesh : {"triangle", "square", "hexagon"}
        Shape of the meshes.
    rows, columns : int
        Cells for squares, and for hexagons, whose every second row has one cell less; for triangles rows of inner
        nodes and nodes in the first of them, every second row having one node more. An even number of rows ends with
        a row of the second kind.
    width, height : float
        Size along x and y with links [m], in place of columns and rows. The web has the number of cells with the
        nearest size, and at least the smallest number; ``refweb check`` prints the actual size.
    side : float
        Length of each line [m].

    Raises
    ------
    InputError
        For rows below 2, for columns below 2, with triangles below 1 and with hexagons below 3; for rows × columns
        above a million; unless either columns or width is given, and either rows or height.

    Examples
    --------
        [web]
        kind = "window"
        mesh = "square"
        rows = 20
        columns = 20
        side = 0.1
    """

    kind: str = choice("window", default="window")
    mesh: str = choice(*MESHES)
    rows: int | None = integer(default=None)
    columns: int | None = integer(default=None)
    width: float | None = real(default=None, above=0, unit="m")
    height: float | None = real(default=None, above=0, unit="m")
    side: float = real(above=0, unit="m")

    def check(self) -> None:
        """Refuse sizes without a connected web, and more than a million cells."""
        for name, size in (("rows", "height"), ("columns", "width")):
            cells, length = getattr(self, name), getattr(self, size)
            if cells is None and length is None:
                raise InputError(f"{name} is missing: give {name} = ..., or {size} = ... [m]")
            if cells is not None and length is not None:
                raise InputError(f"{size} = {length:g} and {name} = {cells} both say how large it is: leave one out")
        counts = rows, columns = self.counts
        for name, count, smallest in zip(("rows", "columns"), counts, SMALLEST[self.mesh], strict=True):
            if getattr(self, name) is not None and count < smallest:
                raise InputError(f'{name} = {count} must be ≥ {smallest} for mesh = "{self.mesh}"')
        if rows * columns > _MOST_CELLS:
            raise InputError(f"rows × columns = {rows * columns} must be ≤ {_MOST_CELLS}")

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of rows and columns, given or from height and width."""
        counts = []
        (per_column, more_columns), (per_row, more_rows) = EXTENT[self.mesh]
        for given, length, pitch, more, smallest in (
            (self.rows, self.height, per_row, more_rows, SMALLEST[self.mesh][0]),
            (self.columns, self.width, per_column, more_columns, SMALLEST[self.mesh][1]),
        ):
            if given is None and length is not None:
                given = max(smallest, round(min((length / self.side - more) / pitch, 1e9)))
            counts.append(given)
        return tuple(counts)

    def web(self, base: str | PathLike[str] | None = None) -> Web:
        """The `refweb.net.web.Web`; its cells count the sectors between links as `Paper` does."""
        rows, columns = self.counts
        return _window(self.mesh, rows, columns, self.side, "window")


@table
class Layers(Table):
    """A web of concentric layers with its frame, fixed at every node of the frame (section 3.1, Figure 9).

    Groups of lines: ``rim``, lines between two nodes of the frame; ``anchors``, lines with one node there; ``inner``,
    all others; ``ring-1`` … ``ring-N``, the outline of so many layers; ``spokes``, lines between two meshes of one
    layer; ``rows``, ``columns``, ``rising``, ``falling`` and ``diagonals``, see `refweb.net.lattices`.

    Parameters
    ----------
    mesh : {"triangle", "square", "hexagon"}
        Shape of the meshes: a triangle of side 3N − 2, a square of side 2N − 1, hexagons around one.
    layers : int
        N ≥ 1.
    cell_area : float
        Area A of a mesh [m²].

    Raises
    ------
    InputError
        For an unknown mesh, layers < 1, and an area that is not finite and > 0; from ``web``, above a million cells.

    Notes
    -----
    N layers of hexagons have 3N² − 3N + 1 cells and 9N² − 3N lines; the paper's section 3.1.3 repeats the formulas of
    the square. The limit of the length-area ratio that it states is that of hexagons.

    Examples
    --------
        [web]
        kind = "layers"
        mesh = "triangle"
        layers = 4
        cell_area = 0.01
    """

    kind: str = choice("layers", default="layers")
    mesh: str = choice(*MESHES)
    layers: int = integer(at_least=1)
    cell_area: float = real(above=0, unit="m²")

    def web(self, base: str | PathLike[str] | None = None) -> Web:
        """The `refweb.net.web.Web`; refused above a million cells."""
        n = self.layers
        cells = _cells(self.mesh, n)
        if cells > _MOST_CELLS:
            raise InputError(f"layers = {n} makes {cells} cells, must be ≤ {_MOST_CELLS}")
        polygons, layer = _layers(self.mesh, n)
        net = _tessellation(polygons)
        points = _placed(net.nodes, self.mesh, _side(self.mesh, self.cell_area))
        groups = _directions(points, net.lines) | _rings(net, layer)
        rim = np.unique(net.lines[net.frame])
        return Web(points, net.lines, rim=rim, kind="layers", cells=len(polygons), groups=groups)


def _layers(mesh, n):
    """Polygons of n layers, and the layer of each, 1 for those in the centre."""
    if mesh == "triangle":
        row = np.arange(3 * n - 2)
        up, down = len(row) - row, len(row) - 1 - row
        polygons = np.concatenate([_rows(up, row, _UP), _rows(down, row + 2, _DOWN)])
        return polygons, n - np.concatenate([_from_sides(up), _from_sides(down)])
    if mesh == "square":
        counts = np.full(2 * n - 1, 2 * n - 1)
        row, column = _places(counts)
        layer = 1 + np.maximum(abs(row - (n - 1)), abs(column - (n - 1)))
        return _rows(counts, 0 * counts, _SQUARE, (1, 1)), layer
    away = abs(np.arange(2 * n - 1) - (n - 1))
    row, column = _places(2 * n - 1 - away)
    x = abs(2 * column + away[row] - (2 * n - 2))  # in halves of a mesh
    layer = 1 + np.maximum(away[row], (away[row] + x) // 2)
    return _rows(2 * n - 1 - away, away, _HEXAGON, (2, 3)), layer


def _from_sides(counts):
    """Rows of triangles between each triangle of a large one and its nearest side."""
    row, column = _places(counts)
    return np.minimum(np.minimum(row, column), counts[row] - 1 - column)


def _side(mesh, cell_area):
    return sqrt(cell_area / AREA[mesh])


def _cells(mesh, layers):
    """Number of cells."""
    if mesh == "hexagon":
        return 3 * layers * layers - 3 * layers + 1
    return (3 * layers - 2 if mesh == "triangle" else 2 * layers - 1) ** 2
