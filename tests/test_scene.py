"""Scene files: every table and key, what they mean in statics, and how wrong ones are refused."""

import copy
import pathlib
import shutil
import tomllib

import numpy as np
import pytest
import tomli_w

import refweb
from refweb import scene as scenes
from refweb.results.files import as_toml

EA = 10.0


def chain(**changes):
    """Four nodes at x = 0 … 3 in a row that may only move along x, as the dict of a scene file."""
    given = {
        "web": {
            "kind": "inline",
            "points": [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]],
            "lines": [[0, 1], [1, 2], [2, 3]],
            "supports": [0, 3],
            "names": {"tip": 2, "inner": [1, 2]},
            "groups": ["end", "", "end"],
        },
        "cable": {"law": "linear", "modulus": EA / 0.5, "area": 0.5, "density": 8.0},
        "support": [{"nodes": "all", "components": ["y", "z"]}],
        "load": [{"node": 1, "force": [1.0, 0.0, 0.0]}, {"node": "tip", "force": [-0.7, 0.0, 0.0]}],
        "solve": {"kind": "static"},
    }
    return {**given, **changes}


def changed(given, path, value):
    """The scene with the key at a dotted path set, or left out where the value is None."""
    given = copy.deepcopy(given)
    *way, last = path.split(".")
    table = given
    for key in way:
        table = table[int(key)] if isinstance(table, list) else table[key]
    if value is None:
        del table[last]
    else:
        table[last] = value
    return given


def moved(*forces, k=EA):
    """Displacement along x of the two inner nodes of the chain under nodal forces."""
    return np.linalg.solve(k * np.array([[2.0, -1.0], [-1.0, 2.0]]), forces)


def solve(given):
    return refweb.run(refweb.Scene.from_dict(given))


def write(folder, given):
    path = pathlib.Path(folder, "scene.toml")
    path.write_text(given if isinstance(given, str) else tomli_w.dumps(given), encoding="utf-8")
    return path


FULL = """
schema = 1
title = "Everything that statics has"
seed = 3

[web]
kind = "inline"
points = [[0, 0, 0], [1, 0, 0], [2, 0.5, 0], [3, 0, 0]]
lines = [[0, 1], [1, 2], [2, 3]]
natural_length = "distance"
supports = [0, 3]
names = { tip = 2, ends = [0, 3] }
groups = ["end", "middle", "end"]

[cable]
law = "smooth"
modulus = 7e7
area = 1e-4
density = 200.0
slackness = 1e-4
smoothing = 1e-5
prestrain = 0.01
strength = 2e8
order = 2
subdivide = 3
[cable.groups.end]
modulus = 8e7
area = 2e-4
density = 300.0
slackness = 2e-4
smoothing = 2e-5
prestrain = 0.02
strength = 3e8
[cable.groups.middle]
area = 1.5e-4

[supports]
nodes = ["rim", 0]
components = ["x", "y", "z"]
[[support]]
nodes = "all"
components = ["y"]
[[support]]
nodes = "tip"
components = ["z"]

[gravity]
acceleration = [0.0, 0.0, -9.81]
[[load]]
node = "tip"
force = [0.1, 0.0, 1.0]
[[load]]
node = [1, "tip"]
force = [0.0, 0.0, 1.0]
factor = [[0.0, 0.0], [1.0, 1.0]]
[[motion]]
node = "ends"
displacement = [[0.0, 0.0, 0.0, 0.0], [1.0, -0.2, 0.0, 0.0]]

[solve]
kind = "static"
method = "newton"
load_steps = [1, 2.5]
mass = "consistent"

[output]
frames = 2

[[observe]]
name = "tip height"
quantity = "position"
node = "tip"
component = "z"
reduce = "max"
[[observe]]
name = "line 1"
quantity = "tension"
line = 1
reduce = "min"
"""


def test_every_table_and_key(tmp_path):
    scene = refweb.Scene.load(write(tmp_path, FULL))
    end = refweb.Group(
        modulus=8e7, area=2e-4, density=300, slackness=2e-4, smoothing=2e-5, prestrain=0.02, strength=3e8
    )
    assert scene == refweb.Scene(
        title="Everything that statics has",
        seed=3,
        web=refweb.Inline(
            points=[[0, 0, 0], [1, 0, 0], [2, 0.5, 0], [3, 0, 0]],
            lines=[[0, 1], [1, 2], [2, 3]],
            supports=[0, 3],
            names={"tip": 2, "ends": [0, 3]},
            groups=["end", "middle", "end"],
        ),
        cable=refweb.Cable(
            law="smooth",
            modulus=7e7,
            area=1e-4,
            density=200,
            slackness=1e-4,
            smoothing=1e-5,
            prestrain=0.01,
            strength=2e8,
            order=2,
            subdivide=3,
            groups={"end": end, "middle": refweb.Group(area=1.5e-4)},
        ),
        supports=refweb.Supports(nodes=["rim", 0]),
        support=[refweb.Supports(nodes="all", components=["y"]), refweb.Supports(nodes="tip", components=[2])],
        effects=[
            refweb.Gravity(acceleration=(0, 0, -9.81)),
            refweb.Load(node="tip", force=(0.1, 0, 1)),
            refweb.Load(node=[1, "tip"], force=(0, 0, 1), factor=[(0, 0), (1, 1)]),
            refweb.Motion(node="ends", displacement=[(0, 0, 0, 0), (1, -0.2, 0, 0)]),
        ],
        solve=refweb.Static(load_steps=[1, 2.5], mass="consistent"),
        output=refweb.Output(frames=2),
        observe=[
            refweb.Observe(name="tip height", quantity="position", node="tip", component=2, reduce="max"),
            refweb.Observe(name="line 1", quantity="tension", line=1, reduce="min"),
        ],
    )
    assert len(scene.build().terms) == 4


