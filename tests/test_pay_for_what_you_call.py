"""What a scene does not call for is not there: no module of it is loaded, no entry of the tangent and no kernel waits.

Modules are those of a process of its own that runs one scene and nothing else: what its tables name in the registry,
what is imported inside functions for a reason that its tables give, and all that these import at their heads. Entries
of the pattern are counted from the lines of the web and the pairs that an effect couples, kernels from what the
compiled loop is called with.
"""

import itertools
import json
import os
import subprocess
import sys
import tomllib
import types
from functools import cache

import numpy as np
import pytest
from import_graph import loaded_with

import refweb
from refweb.dynamics.integrators import central_difference
from refweb.dynamics.schedule import FEW_CORNERS
from refweb.kernels import Functions, Record
from refweb.registry import EFFECTS, INTEGRATORS, LAWS, OBSERVABLES, SHAPES, STATICS, WEBS, load
from refweb.scene import SHIPPED_SCENES

# Modules

MESH = ("closed", "crossings", "distances", "field", "surface_file")
"""What a body from a file of triangles is made of."""
DEFAULT = [{"quantity": quantity} for quantity in ("displacement", "stress", "tension")]
"""What a scene observes that does not say."""
BASE = ("numpy", "numba", "numba.core.typing.cffi_utils", "platformdirs")
"""Libraries of every scene; each brings others along, and numba a part of its own once it types a function."""
LOADED = "print(json.dumps(sorted(sys.modules)), flush=True)"
PARENT = f"""
import json, os, sys
import {", ".join(BASE)}
for line in sys.stdin:
    child = os.fork()
    if not child:
        exec(json.loads(line))
        {LOADED}
        os._exit(0)
    print(json.dumps(os.waitpid(child, 0)[1]), flush=True)
"""
"""A process with the libraries of every scene, which take most of the time of a short run: its children run lines."""


def run(*lines):
    """Modules of a process that has run some lines."""
    program = "\n".join(["import json, sys", *lines, LOADED])
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout.splitlines()[-1]))


@pytest.fixture(scope="module")
def run_with_base():
    """The same as `run`, in a child of one process that has loaded `BASE`, where there is a fork."""
    if not hasattr(os, "fork"):
        yield run
        return
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", PARENT], **pipes) as p:

        def run_in_child(*lines):
            p.stdin.write(json.dumps("\n".join(lines)) + "\n")
            p.stdin.flush()
            modules = None
            while isinstance(printed := json.loads(p.stdout.readline()), list):
                modules = set(printed)
            assert printed == 0 and modules is not None
            return modules

        yield run_in_child
        p.stdin.close()


def libraries(modules):
    """Names of what stands outside of refweb and the standard library, scipy by its parts."""
    depth = lambda name: 3 if name.startswith("scipy.sparse.") else 2 if name.startswith("scipy.") else 1  # noqa: E731
    names = {".".join(name.split(".")[: depth(name)]) for name in modules}
    return {n for n in names if n.split(".")[0] not in sys.stdlib_module_names and not n.startswith("refweb")}


@cache
def brought(*names):
    return libraries(run(*(f"import {name}" for name in names)))


def registered(reference):
    """Module of an entry of the registry."""
    return reference.split(":")[0].removeprefix("refweb.")


