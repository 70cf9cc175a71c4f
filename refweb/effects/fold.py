"""Folded initial positions of a web: all lines slack and apart from each other.

May change: messages, and the default of ``gap``. Must stay: keys and docstring of `Fold` (scene format and help; after
a change write ``validation/REFERENCE.md`` anew), of which `registry.with_fold` makes a table from ``[web] fold`` and
``positions``; what `lay` returns, the displacement of all rows at the start. The geometry is in `net.folding`. Tests:
``tests/effects/test_fold.py``.
"""

from __future__ import annotations

import math
import pathlib
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..net.folding import refuse_unfit, turns_of, wound
from ..tables import Several, Table, choice, nodes, real, table, text, vector

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.net import Net


@table
class Fold(Table):
    """Initial positions of the nodes: drawn in to a hub and wound about it, or those of a file.

    Natural lengths, and the reference of displacements, stay those of ``[web]``. Nodes that order and subdivision add
    lie straight between the ends of their line. Velocities by a spin are those of the folded positions. All lines must
    be slack, and lines that share no node must be further apart than ``gap``. Supported nodes must keep their position;
    a web to be thrown has ``[supports] nodes = []``.

    The keys may also be in ``[web]``: ``fold = "star"``, ``[web.fold]`` with these keys, or ``positions = FILE``.

    A ``"star"`` moves each node to ``ratio`` times its distance from the hub. Then it winds all nodes about the axis by
    an angle in proportion to that distance: the outermost node by ``turns``. Lines are not pleated.

    Parameters
    ----------
    kind : {"star", "positions"}
        Kind of folding.
    ratio : float
        For a star: distance from the hub over that in the web, 0 < ratio < 1; by default 0.5.
    turns : float, optional
        For a star: turns of the outermost node [1]. By default as many as keep the distance of the ends of every line
        within 0.9 of its natural length.
    hub : int or str
        For a star: one node, by number or name.
    axis : sequence of 3 float
        For a star: its axis, of any length.
    file : str, optional
        For positions: CSV file with the columns x, y and z [m], a row for each node of the web in its order, relative
        to the scene's folder.
    gap : float, optional
        Least distance of lines without a common node [m]; by default the diameter of a round line of the largest area.

    Raises
    ------
    InputError
        For numbers out of bounds, a key of the other kind, and an axis that is zero. From ``lay``: in statics, for a
        hub that is not one node, and for a file that cannot be read or has other nodes. Also for a supported node that
        would move, for a line that would be taut, and for lines nearer than the gap.

    Notes
    -----
    The winding is refweb's own, in `refweb.net.folding`; webs in space have their arms pleated as well: M. Gärdsback,
    G. Tibert, "Deployment control of spinning space webs", J. Guid. Control Dyn. 32 (2009) 40–50.

    Examples
    --------
        [fold]
        kind = "star"
        ratio = 0.3
    """

    kind: str = choice("star", "positions", default="star")
    ratio: float | None = real(default=None, above=0, unit="1")
    turns: float | None = real(default=None, unit="1")
    hub: Several = nodes(default=None)
    axis: Several = vector(default=None)
    file: str | None = text(default=None)
    gap: float | None = real(default=None, at_least=0, unit="m")

    def check(self) -> None:
        """Refuse keys of the other kind, a missing file, a ratio not below 1, and an axis without direction."""
        keys = ("ratio", "turns", "hub", "axis") if self.kind == "positions" else ("file",)
        for key in keys:
            if getattr(self, key) is not None:
                raise InputError(f'{key} has no meaning with kind = "{self.kind}": leave it out')
        if self.kind == "positions" and self.file is None:
            raise InputError('file is missing: kind = "positions" needs it')
        if self.ratio is not None and not self.ratio < 1.0:
            raise InputError(f"ratio = {self.ratio:g} must be < 1: the web is drawn in")
        if self.axis is not None and not any(self.axis):
            raise InputError("axis = [0, 0, 0] must have a direction")

    def lay(self, net: Net, supported: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Displacement of all rows at the start [m], shape (rows, 3)."""
        if net.quasi_static:
            raise InputError("a start that is folded cannot be used in statics: leave it out")
        web = net.web
        length = np.bincount(net.line, net.natural_length)
        places = self._star(web, length) if self.kind == "star" else self._from_file(web)
        moved = np.abs(places - web.points) > 1e-12 * np.ptp(web.points, axis=0).max()
        for node in np.flatnonzero((moved & supported[: len(moved)]).any(axis=1))[:1]:
            raise InputError(f"node {node} would move, and is supported: free it, such as by [supports] nodes = []")
        gap = math.sqrt(4.0 * float(net.area.max()) / math.pi) if self.gap is None else self.gap
        refuse_unfit(places, web.lines, length, gap)
        x = np.zeros((len(net.points), 3))
        start, end = (places[web.lines[net.line, side]] for side in (0, 1))
        piece = np.arange(len(net.cells)) % net.subdivide
        along = (piece[:, None] + net.places) / net.subdivide
        x[net.cells] = start[:, None] + along[:, :, None] * (end - start)[:, None] - net.points[net.cells]
        x[: len(places)] = places - web.points
        return x

    def _star(self, web, length):
        """Positions of the nodes of a star, for these natural lengths [m]."""
        hub = web.find_one("centre" if self.hub is None else self.hub, "hub")
        size = np.linalg.norm(web.points[web.lines[:, 1]] - web.points[web.lines[:, 0]], axis=1)
        ratio = 0.5 if self.ratio is None else self.ratio
        turns = turns_of(ratio, float((length / size).min())) if self.turns is None else self.turns
        return wound(web.points, web.points[hub], self.axis or (0.0, 0.0, 1.0), ratio, turns)

    def _from_file(self, web):
        """Positions of the nodes in the file."""
        from ..net.csv_files import columns_of

        places = columns_of(pathlib.Path(str(self.file)), "xyz")
        if len(places) != len(web.points):
            raise InputError(f"{self.file} has {len(places)} rows, must have one for each of {len(web.points)} nodes")
        return places
