"""A mass under feedback: a force that is held between periods, and a torque that turns a drum.

A controller measures the place x and the velocity v of a free mass m in each period T, and holds the force
u = k (r − x) − d v until the next one. Its motion from period to period is exact:

    x ← x + T v + ½ T² u/m,        v ← v + T u/m.

A drum of the moment of inertia I turns about its axle under a torque M that changes in each period:

    φ ← φ + T ω + ½ T² M/I,        ω ← ω + T M/I.
"""

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row

PERIOD, PERIODS, TARGET, STIFFNESS, DAMPING = 0.05, 30, 0.3, 40.0, 6.0
"""T [s], number of periods, r [m], k [N/m] and d [N s/m]."""
METHODS = {
    "central-difference": {},
    "order 4": {"method": "explicit", "order": 4},
    "cvode": {"method": "cvode", "rtol": 1e-6},
    "ida": {"method": "ida", "rtol": 1e-6},
}
TORQUES = (0.05, 0.05, -0.05, -0.02)


def scene(keys, duration, **tables):
    """A mass on a slack line, with a load."""
    return refweb.Scene.from_dict(
        {
            "web": {
                "kind": "inline",
                "points": [[0, 0, 0], [0.5, 0, 0]],
                "lines": [[0, 1]],
                "natural_length": [50.0],
                "supports": [0],
            },
            "cable": {"law": "tension-only", "modulus": 1e6, "area": 1e-4, "density": 100.0},
            "point_mass": [{"node": 1, "mass": 1.0}],
            "load": [{"node": 1, "force": [0.0, 0.0, 0.0]}],
            "observe": [
                {"name": "x", "quantity": "displacement", "node": 1, "component": "x"},
                {"name": "v", "quantity": "velocity", "node": 1, "component": "x"},
            ],
            "output": {"interval": PERIOD},
            "solve": {"kind": "dynamic", "duration": duration, **keys},
            **tables,
        }
    )


def held(keys):
    """(Places found, exact places) of the mass in each period."""
    run, mass = refweb.start(scene(keys, PERIODS * PERIOD)), 1.0 + 0.5 * 100.0 * 1e-4 * 50.0
    x, v, exact = 0.0, 0.0, [0.0]
    while not run.stopped:
        run.set("load.0.force", [STIFFNESS * (TARGET - run.observe("x")) - DAMPING * run.observe("v"), 0.0, 0.0])
        push = (STIFFNESS * (TARGET - x) - DAMPING * v) / mass
        x, v = x + PERIOD * v + 0.5 * PERIOD**2 * push, v + PERIOD * push
        run.advance()
        exact.append(x)
    return run.history["x"], np.array(exact)


def turned():
    """(Angle, exact angle) of a drum after torques that change in each period."""
    drum = {
        "name": "drum",
        "shape": "sphere",
        "radius": 0.1,
        "mass": 2.0,
        "position": [0, 5, 0],
        "axle": {"direction": [0, 0, 1], "torque": 0.0},
    }
    angle = [{"name": "angle", "quantity": "axle_angle", "body": "drum"}]
    run = refweb.start(scene({}, len(TORQUES) * PERIOD, body=[drum], observe=angle))
    inertia, exact, speed = 0.4 * 2.0 * 0.1**2, 0.0, 0.0
    for torque in TORQUES:
        run.set("body.drum.axle.torque", torque)
        run.advance()
        exact, speed = exact + PERIOD * speed + 0.5 * PERIOD**2 * torque / inertia, speed + PERIOD * torque / inertia
    return run.observe("angle"), exact


def case(quick):
    rows = []
    for method, keys in METHODS.items():
        if quick and method == "ida":
            continue
        found, exact = held(keys)
        implicit = method in ("cvode", "ida")
        limit, reason = (1e-3, "each period begins with steps of order 1") if implicit else (1e-11, "rounding")
        off = float(np.abs(found - exact).max())
        rows.append(Row(f"held mass, {method}: largest error", off, 0.0, "exact", limit, reason, "m", scale=TARGET))
    angle, exact = turned()
    rows.append(Row("drum, angle after four torques", angle, exact, "exact", 1e-9, "rounding", "rad"))

    def drawn():
        page, plot = plots.axes("period", "x [m]")
        plot.plot(exact_places, **plots.REFERENCE)
        plot.plot(places, "o")
        return page

    places, exact_places = held(METHODS["central-difference"])
    return Case(rows=rows, figures=[Figure("A held mass: refweb (markers) on the exact places (line).", drawn)])
