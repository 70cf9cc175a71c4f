"""Pressure on lines in a plane, at right angles to the current lines: the load of a flow, or of gas in a flat hose.

With the unit normal n of the plane, p per current length and x' = dx/dξ along an element

    force on node a      ∫ N_a p x' × n dξ
    stiffness of (a, b)  ∫ N_a dN_b/dξ dξ p [n]×

exactly, for every order: the force depends on positions and not on natural length. On a closed loop in a plane it has
the potential −p × area. On other lines it has no potential, and its work depends on the path.

May change: private functions and how the kernels are written. Must stay: the name "pressure", which
`statics.gradients.KNOWN` has; keys and docstring of `Pressure` (scene format and help; after a change write
``validation/REFERENCE.md`` anew); `PUSH` as the first numbers of a cell, with the factor of `outer_load` behind, at
`FACTOR`; the normal among them, which is set to 0 where an element breaks. Tests: ``tests/test_contract.py``,
``tests/effects/test_follower_loads.py``.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np

from ..compiled.rows import column_of, matrix_of, record_at, width_of
from ..errors import InputError
from ..kernels import BOUND, FORCE, STIFFNESS, kernel
from ..tables import Several, Table, nodes, real, rows, table, vector
from .base import CellElements, Tangent, without
from .outer_load import factor_at, outer_load

if TYPE_CHECKING:
    from ..net.net import Net
    from .base import ForceTerm

PUSH = np.dtype([("normal", float, (3,)), ("along", float, (3,))])
"""Data of a cell, p n and dX/dξ; behind it stands the factor."""
FACTOR = width_of(PUSH)


@functools.cache
def kernels(nodes, shares, couples):
    """Force, stiffness and bound kernels.

    Parameters
    ----------
    nodes : int
        Nodes per element.
    shares : tuple of float
        ∫ N_a dξ by node.
    couples : tuple of float
        ∫ N_a dN_b/dξ dξ, row by row.
    """

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            times, power, push = factor_at(t, data[c], FACTOR), 0.0, record_at(PUSH, data, c, 0)
            n0, n1, n2 = times * push.normal[0], times * push.normal[1], times * push.normal[2]
            for a in range(nodes):
                row, share = cells[c, a], shares[a]
                d0, d1, d2 = share * push.along[0], share * push.along[1], share * push.along[2]
                for b in range(nodes):
                    column, couple = cells[c, b], couples[nodes * a + b]
                    d0 += couple * x[column, 0]
                    d1 += couple * x[column, 1]
                    d2 += couple * x[column, 2]
                p0, p1, p2 = d1 * n2 - d2 * n1, d2 * n0 - d0 * n2, d0 * n1 - d1 * n0
                f[row, 0] += p0
                f[row, 1] += p1
                f[row, 2] += p2
                power += p0 * v[row, 0] + p1 * v[row, 1] + p2 * v[row, 2]
            out[c, 0] = power

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        for c in range(cells.shape[0]):
            blocks[c] = 0.0
            times, normal = factor_at(t, data[c], FACTOR), record_at(PUSH, data, c, 0).normal
            for a in range(nodes if not definite else 0):
                for b in range(nodes):
                    for i in range(3):
                        j, k = (i + 1) % 3, (i + 2) % 3
                        push = times * couples[nodes * a + b] * normal[i]
                        blocks[c, 3 * a + j, 3 * b + k] -= push
                        blocks[c, 3 * a + k, 3 * b + j] += push

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            largest, n = FACTOR, record_at(PUSH, data, c, 0).normal
            area = data[c, largest] * math.sqrt(2.0 * (n[0] ** 2 + n[1] ** 2 + n[2] ** 2))
            for a in range(nodes):
                for b in range(nodes):
                    rates[cells[c, a]] += area * abs(couples[nodes * a + b])

    return force, stiffness, bound


@table
class Pressure(Table):
    """A force per current length, at right angles to lines and to the normal of a plane.

    Seen from the tip of the normal, it pushes to the right of a line's direction, from its first node to its second: a
    loop that runs counterclockwise is inflated. ``away_from`` selects the side in another way. Only the projection of a
    line on the plane counts.

    Parameters
    ----------
    lines : int, str or list
        Lines, by number or group (see `refweb.net.groups`), or "all".
    normal : sequence of 3 float
        Normal of the plane, of any length.
    value : float
        p, force per current length [N/m].
    away_from : sequence of 3 float, optional
        A point [m] from which every line is pushed away; its side is that in the initial web.
    factor : sequence of (t, factor), optional
        Factor on p over time: linear between the times, constant before and after them. Without it the factor is 1, in
        statics the load step.

    Raises
    ------
    InputError
        For a normal that is zero, numbers that are not finite, and a factor without rows or with times that do not
        increase. From ``on``, for a line or a group that the web does not have, and a line that has the point on
        neither side.

    References
    ----------
    K. Schweizerhof, E. Ramm, "Displacement dependent pressure loads in nonlinear finite element analyses", Comput.
    Struct. 18 (1984) 1099–1114: stiffness of such loads, and when they have a potential.

    Examples
    --------
        [[pressure]]
        lines = "rim"
        normal = [0.0, 0.0, 1.0]
        value = 0.5
        away_from = [0.0, 0.0, 0.0]
    """

    several = True

    lines: Several = nodes(what="line")
    normal: Several = vector()
    value: float = real(unit="N/m")
    away_from: Several = vector(default=None, unit="m")
    factor: Several = rows(2, default=None, increasing=True)

    def check(self) -> None:
        """Refuse a normal without direction."""
        if not any(self.normal):
            raise InputError("normal = [0, 0, 0] must have a direction")

    def on(self, net: Net) -> ForceTerm:
        """The term of the elements of these lines; ``out`` is the power [W]."""
        lines = net.web.find_lines(self.lines)
        at = np.flatnonzero(np.isin(net.line, lines))
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        sides = np.ones(len(net.web.lines)) if self.away_from is None else self._sides(net.web, lines, normal)
        pushed = self.value * sides[net.line[at], None] * normal
        cells, data = np.ascontiguousarray(net.cells[at]), np.zeros(len(at), PUSH)
        data["normal"], data["along"] = pushed, net.line_data.reference[at]
        force, stiffness, bound = kernels(len(net.places), *_integrals(net.places))
        arguments = dict(
            force=force,
            tangent=Tangent(stiffness, bound, symmetric=False),
            elements=CellElements(at, without(slice(column_of(PUSH, "normal"), column_of(PUSH, "along")))),
        )
        return outer_load(net, "pressure", cells, matrix_of(data), self.factor, **arguments)

    def _sides(self, web, lines, normal):
        """Sign of each line: 1 if the push by its direction is away from the point, else −1."""
        ends = web.points[web.lines]
        push = np.cross(ends[:, 1] - ends[:, 0], normal)
        side = ((ends.mean(axis=1) - self.away_from) * push).sum(axis=1)
        for line in lines[side[lines] == 0.0][:1]:
            raise InputError(f"away_from = {list(self.away_from)} is on neither side of line {line}")
        return np.sign(side)


def _integrals(places):
    """∫ N_a dξ, and ∫ N_a dN_b/dξ dξ row by row, of an element with nodes at these coordinates in [0, 1]."""
    power = np.arange(len(places))
    functions = np.linalg.inv(np.vander(places, increasing=True))  # by power, then node
    slopes = power / np.maximum(power + power[:, None], 1)
    couples = functions.T @ slopes @ functions
    return tuple((couples @ places).tolist()), tuple(couples.ravel().tolist())
