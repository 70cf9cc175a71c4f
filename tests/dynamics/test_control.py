"""Controls of scene files: laws in closed form on a free mass and a drum, limits, delay, noise, errors and resuming."""

import copy
import pathlib
import re

import nets
import numpy as np
import pytest

import refweb
from refweb.errors import InputError
from refweb.solution import summary_of

MASS = 1.25
"""Mass of the free node, with half of its line [kg]."""
PID = {"law": "pid", "parameters": {"proportional": 40.0, "derivative": 6.0}}


def scene(control=(), duration=1.0, interval=None, law=PID, **tables):
    """A mass on a slack line, whose load a control sets along x."""
    given = {
        **nets.SLACK_LINE,
        "point_mass": [{"node": 1, "mass": 1.0}],
        "load": [{"node": 1, "force": [0.0, 0.0, 0.0]}],
        "observe": [
            {"name": f"{name}{axis}", "quantity": quantity, "node": 1, "component": axis}
            for name, quantity in (("", "displacement"), ("v", "velocity"))
            for axis in "xyz"
        ],
        "solve": {"kind": "dynamic", "duration": duration},
        "control": [
            {
                "name": "hover", "period": 0.05, "sets": "load.0.force", "measures": ["x"], "rates": ["vx"],
                "direction": [2.0, 0.0, 0.0], "target": 0.3, **law, **dict(control),
            }
        ],
        **tables,
    }  # fmt: skip
    given["output"] = {"interval": interval} if interval else {}
    return refweb.Scene.from_dict(given)


def held(act, count, period=0.05, start=(0.0, 0.0)):
    """(Places, velocities, forces) of a mass under a force act(x, v, n) that is held between periods."""
    x, v = start
    states = [(x, v)]
    forces = []
    for n in range(count):
        force = act(x, v, n)
        x, v = x + period * v + 0.5 * period**2 * force / MASS, v + period * force / MASS
        states.append((x, v))
        forces.append(force)
    return *np.array(states).T, np.array(forces)


@pytest.mark.parametrize("method", ["central-difference", "order 4", "cvode", "ida"])
def test_proportional_and_derivative(method):
    """Its motion from period to period is exact; what it spends is the sum of its forces."""
    keys = nets.METHODS.get(method, {"method": method, "rtol": 1e-6})
    solve = {"kind": "dynamic", "duration": 1.0, **keys}
    run = refweb.run(scene(solve=solve))
    x, v, forces = held(lambda x, v, n: 40.0 * (0.3 - x) - 6.0 * v, 20)
    tight = 1e-12 if method in ("central-difference", "order 4") else 1e-4  # they begin anew in each period
    np.testing.assert_allclose(run.history["x"], x, atol=tight)
    np.testing.assert_allclose(run.history["vx"], v, atol=10.0 * tight)
    (control,) = run.controls
    assert abs(control["spent"] - 0.05 * np.abs(forces).sum()) <= control["error"] + 1e-12
    assert control["error"] < 0.01 and control["unit"] == "N s" and run.results["x"].error is not None
    np.testing.assert_allclose(control["largest"], 12.0, rtol=1e-12)
    energy = run.history["total_energy"] - run.history["work"]
    assert np.abs(energy).max() < 1e-4 * np.abs(run.history["total_energy"]).max()


@pytest.mark.parametrize("order, fewest", [(2, 8), (4, 2), (6, 1)])
def test_orders_are_kept_across_periods(order, fewest):
    """Of a mass on a spring under a force that is held: a circle about F/k in each period."""
    keys = {} if order == 2 else {"method": "explicit", "order": order}
    tables = {
        "web": {**nets.SLACK_LINE["web"], "natural_length": [0.5]},
        "cable": {**nets.SLACK_LINE["cable"], "law": "linear"},
        "accuracy": {"error": "none"},
    }
    stiffness, mass = 1e6 * 1e-4 / 0.5, 1.0 + 0.5 * 100.0 * 1e-4 * 0.5
    rate, x, v = np.sqrt(stiffness / mass), 0.0, 0.0
    cosine, sine = np.cos(0.05 * rate), np.sin(0.05 * rate)
    for _ in range(20):
        middle = (40.0 * (0.3 - x) - 6.0 * v) / stiffness
        x, v = middle + (x - middle) * cosine + v / rate * sine, v * cosine - rate * (x - middle) * sine
    errors = []
    for steps in (fewest, 2 * fewest, 4 * fewest):
        solve = {"kind": "dynamic", "duration": 1.0, "step_size": 0.05 / steps, **keys}
        history = refweb.run(scene(solve=solve, **tables)).history
        errors.append(np.hypot(history["x"][-1] - x, (history["vx"][-1] - v) / rate))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.abs(orders - order).max() < 0.3 and errors[0] < 0.01


