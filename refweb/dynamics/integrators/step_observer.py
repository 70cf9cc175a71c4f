"""What CVODE and IDA have in common: history rows, peaks, books of energy and momentum around a solver's own steps.

A solver takes steps of its own choice and knows its state anywhere within the last one. Each step, cut at the history
rows, is looked at in its middle and at its end: for peaks, and for the integrals of power and of the supports' forces
by Simpson's rule. A flag of success is not believed: the book of energies is checked at every row as in
`refweb.dynamics.integrators.central_difference`.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field, replace

import numpy as np

from ...errors import InputError, OpenBook, SolverError
from ...kernels import ENERGY, INDICES, MATRIX, VECTOR, typed_list
from ...results.probes import PLACE
from .energy_book import CLOSING, DRIFT, book_energies, no_energy, refuse_open
from .events import crosses, event_rows, starts_above
from .extremes import Extremes, quadratic_peak
from .integrator import MAX_STEPS_PER_ROW, Course, History, Integrator

TRAVEL = 0.2
"""Largest share of a body's thickness that anything may move in a step, so that nothing passes through; where bodies
are further away, half of that distance."""
PATIENCE = 1000
"""Number of steps in turn of which a row would take more than `MAX_STEPS_PER_ROW`; at a start they are short."""
UNEVEN = 1e-3
"""Largest share of the energy by which the work in a piece may differ between Simpson's and the trapezoidal rule."""
HALVINGS = 8
"""Number of times that a piece is halved where it does."""


TWIN_TOLERANCES = 10.0
"""Tolerances of a run over those of its twin: by less, both may take the same steps, which are changed by factors of
up to 2."""


@dataclass(eq=False, kw_only=True)
class ImplicitCourse(Course):
    """State of an implicit run, at the time that has been looked at; the solver's last step may end later.

    Attributes
    ----------
    reached : float
        End of the solver's last step [s].
    short : int
        Number of steps in turn that are too short to come to the next row.
    rates : tuple
        Powers, forces of the supports, natural lengths and what pulls on them, at ``time``.
    """

    reached: float = 0.0
    short: int = 0
    rates: tuple = field(default=(), metadata={"saved": False})


