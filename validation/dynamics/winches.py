"""Winches: a drum that winds up a rope, a lever on an axle, and lines that are reeled or wound with their mass.

A drum of radius R that turns by θ winds up R θ of a rope, which hangs from its side with a mass. Without friction the
moment on it is R times all weight that hangs. Elements of length h lie on it as chords, which stand out by (h/R)²/8 of
R.

A lever of mass M whose centre is at the arm a of an axle, with a rope of EA and natural length L from its end at 2a to
a point straight above, rests at the angle θ at which the energy of rope and weight is least.

A mass m on a line of ρA is whirled about a pin while the line is reeled in or paid out, its natural length L(t). Half
of the line's mass is at its end, and material leaves and comes through the pin, where it has no velocity:

    (m + ½ ρA L) v' = F − ½ ρA L' v,        so that the angular momentum about the pin stays.

Where L' jumps by ΔL', the material between pin and mass slides at another rate, and the mass m + ½ ρA L gets the
impulse −¼ ρA ΔL' r, r its place from the pin.

Two masses M turn at both ends of a line of as much mass as both, 2M = ρA L, in free space. It is reeled in by one of
them to half of its length, so slowly that it stays straight. With the acceleration a across the line of the mass that
reels, and the masses beyond it, m = M + ρA l, m₁ = M l + ½ρA l² and m₂ = M l² + ⅓ρA l³,

    (M + m) a + m₁ ω' = −2 l' ω m,      m₁ a + m₂ ω' = −2 l' ω m₁,

from which ω grows to 49/16 of what it was.

A load M hangs on a line that a winch pays out at a speed, or hauls in at a tension or a power, while its mass follows:

    (M + ½ρA L) v' = T − (M + ½ρA L) g − ½ρA L' v,      T = EA (l/L − 1),

with L' by the speed; L = l/(1 + T/EA) at a tension; or L' = −P/Y, Y = EA (ε + ½ε²), at a power.

The independent methods are DOP853 on these equations and a minimisation of the energy by Brent's method.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import refweb
from refweb.scene import Scene

from ..harness import plots
from ..harness.case import Case, Figure, Row

G = 9.81
REELED = ((0.0, 1.0), (0.4, 1.3), (1.0, 0.8))
DENSE, MASS, AXIAL, FAST = 0.5, 0.3, 1e3, 3.0
"""ρA [kg/m], m [kg], EA [N] and the speed across at the start [m/s]."""
LOAD, ROPE, HUNG = 2.0, 0.8, 1e4
"""M [kg], ρA [kg/m] and EA [N] of a load on a line of 3 m."""
WINCHES = {
    "lowered": {"speed": [[0.0, 0.0], [0.2, -0.6]]},
    "raised at a tension": {"tension": 40.0},
    "raised at a power": {"power": 40.0, "speed_limit": 20.0},
}
"""Winches of the line; none lets it go slack."""
METHODS = {
    "central-difference": dict(safety=0.1),
    "cvode": dict(method="cvode", rtol=1e-4),
    "ida": dict(method="ida", rtol=1e-4),
}


def whirled(keys):
    """Solution of a mass of `MASS` whirled on a line that is reeled."""
    return refweb.run(
        refweb.Scene(
            web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
            cable=refweb.Cable(law="linear", modulus=1e4 * AXIAL, area=1e-4, density=1e4 * DENSE),
            effects=[
                refweb.PointMass(node=1, mass=MASS),
                refweb.Velocity(node=1, value=(0.0, FAST, 0.0)),
                refweb.Reel(lines=0, factor=REELED, mass="follows"),
            ],
            solve=refweb.Dynamic(duration=1.0, **keys),
            output=refweb.Output(interval=0.02),
            observe=[
                refweb.Observe(name="x", quantity="position", node=1, component="x"),
                refweb.Observe(name="y", quantity="position", node=1, component="y"),
                refweb.Observe(name="speed", quantity="velocity", node=1),
            ],
        )
    )


def path(times):
    """Place and velocity of the mass by DOP853, shape (4, times)."""
    knots, factors = np.transpose(REELED)

    def rate(t, y, slope, at, before):
        natural = before + slope * (t - at)
        length = np.hypot(*y[:2])
        force = -AXIAL * (length / natural - 1.0) * y[:2] / length - 0.5 * DENSE * slope * y[2:]
        return np.concatenate([y[2:], force / (MASS + 0.5 * DENSE * natural)])

    y, found, before = np.array([1.0, 0.0, 0.0, FAST]), [], 0.0
    for a, b, f, g in zip(knots, knots[1:], factors, factors[1:], strict=False):
        y[2:] -= 0.25 * DENSE * ((g - f) / (b - a) - before) * y[:2] / (MASS + 0.5 * DENSE * f)
        before = (g - f) / (b - a)
        run = solve_ivp(
            rate, (a, b), y, "DOP853", dense_output=True, args=((g - f) / (b - a), a, f), rtol=1e-12, atol=1e-13
        )
        inside = times[(times >= a) & ((times < b) | (b == knots[-1]))]
        found += [run.sol(t) for t in inside]
        y = run.y[:, -1]
    found[-1][2:] += 0.25 * DENSE * before * y[:2] / (MASS + 0.5 * DENSE * factors[-1])  # the reel stops there
    return np.array(found).T


def turned():
    """Angular velocity of two masses of 5 kg on a line of 10 kg and 10 m that turned by 1 rad/s before."""
    points = [[10.0 * n / 16.0, 0, 0] for n in range(17)]
    solution = refweb.run(
        refweb.Scene(
            web=refweb.Inline(points=points, lines=[[n, n + 1] for n in range(16)], supports=[]),
            cable=refweb.Cable(law="linear", modulus=1e10, area=1e-4, density=1e4),
            effects=[
                *(refweb.PointMass(node=n, mass=5.0) for n in (0, 16)),
                refweb.Velocity(node="all", spin=(0.0, 0.0, 1.0)),
                refweb.Reel(lines="all", factor=((0.0, 1.0), (100.0, 0.5)), mass="follows", drum=0),
            ],
            solve=refweb.Dynamic(duration=100.0),
            output=refweb.Output(interval=1.0),
            accuracy=refweb.Accuracy(error="none"),
        )
    )
    away, speed = np.diff(solution.positions[[0, -1]], axis=0)[0], solution.state.v[16] - solution.state.v[0]
    return np.cross(away, speed)[2] / (away @ away)


def hauled(winch, keys):
    """(Way of the load by refweb, by DOP853) until 0.5 s, which begins with the tension of its weight."""
    stretch = 1.0 + (LOAD + 1.5 * ROPE) * G / HUNG
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [0, 0, -3]], lines=[[0, 1]], natural_length=[3.0 / stretch], supports=[0]),
        cable=refweb.Cable(law="tension-only", modulus=HUNG / 1e-5, area=1e-5, density=ROPE / 1e-5),
        effects=[
            refweb.PointMass(node=1, mass=LOAD),
            refweb.Gravity(acceleration=(0.0, 0.0, -G)),
            refweb.Winch(lines=0, mass="follows", **winch),
        ],
        solve=refweb.Dynamic(duration=0.5, **keys),
        observe=[refweb.Observe(name="way", quantity="displacement", node=1, component="z")],
    )

    def rate(t, y):
        length = 3.0 - y[0]
        if "tension" in winch:
            natural, growth = length / (1.0 + winch["tension"] / HUNG), -y[1] / (1.0 + winch["tension"] / HUNG)
        else:
            natural = y[2]
        strain = length / natural - 1.0
        if "power" in winch:
            growth = -winch["power"] / (HUNG * (strain + 0.5 * strain**2))
        elif "speed" in winch:
            growth = -np.interp(t, *np.transpose(winch["speed"]))
        mass = LOAD + 0.5 * ROPE * natural
        return [y[1], (HUNG * strain - mass * G - 0.5 * ROPE * growth * y[1]) / mass, growth]

    exact = solve_ivp(rate, (0.0, 0.5), [0.0, 0.0, 3.0 / stretch], "DOP853", rtol=1e-11, atol=1e-13, max_step=1e-3)
    return refweb.run(scene).results["way"], exact.y[0, -1]


def lever(torque):
    """(Solution, angle by a minimisation) of the lever, with a torque about its axle [N m]."""
    arm, natural, mass = 0.5, 0.9, 2.0
    scene = refweb.Scene(
        web=refweb.Inline(points=[[1, 0, 1], [1, 0, 0]], lines=[[0, 1]], natural_length=[natural], supports=[0]),
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=0.0),
        effects=[
            refweb.Gravity(acceleration=(0.0, 0.0, -G)),
            refweb.Body(
                name="lever", shape="box", size=(1.0, 0.2, 0.1), mass=mass, position=(arm, 0, 0),
                axle={"point": [0, 0, 0], "direction": [0, 1, 0], "torque": torque},
            ),
            refweb.Attach(body="lever", node=1),
        ],
        observe=[refweb.Observe(name="angle", quantity="axle_angle", body="lever")],
    )  # fmt: skip

    def energy(angle):
        end = np.array([np.cos(angle), -np.sin(angle)])
        stretch = max(np.hypot(*(end - [1.0, 1.0])) - natural, 0.0)
        return 0.5 * 100.0 / natural * stretch**2 + mass * G * arm * end[1] - torque * angle

    least = minimize_scalar(energy, bounds=(-0.5, 0.8), method="bounded", options={"xatol": 1e-10})
    return refweb.run(scene), least.x


def case(quick):
    rows = []
    drum = refweb.run(Scene.load("winch-drum")).results
    radius, angle, piece = 0.1, 2.0, 0.02
    out = (piece / radius) ** 2 / 8.0
    hanging = 1.0 - radius * angle
    reason = "chords on the drum stand out by (h/R)²/8 of R, and contact gives way by 0.26 mm"
    pull = G * (5.0 + 1150.0 * 7e-6 * hanging)
    height = radius * angle - (1.0 + pull / (3e9 * 7e-6))
    given = dict(unit="m", error=drum["height"].error, scale=radius * angle)
    rows.append(Row("drum, height", drum["height"].value, height, "R θ", out, reason, **given))
    rows.append(Row("drum, moment", drum["moment"].value, -radius * pull, "R times the weight", out, reason, "N m"))
    for torque in (0.0, 3.0):
        solution, exact = lever(torque)
        result, reason = solution.results["angle"], "roots of rounding of the energy"
        rows.append(Row(f"lever, {torque:g} N m", result.value, exact, "Brent", 1e-7, reason, "rad", result.error, 1.0))
    spun = refweb.run(Scene.load("reeled-tether")).results["across"]
    ends = np.array([0.2, 0.4, 0.6, 0.8, 1.0])
    moments = [2.0 * L**2 + 0.03 * L / 100.0 * L**2 * (ends**2 @ [1, 1, 1, 1, 0.5]) for L in (100.0, 80.0)]
    reason = "the moment of inertia has the square of a strain of 1.8e-3"
    exact = 0.05 * moments[0] / moments[1] * 80.0
    rows.append(Row("tether, speed of its end", spun.value, exact, "angular momentum", 4e-3, reason, "m/s", spun.error))
    reason = "the line is strained by 2e-4, and Coriolis forces bend it"
    rows.append(Row("pair, angular velocity", turned(), 49.0 / 16.0, "closed form", 2e-3, reason, "rad/s"))
    runs = {name: whirled(keys) for name, keys in METHODS.items() if not quick or name != "ida"}
    for name, winch in WINCHES.items():
        for method in METHODS if not quick else ["central-difference"]:
            found, exact = hauled(winch, METHODS[method])
            given = dict(unit="m", error=found.error, covered=True)
            label = f"load {name}, way by {method}"
            rows.append(Row(label, found.value, exact, "DOP853", 2e-2, "± of the method covers it", **given))
    end = path(np.array([1.0]))[:, 0]
    exact = {"x": end[0], "y": end[1], "speed": np.hypot(*end[2:])}
    reason = "± of the method covers it, at these tolerances"
    for method, solution in runs.items():
        for name, value in exact.items():
            result, scale, unit = solution.results[name], *((FAST, "m/s") if name == "speed" else (1.0, "m"))
            given = dict(unit=unit, error=result.error, scale=scale, covered=True)
            rows.append(Row(f"whirled mass, {name} by {method}", result.value, value, "DOP853", 2e-2, reason, **given))

    def drawn():
        page, plot = plots.axes("x [m]", "y [m]")
        fine = path(np.linspace(0.0, 1.0, 400))
        plot.plot(*fine[:2], **plots.REFERENCE)
        history = runs["cvode"].history
        plot.plot(history["x"], history["y"], "o")
        plot.set_aspect("equal")
        return page

    return Case(rows=rows, figures=[Figure("Path of the whirled mass: refweb (markers) on DOP853 (line).", drawn)])