def test_defaults(tmp_path):
    given = chain()
    given["web"] = {"kind": "cable", "start": [0, 0, 0], "end": [1, 0, 0], "elements": 2}
    given["cable"] = {"modulus": 1.0, "area": 1.0, "density": 0}
    del given["support"], given["load"]
    path = write(tmp_path, given)
    path = path.rename(path.with_name("my web.toml"))
    assert refweb.Scene.load(path).to_dict() == {
        "schema": 1,
        "title": "my web",
        "seed": 0,
        "web": given["web"],
        "cable": {
            "law": "smooth",
            "modulus": 1.0,
            "area": 1.0,
            "density": 0.0,
            "slackness": 0.0,
            "smoothing": 1e-5,
            "prestrain": 0.0,
            "safety_factor": 1.0,
            "knot_factor": 1.0,
            "order": 1,
            "subdivide": 1,
            "groups": {},
        },
        "solve": {"kind": "static", "method": "newton", "load_steps": [1.0], "mass": "lumped", "factorization": "auto"},
        "output": {"frames": 1},
        "observe": [
            {"name": "deflection", "quantity": "displacement", "reduce": "max"},
            {"name": "max_stress", "quantity": "stress", "reduce": "max"},
            {"name": "max_tension", "quantity": "tension", "reduce": "max"},
        ],
        "accuracy": {"error": "twin", "refine": False, "horizon": False, "level": "time"},
    }


SHIPPED = {path.stem: path.read_text(encoding="utf-8") for path in scenes.SHIPPED_SCENES.glob("*.toml")}
WINDOW = {"kind": "window", "mesh": "triangle", "rows": 3, "columns": 3, "side": 0.1}
LAYERS = {"kind": "layers", "mesh": "hexagon", "layers": 2, "cell_area": 0.1}
CABLE = {"kind": "cable", "start": [0, 0, 0], "end": [0, 0, 1], "elements": 3, "length": 2, "sag": [0, 1, 0]}
PULL = [{"node": 1, "force": [0.0, 0.0, 1.0]}]
WEBS = {web["kind"]: tomli_w.dumps(chain(web=web, load=PULL)) for web in (WINDOW, LAYERS, CABLE)}


@pytest.mark.parametrize("content", [FULL, *SHIPPED.values(), *WEBS.values()], ids=["full", *SHIPPED, *WEBS])
def test_round_trip_is_a_fixed_point(tmp_path, content):
    for file in scenes.SHIPPED_SCENES.glob("*.csv"):
        shutil.copy(file, tmp_path)
    scene = refweb.Scene.load(write(tmp_path, content))
    again = refweb.Scene.load(write(tmp_path, scene.to_dict()))
    assert again.to_dict() == scene.to_dict() and tomli_w.dumps(again.to_dict()) == tomli_w.dumps(scene.to_dict())
    web = again.web if scene.web.kind == "file" else scene.web  # whose paths are absolute
    assert sorted(map(repr, again.effects)) == sorted(map(repr, scene.effects))  # whose order may be another
    assert again == scene.replace(observe=scene.observables, web=web, effects=again.effects)
    given = tomllib.loads(content)
    for table in ("web", "cable", "solve"):
        written = scene.to_dict()[table]
        files = {"path", "lines", "positions"} if given[table].get("kind") == "file" else set()
        kept = set(given[table]) - {"groups", "names"} - files
        assert all(written[key] == given[table][key] for key in kept)


