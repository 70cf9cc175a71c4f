"""Depth of lines in bodies, and the probe of the largest speed of a point of a body.

May change: private functions; the class docstring, which is help: then write ``validation/REFERENCE.md`` anew. Must
stay: rows of the probes, which are those of `system.contact_forces`; `probe_of…` and `probes_between`, by which
`dynamics.history` follows contact; `probe_of_speed` and `probe_of_touch`, which `dynamics.history` imports. Tests:
``tests/results/test_contact_force.py``, ``tests/results/test_every_number.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...effects.base import CONTACT, pairs_of
from ...errors import InputError
from .observable import NOT_NEGATIVE, Observable, Value

if TYPE_CHECKING:
    from ...system.system import System
    from ..probes import Probe
    from ..state import State


class Overlap(Observable):
    """Depth of the deepest contact of a body, or of several, with lines, 0 where none touches; it stands at the line.

    The overlap of two bodies is in ``pairs`` of ``run.json``.

    With ``reduce = "max"`` it is the deepest overlap at and between all steps.
    """

    unit = "m"
    keys: tuple[str, ...] = ("body",)
    at = "line"

    def on(self, system: System) -> None:
        """Refuse a scene without contact, an unknown body, and a missing name if there are several bodies."""
        if not system.contact:
            raise InputError('quantity = "overlap" needs [contact] in the scene')
        self._touched(system.net)

    def _touched(self, net):
        """The bodies that are named, or the only one."""
        return self.bodies(net) if isinstance(self.observe.body, tuple) else [self.body(net)]

    def of(self, state: State) -> Value:
        """The deepest over all lines."""
        deep = np.max([state.overlap(body) for body in self._touched(state.system.net)], axis=0)
        at = int(np.argmax(deep))
        return Value(float(deep[at]), self.position(state.system, at if deep[at] > 0.0 else -1))

    def bounds(self, system: System | None) -> tuple[float, float]:
        """Bounds of the value: a depth is not negative."""
        return NOT_NEGATIVE

    def probe(self, system: System) -> Probe:
        """Make the probe of the contact of its body."""
        return _deepest_of([system.contact_forces.row(body) for body in self._touched(system.net)])

    def position(self, system: System, at: int) -> int | None:
        """The line of an element, None without contact."""
        return int(system.net.line[at]) if at >= 0 else None


def probe_of(system, body):
    """The `refweb.results.probes.Probe` of the deepest contact of a body."""
    return _deepest_of([system.contact_forces.row(body)])


def _deepest_of(rows):
    from ..probes import Probe, contact_depth

    return Probe(contact_depth, rows, np.zeros((0, 0)), term=CONTACT)


def probes_between(system):
    """Probes of the deepest contact of each pair of bodies, by name."""
    pairs = [system.contact_forces.pair_rows(body_a, [body_b]) for body_a, body_b in pairs_of(system)]
    return {("between", k): _deepest_of(rows)._replace(sign=1.0) for k, rows in enumerate(pairs)}


def probe_of_touch(system, body, body_b):
    """The probe of the deepest contact of a body (None for any body) with the web, or with another body."""
    bodies, forces = system.net.bodies if body is None else [body], system.contact_forces
    return _deepest_of(
        [forces.row(body_a) for body_a in bodies] if body_b is None else forces.pair_rows(body_b, bodies)
    )


def probe_of_speed(system):
    """Probe of the largest speed of a point of a body."""
    from ..probes import Probe, surface_speed

    rows, reach = [], []
    for body in system.net.bodies:
        rows += [body.row, -1 if body.spin is None else body.spin]
        fastest = 1.0 if body.turn is None else float(np.linalg.eigvalsh(body.mobility)[-1])
        reach.append([body.extent * fastest if np.isfinite(body.extent) else body.radius])
    return Probe(surface_speed, rows, np.array(reach), sign=1.0)
