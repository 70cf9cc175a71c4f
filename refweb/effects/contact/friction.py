"""Losses of contact, by damping and by friction, as compiled kernels.

At a contact, see `refweb.effects.contact.signed_distance`, let N₀ = k W δ^p be the push of the penalty, n = −∂δ/∂x the
normal, u the velocity of the line's point relative to the body's, with the rate of depth δ̇ = −n·u and the slip u_t = u
+ δ̇ n, and q = u_t/√(|u_t|² + v_s²). By Hunt and Crossley [1]_ and by Coulomb, regularised,

    N = N₀ (1 + max(d δ̇, −1)) ≥ 0,        F = N₀ max(d δ̇, −1) n − μ N q,

F being what is added here to the penalty. F acts on the line at the contact and on the body with −F and the moment
−y × F about its centre, y from the centre to the line's point, so that their momenta and angular momenta are kept; a
ring turns about its normal only. The power F·u is not positive. With the matrices A = ∂F/∂y and B = ∂F/∂u the tangents
follow from dF = A dy + B du + F dW/W, where dy, du and dW have a part of the contact's place as it moves.

References
----------
.. [1] K. H. Hunt, F. R. E. Crossley, "Coefficient of restitution interpreted as damping in vibroimpact", J. Appl. Mech.
   42 (1975) 440–445, doi:10.1115/1.3423596.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from ...kernels import BOUND, FORCE, STIFFNESS, kernel
from ...net.shapes import RING, SPHERE
from ..vectors import cross, dot
from .nearest_point import AWAY, FRICTION, KIND, LOSS, PENALTY, SLIP, lightness, share
from .penalty import SHALLOW, foreseen, lowered, raised, thickness, turn
from .signed_distance import PLACES, along_axes, bent, contacts, from_axes, moves, window, within


@kernel()
def turning(data, c, nodes, w):
    """What of an angular velocity, or a moment, turns the body: of a ring that about its normal."""
    return (0.0, 0.0, w[2]) if data[c, AWAY + 3 * nodes + KIND] == RING else w


@kernel()
def slipping(v, cells, data, c, nodes, spins, functions, place, y):
    """(velocity of the line's point relative to the body's, its slope along the line, angular velocity), along axes."""
    b, w = cells[c, nodes], (0.0, 0.0, 0.0)
    u0, u1, u2 = -v[b, 0], -v[b, 1], -v[b, 2]
    s0 = s1 = s2 = 0.0
    for a in range(nodes):
        i = cells[c, a]
        value, slope = share(a, nodes, functions, place)
        u0, u1, u2 = u0 + value * v[i, 0], u1 + value * v[i, 1], u2 + value * v[i, 2]
        s0, s1, s2 = s0 + slope * v[i, 0], s1 + slope * v[i, 1], s2 + slope * v[i, 2]
    u, s = along_axes(data, c, nodes, (u0, u1, u2)), along_axes(data, c, nodes, (s0, s1, s2))
    if spins:
        r = cells[c, nodes + 1]
        w = turning(data, c, nodes, along_axes(data, c, nodes, (v[r, 0], v[r, 1], v[r, 2])))
        wy = cross(w, y)
        u = u[0] - wy[0], u[1] - wy[1], u[2] - wy[2]
    return u, s, w


@kernel()
def lost(data, c, nodes, push, g, u):
    """(max(d δ̇, −1), N, q, √(|u_t|² + v_s²)) of the push N₀."""
    at, rate = AWAY + 3 * nodes, dot(g, u)
    damped = max(data[c, at + LOSS] * rate, -1.0)
    t = u[0] - rate * g[0], u[1] - rate * g[1], u[2] - rate * g[2]
    size = math.sqrt(dot(t, t) + data[c, at + SLIP] ** 2)
    return damped, push * (1.0 + damped), (t[0] / size, t[1] / size, t[2] / size), size


@kernel()
def rubbed(data, c, nodes, push, g, u):
    """F along the axes of the body."""
    damped, normal, q, _ = lost(data, c, nodes, push, g, u)
    drag = data[c, AWAY + 3 * nodes + FRICTION] * normal
    return (
        -push * damped * g[0] - drag * q[0],
        -push * damped * g[1] - drag * q[1],
        -push * damped * g[2] - drag * q[2],
    )


@kernel()
def by_velocity(data, c, nodes, push, g, u, matrix):
    """Write ∂F/∂u."""
    at = AWAY + 3 * nodes
    damped, normal, q, size = lost(data, c, nodes, push, g, u)
    friction, slope = data[c, at + FRICTION], push * data[c, at + LOSS] if damped > -1.0 else 0.0
    drag = friction * normal / size
    for i in range(3):
        for j in range(3):
            along = g[i] * g[j]
            across = (1.0 if i == j else 0.0) - along - q[i] * q[j]
            matrix[i, j] = -slope * along - drag * across - friction * slope * q[i] * g[j]


@kernel()
def by_place(data, c, nodes, push, steep, g, bend, u, matrix):
    """Write ∂F/∂y at a given u; ``steep`` is ∂N₀/∂δ."""
    at = AWAY + 3 * nodes
    damped, normal, q, size = lost(data, c, nodes, push, g, u)
    friction, slope = data[c, at + FRICTION], push * data[c, at + LOSS] if damped > -1.0 else 0.0
    rate, turned = dot(g, u), bent(bend, u)
    h = ((bend[0], bend[1], bend[2]), (bend[1], bend[3], bend[4]), (bend[2], bend[4], bend[5]))
    qh = bent(bend, q)
    for j in range(3):
        pushed, faster = steep * g[j], slope * turned[j]  # ∂N₀/∂y, N₀ ∂(d δ̇)/∂y
        pressed = pushed * (1.0 + damped) + faster  # ∂N/∂y
        along = rate * qh[j]  # −q·∂u_t/∂y
        for i in range(3):
            slid = -rate * h[i][j] - g[i] * turned[j] + q[i] * along  # size ∂q/∂y
            matrix[i, j] = -(pushed * damped + faster) * g[i] - push * damped * h[i][j]
            matrix[i, j] -= friction * (pressed * q[i] + normal * slid / size)


@kernel()
def spread(most, mass, rates, cells, data, c, nodes, spins):
    """Add the row sums of the contacts of an element, with ∂F/∂u, or ∂F/∂y, of at most ``most`` each.

    Unknowns of the body are scaled as in `refweb.effects.contact.nearest_point.lightness`, and its rotation likewise.
    """
    delta, thick, b = lightness(mass, cells, c, nodes), thickness(data, c, nodes), cells[c, nodes]
    most *= 1.0 if nodes == 2 else float(nodes * nodes)
    near, all_of = 1.6, 3.0  # 1 + max W N of a node; both ends and one between
    if data[c, AWAY + 3 * nodes + KIND] == SPHERE:
        near = all_of = 1.0
    spun = 0.0
    if spins:
        r = cells[c, nodes + 1]
        spun = min(delta * thick * math.sqrt(mass[b] / mass[r]), 1.0)
        rates[r] += all_of * most * thick * thick * (1.0 + (1.0 + delta) / spun)
    for a in range(nodes):
        rates[cells[c, a]] += near * most * (1.0 + delta + spun)
    if delta > 0.0:
        rates[b] += all_of * most * (1.0 + (1.0 + spun) / delta)


@functools.cache
def kernels(pieces, nodes, functions, spins):
    """Force, stiffness and its bound, damping and its bound.

    Parameters
    ----------
    pieces, nodes, functions
        See `refweb.effects.contact.penalty.kernels`.
    spins : int
        1 where the last row of a cell is the rotation of the body, else 0.
    """
    arity = nodes + 1 + spins

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        found = np.empty((PLACES * pieces, 3))
        out[:, 0] = 0.0
        for first in range(0, cells.shape[0], pieces):
            for n in range(contacts(x, cells, data, first, pieces, nodes, functions, found)):
                c, place, inner = int(found[n, 0]), found[n, 1], found[n, 2] > 0.0
                y, _, _, deep, g, _ = within(x, cells, data, c, nodes, functions, place)
                push = data[c, PENALTY] * window(data, c, nodes, place, inner)[0] * raised(data, c, nodes, deep)
                u, _, _ = slipping(v, cells, data, c, nodes, spins, functions, place, y)
                own = rubbed(data, c, nodes, push, g, u)
                out[c, 0] += dot(own, u)
                pull = from_axes(data, c, nodes, own)
                for k in range(3):
                    for a in range(nodes):
                        f[cells[c, a], k] += share(a, nodes, functions, place)[0] * pull[k]
                    f[cells[c, nodes], k] -= pull[k]
                if spins:
                    moment = from_axes(data, c, nodes, turning(data, c, nodes, cross(y, own)))
                    for k in range(3):
                        f[cells[c, nodes + 1], k] -= moment[k]

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        found, z, q = np.empty((PLACES * pieces, 3)), np.empty((nodes + 1, 3)), np.empty((3, 3))
        by_y, by_u = np.empty((3, 3)), np.empty((3, 3))
        blocks[:] = 0.0
        for first in range(0, cells.shape[0] if not definite else 0, pieces):
            for n in range(contacts(x, cells, data, first, pieces, nodes, functions, found)):
                c, place, inner = int(found[n, 0]), found[n, 1], found[n, 2] > 0.0
                y, d, e, deep, g, bend = within(x, cells, data, c, nodes, functions, place)
                moves(data, c, nodes, functions, place, inner, d, e, deep, g, bend, z)
                w, w1, _ = window(data, c, nodes, place, inner)
                push = data[c, PENALTY] * w * raised(data, c, nodes, deep)
                steep = data[c, PENALTY] * w * lowered(data, c, nodes, deep)
                u, s, turns = slipping(v, cells, data, c, nodes, spins, functions, place, y)
                own = rubbed(data, c, nodes, push, g, u)
                by_velocity(data, c, nodes, push, g, u, by_u)
                by_place(data, c, nodes, push, steep, g, bend, u, by_y)
                for b in range(nodes + 1):
                    part = share(b, nodes, functions, place)[0] if b < nodes else -1.0
                    for j in range(3):
                        step = z[b, j]
                        dy = (
                            step * d[0] + (part if j == 0 else 0.0),
                            step * d[1] + (part if j == 1 else 0.0),
                            step * d[2] + (part if j == 2 else 0.0),
                        )
                        wy = cross(turns, dy)
                        du = step * s[0] - wy[0], step * s[1] - wy[1], step * s[2] - wy[2]
                        fading = step * w1 / w
                        change = (
                            dot(by_y[0], dy) + dot(by_u[0], du) + fading * own[0],
                            dot(by_y[1], dy) + dot(by_u[1], du) + fading * own[1],
                            dot(by_y[2], dy) + dot(by_u[2], du) + fading * own[2],
                        )
                        for a in range(nodes):
                            value, slope = share(a, nodes, functions, place)
                            for i in range(3):
                                blocks[c, 3 * a + i, 3 * b + j] -= value * change[i] + slope * step * own[i]
                        for i in range(3):
                            blocks[c, 3 * nodes + i, 3 * b + j] += change[i]
                        if spins:
                            one, two = cross(dy, own), cross(y, change)
                            moment = turning(data, c, nodes, (one[0] + two[0], one[1] + two[1], one[2] + two[2]))
                            for i in range(3):
                                blocks[c, 3 * nodes + 3 + i, 3 * b + j] += moment[i]
            for c in range(first, first + pieces):
                turn(blocks, c, arity, data, nodes, q)

    @kernel(STIFFNESS)
    def damping(t, x, v, blocks, cells, data, definite):
        found, q, by_u = np.empty((PLACES * pieces, 3)), np.empty((3, 3)), np.empty((3, 3))
        blocks[:] = 0.0
        for first in range(0, cells.shape[0], pieces):
            for n in range(contacts(x, cells, data, first, pieces, nodes, functions, found)):
                c, place, inner = int(found[n, 0]), found[n, 1], found[n, 2] > 0.0
                y, _, _, deep, g, _ = within(x, cells, data, c, nodes, functions, place)
                push = data[c, PENALTY] * window(data, c, nodes, place, inner)[0] * raised(data, c, nodes, deep)
                u, _, _ = slipping(v, cells, data, c, nodes, spins, functions, place, y)
                by_velocity(data, c, nodes, push, g, u, by_u)
                for b in range(arity):
                    part = share(b, nodes, functions, place)[0] if b < nodes else -1.0
                    for j in range(3):
                        unit = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
                        du = part * unit[0], part * unit[1], part * unit[2]
                        if b > nodes:
                            du = cross(y, turning(data, c, nodes, unit))
                        change = dot(by_u[0], du), dot(by_u[1], du), dot(by_u[2], du)
                        for i in range(3):
                            for a in range(nodes):
                                value = share(a, nodes, functions, place)[0]
                                blocks[c, 3 * a + i, 3 * b + j] -= value * change[i]
                            blocks[c, 3 * nodes + i, 3 * b + j] += change[i]
                        if spins:
                            moment = turning(data, c, nodes, cross(y, change))
                            for i in range(3):
                                blocks[c, 3 * nodes + 3 + i, 3 * b + j] += moment[i]
            for c in range(first, first + pieces):
                turn(blocks, c, arity, data, nodes, q)

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            deep, _ = foreseen(False, reach, speed, x, mass, cells, data, c, nodes, functions)
            if deep > 0.0:
                loss, friction = data[c, AWAY + 3 * nodes + LOSS], data[c, AWAY + 3 * nodes + FRICTION]
                most = SHALLOW * loss * speed * (1.0 + friction) + friction
                spread(
                    most * data[c, PENALTY] * lowered(data, c, nodes, deep), mass, rates, cells, data, c, nodes, spins
                )

    @kernel(BOUND)
    def damping_bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            deep, _ = foreseen(False, reach, speed, x, mass, cells, data, c, nodes, functions)
            if deep > 0.0:
                at = AWAY + 3 * nodes
                loss, friction = data[c, at + LOSS], data[c, at + FRICTION]
                most = loss * (1.0 + friction) + friction * (1.0 + SHALLOW * loss * speed) / data[c, at + SLIP]
                spread(
                    most * data[c, PENALTY] * raised(data, c, nodes, deep), mass, rates, cells, data, c, nodes, spins
                )

    return force, stiffness, bound, damping, damping_bound
