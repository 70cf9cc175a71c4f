"""Whether lines can have passed through lines, and which stiffness would hold them.

Between two explicit steps nodes move in straight lines. Two centre lines that meet on the way are, at the end of the
step, no further apart than their ways: so nothing has passed in a step at whose end every distance is above the way
that two rows may have come towards each other in it. Elements that show no overlap are at least 2r apart. So nothing
can have passed in a run whose deepest overlap and longest way together are less than 2r; both are those of all steps.
Elements that do not touch, since they are neighbours along the net, are no part of it.

An overlap above r is refused: from there on the push falls.
"""

from __future__ import annotations

import math

from ...errors import SolverError
from .pair import SCALE, TOUCH

AIM = 0.8
"""Overlap that a stiffness is named for, over the radius."""
POWER = 2.5
"""Power of an overlap that the energy of lines that cross goes with."""


def pressed(system):
    """Number of the family of lines against lines of a system, None where there is none."""
    found = (i for i, family in enumerate(system.families) if family.book == "self_contact_energy")
    return next(found, None)


class Passage:
    """What is known of lines that may have passed each other.

    Parameters
    ----------
    system : refweb.system.system.System
        With a family of lines against lines.
    method : str
        What solves it.
    followed : bool
        Whether the ways of all steps are known.
    """

    def __init__(self, system, method, followed):
        self._system, self._method, self._followed = system, method, followed
        family = system.families[pressed(system)]
        self.touch, self._elements = float(family.data[0, TOUCH]), family.elements
        self._stiffness = float(family.data[:, SCALE].max()) * math.sqrt(12.0) * self.touch**3
        self._since: float | None = None
        self._deepest = 0.0

    def note(self, overlap, way, time):
        """Note the deepest overlap and the longest way of a step [m] until a time [s]."""
        self._deepest = max(self._deepest, overlap)
        if self._since is None and not overlap + way < self.touch:
            self._since = time

    def plain(self):
        """Overlap, radius and stiffness as ``run.json`` has them."""
        return {"overlap": self._deepest, "radius": 0.5 * self.touch, "stiffness": self._stiffness}

    def told(self):
        """Whether nothing can have passed, as ``run.json`` has it."""
        if not self._followed:
            return f"not certified: {self._method} does not follow what moves between its steps"
        if self._since is None:
            return "certified"
        return f"not certified at t = {self._since:.6g} s: overlap and way of a step are not below {self.touch:g} m"

    def refuse(self, overlap, time, cell):
        """Refuse an overlap above the radius [m] of a cell, at a time [s]; `SolverError`."""
        radius = 0.5 * self.touch
        if not overlap > radius:
            return
        own = self._elements[cell]
        names = " and ".join(str(n) for n in self._system.net.line[own].ravel().tolist()) if own.ndim else None
        names = f"lines {names}" if names else f"line {self._system.net.line[own]} and another"
        enough = float(f"{self._stiffness * (overlap / (AIM * radius)) ** POWER:.2g}")
        raise SolverError(
            f"{names} overlap by {overlap:.3g} m at t = {time:.6g} s, more than their radius {radius:g}, where the "
            f"push falls and lines pass: [self_contact] stiffness = {enough:g} or more is enough in place of "
            f"{self._stiffness:.3g}"
        )
