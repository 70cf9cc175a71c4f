"""Events: their times against closed forms, what they end, what they leave in results, and what is refused.

Central differences note an event at the end of the step that it happens in; CVODE and IDA find it on their own
interpolation, as exactly as that is. Either says by ± how far off that may be.
"""

import dataclasses
import json

import meshio
import numpy as np
import pytest
from nets import some
from scipy.optimize import brentq

import refweb
from refweb.dynamics.twin_error import _add_lateness
from refweb.results.summary_text import on_run

MODULUS, AREA = 7e7, 1e-4
EA = MODULUS * AREA
EXPLICIT = dict(method="central-difference", safety=0.05)
BDF, ADAMS = (dict(method="cvode", family=family, rtol=1e-8) for family in ("bdf", "adams"))
IDA = dict(method="ida", rtol=1e-8)
METHODS = [EXPLICIT, BDF, ADAMS, IDA]
NAMES = ["central-difference", "bdf", "adams", "ida"]
SOME = some(METHODS, 3)
"""Explicit steps and IDA in the ordinary run."""
ROUGH = [EXPLICIT, {**BDF, "rtol": 1e-6}, ADAMS, {**IDA, "rtol": 1e-6}]
"""Those of order 2 are off by a hundred to the power 2/3 times as much, some 22 times, in a fifth of the steps."""


def cable(law="tension-only", density=0.0, **changes):
    return refweb.Cable(law=law, modulus=MODULUS, area=AREA, density=density, **changes)


def scene(event, solve, duration, observe=(), interval=None, error="twin", frames=10, **fields):
    solve = refweb.Dynamic(duration=duration, **solve)
    output = refweb.Output(interval=interval or duration / 20.0, frames=frames)
    given = dict(solve=solve, output=output, accuracy=refweb.Accuracy(error=error), observe=observe, event=event)
    return refweb.Scene(**given, **fields)


def times(solution):
    return {event["name"]: event["time"] for event in solution.events}


def agrees(solution, name, exact, within):
    """The event is ``within`` of the exact time; central differences are a step late at most, and ± covers them."""
    (event,) = (event for event in solution.events if event["name"] == name)
    off = event["time"] - exact
    if solution.scene.solve.method == "central-difference":
        # Of the steps of order 2 themselves some ten thousandths of a period are left.
        assert -0.1 * event["error"] <= off <= event["error"], (off, event["error"])
    else:
        assert abs(off) <= within, (off, within)
    return event


# Contact


def ball(**changes):
    given = dict(name="ball", radius=0.1, mass=1.0, position=(0.01, 0.02, -0.13), velocity=(0.0, 0.0, 1.0))
    return refweb.Body(**{**given, **changes})


@pytest.mark.ordinary("central-difference", "adams")
@pytest.mark.parametrize("solve", METHODS, ids=NAMES)
def test_first_touch_of_a_flying_ball(solve):
    """It meets the line x = 0 at the height √(R² − 0.01²), and the whole web not before."""
    hit = scene(
        [refweb.Event(name="touch", kind="contact"), refweb.Event(name="same", kind="contact", body="ball")],
        solve,
        duration=0.032,
        web=refweb.Window(mesh="square", rows=2, columns=2, side=0.2),
        cable=cable(density=200.0),
        effects=[ball(), refweb.Contact(stiffness=1e5)],
    )
    solution = refweb.run(hit)
    event = agrees(solution, "touch", 0.13 - np.sqrt(0.1**2 - 0.01**2), within=1e-9)
    assert times(solution)["same"] == event["time"] and solution.history["time"][-1] == 0.032


def held_line(**changes):
    """One line along y that cannot move."""
    web = refweb.Inline(points=[[0, -1, 0], [0, 1, 0]], lines=[[0, 1]], supports=[0, 1])
    return dict(web=web, cable=cable(density=200.0), **changes)


