"""Values of observables at an instant of a motion, and their derivatives by numbers of the scene.

An observable of several lines or nodes has the value of each; which of them counts is decided behind the derivatives,
so that a difference passes no kink of a largest value.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..results.observables.balances import Booked, weights
from ..results.observables.line import Line
from ..results.observables.nodal import Nodal
from ..results.observables.reaction import Reaction
from ..results.state import State

MOVED = 1e-7
"""Displacement of a difference of values over the shortest natural length; small against strains in tension."""
TIED = 1e-6
"""Relative difference below which lines or nodes share the largest value, as symmetric ones do."""


class Instant(NamedTuple):
    """A state of a motion and its derivatives: x, v, a of shape (rows, 3), and theirs of shape (numbers, rows, 3)."""

    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    dx: np.ndarray
    dv: np.ndarray
    da: np.ndarray

    def copied(self):
        """A copy, as the motion writes to its arrays."""
        return Instant(*(part.copy() for part in self))


def between(share, h, before, now):
    """The `Instant` at a share of a step h, on the polynomials of `step.interpolate_kicks`."""
    s, r = share, 1.0 - share
    parts = []
    for k in (0, 3):
        (x0, v0, a0), (x1, v1, a1) = before[k : k + 3], now[k : k + 3]
        x = x0 + s * (x1 - x0) - h * h * s * r * ((1.0 + r) * a0 + (1.0 + s) * a1) / 6.0
        v = v0 + s * s * (3.0 - 2.0 * s) * (v1 - v0) + h * (s * r * r * a0 - s * s * r * a1)
        parts += [x, v, r * a0 + s * a1]
    return Instant(*parts)


def values_of(observe, state):
    """Value of each line or node of an observable, or of the whole of it, shape (k,)."""
    observable, system = observe.observable, state.system
    if isinstance(observable, Booked):
        energies = [system.energy_of(term, state.time, state.x).sum() for term in system.terms]
        kinetic = 0.5 * (system.net.mass[:, None] * state.v**2).sum()
        return np.array([weights(system, observe.quantity)[:-2] @ [*energies, kinetic]])
    if isinstance(observable, Line):
        return observable.values(state)[observable.elements(system.net)]
    summed = isinstance(observable, Reaction) and observe.select is None
    if type(observable).of in (Nodal.of, Reaction.of) and not summed:
        return observable.sizes(observable.vectors(state)[observable.rows(system)])
    return np.array([observable.of(state).value])


def rates_of(observed, numbers, system, t, instant):
    """Values of observables, and their derivatives, at an instant.

    Returns
    -------
    dict of str to (ndarray of shape (k,), ndarray of shape (numbers, k))
    """
    x, v, shortest = instant.x, instant.v, system.net.natural_length.min()
    state = State(system, t, x, v)
    values = {o.name: values_of(o, state) for o in observed}
    rates = {name: np.zeros((len(numbers), len(value))) for name, value in values.items()}
    for n, (number, dx, dv) in enumerate(zip(numbers, instant.dx, instant.dv, strict=True)):
        low, high = number.systems
        pairs = [((low, x, v), (high, x, v), number.step)]
        size = np.abs(dx).max()
        size = (
            MOVED * shortest / size if size > 0.0 else MOVED * max(np.abs(v).max(), 1.0) / max(np.abs(dv).max(), 1e-300)
        )
        if dx.any() or dv.any():
            pairs.append(((system, x - size * dx, v - size * dv), (system, x + size * dx, v + size * dv), size))
        for first, second, step in pairs:
            states = [State(changed, t, *moved) for changed, *moved in (first, second)]
            for o in observed:
                rates[o.name][n] += (values_of(o, states[1]) - values_of(o, states[0])) / (2.0 * step)
    return {name: (value, rates[name]) for name, value in values.items()}


class Slopes(NamedTuple):
    """Derivatives of a result by some numbers, shape (numbers,) each.

    Attributes
    ----------
    value, left : ndarray
        Derivatives for numbers that rise and that fall.
    spread : ndarray
        Difference of the derivatives of lines or nodes that may be those of the largest value, within its ±.
    """

    value: np.ndarray
    left: np.ndarray
    spread: np.ndarray


def slopes_of(observe, values, rates, error):
    """The `Slopes` of an observable from `rates_of`, whose value is known to an ``error``."""
    scores, sign = observe.observable.scores(values), 1.0
    if observe.select == "abs":
        sign = np.sign(values)
    rates = sign * rates
    best = int(scores.argmax())
    tied = scores >= scores[best] - TIED * abs(scores[best])
    near = scores >= scores[best] - max(error or 0.0, 0.0)
    right, left = rates[:, tied].max(axis=1), rates[:, tied].min(axis=1)
    if observe.select == "min":
        right, left = left, right
    if tied.sum() == 1 or not (np.abs(right - left) > 1e-6 * np.abs(rates[:, tied]).max()).any():
        right = left = rates[:, best]
    return Slopes(right, left, np.ptp(rates[:, near | tied], axis=1) if near.any() else np.zeros(len(rates)))