def test_rows_between_periods_change_nothing():
    """Steps of the same size, with rows five times as often."""
    one, other = refweb.run(scene()), refweb.run(scene(interval=0.01))
    np.testing.assert_allclose(other.history["x"][::5], one.history["x"], atol=1e-13)


def test_an_integral_takes_away_what_a_steady_load_leaves():
    """A spring alone leaves F/k; the integral brings it to zero, and waits while the limit acts."""
    steady = {"load": [{"node": 1, "force": [0, 0, 0]}, {"node": 1, "force": [4.0, 0, 0]}], "duration": 12.0}
    left = refweb.run(scene(target_of(0.0), **steady)).history["x"][-1]
    np.testing.assert_allclose(left, 4.0 / 40.0, rtol=1e-6)
    law = {"law": "pid", "parameters": {"proportional": 40.0, "derivative": 12.0, "integral": 30.0}}
    none = refweb.run(scene(target_of(0.0), law=law, **steady)).history["x"][-1]
    assert abs(none) < 1e-4
    limited = refweb.run(scene({"target": 1.0, "limit": 3.0}, law=law, duration=3.0))
    state = {"sum": 0.0, "limited": False}

    def act(x, v, n):
        force = 40.0 * (1.0 - x) + 30.0 * state["sum"] - 12.0 * v
        state["sum"] += 0.0 if state["limited"] else 0.05 * (1.0 - x)
        state["limited"] = abs(force) > 3.0
        return float(np.clip(force, -3.0, 3.0))

    x, _, forces = held(act, 60)
    np.testing.assert_allclose(limited.history["x"], x, atol=1e-11)
    assert limited.controls[0]["largest"] == 3.0 and np.abs(forces).min() < 3.0


def target_of(value):
    return {"target": value}


def test_bang_bang_needs_the_least_time():
    """From rest over d with ± U: 2 √(d m/U), half of it speeding up."""
    size, way = 4.0, 0.5
    law = {"law": "bang-bang", "parameters": {"strength": size, "mass": MASS}}
    least = 2.0 * np.sqrt(way * MASS / size)
    run = refweb.run(scene({"period": least / 200.0, "target": way}, duration=least, law=law))
    np.testing.assert_allclose(run.history["x"][-1], way, atol=0.02 * way)  # a period of 200 late
    np.testing.assert_allclose(run.history["vx"][100], np.sqrt(way * size / MASS), rtol=0.02)
    np.testing.assert_allclose(run.controls[0]["spent"], size * least, rtol=1e-9)


