"""Free bodies in statics: each has a position and a rotation vector as unknowns; tangents by these.

An orientation has no coordinates in which a step is a sum: a step p turns a body by the rotation vector p from where it
is, q becomes exp(p/2) q. The force that belongs to p is the moment m about the centre, along the axes of space. If all
forces have a potential Π, the second derivative of Π along such steps is the symmetric part of −∂m/∂p. The other part,
half the matrix of m ×, is zero in an equilibrium, as the moment is. Newton's method with the symmetric part therefore
reduces Π and converges quadratically, and its pivots show if an equilibrium is stable. Without a potential K is −∂m/∂p
itself.

A body on an axle turns about that alone: its moment counts along the direction n of the axle, and of K what is n nᵀ K n
nᵀ, beside a stiffness across that moves nothing.

A node at the arm a of a body moves by δ + p × a, so that a block K of lines becomes Lᵀ K L with L = (1, −a ×), and as
the arm turns f·a 1 − a⊗f of the force f on the node is added, as in `refweb.system.attached_nodes`. Kernels of contact
have columns for the quaternion q = (w, u); those of p follow by δw = −½ u·p and δu = ½ (w p + p × u).

`System.carriers` makes it of the terms in the tangent, whose numbers are those of ``blocks``. May change: `ACROSS`,
which moves no body, private methods but `_state`, which `attached_nodes.Carried` calls. Must stay: of the two rows of
rotation the first has the rotation vector, the second no unknown; names of public methods, which `System`, `statics`
and `studies` call through `System.carriers`. Must follow a change of `attached_nodes`. Must stay as well:
`RestingBodies`, which `system` imports. Tests: ``tests/statics/test_free_bodies.py``, ``tests/effects/test_axles.py``.
"""

from __future__ import annotations

import numpy as np

from .attached_nodes import Carried, add_to, cross_matrix, lever_stiffness

ACROSS = 1e-6
"""Moment of inertia across an axle over that about it: what it makes are modes a thousand times as fast, of no body."""
NO_TURN = np.hstack([np.eye(3), np.zeros((3, 3))])
"""∂θ of the two rows of rotation of a body: the first row has the rotation vector as its displacement."""


