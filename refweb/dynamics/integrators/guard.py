"""What keeps lines from passing through lines: each drift of an explicit step is looked at before it is taken.

In a drift rows move in straight lines, behind the kick that gives them their velocities. Lines whose overlap and the
way by which two rows may come nearer are together less than the distance of touch cannot meet. Where they are not, the
pairs of lines are looked at one by one, see `refweb.effects.self_contact.crossing`: a step in which two would meet is
not taken but cut to `SHORTER` of it, until the next row or corner of a table. Where less than `LEAST` of the step that
is stable is left, the run ends. Steps of higher order are not cut, but told of. Of neighbours along the net, which do
not push each other, it is told when the first two meet.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba.typed import List

from ...kernels import INDICES, INTEGERS, MATRIX, MEETS, VECTOR, WATCH, kernel, typed_list
from .crossings import APART, BESIDE, note_met
from .nearby import near_of, spread_of

SHORTER = 0.25
"""Share of a step in which lines would meet that is tried next."""
LEAST = 1e-3
"""Share of the stable step below which none is tried."""
FAR = 0.02
"""Way over the distance of touch above which it is looked at more closely."""


class Guard(NamedTuple):
    """Lines that push each other.

    Attributes
    ----------
    families, places : ndarray of int
        The number of the family, none without; its place among those that act nearby.
    meets, watches : List
        Its kernels, see `refweb.effects.base.Crossing`.
    rows, data, due, chosen : List
        Neighbours, and when their turn comes.
    touch : float
        Distance at which lines touch [m].
    met : ndarray of int, shape (4,)
        Rows of the last two lines that would have met.
    """

    families: np.ndarray
    places: np.ndarray
    meets: List
    watches: List
    rows: List
    data: List
    due: List
    chosen: List
    touch: float
    met: np.ndarray

    @classmethod
    def of(cls, system):
        """That of a system."""
        found = [i for i, family in enumerate(system.families) if family.crossing is not None]
        own, near = [system.families[i].crossing for i in found], near_of(system)
        return cls(
            families=np.array(found, dtype=np.int64),
            places=np.array([near.index(i) for i in found], dtype=np.int64),
            meets=typed_list(MEETS, [one.meets for one in own]),
            watches=typed_list(WATCH, [one.watch for one in own]),
            rows=typed_list(INDICES, [one.rows for one in own]),
            data=typed_list(MATRIX, [one.data for one in own]),
            due=typed_list(VECTOR, [np.zeros(len(one.rows) + 2) for one in own]),
            chosen=typed_list(INTEGERS, [np.zeros(len(one.rows) + 1, dtype=np.int64) for one in own]),
            touch=max((one.touch for one in own), default=0.0),
            met=np.zeros(4, dtype=np.int64),
        )


@kernel(fastmath={"contract", "nnan", "nsz"})
def largest_of(kick, v, f, inverse):
    """Largest component of velocities behind a kick, and of what that adds to them."""
    most = more = 0.0
    for q in range(v.size):
        gained = kick * inverse[q] * f[q]
        most, more = max(most, abs(v[q] + gained)), max(more, abs(gained))
    return most, more


@kernel()
def look_anew(guard):
    """Look at all neighbours when they come next: rows may be anywhere."""
    for m in range(guard.families.size):
        guard.due[m][:] = 0.0


@kernel()
def comes_through(time, kick, drift, whole, model, running):
    """Whether lines that push each other would meet in a drift behind a kick, from a time on.

    Where a step is not a ``whole`` drift that is noted, as neighbours that meet are.
    """
    guard, families, linear = model.guard, model.families, model.inertia.linear
    x, v, f, inverse, size = running.x, running.v, running.f, model.inertia.inverse, 3 * model.inertia.linear
    most, more = largest_of(kick, v.reshape(-1)[:size], f.reshape(-1)[:size], inverse.reshape(-1)[:size])
    way = 2.0 * math.sqrt(3.0) * abs(drift) * most
    if way > FAR * guard.touch:
        way = min(way, abs(drift) * (spread_of(v[:linear]) + 2.0 * math.sqrt(3.0) * more))
    if not way < math.inf:
        return False
    came = False
    for m in range(guard.families.size):
        i, deep, skin, place = guard.families[m], 0.0, model.nearby.skin[0], guard.places[m]
        shown, cells, data = families.outs[i], families.cells[i], families.data[i]
        for c in range(shown.shape[0]):
            deep = max(deep, shown[c, 0])
        if not way + deep < guard.touch:
            if way > guard.touch + skin.depth - skin.used:
                before = place - model.nearby.families.size  # all cells, see `refweb.dynamics.integrators.records`
                data = families.data[len(families.data) + before]
                cells = families.cells[len(families.data) + before]
            if guard.meets[m](0.0, way, kick, drift, x, v, f, inverse, cells, data, guard.met):
                came = whole
                if not whole:
                    note_met(APART, time, guard.met, running.crossings)
        if not came and guard.watches[m](
            0.0, way, kick, drift, x, v, f, inverse, guard.rows[m], guard.data[m], guard.due[m], guard.chosen[m],
            guard.met,
        ):  # fmt: skip
            note_met(BESIDE, time, guard.met, running.crossings)
    if came:
        running.clock[0].held = 1
    return came
