"""Spheres at rest on lines of several elements, which share the push."""

import numpy as np
import pytest
from scipy.optimize import brentq, nnls

import refweb
from refweb.statics.newton import Newton
from refweb.statics.shared_push import SharedPush
from refweb.system.static_system import at_rest

WEIGHT, RADIUS, HALF, EA, STIFFNESS = 20.0, 0.2, 0.5, 2e3, 2e4
LENGTH = 1.02 * 2.0 * HALF
BALL = {"name": "ball", "radius": RADIUS, "mass": WEIGHT / 10.0, "position": [0.01, 0.02, RADIUS - 0.01]}
ROPE = {"law": "tension-only", "modulus": EA / 1e-6, "area": 1e-6, "density": 0.0, "subdivide": 2}
CROSS = {
    "kind": "inline", "points": [[-HALF, 0, 0], [HALF, 0, 0], [0, -HALF, 0], [0, HALF, 0]], "lines": [[0, 1], [2, 3]],
    "supports": [0, 1, 2, 3], "natural_length": LENGTH,
}  # fmt: skip
DAMPED = {"cable": {**ROPE, "density": 100.0}, "damping": {"rate": 30.0, "bodies": 4.0}, "accuracy": {"error": "none"}}


def crossed(**tables):
    """A ball on two ropes that cross under it, each of two elements."""
    seen = [
        {"name": "height", "quantity": "position", "body": "ball", "component": "z"},
        {"name": "push", "quantity": "reaction", "body": "ball", "component": "z"},
        {"name": "tension", "quantity": "tension", "select": "max"},
    ]
    scene = {
        "web": CROSS, "cable": ROPE, "gravity": {"acceleration": [0.0, 0.0, -10.0]}, "body": [BALL],
        "contact": {"stiffness": STIFFNESS}, "solve": {"kind": "static"}, "observe": seen,
    }  # fmt: skip
    return refweb.Scene.from_dict({**scene, **tables})


@pytest.fixture(scope="module")
def crossing(tmp_path_factory):
    """The ball on two ropes, and its result folder."""
    folder = tmp_path_factory.mktemp("crossing") / "out"
    return refweb.run(crossed(), out=folder), folder


def closed_form():
    """Height of the ball and tension of the ropes: each side has a quarter of the weight and half a push.

    A side at the angle φ below the horizontal feels P = W/(4 cos φ) at the distance d = R − 2 P/k from the centre, d
    tan φ from the middle of the rope, where T tan φ = (1 − d tan φ/l) P balances.
    """

    def side(angle):
        push, length = WEIGHT / (4.0 * np.cos(angle)), HALF / np.cos(angle)
        return push, RADIUS - 2.0 * push / STIFFNESS, length, EA * (2.0 * length / LENGTH - 1.0)

    def unbalanced(angle):
        push, away, length, tension = side(angle)
        return tension * np.tan(angle) - (1.0 - away * np.tan(angle) / length) * push

    angle = brentq(unbalanced, 0.05, 1.0, xtol=1e-15)
    _, away, _, tension = side(angle)
    return away / np.cos(angle) - HALF * np.tan(angle), tension


def test_a_ball_on_two_ropes_of_two_elements(crossing):
    """Closed form, to what rounding leaves; both halves of a rope have half of its push."""
    solution, _ = crossing
    height, tension = closed_form()
    assert solution.results["height"].value == pytest.approx(height, rel=1e-11)
    assert solution.results["tension"].value == pytest.approx(tension, rel=1e-11)
    assert solution.results["push"].value == pytest.approx(WEIGHT, rel=1e-11)
    np.testing.assert_allclose(solution.state.reaction[:4, 2], WEIGHT / 4.0, rtol=1e-11)
    assert solution.solver["smallest_pivot"] == 1
    (remark,) = (text for text in solution.warnings if "share its push" in text)
    assert "line 0 and 1 more" in remark and "50 %, 50 %" in remark and "the rest is stable" in remark


def test_shares_are_kept_with_the_results(crossing):
    """The state that is read from a folder has the same forces."""
    solution, folder = crossing
    read = refweb.load(folder).state
    np.testing.assert_array_equal(read.reaction, solution.state.reaction)


def test_a_ball_on_one_rope_is_in_balance_and_not_stable():
    web = {**CROSS, "points": CROSS["points"][:2], "lines": [[0, 1]], "supports": [0, 1]}
    solution = refweb.run(crossed(web=web, body=[{**BALL, "position": [0.0, 0.0, RADIUS - 0.01]}]))
    assert solution.results["push"].value == pytest.approx(WEIGHT, rel=1e-11)
    assert any("is a saddle" in text for text in solution.warnings)
    assert not any("the rest is stable" in text for text in solution.warnings)


