"""Reels: lines whose natural length is a function of time, such as those of a winch or a closing line.

May change: messages. Must stay: keys and docstring of `Reel` (scene format and help; after a change write
``validation/REFERENCE.md`` anew); the table of the factor, the same object in ``factors`` of the net, by which
`dynamics.commands` finds it. `natural_lengths` and `mass_flow` do the work. Tests: ``tests/effects/test_reel.py``,
``tests/effects/test_reel_mass.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..tables import Several, Table, choice, nodes, rows, table
from .natural_lengths import with_factor

if TYPE_CHECKING:
    from ..net.net import Net


@table
class Reel(Table):
    """Lines that are reeled in or paid out; the reel does work.

    The factors of several reels of a line, and the factor of its temperature, are multiplied.

    Parameters
    ----------
    lines : int, str or list
        Lines, by number or group (see `refweb.net.groups`), or "all".
    factor : sequence of (t, factor)
        Natural length over that without the reel [1], > 0: linear between the times, constant before and after them. In
        statics t is the load step.
    mass : {"stays", "follows"}
        "stays": nodes keep their mass. "follows": a line has the mass of its natural length. Material leaves and comes
        through the drum, at the velocity of the drum's node, with its momentum and its energy, which counts as
        ``work``. So does its weight: energies by place are those of the masses at t = 0. Point masses and bodies keep
        theirs, a body with the share of a line's end on it. Material that slides along the lines has its inertia, see
        `refweb.effects.sliding_material`: nodes, which it passes, jump by it where the rate of the factor does, also
        at t = 0. Momentum and angular momentum are kept, also where the drum is free to move. Kinetic energy is that
        of nodes. The lines may not break.
    drum : int, str or list, optional
        Node at the drum, with ``mass = "follows"``: one of each connected part of the lines. By default the one that is
        supported, moved or on a body.

    Raises
    ------
    InputError
        For a factor that is not > 0, a table without rows, and times that do not increase; for a drum without ``mass =
        "follows"``. From ``extend``, for a line or a group that the web does not have, for a consistent mass that is to
        follow, and for mass that follows two reels.

    Examples
    --------
        [[reel]]
        lines = "rim"
        factor = [[0.1, 1.0], [0.5, 0.5]]
    """

    several = True

    lines: Several = nodes(what="line")
    factor: Several = rows(2, increasing=True)
    mass: str = choice("stays", "follows", default="stays")
    drum: Several = nodes(default=None)

    def check(self) -> None:
        """Refuse a natural length that is not positive, and a drum that has no meaning."""
        for i, (_, factor) in enumerate(self.factor):
            if not factor > 0.0:
                raise InputError(f"factor[{i}][1] = {factor:g} must be > 0 [1]: a line cannot be reeled in to nothing")
        if self.drum is not None and self.mass == "stays":
            raise InputError('drum has no meaning where mass = "stays": leave it out, or give mass = "follows"')

    def extend(self, net: Net) -> Net:
        """The net with the factor on its lines."""
        lines = net.web.find_lines(self.lines)
        net = with_factor(net, lines, self.factor)
        return net if self.mass == "stays" else self._with_flow(net, lines)

    def _with_flow(self, net, lines):
        """The net whose lines have the mass of their natural length."""
        from ..net.elements import line_element, lumped_shares
        from .mass_flow import MassFlow

        if net.consistent_minus_lumped is not None:
            raise InputError('mass = "follows" needs [solve] mass = "lumped", not "consistent": leave that out')
        for flow in net.flows:
            for line in np.intersect1d(flow.lines, lines)[:1]:
                raise InputError(f'line {line} has a reel with mass = "follows" already: merge their factors')
        elements = np.flatnonzero(np.isin(net.line, lines))
        mass, cells = np.zeros(net.nodes), net.cells[elements]
        for a, share in enumerate(lumped_shares(line_element(net.order))):
            np.add.at(mass, cells[:, a], share * net.element_mass[elements])
        drums = None if self.drum is None else net.web.find(self.drum, "drum")
        touched = np.unique(cells)
        flow = MassFlow(lines, elements, touched, mass[touched], self.factor, drums)
        return replace(net, flows=(*net.flows, flow))
