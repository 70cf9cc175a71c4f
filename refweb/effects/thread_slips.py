"""Slips of the rings of a thread with friction: the return mapping of a step, see `refweb.effects.thread_friction`.

The segments of a thread are records w, see `SEGMENT`. Ring r is between segment r and the next; there is one ring less
than segments, in a closed thread as many.

May change: limits of the iterations (`STEPS`, `ROUGH`, `BISECTIONS`, `DOUBLINGS`, `FARTHER`, `POLISH`) upwards: slips
are to be found to rounding, of which the other constants say what it is. Must stay: the fields of `SEGMENT`, which
`thread_friction`, `winch_power`, `wound_lines` and `wound_mass` read; the layout that `layout_kernels` reads: first
row, ends, friction of each ring, numbers of the winch, as `thread_friction.numbers_of` writes them; all names that
`thread_friction`, `wound_mass` and `winch_power` import.
Tests: ``tests/effects/test_thread_friction.py``, ``tests/effects/test_winch.py``.
"""

from __future__ import annotations

import functools
import math
from typing import Annotated

import numpy as np
from numba import from_dtype, types

from ..compiled.rows import record_at
from ..kernels import Indices, Matrix, kernel
from .line_kernels import internal_number, line_at
from .thread_segments import segment_kernel

_NUMBERS = """
    elongation length tension pull slope rate pull_rate gained_before
    slip slip_before kappa direction change left left_low
    head tail holds_in holds_out reach
"""
SEGMENT = np.dtype([(name, float) for name in _NUMBERS.split()])
"""Numbers of a segment, and of the ring behind it.

Of the segment: elongation with the natural length as built, length, tension, and the tension that goes on below 0
(pull); slopes ∂T/∂l, −∂T/∂L and that of the pull; what it had gained before. Of the ring: slip, slip before, κ, the
direction in which it slips (0 where it sticks, ±2 where a winch is at its largest speed), what Newton's method changes,
and the material that is left behind it where a chain begins with a pull, and with a lower one.

Of the whole thread, in its first segment alone: 1 where the last ring has a segment behind it (head), and one before it
(tail); the tensions up to which a winch hauls in and from which it pays out; its largest slip in the step.
"""
NOTHING = np.zeros(1, SEGMENT)
SegmentArray = Annotated[np.ndarray, types.Array(from_dtype(SEGMENT), 1, "C")]
"""Annotation of the segments of a thread."""
ROUNDING = 1e-15
"""Share of elongations and slips of a segment up to which its tension is rounding."""
STEPS = 12
"""Largest number of Newton steps, by which next to all steps of a run are solved."""
BISECTIONS = 200
"""Largest number of bisections."""
ROUGH = 16
"""Number of bisections that mostly suffice to tell which rings slip: Newton steps behind them find by how much."""
DOUBLINGS = 1000
"""Largest number of doublings."""
FARTHER = 40
"""Largest number of doublings of the slip of a winch, from the length of a segment on: none is beyond 1e12 lengths."""
POLISH = 4
"""Largest number of Newton steps behind bisections."""
DENORMAL = 1e-200
"""Tension over EA up to which a pull is none: strains by it have no digits."""
LARGEST = 1e6
"""Largest strain at which a ring that never slips is looked at."""
SINGULAR = 1e-9
"""Least slope of the side that material comes from, where it is slack, over that of the other."""
SAME = 1e-10
"""Time over that of a run that is none."""
NEAR = 1e-6
"""Share of its largest slip by which a winch is at it."""
SHRINK = 0.5
"""Largest share of its natural length that a segment loses in a Newton step."""


@kernel()
def rings_beside(w, s):
    """Ring before segment s, ring behind it, and 1 for each of them that there is, else 0."""
    last = len(w) - 1
    before, first = (s - 1, 1.0) if s > 0 else (last, w[0].head)
    return before, s, first, 1.0 if s < last else w[0].tail


@kernel()
def gained(w, s):
    """Material that segment s has gained by slips: that of the ring before it, less that of its own."""
    a, b, first, second = rings_beside(w, s)
    return first * w[a].slip - second * w[b].slip


