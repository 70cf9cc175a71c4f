"""Losses at lines whose nodes bodies carry, as explicit kicks solve for them: laws, books, closed forms, CVODE."""

import re

import numpy as np
import pytest
from contact_kicks import Solved
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from test_attach import bridled, carrying, state

import refweb
from refweb.dynamics.expected_cost import expected_cost
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.method_choice import decided

G = 9.81
LOSSES = {
    "contact": refweb.Contact(stiffness=1e3, exponent=1.5, damping=0.1, friction=0.4, slip_velocity=1e-2),
    "drag": refweb.Drag(density=20.0, diameter=0.05, bodies={"chest": {"coefficient": 1, "area": 1}}),
    "self_contact": refweb.SelfContact(radius=0.1, stiffness=1e3, friction=0.5, slip_velocity=1e-2),
}


class Kick:
    """One kick of a web whose nodes two free bodies carry, by losses alone.

    Parameters
    ----------
    seed : int
        Of the state and the size of the kick.
    loss : refweb.Contact or refweb.Drag
        What takes energy.

    Attributes
    ----------
    v, after, mean : ndarray, shape (rows, 3)
        Velocities ahead of it, behind it, and the mean [m/s], with those of the nodes that bodies carry.
    own : ndarray, shape (rows, 3)
        Forces as sweeps come to them, on bodies those of the nodes included [N].
    power : float
        What is booked of them [W].
    """

    def __init__(self, seed, loss):
        self.system = system = carrying(loss)
        self.x, self.v = state(system, seed)
        self.h = float(10.0 ** np.random.default_rng(seed).uniform(-4, -1))
        solved = Solved(system, self.x, self.v, self.h)
        self.terms, self.contacts, self.sweeps = solved.terms, solved.contacts, solved.sweeps
        self.own, self.after, self.mean, self.power = solved.forces, solved.after, solved.mean, solved.power
        self.rows = solved.rows

    def energy(self, v):
        """Of motion, by masses and moments alone [J]."""
        net, total = self.system.net, 0.0
        for r in np.flatnonzero(~self.system.carried[: net.nodes + len(net.bodies)]):
            total += 0.5 * net.mass[r] * v[r] @ v[r]
        return total + sum(0.5 * b.moment * b.turning(self.x, v) @ v[b.spin] for b in net.bodies)


@pytest.mark.parametrize("loss", LOSSES)
def test_a_kick_loses_what_is_booked_and_keeps_momenta(loss):
    """By masses, moments and places alone, of contact, which is internal; energy falls, to rounding."""
    count = 0
    for seed in range(25):
        kick = Kick(seed, LOSSES[loss])
        count += len(kick.contacts)
        before, after = kick.energy(kick.v), kick.energy(kick.after)
        assert kick.power <= 0.0 and abs(after - before - kick.h * kick.power) <= 1e-13 * before
        if loss != "drag":
            own, bodies = kick.own.copy(), kick.system.net.bodies
            own[kick.system.carried] = 0.0  # bodies have them
            linear = kick.system.net.nodes + len(bodies)
            moment = np.cross((kick.system.net.points + kick.x)[:linear], own[:linear]).sum(axis=0)
            moment += sum(own[body.spin] for body in bodies)
            most = np.abs(own).max()
            assert np.abs(own[:linear].sum(axis=0)).max() <= 1e-12 * most and np.abs(moment).max() <= 1e-11 * most
    assert count > (25 if loss == "self_contact" else 100)


