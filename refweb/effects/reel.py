"""Reels: lines whose natural length is a function of time, such as those of a winch or a closing line."""

from __future__ import annotations

from ..errors import InputError
from ..tables import Several, Table, nodes, rows, table
from .natural_lengths import with_factor


@table
class Reel(Table):
    """Lines that are reeled in or paid out; their nodes keep their mass, and the reel does work.

    The factors of several reels of a line, and the factor of its temperature, are multiplied.

    Parameters
    ----------
    lines : int, str or list
        Lines, by number or group (see `refweb.net.groups`), or "all".
    factor : sequence of (t, factor)
        Natural length over that without the reel [1], > 0: linear between the times, constant before and after them. In
        statics t is the load step.

    Raises
    ------
    InputError
        For a factor that is not > 0, a table without rows, and times that do not increase. From ``extend``, for a line
        or a group that the web does not have.

    Examples
    --------
        [[reel]]
        lines = "rim"
        factor = [[0.1, 1.0], [0.5, 0.5]]
    """

    several = True

    lines: Several = nodes(what="line")
    factor: Several = rows(2, increasing=True)

    def check(self):
        """Refuse a natural length that is not positive."""
        for i, (_, factor) in enumerate(self.factor):
            if not factor > 0.0:
                raise InputError(f"factor[{i}][1] = {factor:g} must be > 0 [1]: a line cannot be reeled in to nothing")

    def extend(self, net):
        """The net with the factor on its lines."""
        return with_factor(net, net.web.find_lines(self.lines), self.factor)
