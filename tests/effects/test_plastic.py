"""Lines that yield: paths by hand, a brake, loops, three bars, statics by load steps, every method, and starts."""

import nets
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import PchipInterpolator

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.cvode import Cvode
from refweb.dynamics.integrators.ida import Ida
from refweb.effects.plastic import PlasticLines
from refweb.errors import InputError
from refweb.net.plastic_keys import yield_curves
from refweb.results.state import State

AREA, MODULUS, STRESS, HARDENING = 1e-4, 1e7, 1e5, 1e6
"""A [m²], E, yield stress and hardening [Pa]: yields at a strain of 1 % with 10 N."""
LAW = dict(law="elastic-plastic", modulus=MODULUS, area=AREA, yield_stress=STRESS, hardening=HARDENING)
CURVE = dict(law="elastic-plastic", modulus=MODULUS, area=AREA, hardening=[(0, 1e5), (0.01, 1.4e5), (0.03, 1.5e5)])


def rope(effects=(), mass=1.0, law=LAW):
    """A line from a support to a mass that moves along it."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]).web()
    cable, supported = refweb.Cable(**law, density=0.0), np.ones((2, 3), dtype=bool)
    supported[1, 0] = False
    effects = [PlasticLines(cable), refweb.PointMass(node=1, mass=mass), *effects]
    return nets.system(web, cable, effects, False, supported)


def by_hand(strains, curve):
    """(Tension, plastic strain, work lost) along a path of strains, by bisection and trapezoids of the curve."""
    p, lost, path = 0.0, 0.0, []

    def stress(p):
        last = curve[-1][1] + (p - curve[-1][0]) * (curve[-1][1] - curve[-2][1]) / (curve[-1][0] - curve[-2][0])
        return last if p > curve[-1][0] else np.interp(p, *np.transpose(curve))

    for e in strains:
        if MODULUS * (e - p) > stress(p):
            low, high = p, e
            for _ in range(80):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if MODULUS * (e - middle) > stress(middle) else (low, middle)
            parts = np.unique([p, low, *(c for c, _ in curve if p < c < low)])
            lost += np.trapezoid([stress(c) for c in parts], parts)
            p = low
        path.append((AREA * MODULUS * max(e - p, 0.0), p, AREA * lost))
    return np.array(path)


@pytest.mark.parametrize("law", [LAW, CURVE, LAW | {"hardening": 0.0}])
def test_ten_cycles_of_a_line_by_hand(law):
    """Loaded and unloaded, each time further: tension, plastic strain and area of the loops, by statics and motion."""
    ends = [e for n in range(10) for e in (0.006 * (n + 1), 0.002 * n - 0.001)]
    table = [(0.0, 0.0, 0.0, 0.0), *((1.0 + i, e, 0.0, 0.0) for i, e in enumerate(ends))]
    motion = refweb.Motion(node=1, displacement=table)
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0])
    cable = refweb.Cable(**law, density=1.0)
    exact = by_hand(ends, yield_curves(cable, web.web())[0].tolist())
    assert exact[-2, 1] > 0.03
    observe = [refweb.Observe(name="lost", quantity="plastic_energy")]
    scene = refweb.Scene(
        web=web, cable=cable, effects=[motion], observe=observe, accuracy=refweb.Accuracy(error="none"),
        solve=refweb.Dynamic(duration=len(ends), step_size=2e-3), output=refweb.Output(interval=1.0, frames=1),
    )  # fmt: skip
    run = refweb.run(scene)
    found = np.array([[state.tension[0], state.plastic_strain[0]] for _, state in run.frames[1:]])
    np.testing.assert_allclose(found, exact[:, :2], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(run.history["lost"][1:], exact[:, 2], rtol=1e-9)
    static = scene.replace(
        solve=refweb.Static(load_steps=[1.0 + i for i in range(len(ends))]), output=refweb.Output(), observe=observe
    )
    rest = refweb.run(static)
    np.testing.assert_allclose([step["results"]["lost"].value for step in rest.steps], exact[:, 2], rtol=1e-9)
    assert [finding.code for finding in rest.findings] == ["monotone-loading", "not-proven"]  # it turns back


@pytest.mark.ordinary("CentralDifference", "Ida")
@pytest.mark.parametrize("method", [CentralDifference, Cvode, Ida])
def test_a_brake_stops_a_mass(method):
    """A line that pays out at constant force: the way is m v²/2F, and the elastic stretch; the rest is lost."""
    mass, speed = 2.0, 1.5
    force = STRESS * AREA
    system = rope(mass=mass, law=LAW | {"hardening": 0.0})
    v = np.zeros((system.rows, 3))
    v[1, 0] = speed
    solver = method(system, **({"safety": 0.02} if method is CentralDifference else {"rtol": 1e-7}))
    run = solver.start(None, v)
    stretch = force / (MODULUS * AREA)  # the mass comes to it with less energy, and stops after the rest
    way = stretch + (0.5 * mass * speed**2 - 0.5 * force * stretch) / force
    frequency = np.sqrt(MODULUS * AREA / mass)
    first = np.arcsin(stretch * frequency / speed) / frequency
    stop = first + np.sqrt(speed**2 - (stretch * frequency) ** 2) * mass / force
    solver.advance(run, [0.5 * stop, stop])
    # Explicit steps are of order 1 at the kink.
    np.testing.assert_allclose(run.x[1, 0], way, rtol=5e-4 if method is CentralDifference else 2e-5)
    assert abs(run.v[1, 0]) < 1e-4 * speed
    np.testing.assert_allclose(run.largest, 0.5 * mass * speed**2, rtol=5e-4)  # what drifts are held against
    energies = {term.balance.column: system.energy_of(term, 0.0, run.x).sum() for term in system.terms[:0:-1]}
    np.testing.assert_allclose(energies["plastic_energy"], force * (way - stretch), rtol=5e-4)
    solver.advance(run, [1.2 * stop])
    assert run.drift < (5e-4 if method is CentralDifference else 1e-4)


@pytest.mark.ordinary("law1-CentralDifference")
@pytest.mark.parametrize("method", [CentralDifference, Cvode, Ida])
@pytest.mark.parametrize("law", [LAW, CURVE])
def test_a_mass_that_bounces_on_a_line_that_yields(method, law):
    """Against a program of its own, with p = p(largest strain), and a pull that brings it back."""
    mass, pull = 1.0, 4.0
    system = rope([refweb.Load(node=1, force=(pull, 0, 0))], mass, law)
    points = yield_curves(refweb.Cable(**law, density=0.0), system.net.web)[0].tolist()
    grid = np.linspace(0.0, 0.4, 40001)  # plastic strain over the largest strain
    table = np.zeros(len(grid))
    for k in range(len(points) - 1):
        (p0, y0), (p1, y1) = points[k], points[k + 1]
        slope = (y1 - y0) / (p1 - p0)
        ahead = p0 + (MODULUS * (grid - p0) - y0) / (MODULUS + slope)
        last = k == len(points) - 2
        table = np.where(ahead > p0, ahead if last else np.minimum(ahead, p1), table)

    def rates(t, y):
        p = np.interp(max(y[2], y[0]), grid, table)
        rising = max(y[1], 0.0) if y[0] >= y[2] else 0.0
        return [y[1], (pull - AREA * MODULUS * max(y[0] - p, 0.0)) / mass, rising]

    end = 0.9
    exact = solve_ivp(rates, (0.0, end), [0.0, 1.0, 0.0], rtol=1e-9, atol=1e-12, max_step=2e-4).y[:, -1]
    v = np.zeros((system.rows, 3))
    v[1, 0] = 1.0
    solver = method(system, **({"safety": 0.01} if method is CentralDifference else {"rtol": 1e-7}))
    run, before = solver.start(None, v), 0.0
    for t in np.linspace(0.0, end, 31)[1:]:
        solver.advance(run, [t])
        state = State(system, run.time, run.x.copy(), run.v)
        assert state.element_tension[0] >= 0.0 and state.plastic_strain[0] >= before - 1e-12
        before = state.plastic_strain[0]
    expected = [*exact[:2], np.interp(exact[2], grid, table)]
    np.testing.assert_allclose([run.x[1, 0], run.v[1, 0], before], expected, rtol=0, atol=2e-4)
    assert run.drift < 1e-4


def test_three_bars_of_which_one_yields():
    """Three lines side by side on one node: beyond its yield the weak one bears no more; unloaded, it goes slack."""
    points = [[0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 0]]
    web = refweb.Inline(
        points=points, lines=[[0, 3], [1, 3], [2, 3]], supports=[0, 1, 2], groups={"weak": [1]}
    )  # fmt: skip
    cable = refweb.Cable(
        law="tension-only", modulus=MODULUS, area=AREA, density=1.0,
        groups={"weak": dict(law="elastic-plastic", yield_stress=STRESS)},
    )  # fmt: skip
    load = refweb.Load(node=3, force=(0.0, 0.0, -1.0), factor=[(0.0, 0.0), (100.0, 100.0), (200.0, 0.0)])
    observe = [refweb.Observe(name=f"T{line}", quantity="tension", line=line) for line in range(3)]
    stiffness, limit = MODULUS * AREA, STRESS * AREA
    stretch = (70.0 - limit) / (2.0 * stiffness)  # at the largest load
    p = stretch - limit / stiffness
    weak = [20.0 / 3.0, limit, limit, limit, (50.0 - 2.0 * stiffness * p) / 3.0, 0.0]
    for kind in ("newton", "relaxation"):
        solve = refweb.Static(load_steps=[20.0, 30.0, 50.0, 70.0, 150.0, 190.0], method=kind)
        run = refweb.run(refweb.Scene(web=web, cable=cable, effects=[load], observe=observe, solve=solve))
        found = np.array([[step["results"][f"T{line}"].value for line in range(3)] for step in run.steps])
        loads = np.array([20.0, 30.0, 50.0, 70.0, 50.0, 10.0])
        other = (loads - weak) / 2.0
        np.testing.assert_allclose(found, np.column_stack([other, weak, other]), rtol=1e-7, atol=1e-7)


@pytest.mark.slow
def test_lines_of_three_laws_side_by_side():
    """One that yields, one with a measured curve and one of tension alone, by statics and motion: each as by itself."""
    points = [(0.0, 0.0), (0.01, 2e4), (0.02, 6e4), (0.05, 2e5)]
    web = refweb.Inline(
        points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]] * 3, supports=[0], groups={"rope": [0], "wire": [2]}
    )  # fmt: skip
    groups = {"rope": dict(law="table", stress=points), "wire": dict(law="tension-only", modulus=1e5)}
    cable = refweb.Cable(**LAW, density=1.0, groups=groups)
    rope, strains = PchipInterpolator(*np.transpose(points)), np.array([0.005, 0.03, 0.012, 0.04])
    yielding = by_hand(strains, yield_curves(cable, web.web())[1, :2].tolist())
    slope, stress = rope.derivative()(0.0), rope(strains)
    assert slope > 0.0  # so that the curve is that of scipy
    expected = np.column_stack([AREA * stress, yielding[:, 0], AREA * 1e5 * strains])
    times = np.arange(1.0, 5.0)
    path = np.column_stack([times, strains, 0.0 * strains, 0.0 * strains])
    motion = refweb.Motion(node=1, displacement=[(0.0, 0.0, 0.0, 0.0), *path.tolist()])
    moved = refweb.Scene(
        web=web, cable=cable, effects=[motion], accuracy=refweb.Accuracy(error="none"),
        solve=refweb.Dynamic(duration=4.0), output=refweb.Output(interval=1.0, frames=1),
    )  # fmt: skip
    found = np.array([state.tension for _, state in refweb.run(moved).frames[1:]])
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    factor = [(0.0, 0.0), *zip(times, expected.sum(axis=1), strict=True)]
    loaded = refweb.Scene(
        web=web, cable=cable, effects=[refweb.Load(node=1, force=(1.0, 0.0, 0.0), factor=factor)],
        observe=[refweb.Observe(name=f"T{line}", quantity="tension", line=line) for line in range(3)],
        solve=refweb.Static(load_steps=times.tolist()),
    )  # fmt: skip
    steps = refweb.run(loaded).steps
    found = [[step["results"][f"T{line}"].value for line in range(3)] for step in steps]
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("method", ["central-difference", pytest.param("cvode", marks=pytest.mark.slow)])
def test_a_net_catches_a_mass(method, tmp_path):
    """It absorbs energy that elastic lines give back, the book closes, and resumed and started runs are the same."""
    scene = refweb.Scene(
        web=refweb.Window(mesh="square", rows=4, columns=4, side=0.25),
        cable=refweb.Cable(law="elastic-plastic", modulus=1e7, area=1e-5, density=500.0, yield_stress=1e5),
        effects=[refweb.PointMass(node="centre", mass=0.5), refweb.Velocity(node="centre", value=(0.0, 0.0, 2.0))],
        observe=[refweb.Observe(name="lost", quantity="plastic_energy")],
        solve=refweb.Dynamic(duration=0.2, method=method),
        output=refweb.Output(interval=0.01, frames=5),
        accuracy=refweb.Accuracy(error="none"),
    )
    whole, resumed = nets.whole_and_resumed(scene, tmp_path)
    exact = method == "central-difference"
    np.testing.assert_allclose(resumed.state.x, whole.state.x, rtol=0, atol=0 if exact else 1e-5)
    assert whole.solver["energy_drift"] < 2e-3
    lost = whole.history["lost"]
    assert (np.diff(lost) >= -1e-12).all() and lost[-1] > 0.5 * 1.0  # of 1 J
    total = whole.history["total_energy"]
    np.testing.assert_allclose(total, total[0], rtol=3e-3)
    ahead = scene.replace(solve=refweb.Dynamic(duration=0.01, start=str(tmp_path / "whole"), method=method))
    first = refweb.run(ahead).frames[0][1]
    np.testing.assert_array_equal(first.plastic_strain, whole.state.plastic_strain)
    import meshio

    last = sorted((tmp_path / "whole" / "frames").glob("web_*.vtu"))[-1]
    np.testing.assert_allclose(meshio.read(last).cell_data["plastic_strain"][0], whole.state.plastic_strain)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["cvode", pytest.param("ida", marks=pytest.mark.slow)])
def test_a_ring_net_absorbs_what_an_elastic_one_gives_back(method):
    """A mass that is thrown into rings that are hexagons: methods agree within ±, and the energy is kinetic or lost."""
    web = refweb.Window(mesh="hexagon", rows=3, columns=3, side=0.15)
    material = dict(modulus=1e7, area=1e-5, density=500.0)
    scene = refweb.Scene(
        web=web,
        cable=refweb.Cable(law="elastic-plastic", yield_stress=1e5, hardening=1e5, **material),
        effects=[refweb.PointMass(node="centre", mass=0.5), refweb.Velocity(node="centre", value=(0.0, 0.0, 2.0))],
        observe=[
            refweb.Observe(name="lost", quantity="plastic_energy"),
            refweb.Observe(name="stored", quantity="strain_energy"),
        ],
        solve=refweb.Dynamic(duration=0.1), output=refweb.Output(interval=0.01),
    )  # fmt: skip
    explicit = refweb.run(scene)
    implicit = refweb.run(scene.replace(solve=refweb.Dynamic(duration=0.1, method=method, rtol=1e-4)))
    for name, result in explicit.results.items():
        same = implicit.results[name]
        assert abs(result.value - same.value) <= result.error + same.error < 0.01 * result.value
    assert max(explicit.solver["energy_drift"], implicit.solver["energy_drift"]) < 1e-4
    elastic = scene.replace(
        cable=refweb.Cable(law="tension-only", **material), observe=[], solve=refweb.Dynamic(duration=0.2)
    )
    back = refweb.run(elastic).history
    brought, centre = back["kinetic_energy"][0], web.web().centre
    assert back["strain_energy"].max() > 0.9 * brought and back["kinetic_energy"][-1] > 0.9 * brought
    lost, stored = (explicit.results[name].value for name in ("lost", "stored"))
    assert lost > 0.2 * brought and stored < 0.1 * lost
    kinetic = explicit.history["kinetic_energy"][-1]
    np.testing.assert_allclose(kinetic + lost + stored, brought, rtol=1e-4)
    assert 0.0 < explicit.state.v[centre, 2] < 2.0


def test_refusals():
    with pytest.raises(InputError, match=r'yield_stress has no meaning with law = "smooth"'):
        refweb.Cable(modulus=1.0, area=1.0, density=1.0, yield_stress=1.0)
    with pytest.raises(InputError, match=r'law = "elastic-plastic" needs yield_stress'):
        refweb.Cable(law="elastic-plastic", modulus=1.0, area=1.0, density=1.0)
    with pytest.raises(InputError, match=r"both say it"):
        refweb.Cable(**CURVE, yield_stress=1.0, density=1.0)
    with pytest.raises(InputError, match=r"hardening\[1\]\[1\] = 1 must be ≥ 2"):
        refweb.Cable(**{**CURVE, "hardening": [(0, 2.0), (1, 1.0)]}, density=1.0)
    viscous = refweb.Viscous(arms=[(1.0, 1.0)])
    web = refweb.Window(mesh="square", rows=2, columns=2, side=0.5)
    with pytest.raises(InputError, match=r"\[cable\] viscous cannot stand beside"):
        refweb.Scene(web=web, cable=refweb.Cable(**LAW, density=1.0, viscous=viscous)).build()
    with pytest.raises(InputError, match=r'\[damping\] time = 1 \[s\] cannot stand beside law = "elastic-plastic"'):
        refweb.Scene(web=web, cable=refweb.Cable(**LAW, density=1.0), effects=[refweb.Damping(time=1.0)]).build()


@pytest.mark.parametrize("method", ["central-difference", "cvode", "ida"])
def test_a_line_breaks_at_a_plastic_strain(method):
    """Stretched at a rate, at the time at which E (ε − p) = Y(p); it keeps what it lost, and ends what it stored."""
    rate, limit = 0.02, 0.013
    strain = limit + (STRESS + HARDENING * limit) / MODULUS
    points = [[0, 0, 0], [1, 0, 0], [0, 0, 1]]  # the last one moves freely, and hangs on a line that holds
    web = refweb.Inline(points=points, lines=[[0, 1], [0, 2]], supports=[0], groups={"brake": [0]})
    motion = refweb.Motion(node=1, displacement=[(0.0, 0.0, 0.0, 0.0), (2.0, 2.0 * rate, 0.0, 0.0)])
    observe = [refweb.Observe(name=name, quantity=f"{name}_energy") for name in ("plastic", "rupture")]
    scene = refweb.Scene(
        web=web, cable=refweb.Cable(**LAW, density=1.0), observe=observe, accuracy=refweb.Accuracy(error="none"),
        effects=[motion, refweb.Rupture(strength=1e9, groups={"brake": {"plastic_strain": limit}})],
        solve=refweb.Dynamic(duration=2.0, method=method), output=refweb.Output(interval=0.5, frames=1),
    )  # fmt: skip
    run = refweb.run(scene)
    (broken,) = run.breaks
    np.testing.assert_allclose(broken["time"], strain / rate, rtol=1e-6)
    np.testing.assert_allclose(broken["energy"], 0.5 * AREA * MODULUS * (strain - limit) ** 2, rtol=1e-5)
    lost = AREA * (STRESS * limit + 0.5 * HARDENING * limit**2)
    np.testing.assert_allclose(run.history["plastic"][-1], lost, rtol=1e-5)
    assert run.state.tension[0] == 0.0 and run.solver["energy_drift"] < 1e-4
    static = scene.replace(
        observe=[], solve=refweb.Static(load_steps=[0.5, 2.0]), output=refweb.Output(), accuracy=refweb.Accuracy()
    )
    with pytest.raises(refweb.SolverError, match=f"load step {strain / rate:.6g}, where its plastic strain reaches"):
        refweb.run(static)


@pytest.mark.parametrize("method", ["central-difference", "cvode"])
def test_a_line_of_a_start_that_has_yielded_too_far_is_broken(method, tmp_path):
    """Drawn until it yields, and let go: with a limit below its plastic strain it breaks at once, slack as it is."""
    points = [[0, 0, 0], [1, 0, 0], [0, 0, 1]]
    web = refweb.Inline(points=points, lines=[[0, 1], [0, 2]], supports=[0])
    there, back = [(0.0, 0.0), (1.0, 0.1), (1.2, 0.02)], [(0.0, 0.02), (1.0, 0.0)]
    first, second = (refweb.Motion(node=1, displacement=[(t, x, 0.0, 0.0) for t, x in path]) for path in (there, back))
    scene = refweb.Scene(
        web=web, cable=refweb.Cable(**LAW, density=1.0), effects=[first], accuracy=refweb.Accuracy(error="none"),
        observe=[refweb.Observe(name="lost", quantity="plastic_energy")],
        solve=refweb.Dynamic(duration=1.2), output=refweb.Output(interval=0.5),
    )  # fmt: skip
    before = refweb.run(scene, out=tmp_path / "first")
    plastic = (0.1 * MODULUS - STRESS) / (MODULUS + HARDENING)
    np.testing.assert_allclose(before.state.plastic_strain, [plastic, 0.0], rtol=1e-9)
    assert before.state.tension[0] == 0.0
    for limit, broken in ((0.9 * plastic, [(0, 0.0, 0.0)]), (1.1 * plastic, [])):
        solve = refweb.Dynamic(duration=1.0, method=method, start=str(tmp_path / "first"))
        run = refweb.run(scene.replace(effects=[second, refweb.Rupture(plastic_strain=limit)], solve=solve))
        assert [(b["line"], b["time"], b["energy"]) for b in run.breaks] == broken
        np.testing.assert_allclose(run.history["lost"], before.results["lost"].value, rtol=1e-12)


def test_a_mass_breaks_a_brake():
    """Without a strength: it goes on with what is left; lines beside it without that limit and of another law hold."""
    mass, speed, limit = 2.0, 1.5, 0.05
    groups = {"brake": [0], "rest": [2]}
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]] * 3, supports=[0], groups=groups)
    cable = refweb.Cable(**LAW, density=0.0, groups={"rest": dict(law="tension-only", modulus=1e4)})
    effects = [refweb.PointMass(node=1, mass=mass), refweb.Velocity(node=1, value=(speed, 0.0, 0.0))]
    run = refweb.run(
        refweb.Scene(
            web=web,
            cable=cable,
            effects=[*effects, refweb.Rupture(groups={"brake": {"plastic_strain": limit}})],
            solve=refweb.Dynamic(duration=0.1, safety=0.01),
            output=refweb.Output(interval=0.01),
        )  # fmt: skip
    )
    assert [b["line"] for b in run.breaks] == [0]

    def energy(p):
        return AREA * (STRESS * p + 0.5 * HARDENING * p**2 + 0.5 * (STRESS + HARDENING * p) ** 2 / MODULUS)

    stretch = run.state.x[1, 0]
    p = (MODULUS * stretch - STRESS) / (MODULUS + HARDENING)
    kinetic = 0.5 * mass * speed**2 - energy(limit) - energy(p) - 0.5 * AREA * 1e4 * stretch**2
    np.testing.assert_allclose(0.5 * mass * run.state.v[1, 0] ** 2, kinetic, rtol=1e-4)


@pytest.mark.parametrize(
    "keys, words",
    [
        (dict(plastic_strain=0.1), "plastic_strain = 0.1 needs lines that yield"),
        (
            dict(groups={"rest": {"plastic_strain": 0.1}}),
            'groups.rest: plastic_strain = 0.1 has no meaning with law = "t',
        ),
    ],
)
def test_plastic_strains_of_lines_that_do_not_yield(keys, words):
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0], groups={"rest": [0]})
    cable = refweb.Cable(law="tension-only", modulus=1.0, area=1.0, density=1.0)
    with pytest.raises(InputError, match=words):
        refweb.Scene(web=web, cable=cable, effects=[refweb.Rupture(**keys)]).build()


def between(effects, law=LAW, **solve):
    """A line of 1 m between two supports, with effects; solved in statics or dynamics."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1])
    return refweb.Scene(
        web=web,
        cable=refweb.Cable(**law, density=1.0),
        effects=effects,
        observe=[refweb.Observe(name="lost", quantity="plastic_energy")],
        accuracy=refweb.Accuracy(error="none"),
        **solve,
    )


