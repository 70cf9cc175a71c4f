"""Penetration check of lines with lines, and a stiffness that is sufficient.

Lines pass if their centre lines meet. All methods check the motion of every pair, see
`refweb.effects.self_contact.line_line_ccd`. Explicit methods do so before each drift, in which nodes move in straight
lines; CVODE and IDA use their interpolants. If no two centre lines have met since the start of a run, it is proven that
no line has passed. The change from the initial web to a folded start is not checked.

Two elements that share a node do not push each other, nor do those within two radii of each other along the net. They
are checked as well: the first two that fold flat onto each other, or meet, are reported. Other elements that pass
because of them are found by their own pairs.

An overlap above r is refused: from there on the push falls.

May change: `AIM`, `STIFFER` (which stiffness is chosen) and messages. Must stay: `HELD` and `POWER`, which follow from
the energy of `line_line_penalty`; texts of `status`, `PRESCRIBED` among them, and keys of ``plain``, which stand in
``run.json``; the stiffness in the `PenetrationError`, with which `runner` runs again; `would_pass`, `lines_of`,
`pressed` and `first_stiffness`, which `integrators`, `statics` and `scene` call; `Passage`, which `commands.console`,
`dynamics.simulation` and `statics.line_penetration` import. Tests: ``tests/effects/test_self_contact.py``.
"""

from __future__ import annotations

import math

import numpy as np

from ...errors import PenetrationError, SolverError
from ...findings import Finding

AIM = 0.8
"""Overlap for which a stiffness is proposed, over the radius."""
STIFFER = 4.0
"""Factor on a stiffness that is chosen again: the present overlap tells little, since it may still be growing."""
POWER = 2.5
"""Power of the overlap to which the energy of crossing lines is proportional."""
PRESCRIBED = "the motion of both is prescribed, and no stiffness of [self_contact] holds them"
"""Text for lines that prescribed motions move through each other."""
HELD = 16.0 / 15.0 * (4.0 - (2.0 - AIM) ** 2) ** POWER / (8.0 * math.sqrt(12.0))
"""Energy of crossing lines that overlap by `AIM` of the radius, over k r²."""


def pressed(system):
    """Number of the term of lines against lines of a system; None if there is none."""
    numbers = (i for i, term in enumerate(system.terms) if term.contact.crossing is not None)
    return next(numbers, None)


def lines_of(net, nodes):
    """ "lines 1 and 2", those of two elements by the nodes of both, shape (4,)."""
    first, second = (net.line_between(pair) for pair in np.reshape(nodes, (2, 2)))
    return f"lines {first} and {second}"


def holding(energy, radius):
    """Stiffness that stores an energy [J] at `AIM` of a radius [m], where lines cross [N/m]."""
    return energy / (HELD * radius**2)


def would_pass(system, v, nodes):
    """Message that two lines would pass, with a sufficient stiffness; ``nodes (4,)`` are those of both.

    At `AIM` of the radius, this stiffness stores the energy of both at velocities v. An attached node counts with the
    mass of its body.
    """
    fixed, pairs = system.fixed.all(axis=1), np.reshape(nodes, (2, 2))
    crossing = system.terms[pressed(system)].contact.crossing
    given = f"{lines_of(system.net, nodes)} would pass through each other"
    heavy = []
    for pair in pairs:
        free = pair[~fixed[pair]].tolist()
        rows = list(set(system.carriers.moving(free) if system.carriers else free))
        heavy.append(system.net.mass[rows].sum() if free else np.inf)
    mass = 1.0 / (1.0 / heavy[0] + 1.0 / heavy[1]) if np.isfinite(heavy).any() else np.inf
    speed = max(float(np.linalg.norm(v[i] - v[k])) for i in pairs[0] for k in pairs[1])
    if np.isinf(mass):
        return f"{given}: {PRESCRIBED}"
    enough = max(holding(0.5 * mass * speed**2, 0.5 * crossing.touch), 2.0 * crossing.stiffness)
    return (
        f"{given}: [self_contact] stiffness = {float(f'{enough:.2g}'):g} would hold what comes at {speed:.3g} m/s, in "
        f"place of {crossing.stiffness:.3g}"
    )


def first_stiffness(system):
    """Stiffness of lines that refweb chooses before a scene is solved [N/m].

    It is EA/L of the stiffest element, or, if larger, the stiffness that stores an impact energy at `AIM` of the
    radius. This is the energy of two of the heaviest elements at the largest relative velocity of any two nodes or
    bodies, since a net that is thrown at a body folds with that velocity.

    Parameters
    ----------
    system : refweb.system.system.System
        System with any stiffness of lines.
    """
    net, touch = system.net, system.terms[pressed(system)].contact.crossing.touch
    lines = float((net.axial / net.line_data.natural_length).max())
    if net.quasi_static:
        return lines
    v = system.initial_velocity()[: system.rows - net.spins]
    speed = float(np.linalg.norm(np.ptp(v, axis=0)))
    mass = 0.5 * float(net.mass[net.cells].sum(axis=1).max())
    return max(lines, float(f"{holding(0.5 * mass * speed**2, 0.5 * touch):.2g}"))


