"""The square web under 1 to 5 N at its centre, from flat, and from a bowl that users of other programs make by hand."""

from ..truth import equilibrium
from ..webs import LOADS, paper, problem
from . import Work

FROM_FLAT = ("refweb", "mujoco", "opensees", "exudyn", "kratos")
FROM_BOWL = ("refweb", "opensees", "exudyn", "kratos")


def one(name, title, said, dish, programs):
    return Work(
        name=name,
        title=title,
        said=said,
        task="statics",
        problem=lambda quick: problem(paper(quick), loads=LOADS, dish=dish * (0.2 if quick else 1.0)),
        truth=equilibrium,
        settings={program: [{}] for program in programs},
        target=5e-5,
    )


WORKS = (
    one(
        "statics-flat",
        "Statics from flat",
        "1, 2, 3, 4 and 5 N at the centre of the square web of 3120 lines, which is flat and without tension at first.",
        0.0,
        FROM_FLAT,
    ),
    one(
        "statics-dish",
        "Statics from a bowl",
        "The same from a paraboloid of 0.2 m, a start that a user makes by hand and tries until Newton's method "
        "converges; OpenSees does from 0.2 m and not from 0.05 or 0.5 m. refweb starts from flat here, too; MuJoCo, "
        "which follows a damped motion, needs no bowl.",
        0.2,
        FROM_BOWL,
    ),
)
