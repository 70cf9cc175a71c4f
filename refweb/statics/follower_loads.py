"""Newton's method for forces without a potential: unsymmetric tangents, and steps judged by the residual.

Loads that turn with the net have no energy to search along. A step p = J⁻¹r, J the tangent with its prestress, is taken
as long as it makes the next one shorter: |J⁻¹r(x + ap)| < |p|, the natural monotonicity test [1]_, a residual in units
of displacement that neither the scale of forces nor that of stiffnesses changes.

References
----------
.. [1] P. Deuflhard, "Newton Methods for Nonlinear Problems", Springer 2011, section 2.1, doi:10.1007/978-3-642-23899-4.
"""

from __future__ import annotations

import numpy as np


class Lu:
    """LU of matrices of one `refweb.system.sparsity.Pattern`, with the interface of a `Factor`."""

    def __init__(self, pattern):
        self.pattern = pattern

    def update(self, values):
        """Factorize the matrix of these values."""
        from scipy.sparse.linalg import splu

        try:
            self._lu = splu(self.pattern.matrix(values), permc_spec="MMD_AT_PLUS_A")
        except RuntimeError:  # exactly singular
            self._lu = None

    def solve(self, b):
        """Solution of A y = b, shape (n,); None where there is none."""
        if self._lu is None:
            return None
        y = self._lu.solve(b)
        return y if np.isfinite(y).all() else None


def search(system, factor, t, x, p, shift, stats):
    """x + ap with the first a = 1, 1/2, ... that makes the next step shorter, and the next prestress."""
    start, y, a, size = x.ravel()[system.free], x.copy(), 1.0, np.linalg.norm(p)
    for _ in range(40):
        y.ravel()[system.free] = start + a * p
        ahead = factor.solve(system.force(t, y).ravel()[system.free])
        stats["nfev"] += 1
        length, along = np.linalg.norm(ahead), ahead @ p
        if length < size or (length < 2.0 * size and along > 0.9 * length * size):
            break
        a *= 0.5
    if a < 1.0:
        return y, 4.0 * shift
    return y, 0.1 * shift if along > 0.0 or length < 0.25 * size else shift
