"""The sum of effects: M v' = f(t, x, v), x' = v, with supports eliminated.

A `System` concatenates the terms of its effects once and has the interface of one of them: force, energy, stiffness.
``x`` is the displacement of each row from its reference position, shape (rows, 3); a solver sees only the system.

Where effects prescribe natural lengths, the numbers of the lines are a function of time, `System.line_data`: every
force and energy uses the numbers of its time t, and `System.at` returns the system with the numbers of one time. The
net itself keeps its lengths as built. A loop of kernels cannot call Python, and keeps its own array of lengths.

Values are written to arrays of the caller, by default new ones, so that threads may share a system. May change: private
names and `MOST_TURN`. Must stay: public names, which solvers and plug-ins use; the order of `_in_tangent`, that of
blocks; `_at_time` is replaced as a whole and its numbers never written to, as threads share it. A new cached property
belongs in what `at`, `with_line_data`, `static_system`, `broken_lines`, `statics.shared_push` and
`statics.monotone_loading` drop, if it depends on what these change. Tests: ``tests/system/test_system.py``.
"""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import cached_property, reduce
from typing import TYPE_CHECKING, Any

import numpy as np

from ..effects.base import DAMPED_TENSION, TENSION, BreakLimits, Constraint, ForceTerm, PrescribedMotion
from ..findings import Finding
from ..net.rigid_body import row_names, with_rotations
from ..net.rotation import turn_by
from .effect_parts import parts_of
from .forces import Forces, PerCell
from .start import initial_velocity, laid

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..effects.natural_lengths import NaturalLengths
    from ..net.laws.line_data import LineData
    from ..net.net import Net
    from ..net.rigid_body import RigidBody
    from .contact_forces import ContactForces
    from .factorization import Library
    from .links import Links
    from .mass import Mass
    from .sparsity import Pattern
    from .unsupported_parts import Part

MOST_TURN = 0.5
"""Largest angle by which a step of statics turns a body [rad]."""