@pytest.mark.ordinary("central-difference", "adams")
@pytest.mark.parametrize("solve", METHODS, ids=NAMES)
def test_first_touch_of_falling_balls(solve):
    """√(2 h/g) each, and of any body the earlier; one that flies past touches nothing."""
    balls = [
        ball(name="low", position=(0.0, -0.5, 0.1 + 0.05), velocity=(0, 0, 0)),
        ball(name="high", position=(0.0, 0.5, 0.1 + 0.3), velocity=(0, 0, 0)),
        ball(name="past", position=(0.2, 0.0, 0.3), velocity=(0, 0, 0)),
    ]
    gravity = refweb.Gravity(acceleration=(0.0, 0.0, -9.81))
    names = [None, "low", "high", "past"]
    events = [refweb.Event(name=str(name), kind="contact", body=name) for name in names]
    fields = held_line(effects=[*balls, refweb.Contact(stiffness=1e4), gravity])
    solution = refweb.run(scene(events, solve, duration=0.3, **fields))
    low, high = (np.sqrt(2.0 * height / 9.81) for height in (0.05, 0.3))
    for name, exact in (("None", low), ("low", low), ("high", high)):
        agrees(solution, name, exact, within=1e-9)
    assert times(solution)["past"] is None


@pytest.mark.parametrize("solve", METHODS, ids=NAMES)
def test_a_contact_that_is_there_at_the_start(solve):
    """A body inside of the web touches it at t = 0; a run that ends there has that row and no other."""
    deep = ball(position=(0.0, 0.0, 0.0999), velocity=(0.0, 0.0, 1.0))
    for stop in (False, True):
        event = [refweb.Event(name="touch", kind="contact", stop=stop)]
        solution = refweb.run(scene(event, solve, 0.01, **held_line(effects=[deep, refweb.Contact(stiffness=1e4)])))
        assert solution.events == [{"name": "touch", "time": 0.0, "error": 0.0}]
        assert solution.history["time"][-1] == solution.state.time == (0.0 if stop else 0.01)


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("solve", SOME, ids=NAMES)
def test_first_touch_in_a_turning_frame(solve):
    """A ball falls on a line along x that turns about z: seen from outside it flies straight on.

    What the frame adds to its forces is not contact: before the touch that is zero, afterwards not.
    """
    speed, height = 10.0, 0.1 + 0.03
    web = refweb.Inline(points=[[0.2, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0, 1])
    falling = ball(position=(0.5, 0.0, height), velocity=(0.0, 0.0, -1.0))
    fields = dict(web=web, cable=cable(density=200.0), effects=[falling, refweb.Contact(stiffness=1e4)])
    fields["effects"].append(refweb.Frame(angular_velocity=(0.0, 0.0, speed)))
    force = refweb.Observe(name="force", quantity="reaction", body="ball", reduce="final")

    def gap(t):
        outside = np.array([0.5, 0.5 * speed * t])
        aside = np.cos(speed * t) * outside[1] - np.sin(speed * t) * outside[0]
        return np.hypot(aside, height - t) - 0.1

    touch = brentq(gap, 0.01, 0.05)
    assert touch > height - 0.1 + 1e-5  # it has moved aside
    solution = refweb.run(scene([refweb.Event(name="touch", kind="contact")], solve, 0.05, [force], **fields))
    agrees(solution, "touch", touch, within=1e-8)
    history = solution.history
    before = history["time"] <= touch
    assert np.abs(history["force"][before]).max() < 1e-12 and (history["force"][~before] > 0.1).all()
    body = solution.state.system.net.bodies[0].row
    np.testing.assert_allclose(history["force"][-1], np.linalg.norm(solution.state.reaction[body]), rtol=1e-9)


# A line that snaps taut


@pytest.mark.ordinary("tension-only-central-difference", "smooth-central-difference", "smooth-adams")
@pytest.mark.parametrize("solve", METHODS, ids=NAMES)
@pytest.mark.parametrize("law", ["tension-only", "smooth"])
def test_masses_that_fly_apart(solve, law):
    """At 2 m/s they take up the 0.2 m of slack in 0.1 s, and ε0 times the length of it later."""
    slackness = 1e-3 if law == "smooth" else 0.0
    smooth = dict(slackness=slackness, smoothing=1e-9) if law == "smooth" else {}
    apart = scene(
        [refweb.Event(name="taut", kind="taut", line=0)],
        solve,
        duration=0.15,
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], natural_length=1.2),
        cable=cable(law, **smooth),
        effects=[
            refweb.PointMass(node=0, mass=2.0),
            refweb.PointMass(node=1, mass=3.0),
            refweb.Velocity(node=0, value=(-0.7, 0.0, 0.0)),
            refweb.Velocity(node=1, value=(1.3, 0.0, 0.0)),
        ],
        supports=refweb.Supports(nodes=[]),
    )
    # The smooth law's floor, α ≈ η²/ε0, pushes by 1e-15 of EA and more only near ε0.
    agrees(refweb.run(apart), "taut", (1.2 * (1.0 + slackness) - 1.0) / 2.0, within=1e-9)


