"""A solution read back from its folder, as meshes, as tables, in a notebook; and what is said of it."""

import json
import re
import signal
import subprocess
import sys
import textwrap
import threading
import time
import xml.etree.ElementTree as ElementTree

import numba
import numpy as np
import pytest

import refweb
from refweb.__main__ import main
from refweb.results.folder import is_alive
from refweb.results.progress import RemainingTime, followed
from refweb.results.run_status import Clock
from refweb.results.units import readable, with_error

CABLE = refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0, strength=2e8)
BALL = refweb.Body(name="ball", radius=0.05, mass=0.2, position=(0, 0, -0.06), velocity=(0, 0, 1))


def pressed(**parts):
    web = refweb.Window(mesh="square", rows=4, columns=4, side=0.1)
    effects = [refweb.Load(node="centre", force=(0, 0, 1)), refweb.Load(node="centre", force=(2, 0, 0))]
    solve = refweb.Static(load_steps=[1, 2])
    return refweb.Scene(**dict(web=web, cable=CABLE, effects=effects, solve=solve, title="pressed") | parts)


def hit(**parts):
    solve = refweb.Dynamic(duration=0.02)
    return pressed(effects=[BALL, refweb.Contact(stiffness=1e4)], solve=solve, title="hit", **parts)


@pytest.fixture(scope="module", params=[pressed, hit])
def both(request, tmp_path_factory):
    """(solution as it was run, as it was read back)."""
    folder = tmp_path_factory.mktemp("loaded") / "run"
    scene = request.param(output=refweb.Output(frames=1))
    run = refweb.run(scene, out=folder)
    return run, refweb.load(folder)


def test_what_is_read_back_is_what_was_run(both):
    run, read = both
    assert read.results == run.results and read.scene.to_dict() == run.scene.to_dict() and read.warnings == run.warnings
    for key in ("status", "solver", "cost", "web", "versions", "utilisation", "bodies", "events", "columns"):
        assert getattr(read, key) == getattr(run, key), key
    assert [step["results"] for step in read.steps] == [step["results"] for step in run.steps]
    for key in ("positions", "velocities", "tension", "slack", "reaction"):
        assert np.array_equal(getattr(read, key), getattr(run, key)), key
    for name, column in run.history.items():
        assert np.array_equal(read.history[name], column), name


def test_saved_again(both, tmp_path):
    _, read = both
    read.save(tmp_path / "copy")
    assert refweb.load(tmp_path / "copy").results == read.results


def test_meshes_of_pyvista(both):
    run, read = both
    for solution in both:
        last, first = solution.to_pyvista(), solution.to_pyvista(0)
        net = solution.state.system.net
        assert last.keys() == ["web", *(body.name for body in net.bodies)]
        assert np.array_equal(last["web"].points, solution.positions)
        assert np.array_equal(last["web"].cell_data["tension"], solution.tension)
        assert last["web"].n_cells == len(net.web.lines)
        assert last.field_data["TimeValue"][0] == solution.state.time > first.field_data["TimeValue"][0]
        with pytest.raises(refweb.InputError, match="frame = 99: there is no such frame, the nearest is"):
            solution.to_pyvista(99)
    assert np.array_equal(run.to_pyvista(0)["web"].points, read.to_pyvista(0)["web"].points)


def test_tables_of_pandas(both):
    pytest.importorskip("pandas", reason="an extra of the user's")
    run, _ = both
    table = run.to_pandas()
    assert table.index.name == next(iter(run.history)) and len(table) == len(run.history["deflection"])
    assert np.array_equal(table["deflection"], run.history["deflection"])
    assert table.attrs["units"]["deflection"] == "m" and set(table.attrs["units"]) == set(run.history)
    results = run.to_pandas("results")
    assert results.loc["max_tension", "value"] == run.results["max_tension"].value
    assert results.loc["max_tension", "at"] == "line" and results.loc["deflection", "unit"] == "m"


