"""Budget of CPU time for raising the accuracy of a run, and the part of it that is spent.

The first run goes to its end whatever it costs, as there is no result before. One that follows it is not begun where it
is expected to cost more than what is left, and is ended where it is seen to.
"""

from __future__ import annotations

import math
import time
from typing import NamedTuple

clock = time.process_time
"""CPU time of this process [s]."""
LEAST, RUNS = 600.0, 20.0
"""Budget where none is given: this time [s], or so many times the cost of the first run, whichever is larger."""
SEEN, SURE = 0.25, 2.0
"""Share of what is left that a run has spent before it is judged by its progress, and how many times what is left it
has to be on its way to: runs do not progress evenly."""
SLOWEST = 0.2
"""Least power of 1/rtol that the number of steps is expected to grow with."""


class Spent(Exception):
    """A run was ended because it would have cost more than what is left of a budget."""


class Run(NamedTuple):
    """A run with its twin: the knob of its integrator, its steps, and its cost [s]."""

    knob: float
    steps: int
    price: float


def budget_of(given, first):
    """The budget that is given [s], else that of a first run of a cost [s], see `LEAST`."""
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
        Those that came to their end.
    kept : bool
        Whether runs are ended that would exceed it.
    """

    def __init__(self, given):
        self._given, self._began = given, clock()
        self._begun = self._began, 0.0
        self.runs: list[Run] = []
        self.kept = True

    @property
    def total(self):
        """All of it [s]."""
        first = self.runs[0].price if self.runs else 0.0
        return budget_of(self._given, first)

    @property
    def spent(self):
        """CPU time that is spent [s]."""
        return clock() - self._began

    def begin(self):
        """Note that a run begins."""
        self._begun = clock(), self.total - self.spent

    def end(self, knob, steps):
        """Note that it has come to its end, with a knob and so many steps."""
        self.runs.append(Run(knob, steps, clock() - self._begun[0]))

    def expected(self, integrator, knob):
        """Cost of a run with another value of the knob [s]: as steps have grown before, else by the method's order."""
        last = self.runs[-1]
        power = 1.0 if integrator.knob == "safety" else max(1.0 / (integrator.order + 1.0), SLOWEST)
        if len(self.runs) > 1 and (before := self.runs[-2]).knob != last.knob:
            power = max(power, math.log(last.steps / before.steps) / math.log(before.knob / last.knob))
        return last.price * (last.knob / knob) ** power

    def price_of(self, integrator, share, limit):
        """Cost of all runs, ``limit`` at most, until errors that are ``share`` times what they may be are small enough.

        Errors go with the step to the power of the order, or with the tolerance to the power 2/3, see
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
        """End a run, of which a share is done, by `Spent` where it costs more than what was left at its beginning."""
        if not (self.runs and self.kept):
            return
        began, left = self._begun
        spent = clock() - began
        if spent > left or (spent > SEEN * left and spent > SURE * left * share):
            raise Spent(f"{100.0 * share:.2g} % of it took {spent:.3g} s")


def steps_with_twin(scene):
    """Steps of a scene's run and its twin over those of the run: of order 2, half the error is √2 times the steps."""
    return 1.0 + math.sqrt(2.0) if scene.accuracy.error == "twin" else 1.0


def check_budget(simulation, share, twin=False):
    """End a run of which a share is done, or its twin, where both would cost too much; `Spent`."""
    if not simulation.integrator.beside:  # the twin comes after the run
        both = steps_with_twin(simulation.scene)
        share = (1.0 + (both - 1.0) * share if twin else share) / both
    simulation.budget.watch(share)
