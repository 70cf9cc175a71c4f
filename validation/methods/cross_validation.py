"""Every impact by three methods.

Central differences (explicit, fixed steps from a bound of stability), CVODE (Adams methods of order 1 to 12) and IDA
(BDF of order 2 on the residual) share forces and tangents, nothing else. Each run of a shipped impact brings an error
with every observable, from a second run of its own at a neighbouring accuracy; two methods have to agree within the sum
of theirs. The errors of peaks of stress are large because a peak is the highest of many waves that meet, and which one
that is changes with every digit.

Effects that no impact has stand in a small thrown net, an orbit much faster than any among them, so that it shows, a
box that tumbles into it, one that is tied to its middle, one on an axle, one that falls on a ball, a ball that is
pressed into it, a line that is reeled in with its mass, a thread through six of its nodes, and lines so weak that some
break; two strings are thrown at each other. The three methods have to agree as well, on which lines break, and when.

Where nothing is hit there are digits to compare: 1 kg thrown at 1 m/s from the centre of a square web (smooth law,
η = 1e-4). Central differences of two step sizes, extrapolated by their order 2, CVODE at rtol = 1e-10 and the explicit
Runge–Kutta method DOP853 of scipy (E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I,
2nd ed. 1993, doi:10.1007/978-3-540-78862-1) at rtol = 1e-12 have to agree to nine digits.

A node that a body carries is eliminated by all of refweb's methods. So the box that is tied to the net is compared with
one whose node has a mass of its own and is held by constraints with multipliers.
"""

import itertools

import numpy as np
from scipy.integrate import solve_ivp

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.cvode import Cvode
from refweb.scene import Scene

from ..harness import plots
from ..harness.case import Case, Figure, Row
from .as_constraint import Tied

