"""The price of modelling

What a choice of the model changes in the answer, and what it costs: smoothing of the cable law, elements per line,
their order, mass, stiffness of the contact, and step. A ball of 1 kg at 1 m/s hits a slack square web; each row of
the table changes one thing in the model of its first row, central differences at half of their bound with the
tension-only law, one straight element per line, lumped mass and a contact of 1e5 N/m. The answers are the largest
displacement of the centre and the largest stress of any line, each with its change; the stress is that of one moment
in one line, and whatever shifts the moment changes it: a small difference says no more than that. CPU
time is that of the whole run without a twin, the less of two, and with it stand the steps, which do not depend on the
machine.

What is asserted follows from the models alone: the smooth law goes over into the tension-only law as η goes to zero;
the bound on steps, 2/ω of the fastest element, makes the number of steps grow in proportion to elements per line and
to 1/safety. Order and mass are compared with CVODE at order 1, which takes both, so that the row shows the model and
not the method.

A second table has a ring of 1 kg that swings on a rope between two posts, as in ``refweb run ring-on-thread``, on one
thread and on short lines that touch a ring of 20 mm. Both begin with the tension of the ring at rest. The ring of the
thread is a point; its speed at the bottom of the ellipse is √(2 g b (1 − cos φ₀)), with b = 0.8 m and φ₀ = 0.5.
"""

from __future__ import annotations

import time

import numpy as np

import refweb

from ..harness.case import Case, Row, Table, Verdict, slope

WEB = dict(mesh="square", side=0.1)
SOFT = dict(law="tension-only", modulus=7e7, area=1e-4, density=200.0)
ETAS = (1e-2, 1e-3, 1e-4, 1e-5)
SAFETIES = (0.9, 0.5, 0.25, 0.125)
PARTS = (1, 2, 4)
ROPE = dict(modulus=1e9, area=1e-5, prestrain=5.38068e-4)
"""Rope of a ring, with the tension of the ring at rest, 5.38 N."""
RING = dict(radius=0.02, normal=[0.0, 1.0, 0.0], mass=1.0)
IMPLICIT = dict(method="cvode", rtol=1e-4)
OBSERVED = (
    refweb.Observe(name="deflection", quantity="displacement", node="centre", reduce="max"),
    refweb.Observe(name="stress", quantity="stress", reduce="max"),
)


def scene(rows, duration, cable=None, contact=1e5, **solve):
    """The web that is hit, with what a row changes."""
    place = dict(position=(0.01, 0.02, -0.105), velocity=(0.0, 0.0, 1.0))
    return refweb.Scene(
        web=refweb.Window(rows=rows, columns=rows, **WEB),
        cable=refweb.Cable(**{**SOFT, **(cable or {})}),
        effects=[refweb.Body(name="ball", radius=0.1, mass=1.0, **place), refweb.Contact(stiffness=contact)],
        observe=OBSERVED,
        accuracy=refweb.Accuracy(error="none"),
        solve=refweb.Dynamic(duration=duration, **solve),
    )


def models(quick):
    """What a row changes, as (kind, name, changes)."""
    yield "base", "as described above", {}
    for eta in ETAS:
        yield "η", f"smooth law, η = {eta:g}", dict(cable=dict(law="smooth", smoothing=eta))
    for parts in PARTS[1:]:
        yield "elements", f"{parts} elements per line", dict(cable=dict(subdivide=parts))
    for contact in (1e4, 1e6):
        yield "contact", f"contact of {contact:g} N/m", dict(contact=contact)
    for safety in SAFETIES:
        if safety != 0.5:
            yield "step", f"{safety:g} of the bound", dict(safety=safety)
    if not quick:
        yield "implicit", "CVODE, BDF, rtol = 1e-4", IMPLICIT
        yield "implicit", "the same, 2 elements per line", dict(cable=dict(subdivide=2), **IMPLICIT)
        yield "implicit", "the same, order 2 instead", dict(cable=dict(order=2), **IMPLICIT)
        yield "implicit", "the same, consistent mass", dict(mass="consistent", **IMPLICIT)


def swinging(count=None):
    """Scene of a ring that swings on a thread, or on ``count`` lines in contact with it."""
    scene = refweb.Scene.load("ring-on-thread").to_dict()
    scene |= {"accuracy": {"error": "none"}, "solve": {"kind": "dynamic", "duration": 1.0}}
    tension = {"name": "tension", "quantity": "tension", "reduce": "max", "average": 1e-2}
    speed = {"name": "speed", "quantity": "velocity", "reduce": "max"}
    if count is None:
        scene["observe"] = [speed | {"node": "ring"}, tension | {"thread": "thread"}]
        scene["thread"][0] |= ROPE
        return refweb.Scene.from_dict(scene)
    places, centre = rope_below(np.array(scene["web"]["points"]), count)
    del scene["thread"], scene["point_mass"]
    return refweb.Scene.from_dict(
        scene
        | {
            "web": {"kind": "inline", "points": places, "lines": [[i, i + 1] for i in range(count)]},
            "supports": {"nodes": [0, count]},
            "cable": {"law": "tension-only", **ROPE, "density": 1000.0},
            "body": [{"name": "ring", "shape": "ring", **RING, "position": centre}],
            "contact": {"stiffness": 1e5},
            "observe": [speed | {"body": "ring"}, tension],
        }
    )


