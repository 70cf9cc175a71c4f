"""Fuel and Δv of a control: the impulse of its force, ∫ |F| dt, and the change of velocity by it.

The force is constant between periods, so that the integral is linear in time. May change: private functions; class
docstrings, which are help: then write ``validation/REFERENCE.md`` anew. Must stay: the numbers of a probe in this
order, to which `dynamics.controllers` writes: integral [N s] at a time, size of the force [N], that time [s], factor;
`Fuel`, which `dynamics.gradients` knows. Tests: ``tests/dynamics/test_control.py``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ...kernels import kernel
from ...messages import quote
from ..probes import PROBE, Probe
from .observable import NOT_NEGATIVE, Observable, Value

if TYPE_CHECKING:
    from ...system.system import System
    from ..state import State


class Fuel(Observable):
    """Impulse that a control has spent: ∫ abs(F) dt of its force, on all nodes of its load together."""

    unit = "N s"
    keys: tuple[str, ...] = ("control",)
    dynamic = True

    def bounds(self, system: System | None) -> tuple[float, float]:
        """Bounds of the value: it is not negative."""
        return NOT_NEGATIVE

    def on(self, system: System) -> None:
        """Refuse a missing name; the scene refuses a control that it does not have."""
        if self.observe.control is None:
            raise InputError(
                f'control is missing: quantity = "{self.observe.quantity}" needs the name of a [[control]]'
            )

    def of(self, state: State) -> Value:
        """No number: a state alone does not tell what was spent."""
        return Value(float("nan"), None)

    def factor(self, load: Any, system: System, axes: Sequence[bool] = (True,) * 3) -> float:
        """Factor on ∫ abs(F) dt of the force of a ``[[load]]`` or ``[[thrust]]`` on one node or body: their number.

        ``axes`` are True for those in which the force acts.
        """
        return float(len(_nodes(load, system, axes))) if load.node is not None else 1.0

    def probe(self, system: System) -> Probe:
        """Make the probe, whose data a control writes."""
        return Probe(spent, [], np.zeros((1, 4)))


class DeltaV(Fuel):
    """Δv that a control has spent: its fuel over the mass of its body, or over the point masses of its nodes."""

    unit = "m/s"

    def factor(self, load: Any, system: System, axes: Sequence[bool] = (True,) * 3) -> float:
        """Factor on ∫ abs(F) dt of the force on one node or body: their number over their mass [1/kg]."""
        net = system.net
        if load.node is None:
            return 1.0 / float(net.mass[next(body.row for body in net.bodies if body.name == load.body)])
        nodes = _nodes(load, system, axes)
        if system.carried[nodes].any():
            raise InputError(
                f'quantity = "delta_v" has no meaning for node = {quote(load.node)}, which a body carries: load the '
                'body, or use "fuel"'
            )
        mass = 0.0 if net.point_mass is None else float(net.point_mass[nodes].sum())
        if not mass > 0.0:
            raise InputError(
                f'quantity = "delta_v" needs a mass: give node = {quote(load.node)} a [[point_mass]], or use "fuel"'
            )
        return len(nodes) / mass


def _nodes(load, system, axes):
    """Nodes of a load; `InputError` for one that cannot move along axes of its force, which no fuel flies."""
    nodes, pushed = system.net.web.find(load.node), np.array(axes)
    still = nodes[system.fixed[nodes][:, pushed].all(axis=1)]
    if len(still):
        along = "" if pushed.all() else f" along {' and '.join(np.array(['x', 'y', 'z'])[pushed])}"
        raise InputError(
            f"node {still[0]} is supported or moved by a table{along}, so that no thrust flies it: leave it out of "
            f"node = {quote(load.node)} of the load"
        )
    return nodes


@kernel(PROBE)
def spent(t, x, v, f, lines, rows, data, where):
    """Kernel of factor · (integral at a time + size · time since then)."""
    return data[0, 3] * (data[0, 0] + data[0, 1] * (t - data[0, 2]))
