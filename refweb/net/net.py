"""Nets: the rows of the unknowns, their mass, and the elements of lines, on which effects act.

`refweb.net.discretisation` makes a net from a web. A net is never changed: effects return copies with more rows, mass
and numbers of elements.

May change: how properties are computed. Must stay: names of fields and properties, which effects (of users too),
solvers and observables read; a default for a new field, so that `discretisation` may omit it; that a net is never
changed in place. Bodies' and internal rows stand behind the nodes. Must stay as well: `Net`, which
`dynamics.half_turns`, `effects.around` and other files import. Tests: ``tests/net/test_elements.py``,
``tests/test_contract.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..messages import nearest, quote
from .laws.law import record_of, together

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from .laws.line_data import LineData
    from .rigid_body import RigidBody
    from .web import Web


@dataclass(frozen=True, eq=False)
class Net:
    """Net that effects act on: the rows of the unknowns, their mass, and the lines between them.

    Attributes
    ----------
    web : refweb.net.web.Web
        Nodes and lines as the user numbered them.
    laws : tuple of type
        Tension laws of the lines, classes of `refweb.net.laws.law.TensionLaw`. Where there are several, the number of
        that of each element stands in ``line_data.law``.
    points : ndarray, shape (rows, 3)
        Reference positions [m]: nodes of the web, nodes of order and subdivision, line by line and along each line,
        then bodies.
    mass : ndarray, shape (rows,)
        Lumped mass [kg].
    element_mass : ndarray, shape (cells,)
        Mass of each element, of its natural length as built [kg].
    cells : ndarray of int32, shape (cells, nodes per cell)
        Rows that each element couples, in the order of dN/dξ: ends first. Elements of a line follow each other.
    line : ndarray of int32, shape (cells,)
        The web's line that each element belongs to.
    line_data : refweb.net.laws.line_data.LineData
        Numbers of each element.
    factors : tuple
        Factors of reels and temperature on natural lengths, which are multiplied: pairs of elements and table of (t,
        factor).
    flows : tuple of refweb.effects.mass_flow.MassFlow
        Masses that follow factors of reels; ``mass`` is that of factors of 1.
    end : float
        Latest end of a run [s], or its last load step.
    area, strength : ndarray, shape (cells,)
        Cross section [m²] and strength [Pa].
    allowed_share : ndarray, shape (cells,), optional
        Knot factor over safety factor, the allowed share of the strength; None if it is 1 everywhere.
    point_mass : ndarray, shape (nodes,), optional
        Point masses in ``mass`` [kg]; None if there are none.
    threads : tuple of refweb.net.threads.ThreadLine
        Threads through nodes.
    wound : tuple of (ndarray of int, refweb.effects.winch.Winch)
        Elements of lines on winches, and their winch.
    kept : tuple of refweb.net.laws.curve.Curve
        Curves whose addresses stand in ``line_data``: they live as long as the net.
    gradients : ndarray, shape (points, nodes per cell)
        dN/dξ on the reference element [0, 1].
    weights : ndarray, shape (points,)
        Quadrature weights, of sum 1.
    nodes : int
        Number of rows that are nodes, not bodies.
    places : ndarray, shape (nodes per cell,)
        ξ of each node of a cell.
    subdivide : int
        Elements per line.
    quasi_static : bool
        True in statics, in which time is the load step.
    cable_mass : float
        Mass of the lines [kg].
    consistent_minus_lumped : ndarray, shape (cells, nodes per cell, nodes per cell), optional
        Consistent minus lumped mass of each element [kg], with rows of sum 0; None for lumped mass.
    bodies : tuple of refweb.net.rigid_body.RigidBody
        Bodies, whose rows follow those of the nodes.
    spins : int
        Number of rows at the end for rotations of bodies, with a moment of inertia [kg m²] in place of mass, and for
        internal variables of lines behind them. A body whose orientation has no effect has one row, with rotation
        vector [rad] and angular velocity [rad/s]; another body has two rows, see `refweb.net.rotation`.
    internal : int
        Number of rows at the end that are internal variables of lines, which have no mass.
    length_force : callable, optional
        Makes the kernel of ∂E/∂L of the net, where lines have internal variables.
    """

    web: Web
    laws: tuple[Any, ...]
    points: NDArray[np.float64]
    mass: NDArray[np.float64]
    element_mass: NDArray[np.float64]
    cells: NDArray[np.int32]
    line: NDArray[np.int64]
    line_data: LineData
    area: NDArray[np.float64]
    strength: NDArray[np.float64]
    gradients: NDArray[np.float64]
    weights: NDArray[np.float64]
    nodes: int
    places: NDArray[np.int64]
    subdivide: int = 1
    quasi_static: bool = False
    cable_mass: float = 0.0
    consistent_minus_lumped: NDArray[np.float64] | None = None
    bodies: tuple[RigidBody, ...] = ()
    spins: int = 0
    internal: int = 0
    length_force: Any = None
    factors: tuple[Any, ...] = ()
    flows: tuple[Any, ...] = ()
    end: float = math.inf
    allowed_share: NDArray[np.float64] | None = None
    point_mass: NDArray[np.float64] | None = None
    threads: tuple[Any, ...] = ()
    wound: tuple[Any, ...] = ()
    kept: tuple[Any, ...] = ()

    @property
    def allowed(self) -> NDArray[np.float64]:
        """Allowed stress of each element [Pa], infinite without strength, shape (cells,)."""
        return self.strength if self.allowed_share is None else self.strength * self.allowed_share

    @property
    def law(self) -> Any:
        """The law of all lines for compiled kernels: the one law, or a `refweb.net.laws.law.Mixed`."""
        return together(self.laws, self.line_data.dtype)

    @property
    def law_record(self) -> np.dtype[Any]:
        """Dtype by which kernels of the law read the numbers of an element."""
        return record_of(self.law.columns, self.line_data.dtype)

    @cached_property
    def law_index(self) -> NDArray[np.int64]:
        """Number of the law of each element in ``laws``, shape (cells,)."""
        several = len(self.laws) > 1
        return self.line_data.law.astype(np.int64) if several else np.zeros(len(self.cells), dtype=np.int64)

    def law_is(self, attribute: str) -> NDArray[np.bool_]:
        """True for each element whose law has an attribute of `refweb.net.laws.law.TensionLaw`, shape (cells,)."""
        return np.array([getattr(law, attribute) for law in self.laws])[self.law_index]

    @cached_property
    def forming(self) -> NDArray[np.bool_]:
        """True for each element with a law of form finding, shape (cells,)."""
        return self.law_is("forming")

    @property
    def curve_scale(self) -> NDArray[np.float64] | None:
        """Inverse of the last strain of the curve of each element [1], 0 without a curve; None where there is none."""
        if "last_strain" not in (self.line_data.dtype.names or ()):
            return None
        last = self.line_data.last_strain
        return np.where(last > 0.0, 1.0 / np.where(last > 0.0, last, 1.0), 0.0)

    @property
    def axial(self) -> NDArray[np.float64]:
        """Magnitude of EA of each element [N], or of its substitute in laws of form finding, shape (cells,)."""
        return np.abs(self.line_data.ea)

    @property
    def heavy(self) -> NDArray[np.int64]:
        """Rows with a mass, without rows of rotation."""
        return np.flatnonzero(self.mass[: len(self.mass) - self.spins])

    @property
    def internal_names(self) -> list[str]:
        """Names of the rows of internal variables, by element and number, a list."""
        width = self.rows_of_elements // max(len(self.cells), 1)
        names = [f".{width}.{number}" for number in range(self.rows_of_elements)]
        return names + [f".slips.{thread.name}.{n}" for thread in self.threads for n in range(thread.rows_of_slips)]

    @property
    def rows_of_elements(self) -> int:
        """Number of rows of internal variables of elements, which stand before those of threads."""
        return self.internal - sum(thread.rows_of_slips for thread in self.threads if thread.first >= 0)

    @property
    def winches(self) -> list[tuple[float, ...]]:
        """Numbers of each winch, see `refweb.effects.winch`, a list."""
        of_lines = [winch.numbers(self.quasi_static) for _, winch in self.wound]
        return [thread.winch for thread in self.threads if thread.winch] + of_lines

    @property
    def carried(self) -> list[int]:
        """Rows carried by bodies that are not fixed, a list: attached nodes, and bodies that are off their axles."""
        off_axle = [body.row for body in self.bodies if body.pivot is not None]
        return off_axle + [node for body in self.bodies if not body.fixed for node in body.carried]

    def body_of(self, name: str, key: str = "body") -> RigidBody:
        """The body of a name, which a key of a table gives; refuses one that none has."""
        names = [body.name for body in self.bodies]
        if name not in names:
            hint = nearest(name, names) if names else "the scene has no [[body]]"
            raise InputError(f"{key} = {quote(name)} is not a [[body]], {hint}")
        return self.bodies[names.index(name)]

    def thread_of(self, name: str) -> Any:
        """The `refweb.net.threads.ThreadLine` of a name that one has."""
        return next(thread for thread in self.threads if thread.name == name)

    def with_turning(self, turning: RigidBody) -> Net:
        """The net in which the rotation of a body is followed."""
        return replace(self, bodies=tuple(replace(b, turns=b.turns or b is turning) for b in self.bodies))

    @property
    def order(self) -> int:
        """Order of the elements."""
        return self.cells.shape[1] - 1

    def with_column(self, name: str, values: float | NDArray[np.float64]) -> Net:
        """The net with one more field in ``line_data``; ``values`` are one number or one for each element."""
        return replace(self, line_data=self.line_data.with_column(name, values))

    @property
    def broken(self) -> NDArray[np.int64]:
        """Broken elements, which have no stiffness, shape (k,)."""
        return np.flatnonzero(self.line_data.ea == 0.0)

    def middle_of(self, lines: Sequence[int] | NDArray[np.int64]) -> NDArray[np.int64]:
        """Element at the middle of each of some lines, or next to it, shape (lines,)."""
        return np.asarray(lines, dtype=np.int64) * self.subdivide + self.subdivide // 2

    @property
    def natural_length(self) -> NDArray[np.float64]:
        """Natural length of each element [m], shape (cells,)."""
        return self.line_data.natural_length

    @property
    def slackness(self) -> NDArray[np.float64]:
        """Strain up to which an element is slack, shape (cells,): ε0, or 0 for laws without it."""
        return self.line_data.slackness

    @cached_property
    def bars(self) -> csr_array:
        """Matrix whose product with positions x gives the vectors of bars, one bar for each quadrature point.

        A bar has the natural length w L and the stiffness EA/(w L). The matrix is a `scipy.sparse.csr_array` of shape
        (cells × points, rows) with entries w dN/dξ; the bars of a cell follow each other. Tensions of bars as vectors
        S, shape (bars, 3), give the forces ``-bars.T @ S`` on the rows.
        """
        from scipy.sparse import csr_array

        points, nodes = self.gradients.shape
        entries = np.tile((self.weights[:, None] * self.gradients).ravel(), len(self.cells))
        columns = np.repeat(self.cells[:, None], points, axis=1)
        starts = nodes * np.arange(points * len(self.cells) + 1)
        return csr_array((entries, columns.ravel(), starts), shape=(points * len(self.cells), len(self.points)))

    @property
    def bar_lengths(self) -> NDArray[np.float64]:
        """Natural length of each bar [m], shape (bars,)."""
        return (self.natural_length[:, None] * self.weights).ravel()

    def per_bar(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of elements for each bar, shape (bars,)."""
        return np.repeat(values, len(self.weights))

    def bar_vectors(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vector of each bar [m] at the displacement x, shape (bars, 3)."""
        return self.bars @ self.points + self.bars @ x

    @cached_property
    def quadrature(self) -> tuple[tuple[tuple[float, ...], ...], tuple[float, ...]]:
        """dN/dξ by quadrature point and node, and weights, as tuples: keys of factories of kernels."""
        return tuple(map(tuple, self.gradients.tolist())), tuple(self.weights.tolist())

    @property
    def unit_tension(self) -> NDArray[np.float64]:
        """Geometric stiffness of an element of unit length under unit tension, shape (3 nodes, 3 nodes)."""
        unit = np.einsum("q,qa,qb->ab", self.weights, self.gradients, self.gradients)
        return np.kron(unit, np.eye(3))

    @property
    def along(self) -> NDArray[np.int64]:
        """Order of the nodes of a cell from its first to its second end: ``cells[:, along]`` follows the line."""
        return np.argsort(self.places)

    def line_between(self, nodes: Sequence[int]) -> int:
        """Number of the line of an element between two nodes."""
        return int(self.line[np.isin(self.cells, nodes).all(axis=1).argmax()])

    def find(self, selection: Any, name: str = "node") -> NDArray[np.int64]:
        """Rows of a selection of nodes, see `Web.find`; "all" includes nodes of order and subdivision."""
        every = selection == "all" or (isinstance(selection, (list, tuple)) and "all" in selection)
        numbers = self.web.find(selection, name)
        return np.arange(self.nodes) if every else numbers
