"""State of an explicit run."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .integrator import IntegratorState
from .records import aligned


@dataclass(eq=False, kw_only=True)
class ExplicitState(IntegratorState):
    """State of an explicit run; a run that goes on from it is the same run bit for bit.

    The compiled loop works in its arrays.

    Attributes
    ----------
    force : ndarray, shape (rows, 3)
        Force [N], last seen with the velocity at half a step.
    power : ndarray, shape (terms,)
        Power of each term that is booked by it at the last step [W].
    longest : float
        By how much two rows may have come nearer to each other in a step, at most [m]; infinite where that is not
        known.
    before : ndarray, shape (3, rows, 3)
        Displacement, velocity and force at the row or the corner of a table before.
    """

    force: np.ndarray
    power: np.ndarray
    longest: float = 0.0
    before: np.ndarray = field(init=False, metadata={"saved": False})

    def __post_init__(self):
        self.x, self.v, self.force = aligned(self.x), aligned(self.v), aligned(self.force)
        self.before = np.stack([self.x, self.v, self.force])
