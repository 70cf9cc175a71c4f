"""Repeated runs of a scene: until the energy balance closes, and until results have the requested digits.

The accuracy parameter of an integrator, ``safety`` or ``rtol``, trades accuracy for time; the code calls it the knob.
Each run has a value of it.

May change: constants (number and size of repeated runs) and words of messages. Must stay: keys of
`AccuracyState.arrays`, which stand in ``checkpoint.npz`` and which `runner._before` checks; codes of findings, those of
`findings.CODES`. Runs fill ``reduced``, ``findings``, ``throw`` and ``twin_…`` of the solution, which `runner` and
`results` read. Must stay as well: `CLIMBS`, `reach_digits` and `run_within_drift`, which `simulation` imports. Tests:
``tests/dynamics/test_budget.py``, ``test_accuracy.py``.
"""

from __future__ import annotations

import contextlib
import functools
from dataclasses import dataclass, field

import numpy as np

from ..errors import EnergyDriftError
from ..findings import NOTE, Finding
from .budget import Spent

ATTEMPTS, MOST_ATTEMPTS, PAYS = 3, 8, 0.5
"""Number of runs after which the energy balance must close; a larger number that is used while the energy drift of each
run is at most a share of that of the run before; this share."""
CLIMBS = 8
"""Largest number of times that accuracy is raised for missing digits."""
STAYS = "higher accuracy changes it by as much: it is zero, or not determined, or a peak that needs a shorter interval"
STUCK = 1.5
"""Least factor by which an error must fall with half the step, or a tenth of rtol, which should quarter it."""


@dataclass
class AccuracyState:
    """State of the accuracy loop, which a checkpoint keeps.

    Attributes
    ----------
    first : float
        First value of the knob.
    knob : float
        Present value of the knob.
    repeated : int
        Number of repeated runs, whose energy balance did not close, since digits were checked.
    drift : float
        Energy drift at the end of the last of these [1], infinite if there is none.
    missing : dict of str to float
        ± over the ± that the digits allow, by result, at the last check.
    """

    first: float
    knob: float
    repeated: int = 0
    drift: float = np.inf
    missing: dict[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, first, kept=None):
        """The state at the beginning, or of a checkpoint."""
        if kept is None:
            return cls(first, first)
        missing = dict(zip(kept["missing"].tolist(), kept["shares"].tolist(), strict=True))
        return cls(first, float(kept["accuracy"]), int(kept["repeated"]), float(kept["drift"]), missing)

    def arrays(self):
        """Arrays for a checkpoint."""
        names, shares = np.array(list(self.missing), dtype=str), np.array(list(self.missing.values()))
        counted = {"accuracy": self.knob, "repeated": self.repeated, "drift": self.drift}
        return {**counted, "missing": names, "shares": shares}


def run_within_drift(simulation, folder, tell):
    """Run with errors; repeat a run whose energy balance does not close with a smaller knob, see `ATTEMPTS`.

    Parameters
    ----------
    simulation : refweb.dynamics.simulation.Simulation
        Simulation to run; its solution is filled in.
    folder : refweb.results.folder.Folder or None
        Folder for rows and frames.
    tell : callable
        Called with a text and the finished share.
    """
    scene, solution, standing = simulation.scene, simulation.solution, simulation.standing
    while True:
        name = simulation.integrator.knob
        text = "running" if standing.knob == standing.first else f"running with {name} = {standing.knob:g}"
        if (prepare := getattr(simulation.integrator, "prepare", None)) is not None:
            prepare()  # before a twin asks for the same
        simulation.budget.begin()
        with _twin_of(simulation) as twin:
            try:
                run = simulation.run(folder, functools.partial(_tell_phase, tell, text))
            except EnergyDriftError as error:
                pays = error.drift <= PAYS * standing.drift and standing.repeated < MOST_ATTEMPTS - 1
                if scene.solve.step_size is not None or standing.repeated >= ATTEMPTS - 1 and not pays:
                    raise
                standing.repeated, standing.drift = standing.repeated + 1, error.drift
                standing.knob *= simulation.integrator.retry
                message = f"{error}; repeated with {name} = {standing.knob:g}"
                solution.findings.append(Finding("repeated", message, "solve", NOTE))
                simulation.again(folder)
                continue
            ended = twin.ended(tell, run.course.stopped) if twin else None
        break
    if twin and isinstance(twin.failure, Spent):
        raise twin.failure
    simulation.budget.end(standing.knob, solution.solver["nsteps"])
    solution.reduced, standing.repeated, standing.drift, known = run.results, 0, np.inf, np.inf
    rows = simulation.compared(folder) if ended is not None or scene.throw is not None else None
    if ended is not None:
        from .twin_error import add_errors

        known = add_errors(simulation, run, ended, rows)
        named = {o.name: o for o in scene.observables}
        bounded = {name: named[name].bounded(result, simulation.system) for name, result in solution.reduced.items()}
        solution.reduced = bounded
        solution.twin_end, solution.twin_steps = (ended.course.x, ended.course.v), ended.course.nsteps
        if folder is not None:
            folder.keep_twin(solution.twin_end)
    elif twin:
        message = f"no errors are known: the step-refinement run failed: {twin.failure}"
        solution.findings.append(Finding("no-error", message, "accuracy"))
    if scene.throw is not None:
        solution.throw = _throw(simulation, run, ended, rows, known)


