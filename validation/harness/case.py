"""Cases of the report: what they are, what they hand in, and how to write one.

How to write a case
-------------------
A case is a module ``validation/PART/NAME.py`` that reads from top to bottom, and its name in `CASES`. Its docstring is
what the report prints above the numbers: the first line is the title, then what is computed, the source with its DOI
(``doi:10.1000/182`` becomes a link), and the closed form or independent method. Paragraphs are separated by empty
lines; a paragraph whose lines are indented by four is set as it stands (formulas); one that begins with ``- `` is a
list; ``code`` between double backticks. The module has one function ``case(quick)`` that returns a `Case`::

    def case(quick):
        solution = refweb.run(scene(links=20 if quick else 100))
        sag = solution.results["deflection"]
        return Case(
            rows=[
                Row("sag", sag.value, 0.7812, "closed form", 1e-9, "residual 1e-10 of the weight", "m", sag.error),
                Row("sag", sag.value, "0.78", "Author 1962, table 1", unit="m"),  # as printed: agrees in every digit
                Row("order", slope([20, 40], errors), -2, "theory", 0.05, "the next term is (1/20)²", scale=1),
            ],
            verdicts=[Verdict("the paper's claim", "holds", "by 12.3 %, at every load", checked=12.3 > 0)],
            figures=[Figure("What is seen, with units.", lambda: drawing(solution))],
            tables=[Table("Open parameters", ["name", "value", "why"], [["η", "1e-5", "floor below 1 %"]])],
        )

- ``quick`` asks for the same assertions on smaller or fewer scenes: seconds, not minutes.
- Figures are drawn only for the report, so ``draw`` is a function without arguments; it returns a
  `matplotlib.figure.Figure`, see `validation.harness.plots`, whose ``picture`` draws a solution as ``refweb picture``
  does.
- A reference never comes from the code under test, and a tolerance says where it comes from.
- There is no empty cell: what is unknown is said to be unknown.
"""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

CASES = {
    "paper": (
        "cable_law",
        "example_1",
        "example_2",
        "example_3",
        "length_area",
        "webs_under_load",
        "webs_hit",
        "figures_with_a_limit",
        "open_parameters",
    ),
    "statics": (
        "two_links",
        "three_cables",
        "hanging_chain",
        "elastic_catenary",
        "isolated_cable",
        "lattice_green",
        "conic_programming",
        "hanging_platform",
        "clamps_and_forms",
        "changed_lines",
    ),
    "dynamics": (
        "transverse_impact",
        "pulled_end",
        "slack_tether",
        "mass_on_arms",
        "falling_chain",
        "spinning_arm",
        "orbit",
        "rupture",
        "frequencies",
        "free_net",
        "tumbling",
        "winches",
        "materials",
        "threads",
        "feedback",
        "drawstrings",
        "drag_and_link",
    ),
    "missions": (
        "published_throw",
        "falling_net",
        "spun_tight",
        "spin_deployment",
        "spin_up",
        "capture",
        "capture_satellite",
        "tethered_web",
        "capture_in_orbit",
        "four_satellites",
        "odds_of_capture",
    ),
    "methods": ("cross_validation", "coverage", "trust", "work_precision", "price_of_modelling"),
    "hard_cases": ("hard_cases",),
}
"""Parts of the report, each a folder, and the names of their cases, in the order of the report."""
VERDICTS = ("holds", "does not hold", "holds only when", "cannot be decided")