IMPACTS = ("square-impact", "triangle-impact", "hexagon-impact", "square-oblique-impact")
METHODS = {
    "central-difference": dict(method="central-difference", safety=0.25),
    "cvode": dict(method="cvode", family="adams", rtol=1e-5),
    "ida": dict(method="ida", rtol=1e-4),
}
QUICK = {
    "central-difference": dict(method="central-difference"),
    "cvode": dict(method="cvode", family="adams", rtol=1e-4),
    "ida": dict(method="ida", rtol=1e-3),
}
"""Keys of [solve] for each method; the quick ones on a shorter run."""
SMALL = {
    "web": {"kind": "window", "mesh": "square", "rows": 3, "columns": 3, "side": 0.5},
    "cable": {"law": "smooth", "smoothing": 1e-3, "modulus": 1e6, "area": 1e-5, "density": 1000.0, "prestrain": 0.01},
    "velocity": [{"node": "centre", "value": [0.2, -0.1, 1.0]}],
    "solve": {"kind": "dynamic", "duration": 0.3},
    "output": {"interval": 0.01},
    "observe": [
        {"name": "deflection", "quantity": "displacement", "reduce": "max"},
        {"name": "height", "quantity": "displacement", "node": "centre", "component": "z"},
    ],
}
BOX = {"name": "box", "shape": "box", "size": [0.3, 0.2, 0.15], "rounding": 0.03, "mass": 0.3}
BOX |= {"angular_velocity": [3.0, -2.0, 1.0], "velocity": [0.0, 0.0, -1.0]}
ANGLE = {"name": "angle", "quantity": "orientation", "body": "box"}
CURVE = [[0.002, 0.0], [0.015, 4e3], [0.03, 2e4], [0.1, 1e5]]
"""A rope that is soft at first."""
TIED = "a box tied to its middle"
EFFECTS = {
    "[orbit]": {"orbit": {"mean_motion": 2.0}},
    "[drag]": {"drag": {"density": 100.0, "wind": [0.5, 0.0, 0.0]}},
    "[rupture]": {"rupture": {"strength": 2.3e4}},
    "a line that is reeled in with its mass": {
        "reel": [{"lines": 0, "factor": [[0.0, 1.0], [0.2, 0.9], [0.3, 1.0]], "mass": "follows"}],
        "gravity": {"acceleration": [0.0, 0.0, -9.81]},
    },
    "a thread through rings on it": {
        "thread": [
            {"name": "rope", "nodes": [0, 3, 4, 8, 7, 11], "modulus": 1e6, "area": 1e-5, "density": 1000.0},
        ],
        "observe": [*SMALL["observe"], {"name": "rope", "quantity": "length", "thread": "rope", "reduce": "max"}],
    },
    "a ball that is pressed into it": {
        "body": [{"name": "press", "radius": 0.3, "position": [0.0, 0.0, 0.32]}],
        "motion": [{"body": "press", "displacement": [[0.0, 0.0, 0.0, 0.0], [0.3, 0.0, 0.0, -0.3]]}],
        "contact": {"stiffness": 300.0},
        "observe": [
            *SMALL["observe"],
            {"name": "push", "quantity": "support_force", "body": "press", "component": "z", "average": 0.05}
            | {"reduce": "min"},
        ],
    },
    "a box on an axle that is tied to it": {
        "body": [
            {key: BOX[key] for key in ("name", "shape", "size", "mass")}
            | {"position": [0.0, 0.0, -0.2], "axle": {"point": [0.0, 0.0, -0.3], "direction": [0.0, 1.0, 0.0]}}
        ],
        "attach": [{"body": "box", "node": "centre"}],
        "velocity": [{"node": "all", "value": [0.0, 0.0, 0.0]}],
        "load": [{"node": 3, "force": [1.0, 0.0, 2.0]}],
        "observe": [*SMALL["observe"][:1], {"name": "turned", "quantity": "axle_angle", "body": "box"}],
    },
    'law = "table"': {
        "cable": {"law": "table", "stress": CURVE, "area": 1e-5, "density": 1000.0, "prestrain": 0.01},
        "damping": {"time": 1e-4},
    },
    "elastic-plastic": {
        "cable": {key: value for key, value in SMALL["cable"].items() if key != "smoothing"}
        | {"law": "elastic-plastic", "yield_stress": 1.5e4, "hardening": 1e5},
        "observe": [*SMALL["observe"], {"name": "lost", "quantity": "plastic_energy"}],
    },
    "[cable.viscous]": {
        "cable": SMALL["cable"] | {"viscous": {"arms": [[1e6, 0.05], [5e5, 0.5]]}},
        "observe": [*SMALL["observe"], {"name": "lost", "quantity": "dissipated_energy"}],
    },
    "a box that tumbles into it": {
        "body": [BOX | {"position": [0.1, 0.03, 0.15]}],
        "contact": {"stiffness": 300.0},
        "observe": [*SMALL["observe"], ANGLE],
    },
    TIED: {
        "body": [BOX | {"position": [0.2, 0.1, -0.2]}],
        "attach": [{"body": "box", "node": "centre"}],
        "velocity": [{"node": "all", "value": [0.0, 0.0, 0.5]}],
        "observe": [*SMALL["observe"], ANGLE],
    },
    "strings that are thrown at each other": {
        "web": {
            "kind": "inline",
            "points": [
                *([x, 0.0, 0.0] for x in (-0.5, -0.1, 0.12, 0.5)),
                *([0.01, y, 0.03] for y in (-0.5, -0.12, 0.1, 0.5)),
            ],
            "lines": [[0, 1], [1, 2], [2, 3], [4, 5], [5, 6], [6, 7]],
            "supports": [0, 3, 4, 7],
        },
        "velocity": [{"node": [5, 6], "value": [0.3, 0.1, -1.0]}],
        "self_contact": {"radius": 0.01, "stiffness": 300.0, "friction": 0.3, "slip_velocity": 0.05, "damping": 0.5},
        "observe": [
            {"name": "deflection", "quantity": "displacement", "reduce": "max"},
            {"name": "height", "quantity": "displacement", "node": 5, "component": "z"},
            {"name": "across", "quantity": "displacement", "node": 5, "component": "x"},
        ],
    },
    "a box that falls on a ball beside it": {
        "body": [
            BOX | {"position": [2.0, 0.03, 0.17]},
            {"name": "ball", "radius": 0.1, "mass": 0.5, "position": [2.0, 0.0, -0.05]},
        ],
        "contact": {"stiffness": 300.0, "friction": 0.3, "slip_velocity": 0.1, "between_bodies": True},
        "observe": [*SMALL["observe"], ANGLE, {"name": "lost", "quantity": "dissipated_energy"}],
    },
    "a box tied to its middle that rubs on it": {
        "body": [BOX | {"position": [0.1, 0.05, 0.2]}],
        "attach": [{"body": "box", "node": "centre"}],
        "velocity": [{"node": "all", "value": [0.0, 0.0, 0.5]}],
        "contact": {"stiffness": 300.0, "friction": 0.3, "damping": 0.1, "slip_velocity": 0.1},
        "observe": [*SMALL["observe"], ANGLE, {"name": "lost", "quantity": "dissipated_energy"}],
    },
}
"""The small net, and what it has one at a time."""
END = 0.03
"""Duration of the quick impact [s]: the ball has hit, and the centre follows it."""