def _tell_phase(tell, phase, text, share):
    """Call ``tell`` with the name of a phase before a text."""
    tell(f"{phase}, {text}", share)


def _throw(simulation, run, ended, rows, known):
    """Results of a throw, with ± where the step refinement has ended, for events before a ``known`` time."""
    scene, watch = simulation.scene, simulation.watch
    state, twin, factor = watch.state(run.course), None, 0.0
    if ended is not None:
        from .twin_error import SPREAD

        twin = ended.rows, watch.state(ended.course)
        factor = SPREAD / (1.0 - simulation.integrator.error_share(run.course, ended.course))
    return scene.throw.results(scene.observables, rows, state, twin, factor, known)


def _twin_of(simulation):
    """Step refinement beside the run, if the scene asks for it."""
    if simulation.scene.accuracy.error == "none":
        return contextlib.nullcontext()
    from .twin_error import Twin

    return Twin(simulation)


def missing_digits(results, digits):
    """± over the ± that so many significant digits allow, of each result without these digits."""
    allowed = {name: 0.5 * 10.0**-digits * abs(result.value) for name, result in results.items()}
    shares = {n: np.inf if r.error is None else r.error / max(allowed[n], 5e-324) for n, r in results.items()}
    return {name: share for name, share in shares.items() if share > 1.0}


def reach_digits(simulation, digits, folder, tell):
    """Raise accuracy until every result has its digits or cannot get them; report results without them.

    It also ends with the budget, see `refweb.dynamics.budget`; then the last complete run counts.
    """
    solution, standing, budget = simulation.solution, simulation.standing, simulation.budget
    before = standing.missing
    for climb in range(CLIMBS):
        missing = missing_digits(solution.reduced, digits)
        falling = [share for name, share in missing.items() if before.get(name, np.inf) > STUCK * share]
        if not falling:
            break
        reached, price = standing.knob, budget.price_of(simulation.integrator, max(falling), CLIMBS - climb)
        knob = reached * simulation.integrator.next_knob(max(falling))
        if (expected := budget.expected(simulation.integrator, knob)) > budget.total - budget.spent:
            why = f"the next run would take some {expected:.2g} s"
            solution.findings.append(_over(simulation, digits, knob, why, price))
            break
        earlier, before, steps = before, missing, solution.solver["nsteps"]
        standing.missing, standing.knob = before, knob
        simulation.again(folder)
        try:
            run_within_drift(simulation, folder, tell)
        except Spent as spent:
            solution.findings.append(_over(simulation, digits, standing.knob, f"a run was ended: {spent}", price))
            before = standing.missing = earlier
            standing.knob, standing.repeated, standing.drift, budget.kept = reached, 0, np.inf, False
            simulation.again(folder)
            run_within_drift(simulation, folder, tell)
            break
        if solution.solver["nsteps"] < 1.1 * steps:  # something else limits them: nothing was changed
            before = standing.missing = {}
    setting = f"{simulation.integrator.knob} = {standing.knob:g}"
    for name, share in missing_digits(solution.reduced, digits).items():
        falls = before.get(name, np.inf) > STUCK * share
        why = "still higher accuracy would help, but is not tried" if falls else STAYS
        known = f"its ± is {share:.3g} times what they allow with {setting}; {why}"
        known = known if np.isfinite(share) else "its ± is not known"
        text = f"{name} does not have the {digits} digits asked for: {known}"
        solution.findings.append(Finding("digits-not-reached", text, "accuracy"))


def _over(simulation, digits, knob, why, price):
    """Finding that accuracy is raised no further, with the cost of doing so."""
    budget, name = simulation.budget, simulation.integrator.knob
    return Finding(
        "digits-not-reached",
        f"with {name} = {knob:.3g} {why}, more than what was left of the budget of {budget.total:.3g} s of CPU time: "
        f"digits = {digits} would take some {price:.2g} s more; raise [accuracy] budget, or ask for fewer digits",
        "accuracy",
    )
