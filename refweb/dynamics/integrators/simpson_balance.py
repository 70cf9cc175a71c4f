"""Dense output of any method, and books of energy and momentum along it: work and impulse by Simpson's rule.

A piece of a step is known at its start, in its middle and at its end, and by the method at any time within. The
parabolas through the powers there, through what supports give and what pulls on lines that change their length, are
integrated to any time within. Where Simpson's rule and the trapezoidal one differ too much, as where damped lines go
slack in a long step, a piece is to be halved: `SimpsonBalance.uneven` tells so, and `step_observer` halves it.
`SimpsonBalance.close` refuses a balance that does not close, `refuse_endless` forces that are not finite. Explicit
steps book what each kick and drift gives instead, which closes to rounding, see
`refweb.dynamics.integrators.energy_balance`.

`step_observer` makes the book, and hands its own state over as ``course``. May change: `UNEVEN`, which trades cost for
the error of the balance. Must stay: the last seven entries of ``flow`` and ``before`` are work of motion, impulse of
supports and impulse from outside: `step_observer` splits integrals by these places, and `rates` adds there what
`system.material_flow` brings; fields of `Sample` and `Piece`, which `measurements`, `events` and `passages` read;
public names of `SimpsonBalance`, which other files use. Tests: ``tests/dynamics/integrators/test_step_observer.py``,
``test_cvode.py``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...compiled.kernel import prepare
from ...effects.sliding_material import BEHIND
from ...errors import EnergyDriftError, IntegrationError
from ...kernels import ENERGY, INDICES, MATRIX, VECTOR, Arrays, Functions
from ...net.rotation import RigidRotations, more_kinetic
from .energy_balance import DRIFT, book_energies, drifts_away, least_energy, no_energy, own_energies
from .features import of_balances
from .momentum_balance import Outside, note_momentum, open_balance

UNEVEN = 1e-3
"""Largest share of the energy by which the work in a piece may differ between Simpson's and the trapezoidal rule."""


class Sample:
    """A system at an instant.

    Parameters
    ----------
    system : refweb.system.system.System
        The system.
    time : float
        Time [s].
    x, v : ndarray, shape (rows, 3)
        Displacement [m] and velocity [m/s] of each row.

    Attributes
    ----------
    force : ndarray, shape (rows, 3)
        Force on each row [N]; what supports give is its negative.
    per_cell : refweb.system.forces.PerCell
        Output of the terms for their cells.
    rates : Rates or None
        Its rates, where the next piece begins with them.
    """

    def __init__(self, system, time, x, v):
        self._system, self.time, self.x, self.v = system, time, x, v
        self.rates: Rates | None = None
        self.force, self.per_cell = system.balance(time, x, v)
        refuse_endless(system, time, self.force)

    @classmethod
    def behind(cls, system, time, x, v):
        """The sample behind a corner of tables of reels; that at the time where there is none."""
        sample = cls(system, time * BEHIND if system.net.flows else time, x, v)
        sample.time = time
        return sample

    @cached_property
    def felt(self):
        """Contact that bodies feel, see `refweb.system.contact_forces.ContactForces.of`."""
        return self._system.contact_forces.of(self.per_cell)


class Rates(NamedTuple):
    """Rates that are integrated.

    Attributes
    ----------
    flow : ndarray, shape (terms + 7,)
        Power of each term and of motion [W]; the force of the supports, and of what acts from outside without a
        formula of its impulse [N].
    lengths, length_force : ndarray or None
        Natural lengths [m], and ∂E/∂L of each [N]; none where nothing changes them. Masses that follow reels are among
        them, and then four rows have the energy and the momentum that come with each.
    """

    flow: np.ndarray
    lengths: Any = None
    length_force: Any = None


