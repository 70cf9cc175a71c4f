"""Reactions: the force of supports on nodes and of contact on bodies, of several their sum or that of one.

A kernel gets the total force f on each row; the force of a support is −f. The contact force on a body is the sum over
its contacts and the threads that run over it, see `refweb.system.contact_forces`: it is zero without these, whatever
else acts.

May change: how forces are added up, in `of` and in the kernels `reaction` and `contact_force` of `probes` together;
`dynamics.responses.parts_of` and `statics.responses` repeat the sum for gradients, so that it changes in all four
places. Must stay: the sign (what holds, not what acts); the class docstring (help; after a change write
``validation/REFERENCE.md`` anew) and name in `registry.OBSERVABLES`; `Reaction`, which `dynamics.responses` and
`statics.responses` import. Tests: ``tests/results/test_observable_contract.py``,
``tests/results/test_contact_force.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...effects.base import CONTACT
from .nodal import Nodal
from .observable import SELECTIONS, Value

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...system.system import System
    from ..probes import Probe
    from ..state import State


class Reaction(Nodal):
    """Force of the supports, or of contact on a body and of threads that run over it."""

    unit = "N"

    def vectors(self, state: State) -> NDArray[np.float64]:
        """Reactions [N], shape (rows, 3)."""
        return state.reaction

    def of(self, state: State) -> Value:
        """The sum over its rows, or the value that counts of them."""
        rows = self.rows(state.system)
        if self.observe.select is not None or len(rows) == 1:
            return super().of(state)
        return Value(float(self.sizes(state.reaction[rows].sum(axis=0, keepdims=True))[0]), None)

    def position(self, system: System, at: int) -> int | None:
        """The node or body, where it is one; a sum stands nowhere."""
        stands = self.observe.select is not None or len(self.rows(system)) == 1
        return super().position(system, at) if stands else None

    def probe(self, system: System) -> Probe:
        """Make the probe of the support forces on nodes, or of all contact forces on bodies."""
        from ..probes import REACTION, Probe, contact_force, reaction, selected_contact, selected_row

        rows, select = self.rows(system), self.observe.select
        if self.observe.body is None:
            data = np.where(system.supported[rows], 1.0, 0.0)
            if select is None:
                return Probe(reaction, self.numbers(rows), data)
            return Probe(selected_row, [REACTION, SELECTIONS[select], self.component, *rows], data)
        felt, none = [system.contact_forces.row(body) for body in self.bodies(system.net)], np.zeros((0, 0))
        if select is None:
            return Probe(contact_force, [self.component, *felt], none, term=CONTACT)
        numbers = [SELECTIONS[select], self.component, len(felt), *felt, *rows]
        return Probe(selected_contact, numbers, none, term=CONTACT)
