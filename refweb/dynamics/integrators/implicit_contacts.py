"""Families whose kicks an explicit step solves for: their record, and what is done for all of them in turn.

Losses of contact act where its push does, and that push has just been found: of lines with a body only those that show
a depth there are looked at.
"""

from __future__ import annotations

import numpy as np

from ... import kernels as k
from ...effects.base import CELL
from ...kernels import (
    INTEGERS,
    MATRIX,
    Arrays,
    Functions,
    GiveTable,
    Integers,
    IntegerTable,
    KeptTable,
    MatrixTable,
    MeetTable,
    Record,
    SweepTable,
    kernel,
)
from .neighbour_list import near_of, rows_of


class ImplicitContacts(Record):
    """Families whose kicks are solved for.

    Attributes
    ----------
    families : ndarray of int
        Their numbers; ``last`` are the places among these where runs of families with one sweep end.
    meets, recalls, sweeps, gives, memories : table
        Their kernels, see `refweb.effects.base.ImplicitContactKernels`, and what is remembered of the step before,
        within a row.
    depths, elements : ndarray of int, List
        Which ``outs`` of `refweb.dynamics.integrators.records.Families` has depths, −1 for those that have none, and
        for each cell the row in it.
    pieces : int
        Number of cells of a line, which are looked at together.
    width : int
        Number of columns of what touches.
    """

    families: Integers
    meets: MeetTable
    recalls: KeptTable
    sweeps: SweepTable
    gives: GiveTable
    memories: MatrixTable
    last: Integers
    depths: Integers
    elements: IntegerTable
    pieces: int
    width: int

    @classmethod
    def of(cls, system):
        """Those of a system."""
        families = [i for i, family in enumerate(system.families) if family.rubbing is not None]
        terms = [system.families[i] for i in families]
        rubbing = [family.rubbing for family in terms]
        sweeps = [kernels_.sweep for kernels_ in rubbing]
        last = [i for i, sweep in enumerate(sweeps) if sweeps[i + 1 : i + 2] != [sweep]]
        depths = [depths_of(system, family) for family in terms]
        return cls(
            families=np.array(families, dtype=np.int64),
            meets=Functions(k.DETECT, [kernels_.detect for kernels_ in rubbing]),
            recalls=Functions(k.WARM_START, [kernels_.recall for kernels_ in rubbing]),
            sweeps=Functions(k.GAUSS_SEIDEL, sweeps),
            gives=Functions(k.COMMIT, [kernels_.commit for kernels_ in rubbing]),
            last=np.array(last, dtype=np.int64),
            memories=Arrays(MATRIX, [np.zeros((len(f.cells), f.rubbing.memory)) for f in terms]),
            depths=np.array([number for number, _ in depths], dtype=np.int64),
            elements=Arrays(INTEGERS, [elements for _, elements in depths]),
            pieces=system.net.subdivide,
            width=max((kernels_.width for kernels_ in rubbing), default=0),
        )


def depths_of(system, family):
    """(``depths``, ``elements``) of the push of the lines of a family on its bodies, see `ImplicitContacts`."""
    near = near_of(system)
    for i in near if family.contact else ():
        push = system.families[i]
        if push.contact:
            keys, its = (term.elements * system.rows + term.cells[:, system.net.along.size] for term in (family, push))
            order = np.argsort(its)
            matches = order[np.minimum(np.searchsorted(its, keys, sorter=order), len(its) - 1)]
            if (its[matches] == keys).all():
                return len(system.families) + near.index(i), matches
    return -1, np.zeros(0, dtype=np.int64)


@kernel()
def lines_in_touch(depths, elements, pieces):
    """Numbers of the cells of lines that show a depth."""
    chosen, count = np.empty(elements.size, dtype=np.int64), 0
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
def meet_all(h, x, v, inverse, families, implicit_contacts, touches, ends):
    """Write all that touches, and to ``ends`` the rows that each family's end at; ``touches``, or a larger one."""
    while True:
        count = 0
        for m in range(implicit_contacts.families.size):
            i, begin = implicit_contacts.families[m], count
            if implicit_contacts.depths[m] < 0:
                count = implicit_contacts.meets[m](
                    h, x, v, inverse, families.cells[i], families.data[i], touches, count
                )
            else:
                chosen = lines_in_touch(
                    families.outs[implicit_contacts.depths[m]], implicit_contacts.elements[m], implicit_contacts.pieces
                )
                some, some_data = rows_of(chosen, families.cells[i], families.data[i])
                count = implicit_contacts.meets[m](h, x, v, inverse, some, some_data, touches, count)
                for n in range(begin, min(count, touches.shape[0])):
                    touches[n, CELL] = chosen[int(touches[n, CELL])]
            ends[m] = count
        if count <= touches.shape[0]:
            return touches
        touches = np.empty((2 * count, implicit_contacts.width))