def roots(given, method):
    """Modules that a scene calls for by its tables: entries of the registry, and what is imported inside functions."""
    static, bodies, contact = given["solve"]["kind"] == "static", given.get("body", ()), given.get("contact")
    law, follower, spun = (
        given["cable"]["law"],
        given.keys() & {"pressure", "thrust"},
        given.keys() & {"frame", "orbit"},
    )
    law, shapes = given["cable"]["law"], [body.get("shape", "sphere") for body in bodies]
    yield from ("runner", "build", "net.cable", "results.observables.observe")
    yield from ("statics.simulation", "statics.remarks") if static else ("dynamics.simulation",)
    yield registered(STATICS[method] if static else INTEGRATORS[method].integrator)
    yield registered(WEBS[given["web"]["kind"]])
    yield from (registered(EFFECTS[effect]) for effect in given.keys() & EFFECTS.keys())
    for observe in given.get("observe", DEFAULT):
        yield registered(OBSERVABLES["length" if "thread" in observe else observe["quantity"]])
    yield from (registered(SHAPES[shape]) for shape in shapes)
    cable = given["cable"]
    laws = {law, *(group.get("law", law) for group in cable.get("groups", {}).values())}
    yield from (registered(LAWS[name]) for name in laws)
    if "elastic-plastic" in laws:
        yield "effects.plastic"
    explicit = not static and method not in ("cvode", "ida")
    if explicit and len(laws) == 1 and "table" not in laws:  # one law without numbers of its own
        yield "effects.line_blocks"
    if "viscous" in cable:
        yield "effects.viscous"
    if given["web"].get("path", "").endswith(".csv"):
        yield "net.csv_files"
    if "fold" in given or "positions" in given["web"]:
        yield "effects.fold"
    free = [body for body in bodies if not body.get("fixed")]
    if "attach" in given:
        yield "system.attached_nodes"
    if static and any("attach" in given or body.get("shape", "sphere") != "sphere" for body in free):
        yield "system.resting_bodies"
    if "throw" in given:
        yield "results.throw"
    if any("axle" in body for body in bodies):
        yield "effects.axle"
    if "gym" in given:
        yield from ("sweeps.episodes", "dynamics.controllers")  # inputs are checked as those of controls are
    if "control" in given:
        yield "dynamics.controllers"
    if any("body" in load for load in given.get("load", ())):
        yield "effects.body_load"
    if any(len(reel["factor"]) > FEW_CORNERS for reel in given.get("reel", ())):
        yield "dynamics.breakpoints"
    if any("around" in thread for thread in given.get("thread", ())):
        yield from ("effects.around", "effects.half_turns", "effects.winding", "system.contact_forces")
        if not static:
            yield "dynamics.half_turns"
    if "winch" in given or any("friction" in thread for thread in given.get("thread", ())):
        yield from ("effects.thread_friction", "effects.thread_slips")
    if any("lines" in winch for winch in given.get("winch", ())):
        yield "effects.wound_lines"
    if any("power" in winch for winch in given.get("winch", ())):
        yield "effects.winch_power"
    if any(reel.get("mass") == "follows" for reel in given.get("reel", ())):
        yield "system.material_flow"
    heavy = [body for body in bodies if "mass" in body]
    if any(body["shape"] in ("cylinder", "box") and "inertia" not in body for body in heavy if "shape" in body):
        yield "net.solid"
    if spun and any(body.get("shape") in ("cylinder", "box", "mesh") for body in heavy):
        yield "effects.turning_bodies"
    if "mesh" in shapes:
        yield from ("effects.contact.nonconvex_contacts", *(f"net.boundary.{name}" for name in MESH))
    if any(body.get("file") == "envisat.obj" for body in bodies):  # its parts overlap
        yield from ("net.boundary.repair", "net.boundary.winding")
    if not static and len(bodies) > 1 and not (contact or {}).get("between_bodies"):
        yield "effects.contact.undetected_overlap"  # bodies that overlap in silence
    if "self_contact" in given:
        yield from (f"effects.self_contact.{name}" for name in ("line_line_ccd", "penetration", "line_line_penalty"))
    if not static and given.get("accuracy", {}).get("error") != "none":
        yield "dynamics.twin_error"
    if contact is not None:
        yield from contact_roots(contact, shapes, static)
    if method in ("cvode", "ida"):
        yield from ("system.sparsity", "system.contact_forces")
    if not static and given["solve"].get("start") != "equilibrium":
        return
    yield from ("statics.remarks", "system.sparsity", "system.unsupported_parts")
    if method != "relaxation":
        yield "statics.load_steps"
    if spun:
        yield "statics.critical_speed"
    elif law in ("tension-only", "table") and not (static and free):
        yield "statics.duality_bound"
    if law == "linear":  # bars, which may snap through
        yield "statics.snap_through"
    if law not in ("tension-only", "table") or follower or spun or contact is not None or static and free:
        yield "statics.stability"  # the energy is not convex
    if follower:
        yield "statics.residual_search"
    elif len(given["solve"].get("load_steps", [1.0])) > 1 and law == "tension-only" and not bodies:
        yield "statics.predictor"


