"""Runs that are taken ahead step by step: bits of a whole run, feedback in closed form, balances and errors."""

import copy
import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import refweb
from refweb.errors import InputError

EA, MASS = 100.0, 1.0
STEPS = {
    "central-difference": {},
    "order 4": dict(method="explicit", order=4),
    "cvode": dict(method="cvode", rtol=1e-6),
    "ida": dict(method="ida", rtol=1e-6),
}


def scene(solve=(), duration=0.2, interval=0.02, lines=((0, 1), (1, 2)), **tables):
    """A rope of two lines from a support, a mass at its end with a load, and a mass aside that nothing holds."""
    given = {
        "web": {
            "kind": "inline",
            "points": [[0, 0, 0], [1, 0, 0], [2, 0, 0], [9, 0, 0], [9.5, 0, 0]],
            "lines": [*map(list, lines), [3, 4]],
            "natural_length": [1.0] * len(lines) + [50.0],
            "supports": [0, 3],
        },
        "cable": {"law": "tension-only", "modulus": EA / 1e-4, "area": 1e-4, "density": 100.0},
        "point_mass": [{"node": node, "mass": MASS} for node in (2, 4)],
        "load": [{"node": node, "force": [0.0, 0.0, 0.0]} for node in (2, 4)],
        "observe": [
            {"name": f"{name}{node}", "quantity": quantity, "node": node, "component": "x"}
            for node in (2, 4)
            for name, quantity in (("x", "displacement"), ("v", "velocity"))
        ],
        "output": {"interval": interval},
        "solve": {"kind": "dynamic", "duration": duration, **dict(solve)},
    }
    return refweb.Scene.from_dict({name: value for name, value in {**given, **tables}.items() if value != []})


def driven(run, until=np.inf):
    """Set loads, a motion and gravity at each row, by what the run observes."""
    while not run.stopped and run.time < until:
        n = round(run.time / 0.02)
        run.set("load.0.force", [5.0 * np.sin(n) - run.observe("x2"), 1.0, 0.0])
        run.set("motion.0.velocity", [0.1 * (n % 3), 0.0, 0.0])
        if n == 5:
            run.set("gravity.acceleration", [0.0, 0.0, -2.0])
        run.advance()
    return run


MOVED = {
    "motion": [{"node": 0, "displacement": [[0.05, 0.0, 0.0, 0.0], [0.1, 0.02, 0.0, 0.0]]}],
    "gravity": {"acceleration": [0, 0, -0.1]},
}


@pytest.mark.parametrize("name", STEPS)
def test_a_run_without_commands_has_the_bits_of_a_whole_one(name):
    """At once, row by row, and some rows at a time."""
    one = scene(STEPS[name], accuracy={"error": "none"}, **MOVED)
    whole, run = refweb.run(one), refweb.start(one)
    while not run.stopped:
        run.advance(0.04 if run.time > 0.1 else None)
    assert run.history.keys() == whole.history.keys() and run.time == one.solve.duration
    for column, values in whole.history.items():
        np.testing.assert_array_equal(run.history[column], values, err_msg=column)
    np.testing.assert_array_equal(run.state.x, whole.state.x)


@pytest.mark.ordinary("central-difference", "order 4")
@pytest.mark.parametrize("name", STEPS)
def test_balances_close_and_the_whole_solution_has_the_same_bits(name):
    """Errors of the balances are those of steps: a load and gravity that jump bring no energy and no momentum."""
    run = driven(refweb.start(scene(STEPS[name], **MOVED)))
    solution = run.finish()
    for column, values in solution.history.items():
        np.testing.assert_array_equal(run.history[column], values, err_msg=column)
    energy = solution.history["total_energy"] - solution.history["work"]
    largest = np.abs(solution.history["total_energy"]).max()
    assert np.abs(energy - energy[0]).max() < 1e-2 * largest and solution.solver["momentum_drift"] < 1e-6
    assert np.abs(solution.history["work"]).max() > 0.1 * largest
    assert all(result.error is not None for result in solution.results.values())


@pytest.mark.slow
def test_methods_agree_under_commands():
    """Open loop, so that all have the same commands; each ± is small and covers the difference."""
    commands = [(0.02 * n, "load.0.force", [3.0 + np.sin(n), np.cos(n), 0.0]) for n in range(10)]
    runs = [refweb.run(scene(keys), commands=commands) for keys in STEPS.values()]
    for name, one in runs[0].results.items():
        for run in runs[1:]:
            other = run.results[name]
            assert abs(one.value - other.value) <= one.error + other.error + 1e-12 < 0.02, name


