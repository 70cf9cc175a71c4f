"""Allowed penetration of lines into bodies, and the stiffness of contact that keeps it.

A penalty lets lines in, and a weak one lets them through. The overlap is compared with the size of the body: the radius
of a sphere, of a ring in its plane, or the smallest edge or diameter of another shape. If it is above `SHARE` of this
size, the contact is not that with a rigid body. A line deeper than `CORE` of the distance to the middle counts as
passed through, since its push may change to the other side.

The push k δ^p stores k δ^(p + 1)/(p + 1). A body with the energy E stops at δ if k = (p + 1) E/δ^(p + 1); a force F is
in balance at δ if k = F/δ^p, if nothing else yields. Hence a sufficient stiffness follows from a computed overlap,
which is proportional to k^(−1/(p + 1)) for a given energy, and to k^(−1/p) for a given force.

The window W of a contact between the ends of an element, see `refweb.effects.contact.contact_points`, makes it softer
near the ends. A body penetrates deeper there, so that it is pushed along the line towards the ends. Let a force N press
a body by δ into the middle of a straight chain of elements of length L, with the radius r of the surface of the body
along the chain. Energies along the chain differ by 0.145 N (δ² L²/r)^⅓, within a quarter for all δ/L from 5e-4 to 0.05
and r/L from 0.05 to 5. Therefore contact pushes along a line, in alternating directions, by `ALONG` (δ²/(L r))^⅓ of
each push on average. Other laws have these factors on it:

=====================================================================  ==================================
laws, at r = L/4                                                       δ/L = 5e-4, 5e-3, 5e-2
=====================================================================  ==================================
lines in 4 pieces                                                      0.37, 0.36, 0.45
lines in 16 pieces                                                     0.14, 0.14, 0.013
the deepest place of each element alone, which jumps along a face      0.09, 0.19, 0.43
one for all lines at a node in place of their ends, with (1 − 2 ξ)²     0.006, 0.036, 0.17
∫ δ² ds along all lines, which is another law of depth, of power 1.5   0
=====================================================================  ==================================

A line that turns by an angle θ round an edge with r θ < 2 L is pushed along by θ/4 (1 − r θ/(2 L))² of the push on
average, whatever the stiffness, see `refweb.effects.contact.sharp_edges`.

May change: private functions and messages. Of the constants `SHARE`, `AIM`, `STIFFER`, `DEEPER` and `MOST_TIMES` decide
which stiffness is chosen or refused, so that results of scenes without one move; `ROUGH`, `NOTED` and `TOLD` only when
a finding comes; `ALONG` is measured. Must stay: keys of `Deepest.plain`, which stand in ``run.json``; the stiffness in
the `PenetrationError` of `too_soft`, with which `runner` runs again; `CORE`, which `line_body_ccd`, `pair_overlap` and
`statics.body_penetration` use; rows of `kept_edges`, which checkpoints keep; all names that `pair_overlap`, `scene` and
other files import; public names of `Deepest` and `Overlaps`, which other files use. Tests:
``tests/effects/test_overlap.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ...errors import InputError, PenetrationError, SolverError
from ...findings import Finding
from ...net.rigid_body import RigidBody
from ..base import pairs_of

SHARE = 0.1
"""Allowed overlap, over the size of the body."""
CORE = 0.5
"""Overlap at which a line is in the core, over the distance from the middle of the body to its surface."""
ROUGH = 0.1
"""Error of a surface over an overlap above which a finding reports it; below, soft contact moves results more."""
AIM = 0.2
"""Overlap for which a stiffness is chosen, over the allowed overlap: this is 2 % of the size of the body.

