"""A folded chain falls faster than freely.

A chain of length L hangs folded from two ends at one height and close together; one of them is let go. What has fallen
in comes to rest in the fold, and the end that falls is pulled down by the chain besides its weight. With energy kept,
the end at the depth x has the speed

    v² = 2 g x (1 − x/2L)/(1 − x/L)

(M. G. Calkin and R. H. March, Am. J. Phys. 57, 1989; C. W. Wong and K. Yasui, Am. J. Phys. 74, 2006,
doi:10.1119/1.2186686) and comes to the end of its fall after 0.8472 of the time √(2L/g) of a free fall. This is the
limit of a thin chain that does not stretch and whose strands touch. The chain of refweb has n links, its strands are
one link apart, and its waves run at c; under its weight it stretches by gL/c², 1e-5 or 1e-4. Its times are those of the
limit and a part of order 1/n: compared are the times extrapolated from two numbers of links, and that of the finest.
"""

import numpy as np
from scipy.integrate import quad

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Verdict

LENGTH, GRAVITY = 1.0, 9.81
FREE = np.sqrt(2 * LENGTH / GRAVITY)


def exact(x):
    """Time to the depth x of an end that falls with energy kept, over √(2L/g); by y² = x/L, without its root at 0."""
    return quad(lambda y: np.sqrt((1 - y * y) / (1 - y * y / 2)), 0, np.sqrt(x / LENGTH), epsabs=1e-13)[0]


def solved(links, sound):
    """The chain of an odd number of links: down, across by one link, and up again."""
    each, half = LENGTH / links, links // 2
    down = [[0.0, 0.0, -i * each] for i in range(half + 1)]
    points = down + [[each, 0.0, z] for _, _, z in reversed(down)]
    density, area = 1000.0, 1e-4
    scene = refweb.Scene(
        web=refweb.Inline(points=points, lines=[[i, i + 1] for i in range(links)], supports=[0]),
        cable=refweb.Cable(law="tension-only", modulus=density * sound**2, area=area, density=density),
        effects=[refweb.Gravity(acceleration=(0.0, 0.0, -GRAVITY))],
        solve=refweb.Dynamic(duration=0.9 * FREE),
        output=refweb.Output(interval=FREE / 4000, frames=400),
        accuracy=refweb.Accuracy(error="none"),
        observe=[refweb.Observe(name="height", quantity="position", node=links, component="z")],
    )
    return refweb.run(scene)


def times(solution):
    """Times to the depths 0.5 L and 0.9 L and to the deepest point, over √(2L/g)."""
    time, depth = solution.history["time"] / FREE, -solution.history["height"]
    last = np.argmax(depth)
    return np.array([*np.interp([0.5 * LENGTH, 0.9 * LENGTH], depth[:last], time[:last]), time[last]])


def case(quick):
    counts, sound = ((41, 81, 161), 300.0) if quick else ((41, 81, 161, 321, 481), 1000.0)
    solutions = [solved(count, sound) for count in counts]
    found = np.array([times(solution) for solution in solutions])
    limits = [exact(0.5 * LENGTH), exact(0.9 * LENGTH), exact(LENGTH)]
    share = counts[-1] / (counts[-1] - counts[-3])
    further = share * found[-1] + (1 - share) * found[-3]
    rows = []
    source, reason = "energy kept, closed form", "a part of order 1/n is left: 3/n"
    for name, limit, value in zip(("to 0.5 L", "to 0.9 L", "to the end"), limits, found[-1], strict=True):
        rows.append(Row(f"time {name}, {counts[-1]} links", value, limit, source, 3 / counts[-1], reason))
    reason = "half of the shortest chain's 1/n"
    for name, limit, value in zip(("to 0.5 L", "to 0.9 L", "to the end"), limits, further, strict=True):
        rows.append(Row(f"time {name}, extrapolated", value, limit, source, 0.5 / counts[-3], reason))
    verdict = Verdict(
        "A folded chain falls faster than freely.",
        "holds",
        f"at {found[-1, 2]:.3f} of the time of free fall with {counts[-1]} links, "
        f"{further[2]:.3f} in the limit, for 0.8472; energy is kept to {solutions[-1].solver['energy_drift']:.1e}",
        found[-1, 2] < 0.9,
    )

    def drawn():
        labels = ["x [m]", "time over √(2L/g)"], ["z [m]", "depth of the end over L"]
        page, (left, right) = plots.axes(*labels, columns=2)
        solution = solutions[min(2, len(counts) - 1)]
        for number, (_, state) in enumerate(solution.frames[:-1]):
            left.plot(0.08 * number + state.position[:, 0], state.position[:, 2], linewidth=0.9)
        left.set_aspect("equal")
        depth = np.linspace(0, 1, 200)
        right.plot([exact(x) for x in depth], depth, label="energy kept", **plots.REFERENCE)
        right.plot(np.sqrt(depth), depth, ":", color="#777777", label="free fall")
        for solution, count in zip(solutions, counts, strict=True):
            own = solution.history
            right.plot(own["time"][::40] / FREE, -own["height"][::40], ".", markersize=3, label=f"{count} links")
        right.set_ylim(0, 1.02)
        right.legend(frameon=False, fontsize="small")
        return page

    caption = "Left: the chain of 161 links, at every tenth of √(2L/g), side by side. Right: the depth of its end."
    return Case(rows=rows, verdicts=[verdict], figures=[Figure(caption, drawn)])
