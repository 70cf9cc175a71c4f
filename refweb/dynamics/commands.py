"""Commands: values of effects that change during a run, and what they do to a system and to a run.

A command changes one number or vector at a history row, where steps end, and the value stays until the next command. It
writes to the numbers of cells in place: kernels, cells and sizes of tables stay, so that the compiled loop goes on. A
rate goes on from the value of its table: a reel and a motion have no jump.

Balances stay closed. A command changes the energy of gravity at once, which counts as work, and formulas of impulses,
whose values at the start change by as much as those of the time.

May change: private methods, `SHORTEST` and `NEAR`. `NUMBERS` has the keys after whose change `only_numbers_differ` lets
a restart use the system again. Must stay: keys of `INPUTS` and `RATES`, which are paths that users write; numbers are
written in place, so that arrays of the compiled loop keep their addresses; texts of `save` and `arrays`, which
checkpoints keep. A further input is an entry there and nothing else, if the numbers of its term follow from the new
table of the effect. Must stay as well: all names that `stepped_run`, `sweeps.episodes` and other files import; public
names of `Inputs` and `Commands`, which other files use. Tests: ``tests/dynamics/test_stepped_run.py``,
``test_control.py``.
"""

from __future__ import annotations

import json
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..effects.base import ForceTerm
from ..effects.time_tables import flattened
from ..errors import InputError
from ..messages import nearest, quote, short
from ..registry import EFFECTS, name_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from ..scene import Scene
    from ..system.system import System
    from .controllers import Controller
    from .integrators.integrator import History, Integrator, IntegratorState
    from .schedule import Schedule

NUMBERS = {
    "load": ("force", "torque"),
    "thrust": ("force",),
    "pressure": ("value",),
    "gravity": ("acceleration",),
}
"""Keys of each effect whose values are numbers of a term alone."""
INPUTS = {**NUMBERS, "winch": ("speed", "limit", "tension", "power")}
"""Keys of each effect that a command may set."""
RATES = {
    "reel": {"rate": ("factor", 1)},
    "motion": {"velocity": ("displacement", 3), "angular_velocity": ("rotation", 3)},
}
"""Rates of each effect, with the table over time that they continue and its number of columns."""
TORQUE = "axle.torque"
"""Key of the torque about the axle of a body."""
SHORTEST = 0.01
"""Share of its length down to which a rate reels in a line."""
NEAR = 1e-9
"""Share of the time between rows within which a command is at a row."""


class Command(NamedTuple):
    """A value that changes.

    Attributes
    ----------
    time : float
        Time of a history row [s].
    path : str
        Path of the value, ``load.0.force``; names of effects and keys are those of `INPUTS` and `RATES`.
    value : float or sequence of float
        The value from then on; a tension below 0 counts as 0.
    """

    time: float
    path: str
    value: Any


def not_negative(path: str) -> bool:
    """True for the path of a tension of a winch, of which a value below 0 counts as 0."""
    return path.startswith("winch.") and path.endswith(".tension")


def widened(scene: Scene) -> Scene:
    """The scene with tables of reels and motions of two rows or more, which begin at 0: values are the same."""
    solve: Any = scene.solve
    end, effects = solve.duration, []
    for effect in scene.effects:
        tables = {table: columns for table, columns in RATES.get(str(name_of(EFFECTS, effect)), {}).values()}
        changed = {}
        for name, columns in tables.items():
            rows = getattr(effect, name)
            if rows is None and getattr(effect, "body", None) is not None and name == "displacement":
                rows = ((0.0, *(0.0,) * columns),)
            if rows is None:
                continue
            rows = [tuple(row) for row in rows]
            rows = [(0.0, *rows[0][1:]), *rows] if rows[0][0] > 0.0 else rows
            changed[name] = rows if len(rows) > 1 else [*rows, (max(end, rows[0][0]) + 1.0, *rows[0][1:])]
        effects.append(replace(effect, **changed) if changed else effect)
    return scene.replace(effects=tuple(effects))


