"""A web is deployed by spin: its arms swing out from a hub that turns freely.

Four arms of 2.5 m with masses of 1 kg at their tips, joined by five rings of lines, are folded about their roots on the
rim of a hub, 75° against the spin; ``refweb run spin-deployment`` is the scene. While arms are straight and their rings
slack, a model of three degrees of freedom tells the motion, as those do by which deployment is controlled
(M. Gärdsback, G. Tibert, J. Guid. Control Dyn. 32 (2009) 40–50): the angle θ of the hub, the angle ψ = θ + φ of the
arms and their length l. With masses m at the shares s of an arm, A = Σ m, B = Σ m s, C = Σ m s², the hub's moment of
inertia J and radius R, and 4 arms of stiffness k,

    (J + 4AR²) θ'' + 4BR (l'' sin φ + l ψ'' cos φ) = 4BR (l ψ'² sin φ − 2 l' ψ' cos φ),
    4C l² ψ'' + 4BR l cos φ θ'' = −8C l l' ψ' − 4BR l θ'² sin φ,
    4C l'' + 4BR sin φ θ'' = 4C l ψ'² + 4BR cos φ θ'² − 4k (l − l₀).

Of arms that are one line each the model is exact, by whatever method. Masses along an arm bend it, and swing: what the
whole web differs by goes with them. The angular momentum is exact whatever bends.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Verdict

RADIUS, LENGTH, RINGS, RATE, FOLD = 0.5, 2.5, 5, 2.0, np.radians(75.0)
HUB, TIP, LINE, AXIAL = 50.0, 1.0, 1.44e-3, 7e4
"""Masses of the hub and of each tip [kg], of lines [kg/m], and EA [N]."""


def masses():
    """Mass at the root of an arm of the web and at each ring [kg]; lines weigh 1.44 g/m."""
    rings = LINE * np.sqrt(2.0) * (RADIUS + LENGTH * np.arange(RINGS + 1) / RINGS)
    rings[0] = 0.0
    mass = rings + LINE * LENGTH / RINGS * np.array([0.5, *np.ones(RINGS - 1), 0.5])
    mass[-1] += TIP
    return mass


def rates(mass):
    """Function of t and (θ, φ, l, θ', ψ', l') with their rates, of masses at equal parts of an arm [kg]."""
    s = np.linspace(0.0, 1.0, len(mass))
    A, B, C = mass.sum(), mass @ s, mass @ s**2
    inertia, k, b = 0.5 * HUB * RADIUS**2 + 4.0 * A * RADIUS**2, AXIAL / LENGTH, 4.0 * B * RADIUS

    def found(t, y):
        _, phi, length, turn, swing, stretch = y
        sine, cosine = np.sin(phi), np.cos(phi)
        matrix = [
            [inertia, b * length * cosine, b * sine],
            [b * length * cosine, 4.0 * C * length**2, 0.0],
            [b * sine, 0.0, 4.0 * C],
        ]
        right = [
            b * (length * swing**2 * sine - 2.0 * stretch * swing * cosine),
            -8.0 * C * length * stretch * swing - b * length * turn**2 * sine,
            4.0 * C * length * swing**2 + b * cosine * turn**2 - 4.0 * k * (length - LENGTH),
        ]
        return [turn, swing - turn, stretch, *np.linalg.solve(matrix, right)]

    return found


def model(mass, length, times):
    """θ', ψ', φ and l by DOP853 at some times, shape (4, times), of arms that begin with a length [m]."""
    start = [0.0, -FOLD, length, RATE, RATE, 0.0]
    done = solve_ivp(rates(mass), (0.0, times[-1]), start, "DOP853", t_eval=times, rtol=1e-11, atol=1e-12)
    return done.y[[3, 4, 1, 2]]


def bare(length, **solve):
    """The four arms alone, each one line, that begin with a length [m]."""
    roots = RADIUS * 1j ** np.arange(4)
    ends = np.concatenate([roots, roots * (1.0 + length / RADIUS * np.exp(-1j * FOLD))])
    return refweb.Scene(
        web=refweb.Inline(
            points=np.column_stack([ends.real, ends.imag, np.zeros(8)]).tolist(),
            lines=[[i, i + 4] for i in range(4)],
            natural_length=LENGTH,
        ),
        cable=refweb.Cable(law="tension-only", modulus=7e10, area=1e-6, density=1440.0),
        supports=refweb.Supports(nodes=[]),
        effects=[
            refweb.PointMass(node=[4, 5, 6, 7], mass=TIP),
            refweb.Body(name="hub", shape="cylinder", radius=RADIUS, length=0.4, axis=(0.0, 0.0, 1.0), mass=HUB,
                        inertia=(0.25 * HUB * RADIUS**2, 0.25 * HUB * RADIUS**2, 0.5 * HUB * RADIUS**2),
                        position=(0.0, 0.0, 0.0), angular_velocity=(0.0, 0.0, RATE)),
            refweb.Attach(body="hub", node=[0, 1, 2, 3]),
            refweb.Velocity(node="all", spin=(0.0, 0.0, RATE)),
        ],
        solve=refweb.Dynamic(duration=2.0, **solve),
        output=refweb.Output(interval=1e-2),
        observe=[refweb.Observe(name="hub_rate", quantity="angular_velocity", body="hub", component="z")],
    )  # fmt: skip


def case(quick):
    grid, web = np.linspace(0.0, 3.0, 301), masses()
    theirs = model(web, LENGTH * (1.0 - 1e-6), grid)
    straight = int(np.argmax(theirs[2] > np.radians(-10.0)))  # behind it rings get taut
    arm = np.array([0.5 * LINE * LENGTH, TIP + 0.5 * LINE * LENGTH])
    length = brentq(lambda l: rates(arm)(0.0, [0.0, -FOLD, l, RATE, RATE, 0.0])[-1], LENGTH, 1.1 * LENGTH, xtol=1e-15)  # noqa: E741
    ends = model(arm, length, grid[:201])[0, -1]
    own = refweb.run("spin-deployment")
    whole = own.history
    source, rows = "model of three degrees of freedom, DOP853", []
    for name, keys in {
        "steps": {"safety": 0.1},
        "order 6": dict(method="explicit", order=6),
        "CVODE": dict(method="cvode", rtol=1e-7),
    }.items():
        found = refweb.run(bare(length, **keys)).results["hub_rate"]
        reason = "steps, rtol"
        rows.append(Row(f"bare arms, hub at 2 s, {name}", found.value, ends, source, 1e-5, reason, "rad/s", found.error,
                        covered=True))  # fmt: skip
    apart = float(np.abs(whole["hub_rate"][: straight + 1] - theirs[0, : straight + 1]).max())
    rows.append(Row(f"web, hub's rate until {grid[straight]:g} s, largest difference", apart, 0.0, source, 0.02,
                    "lines weigh 1/40 of the tips, and swing", "rad/s", scale=RATE))  # fmt: skip
    drift = own.solver["angular_momentum_drift"]
    radii = np.abs(RADIUS + LENGTH * np.arange(RINGS + 1) / RINGS * np.exp(-1j * FOLD))
    spin = 0.5 * HUB * RADIUS**2 + 4.0 * web @ radii**2
    least, most = whole["hub_rate"].min(), whole["hub_rate"].max()
    verdicts = [
        Verdict(
            "Angular momentum is kept: what the arms take up, the hub loses.",
            "holds",
            f"to {drift:.1e} of {spin * RATE:.1f} N m s, while the hub turns at {least:.3f} to {most:.3f} rad/s; "
            f"energy to {own.solver['energy_drift']:.1e}",
            drift < 1e-12 and least < 1.0,
        )
    ]

    def drawn():
        page, (left, right) = plots.axes(["t [s]", "x [m]"], ["rate of the hub [rad/s]", "y [m]"], columns=2)
        left.plot(grid, theirs[0], label="model", **plots.REFERENCE)
        left.plot(whole["time"][::5], whole["hub_rate"][::5], ".", label="refweb")
        left.axvline(grid[straight], color="#888888", linestyle=":")
        left.legend(frameon=False, fontsize="small")
        for number, (_, state) in enumerate(own.frames[:: max(len(own.frames) // 4, 1)][:4]):
            for i, j in state.system.net.cells:
                right.plot(*state.position[[i, j], :2].T, color=plots.COLOURS[number], linewidth=0.8)
        right.set_aspect("equal")
        return page

    caption = "Left: rate of the hub, and where rings get taut. Right: the web at four times."
    figures = [Figure(caption, drawn), Figure("The web at the end.", lambda: plots.picture(own, "tension"))]
    return Case(rows=rows, verdicts=verdicts, figures=figures)
