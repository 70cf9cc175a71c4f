"""What digits cost

Each scene is run by every method that takes it, from coarse to fine, as ``refweb cost`` does: central differences,
explicit steps of order 4 and 6, CVODE with BDF and Adams methods, IDA, and as a voice from outside scipy's DOP853,
driven by the same compiled forces. Errors are largest differences over the history rows to a reference; the reference
and a second one, of another kind of method, are the finest runs, and the grey zone of a diagram is where they differ:
there nobody knows. CPU time is that of the solver's loop, compiled before, the least of several runs where they are
cheap. A run that fails, is refused or would take more than a third of what is left of the time stands in the legend.

A method costs what the coarsest run costs from which on it keeps the digits, interpolated on logarithmic scales between
that run and the one before. ``method = "auto"`` names a method before anything has run; it has to be one that costs at
most 1.5 times the best at three digits, or at as many as the references allow: in the mean of that, half a digit and a
digit less, as the errors of an impact fall by leaps and a single price is luck. The quick variant runs in tests, on
machines that have other things to do: there all runs are taken in turns, several times over, each counts with the least
CPU time that it has shown, and the bound is 3 times the best.

Last, refweb's explicit steps of order 2, 4 and 6 against DOP853 on the square web of the paper whose centre is thrown:
the ratio of CPU times at equal errors of displacement, with the smooth law, whose forces have the derivatives that high
orders need.
"""

from __future__ import annotations

import math

import numpy as np

import refweb
from refweb.dynamics.method_choice import decided
from refweb.studies import trials
from refweb.studies.work_precision import cost

from ..harness.case import Case, Figure, Table, Verdict

NEAR, NEAR_QUICK = 1.5, 3.0
"""Largest price of the method that "auto" names over the best; in the quick variant."""
ROUNDS, LONG = 5, 0.2
"""Turns of the quick variant, in which runs of less CPU time [s] take part."""
SECONDS = 55.0
"""Budget of a scene [s]."""
ERRORS = 10.0 ** -np.arange(6.0, 11.1)
"""Errors of displacement at which explicit steps and DOP853 are compared [m]."""

SOFT = dict(law="tension-only", modulus=7e7, area=1e-4, density=200.0)
TAUT = dict(law="smooth", smoothing=1e-3, modulus=7e7, area=1e-4, density=200.0, prestrain=1e-2)
STIFF = dict(law="tension-only", modulus=1e11, area=1e-6, density=7800.0)
CENTRE = refweb.Observe(name="centre", quantity="displacement", node="centre")


def thrown(value, mass=None):
    """The centre, with a point mass or without, has a velocity."""
    given = [refweb.Velocity(node="centre", value=value)]
    return given if mass is None else [refweb.PointMass(node="centre", mass=mass), *given]


def ball():
    """A ball of 1 kg at 1 m/s, beside the middle."""
    place = dict(position=(0.01, 0.02, -0.105), velocity=(0.0, 0.0, 1.0))
    return [refweb.Body(name="ball", radius=0.1, mass=1.0, **place), refweb.Contact(stiffness=1e5)]


def scene(title, web, cable, effects, duration, interval=1e-3, **solve):
    """A scene that is observed at its centre."""
    return refweb.Scene(
        title=title,
        web=web,
        cable=refweb.Cable(**cable),
        effects=effects,
        observe=(CENTRE,),
        output=refweb.Output(interval=interval),
        solve=refweb.Dynamic(duration=duration, **{"method": "auto", **solve}),
    )


def window(mesh, rows, columns, side):
    """A window of a web."""
    return refweb.Window(mesh=mesh, rows=rows, columns=columns, side=side)


GRAVITY = refweb.Gravity(acceleration=(0.0, 0.0, -9.81))


