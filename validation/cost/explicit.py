"""What a step costs: nanoseconds per element and step of whole explicit runs, beside plain C of the same arithmetic.

    python -m validation.cost.explicit

Four scenes: the square web hit by a ball, as shipped, a taut cable of 100 elements that a point mass plucks, and point
masses that leave the centres of the square web and of one of 79 600 lines, with default observables. The whole run is
timed, from the first state to the results, with its history rows (every 1e-3 or 1e-2 s) and peaks, and without files,
frames between the first and the last, or a twin. Two loops in C take the same steps, without rows:

same    the same arithmetic on the same cells and data: kicks and drifts, tensions, contact, the impulse of the supports
        and the peaks of the same observables
lean    kicks, drifts, tensions and contact of every line alone, with positions as unknowns

CPU time, minimum of several warm runs that alternate, all in this process, one thread. The status is 1 where a ratio is
above its limit; a busy machine moves both, and by how much shows in the median of the ratios.
"""

from __future__ import annotations

import ctypes
import pathlib
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple

import numpy as np

import refweb
from refweb.compiled.rows import column_of, records_of
from refweb.dynamics.simulation import Simulation
from refweb.effects.contact.pair import AWAY, SPHERE
from refweb.scene import Scene
from refweb.solution import Solution

FLAGS = dict.fromkeys(("same", "lean"), ("-O3", "-march=native"))
"""How each loop is compiled."""
LIMITS = {
    "square web hit by a ball": {"same": 0.7, "lean": 1.25},
    "cable of 100 elements": {"same": 1.1, "lean": 1.7},
    "mass thrown from 3120 lines": {"same": 0.7, "lean": 1.15},
    "mass thrown from 79 600 lines": {"same": 0.7, "lean": 1.3},
}
"""Largest ratio to each C loop.

The fewer lines there are, the more a step has of what goes with steps and rows: in runs of 18 000 steps cables of 50,
100, 200, 400 and 1000 elements take 1.6, 1.4, 1.3, 1.3 and 1.2 times as long as the same arithmetic in C. Of the 60 000
steps of the cable here two thirds of the time are strains and forces, a fifth kicks, drifts and peaks, and the rest
history rows, one in 60 steps, and what begins and ends a run.

The lean loop is what a program for one purpose can do; the same arithmetic in C takes 1.9 to 2.5 times as long as it.
refweb takes differences and sums over runs of lines whose nodes follow each other, and strains and tensions of a block,
in all lanes of the processor, see `refweb.effects.line_blocks`, and takes 0.5 to 0.6 times as long as the same
arithmetic in C, which has one line after another. Of the 3.7 ns of the forces of a line, with 8 lanes, 1.5 are
differences of displacements and sums at nodes, 2.1 strains and tensions, and 0.1 the largest of these; steps copy none
of lines but at history rows. Among 79 600 lines some 180 bytes of a line pass the outer cache in a step, 48 of them its
numbers, which takes 2 ns at 90 GB/s; the lean loop has 140. Beside the lean loop there remain displacements as
unknowns, which keep digits where a web is nearly still but have strains in place of lengths and four more numbers of
each line to read, and the steps of what is not the loop. The lean loop also does nothing at lines that are not longer
than by nature. There are many of these in the thrown webs: ahead of a wave displacements are 1e-30 m and less, and lost
in positions.
"""

