"""What a run leaves: the result folder, the solution and the warnings."""

import csv
import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import meshio
import numpy as np
import pytest
import pyvista
from vtkmodules.vtkCommonCore import reference

import refweb
from refweb.dynamics.integrators.drift_source import suspects
from refweb.effects.base import Balance, ForceTerm, Tangent, column
from refweb.kernels import ENERGY, STIFFNESS, kernel
from refweb.kernels import FORCE as FORCE_KERNEL
from refweb.net import elements
from refweb.registry import EFFECTS
from refweb.results.solution import Result, read_results
from refweb.tables import Table, real, table

STEPS = (0.5, 1.0, 2.0, 3.0)
MODULUS, AREA, DENSITY, WEIGHT = 1e5, 1e-4, 300.0, np.array([0.3, 0.0, -2.0])
FORCE = np.array([0.1, -0.05, 0.4])


def scene(**changes):
    """A hexagon web under gravity and two loads, one with a table."""
    return refweb.Scene(
        title="Loaded hexagons",
        seed=7,
        web=refweb.Window(mesh="hexagon", rows=4, columns=4, side=0.3),
        cable=refweb.Cable(law="tension-only", modulus=MODULUS, area=AREA, density=DENSITY),
        effects=[
            refweb.Gravity(acceleration=WEIGHT),
            refweb.Load(node="centre", force=FORCE),
            refweb.Load(node=[0, 3], force=FORCE, factor=[(0, 0), (2, 1)]),
        ],
        solve=refweb.Static(load_steps=STEPS),
        observe=[
            refweb.Observe(name="sag", quantity="displacement", node="centre", component="z"),
            refweb.Observe(name="largest tension", quantity="tension"),
            refweb.Observe(name="support", quantity="reaction"),
        ],
    ).replace(**changes)


