"""What order, subdivision and mass buy: digits of deflection and peak stress of the three webs, and what they cost.

    python -m validation.methods.refinement [triangle square hexagon]

Under a load at a node the lines between nodes stay straight and carry one tension each, so that one straight element is
exact: the digits of the 5 N rows are those that the solver leaves, whatever the refinement. Under an impact mass and
waves are spread along the lines, and every refinement changes the answer. Digits are −log₁₀ of the relative difference
to the finest run of the same case. Order 1 with lumped mass is integrated by central differences, all else by CVODE
(Adams, rtol 1e-5), both far more accurate in time than the discretisation is in space. CPU time of one run, one thread.
"""

from __future__ import annotations

import os
import sys
import time
from dataclasses import replace

from refweb.sweeps.threads import ONE_THREAD

os.environ |= ONE_THREAD

import numpy as np  # noqa: E402

import refweb  # noqa: E402
from refweb.scene import Scene  # noqa: E402

WEBS = ("triangle", "square", "hexagon")
STATIC = [(1, 1), (1, 2), (1, 4), (2, 1), (2, 2), (3, 1)]
"""(order, subdivide) of the static runs; the last is the reference."""
DYNAMIC = [
    (1, 1, "lumped"),
    (1, 2, "lumped"),
    (1, 4, "lumped"),
    (1, 1, "consistent"),
    (2, 1, "lumped"),
    (2, 1, "consistent"),
    (3, 1, "lumped"),
    (1, 6, "lumped"),
]
"""(order, subdivide, mass) of the impacts; the last is the reference."""
NAMES = ("deflection", "max_stress")
DURATION = {"triangle": 0.12, "square": 0.135, "hexagon": 0.175}
"""Time by which stress and deflection of each web have passed their largest value [s]."""


def refined(scene, order, subdivide):
    """A scene whose lines are divided, without the errors that a twin would find."""
    return scene.replace(cable=replace(scene.cable, order=order, subdivide=subdivide))


def loaded(web, order, subdivide):
    """A web under 5 N."""
    scene = refined(Scene.load(f"{web}-load"), order, subdivide)
    return scene.replace(solve=refweb.Static(load_steps=[5.0]), observe=())


def hit(web, order, subdivide, mass):
    """A web hit by the ball, to the time of its largest deflection and a little beyond."""
    scene = refined(Scene.load(f"{web}-impact"), order, subdivide)
    if order == 1 and mass == "lumped":
        solve = refweb.Dynamic(duration=DURATION[web])
    else:
        solve = refweb.Dynamic(
            duration=DURATION[web],
            method="cvode",
            family="adams",
            rtol=1e-5,
            linear_solver="fixed-point",
            mass=mass,
        )
    return scene.replace(solve=solve, accuracy=refweb.Accuracy(error="none"))


def solved(scene):
    """Results of a scene and its CPU time [s]."""
    began = time.process_time()
    solution = refweb.run(scene)
    return [solution.results[name].value for name in NAMES], time.process_time() - began


def digits(value, reference):
    """Digits in which a value agrees with a reference, at most 16."""
    difference = abs(value - reference) / abs(reference)
    return 16.0 if difference < 1e-16 else -np.log10(difference)


def table(title, cases, make):
    """Run and print the cases; the last, run first, is the reference."""
    reference, spent = solved(make(*cases[-1]))
    print(f"\n{title}: {reference[0] * 1e3:.4f} mm, {reference[1] / 1e3:.3f} kPa at the reference")
    print("order  subdivide  mass        deflection [mm]  digits  peak stress [kPa]  digits   CPU [s]")
    found = []
    for case in cases:
        values, cpu = (reference, spent) if case == cases[-1] else solved(make(*case))
        known = [digits(v, r) for v, r in zip(values, reference, strict=True)]
        found.append((*case, *known))
        mass = case[2] if len(case) > 2 else "-"
        shown = ["   ref" if case == cases[-1] else f"{d:6.1f}" for d in known]
        print(
            f"{case[0]:5d}  {case[1]:9d}  {mass:10s}  {values[0] * 1e3:15.5f}  {shown[0]}  "
            f"{values[1] / 1e3:17.4f}  {shown[1]}  {cpu:8.2f}",
            flush=True,
        )
    return found


def main(webs=WEBS):
    """Print the tables; the status says whether static results are the same to 8 digits at every refinement."""
    worst = 16.0
    for web in webs:
        found = table(f"{web} web under 5 N", STATIC, lambda *case: loaded(web, *case))  # noqa: B023
        worst = min(worst, *(min(row[-2:]) for row in found))
        table(f"{web} web hit by a ball", DYNAMIC, lambda *case: hit(web, *case))  # noqa: B023
    print(f"\nstatic results agree to {worst:.1f} digits at every refinement, limit 8")
    return 0 if worst >= 8.0 else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or WEBS))
