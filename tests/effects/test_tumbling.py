"""Contact of bodies that turn in space: forces from energies, tangents, bounds, hits off-centre, books, tables."""

import itertools
from types import SimpleNamespace

import meshio
import nets
import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.rotations import Rotations
from refweb.effects.contact.pair import lever
from refweb.net.rigid_body import RigidBody
from refweb.net.rotation import quaternion_rate
from refweb.net.shapes.box import Box
from refweb.system.system import System

CHEST = dict(name="chest", shape="box", size=(0.6, 0.5, 0.7), axes=[(3.0, 1.0, 0.0), (-1.0, 3.0, 0.0)], rounding=0.2)
DRUM = dict(name="drum", shape="cylinder", radius=0.3, length=0.8, axis=(1.0, -1.0, 0.2), rounding=0.2)
PILL = dict(name="pill", shape="capsule", radius=0.2, length=0.4, orientation=(1.0, 2.0, 3.0, 4.0))
BODIES = (
    refweb.Body(**CHEST, position=(0.9, 0.7, -0.2), mass=0.5),
    refweb.Body(**DRUM, position=(0.2, 0.7, -0.15), density=100.0),
    refweb.Body(
        **PILL, position=(0.5, 0.2, 0.2), mass=1.0, inertia=[[1, 0.1, 0.2], [0.1, 1.2, 0.05], [0.2, 0.05, 0.9]]
    ),
    refweb.Body(name="ball", radius=0.3, position=(0.6, 0.3, 0.2), mass=0.5, inertia=(0.01, 0.02, 0.015)),
)
CONTACTS = [
    dict(stiffness=1e3),
    dict(stiffness=1e3, exponent=1.5, damping=0.1, friction=0.4, slip_velocity=2.0),
]


def touching(effect, bodies=BODIES):
    net = nets.skew_net("linear")
    return System(net, [*bodies, effect], np.zeros((len(net.points), 3), dtype=bool))


def alone(system, term):
    return System(system.net, [SimpleNamespace(on=lambda _: term)], np.zeros(system.net.points.shape, dtype=bool))


def state(net, seed, near=0.05):
    """Places near those of the web, and any rotations."""
    rng = np.random.default_rng(seed)
    x, v = near * rng.standard_normal(net.points.shape), rng.standard_normal(net.points.shape)
    for body in net.bodies:
        x[body.turn] = 0.0
        q = rng.standard_normal(4)
        x[body.turn, 0], x[body.spin] = q[0] - 1.0, q[1:]
    return x, v


FRAME = refweb.Frame(angular_velocity=(1.0, -2.0, 3.0))