def test_paths_start_at_the_scene_and_are_written_absolute(tmp_path, monkeypatch):
    import meshio

    (tmp_path / "nets").mkdir()
    monkeypatch.chdir("/")
    net = meshio.Mesh(np.array([[0.0, 0, 0], [1, 0, 0]]), [("line", [[0, 1]])], point_data={"support": [1.0, 0.0]})
    meshio.write(tmp_path / "nets" / "net.vtu", net)
    given = chain(web={"kind": "file", "path": "nets/net.vtu"}, load=[{"node": 1, "force": [1.0, 0.0, 0.0]}])
    scene = refweb.Scene.load(write(tmp_path, given))
    assert scene.to_dict()["web"]["path"] == str(tmp_path / "nets" / "net.vtu")
    np.testing.assert_allclose(refweb.run(scene).displacement, [[0, 0, 0], [1 / EA, 0, 0]], rtol=1e-9)


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_line_ends_and_byte_order_mark(tmp_path, ending):
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xef\xbb\xbf" + FULL.replace("\n", ending).encode())
    assert refweb.Scene.load(path).title == "Everything that statics has"


def supported(**tables):
    """Which components of each node are held, as texts such as "xz"."""
    system = refweb.Scene.from_dict(chain(**tables)).build()
    return ["".join(np.array(["x", "y", "z"])[row]) for row in system.supported]


def test_supports_replace_and_support_adds():
    along_y = [{"nodes": 1, "components": ["y"]}]
    assert supported(support=along_y) == ["xyz", "y", "", "xyz"]
    assert supported(support=[{"nodes": 1}], supports={"nodes": []}) == ["", "xyz", "", ""]
    assert supported(support=[{"nodes": ["tip"]}], supports={"nodes": 0, "components": [2, 0]}) == ["xz", "", "xyz", ""]
    assert supported(support=along_y, supports={"nodes": "all", "components": ["z"]}) == ["z", "yz", "z", "z"]
    assert supported(support=along_y, supports={"nodes": "rim", "components": ["x"]}) == ["x", "y", "", "x"]


def check_observed(given, unit, *cases):
    """Each case: a table of [[observe]], its value and the node or line it stands at."""
    tables = [{"name": f"o{i}", **table} for i, (table, _, _) in enumerate(cases)]
    results = solve({**given, "observe": tables}).results
    for table, (_, value, where) in zip(tables, cases, strict=True):
        found = results[table["name"]]
        assert found.value == pytest.approx(value, rel=1e-9, abs=1e-14), table
        assert (found.where, found.unit) == (where, unit), table


def test_observed_displacement_and_position():
    """Signed where a component is given, else the magnitude; the largest where no node is."""
    u1, u2 = moved(0.8, -1.0)
    assert u1 > 0 > u2 and abs(u2) > u1
    check_observed(
        chain(load=[{"node": 1, "force": [0.8, 0, 0]}, {"node": 2, "force": [-1.0, 0, 0]}]),
        "m",
        ({"quantity": "displacement"}, -u2, 2),
        ({"quantity": "displacement", "component": "x"}, u1, 1),
        ({"quantity": "displacement", "component": 0, "node": "tip"}, u2, 2),
        ({"quantity": "displacement", "node": 2}, -u2, 2),
        ({"quantity": "displacement", "node": [2]}, -u2, 2),
        ({"quantity": "displacement", "node": "inner"}, -u2, 2),
        ({"quantity": "displacement", "node": [0, 2], "component": "x"}, 0.0, 0),
        ({"quantity": "position", "component": "x"}, 3.0, 3),
        ({"quantity": "position", "node": 1}, 1.0 + u1, 1),
        ({"quantity": "position", "node": 1, "component": 2}, 0.0, 1),
    )


def test_observed_lines_and_reactions():
    """Without a node the reactions are summed, as they are over several nodes."""
    u1, u2 = moved(1.0, -0.7)
    t0, t1, t2 = EA * u1, EA * (u2 - u1), -EA * u2
    assert t0 > t2 > 0 > t1
    stress = {"quantity": "stress"}
    check_observed(chain(), "Pa", (stress, t0 / 0.5, 0), ({**stress, "line": 2}, t2 / 0.5, 2))
    check_observed(chain(), "1", ({"quantity": "strain"}, u1, 0), ({"quantity": "slack_fraction"}, 1 / 3, None))
    check_observed(
        chain(),
        "N",
        ({"quantity": "tension"}, t0, 0),
        ({"quantity": "tension", "line": 1}, t1, 1),
        ({"quantity": "reaction"}, 0.3, None),
        ({"quantity": "reaction", "component": "x"}, -0.3, None),
        ({"quantity": "reaction", "node": "rim"}, 0.3, None),
        ({"quantity": "reaction", "node": [0, 1], "component": "x"}, -t0, None),
        ({"quantity": "reaction", "node": 0, "component": "x"}, -t0, 0),
        ({"quantity": "reaction", "node": 3}, t2, 3),
        ({"quantity": "reaction", "node": 1}, 0.0, 1),
    )


