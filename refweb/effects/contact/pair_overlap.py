"""Allowed penetration of bodies into each other, the stiffness that keeps it, and the proof that none passes.

The overlap is compared with the size of the smaller of both bodies, as for a line, see
`refweb.effects.contact.overlap`. A body can only pass through another by its middle, at a step or between two. In a
step two bodies approach by at most the step times the speeds of their fastest points. If this approach plus the deepest
overlap of all steps is less than the least distance from a middle to its surface, it is proven that nothing has passed.
The bound of explicit steps limits the approach to 0.2 times that distance times ``safety``. For explicit steps of a
given size, it follows from the step and the largest speed of the run. Steps of CVODE and IDA are checked one by one,
see `refweb.dynamics.integrators.passages`.

May change: messages of findings. Must stay: "certified" and "not certified" of `passage` and the keys of ``plain``,
which stand in ``run.json``; `WAY`, which follows from the bound of `body_body_penalty` (10 × speed over thickness);
`record`, `note_way` and `note_met`, which `dynamics.history` calls (`statics.body_penetration` `record` alone);
`refuse`, `touched` and `remarks`, which `overlap.Overlaps` calls; `plain` and `passage`, which the simulations read,
and `deepest`, which `dynamics.history` and `statics.body_penetration` read; texts of `DeepestPair` for which
`overlap.Deepest` asks; `PairOverlaps`, which `dynamics.simulation` and `statics.body_penetration` import. Tests:
``tests/effects/test_between_bodies.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...findings import Finding
from ..base import pairs_of
from .overlap import AIM, CORE, Deepest, allowed, first_between, size_of

WAY = 0.2
"""Largest approach of two bodies in an explicit step by the bound, over the thickness of the smaller body and
``safety``."""


@dataclass(frozen=True)
class DeepestPair(Deepest):
    """The deepest contact of two bodies."""

    @property
    def name(self):
        """Names of both bodies."""
        return " and ".join(f'"{body.name}"' for body in self.bodies)

    @property
    def _where(self):
        return f"bodies {self.name} are {self.overlap:.3g} m deep in each other at {self.instant}"

    @property
    def _at_start_text(self):
        return f"{self._where}, in the core, where they start: move one of them"

    @property
    def _in_core_text(self):
        return (
            f"{self._where}, in the core, more than {CORE:g} of the {self.thickness:.3g} m from the middle of the "
            f"smaller to its surface; {self._remedy}"
        )

    def remarks(self):
        """Remarks for a reader of the results."""
        if self.too_deep:
            remedy = "there they start" if self.at_start else self._remedy
            share = 100.0 * self.overlap / min(map(size_of, self.bodies))
            yield Finding("deep-contact", f"{self._where}, {share:.3g} % of the smaller; {remedy}", "contact")

    @property
    def _remedy(self):
        return (
            f"stiffness = {self.enough:g} may hold them to {AIM * self.allowed:.3g} m in place of {self.stiffness:g}, "
            "or leave it out"
        )


class PairOverlaps:
    """The deepest contacts of all pairs of bodies so far, and whether any can have passed.

    Parameters
    ----------
    contact : refweb.effects.contact.table.Contact
        With a stiffness for each body.
    chosen : sequence of str
        Names of the bodies whose stiffness is refweb's choice.
    system : refweb.system.system.System
        That of the scene.
    moving : bool
        True in dynamics, False in statics.
    """

    def __init__(self, contact, chosen, system, moving=True):
        self._contact, self._chosen, self._system, self._moving = contact, set(chosen), system, moving
        self.deepest = [self._deepest(bodies, 0.0, 0.0, 0.0) for bodies in pairs_of(system)]
        self._path_limit, self._met = None, None

    def _deepest(self, bodies, overlap, time, initial):
        stiffness, exponent, *_ = self._contact.law_between(*bodies)
        chosen = tuple(body.name for body in bodies if body.name in self._chosen)
        deep = overlap > CORE * min(body.thickness for body in bodies)
        smallest = first_between(self._system, bodies, exponent) if deep else 0.0
        limit = min(map(allowed, bodies))
        law = stiffness, exponent, chosen, smallest
        return DeepestPair(bodies, overlap, time, *law, initial, limit, self._moving)

    def record(self, i, overlap, time):
        """Note the deepest overlap [m] of pair ``i`` and its time [s], if it is deeper than before."""
        was = self.deepest[i]
        if overlap > was.overlap:
            initial = overlap if time == 0.0 else was.initial
            self.deepest[i] = self._deepest(was.bodies, overlap, time, initial)

    def note_way(self, safety=0.0, step=0.0, speed=0.0):
        """Note what bounds the way in a step.

        That is ``safety``, where steps follow the bound, or the size of all steps [s] and the largest speed of a point
        of a body [m/s].
        """
        self._path_limit = (
            (lambda pair: WAY * safety * pair.thickness) if safety > 0.0 else (lambda pair: 2.0 * step * speed)
        )

    def note_met(self, met):
        """Note the first pair that has met, a row of ``crossings`` of the state of an integrator."""
        self._met = met

    def refuse(self):
        """Refuse what may not be, see `Deepest.refuse`."""
        for deepest in self.deepest:
            deepest.refuse()

    def plain(self):
        """Convert to values for ``run.json``, by names: the pairs that have touched."""
        return {", ".join(b.name for b in pair.bodies): pair.plain() for pair in self.deepest if pair.overlap > 0.0}

    def passage(self):
        """ "certified", or of which pair it is not certain that nothing has passed, and when it was deepest."""
        if self._met is not None:
            return self._text(*self._met)
        if self._path_limit is None:
            return "not certified"
        for pair in self.deepest:
            if not pair.overlap + (path := self._path_limit(pair)) < pair.thickness:
                when = f", deepest at t = {pair.time:.6g} s" if pair.overlap > 0.0 else ""
                return (
                    f"not certified: bodies {pair.name} may come nearer by {path:.3g} m in a step, and their middles "
                    f"are {pair.thickness:.3g} m below their surfaces{when}"
                )
        return "certified"

    def _text(self, time, body_a, body_b, *_):
        """Text of `passage` for steps that were checked one by one: two bodies have met at a time, or none have."""
        if not math.isfinite(time):
            return "certified"
        pair = next(pair for pair in self.deepest if [body.row for body in pair.bodies] == [body_a, body_b])
        return (
            f"not certified: bodies {pair.name} came as near each other as {pair.thickness:.3g} m below a surface, "
            f"where they may pass, at t = {time:.6g} s"
        )

    @property
    def touched(self):
        """Names of the bodies that have touched others."""
        return {body.name for pair in self.deepest if pair.overlap > 0.0 for body in pair.bodies}

    def remarks(self):
        """Remarks for a reader of the results."""
        for deepest in self.deepest:
            yield from deepest.remarks()
