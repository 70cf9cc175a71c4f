"""Free bodies in statics: a published value, an energy minimised by a program of its own, tangents, modes, dynamics."""

import meshio
import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import refweb
from refweb.runner import notices
from refweb.statics.newton import Newton
from refweb.statics.stability import Question
from refweb.system.static_system import at_rest

G = 9.81
ROPES = {"law": "tension-only", "modulus": 1e9, "area": 1e-4, "density": 1000.0}
WEIGHT = {"acceleration": [0.0, 0.0, -G]}
BEAM = {"name": "beam", "shape": "box", "size": [2.0, 0.2, 0.2], "mass": 100.0, "position": [0.0, 0.0, 0.0]}
SEEN = [
    {"name": "turn", "quantity": "orientation", "body": "beam"},
    {"name": "height", "quantity": "position", "body": "beam", "component": "z"},
]


def beam(**tables):
    """A beam of 100 kg that hangs on a long and a short rope."""
    web = {"kind": "inline", "points": [[-1, 0, 2], [1, 0, 2], [-1, 0, 0], [1, 0, 0.0]], "lines": [[0, 2], [1, 3]]}
    return {
        "web": {**web, "natural_length": [2.0, 1.5], "supports": [0, 1]},
        "cable": ROPES,
        "gravity": WEIGHT,
        "body": [BEAM],
        "attach": [{"body": "beam", "node": [2, 3]}],
        "observe": SEEN,
        "solve": {"kind": "static"},
        **tables,
    }


def hung(seed, **solve):
    """A box on random ropes, half of which have a node between their ends, some of these joined."""
    rng = np.random.default_rng(seed)
    count, size = int(rng.integers(2, 6)), np.array([0.6, 0.4, 0.3])
    tops = np.c_[rng.uniform(-2, 2, (count, 2)), rng.uniform(0.5, 2, count)]
    points, lines, ends, middles = tops.tolist(), [], [], []
    for i in range(count):
        end = rng.uniform(-0.5, 0.5, 3) * size
        points.append(end.tolist())
        ends.append(len(points) - 1)
        if rng.random() < 0.5:
            points.append((0.5 * (tops[i] + end) + 0.1 * rng.normal(size=3)).tolist())
            middles.append(len(points) - 1)
            lines += [[i, middles[-1]], [middles[-1], ends[-1]]]
        else:
            lines.append([i, ends[-1]])
    lines += [[a, b] for a in middles for b in middles if b < a and rng.random() < 0.5]
    apart = [float(np.linalg.norm(np.subtract(points[a], points[b]))) for a, b in lines]
    web = {"kind": "inline", "points": points, "lines": lines, "supports": list(range(count))}
    lengths = [length * rng.uniform(0.8, 1.3) for length in apart]
    area, mass = float(10 ** rng.uniform(-6, -4)), float(10 ** rng.uniform(0, 2.5))
    body = {"name": "box", "shape": "box", "size": size.tolist(), "mass": mass}
    return refweb.Scene.from_dict(
        {
            "web": {**web, "natural_length": lengths},
            "cable": {**ROPES, "area": area},
            "gravity": WEIGHT,
            "body": [{**body, "position": (0.05 * rng.normal(size=3)).tolist()}],
            "attach": [{"body": "box", "node": ends}],
            "solve": {"kind": "static", **solve},
        }
    )


