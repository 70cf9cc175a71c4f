"""Laws of straight parts: lines that only pull, bars, and the two of form finding.

Tension of the laws of form finding does not depend on natural length: T = q l of a force density q, and a constant
force. In place of EA they have q L, L the natural length, and the force, so that T = EA (1 + ε) and T = EA.

May change: nothing of the formulas without a change of all results. Must stay: names in `registry.LAWS`, which are the
scene format; `convex`, `cone`, `bar`, `forming` and `plastic`, on which proofs of errors in statics rest. Tests:
``tests/net/test_laws.py``, ``tests/test_contract.py``.
"""

# Kernels in classes are no methods:
# pyright: reportArgumentType=false, reportOperatorIssue=false

from __future__ import annotations

from ...kernels import kernel
from .law import TensionLaw, zero


class TensionOnly(TensionLaw):
    """The smooth law at η → 0 and ε0 = 0: linear above the natural length, slack below."""

    name = "tension-only"
    convex = cone = True

    @kernel()
    def stress(strain, line):
        if strain > 0.0:
            return line.ea * strain
        return 0.0

    @kernel()
    def tangent(strain, line):
        if strain >= 0.0:
            return line.ea
        return 0.0

    @kernel()
    def energy_density(strain, line):
        if strain > 0.0:
            return 0.5 * line.ea * strain * strain
        return 0.0

    @classmethod
    def strain_of(cls, tension, lines):
        """σ/E."""
        return tension / lines.ea


class ElasticPlastic(TensionOnly):
    """The elastic part of lines that yield; the rest is in `refweb.effects.plastic`."""

    name = "elastic-plastic"
    plastic = True
    convex = cone = False


class Linear(TensionLaw):
    """Linear in tension and compression, like a bar."""

    name = "linear"
    bar = pushes = True

    @kernel()
    def stress(strain, line):
        return line.ea * strain

    @kernel()
    def tangent(strain, line):
        return line.ea

    @kernel()
    def energy_density(strain, line):
        return 0.5 * line.ea * strain * strain

    @classmethod
    def strain_of(cls, tension, lines):
        """σ/E, of any σ."""
        return tension / lines.ea


class ForceDensity(TensionLaw):
    """A tension in proportion to length; negative pushes."""

    name = "force-density"
    forming = pushes = convex = True

    @kernel()
    def stress(strain, line):
        return line.ea * (1.0 + strain)

    @kernel()
    def tangent(strain, line):
        return line.ea

    @kernel()
    def energy_density(strain, line):
        return line.ea * strain * (1.0 + 0.5 * strain)


class ConstantForce(TensionLaw):
    """A force that does not depend on length; negative pushes."""

    name = "constant-force"
    forming = pushes = True
    tangent = zero

    @kernel()
    def stress(strain, line):
        return line.ea

    @kernel()
    def energy_density(strain, line):
        return line.ea * strain
