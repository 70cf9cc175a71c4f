"""Frictionless penalty contact of lines with rigid spheres.

The penalty acts once per line of the web, at the line's point nearest the centre: with its distance d and the radius R
the energy is ½ k (R − d)₊², shared by the nodes as the functions N of the element have it at that point. Contact is
thus the same however finely a line is divided. With p the vector from the centre to that point, ξ its place on the
element and m = ∂(p·p')/∂q, p' = ∂p/∂ξ, the Hessian of ½ d² is BᵀB − m mᵀ/(|p'|² + p·p'') while 0 < ξ < 1.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from ..compiled import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from ..inputs import InputError, Table, field, nearest, real
from . import Family

# Columns of data; behind them stand the vectors from the centre to the cell's nodes in the web's position.
RADIUS, PENALTY, AWAY = 0, 1, 2
SAMPLES = 8
"""Places on a curved element from which Newton's method may start to its nearest point."""


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
def shape(a, nodes, functions, place):
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
                out[c, 0] = 0.0
            c, place, square = touched(x, cells, data, first, pieces, nodes, functions)
            if c < 0 or square == 0.0:
                continue
            p, _, _ = point(x, cells, data, c, nodes, functions, place)
            distance = math.sqrt(square)
            push = data[c, PENALTY] * (data[c, RADIUS] - distance)
            out[c, 0] = push
            for k in range(3):
                pull = push * p[k] / distance
                for a in range(nodes):
                    f[cells[c, a], k] += shape(a, nodes, functions, place)[0] * pull
                f[cells[c, nodes], k] -= pull

    @kernel(ENERGY)
    def energy(t, x, cells, data, out):
        for first in range(0, cells.shape[0], pieces):
            for c in range(first, first + pieces):
                out[c] = 0.0
            c, _, square = touched(x, cells, data, first, pieces, nodes, functions)
            if c >= 0:
                depth = data[c, RADIUS] - math.sqrt(square)
                out[c] = 0.5 * data[c, PENALTY] * depth * depth

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        size = 3 * nodes + 3
        gradient, mixed, share = np.empty(size), np.empty(size), np.empty(nodes + 1)
        blocks[:] = 0.0
        for first in range(0, cells.shape[0], pieces):
            c, place, square = touched(x, cells, data, first, pieces, nodes, functions)
            if c < 0 or square == 0.0:
                continue
            p, d, e = point(x, cells, data, c, nodes, functions, place)
            distance, bent = math.sqrt(square), dot(d, d) + dot(p, e)
            for a in range(nodes + 1):
                value, slope = shape(a, nodes, functions, place) if a < nodes else (-1.0, 0.0)
                share[a] = value
                for k in range(3):
                    gradient[3 * a + k] = value * p[k] / distance
                    mixed[3 * a + k] = value * d[k] + slope * p[k]
            penalty = data[c, PENALTY]
            curved = 0.0 if definite else penalty * (data[c, RADIUS] - distance) / distance
            inside = 0.0 < place < 1.0
            for r in range(size):
                for s in range(size):
                    value = (penalty + curved) * gradient[r] * gradient[s]
                    if inside:
                        value += curved * mixed[r] * mixed[s] / bent
                    if r % 3 == s % 3:
                        value -= curved * share[r // 3] * share[s // 3]
                    blocks[c, r, s] = value

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        # Row sums of functions and of their slopes are larger on curved elements, by less than the square of nodes.
        scale = 1.0 if nodes == 2 else float(nodes * nodes)
        for first in range(0, cells.shape[0], pieces):
            before = most = 0.0
            b = cells[first, nodes]
            for c in range(first, first + pieces):
                place, square = closest(x, cells, data, c, nodes, functions)
                radius, penalty, distance = data[c, RADIUS], data[c, PENALTY], math.sqrt(square)
                if distance - radius >= reach:
                    before = 0.0
                    continue
                # Scaling the body's unknown by δ makes its share of a node's row small where the body is heavy. Nodes
                # without mass are supported and have no row.
                light = 0.0
                for a in range(nodes):
                    own = mass[cells[c, a]]
                    if own > 0.0 and (light == 0.0 or own < light):
                        light = own
                delta = min(math.sqrt(light / mass[b]), 1.0) if mass[b] > 0.0 else 0.0
                # The line turns under a push that slides along it, which adds by depth over length.
                turn = own = 0.0
                _, d, _ = point(x, cells, data, c, nodes, functions, place)
                length = math.sqrt(dot(d, d))
                if square < radius * radius and length > 0.0:
                    turn = scale * (radius - distance) / length
                    own = 2.0 * penalty * turn * (1.0 + distance / length)
                own = scale * (own + penalty * (1.0 + delta) * (1.0 + turn))
                # One piece of a line touches at a time: a node between two of them feels the larger.
                rates[cells[c, 0]] += max(own - before, 0.0)
                for a in range(1, nodes):
                    rates[cells[c, a]] += own
                before = own
                body = scale * penalty * (1.0 + turn) * (1.0 + 1.0 / delta if delta > 0.0 else 1.0)
                rates[b] += max(body - most, 0.0)
                most = max(most, body)
                # Nothing passes through between two steps: they are at most a tenth of the radius at half the bound.
                crossing = (10.0 * speed / radius) ** 2
                for a in range(nodes + 1):
                    rates[cells[c, a]] = max(rates[cells[c, a]], crossing * mass[cells[c, a]])

    return force, energy, stiffness, bound


@dataclass(frozen=True, kw_only=True)
class BodyContact(Table):
    """What differs for one body."""

    stiffness: float = real(above=0, unit="N/m")


def _bodies(name, value):
    if not isinstance(value, dict):
        raise InputError(f"{name} must be a table by body, [contact.bodies.NAME]")
    return {k: b if isinstance(b, BodyContact) else BodyContact.read(f"{name}.{k}", b) for k, b in value.items()}


@dataclass(frozen=True, kw_only=True)
class Contact(Table):
    """Contact of the web with all bodies.

    Parameters
    ----------
    stiffness : float
        Penalty stiffness of each line's contact [N/m].
    bodies : dict of str to BodyContact
        Stiffness that differs for a body.
    """

    stiffness: float = real(above=0, unit="N/m")
    bodies: dict = field(_bodies, factory=dict)

    def on(self, net):
        """The family of all pairs of a line and a body; ``out`` is the contact force [N]."""
        names = [body.name for body in net.bodies]
        if not names:
            raise InputError("there is no [[body]] that the web could touch: add one")
        for name in self.bodies:
            if name not in names:
                raise InputError(f'bodies."{name}" is no body, {nearest(name, names)}')
        along = net.cells[:, net.along]
        nodes = along.shape[1]
        functions = np.linalg.inv(np.vander(np.sort(net.places), increasing=True))
        force, energy, stiffness, bound = kernels(net.subdivide, nodes, tuple(functions.ravel().tolist()))
        cells, data = [], []
        for body in net.bodies:
            own = self.bodies.get(body.name, self).stiffness
            relative = (net.points[along] - net.points[body.row]).reshape(len(along), -1)
            cells.append(np.column_stack([along, np.full(len(along), body.row)]))
            data.append(np.column_stack([np.full((len(along), 2), (body.radius, own)), relative]))
        return Family(
            name="contact",
            cells=np.ascontiguousarray(np.vstack(cells), dtype=np.int32),
            data=np.ascontiguousarray(np.vstack(data)),
            force=force,
            energy=energy,
            stiffness=stiffness,
            bound=bound,
            book="contact_energy",
            observed=1,
            internal=True,
        )
