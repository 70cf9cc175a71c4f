"""Bodies against bodies: forces from energies, momenta, tangents, bounds, hits, rolling, sliding, what passes."""

import itertools
import re
from dataclasses import replace
from types import SimpleNamespace

import meshio
import nets
import numpy as np
import pytest
import solids
from scipy.optimize import minimize

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.crossings import PAIRS as MET
from refweb.dynamics.integrators.crossings import none_met
from refweb.dynamics.integrators.passages import Passages, Position
from refweb.net import discretisation
from refweb.net.rotation import quaternion_rate
from refweb.net.skeleton import rim
from refweb.system.system import System

G = 9.81
SHAPES = {
    "sphere": dict(shape="sphere", radius=0.3, inertia=(0.04, 0.05, 0.06)),
    "capsule": dict(shape="capsule", radius=0.2, length=0.4, axis=(0, 0, 1)),
    "box": dict(shape="box", size=(0.6, 0.5, 0.7), rounding=0.05),
    "cylinder": dict(shape="cylinder", radius=0.3, length=0.8, axis=(0, 0, 1), rounding=0.05),
}
PAIRS = list(itertools.combinations_with_replacement(SHAPES, 2))
LAWS = [dict(stiffness=1e3), dict(stiffness=1e3, exponent=1.5)]
LOSSES = dict(stiffness=1e3, damping=0.3, friction=0.4, slip_velocity=2.0)
FLOOR = dict(name="floor", shape="box", size=[4, 4, 0.4], position=[0, 0, -0.2], fixed=True)
FAR = refweb.SingleCable(start=(0, 0, 100), end=(1, 0, 100), elements=1).web()
CABLE = refweb.Cable(law="linear", modulus=1e3, area=1e-4, density=100.0)


def system(one, other, held=False, more=(), **contact):
    """Two bodies that overlap, and nothing but their contact: each term a system of its own."""
    bodies = [
        refweb.Body(name="a", mass=1.0, position=(0, 0, 0), **SHAPES[one]),
        refweb.Body(name="b", **(dict(fixed=True) if held else dict(mass=2.0)), position=(0.5, 0, 0), **SHAPES[other]),
    ]
    net = discretisation.build(FAR, CABLE)
    whole = System(net, [*bodies, *more, refweb.Contact(between_bodies=True, **contact)], np.zeros((2, 3), dtype=bool))
    own = [term for term in whole.terms if term.contact.pairs or term.cells.shape[1] == 6]
    return [System(whole.net, [SimpleNamespace(on=lambda _, f=f: f)], whole.supported[:2]) for f in own]


def state(net, seed):
    rng = np.random.default_rng(seed)
    x, v = 0.1 * rng.standard_normal(net.points.shape), rng.standard_normal(net.points.shape)
    for body in net.bodies:
        q = rng.standard_normal(4)
        if body.fixed:
            x[body.row] = 0.0
        else:
            x[body.turn] = 0.0
            x[body.turn, 0], x[body.spin] = q[0] - 1.0, q[1:]
    return x, v


def turned(net, x, d):
    """A motion whose rows of rotation are angles, as one of the rows of quaternions."""
    moved = d.copy()
    for body in net.bodies:
        if body.turn is not None:
            rate = quaternion_rate(1.0 + x[body.turn, 0], *x[body.spin], d[body.spin])
            moved[body.turn] = 0.0
            moved[body.turn, 0], moved[body.spin] = rate[0], rate[1:]
    return moved


@pytest.mark.ordinary("pair[13579]-law0", "pair[02468]-law1")
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("pair", PAIRS)
def test_force_is_the_slope_of_an_energy(pair, law):
    """Force and moment on both against a difference quotient of step 1e-5; momenta vanish to rounding."""
    (one,) = system(*pair, **law)
    net, touched = one.net, 0
    rows, spins, turns = ([getattr(b, key) for b in net.bodies] for key in ("row", "spin", "turn"))
    for seed in range(12):
        x, v = state(net, seed)
        f = one.force(0.0, x, v)
        d = 0.1 * np.random.default_rng(seed + 100).standard_normal(x.shape)
        moved, h = turned(net, x, d), 1e-5
        rate = (one.energy(0.0, x + h * moved) - one.energy(0.0, x - h * moved)) / (2.0 * h)
        size = np.abs(f * d).sum()
        assert abs(rate + np.delete(f * d, turns, axis=0).sum()) <= 1e-7 * size  # h² over the rounding squared
        moment = np.cross((net.points + x)[rows], f[rows]).sum(axis=0) + f[spins].sum(axis=0)
        assert np.abs([f[rows].sum(axis=0), moment]).max() <= 1e-15 * 10.0 * np.abs(f).sum()
        touched += f.any()
    assert touched >= 4


