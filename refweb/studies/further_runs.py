"""Error budget of results, by further runs within a budget of CPU time.

A run and its step-refinement run show the error of time steps alone. Further runs of the same scene show the other
parts. They have twice and four times the elements, 4 and 16 times the stiffness of contact, a tenth of the smoothing,
or a quarter of the slip velocity of friction. Two runs from starts side by side show chaos; if they separate, an
ensemble follows. The run of least expected cost comes first. A run that is expected to exceed the remaining budget is
not begun, and a run that exceeds it is ended. A part without a run is "not estimated".

Two runs are compared by their result and by the mean difference of the observable before it, since results may agree by
chance. A step-refinement run is compared in the same way, see `refweb.dynamics.twin_error`.

``python -m validation trust`` compares ± and verdicts with runs of far finer elements, stiffer contact and shorter
steps. ± contains the true value of 99.8 % of 628 results of 100 random impacts, and of 98.2 % of 228 results of 30
small nets that are thrown at a sphere. Its median is 2.4 and 3.9 times the true error. No result with the verdict
"determined" has an error that its digits do not allow. The four results of captures outside ± are forces of contact:
three peaks and a mean.

May change: private functions and texts of `report`. All constants change ± of results: ``python -m validation trust``
is to be run after that. Must stay: texts of variants, which are keys in `TELLING`; keys of `report`, which are those of
``trust.json`` and which `commands.console` prints; `FurtherRuns` and `write`, which `runner` calls. Tests:
``tests/studies/test_further_runs.py``.
"""

from __future__ import annotations

import itertools
import json
import pathlib
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..dynamics.budget import Spent, budget_of
from ..dynamics.twin_error import largest_mean
from ..errors import InputError, SolverError
from ..registry import EFFECTS, INTEGRATORS, name_of
from ..results.error_budget import SMOOTHED, SMOOTHING_SHARE, first_touch, reasons_of, rubs
from ..results.files import write_atomically, write_text
from ..results.solution import as_history
from ..results.strength import UTILISATION
from ..settings import Accuracy
from .discretisation_error import MARGIN, left_of
from .predictability import ensemble, horizon, lost_digits

SURE = 1.1
"""Time of a run, extrapolated by its progress, over the remaining budget, at which the run is ended."""
SEEN = 0.1
"""Share of a run after which its time is extrapolated."""
STIFFER = (4.0, 16.0)
"""Stiffness of contact of further runs, over that of the scene."""
SLOWER = 0.25
"""Slip velocity of friction of a further run, over that of the scene."""
MEMBERS, QUANTILE = 8, 2.5
"""Number of runs of an ensemble, and standard deviations from its mean that contain 95 % of further runs."""
APART = 1e-6
"""Largest difference of the starts of an ensemble, over the shortest element: no real net is known more precisely.

The differences are spaced by equal ratios down to the smallest one that grows to the size of the motion. The logarithm
of a difference sets the time at which a branch is left: runs with one difference leave it together.
"""
LOST = 5
"""Number of digits that a small difference must cost before a result counts as chaotic: a difference of `APART` then
grows to a tenth of the motion, also where a motion that is symmetric by rounding alone has a narrow ± in time."""
FALLS, GROWS = 0.85, 1.5
"""Limits of the factors on a force of contact with twice the elements, and with 4 times the stiffness, for a first
touch. A first touch has the factors 0.71 and 2. With finer elements its force falls to that of the web as a whole; with
stiffer contact it grows without limit. If both are refined there is no limit."""


class Variant(NamedTuple):
    """A further run.

    Attributes
    ----------
    part : str
        Part of the error that the run shows.
    text : str
        Text of the difference from the scene.
    scene : refweb.Scene or None
        Scene of the run; None for runs from starts side by side.
    price : float
        Expected CPU time [s].
    follows : str or None
        Text of the variant that must be solved before.
    """

    part: str
    text: str
    scene: object
    price: float
    follows: str | None = None


