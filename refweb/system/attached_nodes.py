"""Tangents of nodes that bodies carry: these nodes are no unknowns and move with their bodies.

A node at the arm a of a body moves by δx = δx_b + δθ × a. A force f on the node acts on the body as the force f and the
moment a × f. The block K of a cell with such a node becomes L K T: T gives the motion of the cell's nodes from that of
its rows, and L sums the forces on the nodes to forces on the rows. Since the arm turns, −∂(a × f)/∂θ = (f·a) 1 − a⊗f is
added. For forces that depend on velocity, C becomes L C T_v, and K gains a part because the velocities of nodes turn
with the body:

    δv = δv_b + δω × a + ω × (δθ × a),        δω = W δu + δθ × ω − W (δθ × u),

with W and u of `refweb.net.rotation`. `refweb.net.rotation.to_quaternion` gives δθ by the change of the quaternion.

May change: how blocks are multiplied, and private names that `resting_bodies` does not use. Must stay: names and
arguments of public methods, which `System`, statics and studies call through `System.carriers`; `cells` couples all
rows that any block needs, else entries are missing in the pattern. Must follow: `resting_bodies`, which derives from
`Carried` with a `_state` of its own. Must stay as well: `add_to`, `cross_matrix` and `lever_stiffness`, which
`resting_bodies` imports; `Carried._spun` and `_add_blocks`, which `resting_bodies` uses. Tests:
``tests/effects/test_attach.py``, ``tests/statics/test_free_bodies.py``.
"""

from __future__ import annotations

import numpy as np

from ..net.rotation import RigidRotations, add_forces_to_bodies, angular_velocity, matrix_at, update_attached_nodes


class _Cell:
    """A cell with nodes that bodies carry.

    Attributes
    ----------
    term, at : int
        Number of the term in the pattern, and of the cell in the term.
    own_rows : list of int
        Index in ``rows`` of each row of the cell; −1 for a carried node.
    parts : list of (int, int, int)
        For each carried node: its number in the cell, its number among the carried nodes, and the index in ``rows`` of
        the row of its body, which the rows of rotation follow.
    """

    def __init__(self, term, at, cell, turns):
        self.term, self.at = term, at
        number = {int(node): c for c, (node, _) in enumerate(turns.carried)}
        rows: list = []
        for row in cell.tolist():
            rows += turns.rows[turns.carried[number[row], 1]].tolist() if row in number else [row]
        self.rows = list(dict.fromkeys(rows))
        self.own_rows = [-1 if row in number else self.rows.index(row) for row in cell.tolist()]
        self.parts = [
            (i, number[row], [self.rows.index(r) for r in turns.rows[turns.carried[number[row], 1]].tolist()])
            for i, row in enumerate(cell.tolist())
            if row in number
        ]

    def unmoved(self):
        """T and L of the rows that are not carried, shapes (3 cell rows, 3 ``rows``) and (3 ``rows``, 3 cell rows)."""
        T = np.zeros((3 * len(self.own_rows), 3 * len(self.rows)))
        for i, r in enumerate(self.own_rows):
            if r >= 0:
                T[3 * i : 3 * i + 3, 3 * r : 3 * r + 3] = np.eye(3)
        return T, T.T.copy()


