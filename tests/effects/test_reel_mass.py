"""Mass that follows a reel: closed equations by scipy, angular momentum, drums that move, weight at rest, refusals."""

import nets
import numpy as np
import pytest
from scipy.integrate import simpson, solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.cvode import Cvode
from refweb.dynamics.integrators.ida import Ida
from refweb.effects.plastic import PlasticLines
from refweb.effects.viscous import ViscousArms
from refweb.errors import InputError

AXIAL, DENSE, MASS, FAST, GRAVITY = 1e3, 0.5, 0.3, 3.0, 9.81
"""EA [N], mass of a line by its length [kg/m], a point mass at its end [kg], its speed across [m/s], and g [m/s²]."""
IN, OUT_AND_IN = [(0.0, 1.0), (1.0, 0.6)], [(0.0, 1.0), (0.4, 1.3), (1.0, 1.1)]
WEIGHT = refweb.Gravity(acceleration=(0.0, 0.0, -GRAVITY))
DRIVES = {"drum at rest": (0.0, 0.0, 0.0), "drum that moves": (0.3, -0.2, 0.5)}


def straight(pieces=1, supports=(0,), end=1.0):
    points = [[end * i / pieces, 0.0, 0.0] for i in range(pieces + 1)]
    lines = [[i, i + 1] for i in range(pieces)]
    return refweb.Inline(points=points, lines=lines, supports=list(supports))


CABLE = refweb.Cable(law="linear", modulus=1e4 * AXIAL, area=1e-4, density=DENSE / 1e-4)


def whirled(factor, *effects, drive=(0.0, 0.0, 0.0), pieces=1):
    """A line along x with a mass at its end that is thrown across, both in a frame that moves."""
    given = [
        refweb.PointMass(node=pieces, mass=MASS),
        *(refweb.Velocity(node=i, value=np.add(drive, (0.0, i * FAST / pieces, 0.0))) for i in range(1, pieces + 1)),
        refweb.Reel(lines="all", factor=factor, mass="follows"),
        *effects,
    ]
    if any(drive):
        given.append(refweb.Motion(node=0, displacement=[(0.0, 0.0, 0.0, 0.0), (2.0, *np.multiply(2.0, drive))]))
    return nets.system(straight(pieces, () if any(drive) else (0,)).web(), CABLE, given, quasi_static=False)


def by_scipy(factor, drive, weight, end=1.0):
    """Place, velocity, and work that the motion of the drum and the reel have done, in closed equations.

    The reel gives the force −(EA/2)(l² − L²)/L² = −∂E/∂L of the line times −L', and material of the drum's velocity u
    the power ρA L'/2 (u·v − ½ v²); the moved drum has half of the line's mass, and pulls with the line's tension. Where
    L' jumps, what slides between drum and mass gives either −½ ΔL' ½ρA times the way from one to the other.
    """
    times, factors = np.transpose(factor)
    u = np.array(drive)

    def rate(t, y, slope, at, before):
        natural = before + slope * (t - at)
        away, v = y[:3] - u * t, y[3:6]
        length = np.linalg.norm(away)
        pull = -AXIAL * (length / natural - 1.0) * away / length
        mass, brought = MASS + 0.5 * DENSE * natural, 0.5 * DENSE * slope
        push = pull + brought * (u - v) + mass * weight
        work = -0.5 * AXIAL * (length**2 / natural**2 - 1.0) * slope + brought * (u @ v - 0.5 * v @ v)
        work += 0.5 * brought * u @ u - (0.5 * DENSE * natural * weight - pull) @ u
        # Weight of factor 1 is stored in the energy of gravity; what is beyond it does work, on the drum's node too.
        work += 0.5 * DENSE * (natural - 1.0) * weight @ (v + u)
        return np.concatenate([v, push / mass, [work]])

    y = np.array([1.0, 0.0, 0.0, *np.add(drive, (0.0, FAST, 0.0)), 0.0])
    slopes = [*np.diff(factors) / np.diff(times), 0.0]
    y[3:6] += jumped(y[:3], slopes[0], 1.0)
    for n, (a, b, f, g) in enumerate(zip(times, times[1:], factors, factors[1:], strict=False)):
        given = dict(args=(slopes[n], a, f), method="DOP853", rtol=1e-12, atol=1e-13)
        y = solve_ivp(rate, (a, min(b, end)), y, **given).y[:, -1]
        if b <= end:
            jump, before = jumped(y[:3] - u * b, slopes[n + 1] - slopes[n], g), y[3:6].copy()
            y[3:6] += jump
            y[6] += (MASS + 0.5 * DENSE * g) * jump @ (before + 0.5 * jump)
    return y[:3], y[3:6], y[6]