@pytest.mark.parametrize("loss, column", [("damping", 0), ("friction", 1)])
def test_forces_of_contact_are_those_of_the_law(loss, column):
    """The kernel that CVODE calls, at velocities of which θ says the share of those behind the kick; a sphere touches
    each line once."""
    found = 0
    for seed in range(60):
        own = {"ball": {loss: 0.3, "slip_velocity": 1.0}}
        kick = Kick(seed, refweb.Contact(stiffness=1e3, bodies=own))
        (term,), contacts = kick.terms, kick.contacts
        body = kick.system.net.bodies[1].row
        at_node = any(kick.rows(contact)[1] == body for contact in contacts)  # where lines that end there touch as one
        if at_node or not np.abs(kick.own).max() > 1e-6 or kick.sweeps > 200:
            continue
        total = np.zeros_like(kick.v)
        for contact in contacts:
            theta, cell = contact["theta"][column], slice(contact["cell"], contact["cell"] + 1)
            seen = (1.0 - theta) * kick.v + theta * kick.after
            where = term.cells[cell], term.data[cell]
            term.force(0.0, kick.x, seen, total, *where, np.zeros((1, term.columns)))
        kick.system.carriers.add_forces_to_bodies(kick.x, total)
        np.testing.assert_allclose(total, kick.own, rtol=0, atol=1e-8 * np.abs(kick.own).max())
        found += bool(np.isin(term.cells[contacts["cell"], :2], kick.system.net.carried).any())
    assert found > 10  # with a node that a body carries


def test_friction_of_lines_is_that_of_the_law():
    """As above, of pairs of lines of which bodies carry nodes."""
    found = 0
    for seed in range(60):
        kick = Kick(seed, refweb.SelfContact(radius=0.1, stiffness=1e3, friction=0.5, slip_velocity=1.0))
        if not len(kick.contacts) or kick.sweeps > 200:
            continue
        (term,), total = kick.terms, np.zeros_like(kick.v)
        for contact in kick.contacts:
            theta, cell = contact["theta"][1], slice(contact["cell"], contact["cell"] + 1)
            seen = (1.0 - theta) * kick.v + theta * kick.after
            term.force(0.0, kick.x, seen, total, term.cells[cell], term.data[cell], np.zeros((1, 1)))
        kick.system.carriers.add_forces_to_bodies(kick.x, total)
        np.testing.assert_allclose(total, kick.own, rtol=0, atol=1e-8 * np.abs(kick.own).max())
        found += bool(np.isin(term.cells[kick.contacts["cell"]], kick.system.net.carried).any())
    assert found > 10


def test_forces_of_drag_are_those_of_the_law():
    """At the mean of velocities ahead and behind, of all at once: bodies, nodes that they carry, and all others."""
    for seed in range(10):
        kick = Kick(seed, LOSSES["drag"])
        total = np.zeros_like(kick.v)
        for one in kick.terms:
            one.force(0.0, kick.x, kick.mean, total, one.cells, one.data, np.zeros((len(one.cells), one.columns)))
        kick.system.carriers.add_forces_to_bodies(kick.x, total)
        np.testing.assert_allclose(total, kick.own, rtol=0, atol=1e-10 * np.abs(kick.own).max())


def scene(points, lines, body, effects, duration, observe, density=1000.0, **solve):
    """A web of lines all of whose nodes a body at the origin carries."""
    return refweb.Scene(
        web=refweb.Inline(points=points, lines=lines, supports=[]),
        cable=refweb.Cable(law="linear", modulus=1e6, area=1e-4, density=density),
        supports=refweb.Supports(nodes=[]),
        effects=[
            refweb.Body(name="sled", position=(0.0, 0.0, 0.0), **body),
            refweb.Attach(body="sled", node="all"),
            *effects,
        ],
        solve=refweb.Dynamic(duration=duration, **solve),
        output=refweb.Output(interval=duration),
        accuracy=refweb.Accuracy(error="none"),
        observe=[refweb.Observe(name=name, **keys) for name, keys in observe.items()],
    )


LONG, WIDE, STIFFNESS, MU, SLIP = 0.3, 0.2, 1e4, 0.3, 0.2
"""Half sizes of the sled; its runners touch a plane at two ends and the middle each, all alike."""


