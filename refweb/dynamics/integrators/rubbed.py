"""The record of families whose kicks an explicit step solves for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba.typed import List

from ... import kernels as k
from ...kernels import MATRIX, typed_list


class Rubbed(NamedTuple):
    """Families whose kicks are solved for.

    Attributes
    ----------
    families : ndarray of int
        Their numbers; ``last`` are the places among these where runs of families with one sweep end.
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
    width: int

    @classmethod
    def of(cls, system):
        """Those of a system."""
        families = [i for i, family in enumerate(system.families) if family.rubbing is not None]
        rubbing = [system.families[i] for i in families]
        own = [family.rubbing for family in rubbing]
        last = [i for i, one in enumerate(own) if i + 1 == len(own) or own[i + 1].sweep is not one.sweep]
        return cls(
            families=np.array(families, dtype=np.int64),
            meets=typed_list(k.MEET, [one.meet for one in own]),
            recalls=typed_list(k.KEPT, [one.recall for one in own]),
            sweeps=typed_list(k.SWEEP, [one.sweep for one in own]),
            gives=typed_list(k.GIVE, [one.give for one in own]),
            last=np.array(last, dtype=np.int64),
            memories=typed_list(MATRIX, [np.zeros((len(f.cells), f.rubbing.memory)) for f in rubbing]),
            width=max((one.width for one in own), default=0),
        )
