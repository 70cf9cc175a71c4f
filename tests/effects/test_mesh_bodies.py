"""Bodies from files in contact: forces as the slope of one energy, and the motion of the shape that they are of."""

import subprocess
import sys
import tomllib

import nets
import numpy as np
import pytest
import solids

import refweb
from refweb.dynamics.integrators.central_difference import CentralDifference
from refweb.effects.contact.nonconvex_contacts import share_out
from refweb.effects.contact.pair import LINE_CONTACT

SIZE, ROUND = (0.3, 0.4, 0.24), 0.08
AXES = [(2.0, 1.0, -1.0), (-1.0, 2.0, 0.0)]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Files of an angle, a torus, a sphere, and the box whose edges are round."""
    folder = tmp_path_factory.mktemp("solids")
    surfaces = {"ell": solids.ell(), "torus": solids.torus(0.15, 0.06, 32), "ball": solids.sphere(0.15, 48)}
    normals, triangles = solids.sphere(1.0, 64)
    surfaces["box"] = ROUND * normals + np.sign(normals.round(12)) * (0.5 * np.array(SIZE) - ROUND), triangles
    return {name: solids.write(folder / f"{name}.stl", *surface) for name, surface in surfaces.items()}


def one_line(file, order=1, **contact):
    """(system, term of contact) of a line of 1 m across a fixed body at the origin."""
    web = refweb.Inline(points=[[-0.5, 0, 0], [0.5, 0, 0]], lines=[[0, 1]], supports=[]).web()
    body = refweb.Body(name="it", shape="mesh", file=file, position=(0.0, 0.0, 0.0), axes=AXES, fixed=True)
    cable = refweb.Cable(law="linear", modulus=1.0, area=1e-6, density=1.0, order=order)
    system = nets.system(web, cable, [body, refweb.Contact(**{"stiffness": 1e3, **contact})], False)
    return system, next(term for term in system.terms if term.contact.with_lines)


def deep_states(system, count, seed=5):
    rng, nodes = np.random.default_rng(seed), system.net.nodes
    place = system.net.points[:nodes, :1] + 0.5
    for _ in range(count):
        a, b = rng.uniform(-0.25, 0.25, (2, 3))
        x = np.zeros((system.rows, 3))
        x[:nodes] = a + place * (b - a) - system.net.points[:nodes]
        x[2:nodes] += 0.04 * rng.standard_normal((nodes - 2, 3))
        yield x


def force_of(term, x):
    force, out = np.zeros_like(x), np.zeros((len(term.cells), term.columns))
    term.force(0.0, x, np.zeros_like(x), force, term.cells, term.data, out)
    return force


@pytest.mark.ordinary("ell-1-1.5", "torus-1-1", "torus-1-1.5")
@pytest.mark.parametrize("exponent", [1, 1.5])
@pytest.mark.parametrize("order", [1, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["ell", "torus"])
def test_force_is_minus_the_slope_of_energy(files, name, order, exponent):
    """However deep, with several places on an element, and the stiffness is that of the force."""
    system, term = one_line(files[name], order, exponent=exponent)
    step, touched = 1e-6, 0
    for x in deep_states(system, 30):
        force = force_of(term, x)
        if not force.any():
            continue
        touched += 1
        blocks = np.zeros((1, *2 * (3 * term.cells.shape[1],)))
        term.tangent.stiffness(0.0, x, np.zeros_like(x), blocks, term.cells, term.data, False)
        np.testing.assert_allclose(blocks[0], blocks[0].T, rtol=0, atol=1e-9 * np.abs(blocks).max())
        np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * np.abs(force).max())
        for column, (row, axis) in enumerate([(row, axis) for row in term.cells[0] for axis in range(3)]):
            d = np.zeros_like(x)
            d[row, axis] = step
            ends = [system.energy_of(term, 0.0, x + sign * d).sum() for sign in (-1.0, 1.0)]
            assert abs((ends[0] - ends[1]) / (2.0 * step) - force[row, axis]) < 1e-5 * np.abs(force).max()
            change = (force_of(term, x - d) - force_of(term, x + d))[term.cells[0]].ravel() / (2.0 * step)
            assert np.abs(change - blocks[0][:, column]).max() < 1e-4 * np.abs(blocks).max()
    assert touched > 10


@pytest.mark.parametrize("name", ["ell", "torus"])
def test_energy_nowhere_jumps(files, name):
    """Along straight ways of a line through the body, places appear, join and vanish: the force accounts for all.

    Work is summed by trapezia of 1/1500 of a way, which leave some 1e-3 at kinks of the force; a jump would stay as the
    parts shrink.
    """
    system, term = one_line(files[name])
    rng, left, several = np.random.default_rng(1), [], 0
    for x in deep_states(system, 12, seed=9):
        d = np.zeros_like(x)
        d[:2] = 0.3 * rng.standard_normal((2, 3))

        def along(low, high, parts, x=x, d=d):
            at = np.linspace(low, high, parts + 1)
            energy = np.array([system.energy_of(term, 0.0, x + s * d).sum() for s in at])
            power = np.array([(force_of(term, x + s * d) * d).sum() for s in at])
            return at, energy, np.diff(energy) + 0.5 * (power[1:] + power[:-1]) * np.diff(at)

        at, energy, off = along(0.0, 1.0, 500)
        if energy.max() == 0.0:
            continue
        several += 1
        for _ in range(3):
            worst = int(np.abs(off).argmax())
            at, _, off = along(at[worst], at[worst + 1], 20)
        left.append(np.abs(off).max() / energy.max())
    assert several > 6
    assert np.median(left) < 1e-10 and max(left) < 2e-4


def thrown(body, count, stiffness=300.0):
    """A net that falls on a body, in some steps."""
    return nets.thrown({"axes": AXES, **body}, count, stiffness)


@pytest.mark.parametrize("name, place", [("ell", (0.02, -0.03, -0.16)), ("torus", (0.02, -0.03, -0.15))])
def test_a_net_over_a_mesh_keeps_its_energy(files, name, place):
    """Errors of positions and of energy fall with the square of the step, as over a box."""
    counts = np.array([600, 1200, 2400, 4800])
    runs = [thrown(dict(shape="mesh", file=files[name], position=place), count) for count in counts]
    assert runs[-1][2] > 2e-3
    apart = [np.abs(a[0] - b[0]).max() for a, b in zip(runs, runs[1:], strict=False)]
    drift = [run[1] for run in runs]
    assert drift[-1] < 1e-5
    for errors in (apart, drift):
        assert np.polyfit(np.log(1.0 / counts[: len(errors)]), np.log(errors), 1)[0] > 1.6


@pytest.mark.ordinary("box-exact0")
@pytest.mark.parametrize(
    "name, exact",
    [("box", dict(size=SIZE, rounding=ROUND)), ("ball", dict(size=(0.3, 0.3, 0.3), rounding=0.15))],
)
def test_a_mesh_moves_a_net_as_its_shape_does(files, name, exact):
    """Within a few times the error of its field: a ball is a box that is nothing but rounding."""
    place = (0.02, -0.03, -0.22 if name == "box" else -0.16)
    mesh = dict(shape="mesh", file=files[name], position=place)
    one, other = thrown(mesh, 2400), thrown(dict(shape="box", position=place, **exact), 2400)
    assert other[2] > 3e-3
    error = refweb.Body(name="it", fixed=True, **mesh).form.solid.field.error
    sagitta = 0.5 * 0.15 * (np.pi / 48) ** 2  # of its facets, beside which the field is exact
    assert np.abs(one[0] - other[0]).max() < 6.0 * (error + sagitta) < 5e-3


def caught(**body):
    """A net that a free body falls into, while it turns."""
    own = {"name": "it", "density": 200.0, "position": [0.02, -0.03, 0.3], "velocity": [0.2, 0.0, -4.0]}
    return refweb.Scene.from_dict({
        "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.15},
        "cable": {"law": "linear", "modulus": 1e6, "area": 1e-5, "density": 1000.0},
        "body": [{**own, "angular_velocity": [3.0, -4.0, 5.0], "axes": [list(axis) for axis in AXES], **body}],
        "contact": {"stiffness": 3e3},
        "solve": {"kind": "dynamic", "duration": 0.06, "step_size": 2.5e-5},
        "output": {"interval": 0.005, "frames": 12},
        "accuracy": {"error": "none"},
        "observe": [{"name": "push", "quantity": "reaction", "body": "it", "reduce": "max"}],
    })  # fmt: skip


@pytest.mark.slow
def test_a_free_mesh_tumbles_as_its_shape_does(files):
    """Mass and inertia by density; books close, and the motion is that of the box within its field's error."""
    solutions = [
        refweb.run(caught(shape="mesh", file=files["box"])),
        refweb.run(caught(shape="box", size=SIZE, rounding=ROUND)),
    ]
    one, other = (solution.state for solution in solutions)
    assert solutions[0].results["push"].value > 10.0
    for solution in solutions:
        assert solution.solver["energy_drift"] < 1e-3 and solution.solver["momentum_drift"] < 1e-9
    net = one.system.net
    assert net.mass[net.bodies[0].row] == pytest.approx(other.system.net.mass[net.bodies[0].row], rel=2e-3)
    np.testing.assert_allclose(net.bodies[0].inertia, other.system.net.bodies[0].inertia, rtol=5e-3, atol=1e-4)
    error = net.bodies[0].shape.error
    assert np.abs(one.position[: net.nodes + 1] - other.position[: net.nodes + 1]).max() < 10.0 * error < 5e-3


