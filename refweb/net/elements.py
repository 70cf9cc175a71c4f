"""Reference line elements on [0, 1] and their quadrature.

The functions of a straight element are 1 − ξ and ξ and its nodes are the ends of the line. Explicit steps need nothing
else, and therefore avoid scikit-fem: its import and that of scipy take as long as that of numba. Elements of higher
order are in `refweb.net.curved`.

May change: how values are computed. Must stay: nodes in the order of columns of `Net.cells`, both ends first; the
number of Gauss points that `gauss` is asked for, on which orders of convergence rest; no import of scikit-fem at the
head (``tests/test_pay_for_what_you_call.py``). `discretisation`, `effects.reel`, `statics.adjoint` and
`system.weak_form` call this file. Must stay as well: `line_element`, which `effects.reel`, `discretisation` and other
files import; `lumped_shares`, which `effects.reel`, `discretisation` and `statics.adjoint` import. Tests:
``tests/net/test_elements.py``.
"""

from __future__ import annotations

import functools

import numpy as np


class Straight:
    """Data of scikit-fem's ``ElementLineP1`` that a net needs."""

    maxdeg = 1
    doflocs = np.array([[0.0], [1.0]])

    def lbasis(self, X, i):
        """Function of node i at X, shape (1, points), and its derivative, shape (1, points)."""
        return (X[0], np.ones_like(X)) if i else (1.0 - X[0], -np.ones_like(X))


def line_element(order):
    """The scalar element of an order, 1, 2 or 3; its two ends come first."""
    if order == 1:
        return Straight()
    from .curved import CURVED

    return CURVED[order]()


@functools.cache
def gauss(points):
    """Gauss–Legendre quadrature on [0, 1]: points, shape (1, points), and weights of sum 1, both read-only."""
    places, weights = np.polynomial.legendre.leggauss(points)
    places, weights = 0.5 * (places[None] + 1.0), 0.5 * weights
    places.setflags(write=False)
    weights.setflags(write=False)
    return places, weights


def lumped_shares(element):
    """Share of each node in the lumped mass of an element, ∫N_a dξ."""
    if element.maxdeg == 1:
        return np.array([0.5, 0.5])
    at, weights = gauss(element.maxdeg + 1)
    return weights @ values(element, at)[0]


def values(element, places):
    """Functions of an element at points, shape (points, nodes), and their derivatives, the same shape."""
    local = np.reshape(places, (1, -1))
    both = [element.lbasis(local, a) for a in range(len(element.doflocs))]
    return np.array([value for value, _ in both]).T.copy(), np.array([slope[0] for _, slope in both]).T.copy()