class FurtherRuns:
    """Further runs of a scene, and the errors that they show.

    Parameters
    ----------
    simulation : refweb.dynamics.simulation.Simulation or refweb.statics.simulation.Simulation
        Simulation of the scene, at its end.
    solution : refweb.solution.Solution
        Its solution; the list ``further`` grows.
    rows : ndarray, shape (rows, columns)
        Its history.
    clock : refweb.results.run_status.Clock
        Clock of the whole budget.
    run : callable
        `refweb.run`.
    tell : callable
        Called with a text and the spent share of the budget.
    """

    def __init__(self, simulation, solution, rows, clock, run, tell):
        self.simulation, self.solution, self._clock, self._run, self._tell = simulation, solution, clock, run, tell
        self.scene = scene = _at_knob(simulation)
        self.static = scene.solve.kind == "static"
        spent = clock.spent()
        first = max(spent["cpu_s"] - spent["compile_s"], 1e-3)
        self._single = first / solution.steps_of_both
        self.budget = budget_of(scene.accuracy.budget, first)
        self._compared = {None: (_results(solution), as_history(solution.columns, rows))}

    @property
    def spent(self):
        """Spent part of the budget [s]."""
        return self._clock.spent()["cpu_s"]

    def follow(self):
        """Run all variants that the budget allows, the cheapest first."""
        waiting = list(variants(self.scene, self.simulation.system, self.solution, self._single))
        done: set[str | None] = {None}
        while ready := [v for v in waiting if v.follows in done]:
            variant = min(ready, key=lambda v: v.price)
            waiting.remove(variant)
            left = self.budget - self.spent
            entry = {"part": variant.part, "text": variant.text, "expected_s": variant.price, "cpu_s": 0.0}
            if variant.price > left:
                message = f"{variant.price:.3g} s expected, {max(left, 0.0):.3g} s left of the budget"
                entry |= {"status": "left out", "message": message}
            else:
                entry |= self._tried(variant, left)
            self.solution.further.append(entry)
            if entry["status"] == "solved":
                done.add(variant.text)
                grown = entry["cpu_s"] / max(variant.price, 1e-9)
                waiting = [v._replace(price=v.price * grown) if v.part == variant.part else v for v in waiting]
                if variant.text == HORIZON and any(map(self._chaotic, self.scene.observables)):
                    waiting.append(Variant("chance", ENSEMBLE, None, 0.5 * MEMBERS * entry["cpu_s"]))

    def _tried(self, variant, left):
        """Run a variant; return its status, message and CPU time."""
        before = self.spent

        def watched(text, share):
            spent = self.spent - before
            if spent > SURE * left or (share > SEEN and spent > SURE * left * share):
                raise Spent(f"ended after {spent:.3g} s, {100.0 * share:.2g} % done")
            self._tell(variant.text, min(self.spent / self.budget, 1.0))

        try:
            if variant.scene is None:
                self._side_by_side(variant.text, watched)
            else:
                run = self._run(variant.scene, progress=watched)
                self._compared[variant.text] = _results(run), run.history
            status, message = "solved", ""
        except Spent as error:
            status, message = "ended", str(error)
        except (InputError, SolverError) as error:
            status, message = "failed", str(error)
        return {"status": status, "message": message, "cpu_s": self.spent - before}

    def _side_by_side(self, text, tell):
        """Find the horizon, or mean and spread of an ensemble."""
        if text == HORIZON:
            self.solution.horizon = horizon(self.simulation, self.solution.results, None, tell)
        else:
            lost = min(self._lost(o) for o in self.scene.observables if self._chaotic(o))
            sizes = np.geomspace(APART, min(10.0**-lost, APART), MEMBERS)
            self.solution.horizon |= ensemble(self.simulation, sizes, tell)

    def _chaotic(self, observable):
        """Tell if a result is chaotic: small differences cost `LOST` digits."""
        return self._lost(observable) >= LOST

    def _lost(self, observable):
        """Number of digits that small differences cost until the time of a result.

        For a peak it is that at the end of the run: a run beside it may have a higher peak later.
        """
        last = observable.reduce == "final"
        return lost_digits(self.solution.horizon, self.solution.results[observable.name].time if last else np.inf)

    def findings(self):
        """Errors of each result by these runs: ``parts``, ``reasons`` and ``mesh_only``."""
        errors: dict = {o.name: self._found_of(o) for o in self.scene.observables}
        used = {"parts": self._parts_of(UTILISATION)}
        if self.solution.utilisation is not None and (horizon := self.solution.horizon):
            if lost_digits(horizon, np.inf) < LOST:
                used = self._without_chance(used)
            elif (mean := horizon.get("utilisation")) is not None:
                used["parts"]["chance"] = self._chance(self.solution.utilisation.value, mean)
        return errors | {UTILISATION: used}

    def _without_chance(self, entry):
        """Entry of `findings` for a result that small differences at the start do not change."""
        parts = {**entry["parts"], "chance": "none"}
        return {**entry, "parts": parts, "reasons": {"chance": "small differences at the start leave its digits"}}

    def _chance(self, value, mean):
        """Error of a value by chance, from mean and deviation of an ensemble."""
        return abs(value - mean["mean"]) + QUANTILE * mean["deviation"]

    def _parts_of(self, name):
        """Errors of a result by part of the model; for the utilisation, which has no history, by its largest value."""
        parts = {}
        for part, texts, factor in TELLING:
            texts = [text for text in texts if text in self._compared]
            if texts and name in self._compared[None][0]:
                parts[part] = parts.get(part, 0.0) + self._left(name, texts, factor)
        return parts

    def _found_of(self, observable):
        name, reasons = observable.name, {}
        parts = self._parts_of(name)
        entry = {"parts": parts, "reasons": reasons, "mesh_only": self._mesh_only(observable)}
        horizon = self.solution.horizon
        if not horizon:
            return entry
        if not self._chaotic(observable):
            return self._without_chance(entry)
        if (mean := horizon.get("ensemble", {}).get(name)) is not None:
            parts["chance"] = self._chance(self.solution.results[name].value, mean)
            entry["spread"] = mean
        return entry

    def _left(self, name, texts, factor):
        """Error of a result by one or two refined runs; with one run it is ``factor`` times the change."""
        values = [self._compared[text][0][name] for text in (None, *texts)]
        left = MARGIN * factor * abs(values[0] - values[1]) if len(values) == 2 else left_of(*values)
        return max(left, MARGIN * self._mean_apart(name, texts[-1]))

    def _mean_apart(self, name, text):
        """Mean difference of an observable from that of another run, before the time of its result; 0 in statics."""
        if self.static or name == UTILISATION:
            return 0.0
        table, compared = self._compared[None][1], self._compared[text][1]
        count, end = min(len(table["time"]), len(compared["time"])), self.solution.results[name].time
        same = table["time"][:count] == compared["time"][:count]
        off = np.abs(table[name][:count] - compared[name][:count])[same]
        return largest_mean(table["time"][:count][same], off, end)

    def _mesh_only(self, observable):
        """Tell if a force of contact is that of a first touch; None where no run tells.

        The force of a first touch falls with the mass of a node and grows with the root of the stiffness. Both must be
        found if runs for both exist. A force that only grows with the stiffness depends on the model.
        """
        touch = first_touch(self.scene, self.simulation.system, observable)
        if touch is None or not self.solution.results[observable.name].value > 0.0:
            return False
        values = [[self._compared[text][0][observable.name] for text in (None, *texts) if text in self._compared]
                  for texts in (FINER, STIFFNESS)]  # fmt: skip
        finer, stiffer = ([b / max(a, 1e-300) for a, b in itertools.pairwise(of)] for of in values)
        if not finer and not stiffer:
            return None
        return bool((not finer or finer[0] < FALLS) and (not stiffer or min(stiffer) > GROWS))


