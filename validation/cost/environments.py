"""What a step of a learning environment costs, beside MuJoCo, and the memory of 64 environments.

    python -m validation.cost.environments

Nets of the environment ``refweb/CornerControl-v0`` with 60, 480 and 1740 lines: point masses, and lines that only pull.
In MuJoCo a node is a body on three slide joints and a line a spatial tendon with a spring of the range [0, natural
length]; contact, gravity and constraints are off. MuJoCo is not a dependency, ``pip install mujoco``, and is left out
where it is not installed. Both take the same steps in a period of 0.1 s, under the same forces on the corners, on one
core.

A step of refweb's environment has all that `gymnasium.Env.step` gives: commands, observations, reward, ends, energy
drift, largest tension. That of MuJoCo has forces, ``mj_step`` with the number of steps, observations and the reward in
numpy. CPU time, minimum of rounds that alternate; a busy machine moves both. At the end corners of both are compared.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import psutil

import refweb
from refweb.gym import SceneEnv

LAYERS, SIDE, PERIODS, ROUNDS = (3, 8, 15), 0.8, 20, 5
ENVIRONMENTS = 64
"""Number of environments whose memory is measured."""


def environment(layers):
    """The environment with another net, and the nodes of its corners."""
    nodes = 2 * layers
    corners = [0, nodes - 1, nodes * (nodes - 1), nodes**2 - 1]
    values = {"web.layers": layers, "point_mass.0.node": corners}
    for k, corner in enumerate(corners):
        values |= {f"load.{k}.node": corner, f"velocity.{k}.node": corner}
        values |= {f"observe.{name}{k + 1}.node": corner for name in "xyzuvw"}
    return SceneEnv("corner-control", values=values), corners


def xml(net, step):
    """The net as a model of MuJoCo."""
    joints = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    bodies = "".join(
        f'<body pos="{x} {y} {z}">{joints}<inertial pos="0 0 0" mass="{mass}" diaginertia="1e-6 1e-6 1e-6"/>'
        f'<site name="{n}"/></body>'
        for n, ((x, y, z), mass) in enumerate(zip(net.points.tolist(), net.mass.tolist(), strict=True))
    )
    lines = "".join(
        f'<spatial springlength="0 {length}" stiffness="{ea / length}"><site site="{i}"/><site site="{j}"/></spatial>'
        for (i, j), length, ea in zip(
            net.cells.tolist(), net.natural_length.tolist(), net.line_data.ea.tolist(), strict=True
        )
    )
    flags = '<flag contact="disable" constraint="disable" gravity="disable"/>'
    return (
        f'<mujoco><option timestep="{step!r}" integrator="Euler">{flags}</option><size memory="200M"/>'
        f"<worldbody>{bodies}</worldbody><tendon>{lines}</tendon></mujoco>"
    )


class Peer:
    """The same net in MuJoCo, with as many steps in a period."""

    def __init__(self, env, corners, steps):
        import mujoco

        self._step = mujoco.mj_step
        self._model = mujoco.MjModel.from_xml_string(xml(env.run.state.system.net, env.gym.period / steps))
        self._data, self._steps = mujoco.MjData(self._model), steps
        self._corners = np.array(corners)
        self._reset = lambda: mujoco.mj_resetData(self._model, self._data)
        self._target = np.array([[0.2, 0.2, 1.0], [-0.2, 0.2, 1.0], [0.2, -0.2, 1.0], [-0.2, -0.2, 1.0]])

    def reset(self, velocities):
        """Begin with velocities of the corners [m/s]."""
        self._reset()
        self._data.qvel.reshape(-1, 3)[self._corners] = velocities

    def step(self, action):
        """Forces, steps, observations and reward."""
        force = 0.5 * action.reshape(4, 3)
        self._data.xfrc_applied[self._corners + 1, :3] = force
        self._step(self._model, self._data, nstep=self._steps)
        place = self._data.qpos.reshape(-1, 3)[self._corners]
        speed = self._data.qvel.reshape(-1, 3)[self._corners]
        reward = 1.0 - 0.25 * ((place - self._target) ** 2).sum() - 0.05 * (force**2).sum()
        return np.hstack([place, speed]).ravel(), reward


def timed(call):
    """CPU time [s] of a call."""
    began = time.process_time()
    call()
    return time.process_time() - began


def compare(layers):
    """Print the row of a net."""
    env, corners = environment(layers)
    env.reset(seed=1)
    actions = np.random.default_rng(1).uniform(-0.5, 0.5, (PERIODS, 12))

    def own():
        env.reset(seed=1)
        nonlocal last
        for action in actions:
            last = env.step(action)[0]

    last = np.zeros(24)
    own()
    resets = min(timed(lambda: env.reset(seed=1)) for _ in range(ROUNDS))
    own()
    steps = round(env.run.steps / PERIODS)
    text = f"{env.run.state.system.net.cells.shape[0]:6d} lines, {steps:4d} steps a period"
    try:
        peer = Peer(env, corners, steps)
    except ImportError as error:
        taken = (min(timed(own) for _ in range(ROUNDS)) - resets) / PERIODS
        print(f"{text}: refweb {1.0 / taken:7.0f}/s; MuJoCo is left out: {error}")
        return
    velocities = [e.value for e in env.run.scene.effects if isinstance(e, refweb.Velocity)]

    def theirs():
        nonlocal found
        peer.reset(velocities)
        for action in actions:
            found = peer.step(action)[0]

    found = last
    theirs()
    times = [(timed(own) - resets, timed(theirs)) for _ in range(ROUNDS)]
    mine, other = np.min(times, axis=0) / PERIODS
    apart = np.abs(found - last).reshape(4, 6)[:, :3].max()
    print(
        f"{text}: refweb {1.0 / mine:7.0f}/s, MuJoCo {1.0 / other:7.0f}/s, ratio {other / mine:5.1f}; "
        f"corners {apart:.1e} m apart at {PERIODS * env.gym.period:g} s, reset {1e3 * resets:.1f} ms"
    )


def memory():
    """Print the memory of environments in one process."""
    process, envs, before = psutil.Process(), [], 0
    for n in range(ENVIRONMENTS + 1):
        envs.append(SceneEnv("corner-control"))
        envs[-1].reset(seed=n)
        envs[-1].step(np.zeros(12))
        before = before or process.memory_info().rss
    more = process.memory_info().rss - before
    print(f"{ENVIRONMENTS} environments of 60 lines: {more / 2**20:.0f} MiB beyond {before / 2**20:.0f} MiB with one")


def main():
    """Print all."""
    for layers in LAYERS:
        compare(layers)
    memory()
    return 0


if __name__ == "__main__":
    sys.exit(main())
