"""Rupture: lines that break, and their rupture energy.

A broken element has no stiffness: its tension, strain and energy are 0, and forces through it end. The energy that it
had stored, and the energy of the forces that end with it, become the constant energy of a separate term, so that the
energy balance closes through every break. `refweb.dynamics.integrators.rupture` finds the times of breaks.

May change: messages. Must stay: keys and docstring of `Rupture` and `GroupRupture` (scene format and help; after a
change write ``validation/REFERENCE.md`` anew); `BreakLimits` with a limit of the tension (and of the strain of lines
that yield) for each element, which `integrators.rupture` and `statics.rupture` read. Tests:
``tests/effects/test_rupture.py``, ``tests/effects/test_plastic.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..messages import short
from ..net.groups import givers
from ..tables import Several, Table, by_group, real, rows, table
from .base import BreakLimits
from .broken import HELD, held_energy

if TYPE_CHECKING:
    from numpy.typing import NDArray

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
    plastic_strain: float | None = real(default=None, above=0, unit="1")


@table
class Rupture(Table):
    """Lines that break when their stress reaches their strength, by plastic strain, or at given times.

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
    plastic_strain : float, optional
        Plastic strain at which lines of the law "elastic-plastic" break [1], > 0, whatever their stress is: also those
        without a strength. A group may have another. Lines of other laws do not break by it.
    at : sequence of (line, t), optional
        Lines that break at a time [s] for any stress, in the middle element or in the element after the middle. Lines
        that are already broken stay as they are. In statics t is the load step.
    groups : dict of str to GroupRupture
        Strengths and plastic strains by group of lines; only one of the groups that share a line may give each.

    Raises
    ------
    InputError
        For a strength or a plastic strain that is not > 0, times < 0, and a line that breaks at two times. From ``on``,
        for a line or a group that the web does not have, if no line can break, for a plastic strain of lines that do
        not yield, for moving nodes without mass, and for a consistent mass, which would couple the ends of a broken
        line.

    Examples
    --------
        [rupture]
        strength = 2.5e9
        at = [[3, 0.5]]
    """

    strength: float | None = real(default=None, above=0, unit="Pa")
    plastic_strain: float | None = real(default=None, above=0, unit="1")
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
        strengths = self._by_element(net, "strength")
        strength = np.where(np.isnan(strengths), net.strength, strengths)
        return replace(net, strength=strength).with_column(HELD, 0.0)

    def _by_element(self, net: Net, key: str) -> NDArray[np.float64]:
        """Value of a key for each element, NaN where none is given, shape (elements,)."""
        web, common = net.web, getattr(self, key)
        values = np.full(len(web.lines), np.nan if common is None else common)
        given = givers(web.groups, self.groups, len(web.lines)).get(key, np.full(len(values), -1))
        for number, group in enumerate(self.groups.values()):
            if getattr(group, key) is not None:
                values[given == number] = getattr(group, key)
        return values[net.line]

    def _strains(self, net: Net) -> NDArray[np.float64] | None:
        """Strain at which each element has the plastic strain at which it breaks, None where no such is given."""
        if self.plastic_strain is None and all(group.plastic_strain is None for group in self.groups.values()):
            return None
        plastic, yields = self._by_element(net, "plastic_strain"), net.law_is("plastic")
        for name, group in self.groups.items():
            lines = np.isin(net.line, net.web.groups[name])
            for line in net.line[lines & ~yields][:1] if group.plastic_strain is not None else ():
                law = net.laws[net.law_index[net.line == line][0]].name
                raise InputError(
                    f"groups.{short(name)}: plastic_strain = {group.plastic_strain:g} has no meaning with law = "
                    f'"{law}", which line {line} has: leave it out'
                )
        if not yields.any():
            raise InputError(
                f"plastic_strain = {self.plastic_strain:g} needs lines that yield: give [cable] or a group of it law = "
                '"elastic-plastic", or leave it out'
            )
        from .plastic import strain_at

        strains = strain_at(net, np.nan_to_num(plastic))
        return np.where(yields & ~np.isnan(plastic), strains, np.inf)

    def on(self, net: Net) -> BreakLimits | list[ForceTerm | BreakLimits]:
        """The elements that may break and, except in statics, the term of the rupture energy."""
        limits, count = net.strength * net.area, len(net.web.lines)
        for i, (line, _) in enumerate(self._due):
            if line >= count:
                raise InputError(f"at[{i}][0] = {line:g} is not a line, must be 0 … {count - 1}")
        elements = net.middle_of([line for line, _ in self._due])
        middles = [(time, int(element)) for (_, time), element in zip(self._due, elements, strict=True)]
        weakness = BreakLimits(limits, tuple(sorted(middles)), self._strains(net))
        breakable = weakness.breakable
        for line in net.line[[n for wound, _ in net.wound for n in wound.tolist() if breakable[n]][:1]]:
            raise InputError(f"line {line} is on a [[winch]] and does not break: give it no strength or time")
        if not self._due and not weakness.watched:
            raise InputError(
                "strength is missing: give it here, in [cable] or in their groups, or give at = [[line, t]]"
            )
        if net.quasi_static:
            return weakness
        return [held_energy(net), weakness]
