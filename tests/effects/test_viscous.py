"""Viscoelastic lines: relaxation, creep, harmonic strain and vibration in closed form, slack lines and books."""

import nets
import numpy as np
import pytest
import scipy.linalg
from scipy.integrate import solve_ivp

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.cvode import Cvode
from refweb.dynamics.integrators.ida import Ida
from refweb.effects.viscous import ViscousArms, lost_square
from refweb.errors import InputError

EA, ARMS = 100.0, ((150.0, 0.03), (50.0, 0.3))
"""EA of the law [N]; EA [N] and τ [s] of arms."""
AREA = 1e-4
TOTAL = EA + sum(ea for ea, _ in ARMS)


def viscous(arms=ARMS, **keys):
    return refweb.Viscous(arms=[(ea / AREA, tau) for ea, tau in arms], **keys)


def rope(effects=(), arms=ARMS, law="linear", mass=1.0, order=1):
    """1 m from a support to a mass that moves along it, with its arms."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]).web()
    keys = dict(law=law, modulus=EA / AREA, area=AREA, density=1e-3 if mass else 0.0, order=order)
    cable = refweb.Cable(**keys, viscous=viscous(arms))
    weights = [refweb.PointMass(node=1, mass=mass)] if mass else []
    supported = np.ones((1 + order, 3), dtype=bool)
    supported[1:, 0] = False
    return nets.system(web, cable, [ViscousArms(cable.viscous), *weights, *effects], False, supported)


def slope(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def tensions(system, course):
    return system.forces(course.time, course.x, course.v).per_cell.tension


def pulled(t, y, push=0.0, law="linear", mass=1.0):
    """Rates of stretch, its velocity, strains of dashpots and dissipated energy of a mass on 1 m."""
    e, rate, z = y[0], y[1], y[2:-1]
    ea, tau = np.array(ARMS).T
    arms = (ea * (e - z)).sum()
    material, tension = e, EA * e + arms
    if law == "tension-only":
        tension = EA * max(e, 0.0) + arms
        if tension < 0.0:
            tension, material = 0.0, (ea * z).sum() / (TOTAL if (ea * z).sum() > 0.0 else TOTAL - EA)
    stretch = material - z
    return np.array([rate, (push - tension) / mass, *(stretch / tau), (ea * stretch**2 / tau).sum()])


MASS = 1.0 + 0.5e-3 * AREA


def vibration(e, rate, t):
    """State of the mass on the linear rope, from a strain with relaxed arms, by the exponential of its matrix."""
    z = [e] * len(ARMS)
    columns = [pulled(0.0, np.append(unit, 0.0), mass=MASS)[:-1] for unit in np.eye(2 + len(ARMS))]
    return scipy.linalg.expm(np.array(columns).T * t) @ np.array([e, rate, *z])


@pytest.mark.ordinary("CentralDifference", "Cvode")
@pytest.mark.parametrize("method", [CentralDifference, Cvode, Ida])
def test_relaxation(method):
    """Held at a strain from the start: each arm fades as exp(−t/τ), and what it stored is dissipated."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1]).web()
    cable = refweb.Cable(
        law="tension-only", modulus=EA / AREA, area=AREA, density=1.0, prestrain=0.02, subdivide=2,
        viscous=viscous(statics="short"),
    )  # fmt: skip
    system = nets.system(web, cable, [ViscousArms(cable.viscous)], False)
    solver = method(system, **({} if method is CentralDifference else {"rtol": 1e-8}))
    run = solver.start(system.settled(None))
    tight = 1e-10 if method is CentralDifference else 5e-6
    for t in (0.0, 0.05, 0.4):
        solver.advance(run, [t])
        left = sum(ea * np.exp(-t / tau) for ea, tau in ARMS)
        np.testing.assert_allclose(tensions(system, run), 0.02 * (EA + left), rtol=tight)
    stored = sum(0.5 * ea * 0.02**2 * (1.0 - np.exp(-0.8 / tau)) for ea, tau in ARMS) / 1.02  # of its natural length
    assert abs(-run.work[:-1].sum() - stored) < tight * stored
    assert run.drift < tight