def jumped(away, jump, natural):
    """Jump of the velocity of a mass at the end of a line, away from the drum, for one of L'."""
    return -0.25 * DENSE * jump * away / (MASS + 0.5 * DENSE * natural)


def far(run, system, truth):
    """Errors of place, velocity and work."""
    own = system.net.points[1] + run.x[1], run.v[1], run.work.sum()
    return [np.abs(one - other).max() for one, other in zip(own, truth, strict=True)]


@pytest.mark.parametrize("factor", [IN, OUT_AND_IN], ids=["in", "out and in"])
@pytest.mark.parametrize("drum", DRIVES)
def test_a_mass_that_is_whirled_by_central_differences(factor, drum):
    """Order 2 in place, velocity, work and angular momentum about a drum at rest; momentum to rounding."""
    drive, errors = DRIVES[drum], []
    system = whirled(factor, WEIGHT, drive=drive)
    truth = by_scipy(factor, drive, np.array(WEIGHT.acceleration))
    for safety in (0.2, 0.1, 0.05):
        solver = CentralDifference(system, safety=safety)
        run = solver.start()
        solver.advance(run, np.linspace(0.1, 1.0, 10))
        errors.append([run.nsteps, *far(run, system, truth)])
        assert run.ledger.drifts[0] < 1e-13
        if not any(drive):  # gravity has no moment about z through the drum, which the line is bound to
            turning = (MASS + 0.5 * DENSE * factor[-1][1]) * np.cross(system.net.points[1] + run.x[1], run.v[1])
            errors[-1].append(abs(turning[2] - (MASS + 0.5 * DENSE) * FAST))
    nsteps, *errors = np.array(errors).T
    for error in errors:
        slope = np.polyfit(np.log(1.0 / nsteps), np.log(error), 1)[0]
        assert abs(slope - 2.0) < 0.2  # steps of 0.2 of the bound leave the next term


@pytest.mark.slow
@pytest.mark.ordinary("drum that moves-Cvode")
@pytest.mark.parametrize("solver", [Cvode, Ida])
@pytest.mark.parametrize("drum", DRIVES)
def test_a_mass_that_is_whirled_by_sundials(solver, drum):
    """Errors go with rtol to the power 2/3, by 21 over two decades, of which a quarter is asked for; balances close.

    Each corner of the table begins the method anew, at order 1.
    """
    drive, errors = DRIVES[drum], []
    system = whirled(OUT_AND_IN, WEIGHT, drive=drive)
    truth = by_scipy(OUT_AND_IN, drive, np.array(WEIGHT.acceleration))
    for rtol in (1e-4, 1e-6):
        one = solver(system, rtol=rtol)
        run = one.start()
        one.advance(run, np.linspace(0.1, 1.0, 10))
        errors.append([*far(run, system, truth), run.drift, run.ledger.drifts[0]])
    coarse, fine = np.array(errors)
    assert (coarse > 5.0 * fine).all()
    assert fine[0] < 5e-4 and fine[1] < 1e-2 and fine[2] < 5e-3 and fine[3] < 5e-4 and fine[4] < 5e-5


STIFF, YIELD, HARD, ARM = 100.0, 5.0, 10.0, (100.0, 0.05)
"""EA, A Y and A H of a line that yields [N]; EA [N] and τ [s] of an arm."""


def hoisted(yields, end):
    """(Length, velocity, energy lost at the end) of a weight on a line that is reeled in, along it, by scipy.

    Of a line that yields it is ∫ A L Y dp, L at the time at which it yields.
    """
    speed = -0.8

    def rate(t, y):
        length, v, largest, z, lost = y
        natural = 1.0 + speed * t
        e, growth = length / natural - 1.0, (v - length * speed / natural) / natural
        if yields:
            p = max((STIFF * max(largest, e) - YIELD) / (STIFF + HARD), 0.0)
            pull, creep = STIFF * max(e - p, 0.0), 0.0
            yielding = growth > 0.0 and e >= largest and p > 0.0
            dissipated = natural * (YIELD + HARD * p) * STIFF / (STIFF + HARD) * growth * yielding
        else:
            pull, material = STIFF * max(e, 0.0) + ARM[0] * (e - z), e
            if pull < 0.0:  # slack, and its material is free of tension
                pull, material = 0.0, ARM[0] * z / (ARM[0] + STIFF * (z > 0.0))
            creep = (material - z) / ARM[1]
            dissipated = natural * ARM[0] * ARM[1] * creep**2
        mass, brought = MASS + 0.5 * DENSE * natural, 0.5 * DENSE * speed
        force = mass * GRAVITY - pull - brought * v
        return [v, force / mass, max(growth, 0.0) if e >= largest else 0.0, creep, dissipated]

    begun = jumped(1.0, speed, 1.0)
    length, v, _, _, lost = solve_ivp(
        rate, (0.0, end), [1.0, begun, 0.0, 0.0, 0.0], "DOP853", rtol=1e-9, atol=1e-12, max_step=1e-3
    ).y[:, -1]
    return length, v, lost


