"""Studies: every case once, its row true to it, whatever ends the study; nothing computed twice.

Two arms that a force pulls to one side, of which the equilibrium is an equation of one unknown, are solved in
milliseconds, here in this process.
"""

import concurrent.futures
import concurrent.futures.process
import contextlib
import csv
import json
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import tomli_w

import refweb
from refweb.__main__ import main
from refweb.results import case_rows
from refweb.results.folder import so_far
from refweb.sweeps import case as cases

MODULUS, AREA = 1e6, 1e-4
ARMS = {
    "title": "Two arms",
    "web": {
        "kind": "inline",
        "points": [[-1, 0, 0], [0, 0, 0], [1, 0, 0]],
        "lines": [[0, 1], [1, 2]],
        "supports": [0, 2],
    },
    "cable": {"law": "tension-only", "modulus": MODULUS, "area": AREA, "density": 100.0},
    "load": [{"node": 1, "force": [0.0, 0.0, 1.0]}],
    "solve": {"kind": "static"},
}
FORCE = "load.0.force.2"
COSTS = ("cpu_s", "wall_s", "compile_s")


class Here(concurrent.futures.Executor):
    """Runs what it is given in this process, and counts it."""

    lasts = 0.0

    def __init__(self):
        self.ran = []

    def submit(self, fn, /, *args, **kwargs):
        self.ran.append(args[0].key)
        future = concurrent.futures.Future()
        future.set_result(fn(*args, **kwargs))
        return future


class MadeUp(Here):
    """Says without a solver what comes of a case, the same each time: a function of its force and area."""

    def __init__(self, lasts=0.0):
        super().__init__()
        self.lasts = lasts

    def submit(self, fn, /, job):
        time.sleep(self.lasts)
        value = job.given["load"][0]["force"][2] / 3.0 + job.given["cable"]["area"] / 7.0
        cells = {"status": "solved", "x [m]": value, "x ±": 1e-9, "cpu_s": 0.1}
        return super().submit(lambda job: cases.Outcome(job.key, cells, {"x": value}, None), job)


def arms(**tables):
    return refweb.Scene.from_dict({**ARMS, **tables})


def rows_of(folder):
    """Rows of ``results.csv`` without what they cost, and the names of its columns."""
    with open(folder / "results.csv", encoding="utf-8", newline="") as file:
        columns, *rows = csv.reader(file)
    assert all(len(row) == len(columns) for row in rows)
    return columns, [{c: cell for c, cell in zip(columns, row, strict=True) if c not in COSTS} for row in rows]


def balance(force, area, deflection):
    """Force that is left on the middle node [N]: 2 T z/l − F, T = E A (l − 1)."""
    length = np.hypot(1.0, deflection)
    return 2.0 * MODULUS * area * (length - 1.0) * deflection / length - force


def write_study(folder, **keys):
    """A study file and its scene, in a folder; its path."""
    (folder / "arms.toml").write_text(tomli_w.dumps(ARMS))
    given = {"scene": "arms.toml", "parameters": {FORCE: [1.0, 2.0, 3.0]}, **keys}
    (folder / "study.toml").write_text(tomli_w.dumps(given))
    return folder / "study.toml"


# Cases


def test_every_row_is_that_of_its_case(tmp_path):
    found = refweb.sweep(
        arms(), {FORCE: [1.0, 2.0], "cable.area": {"from": 1e-4, "to": 4e-4, "count": 3}}, tmp_path / "s", Here()
    )
    assert [(row[FORCE], row["cable.area"]) for row in found.rows] == [
        (force, pytest.approx(area)) for force in (1.0, 2.0) for area in (1e-4, 2.5e-4, 4e-4)
    ]
    for row in found.rows:
        value, error = row["deflection [m]"], row["deflection ±"]
        least, most = (balance(row[FORCE], row["cable.area"], value + sign * (error + 1e-15)) for sign in (-1, 1))
        assert row["status"] == "solved" and least < 0.0 < most
    assert found.status == "solved" and found.count == {"solved": 6}
    columns, written = rows_of(tmp_path / "s")
    assert columns[:4] == ["case", "status", FORCE, "cable.area"] and columns[-3:] == list(COSTS)
    assert [float(row["deflection [m]"]) for row in written] == list(found.values("deflection"))
    frame = found.to_pandas()
    assert list(frame.columns) == columns and frame["deflection [m]"].to_list() == list(found.values("deflection"))
    summary = json.loads((tmp_path / "s" / "run.json").read_text())
    assert (summary["kind"], summary["status"], summary["cases"]) == ("sweep", "solved", 6)