FINER = ("twice the elements", "four times the elements")
STIFFNESS = tuple(f"{times:g} times the stiffness of contact" for times in STIFFER)
SMOOTHER, SLIP = "a tenth of the smoothing", "a quarter of the slip velocity of friction"
TELLING = (
    ("elements", FINER, 2.0),
    ("contact_stiffness", STIFFNESS, 2.0),
    ("smoothing", (SMOOTHER,), SMOOTHED / (1.0 - SMOOTHING_SHARE) / MARGIN),
    ("smoothing", (SLIP,), 1.0 / (1.0 - SLOWER)),
)
"""Parts of the error, the runs that show each, and the error by a single run over the change that it makes."""
HORIZON, ENSEMBLE = "two starts side by side", f"{MEMBERS} starts side by side"


def variants(scene, system, solution, single):
    """Yield the `Variant` s of a scene that its error budget needs; ``single`` is the CPU time of one run [s]."""
    reasons, static = reasons_of(scene, system, solution), scene.solve.kind == "static"
    plain = scene.replace(accuracy=Accuracy(error="none"), chosen=())
    explicit = not static and INTEGRATORS[scene.solve.method].knob == "safety"
    if "elements" not in reasons:
        for n, (text, times) in enumerate(zip(FINER, (2, 4), strict=True)):
            finer = plain.replace(cable=replace(scene.cable, subdivide=times * scene.cable.subdivide))
            price = single * float(times) ** (2.0 if explicit else 1.2)
            yield Variant("elements", text, finer, price, FINER[0] if n else None)
    if "contact_stiffness" not in reasons:
        given = stiffness_of(scene, system)
        for n, (text, times) in enumerate(zip(STIFFNESS, STIFFER, strict=True)):
            stiffer = plain.with_stiffness({name: times * value for name, value in given.items()}).replace(chosen=())
            price = single * (times**0.5 if explicit else 1.5)
            yield Variant("contact_stiffness", text, stiffer, price, STIFFNESS[0] if n else None)
    if not static and system.net.law_is("smoothed").any():
        smoother = plain.replace(cable=scene.cable.with_smoothing(SMOOTHING_SHARE))
        yield Variant("smoothing", SMOOTHER, smoother, single)
    if not static and (effects := slower_slip(scene)) is not None:
        yield Variant("smoothing", SLIP, plain.replace(effects=effects), single)
    if not static:
        yield Variant("chance", HORIZON, None, 2.0 * single)


