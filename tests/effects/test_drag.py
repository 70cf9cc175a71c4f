"""Drag: closed forms of bodies and lines, what is lost, what steps do not feel, and what is refused."""

import nets
import numpy as np
import pytest
import scipy.optimize

import refweb
from refweb.kernels import CONTACT, PART
from refweb.net.web import Web

AIR, WATER = 1.2, 1000.0
RADIUS, MASS = 0.1, 0.5
BALL = dict(name="ball", radius=RADIUS, mass=MASS, position=(0.0, 0.0, 5.0))
OWN = 0.5 * WATER * 0.47 * np.pi * RADIUS**2
"""½ ρ C A of the ball in water [kg/m]."""


def slope(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def swimming(effects, **solve):
    """A ball in water far from a line that is held."""
    return refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=1),
        cable=refweb.Cable(law="linear", modulus=7e7, area=1e-4, density=200.0),
        effects=[refweb.Body(**BALL), *effects],
        solve=refweb.Dynamic(**solve),
        output=refweb.Output(interval=solve["duration"] / 4.0),
        observe=[
            refweb.Observe(name="speed", quantity="velocity", body="ball", component="z"),
            refweb.Observe(name="height", quantity="position", body="ball", component="z"),
        ],
        accuracy=refweb.Accuracy(error="none"),
    )


def fallen(t, g=9.81):
    """(velocity, height) of the ball, from rest: −v_∞ tanh(gt/v_∞), with v_∞² = mg/(½ρCA)."""
    end = np.sqrt(MASS * g / OWN)
    return -end * np.tanh(g * t / end), 5.0 - end**2 / g * np.log(np.cosh(g * t / end))


def coasted(t, v):
    """(velocity, height) of a ball thrown at v: v/(1 + vt/l) and l ln(1 + vt/l), with the length l = m/(½ρCA)."""
    length = MASS / OWN
    return v / (1.0 + v * t / length), 5.0 + length * np.log1p(v * t / length)


CASES = {
    "falls": (lambda: [refweb.Gravity(acceleration=(0.0, 0.0, -9.81)), refweb.Drag(density=WATER)], fallen, 0.3),
    "coasts": (lambda: [refweb.Drag(density=WATER)], lambda t: coasted(t, 3.0), 0.3),
}


def ball_of(case, **solve):
    effects, exact, end = CASES[case]
    scene = swimming(effects(), duration=end, **solve)
    if case == "coasts":
        ball = refweb.Body(**BALL, velocity=(0.0, 0.0, 3.0))
        scene = scene.replace(effects=[ball, *scene.effects[1:]])
    results = refweb.run(scene).results
    return np.abs(np.array([results["speed"].value, results["height"].value]) - exact(end)), exact(end)


@pytest.mark.parametrize("case", CASES)
def test_ball_of_order_two(case):
    """Speed to its terminal velocity, and the way until it has lost nine tenths; both of order 2."""
    counts, errors = np.array([100, 200, 400, 800]), []
    for count in counts:
        error, exact = ball_of(case, step_size=CASES[case][2] / count * (1.0 + 1e-12))
        errors.append(error)
    for error in np.array(errors).T:
        assert abs(slope(error, 1.0 / counts) - 2.0) < 0.1
    assert errors[-1][1] < 1e-4


@pytest.mark.ordinary("falls-cvode-*", "coasts-ida-*")
@pytest.mark.parametrize("method, rtol", [("cvode", 1e-8), ("ida", 1e-7)])
@pytest.mark.parametrize("case", CASES)
def test_ball_by_other_methods(case, method, rtol):
    """A thousand steps of errors of one sign at most."""
    error, exact = ball_of(case, method=method, rtol=rtol)
    assert (error <= 1e3 * rtol * np.abs(exact)).all()


def test_stopping_distance():
    """A thrown ball is down to half of its speed after l ln 2, whatever the speed."""
    length = MASS / OWN
    for v in (0.5, 5.0):
        scene = swimming([refweb.Drag(density=WATER)], duration=length / v, safety=0.2)
        scene = scene.replace(effects=[refweb.Body(**BALL, velocity=(0.0, 0.0, v)), *scene.effects[1:]])
        results = refweb.run(scene).results
        np.testing.assert_allclose(results["speed"].value, 0.5 * v, rtol=1e-4)
        np.testing.assert_allclose(results["height"].value - 5.0, length * np.log(2.0), rtol=1e-4)


@pytest.mark.parametrize("keys", [{"step_size": 3e-4}, {"method": "cvode"}, {"method": "ida"}])
def test_wind_does_work(keys):
    """A ball at rest is carried along: ½ m v², v = u² t/(l + u t), is booked as work, and nothing as dissipated."""
    wind, end = 4.0, 0.3
    solution = refweb.run(swimming([refweb.Drag(density=WATER, wind=(0.0, 0.0, wind))], duration=end, **keys))
    length = MASS / OWN
    speed = wind**2 * end / (length + wind * end)
    work, kinetic = solution.history["work"][-1], solution.history["kinetic_energy"][-1]
    np.testing.assert_allclose(solution.results["speed"].value, speed, rtol=1e-3)  # of order 2: 1000 steps
    np.testing.assert_allclose(work, kinetic, rtol=1e-3)
    assert "dissipated_energy" not in solution.history and solution.solver["energy_drift"] < 1e-3


