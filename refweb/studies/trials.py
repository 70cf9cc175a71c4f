"""Trials of one scene by every method, each from coarse to fine, for `refweb.studies.work_precision`.

A `Trial` is a method at one setting. The methods of dynamics are those of `refweb.registry.INTEGRATORS`, in all their
`refweb.dynamics.integrators.integrator.Variant` s, and scipy's DOP853. They run with one probe, the observable, and
without peaks, files or step refinement.

May change: private functions, `SETTINGS`, from coarse to fine, and `PIECES`; `UNKNOWN`, `OUTSIDE` and `CALL`, which
only guess times. Must stay: fields of `Trial` and keys of ``work``, which are columns of ``cost.csv``; `OverBudget`,
which `budget` catches, and `clock`, its measure; labels of methods, those in `STATIC_LADDERS` among them; `trials_of`,
`Dynamics` and `Statics`, which `work_precision` imports. Tests: ``tests/studies/test_cost.py``.
"""

from __future__ import annotations

import contextlib
import functools
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ..dynamics.initial_state import start_of
from ..dynamics.integrators.integrator import Variant
from ..dynamics.method_choice import step_price
from ..dynamics.schedule import Schedule, blocks, row_times
from ..errors import SolverError
from ..registry import INTEGRATORS, STATICS, load
from ..results.state import State
from . import dop853

clock = time.process_time
"""Clock of trials and of the budget [s]. It measures CPU time, so that results do not depend on the load of the
machine."""
SETTINGS = {
    "safety": (0.9, 0.5, 0.25, 0.125, 0.0625, 0.03125),
    "rtol": (1e-3, 1e-4, 1e-5, 1e-6, 1e-7),
}
"""Values of accuracy parameters from coarse to fine, for methods that do not name their own."""
UNKNOWN = 12.0
"""Expected CPU time of the coarsest implicit run, over that of the longest explicit steps."""
OUTSIDE, CALL = 4.0, 5e-5
"""Evaluations of the coarsest run of DOP853 over those of the longest explicit steps, and additional time of each
[s]."""
PIECES = 100
"""Smallest number of parts of an implicit run; the clock is read after each."""


class OverBudget(Exception):
    """A trial has taken more time than it may."""


@dataclass(eq=False)
class Trial:
    """A method at one setting, and its outcome.

    Attributes
    ----------
    method, key, value
        Method, and the key that is varied with its value.
    status : {"solved", "failed", "refused", "budget"}
        "failed": the run ended with an error. "refused": the method does not take the scene. "budget": the run was left
        out or ended for its cost.
    message : str
        Reason if the trial is not solved.
    kind : str
        Name that methods share if their errors may be alike.
    make : callable, optional
        In dynamics, function of a system, probes and the varied key that returns the integrator. In statics, function
        of the trial, a system, load steps and a callable for lines of text that yields the equilibria.
    cpu_s : float
        CPU time of the solver's loop [s], without compiling.
    values : ndarray, shape (rows,)
        The observable at the history rows, or load steps.
    x : ndarray, shape (rows of the system, 3)
        Displacement at the end [m].
    nfev, njev, nlu, nsteps : int
        Evaluations of forces and of tangents, factorizations, steps.
    """

    method: str
    key: str
    value: float
    status: str = "budget"
    message: str = ""
    kind: str = ""
    make: Callable[..., Any] | None = None
    cpu_s: float = np.nan
    values: np.ndarray | None = None
    x: np.ndarray | None = None
    work: dict[str, Any] = field(default_factory=lambda: dict(nfev=0, njev=0, nlu=0, nsteps=0))
    error_observable: float = np.nan
    error_state: float = np.nan

    @property
    def setting(self):
        """The setting as text."""
        return f"{self.key} = {self.value:g}"


class Ladder(NamedTuple):
    """A method with the settings at which it is tried.

    Attributes
    ----------
    key : str
        The key that is varied.
    settings : tuple of float
        Its values from coarse to fine.
    kind : str
        Name that methods share if their errors may be alike.
    make : callable, optional
        See `Trial`.
    """

    key: str
    settings: tuple[Any, ...]
    kind: str
    make: Callable[..., Any] | None = None


