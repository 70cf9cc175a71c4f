"""Result of an evaluation of all forces: their sum on every row, and the values of each term per cell."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class PerCell(list):
    """Values of each term per cell, an array beside each of `System.terms`.

    Attributes
    ----------
    lines : ndarray, shape (elements, columns)
        That of the lines, with the columns of `refweb.effects.base`.
    """

    def __init__(self, arrays, lines, tension_column):
        super().__init__(arrays)
        self.lines, self._tension_column = lines, tension_column

    @property
    def tension(self):
        """Tension of each element [N], with damping where there is some, a view of ``lines``."""
        return self.lines[:, self._tension_column]


class Forces(NamedTuple):
    """Force on every row [N], shape (rows, 3), and what terms observe."""

    force: np.ndarray
    per_cell: PerCell