@pytest.mark.slow
def test_sliding_mode_reaches_its_surface_in_the_time_of_its_strength():
    """s = e' + λ e falls from s₀ by U/m − λ v; with λ v small beside it, in |s₀| m/U; then e falls by exp(−λ t)."""
    strength, slope, begin = 20.0, 2.0, 0.1
    law = {"law": "sliding-mode", "parameters": {"strength": strength, "slope": slope, "width": 0.02}}
    run = refweb.run(scene({"period": 1e-3, "target": begin}, duration=2.0, law=law))
    surface = -run.history["vx"] + slope * (begin - run.history["x"])
    # In the approach s' = −U/m − λ v with v = U t/m: s = s₀ − U/m (t + λ t²/2).
    rate = strength / MASS
    reached = (np.sqrt(1.0 + 2.0 * slope * slope * begin / rate) - 1.0) / slope
    first = run.history["time"][np.argmax(surface < 0.02)]
    assert abs(first - reached) < 0.02 / rate + 2e-3
    later = run.history["time"] > 0.5
    decay = -np.polyfit(run.history["time"][later], np.log(begin - run.history["x"][later]), 1)[0]
    assert abs(decay - slope) < 0.02 and np.abs(surface[later]).max() < 0.02
    # U in the approach, then m λ² e, of which the integral is m λ e; the layer of 0.02 is a fifth of s₀.
    error = begin - 0.5 * rate * reached**2
    spent = strength * reached + MASS * slope * error * (1.0 - np.exp(-slope * (2.0 - reached)))
    assert run.controls[0]["spent"] == pytest.approx(spent, rel=0.05)


def drum(law, duration, **control):
    body = {
        "name": "drum", "shape": "sphere", "radius": 0.1, "mass": 2.0, "position": [0, 5, 0],
        "axle": {"direction": [0, 0, 1], "torque": 0.0},
    }  # fmt: skip
    observe = [
        {"name": "turn", "quantity": "axle_angle", "body": "drum"},
        {"name": "speed", "quantity": "angular_velocity", "body": "drum", "component": "z"},
    ]
    hub = {"name": "hub", "sets": "body.drum.axle.torque", "period": 0.01, "measures": ["speed"], "rates": []}
    return refweb.run(scene({**hub, "direction": None, **law, **control}, duration, body=[body], observe=observe))


def test_spin_up_is_exponential():
    """I ω' = M₀ (1 − ω/ω₀), held between periods: ω₀ − ω falls by 1 − T M₀/(I ω₀) in each."""
    law = {"law": "spin-up", "parameters": {"strength": 0.02}, "target": 5.0}
    run = drum(law, 2.0)
    share = 1.0 - 0.01 * 0.02 / (0.4 * 2.0 * 0.01 * 5.0)
    np.testing.assert_allclose(run.history["speed"], 5.0 * (1.0 - share ** np.arange(201)), atol=1e-10)
    assert run.controls[0]["unit"] == "N m s"


@pytest.mark.filterwarnings("error")
def test_a_spin_up_whose_target_passes_zero_is_refused_at_its_time():
    law = {"law": "spin-up", "parameters": {"strength": 0.02}}
    with pytest.raises(refweb.SolverError, match=r'"hub" at t = 0.1 s: .* the target is 0, and must not be'):
        drum(law, 0.2, target=[[0.0, 1.0], [0.1, 0.0], [1.0, 0.0]])


def test_attitude_of_a_hub():
    """PD about its axle, with a table as target; its rate by differences."""
    law = {"law": "pid", "parameters": {"proportional": 0.8, "derivative": 0.1}}
    run = drum(law, 4.0, measures=["turn"], rates=["speed"], target=[[0.0, 0.0], [1.0, 1.5], [2.0, 1.5]])
    np.testing.assert_allclose(run.history["turn"][-1], 1.5, atol=1e-4)
    inertia, turn, speed, before, moments = 0.4 * 2.0 * 0.01, 0.0, 0.0, 0.0, []
    for n in range(400):
        target = np.interp(0.01 * n, [0.0, 1.0, 2.0], [0.0, 1.5, 1.5])
        moments.append(0.8 * (target - turn) + 0.1 * ((target - before) / 0.01 - speed))
        rate, before = moments[-1] / inertia, target
        turn, speed = turn + 0.01 * speed + 0.5 * 0.01**2 * rate, speed + 0.01 * rate
    np.testing.assert_allclose(run.history["turn"][-1], turn, atol=1e-11)
    np.testing.assert_allclose(run.controls[0]["spent"], 0.01 * np.abs(moments).sum(), rtol=1e-9)