class Passage:
    """Record of lines that may have passed each other.

    Parameters
    ----------
    system : refweb.system.system.System
        System with a force term of lines against lines.
    unfollowed : str, optional
        Method that does not check the lines, with the reason; None if they are checked.
    chosen : bool
        True if refweb chose the stiffness.
    """

    def __init__(self, system, unfollowed=None, chosen=False):
        self._system, self._unfollowed, self._chosen = system, unfollowed, chosen
        term = system.terms[pressed(system)]
        crossing, self._elements = term.contact.crossing, term.elements.numbers
        self.touch, self._stiffness = crossing.touch, crossing.stiffness
        self._deepest, self._crossings = 0.0, np.full((2, 5), np.inf)

    def record(self, overlap, crossings):
        """Record the deepest overlap [m], and crossings so far, see `IntegratorState.crossings`."""
        self._deepest, self._crossings = max(self._deepest, overlap), crossings

    def plain(self):
        """Overlap, radius and stiffness, as in ``run.json``."""
        values = {"overlap": self._deepest, "radius": 0.5 * self.touch, "stiffness": self._stiffness}
        return {**values, "chosen": self._chosen}

    def status(self):
        """Status as in ``run.json``: "certified", "certified but for ..." or the reason for doubt."""
        if self._unfollowed is not None:
            return f"not certified: {self._unfollowed}"
        net, ((time, *nodes), (folded, *beside)) = self._system.net, self._crossings
        if np.isfinite(time):
            return f"not certified: {lines_of(net, nodes)} may have passed through each other at t = {time:.6g} s"
        if np.isfinite(folded):
            return (
                f"certified but for neighbours along the net: {lines_of(net, beside)} came to lie on each other at "
                f"t = {folded:.6g} s"
            )
        return "certified"

    def remarks(self):
        """Remarks for a reader of the results."""
        if (status := self.status()) != "certified":
            yield Finding("lines-in-doubt", f"lines may have passed through lines, {status}", "self_contact")

    def _enough(self, overlap, elements, v):
        """Stiffness that may be sufficient for the overlap so far [N/m].

        Above the largest push lines are hardly braked, and the overlap tells nothing about their energy. Therefore this
        stiffness stores at least, at `AIM` of the radius, the energy that is stored so far plus the kinetic energy of
        two elements at the largest relative velocity of their nodes.
        """
        radius = 0.5 * self.touch
        enough = self._stiffness * (overlap / (AIM * radius)) ** POWER
        if v is None:
            return enough
        mass, cells = self._system.net.mass, self._system.net.cells
        nodes = cells[elements].ravel() if elements.ndim else np.unique(cells)
        heavy = mass[cells[elements if elements.ndim else slice(None)]].sum(axis=1).max()
        moving = 0.25 * heavy * float((np.ptp(v[nodes], axis=0) ** 2).sum())
        stored = self._stiffness * min(overlap / (AIM * radius), 1.0) ** POWER
        return max(enough, stored + holding(moving, radius))

    def refuse(self, overlap, when, cell, v=None):
        """Refuse an overlap [m] of a cell above the radius, at a time or load step as text; v are the velocities.

        Raises
        ------
        PenetrationError
            Where refweb chose the stiffness.
        SolverError
            Where the scene gives the stiffness.
        """
        radius = 0.5 * self.touch
        if not overlap > radius:
            return
        elements = self._elements[cell]
        names = (
            " and ".join(str(n) for n in self._system.net.line[elements].ravel().tolist()) if elements.ndim else None
        )
        names = f"lines {names}" if names else f"line {self._system.net.line[elements]} and another"
        if elements.ndim and self._system.fixed[self._system.net.cells[elements]].all():
            raise SolverError(
                f"{names} overlap by {overlap:.3g} m at {when}, more than their radius {radius:g}: {PRESCRIBED}"
            )
        enough = float(f"{self._enough(overlap, elements, v):.2g}")
        if self._chosen:
            enough = STIFFER * self._stiffness if v is not None else max(enough, STIFFER * self._stiffness)
            raise PenetrationError(
                f"{names} overlap by {overlap:.3g} m at {when}, more than their radius {radius:g}, with "
                f"stiffness = {self._stiffness:.3g}; repeated with stiffness = {enough:g}",
                {"self_contact": enough},
            )
        words = f"{enough:g} may be enough in place of {self._stiffness:.3g}"
        if self._unfollowed is not None:  # what does not move does not tell what it would take
            words = f"{words}; nodes that are themselves moved into other lines are held by none"
        else:
            words = f"{words}, or leave it out"
        raise SolverError(
            f"{names} overlap by {overlap:.3g} m at {when}, more than their radius {radius:g}, where the "
            f"push falls and lines pass: [self_contact] stiffness = {words}"
        )
