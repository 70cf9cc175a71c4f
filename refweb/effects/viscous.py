"""Viscoelastic lines: Maxwell arms beside the spring of the law, the generalized standard linear solid.

An arm is a spring of modulus Eₖ in series with a dashpot of time τₖ. Its state is the strain zₖ of the dashpot; a line
of cross section A has, at the strain ε,

    tension             A max(σ(ε) + Σ Eₖ (ε − zₖ), min(σ(ε), 0))
    rate of the state   z'ₖ = (e − zₖ)/τₖ
    energy              A L [w(e) + ½ Σ Eₖ (e − zₖ)²],    w = ∫ σ dε
    dissipated power    A L Σ Eₖ (e − zₖ)²/τₖ ≥ 0.

e is the strain of the material. It is ε in a taut line. The arms of a slack line do not make it push: its material is
free of tension, with σ(e) + Σ Eₖ (e − zₖ) = 0, e > ε, and creeps back by itself while the line hangs loose. So the
tension is the gradient of the energy in taut and slack lines, and the energy balance is closed. A law that resists
compression like a bar pushes, and so do its arms: e = ε. Where natural length L changes with time, ε is that of L at
the time, and so are the rates.

The states are rows of the unknowns behind all places, `refweb.effects.base.InternalVariables`, three to a row, those of
a quadrature point after those of the one before.

May change: `ROUNDS` and `SHORT`. Must stay: the columns behind `ROW` (bar, then EA and τ of each arm), which kernels
read by position; the names ``arm_time_…``, by which `of` counts arms; the order of what `kernels` returns, with ∂E/∂L
as the last; the order of states in rows; `refuse_beside`, which `damping` calls; `ViscousArms`, which `build` imports.
Tests: ``tests/effects/test_viscous.py``, ``tests/test_contract.py``.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..compiled.rows import record_at
from ..errors import InputError
from ..kernels import BOUND, ENERGY, FORCE, RELAX, STIFFNESS, kernel
from . import elasticity
from .base import (
    LINE_OUT,
    POWER,
    Balance,
    CellElements,
    ForceTerm,
    InternalVariables,
    Tangent,
    Timing,
    with_internal,
    with_numbers,
)
from .line_kernels import add_row_sums, add_stiffness, internal_number, line_at, pull_together, strain

if TYPE_CHECKING:
    from ..net.cable import Viscous

ROW = "arm_row"
"""Column of line data with the first row of the states of an element, 1 of a bar, EA [N] and τ [s] of each arm."""
ROUNDS = 100
"""Largest number of rounds of Newton's method, or of halvings, for the strain of a material without tension."""
SHORT = 0.01
"""Step over τ below which the dissipated energy is integrated by Simpson's rule, to 1e-10: the exact formula cancels.
"""


@kernel()
def lost_square(h, time, before, rate):
    """(e − z at the end of a step, ∫ (e − z)² dt) where e has a constant rate, from e − z ``before``."""
    share, steady = h / time, time * rate
    decay = math.exp(-share)
    after = before * decay - steady * math.expm1(-share)
    if share < SHORT:
        middle = before * math.exp(-0.5 * share) - steady * math.expm1(-0.5 * share)
        return after, h / 6.0 * (before * before + 4.0 * middle * middle + after * after)
    apart = before - steady
    square = steady * steady * h + 2.0 * steady * apart * time * (1.0 - decay)
    return after, max(square + 0.5 * apart * apart * time * (1.0 - decay * decay), 0.0)