def test_station_keeping_leaves_a_dead_band():
    law = {"law": "station-keeping", "parameters": {"proportional": 40.0, "derivative": 8.0, "dead_band": 0.052}}
    start = [{"node": 1, "value": [0.1, 0.0, 0.0]}]
    run = refweb.run(scene({"target": 0.0}, law=law, velocity=start, duration=3.0))

    def act(x, v, n):
        return -40.0 * x - 8.0 * v if abs(x) > 0.052 else 0.0

    x, _, forces = held(act, 60, start=(0.0, 0.1))
    np.testing.assert_allclose(run.history["x"], x, atol=1e-11)
    assert (forces == 0.0).any() and (forces != 0.0).any()


def test_three_components_follow_observables_and_a_delay():
    """A vector with targets that are observables; what is measured acts two periods later."""
    keys = {"measures": ["x", "y", "z"], "rates": ["vx", "vy", "vz"], "target": ["x", "y", "z"], "direction": None}
    still = refweb.run(scene({key: value for key, value in keys.items() if value} | {"name": "s"}, law=no_direction()))
    assert np.abs(still.history["x"]).max() == 0.0
    late = refweb.run(scene({"delay": 0.1}))
    seen = []

    def act(x, v, n):
        seen.append((x, v))
        then = seen[max(n - 2, 0)]
        return 40.0 * (0.3 - then[0]) - 6.0 * then[1]

    x, _, _ = held(act, 20)
    np.testing.assert_allclose(late.history["x"], x, atol=1e-11)


def no_direction():
    return {**PID, "direction": None}


def test_noise_follows_the_seed():
    """The same runs again, others with another seed; of the size that is asked for."""
    noisy = scene({"noise": 0.01, "rates": ["vx"]})
    one, same, other = refweb.run(noisy), refweb.run(noisy), refweb.run(noisy.replace(seed=3))
    np.testing.assert_array_equal(one.history["x"], same.history["x"])
    assert np.abs(one.history["x"] - other.history["x"]).max() > 1e-4
    quiet = refweb.run(scene())
    assert 1e-4 < np.abs(one.history["x"] - quiet.history["x"]).max() < 0.1


OWN = """
import numpy as np

class Spring:
    def __init__(self, stiffness=1.0):
        self.stiffness = stiffness
    def reset(self):
        self.count = 0
    def act(self, measurement, time):
        self.count += 1
        if self.count == {fails}:
            {failure}
        return self.stiffness * measurement.error
    def save(self):
        return [self.count]
    def restore(self, numbers):
        self.count = int(numbers[0])
"""


def own(folder, failure="pass", fails=5, saves=True):
    text = OWN.replace("{fails}", str(fails)).replace("{failure}", failure)
    (folder / "spring.py").write_text(text if saves else text[: text.index("    def save")])
    law = {"law": f"{folder / 'spring.py'}:Spring", "parameters": {"stiffness": 20.0}}
    return scene(law=law)


def test_a_law_of_ones_own(tmp_path):
    run = refweb.run(own(tmp_path), tmp_path / "out")
    x, _, _ = held(lambda x, v, n: 20.0 * (0.3 - x), 20)
    np.testing.assert_allclose(run.history["x"], x, atol=1e-12)
    again = refweb.load(tmp_path / "out")
    assert again.controls == run.controls
    (term,) = [term for term in again.state.system.terms if term.name == "load"]
    np.testing.assert_allclose(again.state.system.force_of(term, 1.0, again.state.x)[1, 0], 20.0 * (0.3 - x[-2]))


@pytest.mark.parametrize(
    "failure, words",
    [
        ("return 1 / 0", "its law failed with ZeroDivisionError"),
        ("return float('nan')", "act gave nan, must be a finite number"),
        ("return [1.0, 2.0]", "act gave [1.0, 2.0], must be a finite number"),
        ("return 'far'", "act gave 'far', must be a finite number"),
    ],
)
def test_a_law_that_fails_ends_with_one_line(tmp_path, failure, words):
    """With control, time and value; what was written stays."""
    with pytest.raises(refweb.SolverError, match=re.escape(words)) as error:
        refweb.run(own(tmp_path, failure), tmp_path / "out")
    assert '[[control]] "hover" at t = 0.2 s' in str(error.value) and "\n" not in str(error.value)
    assert summary_of(tmp_path / "out")["status"] == "failed"
    assert len((tmp_path / "out" / "history.csv").read_text().splitlines()) >= 4


