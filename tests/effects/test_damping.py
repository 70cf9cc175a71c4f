"""Damping: restitution of a tether that snaps taut, decay of modes, what it dissipates, and the step it asks for."""

from dataclasses import replace

import nets
import numpy as np
import pytest
import scipy.linalg
from nets import LAWS, skew_net
from scipy.integrate import solve_ivp

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.cvode import Cvode
from refweb.dynamics.integrators.ida import Ida
from refweb.effects.elasticity import Elasticity
from refweb.errors import InputError
from refweb.net import discretisation
from refweb.results.state import State
from refweb.system.system import System

OMEGA, MASSES, REDUCED, SPEED = 100.0, (1.0, 3.0), 0.75, 0.6
APART = np.array([[-0.2, 0.0, 0.0], [0.4, 0.0, 0.0]])
"""Velocities of the two masses, which move apart at `SPEED`."""


def tether(zeta, gap=0.0, **cable):
    """Two masses on one massless line of 1 m and frequency `OMEGA`, ``gap`` longer than their distance."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], natural_length=[1.0 + gap], supports=[]).web()
    cable = {"law": "tension-only", "modulus": REDUCED * OMEGA**2 * (1.0 + gap), "area": 1.0, "density": 0.0, **cable}
    effects = [refweb.PointMass(node=i, mass=m) for i, m in enumerate(MASSES)]
    effects.append(refweb.Damping(time=2.0 * zeta / OMEGA))
    return nets.system(web, refweb.Cable(**cable), effects, False, np.zeros((2, 3), dtype=bool))


def taut(zeta, t):
    """(stretch, its rate) of the taut tether that starts unstrained: the damped oscillator."""
    root = np.sqrt(complex(1.0 - zeta**2)) * OMEGA
    sine = (np.sin(root * t) / root).real if root else t
    decay = np.exp(-zeta * OMEGA * t) * SPEED
    return decay * sine, decay * (np.cos(root * t).real - zeta * OMEGA * sine)


def parting(zeta):
    """(time at which stress vanishes, speed of approach then over `SPEED`).

    There x = −2ζ x'/ω. With ζ = sin φ that is ω_d t = π − 2φ = 2 acos ζ, and x' = −exp(−ζωt) times what it was: for
    ζ < 1/√2 the branch of π − atan[2ζ√(1 − ζ²)/(1 − 2ζ²)], and on beyond that and beyond ζ = 1.
    """
    root = np.sqrt(abs(1.0 - zeta**2))
    angle = 1.0 if zeta == 1.0 else (np.arccos(zeta) if zeta < 1.0 else np.arccosh(zeta)) / root
    return 2.0 * angle / OMEGA, np.exp(-2.0 * zeta * angle)


def approach(run):
    return (run.v[0, 0] - run.v[1, 0]) / SPEED


def stretched(system, run):
    """(stretch, its rate, tension) of the tether."""
    state = State(system, run.time, run.x, run.v)
    return np.array([run.x[1, 0] - run.x[0, 0], run.v[1, 0] - run.v[0, 0], state.tension[0]])


def slope(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def started(solver, v=APART):
    return solver, solver.start(v=v)


def stepped(system, end, safety, v=APART):
    solver = CentralDifference(system, safety=safety)
    run = solver.start(v=v)
    solver.advance(run, np.linspace(0.0, end, 3)[1:])
    return run


def test_restitution_by_the_formula():
    zeta = 0.1
    angle = np.pi - np.arctan(2.0 * zeta * np.sqrt(1.0 - zeta**2) / (1.0 - 2.0 * zeta**2))
    np.testing.assert_allclose(parting(zeta)[1], np.exp(-zeta / np.sqrt(1.0 - zeta**2) * angle), rtol=1e-14)
    assert abs(parting(zeta)[1] - 0.7441) < 5e-5


@pytest.mark.parametrize("zeta", [0.1, 0.3, 0.5, 0.6, 0.8, 1.0, 2.0, 10.0])
def test_restitution(zeta):
    """The stretch is of order 2; so is the restitution, but for where in its step the force meets zero."""
    system, (time, expected) = tether(zeta), parting(zeta)
    x, v = taut(zeta, time)
    np.testing.assert_allclose([2.0 * zeta * v / OMEGA, v], [-x, -expected * SPEED], rtol=1e-12)
    safeties, errors, restitutions = (0.2, 0.1, 0.05, 0.025), [], []
    for safety in safeties:
        run = stepped(system, 0.5 * time, safety)
        errors.append([abs(run.x[1, 0] - run.x[0, 0] - taut(zeta, 0.5 * time)[0]), run.nsteps])
        run = stepped(system, 1.2 * time, safety)
        restitutions.append(abs(approach(run) - expected))
    stretch, nsteps = np.array(errors).T
    assert abs(slope(stretch, 1.0 / nsteps) - 2.0) < 0.1
    # A kink anywhere within a step changes the velocity by at most ⅛ h² × that of the slope of the acceleration,
    # which is ω² × the speed there, beside errors of order 2 of the taut phase.
    share = safeties[-1] * CentralDifference(system).bound() * OMEGA
    assert restitutions[-1] < 0.5 * share**2 and slope(restitutions, safeties) > 1.8


@pytest.mark.ordinary("0.1-Cvode")
@pytest.mark.parametrize("method", [Cvode, Ida])
@pytest.mark.parametrize("zeta", [0.1, 0.5, 2.0])
def test_restitution_by_implicit_steps(method, zeta):
    """Also where the line is slack at first, so that its force jumps within a step."""
    for gap in (0.0, 2.17e-3):
        time, expected = parting(zeta)
        solver, run = started(method(tether(zeta, gap), rtol=1e-8))
        solver.advance(run, [1.5 * time + gap / SPEED])
        # Errors of a few hundred steps of a tolerance of 1e-8, and of their book by 1e-3 of the energy in a piece.
        assert abs(approach(run) - expected) < 1e-5 and run.drift < 2e-3


def test_first_order_where_the_force_jumps():
    """A line without smoothing that snaps taut within a step; with smoothing that steps resolve it is of order 2."""
    (time, expected), gap = parting(0.5), 2.17e-3
    system = tether(0.5, gap)
    steps = np.geomspace(1e-4, 1e-5, 40)
    errors = []
    for step in steps:
        solver, run = started(CentralDifference(system, step_size=step))
        solver.advance(run, [1.2 * time + gap / SPEED])
        errors.append(abs(approach(run) - expected))
    # The error goes with the place of the jump in its step; its largest over ten neighbouring steps with the step.
    envelope = np.array(errors).reshape(4, 10).max(axis=1)
    assert 0.7 < slope(envelope, steps.reshape(4, 10).mean(axis=1)) < 1.3


def by_formula(zeta, law, gap, end, slackness=0.0, smoothing=0.0):
    """(stretch, its rate, tension) of the tether at a time, from the law as the paper writes it and another method."""
    natural, axial = 1.0 + gap, REDUCED * OMEGA**2 * (1.0 + gap)
    alpha = 0.5 * (-slackness + np.hypot(slackness, 2.0 * smoothing))

    def tension(y):
        strain, speed = (y[0] - gap) / natural, y[1] / natural
        if law == "linear":
            return axial * (strain + 2.0 * zeta / OMEGA * speed)
        s = strain - slackness
        root = np.hypot(s, 2.0 * smoothing)
        stress, tangent = 0.5 * (s + root) - alpha, 0.5 * (1.0 + s / root)
        return axial * max(stress + 2.0 * zeta / OMEGA * tangent * speed, -alpha)

    method = dict(method="DOP853", rtol=1e-12, atol=1e-15)
    y = solve_ivp(lambda t, y: [y[1], -tension(y) / REDUCED], [0.0, end], [0.0, SPEED], **method).y[:, -1]
    return [*y, tension(y)]


@pytest.mark.slow
@pytest.mark.parametrize("law", ["smooth", "linear"])
def test_other_laws(law):
    """Of order 2 on the way out and back, and right where the smooth law is at its floor, and the linear one pushes."""
    smooth = dict(slackness=1e-3, smoothing=5e-4) if law == "smooth" else {}
    system, errors = tether(0.3, 1e-3, law=law, **smooth), []
    safeties = (0.04, 0.02, 0.01, 0.005)
    for safety in safeties:
        run = stepped(system, 0.03, safety)
        errors.append(np.abs(stretched(system, run) - by_formula(0.3, law, 1e-3, 0.03, **smooth)))
    assert all(abs(slope(error, safeties) - 2.0) < 0.1 for error in np.transpose(errors))
    exact = by_formula(0.3, law, 1e-3, 0.04, **smooth)
    if law == "smooth":
        np.testing.assert_allclose(exact[2], -system.net.law.floor(system.net.line_data)[0], rtol=1e-14)
    for solver in (Cvode(system, rtol=1e-9), Ida(system, rtol=1e-9), CentralDifference(system, safety=0.001)):
        run = solver.start(v=APART)
        solver.advance(run, np.linspace(0.0, 0.04, 5)[1:])
        # Local tolerances of 1e-9 add up over three thousand steps; (ωh)² of explicit ones is 3e-6.
        np.testing.assert_allclose(stretched(system, run), exact, rtol=5e-5)


@pytest.mark.parametrize("law", LAWS)
def test_never_pushes_more_than_its_law(law):
    """Total tensions over random states and velocities: at or above the floor, without damping where that is slack."""
    held, net = np.zeros((6, 3), dtype=bool), skew_net(law)
    plain, damped = (System(net, [Elasticity(), *more], held) for more in ([], [refweb.Damping(time=0.1)]))
    floor, smallest, at_floor = net.law.floor(net.line_data), np.inf, 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        x, v = 0.1 * rng.standard_normal((6, 3)), rng.standard_normal((6, 3))
        elastic, total = (system.forces(0.0, x, v).per_cell.tension.copy() for system in (plain, damped))
        assert (total >= -floor * (1.0 + 1e-12)).all()
        smallest, at_floor = (
            min(smallest, total.min()),
            at_floor + np.isclose(total, -floor, rtol=1e-12, atol=0.0).sum(),
        )
        if law == "tension-only":
            np.testing.assert_array_equal(total[elastic == 0.0], 0.0)
    assert smallest < 0.0 if law == "linear" else at_floor > 20


def test_tension_observed_is_the_whole():
    """Largest and smallest tension over a hit: the closed form of k x + c x', from which it starts, and zero."""
    zeta = 0.3
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], natural_length=[1.0], supports=[])
    scene = refweb.Scene(
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=REDUCED * OMEGA**2, area=1.0, density=0.0),
        effects=[
            refweb.Damping(time=2.0 * zeta / OMEGA),
            *(refweb.PointMass(node=i, mass=m) for i, m in enumerate(MASSES)),
            *(refweb.Velocity(node=i, value=tuple(v)) for i, v in enumerate(APART.tolist())),
        ],
        solve=refweb.Dynamic(duration=0.04, safety=0.02),
        accuracy=refweb.Accuracy(error="none"),
        observe=[
            refweb.Observe(name=f"{quantity}_{reduce}", quantity=quantity, reduce=reduce)
            for quantity, reduce in [("tension", "max"), ("tension", "min"), ("stress", "max"), ("strain", "max")]
        ]
        + [refweb.Observe(name="lost", quantity="dissipated_energy")],
    )
    time, restitution = parting(zeta)
    x, v = taut(zeta, np.linspace(0.0, time, 100001))
    tension = REDUCED * (OMEGA**2 * x + 2.0 * zeta * OMEGA * v)
    solution = refweb.run(scene)
    found = {name: result.value for name, result in solution.results.items()}
    # Steps of 0.02 of the bound leave errors of (ωh)²/24 ≤ 1e-4.
    np.testing.assert_allclose([found["tension_max"], found["stress_max"]], tension.max(), rtol=2e-4)
    np.testing.assert_allclose(found["strain_max"], x.max(), rtol=2e-4)
    assert found["tension_min"] == 0.0 and solution.tension[0] == 0.0
    np.testing.assert_allclose(solution.history["tension_max"][0], tension[0], rtol=1e-14)
    lost = 0.5 * REDUCED * SPEED**2 * (1.0 - restitution**2)
    np.testing.assert_allclose(found["lost"], lost, rtol=2e-4)
    np.testing.assert_allclose(solution.history["dissipated_energy"][-1], found["lost"], rtol=1e-14)
    assert (np.diff(solution.history["dissipated_energy"]) >= 0.0).all()


