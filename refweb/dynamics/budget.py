"""Budget of CPU time for runs of higher accuracy.

The first run is always completed, since there is no result before. A further run is not begun if it is expected to
exceed the remaining budget, and it is ended if it will exceed it.

May change: `SEEN`, `SURE` and `SLOWEST`, which decide when a run counts as too dear; `SURE` stands in words in the help
text of `settings.Accuracy`, "twice". Must stay: `clock`, which tests replace by a count of steps; names that
`simulation`, `accuracy_loop`, `twin_error`, `expected_cost`, `runner` and `studies.further_runs` import. With `LEAST`
or `RUNS` the help texts of `settings.Accuracy` and of `commands.trust` change, which have them in words. Must stay as
well: public names of `Budget`, which other files use. Tests: ``tests/dynamics/test_budget.py``.
"""

from __future__ import annotations

import math
import time
from typing import NamedTuple

clock = time.process_time
"""CPU time of this process [s]."""
LEAST, RUNS = 600.0, 20.0
"""Default budget: this time [s], or so many times the cost of the first run, whichever is larger."""
SEEN, SURE = 0.25, 2.0
"""Share of the remaining budget that a run may use before its cost is extrapolated; factor of the extrapolated cost
over the remaining budget at which it is ended. The factor is above 1 since runs do not progress evenly."""
SLOWEST = 0.2
"""Least expected power of 1/rtol in the number of steps."""


class Spent(Exception):
    """A run was ended because it would have exceeded the remaining budget."""


class Run(NamedTuple):
    """A run with its step refinement: the knob of its integrator, its steps, and the cost of both [s]."""

    knob: float
    steps: int
    price: float


def budget_of(given, first):
    """The given budget [s], else the default for the cost of the first run [s], see `LEAST`."""
    return max(LEAST, RUNS * first) if given is None else given


class Budget:
    """CPU time that the runs of a simulation may take.

    Parameters
    ----------
    given : float or None
        The budget [s], None for the default, see `LEAST`.

    Attributes
    ----------
    runs : list of Run
        Complete runs.
    kept : bool
        True if runs that would exceed the budget are ended.
    """

    def __init__(self, given):
        self._given, self._began = given, clock()
        self._begun = self._began, 0.0
        self.runs: list[Run] = []
        self.kept = True

    @property
    def total(self):
        """The whole budget [s]."""
        first = self.runs[0].price if self.runs else 0.0
        return budget_of(self._given, first)

    @property
    def spent(self):
        """Spent CPU time [s]."""
        return clock() - self._began

    def begin(self):
        """Record the start of a run."""
        self._begun = clock(), self.total - self.spent

    def end(self, knob, steps):
        """Record the end of a run with a knob and a number of steps."""
        self.runs.append(Run(knob, steps, clock() - self._begun[0]))

    def expected(self, integrator, knob):
        """Expected cost of a run with another knob [s], by the growth of steps so far, else by the order."""
        last = self.runs[-1]
        power = 1.0 if integrator.knob == "safety" else max(1.0 / (integrator.order + 1.0), SLOWEST)
        if len(self.runs) > 1 and (before := self.runs[-2]).knob != last.knob:
            power = max(power, math.log(last.steps / before.steps) / math.log(before.knob / last.knob))
        return last.price * (last.knob / knob) ** power

    def price_of(self, integrator, share, limit):
        """Cost of all runs, at most ``limit``, until errors have fallen by the factor ``share``.

        Errors are proportional to the step to the power of the order, or to the tolerance to the power 2/3, see
        `refweb.dynamics.twin_error.with_errors`.
        """
        total, knob, order = 0.0, self.runs[-1].knob, integrator.order if integrator.knob == "safety" else 2.0 / 3.0
        for _ in range(limit):
            factor = integrator.next_knob(share)
            knob, share = knob * factor, share * factor**order
            total += self.expected(integrator, knob)
            if share <= 1.0:
                break
        return total

    def watch(self, share):
        """Raise `Spent` if a run, of which a share is finished, exceeds the budget that remained at its start."""
        if not (self.runs and self.kept):
            return
        began, left = self._begun
        spent = clock() - began
        if spent > left or (spent > SEEN * left and spent > SURE * left * share):
            raise Spent(f"{100.0 * share:.2g} % of it took {spent:.3g} s")


def steps_with_twin(scene, by=None):
    """Steps of a run and its step refinement, over those of the run; that has ``by`` times these, else √2 times."""
    return 1.0 + (by or math.sqrt(2.0)) if scene.accuracy.error == "twin" else 1.0


def check_budget(simulation, share, twin=False):
    """Raise `Spent` if a run, of which a share is finished, and its step refinement would cost too much."""
    if not simulation.integrator.beside:  # the twin comes after the run
        both = steps_with_twin(simulation.scene)
        share = (1.0 + (both - 1.0) * share if twin else share) / both
    simulation.budget.watch(share)
