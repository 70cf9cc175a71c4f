"""Error budget of results: its parts, their sum ±, and the verdict on the worth of each number.

Parts are the errors of time steps, of elements, of the stiffness of contact, of the smoothing of the cable law, of
chance where the motion is chaotic, and of rounding. Each part is a number in the unit of the result, "none" if it does
not exist in the scene, or "not estimated" if no run shows it. ± is the sum of the numbers.

Every verdict follows from ± and the parts alone:

=====================  =================================================================================
`determined`           all parts are known, and ± is at most a tenth of the value
`wide`                 ± is above a tenth of the value: more steps make it smaller
`statistical`          ± is above a tenth, most of it by chance: runs have a mean and a spread, and no run has more
`depends on the model` ± is above a tenth, most of it by elements, stiffness of contact or smoothing
`no limit`             finer elements do not converge: the number is one of the mesh
=====================  =================================================================================

A result has n digits if ± is at most 10^−n of its value. There is no verdict if ± is small and a part is not estimated.

May change: private functions and texts. `ALLOWED`, `FAR_WITHIN`, `ZERO`, `MOST_DIGITS` and `TOUCH` move the border
between verdicts. Must stay: names of parts and verdicts (`PARTS`, `NONE`, `OPEN`, `VERDICTS`), which stand in
``run.json`` and ``results.csv`` (a new part needs `WORDS` and a colour of `pictures.sheet.COLOURS`); `SMOOTHED`, which
follows from `SMOOTHING_SHARE`, the smoothing of the runs in `studies.further_runs` and `statics.smoothing_error`; ± as
the sum of the known parts; an effect is in `EXACT` only if more elements change nothing; all names that
`studies.further_runs`, `runner` and other files import. Tests: ``tests/results/test_error_budget.py``.
"""

from __future__ import annotations

import math

import numpy as np

from ..findings import Finding
from .solution import Result
from .strength import ALIKE, UTILISATION, of_observable
from .units import readable

PARTS = ("time", "elements", "contact_stiffness", "smoothing", "chance", "rounding")
MODELS = ("elements", "contact_stiffness", "smoothing")
"""Parts that belong to the model and not to its solution."""
NONE, OPEN = "none", "not estimated"
VERDICTS = ("determined", "wide", "statistical", "depends on the model", "no limit")
DETERMINED, WIDE, STATISTICAL, MODEL, NO_LIMIT = VERDICTS
ALLOWED = 0.1
"""± over the value above which a result is not determined."""
SMOOTHING_SHARE = 0.1
"""Smoothing of the runs that show the error of smoothing, over that of the scene."""
SMOOTHED = 1.32
"""Factor on the error of smoothing that follows from a run with a tenth of η, if errors are proportional to η.

That error is the difference of both runs over 0.9. In nets that are flat and slack, errors are proportional to √η: it
is the difference over 1 − √0.1, which is 1.32 times as much."""
FAR_WITHIN = 1e-2
"""Value over its ± up to which it may be zero, as by symmetry: no smaller ± leaves a digit of it."""
ZERO = 1e-14
"""Value plus ±, over the size of such results in a net, up to which the value is zero up to rounding."""
MOST_DIGITS = 12
"""Largest number of digits that is reported."""
TOUCH = 4.0
"""Largest force of a contact, over that of its first touch of one node, that counts as a property of the mesh."""
WORDS = {
    "time": "time steps",
    "elements": "elements",
    "contact_stiffness": "stiffness of contact",
    "smoothing": "smoothing",
    "chance": "chance",
    "rounding": "rounding",
}
EXACT = {"load", "motion", "reel", "temperature", "point_mass", "link"}
"""Effects of statics that keep straight elements straight, so that more elements change nothing."""


def reasons_of(scene, system, solution):
    """Reasons why parts of the error do not exist in a scene, by part; the others apply."""
    reasons, static = {}, scene.solve.kind == "static"
    if static:
        reasons |= dict.fromkeys(("time", "chance"), "an equilibrium has none")
        terms = {term.name for term in system.terms if not term.over_lines}
        if scene.cable.order == 1 and terms <= EXACT:
            reasons["elements"] = "straight elements that are loaded at their ends alone are exact"
    else:
        reasons["rounding"] = "part of that of time steps: both runs round differently"
    touching = [entry["overlap"] for table in (solution.bodies, solution.pairs) for entry in table.values()]
    touching += [solution.lines["overlap"]] if solution.lines else []
    if not touching:
        reasons["contact_stiffness"] = "no contact in the scene"
    elif not any(touching):
        reasons["contact_stiffness"] = "nothing touches"
    if not system.net.law_is("smoothed").any() and (static or not any(map(rubs, scene.effects))):
        reasons["smoothing"] = "neither the cable law nor friction has any"
    return reasons


