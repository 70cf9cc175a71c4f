"""Environments of scenes: closed forms of a free mass, seeds, ends, failures, Gymnasium's checker, vectors, images."""

import re
import subprocess
import sys
import warnings

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env  # noqa: E402

import refweb  # noqa: E402
from refweb.errors import InputError, SolverError  # noqa: E402
from refweb.gym import SHIPPED, SceneEnv  # noqa: E402

MASS, FORCE, PERIOD = 2.0, 3.0, 0.1
TASK = {
    "period": PERIOD,
    "reward": "10*v.before - abs(x) + (time > 0.25) + load.0.force[0]",
    "inputs": {"load.0.force": [[-FORCE, 0.5, 0.0], [FORCE, 0.5, 0.0]]},
    "observations": {"x": [-1.0, 1.0], "v": [-9.0, 9.0]},
}


def scene(task=(), duration=0.5, **tables):
    """A mass that nothing holds, with a slack rope of next to no mass, and its load."""
    given = {
        "web": {"kind": "inline", "points": [[0, 0, 0], [0.5, 0, 0]], "lines": [[0, 1]], "natural_length": [50.0]},
        "cable": {"law": "tension-only", "modulus": 1e6, "area": 1e-4, "density": 1e-6},
        "supports": {"nodes": [0]},
        "point_mass": [{"node": 1, "mass": MASS}],
        "velocity": [{"node": 1, "value": [0.0, 0.0, 0.0]}],
        "load": [{"node": 1, "force": [0.0, 0.0, 0.0]}] * 2,
        "observe": [
            {"name": "x", "quantity": "displacement", "node": 1, "component": "x"},
            {"name": "v", "quantity": "velocity", "node": 1, "component": "x"},
            {"name": "y", "quantity": "displacement", "node": 1, "component": "y"},
        ],
        "solve": {"kind": "dynamic", "duration": duration},
        "gym": {**TASK, **dict(task)},
    }
    return refweb.Scene.from_dict({**given, **tables})


def episode(env, seed=None, options=None, scale=0.3):
    """Observations, rewards and ends of an episode of random actions that follow from the seed alone."""
    random = np.random.default_rng(seed)
    observation, info = env.reset(seed=seed, options=options)
    rows = [(observation, 0.0, False, False, info)]
    while not (rows[-1][2] or rows[-1][3]):
        rows.append(env.step(scale * random.uniform(-1.0, 1.0, env.action_space.shape)))
    return rows


def assert_same(rows, others):
    """Bit for bit."""
    for row, other in zip(rows, others, strict=True):
        np.testing.assert_array_equal(row[0], other[0])
        assert row[1:] == other[1:]


def test_a_free_mass_is_a_double_integrator():
    """Held between periods: matrices are exact, and so are steps at constant force. Rewards follow from the states."""
    env = SceneEnv(scene())
    observation, info = env.reset(seed=1)
    assert info == {"time": 0.0, "values": {}} and env.action_space.shape == (1,)
    x = v = 0.0
    for n, action in enumerate([1.0, -0.25, 3.0, 0.5, -1.0], start=1):  # 3 is set to 1
        force = FORCE * min(action, 1.0)
        reward = 10.0 * v + (n > 2) + force
        x, v = x + PERIOD * v + 0.5 * PERIOD**2 * force / MASS, v + PERIOD * force / MASS
        observation, found, terminated, truncated, info = env.step(np.array([action], dtype=np.float32))
        # Half of the line's mass, 2.5e-9 kg, is with the point mass.
        np.testing.assert_allclose(observation, [x, v], rtol=1e-8, atol=1e-12)
        assert found == pytest.approx(reward - abs(x), rel=1e-8) and not terminated and truncated == (n == 5)
    assert info["time"] == 0.5 and 0.0 <= info["energy_drift"] < 1e-9 and info.keys() == {"time", "energy_drift"}
    assert env.run.observe("y") == pytest.approx(0.5 * 0.5**2 * 0.5 / MASS, rel=1e-8)  # the constant component
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
        env.step(np.zeros(1))


