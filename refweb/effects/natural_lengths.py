"""Natural lengths at a time: those of the net, times factors by tables over time.

Reels and heat add factors to the net; nothing else changes natural lengths. Only `set_lengths` computes them; it writes
them to the line data of its caller.

May change: how kernels are written. Must stay: fields of `NaturalLengths`, which the explicit loop reads by name; ∞ and
−∞ behind the corners, on which `explicit_loop` and `step_bound` count; the column `GROWTH`, which `damping` adds.
`set_lengths` is the only place that computes lengths: a new effect on them calls `with_factor`. Must stay as well:
`shortest_of`, which `self_contact.table` imports; `set_growth`, which `integrators.energy_balance` and
`integrators.step` import; `set_lengths_by_blocks`, which explicit steps and their bound call; `work_of_lengths`, which
`system.system` imports. Tests: ``tests/effects/test_reel.py``, ``tests/effects/test_viscous.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ..compiled.rows import record_at
from ..errors import InputError
from ..kernels import (
    ENERGY,
    INDICES,
    VECTOR,
    Arrays,
    EnergyTable,
    Functions,
    IndexTable,
    IntegerMatrix,
    Integers,
    Matrix,
    Record,
    Vector,
    VectorTable,
    kernel,
)
from .base import column
from .elasticity import length_force
from .line_kernels import LINE
from .mass_flow import FollowedMass, set_masses
from .time_tables import flattened, interpolate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..net.net import Net

GROWTH = "growth"
"""Column of line data with (dL/dt)/L of each element [1/s], of effects that need it."""


def work_of_lengths(net):
    """The kernel (signature `refweb.kernels.ENERGY`) of ∂E/∂L of each element [N], internal variables included."""
    return (net.length_force or length_force)(net)


class NaturalLengths(Record):
    """Natural lengths that change over time.

    Attributes
    ----------
    elements : ndarray of int, shape (changing,)
        Numbers of the elements that change, increasing.
    built : ndarray, shape (changing,)
        Natural lengths that the factors multiply [m].
    runs : ndarray of int, shape (runs, 2)
        First and last + 1 of the elements that follow each other.
    cells, tables : table
        Elements of each factor, as a column, and its table over time.
    growth : int
        Column of (dL/dt)/L in the numbers of the lines; −1 without one.
    by_length : table
        One kernel of ∂E/∂L [N], where any length changes.
    corners : ndarray
        Times at which a factor has a corner [s], increasing; if there are factors, then ∞ for the end of a row and −∞
        for its start.
    masses : refweb.effects.mass_flow.FollowedMass
        Masses that follow the lengths.
    """

    elements: Integers
    built: Vector
    runs: IntegerMatrix
    cells: IndexTable
    tables: VectorTable
    growth: int
    by_length: EnergyTable
    corners: Vector
    masses: FollowedMass

    @classmethod
    def of(cls, net: Net) -> Self:
        """Make the record of a net."""
        factors = net.factors
        elements = np.unique(np.concatenate([[], *(part for part, _ in factors)])).astype(np.int64)
        begins = np.flatnonzero(np.diff(elements, prepend=-2) > 1)
        ends = np.append(begins[1:], len(elements))[: len(begins)] - 1
        corners = sorted({t for _, table in factors for t, _ in table})
        return cls(
            elements=elements,
            built=net.natural_length[elements],
            runs=np.ascontiguousarray(np.column_stack([elements[begins], elements[ends] + 1])),
            cells=Arrays(INDICES, [column(part) for part, _ in factors]),
            tables=Arrays(VECTOR, [np.array(flattened(table)) for _, table in factors]),
            growth=net.line_data.column(GROWTH) if factors and GROWTH in (net.line_data.dtype.names or ()) else -1,
            by_length=Functions(ENERGY, [work_of_lengths(net)] if factors else []),
            corners=np.array([*corners, *([np.inf] if factors else []), -np.inf]),
            masses=FollowedMass.none(),
        )


@kernel(apart=("growth",))
def set_growth(t: float, lengths: NaturalLengths, lines: Matrix) -> None:
    """Write (dL/dt)/L at time t, at a corner of a factor that behind it, to the numbers of all ``lines``."""
    for c in range(lengths.elements.size):
        lines[lengths.elements[c], lengths.growth] = 0.0
    for i in range(len(lengths.tables)):
        (factor, slope), cells = interpolate(t, lengths.tables[i], 0, 2, 1), lengths.cells[i]
        for c in range(cells.shape[0]):
            lines[cells[c, 0], lengths.growth] += slope / factor


@kernel(apart=("lengths",))
def set_lengths(t: float, lengths: NaturalLengths, lines: Matrix) -> None:
    """Write natural lengths at time t to the numbers of all ``lines``, and masses that follow them."""
    for c in range(lengths.elements.size):
        record_at(LINE, lines, lengths.elements[c], 0).natural_length = lengths.built[c]
    for i in range(len(lengths.tables)):
        factor, cells = interpolate(t, lengths.tables[i], 0, 2, 1)[0], lengths.cells[i]
        for c in range(cells.shape[0]):
            record_at(LINE, lines, cells[c, 0], 0).natural_length *= factor
    if lengths.masses.rows.size:
        set_masses(t, lengths.masses)
    if lengths.growth >= 0:
        set_growth(t, lengths, lines)


@kernel(apart=("lengths",))
def set_lengths_by_blocks(
    t: float, lengths: NaturalLengths, lines: Matrix, places: Integers, blocks: Matrix
) -> None:  # fmt: skip
    """Write the same to the numbers of all ``lines``, and natural lengths to ``places`` among those of blocks."""
    set_lengths(t, lengths, lines)
    numbers = blocks.reshape(-1)
    for c in range(places.size):
        numbers[places[c]] = record_at(LINE, lines, lengths.elements[c], 0).natural_length


def with_factor(net: Net, lines: NDArray[np.int64], table: Any) -> Net:
    """The net with a factor on the natural lengths of some lines.

    Parameters
    ----------
    net : refweb.net.net.Net
        The net.
    lines : ndarray of int, shape (k,)
        Lines of the web; all elements of a line share the factor.
    table : sequence of (t, factor)
        Linear in between, end values held.

    Raises
    ------
    InputError
        For a line with a law of form finding.
    """
    elements = np.flatnonzero(np.isin(net.line, lines))
    for element in elements[net.forming[elements]][:1]:
        raise InputError(
            f"line {net.line[element]} has a law of form finding, whose tension does not depend on its natural length: "
            "leave it out"
        )
    return replace(net, factors=(*net.factors, (elements, table)))


def shortest_of(net: Net) -> NDArray[np.float64]:
    """Least natural length of each element in a run [m], shape (cells,).

    Between corners a length is a product of positive linear functions of time, which has its minimum at an end.
    """
    lengths, numbers, shortest = NaturalLengths.of(net), net.line_data.copy(), net.natural_length.copy()
    shortest[lengths.elements] = np.inf
    for t in {0.0, net.end, *lengths.corners[(lengths.corners > 0.0) & (lengths.corners < net.end)]}:
        set_lengths(t, lengths, numbers.matrix)
        np.minimum(shortest, numbers.natural_length, out=shortest)
    return shortest