@pytest.mark.parametrize("linear_solver", ["dense", pytest.param("block", marks=pytest.mark.slow)])
def test_creep(linear_solver):
    """A load on a rope without mass: ε(t) of the standard linear solid, by IDA."""
    arm, push = (150.0, 0.1), 3.0
    system = rope([refweb.Load(node=1, force=(push, 0, 0))], arms=[arm], law="tension-only", mass=0.0)
    solver = Ida(system, rtol=1e-8, linear_solver=linear_solver)
    run = solver.start()
    for t in (0.0, 0.05, 0.1, 0.5):
        solver.advance(run, [t])
        retardation = arm[1] * (EA + arm[0]) / EA
        creep = push / EA * (1.0 - arm[0] / (EA + arm[0]) * np.exp(-t / retardation))
        np.testing.assert_allclose(run.x[1, 0], creep, rtol=1e-5)


def test_harmonic_strain():
    """Storage and loss modulus, Σ E ω²τ²/(1 + ω²τ²) and Σ E ωτ/(1 + ω²τ²), from the last of some cycles."""
    size, omega, cycles, steps = 1e-3, 20.0, 6, 240
    phase = np.linspace(0.0, 2.0 * np.pi * cycles, cycles * steps + 1)
    table = [(p / omega, size * np.sin(p), 0.0, 0.0) for p in phase]
    system = rope([refweb.Motion(node=1, displacement=table)])
    solver, period = CentralDifference(system, safety=1.0), 2.0 * np.pi / omega
    run, lost, seen = solver.start(), [], []
    for cycle in (cycles - 1.0, cycles - 0.75, cycles):
        solver.advance(run, [cycle * period])
        lost.append(-run.work[:-1].sum())
        seen.append(tensions(system, run)[0])
    storage = EA + sum(ea * (omega * tau) ** 2 / (1.0 + (omega * tau) ** 2) for ea, tau in ARMS)
    loss = sum(ea * omega * tau / (1.0 + (omega * tau) ** 2) for ea, tau in ARMS)
    # Strain is linear in pieces of 1.5°, whose fundamental is short of the sine by 6e-5.
    np.testing.assert_allclose(seen[1:], [storage * size, loss * size], rtol=5e-4)
    np.testing.assert_allclose(lost[2] - lost[0], np.pi * loss * size**2, rtol=5e-4)


def test_a_vibration_is_of_order_two():
    """A mass on a rope: stretch, velocity, state of an arm and drift of the book, from arms at rest."""
    exact, errors = vibration(0.02, 0.3, 0.4), []
    system = rope()
    x, v = np.zeros((system.rows, 3)), np.zeros((system.rows, 3))
    x[1, 0], v[1, 0] = 0.02, 0.3
    for safety in (0.2, 0.1, 0.05, 0.025):
        solver = CentralDifference(system, safety=safety)
        run = solver.start(system.settled(x), v)
        solver.advance(run, [0.2, 0.4])
        found = np.array([run.x[1, 0], run.v[1, 0], run.x[2, 0]])
        errors.append([run.nsteps, *np.abs(found - exact[:3]), run.drift])
    nsteps, *errors = np.array(errors).T
    for error in errors:
        assert abs(slope(error, 1.0 / nsteps) - 2.0) < 0.15
    assert max(error[-1] for error in errors) < 1e-4


