"""Neighbour lists: lines that a body cannot reach yet are not evaluated in every step.

A list of the lines within a skin around a body is valid until the approach may exceed the depth of the skin. In a step
no row moves by more than the fastest one, and a line approaches a body by at most twice that. Therefore no contact is
missed. Results are those with all lines to the last bit, since lines without contact add nothing to any sum.

A list is deep enough for the next `LASTS` steps, and for the bound on the steps of the next row if that needs at most
`LONGEST` steps. Thus a list is made once in several rows, by a search over all lines.

With lines that touch lines, lists differ in four ways. The approach is that of the relative motion of rows, since a
thrown net moves as a whole. A list that lasts for `INNER` steps is taken from a wider one, which lasts longer. Before a
new wide list is made, the actual displacements are checked, since waves may move rows back. Its skin is at most
`WIDEST` of the length of elements, since else every element would be near another, and it lasts for fewer steps, down
to `FEWEST`, if it costs more than the search. A capture of 1104 lines takes 0.87 of the time that it takes with the
wide list alone.

May change: `LASTS`, `LONGEST`, `WIDEST`, `MANY`, `FEWEST`, `PRICE` and `INNER`, which trade searches for evaluations.
Must stay: no change may miss a contact, so that `WAY`, `SHARE` and `COVERED`, parts of the bound, stay; results are
those with all lines, bit for bit. Places behind the terms in `records.ForceTerms` are in the order of `near_of`, also
for `contacts`, `step_bound` and `implicit_contacts`. `ccd` leaves out cells and checks by ``depth``, ``used``,
``last`` and ``steps`` of `SKIN`: their meaning stays, or a passage is missed; `ccd` writes `fastest`, in one word with
`top`, and `central_difference` reads and sets back `longest`. Must stay as well: all names that `explicit_loop`,
`central_difference` and other files import; public names of `NeighbourList`, which other files use. Tests:
``tests/dynamics/integrators/test_nearby.py``.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numba import from_dtype, types

from ...compiled.tables import ArraysType
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
    copy_rows,
    kernel,
)
from ...net.rotation_bounds import fastest_surface
from .vector_spread import spread_of, spread_since

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
INNER = 12.0
"""Number of steps that a list lasts which is taken from a wider one."""
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
            "outer",
            "past",
        ],
        "formats": [*(8 * [float]), np.int64, np.int64, np.int64, *(4 * [float])],
        "offsets": [0, 8, 16, 24, 32, 40, 48, 56, 64, 72, 80, 80, 88, 96, 104],
    }
)
"""Depth of the skin [m], infinite where all lines are looked at; how much of it may be used up; by how much lines and
bodies may have come nearer in the last step and the two before; depth that a bound on the next steps asks for; number
of steps that a list of pairs is to last; the longest of all ways of a step [m]; number of steps of which that is known,
and above which a list is made, 0 from the start of a run on; the largest component of a velocity, as a whole number and
as what it is [m/s]; largest depth around pairs [m], infinite where none are found; depth of the wider list of which
the list is a part [m], infinite where there is none, and how much of that is used up."""
NOWHERE = np.zeros((0, 3))
"""Displacements without rows."""
SWAP = types.void(types.int64, types.int64, types.float64, MATRIX, *map(ArraysType, (INDICES, MATRIX, MATRIX, VECTOR)))
"""``(i, m, depth, x, cells, data, outs, stored)``: swaps the cells of term i, the m-th that acts nearby, in the
tables of `refweb.dynamics.integrators.records.ForceTerms`, for those within a skin, or for all where it has no
bound."""
SwapTable = Annotated[Functions, SWAP]
NARROW = types.void(
    *(2 * (types.int64,)),
    types.float64,
    MATRIX,
    *map(ArraysType, (INDICES, INDICES, MATRIX, INDICES, MATRIX, MATRIX, VECTOR)),
)
"""``(i, m, depth, x, chosen, wide_cells, wide_data, cells, data, outs, stored)``: takes into the tables the cells of
term i, the m-th that acts nearby, that are within a skin, of a wider list."""
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
    at : ndarray, shape (rows, 3)
        Displacement at which near pairs were chosen [m]; no rows where steps are planned for rows, and not for spans.
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
    cells: IndexTable
    data: MatrixTable
    chosen: IndexTable
    wide_cells: IndexTable
    wide_data: MatrixTable

    @classmethod
    def of(cls, system):
        """Make the record of a system."""
        near, skin = near_of(system), np.zeros(1, dtype=SKIN)
        skin["depth"], skin["outer"], skin["lasts"] = np.inf, np.inf, MANY
        pairs = any(term.contact.foresee is not None for term in system.terms)
        swaps = Functions(SWAP, [swap_for(system.terms[i]) for i in near])
        narrows = Functions(NARROW, [narrow_of(system.terms[i].contact.near) for i in near if pairs])
        aheads = Functions(AHEAD, [ahead_for(system.terms[i]) for i in near if pairs])
        at = np.zeros((system.rows - system.net.spins if pairs else 0, 3))
        skin["widest"] = WIDEST * float(system.net.natural_length.mean()) if pairs else np.inf
        cells, data = [system.terms[i].cells for i in near], [system.terms[i].data for i in near]
        lists = Arrays(INDICES, cells), Arrays(MATRIX, data)
        wide = Arrays(INDICES, cells), Arrays(INDICES, cells), Arrays(MATRIX, data)
        return cls(swaps, narrows, aheads, np.array(near, dtype=np.int64), skin, at, *lists, *wide)

    def without(self):
        """Make the record without terms."""
        return replace(self, terms=self.terms[:0])


def near_of(system):
    """Numbers of the terms of a system whose cells act only on near lines or bodies."""
    return [
        i for i, term in enumerate(system.terms) if term.contact.near is not None or term.contact.finder is not None
    ]


def swap_for(term):
    """The kernel that swaps the cells of a term."""
    return swap_of(term.contact.near) if term.contact.finder is None else swap_pairs_of(term.contact.finder)


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
    def listed_pairs(skin, x, cells, data):
        touching = np.empty(cells.shape[0], dtype=np.int64)
        chosen = touching[: near(skin, x, cells, data, touching)]
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
            _, rows, numbers = pairs(reach, x, cells[source], data[source])
            foresee(span, early, v, f, inverse, rows, numbers)
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
def swap_of(near):
    """The kernel that swaps the cells of a term, found by its kernel ``near``, of signature `SWAP`.

    Loops call it by its address, since machine code that is called by name is optimized again in each calling kernel.
    """

    @kernel(SWAP)
    def swap(i, m, depth, x, cells, data, outs, stored):
        if depth == math.inf:
            show_all(i, m, cells, data, outs, stored)
            return
        source = 2 * len(data) - len(cells) + m
        touching = np.empty(cells[source].shape[0], dtype=np.int64)
        count = near(depth, x, cells[source], data[source], touching)
        some, numbers = rows_of(touching[:count], cells[source], data[source])
        chosen = np.empty((count, 1), dtype=np.int32)
        for n in range(count):
            chosen[n, 0] = touching[n]
        show_some(i, m, chosen, some, numbers, cells, data, outs, stored)

    return swap


@functools.cache
def swap_pairs_of(pairs):
    """Make the swap of a term whose cells are elements, for the pairs that ``pairs`` finds; see `swap_of`."""

    @kernel(SWAP)
    def swap(i, m, depth, x, cells, data, outs, stored):
        if depth == math.inf:
            show_all(i, m, cells, data, outs, stored)
            return
        source = 2 * len(data) - len(cells) + m
        chosen, some, numbers = pairs(depth, x, cells[source], data[source])
        show_some(i, m, chosen.astype(np.int32), some, numbers, cells, data, outs, stored)

    return swap


@functools.cache
def narrow_of(near):
    """Make the kernel of `NARROW` of a term, with its kernel ``near`` of signature `refweb.kernels.NEAR`."""

    @kernel(NARROW)
    def narrow(i, m, depth, x, chosen, wide_cells, wide_data, cells, data, outs, stored):
        touching = np.empty(wide_cells[m].shape[0], dtype=np.int64)
        count = near(depth, x, wide_cells[m], wide_data[m], touching)
        some, numbers = rows_of(touching[:count], wide_cells[m], wide_data[m])
        known, rows = chosen[m], np.empty((count, chosen[m].shape[1]), dtype=np.int32)
        for n in range(count):
            for k in range(known.shape[1]):
                rows[n, k] = known[touching[n], k]
        show_some(i, m, rows, some, numbers, cells, data, outs, stored)

    return narrow


@kernel(apart=("near",))
def set_reference(depth: float, x: Matrix, nearby: NeighbourList, terms: ForceTerms) -> None:
    """Swap the cells of all terms for those within a skin at displacement x."""
    for m in range(nearby.terms.size):
        i = nearby.terms[m]
        nearby.swaps[m](i, m, depth, x, terms.cells, terms.data, terms.outs, terms.stored)


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
            swap_for(system.terms[i])(i, m, np.inf, NOWHERE, terms.cells, terms.data, terms.outs, terms.stored)
    skin["depth"] = skin["outer"] = np.inf


@kernel(apart=("pairs",))
def narrow_all(depth: float, x: Matrix, nearby: NeighbourList, terms: ForceTerms) -> None:
    """Take the cells of the wider lists that are within a skin at displacement x."""
    chosen, cells, data = nearby.chosen, nearby.wide_cells, nearby.wide_data
    for m in range(nearby.terms.size):
        i = nearby.terms[m]
        nearby.narrows[m](i, m, depth, x, chosen, cells, data, terms.cells, terms.data, terms.outs, terms.stored)


@kernel(apart=("pairs",))
def take_pairs(x: Matrix, nearby: NeighbourList, terms: ForceTerms) -> None:
    """Find what is within the wider skin at displacement x, and set the number of steps that the list should last."""
    copy_rows(x[: nearby.at.shape[0]], nearby.at)
    skin, pairs, elements = nearby.skin[0], 0, 0
    set_reference(skin.outer, x, nearby, terms)
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
        set_reference(skin.depth, x, nearby, terms)


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
    well, which is what is looked at for peaks. Of pairs the ways relative to each other are taken where a skin as deep
    as may be is used up in few steps otherwise.
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
    if FEWEST * path > skin.widest and not driven.size:
        path = abs(drift) * spread_of(bits.view(np.float64).reshape(-1, 3))
    if turns.moment.size:
        path += 2.0 * abs(drift) * fastest_surface(x, v, turns)
    skin.earlier, skin.before, skin.last = skin.before, skin.last, path
    skin.longest = max(skin.longest, path)
    skin.used += path
    skin.steps += 1
    if skin.steps > skin.unknown and not (skin.depth < math.inf and skin.used + path <= SHARE * skin.depth):
        choose(drift, x, v, driven.size > 0, model.nearby, model.terms)


@kernel(apart=("near",))
def choose(drift: float, x: Matrix, v: Matrix, driven: bool, nearby: NeighbourList, terms: ForceTerms) -> None:
    """Choose anew what is near, behind a drift that led to x at velocities v, where motion is ``driven`` or is not."""
    skin = nearby.skin[0]
    path, recent = skin.last, skin.last + skin.before + skin.earlier
    if not nearby.at.shape[0]:
        skin.depth, skin.used = max(LASTS * path, 4.0 * recent, min(skin.wished, LONGEST * path)), 0.0
        set_reference(skin.depth, x, nearby, terms)
        return
    depth = max(INNER * path, 4.0 * recent)
    if skin.outer < math.inf:
        skin.past += skin.used
        if not skin.past + depth <= SHARE * skin.outer:
            skin.past = spread_since(x, nearby.at)
    if not skin.past + depth <= SHARE * skin.outer < math.inf:
        near = path if driven else abs(drift) * spread_of(v[: nearby.at.shape[0]])
        skin.outer, skin.past = max(min(skin.lasts * near, skin.widest), 2.0 * depth), 0.0
        take_pairs(x, nearby, terms)
    skin.depth, skin.used = depth, 0.0
    narrow_all(depth, x, nearby, terms)
