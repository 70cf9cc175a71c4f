"""Drawstrings: a thread through the rings of a mouth, and through the rim of a thrown net.

The mouth of ``refweb run drawstring`` is a circle of 1 m of 20 rings, each on a cord. A hand pulls both ends of a
thread that runs through all rings. Half of the run is integrated by a program of its own: rings with the one tension
T = EA (Σ l_s/L − 1) of the thread and those of the cords, by DOP853. The work of the hand is all the energy.

The net of ``refweb run closing-net`` has its rim closed in three ways. The reel of that scene shortens every line of
the rim by a table. A drawstring through the 76 nodes of the rim has its ends 2 m behind the net, and 1 m of slack. The
ends stay, and the net closes as it flies on, without any work; or they are drawn back by 1 m. The mouth is the area
between the corners.
``FRICTION`` is the friction of the drawstring at its rings.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict

FRICTION = (0.0,)
"""Friction coefficients at the rings of the net's drawstring."""
HALF, TAU, STIFFNESS = 0.5, 1e-4, 3e3
"""Time of the comparison [s], damping time of the cords [s], and EA [N]."""
BEHIND, BACK = 2.0, ((0.1, 0.0, 0.0, 0.0), (0.45, 0.0, 0.0, -1.0))
"""Distance of the hand behind the net [m], and how it is drawn back."""


def mouth_by_itself(net):
    """(Area of the mouth [m²], work of the hand [J]) after `HALF`, by DOP853."""
    points, mass = net.web.points, net.mass[:20, None]
    cords = np.linalg.norm(points[:20] - points[20], axis=1)
    length = np.linalg.norm(np.diff(points[[21, *range(20), 0, 21]], axis=0), axis=1).sum()
    speed = np.array([0.4, 0.0, 0.0])

    def rate(t, y):
        place, velocity = y[:120].reshape(2, 20, 3)
        hand = points[21] + speed * t
        apart = np.diff(np.vstack([hand, place, place[:1], hand]), axis=0)
        far = np.linalg.norm(apart, axis=1)
        pulls = STIFFNESS * max(far.sum() / length - 1.0, 0.0) * apart / far[:, None]
        force = pulls[1:21] - pulls[:20]
        force[0] += pulls[21] - pulls[20]
        arm = place - points[20]
        along = arm / np.linalg.norm(arm, axis=1)[:, None]
        strain = np.linalg.norm(arm, axis=1) / cords - 1.0
        damped = strain + TAU * (along * velocity).sum(axis=1) / cords
        force -= (STIFFNESS * np.where(strain > 0.0, np.maximum(damped, 0.0), 0.0))[:, None] * along
        return np.concatenate([velocity.ravel(), (force / mass).ravel(), [speed @ (pulls[21] - pulls[0])]])

    start = np.concatenate([points[:20].ravel(), np.zeros(61)])
    end = solve_ivp(rate, (0.0, HALF), start, "DOP853", rtol=1e-9, atol=1e-11).y[:, -1]
    ring = end[:60].reshape(20, 3)
    return 0.5 * np.linalg.norm(np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0)), end[120]


