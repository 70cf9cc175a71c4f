"""How cost grows with size: statics with its bounds and explicit steps, up to the largest web that is asked for.

    python -m validation.cost.scale [CELLS [qdldl | superlu | multifrontal | rslab | auto [MESHES]]]

Square, triangle and hexagon webs of cells × cells up to CELLS a side, 100 by default, each size in a process of its
own with one thread. Statics: five load steps of a load at the centre, from flat, with error bounds; the unit is one
factorization by SuperLU (symmetric mode, minimum degree) of the same matrix in the same process. Explicit: each web
thrown at 1 m/s for 0.08 s, which takes a thousand steps. CPU time; the peak is that of the process, libraries included.
The exponents are slopes of a fit of log CPU over log unknowns. CPU time moves by tens of per cent on a busy machine;
the counts of factorizations do not.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time

from refweb.sweeps.threads import ONE_THREAD

os.environ |= ONE_THREAD

import numpy as np  # noqa: E402

import refweb  # noqa: E402
from refweb.dynamics.simulation import Simulation  # noqa: E402
from refweb.solution import Solution  # noqa: E402
from refweb.statics import load_steps  # noqa: E402
from refweb.system.factorization import symmetric_lu  # noqa: E402

DURATION = 0.08
"""Of the explicit runs [s], some thousand steps."""
MESHES = "square,triangle,hexagon"


def scene(mesh, cells, **parts):
    return refweb.Scene(
        web=refweb.Window(mesh=mesh, rows=cells, columns=cells, side=0.1),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        **parts,
    )


def statics(mesh, cells, library):
    """One row of statics."""
    load, series = refweb.Load(node="centre", force=(0.0, 0.0, 1.0)), [1.0, 2.0, 3.0, 4.0, 5.0]
    warm = scene(mesh, 6, effects=[load]).build()
    list(load_steps.solve(warm, series))
    what = scene(mesh, cells, effects=[load], solve=refweb.Static(factorization=library))
    began = time.process_time()
    system = what.build()
    built = time.process_time()
    count, gap = 0, 0.0
    for state in load_steps.solve(system, series):
        count, gap = count + state.stats["nlu"], state.duality_bound.gap / abs(system.energy(state.step, state.x))
    solved = time.process_time()
    row = dict(lines=len(system.net.cells), unknowns=len(system.free), build=built - began, cpu=solved - built)
    row |= dict(count=count, gap=gap, peak=peak(), by=system.library.name)
    return row | dict(unit=superlu(system) if cells <= 300 else None)


def superlu(system):
    """CPU time of a factorization by SuperLU of a matrix with the system's pattern [s]."""
    net, times = system.net, []
    matrix = system.pattern.matrix(system.assemble_lines(net.unit_tension / net.natural_length[:, None, None]))
    for _ in range(2):
        began = time.process_time()
        symmetric_lu(matrix)
        times.append(time.process_time() - began)
    return min(times)


def explicit(mesh, cells, library):
    """One row of explicit steps."""

    def timed(cells):
        began = time.process_time()
        what = scene(
            *(mesh, cells),
            effects=[refweb.Velocity(node="all", value=(0.0, 0.0, 1.0))],
            solve=refweb.Dynamic(duration=DURATION),
            output=refweb.Output(interval=0.25 * DURATION, frames=4),
            accuracy=refweb.Accuracy(error="none"),
        )
        system = what.build()
        built = time.process_time()
        simulation = Simulation(what, system, Solution(what))
        simulation.follow(None, lambda text, share: None)
        steps, lines = simulation.solution.solver["nsteps"], len(system.net.cells)
        spent = time.process_time() - built
        row = dict(lines=lines, unknowns=len(system.free), build=built - began, cpu=spent, steps=steps)
        return row | dict(each=1e9 * spent / (steps * lines), peak=peak())

    timed(6)
    return timed(cells)


def peak():
    """Largest memory of this process so far [GB]; nan on Windows, which does not say."""
    if sys.platform == "win32":
        return np.nan
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1e-9 if sys.platform == "darwin" else 1.024e-6)


def alone(kind, *arguments):
    """A row from a process of its own; None where that fails, with its words."""
    command = [sys.executable, "-m", "validation.cost.scale", "--row", kind, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        print(f"{kind} {arguments}: {(done.stderr.strip() or f'ended by signal {-done.returncode}').splitlines()[-1]}")
        return None
    return json.loads(done.stdout.splitlines()[-1])


def exponent(rows, key):
    """Slope of log ``key`` over log unknowns, of the larger half of sizes; nan of one."""
    rows = rows[-max(2, (len(rows) + 1) // 2) :]
    if len(rows) < 2:
        return np.nan
    return np.polyfit(*(np.log([row[k] for row in rows]) for k in ("unknowns", key)), 1)[0]


def main(most=100, library="auto", meshes=MESHES):
    """Print the tables."""
    sizes = [n for n in (25, 50, 100, 200, 350, 500, 700, 1000) if n <= most]
    for mesh in meshes.split(","):
        heads = "lines, unknowns, set-up [s], CPU [s]"
        print(f"{mesh}, statics: {heads}, of one SuperLU, factorizations, gap/|Pi|, by, peak")
        table("statics", mesh, sizes, library, told_statics)
        print(f"{mesh}, explicit: {heads}, steps, ns per element and step, peak")
        table("explicit", mesh, sizes, library, told_explicit)


def table(kind, mesh, sizes, library, told):
    """Print a row of each size, as far as this machine takes it, and exponents."""
    rows = []
    for n in sizes:
        if (row := alone(kind, mesh, n, library)) is None:
            break
        rows.append(row)
        start = f"{row['lines']:9d}{row['unknowns']:9d}{row['build']:8.2f}{row['cpu']:9.2f}"
        print(f"{start}{told(row)}{row['peak']:7.2f} GB", flush=True)
    print(f"exponents: set-up {exponent(rows, 'build'):.2f}, CPU {exponent(rows, 'cpu'):.2f}")


def told_statics(row):
    """What a row of statics tells beside size, time and memory."""
    unit = f"{row['cpu'] / row['unit']:6.1f}" if row["unit"] else "     -"
    return f"{unit}{row['count']:5d}{row['gap']:9.0e}  {row['by']}"


def told_explicit(row):
    """What a row of explicit steps tells beside size, time and memory."""
    return f"{row['steps']:6d}{row['each']:8.1f}"


if __name__ == "__main__":
    if sys.argv[1:2] == ["--row"]:
        one, mesh, cells, library = sys.argv[2:]
        print(json.dumps({"statics": statics, "explicit": explicit}[one](mesh, int(cells), library)))
    else:
        main(*(int(word) if word.isdigit() else word for word in sys.argv[1:]))
