"""A mass thrown from a V and from a cross.

A mass sits where weightless arms of length a meet, two of them in a slack V or four in a prestressed cross, and is
thrown across them with the speed v. The arms stay straight, so that it moves in one potential,

    Π(h) = n EA L ε²/2 where ε = √(a² + h²)/L − 1 > 0, else 0

and all of the motion follows from energy: the farthest point from ½ m v² = Π(h) − Π(0), the time to it from
∫ dh/√(v² − 2 (Π(h) − Π(0))/m), and the return to h = 0 with −v after twice that time. In the V the mass flies freely
until the arms snap taut at h² = L² − a². Central differences are of order 2, also across the snap, where the tension
begins from zero.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row, slope

ARM, AXIAL, MASS = 1.0, 100.0, 0.5


@dataclass(frozen=True)
class Thrown:
    """Number of arms, their natural length [m], and the speed of the mass [m/s]."""

    arms: int
    natural: float
    speed: float

    def potential(self, h):
        """Energy of the arms [J]; l − L without cancellation."""
        stretch = (ARM**2 + h * h - self.natural**2) / (np.sqrt(ARM**2 + h * h) + self.natural)
        return self.arms * AXIAL / self.natural * np.maximum(stretch, 0.0) ** 2 / 2

    def farthest(self):
        """Farthest point [m] and the time to it [s]."""
        energy = MASS * self.speed**2 / 2 + self.potential(0.0)
        top = brentq(lambda h: self.potential(h) - energy, 1e-9, 10.0, xtol=1e-16, rtol=1e-15)
        taut = np.sqrt(max(self.natural**2 - ARM**2, 0.0))

        def slowness(angle):
            """dt/dφ with h = taut + (top − taut) sin φ, which takes the root out of the end."""
            h = taut + (top - taut) * np.sin(angle)
            left = 2 * (energy - self.potential(h)) / MASS
            return (top - taut) * np.cos(angle) / np.sqrt(left)

        time = quad(slowness, 0, np.pi / 2 - 1e-9, epsabs=1e-12, epsrel=1e-12)[0]
        return top, taut / self.speed + time


CASES = {"V": Thrown(2, 1.02, 2.0), "cross": Thrown(4, 0.99, 2.0)}


def solved(thrown, duration, steps):
    """The mass for a time, in a number of steps."""
    ends = [[-ARM, 0, 0], [ARM, 0, 0], [0, -ARM, 0], [0, ARM, 0]][: thrown.arms]
    scene = refweb.Scene(
        web=refweb.Inline(
            points=[[0, 0, 0], *ends],
            lines=[[0, i + 1] for i in range(thrown.arms)],
            natural_length=thrown.natural,
            supports=list(range(1, thrown.arms + 1)),
        ),
        cable=refweb.Cable(law="tension-only", modulus=AXIAL / 1e-4, area=1e-4, density=0.0),
        effects=[refweb.PointMass(node=0, mass=MASS), refweb.Velocity(node=0, value=(0, 0, thrown.speed))],
        solve=refweb.Dynamic(duration=duration, step_size=duration / steps * (1 + 1e-9)),
        output=refweb.Output(interval=duration / 36),
        observe=[
            refweb.Observe(name="farthest", quantity="displacement", node=0, component="z", reduce="max"),
            refweb.Observe(name="h", quantity="displacement", node=0, component="z"),
            refweb.Observe(name="v", quantity="velocity", node=0, component="z"),
            refweb.Observe(name="T", quantity="tension", reduce="max"),
        ],
    )
    return refweb.run(scene)


def case(quick):
    counts = 36 * 3 ** np.arange(1, 4 if quick else 6)
    rows, histories = [], {}
    for name, thrown in CASES.items():
        top, time = thrown.farthest()
        length = np.sqrt(ARM**2 + top**2)
        tension = AXIAL * (length / thrown.natural - 1)
        errors = []
        for count in counts:
            solution = solved(thrown, 2 * time, int(count))
            r = solution.results
            errors.append(abs(r["h"].value) / top)
        histories[name] = solution.history
        within, reason = 10 / counts[-1] ** 2, "order 2 in the step, 10 (1/steps)²"
        for title, value, reference, unit in (
            ("farthest", r["farthest"], top, "m"),
            ("largest tension", r["T"], tension, "N"),
            ("speed at the time of return", r["v"], -thrown.speed, "m/s"),
        ):
            full = f"{name}: {title}"
            rows.append(Row(full, value.value, reference, "energy", within, reason, unit, value.error, covered=True))
        rows.append(
            Row(f"{name}: place then", r["h"].value, 0.0, "energy, quadrature", within, reason, "m", r["h"].error,
                scale=top, covered=True)
        )  # fmt: skip
        order = -slope(counts, errors)
        rows.append(Row(f"{name}: order of the place", order, 2, "theory", 0.1, "where in its step it snaps", scale=1))

    def drawn():
        page, (left, right) = plots.axes(
            ["time over that of the return", "height over the largest"],
            ["height over the largest", "speed over the first"],
            columns=2,
        )
        for (name, thrown), mark in zip(CASES.items(), "os", strict=True):
            top, time = thrown.farthest()
            h = top * np.sin(np.linspace(0, np.pi / 2, 400))
            speed = np.sqrt(np.maximum(thrown.speed**2 - 2 * (thrown.potential(h) - thrown.potential(0.0)) / MASS, 0))
            own = histories[name]
            left.plot(own["time"] / (2 * time), own["h"] / top, mark, markersize=4, label=name)
            right.plot(own["h"] / top, own["v"] / thrown.speed, mark, markersize=4)
            right.plot(h / top, speed / thrown.speed, **plots.REFERENCE)
            right.plot(h / top, -speed / thrown.speed, **plots.REFERENCE)
        left.legend(frameon=False)
        return page

    caption = "The mass in the V and in the cross: refweb (markers), and speed over height from energy (lines)."
    return Case(rows=rows, figures=[Figure(caption, drawn)])