@pytest.mark.parametrize("name", ["central-difference", "order 4", "cvode", "ida"])
def test_a_held_mass_under_feedback(name):
    """PD control of a free mass, held between periods: its matrix is exact, and so are steps at constant force."""
    period, stiffness, damping = 0.05, 40.0, 6.0
    run = refweb.start(scene(STEPS[name], duration=1.0, interval=period))
    mass = MASS + 0.5 * 100.0 * 1e-4 * 50.0  # with half of its line
    state = np.zeros(2)
    for _ in range(20):
        force = stiffness * (0.3 - run.observe("x4")) - damping * run.observe("v4")
        run.set("load.1.force", [force, 0.0, 0.0])
        push = (stiffness * (0.3 - state[0]) - damping * state[1]) / mass
        state = np.array([state[0] + period * state[1] + 0.5 * period**2 * push, state[1] + period * push])
        run.advance()
        found = [run.observe("x4"), run.observe("v4")]
        # Rounding of some hundred steps; BDF restarts in each period with steps of order 1 to its tolerance.
        np.testing.assert_allclose(found, state, atol=1e-11 if name in ("central-difference", "order 4") else 1e-4)
    assert run.time == 1.0 and abs(state[0] - 0.3) < 0.05


def test_order_2_across_periods():
    """A load that jumps in each row: against DOP853 from jump to jump."""
    pushes = [4.0 * np.cos(2.0 * n) + 6.0 for n in range(10)]
    masses = np.array([0.01, MASS + 0.005])

    def rate(t, y, push):
        stretch = np.array([y[0], y[1] - y[0]])
        tension = EA * np.maximum(stretch, 0.0)
        return np.concatenate([y[2:], np.array([tension[1] - tension[0], push - tension[1]]) / masses])

    y = np.zeros(4)
    for push in pushes:
        y = solve_ivp(rate, (0.0, 0.02), y, "DOP853", args=(push,), rtol=1e-11, atol=1e-13, max_step=2e-4).y[:, -1]
    errors, steps = [], np.array([2e-4, 1e-4, 5e-5])
    for step in steps:
        run = refweb.start(scene(dict(step_size=step), accuracy={"error": "none"}))
        for push in pushes:
            run.set("load.0.force", [push, 0.0, 0.0])
            run.advance()
        errors.append(abs(run.observe("x2") - y[1]))
    assert abs(np.polyfit(np.log(steps), np.log(errors), 1)[0] - 2.0) < 0.2  # the light node vibrates near the bound


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", ["central-difference", "cvode"])
def test_a_line_is_reeled_in_at_a_rate(method):
    """A mass that hangs is pulled up by a line that gets shorter at a rate; a tenth of its length later it rests."""
    run = refweb.start(
        scene(
            {"start": "equilibrium", **STEPS[method]}, 3.0, 0.1, reel=[{"lines": [0, 1], "factor": [[0.0, 1.0]]}],
            damping={"rate": 12.0}, gravity={"acceleration": [9.81, 0.0, 0.0]},
        )
    )  # fmt: skip
    stretch = 9.81 / EA * (2.0 * MASS + 0.02)  # of both lines of 1 m, each with half of its weight
    run.advance(0.5)
    np.testing.assert_allclose(run.observe("x2"), stretch, atol=1e-6)
    run.set("reel.0.rate", -0.2)
    run.advance(0.5)
    run.set("reel.0.rate", 0.0)
    run.advance(2.0)
    # The weight stays; what is left of the motion is exp(-12) of 0.1 m.
    np.testing.assert_allclose(run.observe("x2"), 0.9 * (2.0 + stretch) - 2.0, atol=1e-5)
    assert run.stopped and run.finish().solver["energy_drift"] < 1e-3


def test_a_torque_turns_a_drum():
    """ω = ∫ M dt/I of a bang-bang torque, and the angle by its steps."""
    drum = {
        "name": "drum", "shape": "sphere", "radius": 0.1, "mass": 2.0, "position": [0, 5, 0],
        "axle": {"direction": [0, 0, 1], "torque": 0.0},
    }  # fmt: skip
    observe = [{"name": "angle", "quantity": "axle_angle", "body": "drum"}]
    run = refweb.start(scene(duration=0.4, interval=0.1, body=[drum], observe=observe))
    inertia, angle, speed = 0.4 * 2.0 * 0.01, 0.0, 0.0
    for torque in (0.05, 0.05, -0.05, -0.02):
        run.set("body.drum.axle.torque", torque)
        run.advance()
        angle, speed = angle + 0.1 * speed + 0.005 * torque / inertia, speed + 0.1 * torque / inertia
        np.testing.assert_allclose(run.observe("angle"), angle, rtol=1e-9)


