"""How deep lines get into bodies: closed forms, what is said and refused, and the stiffness that refweb chooses.

A line of one element between two supports does not give way: a ball on it is an oscillator of its mass and the penalty.
"""

import json
import tomllib
from dataclasses import replace

import nets
import numpy as np
import pytest
from scipy.optimize import brentq

import refweb
from refweb.__main__ import main
from refweb.dynamics.simulation import Simulation
from refweb.effects.contact.overlap import push_along
from refweb.results.state import State
from refweb.statics.body_penetration import Passage

RADIUS, MASS = 0.1, 1.0
HELD = refweb.Inline(points=[[-1, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1])
TWO = refweb.Inline(points=[[-1, 0, 0], [0, 0, 0], [1, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2])
CABLE = refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0)
METHODS = ("central-difference", "explicit", "cvode", "ida")
DEEP = refweb.Observe(name="deep", quantity="overlap", body="ball", reduce="max")


def ball(speed=1.0, gap=1e-3, **keys):
    own = dict(name="ball", radius=RADIUS, mass=MASS, position=(0.0, 0.0, -RADIUS - gap), velocity=(0.0, 0.0, speed))
    return refweb.Body(**{**own, **keys})


def hit(
    *bodies,
    method="central-difference",
    web=HELD,
    contact=None,
    duration=0.06,
    interval=0.01,
    effects=(),
    safety=0.5,
    **keys,
):
    return refweb.Scene(
        web=web,
        cable=CABLE,
        effects=[*(bodies or (ball(),)), refweb.Contact(**(contact or {})), *effects],
        solve=refweb.Dynamic(method=method, duration=duration, **dict(safety=safety) if safety != 0.5 else {}),
        output=refweb.Output(interval=interval, frames=2),
        **{"observe": [DEEP], "accuracy": refweb.Accuracy(error="none"), **keys},
    )


def pressed(force, stiffness, steps=(1.0,), modulus=1e5, gap=-1e-4):
    """A node between two lines, pressed on a fixed ball just below it, whose top it cannot slip from to a side."""
    under = ball(speed=0.0, gap=gap, fixed=True, mass=None)
    return refweb.Scene(
        web=TWO,
        cable=refweb.Cable(law="tension-only", modulus=modulus, area=1e-4, density=0.0),
        support=[refweb.Supports(nodes=[1], components=["x", "y"])],
        effects=[under, refweb.Contact(stiffness=stiffness), refweb.Load(node=1, force=(0.0, 0.0, -force))],
        solve=refweb.Static(load_steps=steps),
        observe=[DEEP],
    )


# Closed forms


@pytest.mark.ordinary(
    "central-difference-1.0", "central-difference-1.5", "explicit-1.0", "explicit-1.5", "cvode-1.5", "ida-1.0"
)
@pytest.mark.parametrize("exponent", [1.0, 1.5])
@pytest.mark.parametrize("method", METHODS)
def test_deepest_overlap_of_a_hit(method, exponent):
    """½ m v² = k δ^(p + 1)/(p + 1), between rows and between steps: rows are a third of the time that it takes."""
    stiffness, power = 2e4, exponent + 1.0
    solution = refweb.run(hit(method=method, contact=dict(stiffness=stiffness, exponent=exponent), accuracy=None))
    expected, found = (0.5 * MASS * power / stiffness) ** (1.0 / power), solution.results["deep"]
    assert abs(found.value - expected) <= found.error < 0.02 * expected and found.where == 0
    assert solution.history["deep"].max() < 0.999 * expected
    told = solution.summary()["bodies"]["ball"]
    assert told["overlap"] == found.value and told["time"] == found.time and told["line"] == 0
    assert told["stiffness"] == stiffness and not told["chosen"] and told["allowed"] == pytest.approx(0.1 * RADIUS)
    if exponent == 1.0:  # a quarter of a period after it has come
        assert found.time == pytest.approx(1e-3 + 0.5 * np.pi * (MASS / stiffness) ** 0.5, abs=2e-4)


def test_deepest_overlap_of_a_push():
    """Two lines share a node: F = 2 k δ. Newton's method and relaxation; the lines are too soft to bear anything."""
    for method in ("newton", "relaxation"):
        scene = pressed(100.0, 1e4, steps=(0.2, 1.0))
        solution = refweb.run(scene.replace(solve=refweb.Static(method=method, load_steps=(0.2, 1.0))))
        found = [step["results"]["deep"].value for step in solution.steps]
        np.testing.assert_allclose(found, [1e-3, 5e-3], rtol=1e-5)
        assert solution.bodies["ball"]["overlap"] == found[-1] and solution.bodies["ball"]["time"] == 1.0


SHAPES = {
    "sphere": (dict(radius=0.3), 0.03),
    "ring": (dict(radius=0.3, normal=(0.0, 0.0, 1.0)), 0.03),
    "box": (dict(size=(0.6, 0.8, 1.0)), 0.06),
    "cylinder": (dict(radius=0.3, length=0.4, axis=(0.0, 0.0, 1.0)), 0.04),
    "capsule": (dict(radius=0.3, length=0.1, axis=(0.0, 0.0, 1.0)), 0.06),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_what_is_allowed(shape):
    """A tenth of the radius, or of the smallest size."""
    keys, expected = SHAPES[shape]
    body = refweb.Body(name="it", shape=shape, position=(0.0, 5.0, -5.0), fixed=True, **keys)
    solution = refweb.run(hit(body, contact=dict(stiffness=1e4), duration=1e-3, interval=1e-3, observe=()))
    assert solution.bodies["it"]["allowed"] == pytest.approx(expected)
    assert any('body "it" never touches the web' in text for text in solution.warnings)


# What is said


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_too_deep_is_said_and_what_would_do_does(exponent):
    keys = dict(duration=0.2, safety=0.1)
    soft = refweb.run(hit(contact=dict(stiffness=5000.0, exponent=exponent), **keys))
    (text,) = soft.warnings
    assert "line 0 is up to" in text and 'in body "ball" at t = ' in text
    enough = float(text.split("stiffness = ")[1].split()[0])
    hard = refweb.run(hit(contact=dict(stiffness=enough, exponent=exponent), **keys))
    assert not hard.warnings and 0.01 * RADIUS < hard.results["deep"].value <= 0.021 * RADIUS


def test_too_deep_is_said_in_statics():
    (text,) = refweb.run(pressed(100.0, 2e3)).warnings
    assert "0.025 m deep" in text and "load step 1" in text and "power 1/1" in text
    enough = float(text.split("stiffness = ")[1].split()[0])
    assert not refweb.run(pressed(100.0, enough)).warnings


@pytest.mark.parametrize("method", METHODS)
def test_a_body_that_goes_through_is_refused(method, tmp_path):
    """½ k R² is half of what the ball brings; frames ahead of that are kept."""
    with pytest.raises(
        refweb.SolverError, match=r'line 0 passes the core of a body: .* in body "ball" at t = 0\.0\d+ s'
    ):
        refweb.run(hit(method=method, contact=dict(stiffness=50.0), duration=0.2), out=tmp_path / "run")
    run = json.loads((tmp_path / "run" / "run.json").read_text())
    assert run["status"] == "failed" and run["bodies"]["ball"]["overlap"] > 0.5 * RADIUS
    frames = sorted(path.name for path in (tmp_path / "run" / "frames").glob("web_*.vtu"))
    assert len(frames) >= 3 and frames[0] == "web_000000.vtu"


def test_a_body_that_goes_through_is_refused_in_statics():
    """In the core, k δ below F; and where a step leads past the ball, which smaller ones do not."""
    with pytest.raises(refweb.SolverError, match='line . passes the core of a body: .* in body "ball" at load step 1'):
        refweb.run(pressed(100.0, 700.0))
    stiff = dict(modulus=7e7, stiffness=1e5, gap=0.01)
    with pytest.raises(refweb.SolverError, match=r'line . passes the core of body "ball" on its way to load step 1'):
        refweb.run(pressed(1000.0, **stiff))
    solution = refweb.run(pressed(1000.0, steps=tuple(np.linspace(0.05, 1.0, 20).tolist()), **stiff))
    assert solution.results["deep"].value == pytest.approx(5e-3, rel=1e-2)
    (finding,) = solution.findings  # of a radius of 0.1 m
    assert finding.code == "soft-contact" and "5 % of its size" in finding.text and "250000 holds it" in finding.text


def test_a_start_at_an_equilibrium_beyond_a_body_is_refused():
    under, load = ball(speed=0.0, fixed=True, mass=None), refweb.Load(node=1, force=(0.0, 0.0, -1e3))
    scene = hit(under, web=TWO, contact=dict(stiffness=100.0), effects=[load])
    with pytest.raises(refweb.SolverError, match='passes the core of body "ball" on its way'):
        refweb.run(scene.replace(solve=refweb.Dynamic(duration=0.06, start="equilibrium")))


# The stiffness that refweb chooses


def test_stiffness_left_out(tmp_path, capsys):
    """½ m v² over the allowed overlap; it stands in the box, in scene.toml and in run.json."""
    (tmp_path / "hit.toml").write_text(
        """
        [web]
        kind = "inline"
        points = [[-1, 0, 0], [1, 0, 0]]
        lines = [[0, 1]]
        supports = [0, 1]
        [cable]
        law = "tension-only"
        modulus = 7e7
        area = 1e-4
        density = 200.0
        [[body]]
        name = "ball"
        radius = 0.1
        mass = 1.0
        position = [0.0, 0.0, -0.101]
        velocity = [0.0, 0.0, 1.0]
        [contact]
        [solve]
        kind = "dynamic"
        duration = 0.06
        """
    )
    assert main(["check", str(tmp_path / "hit.toml")]) == 0
    checked = capsys.readouterr().out
    assert main(["run", str(tmp_path / "hit.toml"), "--out", str(tmp_path / "run")]) == 0
    for said in (checked, capsys.readouterr().out):
        assert 'stiffness 250000 N/m for body "ball", chosen for an overlap of 2 mm' in said
    told = json.loads((tmp_path / "run" / "run.json").read_text())["bodies"]["ball"]
    assert told["chosen"] and told["stiffness"] == 250000.0  # 2 · ½ m v²/(2 mm)²
    assert told["overlap"] == pytest.approx((1.0 / 250000.0) ** 0.5, rel=5e-3)
    kept = tomllib.loads((tmp_path / "run" / "scene.toml").read_text())["contact"]
    assert kept["bodies"]["ball"]["stiffness"] == 250000.0 and "stiffness" not in kept
    again = refweb.run(tmp_path / "run" / "scene.toml")
    assert again.bodies["ball"] == {**told, "chosen": False}


def test_stiffness_that_is_given_stays():
    """Beside one that is left out, for another body and for all."""
    other = ball(name="other", position=(0.5, 0.0, -0.3), velocity=(0.0, 0.0, 0.1))
    solution = refweb.run(hit(ball(), other, contact=dict(bodies={"other": {"stiffness": 77.0}})))
    assert [solution.bodies[name]["stiffness"] for name in ("ball", "other")] == [250000.0, 77.0]
    assert [solution.bodies[name]["chosen"] for name in ("ball", "other")] == [True, False]
    solution = refweb.run(hit(ball(), other, contact=dict(stiffness=2e4, bodies={"other": {"exponent": 1.5}})))
    assert [solution.bodies[name]["stiffness"] for name in ("ball", "other")] == [2e4, 2e4]


# A node near a fixed ball moves slowly; the mass beside it, which then pulls it down, does not.
HIDDEN = refweb.Inline(
    points=[[-1, 0, 0], [-0.3, 0, 0], [0, 0, 0], [0.3, 0, 0], [1, 0, 0]],
    lines=[[0, 1], [1, 2], [2, 3], [3, 4]],
    supports=[0, 4],
    natural_length=[0.8, 0.3, 0.3, 0.8],
)


def hidden(stiffness=None, method="central-difference"):
    effects = [refweb.PointMass(node=[1, 3], mass=5.0), refweb.Velocity(node=[1, 3], value=(0.0, 0.0, -3.0))]
    effects.append(refweb.Velocity(node=2, value=(0.0, 0.0, -1e-3)))
    under = ball(speed=0.0, fixed=True, mass=None)
    return hit(under, web=HIDDEN, contact=dict(stiffness=stiffness), effects=effects, method=method, interval=1e-3)


@pytest.mark.parametrize("method", ["central-difference", "explicit"])
def test_what_is_too_soft_is_repeated_stiffer(method, tmp_path):
    scene = hidden(method=method)
    first = scene.settled().contact.bodies["ball"].stiffness
    assert (
        refweb.run(hidden(first, method).replace(solve=refweb.Dynamic(method=method, duration=0.01))).status == "solved"
    )
    solution = refweb.run(scene, out=tmp_path / "run")
    told = solution.bodies["ball"]
    assert any("repeated with stiffness = " in text for text in solution.warnings)
    assert told["stiffness"] >= 4.0 * first and 0.0 < told["overlap"] <= told["allowed"]
    kept = tomllib.loads((tmp_path / "run" / "scene.toml").read_text())["contact"]["bodies"]["ball"]
    assert kept["stiffness"] == told["stiffness"] == solution.scene.contact.bodies["ball"].stiffness
    rows = np.loadtxt(tmp_path / "run" / "history.csv", delimiter=",", skiprows=1)
    assert len(rows) == 61  # of the last run alone


def test_a_resumed_run_has_the_stiffness_it_began_with(tmp_path):
    """And what was chosen is still refweb's to choose."""
    scene = hit()

    nets.interrupt(scene, tmp_path / "run")
    resumed, undisturbed = refweb.resume(tmp_path / "run"), refweb.run(scene)
    assert resumed.bodies == undisturbed.bodies and resumed.scene.chosen == ("ball",)
    assert np.array_equal(resumed.state.x, undisturbed.state.x)


def test_stiffness_of_statics_left_out():
    """At least that of the stiffest line, EA/L = 7 kN/m; F = 2 k δ."""
    for force in (1.0, 500.0):
        solution = refweb.run(
            pressed(force, None, steps=tuple(np.geomspace(1e-3, 1.0, 30).tolist()), modulus=7e7, gap=0.01)
        )
        told = solution.bodies["ball"]
        assert told["chosen"] and told["stiffness"] >= 7e3 and not solution.warnings
        assert 0.0 < told["overlap"] <= 0.5 * force / told["stiffness"] * (1.0 + 1e-9)


def test_twins_share_the_stiffness():
    scene = hit().settled()
    simulation = Simulation(scene, scene.build(), refweb.Solution(scene))
    twin = simulation.integrator.refined()
    assert twin.system is simulation.system
    with pytest.raises(refweb.InputError, match='stiffness is missing for body "ball"'):
        refweb.Contact().on(scene.build().net)


@pytest.mark.parametrize("stiffness", [1e3, None])
def test_what_is_moved_through_a_body_is_no_matter_of_stiffness(stiffness):
    """A line both of whose nodes move as prescribed, through a fixed ball."""
    under = ball(speed=0.0, gap=0.2, fixed=True, mass=None)
    through = refweb.Motion(node=[0, 1], displacement=[[0, 0, 0, 0], [0.06, 0, 0, -0.6]])
    scene = hit(under, contact=dict(stiffness=stiffness), effects=[through], web=replace(HELD, supports=[]))
    with pytest.raises(refweb.SolverError, match="held or moved as prescribed, and no stiffness keeps them apart"):
        refweb.run(scene)


def test_where_a_body_starts_is_no_matter_of_stiffness():
    """An overlap at the start is told, and repeats nothing; in the core it is refused before a step is taken."""
    solution = refweb.run(hit(ball(speed=0.0, gap=-0.3 * RADIUS), duration=1e-3, interval=1e-3))
    told = solution.bodies["ball"]
    assert told["overlap"] == pytest.approx(0.3 * RADIUS) and told["time"] == 0.0
    assert told["stiffness"] == solution.scene.settled().contact.bodies["ball"].stiffness
    assert not any("repeated" in text for text in solution.warnings)
    assert any("30 % of its size; there it starts" in text for text in solution.warnings)
    with pytest.raises(refweb.SolverError, match='line 0 starts in the core of a body, 0.06 m deep in body "ball"'):
        refweb.run(hit(ball(gap=-0.6 * RADIUS)))


@pytest.mark.parametrize("overlap, radius", [(1e-4, 0.01), (1e-4, 0.05), (1e-3, 0.05), (1e-3, 0.4), (1e-2, 0.05)])
def test_pushes_along_a_line_are_as_told(overlap, radius):
    """A capsule across a chain, pressed by one force at 161 places of an element: what it gains and loses on its way.

    The force is the slope of the kernels' energy over the place, by the trapezoidal rule; fits hold to a quarter.
    """
    length, places = 0.2, np.linspace(0.0, 0.2, 161)
    web = refweb.Inline(points=[[0.2 * i - 0.6, 0, 0] for i in range(7)], lines=[[i, i + 1] for i in range(6)]).web()
    own = dict(name="it", shape="capsule", radius=radius, length=5.0, axis=(0.0, 1.0, 0.0), fixed=True)
    body = refweb.Body(position=(0.0, 0.0, 0.0), **own)
    cable = refweb.Cable(law="linear", modulus=1.0, area=1e-6, density=1.0)
    system = nets.system(web, cable, [body, refweb.Contact(stiffness=1.0 / overlap)], True)
    (term,) = (one for one in system.terms if one.contact.with_lines)

    def pushed(place, height):
        x = np.zeros((system.rows, 3))
        x[: system.net.nodes] = place, 0.0, height
        return system.force_of(term, 0.0, x)[: system.net.nodes].sum(axis=0)

    slope = []
    for place in places + 0.1:
        height = brentq(lambda z, at=place: pushed(at, z)[2] - 1.0, 0.3 * radius, radius, xtol=1e-15)
        slope.append(pushed(place, height)[0])
    way = np.concatenate([[0.0], np.cumsum(0.5 * (np.array(slope[1:]) + slope[:-1]))]) * (places[1] - places[0])
    told = push_along(system.net.bodies[0], overlap, length)
    assert 0.75 < 2.0 * np.ptp(way) / length / told < 1.35


@pytest.mark.parametrize("stiffness, friction, told", [(500.0, 0.0, True), (500.0, 0.3, False), (1e7, 0.0, False)])
def test_pushes_along_lines_are_told(stiffness, friction, told):
    """Of a capsule that falls across two rails of elements far longer than it is thick, where friction is less."""
    points = [[0.2 * i, y, 0.0] for y in (-0.2, 0.2) for i in range(4)]
    lines = [[i + 4 * k, i + 4 * k + 1] for k in range(2) for i in range(3)]
    own = dict(name="bar", shape="capsule", radius=0.02, length=0.6, axis=(0.0, 1.0, 0.0), mass=0.5)
    scene = refweb.Scene(
        web=refweb.Inline(points=points, lines=lines, supports=list(range(8))),
        cable=CABLE,
        effects=[
            refweb.Body(position=(0.25, 0.0, 0.0205), velocity=(0.0, 0.0, -0.3), **own),
            refweb.Contact(stiffness=stiffness, friction=friction),
        ],
        solve=refweb.Dynamic(duration=0.05),
        output=refweb.Output(interval=0.01),
        accuracy=refweb.Accuracy(error="none"),
    )
    found = refweb.run(scene)
    assert found.bodies["bar"]["overlap"] > 0.0
    assert any("contact may push it forth and back by" in text for text in found.warnings) == told


def test_a_line_that_went_around_a_body_is_told_from_one_that_went_through():
    """Of a line that stands behind a body the straight way leads through it; a path of steps says which it was."""
    web = {"kind": "inline", "points": [[-1, -0.1, 0], [-1, 0.1, 0]], "lines": [[0, 1]], "supports": []}
    scene = refweb.Scene.from_dict(
        {
            "web": web,
            "cable": {"law": "tension-only", "modulus": 1e9, "area": 1e-6, "density": 1000.0},
            "body": [{"name": "post", "radius": 0.3, "position": [0.0, 0.0, 0.0], "fixed": True}],
            "contact": {"stiffness": 1e4},
            "solve": {"kind": "static"},
        }
    )
    system = scene.build()

    def record(*ways):
        """The line at places, the last of which is that of an equilibrium."""
        path = [np.zeros((system.rows, 3)) for _ in ways]
        for x, way in zip(path, ways, strict=True):
            x[:2] = way
        Passage(scene, system).record(State(system, 1.0, path[-1]), path[:-1])

    around = [[1.0 - np.cos(angle), 0.0, np.sin(angle)] for angle in np.linspace(0.3, np.pi, 8)]
    record(*around)
    for ways in ([around[-1]], [[0.5, 0.0, 0.0], [1.0, 0.0, 0.0], around[-1]]):
        with pytest.raises(refweb.SolverError, match='line 0 passes the core of body "post" on its way to load step 1'):
            record(*ways)