def test_damped_dynamics_comes_to_the_same_rest():
    """It goes to and fro about the valley: 100 µm are a fiftieth of the way that the ball has sunk into the ropes."""
    rest = refweb.run(crossed(cable=DAMPED["cable"])).results["height"].value
    moved = refweb.run(crossed(**DAMPED, solve={"kind": "dynamic", "duration": 3.0}))
    assert moved.results["height"].value == pytest.approx(rest, abs=1e-4)


def test_what_begins_at_such_a_rest(tmp_path):
    """Explicit steps stay there, with a warning; natural frequencies and implicit steps are refused with the reason."""
    start = {"kind": "dynamic", "duration": 0.02, "start": "equilibrium"}
    stays = refweb.run(crossed(**DAMPED, solve=start))
    assert stays.results["height"].value == pytest.approx(closed_form()[0], abs=1e-4)
    assert any("the push goes to and fro between these elements" in text for text in stays.warnings)
    with pytest.raises(refweb.SolverError, match='line 0 with several elements alike.*method = "central-difference"'):
        refweb.run(crossed(**DAMPED, solve={**start, "method": "cvode"}))
    refweb.run(crossed(cable=DAMPED["cable"]), tmp_path / "rest")
    start["start"] = str(tmp_path / "rest")
    stays = refweb.run(crossed(**DAMPED, solve=start))
    assert stays.results["height"].value == pytest.approx(closed_form()[0], abs=1e-4)
    with pytest.raises(refweb.SolverError, match='line 0 with several elements alike.*method = "central-difference"'):
        refweb.run(crossed(**DAMPED, solve={**start, "method": "ida"}))
    capsule = {"shape": "capsule", "axis": [0, 0, 1], "length": 0.0002}
    with pytest.raises(refweb.SolverError, match='no natural frequencies.*"ball" touches line 0.*length = 0.0002'):
        refweb.modes(crossed(cable=DAMPED["cable"]))
    modes = refweb.modes(crossed(cable=DAMPED["cable"], body=[{**BALL, **capsule}]))
    assert (modes.frequency > 0.0).all()


def in_net(seed, **tables):
    """A ball in a random net of some random elements a line."""
    rng = np.random.default_rng(seed)
    count, side, mesh = int(rng.integers(3, 7)), 0.1, str(rng.choice(["square", "triangle"]))
    radius, mass, stiffness = side * rng.uniform(0.8, 2.0), 10.0 ** rng.uniform(-1, 1), 10.0 ** rng.uniform(2, 4.5)
    middle = rng.uniform(-0.15, 0.15, 2) * count * side
    ball = {"name": "ball", "radius": float(radius), "mass": float(mass)}
    cable = {**ROPE, "modulus": float(stiffness / 1e-6), "density": 1000.0, "subdivide": int(rng.choice([2, 3, 4]))}
    return crossed(
        web={"kind": "window", "mesh": mesh, "rows": count, "columns": count, "side": side},
        cable=cable,
        body=[{**ball, "position": [*middle.tolist(), float(radius * rng.uniform(0.9, 1.02))]}],
        contact={"stiffness": float(10.0 * mass / (radius * rng.uniform(0.003, 0.03)))},
        **tables,
    )


def unbalanced(solution):
    """Least unbalanced force over the weight of any shares of the push, by a program of its own.

    It sums the forces of lines, weights and contacts of elements that are as deep as the deepest of their line, and
    asks nonnegative least squares for shares that add up to 1.
    """
    state = solution.state
    net, (ball,) = state.system.net, state.system.net.bodies
    scene, place = solution.scene.to_dict(), state.position
    cable, stiffness = scene["cable"], scene["contact"]["stiffness"]
    begin, along = place[net.cells[:, 0]], place[net.cells[:, 1]] - place[net.cells[:, 0]]
    length = np.linalg.norm(along, axis=1)
    tension = np.maximum(cable["modulus"] * cable["area"] * (length / net.natural_length - 1.0), 0.0)
    force, pull = np.zeros_like(place), (tension / length)[:, None] * along
    np.add.at(force, net.cells[:, 0], pull)
    np.add.at(force, net.cells[:, 1], -pull)
    mass = np.zeros(len(place))
    np.add.at(mass, net.cells, 0.5 * cable["density"] * cable["area"] * net.natural_length[:, None])
    mass[ball.row] = scene["body"][0]["mass"]
    force[:, 2] -= 10.0 * mass
    share = np.clip(-((begin - place[ball.row]) * along).sum(axis=1) / length**2, 0.0, 1.0)
    away = begin + share[:, None] * along - place[ball.row]
    apart = np.linalg.norm(away, axis=1)
    depth = np.maximum(ball.radius - apart, 0.0)
    columns, lines = [], []
    for line in np.unique(net.line[depth > 0.0]):
        elements = np.flatnonzero(net.line == line)
        for element in elements[depth[elements] > (1.0 - 1e-8) * depth[elements].max()]:
            push, (a, b) = np.zeros_like(place), net.cells[element]
            normal = stiffness * depth[element] * away[element] / apart[element]
            push[a] += (1.0 - share[element]) * normal
            push[b] += share[element] * normal
            push[ball.row] -= normal
            columns.append(push[~state.system.supported])
            lines.append(line)
    weight, lines = 10.0 * mass[ball.row], np.array(lines)
    sums = weight * (lines == np.unique(lines)[:, None])
    right = np.concatenate([-force[~state.system.supported], np.full(len(sums), weight)])
    _, rest = nnls(np.vstack([np.transpose(columns), sums]), right)
    return rest / weight, len(lines) > len(sums)


