"""Ground: planes and terrain, against closed forms and each other."""

import numpy as np
import pytest
import solids

import refweb

G = 9.81


def slope_of(angle):
    return [float(-np.sin(angle)), 0.0, float(np.cos(angle))]  # falls towards −x


def sliding(angle, friction, duration=0.5):
    """A level line of two nodes of 1 kg in all, at rest on a plane, which it is free to slide down.

    It begins as deep as the push of its three contacts, at both ends and in between, carries it.
    """
    deep = 1.0002 * G * np.cos(angle) / (3.0 * 1e5) * np.array(slope_of(angle))
    plane = {"name": "slope", "shape": "plane", "normal": slope_of(angle), "position": deep.tolist(), "fixed": True}
    scene = refweb.Scene.from_dict({
        "web": {"kind": "inline", "points": [[0, -0.1, 0], [0, 0.1, 0]], "lines": [[0, 1]], "supports": []},
        "cable": {"law": "linear", "modulus": 1e7, "area": 1e-6, "density": 1000.0},
        "point_mass": [{"node": [0, 1], "mass": 0.5}],
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "body": [plane],
        "contact": {"stiffness": 1e5, "friction": friction, "slip_velocity": 1e-3, "damping": 1.0},
        "solve": {"kind": "dynamic", "duration": duration},
        "accuracy": {"error": "none"},
    })  # fmt: skip
    return refweb.run(scene)


def velocity(solution, angle):
    """(along the slope downward, away from it) of the middle of the line."""
    v = solution.state.v[:2].mean(axis=0)
    normal = np.array(slope_of(angle))
    return v @ [-np.cos(angle), 0.0, -np.sin(angle)], v @ normal


@pytest.mark.ordinary("0.3-0.1", "0.4-0.0")
@pytest.mark.parametrize("angle, friction", [(0.5, 0.3), (0.3, 0.1), (0.4, 0.0)])
def test_a_mass_slides_down_a_slope(angle, friction):
    """a = g (sin α − μ cos α); with the push N, m v along is m g t sin α − μ ∫N dt, ∫N dt = m g t cos α + m v away."""
    solution = sliding(angle, friction)
    along, away = velocity(solution, angle)
    expected = G * 0.5 * (np.sin(angle) - friction * np.cos(angle))
    assert along + friction * away == pytest.approx(expected, rel=2e-3)
    assert along == pytest.approx(expected, rel=1e-2)
    assert solution.passage["bodies"] == "certified"


def test_a_mass_rests_on_a_slope_that_holds_it():
    """tan α < μ: it creeps with the velocity of slip at which friction is tan α/μ of μ N, and no faster."""
    angle, friction = 0.2, 0.4
    share = np.tan(angle) / friction
    along, _ = velocity(sliding(angle, friction), angle)
    assert along == pytest.approx(1e-3 * share / np.sqrt(1.0 - share**2), rel=2e-2)


def test_a_line_bounces_off_a_plane():
    """Without losses it leaves as fast as it came, at the angle at which it came, and the book of energy closes."""
    scene = refweb.Scene.from_dict({
        "web": {"kind": "inline", "points": [[0, -0.1, 0.05], [0, 0.1, 0.05]], "lines": [[0, 1]], "supports": []},
        "cable": {"law": "linear", "modulus": 1e7, "area": 1e-6, "density": 1000.0},
        "point_mass": [{"node": [0, 1], "mass": 0.5}],
        "velocity": [{"node": "all", "value": [0.3, 0.0, -2.0]}],
        "body": [{"name": "floor", "shape": "plane", "normal": [0, 0, 1], "position": [5.0, 3.0, 0.0], "fixed": True}],
        "contact": {"stiffness": 1e5},
        "solve": {"kind": "dynamic", "duration": 0.08, "step_size": 2e-5},
        "accuracy": {"error": "none"},
    })  # fmt: skip
    solution = refweb.run(scene)
    np.testing.assert_allclose(solution.state.v[:2], [[0.3, 0.0, 2.0]] * 2, rtol=0, atol=2e-3)
    # All of the energy is once in the contacts: k δ² of both ends and at most that of one in between.
    largest = solution.bodies["floor"]["overlap"]
    energy = 0.5 * (1.0 + 2e-4) * 4.0
    assert np.sqrt(energy / (1.5e5)) < largest < np.sqrt(energy / 1e5)
    assert solution.solver["energy_drift"] < 1e-3
    assert solution.bodies["floor"]["allowed"] == pytest.approx(0.1 * 0.2)


