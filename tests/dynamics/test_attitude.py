"""Attitude control of free bodies: closed forms and DOP853 in each period; forces in a cone; what controls spend."""

import copy
import re

import nets
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import refweb
from refweb.dynamics.controllers import within_cone
from refweb.errors import InputError
from refweb.net.quaternions import interpolated, rotation_between

INERTIA, PERIOD = np.array([1.0, 2.0, 2.5]), 0.05
PID = {"law": "pid", "parameters": {"proportional": 8.0, "derivative": 5.0}}
SLEW = Rotation.from_rotvec([0.9, -1.3, 0.7])


def quaternion(rotation):
    return np.roll(rotation.as_quat(), 1).tolist()


def hub_of(name, **keys):
    shape = {"shape": "box", "size": [1, 1, 1], "mass": 2.0, "inertia": INERTIA.tolist()}
    return {"name": name, **shape, "position": [0, 5, 0], **keys}


def scene(control=(), load=(), bodies=(), duration=1.0, **tables):
    """A hub that a control turns, far from a slack line."""
    observe = [
        {"name": f"{name}{c}", "quantity": quantity, "body": "hub", "component": c}
        for name, quantity, components in (
            ("q", "orientation", "wxyz"), ("v", "angular_velocity", "xyz"), ("p", "position", "xyz"),
        )
        for c in components
    ]  # fmt: skip
    attitude = {
        "name": "hold", "period": PERIOD, "sets": "load.0.torque", "measures": ["qw", "qx", "qy", "qz"],
        "rates": ["vx", "vy", "vz"], "target": quaternion(SLEW), **PID, **dict(control),
    }  # fmt: skip
    given = {
        **nets.SLACK_LINE,
        "body": [hub_of("hub"), *bodies],
        "load": [{"body": "hub", "torque": [0.0, 0.0, 0.0], **dict(load)}],
        "observe": observe,
        "solve": {"kind": "dynamic", "duration": duration},
        "control": [{key: value for key, value in attitude.items() if value is not None}],
        **tables,
    }
    return refweb.Scene.from_dict(given)


def motion(torque, turned, duration=1.0, start=(1.0, 0.0, 0.0, 0.0), omega=(0.0, 0.0, 0.0)):
    """Orientations (rows, 4) and angular velocities (rows, 3) under torque(rotation, ω), held in each period."""

    def rates(t, y, moment):
        rotation = Rotation.from_quat(np.roll(y[:4], -1))
        now = rotation.apply(rotation.apply(y[4:], inverse=True) / INERTIA)
        change = 0.5 * np.array([-now @ y[1:4], *(y[0] * now + np.cross(now, y[1:4]))])
        return [*change, *(rotation.apply(moment) if turned else moment)]

    y, found = np.concatenate([start, INERTIA * omega]), []  # angular velocity along the axes at the start
    for _ in range(round(duration / PERIOD) + 1):
        rotation = Rotation.from_quat(np.roll(y[:4], -1))
        now = rotation.apply(rotation.apply(y[4:], inverse=True) / INERTIA)
        found.append([*y[:4], *now])
        moment = torque(rotation, now)
        moment = rotation.apply(moment, inverse=True) if turned else moment
        y = solve_ivp(rates, (0.0, PERIOD), y, "DOP853", args=(moment,), rtol=1e-11, atol=1e-12).y[:, -1]
    return np.array(found)


def feedback(rotation, omega, target=SLEW):
    return 8.0 * (target * rotation.inv()).as_rotvec() - 5.0 * omega


def columns(run, names=("qw", "qx", "qy", "qz", "vx", "vy", "vz")):
    return np.column_stack([run.history[name] for name in names])


