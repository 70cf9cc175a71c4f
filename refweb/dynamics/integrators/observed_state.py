"""State of a run of a method with steps of its own."""

from __future__ import annotations

from dataclasses import dataclass, field

from .integrator import IntegratorState
from .simpson_balance import Rates


@dataclass(eq=False, kw_only=True)
class ObservedState(IntegratorState):
    """State of a run at the time that has been looked at; the method's last step may end later.

    Attributes
    ----------
    reached : float
        End of the method's last step [s].
    short : int
        Number of steps in turn that are too short to come to the next row.
    rates : refweb.dynamics.integrators.simpson_balance.Rates
        What the books integrate, at ``time``.
    """

    reached: float = 0.0
    short: int = 0
    rates: Rates | None = field(default=None, metadata={"saved": False})
