"""Blocks of straight elements, and the runs of elements in them, for kernels that take elements together.

Webs repeat: lines from node n to n + 1 follow each other, and lines from n to n + 40 as well. A run is a number of
lines whose first nodes follow each other and whose second nodes do, too. Their displacements and forces lie one after
another in memory, so that differences and sums over a run take all lanes of the processor.

May change: the order of elements in a block, and with it the last digits of all results. Must stay: `by_blocks`, which
`elasticity` calls, and the sums of kernels, which are those of `elasticity.kernels`. Tests:
``tests/net/test_elements.py``.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..compiled.rows import column_of, numbers_aside, numbers_at, record_at, width_of
from ..kernels import FORCE, kernel
from ..net.laws.law import LINE
from .base import BLOCK, BLOCK_OUT, LINE_OUT, MOVES, RESTS
from .line_kernels import strain_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

_intrinsic: Any = intrinsic  # kernels give all but the first argument
SPACE, OUTPUTS = 3 * BLOCK, 2 * BLOCK
"""Number of components of their differences, and of their tensions and strains."""
SHOWN: int = column_of(BLOCK_OUT, "shown")
"""First column of what the elements of a block show."""
LONG = 8
"""Mean number of elements of the runs of a net from which on they are used. A line takes 5.4 ns without runs, and with
runs of 2.3, 4, 10 and 22 elements 6.6, 5.4, 4.6 and 4.0, on a CPU with AVX-512."""
RUN = np.dtype([(name, np.int32) for name in ("begin", "count", "first", "second", "element", "stride")])
"""Where a run begins in the order of its block, 0 for the first of a block, its number of elements, the rows of the
nodes of its first element, the number of that, and from each element to the next."""


def runs_of(cells: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int64]] | None:
    """Runs of each block, shorter offsets of nodes first, and elements in their order; None where they are short.

    Parameters
    ----------
    cells : ndarray of int, shape (elements, 2)
        Rows of the nodes.

    Returns
    -------
    tuple of ndarray, or None
        `RUN` of each, shape (runs, 6), and the number of each element, shape (elements,).
    """
    number, rows = np.arange(len(cells)), int(cells.max(initial=0)) + 1
    first, second = cells[:, 0].astype(np.int64), cells[:, 1].astype(np.int64)
    key = np.full(-(-len(cells) // BLOCK) * BLOCK, np.iinfo(np.int64).max)
    key[: len(cells)] = (second - first + rows) * rows + first
    order = np.argsort(key.reshape(-1, BLOCK), axis=1, kind="stable")
    order = (order + np.arange(0, len(key), BLOCK)[:, None]).reshape(-1)[: len(cells)]
    first, second, strides = first[order], second[order], np.diff(order)
    follows = (np.diff(first) == 1) & (np.diff(second) == 1) & (number[1:] % BLOCK > 0)
    follows[1:] &= ~follows[:-1] | (strides[1:] == strides[:-1])
    begins = np.flatnonzero(np.append(True, ~follows))
    if len(begins) * LONG > len(cells):
        return None
    counts, strides = np.diff(np.append(begins, len(cells))), np.append(strides, 1)[begins]
    runs = np.column_stack([begins % BLOCK, counts, first[begins], second[begins], order[begins], strides])
    return runs.astype(np.int32), order


def blocks_of(lines: NDArray[np.float64], order: NDArray[np.int64] | None = None) -> NDArray[np.float64]:
    """Line data by blocks of `BLOCK` elements, column after column, shape (blocks, columns · `BLOCK`).

    Parameters
    ----------
    lines : ndarray, shape (elements, columns)
        Numbers of straight elements, of which the first columns, those of `LINE`, are taken.
    order : ndarray of int, shape (elements,), optional
        Elements in the order of `runs_of`.
    """
    columns = width_of(LINE)
    blocks = np.zeros((-(-len(lines) // BLOCK), columns, BLOCK))
    for n, block in enumerate(blocks):  # at once it takes twice the time, and memory for them once more
        part = slice(n * BLOCK, (n + 1) * BLOCK)
        taken = lines[part if order is None else order[part], :columns]
        block[:, : len(taken)] = taken.T
    return blocks.reshape(len(blocks), -1)


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


@_intrinsic
def larger(typing, first, second):
    """The larger of two numbers, any of them where one is not a number.

    A loop over it takes all lanes of the processor, and one over ``max`` would not.
    """

    def build(context, builder, signature, arguments):
        kind = arguments[0].type
        largest = builder.module.declare_intrinsic("llvm.maxnum", [kind], ir.FunctionType(kind, [kind, kind]))
        return builder.call(largest, arguments, fastmath=("nnan", "nsz"))

    return types.float64(types.float64, types.float64), build


@functools.cache
def pull_of_block(law):
    """Kernel that turns the differences ``d`` of displacements of a block into forces, with tensions and strains.

    It returns the largest of either, −∞ of no element.

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
        largest = stretched = -math.inf
        for k in range(np.uint64(count)):
            reference, q, s = (x0[k], x1[k], x2[k]), np.uint64(3) * k, np.uint64(2) * k
            numbers = natural[k], ea[k], slackness[k], smoothing[k], g0[k], r0[k]
            line = Line(*numbers, reference, distance[k])
            p0, p1, p2, inverse, e = strain_of(line, d[q], d[q + np.uint64(1)], d[q + np.uint64(2)])
            tension = stress(e, line)
            scale = tension * inverse
            outputs[s], outputs[s + np.uint64(1)] = tension, e
            largest, stretched = larger(largest, tension), larger(stretched, e)
            d[q], d[q + np.uint64(1)], d[q + np.uint64(2)] = scale * p0, scale * p1, scale * p2
        return largest, stretched

    return pull


