"""The command line: exit statuses, one-line messages, what it writes and removes, and what it imports."""

import importlib.metadata
import json
import os
import pathlib
import re
import subprocess
import sys
import tomllib

import pytest
from nets import SMALL as SCENE

import refweb
from refweb import scene
from refweb.__main__ import main
from refweb.statics import load_steps

WRONG = {
    "unknown table": (
        "[[load]]",
        "[[loads]]",
        '[[loads]]: unknown table or key, or of a plug-in that is not installed, did you mean "load"?',
    ),
    "unknown key": ("side =", "sides =", '[web] sides = 0.5: unknown key, did you mean "side"?'),
    "kind": ('"window"', '"windows"', '[web] kind = "windows": unknown kind, did you mean "window"?'),
    "mesh": ('"square"', '"squares"', '[web] mesh = "squares" must be one of'),
    "law": ('"tension-only"', '"tension_only"', 'did you mean "tension-only"?'),
    "solver": ('"static"', '"statical"', '[solve] kind = "statical": unknown kind'),
    "negative": ("area = 1e-4", "area = -1e-4", "[cable] area = -0.0001 must be > 0 [m²]"),
    "zero": ("modulus = 1e5", "modulus = 0", "[cable] modulus = 0.0 must be > 0 [Pa]"),
    "infinite": ("modulus = 1e5", "modulus = inf", "[cable] modulus = inf must be a finite number [Pa]"),
    "text": ("density = 100.0", 'density = "100"', '[cable] density = "100" must be a number [kg/m³]'),
    "missing": ("modulus = 1e5\n", "", "[cable] modulus is missing: give modulus = ... [Pa]"),
    "no table": ('[solve]\nkind = "static"\nload_steps = [1, 2, 3]', "", "[solve] is missing"),
    "two-vector": ("[0.0, 0.0, 1.0]", "[0.0, 1.0]", "[[load]] 1 force = [0.0, 1.0] must be a vector of 3"),
    "nan": ("[0.0, 0.0, 1.0]", "[0.0, 0.0, nan]", "[[load]] 1 force[2] = nan must be a finite number [N]"),
    "node": ('node = "centre"', "node = 12", "[[load]] 1 node = 12 must be 0 … 11"),
    "name": ('node = "centre"', 'node = "center"', 'node = "center" names no node, did you mean "centre"?'),
    "not a list": ("[[load]]", "[load]", "must be a list of tables: write [[load]]"),
    "empty": ("[1, 2, 3]", "[]", "[solve] load_steps = [] must be a list with at least one number"),
    "too large": ("rows = 3", "rows = 1000000000", "[web] rows × columns = 3000000000 must be ≤ 1000000"),
    "slackness": ("strength = 1e6", "slackness = 0.1", "[cable] slackness = 0.1 has no meaning with law"),
    "prestrain": ("strength = 1e6", "prestrain = -1.5", "[cable] prestrain = -1.5 must be > -1 [1]"),
    "group": ("[[load]]", "[cable.groups.radial]\n[[load]]", '[cable.groups] "radial" is not a group of lines'),
    "syntax": ("side = 0.5", "side = ", "wrong.toml: cannot be read: Invalid value (at line 9"),
    "schema": ("title", "schema = 2\ntitle", "schema = 2 must be 1"),
}


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder to work in, with one scene file in another."""
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "web.toml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path / "work"


WEB = "../scenes/web.toml"


def files(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def refused(capsys, *parts):
    """What a command wrote is one line on the error stream."""
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("refweb: ") and "Traceback" not in err
    for part in parts:
        assert part in err


@pytest.mark.parametrize("name", WRONG)
def test_wrong_scene_is_one_line_and_leaves_no_folder(here, capsys, name):
    old, new, message = WRONG[name]
    assert SCENE.count(old) == 1
    (here.parent / "scenes" / "wrong.toml").write_text(SCENE.replace(old, new), encoding="utf-8")
    for command in ("run", "check"):
        assert main([command, "../scenes/wrong.toml"]) == 2
        refused(capsys, "wrong.toml: ", message)
    assert list(here.iterdir()) == []


def test_unknown_scene(here, capsys):
    assert main(["run", "hexagon-laod"]) == 2
    refused(capsys, 'hexagon-laod: no such file and no shipped scene, did you mean "hexagon-load"?')
    assert list(here.iterdir()) == []


def test_run(here, capsys):
    assert main(["run", WEB]) == 0
    out, err = capsys.readouterr()
    assert err == "" and "12 nodes, 12 lines" in out and "effects  load" in out and "results in small-web" in out
    stress = refweb.run(WEB).stress
    found = re.search(r"utilisation ([\d.]+) ± ([\d.e-]+) at line (\d+)", out)
    assert abs(float(found[1]) - stress.max() / 1e6) <= float(found[2]) and int(found[3]) == stress.argmax()
    assert files(here) == [
        "small-web/checkpoint.npz",
        *(f"small-web/frames/web_00000{i}.vtu" for i in range(3)),
        "small-web/history.csv",
        "small-web/run.json",
        "small-web/scene.toml",
        "small-web/web.pvd",
    ]


def test_folder_in_use(here, capsys):
    (here / "file").write_text("mine")
    (here / "full").mkdir()
    (here / "full" / "mine.txt").write_text("mine")
    (here / "foreign").mkdir()
    (here / "foreign" / "run.json").write_text("{}")
    for out, force, message in [
        ("file", [], "file is a file, not a folder"),
        ("file/folder", ["--force"], "file is a file, not a folder"),
        ("full", [], "is not empty: choose another folder, or replace its results with --force"),
        ("full", ["--force"], "holds no run.json"),
        ("foreign", ["--force"], "holds no run.json of refweb"),
        ("n" * 300, [], "File name too long"),
    ]:
        assert main(["run", WEB, "--out", out, *force]) == 2
        refused(capsys, f"result folder {out[:50]}", message)
    assert files(here) == ["file", "foreign/run.json", "full/mine.txt"]


@pytest.mark.parametrize("verb", ["info", "check", "run"])
def test_what_is_not_a_scene(verb, here, capsys):
    """A picture in place of a scene: what is wrong, and what to name."""
    (here / "web.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    assert main([verb, "web.png"]) == 2
    refused(capsys, "web.png: is not a scene, a text in UTF-8 (byte 0 is not UTF-8)", "name a TOML file")
    assert files(here) == ["web.png"]


def test_what_is_not_a_result_folder(here, capsys):
    (here / "empty").mkdir()
    for given, message in [
        ("empty", "is not a result folder, it holds no web.pvd: name one of refweb run"),
        ("none", "none is not a folder"),
    ]:
        assert main(["picture", given]) == 2
        refused(capsys, given, message)
    assert main(["info", "empty"]) == 2
    refused(capsys, "empty: holds no run.json, so it is not a result folder")


def test_force_removes_only_what_a_run_wrote(here, capsys):
    assert main(["run", WEB, "--out", "out"]) == 0
    assert main(["run", WEB, "--out", "out"]) == 2
    for name in ("mine.txt", "web.pvd.bak", "frames/mine.vtu", "frames/web_1.vtu", "run/run.json"):
        (here / "out" / name).parent.mkdir(exist_ok=True)
        (here / "out" / name).write_text("mine")
    for name in ("web.png", "frames/ball_000007.vtu", ".refweb-half.vtu"):
        (here / "out" / name).write_text("of a run")
    before = files(here)
    short = here.parent / "scenes" / "short.toml"
    short.write_text(SCENE.replace("[1, 2, 3]", "[1]"), encoding="utf-8")
    capsys.readouterr()
    assert main(["run", str(short), "--out", "out", "--force"]) == 0
    frames = ("ball_000007", "web_000001", "web_000002")
    gone = {"out/web.png", "out/.refweb-half.vtu", *(f"out/frames/{name}.vtu" for name in frames)}
    assert set(before) - set(files(here)) == gone
    assert (here / "out" / "mine.txt").read_text() == "mine"
    assert len(json.loads((here / "out" / "run.json").read_text())["steps"]) == 1


def test_force_leaves_what_the_user_put_there(here, capsys):
    assert main(["run", WEB, "--out", "out"]) == 0
    mine = ("photo.png", "web-2.png", "web.jpg", "plots.pdf", "scene.toml.old", "frames/photo.png", "pictures/web.png")
    for name in mine:
        (here / "out" / name).parent.mkdir(exist_ok=True)
        (here / "out" / name).write_text("mine")
    for name in ("trust.json", "trust.png", "report.html"):
        (here / "out" / name).write_text("of the run before")
    assert main(["run", WEB, "--out", "out", "--force"]) == 0
    assert all((here / "out" / name).read_text() == "mine" for name in mine)
    assert not {"out/trust.json", "out/trust.png", "out/report.html"} & set(files(here))


def test_failed_run_keeps_its_folder(here, capsys):
    """A web without supports takes no load."""
    free = SCENE.replace("[solve]", "[supports]\nnodes = []\n\n[solve]").replace("[1, 2, 3]", "[0, 2]")
    (here.parent / "scenes" / "free.toml").write_text(free, encoding="utf-8")
    assert main(["run", "../scenes/free.toml", "--out", "out"]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "12 nodes" in err and "along z" in err and "2 N at step 2" in err
    run = json.loads((here / "out" / "run.json").read_text())
    assert run["status"] == "failed" and run["message"] in err and [s["step"] for s in run["steps"]] == [0.0]
    assert files(here / "out" / "frames") == ["web_000000.vtu"]
    assert len((here / "out" / "history.csv").read_text().splitlines()) == 2
    assert main(["info", "out"]) == 0
    out = capsys.readouterr().out
    assert "failed" in out and "carried off" in out


def test_a_run_whose_energy_is_not_finite_is_written(here, capsys):
    """A pressure of 1e12 Pa tears a net apart: numbers that are not finite are null in ``run.json``."""
    tables = """
        [web]
        kind = "window"
        mesh = "square"
        rows = 3
        columns = 3
        side = 0.1
        [cable]
        law = "smooth"
        modulus = 7e7
        area = 1e-4
        density = 200.0
        [[pressure]]
        lines = "all"
        normal = [0.0, -1.0, 0.0]
        value = -1e12
        [solve]
        kind = "dynamic"
        duration = 2.66e-5
        method = "central-difference"
        [output]
        interval = 8.87e-6
    """
    pathlib.Path("torn.toml").write_text(tables)
    assert main(["run", "torn.toml", "--out", "out"]) == 1
    assert "refweb: energy not finite at t = " in capsys.readouterr().err
    kept = json.loads(pathlib.Path("out/run.json").read_text())
    assert kept["status"] == "failed" and kept["solver"]["energy_drift"] is None


@pytest.mark.parametrize("old, new", [("0.0, 1.0]", "0.0, 1e308]"), ("[1, 2, 3]", "[1e308]")])
def test_numbers_that_overflow(here, capsys, old, new):
    (here.parent / "scenes" / "big.toml").write_text(SCENE.replace(old, new), encoding="utf-8")
    assert main(["run", "../scenes/big.toml", "--out", "out"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "= 1e+308 must be ≤ 1e+100" in err
    assert not (here / "out").exists()


STOPS = [
    (KeyboardInterrupt(), 130, "interrupted", "interrupted"),
    (refweb.SolverError("no equilibrium at step 2"), 1, "no equilibrium at step 2", "failed"),
    (ZeroDivisionError("a fault"), 1, "internal error, ZeroDivisionError: a fault", "failed"),
]


@pytest.mark.parametrize("error, status, message, marked", STOPS)
def test_what_was_computed_is_kept(here, capsys, monkeypatch, error, status, message, marked):
    solve = load_steps.solve

    def stops(system, load_steps, *more):
        yield from solve(system, load_steps[:2], *more)
        raise error

    monkeypatch.setattr(load_steps, "solve", stops)
    text = SCENE.replace("[solve]", "[output]\nframes = 5\n\n[solve]")
    (here.parent / "scenes" / "web.toml").write_text(text, encoding="utf-8")
    assert main(["run", WEB, "--out", "out"]) == status
    err = capsys.readouterr().err
    assert err.startswith(f"refweb: {message}") and err.count("\n") == 1
    run = json.loads((here / "out" / "run.json").read_text())
    assert run["status"] == marked and run["message"] and len(run["steps"]) == 2
    assert files(here / "out" / "frames") == ["web_000000.vtu", "web_000001.vtu"]
    assert len((here / "out" / "history.csv").read_text().splitlines()) == 3


def test_check_and_info_write_nothing(here, capsys):
    for command in (["check", WEB], ["info", WEB], ["check", "catenary"], ["info", "hexagon-load"]):
        assert main(command) == 0
        out, err = capsys.readouterr()
        assert "nodes" in out and "tension-only" in out and err == ""
    assert main(["info", "--json", WEB]) == 0
    given = json.loads(capsys.readouterr().out)
    assert given["scene"]["cable"]["area"] == 1e-4 and given["web"]["nodes"] == 12
    assert list(here.iterdir()) == []


def test_info_of_a_folder(here, capsys):
    main(["run", WEB, "--out", "out"])
    printed = capsys.readouterr().out
    assert main(["info", "out"]) == 0
    assert "Small web: solved" in (out := capsys.readouterr().out) and "deflection" in out and "deflection" in printed
    assert main(["info", "out", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads((here / "out" / "run.json").read_text())


NO_RESULTS = [
    (None, "holds no run.json"),
    ("{", "cannot be read"),
    ("[1]", "is not what a run of refweb writes"),
    ("[" * 9999, "cannot be read"),
]


@pytest.mark.parametrize("content, message", NO_RESULTS)
def test_info_of_what_is_no_result(here, capsys, content, message):
    if content is not None:
        (here / "run.json").write_text(content)
    assert main(["info", "."]) == 2
    refused(capsys, message)


SHIPPED = {path.stem: tomllib.loads(path.read_text(encoding="utf-8")) for path in scene.SHIPPED_SCENES.glob("*.toml")}
STATIC = sorted(name for name, given in SHIPPED.items() if given["solve"]["kind"] == "static")


@pytest.mark.ordinary("square-load", "triangle-load", "catenary", "spun-tight")
@pytest.mark.parametrize("name", STATIC)
def test_shipped_scene_runs_by_name(here, capsys, name):
    given = SHIPPED[name]
    assert main(["run", name]) == 0
    (folder,) = here.iterdir()
    assert folder.name == scene.slug(given["title"])
    run = json.loads((folder / "run.json").read_text())
    assert run["status"] == "solved" and run["scene"] == given["title"]
    assert [s["step"] for s in run["steps"]] == given["solve"].get("load_steps", [1])
    assert max(s["solver"]["residual"] for s in run["steps"]) <= 1e-9


def test_slug():
    assert scene.slug("Hexagon web, 5 N!") == "hexagon-web-5-n" and scene.slug("../../etc") == "etc"
    assert scene.slug("Сеть!") == "сеть" and scene.slug("?!") == "result" and scene.slug("x" * 200) == "x" * 80


def test_no_command_and_wrong_ones(capsys):
    assert main([]) == 2 and "usage: refweb" in capsys.readouterr().out
    assert main(["--version"]) == 0
    printed = dict(line.split() for line in capsys.readouterr().out.splitlines())
    assert printed["refweb"] == refweb.__version__
    names = {"numpy", "scipy", "numba", "scikit-fem", "scikit-sundae", "pyvista", "meshio"}
    assert {name: importlib.metadata.version(name) for name in names}.items() <= printed.items()
    with pytest.raises(SystemExit) as leaving:
        main(["chek", "scene.toml"])
    assert leaving.value.code == 2
    assert 'chek: there is no such command, did you mean "check"?' in capsys.readouterr().err
    for arguments in (["frob"], ["run"], ["picture", "a", "--frame", "x"]):
        with pytest.raises(SystemExit) as leaving:
            main(arguments)
        assert leaving.value.code == 2
        assert "Traceback" not in capsys.readouterr().err


# What stands behind is asked in processes of their own: what they import, and statuses as the shell sees them.


def python(*arguments, **options):
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, timeout=120, **options)


def loaded(code, **options):
    """Names of the modules that are there after some code."""
    done = python("-c", f"{code}\nimport sys; print('MODULES', *sys.modules)", **options)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split("MODULES ")[1].split())


@pytest.mark.parametrize("option, word", [("--help", "picture"), ("--version", "pyvista")])
def test_help_and_versions_import_nothing_heavy(option, word):
    done = python("-X", "importtime", "-m", "refweb", option)
    assert done.returncode == 0 and word in done.stdout
    names = {line.split("|")[-1].strip() for line in done.stderr.splitlines() if line.startswith("import time:")}
    assert "argparse" in names and "refweb.errors" in names
    heavy = {"numpy", "scipy", "numba", "skfem", "meshio", "pyvista", "matplotlib", "sksundae", "rich", "qdldl"}
    assert not heavy & {name.split(".")[0] for name in names}


def test_import_is_lazy():
    names = loaded("import refweb; refweb.__version__, dir(refweb)")
    assert not {"numpy", "pyvista", "matplotlib", "numba", "meshio", "sksundae"} & names
    assert {name for name in names if name.startswith("refweb")} == {"refweb", "refweb.registry"}


def test_libraries_have_one_thread_unless_more_are_asked_for():
    """OpenBLAS takes two threads for products of vectors longer than 10 000, and their sum has other last digits."""
    code = """if True:
        import os, sys
        from refweb.__main__ import alone
        sys.argv[1:] = ["--version"]
        count = lambda: len(os.listdir("/proc/self/task")) if os.path.isdir("/proc/self/task") else 1
        before = count()
        assert not {"numpy"} & set(sys.modules) and alone() == 0
        import numpy
        numpy.ones(20_000) @ numpy.ones(20_000)
        print(os.environ["OPENBLAS_NUM_THREADS"], os.environ["OMP_NUM_THREADS"], count() - before)"""
    free = {name: value for name, value in os.environ.items() if not name.endswith("_THREADS")}
    for asked, words in ({}, "1 1 0"), ({"OMP_NUM_THREADS": "2"}, "1 2 "):
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env={**free, **asked})
        assert done.returncode == 0 and done.stdout.splitlines()[-1].startswith(words), done


def test_unknown_name_of_the_package():
    with pytest.raises(AttributeError, match='did you mean "Gravity"?'):
        refweb.Gravty  # noqa: B018
    assert all(getattr(refweb, name) is not None for name in refweb.__all__)


def test_a_run_loads_only_what_its_scene_calls_for(tmp_path):
    code = "from refweb.__main__ import main; assert main(['run', 'catenary', '--out', 'out']) == 0"
    names = loaded(code, cwd=tmp_path)
    assert not {"pyvista", "vtk", "matplotlib", "sksundae"} & names
    effects = {name.removeprefix("refweb.effects.") for name in names if name.startswith("refweb.effects.")}
    assert effects == {"base", "elasticity", "gravity", "line_kernels"}
    assert not {"refweb.pictures.pictures", "refweb.net.lattices", "refweb.reference"} & names


def test_statuses_as_the_shell_sees_them(tmp_path):
    (tmp_path / "web.toml").write_text(SCENE, encoding="utf-8")
    (tmp_path / "wrong.toml").write_text(SCENE.replace("area = 1e-4", "area = -1e-4"), encoding="utf-8")
    program = pathlib.Path(sys.executable).with_name("refweb")
    done = subprocess.run([program, "run", "web.toml"], capture_output=True, text=True, cwd=tmp_path, timeout=120)
    said = [line for line in done.stderr.splitlines() if " %  " not in line]  # but for progress on a busy machine
    assert done.returncode == 0 and not said and (tmp_path / "small-web" / "run.json").is_file()
    done = python("-m", "refweb", "run", "wrong.toml", "--out", "no", cwd=tmp_path)
    assert done.returncode == 2 and done.stdout == "" and not (tmp_path / "no").exists()
    assert done.stderr == "refweb: wrong.toml: [cable] area = -0.0001 must be > 0 [m²]\n"


def test_check_refuses_what_the_solver_cannot_take(here, capsys):
    """A step above the bound and a free node without mass are wrong input, to check as to run."""
    text = """
[web]
kind = "cable"
start = [0, 0, 0]
end = [1, 0, 0]
elements = 2
[cable]
law = "linear"
modulus = 1e6
area = 1e-4
density = {density}
[solve]
kind = "dynamic"
duration = 0.1
step_size = {step}
"""
    for density, step, message in [(0, 1e-6, "has no mass"), (100, 1.0, "[solve] step_size = 1 must be ≤")]:
        (here / "wrong.toml").write_text(text.format(density=density, step=step))
        for command in ("check", "run"):
            assert main([command, "wrong.toml"]) == 2
            err = capsys.readouterr().err
            assert err.startswith("refweb: wrong.toml: ") and message in err and err.count("\n") == 1
    assert files(here) == ["wrong.toml"]