SOURCE = r"""
#include <math.h>

void run(long blocks, const long *counts, const double *steps, long rows, double *x, double *v, double *f,
         const double *inverse, long lines, const int *cells, const double *data, long width, double *out,
         long pairs, const int *touch, const double *bodies, double *pressed, double area, double *peaks,
         long supports, const long *held, double *impulse)
{
    double reaction[3] = {0, 0, 0};
    for (long b = 0; b < blocks; ++b) {
        const double h = steps[b];
        for (long s = 0; s < counts[b]; ++s) {
            for (long q = 0; q < 3 * rows; ++q) {
                v[q] += 0.5 * h * inverse[q] * f[q];
                x[q] += h * v[q];
                f[q] = 0.0;
            }
            for (long c = 0; c < lines; ++c) {
                const double *d = data + width * c, *r = d + REFERENCE;
                const double *xi = x + 3 * (long)cells[2 * c], *xj = x + 3 * (long)cells[2 * c + 1];
                double *fi = f + 3 * (long)cells[2 * c], *fj = f + 3 * (long)cells[2 * c + 1];
                const double u0 = xj[0] - xi[0], u1 = xj[1] - xi[1], u2 = xj[2] - xi[2];
                const double p0 = r[0] + u0, p1 = r[1] + u1, p2 = r[2] + u2, natural = d[LENGTH];
                const double length = sqrt(p0 * p0 + p1 * p1 + p2 * p2);
                const double strain = ((2 * r[0] + u0) * u0 + (2 * r[1] + u1) * u1 + (2 * r[2] + u2) * u2
                                       + (r[3] - natural) * (r[3] + natural)) / (natural * (length + natural));
                const double tension = strain > 0 ? d[AXIAL] * strain : 0.0;
                out[2 * c] = tension;
                out[2 * c + 1] = strain;
                if (length > 0) {
                    const double q = tension / length;
                    fi[0] += q * p0; fi[1] += q * p1; fi[2] += q * p2;
                    fj[0] -= q * p0; fj[1] -= q * p1; fj[2] -= q * p2;
                }
            }
            for (long c = 0; c < pairs; ++c) {
                const double *d = bodies + 8 * c;
                const double *xb = x + 3 * (long)touch[3 * c + 2];
                const double *xi = x + 3 * (long)touch[3 * c], *xj = x + 3 * (long)touch[3 * c + 1];
                double a[3], l[3], start = 0, line = 0;
                pressed[c] = 0;
                for (int k = 0; k < 3; ++k) {
                    a[k] = d[AWAY + k] + xi[k] - xb[k];
                    l[k] = d[AWAY + 3 + k] + xj[k] - xb[k] - a[k];
                    start += a[k] * a[k];
                    line += l[k] * l[k];
                }
                if (start > 2 * (d[RADIUS] * d[RADIUS] + line)) continue;
                double place = line > 0 ? -(a[0] * l[0] + a[1] * l[1] + a[2] * l[2]) / line : 0;
                place = place < 0 ? 0 : place > 1 ? 1 : place;
                double p[3], square = 0;
                for (int k = 0; k < 3; ++k) { p[k] = a[k] + place * l[k]; square += p[k] * p[k]; }
                if (square < d[RADIUS] * d[RADIUS] && square > 0) {
                    const double distance = sqrt(square), push = d[PENALTY] * (d[RADIUS] - distance);
                    pressed[c] = push;
                    for (int k = 0; k < 3; ++k) {
                        const double pull = push * p[k] / distance;
                        f[3 * (long)touch[3 * c] + k] += (1 - place) * pull;
                        f[3 * (long)touch[3 * c + 1] + k] += place * pull;
                        f[3 * (long)touch[3 * c + 2] + k] -= pull;
                    }
                }
            }
            for (long q = 0; q < 3 * rows; ++q) v[q] += 0.5 * h * inverse[q] * f[q];
            for (int k = 0; k < 3; ++k) { impulse[k] += 0.5 * h * reaction[k]; reaction[k] = 0; }
            for (long q = 0; q < supports; ++q) reaction[held[q] % 3] -= f[held[q]];
            for (int k = 0; k < 3; ++k) impulse[k] += 0.5 * h * reaction[k];
            double far = 0, stressed = 0;
            for (long r = 0; r < rows - (pairs > 0); ++r) {
                const double square = x[3 * r] * x[3 * r] + x[3 * r + 1] * x[3 * r + 1] + x[3 * r + 2] * x[3 * r + 2];
                if (square > far) far = square;
            }
            for (long c = 0; c < lines; ++c) if (out[2 * c] / area > stressed) stressed = out[2 * c] / area;
            if (sqrt(far) > peaks[0]) peaks[0] = sqrt(far);
            if (stressed > peaks[1]) peaks[1] = stressed;
            if (pairs) {
                const double *g = f + 3 * (rows - 1);
                const double force = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
                if (force > peaks[2]) peaks[2] = force;
            }
        }
    }
}
"""
LEAN = r"""
#include <math.h>

void run(long blocks, const long *counts, const double *steps, long rows, double *x, double *v, double *f,
         const double *inverse, long lines, const int *cells, const double *stiffness, const double *natural,
         long touching, double radius, double penalty)
{
    const double *centre = x + 3 * (rows - 1);
    double *pushed = f + 3 * (rows - 1);
    for (long b = 0; b < blocks; ++b) {
        const double h = steps[b];
        for (long s = 0; s < counts[b]; ++s) {
            for (long q = 0; q < 3 * rows; ++q) {
                v[q] += 0.5 * h * inverse[q] * f[q];
                x[q] += h * v[q];
                f[q] = 0.0;
            }
            for (long c = 0; c < lines; ++c) {
                const double *xi = x + 3 * (long)cells[2 * c], *xj = x + 3 * (long)cells[2 * c + 1];
                const double p0 = xj[0] - xi[0], p1 = xj[1] - xi[1], p2 = xj[2] - xi[2];
                const double length = sqrt(p0 * p0 + p1 * p1 + p2 * p2);
                if (length > natural[c]) {
                    double *fi = f + 3 * (long)cells[2 * c], *fj = f + 3 * (long)cells[2 * c + 1];
                    const double q = stiffness[c] * (length - natural[c]) / length;
                    fi[0] += q * p0; fi[1] += q * p1; fi[2] += q * p2;
                    fj[0] -= q * p0; fj[1] -= q * p1; fj[2] -= q * p2;
                }
            }
            for (long c = 0; c < (touching ? lines : 0); ++c) {
                const long i = 3 * (long)cells[2 * c], j = 3 * (long)cells[2 * c + 1];
                double a[3], l[3], start = 0, line = 0, along = 0;
                for (int k = 0; k < 3; ++k) {
                    a[k] = x[i + k] - centre[k];
                    l[k] = x[j + k] - x[i + k];
                    start += a[k] * a[k];
                    line += l[k] * l[k];
                    along += a[k] * l[k];
                }
                if (start > 2 * (radius * radius + line)) continue;
                double place = line > 0 ? -along / line : 0, p[3], square = 0;
                place = place < 0 ? 0 : place > 1 ? 1 : place;
                for (int k = 0; k < 3; ++k) { p[k] = a[k] + place * l[k]; square += p[k] * p[k]; }
                if (square < radius * radius && square > 0) {
                    const double distance = sqrt(square), q = penalty * (radius - distance) / distance;
                    for (int k = 0; k < 3; ++k) {
                        f[i + k] += (1 - place) * q * p[k];
                        f[j + k] += place * q * p[k];
                        pushed[k] -= q * p[k];
                    }
                }
            }
            for (long q = 0; q < 3 * rows; ++q) v[q] += 0.5 * h * inverse[q] * f[q];
        }
    }
}
"""


