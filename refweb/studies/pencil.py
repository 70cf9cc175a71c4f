"""K and M of a system at a displacement: number of ω² below a limit, and the vectors of the next ones, none missed.

The number follows from counts of negative pivots (Sylvester's law of inertia). The vectors come from Lanczos iteration
on (K − σM)⁻¹ with σ just below the wanted ω², so that a thousand slack nodes cost nothing. One more count proves that
none is missed, which matters where symmetry makes frequencies double. Nodes without mass have no frequency and follow
the others.

May change: `DENSE`, which decides only what is quicker. Must stay: `STRAIN` and `ROUNDING`, which say what counts as no
stiffness; the count of pivots after a search, without which modes may be missed; the order of calls (a shift by `bend`
or `above` before what uses a factor); methods of `Pencil`, which `spectrum` and `turning` call. Tests:
``tests/studies/test_modes.py``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh, splu

from ..errors import SolverError
from ..system.factorization import Factor

STRAIN, ROUNDING = 1e-12, 1e-15
"""Stiffness that counts as zero: that of a tension of `STRAIN` EA in all lines, plus `ROUNDING` times EA/L at nodes."""
DENSE = 200
"""Number of unknowns with mass up to which all pairs are computed at once."""


class Pencil:
    """K and M at a displacement, in the unknowns of the system.

    Parameters
    ----------
    system : refweb.system.system.System
        System with a symmetric tangent.
    t : float
        Load step or time.
    x : ndarray, shape (rows, 3)
        Displacement [m].
    seed : int
        Seed of the start vector of the iteration.

    Attributes
    ----------
    K, M : sparse matrix, shape (unknowns, unknowns)
        Tangent [N/m] and mass [kg].
    massive, massless : ndarray of int
        Unknowns with mass, and unknowns without.
    strained : sparse matrix, shape (unknowns, unknowns)
        Stiffness across lines with a tension of EA each [N/m]; `STRAIN` times it counts as zero.

    Raises
    ------
    SolverError
        If no free node has mass, or an unknown has neither mass nor stiffness.
    """

    def __init__(self, system, t, x, seed):
        self.system, self.t, self.x, self.seed = system, t, x, seed
        pattern, net = system.pattern, system.net
        self._stiffness, self._mass = system.stiffness(t, x), system.mass_at(x)
        self.K, self.M = pattern.matrix(self._stiffness), pattern.matrix(self._mass)
        self._factor = Factor(pattern)
        self._inner: Any = None  # LU of the stiffness of what has no mass, where there is any
        diagonal = self.M.diagonal()
        self.massive, self.massless = np.flatnonzero(diagonal > 0.0), np.flatnonzero(diagonal == 0.0)
        if not len(self.massive):
            raise SolverError("no mode: no free node has mass; give the cable a density, or nodes a [[point_mass]]")
        axial = net.line_data.ea / system.natural_length(t)
        strained = system.at(t).across_lines(net.line_data.ea)
        self.strained = pattern.matrix(strained)
        taut = strained[pattern.diagonal]
        taut = np.where(taut > 0.0, taut, axial.max())
        self._ridge = STRAIN * strained
        self._ridge[pattern.diagonal] += ROUNDING * taut
        sums = abs(self.K).sum(axis=0) + taut
        # Above every ω², of consistent mass as well.
        self._top = 10.0 * (sums[self.massive] / diagonal[self.massive]).max()
        if len(self.massless):
            self._hold_massless(1e17 * sums.max() / diagonal[self.massive].min(), taut)

    def _hold_massless(self, large, taut):
        """Refuse unknowns that have neither mass nor stiffness; factorize the stiffness of those without mass."""
        if self.below(-large, -1.0):
            bare = self.massless[np.argmin(self.K.diagonal()[self.massless] / taut[self.massless])]
            raise SolverError(
                f"no modes at step {self.t:g}: of {len(self.massless)} unknowns without mass some have no stiffness "
                f"either, such as those of {self.system.row_name(self.system.free[bare] // 3)}: give the cable a "
                "density, or stretch it"
            )
        self._inner = splu(self.K[self.massless][:, self.massless])

    def below(self, shift, ridge=0.0):
        """Number of eigenvalues below a shift; ``ridge`` times the stiffness that counts as zero is added to K."""
        self._factor.update(self._stiffness - shift * self._mass + ridge * self._ridge)
        return self._factor.negative_pivots()

    def beside(self, low, sign):
        """A shift of a sign with at most ``low`` eigenvalues below it; the next one is within 1.5 times the shift."""
        near, far = 1e-24 * self._top, self._top
        while far > 1.5 * near:
            middle = np.sqrt(near * far)
            if (self.below(sign * middle) <= low) == (sign > 0.0):
                near = middle
            else:
                far = middle
        return near if sign > 0.0 else -far

    def above(self, shift, wanted):
        """Vectors of the next eigenvalues above a shift, shape (unknowns, wanted)."""
        low = self.below(shift)
        limit = len(self.massive) - low
        for attempt in range(4):
            squared, vectors = self._nearest(shift, min(wanted + 20 * attempt, limit), attempt)
            mark = squared[wanted - 1] - 1e-7 * abs(squared[wanted - 1] - shift)
            if self.below(mark) == low + np.count_nonzero(squared < mark):
                return vectors[:, :wanted]
        raise SolverError(f"no modes at step {self.t:g}: below ω² = {mark:.4g} 1/s² some modes are not found")

    def _nearest(self, shift, size, attempt):
        """Next eigenvalues above a shift, and their vectors; the iteration may miss some."""
        self._shift, self._solve, unknowns = shift, self._solver(shift), len(self.massive)
        mass = self.M[self.massive][:, self.massive]
        if unknowns <= DENSE or 3 * size >= unknowns:
            root = np.linalg.cholesky(mass.toarray())
            product = root.T @ np.column_stack([self._flexible(column) for column in root.T])
            inverse, parts = np.linalg.eigh(0.5 * (product + product.T))
            parts = scipy.linalg.solve_triangular(root.T, parts[:, : -size - 1 : -1])
            squared = shift + 1.0 / inverse[: -size - 1 : -1]
        else:
            start = np.random.default_rng(self.seed + attempt).standard_normal(unknowns)
            operator = LinearOperator(mass.shape, matvec=self._flexible, dtype=float)  # pyright: ignore[reportCallIssue]  # as __new__ takes them
            try:
                squared, parts = eigsh(mass, size, mass, shift, which="LA", v0=start, OPinv=operator)
            except ArpackError as error:
                raise SolverError(f"no modes at step {self.t:g}: {error}") from None
            order = np.argsort(squared)
            squared, parts = squared[order], parts[:, order]
        vectors = np.zeros((self.system.pattern.size, size))
        vectors[self.massive] = parts
        if self._inner is not None:
            vectors[self.massless] = -self._inner.solve((self.K @ vectors)[self.massless])
        return squared, vectors

    def _solver(self, shift):
        """Solution of (K − shift M) y = b as a function of b."""
        if self.below(shift):
            return splu(self.system.pattern.matrix(self._stiffness - shift * self._mass)).solve
        return self._factor.solve

    def _flexible(self, force):
        """Displacement of the unknowns with mass under forces on them."""
        vector = np.zeros(self.system.pattern.size)
        vector[self.massive] = force.ravel()
        y = self._solve(vector)
        if y is None:
            raise SolverError(f"no modes at step {self.t:g}: the stiffness is singular to rounding")
        return y[self.massive]

    def bend(self, shift):
        """Function from forces on unknowns with mass to their displacement, with the stiffness K − ``shift`` M."""
        self._shift, self._solve = shift, self._solver(shift)
        return self._flexible

    def follow(self, force):
        """Displacement of the unknowns without mass under forces on them; all others are fixed."""
        return self._inner.solve(force)

    def moved(self, force):
        """Displacement of the unknowns under a force, with the stiffness K − shift M of the last shift."""
        return self._solver(self._shift)(force)

    def change(self, x):
        """K at another displacement less K, a sparse matrix."""
        return self.system.pattern.matrix(self.system.stiffness(self.t, x) - self._stiffness)

    def residual(self, squared, vectors):
        """Norm of K φ − ω² M φ in M⁻¹ of each vector; unknowns without mass follow the others."""
        rest = self.K @ vectors - squared * (self.M @ vectors)
        ours = rest[self.massive]
        if self._inner is not None:
            ours = ours - self.K[self.massive][:, self.massless] @ self._inner.solve(rest[self.massless])
        inverse = splu(self.M[self.massive][:, self.massive]).solve(ours)
        return np.sqrt(np.maximum((ours * inverse).sum(axis=0), 0.0))