@functools.cache
def kernels(law, record, first, arms, gradients, weights):
    """Force, energy, stiffness, bound, power, relaxation and length kernels.

    Parameters
    ----------
    law, record, gradients, weights
        As of `refweb.effects.elasticity.kernels`.
    first : int
        Number of the column `ROW`.
    arms : int
        Number of arms.
    """
    points, nodes = len(gradients), len(gradients[0])
    flat = tuple(value for row in gradients for value in row)
    stress, tangent, energy_density = law.stress, law.tangent, law.energy_density
    by_law_alone = elasticity.kernels(law, record, gradients, weights)[-1]

    @kernel()
    def free_strain(weighted, total, line):
        """Strain at which a material has no tension; ``weighted`` is Σ EAₖ zₖ and ``total`` Σ EAₖ."""
        if weighted <= 0.0:
            return weighted / total
        low, high = weighted / (line.ea + total), weighted / total  # the slope of a law is at most EA
        e = low
        for _ in range(ROUNDS):
            off = max(stress(e, line), 0.0) + total * e - weighted
            low, high = (e, high) if off <= 0.0 else (low, e)
            before, e = e, e - off / (tangent(e, line) + total)
            if abs(e - before) <= 4e-16 * e:
                break
            if not low <= e <= high:
                e = 0.5 * (low + high)
        return e

    @kernel(forceinline=True)
    def arm(data, c, k):
        """EA of an arm [N], 0 of a broken element."""
        return 0.0 if line_at(data, c).ea == 0.0 else data[c, first + 2 + 2 * k]

    @kernel(forceinline=True)
    def state_of(x, data, c, q, k):
        """z of an arm at quadrature point q of cell c."""
        return internal_number(x, int(data[c, first]), q * arms + k)

    @kernel()
    def arms_at(x, e, data, c, q):
        """(Tension by the law, tension of the arms, Σ EA [N], e of the material) at quadrature point q of cell c."""
        line, weighted, total = record_at(record, data, c, 0), 0.0, 0.0
        for k in range(arms):
            weighted += arm(data, c, k) * state_of(x, data, c, q, k)
            total += arm(data, c, k)
        by_law, pull = stress(e, line), total * e - weighted
        if data[c, first + 1] > 0.0 or pull + max(by_law, 0.0) >= 0.0:
            return by_law, pull, total, e
        return by_law, -max(by_law, 0.0), total, free_strain(weighted, total, line)

    @kernel()
    def density(x, e, material, data, c, q):
        """Energy of the arms over length [J/m] at quadrature point q of cell c, with what the law has more by them."""
        energy, line = 0.0, record_at(record, data, c, 0)
        for k in range(arms):
            energy += 0.5 * arm(data, c, k) * (material - state_of(x, data, c, q, k)) ** 2
        if material != e:
            energy += energy_density(max(material, 0.0), line) - energy_density(max(e, 0.0), line)
        return energy

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            largest, length, row = 0.0, line_at(data, c).natural_length, int(data[c, first])
            for q in range(points):
                p0, p1, p2, inverse, e = strain(x, cells, data, c, q, nodes, flat)
                by_law, pull, _, material = arms_at(x, e, data, c, q)
                if q == 0 or by_law + pull > largest:
                    largest = by_law + pull
                pull_together(f, cells, c, q, nodes, flat, weights[q] * pull * inverse, p0, p1, p2)
                for k in range(arms):
                    number, stretch = q * arms + k, material - state_of(x, data, c, q, k)
                    f[row + number // 3, number % 3] += weights[q] * length * arm(data, c, k) * stretch
            record_at(LINE_OUT, out, c, 0).damped_tension = largest

    @kernel(ENERGY)
    def energy(t, x, cells, data, out):
        for c in range(cells.shape[0]):
            total = 0.0
            for q in range(points):
                e = strain(x, cells, data, c, q, nodes, flat)[4]
                total += weights[q] * density(x, e, arms_at(x, e, data, c, q)[3], data, c, q)
            out[c] = total * line_at(data, c).natural_length

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        blocks[:] = 0.0
        for c in range(cells.shape[0]):
            line = record_at(record, data, c, 0)
            for q in range(points):
                p0, p1, p2, inverse, e = strain(x, cells, data, c, q, nodes, flat)
                _, pull, total, material = arms_at(x, e, data, c, q)
                taut, begin = material == e, 3 * nodes + q * arms
                slope = total
                if not taut:
                    slope = -tangent(e, line) if e > 0.0 else 0.0
                along = weights[q] * (0.0 if definite and slope < 0.0 else slope) / line.natural_length
                across = 0.0 if definite and pull < 0.0 else weights[q] * pull * inverse
                p = (p0 * inverse, p1 * inverse, p2 * inverse)
                add_stiffness(blocks, c, q, nodes, flat, along, across, p)
                for a in range(nodes):
                    for i in range(3):
                        for k in range(arms if taut else 0):
                            mixed = -weights[q] * flat[q * nodes + a] * p[i] * arm(data, c, k)
                            blocks[c, 3 * a + i, begin + k] += mixed
                            blocks[c, begin + k, 3 * a + i] += mixed
                free = 0.0
                if not taut:
                    free = 1.0 / ((tangent(material, line) if material > 0.0 else 0.0) + total)
                for k in range(arms):
                    pulls = weights[q] * line.natural_length * arm(data, c, k)
                    blocks[c, begin + k, begin + k] += pulls
                    for j in range(arms):
                        blocks[c, begin + k, begin + j] -= pulls * arm(data, c, j) * free

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            axial = 0.0
            for k in range(arms):
                axial += arm(data, c, k) / line_at(data, c).natural_length
            for q in range(points):
                add_row_sums(rates, cells, c, q, nodes, flat, weights[q], axial)

    @kernel(FORCE)
    def power(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            lost = 0.0
            for q in range(points):
                e = strain(x, cells, data, c, q, nodes, flat)[4]
                material = arms_at(x, e, data, c, q)[3]
                for k in range(arms):
                    stretch = material - state_of(x, data, c, q, k)
                    lost += weights[q] * arm(data, c, k) * stretch * stretch / data[c, first + 3 + 2 * k]
            record_at(LINE_OUT, out, c, 0).power = -lost * line_at(data, c).natural_length

    @kernel()
    def at_end(h, e, before, x, data, c, q):
        """Strain of the material at the end of a step, from that ``before``, where the line has e.

        Arms bear EAₖ ((e' − e) φₖ + stretchₖ exp(−h/τₖ)) there, φₖ = (1 − exp(−h/τₖ)) τₖ/h; where that makes the line
        push, it is slack.
        """
        line, weighted, total = record_at(record, data, c, 0), 0.0, 0.0
        for k in range(arms):
            share = h / data[c, first + 3 + 2 * k]
            slope, left = -math.expm1(-share) / share, math.exp(-share) * (before - state_of(x, data, c, q, k))
            weighted += arm(data, c, k) * (slope * before - left)
            total += arm(data, c, k) * slope
        if data[c, first + 1] > 0.0 or total * e - weighted + max(stress(e, line), 0.0) >= 0.0:
            return e
        return free_strain(weighted, total, line)

    @kernel(RELAX)
    def relax(h, x, cells, data, before, lost):
        for c in range(cells.shape[0]):
            lost[c], row, length = 0.0, int(data[c, first]), line_at(data, c).natural_length
            for q in range(points):
                e, at = strain(x, cells, data, c, q, nodes, flat)[4], c * points + q
                if h == 0.0 or line_at(data, c).ea == 0.0:
                    before[at] = arms_at(x, e, data, c, q)[3]
                    continue
                material = at_end(h, e, before[at], x, data, c, q)
                rate = (material - before[at]) / h
                for k in range(arms):
                    number, time = q * arms + k, data[c, first + 3 + 2 * k]
                    stretch, square = lost_square(h, time, before[at] - state_of(x, data, c, q, k), rate)
                    x[row + number // 3, number % 3] = material - stretch
                    lost[c] += weights[q] * length * arm(data, c, k) * square / time
                before[at] = material

    @kernel(ENERGY)
    def length_force(t, x, cells, data, out):
        by_law_alone(t, x, cells, data, out)
        for c in range(cells.shape[0]):
            for q in range(points):
                e = strain(x, cells, data, c, q, nodes, flat)[4]
                _, pull, _, material = arms_at(x, e, data, c, q)
                out[c] += weights[q] * (density(x, e, material, data, c, q) - (1.0 + e) * pull)

    return force, energy, stiffness, bound, power, relax, length_force


def of(net):
    """The kernels for the laws, the arms and the element of a net."""
    names = [*net.line_data.dtype.names]
    arms = sum(name.startswith("arm_time_") for name in names)
    return kernels(net.law, net.law_record, net.line_data.column(ROW), arms, *net.quadrature)


def length_force(net):
    """The kernel of ∂E/∂L of each element [N], arms included."""
    return of(net)[-1]


@dataclass(frozen=True)
class ViscousArms:
    """Arms of the lines of a cable.

    Parameters
    ----------
    viscous : refweb.net.cable.Viscous
        The arms.
    """

    viscous: Viscous

    def add_internal(self, net):
        """The net with rows for the states of the arms behind all others, and numbers of the arms by element."""
        arms, stiffness = self.viscous.arms, net.area * np.isin(net.line, self.viscous.chosen(net.web))
        net = with_internal(net, ROW, len(arms) * len(net.weights), length_force)
        net = net.with_column("arm_bar", net.law_is("bar").astype(float))
        for k, (modulus, time) in enumerate(arms):
            net = net.with_column(f"arm_ea_{k}", modulus * stiffness).with_column(f"arm_time_{k}", time)
        return net

    def on(self, net):
        """Terms of the springs of the arms, with the tension of lines and arms, and of their dashpots."""
        force, energy, stiffness, bound, power, relax, _ = of(net)
        first = len(net.points) - net.internal
        rows = first + np.arange(net.rows_of_elements, dtype=np.int32).reshape(len(net.cells), -1)
        cells = np.hstack([net.cells, rows.astype(np.int32)])
        resistance = np.array([net.line_data[f"arm_ea_{k}"] * tau for k, (_, tau) in enumerate(self.viscous.arms)])
        by_component = (resistance.T[:, None, :] * net.weights[:, None]).reshape(len(net.cells), -1)
        element, number = np.nonzero(by_component)
        springs = ForceTerm(
            name="viscous",
            cells=cells,
            data=None,
            force=force,
            energy=energy,
            tangent=Tangent(stiffness, bound),
            balance=Balance("strain_energy", internal=True),
            timing=Timing(at_rest=self.viscous.statics == "short"),
            elements=CellElements(adds_tension=True),
        )
        dashpots = ForceTerm(
            name="viscous",
            cells=net.cells,
            data=None,
            force=power,
            balance=Balance("dissipated_energy", POWER, internal=True),
            timing=Timing(at_rest=False),
            elements=CellElements(
                internal=InternalVariables(
                    components=3 * rows[element, 0].astype(np.int64) + number,
                    elements=element,
                    resistance=by_component[element, number],
                    relax=relax,
                    space=len(net.cells) * len(net.weights),
                    title="[cable.viscous]",
                )
            ),
        )
        return [springs, dashpots]

    def settled(self, net, x):
        """Displacement of all rows [m] with arms that have come to rest, or as new where statics is "short"."""
        x = with_numbers(net, x, np.zeros((len(net.cells), 0)))
        if self.viscous.statics == "short":
            return x
        strain = elasticity.strains(net, x)
        strain = np.where(net.law_is("bar")[:, None], strain, np.maximum(strain, 0.0))
        return with_numbers(net, x, np.repeat(strain, len(self.viscous.arms), axis=1))


def refuse_beside(net, what):
    """Refuse ``what`` beside arms or lines that yield; `InputError`."""
    if ROW in net.line_data.dtype.names:
        raise InputError(f"{what} cannot stand beside [cable.viscous]: give it one more arm, of a short time, instead")
    if net.wound:
        raise InputError(f"{what} cannot stand beside lines on a [[winch]]: damp with rate = ... [1/s]")
    if net.rows_of_elements:
        raise InputError(f'{what} cannot stand beside law = "elastic-plastic": damp with rate = ... [1/s]')