class Program:
    """Energy of a web of straight ropes with one body, by its own few lines, in places and a rotation vector."""

    def __init__(self, scene):
        tables = scene.to_dict()
        web, cable, (body,) = tables["web"], tables["cable"], tables["body"]
        self.points, self.lines = np.array(web["points"], float), np.array(web["lines"])
        self.length = np.array(web["natural_length"], float)
        self.stiffness, self.mass = cable["modulus"] * cable["area"] / self.length, np.zeros(len(self.points))
        for (a, b), length in zip(self.lines, self.length, strict=True):
            self.mass[[a, b]] += 0.5 * cable["density"] * cable["area"] * length
        self.ends, self.body_mass, self.place = tables["attach"][0]["node"], body["mass"], np.array(body["position"])
        self.loose = [i for i in range(len(self.points)) if i not in (*web["supports"], *self.ends)]

    def places(self, y, turn=None):
        """Places of the nodes and of the body at unknowns y, its rotation beside ``turn``."""
        points, place = self.points.copy(), self.place + y[:3]
        rotation = Rotation.from_rotvec(y[3:6]) * (turn or Rotation.identity())
        points[self.ends] = place + rotation.apply(self.points[self.ends] - self.place)
        points[self.loose] += y[6:].reshape(-1, 3)
        return points, place

    def energy(self, y, turn=None):
        """The energy [J] and its gradient."""
        points, place = self.places(y, turn)
        vector = points[self.lines[:, 1]] - points[self.lines[:, 0]]
        length = np.linalg.norm(vector, axis=1)
        stretch = np.maximum(length - self.length, 0.0)
        return 0.5 * (self.stiffness * stretch**2).sum() + G * (self.mass @ points[:, 2] + self.body_mass * place[2])

    def minimised(self):
        """Energy at the least that repeated descents by differences find [J], and the tensions there [N]."""
        y, turn = np.zeros(6 + 3 * len(self.loose)), Rotation.identity()
        before = np.inf
        while (energy := self.energy(y, turn)) < before - 1e-11 * abs(before if np.isfinite(before) else 1.0):
            before = energy
            y = minimize(self.energy, y, args=(turn,), method="BFGS", jac="3-point", options={"gtol": 1e-7}).x
            turn, y[3:6] = Rotation.from_rotvec(y[3:6]) * turn, 0.0
        vector = np.diff(self.places(y, turn)[0][self.lines], axis=1)[:, 0]
        return energy, self.stiffness * np.maximum(np.linalg.norm(vector, axis=1) - self.length, 0.0)

    def energy_of(self, solution):
        """Energy of a solution by this program [J]."""
        state, (body,) = solution.state, solution.state.system.net.bodies
        turn = Rotation.from_matrix(body.rotation(state.x))
        place = state.position[body.row] + turn.apply(body.offset @ body.axes)
        y = np.concatenate([place - self.place, np.zeros(3), state.x[self.loose].ravel()])
        return self.energy(y, turn)


def test_a_beam_on_two_ropes_of_different_length():
    """Published figures of an independent minimisation, to their printed digits, and the balance of forces."""
    solution = refweb.run(refweb.Scene.from_dict(beam()))
    state, (body,) = solution.state, solution.state.system.net.bodies
    centre = state.position[body.row] + body.rotation(state.x) @ (body.offset @ body.axes)
    np.testing.assert_allclose(centre, [0.0047184, 0.0, 0.2416974], rtol=0, atol=6e-8)
    assert solution.results["turn"].value == pytest.approx(0.253864, abs=6e-7)
    np.testing.assert_allclose(solution.tension, [489.24, 493.64], rtol=0, atol=6e-3)
    weight = G * (100.0 + 3.5 * 0.1)
    np.testing.assert_allclose(state.reaction[:2].sum(axis=0), [0.0, 0.0, weight], rtol=0, atol=1e-10 * weight)


def test_what_is_open_and_what_is_not_proven_is_told(tmp_path):
    """The beam turns about its own line at no cost; no bound is said to be proven; frames have its place."""
    solution = refweb.run(refweb.Scene.from_dict(beam()), out=tmp_path / "out")
    assert 'body "beam" can turn at no cost: place and orientation are not unique there' in solution.warnings
    assert any('"beam" is free: ± are estimates, as the proven bound asks' in text for text in solution.warnings)
    assert len(solution.warnings) == 2 and solution.solver["duality_gap"] is None
    assert not any(result.proven for result in solution.results.values())
    drawn = meshio.read(tmp_path / "out" / "frames" / "beam_000000.vtu")
    (body,), x = solution.state.system.net.bodies, solution.state.x
    local, _ = body.shape.boundary()
    turned = solution.state.position[body.row] + (local + body.offset) @ (body.axes @ body.rotation(x).T)
    np.testing.assert_allclose(drawn.points, turned, rtol=0, atol=1e-12)


@pytest.mark.ordinary("83")
@pytest.mark.parametrize("seed", [2, 11, 34, 83])
def test_random_ropes_beside_a_program_of_ones_own(seed):
    """The least energy found by differences alone, and dynamic relaxation; tensions where differences leave digits."""
    scene = hung(seed)
    newton, relaxed = refweb.run(scene), refweb.run(hung(seed, method="relaxation"))
    program = Program(scene)
    least, tension = program.minimised()
    scale = abs(least) + np.sum(newton.tension**2 / program.stiffness)
    assert program.energy_of(newton) <= least + 1e-9 * scale
    if program.energy_of(newton) > least - 1e-6 * scale:  # BFGS may have stopped on its way
        largest = newton.tension.max()
        np.testing.assert_allclose(newton.tension, tension, rtol=0, atol=1e-2 * largest)
    assert program.energy_of(relaxed) == pytest.approx(program.energy_of(newton), abs=1e-10 * scale)
    np.testing.assert_allclose(relaxed.tension, newton.tension, rtol=0, atol=1e-7 * newton.tension.max())