def test_rows_of_another_study_are_said_to_be_set_aside(tmp_path, capsys):
    """Both studies have one case in common; the box at the start, that at the end and `refweb info` say the rest."""
    refweb.sweep(arms(), {FORCE: [1.0, 2.0, 3.0]}, tmp_path / "s", MadeUp())
    found = refweb.sweep(arms(), {FORCE: [3.0, 4.0]}, tmp_path / "s", MadeUp())
    assert found.reasons == ["2 rows of another study, of other cases or another scene, set aside in set-aside.csv"]
    assert main(["info", str(tmp_path / "s")]) == 0
    assert "2 rows of another study" in capsys.readouterr().out


def test_a_killed_study_counts_its_rows(tmp_path):
    """``run.json`` is that of its start, and the table has what came after."""
    folder = tmp_path / "s"
    refweb.sweep(arms(), {FORCE: [1.0, 2.0, 3.0]}, folder, MadeUp())
    lines = (folder / "results.csv").read_text().splitlines(keepends=True)
    (folder / "results.csv").write_text("".join(lines[:3]))
    before = {"kind": "sweep", "status": "running", "message": "", "count": {"waiting": 3}}
    assert so_far(folder, before)["count"] == {"solved": 2, "waiting": 1}
    assert so_far(folder, {**before, "count": {"skipped": 1, "waiting": 3}})["count"] == {
        "solved": 2,
        "skipped": 1,
        "waiting": 1,
    }


def test_it_agrees_with_runs_one_by_one():
    found = refweb.sweep(arms(), {"load.0.force": [[0, 0, 1], [0, 1, 1]]}, executor=Here())
    for row, force in zip(found.rows, ([0, 0, 1], [0, 1, 1]), strict=True):
        alone = refweb.run(arms(load=[{"node": 1, "force": force}])).results
        assert {name: row[f"{name} [{r.unit}]"] for name, r in alone.items()} == {n: r.value for n, r in alone.items()}
        assert {name: row[f"{name} ±"] for name in alone} == {n: r.error for n, r in alone.items()}


def test_one_beside_the_other_and_ranges_of_ratios():
    parameters = {FORCE: [1.0, 2.0, 2.0], "cable.area": {"from": 1e-4, "to": 1e-2, "count": 3, "spacing": "log"}}
    found = refweb.sweep(arms(), parameters, executor=Here(), sample="zip")
    pairs = [(row[FORCE], row["cable.area"]) for row in found.rows]
    assert pairs == [(1.0, 1e-4), (2.0, pytest.approx(1e-3)), (2.0, 1e-2)]


def test_equal_scenes_are_run_once():
    """Each has its row all the same: a name of a path and its number say one thing."""
    here = Here()
    found = refweb.sweep(
        arms(), {FORCE: {"distribution": "randint", "low": 1, "high": 3}}, executor=here, sample="random", count=12
    )
    assert len(found.rows) == 12 and len(here.ran) == 2 == len({row["deflection [m]"] for row in found.rows})
    assert len({(row[FORCE], row["deflection [m]"]) for row in found.rows}) == 2


