"""A capture in orbit beside the same one far from any planet.

The net and the stage of ``refweb run capture-stage`` meet far from any planet, and in an orbit at the height of 530 km,
thrown along its track or across it: ``--set orbit.mean_motion=1.1e-3 --set "orbit.axes=[[1,0,0],[0,0,1]]"``. In axes
that go round with the orbit all its forces are linear in place and velocity, and so the centre of mass of net and stage
moves as one mass does (W. H. Clohessy, R. S. Wiltshire, J. Aerosp. Sci. 27 (1960) 653–658, doi:10.2514/8.8704); with x
away from the Earth, y along the track, s = sin nt and c = cos nt, from a place and a velocity at t = 0:

    x = (4 − 3c) x₀ + s ẋ₀/n + 2 (1 − c) ẏ₀/n
    y = y₀ − 6 (nt − s) x₀ − 2 (1 − c) ẋ₀/n + (4s − 3nt) ẏ₀/n
    z = c z₀ + s ż₀/n

However the net folds, that is exact. How it folds is chaotic: behind the first touch motions part whatever the
forces, and what an orbit changes there is held against what a change of the throw by 1e-9 does.
"""

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict

N = 1.1e-3
"""Mean motion [rad/s]."""
TOUCH = 0.16
"""Time at which the net meets the stage [s]: 0.8 m away, at 5 m/s."""
THROWS = {"along the track": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), "across it": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))}
"""Directions away from the Earth and along the track, of each throw along z."""


def relative(place, speed, t):
    """Place of a mass in an orbit at time t [m], in its axes; Clohessy and Wiltshire."""
    (x, y, z), (u, v, w), a = place, speed / N, N * t
    s, c = np.sin(a), np.cos(a)
    return np.array([
        (4.0 - 3.0 * c) * x + s * u + 2.0 * (1.0 - c) * v,
        y - 6.0 * (a - s) * x - 2.0 * (1.0 - c) * u + (4.0 * s - 3.0 * a) * v,
        c * z + s * w,
    ])  # fmt: skip


def centre(state):
    """Place and velocity of the centre of mass of net and stage."""
    net = state.system.net
    count = state.system.rows - net.spins
    share = net.mass[:count] / net.mass[:count].sum()
    return share @ state.position[:count], share @ state.v[:count]


def apart(one, other):
    """Largest distance of a node in one state from that in another [m]."""
    nodes = one.system.net.nodes
    return float(np.linalg.norm(one.x[:nodes] - other.x[:nodes], axis=1).max())


def case(quick):
    values = {"web.layers": 3, "web.cell_area": 4.0, "self_contact": False} if quick else {}
    load = lambda more: refweb.run(refweb.Scene.load("capture-stage", {**values, **more}))  # noqa: E731
    free = load({})
    nearby = load({"velocity.0.value": [0.0, 0.0, 5.0 * (1.0 + 1e-9)]})
    orbits = {
        name: load({"orbit.mean_motion": N, "orbit.axes": [list(axis) for axis in axes]})
        for name, axes in THROWS.items()
    }
    rows, verdicts = [], []
    for name, solution in orbits.items():
        own = np.array([*THROWS[name], np.cross(*THROWS[name])])
        (_, first), (_, last) = solution.frames[0], solution.frames[-1]
        place, speed = (own @ vector for vector in centre(first))
        found, exact = own @ centre(last)[0], relative(place, speed, last.time)
        straight = place + last.time * speed
        for axis, label in enumerate(("away from the Earth", "along the track")):
            rows.append(
                Row(f"thrown {name}: centre of mass {label}", found[axis], exact[axis], "Clohessy and Wiltshire", 1e-8,
                    "steps, (h n)², rounding of places of 10 m", "m", scale=float(np.linalg.norm(exact)))
            )  # fmt: skip
        drift = np.linalg.norm(exact - straight)
        times = [state.time for _, state in solution.frames]
        before = max(i for i, time in enumerate(times) if time < TOUCH)
        moved = [apart(a[1], b[1]) for a, b in zip(solution.frames, free.frames, strict=True)]
        verdicts.append(
            Verdict(
                f"An orbit changes a capture of seconds, thrown {name}, by no more than chance does.",
                "holds",
                f"the centre of mass goes off its straight way by {1e3 * drift:.2g} mm in {last.time:.2g} s; nodes are "
                f"{1e3 * moved[before]:.2g} mm apart at {times[before]:.2g} s, before the net meets the stage, and "
                f"{moved[-1]:.2g} m at the end, where a throw that is faster by 1e-9 is "
                f"{apart(nearby.frames[-1][1], free.frames[-1][1]):.2g} m apart: one motion of many each",
                moved[before] < 1e-3 and drift < 2e-3,
            )
        )
    names = {"far from any planet": free, "thrown faster by 1e-9": nearby, **orbits}
    told = [
        [
            name,
            f"{s.throw['covered']['value']:.2f}",
            "yes" if s.throw["inside"]["drawn"] else "no",
            "yes" if s.throw["closed"]["drawn"] else "no",
            f"{s.results['max_tension'].value:.0f}",
            f"{s.solver['energy_drift']:.1e}",
        ]
        for name, s in names.items()
    ]
    head = ["capture", "covered", "inside", "closed", "largest tension [N]", "energy drift"]
    closed = sum(s.throw["closed"]["drawn"] for s in names.values())
    verdicts.append(
        Verdict(
            "The net holds the stage in an orbit as well.",
            "holds",
            f"the centre of the stage is inside in each of four captures, the mouth is closed in {closed} of them",
            all(s.throw["inside"]["drawn"] for s in names.values()) and closed >= (1 if quick else 3),
        )
    )

    def drawn():
        page, plot = plots.axes("t [s]", "largest distance of a node from\nthat far from any planet [m]")
        for name, solution in list(names.items())[1:]:
            pairs = zip(solution.frames, free.frames, strict=True)
            found = [(a[1].time, apart(a[1], b[1])) for a, b in pairs]
            plot.semilogy(*np.array(found[1:]).T, ".-", label=name)
        plot.legend(frameon=False, fontsize="small")
        return page

    figures = [
        Figure("How far nodes are from where they are far from any planet.", drawn),
        Figure("Thrown along the track, at the end.", lambda: plots.picture(orbits["along the track"], "tension")),
    ]
    return Case(rows=rows, verdicts=verdicts, figures=figures, tables=[Table("Four captures", head, told)])
