"""Numbers of a scene as parameters of its motion: what changes with them in the equations of motion, by differences.

A scene is built with two other values of a number, at a path such as ``cable.area``. All that differs in these systems
has a derivative: data of the cells of each term, masses, prescribed motion and the start. Data are smooth in a number,
forces may have kinks in them. So the step is so small that data change by `CHANGE`, and forces, at the state of the
motion, are differences of order 2 of those terms alone whose data differ.

May change: how steps are sought (`PROBED`, `SHRINKS`, `TRIES`). `CHANGE` balances two errors, of its square and of
rounding. Must stay: public attributes and methods of `Parameter`, which `integrators.tangent`, `gradients` and
`responses` use; a number that changes the net or times of steps is refused. ``refweb gradient`` leaves out the tables
in `FIXED`. Must stay as well: `SELF`, which `gradients` imports. Tests: ``tests/dynamics/test_dynamic_gradients.py``.
"""

from __future__ import annotations

import copy
from functools import cached_property

import numpy as np

from ..errors import InputError
from ..messages import quote
from ..reference.paths import with_value
from ..statics.gradients import number_and_size
from ..system.static_system import at_rest
from .integrators.snaps import gaps_of, is_damped

CHANGE = 3e-7
"""Largest relative change of data by a step: its square and rounding over it leave errors of 1e-9 of a derivative."""
PROBED, SHRINKS, TRIES = 1e-3, 100.0, 3
"""First step over the size of a number, ratio of further steps where a value is refused, number of steps."""
SELF, OTHERWISE = "self_contact", 0.5
"""Name of the contact of lines in ``chosen`` of a scene; change of a number, over its size, by which choices differ."""
FIXED = ("schema", "title", "seed", "solve", "output", "accuracy", "observe", "event")
"""Tables whose numbers are none of the motion."""


