"""Threads with friction at their rings: tensions on both sides of a ring differ by a factor of up to e^(μθ).

The state of a thread is the slip δ_r of each ring r, the length of material that has gone over it in the order of the
thread. Segment s has the natural length L_s = L_s⁰ + δ_(s−1) − δ_s and a tension T_s = A σ(l_s/L_s − 1) of its own. A
ring at which the thread turns by θ_r bears, with κ_r = e^(−μ_r θ_r),

    κ T_(r+1) ≤ T_r  and  κ T_r ≤ T_(r+1);      material goes to a side only where that has T/κ of the other.

Slips at the end of a step follow from those of before and from the positions there (return mapping): rings that stay
within their limits stick, and all others are at their limit. With rates T'_s = −∂T_s/∂L_s the limits of rings are a
system of equations with a tridiagonal M-matrix, cyclic in a closed thread, which Newton's method with an active set
solves. It may go round in circles where segments get slack or taut; bisection along the thread then does not, see
`refweb.effects.thread_slips`. The tension of a side that is slack goes on as EA times its strain there, so that no more
material goes to it than makes it taut.

A ring that slips in one direction has a slip that follows from positions, not from the way to them. So states of steps
in which no ring turns back need no history within the step. A step loses Σ ∫ (Y_to − Y_from) d|δ| ≥ 0, by the
trapezoidal rule, with the configurational force Y = T (1 + ε) − W of each side, which is T but for the strain.

The tangent follows from the derivatives of the limits. It is not symmetric, since the limit of one segment is the
tension of another (non-associated flow), and there is no potential. Gershgorin's bound takes column sums, in which it
is at most that of separate lines: Σ_s ∂T_s/∂l_j ≤ max EA/L_s.

Numbers of a thread stand in rows behind all places, see `refweb.effects.base.InternalVariables`: slip [m] of each ring;
Y_to − Y_from over EA where it slipped last, with the sign of the slip; the energy lost over EA [m].

May change: how the kernels are written; `LEAST` keeps a step from being 0. Must stay: the name "thread" of the terms,
which `statics.gradients.KNOWN` and `studies.modes` have; the order of a thread's numbers in its rows and of ``out``
(four columns, tensions of segments, slips of rings), which `net.threads.ThreadLine` and `results.observables.thread`
read by position; fields of `FrictionKernels`, which `winch_power`, `wound_lines` and `wound_mass` use; methods of
`Slips`, which `integrators.yielding` calls as the ``follower``; `with_slips` and `settled`, which `thread` imports;
`numbers_of`, which `wound_mass` imports. Tests: ``tests/effects/test_thread_friction.py``,
``tests/effects/test_winch.py``.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..compiled.rows import record_at
from ..kernels import BOUND, ENERGY, FORCE, RELAX, STIFFNESS, kernel
from ..net.threads import COLUMNS, TAUT
from .base import Balance, CellElements, ForceTerm, InternalVariables, Tangent, Timing, no_force, with_rows
from .line_kernels import internal_number, line_at
from .thread_segments import add_across, segment_kernel
from .thread_slips import (
    SEGMENT,
    choose,
    eliminate,
    layout_kernels,
    matrix,
    natural,
    return_mapping,
    rings_beside,
    sides,
    slipped,
    strain_of,
)

LEAST = 1e-300
"""Least time of a step in which slips are found [s]."""
STILL = 0.1
"""Share of the change of Y in a step that movements may make where it counts as that of a winch alone."""
EVEN = 1e-4
"""Relative change of Y in a step up to which the trapezoidal rule is as good as the difference of strain energies: its
error is a twelfth of the square."""

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.net import Net
    from ..net.threads import ThreadLine


class FrictionKernels(NamedTuple):
    """Kernels of a thread with friction, whose signatures are in `refweb.kernels`.

    Attributes
    ----------
    force, kept, stiffness, bound, gone, relax, taken : kernel
        Force, strain energy, stiffness, bound, energy lost, relaxation, and the energy that a winch has taken.
    pulled_over, tension_slopes, slip_slopes : kernel
        Configurational force at a winch, and slopes of tensions and of slips.
    """

    force: Callable[..., Any]
    kept: Callable[..., Any]
    stiffness: Callable[..., Any]
    bound: Callable[..., Any]
    gone: Callable[..., Any]
    relax: Callable[..., Any]
    taken: Callable[..., Any]
    pulled_over: Callable[..., Any]
    tension_slopes: Callable[..., Any]
    slip_slopes: Callable[..., Any]


@functools.cache
def kernels(law, record, width):
    """The `FrictionKernels` of the parameters of `refweb.effects.thread.kernels`."""
    energy_density, stress, segment = law.energy_density, law.stress, segment_kernel(width)
    find_slips = return_mapping(law, record, width)
    first_of, _, turn_of = layout_kernels(width)

    @kernel()
    def gap(data, c, w, rings, r):
        """Y behind ring r less Y before it, for the direction in which it has slipped; 0 where it has not."""
        moved = slipped(w, r)
        if moved == 0.0:
            return 0.0
        line, total = record_at(record, data, c, 0), 0.0
        for s, sign in (((r + 1) % len(w), 1.0), (r, -1.0)):
            strain = strain_of(w, s)
            total += sign * (w[s].tension * (1.0 + strain) - energy_density(strain, line))
        return max(total, 0.0) if moved > 0.0 else min(total, 0.0)

    @kernel()
    def ordinary_of(cells, data, c, rings):
        """Number of rings of cell c that are no winch."""
        return rings - (data[c, first_of(cells) + 1] > 1.0)

    @kernel()
    def at_winch(w):
        """Number of the segment at a winch."""
        return 0 if w[0].head > 0.0 else len(w) - 1

    @kernel()
    def pulled_over(data, c, w):
        """Configurational force Y at a winch."""
        s, line = at_winch(w), record_at(record, data, c, 0)
        strain = strain_of(w, s)
        return w[s].tension * (1.0 + strain) - energy_density(strain, line)

    @kernel()
    def pull_before(data, c, w, s):
        """(Y, strain energy) of segment s at the slips before and its length now; NaN for energy without a length."""
        line, (i, j, first, second) = record_at(record, data, c, 0), rings_beside(w, s)
        gain = first * w[i].slip_before - second * w[j].slip_before
        long = w[s].length - w[s].elongation + gain
        if not long > 0.0:
            return 0.0, math.nan
        strain = (w[s].elongation - gain) / long
        density = energy_density(strain, line)
        return stress(strain, line) * (1.0 + strain) - density, long * density

    @kernel()
    def left_out(data, c, w, now, before, paid_out, rings):
        """Energy that a winch takes beside the trapezoidal rule, with Y ``now`` and ``before`` at the present lengths.

        The strain energy loses what the winch takes and what rings lose, which is by the trapezoidal rule. 0 for small
        changes of Y, and where Y differs at a ring before by more than its friction.
        """
        line, energy, pulls = record_at(record, data, c, 0), -0.5 * (now + before) * paid_out, np.empty(len(w))
        if abs(now - before) <= EVEN * (abs(now) + abs(before)):
            return 0.0
        for s in range(len(w)):
            pulls[s], stored = pull_before(data, c, w, s)
            energy += stored - natural(w, s) * energy_density(strain_of(w, s), line)
        for r in range(rings - 1):
            last, first = gap(data, c, w, rings, r), pulls[(r + 1) % len(w)] - pulls[r]
            friction = abs(last) * (max(1.0, before / now) if now > 0.0 else 1.0)
            if abs(first) > friction + STILL * abs(now - before):  # movements have shared out what rings then even
                return 0.0
            energy -= 0.5 * (last + math.copysign(min(abs(first), friction), last)) * slipped(w, r)
        return energy if math.isfinite(energy) else 0.0

    @kernel()
    def taken_now(x, cells, data, c, w, rings):
        """Energy that the winch of cell c has taken, over EA.

        It is that at the present lengths where these are the reason for next to nothing of the change of Y, as where a
        tension is set, else by the trapezoidal rule.
        """
        row, last, ea = int(data[c, first_of(cells)]), rings - 1, line_at(data, c).ea
        w[last].slip_before = internal_number(x, row, last)
        paid_out = slipped(w, last) * (w[0].head - w[0].tail)
        if paid_out == 0.0:
            return internal_number(x, row, 2 * rings + 2)
        now, before = pulled_over(data, c, w), ea * internal_number(x, row, 2 * rings - 1)
        at_once = pull_before(data, c, w, at_winch(w))[0]
        if before == 0.0:
            begins = internal_number(x, row, 2 * rings + 1) == 0.0
            before = at_once if begins or at_once == 0.0 else now
        energy = 0.5 * (now + before) * paid_out
        if abs(at_once - before) <= STILL * abs(now - before):
            energy += left_out(data, c, w, now, at_once, paid_out, rings)
        return internal_number(x, row, 2 * rings + 2) + energy / ea

    @kernel()
    def lost_now(x, cells, data, c, w, rings):
        """Energy lost by cell c, over EA."""
        row, ea = int(data[c, first_of(cells)]), line_at(data, c).ea
        total = internal_number(x, row, 2 * rings)
        for r in range(ordinary_of(cells, data, c, rings)):
            now, before = gap(data, c, w, rings, r) / ea, internal_number(x, row, rings + r)
            if now * before <= 0.0:
                before = now
            total += 0.5 * (before + now) * slipped(w, r)
        return total

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        w = np.empty(cells.shape[1] - 1, SEGMENT)
        for c in range(cells.shape[0]):
            rings, count, largest, total = find_slips(t, x, cells, data, c, w), len(w), 0, 0.0
            for s in range(count):
                p0, p1, p2, inverse, length, _ = segment(x, cells, data, c, s)
                i, j, scale = cells[c, s], cells[c, s + 1], w[s].tension * inverse
                f[i, 0] += scale * p0
                f[i, 1] += scale * p1
                f[i, 2] += scale * p2
                f[j, 0] -= scale * p0
                f[j, 1] -= scale * p1
                f[j, 2] -= scale * p2
                total += length
                largest = s if w[s].tension > w[largest].tension else largest
                out[c, COLUMNS + s] = w[s].tension
            for r in range(rings):
                out[c, COLUMNS + count + r] = w[r].slip
            out[c, 0], out[c, 1] = w[largest].tension, w[largest].tension * data[c, width]
            out[c, 2], out[c, 3] = strain_of(w, largest), total

    @kernel(ENERGY)
    def kept(t, x, cells, data, out):
        w = np.empty(cells.shape[1] - 1, SEGMENT)
        for c in range(cells.shape[0]):
            find_slips(t, x, cells, data, c, w)
            line, out[c] = record_at(record, data, c, 0), 0.0
            for s in range(len(w)):
                out[c] += natural(w, s) * energy_density(strain_of(w, s), line)

    def energy_of(now):
        @kernel(ENERGY)
        def energy(t, x, cells, data, out):
            w = np.empty(cells.shape[1] - 1, SEGMENT)
            for c in range(cells.shape[0]):
                rings = find_slips(t, x, cells, data, c, w)
                out[c] = now(x, cells, data, c, w, rings) * line_at(data, c).ea

        return energy

    gone, taken = energy_of(lost_now), energy_of(taken_now)

    @kernel(RELAX)
    def relax(h, x, cells, data, before, lost):
        w = np.empty(cells.shape[1] - 1, SEGMENT)
        for c in range(cells.shape[0]):
            lost[c], row, winch = 0.0, int(data[c, first_of(cells)]), data[c, first_of(cells) + 1] > 1.0
            if h > 0.0:
                n = 2 * (cells.shape[1] - 1) + 1
                t = h + internal_number(x, row, n) if winch else h
                rings = find_slips(t, x, cells, data, c, w)
                total, ea = lost_now(x, cells, data, c, w, rings), line_at(data, c).ea
                if winch:
                    energy = taken_now(x, cells, data, c, w, rings)
                    x[row + n // 3, n % 3] = t
                    x[row + (n + 1) // 3, (n + 1) % 3] = energy
                    x[row + (n - 2) // 3, (n - 2) % 3] = pulled_over(data, c, w) / ea
                for r in range(rings):
                    n = rings + r
                    if r < ordinary_of(cells, data, c, rings):
                        x[row + n // 3, n % 3] = gap(data, c, w, rings, r) / ea
                    x[row + r // 3, r % 3] = w[r].slip
                x[row + 2 * rings // 3, 2 * rings % 3] = total

    @kernel()
    def turn_slopes(x, cells, data, c, r, w, scale, b):
        """Add ``scale`` ∂θ/∂x of ring r to row r of b, by the three components of each node."""
        count = cells.shape[1] - 1
        q = (r + 1) % count
        a0, a1, a2, first, _, _ = segment(x, cells, data, c, r)
        b0, b1, b2, second, _, _ = segment(x, cells, data, c, q)
        u, v = (a0 * first, a1 * first, a2 * first), (b0 * second, b1 * second, b2 * second)
        cosine = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
        sine = math.sin(turn_of(x, cells, data, c, r))
        if sine > 1e-12:
            for k in range(3):
                by_first = -scale * first * (v[k] - cosine * u[k]) / sine
                by_second = -scale * second * (u[k] - cosine * v[k]) / sine
                b[r, 3 * r + k] -= by_first
                b[r, 3 * r + 3 + k] += by_first
                b[r, 3 * q + k] -= by_second
                b[r, 3 * q + 3 + k] += by_second

    @kernel()
    def slip_slopes(x, cells, data, c, w, rings, a, b):
        """Write ∂δ/∂x of each ring to b, and in its last column ∂δ/∂δ of a last ring whose slip is given."""
        choose(w, rings, True)
        matrix(w, rings, a)
        for r in range(rings):
            for m in range(b.shape[1]):
                b[r, m] = 0.0
            if r == rings - 1 and abs(w[r].direction) != 1.0:
                b[r, b.shape[1] - 1] = 1.0
            if abs(w[r].direction) != 1.0:
                continue
            low, high = sides(w, r)
            if w[r].direction < 0.0:
                low, high = high, low
            for s, part in ((high, w[r].kappa * w[high].slope), (low, -w[low].slope)):
                if s < 0:
                    continue
                p0, p1, p2, inverse, _, _ = segment(x, cells, data, c, s)
                p = (p0 * inverse, p1 * inverse, p2 * inverse)
                for k in range(3):
                    b[r, 3 * s + k] -= w[r].direction * part * p[k]
                    b[r, 3 * s + 3 + k] += w[r].direction * part * p[k]
            if min(low, high) < 0:
                continue
            friction = data[c, first_of(cells) + 2 + r]
            turn_slopes(x, cells, data, c, r, w, -w[r].direction * friction * w[r].kappa * w[high].tension, b)
        eliminate(a, b)

    @kernel()
    def tension_slopes(x, cells, data, c, w, rings, definite, slopes):
        """Write ∂T/∂x of each segment, and in the last column that by the slip of a winch that is given."""
        count, size = cells.shape[1] - 1, 3 * cells.shape[1]
        a, b = np.zeros((rings, rings)), np.zeros((count, size + 1))
        if not definite:  # else that of rings that stick, which is symmetric
            slip_slopes(x, cells, data, c, w, rings, a, b)
        for s in range(count):
            p0, p1, p2, inverse, _, _ = segment(x, cells, data, c, s)
            p = (p0 * inverse, p1 * inverse, p2 * inverse)
            i, j, first, second = rings_beside(w, s)
            for m in range(size + 1):
                slopes[s, m] = -w[s].rate * (first * b[i, m] - second * b[j, m])
                if 3 * s <= m < 3 * s + 6:
                    slopes[s, m] += w[s].slope * p[m % 3] * (-1.0 if m < 3 * s + 3 else 1.0)

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        count, size = cells.shape[1] - 1, 3 * cells.shape[1]
        w, slopes = np.empty(count, SEGMENT), np.empty((count, size + 1))
        for c in range(cells.shape[0]):
            rings = find_slips(t, x, cells, data, c, w)
            tension_slopes(x, cells, data, c, w, rings, definite, slopes)
            for i in range(size):
                for j in range(size):
                    blocks[c, i, j] = 0.0
            for s in range(count):
                p0, p1, p2, inverse, _, _ = segment(x, cells, data, c, s)
                p = (p0 * inverse, p1 * inverse, p2 * inverse)
                for m in range(size):
                    for k in range(3):
                        blocks[c, 3 * s + k, m] -= p[k] * slopes[s, m]
                        blocks[c, 3 * s + 3 + k, m] += p[k] * slopes[s, m]
                add_across(blocks, c, s, p, w[s].tension * inverse)

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        w = np.empty(cells.shape[1] - 1, SEGMENT)
        for c in range(cells.shape[0]):
            rings, ea, first, turned = (
                find_slips(0.0, x, cells, data, c, w),
                abs(line_at(data, c).ea),
                first_of(cells),
                1.0,
            )
            shortest = natural(w, 0)
            for s in range(1, len(w)):
                shortest = min(shortest, natural(w, s))
            for r in range(ordinary_of(cells, data, c, rings)):
                turned += data[c, first + 2 + r]
            for s in range(len(w)):
                inverse, distance = segment(x, cells, data, c, s)[3], data[c, width + 4 + 4 * s]
                soon = TAUT * ea / max(distance, TAUT * line_at(data, c).natural_length)
                total = 2.0 * (ea / shortest + turned * max(w[s].tension * inverse, soon))
                rates[cells[c, s]] += total
                rates[cells[c, s + 1]] += total

    return FrictionKernels(force, kept, stiffness, bound, gone, relax, taken, pulled_over, tension_slopes, slip_slopes)


def with_slips(net: Net, name: str) -> Net:
    """The net with rows for the numbers of a thread behind all others."""
    number = [thread.name for thread in net.threads].index(name)
    thread = net.threads[number]._replace(first=len(net.points))
    threads = *net.threads[:number], thread, *net.threads[number + 1 :]
    return replace(with_rows(net, thread.rows_of_slips), threads=threads)


def numbers_of(thread: ThreadLine) -> NDArray[np.float64]:
    """Numbers of the cell of a thread with friction, see `refweb.effects.thread_slips`, shape (1, columns)."""
    friction = np.array([thread.first, thread.ends, *thread.friction, *thread.winch], dtype=float)
    return np.append(thread.numbers, friction)[None, :]


def terms(thread: ThreadLine) -> list[ForceTerm]:
    """Terms of the tensions, of the energy that is stored and of that which is lost."""
    line = thread.line
    acting = kernels(line.law, line.law_record, line.line_data.matrix.shape[1])
    of_thread = {"name": "thread", "cells": thread.rows[None, :], "data": numbers_of(thread)}
    tension = ForceTerm(
        **of_thread,
        force=acting.force,
        tangent=Tangent(acting.stiffness, acting.bound, symmetric=False, across=thread.across),
        balance=Balance("strain_energy", internal=True),
        timing=Timing(thread.corners),
        elements=CellElements(observed=COLUMNS + len(thread.distances) + thread.rings),
    )
    stored = ForceTerm(**of_thread, force=no_force, energy=acting.kept, balance=Balance("strain_energy", internal=True))
    none = np.zeros(0, dtype=np.int64)
    slips = Slips(thread, acting.relax, of_thread["cells"], of_thread["data"])
    lost = ForceTerm(
        **of_thread,
        force=no_force,
        energy=acting.gone,
        balance=Balance("dissipated_energy", internal=True),
        elements=CellElements(
            internal=InternalVariables(none, none, np.zeros(0), acting.relax, 0, "[[thread]] friction", slips)
        ),
    )
    if not thread.winch:
        return [tension, stored, lost]
    wound = ForceTerm(**of_thread, force=no_force, energy=acting.taken, balance=Balance("winch_energy", internal=True))
    return [tension, stored, lost, wound]


class Slips:
    """Slips of a thread, which follow at once, see `refweb.effects.base.InternalVariables`."""

    def __init__(self, thread, relax, cells, data):
        self._thread, self._relax, self._cells, self._data = thread, relax, cells, data

    def taken_on(self, net: Net, x: NDArray[np.float64], t: float) -> NDArray[np.float64]:
        """Displacement of all rows with the slips that it asks for at time t, from those of before in x."""
        x, lost, thread = x.copy(), np.zeros(1), self._thread
        span = t - thread.wound_until(x) if thread.winch else 1.0
        self._relax(max(span, LEAST), x, self._cells, self._data, lost, lost)
        return x

    def grown(self, net: Net, x: NDArray[np.float64], t: float) -> NDArray[np.float64]:
        """Material that goes over each ring in a step, and what a winch may wind more, over that of the thread [1].

        The last falls from where the winch would be faster than it can.
        """
        thread = self._thread
        grown = np.abs(thread.slips(self.taken_on(net, x, t)) - thread.slips(x)) / thread.natural_length
        if thread.winch and 0.0 < thread.winch[2] < np.inf:
            reach = thread.winch[2] * (t - thread.wound_until(x)) / thread.natural_length
            return np.append(grown, reach - grown[-1])
        return grown

    drive = grown


def settled(thread: ThreadLine, net: Net, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement of all rows as a run begins from: with the slips that it asks for, and no energy lost or taken."""
    x = x.copy()
    numbers = x[thread.first : thread.first + thread.rows_of_slips].reshape(-1)[thread.rings :]
    numbers[:] = 0.0
    x = next(filter(None, (term.elements.internal for term in terms(thread)))).follower.taken_on(net, x, 0.0)
    x[thread.first : thread.first + thread.rows_of_slips].reshape(-1)[thread.rings :] = 0.0
    return x