@pytest.mark.ordinary("adams-1", "block-1")
@pytest.mark.parametrize(
    "method, order",
    [*((method, 1) for method in ("cvode", "adams", "ida", "block", "sparse"))]
    + [
        pytest.param(method, order, marks=pytest.mark.slow)
        for method, order in (("block", 2), ("block", 3), ("cvode", 2), ("cvode", 3))
    ],
)
def test_a_vibration_by_sundials(method, order):
    """The same by every linear solver, and with curved elements."""
    keys = {"adams": {"family": "adams"}, "block": {"linear_solver": "block"}, "sparse": {"linear_solver": "sparse"}}
    system = rope(order=order)
    x, v = np.zeros((system.rows, 3)), np.zeros((system.rows, 3))
    x[: system.net.nodes, 0] = 0.02 * system.net.points[: system.net.nodes, 0]
    v[: system.net.nodes, 0] = 0.3 * system.net.points[: system.net.nodes, 0]
    solver = (Ida if method == "ida" else Cvode)(system, rtol=1e-7, **keys.get(method, {}))
    run = solver.start(system.settled(x), v)
    solver.advance(run, [0.2, 0.4])
    exact = vibration(0.02, 0.3, 0.4)
    # Of order 2 rtol to the power 2/3 is left; inner nodes of curved elements, of 1e-8 kg, vibrate beside.
    np.testing.assert_allclose([run.x[1, 0], run.v[1, 0]], exact[:2], rtol=0, atol=2e-3 * 0.02 if order > 1 else 1e-5)
    assert run.drift < 1e-4


def slack_reference(push, rate, end):
    solution = solve_ivp(
        pulled, (0.0, end), [0.0, rate, 0.0, 0.0, 0.0], args=(push, "tension-only", MASS), rtol=1e-10, atol=1e-13,
        max_step=1e-3,
    )  # fmt: skip
    return solution.y[:, -1]


@pytest.mark.ordinary("CentralDifference")
@pytest.mark.parametrize("method", [CentralDifference, Cvode, Ida])
def test_a_slack_line_creeps_back_and_never_pushes(method):
    """A mass that bounces on a rope: its arms relax while it hangs loose, as a program of its own finds."""
    push, rate, end = 0.6, 0.3, 1.3
    system = rope([refweb.Load(node=1, force=(push, 0, 0))], law="tension-only")
    v = np.zeros((system.rows, 3))
    v[1, 0] = rate
    exact = slack_reference(push, rate, end)
    solver = method(system, **({"safety": 0.01} if method is CentralDifference else {"rtol": 1e-7}))
    run, lost, slack = solver.start(None, v), [0.0], 0
    for t in np.linspace(0.0, end, 61)[1:]:
        solver.advance(run, [t])
        tension = tensions(system, run)[0]
        assert tension >= 0.0
        slack += tension == 0.0
        lost.append(-run.work[:-1][system.working < 0].sum())
    assert 10 < slack < 50
    assert (np.diff(lost) >= 0.0).all()
    # Errors of order 1 where the line snaps taut.
    np.testing.assert_allclose([run.x[1, 0], run.v[1, 0], lost[-1]], exact[[0, 1, 4]], rtol=0, atol=2e-4)
    assert run.drift < 1e-4


@pytest.mark.parametrize("method", [CentralDifference, Cvode])
def test_work_of_a_reel_on_arms(method):
    """A line that is reeled in between two ends: work of the reel is what is stored and dissipated."""
    drifts = []
    for share in (1.0, 0.25):
        system = rope([refweb.Reel(lines="all", factor=[(0.0, 1.0), (1.0, 0.8)])], law="tension-only")
        solver = method(
            system, **({"safety": 0.2 * share} if method is CentralDifference else {"rtol": 1e-4 * share**3})
        )
        run = solver.start()
        solver.advance(run, [0.25, 0.5])
        drifts.append(run.drift)
        assert run.work[-1] > 0.0 and -run.work[:-1].sum() > 0.0
    assert drifts[1] < 0.2 * drifts[0] < 1e-3