def test_observations_stay_within_their_bounds():
    env = SceneEnv(scene({"observations": {"v": [-0.1, 0.1]}}))
    env.reset()
    observation, *_ = env.step(np.ones(1))
    assert observation.tolist() == [0.1] and env.run.observe("v") == pytest.approx(PERIOD * FORCE / MASS)
    unbounded = SceneEnv(scene({"observations": ["v", "x"]})).observation_space
    assert np.isinf(unbounded.high).all() and unbounded.shape == (2,)


FAR = {"name": "far", "kind": "threshold", "observe": "v", "value": 0.2, "stop": True}


def test_ends():
    """By success, by another condition, by an event, which is part of the task, and at the end of the duration."""
    fast = np.ones(1)
    for task, tables, expected in [
        ({"terminated": "v > 0.2"}, {}, (True, False, 2)),
        ({"truncated": "v > 0.2"}, {}, (False, True, 2)),
        ({"terminated": "v > 0.2", "truncated": "v > 0.2"}, {}, (True, False, 2)),
        ({}, {"event": [FAR]}, (True, False, 2)),
        ({}, {}, (False, True, 5)),
        ({"period": 0.2}, {"output": {"interval": 0.1}}, (False, True, 3)),
    ]:
        env, count, ended = SceneEnv(scene(task, **tables)), 0, False
        env.reset()
        while not ended:
            _, _, terminated, truncated, info = env.step(fast)
            count, ended = count + 1, terminated or truncated
        assert (terminated, truncated, count) == expected
        assert info.get("event") == ("far" if "event" in tables else None)


DRAWN = {
    "draw": {
        "velocity.0.value.0": {"from": -0.5, "to": 0.5},
        "load.1.force.2": [1.0, 2.0],
        "velocity.0.value.1": {"distribution": "norm", "loc": 0.0, "scale": 0.1},
    }
}


@pytest.mark.parametrize("draw", [DRAWN["draw"], {"point_mass.0.mass": {"from": 1.0, "to": 3.0}}])
def test_an_episode_follows_from_its_seed(draw):
    """On an environment that has had others before, whose system is used again, as on a new one."""
    task = {"draw": draw, "inputs": {"load.0.force": [[-FORCE, 0.5, 0.0], [FORCE, 0.5, 0.5]]}}
    used, new = SceneEnv(scene(task)), SceneEnv(scene(task))
    first = episode(used, seed=1)
    for seed in (2, 3):
        rows = episode(used, seed=seed)
        assert rows[0][4]["values"] != first[0][4]["values"]
    assert_same(episode(used, seed=1), first)
    assert_same(episode(new, seed=1), first)
    (start,) = {row[4]["values"]["velocity.0.value.0"] for row in first[:1]} if "velocity.0.value.0" in draw else {0.0}
    assert first[0][0][1] == start  # the drawn velocity is that of the first observation
    used.reset(seed=1)
    drawn = used.reset()[1]["values"]  # goes on with the generator
    assert drawn.keys() == draw.keys() and drawn != first[0][4]["values"]


def test_draws_are_those_of_studies():
    """Ranges, whose ends are kept, distributions and lists; by Kolmogorov and Smirnov, with a fixed seed."""
    from scipy import stats

    gym, random = scene(DRAWN).gym, np.random.default_rng(5)
    draws = [gym.drawn(random) for _ in range(400)]
    columns = {path: np.array([draw[path] for draw in draws]) for path in DRAWN["draw"]}
    assert stats.kstest(columns["velocity.0.value.0"] + 0.5, "uniform").pvalue > 0.05
    assert stats.kstest(columns["velocity.0.value.1"] / 0.1, "norm").pvalue > 0.05
    ones = int((columns["load.1.force.2"] == 1.0).sum())
    assert set(columns["load.1.force.2"]) == {1.0, 2.0} and stats.binomtest(ones, 400, 0.5).pvalue > 0.05


