"""Trials within a budget of CPU time: the run of least expected cost comes first.

The clock of `refweb.studies.trials` measures the time. The more runs a method has had, the later its next run comes. A
run may take a third of the remaining budget. A run that is expected to take more is left out, and a run that takes more
is ended. The coarsest run of a method may always take a twentieth of the budget.

May change: all constants (`SHARE`, `TURN`, `FAIR`, `CHEAP`, `REPEATS`), which decide the order and the number of runs,
not their results. Must stay: statuses that are set here, which `cost`, `diagram` and `commands.console` read by name;
`climb` and `compile_all`, which `work_precision` calls. Tests: ``tests/studies/test_cost.py``.
"""

from __future__ import annotations

import math

import numpy as np

from ..errors import InputError, SolverError
from . import trials

SHARE = 1.0 / 3.0
"""Largest share of the remaining budget that a run may take."""
TURN = 0.05
"""Share of the budget that the coarsest run of each method may always take."""
FAIR = 1.5
"""Factor on the expected cost for each run that the method has had."""
CHEAP, REPEATS = 0.2, 3
"""CPU time [s] below which runs are repeated, and largest number of runs; the least time counts."""


def compile_all(ladders, runner):
    """Compile the kernels of each method, and find those that refuse the scene."""
    for ladder in ladders.values():
        try:
            runner.compile(ladder[0])
        except InputError as error:
            for trial in ladder:
                trial.status, trial.message = "refused", str(error)


def climb(ladders, runner, deadline, budget, tell):
    """Run all ladders side by side while there is time; the setting of least expected cost is always the next.

    The expected cost counts `FAIR` times for each run that the method has had, so that all methods have a turn.
    """
    ahead = {name: 0 for name, ladder in ladders.items() if ladder and ladder[0].status != "refused"}
    while ahead:
        prices = {name: _expected(ladders[name], rung, runner) for name, rung in ahead.items()}
        name = min(prices, key=lambda name: prices[name] * FAIR ** ahead[name])
        ladder, now = ladders[name], trials.clock()
        trial, rest = ladder[ahead[name]], ladder[ahead[name] :]
        share = SHARE * (deadline - now) if ahead[name] else max(SHARE * (deadline - now), TURN * budget)
        tell(f"{name}, {trial.setting}", min(1.0 - (deadline - now) / budget, 1.0))
        if prices[name] > share and (ahead[name] or trial.key == "safety"):
            trial.message = "would take more than its share of the budget"
        else:
            _try(trial, runner, now + share)
        if trial.status == "budget":
            for left in rest:
                left.message = trial.message
        ahead[name] += 1
        if trial.status == "budget" or ahead[name] == len(ladder):
            del ahead[name]


def _expected(ladder, rung, runner):
    """Expected CPU time of a setting [s], by its growth over the settings before, else by a power law."""
    trial = ladder[rung]
    spent = [(t.value, t.cpu_s) for t in ladder[:rung] if t.status == "solved"]
    if not spent:
        return runner.expected(trial)
    power = 1.0 if trial.key == "safety" else 0.2
    if len(spent) > 1:
        (first, cost_before), (last, cost_last) = spent[-2:]
        power = max(power, math.log(cost_last / cost_before) / math.log(first / last))
    return spent[-1][1] * (spent[-1][0] / trial.value) ** power


def _try(trial, runner, until):
    """Run a trial, several times if it is cheap, and record how it ended."""
    cheapest = np.inf
    for _ in range(REPEATS):
        began = trials.clock()
        try:
            runner.run(trial, until)
        except trials.OverBudget:
            if cheapest < np.inf:
                break
            trial.message = "took more than its share of the budget"
            return
        except SolverError as error:
            trial.status, trial.message, trial.cpu_s = "failed", str(error), trials.clock() - began
            return
        trial.status, cheapest = "solved", min(cheapest, trial.cpu_s)
        if trial.cpu_s > CHEAP or 2.0 * trials.clock() - began > until:
            break
    trial.cpu_s = cheapest