def hung(**body):
    """A heavy net on a body, in statics."""
    return {
        "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.15},
        "cable": {"law": "linear", "modulus": 1e6, "area": 1e-5, "density": 1000.0},
        "gravity": {"acceleration": [0.0, 0.0, -9.81]},
        "body": [{"name": "it", "fixed": True, "position": [0.02, -0.03, -0.12], **body}],
        "contact": {"stiffness": 300.0},
        "solve": {"kind": "static"},
        "observe": [
            {"name": "push", "quantity": "reaction", "body": "it", "component": "z"},
            {"name": "held", "quantity": "reaction", "node": "rim", "component": "z"},
            {"name": "deep", "quantity": "overlap", "body": "it"},
        ],
    }


def test_statics_on_a_mesh(files):
    """A heavy net rests on it as on the box that it is of; supports and body carry the weight."""
    axes = [list(axis) for axis in AXES]
    given = hung(shape="mesh", file=files["box"], axes=axes)
    exact = hung(shape="box", size=SIZE, rounding=ROUND, axes=axes)
    one, other = (refweb.run(refweb.Scene.from_dict(scene)) for scene in (given, exact))
    assert one.status == "solved" and one.solver["residual"] < 1e-8
    values = [{name: result.value for name, result in solution.results.items()} for solution in (one, other)]
    weight = 9.81 * one.web["mass"]
    assert values[0]["held"] - values[0]["push"] == pytest.approx(weight, rel=1e-6)
    assert 0.1 * weight < -values[0]["push"] and values[0]["deep"] > 0.0
    told = one.bodies["it"]
    assert 0.0 < told["surface_error"] < 1e-3 and "surface_error" not in other.bodies["it"]
    assert np.abs(one.positions - other.positions).max() < 5.0 * told["surface_error"]
    told_of = [finding.text for finding in one.findings if "no part of ±" in finding.text]
    assert bool(told_of) == (told["surface_error"] > 0.1 * told["overlap"])
    assert values[0]["push"] == pytest.approx(values[1]["push"], rel=0.02)