def test_stiffness_on_a_plane_follows_from_the_shortest_line():
    """k = 2 E/δ² of the energy that comes, with what it gains on its way, for 2 % of 0.2 m; two digits, rounded up."""
    scene = refweb.Scene.from_dict({
        "web": {"kind": "inline", "points": [[0, -0.1, 0.5], [0, 0.1, 0.5]], "lines": [[0, 1]], "supports": []},
        "cable": {"law": "linear", "modulus": 1e7, "area": 1e-6, "density": 1000.0},
        "point_mass": [{"node": [0, 1], "mass": 0.5}],
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "body": [{"name": "floor", "shape": "plane", "normal": [0, 0, 1], "position": [5.0, 3.0, 0.0], "fixed": True}],
        "contact": {},
        "solve": {"kind": "dynamic", "duration": 0.4},
        "accuracy": {"error": "none"},
    })  # fmt: skip
    solution = refweb.run(scene)
    mass, deep = 1.0 + 2e-4, 0.02 * 0.2
    asked = 2.0 * mass * G * 0.5 / deep**2
    told = solution.bodies["floor"]
    assert told["chosen"] and asked <= told["stiffness"] <= 1.1 * asked
    assert 0.3 * deep < told["overlap"] < deep


@pytest.mark.slow
def test_a_ball_rolls_down_a_slope():
    """5/7 g sin α, without slip, of bodies on ground; and a box on it rests."""
    angle = 0.3
    turned = [[float(np.cos(angle)), 0.0, float(np.sin(angle))], [0.0, 1.0, 0.0]]
    scene = refweb.Scene.from_dict({
        "web": {"kind": "inline", "points": [[9, 0, 9], [9, 1, 9]], "lines": [[0, 1]], "supports": [0, 1]},
        "cable": {"law": "linear", "modulus": 1e7, "area": 1e-6, "density": 1000.0},
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "body": [
            {"name": "slope", "shape": "plane", "normal": slope_of(angle), "position": [0, 0, 0], "fixed": True},
            {"name": "ball", "radius": 0.1, "mass": 2.0, "position": [0.1 * x for x in slope_of(angle)]},
            {"name": "box", "shape": "box", "size": [0.2, 0.2, 0.1], "mass": 1.0, "axes": turned,
             "position": [0.05 * slope_of(angle)[0], 1.0, 0.05 * slope_of(angle)[2]]},
        ],
        "contact": {"stiffness": 1e5, "friction": 0.6, "slip_velocity": 1e-3, "damping": 1.0, "between_bodies": True},
        "solve": {"kind": "dynamic", "duration": 0.5},
        "accuracy": {"error": "none"},
    })  # fmt: skip
    solution = refweb.run(scene)
    state, net = solution.state, solution.state.system.net
    down = np.array([-np.cos(angle), 0.0, -np.sin(angle)])
    _, ball, box = net.bodies
    assert state.v[ball.row] @ down == pytest.approx(5.0 / 7.0 * G * np.sin(angle) * 0.5, rel=1e-2)
    assert np.linalg.norm(ball.turning(state.x, state.v)) == pytest.approx(state.v[ball.row] @ down / 0.1, rel=1e-2)
    assert abs(state.v[box.row] @ down) < 3e-3 and np.linalg.norm(state.x[box.row]) < 5e-3


# Terrain


def grid_of(f, count=9, size=2.0):
    t = np.linspace(-0.5 * size, 0.5 * size, count)
    x, y = np.meshgrid(t, t, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), f(x, y).ravel()])


def write_csv(path, places):
    path.write_text("x,y,z\n" + "\n".join(",".join(map(repr, row)) for row in places.tolist()) + "\n")
    return str(path)


def falling(**body):
    """A net of 0.6 m whose corners are heavy, which falls on ground."""
    return refweb.Scene.from_dict({
        "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.15},
        "cable": {"law": "tension-only", "modulus": 1e7, "area": 1e-6, "density": 1000.0},
        "supports": {"nodes": []},
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "velocity": [{"node": "all", "value": [0.4, 0.0, -2.0]}],
        "body": [{"name": "ground", "fixed": True, "position": [0.05, 0.02, -0.12], **body}],
        "contact": {"stiffness": 50.0, "friction": 0.2, "damping": 0.3},
        "solve": {"kind": "dynamic", "duration": 0.12, "step_size": 5e-5},
        "output": {"interval": 0.02, "frames": 3},
        "accuracy": {"error": "none"},
    })  # fmt: skip


