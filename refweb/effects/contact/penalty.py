"""Penalty of contact with a body of any shape, as compiled kernels.

Each contact, see `refweb.effects.contact.signed_distance`, has the energy k/(p + 1) W δ^(p + 1). Its place ξ is where
that is largest or an end of its element, so that the force is that of a fixed place. With the shares N of nodes, −1 of
the body, g = ∂δ/∂x and the matrix H = ∂²δ/∂x² at the place, and y' = dy/dξ of the line,

    stiffness of (a, b)    k W N_a N_b (p δ^(p−1) g⊗g + δ^p H) + c_a⊗∂ξ/∂x_b,
    c_a                    k δ^(p−1) [(W' δ + p W δ') N_a g + W δ (N_a H y' + N_a' g)].
"""

from __future__ import annotations

import functools
import math

import numpy as np

from ...kernels import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from ...net.shapes import SPHERE
from ..vectors import dot
from .nearest_point import AWAY, CORE, GROWTH, KIND, PENALTY, POWER, lightness, point, share
from .signed_distance import PLACES, bent, contacts, deepest, from_axes, moves, window, within

SHALLOW = 0.05
"""Share of the depth and of the rate of depth that a contact may come to which losses reckon with before it is there: a
step that has to do with more is iterated for longer, and the next bound knows the depth."""
SPREAD = 2.5
"""Bound on the row sums of the stiffness of an element's contacts, both ends and one between, over k p δ^(p − 1)."""


@kernel()
def raised(data, c, nodes, deep):
    """δ^p of a depth δ > 0, p being 1 or 1.5."""
    return deep if data[c, AWAY + 3 * nodes + POWER] == 1.0 else deep * math.sqrt(deep)


@kernel()
def lowered(data, c, nodes, deep):
    """p δ^(p − 1)."""
    return 1.0 if data[c, AWAY + 3 * nodes + POWER] == 1.0 else 1.5 * math.sqrt(deep)


@kernel()
def turn(blocks, c, rows, data, nodes, q):
    """Turn the block of cell c from the axes of its body; ``q (3, 3)`` is space to work in."""
    for r in range(0, 3 * rows, 3):
        for s in range(0, 3 * rows, 3):
            for i in range(3):
                row = blocks[c, r + i, s], blocks[c, r + i, s + 1], blocks[c, r + i, s + 2]
                q[i, 0], q[i, 1], q[i, 2] = from_axes(data, c, nodes, row)
            for j in range(3):
                column = from_axes(data, c, nodes, (q[0, j], q[1, j], q[2, j]))
                blocks[c, r, s + j], blocks[c, r + 1, s + j], blocks[c, r + 2, s + j] = column


@kernel()
def thickness(data, c, nodes):
    """Least distance from the middle of the body to its surface [m]."""
    at = AWAY + 3 * nodes
    return data[c, at + GROWTH] + min(data[c, at + CORE], data[c, at + CORE + 1], data[c, at + CORE + 2])


@kernel()
def foreseen(careful, reach, speed, x, mass, cells, data, c, nodes, functions):
    """(depth that a cell may come to [m], length of its slope there [m]); a depth of 0 where it stays out of reach.

    It goes no deeper than ``reach`` and the energy of what meets at this speed allow; unless ``careful``, only by
    `SHALLOW` of that, and not beyond twice the depth that it already has.
    """
    own, body = 0.0, mass[cells[c, nodes]]
    place, deep = deepest(x, cells, data, c, nodes, functions)
    first = within(x, cells, data, c, nodes, functions, 0.0)[3]
    last = within(x, cells, data, c, nodes, functions, 1.0)[3]
    _, d, _ = point(x, cells, data, c, nodes, functions, place)
    length = math.sqrt(dot(d, d))
    deep = max(deep, first, last)
    nearest = 0.5 * (first + last + length) if nodes == 2 else max(first, last) + float(nodes) * length
    if max(deep, nearest) + reach <= 0.0:
        return 0.0, length
    for a in range(nodes):
        own += mass[cells[c, a]]
    own = own * body / (own + body) if body > 0.0 else own
    more = min(0.5 * reach, thickness(data, c, nodes))
    if speed > 0.0:
        power = data[c, AWAY + 3 * nodes + POWER] + 1.0
        more = min(more, (0.5 * power * own * speed * speed / data[c, PENALTY]) ** (1.0 / power))
    if not careful:
        more = min(SHALLOW * more, deep if deep > 0.0 else math.inf)
    return max(deep, 0.0) + more, length


