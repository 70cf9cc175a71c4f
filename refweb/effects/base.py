"""Effects: forces and other changes of a net, one file each.

An effect is a frozen value that has physical numbers only. It has one or more of the methods below. It uses no global
matrix and knows no other effect.

``on(net)``
    Returns a `ForceTerm`, which has cells with their numbers and compiled kernels for force, energy and stiffness; or a
    list of them; or a `PrescribedMotion`, a `Constraint` or a `BreakLimits`.
``extend(net)``
    Returns the `refweb.net.net.Net` with more rows, mass or columns of line data. It is called before any ``on``;
    effects without ``on`` come first.
``add_internal(net)``
    Returns the net with rows of internal variables behind all others, see `InternalVariables`.
``start(net, supported, v)``
    Writes initial velocities; the points of this net are the positions at the start.
``lay(net, supported)``
    Returns the displacement of all rows at the start of a run.

May change: helpers below `ForceTerm` (`with_rows`, `refuse_flows`, `without`, …) inside, with their signatures kept.
Must stay: names, order and defaults of the fields of `ForceTerm`, its parts, `PrescribedMotion`, `Constraint` and
`BreakLimits`, since effects of users make them (a new field needs a default); columns of `LINE_OUT` (numbers of which
are `TENSION` to `LENGTH_POWER`), `BLOCK_OUT`, `TOUCH` and `FELT`, and the mark `CONTACT`, which kernels write and
`results.probes`, `results.state` and `system.contact_forces` read. `system.effect_parts` checks what effects make. Must
stay as well: all names that `contact.table`, `damping` and other files import; public names of `InternalVariables`,
`ContactForce`, `VelocityForce`, `ImplicitContactKernels`, `Balance`, `Timing` and `CellElements`, which other files
use. Tests: ``tests/test_contract.py``, ``tests/test_plugins.py``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..compiled.rows import column_of, width_of
from ..errors import InputError
from ..kernels import FORCE, kernel

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from ..net.net import Net
    from ..net.rigid_body import RigidBody
    from ..system.forces import PerCell
    from ..system.system import System

LINE_OUT = np.dtype([(name, float) for name in ("tension", "strain", "damped_tension", "power", "length_power")])
"""Numbers that terms over the lines observe: tension by the law [N], strain [1], and of a force beside the law the
tension with it [N], its power [W] and that of changes of natural lengths against it [W]."""
TENSION, STRAIN, DAMPED_TENSION, POWER, LENGTH_POWER = range(5)
"""Columns of these."""
LAST_STRAIN, SNAPPED = range(5, 7)
"""Columns that explicit steps write behind them, see `VelocityForce.jumps`: the strain at the last step [1], and the
sum of the squared energies that jumps within steps leave in doubt [J²]."""

BLOCK = 256
"""Number of lines whose forces are found together: their numbers stay in the nearest cache."""
_of_block: list = [(name, float) for name in ("tension", "strain", "count", "rest")]
BLOCK_OUT = np.dtype([*_of_block, ("shown", float, (BLOCK, 2))])
"""Numbers that a block of lines shows in place of those of each: its largest tension [N] and strain, the number of its
lines, `MOVES`, `RESTS` or `UNKNOWN`, and both numbers of each line. These are of the last step in which the tension or
the strain was above all before, in that step and those since its last row, which stands behind those of the blocks, was
−∞."""
UNKNOWN, MOVES, RESTS = -1.0, 0.0, 1.0
"""Motion of a block: one at rest has neither differences of displacements nor forces, so that it shows what it has."""

TOUCH = np.dtype([("value", float), ("force", float, (3,))])
"""Numbers that terms of contact with bodies observe: the depth [m] of a force with an energy, or the power [W] of a
loss; and the force on the body that `ContactForce.felt` names [N]."""
OWN: int = column_of(TOUCH, "value")
"""Column of that value."""
CONTACT_COLUMNS: int = width_of(TOUCH)
"""Number of columns."""
CONTACT = -2
"""Number that stands, in place of that of a term, for what bodies feel of contact."""
FELT = np.dtype([("depth", float), ("force", float, (3,)), ("element", float)])
"""That: the largest depth of lines in a body, or that of a pair of bodies [m]; the force on the body [N]; the element
of that depth, −1 where nothing touches."""
FELT_COLUMNS: int = width_of(FELT)
"""Number of its columns."""


class ImplicitContactKernels(NamedTuple):
    """Kernels that solve for contact losses in the kick of an explicit method, see `refweb.effects.contact_solver`.

    Attributes
    ----------
    detect, law : kernel
        Detection of contacts, and their law; signatures are in `refweb.kernels`.
    slots : int
        Number of contacts of a cell whose forces are kept until the next step.
    parts : int
        Largest number of rows that a contact moves, without attached nodes.
    """

    detect: Callable[..., Any]
    law: Callable[..., Any]
    slots: int
    parts: int = 4


class Crossing(NamedTuple):
    """Penetration check of cells of a term, each of two lines that may pass through each other.

    Attributes
    ----------
    meets, soon : kernel
        Check if lines of a cell meet in a drift; time in which no lines can meet. Signatures are in `refweb.kernels`.
    touch : float
        Distance at which lines touch [m].
    stiffness : float
        Contact stiffness k [N/m].
    rows, data, elements : ndarray
        Rows, numbers and elements of neighbours: pairs of lines that do not push each other.
    """

    meets: Callable[..., Any]
    soon: Callable[..., Any]
    touch: float
    stiffness: float
    rows: NDArray[np.int32]
    data: NDArray[np.float64]
    elements: NDArray[np.int64]


class Tangent(NamedTuple):
    """Stiffness of a force.

    Attributes
    ----------
    stiffness : kernel, optional
        −∂f/∂x by cell, None where it is zero.
    bound : kernel, optional
        Bound on the row sums of |K|, for the step of an explicit method; None where it is zero.
    symmetric : bool
        True if stiffness and damping are symmetric.
    across : ndarray, shape (cells, 3 arity, 3 arity), optional
        Stiffness of cells that are threads across themselves, by a unit tension [1/m].
    """

    stiffness: Callable[..., Any] | None = None
    bound: Callable[..., Any] | None = None
    symmetric: bool = True
    across: NDArray[np.float64] | None = None


class VelocityForce(NamedTuple):
    """Dependence of a force on velocity.

    Attributes
    ----------
    damping : kernel, optional
        −∂f/∂v by cell; None where the force does not depend on velocity.
    bound : kernel, optional
        Bound on the row sums of |−∂f/∂v|; None where kicks are solved by ``implicit``.
    implicit : ImplicitContactKernels, optional
        Kernels that solve explicit kicks of a force that may be stiff; None where kicks iterate it.
    jumps : bool
        True for a force over the lines that jumps where a line snaps taut within a step.
    """

    damping: Callable[..., Any] | None = None
    bound: Callable[..., Any] | None = None
    implicit: ImplicitContactKernels | None = None
    jumps: bool = False


class ContactForce(NamedTuple):
    """Kind of a contact, and its detection.

    Attributes
    ----------
    felt : tuple of int
        Columns of ``cells`` with the row of the body on which the force in ``out`` acts, see `FELT`, and, between
        bodies, with the row of the body on which its negative acts; empty without a body.
    pairs : tuple of (RigidBody, RigidBody)
        The bodies of each cell, for contact of bodies with bodies.
    near : kernel, optional
        Finds the cells that may act soon, for an explicit method. The others add no force and have zeros in ``out``.
        None if all cells are evaluated.
    finder : kernel, optional
        As ``near``, if cells are elements of which any two may act on each other, or pairs of them. Finds (numbers of
        the elements, their rows, their data) of the pairs that may act soon. Such a term has no stiffness. None if the
        cells themselves act.
    foresee : kernel, optional
        Writes to the data of pairs how near they may come in a span, and how fast they are then. None where steps are
        planned for rows, and not for spans.
    crossing : Crossing, optional
        Penetration check of lines with lines, if the cells are lines that push each other.
    passing : kernel, optional
        Penetration check of lines with a body, for contact of bodies with straight lines. It tells, as a kernel
        `refweb.kernels.MEETS`, if lines come as deep in a body as its middle in a drift.
    places : int
        Number of columns behind a `TOUCH` with the places of contact, which the detection of friction reads.
    """

    felt: tuple[int, ...] = ()
    pairs: tuple[tuple[RigidBody, RigidBody], ...] = ()
    near: Callable[..., Any] | None = None
    finder: Callable[..., Any] | None = None
    foresee: Callable[..., Any] | None = None
    crossing: Crossing | None = None
    passing: Callable[..., Any] | None = None
    places: int = 0

    @property
    def with_lines(self) -> bool:
        """True for contact of lines with bodies."""
        return len(self.felt) == 1


class Balance(NamedTuple):
    """Part of a force in the balances of energy and momentum.

    Attributes
    ----------
    column : str
        Column of the energy balance of its energy or power: "work", "dissipated_energy", or a separate energy.
    power : int, optional
        Column of ``out`` with the power of the force [W], if ``column`` is "work" or "dissipated_energy".
    internal : bool
        True if the net exerts the forces on itself: their resultant is zero, and a rigid motion does not change them.
    impulse : kernel, optional
        Impulse of all cells until a time, exact in time and displacement, for the momentum balance. None if there is no
        such formula: then the impulse is integrated along the steps. For forces that depend on velocity it is linear in
        displacement.
    moment_free : bool
        True if forces that are not internal have no moment about the centre of mass of web and bodies.
    twists : bool
        True if forces that are internal have moments that the twist of lines or a clamp bears: they do not keep angular
        momentum, and feel a rotation as a whole.
    """

    column: str
    power: int | None = None
    internal: bool = False
    impulse: Callable[..., Any] | None = None
    moment_free: bool = False
    twists: bool = False


class MovingFrame(NamedTuple):
    """Rotating frame of a term of inertia forces.

    Attributes
    ----------
    angular_velocity : sequence of 3 float, optional
        Angular velocity of the frame [rad/s].
    orbit_radius : float, optional
        Radius of an orbit [m], for forces that are linear in distances from the origin, which are small against it.
    """

    angular_velocity: tuple[float, float, float] | None = None
    orbit_radius: float | None = None


class Timing(NamedTuple):
    """Times of a force.

    Attributes
    ----------
    times : sequence of float
        Times at which the force has a corner [s]; no step of an implicit method passes one.
    at_rest : bool
        True if the force acts at rest; statics leaves out all other forces.
    """

    times: Sequence[float] = ()
    at_rest: bool = True


class InternalVariables(NamedTuple):
    """Internal variables of elements, unknowns z that are no places, with c z' = f.

    They are in rows at the end, `refweb.net.net.Net.internal`. f is the force that terms add there, and c z'² is what
    their own term dissipates.

    Attributes
    ----------
    components : ndarray of int, shape (variables,)
        3 row + axis of each.
    elements : ndarray of int, shape (variables,)
        Element of each; −1 for one of none, as of a thread.
    resistance : ndarray, shape (variables,)
        c over the natural length of the element, without one c.
    relax : kernel
        Takes them over a step of an explicit method.
    space : int
        Number of strains that this notes.
    title : str
        Table or key of a scene that brings them, for messages.
    follower : object, optional
        Has ``taken_on(net, x, t)``, the displacement of all rows with variables that follow at once and are no
        unknowns; ``grown(net, x, t)``, numbers that fall where one of them would turn back; and ``drive(net, x, t)``,
        numbers of as many that are largest there. None where all are unknowns.
    """

    components: np.ndarray
    elements: np.ndarray
    resistance: np.ndarray
    relax: Callable
    space: int
    title: str
    follower: Any = None

    def joined(self, others: InternalVariables) -> InternalVariables:
        """These and others as unknowns of one system, in the order of their components."""
        both = {n: np.append(getattr(self, n), getattr(others, n)) for n in ("components", "elements", "resistance")}
        order = np.argsort(both["components"])
        return self._replace(**{name: values[order] for name, values in both.items()})


def with_rows(net: Net, count: int) -> Net:
    """The net with rows of internal variables behind all others."""
    more = np.zeros((count, 3))
    return replace(
        net,
        points=np.vstack([net.points, more]),
        mass=np.append(net.mass, more[:, 0]),
        spins=net.spins + count,
        internal=net.internal + count,
    )


def with_internal(net: Net, name: str, each: int, length_force: Callable[[Net], Any]) -> Net:
    """The net with rows for ``each`` internal variables of every element behind all others, three to a row.

    The first row of an element stands in a new column ``name`` of line data. ``length_force`` makes the kernel of ∂E/∂L
    of the net, internal variables included.
    """
    count, width = len(net.cells), -(-each // 3)
    first = float(len(net.points)) + width * np.arange(count, dtype=float)
    return replace(with_rows(net.with_column(name, first), width * count), length_force=length_force)


def with_numbers(net: Net, x: NDArray[np.float64] | None, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement of all rows, by default 0, with other internal variables, shape (elements, each)."""
    x = np.zeros(net.points.shape) if x is None else x.copy()
    first = len(x) - net.internal
    rows = x[first : first + net.rows_of_elements].reshape(len(net.cells), -1)
    rows[:] = 0.0
    rows[:, : numbers.shape[1]] = numbers
    return x