def contact_roots(contact, shapes, static):
    """The same of contact."""
    keys = contact.keys() | {key for own in contact.get("bodies", {}).values() for key in own}
    yield from (
        ("statics.body_penetration", "system.contact_forces")
        if static
        else ("effects.contact.penetration", "results.observables.overlap")
    )
    if keys & {"damping", "friction"}:
        yield "effects.contact.line_body_friction"
    elif "exponent" in keys or set(shapes) != {"sphere"}:
        yield "effects.contact.penalty"
    if static and set(shapes) - {"sphere"}:
        yield "effects.contact.sharp_edges"
    if keys & {"damping", "friction", "exponent"} and "mesh" not in shapes or set(shapes) - {"sphere", "mesh"}:
        yield "net.grown_core"  # a surface of triangles has no core of its own
    if "sphere" in shapes and "exponent" not in keys:
        yield "effects.contact.sphere"


def called(given):
    """(modules of refweb, libraries) that a scene calls for, from its tables."""
    solve, web = given["solve"], given["web"]["kind"]
    method = solve.get("method", "newton" if solve["kind"] == "static" else "central-difference")
    modules, outside = loaded_with(roots(given, method)), list(BASE)
    rests = solve["kind"] == "static" or solve.get("start") == "equilibrium"
    factorized = "system.factorization" in modules
    if factorized and web == "paper" and (solve["kind"] == "dynamic" or given["web"].get("mesh") == "hexagon"):
        modules.add("system.supernodal")
    if given["cable"].get("order", 1) > 1:
        modules.add("net.curved")
    if given["cable"].get("order", 1) > 1 or rests or method in ("cvode", "ida"):
        outside.append("skfem")  # dofs of what has a matrix
    joined = given.keys() & {"self_contact", "thread"}
    apart = "net.boundary.repair" in modules
    if "mesh" not in given["web"] or joined or rests or factorized or apart:  # parts, neighbours
        outside.append("scipy.sparse.csgraph")
    if factorized:
        outside.append("qdldl")
    if method in ("cvode", "ida"):
        outside.append("sksundae")
    if any(body.get("shape") == "mesh" for body in given.get("body", ())):
        outside.append("meshio")
    if given["cable"]["law"] == "table":
        outside.append("scipy.interpolate")  # PCHIP
    if web == "cable":
        outside.append("scipy.optimize")  # a root
    if '"corners"' in json.dumps(given) or "effects.fold" in modules:
        outside.append("scipy.spatial")  # a hull, or lines near each other
    return modules, outside


def brief(name, **solve):
    """The tables of a shipped scene, changed; in dynamics of two rows, or of its longest average."""
    given = tomllib.loads((SHIPPED_SCENES / f"{name}.toml").read_text(encoding="utf-8"))
    if given["solve"]["kind"] == "dynamic":
        averages = (one.get("average", 0.0) for one in given.get("observe", ()))
        interval = given.get("output", {}).get("interval", 0.01 * given["solve"]["duration"])
        solve = {"duration": max(2.0 * interval, *averages), **solve}
    given["solve"] |= solve
    return given


SCENES = {path.stem: brief(path.stem) for path in sorted(SHIPPED_SCENES.glob("*.toml"))}
SCENES["by cvode"] = brief("square-impact", method="cvode")
SCENES["by ida"] = brief("square-impact", method="ida")
SCENES["by relaxation"] = brief("catenary", method="relaxation")
SCENES["by relaxation"]["cable"] |= {"law": "linear"}
SCENES["a curve"] = brief("square-load", load_steps=[1.0])
SCENES["a curve"]["cable"] = {
    "law": "table",
    "stress": [[0, 0], [0.01, 5e5], [0.02, 2e6]],
    "area": 1e-4,
    "density": 1.0,
}
SCENES["arms"] = brief("square-impact")
SCENES["arms"]["cable"] |= {"viscous": {"arms": [[7e7, 1e-3]]}}
SCENES["a brake"] = {
    "web": {"kind": "inline", "points": [[0, 0, 0], [0, 0, -1]], "lines": [[0, 1]]},
    "cable": {"law": "tension-only", "modulus": 1e9, "area": 1e-4, "density": 1000.0},
    "winch": [{"lines": [0], "speed": 0.0, "limit": 10.0}],
    "gravity": {"acceleration": [0.0, 0.0, -9.81]},
    "supports": {"nodes": [0]},
    "solve": {"kind": "dynamic", "duration": 1e-3},
    "accuracy": {"error": "none"},
}
SCENES["a platform"] = {
    "web": {"kind": "inline", "points": [[-1, 0, 2], [1, 0, 2], [-1, 0, 0], [1, 0, 0]], "lines": [[0, 2], [1, 3]]},
    "cable": {"law": "tension-only", "modulus": 1e9, "area": 1e-4, "density": 1000.0},
    "gravity": {"acceleration": [0.0, 0.0, -9.81]},
    "body": [{"name": "beam", "shape": "box", "size": [2.0, 0.2, 0.2], "mass": 100.0, "position": [0.0, 0.0, 0.0]}],
    "attach": [{"body": "beam", "node": [2, 3]}],
    "supports": {"nodes": [0, 1]},
    "solve": {"kind": "static"},
}


