"""Lines on winches: a line whose natural length a winch changes, see `refweb.effects.winch`.

Such a line is a thread of two nodes that stays a line: its tension and strain are those of a line, and bodies, air and
other lines feel it as one. Kernels of `refweb.effects.thread_friction` do the work: the numbers of a thread stand in
columns of line data behind `FIRST`, so that a line is a cell of theirs. The term of the lines has the tension at the
natural length as built, and the term here adds what the winch makes of it:

    force       (T(l/L' − 1) − T(l/L − 1)) t,    L' = L − δ,    δ the length that is wound
    energy      L' W(l/L' − 1) − L W(l/L − 1), and what the winch has taken

Numbers of an element stand in rows behind all places, see `refweb.effects.base.InternalVariables`, in the order of a
thread with one ring: δ; Y over EA; 0, as no ring rubs; the time until which it has wound; what the winch has taken over
EA. They are no unknowns: each step ends with those that follow from positions there. Of a winch of constant power the
first and the last are unknowns, see `refweb.effects.winch_power`.

May change: private functions and messages. Must stay: the name "winch" of the terms, which `studies.modes` has; the
columns from `FIRST` on (`KIND`, `NUMBERS`, `POWERED`) and the order of an element's numbers in its row (`SLIP`,
`UNTIL`, `TAKEN`, …), which kernels, `numbers_in` and `wound_mass` read; ``wound`` of the net, where `winch` notes the
lines; `with_wound`, which `system.system` calls, `rewind` and `standing`, which `dynamics.initial_state` and
`results.observables` call; methods of `WoundLines`, which `integrators.yielding` calls as the ``follower``; `settled`
and `write_numbers`, which `winch` imports. Tests: ``tests/effects/test_wound_lines.py``.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..compiled.rows import record_at
from ..errors import InputError
from ..kernels import BOUND, ENERGY, FORCE, RELAX, STIFFNESS, kernel
from ..net.threads import COLUMNS
from . import elasticity, thread_friction
from .base import LINE_OUT, Balance, CellElements, ForceTerm, InternalVariables, Tangent, Timing, no_force, with_rows
from .line_kernels import add_stiffness, pull_together, strain
from .thread_slips import SEGMENT

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.net import Net

FIRST = "winch_0"
"""Column of line data with 1/A; vector and distance, first row, kind of the ends and numbers of the winch follow it."""
KIND, NUMBERS = 6, 7
"""Columns from there to the kind of the ends, 0 without a winch, and to the numbers of a winch."""
AT_LAST = 3.0
"""Kind of the ends of a line on a winch, see `refweb.net.threads.ThreadLine.ends`."""
ROWS_OF_ONE = 2
"""Rows of the numbers of an element."""
SLIP, UNTIL = 0, 3
"""Places among these of what is wound and of the time until which it is."""
TAKEN = 4
"""Place of what a winch has taken."""
POWERED = "winch_powered"
"""Column of line data that is 1 for elements on a winch of constant power; there is none where none is."""
SPEED_LIMIT = 2
"""Place of its largest speed among the numbers of a winch."""


@functools.cache
def kernels(law, record, first, gradients, weights):
    """Force, energy kept, stiffness, bound, energy taken and relaxation kernels.

    Parameters
    ----------
    law, record, gradients, weights
        As of `refweb.effects.elasticity.kernels`, of elements of two nodes.
    first : int
        Number of the column `FIRST`.
    """
    acting = thread_friction.kernels(law, record, first)
    _, energy_by_law, stiffness_by_law, bound_by_law, *_ = elasticity.kernels(law, record, gradients, weights)
    force_of, kept_of, stiffness_of = acting.force, acting.kept, acting.stiffness
    bound_of, taken_of, relax_of = acting.bound, acting.taken, acting.relax
    flat, stress = tuple(value for row in gradients for value in row), law.stress

    @kernel(forceinline=True)
    def is_wound(data, c):
        return data[c, first + KIND] > 0.0

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        of_thread = np.empty((1, COLUMNS + 2))
        for c in range(cells.shape[0]):
            shows = record_at(LINE_OUT, out, c, 0)
            shows.damped_tension = shows.tension
            if is_wound(data, c):
                p0, p1, p2, inverse, e = strain(x, cells, data, c, 0, 2, flat)
                pull = -stress(e, record_at(record, data, c, 0)) * inverse
                pull_together(f, cells, c, 0, 2, flat, pull, p0, p1, p2)
                force_of(t, x, v, f, cells[c : c + 1], data[c : c + 1], of_thread)
                shows.damped_tension, shows.strain = of_thread[0, 0], of_thread[0, 2]

    @kernel(ENERGY)
    def kept(t, x, cells, data, out):
        by_law = np.empty(1)
        for c in range(cells.shape[0]):
            out[c] = 0.0
            if is_wound(data, c):
                kept_of(t, x, cells[c : c + 1], data[c : c + 1], out[c : c + 1])
                energy_by_law(t, x, cells[c : c + 1], data[c : c + 1], by_law)
                out[c] -= by_law[0]

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        by_law = np.empty((1, 6, 6))
        for c in range(cells.shape[0]):
            blocks[c] = 0.0
            if is_wound(data, c):
                stiffness_of(t, x, v, blocks[c : c + 1], cells[c : c + 1], data[c : c + 1], definite)
                stiffness_by_law(t, x, v, by_law, cells[c : c + 1], data[c : c + 1], definite)
                blocks[c] -= by_law[0]
                if definite:  # of the parts along and across those that are not negative
                    p0, p1, p2, inverse, _ = strain(x, cells, data, c, 0, 2, flat)
                    p, along, both = (p0 * inverse, p1 * inverse, p2 * inverse), 0.0, 0.0
                    for i in range(3):
                        both += blocks[c, i, i]
                        for j in range(3):
                            along += p[i] * blocks[c, i, j] * p[j]
                    blocks[c] = 0.0
                    add_stiffness(blocks, c, 0, 2, flat, max(along, 0.0), max(0.5 * (both - along), 0.0), p)

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        for c in range(cells.shape[0]):
            if is_wound(data, c):
                i, j = cells[c, 0], cells[c, 1]
                first_rate, second_rate = rates[i], rates[j]
                bound_by_law(reach, speed, x, mass, rates, cells[c : c + 1], data[c : c + 1])
                first_by_law, second_by_law = rates[i], rates[j]
                rates[i], rates[j] = first_rate, second_rate
                bound_of(reach, speed, x, mass, rates, cells[c : c + 1], data[c : c + 1])
                rates[i], rates[j] = max(rates[i], first_by_law), max(rates[j], second_by_law)

    @kernel(ENERGY)
    def taken(t, x, cells, data, out):
        for c in range(cells.shape[0]):
            out[c] = 0.0
            if is_wound(data, c):
                taken_of(t, x, cells[c : c + 1], data[c : c + 1], out[c : c + 1])

    @kernel(RELAX)
    def relax(h, x, cells, data, before, lost):
        for c in range(cells.shape[0]):
            lost[c] = 0.0
            if is_wound(data, c):
                relax_of(h, x, cells[c : c + 1], data[c : c + 1], before, lost[c : c + 1])

    return force, kept, stiffness, bound, taken, relax


@functools.cache
def power_kernels(law, record, first, powered, gradients, weights):
    """Force, stiffness, bound and relaxation kernels where some lines are on winches of constant power.

    Cells are the nodes and both rows of numbers of each element, but nodes alone of the last. Parameters are those of
    `kernels`, and the number of the column `POWERED`.
    """
    from .winch_power import power_kernels as of_threads

    force_of, _, stiffness_of, bound_of, *_ = kernels(law, record, first, gradients, weights)
    acting = of_threads(law, record, first)
    add_rates, add_slopes, relax_of = acting.add_rates, acting.add_slopes, acting.relax

    @kernel(FORCE)
    def force(t, x, v, f, cells, data, out):
        nodes, w = cells[:, :2].copy(), np.empty(1, SEGMENT)
        force_of(t, x, v, f, nodes, data, out)
        for c in range(cells.shape[0]):
            if data[c, powered] > 0.0:
                add_rates(t, x, f, nodes, data, c, w)

    @kernel(STIFFNESS)
    def stiffness(t, x, v, blocks, cells, data, definite):
        nodes, w, slopes = cells[:, :2].copy(), np.empty(1, SEGMENT), np.empty((1, 7))
        of_nodes = np.empty((cells.shape[0], 6, 6))
        stiffness_of(t, x, v, of_nodes, nodes, data, definite)
        blocks[:] = 0.0
        blocks[:, :6, :6] = of_nodes
        for c in range(0 if definite else cells.shape[0]):
            if data[c, powered] > 0.0:
                add_slopes(t, x, blocks, nodes, data, c, w, slopes)

    @kernel(BOUND)
    def bound(reach, speed, x, mass, rates, cells, data):
        bound_of(reach, speed, x, mass, rates, cells[:, :2].copy(), data)

    @kernel(RELAX)
    def relax(h, x, cells, data, before, lost):
        for c in range(cells.shape[0]):
            lost[c] = 0.0
            if data[c, powered] > 0.0:
                relax_of(h, x, cells[c : c + 1], data[c : c + 1], before, lost[c : c + 1])

    return force, stiffness, bound, relax


def of(net: Net) -> Any:
    """The kernels for the laws and the element of a net."""
    return kernels(net.law, net.law_record, net.line_data.column(FIRST), *net.quadrature)


def with_wound(net: Net) -> Net:
    """The net with rows and columns for all lines on winches, ahead of rows of threads; one that has them as it is."""
    if FIRST in (net.line_data.dtype.names or ()):
        return net
    given = [(elements, winch.numbers(net.quasi_static)) for elements, winch in net.wound]
    count, lines = len(net.cells), net.line_data
    columns = np.zeros((count, NUMBERS + max(len(numbers) for _, numbers in given)))
    columns[:, 0], columns[:, 1:4], columns[:, 4] = 1.0 / net.area, lines.reference, lines.distance
    columns[:, 5] = len(net.points) + ROWS_OF_ONE * np.arange(count)
    for elements, numbers in given:
        columns[elements, KIND] = AT_LAST
        columns[elements, NUMBERS : NUMBERS + len(numbers)] = numbers
    for i, values in enumerate(columns.T):
        net = net.with_column(f"winch_{i}", values)
    powered = np.zeros(count)
    for elements, winch in net.wound:
        powered[elements] = winch.power is not None and not net.quasi_static
    if powered.any():
        net = net.with_column(POWERED, powered)
    return with_rows(net, ROWS_OF_ONE * count)


def write_numbers(net: Net, elements: NDArray[np.int64], numbers: tuple[float, ...]) -> list[Any]:
    """(Line data of a net, places of the numbers of the winch of some elements, other ``numbers``)."""
    columns = net.line_data.column(FIRST) + NUMBERS + np.arange(len(numbers))
    return [(net.line_data.matrix, np.ix_(elements, columns), numbers)]


def elements_of(net: Net) -> NDArray[np.int64]:
    """Elements on winches, shape (wound,)."""
    return np.concatenate([elements for elements, _ in net.wound])


def standing(net: Net) -> tuple[NDArray[np.bool_], Any]:
    """(True for each element on a winch, line data in which all winches stand still whatever the tension is)."""
    lines, wound = net.line_data.copy(), np.zeros(len(net.cells), dtype=bool)
    wound[elements_of(net)] = True
    at = lines.column(FIRST) + NUMBERS
    lines.matrix[wound, at : at + 3] = -np.inf, np.inf, 0.0
    return wound, lines


def refuse_beside(net: Net) -> None:
    """Refuse what changes natural lengths of lines on winches beside these, and other internal variables."""
    wound = elements_of(net)
    for elements, _ in net.factors:
        for element in np.intersect1d(elements, wound)[:1]:
            raise InputError(
                f"line {net.line[element]} is on a [[winch]], and its natural length follows no [[reel]] or "
                "[temperature] as well: leave it out there"
            )
    if net.rows_of_elements > ROWS_OF_ONE * len(net.cells):
        raise InputError(
            'lines on a [[winch]] cannot stand beside [cable.viscous] or law = "elastic-plastic": take a [[thread]] of '
            "two nodes for each"
        )


def terms(net: Net) -> list[ForceTerm]:
    """Terms of what winches make of the tension of lines, and of the energy that they take."""
    refuse_beside(net)
    force, kept, stiffness, bound, taken, relax = of(net)
    column = net.line_data.column(FIRST) + NUMBERS
    corners = [t for _, winch in net.wound for t, _ in winch.speeds]
    common = {"name": "winch", "cells": net.cells, "data": None}
    tension = ForceTerm(
        **common,
        force=force,
        tangent=Tangent(stiffness, bound, symmetric=False),
        balance=Balance("strain_energy", internal=True),
        timing=Timing(corners),
        elements=CellElements(adds_tension=True),
    )
    stored = ForceTerm(**common, force=no_force, energy=kept, balance=Balance("strain_energy", internal=True))
    none = np.zeros(0, dtype=np.int64)
    wound = ForceTerm(
        **common,
        force=no_force,
        energy=taken,
        balance=Balance("winch_energy", internal=True),
        elements=CellElements(
            internal=InternalVariables(none, none, np.zeros(0), relax, 0, "[[winch]]", WoundLines(relax, column))
        ),
    )
    return [*_with_power(net, tension), stored, wound]


def _with_power(net, tension):
    """The term of the tension, and of what winches of constant power wind; where there are any, it has their rates."""
    if POWERED not in (net.line_data.dtype.names or ()):
        return [tension]
    first, powered = net.line_data.column(FIRST), net.line_data.column(POWERED)
    force, stiffness, bound, relax = power_kernels(net.law, net.law_record, first, powered, *net.quadrature)
    rows = net.line_data.matrix[:, first + 5].astype(np.int32)
    elements = np.flatnonzero(net.line_data.matrix[:, powered])
    unknowns = (3 * rows[elements, None] + np.array([SLIP, TAKEN])).astype(np.int64).ravel()
    none, ones = np.full(len(unknowns), -1, dtype=np.int64), np.ones(len(unknowns))
    with_rates = replace(
        tension,
        cells=np.column_stack([net.cells, rows, rows + 1]),
        force=force,
        tangent=Tangent(stiffness, bound, symmetric=False),
    )
    length = ForceTerm(
        name="winch",
        cells=net.cells,
        data=None,
        force=no_force,
        balance=Balance("winch_energy", internal=True),
        timing=Timing(at_rest=False),
        elements=CellElements(internal=InternalVariables(unknowns, none, ones, relax, 0, "[[winch]] power")),
    )
    return [with_rates, length]


def numbers_in(net: Net, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Numbers of lines on winches in displacements of all rows, of which it is a view, shape (elements, 6)."""
    first = len(x) - net.internal
    return x[first : first + net.rows_of_elements].reshape(len(net.cells), -1)


