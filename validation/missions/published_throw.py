"""A published throw: which of its numbers are determined.

The net of the simulation github.com Yitao-LIN/Dynamical-simulation-of-tethered-net-capture-of-space-debris: 15 × 15
nodes, 424 lines of 0.25 m and 12566 N/m with dashpots of 0.2 N s/m, thrown by four masses of 0.3 kg from half its size;
``refweb run published-throw`` is the scene. Its Runge–Kutta method of order 4 at steps of 1e-4 s gives the momentum
2.078461 N s, a mouth of 3.135 m a side at 1 s, of 3.689 m at most, at 2.56 s, a largest tension of 12.5 N, and of
15.8 N with twice the step.

The motion is chaotic: lines snap taut by the hundred, and the smallest difference grows until no digit is left. So the
same equations are solved once more by a Runge–Kutta method of our own at several steps, and by refweb, which says how
long the motion is determined and what a number of runs from starts 1e-12 apart have in common. Dashpots of the
published net may push while a line is still stretched, those of refweb never do; ours does either.
"""

import numpy as np
from numba import njit

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict

MASSES = np.arange(225, 229)
STIFFNESS, DASHPOT = 12566.0, 0.2
SIDE, LARGEST, WHEN, TENSION, MOMENTUM = 3.135, 3.689, 2.56, 12.5, 2.078461
"""What is published: side of the mouth at 1 s, at most, and when; tension [N] and momentum [N s]."""


@njit
def accelerations(x, v, lines, mass, pushes, a):
    """Write those of all nodes; the largest tension [N]."""
    a[:] = 0.0
    most = 0.0
    for e in range(len(lines)):
        i, j = lines[e]
        d, u = x[j] - x[i], v[j] - v[i]
        length = np.sqrt((d * d).sum())
        if length > 0.25:
            pull = STIFFNESS * (length - 0.25) + DASHPOT * (d * u).sum() / length
            if pull > 0.0 or pushes:
                most = max(most, pull)
                a[i] += pull / length * d
                a[j] -= pull / length * d
    for n in range(len(mass)):
        a[n] /= mass[n]
    return most


@njit
def thrown(x, v, lines, mass, pushes, step, count):
    """Mean side of the mouth [m] and largest tension [N] at each step of the classical Runge–Kutta method."""
    found, a = np.zeros((count + 1, 2)), np.zeros_like(x)
    for n in range(count + 1):
        at, speed, way, gain = x, v, np.zeros_like(x), np.zeros_like(x)
        for stage in range(4):
            most = accelerations(at, speed, lines, mass, pushes, a)
            if stage == 0:
                found[n, 1] = most
                for k in range(4):
                    side = x[MASSES[k]] - x[MASSES[(k + 1) % 4]]
                    found[n, 0] += 0.25 * np.sqrt((side * side).sum())
            share = 1.0 if stage in (0, 3) else 2.0
            way, gain = way + share / 6.0 * speed, gain + share / 6.0 * a
            ahead = 0.5 * step if stage < 2 else step
            at, speed = x + ahead * speed, v + ahead * a
        x, v = x + step * way, v + step * gain
    return found


def own(scene, step, pushes, duration):
    """Times, and what `thrown` gives of the web of a scene."""
    web = scene.build().net.web
    mass = np.bincount(web.lines.ravel(), minlength=len(web.points)) * 0.5 * 0.784e-3
    mass[MASSES] = 0.3
    v = np.zeros_like(web.points)
    v[MASSES] = np.column_stack([0.70711 * np.sign(web.points[MASSES, :2]), np.full(4, 1.73205)])
    count = round(duration / step)
    return step * np.arange(count + 1), thrown(0.5 * web.points, v, web.lines, mass, pushes, step, count)