def test_observed_energies():
    given = chain(gravity={"acceleration": [2.0, 0.0, 0.0]})
    weight = 8.0 * 0.5 * 1.0 * 2.0  # density, area, one metre of line for each inner node, acceleration
    u1, u2 = moved(1.0 + weight, -0.7 + weight)
    strain, potential = EA / 2 * (u1**2 + (u2 - u1) ** 2 + u2**2), -weight * (u1 + u2)
    check_observed(
        given,
        "J",
        ({"quantity": "strain_energy"}, strain, None),
        ({"quantity": "potential_energy"}, potential, None),
        ({"quantity": "total_energy"}, strain + potential, None),
        ({"quantity": "work"}, 1.0 * u1 - 0.7 * u2, None),
    )


def test_load_steps_play_time():
    """A load is multiplied by the step, its table and motion are read at it, and gravity acts in full."""
    loads = [
        {"node": 1, "force": [1.0, 0.0, 0.0]},
        {"node": "tip", "force": [1.0, 0.0, 0.0], "factor": [[0.0, 0.0], [1.0, 2.0], [3.0, -1.0]]},
    ]
    given = chain(
        load=loads,
        gravity={"acceleration": [0.5, 0.0, 0.0]},
        motion=[{"node": 3, "displacement": [[1.0, 0.0, 0.0, 0.0], [2.0, 0.4, 0.0, 0.0]]}],
        solve={"kind": "static", "load_steps": [0.5, 2, 10, -1]},
        observe=[{"name": "x", "quantity": "displacement", "node": "tip", "component": "x", "reduce": "max"}],
    )
    solution = solve(given)
    weight = 8.0 * 0.5 * 0.5
    cases = [(0.5, 1.0, 0.0), (2.0, 0.5, 0.4), (10.0, -1.0, 0.4), (-1.0, 0.0, 0.0)]
    right = [moved(step + weight, factor + weight + EA * end)[1] for step, factor, end in cases]
    np.testing.assert_allclose(solution.history["x"], right, rtol=1e-9)
    assert [step["results"]["x"].value for step in solution.steps] == solution.history["x"].tolist()
    assert solution.results["x"].value == solution.history["x"][-1] and solution.results["x"].time == -1.0
    np.testing.assert_array_equal(solution.history["step"], [0.5, 2, 10, -1])


def test_groups_and_prestrain():
    """A straight chain pulled by its own prestrain: one tension, shared by lines in series."""
    given = changed(chain(), "load", None)
    given["cable"] |= {"prestrain": 0.1, "groups": {"end": {"area": 1.0, "prestrain": 0.05, "density": 4.0}}}
    scene = refweb.Scene.from_dict(given)
    net = scene.build().net
    natural = np.array([1 / 1.05, 1 / 1.1, 1 / 1.05])
    stiffness = np.array([20.0, 10.0, 20.0])
    np.testing.assert_allclose(net.natural_length, natural, rtol=1e-15)
    np.testing.assert_allclose(net.mass.sum(), 4.0 * (2 / 1.05) + 4.0 / 1.1, rtol=1e-15)
    tension = (3.0 - natural.sum()) / (natural / stiffness).sum()
    solution = refweb.run(scene)
    np.testing.assert_allclose(solution.tension, tension, rtol=1e-9)
    np.testing.assert_allclose(solution.stress, tension / np.array([1.0, 0.5, 1.0]), rtol=1e-9)


@pytest.mark.parametrize(
    "law, given, filled",
    [
        ("smooth", {}, (0.0, 1e-5)),
        ("smooth", {"smoothing": 0, "slackness": 1}, (1.0, 0.0)),
        ("linear", {}, (None, None)),
        ("tension-only", {}, (None, None)),
    ],
)
def test_parameters_of_the_law(law, given, filled):
    cable = refweb.Cable(law=law, modulus=1, area=1, density=1, **given)
    assert (cable.slackness, cable.smoothing) == filled


