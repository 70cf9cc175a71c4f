"""Curved line elements on [0, 1]: the quadratic one of scikit-fem, and a nodal cubic, which scikit-fem lacks.

May change: nothing of the functions: they are the elements of order 2 and 3. Must stay: `CURVED`, the elements by their
order, which `elements` takes; both ends first among the nodes, as columns of `Net.cells` have them and `results.vtu`
expects; names that scikit-fem asks of an element (``doflocs``, ``maxdeg``, ``lbasis``, …). Tests:
``tests/net/test_elements.py``, ``tests/system/test_orders.py``.
"""

from __future__ import annotations

import numpy as np
import skfem
from skfem.element import ElementH1
from skfem.refdom import RefLine

_INNER = 0.5 - 0.1 * np.sqrt(5.0)
_NODES = np.array([0.0, 1.0, _INNER, 1.0 - _INNER])
_POWERS = np.linalg.inv(np.vander(_NODES, increasing=True))  # column a: coefficients of node a's function
_SLOPES = np.arange(1, 4)[:, None] * _POWERS[1:]


class ElementLineP3(ElementH1):
    """Nodal cubic on the four Gauss–Lobatto points 0, (1 ∓ 1/√5)/2, 1.

    The integrals of its functions are the weights of Gauss–Lobatto quadrature, 1/12 and 5/12, so that its row-sum
    lumped mass is positive and keeps the order of the frequencies (spectral elements; Cohen, *Higher-Order Numerical
    Methods for Transient Wave Equations*, 2002, doi:10.1007/978-3-662-04823-8). The cubic of scikit-fem,
    ``ElementLinePp(3)``, is hierarchical: its inner functions belong to no node, and their integrals have no fixed
    sign.
    """

    nodal_dofs = 1
    interior_dofs = 2
    maxdeg = 3
    dofnames = ["u", "u", "u"]
    doflocs = _NODES[:, None]
    refdom = RefLine

    def lbasis(self, X, i):
        """Function of node i at X, shape (1, points), and its derivative, shape (1, points)."""
        if not 0 <= i < 4:
            self._index_error()
        x = X[0]
        return np.polyval(_POWERS[::-1, i], x), np.polyval(_SLOPES[::-1, i], x)[None]


CURVED = {2: skfem.ElementLineP2, 3: ElementLineP3}
"""Elements by their order."""
