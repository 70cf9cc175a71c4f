"""Tension laws: stress, tangent and energy density of a cable against its engineering strain.

The smooth law is eqs. (2)–(3) of *Dynamic modelling and analysis of space webs*: with s = ε − ε0 and r = √(s² + 4η²),
σ = E[(s + r)/2 − α]. In that form it loses all digits at small strain and under compression. With
g = (s + r)/2 (for s < 0: 2η²/(r − s)) and g0, r0 its values at ε = 0 the same law reads

    σ = E ε (g + g0)/(r + r0),        dσ/dε = E g/r,        α = g0,

which has a relative error of a few units of round-off everywhere. Under compression the stress tends to the floor −αE.

Two laws are those of form finding. Their tension does not depend on natural length: T = q l of a force density q, and
a constant force. In place of EA they have q L, L the natural length, and the force, so that T = EA (1 + ε) and T = EA.

Scalar functions, one formula for the compiled kernels and for `Law`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..kernels import Vector, kernel
from ..messages import nearest

SMOOTH, TENSION_ONLY, LINEAR, FORCE_DENSITY, CONSTANT_FORCE = range(5)
NAMES = {
    "smooth": SMOOTH,
    "tension-only": TENSION_ONLY,
    "linear": LINEAR,
    "force-density": FORCE_DENSITY,
    "constant-force": CONSTANT_FORCE,
}
FORM_FINDING = (FORCE_DENSITY, CONSTANT_FORCE)
"""Laws of form finding."""
MIXED = len(NAMES)
"""Number of no law, for kernels over lines of several: that of each line stands among its own numbers."""


@kernel(inline="always")
def branch(s, smoothing):
    """(g, r) of the smooth law at s = ε − ε0."""
    r = math.sqrt(s * s + 4.0 * smoothing * smoothing)
    if s >= 0.0:
        return 0.5 * (s + r), r
    return 2.0 * smoothing * smoothing / (r - s), r


@kernel()
def prepared_stress(law, strain, modulus, slackness, smoothing, g0, r0):
    """σ(ε) [Pa], with (g0, r0) = branch(−ε0, η) at hand."""
    if law == LINEAR or (law == TENSION_ONLY and strain > 0.0):
        return modulus * strain
    if law == TENSION_ONLY:
        return 0.0
    if law == FORCE_DENSITY:
        return modulus * (1.0 + strain)
    if law == CONSTANT_FORCE:
        return modulus
    g, r = branch(strain - slackness, smoothing)
    if r + r0 == 0.0:
        return 0.0
    return modulus * strain * ((g + g0) / (r + r0))


@kernel()
def stress(law, strain, modulus, slackness, smoothing):
    """σ(ε) [Pa]."""
    g0, r0 = branch(-slackness, smoothing)
    return prepared_stress(law, strain, modulus, slackness, smoothing, g0, r0)


@kernel()
def tangent(law, strain, modulus, slackness, smoothing):
    """dσ/dε [Pa]; at the kink of a law without smoothing the taut side's."""
    if law == LINEAR or law == FORCE_DENSITY or (law == TENSION_ONLY and strain >= 0.0):
        return modulus
    if law == TENSION_ONLY or law == CONSTANT_FORCE:
        return 0.0
    g, r = branch(strain - slackness, smoothing)
    if r == 0.0:
        return modulus
    return modulus * (g / r)


@kernel()
def curvature(law, strain, modulus, slackness, smoothing):
    """d²σ/dε² [Pa], 2 E η²/r³; 0 for laws without smoothing."""
    _, r = branch(strain - slackness, smoothing)
    if law != SMOOTH or r == 0.0:
        return 0.0
    share = 2.0 * smoothing / r
    return 0.5 * modulus * share * share / r


@kernel()
def above_floor(law, strain, modulus, slackness, smoothing):
    """σ(ε) + αE, how far the stress is above the law's floor [Pa]; infinite for laws without a floor."""
    return math.inf if law >= LINEAR else modulus * branch(strain - slackness, smoothing)[0]


@kernel()
def energy_density(law, strain, modulus, slackness, smoothing):
    """∫ σ dε from 0 [J/m³]; a Taylor series where |ε| is below 1e-4 of the larger of ε0 and 2η."""
    if law == LINEAR or (law == TENSION_ONLY and strain > 0.0):
        return 0.5 * modulus * strain * strain
    if law == TENSION_ONLY:
        return 0.0
    if law == FORCE_DENSITY:
        return modulus * strain * (1.0 + 0.5 * strain)
    if law == CONSTANT_FORCE:
        return modulus * strain
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


STRESS, TANGENT, ENERGY = range(3)