ALIKE = (
    "triangle-impact",
    "hexagon-impact",
    "square-oblique-impact",
    "triangle-load",
    "hexagon-load",
    "published-throw",
    "square-load",
    "spun-tight",
    "falling-net",
    "capture-satellite",
    "four-satellites",
    "spinning-web",
    "tethered-web",
    "ring-on-slack-cable",
    "by ida",
    "reeled-tether",
    "winch-drum",
    "drawstring",
    "platform-on-ropes",
    "closing-net",
    "arms",
    "four-satellites",
    "net-capture",
    "corner-control",
    "catenary",
    "ring-on-thread",
)
"""Scenes that call for what others call for, on another web, or each part of which others call for."""


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in ALIKE)) for n in SCENES])
def test_a_run_loads_what_its_scene_calls_for(name, run_with_base):
    given = SCENES[name]
    modules, outside = called(given)
    scene = f"refweb.Scene.from_dict(json.loads({json.dumps(given)!r}), {str(SHIPPED_SCENES)!r})"
    loaded = run_with_base("import refweb", f"refweb.run({scene})")
    if "scipy.linalg" in loaded and "scipy.linalg" not in brought(*outside):  # numba loads it to compile
        loaded = run_with_base("import refweb", f"refweb.run({scene})")
    own = {m.removeprefix("refweb.") for m in loaded if m.startswith("refweb.")}
    assert own == modules, f"not called for: {sorted(own - modules)}, not seen: {sorted(modules - own)}"
    assert libraries(loaded) <= brought(*outside), sorted(libraries(loaded) - brought(*outside))


def test_the_package_alone_loads_nothing():
    loaded = run("import refweb")
    assert libraries(loaded) <= libraries(run()) and {m for m in loaded if m.startswith("refweb")} == {"refweb"}


def test_libraries_are_told_apart():
    """The comparison above is of names that are there: what is left out of `BASE` is seen."""
    pictures = {"pyvista", "vtkmodules", "matplotlib", "PIL", "meshio"}
    assert not brought(*BASE) & (pictures | {"sksundae", "qdldl", "scipy.optimize", "scipy.spatial"})
    assert {"matplotlib", "scipy.optimize", "scipy.spatial"} <= brought("matplotlib", "scipy.optimize")


# Entries and kernels

