"""Numbers of the elements of lines, by name, over the matrix that kernels read.

May change: how the matrix is kept. Must stay: names and order of `FIELDS`, which `discretisation` fills and all kernels
over lines read; new columns behind them, as effects add theirs by name; `LineData`, which `net.discretisation`,
`net.net` and other files import; `offsets`, which `net.discretisation` imports. Tests: ``tests/net/test_elements.py``,
``tests/test_contract.py``.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

FIELDS = [
    ("natural_length", float),
    ("ea", float),
    ("slackness", float),
    ("smoothing", float),
    ("g0", float),
    ("r0", float),
    ("reference", float, (3,)),
    ("distance", float),
]
"""Columns of every net; kernels know them by `refweb.effects.line_kernels`."""


def offsets(slackness, smoothing):
    """(g0, r0) of the smooth law."""
    r0 = np.sqrt(slackness**2 + 4.0 * smoothing**2)
    return 2.0 * smoothing**2 / np.where(r0 > 0.0, r0 + slackness, 1.0), r0


class LineData(np.recarray):
    """Numbers of each element, an array of shape (elements,) whose fields are arrays, which may be written.

    Attributes
    ----------
    natural_length, ea : ndarray, shape (elements,)
        Natural length [m] and EA [N].
    slackness, smoothing, g0, r0 : ndarray, shape (elements,)
        ε0, η and their (g0, r0) of the smooth law, see `refweb.net.laws`.
    reference : ndarray, shape (elements, 3)
        dX/dξ [m], constant because lines of a web are straight.
    distance : ndarray, shape (elements,)
        Its magnitude [m].
    law, damping_time, rupture_energy : ndarray, shape (elements,)
        Number of the law, where lines have several, and what laws and effects add by `with_column`.
    """

    natural_length: np.ndarray
    ea: np.ndarray
    slackness: np.ndarray
    smoothing: np.ndarray
    g0: np.ndarray
    r0: np.ndarray
    reference: np.ndarray
    distance: np.ndarray
    law: np.ndarray
    damping_time: np.ndarray
    rupture_energy: np.ndarray

    @classmethod
    def of(cls, columns: Any, fields: Any = None) -> LineData:
        """Make the line data of columns in the order of the fields, by default `FIELDS`."""
        matrix = np.ascontiguousarray(np.column_stack(columns), dtype=float)
        return matrix.view(np.dtype(fields or FIELDS)).reshape(len(matrix)).view(cls)

    @classmethod
    def of_law(cls, ea: Any, slackness: Any = 0.0, smoothing: Any = 0.0, **columns: Any) -> LineData:
        """Make the line data of lines of length 1 with all numbers that laws read, from arrays that broadcast."""
        ea, slackness, smoothing = (np.ravel(value) for value in np.broadcast_arrays(ea, slackness, smoothing))
        numbers = [np.ones(len(ea)), ea, slackness, smoothing, *offsets(slackness, smoothing)]
        lines = cls.of([*numbers, np.zeros((len(ea), 4))])
        return lines.with_law(columns)

    def with_law(self, columns: dict[str, Any]) -> LineData:
        """Line data with numbers of a law by column: those of `FIELDS` are replaced, others are added."""
        lines = self
        for name, values in columns.items():
            if name in (self.dtype.names or ()):
                lines[name] = values
            else:
                lines = lines.with_column(name, values)
        return lines

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """The numbers as kernels read them, shape (elements, columns), in the same memory."""
        return np.asarray(self).view(float).reshape(len(self), -1)

    def column(self, name: str) -> int:
        """Number of a column of ``matrix``, for the kernels of the effect that added it."""
        fields: Any = self.dtype.fields
        return fields[name][1] // self.dtype[name].itemsize

    def with_column(self, name: str, values: float | NDArray[np.float64]) -> LineData:
        """Line data with one more field; ``values`` are one number or one for each element."""
        if name in (self.dtype.names or ()):
            raise ValueError(f"there is a column {name} already")
        return self.of([self.matrix, np.broadcast_to(values, len(self))], [*self.dtype.descr, (name, float)])