class CellElements(NamedTuple):
    """Elements of the net through which cells act, or that they are; a cell ends when its element breaks.

    Attributes
    ----------
    numbers : ndarray of int, shape (cells,) or (cells, 2), optional
        Elements of each cell; None for forces on nodes, and for cells that are the elements of the net or a thread.
    disable : callable, optional
        Changes rows of ``data`` in place so that their cells have no force, for cells with a broken element.
    adds_tension : bool
        True for a force over the lines beside their law, which writes the whole tension to ``out``.
    observed : int
        Number of values per cell in ``out`` that observables read, of a thread.
    by_blocks : callable, optional
        Returns the force kernel of lines for steps of an explicit method, its cells and its numbers, for those of the
        term, the number of rows of a matrix of `BLOCK_OUT` that the kernel takes as well, 0 if it takes none, and the
        place of each natural length among the numbers, flattened.
    internal : InternalVariables, optional
        Internal variables that the cells have.
    """

    numbers: NDArray[np.int64] | None = None
    disable: Callable[..., Any] | None = None
    adds_tension: bool = False
    observed: int = 0
    by_blocks: Callable[..., Any] | None = None
    internal: InternalVariables | None = None


@dataclass(frozen=True, eq=False)
class ForceTerm:
    """Force of cells of one kind with its kernels, whose signatures are in `refweb.kernels`.

    Attributes
    ----------
    name : str
        Name of the effect.
    cells : ndarray of int32, shape (cells, arity)
        Rows that each cell couples.
    data : ndarray, shape (cells, columns), optional
        Numbers of each cell. None if the cells are the elements of the net: kernels then get the line data at the time,
        `refweb.system.system.System.line_data`, and all such terms share one ``out``, with the columns from `TENSION`
        on.
    force : kernel
        Adds to the forces.
    balance : Balance
        Part in the balances of energy and momentum.
    energy : kernel, optional
        Potential of the force, if there is one; for a force with a power it is linear in time between its times.
    tangent, velocity, contact, frame, timing, elements
        Parts that are left out where a force has none, see the classes; none may be None.
    """

    name: str
    cells: NDArray[np.int32]
    data: NDArray[np.float64] | None
    force: Callable[..., Any]
    balance: Balance
    energy: Callable[..., Any] | None = None
    tangent: Tangent = Tangent()
    velocity: VelocityForce = VelocityForce()
    contact: ContactForce = ContactForce()
    frame: MovingFrame = MovingFrame()
    timing: Timing = Timing()
    elements: CellElements = CellElements()

    @property
    def over_lines(self) -> bool:
        """True if the cells are the elements of the net."""
        return self.data is None

    @property
    def columns(self) -> int:
        """Number of values per cell that ``force`` writes to its ``out``."""
        if self.contact.felt:
            return CONTACT_COLUMNS + self.contact.places
        if self.velocity.jumps:
            return SNAPPED + 1
        if self.elements.adds_tension and self.balance.power is None:
            return DAMPED_TENSION + 1
        if self.elements.observed:
            return self.elements.observed
        return int(self.contact.crossing is not None) if self.balance.power is None else self.balance.power + 1

    @property
    def dead(self) -> bool:
        """True for a load that follows from time alone, with a power and a potential."""
        linear = self.tangent.stiffness is None and self.velocity.damping is None
        return linear and self.balance.power is not None and self.energy is not None


