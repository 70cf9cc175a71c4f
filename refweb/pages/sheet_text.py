"""Texts of the sheet of a run: sizes of the web, largest tension, margin of safety, and verdicts on results.

The input is the content of ``run.json`` and of ``scene.toml``.

May change: private functions, sentences, and `BESIDE`, a tolerance. Must stay: keys that are read, those of ``web``,
``margin`` and ``utilisation`` in ``run.json``; the value of `PACKING`, which stands in the help of `commands.report` as
well, and which `page`, `sheet` and `sizing.case` import; `decision`, which `sizing.case` calls; `on_sizes`,
`rows_of_worth`, `on_tension` and `on_margin`, which `sheet` imports. Tests: ``tests/pages/test_sheet.py``,
``tests/results/test_strength.py``.
"""

from __future__ import annotations

import math
from typing import Any

from ..pictures.peaks import observed, when
from ..results.units import readable, with_error

PACKING = 0.5
"""Volume of cable over the packed volume, by default."""
BESIDE = 1e-6
"""Relative difference of two stresses of one line up to which they count as equal."""


def on_sizes(web, packing=PACKING):
    """Pairs of name and sentence on the sizes of a web, from ``web`` of ``run.json``."""
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


def on_tension(largest, dynamic):
    """Name and sentence of the largest tension, a `Largest` or None."""
    if largest is None:
        yield "largest tension", 'not known: give an [[observe]] with quantity = "tension" and reduce = "max"'
        return
    text = readable(largest.value, largest.error, "N", largest.within)
    text += f" in line {largest.line}" if largest.line is not None else ""
    text += f" at {when(largest.time, dynamic)}" + (f"; {largest.source}" if largest.source else "")
    yield "largest tension", text


def on_margin(summary, scene, dynamic):
    """Name and sentence of the margin of safety, and of the line with the largest stress."""
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
    terms = _terms(margin, scene, readable(margin["stress"], error, "Pa"))
    yield "its terms", f"{terms}, of line {margin['line']} at {when(margin['time'], dynamic)}"
    used = {"value": margin["stress"] / margin["strength"], "line": margin["line"]}
    used["error"] = None if error is None else error / margin["strength"]
    if (given := summary.get("utilisation")) and given["value"] > used["value"]:  # in statics that of the last step
        used = given
    share = f"its stress reaches {_percent(used['value'], used.get('error'))} of its strength"
    if broken := summary.get("breaks"):
        share += f"; line {broken[0]['line']} broke at t = {broken[0]['time']:.6g} s"
    yield "would break first", f"line {used['line']}: {share}"


def _percent(value, error):
    """A share in percent with its ± or, if that is not known, a remark."""
    if error is None:
        return f"{100.0 * value:.3g} % (its ± is not known)"
    return f"{with_error(100.0 * value, 100.0 * error)} %"


def decision(margin, error):
    """Lower and upper end of a margin by ± of its stress [Pa], and "holds", "does not hold" or "undecided"."""
    stress, allowed = margin["stress"], margin["allowed"]
    error = error or 0.0
    lower = allowed / (stress + error) - 1.0
    upper = allowed / (stress - error) - 1.0 if stress > error else math.inf
    return lower, upper, "holds" if lower > 0.0 else "does not hold" if upper < 0.0 else "undecided"


def _decided(margin, error):
    """A margin with its ±, and the verdict.

    The margin is not linear in the stress: ± is the distance to the end nearer to 0, and both ends follow it.
    """
    lower, upper, verdict = decision(margin, error)
    value = margin["value"]
    if error is None:
        return f"{value:.3g}, {verdict} without ±; the ± of the largest stress is not known"
    to = "without limit" if math.isinf(upper) else f"to {upper:.3g}"
    ends = "" if f"{lower:.3g}" == f"{upper:.3g}" else f", from {lower:.3g} {to}"
    reason = ", as 0 lies within ±" if verdict == "undecided" else ""
    towards_zero = value - lower if value > 0.0 else upper - value
    text = with_error(value, towards_zero) if math.isfinite(towards_zero) else f"{value:.3g}"
    return f"{text}{ends}: {verdict}{reason}"


def _terms(margin, scene, stress):
    """The terms of the margin, a text; the factors are those of the cable or of the group of the line."""
    strength, allowed = (readable(float(f"{margin[key]:.4g}"), None, "Pa") for key in ("strength", "allowed"))
    cable = scene.get("cable") or {}
    safety, knot = cable.get("safety_factor", 1.0), cable.get("knot_factor", 1.0)
    if abs(margin["strength"] * knot / safety / margin["allowed"] - 1.0) > BESIDE:
        return f"{allowed}, allowed of a strength of {strength}, / {stress} − 1"
    strength += f" × {knot:g} left at knots" if knot != 1.0 else ""
    return f"{strength} / " + (f"({safety:g} × {stress})" if safety != 1.0 else stress) + " − 1"


def _error_of(summary, scene, margin):
    """± of the stress of the smallest margin [Pa]; None if it is not known.

    It is the ± of a stress result at the same line, otherwise that of the margin itself.
    """
    for quantity, factor in (("stress", 1.0), ("tension", 1.0 / margin["area"])):
        largest = observed(summary, scene, quantity)
        if largest is None or largest.error is None or largest.line != margin["line"]:
            continue
        if abs(factor * largest.value - margin["stress"]) <= BESIDE * margin["stress"]:
            return factor * largest.error
    if margin.get("error") is None or margin["allowed"] is None:
        return None
    return margin["error"] * margin["allowed"]


def rows_of_worth(results):
    """Columns and rows of results with ± and, if the run has them, verdicts with their reasons."""
    has_verdicts = any(result.get("verdict") or result.get("verdict_text") for result in results.values())
    rows = []
    for name, result in results.items():
        row = [name, readable(result["value"], result["error"], result["unit"], result.get("within"))]
        row += [result.get("verdict") or "", result.get("verdict_text") or ""] if has_verdicts else []
        rows.append(row)
    return ["result", "value", *(["verdict", "reason"] if has_verdicts else [])], rows
