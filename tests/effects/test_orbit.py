"""An orbit: the motion of free masses, dumbbells, what is conserved and what is neglected."""

import numpy as np
import pytest

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.cvode import Cvode
from refweb.dynamics.integrators.ida import Ida
from refweb.effects.elasticity import Elasticity
from refweb.effects.orbit import EARTH, GRAVITATION
from refweb.net import discretisation
from refweb.net.web import Web
from refweb.results.units import other_errors
from refweb.system.system import System

N = 1.1e-3
"""Mean motion [rad/s]."""
MASS, HALF = 10.0, 50.0
"""Of a dumbbell: mass of each end [kg], and half of its length [m]."""
ROUND = 2.0 * np.pi / N
"""Period [s]."""


def slope(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def transition(t):
    """The matrix from position and velocity at the start to those at a time; W. H. Clohessy, R. S. Wiltshire, 1960."""
    s, c, a = np.sin(N * t), np.cos(N * t), N * t
    of_place = [[4 - 3 * c, 0, 0], [6 * (s - a), 1, 0], [0, 0, c]]
    of_speed = [[s / N, 2 * (1 - c) / N, 0], [-2 * (1 - c) / N, (4 * s - 3 * a) / N, 0], [0, 0, s / N]]
    place_to_speed = [[3 * N * s, 0, 0], [-6 * N * (1 - c), 0, 0], [0, 0, -N * s]]
    speed_to_speed = [[c, 2 * s, 0], [-2 * s, 4 * c - 3, 0], [0, 0, c]]
    return np.block([[np.array(of_place), np.array(of_speed)], [np.array(place_to_speed), np.array(speed_to_speed)]])


def free_masses(places, **orbit):
    """Masses at places near each other that lines far too long do not hold: a system."""
    count = len(places)
    web = Web(places, [[i, i + 1] for i in range(count - 1)], natural_length=np.full(count - 1, 1e5))
    net = discretisation.build(web, refweb.Cable(law="tension-only", modulus=1.0, area=1e-4, density=0.0))
    effects = [Elasticity(), refweb.PointMass(node="all", mass=2.0), refweb.Orbit(mean_motion=N, **orbit)]
    return System(net, effects, np.zeros((count, 3), dtype=bool))


def at_time(system, end, solver, v, **options):
    method = solver(system, **options)
    run = method.start(None, v)
    method.advance(run, np.linspace(0.0, end, 5)[1:])
    return run.x, run.v, run


def unit_states():
    """A system of six masses that begin with one component of place or, N times it, of velocity each; and those."""
    places = np.vstack([np.eye(3), np.zeros((3, 3))])
    v = np.vstack([np.zeros((3, 3)), N * np.eye(3)])
    return free_masses(places + 1e-12 * np.arange(6)[:, None]), v


def errors_of_transition(solver, end, **options):
    """Largest errors of the columns of the matrix over its largest numbers, velocities in units of N."""
    system, v = unit_states()
    x, speeds, run = at_time(system, end, solver, v, **options)
    found = np.hstack([system.net.points + x, speeds / N]).T
    scale = np.diag([1.0] * 3 + [N] * 3)
    exact = np.linalg.inv(scale) @ transition(end) @ scale
    return np.abs(found - exact).max() / np.abs(exact).max(), run


def test_transition_matrix():
    """After a whole orbit and a third, by Adams methods at a tolerance of 1e-13."""
    error, run = errors_of_transition(Cvode, 4.0 / 3.0 * ROUND, family="adams", rtol=1e-13)
    assert error < 1e-10 and run.drift < 1e-10


@pytest.mark.parametrize("solver, options", [(Cvode, {}), (Ida, {})])
def test_transition_matrix_by_other_steps(solver, options):
    """BDF at 1e-6: a thousand of that at most, mostly of one sign."""
    error, _ = errors_of_transition(solver, 0.5 * ROUND, rtol=1e-6, **options)
    assert error < 1e-3


def test_transition_matrix_of_order_two():
    counts, errors = np.array([64, 128, 256, 512]), []
    for count in counts:
        step = 0.75 * ROUND / count * (1.0 + 1e-12)
        errors.append(errors_of_transition(CentralDifference, 0.75 * ROUND, step_size=step)[0])
    assert abs(slope(errors, 1.0 / counts) - 2.0) < 0.1


def test_ellipse_of_two_to_one():
    """From (a, 0) at −2na along the track a mass goes round an ellipse, twice as long along the track."""
    system = free_masses([[100.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    v = np.array([[0.0, -2.0 * N * 100.0, 0.0], [0.0] * 3])
    method = Cvode(system, family="adams", rtol=1e-11)
    run = method.start(None, v)
    for turn in np.linspace(0.0, 1.0, 9)[1:]:
        method.advance(run, [turn * ROUND])
        place = system.net.points + run.x
        angle = 2.0 * np.pi * turn
        # Errors of 1e-11 in some hundred steps of 200 m.
        np.testing.assert_allclose(place[0], [100 * np.cos(angle), -200 * np.sin(angle), 0.0], rtol=0, atol=1e-6)
        assert not place[1].any()


def test_ellipse_about_other_axes():
    """Away from the Earth along (0, 0.6, 0.8), along the track along −x: the ellipse stands there."""
    away, along = np.array([0.0, 0.6, 0.8]), np.array([-1.0, 0.0, 0.0])
    system = free_masses([(100.0 * away).tolist(), [0.0, 0.0, 0.0]], axes=(tuple(away), tuple(2.0 * along)))
    method = Cvode(system, family="adams", rtol=1e-11)
    run = method.start(None, np.array([-2.0 * N * 100.0 * along, [0.0] * 3]))
    method.advance(run, [0.3 * ROUND])
    angle = 0.6 * np.pi
    expected = 100.0 * np.cos(angle) * away - 200.0 * np.sin(angle) * along
    # Errors of 1e-11 in some hundred steps of 200 m.
    np.testing.assert_allclose((system.net.points + run.x)[0], expected, rtol=0, atol=1e-6)


def dumbbell(direction, law="linear", modulus=1e6, effects=(), **parts):
    """Two masses at ± `HALF` along a direction, held by a line of 100 N of EA or more; nothing supports them."""
    place = HALF * np.array(direction, dtype=float)
    return refweb.Scene(
        web=refweb.Inline(points=[(-place).tolist(), place.tolist()], lines=[[0, 1]]),
        cable=refweb.Cable(law=law, modulus=modulus, area=1e-4, density=0.0),
        effects=[refweb.PointMass(node="all", mass=MASS), refweb.Orbit(mean_motion=N), *effects],
        supports=refweb.Supports(nodes=[]),
        **parts,
    )


STRAIN = 3.0 * N**2 * MASS * HALF / 100.0
"""Of a dumbbell of 100 N that hangs."""


@pytest.mark.parametrize("law", ["linear", "tension-only"])
def test_tension_of_a_dumbbell_that_hangs(law):
    """3 n² m r at the stretched r: T = T₀/(1 − T₀/EA)."""
    solution = refweb.run(dumbbell([1, 0, 0], law))
    tension = 3.0 * N**2 * MASS * HALF
    np.testing.assert_allclose(solution.tension, tension / (1.0 - STRAIN), rtol=1e-9)
    held = dumbbell([1, 0, 0], law, effects=[refweb.Load(node=0, force=(0.0, 0.0, 0.0))])
    assert refweb.run(held).results["max_tension"].value == solution.results["max_tension"].value


@pytest.mark.parametrize("method", ["central-difference", "cvode", "ida"])
def test_tension_in_dynamics(method):
    """It keeps what it has in equilibrium."""
    parts = dict(solve=refweb.Dynamic(method=method, duration=0.1 * ROUND, start="equilibrium"))
    solution = refweb.run(dumbbell([1, 0, 0], modulus=1e4, output=refweb.Output(interval=0.02 * ROUND), **parts))
    tension = 3.0 * N**2 * MASS * HALF / (1.0 - 100.0 * STRAIN)
    largest, last = solution.results["max_tension"].value, solution.state.element_tension[0]
    np.testing.assert_allclose([largest, last], tension, rtol=1e-6)


@pytest.mark.parametrize("direction, tension", [([0, 1, 0], 0.0), ([0, 0, 1], -(N**2) * MASS * HALF)])
def test_other_dumbbells_are_unstable(direction, tension):
    """Along the track nothing pulls; across it ends are pressed together. Both leave by themselves."""
    scene = dumbbell(direction)
    solution = refweb.run(scene)
    np.testing.assert_allclose(solution.tension, tension / (1.0 - tension / 100.0), rtol=1e-9, atol=1e-12)
    assert refweb.modes(scene, 6).spectra[-1].unstable > 0


def librations(modulus):
    """ω²/n² of a dumbbell that hangs."""
    return refweb.modes(dumbbell([1, 0, 0], modulus=modulus), 5).spectra[-1].squared / N**2


def test_librations_of_a_dumbbell_that_hangs():
    """√3 n in the plane of the orbit and 2 n across it, and its centre goes round with n, in two ways.

    Coriolis forces and the line couple: ω² = 3 n² (1 − 4 n²/ω_l²) to first order in the square of the orbit's over the
    line's frequency, ω_l² = 2 EA/(m L) = EA/(m r), of the stiff rod.
    """
    soft, stiff = librations(1e6), librations(1e8)
    for found, share in ((soft, N**2 * MASS * HALF / 100.0), (stiff, N**2 * MASS * HALF / 1e4)):
        np.testing.assert_allclose(found[:2], 1.0, rtol=1e-6)
        np.testing.assert_allclose(found[2:4], [3.0, 4.0], rtol=5.0 * share + 1e-6)
    np.testing.assert_allclose((3.0 - soft[2]) / (3.0 * N**2 * MASS * HALF / 100.0), 4.0, rtol=0.02)


@pytest.mark.ordinary("central-difference-0.001")
@pytest.mark.parametrize("method, drift", [("central-difference", 1e-3), ("cvode", 1e-5)])
def test_jacobi_integral_over_ten_orbits(method, drift):
    """Of a dumbbell that swings in and across the plane: kinetic, strain and orbit energy keep their sum."""
    thrown = refweb.Velocity(node=1, value=(0.0, 0.2 * N * HALF, 0.1 * N * HALF))
    own = dict(rtol=1e-8, family="adams") if method == "cvode" else dict(safety=0.05)
    solution = refweb.run(
        dumbbell(
            [1, 0, 0],
            modulus=1e3,
            effects=[thrown],
            solve=refweb.Dynamic(method=method, duration=10.0 * ROUND, **own),
            output=refweb.Output(interval=0.1 * ROUND),
            accuracy=refweb.Accuracy(error="none"),
        )
    )
    total, kinetic = solution.history["total_energy"], solution.history["kinetic_energy"]
    stored = solution.history["strain_energy"] + solution.history["orbit_energy"]
    np.testing.assert_allclose(kinetic + stored, total, rtol=0, atol=1e-12 * kinetic.max())
    assert np.abs(total - total[0]).max() < drift * kinetic.max()
    assert np.ptp(solution.history["orbit_energy"]) > 0.1 * kinetic.max()


def test_what_is_neglected():
    """Largest distance over radius times the value, in statics and in dynamics; in words and in run.json."""
    solution = refweb.run(dumbbell([1, 0, 0]))
    radius = (GRAVITATION / N**2) ** (1.0 / 3.0)
    here = solution.results["max_tension"]
    np.testing.assert_allclose(here.neglected, here.value * np.abs(solution.positions).max() / radius, rtol=1e-12)
    (words,) = other_errors(solution.summary()["results"])
    assert words.startswith("orbit neglects deflection by 6.57") and words.endswith("nN")
    throw = refweb.Velocity(node="all", value=(1.0, 0.0, 0.0))
    scene = dumbbell([1, 0, 0], effects=[throw], solve=refweb.Dynamic(method="cvode", duration=0.5))
    here = refweb.run(scene).results["deflection"]
    np.testing.assert_allclose(here.neglected, here.value * (HALF + here.value) / radius, rtol=1e-4)


def test_next_order_is_the_share_that_is_named():
    """Against gravity itself: the tidal acceleration x from the origin differs from 3n²x by about x/R of itself."""
    orbit = refweb.Orbit(altitude=4e5)
    radius = EARTH + 4e5
    n2 = GRAVITATION / radius**3
    for away in (1e3, 1e4, 1e5):
        exact = -GRAVITATION / (radius + away) ** 2 + GRAVITATION / radius**2 + n2 * away
        share = abs(exact / (3.0 * n2 * away) - 1.0)
        assert 0.9 * away / orbit.radius < share < 1.1 * away / orbit.radius


def test_altitude_and_mean_motion():
    """Of an orbit 400 km up, whose period is 92.56 minutes; radius and mean motion belong together."""
    n = np.sqrt(GRAVITATION / (EARTH + 4e5) ** 3)
    assert abs(2.0 * np.pi / n / 60.0 - 92.56) < 0.01
    assert abs(refweb.Orbit(mean_motion=n).radius / (EARTH + 4e5) - 1.0) < 1e-14
    system = free_masses([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    (place, _) = refweb.Orbit(altitude=4e5).on(system.net)
    np.testing.assert_allclose(place.data[0, 0], 3.0 * n * n, rtol=1e-14)


@pytest.mark.parametrize(
    "effects, message",
    [
        (
            [refweb.Gravity(acceleration=(0.0, 0.0, -9.81))],
            r"\[orbit\] has what \[gravity\] would bring: leave out one",
        ),
        ([refweb.Frame(angular_velocity=(0.0, 0.0, 1.0))], r"\[orbit\] has what \[frame\] would bring"),
        ([refweb.Orbit(mean_motion=N)], r"\[orbit\] is listed 2 times"),
    ],
)
def test_what_does_not_go_together(effects, message):
    with pytest.raises(refweb.InputError, match=message):
        dumbbell([1, 0, 0], effects=effects).build()


@pytest.mark.parametrize(
    "given, message",
    [
        ({"mean_motion": 1e-3, "axes": [[1, 0, 0]]}, "must be two vectors, not 1"),
        ({"mean_motion": 1e-3, "axes": [[1, 0, 0], [1, 1, 0]]}, "must be at right angles"),
        ({}, r"give mean_motion \[rad/s\] or altitude \[m\]: none is"),
        ({"mean_motion": N, "altitude": 4e5}, "both are given"),
        ({"mean_motion": 0.0}, r"mean_motion = 0(.0)? must be > 0 \[rad/s\]"),
        ({"mean_motoin": N}, 'did you mean "mean_motion"'),
    ],
)
def test_bad_orbits(given, message):
    with pytest.raises(refweb.InputError, match=message):
        refweb.Orbit(**given)


def test_statics_refuses_what_is_carried_off_and_what_nothing_holds():
    with pytest.raises(refweb.SolverError, match=r"carried off along x .* on the track of \[orbit\]"):
        scene = dumbbell([1, 0, 0])
        refweb.run(scene.replace(web=refweb.Inline(points=[[1, 0, 0], [9, 0, 0]], lines=[[0, 1]])))
    fast = [refweb.PointMass(node="all", mass=MASS), refweb.Orbit(mean_motion=1.0)]
    with pytest.raises(refweb.SolverError, match=r"\[orbit\] turns at 1 rad/s, must be below .* lower mean_motion"):
        refweb.run(dumbbell([1, 0, 0]).replace(effects=fast))


def test_energy_of_the_orbit_is_observed():
    """−½ m n² (3x² − z²), from that of the web's position; refused without an orbit."""
    energy = refweb.Observe(name="place", quantity="orbit_energy")
    solution = refweb.run(dumbbell([1, 0, 0], observe=[energy]))
    moved = (solution.positions[:, 0] ** 2).sum() - 2.0 * HALF**2
    np.testing.assert_allclose(solution.results["place"].value, -1.5 * MASS * N**2 * moved, rtol=1e-6)
    with pytest.raises(refweb.InputError, match=r'quantity = "orbit_energy" needs \[orbit\]'):
        scene = dumbbell([1, 0, 0], observe=[energy])
        scene.replace(effects=scene.effects[:1]).build()