class Piece(NamedTuple):
    """A part of a step, from where a course is, with its dense output.

    Attributes
    ----------
    start, middle, end : Sample
        The system there; at the end with the velocities behind a jump.
    rates : tuple of Rates
        At the start, in the middle and at the end, ahead of a jump.
    before : ndarray, shape (terms + 7,)
        Work of each term and of motion [J], impulse of the supports and of what is integrated along the steps [N s]
        until the start.
    step : float
        Size of the step that it is a part of [s].
    jump : ndarray or None
        Change of these by a jump of velocities at its end, at the corner of a motion.
    at : callable
        The `Sample` at a time within the step.
    """

    start: Sample
    middle: Sample
    end: Sample
    rates: tuple[Rates, Rates, Rates]
    before: np.ndarray
    step: float
    jump: np.ndarray | None
    at: Callable[..., Any]

    def booked(self, t):
        """Integrals until a time within, of the kind of ``before``."""
        width = self.end.time - self.start.time
        s = (t - self.start.time) / width
        a, b, c = s - 1.5 * s**2 + s**3 / 1.5, 2.0 * s**2 - s**3 / 0.75, s**3 / 1.5 - 0.5 * s**2
        start, middle, last = self.rates
        booked = self.before + width * (a * start.flow + b * middle.flow + c * last.flow)
        if start.lengths is not None:
            pull = a * start.length_force + b * middle.length_force + c * last.length_force
            brought = np.atleast_1d(pull @ (last.lengths - start.lengths))
            booked[[-7, -3, -2, -1][: len(brought)]] += brought
        return booked if self.jump is None or t != self.end.time else booked + self.jump

    @property
    def unevenness(self):
        """Difference of the work between Simpson's and the trapezoidal rule [J]: of powers, and of natural lengths."""
        (start, middle, last), by_lengths = self.rates, 0.0
        by_powers = (self.end.time - self.start.time) * np.abs(start.flow - 2.0 * middle.flow + last.flow)[:-6].sum()
        if start.lengths is not None:
            curved = np.atleast_2d(start.length_force - 2.0 * middle.length_force + last.length_force)[0]
            by_lengths = np.abs(curved * (last.lengths - start.lengths)).sum()
        return np.array([by_powers, by_lengths]) / 12.0


