"""A net catches a tumbling stage, and a satellite from a surface file.

Nets of aramid with masses of 5 kg at their corners are thrown at 5 m/s at a rocket stage, a cylinder of 2.4 × 6.5 m
and 1400 kg, and at a satellite of 800 kg, a bus with two panels in a surface file. They wrap around, rub on what they
catch, and a reel along the rim closes them; ``refweb run capture-stage`` and ``refweb run capture-satellite`` are the
scenes.

How a net folds is chaotic: its numbers are statistical. Exact are momentum and angular momentum, for nothing acts from
outside, and a bound: of all motions with the momentum p and the angular momentum L that of one rigid body of mass M and
moment of inertia I has the least kinetic energy,

    T ≥ p²/2M + ½ L·I⁻¹L,

with I of net and target where they are. Friction brings the motion towards that, the work of the reel away from it.
"""

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict


def moments(body, x):
    """Moments of inertia of a body about its centre, in space [kg m²]."""
    axes = body.axes @ body.rotation(x).T
    return axes.T @ body.inertia @ axes


def least_energy(state):
    """(Kinetic energy, that of the rigid union) of a state [J]."""
    net = state.system.net
    body = net.bodies[0]
    count = state.system.rows - net.spins
    mass, place, v = net.mass[:count], state.position[:count], state.v[:count]
    inertia = moments(body, state.x)
    spin = body.moment * state.v[body.spin]
    p, centre = mass @ v, mass @ place / mass.sum()
    arm = place - centre
    angular = spin + (mass[:, None] * np.cross(arm, v - p / mass.sum())).sum(axis=0)
    union = inertia + np.einsum("n,nij->ij", mass, (arm**2).sum(axis=1)[:, None, None] * np.eye(3)
                                - arm[:, :, None] * arm[:, None, :])  # fmt: skip
    moving = 0.5 * mass @ (v**2).sum(axis=1) + 0.5 * spin @ np.linalg.solve(inertia, spin)
    return moving, 0.5 * p @ p / mass.sum() + 0.5 * angular @ np.linalg.solve(union, angular)


def case(quick):
    rows, verdicts, told, figures = [], [], [], []
    for name in ("stage",) if quick else ("stage", "satellite"):
        values = {"web.layers": 5, "web.cell_area": 1.44} if quick else {}
        scene = refweb.Scene.load(f"capture-{name}", values)
        solution = refweb.run(scene)
        energies = np.array([least_energy(state) for _, state in solution.frames])
        share = (energies[:, 0] / energies[:, 1]).min()
        solver, throw = solution.solver, solution.throw
        reason = "rounding"
        rows += [
            Row(f"{name}: momentum, drift", solver["momentum_drift"], 0.0, "nothing acts from outside", 1e-12, reason,
                scale=1.0),
            Row(f"{name}: angular momentum, drift", solver["angular_momentum_drift"], 0.0, "the same", 1e-9, reason,
                scale=1.0),
            Row(f"{name}: kinetic energy at the start", energies[0, 0], solution.history["kinetic_energy"][0],
                "history of the run, by another sum", 1e-12, reason, "J"),
        ]  # fmt: skip
        verdicts.append(
            Verdict(
                f"The {name}: kinetic energy is never below that of the rigid union.",
                "holds",
                f"it is at least {share:.3f} times as large; of {energies[0, 0]:.1f} J at "
                f"first and the work of the reel {energies[-1, 0]:.1f} J are left, and one rigid body would have "
                f"{energies[-1, 1]:.1f} J",
                (energies[:, 0] >= energies[:, 1] * (1.0 - 1e-9)).all(),
            )
        )
        numbers = {key: throw[key] for key in ("inside", "closed", "covered")}
        told.append([name, *(_shown(one) for one in numbers.values()), f"{solution.utilisation[0]:.2f}"])
        figures.append(Figure(f"The {name} at the end.", lambda one=solution: plots.picture(one, "tension")))
    table = Table("What is caught", ["target", "inside", "closed", "covered", "largest stress over strength"], told)
    return Case(rows=rows, verdicts=verdicts, figures=figures, tables=[table])


def _shown(one):
    """A number of a throw in words."""
    value = one["value"]
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3f}" + (f" ± {one['error']:.3f}" if one.get("error") is not None else "")