@kernel()
def slipped(w, r):
    """Slip of ring r in the step."""
    return w[r].slip - w[r].slip_before


@kernel()
def natural(w, s):
    """Natural length of segment s."""
    return w[s].length - w[s].elongation + gained(w, s)


@kernel()
def strain_of(w, s):
    """Strain of segment s."""
    return (w[s].elongation - gained(w, s)) / natural(w, s)


@kernel()
def rounding(w, s):
    """Tension of segment s by rounding."""
    size = abs(w[s].elongation) + abs(gained(w, s)) + abs(w[s - 1].slip) + abs(w[s].slip)
    return ROUNDING * (size * max(w[s].slope, w[s].pull_rate) + abs(w[s].tension))


@kernel()
def sides(w, r):
    """Segments before and behind ring r; −1 for the drum of a winch."""
    last = len(w) - 1
    before = -1 if r == last and w[0].tail == 0.0 else r
    behind = r + 1 if r < last else 0 if w[0].head > 0.0 else -1
    return before, behind


@kernel()
def little(w, r):
    """Tension at ring r by rounding."""
    a, b = sides(w, r)
    return (rounding(w, a) if a >= 0 else 0.0) + (rounding(w, b) if b >= 0 else 0.0)


@kernel()
def side_in(w, r, s):
    """(κ times the pull, its slope) on the side of ring r that material goes to."""
    return (w[r].kappa * w[s].pull, w[r].kappa * w[s].pull_rate) if s >= 0 else (w[0].holds_in, 0.0)


@kernel()
def side_out(w, s, target):
    """(Tension, its slope) on the side that material comes from; it goes on below 0 where a drum is the other."""
    if s < 0:
        return w[0].holds_out, 0.0
    return (w[s].tension, w[s].rate) if target >= 0 else (w[s].pull, w[s].pull_rate)


@kernel()
def beyond(w, r, forward):
    """Pull at ring r beyond its limit, towards the segment behind it or, not ``forward``, before it."""
    a, b = sides(w, r)
    if not forward:
        a, b = b, a
    return side_in(w, r, b)[0] - side_out(w, a, b)[0]


@kernel()
def reach_of(w, r):
    """Largest slip of ring r in a step: that of a winch at its speed limit."""
    return w[0].reach if min(sides(w, r)[0], sides(w, r)[1]) < 0 else math.inf


@kernel()
def miss(w, rings):
    """Largest distance of a ring from where its slip asks it to be, over what rounding allows."""
    worst = 0.0
    for r in range(rings):
        moved, reach = slipped(w, r), reach_of(w, r)
        ahead, back = beyond(w, r, True), beyond(w, r, False)
        if abs(moved) >= reach * (1.0 - NEAR):
            error = 0.0 if reach == 0.0 else max(-ahead, 0.0) if moved > 0.0 else max(-back, 0.0)
        else:
            error = abs(ahead) if moved > 0.0 else abs(back) if moved < 0.0 else max(ahead, back, 0.0)
        if not math.isfinite(moved + error):
            return math.inf
        if w[r].kappa > 0.0 and error > worst * little(w, r):
            worst = error / little(w, r)
    return worst


@kernel()
def choose(w, rings, at_limit):
    """Write the direction in which each ring slips, ±2 where a winch is at its largest speed.

    With ``at_limit`` a ring that is at its limit slips. In a closed thread one ring sticks: material that goes round
    changes nothing.
    """
    pinned = 0
    for r in range(rings):
        (a, b), moved, edge, reach = sides(w, r), slipped(w, r), 0.0, reach_of(w, r)
        ahead, back = beyond(w, r, True), beyond(w, r, False)
        if moved == 0.0:
            edge = -little(w, r) if at_limit else little(w, r)
        w[r].direction = 0.0
        if w[r].kappa > 0.0 and reach > 0.0:
            if ahead + (side_in(w, r, b)[1] + side_out(w, a, b)[1]) * moved > edge:
                w[r].direction = 1.0
            elif back - (side_in(w, r, a)[1] + side_out(w, b, a)[1]) * moved > edge:
                w[r].direction = -1.0
            if abs(moved) >= reach * (1.0 - NEAR) and w[r].direction * (ahead if moved > 0.0 else -back) >= 0.0:
                w[r].direction *= 2.0
        if w[r].direction == 0.0 or w[pinned].direction != 0.0 and abs(moved) < abs(slipped(w, pinned)):
            pinned = r
    if w[0].head * w[0].tail > 0.0:
        w[pinned].direction = 0.0


