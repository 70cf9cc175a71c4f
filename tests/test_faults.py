"""Runs that end where they must not: killed, interrupted, on a full disk, in a folder that is taken away.

What is left opens, says that it is not solved, and goes on with ``refweb resume``.
"""

import errno
import json
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

import meshio
import numpy as np
import pytest
import tomli_w
from nets import some

import refweb
from refweb.__main__ import main
from refweb.dynamics.integrators import central_difference, step_observer
from refweb.errors import EnergyDriftError

WEB = refweb.Window(mesh="hexagon", rows=4, columns=3, side=0.2)
CABLE = refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=200.0)
BALL = refweb.Body(name="ball", radius=0.1, mass=1.0, position=(0.0, 0.0, -0.11), velocity=(0.3, 0.0, 2.0))
HIT = (BALL, refweb.Contact(stiffness=1e4))
EVENTS = (
    refweb.Event(name="touch", kind="contact"),
    refweb.Event(name="far", kind="threshold", observe="deflection", value=0.03),
)


def scene(method="central-difference", effects=HIT, error="none", frames=2, duration=0.03, solve=None, **changes):
    changes = {"web": WEB, "cable": CABLE, **changes}
    return refweb.Scene(
        effects=effects,
        solve=refweb.Dynamic(method=method, duration=duration, **(solve or {})),
        output=refweb.Output(interval=1e-3, frames=frames),
        accuracy=refweb.Accuracy(error=error),
        **changes,
    )


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def summary_of(folder):
    return json.loads((folder / "run.json").read_text(encoding="utf-8"))


def told(folder):
    """What ``run.json`` says, but for what it cost."""
    return {key: value for key, value in summary_of(folder).items() if key != "cost"}


def opens(folder):
    """Check all that a killed run has left, and return its number of history rows."""
    assert summary_of(folder)["status"] != "solved"
    rows = 0
    if (folder / "history.csv").exists():
        text = (folder / "history.csv").read_text()
        lines = text.splitlines()
        assert text == "" or text.endswith("\n") and len({line.count(",") for line in lines}) == 1
        rows = max(len(lines) - 1, 0)
    if (folder / "web.pvd").exists():
        for name in re.findall(r'file="([^"]+)"', (folder / "web.pvd").read_text()):
            mesh = meshio.read(folder / name)
            assert np.isfinite(mesh.points).all() and "velocity" in mesh.point_data
    if (folder / "checkpoint.npz").exists():
        with np.load(folder / "checkpoint.npz") as checkpoint:
            assert all(len(checkpoint[key]) == len(checkpoint["positions"]) for key in ("velocities", "displacements"))
            assert int(checkpoint["row"]) < rows
    return rows


def stop_behind(monkeypatch, end, error=KeyboardInterrupt):
    """Make runs in the main thread stop with an error behind a time; returns what takes that back."""

    def stopping(own):
        def advance(self, course, times):
            if course.time > end and threading.current_thread() is threading.main_thread():
                raise error
            return own(self, course, times)

        return advance

    with_stop = monkeypatch.context()
    patch = with_stop.__enter__()
    for solver in (central_difference.CentralDifference, step_observer.StepObserver):
        patch.setattr(solver, "advance", stopping(solver.advance))
    return lambda: with_stop.__exit__(None, None, None)


# Resumed runs

MOVED = refweb.Motion(node=[0, 1], displacement=[[0.0, 0.0, 0.0, 0.0], [0.02, 0.01, 0.0, 0.0]])
CASES = {
    "hit": {},
    "twin": dict(error="twin", event=EVENTS),
    "friction": dict(effects=(BALL, refweb.Contact(stiffness=1e4, friction=0.3, damping=0.1))),
    "damping": dict(effects=(*HIT, refweb.Damping(time=1e-4, rate=2.0), refweb.Gravity(acceleration=(0, 0, -9.81)))),
    "reel": dict(effects=(*HIT, refweb.Reel(lines="all", factor=[[0.0, 1.0], [0.02, 0.98]]))),
    "moved": dict(effects=(*HIT, MOVED)),
    "turning": dict(effects=(refweb.Thrust(node=5, line=4, force=1.0), *HIT, refweb.PointMass(node=3, mass=0.1))),
    "equilibrium": dict(effects=(*HIT, refweb.Load(node="centre", force=(0, 0, 0.5))), solve=dict(start="equilibrium")),
    "order 6": dict(solve=dict(method="explicit")),
    "stopped": dict(event=(refweb.Event(name="end", kind="threshold", observe="deflection", value=0.05, stop=True),)),
}


