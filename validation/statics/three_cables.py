"""A load on three cables of which one goes slack.

A node hangs on three cables in a plane and carries 2 N downwards and a growing force H to the right. At first all three
are taut; under a larger H the right one is slack, and its tension is exactly zero from there on.

Independent method: with the set of taut cables given, two equations for the place of the node, solved in 30 digits; the
set is right where the tensions of those in it are positive and the others are shorter than their natural length. The
force at which the third goes slack is a third equation, |x − x₃| = L₃. The ± of a tension is refweb's own bound.
"""

import mpmath
import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row

ENDS = np.array([[-1.0, 1.0], [0.2, 1.0], [1.0, 0.8]])
"""Fixed ends (x, z) of the cables [m]; the node begins at the origin."""
NATURAL = np.array([1.35, 0.98, 1.26])
AXIAL, WEIGHT = 100.0, 2.0


def solved(forces):
    """Solution with a load step for each force to the right [N]."""
    weight = refweb.Load(node=0, force=(0.0, 0.0, -WEIGHT), factor=[(0.0, 1.0)])
    scene = refweb.Scene(
        web=refweb.Inline(
            points=[[0.0, 0.0, 0.0], *([x, 0.0, z] for x, z in ENDS)],
            lines=[[0, 1], [0, 2], [0, 3]],
            natural_length=list(NATURAL),
            supports=[1, 2, 3],
        ),
        cable=refweb.Cable(law="tension-only", modulus=AXIAL / 1e-4, area=1e-4, density=0.0),
        effects=[weight, refweb.Load(node=0, force=(1.0, 0.0, 0.0))],
        solve=refweb.Static(load_steps=list(forces)),
        observe=[refweb.Observe(name=f"T{i}", quantity="tension", line=i) for i in range(3)]
        + [refweb.Observe(name=axis, quantity="displacement", node=0, component=axis) for axis in "xz"],
    )
    return refweb.run(scene)


def pulls(x, z, taut):
    """Forces (x, z) and tensions of the cables of a set on a node at (x, z)."""
    out = []
    for i in taut:
        a, b = mpmath.mpf(ENDS[i, 0]) - x, mpmath.mpf(ENDS[i, 1]) - z
        length = mpmath.sqrt(a * a + b * b)
        tension = AXIAL * (length / mpmath.mpf(NATURAL[i]) - 1)
        out.append((tension * a / length, tension * b / length, tension))
    return out


def balance(x, z, force, taut):
    """What is left of the forces on the node."""
    found = pulls(x, z, taut)
    return [sum(p[0] for p in found) + force, sum(p[1] for p in found) - WEIGHT]


def exact(force):
    """Place (x, z) [m] and tensions [N] under a force to the right, and the taut cables."""
    with mpmath.workdps(30):
        for taut in ((0, 1, 2), (0, 1)):
            x, z = mpmath.findroot(lambda x, z, taut=taut: balance(x, z, mpmath.mpf(force), taut), (0.02, -0.02))
            tension = np.zeros(3)
            tension[list(taut)] = [p[2] for p in pulls(x, z, taut)]
            length = np.hypot(*(ENDS - [float(x), float(z)]).T)
            slack = [i for i in range(3) if i not in taut]
            if (tension[list(taut)] > 0).all() and (length[slack] <= NATURAL[slack]).all():
                return (float(x), float(z)), tension, taut
    raise AssertionError(f"no set of taut cables balances {force} N")


def limit():
    """Force at which the third cable goes slack [N]."""
    with mpmath.workdps(30):

        def miss(x, z, force):
            reach = mpmath.sqrt((ENDS[2, 0] - x) ** 2 + (ENDS[2, 1] - z) ** 2)
            return [*balance(x, z, force, (0, 1)), reach - mpmath.mpf(NATURAL[2])]

        return float(mpmath.findroot(miss, (0.02, -0.02, 1.0))[2])


def case(quick):
    critical = limit()
    forces = np.array([0.0, 0.999 * critical, 1.001 * critical, 1.1 * critical])
    steps = [step["results"] for step in solved(forces).steps]
    rows = []
    # Two taut cables at about 90° hold the node with EA/2L or more in any direction: 2e-10 N move it by 1e-11 m.
    moved, pulled = "a residual of 1e-10 of 2 N over a stiffness of EA/2L", "EA/L times the error of the place"
    for force, step in zip(forces, steps, strict=True):
        (x, z), tension, taut = exact(force)
        title = f"H = {force:.6g} N, {'three' if len(taut) == 3 else 'two'} taut"
        for axis, place in (("x", x), ("z", z)):
            value = step[axis].value
            rows.append(Row(f"{title}: {axis}", value, place, "two equations, 30 digits", 1e-11, moved, "m", scale=1))
        for i in range(3):
            found, exactly = step[f"T{i}"], tension[i] == 0.0
            tolerance, reason = (0.0, "a slack cable has none at all") if exactly else (1e-9, pulled)
            source = "slack" if exactly else "two equations, 30 digits"
            rows.append(
                Row(
                    f"{title}: T{i + 1}", found.value, tension[i], source, tolerance, reason, "N", found.error,
                    scale=WEIGHT, covered=True,
                )
            )  # fmt: skip

    def drawn():
        page, plot = plots.axes("force to the right H [N]", "tension T [N]")
        fine, some = np.linspace(0.0, 1.1 * critical, 81), np.linspace(0.0, 1.1 * critical, 13)
        plot.plot(fine, [exact(force)[1] for force in fine], **plots.REFERENCE)
        found = [[step["results"][f"T{i}"].value for i in range(3)] for step in solved(some).steps]
        for i, mark in enumerate("osD"):
            plot.plot(some, [tension[i] for tension in found], mark, label=f"cable {i + 1}", markersize=5)
        plot.axvline(critical, color="#888888", linestyle=":")
        plot.legend(frameon=False)
        return page

    caption = "Tensions of the three cables, refweb (markers) on the independent solution (lines); the third is slack "
    return Case(rows=rows, figures=[Figure(caption + "beyond the dotted line.", drawn)])
