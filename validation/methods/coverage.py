"""Does ± contain the truth

Every result of refweb has a ±. Here it is held against the truth: closed forms of statics and of oscillators, and for
nets short explicit steps of order 6; what those still differ from steps that are twice as long, and from order 4, is
added to ±. All methods, several accuracies of each; regular motions, and nets that go slack and snap taut or are hit,
whose peaks are of no order.

Random impacts on small webs, a flying ball or a node that is thrown, have a table of their own: each method at its
default, history rows as usual and, for explicit steps and Adams methods, a single row as long as the run. There what
truth is comes from a method of another kind at far smaller steps: Adams methods at rtol = 1e-11 for explicit steps and
for ``auto``, explicit steps of order 6 for CVODE and IDA. ± has to contain it in 97 of 100, nothing may be off by more
than three times ±, and in the median ± may be 8 times what is off.

Over all observables ± has to contain the truth in 95 of 100, and in the median it may not be wider than 30 times what
is really off. The bounds on tensions that statics proves from convex duality count as contained or not, and are left
out of the width: they hold for every net, and are wide where nothing is off.
"""

import itertools

import mpmath
import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table

EA = 7e3
CABLE = dict(modulus=7e7, area=1e-4, density=200.0)
METHODS = [
    dict(method="central-difference", safety=0.5),
    dict(method="central-difference", safety=0.2),
    dict(method="explicit", order=4),
    dict(method="explicit", order=6),
    dict(method="cvode", rtol=1e-4),
    dict(method="cvode", rtol=1e-6),
    dict(method="cvode", family="adams", rtol=1e-4),
    dict(method="cvode", family="adams", rtol=1e-6),
    dict(method="ida", rtol=1e-5),
]
OBSERVE = [
    refweb.Observe(name="deflection", quantity="displacement", reduce="max"),
    refweb.Observe(name="max_stress", quantity="stress", reduce="max"),
    refweb.Observe(name="max_speed", quantity="velocity", reduce="max"),
    refweb.Observe(name="centre", quantity="displacement", node="centre", component="z"),
    refweb.Observe(name="kinetic", quantity="kinetic_energy"),
]


def named(keys):
    """A method in words."""
    return " ".join(str(value) for value in keys.values())


# Closed forms


def arms():
    """Two lines of 0.9 m from (±1, 0, 0) to a loaded node: P = 2 EA (l/L − 1) d/l, solved to 30 digits."""
    for load, law in itertools.product((1e-3, 1.0, 37.0, 900.0), ("linear", "tension-only")):
        with mpmath.workdps(30):
            natural = mpmath.mpf(9) / 10

            def pull(d, natural=natural):
                return 2 * EA * (mpmath.sqrt(1 + d * d) / natural - 1) * d / mpmath.sqrt(1 + d * d)

            depth = mpmath.findroot(lambda d, load=load: pull(d) - load, load / 2e3)
            strain = float(mpmath.sqrt(1 + depth * depth) / natural - 1)
        scene = refweb.Scene(
            web=refweb.Inline(
                points=[[-1, 0, 0], [1, 0, 0], [0, 0, 0]], lines=[[0, 2], [1, 2]], natural_length=0.9, supports=[0, 1]
            ),
            cable=refweb.Cable(law=law, **CABLE),
            effects=[refweb.Load(node=2, force=(0, 0, -load))],
            observe=[
                refweb.Observe(name="depth", quantity="position", node=2, component="z"),
                refweb.Observe(name="reaction", quantity="reaction", node=0, component="z"),
                refweb.Observe(name="tension", quantity="tension"),
            ],
        )
        exact = {"depth": -float(depth), "reaction": load / 2, "tension": EA * strain}
        bounds = {"tension"} if law == "tension-only" else set()
        yield f"two arms, {load:g} N, {law}", refweb.run(scene).results, exact, {}, bounds


def oscillators(methods):
    """1 kg on a line that pulls and pushes: x = a sin ωt, ω = √(EA/L m), a ω = 1 m/s; displacements stay below 1 %."""
    rate, end = np.sqrt(EA), 0.3
    exact = {
        "x": np.sin(rate * end) / rate,
        "v": np.cos(rate * end),
        "farthest": 1 / rate,
        "potential": 0.5 * np.sin(rate * end) ** 2,
    }
    for keys in methods:
        scene = refweb.Scene(
            web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
            cable=refweb.Cable(law="linear", **{**CABLE, "density": 0.0}),
            effects=[refweb.PointMass(node=1, mass=1.0), refweb.Velocity(node=1, value=(1.0, 0.0, 0.0))],
            support=[refweb.Supports(nodes=1, components=["y", "z"])],
            observe=[
                refweb.Observe(name="x", quantity="displacement", node=1, component="x"),
                refweb.Observe(name="v", quantity="velocity", node=1, component="x"),
                refweb.Observe(name="farthest", quantity="displacement", node=1, component="x", reduce="max"),
                refweb.Observe(name="potential", quantity="strain_energy"),
            ],
            solve=refweb.Dynamic(duration=end, **keys),
        )
        yield f"oscillator, {named(keys)}", refweb.run(scene).results, exact, {}, set()