def scenes():
    """Pairs of a scene and what is to be seen in its diagram."""
    yield (
        scene("Plain impact", window("square", 10, 10, 0.1), SOFT, ball(), 0.1),
        "A slack square web is hit. Lines go taut and slack, and the ball touches and leaves, so that no method "
        "has its order; waves run through every element, so that no method can step over them. Explicit steps "
        "are cheapest, of order 2 for few digits and of order 6 for many. BDF follows the same waves with steps that "
        "cost far more, and its coarsest runs damp them until their book of energy is open.",
    )
    rubbing = refweb.Contact(stiffness=1e5, friction=0.3, damping=0.1)
    spun = refweb.Body(name="ball", radius=0.1, mass=1.0, position=(0.01, 0.02, -0.105), velocity=(0.7, 0.2, 1.0))
    yield (
        scene("Rubbing impact", window("square", 10, 10, 0.1), SOFT, [spun, rubbing], 0.1),
        "The same web is hit obliquely, with friction at a slip velocity of 0.01 m/s and losses along the normal. "
        "Central differences solve for what is lost, with steps that are those of the impact without losses, and cost "
        "least as far as errors are known. CVODE and IDA cost ten times as much for few digits; DOP853 gains digits "
        "faster, and comes near for many.",
    )
    turning = refweb.Body(
        name="box",
        shape="box",
        size=(0.25, 0.2, 0.15),
        rounding=0.02,
        density=100.0,
        position=(0.01, 0.02, -0.17),
        velocity=(0.0, 0.0, 2.0),
        angular_velocity=(8.0, -5.0, 3.0),
    )
    yield (
        scene("Tumbling capture", window("square", 10, 10, 0.1), SOFT, [turning, refweb.Contact(stiffness=1e4)], 0.1),
        "A box of 0.7 kg tumbles into the web, without friction. Central differences cost least for few digits, "
        "order 4 from some six on; higher orders gain little where lines touch and leave. For equal errors DOP853 "
        "costs ten times as much, Adams methods some forty times, BDF and IDA over a hundred times.",
    )
    cable = refweb.SingleCable(start=(0, 0, 0), end=(3, 0, 0), elements=30, length=3.2, sag=(0, 1, 0))
    yield (
        scene("Stiff cable", cable, STIFF, [GRAVITY], 0.5),
        "A steel cable, E = 1e11 Pa, swings down from a horizontal arc. That takes many explicit steps; "
        "still explicit methods win, as a compiled step costs far less than an implicit one, in Python for the "
        "most part. Central differences have many digits with their longest step already; BDF damps what is in the "
        "swing, and has few until its tolerance is small.",
    )
    ramp = refweb.Load(node="centre", force=(0.0, 0.0, 100.0), factor=[(0.0, 0.0), (8.0, 1.0)])
    steel = {**STIFF, "prestrain": 1e-3}
    effects = [ramp, refweb.Damping(rate=2.0)]
    yield (
        scene("Slow motion of a stiff net", window("square", 8, 8, 0.1), steel, effects, 8.0, 0.1, start="equilibrium"),
        "A taut steel net is loaded over 8 s. Nothing makes waves, and BDF takes steps as long as the motion "
        "allows, far fewer than explicit methods take: implicit steps win clearly. Adams "
        "methods and DOP853 are bound by the frequencies of the net as explicit steps are, and cost more "
        "than those. For many digits BDF has to follow what little does vibrate, and central differences"
        " are cheaper again.",
    )
    cable = refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=40, length=1.1)
    yield (
        scene("Slack cable after a hit", cable, SOFT, thrown((0.3, 0.0, 5.0), 0.1), 0.3),
        "A slack cable snaps taut and whips: at the end two runs that differ by little are far apart, whatever "
        "the method, and before that the centre has few digits. The energy that too long a step brings in shows in the "
        "book and ends central differences in all but short steps; BDF damps so much that it ends likewise.",
    )
    effects = [GRAVITY, refweb.Damping(time=2e-3, rate=30.0)]
    yield (
        scene("Damped settling to rest", window("square", 6, 6, 0.1), TAUT, effects, 1.0, 0.01),
        "A taut web settles under its weight. Damping of its material ends every axial wave in milliseconds and, "
        "stiff itself, makes explicit steps far shorter: implicit steps win clearly. Adams methods, which "
        "solve with the tangent here, cost least, but for the fewest digits, where BDF does. Explicit steps of order 4 "
        "and 6 refuse forces that depend on velocity.",
    )
    yield (
        scene("Ball on a hexagon web", window("hexagon", 11, 9, 0.06), SOFT, ball(), 0.1),
        "As the plain impact, on a web that is a mechanism until its lines are taut. Shorter steps gain digits "
        "unsteadily, as it depends on moments at which lines snap; at few digits explicit steps of all "
        "orders are level, within what is luck. DOP853, which finds those moments by its control of errors, gains "
        "digits steadily, and is cheapest for many where there is time to know them.",
    )
    massless = {**SOFT, "density": 0.0, "prestrain": 1e-2}
    yield (
        scene("Massless nodes", window("square", 4, 4, 0.2), massless, thrown((0.0, 0.0, 1.0), 1.0), 0.2),
        "A mass swings on lines that have none. Every method that divides by mass refuses it; IDA is alone, and "
        "how far its own tolerances agree is all that is known.",
    )


def quick_scenes():
    """Two small ones."""
    damped = [GRAVITY, refweb.Damping(time=2e-3, rate=30.0)]
    yield (
        scene("Thrown window", window("square", 4, 4, 0.2), TAUT, thrown((0.5, 0.2, 2.0)), 0.05),
        "A taut web without contact: explicit steps of every order beat all others.",
    )
    yield scene("Damped window", window("square", 4, 4, 0.1), TAUT, damped, 0.2, 0.01), "Implicit steps win."


