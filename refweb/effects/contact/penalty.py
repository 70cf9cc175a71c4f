"""Penalty of contact with a body of any shape, as compiled kernels.

Each contact, see `refweb.effects.contact.contact_points`, has the energy k/(p + 1) W δ^(p + 1). Its ξ is a maximum of
this energy or an end of its element, so that the force is that of a fixed ξ. With the shape functions N of nodes, −1
for the body, g = ∂δ/∂x and the matrix H = ∂²δ/∂x² at the contact point, and y' = dy/dξ of the line,

    stiffness of (a, b)    k W N_a N_b (p δ^(p−1) g⊗g + δ^p H) + c_a⊗∂ξ/∂x_b,
    c_a                    k δ^(p−1) [(W' δ + p W δ') N_a g + W δ (N_a H y' + N_a' g)].

A rotating body has the moment y × F of its push F about its centre, with y from the centre to the line's point.
`refweb.effects.contact.rotational_stiffness` has the stiffness of this moment.

May change: `SPREAD`, `HOLLOW` and `SHALLOW` upwards alone, since bounds (those of `friction` and `body_body_penalty`,
too) may be too large and never too small. Must stay: layout of ``cells`` and ``data``, which is that of `pair`; the
order force, energy, stiffness, bound, which `table` unpacks; the helpers that `friction`, `line_body_ccd`,
`line_body_friction` and `body_body_penalty` import. Force and stiffness follow from the energy. Tests:
``tests/test_contract.py``, ``tests/results/test_contact_force.py``.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np

from ...compiled.rows import record_at
from ...kernels import BOUND, ENERGY, FORCE, STIFFNESS, Indices, Matrix, Vector, kernel
from ...net.rotation import times_transposed, to_quaternion
from ..base import CONTACT_COLUMNS, TOUCH
from ..vectors import cross, dot
from .contact_points import along, hessian_times, place_moves, places, reaching, window
from .nearest_point import lightness, point, share
from .pair import LINE_CONTACT, lever_of, pair_of, pairing, power_of_depth
from .rotational_stiffness import add_moments, add_push, add_rotation, set_arms

SHALLOW = 0.05
"""Share of the possible depth and rate of depth of a contact that the bound of losses includes in advance. If a step
has more, it takes more iterations, and the next bound knows the depth."""
SPREAD = 2.5
"""Bound on the row sums of the stiffness of an element's contacts, both ends and one between, over k p δ^(p − 1)."""
HOLLOW = 2.0
"""Factor on this bound for a body that is not convex: curvature of hollow parts adds δ ∂²δ/∂x² ≤ 1."""


@kernel()
def slope_of_power(exponent, deep):
    """p δ^(p − 1)."""
    return 1.0 if exponent == 1.0 else 1.5 * math.sqrt(deep)


@kernel(forceinline=True)
def push_of(touch):
    """k W δ^p of a contact [N], less than 0 of a minimum."""
    pair = touch.pair
    faded = touch.weight * pair.stiffness * window(pair.once, touch.xi, touch.inner)[0]
    return faded * power_of_depth(pair.exponent, touch.spot.depth)


@kernel(forceinline=True)
def rubbed_by(touch):
    """k W δ^p that losses go by [N], see `refweb.effects.contact.nonconvex_contacts`."""
    pair = touch.pair
    faded = touch.share * pair.stiffness * window(pair.once, touch.xi, touch.inner)[0]
    return faded * power_of_depth(pair.exponent, touch.spot.depth)


@kernel()
def turn_block(blocks, c, rows, axes, q):
    """Turn the block of cell c from the axes of its body; ``q (3, 3)`` is space to work in."""
    for r in range(0, 3 * rows, 3):
        for s in range(0, 3 * rows, 3):
            for i in range(3):
                row = blocks[c, r + i, s], blocks[c, r + i, s + 1], blocks[c, r + i, s + 2]
                q[i, 0], q[i, 1], q[i, 2] = times_transposed(axes, row)
            for j in range(3):
                column = times_transposed(axes, (q[0, j], q[1, j], q[2, j]))
                blocks[c, r, s + j], blocks[c, r + 1, s + j], blocks[c, r + 2, s + j] = column


