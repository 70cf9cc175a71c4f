"""Volume and moments of inertia of uniform grown cores, in closed form.

By Steiner's formula, a grown box consists of the box, its faces times a length, its edges times a disc and its corners
times a ball. The moments of each part follow from those of the ball of that dimension.

May change: private functions and how sums are written, with the integrals in `BALLS`. Must stay: volume and tensor of
inertia, which `Shape.volume` and `Shape.inertia` return: they are mass and inertia of bodies that a density gives.
Tests: ``tests/net/test_rotation.py``.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

BALLS = ((1.0, 0.0, 0.0), (2.0, 1.0, 2.0 / 3.0), (math.pi, 4.0 / 3.0, math.pi / 4.0))
BALLS = (*BALLS, (4.0 / 3.0 * math.pi, 0.5 * math.pi, 4.0 / 15.0 * math.pi))
"""∫ 1, ∫ |w|, ∫ w² of a coordinate w over the ball of radius 1 of 0 to 3 dimensions."""


def moments(grown):
    """Volume [m³], and ∫ x², ∫ y², ∫ z² [m⁵] along its axes, shape (3,), of a `refweb.net.rigid_body.Grown`."""
    return (_round if grown.round else _box)(grown.radius, grown.core)


def inertia(grown, mass):
    """Tensor of inertia about its centre of a uniform mass [kg m²], along its axes, shape (3, 3)."""
    volume, squares = moments(grown)
    return mass / volume * np.diag(squares.sum() - squares)


def _box(r, core):
    volume, squares = 0.0, np.zeros(3)
    for beyond in itertools.product((False, True), repeat=3):
        k = sum(beyond)
        ball, first, second = (
            weights_of * r ** (k + power) for weights_of, power in zip(BALLS[k], range(3), strict=True)
        )
        flat = math.prod(2.0 * c for c, out in zip(core, beyond, strict=True) if not out)
        volume += flat * ball
        for n, c in enumerate(core):
            weights_of = c * c * ball + 2.0 * c * first + second if beyond[n] else c * c / 3.0 * ball
            squares[n] += flat * weights_of
    return volume, squares


def _round(r, core):
    a, h = core[0], core[2]
    # Discs of radius a + √(r² − u²) at the heights h + u: powers of √(r² − u²), times those of u.
    w = [r, math.pi / 4.0 * r**2, 2.0 / 3.0 * r**3, 3.0 * math.pi / 16.0 * r**4, 8.0 / 15.0 * r**5]
    u = [r**2 / 2.0, r**3 / 3.0, r**4 / 4.0]
    uu = [r**3 / 3.0, math.pi / 16.0 * r**4, 2.0 / 15.0 * r**5]
    weights = (a * a, 2.0 * a, 1.0)
    area, at, square = (sum(p * q for p, q in zip(weights, polynomial, strict=False)) for polynomial in (w, u, uu))
    fourth = sum(p * q for p, q in zip((a**4, 4.0 * a**3, 6.0 * a**2, 4.0 * a, 1.0), w, strict=True))
    volume = 2.0 * math.pi * (h * (a + r) ** 2 + area)
    across = math.pi / 2.0 * (h * (a + r) ** 4 + fourth)
    along = 2.0 * math.pi * ((a + r) ** 2 * h**3 / 3.0 + h * h * area + 2.0 * h * at + square)
    return volume, np.array([across, across, along])
