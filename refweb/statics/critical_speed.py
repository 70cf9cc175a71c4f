"""The angular speed at and above which a net that turns has no stable equilibrium.

Far out every tension law is linear: a net that is stretched without limit has the potential ½ Σ (EA/L) |d|² of the
vectors d of its lines, less terms that grow no faster than |d|, and the centrifugal one, −½ Σ m |Ω × r|². The least Ω
at which their sum is not positive definite,

    A y = Ω² C y,      A of unit tensions EA/L,   C of masses across the axis,

is a sharp limit, also in an orbit, where Ω² C are masses times the G of `refweb.effects.orbit`. Below it the whole
potential has a least value, above it none. And as no law here has dσ/dε > E or T/l > EA/L, no tangent of the lines
exceeds A: at and above the limit no equilibrium is stable, wherever it may be.

Counts of negative pivots (Sylvester's law of inertia) compare A with Ω²C. A part of the net that nothing holds across
the axis is an exception in its translations alone, which A does not resist: such a part moves on in a straight line, as
seen from outside, and turns steadily where its centre of mass is on the axis.
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
    """Refuse a frame that turns at the limit or above it, with that limit."""
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