def sled(duration, velocity=(0.0, 0.0, 0.0), spin=0.0, **solve):
    """A sphere on two runners, as high as its centre, on the top of a box into which they have sunk by their weight."""
    points = [[-LONG, -WIDE, 0.0], [LONG, -WIDE, 0.0], [-LONG, WIDE, 0.0], [LONG, WIDE, 0.0]]
    ball = dict(radius=1e-3, mass=1.5, inertia=(0.02, 0.03, 0.05), velocity=velocity, angular_velocity=(0, 0, spin))
    sunk = (1.5 + 4.0 * 1e-4 * 1000.0 * LONG) * G / (6.0 * STIFFNESS)
    plane = refweb.Body(name="ice", shape="box", size=(9.0, 9.0, 1.0), position=(0.0, 0.0, sunk - 0.5), fixed=True)
    touching = refweb.Contact(stiffness=STIFFNESS, friction=MU, slip_velocity=SLIP)
    effects = [plane, refweb.Gravity(acceleration=(0.0, 0.0, -G)), touching]
    observe = dict(
        v=dict(quantity="velocity", body="sled", component="x"),
        turning=dict(quantity="angular_velocity", body="sled", component="z"),
    )
    return refweb.run(scene(points, [[0, 1], [2, 3]], ball, effects, duration, observe, **solve))


STEPS = np.array([1e-3, 5e-4, 2.5e-4])


def order_of(errors):
    return np.polyfit(np.log(STEPS), np.log(errors), 1)[0]


def test_a_sled_slides_as_the_law_has_it():
    """v' = −μ g v/√(v² + v_s²), whose time is √(v² + v_s²) − v_s arcsinh(v_s/v), over μ g; order 2."""
    time, speed, duration = lambda v: np.hypot(v, SLIP) - SLIP * np.arcsinh(SLIP / v), 0.5, 0.1
    end = brentq(lambda v: time(speed) - time(v) - MU * G * duration, 1e-3, speed)
    errors = [abs(sled(duration, (speed, 0, 0), step_size=h).results["v"].value - end) for h in STEPS]
    assert errors[-1] < 1e-6 * speed and abs(order_of(errors) - 2.0) < 0.15, errors


def test_a_sled_that_spins_is_held_back_by_its_moments():
    """J ω' = −Σ μ N r² ω/√(r² ω² + v_s²) over its six contacts, N of each a sixth of the weight; order 2."""
    mass, duration, start = 4.0 * 1e-4 * 1000.0 * LONG, 0.1, 3.0
    J, normal = 0.05 + mass * (LONG**2 + WIDE**2), (1.5 + mass) * G / 6.0
    r = np.array([np.hypot(LONG, WIDE)] * 4 + [WIDE] * 2)

    def rate(t, w):
        return -MU * normal / J * (r**2 * w / np.hypot(r * w, SLIP)).sum()

    end = solve_ivp(rate, (0.0, duration), [start], "DOP853", rtol=1e-12, atol=1e-12).y[0, -1]
    errors = [abs(sled(duration, spin=start, step_size=h).results["turning"].value - end) for h in STEPS]
    assert errors[-1] < 1e-5 * start and abs(order_of(errors) - 2.0) < 0.15, errors


@pytest.mark.parametrize("spins", [False, True])
def test_a_rod_in_a_fluid_slows_as_drag_has_it(spins):
    """v' = −k v² has v₀/(1 + k v₀ t): of a rod across its way, its ball included, or one that spins about its middle
    with the drag of its ends; order 2, in steps that take up to 3 % of the velocity each."""
    half, D, rho, duration = 0.4, 0.02, 50.0, 0.2
    weight = 2.0 * half * 1e-4 * 1000.0
    ball = dict(radius=0.05, mass=0.5, inertia=0.01)
    ball |= dict(angular_velocity=(0.0, 0.0, 8.0)) if spins else dict(velocity=(0.0, 8.0, 0.0))
    observe = dict(
        v=dict(quantity="velocity", body="sled", component="y"),
        turning=dict(quantity="angular_velocity", body="sled", component="z"),
    )
    c = 0.5 * rho * 1.2 * D * half  # of either end
    if spins:
        k = 2.0 * c * half**3 / (0.01 + weight * half**2)
    else:
        k = (2.0 * c + 0.5 * rho * 0.47 * np.pi * 0.05**2) / (0.5 + weight)
    errors = []
    for h in STEPS * 2.0:
        drag = [refweb.Drag(density=rho, diameter=D)]
        found = refweb.run(scene([[-half, 0, 0], [half, 0, 0]], [[0, 1]], ball, drag, duration, observe, step_size=h))
        end = found.results["turning" if spins else "v"].value
        errors.append(abs(end / (8.0 / (1.0 + k * 8.0 * duration)) - 1.0))
        assert spins or found.solver["momentum_drift"] < 1e-12  # of which there is none where it spins
    assert errors[-1] < 1e-5 and abs(order_of(errors) - 2.0) < 0.1, errors


