"""Results as functions of an equilibrium and of numbers of the scene: their values and derivatives.

A largest or smallest value is that of one line, node or element; where others have the same value within ±, the result
has one derivative to each side, and there is a `Response` for each of these.

May change: private functions and `STEP`. `EQUAL` decides when values count as equal, so that a result has a derivative
to each side; `MOST` is a limit of what is accepted. Must stay: fields of `Response`, which `gradients` and
`studies.frequency_gradients` read; ``slope`` and ``explicit`` are derivatives of ``value``: change them together. A new
quantity of ``[[observe]]`` needs a branch in `responses`; without one `gradients` refuses it by name. Tests:
``tests/statics/test_gradients.py``.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..results.observables.balances import Booked
from ..results.observables.distances import Between
from ..results.observables.line import Strain, Stress, Tension
from ..results.observables.nodal import Place
from ..results.observables.reaction import Reaction
from ..results.observables.rotation import Orientation
from ..results.observables.support import AxleAngle
from ..results.observables.thread import OfThread
from ..results.state import State
from .adjoint import LineState, Sensitivity

EQUAL = 1e-9
"""Difference of two values, over the larger, within which both count as the largest."""
MOST = 64
"""Largest number of values that may be equal."""
STEP = 1e-5
"""Step of a difference over the size of what is measured, of a turn in rad."""


class Response(NamedTuple):
    """A result of one line, node or net at an equilibrium.

    Attributes
    ----------
    again : callable
        The same `Response` at another `refweb.statics.adjoint.Adjoint`.
    value : callable
        Its value in a `refweb.results.state.State`, of the scene or of one whose numbers differ.
    slope : ndarray, shape (rows, 3)
        ∂J/∂x.
    explicit : refweb.statics.adjoint.Sensitivity
        ∂J/∂p by numbers of elements and rows.
    reacting : ndarray, shape (rows, 3)
        Displacement of supports whose virtual work, reversed, the result is; 0 for results that are no reaction.
    doubt : ndarray, shape (rows, 3), optional
        Possible error of the slope, where it is one of differences.
    loaded : ndarray, shape (rows, 3), optional
        ∂J/∂f by a further load on each row, where it is not 0: of work, the displacement.
    size : float
        Sum of the sizes of terms whose difference the value is, for its rounding.
    beside : tuple of (Response, float)
        The response with an enlarged error of what it is made of, and the share of that in ±.
    """

    again: Any
    value: Any
    slope: np.ndarray
    explicit: Sensitivity
    reacting: np.ndarray
    doubt: np.ndarray | None = None
    loaded: np.ndarray | None = None
    size: float = 0.0
    beside: tuple[tuple[Any, float], ...] = ()


def responses(observe, linear):
    """The `Response` of each line or node whose value is the result, a list.

    Parameters
    ----------
    observe : refweb.Observe
        The observable.
    linear : refweb.statics.adjoint.Adjoint
        The equilibrium.

    Raises
    ------
    InputError
        For a quantity without a gradient, and too many lines or nodes of equal values.
    """
    observable = observe.observable
    if type(observable) in (Tension, Stress, Strain):
        makers = _lines(observable, linear)
    elif isinstance(observable, Reaction):
        makers = _reactions(observable, linear)
    elif isinstance(observable, Place):
        makers = _nodes(observable, linear)
    elif isinstance(observable, Booked):
        makers = [partial(_energy, observe.quantity)]
    elif isinstance(observable, (Between, OfThread, Orientation, AxleAngle)):
        makers = [partial(_by_differences, observable)]
    else:
        raise InputError(f'quantity = "{observe.quantity}" has no gradient: it is not smooth, or is a force on a body')
    return [make(linear) for make in makers]


def _nothing(linear):
    """(Sensitivity, rows) of zeros."""
    return Sensitivity.zeros(linear.net), np.zeros_like(linear.x)


def _equal(observable, values, changes):
    """Places of the values that are the largest, or whatever counts, within the changes by errors of x."""
    scores = observable.scores(values)
    best = int(scores.argmax())
    near = EQUAL * np.abs(values).max(initial=0.0) + 3.0 * (changes + changes[best])
    at = np.flatnonzero(scores >= scores[best] - near)
    if len(at) > MOST:
        raise InputError(f"{len(at)} lines or nodes have the same value, of which up to {MOST} are taken: name some")
    return at


def _sign(observable, value):
    """Sign of a value whose size counts, else 1; refuses one that is 0."""
    if observable.observe.select != "abs":
        return 1.0
    if value == 0.0:
        raise InputError("a size has a kink at 0: leave out select")
    return float(np.sign(value))


def _lines(observable, linear):
    """Makers of responses of elements, each at its most strained quadrature point."""
    net, elements, lines = linear.net, observable.elements(linear.net), linear.lines
    values = observable.values(linear.state)[elements]
    strained, every = type(observable) is Strain, np.arange(len(net.cells))
    point = (lines.strain if strained else lines.tension).argmax(axis=1)
    slope = np.ones(len(every)) if strained else lines.tangent[every, point]
    slope = slope * observable.scale(net) / (net.weights[point] * net.natural_length)
    moved = np.array([lines.stretch(move)[every, point] for move in linear.deviations])
    changes = np.abs(moved * slope).sum(axis=0)[elements]
    return [
        partial(_line, observable, strained, int(elements[at]), int(point[elements[at]]), _sign(observable, values[at]))
        for at in _equal(observable, values, changes)
    ]


def _line(observable, strained, cell, q, sign, linear):
    """The response of a quadrature point of an element."""
    net, lines, (explicit, reacting) = linear.net, linear.lines, _nothing(linear)
    scale, tension = sign * float(observable.scale(net)[cell]), float(lines.tension[cell, q])
    slope = scale * (1.0 if strained else float(lines.tangent[cell, q]))
    explicit.length[cell] = -slope * (1.0 + lines.strain[cell, q]) / net.natural_length[cell]
    if not strained and tension:
        explicit.axial[cell] = scale * tension / net.line_data.ea[cell]
    if type(observable) is Stress:
        explicit.area[cell] = -sign * tension / net.area[cell] ** 2
    number, rows = cell * len(net.weights) + q, np.zeros_like(linear.x)
    bar = net.bars[[number]]
    along = slope / (net.weights[q] * net.natural_length[cell]) * lines.direction[number]
    rows[bar.indices] = bar.data[:, None] * along

    def value(state):
        changed = LineState(state.system.at(state.time).net, state.x)
        quantity = changed.strain if strained else changed.tension
        return sign * float(quantity[cell, q] * observable.scale(changed.net)[cell])

    return Response(partial(_line, observable, strained, cell, q, sign), value, rows, explicit, reacting)


def _nodes(observable, linear):
    """Makers of responses of rows, a component or the size of a vector each."""
    rows = observable.rows(linear.system)
    values = observable.sizes(observable.vectors(linear.state)[rows])
    changes = np.abs(linear.deviations).sum(axis=(0, 2))[rows]
    return [
        partial(_node, observable, int(rows[at]), _sign(observable, values[at]))
        for at in _equal(observable, values, changes)
    ]


def _node(observable, row, sign, linear):
    """The response of a row."""
    (explicit, reacting), component = _nothing(linear), observable.observe.component
    slope = np.zeros_like(reacting)
    slope[row] = sign * _along(observable.vectors(linear.state)[row], component)

    def value(state):
        return sign * float(observable.sizes(observable.vectors(state)[[row]])[0])

    return Response(partial(_node, observable, row, sign), value, slope, explicit, reacting)


def _along(vector, component):
    """Slope of the component or the size of a vector."""
    if component is not None:
        return np.eye(3)[component]
    size = np.linalg.norm(vector)
    if not size > 0.0:
        raise InputError("the size of a vector has a kink at 0: name a component")
    return vector / size


def _reactions(observable, linear):
    """Makers of responses of supports: the force of one, or the sum of their forces."""
    if observable.observe.body is not None:
        raise InputError("the force on a body is not taken: observe the reaction of nodes")
    rows, reaction = observable.rows(linear.system), linear.state.reaction
    if observable.observe.select is None:
        return [partial(_reaction, observable, list(rows), 1.0)]
    values = observable.sizes(reaction[rows])
    return [
        partial(_reaction, observable, [int(rows[at])], _sign(observable, values[at]))
        for at in _equal(observable, values, np.zeros(len(rows)))
    ]


def _reaction(observable, group, sign, linear):
    """The response of the sum of the forces of some supports."""
    explicit, reacting = _nothing(linear)
    along = sign * _along(linear.state.reaction[group].sum(axis=0), observable.observe.component)
    reacting[group] = np.where(linear.system.supported[group], along, 0.0)

    def value(state):
        return sign * float(observable.sizes(state.reaction[group].sum(axis=0, keepdims=True))[0])

    return Response(partial(_reaction, observable, group, sign), value, linear.pulled(reacting), explicit, reacting)


def _energy(name, linear):
    """The response of an energy of the net."""
    system, net, (explicit, reacting) = linear.system, linear.net, _nothing(linear)
    shares = [(term, _share(name, term.balance.column)) for term in system.terms if term.energy is not None]
    slope: Any = -sum((share * system.force_of(term, linear.t, linear.x) for term, share in shares if share), reacting)
    if _share(name, "strain_energy"):
        energy, ea = system.energy_of(system.lines, linear.t, linear.x), net.line_data.ea
        explicit.axial[:] = energy / np.where(ea != 0.0, ea, 1.0)
        explicit.length[:] = system.length_force(linear.t, linear.x)
    for term in linear.weight:
        energy = system.energy_of(term, linear.t, linear.x)
        np.add.at(explicit.mass, term.cells[:, 0], _share(name, term.balance.column) * energy)

    def value(state):
        return float(state.energies[name])

    loaded = linear.x if name == "work" else None
    return Response(partial(_energy, name), value, slope, explicit, reacting, loaded=loaded)


def _share(name, column):
    """Share of an energy of one column of the energy balance in another."""
    if name == "work":
        return -1.0 if column == "work" else 0.0
    return float(column != "work" and name in (column, "total_energy"))


def _by_differences(observable, linear):
    """The response of what follows from places and turns of some rows, by differences of order 4."""
    system, (explicit, reacting) = linear.system, _nothing(linear)
    rows, size = _rows_and_size(observable, linear)
    spins = [body.spin for body in system.net.bodies if body.spin is not None]
    bodies = [row for body in system.resting for row in (body.row, body.spin) if row is not None]
    slope, doubt, moves = np.zeros_like(reacting), np.zeros_like(reacting), ~system.supported
    moves[: system.net.nodes] |= system.fixed[: system.net.nodes]  # supports, for derivatives by their positions
    for row, axis in np.argwhere(moves):
        if row not in (*rows, *bodies):
            continue
        step, values = STEP * (1.0 if row in spins else size), []
        for steps in (-2.0, -1.0, 1.0, 2.0):
            move = np.zeros_like(slope)
            move[row, axis] = steps * step
            values.append(observable.of(State(system, linear.t, system.moved(linear.x, move))).value)
        near = (values[2] - values[1]) / (2.0 * step)
        slope[row, axis] = best = (8.0 * near - (values[3] - values[0]) / (2.0 * step)) / 6.0
        doubt[row, axis] = best - near

    def value(state):
        return observable.of(state).value

    return Response(partial(_by_differences, observable), value, slope, explicit, reacting, doubt)


def _rows_and_size(observable, linear):
    """Rows that a value depends on, and a length that differences are small against [m]."""
    if isinstance(observable, OfThread):
        thread = next(t for t in linear.net.threads if t.name == observable.observe.thread)
        return thread.rows, thread.natural_length
    if isinstance(observable, Between):
        rows = observable.rows(linear.system)
        return rows, float(np.ptp(linear.state.position[rows], axis=0).max())
    if isinstance(observable, Orientation) and observable.of(linear.state).value == 0.0:
        raise InputError("the angle of a body has a kink at 0: name a component")
    return [observable.body(linear.net).row], float(linear.net.natural_length.min())
