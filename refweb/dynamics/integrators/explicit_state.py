"""State of an explicit run.

May change: nothing. Must stay: names of fields, which are keys of checkpoints unless their metadata says
``saved=False``. A further field that must survive a step, or a stop, belongs here, with a default for older folders;
`CentralDifference` hands its array to `Running` by position. Must stay as well: `ExplicitState`, which
`central_difference` imports. Tests: ``tests/dynamics/integrators/test_records.py``,
``tests/dynamics/test_dynamics.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .integrator import IntegratorState
from .records import aligned


@dataclass(eq=False, kw_only=True)
class ExplicitState(IntegratorState):
    """State of an explicit run; a run that continues from it is the same run bit for bit.

    The compiled loop writes to its arrays.

    Attributes
    ----------
    force : ndarray, shape (rows, 3)
        Force [N], last evaluated with the velocity at half a step.
    power : ndarray, shape (terms,)
        Power of each term with a power, at the last step [W].
    longest : float
        Largest approach of two rows in a step [m]; infinite if it is not known.
    snapped : ndarray, shape (elements,)
        Square of the energy that jumps of the damping of each element leave in doubt [J²], see
        `refweb.dynamics.integrators.energy_balance.note_snaps`; empty without damping.
    before : ndarray, shape (3, rows, 3)
        Displacement, velocity and force at the row or the corner of a table before.
    """

    force: np.ndarray
    power: np.ndarray
    longest: float = 0.0
    snapped: np.ndarray = field(default_factory=lambda: np.zeros(0))
    before: np.ndarray = field(init=False, metadata={"saved": False})

    def __post_init__(self):
        self.x, self.v, self.force = aligned(self.x), aligned(self.v), aligned(self.force)
        self.before = np.stack([self.x, self.v, self.force])