def test_a_drum_is_turned_at_a_rate():
    drum = {"name": "drum", "shape": "sphere", "radius": 0.1, "position": [0, 5, 0], "axle": {"direction": [0, 0, 1]}}
    run = refweb.start(
        scene(
            duration=0.3, interval=0.1, body=[drum], motion=[{"body": "drum", "rotation": [[0, 0, 0, 0]]}],
            observe=[{"name": "angle", "quantity": "axle_angle", "body": "drum"}],
        )
    )  # fmt: skip
    for rate, angle in ((3.0, 0.3), (50.0, 5.3), (-1.0, 5.2)):
        run.set("motion.0.angular_velocity", [0.0, 0.0, rate])
        run.advance()
        np.testing.assert_allclose(run.observe("angle"), angle, rtol=1e-12)


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("name", ["central-difference", "ida"])
def test_branches_are_independent(name):
    run = driven(refweb.start(scene(STEPS[name], **MOVED)), until=0.09)
    branch, kept = copy.deepcopy(run), run.state.x.copy()
    driven(branch)
    np.testing.assert_array_equal(run.state.x, kept)
    driven(run)
    if name == "central-difference":
        np.testing.assert_array_equal(run.state.x, branch.state.x)
    np.testing.assert_allclose(run.state.x, branch.state.x, atol=1e-4)  # IDA began anew, at rtol = 1e-6
    other = copy.deepcopy(run)
    assert other.stopped and other.history["time"][-1] == run.time
    solution = branch.finish()
    np.testing.assert_allclose(solution.state.x, branch.state.x, atol=1e-4)


def test_folder_and_frames_have_the_forces_of_their_time(tmp_path):
    """A load is what it was at each frame, in memory, and in the last frame of a folder."""
    commands = [(0.02 * n, "load.0.force", [0.0, 0.0, 1.0 + n]) for n in range(10)]
    one = scene(output={"interval": 0.02, "frames": 1}, accuracy={"error": "none"})
    for _, state in refweb.run(one, commands=commands).frames[1:]:
        (load, *_) = [term for term in state.system.terms if term.name == "load"]
        np.testing.assert_allclose(state.system.force_of(load, state.time, state.x)[2, 2], round(state.time / 0.02))
    refweb.run(one, tmp_path / "out", commands=commands)
    loaded = refweb.load(tmp_path / "out")
    (load, *_) = [term for term in loaded.state.system.terms if term.name == "load"]
    assert loaded.state.system.force_of(load, 0.2, loaded.state.x)[2, 2] == 10.0
    assert loaded.commands == [list(command) for command in commands]
    (tmp_path / "out" / "run.json").write_text(
        (tmp_path / "out" / "run.json").read_text().replace('"status": "solved"', '"status": "failed"')
    )
    with pytest.raises(InputError, match="a run with commands, which cannot be continued"):
        refweb.resume(tmp_path / "out")


WRONG = [
    ("load.2.force", [0, 0, 1], '"2" is not the number or name of a [[load]]'),
    ("load.0.forse", [0, 0, 1], 'did you mean "force"'),
    ("laod.0.force", [0, 0, 1], 'did you mean "load"'),
    ("load.0.force", [0, 1], "force"),
    ("load.0.force", [0, 0, float("nan")], "finite"),
    ("thrust.0.force", 1.0, "the scene has no [thrust]"),
    ("cable.modulus", 1.0, "nothing that a command may set"),
    ("motion.0.velocity", 3.0, "3 finite numbers"),
    ("motion.0.angular_velocity", [0, 0, 1], "no rotation that it could continue"),
    ("body.drum.axle.torque", 1.0, "the scene has no [body]"),
]


@pytest.mark.parametrize("path, value, words", WRONG, ids=[f"{path} {value}" for path, value, _ in WRONG])
def test_what_cannot_be_set_is_refused_and_changes_nothing(path, value, words):
    run = refweb.start(scene(accuracy={"error": "none"}, **MOVED))
    with pytest.raises(InputError, match=re.escape(words)):
        run.set(path, value)
    whole = refweb.run(run.scene)
    run.advance(1.0)
    np.testing.assert_array_equal(run.state.x, whole.state.x)
    assert run.commands == []