def of_reeled_in(length):
    """(Energy lost, energy stored) of a line of 1 m whose natural length is drawn in to some length while it yields."""

    def plastic(length):  # E (1/L − 1 − p) = Y + H p
        return (MODULUS * (1.0 / length - 1.0) - STRESS) / (MODULUS + HARDENING)

    def lost_at(length):
        return length * AREA * (STRESS + HARDENING * plastic(length)) * MODULUS / (MODULUS + HARDENING) / length**2

    begin = 1.0 / (1.0 + STRESS / MODULUS)
    lost = quad(lost_at, length, begin, epsabs=0.0, epsrel=1e-12)[0]
    return lost, 0.5 * AREA * MODULUS * length * (1.0 / length - 1.0 - plastic(length)) ** 2


def test_a_reel_brings_material_that_has_lost_nothing():
    """Reeled in until it yields, and paid out slack: ∫ L A Y dp of what was there, to order 2, and then no more."""
    reel, errors = refweb.Reel(lines=0, factor=[(0.0, 1.0), (1.0, 0.9), (3.0, 3.0)]), []
    for step in (8e-3, 4e-3, 2e-3):
        solve = refweb.Dynamic(duration=3.0, step_size=step)
        lost = refweb.run(between([reel], solve=solve, output=refweb.Output(interval=0.5))).history["lost"]
        errors.append(np.abs(lost[2:] / of_reeled_in(0.9)[0] - 1.0).max())
    assert errors[-1] < 1e-6 and errors[0] > 3.5**2 * errors[-1]
    web, errors = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 1]), []
    for steps in (10, 40):
        solve = refweb.Static(load_steps=np.linspace(0.0, 1.0, steps + 1)[1:].tolist())
        lost = refweb.run(between([reel], solve=solve).replace(web=web)).results["lost"].value
        errors.append(abs(lost / of_reeled_in(0.9)[0] - 1.0))
    assert errors[1] < 1e-5 and errors[0] > 3.0**2 * errors[1]


