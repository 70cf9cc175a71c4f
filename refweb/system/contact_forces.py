"""Contact of bodies: the force on each body, the depth of lines in it, and the depth of pairs of bodies.

Each contact writes its depth and its force on the touched body to its cell, see
`refweb.effects.base.ContactForce.felt`; of two bodies that is the force on the second. A thread that runs over bodies
writes a force for each. The contact force on a body is the sum of these alone. It is zero if nothing touches the body,
whatever else acts. One kernel computes this sum for all bodies: over the near cells in a step of the compiled loop,
over all cells in a state.

May change: private names. Must stay: the order of results (rows of the system behind the nodes, then pairs of bodies,
those of terms in the order of `effects.base.pairs_of`), which observables index; arguments of the kernels `forget` and
`add_felt` and names in `CONTACT_TERM`, which `dynamics.integrators.contacts` uses: change both files together;
`ContactTermArray`, which `integrators.contacts` imports; `ContactForces` with its public names, which `system` imports.
Tests: ``tests/results/test_contact_force.py``, ``test_every_number.py``.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numba import from_dtype, types

from ..compiled.rows import record_at, records_of
from ..effects.base import CONTACT_COLUMNS, FELT, FELT_COLUMNS, TOUCH, pairs_of
from ..kernels import kernel
from ..net.threads import COLUMNS

CONTACT_TERM = np.dtype(
    [(name, np.int64) for name in ("number", "body", "partner", "elements", "pairs", "chosen", "row", "column")]
)
"""A term of contact: its number; the columns of its cells with the row of the touched body and of the other body, −1
for none; the number of elements for contact of lines, else 0; the row of the depth of its first pair for contact of
bodies, else −1; the position of the numbers of chosen cells, −1 for none; the result row of the touched body where
``body`` is −1; and the column of ``out`` at which its `TOUCH` begins."""
ContactTermArray = Annotated[np.ndarray, types.Array(from_dtype(CONTACT_TERM), 1, "C")]


class ContactForces:
    """Contact of the bodies of a system: one result row for each system row after the nodes, then one for each pair of
    bodies.

    Parameters
    ----------
    system : refweb.system.system.System
        The system.

    Attributes
    ----------
    first : int
        Number of the row of the system to which the first row belongs.
    terms : ndarray of `CONTACT_TERM`
        Terms of contact.
    rows : int
        Number of rows.
    """

    def __init__(self, system):
        self.first, elements, terms = system.net.nodes, len(system.net.cells), []
        self.rows = pairs = system.rows - self.first
        self._cells, self._pairs = [term.cells for term in system.terms], {}
        for i, term in enumerate(system.terms):
            if term.contact.felt:
                body, partner = (*term.contact.felt, -1)[:2]
                lines = elements if term.contact.with_lines and term.energy is not None else 0
                terms.append((i, body, partner, lines, pairs if term.contact.pairs else -1, -1, -1, 0))
                pairs += len(term.contact.pairs)
        for i, thread in system.threads.items() if system.net.threads else ():
            for n, wrap in enumerate(thread.wraps):
                (row,) = (self.row(body) for body in system.net.bodies if body.name == wrap.body)
                terms.append((i, -1, -1, 0, -1, -1, row, COLUMNS + n * CONTACT_COLUMNS))
        self.terms = np.array(terms, dtype=CONTACT_TERM)
        for n, pair in enumerate(pairs_of(system)):
            self._pairs[frozenset(body.row for body in pair)] = self.rows + n
        self.rows = pairs

    def row(self, body):
        """Number of the row of a body."""
        return body.row - self.first

    def force_on(self, body, felt):
        """Force of contact on a body [N], shape (3,), from the result of `of`."""
        return records_of(FELT, felt)["force"][self.row(body)]

    def lines_on(self, body):
        """Number of the term of contact of lines with a body, and the slice of its cells in order of elements."""
        for term in self.terms:
            indices = np.flatnonzero(self._cells[term["number"]][:, term["body"]] == body.row)
            if term["elements"] and len(indices):
                return int(term["number"]), slice(int(indices[0]), int(indices[-1]) + 1)
        raise ValueError(f'nothing touches body "{body.name}"')

    def pair_rows(self, body, others):
        """Numbers of the rows of the pairs of a body with some other bodies, a list."""
        rows = [self._pairs.get(frozenset((body.row, partner.row))) for partner in others]
        return [row for row in rows if row is not None]

    def of(self, per_cell):
        """Contact of bodies from the values of terms per cell, shape (rows, `FELT_COLUMNS`)."""
        felt = np.empty((self.rows, FELT_COLUMNS))
        forget(felt)
        none = np.empty((0, 1), dtype=np.int32)
        for term in self.terms:
            i = term["number"]
            add_felt(self.first, term, self._cells[i], none, per_cell[i], felt)
        return felt


@kernel(leaf=True, forceinline=True)
def forget(felt):
    """Set all contact to zero."""
    for r in range(felt.shape[0]):
        row = record_at(FELT, felt, r, 0)
        row.depth = row.force[0] = row.force[1] = row.force[2] = 0.0
        row.element = -1.0


@kernel(leaf=True)
def add_felt(first, term, cells, chosen, out, felt):
    """Add forces and depths of the cells of a term; with ``chosen``, shape (cells, 1), of those cells only."""
    for c in range(cells.shape[0]):
        touch = record_at(TOUCH, out, c, term.column)
        depth, force = touch.value, touch.force
        if depth == 0.0 and force[0] == 0.0 and force[1] == 0.0 and force[2] == 0.0:
            continue
        row = cells[c, term.body] - first if term.body >= 0 else term.row
        body, cell = record_at(FELT, felt, row, 0), chosen[c, 0] if chosen.shape[0] else c
        for k in range(3):
            body.force[k] += force[k]
        if term.partner >= 0:
            partner = record_at(FELT, felt, cells[c, term.partner] - first, 0)
            for k in range(3):
                partner.force[k] -= force[k]
        if term.elements > 0 and depth > body.depth:
            body.depth, body.element = depth, float(cell % term.elements)
        if term.pairs >= 0:
            record_at(FELT, felt, term.pairs + cell, 0).depth = depth
