"""Gradients of results of dynamics by numbers of the scene, with ±, by the tangent of central differences.

The run is repeated with the same steps, and derivatives of its motion go beside it, see
`refweb.dynamics.integrators.tangent`; `refweb.dynamics.parameters` has what a number changes. A result at the end, or
at the time t* of its largest value, has the derivative of its value there: dJ/dp = ∂J/∂x δx + ∂J/∂v δv + ∂J/∂p. t*
changes as well, but J is stationary there.

Peaks in time that ± does not tell apart count as lines that share a largest value, see `refweb.dynamics.peaks`. A size
that is 0, or another value at a kink, has a derivative to each side, see `refweb.dynamics.responses`. A largest value
that is kept for a time in which derivatives differ has none, nor has a motion at a kink, see `refweb.dynamics.kinks`.

± is the difference from the gradient of the step-refinement run, with the factors of the results themselves, see
`refweb.dynamics.twin_error`. At a kink of the force, of a first contact or a line that snaps taut, derivatives have
errors of order 1 in the step, which may agree by chance; so ± takes the differences at all times before as well, and
behind a jump of derivatives, as of a damped line that snaps taut, the factor of order 1. There ± is at least what the
gradient changes where each jump comes a step later.

From the time on at which run and step refinement have no digit of a result in common, it has no gradient, see
`refweb.dynamics.divergence`.

May change: private functions, and constants, which decide what is refused and how wide ± is. Must stay:
`Gradients.gradient`, ``follow`` and ``refuse``, which `solution.gradient` and ``refweb gradient`` call; answers are
`statics.gradients.Gradient`; steps are those of the run itself. An effect that gains a derivative leaves the list of
`_refuse` and enters the text `SUPPORTED`. Tests: ``tests/dynamics/test_dynamic_gradients.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError, SolverError
from ..messages import nearest, quote, short
from ..registry import load
from ..results.observables.fuel import Fuel
from ..results.observables.observe import SIGN
from ..results.observables.slack_fraction import SlackFraction
from ..statics.gradients import BY_LINE, Gradient, refuse_no_texts
from .divergence import divergence, lost_before
from .history import SPREAD
from .integrators.snaps import Shift, is_damped
from .linear_run import LinearRun
from .parameters import SELF, Parameter
from .peaks import kept, pooled
from .schedule import blocks, times_of
from .simulation import Simulation
from .twin_error import largest_mean

SAMPLES = 32
"""Largest number of times at which gradients of run and step refinement are compared."""
LEAST = 1e-7
"""± over the size of a gradient that differences of data and of values may leave."""
AMPLIFIED = 10.0
"""± of a gradient without a digit, over the size of the result over that of the number, from which on it is refused:
a hundredth of the number changes a tenth of the result, one way or the other."""
FINER = 0.1
"""Smaller steps that a refusal names, over those of the scene."""
LONGER = 1.1
"""Interval of history rows that a refusal names, over that of the scene."""
PATHWISE = ("dissipated_energy", "work", "winch_energy", "rupture_energy", "plastic_energy", "step_size")
"""Quantities that are summed over steps."""
SUPPORTED = (
    "lines of laws without memory, loads, gravity, frame, orbit, pressure, thrust, damping, bending, drag, motion, "
    "reels whose mass stays, temperature, threads over nodes, bodies whose orientation does not count, and contact"
)
"""Text of what gradients take."""


class Plain(NamedTuple):
    """A run without derivatives: results without errors, rows as of `Watch.compared`, and its end."""

    results: dict[str, Any]
    rows: np.ndarray
    nsteps: int
    time: float
    stopped: bool


class Gradients:
    """Gradients of the results of a dynamic solution.

    Parameters
    ----------
    solution : refweb.Solution
        The solution.

    Raises
    ------
    InputError
        For methods other than central differences, and effects and starts without derivatives.
    """

    def __init__(self, solution):
        scene, method = solution.scene, solution.solver["method"] or solution.scene.solve.method
        if method != "central-difference":
            raise InputError(
                f'[solve] method = "{method}": gradients of dynamics follow the steps of central differences: use '
                '"central-difference"'
            )
        scene = scene.replace(solve=replace(scene.solve, method=method))
        system = scene.build()
        _refuse(scene, system, solution)
        self._simulation = Simulation(scene, system, load("refweb.solution:Solution")(scene))
        self._observed, self._known, self._at_snaps = {o.name: o for o in scene.observables}, {}, set()
        self._given = {name: result.error or 0.0 for name, result in solution.results.items()}
        self._simulation.settle(lambda text, share: None)
        integrator = self._simulation.integrator
        self._methods = integrator, integrator.refined()
        try:
            self._runs = tuple(map(self._plain, self._methods))
        except SolverError as error:
            raise InputError(f"gradients follow the steps of the scene, which end: {error}") from None
        if self._runs[0].nsteps != solution.solver["nsteps"]:
            raise InputError(
                f"gradients follow the steps of the scene, {self._runs[0].nsteps}, but the run was repeated with "
                f"{solution.solver['nsteps']}: set [solve] safety so low that no run is repeated, without digits"
            )

    def _plain(self, integrator):
        """The `Plain` run of a method."""
        simulation, rows = self._simulation, []
        course = integrator.start(*simulation.begin.motion)
        for block in blocks(integrator, course, simulation.schedule):
            table = simulation.watch.table(block.compared)
            rows.append(simulation.watch.compared(table))
        results = simulation.watch.results(course, table[-1])
        return Plain(results, np.concatenate(rows), course.nsteps, course.time, course.stopped)

    def gradient(self, result, path, by=None):
        """The `refweb.statics.gradients.Gradient` of a result, see `refweb.Solution.gradient`."""
        refuse_no_texts(result, path, self._observed, self._simulation.scene.to_dict())
        if by is not None:
            raise InputError(f"by = {quote(by)} is of statics: in dynamics name one number of the scene")
        observe = self.refuse(result)
        self.follow([path])
        number, by_name = self._known[path]
        known = by_name[result]
        value, left, error, times, errors = known[:5]
        size, moved = abs(self._runs[0].results[result].value), abs(number.number) or number.size
        limit = max(abs(value), AMPLIFIED * (size + self._error_of(result)) / moved)
        if known.kept is not None or size > 0.0 and error > limit and known.rivals is not None:
            raise InputError(f'gradient of "{result}" by {path}: {known.kept or known.rivals}')
        if size > 0.0 and error > limit:
            why = self._why_lost(times[errors > limit], self._runs[0].results[result].time)
            raise InputError(f"the derivative of {result} by {path} is {value:.3g} ± {error:.1g}; {why}")
        unit = f"{observe.unit} per {BY_LINE[path]}" if path in BY_LINE else observe.unit
        arrays: list[Any] = [None if part is None else np.array([part]) for part in (value, error, left)]
        return Gradient(result, path, "", ("",), *arrays, unit=unit, number=number.number, notes=self._notes(number))

    def _why_lost(self, lost, end):
        """Reason and remedy where a derivative has no digit from the first of some ``lost`` times on, or at the end."""
        if len(lost) and self._at_snaps.issuperset(lost):
            interval = self._simulation.scene.output.interval
            return (
                f"a damped line snaps taut at the history row of {lost[0]:.4g} s, which is before it in one and behind "
                f"it in the other of run and step refinement: use [output] interval = {LONGER * interval:.2g} in place "
                f"of {interval:g}, or another without a row there"
            )
        return (
            f"behind the horizon, {lost.min(initial=end):.4g} s, it has no digit with these steps: use "
            f"{self._smaller}; where that does not help, small motions are chaotic, as of slack lines without damping, "
            "even where large ones are not: take a result of an earlier time, add damping, or vary the number by "
            "refweb sweep"
        )

    @property
    def _smaller(self):
        """Text of the key of [solve] that makes steps smaller, with a value."""
        solve = self._simulation.scene.solve
        if solve.step_size:
            return f"[solve] step_size = {FINER * solve.step_size:.2g} or less in place of {solve.step_size:g}"
        return f"[solve] safety = {FINER * self._methods[0].safety:.2g} or less in place of {self._methods[0].safety:g}"

    def _notes(self, number):
        """Texts on stiffness of contact that refweb chose by a number."""
        texts = []
        for name, stiffness in number.chosen.items():
            of = f"[{SELF}]" if name == SELF else f'the contact of body "{short(name)}"'
            texts.append(
                f"stiffness = {stiffness:g} of {of} is one that refweb chose by this number among others, and the "
                "derivative is that without its change: give it, so that runs with other numbers have it as well"
            )
        return tuple(texts)

    def refuse(self, result):
        """Refuse a result without a gradient, and one behind the horizon; return its `refweb.Observe`."""
        if result not in self._observed:
            raise InputError(f'result "{short(result)}" is none of this scene, {nearest(result, self._observed)}')
        observe = self._observed[result]
        name, (first, _) = f'gradient of "{observe.name}"', self._runs
        if not _is_smooth(observe):
            why = "means over a window" if observe.average is not None else f'quantity = "{observe.quantity}"'
            raise InputError(
                f"{name}: {why} have none in dynamics: take values of an instant, such as tensions, energies"
            )
        time = first.results[observe.name].time
        if time >= (horizon := self.horizon(result)):
            raise InputError(
                f"{name}: its time, {time:.4g} s, is behind the horizon, {horizon:.4g} s, from which on the run and "
                f"its step refinement have no digit of it in common: take a result of an earlier time, {self._smaller} "
                "where steps are to blame, or, where the motion is chaotic, refweb trust and an ensemble"
            )
        if first.stopped and time >= first.time:
            raise InputError(
                f"{name}: an event ends the run at its time, which changes with the number: leave out stop"
            )
        return observe

    def horizon(self, result):
        """Time from which on a result has no gradient [s], infinite if there is none."""
        first, finer = (run.rows for run in self._runs)
        chaos, count = divergence(first, finer), min(len(first), len(finer))
        column = 1 + list(self._observed).index(result)
        end = self._runs[0].results[result].time
        known = lost_before(first[:count, 0], first[:count, column], finer[:count, column], end)
        return known if chaos is None else min(known, chaos.lost)

    def follow(self, paths, refused=None):
        """Find the gradients of all results by some paths, in one run and its step refinement.

        Paths that are refused are errors, or get their reasons in the dict ``refused``.
        """
        simulation, numbers = self._simulation, []
        scene, system = simulation.scene, simulation.system
        equilibrium = simulation.begin.x if scene.solve.start == "equilibrium" else None
        for path in dict.fromkeys(paths):
            try:
                numbers += [] if path in self._known else [Parameter(scene, system, path, equilibrium)]
            except InputError as error:
                if refused is None:
                    raise
                refused[path] = str(error)
        if not numbers:
            return
        shifts = [Shift(system, number) for number in numbers] if is_damped(system) else []
        followed = [*numbers, *shifts]
        first, finer = (
            self._linear(method, run, followed) for method, run in zip(self._methods, self._runs, strict=True)
        )
        sizes = np.array([number.size for number in followed])
        self._at_snaps |= first.at_snaps | finer.at_snaps
        every = {}
        for name in first.peaks:
            result = self._runs[0].results[name]
            order = 1 if first.snapped <= result.time else 2
            parts = first, finer, self._factor(order), result, sizes
            every[name] = _with_errors(self._observed[name], *parts, len(shifts))
        for n, number in enumerate(numbers):
            self._known[number.path] = number, {name: parts[n] for name, parts in every.items()}

    def _factor(self, order=2):
        """± over the difference of run and step refinement, of errors of an order in the step."""
        return SPREAD / (1.0 - (self._runs[0].nsteps / self._runs[1].nsteps) ** order)

    def _linear(self, integrator, run, numbers):
        """The `LinearRun` of a method."""
        simulation, observed = self._simulation, [o for o in self._observed.values() if _is_smooth(o)]
        times = times_of(simulation.schedule, 0.0, 0, len(simulation.schedule.times))
        ends = times[(times > 0.0) & (times <= run.time)]
        sampled = set(ends[np.linspace(0, len(ends) - 1, min(len(ends), SAMPLES)).astype(int)].tolist())
        results, errors = ({o.name: of(o.name) for o in observed} for of in (run.results.get, self._error_of))
        linear = LinearRun(integrator, simulation.begin.motion, numbers, observed, results, errors)
        return linear.follow(times, sampled)

    def _error_of(self, name):
        """± of a result, of the solution where it has one."""
        first, finer = (run.results[name].value for run in self._runs)
        return max(self._given[name], self._factor() * abs(first - finer))


class Known(NamedTuple):
    """Derivative of a result by a number for one that rises, for one that falls or None, ±, times, and ± there.

    ``rivals`` and ``kept`` are the reasons by which it may, or does, have none; None where there is no such reason.
    """

    value: float
    left: float | None
    error: float
    times: np.ndarray
    errors: np.ndarray
    rivals: str | None
    kept: str | None


def _with_errors(observe, first, finer, factor, result, sizes, shifts):
    """The `Known` of a result by each of some numbers, a list; ``sizes`` are theirs and, last, those of shifts."""
    name, end, sign, unit = observe.name, result.time, SIGN[observe.reduce], observe.unit
    pool = pooled(first.peaks[name], end, sign)
    peaks, main = first.peaks[name], first.peaks[name][pool.at]
    refined = pooled(finer.peaks[name], end, sign)
    count = min(len(first.times), len(finer.times))
    times, rows, beside = (np.array(part[:count]) for part in (first.times, first.rows[name], finer.rows[name]))
    apart = np.maximum(np.abs(pool.value - refined.value), np.abs(pool.left - refined.left))
    if count:
        apart = np.maximum(apart, [largest_mean(times, column, end) for column in np.abs(rows - beside).T])
    largest = np.maximum(np.abs(pool.value), np.abs(pool.left))
    error = factor * apart + LEAST * largest
    if shifts:
        error = np.maximum(error[:-shifts], largest[-shifts:])
    errors, before, known = factor * np.abs(rows - beside)[times <= end].T, times[times <= end], []
    right, falling = kept(first.samples.get(name, []), main.value, sizes)
    for n in range(len(error)):
        value, left = pool.value[n], pool.left[n]
        if abs(value - left) <= error[n]:
            value = left = main.slopes.value[n]
        spread = max(0.0, pool.high[n] - max(value, left), min(value, left) - pool.low[n])
        far = max(peaks, key=lambda peak: abs(peak.slopes.value[n] - value))
        rivals = stays = None
        if spread > error[n] and far is not main:
            rivals = (
                f"it is {main.value:.6g} {unit} at {main.time:.4g} s and {far.value:.6g} {unit} at {far.time:.4g} s, "
                f"which its ± does not tell apart, with derivatives of {value:.3g} and {far.slopes.value[n]:.3g}: take "
                "a result of an instant, or smaller steps"
            )
        total = error[n] + spread
        beyond = (
            (right[1, n] - value, left - falling[0, n]) if sign > 0.0 else (value - right[0, n], falling[1, n] - left)
        )
        if max(beyond) > total:
            low, high = min(right[0, n], falling[0, n]), max(right[1, n], falling[1, n])
            stays = (
                f"it keeps {main.value:.6g} {unit} for a time, in which its derivatives are from {low:.3g} to "
                f"{high:.3g}: take a result of an instant, or another start"
            )
        if n in first.kinks and first.kinks[n][0] < end:
            stays = (
                f"{first.kinks[n][1]}; a number that rises changes the motion otherwise than one that falls: change "
                "the start or the number a little, or use refweb sweep"
            )
        known.append(Known(value, left if left != value else None, total, before, errors[n], rivals, stays))
    return known


def _is_smooth(observe):
    """Tell if an observable is one of an instant that has derivatives."""
    counted = observe.quantity in PATHWISE or isinstance(observe.observable, (Fuel, SlackFraction))
    return observe.average is None and not counted


def _refuse(scene, system, solution):
    """Refuse effects and starts without derivatives; the message has what gradients take."""
    net = system.net
    refused = [
        ("[rupture]", system.weakness is not None),
        ("[[control]] and commands", bool(scene.control or solution.commands)),
        (
            "lines or threads with a memory, as those that yield, creep, slip or are wound",
            bool(net.internal or net.wound),
        ),
        ('[[reel]] mass = "follows"', bool(net.flows)),
        ("threads over bodies", any(thread.wraps for thread in net.threads)),
        ("bodies whose orientation counts", any(body.turn is not None for body in net.bodies)),
        ("[[attach]]", bool(system.carried.any())),
        (f'[solve] start = "{short(str(scene.solve.start))}"', scene.solve.start not in ("web", "equilibrium")),
    ]
    for term in system.terms:
        refused.append((f"[{term.name}] of so many pairs of lines", term.contact.finder is not None))
    if names := [name for name, stands in refused if stands]:
        raise InputError(
            f"gradients of dynamics take no {names[0]}: vary the number by refweb sweep, or take the difference of two "
            f"runs; they take {SUPPORTED}"
        )
