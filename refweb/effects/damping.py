"""Damping of the lines: Kelvin–Voigt on the tangent of their law, and a drag in proportion to mass.

A line that is strained at the rate ε̇ = t·v'/L, v' = dv/dξ, has the stress

    max(σ + τ σ'(ε) ε̇, −αE),        −αE the floor of its law,

so that a slack line is not damped, and none pushes more than its law does. The part N beside A σ is what is added here:
with p = dx/dξ, l = |p| and t = p/l a quadrature point has

    force on node a        −w N dN_a/dξ t
    damping of (a, b)       w dN_a/dξ dN_b/dξ (∂N/∂ε̇)/L t⊗t
    stiffness of (a, b)     w dN_a/dξ dN_b/dξ [(∂N/∂ε)/L t⊗t + (N/l)(I − t⊗t) + (∂N/∂ε̇)/(L l) t⊗(v' − (t·v') t)]

and the power −w L N ε̇ ≤ 0. Where a line of a law without smoothing snaps taut, its force jumps.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np

from ..compiled import BOUND, FORCE, STIFFNESS, kernel
from ..inputs import InputError, Table, real
from ..laws import above_floor, curvature, prepared_stress, tangent
from ..lines import AXIAL_STIFFNESS, G0, LENGTH, R0, REFERENCE, SLACKNESS, SMOOTHING, strain
from . import Family, column

TIME = REFERENCE + 4
"""Column of τ in the numbers of the lines."""


@kernel()
def stretching(x, v, cells, data, c, q, nodes, gradients):
    """(dx/dξ, 1/|dx/dξ| or 0, ε, dv/dξ, ε̇) at quadrature point q of cell c."""
    p0, p1, p2, inverse, e = strain(x, cells, data, c, q, nodes, gradients)
    v0 = v1 = v2 = 0.0
    for a in range(nodes):
        row, d = np.uint64(cells[c, a]), gradients[q * nodes + a]
        v0 += d * v[row, 0]
        v1 += d * v[row, 1]
        v2 += d * v[row, 2]
    rate = (p0 * v0 + p1 * v1 + p2 * v2) * inverse / data[c, LENGTH]
    return (p0, p1, p2), inverse, e, (v0, v1, v2), rate


@kernel()
def viscous(law, e, rate, data, c):
    """(N, ∂N/∂ε, ∂N/∂ε̇) of cell c [N, N, N s]."""
    axial, slack, smooth, time = data[c, AXIAL_STIFFNESS], data[c, SLACKNESS], data[c, SMOOTHING], data[c, TIME]
    slope = tangent(law, e, axial, slack, smooth)
    pull, least = time * slope * rate, -above_floor(law, e, axial, slack, smooth)
    if pull < least:
        return least, -slope, 0.0
    return pull, time * rate * curvature(law, e, axial, slack, smooth), time * slope


@functools.cache
def kernels(law, gradients, weights):
    """Force, stiffness, damping and damping bound of one law and reference element.

    Parameters
    ----------
    law : int
        Number of the law.
    gradients : tuple of tuple of float
        dN/dξ by quadrature point and node.
    weights : tuple of float
        Quadrature weights.
    """
    points, nodes = len(gradients), len(gradients[0])
    flat = tuple(value for row in gradients for value in row)

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            largest = power = 0.0
            for q in range(points):
                p, inverse, e, _, rate = stretching(x, v, cells, data, c, q, nodes, flat)
                pull, _, _ = viscous(law, e, rate, data, c)
                axial, slack, smooth = data[c, AXIAL_STIFFNESS], data[c, SLACKNESS], data[c, SMOOTHING]
                tension = pull + prepared_stress(law, e, axial, slack, smooth, data[c, G0], data[c, R0])
                if q == 0 or tension > largest:
                    largest = tension
                power -= weights[q] * data[c, LENGTH] * pull * rate
                s = weights[q] * pull * inverse
                for a in range(nodes):
                    row, d = np.uint64(cells[c, a]), s * flat[q * nodes + a]
                    f[row, 0] -= d * p[0]
                    f[row, 1] -= d * p[1]
                    f[row, 2] -= d * p[2]
            out[c, 0] = largest
            out[c, 2] = power

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        blocks[:] = 0.0
        if definite:
            return
        for c in range(cells.shape[0]):
            for q in range(points):
                p, inverse, e, w, rate = stretching(x, v, cells, data, c, q, nodes, flat)
                pull, by_strain, by_rate = viscous(law, e, rate, data, c)
                natural, across = data[c, LENGTH], weights[q] * pull * inverse
                along, turn = weights[q] * by_strain / natural, weights[q] * by_rate * inverse / natural
                speed = rate * natural
                for i in range(3):
                    for j in range(3):
                        ti, tj = p[i] * inverse, p[j] * inverse
                        value = (along - across) * ti * tj + turn * ti * (w[j] - speed * tj)
                        if i == j:
                            value += across
                        for a in range(nodes):
                            for b in range(nodes):
                                d = flat[q * nodes + a] * flat[q * nodes + b]
                                blocks[c, 3 * a + i, 3 * b + j] += d * value

    @kernel(STIFFNESS)
    def damping(t, x, v, blocks, cells, data, definite):
        blocks[:] = 0.0
        for c in range(cells.shape[0]):
            for q in range(points):
                p, inverse, e, _, rate = stretching(x, v, cells, data, c, q, nodes, flat)
                along = weights[q] * viscous(law, e, rate, data, c)[2] / data[c, LENGTH] * inverse * inverse
                for a in range(nodes):
                    for b in range(nodes):
                        d = along * flat[q * nodes + a] * flat[q * nodes + b]
                        for i in range(3):
                            for j in range(3):
                                blocks[c, 3 * a + i, 3 * b + j] += d * p[i] * p[j]

    @kernel(BOUND)
    def damping_bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            most = data[c, TIME] * data[c, AXIAL_STIFFNESS] / data[c, LENGTH]
            for q in range(points):
                total = 0.0
                for a in range(nodes):
                    total += abs(flat[q * nodes + a])
                for a in range(nodes):
                    rates[np.uint64(cells[c, a])] += weights[q] * abs(flat[q * nodes + a]) * total * most

    return force, stiffness, damping, damping_bound


@kernel(FORCE)
def drag(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        row = cells[c, 0]
        out[c, 0] = -data[c, 0] * (v[row, 0] ** 2 + v[row, 1] ** 2 + v[row, 2] ** 2)
        for k in range(3):
            f[row, k] -= data[c, 0] * v[row, k]


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


@dataclass(frozen=True, kw_only=True)
class Damping(Table):
    """Damping of the web; bodies are not damped, and statics does not feel it.

    Parameters
    ----------
    time : float
        τ of the material [s], ≥ 0; a vibration of taut lines along themselves, of period T, has the damping ratio πτ/T.
    rate : float
        Rate at which velocities fade [1/s], ≥ 0: a force −rate m v on every node, m its lumped mass, with consistent
        mass as well.
    """

    time: float = real(0.0, at_least=0, unit="s")
    rate: float = real(0.0, at_least=0, unit="1/s")

    def check(self):
        """Refuse a damping that damps nothing."""
        if not (self.time or self.rate):
            raise InputError("time = 0 [s] and rate = 0 [1/s]: one of them must be > 0, or leave the table out")

    def extend(self, net):
        """The net with τ in one more column of the numbers of its lines."""
        if not self.time:
            return net
        time = np.full((len(net.cells), 1), self.time)
        return replace(net, line_data=np.ascontiguousarray(np.hstack([net.line_data, time])))

    def on(self, net):
        """The families of all lines, whose tension is that with damping, and of all nodes with mass."""
        families = []
        if self.time:
            element = tuple(map(tuple, net.gradients.tolist())), tuple(net.weights.tolist())
            force, stiffness, damping, bound = kernels(net.law.number, *element)
            families.append(
                Family(
                    name="damping",
                    cells=net.cells,
                    data=net.line_data,
                    force=force,
                    energy=None,
                    stiffness=stiffness,
                    bound=None,
                    book="dissipated_energy",
                    observed=3,
                    power=2,
                    shared=True,
                    damping=damping,
                    damping_bound=bound,
                    internal=True,
                    symmetric=False,
                    at_rest=False,
                )
            )
        if self.rate:
            nodes = net.heavy[net.heavy < net.nodes]
            families.append(
                Family(
                    name="damping",
                    cells=column(nodes),
                    data=self.rate * net.mass[nodes, None],
                    force=drag,
                    energy=None,
                    stiffness=None,
                    bound=None,
                    book="dissipated_energy",
                    observed=1,
                    power=0,
                    damping=drag_damping,
                    damping_bound=drag_bound,
                    at_rest=False,
                )
            )
        return families
