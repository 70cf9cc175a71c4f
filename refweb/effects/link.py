"""Rigid links: pairs of nodes that keep their distance.

May change: messages. Must stay: the key and docstring of `Link` (scene format and help; after a change write
``validation/REFERENCE.md`` anew); the four numbers of a pair (vector at x = 0, then its length), which
`base.Constraint` reads. `system.links` has the equations. Tests: ``tests/dynamics/integrators/test_ida.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..messages import quote
from ..tables import Several, Table, nodes, table
from .base import Constraint

if TYPE_CHECKING:
    from ..net.net import Net


@table
class Link(Table):
    """Rigid bars without mass, from each of some nodes to the next; they pull and push.

    They need dynamics with ``method = "ida"``. For other methods, statics and modes use a stiff line instead.

    Parameters
    ----------
    nodes : list
        Two nodes or more, by number or name; the length of each link is their distance in the initial web.

    Raises
    ------
    InputError
        For fewer than two nodes. From ``on``, for a name that is not one node of the web, and for neighbours in the
        list with the same position.

    Examples
    --------
        [[link]]
        nodes = ["centre", 1]
    """

    several = True

    nodes: Several = nodes()

    def check(self) -> None:
        """Refuse fewer than two nodes."""
        if not isinstance(self.nodes, tuple) or len(self.nodes) < 2:
            raise InputError(f"nodes = {quote(self.nodes)} must be a list of two nodes or more")

    def on(self, net: Net) -> Constraint:
        """The pairs of rows, and their distances."""
        ends = [net.web.find_one(node, f"nodes[{i}]") for i, node in enumerate(self.nodes)]
        cells = np.column_stack([ends[:-1], ends[1:]]).astype(np.int32)
        apart = net.points[cells[:, 1]] - net.points[cells[:, 0]]
        length = np.linalg.norm(apart, axis=1)
        for i in np.flatnonzero(length == 0.0)[:1]:
            raise InputError(f"nodes[{i}] = {ends[i]} and nodes[{i + 1}] = {ends[i + 1]} must not be at one place")
        return Constraint(cells=cells, data=np.column_stack([apart, length]))
