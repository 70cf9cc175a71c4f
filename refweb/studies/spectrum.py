"""Natural frequencies about an equilibrium: the lowest pairs of K φ = ω² M φ, none missed, each with its bound.

K is the tangent at the equilibrium; across the lines of a net it is that of their tensions. Counts of negative pivots
(Sylvester's law of inertia) say first what there is: unstable directions, directions without stiffness, and the rest.
The pairs come from Lanczos iteration on (K − σM)⁻¹ with σ just below those wanted, so that a thousand slack nodes cost
nothing, and one more count says that none is missed, which matters where symmetry makes frequencies double. Nodes
without mass have no frequency and follow the others.

With M definite there is an eigenvalue within ‖Kφ − ω²Mφ‖ of ω², in the norm of M⁻¹ and with φᵀMφ = 1. To this bound
come the rounding of K, and what the error that is left in the equilibrium changes in ω²: K is assembled once more after
another Newton step.

In a frame that turns K has the centrifugal force, and Coriolis forces are left out: ω²Mφ = (K + iωG)φ with G of the
norm 2Ω has by Weyl's inequality its frequencies between √(Ω² + ω²) ± Ω, which the bound holds for every mode that they
act on. Those along the axis feel none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh, splu

from ..errors import SolverError
from ..net.net import AXIAL_STIFFNESS
from ..system.factorization import Factor

STRAIN, ROUNDING = 1e-12, 1e-15
"""A direction without stiffness: a tension of `STRAIN` EA in all lines, or `ROUNDING` of EA/L at nodes, would rule."""
DENSE = 200
"""Unknowns with mass up to which all pairs are found at once."""
_EPS = np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The lowest modes at one equilibrium, unstable ones first; directions without stiffness are only counted.

    Attributes
    ----------
    step : float
        Load step; in dynamics the time, 0.
    squared : ndarray, shape (modes,)
        ω² [1/s²], increasing; negative where the equilibrium is unstable.
    bound : ndarray, shape (modes,)
        Bound on the error of ω² [1/s²].
    residual : ndarray, shape (modes,)
        ‖Kφ − ω²Mφ‖ over |ω²| ‖φ‖, in the norms of M⁻¹ and M [1].
    shapes : ndarray, shape (modes, rows, 3)
        Displacements; the largest of a row is 1, and its largest component positive.
    modal_mass : ndarray, shape (modes,)
        φᵀMφ of the shapes [kg]: a shape over its root is mass-normalised.
    shares : ndarray, shape (modes, 3)
        Parts of the kinetic energy along x, y and z [1].
    moving : ndarray, shape (modes,)
        Share of the mass that moves, (Σ m|φ|²)²/(Σ m Σ m|φ|⁴) [1]: 1 where all moves alike, near 0 for a local mode.
    nodes : ndarray of int, shape (modes,)
        Row of the largest displacement.
    unstable, zero : int
        Number of modes of negative ω², and of directions without stiffness.
    """

    step: float
    squared: np.ndarray
    bound: np.ndarray
    residual: np.ndarray
    shapes: np.ndarray
    modal_mass: np.ndarray
    shares: np.ndarray
    moving: np.ndarray
    nodes: np.ndarray
    unstable: int
    zero: int

    @property
    def frequency(self):
        """√|ω²|/2π [Hz], shape (modes,); negative where ω² is, which is an imaginary frequency."""
        return _frequency(self.squared)

    @property
    def error(self):
        """± of each frequency [Hz] from the bound on ω², shape (modes,)."""
        ends = [_frequency(self.squared + sign * self.bound) for sign in (-1.0, 1.0)]
        return np.abs(np.array(ends) - self.frequency).max(axis=0)


def _frequency(squared):
    return np.sign(squared) * np.sqrt(np.abs(squared)) / (2.0 * np.pi)


