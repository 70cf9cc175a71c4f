"""Values of observables at an instant of a motion, and their derivatives by numbers of the scene.

An observable of several lines or nodes has the value of each; which of them counts is decided behind the derivatives,
so that a difference passes no kink of a largest value.

May change: `MOVED`, private functions; `TIED` and `KINK` decide which derivatives are given to both sides. Must stay:
values are those that ``history.csv`` and results have for the same observable; fields of `Instant`, `Rates` and
`Slopes`, which `gradients` and `peaks` read. `between` is the polynomial of `integrators.step.interpolate_kicks`:
change both together. Tests: ``tests/dynamics/test_dynamic_gradients.py``.
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

KINK = 1e-9
"""Change over its size of a number that makes up for a size, or a difference of values, that counts as 0."""


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


def parts_of(observe, state):
    """Value of each line or node of an observable, or of the whole of it, shape (k,); vectors (k, 3) of magnitudes."""
    observable, system = observe.observable, state.system
    if isinstance(observable, Booked):
        energies = [system.energy_of(term, state.time, state.x).sum() for term in system.terms]
        kinetic = 0.5 * (system.net.mass[:, None] * state.v**2).sum()
        return np.array([weights(system, observe.quantity)[:-2] @ [*energies, kinetic]])
    if isinstance(observable, Line):
        return observable.values(state)[observable.elements(system.net)]
    if type(observable).of in (Nodal.of, Reaction.of):
        vectors = observable.vectors(state)[observable.rows(system)]
        if isinstance(observable, Reaction) and observe.select is None:
            vectors = vectors.sum(axis=0, keepdims=True)
        return vectors if observe.component is None else observable.sizes(vectors)
    return np.array([observable.of(state).value])


def value_of(observe, state):
    """Value of an observable in a state: that of the line or node that counts."""
    part = parts_of(observe, state)
    return observe.observable.selected(np.linalg.norm(part, axis=1) if part.ndim == 2 else part)[0]


class Rates(NamedTuple):
    """Values of the lines or nodes of an observable, shape (k,), and derivatives for numbers that rise and that fall.

    ``right`` and ``left``, shape (numbers, k), differ where a size is 0.
    """

    values: np.ndarray
    right: np.ndarray
    left: np.ndarray


def _sided(observe, part, rates, sizes):
    """The `Rates` of parts with smooth derivatives, shape (numbers, k) or (numbers, k, 3): a size has a kink at 0."""
    if part.ndim == 1 and observe.select != "abs":
        return Rates(part, rates, rates)
    if part.ndim == 1:
        size, change, along, values = np.abs(part), np.abs(rates), np.sign(part) * rates, part
    else:
        size = values = np.linalg.norm(part, axis=1)
        change = np.linalg.norm(rates, axis=2)
        along = (rates * part).sum(axis=2) / np.where(size > 0.0, size, 1.0)
    still = size <= KINK * change * sizes[:, None]
    return Rates(values, np.where(still, change, along), np.where(still, -change, along))


def rates_of(observed, numbers, system, t, instant):
    """The `Rates` of observables at an instant, a dict by name."""
    x, v, shortest = instant.x, instant.v, system.net.natural_length.min()
    state = State(system, t, x, v)
    parts = {o.name: parts_of(o, state) for o in observed}
    rates = {name: np.zeros((len(numbers), *part.shape)) for name, part in parts.items()}
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
                rates[o.name][n] += (parts_of(o, states[1]) - parts_of(o, states[0])) / (2.0 * step)
    sizes = np.array([number.size for number in numbers])
    return {o.name: _sided(o, parts[o.name], rates[o.name], sizes) for o in observed}


class Slopes(NamedTuple):
    """Derivatives of a result by some numbers, shape (numbers,) each.

    Attributes
    ----------
    value, left : ndarray
        Derivatives for numbers that rise and that fall.
    spread : ndarray
        Largest excess over these of the derivatives of lines or nodes that may have the largest value, within its ±.
    """

    value: np.ndarray
    left: np.ndarray
    spread: np.ndarray


def slopes_of(observe, rates, error):
    """The `Slopes` of an observable from its `Rates`, whose value is known to an ``error``."""
    scores = observe.observable.scores(rates.values)
    best = int(scores.argmax())
    tied = scores >= scores[best] - TIED * abs(scores[best])
    near = tied | (scores >= scores[best] - error)
    right, left = rates.right[:, tied].max(axis=1), rates.left[:, tied].min(axis=1)
    if observe.select == "min":
        right, left = rates.right[:, tied].min(axis=1), rates.left[:, tied].max(axis=1)
    equal = np.abs(right - left) <= 1e-6 * np.maximum(np.abs(right), np.abs(left))
    right, left = (np.where(equal, rates.right[:, best], side) for side in (right, left))
    every = np.concatenate([rates.right[:, near], rates.left[:, near]], axis=1)
    return Slopes(right, left, excess(every.min(axis=1), every.max(axis=1), right, left))


def excess(low, high, right, left):
    """Largest excess of a range of derivatives, from ``low`` to ``high``, over that from one side to the other."""
    return np.maximum(0.0, np.maximum(high - np.maximum(right, left), np.minimum(right, left) - low))
