"""Contact of lines with lines: its table and its terms.

May change: private functions, messages, `ROUNDING`, `LISTED`, `FORESEEN`, `FAR` and `SOME`: with more than `LISTED`
pairs explicit steps alone take a web, and with more than `FORESEEN` they take other steps. Must stay: the name
"self_contact" of all terms, by which `system.unsupported_parts`, `dynamics.kinks` and `integrators.splitting` know
them; keys and docstring of `SelfContact` (scene format and help; after a change write ``validation/REFERENCE.md``
anew); `with_stiffness`, which `scene` calls; `BROKEN`, the column that breaks set to 0; "self_contact_energy", a column
of ``history.csv``. Tests: ``tests/effects/test_self_contact.py``, ``tests/test_contract.py``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import memory
from ...compiled.rows import column_of, records_of
from ...errors import InputError
from ...tables import Table, boolean, real, table
from ..base import Balance, CellElements, ContactForce, Crossing, ForceTerm, Tangent, Timing, VelocityForce, without
from ..natural_lengths import shortest_of
from .pair import APART, ELEMENT
from .search import distances, foresee, near, near_pairs, paired, pairs_by_margin

if TYPE_CHECKING:
    from ...net.net import Net

LISTED = 20_000
"""Largest number of pairs that are one list, which implicit methods need; above, pairs are found as they come near."""
FORESEEN = 1000
"""Number of pairs above which steps are planned for spans, by the speed of each pair near another."""
BROKEN = column_of(ELEMENT, "scale")
"""Column of pairs and of elements that is 0 where one is broken."""
ROUNDING = 1e-9
"""Error of a distance, over the radius."""
FAR, SOME = 4.0, 8
"""Distance of contact, over the longest line, above which some elements are tested first, and their number: the search
of all neighbours along the net would take long and fill the memory."""


@table
class SelfContact(Table):
    """Contact of lines with lines, of the same web.

    Lines are round, and touch where their centre lines are less than two radii apart. Two elements push each other over
    the length of their overlap; for any angle this is a smooth function of their four nodes, see
    `refweb.effects.self_contact.line_line_penalty`. Lines that cross at the distance h push with k h (4 r² −
    h²)^(3/2)/(√27 r³) times the mean of their stretches, length over natural length. The largest push is k r, at half
    the distance of contact; a larger load would push lines through each other, and is refused. Elements that share a
    node do not push each other, nor do those within two radii of each other along the net at any time of the run, as
    reels and heat change natural lengths.

    The penetration check follows every pair of lines from the start of a run: before each drift of an explicit step,
    which is cut if two lines would meet, and on the interpolants of cvode and ida. ``passage`` of ``run.json`` is
    "certified" for ``lines`` if no two centre lines have met. It names neighbours that come to lie on each other, with
    the time, since no force keeps them apart. Load steps of statics are not certified, but lines are named that meet on
    straight paths from one load step to the next. A warning reports lines that are not certified.

    Explicit methods search near pairs during the run, and plan steps for spans of some 100 steps, by how near each pair
    may come in a span and how fast. Statics, cvode and ida, and explicit methods for a small web, have one list of all
    pairs.

    Parameters
    ----------
    radius : float
        Radius of all lines [m].
    stiffness : float, optional
        k [N/m], the push of lines that cross at half the distance of contact, over the radius. If it is left out refweb
        chooses it: EA/L of the stiffest element, or, if larger, the stiffness that stops two of the heaviest elements
        at the largest relative velocity of nodes or bodies at the start. If lines then overlap by more than their
        radius, the run is repeated with a larger stiffness.
    damping : float
        d of Hunt and Crossley [s/m]: a push of 1 + d δ̇ times that of the overlap, never a pull; δ̇ is the rate of the
        overlap.
    friction : float
        μ of Coulomb [1]; against it stands the push of the overlap.
    slip_velocity : float
        v_s [m/s], of μ N |u|/√(|u|² + v_s²): what sticks creeps below it.
    rolling : bool
        True if lines rotate freely about their axes, so that friction conserves angular momentum. A line that is wound
        around a straight line then slides as over a rotating pulley. With false, friction acts on centre lines, as on
        threads that do not twist: a line that is wound n turns holds a ratio of tensions up to e^(2π n μ). Moments of
        2r times the friction are then left to the torsion of lines. Therefore angular momentum is not conserved, and a
        rotating web is braked where its lines press on each other.

    Raises
    ------
    InputError
        For a radius, a stiffness or a slip velocity that is not > 0, and damping or friction < 0. From ``on``, for
        curved elements, lines that overlap in the initial web, and in statics a web with too many pairs.

    Examples
    --------
        [self_contact]
        radius = 1e-3
        damping = 0.1
        friction = 0.3
    """

    radius: float = real(above=0, unit="m")
    stiffness: float | None = real(default=None, above=0, unit="N/m")
    damping: float = real(default=0.0, at_least=0, unit="s/m")
    friction: float = real(default=0.0, at_least=0)
    slip_velocity: float = real(default=1e-3, above=0, unit="m/s")
    rolling: bool = boolean(default=True)

    def on(self, net: Net) -> ForceTerm | list[ForceTerm]:
        """The term of the push, and those of damping and friction.

        ``out`` is the overlap of a pair or an element [m], or the lost power [W].
        """
        if net.order > 1:
            raise InputError(
                f"radius = {self.radius:g} needs [cable] order = 1, not {net.order}: lines touch as straight elements; "
                f"use subdivide = {net.order * net.subdivide}, which has the same nodes"
            )
        if net.wound:
            raise InputError(
                f"radius = {self.radius:g} needs natural lengths ahead, which a [[winch]] finds: in place of its lines "
                "take a [[thread]] of two nodes for each, or a [[reel]]"
            )
        from . import line_line_ccd, line_line_penalty

        self._refuse_too_large(net)
        cells, data = self.elements_of(net, near_along(net, 2.0 * self.radius))
        self._refuse_overlap(net, *near_pairs(0.0, np.zeros_like(net.points), cells, data))
        chosen = listed(cells, data) if len(cells) ** 2 < 4 * LISTED + 4 * len(cells) else None
        if chosen is not None and len(chosen) <= LISTED:
            rows, numbers = paired(chosen, cells, data)
            common: dict = dict(cells=rows, data=numbers, elements=CellElements(chosen, without(BROKEN)))
            search = ContactForce(near=near, foresee=foresee if len(chosen) > FORESEEN else None)
        else:
            if net.quasi_static:
                raise InputError(
                    f"radius = {self.radius:g}: {len(cells)} elements make more than {LISTED} pairs, which statics "
                    'does not take: use [solve] kind = "dynamic" and a [damping], or a smaller web'
                )
            common = dict(cells=cells, data=data, elements=CellElements(np.arange(len(cells)), without(BROKEN)))
            search = ContactForce(near=near, finder=pairs_by_margin, foresee=foresee)
        beside = line_line_ccd.neighbours(net, data[:, APART:], 2.0 * self.radius)
        kernels = line_line_ccd.meets, line_line_ccd.soon
        follows = Crossing(*kernels, 2.0 * self.radius, self.stiffness_on(net), *beside)
        push = ForceTerm(
            name="self_contact",
            force=line_line_penalty.force,
            energy=line_line_penalty.energy,
            tangent=Tangent(line_line_penalty.stiffness if search.finder is None else None, line_line_penalty.bound),
            balance=Balance("self_contact_energy", internal=True),
            contact=search._replace(crossing=follows),
            **common,
        )
        terms = [push]
        if self.damping > 0.0:
            from . import line_line_damping

            velocity = VelocityForce(line_line_damping.damping, line_line_damping.damping_bound)
            terms.append(_lossy(line_line_damping, velocity, search, **common))
        if self.friction > 0.0:
            from . import line_line_friction

            velocity = VelocityForce(line_line_friction.damping, implicit=line_line_friction.KICKS)
            terms.append(_lossy(line_line_friction, velocity, search, twists=not self.rolling, **common))
        return terms if len(terms) > 1 else push

    def stiffness_on(self, net: Net) -> float:
        """Its stiffness [N/m], chosen if it is left out."""
        if self.stiffness is not None:
            return self.stiffness
        return float((net.axial / net.line_data.natural_length).max())

    def elements_of(self, net: Net, beside: Any) -> Any:
        """Nodes and numbers of all elements with those beside them, see `refweb.effects.self_contact.pair`."""
        touch = 2.0 * self.radius
        data = np.zeros((len(net.cells), APART + beside.shape[1]))
        numbers, first = records_of(ELEMENT, data), net.points[net.cells[:, 0]]
        numbers["touch"], numbers["damping"], numbers["length"] = touch, self.damping, net.natural_length
        numbers["scale"] = self.stiffness_on(net) / (math.sqrt(12.0) * touch**3)
        numbers["ends"] = np.stack([first, first + net.line_data.reference], axis=1)
        numbers["friction"], numbers["slip_velocity"] = self.friction, self.slip_velocity
        numbers["rolls"] = self.rolling
        data[:, APART:] = beside
        return np.ascontiguousarray(net.cells, dtype=np.int32), data

    def _refuse_too_large(self, net):
        """Refuse a radius by the size of the web, by some of its elements and by memory, before all pairs are found."""
        touch, size = 2.0 * self.radius, float(np.linalg.norm(np.ptp(net.points[: net.nodes], axis=0)))
        if touch >= size:
            raise InputError(
                f"radius = {self.radius:g} must be < {0.5 * size:.4g} [m], half the size of the web: all lines would "
                "touch each other"
            )
        if touch < FAR * net.natural_length.max():
            return
        cells, data = self.elements_of(net, np.zeros((len(net.cells), 0)))
        graph, largest = _graph(net), 0
        for element in np.linspace(0, len(cells) - 1, SOME).astype(np.int64):
            beside = _reached(graph, cells[element], touch).any(axis=0)[cells].any(axis=1)
            largest = max(largest, int(beside.sum()))
            chosen = np.column_stack([np.full((~beside).sum(), element), np.flatnonzero(~beside)])
            self._refuse_overlap(net, chosen, *paired(chosen, cells, data))
        memory.check(
            8.0 * SOME * largest * len(cells), f"radius = {self.radius:g}: neighbours of {len(cells)} elements"
        )

    def _refuse_overlap(self, net, chosen, rows, numbers):
        """Refuse pairs of lines that overlap in the web's position."""
        if not len(rows):
            return
        apart = distances(np.zeros_like(net.points), rows, numbers)
        worst = int(apart.argmin())
        deep = 2.0 * self.radius - apart[worst]
        if deep <= ROUNDING * self.radius:
            return
        first, second = net.line[chosen[worst]]
        raise InputError(
            f"radius = {self.radius:g}: lines {first} and {second} overlap by {deep:.3g} m in the web's "
            f"position, without being neighbours: it must be ≤ {0.5 * apart[worst]:.4g} [m], "
            "or the lines further apart"
        )

    def with_stiffness(self, stiffness: float) -> SelfContact:
        """The table with a stiffness."""
        return replace(self, stiffness=stiffness)