def rewind(net: Net, x: NDArray[np.float64]) -> None:
    """Let the time of all winches on lines begin at 0 in displacements of all rows."""
    numbers_in(net, x)[:, UNTIL] = 0.0


def settled(net: Net, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement of all rows as a run begins from: with what winches wind at once, and no energy taken."""
    x = x.copy()
    numbers_in(net, x)[:, SLIP + 1 :] = 0.0
    x = WoundLines(of(net)[5], net.line_data.column(FIRST) + NUMBERS).taken_on(net, x, 0.0)
    numbers_in(net, x)[:, SLIP + 1 :] = 0.0
    return x


class WoundLines:
    """Lengths that are wound of lines, which follow at once, see `refweb.effects.base.InternalVariables`.

    Parameters
    ----------
    relax : kernel
        Relaxation.
    column : int
        First column of the numbers of winches.
    """

    def __init__(self, relax, column):
        self._relax, self._column = relax, column

    def taken_on(self, net: Net, x: NDArray[np.float64], t: float) -> NDArray[np.float64]:
        """Displacement of all rows with what winches have wound until t, from what they have before in x."""
        x, lost = x.copy(), np.zeros(len(net.cells))
        span = t - numbers_in(net, x)[elements_of(net)[0], UNTIL]
        self._relax(max(span, thread_friction.LEAST), x, net.cells, net.line_data.matrix, lost, lost)
        return x

    def grown(self, net: Net, x: NDArray[np.float64], t: float) -> NDArray[np.float64]:
        """Length that is wound in a step, and what a winch may wind more, over that of the line [1]."""
        wound, before = elements_of(net), numbers_in(net, x)
        length = net.natural_length[wound]
        moved = np.abs(numbers_in(net, self.taken_on(net, x, t)) - before)[wound, SLIP] / length
        limit = net.line_data.matrix[wound, self._column + SPEED_LIMIT]
        limited = (limit > 0.0) & np.isfinite(limit)
        reach = limit[limited] * (t - before[wound[0], UNTIL]) / length[limited]
        return np.append(moved, reach - moved[limited])

    drive = grown
