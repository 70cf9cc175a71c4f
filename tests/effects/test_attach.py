"""Nodes that bodies carry: closed forms, an independent program, tangents, bounds, books, orders, refusals."""

import meshio
import nets
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import refweb
from refweb.dynamics.initial_state import equilibrium
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.dynamics.integrators.rotations import Rotations
from refweb.effects.elasticity import Elasticity
from refweb.net.rotation import quaternion_rate
from refweb.runner import notices
from refweb.system.static_system import at_rest
from refweb.system.system import System
from validation.methods.as_constraint import Tied

CHEST = dict(
    name="chest", shape="box", size=(0.6, 0.5, 0.7), rounding=0.2, mass=0.5, position=(0.9, 0.7, -0.2),
    orientation=(1.0, 0.2, -0.1, 0.4), inertia=(0.04, 0.03, 0.05), angular_velocity=(1.0, -2.0, 0.5),
)  # fmt: skip
BALL = dict(name="ball", radius=0.3, mass=0.3, position=(0.3, 0.2, 0.4), velocity=(0.0, 1.0, 0.0))
EFFECTS = [
    refweb.Body(**CHEST),
    refweb.Body(**BALL),
    refweb.Attach(body="chest", node=4),
    refweb.Attach(body="chest", node=2, point=(0.3, 0.2, -0.4)),
    refweb.Attach(body="ball", node=1, point=(0.0, 0.3, 0.0)),
]


def carrying(*effects):
    net = nets.skew_net("linear")
    return System(net, [Elasticity(), *EFFECTS, *effects], np.zeros((len(net.points), 3), dtype=bool))


def state(system, seed, near=0.05):
    """A state with any rotations, the nodes where bodies take them."""
    rng = np.random.default_rng(seed)
    x, v = near * rng.standard_normal((system.rows, 3)), rng.standard_normal((system.rows, 3))
    for body in system.net.bodies:
        q = rng.standard_normal(4)
        x[body.turn], x[body.spin] = [q[0] - 1.0, 0.0, 0.0], q[1:]
    system.drive(0.0, x, v)
    return x, v


def test_mass_and_inertia_are_those_of_body_and_nodes():
    """Kinetic energy, momentum and angular momentum, of a body and of points of mass on it, however it moves."""
    bare = nets.skew_net("linear")
    system = carrying()
    net, (x, v) = system.net, state(carrying(), 0)
    assert net.mass.sum() - net.mass[-net.spins :].sum() == pytest.approx(bare.mass.sum() + 0.8, rel=1e-14)
    for given, body in zip((CHEST, BALL), net.bodies, strict=True):
        nodes, R, omega = list(body.carried), body.rotation(x), body.turning(x, v)
        mass, tensor = bare.mass[nodes], np.diag(given.get("inertia", [0.4 * 0.3 * 0.3**2] * 3))
        centre, arm = net.points[body.row] + x[body.row], R @ (body.offset @ body.axes)  # to the centre of the shape
        axes, place = body.axes @ R.T, (net.points + x)[nodes]
        own = v[body.row] + np.cross(omega, arm)
        energy = 0.5 * given["mass"] * own @ own + 0.5 * omega @ axes.T @ tensor @ axes @ omega
        energy += (0.5 * mass * (v[nodes] ** 2).sum(axis=1)).sum()
        L = axes.T @ tensor @ axes @ omega + given["mass"] * np.cross(arm, own)
        L = L + (mass[:, None] * np.cross(place - centre, v[nodes])).sum(axis=0)
        found = 0.5 * net.mass[body.row] * v[body.row] @ v[body.row] + 0.5 * body.moment * omega @ v[body.spin]
        np.testing.assert_allclose(found, energy, rtol=1e-13)
        np.testing.assert_allclose(body.moment * v[body.spin], L, rtol=0, atol=1e-13 * np.abs(L).max())
        whole = given["mass"] * own + mass @ v[nodes]
        np.testing.assert_allclose(net.mass[body.row] * v[body.row], whole, rtol=0, atol=1e-13)
    start = system.initial_velocity()
    system.drive(0.0, (x := np.zeros_like(x)), start)
    chest = net.bodies[0]
    np.testing.assert_allclose(chest.turning(x, start), CHEST["angular_velocity"], atol=1e-14)
    there = net.points[chest.row] + chest.offset @ chest.axes
    np.testing.assert_allclose(there, CHEST["position"], atol=1e-15)
    own = start[chest.row] + np.cross(CHEST["angular_velocity"], there - net.points[chest.row])
    np.testing.assert_allclose(own, 0.0, atol=1e-14)  # its centre is at rest, as given
    np.testing.assert_allclose(x[4], 0.0, atol=0.0)  # which the body takes where it is
    point = chest.axes.T @ [0.3, 0.2, -0.4] + CHEST["position"]
    np.testing.assert_allclose((net.points + x)[2], point, atol=1e-15)