def test_skipped_cases_say_why(tmp_path, capsys):
    path = write_study(tmp_path, skip=f"{FORCE} > 2 or {FORCE} == 1")
    here = Here()
    found = refweb.sweep(path, out=tmp_path / "s", executor=here)
    assert [row["status"] for row in found.rows] == ["skipped", "solved", "skipped"] and len(here.ran) == 1
    assert found.rows[0]["message"].startswith("skip: ") and "2 of 3 cases are skipped" in found.reasons[0]
    assert main(["info", str(tmp_path / "s")]) == 0 and "2 of 3 cases are skipped" in capsys.readouterr().out


def test_failures_are_rows(tmp_path):
    """A load along which nothing carries at all is no answer, and a node that is not there no input."""
    web = {**ARMS["web"], "points": [*ARMS["web"]["points"], [5.0, 0.0, 0.0], [6.0, 0.0, 0.0]]}
    web |= {"lines": [[0, 1], [1, 2], [3, 4]]}
    found = refweb.sweep(arms(web=web), {"load.0.node": [1, 4, 9]}, tmp_path / "s", Here())
    assert [row["status"] for row in found.rows] == ["solved", "failed", "refused"]
    assert found.rows[1]["message"] and "load.0.node" not in found.rows[1]["message"]
    assert "9" in found.rows[2]["message"] and found.status == "solved"
    again = Here()
    refweb.sweep(arms(web=web), {"load.0.node": [1, 4, 9]}, tmp_path / "s", again)
    assert again.ran == [], "what has failed fails again"


# Going on


def test_changed_parameters_add_and_drop_cases_and_nothing_is_computed_twice(tmp_path):
    first, second, third = Here(), Here(), Here()
    refweb.sweep(arms(), {FORCE: [1.0, 2.0, 3.0]}, tmp_path / "s", first)
    found = refweb.sweep(arms(), {FORCE: [3.0, 4.0], "cable.area": [AREA]}, tmp_path / "s", second)
    assert len(first.ran) == 3 and len(second.ran) == 1 and found.values(FORCE).tolist() == [3.0, 4.0]
    assert [row[FORCE] for row in rows_of(tmp_path / "s")[1]] == ["3.0", "4.0"]
    found = refweb.sweep(arms(), {"load.0.force": [[0, 0, f] for f in (1, 2, 3, 4)]}, tmp_path / "s", third)
    assert third.ran == [] and found.count == {"solved": 4} and FORCE not in found.columns
    other = Here()
    refweb.sweep(arms(cable={**ARMS["cable"], "modulus": 2e6}), {FORCE: [1.0]}, tmp_path / "s", other)
    assert len(other.ran) == 1, "another scene is another case"


def test_a_title_is_no_part_of_a_case(tmp_path):
    here = Here()
    for title in ("One", "Two"):
        refweb.sweep(arms(title=title), {FORCE: [1.0]}, tmp_path / "s", here)
    assert len(here.ran) == 1


def test_files_are_part_of_a_case(tmp_path):
    """The content of a mesh, not its name."""
    import meshio

    here, path = Here(), tmp_path / "net.vtu"
    for half in (1.0, 2.0, 1.0):
        points = np.array([[-half, 0, 0], [0, 0, 0], [half, 0, 0]])
        meshio.write(path, meshio.Mesh(points, [("line", [[0, 1], [1, 2]])]))
        tables = {"web": {"kind": "file", "path": str(path)}, "supports": {"nodes": [0, 2]}}
        refweb.sweep(arms(**tables), {FORCE: [1.0]}, tmp_path / "s", here)
    assert len(here.ran) == 2


class Elsewhere(Here):
    """A machine that has other files: while it runs a case, those of this one are away."""

    def __init__(self, *paths, instead=None):
        super().__init__()
        self.paths, self.instead = paths, instead

    def submit(self, fn, /, job):
        aside = [path.with_name(f"{path.name} aside") for path in self.paths]
        for path, beside in zip(self.paths, aside, strict=True):
            path.rename(beside)
            if self.instead is not None:
                path.write_bytes(self.instead)
        try:
            return super().submit(fn, job)
        finally:
            for path, beside in zip(self.paths, aside, strict=True):
                path.unlink(missing_ok=True)
                beside.rename(path)