def only_numbers_differ(scene: Scene, changed: Scene) -> list[tuple[str, int, Any]] | None:
    """Effects of a changed scene that differ in initial velocities or in `NUMBERS`, by name and number.

    None where the scenes differ in more, and where an equilibrium or a stiffness of contact follows from such numbers.
    """
    compared = [f.name for f in fields(scene) if f.compare and f.name != "effects"]
    same = all(getattr(scene, name) == getattr(changed, name) for name in compared)
    starts = getattr(scene.solve, "start", "web") == "web" and not scene.left_out()
    if not same or not starts or len(scene.effects) != len(changed.effects):
        return None
    changes, counts = [], {}
    for given, effect in zip(scene.effects, changed.effects, strict=True):
        name = str(name_of(EFFECTS, given))
        counts[name] = counts.get(name, -1) + 1
        if given == effect:
            continue
        if type(given) is not type(effect) or not (name == "velocity" or _alike(given, effect, NUMBERS.get(name, ()))):
            return None
        changes.append((name, counts[name], effect))
    return changes


def _alike(given, effect, keys):
    """True if two effects differ in values of some keys that both have, at most."""
    for key in keys:
        value = getattr(effect, key)
        if (value is None) != (getattr(given, key) is None):
            return False
        given = given if value is None else given.with_value(key, value)
    return bool(keys) and given == effect


