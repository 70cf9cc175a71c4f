"""A hub keeps its spin by feedback while its arms are coiled off.

A hub that spins has four arms with masses of 1 kg at their tips, which it coils off from 0.5 to 2.5 m: ``refweb run
spin-up`` is the scene. Its torque is M = M₀ (1 − ω/ω₀), by which M. Gärdsback and G. Tibert lead the deployment of
spinning webs (J. Guid. Control Dyn. 32 (2009) 40–50), measured and set each 0.05 s. A model of three degrees of freedom
tells the motion: the angle θ of the hub, the angle ψ = θ + φ of the arms, and their length l, with the length L(t) that
is coiled off. With masses m at the shares s of an arm, A = Σ m, B = Σ m s, C = Σ m s², the hub's moment of inertia J
and radius R, and 4 arms of the tension N = EA max(l/L − 1, 0),

    (J + 4AR²) θ'' + 4BR (l'' sin φ + l ψ'' cos φ) = 4BR (l ψ'² sin φ − 2 l' ψ' cos φ) + M,
    4C l² ψ'' + 4BR l cos φ θ'' = −8C l l' ψ' − 4BR l θ'² sin φ,
    4C l'' + 4BR sin φ θ'' = 4C l ψ'² + 4BR cos φ θ'² − 4N.

These are Lagrange's equations of the masses; scipy's DOP853 solves them in each period. Arms are one line each, so that
the model is exact.
"""

import numpy as np
from scipy.integrate import solve_ivp

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict

RADIUS, HUB, TIP, LENGTH, LINE, AXIAL = 0.5, 50.0, 1.0, 2.5, 1.14e-3, 2e3
"""Radius [m] and mass of the hub, mass of each tip [kg], length of an arm [m], its mass [kg/m], and EA [N]."""
TORQUE, SPEED, PERIOD, START = 10.0, 2.0, 0.05, 0.501
"""M₀ [N m], ω₀ [rad/s], the period [s], and the length of the arms at the start [m]."""


def rates(coiled, moment):
    """Function of t and (θ, φ, l, θ', ψ', l') with their rates, of L as a table of time and a moment [N m]."""
    mass = np.array([0.5 * LINE * LENGTH, TIP + 0.5 * LINE * LENGTH])
    A, B = mass.sum(), mass[1]
    C, inertia, b = B, 0.5 * HUB * RADIUS**2 + 4.0 * A * RADIUS**2, 4.0 * B * RADIUS

    def found(t, y):
        _, phi, length, turn, swing, stretch = y
        sine, cosine = np.sin(phi), np.cos(phi)
        tension = AXIAL * max(length / (LENGTH * np.interp(t, *coiled)) - 1.0, 0.0)
        matrix = [
            [inertia, b * length * cosine, b * sine],
            [b * length * cosine, 4.0 * C * length**2, 0.0],
            [b * sine, 0.0, 4.0 * C],
        ]
        right = [
            b * (length * swing**2 * sine - 2.0 * stretch * swing * cosine) + moment,
            -8.0 * C * length * stretch * swing - b * length * turn**2 * sine,
            4.0 * C * length * swing**2 + b * cosine * turn**2 - 4.0 * tension,
        ]
        return [turn, swing - turn, stretch, *np.linalg.solve(matrix, right)]

    return found


def model(coiled, duration, held=True):
    """(Times, states (times, 6), moments) in each period; the moment follows ω at once unless it is ``held``."""
    y = np.array([0.0, 0.0, START, SPEED, SPEED, 0.0])
    states, moments = [y], []
    for n in range(round(duration / PERIOD)):
        moments.append(TORQUE * (1.0 - y[3] / SPEED))

        def rate(t, y, moment=moments[-1]):
            return rates(coiled, moment if held else TORQUE * (1.0 - y[3] / SPEED))(t, y)

        y = solve_ivp(rate, (n * PERIOD, (n + 1) * PERIOD), y, "DOP853", rtol=1e-10, atol=1e-11).y[:, -1]
        states.append(y)
    return PERIOD * np.arange(len(states)), np.array(states), np.array(moments)


