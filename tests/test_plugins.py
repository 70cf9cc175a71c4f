"""What other packages, scripts and notebooks add by entry points and `refweb.register`."""

import json
import os
import pathlib
import re
import subprocess
import sys
from dataclasses import replace

import nets
import numpy as np
import packages
import pytest
import tomli_w

import refweb
from refweb import registry
from refweb.__main__ import main
from refweb.commands import __doc__ as verbs
from refweb.dynamics.integrators import __doc__ as integrators
from refweb.effects import __doc__ as effects
from refweb.effects.base import Balance, ForceTerm, Tangent
from refweb.kernels import BOUND, ENERGY, FORCE, STIFFNESS, kernel
from refweb.net.laws import __doc__ as laws
from refweb.net.rigid_body import __doc__ as shapes
from refweb.results.observables import __doc__ as observables
from refweb.system.effect_parts import parts_of
from refweb.tables import Table, real, table

PAGES = {
    "effect": effects,
    "shape": shapes,
    "law": laws,
    "observable": observables,
    "integrator": integrators,
    "verb": verbs,
}
SCENE = {
    "web": {"kind": "window", "mesh": "square", "rows": 4, "columns": 4, "side": 0.2},
    "cable": {"law": "tension-only", "modulus": 7e7, "area": 1e-4, "density": 200.0, "prestrain": 0.05},
    "current": [{"lines": "all", "current": 20.0, "field": [0.0, 0.0, 0.5]}],
    "body": [{"name": "wall", "shape": "wall", "normal": [0, 0, 1], "position": [0, 0, -1.0], "fixed": True}],
    "contact": {"stiffness": 1e3},
    "observe": [{"name": "inertia", "quantity": "moment_of_inertia", "component": "z", "reduce": "max"}],
    "solve": {"kind": "dynamic", "duration": 2e-3, "method": "heun", "rtol": 1e-3},
    "output": {"interval": 1e-3},
    "accuracy": {"error": "none"},
}
"""A scene that every kind of plug-in of the pages but a law has a part in."""
OF_PAGES = {**SCENE, "cable": {**SCENE["cable"], "law": "limited", "parameters": {"limit_strain": 0.2}}}
"""The same with the law of its page."""


def modules_and_entries():
    """Modules of the pages by name, and their entry points."""
    modules, entries = {}, []
    for page in PAGES.values():
        source, entry, *_ = packages.blocks(page)
        group, name, module, attribute = packages.entry_point(entry)
        modules[module.partition(".")[2]] = source
        entries.append((group, f"{name} = {module}" + (f":{attribute}" if attribute else "")))
    return modules, entries


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a package of all that the pages show, as an installer leaves it, and a scene that uses it."""
    folder = tmp_path_factory.mktemp("target")
    packages.install(folder, *modules_and_entries())
    (folder / "scene.toml").write_text(tomli_w.dumps(OF_PAGES), encoding="utf-8")
    return folder


def process(folder, *arguments, **environment):
    """What a process has done that knows the packages in a folder."""
    path = os.pathsep.join([str(folder), os.environ["PYTHONPATH"]])
    environment = {**os.environ, "PYTHONPATH": path, **environment}
    return subprocess.run(
        [sys.executable, *map(str, arguments)], cwd=folder, env=environment, capture_output=True, text=True
    )


def test_a_package_is_known_to_the_command_line(folder):
    """Effect, shape, law, observable and integrator in one run, the verb; their help; the version of the package."""
    done = process(folder, "-m", "refweb", "run", "scene.toml", "--out", "out")
    assert done.returncode == 0, done.stderr
    summary = json.loads((folder / "out" / "run.json").read_text(encoding="utf-8"))
    assert summary["solver"]["method"] == "heun" and summary["results"]["inertia"]["unit"] == "kg m²"
    assert summary["versions"]["my_webs"] == "1.2"
    done = process(folder, "-m", "refweb", "weigh", "square-load")
    assert done.returncode == 0 and float(done.stdout) == pytest.approx(4.028, rel=1e-3)  # as `refweb check` has it
    done = process(folder, "-m", "refweb", "help")
    assert done.returncode == 0 and "[[current]]" in done.stdout and done.stderr == ""
    done = process(folder, "-m", "refweb", "--help")
    assert done.returncode == 0 and "mass of a web" in done.stdout
    for name, words in (
        ("body.wall", "All that lies behind a plane"),
        ("cable.limited", "which tends to E a"),
        ("observe", "Moment of inertia of the nodes"),
    ):
        assert words in process(folder, "-m", "refweb", "help", name).stdout


@pytest.mark.slow
def test_machine_code_of_a_package_is_kept_and_noticed_when_it_changes(folder, tmp_path):
    """A second process compiles nothing; a changed kernel of the package is compiled again."""
    lines = """
