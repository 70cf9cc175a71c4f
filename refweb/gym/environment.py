"""The environment of a scene: actions are commands of a stepped run, observations its observables.

May change: private functions and texts of errors. Must stay: arguments and results of `SceneEnv`, which are those of
Gymnasium; keys in `OPTIONS`; keys of ``info``, which programs of users read: ``time``, ``values``, ``energy_drift``,
``event`` and ``failure``; the same bits for the same seed. Tests: ``tests/gym/test_environment.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium
import numpy as np
from gymnasium.spaces import Box

from ..dynamics.stepped_run import SteppedRun
from ..errors import InputError, SolverError, in_file, refused_at
from ..messages import nearest, one_line, quote
from ..reference.paths import with_value
from ..scene import Scene
from ..sweeps.episodes import BEFORE, TIME, Gym
from ..sweeps.study import read_parameters

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import NDArray

    from .images import Images

OPTIONS = ("set", "draw")
"""Keys of the options of `SceneEnv.reset`."""


class SceneEnv(gymnasium.Env):
    """Environment of a dynamic scene with a table ``[gym]``.

    An episode is a run that is taken ahead by periods, see `refweb.Gym` for actions, observations, reward and ends.
    With the seed of `reset` it has the same bits again.

    Parameters
    ----------
    scene : Scene, path-like or str
        A scene, a scene file or the name of a scene shipped with refweb.
    gym : refweb.Gym, optional
        Table in place of that of the scene.
    values : dict, optional
        Values of the scene by path, as those of ``--set``.
    render_mode : {"rgb_array"}, optional
        Mode of `render`.
    size : (int, int)
        Width and height of images [pixel].

    Attributes
    ----------
    scene : refweb.Scene
        The scene, without what an episode draws.
    gym : refweb.Gym
        Its table.
    run : refweb.dynamics.stepped_run.SteppedRun or None
        The run of the episode; None before the first `reset`. Its `finish` gives results with ±, where
        the episode is over those of it.

    Raises
    ------
    InputError
        For wrong input, and a scene without a table ``[gym]``.

    Examples
    --------
    >>> env = gymnasium.make("refweb/Scene-v0", scene="my-net.toml")
    >>> observation, info = env.reset(seed=1)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 10}  # type: ignore[misc]

    def __init__(
        self,
        scene: Scene | str | PathLike[str] | None = None,
        gym: Gym | None = None,
        values: dict[str, Any] | None = None,
        render_mode: str | None = None,
        size: tuple[int, int] = (640, 480),
    ) -> None:
        if scene is None:
            raise InputError('scene is missing: gymnasium.make("refweb/Scene-v0", scene="my-net.toml")')
        if not isinstance(scene, Scene):
            scene = Scene.load(scene, values)
        elif values:
            scene = _with_values(scene, scene.to_dict(), values)
        scene = scene if gym is None else scene.replace(gym=gym)
        if scene.gym is None:
            raise InputError(f"{scene.file or 'scene'}: [gym] is missing: it names inputs, observations and the reward")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(f'render_mode = {quote(render_mode)} must be "rgb_array" or None')
        scene.build()
        self.scene: Scene = scene
        self._given = scene.to_dict() if scene.gym.draw else None
        self.gym: Gym = scene.gym
        self.run: SteppedRun | None = None
        self.render_mode: str | None = render_mode
        self.metadata = {**self.metadata, "render_fps": max(1, round(1.0 / self.gym.period))}  # type: ignore[misc]
        self._size, self._over = size, True
        self._images: Images | None = None
        self._values: dict[str, Any] = {}
        low, high = np.hstack(list(self.gym.bounds.values()))
        self._low, self._high, self._varies = low, high, low < high
        ends = np.cumsum([bounds.shape[1] for bounds in self.gym.bounds.values()])
        self._parts = list(zip(self.gym.bounds, [0, *ends[:-1]], ends, strict=True))
        self._before = [f"{o.name}{BEFORE}" for o in scene.observables]
        formulas: Any = self.gym.formulas([o.name for o in scene.observables])
        self._reward, self._terminated, self._truncated = formulas
        bounds = np.array(list(self.gym.observations.values()), dtype=float).T
        self.observation_space: Box = Box(*bounds, dtype=np.float64)
        self.action_space: Box = Box(-1.0, 1.0, (int(self._varies.sum()),), dtype=np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Begin an episode.

        Parameters
        ----------
        seed : int, optional
            Seed of the values that are drawn, in this episode and the next ones.
        options : dict, optional
            ``set``: values by path of this episode; ``draw``: values that it draws, by path as in ``[gym.draw]``, in
            place of those of the scene.

        Returns
        -------
        observation : ndarray, shape (observations,)
        info : dict
            ``time`` [s], and ``values`` that are drawn or set, by path.

        Raises
        ------
        InputError
            For other options, and values that the scene cannot have.
        SolverError
            Where the run cannot begin.
        """
        super().reset(seed=seed)
        options = options or {}
        for key in options:
            if key not in OPTIONS:
                raise InputError(f"options: {quote(key)} is none, {nearest(key, OPTIONS)}")
        draws, given = options.get("draw"), options.get("set") or {}
        draws = self.gym.draw if draws is None else draws and read_parameters("draw", draws)
        self.gym.refuse_paths(draws, "options:", given)
        values = {**self.gym.drawn(self.np_random, draws), **given}
        if values and self._given is None:
            self._given = self.scene.to_dict()
        scene = _with_values(self.scene, self._given, values) if values else self.scene
        run, self.run = self.run, None  # which it stays where the new one cannot begin
        if run is None:
            run = SteppedRun(scene)
        else:
            run.restart(scene)
        self.run = run
        self._values, self._over, self._observed = values, False, self.run.observed
        if self._images is not None:
            self._images.forget()
        return self._observation(), {TIME: self.run.time, "values": values}

    def _observation(self):
        """The observations within their bounds, shape (observations,)."""
        values = np.array([self._observed[name] for name in self.gym.observations])
        return np.minimum(np.maximum(values, self.observation_space.low), self.observation_space.high)

    def step(self, action: NDArray[np.floating[Any]]) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Set the inputs, and go ahead by a period.

        Parameters
        ----------
        action : ndarray, shape (components,)
            Inputs: −1 for the lower bound of each, 1 for the upper one; values beyond are set to these.

        Returns
        -------
        observation : ndarray, shape (observations,)
        reward : float
        terminated, truncated : bool
        info : dict
            ``time`` [s], ``energy_drift`` over the largest energy, ``event`` where one has ended the run, and
            ``failure`` where the run has failed.

        Raises
        ------
        InputError
            For an action of another shape, and one that is not finite.
        SolverError
            Where the run fails, with ``raise_failure = true``.
        """
        if self.run is None or self._over:
            raise gymnasium.error.ResetNeeded("the episode is over: call reset() before step()")
        given = self._inputs(action)
        info: dict[str, Any] = {}
        try:
            self._advance(self.run, given)
            reward = self._value("reward", self._reward)
            ended, terminated = self.run.stopped, self._holds("terminated", self._terminated)
            terminated = terminated or self.run.event is not None
            truncated = not terminated and (ended or self._holds("truncated", self._truncated))
        except SolverError as error:
            if self.gym.raise_failure:
                raise
            self._over, info["failure"] = True, one_line(str(error))
            self.run.end()
            return self._observation(), self.gym.failure_reward, True, False, {TIME: self.run.time, **info}
        info = {TIME: self.run.time, "energy_drift": self.run.drift}
        if self.run.event is not None:
            info["event"] = self.run.event
        self._over = terminated or truncated or ended
        if self._over:
            self.run.end()
        return self._observation(), reward, terminated, truncated, info

    def _inputs(self, action):
        """Values of the inputs by path."""
        action = np.asarray(action, dtype=float)
        if action.shape != self.action_space.shape or not np.isfinite(action).all():
            raise InputError(f"action = {quote(action.tolist())} must be {self.action_space.shape[0]} finite numbers")
        share = np.zeros(len(self._low))
        share[self._varies] = 0.5 + 0.5 * np.minimum(np.maximum(action, -1.0), 1.0)
        values = (self._low + share * (self._high - self._low)).tolist()
        return {path: values[first:end] if end - first > 1 else values[first] for path, first, end in self._parts}

    def _advance(self, run, given):
        """Set values by path, go ahead by a period, and take the numbers of reward and ends."""
        for path, value in given.items():
            run.set(path, value)
        run.advance(self.gym.period, self.gym.budget)
        before, self._observed = self._observed, run.observed
        self._numbers = dict(zip(self._before, before.values(), strict=True))
        self._numbers |= {**self._values, **given, TIME: run.time, **self._observed}

    def _value(self, key, formula):
        """The value of a formula, `SolverError` where it is not finite."""
        with in_file(self.scene.file), refused_at(f"[gym] {key}:"):
            value = formula(self._numbers)
        if not math.isfinite(value):
            raise SolverError(f"{key} = {quote(getattr(self.gym, key))} is {value} at t = {self._numbers[TIME]:.6g} s")
        return value

    def _holds(self, key, condition):
        """True if a condition is given and holds."""
        return condition is not None and bool(self._value(key, condition))

    def render(self) -> NDArray[np.uint8] | None:
        """The image of the present state, shape (height, width, 3); None without a render mode."""
        if self.render_mode is None:
            gymnasium.logger.warn('render() needs a mode: make the environment with render_mode="rgb_array"')
            return None
        if self.run is None:
            raise gymnasium.error.ResetNeeded("there is no state to draw: call reset() before render()")
        return self._drawn_by().image(self.run.state)

    def _drawn_by(self) -> Images:
        if self._images is None:
            from .images import Images

            self._images = Images(self._size)
        return self._images

    def close(self) -> None:
        """End the process that draws."""
        if self._images is not None:
            self._images.close()
            self._images = None


def _with_values(scene, given, values):
    """The scene of a dict with values by path, in the folder of another one."""
    with in_file(scene.file):
        for path, value in values.items():
            given = with_value(given, path, value)
        return Scene.from_dict(given, scene.folder, scene.file)
