"""Mass that follows natural length: what is reeled in leaves through a drum, what is paid out comes from there.

An element of the natural length L has the mass ρA L, a share of which is at each of its nodes.

Of a reel, material passes from node to node, and leaves each with the velocity v of that node: the momentum m' v and
the energy ½ m' v² are gone with it. `refweb.effects.sliding_material` has the force of what slides along the line. An
explicit step changes the mass in the middle of its drift, and stays its own adjoint.

Of a winch, material passes each ring or drum alone, with the velocity v_d of its node, so that each node of mass m has

    m v' = F + m' (v_d − v),    the momentum m' v_d and the energy m' (v_d·v − ½ v²) that come in.

In axes that rotate with Ω, velocities are relative, and v_d becomes v_d − Ω × (r − r_d), with the places r of node and
ring: material that rests on the ring moves against the axes elsewhere. The velocity at which it slides is left out. A
ring or a drum that is free to move lacks a reaction of the size ρA L' L ω where lines turn, and angular momentum misses
the sum of m' (r − r_d) × v_d. A run says so, see `MaterialFlow` of `system.material_flow`.

An explicit step brings Δm in the middle of its drift, where v − v_d goes with 1/m: that is the exact solution for F =
0, and the step stays its own adjoint.

May change: how the kernels are written, with the order of passages kept: it makes the step of order 2. Must stay:
fields of `MassFlow`, which `reel` fills, of `Passages`, which `wound_mass` fills, and of `FollowedMass`, which the
explicit loop reads by name; the equations, which `system.material_flow` has for other methods; `set_masses`, which
`natural_lengths` imports; `exchange_by_slips`, `exchange_masses` and `set_masses_by_slips`, which
`integrators.energy_balance` imports. Tests: ``tests/effects/test_reel_mass.py``, ``tests/effects/test_winch_mass.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..kernels import (
    INDICES,
    VECTOR,
    Arrays,
    IndexTable,
    IntegerMatrix,
    Integers,
    Matrix,
    Record,
    Vector,
    VectorTable,
    kernel,
)
from .base import column
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
    wound = False

    def weight(self, net: Net, acceleration: Any) -> Any:
        """The `ForceTerm` of a uniform acceleration [m/s²] on what the reel adds to the mass of its factor 1."""
        from .outer_load import nodal_load

        moves = self.off_bodies(net)
        data, added = np.outer(self.mass[moves], acceleration), [(t, factor - 1.0) for t, factor in self.table]
        return nodal_load(net, "gravity", self.rows[moves], data, added)

    def turning(self, net: Net, frame: Any, pull: Any, name: str) -> list[Any]:
        """The two terms of rotating axes on it, see `refweb.effects.turning_axes.force_terms`."""
        from .turning_flows import force_terms

        return force_terms(net, self, frame, pull, name)

    def off_bodies(self, net: Net) -> NDArray[np.bool_]:
        """True for each of the nodes that no body carries: the share of a line's end on a body stays."""
        return ~np.isin(self.rows, [node for body in net.bodies for node in body.carried])


class Passages(NamedTuple):
    """Passages of material over rings and drums.

    Attributes
    ----------
    drums : ndarray of int, shape (passages,)
        Row of each ring or drum.
    slips : ndarray of int, shape (passages,)
        Component 3 row + axis of the length that has gone over it.
    rows : ndarray of int, shape (passages, 2)
        Rows whose mass changes.
    shares : ndarray, shape (passages, 2)
        Change of the mass of each by that length [kg/m].
    """

    drums: np.ndarray
    slips: np.ndarray
    rows: np.ndarray
    shares: np.ndarray


