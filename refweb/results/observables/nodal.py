"""Displacement, position and velocity: of several nodes or bodies one counts, see ``select`` of `refweb.Observe`.

May change: how values are found, in `of` and in the probe together. Must stay: ``numbers`` in the form that the
compiled `probes.largest_of` and `probes.selected_row` read; `Nodal`, on which `reaction` and `angular_momentum` build;
class docstrings (help; after a change write ``validation/REFERENCE.md`` anew) and names in `registry.OBSERVABLES`;
`Place`, which `sizing.case` and `statics.responses` import. Tests: ``tests/results/test_observable_contract.py``,
``tests/results/test_selections.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .observable import SELECTIONS, Observable, Value

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...statics.equilibrium import Equilibrium
    from ...system.system import System
    from ..probes import Probe
    from ..state import State
    from .observe import Observe


class Nodal(Observable):
    """A vector of each row of the unknowns, of which a component or the magnitude counts.

    Subclasses have `vectors` and a probe.
    """

    keys: tuple[str, ...] = ("node", "body", "component", "select")

    def __init__(self, observe: Observe) -> None:
        super().__init__(observe)
        self.at = "node" if observe.body is None else "body"

    def vectors(self, state: State) -> NDArray[np.float64]:
        """Vector of each row in a state, shape (rows, 3)."""
        raise NotImplementedError

    def on(self, system: System) -> None:
        """Refuse nodes and bodies that the net does not have."""
        self.rows(system)

    def rows(self, system: System) -> NDArray[np.int64]:
        """Rows of the nodes or bodies of the observable, shape (k,)."""
        net = system.net
        if self.observe.body is not None:
            return np.array([body.row for body in self.bodies(net)])
        return np.arange(net.nodes) if self.observe.node is None else net.find(self.observe.node)

    def sizes(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """The requested component of vectors, or their magnitude, shape (k,)."""
        component = self.observe.component
        return np.linalg.norm(vectors, axis=1) if component is None else vectors[:, component]

    def of(self, state: State) -> Value:
        """The value that counts of its rows."""
        rows = self.rows(state.system)
        value, at = self.selected(self.sizes(self.vectors(state)[rows]))
        return Value(value, self.position(state.system, int(rows[at])))

    def position(self, system: System, at: int) -> int | None:
        """The node, or of several bodies the number of the one; nowhere of one body, which is named."""
        if self.observe.body is None:
            return at
        rows = [body.row for body in system.net.bodies]
        return None if isinstance(self.observe.body, str) else rows.index(at)

    def probe_of(
        self, kernel: Any, source: int, rows: Sequence[int] | NDArray[np.int64], data: NDArray[np.float64]
    ) -> Probe:
        """The probe of rows by a kernel of the largest, or by that of another choice, of a ``source`` of vectors."""
        from ..probes import Probe, selected_row

        if not self.selects:
            return Probe(kernel, self.numbers(rows), data)
        return Probe(selected_row, [source, SELECTIONS[self.observe.select], self.component, *rows], data)

    def numbers(self, rows: Sequence[int] | NDArray[np.int64]) -> list[int]:
        """Component and rows in the form of `refweb.results.probes.largest_of`."""
        consecutive = len(rows) == 1 or (np.diff(rows) == 1).all()
        return [self.component, rows[0], rows[-1] + 1] if consecutive else [self.component, -1, -1, *rows]


class Place(Nodal):
    """A vector of each row that follows from its position; it is open if the row floats."""

    def floats(self, state: State, equilibrium: Equilibrium) -> bool:
        """Tell if the row whose value counts may move at no cost, or another one pass it."""
        floating = equilibrium.floating
        if floating is None:
            return bool(np.isin(self.rows(state.system), state.slack_nodes).any())
        rows, component = self.rows(state.system), self.observe.component
        axes = slice(None) if component is None else [component]
        open_ = np.any(floating.free[rows][:, axes], axis=1)
        if not open_.any():
            return False
        scores = self.scores(self.sizes(self.vectors(state)[rows]))
        if open_[np.argmax(scores)] or floating.parts is None:
            return True
        smallest, largest = floating.parts.reach[:, rows] + (self.vectors(state) - state.position)[rows]
        if component is not None:
            ends = smallest[:, component], largest[:, component]
        else:  # the nearest and the farthest corner of what is in reach
            nearest = np.maximum(np.maximum(smallest, -largest), 0.0)
            ends = (np.linalg.norm(side, axis=1) for side in (nearest, np.maximum(-smallest, largest)))
        best = np.maximum(*(self.scores(end) for end in ends))
        return bool((best[open_] > scores.max()).any())

    def interval(self, state: State, equilibrium: Equilibrium) -> tuple[float, float] | None:
        """Range of one row along one axis, see `refweb.statics.floating.Parts.limits`."""
        rows, axis, floating = self.rows(state.system), self.observe.component, equilibrium.floating
        if floating is None or floating.parts is None or axis is None or len(rows) > 1 or not floating.free[rows, axis]:
            return None
        limits = floating.parts.limits(rows[0], axis)
        if limits is None:
            return None
        shift = float((self.vectors(state) - state.position)[rows[0], axis])
        value = float(self.vectors(state)[rows[0], axis])
        ends = sorted(float(limit) + shift for limit in limits)
        # rounding may leave the value beside limits that are next to equal
        return min(ends[0], value), max(ends[1], value)


class Displacement(Place):
    """Displacement from the reference position."""

    unit = "m"

    def vectors(self, state: State) -> NDArray[np.float64]:
        """Displacement [m], shape (rows, 3)."""
        return state.x

    def probe(self, system: System) -> Probe:
        """Make the probe of x alone."""
        from ..probes import DISPLACEMENT, displacement

        rows = self.rows(system)
        return self.probe_of(displacement, DISPLACEMENT, rows, np.zeros((len(rows), 3)))


class Position(Place):
    """Position in space."""

    unit = "m"

    def vectors(self, state: State) -> NDArray[np.float64]:
        """Positions [m], shape (rows, 3)."""
        return state.position

    def probe(self, system: System) -> Probe:
        """Make the probe of x and the reference position."""
        from ..probes import DISPLACEMENT, displacement

        rows = self.rows(system)
        return self.probe_of(displacement, DISPLACEMENT, rows, system.net.points[rows])


class Velocity(Nodal):
    """Velocity."""

    unit = "m/s"
    dynamic = True

    def vectors(self, state: State) -> NDArray[np.float64]:
        """Velocities [m/s], shape (rows, 3)."""
        return state.v

    def probe(self, system: System) -> Probe:
        """Make the probe of v alone."""
        from ..probes import VELOCITY, velocity

        rows = self.rows(system)
        return self.probe_of(velocity, VELOCITY, rows, np.zeros((len(rows), 3)))
