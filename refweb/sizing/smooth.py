"""Sizing by gradients: sequential quadratic programming over numbers between bounds.

With fractions u of ranges, an objective f and reserves r that must stay above a small distance, an optimum within
bounds has multipliers λ ≥ 0 with

    ∇f = Σ λ ∇r,    λ r = 0

(Karush, Kuhn and Tucker), where bounds have multipliers as well. `refweb.sizing.sqp` finds it.

Derivatives are those of the adjoint. One that no adjoint gives, as that of a frequency that others are equal to and
leave, is a difference of runs.

A largest value has a kink where two lines or nodes share it. A condition that this value is below a limit is one for
each of these that is close to it, and each of these is smooth. An objective with a largest value is a further variable
t, which is least, with t ≥ f of each that is close.

May change: `INSIDE`, `STEP`, `PRECISE`, `BY_DIFFERENCES`, `NEAR`, `ACTIVE`, `ROUNDED` and `FARTHEST`, by which an
optimum is found within other tolerances and takes more or fewer runs. Must stay: `Smooth` and what it returns, an
`Optimum`, which `search` takes; columns that are read, by `case.slope_of` and `case.part_of`; conditions of an optimum,
which tests check; public names of `Smooth`, which other files use. Tests: ``tests/sizing/test_size.py``.
"""

from __future__ import annotations

import math
import re
from typing import Any, NamedTuple

import numpy as np

from .case import part_of, slope_of
from .runs import middle
from .space import Design
from .sqp import minimise

INSIDE = 1e-9
"""Distance that the lower ends of reserves keep from 0."""
STEP = 1e-4
"""Step of differences of runs, over the range."""
PRECISE, BY_DIFFERENCES, NEAR = 1e-11, 1e-6, 1e-5
"""Lengths of steps, over ranges, at which a search ends: by adjoints, by differences, and where none is feasible."""
ACTIVE = 1e-5
"""Reserve below which a requirement counts as active, and distance of a fraction to a bound."""
ROUNDED = 1e-12
"""Distance of a fraction to a bound that is one of rounding."""
FARTHEST = 1e3
"""Largest violation of a requirement, over its limit, that is looked for, and reserve of lines that are not close."""
OBJECTIVE = -1
"""Number of the objective among parts of requirements."""
PART = re.compile(r"(.*) of (line|node) (\d+)")
"""Columns of `refweb.sizing.case.part_of`."""


class Optimum(NamedTuple):
    """A design with the conditions of its optimum.

    Attributes
    ----------
    judged : refweb.sizing.runs.Judged
        The design and its results.
    multipliers : dict of str to float
        Change of the objective by the reserve of each requirement that is active.
    bounds : dict of str to float
        The same of all numbers at a bound, by their fraction; 0 of one that the bound does not hold.
    residual : float
        Part of the gradient that the multipliers do not balance, over its size.
    """

    judged: object
    multipliers: dict[str, float]
    bounds: dict[str, float]
    residual: float


class Point(NamedTuple):
    """A design: objective over its size with gradient, reserves and their half widths (parts,), and constraints.

    ``rows`` has a value and a gradient (n,) by the number of a part and by its line or node, or None for all; of
    `OBJECTIVE` those of the objective over its size.
    """

    f: float
    df: np.ndarray
    r: np.ndarray
    wide: np.ndarray
    rows: dict[tuple[int, int | None], tuple[float, np.ndarray]]


