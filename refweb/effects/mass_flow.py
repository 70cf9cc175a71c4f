"""Mass that follows natural length: what is reeled in leaves through a drum, what is paid out comes from there.

An element of the natural length L has the mass ρA L, a share of which is at each of its nodes. Material passes the drum
alone, with the velocity v_d of its node, so that each node of mass m has

    m v' = F + m' (v_d − v),    the momentum m' v_d and the energy m' (v_d·v − ½ v²) that come in.

In axes that rotate with Ω, velocities are relative, and v_d becomes v_d − Ω × (r − r_d), with the places r of node and
drum: material that rests on the drum moves against the axes elsewhere.

The velocity at which material slides along the line is left out: its momentum flux is of the size ρA L'². The
momentum of all, and the angular momentum about a drum at rest, are kept.

An explicit step brings Δm in the middle of its drift, where v − v_d goes with 1/m: that is the exact solution for F =
0, and the step stays its own adjoint.

The explicit loop uses `FollowedMass`, other methods `system.material_flow`: both have the same equations.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..kernels import INDICES, VECTOR, Arrays, IndexTable, Integers, Matrix, Record, Vector, VectorTable, kernel
from .time_tables import flattened, interpolate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.net import Net
    from ..system.system import System


class MassFlow(NamedTuple):
    """Mass that follows the factor of a reel.

    Attributes
    ----------
    lines : ndarray of int, shape (k,)
        Lines of the web.
    elements : ndarray of int, shape (elements,)
        Elements of the lines.
    rows : ndarray of int, shape (nodes,)
        Their nodes.
    mass : ndarray, shape (nodes,)
        Mass of each that a factor of 1 is worth [kg].
    table : sequence of (t, factor)
        The factor, which is linear in between.
    drums : ndarray of int, or None
        Nodes of drums; None for the one node of the lines that is supported, moved or on a body.
    """

    lines: np.ndarray
    elements: np.ndarray
    rows: np.ndarray
    mass: np.ndarray
    table: tuple
    drums: np.ndarray | None

    def off_bodies(self, net: Net) -> NDArray[np.bool_]:
        """True for each of the nodes that no body carries: the share of a line's end on a body stays."""
        return ~np.isin(self.rows, [node for body in net.bodies for node in body.carried])


class FollowedMass(Record):
    """Masses that change over time, in the loop.

    Attributes
    ----------
    rows : ndarray of int, shape (changing,)
        Rows whose mass changes, increasing; none where all masses stay.
    built : ndarray, shape (changing,)
        Their masses at a factor of 1 [kg].
    cells, shares, tables : table
        Rows of each flow with the places of these in ``rows`` and the rows of their drums, the mass of each that a
        factor of 1 is worth [kg], and the table over time.
    mass, inverse : ndarray, shape (rows,) and (rows, 3)
        Mass of all rows [kg], and its inverse, 0 where a support holds: those of the loop.
    speed : ndarray, shape (3,)
        Ω of the axes [rad/s].
    points : ndarray, shape (rows, 3)
        Reference positions [m].
    """

    rows: Integers
    built: Vector
    cells: IndexTable
    shares: VectorTable
    tables: VectorTable
    mass: Vector
    inverse: Matrix
    speed: Vector
    points: Matrix

    @classmethod
    def none(cls) -> FollowedMass:
        """Make the record of masses that stay."""
        no_tables = Arrays(INDICES, []), Arrays(VECTOR, []), Arrays(VECTOR, [])
        nothing = np.zeros(0), np.zeros((0, 3)), np.zeros(3), np.zeros((0, 3))
        return cls(np.zeros(0, dtype=np.int64), np.zeros(0), *no_tables, *nothing)

    @classmethod
    def of(cls, system: System, mass: NDArray[np.float64], inverse: NDArray[np.float64]) -> FollowedMass:
        """Make the record of a system with flows, that writes to ``mass`` and ``inverse``."""
        flows = system.material_flow.flows
        rows = np.unique(np.concatenate([flow.rows for flow in flows])).astype(np.int64)
        cells = [np.column_stack([f.rows, np.searchsorted(rows, f.rows), f.drums]).astype(np.int32) for f in flows]
        return cls(
            rows=rows,
            built=system.net.mass[rows],
            cells=Arrays(INDICES, cells),
            shares=Arrays(VECTOR, [flow.mass for flow in flows]),
            tables=Arrays(VECTOR, [np.array(flattened(flow.table)) for flow in flows]),
            mass=mass,
            inverse=inverse,
            speed=system.material_flow.speed,
            points=np.array(system.net.points, order="C"),
        )


@kernel(apart=("follows",))
def set_masses(t: float, followed: FollowedMass) -> None:
    """Write masses at time t, and their inverses."""
    rows, mass, inverse = followed.rows, followed.mass, followed.inverse
    for n in range(rows.size):
        mass[rows[n]] = followed.built[n]
    for i in range(len(followed.tables)):
        change, cells, shares = (
            interpolate(t, followed.tables[i], 0, 2, 1)[0] - 1.0,
            followed.cells[i],
            followed.shares[i],
        )
        for c in range(cells.shape[0]):
            mass[cells[c, 0]] += shares[c] * change
    for n in range(rows.size):
        r = rows[n]
        for k in range(3):
            if inverse[r, k] > 0.0:
                inverse[r, k] = 1.0 / mass[r]


@kernel()
def incoming(back, x, v, r, d, followed, velocity):
    """Write the velocity of material from the drum at row d where row r has been a time ``back`` ago."""
    w, a = followed.speed, followed.points
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        along_i = a[r, i] - a[d, i] + x[r, i] - x[d, i] - back * (v[r, i] - v[d, i])
        along_j = a[r, j] - a[d, j] + x[r, j] - x[d, j] - back * (v[r, j] - v[d, j])
        velocity[k] = v[d, k] - (w[i] * along_j - w[j] * along_i)


@kernel(apart=("follows",))
def exchange_masses(
    t: float, h: float, x: Matrix, v: Matrix, followed: FollowedMass, work: Vector, pushed: Vector
) -> None:
    """Bring the material of a step of size h that ends at t, in the middle of its drift.

    Its work, and its impulse on what is free, are added to the last place of ``work`` and to ``pushed``.
    """
    rows, mass, inverse = followed.rows, followed.mass, followed.inverse
    brought, before, velocity = np.zeros((rows.size, 3)), np.empty(rows.size), np.empty(3)
    for n in range(rows.size):
        before[n] = mass[rows[n]]
    for i in range(len(followed.tables)):
        table, cells, shares = followed.tables[i], followed.cells[i], followed.shares[i]
        change = interpolate(t, table, 0, 2, 1)[0] - interpolate(t - h, table, 0, 2, 1)[0]
        for c in range(cells.shape[0]):
            incoming(0.5 * h, x, v, cells[c, 0], cells[c, 2], followed, velocity)
            for k in range(3):
                brought[cells[c, 1], k] += shares[c] * change * velocity[k]
    set_masses(t, followed)
    for n in range(rows.size):
        r = rows[n]
        for k in range(3):
            if inverse[r, k] > 0.0:
                old = v[r, k]
                speed = inverse[r, k] * (before[n] * old + brought[n, k])
                work[work.size - 1] += 0.5 * (mass[r] * speed * speed - before[n] * old * old)
                pushed[k] += brought[n, k]
                v[r, k] = speed
                x[r, k] += 0.5 * h * (speed - old)
