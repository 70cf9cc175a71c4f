"""A published fall of a net: what steps of implicit Euler cost.

The net of github.com weicheng-huang-mechanics/DDG_Tutorial, rod_network/case_1: 91 knots of a triangular lattice of
0.2 m in five rings about a centre, 180 lines in four elements each (EA 314.159 N, 1000 kg/m³, radius 0.01 m, no
bending), six corners held, g 50 m/s², velocities that fade by 0.1/s, flat and at rest at the start; ``refweb run
falling-net`` is the scene. Its centre falls through, and swings back. By implicit Euler with steps of 0.01 s the
published program comes to −0.66053 m; the same equations solved independently with 0.005 and 0.001 s give −0.69963 and
−0.74394 m.

Implicit Euler,

    x' = x + h v',        M v' = M v + h f(x', v'),

is of order 1 and takes energy out of whatever moves. It is solved here once more, by Newton's method with a tangent of
our own, and so is the limit of no step at all, by DOP853 with the same forces.
"""

import numpy as np
import scipy.sparse as sparse
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import splu

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, Table, Verdict

STIFFNESS, WEIGHT, RATE, END = 314.159, 50.0, 0.1, 0.3
"""EA [N], g [m/s²], rate [1/s], and a time behind the lowest point [s]."""
PUBLISHED = {0.01: -0.66053, 0.005: -0.69963, 0.001: -0.74394}
"""Lowest place of the centre [m] by step [s]."""


class Net:
    """Masses and springs of the net, by our own formulas.

    Parameters
    ----------
    web : refweb.Web
        Its knots and lines; each is cut in four.
    """

    def __init__(self, web):
        points, self.cells = list(web.points), []
        for i, j in web.lines:
            ends = [i, *range(len(points), len(points) + 3), j]
            points += [web.points[i] + share * (web.points[j] - web.points[i]) for share in (0.25, 0.5, 0.75)]
            self.cells += list(zip(ends[:-1], ends[1:], strict=True))
        self.points, self.cells = np.array(points), np.array(self.cells)
        self.mass = np.bincount(self.cells.ravel()) * 0.5 * 1000.0 * 3.14159e-4 * 0.05
        far = np.linalg.norm(web.points, axis=1)
        self.free = np.ones(self.points.size, dtype=bool).reshape(-1, 3)
        self.free[np.flatnonzero(far > far.max() - 1e-6)] = False  # a corner is 1 m from the centre, others are less

    def force(self, x, v):
        """Forces on all nodes [N]."""
        d = np.diff(x[self.cells], axis=1)[:, 0]
        length = np.linalg.norm(d, axis=1)
        pull = (STIFFNESS * (length / 0.05 - 1.0) / length)[:, None] * d
        force = -RATE * self.mass[:, None] * v - self.mass[:, None] * [0.0, 0.0, WEIGHT]
        np.add.at(force, self.cells[:, 0], pull)
        np.add.at(force, self.cells[:, 1], -pull)
        return force

    def tangent(self, x):
        """−∂f/∂x of the springs, of the free unknowns."""
        d = np.diff(x[self.cells], axis=1)[:, 0]
        length = np.linalg.norm(d, axis=1)[:, None, None]
        along = d[:, :, None] * d[:, None, :] / length**2
        block = STIFFNESS / 0.05 * along + STIFFNESS * (1.0 / 0.05 - 1.0 / length) * (np.eye(3) - along)
        block = np.block([[block, -block], [-block, block]])
        rows = (3 * self.cells[:, :, None] + np.arange(3)).reshape(-1, 6)
        shape = np.repeat(rows[:, :, None], 6, axis=2), np.repeat(rows[:, None, :], 6, axis=1)
        whole = sparse.csr_array((block.ravel(), (shape[0].ravel(), shape[1].ravel())), shape=2 * (self.points.size,))
        return whole[self.free.ravel()][:, self.free.ravel()]

    def euler(self, step):
        """Height of the centre after each step of implicit Euler [m]."""
        x, v, heights = self.points.copy(), np.zeros_like(self.points), [0.0]
        mass = np.repeat(self.mass, 3)[self.free.ravel()]
        for _ in range(round(END / step)):
            y = x + step * v
            for _ in range(50):
                speed = (y - x) / step
                left = (self.mass[:, None] * (speed - v) / step - self.force(y, speed))[self.free]
                if np.abs(left).max() < 1e-10 * self.mass.sum() * WEIGHT:
                    break
                matrix = sparse.diags_array(mass * (1.0 / step**2 + RATE / step)) + self.tangent(y)
                y[self.free] -= splu(matrix.tocsc()).solve(left)
            x, v = y, (y - x) / step
            heights.append(x[0, 2])
        return np.array(heights)

    def lowest(self):
        """Height of the centre at its lowest, by DOP853 [m]."""
        count = int(self.free.sum())

        def rates(t, y):
            x, v = self.points.copy(), np.zeros_like(self.points)
            x[self.free] += y[:count]
            v[self.free] = y[count:]
            return np.concatenate([y[count:], (self.force(x, v) / self.mass[:, None])[self.free]])

        def rising(t, y):
            return y[count + 2]

        rising.terminal, rising.direction = True, 1.0
        done = solve_ivp(rates, (0.0, END), np.zeros(2 * count), "DOP853", events=[rising], rtol=1e-11, atol=1e-13)
        return float(done.y_events[0][0][2])