@pytest.mark.ordinary("central-difference", "bdf")
@pytest.mark.parametrize("solve", METHODS, ids=NAMES)
def test_a_thread_that_becomes_taut(solve):
    """A mass on a slack thread of 1.4 m between supports 1 m apart, at 2 m/s across: after (0.7² − 0.5²)^½/2 s."""
    thread = refweb.Thread(
        name="sling", nodes=[0, 1, 2], length=1.4, law="tension-only", modulus=1e6, area=1e-4, density=0.0
    )
    flies = scene(
        [refweb.Event(name="taut", kind="taut", thread="sling")],
        solve,
        duration=0.3,
        web=refweb.Inline(
            points=[[-0.5, 0, 0], [0, 0, 0], [0.5, 0, 0], [0.5, 1, 0]], lines=[[2, 3]], supports=[0, 2, 3]
        ),
        cable=cable(),
        effects=[thread, refweb.PointMass(node=1, mass=2.0), refweb.Velocity(node=1, value=(0.0, 0.0, 2.0))],
    )
    agrees(refweb.run(flies), "taut", np.sqrt(0.7**2 - 0.5**2) / 2.0, within=1e-9)


def test_a_thread_of_an_event_is_one_of_the_scene():
    web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2])
    event = refweb.Event(name="taut", kind="taut", thread="rope")
    slack = scene([event], EXPLICIT, duration=0.1, web=web, cable=cable(density=1000.0))
    with pytest.raises(refweb.InputError, match='thread = "rope" is not a thread, the scene has no'):
        refweb.run(slack)
    with pytest.raises(refweb.InputError, match='line = 0 has no meaning for kind = "taut"'):
        refweb.Event(name="taut", kind="taut", line=0, thread="rope")


@pytest.mark.parametrize("solve", METHODS, ids=NAMES)
def test_a_string_that_is_pulled_taut(solve):
    """By a support at 2 m/s, with a mass beyond it on a line that is slack all the time: nothing else can happen."""
    pulled = scene(
        [refweb.Event(name="first", kind="taut", line=0), refweb.Event(name="second", kind="taut", line=1)],
        solve,
        duration=0.03,
        web=refweb.Inline(
            points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], natural_length=[1.05, 9.0], supports=[0]
        ),
        cable=cable(),
        effects=[
            refweb.Motion(node=1, displacement=[(0.0, 0.0, 0.0, 0.0), (1.0, 2.0, 0.0, 0.0)]),
            refweb.PointMass(node=2, mass=1.0),
            refweb.Velocity(node=2, value=(0.0, 3.0, 0.0)),  # its energy makes the kink's small in central differences
        ],
    )
    solution = refweb.run(pulled)
    agrees(solution, "first", 0.025, within=1e-15)
    assert times(solution)["second"] is None
    (_, missing) = solution.events
    assert missing == {"name": "second", "time": None, "error": None}


# Observables that pass a value


def oscillator(event, solve, observe, duration, **fields):
    """1 kg on a line of 1 m that pulls and pushes: x = a sin ωt with ω = √(EA/m) and a ω = 1 m/s."""
    return scene(
        event,
        solve,
        duration,
        observe,
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], supports=[0]),
        cable=cable("linear"),
        effects=[refweb.PointMass(node=1, mass=1.0), refweb.Velocity(node=1, value=(1.0, 0.0, 0.0))],
        support=[refweb.Supports(nodes=1, components=["y", "z"])],
        **fields,
    )


