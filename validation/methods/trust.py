"""Does the whole ± contain the truth

``refweb trust`` finds every part of the error of a result, and says with a verdict what the number is worth. Here ± and
verdict are held against the truth, on motions that nobody has chosen: random impacts on small webs, a flying ball or a
node that is thrown, and random captures, small nets with masses at their corners that are thrown at a sphere which is
fixed or free, rubs, and of some of which the lines touch each other.

Truth is the same scene without what ± is about: 8 elements per line, 64 times the stiffness of contact, the
tension-only law where the scene has the smooth one, which is its limit, and steps that are shorter by all of that and
by the factor 2. What truth itself leaves open is the difference to a second one with 6 elements, 32 times the stiffness
and a thousandth of the smoothing; it is added to ±. The linear law is left out: a line in several elements is a chain,
which does not push, so that finer elements are another model.

The results are the largest displacement, stress and speed, kinetic energy, speed and place of what flies, the largest
force of contact, and its largest mean over a fifth of the time. Asked for is that ± contains the truth in 95 of 100,
but for results that have no limit; that ± is in the median at most 8 times what is off; that no result which is
called determined is off by more than its digits allow; and that there is no limit only where there is none. For that
each result of which it is said is computed with 1, 2, 4 and 8 elements, and with 1, 4, 16 and 64 times the stiffness
beside these.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

import refweb
from refweb.results.error_budget import DETERMINED, NO_LIMIT, VERDICTS
from refweb.studies.further_runs import stiffness_of

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table
from .coverage import random_impact

IMPACTS, CAPTURES = 100, 30
CHEAP = 2
"""Seed of a capture that takes a second."""
TRUTH = dict(elements=8, stiffness=64.0, smoothing=0.0, safety=0.25)
SECOND = dict(elements=6, stiffness=32.0, smoothing=1e-3, safety=0.3)
"""Truth and what it is compared with: elements per line, factors on stiffness and smoothing, safety of steps."""
FINER = (1, 2, 4, 8)
CONVERGED = 0.1
"""Change from 4 to 8 elements, over the value, up to which a result converges: a force of first touch falls by 0.3."""


def with_force(scene):
    """A scene that observes the largest force on the ball as well, and its largest mean over a fifth of the time."""
    force = dict(quantity="reaction", body="ball", reduce="max")
    observe = [
        refweb.Observe(name="contact_force", **force),
        refweb.Observe(name="mean_force", average=scene.solve.duration / 5, **force),
    ]
    return scene.replace(observe=[*scene.observables, *observe])


def random_capture(seed):
    """A small net with masses at its corners, thrown at a sphere."""
    random = np.random.default_rng(seed)
    mesh, count, side = str(random.choice(["triangle", "square", "hexagon"])), int(random.integers(4, 7)), 0.15
    radius, speed = random.uniform(0.12, 0.2), 10.0 ** random.uniform(0.3, 0.8)
    free = {"mass": 10.0 ** random.uniform(-0.5, 0.7)} if random.random() < 0.5 else {"fixed": True}
    place = (*random.uniform(-0.05, 0.05, 2), radius + 0.01)
    effects = [
        refweb.Body(name="ball", radius=radius, position=place, **free),
        refweb.Contact(stiffness=10.0 ** random.uniform(3.0, 4.0), friction=random.uniform(0.1, 0.4)),
        refweb.PointMass(node="corners", mass=10.0 ** random.uniform(-1.5, -0.7)),
        refweb.Velocity(node="all", value=(*random.uniform(-0.2, 0.2, 2), speed)),
    ]
    if random.random() < 0.3:
        effects.append(refweb.SelfContact(radius=0.004))
    observe = [
        refweb.Observe(name="deflection", quantity="displacement", reduce="max"),
        refweb.Observe(name="max_stress", quantity="stress", reduce="max"),
        refweb.Observe(name="max_speed", quantity="velocity", reduce="max"),
        refweb.Observe(name="kinetic", quantity="kinetic_energy"),
        refweb.Observe(name="ball_speed", quantity="velocity", body="ball"),
        refweb.Observe(name="mouth", quantity="mouth_area", node="corners"),
    ]
    return refweb.Scene(
        web=refweb.Window(mesh=mesh, rows=count, columns=count, side=side),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-5, density=1000.0),
        supports=refweb.Supports(nodes=[]),
        effects=effects,
        observe=observe[: 4 if "fixed" in free else 5] + observe[5:],
        solve=refweb.Dynamic(duration=1.2 * count * side / speed),
    )


def scenes(kind, first=0):
    """Scenes of a kind without end, with their seeds."""
    for seed in itertools.count(first):
        scene = random_impact(seed) if kind == "impact" else random_capture(seed)
        if scene.cable.law != "linear":
            yield seed, with_force(scene) if scene.contact else scene


def results_at(scene, elements=1, stiffness=1.0, smoothing=1.0, safety=None):
    """Values of a scene without errors, with other elements, stiffness of contact, smoothing and steps."""
    settled = scene.settled().replace(chosen=())
    given = stiffness_of(settled, settled.build())
    cable = replace(scene.cable, subdivide=elements)
    if cable.law == "smooth" and smoothing:
        cable = replace(cable, smoothing=smoothing * cable.smoothing)
    elif cable.law == "smooth":
        kept = {key: getattr(cable, key) for key in ("modulus", "area", "density", "prestrain", "subdivide")}
        cable = refweb.Cable(law="tension-only", **kept)
    solve = scene.solve if safety is None else replace(scene.solve, method="central-difference", safety=safety)
    other = settled.replace(cable=cable, solve=solve, accuracy=refweb.Accuracy(error="none"))
    if given:
        other = other.with_stiffness({name: stiffness * value for name, value in given.items()}).replace(chosen=())
    return {name: result.value for name, result in refweb.run(other, progress=False).results.items()}


def trial(kind, seed, scene):
    """Results of one scene beside the truth, a list of dict; a text where refweb refuses the scene or its truth."""
    try:
        solution = refweb.trust(scene, progress=False)
        truth, second = results_at(scene, **TRUTH), results_at(scene, **SECOND)
        found = []
        for name, result in solution.results.items():
            entry = {"kind": kind, "seed": seed, "name": name, "value": result.value, "error": result.error}
            entry |= {"verdict": result.verdict, "digits": result.digits, "parts": dict(result.parts)}
            entry |= {"truth": truth[name], "open": abs(truth[name] - second[name]) + 1e-14 * abs(truth[name])}
            found.append(entry)
        if doubted := [entry for entry in found if entry["verdict"] == NO_LIMIT]:
            finer = [results_at(scene, n) for n in FINER]
            both = [results_at(scene, n, n * n) for n in FINER]
            for entry in doubted:
                entry["finer"], entry["both"] = ([one[entry["name"]] for one in of] for of in (finer, both))
    except refweb.SolverError as error:
        return f"{kind} {seed}: {error}"
    return found


def trials(kind, count, first=0):
    """Results of so many scenes of a kind from a seed on, and the texts of those that were refused before."""
    done, refused = [], []
    for seed, scene in scenes(kind, first):
        outcome = trial(kind, seed, scene)
        if isinstance(outcome, str):
            refused.append(outcome)
        else:
            done.append(outcome)
        if len(done) == count:
            return list(itertools.chain(*done)), refused


def off(entry):
    return abs(entry["value"] - entry["truth"])


def inside(entry):
    return off(entry) <= entry["error"] + entry["open"]


def wrong(entry):
    """True for a result that is called determined and is off by more than its digits allow, or ± where it has none.

    Without a digit is what hardly moves, as a web that is missed, whose speed is a rounding of its own.
    """
    allowed = 10.0 ** -entry["digits"] * abs(entry["value"]) if entry["digits"] else entry["error"]
    return entry["verdict"] == DETERMINED and off(entry) > allowed + entry["open"]


def converges(values):
    """True where values at twice the elements each change less every time, and in the end little."""
    changes = np.abs(np.diff(values))
    return bool(changes[-1] <= CONVERGED * abs(values[-1]) and (np.diff(changes) < 0.0).all())


def widths(entries):
    """± over what is off, where truth is sure enough to tell what is off."""
    return np.array([entry["error"] / off(entry) for entry in entries if off(entry) > 2.0 * entry["open"]])


def judged(kind, entries):
    """Rows on the trials of one kind."""
    limited = [entry for entry in entries if entry["verdict"] != NO_LIMIT and not exact(entry)]
    share, width = float(np.mean([inside(entry) for entry in limited])), float(np.median(widths(limited)))
    mistaken = sum(wrong(entry) for entry in entries)
    without = [entry for entry in entries if entry["verdict"] == NO_LIMIT]
    strange = sum(entry["name"] != "contact_force" for entry in without)
    settled = sum(converges(entry["both"]) for entry in without)
    asked, count = "asked for", dict(tolerance=0.5, reason="a count", scale=1)
    return [
        Row(f"{kind}s: share of results whose ± contains the truth", share, 1.0, asked, 0.05, "95 of 100", scale=1),
        Row(f"{kind}s: median of ± over what is off", width, 4.0, "asked for: ≤ 8", 4.0, "≤ 8", scale=1),
        Row(f"{kind}s: determined, and off by more than the digits allow", mistaken, 0.0, asked, **count),
        Row(f"{kind}s: without limit, and no peak of a contact force", strange, 0.0, asked, **count),
        Row(f"{kind}s: without limit, and converges with elements and stiffness", settled, 0.0, asked, **count),
    ]


def exact(entry):
    """True where nothing is off, as of a web that nothing has touched: that says nothing of ±."""
    return off(entry) <= 1e-12 * abs(entry["truth"])


def grouped(entries, key, names):
    """Lines of a table: a group, results, share inside, median of ± over what is off."""
    for name in names:
        of = [entry for entry in entries if key(entry) == name and not exact(entry)]
        if of:
            wide = widths(of)
            share = f"{100 * np.mean([inside(entry) for entry in of]):.1f} %"
            yield [str(name), len(of), share, f"{np.median(wide):.2g}" if len(wide) else "truth does not tell"]


def tables(entries, refused):
    """Tables by verdict and by result, of what has no limit, of what is not contained and of what was refused."""
    head = ["results", "inside ±", "median of ± over what is off"]
    verdicts = [*VERDICTS, None]
    by_verdict, by_name = [], []
    for kind in dict.fromkeys(entry["kind"] for entry in entries):
        of = [entry for entry in entries if entry["kind"] == kind]
        by_verdict += [[kind, *line] for line in grouped(of, lambda entry: entry["verdict"], verdicts)]
        by_name += [[kind, *line] for line in grouped(of, lambda e: e["name"], dict.fromkeys(e["name"] for e in of))]
    yield Table("By verdict", ["kind", "verdict", *head], by_verdict)
    yield Table("By result", ["kind", "result", *head], by_name)
    of_force = [entry for entry in entries if entry["verdict"] == NO_LIMIT]
    if of_force:
        alone = sum(converges(entry["finer"]) for entry in of_force)
        both = sum(converges(entry["both"]) for entry in of_force)
        lines = [
            ["1, 2, 4 and 8 elements, stiffness as given", len(of_force), alone],
            ["1, 2, 4 and 8 elements, with 1, 4, 16 and 64 times the stiffness", len(of_force), both],
        ]
        yield Table("Forces of contact without limit", ["computed with", "forces", "of these converge"], lines)
    if missed := [entry for entry in entries if not inside(entry) or wrong(entry)]:
        lines = [
            [
                f"{entry['kind']} {entry['seed']}",
                entry["name"],
                f"{entry['value']:.4g} ± {entry['error']:.2g}",
                f"{entry['truth']:.4g} ± {entry['open']:.2g}",
                str(entry["verdict"]),
            ]
            for entry in missed
        ]
        yield Table("Not contained", ["scene", "result", "value", "truth", "verdict"], lines)
    if refused:
        yield Table("Refused, and left out", ["scene and reason"], [[text] for text in refused])


def drawing(entries):
    page, plot = plots.axes("± over what is off", "share of results")
    for kind in dict.fromkeys(entry["kind"] for entry in entries):
        order = np.sort(widths([e for e in entries if e["kind"] == kind and not exact(e)]))
        plot.semilogx(order, np.arange(1, len(order) + 1) / len(order), label=f"{kind}s")
    plot.axvline(1.0, **plots.REFERENCE)
    plot.legend(frameon=False)
    return page


def case(quick):
    counts = {"impact": 3, "capture": 1} if quick else {"impact": IMPACTS, "capture": CAPTURES}
    entries, refused, rows = [], [], []
    for kind, count in counts.items():
        done, kept = trials(kind, count, CHEAP if quick and kind == "capture" else 0)
        entries, refused = entries + done, refused + kept
        rows += judged(kind, done)
    caption = f"How wide ± is, for {len(entries)} results; left of 1 the truth is outside of it."
    return Case(rows=rows, tables=list(tables(entries, refused)), figures=[Figure(caption, lambda: drawing(entries))])