def slower_slip(scene):
    """Effects of a scene with `SLOWER` of the slip velocity of all friction; None without any."""
    effects, any_friction = [], False
    for effect in scene.effects:
        if name_of(EFFECTS, effect) in ("contact", "self_contact") and rubs(effect):
            bodies = getattr(effect, "bodies", {})
            slower = {
                n: replace(b, slip_velocity=SLOWER * b.slip_velocity) for n, b in bodies.items() if b.slip_velocity
            }
            changed = {"bodies": {**bodies, **slower}} if slower else {}
            effect, any_friction = replace(effect, slip_velocity=SLOWER * effect.slip_velocity, **changed), True
        effects.append(effect)
    return effects if any_friction else None


def stiffness_of(scene, system):
    """Stiffness of contact of each body, and of lines as "self_contact"."""
    given = {}
    if scene.contact is not None and scene.contact is not False:
        given |= {body.name: scene.contact.law_of(body)[0] for body in system.net.bodies}
    for effect in scene.effects:
        if name_of(EFFECTS, effect) == "self_contact":
            given["self_contact"] = effect.stiffness
    return {name: value for name, value in given.items() if value is not None}


def _at_knob(simulation):
    """The scene with the stiffness that refweb chose, and with the final accuracy parameter of its run."""
    scene = simulation.scene.settled()
    if scene.solve.kind == "static":
        return scene
    name = simulation.integrator.knob
    if simulation.standing.knob == getattr(scene.solve, name):
        return scene
    return scene.replace(solve=replace(scene.solve, **{name: simulation.standing.knob}))


def _results(solution):
    values: dict = {name: result.value for name, result in solution.results.items()}
    return values | ({UTILISATION: solution.utilisation.value} if solution.utilisation else {})


def report(solution):
    """The content of ``trust.json``, a dict of plain values."""
    keys = ("value", "error", "unit", "time", "parts", "reasons", "verdict", "verdict_text", "digits")
    results = {name: {key: getattr(r, key) for key in keys} for name, r in solution.results.items()}
    spent = solution.cost["cpu_s"]
    return {
        "scene": solution.scene.title,
        "results": results,
        "runs": solution.further,
        "warnings": solution.warnings,
        "horizon": solution.horizon,
        "budget": {"given": solution.scene.accuracy.budget, "spent": spent},
    }


def write(solution, folder):
    """Write ``trust.json`` and ``trust.png`` to a folder."""
    from ..pictures.error_budget import draw

    folder = pathlib.Path(folder)
    write_text(folder / "trust.json", json.dumps(report(solution), indent=1, ensure_ascii=False))
    write_atomically(folder / "trust.png", lambda name: draw(solution.results, solution.scene.title).savefig(name))