@pytest.mark.parametrize("kind", ["grid", "scattered", "obj"])
def test_terrain_that_is_a_slope_is_the_plane(kind, tmp_path):
    """Splines are exact on a plane, so that nodes move alike to rounding; the surface that is told is exact too."""
    places = grid_of(lambda x, y: 0.2 * x - 0.1 * y)
    if kind == "grid":
        file = write_csv(tmp_path / "it.csv", np.random.default_rng(0).permutation(places))
    elif kind == "scattered":
        inner = np.random.default_rng(1).uniform(-0.9, 0.9, (60, 2))
        inner = np.column_stack([inner, inner @ [0.2, -0.1]])
        file = write_csv(tmp_path / "it.csv", np.vstack([places[(np.abs(places[:, :2]) == 1.0).any(axis=1)], inner]))
    else:
        faces = [[9 * i + j, 9 * i + j + 1, 9 * i + j + 10, 9 * i + j + 9] for i in range(8) for j in range(8)]
        file = solids.write(tmp_path / "it.obj", places, faces)
    one = refweb.run(falling(shape="terrain", heights=file))
    other = refweb.run(falling(shape="plane", normal=[-0.2, 0.1, 1.0]))
    assert one.passage["bodies"] == other.passage["bodies"] == "certified"
    assert other.bodies["ground"]["overlap"] > 2e-3
    nodes = one.state.system.net.nodes
    within = 1e-5 if kind == "scattered" else 1e-9  # two cells away a neighbour's triangle may not be the nearest
    np.testing.assert_allclose(one.state.x[:nodes], other.state.x[:nodes], rtol=0, atol=within)
    assert one.bodies["ground"]["overlap"] == pytest.approx(other.bodies["ground"]["overlap"], abs=within)


def test_depth_below_a_hill_is_the_distance_from_it(tmp_path):
    """A ridge of two slopes, whose distance is known; its volume and that of a block below it as well."""
    file = write_csv(tmp_path / "it.csv", grid_of(lambda x, y: 0.5 - 0.5 * np.abs(x), 9))
    body = refweb.Body(name="hill", shape="terrain", heights=file, position=(0, 0, 0), fixed=True)
    shape = body.form
    assert shape.volume() == pytest.approx(2.0 * 2.0 * (0.5 + 0.25), rel=1e-12)  # a quarter of 2 m deep below 0
    rng = np.random.default_rng(2)
    p = np.column_stack([rng.uniform(-0.7, 0.7, (400, 2)), rng.uniform(0.1, 0.8, 400)])
    normal = np.array([0.5, 1.0]) / np.hypot(0.5, 1.0)
    u, w = np.abs(p[:, 0]), p[:, 2] - 0.5
    off = u * normal[0] + w * normal[1]
    along = u * normal[1] - w * normal[0]  # from the ridge down; behind it the ridge itself is nearest
    exact = np.where(along > 0.0, -off, -np.hypot(u, w))
    found = shape.solid.field.at(p)[0]
    near = (exact > -0.1) & (exact < 0.3)  # the field ends three cells outside
    assert np.abs(found - exact)[near].max() < 0.5 * shape.solid.field.spacing
    smooth = near & (np.abs(p[:, 0]) > 0.25)
    np.testing.assert_allclose(found[smooth], exact[smooth], rtol=0, atol=1e-6)
    deeper = refweb.Body(name="hill", shape="terrain", heights=file, thickness=1.0, position=(0, 0, 0), fixed=True).form
    assert deeper.volume() == pytest.approx(2.0 * 2.0 * 1.25, rel=1e-12)
    assert any("surface within" in text for text in shape.texts()) and shape.frame().shape == (3, 3)


