"""What implicit steps cost: error, work and CPU time of CVODE and IDA by tolerance, method and linear solver.

    python -m validation.cost.implicit

First the square web, of whose centre a mass of 1 kg is thrown at 1 m/s (smooth law, η = 1e-4): the error of the
centre's displacement after 0.25 s against an Adams run at rtol = 1e-10, with evaluations of forces (nfev), of tangents
(njev) and factorizations (nlu), and the slope of error over tolerance, for a method of order p about p/(p + 1). Then
the three impacts as shipped, to 0.03 s: CPU time of each linear solver. ``block`` has to beat ``sparse``, and ``auto``
has to stay within 1.3 times the best.

CPU time of one thread, compilation left out; the minimum of `REPEATS` runs where the table compares linear solvers.
"""

from __future__ import annotations

import os
import sys
import time

from refweb.sweeps.threads import ONE_THREAD

os.environ |= ONE_THREAD

import numpy as np  # noqa: E402

import refweb  # noqa: E402
from refweb.dynamics.integrators.central_difference import CentralDifference  # noqa: E402
from refweb.dynamics.integrators.cvode import Cvode  # noqa: E402
from refweb.dynamics.integrators.ida import Ida  # noqa: E402
from refweb.scene import Scene  # noqa: E402

END = 0.25
"""Duration of the thrown mass [s]."""
LADDERS = {
    "BDF, block": (Cvode, dict(family="bdf", linear_solver="block"), (1e-3, 1e-4, 1e-5)),
    "BDF, sparse": (Cvode, dict(family="bdf", linear_solver="sparse"), (1e-3, 1e-4)),
    "BDF, auto": (Cvode, dict(family="bdf"), (1e-3, 1e-4, 1e-5)),
    "Adams, block": (Cvode, dict(family="adams", linear_solver="block"), (1e-3, 1e-5, 1e-7)),
    "Adams, auto": (Cvode, dict(family="adams"), (1e-3, 1e-5, 1e-7)),
    "IDA, block": (Ida, dict(linear_solver="block"), (1e-3, 1e-4, 1e-5)),
}
"""Methods by name: solver, its keys, its tolerances."""
AIM, PRICE = 5e-5, 1.5
"""Error of the centre [m] that CVODE reaches for at most so much CPU time [s]."""
IMPACTS = ("triangle", "square", "hexagon")
HIT = 0.03
"""Duration of the impacts [s]: the ball has touched, and the first waves have come back."""
CHOICES = {
    ("bdf", 1e-4): ("block", "sparse", "fixed-point", "auto"),
    ("bdf", 1e-6): ("block", "sparse", "fixed-point", "auto"),
    ("adams", 1e-4): ("block", "sparse", "fixed-point", "auto"),
    ("adams", 1e-6): ("block", "sparse", "fixed-point", "auto"),
}
"""Linear solvers that are compared, by family and tolerance."""
NEAR = 1.3
"""Largest ratio of ``auto`` to the best."""
REPEATS = 3


def ran(solver, end):
    """A run to ``end`` and its CPU time [s]."""
    run = solver.start()
    began = time.process_time()
    solver.advance(run, [end])
    return run, time.process_time() - began


def best(make, end):
    """The last of `REPEATS` runs, its solver, and the least CPU time [s]."""
    least = np.inf
    for _ in range(REPEATS):
        solver = make()
        run, cpu = ran(solver, end)
        least = min(least, cpu)
    return run, solver, least


def thrown():
    """The square web and its thrown mass."""
    return refweb.Scene(
        web=refweb.Paper(mesh="square", cable_length=201.4),
        cable=refweb.Cable(law="smooth", smoothing=1e-4, modulus=7e7, area=1e-4, density=200.0),
        effects=[refweb.PointMass(node="centre", mass=1.0), refweb.Velocity(node="centre", value=(0.0, 0.0, 1.0))],
        solve=refweb.Dynamic(duration=END),
    ).build()


def tolerances():
    """Print the errors and the work of each method; whether the aim is met for its price."""
    system = thrown()
    node = system.net.web.centre
    reference = ran(Cvode(system, family="adams", rtol=1e-10), END)[0].x[node, 2]
    print(f"A mass of 1 kg thrown at 1 m/s: the square web's centre is at {reference * 1e3:.7f} mm after {END} s")
    print("method              rtol  error [m]   CPU [s]   steps    nfev    njev   nlu")
    met = False
    for safety in (0.9, 0.45):
        solver = CentralDifference(system, safety=safety)
        solver.advance(solver.start(), [1e-6])
        run, cpu = ran(solver, END)
        row = f"central differences, safety {safety:4.2f}"
        print(f"{row:s}  {abs(run.x[node, 2] - reference):.1e}  {cpu:6.2f}  {run.nsteps:6d}")
    for name, (kind, keys, ladder) in LADDERS.items():
        errors = []
        for rtol in ladder:
            solver = kind(system, rtol=rtol, **keys)
            run, cpu = ran(solver, END)
            errors.append(abs(run.x[node, 2] - reference))
            spent = solver.stats
            print(
                f"{name:15s}  {rtol:7.0e}   {errors[-1]:.1e}   {cpu:7.2f}  {run.nsteps:6d}  {spent['nfev']:6d}  "
                f"{spent['njev']:6d}  {spent['nlu']:4d}",
                flush=True,
            )
            met = met or (kind is Cvode and errors[-1] <= AIM and cpu <= PRICE)
        slope = np.polyfit(np.log(ladder), np.log(errors), 1)[0]
        print(f"{name:15s}  slope of error over tolerance {slope:.2f}")
    print(f"error ≤ {AIM:g} m for ≤ {PRICE:g} s by CVODE: {'yes' if met else 'no'}")
    return met


def choices():
    """Print the CPU time of linear solvers on each impact; whether block beats sparse and auto is near the best."""
    good = True
    print(f"\nImpacts to {HIT} s: CPU [s] (nfev, njev, nlu)")
    for web in IMPACTS:
        system = Scene.load(f"{web}-impact").build()
        for (family, rtol), names in CHOICES.items():
            spent, words = {}, []
            for name in names:
                _, solver, spent[name] = best(
                    lambda name=name: Cvode(system, family=family, rtol=rtol, linear_solver=name),  # noqa: B023
                    HIT,
                )
                work = ", ".join(str(n) for n in solver.stats.values())
                words.append(f"{name} {spent[name]:.2f} ({work})")
            ratio = spent["auto"] / min(cpu for name, cpu in spent.items() if name != "auto")
            print(f"{web:8s} {family:5s} {rtol:.0e}  {'  '.join(words)}  auto/best {ratio:.2f}", flush=True)
            good = good and spent["block"] < spent["sparse"] and ratio <= NEAR
    return good


def main():
    """Print both tables; the status says whether what they have to show is so."""
    met, good = tolerances(), choices()
    print(f"\nblock beats sparse everywhere and auto is within {NEAR:g} × of the best: {'yes' if good else 'no'}")
    return 0 if met and good else 1


if __name__ == "__main__":
    sys.exit(main())