def solved(seed):
    """Whether a random scene is solved; refused with a reason counts as well."""
    try:
        solution = refweb.run(hung(seed))
    except refweb.SolverError as error:
        assert "carried off" in str(error)
        return True
    return solution.status == "solved" and solution.solver["residual"] < 1e-9 and solution.solver["smallest_pivot"] >= 0


def test_random_nets_with_a_free_body_are_solved():
    assert all(solved(seed) for seed in range(100, 108))


@pytest.mark.slow
def test_a_hundred_of_a_hundred():
    assert sum(solved(seed) for seed in range(100)) == 100


BALL = {"name": "ball", "radius": 0.15, "mass": 2.0, "position": [0.05, 0.02, 0.15]}
CHEST = {
    "name": "chest", "shape": "box", "size": [0.5, 0.45, 0.2], "rounding": 0.05, "mass": 2.0,
    "position": [0.05, 0.02, 0.0995], "orientation": [1.0, 0.02, 0.02, 0.1],
}  # fmt: skip


def in_net(body, solve=None, **tables):
    """A body in a square net that is held at its rim."""
    scene = {
        "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.25},
        "cable": {**ROPES, "area": 1e-6},
        "gravity": WEIGHT,
        "body": [body],
        "contact": {"stiffness": 1e4},
        "observe": [
            {"name": "height", "quantity": "position", "body": body["name"], "component": "z"},
            {"name": "push", "quantity": "reaction", "body": body["name"], "component": "z"},
        ],
        "solve": {"kind": "static", **(solve or {})},
    }
    return refweb.Scene.from_dict({**scene, **tables})


@pytest.mark.parametrize("body", [BALL, CHEST], ids=["ball", "chest"])
def test_a_body_at_rest_in_a_net(body):
    """Contact carries its weight, the supports that and the net's; dynamic relaxation says the same."""
    newton, relaxed = (refweb.run(in_net(body, {"method": method})) for method in ("newton", "relaxation"))
    weight, state = 2.0 * G, newton.state
    assert newton.results["push"].value == pytest.approx(weight, rel=1e-9)
    web = G * state.system.net.mass[: state.system.net.nodes].sum()
    rim = state.reaction[: state.system.net.nodes][state.system.net.web.rim].sum(axis=0)
    np.testing.assert_allclose(rim, [0.0, 0.0, weight + web], rtol=0, atol=1e-9 * weight)
    assert newton.solver["smallest_pivot"] == 1 and newton.bodies[body["name"]]["overlap"] > 0.0
    for name, result in newton.results.items():
        assert relaxed.results[name].value == pytest.approx(result.value, rel=1e-7)


