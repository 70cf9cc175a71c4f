"""Thrust along a line: a force on a node in the direction of the line's tangent there.

With d = ±dx/dξ at the node, into the line, and e = d/|d|

    force on the node     F e
    stiffness towards b   −F (∂d/∂x_b) (I − e⊗e)/|d|.

It has no potential. If dx/dξ is zero at the node, the line has no direction and no thrust acts.

May change: how the kernels are written; `SHORTER` downwards, by which bounds of steps hold for shorter lines. Must
stay: the name "thrust", which `statics.gradients.KNOWN` has; keys and docstring of `Thrust` (scene format and help;
after a change write ``validation/REFERENCE.md`` anew); the force as the first number of `end_of`, which ``without(0)``
sets to 0 at a break; cells, shape of the data and force kernel for another force, since `dynamics.commands` writes new
numbers over them during a run; ``slopes`` that begin with the node that is pushed. Tests: ``tests/test_contract.py``,
``tests/effects/test_follower_loads.py``.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np

from ..compiled.rows import matrix_of, record_at, width_of
from ..errors import InputError
from ..kernels import BOUND, FORCE, STIFFNESS, kernel
from ..messages import quote
from ..tables import Several, Table, nodes, real, rows, table
from .base import CellElements, Tangent, without
from .line_kernels import direction
from .outer_load import factor_at, outer_load

if TYPE_CHECKING:
    from ..net.net import Net
    from .base import ForceTerm

SHORTER = 0.5
"""Length of a line, over that at the last history row, down to which the bound of the step is valid."""


def end_of(nodes):
    """Dtype of the data of elements with so many nodes; behind it stands the factor.

    F; d at x = 0; ∂d/∂x of each node, the first of which is the one that is pulled.
    """
    return np.dtype([("force", float), ("along", float, (3,)), ("slopes", float, (nodes,))])


@functools.cache
def kernels(nodes):
    """Force, stiffness and bound kernels of elements with so many nodes."""
    End = end_of(nodes)
    times = width_of(End)

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            end = record_at(End, data, c, 0)
            (e0, e1, e2), _ = direction(x, cells, c, end)
            row, pull = cells[c, 0], end.force * factor_at(t, data[c], times)
            f[row, 0] += pull * e0
            f[row, 1] += pull * e1
            f[row, 2] += pull * e2
            out[c, 0] = pull * (e0 * v[row, 0] + e1 * v[row, 1] + e2 * v[row, 2])

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        for c in range(cells.shape[0]):
            blocks[c] = 0.0
            end = record_at(End, data, c, 0)
            e, inverse = direction(x, cells, c, end)
            turn = end.force * factor_at(t, data[c], times) * inverse
            for b in range(nodes if not definite else 0):
                for i in range(3):
                    for j in range(3):
                        across = (1.0 if i == j else 0.0) - e[i] * e[j]
                        blocks[c, i, 3 * b + j] = -turn * end.slopes[b] * across

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            end = record_at(End, data, c, 0)
            _, inverse = direction(x, cells, c, end)
            turn = 1.4 * abs(end.force) * data[c, times] * inverse / SHORTER  # row sums of I − e⊗e are below 1.4
            for b in range(nodes):
                rates[cells[c, 0]] += turn * abs(end.slopes[b])

    return force, stiffness, bound


@table
class Thrust(Table):
    """A force on a node at the end of a line, along the line's current direction there.

    Parameters
    ----------
    node : int or str
        One node, by number or name.
    line : int, str or list
        The line that ends at the node, by number or group; of several lines exactly one must end there.
    force : float
        Force [N]; a positive one pulls the node into the line, towards its other end.
    factor : sequence of (t, factor), optional
        Factor on the force over time: linear between the times, constant before and after them. Without it the factor
        is 1, in statics the load step.

    Raises
    ------
    InputError
        For a force that is not finite, and a factor without rows or with times that do not increase. From ``on``, for a
        name that is not one node of the web, and a line that does not end at it.

    Examples
    --------
        [[thrust]]
        node = "centre"
        line = 2
        force = 3.0
    """

    several = True

    node: Several = nodes()
    line: Several = nodes(what="line")
    force: float = real(unit="N")
    factor: Several = rows(2, default=None, increasing=True)

    def on(self, net: Net) -> ForceTerm:
        """The term of one element; ``out`` is the power [W]."""
        node = net.web.find_one(self.node)
        line = self._line(net.web, node)
        second = int(node == net.web.lines[line, 1])
        cell = np.flatnonzero(net.line == line)[-second]
        position, sign = float(second), 1.0 - 2.0 * second
        order = np.argsort(abs(net.places - position))
        power = np.arange(len(order))
        functions = np.linalg.inv(np.vander(net.places, increasing=True))
        slopes = sign * (power[1:] * position ** (power[1:] - 1)) @ functions[1:]
        end = np.zeros(1, end_of(len(order)))
        end["force"], end["along"], end["slopes"] = self.force, sign * net.line_data.reference[cell], slopes[order]
        cells = np.ascontiguousarray(net.cells[[cell]][:, order])
        force, stiffness, bound = kernels(len(order))
        parts = dict(
            force=force, tangent=Tangent(stiffness, bound, False), elements=CellElements(np.array([cell]), without(0))
        )
        return outer_load(net, "thrust", cells, matrix_of(end), self.factor, **parts)

    def _line(self, web, node):
        """Number of the line that ends at a node."""
        lines = web.find_lines(self.line, "line")
        lines_here = lines[(web.lines[lines] == node).any(axis=1)]
        if len(lines_here) == 1:
            return int(lines_here[0])
        if len(lines) == 1:
            ends = web.lines[lines[0]]
            raise InputError(f"node = {quote(self.node)} must be an end of line {lines[0]}, {ends[0]} or {ends[1]}")
        raise InputError(f"line = {quote(self.line)}: {len(lines_here)} of its lines end at node {node}, must be one")
