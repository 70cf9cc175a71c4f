"""What each effect costs in the explicit loop, and that one which a scene does not call for costs nothing.

    python -m validation.cost.effects

The tables are of the paper's square web, thrown, alone and with one effect more, of a web on a table, without friction
and with it, and of a net that is folded in two: nanoseconds per element and step of a whole run with its history rows
and peaks, without files and without a twin. CPU time, minimum of several warm runs that alternate, in this process, one
thread. Steps are as each scene has them.

Of lines that touch lines there are the nanoseconds of a candidate, a pair that does not touch, and of one that does.
Each line of one layer of a folded net lies across lines of the other, some thousand pairs at once, with lines 20 mm
thick that are 100 mm long, and with 2 mm. A net that is folded onto itself, each line on its like, is the worst there
is: each element touches seven of the other layer, and along the whole of one.

What is never executed costs nothing: valgrind counts the instructions of the plain web's steps and rows, once with the
package as it is and once with a copy of it in which every module that this run has not loaded is deleted, all effects
and all other solvers among them.
"""

from __future__ import annotations

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

import meshio
import numpy as np

import refweb
from refweb.dynamics.simulation import Simulation
from refweb.scene import Scene
from refweb.solution import Solution

PLAIN = {
    "title": "square web, thrown",
    "web": {"kind": "paper", "mesh": "square", "cable_length": 201.4},
    "cable": {"law": "tension-only", "modulus": 7e7, "area": 1e-4, "density": 200.0},
    "velocity": [{"node": "all", "value": [0.0, 0.0, 1.0]}],
    "solve": {"kind": "dynamic", "duration": 0.05},
    "output": {"interval": 1e-3, "frames": 1000},
    "accuracy": {"error": "none"},
}
BALL = {"name": "ball", "radius": 0.1, "mass": 1.0, "position": [0.0, 0.0, 0.11], "velocity": [0.0, 0.0, -1.0]}
BOX = BALL | {"shape": "box", "size": [0.2, 0.15, 0.1], "angular_velocity": [5.0, 3.0, 1.0]}
BOX.pop("radius")
CRATE = BOX | {"name": "crate", "position": [0.0, 0.0, 0.275], "velocity": [0.0, 0.0, -3.0]}
SOLID = {key: value for key, value in BOX.items() if key != "size"} | {"shape": "mesh"}
RUBBING = {"stiffness": 1e5, "friction": 0.3}
TABLE = {
    "title": "web on a table",
    "web": {"kind": "window", "mesh": "square", "rows": 11, "columns": 11, "side": 0.1},
    "cable": {"law": "tension-only", "modulus": 7e7, "area": 1e-6, "density": 1000.0},
    "supports": {"nodes": []},
    "gravity": {"acceleration": [0.0, 0.0, -9.81]},
    "velocity": [{"node": "all", "value": [1.0, 0.3, 0.0]}],
    "body": [
        {"name": "table", "shape": "box", "fixed": True, "size": [20.0, 20.0, 1.0], "position": [0.0, 0.0, -0.5]},
    ],
    "solve": {"kind": "dynamic", "duration": 0.4},
    "output": {"interval": 1e-2, "frames": 1},
    "accuracy": {"error": "none"},
}
CURVED = {key: value for key, value in PLAIN["cable"].items() if key != "modulus"}
CURVED |= {"law": "table", "stress": [[1e-3 * n, 7e4 * n] for n in range(20)]}
"""The cable of the web as a curve of 20 points, which is straight: the web moves in the same way."""
NEVER = "self contact that never touches"
LIMITS = {("square web, thrown", NEVER): 1.5, ("a net folded in two, radius 1 mm", "self contact"): 5.0}
"""Largest ratios to the same without."""
EFFECTS = {
    "gravity": {"gravity": {"acceleration": [0.0, 0.0, -9.81]}},
    "load": {"load": [{"node": "centre", "force": [0.0, 0.0, 1.0]}]},
    "motion": {"motion": [{"node": "rim", "displacement": [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0]]}]},
    "point mass": {"point_mass": [{"node": "centre", "mass": 1.0}]},
    "contact": {"body": [BALL], "contact": {"stiffness": 1e5}},
    "contact, a box that tumbles": {"body": [BOX], "contact": {"stiffness": 1e5}},
    "contact, two bodies": {"body": [BALL, CRATE], "contact": {"stiffness": 1e5, "between_bodies": True}},
    "attach": {"body": [BOX], "attach": [{"body": "ball", "node": "centre"}]},
    "attach, friction": {"body": [BOX], "attach": [{"body": "ball", "node": "centre"}], "contact": RUBBING},
    NEVER: {"self_contact": {"radius": 5e-3, "stiffness": 1e3}},
    "friction": {"body": [BALL], "contact": RUBBING},
    "friction at 1e-6 m/s": {"body": [BALL], "contact": RUBBING | {"slip_velocity": 1e-6}},
    "friction, damping": {"body": [BALL], "contact": RUBBING | {"damping": 0.1}},
    "frame": {"frame": {"angular_velocity": [0.0, 0.0, 1.0]}},
    "drag": {"drag": {"density": 1.2}},
    "orbit": {"orbit": {"mean_motion": 1.1e-3}},
    "rupture": {"rupture": {"strength": 1e12}},
    "pressure": {"pressure": [{"lines": "all", "normal": [0.0, 0.0, 1.0], "value": 0.1}]},
    "thrust": {"thrust": [{"node": 0, "line": 0, "force": 1.0}]},
    'law = "table"': {"cable": CURVED},
    "damping, time": {"damping": {"time": 1e-5}},
    "damping, rate": {"damping": {"rate": 1.0}},
    "viscous, one arm": {"cable": PLAIN["cable"] | {"viscous": {"arms": [[7e7, 1e-3]]}}},
    "lines that may yield": {"cable": PLAIN["cable"] | {"law": "elastic-plastic", "yield_stress": 1e5}},
    "bending": {"bending": {"stiffness": 1e-3}},
    "thread": {"thread": [{"name": "rope", "nodes": "rim", "modulus": 7e7, "area": 1e-4, "density": 200.0}]},
    "reel": {"reel": [{"lines": "all", "factor": [[0.0, 1.0], [1.0, 0.9]]}]},
    "temperature": {"temperature": {"expansion": 1e-5, "change": -10.0}},
}
AGREEMENT = 1e-3
"""Largest relative difference of the two counts, of what the interpreter does before the loop and after it."""