def test_options_and_values():
    env = SceneEnv(scene(DRAWN), values={"point_mass.0.mass": 4.0})
    options = {"set": {"velocity.0.value": [0.25, 0.0, 0.0]}, "draw": {"point_mass.0.mass": [1.0]}}
    _, info = env.reset(seed=1, options=options)
    assert info["values"] == {"point_mass.0.mass": 1.0, "velocity.0.value": [0.25, 0.0, 0.0]}
    assert env.run.observe("v") == 0.25
    env.step(np.zeros(1))
    env.reset(seed=1, options={"draw": {}, "set": {"velocity.0.value": [0.0, 0.0, 0.0]}})
    env.step(np.ones(1))
    assert env.run.observe("v") == pytest.approx(PERIOD * FORCE / 4.0, rel=1e-8)
    for options, message in [
        ({"draws": {}}, 'options: "draws" is none, did you mean "draw"'),
        ({"set": {"velocity.7.value": [1, 0, 0]}, "draw": {"point_mass.0.mass": [1.0]}}, "velocity.7"),
        ({"set": {"velocity.0.value": [1, 0, 0]}}, "options: velocity.0.value.0 is a part of velocity.0.value: give"),
        ({"set": {"gym.reward": "1"}}, "options: gym.reward: [gym] is the same in all episodes"),
        ({"draw": {"load.0.force.2": [1.0]}}, "options: load.0.force.2 is set by the agent"),
        ({"draw": {"velocity.0.value.0": {"from": 1}}}, "draw: velocity.0.value.0: to is missing"),
    ]:
        with pytest.raises(InputError, match=re.escape(message)):
            env.reset(options=options)
    with pytest.raises(InputError, match="mass"):
        env.reset(options={"set": {"point_mass.0.mass": -1.0}})
    assert SceneEnv(scene(), values={"gym.period": 0.2}).gym.period == 0.2
    assert SceneEnv("corner-control", values={"gym.period": 0.3}).gym.period == 0.3


def test_a_reset_that_is_refused_leaves_nothing_behind():
    env = SceneEnv(scene())
    env.reset()
    with pytest.raises(InputError, match="supported"):
        env.reset(options={"set": {"velocity.0": {"node": 0, "value": [1.0, 0.0, 0.0]}}})
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(1))
    assert_same(episode(env, seed=1), episode(SceneEnv(scene()), seed=1))


TAUT = {"kind": "inline", "points": [[0, 0, 0], [0.5, 0, 0]], "lines": [[0, 1]], "natural_length": [0.4]}
COARSE = {"kind": "dynamic", "duration": 5.0, "safety": 1.0}
FAILURES = [
    ({"reward": "1/(time < 0.15)"}, {}, "reward = .* is nan at t = 0.2 s"),
    ({"terminated": "x/(time < 0.15) > 1e9"}, {}, "terminated = .* is nan at t = 0.2 s"),
    ({"truncated": "not sqrt(0.15 - time) < 5"}, {}, "truncated = .* is nan at t = 0.2 s"),
    ({}, {"web": TAUT, "solve": COARSE}, "energy drift"),  # a spring in steps of the length of its stability
]


@pytest.mark.parametrize("task, tables, message", FAILURES)
def test_a_run_that_fails_ends_its_episode(task, tables, message):
    """With the last observation and the reward that the scene names; or it raises, and an episode can follow."""
    env = SceneEnv(scene({"failure_reward": -7.0, **task}, **tables))
    action = np.ones(env.action_space.shape)
    for _ in range(2):
        env.reset()
        while True:
            observation, reward, terminated, truncated, info = env.step(action)
            assert np.isfinite(observation).all() and np.isfinite(reward)
            if terminated or truncated:
                break
        assert terminated and not truncated and reward == -7.0 and re.search(message, info["failure"])
        assert env.observation_space.contains(observation)
        with pytest.raises(gymnasium.error.ResetNeeded):
            env.step(action)
    raising = SceneEnv(scene({"raise_failure": True, **task}, **tables))
    raising.reset()
    with pytest.raises(SolverError, match=message):
        while True:
            raising.step(action)