class Inputs:
    """Values of the effects of a system that commands may set.

    Parameters
    ----------
    system : refweb.system.system.System
        System of a scene that is `widened`; its arrays are written.

    Attributes
    ----------
    present : dict
        Effects that differ from those of the scene, by name and number.

    Raises
    ------
    InputError
        Beside ``[rupture]``.
    """

    def __init__(self, system: System) -> None:
        if system.weakness is not None:
            raise InputError("commands cannot stand beside [rupture]: leave out one of them")
        self._system, self._first = system, {}
        self._given: dict[str, list[Any]] = {}
        self._acting: dict[str, list[Any]] = {}
        for acting, _ in system.acting:
            effect = getattr(acting, "effect", None)
            if effect is not None:
                name = str(name_of(EFFECTS, effect))
                self._given.setdefault(name, []).append(effect)
                self._acting.setdefault(name, []).append(acting)
        self.present: dict[tuple[str, int], Any] = {}

    def reset(self) -> None:
        """Give all numbers the values of the scene."""
        for array, values in self._first.values():
            array[...] = values
        self.present.clear()
        self._system.forget_lengths()

    def take_on(self, changes: list[tuple[str, int, Any]]) -> None:
        """Take other effects as those of the scene, by name and number, as `only_numbers_differ` gives them."""
        self.reset()
        for name, number, effect in changes:
            writes: list[Any] = self._writes(name, self._given[name][number], effect) if name in INPUTS else []
            for array, part, numbers in writes:
                array[part] = numbers
            self._given[name][number] = effect
            self._acting[name][number].effect = effect
        self._first.clear()

    def restore(self, present: dict[tuple[str, int], Any]) -> None:
        """Take the values of another `Inputs` of the same scene."""
        for (name, number), effect in present.items():
            self._write(self._writes(name, self._given[name][number], effect))
        self.present = dict(present)

    def arrays(self) -> list[Any]:
        """Present values as plain ones, for a checkpoint."""
        return [[name, number, effect.to_dict()] for (name, number), effect in self.present.items()]

    def restore_arrays(self, values: list[Any]) -> None:
        """Take the values of a checkpoint."""
        self.restore({(name, number): type(self._given[name][number]).read(name, v) for name, number, v in values})

    def checked(self, command: Command) -> list[Any]:
        """Check a command, and return what `apply` writes.

        Raises
        ------
        InputError
            For a path or a value that a command cannot have.
        """
        try:
            name, number, effect = self._changed(command, command.time)
            writes = self._writes(name, self._given[name][number], effect)
        except InputError as error:
            raise InputError(f"{short(command.path)} = {quote(command.value)}: {error}") from None
        self.present[name, number] = effect
        return writes

    def refuse_factor(self, path: str) -> None:
        """Refuse a path of a force with a factor over time, which would change what is set; `InputError`."""
        name, _, rest = path.partition(".")
        number = self._number(name, rest.partition(".")[0], self._given[name]) if self._given[name][0].several else 0
        if getattr(self._given[name][number], "factor", None) is not None and name in INPUTS:
            raise InputError(f"sets = {quote(path)}: its factor would multiply what is set: leave that out")

    def apply(self, writes: list[Any], integrator: Integrator, course: IntegratorState) -> None:
        """Write the numbers of checked commands in a run, and keep the balances of the run closed."""
        system, t, x, v = self._system, course.time, course.x, course.v
        terms = [term for term in system.terms if any(term.data is array for array, *_ in writes)]
        acting = terms if len(terms) == len(writes) else system.terms  # a motion or a length acts on all
        before = self._force_of(acting, t, x, v), *self._booked(terms, t, x)
        self._write(writes)
        force, energy, impulse = self._force_of(acting, t, x, v), *self._booked(terms, t, x)
        course.work[-1] += energy - before[1]
        course.ledger.given[:] += impulse - before[2]
        integrator.renew(course, force - before[0])

    def _force_of(self, terms, t, x, v):
        """Force of some terms on every row [N]."""
        force = np.zeros_like(x)
        for term in terms:
            self._system.force_of(term, t, x, v, force)
        if self._system.carriers:
            self._system.carriers.add_forces_to_bodies(x, force)
        return force

    def _booked(self, terms, t, x):
        """Energy of terms that are booked by it [J], and the values of their formulas of impulses [N s]."""
        energy, impulse = 0.0, np.zeros(3)
        for term in terms:
            if term.balance.power is None:
                energy += float(self._system.energy_of(term, t, x).sum())
            if term.balance.impulse is not None and not term.balance.internal:
                term.balance.impulse(t, x, term.cells, term.data, impulse)
        return energy, impulse

    def _write(self, writes):
        for array, part, numbers in writes:
            self._first.setdefault(id(array), (array, array.copy()))
            array[part] = numbers
        self._system.forget_lengths()

    def _changed(self, command, t):
        """(Name, number, new effect) that a command asks for at time t."""
        name, _, rest = command.path.partition(".")
        known = [*INPUTS, *RATES, "body"]
        if name not in known:
            raise InputError(f"{quote(name)} has nothing that a command may set, {nearest(name, known)}")
        effects = self._given.get(name, [])
        if not effects:
            raise InputError(f"the scene has no [{name}]")
        number, key = 0, rest
        if effects[0].several:
            word, _, key = rest.partition(".")
            number = self._number(name, word, effects)
        effect = self.present.get((name, number), effects[number])
        if name == "body":
            return name, number, self._with_torque(effect, key, command.value)
        if key in RATES.get(name, {}):
            return name, number, self._with_rate(name, effect, key, command.value, t)
        keys = [*INPUTS.get(name, ()), *RATES.get(name, {})]
        if key not in keys:
            keys = [key for key in keys if name != "winch" or getattr(effect, key) is not None]
            raise InputError(f"{quote(key)} is not a key of [{name}] that a command may set, {nearest(key, keys)}")
        if name == "winch":
            return name, number, effect.commanded(key, _finite(command.value, 1)[0])
        if getattr(effect, key) is None:
            raise InputError(f"there is no {key} that it could change: give one in the scene, such as [0, 0, 0]")
        return name, number, effect.with_value(key, command.value)

    @staticmethod
    def _number(name, word, effects):
        if word.isdecimal() and int(word) < len(effects) and not hasattr(effects[0], "name"):
            return int(word)
        named = {getattr(effect, "name", None): i for i, effect in enumerate(effects)}
        if word in named:
            return named[word]
        if not word.isdecimal() or int(word) >= len(effects):
            names = [*map(str, range(len(effects))), *filter(None, named)]
            raise InputError(f"{quote(word)} is not the number or name of a [[{name}]], {nearest(word, names)}")
        return int(word)

    @staticmethod
    def _with_torque(body, key, value):
        if key != TORQUE:
            raise InputError(f"{quote(key)} is not a key of [[body]] that a command may set, only {TORQUE}")
        if body.axle is None or body.axle.torque is None:
            raise InputError(f"body {quote(body.name)} has no {TORQUE}: give it in the scene, such as 0.0")
        axle = replace(body.axle, torque=_finite(value, 1)[0])
        if isinstance(body.axle.torque, tuple):
            axle = replace(axle, torque=[(row[0], axle.torque) for row in body.axle.torque])
        return replace(body, axle=axle)

    def _with_rate(self, name, effect, key, value, t):
        """The effect whose table goes on with a rate from time t."""
        table, columns = RATES[name][key]
        rows, rate = getattr(effect, table), _finite(value, columns)
        if rows is None:
            raise InputError(f"there is no {table} that it could continue: give one in the scene")
        if name == "reel" and effect.mass == "follows":
            raise InputError('a reel with mass = "follows" has its factor from the scene alone')
        if name == "reel" and any(term.contact.crossing is not None for term in self._system.terms):
            raise InputError("[self_contact] needs to know natural lengths ahead: give the factor in the scene")
        if table == "rotation":
            self._refuse_without_axle(effect)
        rows = np.array(rows)
        now = np.array([np.interp(t, rows[:, 0], column) for column in rows[:, 1:].T])
        end = max(self._system.net.end, t) + 1.0
        if name == "reel" and rate[0] < 0.0:
            end = min(end, t + (1.0 - SHORTEST) * now[0] / -rate[0])
        last = now + rate * (end - t)
        later = [(end + 1.0 + i, *last) for i in range(len(rows) - 2)]
        return replace(effect, **{table: [(t, *now), (end, *last), *later]})

    def _refuse_without_axle(self, motion):
        body = next((body for body in self._system.net.bodies if body.name == motion.body), None)
        if body is None or body.axle is None:
            raise InputError(f"body = {quote(motion.body)} turns about no axle: angular velocities need one")

    def _writes(self, name, given, effect):
        """[(whole array, part of it, numbers)] of what an effect writes in place of that of the scene."""
        system = self._system
        if name == "body":
            return self._writes_of_torque(given, effect)
        if name == "winch":
            return effect.writes(system)
        if name == "reel":
            at = next(i for i, (_, table) in enumerate(system.net.factors) if table is given.factor)
            return [(system.lengths.tables[at], ..., np.array(flattened(effect.factor)))]
        old = next(parts for acting, parts in system.acting if getattr(acting, "effect", None) is given)
        if name == "load" and effect.body is None:
            return [(part.data, ..., effect.numbers(part.data)) for part in old]
        new = effect.on(system.net)
        writes = []
        for part, changed in zip(old, new if isinstance(new, list) else [new], strict=True):
            same = np.array_equal(part.cells, changed.cells) and part.data.shape == changed.data.shape
            if not same or isinstance(part, ForceTerm) and part.force is not changed.force:
                raise InputError("it would change more than numbers, which a command cannot")
            columns = getattr(part, "of_field", ...)  # a winch has other ones
            writes.append((part.data, columns, changed.data[columns]))
        return writes

    def _writes_of_torque(self, given, body):
        rigid = next(rigid for rigid in self._system.net.bodies if rigid.name == given.name)
        for term in self._system.terms:
            if rigid.axle is not None and term.name == "axle" and term.cells[0, 0] == rigid.spin:
                table = body.axle.at(body.position).torque
                return [(term.data, ..., np.array([[*rigid.axle.direction, *flattened(table)]]))]
        raise InputError(f"body {quote(given.name)} does not turn freely")


