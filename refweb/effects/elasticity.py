"""Elasticity of the lines: the tension law on nodal line elements.

With x' = dx/dξ at a quadrature point, l = |x'|, L the natural length and t = x'/l,

    force on node a        −w T dN_a/dξ t
    stiffness of (a, b)     w dN_a/dξ dN_b/dξ [(EA/L)(σ'/E) t⊗t + (T/l)(I − t⊗t)]

and the strain ε = (2 X'·u' + u'·u' + |X'|² − L²)/(L(l + L)), which keeps its digits at tiny displacements.

`build` adds the term to each system. May change: the code around the sums; another order of sums changes the last
digits of all results. Must stay: the name "elasticity", which `statics.gradients.KNOWN` has; ``data=None``, by which
`System` takes the numbers of its lines; "strain_energy", a column of ``history.csv``; `Elasticity`, which `build` and
`statics.monotone_loading` take; the order of what `kernels` returns, which `wound_lines` and ``tests/test_contract.py``
unpack, with ∂E/∂L as the last, which `plastic` and `viscous` take; `strains`, which `results.state`, `statics`,
`plastic` and `viscous` call, and `length_force`, which `natural_lengths` calls; both force kernels have the same sums;
columns of `LINE_OUT`. Tests: ``tests/test_contract.py``, ``tests/net/test_elements.py``.
"""

from __future__ import annotations

import functools

import numpy as np

from ..compiled.rows import record_at
from ..kernels import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from ..tables import Table, table
from .base import LINE_OUT, Balance, CellElements, ForceTerm, Tangent
from .line_kernels import add_row_sums, add_stiffness, line_at, pull_together, strain


@functools.cache
def kernels(law, record, gradients, weights):
    """Force, energy, stiffness, bound, strain and length kernels of a law and reference element.

    The length kernel writes ∂E/∂L of each element [N].

    Parameters
    ----------
    law : type or refweb.net.laws.law.Mixed
        Law of the lines.
    record : numpy.dtype
        Numbers of an element that it reads, see `refweb.net.net.Net.law_record`.
    gradients : tuple of tuple of float
        dN/dξ by quadrature point and node.
    weights : tuple of float
        Quadrature weights.
    """
    stress, tangent, energy_density = law.stress, law.tangent, law.energy_density
    points, nodes = len(gradients), len(gradients[0])
    flat = tuple(value for row in gradients for value in row)

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        for c in range(cells.shape[0]):
            largest = stretched = 0.0
            for q in range(points):
                p0, p1, p2, inverse, e = strain(x, cells, data, c, q, nodes, flat)
                tension = stress(e, record_at(record, data, c, 0))
                if q == 0 or tension > largest:
                    largest, stretched = tension, e
                pull_together(f, cells, c, q, nodes, flat, weights[q] * tension * inverse, p0, p1, p2)
            shows = record_at(LINE_OUT, out, c, 0)
            shows.tension, shows.strain = largest, stretched

    @kernel(ENERGY)
    def energy(t, x, cells, data, out):
        for c in range(cells.shape[0]):
            total = 0.0
            line = record_at(record, data, c, 0)
            for q in range(points):
                e = strain(x, cells, data, c, q, nodes, flat)[4]
                total += weights[q] * energy_density(e, line)
            out[c] = total * line.natural_length

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        for c in range(cells.shape[0]):
            blocks[c] = 0.0
            line = record_at(record, data, c, 0)
            for q in range(points):
                p0, p1, p2, inverse, e = strain(x, cells, data, c, q, nodes, flat)
                along = weights[q] * tangent(e, line) / line.natural_length
                tension = stress(e, line)
                across = 0.0 if definite and tension < 0.0 else weights[q] * tension * inverse
                p = (p0 * inverse, p1 * inverse, p2 * inverse)
                add_stiffness(blocks, c, q, nodes, flat, along, across, p)

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            line = line_at(data, c)
            axial = abs(line.ea) / line.natural_length
            for q in range(points):
                add_row_sums(rates, cells, c, q, nodes, flat, weights[q], axial)

    @kernel(ENERGY)
    def every_strain(t, x, cells, data, out):
        for c in range(cells.shape[0]):
            for q in range(points):
                out[c * points + q] = strain(x, cells, data, c, q, nodes, flat)[4]

    @kernel(ENERGY)
    def length_force(t, x, cells, data, out):
        for c in range(cells.shape[0]):
            total = 0.0
            line = record_at(record, data, c, 0)
            for q in range(points):
                e = strain(x, cells, data, c, q, nodes, flat)[4]
                pulled = (1.0 + e) * stress(e, line)
                total += weights[q] * (energy_density(e, line) - pulled)
            out[c] = total

    return force, energy, stiffness, bound, every_strain, length_force


def by_blocks(law, cells, lines):
    """Force kernel of all elements of a law in explicit steps, its cells, its numbers, and rows of `BLOCK_OUT`."""
    from .line_blocks import by_blocks

    return by_blocks(law, cells, lines)


def of(net):
    """The kernels for the laws and the element of a net."""
    return kernels(net.law, net.law_record, *net.quadrature)


def strains(net, x):
    """Strain at each quadrature point of each element at displacement x, shape (cells, points)."""
    strain = np.empty((len(net.cells), len(net.weights)))
    of(net)[4](0.0, x, net.cells, net.line_data.matrix, strain.ravel())
    return strain


def length_force(net):
    """The kernel (signature `refweb.kernels.ENERGY`) of ∂E/∂L of each element [N]."""
    return of(net)[5]


@table
class Elasticity(Table):
    """Tension of every line by the law of its cable, see `refweb.net.laws`."""

    def on(self, net):
        """The term of all lines; ``out`` is tension [N] and strain."""
        force, energy, stiffness, bound, *_ = of(net)
        together = net.order == 1 and not net.law.columns
        return ForceTerm(
            name="elasticity",
            cells=net.cells,
            data=None,
            force=force,
            energy=energy,
            tangent=Tangent(stiffness, bound),
            balance=Balance("strain_energy", internal=True),
            elements=CellElements(by_blocks=functools.partial(by_blocks, net.law) if together else None),
        )
