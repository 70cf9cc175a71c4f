"""``refweb trust``: parts of errors by further runs, held against closed forms, and the budget that they keep."""

import json
from dataclasses import replace

import numpy as np
import pytest
import pyvista

import refweb
from refweb.__main__ import main
from refweb.results.error_budget import NONE, OPEN, PARTS, VERDICTS
from refweb.studies import further_runs
from validation.statics.elastic_catenary import CABLES, exact, solved

CABLE = dict(modulus=7e7, area=1e-4, density=200.0)


@pytest.mark.parametrize("name", CABLES)
def test_the_error_of_elements_holds_the_elastic_catenary(name):
    """16 straight elements of lumped weight pull less across than the cable, and ± holds by how much."""
    hung = CABLES[name]
    pull = refweb.Observe(name="pull", quantity="reaction", node=0, component="x")
    found = solved(hung, 1, 16).scene.replace(observe=[pull]).trust(progress=False).results["pull"]
    off = abs(found.value + exact(hung)[0])
    assert found.parts["chance"] == found.parts["time"] == found.parts["smoothing"] == NONE
    assert 1e-4 * abs(found.value) < off <= found.error < 8.0 * off
    assert found.verdict == "determined" and off <= 10.0**-found.digits * abs(found.value)


def test_the_error_of_smoothing_holds_the_law_without():
    scene = refweb.Scene(
        web=refweb.Window(mesh="square", rows=3, columns=3, side=0.5),
        cable=refweb.Cable(law="smooth", smoothing=1e-3, **CABLE),
        effects=[refweb.Load(node="centre", force=(0, 0, 1.0))],
    )
    sharp = refweb.run(scene.replace(cable=refweb.Cable(law="tension-only", **CABLE))).results
    for name, found in scene.trust(progress=False).results.items():
        off = abs(found.value - sharp[name].value)
        assert off > 1e-3 * abs(found.value) and off <= found.error < 8.0 * off


def test_further_runs_tell_of_the_last_load_step_alone():
    hung = solved(CABLES["level"], 1, 16).scene
    steps = hung.replace(solve=refweb.Static(load_steps=(0.5, 1.0))).trust(progress=False).steps
    assert all(found.parts["elements"] == OPEN for found in steps[0]["results"].values())
    assert all(isinstance(found.parts["elements"], float) for found in steps[1]["results"].values())


def bounced(stiffness, duration=0.1, **accuracy):
    """A ball of 1 kg that comes at 1 m/s to a line which both ends hold, and leaves it: nothing else moves."""
    ball = refweb.Body(name="ball", radius=0.1, mass=1.0, position=(0.0, 0.0, -0.12), velocity=(0.0, 0.0, 1.0))
    return refweb.Scene(
        web=refweb.Inline(points=[[-0.5, 0, 0], [0.5, 0, 0]], lines=[[0, 1]], supports=[0, 1]),
        cable=refweb.Cable(law="tension-only", **CABLE),
        effects=[ball, refweb.Contact(stiffness=stiffness)],
        observe=[refweb.Observe(name="place", quantity="position", body="ball", component="z")],
        solve=refweb.Dynamic(duration=duration, safety=0.1),
        accuracy=refweb.Accuracy(**accuracy),
    )


def test_the_error_of_stiffness_holds_the_rigid_bounce(monkeypatch):
    """A rigid line throws the ball back at once: it ends at −0.1 − (T − 0.02 s) · 1 m/s. Elements stay as they are."""
    variants = further_runs.variants
    held = lambda *given: (v for v in variants(*given) if v.part != "elements")  # noqa: E731
    monkeypatch.setattr(further_runs, "variants", held)
    found = bounced(1e4).trust(progress=False).results["place"]
    off = abs(found.value + 0.1 + 0.08)
    assert off == pytest.approx(np.pi / 100.0, rel=0.2)  # v π √(m/k), a half swing on the spring
    assert off <= found.parts["contact_stiffness"] < 8.0 * off
    assert found.parts["elements"] == OPEN


