"""One scene by every method that takes it, each from coarse to fine: what `refweb.studies.work_precision` compares.

A `Trial` is a method at one setting. Own solvers run with one probe, the observable, and without peaks, files or twin;
scipy's DOP853 is the voice from outside: its own steps, driven by the same forces.
"""

from __future__ import annotations

import contextlib
import math
import time
from dataclasses import dataclass, field, replace

import numpy as np

from ..errors import InputError, SolverError
from ..results.state import State

SAFETIES = (0.9, 0.5, 0.25, 0.125, 0.0625, 0.03125)
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
TIGHT = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
DYNAMIC = {
    "central-difference": ("safety", SAFETIES),
    "explicit-4": ("safety", (0.9, 0.6, 0.4, 0.25, 0.15)),
    "explicit-6": ("safety", (0.9, 0.6, 0.4, 0.25, 0.15)),
    "cvode-bdf": ("rtol", TOLERANCES),
    "cvode-adams": ("rtol", TIGHT),
    "ida": ("rtol", TOLERANCES),
    "dop853": ("rtol", TIGHT),
}
"""Methods of dynamics: the key that is varied, and its values from coarse to fine."""
STATIC = {
    "newton": ("tolerance", (1e-10,)),
    "relaxation": ("tolerance", (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)),
    "newton-smooth": ("smoothing", (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)),
}
"""Methods of statics. The last is Newton with the smooth law at other smoothings than the scene's own."""
KIND = {"explicit-4": "splitting", "explicit-6": "splitting", "central-difference": "splitting"}
KIND |= {"cvode-bdf": "bdf", "ida": "bdf"}
"""Methods whose errors may be alike: splittings by kicks and drifts, and BDF. Others are of a kind of their own."""
UNKNOWN = 12.0
"""CPU time of the coarsest implicit run over that of the longest explicit steps, until it has run."""
OUTSIDE, CALL = 4.0, 5e-5
"""Evaluations of the coarsest run of DOP853 over those of the longest explicit steps, and what each takes more [s]."""
PIECES = 100
"""Smallest number of pieces of an implicit run, after each of which the clock is looked at."""


class OverBudget(Exception):
    """A trial has taken more time than it may."""


