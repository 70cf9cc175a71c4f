"""Where a run of a method of somebody's own steps is."""

from __future__ import annotations

from dataclasses import dataclass, field

from .integrator import Course
from .simpson_book import Rates


@dataclass(eq=False, kw_only=True)
class ObservedCourse(Course):
    """State of a run at the time that has been looked at; the method's last step may end later.

    Attributes
    ----------
    reached : float
        End of the method's last step [s].
    short : int
        Number of steps in turn that are too short to come to the next row.
    rates : refweb.dynamics.integrators.simpson_book.Rates
        What the books integrate, at ``time``.
    """

    reached: float = 0.0
    short: int = 0
    rates: Rates | None = field(default=None, metadata={"saved": False})