def case(quick):
    scene = refweb.Scene.load("falling-net")
    net = Net(scene.build().net.web)
    solution = refweb.run(scene.replace(solve=refweb.Dynamic(duration=END)))
    finer = refweb.run(scene.replace(solve=refweb.Dynamic(duration=END, method="cvode", rtol=1e-5 if quick else 1e-7)))
    lowest, close = solution.results["lowest"], finer.results["lowest"]
    steps = (0.01,) if quick else tuple(PUBLISHED)
    heights = {step: net.euler(step) for step in steps}
    limit = net.lowest()
    source, reason = "DOP853, forces of our own", "its rtol"
    close_to = "the last printed digit, cut or rounded"
    rows = [
        Row(f"implicit Euler, {h:g} s", heights[h].min(), PUBLISHED[h], "published", 1.5e-5, close_to, "m")
        for h in steps
    ]
    rows += [
        Row("lowest, CVODE", close.value, limit, source, 1e-4, reason, "m", close.error, covered=True),
        Row("lowest, steps", lowest.value, limit, source, 1e-3, "order 2", "m", lowest.error, covered=True),
    ]
    off = {step: found.min() / limit - 1.0 for step, found in heights.items()}
    words = ", ".join(f"{abs(share):.1%} with steps of {step:g} s" for step, share in off.items())
    verdict = Verdict(
        "The net falls to −0.66053 m.",
        "does not hold",
        f"it falls to {close.value:.6f} ± {close.error:.1e} m; implicit Euler falls short of that by {words}",
        off[0.01] < -0.1 and close.error < 1e-4,
    )
    table = Table(
        "What the step costs in accuracy",
        ["method", "step [s]", "lowest [m]", "off"],
        [["implicit Euler", f"{h:g}", f"{heights[h].min():.5f}", f"{-share:.1%}"] for h, share in off.items()]
        + [
            [
                name,
                f"{END / one.solver['nsteps']:.2g}",
                f"{r.value:.6f} ± {r.error:.1e}",
                f"{abs(r.value / limit - 1):.1e}",
            ]
            for name, one, r in (("central differences", solution, lowest), ("CVODE, mean step", finer, close))
        ],
    )

    def drawn():
        page, axes = plots.axes("t [s]", "height of the centre [m]")
        for step, found in heights.items():
            axes.plot(step * np.arange(len(found)), found, ":", label=f"implicit Euler, {step:g} s")
        height = [state.position[0, 2] for _, state in solution.frames]
        axes.plot([state.time for _, state in solution.frames], height, "o", color=plots.COLOURS[0], label="refweb")
        axes.axhline(limit, **plots.REFERENCE)
        axes.legend(frameon=False, fontsize="small")
        return page

    figures = [
        Figure("Height of the centre, and the lowest by DOP853.", drawn),
        Figure(f"The net at {END} s.", lambda: plots.picture(solution, "strain")),
    ]
    return Case(rows=rows, verdicts=[verdict], figures=figures, tables=[table])