def bar(effects, elements=12, consistent=False, **cable):
    """A taut cable of 1 m along x with both ends fixed."""
    web = refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=elements).web()
    given = {"law": "tension-only", "modulus": 1e4, "area": 1e-2, "density": 100.0, "prestrain": 0.2}
    net = discretisation.build(web, refweb.Cable(**{**given, **cable}), consistent=consistent)
    supported = np.zeros((len(net.points), 3), dtype=bool)
    supported[web.rim] = True
    return System(net, [Elasticity(), *effects], supported)


def mode(system, axis, number=0):
    """(ω, shape) of a mode along an axis, as large as 1 somewhere."""
    axes = system.free % 3 == axis
    K = system.pattern.matrix(system.stiffness(0.0, np.zeros((system.rows, 3)))).toarray()[np.ix_(axes, axes)]
    M = system.pattern.matrix(system.mass.values).toarray()[np.ix_(axes, axes)]
    square, shapes = scipy.linalg.eigh(K, M)
    shape = np.zeros((system.rows, 3))
    shape.ravel()[system.free[axes]] = shapes[:, number] / np.abs(shapes[:, number]).max()
    return np.sqrt(square[number]), shape


def decayed(omega, zeta, t):
    """Displacement after a unit of velocity, of a damped mode."""
    damped = omega * np.sqrt(1.0 - zeta**2)
    return np.exp(-zeta * omega * t) * np.sin(damped * t) / damped