def rubs(effect):
    """Tell if an effect is contact with friction, whose force is smooth in the velocity of slip."""
    if not hasattr(effect, "slip_velocity"):
        return False
    others = (body.friction for body in getattr(effect, "bodies", {}).values())
    return any((effect.friction, *(value or 0.0 for value in others)))


def with_parts(result, static, reasons, further):
    """A `refweb.results.solution.Result` with the parts of its error and their sum.

    Parameters
    ----------
    result : refweb.results.solution.Result
        Result with the errors of its run.
    static : bool
        True for a result of an equilibrium.
    reasons : dict of str to str
        Reasons why parts do not exist in its scene, by part.
    further : dict
        ``parts`` and ``reasons`` by further runs, which take precedence; empty without further runs.

    Returns
    -------
    refweb.results.solution.Result
        The result with its parts, and a reason for each part that does not exist.
    """
    reasons = {**reasons, **further.get("reasons", {})}
    known = {
        "rounding" if static else "time": result.error,
        "elements": result.discretisation,
        "smoothing": None if result.smoothing is None else SMOOTHED * result.smoothing,
    }
    parts = {}
    for part in PARTS:
        value = known.get(part)
        parts[part] = (NONE if part in reasons else OPEN) if value is None else float(value)
    reasons = {part: reasons[part] for part in PARTS if parts[part] == NONE}
    return summed(result._replace(parts={**parts, **further.get("parts", {})}, reasons=reasons))


def summed(result):
    """The result with ± as the sum of its known parts; None without any."""
    numbers = [value for value in result.parts.values() if isinstance(value, float)]
    return result._replace(error=float(sum(numbers)) if numbers else None)


def digits_of(value, error):
    """Number n of digits of a value: ± is at most 10^−n of it."""
    if error == 0.0:
        return MOST_DIGITS
    return max(0, min(MOST_DIGITS, math.floor(math.log10(abs(value) / error) + 1e-9))) if value else 0


def scales_of(system):
    """Sizes of results of a system by unit; results below `ZERO` times these are zero."""
    net = system.net
    axial = float(net.axial.max())
    energy = float((net.axial * net.line_data.natural_length).sum())
    size, mass = float(np.ptp(net.points, axis=0).max()), float(net.mass[: len(net.mass) - net.spins].sum())
    speed = math.sqrt(energy / mass) if mass > 0.0 else 0.0
    return {
        "m": size,
        "N": axial,
        "N m": axial * size,
        "Pa": float((net.axial / net.area).max()),
        "J": energy,
        "m/s": speed,
        "rad": 1.0,
        "1": 1.0,
    }


def with_verdict(result, remedies, mesh_only=False, scales=None):
    """The result with its verdict, and a sentence on it.

    Parameters
    ----------
    result : refweb.results.solution.Result
        Result with its parts and their sum.
    remedies : dict of str to str
        Sentence by verdict: a way to make ± smaller, or a result to ask for instead.
    mesh_only : bool
        True if the result is known not to converge with finer elements.
    scales : dict of str to float, optional
        Sizes by unit, see `scales_of`.
    """
    value, error = abs(result.value), result.error
    missing = [WORDS[part] for part, state in result.parts.items() if state == OPEN]
    numbers = {part: state for part, state in result.parts.items() if isinstance(state, float)}
    if mesh_only:
        cause = "it falls with the size of elements, and grows with the stiffness of contact"
        return _judged(result, NO_LIMIT, cause, remedies)
    if error is None or not math.isfinite(error):
        return result._replace(verdict=None, verdict_text="its error is not known")
    if error > 0.0 and value + error <= ZERO * (scales or {}).get(result.unit, 0.0):
        return result._replace(verdict=DETERMINED, verdict_text="zero but for rounding", digits=0)
    if value == error == 0.0:
        text = f"zero, but {_not_estimated(missing)}" if missing else "zero"
        return result._replace(verdict=None if missing else DETERMINED, verdict_text=text, digits=0)
    if error <= ALLOWED * value or error == 0.0:
        digits = digits_of(value, error)
        plural = "s" * (digits != 1)
        if missing:
            text = f"{digits} digit{plural}, but {_not_estimated(missing)}"
            return result._replace(verdict=None, verdict_text=text, digits=digits)
        return result._replace(verdict=DETERMINED, verdict_text=f"{digits} digit{plural}", digits=digits)
    largest = max(numbers, key=lambda part: numbers[part])
    share = readable(float(f"{numbers[largest]:.2g}"), None, result.unit)
    cause = f"most of ± is that of {WORDS[largest]}, {share}"
    if largest in MODELS:
        return _judged(result, MODEL, cause, remedies)
    return _judged(result, STATISTICAL if largest == "chance" else WIDE, cause, remedies)


