"""Records of the compiled loop: forces, monitors and motion.

Kernels of one signature, and arrays of one type, are in tables, so that the loop is compiled once for any mixture of
effects. Features that a scene does not have are empty tables or arrays, and their kernels are not compiled, see
`refweb.dynamics.integrators.features`.

May change: how ``of`` fills a record, and `LINE`, which changes the speed alone. Must stay: names of fields, which
kernels of the loop read; their order in `Scheme` and `Running`, which `central_difference` fills by position; names of
`CLOCK` up to ``share``, which are those of `IntegratorState`; places behind the terms in `ForceTerms`, which
`neighbour_list` fills. A further field compiles all kernels that take the record again. Must stay as well: `Model` with
its public names, which `ccd`, `central_difference` and other files import; `aligned`, which `explicit_state` imports;
`Inertia`, which `step_bound` imports; public names of `ForceTerms` and `Scheme`, which other files use. Tests:
``tests/dynamics/integrators/test_records.py``, ``tests/test_pay_for_what_you_call.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
from numba import from_dtype, types

from ... import kernels as k
from ...compiled.rows import width_of
from ...effects.base import BLOCK_OUT
from ...effects.mass_flow import FollowedMass
from ...effects.natural_lengths import NaturalLengths
from ...kernels import (
    INDICES,
    MATRIX,
    VECTOR,
    Arrays,
    BoundTable,
    ContactTable,
    Cube,
    EnergyTable,
    ForceTable,
    Functions,
    IndexTable,
    Indices,
    IntegerMatrix,
    Integers,
    Matrix,
    MatrixTable,
    PartTable,
    Record,
    RelaxTable,
    Vector,
    VectorTable,
)
from ...net.rotation import RigidRotations
from .averages import Averages
from .ccd import Ccd
from .contacts import Contacts
from .energy_balance import no_energy
from .events import EventArray
from .extremes import Extremes
from .implicit_contacts import ImplicitContacts
from .momentum_balance import MomentumBalance, Outside, pushing_terms
from .neighbour_list import NeighbourList, near_of
from .step_bound import no_bound

CLOCK = np.dtype(
    [
        ("time", float),
        ("nsteps", np.int64),
        ("step", float),
        ("energy", float),
        ("largest", float),
        ("worst", float),
        ("share", float),
        ("least_energy", float),
        ("since", float),
        ("begun", np.int64),
        ("planned", np.int64),
        ("stable", float),
        ("cut", float),
        ("rejected", np.int64),
    ]
)
"""Numbers that the loop writes: those of a `refweb.dynamics.integrators.integrator.IntegratorState` by their names,
then the energy that a drift is held against at least, the time from which steps are equal, how many of these are taken,
0 where none are, and how many they are; the step that is stable there [s], that to which it is cut so that lines do not
pass, 0 where it is not, and whether it is to be cut."""
ClockArray = Annotated[np.ndarray, types.Array(from_dtype(CLOCK), 1, "C")]

LINE = 64
"""Bytes of a line of the cache."""


def aligned(values):
    """A copy that begins where a line of the cache does, so that no eight numbers lie in two.

    Steps of nets that fit into the cache take 7 % longer where they do.
    """
    space = np.empty(values.nbytes + LINE, dtype=np.uint8)
    begin = -space.ctypes.data % LINE
    copy = space[begin : begin + values.nbytes].view(values.dtype).reshape(values.shape)
    copy[...] = values
    return copy


class Scheme(Record):
    """Coefficients of the steps.

    Attributes
    ----------
    kicks, drifts : ndarray
        Shares of a step by which velocities and positions go in turn, one kick more than drifts.
    safety : float
        Share of the bound of a kick, a drift and a kick that a step is.
    least_steps : float
        Least number of steps of a row.
    step_size : float
        Largest step instead [s], 0 where the bound says.
    finer : float
        Factor on the number of steps of each row.
    span : float
        Largest time for which steps are planned [s], 0 where it is a row.
    """

    kicks: Vector
    drifts: Vector
    safety: float
    least_steps: float
    step_size: float
    finer: float
    span: float


class Inertia(Record):
    """Masses and constraints of the rows.

    Attributes
    ----------
    mass : ndarray, shape (rows,)
        Mass of each row [kg], or inertia [kg m²] behind the first ``linear`` rows.
    inverse : ndarray, shape (rows, 3)
        Its inverse, 0 where a support holds.
    rates : ndarray, shape (2, rows)
        Space for what bounds stiffness and damping of each row.
    moving, fixed, driven : ndarray of int
        Rows that are free somewhere, supported components 3 · row + axis, and rows whose motion is prescribed.
    linear : int
        Number of rows that are places; the others are angles.
    turns : refweb.net.rotation.RigidRotations
        Bodies whose orientation counts.
    """

    mass: Vector
    inverse: Matrix
    rates: Matrix
    moving: Integers
    fixed: Integers
    driven: Integers
    linear: int
    turns: RigidRotations

    @classmethod
    def of(cls, system):
        """Make the record of a system with lumped mass."""
        net, free = system.net, ~system.supported
        free[system.rows - net.internal :] = False
        inverse = aligned(np.where(free, 1.0 / np.where(net.mass > 0.0, net.mass, 1.0)[:, None], 0.0))
        driven = np.concatenate([[], *(drive.cells[:, 0] for drive in system.drives)]).astype(np.int64)
        moving, fixed = np.flatnonzero(free.any(axis=1)), np.flatnonzero(system.fixed)
        return cls(
            net.mass.copy() if net.flows else net.mass,
            inverse,
            np.empty((2, system.rows)),
            moving,
            fixed,
            driven,
            system.rows - net.spins,
            RigidRotations.of(net),
        )


class ForceTerms(Record):
    """Force terms; that of the lines is the first term.

    Of those that act only near something, lists have the cells that are looked at; all stand behind all terms.

    Attributes
    ----------
    forces, cells, data, outs : table
        Kernel of each term, its cells, its numbers, and what it writes per cell. Behind them ``cells`` has, as a
        column, the numbers of cells that are looked at instead of all, none where all are.
    of_lines, elements, numbers : table and ndarray
        Kernel of the first term in steps, one, and what it reads in place of ``cells`` and ``data``: the same, or by
        blocks.
    natural : ndarray of int, shape (changing,)
        Places of natural lengths that change among these numbers, flattened; none where they are ``data``.
    blocks : ndarray, shape (blocks + 1, numbers of `refweb.effects.base.BLOCK_OUT`)
        Numbers of blocks of lines in steps in which nothing needs more of the lines, and behind them the largest of all
        steps; without a row if the kernel does not take it, or other terms need what each line shows.
    still, viscous : ndarray of int
        Terms behind the first whose forces follow from displacement and time alone, and those of velocity whose
        kicks are iterated.
    beside : ndarray of int
        Those of both that act on the lines, and write where the first term does.
    energies, stored : table
        Kernel of the energy of each term, and what it writes per cell [J].
    working : ndarray of int, shape (terms,)
        1 if the power of a term counts as work, −1 if it is energy lost, else 0.
    powers : ndarray of int, shape (powered, 3)
        Terms booked by their power, the column of ``outs`` that has it, and 0 where it must be found again for the
        velocity at the end of a step, else 1, or 2 where the force jumps as lines snap taut.
    bounds, dampings : table
        Kernel that bounds the stiffness of each term, and the damping of each viscous one.
    """

    forces: ForceTable
    cells: IndexTable
    data: MatrixTable
    outs: MatrixTable
    of_lines: ForceTable
    elements: Indices
    numbers: Matrix
    natural: Integers
    blocks: Matrix
    still: Integers
    viscous: Integers
    beside: Integers
    energies: EnergyTable
    stored: VectorTable
    working: Integers
    powers: IntegerMatrix
    bounds: BoundTable
    dampings: BoundTable

    @classmethod
    def of(cls, system, outs):
        """Make the record of a system, whose terms write to ``outs``; natural lengths that change get a copy."""
        terms, net = system.terms, system.net
        lines = (net.line_data.copy() if net.factors else net.line_data).matrix
        numbers = [lines if term.over_lines else term.data for term in terms]
        fast = [i for i, term in enumerate(terms) if term.velocity.damping is not None]
        viscous = [i for i in fast if terms[i].velocity.implicit is None]
        inner = [i for i, term in enumerate(terms) if term.elements.internal]
        still = [i for i in range(1, len(terms)) if i not in fast and i not in inner]
        booked = [(i, f.balance.power) for i, f in enumerate(terms) if f.balance.power is not None]
        ready = {*fast, *pushing_terms(terms)}
        powers = [(i, k, (i in ready) + terms[i].velocity.jumps) for i, k in booked if i not in inner]
        near, stored = near_of(system), [np.zeros(len(term.cells)) for term in terms]
        cells = [*(terms[i].cells for i in near), *(np.empty((0, 1), dtype=np.int32) for _ in near)]
        by_elements = terms[0].force, terms[0].cells, lines, 0, np.zeros(0, dtype=np.int64)
        by_blocks, changing = terms[0].elements.by_blocks, system.lengths.elements
        of_lines, elements, of_blocks, rows, places = by_blocks(terms[0].cells, lines) if by_blocks else by_elements
        beside = [i for i in (*still, *viscous) if terms[i].over_lines]
        return cls(
            forces=Functions(k.FORCE, [term.force for term in terms]),
            cells=Arrays(INDICES, [*(term.cells for term in terms), *cells]),
            data=Arrays(MATRIX, [*numbers, *(numbers[i] for i in near)]),
            outs=Arrays(MATRIX, [*outs, *(outs[i] for i in near)]),
            of_lines=Functions(k.FORCE, [of_lines]),
            elements=elements,
            numbers=of_blocks,
            natural=places[changing] if by_blocks else places,
            blocks=np.zeros((0 if beside or inner or changing.size else rows, width_of(BLOCK_OUT))),
            still=np.array(still, dtype=np.int64),
            viscous=np.array(viscous, dtype=np.int64),
            beside=np.array(beside, dtype=np.int64),
            energies=Functions(k.ENERGY, [term.energy or no_energy for term in terms]),
            stored=Arrays(VECTOR, [*stored, *(stored[i] for i in near)]),
            working=system.working,
            powers=np.array(powers, dtype=np.int64).reshape(len(powers), 3),
            bounds=Functions(k.BOUND, [term.tangent.bound or no_bound for term in terms]),
            dampings=Functions(k.BOUND, [terms[i].velocity.bound or no_bound for i in viscous]),
        )


class Relaxing(Record):
    """Internal variables: the term of each kind, its kernel, strains at the start of a step, and energies lost [J]."""

    terms: Integers
    kernels: RelaxTable
    before: VectorTable
    lost: VectorTable

    @classmethod
    def of(cls, system):
        """Make the record of a system."""
        numbers = [i for i, term in enumerate(system.terms) if term.elements.internal]
        terms = [system.terms[i] for i in numbers]
        return cls(
            terms=np.array(numbers, dtype=np.int64),
            kernels=Functions(k.RELAX, [term.elements.internal.relax for term in terms]),
            before=Arrays(VECTOR, [np.zeros(term.elements.internal.space) for term in terms]),
            lost=Arrays(VECTOR, [np.zeros(len(term.cells)) for term in terms]),
        )


class Motions(Record):
    """Prescribed motion: kernels, cells, numbers, and matrices of no columns for what they would write."""

    kernels: ForceTable
    cells: IndexTable
    data: MatrixTable
    outs: MatrixTable

    @classmethod
    def of(cls, system):
        """Make the record of a system."""
        drives = system.drives
        return cls(
            kernels=Functions(k.FORCE, [drive.kernel for drive in drives]),
            cells=Arrays(INDICES, [drive.cells for drive in drives]),
            data=Arrays(MATRIX, [drive.data for drive in drives]),
            outs=Arrays(MATRIX, [np.zeros((len(drive.cells), 0)) for drive in drives]),
        )


class Model(Record):
    """A system as the loop sees it; ``corners`` are the times at which a table has one [s], increasing."""

    inertia: Inertia
    terms: ForceTerms
    implicit_contacts: ImplicitContacts
    relaxing: Relaxing
    motions: Motions
    lengths: NaturalLengths
    corners: Vector
    outside: Outside
    nearby: NeighbourList
    ccd: Ccd
    contacts: Contacts

    @classmethod
    def of(cls, system, outs, reports=True):
        """Make the record of a `refweb.system.system.System`, whose terms write to ``outs``; see `Ccd` for reports."""
        inertia, lengths = Inertia.of(system), system.lengths
        if system.net.flows:
            lengths = replace(lengths, masses=FollowedMass.of(system, inertia.mass, inertia.inverse))
        forces = inertia, ForceTerms.of(system, outs), ImplicitContacts.of(system, inertia.turns), Relaxing.of(system)
        changes = Motions.of(system), lengths, system.corners, Outside.of(system)
        return cls(*forces, *changes, NeighbourList.of(system), Ccd.of(system, reports), Contacts.of(system))


class Running(Record):
    """Arrays that the loop writes, of an explicit course, and numbers that pass from one part of a row to the next.

    Attributes
    ----------
    clock : ndarray of `CLOCK`, shape (1,)
        Numbers.
    x, v, f : ndarray, shape (rows, 3)
        Displacement [m], velocity [m/s] and force [N].
    before : ndarray, shape (3, rows, 3)
        The same at the row or the corner of a table before.
    work : ndarray, shape (terms + 1,)
        Work of each term and, last, of motion [J].
    impulse : ndarray, shape (3,)
        Impulse of the supports [N s].
    ledger : refweb.dynamics.integrators.momentum_balance.MomentumBalance
        The book of momentum.
    extremes : refweb.dynamics.integrators.extremes.Extremes
        Extremes of probes and sums.
    events : ndarray of `refweb.dynamics.integrators.events.EVENT`
        State of each event.
    averages : refweb.dynamics.integrators.averages.Averages
        Means over windows.
    power : ndarray, shape (terms,)
        Power of each term at the last step [W].
    length_force : ndarray, shape (2, changing)
        ∂E/∂L of each length that changes [N], at the last step and at this one.
    crossings : ndarray, shape (4, 5)
        Lines and bodies that have met, see `refweb.dynamics.integrators.integrator.IntegratorState`.
    contacts, parts : table
        One array each, space for contacts that are solved for and for their parts.
    """

    clock: ClockArray
    x: Matrix
    v: Matrix
    f: Matrix
    before: Cube
    work: Vector
    impulse: Vector
    ledger: MomentumBalance
    extremes: Extremes
    events: EventArray
    averages: Averages
    power: Vector
    length_force: Matrix
    crossings: Matrix
    contacts: ContactTable
    parts: PartTable
