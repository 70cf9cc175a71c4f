"""Run of a design in a worker: results, sizes of the web, margin, frequencies, and derivatives by free numbers.

`Task` travels to workers by pickle; its cells are columns of `results.csv`, and `slope_of` names those of derivatives.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from typing import NamedTuple

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
GOVERNING = "stress of the smallest margin"
"""Name of the stress that margin and utilisation follow from."""
NEAR, MOST = 0.3, 16
"""Distance to the largest value, over it, within which lines have derivatives of their own, and their number."""
STEP = 1e-3
"""Step of a difference of a size over its number: sizes are polynomials of low degree, or close to them."""


def slope_of(name, path):
    """Column of the derivative of a result by the number at a path."""
    return f"{name} by {path}"


def of_line(name, line):
    """Column of the value of a line, for a result that is the largest of lines."""
    return f"{name} of line {line}"


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
        return {**summary, "results": results, "more": self._slopes(scene, solution, summary, vibrations)}

    def _slopes(self, scene, solution, summary, vibrations):
        """Derivatives by column; one that no adjoint gives is left out."""
        if not self.numbers:
            return {}
        from ..statics.gradients import Gradients

        slopes, near = {}, _near_lines(scene, solution, self.results)
        sizes, strength = ([n for n in self.results if n in known] for known in (SIZES, STRENGTH))
        for path, number in self.numbers if sizes else ():
            by_difference = _by_difference(scene, path, number)
            slopes |= {slope_of(n, path): by_difference[n] for n in sizes}
        more = [observe for lines in near.values() for _, observe in lines]
        more += [_governing(summary)] if strength else []
        try:
            gradients = Gradients(replace(solution, scene=scene.replace(observe=(*scene.observables, *more))))
        except InputError:
            return slopes
        slopes |= _of_lines(gradients, near, [path for path, _ in self.numbers])
        observed = [o.name for o in scene.observables]
        for name, (path, _) in itertools.product(self.results, self.numbers):
            try:
                if slope_of(name, path) in slopes:
                    continue
                if name in observed or FREQUENCY.fullmatch(name):
                    gradient = (gradients if name in observed else vibrations).gradient(name, path)
                    if gradient.left is None:  # at a kink those by several paths have no sum
                        slopes[slope_of(name, path)] = float(gradient)
                elif name in STRENGTH:
                    slopes[slope_of(name, path)] = _slope_of_strength(gradients, summary, name, path)
            except (InputError, SolverError):
                continue
        return slopes


def _near_lines(scene, solution, names):
    """(Value, `Observe`) of lines close to the largest, by the name of a result that is the largest value of lines."""
    from ..results.observables.line import Strain, Stress, Tension
    from ..results.observables.observe import Observe

    near, net = {}, solution.state.system.net
    for observe in scene.observables:
        if observe.name not in names or observe.select not in (None, "max") or observe.part is not None:
            continue
        if type(observe.observable) in (Strain, Stress, Tension):
            elements = observe.observable.elements(net)
            values = observe.observable.values(solution.state)[elements]
            largest = np.full(len(net.web.lines), -np.inf)
            np.maximum.at(largest, net.line[elements], values)
            order = np.argsort(-largest, kind="stable")[:MOST]
            lines = order[largest[order] >= largest.max() - NEAR * abs(largest.max())]
            near[observe.name] = [
                (float(largest[n]), Observe(name=of_line(observe.name, n), quantity=observe.quantity, line=int(n)))
                for n in lines
            ]
    return near


def _of_lines(gradients, near, paths):
    """Values and derivatives of the lines close to the largest one, whose derivatives are those of the result."""
    cells = {}
    for name, lines in near.items():
        try:
            of_name = {}
            for value, observe in lines:
                slopes = {path: gradients.gradient(observe.name, path) for path in paths}
                if all(slope.left is None for slope in slopes.values()):
                    of_name[observe.name] = value
                    of_name |= {slope_of(observe.name, path): float(slope) for path, slope in slopes.items()}
            first = lines[0][1].name
            if first in of_name:
                cells |= of_name | {slope_of(name, path): of_name[slope_of(first, path)] for path in paths}
        except (InputError, SolverError):
            continue
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
    return int(FREQUENCY.fullmatch(name)[1])


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


def _governing(summary):
    """Observable of the stress that the margin of safety and the utilisation of a static solution follow from."""
    from ..results.observables.observe import Observe

    return Observe(name=GOVERNING, quantity="stress", line=summary["margin"]["line"])


def _slope_of_strength(gradients, summary, name, path):
    """Derivative of the margin or of the utilisation by the number at a path."""
    from ..statics.gradients import LIMITS

    margin = summary["margin"]
    if path.rpartition(".")[2] in LIMITS or margin["value"] is None or margin["line"] != summary["utilisation"]["line"]:
        raise InputError(f"{name} depends on {path} in another way than by a stress")
    slope = float(gradients.gradient(GOVERNING, path))
    stress, allowed = margin["stress"], margin["allowed"]
    return slope / margin["strength"] if name == "utilisation" else -allowed / stress**2 * slope
