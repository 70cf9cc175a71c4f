"""Books of energy and momentum around steps of any method: work and impulse by Simpson's rule.

A piece of a step is known at its start, in its middle and at its end. The parabolas through the powers there, through
what supports give and what pulls on lines that change their length, are integrated to any time within. Where Simpson's
rule and the trapezoidal one differ too much, as where damped lines go slack in a long step, a piece is to be halved.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from ...effects.base import CONTACT
from ...errors import EnergyDriftError, IntegrationError
from ...kernels import ENERGY, INDICES, MATRIX, VECTOR, Arrays, Functions
from ...net.rotation import RigidRotations, more_kinetic
from .energy_balance import CLOSING, DRIFT, book_energies, least_energy, no_energy
from .momentum_balance import Outside, note_momentum, open_balance

UNEVEN = 1e-3
"""Largest share of the energy by which the work in a piece may differ between Simpson's and the trapezoidal rule."""


class Sample(NamedTuple):
    """A system at an instant.

    Attributes
    ----------
    time : float
        Time [s].
    x, v, force : ndarray, shape (rows, 3)
        Displacement [m], velocity [m/s] and force [N] of each row; what supports give is its negative.
    lines : ndarray, shape (cells, columns)
        What the line elements show: tension [N], strain [1].
    power : ndarray, shape (terms + 1,)
        Power of each term and, last, of motion [W].
    per_cell : dict of int to ndarray
        What terms show of their cells that probes read, by number of the term.
    """

    time: float
    x: np.ndarray
    v: np.ndarray
    force: np.ndarray
    lines: np.ndarray
    power: np.ndarray
    per_cell: Mapping = MappingProxyType({})


class Rates(NamedTuple):
    """Rates that are integrated.

    Attributes
    ----------
    flow : ndarray, shape (terms + 7,)
        Power of each term and of motion [W]; the force of the supports, and of what acts from outside without a
        formula of its impulse [N].
    lengths : ndarray or None
        Natural lengths [m]; none where nothing changes them.
    length_force : ndarray or None
        ∂E/∂L of each of them [N].
    """

    flow: np.ndarray
    lengths: np.ndarray | None
    length_force: np.ndarray | None


class Booked(NamedTuple):
    """Work of each term and, last, of motion [J]; impulse of the supports, and of what `Rates.push` is [N s]."""

    work: np.ndarray
    impulse: np.ndarray
    pushed: np.ndarray


class Jump(NamedTuple):
    """Energy [J] and momentum [N s], shape (3,), of a jump of velocities at the corner of a motion."""

    energy: float
    momentum: np.ndarray


class Piece(NamedTuple):
    """A part of a step, from where a course is.

    Attributes
    ----------
    begin : float
        Time at its start [s].
    before : Booked
        What is booked until then.
    step : float
        Size of the step that it is a part of [s].
    middle, end : Sample
        The system there; at the end with the velocities behind a jump.
    rates : tuple of Rates
        At the start, in the middle and at the end.
    behind : Rates
        At the start of the next piece: others where velocities jump.
    jump : Jump or None
        What that takes.
    """

    begin: float
    before: Booked
    step: float
    middle: Sample
    end: Sample
    rates: tuple[Rates, Rates, Rates]
    behind: Rates
    jump: Jump | None

    def booked(self, t):
        """Make the `Booked` values until a time within."""
        width = self.end.time - self.begin
        s = (t - self.begin) / width
        a, b, c = s - 1.5 * s**2 + s**3 / 1.5, 2.0 * s**2 - s**3 / 0.75, s**3 / 1.5 - 0.5 * s**2
        start, middle, last = self.rates
        more = width * (a * start.flow + b * middle.flow + c * last.flow)
        work, impulse, pushed = self.before
        work, impulse, pushed = work + more[:-6], impulse + more[-6:-3], pushed + more[-3:]
        if start.lengths is not None:
            pull = a * start.length_force + b * middle.length_force + c * last.length_force
            work[-1] += pull @ (last.lengths - start.lengths)
        if self.jump and t == self.end.time:
            work[-1], impulse = work[-1] + self.jump.energy, impulse + self.jump.momentum
        return Booked(work, impulse, pushed)

    @property
    def unevenness(self):
        """Difference of the work between Simpson's and the trapezoidal rule [J]."""
        start, middle, last = (rates.flow[:-6] for rates in self.rates)
        return (self.end.time - self.begin) * np.abs(start - 2.0 * middle + last).sum() / 12.0


