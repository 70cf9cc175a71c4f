"""Pressure, heat, a reel and thrust: a ring, a bar and a pendulum.

A ring of n equal lines in the plane is pushed outward by p per current length, and its temperature changes. Half of the
push of each line acts at each of its ends, at right angles to the line. The pushes on a corner and the tensions of its
two lines balance for

    T = p l / (2 tan(π/n)),      l = L₀ (1 + α ΔT) (1 + T/EA)

which is linear in T. A bar between fixed ends at a distance L, whose natural length a reel shortens to f L, has the
tension EA (1/f − 1). A mass on a line that a force Q pulls and a thrust F along the line pushes back hangs in the
direction of Q with the tension Q − F, whatever the line's stiffness.

Independent method: these closed forms.
"""

import numpy as np

import refweb

from ..harness.case import Case, Row

AXIAL = 1e3
"""EA of all lines [N]."""
CABLE = refweb.Cable(law="tension-only", modulus=AXIAL / 1e-4, area=1e-4, density=0.0)
RADIUS, PUSH, EXPANSION = 2.0, 5.0, 2e-5
"""Radius of the corners of the ring [m], push on it [N/m], and coefficient of expansion [1/K]."""
RESIDUAL = "residual 1e-10 of the forces, over the stiffness"


def ring(count, change):
    """Tension of a ring of some lines under a push and a change of temperature [K], a result."""
    angle = 2.0 * np.pi * np.arange(count) / count
    points = RADIUS * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    scene = refweb.Scene(
        web=refweb.Inline(points=points, lines=[[i, (i + 1) % count] for i in range(count)]),
        cable=CABLE,
        supports=refweb.Supports(nodes=[0]),
        support=[
            refweb.Supports(nodes=[count // 2], components=["y", "z"]),
            refweb.Supports(nodes="all", components=["z"]),
        ],
        effects=[
            refweb.Pressure(lines="all", normal=(0, 0, 1), value=PUSH),
            refweb.Temperature(expansion=EXPANSION, change=change),
        ],
    )
    return refweb.run(scene).results["max_tension"]


def shortened(factor):
    """Tension of a bar between fixed ends by a reel, a result."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [1, 0, 0], [2, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2]),
        cable=CABLE,
        effects=[refweb.Reel(lines="all", factor=[(0.0, 1.0), (1.0, factor)])],
    )
    return refweb.run(scene).results["max_tension"]


def pushed(pull, thrust):
    """Position of a mass [m], shape (3,), and tension of its line, a result."""
    scene = refweb.Scene(
        web=refweb.Inline(points=[[0, 0, 0], [0, 0, -1]], lines=[[0, 1]], supports=[0]),
        cable=CABLE,
        effects=[refweb.Load(node=1, force=pull), refweb.Thrust(node=1, line=0, force=thrust)],
    )
    solution = refweb.run(scene)
    return solution.positions[1], solution.results["max_tension"]


def case(quick):
    rows = []
    for count in (6, 12) if quick else (6, 24, 96):
        for change in (0.0, -80.0, 80.0):
            natural = 2.0 * RADIUS * np.sin(np.pi / count) * (1.0 + EXPANSION * change)
            share = PUSH * natural / (2.0 * np.tan(np.pi / count))
            tension, name = ring(count, change), f"tension of a ring of {count} lines, {change:+g} K"
            exact = share / (1.0 - share / AXIAL)
            rows.append(Row(name, tension.value, exact, "closed form", 1e-8, RESIDUAL, "N", tension.error))
    for factor in (0.999, 0.9, 0.5):
        tension, exact = shortened(factor), AXIAL * (1.0 / factor - 1.0)
        name = f"tension of a bar shortened to {factor:g} of its length"
        rows.append(Row(name, tension.value, exact, "closed form", 1e-9, RESIDUAL, "N", tension.error))
    pull = np.array([3.0, 1.0, -2.0])
    size = np.linalg.norm(pull)
    for thrust in (-2.0, 0.0, 3.0):
        position, tension = pushed(pull, thrust)
        name, exact = f"thrust of {thrust:g} N against a pull of {size:.4g} N", size - thrust
        place = pull / size * (1.0 + exact / AXIAL)
        rows.append(Row(f"{name}: tension", tension.value, exact, "Q − F", 1e-8, RESIDUAL, "N", tension.error))
        apart = float(np.linalg.norm(position - place))
        rows.append(Row(f"{name}: error of the position", apart, 0.0, "along Q", 1e-8, RESIDUAL, "m", scale=1))
    return Case(rows=rows)
