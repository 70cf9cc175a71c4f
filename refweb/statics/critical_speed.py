"""Critical speed: the angular speed at and above which a rotating net has no stable equilibrium.

Every tension law is linear at large strains. A net that is stretched without limit has the potential ½ Σ (EA/L) |d|² of
the vectors d of its lines, less terms that grow no faster than |d|. The centrifugal potential is −½ Σ m |Ω × r|². The
least Ω at which the sum of both is not positive definite,

    A y = Ω² C y,      A of unit tensions EA/L,   C of masses across the axis,

is a sharp limit. In an orbit, Ω² C is replaced by the masses times the matrix G of `refweb.effects.orbit`. The total
potential has a least value below the limit, and none above it. No law here has dσ/dε > E or T/l > EA/L, so that no
tangent of the lines exceeds A. Therefore no equilibrium is stable at or above the limit. Of a curve E is the largest
slope, and the limit is sharp only where that is the last one.

Counts of negative pivots (Sylvester's law of inertia) compare A with Ω²C. Translations of a part that no support holds
across the axis are an exception, since A does not resist them. In the inertial frame such a part moves in a straight
line; it rotates steadily if its centre of mass is on the axis.

May change: private functions and words of the message. `ANCHOR` and `HELD` may change as long as no count of pivots
does. Must stay: `drifting`, since `newton` and `stability` allow as many negative pivots in a stable equilibrium;
`check_speed`, which `equilibrium` calls before it solves. Tests: ``tests/effects/test_frame.py``.
"""

from __future__ import annotations

import numpy as np

from ..errors import SolverError
from ..system.factorization import Factor

ANCHOR = 1e-10
"""Stiffness that holds each node of an unsupported part against its translation, over the largest EA/L."""

HELD = 1e9
"""Factor on the stiffness of the rotation of bodies, which are held."""


def drifting(system):
    """Number of translations of unsupported parts that centrifugal forces drive away from the axis."""
    if not system.unsupported_parts:
        return 0
    moves = np.zeros((len(system.free), len(system.unsupported_parts)))
    for k, part in enumerate(system.unsupported_parts):
        moves[part.unknowns, k] = 1.0
    values = np.linalg.eigvalsh(moves.T @ (system.pattern.matrix(_centrifugal(system)) @ moves))
    return int(np.count_nonzero(values < -1e-12 * np.abs(values).max()))


def _centrifugal(system):
    """Values of −Ω²C in the pattern of the system."""
    return system.stiffness(0.0, np.zeros((system.rows, 3)), only=system.rotating)


def check_speed(system, t):
    """Refuse a frame that rotates at the critical speed or above; the message names this speed."""
    net, factor = system.at(t).net, Factor(system.pattern)
    taken, allowed = _centrifugal(system), drifting(system)
    axial = net.line_data.ea / net.natural_length
    tension_stiffness = system.at(t).across_lines(net.line_data.ea)
    spins = system.pattern.diagonal[system.free // 3 >= system.rows - net.spins]  # no rotation stretches without limit
    tension_stiffness[spins] *= HELD
    for part in system.unsupported_parts:
        tension_stiffness[system.pattern.diagonal[part.unknowns]] += ANCHOR * axial.max()

    def stands(share):
        factor.update(tension_stiffness + share * share * taken)
        return factor.negative_pivots() <= allowed

    if stands(1.0):
        return
    low, high = 0.0, 1.0
    while high - low > 1e-13 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stands(middle) else (low, middle)
    term = system.rotating[0]
    speed = np.linalg.norm(term.frame.angular_velocity)
    key = "angular_velocity" if term.name == "frame" else "mean_motion"
    raise SolverError(
        f"no equilibrium: [{term.name}] turns at {speed:.6g} rad/s, must be below {high * speed:.8g} rad/s, where "
        f"centrifugal forces outgrow any tension: lower {key} or the masses, or raise modulus × area"
    )
