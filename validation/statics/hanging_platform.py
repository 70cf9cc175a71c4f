"""A platform on ropes: how a beam hangs on two of different length, and how a plate on four swings and twists.

A beam of mass M and 2 m length hangs from two points 2 m apart on ropes of different length. In the plane it has three
unknowns, its place (x, z) and its angle θ, and rests where the energy of the ropes and the weights

    Π = Σ ½ (EA/L)(l − L)² + g (M z + Σ m z_end)

is least, with half of the mass of a rope at either end. The independent method is a root of the slope of Π, written in
these three unknowns, by MINPACK.

A plate of mass M and moments of inertia J on four vertical ropes of length l and stiffness k without mass, at the
corners ±p, ±q of the height of its centre, has the six frequencies

    sway ω² = g/l, twice,    torsion ω² = M g (p² + q²)/(J_z l),    bounce 4k/M,    rocking 4k q²/J_x and 4k p²/J_y.
"""

import numpy as np
from scipy.optimize import root

import refweb

from ..harness import plots
from ..harness.case import Case, Figure, Row

G, MASS, MODULUS, AREA, DENSITY, LONG = 9.81, 100.0, 1e9, 1e-4, 1000.0, 2.0
SIDES, CORNERS, INERTIA, STIFF = (0.5, 0.3), 4, (4.0, 10.0, 12.0), 1e7
"""p and q [m], number of ropes, J [kg m²] and EA of the plate's ropes [N]."""


def beam(short):
    """Solution of the beam whose second rope has this natural length [m]."""
    scene = refweb.Scene(
        web=refweb.Inline(
            points=[[-1, 0, 2], [1, 0, 2], [-1, 0, 0], [1, 0, 0]],
            lines=[[0, 2], [1, 3]],
            natural_length=[LONG, short],
            supports=[0, 1],
        ),
        cable=refweb.Cable(law="tension-only", modulus=MODULUS, area=AREA, density=DENSITY),
        effects=[
            refweb.Gravity(acceleration=(0.0, 0.0, -G)),
            refweb.Body(name="beam", shape="box", size=(2.0, 0.2, 0.2), mass=MASS, position=(0, 0, 0)),
            refweb.Attach(body="beam", node=[2, 3]),
        ],
        observe=[
            refweb.Observe(name="angle", quantity="orientation", body="beam"),
            refweb.Observe(name="long", quantity="tension", line=0),
            refweb.Observe(name="short", quantity="tension", line=1),
        ],
    )
    return refweb.run(scene)


def rest(short):
    """(θ [rad], tensions [N]) by the root of the slope of the energy."""
    natural, tops = np.array([LONG, short]), np.array([[-1.0, 2.0], [1.0, 2.0]])
    ends = 0.5 * DENSITY * AREA * natural

    def pulls(y):
        arms = np.array([[-np.cos(y[2]), -np.sin(y[2])], [np.cos(y[2]), np.sin(y[2])]])
        way = tops - y[:2] - arms
        length = np.linalg.norm(way, axis=1)
        return arms, MODULUS * AREA * (length / natural - 1.0), way / length[:, None]

    def unbalanced(y):
        arms, tension, way = pulls(y)
        force = tension[:, None] * way - G * np.outer(ends, [0.0, 1.0])
        moment = arms[:, 0] * force[:, 1] - arms[:, 1] * force[:, 0]
        return [force[:, 0].sum(), force[:, 1].sum() - G * MASS, moment.sum()]

    y = root(unbalanced, [0.0, 0.2, LONG - short], tol=1e-14).x
    return y[2], pulls(y)[1]


def plate():
    """Modes of the plate."""
    corners = [[x * SIDES[0], y * SIDES[1]] for x in (-1, 1) for y in (-1, 1)]
    scene = refweb.Scene(
        web=refweb.Inline(
            points=[[*corner, z] for z in (LONG, 0.0) for corner in corners],
            lines=[[i, CORNERS + i] for i in range(CORNERS)],
            supports=list(range(CORNERS)),
        ),
        cable=refweb.Cable(law="tension-only", modulus=STIFF / AREA, area=AREA, density=0.0),
        effects=[
            refweb.Gravity(acceleration=(0.0, 0.0, -G)),
            refweb.Body(
                name="plate", shape="box", size=(1.0, 0.6, 0.2), mass=MASS, inertia=INERTIA, position=(0, 0, 0)
            ),
            refweb.Attach(body="plate", node=list(range(CORNERS, 2 * CORNERS))),
        ],
    )
    return refweb.modes(scene, 6)


def frequencies():
    """Closed form of these [Hz]."""
    k, (p, q), (jx, jy, jz) = STIFF / LONG, SIDES, INERTIA
    length = LONG + MASS * G / (CORNERS * k)
    torsion = MASS * G * (p * p + q * q) / (jz * length)
    squared = [G / length, G / length, torsion, 4 * k / MASS, 4 * k * q * q / jx, 4 * k * p * p / jy]
    return np.sqrt(np.sort(squared)) / (2 * np.pi)


def case(quick):
    lengths = np.linspace(1.2, LONG, 3 if quick else 9)
    rows, found = [], []
    for short in lengths:
        solution, (angle, tension) = beam(short), rest(short)
        here = {name: solution.results[name] for name in ("angle", "long", "short")}
        found.append([here[name].value for name in here])
        reason = "a residual of 1e-10 of the largest force, over g/l and EA/L"
        for name, value, unit in (("angle", angle, "rad"), ("long", tension[0], "N"), ("short", tension[1], "N")):
            title = f"second rope {short:.3g} m: {name if name == 'angle' else 'tension of the ' + name + ' rope'}"
            result, scale = here[name], tension[0] if unit == "N" else 1.0
            rows.append(Row(title, result.value, value, "MINPACK", 1e-8, reason, unit, result.error, scale=scale))
    modes = plate()
    for k, (frequency, exact) in enumerate(zip(modes.frequency, frequencies(), strict=True), 1):
        reason = "± of the mode, and a residual of 1e-10"
        rows.append(Row(f"plate, mode {k}", frequency, exact, "closed form", 1e-8, reason, "Hz", modes.error[k - 1]))

    def drawn():
        page, (left, right) = plots.axes("second rope [m]", ["angle [rad]", "tension [N]"], columns=2)
        fine = np.linspace(lengths[0], lengths[-1], 60)
        curves = [rest(short) for short in fine]
        left.plot(fine, [angle for angle, _ in curves], **plots.REFERENCE)
        left.plot(lengths, [row[0] for row in found], "o")
        for n, name in enumerate(("long", "short")):
            right.plot(fine, [tension[n] for _, tension in curves], **plots.REFERENCE)
            right.plot(lengths, [row[1 + n] for row in found], "os"[n], label=f"{name} rope")
        right.legend(frameon=False)
        return page

    caption = "A beam on two ropes of different length: refweb (markers) on the root of three equations (lines)."
    return Case(rows=rows, figures=[Figure(caption, drawn)])
