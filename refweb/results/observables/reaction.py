"""Reactions: the force of supports on nodes, of several nodes their sum, and the force of contact on a body.

A kernel has the whole force f on each row. What supports add to a row is −f; what contact adds to a body is f less
what acts on the body besides, which is linear in x and v: −(g + B x + C v − f), and less what nodes hand on to it.
"""

from __future__ import annotations

import numpy as np

from .nodal import Nodal
from .observable import Value


class Reaction(Nodal):
    """Force of the supports, or of contact on a body."""

    unit = "N"

    def of(self, state):
        """The sum over its rows."""
        rows = self.rows(state.system)
        total = state.reaction[rows] if len(rows) == 1 else state.reaction[rows].sum(axis=0, keepdims=True)
        return Value(float(self.sizes(total)[0]), self.place(state.system, int(rows[0])))

    def place(self, system, at):
        """The node, where it is one; a sum stands nowhere."""
        return super().place(system, at) if len(self.rows(system)) == 1 else None

    def probe(self, system):
        """Of what is supported on nodes, of all that contact adds on a body."""
        from ..probes import Probe, reaction

        rows = self.rows(system)
        if self.observe.body is None:
            weight, besides = np.where(system.supported[rows], 1.0, 0.0), np.zeros((len(rows), 3))
        else:
            weight, besides = np.full((len(rows), 3), -1.0), besides_contact(system, rows)
            nodes = [node for body in system.net.bodies if body.row in rows for node in body.carried]
            rows, weight = np.append(rows, nodes).astype(int), np.vstack([weight, np.ones((len(nodes), 3))])
            besides = np.vstack([besides, np.zeros((len(nodes), besides.shape[1]))])
        return Probe(reaction, self.numbers(rows), np.hstack([weight, besides]))


def push_on(system, rows):
    """The probe of the largest force of contact on some rows of bodies."""
    from ..probes import Probe, push

    return Probe(push, rows, besides_contact(system, rows))


def besides_contact(system, rows):
    """What bodies feel besides contact: g [N], and B and C where a frame turns; shape (rows, 3 or 21)."""
    parts, still = [system.outer_force(0.0)[rows]], np.zeros((system.rows, 3))
    if system.rotating:
        moved = ([(still + unit, still) for unit in np.eye(3)], [(still, still + unit) for unit in np.eye(3)])
        for states in moved:
            slopes = [system.outer_force(0.0, x, v)[rows] - parts[0] for x, v in states]
            parts.append(np.stack(slopes, axis=-1).reshape(len(rows), 9))
    return np.hstack(parts)
