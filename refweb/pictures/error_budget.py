"""Picture of an error budget: the parts of ± of each result as a stacked bar, relative to its value.

May change: all of the drawing, `MOST` among it. Must stay: `draw`, which `studies.further_runs` calls; a colour in
`sheet.COLOURS` for each of `results.error_budget.PARTS`, as a part without one is left out silently. Tests:
``tests/studies/test_further_runs.py``.
"""

from __future__ import annotations

from ..results.error_budget import ALLOWED, OPEN, PARTS, WORDS
from .sheet import COLOURS, LETTERS, Panel, legend, sheet

MOST = 1.0
"""± over the value to which longer bars are scaled down, with all their parts."""


def draw(results, title):
    """Draw the error budgets of results by name; returns a `matplotlib.figure.Figure`."""
    names = list(results)

    def bars(axes):
        drawn = {}
        for row, name in enumerate(reversed(names)):
            result, left = results[name], 0.0
            size = abs(result.value) or 1.0
            shrunk = min(1.0, MOST * size / result.error) if result.error else 1.0
            for part, colour in zip(PARTS, COLOURS, strict=False):
                if isinstance(share := result.parts[part], float) and share > 0.0:
                    width = shrunk * share / size
                    drawn[part] = axes.barh(row, 100.0 * width, left=100.0 * left, color=colour, height=0.6)
                    left += width
            missing = [WORDS[part] for part in PARTS if result.parts[part] == OPEN]
            words = result.verdict or ("without " + ", ".join(missing) if missing else "")
            over = f"→ {100.0 * result.error / size:.0f} %, " if result.error and result.error > MOST * size else ""
            inside = left > 0.6 * MOST
            axes.annotate(
                over + words,
                (100.0 * left, row),
                xytext=(-4 if inside else 4, 0),
                textcoords="offset points",
                ha="right" if inside else "left",
                va="center",
                fontsize=LETTERS - 2,
            )
        axes.axvline(100.0 * ALLOWED, color="#888888", linewidth=0.8, linestyle="--")
        axes.set_yticks(range(len(names)), names[::-1])
        axes.set_ylim(-0.5, len(names) - 0.5)
        widest = max((result.error or 0.0) / (abs(result.value) or 1.0) for result in results.values())
        axes.set_xlim(0.0, 100.0 * min(MOST, max(1.3 * widest, 2.0 * ALLOWED)))
        legend(axes, [(drawn[part], WORDS[part]) for part in PARTS if part in drawn], columns=3)

    panel = Panel(bars, "± over the value [%], dashed: a tenth", 0.55 + 0.42 * len(names))
    return sheet([panel], title)