@pytest.mark.parametrize("instead", [None, b"x,y,z\n0,0,0\n"])
def test_files_travel_with_a_case(tmp_path, instead):
    """To machines that do not have them, or others of that name; the rows are those of this machine."""
    nodes, lines = tmp_path / "nodes.csv", tmp_path / "lines.csv"
    nodes.write_text("x,y,z\n-1,0,0\n0,0,0\n1,0,0\n")
    lines.write_text("i,j\n0,1\n1,2\n")
    web = {"kind": "file", "path": "nodes.csv", "lines": "lines.csv"}
    (tmp_path / "arms.toml").write_text(tomli_w.dumps({**ARMS, "web": web, "supports": {"nodes": [0, 2]}}))
    (tmp_path / "study.toml").write_text(tomli_w.dumps({"scene": "arms.toml", "parameters": {FORCE: [1.0, 2.0]}}))
    there = refweb.sweep(tmp_path / "study.toml", executor=Elsewhere(nodes, lines, instead=instead))
    here = refweb.sweep(tmp_path / "study.toml", executor=Here())
    assert here.count == there.count == {"solved": 2}
    assert (there.values("deflection") == here.values("deflection")).all()


def test_a_run_that_a_case_starts_from_travels_with_it(tmp_path):
    dynamic = {"kind": "dynamic", "duration": 1e-3}
    refweb.run(arms(), out=tmp_path / "first", progress=False)
    scene = {**ARMS, "solve": {**dynamic, "start": "first"}}
    (tmp_path / "arms.toml").write_text(tomli_w.dumps(scene))
    (tmp_path / "study.toml").write_text(tomli_w.dumps({"scene": "arms.toml", "parameters": {FORCE: [1.0, 2.0]}}))
    there = refweb.sweep(tmp_path / "study.toml", executor=Elsewhere(tmp_path / "first"))
    here = refweb.sweep(tmp_path / "study.toml", executor=Here())
    assert here.count == there.count == {"solved": 2}, there.rows
    assert (there.values("deflection") == here.values("deflection")).all()


@pytest.mark.parametrize("keep", ["json", "all"])
def test_what_is_kept(tmp_path, keep):
    here, out = Here(), tmp_path / "s"
    found = refweb.sweep(arms(), {FORCE: [1.0, 2.0]}, out, here, keep=keep)
    kept = sorted(path.name for path in (out / "cases").iterdir())
    assert kept == sorted(row["case"] + (".json" if keep == "json" else "") for row in found.rows)
    key = found.rows[1]["case"]
    if keep == "json":
        summary = json.loads((out / "cases" / f"{key}.json").read_text())
        (out / "cases" / f"{key}.json").unlink()
    else:
        summary = refweb.load(out / "cases" / key).summary()
        shutil.rmtree(out / "cases" / key)
    assert summary["results"]["deflection"]["value"] == found.rows[1]["deflection [m]"]
    refweb.sweep(arms(), {FORCE: [1.0, 2.0]}, out, here, keep=keep)
    assert here.ran == [found.rows[0]["case"], key, key], "what is not there any more is computed again"


# Wrong input

