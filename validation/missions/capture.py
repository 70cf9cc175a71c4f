"""A net catches a tumbling rocket stage.

A net of aramid with masses of 5 kg at its corners is thrown at 5 m/s at a rocket stage, a cylinder of 2.4 × 6.5 m and
1400 kg. It wraps around, rubs on the stage, its lines touch each other, and a drawstring through rings at its corners
closes it; ``refweb run capture-stage`` is the scene. Lines are 20 mm thick where they touch, as knots and a loose braid
are: what stops masses of 5 kg within a radius r has a stiffness that goes with 1/r², and the number of steps with 1/r.
The drawstring touches nothing: how far it is from the stage is looked at in each frame. What it does beside a reel, and
what friction at its rings costs, stands with the drawstrings.

How a net folds is chaotic: its numbers are statistical. Exact are momentum and angular momentum, for nothing acts from
outside, and a bound: of all motions with the momentum p and the angular momentum L that of one rigid body of mass M and
moment of inertia I has the least kinetic energy,

    T ≥ p²/2M + ½ L·I⁻¹L,

with I of net and target where they are. Friction brings the motion towards that, the work of the winch away from it.

Lines hold what they are given here. Without margin they break: the same throw with `[rupture]` at shares of the largest
stress tells what does, and what is left of the capture.
"""

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict

MARGINS = (0.8, 0.5, 0.3)
"""Strength of lines that have none to spare, over the largest stress of lines that hold."""
RADIUS, LENGTH = 1.2, 6.5
"""Of the stage [m]."""


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


def clearance(solution, distance):
    """Least distance of the drawstring from the body in all frames [m].

    ``distance`` gives that of points in axes of the body, (n, 3) [m], to its surface; 0 within.
    """
    net, along = solution.state.system.net, np.linspace(0.0, 1.0, 201)[:, None]
    (thread,), (body,) = net.threads, net.bodies
    least = np.inf
    for _, state in solution.frames:
        axes = body.axes @ body.rotation(state.x).T
        for first, second in state.position[thread.segments]:
            points = first + along * (second - first) - state.position[body.row]
            least = min(least, distance(points @ axes.T).min())
    return least


def judged(solution, name, distance):
    """Rows and verdicts of a capture of a body by its name; with the ``distance`` of `clearance`, of this as well."""
    solver, throw, passed = solution.solver, solution.throw, solution.passage
    energies = np.array([least_energy(state) for _, state in solution.frames])
    (first, _), (last, union) = energies[0], energies[-1]
    started = solution.history["kinetic_energy"][0]
    outside, reason = "nothing acts from outside", "rounding"
    rows = [
        Row("momentum, drift", solver["momentum_drift"], 0.0, outside, 1e-12, reason, scale=1.0),
        Row("angular momentum, drift", solver["angular_momentum_drift"], 0.0, outside, 1e-9, reason, scale=1.0),
        Row("kinetic energy at the start", started, first, "sum over nodes and body", 1e-12, reason, "J"),
    ]
    covered = f"{throw['covered']['value']:.2f}"
    if (error := throw["covered"].get("error")) is not None:
        covered += f" ± {error:.2f}"
    undecided = [flag for flag in ("inside", "closed") if throw[flag]["value"] is None]
    doubt = f", of which ± leaves {' and '.join(undecided)} undecided" if undecided else ", which ± leaves no doubt of"
    passages = "; ".join(f"lines through {what}: {told}" for what, told in passed.items())
    if solution.lines:
        passages += (
            f"; lines are at most {1e3 * solution.lines['overlap']:.1f} mm deep in each other, of a radius of "
            f"{1e3 * solution.lines['radius']:.0f} mm"
        )
    verdicts = [
        Verdict(
            "Kinetic energy is never below that of the rigid union.",
            "holds",
            f"it is at least {(energies[:, 0] / energies[:, 1]).min():.2f} times as large; of {first:.0f} J and the "
            f"work of the winch {last:.0f} J are left, and one rigid body would have {union:.0f} J",
            (energies[:, 0] >= energies[:, 1] * (1.0 - 1e-9)).all(),
        ),
        Verdict(
            "Nothing can have passed.",
            "holds",
            passages,
            all(told == "certified" for told in passed.values()),
        ),
        Verdict(
            f"The net holds the {name}.",
            "holds",
            f"the centre of the {name} is inside, the mouth is closed{doubt}, the net covers {covered} of all "
            f"directions, the largest stress is {solution.utilisation[0]:.2f} of the strength: numbers of one motion "
            f"of many, found in {solver['nsteps']} steps, "
            f"{solution.cost['cpu_s'] - solution.cost['compile_s']:.0f} s of CPU time with the twin",
            throw["inside"]["drawn"] and throw["closed"]["drawn"],
        ),
    ]
    if distance is not None:
        least = clearance(solution, distance)
        seen = f"in {len(solution.frames)} frames it is at least {least:.2f} m away"
        verdicts.append(
            Verdict("The drawstring touches nothing, and is clear of the body.", "holds", seen, least > 0.0)
        )
    return rows, verdicts


def outside_of_stage(points):
    """Distance of points to the stage [m], see `clearance`."""
    over = np.column_stack([np.hypot(points[:, 0], points[:, 1]) - RADIUS, np.abs(points[:, 2]) - 0.5 * LENGTH])
    return np.linalg.norm(np.maximum(over, 0.0), axis=1)


def case(quick):
    values = {"web.layers": 3, "web.cell_area": 4.0, "self_contact.radius": 0.1} if quick else {}
    solution = refweb.run(refweb.Scene.load("capture-stage", values))
    rows, verdicts = judged(solution, "stage", None if quick else outside_of_stage)
    stress, table = solution.results["max_tension"].value / solution.scene.cable.area, []
    values |= {"self_contact": False} if quick else {}
    margins = MARGINS[-1:] if quick else MARGINS
    for margin in margins:
        weaker = refweb.run(refweb.Scene.load("capture-stage", {**values, "rupture.strength": margin * stress}))
        breaks, found = weaker.breaks or [], weaker.throw
        drift = weaker.solver["angular_momentum_drift"]
        rows.append(
            Row(
                f"the same with lines of {margin:g} of the stress",
                drift,
                0.0,
                "nothing acts from outside",
                1e-9,
                "rounding",
                scale=1.0,
            )
        )
        table.append([
            f"{1e-9 * margin * stress:.3f}",
            str(len(breaks)),
            f"{breaks[0]['time']:.2f}" if breaks else "none breaks",
            *("yes" if found[name]["drawn"] else "no" for name in ("inside", "closed")),
            f"{found['covered']['value']:.2f}",
        ])  # fmt: skip
    verdicts.append(
        Verdict(
            "Lines without margin break.",
            "holds",
            f"at {margins[0]:g} of the largest stress {table[0][1]} of {len(solution.tension)} lines break, the "
            f"first at {table[0][2]} s; which breaks first decides what breaks later: one motion of many",
            all(int(row[1]) > 0 for row in table),
        )
    )
    tables = [
        Table(
            "Without margin",
            ["strength [GPa]", "lines that break", "first at [s]", "stage inside", "mouth closed", "covered"],
            table,
        )
    ]
    figures = [Figure("The stage at the end.", lambda: plots.picture(solution, "tension"))]
    return Case(rows=rows, verdicts=verdicts, figures=figures, tables=tables)
