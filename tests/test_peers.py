"""The comparison with peers: each program solves a small problem, and the command measures, goes on and tells.

A program is held against methods that share no line with it or with refweb: a shifted Newton method and the Verlet
method in NumPy, and the closed form of a saddle. One whose peer is not installed is skipped.
"""

import importlib.util
import json
import os

import numpy as np
import pytest

from validation.peers import __main__ as command
from validation.peers import compare, contact, page, runs, start, truth
from validation.peers.problem import Problem
from validation.peers.programs import refweb
from validation.peers.work import capture, draws, works

MODULES = {
    "refweb": "refweb",
    "dop853": "scipy",
    "mujoco": "mujoco",
    "opensees": "openseespy",
    "exudyn": "exudyn",
    "kratos": "KratosMultiphysics",
    "moordyn": "moordyn",
    "jax_fdm": "jax_fdm",
    "warp": "warp",
    "newton": "newton",
    "pyelastica": "elastica",
}
RIGHT = {
    "statics": truth.newton,
    "impact": lambda problem: truth.verlet(problem, 4000),
    "implicit": lambda problem: truth.verlet(problem, 4000),
    "form": lambda problem: works()["form"].truth(problem).positions,
}
TOLERANCES = {"statics": 1e-8, "impact": 1e-6, "implicit": 1e-4, "form": 1e-9}
"""Largest distance of a node [m]: a residual, and steps of 5e-5 s, and of 7e-4 s, squared times the frequencies."""
LARGER = {"kratos": {"statics": 2e-5, "impact": 2e-5, "implicit": 1e-4}, "moordyn": {"impact": 1e-5},
          "pyelastica": {"impact": 1e-4}}  # fmt: skip
"""Kratos's cables have the strain of Green, which differs by 3/2 of the strain, 1e-3, of itself; MoorDyn and the mass
that its user moves know of each other once a step; rods of 0.25 mm bend."""
MOTIONS = {
    "throw": (5e-4, {"kratos": 0.1, "newton": 0.2, "pyelastica": 0.2, "moordyn": 1e-3}),
    "capture": (2e-4, {"mujoco": 3e-3, "kratos": 5e-3, "moordyn": 0.2, "newton": 0.1, "pyelastica": 0.1}),
    "draws": (1e-7, {"kratos": 1e-5}),
}
"""Largest distance of a node [m]: steps of 0.1 ms, and laws of contact that differ near nodes; larger where a program
has another law of lines, or of their contact, in a net that is 0.7 m wide."""


@pytest.mark.ordinary("[!d]*")
@pytest.mark.parametrize("name", MODULES)
def test_a_program_solves_a_small_problem(name):
    if importlib.util.find_spec(MODULES[name]) is None:
        pytest.skip(f"{MODULES[name]} is not installed: pip install 'refweb[peers]'")
    machine, every, tried = runs.machine(), works(), set()
    for work in (every[one] for one in ("statics-dish", "impact-steps", "impact-error", "implicit", "form")):
        settings = (work.quick or work.settings).get(name)
        if not settings or work.task not in runs.tasks(name) or work.task in tried:
            continue
        problem = work.problem(True)
        if name == "refweb":  # in this process, which has its kernels
            result = getattr(refweb, work.task)(problem, **settings[-1])
        else:
            cost, result = runs.run(machine, name, work.task, problem, settings[-1])
            assert "failure" not in cost and cost["cpu"] > 0.0 and cost["version"], cost
        tried.add(work.task)
        off = np.linalg.norm(result - RIGHT[work.task](problem), axis=1).max()
        assert off < LARGER.get(name, TOLERANCES)[work.task], (name, work.task, off)
        assert 0 < runs.lines(name, work.task) < 100
    assert tried


@pytest.fixture(scope="module")
def right():
    """The `Truth` of each of the `MOTIONS`, by fewer steps than the page has."""
    every = {name: works()[name] for name in MOTIONS}
    problems = {name: work.problem(True) for name, work in every.items()}
    return problems, {
        "throw": truth.motion(problems["throw"], 1000),
        "capture": capture.right(problems["capture"], 1600),
        "draws": draws.right(problems["draws"], 800),
    }


