"""Families whose kicks an explicit step solves for: their record, and what is done for all of them in turn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba.typed import List

from ... import kernels as k
from ...effects.base import CELL
from ...kernels import MATRIX, kernel, typed_list
from .nearby import near_of


class Rubbed(NamedTuple):
    """Families whose kicks are solved for.

    Attributes
    ----------
    families : ndarray of int
        Their numbers; ``last`` are the places among these where runs of families with one sweep end, and ``near`` those
        among what acts only near something, −1 for others.
    meets, recalls, sweeps, gives, memories : List
        Their kernels, see `refweb.effects.base.Rubbing`, and what is remembered of the step before, within a row.
    width : int
        Number of columns of what touches.
    """

    families: np.ndarray
    meets: List
    recalls: List
    sweeps: List
    gives: List
    memories: List
    last: np.ndarray
    near: np.ndarray
    width: int

    @classmethod
    def of(cls, system):
        """Those of a system."""
        families = [i for i, family in enumerate(system.families) if family.rubbing is not None]
        rubbing = [system.families[i] for i in families]
        own = [family.rubbing for family in rubbing]
        last = [i for i, one in enumerate(own) if i + 1 == len(own) or own[i + 1].sweep is not one.sweep]
        near = near_of(system)
        return cls(
            families=np.array(families, dtype=np.int64),
            meets=typed_list(k.MEET, [one.meet for one in own]),
            recalls=typed_list(k.KEPT, [one.recall for one in own]),
            sweeps=typed_list(k.SWEEP, [one.sweep for one in own]),
            gives=typed_list(k.GIVE, [one.give for one in own]),
            last=np.array(last, dtype=np.int64),
            near=np.array([near.index(i) if system.families[i].near else -1 for i in families], dtype=np.int64),
            memories=typed_list(MATRIX, [np.zeros((len(f.cells), f.rubbing.memory)) for f in rubbing]),
            width=max((one.width for one in own), default=0),
        )


@kernel()
def meet_all(h, x, v, inverse, families, rubbed, touches, ends):
    """Write all that touches, and to ``ends`` the rows that each family's end at; ``touches``, or a larger one.

    Of a family of which some cells are looked at, what touches has their numbers among all.
    """
    while True:
        count = 0
        for m in range(rubbed.families.size):
            i, begin, near = rubbed.families[m], count, rubbed.near[m]
            count = rubbed.meets[m](h, x, v, inverse, families.cells[i], families.data[i], touches, count)
            ends[m] = count
            if near >= 0:
                chosen = families.cells[len(families.data) + near]
                for n in range(begin, min(count, touches.shape[0]) if chosen.shape[0] else begin):
                    touches[n, CELL] = chosen[int(touches[n, CELL]), 0]
        if count <= touches.shape[0]:
            return touches
        touches = np.empty((2 * count, rubbed.width))


@kernel()
def give_all(number, v, touches, ends, families, rubbed):
    """Note forces, and write the power of each cell at the velocities v, to where it is looked for."""
    begin = 0
    for m in range(rubbed.families.size):
        i, near = rubbed.families[m], rubbed.near[m]
        out = families.outs[i if near < 0 else len(families.forces) + near]
        rubbed.gives[m](number, rubbed.memories[m], v, touches, begin, ends[m], out)
        begin = ends[m]
        if near >= 0:
            chosen, own = families.cells[len(families.data) + near], families.outs[i]
            for c in range(chosen.shape[0]):
                own[c, 0] = out[chosen[c, 0], 0]