class System:
    """A net, the effects on it and its supports.

    Parameters
    ----------
    net : refweb.net.net.Net
        Rows, lines and masses.
    effects : sequence
        Values with ``on(net)``.
    supported : ndarray of bool, shape (nodes, 3)
        Components of nodes that do not move, or move as prescribed.
    factorization : {"auto", "qdldl", "supernodal", "superlu", "multifrontal", "rslab"}
        Library that factorizes its symmetric matrices.

    Attributes
    ----------
    terms : list of refweb.effects.base.ForceTerm
        One per effect that adds forces.
    acting : list of (effect, list)
        Effects, and what each gives.
    drives : list of refweb.effects.base.PrescribedMotion
        One per effect that prescribes motion; its rows are supported as well.
    constraints : list of refweb.effects.base.Constraint
        One per effect that keeps distances; no force of the system holds them.
    weakness : refweb.effects.base.BreakLimits or None
        Limits of elements that may break; None if none may.
    carried : ndarray of bool, shape (rows,)
        True for nodes that free bodies carry and that move with them.
    internal : refweb.effects.base.InternalVariables or None
        Internal variables that are unknowns.
    followers : list
        Followers of the others, see `refweb.effects.base.InternalVariables`.
    free : ndarray of int
        Components 3 row + axis of the unknowns, increasing.
    angles : bool
        True if the unknowns of rotation of bodies are rotation vectors, as in statics, see
        `refweb.system.resting_bodies`; False for quaternions.
    contact_shares : ndarray or None
        Shares of elements in the contact of their line with a sphere, see `refweb.system.contact_shares`; None where
        the deepest element has all of it.
    """

    contact_shares: NDArray[np.float64] | None = None

    def __init__(
        self, net: Net, effects: Sequence[Any], supported: NDArray[np.bool_], factorization: str = "auto"
    ) -> None:
        for effect in sorted(effects, key=lambda effect: hasattr(effect, "on")):  # bodies before what makes them turn
            if hasattr(effect, "extend"):
                net = effect.extend(net)
        net = with_rotations(net)
        if net.wound:
            from ..effects.wound_lines import with_wound

            net = with_wound(net)
        for effect in effects:
            if hasattr(effect, "add_internal"):
                net = effect.add_internal(net)
        self.net: Net = net
        self.effects: Sequence[Any] = effects
        self.rows: int = len(net.points)
        self.acting: list[Any] = [(effect, parts_of([effect], net)) for effect in effects]
        acting = [part for _, parts in self.acting for part in parts]
        if any(body.axle and body.axle.torque for body in net.bodies):
            from ..effects.axle import torques

            acting += torques(net)
        self.terms: list[ForceTerm] = [a for a in acting if isinstance(a, ForceTerm)]
        self.drives: list[PrescribedMotion] = [a for a in acting if isinstance(a, PrescribedMotion)]
        self.constraints: list[Constraint] = [a for a in acting if isinstance(a, Constraint)]
        self.weakness: BreakLimits | None = next((a for a in acting if isinstance(a, BreakLimits)), None)
        powers = [term.balance.power for term in self.terms if term.over_lines and term.balance.power is not None]
        if len(set(powers)) < len(powers):
            raise ValueError("the lines have one column for a power: two effects must not both be `lines` with a power")
        internal = [term.elements.internal for term in self.terms if term.elements.internal]
        unknown = [variables for variables in internal if not variables.follower]
        self.internal: Any = reduce(lambda first, more: first.joined(more), unknown) if unknown else None
        self.followers: list[Any] = [variables.follower for variables in internal if variables.follower]
        self.supported: NDArray[np.bool_] = np.vstack(
            [supported, np.zeros((self.rows - len(supported), 3), dtype=bool)]
        )
        if internal:
            self.supported[self.rows - net.internal :] = True
        if self.internal is not None:
            self.supported.ravel()[self.internal.components] = False
        for body in net.bodies:
            self.supported[body.row] = self.supported[body.base] = body.fixed or bool(body.axle)
        for drive in self.drives:
            self.supported[drive.cells[:, 0]] = True
        self.angles: bool = net.quasi_static and self.turning
        if self.angles:
            self.supported[[body.turn for body in net.bodies if body.turn is not None]] = True
        self.carried: NDArray[np.bool_] = np.zeros(self.rows, dtype=bool)
        self.carried[net.carried] = True
        self.supported[self.carried] = True
        if net.flows:
            from ..effects.sliding_material import force_terms

            self.terms += force_terms(self)
        self._factorization = factorization
        if factorization == "rslab":
            _ = self.library  # which refuses it where it is not installed
        self.arrange()

    def arrange(self) -> None:
        """Set the attributes that follow from supports and terms."""
        self.free: NDArray[np.int64] = np.flatnonzero(~self.supported)
        self._zero = np.zeros((self.rows, 3))
        self._at_time = None  # the last time that lengths were asked for, and `line_data` then, which stays as it is

    @cached_property
    def library(self) -> Library:
        """Library that factorizes its symmetric matrices, a `refweb.system.factorization.Library`."""
        from .factorization import MEDIUM, STEPPED, Library

        return Library(self._factorization, MEDIUM if self.net.quasi_static else STEPPED)

    @property
    def fixed(self) -> NDArray[np.bool_]:
        """True for components of position that supports, axles or prescribed motion fix, shape (rows, 3)."""
        fixed = self.supported & ~self.carried[:, None]
        fixed[self.rows - self.net.spins :] = False
        return fixed

    @property
    def factorized_by(self) -> str | None:
        """Name of the library that has factorized and the reason, a text; None before a factorization."""
        return self.library.why if "library" in self.__dict__ else None

    def remarks(self) -> list[Finding]:
        """Findings on the factorizations."""
        remarks = self.library.remarks if "library" in self.__dict__ else []
        return [Finding("slow-library", text, "solve") for text in remarks]

    @property
    def internal_of_lines(self) -> str:
        """Table or key that gives lines internal variables; empty without any."""
        of_lines = (term.elements.internal for term in self.terms if np.array_equal(term.cells, self.net.cells))
        titles = (internal.title for internal in of_lines if internal)
        return next(titles, "") if self.net.rows_of_elements else ""

    def resistance(self, t: float) -> NDArray[np.float64]:
        """c of each internal variable at time t, in the order of their components, see `InternalVariables`."""
        return self.internal.resistance * np.append(self.natural_length(t), 1.0)[self.internal.elements]

    def settled(self, x: Any) -> Any:
        """A state, x or None as it is given, with internal variables as they are after all time at rest, or new."""
        for effect in self.effects:
            if hasattr(effect, "settled"):
                x = effect.settled(self.at(0.0).net, x)
        return x

    def taken_on(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """A state with internal variables that follow at once as it asks for at time t, x itself where none do."""
        for follower in self.followers:
            x = follower.taken_on(self.at(t).net, x, t)
        return x

    @cached_property
    def laid(self) -> NDArray[np.float64] | None:
        """Displacement at the start [m], shape (rows, 3); None if the web starts in its position as built."""
        return laid(self)

    def initial_velocity(self) -> NDArray[np.float64]:
        """Velocities at the start [m/s], shape (rows, 3): those of the effects and bodies."""
        return initial_velocity(self)

    @property
    def lines(self) -> ForceTerm | None:
        """The `ForceTerm` of the tension of lines; None if they have no tension."""
        return next((term for term in self.terms if term.over_lines), None)

    @property
    def threads(self) -> dict[int, Any]:
        """The `refweb.net.threads.ThreadLine` of the net by the numbers of their terms."""
        numbers = [number for number, term in enumerate(self.terms) if term.elements.observed]
        return dict(zip(numbers, self.net.threads, strict=True))

    @property
    def _in_tangent(self):
        """Terms with a stiffness or a damping, in the order of the pattern."""
        return [f for f in self.terms if f.tangent.stiffness is not None or f.velocity.damping is not None]

    @cached_property
    def pattern(self) -> Pattern:
        """The fixed `refweb.system.sparsity.Pattern` of the tangent."""
        from .sparsity import Pattern

        also = [np.array([(b.spin, b.turn)], dtype=np.int32) for b in self.net.bodies if b.turn is not None]
        also += self.carriers.cells if self.carriers else []
        return Pattern(self.rows, self.free, [f.cells for f in self._in_tangent], self.library, also)

    @cached_property
    def carriers(self) -> Any:
        """The `Carried` of bodies that carry nodes, in statics the `RestingBodies` of those that turn; None without."""
        if self.angles:
            from .resting_bodies import RestingBodies

            return RestingBodies(self.net, self._in_tangent)
        if not self.carried.any():
            return None
        from .attached_nodes import Carried

        return Carried(self.net, self._in_tangent)

    @cached_property
    def levers(self) -> NDArray[np.float64]:
        """Lever of each row [m], shape (rows,), which compares moments and rotations with forces and displacements.

        It is 1 for rows that are no rotation.
        """
        levers = np.ones(self.rows)
        for body in self.net.bodies:
            if body.spin is not None:
                levers[body.spin] = max([body.extent, *np.linalg.norm(body.points, axis=1)])
        return levers

    def sizes(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """Magnitude of the force on each row [N], for a moment over its lever, shape (rows,)."""
        sizes = np.linalg.norm(force, axis=1)
        return sizes / self.levers if self.net.spins else sizes

    @property
    def resting(self) -> list[RigidBody]:
        """Free bodies whose places are unknowns, and at rest those that turn about axles, a list."""
        on_axles = [
            body for body in self.net.bodies if self.angles and body.axle and not self.supported[body.spin].all()
        ]
        return [body for body in self.net.bodies if body in on_axles or not self.supported[body.row].all()]

    def moved(self, x: NDArray[np.float64], step: NDArray[np.float64]) -> NDArray[np.float64]:
        """Displacement [m] after a step of all rows, both of shape (rows, 3); bodies turn by rotation vectors."""
        y = x + step
        if self.angles:
            turn_by(x, y, np.zeros_like(y), self.carriers.turns)
        return y

    def rows_of(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """A step of the unknowns as one of all rows, shape (rows, 3)."""
        step = np.zeros((self.rows, 3))
        step.ravel()[self.free] = p
        return step

    def largest_share(self, p: NDArray[np.float64]) -> float:
        """Largest share, up to 1, of a step of the unknowns that keeps a tangent meaningful.

        It turns no body by more than `MOST_TURN`, and moves no body that may touch the web by more than half its
        thickness, on an axle by its turn.
        """
        share, step = 1.0, self.rows_of(p)
        for body in self.resting:
            angle = 0.0 if body.turn is None else float(np.linalg.norm(step[body.spin]))
            shift = float(np.linalg.norm(step[body.row]))
            if body.axle:
                shift = angle * (float(np.linalg.norm(body.arm)) + body.extent)
            shift = shift / (0.5 * body.thickness) if self.contact else 0.0
            share = min(share, 1.0 / max(angle / MOST_TURN, shift, 1.0))
        return share

    @cached_property
    def mass(self) -> Mass:
        """The `refweb.system.mass.Mass`."""
        from .mass import Mass

        return Mass(self.net, self.free, self.pattern, self._lines_in_tangent)

    def mass_at(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of M of the unknowns [kg] at displacement x; for rotations of bodies their inertia at x [kg m²]."""
        return self.carriers.tensors(self.mass.values, self, x) if self.angles else self.mass.values

    @property
    def _lines_in_tangent(self):
        """Number of the term of lines in the pattern; None if lines have no tension."""
        return next((i for i, term in enumerate(self._in_tangent) if term.over_lines), None)

    @cached_property
    def unsupported_parts(self) -> list[Part]:
        """Parts of the net without support along an axis, a list of `refweb.system.unsupported_parts.Part`."""
        from .unsupported_parts import find_parts

        return find_parts(self)

    def per_cell(self) -> PerCell:
        """A `PerCell` of new arrays; terms over the lines share one array."""
        lines = np.zeros((len(self.net.cells), max([2, *(f.columns for f in self.terms if f.over_lines)])))
        arrays = [lines if f.over_lines else np.zeros((len(f.cells), f.columns)) for f in self.terms]
        return PerCell(arrays, lines, self.tension_column)

    @property
    def tension_column(self) -> int:
        """Column of the output of lines with their whole tension."""
        return DAMPED_TENSION if any(f.elements.adds_tension for f in self.terms) else TENSION

    def blocks(self) -> list[NDArray[np.float64]]:
        """New arrays for `stiffness` and `damping` to fill, shape (cells, 3 arity, 3 arity) each."""
        sizes = [(len(f.cells), 3 * f.cells.shape[1]) for f in self._in_tangent]
        return [np.empty((count, size, size)) for count, size in sizes]

    @property
    def working(self) -> NDArray[np.int64]:
        """Sign of each term: 1 if its power counts as work, −1 if its power is energy lost, else 0."""
        signs = {"work": 1, "dissipated_energy": -1}
        return np.array(
            [signs[f.balance.column] if f.balance.power is not None else 0 for f in self.terms], dtype=np.int64
        )

    @property
    def works(self) -> bool:
        """True where motion, natural lengths that change or material that comes does work, beside the terms."""
        return bool(self.drives or self.net.factors or self.net.flows)

    @property
    def corners(self) -> NDArray[np.float64]:
        """Times at which a table of time has a corner [s], increasing."""
        times = [t for term in self.terms for t in term.timing.times]
        times += [t for drive in self.drives for t in drive.times]
        times += [t for _, table in self.net.factors for t, _ in table]
        return np.unique(np.array(times, dtype=float))

    @cached_property
    def lengths(self) -> NaturalLengths:
        """The `refweb.effects.natural_lengths.NaturalLengths` that change with time."""
        from ..effects.natural_lengths import NaturalLengths

        return NaturalLengths.of(self.net)

    @cached_property
    def material_flow(self) -> Any:
        """The `refweb.system.material_flow.MaterialFlow` of masses that follow reels and winches."""
        from .material_flow import MaterialFlow

        return MaterialFlow(self)

    def line_data(self, t: float) -> LineData:
        """`Net.line_data` with the natural lengths of time t."""
        if not self.net.factors:
            return self.net.line_data
        known = self._at_time
        if known is None or known[0] != t:
            from ..effects.natural_lengths import set_lengths

            numbers = self.net.line_data.copy()
            set_lengths(t, self.lengths, numbers.matrix)
            self._at_time = known = t, numbers
        return known[1]

    def forget_lengths(self) -> None:
        """Forget the lengths of the last time, where their tables have changed."""
        self._at_time = None

    def natural_length(self, t: float) -> NDArray[np.float64]:
        """Natural length of each element at time t [m], shape (elements,)."""
        return self.line_data(t).natural_length

    def at(self, t: float, x: NDArray[np.float64] | None = None) -> System:
        """The system as it stands at time t: its natural lengths and masses are those of that time, and stay.

        Masses that follow winches are those of displacement x, by default those as built.
        """
        if not self.net.factors and (x is None or not self.net.flows):
            return self
        view = self.with_line_data(self.line_data(t))
        view.net = replace(view.net, factors=())
        if self.net.flows:
            view.net = replace(view.net, flows=(), mass=self.material_flow.masses(t, x))
            view.__dict__.pop("mass", None)
        return view

    def snapshot(self, t: float) -> System:
        """The system as it stands at time t, with a copy of all numbers that commands may change."""
        view = copy.copy(self.at(t))
        if self.net.wound:  # whose numbers stand in those of lines
            view = view.with_line_data(view.net.line_data.copy())
        view.terms = [term if term.data is None else replace(term, data=term.data.copy()) for term in self.terms]
        view.drives = [replace(drive, data=drive.data.copy()) for drive in self.drives]
        return view

    def with_line_data(self, numbers: LineData) -> System:
        """The same system with other numbers of its lines, a `refweb.net.laws.line_data.LineData`."""
        changed = copy.copy(self)
        changed.net = replace(self.net, line_data=numbers)
        changed._at_time = None
        changed.__dict__.pop("lengths", None)
        return changed

    def with_effects(self, effects: dict[str, Any]) -> System:
        """The same system with other effects on the same cells, a dict by the names of their terms."""
        changed, terms = copy.copy(self), {}
        for name, effect in effects.items():
            terms[name] = iter(parts_of([effect], self.net))
        changed.terms = [next(terms[term.name]) if term.name in terms else term for term in self.terms]
        return changed

    def data_of(self, term: ForceTerm, t: float) -> NDArray[np.float64]:
        """Numbers of the cells of a term at time t, shape (cells, columns)."""
        return self.line_data(t).matrix if term.data is None else term.data

    def length_force(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """∂E/∂L of each element [N], shape (elements,); times the change of L it is the work of reels."""
        from ..effects.natural_lengths import work_of_lengths

        force = np.empty(len(self.net.cells))
        work_of_lengths(self.net)(t, x, self.net.cells, self.line_data(t).matrix, force)
        return force

    def drive(self, t: float, x: NDArray[np.float64], v: NDArray[np.float64] | None = None) -> None:
        """Write prescribed displacements [m] and velocities [m/s] of time t, and carried nodes, into x and v."""
        v = np.zeros_like(x) if v is None else v
        for d in self.drives:
            d.kernel(t, x, v, self._zero, d.cells, d.data, self._zero)
        if self.carriers:
            self.carriers.update_attached_nodes(x, v)

    def force(self, t: float, x: NDArray[np.float64], v: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Force on every row [N], supports included, shape (rows, 3)."""
        return self.forces(t, x, v)[0]

    def forces(
        self, t: float, x: NDArray[np.float64], v: NDArray[np.float64] | None = None, per_cell: PerCell | None = None
    ) -> Forces:
        """The `Forces` at displacement x and velocity v, by default at rest; written to a `per_cell` if given."""
        v, per_cell = self._zero if v is None else v, self.per_cell() if per_cell is None else per_cell
        f = np.zeros((self.rows, 3))
        for term, out in zip(self.terms, per_cell, strict=True):
            term.force(t, x, v, f, term.cells, self.data_of(term, t), out)
        if self.carriers:
            self.carriers.add_forces_to_bodies(x, f)
        return Forces(f, per_cell)

    def force_of(
        self,
        term: ForceTerm,
        t: float,
        x: NDArray[np.float64],
        v: NDArray[np.float64] | None = None,
        f: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Force on every row of one term [N], added to ``f`` where that is given."""
        f = np.zeros((self.rows, 3)) if f is None else f
        out = np.zeros((len(term.cells), max(term.columns, 2)))
        term.force(t, x, self._zero if v is None else v, f, term.cells, self.data_of(term, t), out)
        return f

    def outer_force(
        self, t: float, x: NDArray[np.float64] | None = None, v: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Force on every row [N] of all terms that are not internal, by default on the web as built, at rest."""
        x = self._zero if x is None else x
        outer = [self.force_of(term, t, x, v) for term in self.terms if not term.balance.internal]
        return sum(outer, np.zeros((self.rows, 3)))

    @cached_property
    def links(self) -> Links:
        """The `refweb.system.links.Links` of the constraints."""
        from .links import Links

        return Links(self)

    def balance(self, t: float, x: NDArray[np.float64], v: NDArray[np.float64]) -> Forces:
        """The `Forces` with those of links, on supports minus the inertia forces of consistent mass.

        The reaction of supports is its negative.
        """
        force, per_cell = self.forces(t, x, v)
        if self.constraints:
            force += self.links.force(x, v, force)
        if self.net.consistent_minus_lumped is not None and not self.net.quasi_static:
            force -= np.where(self.supported, self.mass.passed_on(self.mass.moved_by(force)), 0.0)
        return Forces(force, per_cell)

    def row_name(self, row: int) -> str:
        """Name of a row in messages: a node by its number, a body by its name."""
        if row >= self.rows - self.net.internal:
            for thread in self.net.threads:
                if 0 <= thread.first <= row < thread.first + thread.rows_of_slips:
                    return f"winch of {thread.title}"
            row -= self.rows - self.net.internal
            return f"arms of line {self.net.line[row // (self.net.rows_of_elements // len(self.net.cells))]}"
        return f"node {row}" if row < self.net.nodes else f'body "{row_names(self.net.bodies)[row - self.net.nodes]}"'

    def energy_of(self, term: ForceTerm, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Energy of each cell of one term [J]."""
        out = np.zeros(len(term.cells))
        if term.energy is None:
            return out
        term.energy(t, x, term.cells, self.data_of(term, t), out)
        return out

    def energy(self, t: float, x: NDArray[np.float64]) -> float:
        """Total potential energy Π of lines and loads [J]."""
        return sum(self.energy_of(f, t, x).sum() for f in self.terms)

    def stiffness(
        self,
        t: float,
        x: NDArray[np.float64],
        v: NDArray[np.float64] | None = None,
        definite: bool = False,
        only: Sequence[ForceTerm] | None = None,
        blocks: list[NDArray[np.float64]] | None = None,
    ) -> NDArray[np.float64]:
        """Values of K = −∂f/∂x [N/m] in the fixed pattern.

        ``definite`` asks for the positive semidefinite part; ``only`` are the terms to include, by default all;
        ``blocks`` are `blocks` to write to, which a loop may use again.
        """
        v, blocks = self._zero if v is None else v, self.blocks() if blocks is None else blocks
        for term, block in zip(self._in_tangent, blocks, strict=True):
            if term.tangent.stiffness is None or not (only is None or term in only):
                block[:] = 0.0
            else:
                term.tangent.stiffness(t, x, v, block, term.cells, self.data_of(term, t), definite)
        if self.carriers:
            self.carriers.convert(x, blocks)
        values = self.pattern.assemble(blocks)
        if self.carriers:
            self.carriers.add_stiffness(values, self, t, x, v, blocks, definite, only)
        return values

    @property
    def symmetric(self) -> bool:
        """True if K and C are symmetric."""
        felt = any(body.pivot is not None or body.carried for body in self.net.bodies if not body.prescribed)
        return all(map(self.is_symmetric, self.terms)) and (self.angles or not felt)

    def is_symmetric(self, term: ForceTerm) -> bool:
        """Tell if the part of a term in K is symmetric; with rotation vectors it is for each term with a potential."""
        return term.tangent.symmetric or (self.angles and term.energy is not None)

    @cached_property
    def turning(self) -> bool:
        """True if there are bodies whose orientation counts."""
        return any(body.turn is not None for body in self.net.bodies)

    @property
    def conservative(self) -> bool:
        """True if every force has a potential."""
        return self.symmetric and all(f.energy is not None for f in self.terms)

    @property
    def dead(self) -> bool:
        """True if the only internal forces are the tensions of the lines, and all others are dead loads.

        With free bodies it is False, since forces on carried nodes turn with them.
        """
        return self._is_dead([f for f in self.terms if f.balance.internal])

    def _is_dead(self, inner):
        """Tell if all forces but those of the terms ``inner`` are dead loads, and these are the tensions of lines."""
        outer = [f for f in self.terms if not f.balance.internal]
        dead = all(f.tangent.stiffness is None and f.energy is not None for f in outer)
        return not self.resting and dead and inner == [self.lines]

    @property
    def convex(self) -> bool:
        """True if the potential of lines alone is convex and the loads are dead."""
        return self._pulls and self.dead

    @property
    def _pulls(self):
        """True if the potential of the lines is convex."""
        net = self.net
        negative = net.forming & (net.line_data.ea <= 0.0)
        return bool((net.law_is("convex") & ~negative).all())

    @property
    def bounded(self) -> bool:
        """True if `refweb.statics.duality_bound` bounds errors: the potential is convex and the loads are dead.

        Beside lines there may be threads of the law of tension alone that run over no bodies.
        """
        if not self.net.threads:
            return self.convex
        plain = all(not thread.wraps and thread.line.law_is("cone").all() for thread in self.net.threads)
        inner = [term for term in self.terms if term.balance.internal and not term.elements.observed]
        return plain and self._pulls and self._is_dead(inner)

    @property
    def contact(self) -> bool:
        """True if the web may touch bodies."""
        return any(term.contact.with_lines for term in self.terms)

    @cached_property
    def contact_forces(self) -> ContactForces:
        """The `refweb.system.contact_forces.ContactForces` on its bodies."""
        from .contact_forces import ContactForces

        return ContactForces(self)

    @property
    def rotating(self) -> list[ForceTerm]:
        """Terms of inertia forces in a rotating frame, a list."""
        return [term for term in self.terms if term.frame.angular_velocity is not None]

    @property
    def orbit_radius(self) -> float | None:
        """Radius of the orbit of the web [m]; None without an orbit."""
        return next((f.frame.orbit_radius for f in self.terms if f.frame.orbit_radius is not None), None)

    def damping(
        self, t: float, x: NDArray[np.float64], v: NDArray[np.float64], blocks: list[NDArray[np.float64]] | None = None
    ) -> NDArray[np.float64] | None:
        """Values of C = −∂f/∂v [N s/m] in the fixed pattern; None if no force depends on v. ``blocks``: `stiffness`."""
        if not any(f.velocity.damping is not None for f in self.terms):
            return None
        blocks = self.blocks() if blocks is None else blocks
        for term, block in zip(self._in_tangent, blocks, strict=True):
            block[:] = 0.0
            if term.velocity.damping is not None:
                term.velocity.damping(t, x, v, block, term.cells, self.data_of(term, t), False)
        values = self.pattern.assemble(blocks)
        if self.carriers:
            self.carriers.add_damping(values, self, x, v, blocks)
        return values

    def across_lines(self, tension: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of the stiffness of lines from a tension in each element alone [N], shape (elements,), as built.

        Threads get that of the mean tension. Free bodies and what contact alone holds get the stiffness of the mean
        line as well, so that the matrix is definite.
        """
        force = tension / self.net.natural_length
        blocks = self.net.unit_tension * force[:, None, None]
        values = self.assemble_lines(blocks)
        for number, term in enumerate(self._in_tangent):
            if term.tangent.across is not None:
                values += self.pattern.assemble_one(number, tension.mean() * term.tangent.across)
        if self.resting:
            rows = [row for body in self.resting for row in (body.row, body.spin) if row is not None]
            unknowns = np.flatnonzero(np.isin(self.free // 3, rows))
            spring = force.mean() * np.repeat(self.levers**2, 3)[self.free[unknowns]]
            values[self.pattern.diagonal[unknowns]] += spring
        if self.contact:
            from .unsupported_parts import find_parts

            parts = find_parts(self, touching=False)
            unknowns = np.concatenate([np.zeros(0, dtype=int), *(part.unknowns for part in parts)])
            unknowns = unknowns[self.free[unknowns] < 3 * self.net.nodes]
            values[self.pattern.diagonal[unknowns]] += force.mean()
        if self.carriers:
            self.carriers.add_across(values, self, self._lines_in_tangent, blocks)
        return values

    def assemble_lines(self, blocks: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values in the fixed pattern from one block (3 nodes, 3 nodes) per line element, shape (cells, ., .)."""
        return self.pattern.assemble_one(self._lines_in_tangent, blocks)
