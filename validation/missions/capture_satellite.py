"""A net catches a tumbling satellite from a mesh file.

A net with masses of 5 kg at its corners is thrown at 5 m/s at a satellite of 600 kg with two folded arrays, a closed
surface of triangles that is not convex; ``refweb run capture-satellite`` is the scene. Contact is with the distance on
a grid, within the error that refweb states of it. What is exact is as in the capture of a stage: momentum, angular
momentum, and the least kinetic energy of one rigid body,

    T ≥ p²/2M + ½ L·I⁻¹L.

Volume, centre of mass and moments of inertia of the surface are those of three boxes.
"""

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row
from .capture import judged

BOXES = (((1.4, 1.4, 1.8), 0.0), ((1.6, 1.2, 0.6), 1.5), ((1.6, 1.2, 0.6), -1.5))
"""Sizes [m] of the boxes that the satellite is made of, and where along x their centres are [m]."""
MASS = 600.0
"""Of the satellite [kg]."""


def outside(points):
    """Distance of points to the three boxes [m], see `capture.clearance`."""
    centres, sizes = ([[at, 0.0, 0.0] for _, at in BOXES], [size for size, _ in BOXES])
    over = np.abs(points[:, None, :] - centres) - 0.5 * np.array(sizes)
    return np.linalg.norm(np.maximum(over, 0.0), axis=2).min(axis=1)


def case(quick):
    values = {"web.layers": 3, "web.cell_area": 4.0, "self_contact": False} if quick else {}
    solution = refweb.run(refweb.Scene.load("capture-satellite", values))
    rows, verdicts = judged(solution, "satellite", None if quick else outside)
    volumes = [float(np.prod(size)) for size, _ in BOXES]
    moments = np.zeros(3)
    for volume, (size, at) in zip(volumes, BOXES, strict=True):
        share, (a, b, c) = MASS * volume / sum(volumes), size
        moments += share * np.array([(b * b + c * c) / 12.0, (a * a + c * c) / 12.0 + at * at,
                                     (a * a + b * b) / 12.0 + at * at])  # fmt: skip
    body = solution.frames[0][1].system.net.bodies[0]
    found = np.linalg.eigvalsh(body.inertia)
    rows += [
        Row(f"moment of inertia {n + 1} of the mesh", mine, exact, "three boxes", 1e-12, "rounding", "kg m²")
        for n, (mine, exact) in enumerate(zip(found, np.sort(moments), strict=True))
    ]
    figures = [Figure("The satellite at the end.", lambda: plots.picture(solution, "tension"))]
    return Case(rows=rows, verdicts=verdicts, figures=figures)