For a net of 16 × 16 cells that is thrown at a box of 500 kg, this takes as many steps as 0.8, whose contact is 16 times
softer; 0.1 takes 2.4 times as many."""
NOTED = 1.0 / 30.0
"""Overlap over the size of the body above which a finding reports it, since results may depend on it."""
STIFFER = 25.0
"""Factor on a stiffness that is chosen again in dynamics: the energy of the allowed overlap then leads to `AIM` of it.
The present overlap tells less, since it may still be growing."""
DEEPER = 1.1
"""Factor on the overlap at the start up to which the stiffness is not the cause of a deeper overlap."""
ALONG, TOLD = 0.29, 0.05
"""Push along a line over that of its contact and (δ²/(L r))^⅓; share of the push above which a finding reports it, if
friction is smaller."""
MOST_TIMES = 200
"""Largest number of times at which loads and motions are evaluated."""


def size_of(body):
    """Size of a body for the comparison with an overlap [m]; infinite for ground."""
    return body.thickness * (1.0 if body.shape.once or body.shape.planar else 2.0)


def allowed(body):
    """Overlap that is allowed [m]."""
    return SHARE * size_of(body)


def allowed_in(net, body):
    """Allowed overlap of a body of a net [m]; ground counts as a body of the size of the shortest line."""
    return min(allowed(body), SHARE * float(net.natural_length.min())) if body.shape.ground else allowed(body)


def aim(net, body):
    """Overlap for which a stiffness is chosen [m]."""
    return AIM * allowed_in(net, body)


def rounded_up(value):
    """A number of two digits that is not smaller."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit * (1.0 - 1e-12)) * unit:.1e}")


def too_soft(deepest, where, limit, names):
    """The `PenetrationError` for a contact deeper than ``limit`` [m], whose stiffness refweb chose for some bodies."""
    factor = STIFFER * deepest.stiffness
    stiffer = rounded_up(factor if deepest.moving else max(deepest.enough, factor))
    return PenetrationError(
        f"{where} with stiffness = {deepest.stiffness:g}, {limit:.3g} m are allowed; repeated with stiffness = "
        f"{stiffer:g}",
        dict.fromkeys(names, stiffer),
    )


def push_along(body, overlap, length):
    """Largest average push along elements of a length [m], over the push of the contact.

    It is that of the smallest radius of curvature of the body; 0 for a sphere, which touches a line once.
    """
    if body.shape.once or not overlap > 0.0:
        return 0.0
    return min(ALONG * (overlap**2 / (length * (body.radius or body.thickness))) ** (1.0 / 3.0), 1.0)


@dataclass(frozen=True)
class Deepest:
    """The deepest contact of lines with a body, or of two bodies.

    Attributes
    ----------
    bodies : tuple of refweb.net.rigid_body.RigidBody
        The body, or both.
    overlap : float
        Depth [m], 0 where nothing has touched.
    time : float
        Time [s]; in statics the load step.
    stiffness, exponent : float
        k [N/m^p] and p of their contact.
    chosen : tuple of str
        Names of those whose stiffness is refweb's choice.
    smallest : float
        Stiffness that their energy, or what pushes, asks for at the start [N/m^p].
    initial : float
        Overlap at t = 0 [m], which no stiffness changes.
    allowed : float
        Overlap that is allowed [m].
    moving : bool
        True if they come with energy, in dynamics, and are not pushed.
    fixed : bool
        True if it is deeper than allowed, and neither the line nor the body is free to give way.
    """

    bodies: tuple[RigidBody, ...]
    overlap: float
    time: float
    stiffness: float
    exponent: float
    chosen: tuple[Any, ...]
    smallest: float
    initial: float
    allowed: float
    moving: bool = True
    fixed: bool = False

    @property
    def thickness(self):
        """Least distance from a middle to its surface [m]."""
        return min(body.thickness for body in self.bodies)

    @property
    def instant(self):
        """Time or load step of the overlap, a text."""
        return f"t = {self.time:.6g} s" if self.moving else f"load step {self.time:g}"

    @property
    def too_deep(self):
        """True if the overlap is not allowed."""
        return self.overlap > self.allowed

    @property
    def at_start(self):
        """True if the overlap is deepest at the start."""
        return self.moving and self.overlap <= self.initial

    @property
    def in_core(self):
        """True if the line, or a body, is in the core."""
        return self.overlap > CORE * self.thickness

    @property
    def enough(self):
        """Sufficient stiffness [N/m^p]: it leads to `AIM` of the allowed overlap.

        In the core the depth tells little: there it is at least the stiffness for the energy at the start.
        """
        share = self.overlap / (AIM * self.allowed)
        factor = self.stiffness * share ** (self.exponent + self.moving)
        return rounded_up(max(factor, self.smallest) if self.in_core else factor)

    def plain(self):
        """Convert to values for ``run.json``."""
        allowed = self.allowed if math.isfinite(self.allowed) else None
        when = self.time if self.overlap > 0.0 else None
        return {"overlap": self.overlap, "time": when, "allowed": allowed, "stiffness": self.stiffness}

    def refuse(self):
        """Refuse what is in the core, and a choice that was too soft.

        Raises
        ------
        PenetrationError
            Where refweb chose the stiffness and the overlap is not allowed.
        SolverError
            Where a line or a body is in the core.
        """
        if self.in_core and self.at_start:
            raise SolverError(self._at_start_text)
        if self.chosen and not self.fixed and self.too_deep and self.overlap > DEEPER * self.initial:
            raise too_soft(self, self._where, self.allowed, self.chosen)
        if self.in_core:
            raise SolverError(self._in_core_text)

    _where: ClassVar[Any]
    _at_start_text: ClassVar[Any]
    _in_core_text: ClassVar[Any]