def of_case(name):
    changes = dict(CASES[name])
    solve = dict(changes.pop("solve", {}))
    return scene(solve.pop("method", "central-difference"), solve=solve, **changes)


@pytest.mark.parametrize("name", CASES)
def test_an_interrupted_run_goes_on_bit_for_bit(tmp_path, monkeypatch, name):
    """All files but the costs in ``run.json`` are those of the undisturbed run."""
    case, whole, cut = of_case(name), tmp_path / "whole", tmp_path / "cut"
    refweb.run(case, out=whole)
    restore = stop_behind(monkeypatch, 0.0105)
    with pytest.raises(KeyboardInterrupt):
        refweb.run(case, out=cut)
    restore()
    assert 0 < opens(cut) < 30 and summary_of(cut)["status"] == "interrupted"
    solution = refweb.resume(cut)
    assert solution.status == "solved"
    expected, found = files(whole), files(cut)
    assert expected.keys() == found.keys()
    assert [key for key in expected if expected[key] != found[key]] == ["run.json"]
    assert told(cut) == told(whole)


@pytest.mark.parametrize("name", some(CASES, 3))
def test_a_row_in_pieces_is_the_same_row(tmp_path, monkeypatch, name):
    """The compiled loop comes back after every step, some of them, or none."""
    written = []
    for breath in (0, 3 * 40, 10**9):
        monkeypatch.setattr(central_difference, "BREATH", breath)
        refweb.run(of_case(name), out=tmp_path / str(breath))
        written.append(files(tmp_path / str(breath)))
        written[-1].pop("run.json")
    assert written[0] == written[1] == written[2]


def test_a_long_row_is_interrupted(tmp_path, monkeypatch):
    """Within a row of some thousand steps; what is left is the row before."""
    monkeypatch.setattr(central_difference, "BREATH", 0)
    case, times = scene(duration=0.1).replace(output=refweb.Output(interval=0.02)), []

    def progress(text, share):
        times.append(share)
        if share > 0.75:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refweb.run(case, out=tmp_path / "out", progress=progress)
    assert len(times) > 50 and times[-1] < 0.8
    rows = (tmp_path / "out" / "history.csv").read_text(encoding="utf-8").splitlines()[1:]
    assert summary_of(tmp_path / "out")["message"] == f"interrupted after t = {0.02 * (len(rows) - 1):g} s"


@pytest.mark.slow
@pytest.mark.parametrize("method", ["cvode", "ida"])
def test_an_interrupted_run_goes_on_within_tolerance(tmp_path, monkeypatch, method):
    """The solver begins anew at the checkpoint, so that rounding and step sizes differ, but neither books nor peaks.

    The difference is that of two solutions of rtol = 1e-7; 1e3 is what the contact of a slack web amplifies it by.
    """
    moved = refweb.Motion(node=[0, 1], displacement=[[0.0, 0.0, 0.0, 0.0], [0.01, 1e-3, 0.0, 0.0]])
    case = scene(method, effects=(*HIT, moved), solve=dict(rtol=1e-7), event=EVENTS[:1], duration=0.016)
    undisturbed = refweb.run(case)
    restore = stop_behind(monkeypatch, 0.0105)
    with pytest.raises(KeyboardInterrupt):
        refweb.run(case, out=tmp_path)
    restore()
    solution = refweb.resume(tmp_path)
    assert 0.5 < solution.solver["nsteps"] / undisturbed.solver["nsteps"] < 2.0
    for name, column in undisturbed.history.items():
        scale = np.abs(column).max()
        if "momentum" in name or "impulse" in name:
            scale = max(np.abs(undisturbed.history[f"{name[:-1]}{axis}"]).max() for axis in "xyz")
        np.testing.assert_allclose(solution.history[name], column, rtol=0, atol=1e-4 * scale, err_msg=name)
    for name, result in undisturbed.results.items():
        np.testing.assert_allclose(solution.results[name].value, result.value, rtol=1e-4)
    for found, event in zip(solution.events, undisturbed.events, strict=True):
        np.testing.assert_allclose(found["time"], event["time"], rtol=1e-4)


