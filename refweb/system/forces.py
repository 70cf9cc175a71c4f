"""Result of an evaluation of all forces: their sum on every row, and the values of each family per cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..effects.base import TENSION


class PerCell(list):
    """Values of each family per cell, an array beside each of `System.families`.

    Attributes
    ----------
    lines : ndarray, shape (elements, columns)
        That of the lines, with tension [N] and strain [1] in the columns `refweb.effects.base.TENSION` and `STRAIN`.
    """

    def __init__(self, arrays, lines):
        super().__init__(arrays)
        self.lines = lines

    @property
    def tension(self):
        """Tension of each element [N], a view of ``lines``."""
        return self.lines[:, TENSION]


class Forces(NamedTuple):
    """Force on every row [N], shape (rows, 3), and what families observe."""

    force: np.ndarray
    per_cell: PerCell