@pytest.mark.parametrize("method", [CentralDifference, Cvode, Ida])
def test_damping_of_a_line_that_is_reeled_in(method):
    """Kelvin–Voigt between fixed ends: ε = 1/L − 1 and ε' = −L'/L², whose stress is E(ε + τ ε'); after the reel Eε."""
    tau, speed = 0.05, 0.2
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1]).web()
    cable = refweb.Cable(law="tension-only", modulus=EA / AREA, area=AREA, density=1.0, subdivide=2)
    reel = refweb.Reel(lines="all", factor=[(0.0, 1.0), (0.5, 0.9), (9.0, 0.9)])
    system = nets.system(web, cable, [refweb.Damping(time=tau), reel], False)
    solver = method(system, **({} if method is CentralDifference else {"rtol": 1e-7}))
    run = solver.start()
    length = 1.0 - speed * 0.25
    solver.advance(run, [0.25])
    np.testing.assert_allclose(tensions(system, run), EA * (1.0 / length - 1.0 + tau * speed / length**2), rtol=1e-9)
    # ∫ EA τ ε'² L dt = EA τ c [1/(2 L²)]
    lost = 0.5 * EA * tau * speed * (length**-2 - 1.0)
    stored = 0.5 * EA * length * (1.0 / length - 1.0) ** 2
    books = dict(zip(system.working, run.work[:-1], strict=True))
    np.testing.assert_allclose([-books[-1], run.work[-1] + books[1]], [lost, lost + stored], rtol=2e-4)
    solver.advance(run, [0.6])
    np.testing.assert_allclose(tensions(system, run), EA * (1.0 / 0.9 - 1.0), rtol=1e-9)
    assert run.drift < 1e-4


def test_square_of_a_stretch():
    """The two formulas for ∫ (e − z)² dt agree where they meet, and with a quadrature."""
    at, weights = np.polynomial.legendre.leggauss(40)
    for h in (1e-5, 0.0099, 0.0101, 0.3, 4.0, 30.0):
        s = 0.5 * h * (at + 1.0)
        stretch = 0.7 * np.exp(-s) + 2.0 * (1.0 - np.exp(-s))
        after, square = lost_square(h, 1.0, 0.7, 2.0)
        np.testing.assert_allclose(after, 0.7 * np.exp(-h) + 2.0 * (1.0 - np.exp(-h)), rtol=1e-14)
        np.testing.assert_allclose(square, 0.5 * h * (weights * stretch**2).sum(), rtol=1e-9)


@pytest.mark.parametrize("ea, tau", [(1e-3, 1e-9), (1e4, 1e-9), (1e3, 1e9), (1e5, 1e-3)])
def test_arms_of_all_times(ea, tau):
    """A slack net of stiff, quick and slow arms is thrown: its book is closed, no line pushes, nothing is gained."""
    given = scene(
        effects=[refweb.Velocity(node="centre", value=(0.1, 0.2, 0.3))], arms=dict(arms=[(ea, tau), (50.0, 0.01)])
    )
    run = refweb.run(given)
    assert run.solver["energy_drift"] < 5e-3  # of order 1 where lines snap taut
    assert min(state.tension.min() for _, state in run.frames) == 0.0
    assert (np.diff(run.history["dissipated_energy"]) >= 0.0).all()


# Scenes


def scene(**keys):
    """A small net with a load, of which lines have arms."""
    given = dict(
        web=refweb.Window(mesh="square", rows=2, columns=2, side=0.5),
        effects=[refweb.Load(node="centre", force=(0.0, 0.0, 2.0))],
        solve=refweb.Dynamic(duration=0.05),
        output=refweb.Output(interval=1e-3, frames=10),
        accuracy=refweb.Accuracy(error="none"),
    )
    cable = dict(
        law="tension-only", modulus=EA / AREA, area=AREA, density=200.0, viscous=viscous(**keys.pop("arms", {}))
    )
    return refweb.Scene(**{**given, "cable": refweb.Cable(**cable), **keys})


