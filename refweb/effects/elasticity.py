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
from typing import NamedTuple

import numpy as np

from ..compiled.rows import numbers_aside, numbers_at, record_at
from ..kernels import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from ..tables import Table, table
from .base import LINE_OUT, Balance, CellElements, ForceTerm, Tangent
from .line_blocks import BLOCK, OUTPUTS, RUN, SPACE, blocks_of, runs_of
from .line_kernels import add_row_sums, add_stiffness, line_at, pull_together, strain, strain_of


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


class Line(NamedTuple):
    """Numbers of a line by the names of `refweb.net.laws.law.LINE`, for a law in `force_by_blocks`."""

    natural_length: float
    ea: float
    slackness: float
    smoothing: float
    g0: float
    r0: float
    reference: tuple[float, float, float]
    distance: float


@functools.cache
def pull_of_block(law):
    """Kernel that turns the differences ``d`` of displacements of a block into forces, with tensions and strains.

    It has no branch, so that it takes all lanes of the processor. Tension and strain of an element lie side by side, so
    that they are copied by one instruction.
    """
    stress = law.stress

    @kernel(forceinline=True)
    def pull(data, block, count, d, outputs):
        natural, ea = numbers_at(data, block, 0), numbers_at(data, block, BLOCK)
        slackness, smoothing = numbers_at(data, block, 2 * BLOCK), numbers_at(data, block, 3 * BLOCK)
        g0, r0 = numbers_at(data, block, 4 * BLOCK), numbers_at(data, block, 5 * BLOCK)
        x0, x1 = numbers_at(data, block, 6 * BLOCK), numbers_at(data, block, 7 * BLOCK)
        x2, distance = numbers_at(data, block, 8 * BLOCK), numbers_at(data, block, 9 * BLOCK)
        for k in range(np.uint64(count)):
            reference, q, s = (x0[k], x1[k], x2[k]), np.uint64(3) * k, np.uint64(2) * k
            numbers = natural[k], ea[k], slackness[k], smoothing[k], g0[k], r0[k]
            line = Line(*numbers, reference, distance[k])
            p0, p1, p2, inverse, e = strain_of(line, d[q], d[q + np.uint64(1)], d[q + np.uint64(2)])
            tension = stress(e, line)
            scale = tension * inverse
            outputs[s], outputs[s + np.uint64(1)] = tension, e
            d[q], d[q + np.uint64(1)], d[q + np.uint64(2)] = scale * p0, scale * p1, scale * p2

    return pull


@kernel(forceinline=True)
def write_output(outputs, k, out, c):
    """Copy tension and strain of element k of a block to those of cell c."""
    cell, s = record_at(LINE_OUT, out, c, 0), np.uint64(2 * k)
    tension, strain = outputs[s], outputs[s + np.uint64(1)]
    cell.tension, cell.strain = tension, strain


@functools.cache
def force_by_blocks(law):
    """Force kernel of straight elements of a law without columns, for numbers by `line_blocks.blocks_of`.

    It has the sums of `kernels` in the same order, in three loops over each block: over nodes, over elements, and over
    nodes. Elements that follow each other often share their first node, whose force is not written in between. To leave
    out the sums of blocks without tension gains nothing: ahead of a wave tensions are tiny, but not 0.
    """
    pull = pull_of_block(law)

    @kernel(FORCE, leaf=True)
    def force(t, x, v, f, cells, data, out):
        d, outputs = numbers_aside(SPACE), numbers_aside(OUTPUTS)
        for begin in range(0, cells.shape[0], BLOCK):
            count, first = np.uint64(min(BLOCK, cells.shape[0] - begin)), np.uint64(begin)
            for k in range(count):
                i, j, q = np.uint64(cells[first + k, 0]), np.uint64(cells[first + k, 1]), np.uint64(3) * k
                d[q], d[q + np.uint64(1)], d[q + np.uint64(2)] = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
            pull(data, begin // BLOCK, count, d, outputs)
            row = np.uint64(cells[first, 0])
            f0, f1, f2 = f[row, 0], f[row, 1], f[row, 2]
            for k in range(count):
                i, j, q = np.uint64(cells[first + k, 0]), np.uint64(cells[first + k, 1]), np.uint64(3) * k
                if i != row:
                    f[row, 0], f[row, 1], f[row, 2] = f0, f1, f2
                    f0, f1, f2, row = f[i, 0], f[i, 1], f[i, 2], i
                d0, d1, d2 = d[q], d[q + np.uint64(1)], d[q + np.uint64(2)]
                f0, f1, f2 = f0 + d0, f1 + d1, f2 + d2
                f[j, 0] -= d0
                f[j, 1] -= d1
                f[j, 2] -= d2
                write_output(outputs, k, out, begin + k)
            f[row, 0], f[row, 1], f[row, 2] = f0, f1, f2

    return force


@functools.cache
def force_by_runs(law):
    """Force kernel as that of `force_by_blocks` for ``cells`` of `line_blocks.runs_of`: all loops take all lanes.

    Forces on second nodes come first, those of long offsets ahead of short ones: where elements stand in the order of
    their nodes, lower ones first, each node has the sum of `kernels` in the same order.
    """
    pull = pull_of_block(law)

    @kernel(FORCE, leaf=True)
    def force(t, x, v, f, cells, data, out):
        d, outputs = numbers_aside(SPACE), numbers_aside(OUTPUTS)
        behind = 0
        for block in range(data.shape[0]):
            first, count = behind, 0
            while behind < cells.shape[0] and (behind == first or record_at(RUN, cells, behind, 0).begin):
                run = record_at(RUN, cells, behind, 0)
                low, high, q = numbers_at(x, run.first, 0), numbers_at(x, run.second, 0), np.uint64(3 * run.begin)
                for k in range(np.uint64(3 * run.count)):
                    d[q + k] = high[k] - low[k]
                behind, count = behind + 1, count + run.count
            pull(data, block, count, d, outputs)
            for r in range(behind - 1, first - 1, -1):
                run = record_at(RUN, cells, r, 0)
                high, q = numbers_at(f, run.second, 0), np.uint64(3 * run.begin)
                for k in range(np.uint64(3 * run.count)):
                    high[k] -= d[q + k]
            for r in range(first, behind):
                run = record_at(RUN, cells, r, 0)
                low, q = numbers_at(f, run.first, 0), np.uint64(3 * run.begin)
                for k in range(np.uint64(3 * run.count)):
                    low[k] += d[q + k]
                begin, element, stride = run.begin, run.element, run.stride
                for k in range(run.count):
                    write_output(outputs, begin + k, out, element + k * stride)

    return force


def by_blocks(law, cells, lines):
    """Force kernel of all elements of a law, its cells and its numbers, by the runs of the net if it has long ones."""
    runs = runs_of(cells)
    if runs is None:
        return force_by_blocks(law), cells, blocks_of(lines)
    return force_by_runs(law), runs[0], blocks_of(lines, runs[1])


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
