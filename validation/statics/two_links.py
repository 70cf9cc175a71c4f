"""Two links under a load across them: flat, prestressed and slack.

Two links of 1 m between supports 2 m apart carry a force F at their joint, at right angles to them. By symmetry the
joint moves by h along the force, and balance is one equation, with the natural length L of a link and its length l:

    2 T h/l = F,    T = EA (l/L − 1),    l² = 1 + h²

- *Flat and without tension* (L = 1 m): the stiffness is zero at first, h → (F/EA)^(1/3) and T → (EA F²)^(1/3)/2 for
  small loads. A solver that starts from the flat shape meets a singular tangent.
- *Prestressed* (L = 0.99 m): h → F/(2 T0) for small loads.
- *Slack* (L = 1.01 m): a V that hangs without tension until its links are straight, h² → L² − 1 m².

The closed form is the equation, solved by bracketing with l − L = (1 + h² − L²)/(l + L), which loses no digits. The ±
of a tension is refweb's own proven bound, and has to cover the difference.
"""

import numpy as np
from scipy.optimize import brentq

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, slope

AXIAL = 100.0
"""EA [N]."""
NATURAL = {"flat": 1.0, "prestressed": 0.99, "slack": 1.01}
EPS = np.finfo(float).eps


def solved(natural, loads):
    """Solution with a load step for each load [N]."""
    scene = refweb.Scene(
        web=refweb.Inline(
            points=[[-1, 0, 0], [0, 0, 0], [1, 0, 0]],
            lines=[[0, 1], [1, 2]],
            natural_length=natural,
            supports=[0, 2],
        ),
        cable=refweb.Cable(law="tension-only", modulus=AXIAL / 1e-4, area=1e-4, density=0.0),
        effects=[refweb.Load(node=1, force=(0.0, 0.0, 1.0))],
        solve=refweb.Static(load_steps=list(loads)),
        observe=[
            refweb.Observe(name="h", quantity="displacement", node=1, component="z"),
            refweb.Observe(name="T", quantity="tension"),
        ],
    )
    return refweb.run(scene)


def exact(natural, load):
    """Closed form: h [m] and T [N]."""

    def tension(h):
        length = np.sqrt(1.0 + h * h)
        return AXIAL * (1.0 + h * h - natural**2) / (length + natural) / natural

    def mismatch(h):
        return 2.0 * tension(h) * h / np.sqrt(1.0 + h * h) - load

    least = np.sqrt(max(natural**2 - 1.0, 0.0))
    h = brentq(mismatch, least, least + 10.0, xtol=1e-300, rtol=4 * EPS, maxiter=1000)
    return h, tension(h)


def case(quick):
    loads = np.logspace(-6, 1, 8 if quick else 29)
    rows, found = [], {}
    for name, natural in NATURAL.items():
        steps = [step["results"] for step in solved(natural, loads).steps]
        found[name] = np.array([step["h"].value for step in steps]), np.array([step["T"].value for step in steps])
        for k in (0, -1):
            h, tension = exact(natural, loads[k])
            # F(h) is convex, so that h F' ≥ F: a force r left on the joint moves it by r h/F, and changes T by 2 r T/F.
            left = 1e-10 * max(tension, loads[k]) + 4 * EPS * AXIAL
            reason = "a residual of 1e-10 of the larger of F and T, and rounding of EA, over F"
            title = f"{name}, F = {loads[k]:g} N"
            rows.append(Row(f"{title}: h", steps[k]["h"].value, h, "closed form", left / loads[k], reason, "m"))
            here = steps[k]["T"]
            rows.append(
                Row(
                    f"{title}: T", here.value, tension, "closed form", 2 * left / loads[k], reason, "N", here.error,
                    covered=True,
                )
            )  # fmt: skip
    small = loads < 1e-3
    exponent = slope(loads[small], found["flat"][0][small])
    source = "closed form, limit of small loads"
    # The next term of h is of relative size h², 1e-4 at 1e-3 N.
    rows.append(Row("flat: exponent of h over F", exponent, 1 / 3, source, 1e-4, "next term h², 5e-4 at most", scale=1))
    exponent = slope(loads[small], found["flat"][1][small])
    rows.append(Row("flat: exponent of T over F", exponent, 2 / 3, source, 1e-4, "next term h², 5e-4 at most", scale=1))

    def drawn():
        page, (left, right) = plots.axes("load F [N]", ["deflection h [m]", "tension T [N]"], columns=2)
        fine = np.logspace(-6, 1, 200)
        for (name, natural), mark in zip(NATURAL.items(), "osD", strict=True):
            curve = np.array([exact(natural, load) for load in fine])
            for plot, k in ((left, 0), (right, 1)):
                plot.loglog(fine, curve[:, k], **plots.REFERENCE)
                plot.loglog(loads, found[name][k], mark, label=name, markersize=5)
        left.legend(frameon=False)
        return page

    caption = "Two links under a load: refweb (markers) on the closed form (lines), over seven decades of load."
    return Case(rows=rows, figures=[Figure(caption, drawn)])
