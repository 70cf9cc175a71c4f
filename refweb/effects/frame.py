"""A steadily rotating frame: the centrifugal and the Coriolis force on every mass.

In axes that rotate with the angular velocity Ω about a line through the origin, the force on a mass m at r with the
velocity v is

    m (Ω²I − ΩΩᵀ) r − 2 m Ω × v,      with the potential −½ m |Ω × r|² of the first part;

`refweb.effects.turning_axes` has the kernels.

May change: only the code of `on`. Must stay: the key and docstring of `Frame` (scene format and help; after a change
write ``validation/REFERENCE.md`` anew); `MovingFrame` of its terms, from which statics, modes and reeled masses read Ω;
the name "frame", by which `statics.critical_speed` tells it from an orbit, and which `statics.gradients.KNOWN` and
`statics.adjoint.MASSES` have; "frame_energy", a column of ``history.csv``. Tests: ``tests/effects/test_frame.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..tables import Several, Table, table, vector
from .base import Balance, MovingFrame
from .turning_axes import force_terms

if TYPE_CHECKING:
    from ..net.net import Net
    from .base import ForceTerm


@table
class Frame(Table):
    """A steadily rotating frame; positions, velocities, supports and all other effects are relative to its axes.

    Parameters
    ----------
    angular_velocity : sequence of 3 float
        Ω of the frame [rad/s], about an axis through the origin.

    Raises
    ------
    InputError
        For an angular velocity that is not three finite numbers.

    References
    ----------
    L. D. Landau, E. M. Lifshitz, "Mechanics", 3rd ed. 1976, §39: the forces, and the energy that is kept.

    Examples
    --------
        [frame]
        angular_velocity = [0.0, 0.0, 6.283]
    """

    angular_velocity: Several = vector(unit="rad/s")

    def on(self, net: Net) -> list[ForceTerm]:
        """Centrifugal and Coriolis force of all rows with mass."""
        speed = np.array(self.angular_velocity)
        across = (speed @ speed) * np.eye(3) - np.outer(speed, speed)
        return force_terms(net, MovingFrame(tuple(speed)), across, name="frame", balance=Balance("frame_energy"))
