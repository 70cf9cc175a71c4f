"""Bodies that turn: the free rotor, and the hit of a rigid body off its centre.

With three different moments of inertia A < B < C the angular velocity of a free body is periodic along its own axes, by
Jacobi's functions (L. D. Landau, E. M. Lifshitz, Mechanics, 3rd ed. 1976, §37): with twice the energy 2E and the
squared momentum M² > 2EB its period is

    T = 4 K(m) √(ABC/((C − B)(M² − 2EA))),        m = (B − A)(2EC − M²)/((C − B)(M² − 2EA)).

Explicit methods move a free body by its own flow, to rounding; CVODE and IDA by their steps. About the axis of B a
rotor is unstable: what a method is off grows there.

A body of the mass m and the moment I that comes with v and touches a fixed thing at a lever r gets the impulse

    J = (1 + e) v/(1/m + r²/I)

if it is rigid. A penalty is the limit of that for growing stiffness k: while it lasts, a time as k^(−1/2), the body
turns. With the damping d of Hunt and Crossley e follows from d v (1 + e) = ln[(1 + d v)/(1 − d e v)], whatever the
masses and the exponent are.
"""

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipk

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, slope

TENSOR = (1.0, 2.0, 3.0)
ROTORS = {"about C": (0.3, 0.2, 2.0), "about B": (0.01, 2.0, 0.01)}
METHODS = {
    "central-difference": (dict(), 1e-11),
    "explicit, order 6": (dict(method="explicit", order=6), 1e-11),
    "cvode, Adams, rtol = 1e-10": (dict(method="cvode", family="adams", rtol=1e-10), 1e-5),
    "ida, rtol = 1e-7": (dict(method="ida", rtol=1e-7), 2e-2),
}
"""Keys of [solve], and how far the angular velocity may be off after a period: about B errors grow by e^14."""
MASS, INERTIA, LEVER, SPEED = 2.0, 0.2, 0.2, 2.0


def period(omega):
    """Period of the angular velocity along the axes of the body [s]."""
    (a, b, c), energy = TENSOR, sum(i * w * w for i, w in zip(TENSOR, omega, strict=True))
    square = sum((i * w) ** 2 for i, w in zip(TENSOR, omega, strict=True))
    if square < energy * b:
        a, c = c, a
    m = (b - a) * (energy * c - square) / ((c - b) * (square - energy * a))
    return 4.0 * ellipk(m) * np.sqrt(a * b * c / ((c - b) * (square - energy * a)))


def free(omega, solve):
    """A box alone, beside one line: how far its angular velocity is off after a period [rad/s]."""
    end = period(omega)
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=1e4, area=1e-4, density=1000.0),
        effects=[
            refweb.Body(
                name="box",
                shape="box",
                size=(0.3, 0.2, 0.1),
                mass=1.0,
                position=(5, 0, 0),
                inertia=TENSOR,
                angular_velocity=omega,
            )
        ],
        solve=refweb.Dynamic(duration=end, **solve),
        output=refweb.Output(interval=end / 10),
        accuracy=refweb.Accuracy(error="none"),
    )
    state = refweb.run(scene).state
    (body,) = state.system.net.bodies
    return np.abs(body.rotation(state.x).T @ body.turning(state.x, state.v) - omega).max()


def hit(k, damping=0.0):
    """Velocity and angular velocity behind a hit of a box on a line that both ends hold, off its centre."""
    time = np.sqrt(1.0 / k)
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, -1, 0], [0, 1, 0]], lines=[[0, 1]], supports=[0, 1]),
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=1.0),
        effects=[
            refweb.Body(
                name="box",
                shape="box",
                size=(1.0, 0.3, 0.2),
                mass=MASS,
                inertia=(0.05, INERTIA, 0.24),
                position=(-LEVER, 0.0, 0.101),
                velocity=(0.0, 0.0, -SPEED),
            ),
            refweb.Contact(stiffness=k, damping=damping),
        ],
        solve=refweb.Dynamic(duration=2e-3 + 5.0 * time, safety=0.1),
        output=refweb.Output(interval=1e-3 + 2.5 * time),
        accuracy=refweb.Accuracy(error="none"),
    )
    state = refweb.run(scene).state
    (body,) = state.system.net.bodies
    return state.v[body.row, 2], -body.turning(state.x, state.v)[1]


def rigid(damping):
    """The same of rigid bodies."""
    d, e = damping * SPEED, 1.0
    if damping:
        e = brentq(lambda e: d * (1.0 + e) - np.log((1.0 + d) / (1.0 - d * e)), 1e-9, 1.0)
    impulse = (1.0 + e) * SPEED / (1.0 / MASS + LEVER**2 / INERTIA)
    return impulse / MASS - SPEED, impulse * LEVER / INERTIA


def case(quick):
    rows, left = [], {}
    for name, omega in ROTORS.items():
        for method, (solve, within) in METHODS.items():
            if quick and "ida" in method:
                continue
            off = free(omega, solve)
            title = f"rotor {name}, off after a period of {period(omega):.12g} s, {method}"
            rows.append(Row(title, off, 0.0, "closed form", within, "its tolerance, and growth", "rad/s", scale=1))
    stiffnesses = 10.0 ** np.arange(5, 8 if quick else 10)
    for damping in (0.0, 0.4):
        exact, found = rigid(damping), [hit(k, damping) for k in stiffnesses]
        left[damping] = [max(abs(np.array(one) / exact - 1.0)) for one in found]
        within, reason = 3.0 * stiffnesses[-1] ** -0.5 * 100, "what the body turns while it touches, as k^(−1/2)"
        for title, one, other, unit in zip(
            ("velocity", "angular velocity"), found[-1], exact, ("m/s", "rad/s"), strict=True
        ):
            rows.append(Row(f"hit, d = {damping} s/m, k = {stiffnesses[-1]:g} N/m: {title}", one, other, "closed form",
                            within, reason, unit))  # fmt: skip
    rate = slope(stiffnesses, left[0.0])
    rows.append(Row("power of k of what is left", rate, -0.5, "theory", 0.1, "the softest", scale=1))

    def drawn():
        page, plot = plots.axes("stiffness [N/m]", "off the hit of rigid bodies [1]")
        for (damping, found), mark in zip(left.items(), "os", strict=True):
            plot.loglog(stiffnesses, found, mark, label=f"d = {damping} s/m")
        plot.loglog(stiffnesses, left[0.0][0] * (stiffnesses / stiffnesses[0]) ** -0.5, **plots.REFERENCE)
        plot.legend(frameon=False)
        return page

    return Case(rows=rows, figures=[Figure("An eccentric hit, with a line of k^(−1/2).", drawn)])