def spectrum(system, t, x, number, seed=0):
    """The `Spectrum` of a system at its equilibrium.

    Parameters
    ----------
    system : refweb.system.system.System
        With a symmetric tangent.
    t : float
        Load step or time.
    x : ndarray, shape (rows, 3)
        Displacement of the equilibrium [m].
    number : int
        Modes wanted; there are fewer where the net has fewer.
    seed : int
        Of the vector that the iteration starts from.

    Raises
    ------
    SolverError
        Where nothing that has mass has stiffness, or a node has neither.
    """
    pencil = _Pencil(system, t, x, seed)
    unstable, low = pencil.below(0.0, 1.0), pencil.below(0.0, -1.0)
    vectors, shift = [], 0.0
    if unstable:
        vectors.append(pencil.above(pencil.beside(0, -1.0), min(number, unstable)))
    if unstable < low < len(pencil.massive):
        shift = pencil.beside(low, 1.0)
        low = pencil.below(shift)
    if number > unstable and low < len(pencil.massive):
        vectors.append(pencil.above(shift, min(number - unstable, len(pencil.massive) - low)))
    if not vectors:
        raise SolverError(
            f"no mode at step {t:g}: none of the {len(pencil.massive)} unknowns that have mass has stiffness; stretch "
            "the web by a load, or by a prestrain of its cable"
        )
    return pencil.described(np.hstack(vectors), unstable, low - unstable)


