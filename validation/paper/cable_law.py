"""Figure 2: the cable law, and what it is under compression.

The law of *Dynamic modelling and analysis of space webs* (eq. 3, section 2.2), with strain ε, slackness ε0, smoothing η
and asymptotic stiffness E:

    σ = ½ [(ε − ε0) + √((ε − ε0)² + 4 η²)] E − α E,      α = ½ [−ε0 + √(ε0² + 4 η²)]

Independent method: this formula as it is printed, in 60 digits; in doubles it loses all of them at small strains.
Limits in closed form: σ → −αE under compression, σ → E (ε − ε0 − α) in tension, and dσ/dε = α E/√(ε0² + 4 η²) at ε = 0.
The floor −αE is set beside what the webs of [figures 10 to 15](#webs_under_load) carry.
"""

import mpmath
import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict

EPS = np.finfo(float).eps
MODULUS = 7e7
PARAMETERS = ((0.0, 1e-3), (0.0, 1e-5), (1e-3, 1e-4), (1e-3, 1e-3), (1e-2, 1e-5))
"""(ε0, η)."""
STRAINS = (-0.5, -1e-2, -1e-3, -1e-9, 1e-15, 1e-9, 1e-5, 1e-3, 1.01e-3, 1e-2, 0.5)


def printed(strain, slackness, smoothing, modulus=MODULUS):
    """σ of eq. 3 as printed, in 60 digits [Pa]."""
    with mpmath.workdps(60):
        strain, slackness, smoothing = map(mpmath.mpf, (strain, slackness, smoothing))

        def bracket(s):
            return (s + mpmath.sqrt(s * s + 4 * smoothing * smoothing)) / 2

        return float(modulus * (bracket(strain - slackness) - bracket(-slackness)))


def floor(slackness, smoothing, modulus=MODULUS):
    """αE [Pa]."""
    with mpmath.workdps(60):
        root = mpmath.sqrt(mpmath.mpf(slackness) ** 2 + 4 * mpmath.mpf(smoothing) ** 2)
        return float(modulus * (root - mpmath.mpf(slackness)) / 2)


def of_segment(extension, length, slackness, smoothing, area=1e-4):
    """T of eq. 2 from the extension Δ [m] of a segment of natural length L [m], Δ0 = ε0 L and N = η L, in doubles."""
    margin, factor = slackness * length, smoothing * length
    beyond = extension - margin
    alpha = floor(slackness, smoothing, 1.0)
    return 0.5 * (beyond + np.hypot(beyond, 2.0 * factor)) * MODULUS * area / length - alpha * MODULUS * area