@pytest.mark.ordinary("*-CentralDifference")
@pytest.mark.parametrize("solver", [CentralDifference, Cvode, Ida])
@pytest.mark.parametrize("kind", ["yields", "arms"])
def test_a_line_that_yields_or_relaxes_while_it_is_reeled_in(kind, solver):
    """Material leaves with its plastic strain, or the state of its arms; books are closed."""
    keys, end = dict(modulus=1e4 * STIFF, area=1e-4, density=DENSE / 1e-4), 0.4
    if kind == "yields":
        cable = refweb.Cable(law="elastic-plastic", yield_stress=1e4 * YIELD, hardening=1e4 * HARD, **keys)
    else:
        cable = refweb.Cable(law="tension-only", viscous=refweb.Viscous(arms=[(1e4 * ARM[0], ARM[1])]), **keys)
    lines = [PlasticLines(cable)] if kind == "yields" else [ViscousArms(cable.viscous)]
    reel = refweb.Reel(lines="all", factor=[(0.0, 1.0), (1.0, 0.2)], mass="follows")
    weight = refweb.Gravity(acceleration=(GRAVITY, 0.0, 0.0))
    effects = [*lines, refweb.PointMass(node=1, mass=MASS), reel, weight]
    system = nets.system(straight().web(), cable, effects, quasi_static=False)
    method = solver(system, **({"safety": 0.02} if solver is CentralDifference else {"rtol": 1e-7}))
    run = method.start(system.settled(None))
    method.advance(run, [end])
    if kind == "yields":
        lost = sum(system.energy_of(f, end, run.x).sum() for f in system.terms if f.balance.column == "plastic_energy")
    else:
        lost = -run.work[:-1][system.working < 0].sum()
    truth = hoisted(kind == "yields", end)
    assert truth[2] > 0.1
    np.testing.assert_allclose([1.0 + run.x[1, 0], run.v[1, 0]], truth[:2], rtol=2e-4, atol=2e-4)
    # What yields in a step is booked with L of its end, which changes by some 2e-3 of itself in the largest ones.
    np.testing.assert_allclose(lost, truth[2], rtol=2e-3 if kind == "yields" else 2e-4, atol=2e-4)
    assert run.drift < 2e-4


def momenta(system, time, x, v, slope):
    """Momentum and angular momentum about the origin of nodes and bodies, and of what slides at a rate φ' of the reel.

    An edge has the momentum −φ' Q (r_b − r_a) and the angular momentum −φ' Q r_a × r_b.
    """
    mass, places = system.material_flow.masses(time), system.net.points + x
    linear = system.rows - system.net.spins
    push, turn = mass[:linear] @ v[:linear], mass[:linear] @ np.cross(places[:linear], v[:linear])
    for body in system.net.bodies:
        turn += mass[body.spin] * v[body.spin]  # v of the row of rotation is the angular momentum over its mass
    for term in system.material_flow.sliding:
        (a, b), beyond = term.cells.T, -slope * term.data[:, 0]
        push, turn = push + beyond @ (places[b] - places[a]), turn + beyond @ np.cross(places[a], places[b])
    return np.array([push, turn])


def test_a_tether_keeps_its_angular_momentum():
    """Four elements about a pin: Σ m r × v and what slides, with the mass of each at its time, to order 2."""
    system, errors = whirled(IN, pieces=4), []
    lumped = DENSE * 0.25 * np.array([1.0, 1.0, 1.0, 0.5])
    lumped[-1] += MASS
    for safety in (0.4, 0.2, 0.1):
        solver = CentralDifference(system, safety=safety)
        run = solver.start()
        errors.append([])
        for time, slope in ((0.0, -0.4), (0.3, -0.4), (1.0, 0.0)):
            if time:
                solver.advance(run, [time])
            found = momenta(system, time, run.x, run.v, slope)[1][2]
            errors[-1].append(abs(found - lumped @ np.linspace(0.25, 1.0, 4) ** 2 * FAST))
    assert max(errors[0][0], errors[1][0], errors[2][0]) < 1e-14
    for error in np.transpose(errors)[1:]:
        assert error[2] < 1e-4 and error[1] / error[2] == pytest.approx(4.0, rel=0.2)
    np.testing.assert_allclose(system.material_flow.masses(1.0).sum(), MASS + 0.6 * DENSE, rtol=1e-14)