@kernel(forceinline=True)
def write_output(outputs, k, out, c):
    """Copy tension and strain of element k of a block to those of cell c."""
    cell, s = record_at(LINE_OUT, out, c, 0), np.uint64(2 * k)
    tension, strain = outputs[s], outputs[s + np.uint64(1)]
    cell.tension, cell.strain = tension, strain


@kernel(leaf=True)
def all_zero(numbers, count):
    """Tell if all of some numbers are 0."""
    others = 0
    for k in range(np.uint64(count)):
        others += numbers[k] != 0.0
    return others == 0


@kernel(forceinline=True)
def show_block(tension, strain, outputs, runs, first, behind, block, count, out):
    """Write the `BLOCK_OUT` of a block, with runs from ``first`` to ``behind`` − 1, and the largest of all."""
    shows, highest = record_at(BLOCK_OUT, out, block, 0), record_at(BLOCK_OUT, out, out.shape[0] - 1, 0)
    shows.tension, shows.strain, shows.count = tension, strain, count
    if tension > highest.tension or strain > highest.strain:
        highest.tension, highest.strain = max(tension, highest.tension), max(strain, highest.strain)
        show_lines(outputs, runs, first, behind, block, out)


@kernel(leaf=True)
def show_lines(outputs, runs, first, behind, block, out):
    """Write tension and strain of each line of a block to its `BLOCK_OUT`."""
    pairs = numbers_at(out, block, SHOWN)
    for r in range(first, behind):
        run = record_at(RUN, runs, r, 0)
        for k in range(run.count):
            s, q = np.uint64(2 * (run.begin + k)), np.uint64(2 * (run.element + k * run.stride - block * BLOCK))
            pairs[q], pairs[q + np.uint64(1)] = outputs[s], outputs[s + np.uint64(1)]


@functools.cache
def force_by_blocks(law):
    """Force kernel of straight elements of a law without columns, for numbers by `blocks_of`.

    It has the sums of `elasticity.kernels` in the same order, in three loops over each block: over nodes, over
    elements, and over nodes. Elements that follow each other often share their first node, whose force is not written
    in between. To leave out the sums of blocks without tension gains nothing: ahead of a wave tensions are tiny, but
    not 0.
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
    """Force kernel as that of `force_by_blocks` for ``cells`` of `runs_of`: all loops take all lanes.

    If ``out`` has a row for each block and one more, the kernel writes `BLOCK_OUT` there in place of tension and strain
    of each element. Copies of these take 0.45 ns of the 4 of a line, and another 0.2 to find the largest among 79 600;
    the largest of a block takes 0.15. A block without differences and forces keeps both until a node moves, which
    spares all but the differences ahead of a wave in a web without prestress. Among 79 600 lines, to read numbers ahead
    of their block gains nothing, to keep equal columns once 0.06 ns, and to begin blocks where lines of the cache do
    0.04; without roots and divisions a line would take 0.07 less, and without the change from and to coordinates side
    by side 0.3.

    Forces on second nodes come first, those of long offsets ahead of short ones: where elements stand in the order of
    their nodes, lower ones first, each node has the sum of `elasticity.kernels` in the same order.
    """
    pull = pull_of_block(law)

    @kernel(FORCE, leaf=True)
    def force(t, x, v, f, cells, data, out):
        d, outputs = numbers_aside(SPACE), numbers_aside(OUTPUTS)
        behind, alone = 0, out.shape[0] == data.shape[0] + 1
        for block in range(data.shape[0]):
            first, count = behind, 0
            while behind < cells.shape[0] and (behind == first or record_at(RUN, cells, behind, 0).begin):
                run = record_at(RUN, cells, behind, 0)
                low, high, q = numbers_at(x, run.first, 0), numbers_at(x, run.second, 0), np.uint64(3 * run.begin)
                for k in range(np.uint64(3 * run.count)):
                    d[q + k] = high[k] - low[k]
                behind, count = behind + 1, count + run.count
            shows = record_at(BLOCK_OUT, out, block, 0)
            may_rest = alone and shows.rest != MOVES
            rests = may_rest and all_zero(d, 3 * count)
            if rests and shows.rest == RESTS:
                continue
            tension, strain = pull(data, block, count, d, outputs)
            if may_rest:
                shows.rest = RESTS if rests and all_zero(d, 3 * count) else MOVES
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
                for k in range(0 if alone else run.count):
                    write_output(outputs, begin + k, out, element + k * stride)
            if alone:
                show_block(tension, strain, outputs, cells, first, behind, block, count, out)

    return force


def by_blocks(law, cells, lines):
    """Force kernel of all elements of a law, its cells and its numbers, by the runs of the net if it has long ones.

    The next number is that of the rows of a matrix of `BLOCK_OUT` that the kernel takes in place of what elements show,
    0 if it takes none. Last are the places of natural lengths among the numbers, flattened, shape (elements,).
    """
    runs, places = runs_of(cells), np.arange(len(cells))
    if runs is not None:
        places[runs[1]] = np.arange(len(cells))
    places = places // BLOCK * (width_of(LINE) * BLOCK) + column_of(LINE, "natural_length") * BLOCK + places % BLOCK
    if runs is None:
        return force_by_blocks(law), cells, blocks_of(lines), 0, places
    blocks = blocks_of(lines, runs[1])
    return force_by_runs(law), runs[0], blocks, len(blocks) + 1, places
