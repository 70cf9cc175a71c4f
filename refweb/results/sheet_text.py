"""Sheet of a run in words: sizes of the web, its largest tension, its margin of safety, and the worth of each result.

All of it comes from the content of ``run.json`` and of ``scene.toml``, and where these do not hold the largest tension,
from the frames.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from .observables.observe import observes_of
from .units import readable, scale_of, with_error

PACKING = 0.5
"""Share of a packed volume that is cable, where none is given."""
BESIDE = 1e-6
"""Relative difference of two stresses of one line up to which they are the same."""


class Largest(NamedTuple):
    """The largest tension of a run.

    Attributes
    ----------
    value : float
        The tension [N].
    error : float or None
        Its ± [N], None where none is known.
    line : int or None
        Number of its line, of a quantity of nodes of its node.
    time : float
        When it was [s], in statics the load step.
    source : str
        A remark on where it is from; empty where a result holds it.
    within : tuple or None
        Least and largest value that are possible [N], where ± goes beyond them.
    """

    value: float
    error: float | None
    line: int | None
    time: float
    source: str = ""
    within: tuple | None = None

    def times(self, factor, source):
        """The same with all values times a factor."""
        error = None if self.error is None else factor * self.error
        within = self.within and tuple(factor * end for end in self.within)
        return self._replace(value=factor * self.value, error=error, within=within, source=source)


def on_sizes(web, packing=PACKING):
    """(Name, sentence) of the sizes of a web, of ``web`` of ``run.json``; ``packing`` is cable over packed volume."""
    if "extent" in web:
        x, y, z = (f"{length:.4g}" for length in web["extent"])
        yield "overall size", f"{x} × {y} × {z} m along x, y and z, as the web is built"
    if "lines" in web:
        yield "lines", f"{web['lines']}, {web['cable_length']:.6g} m of cable"
    if "diameter" in web:
        thin, thick = (readable(float(f"{size:.4g}"), None, "m") for size in web["diameter"])
        yield "cable diameter", f"{thin if thin == thick else f'{thin} to {thick}'}, of a round cable of the same area"
    if "mass" in web:
        yield "cable mass", f"{web['mass']:.4g} kg"
    if "total_mass" in web:
        yield "total mass", f"{web['total_mass']:.4g} kg, with point masses and bodies that move"
    if "volume" in web:
        packed, solid = (f"{1e3 * size:.4g} l" for size in (web["volume"] / packing, web["volume"]))
        yield "packed volume", f"{packed}, if {100.0 * packing:.3g} % of it is cable; the cable alone has {solid}"


def largest_tension(summary, scene, of_frames=None):
    """The `Largest` tension of a run.

    Parameters
    ----------
    summary : dict
        The content of ``run.json``.
    scene : dict
        The tables of the scene file.
    of_frames : callable, optional
        Gives the `Largest` of the frames, or None; it is called where nothing else is known.

    Returns
    -------
    Largest or None
        None where it is not known.
    """
    if (largest := observed(summary, scene, "tension")) is not None:
        return largest
    cable = scene.get("cable") or {}
    groups = list((cable.get("groups") or {}).values())
    alike = "area" in cable and not any("area" in group for group in groups)
    if alike and (stress := observed(summary, scene, "stress")) is not None:
        return stress.times(cable["area"], "it is the largest stress times the area")
    margin = summary.get("margin")
    keys = ("strength", "safety_factor", "knot_factor")
    if alike and margin and "rupture" not in scene and not any(key in group for group in groups for key in keys):
        stress = Largest(margin["stress"], None, margin["line"], margin["time"])
        return stress.times(margin["area"], "it is the largest stress times the area, and its ± is not known")
    return of_frames() if of_frames is not None else None


def on_tension(largest, dynamic):
    """(Name, sentence) of the largest tension, a `Largest` or None."""
    if largest is None:
        yield "largest tension", 'not known: give an [[observe]] with quantity = "tension" and reduce = "max"'
        return
    text = readable(largest.value, largest.error, "N", largest.within)
    text += f" in line {largest.line}" if largest.line is not None else ""
    text += f" at {when(largest.time, dynamic)}" + (f"; {largest.source}" if largest.source else "")
    yield "largest tension", text


def when(time, dynamic):
    """A time, or a load step, in words."""
    return f"t = {time:.6g} s" if dynamic else f"load step {time:g}"


def on_margin(summary, scene, dynamic):
    """(Name, sentence) of the margin of safety and of the line that breaks first."""
    margin: dict[str, Any] | None = summary.get("margin")
    if margin is None:
        lacking = "the run has no strength: give [cable] strength [Pa], or that of [cable.groups]"
        given = [scene.get("cable") or {}, scene.get("rupture") or {}]
        given += [group for table in given for group in (table.get("groups") or {}).values()]
        if any("strength" in table for table in given):
            lacking = "this run.json does not hold it: it does where a run has ended"
        yield "margin of safety", f"not known, as {lacking}"
        return
    if margin["value"] is None:
        yield "margin of safety", "unlimited: no line that has a strength is under tension"
        return
    error = _error_of(summary, scene, margin)
    yield "margin of safety", _decided(margin, error)
    factors = _factors(margin, scene)
    stress = readable(margin["stress"], error, "Pa")
    yield "", f"{factors} / {stress} − 1, of line {margin['line']} at {when(margin['time'], dynamic)}"
    used = summary.get("utilisation") or {}
    if used:
        share = f"its stress reaches {100.0 * used['value']:.3g} % of its strength"
        yield "breaks first", f"line {used['line']}: {share}"


def decision(margin, error):
    """(Lower, upper end, verdict) of a margin, of the ± of its stress [Pa]; "holds", "breaks" or "undecided"."""
    stress, allowed = margin["stress"], margin["allowed"]
    error = error or 0.0
    lower = allowed / (stress + error) - 1.0
    upper = allowed / (stress - error) - 1.0 if stress > error else math.inf
    return lower, upper, "holds" if lower > 0.0 else "breaks" if upper < 0.0 else "undecided"


def _decided(margin, error):
    """A margin with its ±, and the verdict.

    The margin is not linear in the stress: ± is how far it may lie towards 0, and both ends follow it.
    """
    lower, upper, verdict = decision(margin, error)
    value = margin["value"]
    if error is None:
        text = "the ± of the largest stress is not known: an [[observe]] of its stress over all lines, with reduce = "
        return f'{value:.3g}, {verdict} without ±; {text}"max", has it'
    to = "without limit" if math.isinf(upper) else f"to {upper:.3g}"
    reason = ", as 0 lies within ±" if verdict == "undecided" else ""
    towards_zero = value - lower if value > 0.0 else upper - value
    text = with_error(value, towards_zero) if math.isfinite(towards_zero) else f"{value:.3g}"
    return f"{text}, from {lower:.3g} {to}: {verdict}{reason}"


def _factors(margin, scene):
    """The allowed stress as a product, where the factors are those of the cable, else as it is."""
    factor, name = scale_of(margin["strength"], "Pa")
    strength = f"{margin['strength'] / factor:.4g} {name}"
    cable = scene.get("cable") or {}
    safety, knot = cable.get("safety_factor", 1.0), cable.get("knot_factor", 1.0)
    if abs(margin["strength"] * knot / safety / margin["allowed"] - 1.0) > BESIDE:
        factor, name = scale_of(margin["allowed"], "Pa")
        return f"{margin['allowed'] / factor:.4g} {name} allowed of {strength}"
    return (
        strength + (f" × {knot:g} left at knots" if knot != 1.0 else "") + (f" / {safety:g}" if safety != 1.0 else "")
    )


def _error_of(summary, scene, margin):
    """± of the stress of the smallest margin [Pa], by a result that stands at its line; None where there is none."""
    for quantity, factor in (("stress", 1.0), ("tension", 1.0 / margin["area"])):
        largest = observed(summary, scene, quantity)
        if largest is None or largest.error is None or largest.line != margin["line"]:
            continue
        if abs(factor * largest.value - margin["stress"]) <= BESIDE * margin["stress"]:
            return factor * largest.error
    return None


def observed(summary, scene, quantity):
    """The `Largest` of the results of a quantity over all lines, or over all nodes; None where there is none."""
    steps = summary.get("steps") or []
    tables = [step.get("results") or {} for step in steps] or [summary.get("results") or {}]
    found = []
    for observe in observes_of(scene):
        keys = (observe.line, observe.node, observe.body, observe.component, observe.average)
        every = keys == (None,) * len(keys) and (steps or observe.reduce == "max")
        if observe.quantity == quantity and every:
            found += [results[observe.name] for results in tables if observe.name in results]
    if not found:
        return None
    best = max(found, key=lambda result: result["value"])
    within = best.get("within")
    return Largest(
        best["value"], best["error"], best["where"], best["time"], within=None if within is None else tuple(within)
    )


def rows_of_worth(results):
    """(Columns, rows) of results with ±, and where a run gives them, a verdict on each and its reason."""
    told = any(result.get("verdict") or result.get("verdict_text") for result in results.values())
    rows = []
    for name, result in results.items():
        row = [name, readable(result["value"], result["error"], result["unit"], result.get("within"))]
        row += [result.get("verdict") or "", result.get("verdict_text") or ""] if told else []
        rows.append(row)
    return ["result", "value", *(["verdict", "reason"] if told else [])], rows
