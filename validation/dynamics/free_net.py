"""What a free net keeps.

A square net drifts, spins and is stretched in some places and slack in others; nothing holds it and nothing acts on it.
Whatever its lines do, it keeps its momentum Σ m v, its angular momentum Σ x × m v about the origin, the path of its
centre of mass, and its energy.

Central differences keep the first three to rounding, because internal forces have no resultant and no moment; the
energy changes by a part of order 2 in the step, which is fitted. A line that snaps taut leaves a kink in the force, not
a jump, and does not change the order.
"""

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Verdict, slope

SIDE, ROWS, SEED = 0.1, 8, 1
DRIFT, SPIN = np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, -3.0])
"""Velocity of the centre of mass [m/s], and angular velocity [rad/s]."""


def solved(steps, duration=0.1):
    """The net in a number of steps; its speeds are those of a rigid body and a smooth field across it."""
    web = refweb.Window(mesh="square", rows=ROWS, columns=ROWS, side=SIDE)
    points = web.web().points
    bumps = np.sin(np.pi * points[:, [1]] / SIDE / 3) * np.cos(np.pi * points[:, [0]] / SIDE / 2) * [1.0, -0.7, 2.0]
    speeds = DRIFT + np.cross(SPIN, points) + bumps
    scene = refweb.Scene(
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-4, density=200.0, prestrain=0.002),
        effects=[refweb.Velocity(node=i, value=tuple(speed)) for i, speed in enumerate(speeds)],
        supports=refweb.Supports(nodes=[]),
        solve=refweb.Dynamic(duration=duration, step_size=duration / steps * (1 + 1e-9)),
        output=refweb.Output(interval=duration / 40, frames=1),
        accuracy=refweb.Accuracy(error="none"),
        title="A free net",
    )
    return refweb.run(scene)


def kept(solution):
    """Momentum, angular momentum and centre of mass of all frames, each of shape (frames, 3)."""
    mass, found = solution.state.system.net.mass[:, None], []
    for _, state in solution.frames:
        x, v = state.position, state.v
        found.append(((mass * v).sum(0), np.cross(x, mass * v).sum(0), (mass * x).sum(0) / mass.sum()))
    return tuple(np.array(one) for one in zip(*found, strict=True))


def case(quick):
    counts = np.array([120, 240, 480] if quick else [120, 240, 480, 960, 1920])
    drift = []
    for count in counts:
        solution = solved(int(count))
        energy = solution.history["total_energy"]
        drift.append(abs(energy - energy[0]).max() / energy[0])
    momentum, angular, centre = kept(solution)
    path = centre[0] + solution.history["time"][:, None] * momentum[0] / solution.web["mass"]
    names = ("momentum", "N s"), ("angular momentum", "N m s"), ("centre of mass from its straight path", "m")
    left = momentum - momentum[0], angular - angular[0], centre - path
    scales = abs(momentum[0]).max(), abs(angular[0]).max(), ROWS * SIDE
    rows, source = [], "no force acts"
    for (name, unit), rest, scale in zip(names, left, scales, strict=True):
        title = f"largest change of the {name}"
        rows.append(Row(title, abs(rest).max(), 0.0, source, 1e-13, "rounding", unit, scale=scale))
    within, reason = 500 / counts[-1] ** 2, "order 2 in the step, 500 (1/steps)²"
    rows.append(Row("largest change of the energy", drift[-1], 0.0, "nothing works on it", within, reason, scale=1))
    reason = "kinks fall where they fall in a step"
    rows.append(Row("order of the change of the energy", -slope(counts, drift), 2, "theory", 0.4, reason, scale=1))
    share = max(state.slack.mean() for _, state in solution.frames)
    verdict = Verdict(
        "What nothing acts on keeps its momentum and its angular momentum, whatever its lines do.",
        "holds",
        f"to rounding, while up to {100 * share:.0f} % of the lines are slack at once",
        all(row.passes for row in rows[:3]) and share > 0.5,
    )

    def drawn():
        page, plot = plots.axes("time [s]", "kinetic and strain energy over the first total")
        own = solution.history
        total = own["total_energy"][0]
        for name in ("kinetic_energy", "strain_energy", "total_energy"):
            plot.plot(own["time"], own[name] / total, label=name.replace("_", " "))
        plot.set_ylim(bottom=0)
        plot.legend(frameon=False)
        return page

    figures = [Figure("Energies of the free net: lines snap taut and go slack, the sum stays.", drawn)]
    figures.append(Figure("The net at the end, at true scale; slack lines are grey.", lambda: plots.picture(solution)))
    return Case(rows=rows, verdicts=[verdict], figures=figures)
