"""Numbers of the elements of lines, by name, over the matrix that kernels read."""

from __future__ import annotations

from typing import Any

import numpy as np

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


class LineData(np.recarray):
    """Numbers of each element, an array of shape (elements,) whose fields are arrays, which may be written.

    Attributes
    ----------
    natural_length, ea : ndarray, shape (elements,)
        Natural length [m] and EA [N].
    slackness, smoothing, g0, r0 : ndarray, shape (elements,)
        ε0, η and their (g0, r0) of `refweb.net.tension_laws`.
    reference : ndarray, shape (elements, 3)
        dX/dξ [m], constant because lines of a web are straight.
    distance : ndarray, shape (elements,)
        Its magnitude [m].
    law, damping_time, rupture_energy : ndarray, shape (elements,)
        Number of the law, where lines have several, and what effects add by `with_column`.
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
    def of(cls, columns, fields=None):
        """Make those of columns in the order of the fields, by default `FIELDS`."""
        matrix = np.ascontiguousarray(np.column_stack(columns), dtype=float)
        return matrix.view(np.dtype(fields or FIELDS)).reshape(len(matrix)).view(cls)

    @property
    def matrix(self):
        """The same numbers as kernels read them, shape (elements, columns)."""
        return np.asarray(self).view(float).reshape(len(self), -1)

    def column(self, name):
        """Number of a column of ``matrix``, for the kernels of the effect that added it."""
        fields: Any = self.dtype.fields
        return fields[name][1] // self.dtype[name].itemsize

    def with_column(self, name, values):
        """The same with one more field; ``values`` are one number or one for each element."""
        if name in self.dtype.names:
            raise ValueError(f"there is a column {name} already")
        return self.of([self.matrix, np.broadcast_to(values, len(self))], [*self.dtype.descr, (name, float)])
