"""The push between lines, as compiled kernels.

Two elements with natural lengths L and L', whose vectors are u and w, have the energy

    E = ½ κ f (L I + L' I'),        f² = |u × w|²/(L L')² + c²/(L L'),        κ = k/(√12 c³),

with the overlaps I and I' of each element with the line of the other, see
`refweb.effects.self_contact.overlap_integrals`, the distance of contact c = 2r, and the stiffness k. E is a smooth
function of the four nodes, and a rigid motion does not change it. The forces are its gradient, so that their resultant
and their moment are zero.

Lines that cross at a distance h of their centre lines overlap over a length proportional to 1/sin of their angle. The
factor f compensates this. For any angle, and at any point that is not near a free end,

    E = (16/15) κ (c² − h²)^(5/2) f/sin,        push = k h (c² − h²)^(3/2)/(√27 r³) · f/sin,

where f/sin is 1 up to (c/L)², and both are multiplied by the mean of the stretches |u|/L and |w|/L'. For a small
overlap δ the push is 3.08 k δ^(3/2)/√r, as for crossed cylinders by Hertz. Its largest value is k r, at h = r. If the
overlap is further than c from all ends, these closed forms are exact to rounding, and no sums are needed. Lines that
lie along each other push with 2 κ f h (c² − h²)·2 along their common length, so that the push of a pair is at most k r
again. Therefore the stiffness of a pair is of the order of k at any angle, and parallel lines need no shorter steps.

Columns of cells and data are described in `pair`. May change: `FAR`; `MARGIN`, `MOST`, `ROWS` and `ROWS_DEEP` upwards,
and `SHALLOW` downwards, by which explicit steps are shorter; tests of what is far, if no contact is missed. Must stay:
`OF_REACH`, which follows from the meaning of ``reach`` in bounds, and the marks `NOT_SEEN` and `NO_PUSH`; one energy,
which `overlap_integrals`, the closed form here and `penetration.HELD` share; 1.875 in `room_left`, which follows from
it and stands again in `line_line_damping.add_bounds`; `pushed`, of which damping and friction make theirs;
`add_forces`, `add_all_second`, `stored`, `depth_ahead`, `steepest` and `MOST`, which `line_line_damping` imports for
its forces, stiffness and bounds; `bound`, which `line_line_friction` calls; `force`, `energy`, `stiffness` and `bound`,
which `table` takes by name. Tests: ``tests/effects/test_self_contact.py``.
"""

from __future__ import annotations

import math

import numpy as np

from ...compiled.rows import record_at
from ...kernels import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from ..vectors import cross, dot
from .overlap_integrals import add_second, first
from .pair import ELEMENT, PAIR, Numbers, angle_factor, apart, nearest, numbers_of, place_of
from .search import REACH, axes_apart, near_pairs

MARGIN = 0.75
"""Factor on the bound for a rigid body: no row sum of 4000 random pairs is above 0.7 of the bound."""
MOST = 6.0
"""Largest number of elements that touch an element at one time, for bounds: so many equal lines fit around one."""
FAR = 4.0
"""Reach over the longest element above which a bound does not search near elements."""
OF_REACH = 0.5
"""Largest approach of two elements over the reach of a bound, which is twice that."""
ROWS, ROWS_DEEP, SHALLOW = 1.15, 1.4, 0.09
"""Bound on the row sums of a pair, over 8 c² κ times the larger of `parallel_overlap` and c, where c² − D is at most
`SHALLOW` c², and where it is more: of 200 000 random pairs, from 1.2 c to 60 c long, none comes above 1.10 and 1.33."""
NOT_SEEN = -1.0
"""Overlap of a pair without contact, as a mark."""
NO_PUSH = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
"""Forces of a pair without contact."""


@kernel(forceinline=True)
def overlap(p, u, w, n, s, t, of):
    """(J, its slopes by ½ p·p, p·u, p·w, ½ u·u, u·w and ½ w·w), E = f J, see `first`."""
    uu, uw, ww, nn, pp, pu, pw = dot(u, u), dot(u, w), dot(w, w), dot(n, n), dot(p, p), dot(p, u), dot(p, w)
    first_share, a = first(pp, pu, pw, uw, ww, nn, s, t, of.touch)
    second_share, b = first(pp, -pw, -pu, uw, uu, nn, t, s, of.touch)
    half_scale, more = 0.5 * of.scale * of.length, 0.5 * of.scale * of.second
    return half_scale * first_share + more * second_share, (
        half_scale * a[0] + more * b[0],
        half_scale * a[1] - more * b[2],
        half_scale * a[2] - more * b[1],
        half_scale * a[3] + more * b[5],
        half_scale * a[4] + more * b[4],
        half_scale * a[5] + more * b[3],
    )