@dataclass(frozen=True)
class Row:
    """One number of refweb's beside a reference.

    Parameters
    ----------
    name : str
        What is compared.
    value : float
        refweb's.
    reference : float or str
        What it should be. A str is a published figure as printed: by default the value has to round to it.
    source : str
        Where the reference comes from.
    tolerance : float, optional
        Largest difference, relative to ``scale``; by default half a unit of the last printed digit.
    reason : str
        Why that much.
    unit : str
        Unit of value and reference.
    error : float, optional
        The ± that refweb gives with its value; it has to cover the difference only where ``covered`` says so.
    scale : float, optional
        What the difference is relative to, by default |reference|.
    covered : bool
        Whether ± has to cover the difference as well.
    """

    name: str
    value: float
    reference: float | str
    source: str
    tolerance: float | None = None
    reason: str = "half a unit of the last printed digit"
    unit: str = "1"
    error: float | None = None
    scale: float | None = None
    covered: bool = False

    def __post_init__(self):
        printed = isinstance(self.reference, str)
        scale = abs(float(self.reference)) if self.scale is None else self.scale
        if not scale > 0:
            raise ValueError(f"{self.name}: scale = {scale} must be > 0; give one where the reference is 0")
        if self.tolerance is None and not printed:
            raise ValueError(f"{self.name}: tolerance is missing; only a printed figure brings its own")
        if not (self.name and self.source and self.reason and self.unit):
            raise ValueError(f"{self.name}: name, source, reason and unit must not be empty")
        object.__setattr__(self, "scale", scale)
        if self.tolerance is None:
            digits = len(self.reference.partition(".")[2])
            # A value on the very edge rounds either way: 1e-9 of a unit is left for binary fractions.
            object.__setattr__(self, "tolerance", 0.5 * (1 + 1e-9) * 10.0**-digits / scale)

    @property
    def difference(self):
        """|value − reference| relative to ``scale`` [1]."""
        return abs(self.value - float(self.reference)) / self.scale

    @property
    def passes(self):
        """Whether the difference is within the tolerance, and ± where that is asked; never for what is no number."""
        covered = not self.covered or (self.error is not None and self.difference * self.scale <= self.error)
        return bool(self.difference <= self.tolerance) and covered


@dataclass(frozen=True)
class Verdict:
    """A claim in its author's words, what becomes of it, and why, with numbers.

    ``checked`` is the condition on computed numbers that the verdict rests on: where it is false, the verdict is no
    longer true of refweb's results, and the case fails.
    """

    claim: str
    verdict: str
    because: str
    checked: bool

    def __post_init__(self):
        if self.verdict not in VERDICTS:
            raise ValueError(f"verdict = {self.verdict!r} must be one of {VERDICTS}")
        if not (self.claim and self.because):
            raise ValueError("a verdict has a claim and a reason")


@dataclass(frozen=True)
class Figure:
    """A picture and the words below it; ``draw`` gives a matplotlib Figure."""

    caption: str
    draw: Callable


@dataclass(frozen=True)
class Table:
    """A table of text, for what is no comparison of two numbers."""

    title: str
    columns: list
    rows: list

    def __post_init__(self):
        for row in self.rows:
            if len(row) != len(self.columns) or not all(str(cell).strip() for cell in row):
                raise ValueError(f"{self.title}: row {row} must have {len(self.columns)} cells, none of them empty")


@dataclass(frozen=True)
class Case:
    """What a case hands to the report; ``failure`` says why it has nothing to hand."""

    rows: list = field(default_factory=list)
    verdicts: list = field(default_factory=list)
    figures: list = field(default_factory=list)
    tables: list = field(default_factory=list)
    failure: str = ""

    @property
    def failures(self):
        """What fails, a list of text."""
        found = [self.failure] if self.failure else []
        if not self.rows and not self.verdicts and not self.failure:
            found.append("the case asserts nothing")
        found += [
            f"{row.name}: {row.value:.10g} for {row.reference} {row.unit}, "
            f"difference {row.difference:.2e}, tolerance {row.tolerance:.2e}"
            for row in self.rows
            if not row.passes
        ]
        return found + [f"{v.claim}: no longer {v.verdict}" for v in self.verdicts if not v.checked]


def names():
    """Names of all cases, in the order of the report."""
    return [name for part in CASES.values() for name in part]


def module(name):
    """The module of a case."""
    part = next(part for part, names in CASES.items() if name in names)
    return importlib.import_module(f"validation.{part}.{name}")


def text(name):
    """Title and description of a case, from its docstring."""
    title, _, body = inspect.cleandoc(module(name).__doc__).partition("\n")
    return title.rstrip("."), re.sub(r"^\n+", "", body)


def run(name, quick=False):
    """The `Case` of a name."""
    return module(name).case(quick)


def slope(sizes, errors):
    """Order of convergence: slope of log(errors) over log(sizes), by least squares."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