class Parameter:
    """A number of a scene.

    Parameters
    ----------
    scene : refweb.Scene
        Dynamic scene with its stiffness of contact.
    system : refweb.system.system.System
        Its system.
    path : str
        Path of the number.
    equilibrium : ndarray, shape (rows, 3), optional
        Displacement of the equilibrium that the run starts from [m]; by default it starts as built.

    Attributes
    ----------
    number : float
        Its value.
    size : float
        Its size; of a number that is 0 that of those beside it, else 1.
    step : float
        Its change in the ``systems``.
    systems : tuple of refweb.system.system.System
        Systems with a value below and above.
    differing : list of int
        Numbers of the terms of the system whose forces depend on it.
    start : ndarray, shape (2, rows, 3)
        Derivatives of displacement and velocity at the start.

    Raises
    ------
    InputError
        For a path without a number, one of `FIXED`, a number that cannot be changed to both sides, and one that changes
        the net itself or times at which steps end.
    """

    def __init__(self, scene, system, path, equilibrium=None):
        self.path, self._scene, self._system, self._given = path, scene, system, scene.to_dict()
        if path.partition(".")[0] in FIXED:
            raise InputError(f"path {quote(path)} is no number of the motion: it sets what is computed of it, or how")
        self.number, self.size = number_and_size(self._given, path)
        self.step, self.systems = self._beside = self._changed()
        if not all(np.array_equal(changed.corners, system.corners) for changed in self.systems):
            raise InputError(
                f"{path} = {self.number:g} is a time of a table, at which steps end, and has no gradient: vary it by "
                "refweb sweep"
            )
        low, high = self.systems
        self.start = (_start_of(high) - _start_of(low)) / (2.0 * self.step)
        if equilibrium is not None:
            self.start[0] = self._moved(equilibrium)
        self.differing = [n for n, pair in enumerate(zip(low.terms, high.terms, strict=True)) if _differ(*pair)]
        if _relative(low.net.line_data.matrix, high.net.line_data.matrix) or _tables(low) != _tables(high):
            over = [n for n, term in enumerate(system.terms) if term.over_lines]
            self.differing = sorted({*self.differing, *over})
        self._lighter = self._inverse_of(high) - self._inverse_of(low)
        self._outs = system.per_cell()
        over = any(system.terms[n].over_lines for n in self.differing)
        self._damped = over and is_damped(system)

    def _changed(self):
        """(Step, systems) for a change of data by `CHANGE`."""
        for tried in range(TRIES):
            step = PROBED * self.size / SHRINKS**tried
            try:
                systems = self._built(step)
                change = max(_change(*systems), CHANGE)
                return (
                    (step, systems)
                    if change == CHANGE
                    else (step * CHANGE / change, self._built(step * CHANGE / change))
                )
            except InputError as error:
                refused = error
        raise InputError(f"{self.path} = {self.number:g} cannot be changed to both sides: {refused}")

    def _built(self, step):
        """Systems with the number less and more a step."""
        systems = tuple(self.system_at(self.number + sign * step) for sign in (-1.0, 1.0))
        if not all(_same_net(changed, self._system) for changed in systems):
            raise InputError(f"{self.path} changes the net itself, and has no gradient")
        return systems

    @cached_property
    def chosen(self):
        """Stiffness of contact that refweb chose and would choose otherwise at other numbers, by name of its body."""
        if not self._scene.chosen:
            return {}
        given = copy.deepcopy(self._given)
        bodies = given.get("contact", {}).get("bodies", {})
        for name in self._scene.chosen:
            (given if name == SELF else bodies)[name].pop("stiffness")
        by_number = []
        for share in (0.0, -OTHERWISE, OTHERWISE):
            try:
                changed = with_value(given, self.path, self.number + share * self.size)
                by_number.append(_stiffness_of(type(self._scene).from_dict(changed, self._scene.folder).settled()))
            except InputError:  # a number on one side alone
                continue
        now = _stiffness_of(self._scene)
        return {n: now[n] for n in self._scene.chosen if len({chosen[n] for chosen in by_number}) > 1}

    def beside(self, step):
        """Systems with the number less and more a step; the last ones are kept."""
        if step != self._beside[0]:
            self._beside = step, self.systems if step == self.step else self._built(step)
        return self._beside[1]

    def system_at(self, value):
        """The system with another value of the number."""
        scene = type(self._scene).from_dict(with_value(self._given, self.path, float(value)), self._scene.folder)
        return scene.build()

    def _moved(self, x):
        """Derivative of the displacement x of an equilibrium, K⁻¹ ∂f/∂p, shape (rows, 3)."""
        from ..statics.adjoint import Adjoint

        rest, low, high = (at_rest(system) for system in (self._system, *self.systems))
        change = (high.force(0.0, x) - low.force(0.0, x)) / (2.0 * self.step)
        try:
            if not rest.symmetric or rest.drives:
                raise InputError("it has loads that follow it, or motion")
            return Adjoint(rest, 0.0, x).multipliers(np.where(rest.supported, 0.0, change))[0]
        except InputError as error:
            raise InputError(
                f"the equilibrium that the run starts from has no derivative by {self.path}: {error}"
            ) from None

    def _inverse_of(self, system):
        """Inverse masses, 0 where a row is without one, shape (rows, 1)."""
        mass = system.net.mass
        return np.where(mass > 0.0, 1.0 / np.where(mass > 0.0, mass, 1.0), 0.0)[:, None]

    def add_rate(self, t, x, v, f, inverse, rate):
        """Add ∂(M⁻¹f)/∂p at a state with the force f to ``rate``, all of shape (rows, 3)."""
        if self._lighter.any():
            rate += np.where(inverse > 0.0, self._lighter / (2.0 * self.step), 0.0) * f
        if self.differing:
            by_side = []
            for system in self.systems:
                force = np.zeros_like(x)
                for n in self.differing:
                    term = system.terms[n]
                    term.force(t, x, v, force, term.cells, system.data_of(term, t), self._outs[n])
                by_side.append(force)
            change = by_side[1] - by_side[0]
            if self._damped:
                self._take_one_side(t, x, v, change)
            rate += inverse * (change / (2.0 * self.step))

    def _take_one_side(self, t, x, v, change):
        """Take the change of the force of elements whose damping is in one of the systems alone to the other side.

        It is twice the difference from the motion, where the line is slack or taut as well.
        """
        low, high = self.systems
        sides = [gaps_of(system, t, x) >= 0.0 for system in (low, self._system, high)]
        for same, ends in ((sides[1] == sides[2], (self._system, high)), (sides[1] == sides[0], (low, self._system))):
            at = np.flatnonzero(same & (sides[0] != sides[2]))
            for n in [n for n in self.differing if self._system.terms[n].over_lines and len(at)]:
                for system, factor in ((high, -1.0), (low, 1.0), (ends[1], 2.0), (ends[0], -2.0)):
                    term, force = system.terms[n], np.zeros_like(x)
                    term.force(t, x, v, force, term.cells[at], system.data_of(term, t)[at], self._outs[n][at])
                    change += factor * force

    def driven(self, t, at, rows):
        """Derivatives of positions at t, and of velocities ``at`` a time, of rows with prescribed motion."""
        ends = []
        for system in self.systems:
            x, v, aside = (np.zeros((system.rows, 3)) for _ in range(3))
            system.drive(t, x)
            system.drive(at, aside, v)
            ends.append((x[rows], v[rows]))
        (x_low, v_low), (x_high, v_high) = ends
        return (x_high - x_low) / (2.0 * self.step), (v_high - v_low) / (2.0 * self.step)


