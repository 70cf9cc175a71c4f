"""Damping of free bodies, the event of rest, and an equilibrium with free bodies to start from."""

import numpy as np
import pytest

import refweb
from refweb.system.static_system import at_rest, waiting

G = 9.81
METHODS = ["central-difference", "cvode", "ida"]
BOX = {"name": "box", "shape": "box", "size": [0.5, 0.4, 0.2], "mass": 3.0, "position": [0.0, 0.0, 0.0]}
SPIN = [3.0, -2.0, 1.0]


def alone(method, **tables):
    """A box and a ball that fly and turn, beside a rope that touches neither."""
    ball = {
        "name": "ball",
        "radius": 0.3,
        "mass": 1.0,
        "position": [0.0, 3.0, 0.0],
        "angular_velocity": [0.0, 2.0, 1.0],
    }
    return refweb.Scene.from_dict(
        {
            "web": {"kind": "inline", "points": [[0, 0, 5], [1, 0, 5]], "lines": [[0, 1]], "supports": [0]},
            "cable": {"law": "tension-only", "modulus": 1e9, "area": 1e-6, "density": 1.0},
            "body": [{**BOX, "velocity": [1.0, 2.0, 3.0], "angular_velocity": SPIN}, ball],
            "damping": {"bodies": 0.7},
            "observe": [
                {"name": "box", "quantity": "angular_momentum", "body": "box"},
                {"name": "ball", "quantity": "angular_momentum", "body": "ball"},
                {"name": "lost", "quantity": "dissipated_energy"},
                {"name": "left", "quantity": "kinetic_energy"},
            ],
            "solve": {"kind": "dynamic", "duration": 1.0, "method": method},
            "accuracy": {"error": "none"},
            **tables,
        }
    )


@pytest.mark.ordinary("central-difference", "cvode")
@pytest.mark.parametrize("method", METHODS)
def test_momenta_fade_at_the_rate(method):
    """exp(−γt) of momentum and angular momentum, whatever the tumbling does; what is lost is what was there."""
    solution = refweb.run(alone(method))
    state, (box, ball) = solution.state, solution.state.system.net.bodies
    fade, close = np.exp(-0.7), 1e-9 if method == "central-difference" else 3e-5  # rtol of the others is 1e-6 a step
    np.testing.assert_allclose(state.v[box.row], fade * np.array([1.0, 2.0, 3.0]), rtol=close)
    np.testing.assert_allclose(state.x[box.row], (1 - fade) / 0.7 * np.array([1.0, 2.0, 3.0]), rtol=close)
    momentum = np.linalg.norm(box.inertia @ SPIN)
    assert solution.results["box"].value == pytest.approx(fade * momentum, rel=close)
    assert solution.results["ball"].value == pytest.approx(fade * ball.moment * np.sqrt(5.0), rel=close)
    turning = box.axes.T @ box.inertia @ box.axes
    before = 0.5 * (3.0 * 14.0 + SPIN @ turning @ SPIN + 5.0 * ball.moment)
    lost = before - solution.results["left"].value
    assert solution.results["lost"].value == pytest.approx(lost, rel=100 * close)
    assert solution.solver["energy_drift"] < 1e-4 and solution.solver["momentum_drift"] < 1e-9


def test_damping_that_damps_nothing_is_refused():
    with pytest.raises(refweb.InputError, match=r"time = 0 \[s\], rate = 0 \[1/s\] and bodies = 0 \[1/s\]: one of"):
        refweb.Damping(bodies=0.0)
    fixed = {"name": "wall", "radius": 0.1, "position": [0, 0, 0], "fixed": True}
    with pytest.raises(
        refweb.InputError, match=r"\[damping\] bodies = 0.7 \[1/s\]: the scene has no free \[\[body\]\]"
    ):
        alone("cvode", body=[fixed], observe=[{"name": "lost", "quantity": "dissipated_energy"}]).build()


def hanging(solve, **tables):
    """A beam on a long and a short rubber rope, off the middle."""
    web = {"kind": "inline", "points": [[-1, 0, 2], [1, 0, 2], [-1, 0, 0], [1, 0, 0.0]], "lines": [[0, 2], [1, 3]]}
    beam = {"name": "beam", "shape": "box", "size": [2.0, 0.2, 0.2], "mass": 100.0, "position": [0.1, 0.0, 0.0]}
    return refweb.Scene.from_dict(
        {
            "web": {**web, "natural_length": [2.0, 1.5], "supports": [0, 1]},
            "cable": {"law": "tension-only", "modulus": 1e8, "area": 1e-4, "density": 1000.0},
            "gravity": {"acceleration": [0.0, 0.0, -G]},
            "body": [beam],
            "attach": [{"body": "beam", "node": [2, 3]}],
            "observe": [
                {"name": "turn", "quantity": "orientation", "body": "beam"},
                {"name": "x", "quantity": "position", "body": "beam", "component": "x"},
                {"name": "z", "quantity": "position", "body": "beam", "component": "z"},
                {"name": "pull", "quantity": "tension", "line": 0},
                *(
                    {"name": "most", "quantity": "kinetic_energy", "reduce": "max"}
                    for _ in range(solve["kind"] != "static")
                ),
            ],
            "solve": solve,
            **tables,
        }
    )


