"""Gradients of results of statics by numbers of the scene, with ±.

By line and group they follow from the adjoint of the equilibrium alone, see `refweb.statics.adjoint`. By one number of
the scene, at a path such as ``cable.area`` or ``load.0.force.2``, J + λ·f is differentiated at the displacement of the
equilibrium, by systems that are built with other values of the number: no equilibrium is solved again.

May change: private functions, sizes of steps. Must stay: fields of `Gradient` and keys of `BY_LINE` and `BY_NODE`,
which users read and write through `Solution.gradient` and ``refweb gradient``; paths are those of ``--set``.
`dynamics.gradients`, `studies.frequency_gradients` and `sizing.case` use names of this file. `KNOWN` has only terms
that `adjoint` knows. Must stay as well: all names that `studies.frequency_gradients`, `sizing.case` and other files
import; public names of `Gradients`, which other files use; `Gradients._refuse_kinks`, which `frequency_gradients`
calls. Tests: ``tests/statics/test_gradients.py``.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..messages import nearest, quote, row_of, short
from ..reference.paths import with_value
from ..results.state import State
from ..system.static_system import at_rest
from .adjoint import Adjoint
from .responses import responses

if TYPE_CHECKING:
    from numpy.typing import NDArray

BY_LINE = {
    "cable.modulus": "Pa",
    "cable.area": "m²",
    "cable.density": "kg/m³",
    "cable.prestrain": "1",
    "natural_length": "m",
}
"""Numbers that lines have each, with their units; the others of a line stay as they are."""
BY_NODE = {"force": "N", "position": "m"}
"""Vectors of nodes: a force on it, and the position of a support, with the natural lengths as they are."""
KNOWN = ("elasticity", "load", "gravity", "frame", "orbit", "pressure", "thrust", "contact", "thread")
"""Terms that do not depend on numbers of lines but as `refweb.statics.adjoint` knows."""
MOVED = 1e-7
"""Displacement by which a possible error of x is enlarged for its effect, over the shortest natural length."""
SHARES = (2.0, 3.0)
"""Factors on the effects of the residual and of rounding in ±."""
KINK = 1e-12
"""Strain by rounding within which a line counts as neither slack nor taut."""
FELT = 1e-9
"""Virtual stretch of a line, over the largest, below which it does not count for a result."""
STEPS, LARGEST_STEP, SHRINKS = 5, 1e-2, 8.0
"""Number of tries of a difference by a number of the scene, the first step over its size, and their ratio."""
SKIPPED = ("schema", "title", "seed", "web", "solve", "output", "accuracy", "observe", "event", "supports", "support")
"""Tables whose numbers are not among `numbers_of`."""
LIMITS = ("strength", "safety_factor", "knot_factor")
"""Keys without effect on equilibria."""
FEW = 3
"""Largest length of a list whose numbers are taken one by one."""
ENOUGH = 1e-9
"""Relative error of a difference that is small enough."""


@dataclass(frozen=True)
class Gradient:
    """Derivatives of a result.

    Attributes
    ----------
    result, path : str
        The result, and the number of the scene.
    by : {"", "line", "group", "node"}
        Kind of the entries; empty for one number.
    names : tuple
        Number of the line or node, or name of the group, of each entry; one empty text for one number.
    value, error : ndarray
        Derivative and ± of each entry, shape (entries,), by node (nodes, 3).
    left : ndarray, optional
        Derivative for a number that falls, where that is another one than for one that rises, of the same shape: two
        lines or nodes share the largest value, or in dynamics two peaks, or a size is 0, or a value has a kink. None
        where there is one derivative.
    unit : str
        Unit of the derivative; of numbers of other tables that of the result, per unit of the number.
    number : float, optional
        The number of the scene; None by line, group and node.
    equal : tuple of str
        Natural frequencies that are equal within ±, of which the result is one; empty for other results. They keep
        their order: the lowest has the least derivative for a number that rises, and the largest for one that falls.
    notes : tuple of str
        In dynamics, stiffness of contact that refweb chose by the number; the derivative is that without its change.
    """

    result: str
    path: str
    by: str
    names: tuple[Any, ...]
    value: NDArray[np.float64]
    error: NDArray[np.float64]
    left: NDArray[np.float64] | None
    unit: str
    number: float | None = None
    equal: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __float__(self) -> float:
        """The derivative by one number."""
        if self.value.size != 1:
            raise InputError(f"a gradient by {self.by} has {self.value.size} numbers: take its value")
        return float(self.value.ravel()[0])


class Gradients:
    """Gradients of the results of a static solution at its last load step.

    Parameters
    ----------
    solution : refweb.Solution
        The solution.

    Raises
    ------
    InputError
        For a solution of dynamics, and lines that have yielded and turned back.
    """

    of_modes = False
    """True if the equilibrium may be that of a scene of dynamics."""

    def __init__(self, solution):
        self.scene, state = solution.scene, solution.state
        if state is None or not (self.of_modes or state.system.net.quasi_static):
            raise InputError('gradients are those of equilibria: [solve] kind = "static", with a solution')
        system = at_rest(state.system)
        for thread in (thread for thread in system.net.threads if thread.rings):
            raise InputError(f"gradients take no friction or winch, as of {thread.title}: it depends on the path")
        if system.net.wound:
            raise InputError("gradients take no [[winch]] on lines: what it has wound depends on the path")
        self._yields = state.plastic_strain is not None
        self._yielded = self._yields and state.plastic_strain.any()
        if self._yields:
            from .monotone_loading import turned_back

            if turned_back(system, state.time, state.x):
                raise InputError("gradients take no line that has yielded and turned back: it depends on the path")
        self.state = State(self._at_once(system), state.time, state.x)
        self._results, self._observed = {}, {o.name: o for o in self.scene.observables}

    def _at_once(self, system):
        """The system with curves in place of yield, of lines that have not turned back; itself where none yields."""
        if not self._yields:
            return system
        from .monotone_loading import of_curves

        return of_curves(system)

    @cached_property
    def linear(self):
        """The `refweb.statics.adjoint.Adjoint` of the equilibrium."""
        return Adjoint(self.state.system, self.state.time, self.state.x)

    @cached_property
    def _moved(self):
        """(The `Adjoint` at an enlarged error of x, factor to that of the error) by the residual and by rounding."""
        linear, moved = self.linear, []
        scale = MOVED * linear.net.natural_length.min()
        for factor, deviation in zip(SHARES, linear.deviations, strict=True):
            size = np.abs(deviation).max()
            if size > 0.0:
                step = np.where(linear.system.supported, 0.0, scale / size * deviation)
                x = linear.system.moved(linear.x, step)
                moved.append((Adjoint(linear.system, linear.t, x, linear.newton), factor * size / scale))
        return moved

    def of(self, result):
        """Pairs of a `refweb.statics.responses.Response` and its multipliers, at the equilibrium and beside it.

        A list of lists, of each response: (`Adjoint`, `Response`, λ, share of the error).
        """
        if result not in self._results:
            self._refuse_unknown(result)
            try:
                self._results[result] = [self._solved(item) for item in self._responses(result)]
            except InputError as error:
                raise InputError(f'gradient of "{result}": {error}') from None
        return self._results[result]

    def _refuse_unknown(self, result):
        """Refuse a result that the scene does not have."""
        if result not in self._observed:
            raise InputError(
                f'result "{short(result)}" is none of this scene, {nearest(result, self._observed)}; frequencies are '
                "results of refweb.modes(scene), which has gradients as well"
            )

    def _responses(self, result):
        """The `refweb.statics.responses.Response` of each line, node or pair of shapes that has a part in a result."""
        observe = self._observed[result]
        if self._yielded and observe.quantity in ("strain_energy", "plastic_energy"):
            raise InputError("of lines that yield observe the total_energy")
        if self._yielded and observe.quantity == "total_energy" and self.state.system.net.factors:
            raise InputError(
                "where lines yield beside [[reel]] or [temperature], the energy depends on the path: take tensions or "
                "displacements, or solve the scene again with other numbers"
            )
        return responses(observe, self.linear)

    def _solved(self, response):
        """The multipliers of a response, their last correction, and those beside the equilibrium."""
        rows, change = self.linear.multipliers(response.slope)
        if response.doubt is not None:
            change = change + self.linear.multipliers(response.doubt)[0]
        self._refuse_kinks(np.abs(self.linear.lines.stretch(rows - response.reacting)))
        solved = [(self.linear, response, rows, 1.0), (self.linear, None, change, 1.0)]
        for linear, factor in self._moved:
            beside = response.again(linear)
            solved.append((linear, beside, linear.multipliers(beside.slope)[0], factor))
        for beside, factor in response.beside:
            try:
                near = self.linear.multipliers(beside.slope)[0]
            except InputError:  # an error that moves parts without stiffness, on which the result does not depend
                near = rows
            solved.append((self.linear, beside, near, factor))
        return solved

    def _refuse_kinks(self, along):
        """Refuse lines that are neither slack nor taut, and that move in what the result depends on.

        ``along`` is the size of their move, shape (cells, points).
        """
        linear, net = self.linear, self.linear.net
        kinked = (net.law_is("convex") & ~net.forming)[:, None]
        strains = net.slackness[:, None]
        if self._yields:
            from .monotone_loading import corners_of

            strains = np.hstack([strains, corners_of(self.state.system.net)])
        error = np.abs([linear.lines.stretch(move) for move in linear.deviations]).sum(axis=0)
        error = error / (net.weights * net.natural_length[:, None])
        felt = along > FELT * along.max(initial=0.0)
        for number, strain in enumerate(strains.T):
            near = np.abs(linear.lines.strain - strain[:, None]) <= KINK + 3.0 * error
            for element in np.flatnonzero((near & felt & kinked).any(axis=1))[:1]:
                where = "between yielding and not" if number else "neither slack nor taut"
                raise InputError(
                    f"line {net.line[element]} is {where}, where the result has a kink: change loads or prestrain"
                )

    def gradient(self, result, path, by=None):
        """The `Gradient` of a result, see `refweb.Solution.gradient`."""
        refuse_no_texts(result, path, self._observed, self._given)
        if by not in (None, "line", "group", "node"):
            raise InputError(f'by = {quote(by)} must be "line", "group" or "node", or be left out')
        if path in BY_NODE:
            values = [self._by_node(solved, path) for solved in self.of(result)]
            names, unit, by = tuple(range(self.linear.net.nodes)), BY_NODE[path], "node"
        elif by in ("line", "group"):
            if path not in BY_LINE:
                raise InputError(f"by {by} there is no {quote(path)}, {nearest(path, BY_LINE)}")
            self._refuse_by_line(path)
            values = [self._by_line(solved, path) for solved in self.of(result)]
            names, unit = tuple(range(len(self.linear.net.web.lines))), BY_LINE[path]
            if by == "group":
                groups = self.linear.net.web.groups
                rest = np.setdiff1d(np.array(names), np.concatenate([[], *groups.values()]))
                members = {**groups, **({"": rest} if len(rest) else {})}
                names = tuple(members)
                values = [[np.array([v[list(m)].sum() for m in members.values()]) for v in pair] for pair in values]
        elif by == "node":
            raise InputError(f"by node there is no {quote(path)}, {nearest(path, BY_NODE)}")
        elif path == "natural_length":
            raise InputError('natural_length is a number of each line: give by = "line" or "group"')
        else:
            names, unit = ("",), BY_LINE.get(path, "")
            if self._is_of_all_lines(path):
                every = [self._by_line(solved, path) for solved in self.of(result)]
                values = [(value.sum(keepdims=True), error.sum(keepdims=True)) for value, error in every]
            else:
                values = self._by_number(result, path)
        return self._assembled(result, path, by or "", names, values, unit)

    def _assembled(self, result, path, by, names, values, unit):
        """The `Gradient` of the values and errors of each response."""
        every, errors = (np.array([pair[k] for pair in values]) for k in (0, 1))
        right, left, error = self._sides(result, every, errors)
        one_sided = (abs(right - left) > 2.0 * error + 1e-9 * np.abs(every).max(initial=0.0)).any()
        of_result = self._unit(result)
        unit = f"{of_result} per {unit}" if unit else of_result
        number = None if by else number_at(self._given, path)
        gradient = Gradient(result, path, by, names, right, error, left if one_sided else None, unit, number)
        return replace(gradient, equal=self._equal(result))

    def _sides(self, result, every, errors):
        """(Derivatives for numbers that rise, for numbers that fall, ±) by those of each response."""
        low, high = every.min(axis=0), every.max(axis=0)
        right, left = (low, high) if self._observed[result].select == "min" else (high, low)
        return right, left, errors.max(axis=0)

    def _unit(self, result):
        """Unit of a result."""
        return self._observed[result].unit

    def _equal(self, result):
        """Names of results that are one value within ±, of which a derivative takes part in each."""
        return ()

    # By line and node

    def _refuse_by_line(self, path):
        """Refuse terms and laws by whose numbers of lines nothing is known."""
        system, net = self.state.system, self.linear.net
        for term in system.terms:
            if term.name not in KNOWN:
                raise InputError(f"by line and group [{term.name}] is not taken: name one number of the scene")
        if system.net.flows:
            raise InputError('by line and group [[reel]] mass = "follows" is not taken: name one number of the scene')
        if path != "cable.modulus" and system.carried.any() and self.linear.weight:
            raise InputError("by line and group mass beside [[attach]] is not taken: name one number of the scene")
        if path != "cable.modulus" and net.consistent_minus_lumped is not None and system.rotating:
            raise InputError(
                'by line and group mass = "consistent" in axes that turn is not taken: name one number of the scene'
            )
        for element in np.flatnonzero(net.forming)[:1] if path != "cable.density" else ():
            raise InputError(f"{path} of line {net.line[element]} has no meaning, whose law is one of form finding")
        curves = "curve" in (net.line_data.dtype.names or ())
        for element in np.flatnonzero(net.line_data["curve"] > 0.0)[:1] if curves and path == "cable.modulus" else ():
            law = "yields: name one number of the scene" if self._yields else "has a curve"
            raise InputError(f"cable.modulus by line and group is not taken: line {net.line[element]} {law}")

    def _is_of_all_lines(self, path):
        """Tell if a number of the cable is that of each line, and nothing else follows from it."""
        cable, (table, _, key) = self.scene.cable, path.partition(".")
        if path not in BY_LINE or table != "cable" or cable.viscous is not None or self.linear.net.web.length_given:
            return False
        tables = (cable, *cable.groups.values())
        apart = any(getattr(group, key) is not None or group.law not in (None, cable.law) for group in tables[1:])
        drawn = any(getattr(given, name) is not None for given in tables for name in ("pretension", "sag", "material"))
        try:
            self._refuse_by_line(path)
        except InputError:
            return False
        return not apart and not drawn

    def _sensitivity(self, linear, response, rows):
        """The `refweb.statics.adjoint.Sensitivity` of a response, or of a change of multipliers alone."""
        if response is None:
            return linear.work(rows)
        return linear.work(rows - response.reacting).plus(response.explicit)

    def _by_line(self, solved, path):
        """(Derivative, ±) by a number of each line, both of shape (lines,)."""
        values = self._line_values
        return _with_error([(values(linear, response, rows, path), share) for linear, response, rows, share in solved])

    def _line_values(self, linear, response, rows, path):
        """Derivatives by a number of each line at one state."""
        net, by_numbers = linear.net, self._sensitivity(linear, response, rows)
        given = self._properties
        modulus, area, density = (given[key][net.line] for key in ("modulus", "area", "density"))
        built = self.state.system.net.natural_length
        stretched, by_mass = net.natural_length / built, linear.by_element_mass(by_numbers)
        if path == "cable.modulus":
            values = area * by_numbers.axial
        elif path == "cable.area":
            values = np.where(self._of_tension[net.line], 0.0, modulus * by_numbers.axial) + by_numbers.area
            values = values + density * built * by_mass
        elif path == "cable.density":
            values = area * built * by_mass
        else:
            values = (stretched * by_numbers.length + density * area * by_mass) / net.subdivide
            if path == "cable.prestrain":
                length = built * net.subdivide
                values = -values * length**2 / self._distance[net.line]
        return np.bincount(net.line, values, len(net.web.lines))

    @cached_property
    def _properties(self):
        """Numbers of each line, see `refweb.net.cable.Cable.properties`."""
        return self.scene.cable.properties(self.linear.net.web, True)

    @cached_property
    def _of_tension(self):
        """True for each line whose curve is one of tension, whatever its area is."""
        curves = self._properties.get("curve", np.full(len(self.linear.net.web.lines), None))
        return np.array([curve is not None and curve.unit == "N" for curve in curves])

    @cached_property
    def _distance(self):
        """Distance of the ends of each line in the web [m]."""
        web = self.linear.net.web
        return np.linalg.norm(web.points[web.lines[:, 1]] - web.points[web.lines[:, 0]], axis=1)

    def _by_node(self, solved, path):
        """(Derivative, ±) by the force on each node, or by its position where it is a support, shape (nodes, 3)."""

        def values(linear, response, rows):
            none = np.zeros_like(rows)
            reacting, slope = (none, none) if response is None else (response.reacting, response.slope)
            if path == "force":
                loaded = none if response is None or response.loaded is None else response.loaded
                return (rows - reacting + loaded)[: linear.net.nodes]
            at = np.where(linear.system.supported, slope - linear.pulled(rows), 0.0)
            return at[: linear.net.nodes]

        value, error = _with_error([(values(*item[:3]), item[3]) for item in solved])
        if path == "position" and solved[0][1].doubt is not None:
            error = error + np.where(self.linear.system.supported, np.abs(solved[0][1].doubt), 0.0)[: len(error)]
        return value, error

    # By one number of the scene

    def together(self, results, path):
        """The `Gradient` of several results by one number, by the same systems, a dict; without those refused."""
        solved = {}
        for result in results:
            with contextlib.suppress(InputError):
                solved[result] = self.of(result)
        if self._is_of_all_lines(path):
            return {result: self.gradient(result, path) for result in solved}
        pairs = iter(self._of_number([item for items in solved.values() for item in items], path) if solved else ())
        values = {result: [next(pairs) for _ in items] for result, items in solved.items()}
        return {result: self._assembled(result, path, "", ("",), values[result], "") for result in solved}

    def _by_number(self, result, path):
        """Pairs of derivative and ± by one number of the scene, one of each response, each of shape (1,)."""
        return self._of_number(self.of(result), path)

    def _of_number(self, solved, path):
        """Solve as `_by_number`, by the multipliers of responses of some results."""
        number, size = number_and_size(self._given, path)
        best: Any = None
        before = None
        for attempt in range(STEPS):
            step = LARGEST_STEP * size / SHRINKS**attempt
            value, error, rounding = self._differences(solved, path, number, step)
            if before is not None:  # whose error is larger than that of this step
                error = np.minimum(error, np.abs(value - before)[:, 0])
            before, rounded = value, (error <= rounding).all()
            error = error + rounding
            if best is None or error.max() < best[1].max():
                best = value, error
            if rounded or (best[1] <= ENOUGH * np.abs(best[0][:, 0])).all():
                break
        pairs = []
        for values, error in zip(*best, strict=True):
            total, spread = _with_error(list(zip(values[:, None], [item[3] for item in solved[0]], strict=True)))
            pairs.append((total, spread + error))
        return pairs

    @cached_property
    def _given(self):
        """The dict of the scene."""
        return self.scene.to_dict()

    def _differences(self, solved, path, number, step):
        """Derivatives by differences of two steps, (responses, states), and errors by the step and by rounding."""
        try:
            by_step = {k: self._lagrangians(solved, path, number + k * step) for k in (-2, -1, 1, 2)}
        except InputError as error:
            raise InputError(f"{path} = {number:g} cannot be changed to both sides: {error}") from None
        wide = (by_step[2] - by_step[-2]) / (4.0 * step)
        narrow = (by_step[1] - by_step[-1]) / (2.0 * step)
        value = (4.0 * narrow - wide) / 3.0
        tension = np.abs(self.state.element_tension).max(initial=0.0)
        summed = np.array([np.linalg.norm(items[0][2]) * tension + items[0][1].size for items in solved])
        summed += np.abs(by_step[1][:, 0])
        return value, np.abs(value - narrow)[:, 0], 4.0 * np.finfo(float).eps * summed / abs(step)

    def _step_of(self, scene, system):
        """The last load step of a scene whose load steps change."""
        corners = system.corners
        if (np.abs(corners - self.state.time) <= LARGEST_STEP * abs(self.state.time)).any():
            raise InputError(f"a table of a load or motion has a corner near t = {self.state.time:g}")
        return scene.solve.load_steps[-1]

    def _lagrangians(self, solved, path, value):
        """J + λ·f at the displacements of the equilibrium and beside it, for another number, (responses, states)."""
        from ..scene import Scene

        scene = Scene.from_dict(with_value(self._given, path, float(value)), self.scene.folder)
        system, t = self._at_once(at_rest(scene.build())), self.state.time
        if path.startswith("solve.load_steps."):
            t = self._step_of(scene, system)
        if system.rows != self.state.system.rows or not np.array_equal(system.free, self.state.system.free):
            raise InputError("it changes the net itself, and has no gradient")
        forces, states, free = {}, {}, system.free
        for linear, *_ in solved[0]:
            x = linear.x.copy()
            system.drive(t, x)
            states[linear] = State(system, t, x)
            forces[linear] = system.force(t, x).ravel()[free]
        return np.array(
            [
                [
                    (0.0 if response is None else response.value(states[linear])) + rows.ravel()[free] @ forces[linear]
                    for linear, response, rows, _ in items
                ]
                for items in solved
            ]
        )


def _with_error(parts):
    """(Value, ±) from pairs of (value, share): of the state, of a correction, and of states beside it."""
    (value, _), (change, _), *beside = parts
    error = np.abs(change) + sum((share * np.abs(changed - value) for changed, share in beside), 0.0)
    return value, error + 8.0 * np.finfo(float).eps * np.abs(value)


def refuse_no_texts(result, path, results, given):
    """Refuse a result or a path that is no text; the message has ``results`` and paths of the dict of a scene."""
    if not isinstance(result, str):
        raise InputError(f"result = {quote(result)} must be the name of a result: {row_of(list(results))}")
    if not isinstance(path, str):
        raise InputError(f"path = {quote(path)} must be the path of a number: {row_of(numbers_of(given))}")


def number_and_size(given, path):
    """The number at a path in the dict of a scene, and its size: of a number that is 0 that of its list, else 1."""
    number = number_at(given, path)
    if number is None:
        raise InputError(f"path {quote(path)} is no number of this scene, {_remedy(given, path.split('.'))}")
    head, _, last = path.rpartition(".")
    beside = [number_at(given, f"{head}.{k}") for k in range(10)] if last.isdecimal() else []
    largest = max([abs(each) for each in beside if each is not None], default=0.0)
    return number, abs(number) or largest or 1.0


def number_at(given, path):
    """The number at a path in the dict of a scene, None where there is none."""
    value = reduce(_below, path.split("."), given)
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def _below(value: Any, key: str) -> Any:
    """The value at a key, number or name of a table or list, None where there is none."""
    if isinstance(value, dict):
        return value.get(key)
    if not isinstance(value, (list, tuple)):
        return None
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in value]
    at = names.index(key) if key in names else int(key) if key.isdecimal() else len(value)
    return value[at] if at < len(value) else None


def _remedy(given, keys):
    """Range of a number in a path without a number of the scene, else the nearest path that begins as it does."""
    value, head = given, ""
    for key in keys:
        inner = _below(value, key)
        if inner is None:
            if isinstance(value, (list, tuple)) and value and key.isdecimal():
                return f"{short(head[:-1])} has 0 … {len(value) - 1}"
            break
        value, head = inner, f"{head}{key}."
    paths = numbers_of(given)
    begun = [path for path in paths if path.startswith(head)]
    return nearest(".".join(keys), begun or paths)


def numbers_of(given, above=""):
    """Paths of the numbers of a scene that are not whole, but for lists that are tables, a list."""
    paths = []
    for key, value in given.items() if isinstance(given, dict) else enumerate(given):
        path = f"{above}.{key}" if above else str(key)
        if not above and key in SKIPPED or key in LIMITS:
            continue
        if isinstance(value, float):
            paths.append(path)
        elif isinstance(value, dict) or _is_short(value):
            paths += numbers_of(value, path)
    return paths


def _is_short(value):
    """Tell if a value is a list of tables, or of a few numbers."""
    if not isinstance(value, (list, tuple)):
        return False
    return (
        all(isinstance(entry, dict) for entry in value) or len(value) <= FEW and not isinstance(value[0], (list, tuple))
    )
