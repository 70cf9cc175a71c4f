"""Penalty of contact with spheres, as compiled kernels.

The penalty acts once per line of the web, at the line's point nearest the centre of a sphere. With its distance d and
the radius R the energy is ½ k (R − d)₊². The shape functions N of the element distribute the force to the nodes.
Contact is thus the same for any number of elements. Let p be the vector from the centre to that point, ξ its coordinate
on the element, p' = ∂p/∂ξ, and m = ∂(p·p')/∂q. Then the Hessian of ½ d² is BᵀB − m mᵀ/(|p'|² + p·p'') while 0 < ξ < 1.

May change: how the bound is found, if it is not smaller. Must stay: one energy for force and stiffness; ``out`` as a
`TOUCH`; the order of sums, which decides the last digits of all impacts of balls; the order force, energy, stiffness,
bound, which `table` unpacks. `friction` finds the push of spheres by kernels of its own: a change of the law is made in
both. Tests: ``tests/test_contract.py``, ``tests/effects/test_contact.py``.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from ...compiled.rows import record_at
from ...kernels import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from ..base import CONTACT_COLUMNS, TOUCH
from ..vectors import dot
from .nearest_point import closest, lightness, point, share, touched
from .pair import SPHERE


@functools.cache
def kernels(pieces, nodes, functions):
    """Force, energy, stiffness and bound kernels.

    Parameters
    ----------
    pieces : int
        Elements per line: so many cells that follow each other share one contact.
    nodes : int
        Nodes per element.
    functions : tuple of float
        Coefficients of the element's functions, by power of ξ, then by node in the order along the line.
    """

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for first in range(0, cells.shape[0], pieces):
            for c in range(first, first + pieces):
                for k in range(CONTACT_COLUMNS):
                    out[c, k] = 0.0
            c, xi, square = touched(x, cells, data, first, pieces, nodes, functions)
            if c < 0:
                continue
            distance, ball, shows = math.sqrt(square), record_at(SPHERE, data, c, 0), record_at(TOUCH, out, c, 0)
            shows.value = ball.radius - distance
            if square == 0.0:
                continue
            p, _, _ = point(x, cells, data, c, nodes, functions, xi)
            push = ball.stiffness * shows.value
            for k in range(3):
                pull = push * p[k] / distance
                for a in range(nodes):
                    f[cells[c, a], k] += share(a, nodes, functions, xi)[0] * pull
                f[cells[c, nodes], k] -= pull
                shows.force[k] = -pull

    @kernel(ENERGY)
    def energy(t, x, cells, data, out):
        for first in range(0, cells.shape[0], pieces):
            for c in range(first, first + pieces):
                out[c] = 0.0
            c, _, square = touched(x, cells, data, first, pieces, nodes, functions)
            if c >= 0:
                ball = record_at(SPHERE, data, c, 0)
                depth = ball.radius - math.sqrt(square)
                out[c] = 0.5 * ball.stiffness * depth * depth

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        size = 3 * nodes + 3
        gradient, mixed, shares = np.empty(size), np.empty(size), np.empty(nodes + 1)
        blocks[:] = 0.0
        for first in range(0, cells.shape[0], pieces):
            c, xi, square = touched(x, cells, data, first, pieces, nodes, functions)
            if c < 0 or square == 0.0:
                continue
            p, d, e = point(x, cells, data, c, nodes, functions, xi)
            distance, curve = math.sqrt(square), dot(d, d) + dot(p, e)
            for a in range(nodes + 1):
                value, slope = share(a, nodes, functions, xi) if a < nodes else (-1.0, 0.0)
                shares[a] = value
                for k in range(3):
                    gradient[3 * a + k] = value * p[k] / distance
                    mixed[3 * a + k] = value * d[k] + slope * p[k]
            ball = record_at(SPHERE, data, c, 0)
            penalty = ball.stiffness
            curved = 0.0 if definite else penalty * (ball.radius - distance) / distance
            inside = 0.0 < xi < 1.0
            for r in range(size):
                for s in range(size):
                    value = (penalty + curved) * gradient[r] * gradient[s]
                    if inside:
                        value += curved * mixed[r] * mixed[s] / curve
                    if r % 3 == s % 3:
                        value -= curved * shares[r // 3] * shares[s // 3]
                    blocks[c, r, s] = value

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        # Row sums of functions and of their slopes are larger on curved elements, by less than the square of nodes.
        scale = 1.0 if nodes == 2 else float(nodes * nodes)
        for first in range(0, cells.shape[0], pieces):
            before = largest = 0.0
            b = cells[first, nodes]
            for c in range(first, first + pieces):
                xi, square = closest(x, cells, data, c, nodes, functions)
                ball, distance = record_at(SPHERE, data, c, 0), math.sqrt(square)
                radius, penalty = ball.radius, ball.stiffness
                if distance - radius >= reach:
                    before = 0.0
                    continue
                delta = lightness(mass, cells, c, nodes)
                # The line turns under a push that slides along it, which adds by depth over length.
                turn = own_rate = 0.0
                _, d, _ = point(x, cells, data, c, nodes, functions, xi)
                length = math.sqrt(dot(d, d))
                if square < radius * radius and length > 0.0:
                    turn = scale * (radius - distance) / length
                    own_rate = 2.0 * penalty * turn * (1.0 + distance / length)
                own_rate = scale * (own_rate + penalty * (1.0 + delta) * (1.0 + turn))
                # One piece of a line touches at a time: a node between two of them feels the larger.
                rates[cells[c, 0]] += max(own_rate - before, 0.0)
                for a in range(1, nodes):
                    rates[cells[c, a]] += own_rate
                before = own_rate
                body = scale * penalty * (1.0 + turn) * (1.0 + 1.0 / delta if delta > 0.0 else 1.0)
                rates[b] += max(body - largest, 0.0)
                largest = max(largest, body)
                # Nothing passes through between two steps: they are at most a tenth of the radius at half the bound.
                crossing = (10.0 * speed / radius) ** 2
                for a in range(nodes + 1):
                    rates[cells[c, a]] = max(rates[cells[c, a]], crossing * mass[cells[c, a]])

    return force, energy, stiffness, bound