def price(found, method, limit, key="error_observable"):
    """CPU time for which a method has an error of ``limit``, interpolated; infinite where it never has.

    None of its finer runs is allowed to be worse. Above its coarsest run a method costs what that costs.
    """
    ladder = [t for t in found.trials if t.method == method and t.status == "solved"]
    good = next((i for i, t in enumerate(ladder) if all(getattr(f, key) <= limit for f in ladder[i:])), None)
    if good is None:
        return math.inf
    here, before = ladder[good], ladder[good - 1] if good else None
    if before is None or before.cpu_s >= here.cpu_s:
        return here.cpu_s
    worse, better = math.log(getattr(before, key)), math.log(max(getattr(here, key), 1e-300))
    share = (worse - math.log(limit)) / (worse - better)
    return math.exp((1.0 - share) * math.log(before.cpu_s) + share * math.log(here.cpu_s))


def in_turns(found):
    """Run all that was solved again in turns: what slows the machine down for a while slows them all."""
    scene = found.scene
    runner = trials.Dynamics(scene, scene.build(), found.observable)
    short = [t for t in found.trials if t.status == "solved" and t.cpu_s < LONG]
    for _ in range(ROUNDS):
        for trial in short:
            before = trial.cpu_s
            runner.run(trial, math.inf)
            trial.cpu_s = min(trial.cpu_s, before)
    return found


def judged(found):
    """What "auto" names, its price over the best in the mean, and in words, at how many digits and why."""
    solve, reason = decided(found.scene, found.scene.build())
    own, methods = trials.label_of(solve), dict.fromkeys(t.method for t in found.trials)
    digits = next((d for d in (3, 2, 1) if found.price(d) is not None), None)
    if digits is None:
        return own, math.nan, f"nothing is known of digits; {reason}"
    ratios = []
    for known in (digits - 1.0, digits - 0.5, digits):
        prices = {method: price(found, method, found.scale * 10.0**-known) for method in methods}
        best = min(prices, key=prices.get)
        ratios.append(prices[own] / prices[best])
    mean = float(np.exp(np.log(ratios).mean()))
    return own, mean, f"{own} costs {mean:.2f} × the best, {ratios[-1]:.2f} × {best} at {digits} digits; {reason}"


def against_dop853(quick):
    """CPU time of DOP853 over that of refweb's explicit methods at equal errors, of the best of order 2, 4 and 6."""
    web = window("square", 6, 6, 0.1) if quick else refweb.Paper(mesh="square", cable_length=201.4)
    cable = dict(law="smooth", smoothing=1e-4, modulus=7e7, area=1e-4, density=200.0)
    found = cost(scene("Thrown mass", web, cable, thrown((0.0, 0.0, 1.0), 1.0), 0.05), budget=8.0 if quick else 100.0)
    found, ratios = in_turns(found) if quick else found, []
    explicit = dict.fromkeys(t.method for t in found.trials if t.key == "safety")
    for error in ERRORS:
        own = min(price(found, method, error, "error_state") for method in explicit)
        ratios.append(price(found, "dop853", error, "error_state") / own)
    return found, np.array(ratios)


def drawn(found):
    """The diagram of a cost, drawn for the report."""
    return Figure(f"{found.scene.title}. {found.sentence}", found.draw)


def case(quick):
    """All diagrams, and whether "auto" is near the best."""
    verdicts, figures, rows = [], [], []
    near = NEAR_QUICK if quick else NEAR
    for given, words in quick_scenes() if quick else scenes():
        found = in_turns(cost(given, budget=10.0)) if quick else cost(given, budget=SECONDS)
        method, ratio, because = judged(found)
        verdicts.append(
            Verdict(f'{given.title}: "auto" is within {near:g} × of the best', "holds", because, checked=ratio <= near)
        )
        figures.append(Figure(f"{given.title}. {words} {found.sentence}", found.draw))
        rows.append([given.title, found.sentence, method, f"{ratio:.2f}", because])
    found, ratios = against_dop853(quick)
    figures.append(drawn(found))
    known = np.isfinite(ratios)
    told = ", ".join(f"{r:.1f} at {e:.0e} m" for e, r in zip(ERRORS[known], ratios[known], strict=True))
    least, mean = ratios[known].min(), float(np.exp(np.log(ratios[known]).mean()))
    because = f"{mean:.1f} × in the mean: {told}"
    claim = "× the CPU time of refweb's explicit methods at every error from 1e-6 to 1e-11 m"
    verdicts.append(Verdict(f"DOP853 takes 1.5 {claim}", "holds", because, checked=least >= 1.5))
    if not quick:
        because += "; the compiled forces are the same"
        verdicts.append(Verdict(f"DOP853 takes 3 {claim}", "does not hold", because, checked=least < 3.0))
    return Case(
        verdicts=verdicts,
        figures=figures,
        tables=[Table("Prices", ["scene", "digits and their price", '"auto"', "over the best", "reason"], rows)],
    )
