"""The comparison with peers: each program solves a small problem, and the command measures, goes on and tells.

A program is held against methods that share no line with it or with refweb: a shifted Newton method and the Verlet
method in NumPy, and the closed form of a saddle. One whose peer is not installed is skipped.
"""

import importlib.util
import json

import numpy as np
import pytest

from validation.peers import __main__ as command
from validation.peers import compare, page, runs, truth
from validation.peers.programs import refweb
from validation.peers.work import works

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
}
RIGHT = {
    "statics": truth.newton,
    "impact": lambda problem: truth.verlet(problem, 4000),
    "implicit": lambda problem: truth.verlet(problem, 4000),
    "form": lambda problem: works()["form"].truth(problem).positions,
}
TOLERANCES = {"statics": 1e-8, "impact": 1e-6, "implicit": 1e-4, "form": 1e-9}
"""Largest distance of a node [m]: a residual, and steps of 5e-5 s, and of 7e-4 s, squared times the frequencies."""
LARGER = {"kratos": {"statics": 2e-5, "impact": 2e-5, "implicit": 1e-4}, "moordyn": {"impact": 1e-5}}
"""Kratos's cables have the strain of Green, which differs by 3/2 of the strain, 1e-3, of itself; MoorDyn and the mass
that its user moves know of each other once a step."""


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
