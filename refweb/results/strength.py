"""Largest stress over strength of a run, its ±, and findings on it.

May change: texts of findings, and `ALIKE`, a tolerance. Must stay: keys of ``plain``, which stand in ``run.json`` and
which `read_utilisation` reads; `UTILISATION`, a tuple, so that no name of a result is equal to it; `Utilisation`, which
statics and dynamics fill; `strength_remark`, which `dynamics.simulation`, `statics.remarks` and `statics.simulation`
import; `of_observable`, which `error_budget` imports. Tests: ``tests/results/test_strength.py``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..findings import Finding

ALIKE = 1e-6
"""Relative difference up to which two stresses of one line count as equal."""
UTILISATION = ("utilisation",)
"""Key of the utilisation among names of results; it is a tuple, so that no result has this name."""


class Utilisation(NamedTuple):
    """Largest stress over strength, in dynamics over time, in statics at the last load step.

    Attributes
    ----------
    value : float
        The largest stress over strength [1].
    line : int
        Line of the largest value.
    error : float or None
        ± of the value [1], None if it is not known. It is that of a result that observes the same stress, if there is
        one. Else it has the part of time steps or of rounding, and other parts that were computed.
    parts : dict or None
        Parts of ±, as for a `refweb.results.solution.Result`; None before the end of the run.
    smoothing : float or None
        Error of the smooth law [1], if it was computed.
    proven : bool
        True if ± of an equilibrium is a bound from duality.
    """

    value: float
    line: int
    error: float | None = None
    parts: dict[str, float | str] | None = None
    smoothing: float | None = None
    proven: bool = False

    def plain(self):
        """Convert to a dict, as in ``run.json``."""
        entry: dict[str, Any] = {"value": self.value, "line": self.line, "error": self.error}
        if self.parts is not None:
            entry["parts"] = self.parts
        return entry | ({"proven": True} if self.proven else {})


def read_utilisation(given):
    """The `Utilisation` from its dict in ``run.json``."""
    known = {key: given[key] for key in ("error", "parts", "proven") if key in given}
    return Utilisation(given["value"], given["line"], **known)


def strength_remark(utilisation):
    """Find a `Utilisation` that exceeds 1, or may exceed 1 within its ±."""
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
    """(Result, factor) of a result with a known ± that is the utilisation over a factor; None without such a result."""
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