def case(quick):
    law, rows, table = refweb.Law("smooth"), [], []
    for slackness, smoothing in PARAMETERS:
        name, numbers = f"ε0 = {slackness:g}, η = {smoothing:g}", (MODULUS, slackness, smoothing)
        found = [law.stress(strain, *numbers) for strain in STRAINS]
        exact = [printed(strain, slackness, smoothing) for strain in STRAINS]
        worst = max(abs(f / e - 1) for f, e in zip(found, exact, strict=True))
        reason = "sixteen roundings of a formula that does not cancel"
        text = f"{name}: largest relative error of σ"
        rows.append(Row(text, worst, 0.0, "eq. 3 in 60 digits", 16 * EPS, reason, scale=1))
        alpha = floor(slackness, smoothing) / MODULUS
        start = alpha / float(np.hypot(slackness, 2 * smoothing))
        reason = "E (2η)²/4|ε − ε0| is left at ε = −1, and rounding"
        rows.append(
            Row(
                f"{name}: stress at ε = −1",
                float(law.stress(-1.0, *numbers)),
                -alpha * MODULUS,
                "−αE",
                smoothing**2 / alpha + 8 * EPS,
                reason,
                "Pa",
            )
        )
        tangent = float(law.tangent(0.0, *numbers)) / MODULUS
        rows.append(Row(f"{name}: tangent at ε = 0 over E", tangent, start, "closed form", 16 * EPS, "rounding"))
        table.append(
            [
                f"{slackness:g}",
                f"{smoothing:g}",
                f"{1e-3 * floor(slackness, smoothing):.4g}",
                f"{100 * start:.3g} %",
                f"{slackness + alpha:.6g}",
            ]
        )
    segment = of_segment(3e-4, 0.1, 1e-3, 1e-4)
    value, reason = float(law.stress(3e-3, MODULUS, 1e-3, 1e-4)) * 1e-4, "rounding of eq. 2, which cancels by 1/10"
    rows.append(Row("tension of a segment of 0.1 m, from eq. 3", value, segment, "eq. 2", 100 * EPS, reason, "N"))

    largest = refweb.run(refweb.Scene.load("hexagon-load")).results["max_stress"].value
    wide, narrow = floor(0.0, 1e-3), floor(0.0, 1e-6)
    free = [float(law.tangent(0.0, MODULUS, *numbers)) / MODULUS for numbers in ((0.0, 1e-5), (1e-3, 1e-5))]
    margin = PARAMETERS[0][0] + floor(*PARAMETERS[0]) / MODULUS
    crush = [float(law.stress(strain, MODULUS, 0.0, 1e-3)) for strain in (-0.01, -0.5, -0.999)]
    upper, lower = (float(law.tangent(s, MODULUS, 1e-3, 1e-4)) / MODULUS for s in (0.1, -0.1))
    verdicts = [
        Verdict(
            '"The slope of asymptotes is controlled by E" (figure 2)',
            "holds",
            f"the upper one has the slope E (1 − {1 - upper:.0e} at ε = 0.1), the lower one the slope 0 "
            f"({lower:.0e} E at ε = −0.1)",
            abs(upper - 1) < 1e-5 and abs(lower) < 1e-5,
        ),
        Verdict(
            '"Initial slackness margin is controlled by ε0, the smoothness of curve by η" (figure 2)',
            "holds only when",
            f"η is much smaller than ε0: the upper asymptote meets σ = 0 at ε0 + α, so that η = 1e-3 makes a margin of "
            f"{margin:g} even with ε0 = 0",
            margin > 0.99e-3,
        ),
        Verdict(
            '"Stretching from natural length, the web segment has tiny stiffness on both sides" (section 2.2)',
            "holds only when",
            f"η is much smaller than ε0: the tangent at ε = 0 is {free[1]:.1e} E with ε0 = 1e-3, η = 1e-5, and "
            f"{free[0]:g} E with ε0 = 0 and any η",
            free[0] == 0.5 and free[1] < 1e-3,
        ),
        Verdict(
            '"When the web segment is compressed, there is hardly resistance" (section 2.2)',
            "holds only when",
            "the floor αE is small beside the stresses. With ε0 = 0, α = η: at η = 1e-3 a slack segment pushes with "
            f"{1e-3 * wide:.0f} kPa, more than the {1e-3 * largest:.1f} kPa that the hexagon web carries anywhere "
            f"under 5 N; at η = 1e-6 with {narrow:.0f} Pa, {100 * narrow / largest:.2g} % of it. The paper does not "
            "state η",
            wide > largest and narrow < 0.01 * largest,
        ),
        Verdict(
            '"The incompressible property of cable material" (sections 1 and 2.2)',
            "does not hold",
            "an incompressible segment would resist any shortening without limit; this law gives way to "
            f"{-1e-3 * crush[0]:.2f} kPa at ε = −0.01, {-1e-3 * crush[1]:.2f} kPa at −0.5 and {-1e-3 * crush[2]:.2f} "
            "kPa at −0.999, never more than αE (E = 70 MPa, ε0 = 0, η = 1e-3). Compression-free is meant",
            all(-c <= wide for c in crush),
        ),
    ]
    columns = ["ε0", "η", "floor αE [kPa]", "tangent at ε = 0 over E", "margin ε0 + α"]
    return Case(
        rows=rows,
        verdicts=verdicts,
        tables=[Table("Floor, first stiffness and margin of the law, E = 70 MPa", columns, table)],
        figures=[Figure("Figure 2: σ over ε, and what ε0, η and E do to it; dashed, the asymptotes.", drawn)],
    )


def drawn():
    law, strain = refweb.Law("smooth"), 1e-3 * np.linspace(-4, 6, 400)
    page, plot = plots.axes("strain ε [10⁻³]", ["stress σ [kPa]"] * 3, columns=3, height=3.0, sharey=True)
    curves = (
        ("ε0", [(7e7, e, 5e-4) for e in (0.0, 1e-3, 2e-3)], lambda n: f"{n[1]:g}"),
        ("η", [(7e7, 1e-3, h) for h in (1e-5, 5e-4, 1e-3)], lambda n: f"{n[2]:g}"),
        ("E", [(e, 1e-3, 5e-4) for e in (3.5e7, 7e7, 1.05e8)], lambda n: f"{1e-6 * n[0]:g} MPa"),
    )
    for one, (name, many, label) in zip(plot, curves, strict=True):
        for colour, numbers in zip(plots.COLOURS, many, strict=False):
            bottom = law.floor(*numbers)
            one.plot(
                1e3 * strain, 1e-3 * law.stress(strain, *numbers), color=colour, label=f"{name} = {label(numbers)}"
            )
            line = np.maximum(numbers[0] * (strain - numbers[1]), 0.0) - bottom
            one.plot(1e3 * strain, 1e-3 * line, "--", color=colour, linewidth=0.7)
        one.legend(frameon=False, fontsize="small", loc="upper left")
    for one in plot[1:]:
        one.set_ylabel("")
    return page
