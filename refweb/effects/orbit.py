"""An orbit: forces relative to a point that moves around the Earth in a circle.

The origin of the axes is this point. x points away from the Earth, y along the track, and z along the angular velocity
n of the orbit. In these axes masses move by the equations of Clohessy and Wiltshire,

    ẍ = 3n²x + 2nẏ,      ÿ = −2nẋ,      z̈ = −n²z,

which have the difference of gravity from its value at the origin, to first order in r over the radius R of the orbit,
and the inertia forces of the axes. `refweb.effects.turning_axes` has the kernels, with G = n² diag(3, 0, −1). The sum
of the kinetic energy, −½ m n² (3x² − z²) and the energies of all other effects is constant: the Jacobi integral.

May change: only the code of `on`. Must stay: the name "orbit", which `statics.gradients.KNOWN` and
`statics.adjoint.MASSES` have; keys and docstring of `Orbit` (scene format and help; after a change write
``validation/REFERENCE.md`` anew); `MovingFrame` of its terms: its radius gives ± of what the linear equations neglect,
by `System.orbit_radius`; `GRAVITATION` and `EARTH`, which are constants of nature. Tests:
``tests/effects/test_orbit.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from ..errors import InputError
from ..tables import Several, Table, real, rows, table
from .base import Balance, MovingFrame
from .turning_axes import force_terms

if TYPE_CHECKING:
    from ..net.net import Net
    from .base import ForceTerm

GRAVITATION = 3.986004418e14
"""Gravitational parameter of the Earth [m³/s²], IERS Conventions (2010), table 1.1."""
EARTH = 6378136.6
"""Equatorial radius of the Earth [m], from the same table."""


@table
class Orbit(Table):
    """A circular orbit of the Earth; all other data of the scene are relative to axes that rotate with it.

    The origin of the scene moves along the orbit. x points away from the Earth, y along the track, and z along the
    angular velocity; `axes` may name other directions. Velocities are relative to these axes: an object that rests in
    them has the velocity 0, and a web that does not rotate in the inertial frame has the spin −n about z. The same
    holds for the rotation of spheres.

    Each result has, beside ±, an estimate of the error of the linear equations: its size times the largest distance
    from the origin over the radius of the orbit. This is an order of magnitude. The error of a position along the track
    may be larger, since differences of periods add up.

    Parameters
    ----------
    mean_motion : float, optional
        n [rad/s], 2π over the period.
    altitude : float, optional
        Height above the equator [m], in place of ``mean_motion``.
    axes : list of 2 vectors, optional
        Directions away from the Earth and along the track, at right angles; by default x and y.

    Raises
    ------
    InputError
        For a number out of bounds, and unless exactly one of both is given; for axes that are not two at right angles;
        and beside ``[frame]`` or ``[gravity]``, which an orbit includes.

    References
    ----------
    W. H. Clohessy, R. S. Wiltshire, "Terminal guidance system for satellite rendezvous", J. Aerosp. Sci. 27 (1960)
    653–658, doi:10.2514/8.8704.

    Examples
    --------
        [orbit]
        mean_motion = 1.1e-3
    """

    excludes: ClassVar[tuple[str, ...]] = ("frame", "gravity")

    mean_motion: float | None = real(default=None, above=0, unit="rad/s")
    altitude: float | None = real(default=None, at_least=0, unit="m")
    axes: Several = rows(3, default=None)

    def check(self) -> None:
        """Refuse an orbit that is not given, or given twice, and wrong axes."""
        if (self.mean_motion is None) == (self.altitude is None):
            given = "both are given" if self.altitude is not None else "none is"
            raise InputError(f"give mean_motion [rad/s] or altitude [m]: {given}")
        self._frame()

    def _frame(self):
        """Unit vectors away from the Earth, along the track and across it, shape (3, 3)."""
        if self.axes is None:
            return np.eye(3)
        from ..net.rigid_body import axes_of

        return axes_of(self.axes)

    @property
    def radius(self) -> float:
        """Radius R of the orbit of the Earth [m]."""
        if self.mean_motion is None:
            return EARTH + (self.altitude or 0.0)
        return float(np.cbrt(GRAVITATION / self.mean_motion) / np.cbrt(self.mean_motion))

    def on(self, net: Net) -> list[ForceTerm]:
        """The terms of all rows with mass."""
        n = np.sqrt(GRAVITATION / self.radius) / self.radius if self.mean_motion is None else self.mean_motion
        frame = self._frame()
        pull, speed = n**2 * frame.T @ np.diag([3.0, 0.0, -1.0]) @ frame, n * frame[2]
        frame = MovingFrame(tuple(speed.tolist()), self.radius)
        return force_terms(net, frame, pull, name="orbit", balance=Balance("orbit_energy"))