def test_the_file_travels_with_the_scene(files, tmp_path):
    """Its path starts at the scene's folder, is written absolute, and a run can be made of what was written."""
    (tmp_path / "ell.stl").write_text(open(files["ell"]).read())
    given = hung(shape="mesh", file="ell.stl", scale=0.9)
    scene = refweb.Scene.from_dict(given, tmp_path)
    (body,) = scene.to_dict()["body"]
    assert body["file"] == str(tmp_path / "ell.stl") and body["scale"] == 0.9
    solution = refweb.run(scene, tmp_path / "results")
    written = tomllib.loads((tmp_path / "results" / "scene.toml").read_text())
    assert written["body"][0]["file"] == str(tmp_path / "ell.stl")
    again = refweb.run(tmp_path / "results" / "scene.toml")
    np.testing.assert_array_equal(again.positions, solution.positions)
    with pytest.raises(refweb.InputError, match=r"\[\[body\]\] 1 file = .*there is no file"):
        refweb.Scene.from_dict(hung(shape="mesh", file="elf.stl"), tmp_path).build()


def test_a_case_of_a_study_is_known_by_the_content_of_its_files(files, tmp_path):
    from refweb.sweeps.case import Job, _brought
    from refweb.sweeps.design import files_of, key_of

    (tmp_path / "it.stl").write_text(open(files["ell"]).read())
    scene = refweb.Scene.from_dict(hung(shape="mesh", file="it.stl"), tmp_path)
    given = scene.to_dict()
    assert files_of(given) == [str(tmp_path / "it.stl")]
    first = key_of(scene)
    content = (tmp_path / "it.stl").read_bytes()
    (tmp_path / "it.stl").write_text(open(files["torus"]).read())
    assert key_of(scene) != first
    job = Job("key", given, None, "scene", "none", (), {str(tmp_path / "it.stl"): content})
    (place := tmp_path / "there").mkdir()
    brought = _brought(job, place)["body"][0]["file"]
    assert brought != given["body"][0]["file"] and open(brought, "rb").read() == content