STILL = {"node": 0, "displacement": [[0, 0, 0, 0]]}
UNKNOWN = "unknown table or key, or of a plug-in that is not installed"
# Each wrong scene: where the chain is changed, to what, and what the one line says.
WRONG = [
    # unknown tables and keys
    (
        "gravty",
        {"acceleration": [0, 0, 1]},
        '[gravty]: unknown table or key, or of a plug-in that is not installed, did you mean "gravity"?',
    ),
    ("tite", "x", 'tite = "x": unknown table or key, did you mean "title"?'),
    (
        "quux",
        {"a": 1},
        "[quux]: unknown table or key, or of a plug-in that is not installed, known: schema, title, seed, web",
    ),
    ("links", [{"nodes": [0, 1]}], f"[[links]]: {UNKNOWN}"),
    ("cable.groups", {"end": {"order": 2}}, "[cable] groups.end order = 2: unknown key, known: law, material, modulus"),
    ("solve.start", "equilibrium", '[solve] start = "equilibrium": unknown key, known: kind, method, load_steps, mass'),
    ("solve.duration", 0.25, "[solve] duration = 0.25: unknown key"),
    ("solve.rtol", 1e-6, "[solve] rtol = 1e-06: unknown key, known: kind, method, load_steps"),
    ("output", {"interval": 1e-3}, "[output] interval = 0.001"),
    ("output", {"frame": 2}, '[output] frame = 2: unknown key, did you mean "frames"?'),
    ("web.suports", [0], '[web] suports = [0]: unknown key, did you mean "supports"?'),
    ("cable.modulos", 1.0, '[cable] modulos = 1.0: unknown key, did you mean "modulus"?'),
    ("cable.groups", {"end": {"law": "linar"}}, '[cable] groups.end law = "linar" must be', 'did you mean "linear"?'),
    # misspelt and missing
    ("web.kind", "inlin", '[web] kind = "inlin": unknown kind, did you mean "inline"?'),
    ("web", {**WINDOW, "mesh": "hexagonn"}, '[web] mesh = "hexagonn" must be one of', 'did you mean "hexagon"?'),
    ("solve.kind", "statics", '[solve] kind = "statics": unknown kind', "static"),
    ("solve.method", "newtn", '[solve] method = "newtn" must be', '"newton"'),
    ("solve.mass", "lump", '[solve] mass = "lump" must be one of "lumped", "consistent"', 'did you mean "lumped"?'),
    ("cable.law", "Tension-Only", '[cable] law = "Tension-Only" must be one of', 'did you mean "tension-only"?'),
    ("web", None, "[web] is missing"),
    ("cable", None, "[cable] is missing"),
    ("solve", None, "[solve] is missing"),
    ("web.kind", None, "[web] kind is missing: one of paper, window"),
    ("solve.kind", None, "[solve] kind is missing"),
    ("cable.area", None, "[cable] area is missing: give area = ... [m²]"),
    ("load.0.force", None, "[[load]] 1 force is missing: give force = ... [N]"),
    # types
    ("schema", 2, "schema = 2 must be 1"),
    ("schema", True, "schema = true must be 1"),
    ("seed", -1, "seed = -1 must be ≥ 0"),
    ("seed", 2**63, "seed = 9223372036854775808 must be a whole number below 2⁶³"),
    ("seed", 1.0, "seed = 1.0 must be a whole number"),
    ("title", "two\nlines", 'title = "two lines" must be a printable text on one line'),
    ("title", "x" * 5000, "must be a text of at most 200 characters, not 5000"),
    ("title", "red \x1b[31m", r'title = "red \x1b[31m" must be a printable text'),
    ("web", "paper", 'web = "paper" must be a table: write [web]'),
    ("web", [{"kind": "paper"}], "must be a table: write [web]"),
    ("cable", 3, "[cable] = 3 must be a table"),
    ("cable.area", "1e-4", '[cable] area = "1e-4" must be a number [m²]'),
    ("cable.area", True, "[cable] area = true must be a number [m²]"),
    ("cable.area", float("nan"), "[cable] area = nan must be a finite number [m²]"),
    ("cable.modulus", float("inf"), "[cable] modulus = inf must be a finite number [Pa]"),
    ("cable.groups", [1], "[cable] groups = [1] must be a table of groups"),
    ("gravity", {"acceleration": [0, -9.81]}, "[gravity] acceleration = [0, -9.81] must be a vector of 3"),
    ("gravity", {"acceleration": -9.81}, "[gravity] acceleration = -9.81 must be a vector [x, y, z] [m/s²]"),
    ("load.0.force", [0, 0, float("-inf")], "[[load]] 1 force[2] = -inf must be a finite number [N]"),
    ("load.1.force", [0, 0, "1"], '[[load]] 2 force[2] = "1" must be a number [N]'),
    ("load", {"node": 1, "force": [0, 0, 1]}, "[load] =", "must be a list of tables: write [[load]]"),
    ("load", [], "load = [] must hold at least one table"),
    ("load.0.node", [], "[[load]] 1 node = [] must be at least one node"),
    ("load.0.node", 1.0, "[[load]] 1 node = 1.0 must be a node number or a name"),
    ("load.0.node", 10**30, "[[load]] 1 node = 1000000000000000000000000000000 must be a node number"),
    ("load.0.factor", [[1.0, 1.0], [0.0, 1.0]], "[[load]] 1 factor[1][0] = 0.0 must be > 1"),
    ("load.0.factor", [[1.0, 1.0, 1.0]], "[[load]] 1 factor[0] = [1.0, 1.0, 1.0] must be a row of 2 numbers, not 3"),
    ("solve.load_steps", [], "[solve] load_steps = [] must be a list with at least one number"),
    ("solve.load_steps", 5, "[solve] load_steps = 5 must be a list of numbers"),
    ("solve.load_steps", [1.0] * 100001, "[solve] load_steps has 100001 numbers, must be at most 100000"),
    ("output", {"frames": 0}, "[output] frames = 0 must be ≥ 1"),
    ("supports", {"nodes": 0, "components": []}, "[supports] components = [] must be a list with at least one of"),
    ("supports", {"components": ["x"]}, "[supports] nodes is missing"),
    ("support.0.components", ["w"], '[[support]] 1 components[0] = "w" must be one of 0, 1, 2, "x", "y", "z"'),
    ("cable.order", 2.0, "[cable] order = 2.0 must be one of 1, 2, 3"),
    ("cable.order", True, "[cable] order = true must be one of 1, 2, 3"),
    ("cable.subdivide", 2.5, "[cable] subdivide = 2.5 must be a whole number"),
    # limits
    ("cable.order", 4, "[cable] order = 4 must be one of 1, 2, 3"),
    ("cable.subdivide", 0, "[cable] subdivide = 0 must be ≥ 1"),
    ("cable.subdivide", 1001, "[cable] subdivide = 1001 must be ≤ 1000"),
    ("cable.area", -1e-4, "[cable] area = -0.0001 must be > 0 [m²]"),
    ("cable.density", -1, "[cable] density = -1.0 must be ≥ 0 [kg/m³]"),
    ("cable.prestrain", -1.0, "[cable] prestrain = -1.0 must be > -1 [1]"),
    ("cable.modulus", 1e308, "[cable] modulus = 1e+308 must be ≤ 1e+100 [Pa]"),
    ("cable.modulus", 10**400, "[cable] modulus = 1000", "must be a finite number [Pa]"),
    ("cable", {"modulus": 1e99, "area": 1e99, "density": 1}, "[cable] line 0: stiffness", "must be ≤ 1e+100 [N/m]"),
    ("cable.area", 1e-200, "[cable] area = 1e-200 must be ≥ 1e-100 [m²]"),
    ("cable.density", 5e-324, "[cable] density = 5e-324 must be 0 or ≥ 1e-100 [kg/m³]"),
    ("web", {**WINDOW, "rows": 10**9, "columns": 10}, "[web] rows × columns = 10000000000 must be ≤ 1000000"),
    ("web", {**CABLE, "elements": 10**9}, "[web] elements = 1000000000 must be ≤ 1e+06"),
    # what does not fit together
    ("cable.slackness", 0.0, '[cable] slackness = 0 has no meaning with law = "linear"'),
    ("cable.groups", {"end": {"smoothing": 1e-3}}, '[cable] smoothing = 0.001 has no meaning with law = "linear"'),
    ("cable.groups", {"ends": {"area": 1.0}}, '[cable.groups] "ends" is not a group of lines, did you mean "end"?'),
    ("cable.groups", {"": {"area": 1.0}}, '[cable.groups] "" is not a group of lines'),
    ("load.0.node", 4, "[[load]] 1 node = 4 must be 0 … 3"),
    ("load.0.node", -1, "[[load]] 1 node = -1 must be ≥ 0"),
    ("load.0.node", "tipp", '[[load]] 1 node = "tipp" names no node, did you mean "tip"?'),
    ("supports", {"nodes": [0, 7]}, "[supports] nodes[1] = 7 must be 0 … 3"),
    ("support.0.nodes", "rimm", '[[support]] 1 nodes = "rimm" names no node, did you mean "rim"?'),
    ("web.lines", [[0, 1], [1, 2], [2, 9]], "[web] lines[2] = [2, 9]", "0 … 3"),
    ("web.lines", [[0, 1], [1, 2], [1, 0]], "[web] node 3 is used by no line, no [[link]] and no [[thread]]"),
    (
        "web.lines",
        [[0, 1], [1, 0], [0, 1]],
        "[web] node 2 (and 1 more) is used by no line, no [[link]] and no [[thread]]",
    ),
    ("web.lines", [[0, 1], [1, 2], [3, 3]], "[web] lines[2] = [3, 3] joins a node to itself"),
    ("web.points", [[0, 0, 0], [1, 0, 0], [1, 0, 0], [3, 0, 0]], "[web] lines[1] = [1, 2] has no length"),
    ("web.points", [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0]], "[web] points[3] = [3, 0] must be a row of 3 numbers"),
    ("web.points", ["a", "b"], '[web] points[0] = "a" must be a row of 3 numbers'),
    ("web.points", [[[[0]], 0, 0]], "[web] points[0][0] = [[0]] must be a number"),
    ("web.groups", ["a"], "[web] groups has 1 entries for 3 lines"),
    ("web.natural_length", [1, 1], "[web] natural_length has 2 entries for 3 lines"),
    ("web.supports", [0, 9], "[web] supports[1] = 9 must be 0 … 3"),
    ("motion", [STILL, {**STILL, "node": "rim"}], "[[motion]] node 0 is moved by two tables"),
    ("motion", [{"node": 0, "displacement": [[0, 1.0, 0]]}], "[[motion]] 1 displacement[0] = [0, 1.0, 0]", "row of 4"),
]
OBSERVE = [
    ({"quantity": "deflection"}, '[[observe]] 1 quantity = "deflection" must be one of the quantities, did you mean'),
    ({"quantity": "velocity"}, '[[observe]] 1 quantity = "velocity"'),
    ({"quantity": "tension", "line": 3}, "[[observe]] 1 line = 3 must be 0 … 2"),
    ({"quantity": "tension", "line": -1}, "[[observe]] 1 line = -1 must be ≥ 0"),
    ({"quantity": "tension", "node": 1}, '[[observe]] 1 node = 1 has no meaning for quantity = "tension"'),
    ({"quantity": "tension", "component": 1}, '[[observe]] 1 component = 1 has no meaning for quantity = "tension"'),
    ({"quantity": "displacement", "line": 1}, '[[observe]] 1 line = 1 has no meaning for quantity = "displacement"'),
    (
        {"quantity": "displacement", "component": 3},
        '[[observe]] 1 component = "w" has no meaning for quantity = "displacement"',
    ),
    ({"quantity": "displacement", "node": "nix"}, '[[observe]] 1 node = "nix" names no node'),
    ({"quantity": "displacement", "body": "ball"}, '[[observe]] 1 body = "ball"'),
    ({"quantity": "displacement", "reduce": "mean"}, '[[observe]] 1 reduce = "mean" must be one of "max", "min"'),
    ({"quantity": "potential_energy"}, '[[observe]] 1 quantity = "potential_energy" needs [gravity]'),
    ({"quantity": "stress", "name": "a,b"}, '[[observe]] 1 name = "a,b" must have no commas'),
    ({"quantity": "stress", "name": "a\nb"}, '[[observe]] 1 name = "a b" must be a printable text'),
    ({"quantity": "stress", "name": "step"}, '[[observe]] 1 name = "step" is a column of its own'),
    ({"quantity": "work", "name": "total_energy"}, '[[observe]] 1 name = "total_energy" is a column of its own'),
]
WRONG += [("observe", [{"name": "o", **table}], message) for table, message in OBSERVE]
TWICE = [{"name": "o", "quantity": "stress"}, {"name": "o", "quantity": "strain"}]
WRONG.append(("observe", TWICE, '[[observe]] 2 name = "o" is the name of [[observe]] 1'))
IDS = [f"{i}-{path}" for i, (path, *_) in enumerate(WRONG)]


