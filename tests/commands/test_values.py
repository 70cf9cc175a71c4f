"""``--set PATH=VALUE``: the scene that runs is the one with the value; a refusal names path, value and limit."""

import json
import tomllib

import pytest
from nets import SMALL

import refweb
from refweb.__main__ import main

SCENE = SMALL.replace('title = "Small web"\n', "").replace("load_steps = [1, 2, 3]\n", "")
WRONG = {
    "cable.aera=1": 'net.toml with cable.aera = 1: [cable] aera = 1: unknown key, did you mean "area"?',
    "cable.area=-1": "net.toml with cable.area = -1: [cable] area = -1.0 must be > 0 [m²]",
    "cable.area=wide": 'net.toml with cable.area = "wide": [cable] area = "wide" must be a number [m²]',
    "cabel.area=1": "net.toml with cabel.area = 1: [cabel]: unknown table or key, or of a plug-in "
    'that is not installed, did you mean "cable"?',
    "load.0.node=center": 'net.toml with load.0.node = "center": [[load]] 1 node = "center" names no node',
    "load.5.node=1": "net.toml: load.5.node = 1: load.5: the number must be 0 … 0; 1 adds one",
    "solve.kind=dynamic": 'net.toml with solve.kind = "dynamic": [solve] duration is missing',
    "solve.method": "--set solve.method: must be PATH=VALUE",
    "solve.load_steps=[1": "--set solve.load_steps=[1: cannot be read as TOML",
}


@pytest.fixture
def net(tmp_path, monkeypatch):
    """A folder to work in with one scene file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "net.toml").write_text(SCENE, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("given", WRONG)
def test_wrong_values_are_one_line_that_names_path_value_and_limit(net, capsys, given):
    for verb in ("run", "check", "modes", "cost"):
        assert main([verb, "net.toml", "--set", "title=net", "--set", given]) == 2
        out, err = capsys.readouterr()
        assert out == "" and err.count("\n") == 1
        first, _, rest = WRONG[given].partition(" with ")
        assert f'{first} with title = "net", {rest}' in err if rest else first in err, err
    assert [path.name for path in net.iterdir()] == ["net.toml"]


def test_a_run_solves_the_scene_with_the_values_and_keeps_it(net, capsys):
    settings = ["solve.load_steps=[1,2]", "load.0.force=[0,0,3]", "solve.method=newton", "load.1.node=centre"]
    settings += ["load.1.force=[0,0,1]", "gravity.acceleration=[0,0,0]", "cable.modulus=1", "cable.modulus=2e5"]
    arguments = [part for one in settings for part in ("--set", one)]
    assert main(["run", "net.toml", "--out", "out", *arguments]) == 0
    kept = tomllib.loads((net / "out" / "scene.toml").read_text(encoding="utf-8"))
    assert kept["solve"]["load_steps"] == [1.0, 2.0] and kept["cable"]["modulus"] == 2e5 and kept["title"] == "net"
    assert [load["force"] for load in kept["load"]] == [[0.0, 0.0, 3.0], [0.0, 0.0, 1.0]]
    by_hand = SCENE.replace("1.0]", "4.0]").replace("1e5", "2e5") + "load_steps = [1, 2]"
    same = refweb.run(refweb.Scene.from_dict(tomllib.loads(by_hand)))
    found = json.loads((net / "out" / "run.json").read_text())["results"]["max_tension"]["value"]
    assert found == pytest.approx(same.results["max_tension"].value, rel=1e-9)


def test_check_and_modes_take_values(net, capsys):
    assert main(["check", "net.toml", "--set", "web.rows=5", "--set", "title=Five rows"]) == 0
    assert "Five rows" in (out := capsys.readouterr().out) and "15 cells" in out
    assert main(["modes", "net.toml", "-n", "1", "--out", "out", "--set", "cable.density=400"]) == 0
    assert main(["modes", "net.toml", "-n", "1", "--out", "own"]) == 0
    four, one = (json.loads((net / f / "run.json").read_text())["steps"][0]["results"] for f in ("out", "own"))
    ratio = next(iter(one.values()))["value"] / next(iter(four.values()))["value"]
    assert ratio == pytest.approx(2.0, rel=1e-6)  # four times the mass, half the frequency