@pytest.mark.ordinary("cvode")
@pytest.mark.parametrize("method", ["central-difference", "cvode"])
def test_a_period_has_a_budget(method):
    """A run that is too slow ends its episode with a reason, and the next one can begin; one in time is the same."""
    slow = {"web": {**TAUT, "natural_length": [0.5]}, "solve": {"kind": "dynamic", "duration": 5.0, "method": method}}
    slow["solve"] |= {"step_size": 1e-9} if method == "central-difference" else {"rtol": 1e-13}
    env = SceneEnv(scene({"budget": 1e-3, "failure_reward": -7.0}, **slow))
    for _ in range(2):
        env.reset()
        observation, reward, terminated, truncated, info = env.step(np.ones(1))
        assert (reward, terminated, truncated) == (-7.0, True, False) and np.isfinite(observation).all()
        assert re.search(r"from t = 0 s on takes more than budget = 0.001 s of CPU time", info["failure"])
    assert_same(episode(SceneEnv(scene({"budget": 1e3})), seed=1), episode(SceneEnv(scene()), seed=1))


def test_an_episode_has_results_with_errors():
    """`finish` repeats it with its commands; a reset forgets them."""
    env = SceneEnv(scene(DRAWN))
    rows = episode(env, seed=4)
    solution = env.run.finish()
    assert solution.results["v"].value == rows[-1][0][1] and solution.results["v"].error is not None
    assert len(env.run.commands) == 5
    env.reset(seed=4)
    assert env.run.commands == []


@pytest.mark.parametrize("task", [{"terminated": "v > 0.2"}, {"truncated": "v > 0.2"}, {"reward": "1/(v < 0.2)"}])
def test_results_are_those_of_the_episode_that_is_over(task):
    """At its end, success, loss or failure, in closed form; not those of a motion that goes on to the duration."""
    env = SceneEnv(scene(task))
    env.reset()
    while not any(env.step(np.ones(1))[2:4]):
        pass
    results, acceleration = env.run.finish().results, FORCE / MASS
    assert env.run.stopped and env.run.time == 0.2 and results["v"].time == 0.2
    # Half of the line's mass, 2.5e-9 kg, is with the point mass.
    assert results["v"].value == pytest.approx(0.2 * acceleration, rel=1e-8) and results["v"].error is not None
    assert results["x"].value == pytest.approx(0.5 * acceleration * 0.2**2, rel=1e-8)
    env.reset()
    env.step(np.ones(1))
    assert env.run.finish().results["v"].time == 0.5  # this one is not over


def test_results_of_a_run_that_fails():
    """Until the row before, where an observation was given: of a spring, by cosines."""
    tables, stiffness = {"web": {**TAUT, "natural_length": [0.5]}, "solve": COARSE}, 1e6 * 1e-4 / 0.5
    env, ended = SceneEnv(scene({"inputs": {"load.0.force": [[-FORCE, 0, 0], [FORCE, 0, 0]]}}, **tables)), False
    env.reset()
    while not ended:
        _, _, ended, _, info = env.step(np.ones(1))
    end = env.run.history["time"][-1]
    x, found = FORCE / stiffness * (1.0 - np.cos(np.sqrt(stiffness / MASS) * end)), env.run.finish().results["x"]
    assert "energy drift" in info["failure"] and 0.0 < end == found.time < info["time"]
    assert abs(found.value - x) <= found.error < 0.1 * abs(x)


def test_wrong_actions():
    env = SceneEnv(scene())
    env.reset()
    for action in (np.zeros(2), np.array([np.nan]), np.zeros((1, 1))):
        with pytest.raises(InputError, match="must be 1 finite numbers"):
            env.step(action)
    assert env.run.time == 0.0


@pytest.mark.parametrize("name", SHIPPED)
def test_gymnasium_finds_nothing_to_warn_of(name):
    env = gymnasium.make(name)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
    assert env.spec.id == name and env.unwrapped.metadata["render_fps"] == 10


def test_an_id_imports_what_it_needs_and_any_scene_is_an_environment():
    with pytest.raises(InputError, match="scene is missing"):
        gymnasium.make("refweb/Scene-v0")
    env = gymnasium.make("refweb.gym:refweb/Scene-v0", scene=scene())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True, skip_close_check=True)


