"""Interface of integrators: one system taken through time, inspected by probes, with balances of energy and momentum.

A method is a class that has what `Integrator` lists; `refweb.registry.INTEGRATORS` gives it its name in scenes. It is
made of a system and of what is to be looked at:

* `refweb.results.probes.Probe`, one scalar of the state each, in the rows and, with a sign, as extreme of all steps; or
  its mean over a window that slides along the run, in the same places;
* `Sum`, the same of energies, work and step size;
* `refweb.dynamics.integrators.events.Event`, a moment at which one of these passes a level.

``start`` makes an `IntegratorState`, the whole state of a run; ``advance`` takes it on and returns a `History` of rows.

May change: words, `MAX_STEPS_PER_ROW`, a limit of what is accepted, and `SAME`, above rounding. Must stay: names in
`Integrator`, which plug-ins bring; fields of `IntegratorState` and keys of `GROUPS`, which are keys of checkpoints; the
order of columns of `History`, which `rows` and `step_observer` write by position and `history` reads. An optional
attribute of integrators belongs in the notes of `Integrator`. Must stay as well: `Variant`, which `studies.trials`,
`central_difference` and other files import; public names of `History`, which other files use. Tests:
``tests/how_to/test_integrator.py``, ``tests/dynamics/test_dynamics.py``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol, Self

import numpy as np

from ...results.columns import VECTORS, components
from .averages import Averages
from .crossings import none_met
from .events import ended_by
from .extremes import Extremes
from .momentum_balance import MomentumBalance

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ...effects.base import ForceTerm
    from ...system.broken_lines import Breaks

SAME = 1e-12
"""Share of a time within which another is the same: corners of tables, rows and ends of steps are sums."""
MAX_STEPS_PER_ROW = 1e8
"""Largest number of steps that a history row may take."""
GROUPS = {"extremes": Extremes, "ledger": MomentumBalance, "averages": Averages}
"""Fields of an `IntegratorState` that are records of arrays."""


class Sum(NamedTuple):
    """A weighted sum of the entries of the energy balance, which is evaluated in every step.

    Attributes
    ----------
    weights : ndarray, shape (terms + 3,)
        Weights of the energy of each term, kinetic energy, work and step size: the columns of `History.sums`.
    sign : float
        1 for the largest value of all steps, −1 for the smallest, 0 for neither.
    """

    weights: NDArray[np.float64]
    sign: float = 0.0


@dataclass(eq=False, kw_only=True)
class IntegratorState:
    """State of a run: all data that are needed to continue it.

    Attributes
    ----------
    time : float
        Time [s].
    x, v : ndarray, shape (rows, 3)
        Displacement [m] and velocity [m/s].
    extremes : refweb.dynamics.integrators.extremes.Extremes
        Extreme value of each probe and, behind them, of each sum.
    events : ndarray of `refweb.dynamics.integrators.events.EVENT`, shape (events,)
        State of each event.
    work : ndarray, shape (terms + 1,)
        Work of each term that is booked by its power and, last, of motion [J].
    impulse : ndarray, shape (3,)
        Impulse of the supports on the net [N s].
    ledger : refweb.dynamics.integrators.momentum_balance.MomentumBalance
        The book of momentum.
    averages : refweb.dynamics.integrators.averages.Averages
        Means over windows, of the probes that have one.
    nsteps : int
        Steps taken.
    step : float
        Size of the last one [s].
    energy : float
        Energy at the start [J].
    largest : float
        Largest energy of the rows, terms and motion without regard to sign [J].
    worst : float
        Largest |ΔE − work| of the rows [J].
    share : float
        |ΔE − work| at the last row over ``largest`` there [1], infinite before the first.
    crossings : ndarray, shape (4, 5)
        Where lines may touch lines, the first two that may have passed through each other, and the first two neighbours
        along the net: time [s], infinite where there are none, and the four nodes of both; the first line that may have
        passed through a body: time, its two nodes, the row of the body and a number; the first two bodies of which one
        may have come to the middle of the other: time, the rows of both and twice −1.
    breaks : refweb.system.broken_lines.Breaks, optional
        Broken elements, if elements may break.
    """

    time: float
    x: NDArray[np.float64]
    v: NDArray[np.float64]
    extremes: Extremes
    events: NDArray[Any]
    work: NDArray[np.float64]
    impulse: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    ledger: MomentumBalance = field(default_factory=MomentumBalance.empty)
    averages: Averages = field(default_factory=Averages.at_start)
    nsteps: int = 0
    step: float = 0.0
    energy: float = 0.0
    largest: float = 0.0
    worst: float = 0.0
    share: float = np.inf
    crossings: NDArray[np.float64] = field(default_factory=none_met)
    breaks: Breaks | None = field(default=None, metadata={"saved": False})

    @property
    def stopped(self) -> bool:
        """True if an event has ended the run."""
        return len(self.events) > 0 and bool(ended_by(self.events))

    @property
    def drift(self) -> float:
        """Largest |ΔE − work| over the largest energy [1]."""
        return float(self.worst / self.largest) if self.largest > 0.0 else 0.0

    @property
    def drifts(self) -> dict[str, float | None]:
        """Errors of the balances, for ``run.json``; None for angular momentum that is not kept."""
        linear, angular = self.ledger.drifts.tolist()
        angular = angular if self.ledger.largest[1] > 0.0 else None
        return dict(energy_drift=self.drift, momentum_drift=linear, angular_momentum_drift=angular)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All of it as arrays by name, for a checkpoint; a field whose metadata says ``saved=False`` is left out."""
        kept = {f.name: getattr(self, f.name) for f in fields(self) if f.metadata.get("saved", True)}
        for group in GROUPS:
            kept |= {f"{group}_{name}": array for name, array in kept.pop(group).by_name().items()}
        return {name: np.asarray(value) for name, value in kept.items()}

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """The course of a checkpoint."""
        given: dict[str, Any] = {name: array if array.ndim else array.item() for name, array in arrays.items()}
        for group, kind in GROUPS.items():
            given[group] = kind(*(given.pop(f"{group}_{name}") for name in kind.field_names()))
        return cls(**given)