@kernel(forceinline=True)
def to_nodes(p, u, w, s, t, slopes):
    """Gradients by the four nodes of a quantity with such slopes."""
    a, b, c, d, e, g = slopes
    by_p = a * p[0] + b * u[0] + c * w[0], a * p[1] + b * u[1] + c * w[1], a * p[2] + b * u[2] + c * w[2]
    by_u = (
        b * p[0] + d * u[0] + e * w[0] + s * by_p[0],
        b * p[1] + d * u[1] + e * w[1] + s * by_p[1],
        b * p[2] + d * u[2] + e * w[2] + s * by_p[2],
    )
    by_w = (
        c * p[0] + e * u[0] + g * w[0] - t * by_p[0],
        c * p[1] + e * u[1] + g * w[1] - t * by_p[1],
        c * p[2] + e * u[2] + g * w[2] - t * by_p[2],
    )
    return (
        (by_p[0] - by_u[0], by_p[1] - by_u[1], by_p[2] - by_u[2]),
        by_u,
        (-by_p[0] - by_w[0], -by_p[1] - by_w[1], -by_p[2] - by_w[2]),
        by_w,
    )


@kernel(forceinline=True)
def between(geometry, s, t):
    """Vector from the share t of the other element to the share s of the first."""
    p, u, w = geometry
    return p[0] + s * u[0] - t * w[0], p[1] + s * u[1] - t * w[1], p[2] + s * u[2] - t * w[2]


@kernel(forceinline=True)
def slopes_of_factor(u, w, n, f, area):
    """(∂f/∂u, ∂f/∂w)."""
    first, second, scale = cross(w, n), cross(n, u), 1.0 / (f * area * area)
    return (
        (scale * first[0], scale * first[1], scale * first[2]),
        (scale * second[0], scale * second[1], scale * second[2]),
    )


@kernel(forceinline=True)
def crossed(geometry, n, of):
    """(J, its slopes, squared distance) of a pair that overlaps far from its ends; J is 0 for all others.

    Let both infinite lines cross at s and t with a distance h, R = c² − h² and N = |u × w|. The overlap extends by
    (R/N²)^½ |w| to each side along the first element, and correspondingly along the other:

        J = (8/15) κ R^(5/2) (L |w| + L' |u|)/N.

    The slopes are numbers a, b, α and β: ∂J/∂p = a n, ∂J/∂u = w × (a p + b n) + α u, and ∂J/∂w = (a p + b n) × u + β w.
    """
    (p, u, w), touch = geometry, of.touch
    uu, uw, ww, nn, pn = dot(u, u), dot(u, w), dot(w, w), dot(n, n), dot(p, n)
    remainder = touch * touch * nn - pn * pn
    if not (remainder > 0.0 and nn > 0.0):
        return 0.0, 0.0, 0.0, 0.0, 0.0, math.inf
    first, second_length = math.sqrt(uu), math.sqrt(ww)
    both = first * second_length
    reciprocal = 1.0 / (nn * both)  # of three numbers by one division: those and roots are most of the time
    inverse, short = reciprocal * both, reciprocal * nn
    remainder *= inverse
    half = math.sqrt(remainder * inverse)
    d, e = dot(u, p), dot(w, p)
    s, t, along = (uw * e - ww * d) * inverse, (uu * e - uw * d) * inverse, half * abs(uw) + touch
    wide, high = max(half * second_length, along * second_length * short), max(half * first, along * first * short)
    if not (wide <= s <= 1.0 - wide and high <= t <= 1.0 - high):
        return 0.0, 0.0, 0.0, 0.0, 0.0, math.inf
    size = of.length * second_length + of.second * first
    scale = 8.0 / 15.0 * of.scale * remainder * half
    j, by_p, share = scale * remainder * size, -5.0 * scale * pn * inverse * size, scale * remainder * short
    turn = -(by_p * pn + j) * inverse
    return j, by_p, turn, of.second * second_length * share, of.length * first * share, pn * pn * inverse


