"""Frictionless penalty contact of lines with rigid spheres.

The penalty acts once per line, at the line's point nearest the centre: with its distance d and the radius R the energy
is ½ k (R − d)₊², shared by the line's ends as the point lies between them. With p the vector from the centre to that
point, ξ its place on the line and m = ∂(p·∂p/∂ξ)/∂q, the Hessian of ½ d² is BᵀB − m mᵀ/|∂p/∂ξ|² while 0 < ξ < 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..compiled import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from ..inputs import InputError, Table, field, nearest, real
from . import Family

# Columns of data; before them stand the vectors from the centre to the line's ends in the web's position.
RADIUS, PENALTY = 6, 7


@kernel()
def closest(x, cells, data, c):
    """(ends relative to the centre, place on the line, nearest point, its squared distance)."""
    i, j, b = cells[c, 0], cells[c, 1], cells[c, 2]
    a0 = data[c, 0] + x[i, 0] - x[b, 0]
    a1 = data[c, 1] + x[i, 1] - x[b, 1]
    a2 = data[c, 2] + x[i, 2] - x[b, 2]
    d0 = data[c, 3] + x[j, 0] - x[b, 0] - a0
    d1 = data[c, 4] + x[j, 1] - x[b, 1] - a1
    d2 = data[c, 5] + x[j, 2] - x[b, 2] - a2
    square = d0 * d0 + d1 * d1 + d2 * d2
    place = 0.0
    if square > 0.0:
        place = min(max(-(a0 * d0 + a1 * d1 + a2 * d2) / square, 0.0), 1.0)
    p0, p1, p2 = a0 + place * d0, a1 + place * d1, a2 + place * d2
    return (d0, d1, d2), place, (p0, p1, p2), p0 * p0 + p1 * p1 + p2 * p2


@kernel(FORCE)
def force(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        out[c, 0] = 0.0
        radius, i, j, b = data[c, RADIUS], cells[c, 0], cells[c, 1], cells[c, 2]
        start = line = 0.0
        for k in range(3):
            here = data[c, k] + x[i, k] - x[b, k]
            start += here * here
            along = data[c, 3 + k] + x[j, k] - x[b, k] - here
            line += along * along
        if start > 2.0 * (radius * radius + line):  # then |start| > radius + |line|: out of reach
            continue
        _, place, p, square = closest(x, cells, data, c)
        if square < radius * radius and square > 0.0:
            distance = math.sqrt(square)
            push = data[c, PENALTY] * (radius - distance)
            out[c, 0] = push
            for k in range(3):
                pull = push * p[k] / distance
                f[cells[c, 0], k] += (1.0 - place) * pull
                f[cells[c, 1], k] += place * pull
                f[cells[c, 2], k] -= pull


@kernel(ENERGY)
def energy(t, x, cells, data, out):
    for c in range(cells.shape[0]):
        square = closest(x, cells, data, c)[3]
        depth = max(data[c, RADIUS] - math.sqrt(square), 0.0)
        out[c] = 0.5 * data[c, PENALTY] * depth * depth


@kernel(STIFFNESS)
def stiffness(t, x, v, blocks, cells, data, definite):
    gradient, mixed, share = np.empty(9), np.empty(9), np.empty(3)
    for c in range(cells.shape[0]):
        blocks[c] = 0.0
        d, place, p, square = closest(x, cells, data, c)
        radius, penalty = data[c, RADIUS], data[c, PENALTY]
        if square >= radius * radius or square == 0.0:
            continue
        distance = math.sqrt(square)
        share[0], share[1], share[2] = 1.0 - place, place, -1.0
        length = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        inside = 0.0 < place < 1.0
        for k in range(3):
            for a in range(3):
                gradient[3 * a + k] = share[a] * p[k] / distance
            mixed[k] = (1.0 - place) * d[k] - p[k]
            mixed[3 + k] = place * d[k] + p[k]
            mixed[6 + k] = -d[k]
        curved = 0.0 if definite else penalty * (radius - distance) / distance
        for r in range(9):
            for s in range(9):
                value = (penalty + curved) * gradient[r] * gradient[s]
                if inside:
                    value += curved * mixed[r] * mixed[s] / length
                if r % 3 == s % 3:
                    value -= curved * share[r // 3] * share[s // 3]
                blocks[c, r, s] = value


@kernel(BOUND)
def bound(reach, speed, x, mass, rates, cells, data):
    for c in range(cells.shape[0]):
        d, _, _, square = closest(x, cells, data, c)
        radius, penalty, distance = data[c, RADIUS], data[c, PENALTY], math.sqrt(square)
        if distance - radius >= reach:
            continue
        i, j, b = cells[c, 0], cells[c, 1], cells[c, 2]
        # Scaling the body's unknown by δ makes its share of a node's row small where the body is heavy. Nodes without
        # mass are supported and have no row.
        light = min(mass[i], mass[j]) if min(mass[i], mass[j]) > 0.0 else max(mass[i], mass[j])
        delta = min(math.sqrt(light / mass[b]), 1.0) if mass[b] > 0.0 else 0.0
        # The line turns under a push that slides along it, which adds by depth over length.
        turn = own = 0.0
        if square < radius * radius and d[0] * d[0] + d[1] * d[1] + d[2] * d[2] > 0.0:
            length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            turn = (radius - distance) / length
            own = 2.0 * penalty * turn * (1.0 + distance / length)
        own += penalty * (1.0 + delta) * (1.0 + turn)
        rates[i] += own
        rates[j] += own
        rates[b] += penalty * (1.0 + turn) * (1.0 + 1.0 / delta if delta > 0.0 else 1.0)
        # Nothing passes through between two steps: they are at most a tenth of the radius at half the bound.
        crossing = (10.0 * speed / radius) ** 2
        for row in (i, j, b):
            rates[row] = max(rates[row], crossing * mass[row])


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
        cells, data = [], []
        for body in net.bodies:
            own = self.bodies.get(body.name, self).stiffness
            ends = net.cells[:, [0, -1]]
            centre = net.points[body.row]
            count = len(ends)
            cells.append(np.column_stack([ends, np.full(count, body.row)]))
            relative = [net.points[ends[:, 0]] - centre, net.points[ends[:, 1]] - centre]
            data.append(np.column_stack([*relative, np.full(count, body.radius), np.full(count, own)]))
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
