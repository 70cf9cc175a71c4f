"""Lines that break under a mass that is thrown: one, and three side by side, one after another taut.

A mass m hangs from a weightless line at rest and is thrown down at v. It leaves the line that breaks at the stress s
with v² − 2 W/m, W = s² A L/2E what the line held, when v/ω sin ωt is the stretch at which it breaks, ω² = EA/(m L).

Of three lines side by side each is longer than the one before it, and stronger. Between two moments at which one is
pulled taut or breaks, the mass swings about the place at which the pulls of the taut ones would balance; each swing
begins with place and speed of the end of the one before. The speed that is left tells the same by energy alone: half of
m (v² − w²) is the sum of what the lines held.
"""

import numpy as np

import refweb
from refweb.net.web import Web

from ..harness import plots
from ..harness.case import Case, Figure, Row

MODULUS, AREA, MASS, SPEED = 1e9, 1e-6, 1.0, 2.0
STIFF = MODULUS * AREA
"""Stiffness of a line of 1 m [N/m]."""
LENGTHS = (1.0, 1.02, 1.04)
STRENGTHS = (2e7, 3e7, 4e7)
"""Of the three lines, natural lengths [m] and strengths [Pa]."""
METHODS = {
    "central-difference": dict(method="central-difference", safety=0.1),
    "explicit": dict(method="explicit"),
    "cvode": dict(method="cvode"),
    "ida": dict(method="ida"),
}


def held(length, strength):
    """Energy of a line at its strength [J]."""
    return 0.5 * strength**2 / MODULUS * AREA * length


def cascade(lengths=LENGTHS, strengths=STRENGTHS):
    """Times of the breaks [s] in the order of the lines, and the speed that is left [m/s]."""
    lengths = np.array(lengths)
    stiffness, slack = STIFF / lengths, lengths - 1.0
    limits = lengths * (1.0 + np.array(strengths) / MODULUS) - 1.0
    moments = sorted([(slack[i], i, False) for i in range(len(slack))] + [(y, i, True) for i, y in enumerate(limits)])
    taut, place, speed, time, times = np.zeros(len(lengths), dtype=bool), 0.0, SPEED, 0.0, np.zeros(len(lengths))
    for until, line, breaks in moments:
        k = stiffness[taut].sum()
        if k == 0.0:
            time += (until - place) / speed
        else:
            middle, rate = (stiffness * slack)[taut].sum() / k, np.sqrt(k / MASS)
            size, phase = np.hypot(place - middle, speed / rate), np.arctan2(speed / rate, place - middle)
            later = np.arccos((until - middle) / size)
            time, speed = time + (phase - later) / rate, rate * size * np.sin(later)
        place, taut[line] = until, not breaks
        if breaks:
            times[line] = time
    return times, speed


def thrown(lengths, strengths, method="central-difference", duration=0.1):
    """The scene of a mass under lines of these natural lengths [m] and strengths [Pa]."""
    names = [f"line {i}" for i in range(len(lengths))]
    web = Web([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]], [[0, 1]] * len(names), lengths, rim=[0], groups=names)
    groups = {name: {"strength": strength} for name, strength in zip(names, strengths, strict=True)}
    return refweb.Scene(
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=MODULUS, area=AREA, density=0.0),
        effects=[
            refweb.PointMass(node=1, mass=MASS),
            refweb.Velocity(node=1, value=(0.0, 0.0, -SPEED)),
            refweb.Rupture(groups=groups),
        ],
        solve=refweb.Dynamic(duration=duration, **METHODS[method]),
        output=refweb.Output(interval=5e-4),
        observe=[
            refweb.Observe(name="speed", quantity="velocity", node=1, component="z", reduce="final"),
            refweb.Observe(name="held", quantity="rupture_energy", reduce="final"),
        ],
    )


def rows_of(name, method, lengths, strengths, solution):
    """Rows of one solution beside the closed form."""
    times, speed = cascade(lengths, strengths)
    found = solution.results["speed"]
    yield Row(
        f"{name}, speed left, {method}",
        -found.value,
        speed,
        "closed form",
        found.error / speed,
        "±",
        "m/s",
        found.error,
    )
    for n, (one, moment) in enumerate(zip(solution.breaks, times, strict=True), 1):
        label = f"{name}, break {n}, {method}" if len(times) > 1 else f"{name}, when it breaks, {method}"
        yield Row(label, one["time"], moment, "closed form", one["error"] / moment, "±", "s", one["error"])
    total = sum(held(*one) for one in zip(lengths, strengths, strict=True))
    value = solution.results["held"].value
    yield Row(f"{name}, energy booked, {method}", value, total, "s² A L/2E", 1e-8, "the moment is found to 1e-9", "J")


def case(quick):
    rows, shown = [], {}
    for method in METHODS:
        for name, lengths, strengths in (("one line", (1.0,), (5e7,)), ("three lines", LENGTHS, STRENGTHS)):
            solution = refweb.run(thrown(lengths, strengths, method))
            rows += rows_of(name, method, lengths, strengths, solution)
        shown[method] = solution

    def drawn():
        page, plot = plots.axes("time [s]", "speed of the mass [m/s]")
        for (method, solution), style in zip(shown.items(), ("-", "--", ":", "-."), strict=True):
            plot.plot(solution.history["time"], -solution.history["speed"], style, label=method)
        for moment in cascade()[0]:
            plot.axvline(moment, **plots.REFERENCE)
        plot.legend(frameon=False)
        return page

    caption = "A mass under three lines that are pulled taut and break one after another; closed form of the breaks "
    return Case(rows=rows, figures=[Figure(caption + "(black).", drawn)])
