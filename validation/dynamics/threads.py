"""Threads through rings: Atwood's machine, a tackle, and a ring that swings on an ellipse.

Two masses on a thread over pulleys without friction move with (m₁ − m₂)/(m₁ + m₂) g.

A load that hangs on n strands of one thread pulls it with W/n.

A ring on a slack thread of length 2a between two points that are 2c apart moves on an ellipse with the half axes a and
b = √(a² − c²). With x = a sin φ and z = −b cos φ its period from rest at φ₀ is

    4 ∫ √((a² cos² φ + b² sin² φ)/(2 g b (cos φ − cos φ₀))) dφ        from 0 to φ₀.
"""

import numpy as np
from scipy.integrate import quad

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row

G, EA = 9.81, 1e4
METHODS = {
    "central-difference": {"safety": 0.1},
    "order 4": {"method": "explicit", "order": 4},
    "cvode": {"method": "cvode", "rtol": 1e-6},
    "ida": {"method": "ida", "rtol": 1e-6},
}
HALF, FOCUS, START = 1.0, 0.6, 0.5
"""a [m], c [m] and φ₀ of the ellipse."""


def on_thread(points, supports, thread, masses, solve, observe, **tables):
    """Solution of masses on a thread; the one line of the web lies aside."""
    far = len(points)
    return refweb.run(
        refweb.Scene.from_dict(
            {
                "web": {"kind": "inline", "points": [*points, [50, 0, 0], [51, 0, 0]], "lines": [[far, far + 1]]},
                "supports": {"nodes": [*supports, far, far + 1]},
                "cable": {"law": "tension-only", "modulus": 1e9, "area": 1e-5, "density": 0.0},
                "gravity": {"acceleration": [0.0, 0.0, -G]},
                "thread": [{"name": "rope", "modulus": EA / 1e-5, "area": 1e-5, "density": 0.0, **thread}],
                "point_mass": [{"node": node, "mass": mass} for node, mass in masses.items()],
                "observe": observe,
                "solve": solve,
                **tables,
            }
        )
    )


def fall(keys, heavy, light):
    """Way of the lighter mass of Atwood's machine after 0.3 s."""
    pull = 2.0 * heavy * light * G / (heavy + light)
    points = [[0, 0, 0], [0.5, 0, 0.2], [1, 0, 0], [0, 0, -1.0], [1, 0, -1.5]]
    observe = [{"name": "way", "quantity": "displacement", "node": 4, "component": "z"}]
    thread = {"nodes": [3, 0, 1, 2, 4], "prestrain": pull / EA}
    solve = {"kind": "dynamic", "duration": 0.3, **keys}
    return on_thread(points, [0, 1, 2], thread, {3: heavy, 4: light}, solve, observe).results["way"]


def tackle(strands):
    """Pull of a thread that carries 5 kg on so many strands."""
    observe = [{"name": "pull", "quantity": "tension", "thread": "rope"}]
    nodes = ([0, 1] * strands)[: strands + 1]
    return on_thread([[0, 0, 0], [0, 0, -1]], [0], {"nodes": nodes}, {1: 5.0}, {"kind": "static"}, observe).results[
        "pull"
    ]


def period():
    """Period of the ring, by quadrature in s with φ = φ₀ sin s."""
    low = np.sqrt(HALF**2 - FOCUS**2)

    def slowness(s):
        phi = START * np.sin(s)
        way = (HALF * np.cos(phi)) ** 2 + (low * np.sin(phi)) ** 2
        return np.sqrt(way / (2.0 * G * low * (np.cos(phi) - np.cos(START)))) * START * np.cos(s)

    return 4.0 * quad(slowness, 0.0, 0.5 * np.pi * (1.0 - 1e-7))[0]


def swing(duration):
    """History of the ring over a time."""
    place = [HALF * np.sin(START), 0.0, -np.sqrt(HALF**2 - FOCUS**2) * np.cos(START)]
    points = [[-FOCUS, 0, 0], [FOCUS, 0, 0], place]
    thread = {"nodes": [0, 2, 1], "length": 2.0 * HALF, "modulus": 1e11}
    solve = {"kind": "dynamic", "duration": duration, "method": "explicit", "order": 4}
    observe = [{"name": axis, "quantity": "position", "node": 2, "component": axis} for axis in "xz"]
    return on_thread(points, [0, 1], thread, {2: 1.0}, solve, observe, output={"interval": duration / 24}).history


def case(quick):
    rows = []
    heavy, light = 3.0, 1.0
    exact = 0.5 * (heavy - light) / (heavy + light) * G * 0.3**2
    for method, keys in METHODS.items():
        if quick and method == "ida":
            continue
        way = fall(keys, heavy, light)
        given = dict(unit="m", error=way.error, covered=True)
        reason = "± of the method covers it, at these tolerances"
        rows.append(Row(f"Atwood's machine, way by {method}", way.value, exact, "closed form", 1e-4, reason, **given))
    for strands in (2, 3, 6):
        pull, reason = tackle(strands), "a residual of 1e-10 of the load"
        rows.append(
            Row(f"tackle of {strands} strands", pull.value, 5.0 * G / strands, "W/n", 1e-8, reason, "N", pull.error)
        )
    duration = period()
    history, place = swing(duration), HALF * np.sin(START)
    reason = "the thread stretches by T/EA = 1e-5, and the period by half of that"
    for part, value in ((0, place), (12, -place), (24, place)):
        title = f"ring on an ellipse, x after {part}/24 of the period"
        rows.append(Row(title, history["x"][part], value, "quadrature", 1e-4, reason, "m"))

    def drawn():
        page, plot = plots.axes("x [m]", "z [m]")
        phi = np.linspace(-START, START, 200)
        plot.plot(HALF * np.sin(phi), -np.sqrt(HALF**2 - FOCUS**2) * np.cos(phi), **plots.REFERENCE)
        plot.plot(history["x"], history["z"], "o")
        plot.set_aspect("equal")
        return page

    return Case(rows=rows, figures=[Figure("A ring on a slack thread: refweb (markers) on the ellipse (line).", drawn)])
