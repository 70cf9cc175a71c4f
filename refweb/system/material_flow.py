"""Mass that follows reels and winches, for methods that ask a system for it; the explicit loop has kernels of its own.

May change: private functions. Must stay: the order of cells, those of tables first (`by_table`), in `shares`, `brought`
and `slip_rates`, which `integrators.simpson_balance` adds up by position. The kernels of `effects.mass_flow` solve the
same equations from ``flows`` and ``passages``: change both together. Must stay as well: `MaterialFlow`, which `system`
imports; its public names: `masses`, `rates`, `force` and `brought`, which `system` and implicit methods call, and
`flows`, `passages` and `speed`, from which `effects.mass_flow` makes its record. Tests:
``tests/effects/test_reel_mass.py``, ``test_winch_mass.py``.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..findings import Finding

HEAVY = 1e3
"""Mass of a drum over that of the lines of its reel from which on it moves as if nothing were reeled."""


class MaterialFlow:
    """Masses of a system over time, and the forces of the material that comes and goes.

    See `refweb.effects.mass_flow` for the equations.

    Parameters
    ----------
    system : refweb.system.system.System
        A system with flows.

    Attributes
    ----------
    flows : list of refweb.effects.mass_flow.MassFlow
        Flows of reels without rows on bodies, with the drum of each row.
    passages : refweb.effects.mass_flow.Passages
        Passages of material to winches and over rings.
    by_table : int
        Number of the cells of ``flows``, which stand ahead of two of each passage.
    speed : ndarray, shape (3,)
        Ω of rotating axes [rad/s].

    Raises
    ------
    InputError
        For lines without a node that is that of a drum, or with several, and for lines that may break.
    """

    def __init__(self, system):
        self._net, self._system = system.net, system
        net = system.net
        _refuse_breaks(system)
        self.flows, self._wound = [], [flow for flow in net.flows if flow.wound]
        for flow in net.flows:
            if not flow.wound:
                drums, moves = _drums(system, flow), flow.off_bodies(net)
                self.flows.append(flow._replace(rows=flow.rows[moves], mass=flow.mass[moves], drums=drums[moves]))
        frames = [term.frame.angular_velocity for term in system.rotating]
        self.speed = np.array(frames[0] if frames else (0.0, 0.0, 0.0), dtype=float)
        self.passages = _joined([flow.passages(system) for flow in self._wound])
        self.by_table = sum(len(flow.rows) for flow in self.flows)
        self._rows = np.concatenate([*(flow.rows for flow in self.flows), self.passages.rows.ravel()]).astype(int)
        drums = np.repeat(self.passages.drums, 2)
        self._drums = np.concatenate([*(flow.drums for flow in self.flows), drums]).astype(int)
        self._free = ~system.supported[self._rows]
        driven = np.concatenate([[], *(drive.cells[:, 0] for drive in system.drives)])
        self._driven = np.isin(self._rows, driven)

    def remarks(self):
        """Findings on drums and rings that are free to move, see `refweb.effects.mass_flow`."""
        mass, flowing = self._net.mass.copy(), sum(flow.mass.sum() for flow in self.flows)
        mass[self._system.fixed.all(axis=1)] = np.inf
        for body in self._net.bodies:
            mass[list(body.carried)] = np.inf if body.prescribed else max(self._net.mass[body.row], body.mass)
        drums = np.unique(self._drums)
        free = drums[mass[drums] < (np.inf if self._wound else HEAVY * flowing)]
        if len(free):
            name = self._system.row_name(free[0])
            text = (
                f'mass = "follows": the drum or ring at {name} is free to move. Where lines turn, angular momentum is '
                "off by up to the share of the mass that comes or goes, which ± does not contain: hold the drum, make "
                'it far heavier than the lines, or give mass = "stays"'
            )
            yield Finding("drum-moves", text, "winch" if self._wound else "reel")

    def shares(self, t):
        """Mass of each row of each flow of a reel at time t [kg], shape (cells,)."""
        return np.concatenate([[], *(flow.mass * np.interp(t, *np.transpose(flow.table)) for flow in self.flows)])

    def masses(self, t, x=None):
        """Mass of each row of the system at time t and displacement x [kg], shape (rows,).

        Without x winches have wound nothing.
        """
        mass = self._net.mass.copy()
        gained = self.shares(t) - np.concatenate([[], *(flow.mass for flow in self.flows)])
        slips = np.zeros(len(self.passages.slips)) if x is None else self._slips(t, x, np.zeros_like(x))[0]
        np.add.at(mass, self._rows, np.append(gained, (self.passages.shares * slips[:, None]).ravel()))
        return mass

    def _slips(self, t, x, v):
        """Slip over each ring and drum [m], and its rate [m/s], shape (2, passages)."""
        both = [np.zeros((2, 0))]
        for flow in self._wound:
            (kernel, cells, rings), data = flow.passing(self._net), flow.data_in(self._system)
            out = np.empty((len(cells), 2 * rings))
            kernel(t, x, v, x, cells, data, out)
            both.append(np.vstack([out[:, :rings].ravel(), out[:, rings:].ravel()]))
        return np.hstack(both)

    def slip_rates(self, t, x, v):
        """Rate of the mass of both rows of each passage [kg/s], shape (2 passages,)."""
        return (self.passages.shares * self._slips(t, x, v)[1][:, None]).ravel()

    def _rates(self, t, x, v):
        rates = []
        for flow in self.flows:
            times, factors = np.transpose(flow.table)
            n = int(np.searchsorted(times, t, side="right"))
            slope = (factors[n] - factors[n - 1]) / (times[n] - times[n - 1]) if 0 < n < len(times) else 0.0
            rates.append(slope * flow.mass)
        return np.concatenate([*rates, self.slip_rates(t, x, v)])

    def rates(self, t, x, v):
        """Rate of the mass of each row [kg/s], behind a corner of its table; shape (rows,)."""
        return np.bincount(self._rows, self._rates(t, x, v), len(self._net.mass))

    def _incoming(self, x, v):
        """Velocity of material that comes to each row of each flow [m/s], shape (cells, 3)."""
        places = self._net.points + x
        return v[self._drums] - np.cross(self.speed, places[self._rows] - places[self._drums])

    def force(self, t, x, v):
        """Force on each row [N], m' (v_d − v), shape (rows, 3)."""
        force = np.zeros_like(v)
        np.add.at(force, self._rows, self._rates(t, x, v)[:, None] * (self._incoming(x, v) - v[self._rows]))
        return force

    def brought(self, x, v):
        """Energy [J/kg] and momentum along x, y and z [m/s] that come in with the mass of each row, shape (4, cells).

        Where motion is prescribed, energy is what the row then has.
        """
        speed, incoming = v[self._rows], self._incoming(x, v)
        energy = np.where(self._free, incoming * speed - 0.5 * speed**2, 0.0).sum(axis=1)
        energy[self._driven] = 0.5 * (speed[self._driven] ** 2).sum(axis=1)
        return np.vstack([energy, np.where(self._free, incoming, 0.0).T])


