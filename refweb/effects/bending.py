"""Bending stiffness: torsion springs between elements that continue each other.

Let a and b be the vectors of two elements that follow each other, n = a × b, and θ = atan2(|n|, a·b) the angle between
them. A spring has the energy ½ k θ² with k = B/L̄ and the mean L̄ of both natural lengths: this is the curvature θ/L̄
over the length L̄. With its moment m = k (θ/|n|) n the forces are

    f_i = −m × a/|a|²,        f_k = −m × b/|b|²,        f_j = −f_i − f_k

on the first, last and middle node. If a line is folded back onto itself, θ = π, the energy is finite; the direction of
the force is then arbitrary by rounding, or the force is zero.

This is the bending of the multi-particle model, whose states of rest are straight. n is evaluated from displacements,
so that tiny deflections keep their digits.

A clamp is a spring at the end of a line: a is a constant vector in the direction of the element, whose half bends, so
that k = 2 B/L. A cantilever of n such elements has springs B n inside and 2 B n at the clamp, and under a load P at its
tip it bends by P L³/(3 B) (1 + 1/(2 n²)).

May change: private functions, formulas of the kernels, if force, stiffness and bound still belong to the one energy;
`ROUNDING`. Must stay: keys and docstring of `Bending` (scene format and help; after a change write
``validation/REFERENCE.md`` anew); kernel signatures; k as the first number of a cell, which `without` sets to 0 at a
break; the column name "bending_energy". `LARGEST` and `FAR` change results. Tests: ``tests/test_contract.py``,
``tests/effects/test_bending.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..kernels import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from ..tables import Several, Table, nodes, real, table
from .base import Balance, CellElements, ForceTerm, Tangent, without
from .vectors import cross, dot

if TYPE_CHECKING:
    from ..net.net import Net

LARGEST = math.radians(30.0)
"""Largest angle between elements that continue each other in the initial web."""
ROUNDING = 1e-9
"""Angles that differ by less are the same [rad]."""
FAR = 2.0**20
"""Length of the constant vector of a clamp over that of its element: so long that the moment on it adds to no bound."""


@kernel()
def hinge(x, cells, data, c):
    """(a, b, a × b, θ, θ/|a × b|) of spring c; the last is 0 where it is not defined."""
    i, j, k = cells[c, 0], cells[c, 1], cells[c, 2]
    a, b = (data[c, 1], data[c, 2], data[c, 3]), (data[c, 4], data[c, 5], data[c, 6])
    u = (x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2])
    w = (x[k, 0] - x[j, 0], x[k, 1] - x[j, 1], x[k, 2] - x[j, 2])
    now_a, now_b = (a[0] + u[0], a[1] + u[1], a[2] + u[2]), (b[0] + w[0], b[1] + w[1], b[2] + w[2])
    n, o, p = cross(a, b), cross(a, w), cross(u, now_b)
    n = (n[0] + o[0] + p[0], n[1] + o[1] + p[1], n[2] + o[2] + p[2])
    sine, cosine = math.sqrt(dot(n, n)), dot(now_a, now_b)
    angle = math.atan2(sine, cosine)
    if sine > 0.0:
        return now_a, now_b, n, angle, angle / sine
    return now_a, now_b, n, angle, 1.0 / cosine if cosine > 0.0 else 0.0


@kernel()
def inverse_square(a):
    square = dot(a, a)
    return 1.0 / square if square > 0.0 else 0.0


@kernel(FORCE)
def force(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        a, b, n, _, ratio = hinge(x, cells, data, c)
        first, last = cross(n, a), cross(n, b)
        first_scale = data[c, 0] * ratio * inverse_square(a)
        last_scale = data[c, 0] * ratio * inverse_square(b)
        for r in range(3):
            first_pull, last_pull = first_scale * first[r], last_scale * last[r]
            f[cells[c, 0], r] -= first_pull
            f[cells[c, 1], r] += first_pull + last_pull
            f[cells[c, 2], r] -= last_pull


@kernel(ENERGY)
def energy(t, x, cells, data, out):
    for c in range(cells.shape[0]):
        angle = hinge(x, cells, data, c)[3]
        out[c] = 0.5 * data[c, 0] * angle * angle


@kernel()
def second_derivative(angle):
    """d²(½ θ²)/dw² of w = cos θ, (1 − θ cot θ)/sin² θ."""
    square = angle * angle
    if square < 1e-3:
        return 1.0 / 3.0 + square * (2.0 / 15.0 + square * (2.0 / 63.0 + square * (4.0 / 675.0)))
    return (1.0 - angle / math.tan(angle)) / math.sin(angle) ** 2


@kernel(STIFFNESS)
def stiffness(t, x, v, blocks, cells, data, definite):
    # With α = a/|a|, β = b/|b|, w = α·β, P = I − αα, Q = I − ββ, p = ∂w/∂α = β − wα, q = ∂w/∂β = α − wβ, and F(w) the
    # energy: |a|² E_aa = F'' pp − F' (pα + αp + w P) and |a||b| E_ab = F'' pq + F' PQ. The semidefinite part has P and
    # −PQ in their place, the same where the line is straight. (a, b) = `from_nodes` (i, j, k).
    from_nodes = ((-1.0, 1.0, 0.0), (0.0, -1.0, 1.0))
    for c in range(cells.shape[0]):
        blocks[c] = 0.0
        a, b, _, angle, ratio = hinge(x, cells, data, c)
        if ratio == 0.0:
            continue
        va, vb, w = math.sqrt(inverse_square(a)), math.sqrt(inverse_square(b)), math.cos(angle)
        slope, curve, tilt, straight = data[c, 0], 0.0, 0.0, 1.0
        if not definite:
            slope *= ratio / (va * vb)
            curve, tilt, straight = data[c, 0] * second_derivative(angle), slope, w
        for r in range(3):
            for s in range(3):
                ar, br, as_, bs = va * a[r], vb * b[r], va * a[s], vb * b[s]
                pr, qr, ps, qs = br - w * ar, ar - w * br, bs - w * as_, as_ - w * bs
                identity = 1.0 if r == s else 0.0
                aa = (
                    va * va * (curve * pr * ps + tilt * (pr * as_ + ar * ps) + slope * straight * (identity - ar * as_))
                )
                bb = vb * vb * (curve * qr * qs + tilt * (qr * bs + br * qs) + slope * straight * (identity - br * bs))
                ab = va * vb * (curve * pr * qs - slope * (identity - br * bs - ar * qs))
                for m in range(3):
                    for n in range(3):
                        am, bm, an, bn = from_nodes[0][m], from_nodes[1][m], from_nodes[0][n], from_nodes[1][n]
                        blocks[c, 3 * m + r, 3 * n + s] += am * an * aa + bm * bn * bb + am * bn * ab
                        blocks[c, 3 * n + s, 3 * m + r] += am * bn * ab


@kernel(BOUND)
def bound(reach, speed, x, mass, rates, cells, data):
    # Of a straight line the rows of k gg, g = (1/|a|, 1/|a| + 1/|b|, 1/|b|); turning adds at most k θ/|a|² along and
    # across a, and takes away out of the plane.
    for c in range(cells.shape[0]):
        a, b, _, angle, _ = hinge(x, cells, data, c)
        va, vb = math.sqrt(inverse_square(a)), math.sqrt(inverse_square(b))
        first, last = va * (va + vb + angle * va), vb * (va + vb + angle * vb)
        rates[cells[c, 0]] += 2.0 * data[c, 0] * first
        rates[cells[c, 1]] += 2.0 * data[c, 0] * (first + last)
        rates[cells[c, 2]] += 2.0 * data[c, 0] * last


def springs(net):
    """Springs between elements that continue each other: each end is joined to the end, or ends, of least angle.

    Returns
    -------
    rows : ndarray of int, shape (springs, 3)
        First, middle and last node.
    elements : ndarray of int, shape (springs, 2)
        The two elements.
    """
    node, neighbours = net.cells.ravel(), net.cells[:, ::-1].ravel()
    order = np.argsort(node, kind="stable")
    node, neighbours, element = node[order], neighbours[order], order // 2
    outward = net.points[neighbours] - net.points[node]
    apart = range(1, max(np.bincount(node).max(), 2))
    first, second = np.hstack([np.flatnonzero(node[n:] == node[:-n]) + [[0], [n]] for n in apart])
    a, b = -outward[first], outward[second]
    turn = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))
    nearest = np.full(len(node), LARGEST)
    np.minimum.at(nearest, first, turn)
    np.minimum.at(nearest, second, turn)
    kept = turn <= np.maximum(nearest[first], nearest[second]) + ROUNDING
    first, second = first[kept], second[kept]
    rows = np.column_stack([neighbours[first], node[first], neighbours[second]])
    return rows, np.column_stack([element[first], element[second]])


def clamps(net, nodes):
    """Springs between a constant direction and every element that ends at some nodes, as `springs` has them.

    The first node of a row stands in for a second one that does not move: it is the middle node as well.
    """
    side, element = np.nonzero(np.isin(net.cells.T, nodes))
    middle, last = net.cells[element, side], net.cells[element, 1 - side]
    return np.column_stack([middle, middle, last]), np.column_stack([element, element])


@table
class Bending(Table):
    """Bending stiffness of lines that continue each other at a node within 30°, and of the elements of each line.

    Parameters
    ----------
    stiffness : float
        B = E I [N m²]. Springs are those of the natural lengths that the web is made with.
    clamp : int, str or list, optional
        Nodes at which every line keeps the direction in space that it has in the web, by number or name. A clamp does
        not hold the node itself: supports do.

    Raises
    ------
    InputError
        For a stiffness that is not > 0; from ``on``, for elements of an order above 1, a web without a clamp in which
        no element continues another within 30°, and a clamp of a node that a free body carries.

    References
    ----------
    The springs B/L̄ are those of the multi-particle model of *Dynamic modelling and analysis of space webs*, Sci
    China-Phys Mech Astron 54 (2011), section 2.3.

    Examples
    --------
        [bending]
        stiffness = 1e-3
        clamp = [0]
    """

    stiffness: float = real(above=0, unit="N·m²")
    clamp: Several = nodes(default=None)

    def on(self, net: Net) -> list[ForceTerm]:
        """The terms of all springs between elements, and of all clamps.

        Two supported nodes that follow each other clamp a line in the middle between them.
        """
        if net.order > 1:
            raise InputError(
                f"stiffness = {self.stiffness:g} needs [cable] order = 1, not {net.order}: its springs stand between "
                f"straight elements; use subdivide = {net.order * net.subdivide}, which has the same nodes"
            )
        rows, elements = springs(net)
        clamped = np.zeros(0, dtype=int) if self.clamp is None else net.find(self.clamp, "clamp")
        for node in np.intersect1d(clamped, net.carried):
            raise InputError(
                f"clamp = {node} is a node on a free body, which turns: leave it out, and attach the next node of the "
                "line to the body as well"
            )
        inner = ~np.isin(rows[:, 1], clamped)  # at a clamp each element bends by itself
        if not (len(clamped) or len(rows)):
            raise InputError(
                f"stiffness = {self.stiffness:g} bends nothing: no line of this web continues another within 30°; "
                "give [cable] subdivide > 1 for lines that bend between their nodes, or leave the table out"
            )
        terms = []
        if inner.any():
            rows, elements = rows[inner], elements[inner]
            _, kind, beside = np.unique(np.sort(net.cells, axis=1), axis=0, return_inverse=True, return_counts=True)
            beside = beside[kind.ravel()][elements].max(axis=1)  # of two lines beside each other each continues one
            vectors = net.points[rows[:, 1:]] - net.points[rows[:, :-1]]
            spring = self.stiffness / net.natural_length[elements].mean(axis=1) / beside
            terms.append(_term(rows, elements, spring, vectors))
        if len(clamped):
            rows, elements = clamps(net, clamped)
            vectors = net.points[rows[:, 2]] - net.points[rows[:, 1]]
            spring = 2.0 * self.stiffness / net.natural_length[elements[:, 0]]
            terms.append(_term(rows, elements, spring, np.hstack([FAR * vectors, vectors]), twists=True))
        return terms


def _term(rows, elements, spring, vectors, twists=False):
    """The term of springs k [N m] between vectors that are so in the web's position [m], shape (springs, 2, 3)."""
    return ForceTerm(
        name="bending",
        cells=np.ascontiguousarray(rows, dtype=np.int32),
        data=np.column_stack([spring, vectors.reshape(-1, 6)]),
        force=force,
        energy=energy,
        tangent=Tangent(stiffness, bound),
        balance=Balance("bending_energy", internal=True, twists=twists),
        elements=CellElements(elements, without(0)),
    )