def test_other_refusals():
    run = refweb.start(scene())
    with pytest.raises(InputError, match=r"t = 0.013 s is not the time of a history row: rows are each 0.02 s"):
        run.advance(0.013)
    with pytest.raises(InputError, match=r"dt = -1 must be > 0"):
        run.advance(-1)
    with pytest.raises(InputError, match='did you mean "x2"'):
        run.observe("x22")
    run.advance(9.0)
    for ended in (run.advance, lambda: run.set("load.0.force", [0.0, 0.0, 1.0])):
        with pytest.raises(InputError, match=r"the run has ended at t = 0.2 s"):
            ended()
    assert not run.commands
    with pytest.raises(InputError, match="statics has load steps"):
        refweb.start(scene(solve={}).replace(solve=refweb.Static(), output=refweb.Output()))
    with pytest.raises(InputError, match=r"cannot stand beside \[rupture\]"):
        strong = {"law": "tension-only", "modulus": 1e6, "area": 1e-4, "density": 100.0, "strength": 1e9}
        refweb.start(scene(rupture={}, cable=strong))
    for accuracy, key in (({"horizon": True}, "horizon"), ({"level": "full"}, "level")):
        with pytest.raises(InputError, match=rf"\[accuracy\] {key} = .* cannot stand beside commands"):
            refweb.run(scene(accuracy=accuracy), commands=[(0.0, "load.0.force", [0, 0, 1])])


def test_an_event_ends_the_run():
    event = [{"name": "far", "kind": "threshold", "observe": "x4", "value": 0.01, "stop": True}]
    run = refweb.start(scene(event=event))
    run.set("load.1.force", [50.0, 0.0, 0.0])
    while not run.stopped:
        run.advance()
    assert run.time < 0.2 and run.observe("x4") >= 0.01
    with pytest.raises(InputError, match=r"the run has ended at t = 0\.\d+ s: start it again"):
        run.set("load.1.force", [0.0, 0.0, 0.0])
    assert run.finish().results["x4"].value == run.observe("x4")


def test_a_run_that_is_ended():
    """Its results are those of a run of that duration with the same commands; it goes on no more, and nor do copies."""
    run = driven(refweb.start(scene(**MOVED)), until=0.1)
    run.set("load.0.force", [1e6, 0.0, 0.0])  # from its last row on
    run.end()
    assert run.stopped and copy.deepcopy(run).stopped
    with pytest.raises(InputError, match=re.escape("the run has ended at t = 0.1 s")):
        run.advance()
    shorter = refweb.run(scene(duration=0.1, **MOVED), commands=run.commands[:-1])
    assert run.finish().results == shorter.results
    run.restart()
    assert not run.stopped
    run.end()
    with pytest.raises(InputError, match="ended at t = 0 s, its first row: there are no results"):
        run.finish()


def test_a_scene_by_name_and_an_equilibrium():
    run = refweb.start("square-impact")
    assert run.time == 0.0 and run.advance() > 0.0
    begun = refweb.start(
        scene(dict(start="equilibrium"), load=[{"node": 2, "force": [1.0, 0, 0]}], lines=((0, 1), (1, 2)))
    )
    run.advance()
    begun.advance(0.2)
    assert abs(begun.observe("x2") - 2.0 / EA) < 1e-6


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("name", STEPS)
def test_a_restarted_run_is_a_new_one(name):
    """With other loads and velocities, for which the system is used again, with other masses, and as before."""
    drifting = {"velocity": [{"node": 4, "value": [0.1, 0.0, 0.0]}]}
    one = scene(STEPS[name], **MOVED, **drifting)
    run = driven(refweb.start(one), until=0.1)
    loaded = scene(STEPS[name], **{**MOVED, "gravity": {"acceleration": [0, 0, -0.2]}},
                   velocity=[{"node": 4, "value": [-0.3, 0.2, 0.0]}],
                   load=[{"node": node, "force": [0.5, 0.0, 0.0]} for node in (2, 4)])  # fmt: skip
    heavier = scene(STEPS[name], point_mass=[{"node": node, "mass": 2.0} for node in (2, 4)], **MOVED, **drifting)
    system = run.state.system
    for changed in (None, loaded, loaded, one, heavier, None):
        run.restart(changed)
        expected = driven(refweb.start(changed or run.scene), until=0.1)
        assert run.time == 0.0 and run.commands == [] and run.scene == expected.scene
        driven(run, until=0.1)
        for column, values in expected.history.items():
            np.testing.assert_array_equal(run.history[column], values, err_msg=column)
        assert (run.state.system is system) == (run.scene != heavier)
    run.restart(one)
    run.set("load.0.force", [7.0, 0.0, 0.0])
    run.advance()
    for _ in range(2):  # a set value does not outlive a restart, nor do those of the scene before
        run.restart(loaded)
        run.advance()
        expected = refweb.start(loaded)
        expected.advance()
        np.testing.assert_array_equal(run.state.x, expected.state.x)
        run.set("load.0.force", [9.0, 0.0, 0.0])
        run.advance()
    assert run.observed["x2"] == run.observe("x2") and run.steps > 0 and run.event is None
