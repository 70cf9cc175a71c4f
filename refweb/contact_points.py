"""Where a line touches a rigid body.

A sphere touches a line once, at the line's point nearest its centre, however finely the line is divided.

A line that lies on a face, or along a ring or a cylinder, has no single nearest point: a force at the deepest one would
jump from end to end. These shapes touch each element at both ends and once in between, at the place ξ where
W(ξ) δ(ξ)^(p + 1) is largest, with the depth δ, the exponent p of the penalty and the window W = 4 ξ (1 − ξ). On a
straight element that is one place, since the roots of W and δ are concave; it never jumps, and fades out where it nears
an end, whose own contact takes over.

Data of a cell begin with the columns `RADIUS` to `AWAY`, and vectors from the centre to the cell's nodes in the web's
position; behind them stand, for a general shape, the columns of `numbers`.
"""

from __future__ import annotations

import math

import numpy as np

from .compiled import kernel
from .shapes import SPHERE, depth

RADIUS, PENALTY, AWAY = 0, 1, 2
"""Columns of data: radius of a sphere around the body [m], stiffness of the penalty, first of the vectors."""
KIND, POWER, GROWTH, CORE, AXES, LOSS, FRICTION, SLIP = 0, 1, 2, 3, 6, 15, 16, 17
"""Columns behind the vectors: kind of the shape, exponent p, radius of growth and half sizes of the core [m], rows of
the axes, damping [s/m], coefficient of friction and the slip velocity of its regularisation [m/s]."""
SAMPLES = 8
"""Places on a curved element from which Newton's method may start to its nearest point."""
PLACES = 3
"""Largest number of contacts of an element."""