def test_axes_that_cross_push_with_the_windows_of_both():
    """k (W + W') δ of two capsules at right angles, W = 4 ξ (1 − ξ) at the share ξ of either axis, but for order δ."""
    turned, k, radius, deep = dict(radius=0.2, length=1.0), 1e3, 0.2, 1e-6
    bodies = [
        refweb.Body(name="a", shape="capsule", axis=(1, 0, 0), position=(0.2, 0, 0), mass=1.0, **turned),
        refweb.Body(
            name="b", shape="capsule", axis=(0, 1, 0), position=(0, 0.3, 2 * radius - deep), mass=1.0, **turned
        ),
    ]
    net = discretisation.build(FAR, CABLE)
    whole = System(net, [*bodies, refweb.Contact(between_bodies=True, stiffness=k)], np.zeros((2, 3), dtype=bool))
    force = whole.force(0.0, np.zeros((whole.rows, 3)))
    windows = [4.0 * (0.5 - off) * (0.5 + off) for off in (0.2, 0.3)]
    assert force[whole.net.bodies[1].row, 2] == pytest.approx(k * sum(windows) * deep, rel=1e-4)


@pytest.mark.ordinary("False-pair3", "True-pair0", "True-pair1", "True-pair2")
@pytest.mark.parametrize("pair", [("sphere", "box"), ("capsule", "cylinder"), ("box", "box"), ("box", "cylinder")])
@pytest.mark.parametrize("held", [False, True])
def test_tangents(pair, held):
    """−∂f/∂x and −∂f/∂v have remainders of order 2, of penalty and of losses, down to the 1e-8 of differences."""
    for one in system(*pair, held, **LOSSES):
        net = one.net
        for seed in range(6):
            x, v = state(net, seed)
            f, d = one.force(0.0, x, v), turned(net, x, 0.1 * np.random.default_rng(seed).standard_normal(x.shape))
            d[one.supported] = 0.0
            tangents = [(one.stiffness(0.0, x, v), d, 0.0 * d)]
            if (damping := one.damping(0.0, x, v)) is not None:
                tangents.append((damping, 0.0 * d, d))
            for values, dx, dv in tangents:
                product = one.pattern.matrix(values) @ d.ravel()[one.free]
                steps = np.array([1e-3, 5e-4, 2.5e-4])
                change = [(one.force(0.0, x + h * dx, v + h * dv) - f).ravel()[one.free] for h in steps]
                remainder = [np.linalg.norm(c + h * product) for h, c in zip(steps, change, strict=True)]
                small = 1e-8 * np.linalg.norm(product) * steps[-1]
                order = np.polyfit(np.log(steps), np.log(np.maximum(remainder, 1e-300)), 1)[0]
                assert remainder[-1] <= small or order > 1.8, (seed, remainder)


@pytest.mark.parametrize("pair", PAIRS)
def test_power_of_losses(pair):
    """It is that of their forces, and takes energy; momenta vanish."""
    one = system(*pair, **LOSSES)[1]
    net = one.net
    for seed in range(6):
        x, v = state(net, seed)
        f, out = one.forces(0.0, x, v)
        rates = v.copy()
        for body in net.bodies:
            rates[body.spin] = body.turning(x, v)
        assert out[0][:, 0].sum() == pytest.approx((f * rates).sum(), rel=1e-11, abs=1e-13 * np.abs(f).sum())
        assert out[0][:, 0].sum() <= 0.0
        rows, spins = ([getattr(b, key) for b in net.bodies] for key in ("row", "spin"))
        moment = np.cross((net.points + x)[rows], f[rows]).sum(axis=0) + f[spins].sum(axis=0)
        assert np.abs([f[rows].sum(axis=0), moment]).max() <= 1e-14 * np.abs(f).sum()


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("held", [False, True])
def test_bound_bounds(pair, held):
    """2/ω of the tangent, with angles for quaternions, is never below the bound on steps."""
    (one,) = system(*pair, held, stiffness=1e3)
    net = one.net
    for seed in range(12):
        x, v = state(net, seed)
        free = [body for body in net.bodies if not body.fixed]
        rows = [r for body in free for r in (body.row, body.spin)]
        inverse = np.zeros((3 * len(rows), 3 * len(rows)))
        for n, body in enumerate(free):
            axes = body.axes @ body.rotation(x).T
            inverse[6 * n : 6 * n + 3, 6 * n : 6 * n + 3] = np.eye(3) / net.mass[body.row]
            inverse[6 * n + 3 : 6 * n + 6, 6 * n + 3 : 6 * n + 6] = axes.T @ np.linalg.inv(body.inertia) @ axes
        h, tangent = 1e-6, np.zeros_like(inverse)
        for j, (row, k) in enumerate(itertools.product(rows, range(3))):
            d = np.zeros_like(x)
            d[row, k] = h
            d = turned(net, x, d)
            tangent[:, j] = (one.force(0.0, x - d, v) - one.force(0.0, x + d, v))[rows].ravel() / (2.0 * h)
        fastest = np.abs(np.linalg.eigvals(inverse @ tangent)).max()
        if fastest == 0.0:
            continue
        assert CentralDifference(one).bound(x, reach=0.0) <= 2.0 / np.sqrt(fastest) * (1.0 + 1e-6)