@pytest.mark.ordinary("0-effect1", "0-effect2", "1-effect1", "1-effect2", "2-effect1", "2-effect2")
@pytest.mark.parametrize("effect", [*(refweb.Contact(**contact) for contact in CONTACTS), FRAME])
@pytest.mark.parametrize("seed", range(3))
def test_contract(effect, seed):
    """Forces and moments are slopes of the energy, tangents of both, with a slope of 2; momenta are kept."""
    system = touching(effect)
    net, bodies = system.net, system.net.bodies
    x, v = state(net, seed)
    d = 0.1 * np.random.default_rng(seed + 100).standard_normal(x.shape)
    spins, turns = ([getattr(body, name) for body in bodies] for name in ("spin", "turn"))
    steps, linear = np.array([2e-3, 1e-3, 5e-4, 2.5e-4]), len(net.points) - net.spins
    for term in system.terms:
        one = alone(system, term)
        f = one.force(0.0, x, v)
        if term.energy is not None:
            moved = d.copy()
            for body in bodies:
                rate = quaternion_rate(1.0 + x[body.turn, 0], *x[body.spin], d[body.spin])
                moved[body.turn, 0], moved[body.spin] = rate[0], rate[1:]
            h = 1e-5
            rate = (one.energy(0.0, x + h * moved) - one.energy(0.0, x - h * moved)) / (2.0 * h)
            work = np.delete(f * d, turns, axis=0).sum()
            assert rate == pytest.approx(-work, rel=1e-7, abs=1e-7 * np.abs(f * d).sum())
        else:
            w = v.copy()
            w[spins] = [body.turning(x, v) for body in bodies]
            (out,), power = one.forces(0.0, x, v)[1], (f * w).sum()
            expected = out[:, 0].sum() if term.balance.power is not None else 0.0
            assert power == pytest.approx(expected, rel=1e-12, abs=1e-13 * np.abs(f * w).sum()) and expected <= 0.0
        for dx, dv in ((d, 0.0 * d), (0.0 * d, d)):
            if (term.velocity.damping if dv.any() else term.tangent.stiffness) is None:
                continue
            values = one.stiffness(0.0, x, v) if dx.any() else one.damping(0.0, x, v)
            product = one.pattern.matrix(values) @ (dx + dv).ravel()[one.free]
            changes = [(one.force(0.0, x + h * dx, v + h * dv) - f).ravel()[one.free] for h in steps]
            left = [np.linalg.norm(change + h * product) for h, change in zip(steps, changes, strict=True)]
            assert abs(np.polyfit(np.log(steps), np.log(left), 1)[0] - 2.0) < 0.1 or left[-1] < 1e-6 * np.abs(f).sum()
        if not term.balance.internal:
            continue
        size = np.abs(f).sum()
        moment = np.cross(net.points + x, f)[:linear].sum(axis=0) + f[spins].sum(axis=0)
        assert max(np.abs(moment).max(), np.abs(f[:linear].sum(axis=0)).max()) <= 1e-14 * size and size > 0.0
        turn = Rotation.random(random_state=seed)
        there, q = x.copy(), np.roll(turn.as_quat(), 1)
        there[:linear] = turn.apply((net.points + x)[:linear]) + [3.0, -2.0, 1.0] - net.points[:linear]
        for body in bodies:
            p = np.array([1.0 + x[body.turn, 0], *x[body.spin]])
            there[body.turn, 0] = q[0] * p[0] - q[1:] @ p[1:] - 1.0
            there[body.spin] = q[0] * p[1:] + p[0] * q[1:] + np.cross(q[1:], p[1:])
        np.testing.assert_allclose(
            one.force(0.0, there, np.ascontiguousarray(turn.apply(v))), turn.apply(f), atol=1e-12 * size
        )


