"""Static equilibrium by dynamic relaxation: an explicit method, independent of any tangent.

Central differences with fictitious masses, chosen so that a step of 1 is at `SAFETY` of the bound of stability in every
row, and kinetic damping: whenever the kinetic energy passes a peak, all velocities are set to zero.

A free body that turns has a fictitious moment of inertia, the same about every axis, and turns by its velocity in a
step, a rotation vector. A node that it carries at the arm a moves by δ + θ × a, of which the square is at most
2 |δ|² + 2 |a|² |θ|²: so the bounds of rows there are twice those of the node, and twice those times |a|² with the
moment of the force on it, |f| |a|.

May change: constants and masses: they change the number of steps, and results within ``tolerance``. Must stay:
arguments of `solve`, which `registry.STATICS` names and `studies.trials` calls with ``tolerance``; keys of ``stats``,
those of `newton`. The system is not changed: plastic strains are part of x, and `taken_on` returns another x between
load steps. Tests: ``tests/statics/test_relaxation.py``.
"""

from __future__ import annotations

import functools

import numpy as np

from ..errors import InputError
from ..kernels import FORCE, INDICES, MATRIX, Arrays, Functions, kernel
from ..net.rotation import RigidRotations, add_forces_to_bodies, turn_by
from ..system.static_system import at_rest
from .equilibrium import (
    LIMIT,
    TOLERANCE,
    Equilibrium,
    NotFound,
    add_proofs,
    check_supported,
    force_scale,
    refuse_half_turns,
    residual,
    with_reason,
)

SAFETY = 0.6
"""Step size over the critical time step. Half a kick from rest moves the stiffest vibration by 2 `SAFETY`² of its
distance from equilibrium. A net that moves beyond equilibrium may jump between taut and slack, and be at rest after
every second step."""

STALLED, TOUCHING = 2_000_000, 500_000
"""Steps within which the residual must fall by a tenth. The second number is for systems with contact, whose steps cost
ten times as much."""

LOOK = 2000
"""Steps between two evaluations of the residual."""


@functools.cache
def relaxing(turning):
    """Kernel of a number of steps of x, v and f; where bodies are ``turning``, of their rotations and nodes as well.

    ``turns`` are their `refweb.net.rotation.RigidRotations`, ``start`` and ``speed`` room of the shape of x.
    """

    @kernel()
    def relax(count, t, x, v, f, inverse, kernels, cells, data, per_cell, turns, start, speed):
        flat_x, flat_v, flat_f, flat_inverse = x.reshape(-1), v.reshape(-1), f.reshape(-1), inverse.reshape(-1)
        before = 0.0
        for _ in range(count):
            kinetic = 0.0
            for q in range(flat_x.size):
                if flat_inverse[q] > 0.0:
                    flat_v[q] += flat_inverse[q] * flat_f[q]
                    kinetic += flat_v[q] * flat_v[q] / flat_inverse[q]
            if kinetic < before:
                for q in range(flat_x.size):  # a new start from rest: half a kick
                    flat_v[q] = 0.5 * flat_inverse[q] * flat_f[q]
                kinetic = 0.0
            before = kinetic
            if turning:
                start[:] = x
            for q in range(flat_x.size):
                flat_x[q] += flat_v[q]
                flat_f[q] = 0.0
            if turning:
                turn_by(start, x, speed, turns)
            for i in range(len(kernels)):
                kernels[i](t, x, v, f, cells[i], data[i], per_cell[i])
            if turning:
                add_forces_to_bodies(x, f, turns)

    return relax


def solve(system, load_steps, progress=None, limit=10_000_000, tolerance=TOLERANCE):
    """Equilibria at load steps, one after another, each from the one before.

    Parameters
    ----------
    system : refweb.system.system.System
        With a net whose ``quasi_static`` is True.
    load_steps : sequence of float
        Values of t.
    progress : callable, optional
        Called with a line of text at each evaluation of the residual.
    limit : int
        Largest number of steps for one load step.
    tolerance : float
        Residual at which the relaxation ends.

    Yields
    ------
    refweb.statics.equilibrium.Equilibrium

    Raises
    ------
    SolverError
        Where there is no equilibrium, or none is found.
    """
    system = at_rest(system)
    relaxation, x, turns = Relaxation(system, progress, limit, tolerance), np.zeros((system.rows, 3)), []
    for t in load_steps:
        state = relaxation.solve(t, x)
        turns = refuse_half_turns(system, t, state.x, turns)
        x = state.x = system.taken_on(t, state.x)
        yield state


