"""Ropes as they are sold: a measured curve, arms that relax, a line that yields, and a brake.

A weight that pulls with the tension of a point of a measured curve stretches the rope to the strain of that point,
since the interpolant passes through all points.

A rope of EA with Maxwell arms EAᵢ, τᵢ that is held at a strain ε from the start has the tension

    T = ε (EA + Σ EAᵢ exp(−t/τᵢ)).

Three lines of natural lengths 1, 2 and 4 m hang beside each other and carry one node. The first yields at the stress Y
without hardening. At a displacement d behind that the load is A (Y + E d/2 + E d/4).

A mass m comes with the speed v to a brake, a line that pays out at the force F. It stops after m v²/2F, the elastic
stretch F/k, and less by half of that for the energy that the stretch stores. The rest of the energy is lost in the
line.
"""

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row

AREA, EA = 1e-4, 100.0
ARMS = ((150.0, 0.03), (50.0, 0.3))
"""EA [N] and τ [s] of the arms."""
CURVE = [[0.0, 0.0], [0.01, 2e5], [0.02, 1e6], [0.03, 3e6]]
"""Strain and stress [Pa] of a rope that gets stiffer."""
FORCE, MASS, SPEED = 10.0, 2.0, 1.5
"""Force of the brake [N], mass [kg] and its speed [m/s]."""
MODULUS, YIELD = 1e7, 1e5
METHODS = {
    "central-difference": dict(safety=0.02),
    "cvode": dict(method="cvode", rtol=1e-6),
    "ida": dict(method="ida", rtol=1e-6),
}


def along(lines, points, supports, cable, effects, solve=None, **tables):
    """Solution of points on the x axis."""
    web = refweb.Inline(points=[[x, 0.0, 0.0] for x in points], lines=lines, supports=supports)
    given = {} if solve is None else {"solve": refweb.Dynamic(**solve)}
    return refweb.run(refweb.Scene(web=web, cable=refweb.Cable(area=AREA, **cable), effects=effects, **given, **tables))


def measured(strain, stress):
    """Stretch of 1 m of a rope with `CURVE` under A times a stress."""
    effects = [refweb.Load(node=1, force=(AREA * stress, 0.0, 0.0))]
    solution = along([[0, 1]], [0.0, 1.0], [0], {"law": "table", "stress": CURVE, "density": 0.0}, effects)
    return solution.displacement[1, 0]


def relaxed(strain, times):
    """Tensions of a rope with `ARMS` that is held at a strain."""
    arms = refweb.Viscous(arms=[(ea / AREA, tau) for ea, tau in ARMS], statics="short")
    cable = {"law": "tension-only", "modulus": EA / AREA, "density": 1.0, "prestrain": strain, "viscous": arms}
    observe = [refweb.Observe(name="pull", quantity="tension", line=0)]
    step = float(times[1] - times[0])
    solve = dict(duration=float(times[-1]))
    output = refweb.Output(interval=step)
    history = along([[0, 1], [1, 2]], [0.0, 0.5, 1.0], [0, 2], cable, [], solve, output=output, observe=observe).history
    return history["pull"]


def side_by_side(load):
    """Displacement of a node on three lines of which the shortest yields."""
    cable = {"law": "elastic-plastic", "modulus": MODULUS, "density": 0.0, "yield_stress": YIELD, "hardening": 0.0}
    effects = [refweb.Load(node=3, force=(load, 0.0, 0.0))]
    solution = along([[0, 3], [1, 3], [2, 3]], [0.0, -1.0, -3.0, 1.0], [0, 1, 2], cable, effects)
    return solution.displacement[3, 0]


def braked(keys, duration):
    """Solution of a mass that comes to a brake."""
    cable = {"law": "elastic-plastic", "modulus": MODULUS, "density": 0.0, "yield_stress": FORCE / AREA}
    effects = [refweb.PointMass(node=1, mass=MASS), refweb.Velocity(node=1, value=(SPEED, 0.0, 0.0))]
    observe = [
        refweb.Observe(name="way", quantity="displacement", node=1, component="x", reduce="max"),
        refweb.Observe(name="lost", quantity="plastic_energy"),
    ]
    solve = dict(duration=duration, **keys)
    output = refweb.Output(interval=duration / 100)
    cable["hardening"] = 0.0
    return along([[0, 1]], [0.0, 1.0], [0], cable, effects, solve, output=output, observe=observe)


def case(quick):
    rows = []
    for strain, stress in CURVE[1:-1]:
        title, reason = f"measured curve, strain at {stress:g} Pa", "a residual of 1e-10 of the load"
        rows.append(Row(title, measured(strain, stress), strain, "a point of the curve", 1e-8, reason))
    times, strain = np.linspace(0.0, 0.4, 9), 0.02
    exact = strain * sum((ea * np.exp(-times / tau) for ea, tau in ARMS), np.full(len(times), EA))
    found = relaxed(strain, times)
    for at in (0, 2, 8):
        title = f"relaxation, tension after {times[at]:.2g} s"
        rows.append(Row(title, found[at], exact[at], "closed form", 1e-9, "arms are exact in explicit steps", "N"))
    for way in (0.012, 0.018):
        load = AREA * (YIELD + MODULUS * way * (1 / 2 + 1 / 4))
        title, reason = f"three lines under {load:.4g} N, displacement", "a residual of 1e-10 of the load"
        rows.append(Row(title, side_by_side(load), way, "closed form", 1e-8, reason, "m"))
    stretch = FORCE / (MODULUS * AREA)
    way = stretch + (0.5 * MASS * SPEED**2 - 0.5 * FORCE * stretch) / FORCE
    duration = 2.2 * way / SPEED
    runs = {name: braked(keys, duration) for name, keys in METHODS.items() if not quick or name != "ida"}
    for method, solution in runs.items():
        for name, value, unit in (("way", way, "m"), ("lost", FORCE * (way - stretch), "J")):
            result, reason = solution.results[name], "± of the method covers it, at these tolerances"
            given = dict(unit=unit, error=result.error, covered=True)
            rows.append(Row(f"brake, {name} by {method}", result.value, value, "m v²/2F", 1e-2, reason, **given))

    def drawn():
        page, plot = plots.axes("time [s]", "tension [N]")
        fine = np.linspace(0.0, times[-1], 400)
        plot.plot(fine, strain * (EA + sum(ea * np.exp(-fine / tau) for ea, tau in ARMS)), **plots.REFERENCE)
        plot.plot(times, found, "o")
        return page

    text = "Tension of a rope that is held: refweb (markers) on the closed form (line)."
    return Case(rows=rows, figures=[Figure(text, drawn)])