@pytest.mark.parametrize("law", ["tension-only", "linear"])
@pytest.mark.parametrize("kind", ["time", "rate"])
def test_decay_of_a_longitudinal_mode(law, kind):
    """exp(−ζωt) with ζ = τω/2, or rate/(2ω): of order 2, and its book as well; a taut bar is linear along itself."""
    omega, shape = mode(bar([], law=law), 0, number=1)
    zeta, end = 0.05, 5.3 * np.pi / omega
    effect = refweb.Damping(time=2.0 * zeta / omega) if kind == "time" else refweb.Damping(rate=2.0 * zeta * omega)
    system, errors = bar([effect], law=law), []
    for safety in (0.4, 0.2, 0.1, 0.05):
        run = stepped(system, end, safety, v=0.1 * shape)
        errors.append([np.abs(run.x - 0.1 * decayed(omega, zeta, end) * shape).max(), run.drift, run.nsteps])
    error, drift, nsteps = np.array(errors).T
    assert abs(slope(error, 1.0 / nsteps) - 2.0) < 0.05 and abs(slope(drift, 1.0 / nsteps) - 2.0) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("method", [Cvode, Ida])
@pytest.mark.parametrize("order, consistent", nets.some([(2, True), (1, False), (3, False), (2, False)], 2))
def test_decay_at_every_order(method, order, consistent):
    kind, zeta = dict(elements=4, order=order, consistent=consistent), 0.05
    omega, shape = mode(bar([], **kind), 0)
    system, end = bar([refweb.Damping(time=2.0 * zeta / omega)], **kind), 3.3 * np.pi / omega
    solver, run = started(method(system, rtol=1e-7), v=0.1 * shape)
    solver.advance(run, [end])
    # BDF of order 2 leaves a few hundred times its tolerance after two periods.
    assert np.abs(run.x - 0.1 * decayed(omega, zeta, end) * shape).max() < 1e-4 * 0.1 / omega
    assert run.drift < 1e-4