def solutions(name, quick):
    """Solutions of an impact by method."""
    scene, found = Scene.load(name), {}
    for method, keys in (QUICK if quick else METHODS).items():
        solve = refweb.Dynamic(duration=END if quick else scene.solve.duration, **keys)
        found[method] = refweb.run(scene.replace(solve=solve))
    return found


def with_effect(name, quick):
    """Solutions of the small net with an effect by method."""
    own = Scene.from_dict(SMALL | EFFECTS[name])
    keys = {**QUICK, "ida": dict(method="ida", rtol=1e-4)} if quick else METHODS
    return {method: refweb.run(own.replace(solve=refweb.Dynamic(duration=0.3, **k))) for method, k in keys.items()}


def compared(name, found):
    """Rows for each pair of methods and each observable."""
    for first, second in itertools.combinations(found, 2):
        for key, one in found[first].results.items():
            other = found[second].results[key]
            yield Row(
                f"{name}, {key} by {first}",
                one.value,
                other.value,
                second,
                (one.error + other.error) / abs(other.value),
                f"± {one.error:.2g} and ± {other.error:.2g}, added",
                one.unit,
                one.error,
            )


def broken(name, found):
    """Rows for the breaks of each pair of methods: which lines they are, in their order, and when."""
    for first, second in itertools.combinations(found, 2):
        one, other = (found[method].breaks for method in (first, second))
        same = [b["line"] for b in one] == [b["line"] for b in other]
        row = f"{name}, lines that break as by the other, by {first}"
        yield Row(row, len(one) if same else -1, len(other), second, 0.0, "the same lines in the same order")
        for n, (a, b) in enumerate(zip(one, other, strict=False) if same else (), 1):
            yield Row(
                f"{name}, break {n} by {first}",
                a["time"],
                b["time"],
                second,
                (a["error"] + b["error"]) / b["time"],
                f"± {a['error']:.2g} and ± {b['error']:.2g}, added",
                "s",
                a["error"],
            )


def by_central_differences(system, steps, end, node):
    """Height of a node [m] after so many steps and after twice as many, extrapolated."""
    found = []
    for count in (steps, 2 * steps):
        solver = CentralDifference(system, step_size=end / count * (1 + 1e-12))
        run = solver.start()
        solver.advance(run, [end])
        found.append(run.x[node, 2])
    return (4 * found[1] - found[0]) / 3


def by_cvode(system, end, node):
    """Height of a node [m] by Adams methods at rtol = 1e-10."""
    solver = Cvode(system, family="adams", rtol=1e-10)
    run = solver.start()
    solver.advance(run, [end])
    return run.x[node, 2]