def closing(way, friction=0.0):
    """Solution of the closing net whose rim is closed by its "reel", or by a drawstring: "held" or "pulled"."""
    scene = refweb.Scene.load("closing-net")
    web = scene.build().net.web
    count, rim, corners = len(web.points), web.find_around("rim"), web.corners
    rim = np.roll(rim, -np.flatnonzero(rim == corners[0])[0]).tolist()
    given = scene.to_dict() | {"accuracy": {"error": "none"}}
    weights = "corners" if way == "reel" else "weights"
    given["observe"] += [{"name": "mouth", "quantity": "mouth_area", "node": weights}]
    if way == "reel":
        return refweb.run(refweb.Scene.from_dict(given))
    del given["reel"]
    ends = rim[0], count
    string = {"name": "drawstring", "nodes": [count, *rim, *ends], "modulus": 7e7, "area": 1e-4, "density": 0.0}
    far = np.linalg.norm(web.points[rim[0]] + [0.0, 0.0, BEHIND])
    rim_length = np.linalg.norm(np.diff(web.points[[*rim, rim[0]]], axis=0), axis=1).sum()
    string["length"] = float(rim_length + 2.0 * far + 1.0)
    string |= {"friction": friction} if friction else {}
    return refweb.run(
        refweb.Scene.from_dict(
            given
            | {
                "web": {
                    "kind": "inline",
                    "points": [*web.points.tolist(), [0.0, 0.0, -BEHIND]],
                    "lines": web.lines.tolist(),
                    "natural_length": web.natural_length.tolist(),
                    "names": {weights: corners.tolist()},
                },
                "point_mass": [given["point_mass"][0] | {"node": weights}],
                "velocity": [given["velocity"][0] | {"node": list(range(count))}],
                "thread": [string],
                "motion": [{"node": count, "displacement": BACK if way == "pulled" else [[0.0, 0.0, 0.0, 0.0]]}],
                "observe": [
                    *given["observe"],
                    {"name": "pull", "quantity": "tension", "thread": "drawstring", "reduce": "max"},
                ],
            }
        )
    )


def case(quick):
    scene = refweb.Scene.load("drawstring", {"solve.duration": HALF})
    run = refweb.run(scene)
    rows = []
    reason = "± of the method covers it"
    for name, exact, unit in zip(("mouth", "hand_work"), mouth_by_itself(scene.build().net), ("m²", "J"), strict=True):
        value = run.results[name]
        given = dict(unit=unit, error=value.error, covered=True)
        rows.append(Row(f"mouth of rings, {name}", value.value, exact, "DOP853", 2e-2, reason, **given))
    history = run.history
    left = history["total_energy"][-1] + history["dissipated_energy"][-1] - history["work"][-1]
    given = dict(unit="J", scale=history["work"][-1])
    rows.append(Row("mouth of rings, energy less work", left, 0.0, "energy balance", 1e-3, "200 steps a row", **given))
    runs = {"reel on every line of the rim": closing("reel")}
    for mu in FRICTION:
        more = f", μ = {mu:g}" if mu else ""
        runs[f"drawstring, ends held{more}"] = closing("held", mu)
        runs[f"drawstring, ends drawn back{more}"] = closing("pulled", mu)
    table = []
    for name, solution in runs.items():
        found, mouth = solution.results, solution.history["mouth"]
        pull = f"{found['pull'].value:.1f} N" if "pull" in found else "none"
        table.append(
            [
                name,
                f"{100.0 * mouth.min() / mouth[0]:.2g} %",
                f"{100.0 * mouth[-1] / mouth[0]:.2g} %",
                f"{found['max_tension'].value:.0f} N",
                pull,
                f"{found['winch_work'].value:.2f} J",
                f"{found['debris_speed'].value:.2f} m/s",
            ]
        )
    held = runs["drawstring, ends held"]
    share = held.history["mouth"].min() / held.history["mouth"][0]

    def drawn():
        page, plot = plots.axes("t [s]", "mouth [m²]")
        for name, solution in runs.items():
            plot.plot(solution.history["time"], solution.history["mouth"], label=name)
        plot.legend()
        return page

    columns = ["way", "least mouth", "mouth at the end", "largest tension", "pull on the drawstring", "work"]
    return Case(
        rows=rows,
        verdicts=[
            Verdict(
                "a drawstring closes a thrown net by the motion of the net alone",
                "holds",
                f"the mouth comes down to {100.0 * share:.2g} % of its area, and the ends that are held do no work",
                checked=bool(share < 0.05 and held.results["winch_work"].value == 0.0),
            )
        ],
        tables=[Table("A net closes around debris", [*columns, "speed of the debris"], table)],
        figures=[Figure("Mouth of the net over time.", drawn)],
    )
