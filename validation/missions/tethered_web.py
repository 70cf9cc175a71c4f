"""A web hangs on tethers between two satellites for one orbit.

A net of rectangular meshes, on parallel tethers between two long satellites that lie along the track, is let go at
rest, off the line to the Earth; ``refweb run tethered-web`` is the scene. Forces of the orbit are linear in the place,
and so there is a motion in which all lines stay straight,

    r = s e(θ) + y f(φ),        θ″ = −3 n² sin θ cos θ,        φ″ = 3 n² sin φ cos φ (A − B)/(A + B),

with e(θ) = (cos θ, sin θ) and f(φ) = (−sin φ, cos φ), s and y the place of a node in the net, A and B the moments of
the masses along and across the rungs: tethers swing about the line to the Earth, and rungs tip over. The lines of a cut
at s pull by Σ m s (θ′² + 2 n θ′ + 3 n² cos² θ), summed over what lies beyond. Stretch is neglected, a share of 1e-5;
θ and φ are integrated by DOP853.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Verdict

N, START = 1.1e-3, (0.3, 2e-5)
"""Mean motion [rad/s], θ and φ at the start [rad]."""
ALONG, ACROSS = np.array([-50.0, -20.0, -10.0, 0.0, 10.0, 20.0, 50.0]), np.array([-10.0, 0.0, 10.0])
"""Places s and y of the nodes [m]."""
MASS, SIZE = 100.0, (0.5, 21.0)
"""Mass [kg] of a satellite, its sizes across and along the rungs [m]."""
LINE, STIFFNESS = 1150.0 * 1e-6, 3e9 * 1e-6
"""Mass per length [kg/m] and EA [N] of a line."""


class Net(NamedTuple):
    """A net, its nodes by s and, for each of these, by y.

    Attributes
    ----------
    s, y, mass : ndarray, shape (nodes,)
        Places [m] and masses [kg] of nodes.
    lines : ndarray of int, shape (lines, 2)
        End nodes.
    tension : ndarray, shape (lines,)
        Tension at the start [N].
    """

    s: np.ndarray
    y: np.ndarray
    mass: np.ndarray
    lines: np.ndarray
    tension: np.ndarray


def net():
    """The net of the scene."""
    s, y = (side.ravel() for side in np.meshgrid(ALONG, ACROSS, indexing="ij"))
    number = np.arange(len(s)).reshape(len(ALONG), len(ACROSS))
    down = np.column_stack([number[:-1].ravel(), number[1:].ravel()])
    rungs = np.column_stack([number[1:-1, :-1].ravel(), number[1:-1, 1:].ravel()])
    lines = np.concatenate([down, rungs])
    length = np.hypot(*(side[lines[:, 1]] - side[lines[:, 0]] for side in (s, y)))
    mass = np.bincount(lines.ravel(), np.repeat(0.5 * LINE * length, 2))
    tension = np.zeros(len(lines))
    for n, (i, j) in enumerate(down):
        beyond = (y == y[i]) & ((s >= s[j]) if s[i] >= 0.0 else (s <= s[i]))
        pull = mass[beyond] @ abs(s[beyond]) + MASS / len(ACROSS) * ALONG[-1]
        tension[n] = 3.0 * N**2 * np.cos(START[0]) ** 2 * pull
    return Net(s, y, mass, lines, tension)


def place(net, swing, tip):
    """Positions of nodes by both angles, shape (nodes, 2) [m]."""
    e, f = np.array([np.cos(swing), np.sin(swing)]), np.array([-np.sin(tip), np.cos(tip)])
    return net.s[:, None] * e + net.y[:, None] * f


def share(net):
    """(A − B)/(A + B) of net and satellites."""
    across, along = (2.0 * MASS * size**2 / 12.0 for size in SIZE)
    along += net.mass @ net.y**2
    return (along - across) / (along + across)


def exact(net, times):
    """θ, φ and their rates at some times, shape (4, times)."""
    tips = share(net)

    def rates(_, state):
        swing, tip = state[:2]
        return [*state[2:], -1.5 * N**2 * np.sin(2.0 * swing), 1.5 * N**2 * np.sin(2.0 * tip) * tips]

    done = solve_ivp(rates, (0.0, times[-1]), [*START, 0.0, 0.0], "DOP853", t_eval=times, rtol=1e-12, atol=1e-16)
    return done.y


def cut(net, swing, rate):
    """Tension of all lines that cross the middle, above the nodes there [N]."""
    beyond = net.s > 0.0
    pull = net.mass[beyond] @ net.s[beyond] + MASS * ALONG[-1]
    return pull * (rate**2 + 2.0 * N * rate + 3.0 * N**2 * np.cos(swing) ** 2)


def case(quick):
    ours = net()
    values = {"solve.duration": 720.0} if quick else {}
    solution = refweb.run(refweb.Scene.load("tethered-web", values))
    times = np.array([state.time for _, state in solution.frames])
    theirs = exact(ours, times)
    apart, strained = [], []
    middle = np.flatnonzero((ours.s[ours.lines] == [0.0, 10.0]).all(axis=1))
    for (_, state), (swing, tip, rate, _) in zip(solution.frames, theirs.T, strict=True):
        off = state.position[: len(ours.s), :2] - place(ours, swing, tip)
        apart.append(np.linalg.norm(off, axis=1).max())
        strained.append(abs(state.tension[middle].sum() / cut(ours, swing, rate) - 1.0))
    end, tip = times[-1], solution.results["tip"]
    why = "stretch, 1e-5"
    rows = [
        Row("largest distance of a node from its place", max(apart), 0.0, "exact motion", 2e-5, why, "m", scale=50.0),
        Row("rungs have tipped over by", tip.value, theirs[1, -1] - START[1], "exact motion", 2e-5, why, "rad",
            tip.error),
        Row("tension of the middle's lines, largest difference", max(strained), 0.0, "exact motion", 2e-3,
            "lines swing by the share that their masses change the stretch", scale=1.0),
        Row("momentum, drift", solution.solver["momentum_drift"], 0.0, "forces of the orbit", 1e-9, "rounding",
            scale=1.0),
    ]  # fmt: skip
    grown = np.cosh(np.sqrt(3.0 * share(ours)) * N * end)
    verdicts = [
        Verdict(
            "A net on parallel tethers stays open between its satellites.",
            "does not hold",
            f"gravity's gradient keeps tethers taut but has rungs along the track tip over, e-fold in "
            f"{1.0 / (np.sqrt(3.0) * N):.0f} s: {START[1]:g} rad becomes {tip.value + START[1]:.3g} rad in {end:.0f} s "
            f"(at small angles × {grown:.3g}), and no line of rectangular meshes stands against it",
            abs(tip.value) > 0.5 * START[1] * (grown - 1.0) if quick else tip.value > 0.3,
        ),
        Verdict(
            "Energy in axes that go round, the Jacobi integral, is kept.",
            "holds",
            f"to {solution.solver['energy_drift']:.1e} over {end / (2.0 * np.pi / N):.2f} orbits",
            solution.solver["energy_drift"] < 1e-6,
        ),
    ]

    def drawn():
        page, (left, right) = plots.axes(["t [s]", "y, along the track [m]"], ["angle [rad]", "x, from the Earth [m]"],
                                         columns=2)  # fmt: skip
        fine = np.linspace(0.0, end, 400)
        angles = exact(ours, fine)
        left.plot(fine, angles[0], label="swing θ", **plots.REFERENCE)
        left.plot(fine, angles[1], "--", label="rungs φ", **plots.REFERENCE)
        every = max(len(solution.history["time"]) // 24, 1)
        upper, lower = (int(np.flatnonzero((ours.s == s) & (ours.y == 0.0))[0]) for s in (50.0, -50.0))
        swing = [np.arctan2(*(one.position[upper] - one.position[lower])[[1, 0]]) for _, one in solution.frames]
        left.plot(solution.history["time"][::every], solution.history["tip"][::every], ".", label="refweb")
        left.plot(times, swing, ".", color=plots.COLOURS[0])
        left.legend(frameon=False, fontsize="small")
        for number, (_, state) in enumerate(solution.frames[:: max(len(solution.frames) // 4, 1)]):
            for i, j in ours.lines:
                right.plot(state.position[[i, j], 1], state.position[[i, j], 0], linewidth=0.8,
                           color=plots.COLOURS[number % len(plots.COLOURS)])  # fmt: skip
        right.set_aspect("equal")
        return page

    caption = "Left: both angles. Right: the web at several times of the orbit."
    figures = [Figure(caption, drawn), Figure("The web at the end.", lambda: plots.picture(solution, "tension"))]
    return Case(rows=rows, verdicts=verdicts, figures=figures)