@kernel(FORCE)
def no_force(t, x, v, f, cells, data, out):
    pass


def pairs_of(system: System) -> list[tuple[RigidBody, RigidBody]]:
    """Pairs of bodies of a system that may touch each other, in the order of terms and their cells."""
    return [pair for term in system.terms for pair in term.contact.pairs]


def refuse_found(terms: Iterable[ForceTerm], what: str) -> None:
    """Refuse terms with a `ContactForce.finder`, which have no tangent, since ``what`` needs one."""
    for term in terms:
        if term.contact.finder is not None:
            raise InputError(
                f"[{term.name}] has more pairs of elements than a tangent may hold, in a web of {len(term.cells)} "
                f'elements, and {what} needs one: use method = "central-difference" and start = "web"'
            )


def refuse_flows(net: Net, name: str) -> None:
    """Refuse ``name``, which has masses that stay, beside masses that follow a reel or a winch; `InputError`."""
    if net.flows:
        follows = "[[winch]]" if net.flows[0].wound else "[[reel]]"
        raise InputError(f'{name} takes masses that stay: leave it out, or {follows} mass = "follows"')


def without(columns: int | slice) -> Callable[[NDArray[np.float64]], None]:
    """A `CellElements.disable` that sets some columns, a number or a slice, to zero."""

    def disable(numbers):
        numbers[:, columns] = 0.0

    return disable