@pytest.fixture(scope="module")
def web():
    return scene().build().net.web


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A folder written while the run goes."""
    folder = tmp_path_factory.mktemp("results") / "deep" / "written"
    refweb.run(scene(), out=folder)
    return folder


@pytest.fixture(scope="module")
def solution():
    """The same run without touching the disk."""
    return refweb.run(scene())


def frames(folder):
    return sorted((folder / "frames").iterdir())


def read_json(folder):
    return json.loads((folder / "run.json").read_text(encoding="utf-8"))


def is_number(value):
    return isinstance(value, float) or value is None


def check_results(results):
    for name, result in results.items():
        place = ["at"] if result["where"] is not None else []
        budget = ["parts", "reasons", "verdict", "verdict_text", "digits"]
        proven = ["proven"] if "proven" in result else []
        assert list(result) == ["value", "error", "unit", "time", "where", *place, *proven, *budget]
        assert list(result["parts"]) == ["time", "elements", "contact_stiffness", "smoothing", "chance", "rounding"]
        assert isinstance(name, str)
        assert result.get("at") in (None, "node", "line")
        assert isinstance(result["value"], float) and isinstance(result["time"], float) and is_number(result["error"])
        assert result["error"] is None or result["error"] > 0.0
        assert result["unit"] in ("m", "N") and isinstance(result["where"], int | None)


def check_solver(solver):
    counts = ["nsteps", "nfev", "njev", "nlu"]
    bounds = ["residual", "duality_gap", "above_lowest", "smallest_pivot", "slack_nodes"]
    drifts = ["energy_drift", "momentum_drift", "angular_momentum_drift"]
    assert list(solver) == ["method", "factorization", *counts, *bounds, *drifts] and solver["method"] == "newton"
    assert all(type(solver[key]) is int and solver[key] > 0 for key in counts)
    assert 0.0 <= solver["residual"] <= 1e-9 and solver["duality_gap"] > 0.0
    assert (
        all(solver[key] is None for key in ("above_lowest", "smallest_pivot", *drifts))
        and type(solver["slack_nodes"]) is int
    )


def test_run_json(written, web):
    run = read_json(written)
    keys = "status message scene web results steps events solver cost versions seed warnings findings"
    assert list(run) == keys.split()
    assert (run["status"], run["message"], run["scene"], run["seed"]) == ("solved", "", "Loaded hexagons", 7)
    sizes = "nodes lines cells cable_length area mass extent diameter volume total_mass"
    assert list(run["web"]) == sizes.split()
    assert (run["web"]["nodes"], run["web"]["lines"]) == (len(web.points), len(web.lines))
    width, height, _ = np.ptp(web.points, axis=0)
    length = 0.3 * len(web.lines)
    mass, size = DENSITY * AREA * length, 2.0 * (AREA / np.pi) ** 0.5
    values = {"cable_length": length, "area": width * height, "mass": mass, "extent": [width, height, 0.0]}
    values |= {"diameter": [size, size], "volume": AREA * length, "total_mass": mass}
    for key, value in values.items():
        assert run["web"][key] == pytest.approx(value, rel=1e-12)
    assert list(run["results"]) == ["sag", "largest tension", "support"] and run["events"] == []
    check_results(run["results"])
    assert [step["step"] for step in run["steps"]] == list(STEPS) and run["results"] == run["steps"][-1]["results"]
    for step in run["steps"]:
        assert list(step) == ["step", "load", "results", "solver"]
        check_results(step["results"])
        check_solver(step["solver"])
    check_solver(run["solver"])
    assert run["solver"]["nlu"] == sum(step["solver"]["nlu"] for step in run["steps"])
    assert list(run["cost"]) == ["cpu_s", "wall_s", "compile_s", "by_effect"]
    assert set(run["cost"]["by_effect"]) == {"elasticity", "gravity", "load"}
    assert all(isinstance(text, str) for text in [*run["versions"].values(), *run["warnings"]])
    assert {"refweb", "python", "numpy", "scipy"} <= set(run["versions"])


def test_errors_of_tensions_only(written):
    """The certificate bounds tensions; displacement and reaction have what residual and rounding leave."""
    results = read_json(written)["results"]
    for name in ("sag", "support"):
        assert 0 < results[name]["error"] < 1e-9 * abs(results[name]["value"])
    assert 0 < results["largest tension"]["error"] < 1e-3 * results["largest tension"]["value"]


def test_history(written, solution):
    with open(written / "history.csv", encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    energies = {"strain_energy [J]", "potential_energy [J]", "total_energy [J]", "work [J]"}
    assert header[:4] == ["step [1]", "sag [m]", "largest tension [N]", "support [N]"] and set(header[4:]) == energies
    assert header == solution.columns and list(solution.history) == [name.rsplit(" [", 1)[0] for name in header]
    values = np.array(rows, dtype=float)
    np.testing.assert_array_equal(values, np.column_stack(list(solution.history.values())))
    np.testing.assert_array_equal(values[:, 0], STEPS)
    column = dict(zip(header, values.T, strict=True))
    total = column["strain_energy [J]"] + column["potential_energy [J]"]
    np.testing.assert_allclose(column["total_energy [J]"], total, rtol=1e-12)
    for step, row in zip(read_json(written)["steps"], values, strict=True):
        assert [result["value"] for result in step["results"].values()] == row[1:4].tolist()


def loads(step, web):
    """Resultant of all loads [N]."""
    mass = DENSITY * AREA * 0.3 * len(web.lines)
    return mass * WEIGHT + step * FORCE + 2 * min(step / 2, 1) * FORCE


@pytest.mark.parametrize("read", ["meshio", "pyvista"])
def test_frames_open(written, web, solution, read):
    assert [path.name for path in frames(written)] == [f"web_00000{i}.vtu" for i in range(len(STEPS))]
    for path, step in zip(frames(written), STEPS, strict=True):
        if read == "meshio":
            mesh = meshio.read(path)
            (block,) = mesh.cells
            points, lines, kind = mesh.points, block.data, block.type
            nodal, cell = mesh.point_data, {name: data[0] for name, data in mesh.cell_data.items()}
        else:
            mesh = pyvista.read(path)
            points, lines = np.asarray(mesh.points), mesh.cells.reshape(-1, 3)[:, 1:]
            kind = "line" if set(mesh.celltypes) == {pyvista.CellType.LINE} else "other"
            nodal, cell = ({name: np.asarray(d[name]) for name in d} for d in (mesh.point_data, mesh.cell_data))
        assert kind == "line"
        np.testing.assert_array_equal(lines, web.lines)
        assert set(nodal) == {"displacement", "velocity", "reaction", "mass", "support"}
        np.testing.assert_array_equal(np.flatnonzero(nodal["support"]), web.rim)
        assert set(cell) == {"tension", "stress", "strain", "natural_length", "slack"}
        for array in (points, *nodal.values(), *cell.values()):
            assert array.dtype == np.float64
        np.testing.assert_allclose(points - nodal["displacement"], web.points, rtol=0, atol=1e-15)
        assert not nodal["velocity"].any() and nodal["displacement"].any()
        np.testing.assert_allclose(nodal["mass"].sum(), DENSITY * AREA * 0.3 * len(web.lines), rtol=1e-13)
        np.testing.assert_allclose(nodal["reaction"].sum(axis=0), -loads(step, web), rtol=0, atol=1e-8)
        assert not np.delete(nodal["reaction"], web.rim, axis=0).any()
        length = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
        np.testing.assert_allclose(cell["natural_length"], 0.3, rtol=1e-14)
        np.testing.assert_allclose(cell["strain"], length / 0.3 - 1, rtol=0, atol=1e-13)
        np.testing.assert_allclose(cell["stress"], np.maximum(MODULUS * cell["strain"], 0), rtol=0, atol=1e-7)
        np.testing.assert_allclose(cell["tension"], AREA * cell["stress"], rtol=1e-14)
        np.testing.assert_array_equal(cell["slack"], cell["strain"] <= 0)
    np.testing.assert_array_equal(points, solution.positions)
    np.testing.assert_array_equal(cell["tension"], solution.tension)


def hanging(order, subdivide):
    """A cable of two lines that hangs far down, its elements bent."""
    return refweb.Scene(
        web=refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0.2), elements=2, length=1.4),
        cable=refweb.Cable(
            law="tension-only", modulus=MODULUS, area=AREA, density=2e4, order=order, subdivide=subdivide
        ),
        effects=[refweb.Gravity(acceleration=(0.0, 0.0, -9.81))],
    )


@pytest.mark.parametrize("order, subdivide", [(1, 3), (2, 1), (2, 3), (3, 1), (3, 2)])
def test_frames_of_curved_and_divided_lines(tmp_path, order, subdivide):
    """Cells of the order of the elements, whose nodes VTK has evenly: its curve is the element's own, to 1e-12 of 1 m.

    The undeformed points lie on the straight lines of the web; the web's own nodes come first, as they are numbered.
    """
    solution = refweb.run(hanging(order, subdivide), out=tmp_path / "out")
    state, net = solution.state, solution.state.system.net
    path = tmp_path / "out" / "frames" / "web_000000.vtu"
    mesh, grid = meshio.read(path), pyvista.read(path)
    (block,) = mesh.cells
    kinds = {1: ("line", "LINE"), 2: ("line3", "QUADRATIC_EDGE"), 3: ("line4", "CUBIC_LINE")}[order]
    assert block.type == kinds[0] and set(grid.celltypes) == {pyvista.CellType[kinds[1]]}
    np.testing.assert_array_equal(grid.cells.reshape(-1, order + 2)[:, 1:], block.data)
    np.testing.assert_array_equal(np.asarray(grid.points), mesh.points)
    assert len(block.data) == 2 * subdivide and mesh.points.dtype == np.float64

    places = np.linspace(0.0, 1.0, 21)
    functions = elements.values(elements.line_element(order), places)[0]
    sagging = 0.0
    for number, (cell, nodes) in enumerate(zip(block.data, net.cells, strict=True)):
        vtk = grid.GetCell(number)
        at = vtk.GetParametricCoords()
        first, last = at[0], at[3]
        curve, weights = np.empty((21, 3)), np.empty(order + 1)
        for point, place in zip(curve, places, strict=True):
            vtk.EvaluateLocation(reference(0), (first + place * (last - first), 0, 0), point, weights)
        own = functions @ state.position[nodes]
        np.testing.assert_allclose(curve, own, rtol=0, atol=1e-12)
        chord = own[0] + places[:, None] * (own[-1] - own[0])
        sagging = max(sagging, np.linalg.norm(own - chord, axis=1).max())
        np.testing.assert_array_equal(mesh.points[cell[:2]], state.position[nodes[:2]])
    assert sagging > 1e-3 if order > 1 else sagging < 1e-12  # so that places along the element matter

    straight = mesh.points - mesh.point_data["displacement"]
    np.testing.assert_allclose(straight[:3], net.web.points, rtol=0, atol=4e-16)
    even = np.array([0.0, 1.0, *np.arange(1, order) / order])
    for number, cell in enumerate(block.data):
        line, piece = divmod(number, subdivide)
        start, end = net.web.points[net.web.lines[line]]
        along = (piece + even[:, None]) / subdivide
        np.testing.assert_allclose(straight[cell], start + along * (end - start), rtol=0, atol=1e-15)

    names = {"tension", "stress", "strain", "natural_length", "slack"} | ({"line"} if subdivide > 1 else set())
    assert set(mesh.cell_data) == names
    if subdivide > 1:
        np.testing.assert_array_equal(mesh.cell_data["line"][0], np.repeat([0, 1], subdivide))
    data = {name: values[0] for name, values in mesh.cell_data.items()}
    np.testing.assert_allclose(data["natural_length"], 0.7 / subdivide, rtol=1e-15)
    np.testing.assert_allclose(data["tension"], AREA * data["stress"], rtol=1e-15)
    np.testing.assert_array_equal(data["tension"].reshape(2, -1).max(axis=1), solution.tension)
    np.testing.assert_allclose(mesh.point_data["mass"].sum(), 2e4 * AREA * 1.4, rtol=1e-13)
    weight = 2e4 * AREA * 1.4 * 9.81
    np.testing.assert_allclose(mesh.point_data["reaction"].sum(axis=0), [0, 0, weight], rtol=0, atol=1e-8 * weight)


def listed(folder):
    root = ElementTree.parse(folder / "web.pvd").getroot()
    return [(float(entry.get("timestep")), entry.get("file")) for entry in root.iter("DataSet")]


def test_pvd(written):
    assert listed(written) == [(step, f"frames/web_00000{i}.vtu") for i, step in enumerate(STEPS)]
    reader = pyvista.get_reader(written / "web.pvd")
    assert reader.time_values == list(STEPS)
    assert reader.read()[0].n_points == read_json(written)["web"]["nodes"]


@pytest.mark.parametrize("every, kept", [(1, [0, 1, 2, 3]), (2, [0, 2, 3]), (3, [0, 3]), (100, [0, 3])])
def test_selected_frames(tmp_path, every, kept):
    """Every so many rows; the first and the last always."""
    solution = refweb.run(scene(output=refweb.Output(frames=every)), out=tmp_path / "out")
    assert [path.name for path in frames(tmp_path / "out")] == [f"web_{i:06d}.vtu" for i in kept]
    assert listed(tmp_path / "out") == [(STEPS[i], f"frames/web_{i:06d}.vtu") for i in kept]
    assert len((tmp_path / "out" / "history.csv").read_text().splitlines()) == 1 + len(STEPS)
    assert len(solution.steps) == len(STEPS)


def test_checkpoint(written, solution):
    with np.load(written / "checkpoint.npz") as checkpoint:
        state = {"time", "positions", "displacements", "velocities", "supported", "bodies"}
        assert set(checkpoint) == state | {"lines", "scene"}
        assert checkpoint["time"] == STEPS[-1] and checkpoint["bodies"].tolist() == []
        np.testing.assert_array_equal(checkpoint["positions"], solution.positions)
        np.testing.assert_array_equal(checkpoint["displacements"], solution.displacement)
        assert checkpoint["velocities"].shape == solution.positions.shape and not checkpoint["velocities"].any()


def test_scene_of_the_folder_runs_to_the_same(written, solution):
    again = refweb.Scene.load(written / "scene.toml")
    assert again == scene() and again.to_dict() == scene().to_dict()
    assert refweb.run(again).results == solution.results


def test_solution(solution, web):
    assert list(solution.results) == ["sag", "largest tension", "support"] and solution.status == "solved"
    sag = solution.results["sag"]
    assert sag[:5] == (sag.value, sag.error, sag.unit, sag.time, sag.where) and (sag.unit, sag.time) == ("m", 3.0)
    assert sag.where == web.centre and sag.value == solution.displacement[web.centre, 2]
    assert solution.results["largest tension"].value == solution.tension.max()
    assert solution.results["largest tension"].where == solution.tension.argmax()
    assert solution.results["support"].value == pytest.approx(np.linalg.norm(loads(3.0, web)), rel=1e-9)
    assert solution.positions.shape == solution.reaction.shape == web.points.shape
    assert solution.tension.shape == solution.stress.shape == (len(web.lines),)
    np.testing.assert_array_equal(solution.positions, web.points + solution.displacement)
    with pytest.raises(KeyError, match='did you mean "sag"'):
        solution.results["sga"]
    with pytest.raises(KeyError, match='did you mean "largest tension"'):
        solution.history["largest_tension"]


def contents(folder):
    found = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    run = json.loads(found.pop("run.json"))
    run.pop("cost")
    return run, found


def test_save_writes_what_run_writes(tmp_path, written, solution):
    """Two runs and a later save give the same bytes, but for what they cost."""
    again = refweb.run(scene(), out=tmp_path / "again")
    solution.save(tmp_path / "saved")
    again.save(tmp_path / "saved again")
    run, found = contents(written)
    assert len(found) == 4 + len(STEPS)
    for name in ("again", "saved", "saved again"):
        assert contents(tmp_path / name)[0] == run
        assert contents(tmp_path / name)[1] == found
    with pytest.raises(refweb.InputError, match="is not empty"):
        solution.save(tmp_path / "saved")
    solution.save(tmp_path / "saved", force=True)
    assert contents(tmp_path / "saved") == (run, found)


def test_a_save_that_is_cut_short_is_marked(tmp_path, solution, monkeypatch):
    def full(*_):
        raise OSError("disk full")

    monkeypatch.setattr("refweb.results.folder.write_mesh", full)
    with pytest.raises(refweb.SolverError, match="disk full"):
        solution.save(tmp_path / "out")
    assert read_json(tmp_path / "out")["status"] == "running" and listed(tmp_path / "out") == []


def test_a_folder_saved_onto_itself_stays(tmp_path):
    solution = refweb.run(scene(), out=tmp_path / "out")
    before = contents(tmp_path / "out")
    solution.save(tmp_path / "out", force=True)
    assert contents(tmp_path / "out") == before


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="permissions are those of POSIX")
def test_files_have_the_permissions_of_the_user(tmp_path):
    """In a process of its own, whose mask counts."""
    code = f"import os, refweb; os.umask(0o077); refweb.run('square-load', out={str(tmp_path / 'out')!r})"
    subprocess.run([sys.executable, "-c", code], check=True)
    files = [path for path in (tmp_path / "out").rglob("*") if path.is_file()]
    assert len(files) > 4 and {path.stat().st_mode & 0o777 for path in files} == {0o600}


def test_nothing_is_left_of_a_refused_run(tmp_path):
    with pytest.raises(refweb.InputError, match="names no node"):
        refweb.run(scene(support=[refweb.Supports(nodes="tip")]), out=tmp_path / "out")
    web = refweb.Web(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], rim=[0])
    with pytest.raises(refweb.InputError, match="a scene file cannot hold it"):
        refweb.run(scene(web=web, effects=(), observe=()), out=tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def straight(law, prestrain, groups=None, strength=None, **smooth):
    """The run of a straight cable of three lines pulled by its prestrain."""
    given = dict(law=law, modulus=MODULUS, area=AREA, density=1.0, prestrain=prestrain)
    return refweb.run(
        refweb.Scene(
            web=refweb.Inline(
                points=[[i, 0, 0] for i in range(4)],
                lines=[[0, 1], [1, 2], [2, 3]],
                supports=[0, 3],
                groups=["", "weak", ""],
            ),
            cable=refweb.Cable(**given, **smooth, strength=strength, groups=groups or {}),
        )
    )


@pytest.mark.parametrize("share, warned", [(0.012, True), (0.008, False)])
def test_floor_is_warned_of_above_one_percent(share, warned):
    """Under ε0 = 0 the floor is η E, and the stress of a cable with prestrain ε nearly ε E."""
    solution = straight("smooth", 0.02, smoothing=0.02 * share)
    found = [text for text in solution.warnings if "floor" in text]
    assert len(found) == warned and len(solution.warnings) == warned
    if warned:
        assert f"{MODULUS * 0.02 * share:.4g} Pa" in found[0] and "1 %" in found[0]


def test_slack_nodes_are_counted():
    solution = straight("tension-only", -0.1)
    (text,) = solution.warnings
    assert "2 nodes hang on slack lines" in text and "1, 2" in text
    assert solution.solver["slack_nodes"] == 2 and solution.state.slack.all() and not solution.tension.any()


@table
class SpringToPoint(Table):
    """A linear spring of all directions, from a node to where it is at the start."""

    stiffness: float = real(unit="N/m")

    def on(self, net):
        tangent = Tangent(spring_stiffness)
        data, balance = np.array([[self.stiffness]]), Balance("spring_energy")
        return ForceTerm("spring", column([1]), data, spring_force, balance, energy=spring_energy, tangent=tangent)


@kernel(FORCE_KERNEL)
def spring_force(t, x, v, f, cells, data, out):
    for k in range(3):
        f[cells[0, 0], k] -= data[0, 0] * x[cells[0, 0], k]


@kernel(ENERGY)
def spring_energy(t, x, cells, data, out):
    out[0] = 0.5 * data[0, 0] * (x[cells[0, 0]] ** 2).sum()


@kernel(STIFFNESS)
def spring_stiffness(t, x, v, blocks, cells, data, definite):
    for k in range(3):
        for m in range(3):
            blocks[0, k, m] = data[0, 0] if k == m else 0.0


@pytest.fixture
def spring():
    """The class above as an effect of scenes, until the test ends."""
    refweb.register("effect", "spring", SpringToPoint)
    yield SpringToPoint
    EFFECTS.pop("spring")


def test_a_node_on_a_slack_line_that_a_spring_holds_is_not_loose(spring):
    """F = k z, while the line is slack: the position is unique, and has ±."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [0, 0, -1]], lines=[[0, 1]], natural_length=5.0, supports=[0]),
        cable=refweb.Cable(law="tension-only", modulus=1e9, area=1e-6, density=0.0),
        effects=[refweb.Load(node=1, force=(0, 0, -10.0)), spring(stiffness=100.0)],
        observe=[refweb.Observe(name="z", quantity="displacement", node=1, component="z", reduce="min")],
        solve=refweb.Static(),
    )
    solution = refweb.run(scene)
    z = solution.results["z"]
    text = ', or see if the energy of effect "spring" is that of its force'
    assert suspects(solution.state.system) == text and suspects(scene.replace(effects=[]).build()) == ""
    assert solution.warnings == [] and solution.solver["slack_nodes"] == 0
    assert z.error is not None and abs(z.value + 0.1) <= z.error + 1e-15


