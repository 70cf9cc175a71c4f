"""Explicit dynamics: central differences as kick, drift, kick, in one compiled loop.

    v ← v + ½h f/m,   x ← x + h v,   f ← f(t + h, x),   v ← v + ½h f/m

The loop calls the kernels of all effects through typed lists and tracks peaks in every step; Python sees history rows
only. The step comes from Gershgorin's bound on the largest frequency, 2/√(max row sum of M⁻¹K), with K's lines at their
taut stiffness and the lines that a body can reach within the row at their contact stiffness.

Below that bound a slack chain in contact can still gain energy by many orders, and look plausible afterwards. So the
book of energies is checked at every row: ``|ΔE − work|`` above `DRIFT` of the largest energy ends the run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from ...errors import InputError, OpenBook, SolverError
from ...kernels import BOUND, ENERGY, FORCE, INDICES, LINES, MATRIX, VECTOR, typed_list
from ...results.probes import INTEGERS, PLACE, PROBE
from .energy_book import DRIFT, book_energies, no_energy, refuse_open
from .events import event_rows, starts_above
from .explicit_loop import BREATH, LOOKS, advance, rows_ahead, set_lengths
from .extremes import Extremes
from .integrator import MAX_STEPS_PER_ROW, Course, History, Integrator, Variant
from .step_bound import no_bound, step_bound

TWIN_STEPS = math.sqrt(2.0)
"""Steps of a twin over those of a run: with a method of order 2 it has half the error."""
STATE = ("time", "nsteps", "step", "energy", "largest", "worst", "share")
"""Numbers of a course that the loop writes."""


@dataclass(eq=False, kw_only=True)
class ExplicitCourse(Course):
    """State of an explicit run; a run that goes on from it is the same run bit for bit.

    The compiled loop works in its arrays.

    Attributes
    ----------
    force : ndarray, shape (rows, 3)
        Force [N], last seen with the velocity at half a step.
    before : ndarray, shape (3, rows, 3)
        Displacement, velocity and force at the row before.
    """

    force: np.ndarray
    before: np.ndarray | None = field(default=None, metadata={"saved": False})

    def __post_init__(self):
        self.before = np.stack([self.x, self.v, self.force])


class CentralDifference(Integrator):
    """Central differences on one system.

    Parameters
    ----------
    system : refweb.system.system.System
        Of order 1, with lumped mass.
    probes : sequence of refweb.results.probes.Probe
        What to look at, in every row and, with a sign, in every step.
    sums : sequence of refweb.dynamics.integrators.integrator.Sum
        Energies to look at, likewise.
    events : sequence of refweb.dynamics.integrators.events.Event
        What to report the time of, to the step.
    safety : float
        Share of the step bound, 0 < safety ≤ 1.
    step_size : float, optional
        A fixed step instead [s], at most the bound.
    finer : float
        Number of steps of each row over what the other arguments make of it, ≥ 1.

    Raises
    ------
    InputError
        For curved elements, a consistent mass, links, a free row without mass, or a step above the bound.
    """

    method, order, stretch = "central-difference", 2, 1.0
    knob, retry, beside = "safety", 0.5, True
    breathe = staticmethod(lambda t: None)
    variants = {"central-difference": Variant(kind="splitting")}
    kicks, drifts = np.array([0.5, 0.5]), np.array([1.0])

    def __init__(self, system, probes=(), sums=(), events=(), safety=0.5, step_size=None, finer=1.0):
        self.system, self.safety, self.step_size, self.finer = system, safety, step_size, finer
        self.observed = tuple(probes), tuple(sums), tuple(events)
        net, free = system.net, ~system.supported
        if net.order > 1:
            raise InputError(
                f"[cable] order = {net.order} must be 1 with {self.method}: its bound of stability is that of straight "
                f"elements; use subdivide = {net.order * net.subdivide}, which has the "
                'same nodes, or method = "cvode"'
            )
        if net.consistent_minus_lumped is not None:
            raise InputError(
                f'[solve] mass = "consistent" must be "lumped" with {self.method}: an explicit step divides each '
                'force by one mass, and a matrix would have to be solved; use method = "cvode"'
            )
        if system.constraints:
            raise InputError(f'[[link]] needs method = "ida": {self.method} does not hold lengths')
        bare = np.flatnonzero((net.mass <= 0.0) & free.any(axis=1))
        if len(bare):
            raise InputError(
                f"node {bare[0]} has no mass, which {self.method} needs: give density > 0 or a [[point_mass]]"
            )
        families, drives = system.families, system.drives
        self._outs = system.per_cell()
        self._lines = net.line_data.copy() if system.line_drives else net.line_data  # lengths change in this run's own
        numbers = [self._lines if f.lines else f.data for f in families]
        inverse = np.where(free, 1.0 / np.where(net.mass > 0.0, net.mass, 1.0)[:, None], 0.0)
        reeled = np.unique(np.concatenate([[], *(d.cells[:, 0] for d in system.line_drives)])).astype(np.int64)
        driven = np.concatenate([[], *(d.cells[:, 0] for d in drives)]).astype(np.int64)
        viscous = [i for i, f in enumerate(families) if f.damping is not None]
        still = [i for i in range(1, len(families)) if i not in viscous]
        powered = [(i, f.power, i in viscous) for i, f in enumerate(families) if f.power is not None]
        self._working = system.working
        self._masses = (net.mass, inverse)
        self._moving = np.flatnonzero(free.any(axis=1))
        self._ends = (
            np.flatnonzero(system.supported),
            driven,
            self._working,
            np.array(powered, dtype=np.int64).reshape(len(powered), 3),
            np.array(still, dtype=np.int64),
            np.array(viscous, dtype=np.int64),
        )
        self._cells = typed_list(INDICES, [f.cells for f in families])
        self._data = typed_list(MATRIX, numbers)
        self._forces = (typed_list(FORCE, [f.force for f in families]), self._cells, self._data)
        self._seen = typed_list(MATRIX, self._outs)
        self._energies = (
            typed_list(ENERGY, [f.energy or no_energy for f in families]),
            typed_list(VECTOR, [np.zeros(len(f.cells)) for f in families]),
        )
        self._bounds = typed_list(BOUND, [f.bound or no_bound for f in families])
        self._dampings = typed_list(BOUND, [families[i].damping_bound or no_bound for i in viscous])
        self._drives = (
            typed_list(FORCE, [d.kernel for d in drives]),
            typed_list(INDICES, [d.cells for d in drives]),
            typed_list(MATRIX, [d.data for d in drives]),
            typed_list(MATRIX, [np.zeros((len(d.cells), 0)) for d in drives]),
            net.natural_length[reeled],
            reeled,
            net.line_data[reeled],
            typed_list(LINES, [d.kernel for d in system.line_drives]),
            typed_list(INDICES, [np.searchsorted(reeled, d.cells).astype(np.int32) for d in system.line_drives]),
            typed_list(MATRIX, [d.data for d in system.line_drives]),
            net.cells[reeled],
            typed_list(ENERGY, [system.length_force_kernel] if system.line_drives else []),
        )
        corners = {t for d in system.line_drives for t in d.times}
        self._corners = np.array([*sorted(corners), *([np.inf] if system.line_drives else []), -np.inf])
        signs = np.array([float(one.sign) for one in (*probes, *sums)])
        weights = [one.weights for one in sums]
        self._watch = np.array(weights, dtype=float).reshape(len(sums), len(families) + 3)
        self._events = event_rows(events)
        self._probes = (
            typed_list(PROBE, [probe.kernel for probe in probes]),
            typed_list(INTEGERS, [np.array(probe.rows, dtype=np.int64) for probe in probes]),
            typed_list(MATRIX, [np.ascontiguousarray(probe.data, dtype=float) for probe in probes]),
            signs,
            np.flatnonzero(signs[: len(probes)]),
        )
        if step_size is not None and step_size > (limit := self.stretch * self.bound()):
            raise InputError(f"[solve] step_size = {step_size:g} must be ≤ {limit:.6g} [s], the bound of stability")

    def bound(self, x=None, reach=np.inf):
        """Largest stable step [s] at displacement x, with what bodies can touch within ``reach`` [m], at any time."""
        x = np.zeros((self.system.rows, 3)) if x is None else x
        rest = np.empty(self.system.rows), self._bounds, self._ends[5], self._dampings, self._cells, self._data
        limit = np.inf
        for corner in self._corners:
            self._set_lengths(max(corner, 0.0))
            limit = min(limit, step_bound(reach, 0.0, x, self._masses[0], self._moving, *rest))
        return limit

    def evaluations(self, duration):
        """Evaluations of forces that a duration [s] takes, by the bound of its start."""
        step = self.step_size or self.safety * self.stretch * self.bound()
        return len(self.drifts) * self.finer * duration / step

    def _set_lengths(self, t):
        if self.system.line_drives:
            set_lengths(t, *self._drives[4:10], self._lines)

    def spent(self, course):
        """What a course has spent, for ``run.json``.

        The evaluations are those of forces that follow from displacement: others are evaluated more often in a step.
        """
        follows = len(self._probes[4]) + len(self._watch) > 0  # and evaluates forces where it looks
        per_step = len(self.drifts) + (LOOKS - 1 if follows and len(self.drifts) > 1 else 0)
        return dict(nfev=per_step * course.nsteps + 1, njev=0, nlu=0)

    def start(self, x=None, v=None):
        """The `ExplicitCourse` at t = 0, see `refweb.dynamics.integrators.integrator.Integrator.start`."""
        system = self.system
        force = np.zeros((system.rows, 3))
        x = np.zeros_like(force) if x is None else np.array(x, dtype=float, order="C")
        v = system.initial_velocity() if v is None else np.array(v, dtype=float, order="C")
        v[system.supported] = 0.0
        system.drive(0.0, x, v)
        self._set_lengths(0.0)
        for family, data, out in zip(system.families, self._data, self._outs, strict=True):
            family.force(0.0, x, v, force, family.cells, data, out)
        signs, probes = self._probes[3], self.observed[0]
        values, where = np.zeros(len(signs)), np.full((len(signs), 2), PLACE)
        for i, probe in enumerate(probes):
            rows, data = np.array(probe.rows, dtype=np.int64), np.ascontiguousarray(probe.data, dtype=float)
            values[i] = probe.kernel(0.0, x, v, force, self._outs.lines, rows, data, where[i])
        total, book = np.zeros(len(system.families) + 3), np.zeros(len(system.families) + 1)
        numbers = (self._masses[0], self._cells, self._data, *self._energies, book, self._working)
        book_energies(0.0, x, v, *numbers, total)
        values[len(probes) :] = self._watch @ total
        stepping = len(probes) + np.flatnonzero(self._watch[:, -1])
        values[stepping] = -np.inf * signs[stepping]  # no step has been taken
        events = self._events.copy()
        for event in events:
            starts_above(event, values[event["slot"]])
        own = np.delete(total[:-2], np.flatnonzero(self._working > 0))
        extremes = Extremes.at_start(values, where[:, 0].copy())
        book = dict(work=book, energy=own.sum(), largest=np.abs(own).sum())
        return ExplicitCourse(time=0.0, x=x, v=v, force=force, extremes=extremes, events=events, **book)

    def save(self, course):
        """The `ExplicitCourse` as arrays by name, for a checkpoint."""
        return course.arrays()

    def load(self, arrays):
        """The `ExplicitCourse` of a checkpoint."""
        return ExplicitCourse.of_arrays(arrays)

    @property
    def _keys(self):
        return dict(safety=self.safety, step_size=self.step_size)

    def refined(self, by=None):
        """The method with ``by`` times the steps, by default `TWIN_STEPS`."""
        finer = self.finer * (TWIN_STEPS if by is None else by)
        return type(self)(self.system, *self.observed, **self._keys, finer=finer)

    def error_share(self, course, finer):
        """Error of a finer run over that of this one.

        By the steps really taken, at order 2: of a higher one peaks, contact and slack lines leave no more.
        """
        if not finer.nsteps:
            return 0.5
        return (course.nsteps / course.time / (finer.nsteps / finer.time)) ** 2

    def next_knob(self, share):
        """Factor on the safety for errors that are ``share`` times what they may be."""
        return min(max(0.8 * share ** (-1.0 / self.order), 0.125), 0.5)

    def _seen_in(self, course):
        return (*self._probes, course.extremes, course.work, course.impulse)

    def advance(self, course, times):
        """Take a course to each of some times; equal steps lead to each.

        See `refweb.dynamics.integrators.integrator.Integrator.advance`; a `SolverError` for a number that is not finite
        names node, line and time.
        """
        times = np.atleast_1d(np.asarray(times, dtype=float))
        history = History.empty(len(times), len(self._probes[0]), self.system.families)
        step, start, linear = self.step_size or 0.0, course.time, self.system.rows - self.system.net.spins
        least = 1.0 if self.step_size else 0.5 / self.safety
        work = len(self.drifts) * sum(len(family.cells) for family in self.system.families)
        done, part, breath = 0, np.zeros(2, dtype=np.int64), max(BREATH // max(work, 1), 1)
        carried = self._carried()
        state = np.array([getattr(course, name) for name in STATE], dtype=float)
        try:
            while True:
                more = rows_ahead(
                    times[done:], breath, part, *carried, self.safety * self.stretch, least, step, self.finer, DRIFT,
                    self.kicks, self.drifts, state, course.x, course.v, course.force, course.before, linear,
                    *self._masses, self._moving, *self._ends, *self._forces, self._seen, *self._energies, self._bounds,
                    self._dampings, *self._drives, self._corners, *self._seen_in(course), self._watch, course.events,
                    history.values[done:],
                )  # fmt: skip
                if more < 0:
                    raise SolverError(
                        f"the step at t = {state[0]:.6g} s is {state[2]:.3g} s, more than {MAX_STEPS_PER_ROW:g} steps "
                        "to the next row: ask for shorter rows, or lower the stiffness that asks for the step"
                    )
                done += more
                if not part[0]:
                    break
                self.breathe(state[0] + part[0] * state[2])
        except BaseException:
            if part[0]:  # back to the last row
                course.x[:], course.v[:], course.force[:] = course.before
            raise
        finally:
            for name, value in zip(STATE, state.tolist(), strict=True):
                setattr(course, name, value)
            course.nsteps = int(course.nsteps)
        if done and course.stopped and history.time[done - 1] == course.time:
            return history[:done]
        if done < len(times):
            before = times[done - 1] if done else start
            if not np.isfinite(history.values[done]).all():
                self._name_blow_up(course, before)
            self._name_drift(course, before)
        return history

    def _carried(self):
        return np.zeros(len(self.system.families)), np.zeros((2, len(self._drives[4])))

    def _name_blow_up(self, course, before):
        """Replay the last row step by step and name the first number that is not finite."""
        system, h = self.system, course.step
        net = system.net
        x, v, f = course.before.copy()
        count, total = round((course.time - before) / h), np.zeros(len(system.families) + 3)
        for step in range(1, count + 1):
            advance(
                1, 0, *self._carried(), h, before + (step - 1) * h, self.kicks, self.drifts, x, v, f, *self._masses,
                *self._ends, *self._forces, self._seen, *self._drives, *self._seen_in(course), *self._energies,
                self._watch, total, self._events[:0],
            )  # fmt: skip
            wrong = ~np.isfinite(x + v + f).all(axis=1)
            if wrong.any():
                row = int(np.flatnonzero(wrong)[0])
                name = self.system.row_name(row)
                lines = net.line[(net.cells == row).any(axis=1)]
                name += f", line {lines[0]}," if len(lines) else ""
                raise SolverError(f"number not finite at {name} t = {before + step * h:.6g} s: use a smaller safety")
        raise SolverError(f"energy not finite at t = {course.time:.6g} s: use a smaller safety")

    def _name_drift(self, course, before):
        """Say where energy came in: the effect and cell whose energy grew most in the last row."""
        system, most, of, cell = self.system, -np.inf, self.system.families[0], 0
        for family in system.families:
            if family.energy is not None and family.book != "work":
                now = system.energy_of(family, course.time, course.x)
                change = now - system.energy_of(family, before, course.before[0])
                if change.max(initial=-np.inf) > most:
                    most, of, cell = change.max(), family, int(change.argmax())
        if of.cells.shape[1] > 1:
            place = f"line {system.net.line[np.isin(system.net.cells, of.cells[cell]).sum(axis=1).argmax()]}"
        else:
            place = self.system.row_name(of.cells[cell, 0])
        raise OpenBook(
            f"energy drift {course.drift:.3g} of the largest energy between t = {before:.6g} and {course.time:.6g} s, "
            f"limit {DRIFT:g}: energy came in with {of.name} at {place}; {self._remedy}"
        )

    @property
    def _remedy(self):
        step = self.step_size
        return f"use a smaller step_size than {step:g}" if step else f"use a smaller safety than {self.safety:g}"

    def refuse_drift(self, course):
        """Refuse a whole run whose energy drift exceeds `DRIFT`; `OpenBook`."""
        refuse_open(course, DRIFT, self._remedy)
