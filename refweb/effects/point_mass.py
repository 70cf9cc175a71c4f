"""Point masses on nodes.

May change: how masses are added up. Must stay: keys and docstring of `PointMass` (scene format and help; after a change
write ``validation/REFERENCE.md`` anew); that both ``mass`` of the net, which methods use, and ``point_mass``, which
pictures and checkpoints read, get the mass. Tests: ``tests/test_contract.py`` (``test_point_masses_add_up``).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..tables import Several, Table, nodes, real, table

if TYPE_CHECKING:
    from ..net.net import Net


@table
class PointMass(Table):
    """A mass that is added to each of some nodes; gravity acts on it.

    Parameters
    ----------
    node : int, str or list
        Nodes, by number or name.
    mass : float
        Mass on each node [kg], ≥ 0.

    Raises
    ------
    InputError
        For a mass that is not finite or < 0; from ``extend``, for a node that the web does not have.

    Examples
    --------
        [[point_mass]]
        node = "corners"
        mass = 0.25
    """

    several = True

    node: Several = nodes()
    mass: float = real(at_least=0, unit="kg")

    def extend(self, net: Net) -> Net:
        """The net with the masses added."""
        added = np.zeros(len(net.mass))
        np.add.at(added, net.web.find(self.node), self.mass)
        before = 0.0 if net.point_mass is None else net.point_mass
        return replace(net, mass=net.mass + added, point_mass=before + added[: net.nodes])
