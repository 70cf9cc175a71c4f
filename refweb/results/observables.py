"""Observables: the numbers a run is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..net.net import AXIAL_STIFFNESS
from ..tables import Table, choice, component, field, nearest, node_number, nodes, shown, text

NODAL = {
    "displacement": ("x", "m"),
    "position": ("position", "m"),
    "velocity": ("v", "m/s"),
    "reaction": ("reaction", "N"),
}
LINE = {"tension": ("tension", "N"), "stress": ("stress", "Pa"), "strain": ("strain", "1")}
TOTAL = {
    "kinetic_energy": "J",
    "strain_energy": "J",
    "potential_energy": "J",
    "contact_energy": "J",
    "bending_energy": "J",
    "frame_energy": "J",
    "dissipated_energy": "J",
    "total_energy": "J",
    "work": "J",
    "slack_fraction": "1",
    "step_size": "s",
}
QUANTITIES = (*NODAL, *LINE, *TOTAL)
_DYNAMIC = ("velocity", "kinetic_energy", "dissipated_energy", "step_size")
_NEEDS = {"potential_energy": "[gravity]", "contact_energy": "[contact]", "bending_energy": "[bending]"}
_NEEDS |= {"frame_energy": "[frame]", "dissipated_energy": "[damping], or damping or friction in [contact],"}
_NEEDS["work"] = "[[load]], [[motion]] or another effect that does work"


class Value(NamedTuple):
    """Value of an observable at one instant; ``where`` is the node or line it stands at."""

    value: float
    where: int | None


class Result(NamedTuple):
    """A result of a run: value, its error (None where none is known), unit, time and place.

    ``error`` is that of the solution of the scene as it stands. In statics ``smoothing`` is how far a smooth law's η
    moves the value from that at η → 0, and with ``refine = true`` ``discretisation`` how far it is from infinitely many
    elements; None where it was not looked for.
    """

    value: float
    error: float | None
    unit: str
    time: float
    where: int | None
    smoothing: float | None = None
    discretisation: float | None = None

    def plain(self):
        """As a dict, without the errors that were not looked for."""
        extra = {key: value for key in ("smoothing", "discretisation") if (value := getattr(self, key)) is not None}
        return {key: getattr(self, key) for key in ("value", "error", "unit", "time", "where")} | extra


def _quantity(name, value):
    if value not in QUANTITIES:
        raise InputError(f"{name} = {shown(value)} must be one of the quantities, {nearest(value, QUANTITIES)}")
    return value


@dataclass(frozen=True, kw_only=True)
class Observe(Table):
    """A named number, followed over time.

    Parameters
    ----------
    name : str
        Its name in results and history.
    quantity : str
        One of `QUANTITIES`.
    node : int, str or list, optional
        Node of a nodal quantity. Of several nodes the one with the largest value counts, for a reaction their sum;
        without ``node`` that is over all.
    body : str, optional
        Body of a nodal quantity; its reaction is the contact force on it.
    line : int, optional
        Line of a line quantity; without it the largest over all lines.
    component : {0, 1, 2, "x", "y", "z"}, optional
        Axis of a nodal quantity; without it the magnitude.
    reduce : {"max", "min", "final"}
        Reduction over time.

    Raises
    ------
    InputError
        For an unknown quantity, a node, body, line or axis that the quantity does not have, a node beside a body, and a
        name with commas or quotes or above 80 characters; from ``on``, for what the net does not have, an energy whose
        effect is not in the scene, and in statics what needs velocity, or work that depends on the path.
    """

    name: str = text(most=80)
    quantity: str = field(_quantity)
    node: object = nodes(None)
    body: str | None = text(None)
    line: int | None = field(node_number, None)
    component: int | None = component(None)
    reduce: str = choice("max", "min", "final", default="final")

    def check(self):
        """Refuse a node, line or component that the quantity does not have."""
        if "," in self.name or '"' in self.name:
            raise InputError(
                f"name = {shown(self.name)} must be free of commas and quotes: it heads a column of history.csv"
            )
        nodal, line = self.quantity in NODAL, self.quantity in LINE
        for key, allowed in (("node", nodal), ("body", nodal), ("component", nodal), ("line", line)):
            if getattr(self, key) is not None and not allowed:
                value = shown(getattr(self, key))
                raise InputError(f'{key} = {value} has no meaning for quantity = "{self.quantity}"')
        if self.node is not None and self.body is not None:
            raise InputError(f"node = {shown(self.node)} and body = {shown(self.body)} exclude each other")

    @property
    def unit(self):
        """Unit of the value."""
        if self.quantity in TOTAL:
            return TOTAL[self.quantity]
        return {**NODAL, **LINE}[self.quantity][1]

    def on(self, system):
        """Refuse what the system does not have."""
        net = system.net
        need = _NEEDS.get(self.quantity)
        if net.quasi_static and self.quantity in _DYNAMIC:
            raise InputError(f'quantity = "{self.quantity}" has no meaning in statics')
        moved = self.quantity == "work" and (system.drives or system.line_drives)
        if need and self.quantity not in [f.book for f in system.families] and not moved:
            raise InputError(f'quantity = "{self.quantity}" needs {need} in the scene')
        loads = [f for f in system.families if f.book == self.quantity == "work"]
        if net.quasi_static and (moved or any(f.energy is None for f in loads)):
            tables = "[[motion]], [[pressure]], [[thrust]] and [[reel]]"
            raise InputError(f'quantity = "work" is not known in statics with {tables}: it depends on the path')
        if self.line is not None and self.line >= len(net.web.lines):
            raise InputError(f"line = {self.line} must be 0 … {len(net.web.lines) - 1}")
        if self.quantity in NODAL:
            self.rows(system)

    def rows(self, system):
        """Rows of a nodal quantity, shape (k,)."""
        net = system.net
        if self.body is not None:
            names = [body.name for body in net.bodies]
            if self.body not in names:
                hint = nearest(self.body, names) if names else "the scene has no [[body]]"
                raise InputError(f'body = "{self.body}" is no body, {hint}')
            return np.array([net.bodies[names.index(self.body)].row])
        return np.arange(net.nodes) if self.node is None else net.find(self.node)

    def value(self, state):
        """The observable at one instant, a `Value`."""
        if self.quantity == "slack_fraction":
            return Value(float(state.element_slack.mean()), None)
        if self.quantity in TOTAL:
            return Value(state.energies[self.quantity], None)
        if self.quantity in LINE:
            values = getattr(state, self.quantity)
            at = int(np.argmax(values)) if self.line is None else self.line
            return Value(float(values[at]), at)
        rows = self.rows(state.system)
        values = getattr(state, NODAL[self.quantity][0])[rows]
        if self.quantity == "reaction" and len(rows) > 1:
            values, rows = values.sum(axis=0, keepdims=True), [None]
        values = np.linalg.norm(values, axis=1) if self.component is None else values[:, self.component]
        at = int(np.argmax(values))
        return Value(float(values[at]), None if rows[at] is None or self.body is not None else int(rows[at]))

    def error(self, state, equilibrium):
        """± of the value in a `refweb.statics.equilibrium.Equilibrium`, None where none is known.

        A proven bound from duality where there is one that speaks of the quantity, else an estimate from the
        equilibrium's deviations: what the residual makes of the value, three times what rounding makes of it, and the
        rounding of the value itself.
        """
        if equilibrium.duality_bound is not None and (self.quantity in LINE or self.quantity == "strain_energy"):
            return self._bound(state, equilibrium.duality_bound)
        place = self.value(state)
        loose = self.quantity in NODAL and place.where in state.slack_nodes
        if equilibrium.deviations is None or loose or self.quantity == "slack_fraction":
            return None
        changes = []
        for deviation in equilibrium.deviations:
            size = np.abs(deviation).max()
            share = 1e-7 * state.system.net.natural_length.min() / size if size > 0.0 else 0.0
            there = type(state)(state.system, state.time, state.x + share * deviation)
            changes.append(abs(self.value(there).value - place.value) / share if share > 0.0 else 0.0)
        return float(changes[0] + 3.0 * max(changes[1:]) + 2.0 * np.finfo(float).eps * abs(place.value))

    def _bound(self, state, proven):
        if self.quantity == "strain_energy":
            return proven.strain_energy
        net = state.system.net
        bound = proven.tension
        if self.quantity == "stress":
            bound = bound / net.area
        if self.quantity == "strain":
            bound = bound / net.line_data[:, AXIAL_STIFFNESS]
        error = float(bound.max() if self.line is None else bound[net.line == self.line].max())
        if self.quantity == "strain" and self.value(state).value <= error:
            return None  # the strain of a slack line is not unique
        return error


DEFAULT = (
    Observe(name="deflection", quantity="displacement", reduce="max"),
    Observe(name="max_stress", quantity="stress", reduce="max"),
    Observe(name="max_tension", quantity="tension", reduce="max"),
)
"""What a scene without ``[[observe]]`` observes."""
