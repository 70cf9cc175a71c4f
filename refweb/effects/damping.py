"""Damping of the lines: Kelvin–Voigt on the tangent of their law, and a drag in proportion to mass; and that of bodies.

At the rate of strain ε̇ = t·v'/L − (1 + ε) L'/L, v' = dv/dξ and L' = dL/dt, a line has the stress

    max(σ + τ σ'(ε) ε̇, −αE),        −αE the floor of its law,

so that a slack line is not damped, and no line pushes more than by its law. Damping adds the part N to A σ. With p =
dx/dξ, l = |p| and t = p/l, a quadrature point has

    force on node a        −w N dN_a/dξ t
    damping of (a, b)       w dN_a/dξ dN_b/dξ (∂N/∂ε̇)/L t⊗t
    stiffness of (a, b)     w dN_a/dξ dN_b/dξ [(∂N/∂ε)/L t⊗t + (N/l)(I − t⊗t) + (∂N/∂ε̇)/(L l) t⊗(v' − (t·v') t)]

and the power −w L N ε̇ ≤ 0. Where L changes, by reels and heat, ∂N/∂ε has −(∂N/∂ε̇) L'/L as well, and what changes it
does the work −(1 + ε) N L' w. The force of a line without smoothing jumps when it snaps taut, and central differences
are of order 1 across this jump.

May change: how the kernels are written; force, stiffness and damping change together. Must stay: keys and docstring of
`Damping` (scene format and help; after a change write ``validation/REFERENCE.md`` anew); the column `GROWTH` directly
behind ``damping_time``, where kernels read it and `natural_lengths` writes it; columns of `LINE_OUT`. Tests:
``tests/test_contract.py``, ``tests/effects/test_damping.py``.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np

from ..compiled.rows import record_at
from ..errors import InputError
from ..kernels import BOUND, FORCE, IMPULSE, STIFFNESS, kernel
from ..tables import Table, real, table
from .base import (
    LENGTH_POWER,
    LINE_OUT,
    POWER,
    Balance,
    CellElements,
    ForceTerm,
    Tangent,
    Timing,
    VelocityForce,
    column,
    no_force,
    refuse_flows,
)
from .line_kernels import gradient, line_at, pull_together, strain
from .natural_lengths import GROWTH

if TYPE_CHECKING:
    from ..net.net import Net


@functools.cache
def kernels(law, record, tau, changing, gradients, weights):
    """Force, stiffness, damping and damping bound of one law and reference element.

    Parameters
    ----------
    law, record, gradients, weights
        As of `refweb.effects.elasticity.kernels`.
    tau : int
        Column of τ in the numbers of the lines; that behind it has L'/L.
    changing : bool
        True if natural lengths change.
    """
    stress, tangent, curvature, above_floor = law.stress, law.tangent, law.curvature, law.above_floor
    points, nodes = len(gradients), len(gradients[0])
    flat = tuple(value for row in gradients for value in row)

    @kernel()
    def viscous(e, rate, time, line):
        """The damping force N [N]."""
        return max(time * rate * tangent(e, line), -above_floor(e, line))

    @kernel()
    def slopes(e, rate, time, line):
        """(∂N/∂ε [N], ∂N/∂ε̇ [N s])."""
        slope = tangent(e, line)
        if time * rate * slope < -above_floor(e, line):
            return -slope, 0.0
        return time * rate * curvature(e, line), time * slope

    @kernel(forceinline=True)
    def growth(data, c):
        """L'/L of cell c."""
        return data[c, tau + 1] if changing else 0.0

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            largest = power = reeled = 0.0
            line = record_at(record, data, c, 0)
            for q in range(points):
                p0, p1, p2, inverse, e = strain(x, cells, data, c, q, nodes, flat)
                v0, v1, v2 = gradient(v, cells, c, q, nodes, flat)
                longer = (1.0 + e) * growth(data, c)
                rate = (p0 * v0 + p1 * v1 + p2 * v2) * inverse / line.natural_length - longer
                pull = viscous(e, rate, data[c, tau], line)
                tension = pull + stress(e, line)
                if q == 0 or tension > largest:
                    largest = tension
                power -= weights[q] * line.natural_length * pull * rate
                reeled -= weights[q] * line.natural_length * pull * longer
                pull_together(f, cells, c, q, nodes, flat, weights[q] * pull * inverse, p0, p1, p2)
            shows = record_at(LINE_OUT, out, c, 0)
            shows.damped_tension, shows.power = largest, power
            if changing:
                shows.length_power = reeled

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        blocks[:] = 0.0
        if definite:  # nothing of it is
            return
        for c in range(cells.shape[0]):
            line, time = record_at(record, data, c, 0), data[c, tau]
            for q in range(points):
                p0, p1, p2, inverse, e = strain(x, cells, data, c, q, nodes, flat)
                w = gradient(v, cells, c, q, nodes, flat)
                p, speed = (p0 * inverse, p1 * inverse, p2 * inverse), (p0 * w[0] + p1 * w[1] + p2 * w[2]) * inverse
                share = weights[q] / line.natural_length
                rate = speed / line.natural_length - (1.0 + e) * growth(data, c)
                by_strain, by_rate = slopes(e, rate, time, line)
                across = weights[q] * viscous(e, rate, time, line) * inverse
                along = share * (by_strain - by_rate * growth(data, c)) - across
                turn = share * by_rate * inverse
                for i in range(3):
                    for j in range(3):
                        value = p[i] * (along * p[j] + turn * (w[j] - speed * p[j]))
                        if i == j:
                            value += across
                        for a in range(nodes):
                            for b in range(nodes):
                                blocks[c, 3 * a + i, 3 * b + j] += flat[q * nodes + a] * flat[q * nodes + b] * value

    @kernel(STIFFNESS)
    def damping(t, x, v, blocks, cells, data, definite):
        blocks[:] = 0.0
        for c in range(cells.shape[0]):
            line, time = record_at(record, data, c, 0), data[c, tau]
            for q in range(points):
                p0, p1, p2, inverse, e = strain(x, cells, data, c, q, nodes, flat)
                w = gradient(v, cells, c, q, nodes, flat)
                p = (p0 * inverse, p1 * inverse, p2 * inverse)
                rate = (p[0] * w[0] + p[1] * w[1] + p[2] * w[2]) / line.natural_length - (1.0 + e) * growth(data, c)
                along = weights[q] / line.natural_length * slopes(e, rate, time, line)[1]
                for a in range(nodes):
                    for b in range(nodes):
                        d = along * flat[q * nodes + a] * flat[q * nodes + b]
                        for i in range(3):
                            for j in range(3):
                                blocks[c, 3 * a + i, 3 * b + j] += d * p[i] * p[j]

    @kernel(BOUND)
    def damping_bound(reach, speed, x, mass, rates, cells, data):
        # The stiffness has no bound of its own: in a step that this bound allows it is below that of the law unless
        # nodes move faster than sound, but at the kink of a smoothed law, which such a step passes at once.
        for c in range(cells.shape[0]):
            line = line_at(data, c)
            coefficient = data[c, tau] * line.ea / line.natural_length
            for q in range(points):
                total = 0.0
                for a in range(nodes):
                    total += abs(flat[q * nodes + a])
                for a in range(nodes):
                    rates[np.uint64(cells[c, a])] += weights[q] * abs(flat[q * nodes + a]) * total * coefficient

    return force, stiffness, damping, damping_bound


