"""Mass that follows reels, for methods that ask a system for it; the explicit loop has kernels of its own.

`effects.mass_flow` has the same equations for explicit steps; `simpson_balance` counts on the order of `brought`.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError


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
        Flows without rows on bodies, with the drum of each row.
    speed : ndarray, shape (3,)
        Ω of rotating axes [rad/s].

    Raises
    ------
    InputError
        For lines without a node that is that of a drum, or with several.
    """

    def __init__(self, system):
        self._net = net = system.net
        self.flows = []
        for flow in net.flows:
            drums, moves = _drums(system, flow), flow.off_bodies(net)
            self.flows.append(flow._replace(rows=flow.rows[moves], mass=flow.mass[moves], drums=drums[moves]))
        frames = [term.frame.angular_velocity for term in system.rotating]
        self.speed = np.array(frames[0] if frames else (0.0, 0.0, 0.0), dtype=float)
        self._rows = np.concatenate([flow.rows for flow in self.flows])
        self._drums = np.concatenate([flow.drums for flow in self.flows])
        self._free = ~system.supported[self._rows]
        driven = np.concatenate([[], *(drive.cells[:, 0] for drive in system.drives)])
        self._driven = np.isin(self._rows, driven)

    def shares(self, t):
        """Mass of each row of each flow at time t [kg], shape (cells,)."""
        return np.concatenate([flow.mass * np.interp(t, *np.transpose(flow.table)) for flow in self.flows])

    def masses(self, t):
        """Mass of each row of the system at time t [kg], shape (rows,)."""
        mass = self._net.mass.copy()
        np.add.at(mass, self._rows, self.shares(t) - np.concatenate([flow.mass for flow in self.flows]))
        return mass

    def _rates(self, t):
        rates = []
        for flow in self.flows:
            times, factors = np.transpose(flow.table)
            n = int(np.searchsorted(times, t, side="right"))
            slope = (factors[n] - factors[n - 1]) / (times[n] - times[n - 1]) if 0 < n < len(times) else 0.0
            rates.append(slope * flow.mass)
        return np.concatenate(rates)

    def rates(self, t):
        """Rate of the mass of each row [kg/s], behind a corner of its table; shape (rows,)."""
        return np.bincount(self._rows, self._rates(t), len(self._net.mass))

    def _incoming(self, x, v):
        """Velocity of material that comes to each row of each flow [m/s], shape (cells, 3)."""
        places = self._net.points + x
        return v[self._drums] - np.cross(self.speed, places[self._rows] - places[self._drums])

    def force(self, t, x, v):
        """Force on each row [N], m' (v_d − v), shape (rows, 3)."""
        force = np.zeros_like(v)
        np.add.at(force, self._rows, self._rates(t)[:, None] * (self._incoming(x, v) - v[self._rows]))
        return force

    def brought(self, x, v):
        """Energy [J/kg] and momentum along x, y and z [m/s] that come in with the mass of each row, shape (4, cells).

        Where motion is prescribed, energy is what the row then has.
        """
        speed, incoming = v[self._rows], self._incoming(x, v)
        energy = np.where(self._free, incoming * speed - 0.5 * speed**2, 0.0).sum(axis=1)
        energy[self._driven] = 0.5 * (speed[self._driven] ** 2).sum(axis=1)
        return np.vstack([energy, np.where(self._free, incoming, 0.0).T])


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
