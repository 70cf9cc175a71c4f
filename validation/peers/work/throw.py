"""A capture net that is thrown: drawn in and slack at first, until it is open and taut."""

import numpy as np

from ..problem import Problem
from ..truth import motion
from . import Work
from .impact import STEPPED

STEPS = (500, 1000, 2000, 4000)
RTOL = (1e-2, 1e-3, 1e-4, 1e-5)


def throw(quick, side=0.1, folded=0.7, mass=1.0, velocity=(3.0, 3.0, 5.0)):
    """A square net of 16 × 16 cells of cords of 50 N, drawn in to 0.7 of its size, whose corner masses fly."""
    cells = 6 if quick else 16
    number = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    plan = np.stack(np.meshgrid(*2 * [side * (np.arange(cells + 1.0) - cells / 2)], indexing="ij"), axis=-1)
    points = np.column_stack([plan.reshape(-1, 2), np.zeros(number.size)])
    lines = np.vstack([np.column_stack([number[:-1].ravel(), number[1:].ravel()]),
                       np.column_stack([number[:, :-1].ravel(), number[:, 1:].ravel()])])  # fmt: skip
    weights, thrown, corners = np.zeros(len(points)), np.zeros_like(points), number[::cells, ::cells].ravel()
    weights[corners] = mass
    thrown[corners] = np.sign(points[corners] + [0.0, 0.0, 1.0]) * velocity
    return Problem(
        points=points,
        lines=lines,
        natural=np.full(len(lines), side),
        supports=np.array([], dtype=int),
        ea=50.0,
        density=0.02,
        node=int(number[cells // 2, cells // 2]),
        duration=0.06 if quick else 0.15,
        folded=folded * points,
        weights=weights,
        thrown=thrown,
    )


def ladder(steps, rtol):
    """Settings from the longest steps to the shortest."""
    found = {name: [{"steps": n} for n in steps] for name in STEPPED}
    found["refweb"] += [{"steps": steps[0] // 2, "method": "explicit", "order": 6}]
    found |= {"moordyn": [{"steps": steps[-1]}], "pyelastica": [{"steps": 4 * steps[-1], "radius": 4e-3}]}
    return found | {"dop853": [{"rtol": one} for one in rtol]}


WORKS = (
    Work(
        name="throw",
        title="Throw at equal error",
        said="A free net of 16 × 16 cells of 0.1 m and of soft cords, 544 lines with EA = 50 N and 20 g/m, is drawn in "
        "to 0.7 of its size and slack. Masses of 1 kg at its corners fly at 3 m/s along both sides outwards and at "
        "5 m/s forward. Error: farthest node after 0.15 s, when the net is open, 1.8 m wide with three of four lines "
        "taut. Stiffer cords snap so often that there is no right answer: with 700 N one method ends 65 mm apart "
        "at two steps. Each program takes the longest of its steps, or the largest of its tolerances, that "
        "is good for 1 mm.",
        task="impact",
        problem=throw,
        truth=motion,
        settings=ladder(STEPS, RTOL),
        target=1e-3,
        quick=ladder((300, 600), (1e-4,)),
    ),
)