class FollowedMass(Record):
    """Masses that change over time, in the loop.

    Attributes
    ----------
    rows : ndarray of int, shape (changing,)
        Rows whose mass changes, increasing; none where all masses stay.
    built : ndarray, shape (changing,)
        Their masses at a factor of 1 [kg].
    cells, shares, tables : table
        Rows of each flow, of shape (rows, 1), the mass of each that a factor of 1 is worth [kg], and the table over
        time.
    sliding : ndarray of int
        Numbers of the terms of material that slides.
    mass, inverse : ndarray, shape (rows,) and (rows, 3)
        Mass of all rows [kg], and its inverse, 0 where a support holds: those of the loop.
    speed : ndarray, shape (3,)
        Ω of the axes [rad/s].
    points : ndarray, shape (rows, 3)
        Reference positions [m].
    passages : ndarray of int, shape (passages, 4)
        Passages of material to winches and over rings: row of the drum or ring, component of the slip, and two rows
        whose mass changes, see `Passages`.
    by_slip : ndarray, shape (passages, 2)
        Change of the mass of these by the slip [kg/m].
    slips : ndarray, shape (passages,)
        Slips that masses are those of [m].
    """

    rows: Integers
    built: Vector
    cells: IndexTable
    shares: VectorTable
    tables: VectorTable
    sliding: Integers
    mass: Vector
    inverse: Matrix
    speed: Vector
    points: Matrix
    passages: IntegerMatrix
    by_slip: Matrix
    slips: Vector

    @classmethod
    def none(cls) -> FollowedMass:
        """Make the record of masses that stay."""
        none = np.zeros(0, dtype=np.int64)
        no_tables = Arrays(INDICES, []), Arrays(VECTOR, []), Arrays(VECTOR, []), none
        nothing = np.zeros(0), np.zeros((0, 3)), np.zeros(3), np.zeros((0, 3))
        no_passages = np.zeros((0, 4), dtype=np.int64), np.zeros((0, 2)), np.zeros(0)
        return cls(none, np.zeros(0), *no_tables, *nothing, *no_passages)

    @classmethod
    def of(cls, system: System, mass: NDArray[np.float64], inverse: NDArray[np.float64]) -> FollowedMass:
        """Make the record of a system with flows, that writes to ``mass`` and ``inverse``."""
        flows, passages = system.material_flow.flows, system.material_flow.passages
        by_slip = passages.shares
        rows = [*(flow.rows for flow in flows), passages.rows[by_slip != 0.0]]
        rows = np.unique(np.concatenate(rows)).astype(np.int64)
        sliding = [n for n, term in enumerate(system.terms) if term in system.material_flow.sliding]
        return cls(
            rows=rows,
            built=system.net.mass[rows],
            cells=Arrays(INDICES, [column(flow.rows) for flow in flows]),
            shares=Arrays(VECTOR, [flow.mass for flow in flows]),
            tables=Arrays(VECTOR, [np.array(flattened(flow.table)) for flow in flows]),
            sliding=np.array(sliding, dtype=np.int64),
            mass=mass,
            inverse=inverse,
            speed=system.material_flow.speed,
            points=np.array(system.net.points, order="C"),
            passages=np.column_stack([passages.drums, passages.slips, passages.rows]).astype(np.int64),
            by_slip=np.array(by_slip, order="C"),
            slips=np.zeros(len(by_slip)),
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
    for p in range(followed.slips.size):
        for e in range(2):
            mass[followed.passages[p, 2 + e]] += followed.by_slip[p, e] * followed.slips[p]
    for n in range(rows.size):
        r = rows[n]
        for k in range(3):
            if inverse[r, k] > 0.0:
                inverse[r, k] = 1.0 / mass[r]


@kernel(apart=("follows",))
def set_masses_by_slips(t: float, x: Matrix, followed: FollowedMass) -> None:
    """Write masses at time t and the slips of x, and their inverses."""
    for p in range(followed.slips.size):
        slip = followed.passages[p, 1]
        followed.slips[p] = x[slip // 3, slip % 3]
    set_masses(t, followed)


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
def exchange_masses(t: float, v: Matrix, followed: FollowedMass, work: Vector, pushed: Vector) -> None:
    """Change masses by tables in a step that ends at t, in the middle of its drift.

    Energy and momentum of what is free, which material brings, are added to the last place of ``work`` and to
    ``pushed``.
    """
    rows, mass, inverse, before = followed.rows, followed.mass, followed.inverse, np.empty(followed.rows.size)
    for n in range(rows.size):
        before[n] = mass[rows[n]]
    set_masses(t, followed)
    for n in range(rows.size):
        r = rows[n]
        for k in range(3):
            if inverse[r, k] > 0.0:
                brought = (mass[r] - before[n]) * v[r, k]
                work[work.size - 1] += 0.5 * brought * v[r, k]
                pushed[k] += brought


@kernel(apart=("follows",))
def exchange_by_slips(
    t: float, h: float, x: Matrix, v: Matrix, followed: FollowedMass, work: Vector, pushed: Vector
) -> None:
    """Bring the material that has gone over rings and drums in a step, in the middle of its drift.

    One half goes over one after the other, and one half in the inverse order: the step stays of order 2.
    """
    mass, inverse, velocity, count = followed.mass, followed.inverse, np.empty(3), followed.slips.size
    for n in range(2 * count):
        p = n if n < count else 2 * count - 1 - n
        drum, slip = followed.passages[p, 0], followed.passages[p, 1]
        moved = 0.5 * (x[slip // 3, slip % 3] - followed.slips[p])
        for e in range(2):
            r, brought = followed.passages[p, 2 + e], followed.by_slip[p, e] * moved
            if brought == 0.0:
                continue
            incoming(0.5 * h, x, v, r, drum, followed, velocity)
            before, mass[r] = mass[r], mass[r] + brought
            for k in range(3):
                if inverse[r, k] > 0.0:
                    old = v[r, k]
                    v[r, k] = (before * old + brought * velocity[k]) / mass[r]
                    work[work.size - 1] += 0.5 * (mass[r] * v[r, k] ** 2 - before * old * old)
                    pushed[k] += brought * velocity[k]
                    x[r, k] += 0.5 * h * (v[r, k] - old)
    set_masses_by_slips(t, x, followed)