RATE = np.sqrt(EA)
PHASE = 2e-5  # BDF of order 2 leaves some rtol^(2/3) = 5e-6 a period, Adams less
STEP = 0.05 * 2.0  # of central differences at this safety, as a phase
PLACE = refweb.Observe(name="x", quantity="displacement", node=1, component="x")


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("solve", SOME, ids=NAMES)
def test_an_oscillator_passes_values(solve):
    """Upwards through ½a at asin(½)/ω, downwards through −½a at (π + asin(½))/ω; never through 2a; energies as well."""
    rest, speed, stress = (
        refweb.Observe(name="kinetic", quantity="kinetic_energy"),
        refweb.Observe(name="v", quantity="velocity", node=1, component="x", reduce="max"),
        refweb.Observe(name="stress", quantity="stress", reduce="max"),
    )
    a = 1.0 / RATE
    asked = {
        "up": ("x", 0.5 * a, np.arcsin(0.5)),
        "down": ("x", -0.5 * a, np.pi + np.arcsin(0.5)),
        "never": ("x", 2.0 * a, None),
        "half": ("kinetic", 0.25, np.pi / 4.0),
        "slow": ("v", 0.0, np.pi / 2.0),
        "stretched": ("stress", 0.8 * MODULUS * a, np.arcsin(0.8)),
    }
    events = [refweb.Event(name=k, kind="threshold", observe=o, value=value) for k, (o, value, _) in asked.items()]
    solution = refweb.run(oscillator(events, solve, [PLACE, rest, speed, stress], 4.5 / RATE))
    for name, (_, _, phase) in asked.items():
        if phase is None:
            assert times(solution)[name] is None
        else:
            agrees(solution, name, phase / RATE, within=PHASE / RATE)
    assert [event["name"] for event in solution.events] == list(asked)


@pytest.mark.slow
def test_time_of_an_event_converges_with_the_tolerance():
    """As the motion itself does: by the power 2/3 with steps of order 2."""
    off, tolerances = [], (1e-4, 1e-5, 1e-6, 1e-7)
    events = [refweb.Event(name="up", kind="threshold", observe="x", value=0.5 / RATE)]
    for rtol in tolerances:
        solution = refweb.run(oscillator(events, {**BDF, "rtol": rtol}, [PLACE], 10.0 / RATE))
        (event,) = solution.events
        off.append(abs(event["time"] - np.arcsin(0.5) / RATE))
        assert off[-1] <= event["error"]
    assert 0.5 < np.polyfit(np.log(tolerances), np.log(off), 1)[0] < 0.85


@pytest.mark.parametrize("solve", METHODS, ids=NAMES)
@pytest.mark.parametrize("mover", ["load", "motion"])
def test_work_passes_a_value(solve, mover):
    """A constant force F has done F²t²/2m; a support that stretches a line at the speed v, ½ EA (vt)²/L."""
    work = refweb.Observe(name="all_work", quantity="work", reduce="max")
    events = [refweb.Event(name="done", kind="threshold", observe="all_work", value=0.4)]
    if mover == "load":
        effects, exact = [refweb.Load(node=1, force=(3.0, 0.0, 4.0))], np.sqrt(0.8) / 5.0
        web = refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], natural_length=100.0, supports=[0])
    else:
        web = refweb.Inline(
            points=[[0, 0, 0], [1, 0, 0], [1, 1, 0]], lines=[[0, 1], [1, 2]], natural_length=[1.0, 9.0], supports=[0]
        )
        effects = [refweb.Motion(node=1, displacement=[(0.0, 0.0, 0.0, 0.0), (1.0, 0.1, 0.0, 0.0)])]
        exact = np.sqrt(0.8 / EA) / 0.1
    masses = [refweb.PointMass(node=len(web.points) - 1, mass=1.0)]
    fields = dict(web=web, cable=cable(), effects=[*masses, *effects])
    solution = refweb.run(scene(events, solve, 0.3, [work], **fields))
    agrees(solution, "done", exact, within=1e-9)


