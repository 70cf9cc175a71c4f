"""Contact point of a line on a sphere.

A sphere has one contact with a line, at the line's point nearest its centre, for any number of elements.

`far` and `touched` are inlined: a line out of reach then costs 4 ns, and 20 ns with calls.

May change: `SAMPLES` upwards. Must stay: shape functions as a flat tuple, by power of ξ and then by node, as `table`
makes it; that `far` and `near` say no only where nothing can touch; what each function returns, as most files of this
folder call them. Another order of sums changes the last digits of all results with contact. Must stay as well: all
names that `sphere`, `friction` and other files import. Tests: ``tests/effects/test_contact.py``,
``tests/test_contract.py``.
"""

from __future__ import annotations

import functools
import math

from ...compiled.rows import record_at
from ...kernels import NEAR, kernel
from ...net.rotation import times
from ..vectors import dot
from .pair import AWAY, SPHERE, from_shape, pairing

SAMPLES = 8
"""Points of a curved element from which Newton's method may start to the nearest point."""


@kernel()
def point(x, cells, data, c, nodes, functions, xi):
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
        e0, e1, e2 = e0 * xi + 2.0 * d0, e1 * xi + 2.0 * d1, e2 * xi + 2.0 * d2
        d0, d1, d2 = d0 * xi + p0, d1 * xi + p1, d2 * xi + p2
        p0, p1, p2 = p0 * xi + c0, p1 * xi + c1, p2 * xi + c2
    return (p0, p1, p2), (d0, d1, d2), (e0, e1, e2)


@kernel()
def share(a, nodes, functions, xi):
    """(N, N') of node a."""
    value = slope = 0.0
    for n in range(nodes - 1, -1, -1):
        slope = slope * xi + value
        value = value * xi + functions[n * nodes + a]
    return value, slope


@kernel()
def lightness(mass, cells, c, nodes):
    """√(lightest node/body), at most 1: scaling the unknowns of a body by it makes its share of a node's row small.

    Nodes without mass are supported and have no row, or are carried by bodies; where all are it is 1. 0 for a body
    without mass.
    """
    lightest, body = 0.0, mass[cells[c, nodes]]
    for a in range(nodes):
        node_mass = mass[cells[c, a]]
        if node_mass > 0.0 and (lightest == 0.0 or node_mass < lightest):
            lightest = node_mass
    if not body > 0.0:
        return 0.0
    return min(math.sqrt(lightest / body), 1.0) if lightest > 0.0 else 1.0


@kernel(forceinline=True)
def far(x, cells, data, c, nodes):
    """Tell if the whole of cell c is certainly out of reach: its first node is, by more than twice its length."""
    b, first, length = cells[c, nodes], 0.0, 0.0
    for k in range(3):
        at = AWAY + k
        distance = data[c, at] + x[cells[c, 0], k] - x[b, k]
        first += distance * distance
    for a in range(1, nodes):
        line = 0.0
        for k in range(3):
            at = AWAY + 3 * a + k
            along = data[c, at] - data[c, at - 3] + x[cells[c, a], k] - x[cells[c, a - 1], k]
            line += along * along
        length = line if nodes == 2 else length + 2.0 * math.sqrt(line)
    if nodes > 2:
        length = length * length
    radius = record_at(SPHERE, data, c, 0).radius
    return first > 2.0 * (radius * radius + length)  # then |first| > radius + length


@kernel(forceinline=True)  # force and penetration check call it for each cell
def closest(x, cells, data, c, nodes, functions):
    """(place of the point of cell c nearest the centre, its squared distance)."""
    xi = 0.0
    if nodes == 2:
        p, d, _ = point(x, cells, data, c, nodes, functions, 0.0)
        square = dot(d, d)
        if square > 0.0:
            xi = min(max(-dot(p, d) / square, 0.0), 1.0)
    else:
        best = math.inf
        for n in range(SAMPLES + 1):
            p, d, _ = point(x, cells, data, c, nodes, functions, n / SAMPLES)
            if dot(p, p) < best:
                best, xi = dot(p, p), n / SAMPLES
        low, high = max(xi - 1.0 / SAMPLES, 0.0), min(xi + 1.0 / SAMPLES, 1.0)
        for _ in range(60):  # Newton on p·p', by bisection where it leaves the bracket
            p, d, e = point(x, cells, data, c, nodes, functions, xi)
            slope, curve = dot(p, d), dot(d, d) + dot(p, e)
            if slope > 0.0:
                high = xi
            else:
                low = xi
            step = xi - slope / curve if curve > 0.0 else -1.0
            if not low <= step <= high:
                step = 0.5 * (low + high)
            moved, xi = abs(step - xi), step
            if moved <= 1e-15:
                break
    p, _, _ = point(x, cells, data, c, nodes, functions, xi)
    return xi, dot(p, p)


@kernel(forceinline=True)
def touched(x, cells, data, first, pieces, nodes, functions):
    """(cell of a line's cells that is nearest the centre, place, squared distance); −1 where nothing touches."""
    nearest, where, best = -1, 0.0, math.inf
    for c in range(first, first + pieces):
        if not far(x, cells, data, c, nodes):
            xi, square = closest(x, cells, data, c, nodes, functions)
            if square < best:
                nearest, where, best = c, xi, square
    return (nearest if best < record_at(SPHERE, data, first, 0).radius ** 2 else -1), where, best


@kernel(forceinline=True)
def in_sphere(skin, x, cells, data, c, nodes, functions):
    """Tell if cell c may touch, within a skin, the sphere around its body."""
    reach = record_at(SPHERE, data, c, 0).radius + skin
    return not closest(x, cells, data, c, nodes, functions)[1] >= reach * reach


@functools.cache
def in_box(spins):
    """Kernel as `in_sphere`, for the sphere and the box around a body along its axes; spins as in `pairing`."""
    paired = pairing(spins)

    @kernel(forceinline=True)
    def in_box(skin, x, cells, data, c, nodes, functions):
        if not in_sphere(skin, x, cells, data, c, nodes, functions):
            return False
        middle, vector, _ = point(x, cells, data, c, nodes, functions, 0.5)
        pair, square, reach = paired(x, cells, data, c, nodes), 0.0, skin + 0.5 * math.sqrt(dot(vector, vector))
        middle = times(pair.axes, middle)
        if spins == 2:
            middle = from_shape(middle, data, c, nodes)
        for k in range(3):
            over = abs(middle[k]) - pair.shape.core[k] - pair.shape.radius
            square += over * over if over > 0.0 else 0.0
        return not square >= reach * reach

    return in_box


@functools.cache
def near(pieces, nodes, functions, within=in_sphere):
    """The kernel that finds the lines near bodies, of signature `refweb.kernels.NEAR`.

    A line is taken whole. ``within`` is `in_sphere`, or for elements with two nodes
    `refweb.effects.contact.contact_points.in_reach`; the other arguments are those of
    `refweb.effects.contact.sphere.kernels`.
    """

    @kernel(NEAR)
    def near(skin, x, cells, data, chosen):
        count = 0
        for first in range(0, cells.shape[0], pieces):
            beyond = True
            for c in range(first, first + pieces):
                beyond = beyond and not within(skin, x, cells, data, c, nodes, functions)
            if not beyond:  # what is not a number is near
                for c in range(first, first + pieces):
                    chosen[count] = c
                    count += 1
        return count

    return near
