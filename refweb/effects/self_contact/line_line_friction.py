"""Friction where lines touch, as compiled kernels, and how explicit kicks solve for it.

The push of a pair, see `refweb.effects.self_contact.line_line_penalty`, has the resultant N n on its first element,
without parts along the lines, which occur at joints. Its distribution to the four nodes determines the contact points a
of the first and b of the other element, d = a − b. With the directions û and ŵ of the elements, the rates at which they
slide along themselves,

    s₁ = d/dt (û·d),        s₂ = d/dt (ŵ·d),

for this distribution, do not change with a rigid motion of the pair. The slip that has them as components along û and ŵ
has the square |u|² = sᵀ G⁻¹ s, G = [[1, c], [c, 1]], c = û·ŵ. Friction is Coulomb's, regularised with the slip velocity
v_s,

    F = −μ N ∂|u|²/∂s / (2 √(|u|² + v_s²)),        its power  F·s = −μ N |u|²/√(|u|² + v_s²) ≤ 0,

It is distributed to the nodes by the derivatives of s, so that momentum and angular momentum are conserved. Nodes of a
straight line take no moment about it, so that friction has none either: lines rotate freely about their axes. For any
μ, a line that is wound around a straight line slides as over a rotating pulley.

If lines do not roll, s has the two components across n of the relative velocity of both centre lines, and G is the
identity. This is the friction of threads: a line that is wound n turns holds T₂/T₁ ≤ e^(2π n μ). It conserves momentum.
It does not conserve angular momentum: each contact leaves a moment 2 r F, which real lines would carry by torsion. It
also brakes nets that rotate as a whole. No friction can hold a wound line and conserve the angular momentum of such
elements.

N is the push of the overlap, without damping. Lines that lie along each other have friction only along their axes:
across them they roll. To get this limit, the ones in G are replaced by 1 + `ALIKE` c²/(L L'), with the distance of
contact c.

In explicit kicks `refweb.effects.contact_solver` solves for friction contact by contact, along the two directions for
which J M⁻¹ Jᵀ has no mixed term. Only iterations of implicit methods use tangents of N, by differences.

May change: `STEP`. Must stay: the law, which `contact_solver.friction_law` solves in explicit kicks; the names `force`,
`stiffness`, `bound`, `damping` and `KICKS`, which `table` takes from this module; `SLOTS`, the contacts of an element
that are remembered. `ALIKE` changes results of parallel lines. Tests: ``tests/effects/test_self_contact.py``.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.rows import record_at
from ...kernels import BOUND, DETECT, FORCE, STIFFNESS, kernel
from ..base import ImplicitContactKernels
from ..contact_solver import friction_law, set_part
from ..vectors import cross, dot
from .line_line_penalty import bound as press_bound
from .line_line_penalty import pushed
from .pair import ELEMENT, PAIR, place_of
from .search import near_pairs

ALIKE = 0.01
"""Factor of (2r)²/(L L') that keeps the slip of lines along each other finite."""
STEP = 1e-6
"""Step of differences, over the distance of contact."""
SLOTS = 8
"""Number of pairs of an element whose forces are kept."""


@kernel(forceinline=True)
def set_rows_of_threads(along, n, a, b, rows, shares):
    """Write what `slip_rows` does of centre lines that do not roll: components along the first line and across it."""
    off = dot(along, n)
    e = along[0] - off * n[0], along[1] - off * n[1], along[2] - off * n[2]
    inverse = 1.0 / math.sqrt(dot(e, e))
    e = inverse * e[0], inverse * e[1], inverse * e[2]
    axes, weights = (e, cross(n, e)), (1.0 - a, a, b - 1.0, -b)
    for i in range(2):
        for m in range(4):
            for k in range(3):
                rows[i, m, k] = weights[m] * axes[i][k]
        shares[i, i], shares[i, 1 - i] = 1.0, 0.0


@kernel()
def slip_rows(x, cells, data, c, rows, shares):
    """N of pair c [N], 0 without contact; writes the entries of nodes in both components of u to ``rows (2, 4, 3)``.

    ``shares (2, 2)`` are the parts along û and ŵ, or along the components of threads, of forces along both.
    """
    (_, push), pair = pushed(x, cells, data, c), record_at(PAIR, data, c, 0)
    total = push[0][0] + push[1][0], push[0][1] + push[1][1], push[0][2] + push[1][2]
    p, u, w = place_of(x, cells, data, c)
    long, wide = math.sqrt(dot(u, u)), math.sqrt(dot(w, w))
    if not (dot(total, total) > 0.0 and long > 0.0 and wide > 0.0):
        return 0.0
    first_unit, second = (u[0] / long, u[1] / long, u[2] / long), (w[0] / wide, w[1] / wide, w[2] / wide)
    mixed = dot(first_unit, second)
    apart = 1.0 + ALIKE * pair.touch**2 / (pair.length * pair.second)
    both, differ = 1.0 / math.sqrt(2.0 * (apart + mixed)), 1.0 / math.sqrt(2.0 * (apart - mixed))
    shares[0, 0], shares[0, 1], shares[1, 0], shares[1, 1] = both, both, differ, -differ
    p0, p1, p2 = total
    for i in range(2):  # what pushes along either line, at a joint, is no pressure
        first, last = shares[i, 0], shares[i, 1]
        e = (
            first * first_unit[0] + last * second[0],
            first * first_unit[1] + last * second[1],
            first * first_unit[2] + last * second[2],
        )
        size = dot(total, e)
        p0, p1, p2 = p0 - size * e[0], p1 - size * e[1], p2 - size * e[2]
    size = math.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
    if not size > 0.0:
        return 0.0
    n = p0 / size, p1 / size, p2 / size
    within = dot(total, n)
    if not within > 0.0:
        return 0.0
    a, b = dot(push[1], n) / within, -dot(push[3], n) / within
    if pair.rolls == 0.0:
        set_rows_of_threads(first_unit, n, a, b, rows, shares)
        return size
    d = p[0] + a * u[0] - b * w[0], p[1] + a * u[1] - b * w[1], p[2] + a * u[2] - b * w[2]
    first_share, its = dot(first_unit, d), dot(second, d)
    for k in range(3):
        tilt, lean = (d[k] - first_share * first_unit[k]) / long, (d[k] - its * second[k]) / wide
        for i in range(2):
            mean = shares[i, 0] * first_unit[k] + shares[i, 1] * second[k]
            rows[i, 0, k] = (1.0 - a) * mean - shares[i, 0] * tilt
            rows[i, 1, k] = a * mean + shares[i, 0] * tilt
            rows[i, 2, k] = -(1.0 - b) * mean - shares[i, 1] * lean
            rows[i, 3, k] = -b * mean + shares[i, 1] * lean
    return size


@kernel(forceinline=True)
def slip_of(v, cells, c, rows, i):
    """Component i of u [m/s]."""
    total = 0.0
    for n in range(4):
        for k in range(3):
            total += rows[i, n, k] * v[cells[c, n], k]
    return total


@kernel()
def rub(x, v, f, cells, data, c, rows, shares):
    """Add the friction of pair c to the rows ``cells[c]`` of f; its power [W]."""
    normal = slip_rows(x, cells, data, c, rows, shares)
    if normal == 0.0:
        return 0.0
    first, second = slip_of(v, cells, c, rows, 0), slip_of(v, cells, c, rows, 1)
    pair = record_at(PAIR, data, c, 0)
    drag = pair.friction * normal / math.sqrt(first * first + second * second + pair.slip_velocity**2)
    for n in range(4):
        for k in range(3):
            f[cells[c, n], k] -= drag * (first * rows[0, n, k] + second * rows[1, n, k])
    return -drag * (first * first + second * second)


@kernel(FORCE)
def force(t, x, v, f, cells, data, out):
    rows, shares = np.empty((2, 4, 3)), np.empty((2, 2))
    if cells.shape[1] == 4:
        for c in range(cells.shape[0]):
            out[c, 0] = rub(x, v, f, cells, data, c, rows, shares)
        return
    out[:, 0] = 0.0
    chosen, pairs, numbers = near_pairs(0.0, x, cells, data)
    for c in range(pairs.shape[0]):
        out[chosen[c, 0], 0] += rub(x, v, f, pairs, numbers, c, rows, shares)


@kernel(STIFFNESS)
def stiffness(t, x, v, blocks, cells, data, definite):
    rows, shares = np.empty((2, 4, 3)), np.empty((2, 2))
    geometry, speed, ahead, behind = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
    all_rows = np.empty((1, 4), dtype=np.int32)
    for n in range(4):
        all_rows[0, n] = n
    for c in range(cells.shape[0]):
        blocks[c] = 0.0
        if definite or slip_rows(x, cells, data, c, rows, shares) == 0.0:
            continue
        numbers, step = data[c : c + 1], STEP * record_at(PAIR, data, c, 0).touch
        for n in range(4):
            for k in range(3):
                geometry[n, k], speed[n, k] = x[cells[c, n], k], v[cells[c, n], k]
        for m in range(12):
            n, k = m // 3, m % 3
            was = geometry[n, k]
            ahead[:], behind[:] = 0.0, 0.0
            geometry[n, k] = was + step
            rub(geometry, speed, ahead, all_rows, numbers, 0, rows, shares)
            geometry[n, k] = was - step
            rub(geometry, speed, behind, all_rows, numbers, 0, rows, shares)
            geometry[n, k] = was
            for i in range(12):
                blocks[c, i, m] = (behind[i // 3, i % 3] - ahead[i // 3, i % 3]) / (2.0 * step)


@kernel(STIFFNESS)
def damping(t, x, v, blocks, cells, data, definite):
    rows, shares = np.empty((2, 4, 3)), np.empty((2, 2))
    for c in range(cells.shape[0]):
        blocks[c] = 0.0
        normal = slip_rows(x, cells, data, c, rows, shares)
        if normal == 0.0:
            continue
        u, pair = (slip_of(v, cells, c, rows, 0), slip_of(v, cells, c, rows, 1)), record_at(PAIR, data, c, 0)
        size = math.sqrt(u[0] * u[0] + u[1] * u[1] + pair.slip_velocity**2)
        drag = pair.friction * normal / size
        for i in range(2):
            for j in range(2):
                value = drag * ((1.0 if i == j else 0.0) - u[i] * u[j] / (size * size))
                for m in range(12):
                    for n in range(12):
                        blocks[c, m, n] += value * rows[i, m // 3, m % 3] * rows[j, n // 3, n % 3]


@kernel(BOUND)
def bound(reach, speed, x, mass, rates, cells, data):
    rates_here = np.zeros(rates.size)
    if cells.shape[0]:
        press_bound(reach, speed, x, mass, rates_here, cells, data)
        friction = record_at(ELEMENT, data, 0, 0).friction  # where pairs have it as well
        for r in range(rates.size):
            rates[r] += friction * rates_here[r]


# Kicks


@kernel()
def set_contact(contact, parts, cell, c, normal, cells, data, rows, shares):
    """Write the contact of pair c, whose power belongs to a ``cell``, from the output of `slip_rows`.

    Its basis has the directions along û and ŵ, or along the components of threads, and a normal without force.
    """
    pair = record_at(PAIR, data, c, 0)
    contact.cell, contact.owner, contact.tag = cell, int(pair.elements[0]), int(pair.elements[1])
    contact.count, contact.group = 4, 1
    contact.normal_force, contact.damping, contact.wind[:] = normal, 0.0, 0.0
    contact.friction, contact.slip_velocity = pair.friction, pair.slip_velocity
    for m in range(4):
        part = parts[contact.first + m]
        set_part(part, cells[c, m], 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        for i in range(2):
            rate = rows[i, m, 0], rows[i, m, 1], rows[i, m, 2]
            set_part(part, cells[c, m], 1 + i, rate, rate)
    for i in range(2):
        contact.basis[0, i] = contact.basis[1 + i, 2] = 0.0
        contact.basis[1 + i, 0], contact.basis[1 + i, 1] = shares[i, 0], shares[i, 1]
    contact.basis[0, 2] = 1.0


@kernel(DETECT)
def detect(x, cells, data, known, contacts, parts, begin):
    rows, shares = np.empty((2, 4, 3)), np.empty((2, 2))
    count, chosen = begin, np.empty((0, 2), dtype=np.int64)
    if cells.shape[1] != 4:
        chosen, cells, data = near_pairs(0.0, x, cells, data)
    for c in range(cells.shape[0]):
        normal = slip_rows(x, cells, data, c, rows, shares)
        if normal > 0.0:
            if count < contacts.size:
                cell = chosen[c, 0] if chosen.shape[0] else c
                set_contact(contacts[count], parts, cell, c, normal, cells, data, rows, shares)
            count += 1
    return count


KICKS = ImplicitContactKernels(detect, friction_law, SLOTS)
"""Kernels that solve explicit kicks."""
