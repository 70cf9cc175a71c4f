"""Run of a design in a worker: results, sizes of the web, margin, frequencies, and derivatives by free numbers.

May change: private functions, `NEAR` and `MOST`, how many lines and nodes have derivatives of their own, and `STEP`.
Must stay: names in `QUANTITIES` (`SIZES`, `STRENGTH`, `FREQUENCY`), which formulas of users have; fields of `Task`,
which travels by pickle; names of columns by `slope_of` and `part_of`, which `smooth` reads in ``results.csv``;
`sizes_of`, which `problem` imports. Tests: ``tests/sizing/test_size.py``.
"""

from __future__ import annotations

import contextlib
import itertools
import re
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, SolverError

SIZES = {"cable_mass": "kg", "net_mass": "kg", "total_mass": "kg", "cable_length": "m", "packed_volume": "m³"}
"""Sizes of the web, with their units: they are known before a run."""
STRENGTH = ("margin", "utilisation")
"""Numbers of the strength of lines."""
FREQUENCY = re.compile(r"frequency_([1-9]|10)")
"""Names of natural frequencies."""
QUANTITIES = (*SIZES, *STRENGTH, *(f"frequency_{n}" for n in range(1, 11)))
"""Names that every scene has besides its results."""
NEAR, MOST = 0.3, 16
"""Distance to the largest value, over it, within which lines and nodes have derivatives of their own; their number."""
STEP = 1e-3
"""Step of a difference of a size over its number: sizes are polynomials of low degree, or close to them."""


def slope_of(name, path):
    """Column of the derivative of a result by the number at a path."""
    return f"{name} by {path}"


def part_of(name, kind, number):
    """Column of the value of a line or node, for a result that is the largest or smallest of these."""
    return f"{name} of {kind} {number}"


class Part(NamedTuple):
    """Value of a line or node of a result, its derivative by what is observed of it, and its `Observe`."""

    value: float
    factor: float
    observe: Any


class Task(NamedTuple):
    """Computation of a scene: its run, sizes, strength, frequencies and derivatives.

    Attributes
    ----------
    names : tuple of str
        Names among `QUANTITIES`.
    results : tuple of str
        Results and quantities whose derivatives are wanted.
    numbers : tuple of (str, float)
        Paths of the numbers by which they are differentiated, with the numbers.
    """

    names: tuple[str, ...]
    results: tuple[str, ...] = ()
    numbers: tuple[tuple[str, float], ...] = ()

    def __call__(self, scene):
        """The content of a ``run.json`` with `QUANTITIES` among the results; derivatives are ``more``."""
        from ..runner import run

        solution = run(scene, progress=False)
        summary = solution.summary()
        results, of_web = dict(summary["results"]), [n for n in self.names if n in SIZES]
        sizes = sizes_of(scene.build()) if of_web else {}
        results |= {n: {"value": sizes[n], "error": 0.0, "unit": SIZES[n]} for n in of_web}
        results |= {n: _of_strength(n, summary) for n in self.names if n in STRENGTH}
        frequencies = [n for n in self.names if FREQUENCY.fullmatch(n)]
        vibrations = _modes(scene, frequencies) if frequencies else None
        results |= {n: _of_frequency(n, vibrations) for n in frequencies}
        return {**summary, "results": results, "more": self._slopes(scene, solution, vibrations)}

    def _slopes(self, scene, solution, vibrations):
        """Derivatives by column; one that no adjoint gives is left out."""
        if not self.numbers:
            return {}
        from ..statics.gradients import Gradients

        slopes, paths = {}, [path for path, _ in self.numbers]
        sizes, near = [n for n in self.results if n in SIZES], _near(scene, solution, self.results, paths)
        for path, number in self.numbers if sizes else ():
            by_difference = _by_difference(scene, path, number)
            slopes |= {slope_of(n, path): by_difference[n] for n in sizes}
        parts = [part.observe for of_name in near.values() for part in of_name]
        names = [part.name for part in parts] + [o.name for o in scene.observables if o.name in self.results]
        try:
            gradients = Gradients(replace(solution, scene=scene.replace(observe=(*scene.observables, *parts))))
        except InputError:
            names = []
        known = {}
        for path in paths if names else ():
            with contextlib.suppress(InputError, SolverError):
                known |= {(name, path): gradient for name, gradient in gradients.together(names, path).items()}
        for name, path in itertools.product(self.results, paths):
            if FREQUENCY.fullmatch(name) and name not in names:
                with contextlib.suppress(InputError, SolverError):
                    known[name, path] = vibrations.gradient(name, path)
        for (name, path), gradient in known.items():
            if gradient.left is None:  # at a kink those by several paths have no sum
                slopes[slope_of(name, path)] = float(gradient)
        return slopes | _of_parts(slopes, near, paths)


def _near(scene, solution, names, paths):
    """The `Part` of each line or node that is close to the largest, by the name of a result that is the largest."""
    from ..results.observables.line import Strain, Stress, Tension
    from ..results.observables.nodal import Place
    from ..statics.gradients import LIMITS

    near, net, state = {}, solution.state.system.net, solution.state
    for observe in scene.observables:
        observable = observe.observable
        if observe.name not in names or observe.select not in (None, "max") or observe.part is not None:
            continue
        if type(observable) in (Strain, Stress, Tension):
            elements = observable.elements(net)
            numbers, values = _by_line(net, elements, observable.values(state)[elements])
            near[observe.name] = _parts_of(observe.name, "line", observe, numbers, values)
        elif isinstance(observable, Place) and observe.body is None:
            rows = observable.rows(state.system)
            parts = _parts_of(observe.name, "node", observe, rows, observable.sizes(observable.vectors(state)[rows]))
            if len(parts) > 1 and all(part.observe.node < len(net.web.points) for part in parts):
                near[observe.name] = parts
    if any(path.rpartition(".")[2] in LIMITS for path in paths):  # on which strength depends beside stress
        return near
    return near | {name: parts for name in names if name in STRENGTH and (parts := _of_lines(name, solution))}


