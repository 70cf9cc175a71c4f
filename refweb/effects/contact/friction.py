"""Losses of contact, by damping and by friction, as compiled kernels.

At a contact, see `refweb.effects.contact.contact_points`, let g = ∂δ/∂x, N₀ = |g| k W δ^p be the push of the penalty, n
= −g/|g| the normal, u the velocity of the line's point relative to the body's, with the rate of depth δ̇ = g·u and the
slip u_t = u − (n·u) n, and q = u_t/√(|u_t|² + v_s²). By Hunt and Crossley [1]_ and by Coulomb, regularised,

    N = N₀ (1 + max(d δ̇, −1)) ≥ 0,        F = N₀ max(d δ̇, −1) n − μ N q,

where F is added to the force of the penalty. F acts on the line at the contact. On the body act −F and the moment −y ×
F about its centre, with y from the centre to the line's point. Therefore momentum and angular momentum are conserved. A
ring rotates about its normal only, other bodies as in `refweb.net.rotation`. The power F·u is not positive. With the
matrices A = ∂F/∂y and B = ∂F/∂u, tangents follow from dF = A dy + B du + F dW/W, where dy, du and dW include the change
of ξ. `refweb.effects.contact_solver` solves for F in explicit kicks.

May change: numbers of the bound upwards alone, which makes steps shorter; how tangents are written. Must stay: the law,
which `contact_solver.friction_law` has once more for explicit kicks, so that both change together; the layout of
``data``, which is that of `pair`; ``out`` with the power [W] and the force on the body [N]; the order force, stiffness,
bound, damping, which `table` unpacks. `facing` gives −n: the law has only products of two n. Must stay as well:
`friction_force` and `turned_by`, which `body_body_friction` imports. Tests: ``tests/test_contract.py``,
``tests/effects/test_contact_losses.py``.

References
----------
.. [1] K. H. Hunt, F. R. E. Crossley, "Coefficient of restitution interpreted as damping in vibroimpact", J. Appl. Mech.
   42 (1975) 440–445, doi:10.1115/1.3423596.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from ...compiled.rows import record_at
from ...kernels import BOUND, FORCE, STIFFNESS, kernel
from ...net.rotation import times, times_transposed, to_quaternion
from ..base import TOUCH
from ..vectors import cross, dot
from .contact_points import hessian_times, place_moves, places, window
from .nearest_point import lightness, share
from .pair import LINE_CONTACT, lever_of, pair_of, pairing
from .penalty import SHALLOW, foresight, rubbed_by, slope_of_power, thickness, turn_block
from .rotational_stiffness import add_push, add_rotation, add_velocities, set_arms


class Slip(NamedTuple):
    """Velocity of a line at a contact, along the axes of the body.

    Attributes
    ----------
    velocity : tuple of 3 float
        u, of the line's point relative to the body's [m/s].
    slope : tuple of 3 float
        Of the line's velocity along the line, by ξ [m/s].
    turning : tuple of 3 float
        Angular velocity of the body [rad/s].
    """

    velocity: tuple[Any, ...]
    slope: tuple[Any, ...]
    turning: tuple[Any, ...]


class Loss(NamedTuple):
    """(max(d δ̇, −1), N, q, √(|u_t|² + v_s²)) of a contact."""

    damped: float
    normal: float
    direction: tuple[Any, ...]
    size: float


@kernel(forceinline=True)
def turned_by(planar, w):
    """Part of an angular velocity, or a moment, that turns the body: of a ring that about its normal."""
    return (0.0, 0.0, w[2]) if planar else w


@kernel(forceinline=True)
def angular(pair, spins, u):
    """Angular velocity along the axes of the body, by the velocity of its row of rotation."""
    return hessian_times(pair.mobility, u) if spins == 2 else turned_by(pair.planar, u)


@kernel()
def slip_of(v, cells, c, nodes, spins, functions, pair, xi, y):
    """The `Slip` at a place of cell c."""
    b, w = cells[c, nodes], (0.0, 0.0, 0.0)
    u0, u1, u2 = -v[b, 0], -v[b, 1], -v[b, 2]
    s0 = s1 = s2 = 0.0
    for a in range(nodes):
        i = cells[c, a]
        value, slope = share(a, nodes, functions, xi)
        u0, u1, u2 = u0 + value * v[i, 0], u1 + value * v[i, 1], u2 + value * v[i, 2]
        s0, s1, s2 = s0 + slope * v[i, 0], s1 + slope * v[i, 1], s2 + slope * v[i, 2]
    u, s = times(pair.axes, (u0, u1, u2)), times(pair.axes, (s0, s1, s2))
    if spins:
        r = cells[c, nodes + 1]
        w = angular(pair, spins, times(pair.axes, (v[r, 0], v[r, 1], v[r, 2])))
        wy = cross(w, y)
        u = u[0] - wy[0], u[1] - wy[1], u[2] - wy[2]
    return Slip(u, s, w)


@kernel()
def facing(g):
    """(length of a gradient of depth, the unit vector along it)."""
    length = math.sqrt(dot(g, g))
    return (length, (g[0] / length, g[1] / length, g[2] / length)) if length > 0.0 else (0.0, g)


@kernel()
def hunt_crossley(pair, push, g, u):
    """The `Loss` of a push k W δ^p."""
    length, n = facing(g)
    damped, rate = max(pair.damping * dot(g, u), -1.0), dot(n, u)
    t = u[0] - rate * n[0], u[1] - rate * n[1], u[2] - rate * n[2]
    size = math.sqrt(dot(t, t) + pair.slip_velocity**2)
    return Loss(damped, push * length * (1.0 + damped), (t[0] / size, t[1] / size, t[2] / size), size)


@kernel()
def friction_force(pair, push, g, u):
    """F along the axes of the body."""
    damped, normal, q, _ = hunt_crossley(pair, push, g, u)
    drag = pair.friction * normal
    return (
        -push * damped * g[0] - drag * q[0],
        -push * damped * g[1] - drag * q[1],
        -push * damped * g[2] - drag * q[2],
    )


@kernel()
def by_velocity(pair, push, g, u, matrix):
    """Write ∂F/∂u."""
    damped, normal, q, size = hunt_crossley(pair, push, g, u)
    length, n = facing(g)
    slope = push * pair.damping if damped > -1.0 else 0.0
    drag = pair.friction * normal / size
    for i in range(3):
        for j in range(3):
            across = (1.0 if i == j else 0.0) - n[i] * n[j] - q[i] * q[j]
            matrix[i, j] = -slope * g[i] * g[j] - drag * across - pair.friction * length * slope * q[i] * g[j]


@kernel()
def by_place(pair, push, steep, g, bend, u, matrix):
    """Write ∂F/∂y at a given u; ``steep`` is ∂/∂δ of the push k W δ^p, ``bend`` the Hessian of the depth."""
    damped, normal, q, size = hunt_crossley(pair, push, g, u)
    length, n = facing(g)
    inverse = 1.0 / length if length > 0.0 else 0.0
    slope = push * pair.damping if damped > -1.0 else 0.0
    rate, turned, leant, qh = dot(n, u), hessian_times(bend, u), hessian_times(bend, n), hessian_times(bend, q)
    h = ((bend[0], bend[1], bend[2]), (bend[1], bend[3], bend[4]), (bend[2], bend[4], bend[5]))
    for j in range(3):
        pushed, faster = steep * g[j], slope * turned[j]  # ∂(k W δ^p)/∂y, k W δ^p ∂(d δ̇)/∂y
        pressed = length * (pushed * (1.0 + damped) + faster) + push * (1.0 + damped) * leant[j]  # ∂N/∂y
        along = rate * qh[j]  # −|g| q·∂u_t/∂y
        for i in range(3):
            tilted = h[i][j] - n[i] * leant[j]  # |g| ∂n/∂y
            slid = -rate * tilted - n[i] * (turned[j] - rate * leant[j]) + q[i] * along  # |g| size ∂q/∂y
            matrix[i, j] = -(pushed * damped + faster) * g[i] - push * damped * h[i][j]
            matrix[i, j] -= pair.friction * (pressed * q[i] + normal * inverse * slid / size)


@kernel(forceinline=True)
def add_stiffness(blocks, v, cells, touch, nodes, spins, functions, z, by_y, by_u):
    """Add what a contact has of −∂f/∂x, along the axes of the body.

    ``z`` is what `place_moves` writes; ``by_y`` and ``by_u (3, 3)`` are space to work in.
    """
    c, xi, pair, (y, d, _, deep, g, bend) = touch.c, touch.xi, touch.pair, touch.spot
    w, w1, _ = window(pair.once, xi, touch.inner)
    push = rubbed_by(touch)
    steep = touch.share * pair.stiffness * w * slope_of_power(pair.exponent, deep)
    u, s, turns = slip_of(v, cells, c, nodes, spins, functions, pair, xi, y)
    force_ = friction_force(pair, push, g, u)
    by_velocity(pair, push, g, u, by_u)
    by_place(pair, push, steep, g, bend, u, by_y)
    for b in range(nodes + 1):
        part = share(b, nodes, functions, xi)[0] if b < nodes else -1.0
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
                dot(by_y[0], dy) + dot(by_u[0], du) + fading * force_[0],
                dot(by_y[1], dy) + dot(by_u[1], du) + fading * force_[1],
                dot(by_y[2], dy) + dot(by_u[2], du) + fading * force_[2],
            )
            for a in range(nodes):
                value, slope = share(a, nodes, functions, xi)
                for i in range(3):
                    blocks[c, 3 * a + i, 3 * b + j] -= value * change[i] + slope * step * force_[i]
            for i in range(3):
                blocks[c, 3 * nodes + i, 3 * b + j] += change[i]
            if spins:
                turned, two = cross(dy, force_), cross(y, change)
                moment = turned_by(pair.planar, (turned[0] + two[0], turned[1] + two[1], turned[2] + two[2]))
                for i in range(3):
                    blocks[c, 3 * nodes + 3 + i, 3 * b + j] += moment[i]


@kernel(forceinline=True)
def add_damping(blocks, v, cells, touch, nodes, spins, functions, by_u):
    """Add what a contact has of −∂f/∂v, along the axes of the body; ``by_u (3, 3)`` is space to work in."""
    c, xi, pair, y = touch.c, touch.xi, touch.pair, touch.spot.y
    u, _, _ = slip_of(v, cells, c, nodes, spins, functions, pair, xi, y)
    by_velocity(pair, rubbed_by(touch), touch.spot.gradient, u, by_u)
    for b in range(nodes + 2 if spins else nodes + 1):
        part = share(b, nodes, functions, xi)[0] if b < nodes else -1.0
        for j in range(3):
            unit = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
            du = part * unit[0], part * unit[1], part * unit[2]
            if b > nodes:
                du = cross(y, angular(pair, spins, unit))
            change = dot(by_u[0], du), dot(by_u[1], du), dot(by_u[2], du)
            for i in range(3):
                for a in range(nodes):
                    value = share(a, nodes, functions, xi)[0]
                    blocks[c, 3 * a + i, 3 * b + j] -= value * change[i]
                blocks[c, 3 * nodes + i, 3 * b + j] += change[i]
            if spins:
                moment = turned_by(pair.planar, cross(y, change))
                for i in range(3):
                    blocks[c, 3 * nodes + 3 + i, 3 * b + j] += moment[i]


@kernel()
def add_row_sums(rates, slope, mass, cells, data, c, nodes, spins):
    """Add the row sums of the contacts of an element, with ∂F/∂y of at most ``slope`` each.

    Unknowns of the body are scaled as in `refweb.effects.contact.nearest_point.lightness`, and its rotation likewise.
    """
    pair = pair_of(data, c, nodes)
    delta, thick, b = lightness(mass, cells, c, nodes), thickness(pair.shape), cells[c, nodes]
    if spins == 2:
        thick = lever_of(data, c, nodes)
    slope *= 1.0 if nodes == 2 else float(nodes * nodes)
    near, all_of = 1.6, 3.0  # 1 + max W N of a node; both ends and one between
    if pair.once:
        near = all_of = 1.0
    spun = 0.0
    if spins and delta > 0.0:
        r = cells[c, nodes + 1]
        spun = min(delta * thick * math.sqrt(mass[b] / mass[r]), 1.0)
        rates[r] += all_of * slope * thick * thick * (1.0 + (1.0 + delta) / spun)
    for a in range(nodes):
        rates[cells[c, a]] += near * slope * (1.0 + delta + spun)
    if delta > 0.0:
        rates[b] += all_of * slope * (1.0 + (1.0 + spun) / delta)


@functools.cache
def kernels(depth, pieces, nodes, functions, spins):
    """Force, stiffness and its bound, and damping.

    Parameters
    ----------
    depth, pieces, nodes, functions
        See `refweb.effects.contact.penalty.kernels`.
    spins : int
        Number of rows behind the body in a cell that are its rotation: 1 or 2, see `refweb.net.rotation`, or 0.
    """
    rows, paired = nodes + (2 if spins else 1), pairing(spins)
    _, contacts, touch_of, limit = places(depth, spins, pieces, nodes, functions)
    depth_ahead = foresight(depth, spins, pieces, nodes, functions)

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        buffer = np.empty(limit * pieces, LINE_CONTACT)
        out[:] = 0.0
        for first in range(0, cells.shape[0], pieces):
            for n in range(contacts(x, cells, data, first, buffer)):
                touch = touch_of(x, cells, data, buffer, n)
                c, xi, pair, y = touch.c, touch.xi, touch.pair, touch.spot.y
                u, _, _ = slip_of(v, cells, c, nodes, spins, functions, pair, xi, y)
                friction = friction_force(pair, rubbed_by(touch), touch.spot.gradient, u)
                shows = record_at(TOUCH, out, c, 0)
                shows.value += dot(friction, u)
                turned = times_transposed(pair.axes, friction)
                for k in range(3):
                    for a in range(nodes):
                        f[cells[c, a], k] += share(a, nodes, functions, xi)[0] * turned[k]
                    f[cells[c, nodes], k] -= turned[k]
                    shows.force[k] -= turned[k]
                if spins:
                    moment = times_transposed(pair.axes, turned_by(pair.planar, cross(y, friction)))
                    for k in range(3):
                        f[cells[c, nodes + 1], k] -= moment[k]

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        buffer, z, q = np.empty(limit * pieces, LINE_CONTACT), np.empty((nodes + 1, 3)), np.empty((3, 3))
        by_y, by_u = np.empty((3, 3)), np.empty((3, 3))
        pushes, arms = np.empty((pieces, nodes, 3)), np.empty((nodes, 3))
        damped = np.empty_like(blocks if spins == 2 else blocks[:0])
        damped[:] = 0.0
        blocks[:] = 0.0
        for first in range(0, cells.shape[0] if not definite else 0, pieces):
            pushes[:] = 0.0
            for n in range(contacts(x, cells, data, first, buffer)):
                touch = touch_of(x, cells, data, buffer, n)
                place_moves(touch, touch.inner, nodes, functions, z)
                add_stiffness(blocks, v, cells, touch, nodes, spins, functions, z, by_y, by_u)
                if spins == 2:
                    pair, xi, y = touch.pair, touch.xi, touch.spot.y
                    u, _, _ = slip_of(v, cells, touch.c, nodes, spins, functions, pair, xi, y)
                    friction = friction_force(pair, rubbed_by(touch), touch.spot.gradient, u)
                    add_push(pushes[touch.c - first], 1.0, friction, xi, nodes, functions)
                    add_damping(damped, v, cells, touch, nodes, spins, functions, by_u)
            for c in range(first, first + pieces):
                axes = paired(x, cells, data, c, nodes).axes
                if spins == 2:
                    set_arms(x, cells, data, c, nodes, axes, arms)
                    add_rotation(blocks[c], pushes[c - first], arms, nodes)
                    add_velocities(blocks[c], damped[c], v, cells, c, nodes, axes)
                turn_block(blocks, c, rows, axes, q)
                if spins == 2:
                    to_quaternion(blocks[c], x, cells[c, nodes + 1], cells[c, nodes + 2], 3 * (nodes + 1))

    @kernel(STIFFNESS)
    def damping(t, x, v, blocks, cells, data, definite):
        buffer, q, by_u = np.empty(limit * pieces, LINE_CONTACT), np.empty((3, 3)), np.empty((3, 3))
        blocks[:] = 0.0
        for first in range(0, cells.shape[0], pieces):
            for n in range(contacts(x, cells, data, first, buffer)):
                touch = touch_of(x, cells, data, buffer, n)
                add_damping(blocks, v, cells, touch, nodes, spins, functions, by_u)
            for c in range(first, first + pieces):
                turn_block(blocks, c, rows, paired(x, cells, data, c, nodes).axes, q)

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            deep = depth_ahead(False, reach, speed, x, mass, cells, data, c).depth
            if deep > 0.0:
                pair = pair_of(data, c, nodes)
                limit = SHALLOW * pair.damping * speed * (1.0 + pair.friction) + pair.friction
                limit = limit * pair.stiffness * slope_of_power(pair.exponent, deep)
                add_row_sums(rates, limit, mass, cells, data, c, nodes, spins)

    return force, stiffness, bound, damping