def _not_estimated(missing):
    return f"{listed(missing)} {'is' if len(missing) == 1 else 'are'} not estimated"


def _judged(result, verdict, cause, remedies):
    remedy = remedies.get(verdict, "")
    return result._replace(verdict=verdict, verdict_text=f"{cause}; {remedy}" if remedy else cause)


def listed(words):
    """Words in a row: "a", "a and b", "a, b and c"."""
    return " and ".join(filter(None, [", ".join(words[:-1]), *words[-1:]]))


def shares(result):
    """Words after ± on the parts that it contains, if others are not estimated: "time only"."""
    parts, proven = result.get("parts") or {}, ["proven"] if result.get("proven") else []
    if parts.get("time") == NONE:  # an equilibrium
        of = {"elements": "elements", "contact_stiffness": "stiffness of contact", "smoothing": "smoothing"}
        given = [word for part, word in of.items() if parts[part] == OPEN]
        return ", ".join([*([f"of these {listed(given)}"] if given else []), *proven])
    known = [part.replace("_", " ") for part in PARTS if isinstance(parts.get(part), float)]
    return f"{listed(known)} only" if known and OPEN in parts.values() else ""


def first_touch(scene, system, observable):
    """Contact force at which a body first meets the mass of one node [N]; with ever finer elements it tends to zero.

    A mass m that meets a spring k δ^p at the speed v compresses it to ½ m v² = k δ^(p + 1)/(p + 1). The mass is the
    largest that elements give to a free node. The speed is that of the body relative to the web at the start. None for
    observables that are not the peak of a contact force on a body.
    """
    if observable.quantity != "reaction" or observable.body is None or observable.average is not None:
        return None
    if scene.solve.kind == "static" or observable.reduce != "max" or not system.contact:
        return None
    body = next(b for b in system.net.bodies if b.name == observable.body)
    stiffness, exponent = scene.settled().contact.law_of(body)
    nodes, v = np.arange(system.net.nodes), system.initial_velocity()
    free = nodes[~system.fixed[nodes].all(axis=1)]
    if stiffness is None or not len(free):
        return None
    speed = float(np.linalg.norm(v[free] - v[body.row], axis=1).max())
    volume = system.net.area * system.net.natural_length
    cells = system.net.cells
    share = np.repeat(system.net.cable_mass * volume / volume.sum() / cells.shape[1], cells.shape[1])
    mass = float(np.bincount(cells.ravel(), share, system.net.nodes)[free].max())
    depth = (0.5 * mass * speed**2 * (exponent + 1.0) / stiffness) ** (1.0 / (exponent + 1.0))
    return stiffness * depth**exponent


def judge(solution, scene, system, price=None, asked=None):
    """Set parts, ± and verdicts of the results of a solution, and add findings on wide results.

    Parameters
    ----------
    solution : refweb.solution.Solution
        Solution whose ``steps`` or ``reduced`` results are replaced; ``findings`` grow.
    scene : refweb.Scene
        As it was solved.
    system : refweb.system.system.System
        That of the scene.
    price : callable, optional
        Function ``price(share)``: expected CPU time [s] of errors that are smaller by a factor.
    asked : dict, optional
        Errors by result of further runs, of the last load step in statics: ``parts``, ``reasons``, ``mesh_only`` and
        ``spread``, see `refweb.studies.further_runs`.
    """
    static, reasons, asked = scene.solve.kind == "static", reasons_of(scene, system, solution), asked or {}
    named, scales = {o.name: o for o in scene.observables}, scales_of(system)

    def judged(results, asked):
        made = {}
        for name, result in results.items():
            further = asked.get(name, {})
            total = named[name].bounded(with_parts(result, static, reasons, further), system)
            mesh_only = further.get("mesh_only")
            if mesh_only is None:
                touch = first_touch(scene, system, named[name])
                mesh_only = touch is not None and 0.0 < total.value <= TOUCH * touch
            total = with_verdict(total, _remedies(total, solution, price), mesh_only, scales)
            made[name] = _of_chaos(total, solution, further.get("spread"))
        return made

    if static:
        for step in solution.steps:
            step["results"] = judged(step["results"], asked if step is solution.steps[-1] else {})
    else:
        solution.reduced = judged(solution.reduced, asked)
        solution.findings += _warnings(solution, named, known=bool(asked))
    _judge_utilisation(solution, scene, system, reasons, asked.get(UTILISATION, {}))