@pytest.mark.parametrize("slackness, slack", [(0.0199, False), (0.0201, True)])
def test_slack_is_up_to_the_slackness(slackness, slack):
    """Of a cable that is strained by 2 %."""
    assert (straight("smooth", 0.02, slackness=slackness).state.slack == slack).all()


def test_saddle_is_named():
    """A straight chain of bars under compression is in equilibrium, and would buckle; bars are never slack."""
    solution = straight("linear", -0.1)
    (text,) = solution.warnings
    assert "saddle" in text and "bars push" in text and solution.solver["smallest_pivot"] == -1
    assert solution.solver["slack_nodes"] == 0
    np.testing.assert_allclose(solution.stress, -0.1 * MODULUS, rtol=1e-12)
    taut = straight("linear", 0.1)
    assert taut.warnings == [] and taut.solver["smallest_pivot"] == 1


def test_warning_names_the_load_steps_it_holds_for():
    """The chain is slack at the first of two steps, and pulled taut from one end at the second."""
    ends = refweb.Motion(node=3, displacement=[(1.0, 0.0, 0.0, 0.0), (2.0, 1.0, 0.0, 0.0)])
    solution = straight("tension-only", -0.1)
    solution = refweb.run(solution.scene.replace(effects=(ends,), solve=refweb.Static(load_steps=(1, 2))))
    (text,) = solution.warnings
    assert "2 nodes hang on slack lines" in text and text.endswith("(load step 1)")
    assert [step["solver"]["slack_nodes"] for step in solution.steps] == [2, 0]