@kernel()
def forces_of(geometry, of):
    """(Overlap of a pair that may touch [m], or `NOT_SEEN`, and the forces on its four nodes)."""
    p, u, w = geometry
    n = cross(u, w)
    f, area = angle_factor(n, of.length, of.second, of.touch)
    j, by_p, turn, direct, more, square = crossed(geometry, n, of)
    if j == 0.0:
        return forces_near_ends(geometry, n, f, area, of)
    a, b, direct, more = f * by_p, f * turn + j / (f * area * area), f * direct, f * more
    m = a * p[0] + b * n[0], a * p[1] + b * n[1], a * p[2] + b * n[2]
    q, r = cross(w, m), cross(m, u)
    q = q[0] + direct * u[0], q[1] + direct * u[1], q[2] + direct * u[2]
    r = r[0] + more * w[0], r[1] + more * w[1], r[2] + more * w[2]
    return max(of.touch - math.sqrt(square), 0.0), (
        (q[0] - a * n[0], q[1] - a * n[1], q[2] - a * n[2]),
        (-q[0], -q[1], -q[2]),
        (r[0] + a * n[0], r[1] + a * n[1], r[2] + a * n[2]),
        (-r[0], -r[1], -r[2]),
    )


@kernel(forceinline=True)
def forces_near_ends(geometry, n, f, area, of):
    """Overlap and forces of a pair that overlaps near an end, or not at all."""
    s, t, square = nearest(geometry.p, geometry.u, geometry.w)
    if square > (REACH * of.touch) ** 2:
        return NOT_SEEN, NO_PUSH
    p, u, w = between(geometry, s, t), geometry.u, geometry.w
    j, (a, b, c, d, e, g) = overlap(p, u, w, n, s, t, of)
    if j == 0.0:
        return NOT_SEEN, NO_PUSH
    f, turn = -f, -j / (f * area * area)
    e, d, g = f * e - turn * dot(u, w), f * d + turn * dot(w, w), f * g + turn * dot(u, u)
    return max(of.touch - math.sqrt(square), 0.0), to_nodes(p, u, w, s, t, (f * a, f * b, f * c, d, e, g))


@kernel(forceinline=True)
def pushed(x, cells, data, c):
    """(Overlap of pair c [m], or `NOT_SEEN`, and the forces on its four nodes [N]).

    Pairs without contact cost no call, and no call takes an array: counting the references to the arrays of a pair
    would take as long as its push.
    """
    geometry, of = place_of(x, cells, data, c), numbers_of(data, c)
    if apart(geometry, of.touch):
        return NOT_SEEN, NO_PUSH
    return forces_of(geometry, of)


@kernel(forceinline=True)
def add_forces(share, f, cells, c, forces):
    """Add a share of the forces on the four nodes of pair c to f."""
    for n in range(4):
        for k in range(3):
            f[cells[c, n], k] += share * forces[n][k]


@kernel()
def energy_of(geometry, of):
    """Energy of a pair that may touch [J]."""
    n = cross(geometry.u, geometry.w)
    j = crossed(geometry, n, of)[0]
    if j == 0.0:
        s, t, square = nearest(geometry.p, geometry.u, geometry.w)
        if not square > (REACH * of.touch) ** 2:
            j = overlap(between(geometry, s, t), geometry.u, geometry.w, n, s, t, of)[0]
    return angle_factor(n, of.length, of.second, of.touch)[0] * j


@kernel(forceinline=True)
def stored(x, cells, data, c):
    """Energy of pair c [J]."""
    geometry, of = place_of(x, cells, data, c), numbers_of(data, c)
    return 0.0 if apart(geometry, of.touch) else energy_of(geometry, of)


@kernel(FORCE)
def force(t, x, v, f, cells, data, out):
    if cells.shape[1] == 4:
        for c in range(cells.shape[0]):
            deep, forces = pushed(x, cells, data, c)
            out[c, 0] = max(deep, 0.0)
            if deep != NOT_SEEN:
                add_forces(1.0, f, cells, c, forces)
        return
    out[:, 0] = 0.0
    chosen, rows, numbers = near_pairs(0.0, x, cells, data)
    for c in range(rows.shape[0]):
        deep, forces = pushed(x, rows, numbers, c)
        if deep != NOT_SEEN:
            add_forces(1.0, f, rows, c, forces)
            for n in range(2):
                out[chosen[c, n], 0] = max(out[chosen[c, n], 0], deep)


@kernel(ENERGY)
def energy(t, x, cells, data, out):
    if cells.shape[1] == 4:
        for c in range(cells.shape[0]):
            out[c] = stored(x, cells, data, c)
        return
    out[:] = 0.0
    chosen, rows, numbers = near_pairs(0.0, x, cells, data)
    for c in range(rows.shape[0]):
        half = 0.5 * stored(x, rows, numbers, c)
        for n in range(2):
            out[chosen[c, n]] += half