def _lossy(kernels, velocity, search, twists=False, **common):
    """The term of damping or of friction, by the module of its kernels."""
    return ForceTerm(
        name="self_contact",
        force=kernels.force,
        tangent=Tangent(kernels.stiffness if search.finder is None else None, kernels.bound, symmetric=False),
        velocity=velocity,
        contact=search,
        balance=Balance("dissipated_energy", power=0, internal=True, twists=twists),
        timing=Timing(at_rest=False),
        **common,
    )


def listed(cells, data):
    """All pairs of elements that may touch, shape (pairs, 2)."""
    first_element, second_element = np.triu_indices(len(cells), 1)
    first, last = cells[first_element], cells[second_element]
    shared = (first[:, :, None] == last[:, None, :]).any(axis=(1, 2))
    shared |= (data[first_element, APART:] == second_element[:, None]).any(axis=1)
    return np.column_stack([first_element, second_element])[~shared].astype(np.int64)


def _graph(net):
    """Lengths of elements between nodes, natural ones at their shortest in the run, a sparse matrix (nodes, nodes)."""
    from scipy.sparse import coo_array

    ends, lengths = np.sort(net.cells, axis=1), shortest_of(net)
    order = np.lexsort((lengths, ends[:, 1], ends[:, 0]))
    shortest = order[np.append(True, (np.diff(ends[order], axis=0) != 0).any(axis=1))]
    return coo_array((lengths[shortest], ends[shortest].T), shape=(net.nodes, net.nodes)).tocsr()