def test_a_run_that_was_stopped_goes_on_bit_for_bit(tmp_path):
    """With the integral, the delayed measurements and the noise of its controls."""
    law = {"law": "pid", "parameters": {"proportional": 40.0, "derivative": 6.0, "integral": 9.0}}
    given = scene({"delay": 0.1, "noise": 1e-3}, law=law, interval=0.01).replace(
        output=refweb.Output(interval=0.01, frames=7)
    )
    whole, resumed = nets.whole_and_resumed(given, tmp_path)
    for name, values in whole.history.items():
        np.testing.assert_array_equal(resumed.history[name], values, err_msg=name)
    assert resumed.controls[0]["spent"] == whole.controls[0]["spent"]


def test_a_law_without_a_state_to_save_is_not_resumed(tmp_path):
    with pytest.raises(InputError, match=r"its law has no save\(\) and restore\(\): start the run again"):
        nets.whole_and_resumed(
            own(tmp_path, saves=False).replace(output=refweb.Output(interval=0.05, frames=3)), tmp_path
        )


def test_it_acts_in_runs_that_are_stepped():
    """Bit for bit, in a copy as well, and beside commands."""
    whole, run = refweb.run(scene()), refweb.start(scene())
    run.advance(0.5)
    branch = copy.deepcopy(run)
    for one in (run, branch):
        while not one.stopped:
            one.advance()
        np.testing.assert_array_equal(one.history["x"], whole.history["x"])
    two = scene(load=[{"node": 1, "force": [0, 0, 0]}, {"node": 1, "force": [0, 0, 0]}])
    run = refweb.start(two)
    run.advance(0.2)
    run.set("load.1.force", [3.0, 0.0, 0.0])
    run.advance(2.0)
    np.testing.assert_array_equal(run.finish().history["x"], run.history["x"])


def test_what_is_spent_ends_with_the_run():
    """An event within a period ends the integral as well; ± has the error of its time."""
    event = [{"name": "there", "kind": "threshold", "observe": "x", "value": 0.2, "stop": True}]
    run = refweb.run(scene(event=event, solve={"kind": "dynamic", "duration": 1.0, "method": "ida", "rtol": 1e-7}))
    _, _, forces = held(lambda x, v, n: 40.0 * (0.3 - x) - 6.0 * v, 20)
    end, sizes = run.events[0]["time"], np.abs(forces)
    whole = int(end / 0.05)
    assert whole < 19 and abs(end - 0.05 * whole) > 1e-3
    exact = 0.05 * sizes[:whole].sum() + (end - 0.05 * whole) * sizes[whole]
    assert abs(run.controls[0]["spent"] - exact) <= run.controls[0]["error"] + 1e-6 < 1e-2


SPENT = [
    {"name": "x", "quantity": "displacement", "node": 1, "component": "x"},
    {"name": "vx", "quantity": "velocity", "node": 1, "component": "x"},
    {"name": "fuel", "quantity": "fuel", "control": "hover"},
    {"name": "delta_v", "quantity": "delta_v", "control": "hover"},
]


