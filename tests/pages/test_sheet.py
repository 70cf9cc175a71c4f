"""The sheet: sizes, largest tension and margin of safety against closed forms, verdicts as a run has them, refusals."""

import json
import math
import re
import tomllib

import pytest

import refweb
from refweb.__main__ import main
from refweb.errors import InputError
from refweb.net.web import Web
from refweb.pages import page, sheet
from refweb.pages import sheet_text as words
from refweb.pictures.peaks import largest_tension
from refweb.pictures.record import of_folder

E, AREA, MASS, SPEED = 1e9, 1e-6, 1.0, 2.0
CABLE = {"law": "tension-only", "modulus": E, "area": AREA, "density": 1000.0}
LINES = """
[web]
kind = "inline"
points = [[0, 0, 0], [0, 0, -1], [0, 0, -2]]
lines = [[0, 1], [1, 2]]
groups = ["upper", "lower"]
supports = [0]

[[load]]
node = 1
force = [0, 0, -10]

[[load]]
node = 2
force = [0, 0, -30]

[[point_mass]]
node = 2
mass = 0.25

[solve]
kind = "static"
load_steps = [1, 3, 2]
"""
"""Two lines below each other: at load step s the upper one has 40 s N, the lower one 30 s N."""


def hanging(cable=CABLE, observe=(), **parts):
    """The scene of `LINES` with some cable."""
    more = {"observe": list(observe)} if observe else {}
    return refweb.Scene.from_dict({**tomllib.loads(LINES), "cable": cable, **more, **parts})


def run(folder, *args, **kwargs):
    """The folder of a run of `hanging`."""
    refweb.run(hanging(*args, **kwargs), out=folder, progress=False)
    return folder


def thrown(**cable):
    """A mass thrown along a weightless line: the largest tension is v √(k m)."""
    web = Web([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]], [[0, 1]], [1.0], rim=[0])
    velocity = refweb.Velocity(node=1, value=(0.0, 0.0, -SPEED))
    return refweb.Scene(
        web=web,
        cable=refweb.Cable(**{**CABLE, "density": 0.0}, **cable),
        effects=[refweb.PointMass(node=1, mass=MASS), velocity],
        solve=refweb.Dynamic(duration=0.1),
    )


def said(folder):
    """Names and sentences of a sheet, as a dict."""
    record = of_folder(folder, with_frames=False)
    dynamic = record.kind == "dynamic"
    largest = largest_tension(record.summary, record.scene, lambda: sheet.of_frames(record))
    rows = [*words.on_sizes(record.summary["web"]), *words.on_tension(largest, dynamic)]
    rows += words.on_margin(record.summary, record.scene, dynamic)
    return dict(rows)


def test_sizes_are_those_of_the_web(tmp_path):
    """Diameter 2 √(A/π), mass ρ A L and that of the point mass, and twice the volume A L at a density of a half."""
    found = said(run(tmp_path / "out"))
    assert found["overall size"].startswith("0 × 0 × 2 m")
    assert found["lines"] == "2, 2 m of cable"
    assert found["cable diameter"].startswith(f"{2e3 * math.sqrt(AREA / math.pi):.4g} mm,")
    assert found["cable mass"] == "0.002 kg" and found["total mass"].startswith("0.252 kg")
    assert found["packed volume"].startswith("0.004 l, if 50 % of it is cable") and "0.002 l" in found["packed volume"]
    assert dict(words.on_sizes({"volume": 2e-6}, packing=0.25))["packed volume"].startswith("0.008 l, if 25 %")


def test_a_diameter_of_groups_is_a_range(tmp_path):
    found = said(run(tmp_path / "out", {**CABLE, "groups": {"lower": {"area": 4 * AREA}}}))
    size = 2e3 * math.sqrt(AREA / math.pi)
    assert found["cable diameter"].startswith(f"{size:.4g} mm to {2 * size:.4g} mm,")


@pytest.mark.parametrize(
    ("observe", "source"),
    [
        ([{"name": "pull", "quantity": "tension"}], ""),
        ([{"name": "stress", "quantity": "stress"}], "the largest stress times the area"),
        ([{"name": "lower", "quantity": "tension", "line": 1}], "in the frames"),
        ([{"name": "low", "quantity": "displacement"}], "in the frames"),
    ],
)
def test_the_largest_tension_is_of_all_steps(tmp_path, observe, source):
    """Of the second of three steps, 120 N in line 0; of a result over all lines, else of the frames."""
    text = said(run(tmp_path / "out", observe=observe))["largest tension"]
    assert re.match(r"120(\.0+)?( ± [\d.e-]+)? N in line 0 at load step 3", text) and source in text
    assert ("±" in text) == (source != "in the frames")