class _Pencil:
    """K and M at a displacement, in the unknowns of the system."""

    def __init__(self, system, t, x, seed):
        self.system, self.t, self.x, self.seed = system, t, x, seed
        pattern, net = system.pattern, system.net
        self._stiffness, self._mass = system.stiffness(t, x), system.mass.values
        self.K, self.M = pattern.matrix(self._stiffness), pattern.matrix(self._mass)
        self.factor, self._inner = Factor(pattern), None
        own = self.M.diagonal()
        self.massive, self.massless = np.flatnonzero(own > 0.0), np.flatnonzero(own == 0.0)
        if not len(self.massive):
            raise SolverError("no mode: no free node has mass; give the cable a density, or nodes a [[point_mass]]")
        unit = np.einsum("q,qa,qb->ab", net.weights, net.gradients, net.gradients)
        axial = net.line_data[:, AXIAL_STIFFNESS] / system.natural_length(t)
        self._strained = system.assemble_lines(np.kron(unit, np.eye(3)) * axial[:, None, None])
        taut = self._strained[pattern.diagonal]
        taut = np.where(taut > 0.0, taut, axial.max())
        self._ridge = STRAIN * self._strained
        self._ridge[pattern.diagonal] += ROUNDING * taut
        sums = abs(self.K).sum(axis=0) + taut
        self._top = 10.0 * (sums[self.massive] / own[self.massive]).max()  # above every ω², of consistent mass as well
        if len(self.massless):
            self._hold_massless(1e17 * sums.max() / own[self.massive].min(), taut)

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
        """Number of eigenvalues below a shift; K has ``ridge`` times what no stiffness means added."""
        self.factor.update(self._stiffness - shift * self._mass + ridge * self._ridge)
        return self.factor.negative_pivots()

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
        most = len(self.massive) - low
        for attempt in range(4):
            squared, vectors = self._nearest(shift, min(wanted + 20 * attempt, most), attempt)
            mark = squared[wanted - 1] - 1e-7 * abs(squared[wanted - 1] - shift)
            if self.below(mark) == low + np.count_nonzero(squared < mark):
                return vectors[:, :wanted]
        raise SolverError(f"no modes at step {self.t:g}: below ω² = {mark:.4g} 1/s² some of them stay unfound")

    def _nearest(self, shift, size, attempt):
        """Eigenvalues next above a shift, as far as they are found, and their vectors."""
        self._shift, self._solve, unknowns = shift, self._solver(shift), len(self.massive)
        mass = self.M[self.massive][:, self.massive]
        if unknowns <= DENSE or 3 * size >= unknowns:
            flexible, mass = np.column_stack([self._flexible(e) for e in np.eye(unknowns)]), mass.toarray()
            product = mass @ flexible @ mass
            inverse, parts = scipy.linalg.eigh(product + product.T, 2.0 * mass)
            squared, parts = shift + 1.0 / inverse[: -size - 1 : -1], parts[:, : -size - 1 : -1]
        else:
            start = np.random.default_rng(self.seed + attempt).standard_normal(unknowns)
            operator = LinearOperator(mass.shape, matvec=self._flexible, dtype=float)
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
        return self.factor.solve

    def _flexible(self, force):
        """Displacement of the unknowns with mass under forces on them."""
        whole = np.zeros(self.system.pattern.size)
        whole[self.massive] = force.ravel()
        y = self._solve(whole)
        if y is None:
            raise SolverError(f"no modes at step {self.t:g}: the stiffness is singular to rounding")
        return y[self.massive]

    def _bounds(self, squared, vectors):
        """Norm of K φ − ω² M φ, and with it the rounding of K and the error left in the equilibrium."""
        system, rest = self.system, self.K @ vectors - squared * (self.M @ vectors)
        ours = rest[self.massive]
        if self._inner is not None:
            ours = ours - self.K[self.massive][:, self.massless] @ self._inner.solve(rest[self.massless])
        inverse = splu(self.M[self.massive][:, self.massive]).solve(ours)
        residual = np.sqrt(np.maximum((ours * inverse).sum(axis=0), 0.0))
        size = abs(vectors)
        rounding = 8.0 * (size * (abs(self.K) @ size)).sum(axis=0)
        rounding += 2.0 * (vectors * (system.pattern.matrix(self._strained) @ vectors)).sum(axis=0)
        there = self.x.copy()
        there.ravel()[system.free] += self._solver(self._shift)(system.force(self.t, self.x).ravel()[system.free])
        change = system.pattern.matrix(system.stiffness(self.t, there) - self._stiffness)
        left = np.linalg.norm(vectors.T @ (change @ vectors), axis=0)  # whole rows: what parts equal frequencies too
        return residual, residual + _EPS * rounding + left

    def _turned(self, squared, shapes):
        """How far Coriolis forces may move ω²."""
        system = self.system
        turning = np.array(system.rotating[0].angular_velocity if system.rotating else (0.0, 0.0, 0.0))
        force = np.where(system.supported, 0.0, np.cross(turning, shapes))
        speed = np.linalg.norm(turning)
        felt = abs(force).max(axis=(1, 2)) > 1e-9 * speed * abs(shapes).max(axis=(1, 2))
        return np.where(felt, 2.0 * speed * (speed + np.sqrt(speed**2 + np.maximum(squared, 0.0))), 0.0)

    def described(self, vectors, unstable, zero):
        """The `Spectrum` of vectors."""
        system = self.system
        vectors = vectors / np.sqrt((vectors * (self.M @ vectors)).sum(axis=0))
        squared = (vectors * (self.K @ vectors)).sum(axis=0)
        vectors, squared = vectors[:, (order := np.argsort(squared))], squared[order]
        residual, bound = self._bounds(squared, vectors)
        modes = np.arange(len(squared))
        shapes = np.zeros((len(modes), system.rows, 3))
        shapes.reshape(len(modes), -1)[:, system.free] = vectors.T
        bound = bound + self._turned(squared, shapes)
        kinetic = np.zeros_like(shapes)
        kinetic.reshape(len(modes), -1)[:, system.free] = (vectors * (self.M @ vectors)).T
        size = np.linalg.norm(shapes, axis=2)
        nodes = np.argmax(size > (1.0 - 1e-6) * size.max(axis=1, keepdims=True), axis=1)  # the first of equal ones
        largest = shapes[modes, nodes]
        sign = np.sign(largest[modes, abs(largest).argmax(axis=1)])
        shapes *= (sign / size[modes, nodes])[:, None, None]
        mass = np.where(system.supported.all(axis=1), 0.0, system.net.mass)
        moving = (size**2 @ mass) ** 2 / (mass.sum() * (size**4 @ mass))
        return Spectrum(
            step=self.t,
            squared=squared,
            bound=bound,
            residual=residual / np.maximum(abs(squared), np.finfo(float).tiny),
            shapes=shapes,
            modal_mass=1.0 / size[modes, nodes] ** 2,
            shares=kinetic.sum(axis=1),
            moving=moving,
            nodes=nodes,
            unstable=unstable,
            zero=zero,
        )