@pytest.mark.parametrize("scale", [1e-4, 1e4])
def test_the_bound_on_steps_goes_with_the_root_of_the_masses(scale):
    """As all frequencies do with its inverse, of balls that do not turn and of boxes that do."""
    for shape in (dict(shape="sphere", radius=0.3), SHAPES["box"]):
        bounds = []
        for factor in (1.0, scale):
            bodies = [
                refweb.Body(name=name, mass=factor * mass, position=(place, 0, 0), **shape)
                for name, mass, place in (("a", 1.0, 0.0), ("b", 2.0, 0.5))
            ]
            net = discretisation.build(FAR, CABLE)
            whole = System(net, [*bodies, refweb.Contact(between_bodies=True, stiffness=1e3)], np.ones((2, 3), bool))
            bounds.append(CentralDifference(whole).bound(np.zeros((whole.rows, 3)), reach=0.0))
        assert bounds[1] == pytest.approx(np.sqrt(scale) * bounds[0], rel=1e-9)


def test_arcs_cover_a_rim_twice():
    """Every angle is within two arcs, so that no place is at the end of all arcs that have it."""
    arcs = rim(0.3, 0.1, 0.05)["owns"]
    angles = np.linspace(0.0, 2.0 * np.pi, 101)[:-1] + 1e-3
    inside = [((angles - begin) % (2.0 * np.pi)) < end - begin for begin, end in arcs]
    np.testing.assert_array_equal(np.sum(inside, axis=0), 2)


def run(bodies, duration, contact, gravity=False, frames=20, **solve):
    """A solution of bodies with no web near."""
    scene = dict(
        title="bodies",
        web=dict(kind="cable", start=[0, 50, 100], end=[1, 50, 100], elements=1),
        cable=dict(law="linear", modulus=1e3, area=1e-6, density=1.0),
        body=bodies,
        contact=dict(between_bodies=True, **contact),
        solve=dict(kind="dynamic", duration=duration, **solve),
        output=dict(interval=duration / frames, frames=1),
        accuracy=dict(error="none"),
        observe=[dict(name="E", quantity="total_energy")],
    )
    if gravity:
        scene["gravity"] = dict(acceleration=[0.0, 0.0, -G])
    return refweb.run(refweb.Scene.from_dict(scene))


def rows(solution, name):
    """Row of a body and of its rotation."""
    body = next(body for body in solution.state.system.net.bodies if body.name == name)
    return body.row, body.spin


BALLS = [
    dict(name="a", radius=0.1, mass=1.0, position=[0, 0, 0], velocity=[1.0, 0, 0]),
    dict(name="b", radius=0.1, mass=1.0, position=[0.25, 0, 0]),
]


@pytest.mark.parametrize("solve", [dict(method="cvode", rtol=1e-7), dict(method="ida", rtol=1e-7)])
def test_equal_balls_exchange_speeds(solve):
    s = run(BALLS, 0.15, dict(stiffness=1e4), **solve)
    (a, _), (b, _) = rows(s, "a"), rows(s, "b")
    np.testing.assert_allclose(s.state.v[[a, b]], [[0, 0, 0], [1, 0, 0]], atol=3e-6)
    assert s.pairs["a, b"]["overlap"] == pytest.approx(np.sqrt(0.5 / 1e4), rel=1e-5)  # ½ k δ² = ½ μ v²


def test_the_book_closes_with_order_2():
    """Of two balls that hit: the error of the speed behind falls with the square of the step, to the exchange."""
    errors = []
    for step in (4e-4, 2e-4, 1e-4):
        s = run(BALLS, 0.15, dict(stiffness=1e4), step_size=step)
        a, _ = rows(s, "a")
        errors.append(s.solver["energy_drift"])
        assert s.solver["momentum_drift"] <= 1e-14
        assert abs(s.state.v[a, 0]) <= 10.0 * step  # the step in which they part is not known better
    assert np.polyfit(np.log([4, 2, 1]), np.log(errors), 1)[0] > 1.6


METHODS = [dict(), dict(method="cvode", rtol=1e-6), dict(method="ida", rtol=1e-6)]


@pytest.mark.parametrize("solve", METHODS)
def test_a_ball_that_slides_ends_rolling(solve):
    """At v/(1 + I/m r²) with the distance r = R − δ/2 from its centre to where it touches: 5/7 up to δ/R."""
    k, radius = 1e5, 0.1
    deep = G / k
    ball = dict(name="b", radius=radius, mass=1.0, position=[-1, 0, radius - deep], velocity=[1.0, 0, 0])
    s = run([FLOOR, ball], 0.5, dict(stiffness=k, friction=0.3), gravity=True, **solve)
    row, spin = rows(s, "b")
    reach = radius - 0.5 * deep
    speed = 1.0 / (1.0 + 0.4 * radius**2 / reach**2)
    np.testing.assert_allclose(s.state.v[row], [speed, 0, 0], atol=3e-6)
    np.testing.assert_allclose(s.state.v[spin], [0, speed / reach, 0], atol=3e-5)
    assert s.state.v[row, 0] == pytest.approx(5 / 7, rel=deep / radius)