def test_utilisation():
    """Stress over strength, where a strength is given."""
    assert straight("linear", 0.1).state.utilisation is None
    found = straight("linear", 0.1, strength=4e4).state.utilisation
    np.testing.assert_allclose(found, 0.1 * MODULUS / 4e4, rtol=1e-12)
    weak = straight("linear", 0.1, groups={"weak": refweb.Group(strength=8e3)})
    np.testing.assert_allclose(weak.state.utilisation, [0, 0.1 * MODULUS / 8e3, 0], rtol=1e-12)
    (text,) = weak.warnings
    assert "line 1 breaks" in text and "1.25" in text


def test_utilisation_in_the_box(capsys, tmp_path):
    from refweb.commands.console import print_solution

    print_solution(straight("linear", 0.1, groups={"weak": refweb.Group(strength=2e4)}), tmp_path)
    box = capsys.readouterr().out
    assert re.search(r"│ strength  utilisation 0\.50* ± [\d.e-]+ at line 1 ", box) and f"results in {tmp_path}" in box


def test_frames_of_a_body(tmp_path):
    """Each array of its file is what it is called: the ball's way, its velocity, no reaction as nothing holds it."""
    ball = dict(name="ball", radius=0.1, mass=0.5, position=(0.01, 0.02, -0.09), velocity=(0.5, 0.0, 2.0))
    solution = refweb.run(
        refweb.Scene(
            web=refweb.Window(mesh="square", rows=2, columns=2, side=0.2),
            cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0, prestrain=0.01),
            effects=[refweb.Body(**ball), refweb.Contact(stiffness=1e4)],
            solve=refweb.Dynamic(duration=1e-3),
            output=refweb.Output(interval=1e-3, frames=1),
        ),
        out=tmp_path / "out",
    )
    frame, state = meshio.read(tmp_path / "out/frames/ball_000001.vtu"), solution.state
    for name, truth in (("displacement", state.x[-1]), ("velocity", state.v[-1]), ("reaction", state.reaction[-1])):
        np.testing.assert_array_equal(frame.point_data[name][0], truth)
    before, after = np.array(ball["velocity"]), frame.point_data["velocity"][0]
    assert not frame.point_data["reaction"].any()
    assert after[2] < before[2] and abs(after[0] - before[0]) < 0.1 * (before[2] - after[2])
    np.testing.assert_allclose(frame.point_data["displacement"][0], 1e-3 * before, rtol=0.2, atol=1e-4)


