"""The house: rooms from the ground up, read off the imports themselves.

`ROOMS` stands from the bottom to the top, a row a room: its modules import only what stands above their row, or beside
them in the same room, and no chain of imports comes back to where it began. What a package knows and must not know is
the first sentence of its docstring. ``refweb/__init__.py`` is below all of them: it holds the version, and the names
that it exports are imported when they are used.
"""

import ast
import pathlib
import re
import subprocess

import pytest
from import_graph import MODULES, PACKAGES, at_head, imports, nodes_of, uses

import refweb
from refweb.registry import EFFECTS
from refweb.tables import Table

ROOMS = [  # room, its modules ("*": all in its folder), the first sentence of its docstring
    (
        "compiled",
        "*",
        "Kernels: their compilation, machine code on disk, and records that they read by one pointer.",
    ),
    ("the ground floor", "accepted errors findings messages tables kernels memory settings registry", ""),
    ("net.laws", "*", "Tension laws of lines: stress, tangent and energy over strain; they know nothing of nets."),
    (
        "net",
        "*",
        "The model: nodes, lines, lengths, laws, elements, mass, bodies; it knows no forces, time or solvers.",
    ),
    (
        "net.boundary",
        "*",
        "Solids that a surface of triangles bounds: read, checked, weighed, and how deep a point is in them.",
    ),
    ("net.shapes", "*", "Shapes of rigid bodies, one file a shape; they know nothing of contact."),
    (
        "effects",
        "*",
        "Effects: forces on a net, one file an effect; no effect knows another, a global matrix or a solver.",
    ),
    (
        "effects.contact",
        "*",
        "Contact of lines with bodies, and of bodies with each other: where, how deep, and all its forces.",
    ),
    (
        "effects.self_contact",
        "*",
        "Lines against lines: which are near, how they push each other apart, and what that takes from their motion.",
    ),
    (
        "effects.drag",
        "*",
        "Drag of a fluid on lines and bodies: its table, its force, and how explicit kicks solve for it.",
    ),
    (
        "system",
        "*",
        "M v' = f of a net: forces, tangent, mass, links and factorizations; it knows no scene, method or file.",
    ),
    (
        "results",
        "*",
        "Results: an instant, its observables, the solution and the folder; they do not know how they were computed.",
    ),
    (
        "results.observables",
        "*",
        "The numbers a run is asked for, a file for those that are alike: their value at an instant, and their probe.",
    ),
    ("pictures", "*", "A result folder drawn; it knows folders, and nothing of what made them."),
    (
        "pages",
        "*",
        "Pages of a run: its scene, results and pictures; they know records, and nothing of what made them.",
    ),
    (
        "reference",
        "*",
        "Reference of scene files: values by path, its tables in words and as a schema; it knows no scene.",
    ),
    ("the scene", "build scene", ""),
    ("statics", "*", "Equilibria and their bounds; it knows no time and no events."),
    (
        "dynamics.integrators",
        "*",
        "Integrators: a system through time, seen by probes; they know no scene, no files and no errors of results.",
    ),
    ("dynamics", "*", "A scene through time: start, rows, frames, errors; it does not know the command line."),
    ("what users hold", "solution", ""),
    ("studies", "*", "Runs about runs: errors of elements, horizons, modes and what digits cost."),
    ("the desk", "runner", ""),
    (
        "sweeps",
        "*",
        "Many runs of one scene: cases, workers, rows and statistics; it knows scenes and runs, and no command line.",
    ),
    (
        "gym",
        "*",
        "Gymnasium environments of scenes: spaces, episodes, images; they know stepped runs, and no command line.",
    ),
    (
        "sizing",
        "*",
        "Sizing: the least design of a scene that meets requirements; it knows studies and gradients, and no command "
        "line.",
    ),
    ("commands", "*", "The verbs of the command line, one file each; they know everything, and nothing knows them."),
    ("the door", "__main__", ""),
]
EFFECT = re.compile(r"(?:refweb\.)?effects\.([\w.]+)")


def texts(name):
    """Texts in a module's code, docstrings left out."""
    bare = {id(node.value) for node in nodes_of(name) if isinstance(node, ast.Expr)}
    nodes = (node for node in nodes_of(name) if isinstance(node, ast.Constant) and id(node) not in bare)
    return [node.value for node in nodes if isinstance(node.value, str)]


def room_of(name):
    """Number of the room of a module: that of the longest package that has one, or of the root."""
    if name in ROOT_ROOMS:
        return ROOT_ROOMS[name]
    parts = name.split(".")
    return next(FOLDERS[p] for p in (".".join(parts[:end]) for end in range(len(parts), 0, -1)) if p in FOLDERS)


FOLDERS = {room: number for number, (room, modules, _) in enumerate(ROOMS) if modules == "*"}
ROOT_ROOMS = {m: number for number, (_, modules, _) in enumerate(ROOMS) if modules != "*" for m in modules.split()}
INSIDE = sorted(MODULES.keys() - {""})


def test_every_module_has_a_room():
    root = {name for name in INSIDE if "." not in name} - PACKAGES
    assert root <= ROOT_ROOMS.keys(), f"no room for {root - ROOT_ROOMS.keys()}"
    assert len(root) <= 14, "a dozen files at the root: what is more belongs into a room"
    assert PACKAGES - {""} == FOLDERS.keys()