@pytest.mark.slow
def test_a_box_slides_to_rest():
    """Over (v √(v² + s²) + s² asinh(v/s))/(2 μ g), s being the slip velocity, and does not turn."""
    k, v, slip, mu = 1e5, 1.0, 1e-2, 0.3
    box = dict(name="b", shape="box", size=[0.4, 0.4, 0.1], mass=1.0, position=[-1, 0, 0.05 - G / (8 * k)])
    law = dict(stiffness=k, friction=mu, slip_velocity=slip, damping=0.5)
    s = run([FLOOR, box | dict(velocity=[v, 0, 0])], 0.5, law, gravity=True)
    row, _ = rows(s, "b")
    way = (v * np.hypot(v, slip) + slip**2 * np.arcsinh(v / slip)) / (2.0 * mu * G)
    # At rest it still creeps by s e^(−μ g t/s) of that; it rocks on its front edge by some δ.
    assert s.state.x[row, 0] == pytest.approx(way, abs=2e-6)
    assert np.abs(s.state.v[row]).max() <= 1e-6


@pytest.mark.parametrize("solve", [dict(safety=0.25), dict(method="explicit", order=4)])
def test_a_box_on_its_edge(solve):
    """It bounces off a fixed box, turning, and keeps its energy and what it has along the floor."""
    turn = np.pi / 8
    q = [np.cos(turn), 0.8 * np.sin(turn), 0.6 * np.sin(turn), 0.0]
    box = dict(name="b", shape="box", size=[0.3, 0.4, 0.5], mass=1.0, position=[0, 0, 0.5], orientation=q)
    s = run([FLOOR, box], 0.6, dict(stiffness=1e5), gravity=True, **solve)
    row, spin = rows(s, "b")
    assert s.solver["energy_drift"] <= 3e-4
    assert s.pairs["floor, b"]["overlap"] > 1e-3
    assert np.linalg.norm(s.state.v[spin]) > 0.1
    np.testing.assert_allclose(s.state.v[row, :2], 0.0, atol=1e-12)  # the floor is flat there: it pushes upward
    assert s.passage == {"pairs": "certified", "bodies": "certified"}


def test_edges_do_not_pass():
    """Two bars crossed edge on edge: no corner is near, and they exchange their speeds."""
    c, s = np.cos(np.pi / 8), np.sin(np.pi / 8)
    bars = [
        dict(name="a", shape="box", size=[1.0, 0.1, 0.1], mass=1.0, position=[0, 0, 0.16], velocity=[0, 0, -1])
        | dict(orientation=[c, s, 0, 0]),
        dict(name="b", shape="box", size=[0.1, 1.0, 0.1], mass=1.0, position=[0, 0, 0], orientation=[c, 0, s, 0]),
    ]
    found = run(bars, 0.1, dict(stiffness=1e5))
    (a, _), (b, _) = rows(found, "a"), rows(found, "b")
    np.testing.assert_allclose(found.state.v[[a, b], 2], [0.0, -1.0], atol=2e-3)
    assert found.state.position[a, 2] > found.state.position[b, 2]
    assert found.passage == {"pairs": "certified", "bodies": "certified"}


BOXES = [
    dict(name="a", shape="box", size=[0.3, 0.4, 0.5], mass=1.0, position=[0, 0, 0], velocity=[1.0, 0, 0])
    | dict(angular_velocity=[1, 2, 3]),
    dict(
        name="b", shape="box", size=[0.3, 0.3, 0.2], mass=2.0, position=[0.45, 0.2, 0.1], orientation=[1, 0.3, 0.2, 0.1]
    ),
]


HIT = [dict(safety=0.05), *METHODS[1:]]


@pytest.mark.parametrize("methods", [HIT[:1], pytest.param(HIT, marks=pytest.mark.slow)])
def test_an_eccentric_hit_keeps_both_momenta(methods):
    """To rounding, with losses too; all methods agree."""
    law = dict(stiffness=1e4, damping=0.2, friction=0.3, slip_velocity=0.1)
    ends = []
    for solve in methods:
        s = run(BOXES, 0.3, law, **solve)
        net, v = s.state.system.net, s.state.v
        momentum, moment = np.zeros(3), np.zeros(3)
        for body in net.bodies:
            p = net.mass[body.row] * v[body.row]
            momentum += p
            moment += np.cross(s.state.position[body.row], p) + body.moment * v[body.spin]
        tight = 1e-12 if not solve.get("method") else 1e-5
        np.testing.assert_allclose(momentum, [1, 0, 0], atol=tight)
        np.testing.assert_allclose(moment, net.bodies[0].inertia @ [1, 2, 3], atol=tight)
        ends.append(np.concatenate([v[r] for b in net.bodies for r in (b.row, b.spin)]))
        assert s.history["dissipated_energy"][-1] > 1e-3
    for end in ends[1:]:
        np.testing.assert_allclose(end, ends[0], atol=3e-3)