@kernel()
def thickness(shape):
    """Least distance from the middle of the body to its surface [m]."""
    return shape.thick if shape.thick > 0.0 else shape.radius + min(shape.core[0], shape.core[1], shape.core[2])


class Foreseen(NamedTuple):
    """Largest stiffness and depth of an element before it has moved by a reach.

    Attributes
    ----------
    depth : float
        Depth that it may come to [m]; 0 where it stays out of reach. Where stiffness does not depend on depth, that of
        the middle of the body stands for any: to find it takes most of the time of a bound.
    length : float
        |y'| at the deepest place [m], 0 where stiffness depends on neither.
    """

    depth: float
    length: float


@functools.cache
def foresight(depth, spins, pieces, nodes, functions):
    """Kernel ``(careful, reach, speed, x, mass, cells, data, c)`` of what is `Foreseen` of a cell.

    It goes no deeper than ``reach`` and the energy of what meets at this speed allow; unless ``careful``, only by
    `SHALLOW` of that, and not beyond twice the depth that it already has. Arguments are those of
    `refweb.effects.contact.contact_points.places`.
    """
    deepest = places(depth, spins, pieces, nodes, functions).deepest
    (course_of, spot_of), reaches = along(depth, spins, nodes, functions), reaching(depth, spins)

    @kernel(apart=())
    def depth_ahead(
        careful: bool, reach: float, speed: float, x: Matrix, mass: Vector, cells: Indices, data: Matrix, c: int
    ) -> Foreseen:
        reduced_mass, body, pair = 0.0, mass[cells[c, nodes]], pair_of(data, c, nodes)
        course = course_of(x, cells, data, c)
        first = spot_of(x, cells, data, c, course, 0.0).depth
        constant = nodes == 2 and reach > 0.0 and pair.exponent == 1.0 and not pair.once
        if constant and first + reach > 0.0:
            return Foreseen(thickness(pair.shape), 0.0)
        last = spot_of(x, cells, data, c, course, 1.0).depth
        if nodes == 2 and 0.5 * (first + last + math.sqrt(dot(course.d, course.d))) + reach <= 0.0:
            return Foreseen(0.0, 0.0)
        if constant:
            touches = last + reach > 0.0 or reaches(reach, x, cells, data, c, nodes, functions)
            return Foreseen(thickness(pair.shape) if touches else 0.0, 0.0)
        xi, deep = deepest(x, cells, data, c)
        _, d, _ = point(x, cells, data, c, nodes, functions, xi)
        length = math.sqrt(dot(d, d))
        deep = max(deep, first, last)
        nearest = 0.5 * (first + last + length) if nodes == 2 else max(first, last) + float(nodes) * length
        if max(deep, nearest) + reach <= 0.0 or nodes == 2 and not reaches(reach, x, cells, data, c, nodes, functions):
            return Foreseen(0.0, length)
        for a in range(nodes):
            reduced_mass += mass[cells[c, a]]
        reduced_mass = reduced_mass * body / (reduced_mass + body) if body > 0.0 else reduced_mass
        more = min(0.5 * reach, thickness(pair.shape))
        if speed > 0.0:
            power = pair.exponent + 1.0
            more = min(more, (0.5 * power * reduced_mass * speed * speed / pair.stiffness) ** (1.0 / power))
        if not careful:
            more = min(SHALLOW * more, deep if deep > 0.0 else math.inf)
        return Foreseen(max(deep, 0.0) + more, length)

    return depth_ahead


