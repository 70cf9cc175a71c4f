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
class Certificate:
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


def certify(system, equilibrium, factor=None):
    """The `Certificate` of an equilibrium of a system that is ``convex``; ``factor``, if given, is used again."""
    net, x, bars = system.net, equilibrium.x, system.net.bars
    system.prepare(equilibrium.step)
    points = len(net.weights)
    weights = np.tile(net.weights, len(net.cells))
    axial = np.repeat(net.line_data[:, AXIAL_STIFFNESS], points)
    natural = weights * np.repeat(net.natural_length, points)
    stiffness = axial / natural
    vector = bars @ net.points + bars @ x
    length = np.linalg.norm(vector, axis=1)
    tension = axial * np.maximum(strains(net, x).ravel(), 0.0)
    direction = vector / np.where(length > 0, length, 1.0)[:, None]
    outer = sum(system.force_of(f, equilibrium.step, x) for f in system.families if not f.internal)

    weight = stiffness * np.where(tension > 0.0, 1.0, 1e-9)
    unit = np.einsum("q,qa,qb->qab", net.weights**2, net.gradients, net.gradients)
    blocks = np.einsum("cq,qab->cab", weight.reshape(-1, points), unit)
    values = system.assemble_lines(np.kron(blocks, np.eye(3)))
    values[system.pattern.diagonal] += 1e-14 * stiffness.max()
    factor = factor or Factor(system.pattern)
    factor.update(values)
    resultant = -bars.T.tocsc().astype(np.longdouble)

    force = (tension[:, None] * direction).astype(np.longdouble)
    correction = np.zeros_like(force)
    for _ in range(3):
        unbalanced = outer + resultant @ (force + correction)
        unbalanced[system.supported] = 0.0
        y = np.zeros((system.rows, 3))
        p = factor.solve(unbalanced.ravel()[system.free].astype(float))
        if p is None:  # what stays unbalanced enters the gap
            break
        y.ravel()[system.free] = p
        correction += weight[:, None] * (bars @ y)
    unbalanced = outer + resultant @ (force + correction)
    unbalanced[system.supported] = 0.0
    balanced = force + correction

    size = np.sqrt((balanced**2).sum(axis=1))
    across = balanced - (balanced * direction).sum(axis=1)[:, None] * direction
    along = (balanced * direction).sum(axis=1)
    turned = (across**2).sum(axis=1) / np.where(size + along > 0, size + along, 1.0)
    turned = np.where(along > 0, turned, size - along) * length
    slack = np.where(tension > 0.0, 0.0, natural - length)
    terms = (tension - size) ** 2 / (2 * stiffness) + size * np.maximum(slack, 0.0) + turned

    reach = 2.0 * np.linalg.norm(x, axis=1).max()
    own = 0.5 * tension**2 / stiffness + size * length * np.finfo(float).eps
    rounding = np.finfo(float).eps * (own.sum() + np.abs(outer * x).sum()) + np.abs(unbalanced).sum() * reach
    gap = float(terms.sum() + rounding)
    strain_energy = float(0.5 * (tension**2 / stiffness).sum())
    bound = np.sqrt(2.0 * stiffness * gap).reshape(-1, points).max(axis=1)
    return Certificate(gap, bound, 2.0 * np.sqrt(strain_energy * gap) + gap)