class Row(NamedTuple):
    """What a scene costs.

    Attributes
    ----------
    scene : str
        Its name.
    own : float
        Of refweb, per element and step [ns].
    plain, ratio, median, apart : dict
        By loop: the same of it, the ratio of the minima, the median of the ratios of runs one after another, and how
        far apart the last displacements are [m].
    """

    scene: str
    own: float
    plain: dict
    ratio: dict
    median: dict
    apart: dict


def machine():
    """Compiler and CPU, in words; None where there is no compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    version = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    info = pathlib.Path("/proc/cpuinfo")
    names = [line.partition(":")[2].strip() for line in info.read_text().splitlines() if line.startswith("model name")]
    return f"{version}; {(names or [platform.processor() or platform.machine()])[0]}"


def compiled(folder, name):
    """A C loop as a function, or None where there is no compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    source, library = pathlib.Path(folder) / f"{name}.c", pathlib.Path(folder) / f"{name}.so"
    source.write_text(LEAN if name == "lean" else SOURCE)
    names = {"REFERENCE": 6, "LENGTH": 0, "AXIAL": 1, "AWAY": AWAY}  # see `refweb.net.laws.line_data.FIELDS`
    names |= {name: column_of(SPHERE, field) for name, field in (("RADIUS", "radius"), ("PENALTY", "stiffness"))}
    flags = [f"-D{name}={value}" for name, value in names.items()]
    command = [compiler, *FLAGS[name], "-shared", "-fPIC", *flags, "-o", library, source, "-lm"]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(library)).run


def thrown(web, duration, step):
    """Scene of a mass of 1 kg that leaves the centre of a web at 1 m/s."""
    effects = [refweb.PointMass(node="centre", mass=1.0), refweb.Velocity(node="centre", value=(0.0, 0.0, 1.0))]
    return Scene(
        web=web,
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        effects=effects,
        solve=refweb.Dynamic(duration=duration, step_size=step),
        output=refweb.Output(interval=0.01),
        accuracy=refweb.Accuracy(error="none"),
    )


def scenes():
    """The scenes, without a twin."""
    shipped = Scene.load("square-impact")
    web = shipped.to_dict()
    web["accuracy"] = {"error": "none"}
    web["output"]["frames"] = 1000
    cable = {
        "title": "cable of 100 elements",
        "web": {"kind": "cable", "start": [0, 0, 0], "end": [2, 0, 0], "length": 1.998, "elements": 100},
        "cable": {"law": "tension-only", "modulus": 7e7, "area": 1e-4, "density": 200.0},
        "point_mass": [{"node": "centre", "mass": 0.1}],
        "velocity": [{"node": "centre", "value": [0.0, 0.0, 1.0]}],
        "solve": {"kind": "dynamic", "duration": 1.0},
        "observe": [
            {"name": "deflection", "quantity": "displacement", "reduce": "max"},
            {"name": "max_stress", "quantity": "stress", "reduce": "max"},
        ],
        "output": {"interval": 1e-3, "frames": 1000},
        "accuracy": {"error": "none"},
    }
    made = (
        Scene.from_dict(web),
        Scene.from_dict(cable),
        thrown(refweb.Paper(mesh="square", cable_length=201.4), 0.1, 8e-5),
        thrown(refweb.Window(mesh="square", rows=200, columns=200, side=0.1), 0.04, 5e-5),
    )
    return dict(zip(LIMITS, made, strict=True))