@kernel(forceinline=True)
def add_stiffness(blocks, touch, definite, nodes, functions, z):
    """Add what a contact has of the stiffness, along the axes of the body; ``z`` is what `place_moves` writes."""
    c, xi, pair, spot = touch.c, touch.xi, touch.pair, touch.spot
    deep, d, g, h = spot.depth, spot.d, spot.gradient, spot.hessian
    w, w1, _ = window(pair.once, xi, touch.inner)
    steep = touch.weight * pair.stiffness * w * slope_of_power(pair.exponent, deep)
    push = touch.weight * pair.stiffness * power_of_depth(pair.exponent, deep)
    across = w1 * push + steep * dot(g, d)
    turned, push = hessian_times(h, d), w * push
    matrix = ((h[0], h[1], h[2]), (h[1], h[3], h[4]), (h[2], h[4], h[5]))
    for a in range(nodes + 1):
        weight_a, slope = share(a, nodes, functions, xi) if a < nodes else (-1.0, 0.0)
        for b in range(nodes + 1):
            weight_b = share(b, nodes, functions, xi)[0] if b < nodes else -1.0
            for i in range(3):
                tilt = across * weight_a * g[i] + push * (weight_a * turned[i] + slope * g[i])
                for j in range(3):
                    value = steep * g[i] * g[j] + (0.0 if definite else push * matrix[i][j])
                    blocks[c, 3 * a + i, 3 * b + j] += weight_a * weight_b * value + tilt * z[b, j]


@kernel(forceinline=True)
def add_row_sums(rates, ahead, speed, mass, cells, data, c, nodes, spins):
    """Add the row sums of the stiffness of an element's contacts; nothing passes through between two steps.

    In a step of half the bound, rows move by a tenth of the thickness of the body at most. A body that turns has a
    rotation among its unknowns, of the lever that its light ends make of its moment of inertia; it is scaled as the
    body is.
    """
    scale = 1.0 if nodes == 2 else float(nodes * nodes)  # curved elements: row sums of shares and of their slopes
    deep, length, pair = ahead.depth, ahead.length, pair_of(data, c, nodes)
    steep = scale * pair.stiffness * slope_of_power(pair.exponent, deep)
    delta = lightness(mass, cells, c, nodes)
    b, thick, steepest = cells[c, nodes], thickness(pair.shape), SPREAD * steep
    if 0.0 < pair.shape.fine < math.inf:
        steepest *= HOLLOW
    if pair.once:  # a line turns under a push that slides along it
        tilt = scale * deep / length if length > 0.0 else 0.0
        steepest = steep * (1.0 + 3.0 * tilt + (2.0 * tilt * thick / length if length > 0.0 else 0.0))
    spun = 0.0
    if spins and delta > 0.0:
        r, arm = cells[c, nodes + 1], lever_of(data, c, nodes)
        spun = min(delta * arm * math.sqrt(mass[b] / mass[r]), 1.0)
        rates[r] += steepest * arm * arm * (1.0 + (1.0 + delta) / spun)
    body = steepest * (1.0 + (1.0 + spun) / delta) if delta > 0.0 else steepest
    rates[b] = max(rates[b] + body, (10.0 * speed / thick) ** 2 * mass[b])
    for a in range(nodes):
        r = cells[c, a]
        rates[r] = max(rates[r] + steepest * (1.0 + delta + spun), (10.0 * speed / thick) ** 2 * mass[r])