def test_stiffness_left_out():
    """It is chosen so that no overlap is above a tenth of the smaller body."""
    s = run(BALLS, 0.15, {})
    assert 0.0 < s.pairs["a, b"]["overlap"] <= s.pairs["a, b"]["allowed"] == pytest.approx(0.01)
    assert not any("touches the web" in text for text in s.warnings)


def test_what_is_too_deep():
    """A warning names the pair and the stiffness that would do; a body in the core of another ends the run."""
    s = run(BALLS, 0.15, dict(stiffness=2e3))
    assert any('bodies "a" and "b" are' in text and "stiffness = " in text for text in s.warnings)
    core = r'bodies "a" and "b" are (\S+) m deep .* in the core, more than 0\.5 of the 0\.1 m .*; stiffness = (\S+) may'
    with pytest.raises(refweb.SolverError, match=core) as refused:
        run(BALLS, 0.15, dict(stiffness=190.0))
    deep, enough = map(float, re.search(core, str(refused.value)).groups())
    assert deep > 0.05
    # k v²-law: the energy ½ · ½ kg · (1 m/s)² at a fifth of the allowed 0.01 m, and what two digits round up by
    assert enough == pytest.approx(0.5 / 0.002**2, rel=0.05)
    assert run(BALLS, 0.15, dict(stiffness=enough)).pairs["a, b"]["overlap"] == pytest.approx(0.002, rel=0.03)


def test_passage():
    """Steps that are given may be too long for that to be certain."""
    quick = [BALLS[0] | dict(velocity=[20.0, 0, 0]), BALLS[1]]
    assert run(quick, 0.02, dict(stiffness=1e7), step_size=1e-5).passage["pairs"] == "certified"
    long = run([BALLS[0] | dict(velocity=[20.0, 0, 0], position=[0, 0.5, 0]), BALLS[1]], 0.02, dict(stiffness=1e4))
    assert long.passage["pairs"] == "certified"
    by = [BALLS[0] | dict(velocity=[20.0, 0, 0], position=[0, 0.5, 0]), BALLS[1]]
    found = run(by, 0.04, dict(stiffness=50.0), step_size=4e-3).passage["pairs"]  # 2 · 20 m/s · 4 ms against 0.1 m
    assert 'not certified: bodies "a" and "b" may come nearer by 0.16 m in a step' in found


@pytest.mark.parametrize("method", ["cvode", "ida"])
def test_steps_that_follow_from_the_error_are_certified(method):
    """In free flight any step is accurate, and one would lead through the other ball, and far away from it behind."""
    s = run([BALLS[0] | dict(velocity=[20.0, 0, 0]), BALLS[1]], 5.0, dict(stiffness=1e6), method=method)
    (a, _), (b, _) = rows(s, "a"), rows(s, "b")
    assert s.passage["pairs"] == "certified" and s.pairs["a, b"]["overlap"] > 0.01
    np.testing.assert_allclose(s.state.v[[a, b], 0], [0.0, 20.0], atol=0.02)  # 1e-3: rtol of 1e-6 in 1e3 steps


def test_bodies_that_come_to_a_middle_are_seen():
    """Two balls of 0.3 m on random bent ways: none comes nearer than 0.3 m unseen, looked at in 400 places.

    What is said to come there does, but for the way of the smallest piece, 1/1024 of some 2 m.
    """
    built, rng, seen = system("sphere", "sphere", stiffness=1e3)[0], np.random.default_rng(5), [0, 0]
    one, other = built.net.bodies

    def met(at):
        course, (start, middle, end) = (
            SimpleNamespace(crossings=none_met()),
            (Position(t, at(t)) for t in (0.0, 0.5, 1.0)),
        )
        Passages(built, at).inspect(course, SimpleNamespace(start=start, middle=middle, end=end))
        return np.isfinite(course.crossings[MET, 0])

    def there_and_back(t):
        x = np.zeros((built.rows, 3))
        x[other.row, 0] = 0.25 + 1.6 * (t - 0.25) ** 2 - 0.5  # 0.35 m at 0 and at 0.5, and 0.25 m between
        return x

    assert met(there_and_back)
    for _ in range(60):
        start, bend = rng.uniform(-1.5, 1.5, (2, 3)), 0.3 * rng.standard_normal((2, 3))
        way = rng.uniform(-0.4, 0.4, (2, 3)) - 2.0 * start

        def at(t, start=start, way=way, bend=bend):
            x = np.zeros((built.rows, 3))
            x[[one.row, other.row]] = start + t * way + 4.0 * t * (1.0 - t) * bend
            return x

        def apart(t, at=at):
            places = built.net.points[[one.row, other.row]] + at(t)[[one.row, other.row]]
            return np.linalg.norm(places[0] - places[1])

        if apart(0.0) < 0.3:
            continue
        found, nearest = met(at), min(apart(t) for t in np.linspace(0.0, 1.0, 401))
        assert nearest > 0.3 or found
        assert nearest < 0.31 or not found
        seen[int(found)] += 1
    assert min(seen) >= 8


