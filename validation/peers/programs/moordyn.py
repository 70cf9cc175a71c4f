"""MoorDyn: each line is one segment between points; the thrown mass is the body that the user moves by its force."""

import contextlib
import importlib.metadata
import pathlib
import tempfile

import moordyn
import numpy as np

COMPILES = False
HEAD = """net
--- LINE TYPES ---
Name Diam MassDen EA BA EI Cd Ca CdAx CaAx
(-) (m) (kg/m) (N) (N-s) (N-m^2) (-) (-) (-) (-)
rope 1e-6 {density} {ea} 0 0 0 0 0 0
--- POINTS ---
ID Type X Y Z Mass Volume CdA Ca
(#) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)
"""
LINES = """--- LINES ---
ID LineType NodeA NodeB UnstrLen NumSegs LineOutputs
(#) (name) (#) (#) (m) (-) (-)
"""
OPTIONS = """--- OPTIONS ---
0 writeLog
{step} dtM
{scheme} tScheme
0 g
0 rho
10000 WtrDpth
0 kBot
0 cBot
--- END ---
"""


def version():
    return f"MoorDyn {importlib.metadata.version('moordyn')}"


def impact(problem, steps, scheme="RK2"):
    step = problem.duration / steps
    kind = ["Free" if one else "Fixed" for one in problem.free]
    coupled, count = np.flatnonzero(problem.point_masses), np.count_nonzero(problem.point_masses)
    for n in coupled:
        kind[n] = "Coupled"
    depth = 5000.0  # below the surface: the air has lines of another law
    points = [
        f"{n} {kind[n - 1]} {x!r} {y!r} {z - depth!r} 0 0 0 0" for n, (x, y, z) in enumerate(problem.start.tolist(), 1)
    ]
    lines = [
        f"{c} rope {i + 1} {j + 1} {length!r} 1 -"
        for c, ((i, j), length) in enumerate(zip(problem.lines.tolist(), problem.natural.tolist(), strict=True), 1)
    ]
    text = HEAD.format(density=problem.density, ea=problem.ea) + "\n".join(points) + "\n" + LINES
    text += "\n".join(lines) + "\n" + OPTIONS.format(step=step, scheme=scheme)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        pathlib.Path("net.txt").write_text(text, encoding="utf-8")
        system = moordyn.Create("net.txt")
        moordyn.SetVerbosity(system, moordyn.LEVEL_ERR)
        x, v = problem.start[coupled] - [0.0, 0.0, depth], problem.velocities[coupled]
        moordyn.Init_NoIC(system, x.ravel().tolist(), v.ravel().tolist())
        mass, force = problem.point_masses[coupled, None], np.zeros((count, 3))
        for n in range(steps):  # kick, drift, kick of the bodies that carry the coupled points
            v = v + 0.5 * step * force / mass
            force = moordyn.Step(system, x.ravel().tolist(), v.ravel().tolist(), n * step, step)
            force = np.reshape(force, (count, 3))
            x = x + step * v
            v = v + 0.5 * step * force / mass
        found = [moordyn.GetPointPos(moordyn.GetPoint(system, n)) for n in range(1, len(problem.points) + 1)]
        moordyn.Close(system)
    return np.array(found) + [0.0, 0.0, depth]


def capture(problem, steps):
    """MoorDyn has no contact of lines with a body or with each other: they pass."""
    return impact(problem, steps)
