"""Tangent-linear steps of central differences: derivatives of a motion by numbers of a scene, beside its steps.

With a derivative δ by a number p, K = −∂f/∂x and C = −∂f/∂v at the end of each step, and all steps as they were,

    δv ← δv + ½h δa,   δx ← δx + h δv,  (1 + ½h M⁻¹C) δv ← δv + ½h b,  b = ∂(M⁻¹f)/∂p − M⁻¹K δx,  δa = b − M⁻¹C δv.

This is the derivative of the steps themselves, to rounding, where each force is differentiable at each step: K and C
are the kernels of implicit methods. A force with a kink, as of a line that goes slack, has the derivative of the side
on which it is; the step that passes the kink leaves an error of order 1 in its size. A force that jumps is one with a
jump of δv, see `refweb.dynamics.integrators.snaps`. At a corner of a table a step ends: its kick has the velocities of
prescribed motion before the corner, as the run has, and δa behind the kick is that behind it.
∂(M⁻¹f)/∂p are differences of forces of systems with other values of p, of the terms alone whose numbers differ.

Losses of contacts are stiff, and steps solve for them with the θ of `refweb.effects.contact_solver`. Their derivative
has the limit of this: over a kick of size h it decays as δv' = b − M⁻¹C δv does,

    δa = φ(h M⁻¹C) (b − M⁻¹C δv⁻),   φ(z) = (1 − e⁻ᶻ)/z,

with δv⁻ before the kick. It is that of the steps to order 2, not to rounding.

`Steps` follows a run, and calls `Tangent.step` behind each step; `refweb.dynamics.linear_run` is its user.

May change: constants, down to rounding, and how products are computed. Must stay: steps are those of the run itself,
bit for bit, and δa is the derivative of `step` and of `effects.contact_solver`: a change of their kick has to follow
here; the name "drag", by which losses of drag are told from those of contact; names of `Steps` and `Tangent`, which
`linear_run` uses; `BESIDE`, which `dynamics.linear_run` imports. Tests: ``tests/dynamics/test_dynamic_gradients.py``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from ...errors import IntegrationError
from ...kernels import INDICES, kernel
from .integrator import SAME
from .snaps import Shift, Snaps, is_damped

CUBE = types.Array(types.float64, 3, "C")
MOST_ROUNDS, CLOSE = 200, 1e-13
"""Largest number of rounds of the equation of δv, and the change over its size at which they end."""

SKIN = 0.1
"""Approach over the mean length of elements up to which the cells of contact are not looked for again."""
BESIDE = 1e-6
"""Time before a corner of a table at which numbers are those before it, over a step."""
SMALL, TERMS = 0.25, 11
"""Norm of a matrix up to which its decay is a series, and the number of terms, whose remainder is 1e-14."""


@kernel(types.void(CUBE, INDICES, CUBE, CUBE))
def subtract_products(blocks, cells, moves, forces):
    """Subtract the products of the blocks of cells with each of some moves from forces, shapes (p, rows, 3)."""
    size = 3 * cells.shape[1]
    move = np.empty(size)
    for c in range(cells.shape[0]):
        first = 0  # slack lines have zeros
        while first < size * size and blocks[c, first // size, first % size] == 0.0:
            first += 1
        for p in range(moves.shape[0] if first < size * size else 0):
            for a in range(cells.shape[1]):
                for i in range(3):
                    move[3 * a + i] = moves[p, cells[c, a], i]
            for a in range(cells.shape[1]):
                for i in range(3):
                    total = 0.0
                    for b in range(size):
                        total += blocks[c, 3 * a + i, b] * move[b]
                    forces[p, cells[c, a], i] -= total


class Blocks:
    """K or C of a term by cell, of those alone that may act, where it acts near something.

    Parameters
    ----------
    term : refweb.effects.base.ForceTerm
        The term.
    matrix : kernel
        That of its blocks, of signature `refweb.kernels.STIFFNESS`.
    skin : float
        Approach of two rows up to which cells are not looked for again [m].
    """

    def __init__(self, term, matrix, skin):
        self.term, self._matrix, self._skin, self.cells = term, matrix, skin, term.cells
        self._space = np.zeros((len(term.cells), *2 * (3 * term.cells.shape[1],)))
        self._chosen, self._data, self._reference = np.empty(len(term.cells), dtype=np.int64), None, None

    @property
    def blocks(self):
        """Blocks of the ``cells``, shape (cells, 3 arity, 3 arity)."""
        return self._space[: len(self.cells)]

    def set(self, system, t, x, v):
        """Take the blocks at an instant."""
        data = system.data_of(self.term, t)
        if self.term.contact.near is not None:
            data = self._near(x, data)
        self._matrix(t, x, v, self.blocks, self.cells, data, False)

    def _near(self, x, data):
        """Choose the cells that may act, and return their data."""
        if self._reference is None or 2.0 * np.sqrt(((x - self._reference) ** 2).sum(axis=1).max()) > self._skin:
            count = self.term.contact.near(self._skin, x, self.term.cells, data, self._chosen)
            chosen = self._chosen[:count]
            self._reference, self.cells, self._data = x.copy(), self.term.cells[chosen], data[chosen]
        return self._data


class Matrices:
    """Products with K or C of a system: `set` takes the blocks of an instant, of some terms with their kernels."""

    def __init__(self, system, terms):
        skin = SKIN * system.net.natural_length.mean()
        self.terms = [Blocks(term, matrix, skin) for term, matrix in terms]

    def set(self, system, t, x, v):
        """Take the blocks at an instant."""
        for term in self.terms:
            term.set(system, t, x, v)

    def forces(self, moves):
        """−K δx or −C δv of each of some moves, shape (p, rows, 3)."""
        forces = np.zeros_like(moves)
        for term in self.terms:
            subtract_products(term.blocks, term.cells, moves, forces)
        return forces

    def dense(self):
        """(Places in a flat array of rows, matrix) of the cells that have a matrix."""
        acting = []
        for term in self.terms:
            cells = term.blocks.any(axis=(1, 2))
            acting.append((term.cells[cells], term.blocks[cells]))
        parts = [(3 * rows[:, :, None] + np.arange(3)).reshape(len(rows), 3 * rows.shape[1]) for rows, _ in acting]
        places = np.unique(np.concatenate([np.zeros(0, dtype=int), *(part.ravel() for part in parts)]))
        matrix = np.zeros((len(places), len(places)))
        for part, (_, blocks) in zip(parts, acting, strict=True):
            at = np.searchsorted(places, part)
            np.add.at(matrix, (at[:, :, None], at[:, None, :]), blocks)
        return places, matrix


def mean_decay(matrix):
    """φ(Z) = (1 − e⁻ᶻ)/Z, the mean of e⁻ˢᶻ over s from 0 to 1, by φ(2Z) = ½ φ(Z)(1 + e⁻ᶻ) from a series on."""
    identity = np.eye(len(matrix))
    halvings = max(int(np.ceil(np.log2(max(np.abs(matrix).sum(axis=1).max(), 1e-300) / SMALL))), 0)
    small, mean = matrix / 2.0**halvings, identity
    for n in range(TERMS, 1, -1):
        mean = identity - small @ mean / n
    decay = identity - small @ mean
    for _ in range(halvings):
        mean, decay = 0.5 * mean @ (identity + decay), decay @ decay
    return mean


def _rubs(term):
    """Tell if kicks solve for the losses of a term with a mean velocity of their own: contacts, not drag."""
    return term.velocity.implicit is not None and term.name != "drag"


class Tangent:
    """Derivatives of a motion of central differences by some numbers.

    Parameters
    ----------
    integrator : refweb.dynamics.integrators.central_difference.CentralDifference
        The method, of a system without attached nodes, bodies that turn and internal variables.
    numbers : sequence of refweb.dynamics.parameters.Parameter
        The numbers p; behind them may be as many `refweb.dynamics.integrators.snaps.Shift`.
    t : float
        Time of the start [s].
    x, v, f : ndarray, shape (rows, 3)
        State of the start.

    Attributes
    ----------
    x, v, a : ndarray, shape (p, rows, 3)
        δx, δv and δa.
    before : tuple or None
        (v, a, δx, δv, δa) before a corner of a table at the end of the last step, else None.
    snaps : refweb.dynamics.integrators.snaps.Snaps or None
        Lines that snap taut, where they are damped.
    """

    def __init__(self, integrator, numbers, t, x, v, f):
        self.system, self.numbers = integrator.system, numbers
        self.inverse = integrator.model.inertia.inverse
        terms = self.system.terms
        self._stiff = Matrices(
            self.system, [(g, g.tangent.stiffness) for g in terms if g.tangent.stiffness is not None]
        )
        damped = [(g, g.velocity.damping) for g in terms if g.velocity.damping is not None]
        self._damped = Matrices(self.system, [pair for pair in damped if not _rubs(pair[0])])
        self._rubbing = Matrices(self.system, [pair for pair in damped if _rubs(pair[0])])
        self._driven = np.concatenate([[], *(drive.cells[:, 0] for drive in self.system.drives)]).astype(int)
        shape = len(numbers), *x.shape
        self.x, self.v = (np.array([number.start[k] for number in numbers]).reshape(shape) for k in (0, 1))
        self.before = None
        self._set_rates(t, x, v, f)
        self._shifts = sum(isinstance(number, Shift) for number in numbers)
        self.snaps: Any = Snaps(self.system, numbers, x, v, self.x) if is_damped(self.system) else None

    def _rates(self, t, x, v, f):
        """∂(M⁻¹f)/∂p − M⁻¹K δx, shape (p, rows, 3)."""
        self._stiff.set(self.system, t, x, v)
        rates = self.inverse * self._stiff.forces(self.x)
        for number, rate in zip(self.numbers, rates, strict=True):
            number.add_rate(t, x, v, f, self.inverse, rate)
        return rates

    def _set_rates(self, t, x, v, f):
        """Take δa of the state, without a step."""
        self.a = self._rates(t, x, v, f)
        for losses in (self._damped, self._rubbing):
            losses.set(self.system, t, x, v)
            self.a += self.inverse * losses.forces(self.v)

    def _drive(self, t, at):
        """Take the derivatives of prescribed motion: of positions at t, of velocities ``at`` a time."""
        if len(self._driven):
            for number, dx, dv in zip(self.numbers, self.x, self.v, strict=True):
                dx[self._driven], dv[self._driven] = number.driven(t, at, self._driven)

    def step(self, t, h, x, v, f, corner=False):
        """Take a step h to the time t, at the end of which the motion is at x, v with the force f.

        At a ``corner`` of a table these are the velocity and the force behind it.
        """
        self.v += 0.5 * h * self.a
        self.x += h * self.v
        self._drive(t, t - 0.5 * h)
        if self.snaps:
            before = self.v.copy(), self.a
            self.snaps.add(t, h, x, v, self.x, self.v, self.inverse, corner)
            jump = self.v - before[0]
        now, behind = t, (v, f)
        if corner:
            now, v = t - BESIDE * h, v.copy()
            self.system.drive(t - 0.5 * h, np.zeros_like(x), v)
            f = self.system.force(now, x, v)
        rates = self._rates(now, x, v, f)
        rub = self._rub(h, now, x, v)
        if self._damped.terms:
            self._damped.set(self.system, now, x, v)
            self.a = self._solved(now, h, rates, rub)
        else:
            self.a = rub(rates)
        self.v += 0.5 * h * self.a
        if self._shifts and self.snaps.delays.size:
            self.x[-self._shifts :] -= h * jump[: self._shifts]
            self.v[-self._shifts :] -= h * (self.a - before[1])[: self._shifts]
        self.before = None
        if corner:
            self.before = v, self.inverse * f, self.x.copy(), self.v.copy(), self.a
            self._drive(t, t)
            self._set_rates(t, x, *behind)

    def _rub(self, h, t, x, v):
        """Function of δa without losses of contacts that gives it with them."""
        if not self._rubbing.terms:
            return lambda rates: rates
        self._rubbing.set(self.system, t, x, v)
        places, matrix = self._rubbing.dense()
        inverse, start = self.inverse.ravel()[places], self.v.reshape(len(self.v), -1)[:, places]
        if not len(places):
            return lambda rates: rates
        root = np.sqrt(inverse)
        weight = mean_decay(h * root[:, None] * matrix * root)
        free = np.where(root > 0.0, 1.0 / np.where(root > 0.0, root, 1.0), 0.0)

        def rub(rates):
            changed = rates.reshape(len(rates), -1).copy()
            undamped = changed[:, places] - inverse * (start @ matrix.T)
            changed[:, places] = root * ((free * undamped) @ weight.T)
            return changed.reshape(rates.shape)

        return rub

    def _solved(self, t, h, rates, rub):
        """δa of δa = rub(rates − M⁻¹C (δv + ½h δa))."""
        a, before = self.a, np.inf
        for _ in range(MOST_ROUNDS):
            moves = self.v + 0.5 * h * a
            last, a = a, rub(rates + self.inverse * self._damped.forces(moves))
            change, size = 0.5 * h * np.abs(a - last).max(initial=0.0), np.abs(moves).max(initial=0.0)
            if change <= CLOSE * size or change >= before and change <= 1e3 * CLOSE * size:
                return a
            before = change
        raise IntegrationError(f"the derivatives of velocities at t = {t:.6g} s are not found: use a smaller safety")


class Steps:
    """Steps of a run of central differences, one by one.

    Parameters
    ----------
    integrator : refweb.dynamics.integrators.central_difference.CentralDifference
        The method; its steps are those of a run to the same times.
    start : tuple
        (x, v) as `refweb.dynamics.integrators.integrator.Integrator.start` takes them.
    """

    def __init__(self, integrator, start):
        self.integrator, self.course = integrator, integrator.start(*start)
        self.integrator.breath = 1

    def follow(self, times, on_step):
        """Go to each of the times, and call ``on_step(t, h, corner)`` behind each step h to a time t, corner or not."""
        integrator, course, corners = self.integrator, self.course, self.integrator.system.corners
        integrator.on_progress = lambda t: on_step(float(t), integrator.step, False)
        inner = corners[(corners > course.time) & (corners < times[-1])]
        for end in np.union1d(times, inner):
            if end > course.time and not course.stopped:
                integrator.advance(course, [end])
                on_step(course.time, integrator.step, bool(np.isclose(corners, end, rtol=SAME, atol=0.0).any()))