class StepObserver(Integrator):
    """A method of somebody's own steps on one system, with history rows, books, peaks and events around the steps.

    A subclass brings `begin`, `step` and `interpolated`.

    Parameters
    ----------
    system : refweb.system.system.System
        Of any order, with either mass.
    probes, sums, events : sequence
        What to look at, see `refweb.dynamics.integrators.integrator`.
    rtol : float
        Relative tolerance of displacements and velocities.
    atol_position, atol_velocity : float, optional
        Absolute tolerances [m], [m/s]; by default `scales` times rtol.
    """

    method, order = "", 2
    knob, retry, beside = "rtol", 0.1, False
    breathe = staticmethod(lambda t: None)
    takes_massless = takes_links = False
    """Whether nodes without mass have a place in the equations, and rigid links."""

    def __init__(self, system, probes=(), sums=(), events=(), rtol=1e-6, atol_position=None, atol_velocity=None):
        self.system, self.rtol = system, rtol
        self.observed = tuple(probes), tuple(sums), tuple(events)
        self._tolerances = dict(rtol=rtol, atol_position=atol_position, atol_velocity=atol_velocity)
        self._keys = {}
        if not self.takes_massless:
            refuse_massless(system, self.method)
        if system.constraints and not self.takes_links:
            raise InputError(f'[[link]] needs method = "ida": {self.method} does not hold lengths')
        self.unknowns = len(system.free)
        if not self.unknowns:
            raise InputError(
                f'[solve] method = "{self.method}" needs something that is free to move: all nodes are supported; use '
                '"central-difference"'
            )
        near, fast = scales(system)
        self.atol_position = rtol * near if atol_position is None else atol_position
        self.atol_velocity = rtol * fast if atol_velocity is None else atol_velocity
        self.stats = dict(nfev=0, njev=0, nlu=0)
        families = system.families
        self._signs = np.array([float(one.sign) for one in (*probes, *sums)])
        self._arrays = [
            (probe.kernel, np.array(probe.rows, dtype=np.int64), np.ascontiguousarray(probe.data, dtype=float))
            for probe in probes
        ]
        self._events = event_rows(events)
        self._weights = np.array([one.weights for one in sums], dtype=float).reshape(len(sums), len(families) + 3)
        self._lines = system.net.line_data.copy() if system.line_drives else system.net.line_data
        self._book = (
            typed_list(INDICES, [f.cells for f in families]),
            typed_list(MATRIX, [self._lines if f.lines else f.data for f in families]),
            typed_list(ENERGY, [f.energy or no_energy for f in families]),
            typed_list(VECTOR, [np.zeros(len(f.cells)) for f in families]),
        )
        self._powered = [(i, f.power) for i, f in enumerate(families) if f.power is not None]
        self._working = system.working
        self._driven = np.concatenate([[], *(d.cells[:, 0] for d in system.drives)]).astype(np.int64)
        self._held, self._fixed = system.supported, np.flatnonzero(system.supported)
        times = [t for part in (*families, *system.drives, *system.line_drives) for t in part.times]
        self._breaks = np.unique(np.array(times, dtype=float))
        bodies = system.net.bodies
        self._thickness = min((body.thickness for body in bodies), default=np.inf)
        self._outreach = np.array([body.radius + np.linalg.norm(body.core) for body in bodies])
        self._wrong = None  # time and force of the first evaluation of this step that is not finite

    # What a method brings

    def begin(self, t, x, v):
        """Begin to move from a time, and displacement and velocity of the unknowns there; of order 1 if need be."""
        raise NotImplementedError

    def step(self, stop, end):
        """Take one step, not beyond ``stop``, on the way to ``end``; return the time reached."""
        raise NotImplementedError

    def interpolated(self, t):
        """Displacement and velocity of the unknowns at a time within the last step."""
        raise NotImplementedError

    def hold(self, x, v):
        """Move a state of all rows to the nearest one that the equations allow."""

    # What it may call

    def state(self, t, x, v):
        """Displacement [m] and velocity [m/s] of all rows, shape (rows, 3), for those of the unknowns."""
        system = self.system
        all_x, all_v = self._reference.copy(), np.zeros((system.rows, 3))
        all_x.ravel()[system.free], all_v.ravel()[system.free] = x, v
        system.drive(t, all_x, all_v)
        return all_x, all_v

    def force(self, t, x, v):
        """Force on each unknown [N] for displacement and velocity of the unknowns."""
        return self.force_at(t, *self.state(t, x, v))

    def force_at(self, t, x, v):
        """Force on each unknown [N] at a state of all rows."""
        self.stats["nfev"] += 1
        rows = self.system.force(t, x, v)
        force = rows.ravel()[self.system.free]
        if self._wrong is None and not np.isfinite(force.sum()):
            self._wrong = t, rows
        return force

    # What it makes of them

    def spent(self, run):
        """What a run has spent, for ``run.json``."""
        return dict(self.stats)

    def start(self, x=None, v=None):
        """The `Course` at t = 0, from the web's position and the scene's velocities unless x and v say otherwise."""
        system = self.system
        x = np.zeros((system.rows, 3)) if x is None else x.copy()
        v = system.initial_velocity() if v is None else v.copy()
        v[system.supported] = 0.0
        system.drive(0.0, x, v)
        signs, count = self._signs, len(self._arrays)
        extremes = Extremes.at_start(np.zeros(len(signs)), np.full(len(signs), -1))
        book = np.zeros(len(system.families) + 1)
        run = ImplicitCourse(time=0.0, x=x, v=v, extremes=extremes, events=self._events.copy(), work=book)
        force, out = self.system.balance(0.0, x, v)
        where = np.full(2, PLACE)
        for i, (probe, rows, data) in enumerate(self._arrays):
            extremes.values[i] = probe(0.0, x, v, force, out.lines, rows, data, where)
            extremes.places[i] = where[0]
        total = self._energies(run)
        extremes.values[count:] = self._weights @ total
        for event in run.events:
            starts_above(event, extremes.values[event["slot"]])
        stepping = count + np.flatnonzero(self._weights[:, -1])
        extremes.values[stepping] = -np.inf * signs[stepping]  # no step has been taken
        extremes.recent[:, 3] = extremes.values
        own = np.delete(total[:-2], np.flatnonzero(self._working > 0))
        run.energy, run.largest = own.sum(), np.abs(own).sum()
        self._enter(run)
        return run

    def save(self, run):
        """The `Course` as arrays by name, for a checkpoint; a solver's past steps are not among them."""
        return {**run.arrays(), "spent": np.array(list(self.stats.values()))}

    def load(self, arrays):
        """The `Course` of a checkpoint, from which the solver begins with short steps of order 1, as at t = 0."""
        arrays = dict(arrays)
        self.stats.update(zip(self.stats, arrays.pop("spent").tolist(), strict=True))
        run = ImplicitCourse.of_arrays(arrays)
        run.reached = run.time
        self._enter(run)
        return run

    def refined(self, by=None):
        """The method with tolerances that are ``by`` times as small, by default `TWIN_TOLERANCES`."""
        share = 1.0 / (TWIN_TOLERANCES if by is None else by)
        tolerances = {key: share * value for key, value in self._tolerances.items() if value}
        return type(self)(self.system, *self.observed, **self._keys, **tolerances)

    def error_share(self, course, finer):
        """Error of a finer run over that of this one: it goes with the tolerance to the power 2/3 at order 2."""
        return TWIN_TOLERANCES ** (-2.0 / 3.0)

    def next_knob(self, share):
        """Factor on rtol for errors that are ``share`` times what they may be."""
        return min(max(0.5 * share**-1.5, 0.01), 0.1)

    def _enter(self, run):
        """Initialise the solver at the state of a run."""
        system = self.system
        self._reference = np.where(self._held, run.x, 0.0)  # motion is written over it
        run.rates = self._rates(*self._sample_of(run.time, run.x, run.v))
        with self._told(run):
            self.begin(run.time, run.x.ravel()[system.free], run.v.ravel()[system.free])

    def advance(self, run, times):
        """Take a course to each of some times, see `refweb.dynamics.integrators.integrator.Integrator.advance`."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        history = History.empty(len(times), len(self._arrays), self.system.families)
        for n, end in enumerate(times):
            before = run.time
            while run.time < end and not run.stopped:
                if run.reached <= run.time:
                    self._take_step(run, end)
                self._cover(run, min(run.reached, end))
            self._fill(history.values[n], run, before)
            if run.stopped:
                return history[: n + 1]
        return history

    def _take_step(self, run, end):
        """One step of the solver, not beyond a corner of a table, nor further than a body can be passed."""
        stop, ahead = np.inf, self._breaks[self._breaks > run.time * (1.0 + 1e-12)]
        if len(ahead):
            stop = ahead[0]
        if np.isfinite(self._thickness):
            moving = run.v[: self.system.rows - self.system.net.spins]
            speed = 2.0 * np.sqrt((moving**2).sum(axis=1).max())
            way = max(TRAVEL * self._thickness, 0.5 * self._gap(run.x))
            stop = min(stop, run.time + way / speed) if speed > 0.0 else stop
        if stop - run.time < 1e-12 * end:
            stop = run.time + 1e-12 * end
        self._wrong = None
        ahead = max(end, run.time + 1e-3 * end)  # from a corner it may be too near for a first step to be chosen
        with self._told(run):
            reached = self.step(stop, ahead)
            if not reached > run.reached:
                raise Stopped("no step is long enough to change the time")
        run.step, run.reached, run.nsteps = reached - run.reached, reached, run.nsteps + 1
        run.short = run.short + 1 if run.step * MAX_STEPS_PER_ROW < end - run.time else 0
        if run.short > PATIENCE:
            raise SolverError(
                f"the steps at t = {run.time:.6g} s are {run.step:.3g} s, more than {MAX_STEPS_PER_ROW:g} to the next "
                f"row: raise rtol = {self.rtol:g}, or lower the stiffness that asks for such steps"
            )

    def _gap(self, x):
        """At most the least distance between a body and a node [m]: that of balls around and a box around."""
        net = self.system.net
        place = net.points + x
        low, high = place[: net.nodes].min(axis=0), place[: net.nodes].max(axis=0)
        middles = place[[body.row for body in net.bodies]]
        apart = np.maximum(np.maximum(low - middles, middles - high), 0.0)
        return (np.linalg.norm(apart, axis=1) - self._outreach).min()

    def _at(self, t):
        """Displacement and velocity of all rows at a time within the last step."""
        x, v = self.state(t, *self.interpolated(t))
        self.hold(x, v)
        return x, v

    def _cover(self, run, end, halvings=HALVINGS):
        """Look at the run in the middle between its time and ``end``, and at the end; leave it there."""
        samples = [self._sample(t) for t in (0.5 * (run.time + end), end)]
        rates = self._piece(run, samples)
        if halvings and self._uneven(run, rates, *samples[1][:3]):
            self._cover(run, samples[0][0], halvings - 1)
            if not run.stopped:
                self._cover(run, end, halvings - 1)
            return
        if len(run.events):
            stop = self._happened(run, samples, rates)
            if stop < end:
                samples = [self._sample(t) for t in (0.5 * (run.time + stop), stop)]
                rates = self._piece(run, samples)
        end, count = float(samples[1][0]), len(self._arrays)
        for sample in samples:
            self._peaks(run, *sample[:5])
            if len(self._weights):
                total = self._energies(self._there(run, rates, end, *sample[:3]))
                for j, value in enumerate(self._weights @ total, count):
                    if self._signs[j] * value > self._signs[j] * run.extremes.values[j]:
                        run.extremes.values[j], run.extremes.times[j] = value, sample[0]
                    quadratic_peak(run.extremes, j, sample[0], value, self._signs[j])
        run.work, run.impulse = self._booked(run, rates, end, end)
        run.rates = rates[3]
        run.time, run.x, run.v = end, *samples[1][1:3]
        if rates[4] and self.system.net.consistent_minus_lumped is not None:  # what is free jumps as well
            self._enter(run)

    def _piece(self, run, samples):
        """Rates at the start, in the middle and at the end of a piece of a step, and at the start of the next one.

        The last two differ at the corner of a motion, up to which its velocity is that in the middle. There velocities
        jump, which is written to the last sample; fifth comes what that takes of work and of the supports' impulse.
        """
        system, driven, (t, x, v) = self.system, self._driven, samples[1][:3]
        last, jump = samples[1], None
        if len(driven) and (v[driven] != samples[0][2][driven]).any():
            before, step = v.copy(), np.zeros_like(v)
            before[driven] = samples[0][2][driven]
            step[driven] = v[driven] - before[driven]
            after = before + system.mass.kick(step)
            after[driven] = v[driven]
            self.hold(x, after)
            last, samples[1] = self._sample_of(t, x, before), self._sample_of(t, x, after)
            jump = self._kinetic(after) - self._kinetic(before), self._momentum(after) - self._momentum(before)
        return run.rates, self._rates(*samples[0]), self._rates(*last), self._rates(*samples[1]), jump

    def _uneven(self, run, rates, end, x, v):
        """Whether powers change too much within a piece, as where damped lines go slack in a long step."""
        start, middle, last = (rate[0] for rate in rates[:3])
        apart = (end - run.time) * np.abs(start - 2.0 * middle + last).sum() / 12.0
        return apart > UNEVEN * run.largest and apart > UNEVEN * self._kinetic(v)

    def _booked(self, run, rates, end, t):
        """Work, and impulse of the supports, at time t of a piece, by the parabola through its three rates."""
        width = end - run.time
        s = (t - run.time) / width
        a, b, c = s - 1.5 * s**2 + s**3 / 1.5, 2.0 * s**2 - s**3 / 0.75, s**3 / 1.5 - 0.5 * s**2
        start, middle, last = rates[:3]
        power, reaction, _, pull = (a * p + b * q + c * r for p, q, r in zip(start, middle, last, strict=True))
        book, impulse = run.work + width * power, run.impulse + width * reaction
        book[-1] += pull @ (last[2] - start[2])
        if rates[4] and t == end:
            book[-1], impulse = book[-1] + rates[4][0], impulse + rates[4][1]
        return book, impulse

    def _there(self, run, rates, end, t, x, v):
        """The run at a state within a piece."""
        return replace(run, time=t, x=x, v=v, work=self._booked(run, rates, end, t)[0])

    def _sample(self, t):
        return self._sample_of(t, *self._at(t))

    def _sample_of(self, t, x, v):
        """Time, displacement, velocity, force, what the lines show, and the power of each family, last of motion."""
        force, out = self.system.balance(t, x, v)
        self._refuse_endless(t, force)
        power, driven = np.zeros(len(out) + 1), self._driven
        for i, column in self._powered:
            power[i] = out[i][:, column].sum()
        power[-1] = -(force[driven] * v[driven]).sum() if len(driven) else 0.0
        return t, x, v, force, out.lines.copy(), power

    def _refuse_endless(self, t, force):
        if not np.isfinite(force).all():
            name = self.system.row_name(int(np.flatnonzero(~np.isfinite(force).all(axis=1))[0]))
            raise SolverError(f"number not finite at {name}, t = {t:.6g} s: use a smaller rtol") from None

    def _happened(self, run, samples, rates):
        """Note the events between the run's time and the samples; return the time of the first that ends the run."""
        stop, before, piece = np.inf, run.time, (run, rates, samples[1][0])
        for sample in samples:
            for event in run.events:
                if event["time"] < np.inf:
                    continue
                was = event["side"]
                if crosses(event, self._value(event, piece, *sample[:5])):
                    event["time"] = self._moment(event, piece, was, before, sample[0])
                    if event["stop"]:
                        stop = min(stop, event["time"])
            before = sample[0]
        times = run.events["time"]
        times[(times > stop) & (times < np.inf)] = np.inf
        return stop

    def _moment(self, event, piece, was, low, high):
        """Time at which an event happens, by bisection on the solver's own interpolation."""
        while True:
            middle = 0.5 * (low + high)
            if not low < middle < high:
                return high
            if (1.0 if self._value(event, piece, *self._sample(middle)[:5]) > event["level"] else -1.0) == was:
                low = middle
            else:
                high = middle

    def _value(self, event, piece, t, x, v, force, lines):
        slot = event["slot"]
        if slot < len(self._arrays):
            probe, rows, data = self._arrays[slot]
            return probe(t, x, v, force, lines, rows, data, np.zeros(2, dtype=np.int64))
        total = self._energies(self._there(*piece, t, x, v))
        return self._weights[slot - len(self._arrays)] @ total

    def _peaks(self, run, t, x, v, force, lines):
        extremes = run.extremes
        where = np.zeros(2, dtype=np.int64)
        for i in np.flatnonzero(self._signs[: len(self._arrays)]):
            probe, rows, data = self._arrays[i]
            value = probe(t, x, v, force, lines, rows, data, where)
            if self._signs[i] * value > self._signs[i] * extremes.values[i]:
                where[1] = PLACE
                probe(t, x, v, force, lines, rows, data, where)
                extremes.values[i], extremes.times[i], extremes.places[i], where[1] = value, t, where[0], 0
            quadratic_peak(extremes, i, t, value, self._signs[i])

    def _rates(self, t, x, v, force, lines, power):
        """Powers [W], force of the supports [N], natural lengths [m] and what pulls on them [N]."""
        system, lengths = self.system, (np.zeros(0), np.zeros(0))
        if system.line_drives:
            lengths = system.natural_length(t), system.length_force(t, x)
        reaction = np.bincount(self._fixed % 3, force.ravel()[self._fixed], 3)
        return power, -reaction, *lengths

    def _kinetic(self, v):
        """Kinetic energy [J]."""
        return 0.5 * (v * self.system.mass.momentum(v)).sum()

    def _momentum(self, v):
        """Momentum of what is free [N s], shape (3,)."""
        moving = self.system.mass.momentum(np.where(self._held, 0.0, v))
        return moving[: self.system.rows - self.system.net.spins].sum(axis=0)

    def _energies(self, run):
        """Energy of each family, kinetic energy, work [J] and step size [s]."""
        system, total = self.system, np.zeros(len(self.system.families) + 3)
        if system.line_drives:
            self._lines[:] = system.line_data(run.time)
        numbers = (system.net.mass, *self._book, run.work, self._working)
        book_energies(run.time, run.x, run.v, *numbers, total)
        total[-3] = self._kinetic(run.v)
        total[-1] = run.step
        return total

    def _fill(self, row, run, before):
        where = np.zeros(2, dtype=np.int64)
        force, out = self.system.balance(run.time, run.x, run.v)
        total = self._energies(run)
        values = [p(run.time, run.x, run.v, force, out.lines, r, d, where) for p, r, d in self._arrays]
        row[:] = [run.time, *values, *total, *self._momentum(run.v), *run.impulse]
        own = np.delete(total[:-2], np.flatnonzero(self._working > 0))
        run.largest = max(run.largest, np.abs(own).sum())
        drift = abs(own.sum() - total[-2] - run.energy)
        run.worst = max(run.worst, drift)
        share = drift / run.largest if run.largest > 0.0 else drift
        if not share <= max(DRIFT, CLOSING * run.share):
            raise OpenBook(
                f"energy drift {run.drift:.3g} of the largest energy between t = {before:.6g} and {run.time:.6g} s, "
                f"limit {DRIFT:g}: {self._remedy}"
            )
        if run.largest > 0.0:
            run.share = share

    def refuse_drift(self, run):
        """Refuse a whole run whose energy drift exceeds `DRIFT`; `OpenBook`."""
        refuse_open(run, DRIFT, self._remedy)

    @property
    def _remedy(self):
        return f"use a smaller rtol than {self.rtol:g}"

    @contextlib.contextmanager
    def _told(self, run):
        """Tell where a method stopped, and what moves there."""
        try:
            yield
        except Stopped as stop:
            if self._wrong is not None:
                self._refuse_endless(*self._wrong)
            x, v = run.x, run.v
            force = np.where(self._held, 0.0, self.system.force(run.time, x, v))
            row = int(np.argmax(np.linalg.norm(force, axis=1)))
            raise SolverError(
                f"{self.method} stopped at t = {run.reached:.6g} s with steps of {run.step:.3g} s: "
                f"{str(stop).rstrip('.')}; "
                f"the largest force that moves anything is at {self.system.row_name(row)}: raise rtol = {self.rtol:g}, "
                "or lower the stiffness that asks for such steps"
            ) from None


class Stopped(Exception):
    """A method takes no further step; what it says is the reason."""


def scales(system):
    """Displacement [m] and velocity [m/s] that tolerances are relative to where the state is near zero.

    A strain of 1e-3 in the shortest element, and the velocity at which its ends take that up: 1e-3 of the speed of
    sound in the fastest element.
    """
    net, length = system.net, system.natural_length(0.0)
    mass = np.maximum(np.bincount(net.cells.ravel(), minlength=system.rows), 1)
    light = np.where(net.mass > 0.0, net.mass, np.inf) / mass
    least = light[net.cells].min(axis=1)
    rate = np.sqrt(net.line_data[:, 1] / length / np.where(np.isfinite(least), least, np.inf)).max(initial=0.0)
    near = 1e-3 * length.min()
    return near, near * rate if rate > 0.0 else near


def refuse_massless(system, method):
    """Refuse free nodes without mass, for a method that divides by it."""
    bare = np.flatnonzero((system.net.mass <= 0.0) & ~system.supported.all(axis=1))
    if len(bare):
        raise InputError(
            f"node {bare[0]} has no mass, which {method} needs: give density > 0 or a [[point_mass]], or use "
            'method = "ida"'
        )
