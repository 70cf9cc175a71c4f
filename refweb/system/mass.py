"""Mass of a system: lumped, a number for each row, or consistent, a matrix that couples the rows of an element.

M is the lumped mass on the diagonal plus, for consistent mass, a block of each element whose rows sum to 0. Both masses
therefore move a rigid net in the same way.

May change: how values are computed. Must stay: public names; `values` stand in the pattern of the tangent, and `heavy`
numbers components as 3 row + axis: `cvode`, `ida`, `links` and modes index both. Plug-ins use ``matrix`` and
``factor``. Must stay as well: `refuse_massless`, which `studies.dop853` and `integrators.step_observer` import. Tests:
``tests/effects/test_damping.py``, ``tests/dynamics/integrators/test_cvode.py``.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..errors import InputError


class Mass:
    """M of M v' = f.

    Parameters
    ----------
    net : refweb.net.net.Net
        Lumped mass of each row, and consistent less lumped mass of each element.
    free : ndarray of int
        Components of the unknowns, 3 row + axis.
    pattern : refweb.system.sparsity.Pattern
        Pattern of the unknowns.
    lines : int, optional
        Number of the lines among the terms of the pattern; needed where mass is consistent.
    """

    def __init__(self, net, free, pattern, lines=None):
        self._net, self._free, self._pattern, self._lines = net, free, pattern, lines

    @cached_property
    def values(self):
        """Values of M of the unknowns [kg] in the fixed pattern."""
        net, values = self._net, np.zeros(len(self._pattern.indices))
        if net.consistent_minus_lumped is not None:
            values += self._pattern.assemble_one(self._lines, np.kron(net.consistent_minus_lumped, np.eye(3)))
        values[self._pattern.diagonal] += np.repeat(net.mass, 3)[self._free]
        return values

    @cached_property
    def _heavy(self):
        return np.repeat(self._net.mass, 3)[self._free] > 0.0

    @cached_property
    def heavy(self):
        """Components of the unknowns that have mass."""
        return self._free[self._heavy]

    @property
    def matrix(self):
        """M of the components `heavy`, a `scipy.sparse.csc_array`."""
        return self._pattern.matrix(self.values)[self._heavy][:, self._heavy].tocsc()

    @cached_property
    def factor(self):
        """The LU of `matrix`."""
        from scipy.sparse.linalg import splu

        return splu(self.matrix)

    def moved_by(self, push):
        """M⁻¹ f for a force on every row: accelerations [m/s²] of the free components, shape (rows, 3)."""
        moved = np.zeros((len(self._net.mass), 3))
        moved.ravel()[self.heavy] = self.factor.solve(push.ravel()[self.heavy])
        return moved

    @cached_property
    def _consistent_minus_lumped(self):
        """Difference of consistent and lumped mass of all rows, a sparse matrix [kg]; None where mass is lumped."""
        from scipy.sparse import coo_array

        net, rows = self._net, len(self._net.mass)
        if net.consistent_minus_lumped is None:
            return None
        i = np.repeat(net.cells[:, :, None], net.cells.shape[1], axis=2)
        pairs = (i.ravel(), i.swapaxes(1, 2).ravel())
        return coo_array((net.consistent_minus_lumped.ravel(), pairs), shape=(rows, rows)).tocsr()

    def passed_on(self, acceleration):
        """Difference of consistent and lumped M times an acceleration [N], shape (rows, 3)."""
        return self._consistent_minus_lumped @ acceleration

    def kick(self, jump):
        """Jump of all velocities [m/s] caused by a ``jump`` of prescribed velocities: consistent mass couples them."""
        return jump if self._consistent_minus_lumped is None else jump - self.moved_by(self.passed_on(jump))

    def momentum(self, v):
        """M v of every row [N s], shape (rows, 3)."""
        lumped = self._net.mass[:, None] * v
        return lumped if self._consistent_minus_lumped is None else lumped + self.passed_on(v)


def refuse_massless(system, method):
    """Refuse free nodes without mass, for a method that divides by it."""
    places = len(system.net.mass) - system.net.internal
    bare = np.flatnonzero((system.net.mass <= 0.0)[:places] & ~system.supported.all(axis=1)[:places])
    if len(bare):
        raise InputError(
            f"node {bare[0]} has no mass, which {method} needs: give density > 0 or a [[point_mass]], or use "
            'method = "ida"'
        )