PLAIN = {
    "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.5},
    "cable": {"law": "tension-only", "modulus": 7e7, "area": 1e-4, "density": 200.0},
    "solve": {"kind": "dynamic", "duration": 1e-3},
    "output": {"interval": 1e-3},
    "accuracy": {"error": "none"},
}
BALL = {"name": "ball", "radius": 0.1, "mass": 1.0, "position": [0.0, 0.0, -0.3], "velocity": [0.0, 0.0, 1.0]}
WALL = {"name": "wall", "radius": 0.1, "position": [0.0, 5.0, 0.0], "fixed": True}
TABLES = {
    "gravity": {"acceleration": [0.0, 0.0, -9.81]},
    "load": {"node": 5, "force": [0.0, 0.0, 1.0]},
    "motion": {"node": 6, "displacement": [[0.0, 0.0, 0.0, 0.0], [1.0, 0.1, 0.0, 0.0]]},
    "point_mass": {"node": 5, "mass": 1.0},
    "velocity": {"node": 5, "value": [0.0, 0.0, 1.0]},
    "body": BALL,
    "contact": {"stiffness": 1e4},
    "attach": {"body": "wall", "node": 9},
    "link": {"nodes": [5, 6]},
    "thread": {"name": "rope", "nodes": [5, 6, 10], "modulus": 1e9, "area": 1e-6, "density": 1.0},
    "frame": {"angular_velocity": [0.0, 0.0, 1.0]},
    "orbit": {"mean_motion": 1.0},
    "drag": {"density": 1.2},
    "pressure": {"lines": [0, 1], "normal": [0.0, 0.0, 1.0], "value": 1.0},
    "thrust": {"node": 4, "line": 0, "force": 1.0},
    "damping": {"time": 1e-4},
    "bending": {"stiffness": 1e-3},
    "self_contact": {"radius": 1e-3},
    "reel": {"lines": [2, 3], "factor": [[0.0, 1.0], [1.0, 0.9]]},
    "winch": {"thread": "rope", "end": "last", "tension": 10.0},
    "temperature": {"expansion": 1e-5, "change": 10.0},
    "rupture": {"strength": 1e9},
    "fold": {"ratio": 0.5, "gap": 0.0},
}
SOLVED = ("detection", "law")
LISTED = ("force", "force in steps", "energy", "bound", "bound of damping", *SOLVED)
LISTED += ("relax", "motion", "work of lengths", "impulse", "near", "within", "ahead", "collisions", "probe")
TERM = {"force": 1, "energy": 1, "bound": 1}
KERNELS = {name: TERM for name in ("gravity", "load", "contact", "pressure", "thrust", "bending", "thread")}
KERNELS |= {name: {**TERM, "impulse": 1} for name in ("gravity", "load")}
KERNELS |= {name: {**TERM, "near": 1} for name in ("contact", "self_contact")}
KERNELS["self_contact"] |= {"collisions": 2}  # with lines, and with neighbours along the net
KERNELS["contact"] |= {"collisions": 1}
KERNELS["attach"] = {"motion": 1}  # to a body that is fixed
KERNELS |= {"damping": {**TERM, "bound of damping": 1}, "motion": {"motion": 1}}
KERNELS["frame"] = {"force": 2, "energy": 2, "bound": 2, "bound of damping": 1}  # centrifugal and Coriolis
KERNELS["orbit"] = KERNELS["frame"]
KERNELS["rupture"] = TERM
KERNELS["drag"] = {**TERM, **dict.fromkeys(SOLVED, 1)}
KERNELS["winch"] = {**dict.fromkeys(TERM, 3), "relax": 1}  # beside the thread: what it stores, loses and winds
KERNELS |= {name: {} for name in ("reel", "temperature", "point_mass", "velocity", "body", "fold")}
"""Kernels that each effect adds to the lists of the compiled loop, which takes no links."""


def scene_of(*effects):
    given = dict(PLAIN)
    for name in effects:
        given[name] = [TABLES[name]] if load(EFFECTS[name]).several else TABLES[name]
    if "contact" in effects:
        given["body"] = [BALL]
    if "attach" in effects:
        given["body"] = [*given.get("body", []), WALL]
    if "winch" in effects:
        given["thread"] = [TABLES["thread"]]
    if "fold" in effects:
        given["supports"] = {"nodes": []}
    if "link" in effects:
        given["solve"] = {**given["solve"], "method": "ida"}
    return refweb.Scene.from_dict(given)


def entries(*effects):
    """Places (row and axis, row and axis) of the pattern of a scene with some effects."""
    system = scene_of(*effects).build()
    pattern = system.pattern
    column = np.repeat(np.arange(pattern.size), np.diff(pattern.indptr))
    return set(zip(system.free[pattern.indices].tolist(), system.free[column].tolist(), strict=True))


def coupled(pairs, held, rows):
    """The same from pairs of rows that feel each other, rows that are held, and the number of rows."""
    both = {(i, j) for a, b in pairs for i, j in ((a, b), (b, a), (a, a), (b, b)) if i not in held and j not in held}
    places = {(3 * i + p, 3 * j + q) for i, j in both for p in range(3) for q in range(3)}
    return places | {(3 * i + p, 3 * i + p) for i in range(rows) if i not in held for p in range(3)}


def continued(web):
    """Pairs of the outer nodes of two lines that continue each other."""
    ends = {}
    for a, b in web.lines.tolist():
        for here, there in ((a, b), (b, a)):
            ends.setdefault(here, []).append(there)
    unit = lambda a, b: (web.points[b] - web.points[a]) / np.linalg.norm(web.points[b] - web.points[a])  # noqa: E731
    return [
        (a, c)
        for b, around in ends.items()
        for i, a in enumerate(around)
        for c in around[:i]
        if unit(a, b) @ unit(b, c) > np.cos(np.pi / 6.0)
    ]


