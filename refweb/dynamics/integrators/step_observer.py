"""Base of methods that choose their steps: rows, balances of energy and momentum, extremes and events around them.

A method takes steps of its own choice and knows its state anywhere within the last one. Each step, cut at the history
rows, is looked at in its middle and at its end: for extremes and events, and for the integrals of power and of the
supports' forces by Simpson's rule. A flag of success is not believed: the book of energies is checked at every row.

May change: `PATIENCE`, `BREATH`, `HALVINGS`, `HALVINGS_BY_PATH`, private methods. `TWIN_TOLERANCES` sets the tolerances
of the step-refinement run: its cost and ± follow. Must stay: public names and arguments, since plug-ins derive from
`StepObserver`; fields of `ObservedState` and the order of ``stats``, which checkpoints keep; a row as in
`integrator.History`. Simpson's weights stand in `simpson_balance`. Must stay as well: `Stopped`, which `ida` and
`sundials` import. Tests: ``tests/how_to/test_integrator.py``, ``tests/dynamics/integrators/test_step_observer.py``,
``test_cvode.py``.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np

from ...effects.base import refuse_flows
from ...errors import InputError, IntegrationError
from ...kernels import kernel
from ...system.mass import refuse_massless
from .energy_balance import DRIFT, refuse_open
from .events import event_rows, search
from .integrator import MAX_STEPS_PER_ROW, History, Integrator, IntegratorState
from .measurements import Measurements
from .momentum_balance import allowed, refuse_open_momentum
from .simpson_balance import UNEVEN, Sample, SimpsonBalance, refuse_endless
from .step_limits import StepLimits
from .tolerances import scales

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from ...results.probes import Probe
    from ...system.system import System
    from .integrator import Sum
    from .passages import Passages

PATIENCE = 1000
"""Number of steps in turn of which a row would take more than `MAX_STEPS_PER_ROW`; at a start they are short."""
BREATH = 100
"""Number of steps between two calls of ``on_progress``, which may end the run."""
HALVINGS, HALVINGS_BY_PATH = 8, 14
"""Number of times that a piece of a step is halved where powers change too much in it, and where lines yield while
their natural lengths change: the energy that they lose depends on the path."""
TWIN_TOLERANCES = 10.0
"""Tolerances of a run over those of its twin: by less, both may take the same steps, which are changed by factors of
up to 2. By 5, runs with a twin by BDF cost 15 % less, and of 1059 results of random impacts, oscillators and nets one
is off by 1.3 times ±; by 4, of 36 results by IDA with rtol = 1e-6 three are, by up to 5.5 times. By 10 none is."""


@kernel(leaf=True)
def fill_free(x, v, free, all_x, all_v):
    """Put displacements and velocities of the unknowns to their places; numpy takes three times as long for them."""
    for n in range(free.size):
        all_x[free[n]], all_v[free[n]] = x[n], v[n]


class Stopped(Exception):
    """A method finds no further step; what it says is the reason."""


@dataclass(eq=False, kw_only=True)
class ObservedState(IntegratorState):
    """State of a run at the time that has been looked at; the method's last step may end later.

    Attributes
    ----------
    reached : float
        End of the method's last step [s].
    short : int
        Number of steps in turn that are too short to come to the next row.
    sample : refweb.dynamics.integrators.simpson_balance.Sample
        The system at ``time``.
    least_energy : float
        Energy that a drift is held against at least [J].
    """

    reached: float = 0.0
    short: int = 0
    sample: Any = field(default=None, metadata={"saved": False})
    least_energy: float = field(default=0.0, metadata={"saved": False})


class StepObserver(Integrator):
    """Base of methods that choose their steps, on one system.

    A subclass has ``method``, its name, and ``order``, and brings `begin`, `step` and `interpolated`; how to write one
    says `refweb.dynamics.integrators`. Its ``keys`` are those of ``[solve]`` that it takes.

    Parameters
    ----------
    system : refweb.system.system.System
        Of any order, with either mass.
    probes, sums, events : sequence
        Monitors, see `refweb.dynamics.integrators.integrator`.
    rtol : float
        Relative tolerance of displacements and velocities.
    atol_position, atol_velocity : float, optional
        Absolute tolerances [m], [m/s]; by default `refweb.dynamics.integrators.tolerances.scales` times rtol.

    Attributes
    ----------
    unknowns : int
        Number of displacements that are free, and of velocities.
    tolerances : dict of str to float
        Absolute ones by unit: what moves by less is the method's own.
    stats : dict
        Counts of the work: ``nfev``, ``njev`` and ``nlu``.

    Raises
    ------
    InputError
        Where nothing is free to move; for nodes without mass and links that the method does not take.
    """

    method: str = ""
    order: int = 2
    keys: tuple[str, ...] = ("rtol", "atol_position", "atol_velocity")
    knob: Literal["safety", "rtol"] = "rtol"
    retry: float = 0.1
    beside: bool = False
    follows_lines: bool = True
    on_progress: Callable[[float], None] = staticmethod(lambda t: None)
    course_type: type[ObservedState] = ObservedState
    _made_of: tuple[Any, ...]
    takes_massless = takes_links = takes_rotations = takes_flows = takes_internal = False
    """True if the method's equations can include nodes without mass, rigid links, rotating bodies, masses that change,
    and internal variables."""
    rotations: Any = None  # the `refweb.dynamics.integrators.rotations.Rotations` of such bodies
    restarts = False
    """True if the method restarts at corners of tables. The polynomial of IDA through the steps before a pulse of 1e-8
    s gives 3 % too much of its impulse; with a restart the error is 4e-5."""

    def __new__(cls, *observed: Any, **keys: Any) -> Self:
        """Note what it is made of, so that `refined` makes it of the same."""
        made = super().__new__(cls)
        made._made_of = observed, keys
        return made

    def __init__(
        self,
        system: System,
        probes: Sequence[Probe] = (),
        sums: Sequence[Sum] = (),
        events: Sequence[Any] = (),
        rtol: float = 1e-6,
        atol_position: float | None = None,
        atol_velocity: float | None = None,
    ) -> None:
        self.system: System = system
        self.rtol: float = rtol
        self._per_cell, self._blocks = system.per_cell(), system.blocks()
        if not self.takes_massless:
            refuse_massless(system, self.method)
        if system.internal and not self.takes_internal:
            others = 'method = "central-difference", "cvode" or "ida"'
            raise InputError(f"{system.internal.title} needs {others}, not {self.method}")
        if system.constraints and not self.takes_links:
            raise InputError(f'[[link]] needs method = "ida": {self.method} does not hold lengths')
        if not self.takes_flows:
            refuse_flows(system.net, f'[solve] method = "{self.method}"')
        if system.turning:
            from .rotations import followed

            self.rotations = followed(system, self.method, self.takes_rotations)
        self.unknowns: int = len(system.free)
        if not self.unknowns:
            raise InputError(
                f'[solve] method = "{self.method}" needs something that is free to move: all nodes are supported; use '
                '"central-difference"'
            )
        near, fast = scales(system)
        self.atol_position: float = rtol * near if atol_position is None else atol_position
        self.atol_velocity: float = rtol * fast if atol_velocity is None else atol_velocity
        self.tolerances: dict[str, float] = {"m": self.atol_position, "m/s": self.atol_velocity}
        self.stats: dict[str, int] = dict(nfev=0, njev=0, nlu=0)
        self._events = event_rows(events)
        by_path = bool(system.net.factors and system.followers)
        self._halvings = HALVINGS_BY_PATH if by_path else HALVINGS
        even = {"uneven": min(rtol, UNEVEN)} if by_path else {}
        self._book = SimpsonBalance(system, self.hold, max(fast, self.atol_velocity / rtol), **even)
        self._measurements = Measurements(probes, sums, self._book)
        self._limits = StepLimits(system, self.rotations, lambda t: self.state(t, *self.interpolated(t))[0])
        self._monitors: tuple[Measurements | Passages, ...] = self._measurements, self._limits.passages
        self._yielding = None
        if system.followers:
            from .yielding import Yielding

            self._yielding = Yielding(system, rtol)
        self._wrong = None  # time and force of the first evaluation of this step that is not finite

    # What a method brings

    def begin(self, t: float, x: NDArray[np.float64], v: NDArray[np.float64]) -> None:
        """Begin to move, or begin anew behind a jump of velocities.

        Parameters
        ----------
        t : float
            Time [s].
        x, v : ndarray, shape (unknowns,)
            Displacement [m] and velocity [m/s] of the unknowns there.
        """
        raise NotImplementedError

    def step(self, stop: float, end: float) -> float:
        """Take one step.

        Parameters
        ----------
        stop : float
            Time that it must not pass [s], the corner of a table or where a body might pass through something; may be
            infinite.
        end : float
            Time of the next row [s], which it may pass.

        Returns
        -------
        float
            Time reached [s], later than before.

        Raises
        ------
        Stopped
            Where no step is found, with the reason.
        """
        raise NotImplementedError

    def interpolated(self, t: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Displacement [m] and velocity [m/s] of the unknowns, shape (unknowns,), at a time within the last step."""
        raise NotImplementedError

    def hold(self, x: NDArray[np.float64], v: NDArray[np.float64]) -> None:
        """Move a state of all rows, shape (rows, 3), to the nearest one that the equations allow."""
        if self.rotations:
            self.rotations.set_lengths(x)

    # What it may call

    def state(
        self, t: float, x: NDArray[np.float64], v: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Displacement [m] and velocity [m/s] of all rows, shape (rows, 3), for those of the unknowns."""
        system = self.system
        if not len(x) == len(v) == self.unknowns:
            raise ValueError(f"{len(x)} displacements and {len(v)} velocities for {self.unknowns} unknowns")
        all_x, all_v = self._reference.copy(), np.zeros((system.rows, 3))
        fill_free(x, v, system.free, all_x.ravel(), all_v.ravel())
        system.drive(t, all_x, all_v)
        return all_x, all_v

    def force(self, t: float, x: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Force on each unknown [N] for displacement and velocity of the unknowns."""
        return self.force_at(t, *self.state(t, x, v))

    def force_at(self, t: float, x: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Force on each unknown [N] at a state of all rows."""
        self.stats["nfev"] += 1
        rows = self.system.forces(t, x, v, self._per_cell).force
        force = rows.ravel()[self.system.free]
        if self.rotations:
            self.rotations.leave_along_axles(force)
        if self._wrong is None and not math.isfinite(force.sum()):
            self._wrong = t, rows
        return force

    def acceleration(self, t: float, x: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Acceleration of each unknown [m/s²], M⁻¹ f, for displacement and velocity of the unknowns."""
        return self.system.mass.factor.solve(self.force(t, x, v))

    def over_tolerance(
        self, off_x: NDArray[np.float64], off_v: NDArray[np.float64], x: NDArray[np.float64], v: NDArray[np.float64]
    ) -> float:
        """Root mean square of errors of the unknowns, each over its tolerance at a state: 1 is what may be [1]."""
        position = off_x / (self.atol_position + self.rtol * np.abs(x))
        velocity = off_v / (self.atol_velocity + self.rtol * np.abs(v))
        return np.sqrt(0.5 * (np.mean(position**2) + np.mean(velocity**2)))

    def tangents(
        self, t: float, x: NDArray[np.float64], v: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
        """Values of K, and of C or None, at a state of all rows."""
        K, C = self.system.stiffness(t, x, v, blocks=self._blocks), self.system.damping(t, x, v, self._blocks)
        if not self.rotations:
            return K, C
        pattern = self.system.pattern
        along = self.rotations.rows_along_axles
        return along(pattern, K), None if C is None else along(pattern, C)

    # What is made of them

    def spent(self, course: IntegratorState) -> dict[str, Any]:
        """Statistics of a run, for ``run.json``."""
        return dict(self.stats)

    def start(self, x: NDArray[np.float64] | None = None, v: NDArray[np.float64] | None = None) -> ObservedState:
        """The `IntegratorState` at t = 0, see `refweb.dynamics.integrators.integrator.Integrator.start`."""
        system = self.system
        x = np.zeros((system.rows, 3)) if x is None else x.copy()
        v = system.initial_velocity() if v is None else v.copy()
        v[system.supported] = 0.0
        system.drive(0.0, x, v)
        if system.net.flows:
            v = system.material_flow.velocity_behind(0.0, x, v)
            self.hold(x, v)
        sample, work = Sample(system, 0.0, x, v), np.zeros(len(system.terms) + 1)
        energies = self._book.energies(sample, work, 0.0)
        monitors = self._measurements.start(sample, energies, self._events)
        course = self.course_type(time=0.0, x=x, v=v, work=work, **monitors)
        self._book.open(course, energies)
        self._enter(course)
        return course

    def save(self, course: IntegratorState) -> dict[str, NDArray[Any]]:
        """The `IntegratorState` as arrays by name, for a checkpoint; a method's past steps are not among them."""
        return {**course.arrays(), "spent": np.array(list(self.stats.values()))}

    def load(self, arrays: dict[str, NDArray[Any]]) -> ObservedState:
        """The `IntegratorState` of a checkpoint, from which the method begins as at t = 0."""
        arrays = dict(arrays)
        self.stats.update(zip(self.stats, arrays.pop("spent").tolist(), strict=True))
        course = self.course_type.of_arrays(arrays)
        course.reached = course.time
        self._enter(course)
        return course

    def renew(self, course: ObservedState, change: NDArray[np.float64]) -> None:
        """Begin anew at the state of a course, where forces have changed."""
        course.reached = course.time
        self._enter(course)

    def refined(self, by: float | None = None) -> Self:
        """The method with tolerances that are ``by`` times as small, by default `TWIN_TOLERANCES`.

        It does not look for passages: those of the first run are what a solution tells.
        """
        (observed, keys), share = self._made_of, 1.0 / (TWIN_TOLERANCES if by is None else by)
        finer = {key: share * keys[key] for key in ("atol_position", "atol_velocity") if keys.get(key)}
        method = type(self)(*observed, **{**keys, **finer, "rtol": share * self.rtol})
        method._monitors = (method._measurements,)
        return method

    def error_share(self, course: IntegratorState, compared: IntegratorState) -> float:
        """Error of a finer run over that of this one: it goes with the tolerance to the power 2/3 at order 2."""
        return TWIN_TOLERANCES ** (-2.0 / 3.0)

    def next_knob(self, share: float) -> float:
        """Factor on rtol for errors that are ``share`` times what they may be."""
        return min(max(0.5 * share**-1.5, 0.01), 0.1)

    def advance(self, course: ObservedState, times: Sequence[float]) -> History:
        """Take a course to each of some times, see `refweb.dynamics.integrators.integrator.Integrator.advance`."""
        ends = np.atleast_1d(np.asarray(times, dtype=float))
        history = History.empty(len(ends), len(self._measurements.observed.probes), self.system.terms)
        for n, end in enumerate(ends):
            before = course.time
            while course.time < end and not course.stopped:
                if course.reached <= course.time:
                    self._take_step(course, end)
                    if course.nsteps % BREATH == 0:
                        self.on_progress(course.time)
                self._cover(course, min(course.reached, end))
            self._fill(history.values[n], course, before)
            if course.stopped:
                return history[: n + 1]
        return history

    def refuse_drift(self, course: IntegratorState) -> None:
        """Raise `EnergyDriftError` for a run with an energy drift above `DRIFT` or a momentum drift above `allowed`."""
        if not course.drift <= DRIFT:
            from .drift_source import suspects

            refuse_open(course, DRIFT, f"{self._remedy}{suspects(self.system)}")
        refuse_open_momentum(course, allowed(self.rtol), self._remedy)

    def _enter(self, course):
        """Begin at the state of a course."""
        system, x, v = self.system, course.x, course.v
        self._refer(course)
        course.sample, course.least_energy = Sample.behind(system, course.time, x, v), self._book.least_energy
        with self._report(course):
            self.begin(course.time, x.ravel()[system.free], v.ravel()[system.free])

    def _refer(self, course):
        """Take on the plastic strains of a course, and what is no unknown from there on."""
        if self._yielding is not None:
            self._yielding.take_on(course)
        self._reference = np.where(self.system.supported, course.x, 0.0)  # motion is written over it

    def _take_step(self, course: ObservedState, end):
        """Take a step of the method, not beyond a corner of a table, nor further than a body can be passed."""
        turned = self._yielding is not None and self._yielding.turned_back()
        stop = self._limits.stop(course.time, course.x, course.v, end, course.step)
        ahead = max(end, course.time + 1e-3 * end)  # from a corner it may be too near for a first step to be chosen
        if turned or self.restarts and course.nsteps and self._limits.at_corner(course.time):
            self._enter(course)  # and the first step is chosen whatever the rows are
            ahead = course.time + max(1e3 * course.step, 1e-6 * course.time)
        self._wrong = None
        with self._report(course):
            reached = self.step(stop, ahead)
            if not reached > course.reached:
                raise Stopped("no step is long enough to change the time")
            if self._wrong is not None and not np.isfinite(self.interpolated(reached)).all():
                raise Stopped("numbers are not finite")
        if abs(reached - stop) <= 4.0 * np.spacing(reached):  # a sum of time and step, and corners are to be met
            reached = stop
        if self._yielding is not None:
            reached = self._yielding.turn(course.time, reached, self)
        course.step, course.reached, course.nsteps = reached - course.reached, reached, course.nsteps + 1
        course.short = course.short + 1 if course.step * MAX_STEPS_PER_ROW < end - course.time else 0
        if course.short > PATIENCE:
            raise IntegrationError(
                f"the steps at t = {course.time:.6g} s are {course.step:.3g} s, more than {MAX_STEPS_PER_ROW:g} to the "
                f"next row: raise rtol = {self.rtol:g}, or lower the stiffness that asks for such steps"
            )

    def _sample_at(self, t):
        """The system at a time within the last step."""
        x, v = self.state(t, *self.interpolated(t))
        self.hold(x, v)
        return Sample(self.system, t, x, v)

    def _cover(self, course, end, halved=0):
        """Look at a course in the middle between its time and ``end``, and at the end; leave it there."""
        piece = self._book.piece(course, end, self._sample_at)
        if halved < self._halvings and self._book.uneven(course, piece):
            self._cover(course, piece.middle.time, halved + 1)
            if not course.stopped:
                self._cover(course, end, halved + 1)
            return
        if len(course.events):
            stop = search(course.events, piece, self._measurements.value)
            if stop < end:
                piece = self._book.piece(course, stop, self._sample_at)
        for monitor in self._monitors:
            monitor.inspect(course, piece)
        booked = piece.booked(piece.end.time)
        course.work, course.impulse, course.ledger.pushed[:] = booked[:-6], booked[-6:-3], booked[-3:]
        course.sample = end = piece.end
        course.time, course.x, course.v = float(end.time), end.x, end.v
        if self._yielding is not None:
            self._refer(course)
            course.sample.rates = None  # of other plastic strains
        if self._limits.at_corner(course.time):  # what is stored there may be gone again at the row
            self._book.note_largest(course, self._book.energies(end, course.work, course.step))
        net = self.system.net
        if piece.jump is not None and (net.flows or net.consistent_minus_lumped is not None):  # what is free jumps too
            self._enter(course)

    def _fill(self, row, course, before):
        """Write a row, and check the book of energies."""
        sample = Sample(self.system, course.time, course.x, course.v)
        energies = self._book.energies(sample, course.work, course.step)
        self._measurements.write(row, sample, course)
        row[-9 - len(energies) : -9] = energies
        self._book.impulses(course, row[-9:])
        self._book.close(course, energies, before, self._remedy)

    @property
    def _remedy(self):
        return f"use a smaller rtol than {self.rtol:g}"

    @contextlib.contextmanager
    def _report(self, course):
        """Tell where a method stopped, and what moves there."""
        try:
            yield
        except Stopped as stop:
            if self._wrong is not None:
                refuse_endless(self.system, *self._wrong)
            system = self.system
            force = np.where(system.supported, 0.0, system.force(course.time, course.x, course.v))
            row = int(np.argmax(np.linalg.norm(force, axis=1)))
            raise IntegrationError(
                f"{self.method} stopped at t = {course.reached:.6g} s with steps of {course.step:.3g} s: "
                f"{str(stop).rstrip('.')}; the largest force that moves anything is at {system.row_name(row)}: raise "
                f"rtol = {self.rtol:g}, or lower the stiffness that asks for such steps"
            ) from None
