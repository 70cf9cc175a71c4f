"""The smooth law, eqs. (2)–(3) of *Dynamic modelling and analysis of space webs*.

With s = ε − ε0 and r = √(s² + 4η²), σ = E[(s + r)/2 − α]. In that form it loses all digits at small strain and under
compression. With g = (s + r)/2 (for s < 0: 2η²/(r − s)) and g0, r0 its values at ε = 0 the same law reads

    σ = E ε (g + g0)/(r + r0),        dσ/dε = E g/r,        α = g0,

which has a relative error of a few units of round-off everywhere. Under compression the stress tends to the floor −αE.

May change: only all formulas together, as they are of one law. Must stay: accuracy of a few units of rounding at small
strains; `Smooth`, whose energy `statics.lowest` uses and whose inverse it repeats. Tests: ``tests/net/test_laws.py``.
"""

# Kernels in classes are no methods:
# pyright: reportArgumentType=false, reportOperatorIssue=false

from __future__ import annotations

import math

import numpy as np

from ...kernels import kernel
from .law import TensionLaw


@kernel(inline="always")
def branch(s, smoothing):
    """(g, r) of the smooth law at s = ε − ε0."""
    r = math.sqrt(s * s + 4.0 * smoothing * smoothing)
    if s >= 0.0:
        return 0.5 * (s + r), r
    return 2.0 * smoothing * smoothing / (r - s), r


class Smooth(TensionLaw):
    """Slack below ε0 ≥ 0, linear above, with a passage of the width η ≥ 0; under compression it tends to −αE."""

    name = "smooth"
    pushes = cone = smoothed = True

    @kernel()
    def stress(strain, line):
        g, r = branch(strain - line.slackness, line.smoothing)
        if r + line.r0 == 0.0:
            return 0.0
        return line.ea * strain * ((g + line.g0) / (r + line.r0))

    @kernel()
    def tangent(strain, line):
        g, r = branch(strain - line.slackness, line.smoothing)
        if r == 0.0:
            return line.ea
        return line.ea * (g / r)

    @kernel()
    def curvature(strain, line):
        """2 E η²/r³."""
        _, r = branch(strain - line.slackness, line.smoothing)
        if r == 0.0:
            return 0.0
        share = 2.0 * line.smoothing / r
        return 0.5 * line.ea * share * share / r

    @kernel()
    def above_floor(strain, line):
        return line.ea * branch(strain - line.slackness, line.smoothing)[0]

    @kernel()
    def energy_density(strain, line):
        """A Taylor series where |ε| is below 1e-4 of the larger of ε0 and 2η."""
        slackness, smoothing, modulus = line.slackness, line.smoothing, line.ea
        s = strain - slackness
        g0, r0 = branch(-slackness, smoothing)
        if abs(strain) < 1e-4 * max(slackness, 2.0 * smoothing):
            q = 2.0 * smoothing * smoothing / (r0 * r0 * r0)
            rest = strain * (q / 6.0) * (1.0 + 0.75 * strain * slackness / (r0 * r0))
            return modulus * strain * strain * (0.5 * g0 / r0 + rest)
        g, r = branch(s, smoothing)
        energy = 0.5 * (s * g + slackness * g0) - g0 * strain
        if smoothing > 0.0:
            twice = 2.0 * smoothing
            energy += smoothing * smoothing * (math.asinh(s / twice) + math.asinh(slackness / twice))
        return modulus * energy

    @classmethod
    def strain_of(cls, tension, lines):
        """ε = ε0 + g − η²/g with g = σ/E + α."""
        g = tension / lines.ea + cls.floor(lines) / lines.ea
        return lines.slackness + g - lines.smoothing * lines.smoothing / g

    @classmethod
    def floor(cls, lines):
        """αE of each line."""
        slackness, smoothing = lines.slackness, lines.smoothing
        total = np.sqrt(slackness * slackness + 4.0 * smoothing * smoothing) + slackness
        return lines.ea * (2.0 * smoothing * smoothing / (total + (total == 0.0)))