def _by_newton(trial, system, steps, tell):
    return load(STATICS["newton"])(system, steps, tell)


def _by_relaxation(trial, system, steps, tell):
    return load(STATICS["relaxation"])(system, steps, tell, tolerance=trial.value)


STATIC_LADDERS = {
    "newton": Ladder("tolerance", (1e-10,), "newton", _by_newton),
    "relaxation": Ladder("tolerance", (1e-2, 1e-4, 1e-6, 1e-8, 1e-10), "relaxation", _by_relaxation),
    "newton-smooth": Ladder("smoothing", (1e-3, 1e-4, 1e-5, 1e-6, 1e-7), "newton-smooth", _by_newton),
}
"""The `Ladder` of each method of statics by name. The last is Newton with the smooth law at other smoothings than the
scene's own."""


def _variants(name):
    """The `Variant` s of a method by name; one with the name of the method if it lists none."""
    return getattr(load(INTEGRATORS[name].integrator), "variants", {name: Variant()})


def dynamic_ladders():
    """The `Ladder` of each method of dynamics by name: variants of `INTEGRATORS`, and DOP853."""
    ladders = {}
    for name, method in INTEGRATORS.items():
        for label, variant in _variants(name).items():
            make = functools.partial(load(method.integrator), **variant.keys)
            settings = variant.settings or SETTINGS[method.knob]
            ladders[label] = Ladder(method.knob, settings, variant.kind or label, make)
    return ladders | {dop853.NAME: Ladder("rtol", dop853.TOLERANCES, dop853.NAME)}


def label_of(solve):
    """Name of the method of a `refweb.Dynamic` among the trials."""
    for label, variant in _variants(solve.method).items():
        if all(getattr(solve, key) == value for key, value in variant.keys.items()):
            return label
    return solve.method


def trials_of(scene):
    """The trials of each method from coarse to fine, a dict of lists of `Trial` by name."""
    ladders = dynamic_ladders() if scene.solve.kind == "dynamic" else STATIC_LADDERS
    trials = {
        name: [Trial(name, ladder.key, value, kind=ladder.kind, make=ladder.make) for value in ladder.settings]
        for name, ladder in ladders.items()
    }
    if scene.solve.kind == "static":
        cable = scene.cable
        differs = [group.smoothing is not None or group.law is not None for group in cable.groups.values()]
        if cable.law not in ("smooth", "tension-only") or any(differs):
            del trials["newton-smooth"]
        elif cable.law == "smooth":
            trials["newton-smooth"] = [t for t in trials["newton-smooth"] if t.value != cable.smoothing]
    return trials