def test_a_free_tether_that_is_reeled_in_turns_as_one_without_elements():
    """Two masses on a straight line that does not stretch: its transverse motion, and no moment about the drum.

    With a the acceleration of the drum across the line, of the masses beyond it m, of their first and second moments
    m₁ and m₂ about it, (M + m) a + m₁ ω' = −2 l' ω m and m₁ a + m₂ ω' = −2 l' ω m₁.
    """
    drum, far, dense, span, end = 5.0, 5.0, 1.0, 10.0, 0.5

    def rate(t, y):
        length, speed = span * (1.0 - end * t), -span * end
        m, m1, m2 = (length**k * (far + dense * length / (k + 1.0)) for k in range(3))
        sides = -2.0 * speed * y[0] * np.array([m, m1])
        return np.linalg.solve([[drum + m, m1], [m1, m2]], sides)[1:]

    truth = solve_ivp(rate, (0.0, 1.0), [20.0], "DOP853", rtol=1e-10, atol=1e-12).y[0, -1]
    errors = []
    for pieces in (4, 8, 16):
        effects = [
            refweb.PointMass(node=0, mass=drum),
            refweb.PointMass(node=pieces, mass=far),
            refweb.Velocity(node="all", spin=(0.0, 0.0, 20.0)),
            refweb.Reel(lines="all", factor=[(0.0, 1.0), (1.0, end)], mass="follows", drum=0),
        ]
        cable = refweb.Cable(law="linear", modulus=1e13, area=1e-4, density=dense / 1e-4)
        system = nets.system(straight(pieces, (), span).web(), cable, effects, quasi_static=False)
        solver = CentralDifference(system, safety=0.5)
        run = solver.start()
        solver.advance(run, [1.0])
        away, apart = run.x[-1] - run.x[0] + [span, 0.0, 0.0], run.v[-1] - run.v[0]
        errors.append(abs(np.cross(away, apart)[2] / (away @ away) - truth))
        assert run.drift < 1e-3 and run.ledger.drifts[0] < 1e-12
    # Coriolis forces bend the line, by (l'/(ω l))² of its length and more; without what slides it is 92 rad/s.
    assert errors[2] < errors[1] < 0.3 * errors[0] and errors[2] < 5e-3 * truth


@pytest.mark.ordinary("CentralDifference")
@pytest.mark.parametrize("solver", [CentralDifference, Cvode, Ida])
def test_a_net_that_is_reeled_by_a_free_body_keeps_its_momenta(solver):
    """A ring, a chain and a bridge with a drum on a body that turns: what is lost has left with the drum's velocity."""
    points = [[0, 0, 0], [1, 0.2, 0], [1.5, 1.0, 0.3], [0.4, 1.2, -0.2], [-0.3, 0.6, 0.1], [2.3, 1.4, 0.8]]
    lines = [[0, 1], [1, 2], [2, 3], [3, 4], [4, 0], [2, 5]]
    factor = [(0.0, 1.0), (0.1, 0.8), (0.2, 1.05)]
    rng = np.random.default_rng(5)
    effects = [
        refweb.Body(name="ship", radius=0.2, mass=2.0, position=(0.0, -0.3, 0.0), angular_velocity=(0.5, -0.3, 0.8)),
        refweb.Attach(body="ship", node=0),
        *(refweb.Velocity(node=n, value=tuple(rng.normal(size=3))) for n in range(1, 6)),
        refweb.Reel(lines="all", factor=factor, mass="follows", drum=0),
    ]
    web = refweb.Inline(points=points, lines=lines, supports=[]).web()
    cable = refweb.Cable(law="linear", modulus=1e4 * AXIAL, area=1e-4, density=DENSE / 1e-4)
    system = nets.system(web, cable, effects, quasi_static=False)
    method = solver(system, **({"safety": 0.1} if solver is CentralDifference else {"rtol": 1e-7}))
    run = method.start()
    worth = system.material_flow.shares(0.0).sum()  # the mass of a factor of 1
    before, found, lost = momenta(system, 0.0, run.x, run.v, -2.0), [], []
    for slope, times in ((-2.0, np.linspace(0.0, 0.1 - 1e-9, 101)), (2.5, np.linspace(0.1, 0.2 - 1e-9, 101))):
        leaving = []
        for time in times:
            if time:
                method.advance(run, [time])
            leaving.append([run.v[0].copy(), np.cross(system.net.points[0] + run.x[0], run.v[0])])
        lost.append(slope * worth * simpson(leaving, x=times, axis=0))
        found.append(momenta(system, times[-1], run.x, run.v, slope) - before)
        before = before + found[-1]
    method.advance(run, [0.2])
    at_rest = momenta(system, 0.2, run.x, run.v, 0.0) - before
    np.testing.assert_allclose(found, lost, rtol=0.0, atol=1e-4)  # of up to 2.7: what steps of order 2 leave
    np.testing.assert_allclose(at_rest, 0.0, atol=1e-6)  # what leaves in 1 ns