def rest_of(seed):
    """Tell if a ball rests in a random net, and if elements share its push; it may as well fall through."""
    try:
        solution = refweb.run(in_net(seed))
    except refweb.SolverError as error:
        assert "leaves the web, through a mesh or over its rim" in str(error)
        return False, False
    rest, shared = unbalanced(solution)
    assert rest < 1e-9  # TOLERANCE of the residual is 1e-10, of the largest force
    assert solution.results["push"].value == pytest.approx(10.0 * solution.scene.to_dict()["body"][0]["mass"], rel=1e-9)
    assert shared or not any("share its push" in text for text in solution.warnings)
    return True, shared


@pytest.mark.slow
def test_balls_in_random_nets():
    """Shares balance all forces by a program of its own; most nets share the push."""
    rests = [rest_of(seed) for seed in range(4)]
    assert all(rest for rest, _ in rests) and any(shared for _, shared in rests)


@pytest.mark.slow
def test_balls_in_thirty_random_nets():
    rests = [rest_of(seed) for seed in range(30)]
    assert all(rest for rest, _ in rests) and sum(shared for _, shared in rests) >= 20


@pytest.mark.slow
def test_the_sag_converges_with_elements():
    """Four elements change it by less than two, eight by less than four; contact has the weight, to rounding."""
    heights = []
    for pieces in (1, 2, 4, 8):
        ropes = {**ROPE, "modulus": 7e7, "area": 1e-5, "density": 900.0, "subdivide": pieces}
        solution = refweb.run(
            crossed(
                web={"kind": "window", "mesh": "square", "rows": 6, "columns": 6, "side": 0.1},
                cable=ropes,
                body=[{**BALL, "radius": 0.15, "mass": 1.0, "position": [0.02, 0.01, 0.16]}],
                contact={"stiffness": 1e4},
            )
        )
        heights.append(solution.results["height"].value)
        assert solution.results["push"].value == pytest.approx(10.0, rel=1e-11)
    changes = np.abs(np.diff(heights))
    assert (changes[1:] < 0.6 * changes[:-1]).all()


POINTS = [[-0.3, 0, 0.1], [0.3, 0, 0.1], [0, -0.3, 0.1], [0, 0.3, 0.1], [0.05, 0.03, 0.2], [0.1, 0.1, 1.0]]
TIED = {
    "web": {"kind": "inline", "points": POINTS, "lines": [[0, 1], [2, 3], [4, 5]], "supports": [0, 1, 2, 3, 5]},
    "attach": [{"body": "ball", "node": [4]}], "cable": {**ROPE, "density": 9e4},
}  # fmt: skip


@pytest.mark.parametrize("tables", [TIED, {"contact": {"stiffness": 4e5, "exponent": 1.5}}], ids=["tied", "exponent"])
def test_energy_force_and_tangent_of_shares(tables):
    """Each is the derivative of the one before, by differences, as well where a mass on the ball moves its centre."""
    system = at_rest(crossed(**tables).build())
    push = SharedPush(Newton(system, first=1.0), 1.0)
    shared, (lines,), rng = push.newton.system, push._lines, np.random.default_rng(0)

    def moved(x, p):
        y = shared.moved(x, shared.rows_of(p))
        shared.drive(1.0, y)
        return y

    x = np.zeros((system.rows, 3))
    x[system.net.bodies[0].row, 2] = -0.05
    x = moved(x, 1e-3 * rng.normal(size=len(shared.free)))
    lines.begin(1.0, x, 10.0)
    assert lines.several(1.0, x).any()
    p, h = rng.normal(size=len(shared.free)), 1e-7
    ahead, behind = moved(x, h * p), moved(x, -h * p)
    force = [shared.force(1.0, y).ravel()[shared.free] @ p for y in (x, ahead, behind)]
    slope = (shared.energy(1.0, ahead) - shared.energy(1.0, behind)) / (2.0 * h)
    assert slope == pytest.approx(-force[0], rel=1e-7)  # differences leave 9 digits
    stiffness = p @ (shared.pattern.matrix(shared.stiffness(1.0, x)) @ p)
    assert stiffness == pytest.approx(-(force[1] - force[2]) / (2.0 * h), rel=1e-6)


def test_another_method_names_the_one_that_shares():
    """A ball of which the push is shared is refused by dynamic relaxation, which says how it is solved."""
    with pytest.raises(refweb.SolverError, match='method = "newton"'):
        refweb.run(crossed(solve={"kind": "static", "method": "relaxation"}))
