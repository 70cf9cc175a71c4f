"""The sum of effects: M v' = f(t, x, v), x' = v, with supports eliminated.

A `System` concatenates the families of its effects once and has the interface of one of them: force, energy, stiffness.
``x`` is the displacement of each row from its reference position, shape (rows, 3); a solver sees only the system.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..effects.base import Constraint, Drive, Family, LineDrive
from ..net.net import LENGTH
from ..net.rigid_body import row_names
from ..net.tension_laws import TENSION_ONLY


class System:
    """A net, the effects on it and its supports.

    Parameters
    ----------
    net : refweb.net.net.Net
        Rows, lines and masses.
    effects : sequence
        Values with ``on(net)``.
    supported : ndarray of bool, shape (nodes, 3)
        Components of nodes that do not move, or move as prescribed.

    Attributes
    ----------
    families : list of refweb.effects.base.Family
        One per effect that adds forces.
    drives : list of refweb.effects.base.Drive
        One per effect that prescribes motion; its rows are supported as well.
    line_drives : list of refweb.effects.base.LineDrive
        One per effect that prescribes natural lengths.
    constraints : list of refweb.effects.base.Constraint
        One per effect that keeps distances; no force of the system holds them.
    length : ndarray, shape (cells,)
        Natural length of each element as built [m], which the line drives multiply.
    free : ndarray of int
        Components 3 row + axis of the unknowns, increasing.
    """

    def __init__(self, net, effects, supported):
        for effect in sorted(effects, key=lambda effect: hasattr(effect, "on")):  # bodies before what makes them turn
            if hasattr(effect, "extend"):
                net = effect.extend(net)
        self.net, self.effects = net, effects
        self.rows, self.length = len(net.points), net.natural_length.copy()
        acting = []
        for effect in effects:
            if hasattr(effect, "on"):
                part = effect.on(net)
                acting += part if isinstance(part, list) else [part]
        self.families = [a for a in acting if isinstance(a, Family)]
        self.line_drives = [a for a in acting if isinstance(a, LineDrive)]
        self.drives = [a for a in acting if isinstance(a, Drive)]
        self.constraints = [a for a in acting if isinstance(a, Constraint)]
        self.supported = np.vstack([supported, np.zeros((self.rows - len(supported), 3), dtype=bool)])
        for body in net.bodies:
            self.supported[body.row] = body.fixed
        for drive in self.drives:
            self.supported[drive.cells[:, 0]] = True
        self._arrange()

    def _arrange(self):
        self.free = np.flatnonzero(~self.supported)
        self._rest = np.zeros((self.rows, 3))
        self._out = self.outs()
        self._blocks = [np.empty((len(f.cells), 3 * f.cells.shape[1], 3 * f.cells.shape[1])) for f in self._stiff]

    def at_rest(self):
        """The system as statics sees it: free bodies are held and felt by nothing, what needs velocity is left out."""
        waiting = [body.row for body in self.net.bodies if not body.fixed]
        if not waiting and all(family.at_rest for family in self.families):
            return self
        rest = copy.copy(self)
        for kept in ("pattern", "loose", "inverse_mass"):
            rest.__dict__.pop(kept, None)
        rest.supported = self.supported.copy()
        rest.supported[waiting] = True
        rest.supported[self.rows - self.net.spins :] = True
        rest.families = []
        for family in self.families:
            if not family.at_rest:
                continue
            felt = ~np.isin(family.cells, waiting).any(axis=1)
            if felt.all():
                rest.families.append(family)
            elif felt.any():
                rest.families.append(replace(family, cells=family.cells[felt], data=family.data[felt]))
        rest._arrange()
        return rest

    def initial_velocity(self):
        """Velocities at the start [m/s], shape (rows, 3): those of the effects and bodies."""
        v = np.zeros((self.rows, 3))
        for effect in self.effects:
            if hasattr(effect, "start"):
                effect.start(self.net, self.supported, v)
        for body in self.net.bodies:
            v[body.row] = body.velocity
            if body.spin is not None:
                v[body.spin] = body.angular_velocity
        return v

    @property
    def _stiff(self):
        return [f for f in self.families if f.stiffness is not None or f.damping is not None]

    @cached_property
    def pattern(self):
        """The fixed `refweb.system.sparsity.Pattern` of the tangent."""
        from .sparsity import Pattern

        return Pattern(self.rows, self.free, [f.cells for f in self._stiff])

    @cached_property
    def loose(self):
        """Parts of the net that can be carried off: (rows of a connected part, axis in which none is supported)."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        cells = [f.cells for f in self.families if f.cells.shape[1] > 1]
        pairs = np.vstack([np.column_stack([c[:, 0], c[:, k]]) for c in cells for k in range(1, c.shape[1])])
        graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(self.rows, self.rows))
        count, part = connected_components(graph, directed=False)
        held = np.zeros((count, 3), dtype=bool)
        np.logical_or.at(held, part, self.supported)
        return [(np.flatnonzero(part == p), axis) for p, axis in zip(*np.nonzero(~held), strict=True)]

    def outs(self):
        """Arrays for what each family observes per cell; those of families that share it are that of the lines."""
        lines = np.zeros((len(self.net.cells), max([2, *(f.observed for f in self.families if f.shared)])))
        return [
            lines if f.shared or f.name == "elasticity" else np.zeros((len(f.cells), f.observed)) for f in self.families
        ]

    @property
    def working(self):
        """Of each family 1 if its power counts as work, −1 if its power is energy lost, else 0."""
        signs = {"work": 1, "dissipated_energy": -1}
        return np.array([signs[f.book] if f.power is not None else 0 for f in self.families], dtype=np.int64)

    @cached_property
    def by_length(self):
        """Kernel of ∂E/∂L of each element, E the energy of the lines."""
        from ..effects.elasticity import by_length

        return by_length(self.net)

    def prepare(self, t):
        """Give the lines their natural lengths at time t, where an effect prescribes them."""
        if self.line_drives:
            self.net.line_data[:, LENGTH] = self.length
            for d in self.line_drives:
                d.kernel(t, self.net.line_data, d.cells, d.data)

    def drive(self, t, x, v=None):
        """Write the prescribed displacements [m] and velocities [m/s] at time t into x and v."""
        v = np.zeros_like(x) if v is None else v
        for d in self.drives:
            d.kernel(t, x, v, self._rest, d.cells, d.data, self._rest)

    def force(self, t, x, v=None):
        """Force on every row [N], supports included, shape (rows, 3)."""
        return self.forces(t, x, v)[0]

    def forces(self, t, x, v=None):
        """Force on every row [N], and what each family observes per cell (a list beside ``families``)."""
        self.prepare(t)
        f = np.zeros((self.rows, 3))
        v = self._rest if v is None else v
        for family, out in zip(self.families, self._out, strict=True):
            family.force(t, x, v, f, family.cells, family.data, out)
        return f, self._out

    def force_of(self, family, t, x, v=None):
        """Force on every row of one family [N]."""
        self.prepare(t)
        f, out = np.zeros((self.rows, 3)), np.zeros((len(family.cells), max(family.observed, 2)))
        family.force(t, x, self._rest if v is None else v, f, family.cells, family.data, out)
        return f

    def outer_force(self, t, x=None, v=None):
        """Force on every row [N] of all but what the net does to itself, by default on the web as it is, at rest."""
        outer, x = np.zeros((self.rows, 3)), self._rest if x is None else x
        for family in self.families:
            if not family.internal:
                outer += self.force_of(family, t, x, v)
        return outer

    def lengths(self, t, x):
        """Natural length of each element [m], and ∂E/∂L [N]; the work of their change is the integral of both."""
        self.prepare(t)
        pull = np.empty(len(self.net.cells))
        self.by_length(t, x, self.net.cells, self.net.line_data, pull)
        return self.net.natural_length.copy(), pull

    @cached_property
    def _spread(self):
        """Consistent less lumped mass of all rows, a sparse matrix [kg]; None where mass is lumped."""
        from scipy.sparse import coo_array

        net = self.net
        if net.spread is None:
            return None
        i = np.repeat(net.cells[:, :, None], net.cells.shape[1], axis=2)
        pairs = (i.ravel(), i.swapaxes(1, 2).ravel())
        return coo_array((net.spread.ravel(), pairs), shape=(self.rows, self.rows)).tocsr()

    @cached_property
    def inverse_mass(self):
        """Free components that have mass, and the factorized mass matrix of these."""
        from scipy.sparse.linalg import splu

        heavy = np.repeat(self.net.mass, 3)[self.free] > 0.0
        return self.free[heavy], splu(self.pattern.matrix(self.mass())[heavy][:, heavy].tocsc())

    def moved_by(self, push):
        """M⁻¹ of a push on every row, for what is free: accelerations [m/s²] by forces; shape (rows, 3)."""
        (at, mass), moved = self.inverse_mass, np.zeros((self.rows, 3))
        moved.ravel()[at] = mass.solve(push.ravel()[at])
        return moved

    def kick(self, jump):
        """Jump of all velocities where prescribed ones jump by ``jump`` [m/s]: consistent mass passes it on."""
        return jump if self._spread is None else jump - self.moved_by(self._spread @ jump)

    @cached_property
    def links(self):
        """The `refweb.system.links.Links` of what keeps distances."""
        from .links import Links

        return Links(self)

    def balance(self, t, x, v):
        """As `forces`, and with the forces of links; on supports less those that consistent mass takes to move.

        What supports give is its negative.
        """
        force, out = self.forces(t, x, v)
        if self.constraints:
            force += self.links.force(x, v, force)
        if self._spread is not None and not self.net.quasi_static:
            force -= np.where(self.supported, self._spread @ self.moved_by(force), 0.0)
        return force, out

    def momentum(self, v):
        """M v of every row [N s], shape (rows, 3)."""
        lumped = self.net.mass[:, None] * v
        return lumped if self._spread is None else lumped + self._spread @ v

    def mass(self):
        """Values of the mass matrix M [kg] in the fixed pattern."""
        values = np.zeros(len(self.pattern.indices))
        if self.net.spread is not None:
            values += self.assemble_lines(np.kron(self.net.spread, np.eye(3)))
        values[self.pattern.diagonal] += np.repeat(self.net.mass, 3)[self.free]
        return values

    def row_name(self, row):
        """How a message calls a row: a node by its number, a body by its name."""
        return f"node {row}" if row < self.net.nodes else f'body "{row_names(self.net.bodies)[row - self.net.nodes]}"'

    def energy_of(self, family, t, x):
        """Energy of each cell of one family [J]."""
        out = np.zeros(len(family.cells))
        if family.energy is None:
            return out
        self.prepare(t)
        family.energy(t, x, family.cells, family.data, out)
        return out

    def energy(self, t, x):
        """Total potential Π [J]: that of the lines and of all loads."""
        return sum(self.energy_of(f, t, x).sum() for f in self.families)

    def stiffness(self, t, x, v=None, definite=False, only=None):
        """Values of K = −∂f/∂x [N/m] in the fixed pattern; ``definite`` leaves out what is negative.

        ``only`` is the name of an effect, to leave out all others.
        """
        self.prepare(t)
        v = self._rest if v is None else v
        for family, blocks in zip(self._stiff, self._blocks, strict=True):
            if family.stiffness is None or only not in (None, family.name):
                blocks[:] = 0.0
            else:
                family.stiffness(t, x, v, blocks, family.cells, family.data, definite)
        return self.pattern.assemble(self._blocks)

    @property
    def symmetric(self):
        """Whether K and C are symmetric."""
        return all(f.symmetric for f in self.families)

    @property
    def conservative(self):
        """Whether every force has a potential."""
        return self.symmetric and all(f.energy is not None for f in self.families)

    @property
    def dead(self):
        """Whether the only internal forces are the tensions of the lines, and all others are dead loads."""
        outer = [f for f in self.families if not f.internal]
        return all(f.stiffness is None and f.energy is not None for f in outer) and len(self.families) == len(outer) + 1

    @property
    def convex(self):
        """Whether the potential is convex and the loads are dead: `refweb.statics.duality_bound` then bounds errors."""
        return self.net.law.number == TENSION_ONLY and self.dead

    @property
    def turns(self):
        """Whether centrifugal forces act."""
        return any(family.name == "frame" for family in self.families)

    def damping(self, t, x, v):
        """Values of C = −∂f/∂v [N s/m] in the fixed pattern; None where no force depends on velocity."""
        if not any(f.damping is not None for f in self.families):
            return None
        self.prepare(t)
        for family, blocks in zip(self._stiff, self._blocks, strict=True):
            blocks[:] = 0.0
            if family.damping is not None:
                family.damping(t, x, v, blocks, family.cells, family.data, False)
        return self.pattern.assemble(self._blocks)

    def assemble_lines(self, blocks):
        """Values in the fixed pattern of one block (3 nodes, 3 nodes) per line element, shape (cells, ., .)."""
        at = next(i for i, f in enumerate(self._stiff) if f.cells is self.net.cells)
        empty = [np.zeros_like(b[:0]) for b in self._blocks]
        return self.pattern.assemble([*empty[:at], np.ascontiguousarray(blocks), *empty[at + 1 :]])