@functools.cache
def kernels(depth, pieces, nodes, functions, spins=0):
    """Force, energy, stiffness and bound kernels.

    Parameters
    ----------
    depth : kernel
        Depth in the bodies, as `refweb.net.grown_core.depth`.
    pieces : int
        Elements per line: so many cells follow each other.
    nodes : int
        Nodes per element.
    functions : tuple of float
        Coefficients of the element's functions, by power of ξ, then by node in the order along the line.
    spins : int
        2 where the last rows of a cell are those of the rotation of the body, else 0.
    """
    arity, paired = nodes + 1 + spins, pairing(spins)
    _, contacts, touch_of, limit = places(depth, spins, pieces, nodes, functions)
    depth_ahead = foresight(depth, spins, pieces, nodes, functions)

    # Behind a TOUCH, ``out`` may have the place of the contact between the ends, 0 without one, and which ends touch, 1
    # for the first and 2 for the last: `line_body_friction` then need not search for them again.
    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        buffer = np.empty(limit * pieces, LINE_CONTACT)
        out[:] = 0.0
        for first in range(0, cells.shape[0], pieces):
            for n in range(contacts(x, cells, data, first, buffer)):
                touch = touch_of(x, cells, data, buffer, n)
                c, push = touch.c, push_of(touch)
                shows = record_at(TOUCH, out, c, 0)
                shows.value = max(shows.value, touch.spot.depth)
                if out.shape[1] > CONTACT_COLUMNS:
                    if touch.inner:
                        out[c, CONTACT_COLUMNS] = touch.xi
                    else:
                        out[c, CONTACT_COLUMNS + 1] += 1.0 if touch.xi < 0.5 else 2.0
                g = times_transposed(touch.pair.axes, touch.spot.gradient)
                for k in range(3):
                    for a in range(nodes):
                        f[cells[c, a], k] -= share(a, nodes, functions, touch.xi)[0] * push * g[k]
                    f[cells[c, nodes], k] += push * g[k]
                    shows.force[k] += push * g[k]
                if spins:
                    moment = times_transposed(touch.pair.axes, cross(touch.spot.y, touch.spot.gradient))
                    for k in range(3):
                        f[cells[c, nodes + 1], k] += push * moment[k]

    @kernel(ENERGY)
    def energy(t, x, cells, data, out):
        buffer = np.empty(limit * pieces, LINE_CONTACT)
        out[:] = 0.0
        for first in range(0, cells.shape[0], pieces):
            for n in range(contacts(x, cells, data, first, buffer)):
                touch = touch_of(x, cells, data, buffer, n)
                pair, deep = touch.pair, touch.spot.depth
                stored = pair.stiffness / (pair.exponent + 1.0) * power_of_depth(pair.exponent, deep) * deep
                out[touch.c] += touch.weight * window(pair.once, touch.xi, touch.inner)[0] * stored

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        buffer, z, q = np.empty(limit * pieces, LINE_CONTACT), np.empty((nodes + 1, 3)), np.empty((3, 3))
        pushes, arms, turning = np.empty((pieces, nodes, 3)), np.empty((nodes, 3)), spins > 0 and not definite
        blocks[:] = 0.0
        for first in range(0, cells.shape[0], pieces):
            pushes[:] = 0.0
            for n in range(contacts(x, cells, data, first, buffer)):
                touch = touch_of(x, cells, data, buffer, n)
                if definite and touch.weight < 0.0:
                    continue
                place_moves(touch, touch.inner and not definite, nodes, functions, z)
                add_stiffness(blocks, touch, definite, nodes, functions, z)
                if turning:
                    add_push(pushes[touch.c - first], -push_of(touch), touch.spot.gradient, touch.xi, nodes, functions)
            for c in range(first, first + pieces):
                axes = paired(x, cells, data, c, nodes).axes
                if turning:
                    set_arms(x, cells, data, c, nodes, axes, arms)
                    add_moments(blocks[c], pushes[c - first], arms, nodes)
                    add_rotation(blocks[c], pushes[c - first], arms, nodes)
                turn_block(blocks, c, arity - (1 if spins else 0), axes, q)
                if turning:
                    to_quaternion(blocks[c], x, cells[c, nodes + 1], cells[c, nodes + 2], 3 * (nodes + 1))

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            ahead = depth_ahead(True, reach, speed, x, mass, cells, data, c)
            if ahead.depth > 0.0:
                add_row_sums(rates, ahead, speed, mass, cells, data, c, nodes, spins)

    return force, energy, stiffness, bound
