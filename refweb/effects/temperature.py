"""Temperature: natural lengths that expand, L (1 + α ΔT)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..messages import nearest, short, shown
from ..tables import Table, by_group, checked, field, real, rows
from .length_factor import scaled


def _change(name, value):
    table = isinstance(value, (list, tuple)) or hasattr(value, "tolist")
    return checked(name, value, rows(2, increasing=True) if table else real(unit="K"))


@dataclass(frozen=True, kw_only=True)
class GroupTemperature(Table):
    """What may differ on the lines of one group; None keeps the value of `Temperature`."""

    expansion: float | None = real(None, unit="1/K")
    change: object = field(_change, None)


@dataclass(frozen=True, kw_only=True)
class Temperature(Table):
    """Thermal strain of the lines; mass, section and modulus stay.

    Parameters
    ----------
    expansion : float
        Coefficient of linear expansion α [1/K]; that of aramid is negative.
    change : float or sequence of (t, change)
        Difference ΔT [K] to the temperature at which natural lengths are their own, at all times, or linear in between
        and end values held. In statics t is the load step.
    groups : dict of str to GroupTemperature
        Values that differ by group of lines.

    Raises
    ------
    InputError
        For numbers that are not finite, times that do not increase, and 1 + α ΔT that is not > 0 on some lines; from
        ``on``, for a group that no line has.
    """

    expansion: float = real(unit="1/K")
    change: object = field(_change, unit="K")
    groups: dict = by_group(GroupTemperature, "temperature")

    def check(self):
        """Refuse a natural length that is not positive."""
        for group in (None, *self.groups):
            for _, factor in self._factor(group):
                if not factor > 0.0:
                    where = "" if group is None else f"groups.{short(group)} "
                    raise InputError(f"{where}1 + expansion × change = {factor:g} must be > 0: no length is left")

    def _factor(self, group=None):
        """Table of 1 + α ΔT."""
        own = self.groups.get(group, self)
        expansion = self.expansion if own.expansion is None else own.expansion
        change = self.change if own.change is None else own.change
        table = change if isinstance(change, tuple) else ((0.0, change),)
        return [(t, 1.0 + expansion * value) for t, value in table]

    def on(self, net):
        """The drives of the natural lengths, one for each group."""
        groups = np.array(net.web.groups)
        for name in self.groups:
            if name not in groups:
                known = sorted(set(net.web.groups) - {""})
                hint = nearest(name, known) if known else "this web has no groups"
                raise InputError(f"groups {shown(name)} is the group of no line, {hint}")
        apart = [scaled(net, np.flatnonzero(groups == name), self._factor(name)) for name in self.groups]
        rest = np.flatnonzero([name not in self.groups for name in groups])
        return [scaled(net, rest, self._factor()), *apart]
