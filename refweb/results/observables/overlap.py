"""How deep lines are in a body."""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from .observable import NOT_NEGATIVE, Observable, Value


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

    def bounds(self, system):
        """A depth."""
        return NOT_NEGATIVE

    def probe(self, system):
        """Of what the family of its contact shows."""
        return probe_of(system, self.body(system.net))

    def place(self, system, at):
        """The line of an element, None where nothing is touched."""
        return int(system.net.line[at]) if at >= 0 else None


def probe_of(system, body):
    """The `refweb.results.probes.Probe` of the deepest contact of a body."""
    from ..probes import Probe, deepest

    family, cells = system.touching(body)
    return Probe(deepest, [cells.start, cells.stop], np.zeros((1, 1)), family=family)


def probes_between(system):
    """Probes of the deepest contact of each pair of bodies, by name."""
    from ..probes import Probe, deepest

    cells = [(i, n) for i, family in enumerate(system.families) for n in range(len(family.pairs))]
    return {
        ("between", k): Probe(deepest, [n, n + 1], np.zeros((1, 1)), sign=1.0, family=i)
        for k, (i, n) in enumerate(cells)
    }


def probe_of_speed(system):
    """Probe of the largest speed of a point of a body."""
    from ..probes import Probe, surface_speed

    rows, reach = [], []
    for body in system.net.bodies:
        rows += [body.row, -1 if body.spin is None else body.spin]
        fastest = 1.0 if body.turn is None else float(np.linalg.eigvalsh(body.mobility)[-1])
        reach.append([body.extent * fastest if np.isfinite(body.extent) else body.radius])
    return Probe(surface_speed, rows, np.array(reach), sign=1.0)