@pytest.mark.parametrize("path, value, parts", [(p, v, m) for p, v, *m in WRONG], ids=IDS)
def test_wrong_scene(tmp_path, path, value, parts):
    given = changed(chain(), path, value)
    if path == "web" and isinstance(value, dict):
        given["load"] = PULL
    refused(write(tmp_path, given), *parts)


def refused(path, *parts):
    with pytest.raises(refweb.InputError) as error:
        refweb.Scene.load(path).build()
    message = str(error.value)
    assert message.startswith("scene.toml: ") and len(message.splitlines()) == 1 and message.isprintable()
    assert len(message) < 320
    for part in parts:
        assert part in message


DYNAMIC = {"kind": "dynamic", "method": "central-difference", "duration": 0.1}
# What a scene must not have with its method or start: changes of the chain, and what the one line says.
UNFIT = {
    "order": (
        {"cable.order": 2, "cable.subdivide": 3},
        ["[cable] order = 2 must be 1 with central-difference", "use subdivide = 6", 'method = "cvode"'],
    ),
    "mass": (
        {"solve.mass": "consistent"},
        ['[solve] mass = "consistent" must be "lumped" with central-difference', 'method = "cvode"'],
    ),
    "folder": (
        {"solve.start": "nowhere"},
        ['[solve] start = "', 'nowhere": is not a folder; it must be "web", "equilibrium" or a result folder'],
    ),
    "misspelt": (
        {"solve.start": "equilibrum"},
        ['equilibrum": is not a folder; it must be "web", "equilibrium" or a result folder'],
    ),
    "file": ({"solve.start": "scene.toml"}, ['scene.toml": is not a folder']),
    "refine": (
        {"solve.start": "nowhere", "accuracy": {"refine": True}},
        ['[accuracy] refine = true must be false with [solve] start = "nowhere"', "finer ones have other nodes"],
    ),
    "step": (
        {"solve.step_size": 1e-15},
        ["[solve] step_size = 1e-15 must be ≥ 1e-11 [s]: a row takes at most 1e+08 steps"],
    ),
    "no result": ({"solve.start": "."}, ["checkpoint.npz cannot be read: No such file", "a result folder"]),
}


