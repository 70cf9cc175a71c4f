"""What damping takes where lines touch, as compiled kernels.

With the forces f of `refweb.effects.self_contact.press` on the four nodes of a pair, their velocities v, and |f| the
root of the sum of the squares of all components, damping adds

    F = m f,        m = max(d δ̇, −1),        δ̇ = −f·v/|f|,

the push of Hunt and Crossley, which never turns into a pull. δ̇ is the rate of the overlap: where middles of elements
cross, |f| is the push, and up to √2 of it towards their ends. F has no resultant and no moment, as f has none, and does
not feel a rigid motion. Its power m f·v is not positive. With K = −∂f/∂x,

    −∂F/∂v = d f f/|f| where m > −1,        −∂F/∂x = m K − f ∂m/∂x,        ∂δ̇/∂x = K v/|f| − (f·v) K f/|f|³.
"""

from __future__ import annotations

import math

import numpy as np

from ...kernels import BOUND, FORCE, STIFFNESS, kernel
from .pair import DAMPING, LENGTH, OTHER, SCALE, TOUCH
from .press import MOST, OF_REACH, add_all_second, foreseen, press, steepest, stored
from .search import found
from .smeared import ROOM

SHALLOW = 0.05
"""Share of the overlap that a pair may come to that is reckoned with before it is there: a step that has to do with
more is iterated for longer, and the next bound knows the overlap."""


@kernel(forceinline=True)
def loss(v, cells, data, c, push):
    """(m, |f|, f·v) of pair c, ``push (4, 3)`` being f."""
    square = power = 0.0
    for n in range(4):
        for k in range(3):
            square += push[n, k] * push[n, k]
            power += push[n, k] * v[cells[c, n], k]
    size = math.sqrt(square)
    if not size > 0.0:
        return 0.0, 0.0, 0.0
    return max(-data[c, DAMPING] * power / size, -1.0), size, power


@kernel()
def push_of(x, cells, data, c, nodes, push, ends):
    """Write the forces of pair c to ``push (4, 3)``; ``nodes (1, 4)`` counts these."""
    push[:] = 0.0
    return press(x, push, cells, data, c, nodes, ends)


@kernel()
def lose(x, v, f, cells, data, c, nodes, push, ends):
    """Add the forces of the losses of pair c; their power [W]."""
    push_of(x, cells, data, c, nodes, push, ends)
    damped, _, power = loss(v, cells, data, c, push)
    if damped != 0.0:
        for n in range(4):
            for k in range(3):
                f[cells[c, n], k] += damped * push[n, k]
    return damped * power


@kernel()
def counted():
    """Numbers of the four nodes of a pair."""
    nodes = np.empty((1, 4), dtype=np.int32)
    for n in range(4):
        nodes[0, n] = n
    return nodes


@kernel(FORCE)
def force(t, x, v, f, cells, data, out):
    ends, push, nodes = np.empty(ROOM), np.empty((4, 3)), counted()
    if cells.shape[1] == 4:
        for c in range(cells.shape[0]):
            out[c, 0] = lose(x, v, f, cells, data, c, nodes, push, ends)
        return
    out[:, 0] = 0.0
    chosen, rows, numbers = found(0.0, x, cells, data)
    for c in range(rows.shape[0]):
        power = 0.5 * lose(x, v, f, rows, numbers, c, nodes, push, ends)
        for n in range(2):
            out[chosen[c, n], 0] += power


@kernel(STIFFNESS)
def stiffness(t, x, v, blocks, cells, data, definite):
    ends, push, nodes = np.empty(ROOM), np.empty((4, 3)), counted()
    for c in range(cells.shape[0]):
        blocks[c] = 0.0
        if definite:
            continue
        push_of(x, cells, data, c, nodes, push, ends)
        damped, size, power = loss(v, cells, data, c, push)
        if size == 0.0:
            continue
        add_all_second(x, cells, data, c, False, ends, blocks[c])
        slope = np.zeros(12)
        for i in range(12):
            for j in range(12):
                n, k = j // 3, j % 3
                slope[i] += blocks[c, j, i] * (v[cells[c, n], k] - power * push[n, k] / size**2) / size
        rate = data[c, DAMPING] if damped > -1.0 else 0.0
        for i in range(12):
            for j in range(12):
                blocks[c, i, j] = damped * blocks[c, i, j] - rate * push[i // 3, i % 3] * slope[j]


@kernel(STIFFNESS)
def damping(t, x, v, blocks, cells, data, definite):
    ends, push, nodes = np.empty(ROOM), np.empty((4, 3)), counted()
    for c in range(cells.shape[0]):
        blocks[c] = 0.0
        push_of(x, cells, data, c, nodes, push, ends)
        damped, size, _ = loss(v, cells, data, c, push)
        if size == 0.0 or damped == -1.0:
            continue
        for i in range(12):
            for j in range(12):
                blocks[c, i, j] = data[c, DAMPING] * push[i // 3, i % 3] * push[j // 3, j % 3] / size


@kernel()
def add_bounds(reach, speed, x, mass, rates, cells, data, viscous):
    """Add the row sums of ∂F/∂v, or of ∂F/∂x, to the rates."""
    own, most, ends = np.zeros(rates.size), np.zeros(rates.size), np.empty(ROOM)
    for c in range(cells.shape[0]):
        room = foreseen(reach, speed, x, mass, cells, data, c, ends)
        if room > 0.0:
            now = (1.875 * stored(x, cells, data, c, ends) / data[c, SCALE]) ** 0.4
            room = min(room, max(2.0 * now, SHALLOW * room))
            value = 2.0 * steepest(data[c, TOUCH], data[c, SCALE], data[c, LENGTH], data[c, OTHER], room)
            value *= data[c, DAMPING] * (0.5 * room / data[c, TOUCH] if viscous else speed)
            for n in range(4):
                own[cells[c, n]] += value
                most[cells[c, n]] = max(most[cells[c, n]], value)
    for r in range(rates.size):
        rates[r] += min(own[r], MOST * most[r])


@kernel()
def add_bounds_of_any(reach, speed, x, mass, rates, cells, data, viscous):
    """The same of pairs, or of elements; of these no further than the longest is."""
    reach *= OF_REACH
    if cells.shape[1] == 4:
        add_bounds(reach, speed, x, mass, rates, cells, data, viscous)
        return
    _, rows, numbers = found(min(reach, data[:, LENGTH].max()), x, cells, data)
    add_bounds(reach, speed, x, mass, rates, rows, numbers, viscous)


@kernel(BOUND)
def bound(reach, speed, x, mass, rates, cells, data):
    add_bounds_of_any(reach, speed, x, mass, rates, cells, data, False)


@kernel(BOUND)
def damping_bound(reach, speed, x, mass, rates, cells, data):
    add_bounds_of_any(reach, speed, x, mass, rates, cells, data, True)
