"""Which of the paper's figures 16 to 18 have a limit.

The paper computes impacts with "truss element with the size equal to the mesh", one element per line, and prints
numbers of that (*Dynamic modelling and analysis of space webs*, section 3.3). Some numbers stay when every line is cut
into more elements and when the contact of ball and web is made stiffer. They belong to the webs. Others change each
time: they belong to the mesh, and another mesh of the same web has others.

Here the three webs of ``triangle-impact``, ``square-impact`` and ``hexagon-impact`` are hit by a ball of 1 kg at 1 m/s,
and by one of 0.1 kg at 10 m/s, which has the same momentum, 1 kg m/s, and is the ball with which the stresses of figure
17 cross, see [the webs hit](#webs_hit). Lines have 1, 2, 4 and 8 elements, and contact has the stiffness of the scenes
and 16 times that. What a quantity converges to is its value at the most elements. Its ± is the sum of three changes:

- elements: the last change, or half of the change before where that is larger, for the last two may agree by chance;
- stiffness of contact: the change at 16 times the stiffness, with lines in 4 elements;
- time steps: the spread of three runs with lines in 4 elements and steps of 1, 0.7 and 0.5 times the length.

A quantity with ± of at most a tenth of it is called determined, as ``refweb trust`` does. It has no limit where 16 times
the stiffness makes it more than twice as large however fine the lines are: a rigid ball that meets the mass m of a node
at the speed v needs the force

    F = v √(k m)

to take it along, with the stiffness k of contact. This grows fourfold with 16 times the stiffness, and with finer
elements it falls, until what the web makes of the impact is larger.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict
from .three_webs import WEBS
from .webs_hit import HEAVY, LIGHT, STIFFNESS
from .webs_hit import scene as of_momentum

FORCE = dict(quantity="reaction", body="ball", reduce="max")
STRESS = dict(quantity="stress", reduce="max")
OBSERVE = [
    refweb.Observe(name="deflection", quantity="displacement", reduce="max"),
    refweb.Observe(name="stress", **STRESS),
    refweb.Observe(name="mean_stress", average=1e-2, **STRESS),
    refweb.Observe(name="force", **FORCE),
    refweb.Observe(name="mean_force", average=1e-2, **FORCE),
    refweb.Observe(name="speed", quantity="velocity", body="ball", component="z"),
]
QUANTITIES = {
    "deflection": ("largest deflection", "mm", 1e3, 2),
    "stress": ("largest stress of an instant", "kPa", 1e-3, 0),
    "mean_stress": ("largest mean stress over 10 ms", "kPa", 1e-3, 0),
    "force": ("largest contact force of an instant", "N", 1.0, 1),
    "mean_force": ("largest mean force over 10 ms", "N", 1.0, 2),
    "speed": ("speed of the ball at the end", "m/s", 1.0, 3),
}
"""Words, unit, factor to that unit, and decimals."""
STIFFER, SHORTER = 16.0, (0.7, 0.5)
ALLOWED, GROWN = 0.1, 2.0
"""± over the value up to which it is determined, and growth with the stiffness from which on it has no limit."""
DETERMINED, OPEN, NO_LIMIT = "determined", "not within a tenth", "no limit"


def impact(mesh, mass, elements=1, stiffness=1.0, steps=1.0, duration=None):
    """Results of a web hit by a ball of 1 kg m/s; the shipped scene where the ball has 1 kg."""
    scene = refweb.Scene.load(f"{mesh}-impact") if mass == HEAVY else of_momentum(mesh, 1.0, mass)
    scene = scene.with_stiffness({"ball": stiffness * STIFFNESS}).replace(chosen=())
    solve = replace(
        scene.solve, duration=duration or scene.solve.duration, safety=steps * scene.solve.safety
    )
    solution = refweb.run(
        scene.replace(
            observe=OBSERVE,
            cable=replace(scene.cable, subdivide=elements),
            solve=solve,
            accuracy=refweb.Accuracy(error="none"),
        ),
        progress=False,
    )
    return {name: result.value for name, result in solution.results.items()}


@dataclass(frozen=True)
class Found:
    """One quantity of one impact.

    Attributes
    ----------
    values : list of float
        At more and more elements per line.
    stiff : list of (float, float)
        At the stiffness of the scene and at `STIFFER` times it, for lines in one element and in several.
    time : float
        What time steps leave open.
    """

    values: list
    stiff: list
    time: float

    @property
    def elements(self):
        """What elements leave open."""
        steps = np.abs(np.diff(self.values))
        return float(max(steps[-1], 0.5 * steps[-2] if len(steps) > 1 else 0.0))

    @property
    def stiffness(self):
        """What the stiffness of contact leaves open."""
        return abs(self.stiff[-1][1] - self.stiff[-1][0])

    @property
    def error(self):
        return self.elements + self.stiffness + self.time

    @property
    def limit(self):
        """The value at the most elements."""
        return self.values[-1]

    @property
    def growths(self):
        """Ratios of the values at `STIFFER` times the stiffness to those at that of the scene."""
        return [stiffer / given for given, stiffer in self.stiff]

    @property
    def verdict(self):
        if min(self.growths) > GROWN:
            return NO_LIMIT
        return DETERMINED if self.error <= ALLOWED * abs(self.limit) else OPEN


def found(mesh, mass, counts, duration=None):
    """`Found` by quantity of one impact, with lines in so many elements."""
    middle = counts[-2] if len(counts) > 2 else counts[0]
    runs = {n: impact(mesh, mass, n, duration=duration) for n in counts}
    stiff = {n: impact(mesh, mass, n, STIFFER, duration=duration) for n in sorted({counts[0], middle})}
    shorter = [runs[middle], *(impact(mesh, mass, middle, steps=steps, duration=duration) for steps in SHORTER)]
    return {
        name: Found(
            [runs[n][name] for n in counts],
            [(runs[n][name], one[name]) for n, one in stiff.items()],
            float(np.ptp([one[name] for one in shorter])),
        )
        for name in QUANTITIES
    }


def written(name, one):
    """Limit and ± as text, without unit."""
    _, _, factor, decimals = QUANTITIES[name]
    return f"{factor * one.limit:.{decimals}f} ± {factor * one.error:.{decimals}f}"


def of_webs(impacts, mass, name):
    """Limits of the webs as text, with their unit."""
    values = [f"{written(name, one[name])} ({mesh})" for (mesh, m), one in impacts.items() if m == mass]
    return ", ".join(values) + f" {QUANTITIES[name][1]}"


def apart(impacts, mass, name):
    """Whether the webs' limits follow each other, in the order of `WEBS`, by more than their ±, up or down."""
    of = [one[name] for (_, m), one in impacts.items() if m == mass]
    steps = [(b.limit - a.limit, a.error + b.error) for a, b in zip(of, of[1:], strict=False)]
    return all(step > error for step, error in steps) or all(-step > error for step, error in steps)