@dataclass(frozen=True)
class DeepestLine(Deepest):
    """The deepest contact of a body with lines, and the ``line``."""

    line: int | None = None

    @property
    def body(self):
        """The body."""
        return self.bodies[0]

    def plain(self):
        """Convert to values for ``run.json``."""
        values = super().plain() | {"line": self.line, "chosen": bool(self.chosen)}
        return values | ({"surface_error": error} if (error := self.body.shape.error) is not None else {})

    @property
    def _percent(self):
        """Overlap in per cent of the size of the body."""
        return 100.0 * self.overlap * SHARE / self.allowed

    @property
    def _size(self):
        return "the shortest line" if self.body.shape.ground else "its size"

    @property
    def _depth(self):
        return f'{self.overlap:.3g} m deep in body "{self.body.name}" at {self.instant}'

    @property
    def _where(self):
        return f"line {self.line} is {self._depth}"

    @property
    def _at_start_text(self):
        return f"line {self.line} starts in the core of a body, {self._depth}: move the body or the web"

    @property
    def _in_core_text(self):
        return (
            f"line {self.line} passes the core of a body: it is {self._depth}, whose middle is {self.thickness:.3g} m "
            f"below its surface; {self._remedy()}"
        )

    def remarks(self, what="the web"):
        """Findings on the contact; ``what`` is the text for all objects that it might have touched."""
        if self.overlap <= 0.0:
            yield Finding(
                "never-touched", f'body "{self.body.name}" never touches {what}, though there is a [contact]', "contact"
            )
        elif self.too_deep:
            remedy = "there it starts" if self.at_start else self._remedy()
            text = f"line {self.line} is up to {self._depth}, {self._percent:.3g} % of {self._size}; {remedy}"
            yield Finding("deep-contact", text, "contact")
        elif self.overlap > max(NOTED * self.allowed / SHARE, DEEPER * self.initial) and not self.fixed:
            text = f"line {self.line} is up to {self._depth}, {self._percent:.2g} % of {self._size}: results may "
            text += f"move with the stiffness of contact; {self.enough:g} holds it to {100.0 * AIM * SHARE:g} %, and "
            yield Finding("soft-contact", text + "refweb trust says by how much", "contact")

    def _remedy(self):
        if self.fixed:
            return "all its nodes and the body are held or moved as prescribed, and no stiffness keeps them apart"
        return (
            f"stiffness = {self.enough:g} should be enough in place of {self.stiffness:g}, or leave it out "
            f"(the overlap falls with k to the power 1/{self.exponent + self.moving:g})"
        )