class Carried:
    """The nodes that free bodies carry.

    Parameters
    ----------
    net : refweb.net.net.Net
        With the bodies.
    terms : list of refweb.effects.base.ForceTerm
        Terms of the pattern, in its order.
    """

    def __init__(self, net, terms):
        self.turns, self._terms = RigidRotations.of(net), terms
        self._entries, self._spun = [], []  # made once there is a pattern
        turns, nodes = self.turns, self.turns.carried[:, 0]
        self._cells = [
            _Cell(i, int(at), term.cells[at], turns)
            for i, term in enumerate(terms)
            for at in np.flatnonzero(np.isin(term.cells, nodes).any(axis=1))
        ]

    @property
    def cells(self):
        """Rows that are coupled, each of shape (1, rows)."""
        return [np.array([cell.rows], dtype=np.int32) for cell in self._cells]

    def moving(self, rows):
        """Rows that move some rows: the body of a carried node, and each other row itself."""
        bodies = dict(zip(self.turns.carried[:, 0].tolist(), self.turns.carried[:, 1].tolist(), strict=True))
        return [int(self.turns.rows[bodies[row], 0]) if row in bodies else row for row in rows]

    def update_attached_nodes(self, x, v):
        """Write displacements and velocities of the nodes into x and v, shape (rows, 3)."""
        update_attached_nodes(x, v, self.turns)

    def add_forces_to_bodies(self, x, f):
        """Add the forces on the nodes to those on the bodies, shape (rows, 3)."""
        add_forces_to_bodies(x, f, self.turns)

    def _arrange(self, pattern, free):
        """Find the positions of all entries in the pattern of a system, which contains `cells`."""
        if self._spun:
            return
        number = np.full(3 * max(3 + self.turns.rows.max(), 1 + free.max(initial=0) // 3), -1)
        number[free] = np.arange(len(free))
        keys = np.repeat(np.arange(pattern.size), np.diff(pattern.indptr)) * np.int64(pattern.size) + pattern.indices
        self._spun = [_entries(rows[1:].tolist(), pattern.size, number, keys) for rows in self.turns.rows]
        self._entries = [_entries(cell.rows, pattern.size, number, keys) for cell in self._cells]

    def _state(self, x, v):
        """Arm, ω, W, u and ∂θ/∂q of each node; ∂θ/∂q is by the quaternion of its body, shape (3, 6)."""
        states = []
        for c, (_, n) in enumerate(self.turns.carried):
            _, spin, turn = self.turns.rows[n]
            R = np.array(matrix_at(x, spin, turn))
            q = np.array([1.0 + x[turn, 0], *x[spin]])
            angle = np.zeros((3, 6))  # of q's vector part, which stands first, and of q₀
            angle[:, :3], angle[:, 3] = q[0] * np.eye(3) + cross_matrix(q[1:]), -q[1:]
            angle *= 2.0 / (q @ q)
            W = R @ self.turns.mobility[n] @ R.T
            states.append((R @ self.turns.arms[c], np.array(angular_velocity(n, x, v, self.turns)), W, v[spin], angle))
        return states

    def _matrices(self, cell, state):
        """(T, T by velocities, T of velocities by places, L) of a cell."""
        T, L = cell.unmoved()
        fast, turned = T.copy(), np.zeros_like(T)
        for i, c, (b, s, q) in cell.parts:
            arm, omega, W, u, angle = state[c]
            at, body, spin, quaternion = (slice(3 * row, 3 * row + 3) for row in (i, b, s, q))
            A = cross_matrix(arm)
            T[at, body] = fast[at, body] = L[body, at] = np.eye(3)
            L[spin, at], fast[at, spin] = A, -A @ W
            T[at, spin], T[at, quaternion] = -A @ angle[:, :3], -A @ angle[:, 3:]
            rate = A @ (cross_matrix(omega) - W @ cross_matrix(u)) - cross_matrix(omega) @ A
            turned[at, spin], turned[at, quaternion] = rate @ angle[:, :3], rate @ angle[:, 3:]
        return T, fast, turned, L

    def matrix(self, n, x):
        """Rows of the rotation matrix of a body, by its number among those that turn."""
        return matrix_at(x, *self.turns.rows[n, 1:])

    def convert(self, x, blocks):
        """Keep the columns of quaternions, which are unknowns here."""

    def add_stiffness(self, values, system, t, x, v, blocks, definite=False, only=None):
        """Add the part of these nodes to the values of K, from the blocks −∂f/∂x of the terms."""
        self._arrange(system.pattern, system.free)
        state, damped = self._state(x, v), {}
        for i, term in enumerate(self._terms):
            if term.velocity.damping is not None:
                damped[i] = np.zeros_like(blocks[i])
                term.velocity.damping(t, x, v, damped[i], term.cells, system.data_of(term, t), False)
        for cell, entries in zip(self._cells, self._entries, strict=True):
            T, _, turned, L = self._matrices(cell, state)
            block = blocks[cell.term][cell.at]
            expanded = beside(L @ block @ T, block, cell)
            if cell.term in damped:
                expanded += L @ damped[cell.term][cell.at] @ turned
            add_to(values, entries, expanded)
        force = system.force(t, x, v)
        for c, (node, n) in enumerate(self.turns.carried):
            (arm, *_, angle), f = state[c], force[node]
            expanded = np.zeros((6, 6))
            expanded[:3] = lever_stiffness(arm, f) @ angle
            add_to(values, self._spun[n], expanded)

    def add_damping(self, values, system, x, v, blocks):
        """Add the part of these nodes to the values of C, from the blocks −∂f/∂v."""
        self._arrange(system.pattern, system.free)
        self._add_blocks(values, self._state(x, v), lambda cell: blocks[cell.term][cell.at], 1)

    def _add_blocks(self, values, state, block_of, which=0):
        """Add the blocks of cells that have one, by their matrices T, number 0, or T of velocities, number 1."""
        for cell, entries in zip(self._cells, self._entries, strict=True):
            if (block := block_of(cell)) is not None:
                matrices = self._matrices(cell, state)
                add_to(values, entries, beside(matrices[3] @ block @ matrices[which], block, cell))


def lever_stiffness(arm, force):
    """−∂m/∂p of the moment m of a force on a node that a rotation vector p carries about an arm, shape (3, 3)."""
    return (force @ arm) * np.eye(3) - np.outer(arm, force)


def _entries(rows, size, number, keys):
    """Rows, columns and positions of the entries of a block that are in a pattern of such keys."""
    of = number[3 * np.array(rows)[:, None] + np.arange(3)].ravel()
    inside = np.flatnonzero(of >= 0)
    row, column = (side.ravel() for side in np.meshgrid(inside, inside, indexing="ij"))
    wanted = of[column] * np.int64(size) + of[row]
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    present = keys[at] == wanted
    return row[present], column[present], at[present]


def beside(expanded, block, cell):
    """A new block of a cell without the entries that are in the pattern already."""
    T, L = cell.unmoved()
    return expanded - L @ block @ T


def add_to(values, entries, expanded):
    """Add a block to values in the pattern, by its `_entries`."""
    row, column, at = entries
    values[at] += expanded[row, column]


def cross_matrix(a):
    """Matrix of a × b."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