# Nets


def nets():
    """Scenes by name, without a method."""

    def thrown(mesh, speed=2.0, effects=(), **cable):
        return refweb.Scene(
            web=refweb.Window(mesh=mesh, rows=5, columns=5, side=0.2),
            cable=refweb.Cable(**{"prestrain": 0.01, **CABLE, **cable}),
            effects=[refweb.Velocity(node="centre", value=(0.3, 0.1, speed)), *effects],
            observe=OBSERVE,
        )

    ball = refweb.Body(name="ball", radius=0.15, mass=0.5, position=(0.01, 0.02, -0.16), velocity=(0.0, 0.1, 3.0))
    smooth = dict(law="smooth", smoothing=1e-3)
    return {
        "taut square web": thrown("square", **smooth),
        "taut triangle web, gravity": thrown(
            "triangle", effects=[refweb.Gravity(acceleration=(0, 1, -9.81))], **smooth
        ),
        "taut hexagon web, linear law": thrown("hexagon", law="linear"),
        "slack square web": thrown("square", 5.0, law="tension-only", prestrain=-0.002),
        "square web hit by a ball": thrown(
            "square", 0.0, [ball, refweb.Contact(stiffness=1e4)], law="tension-only", prestrain=0.0
        ),
    }


def against_fine_steps(name, scene, methods, duration):
    """A scene by all methods against explicit steps of order 6."""
    fine, twice, other = [
        refweb.run(
            scene.replace(
                solve=refweb.Dynamic(duration=duration, method="explicit", safety=safety, order=order),
                accuracy=refweb.Accuracy(error="none"),
            )
        ).results
        for safety, order in ((0.02, 6), (0.04, 6), (0.02, 4))
    ]
    exact = {key: result.value for key, result in fine.items()}
    open_ = {key: 2 * abs(twice[key].value - exact[key]) + 2 * abs(other[key].value - exact[key]) for key in exact}
    for keys in methods:
        solved = refweb.run(scene.replace(solve=refweb.Dynamic(duration=duration, **keys)))
        yield f"{name}, {named(keys)}", solved.results, exact, open_, set()


# Random impacts

BY_CHANCE = {
    "central differences": (dict(method="central-difference"), 200, True),
    "order 6": (dict(method="explicit", order=6), 200, True),
    "Adams": (dict(method="cvode", family="adams"), 200, True),
    "auto": (dict(method="auto"), 200, True),
    "BDF, rtol = 1e-4": (dict(method="cvode", rtol=1e-4), 50, False),
    "IDA, rtol = 1e-4": (dict(method="ida", rtol=1e-4), 50, False),
}
"""Keys of [solve], number of impacts, and whether a single row is tried as well, by the name of the method."""
FINE = [dict(method="explicit", order=6, safety=0.01), dict(method="cvode", family="adams", rtol=1e-11)]
"""Two methods that are taken for truth, each for those of the other kind; what lies between them is added to ±."""


def random_impact(seed):
    """A scene without a method: one of three webs, of some law and prestrain, that is hit or thrown."""
    random = np.random.default_rng(seed)
    mesh, law = random.choice(["triangle", "square", "hexagon"]), random.choice(["tension-only", "smooth", "linear"])
    count, speed = int(random.integers(3, 6)), 10.0 ** random.uniform(-0.3, 1.0)
    cable = dict(law=str(law), prestrain=random.uniform(1e-3 if law == "linear" else -2e-3, 0.01))
    velocity = speed * np.append(random.uniform(-0.3, 0.3, 2), 1.0)
    observe = [*OBSERVE[:3], OBSERVE[4]]
    if random.random() < 0.6:
        radius, gap = random.uniform(0.08, 0.2), random.uniform(0.001, 0.02)
        place = (*random.uniform(-0.1, 0.1, 2), -radius - gap)
        mass, stiffness = 10.0 ** random.uniform(-1.0, 0.5), 10.0 ** random.uniform(3.5, 4.5)
        ball = refweb.Body(name="ball", radius=radius, mass=mass, position=place, velocity=tuple(velocity))
        effects = [ball, refweb.Contact(stiffness=stiffness)]
        observe.append(refweb.Observe(name="ball_speed", quantity="velocity", body="ball"))
        observe.append(refweb.Observe(name="ball_height", quantity="position", body="ball", component="z"))
    else:
        mass = refweb.PointMass(node="centre", mass=10.0 ** random.uniform(-1.5, 0.0))
        effects = [refweb.Velocity(node="centre", value=tuple(velocity)), mass]
        observe.append(refweb.Observe(name="centre_speed", quantity="velocity", node="centre"))
        observe.append(OBSERVE[3])
    return refweb.Scene(
        web=refweb.Window(mesh=str(mesh), rows=count, columns=count, side=0.2),
        cable=refweb.Cable(**CABLE, **({"smoothing": 1e-3} if law == "smooth" else {}), **cable),
        effects=effects,
        observe=observe,
        solve=refweb.Dynamic(duration=random.uniform(0.005, 0.04)),
    )