def test_what_was_mended_is_a_warning(tmp_path):
    points, triangles = solids.box((0.3, 0.4, 0.2))
    file = solids.write(tmp_path / "inward.stl", points, triangles[:, ::-1])
    solution = refweb.run(refweb.Scene.from_dict(hung(shape="mesh", file=file)))
    assert 'body "it": 12 of 12 triangles faced inward and were turned' in solution.warnings


def test_a_surface_is_drawn_as_it_is(files):
    system, _ = one_line(files["ell"])
    (body,) = system.net.bodies
    points, triangles = body.surface((0.1, 0.2, 0.3))
    assert len(points) == 12 and len(triangles) == 20
    centre = body.shape.solid.centre
    drawn = (points - (0.1, 0.2, 0.3)) @ body.axes.T + centre
    corners, faces = solids.ell()
    expected = {tuple(sorted(map(tuple, face))) for face in corners[faces].round(6)}
    assert {tuple(sorted(map(tuple, face))) for face in (drawn[triangles] + 1e-9).round(6) + 0.0} == expected
    assert any("centre of mass at" in text for text in body.shape.texts())


def test_shares_of_losses_are_those_of_the_rise():
    """Of maxima F = 3, 5, 2 with minima of 1 between the first two, they add up to (3 + 5 + 2 − 1) in all."""
    found = np.zeros(4, LINE_CONTACT)
    found["weight"], found["rise"] = (1.0, -1.0, 1.0, 1.0), (3.0, 1.0, 5.0, 2.0)
    share_out(found, 0, 4)
    assert (found["share"] * found["rise"]).sum() == pytest.approx(9.0)
    np.testing.assert_allclose(found["share"], [1 - 0.5 / 3, 0.0, 1 - 0.5 / 5, 1.0])


def test_friction_on_a_mesh_takes_energy(files):
    """In all states of random slip; what is lost is the power of the force that is felt."""
    system, _ = one_line(files["ell"], friction=0.4, damping=0.5, slip_velocity=0.1)
    term = next(term for term in system.terms if term.balance.power is not None)
    rng, touched = np.random.default_rng(4), 0
    for x in deep_states(system, 30):
        v = rng.standard_normal(x.shape)
        v[system.net.bodies[0].row] = 0.0
        force, out = np.zeros_like(x), np.zeros((1, term.columns))
        term.force(0.0, x, v, force, term.cells, term.data, out)
        assert out[0, 0] <= 0.0 and (force * v).sum() == pytest.approx(out[0, 0], abs=1e-12 * np.abs(force).max())
        touched += out[0, 0] < 0.0
    assert touched > 10


