"""How likely does a net hold a tumbling stage?

The capture of ``refweb run capture-stage`` with errors of aim, spin and speed, as the study ``refweb sweep
odds-of-capture``, but for contact of lines with lines, which takes ten times as long: the stage stands off the line of
the throw by a normal distribution of 1 m along its axis and across, tumbles about y by 0.05 ± 0.1 rad/s, and the net
flies with 5 ± 1 m/s. A net holds it where, at the end, the centre of the stage is inside of it and the mouth is closed.

One run of a net that folds is one draw of many, and its own ± says how far it is determined. What is told here are
statistics: the share of the draws that hold, with the interval of Clopper and Pearson (Biometrika 26 (1934) 404–413,
doi:10.1093/biomet/26.4.404), written out below as quantiles of beta distributions. What matters most is told by
Spearman's rank correlation of each error's size with what the net covers; at no correlation it is within ± 1.96/√n in
95 of 100 studies.
"""

import tomllib

import numpy as np
from scipy.stats import beta, spearmanr

import refweb
from refweb.sweeps.study import SHIPPED_STUDIES

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict

ERRORS = {
    "aim along the stage": ("body.stage.position.0", 0.0),
    "aim across it": ("body.stage.position.1", 0.0),
    "spin": ("body.stage.angular_velocity.1", 0.05),
    "speed": ("velocity.0.value.2", None),
}
"""Paths of what varies, and what its size is measured from; of the speed the value itself."""


def case(quick):
    given = tomllib.loads((SHIPPED_STUDIES / "odds-of-capture.toml").read_text(encoding="utf-8"))
    if quick:
        given |= {"count": 16}
        given["parameters"] |= {"web.layers": [2], "web.cell_area": [11.0]}
    found = refweb.sweep(refweb.Study(**given))
    count = given["count"]
    (chances,) = found.chances
    held, (low, high) = chances["conditions"]["held"], chances["conditions"]["held"]["by_samples"]
    n = found.count.get("solved", 0)
    inside, closed, covers = (found.values(name) for name in ("inside", "closed", "covered"))
    k = int(((inside > 0.5) & (closed > 0.5)).sum())
    exact = [beta.ppf(0.025, k, n - k + 1) if k else 0.0, beta.ppf(0.975, k + 1, n - k) if k < n else 1.0]
    source, reason = "quantiles of beta distributions", "rounding"
    rows = [
        Row("draws with an answer", n, count, "all that were asked for", 0.02, "a draw in fifty may be refused"),
        Row("probability to hold, least", low, exact[0], source, 1e-9, reason, scale=1.0),
        Row("probability to hold, most", high, exact[1], source, 1e-9, reason, scale=1.0),
    ]
    limit, table = 1.96 / np.sqrt(n), []
    answered = np.isfinite(covers)
    for name, (path, centre) in ERRORS.items():
        size = found.values(path) if centre is None else np.abs(found.values(path) - centre)
        rho = float(spearmanr(size[answered], covers[answered]).statistic)
        table.append([name, f"{rho:+.2f}", f"± {limit:.2f}", "yes" if abs(rho) > limit else "not shown"])
    most = max(table, key=lambda row: abs(float(row[1])))
    statistical = held["statistical"]
    verdicts = [
        Verdict(
            "The probability that the net holds the stage.",
            "holds",
            f"{k} of {n} draws hold: {100.0 * k / n:.0f} %, between {100.0 * low:.0f} and {100.0 * high:.0f} % "
            f"(95 %); draws that ± leaves undecided: {held['undecided']}, and of which the twin tells nothing: "
            f"{statistical}",
            0.0 < low <= k / n <= high <= 1.0,
        ),
        Verdict(
            "What matters most.",
            "holds",
            f"{most[0]}: its size and what is covered have a rank correlation of {most[1]}"
            + ("" if most[3] == "yes" else f", which {n} draws do not tell from none"),
            np.isfinite(float(most[1])),
        ),
    ]

    def drawn():
        page, panels = plots.axes([f"{name}" for name in ERRORS], "covered", columns=len(ERRORS), sharey=True)
        for plot, (path, _) in zip(panels, ERRORS.values(), strict=True):
            at, yes = found.values(path), (inside > 0.5) & (closed > 0.5)
            plot.plot(at[yes], covers[yes], ".", label="holds")
            plot.plot(at[~yes], covers[~yes], "x", label="does not")
        named = panels[0].get_legend_handles_labels()
        page.legend(*named, loc="outside upper right", ncols=2, frameon=False, fontsize="small")
        return page

    figures = [Figure("What is covered at the end, by what varies [m, m, rad/s, m/s].", drawn)]
    head = ["error", "rank correlation with what is covered", "of none (95 %)", "matters"]
    return Case(rows=rows, verdicts=verdicts, figures=figures, tables=[Table("What matters", head, table)])