def test_a_ball_in_a_mesh_beside_a_program():
    """A ball in a square of ropes: it presses each by the depth of the nearest point of a segment."""
    outer, inner = [[1.0, 1.1, 0], [-1.1, 1, 0], [-1, -1, 0.1], [1, -0.9, 0]], [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    points = np.array([*outer, *([0.12 * x, 0.12 * y, 0.0] for x, y in inner)])
    lines = np.array([*([i, 4 + i] for i in range(4)), *([4 + i, 4 + (i + 1) % 4] for i in range(4))])
    length = 1.01 * np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
    web = {"kind": "inline", "points": points.tolist(), "lines": lines.tolist(), "natural_length": length.tolist()}
    ball, ropes = {"name": "ball", "radius": 0.2, "mass": 5.0, "position": [0.02, 0.01, 0.155]}, {**ROPES, "area": 1e-6}
    solution = refweb.run(in_net(ball, web={**web, "supports": [0, 1, 2, 3]}, cable=ropes))
    mass = np.zeros(8)
    np.add.at(mass, lines, 0.5 * 1000.0 * 1e-6 * length[:, None])

    def energy(y):
        place, centre = np.vstack([points[:4], y[:12].reshape(4, 3)]), y[12:]
        begin, along = place[lines[:, 0]], place[lines[:, 1]] - place[lines[:, 0]]
        share = np.clip(((centre - begin) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        depth = np.maximum(0.2 - np.linalg.norm(centre - begin - share[:, None] * along, axis=1), 0.0)
        stretch = np.maximum(np.linalg.norm(along, axis=1) - length, 0.0)
        elastic = (1e3 / length * stretch**2).sum() + (1e4 * depth**2).sum()
        return 0.5 * elastic + G * (mass @ place[:, 2] + 5.0 * centre[2])

    start = np.concatenate([solution.positions[4:8].ravel(), solution.state.position[8]])
    found = minimize(energy, start + 1e-3 * np.random.default_rng(0).standard_normal(15), jac="3-point")
    assert energy(start) <= found.fun + 1e-12 * abs(found.fun)
    np.testing.assert_allclose(start, found.x, rtol=0, atol=1e-5)  # slopes by differences are good to 1e-5 N


def everything(seed):
    """A system with a box that carries nodes and lies on a net, in an orbit, and any state of it."""
    tables = {
        "attach": [{"body": "chest", "node": [6, 14]}],
        "load": [{"node": 6, "force": [1.0, -2.0, 3.0]}],
    }
    scene = in_net(CHEST, cable={**ROPES, "area": 1e-6, "law": "linear"}, **tables).to_dict()
    del scene["gravity"]
    system = at_rest(refweb.Scene.from_dict({**scene, "orbit": {"mean_motion": 0.5}}).build())
    rng = np.random.default_rng(seed)
    x = np.zeros((system.rows, 3))
    for size in (0.02, 0.5):  # twice, so that the body is turned already
        x = system.moved(x, system.rows_of(size * 0.1 * rng.standard_normal(len(system.free))))
    return system, x, rng


def test_forces_are_slopes_of_the_energy_and_tangents_those_of_forces():
    """Along any step, rotations of bodies among them, at states that are no equilibria; K is symmetric."""
    system, x, rng = everything(1)
    assert system.angles and system.symmetric and system.conservative
    K = system.pattern.matrix(system.stiffness(1.0, x))
    assert abs(K - K.T).max() < 1e-12 * abs(K).max()
    force = system.force(1.0, x).ravel()[system.free]
    for _ in range(4):
        p, h = rng.standard_normal(len(system.free)), 1e-5
        here = [system.moved(x, a * h * system.rows_of(p)) for a in (-1.0, 1.0)]
        energy = [system.energy(1.0, y) for y in here]
        assert (energy[0] - energy[1]) / (2 * h) == pytest.approx(force @ p, rel=1e-6)
        slope = [system.force(1.0, y).ravel()[system.free] @ p for y in here]
        assert (slope[0] - slope[1]) / (2 * h) == pytest.approx(p @ K @ p, rel=1e-6)
    spins = np.flatnonzero(system.free // 3 == system.net.bodies[0].spin)
    change = [system.force(1.0, system.moved(x, a * h * system.rows_of(p))).ravel()[system.free] for a in (-1.0, 1.0)]
    expected, rest = (change[0] - change[1]) / (2 * h), ~np.isin(np.arange(len(p)), spins)
    np.testing.assert_allclose((K @ p)[rest], expected[rest], rtol=0, atol=1e-6 * abs(expected).max())


def test_convergence_is_quadratic():
    """The last steps of Newton's method square the residual: the tangent is exact, by rotations as well."""
    residuals = []
    scene = hung(5)
    newton = Newton(at_rest(scene.build()), lambda text: residuals.append(float(text.rsplit(" ", 1)[1])))
    newton.solve(1.0, np.zeros((newton.system.rows, 3)))
    falling = [(a, b) for a, b in zip(residuals, residuals[1:], strict=False) if 1e-7 < a < 1e-2]
    assert falling and all(b < a**1.5 for a, b in falling)


def test_two_bodies_one_below_the_other():
    """Ropes in a row carry what hangs below them, through bodies; each hangs straight and spins at no cost."""
    points = [[0, 0, 0], [0, 0, -1], [0, 0, -1.2], [0, 0, -2.2]]
    bodies = [
        {"name": name, "shape": "box", "size": [0.3, 0.2, 0.2], "mass": mass, "position": [0, 0, z]}
        for name, mass, z in (("upper", 3.0, -1.1), ("lower", 5.0, -2.3))
    ]
    tables = {
        "web": {"kind": "inline", "points": points, "lines": [[0, 1], [2, 3]], "supports": [0]},
        "cable": {**ROPES, "density": 0.0},
        "gravity": {"acceleration": [1.0, 0.0, -G]},
        "body": bodies,
        "attach": [{"body": "upper", "node": [1, 2]}, {"body": "lower", "node": 3}],
        "solve": {"kind": "static"},
    }
    solution = refweb.run(refweb.Scene.from_dict(tables))
    size = np.hypot(G, 1.0)
    np.testing.assert_allclose(solution.tension, [8.0 * size, 5.0 * size], rtol=1e-9)
    place = solution.state.position[[0, 1, 2, 3]]
    np.testing.assert_allclose(np.cross(np.diff(place, axis=0), [1.0, 0.0, -G]), 0.0, atol=1e-8)
    assert any('body "upper" can' in text and 'body "lower" can' in text for text in solution.warnings)


def test_shipped_platform():
    """Ropes carry the weights of deck and load, in force and in moment about the place of the deck."""
    solution = refweb.run("platform-on-ropes")
    state, (body,) = solution.state, solution.state.system.net.bodies
    ends = state.position[4:8] - state.position[body.row]
    ropes = state.position[:4] - state.position[4:8]
    pulls = solution.tension[:, None] * ropes / np.linalg.norm(ropes, axis=1)[:, None]
    load = np.array([0.0, 0.0, -400.0])
    weight = [0.0, 0.0, -G * state.system.net.mass[body.row]]
    np.testing.assert_allclose(pulls.sum(axis=0) + load + weight, 0.0, atol=1e-6)
    np.testing.assert_allclose(np.cross(ends, pulls).sum(axis=0) + np.cross(ends[3], load), 0.0, atol=1e-6)
    assert solution.results["smallest"].value > 100.0 and solution.solver["smallest_pivot"] == 1


REFUSED = [
    (dict(body=[{**BEAM, "velocity": [1, 0, 0]}]), r"velocity = \[1.0, 0.0, 0.0\] has no meaning in statics"),
    (dict(body=[{**BEAM, "angular_velocity": [1, 0, 0]}]), r"angular_velocity = .* has no meaning in statics"),
]


@pytest.mark.parametrize("tables, message", REFUSED)
def test_what_has_no_meaning_is_refused(tables, message):
    with pytest.raises(refweb.InputError, match=message):
        refweb.Scene.from_dict(beam(**tables)).build()


def test_a_body_that_nothing_holds_is_carried_off():
    """With the load that does it, its direction and the remedy; without a load it is free to move, and is told."""
    aside = {**BEAM, "name": "aside", "position": [0.0, 5.0, 0.0]}
    scene = refweb.Scene.from_dict(beam(body=[BEAM, aside]))
    with pytest.raises(refweb.SolverError, match=r'body "aside" is carried off along z by -981 N .*\[\[attach\]\]'):
        refweb.run(scene)
    tied = beam(body=[BEAM, aside], gravity=None, load=[{"node": 2, "force": [0, 0, -500.0]}])
    solution = refweb.run(refweb.Scene.from_dict({key: value for key, value in tied.items() if value is not None}))
    assert any('body "aside" can move and turn at no cost' in text for text in solution.warnings)


def test_a_load_on_a_node_of_a_free_body_moves_it():
    scene = refweb.Scene.from_dict(beam(load=[{"node": 2, "force": [-5.0, 0.0, 0.0]}]))
    assert not any(finding.code == "idle-load" for finding in notices(scene, scene.build()))
    pushed, plain = refweb.run(scene).state, refweb.run(refweb.Scene.from_dict(beam())).state
    moved = pushed.reaction[:2].sum(axis=0) - plain.reaction[:2].sum(axis=0)
    np.testing.assert_allclose(moved, [5.0, 0.0, 0.0], rtol=0, atol=1e-7)


def test_wind_has_no_potential():
    """Its tangent is not symmetric, and Newton's method has its LU: moments and forces balance all the same."""
    wind = {
        "density": 1.2,
        "wind": [30.0, 5.0, 0.0],
        "normal": 1.2,
        "bodies": {"beam": {"coefficient": 1.0, "area": 0.4}},
    }
    blown = refweb.run(refweb.Scene.from_dict(beam(drag=wind)))
    system = at_rest(blown.state.system)
    assert not system.conservative
    force = np.where(system.supported, 0.0, system.force(1.0, blown.state.x))
    assert np.abs(force).max() < 1e-8 * blown.tension.max()
    assert Question(blown.state.system, system, blown_equilibrium(blown)).answer().sign in (0, 1)


def blown_equilibrium(solution):
    """The equilibrium of a solution at its only load step."""
    from refweb.statics.equilibrium import Equilibrium

    state = solution.state
    return Equilibrium(1.0, state.x, state.element_tension, state.system.force(1.0, state.x))


def test_two_balls_that_hang_from_one_point():
    """They press each other by m g tan α, at the angle of their ropes; contact that is too soft is told of, or refused.

    A rope of 1 m ends on a ball 0.204 m from its centre, so that sin α = (0.2 − δ/2)/1.204, δ being their overlap.
    """
    arm = float(np.hypot(0.2, 0.04))
    points, ball = [[0, 0, 0], [-0.21, 0, -1], [0.21, 0, -1]], {"radius": 0.2, "mass": 1.0}

    def hanging(stiffness):
        web = {"kind": "inline", "points": points, "lines": [[0, 1], [0, 2]], "supports": [0], "natural_length": 1.0}
        tables = beam(
            web=web,
            cable={**ROPES, "modulus": 1e12, "density": 0.0},
            body=[{**ball, "name": name, "position": [0.25 * s, 0.0, -1.2]} for name, s in (("a", -1), ("b", 1))],
            attach=[{"body": "a", "node": [1]}, {"body": "b", "node": [2]}],
            contact={"stiffness": stiffness, "between_bodies": True},
            observe=[{"name": "push", "quantity": "reaction", "body": "b", "component": "x"}],
        )
        return refweb.Scene.from_dict(tables)

    for stiffness in (1e6, 50.0):
        solution = refweb.run(hanging(stiffness))
        push = solution.results["push"].value
        sine = (0.2 - 0.5 * push / stiffness) / (1.0 + arm)
        assert push == pytest.approx(G * sine / np.sqrt(1.0 - sine**2), rel=1e-6)  # ropes stretch by 1e-7
        assert solution.pairs["a, b"]["overlap"] == pytest.approx(push / stiffness, rel=1e-9)
        assert not any("never touches" in text for text in solution.warnings)
    assert any('"a" and "b" are 0.0305 m deep in each other at load step 1' in text for text in solution.warnings)
    with pytest.raises(refweb.SolverError, match='"a" and "b" are .* at load step 1, in the core.*stiffness = 5000'):
        refweb.run(hanging(5.0))


@pytest.mark.slow
def test_a_rope_that_a_wheel_alone_holds():
    """Two equal weights on a rope over a wheel: it has their weight, though nothing else holds the web."""
    points = [[-0.25, 0, -1], [-0.25, 0, 0], [0, 0, 0.25], [0.25, 0, 0], [0.25, 0, -1]]
    wheel = {"name": "wheel", "shape": "cylinder", "radius": 0.24, "length": 0.2, "axis": [0, 1, 0], "fixed": True}
    solution = refweb.run(
        in_net(
            {**wheel, "position": [0.0, 0.0, 0.0]},
            web={"kind": "inline", "points": points, "lines": [[i, i + 1] for i in range(4)], "supports": []},
            cable={**ROPES, "density": 0.0, "subdivide": 4},
            contact={"stiffness": 1e6},
            point_mass=[{"node": [0, 4], "mass": 5.0}],
        )
    )
    assert solution.results["push"].value == pytest.approx(-10.0 * G, rel=1e-9)
    assert solution.tension[[0, 3]] == pytest.approx(5.0 * G, rel=1e-9)


def test_a_body_that_falls_through_the_web_is_said_to():
    with pytest.raises(refweb.SolverError, match='"ball" leaves the web, through a mesh.*start on the side of the web'):
        refweb.run(in_net({**BALL, "radius": 0.05, "position": [0.05, 0.02, 0.05]}))


def test_nodes_and_bodies_without_support_are_counted():
    """A tether with a body at each end in orbit: it has the tension 3 n² m r."""
    end, rate = {"shape": "box", "size": [1.0, 1.0, 1.0], "mass": 10.0}, 1.1e-3
    solution = refweb.run(
        refweb.Scene.from_dict(
            {
                "web": {"kind": "inline", "points": [[-49.5, 0, 0], [49.5, 0, 0]], "lines": [[0, 1]], "supports": []},
                "cable": {**ROPES, "density": 0.0},
                "orbit": {"mean_motion": rate},
                "body": [{**end, "name": name, "position": [50.0 * s, 0, 0]} for name, s in (("a", -1), ("b", 1))],
                "attach": [{"body": "a", "node": [0]}, {"body": "b", "node": [1]}],
                "solve": {"kind": "static"},
            }
        )
    )
    assert solution.tension == pytest.approx(3.0 * rate**2 * 10.0 * 50.0, rel=1e-6)
    assert "2 nodes and 2 bodies have no support along x, y, z: their position there is not unique" in solution.warnings
