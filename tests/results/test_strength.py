"""Utilisation and margin of safety with ±: against closed forms, in words, and where 1 lies within ±."""

import dataclasses
import math

import pytest
from nets import hit_web, whole_and_resumed

import refweb
from refweb.net.web import Web
from refweb.pages import sheet_text
from refweb.results.strength import Utilisation, read_utilisation, strength_remark
from refweb.results.summary_text import on_run

E, AREA, MASS, SPEED = 1e9, 1e-6, 1.0, 2.0
STRESS = SPEED * math.sqrt(E * AREA * MASS) / AREA
"""Largest stress of a mass thrown along a weightless line of 1 m [Pa]."""
LOW = [refweb.Observe(name="low", quantity="displacement", reduce="max")]
"""An observable that says nothing of stress."""


def thrown(strength, lines=1, groups=(), **parts):
    """A mass thrown along lines side by side, seen by a displacement alone."""
    web = Web([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]], [[0, 1]] * lines, [1.0] * lines, rim=[0], groups=groups or None)
    given = {name: refweb.Group(knot_factor=0.5) for name in set(groups)}
    scene = dict(
        web=web,
        cable=refweb.Cable(
            law="tension-only", modulus=E, area=AREA / lines, density=0.0, strength=strength, groups=given
        ),
        effects=[refweb.PointMass(node=1, mass=MASS), refweb.Velocity(node=1, value=(0.0, 0.0, -SPEED))],
        solve=refweb.Dynamic(duration=0.1),
        observe=LOW,
    )
    return refweb.Scene(**{**scene, **parts})


@pytest.mark.parametrize("safety", [0.9, 0.3, 0.1])
def test_a_motion(safety):
    """v √(k m)/(A σ) is within ±, which falls with the step; that of what is allowed is larger by the same factor."""
    solution = refweb.run(thrown(2.0 * STRESS, solve=refweb.Dynamic(duration=0.1, safety=safety)), progress=False)
    used = solution.utilisation
    assert abs(used.value - 0.5) <= used.error < 0.2 * safety**2
    assert solution.summary()["utilisation"] == used.plain() and list(used.plain())[:3] == ["value", "line", "error"]
    assert solution.margin["error"] == used.error and used.parts["time"] == used.error


def test_without_a_twin_nothing_is_known_and_it_says_so():
    solution = refweb.run(thrown(2.0 * STRESS, accuracy=refweb.Accuracy(error="none")), progress=False)
    assert solution.utilisation.error is None and solution.margin["error"] is None
    text = dict(on_run(solution.summary()))["strength"]
    assert text.startswith("utilisation 0.50 at line 0") and text.endswith("its ± is not known")


def test_it_has_the_error_of_a_result_that_observes_the_same():
    observe = [refweb.Observe(name="peak", quantity="stress", reduce="max"), *LOW]
    solution = refweb.run(thrown(2.0 * STRESS, observe=observe), progress=False)
    assert solution.utilisation.error == pytest.approx(solution.results["peak"].error / (2.0 * STRESS), rel=1e-12)
    alone = refweb.run(thrown(2.0 * STRESS), progress=False)
    assert solution.utilisation.error == pytest.approx(alone.utilisation.error, rel=1e-6)


def test_a_margin_in_another_line():
    """Two lines side by side of equal stress, and half the strength of the second at its knots."""
    scene = thrown(2.0 * STRESS, lines=2, groups=["first", "second"])
    cable = dataclasses.replace(scene.cable, groups={"second": refweb.Group(knot_factor=0.5)})
    solution = refweb.run(scene.replace(cable=cable), progress=False)
    margin = solution.margin
    assert margin["line"] == 1 and abs(margin["used"] - 1.0) <= margin["error"] < 0.1
    assert margin["error"] == pytest.approx(2.0 * solution.utilisation.error, rel=1e-6)
    text = dict(sheet_text.on_margin(solution.summary(), {"cable": {"knot_factor": 0.5}}, True))["margin of safety"]
    assert "±" in text and "undecided, as 0 lies within ±" in text


