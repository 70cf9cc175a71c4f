"""A run that is taken ahead step by step, for feedback: it is asked for results, and values of effects are set.

The loop, its records and tables are those of `refweb.run`, and are kept between calls.

May change: private methods. Must stay: public names of `SteppedRun` and `start`, which users and `gym.environment`
call; a run to which nothing is set has the bits of `refweb.run`. `refweb.dynamics.commands` has what may be set. Tests:
``tests/dynamics/test_stepped_run.py``, ``tests/gym/test_environment.py``.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..errors import InputError, SolverError
from ..messages import nearest, quote
from ..registry import load
from ..results.provenance import versions, web_of
from ..results.solution import as_history
from ..scene import Scene
from .commands import NEAR, Command, Inputs, only_numbers_differ, row_at, widened
from .schedule import Schedule, block_of, times_of
from .simulation import Simulation

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

    from ..results.state import State
    from ..solution import Solution


class SteppedRun:
    """A dynamic run that goes ahead by calls, between which its loads and rates may be set.

    Parameters
    ----------
    scene : Scene, path-like or str
        A dynamic scene, a scene file or the name of a scene shipped with refweb.

    Attributes
    ----------
    scene : refweb.Scene
        The scene.
    commands : list of (float, str, object)
        Time [s], path and value of all that has been set.

    Raises
    ------
    InputError
        For wrong input, a scene of statics, and one with ``[rupture]``.
    SolverError
        Where the equilibrium that the scene starts from is not found.

    See Also
    --------
    refweb.start : makes one.
    """

    def __init__(self, scene: Scene | str | PathLike[str]) -> None:
        scene = scene if isinstance(scene, Scene) else Scene.load(scene)
        if scene.solve.kind == "static":
            raise InputError('start needs [solve] kind = "dynamic": statics has load steps')
        self.scene: Scene = scene
        self.commands: list[Command] = []
        self._make(None)
        self._set_off()

    def _set_off(self):
        """Go to the first row, at t = 0."""
        self._pending, self._tables, self._row, self._end = [], [], 0, None
        self._course = self._simulation.integrator.start(*self._simulation.begin.motion)
        self._go_to_row(1)

    def restart(self, scene: Scene | None = None) -> None:
        """Begin again at t = 0 with the values of the scene, and without commands; it costs less than a new run.

        Parameters
        ----------
        scene : Scene, optional
            Another scene. Where it differs from that of the run in initial velocities, and in values that `set` may
            change other than rates and torques, alone, the system is used again.

        Raises
        ------
        InputError, SolverError
            As `SteppedRun`.
        """
        changes = [] if scene is None else only_numbers_differ(self.scene, scene)
        if scene is not None and changes is None:
            self.__dict__.update(type(self)(scene).__dict__)
            return
        self.scene, self.commands = scene or self.scene, []
        self._inputs.take_on(changes or [])
        self._schedule.reset()
        self._simulation.scene = self._simulation.scene.replace(effects=widened(self.scene).effects)
        self._simulation.again(None)
        self._set_off()

    def _make(self, begin):
        """Make the simulation, at the start of another one or at its own."""
        settled, system = widened(self.scene).settle()
        solution = load("refweb.solution:Solution")(settled, web=web_of(system), versions=versions())
        self._simulation = Simulation(settled, system, solution)
        if begin is None:
            self._simulation.settle(lambda text, share: None)
        else:
            self._simulation.begin = begin
        commands = self._schedule.commands
        self._inputs = Inputs(system) if commands is None else commands.inputs
        prepare = getattr(self._simulation.integrator, "prepare", None)
        if prepare is not None:
            prepare()

    def _go_to_row(self, stop):
        """Advance to the row before ``stop``."""
        simulation, commands = self._simulation, self._schedule.commands
        while self._row < stop and not self._course.stopped:
            end = stop if commands is None else min(stop, commands.until(self._row) + 1)
            times = times_of(self._schedule, self.time, self._row, end)
            compared = simulation.integrator.advance(self._course, times)
            block = block_of(self._schedule, self._row, end, compared)
            table = simulation.watch.table(block.history)
            simulation.inspect(self._course)
            self._tables.append(table)
            self._row += len(table)
            if commands is not None:
                commands.act(self._row - 1, simulation.integrator, self._course, block.history)

    @property
    def _schedule(self) -> Schedule:
        return self._simulation.schedule

    @property
    def time(self) -> float:
        """Time that the run has reached [s]."""
        return float(self._course.time)

    @property
    def stopped(self) -> bool:
        """True at the end of the duration, and where an event or `end` has ended the run."""
        return self._end is not None or self._course.stopped or self._row == len(self._schedule.times)

    @property
    def drift(self) -> float:
        """Energy drift until now over the largest energy, see `refweb.dynamics.integrators.energy_balance`."""
        return float(self._course.drift)

    @property
    def steps(self) -> int:
        """Number of steps until now."""
        return int(self._course.nsteps)

    @property
    def event(self) -> str | None:
        """Name of the event that has ended the run; None where none has."""
        times = self._course.events["time"] if self._course.stopped else ()
        named = zip(self.scene.event, times, strict=False)
        return next((event.name for event, time in named if event.stop and np.isfinite(time)), None)

    @property
    def state(self) -> State:
        """The present `refweb.results.state.State`; it shares its arrays with the run, and holds until it goes on."""
        return self._simulation.watch.state(self._course)

    @property
    def history(self) -> dict[str, NDArray[np.float64]]:
        """Columns of ``history.csv`` until now by name, arrays of shape (rows,)."""
        return as_history(self._simulation.columns, np.concatenate(self._tables))

    @property
    def observed(self) -> dict[str, float]:
        """The present values of all observables of the scene by name."""
        names = (o.name for o in self._simulation.watch.observables)
        return dict(zip(names, self._tables[-1][-1, 1:].tolist(), strict=False))

    def observe(self, name: str) -> float:
        """The present value of an observable of the scene.

        Parameters
        ----------
        name : str
            Name of an ``[[observe]]``.

        Raises
        ------
        InputError
            For a name that the scene does not have.
        """
        observed = self.observed
        if name not in observed:
            raise InputError(f"{quote(name)} is not an observable of the scene, {nearest(name, observed)}")
        return observed[name]

    def set(self, path: str, value: Any) -> None:
        """Set a value from now on; it takes effect when the run goes ahead.

        Parameters
        ----------
        path : str
            ``load.N.force`` [N], ``thrust.N.force`` [N], ``pressure.N.value`` [Pa], ``gravity.acceleration`` [m/s²],
            ``body.NAME.axle.torque`` [N m], of a winch ``winch.N.speed`` [m/s], ``limit`` [N], ``tension`` [N] or
            ``power`` [W], whichever the scene gives; or a rate, ``reel.N.rate`` [1/s] of the factor,
            ``motion.N.velocity`` [m/s], ``motion.N.angular_velocity`` [rad/s] of a body on an axle. N counts from 0.
        value : float or sequence of 3 float
            The value; a rate continues the present value of the table, and a tension below 0 counts as 0.

        Raises
        ------
        InputError
            For what cannot be set, and for a run that has ended.
        """
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if not isinstance(path, str):
            raise InputError(f"path = {path!r} must be a text, such as load.0.force")
        self._refuse_ended()
        if (commands := self._schedule.commands) is not None:
            commands.refuse_controlled(path)
        command = Command(self.time, path, value)
        self._pending += self._inputs.checked(command)
        self.commands.append(command)

    def advance(self, dt: float | None = None, budget: float | None = None) -> float:
        """Go ahead by a time, to a history row.

        Parameters
        ----------
        dt : float, optional
            Time [s], a multiple of ``[output] interval``; by default the time to the next row. Where the duration ends
            before, the run goes to its end.
        budget : float, optional
            CPU time that it may take [s], by default any; explicit methods look at it each ten million steps of an
            element, others each hundred steps.

        Returns
        -------
        float
            Time reached [s].

        Raises
        ------
        InputError
            For a time that does not end at a row, and for a run that has ended.
        SolverError
            As `refweb.run`, and for a time that takes more than the budget: the run has to be ended then.
        """
        times = self._schedule.times
        self._refuse_ended()
        if dt is None:
            stop = self._row + 1
        else:
            if not dt > 0.0:
                raise InputError(f"dt = {dt!r} must be > 0 [s]")
            end = self.time + dt
            past = end > times[-1] * (1.0 - NEAR)
            stop = len(times) if past else row_at(times, end) + 1
        self._apply_pending()
        if budget is None:
            self._go_to_row(stop)
        else:
            self._go_in_time(stop, budget)
        return self.time

    def _refuse_ended(self):
        """Refuse a run that has ended; `InputError`."""
        if self.stopped:
            raise InputError(f"the run has ended at t = {self.time:.6g} s: start it again, or give a longer duration")

    def _go_in_time(self, stop, budget):
        """Advance to the row before ``stop`` within a CPU time [s]."""
        integrator, began, since = self._simulation.integrator, time.process_time(), self.time

        def check(t):
            if time.process_time() - began > budget:
                raise SolverError(
                    f"the time from t = {since:.6g} s on takes more than budget = {budget:g} s of CPU time, in which "
                    f'it came to t = {t:.6g} s; use method = "central-difference", a larger rtol or a softer contact'
                )

        integrator.on_progress = check
        try:
            self._go_to_row(stop)
        finally:
            del integrator.on_progress

    def _apply_pending(self):
        """Give the run what has been set."""
        if self._pending:
            self._inputs.apply(self._pending, self._simulation.integrator, self._course)
            self._pending = []

    def end(self) -> None:
        """End the run at its last row: it goes on no more, and `finish` gives the results until there."""
        if not self.stopped:
            self._end = float(self._tables[-1][-1, 0])

    def finish(self, out: str | PathLike[str] | None = None, force: bool = False, progress: bool = False) -> Solution:
        """Go on to the end, with the values that are set, and return all that `refweb.run` returns.

        The end is that of the duration, of an event, or of `end`, whose time is the duration of the scene then.

        The run is repeated from its start with the same commands, bit for bit, for the extremes, the errors by a
        step-refinement run with the same commands, and the files.

        Parameters
        ----------
        out, force, progress
            See `refweb.run`.

        Returns
        -------
        Solution

        Raises
        ------
        InputError, SolverError
            See `refweb.run`; `InputError` also for a run that `end` has ended at t = 0.
        """
        scene, end = self.scene, self._end
        if end is not None:
            if not end > 0.0:
                raise InputError("the run has ended at t = 0 s, its first row: there are no results")
            interval = self._simulation.scene.output.interval
            scene = scene.replace(
                solve=replace(scene.solve, duration=end), output=replace(scene.output, interval=interval), gym=None
            )
        return load("refweb.runner:run")(scene, out, force, progress, commands=self.commands)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """A run of its own from the present state; CVODE and IDA begin anew there, within their tolerance."""
        self._apply_pending()
        copy = object.__new__(type(self))
        copy.scene, copy.commands = self.scene, list(self.commands)
        copy._make(self._simulation.begin)
        arrays = self._simulation.integrator.save(self._course)
        if (commands := self._schedule.commands) is None:
            copy._inputs.restore(self._inputs.present)
        elif (copied := copy._schedule.commands) is not None:
            copied.load(commands.save())
        copy._course = copy._simulation.integrator.load({name: np.array(value) for name, value in arrays.items()})
        copy._tables, copy._row, copy._pending, copy._end = list(self._tables), self._row, [], self._end
        return copy


def start(scene: Scene | str | PathLike[str]) -> SteppedRun:
    """Start a dynamic run that is taken ahead step by step, for feedback control.

    Parameters
    ----------
    scene : Scene, path-like or str
        A dynamic scene, a scene file or the name of a scene shipped with refweb. Its ``[output] interval`` is the
        shortest time between two commands.

    Returns
    -------
    SteppedRun
        At t = 0.

    Raises
    ------
    InputError, SolverError
        See `SteppedRun`.

    Examples
    --------
    >>> run = refweb.start("scene.toml")
    >>> while not run.stopped:
    ...     run.set("load.0.force", [0.0, 0.0, -50.0 * run.observe("height")])
    ...     run.advance(0.02)
    >>> solution = run.finish()
    """
    return SteppedRun(scene)