@pytest.mark.parametrize("method", ["central-difference", "ida"])
def test_fuel_over_time(method):
    """∫ abs(F) dt in each row, over the point mass; it ends a run where it reaches a limit, linear between periods."""
    keys = {} if method == "central-difference" else {"method": method, "rtol": 1e-7}
    _, _, forces = held(lambda x, v, n: 40.0 * (0.3 - x) - 6.0 * v, 20)
    exact = np.append(0.0, 0.05 * np.cumsum(np.abs(forces)))
    event = [{"name": "empty", "kind": "threshold", "observe": "fuel", "value": 2.0, "stop": True}]
    heavy = [{"node": 1, "mass": 0.4}, {"node": 1, "mass": 0.6}]
    solve = {"kind": "dynamic", "duration": 1.0, **keys}
    run = refweb.run(scene(observe=SPENT, event=event, point_mass=heavy, solve=solve, interval=0.025))
    empty = np.interp(2.0, exact, 0.05 * np.arange(21))
    assert abs(run.events[0]["time"] - empty) <= run.events[0]["error"] + 1e-6
    times = run.history["time"]
    tight = 1e-9 if method == "central-difference" else 1e-3
    np.testing.assert_allclose(run.history["fuel"], np.interp(times, 0.05 * np.arange(21), exact), atol=tight)
    np.testing.assert_allclose(run.history["delta_v"], run.history["fuel"] / 1.0, rtol=1e-12)
    fuel, (control,) = run.results["fuel"], run.controls
    np.testing.assert_allclose(fuel.value, control["spent"], rtol=1e-12)
    late = 3.0 * fuel.value / run.history["time"][-1] * 0.025  # explicit runs end with the step of an event
    assert abs(fuel.value - 2.0) <= fuel.error + 1e-9 < (late if tight < 1e-6 else 0.01) and fuel.unit == "N s"


def test_fuel_of_several_nodes_and_of_bodies(tmp_path):
    """That of a load on two nodes is twice that of one, and goes on bit for bit; Δv has their masses."""
    two = {"web": {"kind": "inline", "points": [[0, 0, 0], [0.5, 0, 0], [0.5, 1, 0]], "lines": [[0, 1], [0, 2]],
                   "natural_length": [50.0, 50.0], "supports": [0]},
           "load": [{"node": [1, 2], "force": [0.0, 0.0, 0.0]}],
           "point_mass": [{"node": 1, "mass": 1.0}, {"node": 2, "mass": 3.0}],
           "observe": SPENT, "output": {"interval": 0.05, "frames": 7}}  # fmt: skip
    whole, resumed = nets.whole_and_resumed(refweb.Scene.from_dict(scene().to_dict() | two), tmp_path)
    np.testing.assert_allclose(whole.history["fuel"][-1], 2.0 * whole.controls[0]["spent"], rtol=1e-12)
    np.testing.assert_allclose(whole.history["delta_v"], whole.history["fuel"] / 4.0, rtol=1e-12)
    for name in ("x", "fuel", "delta_v"):
        np.testing.assert_array_equal(resumed.history[name], whole.history[name])
    body = {"name": "ship", "shape": "box", "size": [1, 1, 1], "mass": 8.0, "position": [0, 5, 0]}
    place = [{"name": "x", "quantity": "position", "body": "ship", "component": "x"}, *SPENT[2:]]
    load = [{"body": "ship", "force": [0.0, 0.0, 0.0]}]
    run = refweb.run(scene({"rates": []}, body=[body], load=load, observe=place))
    np.testing.assert_allclose(run.history["delta_v"], run.history["fuel"] / 8.0, rtol=1e-12)
    np.testing.assert_allclose(run.history["fuel"][-1], run.controls[0]["spent"], rtol=1e-12)


FUELS = [
    ({"control": "hovre"}, 'control = "hovre" is not a [[control]], did you mean "hover"'),
    ({}, 'control is missing: quantity = "fuel"'),
    ({"quantity": "delta_v", "control": "hover"}, 'quantity = "delta_v" needs a mass: give node = 1 a [[point_mass]]'),
]


@pytest.mark.parametrize("keys, words", FUELS, ids=[words for _, words in FUELS])
def test_fuel_that_is_none_is_refused(keys, words):
    given = scene(observe=SPENT).to_dict()
    del given["point_mass"]
    given["observe"] = [*SPENT[:2], {"name": "fuel", "quantity": "fuel", **keys}]
    with pytest.raises(InputError, match=re.escape(words)):
        refweb.Scene.from_dict(given).build()