@pytest.mark.ordinary(
    "cvode-1e-06-reel",
    "cvode-1e-06-temperature",
    "cvode-1e-06-motion",
    "cvode-0.001-reel",
    "cvode-0.001-temperature",
    "cvode-0.001-motion",
)
@pytest.mark.parametrize("effect", ["reel", "temperature", "motion"])
@pytest.mark.parametrize("method, rtol", [("cvode", 1e-6), ("cvode", 1e-3), ("ida", 1e-6)])
def test_energy_by_the_path_has_an_error_although_run_and_refinement_take_the_same_steps(method, rtol, effect):
    """Lines that yield at rest while they are drawn in, or their end is drawn: work and lost energy are within ±."""
    table = [(0.0, 0.0), (1.0, -100.0)]
    effects = {
        "reel": refweb.Reel(lines=0, factor=[(0.0, 1.0), (1.0, 0.9)]),
        "motion": refweb.Motion(node=1, displacement=[(0.0, 0.0, 0.0, 0.0), (1.0, 0.1, 0.0, 0.0)]),
        "temperature": refweb.Temperature(expansion=0.0, change=0.0, groups={"b": dict(expansion=1e-3, change=table)}),
    }
    web = refweb.Inline(
        points=[[0, 0, 0], [1, 0, 0], [0, 0, -1]], lines=[[0, 1], [0, 2]], supports=[0, 1], groups={"b": [0]}
    )
    observe = [refweb.Observe(name=name, quantity=name.lower()) for name in ("Plastic_energy", "Work")]
    scene = between([effects[effect]], solve=refweb.Dynamic(duration=1.0, method=method, rtol=rtol)).replace(
        web=web, observe=observe, accuracy=refweb.Accuracy(), output=refweb.Output(interval=0.5)
    )
    run, (lost, stored) = refweb.run(scene), of_reeled_in(0.9)
    if effect == "motion":
        plastic = (0.1 * MODULUS - STRESS) / (MODULUS + HARDENING)
        lost = AREA * (STRESS * plastic + 0.5 * HARDENING * plastic**2)
        stored = 0.5 * AREA * MODULUS * (0.1 - plastic) ** 2
        stored -= 0.5 * (0.5 * AREA) * 0.1**2  # kinetic energy of its end, which has gone at the end of the table
    for result, exact in zip(run.results.values(), (lost, lost + stored), strict=True):
        assert abs(result.value - exact) <= result.error <= 3e-2 * rtol**0.5 * exact
    assert run.solver["nsteps"] < 30


