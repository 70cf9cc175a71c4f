"""Axles of bodies: the table of one, and the torque about it.

May change: private functions; how the torque is read and computed. Must stay: keys and docstring of `BodyAxle` (scene
format and help; after a change write ``validation/REFERENCE.md`` anew); `torques`, which `system.system` calls; the
name "axle", cells and data of its terms (direction, then a table of `time_tables`), which `dynamics.commands` writes
anew during a run. Tests: ``tests/effects/test_axles.py``.
"""

from __future__ import annotations

import numpy as np

from ..kernels import ENERGY, FORCE, kernel
from ..net.rigid_body import Axle, unit
from ..tables import Several, Table, real_or_rows, table, vector
from .base import Balance, ForceTerm, Timing
from .time_tables import flattened, interpolate


@table
class BodyAxle(Table):
    """Axle that a body turns about, which is all that it does: a pulley, a drum, a flap.

    Parameters
    ----------
    point : sequence of 3 float, optional
        A point on it [m]; by default the position of the body.
    direction : sequence of 3 float
        Direction along it, of any length but 0.
    torque : float or sequence of (t, torque), optional
        Torque about the direction on a body that turns freely [N m]; a table is linear in between, end values held.

    Raises
    ------
    InputError
        For a direction that is zero or missing, and times that do not increase.

    Examples
    --------
        [[body]]
        name = "wheel"
        radius = 0.1
        mass = 2.0
        position = [0.0, 0.0, 1.0]
        axle = { direction = [0.0, 1.0, 0.0], torque = 0.5 }
    """

    point: Several = vector(default=None, unit="m")
    direction: Several = vector()
    torque: Several = real_or_rows(default=None, unit="N m")

    def check(self):
        """Refuse a direction that is zero."""
        unit("direction", self.direction)

    def at(self, position):
        """The `refweb.net.rigid_body.Axle` of a body at a position [m]."""
        torque = self.torque if isinstance(self.torque, (tuple, type(None))) else ((0.0, self.torque),)
        point = np.array(position if self.point is None else self.point, dtype=float)
        return Axle(point, unit("direction", self.direction), torque or ())


@kernel(FORCE)
def force(t, x, v, f, cells, data, out):
    for c in range(cells.shape[0]):
        torque, rate = interpolate(t, data[c], 3, 2, 1)[0], 0.0
        for k in range(3):
            f[cells[c, 0], k] += torque * data[c, k]
            rate += data[c, k] * v[cells[c, 0], k]
        out[c, 0] = torque * rate


@kernel(ENERGY)
def energy(t, x, cells, data, out):
    for c in range(cells.shape[0]):
        out[c] = -interpolate(t, data[c], 3, 2, 1)[0] * x[cells[c, 1], 1]


def torques(net):
    """The `ForceTerm` s of the torques about the axles of a net, one for each body."""
    return [
        ForceTerm(
            name="axle",
            cells=np.array([[body.spin, body.turn]], dtype=np.int32),
            data=np.array([[*body.axle.direction, *flattened(body.axle.torque)]]),
            force=force,
            energy=energy,
            balance=Balance("work", power=0, internal=True, twists=True),
            timing=Timing(tuple(t for t, _ in body.axle.torque)),
        )
        for body in net.bodies
        if body.axle and body.axle.torque
    ]
