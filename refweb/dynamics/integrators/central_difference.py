"""Explicit dynamics: central differences as kick, drift, kick, in one compiled loop.

    v ← v + ½h f/m,   x ← x + h v,   f ← f(t + h, x),   v ← v + ½h f/m

The loop calls the kernels of all effects through typed lists and tracks peaks in every step; Python sees history rows
only. The step comes from Gershgorin's bound on the largest frequency, 2/√(max row sum of M⁻¹K), with K's lines at their
taut stiffness and the lines that a body can reach within the row at their contact stiffness.

Below that bound a slack chain in contact can still gain energy by many orders, and look plausible afterwards. So the
book of energies is checked at every row: ``|ΔE − work|`` above `DRIFT` of the largest energy ends the run.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import InputError, OpenBook, SolverError
from ...kernels import BOUND, ENERGY, FORCE, INDICES, LINES, MATRIX, VECTOR, typed_list
from ...results.probes import INTEGERS, PLACE, PROBE
from .explicit_loop import (
    BREATH,
    DRIFT,
    LOOKS,
    MOST,
    SLOT,
    advance,
    begins,
    book_energies,
    ended_by,
    event_table,
    no_bound,
    no_energy,
    refuse_open,
    rows_ahead,
    set_lengths,
    step_bound,
)


@dataclass(eq=False)
class Run:
    """The whole state of an explicit run; a run resumed from it is the same run bit for bit.

    Attributes
    ----------
    state : ndarray
        Time [s], steps taken, last step [s], energy at the start [J], largest energy [J], worst drift [J].
    saved : ndarray, shape (6, rows, 3)
        Displacement [m], velocity [m/s] and force [N], and the same at the row before.
    peaks, times, places : ndarray, shape (probes,)
        Extreme value of each probe, its time, and the row or element it stands at.
    work : ndarray, shape (families + 1,)
        Work of each family that is booked by its power and, last, of motion [J].
    impulse : ndarray, shape (3,)
        Impulse of the supports on the net [N s].
    events : ndarray, shape (events, 6)
        What each event has come to, see `refweb.dynamics.integrators.explicit_loop`.
    recent : ndarray, shape (probes, 4)
        Time and value of each probe when it was last looked at, twice, for methods of higher order.
    """

    state: np.ndarray
    saved: np.ndarray
    peaks: np.ndarray
    times: np.ndarray
    places: np.ndarray
    work: np.ndarray
    impulse: np.ndarray
    events: np.ndarray
    recent: np.ndarray

    @property
    def stopped(self):
        """Whether an event has ended the run."""
        return bool(ended_by(self.events))

    @property
    def time(self):
        """Time [s]."""
        return float(self.state[0])

    @property
    def nsteps(self):
        """Steps taken."""
        return int(self.state[1])

    @property
    def x(self):
        """Displacement [m], shape (rows, 3)."""
        return self.saved[0]

    @property
    def v(self):
        """Velocity [m/s], shape (rows, 3)."""
        return self.saved[1]

    @property
    def drift(self):
        """Largest |ΔE − work| over the largest energy [1]."""
        return float(self.state[5] / self.state[4]) if self.state[4] > 0.0 else 0.0


class CentralDifference:
    """Central differences on one system.

    Parameters
    ----------
    system : refweb.system.system.System
        Of order 1, with lumped mass.
    probes : sequence of (probe, rows, data, sign)
        What to look at, see `refweb.results.probes`: at every row, and with sign 1 (−1) the largest (smallest) value
        over all steps.
    watch : sequence of (weights, sign)
        Sums to follow in every step: weights of (energy of each family, kinetic energy, work, step size).
    safety : float
        Share of the step bound, 0 < safety ≤ 1.
    step_size : float, optional
        A fixed step instead [s], at most the bound.
    events : sequence of (slot, level, rising, stop)
        What to report the time of, to the step: the value of a probe, or behind those of a sum, passes a level, upwards
        if ``rising`` is true; with ``stop`` the run ends there.
    finer : float
        Number of steps of each row over what the other arguments make of it, ≥ 1.

    Raises
    ------
    InputError
        For curved elements, a consistent mass, links, a free row without mass, or a step above the bound.
    """

    method, order, stretch = "central-difference", 2, 1.0
    breathe = staticmethod(lambda t: None)
    """What is called with the time some times a second, and may raise."""
    kicks, drifts = np.array([0.5, 0.5]), np.array([1.0])

    def __init__(self, system, probes=(), watch=(), events=(), safety=0.5, step_size=None, finer=1.0):
        self.system, self.safety, self.step_size, self.finer = system, safety, step_size, finer
        net, free = system.net, ~system.supported
        if net.order > 1:
            raise InputError(
                f"[cable] order = {net.order} must be 1 with {self.method}: its bound of stability is that of straight "
                f"elements; use subdivide = {net.order * net.subdivide}, which has the "
                'same nodes, or method = "cvode"'
            )
        if net.spread is not None:
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
        self._outs = system.outs()
        numbers = [f.data for f in families]
        if system.line_drives:  # lengths change in a copy of this run's own
            lines = net.line_data.copy()
            numbers = [lines if data is net.line_data else data for data in numbers]
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
            system.length[reeled],
            reeled,
            net.line_data[reeled],
            typed_list(LINES, [d.kernel for d in system.line_drives]),
            typed_list(INDICES, [np.searchsorted(reeled, d.cells).astype(np.int32) for d in system.line_drives]),
            typed_list(MATRIX, [d.data for d in system.line_drives]),
            net.cells[reeled],
            typed_list(ENERGY, [system.by_length] if system.line_drives else []),
        )
        corners = {t for d in system.line_drives for t in d.times}
        self._corners = np.array([*sorted(corners), *([np.inf] if system.line_drives else []), -np.inf])
        signs = np.array([float(p[-1]) for p in (*probes, *watch)])
        self._watch = np.array([w[0] for w in watch], dtype=float).reshape(len(watch), len(families) + 3)
        self._seeing, self._events = list(probes), event_table(events)
        self._probes = (
            typed_list(PROBE, [p[0] for p in probes]),
            typed_list(INTEGERS, [np.array(p[1], dtype=np.int64) for p in probes]),
            typed_list(MATRIX, [np.ascontiguousarray(p[2], dtype=float) for p in probes]),
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

    def _set_lengths(self, t):
        if self.system.line_drives:
            set_lengths(t, *self._drives[4:10], self._data[0])

    def spent(self, run):
        """What a run has spent, for ``run.json``.

        The evaluations are those of forces that follow from displacement: others are evaluated more often in a step.
        """
        follows = len(self._probes[4]) + len(self._watch) > 0  # and evaluates forces where it looks
        per_step = len(self.drifts) + (LOOKS - 1 if follows and len(self.drifts) > 1 else 0)
        return dict(nfev=per_step * run.nsteps + 1, njev=0, nlu=0)

    def start(self, x=None, v=None):
        """The `Run` at t = 0, from the web's position and the scene's velocities unless x and v say otherwise."""
        system = self.system
        saved = np.zeros((6, system.rows, 3))
        saved[0] = 0.0 if x is None else x
        saved[1] = system.initial_velocity() if v is None else v
        saved[1][system.supported] = 0.0
        system.drive(0.0, saved[0], saved[1])
        self._set_lengths(0.0)
        for family, data, out in zip(system.families, self._data, self._outs, strict=True):
            family.force(0.0, saved[0], saved[1], saved[2], family.cells, data, out)
        signs, probes = self._probes[3], self._seeing
        values, where = np.zeros(len(signs)), np.full((len(signs), 2), PLACE)
        for i, (probe, rows, data, _) in enumerate(probes):
            rows, data = np.array(rows, dtype=np.int64), np.ascontiguousarray(data, dtype=float)
            values[i] = probe(0.0, saved[0], saved[1], saved[2], self._outs[0], rows, data, where[i])
        total, book = np.zeros(len(system.families) + 3), np.zeros(len(system.families) + 1)
        numbers = (self._masses[0], self._cells, self._data, *self._energies, book, self._working)
        book_energies(0.0, saved[0], saved[1], *numbers, total)
        values[len(probes) :] = self._watch @ total
        stepping = len(probes) + np.flatnonzero(self._watch[:, -1])
        values[stepping] = -np.inf * signs[stepping]  # no step has been taken
        events = self._events.copy()
        for event in events:
            begins(event, values[int(event[SLOT])])
        own = np.delete(total[:-2], np.flatnonzero(self._working > 0))
        state = np.array([0.0, 0.0, 0.0, own.sum(), np.abs(own).sum(), 0.0, np.inf])
        none, recent = np.zeros(len(signs)), np.full((len(signs), 4), np.nan)
        recent[:, 2], recent[:, 3] = 0.0, values
        return Run(state, saved, values, none, where[:, 0].copy(), book, np.zeros(3), events, recent)

    def save(self, run):
        """The `Run` as arrays by name, for a checkpoint."""
        return vars(run)

    def load(self, arrays):
        """The `Run` of a checkpoint."""
        return Run(**arrays)

    def _peaks(self, run):
        return (*self._probes, run.peaks, run.times, run.places, run.recent, run.work, run.impulse)

    def advance(self, run, ends):
        """Advance a run to each time of ``ends`` in turn; equal steps lead to each.

        Returns
        -------
        ndarray, shape (rows, columns)
            Time, value of each probe, energy of each family, kinetic energy, work, step size, momentum of all that is
            free and impulse of the supports (3 columns each). Fewer rows than times where an event ends the run.

        Raises
        ------
        OpenBook
            Where the energy drift exceeds `DRIFT` and does not fall.
        SolverError
            At the first number that is not finite; names node, line and time.
        """
        ends = np.atleast_1d(np.asarray(ends, dtype=float))
        history = np.zeros((len(ends), 1 + len(self._probes[0]) + len(self.system.families) + 9))
        step, start, linear = self.step_size or 0.0, run.time, self.system.rows - self.system.net.spins
        least = 1.0 if self.step_size else 0.5 / self.safety
        work = len(self.drifts) * sum(len(family.cells) for family in self.system.families)
        done, part, breath = 0, np.zeros(2, dtype=np.int64), max(BREATH // max(work, 1), 1)
        carried = self._carried()
        try:
            while True:
                more = rows_ahead(
                    ends[done:], breath, part, *carried, self.safety * self.stretch, least, step, self.finer, DRIFT,
                    self.kicks, self.drifts, run.state, run.saved, linear, *self._masses, self._moving, *self._ends,
                    *self._forces, self._seen, *self._energies, self._bounds, self._dampings, *self._drives,
                    self._corners, *self._peaks(run), self._watch, run.events, history[done:],
                )  # fmt: skip
                if more < 0:
                    raise SolverError(
                        f"the step at t = {run.time:.6g} s is {run.state[2]:.3g} s, more than {MOST:g} steps to the "
                        "next row: ask for shorter rows, or lower the stiffness that asks for the step"
                    )
                done += more
                if not part[0]:
                    break
                self.breathe(run.time + part[0] * run.state[2])
        except BaseException:
            if part[0]:  # back to the last row
                run.saved[:3] = run.saved[3:]
            raise
        if done and run.stopped and history[done - 1, 0] == run.time:
            return history[:done]
        if done < len(ends):
            before = ends[done - 1] if done else start
            if not np.isfinite(history[done]).all():
                self._name_blow_up(run, before)
            self._name_drift(run, before)
        return history

    def _carried(self):
        return np.zeros(len(self.system.families)), np.zeros((2, len(self._drives[4])))

    def _name_blow_up(self, run, before):
        """Replay the last row step by step and name the first number that is not finite."""
        system, h = self.system, run.state[2]
        net = system.net
        x, v, f = run.saved[3:].copy()
        count, total = round((run.time - before) / h), np.zeros(len(system.families) + 3)
        for step in range(1, count + 1):
            advance(
                1, 0, *self._carried(), h, before + (step - 1) * h, self.kicks, self.drifts, x, v, f, *self._masses,
                *self._ends, *self._forces, self._seen, *self._drives, *self._peaks(run), *self._energies,
                self._watch, total, self._events[:0],
            )  # fmt: skip
            wrong = ~np.isfinite(x + v + f).all(axis=1)
            if wrong.any():
                row = int(np.flatnonzero(wrong)[0])
                name = self.system.row_name(row)
                lines = net.line[(net.cells == row).any(axis=1)]
                name += f", line {lines[0]}," if len(lines) else ""
                raise SolverError(f"number not finite at {name} t = {before + step * h:.6g} s: use a smaller safety")
        raise SolverError(f"energy not finite at t = {run.time:.6g} s: use a smaller safety")

    def _name_drift(self, run, before):
        """Say where energy came in: the effect and cell whose energy grew most in the last row."""
        system, most, of, cell = self.system, -np.inf, self.system.families[0], 0
        for family in system.families:
            if family.energy is not None and family.book != "work":
                change = system.energy_of(family, run.time, run.x) - system.energy_of(family, before, run.saved[3])
                if change.max(initial=-np.inf) > most:
                    most, of, cell = change.max(), family, int(change.argmax())
        if of.cells.shape[1] > 1:
            place = f"line {system.net.line[np.isin(system.net.cells, of.cells[cell]).sum(axis=1).argmax()]}"
        else:
            place = self.system.row_name(of.cells[cell, 0])
        raise OpenBook(
            f"energy drift {run.drift:.3g} of the largest energy between t = {before:.6g} and {run.time:.6g} s, limit "
            f"{DRIFT:g}: energy came in with {of.name} at {place}; {self._remedy}"
        )

    @property
    def _remedy(self):
        step = self.step_size
        return f"use a smaller step_size than {step:g}" if step else f"use a smaller safety than {self.safety:g}"

    def refuse_drift(self, run):
        """Refuse a whole run whose energy drift exceeds `DRIFT`; `OpenBook`."""
        refuse_open(run, DRIFT, self._remedy)