def test_no_load_above_the_limit_is_carried():
    """A line that yields without hardening carries its yield force, three bars the sum of theirs, and no more."""
    law = LAW | {"hardening": 0.0}
    scene = between([refweb.Load(node=1, force=(10.5, 0, 0))], law, solve=refweb.Static())
    hung = scene.replace(web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]))
    with pytest.raises(refweb.SolverError, match="limit load"):
        refweb.run(hung)
    points = [[0, 0, 0], [-1, 0, 0], [1, 0, 0], [0, 0, -1]]
    bars = refweb.Inline(points=points, lines=[[0, 3], [1, 3], [2, 3]], supports=[0, 1, 2])
    for load in (31.0, 100.0):
        with pytest.raises(refweb.SolverError, match="limit load"):
            refweb.run(hung.replace(web=bars, effects=[refweb.Load(node=3, force=(0, 0, -load))]))


@pytest.mark.parametrize("hardening", [0.0, 1.0])
def test_a_vibration_about_a_yielded_state_is_elastic(hardening):
    """The tangent of a line that has just yielded is EA/L, with hardening and without."""
    stretched = rope(law=LAW | {"hardening": hardening})
    x = np.zeros((stretched.rows, 3))
    x[1, 0] = 0.02
    x = stretched.taken_on(0.0, x)
    along = stretched.pattern.matrix(stretched.stiffness(0.0, x)).toarray()[0, 0]
    np.testing.assert_allclose(along, MODULUS * AREA, rtol=1e-9)


