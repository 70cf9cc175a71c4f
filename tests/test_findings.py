"""Findings: each has a code of the table, run.json and what is read back have them, and refusals stand among them."""

import ast
import json
import pathlib

import pytest

import refweb
from refweb.errors import EnergyDriftError, IntegrationError, PenetrationError, SolverError
from refweb.findings import CODES, REFUSAL, Finding, read_findings, texts
from refweb.registry import EFFECTS
from refweb.solution import load

PACKAGE = pathlib.Path(refweb.__file__).parent
TABLES = {
    "",
    "accuracy",
    "body",
    "cable",
    "control",
    "event",
    "motion",
    "observe",
    "solve",
    "supports",
    "web",
    *EFFECTS,
}


def made():
    """Calls of `Finding` in the package, with constant arguments as their values."""
    for path in PACKAGE.rglob("*.py"):
        if "Finding(" not in (text := path.read_text(encoding="utf-8")):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Finding":
                yield [arg.value if isinstance(arg, ast.Constant) else None for arg in node.args]


def test_codes_are_those_of_the_table():
    codes = {arguments[0] for arguments in made() if arguments and arguments[0]}
    refusals = {error.code for error in (SolverError, IntegrationError, EnergyDriftError, PenetrationError)}
    assert codes | refusals == set(CODES)


def test_tables_are_those_of_scenes():
    assert {arguments[2] for arguments in made() if len(arguments) > 2 and arguments[2] is not None} <= TABLES


def a_body_that_is_not_felt(**tables):
    given = {
        "web": {"kind": "inline", "points": [[0, 0, 0], [1, 0, 0]], "lines": [[0, 1]]},
        "cable": {"law": "linear", "modulus": 1e6, "area": 1e-5, "density": 1000.0, "strength": 1.0},
        "supports": {"nodes": [0]},
        "body": [{"name": "ball", "radius": 0.1, "mass": 1.0, "position": [5, 0, 0]}],
        "load": [{"node": 1, "force": [1.0, 0.0, 0.0]}],
        "solve": {"kind": "dynamic", "duration": 1e-3},
        "output": {"interval": 1e-3},
        "accuracy": {"error": "none"},
    }
    return refweb.Scene.from_dict({name: value for name, value in (given | tables).items() if value is not None})


def test_findings_are_in_run_json_and_read_back(tmp_path):
    solution = refweb.run(a_body_that_is_not_felt(), out=tmp_path / "run")
    codes = {finding.code: finding for finding in solution.findings}
    assert codes["body-not-felt"].table == "body" and codes["body-not-felt"].severity == "warning"
    summary = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    assert [Finding(**entry) for entry in summary["findings"]] == solution.findings
    assert summary["warnings"] == solution.warnings == texts(solution.findings)
    assert load(tmp_path / "run").findings == solution.findings


def test_a_refusal_is_a_finding_and_no_warning(tmp_path):
    """Of a load beyond the strength in statics with rupture, which names the line that breaks."""
    scene = a_body_that_is_not_felt(
        body=None, rupture={"strength": 1.0}, solve={"kind": "static", "load_steps": [1.0]}, output=None, accuracy=None
    )
    with pytest.raises(refweb.SolverError) as refused:
        refweb.run(scene, out=tmp_path / "run")
    summary = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    (last,) = (finding for finding in read_findings(summary) if finding.severity == REFUSAL)
    assert last.code == "solver" and last.text == summary["message"] == str(refused.value)
    assert last.text not in summary["warnings"]


def test_a_folder_without_codes_has_its_warnings():
    assert read_findings({"warnings": ["slack lines push"]}) == [Finding("", "slack lines push")]


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_statics_says_that_it_has_no_friction(friction):
    scene = refweb.Scene(
        web=refweb.Inline(points=[[-1, 0, 0], [0, 0, 0.1], [1, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2]),
        cable=refweb.Cable(law="tension-only", modulus=1e7, area=1e-5, density=1.0),
        effects=[
            refweb.Body(name="post", radius=0.1, fixed=True, position=(0.1, 0.0, 0.0)),
            refweb.Contact(stiffness=1e4, friction=friction),
            refweb.Load(node=1, force=(0.0, 0.0, -1.0)),
        ],
        solve=refweb.Static(),
    )
    texts = [finding.text for finding in refweb.run(scene).findings if finding.code == "left-out"]
    assert len(texts) == (friction > 0.0) and all("no friction" in text for text in texts)