@kernel(leaf=True, apart=())
def evaluate(
    which: int, law: int, strain: Vector, modulus: Vector, slackness: Vector, smoothing: Vector, out: Vector
) -> None:
    """Write stress, tangent or energy density of each strain."""
    for i in range(out.size):
        e, m, s, w = strain[i], modulus[i], slackness[i], smoothing[i]
        if which == STRESS:
            out[i] = stress(law, e, m, s, w)
        elif which == TANGENT:
            out[i] = tangent(law, e, m, s, w)
        else:
            out[i] = energy_density(law, e, m, s, w)


@dataclass(frozen=True)
class Law:
    """A tension law by name, vectorised over strain and parameters.

    Parameters
    ----------
    name : {"smooth", "tension-only", "linear", "force-density", "constant-force"}
        ``smooth`` has slackness ε0 ≥ 0 and smoothing η ≥ 0; ``tension-only`` is its limit η → 0 at ε0 = 0, of convex
        energy; ``linear`` resists compression like a bar; the others are those of form finding.

    Raises
    ------
    InputError
        For an unknown name.

    Notes
    -----
    All methods take engineering strain [1], modulus E [Pa], slackness ε0 [1] and smoothing η [1], which broadcast.
    """

    name: str = "smooth"

    def __post_init__(self):
        if self.name not in NAMES:
            raise InputError(f'law = "{self.name}" is unknown, {nearest(self.name, NAMES)}')

    @property
    def number(self):
        """The law's number in compiled kernels."""
        return NAMES[self.name]

    def _evaluate(self, which, *numbers):
        numbers = np.broadcast_arrays(*numbers)
        out = np.empty(numbers[0].shape)
        evaluate(
            which, self.number, *(np.array(number, dtype=float).reshape(-1) for number in numbers), out.reshape(-1)
        )
        return out[()]

    def stress(self, strain, modulus=1.0, slackness=0.0, smoothing=0.0):
        """Stress σ = T/A [Pa]."""
        return self._evaluate(STRESS, strain, modulus, slackness, smoothing)

    def strain(self, stress, modulus=1.0, slackness=0.0, smoothing=0.0):
        """Strain of a tension, stress σ > 0 [Pa]: ε = ε0 + g − η²/g with g = σ/E + α; of the linear law of any σ."""
        if self.name == "linear":
            return stress / modulus
        g = stress / modulus + self.floor(1.0, slackness, smoothing)
        return slackness + g - smoothing * smoothing / g

    def tangent(self, strain, modulus=1.0, slackness=0.0, smoothing=0.0):
        """Tangent modulus dσ/dε [Pa]."""
        return self._evaluate(TANGENT, strain, modulus, slackness, smoothing)

    def energy_density(self, strain, modulus=1.0, slackness=0.0, smoothing=0.0):
        """Energy per natural volume ∫σ dε, zero at ε = 0 [J/m³]."""
        return self._evaluate(ENERGY, strain, modulus, slackness, smoothing)

    def floor(self, modulus=1.0, slackness=0.0, smoothing=0.0):
        """Largest stress under compression, αE [Pa]; 0 for tension-only, infinite for laws without a floor."""
        if self.name != "smooth":
            return 0.0 * modulus if self.name == "tension-only" else math.inf * modulus
        root = (slackness * slackness + 4.0 * smoothing * smoothing) ** 0.5
        total = root + slackness
        return modulus * (2.0 * smoothing * smoothing / (total + (total == 0.0)))


def strains_of(law, tension, modulus, area, slackness, smoothing):
    """Strain of each line that has a tension [N], 0 of none; arrays of shape (lines,).

    Raises
    ------
    InputError
        For a law of form finding, a line that pushes and whose law does not, and one that pushes with more than its EA.
    """
    strain, stress = np.zeros(len(tension)), tension / area
    for number in np.unique(law):
        name, lines = list(NAMES)[number], (law == number) & (tension != 0.0)
        if number in FORM_FINDING and lines.any():
            raise InputError(f'law = "{name}" is for form finding: give "tension-only", "linear" or "smooth"')
        for line in np.flatnonzero(lines & (tension < 0.0))[:1] if number != LINEAR else ():
            raise InputError(f'line {line} pushes with {-tension[line]:g} N, and law = "{name}" does not: use "linear"')
        strain[lines] = Law(name).strain(stress[lines], modulus[lines], slackness[lines], smoothing[lines])
    for line in np.flatnonzero(strain <= -1.0)[:1]:
        raise InputError(f"line {line} pushes with {-tension[line]:g} N, more than its EA: give it a larger area")
    return strain
