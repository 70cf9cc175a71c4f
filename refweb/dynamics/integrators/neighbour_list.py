"""Neighbour lists: lines that a body cannot reach yet are not evaluated in every step.

A list of the lines within a skin around a body is valid until the approach may exceed the depth of the skin. In a step
no row moves by more than the fastest one, and a line approaches a body by at most twice that. Therefore no contact is
missed. Results are those with all lines to the last bit, since lines without contact add nothing to any sum.

A list is deep enough for the next `LASTS` steps, and for the bound on the steps of the next row if that needs at most
`LONGEST` steps. Thus a list is made once in several rows, by a search over all lines.

With lines that touch lines, each row has a margin of its own in a list, by which it may move in axes that have the mean
velocity of all rows: two rows come nearer by at most the sum of their margins. A row has the margin that it takes in
`INNER` steps at its velocity, so that few fast rows do not make lists of slow ones long. In each step the places of
rows are compared with those at which the list was made, and the list is made anew where a row leaves its margin. It is
taken from a wider one, with margins for more steps, which is valid while the margins of the list are within its own.
These are at most half of `WIDEST` of the length of elements, since else every element would be near another, and last
for fewer steps, down to `FEWEST`, if the list costs more than the search.

Pairs stand in the order of their elements, so that sums do not depend on where lists are made.

May change: `LASTS`, `LONGEST`, `WIDEST`, `MANY`, `FEWEST`, `PRICE`, `INNER` and `EVEN`, which trade searches for
evaluations; `FLOOR` and `BEND` upwards. Must stay: no change may miss a contact, so that `WAY`, `SHARE` and `COVERED`,
parts of the bound, stay; results are those with all lines, bit for bit. Places behind the terms in
`records.ForceTerms` are in the order of `near_of`, also for `contacts`, `step_bound` and `implicit_contacts`. `ccd`
leaves out cells and checks by ``depth``, ``used``, ``last`` and ``steps`` of `SKIN`: their meaning stays, or a passage
is missed; `ccd` writes `fastest`, in one word with `top`, and `central_difference` reads and sets back `longest`. Must
stay as well: all names that `explicit_loop`, `central_difference` and other files import; public names of
`NeighbourList`, which other files use. Tests: ``tests/dynamics/integrators/test_nearby.py``.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numba import from_dtype, types

from ...compiled.tables import ArraysType
from ...effects.self_contact.search import margins_ahead
from ...kernels import (
    INDICES,
    MATRIX,
    VECTOR,
    Arrays,
    Functions,
    IndexTable,
    Indices,
    Integers,
    Matrix,
    MatrixTable,
    Record,
    VectorTable,
    kernel,
)
from ...net.rotation_bounds import fastest_surface
from .vector_spread import spread_of

if TYPE_CHECKING:
    from .records import ForceTerms, Model

LASTS = 64.0
"""Number of steps that a list should last at the speed of its first step."""
LONGEST = 256.0
"""Largest such number if the bound on the steps of the next row needs a deeper skin."""
WIDEST, MANY, FEWEST = 0.5, 512.0, 6.0
"""Largest depth of a skin around pairs over the mean length of elements; largest and least number of steps that it
should last."""
PRICE = 400.0
"""Time of the search of the pairs of an element, over that of a pair of the wide list in a step."""
INNER = 24.0
"""Number of steps that margins of rows last in a list that is taken from a wider one; 16 and 32 take longer. To mark in
each step which listed cells of a body cannot touch yet, by the ways of their rows, takes as long as it saves."""
FLOOR, EVEN = 0.6, 0.2
"""Least margin of a row over the largest approach of rows in the last `COVERED` steps: of any two half of that
suffices; and in the wider list over the way that the spread of velocities is in the steps that it should last."""
BEND = 0.25
"""Approach in a step between its ends, over that at its end: accelerations bend the motion."""
COVERED = 3
"""Number of steps whose motion must be known before a list is made, since peaks are searched in these."""
WAY = 2.0 * math.sqrt(3.0)
"""Largest approach of two rows, over the largest component of a displacement."""
SHARE = 0.999
"""Share of a skin that may be used up: the rest is for rounding."""
SIGN = np.int64(0x7FFFFFFFFFFFFFFF)
"""All bits of a number but its sign: those of numbers ≥ 0 are in the order of these, and many are compared at once."""

SKIN = np.dtype(
    {
        "names": [
            "depth",
            "used",
            "last",
            "before",
            "earlier",
            "wished",
            "lasts",
            "longest",
            "steps",
            "unknown",
            "top",
            "fastest",
            "widest",
            "turned",
            "past",
            "listed",
        ],
        "formats": [*(8 * [float]), np.int64, np.int64, np.int64, *(4 * [float]), np.int64],
        "offsets": [0, 8, 16, 24, 32, 40, 48, 56, 64, 72, 80, 80, 88, 96, 104, 112],
    }
)
"""Depth of the skin [m], infinite where all lines are looked at, 0 where rows have margins; how much of it may be used
up, less twice the least of the margins that are left; by how much lines and bodies may have come nearer in the last
step and the two before; depth that a bound on the next steps asks for; number of steps that a list of pairs is to last;
the longest of all ways of a step [m]; number of steps of which that is known, and above which a list is made, 0 from
the start of a run on; the largest component of a velocity, as a whole number and as what it is [m/s]; largest depth
around pairs [m], infinite where none are found; ways that bodies have turned by at their surfaces since the list was
made, and before that since the wider one was [m]; 1 where there is a wider list."""
NOWHERE = np.zeros((0, 3)), np.zeros((0, 4))
"""Displacements and marks without rows."""
SWAP = types.void(
    *(2 * (types.int64,)), types.float64, *(2 * (MATRIX,)), *map(ArraysType, (INDICES, MATRIX, MATRIX, VECTOR))
)
"""``(i, m, depth, x, marks, cells, data, outs, stored)``: swaps the cells of term i, the m-th that acts nearby, in the
tables of `refweb.dynamics.integrators.records.ForceTerms`, for those within a skin and the margins of their rows, see
`NeighbourList`, or for all where it has no bound."""
SwapTable = Annotated[Functions, SWAP]
NARROW = types.void(
    *(2 * (types.int64,)),
    *(2 * (MATRIX,)),
    *map(ArraysType, (INDICES, INDICES, MATRIX, INDICES, MATRIX, MATRIX, VECTOR)),
)
"""``(i, m, x, marks, chosen, wide_cells, wide_data, cells, data, outs, stored)``: takes into the tables the cells of
term i, the m-th that acts nearby, that may act when their rows have moved by their margins, see `NeighbourList`, of a
wider list."""
NarrowTable = Annotated[Functions, NARROW]
AHEAD = types.void(
    types.int64, types.int64, *(3 * (types.float64,)), *(4 * (MATRIX,)), ArraysType(INDICES), ArraysType(MATRIX)
)
"""``(i, m, reach, span, early, x, v, f, inverse, cells, data)``: takes into the tables the cells of term i, the m-th
that acts nearby, that may act when rows have come nearer by ``reach`` [m], in a span [s], see `ContactForce`."""
AheadTable = Annotated[Functions, AHEAD]
SkinArray = Annotated[np.ndarray, types.Array(from_dtype(SKIN), 1, "C")]


class NeighbourList(Record):
    """Terms whose cells act only on near lines or bodies.

    Attributes
    ----------
    swaps : table
        Kernel of each that swaps its cells, see `swap_of`.
    narrows : table
        Kernel of each that takes cells of a wider list, see `NARROW`.
    aheads : table
        Kernel of each that takes its cells for a bound on steps, see `AHEAD`.
    terms : ndarray of int
        Their numbers.
    skin : ndarray of `SKIN`, shape (1,)
        State of the list.
    at, marks : ndarray, shape (rows, 4)
        Displacement at which the wider list and the list were made, and margin of each row in it [m]; no rows where
        steps are planned for rows, and not for spans.
    frame : ndarray, shape (2, 4)
        Velocity of the axes of the list and of the wider one [m/s], and sum of the drifts since these were made [s].
    cells, data : table
        Space for the cells and numbers of each.
    chosen, wide_cells, wide_data : table
        Cells, or elements of pairs, of the wider list of each, with their rows and numbers.
    """

    swaps: SwapTable
    narrows: NarrowTable
    aheads: AheadTable
    terms: Integers
    skin: SkinArray
    at: Matrix
    marks: Matrix
    frame: Matrix
    cells: IndexTable
    data: MatrixTable
    chosen: IndexTable
    wide_cells: IndexTable
    wide_data: MatrixTable

    @classmethod
    def of(cls, system):
        """Make the record of a system."""
        near, skin = near_of(system), np.zeros(1, dtype=SKIN)
        skin["depth"], skin["lasts"] = np.inf, MANY
        pairs = any(term.contact.foresee is not None for term in system.terms)
        swaps = Functions(SWAP, [swap_for(system, i) for i in near])
        narrows = [narrow_of(system.terms[i].contact.near, system.net.subdivide) for i in near if pairs]
        aheads = Functions(AHEAD, [ahead_for(system.terms[i]) for i in near if pairs])
        at = np.zeros((system.rows - system.net.spins if pairs else 0, 4))
        skin["widest"] = WIDEST * float(system.net.natural_length.mean()) if pairs else np.inf
        cells, data = [system.terms[i].cells for i in near], [system.terms[i].data for i in near]
        lists = Arrays(INDICES, cells), Arrays(MATRIX, data)
        wide = Arrays(INDICES, cells), Arrays(INDICES, cells), Arrays(MATRIX, data)
        moves = at, np.zeros_like(at), np.zeros((2, 4))
        numbers = np.array(near, dtype=np.int64)
        return cls(swaps, Functions(NARROW, narrows), aheads, numbers, skin, *moves, *lists, *wide)

    def without(self):
        """Make the record without terms."""
        return replace(self, terms=self.terms[:0])


def near_of(system):
    """Numbers of the terms of a system whose cells act only on near lines or bodies."""
    return [
        i for i, term in enumerate(system.terms) if term.contact.near is not None or term.contact.finder is not None
    ]


def swap_for(system, i):
    """The kernel that swaps the cells of term i of a system."""
    contact = system.terms[i].contact
    return swap_of(contact.near, system.net.subdivide) if contact.finder is None else swap_pairs_of(contact.finder)


def ahead_for(term):
    """The kernel that takes the cells of a term for a bound on steps."""
    contact = term.contact
    if contact.foresee is None:
        return all_ahead
    return ahead_of(contact.finder or listed_pairs_of(contact.near), contact.foresee)


@kernel(AHEAD)
def all_ahead(i, m, reach, span, early, x, v, f, inverse, cells, data):
    source = 2 * len(data) - len(cells) + m
    cells[i], data[i] = cells[source], data[source]


@functools.cache
def listed_pairs_of(near):
    """Make a kernel with the answer of a `ContactForce.finder` for pairs that are cells, by their kernel ``near``."""

    @kernel()
    def listed_pairs(skin, marks, x, cells, data):
        touching, largest = np.empty(cells.shape[0], dtype=np.int64), 0.0
        for r in range(marks.shape[0]):
            largest = max(largest, marks[r, 3])
        chosen = touching[: near(skin + 2.0 * largest, x, cells, data, touching)]
        rows, numbers = rows_of(chosen, cells, data)
        return chosen, rows, numbers

    return listed_pairs


@functools.cache
def ahead_of(pairs, foresee):
    """Make the kernel of `AHEAD` for the pairs that ``pairs`` finds; for all cells where the reach is far."""

    @kernel(AHEAD)
    def ahead(i, m, reach, span, early, x, v, f, inverse, cells, data):
        source = 2 * len(data) - len(cells) + m
        cells[i], data[i] = cells[source], data[source]
        if reach < math.inf:
            marks = margins_ahead(span, early, v, f, inverse)
            _, rows, numbers = pairs(0.0, marks, x, cells[source], data[source])
            foresee(span, early, x, v, f, inverse, rows, numbers)
            cells[i], data[i] = rows, numbers

    return ahead


@kernel()
def rows_of(chosen, cells, data):
    """Some rows of cells and of data."""
    some, some_data = np.empty((chosen.size, cells.shape[1]), dtype=np.int32), np.empty((chosen.size, data.shape[1]))
    for n in range(chosen.size):
        for k in range(cells.shape[1]):
            some[n, k] = cells[chosen[n], k]
        for k in range(data.shape[1]):
            some_data[n, k] = data[chosen[n], k]
    return some, some_data


@kernel(apart=())
def show_all(i: int, m: int, cells: IndexTable, data: MatrixTable, outs: MatrixTable, stored: VectorTable) -> None:
    """Take all cells of term i, the m-th that acts nearby, into the tables of `SWAP`."""
    source, numbers = 2 * len(data) - len(cells) + m, len(data) + m
    cells[i], data[i], outs[i], stored[i] = cells[source], data[source], outs[source], stored[source]
    cells[numbers] = np.empty((0, 1), dtype=np.int32)


@kernel(apart=())
def show_some(
    i: int,
    m: int,
    chosen: Indices,
    some: Indices,
    numbers: Matrix,
    cells: IndexTable,
    data: MatrixTable,
    outs: MatrixTable,
    stored: VectorTable,
) -> None:
    """Take the chosen cells of term i, the m-th that acts nearby, and their numbers into the tables of `SWAP`."""
    observed = outs[2 * len(data) - len(cells) + m]
    observed[:] = 0.0
    cells[i], data[i], cells[len(data) + m] = some, numbers, chosen
    outs[i], stored[i] = np.zeros((len(some), observed.shape[1])), np.zeros(len(some))


@functools.cache
def within_margins(near, pieces):
    """Make a kernel ``(skin, x, marks, cells, data)`` of the cells that ``near`` finds within a skin and margins.

    Two rows come nearer by the sum of their margins. Cells are looked at by ``pieces``, which are found whole where
    they are those of a line.
    """

    @kernel(leaf=True)
    def note_near(skin, x, marks, cells, data, touching, piece):
        count = 0
        for first in range(0, cells.shape[0], pieces):
            end, first_margin, second = min(first + pieces, cells.shape[0]), 0.0, 0.0
            for c in range(first, end):
                for k in range(cells.shape[1]):
                    if cells[c, k] < marks.shape[0]:  # rows behind are of rotations
                        row_margin = marks[cells[c, k], 3]
                        first_margin, second = max(first_margin, row_margin), max(second, min(first_margin, row_margin))
            for n in range(near(skin + first_margin + second, x, cells[first:end], data[first:end], piece)):
                touching[count] = first + piece[n]
                count += 1
        return count

    @kernel()
    def cells_near(skin, x, marks, cells, data):
        touching, piece = np.empty(cells.shape[0], dtype=np.int64), np.empty(pieces, dtype=np.int64)
        return touching[: note_near(skin, x, marks, cells, data, touching, piece)]

    return cells_near


@functools.cache
def swap_of(near, pieces=1):
    """The kernel that swaps the cells of a term, found by its kernel ``near``, of signature `SWAP`.

    Loops call it by its address, since machine code that is called by name is optimized again in each calling kernel.
    """

    cells_near = within_margins(near, pieces)

    @kernel(SWAP)
    def swap(i, m, depth, x, marks, cells, data, outs, stored):
        if depth == math.inf:
            show_all(i, m, cells, data, outs, stored)
            return
        source = 2 * len(data) - len(cells) + m
        touching = cells_near(depth, x, marks, cells[source], data[source])
        some, numbers = rows_of(touching, cells[source], data[source])
        chosen = np.empty((touching.size, 1), dtype=np.int32)
        for n in range(touching.size):
            chosen[n, 0] = touching[n]
        show_some(i, m, chosen, some, numbers, cells, data, outs, stored)

    return swap


@functools.cache
def swap_pairs_of(pairs):
    """Make the swap of a term whose cells are elements, for the pairs that ``pairs`` finds; see `swap_of`."""

    @kernel(SWAP)
    def swap(i, m, depth, x, marks, cells, data, outs, stored):
        if depth == math.inf:
            show_all(i, m, cells, data, outs, stored)
            return
        source = 2 * len(data) - len(cells) + m
        chosen, some, numbers = pairs(depth, marks, x, cells[source], data[source])
        show_some(i, m, chosen.astype(np.int32), some, numbers, cells, data, outs, stored)

    return swap


@functools.cache
def narrow_of(near, pieces):
    """Make the kernel of `NARROW` of a term, with its kernel ``near`` of signature `refweb.kernels.NEAR`."""
    cells_near = within_margins(near, pieces)

    @kernel(NARROW)
    def narrow(i, m, x, marks, chosen, wide_cells, wide_data, cells, data, outs, stored):
        touching = cells_near(0.0, x, marks, wide_cells[m], wide_data[m])
        some, numbers = rows_of(touching, wide_cells[m], wide_data[m])
        known, rows = chosen[m], np.empty((touching.size, chosen[m].shape[1]), dtype=np.int32)
        for n in range(touching.size):
            for k in range(known.shape[1]):
                rows[n, k] = known[touching[n], k]
        show_some(i, m, rows, some, numbers, cells, data, outs, stored)

    return narrow


@kernel(apart=("near",))
def set_reference(depth: float, x: Matrix, marks: Matrix, nearby: NeighbourList, terms: ForceTerms) -> None:
    """Swap the cells of all terms for those within a skin and margins of their rows at displacement x."""
    for m in range(nearby.terms.size):
        i = nearby.terms[m]
        nearby.swaps[m](i, m, depth, x, marks, terms.cells, terms.data, terms.outs, terms.stored)


@kernel(leaf=True, apart=("near",))
def show_near(nearby: NeighbourList, terms: ForceTerms) -> None:
    """Copy the output of the chosen cells to the output of all cells.

    The output of an element is the value of largest size among its pairs.
    """
    if not nearby.skin[0].depth < math.inf:
        return
    size, count = nearby.terms.size, len(terms.data)
    for m in range(size):
        all_values, values = terms.outs[nearby.terms[m]], terms.outs[count - size + m]
        chosen = terms.cells[count + m]
        if chosen.shape[1] == 1:
            for n in range(chosen.shape[0]):
                for k in range(all_values.shape[1]):
                    values[chosen[n, 0], k] = all_values[n, k]
            continue
        for e in range(values.shape[0]):
            for k in range(values.shape[1]):
                values[e, k] = 0.0
        for n in range(chosen.shape[0]):
            for k in range(values.shape[1]):
                value = all_values[n, k]
                if value == 0.0:
                    continue
                for e in range(2):
                    if abs(value) > abs(values[chosen[n, e], k]):
                        values[chosen[n, e], k] = value


def forget(model, begun):
    """Reset the record of motion: the next run has not taken the last steps, or has ``begun`` and taken none."""
    model.nearby.skin["steps"], model.nearby.skin["unknown"] = 0, COVERED if begun else 0


def look_at_all(system, model):
    """Select all cells."""
    skin, terms = model.nearby.skin[0], model.terms
    if skin["depth"] < np.inf:
        for m, i in enumerate(near_of(system)):
            swap_for(system, i)(i, m, np.inf, *NOWHERE, terms.cells, terms.data, terms.outs, terms.stored)
    skin["depth"], skin["listed"] = np.inf, 0


@kernel(apart=("pairs",))
def narrow_all(x: Matrix, nearby: NeighbourList, terms: ForceTerms) -> None:
    """Take the cells of the wider lists that may act when rows have moved by their margins."""
    marks = nearby.marks
    chosen, cells, data = nearby.chosen, nearby.wide_cells, nearby.wide_data
    for m in range(nearby.terms.size):
        i = nearby.terms[m]
        nearby.narrows[m](i, m, x, marks, chosen, cells, data, terms.cells, terms.data, terms.outs, terms.stored)


@kernel(apart=("pairs",))
def take_pairs(x: Matrix, nearby: NeighbourList, terms: ForceTerms) -> None:
    """Find what is within the margins of the wider list, and set the number of steps that the next should last."""
    skin, pairs, elements = nearby.skin[0], 0, 0
    set_reference(0.0, x, nearby.at, nearby, terms)
    for m in range(nearby.terms.size):
        i = nearby.terms[m]
        nearby.chosen[m] = terms.cells[len(terms.data) + m]
        nearby.wide_cells[m], nearby.wide_data[m] = terms.cells[i], terms.data[i]
        pairs += terms.cells[nearby.terms[m]].shape[0]
        elements += terms.cells[len(terms.cells) - 2 * nearby.terms.size + m].shape[0]
    if pairs * skin.lasts > PRICE * elements:
        skin.lasts = max(0.5 * skin.lasts, FEWEST)
    elif 4.0 * pairs * skin.lasts < PRICE * elements:
        skin.lasts = min(2.0 * skin.lasts, MANY)


@kernel(leaf=True, forceinline=True)
def reach_all(reach, x, nearby, terms):
    """Select all cells, unless the chosen cells are all that can touch after an approach of ``reach`` [m].

    Listed pairs stay: `refweb.dynamics.integrators.step_bound.step_by_pairs` finds its own.
    """
    skin = nearby.skin[0]
    skin.wished = 2.0 * reach
    if nearby.at.shape[0]:
        return
    if skin.depth < math.inf and not skin.used + reach <= SHARE * skin.depth:
        skin.depth = math.inf
        set_reference(skin.depth, x, nearby.marks, nearby, terms)


@kernel(leaf=True, forceinline=True)
def goes_freely(model):
    """Tell if lines push each other, and all rows move as their velocities say: none is moved or carried."""
    inertia = model.inertia
    return model.ccd.touch > 0.0 and inertia.driven.size + inertia.turns.carried.shape[0] == 0


@kernel(leaf=True, apart=("near",))
def update_neighbours(drift: float, x: Matrix, v: Matrix, bits: Integers, before: Matrix, model: Model) -> None:
    """Record the approach in the drift that led to x, and make a new list if the skin is used up.

    ``bits`` are the velocities of all places, in a row, as whole numbers; none where nothing acts nearby. The largest
    is known where a check of collisions has found it. Motion that is prescribed is held against the places ``before``;
    to that of a body is added what its rotation adds at its surface. States between the last three steps are covered as
    well, which is what is looked at for peaks. Where rows have margins, these count, and the approach is the way of
    rows relative to each other.
    """
    if not bits.size:
        return
    skin, largest, driven, turns = model.nearby.skin[0], np.int64(0), model.inertia.driven, model.inertia.turns
    if not goes_freely(model):
        for q in range(bits.size):
            largest = max(largest, bits[q] & SIGN)
        skin.top = largest
    path = abs(drift) * skin.fastest
    for d in range(driven.size):
        for k in range(3):
            path = max(path, abs(x[driven[d], k] - before[d, k]))
    path *= WAY
    if model.nearby.at.shape[0] and not driven.size:
        spread = abs(drift) * spread_of(bits.view(np.float64).reshape(-1, 3))
        path = spread if spread < path else path  # what is not a number stays
    turn = 0.0
    if turns.moment.size:
        turn = 2.0 * abs(drift) * fastest_surface(x, v, turns)
        path += turn
    skin.earlier, skin.before, skin.last = skin.before, skin.last, path
    skin.longest = max(skin.longest, path)
    skin.used += path
    if model.nearby.at.shape[0]:
        nearby = model.nearby
        nearby.frame[0, 3] += drift
        nearby.frame[1, 3] += drift
        skin.turned += turn
        skin.used = -2.0 * least_margin(skin.turned, x, nearby.marks, nearby.frame[0], nearby.at[:0], turns)
        path *= BEND
    skin.steps += 1
    if skin.steps > skin.unknown and not (skin.depth < math.inf and skin.used + path <= SHARE * skin.depth):
        choose(drift, x, v, turn, model)


@kernel(leaf=True)
def least_margin(turned, x, marks, frame, margins, turns):
    """Least way that any row may still move within its margin of some ``marks``, see `NeighbourList` [m].

    Bodies have turned since, and as much as the ``margins`` of other marks must be left, if these have rows.
    """
    free_way, a, b, c = math.inf, frame[3] * frame[0], frame[3] * frame[1], frame[3] * frame[2]
    more = margins.shape[0] > 0
    for r in range(marks.shape[0]):
        p, q, s = x[r, 0] - marks[r, 0] - a, x[r, 1] - marks[r, 1] - b, x[r, 2] - marks[r, 2] - c
        left = SHARE * marks[r, 3] - math.sqrt(p * p + q * q + s * s)
        left = left - margins[r, 3] if more else left
        free_way = left if left < free_way else free_way
    for n in range(turns.moment.size):
        r = turns.rows[n, 0]
        p, q, s = x[r, 0] - marks[r, 0] - a, x[r, 1] - marks[r, 1] - b, x[r, 2] - marks[r, 2] - c
        left = SHARE * marks[r, 3] - turned - math.sqrt(p * p + q * q + s * s)
        free_way = min(free_way, left - margins[r, 3] if more else left)
    return free_way


@kernel()
def set_marks(steps, drift, turn, smallest_margin, largest_margin, margins, x, v, turns, marks, frame):
    """Give each row the margin that it takes in some ``steps`` at its velocity, within two limits.

    It is twice that of the ``margins`` of other marks at least, if these have rows. Rows move in axes that have the
    mean velocity of all, and surfaces of bodies by a way ``turn`` more in each step.
    """
    for k in range(4):
        frame[k] = 0.0
    for r in range(marks.shape[0]):
        for k in range(3):
            marks[r, k] = x[r, k]
            frame[k] += v[r, k] / marks.shape[0]
    for r in range(marks.shape[0]):
        p, q, s = v[r, 0] - frame[0], v[r, 1] - frame[1], v[r, 2] - frame[2]
        marks[r, 3] = min(max(steps * abs(drift) * math.sqrt(p * p + q * q + s * s), smallest_margin), largest_margin)
        if margins.shape[0]:
            marks[r, 3] = max(marks[r, 3], 2.0 * margins[r, 3])
    for n in range(turns.moment.size):
        marks[turns.rows[n, 0], 3] += steps * turn


@kernel(apart=("near",))
def choose(drift: float, x: Matrix, v: Matrix, turn: float, model: Model) -> None:
    """Choose anew what is near, behind a drift that led to x at velocities v.

    Surfaces of bodies have moved in it by a way ``turn`` for their rotation.
    """
    nearby, terms, turns = model.nearby, model.terms, model.inertia.turns
    skin = nearby.skin[0]
    path, recent = skin.last, skin.last + skin.before + skin.earlier
    if not nearby.at.shape[0]:
        skin.depth, skin.used = max(LASTS * path, 4.0 * recent, min(skin.wished, LONGEST * path)), 0.0
        set_reference(skin.depth, x, nearby.marks, nearby, terms)
        return
    none, marks, frame = nearby.at[:0], nearby.marks, nearby.frame[0]
    set_marks(INNER, drift, turn, FLOOR * recent, math.inf, none, x, v, turns, marks, frame)
    skin.past, skin.turned = skin.past + skin.turned, 0.0
    if not (skin.listed > 0 and least_margin(skin.past, x, nearby.at, nearby.frame[1], marks, turns) > 0.0):
        largest_margin = 0.5 * skin.widest
        smallest_margin = min(EVEN * skin.lasts * abs(drift) * spread_of(v[: marks.shape[0]]), largest_margin)
        set_marks(
            skin.lasts, drift, turn, smallest_margin, largest_margin, marks, x, v, turns, nearby.at, nearby.frame[1]
        )
        skin.listed, skin.past = 1, 0.0
        take_pairs(x, nearby, terms)
    skin.depth, skin.used = 0.0, -2.0 * least_margin(0.0, x, marks, frame, none, turns)
    narrow_all(x, nearby, terms)