# The end of a run


STOPPED = [refweb.Event(name="down", kind="threshold", observe="x", value=-0.5 / RATE, stop=True)]
DOWN = (np.pi + np.arcsin(0.5)) / RATE


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("solve", ROUGH, ids=NAMES)
def test_a_run_stops_at_its_event(solve, tmp_path):
    """Last row, last frame, checkpoint and results are those of its time; what would have come later has not."""
    before = refweb.Event(name="up", kind="threshold", observe="x", value=0.5 / RATE)
    after = refweb.Event(name="back", kind="threshold", observe="y", value=-0.9 / RATE)
    again = refweb.Observe(name="y", quantity="displacement", node=1, component="x", reduce="min")
    stopped = oscillator([after, *STOPPED, before], solve, [PLACE, again], 8.0 / RATE, interval=0.3 / RATE, frames=4)
    kept, written = refweb.run(stopped), refweb.run(stopped, out=tmp_path / "out")
    event = agrees(kept, "down", DOWN, within=30.0 * PHASE / RATE)
    agrees(kept, "up", np.arcsin(0.5) / RATE, within=30.0 * PHASE / RATE)
    assert times(kept)["back"] is None and kept.events == written.events and kept.status == "solved"
    end = event["time"]
    for history in (kept.history, written.history):
        assert history["time"][-1] == end and (np.diff(history["time"]) > 0.0).all()
        np.testing.assert_allclose(history["time"][:-1], 0.3 / RATE * np.arange(len(history["time"]) - 1), rtol=1e-12)
        assert history["time"][-2] < DOWN <= history["time"][-2] + 0.3 / RATE
    assert kept.frames[-1][1].time == kept.state.time == end
    assert [number for number, _ in kept.frames] == [0, 4, 8, 12, len(kept.history["time"]) - 1]
    np.testing.assert_array_equal(kept.frames[-1][1].x, written.state.x)
    summary = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert summary["events"] == kept.events and summary["results"]["x"]["time"] == end
    assert np.load(tmp_path / "out" / "checkpoint.npz")["time"] == end
    frame = meshio.read(tmp_path / "out" / "frames" / f"web_{len(kept.history['time']) - 1:06d}.vtu")
    np.testing.assert_array_equal(frame.point_data["displacement"][1], kept.state.x[1])
    below = kept.results["x"].value * RATE
    assert -0.5 - STEP < below <= -0.5 + PHASE
    assert abs(below + 0.5) <= kept.results["x"].error * RATE  # ± of the time is in that of what has its value there
    assert kept.results["y"].value == kept.results["x"].value
    told = [text for name, text in on_run(summary) if name in ("events", "")]
    assert (
        len(told) == 3 and told[0] == "back did not happen" and told[1].startswith(f"down at t = {1e3 * end:.3g}"[:-1])
    )


def test_an_event_that_ends_one_of_two_runs():
    """A value between the peaks of a run and its twin: one of them passes it, and no difference says anything."""
    largest = refweb.Observe(name="x", quantity="displacement", node=1, component="x", reduce="max")
    period, peaks = 2.0 * np.pi / RATE, []
    for steps in (40, 60):  # 4 in each of ten rows, and ⌈√2 · 4⌉
        solve = dict(method="central-difference", step_size=period / steps * (1.0 + 1e-12))
        run = refweb.run(oscillator((), solve, [largest], period, interval=period / 10, error="none"))
        assert run.solver["nsteps"] == steps
        peaks.append(run.results["x"].value)
    assert abs(peaks[1] - peaks[0]) > 1e-6 * peaks[0]
    event = [refweb.Event(name="far", kind="threshold", observe="x", value=np.mean(peaks), stop=True)]
    solve = dict(method="central-difference", step_size=period / 40 * (1.0 + 1e-12))
    solution = refweb.run(
        oscillator(event, solve, [largest, dataclasses.replace(PLACE, name="last")], period, interval=period / 10)
    )
    assert [result.error for result in solution.results.values()] == [None, None]
    (warning,) = solution.warnings
    which = ["the run", "its step refinement, a second run with other steps"]
    one, other = which if solution.events[0]["time"] is not None else which[::-1]
    assert warning == f"no errors are known: an event ends {one}, but not {other}"


