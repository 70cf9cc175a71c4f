"""Rigid links of a system: their equations and the forces that keep the lengths.

The accelerations satisfy M a + Gᵀλ = f with G = ∂g/∂x, and keep the lengths if G a = −|v₂ − v₁|²/L. A state is moved to
the nearest velocities with G v = 0 and to the nearest positions with G δx = −g; mass weighs the distance.

May change: constants and private functions. Must stay: `places` and `values` list the same entries in the same order,
for the unknowns (x, v, λ, μ) of `dynamics.integrators.ida`: change all three together. Messages and lengths are tested
by ``tests/dynamics/integrators/test_ida.py``. Must stay as well: `Links` with its public names, which `system` imports.
"""

from __future__ import annotations

import numpy as np

from ..effects.base import Constraint
from ..errors import InputError, SolverError
from .factorization import weak_pivot

WEAK = 1e-12
"""Smallest pivot of G M⁻¹ Gᵀ over its largest entry, for which the forces of links count as determined."""
STRETCH = 1e-6
"""Largest relative error of a length in a state to start from."""
FINE = 1e-13
"""Relative error of lengths at which an iteration stops."""


class Links:
    """All links of a system, for the components that have mass and are free.

    Attributes
    ----------
    pairs : refweb.effects.base.Constraint
        The links, one after another.

    Raises
    ------
    InputError
        For a link between supported nodes, a distance that is kept already, and a node without mass or with prescribed
        motion.
    """

    def __init__(self, system):
        given = system.constraints
        cells, data = (np.vstack([getattr(link, name) for link in given]) for name in ("cells", "data"))
        self.pairs = Constraint(cells=cells, data=data)
        table = np.repeat(np.arange(len(given)), [len(link.cells) for link in given]) + 1
        self._names = [f"[[link]] {i} of nodes {a} and {b}" for i, (a, b) in zip(table, cells, strict=True)]
        self._refuse(system)
        self._M, self._at = system.mass.matrix, system.mass.heavy
        number = np.full(3 * system.rows, -1)
        number[self._at] = np.arange(len(self._at))
        unknown = number[3 * cells[:, :, None] + np.arange(3)]  # of (link, end, axis)
        moving = unknown >= 0
        self._link, end, self._axis = np.nonzero(moving)
        self._unknown, self._sign = unknown[moving], 2.0 * end - 1.0
        opposite = np.full(unknown.shape, -1)
        opposite[moving] = np.arange(len(self._link))
        self._opposite = opposite[:, ::-1][moving]
        self._both = np.flatnonzero(self._opposite >= 0)
        self._refuse_redundant(np.zeros((system.rows, 3)))
        self._arrange()

    def __len__(self):
        return len(self._names)

    def _refuse(self, system):
        free = ~system.supported
        driven = np.concatenate([[], *(d.cells[:, 0] for d in system.drives)])
        for name, pair in zip(self._names, self.pairs.cells, strict=True):
            for node in pair[np.isin(pair, driven)]:
                raise InputError(
                    f"{name}: node {node} moves by [[motion]], whose jumps of velocity no rigid link can follow: link "
                    "to a free node, tied to it by a line"
                )
            if not free[pair].any():
                raise InputError(f"{name}: both are supported, so that it holds nothing: leave it out")
            for node in pair[(system.net.mass[pair] <= 0.0) & free[pair].any(axis=1)]:
                raise InputError(f"{name}: node {node} has no mass: give density > 0 or a [[point_mass]]")

    def _refuse_redundant(self, x):
        from qdldl import Solver
        from scipy.sparse import csc_matrix, csr_array, eye_array, triu

        G = csr_array((self._entries(x), (self._link, self._unknown)), shape=(len(self), len(self._at)))
        coupling = G @ (G / self._M.diagonal()).T
        coupling = coupling - WEAK * abs(coupling).max() * eye_array(len(self))
        if (weak := weak_pivot(Solver(csc_matrix(triu(coupling)), upper=True))) is not None:
            raise InputError(
                f"{self._names[weak]}: the other links and the supports hold that distance already, so that its force "
                "is not determined: leave it out"
            )

    def refuse_stretched(self, x):
        """Refuse a start in which a link does not have its length."""
        off = self.pairs.excess(x) / self.pairs.length
        worst = int(np.abs(off).argmax())
        if not abs(off[worst]) < STRETCH:
            raise InputError(f"{self._names[worst]}: the start has it stretched by {off[worst]:.3g} of its length")

    def _arrange(self):
        """The fixed pattern of [[M, Gᵀ], [G, 0]]."""
        n, M = len(self._at), self._M.tocoo()
        size = n + len(self)
        rows = np.concatenate([M.row, self._unknown, n + self._link])
        columns = np.concatenate([M.col, n + self._link, self._unknown])
        keys, self._slots = np.unique(columns.astype(np.int64) * size + rows, return_inverse=True)
        indptr = np.searchsorted(keys, size * np.arange(size + 1)).astype(np.int32)
        self._pattern, self._lu = ((keys % size).astype(np.int32), indptr), None

    def _entries(self, x):
        """∂g/∂x of the ends that move."""
        return self._sign * self.pairs.direction(x)[self._link, self._axis]

    def places(self, position, velocity, first):
        """Rows and columns of the entries that links add to the Jacobian of `refweb.dynamics.integrators.ida`.

        Parameters
        ----------
        position, velocity : ndarray of int
            Numbers of the equations x' − v and M v' − f of all components with mass that are free; x and v have the
            same numbers.
        first : int
            Number of g and of λ of the first link; the numbers of G v and μ follow.
        """
        x, v, force = position[self._unknown], velocity[self._unknown], first + self._link
        rate, both = force + len(self), self._both
        values, across = (v, x), (v[both], x[self._opposite[both]])
        return [(v, force), values, across, (x, rate), (force, x), (rate, v), (rate, x)]

    def values(self, x, v, multipliers):
        """Values of the entries at `places`."""
        G, length = self._entries(x), self.pairs.length[self._link]
        turn = multipliers[self._link] / length
        rate = self._sign * self.pairs.between(v)[self._link, self._axis] / length
        return [G, turn, -turn[self._both], G, G, G, rate]

    def solve(self, x, f, b):
        """Solve M a + Gᵀλ = f, G a = b for a and λ, by the last factorization if refinement reaches the residual."""
        from scipy.sparse import csc_array

        G, size = self._entries(x), len(self._pattern[1]) - 1
        data = np.bincount(self._slots, np.concatenate([self._M.data, G, G]))
        matrix, lu = csc_array((data, *self._pattern), shape=(size, size)), self._lu
        rest = wanted = np.concatenate([f, b])
        solution = np.zeros_like(wanted)
        for i in range(5):
            if lu is None or i == 4:
                self._lu = lu = _factorized(matrix)
                rest, solution = wanted, np.zeros_like(wanted)
            solution = solution + lu.solve(rest)
            rest = wanted - matrix @ solution
            if np.abs(rest).max() <= 1e-10 * np.abs(wanted).max():
                break
        return solution[: len(f)], solution[len(f) :]

    def start(self, x, v, force):
        """Accelerations of the components with mass [m/s²], and λ [N], for all other forces [N]."""
        return self.solve(x, force.ravel()[self._at], -self.pairs.turning(v))

    def force(self, x, v, force):
        """Force of the links on every row [N], shape (rows, 3), for all other forces [N]."""
        return -self.pairs.pull(x, self.start(x, v, force)[1])

    def drift(self, x, v):
        """Largest relative error of a length, and largest rate of one [m/s]."""
        return np.abs(self.pairs.excess(x) / self.pairs.length).max(), np.abs(self.pairs.speed(x, v)).max()

    def hold(self, x, v):
        """Move x and v to the nearest state that keeps the lengths."""
        still, moving = np.zeros(len(self._at)), x.ravel()
        for _ in range(4):
            excess = self.pairs.excess(x)
            if np.abs(excess).max() <= FINE * self.pairs.length.min():
                break
            moving[self._at] += self.solve(x, still, -excess)[0]
        v.ravel()[self._at] += self.solve(x, still, -self.pairs.speed(x, v))[0]


def _factorized(matrix):
    from scipy.sparse.linalg import splu

    try:
        return splu(matrix)
    except RuntimeError:
        raise SolverError("links have moved so that their forces are not determined") from None