def apart(web, one, other):
    """Whether two nodes stand on two lines that share none."""
    first, last = (web.lines[(web.lines == node).any(axis=1)] for node in (one, other))
    return (first[:, None, :, None] != last[None, :, None, :]).all(axis=(2, 3)).any()


def expected(*effects):
    web = scene_of().build().net.web
    pairs, held, rows = web.lines.tolist(), set(web.rim.tolist()), len(web.points)
    if "fold" in effects:  # which nothing may hold
        held = set()
    if "bending" in effects:
        pairs = pairs + continued(web)
    if {"thread", "winch"} & set(effects):  # every node of it with every other
        pairs = pairs + list(itertools.combinations(TABLES["thread"]["nodes"], 2))
    if "self_contact" in effects:  # every line with every other
        pairs = pairs + [(one, other) for one in range(rows) for other in range(one) if apart(web, one, other)]
    if "motion" in effects:
        held = held | {TABLES["motion"]["node"]}
    if {"body", "contact"} & set(effects):
        rows += 1
    if "contact" in effects:
        pairs = pairs + [(node, rows - 1) for node in range(rows - 1)]
    if "attach" in effects:  # behind the ball, where there is one
        held, rows = held | {TABLES["attach"]["node"], rows}, rows + 1
    if {"frame", "orbit"} & set(effects):  # the axes of a row with each other
        pairs = pairs + [(row, row) for row in range(rows)]
    if "drag" in effects and {"body", "contact"} & set(effects):
        pairs = pairs + [(len(web.points), len(web.points))]
    return coupled(pairs, held, rows)


def test_every_effect_is_here():
    assert TABLES.keys() == EFFECTS.keys() == KERNELS.keys() | {"link"}


def all_but(name):
    """All effects but one: contact and its body are one, and an orbit stands only without what it excludes."""
    excluded = load(EFFECTS["orbit"]).excludes
    absent = {name, "contact" if name == "body" else name, *(excluded if name in excluded else ["orbit"]), "fold"}
    return [other for other in EFFECTS if other not in absent]


@pytest.mark.parametrize("name", [None, *EFFECTS])
def test_entries_with_an_effect_alone(name):
    effects = [name] if name else []
    assert entries(*effects) == expected(*effects)


@pytest.mark.parametrize("name", EFFECTS)
def test_entries_without_an_effect(name):
    rest = all_but(name)
    assert entries(*rest) == expected(*rest)


def tables(record):
    """Tables of kernels in a record and in its records, one after another."""
    for value in record.by_name().values():
        if isinstance(value, Functions):
            yield value
        elif isinstance(value, Record):
            yield from tables(value)


@pytest.fixture
def handed(monkeypatch):
    """Numbers of kernels in the lists that the compiled loop is handed for a scene with some effects."""

    def count(*effects):
        seen, solver = [], central_difference.CentralDifference(scene_of(*effects).build())
        solver.prepare()
        with monkeypatch.context() as patched:
            called = types.SimpleNamespace(call=lambda *given: seen.append(given) or 1)
            patched.setattr(central_difference, "advance_rows", called)
            solver.advance(solver.start(), [1e-3])
        counts = [len(table) for given in seen[0] if isinstance(given, Record) for table in tables(given)]
        return dict(zip(LISTED, counts, strict=True))

    return count


def summed(*effects):
    """The same from `KERNELS`; a web alone has its elasticity, and one work of lengths serves all that change them."""
    total = dict.fromkeys(LISTED, 0) | TERM | {"force in steps": 1}
    for name in effects:
        for which, number in KERNELS[name].items():
            total[which] += number * (2 if name == "drag" and {"body", "contact"} & set(effects) else 1)
    for which in TERM if "winch" in effects and "thread" not in effects else ():
        total[which] += 1  # its thread
    total["work of lengths"] = int(bool({"reel", "temperature"} & set(effects)))
    for which in TERM if "damping" in effects and total["work of lengths"] else ():
        total[which] += 1  # the work of lengths against damping
    return total


@pytest.mark.parametrize("name", [None, *KERNELS])
def test_kernels_with_an_effect_alone(handed, name):
    effects = [name] if name else []
    assert handed(*effects) == summed(*effects)