RUBBED = {"stiffness": 1e4, "friction": 0.3, "damping": 0.1}


def sliding(**solve):
    """A sled that presses on a free plate and slides and turns on it, both tumbling, for half of a bounce."""
    points = [[-LONG, -WIDE, 0.0], [LONG, -WIDE, 0.0], [-LONG, WIDE, 0.0], [LONG, WIDE, 0.0]]
    ball = dict(radius=1e-3, mass=1.5, inertia=(0.05, 0.06, 0.08), velocity=(0.5, 0.2, -0.4))
    plate = dict(name="plate", shape="box", size=(2.0, 2.0, 0.4), mass=3.0, position=(0.1, 0.05, -0.197))
    touching = refweb.Contact(stiffness=5e3, friction=MU, damping=0.3, slip_velocity=SLIP)
    effects = [refweb.Body(**plate), touching]
    observe = {"v": dict(quantity="velocity", body="sled")}
    lines = [[0, 1], [2, 3]]
    return refweb.run(
        scene(points, lines, ball | {"angular_velocity": (0.1, 0.2, 2.0)}, effects, 0.006, observe, **solve)
    )


@pytest.mark.slow
def test_central_differences_have_their_order_towards_cvode():
    """Two free bodies, one of which carries what the other rubs on: bounces, slides and turns, all in touch."""
    exact = sliding(method="cvode", rtol=1e-10)
    found = [sliding(step_size=0.1 * h) for h in STEPS]
    for part in ("x", "v"):
        errors = [np.abs(getattr(one.state, part) - getattr(exact.state, part)).max() for one in found]
        assert abs(order_of(errors) - 2.0) < 0.2, (part, errors)
    assert exact.history["dissipated_energy"][-1] > 1e-2
    drifts = [one.solver["energy_drift"] for one in found]
    assert abs(order_of(drifts) - 2.0) < 0.3 and drifts[0] < 1e-3
    for one in found:
        assert one.solver["momentum_drift"] < 1e-13 and one.solver["angular_momentum_drift"] < 1e-13


@pytest.mark.slow
def test_a_bridle_that_wraps_is_that_of_cvode():
    """A box that rubs on the lines it carries, with damped lines besides, which kicks iterate with what they solve."""
    given = lambda **keys: bridled(contact=RUBBED, solve={"kind": "dynamic", "duration": 0.1} | keys)  # noqa: E731
    other, found = refweb.run(given(method="cvode", rtol=1e-6)), refweb.run(given(safety=0.2))
    np.testing.assert_allclose(found.state.x, other.state.x, rtol=0, atol=1e-4)
    lost = [one.history["dissipated_energy"][-1] for one in (found, other)]
    assert lost[0] == pytest.approx(lost[1], rel=1e-2)
    assert found.solver["energy_drift"] < 1e-5 and found.solver["momentum_drift"] < 1e-12
    auto = given(method="auto")
    assert decided(auto, auto.build()).solve.method == "central-difference"


