"""Penalty contact of lines with rigid bodies, with damping and friction where asked for.

The penalty acts once per line of the web, at the line's point nearest the centre of a sphere: with its distance d and
the radius R the energy is ½ k (R − d)₊², shared by the nodes as the functions N of the element have it at that point.
Contact is thus the same however finely a line is divided. With p the vector from the centre to that point, ξ its place
on the element and m = ∂(p·p')/∂q, p' = ∂p/∂ξ, the Hessian of ½ d² is BᵀB − m mᵀ/(|p'|² + p·p'') while 0 < ξ < 1.

The kernels here are those of spheres alone. Other shapes, which touch a line wherever it lies on them, and other
exponents are in `refweb.effects.contact.penalty`, damping and friction in `refweb.effects.contact.friction`.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np

from ...errors import InputError
from ...kernels import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from ...messages import nearest, shown
from ...net.shapes import SPHERE
from ...tables import Table, field, real
from ..base import Family
from ..vectors import dot
from .nearest_point import AWAY, PENALTY, RADIUS, closest, lightness, numbers, point, share, touched


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
                    f[cells[c, a], k] += share(a, nodes, functions, place)[0] * pull
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
        gradient, mixed, shares = np.empty(size), np.empty(size), np.empty(nodes + 1)
        blocks[:] = 0.0
        for first in range(0, cells.shape[0], pieces):
            c, place, square = touched(x, cells, data, first, pieces, nodes, functions)
            if c < 0 or square == 0.0:
                continue
            p, d, e = point(x, cells, data, c, nodes, functions, place)
            distance, bent = math.sqrt(square), dot(d, d) + dot(p, e)
            for a in range(nodes + 1):
                value, slope = share(a, nodes, functions, place) if a < nodes else (-1.0, 0.0)
                shares[a] = value
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
                        value -= curved * shares[r // 3] * shares[s // 3]
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
                delta = lightness(mass, cells, c, nodes)
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


def _exponent(name, value):
    if isinstance(value, bool) or value not in (1, 1.5):
        raise InputError(f"{name} = {shown(value)} must be 1 or 1.5")
    return float(value)


@dataclass(frozen=True, kw_only=True)
class BodyContact(Table):
    """What differs for one body; the keys are those of `Contact`."""

    stiffness: float | None = real(None, above=0, unit="N/m")
    exponent: float | None = field(_exponent, None)
    damping: float | None = real(None, at_least=0, unit="s/m")
    friction: float | None = real(None, at_least=0)
    slip_velocity: float | None = real(None, above=0, unit="m/s")


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
        Penalty k of each contact [N/m], or [N/m^1.5] with that exponent. A sphere touches a line once, other shapes
        each of its elements up to three times.
    exponent : {1, 1.5}
        p of the push k δ^p at the depth δ.
    damping : float
        d of Hunt and Crossley [s/m]: a push of k δ^p (1 + d δ̇), never a pull. A body that comes with a small velocity
        v is thrown back with 1 − 2/3 d v of it.
    friction : float
        Coefficient of friction μ. Free bodies that are spheres or rings are turned by it.
    slip_velocity : float
        Velocity of slip v_s [m/s] at which friction is 1/√2 of what it comes to; below, it is viscous. Steps of an
        explicit method are in proportion to it where friction rules them.
    bodies : dict of str to BodyContact
        What differs for a body.

    Raises
    ------
    InputError
        For a stiffness or a slip velocity that is not > 0, damping or friction < 0, and another exponent; from
        ``extend``, for a body that turns and has no friction; from ``on``, without a body, and for one of ``bodies``
        that is none.
    """

    stiffness: float = real(above=0, unit="N/m")
    exponent: float = field(_exponent, 1.0)
    damping: float = real(0.0, at_least=0, unit="s/m")
    friction: float = real(0.0, at_least=0)
    slip_velocity: float = real(1e-2, above=0, unit="m/s")
    bodies: dict = field(_bodies, factory=dict)

    def _of(self, body, key):
        own = getattr(self.bodies.get(body.name), key, None)
        return getattr(self, key) if own is None else own

    def extend(self, net):
        """The net with a row of rotation for each free body that friction turns."""
        turned = [body.name for body in net.bodies if not body.fixed and self._of(body, "friction") > 0.0]
        for body in net.bodies:
            if any(body.angular_velocity) and body.name not in turned:
                raise InputError(f'friction = 0 of body "{body.name}", which turns: friction > 0 alone feels it')
        rows = {name: len(net.points) + i for i, name in enumerate(turned)}
        return replace(
            net,
            points=np.vstack([net.points, np.zeros((len(turned), 3))]),
            mass=np.concatenate([net.mass, [body.inertia for body in net.bodies if body.name in turned]]),
            bodies=tuple(replace(body, spin=rows.get(body.name)) for body in net.bodies),
            spins=net.spins + len(turned),
        )

    def on(self, net):
        """The families of all pairs of a line and a body, of one kind each; ``out`` is the contact force [N], or the
        power of what is lost [W]."""
        names = [body.name for body in net.bodies]
        if not names:
            raise InputError("there is no [[body]] that the web could touch: add one")
        for name in self.bodies:
            if name not in names:
                raise InputError(f'bodies."{name}" is no body, {nearest(name, names)}')
        functions = np.linalg.inv(np.vander(np.sort(net.places), increasing=True))
        element = net.subdivide, net.order + 1, tuple(functions.ravel().tolist())
        pressed, rubbed = {}, {}
        for body in net.bodies:
            plain = body.kind == SPHERE and self._of(body, "exponent") == 1.0
            pressed.setdefault(plain, []).append(body)
            if self._of(body, "damping") > 0.0 or self._of(body, "friction") > 0.0:
                rubbed.setdefault(int(body.spin is not None), []).append(body)
        families = [self._pressed(net, element, plain, bodies) for plain, bodies in pressed.items()]
        return families + [self._rubbed(net, element, spins, bodies) for spins, bodies in rubbed.items()]

    def _numbers(self, net, bodies, spins=0):
        """Cells and data of every element with each of some bodies, ``spins`` of 1 with their rotations."""
        along = net.cells[:, net.along]
        keys = ("stiffness", "exponent", "damping", "friction", "slip_velocity")
        rows = [[body.row, body.spin][: 1 + spins] for body in bodies]
        cells = [np.hstack([along, np.tile(row, (len(along), 1))]) for row in rows]
        data = [numbers(body, along, net.points, *(self._of(body, key) for key in keys)) for body in bodies]
        return np.ascontiguousarray(np.vstack(cells), dtype=np.int32), np.ascontiguousarray(np.vstack(data))

    def _pressed(self, net, element, plain, bodies):
        make = kernels
        if not plain:
            from .penalty import kernels as make
        force, energy, stiffness, bound = make(*element)
        cells, data = self._numbers(net, bodies)
        return Family(
            name="contact",
            contact=True,
            cells=cells,
            data=np.ascontiguousarray(data[:, : AWAY + 3 * element[1]]) if plain else data,
            force=force,
            energy=energy,
            stiffness=stiffness,
            bound=bound,
            book="contact_energy",
            observed=1,
            internal=True,
        )

    def _rubbed(self, net, element, spins, bodies):
        from ..contact import friction as rubbing

        force, stiffness, bound, damping, damping_bound = rubbing.kernels(*element, spins)
        cells, data = self._numbers(net, bodies, spins)
        return Family(
            name="contact",
            contact=True,
            cells=cells,
            data=data,
            force=force,
            energy=None,
            stiffness=stiffness,
            bound=bound,
            book="dissipated_energy",
            observed=1,
            power=0,
            damping=damping,
            damping_bound=damping_bound,
            internal=True,
            symmetric=False,
            at_rest=False,
        )
