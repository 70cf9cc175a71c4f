"""Reactions: the force of supports on a node or on several nodes, and the contact force on a body.

A kernel gets the total force f on each row; the force of a support is −f. The contact force on a body is the sum over
its contacts, see `refweb.system.contact_forces`: it is zero without contact, whatever else acts.
"""

from __future__ import annotations

import numpy as np

from ...effects.base import CONTACT
from .nodal import Nodal
from .observable import Value


class Reaction(Nodal):
    """Force of the supports, or of contact on a body."""

    unit = "N"

    def of(self, state):
        """The sum over the observed rows."""
        rows = self.rows(state.system)
        total = state.reaction[rows] if len(rows) == 1 else state.reaction[rows].sum(axis=0, keepdims=True)
        return Value(float(self.sizes(total)[0]), self.position(state.system, int(rows[0])))

    def position(self, system, at):
        """The node if there is one; a sum has no position."""
        return super().position(system, at) if len(self.rows(system)) == 1 else None

    def probe(self, system):
        """Make the probe of the support forces on nodes, or of all contact forces on a body."""
        from ..probes import Probe, contact_force, reaction

        rows = self.rows(system)
        numbers = self.numbers(rows)
        if self.observe.body is None:
            return Probe(reaction, numbers, np.where(system.supported[rows], 1.0, 0.0))
        row = system.contact_forces.row(self.body(system.net))
        return Probe(contact_force, [numbers[0], row], np.zeros((0, 0)), term=CONTACT)
