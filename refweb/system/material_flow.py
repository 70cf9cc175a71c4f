"""Mass that follows reels and winches, for methods that ask a system for it; the explicit loop has kernels of its own.

May change: private functions. Must stay: the order of cells, those of tables first (`by_table`), in `shares`, `brought`
and `slip_rates`, which `integrators.simpson_balance` adds up by position. The kernels of `effects.mass_flow` solve the
same equations from ``flows`` and ``passages``: change both together. Must stay as well: `MaterialFlow`, which `system`
imports; its public names: `masses`, `rates`, `force` and `brought`, which `system` and implicit methods call, and
`flows`, `sliding`, `passages` and `speed`, from which `effects.mass_flow` makes its record; `velocity_behind`, which
methods call at the start and at corners of tables. Tests: ``tests/effects/test_reel_mass.py``,
``test_winch_mass.py``.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..findings import Finding


class MaterialFlow:
    """Masses of a system over time, and the forces of the material that comes and goes over rings and drums of winches.

    See `refweb.effects.mass_flow` for the equations.

    Parameters
    ----------
    system : refweb.system.system.System
        A system with flows.

    Attributes
    ----------
    flows : list of refweb.effects.mass_flow.MassFlow
        Flows of reels without rows on bodies.
    sliding : list of refweb.effects.base.ForceTerm
        Terms of the system of what slides along their lines.
    passages : refweb.effects.mass_flow.Passages
        Passages of material to winches and over rings.
    by_table : int
        Number of the cells of ``flows``, which stand ahead of two of each passage.
    speed : ndarray, shape (3,)
        Ω of rotating axes [rad/s].

    Raises
    ------
    InputError
        For lines that may break, and for lines of a winch of which not one end is that of a drum.
    """

    def __init__(self, system):
        from ..effects.sliding_material import force as sliding_force

        self._net, self._system = system.net, system
        net = system.net
        _refuse_breaks(system)
        self.flows, self._wound = [], [flow for flow in net.flows if flow.wound]
        for flow in net.flows:
            if not flow.wound:
                moves = flow.off_bodies(net)
                self.flows.append(flow._replace(rows=flow.rows[moves], mass=flow.mass[moves]))
        self.sliding = [term for term in system.terms if term.force is sliding_force]
        frames = [term.frame.angular_velocity for term in system.rotating]
        self.speed = np.array(frames[0] if frames else (0.0, 0.0, 0.0), dtype=float)
        self.passages = _joined([flow.passages(system) for flow in self._wound])
        self.by_table = sum(len(flow.rows) for flow in self.flows)
        self._rows = np.concatenate([*(flow.rows for flow in self.flows), self.passages.rows.ravel()]).astype(int)
        self._drums = np.repeat(self.passages.drums, 2)
        self._free = ~system.supported[self._rows]
        driven = np.concatenate([[], *(drive.cells[:, 0] for drive in system.drives)])
        self._driven = np.isin(self._rows, driven)

    def remarks(self):
        """Findings on drums and rings of winches that are free to move, see `refweb.effects.mass_flow`."""
        free, bodies = ~self._system.fixed.all(axis=1), self._net.bodies
        free[[node for body in bodies if body.prescribed for node in body.carried]] = False
        for row in self._drums[free[self._drums]][:1]:
            text = (
                f'mass = "follows": the drum or ring at {self._system.row_name(row)} is free to move. Where lines '
                "turn, angular momentum is off by up to the share of the mass that comes or goes, which ± does not "
                'contain: hold the drum, make it far heavier than the lines, or give mass = "stays"'
            )
            yield Finding("drum-moves", text, "winch")

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

    def rates(self, t, x, v):
        """Rate of the mass of each row by passages [kg/s], shape (rows,)."""
        return np.bincount(self._rows[self.by_table :], self.slip_rates(t, x, v), len(self._net.mass))

    def _incoming(self, x, v):
        """Velocity of material that comes to the rows of each passage [m/s], shape (2 passages, 3)."""
        places, rows = self._net.points + x, self._rows[self.by_table :]
        return v[self._drums] - np.cross(self.speed, places[rows] - places[self._drums])

    def force(self, t, x, v):
        """Force on each row of material that passes rings and drums [N], m' (v_d − v), shape (rows, 3)."""
        force, rows = np.zeros_like(v), self._rows[self.by_table :]
        np.add.at(force, rows, self.slip_rates(t, x, v)[:, None] * (self._incoming(x, v) - v[rows]))
        return force

    def velocity_behind(self, t, x, v):
        """Velocity of all rows [m/s] behind time t, shape (rows, 3); v itself where no rate of a reel jumps there."""
        from ..effects.sliding_material import impulse

        system, push = self._system, np.zeros_like(x)
        for term in self.sliding:
            impulse(t, x, v, push, term.cells, term.data, push)
        if not push.any():
            return v
        if system.carriers:
            system.carriers.add_forces_to_bodies(x, push)
        mass = np.where(system.supported, np.inf, self.masses(t, x)[:, None])  # lumped, which follows alone
        v = v + np.divide(push, mass, out=np.zeros_like(push), where=mass > 0.0)
        if system.carriers:
            system.carriers.update_attached_nodes(x, v)
        return v

    def brought(self, x, v):
        """Energy [J/kg] and momentum along x, y and z [m/s] that come in with the mass of each row, shape (4, cells).

        Where motion is prescribed, energy is what the row then has.
        """
        speed = v[self._rows]
        incoming = np.concatenate([speed[: self.by_table], self._incoming(x, v)])
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