@pytest.mark.parametrize("law", nets.LAWS)
def test_limits_of_statics(law):
    """Statics has the law alone, or with the moduli of all arms."""
    given = dict(solve=refweb.Static(), output=refweb.Output())
    base = dict(modulus=EA / AREA, area=AREA, density=200.0, **nets.LAWS[law])
    for limit, modulus in (("long", EA / AREA), ("short", TOTAL / AREA)):
        arms = refweb.run(scene(cable=refweb.Cable(**base, viscous=viscous(statics=limit)), **given))
        plain = refweb.run(scene(cable=refweb.Cable(**{**base, "modulus": modulus}), **given))
        np.testing.assert_allclose(arms.displacement, plain.displacement, rtol=1e-12, atol=1e-15)


SOFT = ((0.004, 0.0), (0.01, 2e3), (0.03, 2e4), (0.1, 4e4))
"""Strain and stress [Pa] of a measured rope that is slack at first."""


@pytest.mark.parametrize("key", ["stress", "tension"])
def test_short_arms_beside_a_curve(key):
    """They bear what lines of their moduli bear that stand beside those of the curve; a run starts from there."""
    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.25).web()
    count, size = len(web.lines), AREA if key == "tension" else 1.0
    twice = refweb.Inline(
        points=web.points, lines=np.vstack([web.lines, web.lines]), supports=web.rim,
        groups={"springs": [*range(count, 2 * count)]},
    )  # fmt: skip
    springs = dict(law="tension-only", modulus=(TOTAL - EA) / AREA)
    base = {"law": "table", "area": AREA, "density": 200.0, key: [(e, size * value) for e, value in SOFT]}
    arms = refweb.Cable(**base, viscous=viscous(statics="short"))
    load = [refweb.Load(node=web.centre, force=(0.1, 0.0, 2.0))]
    kinds = {"pull": "tension", "stored": "strain_energy"}
    observe = [refweb.Observe(name=name, quantity=kind) for name, kind in kinds.items()]
    given = dict(
        effects=load, solve=refweb.Static(), output=refweb.Output(), accuracy=refweb.Accuracy(), observe=observe
    )  # fmt: skip
    short = refweb.run(scene(web=web, cable=arms, **given))
    both = refweb.run(scene(web=twice, cable=refweb.Cable(**base, groups={"springs": springs}), **given))
    np.testing.assert_allclose(short.displacement, both.displacement, rtol=1e-9, atol=1e-12)
    tension = both.state.tension.reshape(2, count)
    np.testing.assert_allclose(short.state.tension, tension.sum(axis=0), rtol=1e-9)
    assert tension[0].min() == 0.0 < tension[1].min()  # arms alone bear some lines
    assert short.results["pull"].proven
    stored, expected = (run.results["stored"].value for run in (short, both))
    np.testing.assert_allclose(stored, expected, rtol=1e-9)
    start = scene(web=web, cable=arms, effects=load, solve=refweb.Dynamic(duration=1e-3, start="equilibrium"))
    first = refweb.run(start).frames[0][1]
    np.testing.assert_allclose(first.tension, short.state.tension, rtol=1e-6, atol=1e-6)
    tight = refweb.Cable(**base, pretension=3.0, viscous=viscous(statics="short"))
    system = scene(cable=tight, effects=[]).build()
    np.testing.assert_allclose(system.forces(0.0, system.settled(None)).per_cell.tension, 3.0, rtol=1e-12)


@pytest.mark.parametrize("limit", ["long", "short"])
def test_a_start_at_rest_stays_there(limit):
    """The equilibrium with arms at rest stays; with new arms it is that of all moduli, and tensions relax from it."""
    start = scene(arms=dict(statics=limit), solve=refweb.Dynamic(duration=0.02, start="equilibrium"))
    run = refweb.run(start)
    static = refweb.run(start.replace(solve=refweb.Static(), output=refweb.Output()))
    first = run.frames[0][1]
    np.testing.assert_allclose(first.x[:5], static.displacement[:5], rtol=0, atol=1e-9)
    moved = np.abs(run.state.x[:5] - first.x[:5]).max()
    assert moved < 1e-9 if limit == "long" else moved > 1e-4