def test_errors_stay_within_what_is_possible():
    """Two slack lines shrink until both are taut: a share is 0 to 1, and the largest tension of ropes at least 0."""
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2])
    cable = refweb.Cable(law="tension-only", modulus=1e7, area=1e-4, density=100.0, prestrain=-0.05)
    asked = {"share": "slack_fraction", "most": "tension", "speed": "velocity", "strain": "strain"}
    found = refweb.run(
        refweb.Scene(
            web=web,
            cable=cable,
            effects=[refweb.Temperature(expansion=1e-3, change=[(0.0, 0.0), (0.1, -100.0)])],
            observe=[refweb.Observe(name=name, quantity=quantity) for name, quantity in asked.items()],
            event=[refweb.Event(name="taut", kind="taut", line=[1], stop=True)],
            solve=refweb.Dynamic(duration=0.1),
        )
    ).results
    assert found["share"].error == pytest.approx(1.0) and found["share"].within == (0.0, 1.0)
    value, error, *_ = found["most"]
    assert error > value and found["most"].within == (0.0, value + error)
    assert found["strain"].within is None


@pytest.mark.parametrize(
    "value, error, bounds, left, within",
    [
        (0.0, 3.0, (0.0, 1.0), 1.0, (0.0, 1.0)),
        (0.25, 0.5, (0.0, 1.0), 0.5, (0.0, 0.75)),
        (0.25, 5.0, (0.0, 1.0), 0.75, (0.0, 1.0)),
        (3.0, 1.0, (0.0, np.pi), 1.0, (2.0, np.pi)),
        (1.1, 5.3, (0.0, np.inf), 5.3, (0.0, 6.4)),
        (1.1, 0.2, (0.0, np.inf), 0.2, None),
        (-1.1, 5.3, (-np.inf, np.inf), 5.3, None),
        (1.1, None, (0.0, 1.0), None, None),
    ],
)
def test_value_and_error_cut_to_bounds(value, error, bounds, left, within):
    """Where ± goes beyond the bounds what it leaves is told, and ± is the farther of these ends at most."""
    found = Result(value, error, "1", 0.0, None).bounded(*bounds)
    assert (found.value, found.error) == (value, left)
    assert found.within == (within and pytest.approx(within))
    assert read_results({"a": json.loads(json.dumps(found.plain()))})["a"] == found