def impacts():
    """Random impacts without end, each with its results by both of `FINE`.

    Of a random stiffness that lets the ball pass the web there are none: refweb refuses such runs.
    """
    for seed in itertools.count():
        scene = random_impact(seed)
        duration, quiet = scene.solve.duration, refweb.Accuracy(error="none")
        try:
            fine = [
                refweb.run(scene.replace(solve=refweb.Dynamic(duration=duration, **keys), accuracy=quiet)).results
                for keys in FINE
            ]
        except refweb.SolverError as error:
            if "passes the core" not in str(error):
                raise
            continue
        yield scene, fine


def by_chance(quick):
    """What is off, ± and what truth leaves open, of all results of random impacts, by method and rows."""
    found, most = {}, 1 if quick else max(count for _, count, _ in BY_CHANCE.values())
    for number, (scene, fine) in enumerate(itertools.islice(impacts(), most)):
        duration = scene.solve.duration
        for name, (keys, count, alone) in list(BY_CHANCE.items())[:: 2 if quick else 1]:
            if number >= count:
                continue
            truth = fine[0 if keys["method"] in ("cvode", "ida") else 1]
            asked = scene.replace(solve=refweb.Dynamic(duration=duration, **keys))
            rows = {"": asked}
            if alone:
                rows[", one row"] = asked.replace(output=refweb.Output(interval=duration))
            for which, one in rows.items():
                for key, result in refweb.run(one).results.items():
                    between = abs(fine[0][key].value - fine[1][key].value) + 1e-14 * abs(truth[key].value)
                    off = abs(result.value - truth[key].value)
                    found.setdefault(name + which, []).append((off, result.error, between))
    return {name: np.array(results) for name, results in found.items()}


def judged(found):
    """Rows and a table of what `by_chance` has found."""
    rows, lines = [], []
    for name, results in found.items():
        off, error, between = results.T
        inside = float(np.mean(off <= error + between))
        worst = float(np.max((off - between) / np.maximum(error, 1e-300)))
        known = off > 2.0 * between
        width = float(np.median(error[known] / off[known]))
        lines.append([name, len(off), f"{100 * inside:.1f} %", f"{worst:.2f}", f"{width:.1f}"])
        rows.append(
            Row(f"random impacts, {name}: share inside ±", inside, 1.0, "asked for", 0.03, "97 of 100", scale=1)
        )
        rows.append(Row(f"{name}: largest error over ±", max(worst, 0.0), 1.5, "asked for: ≤ 3", 1.5, "≤ 3", scale=1))
        rows.append(Row(f"{name}: median of ± over what is off", width, 4.0, "asked for: ≤ 8", 4.0, "≤ 8", scale=1))
    head = ["method", "results", "inside ±", "largest error over ±", "median of ± over what is off"]
    return rows, Table("Random impacts", head, lines)


def case(quick):
    methods = METHODS[::3] if quick else METHODS
    runs = [*arms(), *oscillators(methods)]
    for name, scene in list(nets().items())[:: 3 if quick else 1]:
        runs += against_fine_steps(name, scene, methods, 0.02 if quick else 0.05)
    contained, widths, missed, groups = [], [], [], {}
    for name, results, exact, left, bounds in runs:
        for key, value in exact.items():
            result = results[key]
            off = abs(result.value - value)
            inside = off <= result.error + left.get(key, 0.0)
            contained.append(inside)
            group = groups.setdefault(name.split(",")[0], [[], []])
            group[0].append(inside)
            if key not in bounds and off > max(left.get(key, 0.0), 1e-15 * abs(value)):
                widths.append(result.error / off)
                group[1].append(widths[-1])
            if not inside:
                missed.append([name, key, f"{result.value:.8g} ± {result.error:.2g}", f"{value:.8g}"])
    share, width = float(np.mean(contained)), float(np.median(widths))
    rows = [
        Row("share of observables whose ± contains the truth", share, 1.0, "asked for", 0.05, "95 of 100", scale=1),
        Row("median of ± over what is off", width, 15.5, "asked for: 1 to 30", 14.5, "not wider than 30", scale=1),
    ]
    rows_by_chance, by_method = judged(by_chance(quick))
    rows += rows_by_chance
    by_group = [
        [name, len(inside), f"{100 * np.mean(inside):.1f} %", f"{np.median(wide):.3g}" if wide else "nothing is off"]
        for name, (inside, wide) in groups.items()
    ]
    tables = [Table("By kind of case", ["case", "observables", "contained", "median of ± over what is off"], by_group)]
    tables.append(by_method)
    if missed:
        tables.append(Table("Not contained", ["case", "observable", "result", "truth"], missed))

    def drawing():
        page, plot = plots.axes("± over what is really off", "share of observables")
        order = np.sort(widths)
        plot.semilogx(order, np.arange(1, len(order) + 1) / len(order))
        plot.axvline(1.0, **plots.REFERENCE)
        return page

    caption = f"How wide ± is, for {len(widths)} observables of {len(contained)}; left of 1 the truth is outside of it."
    return Case(rows=rows, tables=tables, figures=[Figure(caption, drawing)])