@pytest.mark.parametrize("case", UNFIT)
def test_scene_that_its_method_or_start_does_not_fit(tmp_path, monkeypatch, case):
    changes, parts = UNFIT[case]
    given = chain(solve=DYNAMIC)
    for path, value in changes.items():
        given = changed(given, path, value)
    monkeypatch.chdir("/")
    with pytest.raises(refweb.InputError) as error:
        refweb.run(write(tmp_path, given), out=tmp_path / "out")
    message = str(error.value)
    assert message.startswith("scene.toml: ") and message.isprintable() and len(message) < 320
    for part in parts:
        assert part in message
    assert [path.name for path in tmp_path.iterdir()] == ["scene.toml"]


TEXT = tomli_w.dumps(chain())
TEXTS = {
    "syntax": ("title = \n" + TEXT, "cannot be read: ", "line 1"),
    "twice": ('title = "a"\ntitle = "b"\n' + TEXT, "cannot be read: ", "line 2"),
    "digits": (f"seed = 1{'0' * 5000}\n" + TEXT, "cannot be read: Exceeds the limit"),
    "hexadecimal": (f"seed = 0x{'f' * 6000}\n" + TEXT, "seed = a int too large to show must be a whole number"),
    "overflow": ("seed = 1e400\n" + TEXT, "seed = inf must be a whole number"),
    "nesting": ("seed = " + "[" * 5000 + "]" * 5000 + "\n" + TEXT, "cannot be read: "),
    "nested": ("seed = " + "[" * 200 + "]" * 200 + "\n" + TEXT, "seed = [[[", "must be a whole number"),
    "date": ("seed = 1979-05-27\n" + TEXT, "seed = 1979-05-27 must be a whole number"),
    "nul": ("\0" + TEXT, "cannot be read: "),
    "empty": ("", "[web] is missing"),
    "key": ('"a\\nb\\u001b[2J" = 1\n' + TEXT, r"a b\x1b[2J = 1: unknown table or key"),
    "long key": ("k" * 100000 + " = 1\n" + TEXT, "kkk... = 1: unknown table or key"),
    "group": (TEXT + '[cable.groups."a\\nb"]\nfoo = 1\n', "[cable] groups.a b foo = 1: unknown key"),
}