@pytest.mark.parametrize("solve", METHODS, ids=NAMES)
@pytest.mark.parametrize("interval", [0.05, 1e-3])
def test_a_value_that_is_passed_and_passed_back_within_a_step_is_told(solve, interval):
    """A mass flies by on a slack line, at 3 mm: nearer than 20 mm from t = (1 − √(0.02² − 0.003²))/3 on, for 13 ms."""
    near = refweb.Event(name="near", kind="threshold", observe="d", value=0.02)
    flying = scene(
        [near], solve, 0.5, [refweb.Observe(name="d", quantity="distance", node=[0, 1], reduce="min")], interval,
        web=refweb.Inline(points=[[0, 0, 0], [1, 0.003, 0]], lines=[[0, 1]], natural_length=10.0),
        cable=cable(density=1000.0),
        supports=refweb.Supports(nodes=[0]),
        effects=[refweb.Velocity(node=1, value=(-3.0, 0.0, 0.0))],
    )  # fmt: skip
    solution = refweb.run(flying)
    (event,) = solution.events
    told = any('event "near" is not seen' in text for text in solution.warnings)
    assert solution.results["d"].value == pytest.approx(0.003, abs=1e-5)
    assert told == (event["time"] is None)
    if not told:
        agrees(solution, "near", (1.0 - np.sqrt(0.02**2 - 0.003**2)) / 3.0, 1e-6)
    if interval == 1e-3:
        assert not told


@pytest.mark.parametrize("solve", METHODS, ids=NAMES)
def test_an_event_at_the_end_of_a_row(solve):
    """Masses that tauten their line at 0.1 s, a row of the history: one row there, or one and the last right behind."""
    fields = dict(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0]], lines=[[0, 1]], natural_length=1.2),
        cable=cable(),
        effects=[refweb.PointMass(node="all", mass=2.0), refweb.Velocity(node=1, value=(2.0, 0.0, 0.0))],
        supports=refweb.Supports(nodes=[]),
    )
    event = [refweb.Event(name="taut", kind="taut", line=0, stop=True)]
    solution = refweb.run(scene(event, solve, 0.15, interval=0.02, **fields))
    end = agrees(solution, "taut", 0.1, within=1e-9)["time"]
    rows = solution.history["time"]
    assert rows[-1] == end and (np.diff(rows) > 0.0).all() and len(rows) in (6, 7)
    assert solution.state.time == solution.frames[-1][1].time == end


@pytest.mark.slow
def test_the_first_of_two_that_stop():
    """In whichever order they are asked for; the other has not happened, though it would have within the same step."""
    both = [
        refweb.Event(name=name, kind="threshold", observe="x", value=value / RATE, stop=True)
        for name, value in (("second", 0.5001), ("first", 0.5))
    ]
    for events in (both, both[::-1]):
        for solve in (BDF, ADAMS, {**ADAMS, "rtol": 1e-3}):
            found = times(refweb.run(oscillator(events, solve, [PLACE], 8.0 / RATE)))
            assert found["second"] is None and abs(found["first"] - np.arcsin(0.5) / RATE) < 1e-2 / RATE


@pytest.mark.ordinary("central-difference", "bdf", "adams")
@pytest.mark.parametrize("solve", ROUGH, ids=NAMES)
def test_errors_come_from_the_twin(solve):
    """Without one there are none; with one the time of the run itself is the same."""
    events = [refweb.Event(name="up", kind="threshold", observe="x", value=0.5 / RATE), *STOPPED]
    twin, alone = (
        refweb.run(oscillator(events, solve, [PLACE], 8.0 / RATE, error=error)).events for error in ("twin", "none")
    )
    assert [event["time"] for event in twin] == [event["time"] for event in alone]
    assert [event["error"] for event in alone] == [None, None]
    # Three times twice what two runs differ by, at most a step, and a step.
    assert all(0.0 < event["error"] < 7.0 * STEP / RATE for event in twin)