COUNTED = """
import ctypes, gc, json, sys
import refweb
from refweb.dynamics.schedule import row_times
from refweb.dynamics.simulation import Simulation

scene = refweb.Scene.from_dict(json.loads(sys.argv[1]))
refweb.run(scene)
solver = Simulation(scene, scene.build(), refweb.Solution(scene)).integrator
run, times = solver.start(), row_times(scene)
gc.disable()  # it would come when it likes
toggle = ctypes.CDLL(sys.argv[2]) if len(sys.argv) > 2 else None
if toggle:
    toggle.start()
history = solver.advance(run, times)
if toggle:
    toggle.stop()
own = [sys.modules[name].__file__ for name in sys.modules if name.partition(".")[0] == "refweb"]
print(json.dumps([own, run.nsteps, history.values[-1].tolist()]))
"""
TOGGLE = """
#include <valgrind/callgrind.h>
void start(void) { CALLGRIND_START_INSTRUMENTATION; }
void stop(void) { CALLGRIND_STOP_INSTRUMENTATION; }
"""


def torus(path, ring=0.07, tube=0.03, parts=50):
    """Write a torus of 2 parts² triangles as an STL file."""
    around, across = (2.0 * np.pi * np.arange(n) / n for n in (2 * parts, parts))
    points = np.stack(
        [
            np.outer(np.cos(around), ring + tube * np.cos(across)),
            np.outer(np.sin(around), ring + tube * np.cos(across)),
            np.tile(tube * np.sin(across), (2 * parts, 1)),
        ],
        axis=-1,
    )
    here = np.arange(2 * parts * parts).reshape(2 * parts, parts)
    on, up = np.roll(here, -1, axis=0), np.roll(here, -1, axis=1)
    both = np.roll(on, -1, axis=1)
    faces = np.concatenate(
        [np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((here, on, both), (here, both, up))]
    )
    meshio.write(path, meshio.Mesh(points.reshape(-1, 3), [("triangle", faces)]))
    return str(path)


def scenes(folder):
    """The plain scene, and it with each effect; files of bodies are written to a folder."""
    solid = {"body": [SOLID | {"file": torus(pathlib.Path(folder) / "torus.stl")}], "contact": {"stiffness": 1e5}}
    effects = EFFECTS | {"contact, a torus of 5000 faces": solid}
    return {"plain": Scene.from_dict(PLAIN)} | {name: Scene.from_dict(PLAIN | more) for name, more in effects.items()}