def _finite(value, count):
    """A value as an array of so many finite numbers."""
    try:
        numbers = np.array(value, dtype=float).reshape(-1)
    except (TypeError, ValueError):
        numbers = np.zeros(0)
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise InputError(f"must be {'a finite number' if count == 1 else f'{count} finite numbers'}")
    return numbers


class Commands:
    """Commands of a run at the numbers of its rows: those of controls, and given ones.

    Parameters
    ----------
    inputs : Inputs
        Values that they set.
    schedule : refweb.dynamics.schedule.Schedule
        Times of the history rows.
    given : iterable of Command
        Given commands.
    controllers : list of refweb.dynamics.controllers.Controller
        Controls of the scene.
    table : callable
        Rows of ``history.csv`` of a `refweb.dynamics.integrators.integrator.History`.

    Raises
    ------
    InputError
        For a time that is not that of a row.
    """

    def __init__(
        self,
        inputs: Inputs,
        schedule: Schedule,
        given: Iterable[Sequence[Any]],
        controllers: list[Controller],
        table: Callable[..., NDArray[np.float64]],
    ) -> None:
        self.inputs: Inputs = inputs
        self.controllers: list[Controller] = controllers
        self._by_row: dict[int, list[Command]] = {}
        self._table = table
        for entry in given:
            command = _command(entry)
            self.refuse_controlled(command.path)
            self._by_row.setdefault(row_at(schedule.times, command.time), []).append(command)

    def refuse_controlled(self, path: str) -> None:
        """Refuse a command on what a control sets; `InputError`."""
        for controller in self.controllers:
            if controller.control.sets == path:
                raise InputError(
                    f"{path} is set by [[control]] {quote(controller.control.name)}: leave out one of them"
                )

    def reset(self) -> None:
        """Begin at the values of the scene."""
        self.inputs.reset()
        for controller in self.controllers:
            controller.reset()

    def until(self, first: int) -> float:
        """Number of the first row from ``first`` on that has commands; infinite without one."""
        rows = [row for row in self._by_row if row >= first]
        return min([*rows, *(controller.next_row(first) for controller in self.controllers)], default=np.inf)

    def act(self, row: int, integrator: Integrator, course: IntegratorState, history: History) -> None:
        """Apply the commands of a row, the last of a history: those of controls first."""
        values = self._table(history[-1:])[0] if self.controllers and len(history) else None
        self.act_on(row, integrator, course, values)

    def act_on(self, row: int, integrator: Integrator, course: IntegratorState, values: Any) -> None:
        """Apply the commands of a row of ``history.csv`` with these values."""
        due = [] if course.stopped else [controller for controller in self.controllers if controller.due(row)]
        for commands in ([controller.command(row, values, course.x) for controller in due], self._by_row.get(row)):
            if commands:
                writes = [write for command in commands for write in self.inputs.checked(command)]
                self.inputs.apply(writes, integrator, course)

    def save(self) -> str:
        """State for a checkpoint, as text."""
        controllers = [controller.arrays() for controller in self.controllers]
        return json.dumps({"controllers": controllers, "inputs": self.inputs.arrays()})

    def load(self, text: str) -> None:
        """Take the state of a checkpoint, at the values of the scene."""
        saved = json.loads(text)
        self.inputs.restore_arrays(saved["inputs"])
        for controller, arrays in zip(self.controllers, saved["controllers"], strict=True):
            controller.restore(arrays)


def _command(entry):
    """A command of (time, path, value)."""
    try:
        time, path, value = entry
        return Command(float(time), str(path), value)
    except (TypeError, ValueError):
        raise InputError(f"commands: {short(repr(entry))} must be (time, path, value)") from None


def row_at(times: NDArray[np.float64], time: float) -> int:
    """Number of the history row at a time [s]; `InputError` for a time between rows."""
    row = int(np.argmin(np.abs(times - time)))
    interval = times[1] - times[0]
    if not abs(times[row] - time) <= NEAR * interval:
        raise InputError(
            f"t = {time:.9g} s is not the time of a history row: rows are each {interval:.6g} s, "
            "which [output] interval decides"
        )
    return row
