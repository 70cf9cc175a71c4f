"""Parts of a net without support along an axis, which no force along that axis may act on in statics.

`System.unsupported_parts` and `statics.equilibrium` call `find_parts`. May change: how parts are found, and their
order, by which a message names the first. Must stay: fields of `Part`, which statics reads; terms of contact are known
by their names "contact" and "self_contact": a renamed or further one belongs in `find_parts`. Tests:
``tests/statics/test_statics.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Part(NamedTuple):
    """A connected part and an axis, 0 … 2, along which no row of it is supported; its unknowns along that axis.

    Its rows contain no rotations of bodies, and its unknowns no carried nodes.
    """

    rows: np.ndarray
    axis: int
    unknowns: np.ndarray


def find_parts(system, touching=True):
    """Every `Part` of a system; contact holds parts together only if ``touching``."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    terms = [f for f in system.terms if touching or f.name not in ("contact", "self_contact")]
    cells = [f.cells for f in terms if f.cells.shape[1] > 1]
    pairs = np.vstack([np.column_stack([c[:, 0], c[:, k]]) for c in cells for k in range(1, c.shape[1])])
    joined = [(body.row, node) for body in system.net.bodies if not body.fixed for node in body.carried]
    joined += [(body.row, body.base) for body in system.net.bodies if body.pivot is not None]
    pairs = np.vstack([pairs, *([joined] if joined else [])])
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(system.rows, system.rows))
    count, part = connected_components(graph, directed=False)
    fixed = np.zeros((count, 3), dtype=bool)
    np.logical_or.at(fixed, part, system.fixed)
    places = np.arange(system.rows) < system.rows - system.net.spins
    free_along = [(np.flatnonzero((part == p) & places), axis) for p, axis in zip(*np.nonzero(~fixed), strict=True)]
    return [
        Part(rows, axis, np.searchsorted(system.free, 3 * rows[~system.carried[rows]] + axis))
        for rows, axis in free_along
        if len(rows)
    ]