@kernel()
def add_turning(block, geometry, j, slopes, by_u, by_w, f, area):
    """Add what follows of f as the elements turn: ∇f ∇J + ∇J ∇f + J ∇∇f; ``slopes (4, 3)`` are those of J."""
    u, w, of_u, of_w = geometry.u, geometry.w, (-1.0, 1.0, 0.0, 0.0), (0.0, 0.0, -1.0, 1.0)
    uu, uw, ww, scale = dot(u, u), dot(u, w), dot(w, w), j / (f * area * area)
    for a in range(3):
        for b in range(3):
            identity = 1.0 if a == b else 0.0
            first_block = scale * (ww * identity - w[a] * w[b]) - j * by_u[a] * by_u[b] / f
            mixed = scale * (2.0 * u[a] * w[b] - w[a] * u[b] - uw * identity) - j * by_u[a] * by_w[b] / f
            last_block = scale * (uu * identity - u[a] * u[b]) - j * by_w[a] * by_w[b] / f
            for m in range(4):
                tilt = of_u[m] * by_u[a] + of_w[m] * by_w[a]
                for n in range(4):
                    change = of_u[n] * by_u[b] + of_w[n] * by_w[b]
                    value = tilt * slopes[n, b] + slopes[m, a] * change
                    value += of_u[m] * of_u[n] * first_block + of_w[m] * of_w[n] * last_block
                    value += of_u[m] * of_w[n] * mixed
                    block[3 * m + a, 3 * n + b] += value
                    block[3 * n + b, 3 * m + a] += of_u[m] * of_w[n] * mixed


@kernel()
def add_all_second(x, cells, data, c, definite, block):
    """Add the second derivatives of the energy of pair c to its block, or a part that is positive semidefinite."""
    geometry, of = place_of(x, cells, data, c), numbers_of(data, c)
    if apart(geometry, of.touch):
        return
    p, u, w = geometry
    n = cross(u, w)
    f, area = angle_factor(n, of.length, of.second, of.touch)
    half = 0.5 * of.scale * f
    add_second(p, u, w, of.touch, half * of.length, definite, (0, 1, 2, 3), block)
    back = -p[0], -p[1], -p[2]
    add_second(back, w, u, of.touch, half * of.second, definite, (2, 3, 0, 1), block)
    if definite:
        return
    s, t, _ = nearest(p, u, w)
    q = between(geometry, s, t)
    j, by_products = overlap(q, u, w, n, s, t, of)
    by_nodes, slopes = to_nodes(q, u, w, s, t, by_products), np.empty((4, 3))
    for m in range(4):
        for k in range(3):
            slopes[m, k] = by_nodes[m][k]
    by_u, by_w = slopes_of_factor(u, w, n, f, area)
    add_turning(block, geometry, j, slopes, by_u, by_w, f, area)


@kernel(STIFFNESS)
def stiffness(t, x, v, blocks, cells, data, definite):
    for c in range(cells.shape[0]):
        blocks[c] = 0.0
        add_all_second(x, cells, data, c, definite, blocks[c])


@kernel(forceinline=True)
def parallel_overlap(of):
    """f times the length in reach of a pair of parallel lines [m]."""
    return of.touch / math.sqrt(of.length * of.second) * (min(of.length, of.second) + 2.0 * of.touch)


@kernel(forceinline=True)
def row_sum(of, depth):
    """Bound on the row sums of a pair alone [N/m] whose c² − D is at most ``depth``.

    Its row sums do not grow as 2 `steepest` does: lines that cross are no stiffer than at c²/4, and what is in reach of
    parallel lines is spread over both nodes.
    """
    share = ROWS if depth <= SHALLOW * of.touch * of.touch else ROWS_DEEP
    return share * 8.0 * of.touch * of.touch * of.scale * max(parallel_overlap(of), of.touch)


@kernel(forceinline=True)
def steepest(of, depth):
    """Bound on the stiffness of a pair [N/m] whose c² − D is at most ``depth``: 8 c² κ f times the length in reach."""
    touch, shared = of.touch, parallel_overlap(of)
    return MARGIN * 8.0 * touch * touch * of.scale * math.sqrt(4.0 * depth + shared * shared)


@kernel(forceinline=True)
def room_left(limit, touch, scale, stored_now, moving):
    """c² − D that a pair may come to: what is within reach, and for what its energy and that of motion allow."""
    if not scale > 0.0:
        return 0.0
    limit, power = min(limit, touch * touch), 1.875 * (stored_now + moving) / scale
    return limit if power >= touch**5 else min(limit, power**0.4)


