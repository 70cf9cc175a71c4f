"""A bound on the error of a static solution, from convex duality.

For the tension-only law the potential Π(x) = Σ ½ k (l − L)₊² − f·x, k = EA/L, is convex in the positions. Element
forces s, vectors that balance the loads at every free node, give the dual value D(s) ≤ min Π. The gap is a sum over
lines of terms that are never negative,

    Π − D = Σ ½ k (l − L)₊² + |s|²/2k + L|s| − s·d,      d the line's vector, l = |d|,

evaluated here without cancellation: with T = k (l − L)₊, (T − |s|)²/2k on taut lines, |s|²/2k + |s|(L − l) on slack
ones, plus (|s| l − s·d) for the direction. The stress energy of the element forces is quadratic and its gradient
Lipschitz with k, so Σ |T t − s*|²/2k ≤ Π − Π* ≤ gap, which bounds every tension: |T − T*| ≤ √(2 k gap).

Of curved elements every quadrature point is such a line, a bar of natural length w L whose vector is w dx/dξ.

The balancing correction of the computed forces runs over taut lines first. It is kept in extended precision, where the
platform has it, since what it leaves unbalanced enters the gap multiplied by a displacement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..effects.elasticity import strains
from ..net.net import AXIAL_STIFFNESS
from ..system.factorization import Factor


@dataclass(frozen=True, eq=False)
class DualityBound:
    """Bounds on a static solution.

    Attributes
    ----------
    gap : float
        Π(x) − D(s), with its rounding [J]; the exact potential lies within [Π − gap, Π].
    tension : ndarray, shape (cells,)
        Bound on the error of each element's tension [N].
    strain_energy : float
        Bound on the error of the strain energy [J].
    """

    gap: float
    tension: np.ndarray
    strain_energy: float


def duality_bound(system, equilibrium, factor=None):
    """The `DualityBound` of an equilibrium.

    Parameters
    ----------
    system : refweb.system.system.System
        One that is ``convex``.
    equilibrium : refweb.statics.equilibrium.Equilibrium
        Its state.
    factor : refweb.system.factorization.Factor, optional
        Used again where there is one.
    """
    net, x = system.at(equilibrium.step).net, equilibrium.x
    bars = _Bars(net, x)
    outer = sum(system.force_of(f, equilibrium.step, x) for f in system.families if not f.internal)
    force, unbalanced = _balanced(system, bars, outer, factor or Factor(system.pattern))

    size = np.sqrt((force**2).sum(axis=1))
    reach = 2.0 * np.linalg.norm(x, axis=1).max()
    own = 0.5 * bars.tension**2 / bars.stiffness + size * bars.length * np.finfo(float).eps
    rounding = np.finfo(float).eps * (own.sum() + np.abs(outer * x).sum()) + np.abs(unbalanced).sum() * reach
    gap = float(_gaps(bars, force, size).sum() + rounding)
    strain_energy = float(0.5 * (bars.tension**2 / bars.stiffness).sum())
    tension = np.sqrt(2.0 * bars.stiffness * gap).reshape(-1, len(net.weights)).max(axis=1)
    return DualityBound(gap, tension, 2.0 * np.sqrt(strain_energy * gap) + gap)


class _Bars:
    """What the bars of a net are at a displacement: arrays over them."""

    def __init__(self, net, x):
        axial = net.per_bar(AXIAL_STIFFNESS)
        self.natural = net.bar_lengths
        self.stiffness = axial / self.natural
        vector = net.bar_vectors(x)
        self.length = np.linalg.norm(vector, axis=1)
        self.tension = axial * np.maximum(strains(net, x).ravel(), 0.0)
        self.direction = vector / np.where(self.length > 0, self.length, 1.0)[:, None]


def _balanced(system, bars, outer, factor):
    """Forces of the bars [N] that balance the outer ones, shape (bars, 3), and what they leave, shape (rows, 3)."""
    net, of_bars = system.net, system.net.bars
    weight = bars.stiffness * np.where(bars.tension > 0.0, 1.0, 1e-9)
    unit = np.einsum("q,qa,qb->qab", net.weights**2, net.gradients, net.gradients)
    blocks = np.einsum("cq,qab->cab", weight.reshape(-1, len(net.weights)), unit)
    values = system.assemble_lines(np.kron(blocks, np.eye(3)))
    values[system.pattern.diagonal] += 1e-14 * bars.stiffness.max()
    factor.update(values)
    resultant = -of_bars.T.tocsc().astype(np.longdouble)

    def unbalanced(force):
        rest = outer + resultant @ force
        rest[system.supported] = 0.0
        return rest

    force = (bars.tension[:, None] * bars.direction).astype(np.longdouble)
    correction = np.zeros_like(force)
    for _ in range(3):
        p = factor.solve(unbalanced(force + correction).ravel()[system.free].astype(float))
        if p is None:  # what stays unbalanced enters the gap
            break
        y = np.zeros((system.rows, 3))
        y.ravel()[system.free] = p
        correction += weight[:, None] * (of_bars @ y)
    force = force + correction
    return force, unbalanced(force)


def _gaps(bars, force, size):
    """What each bar adds to the gap [J], for forces of that ``size``."""
    along = (force * bars.direction).sum(axis=1)
    across = force - along[:, None] * bars.direction
    turned = (across**2).sum(axis=1) / np.where(size + along > 0, size + along, 1.0)
    turned = np.where(along > 0, turned, size - along) * bars.length
    slack = np.where(bars.tension > 0.0, 0.0, bars.natural - bars.length)
    return (bars.tension - size) ** 2 / (2 * bars.stiffness) + size * np.maximum(slack, 0.0) + turned
