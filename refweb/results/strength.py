"""Largest stress over strength of a run, its ±, and what is said of it where it is near 1."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..findings import Finding

ALIKE = 1e-6
"""Relative difference of two stresses of one line up to which they are the same."""
UTILISATION = ("utilisation",)
"""Key of the utilisation beside names of results, none of which it can be."""


class Utilisation(NamedTuple):
    """Largest stress over strength, in dynamics over time, in statics of the last load step.

    Attributes
    ----------
    value : float
        The largest stress over strength [1].
    line : int
        Its line.
    error : float or None
        Its ± [1], None where none is known. It is that of a result which observes the same stress, with all parts that
        are known of that, else that of time steps or rounding and, where these were looked for, of other parts.
    parts : dict or None
        Parts of ± as of a `refweb.results.solution.Result`; None where the run has not come to its end.
    smoothing : float or None
        Error of the smooth law [1], where it was looked for.
    proven : bool
        Whether ± of an equilibrium is a bound from duality.
    """

    value: float
    line: int
    error: float | None = None
    parts: dict[str, float | str] | None = None
    smoothing: float | None = None
    proven: bool = False

    def plain(self):
        """Convert to a dict, as ``run.json`` has it."""
        entry: dict[str, Any] = {"value": self.value, "line": self.line, "error": self.error}
        if self.parts is not None:
            entry["parts"] = self.parts
        return entry | ({"proven": True} if self.proven else {})


def read_utilisation(given):
    """The `Utilisation` of what ``run.json`` says of it."""
    known = {key: given[key] for key in ("error", "parts", "proven") if key in given}
    return Utilisation(given["value"], given["line"], **known)


def strength_remark(utilisation):
    """A warning where the largest stress over strength, a `Utilisation`, exceeds 1, or may do so within its ±."""
    if utilisation is None:
        return
    value, line, error = utilisation[:3]
    if error is not None and utilisation.parts is None:  # not summed yet
        error += utilisation.smoothing or 0.0
    if error is not None and abs(value - 1.0) <= error:
        text = f"line {line} may break, which is undecided: stress over strength is {value:.3g} ± {error:.2g}, and 1 "
        yield Finding("over-strength", text + "lies within ±", "cable")
    elif value > 1.0:
        known = "" if error is not None else ", and its ± is not known"
        yield Finding("over-strength", f"line {line} breaks: stress over strength is {value:.3g}{known}", "cable")


def of_observable(scene, system, results, used):
    """(Result, factor) of a result that is the utilisation over a factor, with a known ±; None where there is none."""
    net = system.net
    cells = np.flatnonzero(net.line == used.line)
    limits = {"stress": net.strength[cells], "tension": net.strength[cells] * net.area[cells]}
    for observe in scene.observables:
        result = results.get(observe.name)
        if result is None or observe.quantity not in limits or observe.average is not None:
            continue
        limit = float(limits[observe.quantity][0])
        alike = abs(result.value - used.value * limit) <= ALIKE * abs(result.value)
        if result.where == used.line and result.error is not None and result.parts and alike:
            return result, 1.0 / limit
    return None