def test_a_start_on_the_edge_is_statistical():
    """A mass at rest between two lines that are pressed leaves to either side: its rest is no result."""
    rate = np.sqrt(2.0 * 7e3 * 1e-3)
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2]),
        cable=refweb.Cable(law="linear", modulus=7e7, area=1e-4, density=0.0, prestrain=-1e-3),
        effects=[refweb.PointMass(node=1, mass=1.0)],
        support=[refweb.Supports(nodes=1, components=["x", "z"])],
        observe=[refweb.Observe(name="place", quantity="displacement", node=1, component="y")],
        solve=refweb.Dynamic(duration=45.0 / rate),
        output=refweb.Output(interval=0.1),
    )
    found = scene.trust(progress=False)
    spread = found.horizon["ensemble"]["place"]
    assert found.results["place"].verdict == "statistical" and "runs from starts" in found.results["place"].verdict_text
    assert found.results["place"].error >= 2.0 * spread["deviation"] > 0.0


@pytest.mark.slow
def test_first_touch_has_no_limit_by_what_finer_elements_and_stiffer_contact_do():
    scene = refweb.Scene.load("triangle-impact", {"solve.duration": 0.05})
    peak = refweb.Observe(name="peak", quantity="reaction", body="ball", reduce="max")
    results = scene.replace(observe=[*scene.observables, peak]).trust(progress=False).results
    assert results["peak"].verdict == "no limit"
    assert not any(found.verdict == "no limit" for name, found in results.items() if name != "peak")


def test_runs_that_cost_too_much_are_left_out():
    """The first run goes to its end; of the rest nothing is left, and no part is made up."""
    found = bounced(1e4).trust(budget=1e-6, progress=False)
    assert {run["status"] for run in found.further} == {"left out"}
    place = found.results["place"]
    assert place.verdict is None and place.parts["elements"] == place.parts["contact_stiffness"] == OPEN
    assert isinstance(place.parts["time"], float) and place.error == place.parts["time"]


def test_a_run_on_its_way_beyond_the_budget_is_ended(monkeypatch):
    """Its price is taken to be nothing; what it takes is more than what is left, and the budget is kept."""
    variants = further_runs.variants
    cheap = lambda *given: (v._replace(price=0.0) for v in variants(*given) if v.part == "elements")  # noqa: E731
    monkeypatch.setattr(further_runs, "variants", cheap)
    scene = refweb.Scene.load("square-impact", {"solve.duration": 0.05})
    refweb.run(scene)  # kernels are compiled
    alone = refweb.run(scene).cost["cpu_s"]
    found = scene.trust(budget=2.0 * alone, progress=False)
    assert "ended" in {run["status"] for run in found.further}
    assert all(result.parts["elements"] == OPEN for result in found.results.values()) or len(found.further) == 2


def test_the_command_writes_what_it_prints(tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["trust", "square-load", "--budget", "60", "--out", str(out)]) == 0
    printed, read = capsys.readouterr().out, json.loads((out / "trust.json").read_text(encoding="utf-8"))
    run = json.loads((out / "run.json").read_text(encoding="utf-8"))
    for name, entry in read["results"].items():
        assert name in printed and entry["verdict"] in VERDICTS and list(entry["parts"]) == list(PARTS)
        for key in ("value", "error", "parts", "verdict", "verdict_text", "digits"):
            assert run["results"][name][key] == entry[key]
        numbers = [part for part in entry["parts"].values() if not isinstance(part, str)]
        assert entry["error"] == pytest.approx(sum(numbers), rel=1e-12)
    assert read["budget"]["given"] == 60.0 and read["budget"]["spent"] > 0.0
    picture = pyvista.read(out / "trust.png")
    assert np.ptp(np.asarray(picture.active_scalars)) > 200