def test_no_arrow_goes_upwards():
    upwards = [(name, used) for name in INSIDE for used in uses(name) - {""} if room_of(used) > room_of(name)]
    assert not upwards, "a module imports one that stands above it"


def test_no_circle():
    """Packages count as what their ``__init__`` imports."""
    graph, done, path = {name: uses(name) - {"", name} for name in INSIDE}, set(), []

    def visit(name):
        assert name not in path, f"a circle of imports: {' → '.join([*path[path.index(name) :], name])}"
        if name not in done:
            path.append(name)
            for used in graph[name]:
                visit(used)
            done.add(path.pop())

    for name in INSIDE:
        visit(name)


@pytest.mark.parametrize("room", [room for room, *_ in ROOMS if room in PACKAGES])
def test_a_package_says_what_it_knows(room):
    sentence = next(sentence for name, _, sentence in ROOMS if name == room)
    assert sentence and " ".join(ast.get_docstring(MODULES[room]).split()).startswith(sentence)


def test_the_package_imports_nothing_at_its_head():
    head = [node for node in MODULES[""].body if isinstance(node, ast.Import | ast.ImportFrom)]
    assert head == [] and uses("") == {"messages", "registry"}


ELASTICITY = "effects.elasticity"
OWNERS = {reference.split(":")[0].removeprefix("refweb.") for reference in EFFECTS.values()} | {"effects.elasticity"}
"""Modules that hold an effect each."""


def named(name):
    """Effects that a module imports or names in a text of its code."""
    found = {used for used in uses(name) if used in OWNERS}
    return found | {f"effects.{match}" for text in texts(name) for match in EFFECT.findall(text)} & OWNERS


@pytest.mark.parametrize("name", sorted(OWNERS))
def test_no_effect_knows_another(name):
    assert not named(name) - {name}


def test_one_table_names_the_effects():
    """Elasticity, which every net has, is known to what reads lines as well."""
    found = {name: named(name) for name in INSIDE if not name.startswith("effects") and named(name)}
    assert found.pop("registry") == OWNERS - {"effects.elasticity"}
    assert found.keys() <= {
        "build",
        "results.state",
        "statics.adjoint",
        "statics.interior_point",
        "statics.bars",
        "statics.floating",
        "statics.lowest",
        "statics.monotone_loading",
        "system.system",
    }
    assert all(names == {"effects.elasticity"} for names in found.values())


def test_imports_from_outside():
    """Neither tests nor validation; libraries for pictures, files and SUNDIALS only inside functions."""
    wrong = []
    for name in MODULES:
        outside = {absolute.split(".")[0] for absolute in imports(name)}
        head = {found.split(".")[0] for node in at_head(MODULES[name]) for found in imports(name, node)}
        wrong += [(name, library) for library in outside & {"tests", "validation", "pytest"}]
        wrong += [(name, library) for library in head & {"pyvista", "matplotlib", "meshio", "sksundae", "PIL"}]
    assert not wrong


FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef


def functions(name):
    """Functions of a module, at any depth, and whether each is a factory: one that defines kernels inside of it."""
    for node in nodes_of(name):
        if isinstance(node, FUNCTIONS):
            inner = [n for n in ast.walk(node) if isinstance(n, FUNCTIONS) and n is not node]
            yield node, any("kernel" in ast.unparse(decorator) for n in inner for decorator in n.decorator_list)


def test_functions_and_files_are_short():
    """At most 14 parameters; 80 lines of code and docstring, but for factories of kernels; 700 lines a file."""
    long = []
    for name, module in MODULES.items():
        for node, factory in functions(name):
            parameters = len(node.args.posonlyargs + node.args.args + node.args.kwonlyargs)
            size = node.end_lineno - node.lineno + 1
            long += [f"{name}.{node.name} takes {parameters} parameters"] if parameters > 14 else []
            long += [f"{name}.{node.name} has {size} lines"] if size > 80 and not factory else []
        last = max((node.end_lineno for node in module.body), default=0)
        long += [f"{name} has {last} lines"] if last > 700 else []
    assert not long


def test_names_say_something():
    parts = {part for name in MODULES for part in name.split(".")}
    assert not parts & {"utils", "util", "helpers", "helper", "common", "manager", "misc"}


@pytest.mark.parametrize("name", refweb.__all__)
def test_exported_classes_are_described(name):
    """Their fields; of tables and their ``check`` what they refuse."""
    found = getattr(refweb, name)
    if isinstance(found, type) and not issubclass(found, Exception):
        assert re.search(r"\n    (Parameters|Attributes)\n    -{10}\n", found.__doc__)
        assert not issubclass(found, Table) or "\n    Raises\n    ------\n    InputError\n" in found.__doc__
        assert "check" not in vars(found) or found.check.__doc__


def test_the_top_level_has_the_folders_of_the_project():
    """What git keeps there: a result folder of a run is none of it."""
    root = pathlib.Path(__file__).parents[1]
    if not (root / ".git").exists():
        pytest.skip("not in a clone")
    files = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, text=True, check=True).stdout.split("\n")
    folders = {file.partition("/")[0] for file in files if "/" in file}
    assert folders == {"refweb", "tests", "validation", ".ci", ".github"}