@pytest.mark.parametrize("name", TEXTS)
def test_wrong_text(tmp_path, name):
    content, *parts = TEXTS[name]
    refused(write(tmp_path, content), *parts)


def test_not_utf_8(tmp_path):
    (tmp_path / "scene.toml").write_bytes(b"title = '\xff\xfe'\n" + TEXT.encode())
    refused(tmp_path / "scene.toml", "is not a scene, a text in UTF-8 (byte ")


@pytest.mark.parametrize(
    "source, hint",
    [
        ("hexagon-lod", 'did you mean "hexagon-load"?'),
        ("nowhere/at/all.toml", "no such file"),
        ("", "known: braked-net"),
        ("n" * 1000, "known: braked-net"),
        ("a\nb\0", "no such file"),
    ],
)
def test_no_such_scene(source, hint):
    with pytest.raises(refweb.InputError) as error:
        refweb.Scene.load(source)
    assert hint in str(error.value) and "no shipped scene" in str(error.value) and str(error.value).isprintable()


def test_shipped_by_name_unless_there_is_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert refweb.Scene.load("catenary").title == refweb.Scene.load("catenary.toml").title == "Catenary"
    (tmp_path / "catenary").write_text(FULL, encoding="utf-8")
    assert refweb.Scene.load("catenary").title == "Everything that statics has"


def test_scene_in_python():
    cable = refweb.Cable(law="linear", modulus=1, area=1, density=1)
    web = refweb.Web(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], rim=[0])
    with pytest.raises(refweb.InputError, match="title"):
        refweb.Scene(web=web, cable=cable, title="a\nb")
    with pytest.raises(refweb.InputError, match="str is not an effect"):
        refweb.Scene(web=web, cable=cable, effects=["gravity"])
    wrong = {"web": {"kind": "window"}, "cable": None, "solve": "static", "output": None, "accuracy": 4}
    for key, value in {**wrong, "observe": [3], "event": [None], "support": [[0]], "supports": [0]}.items():
        with pytest.raises(refweb.InputError, match=rf"^{key} = .* must be a? ?refweb\."):
            refweb.Scene(**{"web": web, "cable": cable, key: value})
    with pytest.raises(refweb.InputError, match="scene = 5 must be a Scene, a scene file or the name of a shipped"):
        refweb.run(5)
    gravity = refweb.Gravity(acceleration=(0, 0, -1))
    with pytest.raises(refweb.InputError, match="is listed 2 times"):
        refweb.Scene(web=web, cable=cable, effects=[gravity, gravity]).build()
    with pytest.raises(refweb.InputError, match="scene file cannot hold it"):
        refweb.Scene(web=web, cable=cable).to_dict()
    assert refweb.Scene(web=web, cable=cable, effects=[gravity]).build().rows == 2


@pytest.mark.parametrize("name", sorted(scenes.shipped()))
def test_a_shipped_scene_is_written_as_it_is_read(name):
    """With all tables that stand below others, such as the axle of a body, so that a result folder can be read."""
    scene = refweb.Scene.load(name)
    again = refweb.Scene.from_dict(tomllib.loads(as_toml(scene.to_dict())), scene.folder)
    assert again.to_dict() == scene.to_dict()
