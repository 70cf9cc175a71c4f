"""Continuous collision detection: each drift of an explicit step is checked before it is taken.

In a drift rows move in straight lines, with the velocities of the kick before. Lines cannot meet if their overlap plus
the largest approach of two rows is less than the distance of contact. Else the pairs of lines are checked one by one,
see `refweb.effects.self_contact.line_line_ccd`. A step in which two lines would meet is rejected and cut to `SHORTER`
of its size, until the next row or corner of a table. The run ends if the step falls below `LEAST` of the stable step.
Neighbours along the net do not push each other; the time at which the first two meet is reported.

A check finds how far rows may move until the next check is needed; there is none while the sum of drifts is less.

A step of higher order has several drifts, and cannot be rejected after the first. It is checked in advance as a step of
order 2, and cut in the same way. Lines that pass in one of its drifts nevertheless are reported.

The check of lines with bodies is similar, see `refweb.effects.contact.line_body_ccd`. No line can reach the middle of a
body if the largest depth of all contacts plus the approach in a drift is less than the depth there. Else lines near
bodies are checked one by one. A line that is in the core already is reported and does not cut the step. If twice the
approach of the last drift is still safe, the next drift is checked after it, when its approach is known without a
search over all velocities. Lines that have moved further in that drift are reported.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ...kernels import (
    CCD_NEIGHBOURS,
    INDICES,
    INTEGERS,
    MATRIX,
    MEETS,
    VECTOR,
    Arrays,
    Functions,
    IndexTable,
    Integers,
    IntegerTable,
    MatrixTable,
    MeetsTable,
    Record,
    Vector,
    VectorTable,
    WatchTable,
    kernel,
)
from ...net.rotation_bounds import beside_places
from .crossings import APART, BESIDE, THROUGH, note_met
from .neighbour_list import WAY, goes_freely, near_of
from .vector_spread import spread_of

if TYPE_CHECKING:
    from .neighbour_list import NeighbourList
    from .records import ForceTerms, Model, Running

SHORTER = 0.25
"""Share of a step in which lines would meet that is tried next."""
LEAST = 1e-3
"""Share of the stable step below which none is tried."""
CALM = 2.0
"""Way of a drift that is not looked at before, over that of the last, at most; above, it is told of."""
TOLD, KEPT_APART, FORESEEN = 0, 1, 2
"""Where lines would pass, they are told of, the drift is not taken, or the step is not begun and nothing is told of."""
FEW = 16.0
"""Number of drifts that what is open does for, below which their ways are looked at more closely."""
PAST, DUE = -3, -1
"""Numbers behind the turns of neighbours: way that rows have gone [m], and that of the next turn; between them is the
way up to which some are chosen."""


class Ccd(Record):
    """Lines that push each other.

    Attributes
    ----------
    terms, places : ndarray of int
        The number of the term, none without; its place among those that act nearby.
    meets, watches : table
        Its kernels, see `refweb.effects.base.Crossing`.
    rows, data, due, chosen : table
        Neighbours, and when their turn comes.
    touch : float
        Distance at which lines touch [m].
    met : ndarray of int, shape (4,)
        Rows of the last two lines that would have met.
    left : ndarray, shape (2,)
        Way that rows may go until lines are looked at, and that which they have gone since they were [m].
    """

    terms: Integers
    places: Integers
    meets: MeetsTable
    watches: WatchTable
    rows: IndexTable
    data: MatrixTable
    due: VectorTable
    chosen: IntegerTable
    touch: float
    met: Integers
    left: Vector

    @classmethod
    def of(cls, system):
        """Make the record of a system."""
        numbers = [i for i, term in enumerate(system.terms) if term.contact.crossing is not None]
        crossings, near = [system.terms[i].contact.crossing for i in numbers], near_of(system)
        return cls(
            terms=np.array(numbers, dtype=np.int64),
            places=np.array([near.index(i) for i in numbers], dtype=np.int64),
            meets=Functions(MEETS, [crossing.meets for crossing in crossings]),
            watches=Functions(CCD_NEIGHBOURS, [crossing.watch for crossing in crossings]),
            rows=Arrays(INDICES, [crossing.rows for crossing in crossings]),
            data=Arrays(MATRIX, [crossing.data for crossing in crossings]),
            due=Arrays(VECTOR, [np.zeros(len(crossing.rows) + 3) for crossing in crossings]),
            chosen=Arrays(INTEGERS, [np.zeros(len(crossing.rows) + 1, dtype=np.int64) for crossing in crossings]),
            touch=max((crossing.touch for crossing in crossings), default=0.0),
            met=np.zeros(4, dtype=np.int64),
            left=np.zeros(2),
        )


class BodyCcd(Record):
    """Bodies that push lines.

    Attributes
    ----------
    terms, places : ndarray of int
        As in `Ccd`.
    meets : table
        Kernels of `refweb.effects.contact.line_body_ccd`.
    limits : ndarray
        Depth that nothing comes to of each term, at least [m].
    factors : ndarray
        Largest depth over what cells show, infinite where that is not known.
    met : ndarray of int, shape (4,)
        Nodes of the last line that would have come to the middle of a body, its row, and whether it was in the core.
    left : ndarray, shape (1,)
        Way that is open to a drift which is not looked at before [m], 0 where it is; none where nothing is pushed.
    """

    terms: Integers
    places: Integers
    meets: MeetsTable
    limits: Vector
    factors: Vector
    met: Integers
    left: Vector

    @classmethod
    def of(cls, system):
        """Those of a system."""
        numbers = [i for i, term in enumerate(system.terms) if term.contact.passing is not None]
        passing, near, limits = [system.terms[i] for i in numbers], near_of(system), np.zeros((0, 2))
        if numbers:
            from ...effects.contact.line_body_ccd import limits_of

            limits = np.array([limits_of(term, system.net.bodies) for term in passing])
        return cls(
            terms=np.array(numbers, dtype=np.int64),
            places=np.array([near.index(i) for i in numbers], dtype=np.int64),
            meets=Functions(MEETS, [term.contact.passing for term in passing]),
            limits=np.ascontiguousarray(limits[:, 0]),
            factors=np.ascontiguousarray(limits[:, 1]),
            met=np.ones(4, dtype=np.int64),
            left=np.zeros(1 if numbers else 0),
        )


@kernel(leaf=True, forceinline=True)
def _larger(a, b):
    return b if b > a else a


@kernel(leaf=True, fastmath={"contract", "nnan", "nsz"})
def largest_of(kick, v, f, inverse, share):
    """Largest component of velocities, by a ``share`` of 0 or 1, with what a kick adds to them: four maxima at once."""
    a = b = c = d = 0.0
    blocks = v.size // 4 * 4
    for q in range(0, blocks, 4):
        m, n, o, p = np.uint64(q), np.uint64(q + 1), np.uint64(q + 2), np.uint64(q + 3)
        a = _larger(a, abs(share * v[m] + kick * inverse[m] * f[m]))
        b = _larger(b, abs(share * v[n] + kick * inverse[n] * f[n]))
        c = _larger(c, abs(share * v[o] + kick * inverse[o] * f[o]))
        d = _larger(d, abs(share * v[p] + kick * inverse[p] * f[p]))
    for q in range(blocks, v.size):
        a = _larger(a, abs(share * v[np.uint64(q)] + kick * inverse[np.uint64(q)] * f[np.uint64(q)]))
    return _larger(_larger(a, b), _larger(c, d))


@kernel(apart=())
def look_anew(guard: Ccd) -> None:
    """Look at all lines when they come next: rows may be anywhere."""
    guard.left[:] = 0.0
    for m in range(guard.terms.size):
        guard.due[m][:] = 0.0


@kernel(leaf=True)
def way_among(drift, kick, v, f, inverse):
    """Way by which two rows may come nearer to each other in a drift behind a kick, by how unlike velocities are."""
    return abs(drift) * (spread_of(v.reshape(-1, 3)) + WAY * largest_of(kick, v, f, inverse, 0.0))


@kernel(leaf=True, apart=("guard",))
def open_ahead(kick: float, drift: float, model: Model, running: Running) -> bool:
    """Tell if a drift behind a kick stays within the distance that the last check found free, and use it up.

    The largest component of a velocity is written to the skin of what is near.
    """
    left, skin, size = model.guard.left, model.nearby.skin[0], 3 * model.inertia.linear
    v, f, inverse = running.v.reshape(-1)[:size], running.f.reshape(-1)[:size], model.inertia.inverse.reshape(-1)[:size]
    skin.fastest = largest_of(kick, v, f, inverse, 1.0)
    path = WAY * abs(drift) * skin.fastest
    if FEW * path > left[0]:
        path = min(path, way_among(drift, kick, v, f, inverse))
    if not path < left[0]:
        return False
    left[0] -= path
    left[1] += path
    return True


@kernel(forceinline=True)
def near_cells(path, i, index, model):
    """(Cells, data) of a term that may touch on a way [m]: those that are looked at, or all."""
    skin, terms = model.nearby.skin[0], model.terms
    if path > skin.depth - skin.used:
        source = len(terms.data) - model.nearby.terms.size + index  # see `refweb.dynamics.integrators.records`
        return terms.cells[source], terms.data[source]
    return terms.cells[i], terms.data[i]


@kernel(leaf=True, forceinline=True)
def deepest_of(depths):
    """Largest of what a term shows, 0 where that is nothing."""
    deep = 0.0
    for c in range(depths.shape[0]):
        deep = max(deep, depths[c, 0])
    return deep


@kernel(leaf=True, apart=("walls",))
def calm(walls: BodyCcd, nearby: NeighbourList, terms: ForceTerms) -> bool:
    """Tell if a drift behind another needs no check before, for bodies alone that do not turn."""
    skin, left = nearby.skin[0], math.inf
    for m in range(walls.terms.size):
        deep = deepest_of(terms.outs[walls.terms[m]])
        left = min(left, walls.limits[m] - (walls.factors[m] * deep if deep > 0.0 else 0.0))
    walls.left[0] = left if skin.steps > 0 and CALM * skin.last < left else 0.0
    return walls.left[0] > 0.0


@kernel(apart=("walls",))
def look_back_at_bodies(time: float, model: Model, running: Running) -> None:
    """Note lines that may have come to the middle of a body in a drift that was not looked at before, from its end."""
    walls, x, v, f, skin = model.walls, running.x, running.v, running.f, model.nearby.skin[0]
    for m in range(walls.terms.size):
        cells, data = near_cells(math.inf, walls.terms[m], walls.places[m], model)
        if walls.meets[m](skin.last, 0.0, 0.0, 0.0, x, v, f, model.inertia.inverse, cells, data, walls.met):
            note_met(THROUGH, time, walls.met, running.crossings)


@kernel(leaf=True, forceinline=True)
def look_back_at_drift(time, model, running):
    """Look back at the drift from a time on where it was not looked at before, and led further than it might."""
    if model.walls.left.size:
        if not (model.walls.left[0] == 0.0 or model.nearby.skin[0].last < model.walls.left[0]):
            look_back_at_bodies(time, model, running)


@kernel(leaf=True, forceinline=True)
def passes(time, kick, drift, stages, model, running):
    """Tell if the last drift of a step, behind a kick and some ``stages``, must be rejected, see `comes_through`.

    The safe distance of a check suffices if rows move with their velocities alone.
    """
    if goes_freely(model):
        if open_ahead(kick, drift, model, running):
            return False
    elif stages + model.guard.terms.size + model.inertia.turns.moment.size == 0:
        if calm(model.walls, model.nearby, model.terms):
            return False
    return comes_through(time, kick, drift, TOLD if stages else KEPT_APART, model, running)


@kernel(forceinline=True)
def reject_step(time, h, model, running):
    """Tell if a step of several drifts, of size h, must not begin."""
    if model.guard.terms.size + model.walls.terms.size == 0:
        return False
    return comes_through(time, 0.5 * h, h, FORESEEN, model, running)


@kernel(apart=("guarded",))
def comes_through(time: float, kick: float, drift: float, then: int, model: Model, running: Running) -> bool:
    """Tell if lines would pass through each other or a body's middle in a drift behind a kick, from a time on.

    ``then`` is one of `TOLD`, `KEPT_APART` and `FORESEEN`.
    """
    touch, size, left = model.guard.touch, 3 * model.inertia.linear, model.guard.left
    v, f, inverse = running.v.reshape(-1)[:size], running.f.reshape(-1)[:size], model.inertia.inverse.reshape(-1)[:size]
    path = WAY * abs(drift) * largest_of(kick, v, f, inverse, 1.0)
    if touch > 0.0 and FEW * path > touch:
        path = min(path, way_among(drift, kick, v, f, inverse))
    if not path < math.inf:
        return False
    came = passes_lines(time, path, kick, drift, then, model, running) if touch > 0.0 else False
    if model.walls.terms.size:
        came = passes_bodies(time, path, kick, drift, then, model, running) or came
    if came:
        running.clock[0].rejected, left[0] = 1, 0.0
    return came


@kernel(apart=("guard",))
def passes_lines(
    time: float, path: float, kick: float, drift: float, then: int, model: Model, running: Running
) -> bool:
    """Tell if lines that push each other would meet; where the drift is taken, find the free distance behind it."""
    guard, terms, x, v, f, came = model.guard, model.terms, running.x, running.v, running.f, False
    inverse, left = model.inertia.inverse, math.inf
    for m in range(guard.terms.size):
        i, due = guard.terms[m], guard.due[m]
        margin = guard.touch - deepest_of(terms.outs[i]) - path
        if not margin > 0.0:
            cells, data = near_cells(path - guard.touch, i, guard.places[m], model)
            if guard.meets[m](0.0, path, kick, drift, x, v, f, inverse, cells, data, guard.met):
                came = then != TOLD
                if then == TOLD:
                    note_met(APART, time, guard.met, running.crossings)
        due[PAST] += guard.left[1]
        if came or then == FORESEEN:
            continue
        if guard.watches[m](
            0.0, path, kick, drift, x, v, f, inverse, guard.rows[m], guard.data[m], due, guard.chosen[m], guard.met
        ):  # fmt: skip
            note_met(BESIDE, time, guard.met, running.crossings)
        left = min(left, margin, due[DUE] - due[PAST])
    guard.left[0], guard.left[1] = 0.0 if then == FORESEEN else left, 0.0
    return came


@kernel(apart=("walls",))
def passes_bodies(
    time: float, path: float, kick: float, drift: float, then: int, model: Model, running: Running
) -> bool:
    """Tell if lines would come as deep in a body as its middle."""
    walls, terms, x, v, f, came = model.walls, model.terms, running.x, running.v, running.f, False
    inverse, margin = model.inertia.inverse, 0.0
    if model.inertia.turns.moment.size:
        margin = beside_places(kick, drift, x, v, f, inverse, model.inertia.turns)
    walls.met[3] = 1
    for m in range(walls.terms.size):
        i = walls.terms[m]
        deep = deepest_of(terms.outs[i])
        left = walls.limits[m] - (walls.factors[m] * deep if deep > 0.0 else 0.0) - path - margin
        if model.guard.terms.size:
            model.guard.left[0] = 0.0 if model.inertia.turns.moment.size else min(model.guard.left[0], left)
        if left > 0.0:
            continue
        cells, data = near_cells(path + margin, i, walls.places[m], model)
        if walls.meets[m](margin, path, kick, drift, x, v, f, inverse, cells, data, walls.met):
            if then != TOLD and walls.met[3] == 0:
                came = True
                break
            if then != FORESEEN:
                note_met(THROUGH, time, walls.met, running.crossings)
    return came
