"""Force terms whose kicks an explicit step solves for: their record, and the detection of their contacts.

Losses act only where the push acts, which is evaluated before: only lines with a depth in a body are detected.

May change: how space for contacts grows. Must stay: parts of contact n begin at ``parts`` × n, of which an attached
node takes `CARRIED`; `detect` kernels count contacts for which there is no space as well; numbers of near cells stand
as `neighbour_list.near_of` lists terms. Must follow: the kernels of `effects.contact_solver`, and `step`, which calls
`detect_all`. Must stay as well: `ImplicitContacts` with its public names, which `records` imports. Tests:
``tests/effects/test_contact_losses.py``.
"""

from __future__ import annotations

import numpy as np

from ...effects.base import CONTACT_COLUMNS
from ...effects.contact_solver import carry, prepare
from ...kernels import (
    CONTACT,
    DETECT,
    INTEGERS,
    LAW,
    MEMORIES,
    MEMORY,
    PART,
    Arrays,
    DetectTable,
    Functions,
    Integers,
    IntegerTable,
    LawTable,
    MemoryTable,
    Record,
    kernel,
)
from .neighbour_list import near_of, rows_of

CARRIED = 3
"""Number of parts for an attached node: the part of the node, of the body, and of its rotation."""


class ImplicitContacts(Record):
    """Terms whose kicks are solved for.

    Attributes
    ----------
    terms : ndarray of int
        Their numbers.
    detects, laws : table
        Their kernels, see `refweb.effects.base.ImplicitContactKernels`.
    memories : table
        Forces of the step before, within a row: `refweb.kernels.MEMORY` for each cell, or element, and slot.
    depths : ndarray of int
        The ``outs`` of `refweb.dynamics.integrators.records.ForceTerms` that has depths, −1 for those that have none.
    elements : table
        For each cell the row in it.
    parts : int
        Largest number of parts of a contact.
    pieces : int
        Number of cells of a line, which are looked at together.
    carriers : ndarray of int
        Number of each row among the nodes that bodies carry, −1 for others; empty where no node is carried.
    """

    terms: Integers
    detects: DetectTable
    laws: LawTable
    memories: MemoryTable
    depths: Integers
    elements: IntegerTable
    parts: int
    pieces: int
    carriers: Integers

    @classmethod
    def of(cls, system, turns):
        """Make the record of a system; ``turns`` are its `refweb.net.rotation.RigidRotations`."""
        numbers = [i for i, term in enumerate(system.terms) if term.velocity.implicit is not None]
        terms = [system.terms[i] for i in numbers]
        depths = [depths_of(system, term) for term in terms]
        carriers = np.full(system.rows if len(turns.carried) else 0, -1)
        carriers[turns.carried[:, 0]] = np.arange(len(turns.carried))
        return cls(
            terms=np.array(numbers, dtype=np.int64),
            detects=Functions(DETECT, [term.velocity.implicit.detect for term in terms]),
            laws=Functions(LAW, [term.velocity.implicit.law for term in terms]),
            memories=Arrays(
                MEMORIES,
                [
                    np.zeros((max(len(f.cells), len(system.net.cells)), f.velocity.implicit.slots), dtype=MEMORY)
                    for f in terms
                ],
            ),
            depths=np.array([number for number, _ in depths], dtype=np.int64),
            elements=Arrays(INTEGERS, [elements for _, elements in depths]),
            parts=(1 if len(turns.carried) == 0 else CARRIED)
            * max((term.velocity.implicit.parts for term in terms), default=0),
            pieces=system.net.subdivide,
            carriers=carriers,
        )


def depths_of(system, term):
    """(``depths``, ``elements``) of the push of the lines of a term on its bodies, see `ImplicitContacts`."""
    near = near_of(system)
    for i in near if term.contact.with_lines else ():
        push = system.terms[i]
        if push.contact.with_lines:
            keys, its = (
                side.elements.numbers * system.rows + side.cells[:, system.net.along.size] for side in (term, push)
            )
            order = np.argsort(its)
            matches = order[np.minimum(np.searchsorted(its, keys, sorter=order), len(its) - 1)]
            if (its[matches] == keys).all():
                return len(system.terms) + near.index(i), matches
    return -1, np.zeros(0, dtype=np.int64)


@kernel()
def lines_in_touch(depths, elements, pieces):
    """Numbers of the cells of lines that show a depth."""
    chosen, count = np.empty(elements.size, dtype=np.int64), 0
    if pieces == 1:  # in half of the time
        for c in range(elements.size):
            chosen[count] = c
            count += 0 if depths[np.uint64(elements[c]), 0] <= 0.0 else 1
        return chosen[:count]
    for first in range(0, elements.size, pieces):
        apart = True
        for c in range(first, first + pieces):
            apart = apart and depths[elements[c], 0] <= 0.0
        if not apart:  # what is not a number touches
            for c in range(first, first + pieces):
                chosen[count] = c
                count += 1
    return chosen[:count]


@kernel()
def known_places(chosen, outs, elements):
    """Columns of what the push of some cells shows that stand behind a `TOUCH`."""
    known = np.empty((chosen.size, outs.shape[1] - CONTACT_COLUMNS))
    for n in range(chosen.size):
        for k in range(known.shape[1]):
            known[n, k] = outs[elements[chosen[n]], CONTACT_COLUMNS + k]
    return known


@kernel()
def detect(m, x, terms, implicit_contacts, contacts, parts, begin):
    """Write the contacts of term m from ``begin`` on; the number behind them."""
    i, elements = implicit_contacts.terms[m], implicit_contacts.depths[m]
    if elements < 0:
        return implicit_contacts.detects[m](x, terms.cells[i], terms.data[i], np.empty((0, 0)), contacts, parts, begin)
    chosen = lines_in_touch(terms.outs[elements], implicit_contacts.elements[m], implicit_contacts.pieces)
    cells, data = rows_of(chosen, terms.cells[i], terms.data[i])
    known = known_places(chosen, terms.outs[elements], implicit_contacts.elements[m])
    end = implicit_contacts.detects[m](x, cells, data, known, contacts, parts, begin)
    for n in range(begin, min(end, contacts.size)):
        contacts[n].cell = contacts[n].owner = chosen[contacts[n].cell]
    return end


@kernel()
def detect_all(h, x, v, inverse, model, space, parts_space, ends):
    """Write all contacts, and to ``ends`` the number behind those of each term; (contacts, their parts).

    ``space`` and ``parts_space`` hold arrays for these, and get larger ones where they have no space for all.
    """
    implicit_contacts = model.implicit_contacts
    while True:
        contacts, parts, count = space[0], parts_space[0], 0
        for m in range(implicit_contacts.terms.size):
            begin = count
            count = detect(m, x, model.terms, implicit_contacts, contacts, parts, begin)
            ends[m] = count
            for n in range(begin, min(count, contacts.size)):
                contacts[n].term = m
        if count <= contacts.size:
            break
        contacts, parts = np.empty(2 * count, dtype=CONTACT), np.empty(2 * count * implicit_contacts.parts, dtype=PART)
        for n in range(contacts.size):
            contacts[n].first = implicit_contacts.parts * n
        space[0], parts_space[0] = contacts, parts
    for n in range(count):
        if implicit_contacts.carriers.size:
            carry(n, x, implicit_contacts.carriers, model.inertia.turns, contacts, parts)
        prepare(h, n, v, inverse, contacts, parts)
    return contacts, parts