def test_by_the_margin_where_lines_are_alike(tmp_path):
    """Where no result has it and all lines have one area and one strength."""
    observe = [{"name": "low", "quantity": "displacement"}]
    text = said(run(tmp_path / "out", {**CABLE, "strength": 1e9}, observe))["largest tension"]
    assert re.match(r"120(\.0+)? N in line 0 at load step 3", text) and "its ± is not known" in text


@pytest.mark.parametrize(
    ("strength", "factors", "verdict"),
    [(3e8, {}, "holds"), (2e8, dict(safety_factor=1.5, knot_factor=0.8), "does not hold")],
)
def test_the_margin_of_safety(tmp_path, strength, factors, verdict):
    """MS = strength × knot_factor/(safety_factor σ) − 1, σ = 120 N over the area; utilisation knows no factor."""
    observe = [{"name": "pull", "quantity": "tension"}]
    folder = run(tmp_path / "out", {**CABLE, "strength": strength, **factors}, observe)
    stress = 120.0 / AREA
    margin = strength * factors.get("knot_factor", 1.0) / (factors.get("safety_factor", 1.0) * stress) - 1.0
    summary = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    assert summary["margin"]["value"] == pytest.approx(margin, rel=1e-6)
    assert summary["utilisation"]["value"] == pytest.approx(80.0 / AREA / strength, rel=1e-6)  # of the last step
    found = said(folder)
    assert float(found["margin of safety"].split()[0]) == pytest.approx(margin, abs=1e-3)
    assert found["margin of safety"].endswith(verdict) and "line 0 at load step 3" in found["its terms"]
    assert (" × 0.8 left at knots / (1.5 × " in found["its terms"]) == bool(factors)
    reached = re.fullmatch(
        r"line 0: its stress reaches ([\d.]+) ± ([\d.e-]+) % of its strength", found["would break first"]
    )
    assert abs(float(reached[1]) - 100.0 * stress / strength) <= float(reached[2]) < 1e-4


def test_factors_change_nothing_else(tmp_path):
    """All numbers of a run but the margin are the same to the last bit."""
    plain, other = (
        refweb.run(hanging({**CABLE, "strength": 1e9, **more}), progress=False)
        for more in ({}, dict(safety_factor=3.0, knot_factor=0.5))
    )
    assert plain.results == other.results and plain.utilisation == other.utilisation
    assert (plain.state.x == other.state.x).all()
    assert (1.0 + plain.margin["value"]) / (1.0 + other.margin["value"]) == pytest.approx(6.0)


def test_factors_of_groups_choose_the_line(tmp_path):
    """The lower line has three quarters of the stress of the upper one, and half of the strength at its knots."""
    cable = {**CABLE, "strength": 1e9, "groups": {"lower": {"knot_factor": 0.5}}}
    summary = json.loads((run(tmp_path / "out", cable) / "run.json").read_text(encoding="utf-8"))
    assert summary["utilisation"]["line"] == 0 and summary["margin"]["line"] == 1
    assert summary["margin"]["value"] == pytest.approx(0.5e9 / (90.0 / AREA) - 1.0, rel=1e-6)


def test_the_margin_of_a_motion():
    """Stress v √(k m)/A, at a quarter of the period."""
    stress = SPEED * math.sqrt(E * AREA * MASS) / AREA
    solution = refweb.run(thrown(strength=2.0 * stress, safety_factor=1.6), progress=False)
    assert solution.margin["value"] == pytest.approx(2.0 / 1.6 - 1.0, rel=1e-3) and solution.margin["line"] == 0
    assert solution.margin["time"] == pytest.approx(0.5 * math.pi / math.sqrt(E * AREA / MASS), rel=2e-2)


def test_two_lines_in_motion_with_factors_of_their_own():
    """Side by side, of equal stress: the one whose safety factor is larger has the smaller margin."""
    web = Web([[0, 0, 0], [0, 0, -1.0]], [[0, 1]] * 2, [1.0, 1.0], rim=[0], groups=["first", "second"])
    cable = refweb.Cable(**{**CABLE, "density": 0.0}, strength=1e9, groups={"second": {"safety_factor": 4.0}})
    solution = refweb.run(thrown().replace(web=web, cable=cable), progress=False)
    stress = SPEED * math.sqrt(2.0 * E * AREA * MASS) / (2.0 * AREA)
    assert solution.margin["line"] == 1
    assert solution.margin["value"] == pytest.approx(1e9 / (4.0 * stress) - 1.0, rel=1e-3)


@pytest.mark.parametrize(
    ("allowed", "error", "expected"),
    [
        (2.0, 0.5, (1.0 / 3.0, 3.0, "holds")),
        (2.0, 1.2, (2.0 / 2.2 - 1.0, math.inf, "undecided")),
        (0.5, 0.2, (0.5 / 1.2 - 1.0, 0.5 / 0.8 - 1.0, "does not hold")),
        (0.9, 0.2, (0.9 / 1.2 - 1.0, 0.9 / 0.8 - 1.0, "undecided")),
        (0.9, None, (-0.1, -0.1, "does not hold")),
    ],
)
def test_the_decision(allowed, error, expected):
    """Of a stress of 1 Pa with ±: both ends of the margin, and the verdict."""
    lower, upper, verdict = words.decision({"stress": 1.0, "allowed": allowed}, error)
    assert (lower, upper) == pytest.approx(expected[:2]) and verdict == expected[2]