def test_a_net_that_one_body_carries_and_another_hits():
    """Free in space, with friction and damping: momentum and angular momentum to rounding."""
    web = {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.2}
    tables = {
        "web": web,
        "cable": {"law": "tension-only", "modulus": 1e6, "area": 1e-5, "density": 1000.0},
        "supports": {"nodes": []},
        "body": [
            dict(name="hub", shape="box", size=[0.1, 0.1, 0.1], mass=1.0, position=[0.6, 0.0, 0.0]),
            dict(name="stone", shape="box", size=[0.1, 0.15, 0.2], mass=0.5, position=[0.45, 0.03, -0.15],
                 velocity=[0.0, 0.0, 3.0], angular_velocity=[5.0, 2.0, 0.0]),
        ],
        "attach": [{"body": "hub", "node": "rim"}],
        "contact": RUBBED,
        "solve": {"kind": "dynamic", "duration": 0.1},
        "output": {"interval": 0.01},
        "accuracy": {"error": "none"},
    }  # fmt: skip
    found = refweb.run(refweb.Scene.from_dict(tables))
    assert found.history["dissipated_energy"][-1] > 1e-3 and found.solver["energy_drift"] < 5e-3
    assert found.solver["momentum_drift"] < 1e-13 and found.solver["angular_momentum_drift"] < 1e-13


def joined(**tables):
    """Two free boxes, one of which spins, joined by one line: no node has a mass of its own."""
    box = dict(shape="box", size=[0.2, 0.2, 0.2])
    given = {
        "web": {"kind": "inline", "points": [[0.1, 0, 0], [0.9, 0, 0]], "lines": [[0, 1]]},
        "cable": {"law": "tension-only", "modulus": 1e6, "area": 1e-5, "density": 1000.0},
        "supports": {"nodes": []},
        "body": [
            dict(name="one", mass=1.0, position=[0, 0, 0], angular_velocity=[0, 0, 1.0], **box),
            dict(name="two", mass=2.0, position=[1, 0, 0], velocity=[0.5, 0.1, 0], **box),
        ],
        "attach": [{"body": "one", "node": 0}, {"body": "two", "node": 1}],
        "contact": {"stiffness": 1e4, "between_bodies": True},
        "solve": {"kind": "dynamic", "duration": 0.5},
        "output": {"interval": 0.01},
        "accuracy": {"error": "none"},
    }
    return refweb.Scene.from_dict(given | tables)


@pytest.mark.parametrize("contact", [{}, {"friction": 0.3, "damping": 0.1}])
def test_bodies_that_carry_all_nodes_are_given_steps(contact):
    """Some hundred, as the line asks for; and the books close."""
    found = refweb.run(joined(contact={"stiffness": 1e4} | contact))
    assert found.solver["nsteps"] < 1000 and found.solver["energy_drift"] < 1e-4
    assert found.solver["momentum_drift"] < 1e-13 and found.solver["angular_momentum_drift"] < 1e-13


@pytest.mark.parametrize("sunk", [0.0, 0.03])
def test_bound_bounds_where_bodies_carry_all_nodes(sunk):
    """2/ω of the tangent is never below the bound, of a line in touch with a third body between two that carry it."""
    box = {"shape": "box", "size": [0.2, 0.3, 0.2], "mass": 0.3, "position": [0.5, 0, 0.1 - sunk]}
    scene = joined(body=[*joined().to_dict()["body"], {"name": "between", **box}])
    system = scene.build()
    x = np.zeros((system.rows, 3))
    K = system.pattern.matrix(system.stiffness(0.0, x)).toarray()
    number = np.full(x.size, -1)
    number[system.free] = np.arange(len(system.free))
    inverse = np.diag(1.0 / np.repeat(system.net.mass, 3)[system.free])
    for body in system.net.bodies:
        at = number[3 * body.spin + np.arange(3)]
        inverse[np.ix_(at, at)] = body.axes.T @ np.linalg.inv(body.inertia) @ body.axes
        K[:, at] *= 0.5  # of angles: at the start a quaternion has half of them
    largest = np.linalg.eigvals(inverse @ K).real.max()
    bound = CentralDifference(system).bound(x, reach=1e-3)
    assert 0.0 < bound <= 2.0 / np.sqrt(largest) * (1.0 + 1e-12)