def rope_below(points, count):
    """(Points of ``count`` equal parts of a rope from post to post below a ring, centre of the ring), as lists."""
    low, radius = points[2], RING["radius"]
    far = np.linalg.norm(points[:2] - low, axis=1)
    (a, b), side = (points[:2] - low) / far[:, None], np.array([0.0, 1.0, 0.0])
    half, up = 0.5 * np.arccos(a @ b), (a + b) / np.linalg.norm(a + b)
    centre, cut, arc = low + radius / np.sin(half) * up, radius / np.tan(half), radius * (np.pi - 2.0 * half)
    across = np.cross(side, up)
    across *= np.sign(across @ b)
    places = []
    for way in np.linspace(0.0, far.sum() - 2.0 * cut + arc, count + 1):
        on = way - (far[0] - cut)
        turn = np.clip(on, 0.0, arc) / radius - 0.5 * arc / radius
        place = centre + radius * (np.sin(turn) * across - np.cos(turn) * up)
        places.append((place - min(on, 0.0) * a + max(on - arc, 0.0) * b).tolist())
    return places, centre.tolist()


def rings(quick):
    """(Table of rings on a thread and on lines, row of the thread's speed, verdict on lines)."""
    exact = np.sqrt(2.0 * 9.81 * 0.8 * (1.0 - np.cos(0.5)))
    refweb.run(swinging())  # compiles
    table, speeds = [], []
    for count in (None, *((50, 100) if quick else (50, 100, 200))):
        began = time.process_time()
        solution = refweb.run(swinging(count))
        spent = time.process_time() - began
        speed, tension = (solution.results[name].value for name in ("speed", "tension"))
        speeds.append(speed)
        name = "one thread" if count is None else f"{count} lines in contact with the ring"
        change = f"{100.0 * (speed / exact - 1.0):+.2f} %"
        table.append([name, f"{speed:.4f} m/s", change, f"{tension:.2f} N", f"{solution.solver['nsteps']}"])
        table[-1].append(f"{spent:.2f} s")
    off = np.abs(np.array(speeds) / exact - 1.0)
    first, last = 100.0 * off[1], 100.0 * off[-1]
    columns = ["model", "largest speed", "change", "largest tension, mean of 10 ms", "steps", "CPU time"]
    reason = "half of the strain energy of the rope, 2.9 mJ of 961 mJ, and 300 steps"
    return (
        Table("A ring on a thread, and on lines that touch it", columns, table),
        Row("ring on a thread, largest speed", speeds[0], exact, "energy on the ellipse", 2e-3, reason, "m/s"),
        Verdict(
            "a thread does what ever shorter lines in contact tend to",
            "holds",
            f"the speed on the longest lines differs by {first:.2g} %, on the shortest by {last:.2g} %: they rattle on "
            "the ring, which makes peaks of tension",
            checked=bool(off[0] < off[-1] < off[1]),
        ),
    )


def case(quick):
    """Two tables, and what the models themselves say of it."""
    rows, duration = (6, 0.05) if quick else (12, 0.15)
    table, found = [], {}
    for kind, name, changes in models(quick):
        given, spent = scene(rows, duration, **changes), np.inf
        for _ in range(2):
            began = time.process_time()
            solution = refweb.run(given)
            spent = min(spent, time.process_time() - began)
        answers = np.array([solution.results[o.name].value for o in OBSERVED])
        found.setdefault(kind, []).append((answers, solution.solver["nsteps"], spent))
        change = 100.0 * (answers / found["base"][0][0] - 1.0)
        cells = [
            f"{1e3 * answers[0]:.3f} mm",
            f"{change[0]:+.2f} %",
            f"{1e-3 * answers[1]:.2f} kPa",
            f"{change[1]:+.2f} %",
        ]
        table.append([name, *cells, f"{solution.solver['nsteps']}", f"{spent:.2f} s"])
    base, base_steps, _ = found["base"][0]
    off = [abs(answers[0] - base[0]) for answers, *_ in found["η"]]
    steps = {**dict(zip(SAFETIES[:1] + SAFETIES[2:], [n for _, n, _ in found["step"]], strict=True)), 0.5: base_steps}
    parts = [base_steps, *(n for _, n, _ in found["elements"])]
    finest = found["step"][-1][0]
    by_step = 100.0 * abs(base[0] / finest[0] - 1.0)
    by_elements = 100.0 * abs(found["elements"][-1][0][0] / base[0] - 1.0)
    of_rings, speed, shorter = rings(quick)
    return Case(
        rows=[
            Row(
                "steps over 1/safety, exponent",
                slope([1.0 / s for s in SAFETIES], [steps[s] for s in SAFETIES]),
                1.0,
                "a step is a share of the bound",
                0.1,
                "each history row takes a whole number of steps",
            ),
            Row(
                "steps over elements per line, exponent",
                slope(PARTS, parts),
                1.0,
                "ω of the fastest element goes with 1/length",
                0.2,
                "contact, which adds to ω, does not",
            ),
            speed,
        ],
        verdicts=[
            Verdict(
                "the smooth law goes over into the tension-only law",
                "holds",
                "deflections differ by " + ", ".join(f"{d:.1e} m at η = {e:g}" for e, d in zip(ETAS, off, strict=True)),
                checked=bool((np.diff(off) < 0).all()),
            ),
            Verdict(
                "elements per line matter more to the deflection than steps",
                "holds",
                f"four elements per line change it by {by_elements:.2g} %, a quarter of the step by {by_step:.2g} %",
                checked=by_elements > by_step,
            ),
            shorter,
        ],
        tables=[
            Table(
                "What a choice changes, and what it costs",
                ["model", "deflection", "change", "largest stress", "change", "steps", "CPU time"],
                table,
            ),
            of_rings,
        ],
    )
