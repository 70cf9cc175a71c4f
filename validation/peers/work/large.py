"""Statics of a net of 79 600 lines."""

from ..truth import equilibrium
from ..webs import LOADS, large, problem
from . import Work

WORKS = (
    Work(
        name="large",
        title="Statics of 200 × 200",
        said="1, 2, 3, 4 and 5 N at the centre of a square net of 200 × 200 cells of 0.1 m, 79 600 lines: refweb from "
        "flat, the others from a paraboloid of 1 m.",
        task="statics",
        problem=lambda quick: problem(large(12 if quick else 200), loads=LOADS, dish=0.1 if quick else 1.0),
        truth=equilibrium,
        settings={name: [{}] for name in ("refweb", "opensees", "exudyn", "kratos")},
        target=5e-5,
    ),
)