@kernel(forceinline=True)
def depth_ahead(reach, speed, x, mass, cells, data, c):
    """(c² − D that pair c may come to within a reach at some speed, whether it touches now).

    See `refweb.effects.contact.penalty.foresight`.
    """
    geometry, of, pair = place_of(x, cells, data, c), numbers_of(data, c), record_at(PAIR, data, c, 0)
    square, touch = nearest(geometry.p, geometry.u, geometry.w)[2], of.touch
    closing, reach = min(reach, pair.closing), min(reach, pair.approach)
    if not square < (REACH * touch + closing) ** 2:
        return 0.0, False
    first_mass, second_mass = mass[cells[c, 0]] + mass[cells[c, 1]], mass[cells[c, 2]] + mass[cells[c, 3]]
    reduced = (
        first_mass * second_mass / (first_mass + second_mass)
        if min(first_mass, second_mass) > 0.0
        else max(first_mass, second_mass)
    )
    speed = min(speed if speed > 0.0 else math.inf, pair.speed)
    moving = 0.5 * reduced * speed * speed
    p, u, w = geometry
    left, axes = max(math.sqrt(square) - closing, 0.0), axes_apart(p, u, w, touch, reach)
    limit = min(2.0 * touch * touch - left * left, touch * touch - axes * axes)
    return room_left(limit, touch, of.scale, stored(x, cells, data, c), moving), square < touch * touch


@kernel()
def note_pairs(reach, speed, x, mass, cells, data, rates_here, largest):
    """Write the sum of the bounds of all pairs of each row, and the largest that it may be.

    That is `MOST` times the largest of a pair. In a span, in which each pair has a speed of its own, a row has all
    pairs that touch at its start, but no more than an element whose middle another like it touches as deep as it can;
    and no less than any pair alone that may touch in the span. In a capture two or three of some ten pairs touch a row
    at one time, most of them for less than a span, and of those that come near few touch.
    """
    in_span = cells.shape[0] > 0 and record_at(PAIR, data, 0, 0).speed < math.inf
    for c in range(cells.shape[0]):
        depth, touches = depth_ahead(reach, speed, x, mass, cells, data, c)
        if not depth > 0.0:
            continue
        of = numbers_of(data, c)
        if in_span:
            value, limit = row_sum(of, depth), steepest(of, of.touch * of.touch)
            highest = value
        else:
            value, limit = 2.0 * steepest(of, depth), math.inf
            highest = MOST * value
        for n in range(4):
            r = cells[c, n]
            largest[r] = max(largest[r], highest)
            if touches or not in_span:
                rates_here[r] = max(rates_here[r], min(rates_here[r] + value, limit))
    for r in range(largest.size if in_span else 0):
        rates_here[r], largest[r] = max(rates_here[r], largest[r]), math.inf


@kernel()
def note_all(speed, mass, cells, data, rates_here, largest):
    """The same where any two elements may touch: each has its middle touched by another like it."""
    for c in range(cells.shape[0]):
        element = record_at(ELEMENT, data, c, 0)
        of = Numbers(element.touch, element.scale, element.length, element.length)
        moving = math.inf if speed == 0.0 else 0.25 * (mass[cells[c, 0]] + mass[cells[c, 1]]) * speed * speed
        value = steepest(of, room_left(math.inf, of.touch, of.scale, 0.0, moving))
        for n in range(2):
            largest[cells[c, n]] = rates_here[cells[c, n]] = max(largest[cells[c, n]], value)


@kernel()
def longest(x, cells, data):
    """Length of the longest element."""
    square = 0.0
    for c in range(cells.shape[0]):
        i, j, longest_here, ends = cells[c, 0], cells[c, 1], 0.0, record_at(ELEMENT, data, c, 0).ends
        for k in range(3):
            longest_here += (ends[1, k] - ends[0, k] + x[j, k] - x[i, k]) ** 2
        square = max(square, longest_here)
    return math.sqrt(square)


@kernel(BOUND)
def bound(reach, speed, x, mass, rates, cells, data):
    rates_here, largest, reach = np.zeros(rates.size), np.zeros(rates.size), OF_REACH * reach
    if cells.shape[1] == 4:
        note_pairs(reach, speed, x, mass, cells, data, rates_here, largest)
    elif reach > FAR * longest(x, cells, data):
        note_all(speed, mass, cells, data, rates_here, largest)
    else:
        _, rows, numbers = near_pairs(reach, x, cells, data)
        note_pairs(reach, speed, x, mass, rows, numbers, rates_here, largest)
    for r in range(rates.size):
        rates[r] += min(rates_here[r], largest[r])