@pytest.mark.parametrize("method", ["central-difference", "cvode"])
def test_decay_of_a_string_mode(method):
    """A drag takes rate/2 of the amplitude of every mode; a material damps a string only by what it stretches."""
    omega, shape = mode(bar([]), 2)
    end, small = 2.3 * np.pi / omega, 1e-6
    rate = 0.2 * omega
    for effect, zeta in [(refweb.Damping(rate=rate), 0.1), (refweb.Damping(time=2.0 / omega), 0.0)]:
        system = bar([effect])
        if method == "cvode":
            tolerances = dict(rtol=1e-7, atol_position=1e-7 * small / omega, atol_velocity=1e-7 * small)
            solver, run = started(Cvode(system, family="adams", **tolerances), v=small * shape)
            solver.advance(run, [end])
        else:
            run = stepped(system, end, 0.02, v=small * shape)
        # (ωh)²/24 of phase per step of 0.02 of the bound, and tolerances.
        expected = small * decayed(omega, zeta, end) * shape
        np.testing.assert_allclose(run.x, expected, atol=1e-4 * small / omega)


def test_drag_of_a_free_web():
    """v = v0 exp(−rate t), of order 2, whatever the masses; bodies are not damped."""
    ball = refweb.Body(name="ball", radius=0.1, mass=2.0, position=(0.0, 0.0, 9.0), velocity=(1.0, 0.0, 0.0))
    effects = [ball, refweb.PointMass(node=2, mass=3.0), refweb.Damping(rate=2.0)]
    web = refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=4).web()
    cable = refweb.Cable(law="tension-only", modulus=1.0, area=1.0, density=1.0)
    system = nets.system(web, cable, effects, False, np.zeros((5, 3), dtype=bool))
    v, errors = np.vstack([np.tile([1.0, -2.0, 0.5], (5, 1)), [1.0, 0.0, 0.0]]), []
    for count in (40, 80, 160, 320):
        solver = CentralDifference(system, step_size=1.0 / count)
        run = solver.start(v=v)
        solver.advance(run, [1.0])
        np.testing.assert_array_equal(run.v[5], v[5])
        errors.append(np.abs(run.v[:5] - np.exp(-2.0) * v[:5]).max())
    assert abs(slope(errors, [8, 4, 2, 1]) - 2.0) < 0.05


