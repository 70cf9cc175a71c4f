"""Lines that yield: elastic–plastic tension with hardening, which goes slack at its plastic strain and never pushes.

The state of a line is its plastic strain p ≥ 0. With the yield stress Y(p), which does not fall, and σ₀ = E max(ε − p,
0),

    stress          σ₀ while σ₀ ≤ Y(p); else p grows to where E (ε − p) = Y(p)      (return mapping)
    tangent         E, 0 of a slack line, E Y'/(E + Y') of one that yields           (consistent)
    energy          A L ½ E max(ε − p, 0)², kept, and A ∫ L Y dp, lost.

A line that does not push yields in one direction alone, so that p is the largest that the strain has asked for. Within
a step the energy that it loses, the area of its loops, is a function of p, and the sum of both energies is the
incremental potential: convex in the strain, and its gradient is the tension for any p of before. So states of steps
that do not turn back need no history within the step. L is the natural length at which the line yields, the mean of
those between which p grows: material that a reel pays out has lost nothing, and takes none of the energy along. Beside
``law = "elastic-plastic"``, whose term has the elastic tension of p = 0, this term has the rest.

Numbers of each element stand in rows behind all places, see `refweb.effects.base.InternalVariables`: p of each
quadrature point, then the energy that each has lost over A Y(0) [m], and L of the element [m], 0 before it is known.
They are no unknowns: explicit steps take them on at their ends, load steps of statics at equilibria, and CVODE and IDA
at the ends of the pieces of their steps, which end where a line that yields turns back.

May change: `ROUNDING`. Must stay: the name "plastic", by which `statics.monotone_loading` leaves the terms out; the
columns behind `ROW` (curve of the yield stress), which kernels read by position and `corners` counts by
``plastic_force_…``; the order of what `kernels` returns, which this file takes by number; the order of internal
variables in rows; ``taken_on``, ``grown``, ``drive`` and ``settled``, which `System` and `integrators.yielding` call
through `InternalVariables.follower`; `PlasticLines`, which `build` imports; `strain_at`, which `rupture`,
`statics.monotone_loading` and `integrators.rupture` import; `plastic_strain`, which `results.state`,
`statics.monotone_loading` and `integrators.rupture` import. Tests: ``tests/effects/test_plastic.py``.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..compiled.rows import record_at
from ..kernels import ENERGY, FORCE, RELAX, STIFFNESS, kernel
from ..net.plastic_keys import yield_curves
from . import elasticity
from .base import (
    LINE_OUT,
    Balance,
    CellElements,
    ForceTerm,
    InternalVariables,
    Tangent,
    no_force,
    with_internal,
    with_numbers,
)
from .line_kernels import add_stiffness, internal_number, line_at, pull_together, strain

if TYPE_CHECKING:
    from ..net.cable import Cable

ROW = "plastic_row"
"""Column of line data with the first row of an element; p and A Y [N] of each point of the curve follow it."""
ROUNDING = 1e-12
"""Stress above the yield stress, over it, up to which a line does not yield: it is there by rounding."""


@functools.cache
def kernels(law, record, first, corners, gradients, weights):
    """Force, energy kept, stiffness, energy lost, relaxation, length and strain kernels.

    Parameters
    ----------
    law, record, gradients, weights
        As of `refweb.effects.elasticity.kernels`.
    first : int
        Number of the column `ROW`.
    corners : int
        Number of points of the curve of yield stress over plastic strain; its last slope goes on.
    """
    points, nodes = len(gradients), len(gradients[0])
    flat, stress = tuple(value for row in gradients for value in row), law.stress
    by_law_alone = elasticity.kernels(law, record, gradients, weights)[-1]

    @kernel()
    def plastic(e, p, data, c):
        """(p, slope of A Y over p where the line yields, −1 where it does not) at a strain, from p of before."""
        ea, yields = line_at(data, c).ea, -1.0
        for i in range(corners - 1):
            p0, y0 = data[c, first + 1 + 2 * i], data[c, first + 2 + 2 * i]
            p1, y1 = data[c, first + 3 + 2 * i], data[c, first + 4 + 2 * i]
            slope, last = (y1 - y0) / (p1 - p0), i == corners - 2
            if (p < p1 or last) and ea > 0.0:
                limit = y0 + slope * (p - p0)
                beyond = ea * (e - p) - limit
                if beyond <= ROUNDING * limit:
                    break
                yields, ahead = slope, p + beyond / (ea + slope)
                p = ahead if last else min(ahead, p1)
                if p < p1:
                    break
        return p, yields

    @kernel()
    def lost(p, data, c):
        """∫ A Y dp from 0 [N]."""
        total = 0.0
        for i in range(corners - 1):
            p0, y0 = data[c, first + 1 + 2 * i], data[c, first + 2 + 2 * i]
            p1, y1 = data[c, first + 3 + 2 * i], data[c, first + 4 + 2 * i]
            end = p if i == corners - 2 else min(p, p1)
            if end > p0:
                total += (end - p0) * (y0 + 0.5 * (end - p0) * (y1 - y0) / (p1 - p0))
        return total

    @kernel(forceinline=True)
    def state_of(x, data, c, q):
        """p of before at quadrature point q of cell c."""
        return internal_number(x, int(data[c, first]), q)

    @kernel()
    def lost_now(p, x, data, c, q):
        """Energy lost at quadrature point q of cell c where its plastic strain is p, over A Y(0) [m]."""
        length, before = line_at(data, c).natural_length, internal_number(x, int(data[c, first]), 2 * points)
        length = 0.5 * (before + length) if before > 0.0 else length
        more = length * (lost(p, data, c) - lost(state_of(x, data, c, q), data, c))
        return internal_number(x, int(data[c, first]), points + q) + more / data[c, first + 2]

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            largest, ea = 0.0, line_at(data, c).ea
            for q in range(points):
                p0, p1, p2, inverse, e = strain(x, cells, data, c, q, nodes, flat)
                pull = ea * max(e - plastic(e, state_of(x, data, c, q), data, c)[0], 0.0) - ea * max(e, 0.0)
                tension = stress(e, record_at(record, data, c, 0)) + pull
                if q == 0 or tension > largest:
                    largest = tension
                if pull != 0.0:
                    pull_together(f, cells, c, q, nodes, flat, weights[q] * pull * inverse, p0, p1, p2)
            record_at(LINE_OUT, out, c, 0).damped_tension = largest

    @kernel(ENERGY)
    def kept(t, x, cells, data, out):
        for c in range(cells.shape[0]):
            total = 0.0
            for q in range(points):
                e = strain(x, cells, data, c, q, nodes, flat)[4]
                p = plastic(e, state_of(x, data, c, q), data, c)[0]
                total += weights[q] * (max(e - p, 0.0) ** 2 - max(e, 0.0) ** 2)
            out[c] = 0.5 * line_at(data, c).ea * total * line_at(data, c).natural_length

    @kernel(ENERGY)
    def gone(t, x, cells, data, out):
        for c in range(cells.shape[0]):
            total = 0.0
            for q in range(points):
                e = strain(x, cells, data, c, q, nodes, flat)[4]
                p = plastic(e, state_of(x, data, c, q), data, c)[0]
                total += weights[q] * lost_now(p, x, data, c, q)
            out[c] = total * data[c, first + 2]

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        blocks[:] = 0.0
        if definite:  # what it takes from the law is nothing of it
            return
        for c in range(cells.shape[0]):
            line = line_at(data, c)
            for q in range(points):
                p0, p1, p2, inverse, e = strain(x, cells, data, c, q, nodes, flat)
                state, yields = plastic(e, state_of(x, data, c, q), data, c)
                elastic, slope = line.ea * max(e, 0.0), 0.0
                if yields >= 0.0:
                    slope = line.ea * yields / (line.ea + yields)
                elif e >= state:
                    slope = line.ea
                if e >= 0.0:
                    slope -= line.ea
                along = weights[q] * slope / line.natural_length
                across = weights[q] * (line.ea * max(e - state, 0.0) - elastic) * inverse
                p = (p0 * inverse, p1 * inverse, p2 * inverse)
                add_stiffness(blocks, c, q, nodes, flat, along, across, p)

    @kernel(RELAX)
    def relax(h, x, cells, data, before, lost_energy):
        for c in range(cells.shape[0]):
            lost_energy[c], row, length = 0.0, int(data[c, first]), 2 * points
            for q in range(points if h > 0.0 else 0):
                e, n = strain(x, cells, data, c, q, nodes, flat)[4], points + q
                p = plastic(e, state_of(x, data, c, q), data, c)[0]
                x[row + n // 3, n % 3] = lost_now(p, x, data, c, q)
                x[row + q // 3, q % 3] = p
            if h > 0.0 or x[row + length // 3, length % 3] == 0.0:
                x[row + length // 3, length % 3] = line_at(data, c).natural_length

    @kernel(ENERGY)
    def length_force(t, x, cells, data, out):
        by_law_alone(t, x, cells, data, out)
        for c in range(cells.shape[0]):
            ea = line_at(data, c).ea
            for q in range(points):
                e = strain(x, cells, data, c, q, nodes, flat)[4]
                p = plastic(e, state_of(x, data, c, q), data, c)[0]
                stretch, elastic = max(e - p, 0.0), max(e, 0.0)
                more = stretch * (0.5 * stretch - (1.0 + e)) - elastic * (0.5 * elastic - (1.0 + e))
                out[c] += weights[q] * ea * more

    @kernel(ENERGY)
    def states(t, x, cells, data, out):
        for c in range(cells.shape[0]):
            for q in range(points):
                e, begin = strain(x, cells, data, c, q, nodes, flat)[4], (2 * points + 1) * c + q
                p = plastic(e, state_of(x, data, c, q), data, c)[0]
                out[begin], out[begin + points] = p, lost_now(p, x, data, c, q)
            out[(2 * points + 1) * (c + 1) - 1] = line_at(data, c).natural_length

    return force, kept, stiffness, gone, relax, length_force, states


def of(net):
    """The kernels for the curve and the element of a net."""
    return kernels(net.law, net.law_record, net.line_data.column(ROW), corners(net), *net.quadrature)


def plastic_strain(net, x):
    """Plastic strain at each quadrature point of each element at displacement x, shape (cells, points)."""
    return states(net, x)[:, : len(net.weights)]


def states(net, x):
    """Plastic strain, energy lost over A Y(0) [m] by quadrature point, and L [m], shape (cells, 2 points + 1)."""
    numbers = np.empty((len(net.cells), 2 * len(net.weights) + 1))
    of(net)[6](0.0, x, net.cells, net.line_data.matrix, numbers.ravel())
    return numbers


def strain_at(net, plastic):
    """Strain at which each element has a plastic strain while it yields, p + Y(p)/E, shape (elements,)."""
    numbers = net.line_data
    curve = [f"plastic_{kind}_{i}" for i in range(corners(net)) for kind in ("strain", "force")]
    (p0, y0), *rest = np.array([numbers[name] for name in curve]).reshape(-1, 2, len(plastic))
    tension = y0
    for p1, y1 in rest:
        tension = np.where(plastic >= p0, y0 + (plastic - p0) * (y1 - y0) / (p1 - p0), tension)
        p0, y0 = p1, y1
    return plastic + tension / numbers.ea


def corners(net):
    """Number of points of the curves of yield stress."""
    return sum(name.startswith("plastic_force_") for name in net.line_data.dtype.names)


def length_force(net):
    """The kernel of ∂E/∂L of each element [N], plastic strain included."""
    return of(net)[5]


@dataclass(frozen=True)
class PlasticLines:
    """Yield of the lines of a cable with ``law = "elastic-plastic"``.

    Parameters
    ----------
    cable : refweb.net.cable.Cable
        The cable.
    """

    cable: Cable

    def add_internal(self, net):
        """The net with rows for plastic strains behind all others, and numbers of the curves by element."""
        curves, each = yield_curves(self.cable, net.web), 2 * len(net.weights) + 1
        net = with_internal(net, ROW, each, length_force)
        for i in range(curves.shape[1]):
            net = net.with_column(f"plastic_strain_{i}", curves[net.line, i, 0])
            net = net.with_column(f"plastic_force_{i}", net.area * curves[net.line, i, 1])
        return net

    def on(self, net):
        """Terms of the tension that lines do not have by their law, and of the energy that is lost."""
        force, kept, stiffness, gone, relax, *_ = of(net)
        tension = ForceTerm(
            name="plastic",
            cells=net.cells,
            data=None,
            force=force,
            energy=kept,
            tangent=Tangent(stiffness),
            balance=Balance("strain_energy", internal=True),
            elements=CellElements(adds_tension=True),
        )
        none = np.zeros(0, dtype=np.int64)
        lost = ForceTerm(
            name="plastic",
            cells=net.cells,
            data=None,
            force=no_force,
            energy=gone,
            balance=Balance("plastic_energy", internal=True),
            elements=CellElements(
                internal=InternalVariables(none, none, np.zeros(0), relax, 0, 'law = "elastic-plastic"', self)
            ),
        )
        return [tension, lost]

    def grown(self, net, x, t):
        """Plastic strain at each quadrature point of each element, see `plastic_strain`."""
        return plastic_strain(net, x)

    def drive(self, net, x, t):
        """Strain at each quadrature point of each element, shape (cells, points)."""
        return elasticity.strains(net, x)

    def taken_on(self, net, x, t):
        """Displacement of all rows with the plastic strains that it asks for, from those of before in x."""
        return with_numbers(net, x, states(net, x))

    def settled(self, net, x):
        """Displacement of all rows with the plastic strains of new lines there."""
        return self.taken_on(net, with_numbers(net, x, np.zeros((len(net.cells), 0))), 0.0)
