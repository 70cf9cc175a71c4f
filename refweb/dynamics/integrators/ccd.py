"""Continuous collision detection: each drift of an explicit step is checked before it is taken.

In a drift rows move in straight lines, with the velocities of the kick before. Nothing passes through anything if the
deepest contact plus the largest approach of two rows is less than a limit: for lines the distance of contact, for lines
and bodies the depth in the middle of a body. Else cells are checked one by one, by the kernels of
`refweb.dynamics.integrators.crossings.checks_of`. A step in which lines would pass is rejected and cut to `SHORTER` of
its size, until the next row or corner of a table. The run ends if the step falls below `LEAST` of the stable step.
Neighbours along the net do not push each other, and a line may be in the core of a body already: the time at which the
first is there is reported, and no step is cut.

A check finds how far rows may move until the next check is needed; there is none while the sum of drifts is less. For
bodies alone, a drift is checked after it if twice the approach of the last drift is still safe: then its approach is
known without a search over all velocities. Lines that have moved further in that drift are reported.

A step of higher order has several drifts, and cannot be rejected after the first. It is checked in advance as a step of
order 2, and cut in the same way. Lines that pass in one of its drifts nevertheless are reported. The bound of explicit
steps limits the approach of two bodies, see `refweb.effects.contact.pair_overlap`.

May change: `FEW` and `CALM`, which decide how often is checked, and `SHORTER` and `LEAST`, which decide how far a step
is cut before the run ends. Must stay: bounds may be too large and never too small: no change may miss a meeting. Of
``met`` the first three numbers are rows, `line_body_ccd` sets the fourth and `central_difference` reads the fifth.
`PAST` and `NEXT` are places in the list of `kernels.DUE`, whose layout `line_line_ccd` shares. Must follow: `features`
gives the names in ``apart``, `records` has the fields of ``model`` and ``running``, `explicit_loop` calls the kernels.
Must stay as well: all names that `explicit_loop`, `step`, `records` and other files import; public names of `Ccd`,
which other files use. Tests: ``tests/effects/test_passage.py``, ``test_self_contact.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numba import from_dtype, types

from ...kernels import (
    DUE,
    DUE_LIST,
    INDICES,
    MATRIX,
    MEETS,
    Arrays,
    DueTable,
    Functions,
    IndexTable,
    Integers,
    MatrixTable,
    MeetsTable,
    Record,
    kernel,
)
from ...net.rotation_bounds import beside_places
from .crossings import APART, BESIDE, PAIRS, THROUGH, checks_of, note_met
from .neighbour_list import WAY, goes_freely
from .vector_spread import spread_of

if TYPE_CHECKING:
    from .records import Model, Running

SHORTER = 0.25
"""Share of a step in which lines would meet that is tried next."""
LEAST = 1e-3
"""Share of the stable step below which none is tried."""
CALM = 2.0
"""Largest approach in a drift that is checked after it, over that in the last drift; a larger one is reported."""
REPORT, REJECT, FORESEE = 0, 1, 2
"""Where lines would pass, they are reported, the drift is not taken, or the step is not begun and nothing reported."""
FEW = 16.0
"""Number of drifts for which a free distance lasts, below which the approach is bounded more closely."""
PAST, NEXT = -3, -1
"""Places in a list of what is due of the approach so far, and of that at which the next is due, see `DUE`."""
CHECK = np.dtype([("kind", np.int64), ("term", np.int64), ("limit", float), ("factor", float)])
"""Numbers of a `refweb.dynamics.integrators.crossings.Check`."""
PATHS = np.dtype([("free", float), ("past", float), ("unchecked", float)])
"""Approach that is free until the next check, and that of all drifts so far [m]; for bodies alone that which is free in
a drift that is checked after it, 0 where it is checked before."""
CheckArray = Annotated[np.ndarray, types.Array(from_dtype(CHECK), 1, "C")]
PathArray = Annotated[np.ndarray, types.Array(from_dtype(PATHS), 1, "C")]


class Ccd(Record):
    """Checks of a system: lines with lines, with neighbours along the net and with bodies.

    Attributes
    ----------
    checks : ndarray of `CHECK`, shape (checks,)
        Their numbers.
    meets : table
        Their kernels.
    cells, data, due : table
        All cells with their numbers, and of neighbours when each is due, see `refweb.kernels.DUE`.
    touch : float
        Distance at which lines touch [m], 0 where lines do not push each other.
    bodies : int
        Number of checks with bodies.
    met : ndarray of int, shape (5,)
        The last that would have met, see `refweb.kernels.MEETS`, and the kind that a step was rejected for.
    paths : ndarray of `PATHS`, shape (1,)
        Approach.
    """

    checks: CheckArray
    meets: MeetsTable
    cells: IndexTable
    data: MatrixTable
    due: DueTable
    touch: float
    bodies: int
    met: Integers
    paths: PathArray

    @classmethod
    def of(cls, system, reports=True):
        """Make the record of a system; without ``reports`` it leaves out neighbours, for which no step is cut."""
        left_out = (PAIRS,) if reports else (PAIRS, BESIDE)
        checks = [check for check in checks_of(system) if check.kind not in left_out]
        counts = [len(check.cells) + 3 if check.kind == BESIDE else 0 for check in checks]
        return cls(
            checks=np.array([(check.kind, check.term, check.limit, check.factor) for check in checks], dtype=CHECK),
            meets=Functions(MEETS, [check.kernel for check in checks]),
            cells=Arrays(INDICES, [check.cells for check in checks]),
            data=Arrays(MATRIX, [check.data for check in checks]),
            due=Arrays(DUE_LIST, [np.zeros(count, dtype=DUE) for count in counts]),
            touch=max((check.limit for check in checks if check.kind == APART), default=0.0),
            bodies=sum(check.kind == THROUGH for check in checks),
            met=np.zeros(5, dtype=np.int64),
            paths=np.zeros(1, dtype=PATHS),
        )


@kernel(forceinline=True, leaf=True)
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
def reset_checks(ccd: Ccd) -> None:
    """Make all cells due: rows may be anywhere."""
    ccd.paths[0].free = ccd.paths[0].past = 0.0
    for m in range(ccd.checks.size):
        due = ccd.due[m]
        for c in range(due.size):
            due[c].path = 0.0


@kernel(leaf=True, forceinline=True)
def approach(kick, drift, free, model, running):
    """(Largest component of a velocity [m/s], largest approach of two rows [m]) in a drift behind a kick.

    The approach is bounded more closely, by how much velocities differ, if `FEW` times it is not ``free`` [m].
    """
    size = 3 * model.inertia.linear
    v, f, inverse = running.v.reshape(-1)[:size], running.f.reshape(-1)[:size], model.inertia.inverse.reshape(-1)[:size]
    fastest = largest_of(kick, v, f, inverse, 1.0)
    path = WAY * abs(drift) * fastest
    if FEW * path > free:
        relative = spread_of(v.reshape(-1, 3)) + WAY * largest_of(kick, v, f, inverse, 0.0)
        path = min(path, abs(drift) * relative)
    return fastest, path


@kernel(leaf=True, apart=("line_ccd",))
def stays_free(kick: float, drift: float, model: Model, running: Running) -> bool:
    """Tell if a drift behind a kick stays within the distance that the last check found free, and use it up.

    The largest component of a velocity is written to the skin of what is near.
    """
    paths, skin = model.ccd.paths[0], model.nearby.skin[0]
    skin.fastest, path = approach(kick, drift, paths.free, model, running)
    if not path < paths.free:
        return False
    paths.free -= path
    paths.past += path
    return True


@kernel(forceinline=True)
def near_cells(path, m, model):
    """(Cells, data) that a check looks at, of those that may touch on a way [m]: those that are listed, or all."""
    skin, ccd, check = model.nearby.skin[0], model.ccd, model.ccd.checks[m]
    if check.kind == BESIDE or path > skin.depth - skin.used:
        return ccd.cells[m], ccd.data[m]
    return model.terms.cells[check.term], model.terms.data[check.term]


@kernel(leaf=True, forceinline=True)
def depth_left(m, ccd, terms):
    """Distance from the deepest contact of a check to the depth that nothing comes to [m]."""
    check, deep = ccd.checks[m], 0.0
    outs = terms.outs[check.term]
    for c in range(outs.shape[0]):
        deep = max(deep, outs[c, 0])
    return check.limit - (check.factor * deep if deep > 0.0 else 0.0)


@kernel(leaf=True, apart=("body_ccd",))
def checked_after(model: Model) -> bool:
    """Tell if a drift is checked after it, for bodies alone that do not turn."""
    ccd, skin, left = model.ccd, model.nearby.skin[0], math.inf
    for m in range(ccd.checks.size):
        left = min(left, depth_left(m, ccd, model.terms))
    ccd.paths[0].unchecked = left if skin.steps > 0 and CALM * skin.last < left else 0.0
    return ccd.paths[0].unchecked > 0.0


@kernel(apart=("body_ccd",))
def report_bodies(time: float, model: Model, running: Running) -> None:
    """Report lines that may have come to the middle of a body in a drift that is checked after it, from its end."""
    ccd, x, v, f, inverse = model.ccd, running.x, running.v, running.f, model.inertia.inverse
    last = model.nearby.skin[0].last
    for m in range(ccd.checks.size):
        cells, data, due = ccd.cells[m], ccd.data[m], ccd.due[m]
        if ccd.meets[m](last, 0.0, 0.0, 0.0, x, v, f, inverse, cells, data, due, ccd.met):
            note_met(THROUGH, time, ccd.met, running.crossings)


@kernel(leaf=True, forceinline=True)
def check_last_drift(time, model, running):
    """Check the drift from a time on where it was not checked before, and led further than foreseen."""
    if model.ccd.bodies:
        unchecked = model.ccd.paths[0].unchecked
        if not (unchecked == 0.0 or model.nearby.skin[0].last < unchecked):
            report_bodies(time, model, running)


@kernel(leaf=True, forceinline=True)
def reject_drift(time, kick, drift, stages, model, running):
    """Tell if the last drift of a step, behind a kick and some ``stages``, must be rejected, see `collides`.

    The free distance of a check suffices if rows move with their velocities alone.
    """
    if goes_freely(model):
        if stays_free(kick, drift, model, running):
            return False
    elif stages + model.inertia.turns.moment.size == 0 and not model.ccd.touch > 0.0:
        if checked_after(model):
            return False
    return collides(time, kick, drift, REPORT if stages else REJECT, model, running)


@kernel(forceinline=True)
def reject_step(time, h, model, running):
    """Tell if a step of several drifts, of size h, must not begin."""
    return model.ccd.checks.size > 0 and collides(time, 0.5 * h, h, FORESEE, model, running)


@kernel(apart=("ccd",))
def collides(time: float, kick: float, drift: float, then: int, model: Model, running: Running) -> bool:
    """Tell if a step is rejected for what would meet in a drift behind a kick, from a time on.

    ``then`` is one of `REPORT`, `REJECT` and `FORESEE`. Where the drift is taken, the free distance behind it is found.
    """
    ccd, turns, paths = model.ccd, model.inertia.turns, model.ccd.paths[0]
    x, v, f, inverse, met = running.x, running.v, running.f, model.inertia.inverse, model.ccd.met
    path = approach(kick, drift, ccd.touch if ccd.touch > 0.0 else math.inf, model, running)[1]
    if not path < math.inf:
        return False
    turned, free, came, turning = 0.0, math.inf, False, ccd.bodies > 0 and turns.moment.size > 0
    if turning:
        turned = beside_places(kick, drift, x, v, f, inverse, turns)
    for m in range(ccd.checks.size):
        kind, due, margin, reach = ccd.checks[m].kind, ccd.due[m], 0.0, path
        if kind == BESIDE:
            if then == FORESEE:
                continue
            due[PAST].path = paths.past
        else:
            if kind == THROUGH:
                margin, reach = turned, path + turned
            else:
                reach -= ccd.touch
            left = depth_left(m, ccd, model.terms) - path - margin
            free = min(free, left)
            if left > 0.0:
                continue
        cells, data = near_cells(reach, m, model)
        if ccd.meets[m](margin, path, kick, drift, x, v, f, inverse, cells, data, due, met):
            if then != REPORT and (kind == APART or kind == THROUGH and met[3] == 0):
                came, met[4] = True, kind
                break
            if then != FORESEE:
                note_met(kind, time, met, running.crossings)
        if kind == BESIDE:
            free = min(free, due[NEXT].path - paths.past - path)
    if came:
        running.clock[0].rejected = 1
    elif then != FORESEE:
        paths.past += path
    paths.free = 0.0 if came or turning or then == FORESEE else free
    return came
