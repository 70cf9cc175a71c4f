"""A circular orbit: free masses, and dumbbells that gravity's gradient holds.

In axes that go round with the origin, x away from the Earth, y along the track, z across it, masses move by the linear
equations of W. H. Clohessy and R. S. Wiltshire (J. Aerosp. Sci. 27 (1960) 653–658, doi:10.2514/8.8704). Their
transition matrix over an orbit and a third is held against its closed form, and by central differences, which are of
order 2. Two masses m at distances r from the origin that hang on a line without mass pull it with

    T = 3 n² m r

and swing with √3 n in the plane of the orbit and with 2 n across it (P. C. Hughes, Spacecraft Attitude Dynamics, 1986,
chapter 9), but for what the line's stretch changes, of the share 4 n²/ω² of its own frequency ω.
"""

import numpy as np

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.cvode import Cvode

from ..harness.case import Case, Row, slope

N, MASS, HALF = 1.1e-3, 10.0, 50.0
"""Mean motion [rad/s], mass of each end [kg] and half of the length [m] of a dumbbell."""


def transition(angle):
    """The closed form, after an angle of the orbit [rad], velocities in units of n times lengths."""
    s, c = np.sin(angle), np.cos(angle)
    return np.array(
        [
            [4 - 3 * c, 0, 0, s, 2 * (1 - c), 0],
            [6 * (s - angle), 1, 0, -2 * (1 - c), 4 * s - 3 * angle, 0],
            [0, 0, c, 0, 0, s],
            [3 * s, 0, 0, c, 2 * s, 0],
            [-6 * (1 - c), 0, 0, -2 * s, 4 * c - 3, 0],
            [0, 0, -s, 0, 0, c],
        ]
    )


def found(angle, solver, **options):
    """The same of six masses that begin with one unit each."""
    places = [*np.eye(3).tolist(), [0.0, 0.0, 0.0], [0.0, 0.0, 2e-16], [0.0, 0.0, 4e-16]]
    system = refweb.Scene(
        web=refweb.Inline(points=places, lines=[[i, i + 1] for i in range(5)], natural_length=1e5),
        cable=refweb.Cable(law="tension-only", modulus=1.0, area=1e-4, density=0.0),
        effects=[refweb.PointMass(node="all", mass=1.0), refweb.Orbit(mean_motion=N)],
        supports=refweb.Supports(nodes=[]),
        solve=refweb.Dynamic(duration=angle / N),
    ).build()
    method = solver(system, **options)
    run = method.start(None, np.vstack([np.zeros((3, 3)), N * np.eye(3)]))
    method.advance(run, [angle / N])
    return np.hstack([system.net.points + run.x, run.v / N]).T


def dumbbell():
    """Two masses on a line from the Earth."""
    return refweb.Scene(
        web=refweb.Inline(points=[[-HALF, 0, 0], [HALF, 0, 0]], lines=[[0, 1]]),
        cable=refweb.Cable(law="tension-only", modulus=1e8, area=1e-4, density=0.0),
        effects=[refweb.PointMass(node="all", mass=MASS), refweb.Orbit(mean_motion=N)],
        supports=refweb.Supports(nodes=[]),
    )


def case(quick):
    angle = 8.0 * np.pi / 3.0
    exact = transition(angle)
    apart = np.abs(found(angle, Cvode, family="adams", rtol=1e-13) - exact).max()
    name, reason = "transition matrix, largest error of a number", "ten digits"
    rows = [Row(name, apart, 0.0, "closed form", 1e-10, reason, scale=float(np.abs(exact).max()))]
    counts, errors = (64, 128, 256), []
    for count in counts:
        near = found(angle, CentralDifference, step_size=angle / N / count * (1.0 + 1e-12))
        errors.append(np.abs(near - exact).max())
    rows.append(Row("order of central differences", -slope(counts, errors), 2, "theory", 0.15, "the coarsest step",
                    scale=1))  # fmt: skip
    tension = refweb.run(dumbbell()).results["max_tension"]
    pull = 3.0 * N**2 * MASS * HALF
    reason = "the line is stretched by T/EA = 2e-7"
    rows.append(Row("tension that hangs", tension.value, pull, "closed form", 1e-6, reason, "N", tension.error))
    squared = refweb.modes(dumbbell(), 5).spectra[-1].squared / N**2
    reason = "4 n²/ω² = 2e-6 of the line"
    for name, at, value in (("in the plane", 2, 3.0), ("across it", 3, 4.0)):
        rows.append(Row(f"libration {name}, ω²/n²", squared[at], value, "closed form", 5e-6, reason))
    return Case(rows=rows)