def test_pretension_is_that_of_the_start():
    """Whichever limit statics has, lines start with the pretension that the cable says."""
    for limit in ("long", "short"):
        base = dict(law="tension-only", modulus=EA / AREA, area=AREA, density=200.0, pretension=3.0)
        system = scene(cable=refweb.Cable(**base, viscous=viscous(statics=limit)), effects=[]).build()
        tension = system.forces(0.0, system.settled(None)).per_cell.tension
        np.testing.assert_allclose(tension, 3.0, rtol=1e-12)


@pytest.mark.parametrize("method", ["central-difference", pytest.param("cvode", marks=pytest.mark.slow)])
def test_a_resumed_run_is_the_same(method, tmp_path):
    """Bit for bit where steps are explicit; a run that starts from a folder goes on with the arms that it finds."""
    given = scene(solve=refweb.Dynamic(duration=0.05, method=method))
    whole, resumed = nets.whole_and_resumed(given, tmp_path)
    # CVODE begins anew where it was stopped, and errors of its steps, rtol 1e-6 each, add up.
    within = 1e-4 * np.abs(whole.state.x).max() if method == "cvode" else 0.0
    np.testing.assert_allclose(resumed.state.x, whole.state.x, rtol=0, atol=within)
    ahead = given.replace(solve=refweb.Dynamic(duration=0.01, start=str(tmp_path / "whole"), method=method))
    np.testing.assert_array_equal(refweb.run(ahead).frames[0][1].x, whole.state.x)


def test_lines_without_arms_and_broken_ones():
    """Arms of a group act there alone, and end with a line that breaks; the book is closed."""
    web = refweb.Inline(
        points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2], groups={"left": [0]}
    )
    cable = refweb.Cable(
        law="tension-only", modulus=EA / AREA, area=AREA, density=100.0, strength=1.5 / AREA, prestrain=0.01,
        viscous=viscous(lines="left"),
    )  # fmt: skip
    pull = refweb.Load(node=1, force=(2.0, 0, 0))
    solve = refweb.Dynamic(duration=0.1)
    given = scene(web=web, cable=cable, effects=[pull], solve=solve)
    system = given.build()
    assert not system.internal.elements.any()
    broken = refweb.run(given.replace(effects=[pull, refweb.Rupture()]))
    assert [b["line"] for b in broken.breaks] == [0]
    assert broken.solver["energy_drift"] < 1e-3
    assert broken.state.tension[0] == 0.0


def test_refusals():
    with pytest.raises(InputError, match=r"arms\[0\]\[1\] = 0 must be > 0: it is a time \[s\]"):
        refweb.Viscous(arms=[(1.0, 0.0)])
    with pytest.raises(InputError, match=r'\[solve\] method = "explicit" takes no \[cable.viscous\]'):
        refweb.run(scene(solve=refweb.Dynamic(duration=0.01, method="explicit", order=4)))
    with pytest.raises(InputError, match=r"\[damping\] time = 0.1 \[s\] cannot stand beside \[cable.viscous\]"):
        scene(effects=[refweb.Damping(time=0.1)]).build()
    with pytest.raises(InputError, match=r'\[cable\] viscous lines = "rimm" names no line'):
        scene(arms=dict(lines="rimm")).build()
    form = refweb.Cable(law="force-density", modulus=1e6, area=AREA, density=1.0, force_density=1.0, viscous=viscous())
    with pytest.raises(InputError, match=r'\[cable\] viscous line 0 has law = "force-density" of form finding'):
        scene(cable=form, solve=refweb.Static(), output=refweb.Output()).build()
    with pytest.raises(InputError, match=r"modulus = 1: unknown key"):
        refweb.Cable.read("[cable]", dict(modulus=1e6, area=AREA, density=1.0, viscous={"modulus": 1}))
