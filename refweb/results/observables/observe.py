"""``[[observe]]``: a quantity with a name, and its reduction over time.

May change: private functions and texts of errors. Must stay: keys, defaults and docstring of `Observe` (scene format
and help; after a change write ``validation/REFERENCE.md`` anew); `SIGN` and `PARTS`, which follow from keys; `default`,
the observables of a scene without any; `observes_of` and `bounds_by_name`, which read ``scene.toml`` for pictures,
studies and `sizing.problem`; public names of `Observe`, which other files use. Tests: ``tests/test_scene.py``,
``tests/results/test_selections.py``.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

from ...accepted import accepts, any_of, array
from ...errors import InputError
from ...messages import nearest, quote
from ...registry import OBSERVABLES, known, load, possible
from ...tables import Several, Table, choice, component, field, integer, nodes, real, table, text

if TYPE_CHECKING:
    from ...statics.equilibrium import Equilibrium
    from ...system.system import System
    from ..probes import Probe
    from ..solution import Result
    from ..state import State
    from .observable import Value

SIGN = {"max": 1.0, "min": -1.0, "final": 0.0}
"""Sign of the peaks that a probe follows, by ``reduce``."""
PARTS = ("part", "select")
"""Keys that choose among several values."""


@accepts(lambda: {"type": "string", "enum": list(OBSERVABLES)})
def _quantity(name, value):
    if not isinstance(value, str) or not known(OBSERVABLES, value):
        hint = nearest(value, possible(OBSERVABLES))
        raise InputError(f"{name} = {quote(value)} must be one of the quantities, {hint}")
    return value


_name = text().metadata["read"]


@accepts(any_of(_name.accepts, array(_name.accepts, 1)))
def _bodies(name, value):
    if not isinstance(value, (list, tuple)):
        return _name(name, value)
    if not value:
        raise InputError(f"{name} = [] must be at least one body")
    return tuple(_name(f"{name}[{i}]", body) for i, body in enumerate(value))


@table
class Observe(Table):
    """A named number, followed over time.

    Parameters
    ----------
    name : str
        Name in results and history.
    quantity : str
        Quantity, one of `refweb.registry.OBSERVABLES`.
    node : int, str or list, optional
        Node of a nodal quantity, or several, see ``select``; without ``node`` all.
    body : str or list of str, optional
        Body of a nodal quantity, or several. Its reaction is the force of contact on it, of lines, other bodies and
        threads that run over it together: 0 where nothing touches it, whatever drag, gravity, a frame or what it holds
        by ``[[attach]]`` do to it. The force with which it holds these is the reaction of their nodes.
    to : str, optional
        Body at the end of a distance from one node or another body. Without it, the distance is that of two nodes.
    line : int, str or list, optional
        Lines of a line quantity, by number or group, see `refweb.net.groups`; without ``line`` all.
    thread : str, optional
        Thread of a length, which is that of the whole thread, or of a tension, stress or strain, which with friction
        at its rings is that of the segment with the largest tension.
    segment : int, optional
        Segment of a thread whose tension it is: 0 is that between the first two of its nodes.
    ring : int, optional
        Ring of a ``slip``, the length of thread that has gone over it since the start: its number in the list ``nodes``
        of the thread, from 0 on. It is positive where material goes in the order of the list.
    control : str, optional
        Control whose fuel or Δv it is: a ``[[control]]`` that sets a force.
    part : {"start", "middle", "end"}, optional
        Element of each line that a line quantity is looked at in: that at its first node, that at its middle or behind
        it, or that at its last node; without it all elements. A value of an element of order 1 is that of its middle;
        of a higher order it is the largest of its quadrature points. The load of a support, with the mass that is
        lumped there, is its reaction.
    select : {"max", "min", "abs"}, optional
        Value that counts of several nodes, bodies or lines: the largest, which is the default, the smallest, or the
        largest absolute value, without its sign. The reaction of several is their sum, and with ``select`` that of the
        one that counts.
    component : {0, 1, 2, "x", "y", "z", "w"}, optional
        Axis of a nodal quantity, or of a quantity of rotation; without it the magnitude. For an orientation it is the
        component of the quaternion that rotates the axes x, y and z to those of the body; "w" or 3 is the scalar part.
        Without a component an orientation is the angle from the pose of the body in the web.
    reduce : {"max", "min", "final"}
        Reduction over time. In statics it is not used, since each load step has its results.
    average : float, optional
        Length of a window [s], in dynamics: its mean is taken in place of the value. In a web of many waves the mean
        has digits where an instant has none. The window slides along the run and ends at the instant: each row of the
        history holds the mean until its time, and ``reduce`` takes the largest, smallest or final mean, which belongs
        to no node or line. Before the first window is full the mean is over the time that has passed, at t = 0 the
        value itself; "max" and "min" look at full windows only. With several nodes or lines it is the mean of the
        value that counts, such as the largest, not the largest of the means. Energies, work and step size have no
        window: they are summed over steps.

    Raises
    ------
    InputError
        For an unknown quantity, a node, body, line or axis that the quantity does not have, a node beside a body, a
        name with commas or quotes or above 80 characters, a window that is not above 0, and one of a booked quantity;
        from ``on``, for what the net does not have, an energy whose effect is not in the scene, and in statics what
        needs velocity, work that depends on the path, and a window.

    Examples
    --------
        [[observe]]
        name = "deflection"
        quantity = "displacement"
        node = "centre"
        component = "z"
        reduce = "max"
    """

    name: str = text(limit=80)
    quantity: str = field(_quantity)
    node: Several = nodes(default=None)
    body: Several = field(_bodies, default=None)
    to: str | None = text(default=None)
    line: Several = nodes(default=None, what="line")
    thread: str | None = text(default=None, limit=80)
    segment: int | None = integer(default=None, at_least=0)
    ring: int | None = integer(default=None, at_least=0)
    control: str | None = text(default=None, limit=80)
    part: str | None = choice("start", "middle", "end", default=None)
    select: str | None = choice("max", "min", "abs", default=None)
    component: int | None = component(default=None, axes="xyzw")
    reduce: str = choice("max", "min", "final", default="final")
    average: float | None = real(default=None, above=0.0, unit="s")

    def check(self) -> None:
        """Refuse a node, line, component or choice that the quantity does not have."""
        if "," in self.name or '"' in self.name:
            raise InputError(
                f"name = {quote(self.name)} must have no commas and no quotes: it heads a column of history.csv"
            )
        for key in ("node", "body", "to", "component", "line", "thread", "segment", "ring", "control", *PARTS):
            if getattr(self, key) is not None and key not in self.observable.keys:
                value = quote(getattr(self, key))
                beside = " of a thread" if self.thread is not None and key != "thread" else ""
                raise InputError(f'{key} = {value} has no meaning for quantity = "{self.quantity}"{beside}')
        if self.component == 3 and self.quantity != "orientation":
            raise InputError(f'component = "w" has no meaning for quantity = "{self.quantity}"')
        if self.node is not None and self.body is not None:
            raise InputError(f"node = {quote(self.node)} and body = {quote(self.body)} exclude each other")
        if self.average is not None and self.observable.booked:
            raise InputError(
                f'average = {self.average:g} has no meaning for quantity = "{self.quantity}", which is summed over '
                "steps: leave it out"
            )

    @property
    def observable(self) -> Any:
        """The `refweb.results.observables.observable.Observable` of the quantity."""
        if self.thread is not None and self.quantity in ("tension", "stress", "strain"):
            return load(f"refweb.results.observables.thread:{self.quantity.capitalize()}")(self)
        return load(OBSERVABLES[self.quantity])(self)

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return self.observable.unit

    def on(self, system: System) -> None:
        """Refuse nodes, lines, bodies and effects that the system does not have."""
        if system.net.quasi_static and self.observable.dynamic:
            raise InputError(f'quantity = "{self.quantity}" has no meaning in statics')
        if system.net.quasi_static and self.average is not None:
            raise InputError(f"average = {self.average:g} has no meaning in statics: leave it out")
        self.observable.on(system)

    def value(self, state: State) -> Value:
        """The observable at one instant, a `refweb.results.observables.observable.Value`."""
        return self.observable.of(state)

    def error(self, state: State, equilibrium: Equilibrium) -> float | None:
        """± of the value in a `refweb.statics.equilibrium.Equilibrium`, None if it is not known.

        It is a proven bound from duality if there is one for the quantity, else an estimate from the deviations of the
        equilibrium.
        """
        return self.observable.error(state, equilibrium)

    def interval(self, state: State, equilibrium: Equilibrium) -> tuple[float, float] | None:
        """Least and largest value in all equilibria, if the value is open and they are known."""
        return self.observable.interval(state, equilibrium)

    def bounded(self, result: Result, system: System) -> Result:
        """A `refweb.results.solution.Result` whose ± is cut to possible values."""
        return result.bounded(*self.observable.bounds(system))

    def probe(self, system: System) -> Probe:
        """The `refweb.results.probes.Probe` of the observable, with the sign of its peaks and its window."""
        return self.observable.probe(system)._replace(sign=SIGN[self.reduce], average=self.average or 0.0)


@functools.cache
def _of_nets():
    """Default observables of a net."""
    names = {"deflection": "displacement", "max_stress": "stress", "max_tension": "tension"}
    return tuple(Observe(name=name, quantity=quantity, reduce="max") for name, quantity in names.items())


def default(threads=()):
    """Observables of a scene without ``[[observe]]``, with the tension of each thread by its name."""
    observes = [*_of_nets()]
    for number, name in enumerate(threads):
        can_be_in_name = len(name) <= 70 and "," not in name and '"' not in name
        name_of = f"tension_{name if can_be_in_name else number}"
        observes.append(Observe(name=name_of, quantity="tension", thread=name, reduce="max"))
    return tuple(observes)


def observes_of(tables):
    """Observables of the tables of a scene file, each an `Observe`."""
    names = [thread["name"] for thread in tables.get("thread") or ()]
    return [Observe.read("[[observe]]", entry) for entry in tables.get("observe") or ()] or list(default(names))


def bounds_by_name(tables):
    """Least and largest possible value of each result of a scene by name, and of each name that is a quantity.

    Parameters
    ----------
    tables : dict
        The tables of a scene file.

    Returns
    -------
    dict of str to (float, float)
        Bounds by name.

    Raises
    ------
    InputError
        For an invalid observable.
    """
    observes = {quantity: Observe(name=quantity, quantity=quantity) for quantity in OBSERVABLES}
    observes |= {observe.name: observe for observe in observes_of(tables)}
    return {name: observe.observable.bounds_by_tables(tables) for name, observe in observes.items()}