class SimpsonBalance:
    """The books of one system.

    Parameters
    ----------
    system : refweb.system.system.System
        The system.
    hold : callable
        ``hold(x, v)`` moves a state to the nearest one that the equations allow.
    fast : float
        Velocity [m/s] below which nothing is held to be moving.
    uneven : float
        As `UNEVEN`, of the work of natural lengths that change.
    """

    def __init__(self, system, hold, fast, uneven=UNEVEN):
        self.system, self._hold = system, hold
        self._uneven = np.array([UNEVEN, uneven])
        self._linear, self._turns = system.rows - system.net.spins, RigidRotations.of(system.net)
        self.least_energy = least_energy(system, self._turns)
        self._still = system.net.mass[: self._linear].sum() * fast
        terms = system.terms
        self._lines = system.line_data(0.0).matrix.copy()
        self._terms = (
            Arrays(INDICES, [f.cells for f in terms]),
            Arrays(MATRIX, [self._lines if f.over_lines else f.data for f in terms]),
            Functions(ENERGY, [f.energy or no_energy for f in terms]),
            Arrays(VECTOR, [np.zeros(len(f.cells)) for f in terms]),
        )
        self._powered = [(i, f.balance.power) for i, f in enumerate(terms) if f.balance.power is not None]
        self._working = system.working
        self._driven = np.concatenate([[], *(d.cells[:, 0] for d in system.drives)]).astype(np.int64)
        self._outside = Outside.of(system)
        self._pushing = [terms[i] for i in self._outside.pushing]
        self._supported, self._fixed = system.supported, np.flatnonzero(system.fixed)
        self._axes = self._fixed % 3
        prepare([book_energies, open_balance, note_momentum], of_balances(self._turns, self._outside))

    def rates(self, sample):
        """The `Rates` of a sample."""
        system, driven, flow = self.system, self._driven, np.zeros(len(sample.per_cell) + 7)
        for i, column in self._powered:
            flow[i] = sample.per_cell[i][:, column].sum()
        if len(driven):
            flow[-7] = -(sample.force[driven] * sample.v[driven]).sum()
        if len(self._fixed):
            flow[-6:-3] = -np.bincount(self._axes, sample.force.ravel()[self._fixed], 3)
        for term in self._pushing:
            rows = system.force_of(term, sample.time, sample.x, sample.v)
            flow[-3:] += rows[: self._linear].sum(axis=0)
        brought = None
        if system.net.flows:
            material, count = system.material_flow, system.material_flow.by_table
            brought = material.brought(sample.x, sample.v)
            flow[[-7, -3, -2, -1]] += brought[:, count:] @ material.slip_rates(sample.time, sample.x, sample.v)
        if not system.net.factors:
            return Rates(flow)
        lengths, force = system.natural_length(sample.time), system.length_force(sample.time, sample.x)
        if brought is not None and count:
            lengths = np.append(lengths, material.shares(sample.time))
            force = np.hstack([np.vstack([force, np.zeros((3, force.size))]), brought[:, :count]])
        return Rates(flow, lengths, force)

    def piece(self, course, end, at):
        """The `Piece` from where a course is to a time, by the dense output ``at`` of the step.

        At the corner of a motion velocities jump: until then the given ones are those in the middle. At the corner of a
        reel whose mass follows, those of nodes that material slides past jump.
        """
        middle, end = at(0.5 * (course.time + end)), at(end)
        driven, last, jump, before, after = self._driven, end, None, end.v, end.v
        if len(driven) and (end.v[driven] != middle.v[driven]).any():
            before, step = end.v.copy(), np.zeros_like(end.v)
            before[driven] = middle.v[driven]
            if self.system.carriers:
                self.system.carriers.update_attached_nodes(end.x, before)
            step[driven] = end.v[driven] - before[driven]
            after = before + self.system.mass.kick(step)
            after[driven] = end.v[driven]
            if self.system.carriers:
                self.system.carriers.update_attached_nodes(end.x, after)
            self._hold(end.x, after)
            last = Sample(self.system, end.time, end.x, before)
        moved = after
        if self.system.net.flows:
            after = self.system.material_flow.velocity_behind(end.time, end.x, after)
        if after is not before:
            t, x, jump = end.time, end.x, np.zeros(len(course.work) + 6)
            if after is not moved:
                self._hold(x, after)
            end = Sample.behind(self.system, t, x, after)
            jump[-7] = self.kinetic(t, x, after) - self.kinetic(t, x, before)
            jump[-6:-3] = self.momentum(t, x, moved) - self.momentum(t, x, before)
            jump[-3:] = self.momentum(t, x, after) - self.momentum(t, x, moved)
        start, rates = course.sample, (self.rates(middle), self.rates(last))
        rates = start.rates or self.rates(start), *rates
        end.rates = rates[-1] if last is end else None
        before = np.concatenate([course.work, course.impulse, course.ledger.pushed])
        return Piece(start, middle, end, rates, before, course.step, jump, at)

    def uneven(self, course, piece):
        """Tell if powers change too much within a piece."""
        apart, end = piece.unevenness, piece.end
        if (apart <= self._uneven * course.largest).all():
            return False
        done = np.abs(piece.booked(end.time)[:-6]).sum()
        return (apart > self._uneven * max(course.largest, done, self.kinetic(end.time, end.x, end.v))).any()

    def _mass(self, t, x):
        """The `refweb.system.mass.Mass` at time t and displacement x."""
        return self.system.at(t, x).mass if self.system.net.flows else self.system.mass

    def kinetic(self, t, x, v):
        """Kinetic energy [J]."""
        energy = 0.5 * (v * self._mass(t, x).momentum(v)).sum()
        return energy + more_kinetic(x, v, self._turns) if len(self._turns.moment) else energy

    def momentum(self, t, x, v):
        """Momentum of what is free [N s], shape (3,)."""
        return self._momenta(t, x, v)[: self._linear].sum(axis=0)

    def _momenta(self, t, x, v):
        """M v of what is free, by row [N s]."""
        return self._mass(t, x).momentum(np.where(self._supported, 0.0, v))

    def energies(self, sample, work, step):
        """Energy of each term, kinetic energy, work [J] and step size [s], for the work of each term."""
        t, x, v, system, total = sample.time, sample.x, sample.v, self.system, np.zeros(len(self.system.terms) + 3)
        if system.net.factors:
            self._lines[:] = system.line_data(t).matrix
        book_energies.call(t, x, v, system.net.mass, self._turns, *self._terms, work, self._working, total)
        total[-3] = self.kinetic(t, x, v)
        total[-1] = step
        return total

    def energies_within(self, piece, sample):
        """Energies as of `energies`, at a sample within a piece."""
        return self.energies(sample, piece.booked(sample.time)[:-6], piece.step)

    def open(self, course, energies):
        """Note the energy and the momentum at the start of a course."""
        open_balance.call(course.x, self._momenta(course.time, course.x, course.v), self._outside, course.ledger)
        course.energy, stored = own_energies(energies, self.system)
        course.largest = max(stored, self.least_energy)

    def impulses(self, course, row):
        """Write momentum, impulse of the supports and of all else from outside [N s], held against each other."""
        momenta = self._momenta(course.time, course.x, course.v)
        note_momentum.call(
            course.time, course.x, momenta, course.impulse, self._outside, course.ledger, self._still, row
        )

    def note_largest(self, course, energies):
        """Note the largest energy of a course."""
        course.largest = max(course.largest, own_energies(energies, self.system)[1])

    def close(self, course, energies, before, remedy):
        """Compare the energies at a row with the work; raise `EnergyDriftError` where a large drift does not fall."""
        if drifts_away.py_func(course, *own_energies(energies, self.system), energies[-2], DRIFT):
            from .drift_source import suspects

            raise EnergyDriftError(
                f"energy drift {course.drift:.3g} of the largest energy between t = {before:.6g} and "
                f"{course.time:.6g} s, limit {DRIFT:g}: {remedy}{suspects(self.system)}",
                course.drift,
            )


def refuse_endless(system, t, force):
    """Refuse forces on rows, shape (rows, 3), that are not finite; names the first such row."""
    if not math.isfinite(force.sum()) and not np.isfinite(force).all():  # a sum may overflow
        name = system.row_name(int(np.flatnonzero(~np.isfinite(force).all(axis=1))[0]))
        raise IntegrationError(f"number not finite at {name}, t = {t:.6g} s: use a smaller rtol") from None