def test_kernels_of_friction(handed, monkeypatch):
    """A second term, with the four kernels that solve for it, and no bound of damping."""
    monkeypatch.setitem(TABLES, "contact", {**TABLES["contact"], "friction": 0.3})
    rubbing = {**summed("contact"), "force": 3, "energy": 3, "bound": 3, **dict.fromkeys(SOLVED, 1)}
    assert handed("contact") == rubbing


def test_what_a_winch_of_constant_power_adds(handed, monkeypatch):
    """A term that takes its two unknowns over a step, and these in the pattern, with nodes of the thread."""
    others = entries("winch")
    rows = scene_of("winch").build().rows
    monkeypatch.setitem(TABLES, "winch", {"thread": "rope", "end": "last", "power": 10.0, "speed_limit": 1.0})
    powered = summed("winch")
    assert handed("winch") == {which: number + (which in (*TERM, "relax")) for which, number in powered.items()}
    more = entries("winch") - others
    assert others < entries("winch") and all(max(i, j) // 3 >= rows - 3 for (i, j) in more)


@pytest.mark.parametrize("name", KERNELS)
def test_kernels_without_an_effect(handed, name):
    rest = [other for other in all_but(name) if other in KERNELS]
    assert handed(*rest) == summed(*rest)


# Machine code

FILLED = "from refweb.compiled import numba_internals as n; print(*(s for s, slot in n._slots.items() if slot.filled))"
MANY = 70
"""Kernels of a plain impact, at most: some forty of the loop, and those of its effects and observables."""
ABSENT = (
    "inner_stages", "advance_rotation", "carry_nodes", "move_supports", "set_lengths", "set_masses", "exchange_masses",
    "viscous_kick", "contact_kick", "narrow_all", "step_by_pairs",
    "take_pairs", "stays_free", "set_push", "average", "note_events", "look_at_books", "book_powers",
    "add_half_steps", "turning", "more_kinetic", "relax", "set_growth",
)  # fmt: skip
"""Kernels of the loop that a plain impact has no use for: stages, bodies that turn or carry, motion, reels, damping,
friction, lines on lines, integrated impulses, averages, events, energies as observables, angular momentum, arms."""


def machine_code(*changes):
    """Names of the kernels whose machine code a process has that runs an impact for two rows."""
    lines = [
        "import refweb",
        "scene = refweb.Scene.load('square-impact', {'solve.duration': 2e-3, 'output.interval': 1e-3})",
        *changes,
        "refweb.run(scene)",
        FILLED,
    ]
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=True)
    return [name.removeprefix("refweb.").rpartition(".")[0] for name in done.stdout.split()]


@pytest.mark.parametrize("method, least", [("central-difference", 30), ("cvode", 10)])
def test_a_plain_impact_has_machine_code_of_nothing_else(method, least):
    """The loop of explicit steps, and the books of dense output."""
    plain = "scene = scene.replace(observe=(refweb.Observe(name='d', quantity='displacement', reduce='max'),))"
    names = machine_code(plain, f"scene = scene.replace(solve=type(scene.solve)(duration=2e-3, method={method!r}))")
    assert least < len(names) <= MANY, len(names)
    called = {name.rpartition(".")[2] for name in names}
    assert {"note_momentum", "book_energies"} <= called and not set(ABSENT) & called


def test_a_check_has_no_machine_code_of_the_loop():
    """It says how large steps are, beside damping as well, for which it compares bounds."""
    checked = "main(['check', 'square-impact', '--set', 'damping.rate=1.0'])"
    lines = ["from refweb.__main__ import main", checked, FILLED]
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=True)
    names = {name.rpartition(".")[0].rpartition(".")[2] for name in done.stdout.splitlines()[-1].split()}
    assert "safe_step" in names and not names & {"advance_rows", "run_steps", "begin_forces", "viscous_kick"}, names


def test_an_effect_brings_its_own_machine_code_alone():
    """Damping by mass: its force, bounds and impulse, the kick that is iterated, and the book of its power."""
    plain = "scene = scene.replace(observe=(refweb.Observe(name='d', quantity='displacement', reduce='max'),))"
    damped = "scene = scene.replace(effects=(*scene.effects, refweb.Damping(rate=1.0)))"
    without, more = set(machine_code(plain)), set(machine_code(plain, damped))
    added = {name for name in more - without}
    assert without <= more and any("viscous_kick" in name for name in added)
    assert len(added) <= 9, added