def whole_run(scene, system):
    """CPU time of a run and its follower, with the steps it took in each row."""
    simulation = Simulation(scene, system, Solution(scene))
    began = time.process_time()
    simulation.follow(None, lambda text, share: None)
    return time.process_time() - began, simulation


def steps_of(scene, system):
    """Step counts and sizes of every history row."""
    simulation = Simulation(scene, system, Solution(scene))
    solver, times = simulation.integrator, simulation.schedule.times
    run, counts, sizes = solver.start(), [], []
    for end in times[1:]:
        before = run.nsteps
        solver.advance(run, [end])
        counts.append(run.nsteps - before)
        sizes.append(run.step)
    return np.array(counts, dtype=np.int64), np.array(sizes), run


def address(array):
    """Where an array begins, for C."""
    return array.ctypes.data_as(ctypes.c_void_p)


def c_run(name, loop, system, counts, sizes):
    """CPU time of a C loop over the same steps, and its last displacement."""
    net, long, double = system.net, ctypes.c_long, ctypes.c_double
    contact = next((f for f in system.terms if f.contact.with_lines), None)
    x, v = np.zeros((system.rows, 3)), system.initial_velocity()
    f = system.force(0.0, x)
    inverse = np.where(system.supported, 0.0, 1.0 / net.mass[:, None])
    pairs = len(contact.cells) if contact else 0
    touch = contact.cells if contact else np.zeros((0, 3), dtype=np.int32)
    bodies = contact.data if contact else np.zeros((1, 8))
    sphere = records_of(SPHERE, bodies)[0]
    if name == "lean":
        x += net.points
        natural = net.line_data.natural_length.copy()
        stiffness = net.line_data.ea / natural
        own = (
            address(stiffness), address(natural), long(pairs > 0), double(sphere["radius"]),
            double(sphere["stiffness"]),
        )  # fmt: skip
    else:
        out, pressed, impulse = np.zeros((len(net.cells), 2)), np.zeros(max(pairs, 1)), np.zeros(3)
        held, peaks = np.flatnonzero(system.supported), np.zeros(3)
        own = (
            address(net.line_data), long(net.line_data.matrix.shape[1]), address(out), long(pairs), address(touch),
            address(bodies), address(pressed), double(net.area[0]), address(peaks), long(len(held)), address(held),
            address(impulse),
        )  # fmt: skip
    began = time.process_time()
    loop(
        long(len(counts)), address(counts), address(sizes), long(system.rows), address(x), address(v), address(f),
        address(inverse), long(len(net.cells)), address(net.cells), *own,
    )  # fmt: skip
    return time.process_time() - began, x - net.points if name == "lean" else x


def measure(repeats=9):
    """A `Row` of each scene; without a compiler its dicts are empty."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        loops = {name: loop for name in FLAGS if (loop := compiled(folder, name)) is not None}
        for name, scene in scenes().items():
            system = scene.build()
            counts, sizes, run = steps_of(scene, system)
            unit = 1e9 / (counts.sum() * len(system.net.cells))
            whole_run(scene, system)
            own, plain, apart = [], {loop: [] for loop in loops}, {}
            for _ in range(repeats):
                own.append(unit * whole_run(scene, system)[0])
                for kind, loop in loops.items():
                    seconds, x = c_run(kind, loop, system, counts, sizes)
                    plain[kind].append(unit * seconds)
                    apart[kind] = float(np.abs(x - run.x).max())
            best = {kind: min(times) for kind, times in plain.items()}
            ratio = {kind: min(own) / time for kind, time in best.items()}
            pairs = {kind: [a / b for a, b in zip(own, times, strict=True)] for kind, times in plain.items()}
            median = {kind: statistics.median(ratios) for kind, ratios in pairs.items()}
            rows.append(Row(name, min(own), best, ratio, median, apart))
    return rows


def main():
    """Print the table; 1 where a limit is exceeded."""
    found = machine()
    print("no C compiler: ratios are not measured" if found is None else found)
    wrong = []
    for row in measure():
        print(f"\n{row.scene}: refweb {row.own:.2f} ns per element and step")
        for kind, plain in row.plain.items():
            limit = LIMITS[row.scene][kind]
            over = bool(row.ratio[kind] > limit)
            wrong += [f"{row.scene}, {kind}"] * over
            print(
                f"  {kind:5} {' '.join(FLAGS[kind]):20}{plain:7.2f} ns, ratio {row.ratio[kind]:.2f}, median "
                f"{row.median[kind]:.2f}, limit {limit}{' EXCEEDED' if over else ''}; last displacements "
                f"{row.apart[kind]:.1e} m apart"
            )
    print("\nabove the limit: " + "; ".join(wrong) if wrong else "\nall within their limits")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