@dataclass(frozen=True, eq=False)
class PrescribedMotion:
    """Rows whose motion is prescribed; ``kernel`` (signature `FORCE`) writes their x and v at time t.

    Between its times v is constant: steps of orders 4 and 6 rely on it. Of rows of rotation it is the angular velocity.

    Attributes
    ----------
    cells : ndarray of int32, shape (rows, 1)
        The driven rows.
    data : ndarray, shape (rows, columns)
        Numbers of each row.
    kernel : kernel
        Writes x and v.
    times : sequence of float
        Times at which the motion has a corner [s].
    """

    cells: NDArray[np.int32]
    data: NDArray[np.float64]
    kernel: Callable[..., Any]
    times: Sequence[float] = ()


@dataclass(frozen=True, eq=False)
class Constraint:
    """Pairs of rows with a constant distance: g(x) = (|d|² − L²)/(2L) = 0 with d from the first to the second.

    This class defines the constraint; `refweb.system.links` finds the forces that maintain it.

    Attributes
    ----------
    cells : ndarray of int32, shape (cells, 2)
        The rows.
    data : ndarray, shape (cells, 4)
        The vector d at x = 0, and its magnitude L [m].
    """

    cells: NDArray[np.int32]
    data: NDArray[np.float64]

    def between(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vectors d from the first to the second row of each pair, shape (cells, 3)."""
        return x[self.cells[:, 1]] - x[self.cells[:, 0]]

    @property
    def length(self) -> NDArray[np.float64]:
        """L [m], shape (cells,)."""
        return self.data[:, 3]

    def excess(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """g [m] at displacement x, shape (cells,); it is close to the difference of both lengths if that is small."""
        u = self.between(x)
        return ((2.0 * self.data[:, :3] + u) * u).sum(axis=1) / (2.0 * self.length)

    def direction(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """∂g/∂x of the second row, d/L, shape (cells, 3); that of the first is its negative."""
        return (self.data[:, :3] + self.between(x)) / self.length[:, None]

    def speed(self, x: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
        """dg/dt [m/s] at displacement x and velocity v, shape (cells,)."""
        return (self.direction(x) * self.between(v)).sum(axis=1)

    def turning(self, v: NDArray[np.float64]) -> NDArray[np.float64]:
        """Part of d²g/dt² beside the accelerations, |v₂ − v₁|²/L [m/s²], shape (cells,)."""
        return (self.between(v) ** 2).sum(axis=1) / self.length

    def pull(self, x: NDArray[np.float64], multipliers: NDArray[np.float64]) -> NDArray[np.float64]:
        """Gᵀλ on every row [N], G = ∂g/∂x, shape (rows, 3); the links act with its negative."""
        along, total = multipliers[:, None] * self.direction(x), np.zeros_like(x)
        np.subtract.at(total, self.cells[:, 0], along)
        np.add.at(total, self.cells[:, 1], along)
        return total


@dataclass(frozen=True, eq=False)
class BreakLimits:
    """Limits at which elements break.

    Attributes
    ----------
    limits : ndarray, shape (elements,)
        Tension at which each element breaks [N], infinite for elements that cannot break.
    times : tuple of (float, int)
        Times at which elements break at any tension [s], increasing, with the element.
    strains : ndarray, shape (elements,), optional
        Strain at which each element breaks [1], infinite for elements that break by tension alone; None if all do.
    """

    limits: NDArray[np.float64]
    times: tuple[tuple[float, int], ...] = ()
    strains: NDArray[np.float64] | None = None

    @property
    def watched(self) -> bool:
        """True if any limit is finite."""
        return self.strains is not None or bool(np.isfinite(self.limits).any())

    @property
    def breakable(self) -> NDArray[np.bool_]:
        """True for each element that may break."""
        mask = np.isfinite(self.limits)
        if self.strains is not None:
            mask |= np.isfinite(self.strains)
        mask[[element for _, element in self.times]] = True
        return mask

    def shares(self, per_cell: PerCell) -> NDArray[np.float64]:
        """Tension of each element over its limit, or strain over its limit where that is larger, shape (elements,)."""
        shares = per_cell.tension / self.limits
        return shares if self.strains is None else np.maximum(shares, per_cell.lines[:, STRAIN] / self.strains)


def column(rows: Sequence[int] | NDArray[np.int64]) -> NDArray[np.int32]:
    """Row numbers as the cells of a term that couples nothing: int32, shape (rows, 1)."""
    return np.ascontiguousarray(np.asarray(rows, dtype=np.int32).reshape(-1, 1))
