"""What an evaluation of all forces leaves: their sum on every row, and what each family observes per cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..effects.base import CONTACT_COLUMNS, TENSION

CONTACT = -2
"""Number that stands, in place of that of a family, for what all families of contact with bodies observe."""


class PerCell(list):
    """What each family observes per cell, an array beside each of some families.

    Attributes
    ----------
    lines : ndarray, shape (elements, columns)
        That of the lines, with tension [N] and strain [1] in the columns `refweb.effects.base.TENSION` and `STRAIN`;
        families over the lines share it.
    contact : ndarray, shape (cells, `refweb.effects.base.CONTACT_COLUMNS`)
        That of all families of contact with bodies, one behind the other; `refweb.system.contact_rows` says which rows
        are of which body.
    """

    def __init__(self, families, elements):
        self.lines = np.zeros((elements, max([2, *(f.observed for f in families if f.lines)])))
        self.contact = np.zeros((sum(len(f.cells) for f in families if f.felt), CONTACT_COLUMNS))
        self._felt, begin = [i for i, family in enumerate(families) if family.felt], 0
        super().__init__()
        for family in families:
            if family.felt:
                self.append(self.contact[begin : begin + len(family.cells)])
                begin += len(family.cells)
            else:
                self.append(self.lines if family.lines else np.zeros((len(family.cells), family.observed)))

    def of(self, number):
        """What a family observes, by its number, or with `CONTACT` all families of contact with bodies."""
        return self.contact if number == CONTACT else self[number]

    def families_of(self, number):
        """Numbers of the families that write that, a list."""
        return self._felt if number == CONTACT else [number]

    @property
    def tension(self):
        """Tension of each element [N], a view of ``lines``."""
        return self.lines[:, TENSION]


class Forces(NamedTuple):
    """Force on every row [N], shape (rows, 3), and what families observe; the next evaluation writes over that."""

    force: np.ndarray
    per_cell: PerCell
