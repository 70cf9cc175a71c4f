"""Observables: a value at an instant, and the probe that follows it through the steps of a run.

May change: how defaults are computed. Must stay: names of attributes and methods of `Observable` and fields of `Value`,
which observables of users give and statics, dynamics and plots call (a new one needs a default); `ANY` and
`NOT_NEGATIVE`, which are bounds; numbers of `SELECTIONS`, which kernels of `probes` read; `ROUNDING` and `SHARE` belong
to ±. Tests: ``tests/results/test_observable_contract.py``, ``tests/how_to/test_observable.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...messages import nearest

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...net.net import Net
    from ...net.rigid_body import RigidBody
    from ...statics.equilibrium import Equilibrium
    from ...system.system import System
    from ..probes import Probe
    from ..state import State
    from .observe import Observe

ANY, NOT_NEGATIVE = (-np.inf, np.inf), (0.0, np.inf)
"""Least and largest value that are possible."""
SELECTIONS: dict[str | None, int] = {"max": 0, "min": 1, "abs": 2}
"""Numbers of choices among several values in compiled probes, by ``select``."""
ROUNDING, SHARE = 4.0 * np.finfo(float).eps, 1e-7
"""Rounding of a strain by rounding of positions and lengths; relative change of lengths by which its effect is
found."""


class Value(NamedTuple):
    """Value of an observable at one instant; ``where`` is the number of its node or line."""

    value: float
    where: int | None


class Observable:
    """A quantity with the keys of one ``[[observe]]``.

    Parameters
    ----------
    observe : refweb.Observe
        The table, which selects nodes, lines or bodies.

    Attributes
    ----------
    unit : str
        Unit of its value.
    keys : tuple of str
        Which of ``node``, ``body``, ``to``, ``component``, ``line``, ``part`` and ``select`` have a meaning; one of the
        whole net has none.
    dynamic : bool
        True if the quantity has no meaning in statics.
    at : str
        Kind of the number ``where`` of its value, "node" or "line".
    booked : bool
        True if the value comes from the energy balance, see `refweb.results.observables.balances.Booked`, and not from
        a probe.
    """

    unit = "1"
    keys: tuple[str, ...] = ()
    dynamic = False
    at = "node"
    booked = False

    def __init__(self, observe: Observe) -> None:
        self.observe = observe

    def on(self, system: System) -> None:
        """Raise an `InputError` for keys that do not fit a `refweb.system.system.System`."""

    def of(self, state: State) -> Value:
        """`Value` of the observable in a `refweb.results.state.State`."""
        raise NotImplementedError

    def probe(self, system: System) -> Probe:
        """The `refweb.results.probes.Probe` of the same value for every step of a run."""
        raise NotImplementedError

    def body(self, net: Net) -> RigidBody:
        """Body of the observable: the one that is named, or the only one of the scene; refused where there is none."""
        names = [body.name for body in net.bodies]
        if self.observe.body is None and len(names) == 1:
            return net.bodies[0]
        named = self.bodies(net)
        if len(named) != 1:
            quantity, missing = self.observe.quantity, "is missing" if not named else f"names {len(named)} bodies"
            raise InputError(f'body {missing}: quantity = "{quantity}" needs one body, {nearest("", names)}')
        return named[0]

    def bodies(self, net: Net) -> list[RigidBody]:
        """Bodies that are named, a list; `InputError` for a name that no body has."""
        named, bodies = self.observe.body, {body.name: body for body in net.bodies}
        named = (named,) if isinstance(named, str) else named or ()
        for name in named:
            if name not in bodies:
                hint = nearest(name, bodies) if bodies else "the scene has no [[body]]"
                raise InputError(f'body = "{name}" is not a body, {hint}')
        return [bodies[name] for name in dict.fromkeys(named)]

    def scores(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Numbers of which the largest is that of the value that counts, see ``select`` of `refweb.Observe`."""
        if self.observe.select == "abs":
            return np.abs(values)
        return -values if self.observe.select == "min" else values

    def selected(self, values: NDArray[np.float64]) -> tuple[float, int]:
        """The value that counts, and its number."""
        at = int(np.argmax(self.scores(values)))
        return float(abs(values[at]) if self.observe.select == "abs" else values[at]), at

    @property
    def selects(self) -> bool:
        """True where a value counts that is not the largest."""
        return self.observe.select not in (None, "max")

    @property
    def component(self) -> int:
        """Number of the component in kernels: that of the table, or `refweb.results.probes.MAGNITUDE`."""
        from ..probes import MAGNITUDE

        return MAGNITUDE if self.observe.component is None else self.observe.component

    def bounds(self, system: System | None) -> tuple[float, float]:
        """Least and largest value that are possible, whatever the state: a magnitude is not negative."""
        magnitude = "component" in self.keys and self.observe.component is None
        return NOT_NEGATIVE if magnitude or self.observe.select == "abs" else ANY

    def bounds_by_tables(self, tables: dict[str, Any]) -> tuple[float, float]:
        """Least and largest possible value by the tables of a scene file, a dict; any value if they do not tell."""
        return self.bounds(None)

    def position(self, system: System, at: int) -> int | None:
        """Node or line of the row or element ``at`` of the probe; None for quantities of the whole net."""
        return None

    def error(self, state: State, equilibrium: Equilibrium) -> float | None:
        """± of the value in a `refweb.statics.equilibrium.Equilibrium`, None if it is not known.

        This is an estimate from the deviations of the equilibrium: the change by the residual, three times the change
        by rounding of forces, and the rounding of the value itself. It is None for a value that changes as parts of the
        net float.
        """
        if equilibrium.deviations is None or self.floats(state, equilibrium):
            return None
        changes = [self._change(state, deviation) for deviation in equilibrium.deviations]
        rounding = 2.0 * np.finfo(float).eps * abs(self.of(state).value) + self.of_held_lines(state)
        return float(changes[0] + 3.0 * max(changes[1:]) + rounding)

    def proven(self, equilibrium: Equilibrium) -> bool:
        """Tell if ± in an equilibrium is a proven bound."""
        return False

    def _change(self, state, move):
        """Size of the change of the value under a move of the rows, to first order."""
        size = np.abs(move).max()
        if size == 0.0:
            return 0.0
        share = SHARE * state.system.natural_length(state.time).min() / size
        moved = type(state)(state.system, state.time, state.system.moved(state.x, share * move))
        return abs(self.of(moved).value - self.of(state).value) / share

    def of_held_lines(self, state: State) -> float:
        """Effect on the value of a rounding, by `ROUNDING`, of strains of lines on winches or with both ends fixed.

        No displacement of a node balances these strains.
        """
        system = state.system.at(state.time)
        net = system.net
        fixed = np.all(system.supported[: net.nodes], axis=1)[net.cells].all(axis=1)
        lines = net.line_data
        if net.wound:
            from ...effects.wound_lines import standing

            wound, lines = standing(net)
            fixed |= wound
        if not fixed.any():
            return 0.0
        changes, value = [], self.of(state).value
        for share in (SHARE, -SHARE):  # of a line that is neither slack nor taut, the side where it is taut
            numbers = lines.copy()
            numbers.natural_length[fixed] *= 1.0 + share
            moved = type(state)(system.with_line_data(numbers), state.time, state.x)
            changes.append(abs(self.of(moved).value - value))
        return max(changes) / SHARE * ROUNDING

    def floats(self, state: State, equilibrium: Equilibrium) -> bool:
        """Tell if moves without stiffness change the value, compared with other moves of their size."""
        if equilibrium.floating is None:
            return False
        some = np.random.default_rng(0).uniform(-1.0, 1.0, state.x.shape) * ~state.system.supported
        return max(self._change(state, move) for move in equilibrium.floating.moves) > 1e-4 * self._change(state, some)

    def interval(self, state: State, equilibrium: Equilibrium) -> tuple[float, float] | None:
        """Least and largest value in all equilibria if parts of the net float; None if that is not known."""
        return None