def case(quick):
    duration, runs = (1.05, 0) if quick else (3.0, 16)
    scene = refweb.Scene.load("published-throw").replace(
        solve=refweb.Dynamic(duration=duration), accuracy=refweb.Accuracy(horizon=not quick, ensemble=runs or None)
    )
    solution = refweb.run(scene)
    history, pull = solution.history, solution.results["max_tension"]
    side = 0.25 * history["mouth_perimeter"]
    at_one = float(np.interp(1.0, history["time"], side))
    theirs = {(step, pushes): own(scene, step, pushes, duration) for step in (1e-4, 2e-4) for pushes in (True, False)}
    mouths = {key: float(np.interp(1.0, times, rows[:, 0])) for key, (times, rows) in theirs.items()}
    sizes = {key: float(rows[:, 0].max()) for key, (times, rows) in theirs.items()}
    pulls = {key: float(rows[:, 1].max()) for key, (times, rows) in theirs.items()}
    reason = "published with six digits of the speed √3 m/s"
    rows = [
        Row("momentum", history["momentum_z"][-1], MOMENTUM, "published", 1e-6, reason, "N s"),
        Row("mass", scene.build().net.mass.sum(), 1.530848, "published", 1e-9, "rounding", "kg"),
        Row("side of the mouth at 1 s", at_one, SIDE, "published", 0.005, "two digits: their step", "m"),
        Row("our Runge–Kutta method: side at 1 s", mouths[1e-4, True], SIDE, "published", 0.005, "two digits", "m"),
        Row("refweb beside it, none pushes", at_one, mouths[1e-4, False], "Runge–Kutta", 0.005, "two digits", "m"),
    ]  # fmt: skip
    verdicts = [
        Verdict(
            "Momentum is kept.",
            "holds",
            f"to {abs(history['momentum_z'] / history['momentum_z'][0] - 1.0).max():.1e} over {duration:g} s, "
            f"the book of refweb to {solution.solver['momentum_drift']:.1e}",
            solution.solver["momentum_drift"] < 1e-12,
        ),
        Verdict(
            f"The largest tension is {TENSION} N.",
            "cannot be decided",
            f"the same method gives {pulls[1e-4, True]:.1f} N, and {pulls[2e-4, True]:.1f} N with twice the step; with "
            f"dashpots that never push {pulls[1e-4, False]:.1f} and {pulls[2e-4, False]:.1f} N; refweb says "
            f"{pull.value:.1f} ± {pull.error:.1f} N: no digit of it is determined",
            max(pulls.values()) > 1.1 * min(pulls.values()),
        ),
    ]
    table = Table(
        "What the step and pushing dashpots change, by the Runge–Kutta method",
        ["step [s]", "dashpots push", "side at 1 s [m]", "largest side [m]", "largest tension [N]"],
        [
            [f"{step:g}", "yes" if pushes else "no"]
            + [f"{own_of[step, pushes]:.{places}f}" for own_of, places in ((mouths, 4), (sizes, 3), (pulls, 1))]
            for step, pushes in theirs
        ],
    )
    if not quick:  # what some runs from starts 1e-12 apart have in common
        digits, ensemble = dict(solution.horizon["digits"]), solution.horizon["ensemble"]
        largest, tension = ensemble["mouth_perimeter"], ensemble["max_tension"]
        mean, deviation = 0.25 * largest["mean"], 0.25 * largest["deviation"]
        when = float(history["time"][side.argmax()])
        rows.append(
            Row("largest side, mean of the runs", mean, LARGEST, "published", 0.03, "two digits", "m", deviation)
        )
        verdicts.append(
            Verdict(
                f"The mouth is largest at {WHEN} s, with {LARGEST} m a side.",
                "holds only when",
                f"two digits are meant: {runs} runs have {mean:.3f} m with a standard deviation of {deviation:.3f} m, "
                f"and of the largest tension {tension['mean']:.1f} N and {tension['deviation']:.1f} N; "
                f"refweb's own is {0.25 * solution.results['mouth_perimeter'].value:.3f} ± "
                f"{0.25 * solution.results['mouth_perimeter'].error:.3f} m at {when:.2f} s; less than three digits of "
                f"displacements are left behind {digits[3]:.2f} s, less than two behind {digits[2]:.2f} s",
                abs(mean - LARGEST) < 0.1 and digits[2] is not None,
            )
        )

    def drawn():
        page, (left, right) = plots.axes("t [s]", ["side of the mouth [m]", "largest tension [N]"], columns=2)
        left.plot(history["time"], side, label="refweb")
        right.semilogy(history["time"][1:], np.maximum(history["max_tension"][1:], 1e-3), label="refweb", linewidth=0.8)
        for step in (1e-4, 2e-4):
            times, rows = theirs[step, True]
            left.plot(times[::100], rows[::100, 0], ":", label=f"Runge–Kutta, {step:g} s")
        left.plot([1.0, WHEN], [SIDE, LARGEST], "ko", markersize=4, label="published")
        left.legend(frameon=False, fontsize="small")
        return page

    caption = "Side of the mouth and largest tension over time."
    figures = [Figure(caption, drawn), Figure("The net at the end.", lambda: plots.picture(solution, "tension"))]
    return Case(rows=rows, verdicts=verdicts, figures=figures, tables=[table])
