"""How deep lines are in a body."""

from __future__ import annotations

import numpy as np

from ...effects.base import pairs_of
from ...errors import InputError
from ...system.forces import CONTACT
from .observable import Observable, Value


class Overlap(Observable):
    """Depth of the deepest contact of a body with lines, 0 where no line touches it; it stands at the line.

    How deep two bodies overlap stands in ``pairs`` of ``run.json``.

    With ``reduce = "max"`` it is the deepest of all steps and between them.
    """

    unit, keys, at = "m", ("body",), "line"

    def on(self, system):
        """Refuse a scene without contact, a body that is none, and none where there are several."""
        if not system.contact:
            raise InputError('quantity = "overlap" needs [contact] in the scene')
        self.body(system.net)

    def of(self, state):
        """The deepest over all lines."""
        deep = state.overlap(self.body(state.system.net))
        at = int(np.argmax(deep))
        return Value(float(deep[at]), self.place(state.system, at if deep[at] > 0.0 else -1))

    def probe(self, system):
        """Of what its contacts show."""
        return probe_of(system, self.body(system.net))

    def place(self, system, at):
        """The line of an element, None where nothing is touched."""
        return int(system.net.line[at]) if at >= 0 else None


def probe_of(system, body):
    """The `refweb.results.probes.Probe` of the deepest contact of a body."""
    return _deepest_in([system.contact_rows.lines_on(body)])


def _deepest_in(ranges):
    """The probe of the deepest contact in ranges of `refweb.system.contact_rows.ContactRows`."""
    from ..probes import Probe, deepest

    return Probe(deepest, np.ravel(ranges), np.zeros((0, 0)), family=CONTACT)


def probes_between(system):
    """Probes of the deepest contact of each pair of bodies, by name."""
    pairs = [system.contact_rows.between(one, [other]) for one, other in pairs_of(system)]
    return {("between", k): _deepest_in(ranges)._replace(sign=1.0) for k, ranges in enumerate(pairs)}


def probe_of_touch(system, body, other):
    """The probe of the deepest contact of a body, None for any, with the web, or with another body."""
    bodies, rows = [body] if body is not None else system.net.bodies, system.contact_rows
    return _deepest_in(rows.with_web(bodies) if other is None else rows.between(other, bodies))


def probe_of_speed(system):
    """Probe of the largest speed of a point of a body."""
    from ..probes import Probe, surface_speed

    rows, reach = [], []
    for body in system.net.bodies:
        rows += [body.row, -1 if body.spin is None else body.spin]
        fastest = 1.0 if body.turn is None else float(np.linalg.eigvalsh(body.mobility)[-1])
        reach.append([body.extent * fastest if np.isfinite(body.extent) else body.radius])
    return Probe(surface_speed, rows, np.array(reach), sign=1.0)