@pytest.fixture(scope="module")
def rest():
    return refweb.run(hanging({"kind": "static"}))


@pytest.mark.ordinary("central-difference")
@pytest.mark.parametrize("method", METHODS)
def test_what_is_damped_comes_to_rest_where_statics_has_it(method, rest):
    """Three methods that know nothing of statics; the event ends the run when its energy has stayed below the share."""
    stop = {"name": "still", "kind": "rest", "share": 1e-8, "during": 0.3, "stop": True}
    solve = {"kind": "dynamic", "duration": 100.0, "method": method}
    solve |= {"rtol": 1e-4} if method in METHODS[1:] else {}  # where it rests does not hang on the way there
    more = {"damping": {"bodies": 3.0}, "event": [stop], "accuracy": {"error": "none"}, "output": {"interval": 1.0}}
    solution = refweb.run(hanging(solve, **more))
    (event,) = solution.events
    assert event["time"] == pytest.approx(solution.history["time"][-1]) and 2.0 < event["time"] < 60.0
    for name, result in rest.results.items():
        assert solution.results[name].value == pytest.approx(result.value, rel=3e-4, abs=3e-5)  # √share
    assert solution.history["kinetic_energy"][-1] <= 1e-8 * solution.results["most"].value


def test_a_pendulum_is_not_at_rest_where_it_turns_back():
    """Its kinetic energy is below a share for a while twice in a period, and not for as long as is asked for."""
    still = {"name": "still", "kind": "rest", "share": 0.05, "during": 0.3, "stop": True}  # for 2 √0.05/ω = 0.14 s
    swing = {
        "web": {"kind": "inline", "points": [[0, 0, 0], [0.6, 0, -0.8]], "lines": [[0, 1]], "supports": [0]},
        "cable": {"law": "linear", "modulus": 1e8, "area": 1e-4, "density": 0.0},
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "point_mass": [{"node": 1, "mass": 1.0}],
        "event": [still],
        "solve": {"kind": "dynamic", "duration": 3.0},
        "accuracy": {"error": "none"},
    }
    solution = refweb.run(refweb.Scene.from_dict(swing))
    kinetic = solution.history["kinetic_energy"]
    assert (np.diff(kinetic < 0.05 * kinetic.max()) != 0).sum() >= 3
    assert solution.events[0]["time"] is None
    shorter = refweb.Scene.from_dict({**swing, "event": [{**still, "during": 0.05}]})
    assert refweb.run(shorter).events[0]["time"] < 2.0


REFUSED = [
    (dict(kind="rest", value=1.0), r'value = 1.0 has no meaning for kind = "rest"'),
    (dict(kind="rest", share=1.5), r"share = 1.5 must be < 1"),
    (dict(kind="taut", line=0, during=1.0), r'during = 1.0 has no meaning for kind = "taut"'),
]


@pytest.mark.parametrize("given, message", REFUSED)
def test_keys_of_the_event_are_checked(given, message):
    with pytest.raises(refweb.InputError, match=message):
        refweb.Event(name="it", **given)


@pytest.mark.parametrize("method", METHODS[:2])
@pytest.mark.parametrize("stored", [False, True], ids=["equilibrium", "folder"])
def test_what_starts_at_rest_stays_there(method, stored, rest, tmp_path):
    start = "equilibrium"
    if stored:
        rest.save(tmp_path / "rest")
        start = str(tmp_path / "rest")
    solution = refweb.run(hanging({"kind": "dynamic", "duration": 0.3, "method": method, "start": start}))
    np.testing.assert_allclose(solution.state.x, rest.state.x, rtol=0, atol=1e-9)
    assert np.abs(solution.state.v).max() < 1e-9
    told = [text for text in solution.warnings if "of the equilibrium it starts from" in text]
    assert stored or told == [
        'of the equilibrium it starts from: body "beam" can turn at no cost: place and orientation are not unique there'
    ]


BALL = {"name": "ball", "radius": 0.15, "mass": 2.0, "position": [0.05, 0.02, 0.13]}


@pytest.mark.parametrize(
    "change, held",
    [({}, False), ({"velocity": [0, 0, 1.0]}, True), ({"position": [0.05, 0.02, 0.5]}, True)],
    ids=["touches", "moves", "away"],
)
def test_who_takes_part_in_the_equilibrium(change, held):
    """A ball that lies in the net does; one that flies, or is above it, is held, and the net hangs without it."""
    tables = {
        "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.25},
        "cable": {"law": "tension-only", "modulus": 1e9, "area": 1e-6, "density": 1000.0},
        "gravity": {"acceleration": [0.0, 0.0, -G]},
        "body": [{**BALL, **change}],
        "contact": {"stiffness": 1e4},
        "solve": {"kind": "dynamic", "duration": 1e-3, "start": "equilibrium"},
    }
    scene = refweb.Scene.from_dict(tables)
    system = scene.build()
    assert [body.name for body in waiting(system)] == (["ball"] if held else [])
    assert at_rest(system).supported[system.net.bodies[0].row].all() == held
    modes = refweb.modes(scene, 3)
    assert any("held" in text for text in modes.warnings) == held
    if not held:
        assert abs(modes.state.reaction[system.net.bodies[0].row, 2] - 2.0 * G) < 1e-7