WRONG = {
    "misspelt key": ({"sampel": "grid"}, 'did you mean "sample"?'),
    "misspelt path": ({"parameters": {"cable.aera": [1.0]}}, 'did you mean "area"?'),
    "no list": ({"parameters": {FORCE: 1.0}}, "must be a list of cases"),
    "empty": ({"parameters": {FORCE: []}}, "must hold at least one case"),
    "nothing": ({"parameters": {}}, "must be a table of values by path"),
    "twice": ({"parameters": {FORCE: [1.0, 2.0, 1.0]}}, "stands there twice"),
    "twice in a zip": (
        {"sample": "zip", "parameters": {FORCE: [1.0, 2.0, 1.0], "cable.area": [1e-4, 1e-4, 1e-4]}},
        "and cable.area: 1.0, 0.0001 stands there twice",
    ),
    "range": ({"parameters": {FORCE: {"from": 0, "too": 1}}}, 'did you mean "to"?'),
    "range count": ({"parameters": {FORCE: {"from": 0, "to": 1}}}, "count is missing"),
    "log": ({"parameters": {FORCE: {"from": 0, "to": 1, "count": 2, "spacing": "log"}}}, "must be > 0"),
    "name": ({"parameters": {FORCE: {"distribution": "normm"}}}, 'did you mean "norm"?'),
    "shape": ({"parameters": {FORCE: {"distribution": "norm", "sclae": 1}}}, 'did you mean "scale"?'),
    "shape missing": (
        {"parameters": {FORCE: {"distribution": "gamma"}}, "sample": "random", "count": 2},
        "a is missing",
    ),
    "scale": ({"parameters": {FORCE: {"distribution": "norm", "scale": -1.0}}}, "does not exist with scale = -1"),
    "grid": ({"parameters": {FORCE: {"distribution": "norm"}}}, 'needs sample = one of "random"'),
    "zip": ({"sample": "zip", "parameters": {FORCE: [1.0, 2.0], "cable.area": [1e-4]}}, "as many values of each"),
    "count": ({"sample": "sobol", "parameters": {FORCE: {"from": 0, "to": 1}}}, "count is missing"),
    "nothing drawn": ({"sample": "sobol", "count": 4}, "needs a range or a distribution"),
    "count of a grid": ({"count": 4}, 'count = 4 has no meaning with sample = "grid"'),
    "indices": (
        {"sample": "halton", "count": 4, "indices": True, "parameters": {FORCE: {"from": 1, "to": 2}}},
        "sobol",
    ),
    "power": (
        {"sample": "sobol", "count": 5, "indices": True, "parameters": {FORCE: {"from": 1, "to": 2}}},
        "power of 2",
    ),
    "value": ({"parameters": {"cable.area": [1e-4, -1e-4]}}, "area = -0.0001 must be > 0"),
    "skip": ({"skip": "mass > 1"}, "skip:"),
    "all skipped": ({"skip": f"{FORCE} > 0"}, "leaves no case of 3"),
    "condition": ({"conditions": {"safe": "max_stres < 1"}}, 'did you mean "max_stress"?'),
    "scene": ({"scene": "squre-impact"}, 'did you mean "square-impact"?'),
    "keep": ({"keep": "al"}, 'did you mean "all"?'),
    "quantile": ({"quantiles": [1.5]}, "must be between 0 and 1"),
    "build": ({"parameters": {"load.0.node": [7, 1]}}, "load.0.node = 7"),
    "web": ({"web": {}, "parameters": None}, "is a scene, not a study"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_studies_are_one_line_and_change_nothing(name, tmp_path, capsys, monkeypatch):
    keys, message = WRONG[name]
    path = write_study(tmp_path)
    given = {"scene": "arms.toml", "parameters": {FORCE: [1.0, 2.0, 3.0]}, **keys}
    path.write_text(tomli_w.dumps({key: value for key, value in given.items() if value is not None}))
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", str(path), "--out", "s"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("refweb: ") and message in err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["arms.toml", "study.toml"]


def test_folders_of_something_else_are_refused(tmp_path, capsys):
    path = write_study(tmp_path)
    refweb.run(arms(), out=tmp_path / "run")
    before = files_of(tmp_path)
    for folder, message in (("run", "holds no study"), ("arms.toml", "is a file, not a folder")):
        assert main(["sweep", str(path), "--out", str(tmp_path / folder)]) == 2
        assert message in capsys.readouterr().err
    assert files_of(tmp_path) == before


def files_of(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_a_study_that_is_alive_is_left_alone(tmp_path):
    class Asks(Here):
        def submit(self, fn, /, *args, **kwargs):
            with pytest.raises(refweb.InputError, match="is alive"):
                refweb.sweep(arms(), {FORCE: [1.0]}, tmp_path / "s", Here())
            return super().submit(fn, *args, **kwargs)

    refweb.sweep(arms(), {FORCE: [1.0]}, tmp_path / "s", Asks())


def test_what_python_is_told(tmp_path):
    for given, message in (
        ({"workers": 2, "executor": Here()}, "workers = 2 has no meaning with an executor"),
        ({"workers": 0}, "workers = 0 must be"),
        ({"sampel": "grid"}, 'did you mean "sample"?'),
    ):
        with pytest.raises(refweb.InputError, match=message.replace("?", r"\?")):
            refweb.sweep(arms(), {FORCE: [1.0]}, **given)
    with pytest.raises(refweb.InputError, match="parameters are missing"):
        refweb.sweep(arms())
    with pytest.raises(refweb.InputError, match="neither a result nor a parameter"):
        refweb.sweep(arms(), {FORCE: [1.0]}, executor=Here()).values("deflecton")


# Workers that die


class Dies(Here):
    """Loses some of what it is given, for as often as it is said, as pools do."""

    def __init__(self, times):
        super().__init__()
        self.times = dict(times)

    def submit(self, fn, /, *args, **kwargs):
        force = args[0].given["load"][0]["force"][2]
        if self.times.get(force, 0) > 0:
            self.times[force] -= 1
            future = concurrent.futures.Future()
            future.set_exception(concurrent.futures.process.BrokenProcessPool("a process died"))
            return future
        return super().submit(fn, *args, **kwargs)


def test_a_case_whose_worker_died_is_tried_again(tmp_path):
    whole = refweb.sweep(arms(), {FORCE: [1.0, 2.0, 3.0, 4.0]}, tmp_path / "whole", Here())
    found = refweb.sweep(arms(), {FORCE: [1.0, 2.0, 3.0, 4.0]}, tmp_path / "s", Dies({2.0: 1, 3.0: 2}))
    assert rows_of(tmp_path / "s") == rows_of(tmp_path / "whole") and found.count == whole.count


def test_a_case_that_kills_its_worker_is_given_up_and_tried_at_the_next_start(tmp_path):
    found = refweb.sweep(arms(), {FORCE: [1.0, 2.0, 3.0]}, tmp_path / "s", Dies({2.0: 99}))
    assert [row["status"] for row in found.rows] == ["solved", "lost", "solved"]
    assert "its worker died 3 times (BrokenProcessPool: a process died)" in found.rows[1]["message"]
    here = Here()
    found = refweb.sweep(arms(), {FORCE: [1.0, 2.0, 3.0]}, tmp_path / "s", here)
    assert found.count == {"solved": 3} and here.ran == [found.rows[1]["case"]]


def test_an_executor_that_takes_no_more_is_said(tmp_path):
    class Ends(Here):
        def submit(self, fn, /, *args, **kwargs):
            if len(self.ran) == 2:
                raise RuntimeError("cannot schedule new futures after shutdown")
            return super().submit(fn, *args, **kwargs)

    with pytest.raises(refweb.SolverError, match="Ends, takes no more cases: cannot schedule"):
        refweb.sweep(arms(), {FORCE: [1.0, 2.0, 3.0]}, tmp_path / "s", Ends())
    summary = json.loads((tmp_path / "s" / "run.json").read_text())
    assert summary["status"] == "failed" and len(rows_of(tmp_path / "s")[1]) == 2


# Kills

TWELVE = {FORCE: [1.0, 2.0, 3.0, 4.0], "cable.area": [1e-4, 2e-4, 3e-4]}


def in_child(call):
    """Start a call in a forked process; its id."""
    child = os.fork()
    if child:
        return child
    status = 1
    try:
        call()
        status = 0
    finally:
        os._exit(status)


def whole_folder(cut, expected):
    """Check what a kill has left: rows are whole, none twice, and those of an undisturbed study."""
    if not (cut / "results.csv").exists():
        return 0
    columns, rows = rows_of(cut)
    keys = [row["case"] for row in rows]
    assert len(set(keys)) == len(keys)
    true = {row["case"]: row for row in expected}
    for row in rows:
        assert {k: v for k, v in row.items() if v} == {k: v for k, v in true[row["case"]].items() if v}
    return len(rows)


def injected(folder):
    """Kill a study before and after each of its writes, go on with it, and compare; prints the number of writes."""
    study = {"parameters": {FORCE: [1.0, 2.0, 3.0]}, "keep": "json"}
    refweb.sweep(arms(), out=folder / "whole", executor=MadeUp(), **study)
    expected = rows_of(folder / "whole")
    last = None
    for number in range(10_000):
        for after in (False, True):
            cut = folder / f"cut-{number}-{after}"

            def killed(cut=cut, number=number, after=after):
                count = [0]

                def around(own):
                    def write(*args, **kwargs):
                        mine, count[0] = count[0] == number, count[0] + 1
                        if mine and not after:
                            os.kill(os.getpid(), signal.SIGKILL)
                        done = own(*args, **kwargs)
                        if mine:
                            os.kill(os.getpid(), signal.SIGKILL)
                        return done

                    return write

                for place, name in ((os, "replace"), (case_rows.CaseRows, "add"), (pathlib.Path, "mkdir")):
                    setattr(place, name, around(getattr(place, name)))
                refweb.sweep(arms(), out=cut, executor=MadeUp(), **study)

            status = os.waitpid(in_child(killed), 0)[1]
            if not os.WIFSIGNALED(status):
                last = number
                assert status == 0
            whole_folder(cut, expected[1])
            refweb.sweep(arms(), out=cut, executor=MadeUp(), **study)
            assert rows_of(cut) == expected
            assert sorted(p.name for p in cut.rglob("*")) == sorted(p.name for p in (folder / "whole").rglob("*"))
            shutil.rmtree(cut)
        if last is not None:
            break
    print(last)


def kill_often(count, folder, seed, crew):
    """Kill a study of 12 cases at moments over all of it, go on, and compare; prints how many rows kills have left."""
    chance, left = random.Random(seed), []
    for name in ("first", "whole"):
        began = time.perf_counter()
        refweb.sweep(arms(), TWELVE, folder / name, crew())
        lasts = time.perf_counter() - began
    expected, cut = rows_of(folder / "whole"), folder / "cut"
    assert len(expected[1]) == 12
    for number in range(count):
        child = in_child(lambda: refweb.sweep(arms(), TWELVE, cut, crew()))
        if number % 4:  # most of them when rows are written
            while not (cut / "results.csv").exists() and not os.waitpid(child, os.WNOHANG)[0]:
                time.sleep(1e-3)
            lasts = 12 * crew().lasts or lasts
        time.sleep(chance.uniform(0.0, lasts))
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        left.append(whole_folder(cut, expected[1]))
        if chance.random() < 0.3:
            continue
        found = refweb.sweep(arms(), TWELVE, cut, crew())
        assert found.count == {"solved": 12} and rows_of(cut) == expected
        shutil.rmtree(cut)
    print(*left)


def alone(job, folder, *arguments):
    """What a function of this file prints in a process that has one thread, which may fork."""
    command = [sys.executable, __file__, job, str(folder), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, done.stderr
    return [int(number) for number in done.stdout.split()]


def test_a_kill_before_and_after_every_write(tmp_path):
    assert alone("injected", tmp_path)[0] >= 12


@pytest.mark.slow
def test_kills(tmp_path):
    """A study that is killed at any moment keeps whole rows, and goes on to the rows of a study that is not."""
    left = alone("kills", tmp_path, 8, 1, "made-up")
    assert len(left) == 8 and sum(0 < rows < 12 for rows in left) >= 1


@pytest.mark.slow
def test_a_hundred_kills(tmp_path):
    left = alone("kills", tmp_path, 100, 2, "solved")
    assert len(left) == 100 and sum(0 < rows < 12 for rows in left) >= 30


def test_a_study_killed_after_its_third_row(tmp_path):
    """Twelve rows, none twice, equal to those of an undisturbed study bit for bit."""

    class Stops(Here):
        def submit(self, fn, /, *args, **kwargs):
            if len(self.ran) == 3:
                raise KeyboardInterrupt
            return super().submit(fn, *args, **kwargs)

    refweb.sweep(arms(), TWELVE, tmp_path / "whole", Here())
    with pytest.raises(KeyboardInterrupt):
        refweb.sweep(arms(), TWELVE, tmp_path / "cut", Stops())
    summary = json.loads((tmp_path / "cut" / "run.json").read_text())
    assert summary["status"] == "interrupted" and "of 12 cases" in summary["message"]
    here = Here()
    refweb.sweep(arms(), TWELVE, tmp_path / "cut", here)
    assert rows_of(tmp_path / "cut") == rows_of(tmp_path / "whole") and len(here.ran) in (9, 10, 11)


def test_a_torn_row_is_left_out(tmp_path):
    refweb.sweep(arms(), {FORCE: [1.0, 2.0]}, tmp_path / "s", Here())
    whole = rows_of(tmp_path / "s")
    table = tmp_path / "s" / "results.csv"
    table.write_bytes(table.read_bytes()[:-7])
    here = Here()
    refweb.sweep(arms(), {FORCE: [1.0, 2.0]}, tmp_path / "s", here)
    assert len(here.ran) == 1 and rows_of(tmp_path / "s") == whole


def test_a_full_disk_is_one_line(tmp_path, monkeypatch):
    def full(*given):
        raise OSError(28, "No space left on device")

    class Fills(Here):
        def submit(self, fn, /, *args, **kwargs):
            monkeypatch.setattr(cases, "keep_outcome", full)
            monkeypatch.setattr("refweb.sweeps.sweep.keep_outcome", full)
            return super().submit(fn, *args, **kwargs)

    with pytest.raises(refweb.SolverError, match="cannot be written any more: No space left"):
        refweb.sweep(arms(), {FORCE: [1.0, 2.0]}, tmp_path / "s", Fills())


if __name__ == "__main__":
    sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))
    if sys.argv[1] == "injected":
        injected(pathlib.Path(sys.argv[2]))
    else:
        crew = Here if sys.argv[5] == "solved" else lambda: MadeUp(0.05)
        kill_often(int(sys.argv[3]), pathlib.Path(sys.argv[2]), int(sys.argv[4]), crew)


# Verdicts


def test_a_row_has_the_verdict_on_each_result(tmp_path):
    """As the run of the case has it, empty where that has none; the rows of a file read back to the same."""
    folder = tmp_path / "study"
    found = refweb.sweep(arms(), {FORCE: [0.5, 1.0]}, folder, executor=Here(), progress=False)
    for force, row in zip((0.5, 1.0), found.rows, strict=True):
        alone = refweb.run(arms(load=[{"node": 1, "force": [0.0, 0.0, force]}]), progress=False)
        assert {name: row[f"{name} verdict"] for name in alone.results} == {
            name: result.verdict for name, result in alone.results.items()
        }
        assert "determined" in row.values()
    assert case_rows.read(folder / case_rows.NAME) == [
        {column: row.get(column) for column in found.columns} for row in found.rows
    ]
    again = refweb.sweep(arms(), {FORCE: [0.5, 1.0, 2.0]}, folder, executor=Here(), progress=False)
    assert [row["max_tension verdict"] for row in again.rows] == ["determined"] * 3


def test_a_run_without_a_verdict_leaves_its_cell_empty():
    entry = {"value": 1.0, "error": 0.1, "unit": "m", "time": 0.0, "where": None}
    given = {"status": "solved", "message": "", "results": {"a": entry, "b": {**entry, "verdict": None}}}
    cells = cases.cells_of(given)
    assert "a verdict" not in cells and cells["b verdict"] is None
    assert case_rows.results_among(cells) == [case_rows.Named("a", "m"), case_rows.Named("b", "m")]
    assert set(case_rows.result_cells(cells)) == set(cells)
