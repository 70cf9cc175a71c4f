"""Result of an evaluation of all forces: their sum on every row, and the values of each term per cell.

May change: the insides of `PerCell`. Must stay: `Forces` is a pair (force, per_cell), which callers unpack;
``per_cell[i]`` belongs to ``System.terms[i]``, and all terms over the lines have the one array ``lines``. Must follow a
change: `System.per_cell`, which makes these arrays, and all kernels that write to them as ``out``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


class PerCell(list[Any]):
    """Values of each term per cell, an array beside each of `System.terms`.

    Attributes
    ----------
    lines : ndarray, shape (elements, columns)
        That of the lines, with the columns of `refweb.effects.base`.
    """

    def __init__(self, arrays: Sequence[NDArray[np.float64]], lines: NDArray[np.float64], tension_column: int) -> None:
        super().__init__(arrays)
        self.lines: NDArray[np.float64] = lines
        self._tension_column = tension_column

    @property
    def tension(self) -> NDArray[np.float64]:
        """Tension of each element [N], with damping where there is some, a view of ``lines``."""
        return self.lines[:, self._tension_column]


class Forces(NamedTuple):
    """Force on every row [N], shape (rows, 3), and what terms observe."""

    force: np.ndarray
    per_cell: PerCell