def needle(radius=1e-3):
    """A needle of 1 m that spins above a net and beside a box at 200 rad/s."""
    thin = dict(shape="capsule", radius=radius, length=1.0, axis=[1, 0, 0], mass=0.1, position=[0, 0, 1.0])
    tables = {
        "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.5},
        "cable": {"law": "tension-only", "modulus": 1e6, "area": 1e-5, "density": 1000.0},
        "body": [
            dict(name="needle", angular_velocity=[0, 200.0, 0], **thin),
            dict(name="box", shape="box", size=[0.1, 0.1, 0.1], mass=1.0, position=[3, 0, 1.0]),
        ],
        "contact": {"stiffness": 1e3, "between_bodies": True},
        "solve": {"kind": "dynamic", "duration": 0.02},
        "output": {"interval": 0.01},
        "accuracy": {"error": "none"},
    }
    return refweb.Scene.from_dict(tables)


def test_a_needle_that_spins_is_given_the_steps_that_are_told():
    """Its ends move at 100 m/s, and pass through nothing in a step; 1.7e5 between its moments are nobody's speed."""
    scene = needle()
    told = expected_cost(scene, scene.build())
    step = float(re.search(r"([\d.]+) ns, where all is touched, by contact at body \"needle\"", told)[1]) * 1e-9
    found = refweb.run(scene)
    assert 0.25 * step < 0.02 / found.solver["nsteps"] < 4.0 * step
    thin = CentralDifference(needle(1e-7).build())
    with pytest.raises(refweb.SolverError, match="nothing may pass through a body in one, .* use a thicker body"):
        thin.advance(thin.start(), [0.01])


def crossed(**solve):
    """Two free spheres that carry a line each; the lines lie across each other, are pressed together and slide."""
    radius = 0.02
    gap = 2.0 * radius * (1.0 + 1e-6)
    points = [[-LONG, 0.05, 0.0], [LONG, 0.05, 0.0], [0.02, -LONG, gap], [0.02, LONG, gap]]
    ball = dict(radius=1e-3, inertia=(0.05, 0.06, 0.08), mass=1.5)
    tables = {
        "web": {"kind": "inline", "points": points, "lines": [[0, 1], [2, 3]]},
        "cable": {"law": "linear", "modulus": 1e6, "area": 1e-4, "density": 1000.0},
        "supports": {"nodes": []},
        "body": [
            dict(name="low", position=[0.1, 0.05, -0.1], angular_velocity=[0.5, 0.2, 2.0], **ball),
            dict(name="high", position=[0.02, 0.1, gap + 0.1], velocity=[0.5, 0.2, -0.4], **ball),
        ],
        "attach": [{"body": "low", "node": [0, 1]}, {"body": "high", "node": [2, 3]}],
        "self_contact": {"radius": radius, "stiffness": 2e4, "friction": MU, "slip_velocity": SLIP},
        "solve": {"kind": "dynamic", "duration": 0.006} | solve,
        "output": {"interval": 0.006},
        "accuracy": {"error": "none"},
    }
    return refweb.Scene.from_dict(tables)


@pytest.mark.slow
def test_lines_that_rub_on_each_other_between_bodies_are_those_of_cvode():
    """Of order 2, with energy by that order and momenta to rounding; central differences are chosen for it."""
    exact = refweb.run(crossed(method="cvode", rtol=1e-10))
    assert exact.history["dissipated_energy"][-1] > 1e-3
    found = [refweb.run(crossed(step_size=0.1 * h)) for h in STEPS]
    for part in ("x", "v"):
        errors = [np.abs(getattr(one.state, part) - getattr(exact.state, part)).max() for one in found]
        assert abs(order_of(errors) - 2.0) < 0.2, (part, errors)
    for one in found:
        assert one.solver["momentum_drift"] < 1e-13 and one.solver["angular_momentum_drift"] < 1e-13
    auto = crossed(method="auto")
    assert decided(auto, auto.build()).solve.method == "central-difference"