@pytest.mark.slow
@pytest.mark.parametrize("solver", nets.some([CentralDifference, Cvode, Ida], 2))
def test_it_is_the_same_in_axes_that_turn(solver):
    """A tether of two elements seen from axes that turn by Ω about its drum, skew to its plane: places, work, momentum.

    In turning axes the inertia forces do work; what is compared there is that the balance closes.
    """
    omega, end, errors = np.array([0.3, -0.4, 1.2]), 0.6, []
    still = whirled(OUT_AND_IN, pieces=2)
    turning = whirled(OUT_AND_IN, refweb.Frame(angular_velocity=omega), pieces=2)
    back = Rotation.from_rotvec(-end * omega)
    for accuracy in (dict(safety=0.1), dict(safety=0.05)) if solver is CentralDifference else (dict(rtol=1e-5),):
        places = []
        for system in (still, turning):
            one = solver(system, **accuracy)
            v = system.initial_velocity()
            if system is turning:
                v -= np.cross(omega, system.net.points)
            run = one.start(v=v)
            one.advance(run, [0.2, 0.4, end])
            places.append(system.net.points + run.x)
            assert run.drift < 1e-3 and run.ledger.drifts[0] < 1e-4
        errors.append(np.abs(back.apply(places[0]) - places[1]).max())
    if solver is CentralDifference:
        assert errors[1] < 0.3 * errors[0]  # of order 2
    assert errors[-1] < 3e-3  # of 40 without the velocity of the axes


def test_what_a_reel_adds_in_turning_axes():
    """At a factor of 1.2, between corners: force by the energy, tangents by the force, whose velocity does no work."""
    axes = [[1.0, 2.0, 0.0], [-2.0, 1.0, 0.5]]
    system = whirled(OUT_AND_IN, refweb.Orbit(mean_motion=0.7, axes=axes), pieces=2)
    of_place, of_velocity = (term for term in system.terms if term.name == "orbit" and term.balance.column == "work")
    rng, t, h = np.random.default_rng(3), 0.4 * 2.0 / 3.0, 1e-6
    x, v, step = (rng.normal(size=(system.rows, 3)) for _ in range(3))
    blocks = np.empty((len(of_place.cells), 3, 3))

    def times(block):
        return sum_of([block[c] @ step[row] for c, (row,) in enumerate(of_place.cells)])

    def sum_of(rows):
        total = np.zeros_like(x)
        np.add.at(total, of_place.cells[:, 0], rows)
        return total

    energies = [system.energy_of(of_place, t, x + side * h * step).sum() for side in (1.0, -1.0)]
    force = system.force_of(of_place, t, x, v)
    assert (energies[1] - energies[0]) / (2.0 * h) == pytest.approx((force * step).sum(), rel=1e-7)
    of_place.tangent.stiffness(t, x, v, blocks, of_place.cells, of_place.data, False)
    change = system.force_of(of_place, t, x + step, v) - force  # both forces are linear
    np.testing.assert_allclose(times(blocks), -change, rtol=0, atol=1e-13 * np.abs(force).max())
    turned = system.force_of(of_velocity, t, x, v)
    of_velocity.velocity.damping(t, x, v, blocks, of_velocity.cells, of_velocity.data, False)
    change = system.force_of(of_velocity, t, x, v + step) - turned
    np.testing.assert_allclose(times(blocks), -change, rtol=0, atol=1e-13 * np.abs(turned).max())
    assert abs((turned * v).sum()) < 1e-14 * np.abs(turned * v).sum()
    # What the built masses feel, times what the factor adds of each line's mass.
    steady = next(term for term in system.terms if term.balance.column == "orbit_energy")
    built, added = system.net.mass, system.material_flow.masses(t) - system.net.mass
    expected = system.force_of(steady, t, x, v) * (added / built)[:, None]
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-13 * np.abs(force).max())


