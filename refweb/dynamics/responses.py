"""Values of observables at an instant of a motion, and their derivatives by numbers of the scene.

An observable of several lines or nodes has the value of each; which of them counts is decided behind the derivatives,
so that a difference passes no kink of a largest value.

May change: `MOVED`, private functions; `HALVINGS`, upwards: fewer than 52 find a time less closely than to rounding.
`TIED`, `KINK`, `BENT` and `ROUNDED` decide which derivatives differ by side: `peaks` takes the first two for largest
values in time, `kinks` the last two for kinks of forces. Must stay: values are those that ``history.csv`` and results
have for the same observable; fields of `Instant`, `Rates` and `Slopes`, which `linear_run`, `gradients` and `peaks`
read. `between` is the polynomial of `integrators.step.interpolate_kicks`: change both together. Must stay as well: all
names that `linear_run`, `kinks` and `peaks` import. Tests: ``tests/dynamics/test_dynamic_gradients.py``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..results.observables.balances import Booked, weights
from ..results.observables.line import Line
from ..results.observables.nodal import Nodal
from ..results.observables.observe import SIGN
from ..results.observables.reaction import Reaction
from ..results.state import State

MOVED = 1e-7
"""Displacement of a difference of values over the shortest natural length; small against strains in tension."""
TIED = 1e-6
"""Relative difference below which lines or nodes share the largest value, as symmetric ones do."""
BENT = 0.1
"""Change of a difference across a state, over it, from which on the state may be at a kink."""
ROUNDED = 1e-12
"""The same over the value, up to which it is rounding."""
HALVINGS = 60
"""Number of halvings of the time in which two lines change places."""
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
    """Values of the lines or nodes of an observable, and their derivatives by some numbers and by time.

    Attributes
    ----------
    parts : ndarray, shape (k,) or (k, 3)
        Values, of sizes of vectors the vectors.
    right, left : ndarray, shape (numbers, k) or (numbers, k, 3)
        Derivatives for numbers that rise and that fall, which differ at a kink, as of a line between slack and taut.
    speeds : ndarray, shape (k,) or (k, 3)
        Derivatives by time; 0 of an observable to which `turns_back` does not apply.
    sizes : ndarray, shape (numbers,)
        Sizes of the numbers.
    """

    parts: np.ndarray
    right: np.ndarray
    left: np.ndarray
    speeds: np.ndarray
    sizes: np.ndarray

    @property
    def values(self):
        """Values, of vectors their sizes, shape (k,)."""
        return np.linalg.norm(self.parts, axis=1) if self.parts.ndim == 2 else self.parts


class Margins(NamedTuple):
    """Times before and behind an instant in which a motion may turn back [s]; less than ``reach`` at an end of it."""

    before: float
    behind: float
    reach: float


def turns_back(observe):
    """Tell if a largest value in time is that of the smallest of several, or the reverse: where two change places."""
    return SIGN[observe.reduce] * (-1.0 if observe.select == "min" else 1.0) < 0.0


def _parts(observed, state):
    return {o.name: parts_of(o, state) for o in observed}


def step_of(system, v, dx, dv):
    """Step of a difference along dx and dv, None where both are 0."""
    if not (dx.any() or dv.any()):
        return None
    size = np.abs(dx).max()
    if size > 0.0:
        return MOVED * system.net.natural_length.min() / size
    return MOVED * max(np.abs(v).max(), 1.0) / max(np.abs(dv).max(), 1e-300)


def rates_of(observed, numbers, system, t, instant):
    """The `Rates` of observables at an instant, a dict by name."""
    parts = _parts(observed, State(system, t, instant.x, instant.v))
    speeds = _speeds([o for o in observed if turns_back(o)], system, t, instant)
    sides = {name: np.zeros((2, len(numbers), *part.shape)) for name, part in parts.items()}
    for n, number in enumerate(numbers):
        for name, pair in _both_sides(observed, parts, number, system, t, instant, n).items():
            sides[name][:, n] = pair
    sizes = np.array([number.size for number in numbers])
    return {
        name: Rates(part, *sides[name], speeds=speeds.get(name, np.zeros_like(part)), sizes=sizes)
        for name, part in parts.items()
    }


def _speeds(observed, system, t, instant):
    """Derivatives of the parts of observables by time, a dict by name."""
    step = step_of(system, instant.v, instant.v, instant.a) if observed else None
    if step is None:
        return {}
    low, high = (
        _parts(observed, State(system, t + s, instant.x + s * instant.v, instant.v + s * instant.a))
        for s in (-step, step)
    )
    return {name: (high[name] - low[name]) / (2.0 * step) for name in low}


def _both_sides(observed, parts, number, system, t, instant, n):
    """Derivatives of parts by a number for one that rises and for one that falls, pairs by name."""
    x, v, dx, dv = instant.x, instant.v, instant.dx[n], instant.dv[n]

    def ends(step, by_number, moves):
        """Parts with the number, and with the state where it ``moves``, less and more a step."""
        pairs = zip((-step * moves, step * moves), number.beside(step) if by_number else (system, system), strict=True)
        return [_parts(observed, State(changed, t, x + s * dx, v + s * dv)) for s, changed in pairs]

    moved, bent, depends = step_of(system, v, dx, dv), set(), set()
    sums = {name: np.zeros_like(part) for name, part in parts.items()}
    for step, *what in [(number.step, True, 0.0), *([(moved, False, 1.0)] if moved else [])]:
        low, high = ends(step, *what)
        for name, part in parts.items():
            sums[name] += (high[name] - low[name]) / (2.0 * step)
            first, second = np.abs(high[name] - low[name]), np.abs(high[name] + low[name] - 2.0 * part)
            if what[0] and (first + second).any():
                depends.add(name)
            if _is_bent(part, first, second).any():
                bent.add(name)
    sides = {name: (rate, rate) for name, rate in sums.items()}
    for by_number in (True, False) if bent else ():  # together, as a kink knows no sum
        names = {name for name in bent if (name in depends) is by_number}
        step = number.step if moved is None else moved
        if by_number and moved is not None:
            step = 10.0 ** np.floor(np.log10(min(moved, MOVED * number.size)))
        if names:
            wide, narrow = (ends(share * step, by_number, 1.0) for share in (1.0, 0.5))
        for name in names:
            sides[name] = _sides(parts[name], *(end[name] for end in (*wide, *narrow)), step=step, rate=sums[name])
    return sides


def _is_bent(part, first, second):
    """True where the second difference of a part is neither small against the first one nor rounding."""
    return (second > BENT * first) & (second > ROUNDED * np.abs(part))


def _sides(part, low, high, lower, higher, step, rate):
    """Derivatives (right, left) of a part, by values at a step and at half of it: at a kink, else ``rate`` for both.

    At a kink the second difference goes as the step, elsewhere as its square. Where the part jumps, as the tension of a
    damped line that snaps taut at this instant, it does not change, and both derivatives are those of the same side.
    """
    first, second, half = np.abs(high - low), np.abs(high + low - 2.0 * part), np.abs(higher + lower - 2.0 * part)
    bent, right, left = _is_bent(part, first, second), (high - part) / step, (part - low) / step
    kink, jump = bent & (np.abs(second - 2.0 * half) < 0.1 * second), bent & (np.abs(second - half) < 0.1 * second)
    rate = np.where(jump, np.where(np.abs(right) < np.abs(left), right, left), rate)
    return np.where(kink, right, rate), np.where(kink, left, rate)


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


def _of_sizes(observe, rates, margins):
    """(Right, left, speeds) of values, of sizes those of the sizes, which have a kink at 0.

    Where a vector comes close to 0 between steps, its smallest size is that of what is across its velocity.
    """
    part, right, left, speeds, sizes = rates
    if part.ndim == 1 and observe.select != "abs":
        return right, left, speeds
    if part.ndim == 1:
        part, right, left, speeds = (values[..., None] for values in (part, right, left, speeds))
    elif margins is not None and min(margins) > 0.0:
        fast = np.linalg.norm(speeds, axis=1, keepdims=True)
        close = np.linalg.norm(part, axis=1, keepdims=True) <= margins.reach * fast
        along = np.where(close, speeds / np.where(fast > 0.0, fast, 1.0), 0.0)
        part, right, left, speeds = (
            values - (values * along).sum(axis=-1, keepdims=True) * along for values in (part, right, left, speeds)
        )
    size = np.linalg.norm(part, axis=1)
    to = part / np.where(size > 0.0, size, 1.0)[:, None]
    ends = []
    for sign, side in ((1.0, right), (-1.0, left)):
        change = np.linalg.norm(side, axis=2)
        ends.append(np.where(size <= KINK * change * sizes[:, None], sign * change, (side * to).sum(axis=2)))
    return *ends, np.where(size > 0.0, (speeds * to).sum(axis=1), np.linalg.norm(speeds, axis=1))


def slopes_of(observe, rates, error, margins=None):
    """The `Slopes` of an observable from its `Rates`, whose value is known to an ``error``.

    At the time of a result reduced over time, its ``margins`` are given.
    """
    right, left, speeds = _of_sizes(observe, rates, margins)
    scores = observe.observable.scores(rates.values)
    best = int(scores.argmax())
    turned = margins is not None and turns_back(observe)
    if turned and (sides := _where_two_turn(observe, scores, right, left, speeds, margins)) is not None:
        return Slopes(*sides, np.zeros(len(right)))
    tied = scores >= scores[best] - TIED * abs(scores[best])
    near = tied | (scores >= scores[best] - error)
    if observe.select == "min":
        value, below = right[:, tied].min(axis=1), left[:, tied].max(axis=1)
    else:
        value, below = right[:, tied].max(axis=1), left[:, tied].min(axis=1)
    equal = np.abs(value - below) <= 1e-6 * np.maximum(np.abs(value), np.abs(below))
    value, below = np.where(equal, right[:, best], value), np.where(equal, right[:, best], below)
    every = np.concatenate([right[:, near], left[:, near]], axis=1)
    return Slopes(value, below, excess(every.min(axis=1), every.max(axis=1), value, below))


def _where_two_turn(observe, scores, right, left, speeds, margins):
    """Derivatives (right, left) where the largest score is least between instants, None where it has a smooth top.

    The scores c_i change by ċ_i τ + c_i' dp with the time τ. Where one that rises and one that falls are equal, the
    least largest one changes by the largest Σ w c' dp of all weights w with Σ w = 1 and Σ w ċ = 0; at the start or end
    of the run with Σ w ċ ≥ 0 or ≤ 0 (linear programming).
    """
    sign = -1.0 if observe.select == "min" else 1.0
    speeds, right, left = sign * speeds, sign * right, sign * left
    if observe.select == "abs":  # the larger one of a value and its negative
        scores, speeds = np.append(scores, -scores), np.append(speeds, -speeds)
        right, left = (np.concatenate([side, -side], axis=1) for side in (right, left))
    low, high = -margins.before, margins.behind
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        falls = speeds[(scores + speeds * middle).argmax()] < 0.0
        low, high = (middle, high) if falls else (low, middle)
    moved = scores + speeds * high
    active = np.flatnonzero(moved >= moved.max() - TIED * (abs(moved.max()) + margins.reach * np.abs(speeds).max()))
    rising, falling = active[speeds[active] > 0.0], active[speeds[active] < 0.0]
    if not (len(rising) and len(falling)):
        return None
    starts = low == -margins.before > -margins.reach
    ends = high == margins.behind < margins.reach
    single = rising if starts else falling if ends else active[:0]
    r, f = (part.ravel() for part in np.meshgrid(rising, falling))
    weight = speeds[r] / (speeds[r] - speeds[f])
    mixed = [
        np.concatenate([(1.0 - weight) * side[:, r] + weight * side[:, f], side[:, single]], axis=1)
        for side in (right, left)
    ]
    return sign * mixed[0].max(axis=1), sign * mixed[1].min(axis=1)


def excess(low, high, right, left):
    """Largest excess of a range of derivatives, from ``low`` to ``high``, over that from one side to the other."""
    return np.maximum(0.0, np.maximum(high - np.maximum(right, left), np.minimum(right, left) - low))