@functools.cache
def kernels(pieces, nodes, functions):
    """Force, energy, stiffness and bound kernels.

    Parameters
    ----------
    pieces : int
        Elements per line: so many cells follow each other.
    nodes : int
        Nodes per element.
    functions : tuple of float
        Coefficients of the element's functions, by power of ξ, then by node in the order along the line.
    """

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        found = np.empty((PLACES * pieces, 3))
        out[:, 0] = 0.0
        for first in range(0, cells.shape[0], pieces):
            for n in range(contacts(x, cells, data, first, pieces, nodes, functions, found)):
                c, place, inner = int(found[n, 0]), found[n, 1], found[n, 2] > 0.0
                _, _, _, deep, g, _ = within(x, cells, data, c, nodes, functions, place)
                push = data[c, PENALTY] * window(data, c, nodes, place, inner)[0] * raised(data, c, nodes, deep)
                out[c, 0] += push
                g = from_axes(data, c, nodes, g)
                for k in range(3):
                    for a in range(nodes):
                        f[cells[c, a], k] -= share(a, nodes, functions, place)[0] * push * g[k]
                    f[cells[c, nodes], k] += push * g[k]

    @kernel(ENERGY)
    def energy(t, x, cells, data, out):
        found = np.empty((PLACES * pieces, 3))
        out[:] = 0.0
        for first in range(0, cells.shape[0], pieces):
            for n in range(contacts(x, cells, data, first, pieces, nodes, functions, found)):
                c, place, inner = int(found[n, 0]), found[n, 1], found[n, 2] > 0.0
                deep = within(x, cells, data, c, nodes, functions, place)[3]
                stored = (
                    data[c, PENALTY] / (data[c, AWAY + 3 * nodes + POWER] + 1.0) * raised(data, c, nodes, deep) * deep
                )
                out[c] += window(data, c, nodes, place, inner)[0] * stored

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        found, z, q = np.empty((PLACES * pieces, 3)), np.empty((nodes + 1, 3)), np.empty((3, 3))
        blocks[:] = 0.0
        for first in range(0, cells.shape[0], pieces):
            for n in range(contacts(x, cells, data, first, pieces, nodes, functions, found)):
                c, place, inner = int(found[n, 0]), found[n, 1], found[n, 2] > 0.0
                _, d, e, deep, g, bend = within(x, cells, data, c, nodes, functions, place)
                moves(data, c, nodes, functions, place, inner and not definite, d, e, deep, g, bend, z)
                w, w1, _ = window(data, c, nodes, place, inner)
                steep = data[c, PENALTY] * w * lowered(data, c, nodes, deep)
                push = data[c, PENALTY] * raised(data, c, nodes, deep)
                across = w1 * push + steep * dot(g, d)
                turned, push = bent(bend, d), w * push
                matrix = ((bend[0], bend[1], bend[2]), (bend[1], bend[3], bend[4]), (bend[2], bend[4], bend[5]))
                for a in range(nodes + 1):
                    own, slope = share(a, nodes, functions, place) if a < nodes else (-1.0, 0.0)
                    for b in range(nodes + 1):
                        other = share(b, nodes, functions, place)[0] if b < nodes else -1.0
                        for i in range(3):
                            tilt = across * own * g[i] + push * (own * turned[i] + slope * g[i])
                            for j in range(3):
                                value = steep * g[i] * g[j] + (0.0 if definite else push * matrix[i][j])
                                blocks[c, 3 * a + i, 3 * b + j] += own * other * value + tilt * z[b, j]
            for c in range(first, first + pieces):
                turn(blocks, c, nodes + 1, data, nodes, q)

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        scale = 1.0 if nodes == 2 else float(nodes * nodes)  # curved elements: row sums of shares and of their slopes
        for c in range(cells.shape[0]):
            deep, length = foreseen(True, reach, speed, x, mass, cells, data, c, nodes, functions)
            if deep <= 0.0:
                continue
            steep = scale * data[c, PENALTY] * lowered(data, c, nodes, deep)
            delta = lightness(mass, cells, c, nodes)
            b, thick, own = cells[c, nodes], thickness(data, c, nodes), SPREAD * steep
            if data[c, AWAY + 3 * nodes + KIND] == SPHERE:  # a line turns under a push that slides along it
                tilt = scale * deep / length if length > 0.0 else 0.0
                own = steep * (1.0 + 3.0 * tilt + (2.0 * tilt * thick / length if length > 0.0 else 0.0))
            body = own * (1.0 + 1.0 / delta) if delta > 0.0 else own
            rates[b] = max(rates[b] + body, (10.0 * speed / thick) ** 2 * mass[b])
            for a in range(nodes):  # nothing passes through between two steps, of a tenth of the body at half the bound
                r = cells[c, a]
                rates[r] = max(rates[r] + own * (1.0 + delta), (10.0 * speed / thick) ** 2 * mass[r])

    return force, energy, stiffness, bound
