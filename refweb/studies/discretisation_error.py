"""Discretisation errors: the same scene with more elements in every line.

A scene is solved with two and with four times as many elements. Let the first difference be q times the second. Then
the error of the scene is q/(q − 1) times the first difference. `MARGIN` is a factor of safety, since q may not be
constant yet.

May change: private functions and texts. Must stay: `left_of` and `MARGIN`, which `further_runs` uses for its own runs,
and `discretisation_errors`, which `runner` calls. `FINER`, `SLOWEST`, `FASTEST` and `MARGIN` change ± of results.
Tests: ``tests/dynamics/test_accuracy.py``.
"""

from __future__ import annotations

from dataclasses import replace

from ..settings import Accuracy

FINER = (2, 4)
"""Numbers of elements per line of the finer runs, over that of the scene."""
SLOWEST, FASTEST = 1.5, 16.0
"""Bounds on q: a smaller q shows no reliable convergence, and a larger q is chance."""
MARGIN = 1.25
"""Factor of safety on the error by three solutions (Roache, *Annu. Rev. Fluid Mech.* 29 (1997) 123–160, sec. 4)."""


def discretisation_errors(scene, results, solve):
    """Results with their discretisation error; without convergence it is twice the largest difference of the runs.

    Parameters
    ----------
    scene : refweb.Scene
        The scene as it was solved.
    results : list of dict of str to refweb.results.solution.Result
        Results of each load step, or of the motion.
    solve : callable
        Function that returns such a list for another scene.
    """
    results_by_mesh = [results]
    for times in FINER:
        cable = replace(scene.cable, subdivide=times * scene.cable.subdivide)
        results_by_mesh.append(solve(scene.replace(cable=cable, accuracy=Accuracy(error="none"))))
    return [
        {
            name: result._replace(discretisation=left_of(*(step[name].value for step in steps)))
            for name, result in coarse.items()
        }
        for coarse, *steps in zip(results, *results_by_mesh, strict=True)
    ]


def left_of(coarse, fine, finest):
    """Error of the first of three values."""
    first, second = abs(coarse - fine), abs(fine - finest)
    if second * SLOWEST > first:
        return 2.0 * max(first, second, abs(coarse - finest))
    ratio = min(first / second, FASTEST) if second > 0.0 else FASTEST
    return MARGIN * first * ratio / (ratio - 1.0)
