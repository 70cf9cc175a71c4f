"""Types: the package has no errors to a type checker, and to users theirs are shown as they write.

The public interface is annotated as a whole: what ``refweb`` exports, all kinds of tables, shapes and observables, base
classes of plug-ins, what pages on plug-ins import, and what is handed to plug-ins.

The checker is basedpyright, a pyright that downloads nothing, with what ``pyproject.toml`` says of it. It reads refweb
and a script of a user in one go. Of pyvista, whose types take it a third of its time, the first run is told nothing.
"""

import ast
import functools
import importlib
import inspect
import json
import pathlib
import subprocess
import sys

import packages
import pytest

import refweb
from refweb import registry

ROOT = pathlib.Path(refweb.__file__).parents[1]

SCRIPT = """
import numpy as np
import refweb

web = refweb.Web(points=[[0, 0, 0], [1, 0, 0]], lines=np.array([[0, 1]]), rim=[0, 1])
cable = refweb.Cable(modulus=1e9, area=1e-6, density=1000.0, groups={"rim": refweb.Group(area=2e-6)})
scene = refweb.Scene(
    web=web,
    cable=cable,
    effects=[refweb.Gravity(acceleration=(0, 0, -9.81)), refweb.Load(node="centre", force=np.zeros(3))],
    solve=refweb.Dynamic(duration=1.0),
    observe=[refweb.Observe(name="sag", quantity="displacement", node="centre")],
)
solution = refweb.run(scene)
print(solution.positions[0], solution.results["sag"].value, refweb.modes(scene).frequency[0], cable.area / 2.0)
"""
MISTAKES = {
    "refweb.Cable(modulos=1)": "modulos",
    "refweb.Cable(modulus=1e9, area=1e-6, density=1.0, order='second')": "order",
    "refweb.Scene(web=web, cable=refweb.Gravity(acceleration=(0, 0, 1)))": "cable",
    "refweb.Solve": "Solve",
    "solution.position": "position",
    "scene.title / 2": "str",
}
"""What a user may write wrongly, each with a word of what is to be said of it."""


PAGES = [
    "refweb.effects",
    "refweb.net.laws",
    "refweb.net.rigid_body",
    "refweb.results.observables",
    "refweb.dynamics.integrators",
    "refweb.commands",
]
"""Modules whose docstrings say how to write a plug-in."""
HANDED = [
    "refweb.dynamics.integrators.integrator:History",
    "refweb.dynamics.integrators.integrator:IntegratorState",
    "refweb.net.net:Net",
    "refweb.net.rigid_body:RigidBody",
    "refweb.results.state:State",
    "refweb.statics.equilibrium:Equilibrium",
    "refweb.system.system:System",
]
"""Classes of what plug-ins are given."""


def public():
    """Functions and classes of the public interface by their names as ``"module:name"``."""
    tables = registry.EFFECTS, registry.SHAPES, registry.OBSERVABLES, registry.PARTS, registry.LISTS, registry.SOLVES
    names = {*registry.exports().values(), *HANDED, *(name for table in tables for name in table.values())}
    names |= {kind.base for kind in registry.KINDS.values() if kind.base}
    for page in PAGES:
        source = packages.blocks(inspect.getdoc(importlib.import_module(page)))[0]
        imports = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ImportFrom)]
        names |= {f"{n.module}:{a.name}" for n in imports if n.module.startswith("refweb") for a in n.names}
    return {name: registry.load(name) for name in names if isinstance(name, str)}


def functions(name, value):
    """Functions of a public function or class, with those of its bases in refweb, by name."""
    if inspect.isfunction(value):
        yield name, value
    for base in value.__mro__ if inspect.isclass(value) else ():
        for key, member in vars(base).items() if base.__module__.startswith("refweb.") else ():
            for wrapper in ("__func__", "fget", "func"):  # of a class method, a property and a cached one
                member = getattr(member, wrapper, member)
            named = inspect.isfunction(member) and member.__name__ == key
            if named and member.__module__.startswith("refweb.") and (key == "__init__" or not key.startswith("_")):
                yield f"{base.__module__}:{base.__qualname__}.{key}", member


