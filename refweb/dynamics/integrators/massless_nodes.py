"""Nodes without mass: what no inertia holds has its position from the forces alone, 0 = f(t, x, v).

They have one where the tangent among them, K_mm, is positive definite, that is where tension holds them; that follows
all else without delay, K_mm v_m = −K_mo v_o − ∂f_m/∂t.

May change: constants and rounds of Newton's method. Must stay: public names of `Massless` and `REMEDY`, which `ida`
alone uses; a node that nothing holds is named and ends the run. Tests: ``tests/dynamics/integrators/test_ida.py``.
"""

from __future__ import annotations

import numpy as np

from ...errors import SolverError
from ...system.factorization import weak_pivot

WEAK = 1e-12
"""Share of the largest entry on the diagonal that each pivot of K_mm has to exceed."""
REMEDY = "give density > 0, a [[point_mass]] or more prestrain"


class Massless:
    """The nodes without mass of a system.

    Parameters
    ----------
    system : refweb.system.system.System
        The system.
    unknowns : ndarray of int
        Numbers of their displacements among the unknowns.

    Attributes
    ----------
    around : ndarray of bool, shape (cells,)
        Elements that hold them.
    """

    def __init__(self, system, unknowns):
        self.system, self._unknowns, self._at = system, unknowns, system.free[unknowns]
        self.around = np.isin(system.net.cells, self._at // 3).any(axis=1)
        pattern, number = system.pattern, np.full(system.pattern.size, -1)
        number[unknowns] = np.arange(len(unknowns))
        row, col = number[pattern.indices], number[np.repeat(np.arange(pattern.size), np.diff(pattern.indptr))]
        self._upper = np.flatnonzero((row >= 0) & (row <= col))
        lower = np.flatnonzero((col >= 0) & (col <= row))
        self._lower = lower[np.lexsort((col[lower], row[lower]))]
        self._diagonal = np.flatnonzero((row == col)[self._upper])
        indptr = np.searchsorted(col[self._upper], np.arange(len(unknowns) + 1))
        self._structure = row[self._upper].astype(np.int32), indptr.astype(np.int32)
        self._solver = None

    def adrift(self, K):
        """A node that nothing holds, by name; None where the symmetric part of K_mm is positive definite."""
        from qdldl import Solver
        from scipy.sparse import csc_matrix

        values = 0.5 * (K[self._upper] + K[self._lower])
        values[self._diagonal] -= WEAK * (np.abs(values[self._diagonal]).max() or 1.0)
        matrix = csc_matrix((values, *self._structure))
        if self._solver is None:
            self._solver = Solver(matrix, upper=True)
        else:
            self._solver.update(matrix, upper=True)
        weak = weak_pivot(self._solver)
        return None if weak is None else self.system.row_name(self._at[weak] // 3)

    def settle(self, x, v, near, fast):
        """Write positions and velocities at t = 0 into x and v: first with all at rest, then as all else moves.

        Parameters
        ----------
        x, v : ndarray, shape (rows, 3)
            Displacement [m] and velocity [m/s] of all rows.
        near, fast : float
            Small ones of these, see `refweb.dynamics.integrators.tolerances.scales`.

        Raises
        ------
        SolverError
            If a node has no position.
        """
        v.ravel()[self._at] = 0.0
        self._balance(x, np.zeros_like(v), near)
        h = 1e-4 * near / max(np.abs(v).max(), fast)
        now, soon, later = (self._ahead(k * h, x, v) for k in range(3))
        rate = (4.0 * soon - 3.0 * now - later) / (2.0 * h)
        v.ravel()[self._at] = self._solve(self.system.stiffness(0.0, x, v), rate)
        self._balance(x, v, near)

    def _balance(self, x, v, near):
        """Newton's method for the positions in which no force is left."""
        at = self._at
        force = self._force(0.0, x, v)
        for _ in range(50):
            K = self.system.stiffness(0.0, x, v)
            if (node := self.adrift(K)) is not None:
                raise SolverError(f"{node} has no position at t = 0: it has no mass, and no tension holds it; {REMEDY}")
            step, y = self._solve(K, force), x.copy()
            for _ in range(30):
                y.ravel()[at] = x.ravel()[at] + step
                forces = self._force(0.0, y, v)
                if np.linalg.norm(forces) < np.linalg.norm(force) or np.abs(step).max() < 1e-9 * near:
                    break
                step *= 0.5
            x[:], force = y, forces
            if np.abs(step).max() < 1e-7 * near:
                return
        node = self.system.row_name(at[np.abs(force).argmax()] // 3)
        raise SolverError(
            f"nodes without mass find no equilibrium at t = 0: {np.abs(force).max():.3g} N are left at {node}; {REMEDY}"
        )

    def _ahead(self, h, x, v):
        """Forces a time h later, when all that has mass has moved on with its velocity."""
        y = x + h * v
        y.ravel()[self._at] = x.ravel()[self._at]
        self.system.drive(h, y)
        return self._force(h, y, v)

    def _force(self, t, x, v):
        return self.system.force(t, x, v).ravel()[self._at]

    def _solve(self, K, b):
        from scipy.sparse.linalg import splu

        return splu(self.system.pattern.matrix(K)[self._unknowns][:, self._unknowns].tocsc()).solve(b)