@pytest.mark.slow
def test_images():
    """Of its size, of different states, by one camera; the child that draws ends with the environment."""
    env = SceneEnv(scene(duration=50.0), render_mode="rgb_array", size=(120, 80))
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.render()
    env.reset()
    first = env.render()
    assert first.shape == (80, 120, 3) and first.dtype == np.uint8 and 1 < len(np.unique(first)) and first.max() == 255
    np.testing.assert_array_equal(env.render(), first)
    camera = env._images._stage.views[0]
    env.step(np.ones(1))
    near = env.render()
    assert (near != first).any() and env._images._stage.views[0] is camera
    for _ in range(40):
        env.step(np.ones(1))
    assert (env.render() != 255).any() and env._images._stage.views[0] is not camera  # it has left the view
    env.close()
    env.close()
    with pytest.warns(UserWarning, match="render_mode"):
        assert SceneEnv(scene()).render() is None


def test_vectors_of_environments():
    """In this process and in processes of their own: the same rows as one after the other."""
    actions = np.random.default_rng(1).uniform(-0.3, 0.3, (3, 2, 12)).astype(np.float32)
    found = {}
    for mode in ("sync", "async"):
        envs = gymnasium.make_vec("refweb.gym:refweb/CornerControl-v0", num_envs=2, vectorization_mode=mode)
        rows = [envs.reset(seed=[3, 4])[0]]
        for action in actions:
            observation, reward, terminated, truncated, _ = envs.step(action)
            rows += [observation, reward]
            assert not (terminated | truncated).any()
        envs.close()
        found[mode] = rows
    alone = SceneEnv("corner-control")
    alone.reset(seed=4)
    for n, action in enumerate(actions):
        observation, reward, *_ = alone.step(action[1])
        for rows in found.values():
            np.testing.assert_array_equal(rows[1 + 2 * n][1], observation)
            assert rows[2 + 2 * n][1] == reward


def test_corners_are_flown_to_their_targets():
    """By proportional and derivative feedback, critically damped at 1 rad/s, of 0.5 kg."""
    env = SceneEnv("corner-control")
    state, _ = env.reset(seed=2)
    targets, ended, rewards = np.array([[0.2, 0.2, 1], [-0.2, 0.2, 1], [0.2, -0.2, 1], [-0.2, -0.2, 1]]), False, []
    while not ended:
        corners = state.reshape(4, 6)
        force = 0.5 * ((targets - corners[:, :3]) - 2.0 * corners[:, 3:])
        state, reward, terminated, truncated, _ = env.step((force / 0.5).ravel())
        ended = terminated or truncated
        rewards.append(reward)
    # (1 + t) e^−t at 6 s is 0.017 of 1 m; the thrusters' limit and the net, a tenth of the mass, are the rest.
    assert np.abs(state.reshape(4, 6)[:, :3] - targets).max() < 0.1 and rewards[-1] > 0.95 > rewards[0]


def test_a_hub_deploys_its_web_by_a_torque_that_falls_with_its_speed():
    """M = M₀ (1 − ω/ω₀); without torque the arms take the spin of the hub, and it stands still."""

    def run(law):
        env, total, count, ended = SceneEnv("hub-deployment"), 0.0, 0, False
        state, _ = env.reset(seed=1)
        while not ended:
            state, reward, terminated, truncated, _ = env.step(np.array([law(state[0])]))
            total, count, ended = total + reward, count + 1, terminated or truncated
        return total, count, terminated

    total, count, terminated = run(lambda rate: 2.0 * (1.0 - rate / 2.0))
    assert count == 100 and not terminated and total > 90.0  # cos φ near 1 for most of the time
    _, count, terminated = run(lambda rate: 0.0)
    assert terminated and count < 20