@dataclass(eq=False)
class Trial:
    """A method at one setting, and what came of it.

    Attributes
    ----------
    method, key, value
        Method, and the key that is varied with its value.
    status : {"solved", "failed", "refused", "budget"}
        Whether it solved; failed on the way; could not take the scene; or was left out for its price.
    message : str
        Why, where it is not solved.
    cpu_s : float
        CPU time of the solver's loop [s], compiled before.
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
    cpu_s: float = np.nan
    values: np.ndarray | None = None
    x: np.ndarray | None = None
    work: dict = field(default_factory=lambda: dict(nfev=0, njev=0, nlu=0, nsteps=0))
    error_observable: float = np.nan
    error_state: float = np.nan

    @property
    def setting(self):
        """The setting as text."""
        return f"{self.key} = {self.value:g}"

    @property
    def kind(self):
        """What the method has in common with others."""
        return KIND.get(self.method, self.method)


def trials(scene):
    """The ladder of each method, a dict of lists of `Trial`."""
    ladders = DYNAMIC if scene.solve.kind == "dynamic" else STATIC
    found = {name: [Trial(name, key, value) for value in values] for name, (key, values) in ladders.items()}
    if scene.solve.kind == "static":
        cable = scene.cable
        if cable.law == "linear" or any(group.smoothing is not None for group in cable.groups.values()):
            del found["newton-smooth"]
        elif cable.law == "smooth":
            found["newton-smooth"] = [t for t in found["newton-smooth"] if t.value != cable.smoothing]
    return found


class Dynamics:
    """Runs the trials of a dynamic scene.

    Parameters
    ----------
    scene : refweb.Scene
        What moves, and for how long.
    system : refweb.system.system.System
        What acts.
    observable : refweb.Observe
        What is compared at the history rows.
    """

    def __init__(self, scene, system, observable):
        from ..dynamics.simulation import row_times

        self.system, self.observable, self.times = system, observable, row_times(scene)
        self.probes = [observable.probe(system)._replace(sign=0.0)]
        self._price, self.begin = 0.0, (None, None)
        self._linear = system.rows - system.net.spins  # the others are angles
        if scene.start_folder is not None:
            from ..dynamics.initial_state import stored

            self.begin = stored(system, scene.start_folder)
        elif scene.solve.start == "equilibrium":
            from ..dynamics.initial_state import equilibrium

            self.begin = equilibrium(system).x, None

    def _solver(self, trial):
        """A solver of refweb's at the setting of a trial."""
        name, _, detail = trial.method.partition("-")
        setting = {trial.key: trial.value}
        if name == "explicit":
            from ..dynamics.integrators.splitting import Splitting

            return Splitting(self.system, self.probes, order=int(detail), **setting)
        if name == "cvode":
            from ..dynamics.integrators.cvode import Cvode

            return Cvode(self.system, self.probes, family=detail, **setting)
        if name == "ida":
            from ..dynamics.integrators.ida import Ida

            return Ida(self.system, self.probes, **setting)
        from ..dynamics.integrators.central_difference import CentralDifference

        return CentralDifference(self.system, self.probes, **setting)

    def compile(self, trial):
        """Take a step with the solver of a trial; raises an `InputError` where it does not take the scene."""
        if trial.method == "dop853":
            self._refuse(trial.method)
            return
        solver = self._solver(trial)
        with contextlib.suppress(SolverError):  # energies of a first moment may be too small for their book
            solver.advance(solver.start(*self.begin), [1e-9 * self.times[-1]])

    def expected(self, trial):
        """Estimate of the CPU time of a trial before any of its method has run [s].

        That of explicit steps, by the last of them that have run; of implicit ones, whose number nobody knows before, a
        guess that gives them their turn.
        """
        from ..dynamics.method_choice import step_price

        one = step_price(self.system)
        if trial.key == "safety":
            solver = self._solver(trial)
            self._price = self._price or one * self.times[-1] / solver.bound()
            return self._price * _stages(solver) / trial.value
        longest = self._price / SAFETIES[0]
        return OUTSIDE * longest * (1.0 + CALL / one) if trial.method == "dop853" else UNKNOWN * longest

    def _refuse(self, method):
        """Refuse for DOP853 what has no mass, or lengths that are held."""
        from ..dynamics.integrators.step_observer import refuse_massless

        refuse_massless(self.system, method)
        if self.system.constraints:
            raise InputError(f'[[link]] needs method = "ida": {method} does not hold lengths')

    def run(self, trial, deadline):
        """Run a trial; raises what its method raises, and `OverBudget` at the ``deadline`` of the clock."""
        if trial.method == "dop853":
            self._outside(trial, deadline)
            return
        from ..dynamics.simulation import blocks

        solver, times, split = self._solver(trial), self.times, 1
        if trial.key == "rtol":  # steps are the solver's own and may be looked into; explicit ones follow from the rows
            split = -(-PIECES // (len(times) - 1))
            times = np.interp(np.arange(split * (len(times) - 1) + 1) / split, np.arange(len(times)), times)
        run, table = solver.start(*self.begin), []
        began = time.process_time()
        for _, history in blocks(solver, run, times, [len(times) - 1]):
            table.append(history.probes[:, 0])
            _check(deadline)
        trial.cpu_s = time.process_time() - began
        if trial.key == "safety":
            self._price = trial.cpu_s * trial.value / _stages(solver)
        trial.values, trial.x = np.concatenate(table)[::split], run.x[: self._linear].copy()
        trial.work = {**{key: solver.spent(run)[key] for key in ("nfev", "njev", "nlu")}, "nsteps": run.nsteps}

    def _outside(self, trial, deadline):
        """Run scipy's DOP853 with the forces of the system."""
        from scipy.integrate import DOP853

        from ..dynamics.integrators.step_limits import TRAVEL
        from ..dynamics.integrators.tolerances import scales

        system, free, n = self.system, self.system.free, len(self.system.free)
        x = np.zeros((system.rows, 3)) if self.begin[0] is None else self.begin[0].copy()
        v = system.initial_velocity() if self.begin[1] is None else self.begin[1].copy()
        v[system.supported] = 0.0
        system.drive(0.0, x, v)
        mass, held = np.repeat(system.net.mass, 3)[free], np.where(system.supported, x, 0.0)
        consistent = system.net.consistent_minus_lumped is not None
        over_mass = system.mass.factor.solve if consistent else lambda f: f / mass

        def rows(t, y):
            x, v = held.copy(), np.zeros((system.rows, 3))
            x.ravel()[free], v.ravel()[free] = y[:n], y[n:]
            system.drive(t, x, v)
            return x, v

        def rate(t, y):
            return np.concatenate([y[n:], over_mass(system.force(t, *rows(t, y)).ravel()[free])])

        near, fast = scales(system)
        y, end, rtol = np.concatenate([x.ravel()[free], v.ravel()[free]]), self.times[-1], trial.value
        breaks = [t for part in (*system.families, *system.drives, *system.line_drives) for t in part.times]
        thickness = min((body.thickness for body in system.net.bodies), default=np.inf)
        values, row, steps, spent = np.empty(len(self.times)), 0, 0, -time.process_time()
        solver = DOP853(rate, 0.0, y, end, rtol=rtol, atol=rtol * np.repeat([near, fast], n))
        while row < len(values):
            ahead = min((t for t in breaks if t > solver.t * (1.0 + 1e-12)), default=end)
            speed = 2.0 * np.abs(solver.y[n:]).max(initial=0.0)
            travel = TRAVEL * thickness / speed if speed > 0.0 else np.inf
            solver.max_step = max(min(ahead - solver.t, travel), 1e-12 * end)
            if steps or row:
                message = solver.step()
                steps += 1
                if solver.status == "failed":
                    raise SolverError(f"dop853 stopped at t = {solver.t:.6g} s: {message}")
            inside = None
            while row < len(values) and self.times[row] <= solver.t:
                if row:
                    inside = inside or solver.dense_output()
                    y = inside(self.times[row])
                spent += time.process_time()
                trial_x, trial_v = rows(self.times[row], y)
                values[row] = self.observable.value(State(system, self.times[row], trial_x, trial_v)).value
                spent -= time.process_time()
                row += 1
            if consistent and steps and ahead < end and solver.t > ahead * (1.0 - 1e-12):  # a corner of a motion
                sides = (rows(t, solver.y)[1] for t in (ahead * (1.0 + 1e-12), 0.5 * (solver.t_old + ahead)))
                jump = np.where(system.supported, np.subtract(*sides), 0.0)
                solver.y[n:] += system.mass.kick(jump).ravel()[free]
                solver.f = rate(solver.t, solver.y)
            _check(deadline)
        trial.cpu_s, trial.values, trial.x = spent + time.process_time(), values, trial_x[: self._linear]
        trial.work = {"nfev": solver.nfev, "njev": 0, "nlu": 0, "nsteps": steps}


class Statics:
    """Runs the trials of a static scene; see `Dynamics`."""

    def __init__(self, scene, system, observable):
        self.scene, self.system, self.observable = scene, system, observable

    def expected(self, trial):
        """Nothing is known before a run."""
        return 0.0

    def compile(self, trial):
        """Solve the first load step, with the kernels of the method."""
        with contextlib.suppress(SolverError):
            self._solved(trial, self.scene.solve.load_steps[:1], math.inf)

    def run(self, trial, deadline):
        """Run a trial; raises what its method raises, and `OverBudget` at the ``deadline`` of the clock."""
        states, stats = self._solved(trial, self.scene.solve.load_steps, deadline)
        trial.values, trial.x = np.array([self.observable.value(state).value for state in states]), states[-1].x
        trial.work = {key: sum(spent[key] for spent in stats) for key in trial.work}

    def _system(self, trial):
        """The scene's system, or that of another smoothing."""
        if trial.key != "smoothing":
            return self.system
        return self.scene.replace(cable=replace(self.scene.cable, law="smooth", smoothing=trial.value)).build()

    def _solved(self, trial, steps, deadline):
        """States of a trial, and what each took; notes the CPU time."""
        system, options = self._system(trial), {}
        if trial.method == "relaxation":
            from ..statics.dynamic_relaxation import solve

            options = {"tolerance": trial.value}
        else:
            from ..statics.load_steps import solve
        began, found = time.process_time(), []
        for equilibrium in solve(system, steps, lambda text: _check(deadline), **options):
            found.append(equilibrium)
            _check(deadline)
        trial.cpu_s = time.process_time() - began
        return [State(system, one.step, one.x) for one in found], [one.stats for one in found]


def _stages(solver):
    """Evaluations of forces of explicit steps in the time in which central differences at the bound take one."""
    return len(solver.drifts) / solver.stretch


def _check(deadline):
    if time.perf_counter() > deadline:
        raise OverBudget