class Overlaps:
    """The deepest contacts of all bodies of a system so far.

    Parameters
    ----------
    scene : refweb.Scene
        Scene with a stiffness for each body; refweb chose those of ``scene.chosen``.
    system : refweb.system.system.System
        That of the scene.
    moving : bool
        True in dynamics, where bodies have energy; False in statics, where they are pushed.
    pairs : refweb.effects.contact.pair_overlap.PairOverlaps, optional
        Contacts of bodies with bodies, if there are any.

    Attributes
    ----------
    edges : dict of str to refweb.effects.contact.sharp_edges.Edge
        Edges of bodies by name that are sharp for the elements: in the last equilibrium, or in any frame.
    """

    def __init__(self, scene, system, moving, pairs=None):
        self.system, self._chosen, self._moving = system, scene.chosen, moving
        self._contact, self.edges = scene.contact, {}
        self._initial = [0.0] * len(system.net.bodies)
        self._laws = [scene.contact.law_of(body) for body in system.net.bodies]
        self._load_steps = getattr(scene.solve, "load_steps", ())
        self.deepest = [self._deepest(i, 0.0, 0.0, None) for i in range(len(self.bodies))]
        self.pairs = pairs

    @property
    def bodies(self):
        """The bodies, in their order."""
        return self.system.net.bodies

    def _deepest(self, i, overlap, time, line):
        body, (stiffness, exponent), smallest = self.bodies[i], self._laws[i], 0.0
        if overlap > CORE * body.thickness:
            smallest = first_stiffness(self.system, body, exponent, self._load_steps)
        if self._moving and time == 0.0:
            self._initial[i] = overlap
        net, unmoved = self.system.net, self.system.fixed
        limit, chosen = allowed_in(net, body), (body.name,) if body.name in self._chosen else ()
        fixed_pair = overlap > limit and bool(unmoved[[body.row, *net.cells[net.line == line].ravel()]].all())
        law, more = (stiffness, exponent, chosen, smallest, self._initial[i], limit), (self._moving, fixed_pair, line)
        return DeepestLine((body,), overlap, time, *law, *more)

    def stiffness_of(self, body):
        """Stiffness of the contact of a body [N/m^p]."""
        return self._laws[self.bodies.index(body)][0]

    def record(self, i, overlap, time, line):
        """Note the deepest overlap [m] of body ``i``, its time [s] and its line, if it is deeper than before."""
        if overlap > self.deepest[i].overlap:
            self.deepest[i] = self._deepest(i, overlap, time, line)

    def note_edge(self, body, state, overlap):
        """Note the edge of a body that is sharp for the elements in a state, where its share is the largest so far."""
        if body.shape.once or not overlap.any():
            return
        from .sharp_edges import sharpest_edge

        known = self.edges.get(body.name)
        edge = sharpest_edge(state, body, overlap, known.share if known else TOLD)
        if edge is not None:
            self.edges[body.name] = edge

    def kept_edges(self):
        """Edges for a checkpoint, an array of shape (edges, 5): number of the body and the numbers of its `Edge`."""
        numbers = {body.name: i for i, body in enumerate(self.bodies)}
        return np.array([[numbers[name], *edge] for name, edge in self.edges.items()]).reshape(-1, 5)

    def restore_edges(self, rows):
        """Take the edges of a checkpoint."""
        from .sharp_edges import Edge

        for number, line, *edge in rows.tolist():
            self.edges[self.bodies[int(number)].name] = Edge(int(line), *edge)

    def refuse(self):
        """Refuse what may not be, see `Deepest.refuse`."""
        for deepest in self.deepest:
            deepest.refuse()
        if self.pairs is not None:
            self.pairs.refuse()

    def plain(self):
        """Convert to values for ``run.json``, by name."""
        return {deepest.body.name: deepest.plain() for deepest in self.deepest}

    def _pushed_along(self, deepest):
        """Remark on pushes along lines, see `push_along`."""
        net, body = self.system.net, deepest.body
        if deepest.line is None:
            return
        if (edge := self.edges.get(body.name)) is not None and edge.share > self._contact.friction_of(body):
            yield _at_an_edge(body, edge)
            return
        length = float(net.natural_length[net.line == deepest.line].max())
        share = push_along(body, deepest.overlap, length)
        if share > max(TOLD, self._contact.friction_of(body)):
            yield Finding(
                "push-along-lines",
                f'body "{body.name}" is up to {deepest.overlap:.3g} m deep in elements of {length:.3g} m: where it '
                f"slides along one, contact may push it forth and back by {100.0 * share:.2g} % of each push on "
                "average, to which no ± is open; a larger stiffness or subdivide makes that less",
                "contact",
            )

    def remarks(self):
        """Remarks for a reader of the results."""
        elsewhere = self.pairs.touched if self.pairs is not None else ()
        what = "the web" if self.pairs is None else "anything"
        for deepest in self.deepest:
            if deepest.overlap > 0.0 or deepest.body.name not in elsewhere:
                yield from deepest.remarks(what)
            yield from self._pushed_along(deepest)
            yield from _off_surface(deepest)
        if self.pairs is not None:
            yield from self.pairs.remarks()