def test_what_slides_in_turning_axes():
    """At a factor of 1.2: force by velocities of the axes, tangents by the force; the jump by the masses there are."""
    omega = np.array([0.3, -0.4, 1.2])
    system = whirled(OUT_AND_IN, refweb.Frame(angular_velocity=omega), pieces=3)
    (term,) = system.material_flow.sliding
    rng, t = np.random.default_rng(4), 0.4 * 2.0 / 3.0
    x, v, step = (rng.normal(size=(system.rows, 3)) for _ in range(3))
    (a, b), places = term.cells.T, system.net.points + x
    beyond = DENSE * np.array([2.5, 1.5, 0.5]) / 3.0  # of the nodes behind each edge
    push = -(0.3 / 0.4) * beyond[:, None] * (v[b] - v[a] + np.cross(omega, places[b] - places[a]))
    expected = np.zeros_like(x)
    np.add.at(expected, term.cells, push[:, None, :])
    force = system.force_of(term, t, x, v)
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-13)
    for kernel, state in ((term.tangent.stiffness, (x + step, v)), (term.velocity.damping, (x, v + step))):
        blocks, change = np.empty((3, 6, 6)), system.force_of(term, t, *state) - force  # the force is linear
        kernel(t, x, v, blocks, term.cells, term.data, False)
        total = np.zeros_like(x)
        np.add.at(total, term.cells, (blocks @ step[term.cells].reshape(3, 6, 1)).reshape(3, 2, 3))
        np.testing.assert_allclose(total, -change, rtol=0, atol=1e-13)
    flow, jump = system.material_flow, (1.1 - 1.3) / 0.6 - 0.3 / 0.4
    gained = flow.masses(0.4)[1:, None] * (flow.velocity_behind(0.4, x, v) - v)[1:]
    expected = 0.5 * jump * beyond[:, None] * (places[a] - places[b])
    np.testing.assert_allclose(gained.sum(axis=0), (2.0 * expected.sum(axis=0) - expected[0]), rtol=0, atol=1e-13)
    assert flow.velocity_behind(0.2, x, v) is v


def test_material_goes_both_ways_around_a_ring():
    """What leaves each node is its mass, and around the ring ∑ q L is 0: ∑ q² L is least."""
    corners = [[0, 0, 0], [1, 0, 0], [3, 2, 0], [0, 1, 0]]
    web = refweb.Inline(points=corners, lines=[[0, 1], [1, 2], [2, 3], [3, 0]], supports=[0]).web()
    system = nets.system(web, CABLE, [refweb.Reel(lines="all", factor=IN, mass="follows")], quasi_static=False)
    (term,), (flow,) = system.material_flow.sliding, system.material_flow.flows
    out = np.zeros(4)
    for (a, b), passed in zip(term.cells, term.data[:, 0], strict=True):
        out[a] += passed
        out[b] -= passed
    np.testing.assert_allclose(out[1:], flow.mass[1:], rtol=1e-13)
    assert abs(term.data[:, 0] @ system.net.natural_length) < 1e-13
    assert np.ptp(system.net.natural_length) > 1.0


@pytest.mark.parametrize("method", ["newton", "relaxation"])
def test_a_line_that_is_paid_out_hangs_by_the_weight_it_has(method):
    """At each load step the tension in an element is the weight of the nodes below it, ρA L(t) g in all."""
    web, steps = straight(3), (0.0, 0.5, 1.0)
    factor = [(0.0, 1.0), (1.0, 2.5)]
    scene = refweb.Scene(
        web=web,
        cable=CABLE,
        effects=[
            refweb.Gravity(acceleration=(GRAVITY, 0.0, 0.0)),
            refweb.Reel(lines="all", factor=factor, mass="follows"),
        ],
        solve=refweb.Static(load_steps=steps, method=method),
        observe=[refweb.Observe(name=f"of_{line}", quantity="tension", line=line) for line in range(3)],
    )
    history = refweb.run(scene).history
    for step, *found in zip(steps, *(history[f"of_{line}"] for line in range(3)), strict=True):
        piece = DENSE * GRAVITY * np.interp(step, *np.transpose(factor)) / 3.0
        np.testing.assert_allclose(found, piece * np.array([2.5, 1.5, 0.5]), rtol=1e-9)  # the residual of statics


def test_a_drum_on_a_body():
    """A body of 1e12 kg that drifts is a drum that is moved; the mass of its node stays with it."""
    drive = DRIVES["drum that moves"]
    truth = whirled(IN, drive=drive)
    effects = [
        refweb.Body(name="ship", radius=0.1, mass=1e12, position=(-0.1, 0.0, 0.0), velocity=drive),
        refweb.Attach(body="ship", node=0),
        *thrown(drive),
    ]
    system = nets.system(straight(1, ()).web(), CABLE, effects, quasi_static=False)
    places = []
    for one in (truth, system):
        solver = CentralDifference(one, safety=0.2)
        run = solver.start()
        solver.advance(run, [0.5, 1.0])
        assert run.ledger.drifts[0] < 1e-12
        places.append(run.x[1])
    np.testing.assert_allclose(*places, rtol=0, atol=1e-9)  # steps differ by the bound of the body's node: none here