class Relaxation:
    """Dynamic relaxation of one system; keeps its kernels and the scale of forces between load steps.

    Parameters
    ----------
    system : refweb.system.system.System
        With a net whose ``quasi_static`` is True.
    progress, limit, tolerance
        See `solve`.
    """

    def __init__(self, system, progress=None, limit=10_000_000, tolerance=TOLERANCE):
        for body in system.resting:
            if body.axle:
                raise InputError(
                    f'[solve] method = "relaxation" must be "newton" with body "{body.name}", which turns about an axle'
                )
        self.system, self.progress = system, progress or (lambda text: None)
        self.limit, self.tolerance, self.scale = limit, tolerance, 0.0
        self._stalled = TOUCHING if system.contact else STALLED
        self._kernels = Functions(FORCE, [f.force for f in system.terms])
        self._cells = Arrays(INDICES, [f.cells for f in system.terms])
        self._per_cell = Arrays(MATRIX, system.per_cell())
        self._relax, self._turns = relaxing(system.angles), RigidRotations.of(system.net)

    def solve(self, t, x):
        """Equilibrium at load step t from the displacement x, see `refweb.statics.newton.Newton.solve`."""
        system = self.system
        check_supported(system, t)
        x = x.copy()
        system.drive(t, x)
        inverse, data = self._inverse_mass(t), Arrays(MATRIX, [system.data_of(f, t) for f in system.terms])
        v, done, error, best, since = np.zeros_like(x), 0, np.inf, np.inf, 0
        turning = self._turns, np.zeros_like(x), np.zeros_like(x)
        while True:
            f, per_cell = system.forces(t, x)
            scale = max(self.scale, force_scale(system, t, x, per_cell.tension))
            last, error = error, residual(system, f, scale)
            if error <= self.tolerance or (error <= LIMIT and done and error > 0.5 * last):
                break
            if error < 0.9 * best:
                best, since = error, done
            if done >= self.limit or done - since >= self._stalled or not np.isfinite(error):
                failed = NotFound(
                    f"no equilibrium found at step {t:g} in {done} steps of relaxation: residual {error:.2e}, limit "
                    f'{LIMIT:g}; use method = "newton"',
                    {"nsteps": done},
                    x,
                )
                remedy = 'use method = "newton", by which both share its push, or '
                raise with_reason(system, t, failed, remedy, tangents=False)
            if system.carried.any():
                self._weigh_bodies(f, inverse)
            self._relax(LOOK, t, x, v, f, inverse, self._kernels, self._cells, data, self._per_cell, *turning)
            done += LOOK
            self.progress(f"step {t:g}, residual {error:.0e}")
        self.scale = scale
        stats: dict = dict(nsteps=done, nfev=done, njev=0, nlu=0, residual=float(error))
        if system.dead and not system.convex:
            stats["above_lowest"] = None if (per_cell.tension < 0.0).any() else 0.0
        state = Equilibrium(t, x, per_cell.tension.copy(), f, stats)
        add_proofs(system, state)
        return state

    def _inverse_mass(self, t):
        """Factor of the forces [m/N], shape (rows, 3): 0 where nothing moves."""
        system = self.system
        rates, x = np.zeros(system.rows), np.zeros((system.rows, 3))
        for term in system.terms:
            if term.tangent.bound is not None:
                term.tangent.bound(np.inf, 0.0, x, np.ones(system.rows), rates, term.cells, system.data_of(term, t))
        self._rates = rates
        return self._inverse(rates)

    def _inverse(self, rates):
        """Factor of the forces by bounds of the rows [N/m], shape (rows, 3)."""
        moving = ~self.system.supported & (rates > 0.0)[:, None]
        return np.where(moving, 4.0 * SAFETY**2 / np.where(rates > 0.0, rates, 1.0)[:, None], 0.0)

    def _weigh_bodies(self, f, inverse):
        """Write the factors of bodies that carry nodes, by forces f on these."""
        rates, turns = self._rates.copy(), self._turns
        for (node, n), arm in zip(turns.carried, np.linalg.norm(turns.arms, axis=1), strict=True):
            row, spin, _ = turns.rows[n]
            rates[row] += 2.0 * rates[node]
            rates[spin] += 2.0 * rates[node] * arm**2 + 2.0 * float(np.linalg.norm(f[node])) * arm
        inverse[:] = self._inverse(rates)
