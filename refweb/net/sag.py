"""Length of a rope that hangs between two points of equal height, from its sag.

An inextensible rope under its weight is a catenary: with u half of the distance of its ends over the parameter of the
curve, the sag over the distance is sinh²(u/2)/u and the length over the distance sinh(u)/u.

May change: all but `over_chord`, its argument (sag over distance) and its result (length over distance): `net.cable`
alone calls it. Tests: ``tests/studies/test_form.py``.
"""

from __future__ import annotations

import numpy as np


def over_chord(sag):
    """Length over the distance of the ends [1], from sag over that distance [1], both of shape (ropes,)."""
    different, number = np.unique(sag, return_inverse=True)
    return np.array([_over_chord(value) for value in different])[number.ravel()] if len(sag) else np.ones(0)


def _over_chord(sag):
    """Length over the distance of one rope; sinh²(u/2)/u is between u/4 and 0.28 u for u ≤ 1, else above u/4."""
    from scipy.optimize import brentq

    if sag == 0.0:
        return 1.0
    u = brentq(lambda u: np.sinh(0.5 * u) ** 2 / u - sag, min(sag, 1.0), 4.0 * sag, xtol=1e-300, rtol=1e-15)
    return np.sinh(u) / u