def case(quick):
    scene = refweb.Scene.load("spin-up")
    (reel,) = (effect for effect in scene.effects if isinstance(effect, refweb.Reel))
    coiled = tuple(np.array(reel.factor).T)
    short, duration = 6.0, 6.0 if quick else scene.solve.duration
    times, states, moments = model(coiled, duration)
    source = "model of three degrees of freedom, DOP853"
    radius = np.sqrt(RADIUS**2 + states[:, 2] ** 2 + 2.0 * RADIUS * states[:, 2] * np.cos(states[:, 1]))
    rows, runs = [], {}
    methods = {"central differences": (duration, {"safety": scene.solve.safety})}
    methods |= {name: (short, dict(method=name.lower(), rtol=1e-6)) for name in ("CVODE", "IDA") if not quick}
    for name, (until, keys) in methods.items():
        run = runs[name] = refweb.run(scene.replace(solve=refweb.Dynamic(duration=until, **keys)))
        n, (control,) = round(until / PERIOD), run.controls
        for text, value, unit, result, error in (
            ("rate of the hub", states[n, 3], "rad/s", *run.results["hub_rate"][:2]),
            ("tip from the axis", radius[n], "m", *run.results["tip"][:2]),
            ("∫ M dt", PERIOD * np.abs(moments[:n]).sum(), "N m s", control["spent"], control["error"]),
        ):
            scale = TORQUE if unit == "N m s" else None  # that of one second
            rows.append(Row(f"{text} at {until:g} s, {name}", result, value, source, 1e-3, "steps, rtol", unit, error,
                            covered=True, scale=scale))  # fmt: skip
    run = runs["central differences"]
    apart = float(np.abs(run.history["hub_rate"] - states[:, 3]).max())
    rows.append(Row("rate of the hub, largest difference at any time", apart, 0.0, source, 2e-3, "steps", "rad/s",
                    scale=SPEED))  # fmt: skip
    end, work, given = states[-1], run.history["work"][-1], float((moments * np.diff(states[:, 0])).sum())
    at_once = model(coiled, duration, held=False)[1]
    spin, total = run.results["spin"], run.history["spin"][0] + PERIOD * moments.sum()
    lag = states[:, 1]
    verdicts = [
        Verdict(
            "What the hub is given is what hub and arms gain of angular momentum.",
            "holds",
            f"{spin.value:.4f} ± {spin.error:.1e} of {total:.4f} N m s",
            abs(spin.value - total) <= spin.error + 1e-9 * spin.value,
        ),
        Verdict(
            "The arms stay within a quarter turn of the hub's radius.",
            "holds",
            "they lag by at most {:.1f}° and lead by {:.1f}°".format(*np.degrees([-lag.min(), lag.max()])),
            np.abs(lag).max() < 0.5 * np.pi,
        ),
        Verdict(
            "A torque that is held in each period serves as one that follows at once.",
            "holds",
            f"rates of the hub differ by at most {np.abs(at_once[:, 3] - states[:, 3]).max():.1e} rad/s",
            np.abs(at_once[:, 3] - states[:, 3]).max() < 0.05 * SPEED,
        ),
    ]
    numbers = [
        ["rate of the hub at the end [rad/s]", f"{end[3]:.4f}"],
        ["length of the arms at the end [m]", f"{end[2]:.4f}"],
        ["angle of the arms at the end [°]", f"{np.degrees(end[1]):.2f}"],
        ["work of the torque [J]", f"{given:.3f}; with that of coiling off {work:.3f}"],
    ]

    def drawn():
        page, (left, middle, right) = plots.axes("t [s]", ["hub [rad/s]", "tip from the axis [m]", "φ [°]"], columns=3)
        left.plot(times, states[:, 3], **plots.REFERENCE)
        left.plot(run.history["time"][::10], run.history["hub_rate"][::10], ".")
        middle.plot(times, radius, **plots.REFERENCE)
        middle.plot(run.history["time"][::10], run.history["tip"][::10], ".")
        right.plot(times, np.degrees(states[:, 1]), **plots.REFERENCE)
        return page

    figures = [Figure("Spin-up: the model (lines) and refweb (points).", drawn)]
    tables = [Table("The deployment", ["number", "model"], numbers)]
    return Case(rows=rows, verdicts=verdicts, figures=figures, tables=tables)