def thrown(drive):
    return [
        refweb.PointMass(node=1, mass=MASS),
        refweb.Velocity(node=1, value=np.add(drive, (0.0, FAST, 0.0))),
        refweb.Reel(lines="all", factor=IN, mass="follows"),
    ]


def whirl(**changes):
    given = {
        "web": {"kind": "inline", "points": [[0, 0, 0], [0.5, 0, 0], [1, 0, 0]], "lines": [[0, 1], [1, 2]]},
        "cable": {"law": "tension-only", "modulus": 1e7, "area": 1e-4, "density": DENSE / 1e-4},
        "supports": {"nodes": [0]},
        "point_mass": [{"node": 2, "mass": MASS}],
        "gravity": {"acceleration": [0.0, 0.0, -1.0]},
        "velocity": [{"node": [1], "value": [0.0, 1.5, 0.0]}, {"node": [2], "value": [0.0, 3.0, 0.0]}],
        "reel": [{"lines": "all", "factor": OUT_AND_IN, "mass": "follows"}],
        "solve": {"kind": "dynamic", "duration": 1.0},
        "output": {"interval": 0.05},
        "observe": [
            {"name": "far", "quantity": "position", "node": 2, "component": "y"},
            {"name": "pull", "quantity": "tension", "line": 0, "average": 0.3, "reduce": "max"},
            {"name": "done", "quantity": "work"},
        ],
    }
    given["web"]["supports"] = []
    return given | changes


@pytest.mark.slow
def test_methods_agree():
    """Within the sum of their ±, which are small."""
    found = []
    for solve in ({"safety": 0.2}, {"method": "cvode", "rtol": 1e-5}):
        found.append(refweb.run(refweb.Scene.from_dict(whirl(solve={"kind": "dynamic", "duration": 0.5, **solve}))))
        assert not found[-1].warnings
    for name, one in found[0].results.items():
        other = found[1].results[name]
        assert abs(one.value - other.value) <= one.error + other.error < 0.05 * abs(one.value), name


def test_it_is_resumed_bit_for_bit_and_its_frames_have_the_mass_of_their_time(tmp_path):
    scene = refweb.Scene.from_dict(whirl(output={"interval": 0.05, "frames": 2}, accuracy={"error": "none"}))
    whole, resumed = nets.whole_and_resumed(scene, tmp_path)
    for name, values in whole.history.items():
        np.testing.assert_array_equal(resumed.history[name], values)
    assert whole.state.system.at(1.0).net.mass.sum() == pytest.approx(MASS + 1.1 * DENSE, rel=1e-14)


def paid_out(**tables):
    """A line of 1 m and 1 kg/m that hangs, or stands out in axes that turn, and is 3 m long in the equilibrium."""
    points = [[0.5, 0, 0], [1.5, 0, 0]] if "frame" in tables else [[0, 0, 0], [0, 0, -1.0]]
    given = {
        "web": {"kind": "inline", "points": points, "lines": [[0, 1]], "supports": [0]},
        "cable": {"law": "tension-only", "modulus": 1e8, "area": 1e-4, "density": 1e4},
        "reel": [{"lines": [0], "mass": "follows", "factor": [[0.0, 1.0], [2.0, 3.0]]}],
        "solve": {"kind": "static", "load_steps": [2.0]},
        "observe": [{"name": "pull", "quantity": "tension"}],
        **tables,
    }
    return refweb.Scene.from_dict(given)


def test_frequencies_are_those_of_the_mass_there_is():
    """√(k/m) of 1.5 kg on 1e4/3 N/m, and pendulums √(g/l); in axes that turn by Ω along z a pendulum of l that hangs
    out from a support at a has Ω √((a + l)/l) along the axis."""
    length = 3.0 * (1.0 + 15.0 / 1e4)
    hanging = refweb.modes(paid_out(gravity={"acceleration": [0, 0, -10.0]}), progress=False)
    expected = np.sqrt([10.0 / length, 10.0 / length, 1e4 / 3.0 / 1.5]) / (2.0 * np.pi)
    np.testing.assert_allclose(hanging.table["frequency"], expected, rtol=1e-9)
    turning = refweb.modes(paid_out(frame={"angular_velocity": [0, 0, 3.0]}), progress=False)
    length = brentq(lambda long: 1e4 * (long / 3.0 - 1.0) - 1.5 * 9.0 * (0.5 + long), 3.0, 3.1)
    along = 3.0 * np.sqrt((0.5 + length) / length) / (2.0 * np.pi)
    np.testing.assert_allclose(turning.table["frequency"][1], along, rtol=1e-9)
    with pytest.raises(InputError, match="a gradient of frequency_3 takes masses that stay"):
        hanging.gradient("frequency_3", "cable.density")