def numbers(body, cells, points, stiffness, exponent, damping, friction, slip_velocity):
    """Data of the contact of elements with a body, shape (cells, columns).

    Parameters
    ----------
    body : refweb.bodies.RigidBody
        The body.
    cells : ndarray of int, shape (cells, nodes)
        Rows along each element.
    points : ndarray, shape (rows, 3)
        Reference positions [m].
    stiffness, exponent, damping, friction, slip_velocity : float
        Of the penalty [N/m^p], [1], and of `refweb.rubbing`, [s/m], [1], [m/s].
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
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel()
def share(a, nodes, functions, place):
    """(N, N') of node a."""
    value = slope = 0.0
    for n in range(nodes - 1, -1, -1):
        slope = slope * place + value
        value = value * place + functions[n * nodes + a]
    return value, slope


@kernel()
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


# The plain sphere


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


@kernel()
def touched(x, cells, data, first, pieces, nodes, functions):
    """(cell of a line's cells that is nearest the centre, place, squared distance); −1 where nothing touches."""
    nearest, where, best = -1, 0.0, math.inf
    for c in range(first, first + pieces):
        if not far(x, cells, data, c, nodes):
            place, square = closest(x, cells, data, c, nodes, functions)
            if square < best:
                nearest, where, best = c, place, square
    return (nearest if best < data[first, RADIUS] ** 2 else -1), where, best


# Any shape


@kernel()
def along_axes(data, c, nodes, p):
    """A vector's components along the axes of the body."""
    at = AWAY + 3 * nodes + AXES
    return (
        data[c, at] * p[0] + data[c, at + 1] * p[1] + data[c, at + 2] * p[2],
        data[c, at + 3] * p[0] + data[c, at + 4] * p[1] + data[c, at + 5] * p[2],
        data[c, at + 6] * p[0] + data[c, at + 7] * p[1] + data[c, at + 8] * p[2],
    )


@kernel()
def from_axes(data, c, nodes, q):
    """The vector of components along the axes of the body."""
    at = AWAY + 3 * nodes + AXES
    return (
        data[c, at] * q[0] + data[c, at + 3] * q[1] + data[c, at + 6] * q[2],
        data[c, at + 1] * q[0] + data[c, at + 4] * q[1] + data[c, at + 7] * q[2],
        data[c, at + 2] * q[0] + data[c, at + 5] * q[1] + data[c, at + 8] * q[2],
    )


@kernel()
def within(x, cells, data, c, nodes, functions, place):
    """p, p', p'' along the body's axes at a place of cell c, then depth, its gradient and its Hessian."""
    p, d, e = point(x, cells, data, c, nodes, functions, place)
    p, d, e = along_axes(data, c, nodes, p), along_axes(data, c, nodes, d), along_axes(data, c, nodes, e)
    at = AWAY + 3 * nodes
    core = data[c, at + CORE], data[c, at + CORE + 1], data[c, at + CORE + 2]
    deep, g, bend = depth(int(data[c, at + KIND]), p[0], p[1], p[2], data[c, at + GROWTH], core[0], core[1], core[2])
    return p, d, e, deep, g, bend


@kernel()
def bent(bend, p):
    """Product of a Hessian and a vector."""
    return (
        bend[0] * p[0] + bend[1] * p[1] + bend[2] * p[2],
        bend[1] * p[0] + bend[3] * p[1] + bend[4] * p[2],
        bend[2] * p[0] + bend[4] * p[1] + bend[5] * p[2],
    )


@kernel()
def window(data, c, nodes, place, inner):
    """(W, W', W'') of a contact; 1 at an end, and of a sphere."""
    if not inner or data[c, AWAY + 3 * nodes + KIND] == SPHERE:
        return 1.0, 0.0, 0.0
    return 4.0 * place * (1.0 - place), 4.0 - 8.0 * place, -8.0


@kernel()
def rise(data, c, nodes, place, d, e, deep, g, bend):
    """What vanishes at the deepest place of an element, positive before it, and its slope.

    W' δ + (p + 1) W δ', or where nothing is touched δ'; of a sphere the rate of −½ |w|², which is linear.
    """
    at, slope, curve = AWAY + 3 * nodes, dot(g, d), dot(d, bent(bend, d)) + dot(g, e)
    if data[c, at + KIND] == SPHERE:
        away = data[c, at + GROWTH] - deep
        return away * slope, away * curve - slope * slope
    if deep <= 0.0:
        return slope, curve
    power, (w, w1, w2) = data[c, at + POWER], window(data, c, nodes, place, True)
    return w1 * deep + (power + 1.0) * w * slope, w2 * deep + (power + 2.0) * w1 * slope + (power + 1.0) * w * curve


@kernel()
def deepest(x, cells, data, c, nodes, functions):
    """(place within cell c, depth there) of the contact between its ends; of a sphere, that with the whole of it."""
    low, high, place, at = 0.0, 1.0, 0.5, AWAY + 3 * nodes
    if nodes > 2:
        most = -math.inf
        for n in range(SAMPLES + 1):
            deep = within(x, cells, data, c, nodes, functions, n / SAMPLES)[3]
            faded = window(data, c, nodes, n / SAMPLES, True)[0] ** (1.0 / (data[c, at + POWER] + 1.0))
            if (felt := faded * deep if deep > 0.0 else deep) > most:
                most, place = felt, n / SAMPLES
        low, high = max(place - 1.0 / SAMPLES, 0.0), min(place + 1.0 / SAMPLES, 1.0)
    if data[c, at + KIND] == SPHERE:
        for end in (low, high):
            _, d, _, deep, g, _ = within(x, cells, data, c, nodes, functions, end)
            if (end == 0.0 and dot(g, d) <= 0.0) or (end == 1.0 and dot(g, d) >= 0.0):
                return end, deep
    for _ in range(100):  # Newton's method, by bisection where it leaves the bracket
        _, d, e, deep, g, bend = within(x, cells, data, c, nodes, functions, place)
        slope = dot(g, d)
        if nodes == 2 and deep + max(slope * (high - place), slope * (low - place)) <= 0.0:
            return place, deep  # concave: nowhere deep enough
        value, curve = rise(data, c, nodes, place, d, e, deep, g, bend)
        if value > 0.0:
            low = place
        else:
            high = place
        step = place - value / curve if curve < 0.0 else -1.0
        if not low <= step <= high:
            step = 0.5 * (low + high)
        moved, place = abs(step - place), step
        if moved <= 1e-15:
            break
    return place, within(x, cells, data, c, nodes, functions, place)[3]


@kernel()
def contacts(x, cells, data, first, pieces, nodes, functions, found):
    """Write (cell, place, whether the place may move) of each contact of a line to ``found``; return their number."""
    count, best = 0, 0.0
    for c in range(first, first + pieces):
        if far(x, cells, data, c, nodes):
            continue
        place, deep = deepest(x, cells, data, c, nodes, functions)
        inner = 0.0 < place < 1.0
        if data[c, AWAY + 3 * nodes + KIND] == SPHERE:
            if deep > best:
                best, count = deep, 1
                found[0, 0], found[0, 1], found[0, 2] = c, place, inner
            continue
        if deep > 0.0 and inner:
            found[count, 0], found[count, 1], found[count, 2] = c, place, 1.0
            count += 1
        for end in range(2):
            if within(x, cells, data, c, nodes, functions, float(end))[3] > 0.0:
                found[count, 0], found[count, 1], found[count, 2] = c, end, 0.0
                count += 1
    return count


@kernel()
def moves(data, c, nodes, functions, place, inner, d, e, deep, g, bend, z):
    """Write by how much the place of a contact moves with each node, along the body's axes, to ``z (nodes + 1, 3)``.

    The last row is of the body; all are zero unless ``inner``.
    """
    z[:] = 0.0
    curve = rise(data, c, nodes, place, d, e, deep, g, bend)[1]
    if not inner or not curve < 0.0:
        return
    (w, w1, _), at, turned = window(data, c, nodes, place, True), AWAY + 3 * nodes, bent(bend, d)
    own = (data[c, at + POWER] + 1.0) * w if data[c, at + KIND] != SPHERE else data[c, at + GROWTH] - deep
    for a in range(nodes + 1):
        value, slope = share(a, nodes, functions, place) if a < nodes else (-1.0, 0.0)
        for k in range(3):
            z[a, k] = -(w1 * value * g[k] + own * (value * turned[k] + slope * g[k])) / curve
