"""The order of the modules, read off their imports.

`LAYERS` stands from the bottom to the top. A module imports only modules of layers below its own, at its head and
inside its functions alike: what a solver sees is the system, what an effect sees is the net, and a scene alone knows
every effect's name. The package itself, ``refweb/__init__.py``, is below all of them: it holds the version, and the
names it exports are imported when they are used.
"""

import ast
import pathlib
import re

import pytest

import refweb
from refweb.inputs import Table

LAYERS = [
    ["inputs", "errors", "compiled", "units"],
    ["shapes", "memory", "vectors"],
    ["contact_points", "bodies"],
    ["shape_contacts"],
    ["penalty"],
    ["rubbing"],
    ["laws", "time_tables", "probes", "webs"],
    ["lattices", "single_cable", "given_webs", "cables", "settings"],
    ["elements"],
    ["lines"],
    ["stepping"],
    ["pattern", "factor"],
    ["effects"],
    ["lengths", "links"],
    ["effects.elasticity", "effects.gravity", "effects.load", "effects.motion", "effects.point_mass"]
    + ["effects.velocity", "effects.body", "effects.contact"]
    + ["effects.damping", "effects.bending"]
    + ["effects.frame", "effects.pressure", "effects.thrust"]
    + ["effects.reel", "effects.temperature", "effects.link"],
    ["system"],
    ["certificate", "interior", "spectrum", "spin_limit", "follower_loads", "massless"],
    ["statics", "central_difference"],
    ["nystrom"],
    ["implicit"],
    ["cvode"],
    ["ida"],
    ["relaxation"],
    ["state"],
    ["observables"],
    ["io"],
    ["solution"],
    ["scene", "starts", "choice"],
    ["dynamics"],
    ["accuracy", "horizon"],
    ["runner"],
    ["vibration", "ladders", "diagram"],
    ["work_precision"],
    ["views", "shots", "drawing"],
    ["console", "pictures"],
    ["__main__"],
]
LEVEL = {"": -1, **{name: level for level, names in enumerate(LAYERS) for name in names}}
ROOT = pathlib.Path(refweb.__file__).parent
EFFECT = re.compile(r"(?:refweb\.)?effects\.(\w+)")


def name_of(path):
    """Name of a module below the package, "" for the package itself."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): ast.parse(path.read_text(encoding="utf-8")) for path in sorted(ROOT.rglob("*.py"))}
PACKAGES = {"", "effects"}


def imported(name, node):
    """Absolute names that an import statement asks for; those of refweb begin with "refweb."."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    base = node.module or ""
    if node.level:
        here = ["refweb", *name.split(".")] if name else ["refweb"]
        here = here if name in PACKAGES else here[:-1]
        base = ".".join([*here[: len(here) - node.level + 1], *filter(None, [base])])
    return [f"{base}.{alias.name}" for alias in node.names]


def imports(name, tree=None):
    """Absolute names of all imports in a module."""
    nodes = ast.walk(MODULES[name] if tree is None else tree)
    return [found for node in nodes if isinstance(node, ast.Import | ast.ImportFrom) for found in imported(name, node)]


def at_head(tree):
    """Statements that run when a module is imported."""
    for node in tree.body:
        if not isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node
        elif isinstance(node, ast.ClassDef):
            yield from at_head(node)


def uses(name):
    """Modules of the package that a module imports, the longest name that is one."""
    found = set()
    for absolute in imports(name):
        parts = absolute.split(".")
        if parts[0] == "refweb":
            below = [".".join(parts[1:end]) for end in range(len(parts), 0, -1)]
            found.add(next(module for module in below if module in MODULES))
    return found


def texts(name):
    """Texts in a module's code, docstrings left out."""
    bare = {id(node.value) for node in ast.walk(MODULES[name]) if isinstance(node, ast.Expr)}
    nodes = (node for node in ast.walk(MODULES[name]) if isinstance(node, ast.Constant) and id(node) not in bare)
    return [node.value for node in nodes if isinstance(node.value, str)]


def test_every_module_has_a_layer():
    for name in MODULES:
        assert name in LEVEL, f"refweb/{name.replace('.', '/')}.py has no layer: give it its place in LAYERS"
    for name in LEVEL:
        assert name in MODULES, f"LAYERS names {name!r}, which is no module of refweb"
    assert len(LEVEL) == 1 + sum(map(len, LAYERS)), "a module stands twice in LAYERS"


@pytest.mark.parametrize("name", sorted(MODULES.keys() - {""}))
def test_imports_go_downwards(name):
    for used in uses(name):
        assert LEVEL[used] < LEVEL[name], f"{name} imports {used}, which is not below it"


def test_the_package_imports_nothing_at_its_head():
    head = [node for node in MODULES[""].body if isinstance(node, ast.Import | ast.ImportFrom)]
    assert head == [] and uses("") == {"inputs"}


def test_no_effect_knows_another():
    effects = {name for name in MODULES if name.startswith("effects.")}
    for name in effects:
        assert not uses(name) & effects - {name}, f"{name} imports another effect"
        assert not any(EFFECT.fullmatch(text) for text in texts(name))


def test_only_the_scene_names_the_effects():
    """The package exports them by name; elasticity, which every net has, is known to what reads lines as well."""
    named = {}
    for name in MODULES:
        found = {used.removeprefix("effects.") for used in uses(name) if used.startswith("effects.")}
        found |= {match for text in texts(name) for match in EFFECT.findall(text)}
        if found and not name.startswith("effects"):
            named[name] = found
    assert set(named) - {"", "scene"} <= {"state", "interior", "certificate", "system"}
    assert all(found == {"elasticity"} for name, found in named.items() if name not in ("", "scene"))
    effects = {name.removeprefix("effects.") for name in MODULES if name.startswith("effects.")}
    assert named["scene"] == effects and named[""] <= effects - {"elasticity"}


@pytest.mark.parametrize("name", sorted(MODULES))
def test_imports_from_outside(name):
    """Neither tests nor validation; libraries for pictures, files and SUNDIALS only inside functions."""
    outside = {absolute.split(".")[0] for absolute in imports(name)}
    assert not outside & {"tests", "validation", "pytest"}
    head = {found.split(".")[0] for node in at_head(MODULES[name]) for found in imports(name, node)}
    assert not head & {"pyvista", "matplotlib", "meshio", "sksundae", "PIL"}


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
