"""Temperature: natural lengths that expand, L (1 + α ΔT).

May change: private functions and messages. Must stay: keys and docstring of `Temperature` (scene format and help; after
a change write ``validation/REFERENCE.md`` anew); the same names of keys in `GroupTemperature`, which
`net.groups.givers` finds by name; that factors multiply those of reels, by `natural_lengths.with_factor`. Tests:
``tests/effects/test_temperature.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..messages import short
from ..net.groups import givers
from ..tables import Several, Table, by_group, real, real_or_rows, table
from .natural_lengths import with_factor

if TYPE_CHECKING:
    from ..net.net import Net


@table
class GroupTemperature(Table):
    """Keys that may differ on the lines of one group; None keeps the value of `Temperature`.

    Examples
    --------
        [temperature.groups.rim]
        expansion = 1.2e-5
        change = 40.0
    """

    expansion: float | None = real(default=None, unit="1/K")
    change: Several = real_or_rows(default=None, unit="K")


@table
class Temperature(Table):
    """Thermal strain of the lines; mass, section and modulus do not change.

    Parameters
    ----------
    expansion : float
        Coefficient of linear expansion α [1/K]; it is negative for aramid.
    change : float or sequence of (t, change)
        Difference ΔT [K] from the temperature at which natural lengths are those of the web: one number, or a table
        over time, linear between the times, constant before and after them. In statics t is the load step.
    groups : dict of str to GroupTemperature
        Values by group of lines; groups that share lines must give different keys.

    Raises
    ------
    InputError
        For numbers that are not finite, times that do not increase, and 1 + α ΔT that is not > 0 on some lines. From
        ``extend``, for a group without lines, and two groups that give the same key to one line.

    Examples
    --------
        [temperature]
        expansion = -2e-6
        change = [[0.0, 0.0], [60.0, -80.0]]
    """

    expansion: float = real(unit="1/K")
    change: Several = real_or_rows(unit="K")
    groups: dict[str, Any] = by_group(GroupTemperature, "temperature", default_factory=dict)

    def check(self) -> None:
        """Refuse a natural length that is not positive."""
        for name in (None, *self.groups):
            settings = self if name is None else self.groups[name]
            _refuse_none(
                self if settings.expansion is None else settings,
                self if settings.change is None else settings,
                "" if name is None else f"groups.{short(name)} ",
            )

    def extend(self, net: Net) -> Net:
        """The net with a factor on the lines of each pair of α and ΔT."""
        for lines, factor in self._factors(net.web):
            net = with_factor(net, lines, factor)
        return net

    def _factors(self, web):
        """Lines of each pair of α and ΔT, and the table of their factor."""
        tables = list(self.groups.values())
        tables_of = givers(web.groups, self.groups, len(web.lines))
        none = np.full(len(web.lines), -1)
        given = np.stack([tables_of.get("expansion", none), tables_of.get("change", none)], axis=1)
        for numbers in np.unique(given, axis=0):
            expanding, changing = (tables[number] if number >= 0 else self for number in numbers)
            _refuse_none(expanding, changing, "groups ")
            yield np.flatnonzero((given == numbers).all(axis=1)), _factor(expanding, changing)


def _factor(expanding, changing):
    """Table of 1 + α ΔT, from the two tables that give α and ΔT."""
    change = changing.change if isinstance(changing.change, tuple) else ((0.0, changing.change),)
    return [(t, 1.0 + expanding.expansion * value) for t, value in change]


def _refuse_none(expanding, changing, where):
    """Refuse natural lengths that are not positive."""
    for _, factor in _factor(expanding, changing):
        if not factor > 0.0:
            raise InputError(f"{where}1 + expansion × change = {factor:g} must be > 0: no length is left")