def test_a_statistical_result_beside_a_strength_is_written(tmp_path, monkeypatch):
    """The utilisation has an ensemble as results have one, and ``trust.json`` holds texts as names."""
    monkeypatch.setattr(further_runs.FurtherRuns, "_chaotic", lambda self, observable: True)
    scene = bounced(1e4, duration=0.02, level="full")
    scene = scene.replace(cable=replace(scene.cable, strength=1e9), solve=replace(scene.solve, safety=0.5))
    scene.trust(out=tmp_path / "out", progress=False)
    horizon = json.loads((tmp_path / "out" / "trust.json").read_text(encoding="utf-8"))["horizon"]
    assert list(horizon["ensemble"]) == ["place"] and horizon["utilisation"]["deviation"] >= 0.0


def test_a_scene_asks_for_it_itself():
    level = replace(bounced(1e4).accuracy, level="full", budget=30.0)
    asked = refweb.run(bounced(1e4).replace(accuracy=level))
    assert asked.further and OPEN not in asked.results["place"].parts.values()


@pytest.mark.parametrize(
    "given, message",
    [
        (["--budget", "0"], "budget = 0.0 must be > 0"),
        (["--budget", "nan"], "budget = nan must be a finite number"),
        (["--set", 'accuracy.level="ful"'], "did you mean"),
    ],
)
def test_refusals(given, message, capsys):
    assert main(["trust", "square-load", *given]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1


def upright(speed, **changes):
    """A mass on a bar that stands on a support, in gravity: the least push lays it down."""
    return refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [0, 0, 1]], lines=[[0, 1]], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=1e9, area=1e-6, density=1.0),
        effects=[
            refweb.PointMass(node=1, mass=0.1),
            refweb.Gravity(acceleration=(0, 0, -9.81)),
            refweb.Velocity(node=1, value=(0.0, 0.0, speed)),
        ],
        observe=[refweb.Observe(name="lowest", quantity="position", node=1, component="z", reduce="min")],
        solve=refweb.Dynamic(duration=15.0),
        output=refweb.Output(interval=0.05),
        **changes,
    )


@pytest.mark.slow
def test_a_peak_before_the_horizon_may_be_exceeded_behind_it():
    """It stands for 15 s where nothing pushes it, and swings through its lowest place where anything does."""
    found = upright(0.05).trust(progress=False).results["lowest"]
    assert found.value > 0.9 and found.parts["chance"] > 1.9 and found.error > 1.9
    assert found.verdict in ("statistical", "depends on the model")  # a bar in two elements is a chain, and falls too


@pytest.mark.slow
def test_a_branch_that_is_kept_by_symmetry_alone_has_an_error_of_chance():
    """A bola whose lines are reeled in with a jump: its light hub buckles between them, but from exact symmetry.

    A narrow ± in time holds the symmetric motion; a hub that is 1e-12 m off comes to other values within the run.
    """
    spun = refweb.Velocity(node="all", spin=(0.0, 0.0, 3.0))
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [-1, 0, 0]], lines=[[0, 1], [0, 2]], supports=[]),
        cable=refweb.Cable(law="linear", modulus=1e9, area=1e-6, density=10.0),
        effects=[
            refweb.PointMass(node=[1, 2], mass=0.5),
            spun,
            refweb.Reel(lines="all", factor=[(0.2, 1.0), (1.2, 0.7)]),
            refweb.Rupture(at=[(1, 1.5)]),
            refweb.Drag(density=1.2, diameter=0.05),
        ],
        observe=[refweb.Observe(name="peak", quantity="tension", line=0, reduce="max")],
        solve=refweb.Dynamic(duration=2.0),
    )
    found = scene.trust(progress=False).results["peak"]
    beside = refweb.Inline(points=[[0, 1e-12, 0], [1, 0, 0], [-1, 0, 0]], lines=[[0, 1], [0, 2]], supports=[])
    straight, bent = (refweb.run(s).results["peak"] for s in (scene, scene.replace(web=beside)))
    apart = abs(straight.value - bent.value)
    assert apart > 100.0 * straight.error and found.parts["chance"] > 0.5 * apart and found.error > apart