def test_debris_is_caught_by_corners_that_fly_on_and_close():
    """By feedback to places beside it and then behind it; left alone, the net is still open after 4 s."""

    def run(law):
        env, ended = SceneEnv("net-capture"), False
        state, _ = env.reset(seed=3)
        while not ended:
            state, reward, terminated, truncated, _ = env.step(law(state))
            ended = terminated or truncated
        return env.run, reward, terminated

    def closing(state):
        corners, debris = state[:24].reshape(4, 6), state[24:]
        behind = corners[:, 2].min() > debris[2] + 0.3
        places = debris[:2] + (not behind) * np.array([[-2, -2], [2, -2], [-2, 2], [2, 2]])
        aside = 1.5 * (places - corners[:, :2]) - 1.5 * corners[:, 3:5]
        ahead = 2.0 * (debris[2] + 1.0 - corners[:, 2]) - 2.0 * (corners[:, 5] - debris[5])
        return np.column_stack([aside, ahead]).ravel() / 2.0

    caught, reward, terminated = run(closing)
    assert terminated and reward > 10.0 and caught.time < 4.0 and caught.observe("mouth") < 2.0
    left, reward, terminated = run(lambda state: np.zeros(12))
    assert not terminated and reward < 1.0 and left.time == 4.0 and left.observe("mouth") > 2.0


WRONG = [
    ({"inputs": {}}, "inputs is empty"),
    ({"inputs": {"load.0.force": [1.0, 1.0]}}, r"inputs: load.0.force = \[1.0, 1.0\] must be .* with low < high"),
    ({"inputs": {"load.0.force": [2.0, 1.0]}}, "low < high"),
    ({"inputs": {"load.0.force": [1.0]}}, r"must be \[low, high\]"),
    ({"inputs": {"load.0.forc": [0.0, 1.0]}}, 'did you mean "force"'),
    ({"inputs": {"load.2.force": [0.0, 1.0]}}, '"2" is not the number or name of a'),
    ({"inputs": {"gravity.acceleration": [0.0, 1.0]}}, r"the scene has no \[gravity\]"),
    ({"observations": []}, "observations is empty"),
    ({"observations": ["x", "v", "x"]}, 'observations: "x" stands there twice'),
    ({"draw": {"gym.reward": ["x"]}}, "draw: gym.reward: .gym. is the same in all episodes"),
    ({"draw": {"load.0.force.2": [1.0]}}, "draw: load.0.force.2 is set by the agent"),
    ({"draw": {"load.0.force": [[1.0, 0.0, 0.0]]}}, "draw: load.0.force is set by the agent"),
    ({"draw": {"velocity.0.value.0": [1.0], "velocity.0.value": [[0.0, 0.0, 0.0]]}}, "value.0 is a part of velocity"),
    ({"observations": ["z"]}, 'observations: "z" is not an observable'),
    ({"observations": {"x": [1.0, 0.0]}}, "low < high"),
    ({"reward": "x + z"}, 'reward: "x . z": "z" is not known here'),
    ({"reward": "__import__('os')"}, "reward: .* is not known here"),
    ({"reward": "x.__class__"}, "reward: .* is not known here"),
    ({"reward": "x +"}, "is not a condition|is not a number"),
    ({"terminated": "x"}, "compares nothing"),
    ({"reward": "load.0.force"}, "reward: .* load.0.force is a vector of 3, and must be a number"),
    ({"reward": "x > 1 and -load.0.force"}, "load.0.force is a vector of 3, and must be a number"),
    ({"reward": "'abc'"}, "reward: .* 'abc' is a text, and must be a number"),
    ({"reward": "min(x, 'abc')"}, "'abc' is a text"),
    ({"reward": "x*load.0.force[3]"}, r"load.0.force is a vector of 3: no \[3\]"),
    ({"terminated": "x[0] > 1"}, r"terminated: .* x is a number: no \[0\]"),
    ({"truncated": "load.0.force > 1"}, "truncated: .* load.0.force is a vector of 3"),
    ({"terminated": "load.0.force == 1"}, "load.0.force is a vector of 3"),
    ({"reward": "x + cable.law", "draw": {"cable.law": ["linear", "tension-only"]}}, "cable.law is a text"),
    ({"period": 0.15, "draw": {}}, "period = 0.15: t = 0.15 s is not the time of a history row"),
    ({"draw": {"velocity.0.value.0": {"from": 0.0, "to": 1.0, "count": 3}}}, "count = 3 has no meaning: an"),
    ({"draw": {"velocity.4.value": [1.0]}}, "draw: velocity.4"),
    ({"draw": {"velocity.0.value.0": 3.0}}, "must be a list of cases"),
    ({"rewards": "x"}, 'rewards = "x": unknown key, did you mean "reward"'),
]  # fmt: skip