@pytest.mark.slow
def test_rigid_links_go_on(tmp_path, monkeypatch):
    """A run with rigid links that is interrupted and resumed has the results of one that is not."""
    chain = refweb.Inline(points=[[0.0, 0.0, -0.5 * i] for i in range(4)], lines=[[0, 1], [1, 2], [2, 3]], supports=[0])
    kick = refweb.Velocity(node=3, value=(1.0, 0.0, 0.0))
    case = scene("ida", web=chain, effects=(refweb.Link(nodes=[1, 2]), kick), solve=dict(rtol=1e-8))
    undisturbed = refweb.run(case)
    restore = stop_behind(monkeypatch, 0.0105)
    with pytest.raises(KeyboardInterrupt):
        refweb.run(case, out=tmp_path)
    restore()
    solution = refweb.resume(tmp_path)
    np.testing.assert_allclose(solution.positions, undisturbed.positions, rtol=0, atol=1e-6)
    assert max(solution.solver["constraint_drift"]) > 0.0


def test_a_repeated_run_goes_on_with_its_accuracy(tmp_path, monkeypatch):
    """One whose energy book was open is repeated with half the step; interrupted there, it goes on with that."""
    case = scene()
    drifts = [refweb.run(scene(solve=dict(safety=safety))).solver["energy_drift"] for safety in (0.5, 0.25)]
    monkeypatch.setattr(central_difference, "DRIFT", np.sqrt(drifts[0] * drifts[1]))
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    refweb.run(case, out=whole)
    assert "repeated with safety = 0.25" in told(whole)["warnings"][0]
    own, made = central_difference.CentralDifference.advance, []

    def advance(self, course, times):
        if self.safety == 0.25 and course.time > 0.0105:
            raise KeyboardInterrupt
        return own(self, course, times)

    with monkeypatch.context() as patch:
        patch.setattr(central_difference.CentralDifference, "advance", advance)
        with pytest.raises(KeyboardInterrupt):
            refweb.run(case, out=cut)
    with monkeypatch.context() as patch:
        patch.setattr(central_difference.CentralDifference, "start", lambda self, *state: made.append(self))
        refweb.resume(cut)
    assert made == [] and told(cut) == told(whole)
    assert files(cut)["history.csv"] == files(whole)["history.csv"]


@pytest.mark.parametrize("pays, attempts, cut_at", [(True, 5, 2), (False, 3, 1), (False, 3, 3)])
def test_a_run_that_goes_on_has_no_more_attempts(tmp_path, monkeypatch, pays, attempts, cut_at):
    """A book that never closes ends the run after as many attempts, wherever one of them was interrupted."""
    monkeypatch.setattr(refweb.dynamics.accuracy_loop, "MOST_ATTEMPTS", 5)
    monkeypatch.setattr(refweb.dynamics.schedule, "MOST_ROWS", 1)  # what is told is counted in blocks, not by the clock
    own, interrupting = central_difference.CentralDifference.advance, []

    def advance(self, course, times):
        attempt = round(np.log2(0.5 / self.safety)) + 1  # each has half the step of that before
        if interrupting and attempt == cut_at and course.time > 0.0105:
            raise KeyboardInterrupt
        if course.time > 0.0205:
            raise EnergyDriftError("the book is open", 0.25**attempt if pays else 0.5)
        return own(self, course, times)

    monkeypatch.setattr(central_difference.CentralDifference, "advance", advance)
    case, whole, cut = scene(), tmp_path / "whole", tmp_path / "cut"
    with pytest.raises(EnergyDriftError):
        refweb.run(case, out=whole)
    interrupting.append(True)
    with pytest.raises(KeyboardInterrupt):
        refweb.run(case, out=cut)
    interrupting.clear()
    with pytest.raises(EnergyDriftError):
        refweb.resume(cut)
    assert len(told(whole)["warnings"]) == attempts - 1 and told(cut) == told(whole)