def _stiffness_of(scene):
    """Stiffness of contact by the name of the body, and of lines with each other by `SELF`."""
    given = scene.to_dict()
    bodies = {name: body.get("stiffness") for name, body in given.get("contact", {}).get("bodies", {}).items()}
    return {**bodies, SELF: given.get(SELF, {}).get("stiffness")}


def _start_of(system):
    """Displacement and velocity at the start of an integrator, shape (2, rows, 3)."""
    x = np.zeros((system.rows, 3)) if system.laid is None else system.laid.copy()
    v = system.initial_velocity()
    v[system.supported] = 0.0
    system.drive(0.0, x, v)
    return np.array([x, v])


def _same_net(first, second):
    """Tell if two systems have the same rows, unknowns and cells, so that their states can be compared."""
    same = first.rows == second.rows and np.array_equal(first.free, second.free)
    same = same and [term.name for term in first.terms] == [term.name for term in second.terms]
    return same and all(np.array_equal(a.cells, b.cells) for a, b in zip(first.terms, second.terms, strict=True))


def _relative(low, high):
    """Largest change of the columns of two arrays over the size of each."""
    if np.shape(low) != np.shape(high):
        return np.inf
    low, high = (np.nan_to_num(np.reshape(part, (len(part), -1)), posinf=0.0, neginf=0.0) for part in (low, high))
    size = np.maximum(np.abs(low), np.abs(high)).max(axis=0, initial=0.0)
    change = np.abs(high - low).max(axis=0, initial=0.0)
    return float(np.max(change / np.where(size > 0.0, size, 1.0), initial=0.0))


def _tables(system):
    """Tables of the factors of natural lengths."""
    return [table for _, table in system.net.factors]


def _differ(low, high):
    """Tell if two terms may have different forces."""
    return (
        low.force is not high.force or low.data is not None and not np.array_equal(low.data, high.data, equal_nan=True)
    )


def _change(low, high):
    """Largest relative change of what two systems are."""
    pairs = [(low.net.line_data.matrix, high.net.line_data.matrix), (low.net.mass[:, None], high.net.mass[:, None])]
    pairs += [(a.data, b.data) for a, b in zip(low.terms, high.terms, strict=True) if a.data is not None]
    pairs += [(a.data, b.data) for a, b in zip(low.drives, high.drives, strict=True)]
    pairs += list(zip(_start_of(low), _start_of(high), strict=True))
    pairs += [(np.array(a), np.array(b)) for a, b in zip(_tables(low), _tables(high), strict=True)]
    return max(_relative(*pair) for pair in pairs if len(pair[0]))