class Smooth:
    """Objective and reserves over the numbers between bounds, for one choice of everything else.

    Parameters
    ----------
    runs : refweb.sizing.runs.Runs
        Runs of designs.
    options : tuple of int
        The choice.
    requirements : dict of str to refweb.sizing.formulas.Criterion, optional
        Conditions by name, of ``or`` one side; by default those of the problem, of ``or`` the side that is nearest.
    """

    def __init__(self, runs, options, requirements=None):
        self.runs, self.options, self.problem = runs, options, runs.problem
        self._requirements = requirements or self.problem.requirements
        self.count, self.coarse, self._points = len(self.problem.space.free), False, {}
        self.size: Any = None
        self.parts = [name for name, f in self._requirements.items() for _ in f.parts]
        self._keys = {(n, None): n for n in range(len(self.parts))}

    def design(self, u):
        """The design at some fractions, which are 0 or 1 at a bound but for rounding."""
        return Design(tuple(float(x if ROUNDED < x < 1.0 - ROUNDED else x > 0.5) for x in u), self.options)

    def at(self, u):
        """The `Point` at some fractions."""
        design = self.design(u)
        if design not in self._points:
            self._points[design] = self._computed(design)
        return self._points[design]

    def _computed(self, design):
        (judged,) = self.runs.of([design], slopes=True)
        if not math.isfinite(judged.value):
            none, count = np.zeros(self.count), len(self.parts)
            rows: dict[tuple[int, int | None], tuple[float, np.ndarray]] = {
                (n, None): (-1.0, none) for n in range(count)
            }
            return Point(math.inf, none, -np.ones(count), np.zeros(count), rows)
        values, row = self.runs.values_of(judged), judged.rows[0]
        numbers = {name: middle(v) if isinstance(v, tuple) else v for name, v in values.items()}
        slopes = {name: self._slope(name, row, design) for name in self.problem.results}
        for n, (name, given) in enumerate(self.problem.space.free.items()):
            slopes[name] = np.eye(self.count)[n] * given.slope(design.shares[n])
        lacking = [name for name, slope in slopes.items() if slope is None]
        slopes |= self._differences(design, lacking) if lacking else {}
        self.coarse = self.coarse or bool(lacking)
        ((f, df),) = self.problem.objective.slopes(numbers, slopes)
        self.size = self.size or abs(f) or 1.0
        r, wide, lines = [], [], self._lines(row, design)
        rows = self._of_objective(numbers, slopes, lines, self.problem.objective.number(values).high)
        for formula in self._requirements.values():
            each = self._by_line(formula, numbers, slopes, lines)
            pairs = zip(formula.slopes(numbers, slopes), formula.reserves(values), strict=True)
            for part, ((value, slope), reserve) in enumerate(pairs):
                near = {line: pairs_of[part] for line, pairs_of in each.items()}
                lowest = min((v for v, _ in near.values()), default=-math.inf)
                if lowest < reserve.low - ROUNDED * (1.0 + abs(value)):
                    near, lowest = {None: (value, slope)}, value
                rows |= {(len(r), line): (v, np.zeros(self.count) + dv) for line, (v, dv) in near.items()}
                r.append(lowest)
                wide.append(max(lowest - reserve.low, 0.0))
        df = (np.zeros(self.count) + df) / self.size
        return Point(f / self.size, df, np.array(r), np.array(wide), rows)

    def _of_objective(self, numbers, slopes, lines, high):
        """Rows of the objective by line or node, where it is the largest of these values, up to ``high`` within ±."""
        formula = self.problem.objective
        ((f, df),) = formula.slopes(numbers, slopes)
        near = {line: pairs[0] for line, pairs in self._by_line(formula, numbers, slopes, lines).items()}
        if not near or max(v for v, _ in near.values()) > high + ROUNDED * (1.0 + abs(f)):
            near = {None: (f, df)}
        return {(OBJECTIVE, n): (v / self.size, (np.zeros(self.count) + dv) / self.size) for n, (v, dv) in near.items()}

    def _lines(self, row, design):
        """{Line or node: (value, gradient)} by result, of those whose value is close to the largest."""
        lines = {}
        for match in filter(None, map(PART.fullmatch, row)):
            key, (name, kind, n) = match[0], match.groups()
            if name in self.problem.results and row[key] is not None:
                at = part_of(name, kind, n)
                lines.setdefault(name, {})[int(n)] = (row[at], self._slope(at, row, design))
        return lines

    def _by_line(self, formula, numbers, slopes, lines):
        """Value and gradient of each part by line, of a formula that holds one largest value."""
        names = formula.used & lines.keys()
        if len(names) != 1:
            return {}
        (name,) = names
        return {
            line: formula.slopes(numbers | {name: value}, slopes | {name: slope})
            for line, (value, slope) in lines[name].items()
        }

    def _constraints(self, point, kept):
        """Lower ends above the reserves that are kept, and gradients, of all lines that were close so far.

        Of the objective it is the reserve to its largest value.
        """
        for key in point.rows:
            self._keys.setdefault(key, len(self._keys))
        r, dr = np.full(len(self._keys), FARTHEST), np.zeros((len(self._keys), self.count))
        for (part, line), (value, slope) in point.rows.items():
            at = self._keys[part, line]
            if part == OBJECTIVE:
                r[at], dr[at] = point.f - point.rows[part, line][0], -slope
            else:
                r[at], dr[at] = value - point.wide[part] - kept[part], slope
        return r, dr

    def _groups(self):
        """Number of the part of each constraint, 0 of the objective."""
        return np.array([part - OBJECTIVE for part, _ in self._keys])

    def _of_largest(self, point):
        """True for each constraint that is one of the objective at a point."""
        present = [key for key in point.rows if key[0] == OBJECTIVE]
        return np.array([key in present for key in self._keys])

    def _slope(self, name, row, design):
        """Gradient of a result by fractions, None where the row lacks one."""
        total = np.zeros(self.count)
        for path, n, factor in self.problem.space.slopes(design):
            slope = row.get(slope_of(name, path))
            if slope is None:
                return None
            total[n] += factor * slope
        return total

    def _differences(self, design, names):
        """Gradients by fractions, of differences of runs to both sides, at a bound to one."""
        ends = []
        for n, share in enumerate(design.shares):
            for side in (-1.0, 1.0):
                moved = min(max(share + side * STEP, 0.0), 1.0)
                ends.append(Design((*design.shares[:n], moved, *design.shares[n + 1 :]), design.options))
        values = [self.runs.values_of(judged) for judged in self.runs.of(ends)]
        slopes = {name: np.zeros(self.count) for name in names}
        for n, (low, high) in enumerate(zip(values[::2], values[1::2], strict=True)):
            apart = ends[2 * n + 1].shares[n] - ends[2 * n].shares[n]
            for name in names:
                if low is not None and high is not None:
                    slopes[name][n] = (middle(high[name]) - middle(low[name])) / apart
        return slopes

    def optimise(self, u, reserve=0.0):
        """Least design from a start, with reserves of at least ``reserve``; the fractions."""
        u, kept = np.array(u, float), np.full(len(self.parts), reserve + INSIDE)
        largest = (OBJECTIVE, None) not in self.at(u).rows and math.isfinite(self.at(u).f)
        tolerance = BY_DIFFERENCES if self.coarse else PRECISE

        def functions(u):
            point = self.at(u)
            r, dr = self._constraints(point, kept)
            return point.f, point.df, np.where(self._of_largest(point), FARTHEST, r), dr, self._groups()

        def of_largest(ut):
            """Solve as `functions`, of t above each value of the objective."""
            point = self.at(ut[:-1])
            r, dr = self._constraints(point, kept)
            above = self._of_largest(point)
            r = r + np.where(above, ut[-1] - point.f, 0.0) if math.isfinite(point.f) else r
            f = ut[-1] if math.isfinite(point.f) else math.inf
            return f, np.eye(self.count + 1)[-1], r, np.column_stack([dr, above]), self._groups()

        if not largest:
            return minimise(functions, u, np.zeros(self.count), np.ones(self.count), tolerance)
        lower, upper = np.append(np.zeros(self.count), -FARTHEST), np.append(np.ones(self.count), FARTHEST)
        return minimise(of_largest, np.append(u, self.at(u).f), lower, upper, tolerance)[:-1]

    def nearest(self, u):
        """Design whose largest violation is least, from a start: t is least with r + t ≥ 0; the fractions."""

        def functions(ut):
            r, dr = self._constraints(self.at(ut[:-1]), np.zeros(len(self.parts)))
            r[self._of_largest(self.at(ut[:-1]))] = FARTHEST
            dr = np.hstack([dr, np.ones((len(r), 1))])
            return ut[-1], np.eye(self.count + 1)[-1], r + ut[-1], dr, self._groups()

        start = np.append(u, max(-self.at(u).r.min(), 0.0))
        lower, upper = np.append(np.zeros(self.count), -1.0), np.append(np.ones(self.count), FARTHEST)
        return minimise(functions, start, lower, upper, NEAR)[:-1]

    def _multipliers(self, u):
        """(Multipliers of all parts, those of numbers at a bound, what they leave of the gradient over its size)."""
        from scipy.optimize import nnls

        point = self.at(u)
        r, dr = self._constraints(point, np.full(len(self.parts), INSIDE))
        sides = np.where(u <= ACTIVE, 1.0, np.where(u >= 1.0 - ACTIVE, -1.0, 0.0))
        at_bound, active = np.flatnonzero(sides), np.flatnonzero(r <= ACTIVE)
        above = self._of_largest(point)[active]
        size = np.linalg.norm(dr[active[above]], axis=1).max() or 1.0
        # With t: Σ μ ∇f = Σ λ ∇r, and the μ of values of the objective sum to 1.
        normals = np.vstack([dr[active].reshape(-1, self.count), (np.eye(self.count) * sides)[at_bound]])
        normals = np.column_stack([normals, size * np.append(above, np.zeros(len(at_bound)))])
        scale = np.linalg.norm(normals, axis=1)
        scale[scale == 0.0] = 1.0
        solved, left = nnls((normals / scale[:, None]).T, np.append(np.zeros(self.count), size))
        solved = solved / scale
        multipliers, names = np.zeros(len(self.parts)), list(self.problem.space.free)
        parts = self._groups()[active] + OBJECTIVE
        np.add.at(multipliers, parts[~above], solved[: len(active)][~above])
        of_bounds = {names[n]: float(value) for n, value in zip(at_bound, solved[len(active) :], strict=True)}
        return multipliers, of_bounds, float(left / size)

    def optimum(self, u):
        """The `Optimum` at some fractions."""
        multipliers, of_bounds, residual = self._multipliers(u)
        by_name = {}
        for name, value in zip(self.parts, multipliers, strict=True):
            if value > 0.0:
                by_name[name] = by_name.get(name, 0.0) + float(value * self.size)
        (judged,) = self.runs.of([self.design(u)], slopes=True)
        return Optimum(judged, by_name, {name: value * self.size for name, value in of_bounds.items()}, residual)
