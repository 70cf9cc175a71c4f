"""A ball that is caught by two layers of lines which nothing joins, so that lines hit the ball and each other."""

import numpy as np

from ..contact import Contacts
from ..problem import Problem
from ..programs import refweb
from ..truth import Truth
from . import Work
from .impact import STEPPED

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


def right(problem, steps=8000):
    """Positions at the end, a `Truth`."""
    found, other = refweb.capture(problem, steps=steps // 2, method="explicit", order=6), verlet(problem, steps)
    apart = float(np.abs(found - other).max())
    said = f"the mean of {steps // 2} of refweb's steps of order 6 and {steps} of the Verlet method in NumPy"
    return Truth(0.5 * (found + other), apart, said)


def verlet(problem, steps):
    """Positions at the end by the Verlet method, in NumPy."""
    step, weight, contacts = problem.duration / steps, 1.0 / problem.masses[:, None], Contacts(problem)
    x, v = problem.start, problem.velocities
    for _ in range(steps):
        x += 0.5 * step * v
        v += step * weight * (problem.forces(x) + contacts.forces(x))
        x += 0.5 * step * v
    return x


def ladder(steps, rtol):
    """Settings from the longest steps to the shortest."""
    found = {name: [{"steps": n} for n in steps] for name in STEPPED}
    found |= {"newton": [{"steps": steps[0]}], "moordyn": [{"steps": 4 * steps[0]}]}
    return found | {"dop853": [{"rtol": one} for one in rtol], "pyelastica": [{"steps": 4 * steps[0]}]}


SAID = (
    "Two layers of nine strings each, of 13 lines of 0.1 m with EA = 100 N and 50 g/m, cross each other and are joined "
    "nowhere; masses of 1 kg are at their ends. They fly at 5 m/s to a ball of 0.2 kg with a radius of 0.25 m, which "
    "pushes the lower layer and through it the upper one. The penalties are those of `validation/peers/contact.py`: "
    "1 kN/m of the ball, and 100 kN/m of strings with a radius of 3 mm. Error: farthest node after 0.05 s, when the "
    "ball flies at 3.9 m/s. After 0.1 s, when strings have slipped over each other, both right answers are 2 mm apart. "
    "Each program takes the longest of its steps, or the largest of its tolerances, that is good for "
    "0.5 mm. Warp has the penalties as kernels of one's own; DOP853, OpenSees, Exudyn and Kratos have no contact of "
    "lines that can have them, and take them from that file in each step. MuJoCo, Newton and PyElastica have their own "
    "contact, and what stands in their rows is how far that is from this: MuJoCo's is another one of lines, linear in "
    "the overlap; Newton's has nodes, no lines; PyElastica shares the push between nodes by halves. MoorDyn has none. "
    "Kratos's cables have the strain of Green, which matters at strains of 0.1."
)
WORKS = (
    Work(
        name="capture",
        title="Capture with self-contact at equal error",
        said=SAID,
        task="capture",
        problem=capture,
        truth=right,
        settings=ladder((800, 1600, 3200), (1e-3, 1e-4, 1e-5)),
        target=5e-4,
        quick=ladder((400, 800), (1e-3, 1e-4)),
    ),
)