def _joined(parts):
    """`Passages` of several winches as those of one."""
    from ..effects.mass_flow import Passages

    none = np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros((0, 2), dtype=int), np.zeros((0, 2))
    return Passages(*(np.concatenate(arrays) for arrays in zip(none, *parts, strict=True)))


def _refuse_breaks(system):
    """Refuse lines that are broken or may break: a break would cut them off from the drum of their material."""
    net, weakness = system.net, system.weakness
    at_risk = np.zeros(len(net.cells), dtype=bool) if weakness is None else weakness.breakable
    at_risk[net.broken] = True
    for flow in net.flows:
        for line in np.intersect1d(net.line[at_risk], flow.lines)[:1]:
            raise InputError(
                f'line {line} is broken or may break, and its mass = "follows": material would go on to come over the '
                'break. Give mass = "stays", or this line no break'
            )


def _drums(system, flow):
    """Node of the drum of each row of a flow."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    net, cells = system.net, system.net.cells[flow.elements]
    pairs = np.repeat(cells[:, :1], cells.shape[1] - 1, axis=1).ravel(), cells[:, 1:].ravel()
    graph = coo_array((np.ones(len(pairs[0])), pairs), shape=(len(net.points), len(net.points)))
    part = connected_components(graph, directed=False)[1][flow.rows]
    given = flow.rows[system.supported[flow.rows].all(axis=1)] if flow.drums is None else flow.drums
    for node in given[~np.isin(given, flow.rows)][:1]:
        raise InputError(f"drum = {node} is no end of the lines of this reel: name a node of theirs")
    drums = np.empty(len(flow.rows), dtype=int)
    for number in np.unique(part):
        inside = part == number
        nodes = flow.rows[inside][np.isin(flow.rows[inside], given)]
        if len(nodes) != 1:
            lines = np.unique(net.line[flow.elements][np.isin(cells[:, 0], flow.rows[inside])])
            count = "no node" if not len(nodes) else f"{len(nodes)} nodes ({', '.join(map(str, nodes[:3]))})"
            why = "that is supported, moved or on a body" if flow.drums is None else "of drum"
            raise InputError(
                f'mass = "follows": {count} of line {lines[0]} and those that it is connected to by this reel {why}: '
                "name one node at the drum, drum = ..., for each part of the lines"
            )
        drums[inside] = nodes[0]
    return drums