def test_refusals():
    alone = [BALLS[0]]
    with pytest.raises(refweb.InputError, match="takes two bodies"):
        run(alone, 0.1, dict(stiffness=1e4))
    mixed = dict(stiffness=1e4, bodies=dict(a=dict(exponent=1.5)))
    with pytest.raises(refweb.InputError, match="must be equal"):
        run(BALLS, 0.1, mixed)


def ell(width=0.2):
    """A prism over an L, which is not convex, and its triangles."""
    corners = np.array([[0, 0], [0.6, 0], [0.6, 0.2], [0.2, 0.2], [0.2, 0.6], [0, 0.6]]) - 0.2
    points = np.vstack([np.column_stack([corners, np.full(6, z)]) for z in (-width, width)])
    top = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    i = np.arange(6)
    j = np.roll(i, -1)
    sides = np.vstack([np.column_stack([i, j, j + 6]), np.column_stack([i, j + 6, i + 6])])
    return points, np.vstack([top + 6, top[:, ::-1], sides])


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("surfaces")
    found = {"block": solids.box((0.6, 0.5, 0.7)), "ell": ell()}
    for name, (points, triangles) in found.items():
        meshio.write(folder / f"{name}.stl", meshio.Mesh(points, [("triangle", triangles)]))
    return {name: dict(shape="mesh", file=str(folder / f"{name}.stl"), grid=24) for name in found}


@pytest.mark.ordinary("pair3")
@pytest.mark.parametrize("pair", [("sphere", "block"), ("box", "ell"), ("cylinder", "ell"), ("block", "ell")])
def test_meshes(pair, files, monkeypatch):
    """A ball that is thicker than a field reaches as well; bodies that are not convex."""
    for name, shape in files.items():
        monkeypatch.setitem(SHAPES, name, shape)
    test_force_is_the_slope_of_an_energy(pair, LAWS[0])


@pytest.mark.slow
def test_a_mesh_is_the_box_that_it_is(files):
    """Force of a ball on a block from a file and on a box with sharp edges, beyond a face, an edge and a corner."""
    ball = dict(name="a", radius=0.1, mass=1.0)
    for place in ([0.0, 0.1, 0.43], [0.38, 0.05, 0.38], [0.36, 0.28, 0.40]):
        found = []
        for other in (files["block"] | dict(grid=48), dict(shape="box", size=(0.6, 0.5, 0.7), rounding=1e-5)):
            bodies = [
                refweb.Body(**ball, position=place),
                refweb.Body(name="b", fixed=True, position=(0, 0, 0), **other),
            ]
            contact = refweb.Contact(stiffness=1e3, between_bodies=True)
            whole = System(discretisation.build(FAR, CABLE), [*bodies, contact], np.zeros((2, 3), dtype=bool))
            found.append(whole.force(0.0, np.zeros((whole.rows, 3)))[2])
        assert np.abs(found[1]).max() > 5.0
        np.testing.assert_allclose(found[0], found[1], atol=1e3 * 1.2e-4)  # splines of 0.015 m miss depth by so much


def test_rings():
    """Two coins in a plane exchange their speeds, as balls do: their windows add up to 1 up to δ/r of it."""
    ring = dict(shape="ring", radius=0.1, mass=1.0, normal=[0, 0, 1])
    coins = [
        ring | dict(name="a", position=[0, 0, 0], velocity=[0.8, 0.6, 0]),
        ring | dict(name="b", position=[0.184, 0.138, 0]),
    ]
    s = run(coins, 0.15, dict(stiffness=1e4), safety=0.1)
    (a, _), (b, _) = rows(s, "a"), rows(s, "b")
    np.testing.assert_allclose(s.state.v[[a, b]], [[0, 0, 0], [0.8, 0.6, 0]], atol=2e-3)
    assert s.pairs["a, b"]["overlap"] == pytest.approx(np.sqrt(0.5 / 2e4), rel=0.05)  # each feels the other: 2 k


