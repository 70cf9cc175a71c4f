"""Damping of free bodies in proportion to mass: their momentum and their angular momentum fade at one rate.

A body of momentum P and angular momentum L about its centre feels the force −γ P and the moment −γ L, so that both fade
as exp(−γ t) where nothing else acts, and the power −γ (v·P + ω·L) ≤ 0 is lost.

May change: the code of `fade`. Must stay: `rotation_terms`, which `damping` calls with its kernels of places; the order
of the numbers of a cell (coefficient of the drag, then W by rows), which `fade` reads; kernel signatures. Tests:
``tests/dynamics/test_bodies_come_to_rest.py``.
"""

from __future__ import annotations

import numpy as np

from ..kernels import FORCE, IMPULSE, kernel
from ..net.rotation import matrix_at, times, times_transposed
from .base import Balance, ForceTerm, Timing, VelocityForce, column


@kernel(FORCE)
def fade(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        s = cells[c, 0]
        m = matrix_at(x, s, cells[c, 1])
        p = times_transposed(m, (v[s, 0], v[s, 1], v[s, 2]))
        mobility = (
            (data[c, 1], data[c, 2], data[c, 3]),
            (data[c, 4], data[c, 5], data[c, 6]),
            (data[c, 7], data[c, 8], data[c, 9]),
        )
        omega = times(m, times(mobility, p))
        out[c, 0] = 0.0
        for k in range(3):
            f[s, k] -= data[c, 0] * v[s, k]
            out[c, 0] -= data[c, 0] * v[s, k] * omega[k]


@kernel(IMPULSE)
def no_impulse(t, x, cells, data, total):
    """Add nothing: moments give no momentum."""


def rotation_terms(net, rate, drag, damping, bound):
    """Terms of the rotation of free bodies at a rate [1/s]; ``drag`` and the others are the kernels of places."""
    spinning = [body for body in net.bodies if body.spin is not None and body.turn is None]
    turning = [body for body in net.bodies if body.turn is not None and not body.moved]
    shared: dict = dict(
        name="damping",
        velocity=VelocityForce(damping, bound),
        balance=Balance("dissipated_energy", 0, impulse=no_impulse),
        timing=Timing(at_rest=False),
    )
    terms = []
    if spinning:
        rows = [body.spin for body in spinning]
        terms.append(ForceTerm(cells=column(rows), data=rate * net.mass[rows, None], force=drag, **shared))
    if turning:
        cells = np.array([(body.spin, body.turn) for body in turning], dtype=np.int32)
        data = [[rate * b.moment_about_centre, *(b.axes.T @ b.mobility @ b.axes).ravel()] for b in turning]
        terms.append(ForceTerm(cells=cells, data=np.array(data), force=fade, **shared))
    return terms