def test_pretension_is_the_tension_that_is_asked_for():
    """Above the yield force too, where hardening bears it; refused where none does, and in forms that are found."""
    tense = between([], LAW | {"pretension": 12.0}, solve=refweb.Static())
    np.testing.assert_allclose(refweb.run(tense).tension, 12.0, rtol=1e-9)
    with pytest.raises(
        InputError, match="pretension: line 0 cannot have a stress of 120000 Pa: it yields at 100000 Pa"
    ):
        between([], LAW | {"pretension": 12.0, "hardening": 0.0}, solve=refweb.Static()).build()


def test_a_line_that_has_yielded_and_lost_its_tension_is_slack():
    """Of two lines the one that is longer by its plastic strain is slack at a strain above zero."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 1, 0]], lines=[[0, 1], [2, 3]], supports=[0, 2, 3])
    table = [(0.0, 0.0, 0.0, 0.0), (1.0, 0.05, 0.0, 0.0), (2.0, 0.02, 0.0, 0.0)]
    scene = refweb.Scene(
        web=web, cable=refweb.Cable(**LAW, density=1.0, prestrain=1e-3),
        effects=[refweb.Motion(node=1, displacement=table)],
        observe=[refweb.Observe(name="slack", quantity="slack_fraction")],
        solve=refweb.Dynamic(duration=2.0, step_size=2e-3), output=refweb.Output(interval=1.0),
        accuracy=refweb.Accuracy(error="none"),
    )  # fmt: skip
    run = refweb.run(scene)
    np.testing.assert_array_equal(run.history["slack"], [0.0, 0.0, 0.5])
    assert run.state.element_slack.mean() == 0.5