def test_undecided_is_said():
    summary = {
        "margin": {
            "value": -0.1, "used": 1 / 0.9, "line": 3, "stress": 1e6, "allowed": 9e5, "strength": 9e5, "area": 1e-6,
            "time": 0.5,
        },
        "results": {"s": {"value": 1e6, "error": 2e5, "unit": "Pa", "time": 0.5, "where": 3}},
    }  # fmt: skip
    scene = {"observe": [{"name": "s", "quantity": "stress", "reduce": "max"}], "cable": CABLE}
    text = dict(words.on_margin(summary, scene, True))["margin of safety"]
    assert text == "-0.10 ± 0.23, from -0.25 to 0.125: undecided, as 0 lies within ±"


def test_without_strength_the_key_is_named(tmp_path):
    assert "give [cable] strength [Pa]" in said(run(tmp_path / "out"))["margin of safety"]


def test_verdicts_are_shown_where_a_run_has_them():
    plain = {"value": 1.0, "error": 0.1, "unit": "N", "time": 0.0, "where": None}
    columns, rows = words.rows_of_worth({"a": plain})
    assert columns == ["result", "value"] and rows == [["a", "1.00 ± 0.10 N"]]
    more = {**plain, "verdict": "wide", "verdict_text": "The contact is too stiff for the step."}
    columns, rows = words.rows_of_worth({"a": {**plain, "verdict": None}, "b": more})
    assert columns[2:] == ["verdict", "reason"] and rows[0][2:] == ["", ""]
    assert rows[1] == ["b", "1.00 ± 0.10 N", "wide", "The contact is too stiff for the step."]


@pytest.mark.slow
def test_the_command(tmp_path, capsys):
    """One page that needs nothing else; the same section is the first of the report."""
    folder = run(tmp_path / "out", {**CABLE, "strength": 1e9})
    assert main(["report", str(folder), "--sheet"]) == 0
    assert capsys.readouterr().out == f"{folder / 'sheet.html'}\n"
    text = (folder / "sheet.html").read_text(encoding="utf-8")
    assert re.findall(r'<section id="([^"]*)"', text) == ["sheet"]
    assert [head for head in re.findall("<h3>(.*?)</h3>", text)] == ["What it is", "What happens", "What it is worth"]
    assert main(["report", str(folder), "--sheet", "--packing", "0.25", "--out", str(tmp_path / "s.html")]) == 0
    assert "if 25 % of it is cable" in (tmp_path / "s.html").read_text(encoding="utf-8")
    section = re.search(r'<section id="sheet">.*?</section>', text, re.DOTALL)[0]
    whole = page.page_of(of_folder(folder))
    assert re.findall(r'<section id="([^"]*)"', whole)[0] == "sheet" and section in whole
    assert refweb.load(folder).report(tmp_path / "again.html", sheet=True).read_text(encoding="utf-8") == text


@pytest.mark.parametrize(
    ("more", "words_of_it"),
    [
        (["--sheet", "--frames", "3"], "--frames 3 has no meaning with --sheet"),
        (["--packing", "0.5"], "--packing 0.5 has a meaning with --sheet alone"),
        (["--sheet", "--packing", "1.5"], "packing = 1.5 must be > 0 and ≤ 1"),
    ],
)
def test_refusals(tmp_path, capsys, more, words_of_it):
    folder = run(tmp_path / "out")
    assert main(["report", str(folder), *more]) == 2
    assert words_of_it in capsys.readouterr().err and not (folder / "sheet.html").exists()


@pytest.mark.slow
def test_a_study_has_no_sheet(tmp_path, capsys):
    refweb.sweep(hanging(), {"cable.modulus": [1e9]}, tmp_path / "study", workers=1, progress=False)
    assert main(["report", str(tmp_path / "study"), "--sheet"]) == 2
    assert "--sheet is of one run" in capsys.readouterr().err


@pytest.mark.parametrize(("key", "value"), [("safety_factor", 0.0), ("knot_factor", 0.0), ("knot_factor", 1.1)])
def test_factors_out_of_bounds(key, value):
    with pytest.raises(InputError, match=key):
        refweb.Cable(**CABLE, **{key: value})
    with pytest.raises(InputError, match=key):
        refweb.Group(**{key: value})


def test_a_sheet_of_modes(tmp_path):
    refweb.modes(hanging(), number=2, out=tmp_path / "modes", progress=False)
    text = page.sheet(tmp_path / "modes").read_text(encoding="utf-8")
    assert "frequency_1" in text and "What happens" not in text