def test_cylinders_roll_without_a_bump():
    """On its side at speed v with v/r: neither changes by more than its overlap over the radius, nor its height."""
    k, radius = 1e5, 0.1
    deep = G / (7.0 * k)  # four rims, and the axis at both ends and in between
    drum = dict(name="b", shape="cylinder", radius=radius, length=0.4, axis=[0, 1, 0], mass=1.0, rounding=0.01)
    at = dict(position=[-1, 0, radius - deep], velocity=[1.0, 0, 0], angular_velocity=[0, 10.0, 0])
    s = run([FLOOR, drum | at], 0.5, dict(stiffness=k, friction=0.3), gravity=True)
    row, spin = rows(s, "b")
    np.testing.assert_allclose(s.state.x[row], [0.5, 0, 0], atol=5e-4)
    assert s.state.v[row, 0] == pytest.approx(1.0, abs=5e-4)
    assert s.state.v[row, 2] == pytest.approx(0.0, abs=2e-3)


def test_bodies_that_do_not_touch_are_told():
    scene = dict(title="through", web=dict(kind="cable", start=[0, 0, 9], end=[1, 0, 9], elements=1), body=BALLS)
    scene |= dict(cable=dict(law="linear", modulus=1e3, area=1e-6, density=1.0), contact=dict(stiffness=1e4))
    scene |= dict(solve=dict(kind="dynamic", duration=0.2), output=dict(interval=0.02))
    s = refweb.run(refweb.Scene.from_dict(scene))
    assert any('bodies "a" and "b" are' in text and "between_bodies = true" in text for text in s.warnings)
    apart = [BALLS[0] | dict(position=[0, 0.5, 0]), BALLS[1]]
    s = refweb.run(refweb.Scene.from_dict(scene | dict(body=apart)))
    assert not any("between_bodies" in text for text in s.warnings)


@pytest.mark.slow
def test_a_stack_rests():
    """Three boxes on a floor for 100 000 steps: they sink by what bears them, and stay, to rounding."""
    k = 1e5
    boxes = [
        dict(name=f"b{i}", shape="box", size=[0.4] * 3, mass=1.0, position=[0, 0, 0.2 + 0.4 * i]) for i in range(3)
    ]
    s = run([FLOOR, *boxes], 6.2, dict(stiffness=k, damping=30.0, friction=0.3), gravity=True)
    assert s.solver["nsteps"] >= 100_000
    at = [rows(s, f"b{i}") for i in range(3)]
    assert max(np.abs(s.state.v[list(r)]).max() for r in at) <= 1e-12
    sunk = [s.state.x[row, 2] for row, _ in at]
    # On the floor four corners, each of one edge, and four edges bear a box; on a box so do those of that one.
    bearing = np.cumsum([3 / 8, 2 / 16, 1 / 16]) * G / k
    # The place in between of an edge that lies flat is found 1e-5 of its length from an end, and bears 4e-5 of that.
    np.testing.assert_allclose(sunk, -bearing, rtol=1e-4)
    assert max(np.abs(s.state.x[row, :2]).max() for row, _ in at) <= 1e-12


def test_bodies_that_carry_nodes(monkeypatch):
    """Their centre of mass is not that of their shape: forces are slopes of the energy all the same."""
    near = refweb.SingleCable(start=(0.3, 0.2, 0.3), end=(1, 0, 2), elements=1).web()
    monkeypatch.setitem(globals(), "FAR", near)
    monkeypatch.setitem(globals(), "CABLE", replace(CABLE, density=2000.0))
    (one,) = system("box", "capsule", more=[refweb.Attach(node=0, body="a")], stiffness=1e3)
    assert np.linalg.norm(one.net.bodies[0].offset) > 0.02
    monkeypatch.setitem(globals(), "system", lambda *pair, **law: [one])
    test_force_is_the_slope_of_an_energy(("box", "capsule"), {})


def depth_along(bodies, places, turns, n):
    """h_A(n) + h_B(−n) − n·(b − a) of unit vectors n, two convex bodies being the points x with n·x ≤ h(n) about them.

    Its least value is the way by which one has to be moved to be out of the other [m].
    """
    total = -n @ (places[1] - places[0])
    for body, turn, sign in zip(bodies, turns, (1.0, -1.0), strict=True):
        grown, local = body.shape.grown(), sign * n @ (body.axes @ turn.T).T
        c = np.array(grown.core)
        if grown.round:
            total = total + grown.radius + c[0] * np.hypot(local[..., 0], local[..., 1]) + c[2] * abs(local[..., 2])
        else:
            total = total + grown.radius + np.abs(local) @ c
    return total


def penetration(bodies, places, turns, directions):
    """The least depth along any direction, from the best three of many."""
    every = depth_along(bodies, places, turns, directions)

    def along(n):
        return depth_along(bodies, places, turns, n / np.linalg.norm(n))

    starts = directions[np.argsort(every)[:3]]
    return min(minimize(along, n, method="Nelder-Mead", options=dict(xatol=1e-6, fatol=1e-9)).fun for n in starts)


def random_turns(rng, net, x):
    """Give all free bodies a random orientation."""
    for body in net.bodies:
        if body.turn is not None:
            q = rng.standard_normal(4)
            q /= np.linalg.norm(q)
            x[body.turn, 0], x[body.spin] = q[0] - 1.0, q[1:]