@kernel(FORCE)
def drag(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        row = cells[c, 0]
        out[c, 0] = -data[c, 0] * (v[row, 0] ** 2 + v[row, 1] ** 2 + v[row, 2] ** 2)
        for k in range(3):
            f[row, k] -= data[c, 0] * v[row, k]


@kernel(IMPULSE)
def drag_impulse(t, x, cells, data, total):
    for c in range(cells.shape[0]):
        for k in range(3):
            total[k] -= data[c, 0] * x[cells[c, 0], k]


@kernel(STIFFNESS)
def drag_damping(t, x, v, blocks, cells, data, definite):
    blocks[:] = 0.0
    for c in range(cells.shape[0]):
        for k in range(3):
            blocks[c, k, k] = data[c, 0]


@kernel(BOUND)
def drag_bound(reach, speed, x, mass, rates, cells, data):
    for c in range(cells.shape[0]):
        rates[cells[c, 0]] += data[c, 0]


@table
class Damping(Table):
    """Damping of the web and of free bodies; statics does not feel it.

    Parameters
    ----------
    time : float
        τ of the material [s], ≥ 0; an axial vibration of taut lines, of period T, has the damping ratio πτ/T. The force
        is proportional to the rate of strain of the material, (d/dt)(l/L) of length l and natural length L: a line that
        is paid out at the velocity at which its ends separate is not damped, and one that is reeled in between fixed
        ends is.
    rate : float
        Rate at which velocities fade [1/s], ≥ 0: a force −rate m v on every node, m its lumped mass, with consistent
        mass as well. Bodies are not damped by it.
    bodies : float
        Rate at which the momentum of every free body and its angular momentum about its centre fade [1/s], ≥ 0: a force
        −bodies m v and a moment −bodies L. Nodes that a body carries fade with it.

    Raises
    ------
    InputError
        For a time or a rate that is not finite or < 0, where all are 0, and for ``bodies`` where none is free.

    References
    ----------
    The material is that of Kelvin and Voigt, with the tangent of the law and without a push: W. Thomson, "On the
    elasticity and viscosity of metals", Proc. R. Soc. Lond. 14 (1865) 289–297; W. Voigt, "Ueber innere Reibung fester
    Körper, insbesondere der Metalle", Ann. Phys. 283 (1892) 671–693.

    Examples
    --------
        [damping]
        time = 1e-5
        rate = 0.1
        bodies = 0.5
    """

    time: float = real(default=0.0, at_least=0, unit="s")
    rate: float = real(default=0.0, at_least=0, unit="1/s")
    bodies: float = real(default=0.0, at_least=0, unit="1/s")

    def check(self) -> None:
        """Refuse a damping that damps nothing."""
        if not (self.time or self.rate or self.bodies):
            raise InputError(
                "time = 0 [s], rate = 0 [1/s] and bodies = 0 [1/s]: one of them must be > 0, or leave the table out"
            )

    def extend(self, net: Net) -> Net:
        """The net with τ in one more column of line data, and room for L'/L behind it."""
        return net.with_column("damping_time", self.time).with_column(GROWTH, 0.0) if self.time else net

    def on(self, net: Net) -> list[ForceTerm]:
        """The terms of all lines, whose tension is that with damping, of all nodes with mass, and of free bodies."""
        terms, free = [], [body.row for body in net.bodies if not body.prescribed]
        if self.bodies and not free:
            raise InputError(f"bodies = {self.bodies:g} [1/s]: the scene has no free [[body]], leave it out")
        if self.time and net.rows_of_elements:
            from .viscous import refuse_beside

            refuse_beside(net, f"time = {self.time:g} [s]")
        if self.time:
            at, changing = net.line_data.column("damping_time"), len(net.factors) > 0
            force, stiffness, damping, bound = kernels(net.law, net.law_record, at, changing, *net.quadrature)
            terms.append(
                ForceTerm(
                    name="damping",
                    cells=net.cells,
                    data=None,
                    force=force,
                    tangent=Tangent(stiffness, symmetric=False),
                    velocity=VelocityForce(damping, bound, jumps=True),
                    balance=Balance("dissipated_energy", POWER, internal=True),
                    timing=Timing(at_rest=False),
                    elements=CellElements(adds_tension=True),
                )
            )
            if changing:
                work = Balance("work", LENGTH_POWER, internal=True)
                cells, apart = net.cells, Timing(at_rest=False)
                terms.append(
                    ForceTerm(name="damping", cells=cells, data=None, force=no_force, balance=work, timing=apart)
                )
        if self.rate:
            refuse_flows(net, f"rate = {self.rate:g}")
        if self.rate or self.bodies:
            nodes = net.heavy[net.heavy < net.nodes] if self.rate else np.zeros(0, dtype=int)
            rows = np.concatenate([nodes, free if self.bodies else []]).astype(int)
            rates = np.repeat([self.rate, self.bodies], [len(nodes), len(rows) - len(nodes)])
            terms.append(
                ForceTerm(
                    name="damping",
                    cells=column(rows),
                    data=(rates * net.mass[rows])[:, None],
                    force=drag,
                    velocity=VelocityForce(drag_damping, drag_bound),
                    balance=Balance("dissipated_energy", 0, impulse=drag_impulse),
                    timing=Timing(at_rest=False),
                )
            )
        if self.bodies and net.spins:
            from .body_damping import rotation_terms

            terms += rotation_terms(net, self.bodies, drag, drag_damping, drag_bound)
        return terms