MORE = [
    [],
    [refweb.Damping(time=0.02)],
    [refweb.Contact(stiffness=1e3)],
    [refweb.Contact(stiffness=1e3, exponent=1.5, damping=0.1, friction=0.4, slip_velocity=2.0)],
    [refweb.Drag(density=20.0, diameter=0.05, wind=(1.0, 2.0, -3.0), bodies={"chest": {"coefficient": 1, "area": 1}})],
]


@pytest.mark.parametrize("effects", MORE)
@pytest.mark.parametrize("seed", range(2))
def test_contract(effects, seed):
    """Forces are slopes of the energy along motions of the bodies; tangents have Taylor remainders of order 2."""
    system = carrying(*effects)
    bodies, free = system.net.bodies, system.free
    x, v = state(system, seed)
    d = 0.1 * np.random.default_rng(seed + 100).standard_normal(x.shape)
    turns = [body.turn for body in bodies]

    def placed(x, v=None):
        x, v = x.copy(), np.zeros_like(x) if v is None else v.copy()
        system.drive(0.0, x, v)
        return x, v

    conservative = [term for term in system.terms if term.energy is not None]
    f = sum(system.force_of(term, 0.0, x, v) for term in conservative)
    raw, (moved, rate) = f.copy(), (d.copy(), d.copy())
    for body in bodies:
        q = quaternion_rate(1.0 + x[body.turn, 0], *x[body.spin], d[body.spin])
        moved[body.turn], moved[body.spin] = [q[0], 0.0, 0.0], q[1:]
        omega = d[body.spin]
        for node, point in zip(body.carried, body.points, strict=True):
            arm = body.rotation(x) @ (point @ body.axes)
            f[body.row] += raw[node]
            f[body.spin] += np.cross(arm, raw[node])
            rate[node] = d[body.row] + np.cross(omega, arm)
    energy = lambda h: sum(  # noqa: E731
        system.energy_of(term, 0.0, placed(x + h * moved)[0]).sum() for term in conservative
    )
    slope = (energy(1e-5) - energy(-1e-5)) / 2e-5
    work = np.delete(np.where(system.supported, 0.0, f * d), turns, axis=0).sum()
    assert slope == pytest.approx(-work, rel=1e-6, abs=1e-7 * np.abs(f * d).sum())
    steps = np.array([2e-3, 1e-3, 5e-4, 2.5e-4]) * 0.5
    whole = system.force(0.0, x, v)
    for dx, dv in ((d, 0.0 * d), (0.0 * d, d)):
        values = system.stiffness(0.0, x, v) if dx.any() else system.damping(0.0, x, v)
        if values is None:
            continue
        product = system.pattern.matrix(values) @ (dx + dv).ravel()[free]
        changes = [(system.force(0.0, *placed(x + h * dx, v + h * dv)) - whole).ravel()[free] for h in steps]
        left = [np.linalg.norm(change + h * product) for h, change in zip(steps, changes, strict=True)]
        assert abs(np.polyfit(np.log(steps), np.log(left), 1)[0] - 2.0) < 0.1 or left[-1] < 1e-6 * np.abs(f).sum()


