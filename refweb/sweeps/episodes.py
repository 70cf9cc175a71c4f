"""Learning environments of scenes: the table ``[gym]``, with inputs, observations, reward, end and draws of episodes.

It knows no Gymnasium: a scene with the table is read, run and swept without that library. `refweb.gym` makes episodes.
May change: private functions and texts of errors. Must stay: keys and docstring of `Gym` (scene format and help; after
a change write ``validation/REFERENCE.md`` anew); `TIME` and `BEFORE`, names that formulas of users have. Tests:
``tests/gym/test_environment.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..accepted import accepts, any_of, array, by_name
from ..errors import InputError, refused_at
from ..messages import nearest, quote, short
from ..reference.paths import with_value
from ..tables import Table, boolean, checked, field, numbers_list, real, rows, table, text, texts
from .design import placed
from .expressions import Formula
from .study import Range, by_path, plain, read_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..scene import Scene
    from ..system.system import System

_numbers, _vectors, _names = numbers_list(), rows(3), texts()
_of_vectors, _of_names = (kind.metadata["read"].accepts for kind in (_vectors, _names))
_of_pair = array({"type": "number"}, 2, 2)
_of_range, _of_distribution = (
    {"type": "object", "properties": {}, "required": keys, "additionalProperties": True}
    for keys in (["from", "to"], ["distribution"])
)
TIME, BEFORE = "time", ".before"
"""Name of the time in expressions, and ending of the value of an observable one period before."""


def _bounds(name, value, several=False):
    """Read [low, high], of a vector also two of them."""
    vectors = several and isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple)
    bounds = checked(name, value, _vectors if vectors else _numbers)
    if len(bounds) != 2:
        raise InputError(f"{name} = {quote(value)} must be [low, high]")
    low, high = np.array(bounds)
    if (low > high).any() or not (low < high).any():
        raise InputError(f"{name} = {quote(value)} must be [low, high] with low < high")
    return bounds


@accepts(by_name(any_of(_of_pair, _of_vectors)))
def _inputs(name, value):
    """Read bounds by path."""
    if not isinstance(value, dict):
        raise InputError(f'{name} = {quote(value)} must be a table of bounds by path, "load.0.force" = [-1.0, 1.0]')
    return {path: _bounds(f"{name}: {short(path)}", given, True) for path, given in by_path(value)}


@accepts(any_of(_of_names, by_name(_of_pair)))
def _observations(name, value):
    """Read names of observables, or their bounds by name."""
    if isinstance(value, dict):
        value = {key: _bounds(f"{name}: {short(key)}", given) for key, given in value.items()}
    else:
        names = checked(name, value, _names)
        if twice := [known for known in names if names.count(known) > 1]:
            raise InputError(f"{name}: {quote(twice[0])} stands there twice: leave out one of them")
        value = dict.fromkeys(names, (-np.inf, np.inf))
    return value


@accepts(by_name(any_of(array({}, 1) | {"uniqueItems": True}, _of_range, _of_distribution)))
def _draws(name, value):
    """Read values that are drawn, by path."""
    return {} if value == {} else read_parameters(name, value)


@table
class Gym(Table):
    """Learning environment of a dynamic scene: `refweb.gym` makes episodes of it for Gymnasium.

    An episode is a run that is taken ahead by periods. At the beginning of each the agent gives values of the inputs,
    and at its end it gets the observations and the reward. The action space is a box from −1 to 1: −1 stands for the
    lower bound of an input and 1 for the upper one. A component of a vector whose bounds are equal is constant and no
    part of the action. Observations beyond their bounds are set to them.

    Reward and end are expressions as the conditions of studies: arithmetic, comparisons, ``and``, ``or``, ``not``, abs,
    sqrt, min, max. Names are those of observables, with ``.before`` their values one period before, ``time`` [s], and
    paths of inputs and draws, such as ``load.0.force[2]``. A comparison within a sum counts as 1 or 0. An episode is
    truncated at the end of the duration, and terminated where an event stops the run.

    A run that fails, since the solver refuses to go on, takes too long, energy drifts, or the reward is not finite or
    an end compares what has no value, terminates the episode with the last observation, the reward ``failure_reward``
    and the message as ``failure`` of the info.

    Parameters
    ----------
    inputs : dict
        Bounds [low, high] of the values that the agent sets, by path, as in ``sets`` of ``[[control]]``; of a vector
        also two vectors, [[x, y, z], [x, y, z]].
    observations : list of str, or dict
        Names of the observables that the agent gets, or their bounds [low, high] by name.
    period : float
        Time between two actions [s], a multiple of ``[output] interval``, which is by default the period.
    reward : str
        Reward of a period.
    terminated : str, optional
        Condition that ends the episode by success or loss.
    truncated : str, optional
        Condition that ends the episode for a reason outside the task, as a time limit does.
    raise_failure : bool
        True to raise the error of a run that fails, in place of an end of the episode.
    failure_reward : float
        Reward of a period in which the run fails.
    budget : float, optional
        CPU time that a period may take [s]; a run that needs more fails. By default it may take any.
    draw : dict
        Values that are drawn for each episode, by path: as ``parameters`` of a study, ranges, distributions, or lists,
        whose entries are equally likely.

    Raises
    ------
    InputError
        For bounds that are not low < high, and a range with a count. From `Scene`, in statics. From `Scene.build`, for
        names that the scene does not have, bounds that cannot be set, such as a tension below 0 of a winch, and a
        period that is no multiple.

    Examples
    --------
        [gym]
        period = 0.1
        reward = "1 - abs(height - 0.5)"
        observations = { height = [-2.0, 2.0], speed = [-5.0, 5.0] }
        [gym.inputs]
        "load.0.force" = [[0, 0, -1], [0, 0, 1]]
        [gym.draw]
        "point_mass.0.mass" = { from = 0.9, to = 1.1 }
    """

    inputs: dict[str, Any] = field(_inputs)
    observations: dict[str, Any] = field(_observations)
    period: float = real(above=0, unit="s")
    reward: str = text()
    terminated: str | None = text(default=None)
    truncated: str | None = text(default=None)
    raise_failure: bool = boolean(default=False)
    failure_reward: float = real(default=0.0)
    budget: float | None = real(default=None, above=0, unit="s")
    draw: dict[str, Any] = field(_draws, default_factory=dict)

    def check(self) -> None:
        """Refuse what is empty, and numbers of samples of draws."""
        for key in ("inputs", "observations"):
            if not getattr(self, key):
                raise InputError(f"{key} is empty: name at least one")
        for path, drawn in self.draw.items():
            if isinstance(drawn, Range) and drawn.count is not None:
                raise InputError(f"draw: {path}: count = {drawn.count} has no meaning: an episode draws once")

        self.refuse_paths(self.draw, "draw:")

    def refuse_paths(self, draws: dict[str, Any], where: str, given: dict[str, Any] | None = None) -> None:
        """Refuse draws of what the agent sets, the table itself, and a vector beside its components; `InputError`."""
        paths = {**draws, **(given or {})}
        for path in paths:
            if path.partition(".")[0] == "gym":
                raise InputError(f"{where} {short(path)}: [gym] is the same in all episodes: give it in the scene")
            for vector in paths:
                if path.startswith(f"{vector}."):
                    raise InputError(f"{where} {short(path)} is a part of {short(vector)}: give one of them")
        for path in draws:
            for part in self.inputs:
                if f"{path}.".startswith(f"{part}.") or part.startswith(f"{path}."):
                    raise InputError(f"{where} {short(path)} is set by the agent, by inputs: leave out one of them")

    def to_dict(self) -> dict[str, Any]:
        """The table as plain TOML values."""
        given = {**super().to_dict(), "draw": {path: plain(drawn) for path, drawn in self.draw.items()}}
        if np.isinf(list(self.observations.values())).all():
            given["observations"] = list(self.observations)
        return {key: value for key, value in given.items() if value != {}}

    @property
    def bounds(self) -> dict[str, NDArray[np.float64]]:
        """Bounds of each input by path, arrays of shape (2, components)."""
        from ..dynamics.controllers import VECTORS

        bounds = {}
        for path, given in self.inputs.items():
            count = 3 if path.partition(".")[0] in VECTORS else 1
            each = np.array(given, dtype=float).reshape(2, -1)
            if each.shape[1] > count:
                raise InputError(f"inputs: {short(path)} is one number: give two bounds, [low, high]")
            bounds[path] = np.broadcast_to(each, (2, count))
        return bounds

    def formulas(self, observables: Sequence[str]) -> list[Formula | None]:
        """Reward and conditions of the two ends, to be evaluated with numbers by name."""
        names = [TIME, *self.inputs, *self.draw, *observables, *(f"{name}{BEFORE}" for name in observables)]
        drawn = {path: given[0] for path, given in self.draw.items() if not hasattr(given, "_fields")}
        inputs = {path: low.tolist() for path, (low, _) in self.bounds.items() if len(low) > 1}
        typical = {**dict.fromkeys(names, 1.0), **drawn, **inputs}
        formulas: list[Formula | None] = []
        for key in ("reward", "terminated", "truncated"):
            given = getattr(self, key)
            with refused_at(f"{key}:"):
                formula = None if given is None else Formula(given, names, None if key == "reward" else True)
                if formula is not None:
                    formula.check_types(typical)
                formulas.append(formula)
        return formulas

    def drawn(self, generator: np.random.Generator, draws: dict[str, Any] | None = None) -> dict[str, Any]:
        """Draw values by path: those of the table, or others in the form of `read_parameters`."""
        values = {}
        for path, parameter in (self.draw if draws is None else draws).items():
            share = generator.random()
            if isinstance(parameter, tuple) and not hasattr(parameter, "_fields"):
                values[path] = parameter[int(share * len(parameter))]
            else:
                values |= placed({path: parameter}, np.array([[share]]))[0]
        return values

    def check_in(self, scene: Scene, system: System) -> None:
        """Refuse what does not fit a scene; `InputError`."""
        from ..dynamics.commands import Command, Inputs, not_negative, row_at
        from ..dynamics.schedule import row_times

        names, inputs = [o.name for o in scene.observables], Inputs(system)
        for path, bounds in self.bounds.items():
            with refused_at("inputs:"):
                if not_negative(path) and bounds[0, 0] < 0.0:
                    raise InputError(f"{short(path)} = {quote(bounds.ravel().tolist())} must be ≥ 0 [N]: a winch pulls")
                for value in bounds.tolist():
                    inputs.checked(Command(0.0, path, value if len(value) > 1 else value[0]))
                inputs.refuse_factor(path)
                if taken := [control.name for control in scene.control if control.sets == path]:
                    raise InputError(f"{short(path)} is set by [[control]] {quote(taken[0])}: leave out one of them")
        for name in self.observations:
            if name not in names:
                raise InputError(f"observations: {quote(name)} is not an observable, {nearest(name, names)}")
        with refused_at(f"period = {self.period:g}:"):
            row_at(np.asarray(row_times(scene), dtype=np.float64), self.period)
        self.formulas(names)
        given = scene.to_dict() if self.draw else {}
        for path in self.draw:
            with refused_at("draw:"):
                with_value(given, path, 0.0)
