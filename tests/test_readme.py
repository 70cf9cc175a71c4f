"""What the README shows works as it stands there."""

import pathlib
import re
import tomllib

import pytest

import refweb
from refweb.dynamics.integrators.energy_book import DRIFT
from refweb.registry import EFFECTS
from refweb.scene import SHIPPED_SCENES

README = (pathlib.Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def block(language):
    return re.search(rf"```{language}\n(.*?)```", README, re.DOTALL).group(1)


def test_python_example(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(block("python"), "README", "exec"), names := {})
    printed, solution = capsys.readouterr(), names["solution"]
    result, shape, tension, deflection = printed.out.splitlines()
    assert result.startswith("Result(value=") and "unit='N'" in result and printed.err == ""
    assert shape == f"({len(solution.scene.web.web().points)}, 3)"
    assert float(tension) == solution.results["max_tension"].value
    assert len(deflection.strip("[]").split()) == len(solution.scene.solve.load_steps)
    assert (tmp_path / "net" / "web.pvd").is_file()


def test_the_limit_of_the_drift():
    assert f"whose energy drifts by more than {100 * DRIFT:g} % is repeated" in README


def test_scene_example():
    scene = refweb.Scene.from_dict(tomllib.loads(block("toml")))
    solution = refweb.run(scene)
    assert solution.status == "solved" and len(solution.steps) == 2
    assert solution.results["deflection"].value > 0


def test_every_effect_and_shipped_scene_is_named():
    for name in EFFECTS:
        assert f"`[{name}]`" in README or f"`[[{name}]]`" in README
    for path in SHIPPED_SCENES.glob("*.toml"):
        assert f"`{path.stem}`" in README


@pytest.mark.parametrize("marker, words", [("main job", "refweb run hexagon-impact"), ("test command", "-m pytest")])
def test_two_commands_are_one_line_each(marker, words):
    lines = README.split(f"<!-- {marker} -->\n```sh\n")[1].split("```")[0].strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("python3 -m venv") and words in lines[0]


def test_impacts_run_by_name(tmp_path):
    for path in SHIPPED_SCENES.glob("*impact.toml"):
        solution = refweb.run(path.stem)
        assert solution.status == "solved" and not solution.warnings
        assert all(result.error is not None for result in solution.results.values())