DIRECTIONS = np.random.default_rng(0).standard_normal((2000, 3))
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("count", [4, pytest.param(50, marks=pytest.mark.slow)])
def test_skeletons_see_every_contact(pair, count):
    """In any orientation, some hundredth deep: the deepest contact is never above the true depth, and hardly below it.

    Edges share a push, and sides of cylinders cross between the parts that fill them.
    """
    (one,) = system(*pair, stiffness=1e3)
    net, rng, seen = one.net, np.random.default_rng(1), 0
    (a, b), turns = net.bodies, None
    while seen < count:
        x = np.zeros_like(net.points)
        random_turns(rng, net, x)
        turns = a.rotation(x), b.rotation(x)
        way = rng.standard_normal(3)
        way /= np.linalg.norm(way)
        low, high = 0.0, 2.0
        for _ in range(40):
            middle = 0.5 * (low + high)
            deep = depth_along((a, b), (np.zeros(3), middle * way), turns, DIRECTIONS).min()
            low, high = (middle, high) if deep > 0.02 else (low, middle)
        x[b.row] = low * way - (net.points[b.row] - net.points[a.row])
        deep = penetration((a, b), (np.zeros(3), low * way), turns, DIRECTIONS)
        if deep < 4e-3:  # edges that the directions have missed
            continue
        share = one.forces(0.0, x)[1][0][:, 0].max() / deep
        assert 0.85 < share <= 1.0 + 1e-6
        seen += 1


def thrown(seed):
    """Bodies of random shapes, thrown from all sides at where they meet."""
    rng, bodies = np.random.default_rng(seed), []
    for n, corner in enumerate(np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])):
        shape = dict(SHAPES[str(rng.choice(list(SHAPES)))])
        shape.pop("inertia", None)
        turn = {"orientation": rng.standard_normal(4).tolist()}
        turn |= {"angular_velocity": (3.0 * rng.standard_normal(3)).tolist()}
        if "axis" in shape:
            shape.pop("axis")
        place = 0.65 * corner + 0.1 * rng.standard_normal(3)
        velocity = -rng.uniform(1.0, 4.0) * place + 0.2 * rng.standard_normal(3)
        mass = float(10.0 ** rng.uniform(-1.0, 1.0))
        bodies.append(
            dict(name=f"b{n}", mass=mass, position=place.tolist(), velocity=velocity.tolist(), **shape)
            | (turn if shape["shape"] != "sphere" else {})
        )
    return bodies


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_nothing_passes(seed):
    """Bodies thrown at each other: what is certified, a program of another kind sees in the frames as well.

    It is `penetration`, by support functions; between two frames nothing moves by a tenth of a body.
    """
    rng = np.random.default_rng(seed)
    law = dict(friction=float(rng.choice([0.0, 0.5])), damping=float(rng.choice([0.0, 0.1])))
    solve = METHODS[1] if seed % 5 == 4 else {}
    s = run(thrown(seed), 0.5, law, frames=200, **solve)
    assert s.passage["pairs"] == "certified"
    assert s.solver["energy_drift"] <= 1e-2
    net, touched = s.state.system.net, 0
    for _, state in s.frames:
        turns = [body.rotation(state.x) for body in net.bodies]
        for i, j in itertools.combinations(range(4), 2):
            pair = (net.bodies[i], net.bodies[j])
            at = [state.position[body.row] for body in pair]
            if depth_along(pair, at, (turns[i], turns[j]), DIRECTIONS).min() > 0.0:
                deep = penetration(pair, at, (turns[i], turns[j]), DIRECTIONS)
                told = s.pairs.get(f"b{i}, b{j}", dict(overlap=0.0, allowed=0.0))
                assert deep <= told["overlap"] / 0.85 + 1e-6
                assert told["overlap"] <= told["allowed"]
                touched += deep > 0.0
    assert touched


def test_what_was_in_each_other_is_known_when_a_run_goes_on(tmp_path):
    """Two balls fly through each other in the first half of a run, which is interrupted behind it."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[(0, 0, 0), (1, 0, 0)], lines=[(0, 1)], supports=[0, 1]),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-6, density=1000.0),
        effects=[
            refweb.Body(name="a", radius=0.1, mass=1.0, position=(0, 5, 0), velocity=(10.0, 0, 0)),
            refweb.Body(name="b", radius=0.1, mass=1.0, position=(0.25, 5, 0)),
            refweb.Contact(stiffness=1e4),
        ],
        solve=refweb.Dynamic(duration=0.1),
        output=refweb.Output(interval=1e-3, frames=5),
        accuracy=refweb.Accuracy(error="none"),
    )
    whole, resumed = nets.whole_and_resumed(scene, tmp_path)
    assert any("m deep in each other" in warning for warning in whole.warnings)
    assert resumed.warnings == whole.warnings