def test_contacts_that_share_a_row_have_no_parts():
    """Whatever stood in the memory of a contact before: only the first of a group has a part, the others have none."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0]).web()
    system = nets.system(
        web, refweb.Cable(law="linear", modulus=1e6, area=1e-6, density=1e3), [refweb.Drag(density=WATER)]
    )
    term = next(term for term in system.terms if term.name == "drag")
    contacts, parts = np.zeros(4, CONTACT), np.zeros(4, PART)
    contacts["count"], contacts["first"] = 10**6, np.arange(4)
    assert (
        term.velocity.implicit.detect(np.zeros((3, 3)), term.cells, term.data, np.empty((0, 0)), contacts, parts, 0)
        == 4
    )
    assert contacts["group"].tolist() == [1, 2, 0, 1] and contacts["count"].tolist() == [1, 1, 0, 1]


def test_steps_are_not_limited_by_drag():
    """A light ball falls at its terminal velocity, in steps four times as long as explicit drag would take."""
    drag, step = refweb.Drag(density=WATER), 5e-4
    effects = [
        refweb.Body(**{**BALL, "mass": 1e-6}),
        refweb.Gravity(acceleration=(0.0, 0.0, -9.81)),
        drag,
    ]
    solution = refweb.run(swimming([], duration=0.2, step_size=step).replace(effects=effects))
    end = np.sqrt(1e-6 * 9.81 / OWN)
    assert step * 2.0 * OWN * end / 1e-6 > 4.0 * 2.0
    np.testing.assert_allclose(solution.results["speed"].value, -end, rtol=1e-9)
    assert solution.solver["nsteps"] <= 404
    dry = swimming([refweb.Gravity(acceleration=(0.0, 0.0, -9.81))], duration=1.0).build()
    (_, body) = drag.on(dry.net)
    assert body.tangent.bound is None and body.velocity.bound is None


def uniform(direction, velocity, **keys):
    """Force on each node of a line of 2 m along a direction, which moves at a velocity; its diameter is 0.02 m."""
    web = Web(np.array([np.zeros(3), 2.0 * np.array(direction, dtype=float)]), [[0, 1]])
    cable = refweb.Cable(law="linear", modulus=1e6, area=np.pi * 1e-4, density=1000.0)
    system = nets.system(web, cable, [refweb.Drag(density=AIR, **keys)])
    return system.force(0.0, np.zeros((2, 3)), np.tile(velocity, (2, 1)))


@pytest.mark.parametrize("degrees", [0.0, 10.0, 30.0, 60.0, 90.0, 150.0])
def test_line_at_an_angle_of_attack(degrees):
    """Normal and tangential part by themselves, half of each at either end; the diameter is that of the area."""
    angle, speed = np.radians(degrees), 7.0
    velocity = speed * np.array([np.cos(angle), 0.0, np.sin(angle)])
    force = uniform([1.0, 0.0, 0.0], velocity, normal=1.1, tangential=0.03)
    across, along = 0.5 * AIR * 1.1 * 0.02 * 2.0, 0.5 * AIR * np.pi * 0.03 * 0.02 * 2.0
    u = velocity[0], velocity[2]
    whole = [-along * abs(u[0]) * u[0], 0.0, -across * abs(u[1]) * u[1]]
    np.testing.assert_allclose(force.sum(axis=0), whole, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(force[0], force[1], rtol=1e-13, atol=1e-15)


def test_wind_is_the_other_velocity():
    """What counts is the velocity relative to the fluid; a diameter of its own counts in proportion."""
    one = uniform([0.6, 0.8, 0.0], [1.0, -2.0, 3.0])
    other = uniform([0.6, 0.8, 0.0], [5.0, 0.0, 4.0], wind=(4.0, 2.0, 1.0))
    np.testing.assert_allclose(other, one, rtol=1e-13)
    np.testing.assert_allclose(uniform([0.6, 0.8, 0.0], [1.0, -2.0, 3.0], diameter=0.06), 3.0 * one, rtol=1e-13)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_drag_of_curved_elements(order):
    """In a uniform motion all orders have the same whole force."""
    system = refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(0, 3, 0), elements=2),
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=1000.0, order=order),
        effects=[refweb.Drag(density=AIR, diameter=0.01, tangential=0.0)],
        solve=refweb.Dynamic(duration=1.0, method="cvode"),
    ).build()
    force = system.force(0.0, np.zeros((system.rows, 3)), np.tile([2.0, 0.0, 0.0], (system.rows, 1)))
    np.testing.assert_allclose(force.sum(axis=0), [-0.5 * AIR * 1.2 * 0.01 * 4.0 * 3.0, 0.0, 0.0], rtol=1e-13)


def test_dissipation_is_never_negative():
    """Of random states, F·u ≤ 0 by cell; of a thrown web, what is lost grows in every row."""
    web, cable = nets.skew_web(), nets.skew_cable("tension-only")
    for seed in range(20):
        rng = np.random.default_rng(seed)
        drag = refweb.Drag(density=AIR, normal=rng.random(), tangential=rng.random())
        system = nets.system(web, cable, [drag])
        x, v = 0.3 * rng.standard_normal((2, system.rows, 3))
        assert system.forces(0.0, x, v)[1][-1].max() <= 0.0
    thrown = dict(effects=[refweb.Drag(density=WATER), refweb.Velocity(node="all", value=(0.5, 0.2, 2.0))])
    for method in ("central-difference", "cvode", "ida"):
        solution = refweb.run(
            refweb.Scene(
                web=refweb.Window(mesh="square", rows=3, columns=3, side=0.5),
                cable=refweb.Cable(law="smooth", smoothing=1e-3, modulus=1e6, area=1e-4, density=200.0),
                solve=refweb.Dynamic(duration=0.05, method=method),
                output=refweb.Output(interval=5e-3),
                accuracy=refweb.Accuracy(error="none"),
                **thrown,
            )
        )
        lost, total = solution.history["dissipated_energy"], solution.history["total_energy"]
        assert (np.diff(lost) > 0.0).all()
        assert np.abs(total + lost - total[0]).max() < 1e-2 * total[0]


def test_momentum_book_closes():
    """What drag takes is what momentum loses, to rounding: the kick has the force at the velocity in its middle."""
    scene = swimming([refweb.Drag(density=WATER, wind=(1.0, 0.0, 0.5))], duration=0.2)
    solution = refweb.run(scene)
    assert solution.solver["momentum_drift"] < 1e-12
    assert "work" in solution.history and "dissipated_energy" not in solution.history


@pytest.mark.parametrize("method", ["newton", "relaxation"])
def test_pendulum_in_the_wind(method):
    """A mass on a line, with half of the line's drag: m g sin θ = c_n (w cos θ)² across the line."""
    mass, wind, g = 2.0, 20.0, 9.81
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [0, 0, -1]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=7e7, area=1e-4, density=0.0),
        effects=[
            refweb.PointMass(node=1, mass=mass),
            refweb.Gravity(acceleration=(0.0, 0.0, -g)),
            refweb.Drag(density=AIR, diameter=0.05, wind=(wind, 0.0, 0.0)),
        ],
        solve=refweb.Static(method=method),
    )
    x, _, z = refweb.run(scene).positions[1]
    across = 0.5 * AIR * 1.2 * 0.05 * 0.5
    angle = scipy.optimize.brentq(lambda a: mass * g * np.sin(a) - across * (wind * np.cos(a)) ** 2, 0.0, 1.5)
    np.testing.assert_allclose(np.arctan2(x, -z), angle, rtol=1e-8)