def test_a_slew_about_a_principal_axis_is_that_of_one_angle():
    """By 2.5 rad, to rounding: θ ← θ + T ω + ½ T² M/J; its poles are those of this feedback."""
    control = {"target": quaternion(Rotation.from_rotvec([0.0, 0.0, 2.5]))}
    run = refweb.run(scene(control, duration=2.0))
    advance = np.array([[1.0, PERIOD], [0.0, 1.0]])
    push = np.array([0.5 * PERIOD**2, PERIOD]) / INERTIA[2]
    loop, state, angles = advance - np.outer(push, [8.0, 5.0]), np.array([-2.5, 0.0]), []
    for _ in range(41):
        angles.append(2.5 + state[0])
        state = loop @ state
    found = 2.0 * np.arctan2(run.history["qz"], run.history["qw"])
    np.testing.assert_allclose(found, angles, atol=1e-12)
    poles = np.linalg.eigvals(loop)
    assert np.abs(poles).max() < 1.0
    later = found[20:] - 2.5  # a sum of powers of two poles follows their recursion
    np.testing.assert_allclose(later[2:], poles.sum().real * later[1:-1] - poles.prod().real * later[:-2], atol=1e-12)


@pytest.fixture(scope="module", params=["space", "body"])
def slews(request):
    """(axes, exact motion) of a slew about no axis of the hub."""
    return request.param, motion(feedback, request.param == "body")