class Dynamics:
    """Runs the trials of a dynamic scene.

    Parameters
    ----------
    scene : refweb.Scene
        Scene of the trials, with its duration.
    system : refweb.system.system.System
        The system.
    observable : refweb.Observe
        Observable that is compared at the history rows.
    """

    def __init__(self, scene, system, observable):
        self.begin = start_of(scene, system)
        self.system, self.observable, self.times = self.begin.torn(system), observable, row_times(scene)
        self.probes = [observable.probe(system)._replace(sign=0.0)]
        self._linear = system.rows - system.net.spins  # the others are angles
        self._per_evaluation = self._fewest = None  # of forces by explicit steps: CPU time [s], and least number
        self._ahead = {}  # evaluations of each trial

    def compile(self, trial):
        """Take a step with the integrator of a trial; raise an `InputError` if it does not take the scene."""
        if trial.make is None:
            dop853.Dop853(self.system, self.begin)
            return
        integrator = self._integrator(trial)
        with contextlib.suppress(SolverError):  # energies of a first moment may be too small for their book
            integrator.advance(integrator.start(*self.begin.motion), [1e-9 * self.times[-1]])

    def _integrator(self, trial):
        make = functools.partial(trial.make, **{trial.key: trial.value})
        if self.system.weakness is None:
            return make(self.system, self.probes)
        from ..dynamics.integrators.rupture import with_breaks

        return with_breaks(make, self.system, self.probes)

    def expected(self, trial):
        """Expected CPU time of the first trial of a method [s].

        The time of explicit steps follows from the last explicit run. The number of implicit steps is not known before
        a run; their time is a guess that gives them a turn.
        """
        price = self._per_evaluation or step_price(self.system)
        if ahead := self._evaluations(trial):
            self._fewest = min(ahead, self._fewest or ahead)
            return price * ahead
        longest = price * (self._fewest or 0.0)
        return OUTSIDE * longest * (1.0 + CALL / price) if trial.make is None else UNKNOWN * longest

    def _evaluations(self, trial):
        """Number of evaluations of forces of a trial; None if only a run can tell."""
        if trial not in self._ahead:
            integrator = None if trial.make is None else self._integrator(trial)
            known = getattr(integrator, "evaluations", None)
            self._ahead[trial] = None if known is None else known(self.times[-1])
        return self._ahead[trial]

    def run(self, trial, deadline):
        """Run a trial; raise the errors of its method, and `OverBudget` at the ``deadline`` of the `clock`."""
        if trial.make is None:
            self._run_outside(trial, deadline)
            return
        integrator, times, split, ahead = self._integrator(trial), self.times, 1, self._evaluations(trial)
        if ahead is None:  # steps are its own and may be looked into; explicit ones follow from the rows
            split = -(-PIECES // (len(times) - 1))
            times = np.interp(np.arange(split * (len(times) - 1) + 1) / split, np.arange(len(times)), times)
        course, values = integrator.start(*self.begin.motion), []
        began = clock()
        for block in blocks(integrator, course, Schedule(times, np.array([len(times) - 1]))):
            values.append(block.history.probes[:, 0])
            _check(deadline)
        trial.cpu_s = clock() - began
        if ahead is not None:
            self._per_evaluation = trial.cpu_s / ahead
        trial.values, trial.x = np.concatenate(values)[::split], course.x[: self._linear].copy()
        spent = integrator.spent(course)
        trial.work = {**{key: spent[key] for key in ("nfev", "njev", "nlu")}, "nsteps": course.nsteps}

    def _run_outside(self, trial, deadline):
        """Run DOP853."""
        outside, began = dop853.Dop853(self.system, self.begin), clock()
        values = outside.follow(self.times, trial.value, self.observable, clock, lambda: _check(deadline))
        trial.cpu_s, trial.values, trial.x = clock() - began - values.looking, values.values, values.x[: self._linear]
        trial.work = {"nfev": values.nfev, "njev": 0, "nlu": 0, "nsteps": values.nsteps}


class Statics:
    """Runs the trials of a static scene; see `Dynamics`."""

    def __init__(self, scene, system, observable):
        self.scene, self.system, self.observable = scene, system, observable

    def expected(self, trial):
        """Expected CPU time of a trial [s]: 0, since nothing is known before a run."""
        return 0.0

    def compile(self, trial):
        """Solve the first load step, with the kernels of the method."""
        with contextlib.suppress(SolverError):
            self._solved(trial, self.scene.solve.load_steps[:1], math.inf)

    def run(self, trial, deadline):
        """Run a trial; raise the errors of its method, and `OverBudget` at the ``deadline`` of the clock."""
        states, stats = self._solved(trial, self.scene.solve.load_steps, deadline)
        trial.values, trial.x = np.array([self.observable.value(state).value for state in states]), states[-1].x
        trial.work = {key: sum(spent[key] for spent in stats) for key in trial.work}

    def _system(self, trial):
        """The scene's system, or its system with another smoothing."""
        if trial.key != "smoothing":
            return self.system
        return self.scene.replace(cable=replace(self.scene.cable, law="smooth", smoothing=trial.value)).build()

    def _solved(self, trial, steps, deadline):
        """States of a trial, and the statistics of each; record the CPU time."""
        system, began, states = self._system(trial), clock(), []
        for equilibrium in trial.make(trial, system, steps, lambda text: _check(deadline)):
            states.append(equilibrium)
            _check(deadline)
        trial.cpu_s = clock() - began
        made = [State(state.system_of(system), state.step, state.x) for state in states]
        return made, [state.stats for state in states]


def _check(deadline):
    if clock() > deadline:
        raise OverBudget