def test_fuel_of_nodes_that_nothing_flies_is_refused():
    """A supported node and one on a rail differ; Δv of a node that a body carries would be that of its point mass."""
    both = [{"node": [0, 1], "force": [0.0, 0.0, 0.0]}]
    with pytest.raises(InputError, match=r"node 0 is supported .* leave it out of node = \[0, 1\]"):
        scene(observe=SPENT, load=both).build()
    rail = [{"nodes": [0], "components": ["y", "z"]}]
    free = {**nets.SLACK_LINE["web"], "supports": []}
    scene(observe=SPENT, load=both, web=free, support=rail).build()
    with pytest.raises(InputError, match="node 0 is supported or moved by a table along x, so that no thrust flies"):
        scene(observe=SPENT, load=both, web=free, support=[{"nodes": [0], "components": ["x"]}]).build()
    given = scene(observe=SPENT, load=both, web=free, support=[{"nodes": [0], "components": ["x"]}]).to_dict()
    given["control"][0] |= {"measures": ["x", "y", "z"], "rates": [], "target": ["x", "y", "z"]}
    given["control"][0] |= {"law": "pid", "parameters": {"proportional": 1.0}}
    given["observe"] = [*scene().to_dict()["observe"], *SPENT[2:3]]
    del given["control"][0]["direction"]
    refweb.Scene.from_dict(given).build()  # node 0 flies along y and z
    ship = {"name": "ship", "shape": "box", "size": [1, 1, 1], "mass": 8.0, "position": [0.5, 0, 0]}
    carried = dict(body=[ship], attach=[{"body": "ship", "node": 1}], point_mass=[{"node": 1, "mass": 1.0}])
    with pytest.raises(InputError, match='"delta_v" has no meaning for node = 1, which a body carries'):
        scene(observe=SPENT, **carried).build()
    scene(observe=SPENT[:3], **carried).build()


def test_fuel_of_what_is_no_force_is_refused():
    with pytest.raises(InputError, match="sets gravity.acceleration, which is no force"):
        fuel = [*SPENT[:2], {"name": "fuel", "quantity": "fuel", "control": "hover"}]
        scene({"sets": "gravity.acceleration"}, gravity={"acceleration": [0, 0, 0]}, observe=fuel).build()


def test_a_switch_within_its_error_is_told():
    """At rest at its target the number whose sign decides is zero."""
    law = {"law": "bang-bang", "parameters": {"strength": 1.0, "mass": MASS}}
    doubt, sure = (refweb.run(scene({"target": target}, law=law, duration=0.2)) for target in (0.0, 5.0))
    assert "switch-in-doubt" in [finding.code for finding in doubt.findings]
    assert "switch-in-doubt" not in [finding.code for finding in sure.findings]


def test_one_value_is_set_by_one():
    """Two controls, commands, and a factor of the load are refused beside a control of it."""
    two = scene().to_dict()
    two["control"] = [two["control"][0], {**two["control"][0], "name": "second"}]
    with pytest.raises(InputError, match='sets = "load.0.force" is set by "hover" already'):
        refweb.Scene.from_dict(two).build()
    with pytest.raises(InputError, match=r'load.0.force is set by \[\[control\]\] "hover"'):
        refweb.run(scene(), commands=[(0.1, "load.0.force", [0, 0, 1])])
    with pytest.raises(InputError, match=r'load.0.force is set by \[\[control\]\] "hover"'):
        refweb.start(scene()).set("load.0.force", [0, 0, 1])
    with pytest.raises(InputError, match="its factor would multiply what is set"):
        scene(load=[{"node": 1, "force": [0, 0, 0], "factor": [[0, 1], [1, 2]]}]).build()
    for wrong in ((1,), "abc", ("soon", "load.0.force", 1.0)):
        with pytest.raises(InputError, match=r"must be \(time, path, value\)"):
            refweb.run(scene(control=[]).replace(control=()), commands=[wrong])