def test_a_slope_from_a_file_is_the_box_that_is_turned(tmp_path):
    """A net that lies under its weight on open ground with a slope of 0.2, in statics and as on a box in its place."""
    lines = ["v -2 -2 -0.4", "v 0 -2 0", "v 2 -2 0.4", "v -2 0 -0.4", "v 0 0 0", "v 2 0 0.4", "v -2 2 -0.4", "v 0 2 0"]
    (tmp_path / "terrain.obj").write_text(
        "\n".join([*lines, "v 2 2 0.4", "f 1 2 5 4", "f 2 3 6 5", "f 4 5 8 7", "f 5 6 9 8"])
    )
    given = {
        "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.5},
        "cable": {"law": "tension-only", "modulus": 3e5, "area": 1e-6, "density": 1000.0},
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "contact": {"stiffness": 10.0},
        "solve": {"kind": "static"},
        "observe": [{"name": "push", "quantity": "reaction", "body": "target", "component": "z"}],
    }
    terrain = {"name": "target", "shape": "terrain", "heights": "terrain.obj", "position": [0, 0, -0.21], "fixed": True}
    one = refweb.run(refweb.Scene.from_dict({**given, "body": [terrain]}, tmp_path))
    angle = np.arctan(0.2)
    up = np.array([-np.sin(angle), 0.0, np.cos(angle)])
    box = {"name": "target", "shape": "box", "size": [6.0, 6.0, 2.0], "rounding": 0.9, "fixed": True,
           "axes": [[float(np.cos(angle)), 0.0, float(np.sin(angle))], [0.0, 1.0, 0.0]],
           "position": (np.array([0.0, 0.0, -0.21]) - up).tolist()}  # fmt: skip
    other = refweb.run(refweb.Scene.from_dict({**given, "body": [box]}))
    assert one.results["push"].value == pytest.approx(other.results["push"].value, rel=1e-6)
    assert one.results["push"].value < -0.01
    nodes = one.state.system.net.nodes
    np.testing.assert_allclose(one.positions[:nodes], other.positions[:nodes], rtol=0, atol=1e-5)
    open_ = {**terrain, "shape": "mesh", "file": "terrain.obj"}
    del open_["heights"]
    with pytest.raises(refweb.InputError, match=r'has no inside.*Open ground is shape = "terrain" with heights = FILE'):
        refweb.Scene.from_dict({**given, "body": [open_]}, tmp_path).build()


SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0.5, 1.0], [1, 0.5, 1.0]], dtype=float)
REFUSED = {
    "it.txt": ("", r'format ".txt" must be one of .csv, .obj, .stl, .vtp'),
    "none.csv": (None, "there is no file"),
    "columns.csv": ("x,y,h\n0,0,0\n", 'column "h" is unknown'),
    "line.csv": ("x,y,z\n0,0,0\n1,1,0\n2,2,0\n", "3 places lie on one line"),
    "twice.csv": ("x,y,z\n0,0,0\n1,0,0\n0,1,0\n0,0,1\n", "two heights at a place"),
    "wall.obj": ("v 0 0 0\nv 1 0 0\nv 1 0 1\nf 1 2 3\n", r"1 of its triangles stand upright, such as the one at \("),
    "over.obj": (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0.1 1\nv 1 0.1 1\nf 1 2 3 4\nf 4 3 6 5\n",
        "must have one height at each place",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_ground_is_refused(name, tmp_path):
    content, message = REFUSED[name]
    if content is not None:
        (tmp_path / name).write_text(content)
    body = refweb.Body(name="it", shape="terrain", heights=str(tmp_path / name), position=(0, 0, 0), fixed=True)
    with pytest.raises(refweb.InputError, match=message) as error:
        body.form.settle()
    assert str(error.value).startswith("heights = ") and "\n" not in str(error.value)


@pytest.mark.parametrize(
    "keys, message",
    [
        (dict(shape="plane", fixed=True), "normal is missing: give normal = ... or orientation = ..."),
        (dict(shape="plane", normal=[0, 0, 0], fixed=True), r"normal = \[0.0, 0.0, 0.0\] must not be zero"),
        (dict(shape="plane", normal=[0, 0, 1], mass=1.0), 'shape = "plane" must have fixed = true'),
        (dict(shape="plane", normal=[0, 0, 1], density=1.0, fixed=True), "density has no meaning for shape"),
        (dict(shape="terrain", heights="it.csv", mass=1.0), 'shape = "terrain" must have fixed = true'),
    ],
)
def test_keys_of_ground_are_checked(keys, message):
    with pytest.raises(refweb.InputError, match=message):
        refweb.Body(name="it", position=(0, 0, 0), **keys)


@pytest.mark.slow
def test_the_error_of_terrain_is_that_of_the_ground(tmp_path):
    """None on a slope, whatever its rim; of waves it falls with the grid."""
    slope = write_csv(tmp_path / "slope.csv", grid_of(lambda x, y: 0.2 * x - 0.1 * y))
    assert refweb.Body(name="it", shape="terrain", heights=slope, position=(0, 0, 0), fixed=True).form.error < 1e-12
    waves = write_csv(tmp_path / "waves.csv", grid_of(lambda x, y: 0.1 * np.sin(4 * x) * np.cos(3 * y), 41))
    forms = [
        refweb.Body(name="it", shape="terrain", heights=waves, grid=grid, position=(0, 0, 0), fixed=True).form
        for grid in (24, 48, 96)
    ]
    errors = np.array([form.error for form in forms])
    assert (errors[1:] < 0.6 * errors[:-1]).all() and errors[-1] < forms[-1].solid.field.error
    rng = np.random.default_rng(4)
    p = rng.uniform(-0.8, 0.8, (300, 2))
    height = 0.1 * np.sin(4 * p[:, 0]) * np.cos(3 * p[:, 1])
    found = forms[-1].solid.field.at(np.column_stack([p, height]))[0]
    sagitta = 0.05**2 / 8 * 0.1 * (16 + 9 + 12)  # of triangles of 0.05 m, by the second derivatives
    assert np.abs(found).max() < errors[-1] + sagitta


@pytest.mark.slow
@pytest.mark.parametrize("shape", [{"radius": 0.1}, {"shape": "box", "size": [0.2, 0.3, 0.1]}])
def test_bodies_move_on_a_terrain_as_on_the_plane(shape, tmp_path):
    """A ball and a box that fall on a slope, skid and turn."""
    file = write_csv(tmp_path / "it.csv", grid_of(lambda x, y: 0.2 * x - 0.1 * y, size=4.0))
    grounds = {"shape": "terrain", "heights": file}, {"shape": "plane", "normal": [-0.2, 0.1, 1.0]}
    states = []
    for ground in grounds:
        scene = refweb.Scene.from_dict({
            "web": {"kind": "inline", "points": [[9, 0, 9], [9, 1, 9]], "lines": [[0, 1]], "supports": [0, 1]},
            "cable": {"law": "linear", "modulus": 1e7, "area": 1e-6, "density": 1000.0},
            "gravity": {"acceleration": [0.0, 0.0, -G]},
            "body": [
                {"name": "ground", "position": [0, 0, 0], "fixed": True, **ground},
                {"name": "it", "mass": 2.0, "position": [0.1, 0.0, 0.2], "velocity": [0.5, 0.0, -1.0],
                 "angular_velocity": [0.0, 3.0, 0.0], **shape},
            ],
            "contact": {"stiffness": 2e4, "friction": 0.3, "slip_velocity": 1e-2, "damping": 0.3,
                        "between_bodies": True},
            "solve": {"kind": "dynamic", "duration": 0.3, "step_size": 1e-4},
            "accuracy": {"error": "none"},
        })  # fmt: skip
        solution = refweb.run(scene)
        assert solution.passage["pairs"] == "certified"
        states.append(solution.state)
    body = states[0].system.net.bodies[1]
    assert np.linalg.norm(states[1].v[body.row] - [0.5, 0.0, -1.0 - 0.3 * G]) > 0.5
    np.testing.assert_allclose(states[0].x[body.row], states[1].x[body.row], rtol=0, atol=1e-6)
    np.testing.assert_allclose(
        body.turning(states[0].x, states[0].v), body.turning(states[1].x, states[1].v), rtol=0, atol=1e-4
    )


def test_a_choice_that_was_too_soft_on_a_plane_is_repeated():
    """A heavy ball presses a net into the floor, which nothing at the start tells of: a tenth of a line is the most."""
    scene = refweb.Scene.from_dict({
        "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.15},
        "cable": {"law": "tension-only", "modulus": 1e6, "area": 1e-6, "density": 1000.0},
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "body": [
            {"name": "floor", "shape": "plane", "normal": [0, 0, 1], "position": [0, 0, -0.02], "fixed": True},
            {"name": "ball", "radius": 0.05, "mass": 0.2, "position": [0, 0, 0.3]},
        ],
        "contact": {},
        "solve": {"kind": "dynamic", "duration": 0.3},
        "accuracy": {"error": "none"},
    })  # fmt: skip
    solution = refweb.run(scene)
    told = solution.bodies["floor"]
    assert any('m deep in body "floor"' in text and "repeated with stiffness" in text for text in solution.warnings)
    assert told["chosen"] and 0.0 < told["overlap"] <= told["allowed"] == pytest.approx(0.1 * 0.15)