def _judge_utilisation(solution, scene, system, reasons, further):
    """Set ± of the utilisation and of the margin of safety of a solution with judged results."""
    used, margin = solution.utilisation, solution.margin
    if used is None:
        return
    result = Result(used.value, used.error, "1", 0.0, used.line, smoothing=used.smoothing)
    result = with_parts(result, scene.solve.kind == "static", reasons, further)
    proven = used.proven
    if (match := of_observable(scene, system, solution.results, used)) is not None:
        observed, factor = match
        scaled = {k: factor * part if isinstance(part, float) else part for k, part in observed.parts.items()}
        result, proven = result._replace(error=factor * observed.error, parts=scaled), observed.proven
    solution.utilisation = used._replace(error=result.error, parts=result.parts, proven=proven)
    if margin and margin["line"] == used.line and margin["strength"] and margin["allowed"] and result.error is not None:
        over_allowed = margin["strength"] / margin["allowed"]
        if abs(margin["used"] - over_allowed * used.value) <= ALIKE * abs(margin["used"]):
            solution.margin = {**margin, "error": over_allowed * result.error}


def _remedies(result, solution, price):
    """Sentences by verdict: remedies for a result."""
    share = math.inf if not result.value else (result.error or 0.0) / (ALLOWED * abs(result.value))
    cost = ""
    if price is not None and 1.0 < share < math.inf:
        cost = f", for some {price(share):.2g} s of CPU time"
    if solution.scene.solve.kind == "static":
        of_model = _of_model(result, solution.scene.cable).partition(", or ask")[0]
        return {WIDE: "that is what the residual and rounding leave of it", MODEL: of_model}
    zero = abs(result.value) <= FAR_WITHIN * (result.error or 0.0)
    return {
        WIDE: "the value is zero within ±" if zero else f"[accuracy] digits = 1 makes it smaller{cost}",
        STATISTICAL: _of_statistics(solution),
        MODEL: _of_model(result, solution.scene.cable),
        NO_LIMIT: "ask for its mean over a time (average = 0.01), which is an impulse",
    }


def _of_statistics(solution):
    """Sentence that names results to ask for instead of a number that chance decides."""
    horizon = next((time for k, time in reversed(solution.horizon.get("digits", ())) if time is not None), None)
    until = f" at t < {horizon:.3g} s" if horizon else ""
    return f"ask for a result{until}, for a mean (average), or for quantiles of many runs (refweb sweep)"


def _of_model(result, cable):
    """Remedy for the largest part of the model; bars of the linear law that push become chains with more elements."""
    where = " where lines only pull" * (cable.law == "linear")
    parts = {part: result.parts[part] for part in MODELS if isinstance(result.parts[part], float)}
    largest = max(parts, key=lambda part: parts[part], default="elements")
    return {
        "elements": f"[cable] subdivide = 2 makes it smaller{where}, or ask for its mean over a longer time (average)",
        "contact_stiffness": "give [contact] the stiffness of the real surface, or a larger one",
        "smoothing": "lower the smoothing of the cable law, or the slip_velocity of friction",
    }[largest]


def _of_chaos(result, solution, spread):
    """The result with mean and spread if it is statistical, and as statistical if run and step refinement diverge.

    It stays wide if time steps are the largest part of ± and an ensemble shows that it is not statistical.
    """
    divergence = solution.divergence
    if spread is not None and result.verdict == STATISTICAL:
        mean = readable(spread["mean"], spread["deviation"], result.unit)
        text = f"{mean} over runs from starts side by side; {_of_statistics(solution)}"
        return result._replace(verdict_text=text)
    if spread is None and divergence is not None and result.verdict == WIDE and result.time >= divergence.lost:
        text = f"run and step refinement grow apart with {divergence.growth:.3g} 1/s and leave no digit from t = "
        text += f"{divergence.lost:.3g} s on; refweb trust finds mean and spread"
        return result._replace(verdict=STATISTICAL, verdict_text=text)
    return result


def _warnings(solution, named, known):
    """Findings on wide ± of peaks, and on chaotic motions."""
    wide = {
        name: result.error / abs(result.value)
        for name, result in solution.reduced.items()
        if named[name].reduce != "final" and result.verdict in (WIDE, STATISTICAL, MODEL) and result.value
    }
    remedy = "see its verdict" if known else "refweb trust SCENE finds what of it is determined"
    if wide:
        text = listed([f"{name} ({100.0 * share:.2g} %)" for name, share in wide.items()])
        yield Finding("wide-error", f"± is above a tenth of the peak: {text}; {remedy}", "accuracy")
    if solution.divergence is not None:
        growth = f"run and step refinement grow apart with {solution.divergence.growth:.3g} 1/s"
        yield Finding("chaotic", f"the motion may be chaotic: {growth}; {remedy}", "accuracy")