def on_a_table():
    """A web of which all lines lie on a table: they slide, and by friction they come to rest after 0.27 s."""
    rubbing = [{"friction": 0.4, "slip_velocity": slip} for slip in (1e-2, 1e-6)]
    contacts = [{}, *rubbing, {**rubbing[0], "damping": 0.1}]
    names = "no friction", "friction", "friction at 1e-6 m/s", "friction, damping"
    scene = {name: TABLE | {"contact": {"stiffness": 1e3, **one}} for name, one in zip(names, contacts, strict=True)}
    return {name: Scene.from_dict(one) for name, one in scene.items()}


def folded(folder, radius, gap=1.6, onto=False, size=24, side=0.1):
    """A net folded in two, its layers some radii apart, and the same untouched.

    It is folded along a line that is none of its own, or ``onto`` itself, so that each line lies on another.
    """
    points = np.array([(side * i, side * j, 0.0) for i in range(size + 1) for j in range(size + 1)])
    numbers = np.arange((size + 1) ** 2).reshape(size + 1, size + 1)
    pairs = ((numbers[:-1], numbers[1:]), (numbers[:, :-1], numbers[:, 1:]))
    across = np.array([1.0, 0.0 if onto else -0.3, 0.0]) / np.hypot(1.0, 0.0 if onto else 0.3)
    over = (points - [0.5 * size * side + (0.0 if onto else 0.037), 0.5 * size * side, 0.0]) @ across
    places = 0.98 * (points - 2.0 * np.outer(np.maximum(over, 0.0), across))
    places[:, 2] = np.where(over > 0.0, gap * radius, 0.0)
    path = pathlib.Path(folder) / f"folded_{radius:g}_{gap:g}_{onto}.csv"
    np.savetxt(path, places, delimiter=",", header="x,y,z", comments="")
    plain = PLAIN | {
        "title": f"a net folded {'onto itself' if onto else 'in two'}, radius {1e3 * radius:g} mm"
        + ("" if gap < 2.0 else ", apart"),
        "web": {
            "kind": "inline",
            "points": points.tolist(),
            "lines": np.vstack([np.column_stack([a.ravel(), b.ravel()]) for a, b in pairs]).tolist(),
            "supports": [],
        },
        "cable": {"law": "tension-only", "modulus": 7e7, "area": 1e-6, "density": 1000.0},
        "fold": {"kind": "positions", "file": str(path), "gap": 0.0},
        "output": {"interval": 5e-3, "frames": 1000},
    }
    touching = plain | {"self_contact": {"radius": radius, "stiffness": 1e-2}}
    rubbing = plain | {"self_contact": {"radius": radius, "stiffness": 1e-2, "friction": 0.3}}
    some = {"plain": plain, "self contact": touching, "self contact, friction": rubbing}
    return {name: Scene.from_dict(one) for name, one in some.items()}


def of_pairs(scene, times=200):
    """(Pairs, those that touch, ns of the push of each, ns of a pair that is apart) of a folded net at its start."""
    from refweb.effects.self_contact.search import near_pairs

    system = scene.build()
    term = next(term for term in system.terms if term.contact.crossing is not None)
    numbers = []
    for x, skin in ((system.laid, 0.0), (system.laid * [1.0, 1.0, 3.0], 0.05)):
        _, rows, data = near_pairs(skin, x, term.cells, term.data)
        out, force = np.zeros((len(rows), 1)), np.zeros_like(x)
        best = np.inf
        for _ in range(5):
            began = time.process_time()
            for _ in range(times):
                term.force(0.0, x, force, force, rows, data, out)
            best = min(best, 1e9 * (time.process_time() - began) / (times * len(rows)))
        numbers.append((len(rows), int((out > 0.0).sum()), best))
    (pairs, touching, push), (_, none, apart) = numbers
    assert none == 0
    return pairs, touching, push, apart


def timed(scene, system):
    """CPU time of a run and its follower per element and step [ns]."""
    simulation = Simulation(scene, system, Solution(scene))
    began = time.process_time()
    simulation.follow(None, lambda text, share: None)
    seconds = time.process_time() - began
    return 1e9 * seconds / (simulation.solution.solver["nsteps"] * len(system.net.cells)), simulation.solution.solver[
        "nsteps"
    ]