@pytest.mark.parametrize("law", ["tension-only", "linear", "smooth"])
def test_an_equilibrium(law):
    """A weight on a line: its stress is F/A whatever the law, and ± is of rounding."""
    more = dict(slackness=0.0, smoothing=1e-4) if law == "smooth" else {}
    scene = thrown(
        4e7,
        cable=refweb.Cable(law=law, modulus=E, area=AREA, density=0.0, strength=4e7, safety_factor=2.0, **more),
        effects=[refweb.Load(node=1, force=(0.0, 0.0, -30.0))],
        solve=refweb.Static(),
    )
    solution = refweb.run(scene, progress=False)
    used, margin = solution.utilisation, solution.margin
    assert abs(used.value - 0.75) <= used.error < 1e-7
    assert abs(margin["used"] - 1.5) <= margin["error"] == pytest.approx(2.0 * used.error, rel=1e-6)
    assert used.proven == (law == "tension-only")


def test_an_equilibrium_has_the_error_of_the_smooth_law():
    """Between two supports, strained by nothing: the floor of the smooth law is all that there is, and falls with η."""
    web = Web([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0]], [[0, 1], [1, 2]], [0.5, 0.5], rim=[0, 2])
    cable = refweb.Cable(law="smooth", modulus=E, area=AREA, density=0.0, strength=1e7, slackness=0.0, smoothing=1e-3)
    load = refweb.Load(node=1, force=(0.0, 0.0, -1.0))
    solution = refweb.run(
        refweb.Scene(web=web, cable=cable, effects=[load], solve=refweb.Static(), observe=LOW), progress=False
    )
    sharp = refweb.run(solution.scene.replace(cable=dataclasses.replace(cable, smoothing=1e-9)), progress=False)
    off = abs(solution.utilisation.value - sharp.utilisation.value)
    assert 1e-4 < off <= 1.5 * solution.utilisation.error and solution.utilisation.error < 5.0 * off
    assert solution.margin["error"] == pytest.approx(solution.utilisation.error, rel=1e-6)


def test_further_runs_tell_of_it():
    """The line that is thrown has one element: with more of them nothing changes, as it has no mass."""
    cable = refweb.Cable(law="tension-only", modulus=E, area=AREA, density=1000.0, strength=2.0 * STRESS)
    solution = refweb.trust(thrown(None, cable=cable, solve=refweb.Dynamic(duration=0.05)), progress=False)
    parts = solution.utilisation.parts
    assert isinstance(parts["elements"], float) and parts["contact_stiffness"] == "none"
    assert solution.utilisation.error == pytest.approx(sum(part for part in parts.values() if isinstance(part, float)))
    assert parts["chance"] == "none" and "only" not in dict(on_run(solution.summary()))["strength"]


def test_a_resumed_run_has_the_same(tmp_path):
    scene = hit_web("hit").replace(observe=LOW, accuracy=refweb.Accuracy())
    scene = scene.replace(cable=dataclasses.replace(scene.cable, strength=1e7))
    whole, resumed = whole_and_resumed(scene, tmp_path)
    assert whole.utilisation == resumed.utilisation and whole.utilisation.error > 0.0
    assert whole.margin == resumed.margin
    assert refweb.load(tmp_path / "whole").utilisation == whole.utilisation


@pytest.mark.parametrize(
    ("used", "words"),
    [
        ((0.9, 3, 0.05), None),
        ((1.2, 3, 0.05), "line 3 breaks: stress over strength is 1.2"),
        ((0.98, 3, 0.05), "line 3 may break, which is undecided: stress over strength is 0.98 ± 0.05"),
        ((1.04, 3, 0.05), "line 3 may break, which is undecided: stress over strength is 1.04 ± 0.05"),
        ((1.2, 3, None), "line 3 breaks: stress over strength is 1.2, and its ± is not known"),
        ((0.98, 3, 0.01, None, 0.02), "line 3 may break, which is undecided: stress over strength is 0.98 ± 0.03"),
    ],
)
def test_the_warning(used, words):
    found = list(strength_remark(Utilisation(*used)))
    assert [finding.code for finding in found] == ["over-strength"] * (words is not None)
    assert words is None or found[0].text.startswith(words)


def test_a_run_near_its_strength_warns_that_it_is_undecided():
    solution = refweb.run(thrown(STRESS), progress=False)
    assert abs(solution.utilisation.value - 1.0) <= solution.utilisation.error
    assert [text for text in solution.warnings if "may break, which is undecided" in text]


def test_what_a_file_without_it_says():
    assert read_utilisation({"value": 0.5, "line": 2}) == Utilisation(0.5, 2)
    assert dict(on_run({"utilisation": {"value": 0.57, "line": 989, "error": 0.04}}))["strength"] == (
        "utilisation 0.570 ± 0.040 at line 989"
    )