RATES = [("cable.density", 1.5e-3), ("cable.area", 1.5e5), ("cable.prestrain", -15.0)]


@pytest.mark.parametrize("path, expected", RATES)
def test_gradients_at_rest_are_by_the_mass_there_is(path, expected):
    """The pull is 1.5 ρ A g l of what has been paid out, which a prestrain shortens."""
    solution = refweb.run(paid_out(gravity={"acceleration": [0, 0, -10.0]}))
    gradient = solution.gradient("pull", path)
    assert float(gradient.value[0]) == pytest.approx(expected, rel=1e-8)
    with pytest.raises(InputError, match="by line and group .* is not taken"):
        solution.gradient("pull", "cable.area", by="line")


@pytest.mark.parametrize("quantity", ["potential_energy", "total_energy"])
def test_energies_by_place_are_refused(quantity):
    scene = paid_out(gravity={"acceleration": [0, 0, -10.0]}, observe=[{"name": "it", "quantity": quantity}])
    with pytest.raises(InputError, match=f'quantity = "{quantity}" takes masses that stay'):
        refweb.run(scene)


@pytest.mark.parametrize("rupture", [{"at": [[0, 1.0]]}, {"strength": 1e9}])
def test_lines_that_may_break_are_refused(rupture):
    with pytest.raises(InputError, match='line 0 is broken or may break, .* Give mass = "stays"'):
        paid_out(solve={"kind": "dynamic", "duration": 1.0}, rupture=rupture).build()


def test_shipped_tether():
    """Angular momentum about the drum by the places and masses of the end; damping along the line has no moment."""
    solution = refweb.run(refweb.Scene.load("reeled-tether").replace(accuracy=refweb.Accuracy(error="none")))
    system, turning = solution.state.system, []
    for t, x, v in ((0.0, 0.0, system.initial_velocity()), (60.0, solution.state.x, solution.state.v)):
        places = system.net.points + x
        turning.append((system.material_flow.masses(t)[:, None] * np.cross(places, v)).sum(axis=0)[2])
    assert turning[1] == pytest.approx(turning[0], rel=1e-8)  # of order 2 in steps
    lumped = 0.03 * np.array([0.2, 0.4, 0.6, 0.8, 1.0]) ** 2 @ [1.0, 1.0, 1.0, 1.0, 0.5]
    moments = [length**2 * (2.0 + length / 100.0 * lumped) for length in (100.0, 80.0)]
    speed = 0.05 * moments[0] / moments[1] * 80.0
    assert solution.results["across"].value == pytest.approx(speed, rel=4e-3)  # strains of 1.8e-3, squared


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"reel": [{"lines": "all", "factor": IN, "drum": 0}]}, r"\[\[reel\]\] 1 drum has no meaning where mass"),
        ({"reel": [{"lines": "all", "factor": IN, "mass": "follow"}]}, 'did you mean "follows"'),
        ({"supports": {"nodes": []}}, r"\[\[reel\]\] mass = \"follows\": no node of line 0 .* drum = "),
        ({"supports": {"nodes": [0, 2]}}, r"2 nodes \(0, 2\) of line 0"),
        ({"reel": [{"lines": 0, "factor": IN, "mass": "follows", "drum": 2}]}, "drum = 2 is no end"),
        ({"reel": 2 * [{"lines": 0, "factor": IN, "mass": "follows"}]}, r"\[\[reel\]\] 2 line 0 has a reel"),
        ({"solve": {"kind": "dynamic", "duration": 1.0, "method": "cvode", "mass": "consistent"}}, '"lumped"'),
        ({"solve": {"kind": "dynamic", "duration": 1.0, "method": "explicit"}}, r"takes no .*\[\[reel\]\]|takes no"),
        ({"damping": {"rate": 1.0}}, r"\[damping\] rate = 1 takes masses that stay"),
        (
            {"observe": [{"name": "h", "quantity": "total_angular_momentum"}]},
            'quantity = "total_angular_momentum" takes masses that stay',
        ),
    ],
)
def test_refusals(changes, message):
    given = {key: value for key, value in whirl(**changes).items() if value is not None}
    with pytest.raises(InputError, match=message):
        refweb.run(refweb.Scene.from_dict(given))
