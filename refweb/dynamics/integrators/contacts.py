"""Contact forces on bodies in the compiled loop: the sum over the cells that are near in a step.

May change: nothing but names inside of kernels. Must stay: ``chosen`` is a place in ``cells`` of `records.ForceTerms`,
counted as `neighbour_list.near_of` lists terms; sums are those of `system.contact_forces`, whose dtype and kernels it
uses, so that a row of the loop equals that of a state. `step`, `dense_output` and `explicit_loop` call `feel`. Must
stay as well: `Contacts`, which `records` imports. Tests: ``tests/results/test_contact_force.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...effects.base import FELT_COLUMNS
from ...kernels import Indices, Matrix, Record, kernel
from ...system.contact_forces import ContactTermArray, add_felt, forget
from .neighbour_list import near_of

if TYPE_CHECKING:
    from .records import ForceTerms


class Contacts(Record):
    """Terms of contact with bodies, and what these feel.

    Attributes
    ----------
    terms : ndarray of `refweb.system.contact_forces.CONTACT_TERM`
        See `refweb.system.contact_forces.ContactForces`.
    felt : ndarray, shape (rows, columns)
        Contact forces on bodies and depths.
    first : int
        Number of the row of the system that the first row is of.
    none : ndarray of int32, shape (0, 1)
        Numbers of chosen cells, where all are looked at.
    """

    terms: ContactTermArray
    felt: Matrix
    first: int
    none: Indices

    @classmethod
    def of(cls, system):
        """Make the record of a system; numbers of near cells stand as `refweb.dynamics.integrators.records` says."""
        forces, near = system.contact_forces, near_of(system)
        terms = forces.terms.copy()
        for term in terms:
            if term["number"] in near:
                term["chosen"] = len(system.terms) + len(near) + near.index(term["number"])
        return cls(terms, np.zeros((forces.rows, FELT_COLUMNS)), forces.first, np.empty((0, 1), dtype=np.int32))


@kernel(leaf=True)
def feel(contacts, terms):
    """Write what bodies feel where terms show what they do, where there is contact with any."""
    if contacts.terms.shape[0]:
        sum_contacts(contacts, terms)


@kernel(leaf=True, apart=("contacts",))
def sum_contacts(contacts: Contacts, terms: ForceTerms) -> None:
    """Write what bodies feel where terms show what they do."""
    forget(contacts.felt)
    for m in range(contacts.terms.shape[0]):
        term = contacts.terms[m]
        i, chosen = term.number, contacts.none
        if term.chosen >= 0:
            chosen = terms.cells[term.chosen]
        add_felt(contacts.first, term, terms.cells[i], chosen, terms.outs[i], contacts.felt)