@pytest.mark.parametrize("zeta", [0.0, 0.1, 1.0, 10.0])
@pytest.mark.parametrize("kind", ["time", "rate"])
def test_bound_of_the_step(zeta, kind):
    """2/ω (√(1 + ζ²) − ζ) of one line between equal masses, whose row sums are its frequency."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], natural_length=[1.0], supports=[]).web()
    cable = refweb.Cable(law="tension-only", modulus=0.5 * OMEGA**2, area=1.0, density=2.0)
    amount = dict(time=2.0 * zeta / OMEGA) if kind == "time" else dict(rate=2.0 * zeta * OMEGA)
    effects = [refweb.Damping(**amount)] if zeta else []
    bound = CentralDifference(nets.system(web, cable, effects, False, np.zeros((2, 3), dtype=bool))).bound()
    np.testing.assert_allclose(bound, 2.0 / OMEGA * (np.sqrt(1.0 + zeta**2) - zeta), rtol=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_bound_bounds(law):
    """The largest loss of the row sums is never below that of M⁻¹C."""
    effect = refweb.Damping(time=0.1)
    for seed, order in enumerate((1, 2, 3, 1, 2, 3)):
        rng = np.random.default_rng(seed)
        net = discretisation.build(nets.skew_web(), replace(nets.skew_cable(law), order=order))
        net = replace(net, mass=10.0 ** rng.uniform(-3, 0, len(net.mass)))
        system = System(net, [effect], np.zeros((len(net.points), 3), dtype=bool))
        x, v = (0.1 * rng.standard_normal(net.points.shape) for _ in range(2))
        C = system.pattern.matrix(system.damping(0.0, x, v)).toarray()
        largest = scipy.linalg.eigvalsh(C, np.diag(np.repeat(net.mass, 3)))[-1]
        (term,), losses = system.terms, np.zeros(len(net.points))
        term.velocity.bound(0.0, 0.0, x, net.mass, losses, term.cells, system.data_of(term, 0.0))
        assert 0.0 < largest <= (losses / net.mass).max() * (1.0 + 1e-12)


@pytest.mark.parametrize("zeta", [0.1, 1.0])
def test_stable_just_below_the_bound(zeta):
    """The lowest mode of a bar whose highest is damped by ζ, over so many steps that any growth would show."""
    omega, shape = mode(bar([], law="linear"), 0)
    highest = mode(bar([], law="linear"), 0, number=-1)[0]
    system, end = bar([refweb.Damping(time=2.0 * zeta / highest)], law="linear"), 3.3 * np.pi / omega
    run = stepped(system, end, 0.999, v=1e-3 * shape)
    ratio = zeta * omega / highest
    expected = 1e-3 * decayed(omega, ratio, end) * shape
    assert np.abs(run.x - expected).max() < 0.05 * 1e-3 / omega
    run = stepped(system, 40.0 / (ratio * omega), 0.999, v=1e-3 * shape)
    assert np.abs(run.v).max() < 1e-12


def test_statics_does_not_feel_it():
    web, cable = (
        refweb.Window(mesh="square", rows=4, columns=4, side=0.2),
        refweb.Cable(modulus=7e7, area=1e-4, density=1),
    )
    load = refweb.Load(node="centre", force=(0.0, 0.0, 1.0))
    plain = refweb.Scene(web=web, cable=cable, effects=[load])
    damped = plain.replace(effects=[load, refweb.Damping(time=1e-3, rate=1.0)])
    pair = [refweb.run(scene).displacement for scene in (plain, damped)]
    np.testing.assert_array_equal(*pair)


def test_refusals():
    with pytest.raises(InputError, match=r"time = 0 \[s\], rate = 0 \[1/s\] and bodies = 0 \[1/s\]: one of them must"):
        refweb.Damping()
    with pytest.raises(InputError, match=r"time = -1.0 must be ≥ 0 \[s\]"):
        refweb.Damping(time=-1)
    with pytest.raises(InputError, match=r"\[damping\] tau = 1: unknown key"):
        refweb.Damping.read("[damping]", {"tau": 1})