def test_chance_holds_branches_that_are_left_by_any_small_difference():
    """A massive end pushes a light hub, exactly in line. The place of the end depends on when the hub leaves the line.

    That is a matter of the logarithm of its difference: runs that are 1e-6 m off alone lie within 0.06 mm.
    """

    def pushed(off):
        return refweb.Scene(
            web=refweb.Inline(points=[[0, 0, 0], [1, off, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0]),
            cable=refweb.Cable(law="linear", modulus=1e9, area=1e-6, density=10.0),
            effects=[refweb.PointMass(node=2, mass=0.5), refweb.Velocity(node=2, value=(-0.05, 0.0, 0.0))],
            observe=[refweb.Observe(name="end", quantity="position", node=2, component="x", reduce="final")],
            solve=refweb.Dynamic(duration=0.3),
        )

    found = pushed(0.0).trust(progress=False).results["end"]
    ends = [refweb.run(pushed(off), progress=False).results["end"].value for off in (1e-12, 1e-9, 1e-6)]
    assert max(ends) - min(ends) > 1e-3 and np.abs(np.array(ends) - found.value).max() < found.error
    assert found.parts["chance"] > found.value - min(ends)


def test_steps_that_are_too_long_are_no_chance():
    """A double pendulum is wide by its time steps; digits that are asked for are found."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0.5]], lines=[[0, 1], [1, 2]], supports=[0]),
        cable=refweb.Cable(law="linear", modulus=1e9, area=1e-6, density=0.0),
        effects=[refweb.PointMass(node=[1, 2], mass=0.1), refweb.Gravity(acceleration=(0, 0, -9.81))],
        observe=[refweb.Observe(name="x", quantity="position", node=2, component="x")],
        solve=refweb.Dynamic(duration=15.0),
        output=refweb.Output(interval=0.05),
    )
    found = scene.trust(progress=False).results["x"]
    assert found.verdict == "wide" and "digits = 1" in found.verdict_text
    digits = refweb.run(scene.replace(accuracy=refweb.Accuracy(digits=1))).results["x"]
    assert digits.error <= 0.05 * abs(digits.value) and abs(found.value - digits.value) <= found.error


def test_friction_that_creeps_is_off_by_its_slip_velocity():
    """Two masses stay on a plate whose friction is above the pull along it; that friction is smooth lets them creep."""
    plate = refweb.Body(name="plate", shape="box", size=(4, 4, 0.2), position=(0, 0, -0.11), fixed=True)
    scene = refweb.Scene(
        web=refweb.Inline(points=[[-0.2, 0, 0], [0.2, 0, 0]], lines=[[0, 1]], supports=[]),
        cable=refweb.Cable(law="linear", modulus=1e9, area=1e-6, density=0.0),
        effects=[
            refweb.PointMass(node=[0, 1], mass=0.1),
            refweb.Gravity(acceleration=(0.0, 2.0, -9.81)),
            plate,
            refweb.Contact(stiffness=2e3, friction=0.5, damping=20.0),
        ],
        observe=[refweb.Observe(name="slip", quantity="displacement", node=0, component="y")],
        solve=refweb.Dynamic(duration=2.0),
        output=refweb.Output(interval=0.02),
    )
    found = scene.trust(progress=False).results["slip"]
    assert found.value > 1e-3 and found.parts["smoothing"] >= found.value and found.verdict == "depends on the model"


def test_chance_of_a_motion_whose_growth_ends_early():
    """A mass on an upright bar for 5 s: a difference of 1e-12 grows by 1e6 alone, one of 1e-6 lays it down."""
    scene = upright(0.0).replace(solve=refweb.Dynamic(duration=5.0))
    lowest = scene.trust(progress=False).results["lowest"]
    beside = refweb.Inline(points=[[0, 0, 0], [1e-6, 0, 1]], lines=[[0, 1]], supports=[0])
    fallen = refweb.run(scene.replace(web=beside), progress=False).results["lowest"].value
    assert fallen < -0.5 and lowest.value > 0.9
    assert lowest.parts["chance"] > 1.0 and lowest.verdict in ("statistical", "depends on the model")