@pytest.mark.ordinary("refweb-throw", "refweb-capture", "[!rd]*")
@pytest.mark.parametrize("work", MOTIONS)
@pytest.mark.parametrize("name", MODULES)
def test_a_program_follows_a_throw_a_capture_and_draws(name, work, right):
    settings, (tolerance, larger) = works()[work].quick.get(name), MOTIONS[work]
    if importlib.util.find_spec(MODULES[name]) is None:
        pytest.skip(f"{MODULES[name]} is not installed: pip install 'refweb[peers]'")
    if not settings:
        pytest.skip(f"{name} has no program for {work}")
    problem, task = right[0][work], works()[work].task
    if name == "refweb" and work != "draws":  # which has processes of its own
        result = getattr(refweb, task)(problem, **settings[-1])
    else:
        cost, result = runs.run(runs.machine(), name, task, problem, settings[-1])
        assert "failure" not in cost and cost["cpu"] > 0.0, cost
    assert result.shape == right[1][work].positions.shape
    off = np.linalg.norm(result - right[1][work].positions, axis=1).max()
    assert off < larger.get(name, tolerance), (name, work, off)


def test_both_right_answers_agree(right):
    apart = {name: one.apart for name, one in right[1].items()}
    assert apart["throw"] < 2e-4 and apart["capture"] < 1e-4 and apart["draws"] < 1e-7, apart


def test_contact_is_the_law_that_the_page_has():
    """Two lines that cross at 0.75 of the distance of contact, at an angle, far from their ends and across a joint."""
    radius, stiffness, high = 3e-3, 1e5, 4.5e-3
    push = stiffness * high * (4 * radius**2 - high**2) ** 1.5 / (np.sqrt(27.0) * radius**3)
    for joint in (0.5, 0.02, 0.0, -0.02):  # of the second line's nodes, so that lines cross there or next to it
        points = np.array([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [-0.4, -0.8, high], [0.0, 0.0, high], [0.3, 0.6, high]])
        points[3] = points[2] + (0.8 + joint) / 1.4 * (points[4] - points[2])
        lines = np.array([[0, 1], [2, 3], [3, 4]])
        natural = np.linalg.norm(points[lines[:, 1]] - points[lines[:, 0]], axis=1)
        one = Problem(points, lines, natural, (), 1.0, 1.0, 0, line_radius=radius, line_stiffness=stiffness)
        forces = contact.Contacts(one).forces(points)
        assert np.allclose(forces[:2].sum(axis=0), [0.0, 0.0, -push], rtol=1e-12, atol=1e-12 * push), joint
        assert np.allclose(forces.sum(axis=0), 0.0, atol=1e-12 * push)
        assert np.allclose(np.cross(points, forces).sum(axis=0), 0.0, atol=1e-9 * push)
    ball = Problem(
        np.array([[-1.0, 0.1, 0.0], [3.0, 0.1, 0.0], [0.0, 0.0, 0.0]]), np.array([[0, 1]]), np.array([4.0]), (), 1.0,
        1.0, 0, ball=2, ball_radius=0.3, ball_stiffness=50.0,
    )  # fmt: skip
    forces = contact.Contacts(ball).forces(ball.points)
    assert np.allclose(forces[:, 1], 10.0 * np.array([0.75, 0.25, -1.0])) and np.allclose(forces[:, [0, 2]], 0.0)


def test_pyelastica_has_a_rod_for_each_string_of_lines():
    if importlib.util.find_spec("elastica") is None:
        pytest.skip("elastica is not installed: pip install 'refweb[peers]'")
    from validation.peers.programs import pyelastica

    found = pyelastica.strings(works()["impact-error"].problem(True))
    assert len(found) == 14 and all(len(nodes) == 9 for nodes in found), "seven rows and seven columns of 8 cells"


def test_a_program_that_does_not_run_tells_why(tmp_path):
    machine, problem = runs.machine(), works()["form"].problem(True)
    cost, result = runs.run(machine, "nothing", "form", problem, {})
    assert result is None and cost["failure"].startswith("ModuleNotFoundError") and "cpu" not in cost
    assert runs.version(machine, "nothing")[0] is None
    words = "step 3\nWARNING: matrix is singular\nTraceback (most recent call last)\nError: x"
    assert runs.complaint(words) == "WARNING: matrix is singular" and runs.complaint("all is well") == ""


@pytest.fixture
def measured(monkeypatch, tmp_path):
    """Runs of form finding that are not made: jax_fdm takes three times as long as refweb."""
    calls = []

    def run(machine, name, task, problem, settings):
        calls.append(name)
        cpu = 3.0 if name == "jax_fdm" else 1.0
        cost = {"version": name, "cpu": cpu, "wall": cpu, "first_cpu": cpu, "peak_mb": 1.0, "process_cpu": cpu}
        return cost, works()["form"].truth(problem).positions + 1e-9

    monkeypatch.setattr(compare.runs, "run", run)
    monkeypatch.setattr(command.runs, "version", lambda machine, name: (f"{name} 1.0", ""))
    return calls, ["jax_fdm", "kratos", "--work", "form", "--out", str(tmp_path)], tmp_path