@pytest.mark.parametrize("mass", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("size", [(0.6, 0.5, 0.7), (2.0, 0.02, 0.3), (0.01, 0.01, 0.01)])
def test_bound_bounds(mass, size):
    """2/ω of the tangent is never below the bound, of nodes far from the body and in it, of light and heavy ones."""
    net = nets.skew_net("linear")
    effects = [refweb.Body(name="b", shape="box", size=size, mass=mass, position=(0.5, 0.5, 0.05))]
    for node, point in ((4, (0.5, 0.1, 0.0)), (2, (-0.02, 0.01, 0.0)), (0, None)):
        effects.append(refweb.Attach(body="b", node=node, point=point))
        system = System(net, [Elasticity(), *effects], np.zeros((len(net.points), 3), dtype=bool))
        (body,) = system.net.bodies
        x = np.zeros((system.rows, 3))
        system.drive(0.0, x)
        K = system.pattern.matrix(system.stiffness(0.0, x)).toarray()
        number = np.full(x.size, -1)
        number[system.free] = np.arange(len(system.free))
        inverse = np.diag(1.0 / np.repeat(system.net.mass, 3)[system.free])
        at = number[3 * body.spin + np.arange(3)]
        inverse[np.ix_(at, at)] = body.axes.T @ np.linalg.inv(body.inertia) @ body.axes
        K[:, at] *= 0.5  # of angles: at the start a quaternion has half of them
        largest = np.linalg.eigvals(inverse @ K).real.max()
        bound = CentralDifference(system).bound(x, reach=0.0)
        assert 0.25 * 2.0 / np.sqrt(largest) < bound <= 2.0 / np.sqrt(largest) * (1.0 + 1e-12)


L, A, C, MASS, G = 0.8, 0.3, 0.1, 1.5, 9.81
TENSOR = (0.03, 0.06, 0.05)


def hung(velocity, spin, duration, **solve):
    """A box on two vertical lines that end in its upper face, at ±A along x and C above its centre."""
    points = [[-A, 0, L + C], [A, 0, L + C], [-A, 0, C], [A, 0, C]]
    box = dict(name="box", shape="box", size=[0.8, 0.3, 0.2], mass=MASS, inertia=TENSOR, position=[0, 0, 0])
    return refweb.Scene.from_dict(
        {
            "web": {"kind": "inline", "points": points, "lines": [[0, 2], [1, 3]], "supports": [0, 1]},
            "cable": {"law": "linear", "modulus": 1e11, "area": 1e-4, "density": 0.0},
            "gravity": {"acceleration": [0.0, 0.0, -G]},
            "body": [{**box, "velocity": velocity, "angular_velocity": spin}],
            "attach": [{"body": "box", "node": [2, 3]}],
            "solve": {"kind": "dynamic", "duration": duration, **solve},
            "output": {"interval": duration, "frames": 1},
            "accuracy": {"error": "none"},
        }
    )


def test_a_box_on_two_lines_swings_as_a_bifilar_and_as_a_compound_pendulum():
    """Small oscillations: along the lines' plane with √(g/L), about the vertical with √(m g A²/(I L)), and across it,
    where both the lines and the box turn, by 2 × 2 matrices; what is small besides is
    the amplitude, of 1e-5, and by how much the lines are stretched, 8e-7."""
    along, about = np.sqrt(G / L), np.sqrt(MASS * G * A**2 / (TENSOR[2] * L))
    end, small = 0.9, 1e-5
    # Across: y of the centre, and the angle φ about x; the lines end at y − C φ.
    K = MASS * G / L * np.array([[1.0, -C], [-C, C * C + C * L]])
    modes, vectors = np.linalg.eig(np.linalg.solve(np.diag([MASS, TENSOR[0]]), K))
    start = np.array([small, 0.3 * small])
    share = np.linalg.solve(vectors, start)
    across = vectors @ (share * np.sin(np.sqrt(modes) * end) / np.sqrt(modes))
    found = refweb.run(hung([small, start[0], 0.0], [start[1], 0.0, small], end, safety=0.9)).state
    (body,) = found.system.net.bodies
    angle = Rotation.from_matrix(body.rotation(found.x)).as_rotvec()
    expected = [small * np.sin(along * end) / along, across[0], across[1], small * np.sin(about * end) / about]
    np.testing.assert_allclose([*found.x[body.row, :2], angle[0], angle[2]], expected, rtol=0, atol=2e-5 * small)


def hub(**solve):
    """A hub that spins with two arms at its rim, taut and a little out of balance, one of them bent."""
    R = 0.2
    points = [[R, 0, 0], [R + 0.5, 0, 0], [R + 1.0, 0.1, 0], [0, -R, 0.05], [0, -R - 0.5, 0.05], [0, -R - 1.0, 0.05]]
    hub = dict(name="hub", shape="cylinder", radius=R, length=0.1, axis=[0, 0, 1], mass=1.0, position=[0, 0, 0])
    tables = {
        "web": {"kind": "inline", "points": points, "lines": [[0, 1], [1, 2], [3, 4], [4, 5]]},
        "cable": {"law": "linear", "modulus": 1e6, "area": 1e-4, "density": 1000.0},
        "supports": {"nodes": []},
        "point_mass": [{"node": [2, 5], "mass": 0.1}],
        "body": [{**hub, "angular_velocity": [0.5, 0.0, 5.0]}],
        "attach": [{"body": "hub", "node": [0, 3]}],
        "velocity": [{"node": "all", "spin": [0.5, 0.0, 5.0]}],
        "solve": {"kind": "dynamic", "duration": 0.2, **solve},
        "output": {"interval": 0.1, "frames": 2},
        "accuracy": {"error": "none"},
    }
    return refweb.Scene.from_dict(tables)


def ends(solution):
    return np.concatenate([solution.state.x.ravel(), solution.state.v.ravel()])


@pytest.fixture(scope="module")
def exact():
    return ends(refweb.run(hub(method="explicit", order=6, step_size=0.2 / 400)))


@pytest.mark.parametrize("order", [2, 4, 6])
def test_explicit_orders(order, exact):
    """Orders are fitted; momentum and angular momentum close to rounding, that of the hub and its nodes included."""
    keys = dict() if order == 2 else dict(method="explicit", order=order)
    counts = {2: (100, 200), 4: (40, 80), 6: (30, 45)}[order]
    found = [refweb.run(hub(**keys, step_size=0.2 / n)) for n in counts]
    errors = [np.linalg.norm(ends(one) - exact) for one in found]
    assert np.log(errors[0] / errors[1]) / np.log(counts[1] / counts[0]) == pytest.approx(order, abs=0.3), errors
    for one in found:
        assert one.solver["momentum_drift"] < 1e-13 and one.solver["angular_momentum_drift"] < 1e-13
    assert found[1].solver["energy_drift"] < found[0].solver["energy_drift"] < 1e-2


@pytest.mark.ordinary("keys1", "keys4")
@pytest.mark.parametrize(
    "keys",
    [
        dict(method="cvode", family="adams", rtol=1e-10),
        dict(method="cvode", rtol=1e-7, linear_solver="block"),
        dict(method="cvode", rtol=1e-7, linear_solver="sparse"),
        dict(method="ida", rtol=1e-7, linear_solver="block"),
        dict(method="ida", rtol=1e-7),
    ],
)
def test_implicit_methods_follow(keys, exact):
    found = refweb.run(hub(**keys))
    np.testing.assert_allclose(ends(found), exact, rtol=0, atol=1e-7 if "family" in keys else 2e-3)
    assert found.solver["angular_momentum_drift"] < 1e-5


def test_another_program_finds_the_same(exact):
    """DOP853 of scipy on Newton's and Euler's equations of the hub with points of mass on it, written here."""
    solution = refweb.run(hub(method="explicit", order=6, step_size=0.2 / 400))
    R, k, mass = 0.2, 100.0, np.array([0.025, 0.05, 0.125, 0.025, 0.05, 0.125])
    points = np.array(
        [[R, 0, 0], [R + 0.5, 0, 0], [R + 1.0, 0.1, 0], [0, -R, 0.05], [0, -R - 0.5, 0.05], [0, -R - 1.0, 0.05]]
    )
    lines, free = np.array([[0, 1], [1, 2], [3, 4], [4, 5]]), [1, 2, 4, 5]
    length = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
    weight = 0.05 * length  # of half a line; the second line is a little longer
    mass = np.bincount(lines.ravel(), np.repeat(weight, 2)) + [0, 0, 0.1, 0, 0, 0.1]
    tensor = refweb.Body(
        name="hub", shape="cylinder", radius=R, length=0.1, axis=[0, 0, 1], mass=1.0, position=[0, 0, 0]
    ).form.inertia(1.0)
    total = 1.0 + mass[0] + mass[3]
    centre = (mass[0] * points[0] + mass[3] * points[3]) / total
    arms = points[[0, 3]] - centre

    def about(m, p):
        return m * (p @ p * np.eye(3) - np.outer(p, p))

    J = tensor + about(1.0, centre) + about(mass[0], arms[0]) + about(mass[3], arms[1])

    def rate(t, y):
        c, q, vc, w = y[:3], y[3:7], y[7:10], y[10:13]  # w along the axes of the body
        x, v = points.copy(), np.zeros((6, 3))
        x[free], v[free] = y[13:25].reshape(4, 3), y[25:].reshape(4, 3)
        turn = Rotation.from_quat(q).as_matrix()
        x[[0, 3]] = c + arms @ turn.T
        d = x[lines[:, 1]] - x[lines[:, 0]]
        size = np.linalg.norm(d, axis=1)
        pull = (k / length * (size - length) / size)[:, None] * d
        f = np.zeros((6, 3))
        np.add.at(f, lines[:, 0], pull)
        np.add.at(f, lines[:, 1], -pull)
        moment = turn.T @ np.cross(x[[0, 3]] - c, f[[0, 3]]).sum(axis=0)
        turning = 0.5 * np.array(
            [
                q[3] * w[0] + q[1] * w[2] - q[2] * w[1],
                q[3] * w[1] + q[2] * w[0] - q[0] * w[2],
                q[3] * w[2] + q[0] * w[1] - q[1] * w[0],
                -q[:3] @ w,
            ]
        )
        spun = np.linalg.solve(J, moment - np.cross(w, J @ w))
        return np.concatenate(
            [vc, turning, f[[0, 3]].sum(axis=0) / total, spun, v[free].ravel(), (f[free] / mass[free, None]).ravel()]
        )

    omega = np.array([0.5, 0.0, 5.0])
    start = [centre, [0, 0, 0, 1], np.cross(omega, centre), omega]
    start = np.concatenate([*start, points[free].ravel(), np.cross(omega, points[free]).ravel()])
    end = solve_ivp(rate, (0.0, 0.2), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    body, found = solution.state.system.net.bodies[0], solution.state
    np.testing.assert_allclose(found.position[free], end[13:25].reshape(4, 3), rtol=0, atol=1e-9)
    turn = Rotation.from_quat(end[3:7]).as_matrix()
    np.testing.assert_allclose(body.rotation(found.x), turn, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.position[[0, 3]], end[:3] + arms @ turn.T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(body.turning(found.x, found.v), turn @ end[10:13], rtol=0, atol=1e-7)


@pytest.mark.ordinary("1e-06-1e-06-0.0001")
@pytest.mark.parametrize("rtol, place, speed", [(1e-6, 1e-6, 1e-4), (1e-9, 2e-9, 5e-8)])
def test_constraints_in_place_of_elimination_find_the_same(rtol, place, speed):
    """IDA on nodes with masses of their own and multipliers, `validation.methods.as_constraint`: errors go with its
    tolerance. They are no more than some ten of its errors a step, of 2 m and 10 m/s."""
    x, v, off, sliding = Tied(hub()).solve(0.2, rtol)
    solution = refweb.run(hub(method="explicit", order=6, step_size=0.2 / 400))
    np.testing.assert_allclose(x[:6], solution.state.x[:6], rtol=0, atol=place)
    np.testing.assert_allclose(v[:6], solution.state.v[:6], rtol=0, atol=speed)
    (own,), (other,) = solution.state.system.net.bodies, Tied(hub()).system.net.bodies
    np.testing.assert_allclose(other.rotation(x), own.rotation(solution.state.x), rtol=0, atol=5.0 * place)
    np.testing.assert_allclose(other.turning(x, v), own.turning(solution.state.x, solution.state.v), atol=5.0 * speed)
    assert off < 1e-9 and sliding < 1e-6


def bridled(**tables):
    """A box on a bridle of four tethers, which tumbles, wraps itself in them, and is damped."""
    corners = [[0.15, 0.1, 0.1], [-0.15, 0.1, 0.1], [0.15, -0.1, 0.1], [-0.15, -0.1, 0.1]]
    points = [*corners, [0, 0, 0.5], [0, 0, 1.0]]
    sat = dict(name="satellite", shape="box", size=[0.3, 0.2, 0.2], rounding=0.01, mass=2.0, position=[0, 0, 0])
    given = {
        "web": {"kind": "inline", "points": points, "lines": [[0, 4], [1, 4], [2, 4], [3, 4], [4, 5]], "supports": [5]},
        "cable": {"law": "tension-only", "modulus": 1e6, "area": 1e-5, "density": 1000.0, "subdivide": 4},
        "body": [{**sat, "velocity": [0.5, 0.2, 0.0], "angular_velocity": [3.0, -2.0, 1.0]}],
        "attach": [{"body": "satellite", "node": [0, 1, 2, 3]}],
        "contact": {"stiffness": 1e4},
        "gravity": {"acceleration": [0.0, 0.0, -9.81]},
        "damping": {"time": 1e-4},
        "observe": [
            {"name": "tie", "quantity": "reaction", "node": 0},
            {"name": "pushed", "quantity": "reaction", "body": "satellite"},
            {"name": "going", "quantity": "velocity", "node": 1, "reduce": "max"},
        ],
        "solve": {"kind": "dynamic", "duration": 0.3},
        "output": {"interval": 0.03, "frames": 3},
        "accuracy": {"error": "none"},
    }
    return refweb.Scene.from_dict(given | tables)


@pytest.mark.slow
def test_books_of_a_bridle_close(tmp_path):
    """Energy by the order, momentum to rounding; both faces of observables agree; frames have the nodes at the box."""
    drifts = []
    for safety in (0.5, 0.25):
        solution = refweb.run(
            bridled(solve={"kind": "dynamic", "duration": 0.3, "safety": safety}), tmp_path / "out", force=True
        )
        drifts.append(solution.solver["energy_drift"])
        assert solution.solver["momentum_drift"] < 1e-12
    assert drifts[1] < 0.4 * drifts[0] < 1e-3 and solution.history["dissipated_energy"][-1] > 0.0
    state, (body,) = solution.state, solution.state.system.net.bodies
    for name, value in (("tie", state.reaction[0]), ("pushed", state.reaction[body.row])):
        assert solution.history[name][-1] == pytest.approx(np.linalg.norm(value), rel=1e-6, abs=1e-6)
    drawn = meshio.read(sorted((tmp_path / "out" / "frames").glob("web_*.vtu"))[-1])
    shape = meshio.read(sorted((tmp_path / "out" / "frames").glob("satellite_*.vtu"))[-1])
    centre = state.position[body.row] + body.rotation(state.x) @ (body.offset @ body.axes)
    far = np.linalg.norm(drawn.points[:4] - centre, axis=1)
    np.testing.assert_allclose(far, np.linalg.norm([0.15, 0.1, 0.1]), rtol=1e-12)
    nearest = np.linalg.norm(shape.points[:, None] - drawn.points[:4], axis=2).min(axis=0)
    assert nearest.max() < 0.02  # of the rounded corner
    assert not drawn.point_data["support"][:4].any()


@pytest.mark.slow
def test_methods_agree_on_a_bridle():
    solve = {"kind": "dynamic", "duration": 0.1}
    found = [
        refweb.run(bridled(solve=solve | keys)).state
        for keys in (dict(safety=0.1), dict(method="cvode", rtol=1e-6), dict(method="ida", rtol=1e-6))
    ]
    for other in found[1:]:
        np.testing.assert_allclose(other.x, found[0].x, rtol=0, atol=1e-4)


@pytest.mark.slow
def test_a_resumed_run_is_the_same(tmp_path):
    whole, resumed = nets.whole_and_resumed(bridled(), tmp_path)
    np.testing.assert_array_equal(resumed.state.x, whole.state.x)
    np.testing.assert_array_equal(resumed.state.v, whole.state.v)


def test_who_is_not_felt_is_told():
    """A body that a web is tied to is felt; one beside it, without contact, is not."""
    tied = bridled().replace(effects=[e for e in bridled().effects if not isinstance(e, refweb.Contact)])
    beside = tied.replace(effects=[*tied.effects, refweb.Body(name="aside", radius=0.1, mass=1.0, position=(9, 9, 9))])
    for scene, told in ((tied, False), (beside, True)):
        assert any("the web does not feel it" in finding.text for finding in notices(scene, scene.build())) == told


def test_a_node_on_a_fixed_body_is_a_support():
    """Statics of a web whose corners are on fixed bodies is that of a web with supports at these points."""
    points = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
    tables = {
        "cable": {"law": "linear", "modulus": 1e6, "area": 1e-4, "density": 1000.0},
        "gravity": {"acceleration": [0.0, 0.0, -9.81]},
        "solve": {"kind": "static"},
    }
    web = {"kind": "inline", "points": points, "lines": [[0, 1], [1, 2]], "natural_length": [0.9, 0.9]}
    wall = dict(name="wall", shape="box", size=[0.2, 0.2, 0.2], position=[2.1, 0, 0], fixed=True)
    wall |= {"orientation": [1.0, 0.0, 0.0, 1.0]}
    attach = [{"body": "wall", "node": 2, "point": [0.0, 0.1, 0.1]}]  # at x = 2.1 − 0.1, z = 0.1
    tied = {**tables, "web": {**web, "supports": [0]}, "body": [wall], "attach": attach}
    moved = [{"node": 2, "displacement": [[0.0, 0.0, 0.0, 0.1]]}]
    held = refweb.run(refweb.Scene.from_dict({**tables, "web": {**web, "supports": [0]}, "motion": moved}))
    found = refweb.run(refweb.Scene.from_dict(tied))
    np.testing.assert_allclose(found.state.position[2], [2.0, 0.0, 0.1], atol=1e-15)
    np.testing.assert_allclose(found.tension, held.tension, rtol=1e-12)
    np.testing.assert_allclose(found.state.reaction[2], held.state.reaction[2], rtol=1e-9, atol=1e-12)


def test_an_equilibrium_to_start_from_holds_free_bodies():
    """The web hangs between its support and the box, which waits where it is; then both move on."""
    scene = bridled(solve={"kind": "dynamic", "duration": 0.1, "start": "equilibrium"})
    system = scene.build()
    start = equilibrium(system)
    (body,) = system.net.bodies
    assert not start.x[[*body.carried, body.row, body.spin, body.turn]].any() and start.x[4].any()
    force = np.where(system.supported, 0.0, at_rest(system).force(0.0, start.x))
    assert np.abs(force[: system.net.nodes]).max() < 1e-9 * np.abs(system.force(0.0, start.x)).max()
    assert np.linalg.norm(refweb.run(scene).state.x[body.row]) > 0.02


REFUSED = [
    (dict(attach=[{"body": "sat", "node": 0}]), r'\[\[attach\]\] 1 body = "sat" is not a \[\[body\]\].*"satellite"'),
    (dict(attach=[{"body": "satellite", "node": 99}]), r"\[\[attach\]\] 1 .*99"),
    (dict(attach=[{"body": "satellite", "node": [0, 5]}]), r"\[\[attach\]\] node 5 is supported as well"),
    (
        dict(attach=[{"body": "satellite", "node": 0}, {"body": "satellite", "node": [0, 1]}]),
        r'\[\[attach\]\] 2 node = 0 is on body "satellite" already',
    ),
    (
        dict(motion=[{"node": 0, "displacement": [[0.0, 0.0, 0.0, 0.1]]}]),
        r"\[\[attach\]\] node 0 is moved by \[\[motion\]\] as well",
    ),
    (
        dict(link=[{"nodes": [0, 4]}], solve={"kind": "dynamic", "duration": 0.1, "method": "ida"}),
        r"\[\[attach\]\] node 0 has a \[\[link\]\] as well",
    ),
    (
        dict(solve={"kind": "dynamic", "duration": 0.1, "method": "cvode", "mass": "consistent"}),
        r'mass = "consistent" must be "lumped" with \[\[attach\]\]',
    ),
    (
        dict(velocity=[{"node": 0, "value": [1.0, 0.0, 0.0]}]),
        r'\[\[velocity\]\] 1 node = 0 is on body "satellite" by \[\[attach\]\] and has the velocity of that',
    ),
    (
        dict(body=[{"name": "satellite", "shape": "ring", "radius": 0.1, "normal": [0, 0, 1], "mass": 1.0,
                    "position": [0, 0, 0]}]),
        r'\[\[attach\]\] 1 body = "satellite" is a ring, which keeps its plane: give it another shape',
    ),
    (dict(solve={"kind": "static"}, output={}), r"velocity = \[0.5, 0.2, 0.0\] has no meaning in statics"),
]  # fmt: skip


@pytest.mark.parametrize("tables, message", REFUSED)
def test_what_does_not_fit_is_refused(tables, message):
    with pytest.raises(refweb.InputError, match=message):
        bridled(**tables).build()


def test_rotations_of_carriers_are_followed():
    """Spheres that carry nodes turn in space."""
    system = carrying()
    assert all(body.turn is not None for body in system.net.bodies) and len(Rotations(system).places) == 2
