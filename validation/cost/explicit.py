"""What a step costs: nanoseconds per element and step of whole explicit runs, beside plain C of the same arithmetic.

    python -m validation.cost.explicit

Two scenes: the square web hit by a ball, as shipped, and a taut cable of 100 elements that a point mass plucks. The
whole run is timed, from the first state to the results, with its history rows (every 1e-3 s) and peaks, and without
files, frames between the first and the last, or a twin. The C loop takes the same steps with the same cells and data:
kicks and drifts, tensions, contact, the impulse of the supports and the peaks of the same observables; it has no rows.
CPU time, minimum of several warm runs, both in this process, one thread.
"""

from __future__ import annotations

import ctypes
import pathlib
import shutil
import subprocess
import tempfile
import time

import numpy as np

from refweb.dynamics.simulation import Simulation
from refweb.effects.contact.nearest_point import AWAY, PENALTY, RADIUS
from refweb.net.net import AXIAL_STIFFNESS, LENGTH, REFERENCE
from refweb.scene import Scene
from refweb.solution import Solution

LIMITS = {"square web hit by a ball": 1.3, "cable of 100 elements": 1.4}
"""Largest ratio to the C loop."""

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


def compiled(folder):
    """The C loop as a function, or None where there is no compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        return None
    source, library = pathlib.Path(folder) / "loop.c", pathlib.Path(folder) / "loop.so"
    source.write_text(SOURCE)
    names = {"REFERENCE": REFERENCE, "LENGTH": LENGTH, "AXIAL": AXIAL_STIFFNESS}
    names |= {"RADIUS": RADIUS, "PENALTY": PENALTY, "AWAY": AWAY}
    flags = [f"-D{name}={value}" for name, value in names.items()]
    command = [compiler, "-O3", "-march=native", "-shared", "-fPIC", *flags, "-o", library, source, "-lm"]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(library)).run


def scenes():
    """The two scenes, without a twin."""
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
    return {"square web hit by a ball": Scene.from_dict(web), "cable of 100 elements": Scene.from_dict(cable)}


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


def c_run(loop, system, counts, sizes):
    """CPU time of the C loop over the same steps, its last displacement and its peaks."""
    net = system.net
    contact = next((f for f in system.families if f.contact), None)
    x, v = np.zeros((system.rows, 3)), system.initial_velocity()
    f, out, peaks = np.zeros_like(x), np.zeros((len(net.cells), 2)), np.zeros(3)
    inverse = np.where(system.supported, 0.0, 1.0 / net.mass[:, None])
    pairs = len(contact.cells) if contact else 0
    touch = contact.cells if contact else np.zeros((0, 3), dtype=np.int32)
    bodies = contact.data if contact else np.zeros((0, 8))
    pressed, impulse = np.zeros(max(pairs, 1)), np.zeros(3)
    held = np.flatnonzero(system.supported)
    address = lambda a: a.ctypes.data_as(ctypes.c_void_p)  # noqa: E731
    long, double = ctypes.c_long, ctypes.c_double
    arguments = (
        long(len(counts)), address(counts), address(sizes), long(system.rows), address(x), address(v), address(f),
        address(inverse), long(len(net.cells)), address(net.cells), address(net.line_data),
        long(net.line_data.shape[1]), address(out), long(pairs), address(touch), address(bodies), address(pressed),
        double(net.area[0]), address(peaks), long(len(held)), address(held), address(impulse),
    )  # fmt: skip
    f[:] = system.force(0.0, x)
    began = time.process_time()
    loop(*arguments)
    return time.process_time() - began, x, peaks


def measure(repeats=7):
    """Rows of (scene, ns per element-step of refweb, of C, ratio, largest difference of the last displacement)."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        loop = compiled(folder)
        for name, scene in scenes().items():
            system = scene.build()
            counts, sizes, run = steps_of(scene, system)
            work = counts.sum() * len(system.net.cells)
            whole_run(scene, system)
            own, plain, apart = [], [], np.nan
            for _ in range(repeats):
                own.append(whole_run(scene, system)[0])
                if loop is not None:
                    seconds, x, _ = c_run(loop, system, counts, sizes)
                    plain.append(seconds)
                    apart = np.abs(x - run.x).max()
            best = 1e9 * min(own) / work
            c = 1e9 * min(plain) / work if plain else np.nan
            rows.append((name, best, c, best / c, apart))
    return rows


def main():
    """Print the table."""
    print(f"{'scene':28}{'refweb':>10}{'plain C':>10}{'ratio':>8}{'limit':>8}{'last displacements apart':>28}")
    for name, own, plain, ratio, apart in measure():
        print(f"{name:28}{own:7.2f} ns{plain:7.2f} ns{ratio:8.2f}{LIMITS[name]:8.1f}{apart:26.1e} m")


if __name__ == "__main__":
    main()
