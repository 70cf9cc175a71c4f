"""A mass of 1 kg leaves the centre of the square web at 1 m/s: at equal steps, and at equal error."""

from ..truth import motion
from ..webs import paper, problem
from . import Work

STEPPED = ("refweb", "mujoco", "opensees", "exudyn", "kratos", "moordyn", "warp", "newton")
STEPS, QUICK = 2000, 400
"""Of 0.1 s, and of 0.02 s in the quick variant: 0.46 of the longest stable step."""


def impact(quick):
    return problem(paper(quick), mass=1.0, speed=1.0, duration=0.02 if quick else 0.1)


def ladder(steps):
    """Settings from the longest step that is stable to the shortest."""
    found = {name: [{"steps": n} for n in (5 * steps // 8, steps, 2 * steps)] for name in STEPPED}
    found["refweb"] += [{"steps": steps // 2, "method": "explicit", "order": 6}]
    found["moordyn"] = [{"steps": 5 * steps // 8}]
    found["pyelastica"] = [{"steps": 5 * steps, "radius": 4e-3}]
    return found | {"dop853": [{"rtol": 10.0**-n} for n in (2, 3, 4)]}


SAID = (
    "A point mass of 1 kg at the centre of the square web of 3120 lines has 1 m/s at first: an impact without the "
    "contact, which every program has in a way of its own. Error: farthest node after 0.1 s, at 68 mm of depth."
)
WORKS = (
    Work(
        name="impact-steps",
        title="Impact at equal steps",
        said=f"{SAID} All programs that have fixed steps take {STEPS} of 5e-5 s.",
        task="impact",
        problem=impact,
        truth=motion,
        settings={name: [{"steps": STEPS}] for name in STEPPED},
        target=float("inf"),
        quick={name: [{"steps": QUICK}] for name in STEPPED},
    ),
    Work(
        name="impact-error",
        title="Impact at equal error",
        said=f"{SAID} Each program takes the longest of its steps, or the largest of its tolerances, that is good for "
        "0.05 mm.",
        task="impact",
        problem=impact,
        truth=motion,
        settings=ladder(STEPS),
        target=5e-5,
        quick=ladder(QUICK) | {"pyelastica": [{"steps": 80 * QUICK, "radius": 2.5e-4}]},
    ),
)
