"""Controls of a run: each measures at its period, and gives a command, see `refweb.dynamics.commands`.

May change: private functions and words of messages. A further effect that controls may set needs its unit in `UNITS`
and, if it takes a vector, its name in `VECTORS`. Must stay: keys and order in `Controller.arrays`, which checkpoints
keep, and of `plain`, which stand in ``run.json``; a `Controller` measures in the columns of a history row, so that it
sees what ``history.csv`` has. `simulation`, `commands` and `sweeps.episodes` use the public names. Must stay as well:
`commands_of`, which `simulation` imports. Tests: ``tests/dynamics/test_control.py``, ``test_attitude.py``.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import pathlib
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, SolverError, refused_at
from ..messages import nearest, one_line, quote, short
from ..net.quaternions import interpolated, of_vector, product, rotation_between
from ..registry import EFFECTS, name_of
from .commands import INPUTS, NEAR, RATES, Command, Commands, Inputs, not_negative
from .control_laws import LAWS, Measurement
from .schedule import row_times

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..net.rigid_body import RigidBody
    from ..scene import Scene
    from ..settings import Control
    from ..system.system import System
    from .history import Watch
    from .schedule import Schedule

UNITS = {"load": "N s", "thrust": "N s", "pressure": "Pa s"}
"""Unit of the integral of the size of what is set, beside torques."""
VECTORS = ("load", "gravity", "motion")
"""Effects whose values that are set are vectors."""
QUATERNION = (3, 0, 1, 2)
"""Components of an orientation, in the order w, x, y, z."""


class Controller:
    """A control at work.

    Parameters
    ----------
    control : refweb.Control
        Its table.
    number : int
        Its number in the scene, which begins its noise.
    scene : refweb.Scene
        The scene.
    names : sequence of str
        Names of the observables, in the order of the columns behind time.
    times : ndarray
        Times of history rows [s].
    bodies : sequence of refweb.net.rigid_body.RigidBody
        Bodies of the scene.

    Attributes
    ----------
    meters : list of ndarray
        Data of the probes of observables of what is spent, see `refweb.results.observables.fuel`.
    vector : bool
        True if what it sets is a vector.
    largest : float
        Largest size of what is set.
    surfaces : list of float
        Numbers whose sign decides what is set, of a law that switches.

    Raises
    ------
    InputError
        For names that the scene does not have, parameters that the law does not have, and a period or delay that is no
        multiple.
    """

    def __init__(
        self,
        control: Control,
        number: int,
        scene: Scene,
        names: Sequence[str],
        times: NDArray[np.float64],
        bodies: Sequence[RigidBody] = (),
    ) -> None:
        self.control, self._seed, self._times = control, (scene.seed, number), times
        self.meters: list[NDArray[np.float64]] = []
        self._attitude = len(control.measures) == 4
        self._size_of_value = 3 if self._attitude else len(control.measures)
        self._difference = rotation_between if self._attitude else np.subtract
        self._stride = _multiple("period", control.period, "[output] interval", times[1] - times[0])
        self._lag = _multiple("delay", control.delay, "period", control.period) if control.delay else 0
        target = control.target if isinstance(control.target, tuple) and isinstance(control.target[0], str) else ()
        self._columns = [
            np.array([1 + _index(key, name, names) for name in given], dtype=int)
            for key, given in (("measures", control.measures), ("rates", control.rates), ("target", target))
        ]
        name, known = control.sets.partition(".")[0], [*INPUTS, *RATES, "body"]
        if name not in known:
            raise InputError(f"sets = {quote(control.sets)}: {quote(name)} has nothing to set, {nearest(name, known)}")
        self.vector = name in VECTORS
        self._not_negative = not_negative(control.sets)
        if self.vector and len(control.measures) == 1 and control.direction is None:
            raise InputError(f"direction is missing: {control.sets} is a vector, and measures has one name")
        if not self.vector and (len(control.measures) > 1 or control.direction is not None):
            raise InputError(f"{control.sets} is one number: give one name in measures, and no direction")
        if self._attitude:
            for key, given in (("measures", control.measures), ("target", target)):
                _refuse_no_orientation(key, given, scene)
        load = load_of(scene, control.sets)
        turned = getattr(load, "axes", None) == "body"
        self._body = next((body for body in bodies if turned and body.name == load.body), None)
        self._law: Any = _law(control, scene.folder)
        if control.law == "spin-up" and control.target == 0.0:
            raise InputError('target = 0 must not be zero with law = "spin-up": it is the speed that is led to')
        self.reset()

    @property
    def axes(self) -> list[bool]:
        """True for each of x, y and z along which its value may have a part."""
        if self.vector and self._size_of_value == 1:
            return [part != 0.0 for part in self.control.direction]
        return [True, True, True]

    def reset(self) -> None:
        """Begin a run."""
        self._measured: list[Any] = []
        self._target_before: Any = None
        self._spent = self.largest = self._size = self._since = 0.0
        self.limited, self.surfaces = False, []
        self._publish()
        with _asked(self.control, 0.0):
            self._law.reset()

    def due(self, row: int) -> bool:
        """True if it measures at a row, which is not the last."""
        return row % self._stride == 0 and row < len(self._times) - 1

    def next_row(self, first: int) -> int:
        """Number of the first row from ``first`` on at which it measures."""
        return -(-first // self._stride) * self._stride

    def command(self, row: int, values: NDArray[np.float64], x: NDArray[np.float64]) -> Command:
        """Measure in the columns of a row, at displacements ``x`` of all rows, and return what is set."""
        control, time = self.control, float(self._times[row])
        noise = np.random.default_rng([*self._seed, row]).normal(scale=control.noise or 1.0, size=(2, 3))
        noise = noise[:, : self._size_of_value] * (control.noise > 0.0)
        value = values[self._columns[0]]
        value = product(of_vector(noise[0]), value) if self._attitude else value + noise[0]
        rate = values[self._columns[1]] + noise[1] if len(control.rates) else None
        self._measured = [*self._measured[-self._lag - 1 :], (value, rate)]
        value, rate = self._measured[max(len(self._measured) - 1 - self._lag, 0)]
        if rate is None:
            at = len(self._measured) - 2 - self._lag
            before = self._measured[at][0] if at >= 0 else value
            rate = self._difference(value, before) / control.period
        target = self._target(time, values)
        before = target if self._target_before is None else self._target_before
        self._target_before = target
        target_rate = self._difference(target, before) / control.period
        if self._attitude:
            value, target = np.zeros(3), rotation_between(target, value)
        measurement = Measurement(value, rate, target, target_rate, control.period, self.limited)
        with _asked(control, time):
            given = self._law.act(measurement, time)
            if hasattr(self._law, "surface"):
                self.surfaces += np.abs(self._law.surface(measurement)).tolist()
        return Command(time, control.sets, self._limited(given, time, x))

    def _target(self, time, values):
        """The target at a time, shape (measures,)."""
        target = self.control.target
        if len(self._columns[2]):
            return values[self._columns[2]]
        if isinstance(target, tuple) and isinstance(target[0], tuple):
            table = np.array(target)
            if self._attitude:
                return interpolated(time, table[:, 0], table[:, 1:])
            return np.array([np.interp(time, table[:, 0], column) for column in table[:, 1:].T])
        return np.broadcast_to(np.array(target, dtype=float), (len(self.control.measures),)).copy()

    def _limited(self, given, time, x):
        """The value of a law within cone and limit, as it is set, along the axes of its load."""
        control, size = self.control, self._size_of_value
        try:
            value = np.array(given, dtype=float).reshape(-1)
        except (TypeError, ValueError):
            value = np.full(1, np.nan)
        if value.shape != (size,) or not np.isfinite(value).all():
            what = "a finite number" if size == 1 else f"{size} finite numbers"
            raise SolverError(
                f"[[control]] {quote(control.name)} at t = {time:.6g} s: act gave {short(repr(given))}, must be {what}"
            )
        if self.vector and size == 1:
            direction = np.array(control.direction)
            value = value[0] * direction / np.linalg.norm(direction)
        if self._body is not None:
            value = self._body.axes @ self._body.rotation(x).T @ value
        asked = value
        if control.angle is not None:
            value = within_cone(value, np.array(control.direction), control.angle)
        if self._not_negative:
            value = np.maximum(value, 0.0)
        norm = float(np.linalg.norm(value))
        if control.limit is not None and norm > control.limit:
            value, norm = value * (control.limit / norm), control.limit
        self.limited = bool((value != asked).any())
        self._spent, self._size, self._since = self.spent(time), norm, time
        self.largest = max(self.largest, norm)
        self._publish()
        return value.tolist() if self.vector else float(value[0])

    def _publish(self):
        """Write what is spent to the meters."""
        for meter in self.meters:
            meter[0, :3] = self._spent, self._size, self._since

    def spent(self, time: float) -> float:
        """Integral of the size of what is set until a time."""
        return self._spent + self._size * (time - self._since)

    def arrays(self) -> dict[str, Any]:
        """State for a checkpoint; `InputError` for a law that does not give its own."""
        if not hasattr(self._law, "save"):
            return {}
        measured = [[value.tolist(), None if rate is None else rate.tolist()] for value, rate in self._measured]
        before = None if self._target_before is None else self._target_before.tolist()
        state = [self._spent, self._size, self._since, self.largest, self.limited, self.surfaces]
        return {"law": list(self._law.save()), "measured": measured, "target": before, "state": state}

    def restore(self, arrays: dict[str, Any]) -> None:
        """Take the state of a checkpoint."""
        if not arrays:
            raise InputError(
                f"[[control]] {quote(self.control.name)}: its law has no save() and restore(): start the run again"
            )
        self._law.restore(arrays["law"])
        self._measured = [
            (np.array(value), None if rate is None else np.array(rate)) for value, rate in arrays["measured"]
        ]
        self._target_before = None if arrays["target"] is None else np.array(arrays["target"])
        self._spent, self._size, self._since, self.largest, self.limited, self.surfaces = arrays["state"]
        self._publish()

    def plain(self, time: float) -> dict[str, Any]:
        """Largest value and integral of its size, for ``run.json``."""
        sets = self.control.sets
        unit = "N m s" if sets.endswith(".torque") else UNITS.get(sets.partition(".")[0])
        return {
            "name": self.control.name,
            "sets": sets,
            "spent": self.spent(time) if unit else None,
            "error": None,
            "unit": unit,
            "largest": self.largest,
        }


def controllers_of(scene: Scene, system: System, names: Sequence[str], times: NDArray[np.float64]) -> list[Controller]:
    """The controls of a scene and its system."""
    made = []
    for number, control in enumerate(scene.control):
        with refused_at(f"[[control]] {number + 1}"):
            if control.name in [earlier.control.name for earlier in made]:
                raise InputError(f"name = {quote(control.name)} is already used")
            for earlier in (earlier for earlier in made if earlier.control.sets == control.sets):
                raise InputError(f"sets = {quote(control.sets)} is set by {quote(earlier.control.name)} already")
            made.append(Controller(control, number, scene, names, times, system.net.bodies))
    return made


def commands_of(scene: Scene, system: System, watch: Watch, schedule: Schedule, given: Sequence[Any]) -> Commands:
    """The commands of a scene: those of its controls, and given ones."""
    controllers = controllers_of(scene, system, [o.name for o in watch.observables], schedule.times)
    probed = [observe for observe in watch.observables if not observe.observable.booked]
    for observe, probe in zip(probed, watch.probes, strict=False):
        for controller in controllers:
            if observe.control == controller.control.name:
                probe.data[0, 3] = observe.observable.factor(
                    load_of(scene, controller.control.sets), system, controller.axes
                )
                controller.meters.append(probe.data)
    return Commands(Inputs(system), schedule, given, controllers, watch.table)


def check(scene: Scene, system: System) -> None:
    """Refuse controls that do not fit a scene or set what cannot be set; `InputError`."""
    inputs, times = Inputs(system), row_times(scene)
    controllers = controllers_of(scene, system, [o.name for o in scene.observables], times)
    for number, made in enumerate(controllers):
        sets = made.control.sets
        with refused_at(f"[[control]] {number + 1}"):
            trial = 1.0 if sets.endswith(".limit") else 0.0  # a limit is above 0
            inputs.checked(Command(0.0, sets, [0.0] * 3 if made.vector else trial))
            inputs.refuse_factor(sets)
    for observe in (observe for observe in scene.observables if observe.control is not None):
        with refused_at(f"[[observe]] {quote(observe.name)}"):
            made = next(made for made in controllers if made.control.name == observe.control)
            if made.plain(0.0)["unit"] != "N s":
                raise InputError(f"control = {quote(observe.control)} sets {made.control.sets}, which is no force")
            observe.observable.factor(load_of(scene, made.control.sets), system, made.axes)


def load_of(scene: Scene, path: str) -> Any:
    """The ``[[load]]`` or ``[[thrust]]`` whose value a path names; None for another path."""
    name, _, rest = path.partition(".")
    number = rest.partition(".")[0]
    effects = [effect for effect in scene.effects if name == name_of(EFFECTS, effect) and name in ("load", "thrust")]
    return effects[int(number)] if number.isdecimal() and int(number) < len(effects) else None


def within_cone(value: NDArray[np.float64], axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """The vector of a cone about an axis that is nearest to a value, shape (3,); ``angle`` is at most π/2 [rad]."""
    axis = axis / np.linalg.norm(axis)
    along = value @ axis
    across = value - along * axis
    size = np.linalg.norm(across)
    if size * np.cos(angle) <= along * np.sin(angle):
        return value
    edge = along * np.cos(angle) + size * np.sin(angle)
    if not edge > 0.0:
        return np.zeros(3)
    return edge * (np.cos(angle) * axis + np.sin(angle) / size * across)


def _refuse_no_orientation(key, names, scene):
    """Refuse four names that are not the components w, x, y, z of the orientation of one body."""
    observes = {observe.name: observe for observe in scene.observables}
    chosen = [observes[name] for name in names]
    right = [(observe.quantity, observe.component) for observe in chosen] == [("orientation", c) for c in QUATERNION]
    if names and not (right and len({observe.body for observe in chosen}) == 1):
        raise InputError(f"{key} = {quote(names)} must be the components w, x, y, z of the orientation of one body")


def _multiple(key, value, name, unit):
    """Ratio of two times, a whole number."""
    count = round(value / unit)
    if count < 1 or abs(value - count * unit) > NEAR * unit:
        raise InputError(f"{key} = {value:g} must be a multiple of {name} = {unit:g} [s]")
    return count


def _index(key, name, names):
    if name not in names:
        raise InputError(f"{key}: {quote(name)} is not an observable, {nearest(name, names)}")
    return names.index(name)


def _law(control, folder):
    """The law of a control, with its parameters."""
    file, sign, name = control.law.rpartition(":")
    kind = _class_in(file, name, folder) if sign else LAWS.get(control.law)
    if kind is None:
        raise InputError(f'law = {quote(control.law)} is none, {nearest(control.law, LAWS)}; or "FILE.py:CLASS"')
    given = control.parameters or {}
    if not sign:
        fields = dataclasses.fields(kind)
        known = [f.name for f in fields]
        for key in given:
            if key not in known:
                raise InputError(f"parameters.{short(key)}: law = {quote(control.law)} has none, {nearest(key, known)}")
        for f in fields:
            if f.name not in given and f.default is dataclasses.MISSING:
                raise InputError(f"parameters.{f.name} is missing: law = {quote(control.law)} needs it")
    try:
        return kind(**given)
    except Exception as error:  # whatever the class of a user raises
        raise InputError(f"law = {quote(control.law)} cannot be made: {one_line(error)}") from None


def _class_in(file, name, folder):
    """A class of a Python file, relative to the folder of the scene."""
    path = pathlib.Path(folder or "", file)
    try:
        spec: Any = importlib.util.spec_from_file_location(path.stem, path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return getattr(module, name)
    except Exception as error:  # whatever the file of a user raises
        raise InputError(f"law = {quote(f'{file}:{name}')} cannot be read: {one_line(error)}") from None


class _asked:
    """Failures of a law become one line that names control and time."""

    def __init__(self, control, time):
        self._control, self._time = control, time

    def __enter__(self):
        pass

    def __exit__(self, kind, error, trace):
        if isinstance(error, Exception):
            raise SolverError(
                f"[[control]] {quote(self._control.name)} at t = {self._time:.6g} s: its law failed with "
                f"{type(error).__name__}: {one_line(error)}"
            ) from None
        return False