class SimpsonBalance:
    """The books of one system.

    Parameters
    ----------
    system : refweb.system.system.System
        What acts.
    hold : callable
        ``hold(x, v)`` moves a state to the nearest one that the equations allow.
    fast : float
        Velocity [m/s] below which nothing is held to be moving.
    observed : sequence of int
        Numbers of the terms of whose cells probes read what they show.
    """

    def __init__(self, system, hold, fast, observed=()):
        self.system, self._hold, self._least_energy = system, hold, least_energy(system.net)
        self._linear, self._turns = system.rows - system.net.spins, RigidRotations.of(system.net)
        self._still = system.net.mass[: self._linear].sum() * fast
        terms, self._observed = system.terms, observed
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

    def sample(self, t, x, v):
        """The `Sample` of a state."""
        force, out = self.system.balance(t, x, v)
        self.refuse_endless(t, force)
        power, driven = np.zeros(len(out) + 1), self._driven
        for i, column in self._powered:
            power[i] = out[i][:, column].sum()
        power[-1] = -(force[driven] * v[driven]).sum() if len(driven) else 0.0
        return Sample(t, x, v, force, out.lines.copy(), power, {i: self._show(out, i) for i in self._observed})

    def _show(self, out, number):
        """Values that probes read of terms that write ``out``."""
        return self.system.contact_forces.of(out) if number == CONTACT else out[number].copy()

    def refuse_endless(self, t, force):
        """Refuse forces on rows, shape (rows, 3), that are not finite; names the first such row."""
        if not np.isfinite(force).all():
            name = self.system.row_name(int(np.flatnonzero(~np.isfinite(force).all(axis=1))[0]))
            raise IntegrationError(f"number not finite at {name}, t = {t:.6g} s: use a smaller rtol") from None

    def rates(self, sample):
        """The `Rates` of a sample."""
        system, flow = self.system, np.zeros(len(sample.power) + 6)
        flow[:-6] = sample.power
        if len(self._fixed):
            flow[-6:-3] = -np.bincount(self._fixed % 3, sample.force.ravel()[self._fixed], 3)
        for term in self._pushing:
            rows = system.force_of(term, sample.time, sample.x, sample.v)
            flow[-3:] += rows[: self._linear].sum(axis=0)
        if not system.net.factors:
            return Rates(flow, None, None)
        return Rates(flow, system.natural_length(sample.time), system.length_force(sample.time, sample.x))

    def piece(self, course, middle, end):
        """The `Piece` from where a course is, by the samples in its middle and at its end.

        At the corner of a motion velocities jump: until then the given ones are those in the middle.
        """
        driven, last, jump = self._driven, end, None
        if len(driven) and (end.v[driven] != middle.v[driven]).any():
            before, step = end.v.copy(), np.zeros_like(end.v)
            before[driven] = middle.v[driven]
            step[driven] = end.v[driven] - before[driven]
            after = before + self.system.mass.kick(step)
            after[driven] = end.v[driven]
            self._hold(end.x, after)
            last, end = self.sample(end.time, end.x, before), self.sample(end.time, end.x, after)
            gained = self.kinetic(end.x, after) - self.kinetic(end.x, before)
            jump = Jump(gained, self.momentum(after) - self.momentum(before))
        rates = course.rates, self.rates(middle), self.rates(last)
        behind = self.rates(end)
        before = Booked(course.work, course.impulse, course.ledger.pushed.copy())
        return Piece(course.time, before, course.step, middle, end, rates, behind, jump)

    def uneven(self, course, piece):
        """Tell if powers change too much within a piece."""
        apart = piece.unevenness
        return apart > UNEVEN * course.largest and apart > UNEVEN * self.kinetic(piece.end.x, piece.end.v)

    def kinetic(self, x, v):
        """Kinetic energy [J]."""
        energy = 0.5 * (v * self.system.mass.momentum(v)).sum()
        return energy + more_kinetic(x, v, self._turns) if len(self._turns.moment) else energy

    def momentum(self, v):
        """Momentum of what is free [N s], shape (3,)."""
        return self._momenta(v)[: self._linear].sum(axis=0)

    def _momenta(self, v):
        """M v of what is free, by row [N s]."""
        return self.system.mass.momentum(np.where(self._supported, 0.0, v))

    def energies(self, sample, work, step):
        """Energy of each term, kinetic energy, work [J] and step size [s], for the work of each term."""
        t, x, v, system, total = sample.time, sample.x, sample.v, self.system, np.zeros(len(self.system.terms) + 3)
        if system.net.factors:
            self._lines[:] = system.line_data(t).matrix
        book_energies(t, x, v, system.net.mass, self._turns, *self._terms, work, self._working, total)
        total[-3] = self.kinetic(x, v)
        total[-1] = step
        return total

    def energies_within(self, piece, sample):
        """The same at a sample of a piece."""
        return self.energies(sample, piece.booked(sample.time)[0], piece.step)

    def open(self, course, energies):
        """Note the energy and the momentum at the start of a course."""
        open_balance(course.x, self._momenta(course.v), self._outside, course.ledger)
        by_term = self._by_term(energies)
        course.energy, course.largest = by_term.sum(), max(np.abs(by_term).sum(), self._least_energy)

    def impulses(self, course):
        """Momentum, impulse of the supports and of all else from outside [N s], shape (9,), held against each other."""
        row, momenta = np.zeros(9), self._momenta(course.v)
        note_momentum(course.time, course.x, momenta, course.impulse, self._outside, course.ledger, self._still, row)
        return row

    def note_largest(self, course, energies):
        """Note the largest energy of a course."""
        course.largest = max(course.largest, np.abs(self._by_term(energies)).sum())

    def close(self, course, energies, before, remedy):
        """Compare the energies at a row with the work; raise `EnergyDriftError` where a large drift does not fall."""
        by_term, work = self._by_term(energies), energies[-2]
        self.note_largest(course, energies)
        drift = abs(by_term.sum() - work - course.energy)
        course.worst = max(course.worst, drift)
        share = drift / course.largest
        if not share <= max(DRIFT, CLOSING * course.share):
            raise EnergyDriftError(
                f"energy drift {course.drift:.3g} of the largest energy between t = {before:.6g} and "
                f"{course.time:.6g} s, limit {DRIFT:g}: {remedy}",
                course.drift,
            )
        if course.nsteps and course.largest > self._least_energy:
            course.share = share

    def _by_term(self, energies):
        """Energies of the terms that are no work, and kinetic energy."""
        return np.delete(energies[:-2], np.flatnonzero(self._working > 0))
