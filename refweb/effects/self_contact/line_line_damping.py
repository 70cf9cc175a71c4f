"""Damping forces between lines that touch, as compiled kernels.

With the forces f of `refweb.effects.self_contact.line_line_penalty` on the four nodes of a pair, their velocities v,
and |f| the root of the sum of the squares of all components, damping adds

    F = m f,        m = max(d δ̇, −1),        δ̇ = −f·v/|f|,

the law of Hunt and Crossley, which never becomes a pull. δ̇ is the rate of the overlap. |f| is the push where middles
of elements cross, and up to √2 of it towards their ends. F has no resultant and no moment, as f has none; a rigid
motion does not change it. Its power m f·v is not positive. With K = −∂f/∂x,

    −∂F/∂v = d f f/|f| where m > −1,        −∂F/∂x = m K − f ∂m/∂x,        ∂δ̇/∂x = K v/|f| − (f·v) K f/|f|³.

May change: how the kernels are written; `SHALLOW` upwards, by which explicit steps are shorter. Must stay: `pushed` of
`line_line_penalty` as the source of all forces; the names `force`, `stiffness`, `damping` and `damping_bound` and
`bound`, which `table` takes from this module; 1.875 and the power 0.4 in `add_bounds`, which find the depth from the
energy of `line_line_penalty`: both change together. Tests: ``tests/effects/test_self_contact.py``.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.rows import record_at
from ...kernels import BOUND, FORCE, STIFFNESS, kernel
from .line_line_penalty import MOST, OF_REACH, add_all_second, add_forces, depth_ahead, pushed, steepest, stored
from .pair import ELEMENT, PAIR, numbers_of
from .search import near_pairs

SHALLOW = 0.05
"""Share of the possible overlap of a pair that the bound includes in advance. If a step has more, it takes more
iterations, and the next bound knows the overlap."""


@kernel(forceinline=True)
def loss(v, cells, data, c, forces):
    """(m, |f|, f·v) of pair c, f being the forces on its four nodes."""
    square = power = 0.0
    for n in range(4):
        for k in range(3):
            square += forces[n][k] * forces[n][k]
            power += forces[n][k] * v[cells[c, n], k]
    size = math.sqrt(square)
    if not size > 0.0:
        return 0.0, 0.0, 0.0
    return max(-record_at(PAIR, data, c, 0).damping * power / size, -1.0), size, power


@kernel(FORCE)
def force(t, x, v, f, cells, data, out):
    if cells.shape[1] == 4:
        for c in range(cells.shape[0]):
            _, forces = pushed(x, cells, data, c)
            damped, _, power = loss(v, cells, data, c, forces)
            add_forces(damped, f, cells, c, forces)
            out[c, 0] = damped * power
        return
    out[:, 0] = 0.0
    chosen, rows, numbers = near_pairs(0.0, x, cells, data)
    for c in range(rows.shape[0]):
        _, forces = pushed(x, rows, numbers, c)
        damped, _, power = loss(v, rows, numbers, c, forces)
        add_forces(damped, f, rows, c, forces)
        for n in range(2):
            out[chosen[c, n], 0] += 0.5 * damped * power


@kernel(STIFFNESS)
def stiffness(t, x, v, blocks, cells, data, definite):
    for c in range(cells.shape[0]):
        blocks[c] = 0.0
        if definite:
            continue
        _, push = pushed(x, cells, data, c)
        damped, size, power = loss(v, cells, data, c, push)
        if size == 0.0:
            continue
        add_all_second(x, cells, data, c, False, blocks[c])
        slope = np.zeros(12)
        for i in range(12):
            for j in range(12):
                n, k = j // 3, j % 3
                slope[i] += blocks[c, j, i] * (v[cells[c, n], k] - power * push[n][k] / size**2) / size
        rate = record_at(PAIR, data, c, 0).damping if damped > -1.0 else 0.0
        for i in range(12):
            for j in range(12):
                blocks[c, i, j] = damped * blocks[c, i, j] - rate * push[i // 3][i % 3] * slope[j]


@kernel(STIFFNESS)
def damping(t, x, v, blocks, cells, data, definite):
    for c in range(cells.shape[0]):
        blocks[c] = 0.0
        _, push = pushed(x, cells, data, c)
        damped, size, _ = loss(v, cells, data, c, push)
        if size == 0.0 or damped == -1.0:
            continue
        rate = record_at(PAIR, data, c, 0).damping
        for i in range(12):
            for j in range(12):
                blocks[c, i, j] = rate * push[i // 3][i % 3] * push[j // 3][j % 3] / size


@kernel()
def add_bounds(reach, speed, x, mass, rates, cells, data, viscous):
    """Add the row sums of ∂F/∂v, or of ∂F/∂x, to the rates."""
    rates_here, largest = np.zeros(rates.size), np.zeros(rates.size)
    for c in range(cells.shape[0]):
        depth, _ = depth_ahead(reach, speed, x, mass, cells, data, c)
        if depth > 0.0:
            of = numbers_of(data, c)
            now = (1.875 * stored(x, cells, data, c) / of.scale) ** 0.4
            depth = min(depth, max(2.0 * now, SHALLOW * depth))
            value = 2.0 * steepest(of, depth)
            value *= record_at(PAIR, data, c, 0).damping * (0.5 * depth / of.touch if viscous else speed)
            for n in range(4):
                rates_here[cells[c, n]] += value
                largest[cells[c, n]] = max(largest[cells[c, n]], value)
    for r in range(rates.size):
        rates[r] += min(rates_here[r], MOST * largest[r])


@kernel()
def add_bounds_of_any(reach, speed, x, mass, rates, cells, data, viscous):
    """The same of pairs, or of elements; of these no further than the longest is."""
    reach *= OF_REACH
    if cells.shape[1] == 4:
        add_bounds(reach, speed, x, mass, rates, cells, data, viscous)
        return
    longest = -math.inf
    for c in range(cells.shape[0]):
        longest = max(longest, record_at(ELEMENT, data, c, 0).length)
    _, rows, numbers = near_pairs(min(reach, longest), x, cells, data)
    add_bounds(reach, speed, x, mass, rates, rows, numbers, viscous)


@kernel(BOUND)
def bound(reach, speed, x, mass, rates, cells, data):
    add_bounds_of_any(reach, speed, x, mass, rates, cells, data, False)


@kernel(BOUND)
def damping_bound(reach, speed, x, mass, rates, cells, data):
    add_bounds_of_any(reach, speed, x, mass, rates, cells, data, True)