def _off_surface(deepest):
    """Finding on a surface that is not known to a small share of the overlap, which ± does not contain."""
    error, overlap = deepest.body.shape.error or 0.0, deepest.overlap
    if error > ROUGH * overlap > 0.0:
        yield Finding(
            "surface",
            f'the surface of body "{deepest.body.name}" is that of its file within {error:.2g} m, '
            f"{100.0 * error / overlap:.2g} % of its deepest overlap with lines: results may be off as if it were "
            "shifted by that, which is no part of ±; a larger grid makes it less",
            "body",
        )


def _at_an_edge(body, edge):
    """Finding on a push along a line at a sharp edge, see `refweb.effects.contact.sharp_edges`."""
    enough = edge.enough(TOLD)
    key = next((key for key in ("rounding", "radius") if hasattr(body.shape, key)), None)
    needed = rounded_up(enough * edge.length)
    larger = "" if key is None or needed > size_of(body) else f"a {key} of at least {needed:.2g} m, or "
    return Finding(
        "push-along-lines",
        f'line {edge.line} turns by {math.degrees(edge.angle):.3g}° at an edge of body "{body.name}" with a radius of '
        f"{edge.radius:.3g} m, which is sharp for elements of {edge.length:.3g} m: contact may push along the line by "
        f"{100.0 * edge.share:.2g} % of its push on average, by where nodes are, to which no ± is open and which does "
        f"not fall with the stiffness; {larger}elements of at most {edge.radius / enough:.2g} m make that less than "
        f"{100.0 * TOLD:g} %",
        "contact",
    )


def first_stiffness(system, body, exponent, load_steps=()):
    """Stiffness of contact that a scene asks for before it is solved [N/m^p].

    It is that of `AIM` of the allowed overlap under the energy ½ μ v² that is there between the web and the body, with
    that by which a body tumbles, and under what pushes them. v is the speed of the body and the free node nearest to it
    towards each other, with what they gain under outer forces until they meet, and that of prescribed motion. μ is the
    mass of the body if the web has supports, else the reduced mass of both; for a body that is fixed or moved by tables
    it is that of all free nodes. The push is the resultant of outer forces on the body, or, for such a one, on the web.
    Statics knows no energy: there contact is at least as stiff as the stiffest line, which costs no steps; so it is, as
    the softest line, where nothing moves and nothing pushes. The ``system`` has any stiffness, ``exponent`` is p.

    Raises
    ------
    InputError
        For a body without end, whose size says nothing of an overlap.
    """
    net, deep = system.net, aim(system.net, body)
    if not math.isfinite(deep):
        raise InputError(f'stiffness is missing for body "{body.name}", whose size is infinite: give stiffness = ...')
    lines = net.axial / (net.natural_length * exponent * deep ** (exponent - 1.0))
    push = max(_push(system, body, t) for t in (*load_steps, *_times(system)))
    asked = push / deep**exponent
    if net.quasi_static:
        return rounded_up(max(asked, float(lines.max())))
    asked = max(asked, (exponent + 1.0) * _energy(system, body) / deep ** (exponent + 1.0))
    if pairs := [pair for pair in pairs_of(system) if body in pair]:
        asked = max([asked, *(first_between(system, pair, exponent) for pair in pairs)])
    return rounded_up(asked if asked > 0.0 else float(lines.min()))