def test_scenes_without_a_mesh_do_not_import_it():
    code = """
import sys, refweb
body = refweb.Body(name="it", shape="box", size=(1, 1, 1), position=(0, 0, -0.6), fixed=True)
web = refweb.Window(mesh="square", rows=2, columns=2, side=0.5)
cable = refweb.Cable(law="linear", modulus=1e6, area=1e-5, density=1000.0)
refweb.Scene(web=web, cable=cable, effects=[body, refweb.Contact(stiffness=1e3)]).build()
loaded = [name for name in sys.modules if "boundary" in name or "shapes.mesh" in name or "nonconvex_contacts" in name]
assert not loaded and "pyvista" not in sys.modules and "meshio" not in sys.modules, loaded
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["ell", "torus"])
@pytest.mark.parametrize("mass", [1e-2, 10.0])
def test_bound_bounds(files, name, mass):
    """2/ω of the tangent is never below the bound, wherever a line lies in a body that is not convex and turns."""
    web = refweb.Inline(points=[[-0.5, 0, 0], [0.5, 0, 0]], lines=[[0, 1]], supports=[]).web()
    body = refweb.Body(name="it", shape="mesh", file=files[name], position=(0.0, 0.0, 0.0), axes=AXES, mass=mass)
    cable = refweb.Cable(law="linear", modulus=1.0, area=1e-6, density=1e6)
    system = nets.system(web, cable, [body, refweb.Contact(stiffness=1e3)], False)
    (body,), free = system.net.bodies, system.free
    method, touched = CentralDifference(system), 0
    inverse, at = np.diag(1.0 / np.repeat(system.net.mass, 3)[free]), 3 * body.spin + np.arange(3)
    inverse[np.ix_(at, at)] = body.axes.T @ np.linalg.inv(body.inertia) @ body.axes
    for x in deep_states(system, 60):
        K = system.pattern.matrix(system.stiffness(0.0, x)).toarray()
        K[:, at] *= 0.5  # of angles: at the start a quaternion has half of them
        largest = np.linalg.eigvals(inverse @ K).real.max()
        if largest > 0.0:
            touched += 1
            assert method.bound(x, reach=0.0) <= 2.0 / np.sqrt(largest) * (1.0 + 1e-9)
    assert touched > 20


@pytest.mark.slow
def test_implicit_methods_follow_a_free_mesh(files):
    """CVODE and IDA find the motion of small explicit steps, of a body that is not convex and tumbles into a net."""

    def end(**solve):
        scene = caught(shape="mesh", file=files["ell"], position=[0.02, -0.03, 0.2])
        solution = refweb.run(scene.replace(solve=refweb.Dynamic(duration=0.03, **solve)))
        assert solution.results["push"].value > 10.0
        return solution.state

    one = end(step_size=5e-6)
    for keys in (dict(method="cvode", rtol=1e-6), dict(method="ida", rtol=1e-6)):
        other = end(**keys)
        np.testing.assert_allclose(other.x, one.x, rtol=0, atol=1e-4, err_msg=str(keys))


@pytest.mark.slow
def test_a_resumed_run_of_a_free_mesh_is_the_same(files, tmp_path):
    scene = caught(shape="mesh", file=files["ell"])
    whole, resumed = nets.whole_and_resumed(scene, tmp_path)
    assert whole.history["contact_energy"].max() > 0.0
    np.testing.assert_array_equal(resumed.state.x, whole.state.x)
    np.testing.assert_array_equal(resumed.state.v, whole.state.v)


@pytest.mark.ordinary("12-30000.0-True")
@pytest.mark.parametrize("grid, stiffness, so", [(12, 3e4, True), (64, 30.0, False)])
def test_an_error_of_the_surface_beside_the_overlap_is_told(files, grid, stiffness, so):
    """With its share, in statics; ± of what is pushed by it is that of residual and rounding."""
    given = hung(shape="mesh", file=files["box"], grid=grid) | {"contact": {"stiffness": stiffness}}
    solution = refweb.run(refweb.Scene.from_dict(given))
    told = solution.bodies["it"]
    (text,) = [f.text for f in solution.findings if f.code == "surface" and "no part of ±" in f.text] or [""]
    assert bool(text) == so == (told["surface_error"] > 0.1 * told["overlap"])
    assert not so or f"within {told['surface_error']:.2g} m" in text and "grid" in text
