"""Proven bound on the error of a static solution, from convex duality.

For the tension-only law the potential Π(x) = Σ ½ k (l − L)₊² − f·x, k = EA/L, is convex in the positions. Let s be
vectors of element forces that balance the loads at every free node. They give the dual value D(s) ≤ min Π. The duality
gap is a sum over lines of terms that are never negative,

    Π − D = Σ ½ k (l − L)₊² + |s|²/2k + L|s| − s·d,      d the line's vector, l = |d|,

It is evaluated without cancellation, with T = k (l − L)₊: (T − |s|)²/2k on taut lines, |s|²/2k + |s|(L − l) on slack
lines, plus (|s| l − s·d) for the direction. The stress energy of the element forces is quadratic, and its gradient is
Lipschitz with k. Hence Σ |T t − s*|²/2k ≤ Π − Π* ≤ gap, which bounds every tension: |T − T*| ≤ √(2 k gap).

A force density q > 0 is the same with k = q and L = 0. Of a law whose tension rises along a curve, with slopes of at
most k, l_s is the length at the tension |s|. The part of a line along itself is then

    W(l) + W*(|s|) − |s| l = (T − |s|)(l − l_s) − (W(l_s) + W*(T) − T l_s) ≤ (T − |s|)(l − l_s) − (T − |s|)²/2k,

and this bound takes the place of the first two terms. The energy of these lines is bounded by that at the ends of the
range of each tension. Of curved elements every quadrature point is such a line, a bar
of natural length w L whose vector is w dx/dξ.

A thread of the length l of all its segments has the tension τ, the largest of |s| along it, and beside W(l) + W*(τ) −
τ l the part (τ − |s|) l_s of each segment.

The computed forces are corrected until they balance the loads: s += D B p, where B p are changes of the vectors of the
lines and Bᵀ D B p equals the unbalanced force. With the tangent, D = k t⊗t + (T/l)(1 − t⊗t), the correction has the
least gap to second order. Newton's method leaves a factorization of this tangent or of a similar one. Where this
correction does not reach rounding, another one does: D = k on taut lines and nearly zero on slack lines, with a new
factorization. Any solution p proves a bound, and the smaller bound is taken. The correction is kept in extended
precision where the platform has it, because the remaining unbalanced force enters the gap times a displacement.

May change: the three constants, and how forces are corrected: any correction proves a bound, a better one a smaller
bound. Must stay: each term of the gap is at least 0 and holds its rounding, else nothing is proven; names of the fields
of `DualityBound`, which `simulation`, `floating` and `results.observables` read. `thread_bars` brings the same arrays
for threads. Must stay as well: `duality_bound`, which `equilibrium` and `monotone_loading` import.
Tests: ``tests/statics/test_statics.py``, ``tests/net/test_curves.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..system import conjugate_gradients
from ..system.factorization import Factor
from .bars import Bars

ROUNDS, MOST, CLOSE = 5, 8, 1e-2
"""Largest number of corrections of forces; largest number of conjugate gradient iterations for each, and their
tolerance."""
SHARP = 4.0
"""Largest gap, over the least gap by rounding, that is not worth another correction."""


@dataclass(frozen=True, eq=False)
class DualityBound:
    """Bounds on a static solution.

    Attributes
    ----------
    gap : float
        Π(x) − D(s), with its rounding [J]; the exact potential lies within [Π − gap, Π].
    tension : ndarray, shape (cells,)
        Bound on the error of each element's tension [N].
    strain : ndarray, shape (cells,)
        Bound on the error of each element's strain [1], where it is taut.
    strain_energy : float
        Bound on the error of the strain energy [J].
    sharp : bool
        True if the gap is at most `SHARP` times the least gap by rounding.
    threads : ndarray, shape (threads,)
        Bound on the error of the tension of each thread [N].
    """

    gap: float
    tension: np.ndarray
    strain: np.ndarray
    strain_energy: float
    sharp: bool = False
    threads: np.ndarray = field(default_factory=lambda: np.zeros(0))


def duality_bound(system, equilibrium, factor=None):
    """The `DualityBound` of an equilibrium.

    Parameters
    ----------
    system : refweb.system.system.System
        A system that is ``bounded``.
    equilibrium : refweb.statics.equilibrium.Equilibrium
        Its state.
    factor : refweb.system.factorization.Factor, optional
        A factorization that is used again; if it holds a tangent, ``shift`` is its prestress τ [N].
    """
    net, x = system.at(equilibrium.step).net, equilibrium.x
    outer = sum(system.force_of(f, equilibrium.step, x) for f in system.terms if not f.balance.internal)
    if net.threads:
        from .thread_bars import ThreadBars

        with_threads = ThreadBars(net, x)
        balance = _Balance(system, with_threads, x, outer)
        return balance.bound(*balance.by_tangent(with_threads.factor(system, equilibrium)))
    balance = _Balance(system, Bars(net, x), x, outer)
    factor, bound = factor or Factor(system.pattern), None
    if factor.shift is not None:
        bound = balance.bound(*balance.by_tangent(factor))
    if bound is None or not bound.sharp:
        improved = balance.bound(*balance.by_laplacian(factor))
        equilibrium.stats["nlu"] = equilibrium.stats.get("nlu", 0) + 1
        bound = improved if bound is None or improved.gap < bound.gap else bound
    return bound


class _Balance:
    """Forces of the bars that balance the outer forces, and the bounds that they prove.

    Parameters
    ----------
    system : refweb.system.system.System
        The system of the scene.
    bars : Bars
        Its bars at the displacement x.
    x, outer : ndarray, shape (rows, 3)
        The displacement [m] and the outer forces [N].
    """

    def __init__(self, system, bars, x, outer):
        self._system, self._bars, self._outer, self._of_bars = system, bars, outer, bars.matrix
        self._resultant = -self._of_bars.T.tocsc().astype(np.longdouble)
        self._force = bars.tension[:, None] * bars.direction
        self._reach = 2.0 * np.linalg.norm(x, axis=1).max()
        self._energy = bars.energy
        per_bar = self._energy + bars.tension * bars.length * np.finfo(float).eps
        self._rounding = np.finfo(float).eps * (per_bar.sum() + np.abs(outer * x).sum())
        # Sums of forces leave at least this of them.
        self._least_gap = self._rounding + np.finfo(np.longdouble).eps * bars.tension.sum() * self._reach

    def by_laplacian(self, factor):
        """Solver and weights for bars with the same stiffness in every direction, nearly zero for slack bars."""
        system, bars, net = self._system, self._bars, self._system.net
        weight = bars.stiffness * np.where(bars.tension > 0.0, 1.0, 1e-9)
        unit = np.einsum("q,qa,qb->qab", net.weights**2, net.gradients, net.gradients)
        blocks = np.einsum("cq,qab->cab", weight.reshape(-1, len(net.weights)), unit)
        values = system.assemble_lines(np.kron(blocks, np.eye(3)))
        values[system.pattern.diagonal] += 1e-14 * bars.stiffness.max()
        factor.update(values)
        return factor.solve, lambda change: weight[:, None] * change

    def by_tangent(self, factor):
        """Solver and weights for the present tangent, with the factorization of it or of a similar one."""
        system, bars = self._system, self._bars
        across = bars.tension / np.where(bars.length > 0.0, bars.length, 1.0)
        along = np.where(bars.tension > 0.0, bars.tangent - across, 0.0)[:, None] * bars.direction
        across = (across + factor.shift / bars.natural)[:, None]
        down = self._of_bars.T.tocsr()

        def weigh(change):
            stretch = (change * bars.direction).sum(axis=1)
            return across * change + along * stretch[:, None] + bars.shared(stretch)

        def times(p):
            return (down @ weigh(self._of_bars @ system.rows_of(p))).ravel()[system.free]

        def solve(b):
            return conjugate_gradients.solve(times, factor.precondition, b, CLOSE, MOST).y

        return solve, weigh

    def bound(self, solve, weigh):
        """The `DualityBound` by a correction of the computed forces.

        ``solve`` finds a displacement from the unbalanced force; ``weigh`` turns the changes of the bars' vectors into
        a correction of forces. Both may be approximate: the remaining unbalanced force enters the gap.
        """
        bars = self._bars
        correction, unbalanced = np.zeros(self._force.shape, dtype=np.longdouble), self._unbalanced(self._force)
        for _ in range(ROUNDS):
            p = solve(unbalanced.ravel()[self._system.free].astype(float))
            if p is None:
                break
            correction += weigh(self._of_bars @ self._system.rows_of(p))
            unbalanced = self._unbalanced(self._force + correction)
            if np.abs(unbalanced).sum() * self._reach <= self._least_gap:
                break
        force = self._force + correction
        size = np.sqrt((force**2).sum(axis=1))
        rounding = self._rounding + np.abs(unbalanced).sum() * self._reach
        gap = float(_gaps(bars, force, size).sum() + rounding)
        tension = np.sqrt(2.0 * bars.stiffness * gap)
        strain, energy_of_curved = tension / (bars.stiffness * bars.natural), 0.0
        if len(bars.curved):
            strain[bars.curved], energy_of_curved = _of_curved(bars, tension[bars.curved])
        straight = float(np.delete(self._energy, bars.curved).sum())
        count = len(self._system.net.cells) * len(self._system.net.weights)
        threads = tension[count:][bars.first]
        strain_energy = 2.0 * np.sqrt(straight * gap) + gap + energy_of_curved
        tension, strain = (
            value[:count].reshape(-1, len(self._system.net.weights)).max(axis=1) for value in (tension, strain)
        )
        return DualityBound(gap, tension, strain, strain_energy, bool(gap <= SHARP * self._least_gap), threads)

    def _unbalanced(self, force):
        """Outer forces that the forces of the bars do not balance, shape (rows, 3)."""
        rest = self._outer + self._resultant @ force
        rest[self._system.supported] = 0.0
        return rest


def _gaps(bars, force, size):
    """Part of each bar in the gap [J], for forces of that ``size``."""
    along = (force * bars.direction).sum(axis=1)
    across = force - along[:, None] * bars.direction
    turned = (across**2).sum(axis=1) / np.where(size + along > 0, size + along, 1.0)
    turned = np.where(along > 0, turned, size - along) * bars.length
    slack = np.where(bars.tension > 0.0, 0.0, bars.unstressed - bars.length)
    apart = (bars.tension - size) ** 2 / (2 * bars.stiffness)
    stretched = apart + size * np.maximum(slack, 0.0)
    if len(curved := bars.curved):
        strain = bars.strain_of(size[curved].astype(float))
        far = np.abs(strain - bars.strain) + 4.0 * np.finfo(float).eps * (1.0 + strain)
        stretched[curved] = np.abs(bars.tension - size)[curved] * bars.natural[curved] * far - apart[curved]
    return bars.stretched(stretched, size) + turned


def _of_curved(bars, error):
    """Bounds on the errors of strains [1] of bars with a curved law, and of their energy [J], by those of tension."""
    if not np.isfinite(error).all():
        return np.full(len(error), np.inf), np.inf
    tension = bars.tension[bars.curved]
    ends = [bars.strain_of(np.maximum(tension + change, 0.0)) for change in (-error, error)]
    strain = np.maximum(*(np.abs(end - bars.strain) for end in ends))
    energies = [bars.evaluated("energy_density", end) for end in (bars.strain, *ends)]
    energy = np.maximum(energies[0] - energies[1], energies[2] - energies[0])
    return strain, float((bars.natural[bars.curved] * np.maximum(energy, 0.0)).sum())