@kernel()
def matrix(w, rings, a):
    """Write the matrix of the changes of slips; a ring that sticks has 1."""
    for r in range(rings):
        for q in range(rings):
            a[r, q] = 0.0
        if abs(w[r].direction) != 1.0:
            a[r, r] = 1.0
            continue
        before, behind = sides(w, r)
        low, high = side_in(w, r, before)[1], side_in(w, r, behind)[1]
        if w[r].direction > 0.0:
            low = max(side_out(w, before, behind)[1], SINGULAR * high)
        else:
            high = max(side_out(w, behind, before)[1], SINGULAR * low)
        a[r, r] = low + high
        if before >= 0 and (before > 0 or w[0].head > 0.0):
            a[r, before - 1] -= low
        if behind >= 0 and (behind < len(w) - 1 or w[0].tail > 0.0):
            a[r, behind] -= high


@kernel()
def eliminate(a, b):
    """Solve a y = b in place, for each column of b; a is diagonally dominant, and tridiagonal but for its corners."""
    last = a.shape[0] - 1
    for i in range(last):
        for j in (i + 1, last):
            share = a[j, i] / a[i, i]
            if share != 0.0:
                a[j, i] = 0.0
                a[j, i + 1] -= share * a[i, i + 1]
                if last > i + 1:
                    a[j, last] -= share * a[i, last]
                for m in range(b.shape[1]):
                    b[j, m] -= share * b[i, m]
    for i in range(last, -1, -1):
        for m in range(b.shape[1]):
            if last > i:
                b[i, m] -= a[i, i + 1] * b[i + 1, m]
            if last > i + 1:
                b[i, m] -= a[i, last] * b[last, m]
            b[i, m] /= a[i, i]


@kernel()
def hauled_until(t, data, c, column):
    """Length that a winch is asked to haul in from 0 to t, by the number of rows of its table of speeds, and these."""
    total, count = 0.0, int(data[c, column])
    for i in range(count + 1):
        before = -math.inf if i == 0 else data[c, column + 2 * i - 1]
        behind = math.inf if i == count else data[c, column + 2 * i + 1]
        low, high = max(before, 0.0), min(behind, t)
        if high > low:
            first = data[c, column + 2 * (i if i > 0 else 1)]
            second = data[c, column + 2 * (i + 1 if i < count else count)]
            slope = (second - first) / (behind - before) if 0 < i < count else 0.0
            middle = 0.5 * (low + high) - before if 0 < i < count else 0.0
            total += (high - low) * (first + slope * middle)
    return total


@functools.cache
def layout_kernels(width):
    """Kernels of the column with the first row of slips, of the number of rings, and of the turn at a ring.

    ``width`` is that of `refweb.effects.thread.kernels`. Behind the numbers of segments stand the first row of internal
    variables, the kind of the ends, see `refweb.net.threads.ThreadLine.ends`, the friction coefficient of each ring,
    and the numbers of a winch, see `refweb.effects.winch`.
    """
    segment = segment_kernel(width)

    @kernel()
    def first_of(cells):
        """Column of the first row of internal variables."""
        return width + 1 + 4 * (cells.shape[1] - 1)

    @kernel()
    def rings_of(cells, data, c):
        """Number of rings of cell c, with that of a winch."""
        return cells.shape[1] - 2 + (data[c, first_of(cells) + 1] > 0.0)

    @kernel()
    def turn_of(x, cells, data, c, r):
        """Angle by which the thread turns at ring r [rad]."""
        a0, a1, a2, first, _, _ = segment(x, cells, data, c, r)
        b0, b1, b2, second, _, _ = segment(x, cells, data, c, (r + 1) % (cells.shape[1] - 1))
        x0, x1, x2 = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
        sine = math.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
        return math.atan2(sine, a0 * b0 + a1 * b1 + a2 * b2) if first * second > 0.0 else 0.0

    return first_of, rings_of, turn_of


