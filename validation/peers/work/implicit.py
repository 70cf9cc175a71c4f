"""The impact by methods that solve equations in each step, at two errors."""

from ..truth import motion
from . import Work
from .impact import SAID, impact

FAMILIES = {"bdf": {"family": "bdf"}, "adams": {"family": "adams", "max_order": 2}}
NEWMARK = ("opensees", "kratos", "exudyn")


def settings(steps, tolerances, share=1):
    """Settings; 1/share of the steps where the motion is that much shorter."""
    of_refweb = [{"rtol": rtol, "method": "cvode", **keys} for rtol in tolerances for keys in FAMILIES.values()]
    return {"refweb": of_refweb} | {name: [{"steps": n // share} for n in steps] for name in NEWMARK}


def work(name, title, target, steps, tolerances):
    return Work(
        name=name,
        title=title,
        said=f"{SAID} Each program takes the cheapest of its set-ups that is good for {1e3 * target:g} mm: Newmark's "
        "method with β = 1/4 and γ = 1/2, the trapezoidal rule, in steps of 0.1 s over "
        f"{' or '.join(map(str, steps))}; CVODE's BDF and Adams method of order 2 with control of errors in refweb. "
        "OpenSees solves with SparseSYM, a fifth faster than with UmfPack, to changes of 1e-6 m, and Kratos to "
        "residuals of 1e-8: with 1e-5 m and 1e-6 they miss by more than 0.1 m and take longer.",
        task="implicit",
        problem=impact,
        truth=motion,
        settings=settings(steps, tolerances),
        target=target,
        quick=settings(steps, tolerances[-1:], share=5),
    )


WORKS = (
    work("implicit", "Implicit impact", 3.5e-4, (100, 150), (1e-3, 3e-4)),
    work("implicit-fine", "Implicit impact, finer", 1e-4, (200, 300), (1e-4,)),
)
