"""Winches of constant power: the material that they wind is an unknown, with a rate.

A winch of the power P winds at the rate

    δ' = ± min(|P|/Y, v),    Y = T (1 + ε) − W,

with the configurational force Y of the segment at the drum, which is its tension but for the strain, and the largest
speed v. Y δ' is the power that the web gets, so that below v this is P. The slip of the winch follows from the way to a
state, not from the state alone, and is an unknown; slips of rings follow from it and from positions as beside a winch
that stands still. So is the energy E that the winch has taken, E' = −Y δ', of which the balance counts E.

CVODE and IDA have both among their unknowns, in rows of `refweb.effects.base.InternalVariables`: the force that the
tension adds there is the rate. An explicit step solves, at its end with the positions there,

    Δδ = h R(½ (Y + Y')),    R the rate,    ΔE = −½ (Y + Y') Δδ,

with Y before and Y' behind it: of order 2, and stable for any step where the winch hauls in. Below v the work of each
step is P h.

Numbers of such a winch are those of one that stands still, see `refweb.effects.winch`, and behind them its power [W],
positive to haul in, and v [m/s]. Lines on such winches are in `refweb.effects.wound_lines`.

May change: `ROUNDS` and `ROUNDING`. Must stay: the name "thread" of the terms, which `statics.gradients.KNOWN` and
`studies.modes` have; `BEHIND`, the column of the power, which follows from the numbers of `Winch.numbers`;
`rate_kernel`, which `wound_mass` calls, and fields of `PowerKernels`, which `wound_lines` uses; slip and energy as
unknowns behind the nodes of a cell, in this order; their places in the rows of a thread, which
`net.threads.ThreadLine.unknowns` repeats, and those of pull and time, all in the order of `thread_friction`;
`with_power`, which `thread` imports; `power_kernels`, which `wound_lines` imports. Tests:
``tests/effects/test_winch.py``, ``tests/test_contract.py``.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..kernels import BOUND, FORCE, RELAX, STIFFNESS, kernel
from .base import Balance, CellElements, ForceTerm, InternalVariables, Tangent, Timing, no_force
from .line_kernels import internal_number, line_at
from .thread_friction import kernels
from .thread_segments import segment_kernel
from .thread_slips import SEGMENT, layout_kernels, return_mapping, strain_of

if TYPE_CHECKING:
    from ..net.threads import ThreadLine

BEHIND = 7
"""Columns from the first number of a winch to its power: those of one that stands still."""
ROUNDS = 60
"""Largest number of rounds for the slip of a step."""
ROUNDING = 1e-15
"""Change of a slip over the length of its thread that is rounding."""


@functools.cache
def rate_kernel(width):
    """The kernel of the rate of a winch, where ``width`` columns stand ahead of 1/A."""
    first_of, rings_of, _ = layout_kernels(width)

    @kernel()
    def rate_at(pull, cells, data, c):
        """(Rate of what is hauled in where the configurational force is ``pull``, its slope over that)."""
        column = first_of(cells) + 1 + rings_of(cells, data, c) + BEHIND
        power, largest = data[c, column], data[c, column + 1]
        if pull * largest <= abs(power):
            return math.copysign(largest, power) if power != 0.0 else 0.0, 0.0
        return power / pull, -power / pull**2

    return rate_at


class PowerKernels(NamedTuple):
    """Kernels of winches of constant power.

    Attributes
    ----------
    force, stiffness, bound, relax : kernel
        Those of a thread, whose cells have, behind its nodes, the rows of the slip of the winch and of its energy; not
        of the last, which has those of the nodes alone.
    add_rates, add_slopes : kernel
        Rates of both in a cell, and their slopes.
    """

    force: Callable[..., Any]
    stiffness: Callable[..., Any]
    bound: Callable[..., Any]
    relax: Callable[..., Any]
    add_rates: Callable[..., Any]
    add_slopes: Callable[..., Any]


@functools.cache
def power_kernels(law, record, width):
    """The `PowerKernels` of the parameters of `refweb.effects.thread.kernels`."""
    acting, segment = kernels(law, record, width), segment_kernel(width)
    find_slips, (first_of, rings_of, _) = return_mapping(law, record, width), layout_kernels(width)
    force_of, stiffness_of, bound_of = acting.force, acting.stiffness, acting.bound
    pulled_over, tension_slopes, rate_at = acting.pulled_over, acting.tension_slopes, rate_kernel(width)

    @kernel()
    def unknowns_of(cells, data, c):
        """Row and component of the slip of the winch, and of its energy."""
        row, rings = int(data[c, first_of(cells)]), rings_of(cells, data, c)
        slip, energy = rings - 1, 2 * rings + 2
        return row + slip // 3, slip % 3, row + energy // 3, energy % 3

    @kernel()
    def add_rates(t, x, f, nodes, data, c, w):
        """Add the rates of slip and energy of a cell by its ``nodes`` to f; w is space."""
        find_slips(t, x, nodes, data, c, w)
        pull, (r, k, q, m) = pulled_over(data, c, w), unknowns_of(nodes, data, c)
        rate = rate_at(pull, nodes, data, c)[0]
        f[r, k] += rate * (w[0].tail - w[0].head)
        f[q, m] -= rate * pull / line_at(data, c).ea

    @kernel()
    def add_slopes(t, x, blocks, nodes, data, c, w, slopes):
        """Add the slopes of these rates, and of the force on nodes by the slip; w and ``slopes`` are space."""
        count, rings = nodes.shape[1] - 1, find_slips(t, x, nodes, data, c, w)
        size = 3 * (count + 1)
        tension_slopes(x, nodes, data, c, w, rings, False, slopes)
        pull, (_, k, _, m), sign = pulled_over(data, c, w), unknowns_of(nodes, data, c), w[0].tail - w[0].head
        (rate, slope), slip, energy = rate_at(pull, nodes, data, c), size + k, size + 3 + m
        for s in range(count):
            p0, p1, p2, inverse, _, _ = segment(x, nodes, data, c, s)
            p = (p0 * inverse, p1 * inverse, p2 * inverse)
            for i in range(3):
                blocks[c, 3 * s + i, slip] -= p[i] * slopes[s, size]
                blocks[c, 3 * s + 3 + i, slip] += p[i] * slopes[s, size]
        s = 0 if sign < 0.0 else count - 1
        for j in range(size + 1):
            change, at = (1.0 + strain_of(w, s)) * slopes[s, j], j if j < size else slip
            blocks[c, slip, at] -= sign * slope * change
            blocks[c, energy, at] += (rate + pull * slope) * change / line_at(data, c).ea

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        nodes, w = cells[:, : cells.shape[1] - 2].copy(), np.empty(cells.shape[1] - 3, SEGMENT)
        force_of(t, x, v, f, nodes, data, out)
        for c in range(cells.shape[0]):
            add_rates(t, x, f, nodes, data, c, w)

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        nodes, count = cells[:, : cells.shape[1] - 2].copy(), cells.shape[1] - 3
        w, slopes = np.empty(count, SEGMENT), np.empty((count, 3 * (count + 1) + 1))
        blocks[:] = 0.0
        stiffness_of(t, x, v, blocks, nodes, data, definite)
        for c in range(0 if definite else cells.shape[0]):
            add_slopes(t, x, blocks, nodes, data, c, w, slopes)

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        bound_of(reach, speed, x, mass, rates, cells[:, : cells.shape[1] - 2].copy(), data)

    @kernel(RELAX)
    def relax(h, x, cells, data, before, lost):
        w = np.empty(cells.shape[1] - 1, SEGMENT)
        for c in range(cells.shape[0]):
            lost[c], row, rings = 0.0, int(data[c, first_of(cells)]), rings_of(cells, data, c)
            if h <= 0.0:
                continue
            r, k, q, m = unknowns_of(cells, data, c)
            t, ea, start = h + internal_number(x, row, 2 * rings + 1), line_at(data, c).ea, x[r, k]
            first = ea * internal_number(x, row, 2 * rings - 1)
            sign = 1.0 if data[c, first_of(cells) + 1] > 2.0 else -1.0
            limit = h * rate_at(0.0, cells, data, c)[0]
            low, high, nothing = 0.0, limit, ROUNDING * (line_at(data, c).natural_length + abs(start))
            moved, before_that, off_before, mean = h * rate_at(first, cells, data, c)[0], 0.0, 0.0, first
            for i in range(ROUNDS):
                x[r, k] = start + sign * moved
                find_slips(t, x, cells, data, c, w)
                mean = 0.5 * (first + pulled_over(data, c, w))
                off = h * rate_at(mean, cells, data, c)[0] - moved
                if abs(off) <= nothing or high == low or i == ROUNDS - 1:
                    break
                if off * limit > 0.0:
                    low = moved
                else:
                    high = moved
                after = moved + off
                if i > 0 and off != off_before:
                    after = moved - off * (moved - before_that) / (off - off_before)
                if not min(low, high) < after < max(low, high):
                    after = 0.5 * (low + high)
                if after == low or after == high:
                    break
                moved, before_that, off_before = after, moved, off
            x[q, m] -= mean * moved / ea

    return PowerKernels(force, stiffness, bound, relax, add_rates, add_slopes)


def with_power(thread: ThreadLine, terms: list[ForceTerm]) -> list[ForceTerm]:
    """Terms of a thread with a winch of constant power, from `refweb.effects.thread_friction.terms`.

    The first, of the tensions, has the rates of both unknowns as well; a further one, ahead of that of the slips, takes
    them over explicit steps.
    """
    line, unknowns = thread.line, thread.unknowns
    powered = power_kernels(line.law, line.law_record, line.line_data.matrix.shape[1])
    tension, stored, *others = terms
    across = np.pad(thread.across, ((0, 0), (0, 6), (0, 6)))
    tension = replace(
        tension,
        cells=np.append(tension.cells, (unknowns // 3).astype(np.int32)[None], axis=1),
        force=powered.force,
        tangent=Tangent(powered.stiffness, powered.bound, symmetric=False, across=across),
    )
    none = np.full(2, -1, dtype=np.int64)
    length = ForceTerm(
        name="thread",
        cells=stored.cells,
        data=stored.data,
        force=no_force,
        balance=Balance("winch_energy", internal=True),
        timing=Timing(at_rest=False),
        elements=CellElements(
            internal=InternalVariables(unknowns, none, np.ones(2), powered.relax, 0, "[[winch]] power")
        ),
    )
    return [tension, stored, length, *others]
