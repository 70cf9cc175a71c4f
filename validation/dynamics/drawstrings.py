"""Drawstrings: a thread through the rings of a mouth, and through the rim of thrown nets.

The mouth of ``refweb run drawstring`` is a circle of 1 m of 20 rings, each on a cord. A hand pulls both ends of a
thread that runs through all rings. Half of the run is integrated by a program of its own: rings with the one tension
T = EA (Σ l_s/L − 1) of the thread and those of the cords, by DOP853. The work of the hand is all the energy.

The net of ``refweb run closing-net`` has its mouth closed in four ways. In that scene a drawstring runs through eight
rings, and a winch at a corner winds it from one side, with 30 N at most, against friction at the rings. Or a reel
shortens every line of the rim by a table, as no hardware does. Or a drawstring through the 76 nodes of the rim has its
ends 2 m behind the net, and 1 m of slack: the ends stay, and the net closes as it flies on, without any work; or they
are drawn back by 1 m. The mouth is the area between the corners.

The winch is then run for other coefficients of friction, ``FRICTION``. The cinch force is the mean tension from 0.1 s,
where the winch starts, to the end: of the segment that it winds, of the one behind the opposite corner, and of the one
that is tied to it. Without any pull, by a winch that stands still, the weights alone bring the mouth together, but
later.

The nets of ``refweb run capture-stage`` and ``refweb run capture-satellite`` have rings at their four corners, and a
winch at one of them. Beside it stands a reel, which pulls as hard as its table asks for. How these nets fold is
chaotic; forces and times are those of one motion each.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict

FRICTION = (0.0, 0.1, 0.2, 0.3, 0.5, 1.0)
"""Friction coefficients at the rings of the drawstring."""
SEGMENTS = {"wound": 0, "across": 4, "tied": 7}
"""Segments of the drawstring: at the winch, behind the opposite corner, and the last, which is tied to the winch."""
START, NARROW = 0.1, 0.05
"""Time at which the winch starts [s], and the share of its area from which on the mouth counts as closed."""
REEL = {"lines": "rim", "factor": [[START, 1.0], [0.45, 0.53]]}
STAGE, RUBBED, HAULED = "capture-stage", (0.0, 0.1, 0.3, 1.0), 0.7
"""Capture that is run for other coefficients of friction, these, and the time at which its winch starts [s]."""
CAPTURES = STAGE, "capture-satellite"
"""Captures that a drawstring closes."""
CORNERS = {"wound": 0, "across": 2, "tied": 3}
"""`SEGMENTS` of their drawstrings."""
RIM = {"lines": "rim", "factor": [[0.7, 1.0], [3.3, 0.28]]}
"""Reel that closes them."""
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


def seen(given, segments):
    """Observables of the mean tensions of some segments of the drawstring over a row."""
    shared = {"quantity": "tension", "thread": "drawstring", "average": given["output"]["interval"]}
    return [{"name": name, "segment": number, **shared} for name, number in segments.items()]


def captured(name, values, reel=False, friction=None, **winch):
    """Solution of a capture by its name and values, with other friction or keys of its winch, or closed by a reel."""
    given = refweb.Scene.load(name, values).to_dict() | {"accuracy": {"error": "none"}}
    if reel:
        given = {key: value for key, value in given.items() if key not in ("thread", "winch")} | {"reel": [RIM]}
        given["observe"] = [observe for observe in given["observe"] if observe["name"] in ("mouth", "max_tension")]
    else:
        given["thread"][0]["friction"] = given["thread"][0]["friction"] if friction is None else friction
        given["winch"][0] |= winch
        given["observe"] += seen(given, CORNERS)
    return refweb.run(refweb.Scene.from_dict(given))


def captures(quick):
    """Solutions of captures: by scene and way, and those of the stage by friction and with a winch at rest."""
    values = {"web.layers": 3, "web.cell_area": 4.0, "self_contact": False} if quick else {}
    caught = {(name, way): captured(name, values, way == "reel") for name in CAPTURES for way in ("winch", "reel")}
    rubbed = {mu: caught[STAGE, "winch"] if mu == 0.1 else captured(STAGE, values, friction=mu) for mu in RUBBED}
    return caught, {f"{mu:g}": solution for mu, solution in rubbed.items()} | {
        "winch stands still": captured(STAGE, values, speed=0.0)
    }


def closing(way, **winch):
    """Solution of the closing net: its rim closed by its "winch", a "reel", or a drawstring "held" or "pulled".

    ``winch`` are keys that differ from the scene: ``friction`` of the drawstring, and ``speed`` of the winch.
    """
    scene = refweb.Scene.load("closing-net")
    given = scene.to_dict() | {"accuracy": {"error": "none"}}
    if way == "winch":
        given["thread"][0]["friction"] = winch.pop("friction", given["thread"][0]["friction"])
        given["winch"][0] |= winch
        given["observe"] += seen(given, SEGMENTS)
        return refweb.run(refweb.Scene.from_dict(given))
    of_winch = ("pull", "energy_of_winch", "mouth")
    given["observe"] = [observe for observe in given["observe"] if observe["name"] not in of_winch]
    given = {key: value for key, value in given.items() if key not in ("thread", "winch")}
    weights = "corners" if way == "reel" else "weights"
    given["observe"] += [{"name": "mouth", "quantity": "mouth_area", "node": weights}]
    if way == "reel":
        return refweb.run(refweb.Scene.from_dict(given | {"reel": [REEL]}))
    web = scene.build().net.web
    count, rim, corners = len(web.points), web.find_around("rim"), web.corners
    rim = np.roll(rim, -np.flatnonzero(rim == corners[0])[0]).tolist()
    ends = rim[0], count
    string = {"name": "drawstring", "nodes": [count, *rim, *ends], "modulus": 7e7, "area": 1e-4, "density": 0.0}
    far = np.linalg.norm(web.points[rim[0]] + [0.0, 0.0, BEHIND])
    rim_length = np.linalg.norm(np.diff(web.points[[*rim, rim[0]]], axis=0), axis=1).sum()
    string["length"] = float(rim_length + 2.0 * far + 1.0)
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


def work_of(solution):
    """Work on the net until the end [J]: of the winch, or else of the reel or the hand."""
    history = solution.history
    return 0.0 - history["winch_energy"][-1] if "winch_energy" in history else history["work"][-1]


def narrow(solution):
    """Time at which the mouth first has `NARROW` of its area [s]; None if it never has."""
    small = solution.history["mouth"] <= NARROW * solution.history["mouth"][0]
    return float(solution.history["time"][small.argmax()]) if small.any() else None


def by_friction(title, runs, start):
    """Table of the cinch force from the start of the winch on [s], and of the mouth, by coefficient of friction."""
    table = []
    for name, solution in runs.items():
        history = solution.history
        pulls = [history[segment][history["time"] > start].mean() for segment in SEGMENTS]
        mouth, when = history["mouth"], narrow(solution)
        table.append(
            [
                name,
                *(f"{pull:.2f} N" for pull in pulls),
                f"{100.0 * max(1.0 - pulls[1] / pulls[0], 0.0):.0f} %" if pulls[0] > 0.0 else "no pull",
                f"{work_of(solution):.1f} J",
                f"{history['dissipated_energy'][-1]:.1f} J",
                "never" if when is None else f"{when:.3f} s",
                f"{100.0 * mouth.min() / mouth[0]:.2g} %",
            ]
        )
    columns = ["friction", *(f"pull, {name}" for name in SEGMENTS), "lost half-way", "work", "heat"]
    return Table(title, [*columns, "mouth at 5 %", "least mouth"], table)


def by_way(runs):
    """Table of captures, each closed by its drawstring and by a reel."""
    table = []
    for (name, way), solution in runs.items():
        mouth, found = solution.history["mouth"], solution.results
        table.append(
            [
                name,
                "drawstring, μ = 0.1" if way == "winch" else "reel on every line of the rim",
                f"{100.0 * mouth.min() / mouth[0]:.2g} %",
                f"{100.0 * mouth[-1] / mouth[0]:.2g} %",
                f"{found['max_tension'].value:.0f} N",
                f"{found['pull'].value:.0f} N" if "pull" in found else "none",
                f"{work_of(solution):.0f} J",
                f"{solution.throw['covered']['value']:.3f}",
                f"{solution.cost['cpu_s'] - solution.cost['compile_s']:.0f} s",
            ]
        )
    columns = ["capture", "closed by", "least mouth", "mouth at the end", "largest tension", "pull on the drawstring"]
    return Table("Captures", [*columns, "work", "covered", "CPU time"], table)


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
    runs = {
        "winch at a corner, μ = 0.1": closing("winch"),
        "reel on every line of the rim": closing("reel"),
        "drawstring, ends held": closing("held"),
        "drawstring, ends drawn back": closing("pulled"),
    }
    rubbed = {f"{mu:g}": closing("winch", friction=mu) for mu in (FRICTION[1:4:2] if quick else FRICTION)}
    still = closing("winch", speed=0.0)
    for mu, solution in rubbed.items():
        history = solution.history
        energy = history["total_energy"] + history["dissipated_energy"]
        scale = history["kinetic_energy"][0]
        rows.append(
            Row(
                f"winch, μ = {mu}, change of energy with heat and the energy of the winch",
                float(np.abs(energy - energy[0]).max()),
                0.0,
                "energy balance",
                5e-3,
                "half of what a run is ended at",
                unit="J",
                scale=scale,
            )
        )
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
                f"{work_of(solution):.2f} J",
                f"{found['debris_speed'].value:.2f} m/s",
            ]
        )
    caught, by_mu = captures(quick)
    ends = {key: solution.history["mouth"][-1] / solution.history["mouth"][0] for key, solution in caught.items()}
    held = runs["drawstring, ends held"]
    wound, across = (rubbed["0.3"].history[name].mean() for name in ("wound", "across"))
    lost, earlier = 1.0 - across / wound, narrow(still) - narrow(rubbed["0.3"])
    closing_at = [mu for mu, solution in rubbed.items() if narrow(solution) is not None]
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
                checked=bool(share < 0.05 and work_of(held) == 0.0),
            ),
            Verdict(
                "friction at the rings takes cinch force, and the mouth still closes",
                "holds",
                f"at μ = 0.3, {100.0 * lost:.0f} % of the pull is lost up to the opposite corner; the mouth comes down "
                f"to {100.0 * NARROW:g} % of its area {1e3 * earlier:.0f} ms earlier than without any pull, and it "
                f"closes at each μ of {', '.join(closing_at)}",
                checked=bool(lost > 0.3 and earlier > 0.0 and closing_at),
            ),
            Verdict(
                "a drawstring through rings at the corners closes the captures",
                "holds",
                "at the end the mouth has "
                + ", ".join(
                    f"{100.0 * ends[name, 'winch']:.2g} % of its area in {name} (by the reel "
                    f"{100.0 * ends[name, 'reel']:.2g} %)"
                    for name in CAPTURES
                ),
                checked=quick or all(ends[name, "winch"] < NARROW for name in CAPTURES),
            ),
        ],
        tables=[
            Table("A net closes around debris", [*columns, "speed of the debris"], table),
            by_friction("Cinch force by friction at the rings", rubbed | {"winch stands still": still}, START),
            by_way(caught),
            by_friction("Cinch force in the capture of the stage", by_mu, HAULED),
        ],
        figures=[Figure("Mouth of the net over time.", drawn)],
    )