def measure(scenes, repeats=7):
    """Rows of (name, ns per element-step, ratio to the first, steps) of scenes by name."""
    made = {name: (scene, scene.build()) for name, scene in scenes.items()}
    found, steps = {name: [] for name in made}, {}
    for _ in range(1 + repeats):
        for name, one in made.items():
            cost, steps[name] = timed(*one)
            found[name].append(cost)
    best = {name: min(costs[1:]) for name, costs in found.items()}
    first = next(iter(best.values()))
    return [(name, cost, cost / first, steps[name]) for name, cost in best.items()]


def ran(package, cache, *toggle):
    """(files loaded, [steps, last row], standard error) of the plain scene with a copy of the package."""
    environment = os.environ | {"PYTHONPATH": str(package), "REFWEB_CACHE": str(cache), "PYTHONHASHSEED": "0"}
    environment |= {"NUMBA_CPU_NAME": "generic"}  # valgrind knows not every instruction that this machine has
    tool = ["valgrind", "--tool=callgrind", "--instr-atstart=no", "--callgrind-out-file=/dev/null"] if toggle else []
    command = [*tool, sys.executable, "-c", COUNTED, json.dumps(PLAIN), *map(str, toggle)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment, cwd=package)
    files, *rest = json.loads(done.stdout.splitlines()[-1])
    assert all(pathlib.Path(file).is_relative_to(package) for file in files)
    return [pathlib.Path(file) for file in files], rest, done.stderr


def counts():
    """(instructions with the whole package, with what the run loads alone, modules deleted, whether results agree).

    A text that says why instead where they cannot be counted.
    """
    for name in ("valgrind", "cc"):
        if shutil.which(name) is None:
            return f"no instructions counted: there is no {name}"
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder).resolve()
        source, toggle = folder / "toggle.c", folder / "toggle.so"
        source.write_text(TOGGLE)
        made = subprocess.run(["cc", "-shared", "-fPIC", "-o", toggle, source], capture_output=True, text=True)
        if made.returncode:
            return "no instructions counted: cc finds no valgrind/callgrind.h"
        whole, bare = folder / "whole", folder / "bare"
        package, ignore = pathlib.Path(refweb.__file__).parent, shutil.ignore_patterns("__pycache__")
        for place in (whole, bare):
            shutil.copytree(package, place / "refweb", ignore=ignore)
        loaded = {path.relative_to(whole) for path in ran(whole, folder / "cache")[0]}
        idle = [path for path in bare.rglob("*.py") if path.relative_to(bare) not in loaded]
        for path in idle:
            path.unlink()
        found = []
        for place in (whole, bare):
            ran(place, folder / "cache")  # compiles
            _, result, errors = ran(place, folder / "cache", toggle)
            found.append((int(re.search(r"Collected : (\d+)", errors)[1]), result))
    (with_all, one), (alone, other) = found
    return with_all, alone, len(idle), one == other


def main():
    """Print the table and the counts; the status says whether these agree, and ratios are within their limits."""
    above = 0
    with tempfile.TemporaryDirectory() as folder:
        groups = {"square web, thrown": scenes(folder), "web on a table": on_a_table()}
        for radius, gap, onto in ((1e-2, 1.6, False), (1e-3, 1.6, False), (1e-3, 1.6, True), (1e-3, 2.2, True)):
            some = folded(folder, radius, gap, onto)
            title = some["plain"].title
            groups |= {title: some}
            pairs, touching, push, apart = of_pairs(some["self contact"])
            print(f"{title}: {pairs} pairs, of which {touching} touch, {push:.0f} ns; apart {apart:.0f} ns")
        for title, some in groups.items():
            print(f"{title:32}{'per element-step':>18}{'ratio':>8}{'steps':>8}")
            for name, cost, ratio, steps in measure(some):
                limit = LIMITS.get((title, name), np.inf)
                said = "" if limit == np.inf else f"  limit {limit:g}{', EXCEEDED' if ratio > limit else ''}"
                above += ratio > limit
                print(f"{name:32}{cost:15.2f} ns{ratio:8.2f}{steps:8d}{said}")
    found = counts()
    if isinstance(found, str):
        print(found)
        return int(above > 0)
    whole, bare, deleted, same = found
    apart = abs(bare / whole - 1.0)
    print(f"instructions of the plain steps: {whole:,}; with {deleted} modules that it does not load deleted: {bare:,}")
    print(f"apart by {apart:.1e}, limit {AGREEMENT:.0e}; the results are {'the same' if same else 'DIFFERENT'}")
    return 0 if apart <= AGREEMENT and same and not above else 1


if __name__ == "__main__":
    sys.exit(main())