def test_it_measures_in_pairs_and_goes_on(measured, capsys):
    calls, arguments, folder = measured
    assert command.main([*arguments, "--quick"]) == 0
    assert calls == ["refweb", "jax_fdm", "jax_fdm", "refweb"]
    text = (folder / "peers.md").read_text(encoding="utf-8")
    assert "| `jax_fdm` | 3 (1) |" in text and "In their own words" not in text
    assert "Quick variant: 180 lines." in text, "the page does not say what it has not measured"
    assert command.main([*arguments, "--quick"]) == 0 and len(calls) == 4, "nothing is measured twice"
    records = json.loads((folder / "form-quick.json").read_text(encoding="utf-8"))["records"]
    assert [r["beside"] for r in records] == [None, None, "jax_fdm", "jax_fdm"]
    assert command.main(arguments) == 0
    pairs = calls[6:]
    assert len(pairs) == 2 * page.ENOUGH and pairs[::2] == 5 * ["jax_fdm", "refweb"], "first the one, then the other"


def test_a_failure_is_told_in_words(measured, monkeypatch):
    _, arguments, folder = measured
    failure = {"failure": "RuntimeError: analyze returned -3", "words": "WARNING: singular"}
    run = compare.runs.run
    monkeypatch.setattr(
        compare.runs, "run", lambda m, name, *more: run(m, name, *more) if name == "refweb" else (dict(failure), None)
    )
    command.main([*arguments, "--quick"])
    text = (folder / "peers.md").read_text(encoding="utf-8")
    assert "| `jax_fdm` | fails |" in text
    assert "- `jax_fdm`, as they are: RuntimeError: analyze returned -3 · WARNING: singular" in text


def test_an_error_above_the_target_is_told(measured, monkeypatch):
    _, arguments, folder = measured
    run = compare.runs.run

    def other_model(machine, name, *more):
        cost, result = run(machine, name, *more)
        return cost, result if name == "refweb" else result + [0.0, 0.0, 0.02]

    monkeypatch.setattr(compare.runs, "run", other_model)
    command.main([*arguments, "--quick"])
    assert "| `jax_fdm` | 2e-02 m off |" in (folder / "peers.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_an_index_that_is_not_reached_is_told(monkeypatch):
    environment = {"PIP_CONFIG_FILE": os.devnull, "PIP_INDEX_URL": "http://127.0.0.1:9", "PIP_FIND_LINKS": ""}
    for key, value in (environment | {"PIP_RETRIES": "1", "PIP_TIMEOUT": "2"}).items():
        monkeypatch.setenv(key, value)
    found = start.measured("dop853")
    assert found["program"] == "dop853" and found["failure"].startswith("the package index is not reachable: "), found
    assert start.reason("WARNING: old\nERROR: No matching distribution found for x").endswith("found for x")


def test_wrong_names_are_refused(capsys):
    for arguments, words in (
        (["mujuco"], 'mujuco: no such peer, did you mean "mujoco"?'),
        (["--work", "impcit"], "impcit: no such work"),
    ):
        with pytest.raises(SystemExit) as ended:
            command.main(arguments)
        assert ended.value.code == 2 and words in capsys.readouterr().err


def test_the_curves_are_drawn(measured):
    _, arguments, folder = measured
    problem = works()["impact-error"].problem(True)
    one = compare.Comparison(works()["impact-error"], None, folder, True, lambda line: None)
    for n, settings in enumerate(one.settings["mujoco"]):
        one.records.append({"program": "mujoco", "settings": settings, "cpu": 2.0**n, "error": 4.0**-n, "beside": None})
    assert page.points(one, "mujoco") == [(1.0, 1.0), (2.0, 0.25), (4.0, 0.0625)]
    (plot,) = page.drawn([one]).axes
    one.records.append({"program": "moordyn", "settings": {"steps": 1}, "failure": "x", "beside": None})
    assert one.chosen("mujoco") is None and one.chosen("moordyn") is None, "errors of 0.06 m are too large"
    assert len(plot.lines) == 1 and len(problem.lines) == 112
    (plot,) = page.drawn([one, one]).axes
    assert [line.get_label() for line in plot.lines] == ["mujoco", "mujoco (impact-error)"]