def test_order_is_kept_across_periods(slews):
    axes, exact = slews
    errors = []
    for step in (0.025, 0.0125, 0.00625):
        solve = {"kind": "dynamic", "duration": 1.0, "step_size": step}
        run = refweb.run(scene(load={"axes": axes}, solve=solve, accuracy={"error": "none"}))
        errors.append(np.abs(columns(run) - exact).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.abs(orders - 2.0).max() < 0.15 and errors[-1] < 1e-3


@pytest.mark.ordinary("space-central-difference", "body-central-difference")
@pytest.mark.parametrize("method", ["central-difference", "cvode", "ida"])
def test_methods_agree_within_their_errors(slews, method):
    axes, exact = slews
    keys = {} if method == "central-difference" else {"method": method, "rtol": 1e-7}
    run = refweb.run(scene(load={"axes": axes}, solve={"kind": "dynamic", "duration": 1.0, **keys}))
    for name, value in zip(("qw", "qx", "qy", "qz", "vx", "vy", "vz"), exact[-1], strict=True):
        assert abs(run.results[name].value - value) <= run.results[name].error + 1e-12, name
        assert run.results[name].error < 5e-3
    (control,) = run.controls
    held = [feedback(Rotation.from_quat(np.roll(row[:4], -1)), row[4:]) for row in exact[:-1]]
    assert abs(control["spent"] - PERIOD * np.linalg.norm(held, axis=1).sum()) <= control["error"] + 1e-9
    assert control["unit"] == "N m s"


def test_a_table_and_another_body_are_followed():
    """A target that turns at a constant rate is reached by derivative feedback of its rate, without a steady error."""
    rate = 0.8
    table = [[0.0, 1.0, 0.0, 0.0, 0.0], [2.0, *quaternion(Rotation.from_rotvec([0.0, 0.0, 2.0 * rate]))]]
    law = {"parameters": {"proportional": 40.0, "derivative": 14.0}}
    by_table = refweb.run(scene({**law, "target": table}, duration=2.0))
    names = [f"other{c}" for c in "wxyz"]
    given = scene(law, duration=2.0).to_dict()
    seen = [dict(name=n, quantity="orientation", body="other", component=c) for n, c in zip(names, "wxyz", strict=True)]
    other = hub_of("other", angular_velocity=[0.0, 0.0, rate])
    by_body = refweb.run(
        scene({**law, "target": names}, bodies=[other], duration=2.0, observe=[*given["observe"], *seen])
    )
    for run in (by_table, by_body):
        angle = 2.0 * np.arctan2(run.history["qz"], run.history["qw"])
        assert abs(angle[-1] - 2.0 * rate) < 0.01
        np.testing.assert_allclose(run.history["vz"][-1], rate, atol=0.01)
    np.testing.assert_allclose(by_body.history["qz"], by_table.history["qz"], atol=1e-12)


def test_a_rate_by_differences_is_that_of_the_period_before():
    """About a principal axis ω is (θ − θ before)/T; at first it is 0."""
    control = {"rates": None, "target": quaternion(Rotation.from_rotvec([0.0, 0.0, 1.0]))}
    run = refweb.run(scene(control))
    angle, omega, before, angles = 0.0, 0.0, 0.0, []
    for _ in range(21):
        angles.append(angle)
        moment = 8.0 * (1.0 - angle) - 5.0 * (angle - before) / PERIOD
        before = angle
        angle, omega = angle + PERIOD * omega + 0.5 * PERIOD**2 * moment / 2.5, omega + PERIOD * moment / 2.5
    np.testing.assert_allclose(2.0 * np.arctan2(run.history["qz"], run.history["qw"]), angles, atol=1e-12)


def test_sliding_mode_turns_along_its_surface():
    """Behind the approach the error falls by the slow pole of e'' + k (e' + λ e) = 0, k = strength/(J width)."""
    law = {"law": "sliding-mode", "parameters": {"strength": 30.0, "slope": 2.0, "width": 0.1}, "period": 4e-3}
    run = refweb.run(scene({**law, "target": quaternion(Rotation.from_rotvec([0.0, 1.2, 0.0]))}, duration=1.5))
    error = 1.2 - 2.0 * np.arctan2(run.history["qy"], run.history["qw"])
    surface = np.abs(2.0 * error - run.history["vy"])
    later = run.history["time"] > 0.7
    assert surface[later].max() < 0.1
    k = 30.0 / (2.0 * 0.1)
    pole = 0.5 * (k - np.sqrt(k * k - 4.0 * k * 2.0))
    assert abs(np.polyfit(run.history["time"][later], np.log(error[later]), 1)[0] + pole) < 0.01 * pole


def test_stopped_runs_of_attitudes_go_on_bit_for_bit(tmp_path):
    """With delayed quaternions, rates by differences, and noise that turns them."""
    control = {"delay": 0.1, "noise": 1e-3, "rates": None}
    given = scene(control, output={"interval": PERIOD, "frames": 7})
    whole, resumed = nets.whole_and_resumed(given, tmp_path)
    for name, values in whole.history.items():
        np.testing.assert_array_equal(resumed.history[name], values, err_msg=name)
    quiet = refweb.run(scene({"rates": None, "delay": 0.1}))
    assert 1e-5 < np.abs(quiet.history["qx"] - whole.history["qx"]).max() < 0.05


def test_rotations_of_quaternions():
    """Against scipy, with quaternions of either sign."""
    first, second = Rotation.random(2, rng=1)
    for sign in (1.0, -1.0):
        found = rotation_between(sign * np.array(quaternion(second)), np.array(quaternion(first)))
        np.testing.assert_allclose(found, (second * first.inv()).as_rotvec(), atol=1e-14)
    times, both = np.array([0.0, 2.0]), np.array([quaternion(first), quaternion(second)])
    middle = Rotation.from_quat(np.roll(interpolated(0.5, times, both), -1))
    expected = Rotation.from_rotvec(0.25 * (second * first.inv()).as_rotvec()) * first
    assert (middle * expected.inv()).magnitude() < 1e-14
    np.testing.assert_array_equal(interpolated(-1.0, times, both), both[0])
    assert (Rotation.from_quat(np.roll(interpolated(9.0, times, both), -1)) * second.inv()).magnitude() < 1e-14


def test_the_nearest_vector_of_a_cone():
    """It is in the cone, and what is left points away from all of it and is at right angles to it."""
    rng = np.random.default_rng(2)
    for angle in (0.2, 1.0, 0.5 * np.pi):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        others = rng.normal(size=(500, 3))
        others = others[others @ axis >= np.cos(angle) * np.linalg.norm(others, axis=1)]
        for value in rng.normal(size=(50, 3)):
            near = within_cone(value, 3.0 * axis, angle)
            assert near @ axis >= np.cos(angle) * np.linalg.norm(near) - 1e-12
            assert abs((value - near) @ near) < 1e-12
            assert ((value - near) @ others.T <= 1e-12).all()


@pytest.mark.parametrize("axes", ["space", "body"])
def test_a_thruster_pushes_within_its_cone(axes):
    """Asked for a force along y with a cone about x, of space or of the body: on the edge, or the force itself."""
    turned = Rotation.from_rotvec([0.0, 0.0, 1.2])
    hub = hub_of("hub", orientation=quaternion(turned))
    push = {
        "name": "fly", "law": "pid", "parameters": {"proportional": 3.0}, "period": 1.0, "sets": "load.0.force",
        "measures": ["px", "py", "pz"], "rates": None, "target": [0.0, 7.0, 0.0], "direction": [2.0, 0.0, 0.0],
        "angle": 0.5,
    }  # fmt: skip
    run = refweb.run(scene(push, {"force": [0.0, 0.0, 0.0], "axes": axes}, body=[hub]))
    axis = turned.apply([1.0, 0.0, 0.0]) if axes == "body" else np.array([1.0, 0.0, 0.0])
    asked = np.array([0.0, 6.0, 0.0])
    along = asked @ axis
    across = asked - along * axis
    size = np.linalg.norm(across)
    edge = along * np.cos(0.5) + size * np.sin(0.5)
    force = edge * (np.cos(0.5) * axis + np.sin(0.5) * across / size) if size > along * np.tan(0.5) else asked
    end = [run.history[name][-1] for name in ("px", "py", "pz")]
    np.testing.assert_allclose(end, np.array([0.0, 5.0, 0.0]) + 0.5 * force / 2.0, atol=1e-12)
    np.testing.assert_allclose(run.controls[0]["spent"], np.linalg.norm(force), rtol=1e-12)


def test_torques_are_set_step_by_step():
    """About a principal axis, in a copy as well: φ ← φ + T ω + ½ T² M/J."""
    run = refweb.start(refweb.Scene.from_dict(without_control({})))
    run.advance(0.5)
    run.set("load.0.torque", [0.0, 0.0, 2.5])
    branch = copy.deepcopy(run)
    for one in (run, branch):
        one.advance(0.5)
        np.testing.assert_allclose(one.observe("vz"), 0.5, rtol=1e-12)
        np.testing.assert_allclose(2.0 * np.arctan2(one.observe("qz"), one.observe("qw")), 0.125, rtol=1e-12)


def test_stiffness_of_loads_that_turn():
    """By differences of forces under rotations of the body."""
    given = scene(load={"force": [1.0, 2.0, -3.0], "torque": [0.4, -0.8, 0.3], "axes": "body"})
    system = given.build()
    (hub,) = system.net.bodies
    x, v = np.zeros((2, system.rows, 3))
    q = np.array(quaternion(SLEW))

    def forces(q):
        x[hub.spin], x[hub.turn, 0] = q[1:], q[0] - 1.0
        return sum(system.force_of(term, 0.0, x) for term in system.terms if term.name == "load")

    terms = [term for term in system.terms if term.name == "load"]
    found = np.zeros((system.rows, 3, 4))
    forces(q)
    for term in terms:
        blocks = np.zeros((1, 9, 9))
        term.tangent.stiffness(0.0, x, v, blocks, term.cells, term.data, False)
        rows = blocks.reshape(3, 3, 9)
        for n, row in enumerate(term.cells[0]):
            found[row] -= np.concatenate([rows[n, :, 6:7], rows[n, :, 3:6]], axis=1)
    for k in range(4):
        change = 1e-6 * np.eye(4)[k]
        slope = (forces(q + change) - forces(q - change)) / 2e-6
        np.testing.assert_allclose(found[:, :, k], slope, atol=1e-8)


WRONG = [
    ({"target": None}, "target is missing: an attitude needs a quaternion"),
    ({"target": [0.0, 0.0, 0.0, 0.0]}, "must not be a quaternion of zeros"),
    ({"target": [1.0, 0.0, 0.0]}, "has 3 values, and measures has 4"),
    ({"measures": ["qx", "qy", "qz", "qw"]}, "must be the components w, x, y, z of the orientation of one body"),
    ({"target": ["qw", "qx", "qy", "vz"]}, "must be the components w, x, y, z of the orientation of one body"),
    ({"law": "spin-up", "parameters": {"strength": 1.0}}, 'law = "spin-up" leads to a speed'),
    ({"sets": "load.0.force"}, "there is no force that it could change"),
    ({"rates": ["vx"]}, "must be 3, by the number of measures"),
    ({"direction": [1.0, 0.0, 0.0]}, "is for one measure, or needs the angle of a cone"),
    ({"angle": 0.5}, "angle = 0.5 needs a direction"),
    ({"angle": 2.0, "direction": [1.0, 0.0, 0.0]}, "angle = 2.0 must be ≤ 1.5708"),
]


@pytest.mark.parametrize("control, words", WRONG, ids=[words for _, words in WRONG])
def test_attitudes_that_do_not_fit_are_refused(control, words):
    with pytest.raises(InputError, match=re.escape(words)):
        scene(control).build()


SPHERE = {"shape": "sphere", "size": None, "radius": 0.5, "inertia": 0.2}
LOADS = [
    ({"node": 1}, {}, "exclude each other"),
    ({"body": "hbu"}, {}, 'is not a [[body]], did you mean "hub"'),
    ({"body": None}, {}, "node is missing: give node = ... or body = ..."),
    ({"body": None, "node": 1, "force": [1, 0, 0]}, {}, "has no meaning for nodes: it acts on a body"),
    ({"body": None, "node": 1, "torque": None}, {}, "force is missing: give force = ... [N]"),
    ({"torque": None}, {}, "force is missing: give force = ... [N] or torque = ... [N m]"),
    ({"axes": "body"}, SPHERE, "has no orientation that is followed"),
    ({}, {"fixed": True, "mass": None, "inertia": None}, "is not free"),
    ({}, {"axle": {"direction": [0, 0, 1]}}, "turns about an axle: give axle.torque"),
    ({}, {"shape": "ring", "size": None, "radius": 0.5, "normal": [0, 0, 1], "inertia": 0.2}, "which keeps its plane"),
]


@pytest.mark.parametrize("load, body, words", LOADS, ids=[words for *_, words in LOADS])
def test_loads_that_do_not_fit_are_refused(load, body, words):
    load = {"body": "hub", "torque": [0.0, 0.0, 1.0], **load}
    tables = {
        "load": [{key: value for key, value in load.items() if value is not None}],
        "body": [{key: value for key, value in hub_of("hub", **body).items() if value is not None}],
        "observe": [{"name": "x", "quantity": "position", "body": "hub", "component": "x"}],
    }
    with pytest.raises(InputError, match=re.escape(words)):
        refweb.Scene.from_dict(without_control(tables)).build()


def without_control(tables):
    given = scene().to_dict() | tables
    del given["control"]
    return given


def test_torque_on_a_sphere_and_loads_on_bodies_in_statics():
    """A sphere with one moment of inertia turns by M t/J, without supports; statics refuses loads on bodies."""
    ball = {key: value for key, value in hub_of("hub", **SPHERE).items() if value is not None}
    given = without_control({"body": [ball]})
    given["web"]["supports"] = []
    given["load"] = [{"body": "hub", "torque": [0.1, 0.0, -0.2], "force": [0.0, 4.0, 0.0]}]
    given["observe"] = [o for o in given["observe"] if o["quantity"] != "orientation"]
    run = refweb.run(refweb.Scene.from_dict(given))
    np.testing.assert_allclose(columns(run, ("vx", "vy", "vz"))[-1], [0.5, 0.0, -1.0], atol=1e-12)
    np.testing.assert_allclose(run.history["py"][-1], 5.0 + 0.5 * 2.0, atol=1e-12)
    force = given["load"][0].pop("force")  # a torque alone is all of the moment that the balance has
    assert refweb.run(refweb.Scene.from_dict(given)).history["vz"][-1] == pytest.approx(-1.0, rel=1e-12)
    given["load"] = [{"body": "hub", "force": force}]
    given["solve"] |= {"method": "explicit", "order": 4}  # which follows no rotation, and none is asked for
    np.testing.assert_allclose(refweb.run(refweb.Scene.from_dict(given)).history["py"][-1], 6.0, atol=1e-12)
    given = {key: value for key, value in given.items() if key not in ("output", "observe", "solve")}
    with pytest.raises(InputError, match="loads on bodies have no meaning in statics"):
        refweb.Scene.from_dict(given | {"solve": {"kind": "static"}}).build()