import numpy as np
from my_webs.current import force
from refweb.compiled import watched
x, f, out, cells, data = np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((1, 1)), np.int32([[0, 1]]), np.ones((1, 6))
data[0, :3] = 1.0, 2.0, 3.0
counts = []
with watched(lambda done, total: counts.append(total)):
    force(0.0, x, x, f, cells, data, out)
print(len(counts), np.abs(f).sum())
"""

    def counted():
        done = process(folder, "-c", lines, REFWEB_CACHE=str(tmp_path))
        assert done.returncode == 0, done.stderr
        count, total = done.stdout.split()
        return int(count), float(total)

    first, total = counted()
    assert first == 1 and counted() == (0, total)
    path = folder / "my_webs" / "current.py"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("0.5 * field[0], 0.5 * field[1], 0.5 * field[2]", "field[0], field[1], field[2]"))
    try:
        again, twice = counted()
    finally:
        path.write_text(text, encoding="utf-8")
    assert again == 1 and twice == 2.0 * total


def test_nothing_is_read_for_a_scene_of_what_refweb_ships(folder):
    """Neither entry points nor the package."""
    lines = (
        "import sys, refweb.registry as registry; from refweb.__main__ import main; main(['check', 'square-load']);"
        "import refweb; refweb.Dynamic(method='auto', duration=1.0);"
        "print(registry.installed.cache_info().currsize, 'my_webs' in sys.modules)"
    )
    assert process(folder, "-c", lines).stdout.splitlines()[-1] == "0 False"


@pytest.fixture
def broken(tmp_path):
    """Packages one of which cannot be imported, one of which has a wrong class, and two that have one name."""
    modules = {"gone": "import no_such_module\n", "wrong": "class Wrong:\n    pass\n"}
    entries = [
        ("refweb.effects", "gone = my_webs.gone:Gone\nwrong = my_webs.wrong:Wrong\ngravity = my_webs.wrong:Wrong"),
        ("refweb.verbs", "gone = my_webs.gone"),
    ]
    twice = [("refweb.effects", "gone_twice = own_webs.gone:Gone")]
    packages.install(tmp_path, {"gone": ""}, twice, "own_webs")
    (tmp_path / "webs-1.dist-info").mkdir()
    (tmp_path / "webs-1.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: webs\nVersion: 1\n")
    (tmp_path / "webs-1.dist-info" / "entry_points.txt").write_text("[refweb.effects]\ngone_twice = own_webs.gone:Gone")
    with packages.installed(tmp_path, modules, entries):
        yield tmp_path


GONE = "of my_webs: my_webs.gone:Gone cannot be loaded, ModuleNotFoundError: No module named 'no_such_module'"
REFUSED = [
    ({"gone": {}}, rf'^plug-in effect "gone" {GONE}$'),
    ({"wrong": {}}, r'^plug-in effect "wrong" of my_webs: "my_webs.wrong:Wrong" must be a class derived from .*Table$'),
    ({"gone_twice": {}}, r'^plug-in effect "gone_twice" of \w+ and \w+: several packages have one of this name'),
    ({"gon": {}}, r'unknown table or key, or of a plug-in that is not installed, did you mean "gone"\?$'),
]


@pytest.mark.parametrize("more, message", REFUSED)
def test_a_package_that_fails_is_one_line_with_its_name(broken, more, message):
    given = {key: SCENE[key] for key in ("web", "cable")} | {"solve": {"kind": "static"}}
    with pytest.raises(refweb.InputError, match=message) as error:
        refweb.Scene.from_dict({**given, **more})
    assert "\n" not in str(error.value)
    assert refweb.Scene.from_dict({**given, "gravity": {"acceleration": [0, 0, -9.81]}}).effects  # the one shipped


def test_help_goes_on_without_a_package_that_fails(broken, capsys):
    assert main(["help"]) == 0
    out, err = capsys.readouterr()
    lines = err.splitlines()
    assert "[gravity]" in out and len(lines) == 5 and all(line.startswith("refweb: plug-in ") for line in lines)
    assert any('effect "gravity" of my_webs: refweb has one of this name' in line for line in lines)
    assert main(["gone"]) == 2
    assert capsys.readouterr().err.startswith('refweb: plug-in verb "gone" of my_webs: my_webs.gone cannot be loaded')
    assert main([]) == 2
    out, err = capsys.readouterr()
    assert "solve" in out and err.count("\n") == 1


@table
class Uplift(Table):
    """A lift of all nodes, as a load: in terms of what refweb ships."""

    force: float = real(unit="N")

    def on(self, net):
        from refweb.effects.load import Load

        return Load(node="all", force=(0.0, 0.0, self.force)).on(net)


@pytest.fixture
def clean(monkeypatch):
    """What is registered is gone behind the test."""
    for name in ("uplift", "misplaced", "counted", "unlike", "by_global"):
        monkeypatch.setitem(registry.EFFECTS, name, None)
        monkeypatch.delitem(registry.EFFECTS, name)


def test_a_script_registers_its_own(clean):
    """The class is an effect of scenes in Python and as a dict; registered again, it is replaced."""
    tables = {key: SCENE[key] for key in ("web", "cable")}
    given = {**tables, "solve": {"kind": "static"}, "uplift": {"force": 0.2}}
    with pytest.raises(refweb.InputError, match="unknown table or key"):
        refweb.Scene.from_dict(given)
    built = refweb.Scene.from_dict({key: given[key] for key in ("web", "cable", "solve")})
    with pytest.raises(refweb.InputError, match=r'^Uplift is not an effect, refweb.register\("effect", NAME, Uplift\)'):
        built.replace(effects=(Uplift(force=0.2),))
    assert refweb.register("effect", "uplift")(Uplift) is Uplift and refweb.register("effect", "uplift", Uplift)
    scene = refweb.Scene.from_dict(given)
    assert scene.to_dict()["uplift"] == {"force": 0.2}
    solution = refweb.run(scene)
    again = refweb.run(built.replace(effects=(refweb.Load(node="all", force=(0, 0, 0.2)),)))
    np.testing.assert_allclose(solution.positions, again.positions, atol=1e-12)
    assert solution.positions[:, 2].max() > 0.0


@kernel(FORCE)
def counting_force(t, x, v, f, cells, data, out):
    data[0, 0] += 1.0
    out[0, 0] = 0.0


@kernel(STIFFNESS)
def no_stiffness(t, x, v, blocks, cells, data, definite):
    blocks[:] = 0.0


@kernel(BOUND)
def no_rates(reach, speed, x, mass, rates, cells, data):
    pass


@table
class Counted(Table):
    """No force; it counts how often it is asked for."""

    def on(self, net):
        tangent, cells = Tangent(no_stiffness, no_rates), np.zeros((1, 1), dtype=np.int32)
        return ForceTerm("counted", cells, np.zeros((1, 1)), counting_force, Balance("work", power=0), tangent=tangent)


def test_a_step_asks_an_effect_for_its_force_twice(clean):
    """Once for the motion, and once with the velocity at the end of the step, for both balances; not for stiffness."""
    refweb.register("effect", "counted", Counted)
    solve = {"kind": "dynamic", "duration": 2e-3, "step_size": 1e-6}
    given = {key: SCENE[key] for key in ("web", "cable", "accuracy", "output")} | {"solve": solve, "counted": {}}
    solution = refweb.run(refweb.Scene.from_dict(given))
    (term,) = (term for term in solution.state.system.terms if term.name == "counted")
    nsteps = solution.solver["nsteps"]
    assert nsteps >= 2000 and 2 * nsteps <= term.data[0, 0] < 2.1 * nsteps  # rows ask, too
    assert not no_stiffness.loaded


@kernel(FORCE)
def unlike_its_power(t, x, v, f, cells, data, out):
    for c in range(len(cells)):
        f[cells[c, 0], 2] += data[c, 0]
        out[c, 0] = -data[c, 0] * v[cells[c, 0], 2]


@table
class Unlike(Table):
    """A force whose power has the wrong sign."""

    def on(self, net):
        cells = np.array([[net.web.find("centre")[0]]], dtype=np.int32)
        return ForceTerm("unlike", cells, np.ones((1, 1)), unlike_its_power, Balance("work", power=0))


@pytest.mark.parametrize("method", ["central-difference", "cvode"])
def test_a_power_that_is_not_that_of_the_force_is_named(clean, method):
    refweb.register("effect", "unlike", Unlike)
    solve = {"kind": "dynamic", "duration": 2e-2, "method": method}
    given = {key: SCENE[key] for key in ("web", "accuracy", "output")} | {"solve": solve, "unlike": {}}
    given["cable"] = {**SCENE["cable"], "prestrain": 0.0}
    with pytest.raises(refweb.SolverError, match='or see if the power of effect "unlike" is that of its force'):
        refweb.run(refweb.Scene.from_dict(given))


AMOUNT = 0.1


@kernel(FORCE)
def by_a_global(t, x, v, f, cells, data, out):
    for c in range(len(cells)):
        f[cells[c, 0], 2] += AMOUNT


@kernel(ENERGY)
def energy_by_a_global(t, x, cells, data, out):
    for c in range(len(cells)):
        out[c] = -AMOUNT * x[cells[c, 0], 2]


@table
class ByGlobal(Table):
    """A force on all nodes, by a number of the cell of a notebook."""

    def on(self, net):
        cells = np.arange(net.nodes, dtype=np.int32)[:, None]
        return ForceTerm(
            "by_global", cells, np.ones((net.nodes, 1)), by_a_global, Balance("spring_energy"), energy_by_a_global
        )


@pytest.mark.parametrize("solve", [{"kind": "static"}, {"kind": "dynamic", "duration": 2e-3, "method": "cvode"}])
def test_a_run_takes_the_numbers_that_cells_of_a_notebook_have_now(clean, monkeypatch, solve):
    """Equal to `refweb.Load`, before and after the number changes; kernels of force and energy are compiled before."""
    refweb.register("effect", "by_global", ByGlobal)
    tables = {key: SCENE[key] for key in ("web", "cable", "accuracy")} | {"solve": solve}
    for amount in (0.1, 0.2):
        monkeypatch.setitem(globals(), "AMOUNT", amount)
        load = [{"node": "all", "force": [0, 0, amount]}]
        found, right = (
            refweb.run(refweb.Scene.from_dict({**tables, **more})).positions
            for more in ({"by_global": {}}, {"load": load})
        )
        np.testing.assert_allclose(found, right, atol=1e-9)


def test_a_fault_of_a_plug_in_is_named_as_its_own(clean, tmp_path, capsys):
    """With its module and line, and not as one to report to refweb."""
    refweb.register("effect", "uplift", type("Faulty", (Uplift,), {"on": lambda self, net: self.force / 0.0}))
    tables = {key: SCENE[key] for key in ("web", "cable")}
    (tmp_path / "scene.toml").write_text(tomli_w.dumps({**tables, "solve": {"kind": "static"}, "uplift": {"force": 1}}))
    assert main(["check", str(tmp_path / "scene.toml")]) == 1
    err = capsys.readouterr().err
    assert re.fullmatch(r"refweb: plug-in test_plugins: ZeroDivisionError: .* \(test_plugins.py:\d+\)\n", err), err


WRONG = [
    (("effct", "uplift", Uplift), 'kind = "effct": there is no such kind, did you mean "effect"'),
    (("effect", "Up lift", Uplift), 'effect "Up lift": the name must be small letters, digits and _, a letter first'),
    (("effect", "gravity", Uplift), 'effect "gravity": refweb has one of this name'),
    (("effect", "web", Uplift), 'effect "web": refweb has one of this name'),
    (("integrator", "auto", Uplift), 'integrator "auto": refweb has one of this name'),
    (("shape", "uplift", Uplift), r'"test_plugins:Uplift" must be a class derived from refweb.net.rigid_body.Shape'),
    (("verb", "uplift", Uplift), "must be a module with the functions add_arguments and run"),
]


@pytest.mark.parametrize("arguments, message", WRONG)
def test_what_register_refuses(arguments, message):
    before = {kind: dict(entry.table) for kind, entry in registry.KINDS.items()}
    with pytest.raises(refweb.InputError, match=message):
        refweb.register(*arguments)
    assert {kind: dict(entry.table) for kind, entry in registry.KINDS.items()} == before


@pytest.mark.parametrize(
    "keys, method", [((), "up"), (("order",), "up"), (("rtol", "knob"), "up"), (("rtol",), "down")]
)
def test_an_integrator_names_keys_of_solve_and_itself(keys, method):
    from refweb.dynamics.integrators.step_observer import StepObserver

    made = type("Up", (StepObserver,), {"method": method, "keys": keys})
    with pytest.raises(refweb.InputError, match="method = " if keys == ("rtol",) else "keys = "):
        refweb.register("integrator", "up", made)


@pytest.mark.slow
def test_a_package_that_pip_installs(folder, tmp_path):
    """The same package from a ``pyproject.toml`` with the entry points as the pages have them."""
    pytest.importorskip("setuptools", minversion="70.1")
    source, target = tmp_path / "source", tmp_path / "target"
    (source / "my_webs").mkdir(parents=True)
    modules, _ = modules_and_entries()
    (source / "my_webs" / "__init__.py").touch()
    for name, text in modules.items():
        (source / "my_webs" / f"{name}.py").write_text(text, encoding="utf-8")
    points = "\n".join(packages.blocks(page)[1] for page in PAGES.values())
    project = '[project]\nname = "my-webs"\nversion = "0.3"\n[tool.setuptools]\npackages = ["my_webs"]\n'
    (source / "pyproject.toml").write_text(project + points, encoding="utf-8")
    command = ["-m", "pip", "install", "--no-deps", "--no-build-isolation", "--quiet", "--target", target, source]
    done = process(tmp_path, *command)
    assert done.returncode == 0, done.stderr
    done = process(target, "-m", "refweb", "run", pathlib.Path(folder, "scene.toml"), "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))["versions"]["my-webs"] == "0.3"


@table
class Misplaced(Table):
    """A load whose parts a test changes."""

    force: float = real(unit="N")
    change = staticmethod(lambda term: term)

    def on(self, net):
        return type(self).change(refweb.Load(node="all", force=(0.0, 0.0, self.force)).on(net))


def changed(**parts):
    """A function that replaces parts of a term by what functions make of them."""
    return lambda term: replace(term, **{name: make(getattr(term, name)) for name, make in parts.items()})


STIFFNESS = 9
"""A column that the data of a `Misplaced` load do not have."""


@kernel()
def pulled(x, data):
    return x * data[1]


@kernel(FORCE)
def slack_spring(t, x, v, f, cells, data, out):
    for c in range(len(cells)):
        if x[cells[c, 0], 2] > 0.0:
            f[cells[c, 0], 2] -= data[c, STIFFNESS] * x[cells[c, 0], 2]


@kernel(FORCE)
def pair_spring(t, x, v, f, cells, data, out):
    for c in range(len(cells)):
        if x[cells[c, 0], 2] > 0.0:
            f[cells[c, 1], 2] -= data[c, 0]


@kernel(FORCE)
def sliced_spring(t, x, v, f, cells, data, out):
    for c in range(len(cells)):
        f[cells[c, 0], 2] -= pulled(x[cells[c, 0], 2], data[c, 6:])


@kernel(FORCE)
def late_spring(t, x, v, f, cells, data, out):
    for c in range(len(cells)):
        f[cells[c, 0], 2] -= data[c, 0 if t < 5e-3 else 9] * x[cells[c, 0], 2]


@kernel(FORCE)
def far_spring(t, x, v, f, cells, data, out):
    for c in range(len(cells)):
        f[cells[c, 0], 2] -= x[cells[c, 0] + (0 if x[cells[c, 0], 2] == 0.0 else 1000), 2]


@kernel(FORCE)
def wary_spring(t, x, v, f, cells, data, out):
    for c in range(len(cells)):
        out[c, 0] = 0.0
        if data.shape[1] > 9:
            f[cells[c, 0], 2] -= data[c, 9] * x[cells[c, 0], 2]


WRONG_PARTS = {
    "nothing": (lambda term: None, r"on\(net\) returns None and must return a ForceTerm"),
    "a row too large": (changed(cells=lambda c: c + np.int32(2)), "row 3 of cell 1 must be 0 to 2: net.find"),
    "a negative row": (changed(cells=lambda c: c - np.int32(1)), "row -1 of cell 0 must be 0 to 2: net.find"),
    "cells of 64 bits": (changed(cells=lambda c: c.astype(np.int64)), r"cells \(int64, .* array of int32"),
    "data of 32 bits": (changed(data=lambda d: d.astype(np.float32)), r"data \(float32, .* array of float64"),
    "columns of another array": (changed(data=lambda d: np.hstack([d, d])[:, ::2]), "not contiguous"),
    "data of fewer cells": (changed(data=lambda d: d[1:]), "data has 2 rows for 3 cells"),
    "data of fewer columns": (
        changed(data=lambda d: np.ascontiguousarray(d[:, :-1])),
        r"force: line \d+ of outer_load.py reaches beyond data, which has 6 columns: give each cell all numbers",
    ),
    "no column for the power": (
        changed(balance=lambda b: b._replace(power=None)),
        r"force: line \d+ of outer_load.py reaches beyond out, which has 0 columns: .* power = 0",
    ),
    "a branch that is not taken": (
        changed(force=lambda k: slack_spring),
        r"force: data\[c, STIFFNESS\] reaches beyond data, which has 7 columns",
    ),
    "rows of a cell": (
        changed(force=lambda k: pair_spring),
        r"force: cells\[c, 1\] reaches beyond cells, which has 1 columns: give each cell all rows",
    ),
    "a column that a time computes": (
        changed(force=lambda k: late_spring),
        r"force: line \d+ of test_plugins.py reaches beyond data, which has 7 columns: give each cell all numbers",
    ),
    "a row that a motion computes": (
        changed(force=lambda k: far_spring),
        r"force: line \d+ of test_plugins.py reaches beyond x, which has \d+ rows: rows are those of the numbers",
    ),
    "a part of the data": (
        changed(force=lambda k: sliced_spring),
        r"force: line \d+ of test_plugins.py reaches beyond data, which has 7 columns",
    ),
    "cells of no element": (changed(data=lambda d: None), "data = None means that cells are the 2 elements"),
    "no tangent": (changed(tangent=lambda t: None), "tangent = None must be a Tangent: leave it out"),
    "no velocity": (changed(velocity=lambda v: None), "velocity = None must be a VelocityForce: leave it out"),
    "a function of Python": (changed(force=lambda k: k.py_func), "force is a function and must be a kernel"),
    "no force": (changed(force=lambda k: None), "force is None and must be a kernel"),
}


@pytest.mark.parametrize("wrong", WRONG_PARTS)
@pytest.mark.parametrize("solve", [refweb.Static(), refweb.Dynamic(duration=1e-3)])
def test_an_effect_that_kernels_could_not_read_is_refused(clean, monkeypatch, wrong, solve):
    """Cells out of range would be memory of others; this net has 3 rows and 2 lines."""
    change, message = WRONG_PARTS[wrong]
    refweb.register("effect", "misplaced", Misplaced)
    monkeypatch.setattr(Misplaced, "change", staticmethod(change))
    scene = refweb.Scene(
        web=refweb.Inline(points=[[-1, 0, 0], [0, 0, 0], [1, 0, 0]], lines=[[0, 1], [1, 2]], supports=[0, 2]),
        cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0),
        effects=[Misplaced(force=0.1)],
        solve=solve,
    )
    with pytest.raises(refweb.InputError, match=f'^effect "misplaced": .*{message}'):
        scene.build()


def test_a_kernel_may_ask_how_many_columns_there_are(monkeypatch):
    monkeypatch.setattr(Misplaced, "change", staticmethod(changed(force=lambda k: wary_spring)))
    (term,) = parts_of([Misplaced(force=0.1)], nets.skew_net("linear"))
    assert term.force is wary_spring