def test_without_pandas(both, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(refweb.InputError, match="^to_pandas needs pandas: pip install pandas$"):
        both[0].to_pandas()
    with pytest.raises(refweb.InputError, match='what = "result" must be .*did you mean "results"'):
        both[0].to_pandas("result")


def test_in_a_notebook(both):
    """Well-formed, with every result, its ± and where it stands; what is a name is no markup."""
    run, _ = both
    shown = ElementTree.fromstring(run._repr_html_())
    cells = [cell.text for cell in shown.iter("td")]
    for name, one in run.results.items():
        assert name in cells and readable(one.value, one.error, one.unit) in cells
    assert f"line {run.results['max_tension'].where}" in cells
    titled = run.scene.replace(title="<b> & co")
    page = ElementTree.fromstring(titled._repr_html_())
    assert page.find("b").text == "<b> & co" and "[solve]" in [cell.text for cell in page.iter("td")]
    points = np.array([[0.0, 0, 0], [1, 0, 0]])
    own = refweb.Web(points=points, lines=np.array([[0, 1]]), natural_length=np.ones(1), rim=np.array([0]))
    assert "nodes = 2" in "".join(ElementTree.fromstring(titled.replace(web=own)._repr_html_()).itertext())


def test_where_results_stand(both, capsys):
    run, read = both
    assert run.results["deflection"].at == "node" and run.results["max_stress"].at == "line"
    main(["info", str(read.path)])
    shown = capsys.readouterr().out
    for one in run.results.values():
        assert f"at {one.at} {one.where}" in shown
    text = with_error(run.utilisation.value, run.utilisation.error)
    assert f"utilisation {text} at line {run.utilisation.line}" in shown


def test_load_steps_in_columns_of_one_unit(tmp_path, capsys):
    """The force of ``[[load]]``, the sum of its sizes: 1 N and 2 N on one node are √5 N together."""
    refweb.run(pressed(), out=tmp_path / "run")
    main(["info", str(tmp_path / "run")])
    head, *rows = (line.strip("│ ").split() for line in capsys.readouterr().out.splitlines()[1:4])
    assert head[:6] == ["results", "step", "load", "[N]", "deflection", "[mm]"]
    assert [float(row[1]) for row in rows] == pytest.approx([5**0.5, 2 * 5**0.5], rel=1e-5)


@pytest.mark.parametrize(
    "value, error, text",
    [
        (31.4848, None, "31.4848"),
        (100.6612, 0.553, "100.66 ± 0.55"),
        (94.2, 32.1, "94 ± 32"),
        (2.997291, 1.7e-6, "2.9972910 ± 1.7e-06"),
        (31.48481312345, 2.4e-13, "31.48481312 ± 2.4e-13"),
        (0.0, 1e-3, "0.0000 ± 0.0010"),
        (1.5e8, 2e6, "150000000 ± 2.0e+06"),
        (1.50123456e8, 2e6, "150100000 ± 2.0e+06"),
        (130.0866297, 9e4, "0 ± 9.0e+04"),
        (-3.0, 1871.0, "0 ± 1900"),
        (126.3, 326.0, "130 ± 330"),
    ],
)
def test_one_notation(value, error, text):
    """± has two digits, and the value no more than it leaves."""
    assert with_error(value, error) == text


@pytest.mark.parametrize(
    "value, error, unit, text",
    [
        (130.0866297e-6, 0.09, "m/s", "0 ± 90 mm/s"),
        (0.5, 1.871, "Pa", "0.5 ± 1.9 Pa"),
        (0.0, 3e-7, "m", "0 ± 300 nm"),
        (0.1234, 1e-7, "m", "123.40000 ± 0.00010 mm"),
        (0.1234, None, "m", "123.4 mm"),
    ],
)
def test_the_unit_is_that_of_the_larger(value, error, unit, text):
    """A velocity of 0.13 mm/s ± 90 mm/s has no digit: neither in its own unit nor in that of its error."""
    assert readable(value, error, unit) == text


def test_names_of_blocks(both):
    """ParaView's reader of collections takes the name of a block from the attribute ``name``."""
    _, read = both
    sets = ElementTree.parse(read.path / "web.pvd").iter("DataSet")
    assert {(one.get("name"), one.get("file").split("/")[1].rsplit("_", 1)[0]) for one in sets} == {
        (name, name) for name in ("web", *(body.name for body in read.state.system.net.bodies))
    }


def test_what_is_no_run_is_refused(tmp_path):
    with pytest.raises(refweb.InputError, match="there is no such folder"):
        refweb.load(tmp_path / "none")
    with pytest.raises(refweb.InputError, match=r"holds no run\.json"):
        refweb.load(tmp_path)
    refweb.modes(pressed(), 2, out=tmp_path / "modes")
    with pytest.raises(refweb.InputError, match="holds modes, not a run"):
        refweb.load(tmp_path / "modes")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no locks that end with a process")
def test_a_killed_run_says_that_it_is_dead_and_how_far_it_came(tmp_path, capsys):
    """It says that it is alive before, and nobody may write into its folder then."""
    scene = tmp_path / "slow.toml"
    scene.write_text(
        textwrap.dedent("""
        [web]
        kind = "inline"
        points = [[0, 0, 0], [1, 0, 0]]
        lines = [[0, 1]]
        supports = [0]
        [cable]
        modulus = 7e7
        area = 1e-4
        density = 200.0
        [solve]
        kind = "dynamic"
        duration = 1e4
        [output]
        interval = 1e-2
        frames = 100
        """)
    )
    run = [sys.executable, "-m", "refweb", "run", str(scene), "--out", str(tmp_path / "run")]
    process = subprocess.Popen(run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path)
    try:
        history = tmp_path / "run" / "history.csv"
        while process.poll() is None and not (history.exists() and history.read_text().count("\n") > 200):
            pass
        assert process.poll() is None and is_alive(tmp_path / "run")
        assert main(["info", str(tmp_path / "run")]) == 0
        assert "its process is alive" in " ".join(capsys.readouterr().out.split())
        assert main(["resume", str(tmp_path / "run")]) == 2
        assert main(["run", str(scene), "--out", str(tmp_path / "run"), "--force"]) == 2
        assert capsys.readouterr().err.count("a run that is alive") == 2
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert is_alive(tmp_path / "run") is False
    assert main(["info", str(tmp_path / "run"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    last = float(history.read_text().rsplit("\n", 2)[-2].split(",")[0])
    assert told["status"] == "killed"
    assert f"its process is dead; it has reached t = {last:.6g} s; refweb resume" in told["message"]


def test_a_folder_does_not_hide_a_shipped_scene(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "square-load").mkdir()
    assert main(["info", "square-load"]) == 0 and "Square web under load" in capsys.readouterr().out
    assert main(["check", "square-load"]) == 0
    (tmp_path / "mine").mkdir()
    assert main(["info", "mine"]) == 2 and "holds no run.json" in capsys.readouterr().err


def test_progress_where_somebody_looks(monkeypatch, capsys):
    """A bar in a terminal, a line in a notebook, none so soon in a pipe; what is given is called itself."""
    told = []
    with followed(lambda text, share: told.append((text, share))) as tell:
        tell("so far", 0.5)
    assert told == [("so far", 0.5)]
    for progress in (True, False, None):
        with followed(progress) as tell:
            tell("so far", 0.5)
    assert capsys.readouterr().err == ""
    notebook = type("IPython", (), {"get_ipython": staticmethod(lambda: type("Shell", (), {"kernel": None})())})
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    monkeypatch.setattr("refweb.results.progress.DELAY", 0.0)
    monkeypatch.setattr("refweb.results.progress.APART", -1.0)
    with followed(True) as tell:
        tell("so far", 0.5)
    assert capsys.readouterr().err.startswith("\r 50 %  so far")


def test_lines_where_there_is_no_terminal(monkeypatch, capsys):
    """One every `EVERY`, of what was last told, and of loading where nothing was."""
    monkeypatch.setattr("refweb.results.progress.EVERY", 0.02)
    shown = []
    with followed(True) as tell:
        while len(shown) < 2:
            shown += capsys.readouterr().err.splitlines()
            time.sleep(0.005)
        tell("running, t = 0.5 of 1 s", 0.5)
        while "running" not in shown[-1]:
            shown += capsys.readouterr().err.splitlines()
            time.sleep(0.005)
    assert set(shown) == {"  0 %  loading", " 50 %  running, t = 0.5 of 1 s"}
    count = threading.active_count()
    with followed(True):
        assert threading.active_count() == count + 1
    assert threading.active_count() == count


def test_remaining_time():
    """What a phase still takes at the rate since it was first seen; each phase, and each repetition, by itself."""
    now = [0.0]
    remaining = RemainingTime(lambda: now[0])
    told = []
    for seconds, text, share in [
        (0.0, "running, t = 0 of 1 s", 0.0),
        (1.0, "running, t = 0.01 of 1 s", 0.01),  # of so little no rate is known
        (10.0, "running, t = 0.1 of 1 s", 0.1),
        (20.0, "running, t = 0.5 of 1 s", 0.5),
        (21.0, "step refinement, t = 0.4 of 1 s", 0.4),
        (41.0, "step refinement, t = 0.5 of 1 s", 0.5),
        (42.0, "running with safety = 0.2, t = 0 of 1 s", 0.0),
        (142.0, "running with safety = 0.2, t = 0.1 of 1 s", 0.1),
        (143.0, "running with safety = 0.1, t = 0 of 1 s", 0.0),
        (3143.0, "running with safety = 0.1, t = 0.2 of 1 s", 0.2),
        (3143.0, "3 of 4 cases, 10 s left", 0.75),
        (3144.0, "4 of 4 cases, 0 s left", 1.0),
    ]:
        now[0] = seconds
        told.append(remaining.added_to(text, share)[len(text) :])
    assert told == [
        *("", "", ", 90 s left".replace("90 s", "2 min"), ", 20 s left", "", ", 100 s left".replace("100 s", "2 min")),
        *("", ", 15 min left", "", ", 3.3 h left", "", ""),
    ]


def test_phases_of_a_run_are_told():
    """Simulated time and the largest value so far, rising; then the step refinement, with a share of its own."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2]),
        cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-4, density=100.0),
        effects=[refweb.Load(node=1, force=(0.0, 0.0, 1.0))],
        solve=refweb.Dynamic(duration=0.05),
        output=refweb.Output(interval=0.01, frames=1),
        observe=[
            refweb.Observe(name="energy", quantity="strain_energy"),
            refweb.Observe(name="sag", quantity="displacement", reduce="max"),
        ],
    )
    told = []
    solution = refweb.run(scene, progress=lambda text, share: told.append((text, share)))
    told = [(text, share) for text, share in told if not text.startswith("compiling")]
    running = [(text, share) for text, share in told if text.startswith("running")]
    refined = told[len(running) :]
    assert told[: len(running)] == running and len(running) >= 6 and refined
    times, sags = [], []
    for text, share in running:
        found = re.fullmatch(r"running, t = (\S+) of 0.05 s, largest sag (\S+) (µ|n|m|)m", text)
        times.append(float(found[1]))
        sags.append(float(found[2]) * {"n": 1e-9, "µ": 1e-6, "m": 1e-3, "": 1.0}[found[3]])
        assert abs(share - times[-1] / 0.05) < 1e-3
    assert times[0] == sags[0] == 0.0 and times[-1] == 0.05 and sags == sorted(sags) and times == sorted(times)
    np.testing.assert_allclose(sags[-1], solution.results["sag"].value, rtol=1e-5)  # of six digits
    assert all(re.fullmatch(r"step refinement, t = \S+ of 0.05 s", text) for text, _ in refined)
    assert [share for _, share in refined] == sorted(share for _, share in refined)
    plain = scene.replace(observe=scene.observe[:1], accuracy=refweb.Accuracy(error="none"))
    told.clear()
    refweb.run(plain, progress=lambda text, share: told.append((text, share)))
    assert not any(text.startswith("step refinement") for text, _ in told)
    assert re.fullmatch(r"running, t = 0.05 of 0.05 s, energy \S+ \w*J", told[-1][0])


def test_compiling_is_told_apart():
    """What is compiled while a clock runs, and no more than the wall has passed; what is compiled already is none."""
    function = numba.njit(lambda x: x + 1.0)
    clock = Clock()
    assert clock.spent()["compile_s"] == 0.0
    function(1.0)
    spent = clock.spent()
    assert 0.0 < spent["compile_s"] <= spent["wall_s"]
    function(2.0)
    assert clock.spent()["compile_s"] == spent["compile_s"] and Clock().spent()["compile_s"] == 0.0


def test_errors_of_smoothing_and_elements_are_shown_beside(tmp_path):
    """Of a hanging cable with the smooth law: in tables and in notebooks, as in the terminal."""
    pytest.importorskip("pandas", reason="an extra of the user's")
    web = refweb.SingleCable(start=(0, 0, 0), end=(1, 0, 0), elements=4, length=1.1)
    cable = refweb.Cable(law="smooth", modulus=7e7, area=1e-4, density=200.0)
    gravity, accuracy = refweb.Gravity(acceleration=(0, 0, -9.81)), refweb.Accuracy(refine=True)
    found = refweb.run(refweb.Scene(web=web, cable=cable, effects=[gravity], accuracy=accuracy))
    table, shown = found.to_pandas("results"), found._repr_html_()
    for key, text in (("smoothing", "smoothing moves"), ("discretisation", "discretisation error")):
        assert table.loc["deflection", key] == getattr(found.results["deflection"], key) > 0.0
        assert f"{text} deflection by" in shown


def test_numbers_that_are_none_are_refused(both, tmp_path):
    _, read = both
    read.save(tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "run.json").read_text())
    for results in (summary["results"], *(step["results"] for step in summary["steps"])):
        results["deflection"]["value"] = "abc"
    (tmp_path / "run" / "run.json").write_text(json.dumps(summary))
    with pytest.raises(refweb.InputError, match=r"run\.json: is not what a run of refweb writes"):
        refweb.load(tmp_path / "run")


def test_a_folder_is_no_scene(both, capsys):
    _, read = both
    assert main(["check", str(read.path)]) == 2
    assert "is a folder, not a scene file: name " in capsys.readouterr().err