WRONG = [
    ({"law": "bang-bang", "parameters": {"strength": 0.0, "mass": 1.0}}, "strength = 0 must be > 0"),
    ({"law": "sliding-mode", "parameters": {"strength": 1.0, "slope": 1.0, "width": 0.0}}, "width = 0 must be > 0"),
    ({"law": "spin-up", "parameters": {"strength": 1.0}, "target": 0.0}, "target = 0 must not be zero"),
    ({"law": "pdi"}, 'did you mean "pid"'),
    ({"angle": 1.5708}, "angle = 1.5708 must be ≤ 1.57079632679"),
    ({"parameters": {"proportionel": 1.0}}, 'did you mean "proportional"'),
    ({"law": "bang-bang", "parameters": {}}, "parameters.strength is missing"),
    ({"measures": ["xx"]}, "is not an observable"),
    ({"measures": ["x", "y"], "rates": []}, "must be one name, three of a vector, or four"),
    ({"sets": "load.1.force"}, "is not the number or name of a [[load]]"),
    ({"sets": "laod.0.force"}, 'did you mean "load"'),
    ({"direction": None}, "direction is missing"),
    ({"direction": [0, 0, 0]}, "must not be zero"),
    ({"period": 0.03, "interval": 0.02}, "period = 0.03 must be a multiple of [output] interval = 0.02"),
    ({"delay": 0.07}, "delay = 0.07 must be a multiple of period = 0.05"),
    ({"target": [1.0, 2.0]}, "target = [1.0, 2.0] has 2 values, and measures has 1"),
    ({"target": ["z", "q"]}, "has 2 values"),
    ({"law": "nothing.py:Law"}, "cannot be read"),
    ({"period": 0.0}, "period"),
]


@pytest.mark.parametrize("control, words", WRONG, ids=[words for _, words in WRONG])
def test_what_does_not_fit_is_refused(control, words):
    control = {**PID, **control}
    interval = control.pop("interval", None)
    with pytest.raises(InputError, match=re.escape(words)):
        scene({key: value for key, value in control.items()}, interval=interval, law={}).build()


def test_the_horizon_has_what_feedback_makes_of_differences():
    """A force that drives away from the target: all differences grow as the held motion from rest does."""
    law = {"law": "pid", "parameters": {"proportional": -90.0}}
    loop = np.array([[1.0, 0.05], [0.0, 1.0]]) + np.outer([0.5 * 0.05**2, 0.05], [90.0, 0.0]) / MASS
    ways = [np.linalg.matrix_power(loop, n)[0, 0] for n in range(31)]
    accuracy = {"horizon": True, "ensemble": 3}
    away = {"measures": ["x", "y", "z"], "rates": [], "target": [-1e-6, 0.0, 0.0]}
    driven = refweb.run(scene(away, law=law | {"direction": None}, duration=1.5, accuracy=accuracy))
    rate = np.polyfit(0.05 * np.arange(31), np.log(ways), 1)[0]
    np.testing.assert_allclose(driven.horizon["growth"], rate, rtol=1e-3)
    spread = driven.horizon["ensemble"]["x"]
    assert 0.0 < spread["deviation"] < driven.horizon["perturbation"] * ways[-1]
    np.testing.assert_allclose(spread["mean"], driven.results["x"].value, rtol=1e-3)
    # Across x nothing acts: differences stay.
    led = refweb.run(scene(duration=1.5, accuracy={"horizon": True}))
    assert abs(led.horizon["growth"]) < 1e-6 and led.horizon["digits"][-1] == (1, None)


def test_all_parts_of_the_error_beside_controls():
    """Further runs have their own controls, and leave results and what is spent as they are."""
    given = scene(observe=SPENT)
    whole, trusted = refweb.run(given), refweb.trust(given, budget=20.0, progress=None)
    for name, result in whole.results.items():
        assert trusted.results[name].value == result.value
        assert trusted.results[name].verdict is not None
    assert trusted.controls == whole.controls and trusted.horizon["growth"] is not None


def test_what_has_no_controls_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"\[\[control\]\] cannot be compared by all methods"):
        refweb.cost(scene())
    with pytest.raises(InputError, match=r'\[\[control\]\] "hover" has no meaning in statics'):
        scene(solve={"kind": "static"})
    twice = scene().to_dict()
    twice["control"] *= 2
    with pytest.raises(InputError, match=r'\[\[control\]\] 2 name = "hover" is already used'):
        refweb.Scene.from_dict(twice).build()
    assert not list(pathlib.Path(tmp_path).iterdir())