def _by_line(net, elements, values):
    """(Lines of some elements, largest value of each)."""
    largest = np.full(len(net.web.lines), -np.inf)
    np.maximum.at(largest, net.line[elements], values)
    numbers = np.flatnonzero(np.isfinite(largest))
    return numbers, largest[numbers]


def _parts_of(name, kind, observe, numbers, values, factors=None):
    """The `Part` of the largest values of lines or nodes, observed as they are but each alone."""
    from ..results.observables.observe import Observe

    order = np.argsort(-values, kind="stable")[:MOST]
    order = order[values[order] >= values.max() - NEAR * abs(values.max())]
    parts = []
    for n in order:
        keys: dict[str, Any] = {kind: int(numbers[n]), "quantity": observe.quantity, "component": observe.component}
        factor = 1.0 if factors is None else float(factors[n])
        parts.append(Part(float(values[n]), factor, Observe(name=part_of(name, kind, numbers[n]), **keys)))
    return parts


def _of_lines(name, solution):
    """The `Part` of lines close to the smallest margin or the largest utilisation, if that is of the last load step."""
    from ..results.observables.observe import Observe

    net, margin = solution.state.system.net, solution.margin
    if margin is None or margin["value"] is None or margin["time"] != solution.state.time:
        return []
    limits = net.allowed if name == "margin" else net.strength
    elements = np.flatnonzero(np.isfinite(limits))
    numbers, values = _by_line(net, elements, solution.state.stress[net.line[elements]] / limits[elements])
    stress = Observe(name=name, quantity="stress")
    factors = values / np.maximum(solution.state.stress[numbers], np.finfo(float).tiny)
    parts = _parts_of(name, "line", stress, numbers, values, factors)
    if name == "utilisation":
        return parts
    return [part._replace(value=1.0 / part.value - 1.0, factor=-part.factor / part.value**2) for part in parts]


def _of_parts(slopes, near, paths):
    """Values and derivatives of lines and nodes close to the largest one, whose derivatives are those of the result."""
    cells = {}
    for name, parts in near.items():
        of_name = {}
        for value, factor, observe in parts:
            known = {path: slopes.get(slope_of(observe.name, path)) for path in paths}
            if None not in known.values():
                of_name[observe.name] = value
                of_name |= {slope_of(observe.name, path): factor * slope for path, slope in known.items()}
        first = parts[0].observe.name
        if first in of_name:
            cells |= of_name | {slope_of(name, path): of_name[slope_of(first, path)] for path in paths}
    return cells


def sizes_of(system):
    """`SIZES` of a system, by name."""
    from ..pages.sheet_text import PACKING
    from ..results.provenance import web_of

    web, net = web_of(system), system.net
    return {
        "cable_mass": web["mass"],
        "net_mass": float(net.mass[: net.nodes].sum()),
        "total_mass": web["total_mass"],
        "cable_length": web["cable_length"],
        "packed_volume": web["volume"] / PACKING,
    }


def _of_strength(name, summary):
    """Entry of the margin of safety or of the utilisation, with the interval of its ±."""
    from ..pages.sheet_text import decision

    margin, used = summary.get("margin"), summary.get("utilisation")
    if margin is None or used is None:
        raise InputError(f"{name}: no line has a strength: give [cable] strength [Pa]")
    if name == "utilisation":
        return {"value": used["value"], "error": used["error"], "unit": "1"}
    if margin["value"] is None:
        return {"value": float("inf"), "error": 0.0, "unit": "1", "interval": (float("inf"), float("inf"))}
    error = margin.get("error")
    if error is None:
        return {"value": margin["value"], "error": None, "unit": "1"}
    lower, upper, _ = decision(margin, error * margin["allowed"])
    wide = max(margin["value"] - lower, upper - margin["value"])
    return {"value": margin["value"], "error": wide, "unit": "1", "interval": (lower, upper)}


def _number(name):
    """Number of the mode of a natural frequency."""
    match: Any = FREQUENCY.fullmatch(name)
    return int(match[1])


def _modes(scene, names):
    """Modes of a scene up to one behind some natural frequencies, which tells if that is equal to the last."""
    from ..studies.modes import modes

    return modes(scene, max(map(_number, names)) + 1, progress=False)


def _of_frequency(name, vibrations):
    """Entry of a natural frequency."""
    number = _number(name)
    if number > len(vibrations.frequency):
        raise InputError(f"{name}: the web has {len(vibrations.frequency)} modes")
    value, error = float(vibrations.frequency[number - 1]), float(vibrations.error[number - 1])
    return {"value": value, "error": error, "unit": "Hz"}


def _by_difference(scene, path, number):
    """Derivatives of `SIZES` by the number at a path, by differences of order 4."""
    from ..reference.paths import with_value
    from ..scene import Scene

    given, step, by_step = scene.to_dict(), STEP * (abs(number) or 1.0), {}
    for k in (-2, -1, 1, 2):
        changed = Scene.from_dict(with_value(given, path, number + k * step), scene.folder)
        by_step[k] = sizes_of(changed.build())
    return {
        name: (8.0 * (by_step[1][name] - by_step[-1][name]) - (by_step[2][name] - by_step[-2][name])) / (12.0 * step)
        for name in SIZES
    }
