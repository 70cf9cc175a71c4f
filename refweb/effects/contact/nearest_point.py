"""Where a line touches a sphere.

A sphere touches a line once, at the line's point nearest its centre, however finely the line is divided.

`far` and `touched` are inlined wherever they stand: with the number of nodes known, a line out of reach costs 4 ns, as
calls 20 ns.

Data of a cell begin with the columns `RADIUS` to `AWAY`, and vectors from the centre to the cell's nodes in the web's
position; behind them stand, for `refweb.effects.contact.signed_distance`, the columns of `numbers`.
"""

from __future__ import annotations

import math

import numpy as np

from ...kernels import kernel
from ..vectors import dot

RADIUS, PENALTY, AWAY = 0, 1, 2
"""Columns of data: radius of a sphere around the body [m], stiffness of the penalty, first of the vectors."""
KIND, POWER, GROWTH, CORE, AXES, LOSS, FRICTION, SLIP = 0, 1, 2, 3, 6, 15, 16, 17
"""Columns behind the vectors: kind of the shape, exponent p, radius of growth and half sizes of the core [m], rows of
the axes, damping [s/m], coefficient of friction and the slip velocity of its regularisation [m/s]."""
SAMPLES = 8
"""Places on a curved element from which Newton's method may start to its nearest point."""


def numbers(body, cells, points, stiffness, exponent, damping, friction, slip_velocity):
    """Data of the contact of elements with a body, shape (cells, columns).

    Parameters
    ----------
    body : refweb.net.rigid_body.RigidBody
        The body.
    cells : ndarray of int, shape (cells, nodes)
        Rows along each element.
    points : ndarray, shape (rows, 3)
        Reference positions [m].
    stiffness, exponent, damping, friction, slip_velocity : float
        Of the penalty [N/m^p], [1], and of `refweb.effects.contact.friction`, [s/m], [1], [m/s].
    """
    away = (points[cells] - points[body.row]).reshape(len(cells), -1)
    tail = [body.kind, exponent, body.radius, *body.core, *np.ravel(body.axes), damping, friction, slip_velocity]
    head, tail = (np.tile(part, (len(cells), 1)) for part in ([body.extent, stiffness], tail))
    return np.column_stack([head, away, tail])


@kernel()
def point(x, cells, data, c, nodes, functions, place):
    """p, p' and p'' at a place of cell c, from the centre."""
    b = cells[c, nodes]
    p0 = p1 = p2 = d0 = d1 = d2 = e0 = e1 = e2 = 0.0
    for n in range(nodes - 1, -1, -1):
        c0 = c1 = c2 = 0.0
        for a in range(nodes):
            i, weight, at = cells[c, a], functions[n * nodes + a], AWAY + 3 * a
            c0 += weight * (data[c, at] + x[i, 0] - x[b, 0])
            c1 += weight * (data[c, at + 1] + x[i, 1] - x[b, 1])
            c2 += weight * (data[c, at + 2] + x[i, 2] - x[b, 2])
        e0, e1, e2 = e0 * place + 2.0 * d0, e1 * place + 2.0 * d1, e2 * place + 2.0 * d2
        d0, d1, d2 = d0 * place + p0, d1 * place + p1, d2 * place + p2
        p0, p1, p2 = p0 * place + c0, p1 * place + c1, p2 * place + c2
    return (p0, p1, p2), (d0, d1, d2), (e0, e1, e2)


@kernel()
def share(a, nodes, functions, place):
    """(N, N') of node a."""
    value = slope = 0.0
    for n in range(nodes - 1, -1, -1):
        slope = slope * place + value
        value = value * place + functions[n * nodes + a]
    return value, slope


@kernel()
def lightness(mass, cells, c, nodes):
    """√(lightest node/body), at most 1: scaling the unknowns of a body by it makes its share of a node's row small.

    Nodes without mass are supported and have no row; 0 for a body without one.
    """
    least, body = 0.0, mass[cells[c, nodes]]
    for a in range(nodes):
        own = mass[cells[c, a]]
        if own > 0.0 and (least == 0.0 or own < least):
            least = own
    return min(math.sqrt(least / body), 1.0) if body > 0.0 else 0.0


@kernel(forceinline=True)
def far(x, cells, data, c, nodes):
    """Whether the whole of cell c is certainly out of reach: its first node is, by more than twice its length."""
    b, first, length = cells[c, nodes], 0.0, 0.0
    for k in range(3):
        here = data[c, AWAY + k] + x[cells[c, 0], k] - x[b, k]
        first += here * here
    for a in range(1, nodes):
        line = 0.0
        for k in range(3):
            at = AWAY + 3 * a + k
            along = data[c, at] - data[c, at - 3] + x[cells[c, a], k] - x[cells[c, a - 1], k]
            line += along * along
        length = line if nodes == 2 else length + 2.0 * math.sqrt(line)
    if nodes > 2:
        length = length * length
    return first > 2.0 * (data[c, RADIUS] * data[c, RADIUS] + length)  # then |first| > radius + length


@kernel()
def closest(x, cells, data, c, nodes, functions):
    """(place of the point of cell c nearest the centre, its squared distance)."""
    place = 0.0
    if nodes == 2:
        p, d, _ = point(x, cells, data, c, nodes, functions, 0.0)
        square = dot(d, d)
        if square > 0.0:
            place = min(max(-dot(p, d) / square, 0.0), 1.0)
    else:
        best = math.inf
        for n in range(SAMPLES + 1):
            p, d, _ = point(x, cells, data, c, nodes, functions, n / SAMPLES)
            if dot(p, p) < best:
                best, place = dot(p, p), n / SAMPLES
        low, high = max(place - 1.0 / SAMPLES, 0.0), min(place + 1.0 / SAMPLES, 1.0)
        for _ in range(60):  # Newton on p·p', by bisection where it leaves the bracket
            p, d, e = point(x, cells, data, c, nodes, functions, place)
            slope, bent = dot(p, d), dot(d, d) + dot(p, e)
            if slope > 0.0:
                high = place
            else:
                low = place
            step = place - slope / bent if bent > 0.0 else -1.0
            if not low <= step <= high:
                step = 0.5 * (low + high)
            moved, place = abs(step - place), step
            if moved <= 1e-15:
                break
    p, _, _ = point(x, cells, data, c, nodes, functions, place)
    return place, dot(p, p)


@kernel(forceinline=True)
def touched(x, cells, data, first, pieces, nodes, functions):
    """(cell of a line's cells that is nearest the centre, place, squared distance); −1 where nothing touches."""
    nearest, where, best = -1, 0.0, math.inf
    for c in range(first, first + pieces):
        if not far(x, cells, data, c, nodes):
            place, square = closest(x, cells, data, c, nodes, functions)
            if square < best:
                nearest, where, best = c, place, square
    return (nearest if best < data[first, RADIUS] ** 2 else -1), where, best
