"""Two masses on a slack tether, without and with damping.

Two masses drift apart with the relative speed u on a massless tether of natural length L that is slack at first. It
snaps taut when their distance is L, pulls them together as a spring k = EA/L on the reduced mass μ would, and lets go.
With ω = √(k/μ):

    taut for π/ω,    largest tension u √(k μ),    afterwards apart with −u

A Kelvin–Voigt tether, T = k (x + τ x') where that is positive, snaps with the jump T = k τ u and lets go when T = 0,
not when x = 0: a rope never pushes. With ζ = ωτ/2 < 1 this is an impact with the coefficient of restitution e,

    taut for t = (π − 2 arcsin ζ)/(ω √(1 − ζ²)),    e = exp(−ζωt),    distance then L + 2 ζ e u/ω

from the damped oscillator with these two ends. Central differences are of order 2; where a jump or a kink falls within
a step decides about the error as well, so that steps are divided by three, which leaves the snap in the middle of one.
"""

import numpy as np

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, slope

LENGTH, AXIAL, MASSES, SPEED = 1.0, 100.0, (1.0, 3.0), 2.0
REDUCED = MASSES[0] * MASSES[1] / sum(MASSES)
STIFFNESS = AXIAL / LENGTH
OMEGA = np.sqrt(STIFFNESS / REDUCED)
PERIOD = 2 * np.pi / OMEGA
SNAP = PERIOD / 8
"""Time at which the tether snaps [s]: with 36, 108, 324, ... steps to the period always the middle of a step."""


def solved(ratio, steps):
    """The masses with a damping ratio, in so many steps per natural period, to a while after the tether lets go."""
    damping = [refweb.Damping(time=2 * ratio / OMEGA)] if ratio else []
    # Velocities of a pair whose centre of mass rests.
    own = [-SPEED * MASSES[1] / sum(MASSES), SPEED * MASSES[0] / sum(MASSES)]
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [LENGTH - SPEED * SNAP, 0, 0]], lines=[[0, 1]], natural_length=LENGTH),
        cable=refweb.Cable(law="tension-only", modulus=AXIAL / 1e-4, area=1e-4, density=0.0),
        effects=[
            *[refweb.PointMass(node=i, mass=mass) for i, mass in enumerate(MASSES)],
            *[refweb.Velocity(node=i, value=(value, 0, 0)) for i, value in enumerate(own)],
            *damping,
        ],
        supports=refweb.Supports(nodes=[]),
        solve=refweb.Dynamic(duration=1.25 * PERIOD, step_size=PERIOD / steps * (1 + 1e-9)),
        output=refweb.Output(interval=PERIOD / 36),
        accuracy=refweb.Accuracy(error="none"),
        observe=[
            refweb.Observe(name="tension", quantity="tension", reduce="max"),
            *[refweb.Observe(name=f"x{i}", quantity="position", node=i, component="x") for i in (0, 1)],
            *[refweb.Observe(name=f"v{i}", quantity="velocity", node=i, component="x") for i in (0, 1)],
        ],
    )
    return refweb.run(scene)


def exact(ratio):
    """Time taut [s], largest tension [N] and coefficient of restitution."""
    root = np.sqrt(1 - ratio**2)
    taut = (np.pi - 2 * np.arcsin(ratio)) / (OMEGA * root)
    # T' = 0 at tan ωd t = √(1 − ζ²) (1 − 4ζ²)/(ζ (3 − 4ζ²)), for ζ < 1/2.
    summit = np.arctan2(root * (1 - 4 * ratio**2), ratio * (3 - 4 * ratio**2)) / (OMEGA * root)
    return taut, tension(summit, ratio), np.exp(-ratio * OMEGA * taut)


def tension(t, ratio):
    """Tension while the tether is taut, t after it snapped [N]."""
    root = np.sqrt(1 - ratio**2)
    phase, fall = OMEGA * root * t, np.exp(-ratio * OMEGA * t)
    x = SPEED / (OMEGA * root) * fall * np.sin(phase)
    v = SPEED * fall * (np.cos(phase) - ratio / root * np.sin(phase))
    return STIFFNESS * (x + 2 * ratio / OMEGA * v)


def case(quick):
    counts = 36 * 3 ** np.arange(3 if quick else 5)
    rows, history = [], {}
    for ratio in (0.0, 0.1, 0.3):
        taut, largest, restitution = exact(ratio)
        errors = []
        for count in counts:
            solution = solved(ratio, int(count))
            r, since = solution.results, solution.state.time - SNAP - taut
            speed = r["v1"].value - r["v0"].value
            distance = r["x1"].value - r["x0"].value
            should = LENGTH + 2 * ratio * restitution * SPEED / OMEGA - restitution * SPEED * since
            found = np.array([distance / LENGTH, -speed / SPEED, r["tension"].value / largest])
            errors.append(np.abs(found - [should / LENGTH, restitution, 1.0]))
        history[ratio] = solution.history
        errors, title = np.array(errors), f"ζ = {ratio:g}"
        within, reason = 6 / counts[-1] ** 2, "order 2: a peak seen at steps is (π/steps)²/2 low"
        names = ("distance over L", "restitution", "largest tension")
        references = (should / LENGTH, restitution, largest)
        for name, value, reference in zip(names, found * [1, 1, largest], references, strict=True):
            unit = "N" if name == "largest tension" else "1"
            rows.append(Row(f"{title}: {name}", value, reference, "closed form", within, reason, unit))
        order, reason = -slope(counts, errors[:, 0]), "where in its step the tether lets go"
        rows.append(Row(f"{title}: order of the distance", order, 2, "theory", 0.3, reason, scale=1))

    def drawn():
        page, (left, right) = plots.axes("time after the snap over π/ω", ["distance over L", "tension over u √(kμ)"],
                                         columns=2)  # fmt: skip
        for ratio, mark in zip(history, "osD", strict=True):
            taut, _, restitution = exact(ratio)
            own = history[ratio]
            time = (own["time"] - SNAP) * OMEGA / np.pi
            left.plot(time, (own["x1"] - own["x0"]) / LENGTH, mark, markersize=4, label=f"ζ = {ratio:g}")
            fine = np.linspace(0, taut, 200)
            scale = SPEED * np.sqrt(STIFFNESS * REDUCED)
            right.plot(fine * OMEGA / np.pi, tension(fine, ratio) / scale, **plots.REFERENCE)
            right.plot(time, own["tension"] / scale, mark, markersize=4)
            gone = LENGTH + 2 * ratio * restitution * SPEED / OMEGA
            after = np.linspace(taut, PERIOD, 50)
            left.plot(after * OMEGA / np.pi, (gone - restitution * SPEED * (after - taut)) / LENGTH, **plots.REFERENCE)
        left.legend(frameon=False)
        return page

    caption = "Distance and tension of the two masses: refweb (markers), free flight and damped oscillator (lines)."
    return Case(rows=rows, figures=[Figure(caption, drawn)])