@functools.cache
def return_mapping(law, record, width):
    """The kernel that finds slips, of the parameters of `refweb.effects.thread.kernels`."""
    stress, tangent, segment = law.stress, law.tangent, segment_kernel(width)
    first_of, rings_of, turn_of = layout_kernels(width)

    @kernel()
    def pull_of(strain, length, data, c):
        """(Tension that goes on below 0, its slope −∂/∂L) of a segment by its strain and natural length."""
        line, plain = record_at(record, data, c, 0), line_at(data, c)
        slack = strain < plain.slackness
        slope = plain.ea if slack else tangent(strain, line)
        pull = plain.ea * (strain - plain.slackness) if slack else stress(strain, line)
        return pull, slope * (1.0 + strain) / length

    @kernel()
    def pull_all(w, data, c):
        """Write the tensions at the slips, and their slopes."""
        line = record_at(record, data, c, 0)
        for s in range(len(w)):
            length, strain = natural(w, s), strain_of(w, s)
            tension, slope = stress(strain, line), tangent(strain, line)
            w[s].tension, w[s].slope = tension, slope / length
            w[s].rate = w[s].slope * (1.0 + strain)
            w[s].pull, w[s].pull_rate = pull_of(strain, length, data, c)

    @kernel()
    def newton(w, rings, data, c, a, b):
        """Change the slips by a Newton step, as far as segments keep their share of material; the largest miss."""
        for r in range(rings):
            b[r, 0] = w[r].slip_before - w[r].slip
            if abs(w[r].direction) == 1.0:
                b[r, 0] = w[r].direction * beyond(w, r, w[r].direction > 0.0)
            elif w[r].direction != 0.0:
                b[r, 0] += 0.5 * w[r].direction * reach_of(w, r)
        matrix(w, rings, a)
        eliminate(a, b)
        share = 1.0
        for r in range(rings):
            w[r].change = b[r, 0]
        for s in range(len(w)):
            i, j, first, second = rings_beside(w, s)
            loss = second * w[j].change - first * w[i].change
            if loss * share > SHRINK * natural(w, s):
                share = SHRINK * natural(w, s) / loss
        for r in range(rings):
            w[r].slip += share * w[r].change
            moved, reach = slipped(w, r), reach_of(w, r)
            if w[r].direction == 0.0 and share == 1.0:
                w[r].slip = w[r].slip_before
            elif abs(moved) > reach:
                w[r].slip = w[r].slip_before + math.copysign(reach, moved)
        pull_all(w, data, c)
        return miss(w, rings)

    @kernel()
    def length_at(pull, w, data, c, s):
        """Natural length that segment s has at a pull."""
        line, plain = record_at(record, data, c, 0), line_at(data, c)
        low = plain.slackness + pull / plain.ea  # no slope is above EA
        if pull > DENORMAL * plain.ea and stress(low, line) < pull * (1.0 - ROUNDING):
            high = 2.0 * low
            for _ in range(DOUBLINGS):
                if stress(high, line) >= pull:
                    break
                high *= 2.0
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                if stress(middle, line) < pull:
                    low = middle
                else:
                    high = middle
        return w[s].length / (1.0 + low)

    @kernel()
    def shoot(pull, incoming, w, data, c, start, first):
        """Material that is left at the end of the chain, where segment ``first`` of it has a pull; −∞ if it is too low.

        The chain begins at segment ``start``. Material left behind each of its segments is written, −∞ behind a slack
        one that would take more.
        """
        count, moved = len(w), incoming
        for i in range(first, count):
            s = (start + i) % count
            if moved > -math.inf:
                moved += w[s].length - w[s].elongation + w[s].gained_before - length_at(pull, w, data, c, s)
            w[i].left = moved
            if moved > 0.0:
                pull = max(pull, 0.0) / w[s].kappa if w[s].kappa > 0.0 else math.inf
            elif pull > 0.0:
                pull *= w[s].kappa
            else:
                moved = -math.inf
        return w[count - 1].left

    @kernel()
    def chain(w, data, c, start, rounds):
        """Write the slips of a chain of all segments from ``start`` on, whose ends keep their material.

        Material that is left at the end grows with the pull on a segment. It jumps where a ring on the way turns from
        one direction to the other: there that ring sticks, and the chain begins anew behind it.
        """
        count, first, incoming, ea = len(w), 0, 0.0, line_at(data, c).ea
        low, high = -ea, ea
        for _ in range(DOUBLINGS):
            if shoot(high, incoming, w, data, c, start, first) >= 0.0:
                break
            high *= 2.0
        while first < count:
            for _ in range(rounds):
                pull = 0.5 * (low + high)
                if low < 0.0 < high:
                    pull = 0.0
                elif low == 0.0:
                    pull = 1e-3 * high if high > ROUNDING**2 * ea else 0.0
                elif high > 2.0 * low > 0.0:
                    pull = math.sqrt(low * high)
                if pull == low or pull == high:
                    break
                if shoot(pull, incoming, w, data, c, start, first) < 0.0:
                    low = pull
                else:
                    high = pull
            shoot(low, incoming, w, data, c, start, first)
            for i in range(first, count):
                w[i].left_low = w[i].left
            shoot(high, incoming, w, data, c, start, first)
            pull_low, pull_high = low, high
            for i in range(first, count):
                s = (start + i) % count
                first = i + 1
                if i == count - 1:
                    break
                down, up = w[i].left_low, w[i].left
                incoming = up
                if down <= 0.0 < up:  # it sticks
                    incoming = 0.0
                    low = w[s].kappa * pull_low if w[s].kappa * pull_low > 0.0 else -ea
                    high = max(pull_high, 0.0) / w[s].kappa if w[s].kappa > 0.0 else LARGEST * ea
                elif down <= 0.0 and pull_low <= 0.0:  # it goes to a segment that gets just taut, from a slack one
                    low, high = -ea, 0.0
                w[s].slip = w[s].slip_before + incoming
                if down <= 0.0 and (up > 0.0 or pull_low <= 0.0):
                    break
                if up > 0.0:
                    pull_low, pull_high = max(pull_low, 0.0) / w[s].kappa, max(pull_high, 0.0) / w[s].kappa
                else:
                    pull_low, pull_high = pull_low * w[s].kappa, pull_high * w[s].kappa

    @kernel()
    def find_chain(w, data, c, start, moved, rounds):
        """Write the slips of a chain where a winch has slipped by ``moved``; its pull beyond its limit, with a sign."""
        count = len(w)
        for r in range(count):
            w[r].slip = w[r].slip_before
        if w[0].head != w[0].tail:
            w[count - 1].slip += moved
        for s in range(count):
            w[s].gained_before = gained(w, s)
        chain(w, data, c, start, rounds)
        pull_all(w, data, c)
        if w[0].head == w[0].tail:
            return 0.0
        ahead, back = beyond(w, count - 1, True), beyond(w, count - 1, False)
        if moved != 0.0:
            return ahead if moved > 0.0 else -back
        return ahead if ahead > 0.0 else -back if back > 0.0 else 0.0

    @kernel()
    def find_with_winch(w, data, c, rounds):
        """Write all slips by `chain`, with that of a winch by bisection."""
        first = find_chain(w, data, c, 0, 0.0, rounds)
        if first == 0.0 or w[0].reach == 0.0:
            return
        sign, low, high = math.copysign(1.0, first), 0.0, min(w[0].reach, w[0].length)
        for _ in range(FARTHER):
            if find_chain(w, data, c, 0, sign * high, rounds) * sign <= 0.0 or high >= w[0].reach:
                break
            high = min(2.0 * high, w[0].reach)
        if find_chain(w, data, c, 0, sign * high, rounds) * sign >= 0.0:
            return
        for _ in range(rounds):
            middle = 0.5 * (low + high)
            if middle == low or middle == high:
                break
            if find_chain(w, data, c, 0, sign * middle, rounds) * sign > 0.0:
                low = middle
            else:
                high = middle

    @kernel()
    def find_all(w, rings, data, c, a, b):
        """Write all slips by `chain`; a closed thread has a ring that sticks, at which it begins."""
        count, best, best_error = len(w), 0, math.inf
        starts = count if w[0].head * w[0].tail > 0.0 else 1
        for trial in range(2 * starts + (starts > 1)):
            start, rounds = trial % starts, ROUGH if trial < starts else BISECTIONS
            if trial == 2 * starts:
                start = best
            if w[0].head != w[0].tail:
                find_with_winch(w, data, c, rounds)
            else:
                find_chain(w, data, c, start, 0.0, rounds)
            error = miss(w, rings)
            for _ in range(POLISH):
                if error <= 1.0:
                    return
                for r in range(rings):
                    moved, nothing = slipped(w, r), 8.0 * ROUNDING * (abs(w[r].slip) + w[r].length)
                    w[r].direction = 1.0 if moved > nothing else -1.0 if moved < -nothing else 0.0
                    if abs(moved) >= reach_of(w, r) * (1.0 - NEAR):
                        w[r].direction *= 2.0
                error = newton(w, rings, data, c, a, b)
            if error < best_error and trial >= starts:
                best, best_error = start, error

    @kernel()
    def wind(t, x, data, c, w, winch, row):
        """Write what a winch holds and asks for at time t, by its numbers from a column on."""
        last, rings = len(w) - 1, len(w)
        begin = internal_number(x, row, 2 * rings + 1)
        span, fixed = t - begin, data[c, winch + 3] > 0.0
        if span < SAME * t:  # times of steps are sums
            span = 0.0
        w[0].holds_in, w[0].holds_out, w[last].kappa = data[c, winch], data[c, winch + 1], 1.0
        w[0].reach = math.inf if fixed or math.isinf(data[c, winch + 2]) else span * data[c, winch + 2]
        if not fixed:
            hauled = hauled_until(begin + span, data, c, winch + 4) - hauled_until(begin, data, c, winch + 4)
            w[last].slip_before += hauled * (w[0].tail - w[0].head)
            w[last].slip = w[last].slip_before

    @kernel(apart=())
    def find_slips(t: float, x: Matrix, cells: Indices, data: Matrix, c: int, w: SegmentArray) -> int:
        """Write the numbers of cell c where its slips are those that positions ask for; the number of its rings.

        A winch has wound until the time t.
        """
        line, first, rings = record_at(record, data, c, 0), first_of(cells), rings_of(cells, data, c)
        share, ends, count = 1.0 - line.natural_length / line.distance, data[c, first + 1], cells.shape[1] - 1
        ordinary = rings - (ends > 1.0)
        for s in range(count):
            w[s] = NOTHING[0]
            _, _, _, _, length, longer = segment(x, cells, data, c, s)
            w[s].length, w[s].elongation = length, longer + share * data[c, width + 4 + 4 * s]
        w[0].head, w[0].tail = 1.0 if ends == 1.0 or ends == 2.0 else 0.0, 1.0 if ends == 1.0 or ends == 3.0 else 0.0
        for r in range(rings):
            w[r].slip_before = w[r].slip = internal_number(x, int(data[c, first]), r)
        for r in range(ordinary):
            w[r].kappa = math.exp(-data[c, first + 2 + r] * turn_of(x, cells, data, c, r))
        if ends > 1.0:
            wind(t, x, data, c, w, first + 2 + ordinary, int(data[c, first]))
        pull_all(w, data, c)
        empty = min(natural(w, 0), natural(w, count - 1)) <= 0.0  # by a winch
        if empty or miss(w, rings) > 1.0:
            a, b = np.empty((rings, rings)), np.empty((rings, 1))
            error = math.inf
            for _ in range(0 if empty else STEPS):
                choose(w, rings, False)
                error = newton(w, rings, data, c, a, b)
                if error <= 1.0:
                    break
            if not error <= 1.0:
                find_all(w, rings, data, c, a, b)
        return rings

    return find_slips
