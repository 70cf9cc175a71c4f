"""A ball that is caught by two layers of lines which nothing joins, so that lines hit the ball and each other."""

import numpy as np

from ..contact import Contacts
from ..problem import Problem
from ..programs import refweb
from ..truth import Truth
from . import Work

RADIUS = 3e-3
"""Of lines for each other [m]."""


def capture(quick, side=0.1, gap=6.2e-3, mass=1.0, speed=5.0, radius=0.25):
    """Strings along x and strings along y above them, with masses at their ends, fly down to a ball at rest."""
    strings, pieces = (3, 7) if quick else (9, 13)
    places = side * (np.arange(strings) - strings // 2)
    along = side * (np.arange(pieces + 1.0) - pieces / 2)
    points, lines, ends = [], [], []
    for layer in range(2):
        for place in places:
            first, row = sum(map(len, points)), np.full((pieces + 1, 3), place)
            row[:, layer], row[:, 2] = along, gap * (layer - 0.5)
            points.append(row)
            lines.append(first + np.column_stack([np.arange(pieces), np.arange(1, pieces + 1)]))
            ends += [first, first + pieces]
    points = np.vstack([*points, [0.013, 0.007, -gap / 2 - radius - 2e-3]])
    weights, thrown, ball = np.zeros(len(points)), np.tile([0.0, 0.0, -speed], (len(points), 1)), len(points) - 1
    weights[ends], weights[ball], thrown[ball] = mass, 0.2, 0.0
    return Problem(
        points=points,
        lines=np.vstack(lines),
        natural=np.full(2 * strings * pieces, side),
        supports=np.array([], dtype=int),
        ea=100.0,
        density=0.05,
        node=0,
        duration=0.02 if quick else 0.05,
        weights=weights,
        thrown=thrown,
        ball=ball,
        ball_radius=radius,
        ball_stiffness=1e3,
        line_radius=RADIUS,
        line_stiffness=1e5,
    )


def verlet(problem, steps):
    """Positions at the end by the Verlet method, in NumPy."""
    step, weight, contacts = problem.duration / steps, 1.0 / problem.masses[:, None], Contacts(problem)
    x, v = problem.start, problem.velocities
    for _ in range(steps):
        x += 0.5 * step * v
        v += step * weight * (problem.forces(x) + contacts.forces(x))
        x += 0.5 * step * v
    return x
