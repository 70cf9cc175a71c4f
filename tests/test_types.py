"""Types: the package has no errors to a type checker, and to users theirs are shown as they write.

The checker is basedpyright, a pyright that downloads nothing, with what ``pyproject.toml`` says of it. It reads refweb
and a script of a user in one go. Of pyvista, whose types take it a third of its time, the ordinary run is told nothing.
"""

import json
import pathlib
import subprocess
import sys

import pytest

import refweb

pytest.importorskip("basedpyright")
pytestmark = pytest.mark.slow
ROOT = pathlib.Path(refweb.__file__).parents[1]

SCRIPT = """
import numpy as np
import refweb

web = refweb.Web(points=[[0, 0, 0], [1, 0, 0]], lines=np.array([[0, 1]]), rim=[0, 1])
cable = refweb.Cable(modulus=1e9, area=1e-6, density=1000.0, groups={"rim": refweb.Group(area=2e-6)})
scene = refweb.Scene(
    web=web,
    cable=cable,
    effects=[refweb.Gravity(acceleration=(0, 0, -9.81)), refweb.Load(node="centre", force=np.zeros(3))],
    solve=refweb.Dynamic(duration=1.0),
    observe=[refweb.Observe(name="sag", quantity="displacement", node="centre")],
)
solution = refweb.run(scene)
print(solution.positions[0], solution.results["sag"].value, refweb.modes(scene).frequency[0], cable.area / 2.0)
"""
MISTAKES = {
    "refweb.Cable(modulos=1)": "modulos",
    "refweb.Cable(modulus='soft', area=1e-6, density=1.0)": "modulus",
    "refweb.Scene(web=web, cable=refweb.Gravity(acceleration=(0, 0, 1)))": "cable",
    "refweb.Solve": "Solve",
    "solution.position": "position",
    "scene.title / 2": "str",
}
"""What a user may write wrongly, each with a word of what is to be said of it."""


def told(folder, script, **options):
    """What the checker says of the package and of a script: the file, line, severity and text of each diagnostic."""
    (folder / "script.py").write_text(script)
    config = {"include": [str(ROOT / "refweb"), str(folder / "script.py")], "extraPaths": [str(ROOT)], **options}
    config = {"extends": str(ROOT / "pyproject.toml"), **config}
    (folder / "pyrightconfig.json").write_text(json.dumps(config))
    command = [sys.executable, "-m", "basedpyright", "-p", str(folder), "--pythonpath", sys.executable, "--outputjson"]
    found = json.loads(subprocess.run(command, capture_output=True, text=True, timeout=900).stdout)
    assert found["summary"]["filesAnalyzed"] > len(list(ROOT.glob("refweb/**/*.py")))
    return [
        (pathlib.Path(one["file"]), one["range"]["start"]["line"], one["severity"], one["message"])
        for one in found["generalDiagnostics"]
    ]


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """What is told of the package and of a script that ends with the `MISTAKES`, a line each."""
    folder = tmp_path_factory.mktemp("types")
    opaque = folder / "stubs" / "pyvista"
    opaque.mkdir(parents=True)
    (opaque / "__init__.pyi").write_text("def __getattr__(name: str): ...\n")
    return told(folder, SCRIPT + "\n".join(MISTAKES), stubPath=str(opaque.parent))


def test_the_package_has_none(said):
    """Names, arguments and attributes that do not exist are seen without a run of the code that uses them."""
    ours = [one for one in said if one[0].name != "script.py"]
    assert not ours, ours


def test_mistakes_of_users_are_shown_and_nothing_else(said):
    first = SCRIPT.count("\n")
    theirs = [(line, text) for file, line, severity, text in said if file.name == "script.py" and severity == "error"]
    for line, (mistake, word) in enumerate(MISTAKES.items(), first):
        texts = [text for at, text in theirs if at == line]
        assert any(word in text for text in texts), (mistake, texts)
    assert {line for line, _ in theirs} == set(range(first, first + len(MISTAKES))), theirs


@pytest.mark.slow
def test_the_package_has_none_with_all_that_is_known_of_others(tmp_path):
    assert not told(tmp_path, SCRIPT)
    assert not told(tmp_path, SCRIPT, useLibraryCodeForTypes=True)
