"""The largest value of a quantity over a run, in particular of tension, from ``run.json`` and ``scene.toml``.

May change: words of `when`. Must stay: keys that are read, those of ``run.json`` and ``scene.toml``; fields of
`Largest`, which `pages.sheet_text` and `over_frames` read; `observed`, which `pages.sheet_text` and `over_frames`
import; `largest_tension`, which `pages.sheet` imports. Tests: ``tests/pages/test_sheet.py``,
``tests/pictures/test_over_frames.py``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ..results.observables.observe import observes_of


class Largest(NamedTuple):
    """The largest value of a quantity over a run.

    Attributes
    ----------
    value : float
        The value [SI].
    error : float or None
        Its ±; None if it is not known.
    line : int or None
        Number of its line, or node for a nodal quantity; None if it is not known.
    time : float or None
        Its time [s], in statics the load step; None if it is not known.
    source : str
        Remark on its origin; empty for the value of a result.
    within : tuple or None
        Least and largest possible value, if ± extends beyond them.
    """

    value: float
    error: float | None
    line: int | None
    time: float | None
    source: str = ""
    within: tuple[Any, ...] | None = None

    def times(self, factor, source):
        """A copy with all values times a factor."""
        error = None if self.error is None else factor * self.error
        within = self.within and tuple(factor * end for end in self.within)
        return self._replace(value=factor * self.value, error=error, within=within, source=source)


def largest_tension(summary, scene, of_frames=None):
    """The `Largest` tension of a run, from the content of ``run.json`` and of the scene file; None if it is not known.

    ``of_frames`` returns the `Largest` of the frames, or None; it is called if no other value is known.
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


def observed(summary, scene, quantity):
    """The `Largest` of the results of a quantity over all lines or all nodes; None if there is none."""
    steps = summary.get("steps") or []
    tables = [step.get("results") or {} for step in steps] or [summary.get("results") or {}]
    results_found = []
    for observe in observes_of(scene):
        keys = (observe.line, observe.node, observe.body, observe.component, observe.average, observe.part)
        largest = observe.select in (None, "max") and (steps or observe.reduce == "max")
        every = keys == (None,) * len(keys) and largest
        if observe.quantity == quantity and every:
            results_found += [results[observe.name] for results in tables if observe.name in results]
    if not results_found:
        return None
    best = max(results_found, key=lambda result: result["value"])
    within = best.get("within")
    return Largest(
        best["value"], best["error"], best["where"], best["time"], within=None if within is None else tuple(within)
    )


def when(time, dynamic):
    """Text of a time or load step."""
    return f"t = {time:.6g} s" if dynamic else f"load step {time:g}"