def test_what_the_time_of_the_end_is_off_by_moves_results_at_the_end():
    """Rows before and at the event, 0.02 s apart, and an event known to 3 ms: 3/20 of what changes between them."""
    result = refweb.run(oscillator(STOPPED, EXPLICIT, [PLACE], 8.0 / RATE)).results["x"]._replace(time=1.0, error=0.5)
    early = result._replace(time=0.5)
    results = {"x": result, "peak": early, "y": result}
    rows = np.array([[0.98, 2.0, 5.0, -1.0], [1.0, 6.0, 9.0, -2.0]])
    _add_lateness(results, [{"time": 1.0, "error": 3e-3}], rows)
    found = {name: one.error for name, one in results.items()}
    np.testing.assert_allclose([found["x"], found["peak"], found["y"]], [0.5 + 0.6, 0.5, 0.5 + 0.15], rtol=1e-12)


# What is refused


ITEMS = dict(
    body=[{"name": "ball", "radius": 0.1, "mass": 1.0, "position": [0, 0, -0.2]}],
    contact={"stiffness": 1e5},
    observe=[{"name": "deflection", "quantity": "displacement", "reduce": "max"}],
)
REFUSED = {
    "body": ({"kind": "contact", "body": "bal"}, '[[event]] 1 body = "bal" is not a body, did you mean "ball"?'),
    "line": ({"kind": "taut", "line": 24}, "[[event]] 1 line = 24 must be 0 … 23"),
    "observe": (
        {"kind": "threshold", "observe": "deflexion", "value": 1.0},
        '[[event]] 1 observe = "deflexion" is not an observable, did you mean "deflection"?',
    ),
    "kind": ({"kind": "contakt"}, '[[event]] 1 kind = "contakt" must be one of "contact", "taut", "threshold"'),
    "no kind": ({}, "[[event]] 1 kind is missing"),
    "no line": ({"kind": "taut"}, '[[event]] 1 line is missing: kind = "taut" needs line = ...'),
    "no value": ({"kind": "threshold", "observe": "deflection"}, '[[event]] 1 value is missing: kind = "threshold"'),
    "no observe": ({"kind": "threshold", "value": 1.0}, "[[event]] 1 observe is missing"),
    "other key": ({"kind": "taut", "line": 0, "body": "ball"}, 'body = "ball" has no meaning for kind = "taut"'),
    "unknown key": ({"kind": "taut", "line": 0, "stopp": True}, 'stopp = true: unknown key, did you mean "stop"?'),
    "stop": ({"kind": "taut", "line": 0, "stop": 1}, "stop = 1 must be true or false"),
    "infinite": ({"kind": "threshold", "observe": "deflection", "value": float("inf")}, "value = inf must be a finite"),
    "negative line": ({"kind": "taut", "line": -1}, "line = -1 must be"),
}


def given(events, **changes):
    return {
        "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.2},
        "cable": {"law": "tension-only", "modulus": 7e7, "area": 1e-4, "density": 200.0},
        "solve": {"kind": "dynamic", "duration": 0.1},
        "event": events,
        **ITEMS,
        **changes,
    }


def refused(message, data):
    with pytest.raises(refweb.InputError) as caught:
        refweb.Scene.from_dict(data).build()
    assert message in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("name", REFUSED)
def test_wrong_events(name):
    keys, message = REFUSED[name]
    refused(message, given([{"name": "a", **keys}]))


def test_events_that_fit_nothing():
    touch = {"name": "touch", "kind": "contact"}
    refused('[[event]] 2 name = "touch" is already used by [[event]] 1', given([touch, {**touch, "body": "ball"}]))
    without = given([touch])
    for key in ("body", "contact"):
        del without[key]
    refused('[[event]] 1 kind = "contact" needs a [contact] in the scene', without)
    static = given([touch], solve={"kind": "static"})
    refused('[[event]] "touch" has no meaning in statics: leave it out', static)
    refused("[[event]] 1 name is missing", given([{"kind": "contact"}]))
    assert refweb.Scene.from_dict(given([touch])).to_dict()["event"] == [{**touch, "stop": False}]
