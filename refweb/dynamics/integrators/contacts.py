"""Contact forces on bodies in the compiled loop: the sum over the cells that are near in a step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...effects.base import FELT_COLUMNS
from ...kernels import Indices, IntegerMatrix, Matrix, Record, kernel
from ...system.contact_forces import CHOSEN, FAMILY, add_felt, forget
from .neighbour_list import near_of

if TYPE_CHECKING:
    from .records import Families


class Contacts(Record):
    """Families of contact with bodies, and what these feel.

    Attributes
    ----------
    families : ndarray of int
        See `refweb.system.contact_forces.ContactForces`.
    felt : ndarray, shape (rows, columns)
        What bodies feel.
    first : int
        Number of the row of the system that the first row is of.
    none : ndarray of int32, shape (0, 1)
        Numbers of chosen cells, where all are looked at.
    """

    families: IntegerMatrix
    felt: Matrix
    first: int
    none: Indices

    @classmethod
    def of(cls, system):
        """Those of a system; numbers of cells that are near stand as `refweb.dynamics.integrators.records` says."""
        forces, near = system.contact_forces, near_of(system)
        families = forces.families.copy()
        for known in families:
            if known[FAMILY] in near:
                known[CHOSEN] = len(system.families) + len(near) + near.index(known[FAMILY])
        return cls(families, np.zeros((forces.rows, FELT_COLUMNS)), forces.first, np.empty((0, 1), dtype=np.int32))


@kernel(leaf=True)
def feel(contacts, families):
    """Write what bodies feel where families show what they do, where there is contact with any."""
    if contacts.families.shape[0]:
        sum_contacts(contacts, families)


@kernel(leaf=True, apart=("contacts",))
def sum_contacts(contacts: Contacts, families: Families) -> None:
    """Write what bodies feel where families show what they do."""
    forget(contacts.felt)
    for m in range(contacts.families.shape[0]):
        known = contacts.families[m]
        i, chosen = known[FAMILY], contacts.none
        if known[CHOSEN] >= 0:
            chosen = families.cells[known[CHOSEN]]
        add_felt(contacts.first, known, families.cells[i], chosen, families.outs[i], contacts.felt)
