"""The impact by methods that solve equations in each step."""

from ..truth import motion
from . import Work
from .impact import SAID, impact

ADAMS = {"method": "cvode", "family": "adams", "max_order": 2}


def ladder(share=1):
    """Settings; 1/share of the steps where the motion is that much shorter."""
    found = {name: [{"steps": n // share} for n in (150, 300)] for name in ("opensees", "exudyn", "kratos")}
    return found | {"refweb": [{"rtol": rtol, **ADAMS} for rtol in (1e-3, 1e-4)]}


WORKS = (
    Work(
        name="implicit",
        title="Implicit impact",
        said=f"{SAID} Newmark's method with β = 1/4 and γ = 1/2, which is the trapezoidal rule, in all programs: "
        "of steps of 0.67 and 0.33 ms, and with control of errors as CVODE's Adams method of order 2 in refweb.",
        task="implicit",
        problem=impact,
        truth=motion,
        settings=ladder(),
        target=5e-4,
        quick=ladder(5),
    ),
)