def test_statics_leaves_out_a_fluid_at_rest():
    scene = refweb.Scene.load("catenary")
    still = scene.replace(effects=[*scene.effects, refweb.Drag(density=WATER)])
    for name, one in refweb.run(still).results.items():
        assert one.value == refweb.run(scene).results[name].value


@pytest.mark.parametrize(
    "keys, message",
    [
        (dict(bodies=dict(bal=dict(area=1.0))), r'\[drag\] bodies."bal" is not a free body, did you mean "ball"'),
        (dict(density=0.0), r"density = 0.0 must be > 0 \[kg/m³\]"),
        (dict(normal=-1.0), "normal = -1.0 must be ≥ 0"),
        (dict(bodies=dict(ball=dict(area=0.0))), "area = 0.0 must be > 0"),
    ],
)
def test_what_is_refused(keys, message):
    with pytest.raises(refweb.InputError, match=message):
        swimming([refweb.Drag(**{"density": WATER, **keys})], duration=1.0).build()


def test_other_shapes_need_coefficient_and_area():
    hoop = refweb.Body(name="hoop", shape="ring", radius=0.1, normal=(0, 0, 1), mass=1.0, position=(0, 0, 5))
    scene = swimming([], duration=1.0).replace(observe=[])
    for own, missing in (({}, "coefficient"), ({"coefficient": 1.1}, "area")):
        drag = refweb.Drag(density=WATER, bodies={"hoop": own})
        with pytest.raises(refweb.InputError, match=f'bodies."hoop".{missing} is missing: only of spheres'):
            scene.replace(effects=[hoop, drag]).build()
    drag = refweb.Drag(density=WATER, bodies={"hoop": dict(coefficient=1.1, area=0.2)})
    system = scene.replace(effects=[hoop, drag]).build()
    v = np.zeros((system.rows, 3))
    v[2] = [0.0, 3.0, 4.0]
    np.testing.assert_allclose(system.force(0.0, 0.0 * v, v)[2], -0.5 * WATER * 1.1 * 0.2 * 5.0 * v[2], rtol=1e-14)