def by_dop853(system, end, node):
    """Height of a node [m] by DOP853 at rtol = 1e-12."""
    free, n = system.free, len(system.free)
    mass = np.repeat(system.net.mass, 3)[free]

    def placed(unknowns):
        rows = np.zeros((system.rows, 3))
        rows.ravel()[free] = unknowns
        return rows

    def rate(t, y):
        return np.concatenate([y[n:], system.force(t, placed(y[:n]), placed(y[n:])).ravel()[free] / mass])

    start = np.concatenate([np.zeros(n), system.initial_velocity().ravel()[free]])
    y = solve_ivp(rate, (0, end), start, "DOP853", t_eval=[end], rtol=1e-12, atol=1e-14).y[:, 0]
    return placed(y[:n])[node, 2]


def digits(quick):
    """Rows that compare the height of a thrown mass."""
    if quick:
        web, end, steps = refweb.Window(mesh="square", rows=8, columns=8, side=0.0646), 0.05, 8000
    else:
        web, end, steps = refweb.Paper(mesh="square", cable_length=201.4), 0.25, 12000
    system = refweb.Scene(
        web=web,
        cable=refweb.Cable(law="smooth", smoothing=1e-4, modulus=7e7, area=1e-4, density=200.0),
        effects=[refweb.PointMass(node="centre", mass=1.0), refweb.Velocity(node="centre", value=(0.0, 0.0, 1.0))],
        solve=refweb.Dynamic(duration=end),
    ).build()
    node = system.net.web.centre
    found = {
        f"central differences, {steps} and {2 * steps} steps": by_central_differences(system, steps, end, node),
        "CVODE, rtol = 1e-10": by_cvode(system, end, node),
        "DOP853, rtol = 1e-12": by_dop853(system, end, node),
    }
    for first, second in itertools.combinations(found, 2):
        name = f"thrown mass after {end} s, {first}"
        yield Row(name, found[first], found[second], second, 1e-9, "nine digits are asked for", "m")


def tied(quick):
    """Rows that compare the box tied to the net with one that constraints of its own tie, by IDA."""
    scene = Scene.from_dict(SMALL | EFFECTS[TIED])
    end, keys = (0.05 if quick else 0.1), dict(method="explicit", order=6, safety=0.1)
    solve = refweb.Dynamic(duration=end, **keys)
    own = refweb.run(scene.replace(solve=solve, accuracy=refweb.Accuracy(error="none"))).state
    other = Tied(scene)
    x, v, *_ = other.solve(end, 1e-10)
    body = own.system.net.bodies[0]
    here, there = body.rotation(own.x), other.body.rotation(x)
    most = [np.linalg.norm(one[: own.system.net.nodes], axis=1).max() for one in (own.x, x)]
    centre = own.system.net.web.centre
    found = {
        "height of the centre": (own.x[centre, 2], x[centre, 2], "m"),
        "largest displacement": (*most, "m"),
        "first entry of the rotation of the box": (here[0, 0], there[0, 0], "1"),
        "its angular velocity about z": (body.turning(own.x, own.v)[2], other.body.turning(x, v)[2], "rad/s"),
    }
    for name, (value, reference, unit) in found.items():
        source = "constraints with multipliers by IDA, rtol = 1e-10"
        yield Row(f"{TIED}, {name} after {end} s", value, reference, source, 1e-6, "six digits are asked for", unit)


def drawing(name, found):
    """Deflection over time by each method."""
    page, plot = plots.axes("time [s]", "deflection [mm]")
    for (method, solution), style in zip(found.items(), ("-", "--", ":"), strict=True):
        plot.plot(solution.history["time"], 1e3 * np.asarray(solution.history["deflection"]), style, label=method)
    plot.set_title(name)
    plot.legend(frameon=False)
    return page


def case(quick):
    rows, figures = [*digits(quick), *tied(quick)], []
    for name in EFFECTS:
        found = with_effect(name, quick)
        rows += compared(f"net with {name}", found)
        if name == "[rupture]":
            rows += broken(f"net with {name}", found)
    for name in IMPACTS[:1] if quick else IMPACTS:
        found = solutions(name, quick)
        rows += compared(name, found)
        figures.append(Figure(f"{name}: three methods, one curve.", lambda n=name, f=found: drawing(n, f)))
    return Case(rows=rows, figures=figures)