def test_rates_and_their_slopes():
    """q' = ½ ω q as implicit methods have it, and X and V of it."""
    system = touching(refweb.Contact(**CONTACTS[0]))
    rotations, (x, v) = Rotations(system), state(system.net, 1)
    n = len(system.free)

    def rates(x, v):
        found = v.ravel()[system.free].copy()
        rotations.set_rates(x, v, found)
        return found

    rotations.linearize(x, v)
    for body, row in zip(system.net.bodies, rotations.places, strict=True):
        q = quaternion_rate(1.0 + x[body.turn, 0], *x[body.spin], body.turning(x, v))
        np.testing.assert_allclose(rates(x, v)[row], q, rtol=1e-12)
    dx, dv = np.random.default_rng(2).standard_normal((2, *x.shape))
    h = 1e-5
    change = (rates(x + h * dx, v + h * dv) - rates(x - h * dx, v - h * dv)) / (2.0 * h)
    assert n == x.size
    expected = rotations.product(dx.ravel()[system.free], dv.ravel()[system.free])
    np.testing.assert_allclose(change, expected, rtol=0, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("mass", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("shape", [dict(CHEST, size=(2.0, 0.02, 0.3), rounding=0.01), dict(DRUM, length=3.0), PILL])
def test_bound_bounds(mass, shape):
    """2/ω of the tangent is never below the bound, of bodies that are thin and long as well."""
    for seed in range(4):
        system = touching(refweb.Contact(**CONTACTS[0]), [refweb.Body(**shape, position=(0.5, 0.5, 0.05), mass=mass)])
        (body,) = system.net.bodies
        x = 0.05 * np.random.default_rng(seed).standard_normal(system.net.points.shape)
        x[[body.spin, body.turn]] = 0.0
        K = system.pattern.matrix(system.stiffness(0.0, x)).toarray()
        inverse = np.diag(np.repeat(1.0 / system.net.mass, 3))
        at = 3 * body.spin + np.arange(3)
        inverse[np.ix_(at, at)] = body.axes.T @ np.linalg.inv(body.inertia) @ body.axes
        K[:, at] *= 0.5  # of angles: at the start a quaternion has half of them
        largest = np.linalg.eigvals(inverse @ K).real.max()
        assert CentralDifference(system).bound(x, reach=0.0) <= 2.0 / np.sqrt(largest) * (1.0 + 1e-12)


def bar(k, offset=0.2, speed=2.0, contact=None, **solve):
    """A box that comes down on one line that both ends hold, off its centre; its moments of inertia differ."""
    body = dict(name="box", shape="box", size=[1.0, 0.3, 0.2], mass=2.0, inertia=[0.05, 0.2, 0.24])
    body |= dict(position=[-offset, 0.0, 0.1 + 1e-3], velocity=[0.0, 0.0, -speed])
    return refweb.Scene.from_dict(
        {
            "web": {"kind": "inline", "points": [[0, -1, 0], [0, 1, 0]], "lines": [[0, 1]], "supports": [0, 1]},
            "cable": {"law": "linear", "modulus": 1e6, "area": 1e-4, "density": 1.0},
            "body": [body],
            "contact": {"stiffness": k, **(contact or {})},
            "solve": {"kind": "dynamic", "duration": 2e-3 + 5.0 * np.sqrt(1.0 / k), **solve},
            "output": {"interval": 1e-3 + 2.5 * np.sqrt(1.0 / k), "frames": 1},
            "accuracy": {"error": "none"},
        }
    )


def restitution(d, v):
    """e of Hunt and Crossley, d (v + e v) = ln((1 + d v)/(1 − d e v)), whatever the exponent and the masses."""
    if d == 0.0:
        return 1.0
    return brentq(lambda e: d * v * (1.0 + e) - np.log((1.0 + d * v) / (1.0 - d * e * v)), 1e-9, 1.0)


@pytest.mark.parametrize("d, exponent", [(0.0, 1), (0.4, 1), (0.4, 1.5)])
def test_an_eccentric_hit_of_rigid_bodies_is_the_limit(d, exponent):
    """J = (1 + e) v/(1/m + r²/I); what is left falls with the time of the contact, as k^(−1/2) or k^(−2/5)."""
    m, inertia, r, v = 2.0, 0.2, 0.2, 2.0
    J = (1.0 + restitution(d, v)) * v / (1.0 / m + r * r / inertia)
    stiffnesses, left = np.array([1e6, 1e7, 1e8]), []
    for k in stiffnesses:
        solution = refweb.run(bar(k, contact=dict(damping=d, exponent=exponent), safety=0.1))
        body, state = solution.state.system.net.bodies[0], solution.state
        spin = body.turning(state.x, state.v)
        np.testing.assert_allclose([spin[0], spin[2], state.v[2, 1]], 0.0, atol=1e-12)
        left.append(max(abs(state.v[2, 2] / (J / m - v) - 1.0), abs(-spin[1] / (J * r / inertia) - 1.0)))
        book = 1e-3 if d else 1e-4
        assert solution.solver["energy_drift"] < book
    rate = np.polyfit(np.log(stiffnesses), np.log(left), 1)[0]
    assert left[-1] < 2e-2 and rate < -0.35


def trap(**solve):
    """A box that two lines hold between them, from above and from below, and never leave: its motion is smooth."""
    points = [[-0.2, -1, 0.09], [-0.2, 1, 0.09], [0.1, -1, -0.09], [0.1, 1, -0.09], [0.3, -1, 0.09], [0.3, 1, 0.09]]
    body = dict(name="box", shape="box", size=[1.0, 1.4, 0.2], rounding=0.04, mass=2.0, position=[0.0, 0.0, 0.0])
    body |= dict(inertia=[0.1, 0.2, 0.24], velocity=[0.0, 0.02, 0.01], angular_velocity=[0.02, 0.05, 0.02])
    return refweb.Scene.from_dict(
        {
            "web": {"kind": "inline", "points": points, "lines": [[0, 1], [2, 3], [4, 5]], "supports": list(range(6))},
            "cable": {"law": "linear", "modulus": 1e6, "area": 1e-4, "density": 1.0},
            "body": [body],
            "contact": {"stiffness": 1e3},
            "solve": {"kind": "dynamic", "duration": 0.5, **solve},
            "output": {"interval": 0.5, "frames": 1},
            "accuracy": {"error": "none"},
        }
    )


@pytest.mark.parametrize("order", [2, 4, 6])
def test_explicit_orders(order):
    """Place, orientation and momenta of a body that is held by contact, against order 6 with small steps."""

    def end(**solve):
        state = refweb.run(trap(**solve)).state
        return np.concatenate([state.x.ravel(), state.v.ravel()])

    exact = end(method="explicit", order=6, step_size=0.5 / 800)
    keys = dict() if order == 2 else dict(method="explicit", order=order)
    steps = {2: (1000, 2000), 4: (400, 800), 6: (300, 400)}[order]
    errors = [np.linalg.norm(end(**keys, step_size=0.5 / n) - exact) for n in steps]
    found = np.log(errors[0] / errors[1]) / np.log(steps[1] / steps[0])
    assert found == pytest.approx(order, abs=0.4), errors


@pytest.fixture(scope="module")
def exact():
    return refweb.run(trap(method="explicit", order=6, step_size=0.5 / 400)).state


IMPLICIT = {
    "adams": dict(method="cvode", family="adams", rtol=1e-8),
    "cvode block": dict(method="cvode", rtol=1e-7, linear_solver="block"),
    "cvode sparse": dict(method="cvode", rtol=1e-7, linear_solver="sparse"),
    "ida block": dict(method="ida", rtol=1e-7, linear_solver="block"),
    "ida": dict(method="ida", rtol=1e-7),
}


@pytest.mark.ordinary("adams")
@pytest.mark.parametrize("name", IMPLICIT)
def test_implicit_methods_follow(name, exact):
    """CVODE and IDA, by each kind of linear solver, against explicit steps of order 6."""
    (body,) = exact.system.net.bodies
    state = refweb.run(trap(**IMPLICIT[name])).state
    error = 1e-7 if name == "adams" else 2e-5  # of order 2
    np.testing.assert_allclose(state.x, exact.x, rtol=0, atol=error)
    np.testing.assert_allclose(state.v, exact.v, rtol=0, atol=60 * error)
    q = [1.0 + state.x[body.turn, 0], *state.x[body.spin]]
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-15)


def caught(friction=0.3, **changes):
    """A web that is free and meets a tumbling box, in front of a capsule."""
    box = dict(name="box", shape="box", size=[0.3, 0.2, 0.15], rounding=0.02, density=100.0, position=[0.05, 0.0, -0.2])
    box |= dict(velocity=[0.0, 0.0, 5.0], angular_velocity=[8.0, -5.0, 3.0])
    pill = dict(
        name="pill", shape="capsule", radius=0.05, length=0.2, axis=[1, 1, 0], mass=0.5, position=[0.2, 0.1, 0.3]
    )
    tables = {
        "web": {"kind": "window", "mesh": "square", "rows": 6, "columns": 6, "side": 0.15},
        "cable": {"law": "tension-only", "modulus": 1e6, "area": 1e-5, "density": 1000.0},
        "supports": {"nodes": []},
        "body": [box, pill],
        "contact": {"stiffness": 1e4, "friction": friction},
        "solve": {"kind": "dynamic", "duration": 0.06},
        "output": {"interval": 5e-3, "frames": 4},
        "accuracy": {"error": "none"},
        "observe": [
            {"name": "w", "quantity": "orientation", "body": "box", "component": "w"},
            {"name": "angle", "quantity": "orientation", "body": "box"},
            {"name": "spin", "quantity": "angular_velocity", "body": "box", "reduce": "max"},
            {"name": "L", "quantity": "angular_momentum", "body": "box", "component": "x"},
        ],
    }
    return refweb.Scene.from_dict(tables | changes)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_books_of_a_capture_close(friction, tmp_path):
    """Momentum and angular momentum to rounding, energy by the order; frames show the box as it is turned."""
    drifts = []
    for safety in (0.4, 0.2):
        solve = {"kind": "dynamic", "duration": 0.06, "safety": safety}
        solution = refweb.run(caught(friction, solve=solve), tmp_path / f"{safety}")
        drifts.append(solution.solver["energy_drift"])
        assert solution.solver["momentum_drift"] < 1e-12 and solution.solver["angular_momentum_drift"] < 1e-12
    assert drifts[1] < drifts[0] < 5e-3
    state, body = solution.state, solution.state.system.net.bodies[0]
    assert state.overlap(body).max() > 0.0 or solution.history["contact_energy"].max() > 0.0
    drawn = meshio.read(tmp_path / "0.2" / "frames" / f"box_{12:06d}.vtu")
    R, centre = body.rotation(state.x), state.position[body.row]
    start, _ = body.surface(state.system.net.points[body.row])
    np.testing.assert_allclose(drawn.points, centre + (start - state.system.net.points[body.row]) @ R.T, atol=1e-12)
    np.testing.assert_allclose(drawn.points - drawn.point_data["displacement"], start, atol=1e-12)
    found = {name: result.value for name, result in solution.results.items()}
    angle = np.linalg.norm(Rotation.from_matrix(R).as_rotvec())
    assert found["angle"] == pytest.approx(angle, abs=1e-7) and abs(found["w"]) == pytest.approx(np.cos(angle / 2))
    assert found["L"] == pytest.approx(body.moment * state.v[body.spin, 0]) and found["spin"] >= np.sqrt(98.0) - 1e-9
    np.testing.assert_allclose(solution.history["spin"][0], np.sqrt(98.0), rtol=1e-12)


def test_a_resumed_capture_is_the_same(tmp_path):
    whole, resumed = nets.whole_and_resumed(caught(), tmp_path)
    np.testing.assert_array_equal(resumed.state.x, whole.state.x)
    np.testing.assert_array_equal(resumed.state.v, whole.state.v)


def test_both_faces_of_observables_agree():
    """Probe and value, of bodies that turn, one that is fixed and a ring."""
    ring = refweb.Body(name="ring", shape="ring", radius=0.2, normal=(1, 2, 2), mass=1.0, position=(5.0, 0, 0))
    ring = type(ring)(**{**ring.to_dict(), "angular_velocity": [1, 2, 2]})
    wall = refweb.Body(
        name="wall", shape="box", size=(1, 1, 1), position=(9.0, 0, 0), fixed=True, orientation=(1, 1, 0, 0)
    )
    system = touching(refweb.Contact(**CONTACTS[0]), [*BODIES, ring, wall])
    tumbling = [body for body in system.net.bodies if body.turn is not None]
    x, v = np.random.default_rng(0).standard_normal((2, system.rows, 3))
    x[tumbling[0].spin], x[tumbling[0].turn] = [0.1, -0.7, 0.1], [-0.3, 0.0, 0.0]
    state_ = refweb.results.state.State(system, 0.0, x, v)
    for quantity in ("orientation", "angular_velocity", "angular_momentum"):
        for body in system.net.bodies:
            for component in (None, "x", "y", "z", *("w" * (quantity == "orientation"))):
                observe = refweb.Observe(name="_", quantity=quantity, body=body.name, component=component)
                observe.on(system)
                probe = observe.probe(system)
                rows, data = np.array(probe.rows, dtype=np.int64), np.ascontiguousarray(probe.data, dtype=float)
                found = probe.kernel(0.0, x, v, x, x, rows, data, np.array([-1, 1]))
                assert found == pytest.approx(observe.value(state_).value, rel=1e-13, abs=1e-14)
    for body in system.net.bodies:  # the quaternion is that of the axes as they are
        parts = [refweb.Observe(name="_", quantity="orientation", body=body.name, component=c) for c in "xyzw"]
        quaternion = [part.value(state_).value for part in parts]
        axes = body.axes @ body.rotation(x).T
        np.testing.assert_allclose(Rotation.from_quat(quaternion).as_matrix(), axes.T, atol=1e-12)


BOX = dict(name="it", shape="box", size=[1, 2, 3], mass=1.0, position=[0, 0, 0])
REFUSED = [
    (
        dict(BOX, mass=None, velocity=[1, 0, 0]),
        r"mass is missing: a free body needs mass = ... \[kg\] or density = ...",
    ),
    (dict(BOX, density=2.0), "mass = 1 and density = 2 exclude each other"),
    (dict(BOX, inertia=0.0), r"inertia = 0.0 must be > 0 \[kg m²\]"),
    (dict(BOX, inertia=[1, 2]), r"inertia = \[1, 2\] must be a number, three, or 3 rows of 3"),
    (dict(BOX, inertia=[1, 2, 4]), r"inertia = .* is no body's: the largest principal moment 4 must be ≤ 3"),
    (dict(BOX, inertia=[1, 2, -3]), "inertia = .* must be positive definite"),
    (dict(BOX, inertia=[[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]), "inertia = .* must be symmetric"),
    (dict(BOX, orientation=[0, 0, 0, 0]), "orientation = .* must not be zero"),
    (dict(BOX, orientation=[1, 0, 0]), r"orientation = .* must be a quaternion \[w, x, y, z\], not 3 numbers"),
    (dict(BOX, orientation=[1, 0, 0, 0], axes=[[1, 0, 0], [0, 1, 0]]), "orientation = .* and axes exclude each other"),
    (dict(BOX, shape="capsule", size=None, radius=1, length=1), "axis is missing: give axis = ... or orientation"),
    (dict(BOX, shape="ring", size=None, radius=1, normal=[0, 0, 1], inertia=[1, 1, 2]), "must be a number for shape"),
    (dict(BOX, shape="ring", size=None, radius=1, normal=[0, 0, 1], mass=None, density=1), "density has no meaning"),
]


@pytest.mark.parametrize("given, message", REFUSED)
def test_its_keys_are_checked(given, message):
    with pytest.raises(refweb.InputError, match=message):
        refweb.Body(**{key: value for key, value in given.items() if value is not None})


def test_tables_are_written_and_read():
    for body in BODIES:
        again = refweb.Body(**body.to_dict())
        assert again.to_dict() == body.to_dict()
    box = refweb.Body(**{**BOX, "mass": None, "density": 10.0, "orientation": [2.0, 0.0, 0.0, 2.0]})
    (found,) = box.extend(nets.skew_net()).bodies
    np.testing.assert_allclose(found.axes, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-15)
    assert box.extend(nets.skew_net()).mass[-1] == pytest.approx(60.0, rel=1e-3)  # its edges are round


def alone_in(tables, end, omega, inertia=(1.0, 2.0, 2.5), **more):
    """The state of a box alone after a time, beside one line that is held."""
    box = dict(BOX, inertia=list(inertia), angular_velocity=list(omega), **more)
    scene = {
        "web": {"kind": "inline", "points": [[9, 0, 0], [9, 1, 0]], "lines": [[0, 1]], "supports": [0, 1]},
        "cable": {"law": "linear", "modulus": 1e6, "area": 1e-4, "density": 1.0},
        "body": [box],
        "output": {"interval": end, "frames": 1},
        "accuracy": {"error": "none"},
    }
    return refweb.run(refweb.Scene.from_dict(scene | tables)).state


@pytest.mark.parametrize("solve", [dict(method="cvode", family="adams", rtol=1e-9), dict(step_size=5e-4)])
def test_a_free_rotor_in_a_frame_is_that_outside(solve):
    """Seen from axes that turn by Ωt it has turned by the inverse of that besides, and by Ω less at the start."""
    frame, omega, end = np.array([0.3, -0.5, 0.7]), np.array([1.0, 0.5, -0.8]), 1.5
    solve = {"kind": "dynamic", "duration": end, **solve}
    outside = alone_in({"solve": {"kind": "dynamic", "duration": end}}, end, omega)
    inside = alone_in({"solve": solve, "frame": {"angular_velocity": frame.tolist()}}, end, omega - frame)
    back = Rotation.from_rotvec(-end * frame).as_matrix()
    rotations = [state.system.net.bodies[0].rotation(state.x) for state in (outside, inside)]
    spins = [state.system.net.bodies[0].turning(state.x, state.v) for state in (outside, inside)]
    within = 1e-6 if "rtol" in solve else 1e-5
    np.testing.assert_allclose(rotations[1], back @ rotations[0], rtol=0, atol=within)
    np.testing.assert_allclose(spins[1], back @ (spins[0] - frame), rtol=0, atol=within)


def test_a_satellite_librates():
    """About the normal of its orbit with n √(3 (Iy − Ix)/Iz), for small angles (x to the Earth, y along the track)."""
    n, inertia, angle = 1e-3, (1.0, 2.0, 2.5), 1e-3
    rate = n * np.sqrt(3.0 * (inertia[1] - inertia[0]) / inertia[2])
    quarter = 0.5 * np.pi / rate
    tables = {
        "orbit": {"mean_motion": n},
        "solve": {"kind": "dynamic", "duration": quarter, "step_size": quarter / 2000},
    }
    tilted = {"orientation": [1.0, 0.0, 0.0, 0.5 * angle]}
    state = alone_in(tables, quarter, (0.0, 0.0, 0.0), inertia, **tilted)
    body = state.system.net.bodies[0]
    assert body.turning(state.x, state.v)[2] == pytest.approx(-angle * rate, rel=1e-5)
    along = (body.axes @ body.rotation(state.x).T)[0]
    assert abs(along[1]) < 1e-5 * angle


def test_a_capsule_moves_as_a_cylinder_with_caps():
    """In a net that it falls into: the same body, described twice."""
    ends = []
    for shape in (dict(shape="capsule", length=0.2), dict(shape="cylinder", length=0.36, rounding=0.08)):
        pill = refweb.Body(
            name="pill", radius=0.08, mass=0.3, position=(0.03, 0.02, -0.14), velocity=(0.0, 0.0, 2.0),
            angular_velocity=(3.0, 5.0, 1.0), axis=(1.0, 0.3, 0.2), **shape,
        )  # fmt: skip
        scene = refweb.Scene(
            web=refweb.Window(mesh="square", rows=4, columns=4, side=0.25),
            cable=refweb.Cable(law="tension-only", modulus=1e6, area=1e-6, density=1000.0),
            effects=[pill, refweb.Contact(stiffness=2e3)],
            solve=refweb.Dynamic(duration=0.15),
            accuracy=refweb.Accuracy(error="none"),
        )
        solution = refweb.run(scene)
        ends.append(solution.state)
        assert solution.bodies["pill"]["overlap"] > 1e-3  # it is caught
    np.testing.assert_allclose(ends[1].x, ends[0].x, rtol=0, atol=1e-9)
    np.testing.assert_allclose(ends[1].v, ends[0].v, rtol=0, atol=1e-7)


@pytest.mark.parametrize("seed", range(8))
def test_lever_of_a_body_is_at_least_that_of_any_push(seed):
    """√(I (y × g)·J⁻¹(y × g)) of all corners of a box and of random directions g, and within 2 of the largest."""
    rng = np.random.default_rng(seed)
    big = np.sort(rng.uniform(0.2, 1.0, 3))
    turn = Rotation.random(random_state=seed).as_matrix()
    tensor = turn @ np.diag([big[0], big[1], min(big[2], big[0] + big[1])]) @ turn.T
    size = rng.uniform(0.1, 1.0, 3)
    body = RigidBody("it", 0, Box(size=tuple(size)), (0, 0, 0), False, np.eye(3), tensor, (0, 0, 0), True, 1, 2)
    corners = 0.5 * size * np.array(list(itertools.product((-1, 1), repeat=3)))
    directions = rng.standard_normal((500, 3))
    arms = np.cross(corners[:, None], directions / np.linalg.norm(directions, axis=1)[:, None]).reshape(-1, 3)
    largest = np.sqrt((arms @ body.mobility * arms).sum(axis=1).max())
    assert largest <= lever(body) <= 2.0 * largest