@pytest.mark.parametrize("task, message", WRONG)
def test_wrong_tables(task, message):
    with pytest.raises(InputError, match=message) as error:
        scene(task, output={"interval": 0.1}).build()
    assert str(error.value).startswith("[gym] ") and "\n" not in str(error.value)


def test_values_of_an_episode_of_another_type_are_refused_with_file_table_and_key(tmp_path):
    """As of a value that may be a number or a table."""
    import tomli_w

    file = tmp_path / "one.toml"
    given = scene({"reward": "x*point_mass.0.mass", "draw": {"point_mass.0.mass": [1.0, 2.0]}}).to_dict()
    file.write_text(tomli_w.dumps(given), encoding="utf-8")
    env = SceneEnv(file)
    env.reset()
    env._values = {"point_mass.0.mass": "1"}
    with pytest.raises(InputError, match=r"one.toml: \[gym\] reward: .* cannot be computed of point_mass.0.mass"):
        env.step(np.ones(1))


def test_wrong_scenes():
    for tables, message in [
        ({"solve": {"kind": "static"}}, r"\[gym\] has no meaning in statics"),
        ({"load": [{"node": 1, "force": [0, 0, 0], "factor": [[0, 1]]}]}, "its factor would multiply"),
        (
            {"control": [{"name": "c", "law": "pid", "period": 0.1, "sets": "load.0.force", "measures": ["x"],
                          "direction": [1, 0, 0]}]},
            r'load.0.force is set by \[\[control\]\] "c"',
        ),
    ]:  # fmt: skip
        with pytest.raises(InputError, match=message):
            scene(**tables).build()
    with pytest.raises(InputError, match=r"square-impact.toml: \[gym\] is missing"):
        SceneEnv("square-impact")
    with pytest.raises(InputError, match="render_mode"):
        SceneEnv(scene(), render_mode="human")


ROPE = {
    "thread": [{"name": "rope", "nodes": [0, 1], "modulus": 1e6, "area": 1e-4, "density": 1.0}],
    "winch": [{"thread": "rope", "end": "first", "tension": 1.0}],
}


def test_bounds_are_what_an_input_may_have():
    """Both of them: a winch does not push, and a brake has a limit above 0."""
    task = {"reward": "x", "inputs": {"winch.0.tension": [-5.0, 10.0]}}
    with pytest.raises(InputError, match=r"inputs: winch.0.tension = \[-5.0, 10.0\] must be ≥ 0 \[N\]: a winch pulls"):
        scene(task, **ROPE).build()
    scene({**task, "inputs": {"winch.0.tension": [0.0, 10.0]}}, **ROPE).build()
    brake = {**ROPE, "winch": [{"thread": "rope", "end": "first", "speed": 0.0, "limit": 1.0}]}
    with pytest.raises(InputError, match=r"inputs: winch.0.limit = 0.0: limit = 0.0 must be > 0"):
        scene({**task, "inputs": {"winch.0.limit": [0.0, 10.0]}}, **brake).build()


def test_a_scene_without_it_loads_nothing_of_it_and_one_with_it_runs_without_gymnasium():
    code = """
import sys
sys.modules["gymnasium"] = None
import refweb
refweb.Scene.load("square-load")
assert not any(name.startswith(("refweb.gym", "refweb.sweeps")) for name in sys.modules)
refweb.Scene.load("corner-control").build()
try:
    import refweb.gym
except ImportError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert 'pip install "refweb[gym]"' in done.stdout