def _reached(graph, nodes, distance):
    """Mask of nodes within a distance of some nodes along the net, shape (nodes given, nodes)."""
    from scipy.sparse.csgraph import dijkstra

    return np.isfinite(dijkstra(graph, directed=False, indices=nodes, limit=distance * (1.0 + ROUNDING)))


def near_along(net, distance):
    """Elements that share no node and are within a distance of each other along the net, shape (elements, most).

    Rows are filled with −1. Distances are sums of the least natural lengths in the run.
    """
    cells, count, natural = net.cells, net.nodes, shortest_of(net)
    if distance < natural.min():
        return np.zeros((len(cells), 0))
    from scipy.sparse import csr_array

    graph = _graph(net)
    meets = csr_array((np.ones(2 * len(cells)), (cells.ravel(), np.repeat(np.arange(len(cells)), 2))))
    reached = []
    for begin in range(0, count, 1000):
        nodes = np.arange(begin, min(begin + 1000, count))
        first_row, second_row = np.nonzero(_reached(graph, nodes, distance))
        reached.append(np.column_stack([nodes[first_row], second_row]))
    first_row, second_row = np.concatenate(reached).T
    close = csr_array((np.ones(len(first_row)), (first_row, second_row)), shape=(count, count))
    pairs = (meets.T @ close[: meets.shape[0], : meets.shape[0]] @ meets).tocoo()
    first, last = pairs.coords
    apart = (cells[first][:, :, None] != cells[last][:, None, :]).all(axis=(1, 2))
    first, last = first[apart], last[apart]
    order = np.lexsort((last, first))
    first, last = first[order], last[order]
    column = np.arange(len(first)) - np.searchsorted(first, first)
    beside = np.full((len(cells), column.max(initial=-1) + 1), -1.0)
    beside[first, column] = last
    return beside
