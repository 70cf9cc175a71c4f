"""Rupture: lines that break, and their rupture energy.

A broken element has no stiffness: its tension, strain and energy are 0, and forces through it end. The energy that it
had stored, and the energy of the forces that end with it, become the constant energy of a separate term, so that the
energy balance closes through every break. `refweb.dynamics.integrators.rupture` finds the times of breaks.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..net.groups import givers
from ..tables import Several, Table, by_group, real, rows, table
from .base import BreakLimits
from .broken import HELD, held_energy

if TYPE_CHECKING:
    from ..net.net import Net
    from .base import ForceTerm


@table
class GroupRupture(Table):
    """Keys that may differ on the lines of one group; None keeps the value of `Rupture`.

    Examples
    --------
        [rupture.groups.rim]
        strength = 3e9
    """

    strength: float | None = real(default=None, above=0, unit="Pa")


@table
class Rupture(Table):
    """Lines that break when their stress reaches their strength, or at given times.

    A line breaks at the element whose stress is the first to reach the strength; its other elements and their mass
    stay. If a line has one element, all of it breaks, and half of its mass stays at each end. The inner nodes of a
    broken curved element move on freely. A broken element has neither tension nor strain. Contact, bending, drag,
    pressure and thrust through it end. Its stored energy becomes ``rupture_energy``. Elements whose stress over
    strength is within 1e-9 of the largest at that moment break together, which keeps symmetry.

    In dynamics ``run.json`` has each break with its line, element, time and position. The order of breaks is compared
    with that of the step-refinement run: after the first difference, results have no ±. Statics ends when the first
    line would break, since equilibria after a break depend on the motion.

    Parameters
    ----------
    strength : float, optional
        Nominal stress T/A at which a line breaks [Pa], damping included; by default the strength of ``[cable]`` and its
        groups. Lines without a strength do not break by stress.
    at : sequence of (line, t), optional
        Lines that break at a time [s] for any stress, in the middle element or in the element after the middle. Lines
        that are already broken stay as they are. In statics t is the load step.
    groups : dict of str to GroupRupture
        Strengths by group of lines; only one of the groups that share a line may give a strength.

    Raises
    ------
    InputError
        For a strength that is not > 0, times < 0, and a line that breaks at two times. From ``on``, for a line or a
        group that the web does not have, if no line can break, for moving nodes without mass, and for a consistent
        mass, which would couple the ends of a broken line.

    Examples
    --------
        [rupture]
        strength = 2.5e9
        at = [[3, 0.5]]
    """

    strength: float | None = real(default=None, above=0, unit="Pa")
    at: Several = rows(2, default=None)
    groups: dict[str, Any] = by_group(GroupRupture, "rupture", default_factory=dict)

    @property
    def _due(self) -> tuple:
        """(Line, t) of ``at``."""
        return self.at or ()

    def check(self) -> None:
        """Refuse breaks that are not (line, time), and a line that breaks twice."""
        lines = [line for line, _ in self._due]
        for i, (line, time) in enumerate(self._due):
            if line != int(line) or line < 0:
                raise InputError(f"at[{i}][0] = {line:g} must be the number of a line")
            if not time >= 0.0:
                raise InputError(f"at[{i}][1] = {time:g} must be ≥ 0 [s]")
            if line in lines[:i]:
                raise InputError(f"at[{i}][0] = {line:g}: this line breaks at two times, name it once")

    def extend(self, net: Net) -> Net:
        """The net with the strengths of its lines, and the rupture energy in one more column of line data."""
        web = net.web
        strengths = np.full(len(web.lines), np.nan if self.strength is None else self.strength)
        given = givers(web.groups, self.groups, len(web.lines)).get("strength", np.full(len(strengths), -1))
        for number, group in enumerate(self.groups.values()):
            if group.strength is not None:
                strengths[given == number] = group.strength
        strength = np.where(np.isnan(strengths[net.line]), net.strength, strengths[net.line])
        return replace(net, strength=strength).with_column(HELD, 0.0)

    def on(self, net: Net) -> BreakLimits | list[ForceTerm | BreakLimits]:
        """The elements that may break and, except in statics, the term of the rupture energy."""
        limits, count = net.strength * net.area, len(net.web.lines)
        for i, (line, _) in enumerate(self._due):
            if line >= count:
                raise InputError(f"at[{i}][0] = {line:g} is not a line, must be 0 … {count - 1}")
        if not self._due and not np.isfinite(limits).any():
            raise InputError(
                "strength is missing: give it here, in [cable] or in their groups, or give at = [[line, t]]"
            )
        elements = net.middle_of([line for line, _ in self._due])
        middles = [(time, int(element)) for (_, time), element in zip(self._due, elements, strict=True)]
        weakness = BreakLimits(limits, tuple(sorted(middles)))
        if net.quasi_static:
            return weakness
        return [held_energy(net), weakness]
