"""Errors of elements: the same scene with every line in more of them.

A scene is solved with every line in two and in four times as many elements: where the first difference is q times the
second, what is left after the first is q/(q − 1) times that, and `MARGIN` times it where q is not yet constant.
"""

from __future__ import annotations

from dataclasses import replace

from ..settings import Accuracy

FINER = (2, 4)
"""Number of elements per line that are compared with, over that of the scene."""
SLOWEST, FASTEST = 1.5, 16.0
"""Bounds on q: slower is no convergence that could be relied on, and faster is chance."""
MARGIN = 1.25
"""Factor of safety on what three solutions say (Roache, *Annu. Rev. Fluid Mech.* 29 (1997) 123–160, sec. 4)."""


def discretisation_errors(scene, results, solve):
    """Results with the error of elements; those that do not converge have all that was seen as their error.

    Parameters
    ----------
    scene : refweb.Scene
        As it was solved.
    results : list of dict of str to refweb.results.solution.Result
        Of each load step, or of the motion.
    solve : callable
        Gives such a list of another scene.
    """
    results_by_mesh = [results]
    for times in FINER:
        cable = replace(scene.cable, subdivide=times * scene.cable.subdivide)
        results_by_mesh.append(solve(scene.replace(cable=cable, accuracy=Accuracy(error="none"))))
    return [
        {
            name: result._replace(discretisation=_left(*(step[name].value for step in steps)))
            for name, result in coarse.items()
        }
        for coarse, *steps in zip(results, *results_by_mesh, strict=True)
    ]


def _left(coarse, fine, finest):
    """Error of the first of three values."""
    return left_of(abs(coarse - fine), abs(fine - finest), abs(coarse - finest))


def left_of(first, second, both):
    """Error of the first of three values that are ``first`` and ``second`` apart one after another, and ``both``."""
    if second * SLOWEST > first:
        return 2.0 * max(first, second, both)
    ratio = min(first / second, FASTEST) if second > 0.0 else FASTEST
    return MARGIN * first * ratio / (ratio - 1.0)