def unannotated(function):
    """Parameters of a function without annotation, and "return"."""
    signature = inspect.signature(function)
    found = [name for name, parameter in signature.parameters.items() if parameter.annotation is parameter.empty]
    found += ["return"] if signature.return_annotation is signature.empty else []
    return [name for name in found if name not in ("self", "cls", "_cls")]


def test_the_public_interface_is_annotated():
    """Each parameter and each result of each public function, and of each method that a class has or inherits."""
    missing = {
        name: left
        for label, value in public().items()
        for name, function in functions(label, value)
        if (left := unannotated(function))
    }
    assert not missing, missing


def told(folder, script, **options):
    """What the checker says of the package and of a script: the file, line, severity and text of each diagnostic."""
    (folder / "script.py").write_text(script)
    config = {"include": [str(ROOT / "refweb"), str(folder / "script.py")], "extraPaths": [str(ROOT)], **options}
    config = {"extends": str(ROOT / "pyproject.toml"), **config}
    (folder / "pyrightconfig.json").write_text(json.dumps(config))
    command = [*checker(), "-p", str(folder)]
    found = json.loads(subprocess.run(command, capture_output=True, text=True, timeout=900).stdout)
    assert found["summary"]["filesAnalyzed"] > len(list(ROOT.glob("refweb/**/*.py")))
    return [
        (pathlib.Path(one["file"]), one["range"]["start"]["line"], one["severity"], one["message"])
        for one in found["generalDiagnostics"]
    ]


@functools.cache
def checker():
    """Command that runs the checker; the test is skipped where it is not installed."""
    pytest.importorskip("basedpyright")
    return [sys.executable, "-m", "basedpyright", "--pythonpath", sys.executable, "--outputjson"]


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """What is told of the package and of a script that ends with the `MISTAKES`, a line each."""
    folder = tmp_path_factory.mktemp("types")
    opaque = folder / "stubs" / "pyvista"
    opaque.mkdir(parents=True)
    (opaque / "__init__.pyi").write_text("def __getattr__(name: str): ...\n")
    return told(folder, SCRIPT + "\n".join(MISTAKES), stubPath=str(opaque.parent))


@pytest.mark.slow
def test_the_package_has_none(said):
    """Names, arguments and attributes that do not exist are seen without a run of the code that uses them."""
    ours = [one for one in said if one[0].name != "script.py"]
    assert not ours, ours


@pytest.mark.slow
def test_mistakes_of_users_are_shown_and_nothing_else(said):
    first = SCRIPT.count("\n")
    theirs = [(line, text) for file, line, severity, text in said if file.name == "script.py" and severity == "error"]
    for line, (mistake, word) in enumerate(MISTAKES.items(), first):
        texts = [text for at, text in theirs if at == line]
        assert any(word in text for text in texts), (mistake, texts)
    assert {line for line, _ in theirs} == set(range(first, first + len(MISTAKES))), theirs


@pytest.mark.slow
def test_the_package_has_none_with_the_types_that_others_declare(tmp_path):
    """Types that a checker infers from the code of other libraries change with their versions, and are not asked."""
    assert not told(tmp_path, SCRIPT)


@pytest.mark.slow
def test_types_of_the_public_interface_are_known():
    """Down to the attributes of what is returned, in the checker's report on completeness."""
    command = [*checker(), "--verifytypes", "refweb", "--ignoreexternal"]
    report = json.loads(subprocess.run(command, capture_output=True, text=True, timeout=900, cwd=ROOT).stdout)
    symbols = [symbol for symbol in report["typeCompleteness"]["symbols"] if symbol["isExported"]]
    starts = tuple(name.replace(":", ".") for name in public())
    ours = [s for s in symbols if any(s["name"] == start or s["name"].startswith(f"{start}.") for start in starts)]
    assert len(ours) > 1000
    unknown = [s["name"] for s in ours if not s["isTypeKnown"] or s["isTypeAmbiguous"]]
    assert not unknown, unknown
