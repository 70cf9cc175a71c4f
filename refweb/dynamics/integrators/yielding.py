"""Plastic strains and slips along the steps of a method that chooses them: steps end where one of them turns back.

Forces follow from those of any time before, which is exact until a line that yields, or a thread that slips over a
ring, turns back. So a step whose dense output turns back is cut at the first such moment, from which the method begins
anew. The energy that is lost needs the natural length at which a line yields, so that they are taken on after each
piece of a step.

May change: `SAMPLES`, `ROUNDS` and `SMALL`, which trade cost for the error of the moment. Must stay: public methods,
which `step_observer` calls; ``method`` has `state` and `interpolated` of `step_observer`; followers have the functions
``grown`` and ``drive`` of `effects.base.InternalVariables`; `Yielding`, which `step_observer` imports. Tests:
``tests/effects/test_plastic.py``.
"""

from __future__ import annotations

import numpy as np

SAMPLES = 8
"""Number of pieces of a step at whose ends they are looked at."""
ROUNDS = 40
"""Number of rounds of the golden section for the moment at which one turns back."""
SMALL = 1e-3
"""Plastic strain, or slip over the length of its thread, over rtol by which a step may turn back."""


class Yielding:
    """Plastic strains and slips of a run on one system.

    Parameters
    ----------
    system : refweb.system.system.System
        With lines that yield or threads that slip over rings with friction.
    rtol : float
        Relative tolerance.
    """

    def __init__(self, system, rtol):
        self._system, self._small, self._turned = system, SMALL * rtol, False

    def take_on(self, course):
        """Write the plastic strains and slips of a state to it."""
        course.x[:] = self._system.taken_on(course.time, course.x)

    def turned_back(self):
        """True if one has turned back at the end of the last step; the second call returns False."""
        turned, self._turned = self._turned, False
        return turned

    def _at(self, t, method, name):
        """Numbers of followers by their name at a time in the last step, shape (numbers,)."""
        net, x = self._system.at(t).net, method.state(t, *method.interpolated(t))[0]
        return np.concatenate([getattr(follower, name)(net, x, t).ravel() for follower in self._system.followers])

    def turn(self, start, end, method):
        """The first moment at which one turns back in a step, by its dense output; its end if none does.

        ``start`` and ``end`` are times of the step [s].
        """
        times = np.linspace(start, end, SAMPLES + 1)
        grown = np.array([self._at(t, method, "grown") for t in times[1:]])
        over = grown.max(axis=0) - grown[-1] > self._small
        if not over.any():
            return end
        tops = grown[:, over].argmax(axis=0)
        point = np.flatnonzero(over)[tops.argmin()]
        low, high = times[tops.min()], times[tops.min() + 2]
        ratio = 0.5 * (np.sqrt(5.0) - 1.0)
        for _ in range(ROUNDS):
            first, second = high - ratio * (high - low), low + ratio * (high - low)
            if self._at(first, method, "drive")[point] < self._at(second, method, "drive")[point]:
                low = first
            else:
                high = second
        self._turned = True
        return float(high)