@dataclass(frozen=True)
class History:
    """Rows of a run.

    Attributes
    ----------
    names : tuple of str
        Names of the columns.
    values : ndarray, shape (rows, columns)
        The rows.
    probed : int
        Number of probes.
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    probed: int

    @classmethod
    def empty(cls, rows: int, probed: int, terms: Sequence[ForceTerm]) -> Self:
        """Rows of zeros for a number of probes and the terms of a system."""
        names = ["time", *(f"probe {i}" for i in range(probed)), *(term.name for term in terms)]
        names += ["kinetic_energy", "work", "step_size"]
        names += components(VECTORS)
        return cls(tuple(names), np.zeros((rows, len(names))), probed)

    def like(self, rows: int) -> History:
        """Rows of zeros with the same columns."""
        return History(self.names, np.zeros((rows, len(self.names))), self.probed)

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, rows: slice | NDArray[np.bool_]) -> History:
        """Some of the rows, by a slice or a mask."""
        return History(self.names, self.values[rows], self.probed)

    @property
    def time(self) -> NDArray[np.float64]:
        """Time of each row [s]."""
        return self.values[:, 0]

    @property
    def probes(self) -> NDArray[np.float64]:
        """Value of each probe, shape (rows, probes)."""
        return self.values[:, 1 : 1 + self.probed]

    @property
    def sums(self) -> NDArray[np.float64]:
        """Weights of a `Sum`: energy of each term, kinetic energy [J], work [J], step size [s]."""
        return self.values[:, 1 + self.probed : -3 * len(VECTORS)]

    @property
    def energies(self) -> NDArray[np.float64]:
        """Energy of each term and, last, kinetic energy [J], shape (rows, terms + 1)."""
        return self.sums[:, :-2]

    @property
    def work(self) -> NDArray[np.float64]:
        """Work of all that acts from outside [J]."""
        return self.sums[:, -2]

    @property
    def step_size(self) -> NDArray[np.float64]:
        """Size of the last step before each row [s]."""
        return self.sums[:, -1]

    @property
    def momentum(self) -> NDArray[np.float64]:
        """Momentum of all that is free [N s], shape (rows, 3)."""
        return self.values[:, -9:-6]

    @property
    def impulse(self) -> NDArray[np.float64]:
        """Impulse of the supports on the net [N s], shape (rows, 3)."""
        return self.values[:, -6:-3]

    @property
    def outer_impulse(self) -> NDArray[np.float64]:
        """Impulse of all else that acts from outside [N s], shape (rows, 3)."""
        return self.values[:, -3:]


class Variant(NamedTuple):
    """A way to run a method, which ``refweb cost`` compares with others.

    Attributes
    ----------
    keys : dict
        Keys of ``[solve]`` that make it.
    settings : tuple of float
        Values of the knob at which it is run, from coarse to fine; by default those of
        `refweb.studies.trials.SETTINGS`.
    kind : str
        Name that variants share if their errors may be alike, so that they do not confirm each other; empty for a
        variant that is the only one of its kind.
    """

    keys: dict[str, Any] = {}
    settings: tuple[float, ...] = ()
    kind: str = ""


class Integrator(Protocol):
    """A method of dynamics on one system.

    It is made by ``Class(system, probes=(), sums=(), events=(), **keys)``, where ``keys`` are those of ``[solve]`` that
    its line of `refweb.registry.INTEGRATORS` names; a system, or a key, that it does not take is an
    `refweb.errors.InputError`.

    Attributes
    ----------
    method : str
        Its name in ``[solve]``.
    order : int
        Order of the error of a smooth motion in the step.
    knob : {"safety", "rtol"}
        The key that trades accuracy for time: a smaller one is a smaller error.
    retry : float
        Factor on the knob for another run where the book of energies stays open, below 1.
    beside : bool
        True if ``advance`` runs compiled and releases the interpreter, so that a step refinement may run in a thread
        beside it.
    on_progress : callable
        Called with the time [s] some times a second of ``advance``, or once in some steps; it may raise, which ends the
        run: one of a compiled loop is then as it was at the row before.

    Notes
    -----
    Further attributes are optional. ``takes_links = True``: it maintains the lengths of ``[[link]]``. ``follows_lines =
    True``: it records in the course which lines may have passed through each other. ``variants``: a dict of `Variant` s
    by name that ``refweb cost`` compares. ``tolerances``: a dict of absolute tolerances by unit, "m" and "m/s"; ± is at
    least a multiple of these. ``prepare()``: compiles kernels before a run. ``evaluations(duration)``: number of
    evaluations of forces for a time [s], if it is known before a run. ``steps_in(spans)``: number of steps for each of
    some spans of time [s], shape (spans,). ``coarser_by(spans)``: a ``by`` below 1 for `refined` whose run shows the
    error as well, in less time, or None; ``spans`` are times between rows and corners of tables [s], shape (spans,).
    """

    method: str
    order: int
    knob: Literal["safety", "rtol"]
    retry: float
    beside: bool
    on_progress: Callable[[float], None]

    def start(self, x: NDArray[np.float64] | None = None, v: NDArray[np.float64] | None = None) -> IntegratorState:
        """The course at t = 0.

        Parameters
        ----------
        x : ndarray, shape (rows, 3), optional
            Displacement [m], by default none: the web's position. It is copied.
        v : ndarray, shape (rows, 3), optional
            Velocity [m/s], by default those of the scene. It is copied.

        Returns
        -------
        IntegratorState
            With the supports where motion has them, the values of probes and sums there as extremes, the events that
            have happened by being there, and the energy at the start.
        """
        ...

    def advance(self, course: IntegratorState, times: Sequence[float]) -> History:
        """Take a course to each of some times in turn.

        Parameters
        ----------
        course : IntegratorState
            Where it is; it is taken along.
        times : sequence of float
            Times of the rows [s], increasing, the first not before the course's own.

        Returns
        -------
        History
            A row at each time; fewer where an event ends the run, the last then at the time of that.

        Raises
        ------
        EnergyDriftError
            Where the energy drift exceeds `refweb.dynamics.integrators.energy_balance.DRIFT` and does not fall.
        SolverError
            Where no step is to be had, or a number is not finite.
        """
        ...

    def refuse_drift(self, course: IntegratorState) -> None:
        """Raise `EnergyDriftError` for a complete run whose energy balance is open by more than results may have."""
        ...

    def spent(self, course: IntegratorState) -> dict[str, Any]:
        """Statistics of a course, for ``run.json``.

        Returns
        -------
        dict
            ``nfev``, ``njev`` and ``nlu``, evaluations of forces and of tangents and factorizations, and whatever else
            there is to say.
        """
        ...

    def save(self, course: IntegratorState) -> dict[str, NDArray[Any]]:
        """A course as arrays by name, for a checkpoint."""
        ...

    def load(self, arrays: dict[str, NDArray[Any]]) -> IntegratorState:
        """The course of a checkpoint, for an integrator made of the same arguments."""
        ...

    def renew(self, course: IntegratorState, change: NDArray[np.float64]) -> None:
        """Go on from the state of a course with forces that have changed at once.

        Parameters
        ----------
        course : IntegratorState
            Its state, at a history row.
        change : ndarray, shape (rows, 3)
            Change of the force on each row [N].
        """
        ...

    def refined(self, by: float | None = None) -> Integrator:
        """The method on the same system, with the same probes, sums and events and another error.

        Parameters
        ----------
        by : float, optional
            How many times as fine steps or tolerances are; by default finer, so that the difference says what the
            error is.
        """
        ...

    def error_share(self, course: IntegratorState, compared: IntegratorState) -> float:
        """Error of the finer of two runs over that of the other, by the order of the method, below 1 [1].

        The error of the run is taken as the difference of both over 1 − this share.

        Parameters
        ----------
        course, compared : IntegratorState
            A run at its end, and that of ``refined(by)``.
        """
        ...

    def next_knob(self, share: float) -> float:
        """Factor on the knob that brings down errors which are ``share`` times what they may be."""
        ...