def case(quick):
    webs, masses, counts = (WEBS[:1], (HEAVY,), (1, 2)) if quick else (WEBS, (HEAVY, LIGHT), (1, 2, 4, 8))
    duration = 0.06 if quick else None
    impacts = {(mesh, mass): found(mesh, mass, counts, duration) for mass in masses for mesh in webs}
    return Case(
        rows=_rows(impacts, counts),
        verdicts=_verdicts(impacts, masses),
        tables=_tables(impacts, counts),
        figures=[
            Figure(
                "Each quantity over its value at the most elements; a flat curve has a limit.",
                functools.partial(_curves, impacts, counts),
            )
        ],
    )


def _rows(impacts, counts):
    rows, most = [], counts[-1]
    for (mesh, mass), one in impacts.items():
        text, deflection, speed = f"{mesh}, {mass:g} kg", one["deflection"], one["speed"]
        rows += [
            Row(
                f"{text}: largest deflection, one element per line",
                deflection.values[0],
                deflection.limit,
                f"{most} elements per line",
                ALLOWED,
                "determined is what is off by a tenth at most",
                "m",
                deflection.error,
            ),
            Row(
                f"{text}: speed of the ball at the end, one element per line",
                speed.values[0],
                speed.limit,
                f"{most} elements per line",
                ALLOWED,
                "determined is what is off by a tenth at most",
                "m/s",
                speed.error,
            ),
            Row(
                f"{text}: contact force with {STIFFER:g} times the stiffness over that as given, one element per line",
                one["force"].growths[0],
                STIFFER**0.5,
                "F = v √(k m)",
                0.15,
                "nodes that are touched later move already",
            ),
        ]
    return rows


def _tables(impacts, counts):
    middle = counts[-2] if len(counts) > 2 else counts[0]
    lines = []
    for (mesh, mass), one in impacts.items():
        for name, (words, unit, factor, decimals) in QUANTITIES.items():
            quantity = one[name]
            cells = [f"{factor * value:.{decimals}f}" for value in (*quantity.values, quantity.stiff[-1][1])]
            parts = [f"{factor * x:.2g}" for x in (quantity.elements, quantity.stiffness, quantity.time)]
            verdict = quantity.verdict
            limit = "none" if verdict == NO_LIMIT else written(name, quantity)
            lines.append([f"{mesh}, {mass:g} kg", f"{words} [{unit}]", *cells, " + ".join(parts), limit, verdict])
    columns = ["impact", "quantity", *(f"{n} per line" for n in counts), f"{STIFFER:g} × stiffness, {middle} per line"]
    columns += ["± of elements + stiffness + time steps", "limit", "verdict"]
    yield_ = [Table("What the quantities converge to", columns, lines)]
    return yield_ + [_by_figure(impacts)]


def _curves(impacts, counts):
    masses = list(dict.fromkeys(mass for _, mass in impacts))
    page, plot = plots.axes("", ["value over that at the most elements"] + [""] * (len(masses) - 1), len(masses), 3.4)
    plot = np.atleast_1d(plot)
    for ax, mass in zip(plot, masses, strict=True):
        for (name, (words, *_)), colour in zip(QUANTITIES.items(), plots.COLOURS, strict=False):
            for mesh, style in zip(WEBS, ("-", "--", ":"), strict=True):
                if (mesh, mass) in impacts:
                    values = np.array(impacts[mesh, mass][name].values)
                    ax.plot(counts, values / values[-1], style, color=colour, label=words if mesh == WEBS[0] else None)
        ax.set_xscale("log", base=2)
        ax.set_xticks(counts, [str(n) for n in counts])
        ax.set_title(f"{mass:g} kg", fontsize="medium")
    page.supxlabel("elements per line (triangle solid, square dashed, hexagon dotted)", fontsize="medium")
    page.legend(*plot[0].get_legend_handles_labels(), frameon=False, loc="outside upper center", ncols=3)
    return page
