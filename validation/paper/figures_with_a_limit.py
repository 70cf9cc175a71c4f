"""Which of the paper's figures 16 to 18 have a limit.

The paper computes impacts with "truss element with the size equal to the mesh", one element per line, and prints
numbers of that (*Dynamic modelling and analysis of space webs*, section 3.3). Some numbers stay when every line is cut
into more elements and when the contact of ball and web is made stiffer. They belong to the webs. Others change each
time: they belong to the mesh, and another mesh of the same web has others.

Here the three webs of ``triangle-impact``, ``square-impact`` and ``hexagon-impact`` are hit by a ball of 1 kg at 1 m/s,
and by one of 0.1 kg at 10 m/s, which has the same momentum, 1 kg m/s. With the light ball the stresses of figure 17
cross between 0.5 and 2 kg m/s, see [the webs hit](#webs_hit). Lines have 1, 2, 4 and 8 elements, and contact has the
stiffness of the scenes and 16 times that. What a quantity converges to is its value at the most elements. Its ± is the
sum of three changes:

- elements: the last change, or half of the change before where that is larger, for the last two may agree by chance;
- stiffness of contact: the change at 16 times the stiffness, with lines in 4 elements;
- time steps: the spread of three runs with lines in 4 elements and steps of 1, 0.7 and 0.5 times the length.

A quantity with ± of at most a tenth of it is called determined, as ``refweb trust`` does. It has no limit where 16
times the stiffness makes it more than twice as large, with one element per line and with four: a rigid ball that meets
the mass m of a node at the speed v needs the force

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
    solve = replace(scene.solve, duration=duration or scene.solve.duration, safety=steps * scene.solve.safety)
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
    return [_by_figure(impacts), Table("What the quantities converge to", columns, lines)]


SHOWN = {
    "figure 16: the deformed webs": "deflection",
    "figure 17: the largest stress": "stress",
    "figure 17, if it were a mean over 10 ms": "mean_stress",
    "figure 18: the vertical displacement": "deflection",
    "section 3.3.1: energy that stays in the web as oscillation": "speed",
    "in no figure: the contact force": "force",
    "in no figure: its mean over 10 ms": "mean_force",
}
"""What the paper shows, and the quantity that it hangs on."""


def _by_figure(impacts):
    """Table of what the figures show, and what that is a number of."""
    masses, lines = dict.fromkeys(mass for _, mass in impacts), []
    for shown, name in SHOWN.items():
        for mass in masses:
            verdicts = {mesh: one[name].verdict for (mesh, m), one in impacts.items() if m == mass}
            if set(verdicts.values()) == {DETERMINED}:
                said = "of the webs: determined"
            elif set(verdicts.values()) == {NO_LIMIT}:
                said = "of mesh and contact: no limit"
            else:
                said = "of the mesh as well: " + ", ".join(f"{verdict} ({mesh})" for mesh, verdict in verdicts.items())
            values = "none" if set(verdicts.values()) == {NO_LIMIT} else of_webs(impacts, mass, name)
            lines.append([shown, f"{mass:g} kg", values, said])
    return Table("The figures", ["what is shown", "ball", "limit", "it is a number ..."], lines)


def determined(impacts, mass, name):
    """True where the limit of all webs is determined."""
    return all(one[name].verdict == DETERMINED for (_, m), one in impacts.items() if m == mass)


def shares(impacts, mass, name):
    """± over the limits of the webs as text."""
    of = {mesh: one[name] for (mesh, m), one in impacts.items() if m == mass}
    return ", ".join(f"{100 * one.error / abs(one.limit):.0f} % ({mesh})" for mesh, one in of.items())


def _verdicts(impacts, masses):
    """Verdicts on the claims of the figures; those that compare balls where there are several."""
    every = list(impacts.values())
    deflections = "; ".join(f"{mass:g} kg: {of_webs(impacts, mass, 'deflection')}" for mass in masses)
    coarse = max(abs(one["deflection"].values[0] / one["deflection"].limit - 1.0) for one in every)
    force = [one["force"].values[0] / one["force"].limit for one in every]
    found = [
        Verdict(
            '"The vertical displacement of the contact point is different obviously" (figure 16), and figure 18, '
            '"vertical displacement of the webs under different impact momentums"',
            "holds",
            f"the largest deflection has a limit, and the webs' limits are further apart than their ±. {deflections}",
            all(determined(impacts, mass, "deflection") and apart(impacts, mass, "deflection") for mass in masses),
        ),
        Verdict(
            '"Truss element with the size equal to the mesh was adopted in the FE model in order to reduce the '
            'computational complexity" (section 4)',
            "holds only when",
            f"displacements are asked for: with one element per line they are at most {100 * coarse:.1f} % off. The "
            f"contact force of an instant is {min(force):.1f} to {max(force):.1f} times that at the most elements, and "
            "grows with the stiffness of contact: no mesh gives it",
            coarse < ALLOWED and all(one["force"].verdict == NO_LIMIT for one in every),
        ),
    ]
    if LIGHT not in masses:
        return found
    heavy, light = ({mesh: impacts[mesh, mass]["stress"] for mesh in WEBS} for mass in (HEAVY, LIGHT))
    between = {mass: of["square"].limit - of["triangle"].limit for mass, of in ((HEAVY, heavy), (LIGHT, light))}
    unsure = {mass: of["square"].error + of["triangle"].error for mass, of in ((HEAVY, heavy), (LIGHT, light))}
    first = light["square"].values[0] / light["triangle"].values[0]
    return [
        *found,
        Verdict(
            '"The max-stress in the impact process represents the capacity of the webs to decentralize impact load" '
            "(section 3.3.2, figure 17)",
            "holds only when",
            f"the ball is slow. Of 1 kg at 1 m/s ± of the largest stress is {shares(impacts, HEAVY, 'stress')} of it, "
            f"of 0.1 kg at 10 m/s {shares(impacts, LIGHT, 'stress')} of it: there it is a wave in the lines below the "
            "ball, which elements and contact shape as much as the web does",
            all(heavy[mesh].error / heavy[mesh].limit < light[mesh].error / light[mesh].limit for mesh in WEBS)
            and not determined(impacts, LIGHT, "stress"),
        ),
        Verdict(
            '"When the impact momentum increases, the max-stress in the square-mesh web becomes larger than that in '
            'the triangle-mesh web" (section 3.3.2, figure 17), in the limit of fine elements',
            "cannot be decided",
            f"of 1 kg the square web's stress is {-1e-3 * between[HEAVY]:.0f} ± {1e-3 * unsure[HEAVY]:.0f} kPa below "
            f"the triangle's. Of 0.1 kg it is {first:.2f} times the triangle's with one element per line, and the "
            f"limits differ by {1e-3 * between[LIGHT]:.0f} ± {1e-3 * unsure[LIGHT]:.0f} kPa",
            -between[HEAVY] > unsure[HEAVY] and abs(between[LIGHT]) < unsure[LIGHT],
        ),
    ]


def _curves(impacts, counts):
    masses = list(dict.fromkeys(mass for _, mass in impacts))
    page, plot = plots.axes("", ["value over that at the most elements"] + [""] * (len(masses) - 1), len(masses), 3.8)
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
    page.legend(*plot[0].get_legend_handles_labels(), frameon=False, loc="outside upper center", ncols=2)
    return page