def first_between(system, bodies, exponent):
    """Stiffness of contact between two bodies that a scene asks for before it is solved [N/m^p].

    It is that of `AIM` of the allowed overlap under the energy ½ μ v² of both with the
    energy by which they turn, and under the outer forces on all bodies that are free. v is their speed at the start
    with what they gain under outer forces until they meet.
    """
    net, deep = system.net, min(aim(system.net, body) for body in bodies)
    if not math.isfinite(deep):
        named = " and ".join(f'"{body.name}"' for body in bodies)
        raise InputError(f"stiffness is missing for bodies {named}, whose size is infinite: give stiffness = ...")
    v, force = system.initial_velocity(), np.where(system.supported, 0.0, system.outer_force(0.0))
    free = [body for body in bodies if not body.prescribed]
    mass = 1.0 / sum(1.0 / net.mass[body.row] for body in free)
    falls = [np.zeros(3) if body.prescribed else force[body.row] / net.mass[body.row] for body in bodies]
    first, second = sorted(bodies, key=lambda body: not body.shape.ground)
    gap = _distances(net, first, net.points[[second.row]])[0] - sum(map(_reach, bodies))
    square = float(((v[bodies[0].row] - v[bodies[1].row]) ** 2).sum())
    square += 2.0 * float(np.linalg.norm(falls[0] - falls[1])) * max(float(gap), 0.0)
    turning = sum(_turning(body, v) for body in free)
    push = sum(float(np.linalg.norm(force[body.row])) for body in net.bodies if not body.prescribed)
    stored = (exponent + 1.0) * (0.5 * mass * square + turning)
    return max(push / deep**exponent, stored / deep ** (exponent + 1.0))


def _times(system):
    """Times at which loads are looked at [s]: the start, corners of tables, and between them."""
    corners = np.concatenate([[0.0], np.asarray(system.corners, dtype=float)])
    corners = corners[:: max(len(corners) // (MOST_TIMES // 2), 1)]
    return np.unique(np.concatenate([corners, 0.5 * (corners[1:] + corners[:-1])])).tolist()


def _push(system, body, t):
    """Resultant of outer forces on a body that is free, or on the free nodes [N]."""
    force = np.where(system.supported, 0.0, system.outer_force(t))
    return float(np.linalg.norm(force[: system.net.nodes].sum(axis=0) if body.prescribed else force[body.row]))


def _distances(net, body, points):
    """Distances of points (n, 3) from the middle of a body, or from ground [m], shape (n,)."""
    away = points - net.points[body.row]
    if not body.shape.ground:
        return np.linalg.norm(away, axis=1)
    depth, grown = body.shape.depth(), body.shape.grown()
    return np.array([-depth(tuple(p), grown)[0] for p in (away @ body.axes.T).tolist()])


def _reach(body):
    """Distance at which a body is touched, of those of `_distances` [m]."""
    return 0.0 if body.shape.ground else body.thickness


def _energy(system, body):
    """½ μ v² of a web and a body that meet, and the energy by which that turns [J], see `first_stiffness`."""
    net, nodes = system.net, system.net.nodes
    fixed = system.supported[:nodes]
    free = np.flatnonzero(~fixed.all(axis=1))
    if not len(free):
        free = np.arange(nodes)
    web, body_mass = float(net.mass[free].sum()), float(net.mass[body.row])
    v = system.initial_velocity()
    distance, speed = _distances(net, body, net.points[free]), np.linalg.norm(v[free] - v[body.row], axis=1)
    nearest = int(distance.argmin())
    v0 = float(speed[nearest]) if speed[nearest] > 0.0 else float(speed.max())
    fastest = 0.0
    for t in _times(system) if system.drives else ():
        driven = np.zeros_like(v)
        system.drive(t, np.zeros_like(v), driven)
        fastest = max(fastest, float(np.linalg.norm(driven[: system.rows - net.spins], axis=1).max()))
    force = np.where(system.supported, 0.0, system.outer_force(0.0))
    falls = np.zeros(3) if body.prescribed else force[body.row] / body_mass
    carried = fixed.any() and not body.prescribed
    along = np.zeros(3) if carried or not web > 0.0 else force[free].sum(axis=0) / web
    gained = 2.0 * float(np.linalg.norm(falls - along)) * max(float(distance[nearest]) - _reach(body), 0.0)
    mass = web if body.prescribed else body_mass if fixed.any() else body_mass * web / (body_mass + web)
    return 0.5 * mass * ((v0 + fastest) ** 2 + gained) + _turning(body, v)


def _turning(body, v):
    """Energy by which a body tumbles at the start [J]."""
    return 0.0 if body.turn is None else 0.5 * body.moment * float(v[body.spin] @ body.turning(np.zeros_like(v), v))
