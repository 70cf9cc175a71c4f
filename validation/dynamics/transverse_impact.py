"""Transverse impact on a string: strain, kink and angle.

A straight cable without tension is struck at a point that goes on at a constant speed V across it. A longitudinal wave
runs ahead with c = √(E/ρ) and leaves the strain ε and an inward flow w = c ε behind it; a kink follows with the speed U
in natural arc length. Inside the kink all of the string moves with V, straight, at an angle θ to its old direction
(H. A. Rakhmatulin 1945; J. D. Cole, C. B. Dougherty and J. H. Huth 1953; J. C. Smith, F. L. McCrackin and
H. F. Schiefer, Text. Res. J. 28, 1958, doi:10.1177/004051755802800402):

    U = c √(ε/(1 + ε)),    V² = (1 + ε)² U² − ((1 + ε) U − w)²,    tan θ = V/((1 + ε) U − w)

By symmetry half of the string is computed: its end is moved. The strain of this solution jumps, and that of elements
rings about it; means over the length that the wave has crossed converge. Compared are the mean strain behind the
longitudinal wave, the kink's place and angle by a straight line through the nodes well inside of it, and the momentum
of the string, ρA U V t across and ρA (c − U) w t along, whose error is that of one node's share: of order 1.
"""

import numpy as np
from scipy.optimize import brentq

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, slope

MODULUS, AREA, DENSITY = 7e7, 1e-4, 200.0
SOUND, STRAIN, REACH = np.sqrt(MODULUS / DENSITY), 0.01, 0.8
"""c [m/s], ε behind the wave, and how far the longitudinal wave runs on the string of 1 m [m]."""


def kink(strain):
    """U [m/s], V [m/s] and tan θ of the solution with a strain."""
    U, flow = SOUND * np.sqrt(strain / (1 + strain)), SOUND * strain
    inward = (1 + strain) * U - flow
    V = np.sqrt(((1 + strain) * U) ** 2 - inward**2)
    return U, V, V / inward


def solved(elements, speed):
    """Half of the string on x > 0, its end at the origin moved along z."""
    end = REACH / SOUND
    scene = refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=elements),
        cable=refweb.Cable(law="tension-only", modulus=MODULUS, area=AREA, density=DENSITY),
        effects=[refweb.Motion(node=0, displacement=[(0, 0, 0, 0), (1, 0, 0, speed)])],
        solve=refweb.Dynamic(duration=end),
        output=refweb.Output(interval=end / 20),
        accuracy=refweb.Accuracy(error="none"),
    )
    return refweb.run(scene)


def measured(solution):
    """Mean strain, kink speed [m/s], tan θ, and the momenta along and across [N s]."""
    s = solution.state.system.net.web.points[:, 0]
    x, time, speed = solution.positions, solution.state.time, kink(STRAIN)[1]
    middle = 0.5 * (s[1:] + s[:-1])
    # Behind the longitudinal wave, 10 % short of it; the first 10 % belong to the start.
    behind = (middle > 0.1 * REACH) & (middle < 0.9 * REACH)
    strain = solution.strain[behind].mean()
    inside = (x[:, 2] > 0.2 * speed * time) & (x[:, 2] < 0.8 * speed * time)
    fall, top = np.polyfit(x[inside, 0], x[inside, 2], 1)
    # The kink in natural arc length: where the straight line reaches the axis, per unit of natural length on it.
    along = np.polyfit(s[inside], x[inside, 2], 1)
    U = -along[1] / along[0] / time
    mass = 0.5 * DENSITY * AREA * (s[1] - s[0])  # of the end that is moved, which is no free node
    history = solution.history
    return np.array([strain, U, -fall, history["momentum_x"][-1], history["momentum_z"][-1] + mass * speed])


def case(quick):
    U, V, tangent = kink(STRAIN)
    time, line = REACH / SOUND, DENSITY * AREA
    inverse = brentq(lambda strain: kink(strain)[1] - V, 1e-6, 0.5, xtol=1e-16)
    exact = np.array([inverse, U, tangent, -line * (SOUND - U) * SOUND * STRAIN * time, line * U * V * time])
    counts = np.array([200, 400, 800] if quick else [400, 800, 1600, 3200])
    solutions = [solved(int(count), V) for count in counts]
    found = np.array([measured(solution) for solution in solutions])
    errors = np.abs(found / exact - 1)
    names = ["mean strain", "kink speed U", "tan θ", "momentum along", "momentum across"]
    units = ["1", "m/s", "1", "N s", "N s"]
    reason, source = "order 1: fronts pass node by node", "Rakhmatulin, Cole, Smith"
    rows = [
        Row(f"{name}, V = {V:.4g} m/s", value, reference, source, 4 / counts[-1], reason, unit)
        for name, value, reference, unit in zip(names, found[-1], exact, units, strict=True)
    ]
    order = -slope(counts, errors[:, 3])
    rows.append(Row("order of the momentum along", order, 1, "one node's share", 0.1, "the next order", scale=1))

    def drawn():
        page, (left, right) = plots.axes(["x [m]", "natural arc length s [m]"], ["z [m]", "strain [%]"], columns=2)
        x, s = solutions[0].positions, (np.arange(counts[0]) + 0.5) / counts[0]
        place, reach = ((1 + STRAIN) * U - SOUND * STRAIN) * time, np.linspace(0, 1, 1001)
        left.plot([0, place, 0.2], [V * time, 0, 0], **plots.REFERENCE)
        near = x[:, 0] < 0.2
        left.plot(x[near, 0], x[near, 2], "o", markersize=3)
        right.plot(s, 100 * solutions[0].strain, linewidth=0.8, color=plots.COLOURS[1])
        right.plot(reach, np.where(reach < REACH, 100 * STRAIN, 0), **plots.REFERENCE)
        return page

    caption = f"The string after {1e3 * time:.2f} ms: place and strain of {counts[0]} elements, and the exact solution "
    return Case(rows=rows, figures=[Figure(caption + "(black). Elements ring behind the fronts.", drawn)])
