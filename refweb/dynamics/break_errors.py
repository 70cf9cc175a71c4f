"""± of the times of breaks, and the time until which their order is known.

May change: words of warnings and private functions. Must stay: `add_errors_of_breaks` writes to ``error`` of the breaks
of `Watch.breaks`, whose keys stand in ``run.json``, and returns the time after which `twin_error` gives no ±. Tests:
``tests/effects/test_rupture.py``.
"""

from __future__ import annotations

import numpy as np

from ..findings import Finding


def add_errors_of_breaks(solution, run, refined, share):
    """Add ± to the times of breaks, while run and step refinement break the same lines in the same order.

    After the first break at which they differ, their difference shows no error. Later results have no ±, and a warning
    reports it. Another warning names the first two breaks that are nearer to each other than their ±.

    Parameters
    ----------
    solution : refweb.Solution
        Solution at the end of the run, with its breaks and results.
    run, refined : refweb.system.broken_lines.Breaks
        Breaks of the run and of its step refinement.
    share : float
        ± over the difference of both runs.

    Returns
    -------
    float
        Time after which no ± is known [s].
    """
    for n, record in enumerate(solution.breaks):
        alike = n < len(refined.elements) and run.elements[n] == refined.elements[n]
        if not alike:
            break
        off = abs(record["time"] - float(refined.times[n]))
        widths = float(run.widths[n] + refined.widths[n])
        record["error"] = float(share * off + widths + 4.0 * np.finfo(float).eps * record["time"])
    else:
        n = len(solution.breaks)
    _warn_of_near(solution, n)
    if n < max(len(run.elements), len(refined.elements)):
        return _end_of_knowledge(solution, run, refined, n)
    return np.inf


def _warn_of_near(solution, count):
    """Warn of the first of so many breaks that the next break may precede."""
    for first, later in zip(solution.breaks[:count], solution.breaks[1:count], strict=False):
        if 0.0 < later["time"] - first["time"] < first["error"] + later["error"]:
            text = (
                f"lines {first['line']} and {later['line']} break within ± of each other at t = {later['time']:.6g} s: "
                "the run and its refinement have them in this order, which is not proven"
            )
            solution.findings.append(Finding("breaks-in-doubt", text, "rupture"))
            return


def _end_of_knowledge(solution, run, refined, n):
    """Remove ± of results from break ``n`` on, with a warning; return the time of that break [s]."""
    times = [breaks.times[n] for breaks in (run, refined) if n < len(breaks.times)]
    since = float(min(times))
    net = solution.state.system.net
    words = [
        f"is of line {net.line[breaks.elements[n]]} at t = {breaks.times[n]:.6g} s"
        if n < len(breaks.times)
        else "is none"
        for breaks in (run, refined)
    ]
    text = (
        f"the order of breaks is beyond the horizon from t = {since:.6g} s on: break {n + 1} {words[0]}, in the "
        f"twin it {words[1]}; what is found from then on has no ±"
    )
    solution.findings.append(Finding("breaks-in-doubt", text, "rupture"))
    for name, result in solution.reduced.items():
        if result.time >= since:
            solution.reduced[name] = result._replace(error=None)
    for event in solution.events:
        if event["time"] is not None and event["time"] >= since:
            event["error"] = None
    return since