class RestingBodies(Carried):
    """Free bodies whose orientation counts in statics, and the nodes that they carry."""

    def __init__(self, net, terms):
        super().__init__(net, terms)
        moved = [body.moved for body in net.bodies if body.turn is not None]
        self._on_axles = [n for n in np.flatnonzero(self.turns.axles.any(axis=1)).tolist() if not moved[n]]
        self._columns = []
        for i, term in enumerate(terms):
            for n, (_, spin, turn) in enumerate(self.turns.rows):
                for at in range(term.cells.shape[1] - 1):
                    cells = np.flatnonzero((term.cells[:, at] == spin) & (term.cells[:, at + 1] == turn))
                    if len(cells):
                        self._columns.append((i, cells, 3 * at, n))

    def add_forces_to_bodies(self, x, f):
        """Add the forces on the nodes to those on the bodies, shape (rows, 3); axles bear moments across them."""
        super().add_forces_to_bodies(x, f)
        for n in self._on_axles:
            axle, spin = self.turns.axles[n], self.turns.rows[n, 1]
            f[spin] = (axle @ f[spin]) * axle

    def _leave_along_axles(self, pattern, values, across=True):
        """Leave in values what turns bodies about their axles, with a stiffness ``across`` them."""
        for n in self._on_axles:
            row, column, at = self._spun[n]
            block = np.flatnonzero((row < 3) & (column < 3))
            if not len(block):  # its rotation is no unknown
                continue
            size = np.abs(values[at[block]]).max() or 1.0
            along = np.outer(self.turns.axles[n], self.turns.axles[n])
            spins = np.unique(pattern.indices[at[block]])
            rows = np.array([np.flatnonzero(pattern.indices == spin) for spin in spins])
            values[rows] = along @ values[rows]
            columns = np.array([np.arange(*pattern.indptr[[spin, spin + 1]]) for spin in spins])
            values[columns] = along @ values[columns]
            if across:
                values[at[block]] += size * (np.eye(3) - along)[row[block], column[block]]

    def convert(self, x, blocks):
        """Replace the columns of quaternions by columns of rotation vectors, in blocks −∂f/∂x of all terms."""
        for i, cells, at, n in self._columns:
            _, spin, turn = self.turns.rows[n]
            u, block = x[spin], blocks[i]
            by_vector = 0.5 * ((1.0 + x[turn, 0]) * np.eye(3) - cross_matrix(u))
            columns = block[cells, :, at : at + 3] @ by_vector
            block[cells, :, at : at + 3] = columns - 0.5 * block[cells, :, at + 3, None] * u
            block[cells, :, at + 3 : at + 6] = 0.0

    def _state(self, x, v):
        """Arm of each node, and ω, W, u and ∂θ by the rows of rotation of its body, at rest."""
        zero, states = np.zeros(3), []
        for (_, n), arm in zip(self.turns.carried, self.turns.arms, strict=True):
            R = np.array(self.matrix(n, x))
            states.append((R @ arm, zero, R @ self.turns.mobility[n] @ R.T, zero, NO_TURN))
        return states

    def add_stiffness(self, values, system, t, x, v, blocks, definite=False, only=None):
        """Add the part of these nodes to the values of K, from the blocks −∂f/∂x of the terms.

        ``definite`` and ``only`` are those of `refweb.system.system.System.stiffness`.
        """
        self._arrange(system.pattern, system.free)
        state = self._state(x, v)
        self._add_blocks(values, state, lambda cell: blocks[cell.term][cell.at])
        if len(self.turns.carried):
            terms = system.terms if only is None else only
            force = sum((system.force_of(term, t, x, v) for term in terms), np.zeros((system.rows, 3)))
            for c, (node, n) in enumerate(self.turns.carried):
                arm, f = state[c][0], force[node]
                turned = lever_stiffness(arm, f)
                if definite:
                    size, axes = np.linalg.eigh(0.5 * (turned + turned.T))
                    turned = axes * np.maximum(size, 0.0) @ axes.T
                expanded = np.zeros((6, 6))
                expanded[:3, :3] = turned
                add_to(values, self._spun[n], expanded)
        if system.conservative:
            self._make_symmetric(values)
        self._leave_along_axles(system.pattern, values)

    def _make_symmetric(self, values):
        """Replace the derivative of the moment of each body by its own rotation with the symmetric part."""
        for row, column, at in self._spun:
            matrix = np.zeros((6, 6))
            matrix[row, column] = values[at]
            values[at] = 0.5 * (matrix + matrix.T)[row, column]

    def add_across(self, values, system, lines, blocks):
        """Add the part of these nodes in blocks (3 nodes, 3 nodes) of the term ``lines``, in the position as built."""
        self._arrange(system.pattern, system.free)
        still = np.zeros((system.rows, 3))
        state = self._state(still, still)
        self._add_blocks(values, state, lambda cell: blocks[cell.at] if cell.term == lines else None)
        self._leave_along_axles(system.pattern, values, across=False)

    def add_moves(self, x, moves):
        """Write displacements of carried nodes into moves of all rows about x, to first order, shape (k, rows, 3)."""
        for (node, n), (arm, *_) in zip(self.turns.carried, self._state(x, x), strict=True):
            row, spin, _ = self.turns.rows[n]
            moves[:, node] = moves[:, row] + np.cross(moves[:, spin], arm)

    def tensors(self, values, system, x):
        """Values, with those of rotations times J/I, J the tensor of inertia of each body in its orientation at x.

        Values of M then contain the tensor in place of the one moment I, and values of the identity convert rates of
        L/I to rates of the angular velocity.
        """
        self._arrange(system.pattern, system.free)
        values = values.copy()
        for n, (row, column, at) in enumerate(self._spun):
            block, tensor = np.zeros((6, 6)), np.eye(6)
            block[row, column] = values[at]
            tensor[:3, :3] = self._tensor(n, x)
            values[at] = (block @ tensor)[row, column]
        return values

    def _tensor(self, n, x):
        """J/I of a body as it stands at x; about an axle with a little across it, so that it has an inverse."""
        R = np.array(self.matrix(n, x))
        tensor = R @ np.linalg.pinv(self.turns.mobility[n]) @ R.T
        return tensor + ACROSS * (np.eye(3) - tensor) if n in self._on_axles else tensor

    def count_across(self, system):
        """Number of unknowns that turn bodies across their axles, which no body does."""
        return 2 * sum(np.isin(self.turns.rows[n, 1], system.free // 3) for n in self._on_axles)

    def turns_about_axles(self, system, vectors):
        """Mask of the vectors (unknowns, modes) that turn no body across its axle, shape (modes,)."""
        turned = np.ones(vectors.shape[1], dtype=bool)
        for n in self._on_axles:
            of_it = np.flatnonzero(system.free // 3 == self.turns.rows[n, 1])
            if len(of_it):
                spun, along = vectors[of_it], self.turns.axles[n]
                across = spun - np.outer(along, along @ spun)
                turned &= (np.abs(across) ** 2).sum(axis=0) <= 0.5 * (np.abs(vectors) ** 2).sum(axis=0)
        return turned

    def momenta(self, system, x):
        """Sparse matrix of the unknowns that converts derivatives by L/I to derivatives by angular velocities."""
        values = np.zeros(len(system.pattern.indices))
        values[system.pattern.diagonal] = 1.0
        return system.pattern.matrix(self.tensors(values, system, x))

    def coriolis(self, system, x, speed):
        """Values of −∂f/∂ω of the moments 2 ω × S Ω in axes that turn with Ω, see `refweb.effects.turning_bodies`."""
        self._arrange(system.pattern, system.free)
        values = np.zeros(len(system.pattern.indices))
        for n, (row, column, at) in enumerate(self._spun):
            block, J = np.zeros((6, 6)), self.turns.moment[n] * self._tensor(n, x)
            block[:3, :3] = 2.0 * cross_matrix((0.5 * np.trace(J) * np.eye(3) - J) @ speed)
            values[at] = block[row, column]
        return values