def test_a_resumed_run_can_be_resumed(tmp_path, monkeypatch):
    """Also where it ended in its own last row, and its errors were still to be found."""
    case, whole, cut = scene(error="twin", frames=3), tmp_path / "whole", tmp_path / "cut"
    refweb.run(case, out=whole)
    for attempt, end in enumerate((-1.0, 0.0045, 0.0125, 0.0205)):
        restore = stop_behind(monkeypatch, end)
        with pytest.raises(KeyboardInterrupt):
            refweb.resume(cut) if attempt else refweb.run(case, out=cut)
        restore()
        opens(cut)

    def lost(*arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(refweb.dynamics.twin_error, "with_errors", lost)
        with pytest.raises(KeyboardInterrupt):
            refweb.resume(cut)
    assert opens(cut) == 31
    refweb.resume(cut)
    expected, found = files(whole), files(cut)
    assert [key for key in expected if expected[key] != found[key]] == ["run.json"] and told(cut) == told(whole)


def spoil_history(folder):
    lines = (folder / "history.csv").read_text().splitlines(keepends=True)
    (folder / "history.csv").write_text("".join(lines[:3]))


def other_web(folder):
    text = (folder / "scene.toml").read_text()
    (folder / "scene.toml").write_text(text.replace("rows = 4", "rows = 5"))


REFUSED = {
    "no folder": (shutil.rmtree, "there is no such folder"),
    "no run.json": (lambda folder: (folder / "run.json").unlink(), "holds no run.json"),
    "no scene": (lambda folder: (folder / "scene.toml").unlink(), "holds no run.json and scene.toml"),
    "history too short": (spoil_history, "is not the history that checkpoint.npz belongs to"),
    "no history": (lambda folder: (folder / "history.csv").unlink(), "history.csv: cannot be read"),
    "checkpoint cut": (lambda f: os.truncate(f / "checkpoint.npz", 500), "is not what a run of refweb writes"),
    "other web": (other_web, "scene.toml is not that of the run any more"),
}


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("interrupted") / "run"
    with pytest.MonkeyPatch.context() as patch:
        restore = stop_behind(patch, 0.0105)
        with pytest.raises(KeyboardInterrupt):
            refweb.run(scene(), out=folder)
        restore()
    return folder


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_resumed(tmp_path, capsys, interrupted, name):
    """Exit status 2 and one line; nothing is written or removed."""
    spoil, message = REFUSED[name]
    folder = tmp_path / "run"
    shutil.copytree(interrupted, folder)
    spoil(folder)
    before = files(folder) if folder.exists() else {}
    assert main(["resume", str(folder)]) == 2
    err = capsys.readouterr().err
    assert message in err and err.count("\n") == 1
    assert (files(folder) if folder.exists() else {}) == before


EDITS = [("density = ", "density = 1"), ("duration = ", "duration = 1"), ('title = "', 'title = "x')]


@pytest.mark.parametrize("edit", EDITS)
def test_a_run_whose_scene_was_edited_is_not_resumed(tmp_path, capsys, interrupted, edit):
    """What went before is not that of the edited scene, whatever of it was edited."""
    folder = tmp_path / "run"
    shutil.copytree(interrupted, folder)
    text = (folder / "scene.toml").read_text()
    assert edit[0] in text
    (folder / "scene.toml").write_text(text.replace(*edit))
    before = files(folder)
    assert main(["resume", str(folder)]) == 2
    assert "scene.toml is not that of the run any more" in capsys.readouterr().err and files(folder) == before
    (folder / "scene.toml").write_text(text)
    assert main(["resume", str(folder)]) == 0


def test_an_edit_in_the_middle_of_a_run_is_seen(tmp_path, capsys):
    """The checkpoint goes with the scene that is run, not with what stands in its file by then."""
    file = tmp_path / "run" / "scene.toml"

    def edit(text, share):
        if share > 0.2:
            file.write_text(file.read_text() + "# edited\n")
        if share > 0.8:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refweb.run(scene(), out=tmp_path / "run", progress=edit)
    assert (tmp_path / "run" / "checkpoint.npz").exists()
    assert main(["resume", str(tmp_path / "run")]) == 2
    assert "scene.toml is not that of the run any more" in capsys.readouterr().err


def test_solved_and_static_runs_are_not_resumed(tmp_path, capsys, interrupted):
    folder = tmp_path / "run"
    shutil.copytree(interrupted, folder)
    assert main(["resume", str(folder)]) == 0
    assert main(["resume", str(folder)]) == 2
    assert "solved run: there is nothing to continue" in capsys.readouterr().err
    static = refweb.Scene(web=WEB, cable=CABLE, solve=refweb.Static(load_steps=[0.0]))
    refweb.run(static, out=tmp_path / "static")
    text = (tmp_path / "static" / "run.json").read_text()
    (tmp_path / "static" / "run.json").write_text(text.replace('"solved"', '"interrupted"'))
    assert main(["resume", str(tmp_path / "static")]) == 2
    assert "no dynamic run" in capsys.readouterr().err


def test_a_diagram_is_not_resumed(tmp_path, capsys, interrupted):
    """The folder of ``refweb cost`` holds no run to go on with, and keeps what it holds."""
    folder = tmp_path / "run"
    shutil.copytree(interrupted, folder)
    (folder / "run.json").write_text(json.dumps({**summary_of(folder), "kind": "cost"}))
    (folder / "cost.csv").write_text("method\n")
    before = files(folder)
    assert main(["resume", str(folder)]) == 2
    assert "no dynamic run" in capsys.readouterr().err and files(folder) == before


@pytest.mark.ordinary("run.json-{")
@pytest.mark.parametrize("name, content", [("checkpoint.npz", None), ("run.json", b"{")])
def test_a_spoilt_folder_is_still_drawn(tmp_path, interrupted, name, content):
    """Supports and title are then those that frames and the folder's name tell."""
    folder = tmp_path / "run"
    shutil.copytree(interrupted, folder)
    path = folder / name
    path.write_bytes(path.read_bytes()[:-100] if content is None else content)
    assert main(["picture", str(folder)]) == 0
    assert (folder / "web.png").stat().st_size > 10_000


def test_a_static_row_that_cannot_be_written(tmp_path, monkeypatch, capsys):
    """The first one: the message is that of the disk."""

    def full(self, numbers):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(refweb.results.folder.Folder, "row", full)
    assert main(["run", "square-load", "--out", str(tmp_path / "out")]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "No space left on device" in err


def test_other_versions_are_told(tmp_path, interrupted):
    folder = tmp_path / "run"
    shutil.copytree(interrupted, folder)
    text = re.sub(r'"numba": "[^"]+"', '"numba": "0.1"', (folder / "run.json").read_text())
    (folder / "run.json").write_text(text)
    (warning,) = refweb.resume(folder).warnings
    assert warning.startswith("resumed with numba") and "after 0.1" in warning


@pytest.mark.parametrize("effects", [HIT, (HIT[1], refweb.Thrust(node=5, line=4, force=1.0), *HIT[:1])])
def test_effects_keep_their_order_in_a_folder(tmp_path, effects):
    """Sums are taken in that order; a table that fits on one line stays where it stands."""
    case = scene(effects=(refweb.Gravity(acceleration=(0, 0, -1)), *effects), duration=1e-3)
    refweb.run(case, out=tmp_path)
    again = refweb.Scene.load(tmp_path / "scene.toml")
    assert again.effects == case.effects and again.to_dict() == case.to_dict()


# Disks that are full, folders that are gone


@pytest.fixture
def small_disk(tmp_path):
    """A disk of 200 kB."""
    place = tmp_path / "disk"
    place.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=200k", "none", place], capture_output=True)
    if made.returncode:
        pytest.skip("no small disk can be mounted here")
    yield place
    subprocess.run(["umount", place], check=True)


def test_full_disk(tmp_path, small_disk, capsys):
    """Status 1 and one line; what was written is whole, and where there is space again the run goes on to its end."""
    case, out, source = scene(frames=1), small_disk / "run", tmp_path / "hit.toml"
    refweb.run(case, out=tmp_path / "whole")
    shutil.copy(tmp_path / "whole" / "scene.toml", source)
    for size in range(40, 160, 19):  # the disk gets full in a frame, a checkpoint, the history, a list
        (small_disk / "ballast").write_bytes(bytes(1000 * size))
        assert main(["run", str(source), "--out", str(out)]) == 1
        err = capsys.readouterr().err
        assert err.count("\n") == 1 and "cannot be written any more: No space left on device" in err
        if not (out / "run.json").exists():  # not even this had space
            assert not any(p.is_file() for p in out.rglob("*"))
            continue
        opens(out)
        again = tmp_path / f"again{size}"
        shutil.copytree(out, again)
        shutil.rmtree(out)
        if (again / "scene.toml").exists():
            refweb.resume(again)
            expected, found = files(tmp_path / "whole"), files(again)
            assert [key for key in expected if expected[key] != found.get(key)] == ["run.json"]
            assert told(again) == told(tmp_path / "whole")


@pytest.mark.parametrize("kind", ["dynamic", "static"])
def test_full_disk_before_the_start(tmp_path, small_disk, capsys, kind):
    (small_disk / "ballast").write_bytes(bytes(196_000))
    solve = refweb.Static(load_steps=[0.0, 0.5]) if kind == "static" else refweb.Dynamic(duration=0.01)
    refweb.run(refweb.Scene(web=WEB, cable=CABLE, solve=solve), out=tmp_path / "whole")
    assert main(["run", str(tmp_path / "whole" / "scene.toml"), "--out", str(small_disk / "run")]) == 1
    assert "No space left on device" in capsys.readouterr().err


def take_away(folder):
    shutil.rmtree(folder)


def make_a_file(folder):
    shutil.rmtree(folder / "frames")
    (folder / "frames").write_text("")


def forbid(folder):
    if os.geteuid() == 0:
        pytest.skip("nothing is forbidden to root")
    (folder / "frames").chmod(0o500)


@pytest.mark.parametrize("spoil", [take_away, make_a_file, forbid])
def test_folder_that_is_spoilt_while_a_run_writes_it(tmp_path, monkeypatch, capsys, spoil):
    refweb.run(scene(), out=tmp_path / "whole")
    own = central_difference.CentralDifference.advance

    def advance(self, course, times):
        if 0.0105 < course.time < 0.0125 and out.exists() and (out / "frames").is_dir():
            spoil(out)
        return own(self, course, times)

    out = tmp_path / "out"
    monkeypatch.setattr(central_difference.CentralDifference, "advance", advance)
    assert main(["run", str(tmp_path / "whole" / "scene.toml"), "--out", str(out)]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "cannot be written any more" in err and "internal" not in err


def test_a_run_that_finds_no_start(tmp_path, capsys):
    """Nodes that nothing holds: the folder is there already, so that the status is 1 and the folder says why."""
    bare = scene("ida", effects=(), cable=refweb.Cable(law="tension-only", modulus=7e7, area=1e-4, density=0.0))
    (tmp_path / "bare.toml").write_text(tomli_w.dumps(bare.to_dict()))
    assert main(["run", str(tmp_path / "bare.toml"), "--out", str(tmp_path / "out")]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "has no position at t = 0" in err
    assert opens(tmp_path / "out") == 0 and "no position" in summary_of(tmp_path / "out")["message"]


# kill -9


def in_child(call, *arguments, **named):
    """Start a call in a forked process; returns its id."""
    child = os.fork()
    if child:
        return child
    status = 1
    try:
        call(*arguments, **named)
        status = 0
    finally:
        os._exit(status)


def kill_often(count, folder, seed):
    """Kill a run ``count`` times, at moments over all of it, resume it, and compare it to the undisturbed one.

    Prints how many were killed before there was anything to resume, while running, and after their end.
    """
    case, chance, counts = scene(frames=1, error="twin", event=EVENTS), random.Random(seed), [0, 0, 0]
    whole, cut = folder / "whole", folder / "cut"
    refweb.run(case, out=folder / "first")  # kernels are compiled, modules are loaded
    began = time.perf_counter()
    os.waitpid(in_child(refweb.run, case, out=whole), 0)
    lasts = time.perf_counter() - began
    expected, first = files(whole), True
    for _ in range(count):
        again = not first and (cut / "scene.toml").exists()  # kill the run that goes on as well, now and then
        child = in_child(refweb.resume, cut) if again else in_child(refweb.run, case, out=cut)
        time.sleep(chance.uniform(0.0, lasts))
        os.kill(child, signal.SIGKILL)
        status = os.waitpid(child, 0)[1]
        if not (cut / "run.json").exists():
            counts[0] += 1
            assert not cut.exists() or not any(p.name[0] != "." for p in cut.iterdir())
        elif summary_of(cut)["status"] == "solved":
            counts[2] += 1
        else:
            assert os.WIFSIGNALED(status)
            counts[1] += 1
            opens(cut)
        if (cut / "scene.toml").exists() and summary_of(cut)["status"] != "solved":
            if chance.random() < 0.3:
                first = False
                continue
            refweb.resume(cut)
        if (cut / "run.json").exists() and summary_of(cut)["status"] == "solved":
            found = files(cut)
            differ = [key for key in expected.keys() | found.keys() if expected.get(key) != found.get(key)]
            assert [key for key in differ if ".refweb-" not in key] == ["run.json"], differ
            assert told(cut) == told(whole)
        shutil.rmtree(cut, ignore_errors=True)
        first = True
    print(*counts)


def kills(count, folder, seed):
    """How `kill_often` went, in a process that has one thread, which may fork."""
    command = [sys.executable, __file__, str(count), str(folder), str(seed)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60 + 20 * count)
    assert done.returncode == 0, done.stderr
    return [int(number) for number in done.stdout.split()]


def test_kills(tmp_path):
    before, during, after = kills(8, tmp_path, seed=1)
    assert before + during + after == 8 and during >= 1


@pytest.mark.slow
def test_two_hundred_kills(tmp_path):
    before, during, after = kills(200, tmp_path, seed=2)
    assert before + during + after == 200 and during >= 100


if __name__ == "__main__":
    kill_often(int(sys.argv[1]), pathlib.Path(sys.argv[2]), int(sys.argv[3]))
